// Ray against triangle without leaks between neighbours: Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection"
// (2013). Corners are sheared into the ray's own axes, each by itself, so that triangles which share a corner see it at
// one place of the plane across the ray; an edge passes the ray on the same side for both.
// Twin: src/reference/watertight.rs.

// The ray's largest axis (0 to 2), and what takes its direction to (0, 0, 1) from there.
struct Shear {
    uint axis;
    vec3 by;
};

// The two axes after the given one, and it.
vec3 turned(vec3 v, uint axis) { return axis == 0u ? v.yzx : axis == 1u ? v.zxy : v; }

// Directions whose largest component lies between these are followed, 2^-70 and 2^70; any other, and one that is no number,
// meets nothing. Beyond them the slab test's stand-in for zero would count, and products would leave the range of floats.
#define SMALLEST_DIRECTION 8.470329472543003e-22
#define LARGEST_DIRECTION 1.180591620717411303e21

Shear shear_of(vec3 direction) {
    vec3 size = abs(direction);
    uint axis = size.x > size.y ? (size.x > size.z ? 0u : 2u) : (size.y > size.z ? 1u : 2u);
    vec3 d = turned(direction, axis);
    float length = abs(d.z);
    float along = length > SMALLEST_DIRECTION && length < LARGEST_DIRECTION ? reciprocal(length) : 0.0;
    along = d.z < 0.0 ? -along : along;
    precise vec2 across = d.xy * along;
    return Shear(axis, vec3(across, along));
}

vec3 sheared(vec3 corner, vec3 origin, Shear shear) {
    precise vec3 from_origin = corner - origin;
    vec3 v = turned(from_origin, shear.axis);
    precise vec2 across = v.xy - shear.by.xy * v.z;
    return vec3(across, v.z);
}

// a b = product + error, exactly, while neither over- nor underflows: Dekker, "A Floating-Point Technique for Extending
// the Available Precision" (1971).
float error_of_product(float a, float b, float product) {
    precise float big_a = a * 4097.0;
    precise float big_b = b * 4097.0;
    precise float high_a = big_a - (big_a - a);
    precise float high_b = big_b - (big_b - b);
    precise float low_a = a - high_a;
    precise float low_b = b - high_b;
    precise float error = ((high_a * high_b - product) + high_a * low_b + low_a * high_b) + low_a * low_b;
    return error;
}

// Below this, 2^-76, the error of a product may underflow.
#define SMALLEST_PRODUCT 1.3234889800848443e-23

// Twice the area of the triangle (0, p, q), within 3 e of itself (e = 2^-24): the difference of two products, which is exact
// where it cancels, and their errors. Where both products are below 2^-76, their difference as it rounds.
float edge_area(vec2 p, vec2 q) {
    precise float left = p.x * q.y;
    precise float right = p.y * q.x;
    precise float area = left - right;
    if (max(abs(left), abs(right)) >= SMALLEST_PRODUCT) {
        float left_error = error_of_product(p.x, q.y, left);
        float right_error = error_of_product(p.y, q.x, right);
        precise float high = area + left_error;
        precise float low = left_error - (high - area);
        precise float sum = (high - right_error) + low;
        area = sum;
    }
    return area;
}

// The same with no more than the sign right, for rounding keeps the order of two products.
float edge_side(vec2 p, vec2 q) {
    precise float left = p.x * q.y;
    precise float right = p.y * q.x;
    precise float side = left - right;
    if (side == 0.0) side = edge_area(p, q);
    return side;
}

// Distance (in units of the direction) and barycentric coordinates of the second and third corner, before the division by
// `det`, which is positive where there is a hit. What is kept of the many triangles that are tested is computed anew, so that
// the distance is that of a point of the triangle, however the ray grazes it.
bool meets_watertight(vec3 origin, Shear shear, Corners corners, out float det, out vec3 tuv) {
    det = 0.0;
    tuv = vec3(0.0);
    vec3 a = sheared(corners.a, origin, shear);
    vec3 b = sheared(corners.b, origin, shear);
    vec3 c = sheared(corners.c, origin, shear);
    float u = edge_side(c.xy, b.xy);
    float v = edge_side(a.xy, c.xy);
    float w = edge_side(b.xy, a.xy);
    if (min(min(u, v), w) < 0.0 && max(max(u, v), w) > 0.0) return false;
    bool ahead = shear.by.z > 0.0 ? max(max(a.z, b.z), c.z) > 0.0 : min(min(a.z, b.z), c.z) < 0.0;
    if (!ahead) return false;
    u = edge_area(c.xy, b.xy);
    v = edge_area(a.xy, c.xy);
    w = edge_area(b.xy, a.xy);
    precise float sum = u + v + w;
    precise float along = u * a.z + v * b.z + w * c.z;
    precise float t = along * shear.by.z;
    float side = sum < 0.0 ? -1.0 : 1.0;
    det = abs(sum);
    tuv = side * vec3(t, v, w);
    return det > SMALLEST_DETERMINANT && det < LARGEST_DETERMINANT && tuv.x > 0.0;
}
