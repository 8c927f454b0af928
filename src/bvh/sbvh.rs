//! Top-down by the surface area heuristic with spatial splits (Stich, Friedrich and Dietrich, 2009): where
//! the boxes of the best object split overlap, planes that cut triangles are weighed against it.
//!
//! A triangle may stand in several leaves, each of whose boxes holds a part of it; [`super::clip`] tells why
//! no hit is lost for that. Duplicates are bounded: the budget of a node goes to its children by the area of the boxes
//! in them, so that it does not depend on which is built first.

use rayon::prelude::*;

use super::bins::{Boxed, Extent, ObjectSplit, best_object_split};
use super::clip::slack;
use super::part::Part;
use super::progress::Progress;
use super::spatial::{Reference, SpatialSplit, best_spatial_split};
use super::{Aabb, BOX_COST, PARALLEL_FROM, TRIANGLE_COST, Tree, WEIGHED_LEVELS};
use crate::layout::{LEAF_LIMIT, Triangle};

/// Spatial splits are weighed where the overlap of an object split exceeds this part of the root's surface.
const ALPHA: f64 = 1e-5;

/// One more reference for this many triangles, at most.
const TRIANGLES_PER_DUPLICATE: usize = 2;

/// Where no spatial split won on this many levels in a row, none is weighed below: most of the time of a
/// build goes into clipping.
const MOST_MISSES: u32 = 4;

/// Most references that packed records can number.
const MOST_REFERENCES: usize = (i32::MAX as u32 / LEAF_LIMIT) as usize;

/// Builds the tree of at least one triangle.
pub(super) fn build(triangles: &[Triangle], progress: &Progress) -> Tree {
    let all = triangles.par_iter().map(Aabb::of).reduce(|| Aabb::EMPTY, |a, b| a.union(&b));
    let largest = all.min.abs().max(all.max.abs()).max_element();
    let reference = |(place, triangle): (usize, &Triangle)| {
        let bounds = Aabb::of(triangle);
        Reference { bounds, cell: bounds, triangle: place as u32, slack: slack(triangle, largest) }
    };
    let references: Vec<Reference> = triangles.par_iter().enumerate().map(reference).collect();
    let room = MOST_REFERENCES.saturating_sub(references.len());
    let budget = (references.len() / TRIANGLES_PER_DUPLICATE).min(room);
    let mut part = Part::default();
    if !references.is_empty() {
        let construction = Construction { triangles, root_area: all.half_area(), progress };
        construction.build_into(references, Allowance { budget, misses: 0, level: 0 }, &mut part);
    }
    part.tree()
}

/// What a subtree may do.
#[derive(Clone, Copy)]
struct Allowance {
    /// References more than it is given.
    budget: usize,
    /// Levels in a row on which no spatial split won.
    misses: u32,
    level: u32,
}

struct Construction<'a> {
    triangles: &'a [Triangle],
    root_area: f64,
    progress: &'a Progress<'a>,
}

/// What becomes of some references.
enum Choice {
    Leaf(Aabb),
    Object(ObjectSplit),
    Spatial(SpatialSplit),
    Halves,
}

