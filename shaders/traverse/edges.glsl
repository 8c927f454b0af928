// All faces against rays that start at one point: a pixel's ambient rays, or the camera's. Seen from there a face is what the
// planes through the point and its edges enclose, and whether a direction lies within is the sign of a product for each edge
// (edge functions: Pineda, "A Parallel Algorithm for Polygon Rasterization", 1988; in three dimensions: Davidovic, Engelhardt,
// Georgiev, Slusallek and Dachsbacher, "3D Rasterization: A Bridge between Rasterization and Ray Casting", 2012). They are found
// once for all of a pixel's rays. A ray clearly within some face is occluded, one clearly outside of all is not, and what is
// left, next to an edge or in a plane, is asked of the exact test: so the answers are those of `any_hit`.
//
// Only for the conservative intersector, since no ray passes between two triangles of a face then.
// Twin: src/reference/traverse/edges.rs.

#include "sides.glsl"

// Of a plane through the start the twin's sign of t decides which side counts, and a hit may be lost to its own box. Then
// edge functions shrink by 2^-20, so that they never reach 2.
#define NEAR_SCALE 9.5367431640625e-7
// 2 as bits.
#define WITHIN 0x40000000

// Whether faces are there for these choices: otherwise nothing stands where their number does. Of bounded rays nothing
// would be sure.
bool takes_faces(bool bounded) {
    return CONSERVATIVE && ROBUST_SLABS && !ORIGINAL && !bounded && load_face(0u).first > 0u;
}

// Of a face, three or four edge functions of a direction; `w` is added to the products.
struct Edges {
    vec4 a;
    vec4 b;
    vec4 c;
    vec4 d;
};

// With `sure` false nothing is within.
Edges edges_from(vec3 start, Face face, bool sure) {
    Side first = side_from(start, load_edges(int(face.first)));
    Side second = first;
    if (face.second != face.first) second = side_from(start, load_edges(int(face.second)));
    bool near = !sure || first.near || second.near;
    float scale = (near ? NEAR_SCALE : 1.0) / max(max(first.error, second.error), 1e-30);
    float base = near ? NEAR_SCALE : 1.0;
    // From between the two planes nothing is clear.
    if (first.below != (second.below != (face.turned == 1u))) {
        scale = 0.0;
        base = 1.0;
    }
    uint first_shared = face.seams & 3u;
    uint second_shared = face.seams >> 2;
    if (face.second == face.first) {
        return Edges(vec4(first.u * scale, base), vec4(first.v * scale, base), vec4(first.w * scale, base), vec4(0.0));
    }
    return Edges(vec4((first_shared == 0u ? first.v : first.u) * scale, base),
                 vec4((first_shared == 2u ? first.v : first.w) * scale, base),
                 vec4((second_shared == 0u ? second.v : second.u) * scale, base),
                 vec4((second_shared == 2u ? second.v : second.w) * scale, base));
}

// As bits, which have the floats' order where it counts: above 0.
int edge(vec4 side, vec3 direction) {
    return floatBitsToInt(side.x * direction.x + (side.y * direction.y + (side.z * direction.z + side.w)));
}

int least_of_three(Edges edges, vec3 direction) {
    return min(min(edge(edges.a, direction), edge(edges.b, direction)), edge(edges.c, direction));
}

int least_of_four(Edges edges, vec3 direction) {
    return min(least_of_three(edges, direction), edge(edges.d, direction));
}

#ifdef USES_CLOSEST

// Of a workgroup's camera rays, which start at one point: each invocation finds the edges of a face for all of them.
shared vec4 camera_edges[4u * WORKGROUP_SIZE];

bool closest_together(bool works, Ray ray, inout Hit hit) {
    Slabs slabs = slabs_of(ray);
    // Of any length: the errors are those of short directions.
    vec3 direction = ray.direction / dot(abs(ray.direction), vec3(1.0));
    uint lane = gl_LocalInvocationIndex;
    uint faces = load_face(0u).first;
    uint first = 0u;
    while (first < faces) {
        uint count = min(faces - first, WORKGROUP_SIZE);
        barrier();
        if (lane < count) {
            Edges edges = edges_from(frame.origin, load_face(1u + first + lane), false);
            camera_edges[4u * lane] = edges.a;
            camera_edges[4u * lane + 1u] = edges.b;
            camera_edges[4u * lane + 2u] = edges.c;
            camera_edges[4u * lane + 3u] = edges.d;
        }
        barrier();
        uint i = 0u;
        while (i < count) {
            uint place = 4u * i;
            Edges edges = Edges(camera_edges[place], camera_edges[place + 1u], camera_edges[place + 2u], camera_edges[place + 3u]);
            if (works && least_of_four(edges, direction) >= 0) {
                Face face = load_face(1u + first + i);
                closest_of_triangle(ray, slabs, int(face.first), hit);
                if (face.second != face.first) closest_of_triangle(ray, slabs, int(face.second), hit);
            }
            i++;
        }
        first += i;
    }
    return first >= faces;
}

