//! Adding up frames: what the random numbers and a moved camera do to the picture.

use super::{Evidence, FIGURES, Lab, Verdict};
use crate::bvh::Builder;
use crate::error::Result;
use crate::lab::figure::Figure;
use crate::lab::ghosts::without_reset;
use crate::lab::interleave::digits;
use crate::layout::FRAME_SAMPLES;
use crate::render::choices::{Accumulator, Preset, Sampler, Wishes};
use crate::render::picture::{Accumulated, Picture};
use crate::render::plan::Job;
use crate::render::repeat::Repeated;
use crate::render::stage::Stage;
use crate::scene::camera::Camera;

/// Frames after which the error is taken.
const AFTER: [u32; 4] = [1, 4, 16, 64];
/// Rays a pixel of the picture that errors are taken against.
const REFERENCE: u32 = 4096;
const QUICK_REFERENCE: u32 = 1024;
/// Slopes of log error over log frames: independent numbers give -1/2, the same ones 0.
const FALLS: f64 = -0.4;
const STAYS: f64 = -0.05;

/// The error after some frames with the same samples in all of them and with the next ones in each.
pub fn same_seeds(lab: &Lab<'_>) -> Result<Evidence> {
    let geometry = lab.geometry(&lab.cornell, Preset::Auto, Builder::Sah)?;
    let job = Job { size: lab.smaller(4), ..lab.job(&lab.cornell, lab.size) };
    // Independent numbers, as the original's were to be.
    let wishes = Wishes { sampler: Some(Sampler::Pcg), ..Wishes::default() };
    let plan = |job| lab.plan_job(job, &lab.cornell, &geometry, &wishes);
    let rays = if lab.quick { QUICK_REFERENCE } else { REFERENCE };
    let reference = Job { samples: 0..rays, seed: lab.seed.wrapping_add(1), ..job.clone() };
    let reference = lab.picture(&plan(reference)?, 1)?;
    let plan = plan(job)?;
    let stage = Stage::new(lab.device, &plan)?;
    let light = |repeated: &Repeated<'_>| -> Result<Vec<f32>> {
        let counts = Accumulated::Counts(repeated.counts()?);
        Ok(Picture::new(plan.tiles, &counts).light)
    };
    let mut fresh = Repeated::new(&stage)?;
    let mut sums = vec![0.0f64; reference.light.len()];
    let mut errors = [Vec::new(), Vec::new()];
    for frame in 1..=AFTER[AFTER.len() - 1] {
        fresh.frame()?;
        let mut same = Repeated::new(&stage)?;
        same.frame()?;
        sums.iter_mut().zip(light(&same)?).for_each(|(sum, light)| *sum += f64::from(light));
        if AFTER.contains(&frame) {
            let mean: Vec<f32> = sums.iter().map(|sum| (sum / f64::from(frame)) as f32).collect();
            errors[0].push(rmse(&mean, &reference));
            errors[1].push(rmse(&light(&fresh)?, &reference));
        }
    }
    let [same, falling] = [slope(&errors[0]), slope(&errors[1])];
    let verdict = match () {
        () if same > STAYS && falling < FALLS => Verdict::Holds,
        () if same < FALLS => Verdict::DoesNotHold,
        () => Verdict::NotDecided,
    };
    let list = |errors: &[f64]| errors.iter().map(|error| digits(*error)).collect::<Vec<_>>().join(", ");
    let measured = format!(
        "root mean square error after 1, 4, 16 and 64 frames of 4 rays, against {rays} rays a pixel: {} with the same \
         numbers (frames^{same:.2}), {} with fresh ones (frames^{falling:.2})",
        list(&errors[0]),
        list(&errors[1])
    );
    Ok(Evidence::new(verdict, measured)
        .number("slope_same", same)
        .number("slope_fresh", falling)
        .number("rmse_same", errors[0].clone())
        .number("rmse_fresh", errors[1].clone()))
}

/// Over the pixels that see the scene.
fn rmse(light: &[f32], reference: &Picture) -> f64 {
    let (mut sum, mut pixels) = (0.0, 0u32);
    for ((light, truth), coverage) in light.iter().zip(&reference.light).zip(&reference.coverage) {
        if *coverage > 0.0 {
            sum += f64::from(light - truth).powi(2);
            pixels += 1;
        }
    }
    (sum / f64::from(pixels.max(1))).sqrt()
}

