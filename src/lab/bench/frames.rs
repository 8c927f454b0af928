//! Whole frames of a picture: camera rays and ambient rays.

use std::cell::{Cell, RefCell};

use super::reference::{Reference, share_of};
use super::rows::{Row, Spec};
use super::schedule::{Repeat, elements_in, interleave, shuffled, spans};
use super::target::{blank_row, bvh_bytes, groups, plan_of, plan_sized, row_bytes, set_times};
use super::{Bench, Case, Watch, has_reference, left_out};
use crate::error::{Error, Result};
use crate::lab::statistics::Median;
use crate::render::choices::Passes;
use crate::render::plan::Plan;
use crate::render::repeat::Repeated;
use crate::render::stage::{Stage, Uploads, traversal_statistics};
use crate::render::tally::Totals;
use crate::render::work::{RayWork, count_work};

/// Frames of the runs beside the timed one.
const ASIDE_FRAMES: usize = 5;
/// No more of them after this long, ms.
const ASIDE_MS: f64 = 1500.0;

/// A row that can be set up.
struct Planned<'a> {
    spec: &'a Spec,
    order: usize,
    plan: Plan<'a>,
}

/// A row on the device.
struct Ready<'a> {
    planned: &'a Planned<'a>,
    stage: Stage<'a>,
}

/// A row that runs.
struct Running<'a> {
    ready: &'a Ready<'a>,
    spans: Vec<(u32, u32)>,
    frames: Repeated<'a>,
    first: Totals,
    mismatched: Option<u64>,
    latest: Totals,
}

impl Repeat for Running<'_> {
    fn frame_ms(&mut self) -> Result<f64> {
        let cost = self.frames.frame()?;
        self.latest = cost.totals;
        Ok(cost.gpu_ms())
    }
}

/// Of camera rays and of ambient rays.
type Costs = [RayWork; 2];

/// What the rows of a view share while they run.
struct View<'a> {
    bench: &'a Bench<'a>,
    case: &'a Case<'a>,
    reference: Option<Reference>,
    uploads: RefCell<Uploads>,
    /// Traversal times by method and builder; `None` where they could not be had.
    traversals: RefCell<Vec<(Spec, Option<f64>)>>,
    /// What rays cost, likewise.
    works: RefCell<Vec<(Spec, Option<Costs>)>>,
    all: usize,
    done: Cell<usize>,
}

/// Measures the rows of a view, as many at once as the device's memory holds.
pub fn measure(bench: &Bench<'_>, case: &Case<'_>, watch: &mut dyn Watch) -> Result<()> {
    let mut planned = Vec::new();
    for place in shuffled(case.rows.len(), bench.options.seed, u32::MAX) {
        let (spec, geometry, order) = case.rows[place];
        match plan_of(bench, case, spec, geometry) {
            Ok(plan) => planned.push(Planned { spec, order, plan }),
            Err(error) => left_out(watch, case, spec, error)?,
        }
    }
    let mut reference = None;
    if planned.iter().any(|row| has_reference(row.spec)) {
        watch.progress("reference", 0, planned.len());
        match Reference::new(bench, case, watch) {
            Ok(found) => reference = Some(found),
            Err(error) => watch.note(&format!("There is no reference to compare counts with: {error}")),
        }
    }
    let view = View {
        bench,
        case,
        reference,
        uploads: RefCell::default(),
        traversals: RefCell::default(),
        works: RefCell::default(),
        all: planned.len(),
        done: Cell::new(0),
    };
    let most = bench.device.adapter().memory_bytes / 2;
    for group in groups(planned, most, |row| row_bytes(&row.plan)) {
        view.group(&group, watch)?;
        view.uploads.borrow_mut().forget_unused();
    }
    Ok(())
}

