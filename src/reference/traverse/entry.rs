//! The fused slab test, and triangles by the rough one. That a workgroup's rays share the way from the root changes no answer: here each walks from the
//! root. Twin of shaders/traverse/entry.glsl.

use super::grown::{self, grown_ray_of};
use super::rough::{self, Verdict};
use super::{children, near_first, pair};
use crate::reference::Inputs;
use crate::reference::intersect::any_of_triangle;
use crate::reference::ray::{Hit, Ray};
use crate::reference::slabs::slabs_of;

pub fn closest_hit(inputs: &Inputs, ray: &Ray, hit: Hit) -> Hit {
    near_first::closest_hit(inputs, ray, hit, |slabs, reference| {
        pair::children(slabs, &grown::sides_of(inputs.load_grown(reference)))
    })
}

pub fn any_hit(inputs: &Inputs, ray: &Ray) -> bool {
    let grown_ray = grown_ray_of(ray);
    let open = |reference, limit| grown::met_children(&grown_ray, inputs.load_grown(reference), limit);
    let slabs = slabs_of(ray, inputs.choices.robust_slabs);
    let exactly = |index| any_of_triangle(inputs, ray, &slabs, index);
    if inputs.choices.watertight || inputs.choices.original || ray.t_max < f32::MAX {
        return children::first_met(inputs, ray, open, exactly).is_some();
    }
    let roughly = |index| rough::verdict(ray, inputs.load_triangle(index));
    let Some(found) = children::first_met(inputs, ray, open, |index| roughly(index) != Verdict::Misses)
    else {
        return false;
    };
    roughly(found) == Verdict::Meets || exactly(found) || children::any_hit(inputs, ray, open)
}
