//! Every triangle, in the order of the array. Twin of shaders/traverse/brute.glsl.

use crate::reference::Inputs;
use crate::reference::intersect::{any_of_triangle, closest_of_triangle};
use crate::reference::ray::{Hit, Ray};
use crate::reference::slabs::slabs_of;

pub fn closest_hit(inputs: &Inputs, ray: &Ray, mut hit: Hit) -> Hit {
    let slabs = slabs_of(ray, inputs.choices.robust_slabs);
    for index in 0..inputs.frame.triangle_count {
        closest_of_triangle(inputs, ray, &slabs, index, &mut hit);
    }
    hit
}

pub fn any_hit(inputs: &Inputs, ray: &Ray) -> bool {
    let slabs = slabs_of(ray, inputs.choices.robust_slabs);
    (0..inputs.frame.triangle_count).any(|index| any_of_triangle(inputs, ray, &slabs, index))
}
