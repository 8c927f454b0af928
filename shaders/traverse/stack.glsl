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

// First and last triangle of the next leaf whose ancestors' boxes the ray meets before t_max; -1 when
// there is none left, or where the loop was cut short (then the stack is not empty).
int next_leaf(Slabs slabs, float t_max, out int last) {
    while (stack_top > 0) {
        int index = stack[--stack_top];
        Node node = load_node(index);
        if (node.left < 0) {
            last = -1 - node.right;
            return -1 - node.left;
        }
        if (meets_box(slabs, node.pmin, node.pmax, t_max)) {
            push(node.left);
            push(node.right);
        }
    }
    last = 0;
    return -1;
}

bool closest_hit(Ray ray, inout Hit hit) {
    Slabs slabs = slabs_of(ray);
    stack_top = 0;
    push(int(frame.node_count) - 1);
    bool finished = true;
    int last;
    int first = next_leaf(slabs, box_limit(hit.t), last);
    while (first >= 0) {
        finished = closest_of_leaf(ray, slabs, first, last, hit) && finished;
        first = next_leaf(slabs, box_limit(hit.t), last);
    }
    return finished && first < 0 && stack_top == 0;
}

bool any_hit(Ray ray, inout bool occluded) {
    Slabs slabs = slabs_of(ray);
    stack_top = 0;
    push(int(frame.node_count) - 1);
    bool finished = true;
    int last;
    int first = next_leaf(slabs, box_limit(ray.t_max), last);
    while (first >= 0 && !occluded) {
        finished = any_of_leaf(ray, slabs, first, last, occluded) && finished;
        if (!occluded) first = next_leaf(slabs, box_limit(ray.t_max), last);
    }
    return occluded || (finished && first < 0 && stack_top == 0);
}

#include "one_ray.glsl"
