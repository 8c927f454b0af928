// Nodes hold both children's boxes.
// Twin: src/reference/traverse/ordered.rs.

#include "near_first.glsl"
#include "left_first.glsl"

#ifdef USES_ANY
bool any_hit(Ray ray, inout bool occluded) { return any_hit_left_first(ray, occluded); }
#endif

#include "one_ray.glsl"
