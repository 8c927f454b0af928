// Every triangle of the range, in the order of the array. Twin: src/reference/traverse/brute.rs.

#ifdef USES_CLOSEST
bool closest_hit(Ray ray, inout Hit hit) {
    Slabs slabs = slabs_of(ray);
    uint i = range.triangle_begin;
    while (i < range.triangle_end) {
        closest_of_triangle(ray, slabs, int(i), hit);
        i++;
    }
    return i >= range.triangle_end;
}
#endif

#ifdef USES_ANY
bool any_hit(Ray ray, inout bool occluded) {
    Slabs slabs = slabs_of(ray);
    uint i = range.triangle_begin;
    while (!occluded && i < range.triangle_end) {
        occluded = any_of_triangle(ray, slabs, int(i));
        i++;
    }
    return occluded || i >= range.triangle_end;
}
#endif

#include "one_ray.glsl"

#ifdef SHARES_START
#include "edges.glsl"
#endif
