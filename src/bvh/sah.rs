//! Top-down by the surface area heuristic (Goldsmith and Salmon, 1987; MacDonald and Booth, 1990) over bins
//! (Wald, 2007). A leaf holds as many triangles as is cheapest, at most [`LEAF_LIMIT`].

use rayon::prelude::*;

use super::bins::{Boxed, Extent, best_object_split};
use super::part::Part;
use super::progress::Progress;
use super::{Aabb, BOX_COST, PARALLEL_FROM, TRIANGLE_COST, Tree, WEIGHED_LEVELS};
use crate::layout::{LEAF_LIMIT, Triangle};

/// A triangle's box and its place in the scene's list.
#[derive(Clone, Copy)]
pub struct Item {
    pub bounds: Aabb,
    pub triangle: u32,
}

impl Boxed for Item {
    fn bounds(&self) -> &Aabb {
        &self.bounds
    }
}

/// One item for each triangle.
pub fn items_of(triangles: &[Triangle]) -> Vec<Item> {
    let item = |(place, triangle)| Item { bounds: Aabb::of(triangle), triangle: place as u32 };
    triangles.par_iter().enumerate().map(item).collect()
}

/// Builds the tree of at least one triangle.
pub(super) fn build(triangles: &[Triangle], progress: &Progress) -> Tree {
    let mut part = Part::default();
    if !triangles.is_empty() {
        build_into(&mut items_of(triangles), 0, &mut part, progress);
    }
    part.tree()
}

/// Adds the subtree of at least one item, `level` levels below the root, and returns its root's place.
pub(super) fn build_into(items: &mut [Item], level: u32, part: &mut Part, progress: &Progress) -> u32 {
    let middle = match split(items, level) {
        Ok(middle) => middle,
        Err(bounds) => return part.leaf(bounds, items.iter().map(|item| item.triangle)),
    };
    let parallel = items.len() >= PARALLEL_FROM;
    let (left, right) = items.split_at_mut(middle);
    if !parallel {
        let left = build_into(left, level + 1, part, progress);
        let right = build_into(right, level + 1, part, progress);
        return part.inner(left, right);
    }
    let mut other = Part::default();
    let (left, _) = rayon::join(
        || build_counted(left, level + 1, part, progress),
        || build_counted(right, level + 1, &mut other, progress),
    );
    let right = part.append(other);
    part.inner(left, right)
}

/// [`build_into`] that reports a subtree which one thread builds.
fn build_counted(items: &mut [Item], level: u32, part: &mut Part, progress: &Progress) -> u32 {
    let root = build_into(items, level, part, progress);
    if items.len() < PARALLEL_FROM {
        progress.add(items.len());
    }
    root
}

/// Parts the items in place and says where the right side begins; or their box, where they are to stay
/// together.
fn split(items: &mut [Item], level: u32) -> Result<usize, Aabb> {
    let extent = Extent::of(items);
    if items.len() == 1 {
        return Err(extent.bounds);
    }
    let weighed = if level < WEIGHED_LEVELS { best_object_split(items, &extent) } else { None };
    if items.len() <= LEAF_LIMIT as usize {
        let area = extent.bounds.half_area();
        let together = area * TRIANGLE_COST * items.len() as f64;
        let apart = weighed.map(|split| area * BOX_COST + split.cost * TRIANGLE_COST);
        if apart.is_none_or(|apart| together <= apart) {
            return Err(extent.bounds);
        }
    }
    Ok(match weighed {
        Some(split) => partition(items, |item| split.goes_left(item)),
        None => items.len() / 2,
    })
}

/// Brings the items that go left to the front and says how many they are.
fn partition(items: &mut [Item], goes_left: impl Fn(&Item) -> bool) -> usize {
    let (mut first, mut end) = (0, items.len());
    while first < end {
        if goes_left(&items[first]) {
            first += 1;
        } else {
            end -= 1;
            items.swap(first, end);
        }
    }
    first
}
