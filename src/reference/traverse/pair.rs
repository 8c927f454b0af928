//! What the methods on nodes with both children's boxes share. Twin of shaders/traverse/pair.glsl.

use std::ops::RangeInclusive;

use crate::layout::{LEAF_BITS, LEAF_LIMIT, PairNode};
use crate::reference::slabs::{Slabs, slab_interval};

/// The root's reference.
pub const ROOT: i32 = 0;

/// Where the ray enters and leaves the two boxes: left, then right.
pub fn pair_intervals(slabs: &Slabs, node: &PairNode) -> [[f32; 2]; 2] {
    [
        slab_interval(slabs, node.left_min.into(), node.left_max.into()),
        slab_interval(slabs, node.right_min.into(), node.right_max.into()),
    ]
}

pub fn meets_pair(intervals: &[[f32; 2]; 2], t_max: f32) -> [bool; 2] {
    intervals.map(|[enter, leave]| enter.max(0.0) <= leave.min(t_max))
}

/// The triangles of the leaf that a negative reference names.
pub fn leaf_of(reference: i32) -> RangeInclusive<u32> {
    let packed_leaf = (-1 - reference) as u32;
    let first = packed_leaf >> LEAF_BITS;
    first..=first + (packed_leaf & (LEAF_LIMIT - 1))
}
