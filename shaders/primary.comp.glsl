// The closest hit of each pixel's camera ray, kept for the passes that follow. (passes: split) STAGE_CLOSEST: of every
// pixel of the range; otherwise only where it is not known yet.
#define USES_CLOSEST
#include "shared/scene.glsl"
#include "shared/arith.glsl"
#include "shared/ray.glsl"
#include "shared/camera.glsl"
#include "shared/slabs.glsl"
#include "shared/intersect.glsl"
#include "shared/counters.glsl"

layout(local_size_x = TILE_SIDE, local_size_y = TILE_SIDE) in;

STORAGE_BLOCK(BINDING_HITS) buffer HitBlock { HitRecord hits[]; };

uint pixel;
Ray primary_ray;
bool waits;
bool ray_overflowed;
bool ray_finished;

bool next_closest(out Ray ray, out Hit hit, out uint id) {
    id = pixel;
    bool more = waits;
    waits = false;
    ray = primary_ray;
    hit = no_hit(ray.t_max);
    return more;
}

void retire_closest(uint id, Hit hit, bool finished) {
    hits[id - range.pixel_base] = HitRecord(hit.t, hit.u, hit.v, finished ? hit.index : UNFINISHED);
    ray_finished = finished;
}

#include "traverse"

void main() {
    pixel = range.pixel_begin + gl_WorkGroupID.x * WORKGROUP_SIZE + gl_LocalInvocationIndex;
    bool works = pixel < range.pixel_end && inside_image(pixel_position(pixel));
    if (works && range.stage != STAGE_CLOSEST) works = hits[pixel - range.pixel_base].index == UNFINISHED;
    // Outside of control flow, where a CPU device reads the frame once for all lanes.
    primary_ray = camera_ray(pixel);
    waits = works;
    ray_overflowed = false;
    ray_finished = false;
    run_closest();
    Counters mine = Counters(0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u);
    mine.primary_asked = works ? 1u : 0u;
    mine.primary_finished = ray_finished ? 1u : 0u;
    mine.overflowed = ray_overflowed ? 1u : 0u;
    report(mine);
}
