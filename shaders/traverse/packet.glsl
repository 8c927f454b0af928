// The rays of a subgroup, one a lane, go through the tree together: a node is visited if any of them meets it, so all
// read the same node at the same time (ray packets: Wald et al. 2001; with one stack for a group of GPU threads:
// Guenther et al. 2007). Everything that steers the walk is voted on, so all lanes hold the same stack, each its own
// copy, which needs no lane in particular to be there. With it each keeps whether its own ray wants what waits.
// Lanes part where one has a ray or wants a triangle and another does not. The barriers bring them together again: a
// vote among lanes that stand at different nodes would mix their walks, as seen on an H100.
// Twin: src/reference/traverse/packet.rs.

#include "pair.glsl"

int stack[STACK_ROOM];
// A bit for each entry of the stack.
uint stack_wanted[(STACK_ROOM + 31) / 32];
int top;

void push(int reference, bool wanted) {
    uint bit = 1u << uint(top & 31);
    uint others = stack_wanted[top >> 5] & ~bit;
    stack_wanted[top >> 5] = wanted ? others | bit : others;
    stack[top++] = reference;
}

// Returns whether the lane's ray wants what comes from the stack.
bool pop(out int reference) {
    reference = stack[--top];
    return (stack_wanted[top >> 5] >> uint(top & 31) & 1u) == 1u;
}

#ifdef ACCESSOR_TEXEL
// A CPU device fetches for each lane apart: each of four lanes fetches a word, and registers are exchanged.
PairNode load_pair_together(int i) {
    uvec4 word = NODE_WORD(uint(i) * 4u + (gl_SubgroupInvocationID & 3u));
#define WORD_OF_LANE(lane) subgroupShuffle(word, lane)
    LOAD_PairNode(WORD_OF_LANE, 0u)
}
#else
// All lanes read the same address, which a GPU turns into one read.
PairNode load_pair_together(int i) { return load_pair(i); }
#endif

#ifdef USES_CLOSEST
// How many lanes meet the left box, the right one, both, and both with the right one nearer: a byte each.
uint closest_votes(bvec2 meets, vec4 intervals) {
    bool both = meets.x && meets.y;
    uint vote = (meets.x ? 1u : 0u) | (meets.y ? 1u << 8 : 0u) | (both ? 1u << 16 : 0u) |
                (both && intervals.z < intervals.x ? 1u << 24 : 0u);
    return subgroupAdd(vote);
}

// `waits`: whether this lane has a ray. Returns whether it came to its end, as does `any_hit_together`.
bool closest_hit_together(Ray ray, bool waits, inout Hit hit) {
    Slabs slabs = slabs_of(ray);
    top = 0;
    int reference = ROOT;
    bool finished = true;
    bool wanted = waits;
    bool more = subgroupAny(wanted);
    while (more) {
        while (more && reference >= 0) {
            if (wanted) {
                COUNT_VISIT();
            }
            PairNode node = load_pair_together(reference);
            vec4 intervals = pair_intervals(slabs, node);
            bvec2 meets = meets_pair(intervals, box_limit(hit.t));
            meets = bvec2(meets.x && wanted, meets.y && wanted);
            uint votes = closest_votes(meets, intervals);
            bool left = (votes & 0xffu) > 0u;
            bool right = (votes >> 8 & 0xffu) > 0u;
            bool right_first = right && (!left || 2u * (votes >> 24) > (votes >> 16 & 0xffu));
            if (left && right) push(right_first ? node.left : node.right, right_first ? meets.x : meets.y);
            reference = right_first ? node.right : node.left;
            wanted = right_first ? meets.y : meets.x;
            if (!left && !right) {
                more = top > 0;
                if (more) wanted = pop(reference);
            }
        }
        if (reference < 0) {
            if (wanted) {
                finished = closest_of_leaf(ray, slabs, leaf_first(reference), leaf_last(reference), hit) && finished;
            }
            subgroupBarrier();
            more = top > 0;
            if (more) wanted = pop(reference);
        }
        if (!more) reference = NOTHING;
    }
    return finished && reference == NOTHING;
}

void run_closest() {
    Ray ray;
    Hit hit;
    uint id;
    bool more = true;
    while (more) {
        bool waits = next_closest(ray, hit, id);
        subgroupBarrier();
        bool finished = closest_hit_together(ray, waits, hit);
        if (waits) retire_closest(id, hit, finished);
        subgroupBarrier();
        more = subgroupAny(waits);
    }
}
#endif

#ifdef USES_ANY
// An occluded ray wants nothing more; the walk ends when no ray wants anything.
bool any_hit_together(Ray ray, bool waits, inout bool occluded) {
    Slabs slabs = slabs_of(ray);
    top = 0;
    int reference = ROOT;
    bool finished = true;
    bool wanted = waits && !occluded;
    bool more = subgroupAny(wanted);
    while (more) {
        while (more && reference >= 0) {
            if (wanted) {
                COUNT_VISIT();
            }
            PairNode node = load_pair_together(reference);
            bvec2 meets = meets_pair(pair_intervals(slabs, node), box_limit(ray.t_max));
            meets = bvec2(meets.x && wanted, meets.y && wanted);
            uint met = subgroupOr((meets.x ? 1u : 0u) | (meets.y ? 2u : 0u));
            if (met == 3u) push(node.right, meets.y);
            bool left = (met & 1u) == 1u;
            reference = left ? node.left : node.right;
            wanted = left ? meets.x : meets.y;
            more = met != 0u;
            while (!more && top > 0) {
                wanted = pop(reference) && !occluded;
                more = subgroupAny(wanted);
            }
        }
        if (reference < 0) {
            if (wanted) {
                finished = any_of_leaf(ray, slabs, leaf_first(reference), leaf_last(reference), occluded) && finished;
            }
            subgroupBarrier();
            more = false;
            while (!more && top > 0) {
                wanted = pop(reference) && !occluded;
                more = subgroupAny(wanted);
            }
        }
        if (!more && top == 0) reference = NOTHING;
    }
    return occluded || (finished && reference == NOTHING);
}

void run_any() {
    Ray ray;
    bool occluded;
    uint id;
    bool more = true;
    while (more) {
        bool waits = next_any(ray, occluded, id);
        subgroupBarrier();
        bool finished = any_hit_together(ray, waits, occluded);
        if (waits) retire_any(id, occluded, finished);
        subgroupBarrier();
        more = subgroupAny(waits);
    }
}
#endif
