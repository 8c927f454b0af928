// Jittered strata: each half of a set of samples has one point in each of as many cells of equal area. All pixels go
// through the cells in the same order, so that neighbouring lanes' rays stay together, and every point has a jitter of
// its own, so that their errors are independent. Twin: src/reference/strata.rs.
//
// Any number of cells will do: they stand in rows along u1, the first of which may have one cell more than the others, and
// a row is as high as its share of the cells. u1 is the height of the direction, u2 its azimuth, so rows are rings
// and the order is a spiral: a ring begins where the last one ended.

struct Stratum {
    // Cells of this half, those in rows before this one, those of this row, the place in it.
    uint count;
    uint first;
    uint columns;
    uint column;
    // 1 / columns.
    float width;
};

// A quarter as many rows as columns (docs/measurements.md): r with (2 r - 1)^2 <= count < (2 r + 1)^2. The float is off
// by less than one.
uint strata_rows(uint count) {
    float size = float(count);
    precise float guess = 0.5 * (size * reciprocal_sqrt(size)) + 0.5;
    uint rows = max(uint(guess), 1u);
    if ((2u * rows - 1u) * (2u * rows - 1u) > count) rows--;
    if ((2u * rows + 1u) * (2u * rows + 1u) <= count) rows++;
    return rows;
}

// The cell of the sample at `place` of a set. Its halves are the even and the odd places; they differ by one cell at most, so
// they share rows and widths, which depend on the set alone.
Stratum stratum_of(uint place, uint samples) {
    uint fewer = samples >> 1;
    uint odd = samples & 1u;
    uint rows = strata_rows(fewer + odd);
    uint narrow = fewer / rows;
    float wide_width = reciprocal(float(narrow + 1u));
    float narrow_width = reciprocal(float(max(narrow, 1u)));

    Stratum stratum;
    stratum.count = max(fewer + ((place & 1u) == 0u ? odd : 0u), 1u);
    uint cell = place >> 1;
    uint wide_cells = (stratum.count - narrow * rows) * (narrow + 1u);
    bool wide = cell < wide_cells;
    stratum.columns = wide ? narrow + 1u : narrow;
    stratum.width = wide ? wide_width : narrow_width;
    uint among = wide ? cell : cell - wide_cells;
    // A row too far or too near at most, since there are less than 2^15.
    precise float row = float(among) * stratum.width;
    int column = int(among - uint(row) * stratum.columns);
    if (column < 0) column += int(stratum.columns);
    if (column >= int(stratum.columns)) column -= int(stratum.columns);
    stratum.column = uint(column);
    stratum.first = cell - stratum.column;
    return stratum;
}

vec2 strata_numbers(uint pixel, uint sample_index, uvec2 set) {
    uint samples = max(set.y - set.x, 1u);
    uint place = sample_index - set.x;
    if (REPEAT > 0u) place %= samples;
    Stratum stratum = stratum_of(place, samples);
    vec2 jitter = unit_floats(pcg4d(uvec4(pixel, sample_index, KEY_STRATA, frame.seed)).xy);
    float share = reciprocal(float(stratum.count));
    precise vec2 u = vec2((float(stratum.first) + float(stratum.columns) * jitter.x) * share,
                          (float(stratum.column) + jitter.y) * stratum.width);
    // Rounding may reach 1.
    return min(u, vec2(0.999999940395355225));
}
