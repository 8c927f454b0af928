// Random numbers. Twin: src/reference/rng.rs.

// Four hashes of a pixel's sample: PCG4D of Jarzynski and Olano, "Hash Functions for GPU Rendering"
// (2020). Every (pixel, sample, dimension, seed) has its own.
uvec4 pcg4d(uvec4 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    v ^= v >> 16;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    return v;
}

// Multiples of 2^-24 in [0, 1).
vec2 unit_floats(uvec2 bits) { return vec2(bits >> 8) * 5.9604644775390625e-8; }

// The original's generator, modulus 2^31 (constants of the C standard's example rand).
uint lcg_step(uint state) { return (1103515245u * state + 12345u) & 0x7fffffffu; }

// So many steps at once: x -> a x + c applied twice is x -> a^2 x + (a + 1) c.
uint lcg_jump(uint state, uint steps) {
    uint a = 1103515245u;
    uint c = 12345u;
    for (uint left = steps; left > 0u; left >>= 1) {
        if ((left & 1u) == 1u) state = a * state + c;
        c *= a + 1u;
        a *= a;
    }
    return state & 0x7fffffffu;
}

// The original's u = x / 2^31, which may round up to 1.
float lcg_float(uint state) { return float(state) * 4.656612873077393e-10; }
