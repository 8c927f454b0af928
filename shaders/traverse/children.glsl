// What the methods on nodes with both children's boxes share. A reference is a node, or a leaf where it is negative.

#include "leaf.glsl"

CONSTANT(SPEC_STACK_ROOM, int, STACK_ROOM, 64);

#define ROOT 0
// No reference: packed leaves do not reach so far down. A walk that came to its end is at it: the loop's own condition
// proves nothing, since a compiler knows that it fails after the loop, even where the driver left the loop early.
#define NOTHING (-0x7fffffff - 1)

// A node's children, and where the ray enters and leaves their boxes: left in xy, right in zw.
struct Children {
    int left;
    int right;
    vec4 intervals;
};

bvec2 meets_pair(vec4 intervals, float t_max) {
    return bvec2(max(intervals.x, 0.0) <= min(intervals.y, t_max), max(intervals.z, 0.0) <= min(intervals.w, t_max));
}

int leaf_first(int reference) { return (-1 - reference) >> int(LEAF_BITS); }

int leaf_last(int reference) { return leaf_first(reference) + ((-1 - reference) & int(LEAF_LIMIT - 1u)); }