/// Slope of log error over log frames, by least squares.
fn slope(errors: &[f64]) -> f64 {
    let points =
        AFTER.iter().zip(errors).map(|(&frames, error)| (f64::from(frames).ln(), error.max(1e-12).ln()));
    let points: Vec<(f64, f64)> = points.collect();
    let n = points.len() as f64;
    let [mx, my] = [points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n];
    let over: f64 = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum();
    let under: f64 = points.iter().map(|p| (p.0 - mx).powi(2)).sum();
    over / under
}

/// Frames before and after the move of the camera.
const GHOST_FRAMES: u32 = 64;
const QUICK_GHOST_FRAMES: u32 = 16;
/// How far the camera orbits in between, degrees.
const TURN: f64 = 15.0;
/// A difference of 8-bit values that the eye may see.
const SEEN: f32 = 2.0 / 255.0;

/// Running means that go on after the camera has moved, against means of one camera; and once more with other random
/// numbers in the place of the move, for what is noise.
pub fn ghosts(lab: &Lab<'_>) -> Result<Evidence> {
    let scene = &lab.maison;
    let frames = if lab.quick { QUICK_GHOST_FRAMES } else { GHOST_FRAMES };
    let geometry = lab.geometry(scene, Preset::Original, Builder::Midpoint)?;
    let wishes = Wishes {
        preset: Some(Preset::Original),
        accumulator: Some(Accumulator::Rgba32f),
        sampler: Some(Sampler::Pcg),
        ..Wishes::default()
    };
    let plan = |turn: f64, first_frame: u32, seed: u32| {
        let first = first_frame * FRAME_SAMPLES;
        let job = Job {
            camera: Camera::Orbit { rx: 20.0, ry: 140.0 + turn },
            samples: first..first + FRAME_SAMPLES,
            seed: lab.seed.wrapping_add(seed),
            ..lab.job(scene, lab.size)
        };
        lab.plan_job(job, scene, &geometry, &wishes)
    };
    let second = plan(TURN, frames, 0)?;
    let after = |turn: f64, seed: u32| -> Result<Picture> {
        without_reset(lab.device, &plan(turn, 0, seed)?, &second, frames)
    };
    let (ghost, clean, noise) = (after(0.0, 0)?, after(TURN, 0)?, after(TURN, 1)?);
    let pairs = |other: &Picture| -> Vec<(f32, f32)> {
        clean.light.iter().copied().zip(other.light.iter().copied()).collect()
    };
    let apart = |other: &Picture| {
        let far = pairs(other).iter().filter(|(a, b)| (a - b).abs() > SEEN).count();
        far as f64 / clean.light.len() as f64
    };
    let (by_ghost, by_noise) = (apart(&ghost), apart(&noise));
    // Where nothing is to be seen there is no noise either.
    let empty = clean.coverage.iter().filter(|coverage| **coverage == 0.0).count();
    let haunted = pairs(&ghost)
        .iter()
        .zip(&clean.coverage)
        .filter(|((_, light), coverage)| **coverage == 0.0 && *light > SEEN)
        .count();
    let verdict = Verdict::of(haunted > 0);
    let measured = format!(
        "after {frames} frames from one side and {frames} from another, {TURN} degrees away, without a reset, \
         {:.1}% of the pixels are off by more than 2/255, where other random numbers instead of the move put {:.1}% off; \
         {haunted} of {empty} pixels without a surface show one",
        by_ghost * 100.0,
        by_noise * 100.0
    );
    let grey = |picture: &Picture, x: u32, y: u32| [picture.light[(y * picture.width + x) as usize]; 3];
    let panels: [&dyn Fn(u32, u32) -> [f32; 3]; 2] = [&|x, y| grey(&ghost, x, y), &|x, y| grey(&clean, x, y)];
    Ok(Evidence::new(verdict, measured)
        .number("share_off", by_ghost)
        .number("share_off_by_noise", by_noise)
        .number("empty_pixels", empty)
        .number("empty_pixels_lit", haunted)
        .figure(Figure::beside(FIGURES[0], lab.size, &panels)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_of_known_errors() {
        let errors = |power: f64| AFTER.map(|frames| 0.3 * f64::from(frames).powf(power));
        for power in [0.0, -0.5, -1.0] {
            assert!((slope(&errors(power)) - power).abs() < 1e-12);
        }
    }
}
