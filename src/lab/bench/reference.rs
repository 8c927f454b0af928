//! What a view's pixels must count, from a row of its own that is not timed.

use super::rows::Spec;
use super::schedule::{elements_in, share_that_fits, spans};
use super::target::plan_of;
use super::{Bench, Case, Watch};
use crate::bvh::Builder;
use crate::error::Result;
use crate::layout::Count;
use crate::render::choices::{Method, Passes, Preset};
use crate::render::repeat::Repeated;
use crate::render::stage::Stage;
use crate::render::tally::Totals;

/// Counts after one frame.
pub struct Reference {
    /// By pixel number; `None` where it did not run.
    counts: Vec<Option<Count>>,
    /// Rays of the whole picture, if all of it ran.
    pub whole: Option<Totals>,
}

/// Up to this many triangles the reference tests all of them.
const FEW_TRIANGLES: usize = 64;

/// The choices of the row that others are compared with: with a tree that some of them read, if it is a good one.
pub fn reference_spec(case: &Case<'_>) -> Spec {
    let few = case.subject.scene.mesh.triangles.len() <= FEW_TRIANGLES;
    let method = if few { Method::Brute } else { Method::Threaded };
    let read = |builder: &Builder| case.rows.iter().any(|(row, ..)| row.builder == *builder);
    let builder = [Builder::Sah, Builder::Reinsert].into_iter().find(read).unwrap_or(Builder::Sah);
    Spec::new(Preset::Auto, method, Some(builder), Passes::Single, builder)
}

impl Reference {
    pub fn new(bench: &Bench<'_>, case: &Case<'_>, watch: &mut dyn Watch) -> Result<Self> {
        let scene = &case.subject.scene;
        let spec = reference_spec(case);
        let built;
        let geometry = match case.rows.iter().find(|(row, ..)| row.shares_geometry(&spec)) {
            Some((_, geometry, _)) => *geometry,
            None => {
                built = watch.build(scene, &spec.wishes())?;
                &built
            }
        };
        let plan = plan_of(bench, case, &spec, geometry)?;
        let stage = Stage::new(bench.device, &plan)?;
        let elements = plan.tiles.padded_pixels() as u32;
        let share = share_of(bench, &stage, elements)?;
        let spans = spans(elements, share, bench.width());
        let mut frames = Repeated::over(&stage, &spans)?;
        let totals = frames.frame()?.totals;
        let mut counts = vec![None; elements as usize];
        for (pixel, count) in pixels(&spans).zip(frames.counts()?) {
            counts[pixel] = Some(count);
        }
        Ok(Self { counts, whole: (elements_in(&spans) == u64::from(elements)).then_some(totals) })
    }

    /// How many pixels of these spans have other counts; `None` if the two have no pixel in common.
    pub fn mismatches(&self, spans: &[(u32, u32)], counts: &[Count]) -> Option<u64> {
        let pairs = pixels(spans).zip(counts).filter_map(|(pixel, count)| {
            self.counts.get(pixel).copied().flatten().map(|expected| expected != *count)
        });
        let compared: Vec<bool> = pairs.collect();
        (!compared.is_empty()).then(|| compared.iter().filter(|differs| **differs).count() as u64)
    }
}

/// The share of the pixels that a row of this stage may take.
pub fn share_of(bench: &Bench<'_>, stage: &Stage<'_>, elements: u32) -> Result<f64> {
    let mut run = |spans: &[(u32, u32)]| Ok(Repeated::over(stage, spans)?.frame()?.gpu_ms());
    share_that_fits(elements, &bench.options.effort, bench.width(), &mut run)
}

fn pixels(spans: &[(u32, u32)]) -> impl Iterator<Item = usize> {
    spans.iter().flat_map(|&(begin, end)| begin as usize..end as usize)
}
