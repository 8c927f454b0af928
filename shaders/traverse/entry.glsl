// Rays that start near one another pass the same nodes from the root down to where they are. So a workgroup finds once,
// for all its any-hit rays, the subtrees that hang off that way (entry points: Reshetov, Soupikov and Hurley, "Multi-Level
// Ray Tracing Algorithm", 2005): nodes whose boxes hold a start are opened until there are ENTRIES of them, whatever is
// left is a subtree, and together they are the tree. Each ray tests their boxes in shared memory, all lanes the same one
// at the same time, and walks those that it meets, the nearest first.
//
// A triangle that a ray meets is a candidate, which is tested against its own box when the walk ends, where the lanes of
// the subgroup are together again. Should it fail, a ray that grazes it, the ray walks again with that test at each triangle.
// Closest hits are those of ordered.glsl.
// Twin: src/reference/traverse/entry.rs.

#include "near_first.glsl"
#include "grown.glsl"

#ifdef USES_ANY

// Farther than any scene.
#define EVERYWHERE 1e30

// The entries: lower corner of the box and reference, upper corner.
shared vec4 entry_min[ENTRIES];
shared vec4 entry_max[ENTRIES];
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
    vec3 pmin = entry_min[entry].xyz;
    vec3 pmax = entry_max[entry].xyz;
    vec3 gap = max(max(pmin - high, low - pmax), vec3(0.0));
    vec3 size = pmax - pmin;
    return dot(gap, gap) / max(size.x * size.y + size.y * size.z + size.z * size.x, 1e-30);
}

void store_entry(uint entry, vec3 pmin, vec3 pmax, int reference) {
    entry_min[entry] = vec4(pmin, intBitsToFloat(reference));
    entry_max[entry] = vec4(pmax, 0.0);
}

int entry_reference(uint entry) { return floatBitsToInt(entry_min[entry].w); }

// Opens the nodes around the starts of the invocations that have work. Every invocation of the workgroup calls this.
void find_entries(bool works, vec3 start) {
    uint lane = gl_LocalInvocationIndex;
    if (lane == 0u) {
        store_entry(0u, vec3(-EVERYWHERE), vec3(EVERYWHERE), ROOT);
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
            bool holds = all(lessThanEqual(entry_min[lane].xyz, high)) && all(greaterThanEqual(entry_max[lane].xyz, low));
            if (reference >= 0 && holds) {
                uint place = atomicAdd(entry_count, 1u);
                if (place < ENTRIES) {
                    PairNode node = load_pair(reference);
                    store_entry(lane, node.left_min, node.left_max, node.left);
                    store_entry(place, node.right_min, node.right_max, node.right);
                }
            }
        }
        barrier();
        uint grown = min(entry_count, ENTRIES);
        barrier();
        more = grown != count && grown < ENTRIES;
        count = grown;
    }
    vec4 own_min = entry_min[min(lane, count - 1u)];
    vec4 own_max = entry_max[min(lane, count - 1u)];
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
        entry_min[rank] = own_min;
        entry_max[rank] = own_max;
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

bool any_hit(Ray ray, inout bool occluded) {
    GrownRay grown_ray = grown_ray_of(ray);
    float t_max = box_limit(ray.t_max);
    bool finished = true;
    // Of bounded rays many candidates lie too far, which the exact test alone tells.
    bool guards = ray.t_max < UNBOUNDED;
    bool again = !occluded;
    int reference = NOTHING;
    while (again) {
        uint waiting = 0u;
        uint count = entry_count;
        uint i = 0u;
        for (; i < count; i++) {
            if (meets_grown(grown_ray, entry_min[i].xyz, entry_max[i].xyz, t_max)) waiting |= 1u << i;
        }
        finished = i == count;
        int candidate = -1;
        int top = 0;
        bool more = waiting != 0u;
        reference = more ? next_entry(waiting) : NOTHING;
        while (more) {
            bool descends = false;
            if (reference >= 0) {
                COUNT_VISIT();
                PairNode node = load_pair(reference);
                bool left = meets_grown(grown_ray, node.left_min, node.left_max, t_max);
                bool right = meets_grown(grown_ray, node.right_min, node.right_max, t_max);
                descends = left || right;
                if (left && right) stack[top++] = node.right;
                reference = left ? node.left : node.right;
            } else {
                int index = leaf_first(reference);
                int last = leaf_last(reference);
                for (; index <= last && candidate < 0; index++) {
                    COUNT_TEST();
                    if (may_meet(ray, index, guards)) candidate = index;
                }
                finished = finished && (candidate >= 0 || index > last);
            }
            more = descends || (candidate < 0 && (top > 0 || waiting != 0u));
            if (!more) {
                reference = NOTHING;
            } else if (!descends) {
                reference = top > 0 ? stack[--top] : next_entry(waiting);
            }
        }
        again = false;
        if (candidate >= 0) {
            occluded = guards || any_of_triangle(ray, slabs_of(ray), candidate);
            again = !occluded;
            guards = true;
            // The walk is not over: a driver may leave the loop here.
            if (again) reference = ROOT;
        }
    }
    return occluded || (finished && reference == NOTHING);
}

#endif

#include "one_ray.glsl"
