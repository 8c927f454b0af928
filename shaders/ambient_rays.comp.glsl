// Ambient rays as a list. LISTED: of the listed pixels, a block of samples after the other (passes: staged).
// Otherwise one (sample_begin; `pcg` in place of `lcg`, whose states are not there) of each pixel whose camera ray hit; in
// place of the others, rays that meet nothing.
#include "shared/scene.glsl"
#include "shared/arith.glsl"
#include "shared/ray.glsl"
#include "shared/camera.glsl"
#include "shared/rng.glsl"
#include "shared/samplers.glsl"
#include "shared/sampling.glsl"
#include "shared/surface.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

STORAGE_BLOCK(BINDING_RAYS) writeonly buffer RayBlock { RayRecord rays[]; };
STORAGE_BLOCK(BINDING_HITS) readonly buffer HitBlock { HitRecord hits[]; };

const RayRecord NO_RAY = RayRecord(vec3(0.0), -1.0, vec3(0.0, 0.0, 1.0), 0.0);

Surface kept_surface(uint pixel) {
    HitRecord record = hits[pixel - range.pixel_base];
    Hit hit = Hit(record.t, record.u, record.v, record.index, 0u);
    return surface_at(camera_ray(pixel), hit);
}

#ifdef LISTED

#include "shared/list.glsl"

STORAGE_BLOCK(BINDING_SEEDS) readonly buffer SeedBlock { uint seeds[]; };

void main() {
    uint place = list_place();
    RayRecord record = NO_RAY;
    if (place < arguments.count) {
        Listed entry = listed[place];
        uint id = range.sample_begin + entry.skip + gl_WorkGroupID.z;
        uvec2 budget = listed_budget(entry);
        if (id < min(range.sample_end, budget.y)) {
            uint lcg_state = 0u;
            if (SAMPLER == SAMPLER_LCG) {
                lcg_state = lcg_jump(seeds[entry.pixel - range.pixel_base], 2u * gl_WorkGroupID.z);
            }
            vec2 u = sample_numbers(entry.pixel, id, budget, lcg_state);
            Surface surface = kept_surface(entry.pixel);
            Ray ray = ambient_ray(surface, u);
            float weight = ORIGINAL ? original_weight(surface, ray.direction, u) : 1.0;
            record = RayRecord(ray.origin, ray.t_max, ray.direction, weight);
        }
    }
    // The last workgroup writes its whole width, so that no stale ray is left for the kernel that traces them.
    rays[gl_WorkGroupID.z * range.stride + place] = record;
}

#else

void main() {
    uint pixel = range.pixel_begin + gl_GlobalInvocationID.x;
    if (pixel >= range.pixel_end) return;
    RayRecord record = NO_RAY;
    if (hits[pixel - range.pixel_base].index != NO_HIT) {
        uint no_state = 0u;
        vec2 u = SAMPLER == SAMPLER_LCG ? pcg_numbers(pixel, range.sample_begin)
                                        : sample_numbers(pixel, range.sample_begin, uvec2(range.set_begin, range.set_end), no_state);
        Ray ray = ambient_ray(kept_surface(pixel), u);
        record = RayRecord(ray.origin, ray.t_max, ray.direction, 1.0);
    }
    rays[pixel - range.pixel_base] = record;
}

#endif
