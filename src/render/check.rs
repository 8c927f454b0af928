//! What a plan may not ask for: what its choices or the device's limits rule out.

use super::choices::{Accumulator, Intersector, Method, Passes, Settings};
use super::plan::Job;
use super::rounds::Goal;
use super::schedule::{brute_frame_limit, brute_part};
use crate::error::{Error, Result};
use crate::layout::{self, Frame};
use crate::vk::Limits;

/// Farthest eye, in largest coordinates of the scene, which is twice as wide.
const FARTHEST: f32 = 2e6;
/// Smallest change of a ray's direction from pixel to pixel, as a part of it: some steps of a 32-bit float.
const SMALLEST_STEP: f32 = 4.0 * f32::EPSILON;

/// The camera must be one that 32-bit floats can hold.
pub(super) fn check_frame(frame: &Frame) -> Result<()> {
    let length = |v: [f32; 3]| glam::Vec3::from(v).length();
    let origins = [frame.origin, frame.origin_dx, frame.origin_dy];
    let far =
        origins.iter().any(|&v| length(v) > FARTHEST * frame.largest) || length(frame.direction) > FARTHEST;
    if far || !origins.iter().chain([&frame.direction]).all(|v| glam::Vec3::from(*v).is_finite()) {
        return Err(Error::usage(
            "The eye is more than a million times the scene's size away, where 32-bit floats see nothing of it: move it \
             closer.",
        ));
    }
    let step = length(frame.direction_dx).min(length(frame.direction_dy));
    if step < length(frame.direction) * SMALLEST_STEP {
        return Err(Error::usage(
            "The pixels are too close together for 32-bit floats to tell their rays apart: choose a larger --fov or a \
             smaller --size.",
        ));
    }
    Ok(())
}

/// A running mean takes its frames whole, and kept hits are found whole, so those rays must fit one dispatch.
pub(super) fn check_brute(settings: &Settings, frame: &Frame, limits: &Limits) -> Result<()> {
    if settings.method != Method::Brute {
        return Ok(());
    }
    let refuse = |what: &str, most: u32, choose: &str| {
        Err(Error::usage(format!(
            "brute with {what} tests {} triangles for each ray, and this device takes {most} in one dispatch: choose \
             {choose} or another --method.",
            frame.triangle_count
        )))
    };
    let most = brute_frame_limit(limits.loop_iterations);
    if settings.accumulator != Accumulator::Count && frame.triangle_count > most {
        return refuse(settings.accumulator.name(), most, "--accumulator count");
    }
    let most = brute_part(limits.loop_iterations);
    if settings.passes != Passes::Single && frame.triangle_count > most {
        return refuse(settings.passes.name(), most, "--passes single");
    }
    Ok(())
}

pub(super) fn check_job(job: &Job, settings: &Settings, limits: &Limits) -> Result<()> {
    let side = limits.image_side;
    if job.size.0.max(job.size.1) > side {
        return Err(Error::usage(format!(
            "--size {}x{} is beyond this device's limit of {side} pixels a side: choose a smaller size.",
            job.size.0, job.size.1
        )));
    }
    if job.tiles().numbers() > u64::from(u32::MAX) {
        return Err(Error::usage(format!(
            "--size {}x{} has more than 2^32 camera rays: choose a smaller size.",
            job.size.0, job.size.1
        )));
    }
    let samples = job.samples.len() as u32;
    let counts = settings.accumulator == Accumulator::Count;
    let needs_counts = match job.goal {
        Goal::Rmse(_) => Some("--target-rmse"),
        Goal::Time(_) => Some("--time"),
        Goal::Samples if job.adaptive => Some("--adaptive"),
        Goal::Samples if job.jitters > 1 => Some("--antialias"),
        Goal::Samples => None,
    };
    if let (Some(option), false) = (needs_counts, counts) {
        return Err(Error::usage(format!(
            "{option} needs exact counts, and {} is a running mean: choose --accumulator count.",
            settings.accumulator.name()
        )));
    }
    if job.adaptive && settings.preset.is_original() {
        return Err(Error::usage(
            "The original gives each pixel the same number of rays: leave --adaptive or --preset out.",
        ));
    }
    if settings.preset.is_original() && settings.intersector == Intersector::Conservative {
        return Err(Error::usage(
            "The original's intersector grants no errors: choose --intersector moller or watertight, or leave --preset out.",
        ));
    }
    if settings.preset.is_original() && !samples.is_multiple_of(layout::FRAME_SAMPLES) {
        return Err(Error::usage(format!(
            "The original traces {} rays a frame: choose a multiple of it for each camera ray's rays (--spp, over --antialias), not {samples}.",
            layout::FRAME_SAMPLES
        )));
    }
    Ok(())
}
