// Nodes with both children's boxes as centres and halves, tested in fewer operations than a triangle's own box: with products and
// sums that may be fused, and inverses by the driver's division. The boxes are grown by what that may err, so that a ray meets
// every box around a triangle whose own box it meets, and never later: `grown_pad` of src/pack.rs says by how much.
// Twin: src/reference/traverse/grown.rs.

// A ray crosses the plane at p across an axis at p inverse + base, and is `width` times as long within a slab as that is thick.
struct GrownRay {
    vec3 inverse;
    vec3 base;
    vec3 width;
};

GrownRay grown_ray_of(Ray ray) {
    vec3 size = max(abs(ray.direction), vec3(SMALLEST_COMPONENT));
    vec3 width = 1.0 / size;
    vec3 inverse = mix(width, -width, lessThan(ray.direction, vec3(0.0)));
    return GrownRay(inverse, -ray.origin * inverse, width);
}

// Whether the ray meets the box from 0 to t_max. From the centre's crossing to either side is a product of two sizes, so no side has to be
// told from the other: GPUs do products and sums at twice the rate of comparisons. Crossings are compared as integers, of which a GPU takes
// the least or most of three at a time: from 0 on they have the floats' order, and of what lies before 0 it counts only that
// it does. An exit at -0 would be lost; but boxes are grown, so that a ray which leaves a triangle's own box at 0 or later leaves
// these above 0.
bool meets_grown(GrownRay ray, vec3 center, vec3 extent, float t_max) {
    vec3 middle = center * ray.inverse + ray.base;
    ivec3 near = floatBitsToInt(middle - extent * ray.width);
    ivec3 far = floatBitsToInt(middle + extent * ray.width);
    int enter = max(max(max(near.x, near.y), near.z), 0);
    int leave = min(min(far.x, far.y), far.z);
    if (BOUNDED) leave = min(leave, floatBitsToInt(t_max));
    return enter <= leave;
}
