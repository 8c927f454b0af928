// A ray under way and what it has met.

// How far rays go that have no end: the largest float.
#define UNBOUNDED 3.40282346638528859812e38

// Whether the driver may leave a loop before its condition fails. Then each loop has to prove its end by what it came to. Elsewhere it is over when its condition
// fails, and the loops of `entry` and `brute` do not ask, which costs up to a twentieth of their time on an H100.
CONSTANT(SPEC_LEAVES_LOOPS, bool, LEAVES_LOOPS, true);
#define CAME_TO_END(proof) (!LEAVES_LOOPS || (proof))

// What a method does before any hits, where it needs to know where they start; see traverse/entry.glsl and edges.glsl.
#define BEGIN_ANY(works, start)

// Points are origin + t direction, 0 < t <= t_max.
struct Ray {
    vec3 origin;
    vec3 direction;
    float t_max;
};

// Closest hit so far. Index: place in the triangle array, NO_HIT if none; id: what decides a tie.
struct Hit {
    float t;
    float u;
    float v;
    uint index;
    uint id;
};

Hit no_hit(float t_max) { return Hit(t_max, 0.0, 0.0, NO_HIT, NO_HIT); }
