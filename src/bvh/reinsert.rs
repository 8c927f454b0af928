//! The tree of [`sah`], its subtrees moved to where they cost less: parallel reinsertion (Meister and Bittner, 2018) by the crate
//! `obvhs`. Then subtrees become leaves where the surface area heuristic finds that cheaper, of at most [`LEAF_LIMIT`]
//! triangles.

use glam::DVec3;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use rayon::prelude::*;

use super::hash::mixed;
use super::part::Part;
use super::progress::Progress;
use super::sah::{self, Item};
use super::{Aabb, BOX_COST, Content, PARALLEL_FROM, TRIANGLE_COST, Tree, TreeNode, WEIGHED_LEVELS};
use crate::layout::{LEAF_LIMIT, Triangle};

/// A box as `obvhs` has it.
pub(super) type Cluster = obvhs::aabb::Aabb;

/// Rounds of reinsertion, each of a part of the nodes that have the largest boxes.
pub(super) struct Rounds {
    pub most: u32,
    /// The part of the nodes that the first round takes up; round n takes up an n-th of it.
    pub first: f64,
    /// The part of the tree's cost that a round gains at least, or it is the last one.
    pub least_gain: f64,
}

const ROUNDS: Rounds = Rounds { most: 16, first: 0.1, least_gain: 0.002 };

/// Builds the tree of at least one triangle.
pub(super) fn build(triangles: &[Triangle], progress: &Progress) -> Tree {
    let first = |part| progress.reach(0.3 * part);
    let tree = sah::build(triangles, &Progress::new(triangles.len(), &first));
    improved(&tree, triangles, 0.0, progress).unwrap_or(tree)
}

/// A tree of the same triangles, each of which stands in one leaf, that costs less by the surface area heuristic. None if none was
/// found, or if reinsertion gains less than the part `worth` of the cost with one triangle a leaf.
pub(super) fn improved(tree: &Tree, triangles: &[Triangle], worth: f64, progress: &Progress) -> Option<Tree> {
    let mut items = sah::items_of(triangles);
    let mut bvh = taken_apart(tree, &clusters_of(&items)?);
    if ROUNDS.run(&mut bvh, progress) < worth {
        return None;
    }
    let other = Emission { bvh: &bvh, items: &mut items }.tree();
    (cost_of(&other) < cost_of(tree)).then_some(other)
}

/// The sum of the surface area heuristic, in half areas.
fn cost_of(tree: &Tree) -> f64 {
    let cost = |node: &TreeNode| {
        let tests = match node.content {
            Content::Inner { .. } => BOX_COST,
            Content::Leaf { count, .. } => TRIANGLE_COST * f64::from(count),
        };
        node.bounds.half_area() * tests
    };
    tree.nodes.iter().map(cost).sum()
}

/// The tree as one of `obvhs`, one triangle a leaf: larger leaves are halved. `clusters`: the triangles' boxes.
fn taken_apart(tree: &Tree, clusters: &[Cluster]) -> Bvh2 {
    let mut nodes = vec![Bvh2Node::default()];
    // Nodes of the tree and leaves' parts, with their places among the nodes.
    let mut open = vec![(tree.nodes[tree.nodes.len() - 1].content, 0)];
    while let Some((content, place)) = open.pop() {
        let halves = match content {
            Content::Leaf { first, count: 1 } => {
                let cluster = clusters[tree.order[first as usize] as usize];
                nodes[place] = Bvh2Node::new(cluster, 1, first);
                continue;
            }
            Content::Inner { left, right } => [left, right].map(|child| tree.nodes[child as usize].content),
            Content::Leaf { first, count } => {
                let half = count / 2;
                [(first, half), (first + half, count - half)]
                    .map(|(first, count)| Content::Leaf { first, count })
            }
        };
        let child = nodes.len();
        nodes[place] = Bvh2Node::new(Cluster::empty(), 0, child as u32);
        nodes.resize(child + 2, Bvh2Node::default());
        open.extend([(halves[0], child), (halves[1], child + 1)]);
    }
    // Children stand behind their parents.
    for place in (0..nodes.len()).rev() {
        if !nodes[place].is_leaf() {
            let child = nodes[place].first_index as usize;
            let both = nodes[child].aabb().union(nodes[child + 1].aabb());
            nodes[place] = Bvh2Node::new(both, 0, child as u32);
        }
    }
    Bvh2 { nodes, primitive_indices: tree.order.clone(), ..Bvh2::default() }
}

