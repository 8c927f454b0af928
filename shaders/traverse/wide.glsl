// Nodes of eight children with boxes of 8 bits a side: Ylitie, Karras and Laine, "Efficient Incoherent Ray Traversal
// on GPUs Through Compressed Wide BVHs" (2017). What waits on the stack is a node and a mask of its children, in the
// order in which their octants come along the ray. Any hit takes them as they stand.
// Twin: src/reference/traverse/wide.rs.

#include "references.glsl"

uvec2 stack[STACK_ROOM];

vec4 bytes_of(uint word) {
    return vec4(word & 255u, (word >> 8) & 255u, (word >> 16) & 255u, word >> 24);
}

// Errors of a crossing, as parts of |(origin - o) / d| + 256 |scale / d|: the twin counts them up.
#define ENTER_ERROR 4.76837158203125e-7
#define EXIT_ERROR 1.9073486328125e-6

// A ray in a node's own units: it crosses side q across an axis at q step + near, or + far if it leaves there.
struct Crossings {
    vec3 step;
    vec3 near;
    vec3 far;
};

Crossings crossings_of(vec3 origin, vec3 scale, Slabs slabs) {
    precise vec3 step = scale * slabs.inverse;
    precise vec3 first = (origin - slabs.origin) * slabs.inverse;
    precise vec3 size = abs(first) + 256.0 * abs(step);
    precise vec3 near = first - size * ENTER_ERROR;
    precise vec3 far = first + size * EXIT_ERROR;
    return Crossings(step, near, far);
}

// Which of four boxes the ray misses before t_max, a bit each. Products and sums may be fused. `near` and `far`: the
// sides that face the ray's origin, and the others.
uint missed_of_four(Crossings crossings, uvec3 near, uvec3 far, float t_max) {
    vec4 enter = max(max(bytes_of(near.x) * crossings.step.x + crossings.near.x,
                         bytes_of(near.y) * crossings.step.y + crossings.near.y),
                     max(bytes_of(near.z) * crossings.step.z + crossings.near.z, 0.0));
    vec4 leave = min(min(bytes_of(far.x) * crossings.step.x + crossings.far.x,
                         bytes_of(far.y) * crossings.step.y + crossings.far.y),
                     min(bytes_of(far.z) * crossings.step.z + crossings.far.z, t_max));
    uvec4 missed = uvec4(greaterThan(enter, leave));
    return missed.x | (missed.y << 1) | (missed.z << 2) | (missed.w << 3);
}

// Slots that the ray meets before t_max, bit i for slot i. An infinity or a NaN, from a scene or a ray beyond all
// bounds, never rules a box out.
uint met_slots(int index, Slabs slabs, float t_max) {
    COUNT_VISIT();
    WideNode node = load_wide(index);
    vec3 scale = uintBitsToFloat((uvec3(node.scales, node.scales >> 8, node.scales >> 16) & 255u) << 23);
    Crossings crossings = crossings_of(node.origin, scale, slabs);
    bvec3 backwards = lessThan(slabs.inverse, vec3(0.0));
    uvec3 min0 = uvec3(node.min_x0, node.min_y0, node.min_z0);
    uvec3 min4 = uvec3(node.min_x4, node.min_y4, node.min_z4);
    uvec3 max0 = uvec3(node.max_x0, node.max_y0, node.max_z0);
    uvec3 max4 = uvec3(node.max_x4, node.max_y4, node.max_z4);
    uint missed0 = missed_of_four(crossings, mix(min0, max0, backwards), mix(max0, min0, backwards), t_max);
    uint missed4 = missed_of_four(crossings, mix(min4, max4, backwards), mix(max4, min4, backwards), t_max);
    return ~(missed0 | (missed4 << 4)) & (node.scales >> 24);
}

// Axes along which the ray runs backwards, a bit each: slots come in the order of slot ^ octant.
uint octant_of(Slabs slabs) {
    uvec3 backwards = uvec3(lessThan(slabs.inverse, vec3(0.0)));
    return backwards.x | (backwards.y << 1) | (backwards.z << 2);
}

// Moves bit i to i ^ octant.
uint nearest_first(uint slots, uint octant) {
    slots = (octant & 1u) != 0u ? ((slots & 0x55u) << 1) | ((slots >> 1) & 0x55u) : slots;
    slots = (octant & 2u) != 0u ? ((slots & 0x33u) << 2) | ((slots >> 2) & 0x33u) : slots;
    return (octant & 4u) != 0u ? ((slots & 0x0fu) << 4) | (slots >> 4) : slots;
}

bool closest_hit(Ray ray, inout Hit hit) {
    Slabs slabs = slabs_of(ray);
    uint octant = octant_of(slabs);
    int top = 0;
    // A node and its children that are still to be visited.
    uvec2 group = uvec2(0u);
    int reference = ROOT;
    bool finished = true;
    bool more = true;
    while (more) {
        if (reference >= 0) {
            if (group.y != 0u) stack[top++] = group;
            group = uvec2(reference, nearest_first(met_slots(reference, slabs, box_limit(hit.t)), octant));
        } else {
            finished = closest_of_leaf(ray, slabs, leaf_first(reference), leaf_last(reference), hit) && finished;
        }
        if (group.y == 0u && top > 0) group = stack[--top];
        more = group.y != 0u;
        if (more) {
            reference = load_wide_child(int(group.x), uint(findLSB(group.y)) ^ octant);
            group.y &= group.y - 1u;
        } else {
            reference = NOTHING;
        }
    }
    return finished && reference == NOTHING;
}

bool any_hit(Ray ray, inout bool occluded) {
    Slabs slabs = slabs_of(ray);
    int top = 0;
    uvec2 group = uvec2(0u);
    int reference = ROOT;
    bool finished = true;
    bool more = !occluded;
    while (more) {
        if (reference >= 0) {
            if (group.y != 0u) stack[top++] = group;
            group = uvec2(reference, met_slots(reference, slabs, box_limit(ray.t_max)));
        } else {
            finished = any_of_leaf(ray, slabs, leaf_first(reference), leaf_last(reference), occluded) && finished;
        }
        if (group.y == 0u && top > 0) group = stack[--top];
        more = !occluded && group.y != 0u;
        if (more) {
            reference = load_wide_child(int(group.x), uint(findLSB(group.y)));
            group.y &= group.y - 1u;
        } else {
            reference = NOTHING;
        }
    }
    return occluded || (finished && reference == NOTHING);
}

#include "one_ray.glsl"
