// Lists the pixels of a range whose camera ray hit and that have samples to do, and writes how many workgroups the
// kernels over the list need. A workgroup takes LIST_TILES tiles, since all workgroups add to the same few words; their
// pixels stay together and in order, so that neighbours share their way through the tree; the order of the workgroups is
// left to chance, since counts add up in any order.
#include "shared/scene.glsl"
#include "shared/ray.glsl"
#include "shared/camera.glsl"
#include "shared/accumulate.glsl"
#include "shared/budgets.glsl"
#include "shared/list.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

STORAGE_BLOCK(BINDING_HITS) readonly buffer HitBlock { HitRecord hits[]; };

// Who of the workgroup's pixels is listed, a bit each: two words a tile.
#define MASKS (2u * LIST_TILES)
shared uint group_mask[MASKS];
shared uint group_begin;

bool camera_ray_hit(uint pixel) {
    HitRecord hit = hits[pixel - range.pixel_base];
    bool within = !ORIGINAL || (hit.t > 0.0 && hit.t < 1.0);
    return hit.index != NO_HIT && hit.index != UNFINISHED && within;
}

// Counted from the range's first: a tile may lie behind the last pixel that has a number.
uint place_of(uint tile) { return (gl_WorkGroupID.x * LIST_TILES + tile) * WORKGROUP_SIZE + gl_LocalInvocationIndex; }

bool is_listed(uint place) {
    uint pixel = range.pixel_begin + place;
    if (place >= range.pixel_end - range.pixel_begin) return false;
    if (!inside_image(pixel_position(pixel)) || !camera_ray_hit(pixel)) return false;
    uint first = first_open_sample(pixel);
    // A pixel that lags behind is taken up again when the others are through.
    return range.sample_begin <= first && first < min(range.sample_end, sample_budget(pixel).y);
}

void main() {
    uint lane = gl_LocalInvocationIndex;
    if (lane < MASKS) group_mask[lane] = 0u;
    barrier();
    for (uint tile = 0u; tile < LIST_TILES; tile++) {
        if (is_listed(place_of(tile))) atomicOr(group_mask[(tile * WORKGROUP_SIZE + lane) >> 5], 1u << (lane & 31u));
    }
    barrier();
    if (lane == 0u) {
        uint all = 0u;
        for (uint i = 0u; i < MASKS; i++) all += bitCount(group_mask[i]);
        if (all > 0u) {
            group_begin = atomicAdd(arguments.count, all);
            uint end = group_begin + all;
            atomicMax(arguments.blocks_x, (end * SAMPLE_LANES + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE);
            atomicMax(arguments.pixels_x, (end + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE);
        }
    }
    if (gl_WorkGroupID.x == 0u && lane == 0u) {
        uint samples = range.sample_end - range.sample_begin;
        arguments.blocks_y = 1u;
        arguments.blocks_z = (samples + range.block - 1u) / range.block;
        arguments.pixels_y = 1u;
        arguments.pixels_z = 1u;
    }
    barrier();
    uint place = group_begin;
    for (uint tile = 0u; tile < LIST_TILES; tile++) {
        uint first_mask = 2u * tile;
        uint low = group_mask[first_mask];
        uint own = group_mask[first_mask + (lane >> 5)];
        if ((own >> (lane & 31u) & 1u) == 1u) {
            uint pixel = range.pixel_begin + place_of(tile);
            uint before = bitCount(own & ((1u << (lane & 31u)) - 1u)) + (lane < 32u ? 0u : bitCount(low));
            uvec2 budget = sample_budget(pixel);
            listed[place + before] = Listed(pixel, first_open_sample(pixel) - range.sample_begin, budget.x, budget.y);
        }
        place += bitCount(low) + bitCount(group_mask[first_mask + 1u]);
    }
}