impl Construction<'_> {
    /// Adds the subtree of at least one reference and returns its root's place.
    fn build_into(&self, references: Vec<Reference>, allowance: Allowance, part: &mut Part) -> u32 {
        let count = references.len();
        let choice = self.choose(&references, &allowance);
        let misses = if matches!(choice, Choice::Spatial(_)) { 0 } else { allowance.misses + 1 };
        let [left, right] = match choice {
            Choice::Leaf(bounds) => {
                return part.leaf(bounds, references.iter().map(|reference| reference.triangle));
            }
            Choice::Object(split) => {
                let (left, right) = references.into_iter().partition(|reference| split.goes_left(reference));
                [left, right]
            }
            Choice::Spatial(split) => split.part(references, self.triangles),
            Choice::Halves => halves(references),
        };
        // Unsplitting may have brought all to one side.
        let [left, right] = if left.is_empty() || right.is_empty() {
            halves(if left.is_empty() { right } else { left })
        } else {
            [left, right]
        };
        let spent = (left.len() + right.len()).saturating_sub(count);
        let budgets = shares(allowance.budget.saturating_sub(spent), &left, &right);
        let [for_left, for_right] =
            budgets.map(|budget| Allowance { budget, misses, level: allowance.level + 1 });
        if count < PARALLEL_FROM {
            let left = self.build_into(left, for_left, part);
            let right = self.build_into(right, for_right, part);
            return part.inner(left, right);
        }
        let mut other = Part::default();
        let (left, _) = rayon::join(
            || self.build_counted(left, for_left, part),
            || self.build_counted(right, for_right, &mut other),
        );
        let right = part.append(other);
        part.inner(left, right)
    }

    /// [`Self::build_into`] that reports a subtree which one thread builds.
    fn build_counted(&self, references: Vec<Reference>, allowance: Allowance, part: &mut Part) -> u32 {
        let count = references.len();
        let root = self.build_into(references, allowance, part);
        if count < PARALLEL_FROM {
            self.progress.add(count);
        }
        root
    }

    fn choose(&self, references: &[Reference], allowance: &Allowance) -> Choice {
        let extent = Extent::of(references);
        if references.len() == 1 {
            return Choice::Leaf(extent.bounds);
        }
        let few = references.len() <= LEAF_LIMIT as usize;
        if allowance.level >= WEIGHED_LEVELS {
            return if few { Choice::Leaf(extent.bounds) } else { Choice::Halves };
        }
        let object = best_object_split(references, &extent);
        let allowed = allowance.budget > 0 && allowance.misses < MOST_MISSES;
        let spatial = if allowed && self.overlaps(object.as_ref(), &extent.bounds) {
            best_spatial_split(references, &extent.bounds, self.triangles, allowance.budget)
        } else {
            None
        };
        let object_cost = object.map_or(f64::INFINITY, |split| split.cost);
        let spatial = spatial.filter(|split| split.cost < object_cost);
        let cost = spatial.map_or(object_cost, |split| split.cost);
        let area = extent.bounds.half_area();
        let together = area * TRIANGLE_COST * references.len() as f64;
        let apart = area * BOX_COST + cost * TRIANGLE_COST;
        // Not so where boxes are not finite and a cost is NaN.
        let worth_it = apart < together;
        if few && !worth_it {
            return Choice::Leaf(extent.bounds);
        }
        match (spatial, object) {
            (Some(split), _) => Choice::Spatial(split),
            (None, Some(split)) => Choice::Object(split),
            (None, None) => Choice::Halves,
        }
    }

    /// Whether the sides of an object split overlap by more than a face. Not so where there is no split: boxes
    /// around one centre are seldom parted by a plane, and a million of them take long to clip.
    fn overlaps(&self, object: Option<&ObjectSplit>, bounds: &Aabb) -> bool {
        let Some(split) = object else { return false };
        let overlap = split.left.intersection(&split.right);
        let thick = overlap.max.cmpgt(overlap.min) | bounds.max.cmple(bounds.min);
        thick.all() && overlap.half_area() > ALPHA * self.root_area
    }
}

fn halves(mut left: Vec<Reference>) -> [Vec<Reference>; 2] {
    let right = left.split_off(left.len() / 2);
    [left, right]
}

/// Divides a budget by the area of the boxes on either side.
fn shares(budget: usize, left: &[Reference], right: &[Reference]) -> [usize; 2] {
    if budget == 0 {
        return [0, 0];
    }
    let area = |side: &[Reference]| side.iter().map(|one| one.bounds().half_area()).sum::<f64>();
    let (left, right) = (area(left), area(right));
    let share = if left + right > 0.0 { left / (left + right) } else { 0.5 };
    let left = ((budget as f64 * share) as usize).min(budget);
    [left, budget - left]
}
