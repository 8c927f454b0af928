//! Renders the pixels of one band: ranges recorded into submits, two of them under way at once, and what
//! the device counted compared with what it was asked for.

use std::cell::Cell;
use std::collections::VecDeque;
use std::ops::Range as Span;
use std::time::Instant;

use super::choices::{Accumulator, Sampler};
use super::passes::{Buffers, MOST_DISPATCHES, Recorder};
use super::plan::Plan;
use super::schedule::{Blocks, Scheduler, Work};
use super::seeds::lcg_seeds;
use super::stage::Stage;
use super::tally::{Tally, Totals};
use crate::error::{Error, Result};
use crate::layout::{self, Budget, Carry, Count, Counters, FRAME_SAMPLES, MISSED, Range};
use crate::vk::{Access, Batch, Binding, BoundKernel, Buffer, BufferUse, Device, Finished, Hazard};

/// A span of pixel numbers and the buffers that hold an element for each of them.
pub struct Band<'a> {
    stage: &'a Stage<'a>,
    pixels: Span<u32>,
    counts: Buffer,
    seeds: Buffer,
    carry: Buffer,
    between: Buffers,
    /// Rays per ms, once that was measured.
    rate: Cell<Option<f64>>,
    work: Buffer,
    /// Of each pixel, where they differ.
    budgets: Buffer,
}

/// Where a submit counts what it does.
struct Slot {
    counters: Buffer,
    readback: Buffer,
}

/// A submit under way.
struct Flight<'a> {
    batch: Batch<'a>,
    ranges: Vec<Range>,
    /// The range of each dispatch.
    dispatched: Vec<Range>,
    /// Camera rays that it must begin, if that is known.
    camera_rays: Option<u64>,
    slot: &'a Slot,
}

/// Submits that may be under way at once: the host prepares one while the device works on the other.
const IN_FLIGHT: usize = 2;
/// Samples of a dispatch that takes up pixels again.
const REPEAT_BLOCK: u32 = 1 << 15;

impl<'a> Band<'a> {
    pub fn new(stage: &'a Stage<'a>, begin: u32, end: u32) -> Result<Self> {
        let Stage { device, plan, .. } = *stage;
        let pixels = u64::from(end - begin);
        let zeroed = |name, wanted: bool, record: usize| -> Result<Buffer> {
            let bytes = if wanted { pixels * record as u64 } else { 16 };
            let buffer = Buffer::new(device, name, BufferUse::Storage, bytes)?;
            let mut batch = Batch::new(device, 0)?;
            batch.fill(&buffer, 0);
            batch.barrier(&[Hazard::Buffer(&buffer, Access::TransferWrite, Access::ShaderWrite)]);
            batch.submit()?;
            batch.wait()?;
            Ok(buffer)
        };
        Ok(Self {
            stage,
            pixels: begin..end,
            counts: zeroed("counts", counts_rays(plan), size_of::<Count>())?,
            seeds: seeds(stage, begin..end)?,
            carry: zeroed("carry", plan.brute(), size_of::<Carry>())?,
            between: Buffers::new(device, plan, pixels)?,
            rate: Cell::new(None),
            work: zeroed("work", plan.counts_work(), size_of::<layout::Work>())?,
            budgets: zeroed("budgets", plan.job.adaptive, size_of::<Budget>())?,
        })
    }

    /// Numbers of the pixels' camera rays.
    pub fn pixels(&self) -> Span<u32> {
        self.pixels.clone()
    }

    /// The samples of each pixel in the next go, where they differ.
    pub fn set_budgets(&mut self, budgets: &[Budget]) -> Result<()> {
        let content = bytemuck::cast_slice(budgets);
        self.budgets = Buffer::with_content(self.stage.device, "budgets", BufferUse::Storage, content)?;
        Ok(())
    }

    /// What each pixel's rays cost, if the kernel counts it.
    pub fn work(&self) -> Result<Vec<layout::Work>> {
        if !self.stage.plan.counts_work() {
            return Ok(Vec::new());
        }
        Ok(bytemuck::pod_collect_to_vec(&self.work.read(self.stage.device)?))
    }

    /// These samples of all pixels, which must be the next ones.
    pub fn render(&self, samples: Span<u32>, tally: &mut Tally<'_>) -> Result<()> {
        let mut missing = self.pass(&samples, tally, true)?;
        let in_parts = self.scheduler(&samples, true).in_parts();
        while missing > 0 && !self.stage.plan.tuning.unguarded {
            if !self.stage.plan.resumes() {
                return Err(self.unfinished(missing, "a running mean cannot be taken up again"));
            }
            if in_parts {
                return Err(self.unfinished(missing, "a part of the triangles was not tested"));
            }
            let before = tally.totals.ambient_finished;
            tally.repeats += 1;
            missing = self.pass(&samples, tally, false)?;
            if missing > 0 && before == tally.totals.ambient_finished {
                return Err(self.unfinished(missing, "one ray alone is too long for it"));
            }
        }
        Ok(())
    }

