// What the methods on nodes with both children's boxes share. A reference is a node, or a leaf where it is negative.

#include "leaf.glsl"

CONSTANT(SPEC_STACK_ROOM, int, STACK_ROOM, 64);

#define ROOT 0
// No reference: packed leaves do not reach so far down. A walk that came to its end is at it: the loop's own condition
// proves nothing, since a compiler knows that it fails after the loop, even where the driver left the loop early.
#define NOTHING (-0x7fffffff - 1)

// Where the ray enters and leaves the two boxes: left in xy, right in zw.
vec4 pair_intervals(Slabs slabs, PairNode node) {
    return vec4(slab_interval(slabs, node.left_min, node.left_max, ROBUST_SLABS),
                slab_interval(slabs, node.right_min, node.right_max, ROBUST_SLABS));
}

bvec2 meets_pair(vec4 intervals, float t_max) {
    return bvec2(max(intervals.x, 0.0) <= min(intervals.y, t_max), max(intervals.z, 0.0) <= min(intervals.w, t_max));
}

int leaf_first(int reference) { return (-1 - reference) >> int(LEAF_BITS); }

int leaf_last(int reference) { return leaf_first(reference) + ((-1 - reference) & int(LEAF_LIMIT - 1u)); }
