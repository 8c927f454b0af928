//! Scene and tree as the arrays of `layout.rs`.

use glam::Vec3;

use crate::bvh::thread;
use crate::bvh::{Aabb, Content, Tree};
use crate::layout::{LEAF_LIMIT, Node, ThreadedNode, ThreadedNode48, Triangle};

/// By how much robust slabs grow every box on every side: 2^-21 of the largest coordinate, so that no
/// box is flat and a ray that lies in a box's face is inside it.
pub fn box_pad(triangles: &[Triangle]) -> f32 {
    let all = triangles.iter().map(Aabb::of).fold(Aabb::EMPTY, |all, bounds| all.union(&bounds));
    let largest = all.min.abs().max(all.max.abs()).max_element();
    if largest.is_finite() { largest * 2f32.powi(-21) } else { 0.0 }
}

/// The triangles in the order of the tree's leaves.
pub fn triangles(tree: &Tree, triangles: &[Triangle]) -> Vec<Triangle> {
    tree.order.iter().map(|&place| triangles[place as usize]).collect()
}

/// Nodes for `stackN`.
pub fn nodes(tree: &Tree, pad: f32) -> Vec<Node> {
    tree.nodes
        .iter()
        .map(|node| {
            let (pmin, pmax) = grown(&node.bounds, pad);
            let (left, right) = links(node.content);
            Node { pmin, left, pmax, right }
        })
        .collect()
}

/// Nodes for `threaded`.
pub fn threaded_nodes(tree: &Tree, pad: f32) -> Vec<ThreadedNode> {
    tree.nodes
        .iter()
        .zip(thread::skips(tree))
        .map(|(node, skip)| {
            let (pmin, pmax) = grown(&node.bounds, pad);
            let leaf = match node.content {
                Content::Inner { .. } => 0,
                Content::Leaf { first, count } => -1 - (first * LEAF_LIMIT + count - 1) as i32,
            };
            ThreadedNode { pmin, skip, pmax, leaf }
        })
        .collect()
}

/// Nodes for `threaded` as the original laid them out.
pub fn threaded_nodes48(tree: &Tree, pad: f32) -> Vec<ThreadedNode48> {
    tree.nodes
        .iter()
        .zip(thread::skips(tree))
        .map(|(node, skip)| {
            let (pmin, pmax) = grown(&node.bounds, pad);
            let (left, right) = links(node.content);
            ThreadedNode48 { pmin, left, pmax, right, pad: [0.0; 3], skip }
        })
        .collect()
}

fn links(content: Content) -> (i32, i32) {
    match content {
        Content::Inner { left, right } => (left as i32, right as i32),
        Content::Leaf { first, count } => (-1 - first as i32, -1 - (first + count - 1) as i32),
    }
}

fn grown(bounds: &Aabb, pad: f32) -> ([f32; 3], [f32; 3]) {
    let pad = Vec3::splat(pad);
    ((bounds.min - pad).to_array(), (bounds.max + pad).to_array())
}

/// Most triangles that the packed records can number.
pub const MOST_TRIANGLES: usize = (i32::MAX as u32 / LEAF_LIMIT) as usize;
