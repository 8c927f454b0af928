// Arithmetic that gives the same bits on every device: additions and multiplications that must not
// be contracted, in a written order, and nothing whose precision the API leaves to the driver
// (division, square root, sine). Twin: src/reference/arith.rs.

// Smallest determinant taken for a triangle that a ray can meet, 2^-120: below it `reciprocal` overflows.
#define SMALLEST_DETERMINANT 7.52316384526264e-37
// 2^120: from here on it underflows.
#define LARGEST_DETERMINANT 1.329227995784916e36

float dot3(vec3 a, vec3 b) {
    precise float sum = a.x * b.x + a.y * b.y + a.z * b.z;
    return sum;
}

vec3 cross3(vec3 a, vec3 b) {
    precise vec3 c = vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
    return c;
}

// Error of the triple product of (direction, s, edge) of three components each, in parts of the largest component of s
// and the sum of the edge's: src/reference/intersect.rs.
float error_of(vec3 direction) {
    vec3 size = abs(direction);
    // 9 x 2^-24
    precise float error = (size.x + size.y + size.z) * 5.36441802978515625e-7;
    return error;
}

float max_abs(vec3 v) { return max(abs(v.x), max(abs(v.y), abs(v.z))); }

// 1/x for 2^-120 < x < 2^120, within 2 ulp: a guess from the exponent (within 1/8), which four Newton
// steps square four times.
float reciprocal(float x) {
    precise float r = uintBitsToFloat(0x7ef311c7u - floatBitsToUint(x));
    for (int i = 0; i < 4; i++) {
        precise float error = 2.0 - x * r;
        r = r * error;
    }
    return r;
}

// 1/sqrt(x) for 2^-120 < x < 2^120, within 3 ulp, in the same way; finite for x = 0.
float reciprocal_sqrt(float x) {
    precise float r = uintBitsToFloat(0x5f3759dfu - (floatBitsToUint(x) >> 1));
    precise float half_x = 0.5 * x;
    for (int i = 0; i < 4; i++) {
        precise float error = 1.5 - half_x * r * r;
        r = r * error;
    }
    return r;
}

// (cos, sin) of 2 pi u for 0 <= u <= 1, within 2^-22: an eighth of a turn by Taylor polynomials.
vec2 cos_sin_turn(float u) {
    precise float quarter = floor(u * 4.0 + 0.5);
    precise float x = (u - quarter * 0.25) * 6.28318530717958648;
    precise float x2 = x * x;
    precise float c = 1.0 + x2 * (-0.5 + x2 * (4.16666667e-2 + x2 * (-1.38888889e-3 + x2 * 2.48015873e-5)));
    precise float s = x + x * x2 * (-0.166666667 + x2 * (8.33333333e-3 + x2 * (-1.98412698e-4 + x2 * 2.75573192e-6)));
    int turn = int(quarter) & 3;
    vec2 odd = (turn & 1) == 1 ? vec2(-s, c) : vec2(c, s);
    return (turn & 2) == 2 ? -odd : odd;
}
