// A box a node, as stack.glsl has it and in the same order, but of two children the right one is visited at once and
// only the left one is put on the stack. Twin: src/reference/traverse/single_push.rs.

#include "leaf.glsl"

CONSTANT(SPEC_STACK_ROOM, int, STACK_ROOM, 64);

int stack[STACK_ROOM];

bool closest_hit(Ray ray, inout Hit hit) {
    Slabs slabs = slabs_of(ray);
    int top = 0;
    int index = int(frame.node_count) - 1;
    bool finished = true;
    bool more = index >= 0;
    while (more) {
        COUNT_VISIT();
        Node node = load_node(index);
        bool descends = false;
        if (node.left < 0) {
            finished = closest_of_leaf(ray, slabs, -1 - node.left, -1 - node.right, hit) && finished;
        } else {
            descends = meets_box(slabs, node.pmin, node.pmax, box_limit(hit.t));
        }
        index = -1;
        if (descends) {
            stack[top++] = node.left;
            index = node.right;
        } else if (top > 0) {
            index = stack[--top];
        }
        more = index >= 0;
    }
    return finished && index < 0;
}

bool any_hit(Ray ray, inout bool occluded) {
    Slabs slabs = slabs_of(ray);
    int top = 0;
    int index = int(frame.node_count) - 1;
    bool finished = true;
    bool more = index >= 0 && !occluded;
    while (more) {
        COUNT_VISIT();
        Node node = load_node(index);
        bool descends = false;
        if (node.left < 0) {
            finished = any_of_leaf(ray, slabs, -1 - node.left, -1 - node.right, occluded) && finished;
        } else {
            descends = meets_box(slabs, node.pmin, node.pmax, box_limit(ray.t_max));
        }
        index = -1;
        if (descends) {
            stack[top++] = node.left;
            index = node.right;
        } else if (!occluded && top > 0) {
            index = stack[--top];
        }
        more = index >= 0;
    }
    return occluded || (finished && index < 0);
}

#include "one_ray.glsl"
