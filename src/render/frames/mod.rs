//! A plan run frame by frame as the original did: one dispatch over all pixels, four rays each, then the
//! next; on either API.

pub mod fragment;
pub mod opengl;
pub mod vulkan;

use crate::error::{Error, Result};
use crate::layout::{FRAME_SAMPLES, Range, STAGE_BOTH};
use crate::render::plan::Plan;
use crate::render::tally::Totals;

/// Something that renders frames into an image that it keeps.
pub trait Frames {
    /// Renders frame `number`, each after the one before; returns its milliseconds.
    fn frame(&mut self, number: u32) -> Result<f64>;
    /// Back to before frame 0.
    fn restart(&mut self) -> Result<()>;
    /// Mean and share of hits of each pixel, row by row.
    fn image(&mut self) -> Result<Vec<[f32; 4]>>;
}

/// The range of a frame.
fn range_of(plan: &Plan<'_>, number: u32) -> Range {
    Range {
        pixel_begin: 0,
        pixel_end: plan.tiles.padded_pixels() as u32,
        sample_begin: number * FRAME_SAMPLES,
        sample_end: (number + 1) * FRAME_SAMPLES,
        triangle_begin: 0,
        triangle_end: plan.frame.triangle_count,
        stage: STAGE_BOTH,
        set_begin: number * FRAME_SAMPLES,
        set_end: (number + 1) * FRAME_SAMPLES,
        ..Range::default()
    }
}

/// Workgroups of a frame, if one dispatch may have as many.
fn groups_of(plan: &Plan<'_>, limit: u32) -> Result<u32> {
    let groups = (plan.tiles.padded_pixels() / u64::from(crate::layout::WORKGROUP_SIZE)) as u32;
    if groups > limit {
        return Err(Error::usage(format!(
            "--size {}x{} is {groups} workgroups, and this device takes {limit} in one dispatch: choose a smaller size.",
            plan.job.size.0, plan.job.size.1
        )));
    }
    Ok(groups)
}

/// A frame must have finished every ray that it began.
fn check(plan: &Plan<'_>, totals: &Totals) -> Result<()> {
    match totals.missing() {
        0 => Ok(()),
        missing => Err(Error::device(format!(
            "{missing} rays of a frame did not come to their end with {} (the driver left a loop early): leave the \
             method out with --methods.",
            plan.settings.method
        ))),
    }
}
