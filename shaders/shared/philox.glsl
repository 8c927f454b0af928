// Philox2x32-10 of Salmon et al., "Parallel Random Numbers: As Easy as 1, 2, 3" (2011), which passes every test of
// BigCrush: two words for each counter and key. Twin: src/reference/philox.rs.

uvec2 philox2x32(uvec2 counter, uint key) {
    for (int i = 0; i < 10; i++) {
        uint high;
        uint low;
        umulExtended(0xd256d193u, counter.x, high, low);
        counter = uvec2(high ^ key ^ counter.y, low);
        key += 0x9e3779b9u;
    }
    return counter;
}

vec2 philox_numbers(uint pixel, uint sample_index) {
    return unit_floats(philox2x32(uvec2(pixel, sample_index), frame.seed));
}
