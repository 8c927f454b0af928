// Rays that start near one another pass the same nodes from the root down to where they are. So a workgroup finds once,
// for all its any-hit rays, the subtrees that hang off that way (entry points: Reshetov, Soupikov and Hurley, "Multi-Level
// Ray Tracing Algorithm", 2005): nodes whose boxes hold a start are opened until there are ENTRIES of them, whatever is
// left is a subtree, and together they are the tree. Each ray tests their boxes in shared memory, all lanes the same one
// at the same time, and walks those that it meets, the nearest first.
//
// Where lanes do not take over each other's work (stealing.glsl), a walk ends at a triangle that the ray may meet by the test of rough.glsl. Where that is not sure the exact one decides, when the lanes of the
// subgroup are together again; should it fail, a ray that grazes the triangle, the ray walks again with that test at each.
// Closest hits are those of ordered.glsl, but that lanes may take over each other's work (stealing_closest.glsl).
// Twin: src/reference/traverse/entry.rs.

#include "near_first.glsl"
#include "grown.glsl"
#include "left_first.glsl"
#include "rough.glsl"

#ifdef USES_ANY

// Farther than any scene.
#define EVERYWHERE 1e30

// The entries: centre of the box and reference, half its size.
shared vec4 entry_center[ENTRIES];
shared vec4 entry_half[ENTRIES];
shared uint entry_turn[ENTRIES];
shared uint entry_count;
// The box of the starts, in floats' own order.
shared uint starts_min[3];
shared uint starts_max[3];

// Integers that compare as the floats do.
uint ordered_bits(float x) {
    uint bits = floatBitsToUint(x);
    return (bits >> 31) == 1u ? ~bits : bits | 0x80000000u;
}

float from_ordered_bits(uint bits) { return uintBitsToFloat((bits >> 31) == 1u ? bits & 0x7fffffffu : ~bits); }

// How early an entry's turn comes, the smallest first: its distance from the starts, in sizes of its own.
float turn_of(uint entry, vec3 low, vec3 high) {
    vec3 center = entry_center[entry].xyz;
    vec3 size = entry_half[entry].xyz;
    vec3 gap = max(max(center - size - high, low - center - size), vec3(0.0));
    return dot(gap, gap) / max(size.x * size.y + size.y * size.z + size.z * size.x, 1e-30);
}

void store_entry(uint entry, vec3 center, vec3 extent, int reference) {
    entry_center[entry] = vec4(center, intBitsToFloat(reference));
    entry_half[entry] = vec4(extent, 0.0);
}

int entry_reference(uint entry) { return floatBitsToInt(entry_center[entry].w); }

// Whether its box and that of the starts have a point in common.
bool holds_starts(uint entry, vec3 low, vec3 high) {
    vec3 center = entry_center[entry].xyz;
    vec3 extent = entry_half[entry].xyz;
    return all(lessThanEqual(center - extent, high)) && all(greaterThanEqual(center + extent, low));
}

// Opens the nodes around the starts of the invocations that have work. Every invocation of the workgroup calls this.
void find_entries(bool works, vec3 start) {
    uint lane = gl_LocalInvocationIndex;
    if (lane == 0u) {
        store_entry(0u, vec3(0.0), vec3(EVERYWHERE), ROOT);
        entry_count = 1u;
    }
    if (lane < 3u) {
        starts_min[lane] = 0xffffffffu;
        starts_max[lane] = 0u;
    }
    barrier();
    if (works) {
        for (int axis = 0; axis < 3; axis++) {
            atomicMin(starts_min[axis], ordered_bits(start[axis]));
            atomicMax(starts_max[axis], ordered_bits(start[axis]));
        }
    }
    barrier();
    bool more = starts_min[0] <= starts_max[0];
    vec3 low = vec3(from_ordered_bits(starts_min[0]), from_ordered_bits(starts_min[1]), from_ordered_bits(starts_min[2]));
    vec3 high = vec3(from_ordered_bits(starts_max[0]), from_ordered_bits(starts_max[1]), from_ordered_bits(starts_max[2]));
    uint count = 1u;
    while (more) {
        // An entry that is opened becomes its left child; the right one is added.
        if (lane < count) {
            int reference = entry_reference(lane);
            if (reference >= 0 && holds_starts(lane, low, high)) {
                uint place = atomicAdd(entry_count, 1u);
                if (place < ENTRIES) {
                    CentredNode node = load_centred(reference);
                    store_entry(lane, node.left_center, node.left_half, node.left);
                    store_entry(place, node.right_center, node.right_half, node.right);
                }
            }
        }
        barrier();
        uint grown = min(entry_count, ENTRIES);
        barrier();
        more = grown != count && grown < ENTRIES;
        count = grown;
    }
    vec4 own_center = entry_center[min(lane, count - 1u)];
    vec4 own_half = entry_half[min(lane, count - 1u)];
    // Found once by one invocation for all: what is found twice may round twice. As bits they have an order whatever they are.
    uint turn = floatBitsToUint(turn_of(min(lane, count - 1u), low, high));
    if (lane < count) entry_turn[lane] = turn;
    barrier();
    uint rank = 0u;
    if (lane < count) {
        for (uint i = 0u; i < count; i++) {
            uint other = entry_turn[i];
            if (other < turn || (other == turn && i < lane)) rank++;
        }
    }
    barrier();
    if (lane < count) {
        entry_center[rank] = own_center;
        entry_half[rank] = own_half;
    }
    if (lane == 0u) entry_count = count;
    barrier();
}

