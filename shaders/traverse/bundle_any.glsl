// Any hits of a bundle, four rays a lane.

// A ray of a lane.
struct Member {
    vec3 direction;
    vec3 inverse;
    float error;
    float t_max;
    // Where it begins, as the bits of its t: 0, or GONE.
    int start;
};

// Where a ray begins that is none, or none any more: behind exits from boxes. (Beyond it lies none that matters: at worst a node is visited
// for nobody.)
#define GONE 0x7f000000

// Rays from one point. A compiler that takes the operations as they come has few values to keep at a time if one ray
// follows the other.
struct Bundle {
    vec3 origin;
    Member a;
    Member b;
    Member c;
    Member d;
    // Of the frame, read where all lanes are there.
    float box_pad;
};

// At least what EXIT_SLACK grows an exit t by, as steps of its bits, u = 2^-24: 16 u t and the product's rounding, where a
// step is at least u t. An exit at -0 would be lost, since its bits are those of the least integer. It does not occur
// where it counts: boxes of nodes are grown by 2^-21 of the scene more than a triangle's own box, so that if a ray leaves
// that one at 0 or later, the difference from its origin is not 0 here, nor is the product, however long the direction.
#define EXIT_ULPS 17

// Whether the ray misses the box (as seen from its origin), only where the robust test of slabs.glsl says so. (Not whether it meets it:
// a CPU's comparison of integers is that for `greater`.)
bool misses_seen_box(Member ray, vec3 low, vec3 high) {
    precise float x0 = low.x * ray.inverse.x;
    precise float x1 = high.x * ray.inverse.x;
    int enter = min(floatBitsToInt(x0), floatBitsToInt(x1));
    int leave = max(floatBitsToInt(x0), floatBitsToInt(x1));
    precise float y0 = low.y * ray.inverse.y;
    precise float y1 = high.y * ray.inverse.y;
    enter = max(enter, min(floatBitsToInt(y0), floatBitsToInt(y1)));
    leave = min(leave, max(floatBitsToInt(y0), floatBitsToInt(y1)));
    precise float z0 = low.z * ray.inverse.z;
    precise float z1 = high.z * ray.inverse.z;
    enter = max(enter, min(floatBitsToInt(z0), floatBitsToInt(z1)));
    leave = min(leave, max(floatBitsToInt(z0), floatBitsToInt(z1)));
    leave += EXIT_ULPS;
    if (BOUNDED) leave = min(leave, floatBitsToInt(ray.t_max));
    return max(enter, ray.start) > leave;
}

bool all_miss(Bundle bundle, vec3 low, vec3 high) {
    bool misses = misses_seen_box(bundle.a, low, high);
    misses = misses_seen_box(bundle.b, low, high) && misses;
    misses = misses_seen_box(bundle.c, low, high) && misses;
    return misses_seen_box(bundle.d, low, high) && misses;
}

// A bit for each child that any ray of the subgroup meets.
uint met_together(Boxes boxes, Bundle bundle) {
#define LOW(i) vec3(boxes.low_x.i, boxes.low_y.i, boxes.low_z.i)
#define HIGH(i) vec3(boxes.high_x.i, boxes.high_y.i, boxes.high_z.i)
    uint met = all_miss(bundle, LOW(x), HIGH(x)) ? 0u : 1u;
    met |= all_miss(bundle, LOW(y), HIGH(y)) ? 0u : 2u;
    met |= all_miss(bundle, LOW(z), HIGH(z)) ? 0u : 4u;
    met |= all_miss(bundle, LOW(w), HIGH(w)) ? 0u : 8u;
    return or_together(met);
}

// What meets_moller needs of a triangle as seen from the origin.
struct Seen {
    vec3 s;
    vec3 q;
    float t;
    float size;
};

Seen seen_from(vec3 origin, Triangle triangle) {
    precise vec3 s = origin - triangle.a;
    vec3 q = cross3(s, triangle.ab);
    return Seen(s, q, dot3(triangle.ac, q), max_abs(s));
}

// meets_moller, with det and t as there.
bool meets_moller_of(Member ray, Seen seen, Triangle triangle, out float det, out float t) {
    vec3 p = cross3(ray.direction, triangle.ac);
    float signed_det = dot3(triangle.ab, p);
    uint side = floatBitsToUint(signed_det) & 0x80000000u;
    det = abs(signed_det);
    float u = uintBitsToFloat(floatBitsToUint(dot3(seen.s, p)) ^ side);
    float v = uintBitsToFloat(floatBitsToUint(dot3(ray.direction, seen.q)) ^ side);
    t = uintBitsToFloat(floatBitsToUint(seen.t) ^ side);
    precise float u_plus_v = u + v;
    bool meets = det > SMALLEST_DETERMINANT && t > 0.0 && ray.start == 0;
    if (!CONSERVATIVE) return meets && u >= 0.0 && v >= 0.0 && u_plus_v <= det;
    precise float error_s = ray.error * seen.size;
    precise float error_u = error_s * triangle.ac_sum;
    precise float error_v = error_s * triangle.ab_sum;
    precise float most = det + (error_u + error_v + ray.error * triangle.ab_sum * triangle.ac_sum);
    return meets && u >= -error_u && v >= -error_v && u_plus_v <= most;
}

