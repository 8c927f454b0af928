//! A box a node; of two children the right one is visited at once and only the left one is put on the stack. Twin of
//! shaders/traverse/single-push.glsl.

use std::ops::RangeInclusive;

use crate::reference::Inputs;
use crate::reference::intersect::{any_of_triangle, box_limit, closest_of_triangle};
use crate::reference::ray::{Hit, Ray};
use crate::reference::slabs::{Slabs, meets_box, slabs_of};

/// Where a walk is, and the left children that wait.
struct Walk {
    at: Option<i32>,
    stack: Vec<i32>,
}

impl Walk {
    fn of_root(inputs: &Inputs) -> Self {
        Self { at: inputs.frame.node_count.checked_sub(1).map(|root| root as i32), stack: Vec::new() }
    }

    /// The triangles of the next leaf whose ancestors' boxes the ray meets before t_max.
    fn next_leaf(&mut self, inputs: &Inputs, slabs: &Slabs, t_max: f32) -> Option<RangeInclusive<u32>> {
        while let Some(index) = self.at {
            let node = inputs.load_node(index);
            if node.left < 0 {
                self.at = self.stack.pop();
                return Some((-1 - node.left) as u32..=(-1 - node.right) as u32);
            }
            self.at = if meets_box(slabs, node.pmin.into(), node.pmax.into(), t_max) {
                self.stack.push(node.left);
                Some(node.right)
            } else {
                self.stack.pop()
            };
        }
        None
    }
}

pub fn closest_hit(inputs: &Inputs, ray: &Ray, mut hit: Hit) -> Hit {
    let slabs = slabs_of(ray, inputs.choices.robust_slabs);
    let mut walk = Walk::of_root(inputs);
    while let Some(leaf) = walk.next_leaf(inputs, &slabs, box_limit(inputs, hit.t)) {
        for index in leaf {
            closest_of_triangle(inputs, ray, &slabs, index, &mut hit);
        }
    }
    hit
}

pub fn any_hit(inputs: &Inputs, ray: &Ray) -> bool {
    let slabs = slabs_of(ray, inputs.choices.robust_slabs);
    let mut walk = Walk::of_root(inputs);
    while let Some(mut leaf) = walk.next_leaf(inputs, &slabs, box_limit(inputs, ray.t_max)) {
        if leaf.any(|index| any_of_triangle(inputs, ray, &slabs, index)) {
            return true;
        }
    }
    false
}
