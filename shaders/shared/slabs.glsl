// Ray against axis-aligned box. Twin: src/reference/slabs.rs.

#include "watertight.glsl"

// What the tests against boxes and triangles need of a ray, once a ray.
struct Slabs {
    vec3 origin;
    vec3 inverse;
    // For the watertight intersector.
    Shear shear;
    // For the conservative one.
    float error;
};

// Smallest direction component that robust slabs divide by, 2^-100. A zero would make 0 * inf = NaN
// where the origin lies on a box's face; with this stand-in every product is finite. A ray parallel
// to a slab then stays in it for longer than any scene is deep, or never comes near.
#define SMALLEST_COMPONENT 7.888609052210118e-31

// 1 + 2 gamma(7): exit distances grow by the error that both distances may have, so that no box which
// the exact ray meets is missed (Ize 2013 has gamma(3) for a correctly rounded division; ours may be off
// by 2 ulp).
#define EXIT_SLACK 1.0000009

float inverse_component(float d) {
    float inverse = reciprocal(max(abs(d), SMALLEST_COMPONENT));
    return d < 0.0 ? -inverse : inverse;
}

vec3 robust_inverse(vec3 d) {
    return vec3(inverse_component(d.x), inverse_component(d.y), inverse_component(d.z));
}

Slabs slabs_of(Ray ray) {
    Shear shear = Shear(0u, vec3(0.0));
    if (WATERTIGHT) shear = shear_of(ray.direction);
    vec3 inverse = ROBUST_SLABS ? robust_inverse(ray.direction) : 1.0 / ray.direction;
    return Slabs(ray.origin, inverse, shear, CONSERVATIVE ? error_of(ray.direction) : 0.0);
}

// Where the ray enters the box and leaves it. Every operation is monotonic in the bounds, so a box
// inside another is never entered earlier nor left later: a ray that passes a triangle's own box
// passes all boxes around it, and no tree can lose a hit.
vec2 slab_interval(Slabs slabs, vec3 pmin, vec3 pmax, bool robust) {
    precise vec3 t0 = (pmin - slabs.origin) * slabs.inverse;
    precise vec3 t1 = (pmax - slabs.origin) * slabs.inverse;
    vec3 near = min(t0, t1);
    vec3 far = max(t0, t1);
    float enter = max(max(near.x, near.y), near.z);
    precise float leave = min(min(far.x, far.y), far.z);
    if (robust) {
        leave = leave * EXIT_SLACK;
    }
    return vec2(enter, leave);
}

bool meets_box(Slabs slabs, vec3 pmin, vec3 pmax, float t_max) {
    vec2 interval = slab_interval(slabs, pmin, pmax, ROBUST_SLABS);
    return max(interval.x, 0.0) <= min(interval.y, t_max);
}