bvec4 meets_of(Bundle bundle, Triangle triangle, out vec4 det, out vec4 t) {
    Seen seen = seen_from(bundle.origin, triangle);
    bool a = meets_moller_of(bundle.a, seen, triangle, det.x, t.x);
    bool b = meets_moller_of(bundle.b, seen, triangle, det.y, t.y);
    bool c = meets_moller_of(bundle.c, seen, triangle, det.z, t.z);
    bool d = meets_moller_of(bundle.d, seen, triangle, det.w, t.w);
    return bvec4(a, b, c, d);
}

// `guarded`, with the triangle's box as seen from the origin. The same answer, so an exit at -0 is made 0.
bool guarded_of(Member ray, vec3 low, vec3 high, float det, float t) {
    precise float x0 = low.x * ray.inverse.x;
    precise float x1 = high.x * ray.inverse.x;
    precise float y0 = low.y * ray.inverse.y;
    precise float y1 = high.y * ray.inverse.y;
    precise float z0 = low.z * ray.inverse.z;
    precise float z1 = high.z * ray.inverse.z;
    precise float far_x = intBitsToFloat(max(floatBitsToInt(x0), floatBitsToInt(x1))) + 0.0;
    precise float far_y = intBitsToFloat(max(floatBitsToInt(y0), floatBitsToInt(y1))) + 0.0;
    precise float far_z = intBitsToFloat(max(floatBitsToInt(z0), floatBitsToInt(z1))) + 0.0;
    int enter = max(max(min(floatBitsToInt(x0), floatBitsToInt(x1)), min(floatBitsToInt(y0), floatBitsToInt(y1))),
                    max(min(floatBitsToInt(z0), floatBitsToInt(z1)), 0));
    int least = min(min(floatBitsToInt(far_x), floatBitsToInt(far_y)), floatBitsToInt(far_z));
    precise float grown = intBitsToFloat(least) * EXIT_SLACK;
    int leave = floatBitsToInt(grown);
    precise float scaled = t * reciprocal(det);
    int inside = min(max(floatBitsToInt(scaled), enter), leave);
    return enter <= leave && inside <= floatBitsToInt(ray.t_max);
}

// Which of the rays that meet the triangle do so within its box.
bvec4 guarded_of_all(Bundle bundle, Triangle triangle, bvec4 meets, vec4 det, vec4 t) {
    precise vec3 b = triangle.a + triangle.ab;
    precise vec3 c = triangle.a + triangle.ac;
    precise vec3 pmin = min(triangle.a, min(b, c)) - bundle.box_pad;
    precise vec3 pmax = max(triangle.a, max(b, c)) + bundle.box_pad;
    precise vec3 low = pmin - bundle.origin;
    precise vec3 high = pmax - bundle.origin;
    bool in_a = guarded_of(bundle.a, low, high, det.x, t.x) && meets.x;
    bool in_b = guarded_of(bundle.b, low, high, det.y, t.y) && meets.y;
    bool in_c = guarded_of(bundle.c, low, high, det.z, t.z) && meets.z;
    bool in_d = guarded_of(bundle.d, low, high, det.w, t.w) && meets.w;
    return bvec4(in_a, in_b, in_c, in_d);
}

// The tests that do not have a form for several rays.
bool meets_alone(Member member, vec3 origin, int index) {
    if (member.start != 0) return false;
    Ray ray = Ray(origin, member.direction, member.t_max);
    return any_of_triangle(ray, slabs_of(ray), index);
}

bvec4 each_alone(Bundle bundle, int index) {
    return bvec4(meets_alone(bundle.a, bundle.origin, index), meets_alone(bundle.b, bundle.origin, index),
                 meets_alone(bundle.c, bundle.origin, index), meets_alone(bundle.d, bundle.origin, index));
}

bool lives(Bundle bundle) { return min(min(bundle.a.start, bundle.b.start), min(bundle.c.start, bundle.d.start)) == 0; }

#ifdef COUNTS_WORK
#define FOR_LIVING(DO) \
    if (bundle.a.start == 0) { DO(); } \
    if (bundle.b.start == 0) { DO(); } \
    if (bundle.c.start == 0) { DO(); } \
    if (bundle.d.start == 0) { DO(); }
void count_tests(Bundle bundle) { FOR_LIVING(COUNT_TEST) }
void count_visits(Bundle bundle) { FOR_LIVING(COUNT_VISIT) }
#else
#define count_tests(bundle)
#define count_visits(bundle)
#endif

// What comes after a node: the first of its children that some ray meets, or what waits.
int visited(int reference, Bundle bundle) {
    count_visits(bundle);
    Boxes boxes = boxes_together(reference, bundle.origin);
    return next_reference(met_together(boxes, bundle), boxes.child);
}

#include "bundle_sides.glsl"

