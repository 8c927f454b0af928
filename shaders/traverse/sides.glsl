// A triangle as seen from where rays start: what the planes through the start and its edges enclose. Whether a direction lies within is the
// sign of a product for each edge; how far from 0 one has to be to be sure of what the exact test says.
// Only for the conservative intersector. Twin: src/reference/traverse/sides.rs.

// Edge functions are measured in the most that rounding may change them, and moved up by that, so that below 0 a direction is
// outside and above twice that within. In sizes of start, edges and direction it is 2^-17: eight times S, what `error_of` grants
// for the three together, with the sum of a direction's components at most 1.74. What the exact test accepts lies within
// 2 S of the triangle, for it errs by S and grants it, and edge functions round by 1.3 S here.
#define EDGE_ERROR 7.62939453125e-6

// A triangle as seen from the start.
struct Side {
    // Zero along the edges ac, ab and bc, positive within.
    vec3 u;
    vec3 v;
    vec3 w;
    float error;
    // Too close to the plane to tell.
    bool near;
};

Side side_from(vec3 start, Triangle triangle) {
    precise vec3 s = start - triangle.a;
    vec3 q = cross3(s, triangle.ab);
    // As meets_moller rounds it.
    float volume = dot3(triangle.ac, q);
    // A CPU finds the largest integer in one operation, the largest float in three.
    float size = intBitsToFloat(max(max(floatBitsToInt(abs(s.x)), floatBitsToInt(abs(s.y))), floatBitsToInt(abs(s.z))));
    float product = triangle.ab_sum * triangle.ac_sum;
    Side side;
    side.near = abs(volume) < EDGE_ERROR * size * product;
    side.error = EDGE_ERROR * (size * (triangle.ab_sum + triangle.ac_sum) + product);
    float sign = volume < 0.0 ? -1.0 : 1.0;
    vec3 ac = triangle.ac * sign;
    side.u = cross(ac, s);
    side.v = q * sign;
    side.w = cross(ac, triangle.ab) - side.u - side.v;
    return side;
}
