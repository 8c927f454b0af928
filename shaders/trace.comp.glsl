// A list of rays: closest hit (STAGE_CLOSEST) or any hit (STAGE_ANY) of each; several blocks of them where the dispatch
// is deep. The answer to a pixel's ray stands at that pixel's place.
#define USES_CLOSEST
#define USES_ANY
#define LISTS_RAYS
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

uint ray_index() { return gl_WorkGroupID.z * range.stride + gl_GlobalInvocationID.x; }

uint answer_index() { return range.pixel_begin - range.pixel_base + ray_index(); }

Ray listed_ray() {
    RayRecord record = rays[ray_index()];
    return Ray(record.origin, record.direction, record.t_max);
}

bool next_closest(out Ray ray, out Hit hit, out uint id) {
    id = answer_index();
    bool more = waits;
    waits = false;
    ray = more ? listed_ray() : Ray(vec3(0.0), vec3(0.0), 0.0);
    hit = no_hit(ray.t_max);
    return more;
}

void retire_closest(uint id, Hit hit, bool finished) {
    hits[id] = HitRecord(hit.t, hit.u, hit.v, finished ? hit.index : UNFINISHED);
    ray_finished = finished;
}

bool any_left() { return waits; }

bool next_any(out Ray ray, out bool occluded, out uint id) {
    id = answer_index();
    bool more = waits;
    waits = false;
    ray = more ? listed_ray() : Ray(vec3(0.0), vec3(0.0), 0.0);
    occluded = false;
    return more;
}

// Of an any hit nothing but its existence is known: index 0 or NO_HIT.
void retire_any(uint id, bool occluded, bool finished) {
    hits[id] = HitRecord(0.0, 0.0, 0.0, finished ? (occluded ? 0u : NO_HIT) : UNFINISHED);
    ray_finished = finished;
}

#include "traverse"

void main() {
    bool works = gl_GlobalInvocationID.x < range.pixel_end - range.pixel_begin;
    waits = works;
    // What stands in the place of a ray that does not exist has an answer, but does not count.
    bool counts = works && rays[ray_index()].t_max >= 0.0;
    ray_overflowed = false;
    ray_finished = false;
    bool closest = range.stage == STAGE_CLOSEST;
    if (closest) {
        run_closest();
    } else {
        BEGIN_ANY(counts, counts ? rays[ray_index()].origin : vec3(0.0));
        run_any();
    }
    Counters mine = Counters(0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u);
    if (closest) {
        mine.primary_asked = counts ? 1u : 0u;
        mine.primary_finished = counts && ray_finished ? 1u : 0u;
    } else {
        mine.ambient_asked = counts ? 1u : 0u;
        mine.ambient_finished = counts && ray_finished ? 1u : 0u;
    }
    mine.overflowed = ray_overflowed ? 1u : 0u;
    report(mine);
}