// Returns whether the walk came to its end; occluded rays are gone then. Mesa's CPU driver runs the body of a loop before it
// asks for its condition, and under an empty mask once more behind the last turn of a loop that asks first: so loops ask at their end, and
// what is there for some of their turns only stands in a branch. What a loop that was left early did not visit stays `reference`, which then is
// not NOTHING at the end.
bool any_hits_together(inout Bundle bundle) {
    top = 0;
    int reference = anyone(lives(bundle)) ? ROOT : NOTHING;
    do {
        int place = 0;
        int last = -1;
        bool found = false;
        vec4 det = vec4(1.0);
        vec4 t = vec4(0.0);
        bvec4 meets = bvec4(false);
        Triangle triangle;
        do {
            do {
                if (reference >= 0) reference = visited(reference, bundle);
            } while (reference >= 0 && STACK_HOLDS);
            place = first_if_leaf(reference);
            last = last_if_leaf(reference);
            do {
                if (place <= last) count_tests(bundle);
                if (WATERTIGHT || ORIGINAL) {
                    meets = bvec4(false);
                    if (place <= last) meets = each_alone(bundle, place);
                    // Lanes part in there, and a vote needs them together.
                    subgroupBarrier();
                } else {
                    triangle = triangle_together(place);
                    meets = meets_of(bundle, triangle, det, t);
                }
                found = anyone(any(meets)) && place <= last;
                place++;
            } while (!found && place <= last);
            reference = pop_if(!found && place > last && is_leaf(reference), reference);
        } while (!found && reference != NOTHING);
        // Whether the loops were left at a leaf of which some triangle is met, and not early.
        bool at_leaf = found;
        do {
            bvec4 occluded = meets;
            if (!(WATERTIGHT || ORIGINAL)) occluded = guarded_of_all(bundle, triangle, meets, det, t);
            bundle.a.start = found && occluded.x ? GONE : bundle.a.start;
            bundle.b.start = found && occluded.y ? GONE : bundle.b.start;
            bundle.c.start = found && occluded.z ? GONE : bundle.c.start;
            bundle.d.start = found && occluded.w ? GONE : bundle.d.start;
            found = false;
            do {
                bool more = place <= last;
                if (more) count_tests(bundle);
                if (WATERTIGHT || ORIGINAL) {
                    meets = bvec4(false);
                    if (more) meets = each_alone(bundle, place);
                    subgroupBarrier();
                } else {
                    triangle = triangle_together(place);
                    meets = meets_of(bundle, triangle, det, t);
                }
                found = more && anyone(any(meets));
                place++;
            } while (!found && place <= last);
        } while (found && STACK_HOLDS);
        bool goes_on = anyone(lives(bundle));
        reference = pop_if(at_leaf && !found && place > last, reference);
        reference = goes_on ? reference : NOTHING;
    } while (reference != NOTHING && STACK_HOLDS);
    return reference == NOTHING;
}

// The original weighs its rays, and `lcg` steps a state from ray to ray: then a lane has one ray under way.
#define RAYS ((ORIGINAL || SAMPLER == SAMPLER_LCG) ? 1 : 4)

Member member_of(Ray ray, bool wants) {
    float error = CONSERVATIVE ? error_of(ray.direction) : 0.0;
    return Member(ray.direction, robust_inverse(ray.direction), error, ray.t_max, wants ? 0 : GONE);
}

// The next ray, if the lane takes so many at a time and has one.
// `wants`: whether it is to be traced at all.
bool next_member(int place, out Ray ray, out Member member, out uint id, out bool wants) {
    bool occluded = true;
    id = 0u;
    ray = Ray(vec3(0.0), vec3(0.0), 0.0);
    bool waits = false;
    if (place < RAYS) waits = next_any(ray, occluded, id);
    wants = waits && !occluded && ray.t_max >= 0.0;
    member = member_of(ray, wants);
    return waits;
}

// Rays are retired in order, up to the first that is not finished.
void retire_member(Member member, bool waits, bool wants, uint id, bool ended, inout bool finished) {
    bool occluded = wants && member.start != 0;
    finished = finished && (ended || occluded);
    if (waits) retire_any(id, occluded, finished);
}

void run_any() {
    bool more = false;
    float box_pad = frame.box_pad;
    do {
        Bundle bundle;
        bundle.box_pad = box_pad;
        bvec4 waits;
        bvec4 wants;
        uvec4 ids;
        Ray ray;
        waits.x = next_member(0, ray, bundle.a, ids.x, wants.x);
        bundle.origin = ray.origin;
        waits.y = next_member(1, ray, bundle.b, ids.y, wants.y);
        waits.z = next_member(2, ray, bundle.c, ids.z, wants.z);
        waits.w = next_member(3, ray, bundle.d, ids.w, wants.w);
        subgroupBarrier();
        bool ended = SURE_BY_SIDES ? any_hits_by_sides(bundle) : any_hits_together(bundle);
        bool finished = true;
        retire_member(bundle.a, waits.x, wants.x, ids.x, ended, finished);
        retire_member(bundle.b, waits.y, wants.y, ids.y, ended, finished);
        retire_member(bundle.c, waits.z, wants.z, ids.z, ended, finished);
        retire_member(bundle.d, waits.w, wants.w, ids.w, ended, finished);
        subgroupBarrier();
        more = anyone(any_left());
    } while (more);
}
