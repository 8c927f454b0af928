//! Lists of rays: what the hit kernels alone can do.

use std::cell::{OnceCell, RefCell};
use std::rc::Rc;

use glam::DVec3;

use super::reference::reference_spec;
use super::rows::{Row, Spec};
use super::schedule::{Repeat, elements_in, interleave, share_that_fits, shuffled, spans};
use super::target::{blank_row, bvh_bytes, groups, plan_of, row_bytes, set_times};
use super::{Bench, Case, RayKind, Watch, has_reference, left_out};
use crate::error::{Error, Result};
use crate::layout::{HitRecord, NO_HIT, RayRecord, WORKGROUP_SIZE};
use crate::render::plan::Plan;
use crate::render::raylist::{Query, RayLists, reach_of};
use crate::render::retrace::{RaySet, Retraced};
use crate::render::seeds::hash;
use crate::render::stage::Uploads;
use crate::render::tally::Totals;
use crate::scene::Bounds;
use crate::scene::rays::FileRay;

/// Rays of `--rays random`.
const RANDOM_RAYS: u32 = 1 << 20;

/// A row that can be set up.
struct Planned<'a> {
    spec: &'a Spec,
    query: Query,
    order: usize,
    plan: Plan<'a>,
}

/// A row with the rays that it takes.
struct Ready<'a> {
    planned: &'a Planned<'a>,
    spans: Vec<(u32, u32)>,
    set: Rc<RaySet>,
}

struct Running<'a> {
    ready: &'a Ready<'a>,
    frames: Retraced<'a>,
    nodes_bytes: u64,
    totals: Totals,
    mismatched: Option<u64>,
}

impl Repeat for Running<'_> {
    fn frame_ms(&mut self) -> Result<f64> {
        let cost = self.frames.frame()?;
        self.totals = cost.totals;
        Ok(cost.gpu_ms())
    }
}

/// An answer that does not depend on the tree: distance, barycentric coordinates (bits) and the triangle's id.
type Answer = [u32; 4];

/// The rays of a case and what they hit.
struct List<'a> {
    bench: &'a Bench<'a>,
    case: &'a Case<'a>,
    rays: Vec<RayRecord>,
    /// The largest coordinate of an origin, device units.
    reach: f64,
    /// By query; the rays that the reference traced, with their answers.
    answers: Vec<(Query, Vec<Option<Answer>>)>,
    /// All rays, once they were wanted.
    whole: OnceCell<Rc<RaySet>>,
    uploads: RefCell<Uploads>,
}

/// Measures how fast each method answers the rays.
pub fn measure(bench: &Bench<'_>, case: &Case<'_>, watch: &mut dyn Watch) -> Result<()> {
    let queries = match bench.options.rays {
        RayKind::Listed(_) => &[Query::Closest, Query::Any][..],
        _ => &[Query::Closest],
    };
    let mut planned = Vec::new();
    for place in shuffled(case.rows.len(), bench.options.seed, u32::MAX) {
        let (spec, geometry, order) = case.rows[place];
        for (number, &query) in queries.iter().enumerate() {
            match plan_of(bench, case, spec, geometry) {
                Ok(plan) => {
                    planned.push(Planned { spec, query, order: order * queries.len() + number, plan });
                }
                Err(error) => left_out(watch, case, spec, error)?,
            }
        }
    }
    // Every tree stands over the same placed triangles, so the rays are the same for all.
    let Some(first) = planned.first() else { return Ok(()) };
    let rays = match rays(bench, &first.plan, case) {
        Ok(rays) => rays,
        Err(error) => return left_out(watch, case, first.spec, error),
    };
    // They may start farther away than the camera.
    let reach = reach_of(&rays);
    let planned: Vec<_> = planned
        .into_iter()
        .map(|row| Planned { plan: row.plan.with_reach(reach, row.query == Query::Any), ..row })
        .collect();
    let mut list = List {
        bench,
        case,
        rays,
        reach,
        answers: Vec::new(),
        whole: OnceCell::new(),
        uploads: RefCell::default(),
    };
    for &query in queries {
        watch.progress("reference", 0, planned.len());
        match list.reference(query, watch) {
            Ok(answers) => list.answers.push((query, answers)),
            Err(error) => watch.note(&format!("There is no reference to compare answers with: {error}")),
        }
    }
    let (all, mut done) = (planned.len(), 0);
    let most = bench.device.adapter().memory_bytes / 2;
    let bytes = list.rays.len() as u64 * (size_of::<RayRecord>() + size_of::<HitRecord>()) as u64;
    for group in groups(planned, most, |row| row_bytes(&row.plan) + bytes) {
        list.group(&group, watch, &mut |watch| {
            done += 1;
            watch.progress("rays", done, all);
        })?;
        list.uploads.borrow_mut().forget_unused();
    }
    Ok(())
}

