// All of a pixel in one invocation: camera ray, closest hit, ambient rays, sum. (passes: single)
#define USES_CLOSEST
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
#include "shared/accumulate.glsl"
#include "shared/budgets.glsl"
#include "shared/counters.glsl"

// A tile of pixels.
layout(local_size_x = TILE_SIDE, local_size_y = TILE_SIDE) in;

STORAGE_BLOCK(BINDING_SEEDS) buffer SeedBlock { uint seeds[]; };

uint pixel;
ivec2 position;
Ray primary_ray;
Hit primary_hit;
bool primary_waits;
bool primary_finished;
Surface surface;
bool occluded_before;
bool part_lost;
uint lcg_state;
uint lcg_before;
uint sample_next;
uint sample_end;
uvec2 budget;
float sample_weight;
uvec2 escaped;
uvec2 traced;
float sum;
bool ray_overflowed;
uint overflowed;

#include "shared/parts.glsl"
#include "shared/pixel_work.glsl"

bool next_closest(out Ray ray, out Hit hit, out uint id) {
    ray = primary_ray;
    hit = primary_hit;
    id = pixel;
    ray_overflowed = false;
    bool waits = primary_waits;
    primary_waits = false;
    return waits;
}

void retire_closest(uint id, Hit hit, bool finished) {
    primary_hit = hit;
    primary_finished = finished;
    if (ray_overflowed) overflowed++;
}

bool any_left() { return sample_next < sample_end; }

bool next_any(out Ray ray, out bool occluded, out uint id) {
    id = sample_next;
    ray = Ray(vec3(0.0), vec3(0.0), 0.0);
    occluded = occluded_before;
    ray_overflowed = false;
    bool more = any_left();
    if (more) {
        sample_next++;
        lcg_before = lcg_state;
        vec2 u = sample_numbers(pixel, id, budget, lcg_state);
        ray = ambient_ray(surface, u);
        sample_weight = ORIGINAL ? original_weight(surface, ray.direction, u) : 1.0;
    }
    return more;
}

// An unfinished ray ends the pixel's work: what it has is kept, the rest is for another dispatch.
void retire_any(uint id, bool occluded, bool finished) {
    if (ray_overflowed) overflowed++;
    if (!finished || !last_part()) {
        carry_occlusion(occluded);
        part_lost = !finished && !last_part();
        lcg_state = lcg_before;
        sample_end = id;
        return;
    }
    occluded_before = false;
    traced[id & 1u]++;
    if (!occluded) {
        escaped[id & 1u]++;
        sum += sample_weight;
    }
}

#include "traverse"

// Whether the camera ray met a surface. The original's far plane is at 1, its near plane at 0.
bool trace_primary(bool works) {
    primary_ray = camera_ray(pixel);
    primary_hit = no_hit(primary_ray.t_max);
    if (works) primary_hit = carried_hit(primary_ray.t_max);
    primary_waits = works && range.stage != STAGE_ANY;
    primary_finished = true;
    begin_closest_work();
    run_closest();
    end_closest_work();
    bool within = !ORIGINAL || (primary_hit.t > 0.0 && primary_hit.t < 1.0);
    return works && primary_hit.index != NO_HIT && within;
}

void trace_ambient(bool works, bool hit) {
    occluded_before = false;
    part_lost = false;
    lcg_state = 0u;
    if (works) {
        if (hit) {
            surface = surface_at(primary_ray, primary_hit);
        } else {
            surface = surface_nowhere();
            sample_next = range.sample_begin;
        }
        occluded_before = carried_occlusion();
        if (SAMPLER == SAMPLER_LCG) lcg_state = seeds[pixel - range.pixel_base];
    } else {
        sample_end = sample_next;
    }
    BEGIN_ANY(works && hit, surface.start);
    begin_any_work();
    run_any();
    end_any_work();
}

// Invocations without work go all the way with the others: a method may have them help their subgroup.
void main() {
    pixel = range.pixel_begin + gl_WorkGroupID.x * WORKGROUP_SIZE + gl_LocalInvocationIndex;
    position = pixel_position(pixel);
    sample_next = 0u;
    sample_end = range.sample_end;
    budget = uvec2(0u);
    escaped = uvec2(0u);
    traced = uvec2(0u);
    sum = 0.0;
    overflowed = 0u;
    Counters mine = Counters(0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u);
    bool works = pixel < range.pixel_end && inside_image(position);
    if (works) {
        sample_next = first_open_sample(pixel);
        budget = sample_budget(pixel);
        sample_end = min(sample_end, budget.y);
        works = sample_next < sample_end;
    }
    bool hit = trace_primary(works);
    if (works && range.stage != STAGE_ANY && (last_part() || !primary_finished)) {
        mine.primary_asked = 1u;
        mine.primary_finished = primary_finished ? 1u : 0u;
    }
    if (works && range.stage == STAGE_CLOSEST) carry_hit(primary_hit);
    bool camera_ray_ended = range.stage == STAGE_BOTH || range.stage == STAGE_CLOSEST && last_part();
    if (works && camera_ray_ended && primary_finished && !hit && !ORIGINAL) mark_missed(pixel);
    works = works && range.stage != STAGE_CLOSEST && primary_finished && (hit || ORIGINAL);
    uint asked = sample_end - sample_next;
    trace_ambient(works, hit);
    if (works) {
        if (!hit) {
            traced = uvec2(0u);
            sum = 0.0;
        } else if (last_part() || part_lost) {
            mine.ambient_asked = asked;
            mine.ambient_finished = traced.x + traced.y;
        }
        if (last_part()) {
            add_samples(pixel, position, hit ? escaped : uvec2(0u), traced, sum);
            if (SAMPLER == SAMPLER_LCG) seeds[pixel - range.pixel_base] = lcg_state;
        }
    }
    mine.overflowed = overflowed;
    report(mine);
}
