// A binary tree with a stack of node indices for each ray, the original's way: a popped inner node
// tests its box and pushes left, then right; a leaf's box is never tested.
// Twin: src/reference/traverse/stack.rs.

#include "leaf.glsl"

CONSTANT(SPEC_STACK_SIZE, int, STACK_SIZE, 64);
// Length of the array, at least STACK_SIZE: a driver may keep a short array whose bounds it knows in
// registers and select among them, which is slower than memory.
CONSTANT(SPEC_STACK_ROOM, int, STACK_ROOM, 64);

int stack[STACK_ROOM];
int stack_top;

// A push that does not fit is dropped, and the ray is counted.
void push(int node) {
    if (stack_top < STACK_SIZE) {
        stack[stack_top++] = node;
    } else {
        ray_overflowed = true;
    }
}

bool closest_hit(Ray ray, inout Hit hit) {
    Slabs slabs = slabs_of(ray);
    stack_top = 0;
    push(int(frame.node_count) - 1);
    bool finished = true;
    while (stack_top > 0) {
        COUNT_VISIT();
        Node node = load_node(stack[--stack_top]);
        if (node.left < 0) {
            finished = closest_of_leaf(ray, slabs, -1 - node.left, -1 - node.right, hit) && finished;
        } else if (meets_box(slabs, node.pmin, node.pmax, box_limit(hit.t))) {
            push(node.left);
            push(node.right);
        }
    }
    return finished && stack_top == 0;
}

bool any_hit(Ray ray, inout bool occluded) {
    Slabs slabs = slabs_of(ray);
    stack_top = 0;
    push(int(frame.node_count) - 1);
    bool finished = true;
    while (stack_top > 0 && !occluded) {
        COUNT_VISIT();
        Node node = load_node(stack[--stack_top]);
        if (node.left < 0) {
            finished = any_of_leaf(ray, slabs, -1 - node.left, -1 - node.right, occluded) && finished;
        } else if (meets_box(slabs, node.pmin, node.pmax, box_limit(ray.t_max))) {
            push(node.left);
            push(node.right);
        }
    }
    return occluded || (finished && stack_top == 0);
}

#include "one_ray.glsl"