impl View<'_> {
    /// Rows that are in the device's memory at once, their frames in turn.
    fn group(&self, group: &[Planned<'_>], watch: &mut dyn Watch) -> Result<()> {
        let mut ready = Vec::new();
        for planned in group {
            match self.stage(&planned.plan) {
                Ok(stage) => ready.push(Ready { planned, stage }),
                Err(error) => self.fail(planned.spec, error, watch)?,
            }
        }
        self.bench.drift.wake()?;
        let mut running = Vec::new();
        for ready in &ready {
            let spec = ready.planned.spec;
            watch.progress(&format!("{} warms up", spec.label()), self.done.get(), self.all);
            match self.warm_up(ready) {
                Ok(row) => running.push(row),
                Err(error) => self.fail(spec, error, watch)?,
            }
        }
        let Bench { options, drift, .. } = self.bench;
        interleave(running, &options.effort, options.seed, &mut || drift.measure(), &mut |mut row, times| {
            let spec = row.ready.planned.spec;
            match times.and_then(|times| self.finish(&mut row, &times)) {
                Ok(row) => {
                    self.through(spec, watch);
                    watch.row(row)?;
                    drift.wake()
                }
                Err(error) => self.fail(spec, error, watch),
            }
        })
    }

    fn fail(&self, spec: &Spec, error: Error, watch: &mut dyn Watch) -> Result<()> {
        self.through(spec, watch);
        left_out(watch, self.case, spec, error)
    }

    fn through(&self, spec: &Spec, watch: &mut dyn Watch) {
        self.done.set(self.done.get() + 1);
        watch.progress(&spec.label(), self.done.get(), self.all);
    }

    fn stage<'p>(&'p self, plan: &'p Plan<'p>) -> Result<Stage<'p>> {
        let uploaded = self.uploads.borrow_mut().of(self.bench.device, plan)?;
        Stage::with_uploaded(self.bench.device, plan, uploaded)
    }

    /// Finds out how much of the picture the row may take, and runs the frames that are thrown away; the first one's
    /// counts are compared.
    fn warm_up<'r>(&self, ready: &'r Ready<'r>) -> Result<Running<'r>> {
        let Ready { planned, stage } = ready;
        let effort = &self.bench.options.effort;
        let elements = planned.plan.tiles.padded_pixels() as u32;
        let spans = spans(elements, share_of(self.bench, stage, elements)?, self.bench.width());
        let mut frames = Repeated::over(stage, &spans)?;
        let first = frames.frame()?.totals;
        let mut mismatched = None;
        if let (Some(reference), true) = (&self.reference, has_reference(planned.spec)) {
            mismatched = reference.mismatches(&spans, &frames.counts()?);
        }
        for _ in 1..effort.warm_up {
            frames.frame()?;
        }
        Ok(Running { ready, spans, frames, first, mismatched, latest: first })
    }

    /// The share of all rays that frames with these totals traced.
    fn share(&self, row: &Running<'_>, totals: &Totals) -> f64 {
        let Planned { plan, spec, .. } = row.ready.planned;
        let (part, all) = (elements_in(&row.spans), plan.tiles.padded_pixels());
        let pixels = part as f64 / all as f64;
        match self.reference.as_ref().and_then(|reference| reference.whole).filter(|_| has_reference(spec)) {
            Some(whole) if part < all => {
                let camera = if totals.primary_finished > 0 { whole.primary_finished } else { 0 };
                let rays = rays_of(totals) as f64 / (camera + whole.ambient_finished).max(1) as f64;
                if rays > 0.0 { rays.min(1.0) } else { pixels }
            }
            _ => pixels,
        }
    }

    /// The row, with what runs beside the timed frames tell.
    fn finish(&self, row: &mut Running<'_>, times: &[f64]) -> Result<Row> {
        let Ready { planned, stage } = row.ready;
        let Planned { spec, order, plan } = planned;
        let mut told = blank_row(self.case, spec, plan, *order);
        set_times(&mut told, times, rays_of(&row.latest), self.share(row, &row.latest));
        told.overflowed_rays = row.first.overflowed;
        told.mismatched_pixels = row.mismatched;
        told.bvh_bytes = bvh_bytes(plan, stage.nodes.bytes());
        let first_share = self.share(row, &row.first);
        if spec.passes != Passes::Single {
            let frames = &mut row.frames;
            self.bench.drift.wake()?;
            let median = aside(&mut || {
                frames.forget_hits();
                Ok(frames.frame()?.gpu_ms())
            })?;
            told.first_frame_ms = median.map(|ms| ms / first_share);
        }
        told.traversal_ms = self.traversal_ms(spec, plan, &row.spans, first_share);
        [told.closest, told.any] =
            self.costs(spec, plan, elements_in(&row.spans)).map_or([None; 2], |costs| costs.map(Some));
        if let Some(statistics) = traversal_statistics(self.bench.device, plan)? {
            told.registers = statistics.registers;
            told.stack_bytes = statistics.stack_bytes;
        }
        Ok(told)
    }

    /// Time that the row's method spends on the hits of a whole frame, camera rays included, from these spans, which
    /// hold so much of its rays.
    fn traversal_ms(&self, spec: &Spec, plan: &Plan<'_>, spans: &[(u32, u32)], share: f64) -> Option<f64> {
        let staged = Spec { passes: Passes::Staged, ..*spec };
        let known = self.traversals.borrow().iter().find(|(known, _)| *known == staged).map(|(_, ms)| *ms);
        known.unwrap_or_else(|| {
            let ms = self.time_traversal(&staged, plan, spans).ok().flatten().map(|ms| ms / share);
            self.traversals.borrow_mut().push((staged, ms));
            ms
        })
    }

    /// What the row's rays cost, from a picture of so many pixels.
    fn costs(&self, spec: &Spec, plan: &Plan<'_>, pixels: u64) -> Option<Costs> {
        let single = Spec { passes: Passes::Single, ..*spec };
        let known = self.works.borrow().iter().find(|(known, _)| *known == single).map(|(_, costs)| *costs);
        known.unwrap_or_else(|| {
            // A method that cannot be counted is measured all the same.
            let costs = self.count(&single, plan, pixels).ok().flatten();
            self.works.borrow_mut().push((single, costs));
            costs
        })
    }

    fn count(&self, spec: &Spec, plan: &Plan<'_>, pixels: u64) -> Result<Option<Costs>> {
        let (width, height) = plan.job.size;
        let side = (pixels as f64 / plan.tiles.padded_pixels() as f64).sqrt();
        let smaller = |length: u32| ((f64::from(length) * side).round() as u32).max(1);
        let size = (smaller(width), smaller(height));
        let plan = plan_sized(self.bench, self.case, spec, plan.geometry, size)?;
        let count = count_work(self.bench.device, &plan)?;
        Ok(count.filter(|count| count.repeats == 0).map(|count| [count.closest, count.any]))
    }

    fn time_traversal(&self, spec: &Spec, plan: &Plan<'_>, spans: &[(u32, u32)]) -> Result<Option<f64>> {
        let plan = plan_of(self.bench, self.case, spec, plan.geometry)?;
        let stage = self.stage(&plan)?;
        let mut frames = Repeated::over(&stage, spans)?;
        frames.frame()?;
        self.bench.drift.wake()?;
        aside(&mut || {
            frames.forget_hits();
            let kernels = frames.frame()?.kernels;
            Ok(kernels
                .iter()
                .filter(|kernel| kernel.name.starts_with("trace/"))
                .map(|kernel| kernel.gpu_ms)
                .sum())
        })
    }
}

fn rays_of(totals: &Totals) -> u64 {
    totals.primary_finished + totals.ambient_finished
}

/// The median of a few runs.
fn aside(run: &mut dyn FnMut() -> Result<f64>) -> Result<Option<f64>> {
    let mut times = Vec::new();
    while times.len() < ASIDE_FRAMES && times.iter().sum::<f64>() < ASIDE_MS {
        times.push(run()?);
    }
    Ok(Median::of(&times).map(|median| median.median))
}