/// Boxes in units of the whole scene's, in [0, 1], where their surfaces neither overflow nor vanish. None if
/// they are not finite, or if there is no tree to build of them.
///
/// Each side is moved outwards by a pseudo-random part of 2^-18. Clustering joins mutual nearest
/// neighbours, and among equal distances a search takes the last: of a million equal boxes, or of boxes
/// on a line, whose surface is 0, one pair would be joined a pass. Only the shape of the tree
/// depends on these boxes, not the bounds in it.
pub(super) fn clusters_of(items: &[Item]) -> Option<Vec<Cluster>> {
    let all = items.par_iter().map(|item| item.bounds).reduce(|| Aabb::EMPTY, |a, b| a.union(&b));
    let finite = items.par_iter().all(|item| item.bounds.min.is_finite() && item.bounds.max.is_finite());
    if items.len() < 2 || !finite {
        return None;
    }
    let low = all.min.as_dvec3();
    let size = (all.max.as_dvec3() - low).max_element();
    let scale = if size > 0.0 { 1.0 / size } else { 0.0 };
    let placed = |point: glam::Vec3| (point.as_dvec3() - low) * scale;
    let cluster = |item: &Item| Cluster {
        min: (placed(item.bounds.min) - jitter(2 * item.triangle)).as_vec3a(),
        max: (placed(item.bounds.max) + jitter(2 * item.triangle + 1)).as_vec3a(),
    };
    Some(items.par_iter().map(cluster).collect())
}

/// Three numbers in [0, 2^-18), a hash of `seed`.
fn jitter(seed: u32) -> DVec3 {
    let z = mixed(u64::from(seed));
    let bits = |shift: u32| ((z >> shift) & 0xffff) as f64 / 65536.0;
    DVec3::new(bits(0), bits(16), bits(32)) * 2f64.powi(-18)
}

impl Rounds {
    /// Moves subtrees to where they cost less. The candidates are chosen here and not by `obvhs`, whose order of
    /// equal ones depends on the number of threads. Returns the part of the cost that it gained.
    pub fn run(&self, bvh: &mut Bvh2, progress: &Progress) -> f64 {
        let mut optimizer = ReinsertionOptimizer::default();
        let count = bvh.nodes.len();
        let first = sum_of_areas(bvh);
        let mut cost = first;
        for round in 1..=self.most {
            // The search's stack is as deep as this says.
            bvh.max_depth = bvh.max_depth.max(depth(bvh) + 2);
            let most = (count as f64 * self.first / f64::from(round)).ceil() as usize;
            optimizer.run_with_candidates(bvh, &largest(bvh, most), 1);
            progress.reach(0.3 + 0.6 * f64::from(round) / f64::from(self.most));
            let before = std::mem::replace(&mut cost, sum_of_areas(bvh));
            if before - cost < self.least_gain * before {
                break;
            }
        }
        if first > 0.0 { 1.0 - cost / first } else { 0.0 }
    }
}

/// Of all nodes' boxes: what the surface area heuristic says of a tree with one triangle a leaf. Added up in an order that does not
/// depend on the number of threads.
fn sum_of_areas(bvh: &Bvh2) -> f64 {
    let sum =
        |nodes: &[Bvh2Node]| -> f64 { nodes.iter().map(|node| f64::from(node.aabb().half_area())).sum() };
    let sums: Vec<f64> = bvh.nodes.par_chunks(PARALLEL_FROM).map(sum).collect();
    sums.iter().sum()
}

