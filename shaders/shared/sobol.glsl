// Owen-scrambled Sobol points, two dimensions, of any length up to 2^32. Twin: src/reference/sobol.rs.
//
// Digits are kept in reverse: bit k of a word is the digit of 2^-(k+1). Then the first dimension (van der Corput's)
// is the index itself, and the second one's matrix is Pascal's triangle modulo 2: digit r is the sum of the index's bits
// j with binomial(j, r) odd. By Lucas (1878) those are the j whose own bits contain r's, so five steps, one a bit of j,
// do it (Sobol 1967; the first two dimensions of Joe and Kuo 2008).

uint pascal_product(uint index) {
    index ^= (index >> 1) & 0x55555555u;
    index ^= (index >> 2) & 0x33333333u;
    index ^= (index >> 4) & 0x0f0f0f0fu;
    index ^= (index >> 8) & 0x00ff00ffu;
    return index ^ (index >> 16);
}

// Nested uniform scrambling (Owen 1995): each digit is turned or not by a hash of the seed and the digits above it.
// Multiplication carries from low bits to high ones, which is from digits to lesser digits here: Laine and Karras (2011), made
// practical by Burley (2020), with the better constants of Vegdahl (2021). Seeds must be random words.
uvec2 owen_scramble(uvec2 digits, uvec2 seed) {
    digits ^= digits * 0x3d20adeau;
    digits += seed;
    digits *= (seed >> 16) | 1u;
    digits ^= digits * 0x05526c56u;
    digits ^= digits * 0x53a22864u;
    return digits;
}

// Burley also shuffles the indices, so that pairs of dimensions under several seeds can be joined. There is only one pair
// here, and scrambling alone makes each point uniform and other seeds' points independent; so a point's
// place is its index, and no index is too large.
uvec2 sobol_digits(uint index) { return uvec2(index, pascal_product(index)); }

uvec2 sobol_bits(uvec2 digits, uvec2 seed) { return bitfieldReverse(owen_scramble(digits, seed)); }

// The order of a half's points. Those of a go are cut into nets, stretches of 2^bits points that begin at a multiple of that, and each is
// taken cell by cell of a grid over the unit square, which is the same for all pixels, so that neighbouring lanes' rays stay together. It is
// the same points in the end, each pixel's own and independent of the others', and the same counts. The grid has 4 x 8 cells, in smaller
// nets one for each point.

// The largest net within begin to end around this index: where its bits part from those of the end, which are beyond it, and from those of the
// last index before it. (A CPU device asks beyond the last sample too, where there is none.)
uint net_bits(uint index, uint begin, uint end) {
    int bits = findMSB(index ^ end);
    return uint(max(begin == 0u ? bits : min(bits, findMSB(index ^ (begin - 1u))), 0));
}

// The first digits that scrambling turns into those of the cell: each digit's turn depends on those above it.
uvec2 unscrambled(uvec2 cell, uvec2 seed) {
    // owen_scramble backwards, modulo 8: products by even numbers are undone digit by digit, and the square of an odd number is 1.
    cell ^= cell << 2;
    uvec2 digits = cell ^ (cell * 6u);
    digits = cell ^ (digits * 6u);
    digits = digits * ((seed >> 16) | 1u) - seed;
    return (digits ^ (digits << 1) ^ (digits << 2)) & 7u;
}

// The first bit of a cell's number halves the azimuth, the next one the height, and so on: what comes in a row lies together.
uvec2 digits_of_cell(uint cell) {
    return uvec2((cell >> 3 & 1u) | (cell & 2u), (cell >> 4) | (cell >> 1 & 2u) | (cell << 2 & 4u));
}

// The digits (index and second dimension) of point `place` in that order of the 2^bits points of a net. The cell's
// digits of the first dimension are the index's lowest two bits. Those of the second are sums of index bits (the rows of Pascal's
// triangle), which are solved for the next three bits. Being sums, they are those of the bits below 32 and of those
// from there on, which are the same for all pixels.
uvec2 sobol_digits_by_cell(uint first, uint place, uint bits, uvec2 seed) {
    uint inner = bits - SOBOL_CELL_BITS;
    uvec2 wanted = unscrambled(digits_of_cell(place >> inner), seed);
    uint high = first + ((place & ((1u << inner) - 1u)) << SOBOL_CELL_BITS);
    uint second = pascal_product(high);
    uint low = wanted.x & 3u;
    uint missing = second ^ wanted.y ^ low ^ (low >> 1);
    uint bit2 = (missing ^ (missing << 1)) & 4u;
    uint bit3 = (missing << 2) & 8u;
    uint bit4 = ((missing << 4) ^ (missing << 2)) & 16u;
    return uvec2(high | low | bit2 | bit3 | bit4, (second & ~7u) ^ wanted.y ^ bit3 ^ bit4);
}

