//! Nodes hold both children's boxes; any hit takes the left child first. Twin of shaders/traverse/ordered.glsl.

use super::near_first;
use super::pair::{ROOT, leaf_of, meets_pair, pair_intervals};
use crate::reference::Inputs;
use crate::reference::intersect::{any_of_triangle, box_limit};
use crate::reference::ray::{Hit, Ray};
use crate::reference::slabs::slabs_of;

pub fn closest_hit(inputs: &Inputs, ray: &Ray, hit: Hit) -> Hit {
    near_first::closest_hit(inputs, ray, hit, &inputs.tree.pair)
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
