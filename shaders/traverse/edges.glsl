// Faces against rays that start at one point, a pixel's ambient rays. Seen from there a face is what the planes through the point
// and its edges enclose, and whether a direction lies within is the sign of a product for each edge
// (edge functions: Pineda, "A Parallel Algorithm for Polygon Rasterization", 1988; in three dimensions: Davidovic, Engelhardt,
// Georgiev, Slusallek and Dachsbacher, "3D Rasterization: A Bridge between Rasterization and Ray Casting", 2012). They are found
// once for many of a pixel's rays, and only of the faces that rays of the subgroup may meet. A ray clearly within some face is occluded, one
// clearly outside of all is not, and what is left, next to an edge or in a plane, is asked of the exact test: so the answers
// are those of `any_hit`.
//
// Only for the conservative intersector, since no ray passes between two triangles of a face then.
// Twin: src/reference/traverse/edges.rs.

#include "beam.glsl"

// Edge functions are measured in the most that rounding may change them, and moved up by 1, so that below 0 a direction is
// outside and above 2 within. In sizes of start, edges and direction that is 2^-17 (EDGE_ERROR of src/pack/faces.rs): eight times S, what
// `error_of` grants for the three together, with the sum of a direction's components at most 1.74. What the exact test accepts lies within
// 2 S of the triangle, for it errs by S and grants it; a face's own edges may be passed by 2.25 times that (LEANS there),
// lie S / 2 beside it (FLAT), and round by S here: e = 2^-24 of the size for the moment, as much for its two products and three times
// for the sums, nine times with the direction, and seven times for the product with it. A start counts with the most that it may be, L + R.
//
// Planes are measured in 2^-17 of the same. Of a plane nearer to the start than that the twin's sign of t decides which side counts, and a hit
// may be lost to its own box. Then edge functions shrink by 2^-20, so that they never reach 2.
#define NEAR_SCALE 9.5367431640625e-7
// There is a header in its place.
#define NO_FACE 0u
// 2 as bits.
#define WITHIN 0x40000000

// Whether faces are there for these choices: otherwise their number is 0. (`lcg` steps a state from ray to ray.) Each lane asks for a face, so
// all have to be there: a driver may run fewer than it tells of, or tell of more than a workgroup has.
bool takes_faces() {
    bool full = gl_NumSubgroups * gl_SubgroupSize == gl_WorkGroupSize.x * gl_WorkGroupSize.y;
    return full && CONSERVATIVE && ROBUST_SLABS && !ORIGINAL && SAMPLER != SAMPLER_LCG && load_face(0u).first > 0u;
}

int second_place(Face face) { return int(face.second & ~FACE_TURNED); }

// The box of the lane's own face among a subgroup's next ones.
Bounds own_bounds(uint first, uint faces) {
    Face face = load_face(1u + min(first + gl_SubgroupInvocationID, faces - 1u));
    return Bounds(face.min, face.max);
}

// A subgroup goes through the faces that some of its rays may meet, in loops that all lanes take alike: FACE_LOOP(beam, own, faces) { what is
// done with face 1 + i } FACE_LOOP_END, after which `finished` tells whether it came to its end. `own`: the lane's box among the first.
#define FACE_LOOP(beam, own, faces) \
    uint end = faces; \
    uint asked = 0u; \
    uint left = 0u; \
    uint first = 0u; \
    while (first < end) { \
        subgroupBarrier(); \
        uvec4 met = subgroupBallot(first + gl_SubgroupInvocationID < end && beam_meets(beam, own)); \
        left += subgroupBallotBitCount(met); \
        asked += min(gl_SubgroupSize, end - first); \
        for (uint word = 0u; 32u * word < gl_SubgroupSize; word++) { \
            uint waiting = met[word]; \
            while (waiting != 0u) { \
                uint i = first + 32u * word + uint(findLSB(waiting)); \
                waiting &= waiting - 1u; \
                left--;
#define FACE_LOOP_END \
            } \
        } \
        first += gl_SubgroupSize; \
        if (first < end) own = own_bounds(first, end); \
    } \
    bool finished = CAME_TO_END(asked == end && left == 0u);

#ifdef USES_CLOSEST

