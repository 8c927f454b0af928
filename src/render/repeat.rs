//! One plan's frames again and again, with everything in place: what a benchmark times. A frame is the next samples of
//! every pixel, as many as the plan's job has.

use super::band::Band;
use super::execute::bands;
use super::stage::Stage;
use super::tally::{KernelTime, Tally, Totals};
use crate::error::Result;
use crate::layout::Count;

/// What a frame cost.
#[derive(Clone, Debug)]
pub struct FrameCost {
    pub kernels: Vec<KernelTime>,
    /// Rays that were traced.
    pub totals: Totals,
    /// Times that pixels were taken up again because a driver left loops early.
    pub repeats: u32,
}

impl FrameCost {
    /// Summed kernel time.
    pub fn gpu_ms(&self) -> f64 {
        self.kernels.iter().map(|kernel| kernel.gpu_ms).sum()
    }
}

/// A stage and the pixels' state.
pub struct Repeated<'a> {
    stage: &'a Stage<'a>,
    bands: Vec<Band<'a>>,
    frames: u32,
    /// Samples of every pixel so far.
    samples: u32,
}

impl<'a> Repeated<'a> {
    pub fn new(stage: &'a Stage<'a>) -> Result<Self> {
        Self::over(stage, &[(0, u32::MAX)])
    }

    /// Only the pixels of these spans: numbers from `begin` to `end`, multiples of the workgroup's size, in order.
    pub fn over(stage: &'a Stage<'a>, spans: &[(u32, u32)]) -> Result<Self> {
        let mut made = Vec::new();
        for (first, last) in bands(stage.plan, stage.device) {
            for &(begin, end) in spans {
                let (begin, end) = (begin.max(first), end.min(last));
                if begin < end {
                    made.push(Band::new(stage, begin, end)?);
                }
            }
        }
        Ok(Self { stage, bands: made, frames: 0, samples: 0 })
    }

    /// Renders the next frame. Passes that keep the camera rays' hits trace them in the first frame only, and after
    /// [`Self::forget_hits`].
    pub fn frame(&mut self) -> Result<FrameCost> {
        let cost = self.advance(self.stage.plan.job.samples.len() as u32)?;
        self.frames += 1;
        Ok(cost)
    }

    /// Renders so many further samples, which are one set.
    pub fn advance(&mut self, samples: u32) -> Result<FrameCost> {
        let begin = self.stage.plan.job.samples.start + self.samples;
        let mut ignore = |_: &_| {};
        let mut tally = Tally::new(self.stage.plan, &mut ignore);
        for band in &self.bands {
            band.render(begin..begin + samples, &mut tally)?;
        }
        self.samples += samples;
        let Tally { totals, kernels, repeats, .. } = tally;
        Ok(FrameCost { kernels: kernels.into_values().collect(), totals, repeats })
    }

    /// Frames rendered so far.
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// As after a move of the camera.
    pub fn forget_hits(&self) {
        self.bands.iter().for_each(Band::forget_hits);
    }

    /// Counts of each pixel so far, in the order of the pixels' numbers; none where means are kept.
    pub fn counts(&self) -> Result<Vec<Count>> {
        let samples = u64::from(self.samples);
        let mut all = Vec::new();
        for band in &self.bands {
            all.extend(band.counts(|_| samples)?);
        }
        Ok(all)
    }
}
