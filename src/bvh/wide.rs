//! The binary tree collapsed to eight children a node: Ylitie, Karras and Laine, "Efficient Incoherent Ray
//! Traversal on GPUs Through Compressed Wide BVHs" (2017), sections 3.1 and 3.2.

use glam::Vec3;

use super::{Content, Tree};
use crate::layout::LEAF_LIMIT;

/// Most children of a node.
pub const WIDTH: usize = 8;

/// Cost of testing a triangle, where a visit of a node costs 1 (measured on Mesa's CPU device; Ylitie et al. have
/// 0.3).
const TRIANGLE_COST: f32 = 1.0;

/// What a slot of a node holds. `node` is the root of its subtree in the binary tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Slot {
    #[default]
    Empty,
    /// Another node of the wide tree.
    Inner { node: u32, index: u32 },
    /// Triangles, by their place in [`Tree::order`]: a whole subtree of the binary tree.
    Leaf { node: u32, first: u32, count: u32 },
}

impl Slot {
    /// Its place in the binary tree.
    pub fn node(self) -> Option<u32> {
        match self {
            Self::Empty => None,
            Self::Inner { node, .. } | Self::Leaf { node, .. } => Some(node),
        }
    }
}

/// A tree of eight children a node: the root first, each node before its children, siblings side by side. Slot i
/// lies in octant i of its node (bit k: towards positive k), so that a ray whose direction is negative along
/// the axes of `octant` meets slots about in the order of `slot ^ octant`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WideTree {
    pub nodes: Vec<[Slot; WIDTH]>,
}

impl WideTree {
    /// Collapses the binary tree so that its expected cost (surface area heuristic) is least.
    pub fn new(tree: &Tree) -> Self {
        let Some(root) = tree.nodes.len().checked_sub(1) else {
            return Self { nodes: vec![[Slot::Empty; WIDTH]] };
        };
        let choices = Choices::new(tree);
        let mut nodes = vec![[Slot::Empty; WIDTH]];
        let mut open = vec![(root as u32, 0usize)];
        while let Some((node, place)) = open.pop() {
            let mut children = Vec::with_capacity(WIDTH);
            choices.children(tree, node, &mut children);
            let mut slots = [Slot::Empty; WIDTH];
            for (child, slot) in octants(tree, node, &children) {
                slots[slot] = if choices.is_leaf(child) {
                    let (first, count) = choices.ranges[child as usize];
                    Slot::Leaf { node: child, first, count }
                } else {
                    Slot::Inner { node: child, index: 0 }
                };
            }
            for slot in &mut slots {
                if let Slot::Inner { node, index } = slot {
                    *index = nodes.len() as u32;
                    open.push((*node, nodes.len()));
                    nodes.push([Slot::Empty; WIDTH]);
                }
            }
            nodes[place] = slots;
        }
        Self { nodes }
    }

    /// Most triangles in a leaf.
    pub fn largest_leaf(&self) -> u32 {
        let count = |slot: &Slot| if let Slot::Leaf { count, .. } = slot { *count } else { 0 };
        self.nodes.iter().flatten().map(count).max().unwrap_or(0)
    }

    /// Entries that a ray's stack can need: a node leaves at most one there, its children that wait, and only while
    /// another child of it is visited.
    pub fn stack_bound(&self) -> u32 {
        let mut held = vec![0u32; self.nodes.len()];
        for (place, slots) in self.nodes.iter().enumerate() {
            let waits = slots.iter().filter(|slot| **slot != Slot::Empty).count() > 1;
            for slot in slots {
                if let Slot::Inner { index, .. } = slot {
                    held[*index as usize] = held[place] + u32::from(waits);
                }
            }
        }
        held.into_iter().max().unwrap_or(0)
    }
}

/// What is cheapest for each binary node, by dynamic programming from the leaves up.
struct Choices {
    /// Triangles below: first place in the order, count.
    ranges: Vec<(u32, u32)>,
    plans: Vec<Plan>,
}

