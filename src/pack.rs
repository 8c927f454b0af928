//! Scene and tree as the arrays of `layout.rs`.

mod wide;

use glam::Vec3;

pub use wide::{validate_wide, wide_child, wide_nodes, wide_scale, wide_sides};

use crate::bvh::thread;
use crate::bvh::wide::WideTree;
use crate::bvh::{Aabb, Content, Tree};
use crate::kernels::NodeLayout;
use crate::layout::{LEAF_LIMIT, Node, PairNode, ThreadedNode, ThreadedNode48, Triangle, WideNode};

/// By how much robust slabs grow every box on every side: 2^-21 of the largest coordinate, so that no
/// box is flat and a ray that lies in a box's face is inside it.
pub fn box_pad(triangles: &[Triangle]) -> f32 {
    let all = triangles.iter().map(Aabb::of).fold(Aabb::EMPTY, |all, bounds| all.union(&bounds));
    let largest = all.min.abs().max(all.max.abs()).max_element();
    if largest.is_finite() { largest * 2f32.powi(-21) } else { 0.0 }
}

/// The same for the watertight intersector: 20 e (L + R), e = 2^-24, if no coordinate of the scene exceeds L = `largest`, and
/// none of a ray's origin R = `reach` (at least L). Then a triangle's own box rejects no hit that the intersector accepts.
///
/// src/reference/watertight.rs derives that the ray passes a point of the triangle within 8 e (L + R) in each axis, or, if
/// it does so behind its origin and t is above 0 by rounding alone, that the origin lies within 15 e (L + R) of that point.
/// The box is made of edges that were rounded (3 e L) and rounds as it grows (e L and little more), and L is at most half of L + R:
/// 17 e (L + R). The slab test allows for its own rounding ([`EXIT_SLACK`]), and its stand-in for zero moves a ray of direction
/// above 2^-70 by less than e (L + R). What remains is spare.
///
/// [`EXIT_SLACK`]: crate::reference::slabs::EXIT_SLACK
pub fn watertight_pad(largest: f32, reach: f64) -> f32 {
    let largest = f64::from(largest);
    let pad = ((largest + largest.max(reach)) * WATERTIGHT_PAD) as f32;
    if pad.is_finite() { pad } else { 0.0 }
}

/// 20 e.
const WATERTIGHT_PAD: f64 = 20.0 / 16_777_216.0;

/// The triangles in the order of the tree's leaves.
pub fn triangles(tree: &Tree, triangles: &[Triangle]) -> Vec<Triangle> {
    tree.order.iter().map(|&place| triangles[place as usize]).collect()
}

/// A tree in every layout, as the twin of the shaders reads it.
#[derive(Clone, Debug, Default)]
pub struct NodeArrays {
    pub single: Vec<Node>,
    pub threaded: Vec<ThreadedNode>,
    pub pair: Vec<PairNode>,
    pub wide: Vec<WideNode>,
}

impl NodeArrays {
    pub fn new(tree: &Tree, pad: f32) -> Self {
        Self {
            single: nodes(tree, pad),
            threaded: threaded_nodes(tree, pad),
            pair: pair_nodes(tree, pad),
            wide: wide_nodes(&WideTree::new(tree), tree, pad),
        }
    }
}

/// The array of nodes of a layout, bytes; a word where the kernel reads none. `wide`: the tree collapsed, asked for
/// where the layout needs it.
pub fn node_bytes<'a>(
    layout: NodeLayout,
    tree: &Tree,
    wide: impl FnOnce() -> &'a WideTree,
    pad: f32,
) -> Vec<u8> {
    match layout {
        NodeLayout::None => vec![0; 16],
        NodeLayout::Single => bytemuck::cast_slice(&nodes(tree, pad)).to_vec(),
        NodeLayout::Threaded => bytemuck::cast_slice(&threaded_nodes(tree, pad)).to_vec(),
        NodeLayout::Threaded48 => bytemuck::cast_slice(&threaded_nodes48(tree, pad)).to_vec(),
        NodeLayout::Pair => bytemuck::cast_slice(&pair_nodes(tree, pad)).to_vec(),
        NodeLayout::Wide => bytemuck::cast_slice(&wide_nodes(wide(), tree, pad)).to_vec(),
    }
}

/// Bytes of the array of nodes of a layout, at most, without making it.
pub fn node_array_bytes<'a>(layout: NodeLayout, tree: &Tree, wide: impl FnOnce() -> &'a WideTree) -> u64 {
    let nodes = tree.nodes.len() as u64;
    match layout {
        NodeLayout::None => 16,
        NodeLayout::Single => nodes * size_of::<Node>() as u64,
        NodeLayout::Threaded => nodes * size_of::<ThreadedNode>() as u64,
        NodeLayout::Threaded48 => nodes * size_of::<ThreadedNode48>() as u64,
        NodeLayout::Pair => (nodes / 2).max(1) * size_of::<PairNode>() as u64,
        NodeLayout::Wide => (wide().nodes.len() * size_of::<WideNode>()) as u64,
    }
}

/// Nodes for `stackN` and `single-push`.
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
                Content::Leaf { first, count } => packed_leaf(first, count),
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

/// Nodes for `ordered`, `packet` and `postponed`: inner nodes only, the root first, each before its children and
/// the left subtree before the right one.
pub fn pair_nodes(tree: &Tree, pad: f32) -> Vec<PairNode> {
    let mut places = vec![0i32; tree.nodes.len()];
    let mut inner = Vec::new();
    let mut open: Vec<u32> = (tree.nodes.len() as u32).checked_sub(1).into_iter().collect();
    while let Some(index) = open.pop() {
        if let Content::Inner { left, right } = tree.nodes[index as usize].content {
            places[index as usize] = inner.len() as i32;
            inner.push((left, right));
            open.extend([right, left]);
        }
    }
    let child = |index: u32| {
        let node = &tree.nodes[index as usize];
        let reference = match node.content {
            Content::Inner { .. } => places[index as usize],
            Content::Leaf { first, count } => packed_leaf(first, count),
        };
        (grown(&node.bounds, pad), reference)
    };
    if let (true, Some(root)) = (inner.is_empty(), tree.nodes.len().checked_sub(1)) {
        let ((left_min, left_max), left) = child(root as u32);
        let far = [OUT_OF_REACH; 3];
        return vec![PairNode {
            left_min,
            left,
            left_max,
            right: left,
            right_min: far,
            right_max: far,
            pad0: 0,
            pad1: 0,
        }];
    }
    inner
        .iter()
        .map(|&(left, right)| {
            let ((left_min, left_max), left) = child(left);
            let ((right_min, right_max), right) = child(right);
            PairNode { left_min, left, left_max, right, right_min, pad0: 0, right_max, pad1: 0 }
        })
        .collect()
}

/// Coordinate of a box that next to no ray meets.
const OUT_OF_REACH: f32 = 1e38;

fn packed_leaf(first: u32, count: u32) -> i32 {
    -1 - (first * LEAF_LIMIT + count - 1) as i32
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
