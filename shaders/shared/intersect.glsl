// Ray against triangle. Twin: src/reference/intersect.rs.

#include "work.glsl"

// Moeller and Trumbore (1997): distance in units of the direction and barycentric coordinates of the second and third
// corner, before the division by `det`. With CONSERVATIVE each of them may be off by as much as rounding can do, so that
// what the exact ray meets is met: no ray leaves a closed mesh. src/reference/intersect.rs derives the errors.
bool meets_moller(Ray ray, float error, Triangle triangle, out float det, out vec3 tuv) {
    vec3 p = cross3(ray.direction, triangle.ac);
    det = dot3(triangle.ab, p);
    float side = det < 0.0 ? -1.0 : 1.0;
    precise vec3 s = ray.origin - triangle.a;
    vec3 q = cross3(s, triangle.ab);
    det = abs(det);
    float u = side * dot3(s, p);
    float v = side * dot3(ray.direction, q);
    float t = side * dot3(triangle.ac, q);
    precise float u_plus_v = u + v;
    if (!CONSERVATIVE) {
        tuv = vec3(t, u, v);
        return det > SMALLEST_DETERMINANT && u >= 0.0 && v >= 0.0 && u_plus_v <= det && t > 0.0;
    }
    precise float error_s = error * max_abs(s);
    precise float error_u = error_s * triangle.ac_sum;
    precise float error_v = error_s * triangle.ab_sum;
    precise float most = det + (error_u + error_v + error * triangle.ab_sum * triangle.ac_sum);
    // The point is brought into the triangle.
    float inside_u = min(max(u, 0.0), det);
    precise float rest = det - inside_u;
    tuv = vec3(t, inside_u, min(max(v, 0.0), rest));
    return det > SMALLEST_DETERMINANT && u >= -error_u && v >= -error_v && u_plus_v <= most && t > 0.0;
}

// The ray must also cross the triangle's own box as the robust slab test sees it, and the hit's distance is brought into
// that box: then every tree of boxes finds the same hits at the same distances, exactly. (Brought in, not compared: a flat
// box is thinner than the error of t.) The box is that of the edges as they round, with either intersector, for so are those
// of the tree.
bool guarded(Ray ray, Slabs slabs, Triangle triangle, float det, float t_max, inout vec3 tuv) {
    precise vec3 b = triangle.a + triangle.ab;
    precise vec3 c = triangle.a + triangle.ac;
    precise vec3 pmin = min(triangle.a, min(b, c)) - frame.box_pad;
    precise vec3 pmax = max(triangle.a, max(b, c)) + frame.box_pad;
    if (!ROBUST_SLABS) slabs.inverse = robust_inverse(ray.direction);
    vec2 interval = slab_interval(slabs, pmin, pmax, true);
    precise float scale = reciprocal(det);
    precise vec3 scaled = tuv * scale;
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

// A triangle of the array: its id, and (t, u, v) where the ray meets it at t_max or before.
bool intersect(Ray ray, Slabs slabs, int index, float t_max, out uint id, out vec3 tuv) {
    float det;
    if (WATERTIGHT) {
        Corners corners = load_corners(index);
        id = corners.id;
        return meets_watertight(ray.origin, slabs.shear, corners, det, tuv) &&
               guarded(ray, slabs, edges_of(corners), det, t_max, tuv);
    }
    Triangle triangle = load_edges(index);
    id = triangle.id;
    if (ORIGINAL) return intersect_original(ray, triangle, t_max, tuv);
    return meets_moller(ray, slabs.error, triangle, det, tuv) && guarded(ray, slabs, triangle, det, t_max, tuv);
}

// Keeps the closer hit; of equal ones the smaller id, so that the order of visits does not matter
// (the original kept the last).
void closest_of_triangle(Ray ray, Slabs slabs, int index, inout Hit hit) {
    COUNT_TEST();
    uint id;
    vec3 tuv;
    if (intersect(ray, slabs, index, hit.t, id, tuv) && (ORIGINAL || tuv.x < hit.t || id < hit.id)) {
        hit = Hit(tuv.x, tuv.y, tuv.z, uint(index), id);
    }
}

bool any_of_triangle(Ray ray, Slabs slabs, int index) {
    COUNT_TEST();
    uint id;
    vec3 tuv;
    return intersect(ray, slabs, index, ray.t_max, id, tuv);
}

// How far a box may lie to be worth opening: the original asked every box over its fixed range.
#define ORIGINAL_BOX_RANGE 1000.0

float box_limit(float t_closest) { return ORIGINAL ? ORIGINAL_BOX_RANGE : t_closest; }