    /// Has camera rays traced again with the next samples, where their hits are kept.
    pub fn forget_hits(&self) {
        self.between.forget_hits();
    }

    /// The pixels' counts, if that is what is accumulated. `samples`: what a pixel has traced by now whose camera ray
    /// hit, given its place in the band.
    pub fn counts(&self, samples: impl Fn(usize) -> u64) -> Result<Vec<Count>> {
        if !counts_rays(self.stage.plan) {
            return Ok(Vec::new());
        }
        let mut counts: Vec<Count> = bytemuck::pod_collect_to_vec(&self.counts.read(self.stage.device)?);
        counts.iter_mut().filter(|count| count.escaped0 == MISSED).for_each(|count| count.escaped0 = 0);
        if !self.stage.plan.tuning.unguarded {
            self.check_counts(&counts, samples)?;
        }
        Ok(counts)
    }

    /// Every pixel has traced all its samples or, where its camera ray hit nothing, none.
    fn check_counts(&self, counts: &[Count], samples: impl Fn(usize) -> u64) -> Result<()> {
        let traced = |count: &Count| u64::from(count.traced0) + u64::from(count.traced1);
        let wrong = |(place, traced): &(usize, u64)| *traced != 0 && *traced != samples(*place);
        match counts.iter().map(traced).enumerate().find(wrong) {
            None => Ok(()),
            Some((place, traced)) => Err(Error::device(format!(
                "A pixel traced {traced} rays where {} were asked for: report this with the output of `cousu \
                 doctor`, and choose another device.",
                samples(place)
            ))),
        }
    }

    fn unfinished(&self, rays: u64, why: &str) -> Error {
        Error::device(format!(
            "{rays} rays did not come to their end on {} ({why}): choose another --method, --accumulator count or \
             another device.",
            self.stage.device.adapter().name
        ))
    }

    /// Goes once over all samples that are not done yet; returns how many rays did not come to their end.
    /// `first`: no sample is done yet, so it is known how many camera rays there must be.
    fn pass(&self, samples: &Span<u32>, tally: &mut Tally<'_>, first: bool) -> Result<u64> {
        let Stage { device, plan, ref pipelines, .. } = *self.stage;
        let mut scheduler = self.scheduler(samples, first);
        let slots: Vec<Slot> = (0..IN_FLIGHT).map(|_| Slot::new(device)).collect::<Result<_>>()?;
        let bind = |slot| self.between.bind(pipelines, &self.bindings(slot));
        let kernels: Vec<Vec<BoundKernel<'_>>> = slots.iter().map(bind).collect::<Result<_>>()?;
        let mut recorder =
            Recorder::new(plan, &self.between, self.pixel_hazards(), first.then_some(samples.start));
        let mut in_flight: VecDeque<Flight<'_>> = VecDeque::new();
        let (mut submitted, mut missing) = (0, 0);
        let mut last_end = Instant::now();
        loop {
            while in_flight.len() < IN_FLIGHT {
                let ranges = scheduler.next_submit();
                if ranges.is_empty() {
                    break;
                }
                let place = submitted % IN_FLIGHT;
                submitted += 1;
                in_flight.push_back(self.submit(&slots[place], &kernels[place], &mut recorder, ranges)?);
            }
            let Some(Flight { batch, ranges, dispatched, camera_rays, slot }) = in_flight.pop_front() else {
                break;
            };
            let finished = batch.wait()?;
            let wall_ms = last_end.elapsed().as_secs_f64() * 1e3;
            last_end = Instant::now();
            let totals = Totals::of(&bytemuck::pod_collect_to_vec::<u8, Counters>(slot.readback.mapped()?));
            if let Some(asked) = camera_rays {
                check_camera_rays(asked, &totals)?;
            }
            let rays = totals.primary_finished + totals.ambient_finished;
            scheduler.measured(&ranges, rays, device_ms(&finished).unwrap_or(wall_ms));
            self.rate.set(Some(scheduler.rate()));
            missing += totals.missing();
            tally.add(&ranges, &dispatched, &totals, &finished, wall_ms);
        }
        Ok(missing)
    }

    fn scheduler(&self, samples: &Span<u32>, first: bool) -> Scheduler {
        let plan = self.stage.plan;
        let work = Work {
            pixel_begin: self.pixels.start,
            pixel_end: self.pixels.end,
            sample_begin: samples.start,
            sample_end: samples.end,
            triangles: plan.frame.triangle_count,
            brute: plan.brute(),
            blocks: if counts_rays(plan) { Blocks::Free } else { Blocks::Frames(FRAME_SAMPLES) },
            room: self.between.room(),
        };
        let scheduler = Scheduler::new(work, self.stage.pace).with_rate(self.rate.get());
        match plan.job.block {
            // Few pixels are left, each with its own rest.
            _ if !first => scheduler.with_block(REPEAT_BLOCK),
            Some(block) => scheduler.with_block(block),
            None => scheduler,
        }
    }