bool closest_together(bool works, Ray ray, inout Hit hit) {
    Slabs slabs = slabs_of(ray);
    Beam beam = beam_of_rays(works, ray.origin, ray.direction);
    uint faces = load_face(0u).first;
    Bounds own = own_bounds(0u, faces);
    FACE_LOOP(beam, own, faces)
        Face face = load_face(1u + i);
        closest_of_triangle(ray, slabs, int(face.first), hit);
        if (face.second != face.first) closest_of_triangle(ray, slabs, second_place(face), hit);
    FACE_LOOP_END
    return finished;
}

void run_closest() {
    if (!takes_faces()) {
        run_each_closest();
        return;
    }
    Ray ray;
    Hit hit;
    uint id;
    bool works = next_closest(ray, hit, id);
    subgroupBarrier();
    bool finished = closest_together(works, ray, hit);
    if (works) retire_closest(id, hit, finished);
}

#endif

#ifdef USES_ANY

vec3 edge_start;
// The face that the start lies next to, mostly that of its surface, and what was found of it.
uint near_face;
float near_sign;

void begin_faces(vec3 start) {
    edge_start = start;
    near_face = NO_FACE;
}

#undef BEGIN_ANY
#define BEGIN_ANY(works, start) begin_faces(start)

// Of a face, three or four edge functions of a direction; `base` is added to the products.
struct Edges {
    vec3 a;
    vec3 b;
    vec3 c;
    vec3 d;
    float base;
};

// Whether the exact test's t of rays that leave the plane upwards is below 0: as meets_moller rounds it.
bool below_plane(vec3 start, int index) {
    Triangle triangle = load_edges(index);
    precise vec3 s = start - triangle.a;
    return dot3(triangle.ac, cross3(s, triangle.ab)) < 0.0;
}

// Which side of the face's edges counts, from next to its plane.
float sign_near(Face face) {
    bool first_below = below_plane(edge_start, int(face.first));
    bool second_below = below_plane(edge_start, second_place(face)) != (face.second >= FACE_TURNED);
    // From between the two planes nothing is clear.
    return first_below != second_below ? 0.0 : first_below ? -NEAR_SCALE : NEAR_SCALE;
}

Edges edges_from_start(uint i) {
    Face face = load_face(i);
    float first = dot(face.normal0, edge_start) + face.offset0;
    float second = dot(face.normal1, edge_start) + face.offset1;
    float sign = first < 0.0 ? -1.0 : 1.0;
    float base = 1.0;
    if (min(abs(first), abs(second)) < 1.0 || (first < 0.0) != (second < 0.0)) {
        if (near_face != i) {
            near_face = i;
            near_sign = sign_near(face);
        }
        sign = near_sign;
        base = NEAR_SCALE;
    }
    vec3 point = edge_start * sign;
    return Edges(cross(point, face.along_a) + sign * vec3(face.moment_ax, face.moment_ay, face.moment_az),
                 cross(point, face.along_b) + sign * vec3(face.moment_bx, face.moment_by, face.moment_bz),
                 cross(point, face.along_c) + sign * vec3(face.moment_cx, face.moment_cy, face.moment_cz),
                 cross(point, face.along_d) + sign * vec3(face.moment_dx, face.moment_dy, face.moment_dz), base);
}

// As bits, which have the floats' order where it counts: above 0.
int edge(vec3 side, vec3 direction, float base) {
    return floatBitsToInt(side.x * direction.x + (side.y * direction.y + (side.z * direction.z + base)));
}

int least_of_three(Edges edges, vec3 direction) {
    return min(min(edge(edges.a, direction, edges.base), edge(edges.b, direction, edges.base)),
               edge(edges.c, direction, edges.base));
}

int least_of_four(Edges edges, vec3 direction) {
    return min(least_of_three(edges, direction), edge(edges.d, direction, edges.base));
}

// Rays of an invocation under way.
#define RAYS 8
#define EACH_RAY(DO) DO(0) DO(1) DO(2) DO(3) DO(4) DO(5) DO(6) DO(7)

// Each ray by name, so that all stay in registers.
vec3 directions[RAYS];
// The most that any face came to of the least of its edge functions.
int most[RAYS];

#define TEST_THREE(i) most[i] = max(most[i], least_of_three(edges, directions[i]));
#define TEST_FOUR(i) most[i] = max(most[i], least_of_four(edges, directions[i]));

