//! The tree that ambient rays cost least in, where nobody named a builder.

use std::ops::RangeInclusive;
use std::time::Instant;

use super::progress::Progress;
use super::walk_cost::{AmbientRays, POINTS, WalkCost};
use super::{Builder, Tree, in_pool, reinsert, sah};
use crate::layout::Triangle;

/// A builder, or the rule that finds one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    Builder(Builder),
    /// `sah` or `reinsert`, whichever ambient rays cost less in.
    Cheaper,
}

impl From<Builder> for Wanted {
    fn from(builder: Builder) -> Self {
        Self::Builder(builder)
    }
}

/// What ambient rays cost in either tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costs {
    pub sah: WalkCost,
    pub reinsert: WalkCost,
}

impl Costs {
    /// The cheaper one's builder.
    pub fn builder(&self) -> Builder {
        if self.reinsert.total() < WORTH * self.sah.total() { Builder::Reinsert } else { Builder::Sah }
    }
}

/// How both trees were tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weighed {
    /// None where no tree worth counting was found: reinsertion gained too little, or there are no rays.
    pub costs: Option<Costs>,
    /// Time that it took beyond building the tree that was taken, ms.
    pub beside_ms: f64,
}

/// A tree and how it was chosen.
pub struct Built {
    pub tree: Tree,
    pub builder: Builder,
    /// None where there was nothing to choose.
    pub weighed: Option<Weighed>,
}

/// Triangles for which both trees are tried: fewer leave reinsertion little to do, and with more it takes seconds.
const TRIED: RangeInclusive<usize> = 256..=1_000_000;

/// Part of the other tree's cost below which reinsertion is taken: counted costs are not times.
const WORTH: f64 = 0.95;

/// Part of the cost by the surface area heuristic that reinsertion must gain, or nothing is counted: a tree that hardly changed does not
/// cost rays so much less.
const GAINS: f64 = 0.01;

/// Builds the tree of at least one triangle as [`super::build`] does.
pub fn build_wanted(wanted: Wanted, triangles: &[Triangle], progress: &(dyn Fn(f64) + Sync)) -> Built {
    let builder = match wanted {
        Wanted::Cheaper if TRIED.contains(&triangles.len()) => {
            return in_pool(triangles, progress, |counter| cheaper(triangles, counter));
        }
        Wanted::Cheaper => Builder::Sah,
        Wanted::Builder(builder) => builder,
    };
    Built { tree: super::build(builder, triangles, progress), builder, weighed: None }
}

fn cheaper(triangles: &[Triangle], progress: &Progress) -> Built {
    let first = |part| progress.reach(0.3 * part);
    let tree = sah::build(triangles, &Progress::new(triangles.len(), &first));
    let begin = Instant::now();
    let other = reinsert::improved(&tree, triangles, GAINS, progress);
    let counting = Instant::now();
    let costs = other.as_ref().and_then(|other| {
        let rays = AmbientRays::new(triangles, POINTS)?;
        Some(Costs { sah: rays.cost(&tree)?, reinsert: rays.cost(other)? })
    });
    let ms_since = |instant: Instant| instant.elapsed().as_secs_f64() * 1e3;
    let (tree, builder, beside_ms) = match (other, costs.map(|costs| costs.builder())) {
        (Some(other), Some(Builder::Reinsert)) => (other, Builder::Reinsert, ms_since(counting)),
        _ => (tree, Builder::Sah, ms_since(begin)),
    };
    Built { tree, builder, weighed: Some(Weighed { costs, beside_ms }) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::testing::{procedural, soup};

    fn wanted(wanted: Wanted, triangles: &[Triangle]) -> Built {
        build_wanted(wanted, triangles, &|_| ())
    }

    /// The surface area heuristic finds reinsertion better on both; rays on one.
    #[test]
    fn a_house_keeps_its_tree_and_an_arcade_takes_another() {
        for (name, count, expected) in
            [("maison", None, Builder::Sah), ("arcade", Some(60_000), Builder::Reinsert)]
        {
            let triangles = procedural(name, count);
            let built = [1, 3].map(|threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| wanted(Wanted::Cheaper, &triangles))
            });
            let [weighed, other] = built.each_ref().map(|built| built.weighed.unwrap().costs.unwrap());
            println!("{name}: {weighed:?}");
            assert_eq!(built[0].builder, expected, "{name}: {weighed:?}");
            assert_eq!(weighed, other, "{name}");
            let named = wanted(expected.into(), &triangles);
            assert_eq!((named.builder, named.weighed), (expected, None));
            assert!(
                built.iter().all(|built| built.tree == named.tree),
                "{name}: the tree of the builder's name"
            );
        }
    }

    #[test]
    fn few_triangles_and_hopeless_ones_are_not_counted() {
        let few = soup(80, *TRIED.start() - 1, 0.3);
        let terrain = procedural("terrain", Some(20_000));
        let without_area = vec![Triangle::default(); 1000];
        for (what, triangles, weighed) in
            [("few", few, None), ("terrain", terrain, Some(None)), ("no area", without_area, Some(None))]
        {
            let built = wanted(Wanted::Cheaper, &triangles);
            assert_eq!(built.builder, Builder::Sah, "{what}");
            assert_eq!(built.weighed.map(|weighed| weighed.costs), weighed, "{what}");
            assert!(built.tree == super::super::build(Builder::Sah, &triangles, &|_| ()), "{what}");
        }
    }
}
