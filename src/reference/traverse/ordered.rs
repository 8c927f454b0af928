//! Nodes hold both children's boxes; the near child is visited first, the other waits on the stack. Twin of
//! shaders/traverse/ordered.glsl.

use super::pair::{ROOT, leaf_of, meets_pair, pair_intervals};
use crate::reference::Inputs;
use crate::reference::intersect::{any_of_triangle, box_limit, closest_of_triangle};
use crate::reference::ray::{Hit, Ray};
use crate::reference::slabs::slabs_of;

pub fn closest_hit(inputs: &Inputs, ray: &Ray, mut hit: Hit) -> Hit {
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
        let node = inputs.load_pair(reference);
        let intervals = pair_intervals(&slabs, node);
        let meets = meets_pair(&intervals, box_limit(inputs, hit.t));
        let (left, right) = ((node.left, intervals[0][0]), (node.right, intervals[1][0]));
        let far_to_near = if right.1 < left.1 {
            [(left, meets[0]), (right, meets[1])]
        } else {
            [(right, meets[1]), (left, meets[0])]
        };
        stack.extend(far_to_near.into_iter().filter(|(_, meets)| *meets).map(|(child, _)| child));
    }
    hit
}

pub fn any_hit(inputs: &Inputs, ray: &Ray) -> bool {
    let slabs = slabs_of(ray, inputs.choices.robust_slabs);
    let mut stack = vec![ROOT];
    while let Some(reference) = stack.pop() {
        if reference < 0 {
            if leaf_of(reference).any(|index| any_of_triangle(inputs, ray, &slabs, index)) {
                return true;
            }
            continue;
        }
        let node = inputs.load_pair(reference);
        let meets = meets_pair(&pair_intervals(&slabs, node), box_limit(inputs, ray.t_max));
        let children = [(node.right, meets[1]), (node.left, meets[0])];
        stack.extend(children.into_iter().filter(|(_, meets)| *meets).map(|(child, _)| child));
    }
    false
}
