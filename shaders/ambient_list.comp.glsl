// Ambient rays of the listed pixels: an invocation takes a block of one pixel's samples and writes what came of it
// where no other writes. (passes: split) Experiments: with ADDS_ATOMICALLY it adds to the pixel's counts instead, which
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

bool next_any(out Ray ray, out bool occluded, out uint id) {
    id = sample_next;
    ray = Ray(vec3(0.0), vec3(0.0), 0.0);
    occluded = false;
    ray_overflowed = false;
    bool more = sample_next < sample_end;
    if (more) {
        sample_next++;
        vec2 u = sample_numbers(pixel, id, budget, lcg_state);
        ray = ambient_ray(surface, u);
        sample_weight = ORIGINAL ? original_weight(surface, ray.direction, u) : 1.0;
    }
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
        atomicAdd(counters[0].escaped, 1u);
#endif
    }
}

#include "traverse"

void main() {
    uint place = list_place();
    bool works = place < arguments.count;
    escaped = uvec2(0u);
    finished_samples = 0u;
    sum = 0.0;
    overflowed = 0u;
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
        if (SAMPLER == SAMPLER_LCG) lcg_state = lcg_jump(seeds[pixel - range.pixel_base], 2u * skipped);
        HitRecord record = hits[pixel - range.pixel_base];
        Hit hit = Hit(record.t, record.u, record.v, record.index, 0u);
        surface = surface_at(camera_ray(pixel), hit);
    }
    run_any();
    Counters mine = Counters(0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u);
    if (works) {
#ifdef ADDS_ATOMICALLY
        uint even = (finished_samples + 1u - (first_sample & 1u)) / 2u;
        uint i = pixel - range.pixel_base;
        if (escaped.x > 0u) atomicAdd(counts[i].escaped0, escaped.x);
        if (escaped.y > 0u) atomicAdd(counts[i].escaped1, escaped.y);
        if (even > 0u) atomicAdd(counts[i].traced0, even);
        if (finished_samples > even) atomicAdd(counts[i].traced1, finished_samples - even);
        mine.ambient_asked = asked;
        mine.ambient_finished = finished_samples;
#else
        partials[gl_WorkGroupID.z * range.stride + place] =
            Partial(escaped.x, escaped.y, finished_samples, sum);
#endif
    }
    mine.overflowed = overflowed;
    report(mine);
}
