// What a subgroup does as one: it reads a node or a triangle, votes, and keeps a stack.

#include "references.glsl"

// Always: `top` falls to -1 where the stack is empty. A loop `while (x)` tells a compiler that x is false behind it, even where the driver left
// the loop early; `while (x && STACK_HOLDS)` tells it nothing, so that x can be asked again.
#define STACK_HOLDS (top > -2)

bool is_leaf(int reference) { return reference < 0 && reference != NOTHING; }

// What is no leaf has no triangles: a node may stand here too, where the driver left a loop early, and its number must not be taken for
// that of a triangle.
int first_if_leaf(int reference) { return is_leaf(reference) ? leaf_first(reference) : 0; }

int last_if_leaf(int reference) { return is_leaf(reference) ? leaf_last(reference) : -1; }

// Four boxes as seen from a point, a component for each, and what they refer to.
struct Boxes {
    vec4 low_x;
    vec4 high_x;
    vec4 low_y;
    vec4 high_y;
    vec4 low_z;
    vec4 high_z;
    ivec4 child;
};

#ifdef ACCESSOR_TEXEL

// A CPU device fetches for each lane apart: each of eight lanes fetches a word, and registers are exchanged. (Subgroups of eight
// lanes; the host refuses others.)
#define FETCHED_QUAD(reference) uvec4 own_word = NODE_WORD(uint(reference) * QUAD_WORDS + gl_SubgroupInvocationID)
#define FETCHED_TRIANGLE(index) uvec4 own_word = TRIANGLE_WORD(uint(index) * 3u + min(gl_SubgroupInvocationID, 2u))
#define SHARED_NODE_WORD(i) subgroupShuffle(own_word, i)
#define SHARED_TRIANGLE_WORD(i) subgroupShuffle(own_word, i)

// Votes and reductions over lanes are loops there; a shuffle is one instruction.
uint or_together(uint bits) {
    bits |= subgroupShuffle(bits, gl_SubgroupInvocationID ^ 1u);
    bits |= subgroupShuffle(bits, gl_SubgroupInvocationID ^ 2u);
    return bits | subgroupShuffle(bits, gl_SubgroupInvocationID ^ 4u);
}

ivec4 min_together(ivec4 keys) {
    keys = min(keys, subgroupShuffle(keys, gl_SubgroupInvocationID ^ 1u));
    keys = min(keys, subgroupShuffle(keys, gl_SubgroupInvocationID ^ 2u));
    return min(keys, subgroupShuffle(keys, gl_SubgroupInvocationID ^ 4u));
}

// The stack lies across the lanes, eight entries a register.
#define STACK_REGISTERS ((STACK_ROOM + 7) / 8)
int stack[STACK_REGISTERS];
int top;

void push_if(bool pushes, int reference) {
    int place = pushes ? top - int(gl_SubgroupInvocationID) : -1;
    for (int i = 0; i < STACK_REGISTERS; i++) stack[i] = place == 8 * i ? reference : stack[i];
    top += pushes ? 1 : 0;
}

// The last entry, or NOTHING.
int last_entry() {
    int last = top - 1;
    int entry = stack[0];
    for (int i = 1; i < STACK_REGISTERS; i++) entry = last >> 3 == i ? stack[i] : entry;
    return last < 0 ? NOTHING : subgroupShuffle(entry, uint(last) & 7u);
}

int pop_if(bool pops, int otherwise) {
    int entry = last_entry();
    top -= pops ? 1 : 0;
    return pops ? entry : otherwise;
}

// What is known of a set of the children 1 to 3 (bits 0 to 2 of the lane's number): which they are, from the last to the first, in
// bits 0 to 5, how many in bits 6 and 7, the first one in bits 8 and 9.
uint known_of_set() {
    uint set = gl_SubgroupInvocationID & 7u;
    uint first = (set & 1u) != 0u ? 1u : (set & 2u) != 0u ? 2u : 3u;
    uint sequence = 0u, count = 0u;
    if ((set & 4u) != 0u) sequence = 3u;
    count = set >> 2;
    sequence |= (set & 2u) != 0u ? 2u << (2u * count) : 0u;
    count += set >> 1 & 1u;
    sequence |= (set & 1u) != 0u ? 1u << (2u * count) : 0u;
    count += set & 1u;
    return sequence | count << 6 | first << 8;
}

