// Nodes with both children's boxes as floats: by the same slab test as that of a triangle's own box, or by the fused one of grown.glsl.
// Twin: src/reference/traverse/pair.rs.

#include "references.glsl"

// A node's children, and where the ray enters and leaves their boxes: left in xy, right in zw.
struct Children {
    int left;
    int right;
    vec4 intervals;
};

bvec2 meets_pair(vec4 intervals, float t_max) {
    return bvec2(max(intervals.x, 0.0) <= min(intervals.y, t_max), max(intervals.z, 0.0) <= min(intervals.w, t_max));
}

#ifdef NODES_CENTRED

#include "grown.glsl"

#define BOX_RAY GrownRay
#define BOX_RAY_OF(ray, slabs) grown_ray_of(ray)

Children open_pair(GrownRay ray, int reference) {
    CentredNode node = load_centred(reference);
    return Children(node.left, node.right, vec4(grown_interval(ray, node.left_center, node.left_half),
                                                grown_interval(ray, node.right_center, node.right_half)));
}

#else

#define BOX_RAY Slabs
#define BOX_RAY_OF(ray, slabs) slabs

vec4 pair_intervals(Slabs slabs, PairNode node) {
    return vec4(slab_interval(slabs, node.left_min, node.left_max, ROBUST_SLABS),
                slab_interval(slabs, node.right_min, node.right_max, ROBUST_SLABS));
}

Children open_pair(Slabs slabs, int reference) {
    PairNode node = load_pair(reference);
    return Children(node.left, node.right, pair_intervals(slabs, node));
}

#endif
