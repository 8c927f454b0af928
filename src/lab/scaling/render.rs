//! Frames of the rows, each rendered from its start, camera rays included, one row after the other in random order.

use super::{BRUTE_UP_TO, LeftOut, Options, Row, Scaling, Study, Subject, Watch, memory};
use crate::error::{Error, Result};
use crate::lab::bench::schedule::{Repeat, interleave};
use crate::lab::scenes::usual_job;
use crate::lab::statistics::Median;
use crate::layout::{self, Count};
use crate::render::auto;
use crate::render::choices::Method;
use crate::render::plan::Plan;
use crate::render::repeat::Repeated;
use crate::render::stage::{Stage, Uploads};

/// What a row is to render.
#[derive(Clone, Copy)]
struct Wanted<'a> {
    subject: &'a Subject,
    method: Option<Method>,
    size: (u32, u32),
    spp: u32,
}

/// What it renders.
struct Frame<'a> {
    wanted: Wanted<'a>,
    plan: Plan<'a>,
}

/// A row that runs.
struct Running<'a> {
    place: usize,
    frames: Repeated<'a>,
    dispatches: u64,
    rays: u64,
}

impl Repeat for Running<'_> {
    fn frame_ms(&mut self) -> Result<f64> {
        self.frames.forget_hits();
        let cost = self.frames.frame()?;
        self.dispatches = cost.kernels.iter().map(|kernel| kernel.dispatches).sum();
        self.rays = cost.totals.primary_finished + cost.totals.ambient_finished;
        Ok(cost.gpu_ms())
    }
}

impl<'d> Scaling<'d> {
    /// Every method on every scene, frame by frame in turn.
    pub(super) fn methods(&self, subjects: &[Subject], watch: &mut dyn Watch) -> Result<()> {
        let Options { methods, size, spp, .. } = self.options;
        let of = |subject| {
            methods.iter().map(move |&method| Wanted {
                subject,
                method: Some(method),
                size: *size,
                spp: *spp,
            })
        };
        self.study(Study::Triangles, subjects.iter().flat_map(of).collect(), watch)
    }

    /// More and more samples, with what `auto` takes or the only method that was asked for.
    pub(super) fn samples(&self, subject: &Subject, watch: &mut dyn Watch) -> Result<()> {
        let (method, size) = (self.one_method(), self.options.samples_size);
        let wanted = self.options.samples.iter().map(|&spp| Wanted { subject, method, size, spp });
        self.study(Study::Samples, wanted.collect(), watch)
    }

    /// Larger and larger pictures, likewise.
    pub(super) fn sizes(&self, subject: &Subject, watch: &mut dyn Watch) -> Result<()> {
        let (method, spp) = (self.one_method(), self.options.spp);
        let wanted = self.options.sizes.iter().map(|&size| Wanted { subject, method, size, spp });
        self.study(Study::Size, wanted.collect(), watch)
    }

    fn one_method(&self) -> Option<Method> {
        if let [method] = self.options.methods[..] { Some(method) } else { None }
    }

    fn study(&self, study: Study, wanted: Vec<Wanted<'_>>, watch: &mut dyn Watch) -> Result<()> {
        watch.begin(&format!("measuring {}", study.name()));
        let mut frames = Vec::new();
        for wanted in wanted {
            match self.plan(&wanted) {
                Ok(plan) => frames.push(Frame { wanted, plan }),
                Err(error) => {
                    let what = wanted.method.map(|method| method.to_string()).unwrap_or_default();
                    watch.left_out(LeftOut::new(study, &wanted.subject.name, &what, &error), error)?;
                }
            }
        }
        // A scene's counts with the first method that came through: others must have the same.
        let mut expected: Vec<(&str, Vec<Count>)> = Vec::new();
        let mut uploads = Uploads::default();
        let mut stages = Vec::new();
        for (place, frame) in frames.iter().enumerate() {
            match self.stage(&mut uploads, &frame.plan) {
                Ok(stage) => stages.push((place, stage)),
                Err(error) => self.fail(study, frame, error, watch)?,
            }
        }
        let mut running = Vec::new();
        let mut told: Vec<Option<Row>> = frames.iter().map(|_| None).collect();
        for (place, stage) in &stages {
            let frame = &frames[*place];
            let Wanted { subject, size, spp, .. } = frame.wanted;
            match self.warm_up(*place, stage) {
                Ok((row, counts, own_bytes)) => {
                    let mismatched_pixels =
                        (study == Study::Triangles).then(|| mismatches(&mut expected, &subject.name, counts));
                    told[*place] = Some(Row {
                        method: Some(frame.plan.settings.method.to_string()),
                        builder: Some(frame.plan.settings.builder.name()),
                        passes: Some(frame.plan.settings.passes.name()),
                        accessor: Some(frame.plan.accessor_name()),
                        size: Some([size.0, size.1]),
                        spp: Some(spp),
                        mismatched_pixels,
                        device_bytes: Some(own_bytes + stage.nodes.bytes() + stage.triangles.bytes()),
                        ..Row::new(study, &subject.name, &subject.scene)
                    });
                    running.push(row);
                }
                Err(error) => self.fail(study, frame, error, watch)?,
            }
        }
        let mut failed = Vec::new();
        interleave(
            running,
            &self.options.effort,
            self.options.seed,
            &mut || self.drift.measure(),
            &mut |row, times| {
                match (times, &mut told[row.place]) {
                    (Ok(times), Some(told)) => set_times(told, &times, &row),
                    (Err(error), told) => {
                        *told = None;
                        failed.push((row.place, error));
                    }
                    (Ok(_), None) => {}
                }
                Ok(())
            },
        )?;
        for (place, error) in failed {
            self.fail(study, &frames[place], error, watch)?;
        }
        let peak_host_bytes = memory::peak();
        let rows = told.into_iter().flatten().map(|row| Row { peak_host_bytes, ..row });
        watch.rows(rows.collect())
    }