// Returns whether all faces were tested that some ray of the subgroup may meet.
bool test_faces(Beam beam, Face header, Bounds own) {
    FACE_LOOP(beam, own, header.first)
        Edges edges = edges_from_start(1u + i);
        if (i < header.second) {
            EACH_RAY(TEST_FOUR)
        } else {
            EACH_RAY(TEST_THREE)
        }
    FACE_LOOP_END
    return finished;
}

#define TAKE(i) directions[i] = direction_of(first_id + uint(i)); wants |= has_sample(first_id + uint(i)) ? 1u << i : 0u; most[i] = -1;
#define BOUND(i) bounds = Bounds(min(bounds.low, directions[i]), max(bounds.high, directions[i]));
#define JUDGE(i) occluded |= most[i] > WITHIN ? 1u << i : 0u; open |= most[i] >= 0 ? 1u << i : 0u;
#define CHOOSE(i) direction = place == i ? directions[i] : direction;
#define RETIRE(i) if ((wants >> i & 1u) == 1u) retire_any(first_id + uint(i), (occluded >> i & 1u) == 1u, finished);

// The exact test for the rays that are not sure, by their places: a ray at a time, and each lane asks for other triangles. Returns who is
// occluded.
uint ask_together(uint unsure, inout bool finished) {
    uint occluded = 0u;
    int unasked = bitCount(unsure);
    subgroupBarrier();
    uvec4 asking = subgroupBallot(unsure != 0u);
    while (asking != uvec4(0u)) {
        int place = findLSB(unsure);
        vec3 direction = vec3(0.0);
        EACH_RAY(CHOOSE)
        uint asker = subgroupBallotFindLSB(asking);
        Ray ray = Ray(subgroupShuffle(edge_start, asker), subgroupShuffle(direction, asker), frame.ambient_t_max);
        Slabs slabs = slabs_of(ray);
        bool hit = false;
        uint asked = range.triangle_begin;
        for (uint first = range.triangle_begin; first < range.triangle_end; first += gl_SubgroupSize) {
            uint index = first + gl_SubgroupInvocationID;
            if (index < range.triangle_end) hit = any_of_triangle(ray, slabs, int(index)) || hit;
            asked += min(gl_SubgroupSize, range.triangle_end - first);
        }
        subgroupBarrier();
        hit = subgroupAny(hit);
        finished = finished && CAME_TO_END(hit || asked == range.triangle_end);
        if (gl_SubgroupInvocationID == asker) {
            if (hit) occluded |= 1u << place;
            unsure &= unsure - 1u;
            unasked--;
        }
        subgroupBarrier();
        asking = subgroupBallot(unsure != 0u);
    }
    finished = finished && CAME_TO_END(unasked == 0);
    return occluded;
}

// A subgroup takes the same samples at a time, from the first of its block on, so that what follows from a sample's number alone is the same
// for all invocations and a compiler sees it. Pixels that lag begin later.
void run_together() {
    Face header = load_face(0u);
    Bounds own = own_bounds(0u, header.first);
    subgroupBarrier();
    Bounds starts = bounds_together(Bounds(edge_start, edge_start), any_left());
    bool takes_part = any_left();
    uint first_id = block_begin();
    for (; subgroupAny(takes_part && first_id < sample_end); first_id += RAYS) {
        if (!subgroupAny(takes_part && sample_next < first_id + RAYS)) continue;
        uint wants = 0u;
        EACH_RAY(TAKE)
        Bounds bounds = Bounds(directions[0], directions[0]);
        EACH_RAY(BOUND)
        subgroupBarrier();
        bounds = bounds_together(bounds, wants != 0u);
        bool finished = test_faces(beam_of(starts, bounds), header, own);
        uint occluded = 0u;
        uint open = 0u;
        EACH_RAY(JUDGE)
        uint unsure = open & ~occluded & wants;
        occluded |= ask_together(unsure, finished);
        EACH_RAY(RETIRE)
        subgroupBarrier();
    }
}

void run_any() {
    // Of bounded rays nothing would be sure.
    if (takes_faces() && frame.ambient_t_max >= UNBOUNDED) {
        run_together();
    } else {
        run_each_any();
    }
}

#endif
