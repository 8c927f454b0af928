// A fixed amount of arithmetic in which each step needs the one before, and nothing is read: its time tells
// how fast the device runs at the moment.
#include "prologue.glsl"
#include "layout"

layout(local_size_x = WORKGROUP_SIZE) in;

STORAGE_BLOCK(BINDING_HITS) writeonly buffer ResultBlock { uint results[]; };

void main() {
    uint state = gl_GlobalInvocationID.x;
    for (uint i = 0u; i < CLOCK_STEPS; ++i) {
        state = state * 1664525u + 1013904223u;
        // Without this, compilers fold several steps of the generator into one.
        state ^= state >> 16;
    }
    results[gl_GlobalInvocationID.x] = state;
}
