// Closest hits of a bundle, one ray a lane: a camera ray has a pixel of its own.

// Where the ray enters each box, as integers; the largest where it misses it.
ivec4 entries(Boxes boxes, vec3 inverse, float t_max) {
    precise vec4 x0 = boxes.low_x * inverse.x;
    precise vec4 x1 = boxes.high_x * inverse.x;
    precise vec4 y0 = boxes.low_y * inverse.y;
    precise vec4 y1 = boxes.high_y * inverse.y;
    precise vec4 z0 = boxes.low_z * inverse.z;
    precise vec4 z1 = boxes.high_z * inverse.z;
    ivec4 ix0 = floatBitsToInt(x0), ix1 = floatBitsToInt(x1);
    ivec4 iy0 = floatBitsToInt(y0), iy1 = floatBitsToInt(y1);
    ivec4 iz0 = floatBitsToInt(z0), iz1 = floatBitsToInt(z1);
    ivec4 enter = max(max(min(ix0, ix1), min(iy0, iy1)), max(min(iz0, iz1), ivec4(0)));
    ivec4 least = min(min(max(ix0, ix1), max(iy0, iy1)), max(iz0, iz1));
    precise vec4 leave = intBitsToFloat(least) * EXIT_SLACK + 0.0;
    ivec4 end = min(floatBitsToInt(leave), ivec4(floatBitsToInt(t_max)));
    return mix(enter, ivec4(0x7fffffff), greaterThan(enter, end));
}

void order_pair(inout int key_a, inout int key_b, inout int a, inout int b) {
    bool swaps = key_b < key_a;
    int key = swaps ? key_b : key_a;
    key_b = swaps ? key_a : key_b;
    key_a = key;
    int reference = swaps ? b : a;
    b = swaps ? a : b;
    a = reference;
}

// The triangles of a leaf, each read once for all: so all lanes come here, those whose ray waits for none as well.
bool closest_of_leaf_together(Ray ray, Slabs slabs, bool waits, int first, int last, inout Hit hit) {
    if (WATERTIGHT || ORIGINAL) {
        bool finished = true;
        if (waits) finished = closest_of_leaf(ray, slabs, first, last, hit);
        return finished;
    }
    int i = first;
    do {
        if (waits) {
            COUNT_TEST();
        }
        Triangle triangle = triangle_together(i);
        float det;
        vec3 tuv;
        bool meets = meets_moller(ray, slabs.error, triangle, det, tuv) &&
                     guarded(ray, slabs, triangle, det, hit.t, tuv);
        if (waits && meets && (tuv.x < hit.t || triangle.id < hit.id)) hit = Hit(tuv.x, tuv.y, tuv.z, uint(i), triangle.id);
        i++;
    } while (i <= last);
    return i > last;
}

// What comes after a node: the child that is entered first, or what waits.
int visited_for_closest(int reference, vec3 origin, vec3 inverse, float t_max) {
    Boxes boxes = boxes_together(reference, origin);
    ivec4 keys = min_together(entries(boxes, inverse, t_max));
    ivec4 child = boxes.child;
    order_pair(keys.x, keys.y, child.x, child.y);
    order_pair(keys.z, keys.w, child.z, child.w);
    order_pair(keys.x, keys.z, child.x, child.z);
    order_pair(keys.y, keys.w, child.y, child.w);
    order_pair(keys.y, keys.z, child.y, child.z);
    push_if(keys.w < 0x7fffffff, child.w);
    push_if(keys.z < 0x7fffffff, child.z);
    push_if(keys.y < 0x7fffffff, child.y);
    return pop_if(keys.x == 0x7fffffff, child.x);
}

bool closest_hit_together(Ray ray, bool waits, inout Hit hit) {
    Slabs slabs = slabs_of(ray);
    vec3 inverse = robust_inverse(ray.direction);
    top = 0;
    bool finished = true;
    int reference = anyone(waits) ? ROOT : NOTHING;
    do {
        do {
            if (reference >= 0) {
                if (waits) {
                    COUNT_VISIT();
                }
                reference = visited_for_closest(reference, ray.origin, inverse, waits ? box_limit(hit.t) : -1.0);
            }
        } while (reference >= 0 && STACK_HOLDS);
        bool tests = waits && is_leaf(reference);
        int last = last_if_leaf(reference);
        finished = closest_of_leaf_together(ray, slabs, tests, first_if_leaf(reference), last, hit) && finished;
        subgroupBarrier();
        // A node that is still to be visited, since the driver left the loop early, stays.
        reference = pop_if(is_leaf(reference), reference);
    } while (reference != NOTHING && STACK_HOLDS);
    return finished && reference == NOTHING;
}

// An invocation has one at most, in every entry.
void run_closest() {
    Ray ray;
    Hit hit;
    uint id;
    bool waits = next_closest(ray, hit, id);
    subgroupBarrier();
    bool finished = closest_hit_together(ray, waits, hit);
    if (waits) retire_closest(id, hit, finished);
    subgroupBarrier();
}
