// Which of a node's children any-hit rays go on to, whether its boxes are kept by their sides or by their centres. Twin: `met_children` of
// src/reference/traverse/grown.rs, and of pair nodes what ordered.rs gives to children.rs.

#ifdef USES_ANY

#ifdef NODES_CENTRED
#include "grown.glsl"
#endif

// A node's children, and which of their boxes the ray meets up to t_max.
#ifdef NODES_CENTRED
#define BOX_RAY GrownRay
#define BOX_RAY_OF(ray, slabs) grown_ray_of(ray)
bvec2 met_children(GrownRay ray, int reference, float t_max, out ivec2 children) {
    CentredNode node = load_centred(reference);
    children = ivec2(node.left, node.right);
    return bvec2(meets_grown(ray, node.left_center, node.left_half, t_max),
                 meets_grown(ray, node.right_center, node.right_half, t_max));
}
#else
#define BOX_RAY Slabs
#define BOX_RAY_OF(ray, slabs) slabs
bvec2 met_children(Slabs slabs, int reference, float t_max, out ivec2 children) {
    Children node = open_pair(slabs, reference);
    children = ivec2(node.left, node.right);
    return meets_pair(node.intervals, t_max);
}
#endif

#endif
