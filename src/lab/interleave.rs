//! Times of variants whose frames alternate, and their ratios.

use std::fmt;
use std::time::Instant;

use serde::Serialize;

use super::statistics::Median;
use crate::error::{Error, Result};
use crate::render::picture::Accumulated;
use crate::render::plan::Plan;
use crate::render::repeat::Repeated;
use crate::render::stage::Stage;
use crate::render::tally::Totals;
use crate::vk::Device;

/// One of the ways that are compared.
pub struct Variant<'p> {
    pub label: String,
    pub plan: Plan<'p>,
    /// Camera rays are traced again in every frame.
    pub forgets_hits: bool,
}

impl<'p> Variant<'p> {
    pub fn new(label: impl Into<String>, plan: Plan<'p>) -> Self {
        Self { label: label.into(), plan, forgets_hits: false }
    }

    pub fn forgetting(self) -> Self {
        Self { forgets_hits: true, ..self }
    }
}

/// What a time was taken with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Clock {
    /// Summed kernel time.
    Device,
    /// The host's, from the call to the return.
    Wall,
}

/// A time over a time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ratio {
    pub over: String,
    pub under: String,
    pub scene: String,
    pub clock: Clock,
    /// Median over pairs of frames that ran one after the other.
    pub ratio: f64,
    pub ci95: [f64; 2],
    pub over_ms: f64,
    pub under_ms: f64,
    pub pairs: usize,
}

impl Ratio {
    /// The ratio with its interval.
    pub fn figure(&self) -> String {
        format!("{} [{}, {}]", digits(self.ratio), digits(self.ci95[0]), digits(self.ci95[1]))
    }
}

/// Three digits that count.
pub fn digits(value: f64) -> String {
    match value.abs() {
        large if large >= 100.0 => format!("{value:.0}"),
        large if large >= 10.0 => format!("{value:.1}"),
        large if large >= 1.0 || value == 0.0 => format!("{value:.2}"),
        small if small >= 0.001 => format!("{value:.3}"),
        _ => format!("{value:.2e}"),
    }
}

impl fmt::Display for Ratio {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} over {} on {}: {}", self.over, self.under, self.scene, self.figure())
    }
}

/// Frames of all variants, one row of each in turn.
pub struct Series {
    scene: String,
    labels: Vec<String>,
    device_ms: Vec<Vec<f64>>,
    wall_ms: Vec<Vec<f64>>,
    /// Of all frames, the warm-up's included.
    pub totals: Vec<Totals>,
    /// After all frames, of which every variant had as many.
    pub accumulated: Vec<Accumulated>,
    pub frames: u32,
}

/// Pairs to measure, and seconds after which fewer will do.
const PAIRS: (usize, f64) = (30, 12.0);
const QUICK_PAIRS: (usize, f64) = (6, 0.8);
/// Pairs at least.
const FEWEST: usize = 6;
/// Where frames are short there are more of them, for this long.
const LEAST_S: f64 = 0.5;
const MOST_PAIRS: usize = 200;
/// Rounds that are thrown away: the first also compiles and makes buffers ready.
const WARM_UP: usize = 2;

