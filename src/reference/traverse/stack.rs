//! A binary tree with a stack of node indices for each ray, the original's way: a popped inner node tests
//! its box and pushes left, then right; a leaf's box is never tested. Twin of shaders/traverse/stack.glsl.

use std::ops::RangeInclusive;

use crate::reference::Inputs;
use crate::reference::intersect::{any_of_triangle, box_limit, closest_of_triangle};
use crate::reference::ray::{Hit, Ray};
use crate::reference::slabs::{Slabs, meets_box, slabs_of};

struct Stack {
    entries: Vec<i32>,
    size: usize,
    /// Whether a push was dropped.
    overflowed: bool,
}

impl Stack {
    /// A stack with the root on it.
    fn of_root(inputs: &Inputs, size: u32) -> Self {
        let size = size as usize;
        let mut stack = Self { entries: Vec::with_capacity(size.min(64)), size, overflowed: false };
        stack.push(inputs.frame.node_count as i32 - 1);
        stack
    }

    /// A push that does not fit is dropped, and the ray is counted.
    fn push(&mut self, node: i32) {
        if self.entries.len() < self.size {
            self.entries.push(node);
        } else {
            self.overflowed = true;
        }
    }

    /// The triangles of the next leaf whose ancestors' boxes the ray meets before t_max.
    fn next_leaf(&mut self, inputs: &Inputs, slabs: &Slabs, t_max: f32) -> Option<RangeInclusive<u32>> {
        while let Some(index) = self.entries.pop() {
            let node = inputs.load_node(index);
            if node.left < 0 {
                return Some((-1 - node.left) as u32..=(-1 - node.right) as u32);
            }
            if meets_box(slabs, node.pmin.into(), node.pmax.into(), t_max) {
                self.push(node.left);
                self.push(node.right);
            }
        }
        None
    }
}

/// The closest hit, and whether a push was dropped.
pub fn closest_hit(inputs: &Inputs, ray: &Ray, mut hit: Hit, size: u32) -> (Hit, bool) {
    let slabs = slabs_of(ray, inputs.choices.robust_slabs);
    let mut stack = Stack::of_root(inputs, size);
    while let Some(leaf) = stack.next_leaf(inputs, &slabs, box_limit(inputs, hit.t)) {
        for index in leaf {
            closest_of_triangle(inputs, ray, &slabs, index, &mut hit);
        }
    }
    (hit, stack.overflowed)
}

/// Whether the ray meets any triangle, and whether a push was dropped before it did.
pub fn any_hit(inputs: &Inputs, ray: &Ray, size: u32) -> (bool, bool) {
    let slabs = slabs_of(ray, inputs.choices.robust_slabs);
    let mut stack = Stack::of_root(inputs, size);
    while let Some(mut leaf) = stack.next_leaf(inputs, &slabs, box_limit(inputs, ray.t_max)) {
        if leaf.any(|index| any_of_triangle(inputs, ray, &slabs, index)) {
            return (true, stack.overflowed);
        }
    }
    (false, stack.overflowed)
}
