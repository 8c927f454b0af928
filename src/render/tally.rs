//! What the device reported of its work, summed up.

use std::collections::BTreeMap;
use std::time::Instant;

use super::plan::Plan;
use super::rounds::Rounds;
use super::spans::{Span, Spans, Submit};
use crate::layout::{Counters, Range, STAGE_CLOSEST};
use crate::vk::Finished;

/// Time and number of the dispatches of one kernel.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct KernelTime {
    pub name: String,
    /// Summed device time; the host's waiting time where the device has no timestamps.
    pub gpu_ms: f64,
    pub dispatches: u64,
}

/// How far a render is.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// In [0, 1].
    pub done: f64,
    /// Rays traced so far.
    pub rays: u64,
    /// Device time so far.
    pub gpu_ms: f64,
    /// Estimated error after the rounds so far.
    pub rmse: Option<f64>,
}

/// Sums of [`Counters`] over slots and submits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    pub primary_asked: u64,
    pub primary_finished: u64,
    pub ambient_asked: u64,
    pub ambient_finished: u64,
    pub overflowed: u64,
    /// Rays that escaped, where they are added up in one place (an experiment).
    pub escaped: u64,
}

impl Totals {
    pub fn of(slots: &[Counters]) -> Self {
        let sum = |field: fn(&Counters) -> u32| slots.iter().map(|slot| u64::from(field(slot))).sum();
        Self {
            primary_asked: sum(|slot| slot.primary_asked),
            primary_finished: sum(|slot| slot.primary_finished),
            ambient_asked: sum(|slot| slot.ambient_asked),
            ambient_finished: sum(|slot| slot.ambient_finished),
            overflowed: sum(|slot| slot.overflowed),
            escaped: sum(|slot| slot.escaped),
        }
    }

    pub fn add(&mut self, other: &Self) {
        self.primary_asked += other.primary_asked;
        self.primary_finished += other.primary_finished;
        self.ambient_asked += other.ambient_asked;
        self.ambient_finished += other.ambient_finished;
        self.overflowed += other.overflowed;
        self.escaped += other.escaped;
    }

    /// Rays that were begun and not brought to their end.
    pub fn missing(&self) -> u64 {
        (self.primary_asked + self.ambient_asked)
            .saturating_sub(self.primary_finished + self.ambient_finished)
    }
}

/// Sums over a whole render.
pub struct Tally<'a> {
    pub totals: Totals,
    pub kernels: BTreeMap<String, KernelTime>,
    pub submits: u64,
    pub repeats: u32,
    /// Camera rays times samples of this round, done and in all.
    done: f64,
    all: f64,
    /// What was done before this round, as a part of everything, and this round's part.
    before: f64,
    share: f64,
    numbers: f64,
    /// Estimated error after the last round.
    pub rmse: Option<f64>,
    triangles: u32,
    observe: &'a mut dyn FnMut(&Progress),
    /// What happened when, where a timeline is wanted.
    pub spans: Option<&'a mut Spans>,
}

impl<'a> Tally<'a> {
    pub fn new(plan: &Plan<'_>, observe: &'a mut dyn FnMut(&Progress)) -> Self {
        Self {
            totals: Totals::default(),
            kernels: BTreeMap::new(),
            submits: 0,
            repeats: 0,
            done: 0.0,
            before: 0.0,
            share: 1.0,
            numbers: plan.tiles.numbers() as f64,
            rmse: None,
            triangles: plan.frame.triangle_count,
            all: plan.tiles.numbers() as f64 * plan.job.samples.len() as f64,
            observe,
            spans: None,
        }
    }

    /// A round of `samples` begins, after which each camera ray has `mean` of them.
    pub fn begin_round(&mut self, rounds: &Rounds, mean: u32, samples: std::ops::Range<u32>) {
        let (before, all) = rounds.way(mean);
        self.before = before / all;
        self.share = (f64::from(mean) - before) / all;
        self.done = 0.0;
        self.all = self.numbers * samples.len() as f64;
    }

    /// Notes that a phase of the host's work ends now.
    pub fn phase(&mut self, name: &'static str, begin: Instant) {
        if let Some(spans) = &mut self.spans {
            spans.phase(name, begin);
        }
    }

    /// Notes what a second thread did.
    pub fn beside(&mut self, span: Span) {
        if let Some(spans) = &mut self.spans {
            spans.phases.push(span);
        }
    }

    /// Adds a finished submit: what it did, how long each dispatch took. `dispatched`: the range of each dispatch;
    /// `wall_ms`: for devices without timestamps.
    pub fn add(
        &mut self,
        ranges: &[Range],
        dispatched: &[Range],
        totals: &Totals,
        finished: &Finished,
        wall_ms: f64,
    ) {
        self.totals.add(totals);
        self.submits += 1;
        if let Some(spans) = &mut self.spans {
            spans.submits.push(Submit {
                ranges: dispatched.to_vec(),
                rays: totals.primary_finished + totals.ambient_finished,
                finished: finished.clone(),
            });
        }
        let share = wall_ms / finished.timings.len().max(1) as f64;
        for timing in &finished.timings {
            let kernel = self.kernels.entry(timing.label.clone()).or_insert_with(|| KernelTime {
                name: timing.label.clone(),
                gpu_ms: 0.0,
                dispatches: 0,
            });
            kernel.gpu_ms += timing.gpu_ms.unwrap_or(share);
            kernel.dispatches += 1;
        }
        for range in ranges {
            // A sample is done with the last part of the triangles.
            if range.stage != STAGE_CLOSEST && range.triangle_end == self.triangles {
                let samples = f64::from(range.sample_end - range.sample_begin);
                self.done += f64::from(range.pixel_end - range.pixel_begin) * samples;
            }
        }
        (self.observe)(&Progress {
            done: self.before
                + self.share * if self.all > 0.0 { (self.done / self.all).min(1.0) } else { 1.0 },
            rays: self.totals.primary_finished + self.totals.ambient_finished,
            gpu_ms: self.kernels.values().map(|kernel| kernel.gpu_ms).sum(),
            rmse: self.rmse,
        });
    }
}
