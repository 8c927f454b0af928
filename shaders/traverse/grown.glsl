// Nodes with both children's boxes as floats, tested in fewer operations than a triangle's own box: with products and
// sums that may be fused, and inverses by the driver's division. The boxes are grown by what that may err, so that a ray meets
// every box around a triangle whose own box it meets, and never later: `grown_pad` of src/pack.rs says by how much.
// Twin: src/reference/traverse/grown.rs.

#include "children.glsl"

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

vec2 grown_interval(GrownRay ray, vec3 pmin, vec3 pmax) {
    vec3 t0 = pmin * ray.inverse + ray.base;
    vec3 t1 = pmax * ray.inverse + ray.base;
    vec3 near = min(t0, t1);
    vec3 far = max(t0, t1);
    return vec2(max(max(near.x, near.y), near.z), min(min(far.x, far.y), far.z));
}

Children open_grown(GrownRay ray, int reference) {
    PairNode node = load_pair(reference);
    return Children(node.left, node.right,
                    vec4(grown_interval(ray, node.left_min, node.left_max), grown_interval(ray, node.right_min, node.right_max)));
}
