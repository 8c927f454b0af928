//! A subtree under construction, in post-order, its places counted from its own first node and triangle.

use super::{Aabb, Content, Tree, TreeNode};

#[derive(Default)]
pub struct Part {
    pub nodes: Vec<TreeNode>,
    pub order: Vec<u32>,
}

impl Part {
    /// Adds a leaf and returns its place.
    pub fn leaf(&mut self, bounds: Aabb, triangles: impl Iterator<Item = u32>) -> u32 {
        let first = self.order.len() as u32;
        self.order.extend(triangles);
        let count = self.order.len() as u32 - first;
        self.push(TreeNode { bounds, content: Content::Leaf { first, count } })
    }

    /// Joins the subtrees whose roots stand at `left` and, just added, at `right`.
    pub fn inner(&mut self, left: u32, right: u32) -> u32 {
        let bounds = self.nodes[left as usize].bounds.union(&self.nodes[right as usize].bounds);
        self.push(TreeNode { bounds, content: Content::Inner { left, right } })
    }

    /// Adds another part and returns the place of its root.
    pub fn append(&mut self, other: Self) -> u32 {
        let (node_shift, order_shift) = (self.nodes.len() as u32, self.order.len() as u32);
        self.order.extend(other.order);
        self.nodes.extend(other.nodes.into_iter().map(|node| {
            let content = match node.content {
                Content::Inner { left, right } => {
                    Content::Inner { left: left + node_shift, right: right + node_shift }
                }
                Content::Leaf { first, count } => Content::Leaf { first: first + order_shift, count },
            };
            TreeNode { content, ..node }
        }));
        self.nodes.len() as u32 - 1
    }

    pub fn tree(self) -> Tree {
        Tree { nodes: self.nodes, order: self.order }
    }

    fn push(&mut self, node: TreeNode) -> u32 {
        self.nodes.push(node);
        self.nodes.len() as u32 - 1
    }
}
