//! Bottom-up by parallel locally ordered clustering (Meister and Bittner, 2018) by the crate `obvhs`, then improved by
//! reinsertion as in [`super::reinsert`].

use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

use super::Tree;
use super::progress::Progress;
use super::reinsert::{Emission, Rounds, clusters_of};
use super::sah;
use crate::layout::Triangle;

const ROUNDS: Rounds = Rounds { most: 8, first: 0.1, least_gain: f64::NEG_INFINITY };

/// Builds the tree of at least one triangle.
pub(super) fn build(triangles: &[Triangle], progress: &Progress) -> Tree {
    let mut items = sah::items_of(triangles);
    let Some(clusters) = clusters_of(&items) else {
        return sah::build(triangles, progress);
    };
    let places = (0..items.len() as u32).collect();
    let mut bvh = PlocBuilder::with_capacity(items.len()).build(
        PlocSearchDistance::Medium,
        &clusters,
        places,
        SortPrecision::U64,
        1,
    );
    drop(clusters);
    progress.reach(0.3);
    ROUNDS.run(&mut bvh, progress);
    Emission { bvh: &bvh, items: &mut items }.tree()
}
