//! Trees of boxes over triangles: builders and what is computed from a tree. No GPU in here.

pub mod midpoint;
pub mod stack;
pub mod thread;
pub mod validate;
pub mod wide;

use glam::Vec3;

use crate::layout::Triangle;

/// An axis-aligned box in device units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    pub min: Vec3,
    pub max: Vec3,
}

impl Aabb {
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    pub fn contains(&self, other: &Self) -> bool {
        self.min.cmple(other.min).all() && self.max.cmpge(other.max).all()
    }

    /// The box of a triangle's corners as the shaders compute them: a, a + ab, a + ac.
    pub fn of(triangle: &Triangle) -> Self {
        let a = Vec3::from(triangle.a);
        let b = a + Vec3::from(triangle.ab);
        let c = a + Vec3::from(triangle.ac);
        Self { min: a.min(b.min(c)), max: a.max(b.max(c)) }
    }
}

/// What a node holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// Two children, by their place in [`Tree::nodes`].
    Inner { left: u32, right: u32 },
    /// Triangles, by their place in [`Tree::order`].
    Leaf { first: u32, count: u32 },
}

/// A node of a binary tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TreeNode {
    pub bounds: Aabb,
    pub content: Content,
}

/// A binary tree in post-order: the left subtree, the right subtree, the node; so the root comes last,
/// and an inner node's right child stands just before it.
#[derive(Clone, Debug, PartialEq)]
pub struct Tree {
    pub nodes: Vec<TreeNode>,
    /// Triangles (places in the scene's list) in the order of the leaves.
    pub order: Vec<u32>,
}

impl Tree {
    /// Most triangles in a leaf.
    pub fn largest_leaf(&self) -> u32 {
        let counts = self.nodes.iter().map(|node| match node.content {
            Content::Inner { .. } => 0,
            Content::Leaf { count, .. } => count,
        });
        counts.max().unwrap_or(0)
    }

    /// Levels below the root: 0 for a lone leaf.
    pub fn depth(&self) -> u32 {
        let mut depths = vec![0u32; self.nodes.len()];
        for (index, node) in self.nodes.iter().enumerate() {
            if let Content::Inner { left, right } = node.content {
                depths[index] = 1 + depths[left as usize].max(depths[right as usize]);
            }
        }
        depths.last().copied().unwrap_or(0)
    }
}
