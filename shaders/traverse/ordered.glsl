// Nodes hold both children's boxes: a child is put on the stack only if both are met, and the near one is visited
// first, so that the closest hit is found early and culls what lies behind it. A stack as deep as the tree is enough.
// Any hit takes the left child first: which one is nearer does not tell which one occludes.
// Twin: src/reference/traverse/ordered.rs.

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
            PairNode node = load_pair(reference);
            vec4 intervals = pair_intervals(slabs, node);
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

bool any_hit(Ray ray, inout bool occluded) {
    Slabs slabs = slabs_of(ray);
    int top = 0;
    int reference = ROOT;
    bool finished = true;
    bool more = !occluded;
    while (more) {
        bool descends = false;
        if (reference >= 0) {
            COUNT_VISIT();
            PairNode node = load_pair(reference);
            bvec2 meets = meets_pair(pair_intervals(slabs, node), box_limit(ray.t_max));
            descends = meets.x || meets.y;
            if (meets.x && meets.y) stack[top++] = node.right;
            reference = meets.x ? node.left : node.right;
        } else {
            finished = any_of_leaf(ray, slabs, leaf_first(reference), leaf_last(reference), occluded) && finished;
        }
        more = descends || (!occluded && top > 0);
        if (!more) {
            reference = NOTHING;
        } else if (!descends) {
            reference = stack[--top];
        }
    }
    return occluded || (finished && reference == NOTHING);
}

#include "one_ray.glsl"