/// Runs the variants' frames in turn, in an order that is turned round every time, the warm-up thrown away.
pub fn interleave(device: &Device, quick: bool, scene: &str, variants: &[Variant<'_>]) -> Result<Series> {
    let stage = |variant| Stage::new(device, Variant::plan(variant));
    let stages: Vec<Stage<'_>> = variants.iter().map(stage).collect::<Result<_>>()?;
    let mut repeated: Vec<Repeated<'_>> = stages.iter().map(Repeated::new).collect::<Result<_>>()?;
    let count = variants.len();
    let mut series = Series {
        scene: scene.to_string(),
        labels: variants.iter().map(|variant| variant.label.clone()).collect(),
        device_ms: vec![Vec::new(); count],
        wall_ms: vec![Vec::new(); count],
        totals: vec![Totals::default(); count],
        accumulated: Vec::new(),
        frames: 0,
    };
    let (pairs, patience_s) = if quick { QUICK_PAIRS } else { PAIRS };
    let warm_up = if quick { 1 } else { WARM_UP };
    let mut start = Instant::now();
    for round in 0.. {
        if round == warm_up {
            start = Instant::now();
        }
        let done = round.saturating_sub(warm_up);
        let elapsed = start.elapsed().as_secs_f64();
        let enough = done >= pairs && (quick || elapsed > LEAST_S || done >= MOST_PAIRS);
        if enough || done >= FEWEST && elapsed > patience_s {
            break;
        }
        for step in 0..count {
            let which = if round % 2 == 0 { step } else { count - 1 - step };
            if variants[which].forgets_hits {
                repeated[which].forget_hits();
            }
            device.wake();
            let begin = Instant::now();
            let cost = repeated[which].frame()?;
            let wall_ms = begin.elapsed().as_secs_f64() * 1e3;
            if round >= warm_up {
                series.device_ms[which].push(cost.gpu_ms());
                series.wall_ms[which].push(wall_ms);
            }
            series.totals[which].add(&cost.totals);
        }
        series.frames += 1;
    }
    for (stage, repeated) in stages.iter().zip(&repeated) {
        series.accumulated.push(accumulated(stage, repeated)?);
    }
    Ok(series)
}

impl<'p> Variant<'p> {
    fn plan(&self) -> &Plan<'p> {
        &self.plan
    }
}

pub fn accumulated(stage: &Stage<'_>, repeated: &Repeated<'_>) -> Result<Accumulated> {
    Ok(match stage.means()? {
        Some(means) => Accumulated::Means(means),
        None => Accumulated::Counts(repeated.counts()?),
    })
}

impl Series {
    /// Device time of one variant over that of another.
    pub fn ratio(&self, over: usize, under: usize) -> Result<Ratio> {
        self.ratio_of(Clock::Device, over, under)
    }

    /// The host's time of one over that of another.
    pub fn wall_ratio(&self, over: usize, under: usize) -> Result<Ratio> {
        self.ratio_of(Clock::Wall, over, under)
    }

    /// How much more time of a frame lies outside the kernels with one variant than with another, as a part of the
    /// other's frame by the host's clock.
    pub fn more_beyond_kernels(&self, of: usize, than: usize) -> Result<Median> {
        let beyond = |which: usize, frame: usize| self.wall_ms[which][frame] - self.device_ms[which][frame];
        let parts: Vec<f64> = (0..self.wall_ms[than].len())
            .map(|frame| (beyond(of, frame) - beyond(than, frame)) / self.wall_ms[than][frame].max(1e-9))
            .collect();
        median(&parts)
    }

    /// Device time of a variant's frame, ms.
    pub fn frame_ms(&self, which: usize) -> Result<f64> {
        Ok(median(&self.device_ms[which])?.median)
    }

    fn ratio_of(&self, clock: Clock, over: usize, under: usize) -> Result<Ratio> {
        let times = if clock == Clock::Device { &self.device_ms } else { &self.wall_ms };
        let (a, b) = (&times[over], &times[under]);
        let ratios: Vec<f64> = a.iter().zip(b).map(|(a, b)| a / b.max(1e-9)).collect();
        let Median { median: ratio, ci95 } = median(&ratios)?;
        Ok(Ratio {
            over: self.labels[over].clone(),
            under: self.labels[under].clone(),
            scene: self.scene.clone(),
            clock,
            ratio,
            ci95,
            over_ms: median(a)?.median,
            under_ms: median(b)?.median,
            pairs: ratios.len(),
        })
    }
}

fn median(values: &[f64]) -> Result<Median> {
    Median::of(values).ok_or_else(|| Error::other("No frame was measured: report this as a bug."))
}