/// The cheapest forest of at most i wide subtrees that stands for a binary subtree, for i = 1 to 7. Its cost lies
/// at i - 1.
#[derive(Clone, Copy, Default)]
struct Plan {
    costs: [f32; WIDTH - 1],
    /// Of j trees, so many for the left child, at j - 1.
    splits: [u8; WIDTH],
    /// Bit i - 1: with i trees allowed, i - 1 are as good.
    fewer: u8,
    /// Of one tree: a leaf.
    leaf: bool,
}

impl Choices {
    fn new(tree: &Tree) -> Self {
        let mut choices = Self {
            ranges: Vec::with_capacity(tree.nodes.len()),
            plans: Vec::with_capacity(tree.nodes.len()),
        };
        for node in &tree.nodes {
            let size = node.bounds.max - node.bounds.min;
            let area = size.x * size.y + size.y * size.z + size.z * size.x;
            let (range, plan) = match node.content {
                Content::Leaf { first, count } => {
                    let costs = [area * count as f32 * TRIANGLE_COST; WIDTH - 1];
                    ((first, count), Plan { costs, leaf: true, ..Plan::default() })
                }
                Content::Inner { left, right } => {
                    let (left, right) = (left as usize, right as usize);
                    let (first, left_count) = choices.ranges[left];
                    let count = left_count + choices.ranges[right].1;
                    ((first, count), Plan::of(area, count, &choices.plans[left], &choices.plans[right]))
                }
            };
            choices.ranges.push(range);
            choices.plans.push(plan);
        }
        choices
    }

    fn is_leaf(&self, node: u32) -> bool {
        self.plans[node as usize].leaf
    }

    /// The children of the wide node that stands for a binary one: roots of binary subtrees. A leaf is its own.
    fn children(&self, tree: &Tree, node: u32, children: &mut Vec<u32>) {
        match tree.nodes[node as usize].content {
            Content::Inner { left, right } if !self.is_leaf(node) => {
                let split = usize::from(self.plans[node as usize].splits[WIDTH - 1]);
                self.forest(tree, left, split, children);
                self.forest(tree, right, WIDTH - split, children);
            }
            _ => children.push(node),
        }
    }

    fn forest(&self, tree: &Tree, node: u32, mut trees: usize, roots: &mut Vec<u32>) {
        let plan = &self.plans[node as usize];
        while trees > 1 && plan.fewer >> (trees - 1) & 1 == 1 {
            trees -= 1;
        }
        match tree.nodes[node as usize].content {
            Content::Inner { left, right } if trees > 1 => {
                let split = usize::from(plan.splits[trees - 1]);
                self.forest(tree, left, split, roots);
                self.forest(tree, right, trees - split, roots);
            }
            _ => roots.push(node),
        }
    }
}

impl Plan {
    fn of(area: f32, count: u32, left: &Self, right: &Self) -> Self {
        let mut plan = Self::default();
        let mut distributed = [f32::INFINITY; WIDTH];
        for trees in 2..=WIDTH {
            plan.splits[trees - 1] = 1;
            for split in 1..trees {
                let cost = left.costs[split - 1] + right.costs[trees - split - 1];
                if cost < distributed[trees - 1] {
                    distributed[trees - 1] = cost;
                    plan.splits[trees - 1] = split as u8;
                }
            }
        }
        let as_node = distributed[WIDTH - 1] + area;
        let as_leaf = if count <= LEAF_LIMIT { area * count as f32 * TRIANGLE_COST } else { f32::INFINITY };
        plan.leaf = count <= LEAF_LIMIT && as_leaf <= as_node;
        plan.costs[0] = as_node.min(as_leaf);
        for trees in 2..WIDTH {
            let fewer = plan.costs[trees - 2] <= distributed[trees - 1];
            plan.fewer |= u8::from(fewer) << (trees - 1);
            plan.costs[trees - 1] = plan.costs[trees - 2].min(distributed[trees - 1]);
        }
        plan
    }
}

