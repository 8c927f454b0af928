//! What the methods on nodes with both children's boxes share. Twin of what shaders/traverse/pair.glsl, left_first.glsl and entry.glsl do with them.

use std::ops::RangeInclusive;

use crate::layout::{LEAF_BITS, LEAF_LIMIT};
use crate::reference::Inputs;
use crate::reference::intersect::{any_of_triangle, box_limit};
use crate::reference::ray::Ray;
use crate::reference::slabs::slabs_of;

/// The root's reference.
pub const ROOT: i32 = 0;

/// A node's children: their references, and where the ray enters and leaves their boxes.
pub type Children = [(i32, [f32; 2]); 2];

pub fn meets(interval: [f32; 2], t_max: f32) -> bool {
    interval[0].max(0.0) <= interval[1].min(t_max)
}

/// The triangles of the leaf that a negative reference names.
pub fn leaf_of(reference: i32) -> RangeInclusive<u32> {
    let packed_leaf = (-1 - reference) as u32;
    let first = packed_leaf >> LEAF_BITS;
    first..=first + (packed_leaf & (LEAF_LIMIT - 1))
}

/// The first triangle of which `meets` is true, the left child first. `open`: the children of the node of this reference, and whether the ray
/// meets each up to this distance.
pub fn first_met(
    inputs: &Inputs,
    ray: &Ray,
    open: impl Fn(i32, f32) -> [(i32, bool); 2],
    meets: impl Fn(u32) -> bool,
) -> Option<u32> {
    let limit = box_limit(inputs, ray.t_max);
    let mut stack = vec![ROOT];
    while let Some(reference) = stack.pop() {
        if reference < 0 {
            if let Some(index) = leaf_of(reference).find(|&index| meets(index)) {
                return Some(index);
            }
            continue;
        }
        let [left, right] = open(reference, limit);
        stack.extend([right, left].into_iter().filter(|(_, met)| *met).map(|(child, _)| child));
    }
    None
}

/// Any hit by the exact test, with what `open` opens. Twin of shaders/traverse/left_first.glsl.
pub fn any_hit(inputs: &Inputs, ray: &Ray, open: impl Fn(i32, f32) -> [(i32, bool); 2]) -> bool {
    let slabs = slabs_of(ray, inputs.choices.robust_slabs);
    first_met(inputs, ray, open, |index| any_of_triangle(inputs, ray, &slabs, index)).is_some()
}
