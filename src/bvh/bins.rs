//! The surface area heuristic over bins of box centres (Wald, "On fast construction of SAH-based bounding
//! volume hierarchies", 2007), all three axes at once.

use glam::Vec3;
use rayon::prelude::*;

use super::Aabb;

/// What is sorted into bins.
pub trait Boxed: Sync {
    fn bounds(&self) -> &Aabb;
}

/// Most bins along an axis, of few items and of [`MANY`].
const FEW_BINS: usize = 32;
const MANY_BINS: usize = 256;

/// From this many items on, many bins cost little beside the items themselves.
const MANY: usize = 4096;

/// From this many items on bins are filled in parallel, in pieces of this many.
const PIECE: usize = 1 << 15;

/// The box of some items and the box of their boxes' centres.
#[derive(Clone, Copy)]
pub struct Extent {
    pub bounds: Aabb,
    pub centers: Aabb,
}

impl Extent {
    const EMPTY: Self = Self { bounds: Aabb::EMPTY, centers: Aabb::EMPTY };

    pub fn of<T: Boxed>(items: &[T]) -> Self {
        let of_piece = |items: &[T]| items.iter().fold(Self::EMPTY, |all, item| all.with(item.bounds()));
        if items.len() < 2 * PIECE {
            return of_piece(items);
        }
        items.par_chunks(PIECE).map(of_piece).reduce(
            || Self::EMPTY,
            |a, b| Self { bounds: a.bounds.union(&b.bounds), centers: a.centers.union(&b.centers) },
        )
    }

    fn with(&self, bounds: &Aabb) -> Self {
        let center = bounds.center();
        let centers = Aabb { min: self.centers.min.min(center), max: self.centers.max.max(center) };
        Self { bounds: self.bounds.union(bounds), centers }
    }
}

/// Which bin a box belongs to along each axis.
#[derive(Clone, Copy)]
struct Binning {
    low: Vec3,
    scale: Vec3,
    bins: usize,
}

impl Binning {
    fn of(centers: &Aabb, items: usize, most: usize) -> Self {
        // Few items fill few bins, and a sweep over empty ones costs more than it finds.
        let bins = (4 + items / 2).min(most);
        let size = centers.max - centers.min;
        Self { low: centers.min, scale: Vec3::splat(bins as f32) / size, bins }
    }

    /// A NaN, from centres that coincide or overflow, falls into bin 0.
    fn bin(&self, bounds: &Aabb, axis: usize) -> usize {
        let place = (bounds.center()[axis] - self.low[axis]) * self.scale[axis];
        (place as usize).min(self.bins - 1)
    }
}

#[derive(Clone, Copy)]
struct Bin {
    bounds: Aabb,
    count: u32,
}

impl Bin {
    const EMPTY: Self = Self { bounds: Aabb::EMPTY, count: 0 };

    fn join(&mut self, other: &Self) {
        self.bounds = self.bounds.union(&other.bounds);
        self.count += other.count;
    }
}

type Bins<const N: usize> = [[Bin; N]; 3];

fn fill<const N: usize, T: Boxed>(items: &[T], binning: &Binning) -> Bins<N> {
    let mut bins = [[Bin::EMPTY; N]; 3];
    for item in items {
        let one = Bin { bounds: *item.bounds(), count: 1 };
        for (axis, bins) in bins.iter_mut().enumerate() {
            bins[binning.bin(&one.bounds, axis)].join(&one);
        }
    }
    bins
}

fn fill_in_parallel<const N: usize, T: Boxed>(items: &[T], binning: &Binning) -> Bins<N> {
    let join = |mut a: Bins<N>, b: Bins<N>| {
        for (a, b) in a.iter_mut().flatten().zip(b.iter().flatten()) {
            a.join(b);
        }
        a
    };
    let empty = || [[Bin::EMPTY; N]; 3];
    items.par_chunks(PIECE).map(|piece| fill(piece, binning)).reduce(empty, join)
}

/// The cheapest way found to part items by their centres.
#[derive(Clone, Copy)]
pub struct ObjectSplit {
    binning: Binning,
    axis: usize,
    /// First bin of the right side.
    first_right: usize,
    /// Items of the larger side: it decides between equal costs, such as those of boxes without a surface.
    larger: u32,
    /// Half area times number of items, summed over both sides.
    pub cost: f64,
    pub left: Aabb,
    pub right: Aabb,
}

impl ObjectSplit {
    pub fn goes_left<T: Boxed>(&self, item: &T) -> bool {
        self.binning.bin(item.bounds(), self.axis) < self.first_right
    }
}

/// The cheapest split between bins; none where all centres coincide.
// Its bins would fill the stack of a recursion that it is inlined into.
#[inline(never)]
pub fn best_object_split<T: Boxed>(items: &[T], extent: &Extent) -> Option<ObjectSplit> {
    if items.len() < MANY {
        let binning = Binning::of(&extent.centers, items.len(), FEW_BINS);
        return cheapest::<FEW_BINS>(&fill(items, &binning), binning);
    }
    let binning = Binning::of(&extent.centers, items.len(), MANY_BINS);
    let bins =
        if items.len() < 2 * PIECE { fill(items, &binning) } else { fill_in_parallel(items, &binning) };
    cheapest::<MANY_BINS>(&bins, binning)
}

fn cheapest<const N: usize>(all: &Bins<N>, binning: Binning) -> Option<ObjectSplit> {
    let mut best: Option<ObjectSplit> = None;
    for (axis, bins) in all.iter().enumerate() {
        let mut rights = [Bin::EMPTY; N];
        let mut right = Bin::EMPTY;
        for place in (1..binning.bins).rev() {
            right.join(&bins[place]);
            rights[place] = right;
        }
        let mut left = Bin::EMPTY;
        for first_right in 1..binning.bins {
            left.join(&bins[first_right - 1]);
            let right = &rights[first_right];
            if bins[first_right - 1].count == 0 || right.count == 0 {
                continue;
            }
            let cost = left.bounds.half_area() * f64::from(left.count)
                + right.bounds.half_area() * f64::from(right.count);
            let larger = left.count.max(right.count);
            let better = |best: ObjectSplit| cost < best.cost || (cost == best.cost && larger < best.larger);
            if best.is_none_or(better) {
                let (left, right) = (left.bounds, right.bounds);
                best = Some(ObjectSplit { binning, axis, first_right, larger, cost, left, right });
            }
        }
    }
    best
}