/// Gives each child its slot: the pair that lies farthest along its octant's diagonal first.
fn octants(tree: &Tree, node: u32, children: &[u32]) -> Vec<(u32, usize)> {
    let center = |node: u32| {
        let bounds = &tree.nodes[node as usize].bounds;
        bounds.min * 0.5 + bounds.max * 0.5
    };
    let middle = center(node);
    let mut away = [[f32::NEG_INFINITY; WIDTH]; WIDTH];
    for (row, &child) in away.iter_mut().zip(children) {
        let from_middle = center(child) - middle;
        *row = std::array::from_fn(|slot| from_middle.dot(diagonal(slot)));
    }
    let (mut waiting, mut free) = ([true; WIDTH], [true; WIDTH]);
    let mut given: Vec<(u32, usize)> = Vec::with_capacity(children.len());
    for _ in children {
        // Of equal ones the first.
        let mut farthest: Option<(f32, usize, usize)> = None;
        for place in (0..children.len()).filter(|&place| waiting[place]) {
            for slot in (0..WIDTH).filter(|&slot| free[slot]) {
                let distance = away[place][slot];
                if farthest.is_none_or(|(best, ..)| distance.total_cmp(&best).is_gt()) {
                    farthest = Some((distance, place, slot));
                }
            }
        }
        let Some((_, place, slot)) = farthest else { break };
        (waiting[place], free[slot]) = (false, false);
        given.push((children[place], slot));
    }
    given
}

