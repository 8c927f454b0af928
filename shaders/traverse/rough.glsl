// What of a ray and a triangle is sure whatever rounding does, by products and sums that may be fused and without the triangle's own box:
// far fewer operations than the exact test, which is asked of what is left. Of rays without an end.
// Twin: src/reference/traverse/rough.rs, which derives what is left open.

#define MISSES 0
#define MAY_MEET 1
#define MEETS 2

// Four times `error_of`: either form may be off by the error, the conservative intersector grants it once, and sums round.
#define ROUGH_ERROR 4.0
// The same of t, in which no direction is: 36 e.
#define ROUGH_ERROR_T 2.1457672119140625e-6

int rough_verdict(Ray ray, Triangle triangle) {
    precise vec3 s = ray.origin - triangle.a;
    vec3 p = cross(ray.direction, triangle.ac);
    vec3 q = cross3(s, triangle.ab);
    float det = dot(triangle.ab, p);
    // As `meets_moller` rounds it: where t is next to nothing its sign decides.
    uint side = floatBitsToUint(det) & 0x80000000u;
    float t = uintBitsToFloat(floatBitsToUint(dot3(triangle.ac, q)) ^ side);
    float u = uintBitsToFloat(floatBitsToUint(dot(s, p)) ^ side);
    float v = uintBitsToFloat(floatBitsToUint(dot(ray.direction, q)) ^ side);
    det = abs(det);
    float error = ROUGH_ERROR * error_of(ray.direction);
    float size = max_abs(s);
    float error_s = error * size;
    float error_u = error_s * triangle.ac_sum;
    float error_v = error_s * triangle.ab_sum;
    float product = triangle.ab_sum * triangle.ac_sum;
    float error_det = error * product;
    float error_sum = error_u + error_v + error_det;
    // With these det is beyond its error, too.
    bool meets = u >= error_u && v >= error_v && u + v + error_sum <= det && t > ROUGH_ERROR_T * size * product &&
                 det > 2.0 * SMALLEST_DETERMINANT;
    bool inside = u >= -error_u && v >= -error_v && u + v <= det + error_sum && t > 0.0;
    // Where the sign of det is open, either one has |u| and |v| within this.
    bool edge_on = det <= error_det && max(abs(u), abs(v)) <= det + 2.0 * error_sum;
    return meets ? MEETS : inside || edge_on ? MAY_MEET : MISSES;
}

// Of what it tells nothing the exact test decides: of other intersectors, and of rays with an end, for which many triangles lie too far.
bool decides_exactly(Ray ray) { return WATERTIGHT || ORIGINAL || (BOUNDED && ray.t_max < UNBOUNDED); }

int verdict_of(Ray ray, int index) {
    if (decides_exactly(ray)) return any_of_triangle(ray, slabs_of(ray), index) ? MEETS : MISSES;
    COUNT_TEST();
    return rough_verdict(ray, load_edges(index));
}

// Of a triangle whose verdict was not MISSES.
bool does_meet(Ray ray, int index) {
    return decides_exactly(ray) || rough_verdict(ray, load_edges(index)) == MEETS || any_of_triangle(ray, slabs_of(ray), index);
}