// The same of a net of up to 16 points, a cell each, so that only the first `bits` of a cell's digits count: half of the index's lowest bits
// are those of the first dimension, and the others are solved for.
uvec2 sobol_digits_of_few(uint first, uint place, uint bits, uvec2 seed) {
    uvec2 wanted = unscrambled(digits_of_cell(place << (SOBOL_CELL_BITS - bits)), seed);
    uint low = wanted.x & ((1u << (bits >> 1)) - 1u);
    uint index = first | low;
    uint missing = pascal_product(index) ^ wanted.y;
    if (bits == 1u) index |= missing & 1u;
    if (bits == 2u) index |= missing << 1 & 2u;
    if (bits == 3u) index |= (missing & 2u) | ((missing << 2 ^ missing << 1) & 4u);
    if (bits == 4u) index |= (missing << 2 & 8u) | ((missing << 2 ^ missing << 1) & 4u);
    return sobol_digits(index);
}

// A pixel has two sequences under seeds of their own, one for each half of its samples. A seed's low bits turn the first
// digits, and pcg4d's low bits are its weak ones, alike in pixels whose numbers are near: so its halves change places.
uvec4 sobol_seeds(uint pixel) {
    uvec4 words = pcg4d(uvec4(pixel, 0u, KEY_SOBOL, frame.seed));
    return (words << 16) | (words >> 16);
}

uvec2 sobol_seed(uint pixel, uint sample_index) {
    uvec4 seeds = sobol_seeds(pixel);
    return (sample_index & 1u) == 0u ? seeds.xy : seeds.zw;
}

// The same of any set of samples, which may be cut into nets of several sizes.
uvec2 sobol_digits_in_set(uint sample_index, uvec2 set, uvec2 seed) {
    uint index = sample_index >> 1;
    uint late = 1u - (sample_index & 1u);
    // The half's own begin and end: odd ones lie one index later in the earlier half.
    uint bits = net_bits(index, (set.x >> 1) + (set.x & late), (set.y >> 1) + (set.y & late));
    uint place = index & ((1u << bits) - 1u);
    if (bits >= SOBOL_CELL_BITS) return sobol_digits_by_cell(index - place, place, bits, seed);
    return sobol_digits_of_few(index - place, place, bits, seed);
}

// Bits of the cells of a set that the host knows to be one net, so that a kernel has no more text for them than it needs; or ANY_CELLS. A set that
// is another one all the same is taken in the order of its indices.
CONSTANT(SPEC_CELLS, uint, CELLS, ANY_CELLS);

// `seed`: that of the sample's half; `set`: the first sample of the go and the one behind its last.
vec2 sobol_point(uvec2 seed, uint sample_index, uvec2 set) {
    uint index = sample_index >> 1;
    uvec2 digits;
    if (REPEAT == 0u && CELLS == ANY_CELLS) {
        digits = sobol_digits_in_set(sample_index, set, seed);
    } else {
        uint samples = set.y - set.x;
        bool one_net = REPEAT == 0u && (samples & (samples - 1u)) == 0u && (set.x & (samples - 1u)) == 0u;
        uint place = index - (set.x >> 1);
        if (CELLS == SOBOL_CELL_BITS && one_net && samples >= 2u << CELLS) {
            digits = sobol_digits_by_cell(set.x >> 1, place, uint(findMSB(samples)) - 1u, seed);
        } else if (0u < CELLS && CELLS < SOBOL_CELL_BITS && one_net && samples == 2u << CELLS) {
            digits = sobol_digits_of_few(set.x >> 1, place, CELLS, seed);
        } else {
            digits = sobol_digits(index);
        }
    }
    return unit_floats(sobol_bits(digits, seed));
}

vec2 sobol_numbers(uint pixel, uint sample_index, uvec2 set) {
    return sobol_point(sobol_seed(pixel, sample_index), sample_index, set);
}
