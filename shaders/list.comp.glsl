// Lists the pixels of a range whose camera ray hit and that have samples to do, and writes how many workgroups the
// kernels over the list need. A workgroup's pixels stay together and in order, so that neighbours share their way
// through the tree; the order of the workgroups is left to chance, since counts add up in any order.
#include "shared/scene.glsl"
#include "shared/ray.glsl"
#include "shared/camera.glsl"
#include "shared/accumulate.glsl"
#include "shared/budgets.glsl"
#include "shared/list.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

STORAGE_BLOCK(BINDING_HITS) readonly buffer HitBlock { HitRecord hits[]; };

// Who of the workgroup is listed, a bit each.
shared uint group_mask[2];
shared uint group_begin;

bool camera_ray_hit(uint pixel) {
    HitRecord hit = hits[pixel - range.pixel_base];
    bool within = !ORIGINAL || (hit.t > 0.0 && hit.t < 1.0);
    return hit.index != NO_HIT && hit.index != UNFINISHED && within;
}

void main() {
    uint lane = gl_LocalInvocationIndex;
    uint pixel = range.pixel_begin + gl_WorkGroupID.x * WORKGROUP_SIZE + lane;
    uint first = 0u;
    uvec2 budget = uvec2(0u);
    bool listed_too = false;
    if (pixel < range.pixel_end && inside_image(pixel_position(pixel)) && camera_ray_hit(pixel)) {
        first = first_open_sample(pixel);
        budget = sample_budget(pixel);
        // A pixel that lags behind is taken up again when the others are through.
        listed_too = range.sample_begin <= first && first < min(range.sample_end, budget.y);
    }
    if (lane < 2u) group_mask[lane] = 0u;
    barrier();
    if (listed_too) atomicOr(group_mask[lane >> 5], 1u << (lane & 31u));
    barrier();
    uint low = bitCount(group_mask[0]);
    uint all = low + bitCount(group_mask[1]);
    if (lane == 0u && all > 0u) {
        group_begin = atomicAdd(arguments.count, all);
        uint end = group_begin + all;
        atomicMax(arguments.blocks_x, (end * SAMPLE_LANES + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE);
        atomicMax(arguments.pixels_x, (end + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE);
    }
    if (pixel == range.pixel_begin) {
        uint samples = range.sample_end - range.sample_begin;
        arguments.blocks_y = 1u;
        arguments.blocks_z = (samples + range.block - 1u) / range.block;
        arguments.pixels_y = 1u;
        arguments.pixels_z = 1u;
    }
    barrier();
    if (listed_too) {
        uint before = bitCount(group_mask[lane >> 5] & ((1u << (lane & 31u)) - 1u));
        uint place = group_begin + (lane < 32u ? 0u : low) + before;
        listed[place] = Listed(pixel, first - range.sample_begin, budget.x, budget.y);
    }
}
