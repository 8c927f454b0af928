//! The binary tree collapsed to four children a node, so that its expected cost (surface area heuristic) is least.

use super::{Content, Tree};
use crate::layout::LEAF_LIMIT;

/// Most children of a node.
pub const QUAD_WIDTH: usize = 4;

/// Cost of testing a triangle, where a visit of a node costs 1 (measured with packets of several rays a lane on Mesa's CPU
/// device).
const TRIANGLE_COST: f64 = 0.5;

/// What a slot of a node holds. `node` is the root of its subtree in the binary tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QuadSlot {
    /// Another node of the tree.
    Inner { node: u32, index: u32 },
    /// Triangles, by their place in [`Tree::order`]: a whole subtree of the binary tree.
    Leaf { node: u32, first: u32, count: u32 },
}

impl QuadSlot {
    /// Its place in the binary tree.
    pub fn node(self) -> u32 {
        match self {
            Self::Inner { node, .. } | Self::Leaf { node, .. } => node,
        }
    }
}

/// A tree of up to four children a node, in the order of the binary tree's leaves: the root first, each node before its
/// children.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct QuadTree {
    pub nodes: Vec<Vec<QuadSlot>>,
}

impl QuadTree {
    pub fn new(tree: &Tree) -> Self {
        let Some(root) = tree.nodes.len().checked_sub(1) else {
            return Self { nodes: vec![Vec::new()] };
        };
        let plans = Plan::of_all(tree);
        let mut nodes = vec![Vec::new()];
        let mut open = vec![(root as u32, 0usize)];
        while let Some((node, place)) = open.pop() {
            let mut children = Vec::with_capacity(QUAD_WIDTH);
            match tree.nodes[node as usize].content {
                Content::Inner { left, right } if !plans[node as usize].leaf => {
                    let split = plans[node as usize].splits[QUAD_WIDTH - 1];
                    forest(tree, &plans, left, split, &mut children);
                    forest(tree, &plans, right, QUAD_WIDTH - split, &mut children);
                }
                // A lone leaf.
                _ => children.push(node),
            }
            let mut slots = Vec::with_capacity(children.len());
            for child in children {
                let plan = &plans[child as usize];
                slots.push(if plan.leaf {
                    QuadSlot::Leaf { node: child, first: plan.first, count: plan.count }
                } else {
                    nodes.push(Vec::new());
                    QuadSlot::Inner { node: child, index: nodes.len() as u32 - 1 }
                });
            }
            // The first child's subtree comes first.
            for slot in slots.iter().rev() {
                if let QuadSlot::Inner { node, index } = *slot {
                    open.push((node, index as usize));
                }
            }
            nodes[place] = slots;
        }
        Self { nodes }
    }

    /// Most triangles in a leaf.
    pub fn largest_leaf(&self) -> u32 {
        let count = |slot: &QuadSlot| if let QuadSlot::Leaf { count, .. } = slot { *count } else { 0 };
        self.nodes.iter().flatten().map(count).max().unwrap_or(0)
    }

    /// Entries that a stack can need: all children of a node but the one that is visited wait there.
    pub fn stack_bound(&self) -> u32 {
        let mut held = vec![0u32; self.nodes.len()];
        let mut most = 0;
        for (place, slots) in self.nodes.iter().enumerate() {
            let waiting = held[place] + (slots.len() as u32).saturating_sub(1);
            most = most.max(waiting);
            for slot in slots {
                if let QuadSlot::Inner { index, .. } = slot {
                    held[*index as usize] = waiting;
                }
            }
        }
        most
    }
}

/// The cheapest forest of at most i subtrees that stands for a binary subtree, for i = 1 to 4, by dynamic programming from the
/// leaves up.
#[derive(Clone, Default)]
struct Plan {
    /// Triangles below: first place in the order, count.
    first: u32,
    count: u32,
    /// Of at most i trees, at i - 1.
    costs: [f64; QUAD_WIDTH],
    /// Of i trees, so many for the left child, at i - 1; 0 where fewer trees are as good.
    splits: [usize; QUAD_WIDTH],
    /// Of one tree: a leaf.
    leaf: bool,
}