/// Towards the octant: bit k of the slot is the side along axis k.
fn diagonal(slot: usize) -> Vec3 {
    let side = |axis: usize| if slot >> axis & 1 == 1 { 1.0 } else { -1.0 };
    Vec3::new(side(0), side(1), side(2))
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;
    use crate::bvh::midpoint;
    use crate::reference::testing::{KINDS, triangles_of};

    fn trees(mut check: impl FnMut(&Tree, &WideTree)) {
        for kind in KINDS {
            for count in [1, 2, 3, 9, 100, 3000] {
                let tree = midpoint::build(&triangles_of(kind, 60 + count as u64, count));
                check(&tree, &WideTree::new(&tree));
            }
        }
    }

    #[test]
    fn leaves_hold_every_place_once() {
        trees(|tree, wide| {
            let mut seen = vec![0; tree.order.len()];
            for slot in wide.nodes.iter().flatten() {
                if let Slot::Leaf { first, count, .. } = *slot {
                    assert!((1..=LEAF_LIMIT).contains(&count));
                    seen[first as usize..(first + count) as usize].iter_mut().for_each(|seen| *seen += 1);
                }
            }
            assert!(seen.iter().all(|&seen| seen == 1));
        });
    }

    /// Expected cost of a wide tree, as the collapse counts it.
    fn cost(tree: &Tree, wide: &WideTree) -> f64 {
        let area = |node: u32| {
            let size =
                (tree.nodes[node as usize].bounds.max - tree.nodes[node as usize].bounds.min).as_dvec3();
            size.x * size.y + size.y * size.z + size.z * size.x
        };
        let of_slot = |slot: &Slot| match *slot {
            Slot::Empty => 0.0,
            Slot::Inner { node, .. } => area(node),
            Slot::Leaf { node, count, .. } => area(node) * f64::from(count) * f64::from(TRIANGLE_COST),
        };
        wide.nodes.iter().flatten().map(of_slot).sum()
    }

    /// The least cost of at most `trees` wide subtrees that stand for `node`; 0: of the children of its wide node.
    fn cheapest(tree: &Tree, node: u32, trees: usize, known: &mut HashMap<(u32, usize), f64>) -> f64 {
        if let Some(&cost) = known.get(&(node, trees)) {
            return cost;
        }
        let size = (tree.nodes[node as usize].bounds.max - tree.nodes[node as usize].bounds.min).as_dvec3();
        let area = size.x * size.y + size.y * size.z + size.z * size.x;
        let as_leaf = |count: u32| area * f64::from(count) * f64::from(TRIANGLE_COST);
        let cost = match tree.nodes[node as usize].content {
            Content::Leaf { count, .. } => as_leaf(count),
            Content::Inner { left, right } => {
                let mut spread = |trees: usize| {
                    let way = |k| cheapest(tree, left, k, known) + cheapest(tree, right, trees - k, known);
                    (1..trees).map(way).fold(f64::INFINITY, f64::min)
                };
                match (trees, triangles_below(tree, node)) {
                    (0, _) => spread(WIDTH),
                    (1, count) if count <= LEAF_LIMIT => as_leaf(count).min(area + spread(WIDTH)),
                    (1, _) => area + spread(WIDTH),
                    _ => spread(trees).min(cheapest(tree, node, trees - 1, known)),
                }
            }
        };
        known.insert((node, trees), cost);
        cost
    }

    fn triangles_below(tree: &Tree, node: u32) -> u32 {
        match tree.nodes[node as usize].content {
            Content::Leaf { count, .. } => count,
            Content::Inner { left, right } => triangles_below(tree, left) + triangles_below(tree, right),
        }
    }

    #[test]
    fn no_other_collapse_is_cheaper() {
        for kind in KINDS {
            for count in [2, 4, 20, 100] {
                let tree = midpoint::build(&triangles_of(kind, 70 + count as u64, count));
                let root = tree.nodes.len() as u32 - 1;
                let wide = WideTree::new(&tree);
                let lone = wide.nodes[0].iter().any(|slot| slot.node() == Some(root));
                let best = cheapest(&tree, root, usize::from(lone), &mut HashMap::new());
                assert!((cost(&tree, &wide) - best).abs() <= 1e-4 * best, "{kind:?} {count}");
            }
        }
    }

    /// The most entries that a traversal of this octant which meets every box ever holds.
    fn replay(wide: &WideTree, octant: usize) -> usize {
        let (mut stack, mut most) = (Vec::new(), 0);
        let group = |node: u32| {
            let filled = |place: &usize| wide.nodes[node as usize][*place ^ octant] != Slot::Empty;
            (node, (0..WIDTH).filter(filled).collect::<Vec<_>>())
        };
        let mut now = group(0);
        loop {
            if now.1.is_empty() {
                let Some(popped) = stack.pop() else { return most };
                now = popped;
            }
            let place = now.1.remove(0);
            if let Slot::Inner { index, .. } = wide.nodes[now.0 as usize][place ^ octant] {
                if !now.1.is_empty() {
                    stack.push(now);
                    most = most.max(stack.len());
                }
                now = group(index);
            }
        }
    }

    #[test]
    fn the_bound_covers_a_full_traversal_from_every_octant() {
        let mut met = 0;
        trees(|_, wide| {
            let most = (0..WIDTH).map(|octant| replay(wide, octant)).max().unwrap_or(0);
            let bound = wide.stack_bound() as usize;
            assert!(most <= bound, "{most} of {bound}");
            met += usize::from(most == bound);
        });
        assert!(met >= 12, "the bound was met {met} times");
    }

    #[test]
    fn children_lie_in_the_octants_of_their_slots() {
        let leaf = |x: f32, y: f32, z: f32, id| crate::layout::Triangle {
            a: [x, y, z],
            id,
            ab: [0.1, 0.0, 0.1],
            ac: [0.0, 0.1, 0.0],
            ..Default::default()
        };
        let corners: Vec<_> = (0..8u32)
            .map(|i| {
                let side = |k: u32| if i >> k & 1 == 1 { 1.0 } else { -1.0 };
                leaf(side(0), side(1), side(2), i)
            })
            .collect();
        let tree = midpoint::build(&corners);
        let wide = WideTree::new(&tree);
        assert_eq!(wide.nodes.len(), 1);
        for (place, slot) in wide.nodes[0].iter().enumerate() {
            let Slot::Leaf { first, count: 1, .. } = *slot else { panic!("{slot:?}") };
            assert_eq!(tree.order[first as usize], place as u32);
        }
    }
}