void run_closest() {
    bool one_eye = frame.origin_dx == vec3(0.0) && frame.origin_dy == vec3(0.0);
    if (!(takes_faces(false) && one_eye)) {
        run_each_closest();
        return;
    }
    Ray ray;
    Hit hit;
    uint id;
    bool works = next_closest(ray, hit, id);
    bool finished = closest_together(works, ray, hit);
    if (works) retire_closest(id, hit, finished);
}

#endif

#ifdef USES_ANY

// Rays of an invocation under way.
#define RAYS 8
#define EACH_RAY(DO) DO(0) DO(1) DO(2) DO(3) DO(4) DO(5) DO(6) DO(7)

// Each of a pixel's invocations finds the edges of two faces for all of them.
#define FACES_AT_A_TIME (2u * SAMPLE_LANES)
// A word more for each pixel, so that they read different banks.
shared vec4 shared_edges[9u * WORKGROUP_SIZE];
shared uint group_left;
vec3 edge_start;

#undef BEGIN_ANY
#define BEGIN_ANY(works, start) edge_start = start

uint edges_place(uint face) {
    return gl_LocalInvocationIndex / SAMPLE_LANES * (4u * FACES_AT_A_TIME + 1u) + 4u * face;
}

void share_edges(uint first, uint count) {
    barrier();
    for (uint i = gl_LocalInvocationIndex % SAMPLE_LANES; i < count; i += SAMPLE_LANES) {
        Edges edges = edges_from(edge_start, load_face(first + i), true);
        uint place = edges_place(i);
        shared_edges[place] = edges.a;
        shared_edges[place + 1u] = edges.b;
        shared_edges[place + 2u] = edges.c;
        shared_edges[place + 3u] = edges.d;
    }
    barrier();
}

Edges shared_edges_of(uint i) {
    uint place = edges_place(i);
    return Edges(shared_edges[place], shared_edges[place + 1u], shared_edges[place + 2u], shared_edges[place + 3u]);
}

// Whether any invocation of the workgroup has rays left, which all have to know alike.
bool anyone_left() {
    if (gl_LocalInvocationIndex == 0u) group_left = 0u;
    barrier();
    if (any_left()) group_left = 1u;
    barrier();
    bool left = group_left == 1u;
    barrier();
    return left;
}

// Each ray by name, so that all stay in registers.
vec3 directions[RAYS];
// The most that any face came to of the least of its edge functions.
int most[RAYS];

#define TEST_THREE(i) most[i] = max(most[i], least_of_three(edges, directions[i]));
#define TEST_FOUR(i) most[i] = max(most[i], least_of_four(edges, directions[i]));

// Returns whether all faces were tested.
bool test_faces() {
    Face header = load_face(0u);
    uint first = 0u;
    while (first < header.first) {
        uint count = min(header.first - first, FACES_AT_A_TIME);
        uint fours = min(max(header.second, first) - first, count);
        share_edges(first + 1u, count);
        uint i = 0u;
        while (i < fours) {
            Edges edges = shared_edges_of(i);
            EACH_RAY(TEST_FOUR)
            i++;
        }
        while (i < count) {
            Edges edges = shared_edges_of(i);
            EACH_RAY(TEST_THREE)
            i++;
        }
        first += i;
    }
    return first >= header.first;
}

// The direction of the invocation's next ray, if there is one.
vec3 next_direction(inout uint count, inout uint first_id) {
    Ray ray;
    bool occluded;
    uint id;
    bool more = next_any(ray, occluded, id);
    if (count == 0u) first_id = id;
    count += more ? 1u : 0u;
    return ray.direction;
}

#define TAKE(i) directions[i] = next_direction(count, first_id); most[i] = -1;
#define JUDGE(i) occluded |= most[i] > WITHIN ? 1u << i : 0u; open |= most[i] >= 0 ? 1u << i : 0u;
#define CHOOSE(i) direction = place == i ? directions[i] : direction;
#define RETIRE(i) if (uint(i) < count) retire_any(first_id + uint(i) * SAMPLE_LANES, (occluded >> i & 1u) == 1u, finished);

void run_together() {
    while (anyone_left()) {
        uint count = 0u;
        uint first_id = 0u;
        EACH_RAY(TAKE)
        bool finished = test_faces();
        uint occluded = 0u;
        uint open = 0u;
        EACH_RAY(JUDGE)
        uint unsure = open & ~occluded & ((1u << count) - 1u);
        while (unsure != 0u) {
            int place = findLSB(unsure);
            unsure &= unsure - 1u;
            vec3 direction = vec3(0.0);
            EACH_RAY(CHOOSE)
            bool hit = false;
            finished = any_hit(Ray(edge_start, direction, frame.ambient_t_max), hit) && finished;
            occluded |= hit ? 1u << place : 0u;
        }
        finished = finished && unsure == 0u;
        EACH_RAY(RETIRE)
    }
}

void run_any() {
    if (takes_faces(frame.ambient_t_max < UNBOUNDED)) {
        run_together();
    } else {
        run_each_any();
    }
}

#endif
