//! Spatial splits (Stich, Friedrich and Dietrich, "Spatial splits in bounding volume hierarchies", 2009): a
//! plane parts the boxes, and a triangle that straddles it goes to both sides, each with its part.

use rayon::prelude::*;

use super::Aabb;
use super::bins::Boxed;
use super::clip::part_bounds;
use crate::layout::Triangle;

/// The part of a triangle that lies in a cell.
#[derive(Clone, Copy)]
pub struct Reference {
    /// The part's box, grown by the slack; the triangle's own box before any split.
    pub bounds: Aabb,
    pub cell: Aabb,
    pub triangle: u32,
    /// 0 for a triangle that is not to be split.
    pub slack: f32,
}

impl Boxed for Reference {
    fn bounds(&self) -> &Aabb {
        &self.bounds
    }
}

impl Reference {
    /// The parts on both sides of a plane; none if one of them is empty.
    fn cut(&self, axis: usize, at: f32, triangles: &[Triangle]) -> Option<[Self; 2]> {
        let (mut low, mut high) = (*self, *self);
        low.cell.max[axis] = at;
        high.cell.min[axis] = at;
        let triangle = &triangles[self.triangle as usize];
        for part in [&mut low, &mut high] {
            part.bounds = part_bounds(triangle, self.slack, &part.cell)?;
        }
        Some([low, high])
    }
}

const BINS: usize = 16;

/// From this many references on bins are filled in parallel, in pieces of this many.
const PIECE: usize = 1 << 13;

/// Planes at equal distances along an axis.
#[derive(Clone, Copy)]
struct Planes {
    axis: usize,
    low: f32,
    size: f32,
}

impl Planes {
    /// Plane between bins `place - 1` and `place`.
    fn at(&self, place: usize) -> f32 {
        self.low + self.size * (place as f32 / BINS as f32)
    }

    fn bin(&self, x: f32) -> usize {
        // A NaN falls into bin 0.
        (((x - self.low) / self.size * BINS as f32) as usize).min(BINS - 1)
    }

    /// First and last bin of a reference: it may be cut at every plane between them. One that is not worth a
    /// cut belongs to the bin of its centre.
    fn span(&self, reference: &Reference) -> (usize, usize) {
        let (low, high) = (reference.cell.min[self.axis], reference.cell.max[self.axis]);
        if reference.slack == 0.0 || high - low <= 8.0 * reference.slack {
            let bin = self.bin(reference.bounds.center()[self.axis]);
            return (bin, bin);
        }
        let (mut first, mut last) = (self.bin(low), self.bin(high));
        while last > first && self.at(last) >= high {
            last -= 1;
        }
        while last > first && self.at(first + 1) <= low {
            first += 1;
        }
        (first, last)
    }
}

#[derive(Clone, Copy)]
struct Bin {
    bounds: Aabb,
    /// References that begin and end here.
    begin: u32,
    end: u32,
}

impl Bin {
    const EMPTY: Self = Self { bounds: Aabb::EMPTY, begin: 0, end: 0 };

    fn join(&mut self, other: &Self) {
        self.bounds = self.bounds.union(&other.bounds);
        self.begin += other.begin;
        self.end += other.end;
    }
}

type Bins = [[Bin; BINS]; 3];

fn planes_of(bounds: &Aabb) -> [Planes; 3] {
    let size = bounds.max - bounds.min;
    [0, 1, 2].map(|axis| Planes { axis, low: bounds.min[axis], size: size[axis] })
}

fn fill(references: &[Reference], planes: &[Planes; 3], triangles: &[Triangle]) -> Bins {
    let mut all = [[Bin::EMPTY; BINS]; 3];
    for reference in references {
        for (planes, bins) in planes.iter().zip(&mut all) {
            let (first, last) = planes.span(reference);
            if first == last {
                bins[first].join(&Bin { bounds: reference.bounds, begin: 1, end: 1 });
                continue;
            }
            let mut held = None;
            for (bin, filled) in bins.iter_mut().enumerate().take(last + 1).skip(first) {
                let mut cell = reference.cell;
                if bin > first {
                    cell.min[planes.axis] = planes.at(bin);
                }
                if bin < last {
                    cell.max[planes.axis] = planes.at(bin + 1);
                }
                let triangle = &triangles[reference.triangle as usize];
                if let Some(bounds) = part_bounds(triangle, reference.slack, &cell) {
                    filled.bounds = filled.bounds.union(&bounds);
                    held = Some((held.map_or(bin, |(begin, _)| begin), bin));
                }
            }
            let (begin, end) = held.unwrap_or((first, first));
            bins[begin].begin += 1;
            bins[end].end += 1;
        }
    }
    all
}

