//! Scene and tree as the arrays of `layout.rs`.

mod faces;
mod quad;
mod wide;

use std::sync::OnceLock;

use glam::Vec3;

pub use faces::{MOST_TRIANGLES as MOST_FACES, Pair, edges_of, faces, pairs};
pub use quad::{quad_children, quad_nodes};
pub use wide::{validate_wide, wide_child, wide_nodes, wide_scale, wide_sides};

use crate::bvh::quad::QuadTree;
use crate::bvh::thread;
use crate::bvh::wide::WideTree;
use crate::bvh::{Aabb, Content, Tree};
use crate::kernels::NodeLayout;
use crate::layout::{
    CentredNode, CompactNode, Face, LEAF_LIMIT, Node, PairNode, QuadNode, ThreadedNode, ThreadedNode48,
    Triangle, WideNode,
};

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

/// By how much boxes are grown for the fused slab test (shaders/traverse/grown.glsl), if triangles' own boxes are grown by `pad`, no
/// coordinate of the scene exceeds L = `largest`, and none of a ray's origin R = `reach`: `pad` and 40 e (L + R), e = 2^-24.
///
/// What is to hold: if the robust slab test says of a triangle's own box that the ray meets it, then the fused one says so of every
/// box around it, and never that the ray enters it later. In units of the inverse of a direction's component, which
/// are lengths, and with D = L + R:
/// - both tests' inverses are within 5 e of the exact one (a division may be off by 2.5 ulp), so 10 e of each other: 10 e D;
/// - the own test rounds twice, and grows its exits by 16 e of what they are: 19 e D, or 2 e D at entries;
/// - the fused one rounds the base, e R, the centre's product, e L or not at all, their sum, e D, half the size's product, again e L
///   or not at all, and the crossing, e D;
/// - the grown sides round, e L and little more; centres round, but halves are made to reach the sides.
///
/// That is 34 e D at exits, with e (R + L + L) counted as 2 e D; the rest is spare.
pub fn grown_pad(pad: f32, largest: f32, reach: f64) -> f32 {
    let largest = f64::from(largest);
    let grown = f64::from(pad) + (largest + largest.max(reach)) * FUSED_ERROR;
    if grown < f64::from(f32::MAX) { grown as f32 } else { pad }
}

/// By how much the boxes of faces are grown for the test of shaders/traverse/beam.glsl, in the terms of [`grown_pad`]: `pad` and 256 e (L + R).
///
/// If the robust slab test says of a triangle's own box that some ray meets it, the ray passes that box grown by 20 e (L + R) and less (see
/// there). The beam's differences, inverses and products round by 7 e of what they are, which is at most L + R.
pub fn beam_pad(pad: f32, largest: f32, reach: f64) -> f32 {
    let largest = f64::from(largest);
    let grown = f64::from(pad) + (largest + largest.max(reach)) * BEAM_ERROR;
    if grown < f64::from(f32::MAX) { grown as f32 } else { pad }
}

/// 256 e.
const BEAM_ERROR: f64 = 256.0 / 16_777_216.0;

/// 40 e.
const FUSED_ERROR: f64 = 40.0 / 16_777_216.0;

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
    /// For the fused test of `entry` and `postponed`.
    pub grown: Vec<CentredNode>,
    pub wide: Vec<WideNode>,
    pub quad: Vec<QuadNode>,
}

impl NodeArrays {
    /// Boxes grown by `pad`, those for the fused test by `grown`.
    pub fn new(tree: &Tree, pad: f32, grown: f32) -> Self {
        Self {
            single: nodes(tree, pad),
            threaded: threaded_nodes(tree, pad),
            pair: pair_nodes(tree, pad),
            grown: centred_nodes(tree, grown),
            wide: wide_nodes(&WideTree::new(tree), tree, pad),
            quad: quad_nodes(&QuadTree::new(tree), tree, pad),
        }
    }
}

/// A tree's collapsed forms, made when first asked for.
#[derive(Default)]
pub struct Collapsed {
    wide: OnceLock<WideTree>,
    quad: OnceLock<QuadTree>,
}