    fn bindings<'b>(&'b self, slot: &'b Slot) -> Vec<(u32, Binding<'b>)> {
        let geometry =
            |buffer| if self.stage.plan.texels() { Binding::Texels(buffer) } else { Binding::Buffer(buffer) };
        let mut bindings = vec![
            (layout::BINDING_FRAME, Binding::Buffer(&self.stage.frame)),
            (layout::BINDING_NODES, geometry(&self.stage.nodes)),
            (layout::BINDING_TRIANGLES, geometry(&self.stage.triangles)),
            (layout::BINDING_COUNTS, Binding::Buffer(&self.counts)),
            (layout::BINDING_SEEDS, Binding::Buffer(&self.seeds)),
            (layout::BINDING_CARRY, Binding::Buffer(&self.carry)),
            (layout::BINDING_COUNTERS, Binding::Buffer(&slot.counters)),
            (layout::BINDING_WORK, Binding::Buffer(&self.work)),
            (layout::BINDING_BUDGETS, Binding::Buffer(&self.budgets)),
        ];
        bindings
            .extend(self.stage.image.as_ref().map(|image| (layout::BINDING_IMAGE, Binding::Image(image))));
        bindings
    }

    /// Records the ranges one after the other and hands them to the device.
    fn submit<'b>(
        &'b self,
        slot: &'b Slot,
        kernels: &'b [BoundKernel<'b>],
        recorder: &mut Recorder<'b>,
        ranges: Vec<Range>,
    ) -> Result<Flight<'b>> {
        let mut batch = Batch::new(self.stage.device, (ranges.len() * MOST_DISPATCHES) as u32)?;
        if self.stage.plan.tuning.waits_between {
            batch.wait_after_each();
        }
        batch.fill(&slot.counters, 0);
        batch.barrier(&[Hazard::Buffer(&slot.counters, Access::TransferWrite, Access::ShaderWrite)]);
        let mut camera_rays = Some(0);
        let mut dispatched = Vec::new();
        for range in &ranges {
            let asked = recorder.record(&mut batch, kernels, range)?;
            camera_rays = camera_rays.zip(asked).map(|(sum, more)| sum + more);
            dispatched.resize(batch.dispatches(), *range);
        }
        batch.barrier(&[Hazard::Buffer(&slot.counters, Access::ShaderWrite, Access::TransferRead)]);
        batch.copy(&slot.counters, &slot.readback, 0, slot.counters.bytes());
        batch.barrier(&[Hazard::Buffer(&slot.readback, Access::TransferWrite, Access::HostRead)]);
        batch.submit()?;
        Ok(Flight { batch, ranges, dispatched, camera_rays, slot })
    }

    /// What the kernels keep for each pixel: written by one dispatch, read by the next.
    fn pixel_hazards(&self) -> Vec<Hazard<'_>> {
        let plan = self.stage.plan;
        let again = |buffer| Hazard::Buffer(buffer, Access::ShaderWrite, Access::ShaderWrite);
        let mut hazards = vec![again(&self.seeds)];
        if counts_rays(plan) {
            hazards.push(again(&self.counts));
        }
        if plan.brute() {
            hazards.push(again(&self.carry));
        }
        if plan.counts_work() {
            hazards.push(again(&self.work));
        }
        hazards.extend(
            self.stage.image.as_ref().map(|i| Hazard::Image(i, Access::ShaderWrite, Access::ShaderWrite)),
        );
        hazards
    }
}

impl Slot {
    fn new(device: &Device) -> Result<Self> {
        let bytes = (layout::COUNTER_SLOTS as usize * size_of::<Counters>()) as u64;
        Ok(Self {
            counters: Buffer::new(device, "counters", BufferUse::Storage, bytes)?,
            readback: Buffer::new(device, "counters (readback)", BufferUse::Readback, bytes)?,
        })
    }
}

/// States of the original's generator at the start, where it is used.
fn seeds(stage: &Stage<'_>, pixels: Span<u32>) -> Result<Buffer> {
    let states = match stage.plan.settings.sampler {
        Sampler::Lcg => lcg_seeds(pixels.start, pixels.end, stage.seed),
        _ => vec![0; 4],
    };
    Buffer::with_content(stage.device, "seeds", BufferUse::Storage, bytemuck::cast_slice(&states))
}

fn counts_rays(plan: &Plan<'_>) -> bool {
    plan.settings.accumulator == Accumulator::Count
}

fn device_ms(finished: &Finished) -> Option<f64> {
    finished.timings.iter().map(|timing| timing.gpu_ms).sum()
}

/// The device must have begun a camera ray for each pixel.
fn check_camera_rays(asked: u64, totals: &Totals) -> Result<()> {
    if asked == totals.primary_asked {
        return Ok(());
    }
    Err(Error::device(format!(
        "The device began {} camera rays where {asked} were asked for: report this with the output of `cousu doctor`, \
         and choose another device.",
        totals.primary_asked
    )))
}
