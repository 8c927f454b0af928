//! The fused slab test. That a workgroup's rays share the way from the root changes no answer: here each walks from the
//! root. Twin of shaders/traverse/entry.glsl.

use super::children::{ROOT, leaf_of, meets};
use super::grown::{children, grown_ray_of};
use super::near_first;
use crate::reference::Inputs;
use crate::reference::intersect::{any_of_triangle, box_limit};
use crate::reference::ray::{Hit, Ray};
use crate::reference::slabs::slabs_of;

pub fn closest_hit(inputs: &Inputs, ray: &Ray, hit: Hit) -> Hit {
    near_first::closest_hit(inputs, ray, hit, &inputs.tree.grown)
}

pub fn any_hit(inputs: &Inputs, ray: &Ray) -> bool {
    let slabs = slabs_of(ray, inputs.choices.robust_slabs);
    let grown_ray = grown_ray_of(ray);
    let limit = box_limit(inputs, ray.t_max);
    let mut stack = vec![ROOT];
    while let Some(reference) = stack.pop() {
        if reference < 0 {
            if leaf_of(reference).any(|index| any_of_triangle(inputs, ray, &slabs, index)) {
                return true;
            }
            continue;
        }
        let [left, right] = children(&grown_ray, inputs.load_grown(reference));
        let met = [right, left].into_iter().filter(|(_, interval)| meets(*interval, limit));
        stack.extend(met.map(|(child, _)| child));
    }
    false
}
