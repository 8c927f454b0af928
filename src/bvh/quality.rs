//! What can be said of a tree without tracing a ray.

use super::stack::stack_bound;
use super::{BOX_COST, Content, TRIANGLE_COST, Tree};

/// The shape of a tree, and what a random ray is expected to cost.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Quality {
    /// Expected cost of a ray that crosses the root's box and meets nothing, by the surface area heuristic
    /// (Goldsmith and Salmon, 1987; MacDonald and Booth, 1990), in tests of a box: the sum over inner nodes of
    /// [`BOX_COST`] A / A(root), and over leaves of [`TRIANGLE_COST`] n A / A(root); A is a box's
    /// surface, n the leaf's number of triangles. A root without a surface counts as 1 everywhere.
    pub sah_cost: f64,
    /// Levels below the root.
    pub depth: u32,
    /// Entries that `stackN` can need.
    pub stack_bound: u32,
    /// Places in the order of the leaves.
    pub references: usize,
    /// References beyond the first to the same triangle.
    pub duplicates: usize,
    pub leaves: usize,
    /// Most triangles in a leaf.
    pub largest_leaf: u32,
    pub nodes: usize,
}

impl Quality {
    pub fn of(tree: &Tree) -> Self {
        let root_area = tree.nodes.last().map_or(0.0, |root| root.bounds.half_area());
        let mut sah_cost = 0.0;
        let mut leaves = 0;
        for node in &tree.nodes {
            let weight = match node.content {
                Content::Inner { .. } => BOX_COST,
                Content::Leaf { count, .. } => {
                    leaves += 1;
                    TRIANGLE_COST * f64::from(count)
                }
            };
            let share = if root_area > 0.0 { node.bounds.half_area() / root_area } else { 1.0 };
            sah_cost += weight * share;
        }
        let triangles = tree.order.iter().max().map_or(0, |&last| last as usize + 1);
        let mut seen = vec![false; triangles];
        let mut duplicates = 0;
        for &triangle in &tree.order {
            if let Some(seen) = seen.get_mut(triangle as usize) {
                duplicates += usize::from(*seen);
                *seen = true;
            }
        }
        Self {
            sah_cost,
            depth: tree.depth(),
            stack_bound: stack_bound(tree),
            references: tree.order.len(),
            duplicates,
            leaves,
            largest_leaf: tree.largest_leaf(),
            nodes: tree.nodes.len(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::{Aabb, TreeNode};
    use glam::Vec3;

    /// Two leaves of one and two triangles, cubes of side 1 and 2 in one of side 4.
    #[test]
    fn cost_is_what_a_hand_finds() {
        let cube = |side| Aabb { min: Vec3::ZERO, max: Vec3::splat(side) };
        let node = |side, content| TreeNode { bounds: cube(side), content };
        let nodes = vec![
            node(1.0, Content::Leaf { first: 0, count: 1 }),
            node(2.0, Content::Leaf { first: 1, count: 2 }),
            node(4.0, Content::Inner { left: 0, right: 1 }),
        ];
        let tree = Tree { nodes, order: vec![0, 1, 0] };
        let expected = Quality {
            sah_cost: BOX_COST + TRIANGLE_COST * (1.0 / 16.0 + 2.0 * 4.0 / 16.0),
            depth: 1,
            stack_bound: 2,
            references: 3,
            duplicates: 1,
            leaves: 2,
            largest_leaf: 2,
            nodes: 3,
        };
        assert_eq!(Quality::of(&tree), expected);
    }
}