impl Collapsed {
    /// To eight children a node.
    pub fn wide(&self, tree: &Tree) -> &WideTree {
        self.wide.get_or_init(|| WideTree::new(tree))
    }

    /// To four children a node.
    pub fn quad(&self, tree: &Tree) -> &QuadTree {
        self.quad.get_or_init(|| QuadTree::new(tree))
    }
}

/// The array of nodes of a layout, bytes; a word where the kernel reads none.
pub fn node_bytes(layout: NodeLayout, tree: &Tree, collapsed: &Collapsed, pad: f32) -> Vec<u8> {
    match layout {
        NodeLayout::None => vec![0; 16],
        // No faces.
        NodeLayout::Faces => vec![0; size_of::<Face>()],
        NodeLayout::Single => bytemuck::cast_slice(&nodes(tree, pad)).to_vec(),
        NodeLayout::Threaded => bytemuck::cast_slice(&threaded_nodes(tree, pad)).to_vec(),
        NodeLayout::Threaded48 => bytemuck::cast_slice(&threaded_nodes48(tree, pad)).to_vec(),
        NodeLayout::Pair => bytemuck::cast_slice(&pair_nodes(tree, pad)).to_vec(),
        NodeLayout::Centred => bytemuck::cast_slice(&centred_nodes(tree, pad)).to_vec(),
        NodeLayout::Compact => bytemuck::cast_slice(&compact_nodes(tree, pad)).to_vec(),
        NodeLayout::Wide => bytemuck::cast_slice(&wide_nodes(collapsed.wide(tree), tree, pad)).to_vec(),
        NodeLayout::Quad => bytemuck::cast_slice(&quad_nodes(collapsed.quad(tree), tree, pad)).to_vec(),
    }
}

