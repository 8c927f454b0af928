// One triangle that covers the picture, without a vertex buffer.
#include "prologue.glsl"

void main() {
    vec2 corner = vec2(float(VERTEX_INDEX & 1), float(VERTEX_INDEX >> 1));
    gl_Position = vec4(4.0 * corner - 1.0, 0.0, 1.0);
}
