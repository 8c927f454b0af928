//! Nodes with both children's boxes as floats. Twin of shaders/traverse/pair.glsl.

use super::children::{Children, meets};
pub use super::children::{ROOT, leaf_of};
use crate::layout::PairNode;
use crate::reference::slabs::{Slabs, slab_interval};

/// Where the ray enters and leaves the two boxes: left, then right.
pub fn pair_intervals(slabs: &Slabs, node: &PairNode) -> [[f32; 2]; 2] {
    [
        slab_interval(slabs, node.left_min.into(), node.left_max.into()),
        slab_interval(slabs, node.right_min.into(), node.right_max.into()),
    ]
}

pub fn meets_pair(intervals: &[[f32; 2]; 2], t_max: f32) -> [bool; 2] {
    intervals.map(|interval| meets(interval, t_max))
}

pub fn children(slabs: &Slabs, node: &PairNode) -> Children {
    let [left, right] = pair_intervals(slabs, node);
    [(node.left, left), (node.right, right)]
}