/// Bytes of the array of nodes of a layout, at most, without making it.
pub fn node_array_bytes(layout: NodeLayout, tree: &Tree, collapsed: &Collapsed) -> u64 {
    let nodes = tree.nodes.len() as u64;
    match layout {
        NodeLayout::None => 16,
        NodeLayout::Faces => size_of::<Face>() as u64,
        NodeLayout::Single => nodes * size_of::<Node>() as u64,
        NodeLayout::Threaded => nodes * size_of::<ThreadedNode>() as u64,
        NodeLayout::Threaded48 => nodes * size_of::<ThreadedNode48>() as u64,
        NodeLayout::Pair => (nodes / 2).max(1) * size_of::<PairNode>() as u64,
        NodeLayout::Centred => (nodes / 2).max(1) * size_of::<CentredNode>() as u64,
        NodeLayout::Compact => (nodes / 2).max(1) * size_of::<CompactNode>() as u64,
        NodeLayout::Wide => (collapsed.wide(tree).nodes.len() * size_of::<WideNode>()) as u64,
        NodeLayout::Quad => (collapsed.quad(tree).nodes.len() * size_of::<QuadNode>()) as u64,
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

/// Nodes for `ordered` and `packet`.
pub fn pair_nodes(tree: &Tree, pad: f32) -> Vec<PairNode> {
    let inner = InnerNodes::of(tree);
    let child = |index: u32| (grown(&tree.nodes[index as usize].bounds, pad), inner.reference(tree, index));
    if let Some(root) = inner.lone_leaf {
        let ((left_min, left_max), left) = child(root);
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
    let nodes = inner.children.iter().map(|&[left, right]| {
        let ((left_min, left_max), left) = child(left);
        let ((right_min, right_max), right) = child(right);
        PairNode { left_min, left, left_max, right, right_min, pad0: 0, right_max, pad1: 0 }
    });
    nodes.collect()
}

/// Nodes for `entry` and `postponed`: the same boxes by their centres.
pub fn centred_nodes(tree: &Tree, pad: f32) -> Vec<CentredNode> {
    let centred = |node: &PairNode| {
        let (left_center, left_half) = centred_box(node.left_min, node.left_max);
        let (right_center, right_half) = centred_box(node.right_min, node.right_max);
        let PairNode { left, right, .. } = *node;
        CentredNode { left_center, left, left_half, right, right_center, pad0: 0, right_half, pad1: 0 }
    };
    pair_nodes(tree, pad).iter().map(centred).collect()
}

/// The same in less room, hardly larger.
pub fn compact_nodes(tree: &Tree, pad: f32) -> Vec<CompactNode> {
    let compact = |node: &CentredNode| {
        let CentredNode { left_center, left, right_center, right, .. } = *node;
        let [left_half_xz, left_half_yz] = packed_halves(node.left_half);
        let [right_half_xz, right_half_yz] = packed_halves(node.right_half);
        CompactNode {
            left_center,
            left,
            right_center,
            right,
            left_half_xz,
            left_half_yz,
            right_half_xz,
            right_half_yz,
        }
    };
    centred_nodes(tree, pad).iter().map(compact).collect()
}

/// A box's centre, and half its size as it is seen from there, rounded up.
fn centred_box(pmin: [f32; 3], pmax: [f32; 3]) -> ([f32; 3], [f32; 3]) {
    let center = [0, 1, 2].map(|axis| pmin[axis] * 0.5 + pmax[axis] * 0.5);
    let half = [0, 1, 2].map(|axis| {
        let middle = f64::from(center[axis]);
        let exact = (f64::from(pmax[axis]) - middle).max(middle - f64::from(pmin[axis]));
        let rounded = exact as f32;
        if f64::from(rounded) < exact { rounded.next_up() } else { rounded }
    });
    (center, half)
}

/// Three floats from 0 to 2^127 in two words, none of them less than it was, nor larger by more than 2^-12 of it. A float's upper bits but its sign
/// are kept: x's in bits 31 to 12 of the first word, z's in its bits 10 to 0 and in bits 31 to 22 of the second, y's in bits 20 to 0. The others
/// are 0, signs in what is read. What stands below z and x when they are read makes them larger, so they are rounded with it.
pub fn packed_halves(half: [f32; 3]) -> [u32; 2] {
    let rounded = |half: f32, dropped: u32, below: u32| {
        let kept = half.to_bits() >> dropped;
        kept + u32::from(kept << dropped | below < half.to_bits())
    };
    let [x, y, z] = half;
    let y = rounded(y, 10, 0);
    let z = rounded(z, 10, y >> 12);
    let x = rounded(x, 11, z >> 11);
    [x << 12 | z >> 10, (z & 0x3ff) << 22 | y]
}

/// The inner nodes of a tree as the records with both children's boxes number them: the root first, each before its
/// children and the left subtree before the right one. Left is the larger child, whose box more rays meet: any hit takes it first.
struct InnerNodes {
    children: Vec<[u32; 2]>,
    /// Of each node of the tree that is an inner one, its number.
    places: Vec<i32>,
    /// The root, if it is a leaf.
    lone_leaf: Option<u32>,
}

impl InnerNodes {
    fn of(tree: &Tree) -> Self {
        let root = tree.nodes.len().checked_sub(1).map(|root| root as u32);
        let mut inner = Self { children: Vec::new(), places: vec![0; tree.nodes.len()], lone_leaf: None };
        let mut open: Vec<u32> = root.into_iter().collect();
        while let Some(index) = open.pop() {
            if let Content::Inner { left, right } = tree.nodes[index as usize].content {
                let area = |child: u32| tree.nodes[child as usize].bounds.half_area();
                let [left, right] = if area(right) > area(left) { [right, left] } else { [left, right] };
                inner.places[index as usize] = inner.children.len() as i32;
                inner.children.push([left, right]);
                open.extend([right, left]);
            }
        }
        inner.lone_leaf = root.filter(|_| inner.children.is_empty());
        inner
    }

    fn reference(&self, tree: &Tree, index: u32) -> i32 {
        match tree.nodes[index as usize].content {
            Content::Inner { .. } => self.places[index as usize],
            Content::Leaf { first, count } => packed_leaf(first, count),
        }
    }
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
