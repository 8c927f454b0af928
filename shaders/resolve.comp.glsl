// Adds up what the listed pixels' samples came to, block by block (passes: split) or ray by ray (ANSWERS; passes:
// staged), and adds it to the picture. A pixel takes its samples in order up to the first that is missing, so that its
// count tells which one comes next.
#include "shared/scene.glsl"
#include "shared/ray.glsl"
#include "shared/camera.glsl"
#include "shared/rng.glsl"
#include "shared/accumulate.glsl"
#include "shared/counters.glsl"
#include "shared/list.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

STORAGE_BLOCK(BINDING_SEEDS) buffer SeedBlock { uint seeds[]; };
#ifdef ANSWERS
STORAGE_BLOCK(BINDING_RAYS) readonly buffer RayBlock { RayRecord rays[]; };
STORAGE_BLOCK(BINDING_ANSWERS) readonly buffer AnswerBlock { HitRecord answers[]; };

Partial load_partial(uint element, uint first_sample) {
    uint index = answers[element].index;
    bool escaped = index == NO_HIT;
    bool even = (first_sample & 1u) == 0u;
    return Partial(escaped && even ? 1u : 0u, escaped && !even ? 1u : 0u, index == UNFINISHED ? 0u : 1u,
                   escaped ? rays[element].weight : 0.0);
}
#else
STORAGE_BLOCK(BINDING_PARTIALS) readonly buffer PartialBlock { Partial partials[]; };

Partial load_partial(uint element, uint first_sample) { return partials[element]; }
#endif

void main() {
    uint place = list_place();
    Counters mine = Counters(0u, 0u, 0u, 0u, 0u, 0u, 0u, 0u);
    if (place < arguments.count) {
        Listed entry = listed[place];
        uint first_sample = range.sample_begin + entry.skip;
        uint asked = min(range.sample_end, listed_budget(entry).y) - first_sample;
        uvec2 escaped = uvec2(0u);
        uint finished = 0u;
        float sum = 0.0;
        uint block = 0u;
        bool more = asked > 0u;
        // A loop that asks first runs its body once more on a CPU device.
        do {
            if (more) {
                Partial part = load_partial(block * range.stride + place, first_sample + block * range.block);
                escaped += uvec2(part.escaped0, part.escaped1);
                finished += part.finished;
                sum += part.sum;
                block++;
                more = finished == min(block * range.block, asked) && block * range.block < asked;
            }
        } while (more);
        // Of samples in a row, every other one is even.
        uint even = (finished + 1u - (first_sample & 1u)) / 2u;
        add_samples(entry.pixel, pixel_position(entry.pixel), escaped, uvec2(even, finished - even), sum);
        if (SAMPLER == SAMPLER_LCG) {
            uint state = seeds[entry.pixel - range.pixel_base];
            seeds[entry.pixel - range.pixel_base] = lcg_jump(state, 2u * finished);
        }
        // With ANSWERS the kernel that gave them counted the rays.
#ifndef ANSWERS
        mine.ambient_asked = asked;
        mine.ambient_finished = finished;
#endif
    }
    report(mine);
}
