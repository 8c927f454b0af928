// Any hits from entries, where the lanes of a subgroup take over each other's work (work stealing: Blumofe and Leiserson, "Scheduling
// Multithreaded Computations by Work Stealing", 1999). If each lane walks its own ray to the end, all wait for the longest way, and a fifth to a
// half of them is at work (docs/measurements.md). Here a lane with nothing to do takes its next ray or, where it has none, a subtree that waits for another
// lane's ray. That ray's bit tells who else walks for it when it is occluded.
//
// Rays are made by all lanes together, a batch, when none of the batch before waits for a lane; so the last rays of a batch go beside the first of the next.
// A triangle that the ray may meet, but not surely, ends no walk. The exact test decides at the very end, for rays that met no other one:
// in the walk it would take a GPU an eighth of its time. Who walks what changes no answer: the twin is that of entry.glsl.

// Nodes that a lane visits at most before the subgroup looks who needs work: with fewer, votes cost more than what they gain.
#define NODES_BETWEEN_VOTES 4u
// Work is handed over where a lane in so many is idle.
#define ONE_IDLE_IN 4u
// Leaves wait for one another until so many eighths of the lanes have one, or none can go on without.
#define EIGHTHS_WITH_LEAVES 3u
// Bits of a word. With a lane a pixel each batch is told of before the next is made: so it is where a driver may leave loops early, and rays that come to their end within its limit must
// not be lost because later ones do not; and where numbers or weights follow from ray to ray.
#define MOST_BATCHES (SAMPLE_LANES == 1u ? 1u : 32u)

// Of the rays that an invocation made, a bit for each batch: those that met a triangle surely, and those that may have met one.
shared uint occluded_rays[WORKGROUP_SIZE];
shared uint unsure_rays[WORKGROUP_SIZE];

// What a lane walks for: a ray, its own or another one's, the invocation that made it and its bit there.
Ray walked;
GrownRay grown_walked;
uint maker;
uint maker_bit;
// Where it is: a node, or a leaf if another one waits already; what waits on the stack; entries.
int reference;
int leaf;
int top;
uint waiting;

// The lane's ray of the last batch, its bit, and those of its entries that nobody has taken.
Ray made_ray;
uint made_bit;
uint made_entries;

// Of the subgroup: a driver may run fewer than it tells of.
uint lanes;

bool walks() { return reference != NOTHING || leaf != NOTHING; }

int take_waiting() { return top > 0 ? stack[--top] : waiting != 0u ? next_entry(waiting) : NOTHING; }

void walk_for(Ray ray, uint invocation, uint bit) {
    walked = ray;
    grown_walked = grown_ray_of(ray);
    maker = invocation;
    maker_bit = bit;
}

// Idle lanes take a subtree each from those that have some to give. Every lane of the subgroup calls this.
void hand_over() {
    bool takes = !walks();
    bool of_made = made_entries != 0u;
    bool gives = of_made || top > 0 || waiting != 0u;
    if (subgroupAny(takes) && subgroupAny(gives)) {
        // None does both: what an idle lane has made it has taken by now.
        uint from = pair_up(takes, gives);
        int given = !gives ? NOTHING : of_made ? next_entry(made_entries) : take_waiting();
        given = subgroupShuffle(given, from);
        vec3 origin = subgroupShuffle(of_made ? made_ray.origin : walked.origin, from);
        vec3 direction = subgroupShuffle(of_made ? made_ray.direction : walked.direction, from);
        float t_max = UNBOUNDED;
        if (BOUNDED) t_max = subgroupShuffle(of_made ? made_ray.t_max : walked.t_max, from);
        uint invocation = subgroupShuffle(of_made ? gl_LocalInvocationIndex : maker, from);
        uint bit = subgroupShuffle(of_made ? made_bit : maker_bit, from);
        if (takes) {
            walk_for(Ray(origin, direction, t_max), invocation, bit);
            reference = given;
        }
    }
}

void walk_some_nodes() {
    float t_max = box_limit(walked.t_max);
    uint nodes = 0u;
    bool more = reference >= 0;
    while (more) {
        ivec2 children;
        bvec2 meets = met_children(grown_walked, reference, t_max, children);
        if (meets.x && meets.y) stack[top++] = children.y;
        reference = meets.x ? children.x : children.y;
        if (!meets.x && !meets.y) reference = take_waiting();
        nodes++;
        more = reference >= 0 && nodes < NODES_BETWEEN_VOTES;
    }
    if (leaf == NOTHING && reference < 0 && reference != NOTHING) {
        leaf = reference;
        reference = take_waiting();
    }
}

