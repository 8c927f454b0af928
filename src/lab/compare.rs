//! The same frames on OpenGL and on Vulkan, in turn.

use std::time::Instant;

use serde::Serialize;

use super::statistics::Median;
use crate::error::Result;
use crate::gl::TimerKind;
use crate::layout::FRAME_SAMPLES;
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

/// What the default choices take for many samples of the same picture, beside the fastest of the original's methods on OpenGL.
#[derive(Clone, Debug, Serialize)]
pub struct Auto {
    pub method: String,
    pub passes: String,
    /// Ambient rays of a camera ray.
    pub samples: u32,
    /// Time of all kernels for each sample of the picture, its camera ray's part included.
    pub ms_per_sample: f64,
    pub ms_per_sample_ci95: [f64; 2],
    /// Camera and ambient rays over the time of all kernels.
    pub mrays_per_s: f64,
    /// The row that is compared with.
    pub original: String,
    /// A frame of it over its samples.
    pub original_ms_per_sample: f64,
    pub times_as_fast: f64,
    /// From the ends of both intervals.
    pub times_as_fast_ci95: [f64; 2],
}

/// Renders of the picture by the default choices, all alike.
pub struct Renders {
    pub method: String,
    pub passes: String,
    pub samples: u32,
    /// Of each of them.
    pub rays: u64,
    /// Time of all kernels of each.
    pub gpu_ms: Vec<f64>,
}

impl Auto {
    /// None without a render or a row to compare with.
    pub fn beside(rows: &[&Row], renders: Renders) -> Option<Self> {
        let Renders { method, passes, samples, rays, gpu_ms } = renders;
        let original = rows.iter().min_by(|a, b| a.gl_ms_median.total_cmp(&b.gl_ms_median))?;
        let per_sample: Vec<f64> = gpu_ms.iter().map(|ms| ms / f64::from(samples)).collect();
        let Median { median, ci95: [low, high] } = Median::of(&per_sample)?;
        let of_frame = |ms: f64| ms / f64::from(FRAME_SAMPLES);
        let [gl_low, gl_high] = original.gl_ms_ci95.map(of_frame);
        Some(Self {
            method,
            passes,
            samples,
            ms_per_sample: median,
            ms_per_sample_ci95: [low, high],
            mrays_per_s: rays as f64 / (median * f64::from(samples)) / 1e3,
            original: original.method.clone(),
            original_ms_per_sample: of_frame(original.gl_ms_median),
            times_as_fast: of_frame(original.gl_ms_median) / median,
            times_as_fast_ci95: [gl_low / high, gl_high / low],
        })
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    fn row(method: &str, gl_ms: f64) -> Row {
        Row {
            method: method.into(),
            frames: 8,
            gl_ms_median: gl_ms,
            gl_ms_ci95: [0.9 * gl_ms, 1.2 * gl_ms],
            gl_timer: TimerKind::Wall,
            vk_ms_median: 1.0,
            vk_ms_ci95: [1.0; 2],
            ratio: 1.0,
            ratio_ci95: [1.0; 2],
            difference: Difference { pixels_different: 0, max_difference: 0.0 },
        }
    }

    #[test]
    fn a_sample_is_a_quarter_of_the_original_s_fastest_frame() {
        let rows = [row("stack64", 480.0), row("threaded", 400.0)];
        let renders = |gpu_ms: &[f64]| Renders {
            method: "bundle".into(),
            passes: "split".into(),
            samples: 64,
            rays: 128_000,
            gpu_ms: gpu_ms.to_vec(),
        };
        let rows: Vec<&Row> = rows.iter().collect();
        let auto = Auto::beside(&rows, renders(&[60.0, 64.0, 80.0])).unwrap();
        assert_eq!((auto.original.as_str(), auto.original_ms_per_sample), ("threaded", 100.0));
        assert_eq!((auto.ms_per_sample, auto.times_as_fast, auto.mrays_per_s), (1.0, 100.0, 2.0));
        assert_eq!(auto.ms_per_sample_ci95, [60.0 / 64.0, 1.25]);
        assert_eq!(auto.times_as_fast_ci95, [90.0 / 1.25, 120.0 / (60.0 / 64.0)]);
        assert!(Auto::beside(&[], renders(&[60.0])).is_none());
        assert!(Auto::beside(&rows, renders(&[])).is_none());
    }
}
