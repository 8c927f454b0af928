//! The fused slab test. That a workgroup's rays share the way from the root changes no answer: here each walks from the
//! root. Twin of shaders/traverse/entry.glsl.

use super::grown::{self, grown_ray_of};
use super::{children, near_first, pair};
use crate::reference::Inputs;
use crate::reference::ray::{Hit, Ray};

pub fn closest_hit(inputs: &Inputs, ray: &Ray, hit: Hit) -> Hit {
    near_first::closest_hit(inputs, ray, hit, |slabs, reference| {
        pair::children(slabs, &grown::sides_of(inputs.load_grown(reference)))
    })
}

pub fn any_hit(inputs: &Inputs, ray: &Ray) -> bool {
    let grown_ray = grown_ray_of(ray);
    children::any_hit(inputs, ray, |reference, limit| {
        grown::met_children(&grown_ray, inputs.load_grown(reference), limit)
    })
}
