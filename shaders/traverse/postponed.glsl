// A stack as in ordered.glsl, but a lane that comes to a leaf keeps it and goes on through the tree, until half
// of the subgroup's rays need something else or none can go on; then all leaves are tested together (Aila and Laine,
// "Understanding the Efficiency of Ray Traversal on GPUs", 2009, who wait until all have one). A lane that is through
// with its ray takes the next one at that time, so none waits for the longest ray. Nodes are those of entry.glsl, and any hits test their boxes
// as there.
// Twin: src/reference/traverse/postponed.rs.

#include "pair.glsl"
#include "met_children.glsl"

int stack[STACK_ROOM];
int top;
// Where the ray is: a node, or a leaf if another one waits already.
int reference;
// The leaf that waits.
int leaf;

void start_walk(bool has_ray) {
    top = 0;
    reference = has_ray ? ROOT : NOTHING;
    leaf = NOTHING;
}

bool walk_ended() { return top == 0 && reference == NOTHING && leaf == NOTHING; }

// Lets a leaf wait where none does; then, where the ray is nowhere, takes the next reference from the stack. Returns
// whether it did.
bool take_next() {
    if (leaf == NOTHING && reference < 0) {
        leaf = reference;
        reference = NOTHING;
    }
    bool takes = reference == NOTHING && top > 0;
    if (takes) reference = stack[--top];
    return takes;
}

// Whether the subgroup goes on through the tree: a lane can, and less than half of the rays need something else.
bool walk_goes_on(bool has_ray) {
    bool can_walk = reference >= 0 || (reference == NOTHING && top > 0) || (reference != NOTHING && leaf == NOTHING);
    bool needs_else = has_ray && (leaf != NOTHING || !can_walk);
    uint votes = subgroupAdd((can_walk ? 1u : 0u) | (needs_else ? 1u << 8 : 0u) | (has_ray ? 1u << 16 : 0u));
    return (votes & 0xffu) > 0u && 2u * (votes >> 8 & 0xffu) < votes >> 16;
}

#ifdef USES_CLOSEST
// Where the ray enters what waits on the stack.
float stack_enter[STACK_ROOM];

void take_next_before(float t_max) {
    if (take_next() && max(stack_enter[top], 0.0) > t_max) reference = NOTHING;
}

void run_closest() {
    Ray ray;
    Hit hit;
    uint id;
    Slabs slabs;
    bool has_ray = false;
    bool finished = true;
    bool more = true;
    start_walk(false);
    while (more) {
        if (walk_ended()) {
            if (has_ray) retire_closest(id, hit, finished);
            has_ray = next_closest(ray, hit, id);
            slabs = slabs_of(ray);
            finished = true;
            start_walk(has_ray);
        }
        bool walks = true;
        while (walks) {
            if (reference >= 0) {
                COUNT_VISIT();
                PairNode node = load_pair(reference);
                vec4 intervals = pair_intervals(slabs, node);
                bvec2 meets = meets_pair(intervals, box_limit(hit.t));
                bool right_first = meets.y && (!meets.x || intervals.z < intervals.x);
                reference = right_first ? node.right : meets.x ? node.left : NOTHING;
                if (meets.x && meets.y) {
                    stack[top] = right_first ? node.left : node.right;
                    stack_enter[top] = right_first ? intervals.x : intervals.z;
                    top++;
                }
            }
            take_next_before(box_limit(hit.t));
            walks = walk_goes_on(has_ray);
        }
        if (leaf != NOTHING) {
            finished = closest_of_leaf(ray, slabs, leaf_first(leaf), leaf_last(leaf), hit) && finished;
            leaf = NOTHING;
            take_next_before(box_limit(hit.t));
        }
        more = subgroupAny(has_ray);
    }
    if (has_ray) retire_closest(id, hit, false);
}
#endif

#ifdef USES_ANY
void run_any() {
    Ray ray;
    bool occluded = false;
    uint id;
    Slabs slabs;
    BOX_RAY box_ray;
    bool has_ray = false;
    bool finished = true;
    bool more = true;
    start_walk(false);
    while (more) {
        if (walk_ended()) {
            if (has_ray) retire_any(id, occluded, occluded || finished);
            has_ray = next_any(ray, occluded, id);
            slabs = slabs_of(ray);
            box_ray = BOX_RAY_OF(ray, slabs);
            finished = true;
            start_walk(has_ray && !occluded);
        }
        bool walks = true;
        while (walks) {
            if (reference >= 0) {
                COUNT_VISIT();
                ivec2 children;
                bvec2 meets = met_children(box_ray, reference, box_limit(ray.t_max), children);
                reference = meets.x ? children.x : meets.y ? children.y : NOTHING;
                if (meets.x && meets.y) stack[top++] = children.y;
            }
            take_next();
            walks = walk_goes_on(has_ray);
        }
        if (leaf != NOTHING) {
            finished = any_of_leaf(ray, slabs, leaf_first(leaf), leaf_last(leaf), occluded) && finished;
            leaf = NOTHING;
            take_next();
            if (occluded) start_walk(false);
        }
        more = subgroupAny(has_ray);
    }
    if (has_ray) retire_any(id, occluded, false);
}
#endif
