//! Verdicts on ratios, and frames of one plan.

use super::{Lab, Verdict};
use crate::error::Result;
use crate::lab::interleave::{Ratio, Series, Variant, accumulated, interleave};
use crate::render::picture::{Accumulated, Picture};
use crate::render::plan::Plan;
use crate::render::repeat::Repeated;
use crate::render::stage::Stage;
use crate::render::tally::Totals;

impl Ratio {
    /// Whether the ratio is below a threshold.
    pub fn below(&self, threshold: f64) -> Verdict {
        match self.ci95 {
            [_, high] if high < threshold => Verdict::Holds,
            [low, _] if low > threshold => Verdict::DoesNotHold,
            _ => Verdict::NotDecided,
        }
    }

    /// Whether it is above.
    pub fn above(&self, threshold: f64) -> Verdict {
        match self.ci95 {
            [low, _] if low > threshold => Verdict::Holds,
            [_, high] if high < threshold => Verdict::DoesNotHold,
            _ => Verdict::NotDecided,
        }
    }
}

impl Lab<'_> {
    /// Runs the variants' frames in turn.
    pub(super) fn interleave(&self, scene: &str, variants: &[Variant<'_>]) -> Result<Series> {
        interleave(self.device, self.quick, scene, variants)
    }

    /// Frames of one plan: what they came to, and what they traced.
    pub(super) fn frames(&self, plan: &Plan<'_>, frames: u32) -> Result<(Accumulated, Totals)> {
        let stage = Stage::new(self.device, plan)?;
        let mut repeated = Repeated::new(&stage)?;
        let mut totals = Totals::default();
        for _ in 0..frames {
            totals.add(&repeated.frame()?.totals);
        }
        Ok((accumulated(&stage, &repeated)?, totals))
    }

    /// The picture of so many frames.
    pub(super) fn picture(&self, plan: &Plan<'_>, frames: u32) -> Result<Picture> {
        let (accumulated, _) = self.frames(plan, frames)?;
        Ok(Picture::new(plan.tiles, &accumulated))
    }
}
