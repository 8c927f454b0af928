// Ambient rays of the listed pixels: SAMPLE_LANES invocations share a block of one pixel's samples, each taking every so
// many of them, so that rays from one place go together. What came of the block is written where no other writes. (passes: split) Experiments: with ADDS_ATOMICALLY it adds to the pixel's counts instead, which
// other invocations add to as well; with ADDS_TO_ONE every escaped ray is also added to one place for all.
#define USES_ANY
#include "shared/scene.glsl"
#include "shared/arith.glsl"
#include "shared/ray.glsl"
#include "shared/camera.glsl"
#include "shared/slabs.glsl"
#include "shared/intersect.glsl"
#include "shared/rng.glsl"
#include "shared/samplers.glsl"
#include "shared/sampling.glsl"
#include "shared/surface.glsl"
#include "shared/counters.glsl"
#include "shared/list.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

STORAGE_BLOCK(BINDING_HITS) readonly buffer HitBlock { HitRecord hits[]; };
STORAGE_BLOCK(BINDING_SEEDS) readonly buffer SeedBlock { uint seeds[]; };
#ifdef ADDS_ATOMICALLY
STORAGE_BLOCK(BINDING_COUNTS) buffer CountBlock { Count counts[]; };
#else
STORAGE_BLOCK(BINDING_PARTIALS) writeonly buffer PartialBlock { Partial partials[]; };
#endif

uint pixel;
Surface surface;
uint lcg_state;
uint sample_next;
uint sample_end;
uvec2 budget;
float sample_weight;
uvec2 escaped;
uint finished_samples;
float sum;
bool ray_overflowed;
uint overflowed;

// A CPU device computes a ray beyond the last sample too: there a branch's body runs under a mask, skipped or not, and consecutive
// calls without one share what depends on the pixel alone. So they do where several rays are made in a row; what
// an invocation without work makes of the pixel that it has not is thrown away.
#ifdef ACCESSOR_TEXEL
#define COMPUTES_ALL true
#else
#define COMPUTES_ALL false
#endif

// All samples of an invocation are of one half where an even number of invocations takes them in turn: its seed is found once. So are both
// where many rays are made in a row.
#define KEEPS_HALF (SAMPLER == SAMPLER_SOBOL && REPEAT == 0u && SAMPLE_LANES % 2u == 0u)
#ifdef SHARES_START
#define KEEPS_HALVES (SAMPLER == SAMPLER_SOBOL && REPEAT == 0u)
#else
#define KEEPS_HALVES false
#endif
uvec2 half_seed;
uvec4 half_seeds;

vec2 next_numbers(uint id) {
    if (KEEPS_HALF) return sobol_point(half_seed, id, budget);
    if (KEEPS_HALVES) return sobol_point((id & 1u) == 0u ? half_seeds.xy : half_seeds.zw, id, budget);
    return sample_numbers(pixel, id, budget, lcg_state);
}

Ray make_ray(uint id) {
    vec2 u = next_numbers(id);
    Ray ray = ambient_ray(surface, u);
    sample_weight = ORIGINAL ? original_weight(surface, ray.direction, u) : 1.0;
    return ray;
}

bool any_left() { return sample_next < sample_end; }

bool next_any(out Ray ray, out bool occluded, out uint id) {
    id = sample_next;
    ray = Ray(vec3(0.0), vec3(0.0), 0.0);
    occluded = false;
    ray_overflowed = false;
    bool more = any_left();
    sample_next += more ? SAMPLE_LANES : 0u;
    if (more || COMPUTES_ALL) ray = make_ray(id);
    return more;
}

// An unfinished ray ends the block: what it has is kept, the rest is for another dispatch.
void retire_any(uint id, bool occluded, bool finished) {
    if (ray_overflowed) overflowed++;
    if (!finished) {
        sample_end = id;
        return;
    }
    finished_samples++;
    if (!occluded) {
        escaped[id & 1u]++;
        sum += sample_weight;
#ifdef ADDS_TO_ONE
        atomicAdd(counter_words[ESCAPED_WORD], 1u);
#endif
    }
}

#ifdef SHARES_START
// The first sample of the workgroup's block where no pixel lags.
uint block_begin() { return range.sample_begin + gl_WorkGroupID.z * range.block; }

bool has_sample(uint id) {
    return id >= sample_next && id < sample_end && (SAMPLE_LANES == 1u || (id - sample_next) % SAMPLE_LANES == 0u);
}

