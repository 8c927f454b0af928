//! Nodes hold both children's boxes; any hit takes the left child first. Twin of shaders/traverse/ordered.glsl.

use super::pair;
use super::{children, near_first};
use crate::reference::Inputs;
use crate::reference::ray::{Hit, Ray};
use crate::reference::slabs::slabs_of;

pub fn closest_hit(inputs: &Inputs, ray: &Ray, hit: Hit) -> Hit {
    near_first::closest_hit(inputs, ray, hit, |slabs, reference| {
        pair::children(slabs, inputs.load_pair(reference))
    })
}

pub fn any_hit(inputs: &Inputs, ray: &Ray) -> bool {
    let slabs = slabs_of(ray, inputs.choices.robust_slabs);
    children::any_hit(inputs, ray, |reference, limit| {
        pair::children(&slabs, inputs.load_pair(reference))
            .map(|(child, interval)| (child, children::meets(interval, limit)))
    })
}
