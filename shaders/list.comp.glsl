// Lists the pixels of a range whose camera ray hit and that have samples to do, and writes how many workgroups the
// kernels over the list need. Workgroups are of LIST_SIZE pixels, since all of them add to the same few words; their
// pixels stay together and in order, so that neighbours share their way through the tree; the order of the workgroups is
// left to chance, since counts add up in any order. It is nearly that of the picture as long as few of them run at a time, which
// large trees gain by: so none takes several tiles in turn.
#include "shared/scene.glsl"
#include "shared/ray.glsl"
#include "shared/camera.glsl"
#include "shared/accumulate.glsl"
#include "shared/budgets.glsl"
#include "shared/list.glsl"

layout(local_size_x = LIST_SIZE) in;

STORAGE_BLOCK(BINDING_HITS) readonly buffer HitBlock { HitRecord hits[]; };

// The words of `arguments` that the first invocations write, one each: a CPU device goes through its lanes at each access.
STORAGE_BLOCK(BINDING_ARGUMENTS) writeonly buffer ArgumentWordBlock { uint argument_words[]; };

// Who of the workgroup is listed, a bit each.
#define MASKS (LIST_SIZE / 32)
shared uint group_mask[MASKS];
shared uint group_begin;

bool camera_ray_hit(uint pixel) {
    HitRecord hit = hits[pixel - range.pixel_base];
    bool within = !ORIGINAL || (hit.t > 0.0 && hit.t < 1.0);
    return hit.index != NO_HIT && hit.index != UNFINISHED && within;
}

void main() {
    uint lane = gl_LocalInvocationIndex;
    // Counted from the range's first: the last workgroup may reach behind the last pixel that has a number.
    uint offset = gl_WorkGroupID.x * LIST_SIZE + lane;
    uint pixel = range.pixel_begin + offset;
    uint first = 0u;
    uvec2 budget = uvec2(0u);
    bool listed_too = false;
    if (offset < range.pixel_end - range.pixel_begin && inside_image(pixel_position(pixel)) && camera_ray_hit(pixel)) {
        first = first_open_sample(pixel);
        budget = sample_budget(pixel);
        // A pixel that lags behind is taken up again when the others are through.
        listed_too = range.sample_begin <= first && first < min(range.sample_end, budget.y);
    }
    if (lane < MASKS) group_mask[lane] = 0u;
    barrier();
    if (listed_too) atomicOr(group_mask[lane >> 5], 1u << (lane & 31u));
    barrier();
    uint before = 0u;
    uint all = 0u;
    for (uint i = 0u; i < MASKS; i++) {
        uint mask = group_mask[i];
        uint earlier = i == lane >> 5 ? mask & ((1u << (lane & 31u)) - 1u) : i < lane >> 5 ? mask : 0u;
        before += bitCount(earlier);
        all += bitCount(mask);
    }
    if (lane == 0u && all > 0u) {
        group_begin = atomicAdd(arguments.count, all);
        uint end = group_begin + all;
        atomicMax(arguments.blocks_x, (end * SAMPLE_LANES + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE);
        atomicMax(arguments.pixels_x, (end + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE);
    }
    uint samples = range.sample_end - range.sample_begin;
    uint blocks = (samples + range.block - 1u) / range.block;
    if (offset < ARGUMENT_WORDS && (ADDED_WORDS >> offset & 1u) == 0u) {
        argument_words[offset] = offset == BLOCKS_Z_WORD ? blocks : 1u;
    }
    barrier();
    if (listed_too) {
        uint place = group_begin + before;
        listed[place].pixel = pixel;
        listed[place].skip = first - range.sample_begin;
        // Nobody reads them otherwise.
        if (BUDGETS) {
            listed[place].begin = budget.x;
            listed[place].end = budget.y;
        }
    }
}