impl Plan {
    fn of_all(tree: &Tree) -> Vec<Self> {
        let mut plans: Vec<Self> = Vec::with_capacity(tree.nodes.len());
        for node in &tree.nodes {
            let area = node.bounds.half_area();
            let plan = match node.content {
                Content::Leaf { first, count } => {
                    let costs = [area * f64::from(count) * TRIANGLE_COST; QUAD_WIDTH];
                    Self { first, count, costs, splits: [0; QUAD_WIDTH], leaf: true }
                }
                Content::Inner { left, right } => {
                    Self::of(area, &plans[left as usize], &plans[right as usize])
                }
            };
            plans.push(plan);
        }
        plans
    }

    fn of(area: f64, left: &Self, right: &Self) -> Self {
        let count = left.count + right.count;
        let mut plan = Self { first: left.first.min(right.first), count, ..Self::default() };
        let mut spread = [f64::INFINITY; QUAD_WIDTH];
        for trees in 2..=QUAD_WIDTH {
            plan.splits[trees - 1] = 1;
            for split in 1..trees {
                let cost = left.costs[split - 1] + right.costs[trees - split - 1];
                if cost < spread[trees - 1] {
                    spread[trees - 1] = cost;
                    plan.splits[trees - 1] = split;
                }
            }
        }
        let as_node = spread[QUAD_WIDTH - 1] + area;
        let as_leaf =
            if count <= LEAF_LIMIT { area * f64::from(count) * TRIANGLE_COST } else { f64::INFINITY };
        plan.leaf = count <= LEAF_LIMIT && as_leaf <= as_node;
        plan.costs[0] = as_node.min(as_leaf);
        for trees in 2..=QUAD_WIDTH {
            let fewer = plan.costs[trees - 2];
            // A node of its own has all its places, whatever its parent's forest has to spare.
            if fewer <= spread[trees - 1] && trees < QUAD_WIDTH {
                plan.splits[trees - 1] = 0;
            }
            plan.costs[trees - 1] = fewer.min(spread[trees - 1]);
        }
        plan
    }
}

fn forest(tree: &Tree, plans: &[Plan], node: u32, mut trees: usize, roots: &mut Vec<u32>) {
    let plan = &plans[node as usize];
    while trees > 1 && plan.splits[trees - 1] == 0 {
        trees -= 1;
    }
    match tree.nodes[node as usize].content {
        Content::Inner { left, right } if trees > 1 => {
            let split = plan.splits[trees - 1];
            forest(tree, plans, left, split, roots);
            forest(tree, plans, right, trees - split, roots);
        }
        _ => roots.push(node),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::midpoint;
    use crate::reference::testing::{KINDS, triangles_of};

    /// The most entries that a walk which meets every box ever holds: the first child next, the others wait.
    fn replay(quad: &QuadTree) -> usize {
        let (mut stack, mut most) = (vec![0u32], 1);
        while let Some(place) = stack.pop() {
            let slots = &quad.nodes[place as usize];
            let inner =
                |slot: &QuadSlot| if let QuadSlot::Inner { index, .. } = *slot { Some(index) } else { None };
            // Leaves wait as well.
            most = most.max(stack.len() + slots.len().saturating_sub(1));
            stack.extend(slots.iter().filter_map(inner));
        }
        most
    }

    #[test]
    fn nodes_are_full_and_the_bound_covers_a_walk_through_all() {
        for kind in KINDS {
            for count in [1, 2, 3, 9, 100, 3000] {
                let tree = midpoint::build(&triangles_of(kind, 60 + count as u64, count));
                let quad = QuadTree::new(&tree);
                assert!(quad.nodes.iter().all(|slots| (1..=QUAD_WIDTH).contains(&slots.len())));
                assert!(quad.nodes.len() == 1 || quad.nodes.iter().all(|slots| slots.len() > 1));
                assert!(replay(&quad) <= quad.stack_bound().max(1) as usize, "{kind:?} {count}");
                assert!(quad.largest_leaf() <= LEAF_LIMIT);
                let held: u32 = quad
                    .nodes
                    .iter()
                    .flatten()
                    .map(|slot| match *slot {
                        QuadSlot::Leaf { count, .. } => count,
                        QuadSlot::Inner { .. } => 0,
                    })
                    .sum();
                assert_eq!(held as usize, tree.order.len());
            }
        }
    }
}
