//! What the methods on nodes with both children's boxes share. Twin of shaders/traverse/children.glsl.

use std::ops::RangeInclusive;

use crate::layout::{LEAF_BITS, LEAF_LIMIT};

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
