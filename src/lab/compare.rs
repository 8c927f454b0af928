//! The same frames on OpenGL and on Vulkan, in turn.

use std::time::Instant;

use serde::Serialize;

use super::statistics::Median;
use crate::error::Result;
use crate::gl::TimerKind;
use crate::render::frames::Frames;

/// What two images differ by.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// Pixels that differ by more than 1/255.
    pub pixels_different: usize,
    /// Largest difference of a channel.
    pub max_difference: f32,
}

/// One method on both APIs.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    pub method: String,
    pub frames: u32,
    pub gl_ms_median: f64,
    pub gl_ms_ci95: [f64; 2],
    pub gl_timer: TimerKind,
    pub vk_ms_median: f64,
    pub vk_ms_ci95: [f64; 2],
    /// Vulkan time over OpenGL time, of frames that were rendered one after the other.
    pub ratio: f64,
    pub ratio_ci95: [f64; 2],
    #[serde(flatten)]
    pub difference: Difference,
}

/// The images of a row: mean and share of hits, row by row from the top.
pub struct Images {
    pub gl: Vec<[f32; 4]>,
    pub vk: Vec<[f32; 4]>,
}

/// How long a row may take on each API.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Frames to measure, if they fit.
    pub frames: u32,
    /// Frames that run before and are not measured.
    pub warm_up: u32,
    /// Seconds after which fewer frames will do, but no fewer than [`FEWEST`].
    pub patience_s: f64,
}

/// Fewest frames that are measured.
pub const FEWEST: u32 = 3;

/// Runs a method's frames on both APIs, interleaved one by one, the warm-up thrown away; then both start
/// again with the same seeds.
pub fn measure(
    method: &str,
    gl: &mut dyn Frames,
    vk: &mut dyn Frames,
    effort: &Effort,
) -> Result<(Row, Images)> {
    let start = Instant::now();
    let mut warmed = 0;
    while warmed < effort.warm_up.max(1) && (warmed == 0 || start.elapsed().as_secs_f64() < effort.patience_s)
    {
        gl.frame(warmed)?;
        vk.frame(warmed)?;
        warmed += 1;
    }
    let pair_s = start.elapsed().as_secs_f64() / f64::from(warmed);
    let fitting = (effort.patience_s / pair_s.max(1e-9)) as u32;
    let frames = effort.frames.min(fitting.max(FEWEST)).max(1);
    gl.restart()?;
    vk.restart()?;
    let (mut gl_ms, mut vk_ms) = (Vec::new(), Vec::new());
    for number in 0..frames {
        gl_ms.push(gl.frame(number)?);
        vk_ms.push(vk.frame(number)?);
    }
    let images = Images { gl: gl.image()?, vk: vk.image()? };
    let ratios: Vec<f64> = vk_ms.iter().zip(&gl_ms).map(|(vk, gl)| vk / gl.max(1e-9)).collect();
    let nothing = Median { median: 0.0, ci95: [0.0; 2] };
    let [gl, vk, ratio] = [&gl_ms, &vk_ms, &ratios].map(|values| Median::of(values).unwrap_or(nothing));
    let row = Row {
        method: method.to_string(),
        frames,
        gl_ms_median: gl.median,
        gl_ms_ci95: gl.ci95,
        gl_timer: TimerKind::Wall,
        vk_ms_median: vk.median,
        vk_ms_ci95: vk.ci95,
        ratio: ratio.median,
        ratio_ci95: ratio.ci95,
        difference: difference(&images),
    };
    Ok((row, images))
}

fn difference(images: &Images) -> Difference {
    let apart = |(a, b): (&[f32; 4], &[f32; 4])| (0..4).map(|i| (a[i] - b[i]).abs()).fold(0.0, f32::max);
    let differences = || images.gl.iter().zip(&images.vk).map(apart);
    Difference {
        // Bytes that are next to each other are 1/255 apart, give or take the rounding of that.
        pixels_different: differences().filter(|&difference| difference > 1.001 / 255.0).count(),
        max_difference: differences().fold(0.0, f32::max),
    }
}
