// The closest hit with nodes that hold both children's boxes: a child is put on the stack only if both are met, and the
// near one is visited first, so that the closest hit is found early and culls what lies behind it. A stack as deep as the
// tree is enough.

#include "pair.glsl"

int stack[STACK_ROOM];
// Where the ray enters what waits on the stack.
float stack_enter[STACK_ROOM];

// Most nodes that a lane at a leaf waits for, while others of its subgroup are still at nodes: with fewer it tests triangles with few others, with
// more it waits for those that have the longest way.
#define NODES_IN_A_ROW 8u

// Loops ask at their end: one that asks first takes a turn more of those that Mesa's software device allows an invocation.

// What waits on the stack and is not farther away than the closest hit.
int pop_near(inout int top, float t_max) {
    int reference = NOTHING;
    bool more = top > 0;
    do {
        if (more) {
            top--;
            bool near = max(stack_enter[top], 0.0) <= t_max;
            if (near) reference = stack[top];
            more = !near && top > 0;
        }
    } while (more);
    return reference;
}

// Opens a node: goes on to the child that the ray meets first before t_max, and puts the other one on the stack; where it meets none, to what waits there.
int nearer_child(Slabs slabs, int reference, float t_max, inout int top) {
    Children node = open_pair(slabs, reference);
    vec4 intervals = node.intervals;
    bvec2 meets = meets_pair(intervals, t_max);
    bool right_first = meets.y && (!meets.x || intervals.z < intervals.x);
    int next = right_first ? node.right : node.left;
    if (meets.x && meets.y) {
        stack[top] = right_first ? node.left : node.right;
        stack_enter[top] = right_first ? intervals.x : intervals.z;
        top++;
    }
    if (!meets.x && !meets.y) next = pop_near(top, t_max);
    return next;
}

bool closest_hit(Ray ray, inout Hit hit) {
    Slabs slabs = slabs_of(ray);
    int top = 0;
    int reference = ROOT;
    bool finished = true;
    bool more = true;
    while (more) {
        uint steps = 0u;
        bool walks = reference >= 0;
        do {
            if (walks) {
                COUNT_VISIT();
                reference = nearer_child(slabs, reference, box_limit(hit.t), top);
                steps++;
                walks = reference >= 0 && steps < NODES_IN_A_ROW;
            }
        } while (walks);
        more = reference != NOTHING;
        if (more && reference < 0) {
            finished = closest_of_leaf(ray, slabs, leaf_first(reference), leaf_last(reference), hit) && finished;
            reference = pop_near(top, box_limit(hit.t));
            more = reference != NOTHING;
        }
    }
    return finished && reference == NOTHING && top == 0;
}
