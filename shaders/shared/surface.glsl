// The surface point that a camera ray met, and the ambient rays that start there. Twin:
// src/reference/surface.rs.

#include "offset.glsl"

struct Surface {
    vec3 start;
    vec3 normal;
    vec3 tangent;
    vec3 bitangent;
};

// Barycentric coordinates place the point on the triangle to within its own rounding, however far the
// camera is. The normal faces the camera ray (the original's does not turn).
Surface surface_at(Ray ray, Hit hit) {
    Triangle triangle = load_triangle(int(hit.index));
    precise vec3 point = triangle.a + hit.u * triangle.ab + hit.v * triangle.ac;
    float largest = max(max_abs(triangle.ab), max_abs(triangle.ac));
    float scale = reciprocal(largest);
    precise vec3 ab = triangle.ab * scale;
    precise vec3 ac = triangle.ac * scale;
    vec3 normal = normalized(cross3(ab, ac));
    if (FACING && dot3(normal, ray.direction) > 0.0) {
        normal = -normal;
    }
    Surface surface;
    precise vec3 start = point + frame.offset * normal;
    surface.start = ULP_OFFSET ? moved_off(point, normal) : start;
    surface.normal = normal;
    basis_of(normal, surface.tangent, surface.bitangent);
    return surface;
}

// Where a camera ray met nothing the original still traced ambient rays, from nowhere.
Surface surface_nowhere() {
    vec3 nan = vec3(uintBitsToFloat(0x7fc00000u));
    return Surface(nan, nan, nan, nan);
}

Ray ambient_ray(Surface surface, vec2 u) {
    vec3 direction = cosine_direction(u, surface.normal, surface.tangent, surface.bitangent);
    return Ray(surface.start, direction, frame.ambient_t_max);
}

// The original's weight of an escaped ray: max(0, n.w) / (pi pdf) with pdf = cos(theta) / pi.
float original_weight(Surface surface, vec3 direction, vec2 u) {
    const float PI = 3.14159265358979;
    float pdf = sqrt(u.x) / PI;
    return max(0.0, dot(surface.normal, direction)) / (PI * pdf);
}