// The first of the met children comes next and the others wait, the last one below; if there is none, what waited last. All of it at
// once: entries above the top may be anything, so all places that the children could take are written.
int next_reference(uint met, ivec4 child) {
    uint lane = gl_SubgroupInvocationID;
    int popped = last_entry();
    uint known = subgroupShuffle(known_of_set(), met >> 1);
    int in_lane = lane == 0u ? child.x : lane == 1u ? child.y : lane == 2u ? child.z : child.w;
    uint place = (lane - uint(top)) & 7u;
    int waiting = subgroupShuffle(in_lane, (known >> (2u * place)) & 3u);
    for (int i = 0; i < STACK_REGISTERS; i++) {
        stack[i] = lane + uint(8 * i) - uint(top) < 3u ? waiting : stack[i];
    }
    top += int(known >> 6 & 3u) + int(met & 1u) - 1;
    int first = subgroupShuffle(in_lane, (met & 1u) != 0u ? 0u : known >> 8);
    return met == 0u ? popped : first;
}

#else

// All lanes read the same address, which a GPU turns into one read, and each keeps its own copy of the stack.
#define SHARED_NODE_WORD(i) NODE_WORD(own_word + i)
#define SHARED_TRIANGLE_WORD(i) TRIANGLE_WORD(own_word + i)
#define FETCHED_QUAD(reference) uint own_word = uint(reference) * QUAD_WORDS
#define FETCHED_TRIANGLE(index) uint own_word = uint(index) * 3u

uint or_together(uint bits) { return subgroupOr(bits); }

ivec4 min_together(ivec4 keys) { return subgroupMin(keys); }

int stack[STACK_ROOM];
int top;

void push_if(bool pushes, int reference) {
    if (pushes) stack[top++] = reference;
}

int pop_if(bool pops, int otherwise) {
    if (!pops) return otherwise;
    return top > 0 ? stack[--top] : NOTHING;
}

int next_reference(uint met, ivec4 child) {
    push_if((met & 8u) != 0u && (met & 7u) != 0u, child.w);
    push_if((met & 4u) != 0u && (met & 3u) != 0u, child.z);
    push_if((met & 3u) == 3u, child.y);
    int first = (met & 1u) != 0u ? child.x : (met & 2u) != 0u ? child.y : (met & 4u) != 0u ? child.z : child.w;
    return pop_if(met == 0u, first);
}

#endif

bool anyone(bool votes) { return or_together(votes ? 1u : 0u) != 0u; }

Boxes boxes_together(int reference, vec3 origin) {
    FETCHED_QUAD(reference);
    precise vec4 low_x = uintBitsToFloat(SHARED_NODE_WORD(0u)) - origin.x;
    precise vec4 high_x = uintBitsToFloat(SHARED_NODE_WORD(1u)) - origin.x;
    precise vec4 low_y = uintBitsToFloat(SHARED_NODE_WORD(2u)) - origin.y;
    precise vec4 high_y = uintBitsToFloat(SHARED_NODE_WORD(3u)) - origin.y;
    precise vec4 low_z = uintBitsToFloat(SHARED_NODE_WORD(4u)) - origin.z;
    precise vec4 high_z = uintBitsToFloat(SHARED_NODE_WORD(5u)) - origin.z;
    return Boxes(low_x, high_x, low_y, high_y, low_z, high_z, ivec4(SHARED_NODE_WORD(QUAD_CHILD_WORD)));
}

Triangle triangle_together(int index) {
    FETCHED_TRIANGLE(index);
    uvec4 w0 = SHARED_TRIANGLE_WORD(0u);
    uvec4 w1 = SHARED_TRIANGLE_WORD(1u);
    uvec4 w2 = SHARED_TRIANGLE_WORD(2u);
    return Triangle(uintBitsToFloat(w0.xyz), w0.w, uintBitsToFloat(w1.xyz), uintBitsToFloat(w1.w), uintBitsToFloat(w2.xyz),
                    uintBitsToFloat(w2.w));
}

// Comparisons of floats as integers, of which a CPU has a minimum that asks nothing about NaNs. Integers order floats
// from 0 on as floats do. Negative ones come in the wrong order, but all of them come before 0, which is all that is asked of
// them: a box that is left behind the origin is missed, and one that is entered there is entered at 0. So the least of the exits is
// negative if any is, and the greatest of the entries and 0 is right. A negative zero counts as 0 where it is an exit.
