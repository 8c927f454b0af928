//! A binary tree in post-order whose nodes are sewn together: after a hit the right child lies just before
//! its parent, after a miss or a leaf the node names where to go on. Twin of shaders/traverse/threaded.glsl.

use std::ops::RangeInclusive;

use crate::layout::{LEAF_BITS, LEAF_LIMIT, ThreadedNode};
use crate::reference::Inputs;
use crate::reference::intersect::{any_of_triangle, box_limit, closest_of_triangle};
use crate::reference::ray::{Hit, Ray};
use crate::reference::slabs::{Slabs, meets_box, slabs_of};

/// The triangles of a leaf; nothing inside the tree.
fn leaf_of(node: &ThreadedNode) -> Option<RangeInclusive<u32>> {
    let packed_leaf = -1 - node.leaf;
    let first = packed_leaf >> LEAF_BITS;
    let last = first + (packed_leaf & (LEAF_LIMIT - 1) as i32);
    (first >= 0).then_some(first as u32..=last as u32)
}

/// Where to go on from an inner node.
fn next(node: &ThreadedNode, index: i32, slabs: &Slabs, t_max: f32) -> i32 {
    if meets_box(slabs, node.pmin.into(), node.pmax.into(), t_max) { index - 1 } else { node.skip }
}

pub fn closest_hit(inputs: &Inputs, ray: &Ray, mut hit: Hit) -> Hit {
    let slabs = slabs_of(ray, inputs.choices.robust_slabs);
    let mut index = inputs.frame.node_count as i32 - 1;
    while index >= 0 {
        let node = inputs.load_threaded(index);
        if let Some(leaf) = leaf_of(node) {
            for i in leaf {
                closest_of_triangle(inputs, ray, &slabs, i, &mut hit);
            }
            index = node.skip;
        } else {
            index = next(node, index, &slabs, box_limit(inputs, hit.t));
        }
    }
    hit
}

pub fn any_hit(inputs: &Inputs, ray: &Ray) -> bool {
    let slabs = slabs_of(ray, inputs.choices.robust_slabs);
    let mut index = inputs.frame.node_count as i32 - 1;
    while index >= 0 {
        let node = inputs.load_threaded(index);
        if let Some(mut leaf) = leaf_of(node) {
            if leaf.any(|i| any_of_triangle(inputs, ray, &slabs, i)) {
                return true;
            }
            index = node.skip;
        } else {
            index = next(node, index, &slabs, box_limit(inputs, ray.t_max));
        }
    }
    false
}
