// Where a pixel's ambient rays are added up: exact counts in a buffer, or the original's running mean
// in a storage image. Twin: src/reference/accumulate.rs.

#ifdef ACCUMULATE_count

STORAGE_BLOCK(BINDING_COUNTS) buffer CountBlock { Count counts[]; };

// The first sample of a pixel that is not done yet: a dispatch which is run again goes on where the
// pixel was left.
uint first_open_sample(uint pixel) {
    Count count = counts[pixel - range.pixel_base];
    if (count.escaped0 == MISSED) return 0xffffffffu;
    return frame.sample_base + count.traced0 + count.traced1;
}

// Has later dispatches pass over a pixel whose camera ray hits nothing.
void mark_missed(uint pixel) {
    if (MARKS_MISSES) counts[pixel - range.pixel_base] = Count(MISSED, 0u, 0u, 0u);
}

void add_samples(uint pixel, ivec2 position, uvec2 escaped, uvec2 traced, float sum) {
    Count count = counts[pixel - range.pixel_base];
    counts[pixel - range.pixel_base] =
        Count(count.escaped0 + escaped.x, count.traced0 + traced.x,
              count.escaped1 + escaped.y, count.traced1 + traced.y);
}

#else

#ifdef ACCUMULATE_rgba8
STORAGE_IMAGE(BINDING_IMAGE, rgba8) image2D mean_image;
#else
STORAGE_IMAGE(BINDING_IMAGE, rgba32f) image2D mean_image;
#endif

// The running mean has no memory of how many samples it holds: dispatches must come in order.
uint first_open_sample(uint pixel) { return range.sample_begin; }
void mark_missed(uint pixel) {}

void add_samples(uint pixel, ivec2 position, uvec2 escaped, uvec2 traced, float sum) {
    float before = float(range.sample_begin);
    float mean = imageLoad(mean_image, position).r;
    precise float new_mean = (mean * before + sum) / float(range.sample_end);
    imageStore(mean_image, position, vec4(vec3(new_mean), traced.x + traced.y > 0u ? 1.0 : 0.0));
}

#endif
