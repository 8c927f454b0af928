// Nodes with both children's boxes as floats, tested in fewer operations than a triangle's own box: with products and
// sums that may be fused, and inverses by the driver's division. The boxes are grown by what that may err, so that a ray meets
// every box around a triangle whose own box it meets, and never later: `grown_pad` of src/pack.rs says by how much.
// Twin: src/reference/traverse/grown.rs.

// A ray crosses side p across an axis at p inverse + base.
struct GrownRay {
    vec3 inverse;
    vec3 base;
};

GrownRay grown_ray_of(Ray ray) {
    vec3 size = max(abs(ray.direction), vec3(SMALLEST_COMPONENT));
    vec3 inverse = mix(1.0 / size, -1.0 / size, lessThan(ray.direction, vec3(0.0)));
    return GrownRay(inverse, -ray.origin * inverse);
}

// Whether the ray meets the box from 0 to t_max. Crossings are compared as integers, of which a GPU takes the least or most of three at a
// time: from 0 on they have the floats' order, and of what lies before 0 it counts only that it does. An exit at -0 would
// be lost; but boxes are grown, so that a ray which leaves a triangle's own box at 0 or later leaves these above 0.
bool meets_grown(GrownRay ray, vec3 pmin, vec3 pmax, float t_max) {
    ivec3 t0 = floatBitsToInt(pmin * ray.inverse + ray.base);
    ivec3 t1 = floatBitsToInt(pmax * ray.inverse + ray.base);
    ivec3 near = min(t0, t1);
    ivec3 far = max(t0, t1);
    int enter = max(max(max(near.x, near.y), near.z), 0);
    int leave = min(min(min(far.x, far.y), far.z), floatBitsToInt(t_max));
    return enter <= leave;
}
