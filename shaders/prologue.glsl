// The only file that knows which API the text is compiled for.
#ifdef VULKAN
#extension GL_KHR_shader_subgroup_basic : enable
#extension GL_KHR_shader_subgroup_vote : enable
#extension GL_KHR_shader_subgroup_ballot : enable
#extension GL_KHR_shader_subgroup_arithmetic : enable
#extension GL_KHR_shader_subgroup_shuffle : enable
#ifdef ACCESSOR_ADDRESS
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#endif
#define UNIFORM_BLOCK(n) layout(set = 0, binding = n, std140) uniform
#define STORAGE_BLOCK(n) layout(set = 0, binding = n, std430)
#define TEXELS(n) layout(set = 0, binding = n) uniform
#define STORAGE_IMAGE(n, image_format) layout(set = 0, binding = n, image_format) uniform
#define DISPATCH_BLOCK layout(push_constant) uniform
#define CONSTANT(n, type, name, value) layout(constant_id = n) const type name = value
#define VERTEX_INDEX gl_VertexIndex
#define FRAGMENT_FROM_TOP
#else
// OpenGL: uniform blocks, storage blocks and images are numbered apart; what is specialized in Vulkan is
// put into the text by the host.
#define UNIFORM_BLOCK(n) layout(binding = n, std140) uniform
#define STORAGE_BLOCK(n) layout(binding = n, std430)
#define TEXELS(n) layout(binding = n) uniform
#define STORAGE_IMAGE(n, image_format) layout(binding = n, image_format) uniform
#define DISPATCH_BLOCK layout(binding = BINDING_RANGE, std140) uniform
#define CONSTANT(n, type, name, value) const type name = type(SPECIALIZED(n))
#define VERTEX_INDEX gl_VertexID
// Vulkan counts rows from the top.
#define FRAGMENT_FROM_TOP layout(origin_upper_left) in vec4 gl_FragCoord;
#endif