/// The nodes with the largest boxes, without the root; the largest first.
fn largest(bvh: &Bvh2, most: usize) -> Vec<u32> {
    // A float without a sign is ordered as its bits, and no two keys are equal.
    let area = |node: u32| u64::from(bvh.nodes[node as usize].aabb().half_area().max(0.0).to_bits());
    let key = |node: u32| (!area(node) << 32) | u64::from(node);
    let mut keys: Vec<u64> = (1..bvh.nodes.len() as u32).into_par_iter().map(key).collect();
    let most = most.min(keys.len());
    if most < keys.len() {
        keys.select_nth_unstable(most);
        keys.truncate(most);
    }
    keys.par_sort_unstable();
    keys.into_iter().map(|key| key as u32).collect()
}

/// Levels below the root.
fn depth(bvh: &Bvh2) -> usize {
    let mut deepest = 0;
    let mut open = vec![(0u32, 0usize)];
    while let Some((node, level)) = open.pop() {
        deepest = deepest.max(level);
        let node = &bvh.nodes[node as usize];
        if !node.is_leaf() {
            open.extend([(node.first_index, level + 1), (node.first_index + 1, level + 1)]);
        }
    }
    deepest
}

/// Writes a tree of `obvhs` as one of ours.
pub(super) struct Emission<'a> {
    pub bvh: &'a Bvh2,
    pub items: &'a mut [Item],
}

impl Emission<'_> {
    pub fn tree(&mut self) -> Tree {
        let mut part = Part::default();
        self.subtree(0, 0, &mut part);
        part.tree()
    }

    /// Adds the subtree of `node`; says where its root stands and what it costs: the sum of the surface
    /// area heuristic, in half areas.
    fn subtree(&mut self, node: u32, level: u32, part: &mut Part) -> (u32, f64) {
        let source = self.bvh.nodes[node as usize];
        if source.is_leaf() {
            let item = self.items[self.bvh.primitive_indices[source.first_index as usize] as usize];
            let root = part.leaf(item.bounds, std::iter::once(item.triangle));
            return (root, item.bounds.half_area() * TRIANGLE_COST);
        }
        if level >= WEIGHED_LEVELS {
            // A chain: halved instead, so that the tree stays shallow.
            let mut chain = self.items_below(node);
            let silent = Progress::new(chain.len(), &|_| {});
            return (sah::build_into(&mut chain, level, part, &silent), f64::INFINITY);
        }
        let (first_node, first) = (part.nodes.len(), part.order.len());
        let (left, left_cost) = self.subtree(source.first_index, level + 1, part);
        let (right, right_cost) = self.subtree(source.first_index + 1, level + 1, part);
        let root = part.inner(left, right);
        let bounds = part.nodes[root as usize].bounds;
        let area = bounds.half_area();
        let apart = area * BOX_COST + left_cost + right_cost;
        let count = part.order.len() - first;
        let together = area * TRIANGLE_COST * count as f64;
        if count > LEAF_LIMIT as usize || together > apart {
            return (root, apart);
        }
        part.nodes.truncate(first_node);
        let content = Content::Leaf { first: first as u32, count: count as u32 };
        part.nodes.push(TreeNode { bounds, content });
        (first_node as u32, together)
    }

    fn items_below(&self, root: u32) -> Vec<Item> {
        let (mut items, mut open) = (Vec::new(), vec![root]);
        while let Some(node) = open.pop() {
            let node = &self.bvh.nodes[node as usize];
            if node.is_leaf() {
                items.push(self.items[self.bvh.primitive_indices[node.first_index as usize] as usize]);
            } else {
                open.extend([node.first_index, node.first_index + 1]);
            }
        }
        items
    }
}
