// The closest hit with nodes that hold both children's boxes: a child is put on the stack only if both are met, and the
// near one is visited first, so that the closest hit is found early and culls what lies behind it. A stack as deep as the
// tree is enough.

#include "pair.glsl"

int stack[STACK_ROOM];
// Where the ray enters what waits on the stack.
float stack_enter[STACK_ROOM];

bool closest_hit(Ray ray, inout Hit hit) {
    Slabs slabs = slabs_of(ray);
    int top = 0;
    int reference = ROOT;
    bool finished = true;
    bool more = true;
    while (more) {
        bool descends = false;
        if (reference >= 0) {
            COUNT_VISIT();
            Children node = open_pair(slabs, reference);
            vec4 intervals = node.intervals;
            bvec2 meets = meets_pair(intervals, box_limit(hit.t));
            bool right_first = meets.y && (!meets.x || intervals.z < intervals.x);
            descends = meets.x || meets.y;
            reference = right_first ? node.right : node.left;
            if (meets.x && meets.y) {
                stack[top] = right_first ? node.left : node.right;
                stack_enter[top] = right_first ? intervals.x : intervals.z;
                top++;
            }
        } else {
            finished = closest_of_leaf(ray, slabs, leaf_first(reference), leaf_last(reference), hit) && finished;
        }
        more = descends;
        while (!more && top > 0) {
            top--;
            reference = stack[top];
            more = max(stack_enter[top], 0.0) <= box_limit(hit.t);
        }
        if (!more) reference = NOTHING;
    }
    return finished && reference == NOTHING && top == 0;
}
