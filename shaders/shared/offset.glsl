// Where ambient rays leave their surface, off it by some ulps of the point. Twin: src/reference/offset.rs.

// Wächter and Binder, "A Fast and Robust Method for Avoiding Self-Intersection" (2019): each component moves along the normal by
// up to 256 ulps, as an integer, and near the origin, where ulps vanish, by a length that is fixed. Theirs are the errors
// of a point whose triangle is small beside its distance from the origin. Ours grow with the triangle, which may be as large as
// the scene: src/reference/offset.rs bounds them by 42 e L, or 66 with the watertight intersector, with e = 2^-24 and L the largest coordinate. So what is near
// reaches to L / 2, and the fixed length is 256 e L: no component that counts moves by less than half of that.
#define OFFSET_ULPS 256.0

vec3 moved_off(vec3 point, vec3 normal) {
    float near = 0.5 * frame.largest;
    // 2^-16
    float fixed_length = 1.52587890625e-5 * frame.largest;
    ivec3 steps = ivec3(OFFSET_ULPS * normal);
    precise vec3 by_length = point + fixed_length * normal;
    // Bits of floats count away from zero. (OpenGL 4.3 has no choice between vectors of integers.)
    ivec3 outward = ivec3(1) - 2 * ivec3(lessThan(point, vec3(0.0)));
    vec3 by_ulps = intBitsToFloat(floatBitsToInt(point) + outward * steps);
    return mix(by_ulps, by_length, lessThan(abs(point), vec3(near)));
}
