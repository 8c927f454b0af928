// What a kernel is given: the frame, its range of work, and geometry through the row's accessor.
#include "prologue.glsl"
#include "layout"

UNIFORM_BLOCK(BINDING_FRAME) FrameBlock { Frame frame; };
#ifndef ACCESSOR_UNIFORM
DISPATCH_BLOCK RangeBlock { Range range; };
#endif

CONSTANT(SPEC_SAMPLER, uint, SAMPLER, SAMPLER_PCG);
// The original's choices that no other option names: normals as wound, the last of equal hits,
// boxes tested over 0..1000 whatever was hit before, four rays even where a pixel hits nothing.
CONSTANT(SPEC_ORIGINAL, bool, ORIGINAL, false);
CONSTANT(SPEC_ROBUST_SLABS, bool, ROBUST_SLABS, true);
CONSTANT(SPEC_FACING, bool, FACING, true);
CONSTANT(SPEC_REPEAT, uint, REPEAT, 0);
CONSTANT(SPEC_JITTERED, bool, JITTERED, false);
CONSTANT(SPEC_ULP_OFFSET, bool, ULP_OFFSET, false);
CONSTANT(SPEC_BUDGETS, bool, BUDGETS, false);
CONSTANT(SPEC_MARKS_MISSES, bool, MARKS_MISSES, true);
// Triangles are kept by their corners.
CONSTANT(SPEC_WATERTIGHT, bool, WATERTIGHT, false);
// No triangle is missed that the exact ray meets.
CONSTANT(SPEC_CONSERVATIVE, bool, CONSERVATIVE, false);
// Ambient rays may have an end; those of a list have each their own.
#ifdef LISTS_RAYS
#define BOUNDED true
#else
CONSTANT(SPEC_BOUNDED, bool, BOUNDED, true);
#endif

#ifdef ACCESSOR_UNIFORM
UNIFORM_BLOCK(BINDING_TRIANGLES) TriangleBlock { uvec4 triangle_words[3u * UNIFORM_TRIANGLES]; };
#define TRIANGLE_WORD(i) triangle_words[i]
#elif defined(ACCESSOR_TEXEL)
TEXELS(BINDING_NODES) utextureBuffer node_texels;
TEXELS(BINDING_TRIANGLES) utextureBuffer triangle_texels;
#define NODE_WORD(i) texelFetch(node_texels, int(i))
#define TRIANGLE_WORD(i) texelFetch(triangle_texels, int(i))
#elif defined(ACCESSOR_ADDRESS)
layout(buffer_reference, std430, buffer_reference_align = 16) readonly restrict buffer Words { uvec4 words[]; };
#define NODE_WORD(i) Words(uvec2(frame.nodes_low, frame.nodes_high)).words[i]
#define TRIANGLE_WORD(i) Words(uvec2(frame.triangles_low, frame.triangles_high)).words[i]
#else
STORAGE_BLOCK(BINDING_NODES) readonly buffer NodeBlock { uvec4 node_words[]; };
STORAGE_BLOCK(BINDING_TRIANGLES) readonly buffer TriangleBlock { uvec4 triangle_words[]; };
#define NODE_WORD(i) node_words[i]
#define TRIANGLE_WORD(i) triangle_words[i]
#endif

#ifdef NODES_SINGLE
Node load_node(int i) { LOAD_Node(NODE_WORD, uint(i)) }
#elif defined(NODES_PAIR)
PairNode load_pair(int i) { LOAD_PairNode(NODE_WORD, uint(i)) }
#elif defined(NODES_CENTRED)
CONSTANT(SPEC_COMPACT, bool, COMPACT, false);
CompactNode load_compact(int i) { LOAD_CompactNode(NODE_WORD, uint(i)) }
// What stands below a half's own bits was counted with when they were rounded.
vec3 shared_halves(uint xz, uint yz) { return uintBitsToFloat(uvec3(xz >> 1, yz << 10, (xz << 20) | (yz >> 12))); }
CentredNode centred(CompactNode node) {
    return CentredNode(node.left_center, node.left, shared_halves(node.left_half_xz, node.left_half_yz), node.right,
                       node.right_center, 0u, shared_halves(node.right_half_xz, node.right_half_yz), 0u);
}
CentredNode load_whole(int i) { LOAD_CentredNode(NODE_WORD, uint(i)) }
CentredNode load_centred(int i) {
    if (COMPACT) return centred(load_compact(i));
    return load_whole(i);
}
#elif defined(NODES_FACES)
Face load_face(uint i) { LOAD_Face(NODE_WORD, i) }
#elif defined(NODES_WIDE)
WideNode load_wide(int i) { LOAD_WideNode(NODE_WORD, uint(i)) }
// The reference in one of its slots.
int load_wide_child(int i, uint slot) { return int(NODE_WORD(uint(i) * WIDE_WORDS + WIDE_CHILD_WORD + slot / 4u)[slot % 4u]); }
#endif
Corners load_corners(int i) { LOAD_Corners(TRIANGLE_WORD, uint(i)) }
Triangle load_edges(int i) { LOAD_Triangle(TRIANGLE_WORD, uint(i)) }
Triangle edges_of(Corners corners) {
    precise vec3 ab = corners.b - corners.a;
    precise vec3 ac = corners.c - corners.a;
    return Triangle(corners.a, corners.id, ab, 0.0, ac, 0.0);
}
// By its edges, whichever way it is kept.
Triangle load_triangle(int i) {
    if (WATERTIGHT) return edges_of(load_corners(i));
    return load_edges(i);
}
