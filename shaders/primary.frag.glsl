// The original's first form: what each pixel's centre sees, in a fragment shader over all triangles.
// Colour: barycentric coordinates (u, v, 0, 1); of equal hits the first. Nothing where there is no hit.
#include "shared/scene.glsl"
#include "shared/arith.glsl"
#include "shared/ray.glsl"
#include "shared/camera.glsl"
#include "shared/slabs.glsl"
#include "shared/intersect.glsl"

FRAGMENT_FROM_TOP
layout(location = 0) out vec4 color;

void main() {
    Ray ray = camera_ray_through(vec2(ivec2(gl_FragCoord.xy)) + frame.pixel_shift);
    float best = ray.t_max;
    color = vec4(0.0);
    for (uint i = 0u; i < frame.triangle_count; i++) {
        vec3 tuv;
        if (intersect_original(ray, load_triangle(int(i)), best, tuv) && tuv.x > 0.0 && tuv.x < best) {
            best = tuv.x;
            color = vec4(tuv.yz, 0.0, 1.0);
        }
    }
}