fn fill_in_parallel(references: &[Reference], planes: &[Planes; 3], triangles: &[Triangle]) -> Bins {
    let join = |mut a: Bins, b: Bins| {
        for (a, b) in a.iter_mut().flatten().zip(b.iter().flatten()) {
            a.join(b);
        }
        a
    };
    let empty = || [[Bin::EMPTY; BINS]; 3];
    references.par_chunks(PIECE).map(|piece| fill(piece, planes, triangles)).reduce(empty, join)
}

/// References on one side, and their box.
#[derive(Clone, Copy)]
struct Side {
    bounds: Aabb,
    count: u32,
}

impl Side {
    const EMPTY: Self = Self { bounds: Aabb::EMPTY, count: 0 };

    fn cost(&self) -> f64 {
        self.bounds.half_area() * f64::from(self.count)
    }
}

/// The cheapest plane found.
#[derive(Clone, Copy)]
pub struct SpatialSplit {
    planes: Planes,
    /// First bin of the right side.
    first_right: usize,
    left: Side,
    right: Side,
    /// Half area times number of references, summed over both sides.
    pub cost: f64,
}

/// The cheapest plane that leaves fewer references on either side and makes at most `budget` more.
// Its bins would fill the stack of a recursion that it is inlined into.
#[inline(never)]
pub fn best_spatial_split(
    references: &[Reference],
    bounds: &Aabb,
    triangles: &[Triangle],
    budget: usize,
) -> Option<SpatialSplit> {
    let all_planes = planes_of(bounds);
    let all = if references.len() < 2 * PIECE {
        fill(references, &all_planes, triangles)
    } else {
        fill_in_parallel(references, &all_planes, triangles)
    };
    let count = references.len();
    let mut best: Option<SpatialSplit> = None;
    for (planes, bins) in all_planes.iter().zip(&all) {
        let mut rights = [Side::EMPTY; BINS];
        let mut right = Side::EMPTY;
        for place in (1..BINS).rev() {
            right.bounds = right.bounds.union(&bins[place].bounds);
            right.count += bins[place].end;
            rights[place] = right;
        }
        let mut left = Side::EMPTY;
        for first_right in 1..BINS {
            left.bounds = left.bounds.union(&bins[first_right - 1].bounds);
            left.count += bins[first_right - 1].begin;
            let right = rights[first_right];
            let (lefts, rights) = (left.count as usize, right.count as usize);
            let parts = (1..count).contains(&lefts) && (1..count).contains(&rights);
            if !parts || lefts + rights > count + budget {
                continue;
            }
            let cost = left.cost() + right.cost();
            if best.is_none_or(|best| cost < best.cost) {
                best = Some(SpatialSplit { planes: *planes, first_right, left, right, cost });
            }
        }
    }
    best
}

impl SpatialSplit {
    /// Parts the references. One that straddles the plane is not cut where it is cheaper to leave it whole
    /// on one side ("reference unsplitting").
    pub fn part(&self, references: Vec<Reference>, triangles: &[Triangle]) -> [Vec<Reference>; 2] {
        let at = self.planes.at(self.first_right);
        let (mut left, mut right) = (self.left, self.right);
        let mut lefts = Vec::with_capacity(self.left.count as usize);
        let mut rights = Vec::with_capacity(self.right.count as usize);
        for reference in references {
            let (first, last) = self.planes.span(&reference);
            if last < self.first_right {
                lefts.push(reference);
                continue;
            }
            if first >= self.first_right {
                rights.push(reference);
                continue;
            }
            let whole_left = Side { bounds: left.bounds.union(&reference.bounds), count: left.count };
            let whole_right = Side { bounds: right.bounds.union(&reference.bounds), count: right.count };
            let fewer = |side: Side| Side { count: side.count.saturating_sub(1), ..side };
            let cut = left.cost() + right.cost();
            let only_left = whole_left.cost() + fewer(right).cost();
            let only_right = fewer(left).cost() + whole_right.cost();
            let parts = if cut < only_left.min(only_right) {
                reference.cut(self.planes.axis, at, triangles)
            } else {
                None
            };
            if let Some([low, high]) = parts {
                lefts.push(low);
                rights.push(high);
            } else if only_left <= only_right {
                (left, right) = (whole_left, fewer(right));
                lefts.push(reference);
            } else {
                (left, right) = (fewer(left), whole_right);
                rights.push(reference);
            }
        }
        [lefts, rights]
    }
}
