// The pair of random numbers of a pixel's sample, from the sampler that the kernel is specialized for. Twin:
// src/reference/samplers.rs.

#include "philox.glsl"
#include "sobol.glsl"
#include "strata.glsl"

vec2 pcg_numbers(uint pixel, uint sample_index) {
    return unit_floats(pcg4d(uvec4(pixel, sample_index, 0u, frame.seed)).xy);
}

// `lcg` steps the state it is given, the others leave it alone. Samples from set.x to set.y are one set of
// strata.
vec2 sample_numbers(uint pixel, uint sample_index, uvec2 set, inout uint lcg_state) {
    if (REPEAT > 0u) sample_index %= REPEAT;
    if (SAMPLER == SAMPLER_LCG) {
        uint first = lcg_step(lcg_state);
        lcg_state = lcg_step(first);
        return vec2(lcg_float(first), lcg_float(lcg_state));
    }
    if (SAMPLER == SAMPLER_SOBOL) return sobol_numbers(pixel, sample_index, set);
    if (SAMPLER == SAMPLER_STRATA) return strata_numbers(pixel, sample_index, set);
    if (SAMPLER == SAMPLER_PHILOX) return philox_numbers(pixel, sample_index);
    return pcg_numbers(pixel, sample_index);
}