vec3 direction_of(uint id) { return ambient_ray(surface, next_numbers(id)).direction; }
#endif

#include "traverse"

// What the invocations of a pixel found, added up: escaped rays of either half, and whether any ray came to no end.
shared uint group_escaped0[WORKGROUP_SIZE];
shared uint group_escaped1[WORKGROUP_SIZE];
shared uint group_lost[WORKGROUP_SIZE];

// Adds up the invocations of each pixel; the first of them has the sum then. A block with an unfinished ray counts as not begun.
void add_up(uint member, uint lane, bool works, uint asked) {
    if (lane == 0u) {
        group_escaped0[member] = 0u;
        group_escaped1[member] = 0u;
        group_lost[member] = 0u;
    }
    barrier();
    if (works) {
        if (escaped.x > 0u) atomicAdd(group_escaped0[member], escaped.x);
        if (escaped.y > 0u) atomicAdd(group_escaped1[member], escaped.y);
        uint own = (max(asked, lane) - lane + SAMPLE_LANES - 1u) / SAMPLE_LANES;
        if (finished_samples != own) atomicAdd(group_lost[member], 1u);
    }
    barrier();
    bool whole = group_lost[member] == 0u;
    escaped = whole ? uvec2(group_escaped0[member], group_escaped1[member]) : uvec2(0u);
    finished_samples = whole ? asked : 0u;
    // With several invocations a pixel an escaped ray weighs 1.
    sum = float(escaped.x + escaped.y);
}

void main() {
    uint member = gl_LocalInvocationIndex / SAMPLE_LANES;
    uint lane = gl_LocalInvocationIndex % SAMPLE_LANES;
    uint place = gl_WorkGroupID.x * (WORKGROUP_SIZE / SAMPLE_LANES) + member;
    bool works = place < arguments.count;
    escaped = uvec2(0u);
    finished_samples = 0u;
    sum = 0.0;
    // Of rays that are not made by next_any.
    sample_weight = 1.0;
    overflowed = 0u;
    ray_overflowed = false;
    lcg_state = 0u;
    sample_next = 0u;
    sample_end = 0u;
    uint first_sample = 0u;
    uint asked = 0u;
    if (works) {
        Listed entry = listed[place];
        pixel = entry.pixel;
        uint skipped = gl_WorkGroupID.z * range.block;
        sample_next = range.sample_begin + entry.skip + skipped;
        budget = listed_budget(entry);
        sample_end = min(sample_next + range.block, min(range.sample_end, budget.y));
        first_sample = sample_next;
        asked = max(sample_end, sample_next) - sample_next;
        sample_next += lane;
        if (KEEPS_HALF) half_seed = sobol_seed(pixel, sample_next);
        if (KEEPS_HALVES) half_seeds = sobol_seeds(pixel);
        if (SAMPLER == SAMPLER_LCG) lcg_state = lcg_jump(seeds[pixel - range.pixel_base], 2u * skipped);
        HitRecord record = hits[pixel - range.pixel_base];
        Hit hit = Hit(record.t, record.u, record.v, record.index, 0u);
        surface = surface_at(camera_ray(pixel), hit);
    }
    BEGIN_ANY(works, surface.start);
    run_any();
    if (SAMPLE_LANES > 1u) {
        add_up(member, lane, works, asked);
        works = works && lane == 0u;
    }
#ifdef ADDS_ATOMICALLY
    Counters mine = Counters(0u, 0u, 0u, 0u, overflowed, 0u, 0u, 0u);
    if (works) {
        uint even = (finished_samples + 1u - (first_sample & 1u)) / 2u;
        uint i = pixel - range.pixel_base;
        if (escaped.x > 0u) atomicAdd(counts[i].escaped0, escaped.x);
        if (escaped.y > 0u) atomicAdd(counts[i].escaped1, escaped.y);
        if (even > 0u) atomicAdd(counts[i].traced0, even);
        if (finished_samples > even) atomicAdd(counts[i].traced1, finished_samples - even);
        mine.ambient_asked = asked;
        mine.ambient_finished = finished_samples;
    }
    report(mine);
#else
    if (works) {
        partials[gl_WorkGroupID.z * range.stride + place] =
            Partial(escaped.x, escaped.y, finished_samples, sum);
    }
    report_overflows(overflowed);
#endif
}