#undef BEGIN_ANY
#define BEGIN_ANY(works, start) find_entries(works, start)

int next_entry(inout uint waiting) {
    uint entry = uint(findLSB(waiting));
    waiting &= waiting - 1u;
    return entry_reference(entry);
}

// The entries that the ray meets, a bit each.
uint met_entries(GrownRay ray, float t_max, inout bool finished) {
    uint met = 0u;
    uint count = entry_count;
    uint i = 0u;
    for (; i < count; i++) {
        if (meets_grown(ray, entry_center[i].xyz, entry_half[i].xyz, t_max)) met |= 1u << i;
    }
    finished = finished && CAME_TO_END(i == count);
    return met;
}

#ifdef STEALS
#include "pairing.glsl"
#include "stealing.glsl"
#else

// Walks until a triangle is found that the ray may meet, or until all of the tree has been seen. Returns whether it came to its end.
bool find_triangle(Ray ray, GrownRay grown_ray, out int found) {
    float t_max = box_limit(ray.t_max);
    found = -1;
    bool finished = true;
    uint waiting = met_entries(grown_ray, t_max, finished);
    int top = 0;
    bool more = waiting != 0u;
    int reference = more ? next_entry(waiting) : NOTHING;
    while (more) {
        uint steps = 0u;
        bool walks = reference >= 0;
        while (walks) {
            COUNT_VISIT();
            ivec2 children;
            bvec2 meets = met_children(grown_ray, reference, t_max, children);
            if (meets.x && meets.y) stack[top++] = children.y;
            reference = meets.x ? children.x : children.y;
            if (!meets.x && !meets.y) {
                more = top > 0 || waiting != 0u;
                reference = !more ? NOTHING : top > 0 ? stack[--top] : next_entry(waiting);
            }
            steps++;
            walks = reference >= 0 && steps < NODES_IN_A_ROW;
        }
        if (more && reference < 0) {
            int index = leaf_first(reference);
            int last = leaf_last(reference);
            for (; index <= last && found < 0; index++) {
                if (verdict_of(ray, index) != MISSES) found = index;
            }
            finished = finished && CAME_TO_END(found >= 0 || index > last);
            more = found < 0 && (top > 0 || waiting != 0u);
            reference = !more ? NOTHING : top > 0 ? stack[--top] : next_entry(waiting);
        }
    }
    return finished && reference == NOTHING;
}

bool any_hit(Ray ray, inout bool occluded) {
    if (occluded) return true;
    int found;
    bool finished = find_triangle(ray, grown_ray_of(ray), found);
    occluded = found >= 0 && does_meet(ray, found);
    // Hardly ever. In the walk itself the exact test would take a GPU an eighth of its time.
    if (found >= 0 && !occluded) finished = any_hit_left_first(ray, occluded);
    return occluded || finished;
}

#endif
#endif

#include "one_ray.glsl"
#ifdef STEALS_CLOSEST
#include "pairing.glsl"
#include "stealing_closest.glsl"
#endif
