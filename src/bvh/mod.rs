//! Trees of boxes over triangles: builders and what is computed from a tree. No GPU in here.

mod bins;
mod choice;
mod clip;
mod hash;
pub mod midpoint;
mod part;
pub mod ploc;
mod progress;
pub mod quad;
pub mod quality;
pub mod reinsert;
pub mod sah;
pub mod sbvh;
mod spatial;
pub mod stack;
#[cfg(test)]
mod tests;
pub mod thread;
pub mod validate;
pub mod walk_cost;
pub mod wide;

use std::sync::OnceLock;

use glam::Vec3;

pub use choice::{Built, Costs, Wanted, Weighed, build_wanted};

use crate::layout::Triangle;
use crate::names::choices;
use progress::Progress;

choices! {
    /// How a tree is made.
    Builder {
        /// The longest axis split at its middle, one triangle a leaf: the original's.
        Midpoint = "midpoint",
        /// Top-down by the surface area heuristic over bins.
        Sah = "sah",
        /// `sah`, then subtrees moved to where they cost less (parallel reinsertion: Meister and Bittner, 2018); the same tree as
        /// `sah` where none is found that costs less.
        Reinsert = "reinsert",
        /// Bottom-up by locally ordered clustering, then reinsertion.
        Ploc = "ploc",
        /// The surface area heuristic with spatial splits: a triangle may stand in several leaves.
        Sbvh = "sbvh",
    }
}

/// Builds the tree of at least one triangle. The result does not depend on the number of threads. Calls
/// `progress` now and then, from any thread, with the part done, in [0, 1].
pub fn build(builder: Builder, triangles: &[Triangle], progress: &(dyn Fn(f64) + Sync)) -> Tree {
    in_pool(triangles, progress, |counter| match builder {
        Builder::Midpoint => midpoint::build(triangles),
        Builder::Sah => sah::build(triangles, counter),
        Builder::Reinsert => reinsert::build(triangles, counter),
        Builder::Ploc => ploc::build(triangles, counter),
        Builder::Sbvh => sbvh::build(triangles, counter),
    })
}

/// Does the work on threads with deep stacks, and reports its begin and its end.
fn in_pool<T: Send>(
    triangles: &[Triangle],
    progress: &(dyn Fn(f64) + Sync),
    work: impl Fn(&Progress<'_>) -> T + Sync,
) -> T {
    progress(0.0);
    let counter = Progress::new(triangles.len(), progress);
    let work = || work(&counter);
    // Whoever calls from a pool of threads has chosen it.
    let outside = rayon::current_thread_index().is_none();
    let done = match deep_pool().filter(|_| outside) {
        Some(pool) => pool.install(work),
        None => work(),
    };
    progress(1.0);
    done
}

/// Stack of a thread that builds, bytes. While it waits for the other half of a subtree it takes up halves of others, so with
/// many threads builders nest deeply: 2 MB overflowed with 16 threads and two million triangles.
const BUILDING_STACK: usize = 256 << 20;

/// Threads with deep stacks; `None` where they cannot be had.
fn deep_pool() -> Option<&'static rayon::ThreadPool> {
    static POOL: OnceLock<Option<rayon::ThreadPool>> = OnceLock::new();
    POOL.get_or_init(|| rayon::ThreadPoolBuilder::new().stack_size(BUILDING_STACK).build().ok()).as_ref()
}

/// Cost of testing a ray against the box of an inner node, the unit of the surface area heuristic.
pub const BOX_COST: f64 = 1.0;

/// Cost of testing a ray against a triangle, in units of [`BOX_COST`].
pub const TRIANGLE_COST: f64 = 1.0;

/// Below this level a builder stops to weigh splits and halves its list, so that every tree is shallow.
const WEIGHED_LEVELS: u32 = 60;

/// Below this many triangles a subtree is built by the thread that comes to it.
const PARALLEL_FROM: usize = 4096;

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

    pub fn intersection(&self, other: &Self) -> Self {
        Self { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// Half the surface; 0 for an empty box. In f64, where no finite box overflows.
    pub fn half_area(&self) -> f64 {
        let size = self.max.as_dvec3() - self.min.as_dvec3();
        if size.min_element() < 0.0 { 0.0 } else { size.x * size.y + size.y * size.z + size.z * size.x }
    }

    /// Its middle; finite for every finite box.
    pub fn center(&self) -> Vec3 {
        self.min * 0.5 + self.max * 0.5
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