// Tests the leaf that waits. Returns whether it came to its end.
bool test_leaf() {
    int index = leaf_first(leaf);
    int last = leaf_last(leaf);
    bool meets = false;
    bool unsure = false;
    for (; index <= last && !meets; index++) {
        int verdict = verdict_of(walked, index);
        meets = verdict == MEETS;
        unsure = unsure || verdict == MAY_MEET;
    }
    if (meets) atomicOr(occluded_rays[maker], maker_bit);
    if (!meets && unsure) atomicOr(unsure_rays[maker], maker_bit);
    leaf = NOTHING;
    return CAME_TO_END(meets || index > last);
}

// Up to MOST_BATCHES rays of each lane.
void run_batches() {
    occluded_rays[gl_LocalInvocationIndex] = 0u;
    unsure_rays[gl_LocalInvocationIndex] = 0u;
    lanes = lanes_with(true);
    walk_for(Ray(vec3(0.0), vec3(0.0), 0.0), gl_LocalInvocationIndex, 0u);
    made_ray = walked;
    made_bit = 0u;
    made_entries = 0u;
    reference = NOTHING;
    leaf = NOTHING;
    top = 0;
    waiting = 0u;
    uint first_id = 0u;
    // Rays of this lane.
    uint made = 0u;
    // Of the subgroup.
    uint batches = 0u;
    bool open = true;
    bool finished = true;
    bool more = true;
    while (more) {
        uint idle = lanes_with(!walks());
        if (idle * ONE_IDLE_IN >= lanes) {
            if (open && !subgroupAny(made_entries != 0u)) {
                bool occluded;
                uint id;
                bool has_ray = next_any(made_ray, occluded, id);
                if (has_ray && made == 0u) first_id = id;
                if (has_ray) {
                    made++;
                    made_bit = 1u << batches;
                    made_entries = met_entries(grown_ray_of(made_ray), box_limit(made_ray.t_max), finished);
                }
                batches++;
                // Lanes that parted must be together again before they vote.
                subgroupBarrier();
                open = batches < MOST_BATCHES && subgroupAny(any_left());
            }
            if (!walks() && made_entries != 0u) {
                walk_for(made_ray, gl_LocalInvocationIndex, made_bit);
                waiting = made_entries;
                made_entries = 0u;
                reference = next_entry(waiting);
            }
            subgroupBarrier();
            hand_over();
        }
        walk_some_nodes();
        // A lane tells all that it comes to know before others look.
        subgroupBarrier();
        uint with_leaf = lanes_with(leaf != NOTHING);
        if (with_leaf * 8u >= EIGHTHS_WITH_LEAVES * lanes || !subgroupAny(reference >= 0)) {
            if (leaf != NOTHING) finished = test_leaf() && finished;
            subgroupBarrier();
            if ((occluded_rays[maker] & maker_bit) != 0u) {
                reference = NOTHING;
                top = 0;
                waiting = 0u;
            }
            if ((occluded_rays[gl_LocalInvocationIndex] & made_bit) != 0u) made_entries = 0u;
            subgroupBarrier();
        }
        more = subgroupAny(open || walks() || made_entries != 0u);
    }
    subgroupBarrier();
    // Not where a driver left a loop early.
    bool ended = subgroupAll(finished && !open && !walks() && made_entries == 0u);
    uint met = occluded_rays[gl_LocalInvocationIndex];
    uint unsure = unsure_rays[gl_LocalInvocationIndex] & ~met;
    if (!ended && made > 0u) retire_any(first_id, false, false);
    for (uint batch = 0u; batch < made && ended; batch++) {
        uint id = first_id + batch * SAMPLE_LANES;
        uint bit = 1u << batch;
        bool occluded = (met & bit) != 0u;
        if ((unsure & bit) != 0u) {
            Ray ray = made_ray;
            if (MOST_BATCHES > 1u) ray = make_ray(id);
            ended = any_hit_left_first(ray, occluded);
        }
        retire_any(id, occluded, ended);
    }
}

void run_any() {
    bool more = subgroupAny(any_left());
    while (more) {
        run_batches();
        subgroupBarrier();
        more = subgroupAny(any_left());
    }
}
