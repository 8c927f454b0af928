// The camera ray of each pixel, as a list; beyond the image, rays that meet nothing.
#include "shared/scene.glsl"
#include "shared/ray.glsl"
#include "shared/camera.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

STORAGE_BLOCK(BINDING_RAYS) writeonly buffer RayBlock { RayRecord rays[]; };

void main() {
    uint pixel = range.pixel_begin + gl_GlobalInvocationID.x;
    if (pixel >= range.pixel_end) return;
    ivec2 position = pixel_position(pixel);
    Ray ray = camera_ray(pixel);
    float t_max = inside_image(position) ? ray.t_max : -1.0;
    rays[pixel - range.pixel_begin] = RayRecord(ray.origin, t_max, ray.direction, 1.0);
}