    fn plan<'a>(&self, wanted: &Wanted<'a>) -> Result<Plan<'a>> {
        let Wanted { subject: Subject { name, scene, geometry, .. }, method, size, spp } = *wanted;
        if method == Some(Method::Brute) && geometry.triangles.len() > BRUTE_UP_TO {
            return Err(Error::usage(format!(
                "brute would test all {} triangles of {name} for each ray: it is measured up to {BRUTE_UP_TO}",
                geometry.triangles.len()
            )));
        }
        let adapter = self.device.adapter();
        let decision = auto::decide(&self.wishes(method, geometry.builder), geometry, adapter);
        auto::check_stack(decision.settings.method, geometry, true)?;
        let plan = Plan::new(
            usual_job(scene, size, spp, self.options.seed),
            scene,
            geometry,
            &decision,
            &adapter.limits,
        )?;
        // Each frame begins anew, pixels that hit nothing too.
        let plan = plan.with_constant(layout::SPEC_MARKS_MISSES, 0);
        let needed = plan.node_array_bytes() + plan.triangle_bytes().len() as u64;
        if needed > adapter.memory_bytes {
            return Err(Error::device(format!(
                "{name} takes {} MB of {}'s memory, which has {}: choose fewer triangles with {}:N or another --device",
                needed / 1_000_000,
                adapter.name,
                adapter.memory_bytes / 1_000_000,
                self.options.kind.name
            )));
        }
        Ok(plan)
    }

    fn stage<'p>(&self, uploads: &mut Uploads, plan: &'p Plan<'p>) -> Result<Stage<'p>>
    where
        'd: 'p,
    {
        let uploaded = uploads.of(self.device, plan)?;
        Stage::with_uploaded(self.device, plan, uploaded)
    }

    /// Runs the frames that are thrown away; gives the first one's counts, and the memory that the pixels take.
    fn warm_up<'r>(&self, place: usize, stage: &'r Stage<'r>) -> Result<(Running<'r>, Vec<Count>, u64)> {
        let before = self.device.allocated_bytes();
        let mut row = Running { place, frames: Repeated::new(stage)?, dispatches: 0, rays: 0 };
        let own_bytes = self.device.allocated_bytes().saturating_sub(before);
        self.drift.wake()?;
        row.frame_ms()?;
        let counts = row.frames.counts()?;
        for _ in 1..self.options.effort.warm_up {
            row.frame_ms()?;
        }
        Ok((row, counts, own_bytes))
    }

    fn fail(&self, study: Study, frame: &Frame<'_>, error: Error, watch: &mut dyn Watch) -> Result<()> {
        let Wanted { subject, size: (width, height), spp, .. } = frame.wanted;
        let what = format!("{} {width}x{height} spp {spp}", frame.plan.settings.method);
        watch.left_out(LeftOut::new(study, &subject.name, &what, &error), error)
    }
}

/// Pixels that differ; a scene's first counts are the ones expected.
fn mismatches<'a>(expected: &mut Vec<(&'a str, Vec<Count>)>, scene: &'a str, counts: Vec<Count>) -> u64 {
    let Some((_, first)) = expected.iter().find(|(known, _)| *known == scene) else {
        expected.push((scene, counts));
        return 0;
    };
    let longer = first.len().abs_diff(counts.len()) as u64;
    longer + first.iter().zip(&counts).filter(|(a, b)| a != b).count() as u64
}

fn set_times(told: &mut Row, times: &[f64], row: &Running<'_>) {
    told.frames = Some(times.len());
    told.dispatches = Some(row.dispatches);
    told.rays = Some(row.rays);
    if let Some(Median { median, ci95 }) = Median::of(times) {
        told.gpu_ms_median = Some(median);
        told.gpu_ms_ci95 = Some(ci95);
        let least = times.iter().copied().fold(f64::INFINITY, f64::min);
        told.gpu_ms_min = Some(least);
        told.ms_per_ray = (row.rays > 0).then(|| least / row.rays as f64);
    }
}
