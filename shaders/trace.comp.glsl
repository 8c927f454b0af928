// A list of rays: closest hit (STAGE_CLOSEST) or any hit (STAGE_ANY) of each.
#define USES_CLOSEST
#define USES_ANY
#include "shared/scene.glsl"
#include "shared/arith.glsl"
#include "shared/ray.glsl"
#include "shared/slabs.glsl"
#include "shared/intersect.glsl"
#include "shared/counters.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

STORAGE_BLOCK(BINDING_RAYS) readonly buffer RayBlock { RayRecord rays[]; };
STORAGE_BLOCK(BINDING_HITS) writeonly buffer HitBlock { HitRecord hits[]; };

bool waits;
bool ray_overflowed;
bool ray_finished;

uint ray_index() { return range.pixel_begin + gl_GlobalInvocationID.x; }

Ray listed_ray() {
    RayRecord record = rays[ray_index()];
    return Ray(record.origin, record.direction, record.t_max);
}

bool next_closest(out Ray ray, out Hit hit, out uint id) {
    id = ray_index();
    bool more = waits;
    waits = false;
    ray = more ? listed_ray() : Ray(vec3(0.0), vec3(0.0), 0.0);
    hit = no_hit(ray.t_max);
    return more;
}

void retire_closest(uint id, Hit hit, bool finished) {
    hits[id] = HitRecord(hit.t, hit.u, hit.v, hit.index);
    ray_finished = finished;
}

bool next_any(out Ray ray, out bool occluded, out uint id) {
    id = ray_index();
    bool more = waits;
    waits = false;
    ray = more ? listed_ray() : Ray(vec3(0.0), vec3(0.0), 0.0);
    occluded = false;
    return more;
}

// Of an any hit nothing but its existence is known: index 0 or NO_HIT.
void retire_any(uint id, bool occluded, bool finished) {
    hits[id] = HitRecord(0.0, 0.0, 0.0, occluded ? 0u : NO_HIT);
    ray_finished = finished;
}

#include "traverse"

void main() {
    bool works = ray_index() < range.pixel_end;
    waits = works;
    ray_overflowed = false;
    ray_finished = false;
    bool closest = range.stage == STAGE_CLOSEST;
    if (closest) {
        run_closest();
    } else {
        run_any();
    }
    Counters mine = Counters(0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u);
    mine.primary_asked = works && closest ? 1u : 0u;
    mine.primary_finished = ray_finished && closest ? 1u : 0u;
    mine.ambient_asked = works && !closest ? 1u : 0u;
    mine.ambient_finished = ray_finished && !closest ? 1u : 0u;
    mine.overflowed = ray_overflowed ? 1u : 0u;
    report(mine);
}
