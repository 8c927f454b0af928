// What the methods on nodes with both children's boxes share.

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
