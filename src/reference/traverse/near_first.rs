//! The closest hit with nodes that hold both children's boxes, the near child first. Twin of
//! shaders/traverse/near_first.glsl.

use super::children::{Children, ROOT, leaf_of, meets};
use crate::reference::Inputs;
use crate::reference::intersect::{box_limit, closest_of_triangle};
use crate::reference::ray::{Hit, Ray};
use crate::reference::slabs::{Slabs, slabs_of};

/// `open`: the children of the method's node of this reference.
pub fn closest_hit(inputs: &Inputs, ray: &Ray, mut hit: Hit, open: impl Fn(&Slabs, i32) -> Children) -> Hit {
    let slabs = slabs_of(ray, inputs.choices.robust_slabs);
    // References and where the ray enters their boxes.
    let mut stack = vec![(ROOT, 0.0f32)];
    while let Some((reference, enter)) = stack.pop() {
        if enter.max(0.0) > box_limit(inputs, hit.t) {
            continue;
        }
        if reference < 0 {
            for index in leaf_of(reference) {
                closest_of_triangle(inputs, ray, &slabs, index, &mut hit);
            }
            continue;
        }
        let [left, right] = open(&slabs, reference);
        let far_to_near = if right.1[0] < left.1[0] { [left, right] } else { [right, left] };
        let met = far_to_near.into_iter().filter(|(_, interval)| meets(*interval, box_limit(inputs, hit.t)));
        stack.extend(met.map(|(child, interval)| (child, interval[0])));
    }
    hit
}
