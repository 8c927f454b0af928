// One ambient ray (sample_begin) of each pixel whose camera ray hit, as a list; in place of the
// others, rays that meet nothing.
#include "shared/scene.glsl"
#include "shared/arith.glsl"
#include "shared/ray.glsl"
#include "shared/camera.glsl"
#include "shared/rng.glsl"
#include "shared/sampling.glsl"
#include "shared/surface.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

STORAGE_BLOCK(BINDING_RAYS) writeonly buffer RayBlock { RayRecord rays[]; };
STORAGE_BLOCK(BINDING_HITS) readonly buffer HitBlock { HitRecord hits[]; };

void main() {
    uint pixel = range.pixel_begin + gl_GlobalInvocationID.x;
    if (pixel >= range.pixel_end) return;
    HitRecord record = hits[pixel - range.pixel_base];
    Ray ray = Ray(vec3(0.0), vec3(0.0, 0.0, 1.0), -1.0);
    if (record.index != NO_HIT) {
        Hit hit = Hit(record.t, record.u, record.v, record.index, 0u);
        Surface surface = surface_at(camera_ray(pixel_position(pixel)), hit);
        ray = ambient_ray(surface, pcg_numbers(pixel, range.sample_begin));
    }
    rays[pixel - range.pixel_base] = RayRecord(ray.origin, ray.t_max, ray.direction, 0u);
}
