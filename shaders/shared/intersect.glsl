// Ray against triangle. Twin: src/reference/intersect.rs.

#include "work.glsl"

// Smallest determinant taken for a triangle that the ray can meet: below it 1/det overflows.
#define SMALLEST_DETERMINANT 7.52316384526264e-37

// Moeller and Trumbore (1997), compared before the division. The ray must also cross the triangle's own
// box as the robust slab test sees it, and the hit's distance is brought into that box: then every tree of boxes
// finds the same hits at the same distances, exactly. (Brought in, not compared: a flat box is thinner
// than the error of t.) Distance: in units of the direction.
bool intersect_guarded(Ray ray, Slabs slabs, Triangle triangle, float t_max, out vec3 tuv) {
    tuv = vec3(0.0);
    vec3 p = cross3(ray.direction, triangle.ac);
    float det = dot3(triangle.ab, p);
    float side = det < 0.0 ? -1.0 : 1.0;
    precise vec3 s = ray.origin - triangle.a;
    vec3 q = cross3(s, triangle.ab);
    det = abs(det);
    float u = side * dot3(s, p);
    float v = side * dot3(ray.direction, q);
    float t = side * dot3(triangle.ac, q);
    precise float u_plus_v = u + v;
    if (!(det > SMALLEST_DETERMINANT && u >= 0.0 && v >= 0.0 && u_plus_v <= det && t > 0.0)) {
        return false;
    }
    precise vec3 b = triangle.a + triangle.ab;
    precise vec3 c = triangle.a + triangle.ac;
    precise vec3 pmin = min(triangle.a, min(b, c)) - frame.box_pad;
    precise vec3 pmax = max(triangle.a, max(b, c)) + frame.box_pad;
    if (!ROBUST_SLABS) slabs = robust_slabs_of(ray);
    vec2 interval = slab_interval(slabs, pmin, pmax, true);
    precise float scale = reciprocal(det);
    precise vec3 scaled = vec3(t, u, v) * scale;
    tuv = vec3(min(max(scaled.x, interval.x), interval.y), scaled.y, scaled.z);
    return max(interval.x, 0.0) <= interval.y && tuv.x <= t_max;
}

// The original's form: the division is not guarded, so a zero determinant gives NaN, which no
// comparison rejects.
bool intersect_original(Ray ray, Triangle triangle, float t_max, out vec3 tuv) {
    tuv = vec3(0.0);
    vec3 p = cross(ray.direction, triangle.ac);
    float inverse = 1.0 / dot(triangle.ab, p);
    vec3 s = ray.origin - triangle.a;
    float u = dot(s, p) * inverse;
    if (u < 0.0 || u > 1.0) return false;
    vec3 q = cross(s, triangle.ab);
    float v = dot(ray.direction, q) * inverse;
    if (v < 0.0 || u + v > 1.0) return false;
    float t = dot(triangle.ac, q) * inverse;
    if (t < 0.0 || t > t_max) return false;
    tuv = vec3(t, u, v);
    return true;
}

bool intersect(Ray ray, Slabs slabs, Triangle triangle, float t_max, out vec3 tuv) {
    if (ORIGINAL) return intersect_original(ray, triangle, t_max, tuv);
    return intersect_guarded(ray, slabs, triangle, t_max, tuv);
}

// Keeps the closer hit; of equal ones the smaller id, so that the order of visits does not matter
// (the original kept the last).
void closest_of_triangle(Ray ray, Slabs slabs, int index, inout Hit hit) {
    COUNT_TEST();
    Triangle triangle = load_triangle(index);
    vec3 tuv;
    if (intersect(ray, slabs, triangle, hit.t, tuv) &&
        (ORIGINAL || tuv.x < hit.t || triangle.id < hit.id)) {
        hit = Hit(tuv.x, tuv.y, tuv.z, uint(index), triangle.id);
    }
}

bool any_of_triangle(Ray ray, Slabs slabs, int index) {
    COUNT_TEST();
    vec3 tuv;
    return intersect(ray, slabs, load_triangle(index), ray.t_max, tuv);
}

// How far a box may lie to be worth opening: the original asked every box over its fixed range.
#define ORIGINAL_BOX_RANGE 1000.0

float box_limit(float t_closest) { return ORIGINAL ? ORIGINAL_BOX_RANGE : t_closest; }
