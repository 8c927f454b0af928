// Nodes with both children's boxes as floats, the same slab test as that of a triangle's own box.
// Twin: src/reference/traverse/pair.rs.

#include "references.glsl"

#ifdef NODES_CENTRED
// Its boxes by their sides, which round by far less than what those boxes are grown by.
PairNode load_pair(int i) {
    CentredNode node = load_centred(i);
    return PairNode(node.left_center - node.left_half, node.left, node.left_center + node.left_half, node.right,
                    node.right_center - node.right_half, 0u, node.right_center + node.right_half, 0u);
}
#endif

// A node's children, and where the ray enters and leaves their boxes: left in xy, right in zw.
struct Children {
    int left;
    int right;
    vec4 intervals;
};

bvec2 meets_pair(vec4 intervals, float t_max) {
    return bvec2(max(intervals.x, 0.0) <= min(intervals.y, t_max), max(intervals.z, 0.0) <= min(intervals.w, t_max));
}

vec4 pair_intervals(Slabs slabs, PairNode node) {
    return vec4(slab_interval(slabs, node.left_min, node.left_max, ROBUST_SLABS),
                slab_interval(slabs, node.right_min, node.right_max, ROBUST_SLABS));
}

Children open_pair(Slabs slabs, int reference) {
    PairNode node = load_pair(reference);
    return Children(node.left, node.right, pair_intervals(slabs, node));
}