/// The rays, filled up to whole workgroups with places where there is none.
fn rays(bench: &Bench<'_>, plan: &Plan<'_>, case: &Case<'_>) -> Result<Vec<RayRecord>> {
    let placement = &plan.geometry.placement;
    let placed = |rays: &[FileRay]| rays.iter().map(|ray| ray.placed(placement)).collect();
    let mut rays: Vec<RayRecord> = match &bench.options.rays {
        RayKind::Listed(rays) => placed(rays),
        RayKind::Random => placed(&random_rays(&case.subject.scene.bounds, bench.options.seed, RANDOM_RAYS)),
        RayKind::Primary | RayKind::Ambient => RayLists::new(bench.device, plan)?.camera_rays()?,
    };
    let whole = rays.len().next_multiple_of(WORKGROUP_SIZE as usize);
    let nothing = RayRecord { t_max: -1.0, direction: [1.0, 0.0, 0.0], ..RayRecord::default() };
    rays.resize(whole, nothing);
    if u32::try_from(rays.len()).is_err() {
        return Err(Error::input(format!("{} rays are more than 2^32: choose fewer.", rays.len())));
    }
    Ok(rays)
}

/// Rays from uniform points of a box in uniform directions, without end.
fn random_rays(bounds: &Bounds, seed: u32, count: u32) -> Vec<FileRay> {
    let mut drawn = 0u32;
    let mut uniform = || {
        drawn = drawn.wrapping_add(1);
        f64::from(hash(drawn, seed)) / 4_294_967_296.0
    };
    let mut ray = |_| {
        let at = DVec3::new(uniform(), uniform(), uniform());
        // Points of the cube, of which those in the unit ball are kept, have every direction alike.
        let direction = loop {
            let point = DVec3::new(uniform(), uniform(), uniform()) * 2.0 - 1.0;
            if (1e-4..=1.0).contains(&point.length_squared()) {
                break point.normalize();
            }
        };
        FileRay { origin: bounds.min + at * (bounds.max - bounds.min), direction, t_max: f64::INFINITY }
    };
    (0..count).map(&mut ray).collect()
}

