// Any hits of a bundle where a triangle's edge functions tell: nearly every ray passes a triangle clearly or is clearly occluded, and only
// what is left is asked of the exact test, ray by ray. So the answers are those of `any_hits_together`.
// Twin of the verdict: src/reference/traverse/sides.rs.

#include "sides.glsl"

// Of bounded rays nothing would be sure, nor of other intersectors.
#define SURE_BY_SIDES (CONSERVATIVE && ROBUST_SLABS && !ORIGINAL && !WATERTIGHT && !BOUNDED)

// More than an edge function's bits come to.
#define NEVER 0x7fffffff

// The least of the edge functions of a direction, moved up by `error`, as bits: negative if it is clearly outside, above those of twice
// the error within.
int least_edge(Side side, vec3 direction, float error) {
    float u = side.u.x * direction.x + (side.u.y * direction.y + (side.u.z * direction.z + error));
    float v = side.v.x * direction.x + (side.v.y * direction.y + (side.v.z * direction.z + error));
    float w = side.w.x * direction.x + (side.w.y * direction.y + (side.w.z * direction.z + error));
    return min(min(floatBitsToInt(u), floatBitsToInt(v)), floatBitsToInt(w));
}

// Puts an end to a ray that is clearly occluded. Whether the exact test has to tell.
bool judge(inout Member ray, Side side, int within) {
    int least = least_edge(side, ray.direction, side.error - intBitsToFloat(ray.start));
    bool hit = least > within;
    ray.start = hit ? GONE : ray.start;
    return least >= 0 && !hit;
}

uint unsure_of(inout Bundle bundle, Side side, int within) {
    uint unsure = judge(bundle.a, side, within) ? 1u : 0u;
    unsure |= judge(bundle.b, side, within) ? 2u : 0u;
    unsure |= judge(bundle.c, side, within) ? 4u : 0u;
    return unsure | (judge(bundle.d, side, within) ? 8u : 0u);
}

Member member_at(Bundle bundle, uint bit) {
    Member ray = bundle.a;
    if (bit == 2u) ray = bundle.b;
    if (bit == 4u) ray = bundle.c;
    if (bit == 8u) ray = bundle.d;
    return ray;
}

// The exact test of one ray.
bool meets_exactly(Member ray, vec3 origin, float box_pad, Triangle triangle) {
    float det;
    float t;
    bool meets = meets_moller_of(ray, seen_from(origin, triangle), triangle, det, t);
    precise vec3 b = triangle.a + triangle.ab;
    precise vec3 c = triangle.a + triangle.ac;
    precise vec3 pmin = min(triangle.a, min(b, c)) - box_pad;
    precise vec3 pmax = max(triangle.a, max(b, c)) + box_pad;
    precise vec3 low = pmin - origin;
    precise vec3 high = pmax - origin;
    return guarded_of(ray, low, high, det, t) && meets;
}

// As `any_hits_together`. A triangle that the exact test was asked of is not asked again: the walk goes on with the leaf's next one.
bool any_hits_by_sides(inout Bundle bundle) {
    top = 0;
    int reference = anyone(lives(bundle)) ? ROOT : NOTHING;
    int done = 0;
    do {
        uint unsure = 0u;
        uint found = 0u;
        int unsure_place = 0;
        do {
            do {
                if (reference >= 0) reference = visited(reference, bundle);
            } while (reference >= 0 && STACK_HOLDS);
            int first = first_if_leaf(reference);
            int place = first + done;
            int last = last_if_leaf(reference);
            bool tests = place <= last;
            do {
                if (tests) count_tests(bundle);
                Triangle triangle = triangle_together(place);
                Side side = side_from(bundle.origin, triangle);
                int within = side.near || !tests ? NEVER : floatBitsToInt(2.0 * max(side.error, 1e-30));
                unsure = unsure_of(bundle, side, within);
                unsure = tests ? unsure : 0u;
                found = or_together((unsure != 0u ? 1u : 0u) | (lives(bundle) ? 2u : 0u));
                place++;
            } while (found == 2u && place <= last && STACK_HOLDS);
            bool ends = found == 2u && place > last;
            done = found == 3u ? place - first : 0;
            unsure_place = found == 3u ? place - 1 : 0;
            reference = pop_if(ends && is_leaf(reference), reference);
            reference = (found & 2u) != 0u ? reference : NOTHING;
        } while (found == 2u && reference != NOTHING && STACK_HOLDS);
        // It runs once in vain, too: what is rare takes as little as it can, one ray at a time. The triangle is fetched anew, for what is kept
        // from the loops above is stored there for each triangle.
        Triangle triangle = triangle_together(unsure_place);
        bool more = false;
        do {
            uint bit = unsure & (0u - unsure);
            bool hit = meets_exactly(member_at(bundle, bit), bundle.origin, bundle.box_pad, triangle) && bit != 0u;
            bundle.a.start = hit && bit == 1u ? GONE : bundle.a.start;
            bundle.b.start = hit && bit == 2u ? GONE : bundle.b.start;
            bundle.c.start = hit && bit == 4u ? GONE : bundle.c.start;
            bundle.d.start = hit && bit == 8u ? GONE : bundle.d.start;
            unsure &= ~bit;
            more = anyone(unsure != 0u);
        } while (more && STACK_HOLDS);
    } while (reference != NOTHING && STACK_HOLDS);
    return reference == NOTHING;
}
