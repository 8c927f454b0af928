// Closest hits where the lanes of a subgroup take over each other's work, as they do for any hits in stealing.glsl: else all wait for the ray with the longest
// way, and at the end most of a GPU waits for a few subgroups. A lane with nothing to do takes the subtree that another lane would walk next. What is known of a
// ray lies where all who walk for it see it. A closest hit does not depend on the order of visits, so who walks changes no answer: the twin is
// that of ordered.glsl.

// Nodes that a lane visits at most before its subgroup tests leaves and looks who needs work.
#define NODES_BEFORE_LEAVES 6u
// Work is handed over where a lane in so many is idle.
#define ONE_IDLE_IN 4u

// Of each invocation's ray: the closest hit so far, and whether a lane is about to change it.
shared float nearest_t[WORKGROUP_SIZE];
shared vec2 nearest_uv[WORKGROUP_SIZE];
shared uvec2 nearest_triangle[WORKGROUP_SIZE];
shared uint changes[WORKGROUP_SIZE];

Hit nearest_hit(uint invocation) {
    vec2 uv = nearest_uv[invocation];
    uvec2 triangle = nearest_triangle[invocation];
    return Hit(nearest_t[invocation], uv.x, uv.y, triangle.x, triangle.y);
}

void store_nearest(uint invocation, Hit hit) {
    nearest_t[invocation] = hit.t;
    nearest_uv[invocation] = vec2(hit.u, hit.v);
    nearest_triangle[invocation] = uvec2(hit.index, hit.id);
}

// Keeps what lanes found for the rays of those that made them, the closest of each. Every lane of the subgroup calls this.
void keep_nearest(uint maker, bool found, Hit hit) {
    bool waits = found;
    bool more = subgroupAny(waits);
    while (more) {
        // Not a plain word: of one written before a subgroup's barrier Mesa's software device takes each lane's own value to be there behind it.
        bool turn = waits && atomicExchange(changes[maker], 1u) == 0u;
        subgroupBarrier();
        if (turn) {
            float t = nearest_t[maker];
            if (hit.t < t || (hit.t == t && hit.id < nearest_triangle[maker].y)) store_nearest(maker, hit);
            atomicExchange(changes[maker], 0u);
            waits = false;
        }
        subgroupBarrier();
        more = subgroupAny(waits);
    }
}

// Every lane of the subgroup calls this. Leaves `finished` to whether all leaves came to their end.
Hit closest_hit_together(Ray ray, Hit hit, bool has_ray, out bool finished) {
    finished = true;
    store_nearest(gl_LocalInvocationIndex, hit);
    changes[gl_LocalInvocationIndex] = 0u;
    uint lanes = lanes_with(true);
    // What a lane walks for: a ray, its own or another one's, the invocation that made it, and the closest hit of it that the lane knows of.
    Ray walked = ray;
    Slabs slabs = slabs_of(ray);
    uint maker = gl_LocalInvocationIndex;
    float t_max = hit.t;
    int top = 0;
    int reference = has_ray ? ROOT : NOTHING;
    bool more = subgroupAny(has_ray);
    while (more) {
        uint steps = 0u;
        bool walks = reference >= 0;
        while (walks) {
            reference = nearer_child(slabs, reference, t_max, top);
            steps++;
            walks = reference >= 0 && steps < NODES_BEFORE_LEAVES;
        }
        bool at_leaf = reference < 0 && reference != NOTHING;
        subgroupBarrier();
        if (subgroupAny(at_leaf)) {
            Hit found = nearest_hit(maker);
            found.index = NO_HIT;
            if (at_leaf) finished = closest_of_leaf(walked, slabs, leaf_first(reference), leaf_last(reference), found) && finished;
            // Others have read what was known before it changes.
            subgroupBarrier();
            keep_nearest(maker, found.index != NO_HIT, found);
            t_max = nearest_t[maker];
            if (at_leaf) reference = pop_near(top, t_max);
        }
        bool takes = reference == NOTHING;
        bool gives = top > 0;
        uint idle = lanes_with(takes);
        more = idle < lanes;
        if (more && idle * ONE_IDLE_IN >= lanes && subgroupAny(gives)) {
            uint from = pair_up(takes, gives);
            int given = NOTHING;
            if (gives) given = pop_near(top, t_max);
            given = subgroupShuffle(given, from);
            vec3 origin = subgroupShuffle(walked.origin, from);
            vec3 direction = subgroupShuffle(walked.direction, from);
            float limit = subgroupShuffle(t_max, from);
            uint invocation = subgroupShuffle(maker, from);
            if (takes) {
                walked = Ray(origin, direction, limit);
                slabs = slabs_of(walked);
                maker = invocation;
                t_max = limit;
                reference = given;
            }
        }
    }
    subgroupBarrier();
    // Who walked for a ray is not known any more.
    finished = subgroupAll(finished);
    return nearest_hit(gl_LocalInvocationIndex);
}

void run_closest_together() {
    bool more = true;
    while (more) {
        Ray ray;
        Hit hit;
        uint id;
        bool has_ray = next_closest(ray, hit, id);
        subgroupBarrier();
        more = subgroupAny(has_ray);
        bool finished = true;
        if (more) hit = closest_hit_together(ray, hit, has_ray, finished);
        if (has_ray) retire_closest(id, hit, finished);
    }
}

void run_closest() {
    // Where a driver leaves loops each ray has to prove its own end. The original keeps the last of equal hits. Of boxes by plain slabs it is not sure that each holds the hits of its
    // triangles, so that hits could depend on what was known when a box was met.
    if (LEAVES_LOOPS || ORIGINAL || !ROBUST_SLABS) {
        run_each_closest();
    } else {
        run_closest_together();
    }
}