impl List<'_> {
    fn elements(&self) -> u32 {
        self.rays.len() as u32
    }

    /// The rays of spans, on the device; all of them only once.
    fn set(&self, spans: &[(u32, u32)]) -> Result<Rc<RaySet>> {
        let all = elements_in(spans) == u64::from(self.elements());
        if let Some(set) = self.whole.get().filter(|_| all) {
            return Ok(set.clone());
        }
        let taken: Vec<RayRecord> = spans
            .iter()
            .flat_map(|&(begin, end)| &self.rays[begin as usize..end as usize])
            .copied()
            .collect();
        let set = Rc::new(RaySet::new(self.bench.device, &taken)?);
        if all {
            // It was not there a moment ago.
            let _ = self.whole.set(set.clone());
        }
        Ok(set)
    }

    /// The part of the rays that a row may take.
    fn spans(&self, plan: &Plan<'_>, query: Query) -> Result<Vec<(u32, u32)>> {
        let effort = &self.bench.options.effort;
        let share = share_that_fits(self.elements(), effort, self.bench.width(), &mut |spans| {
            let set = self.set(spans)?;
            Ok(self.retraced(plan, &set, query)?.0.frame()?.gpu_ms())
        })?;
        Ok(spans(self.elements(), share, self.bench.width()))
    }

    /// A row's kernel over a set of rays, and the bytes of its nodes.
    fn retraced<'r>(
        &'r self,
        plan: &'r Plan<'r>,
        set: &'r RaySet,
        query: Query,
    ) -> Result<(Retraced<'r>, u64)> {
        let uploaded = self.uploads.borrow_mut().of(self.bench.device, plan)?;
        let bytes = uploaded.nodes.bytes();
        Ok((Retraced::new(self.bench.device, plan, uploaded, set, query)?, bytes))
    }

    fn reference(&self, query: Query, watch: &mut dyn Watch) -> Result<Vec<Option<Answer>>> {
        let scene = &self.case.subject.scene;
        let spec = reference_spec(self.case);
        let built;
        let geometry = match self.case.rows.iter().find(|(row, ..)| row.shares_geometry(&spec)) {
            Some((_, geometry, _)) => *geometry,
            None => {
                built = watch.build(scene, &spec.wishes())?;
                &built
            }
        };
        let plan =
            plan_of(self.bench, self.case, &spec, geometry)?.with_reach(self.reach, query == Query::Any);
        let spans = self.spans(&plan, query)?;
        let set = self.set(&spans)?;
        let (mut frames, _) = self.retraced(&plan, &set, query)?;
        frames.frame()?;
        let mut answers = vec![None; self.rays.len()];
        for (place, answer) in places(&spans).zip(answers_of(&plan, query, &frames.hits()?)) {
            answers[place] = Some(answer);
        }
        Ok(answers)
    }

    fn group(
        &self,
        group: &[Planned<'_>],
        watch: &mut dyn Watch,
        through: &mut dyn FnMut(&mut dyn Watch),
    ) -> Result<()> {
        let mut ready = Vec::new();
        for planned in group {
            let spans = self.spans(&planned.plan, planned.query);
            match spans.and_then(|spans| Ok(Ready { planned, set: self.set(&spans)?, spans })) {
                Ok(row) => ready.push(row),
                Err(error) => left_out(watch, self.case, planned.spec, error)?,
            }
        }
        let mut running = Vec::new();
        for ready in &ready {
            match self.warm_up(ready) {
                Ok(row) => running.push(row),
                Err(error) => left_out(watch, self.case, ready.planned.spec, error)?,
            }
        }
        let Bench { options, drift, .. } = self.bench;
        drift.wake()?;
        interleave(running, &options.effort, options.seed, &mut || drift.measure(), &mut |row, times| {
            through(watch);
            match times.and_then(|times| self.finish(&row, &times)) {
                Ok(row) => watch.row(row),
                Err(error) => left_out(watch, self.case, row.ready.planned.spec, error),
            }
        })
    }

    fn warm_up<'r>(&'r self, ready: &'r Ready<'r>) -> Result<Running<'r>> {
        let Planned { spec, query, plan, .. } = ready.planned;
        let (mut frames, nodes_bytes) = self.retraced(plan, &ready.set, *query)?;
        let mut totals = Totals::default();
        for _ in 0..self.bench.options.effort.warm_up {
            totals = frames.frame()?.totals;
        }
        let mut mismatched = None;
        let expected = self.answers.iter().find(|(of, _)| of == query);
        if let (Some((_, expected)), true) = (expected, has_reference(spec)) {
            let found = answers_of(plan, *query, &frames.hits()?);
            let pairs = places(&ready.spans).zip(found);
            let differs: Vec<bool> =
                pairs.filter_map(|(place, answer)| Some(expected[place]? != answer)).collect();
            if !differs.is_empty() {
                mismatched = Some(differs.iter().filter(|differs| **differs).count() as u64);
            }
        }
        Ok(Running { ready, frames, nodes_bytes, totals, mismatched })
    }

    fn finish(&self, row: &Running<'_>, times: &[f64]) -> Result<Row> {
        let Planned { spec, query, order, plan } = row.ready.planned;
        let mut told = blank_row(self.case, spec, plan, *order);
        told.passes = "trace";
        told.query = Some(query.name());
        told.accessor = row.frames.accessor_name();
        told.spp = 0;
        let share = elements_in(&row.ready.spans) as f64 / self.rays.len() as f64;
        set_times(&mut told, times, row.ready.set.rays(), share);
        told.traversal_ms = Some(told.gpu_ms_median);
        told.overflowed_rays = row.totals.overflowed;
        told.mismatched_pixels = row.mismatched;
        told.bvh_bytes = bvh_bytes(plan, row.nodes_bytes);
        if let Some(statistics) = row.frames.statistics()? {
            told.registers = statistics.registers;
            told.stack_bytes = statistics.stack_bytes;
        }
        Ok(told)
    }
}

/// Each ray's answer by the triangle's id, which is the same in every tree; of an any hit, only whether there is one.
fn answers_of(plan: &Plan<'_>, query: Query, hits: &[HitRecord]) -> Vec<Answer> {
    let id = |index: u32| match index {
        NO_HIT => NO_HIT,
        index => plan.geometry.triangles.get(index as usize).map_or(index, |triangle| triangle.id),
    };
    hits.iter()
        .map(|hit| match hit.index {
            NO_HIT => [0, 0, 0, NO_HIT],
            _ if query == Query::Any => [0; 4],
            index => [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), id(index)],
        })
        .collect()
}

fn places(spans: &[(u32, u32)]) -> impl Iterator<Item = usize> {
    spans.iter().flat_map(|&(begin, end)| begin as usize..end as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn random_rays_fill_the_box_and_go_everywhere() {
        let bounds = Bounds { min: DVec3::new(-1.0, 0.0, 2.0), max: DVec3::new(1.0, 5.0, 3.0) };
        let rays = random_rays(&bounds, 4, 20_000);
        let mean = |value: &dyn Fn(&FileRay) -> DVec3| rays.iter().map(value).sum::<DVec3>() / 20_000.0;
        assert!(
            rays.iter().all(|ray| ray.origin.cmpge(bounds.min).all() && ray.origin.cmple(bounds.max).all())
        );
        assert!((mean(&|ray| ray.origin) - bounds.center()).abs().max_element() < 0.05);
        assert!(mean(&|ray| ray.direction).length() < 0.02);
        let second = mean(&|ray| ray.direction * ray.direction);
        assert!((second - 1.0 / 3.0).abs().max_element() < 0.01, "{second}");
        assert_ne!(rays, random_rays(&bounds, 5, 20_000));
    }
}
