//! Runs a plan on a Vulkan device.

use std::time::Instant;

use super::band::Band;
use super::choices::{Accumulator, Passes};
use super::picture::Accumulated;
use super::plan::Plan;
use super::spans::Spans;
use super::stage::{Stage, Uploaded};
use super::tally::{KernelTime, Progress, Tally};
use crate::error::Result;
use crate::layout::{self, Carry, Count, RayRecord, Work};
use crate::vk::{Device, ImageFormat};

/// What came of a render.
#[derive(Clone, Debug)]
pub struct Outcome {
    pub accumulated: Accumulated,
    pub kernels: Vec<KernelTime>,
    pub primary_rays: u64,
    pub ambient_rays: u64,
    /// Rays that lost a part of the tree to a full stack (`--allow-overflow`).
    pub overflowed_rays: u64,
    /// Submits of work to the device.
    pub submits: u64,
    /// Pixels' work had to be taken up again this often (a driver's loop limit).
    pub repeats: u32,
}

/// Renders. `observe` hears of every finished submit.
pub fn run(device: &Device, plan: &Plan<'_>, observe: &mut dyn FnMut(&Progress)) -> Result<Outcome> {
    run_traced(device, plan, observe, None)
}

/// The same, and notes in `spans` what happened when.
pub fn run_traced(
    device: &Device,
    plan: &Plan<'_>,
    observe: &mut dyn FnMut(&Progress),
    spans: Option<&mut Spans>,
) -> Result<Outcome> {
    let mut tally = Tally::new(plan, observe);
    tally.spans = spans;
    let begin = Instant::now();
    let uploaded = Uploaded::new(device, plan)?;
    tally.phase("pack and upload", begin);
    let begin = Instant::now();
    let stage = Stage::with_uploaded(device, plan, uploaded)?;
    tally.phase("compile kernels", begin);
    let mut counts: Vec<Count> = Vec::new();
    for (begin, end) in bands(plan, device) {
        let start = Instant::now();
        let band = Band::new(&stage, begin, end)?;
        tally.phase("make buffers", start);
        band.render(plan.job.samples.clone(), &mut tally)?;
        let start = Instant::now();
        counts.extend(band.counts(plan.job.samples.len() as u64)?);
        tally.phase("read counts", start);
    }
    let begin = Instant::now();
    let accumulated = match (&stage.image, image_format(plan)) {
        (Some(image), Some(format)) => {
            Accumulated::Means(pixels_of(format, &image.read(device, format.bytes_per_pixel())?))
        }
        _ => Accumulated::Counts(counts),
    };
    if stage.image.is_some() {
        tally.phase("read image", begin);
    }
    Ok(Outcome {
        accumulated,
        kernels: tally.kernels.into_values().collect(),
        primary_rays: tally.totals.primary_finished,
        ambient_rays: tally.totals.ambient_finished,
        overflowed_rays: tally.totals.overflowed,
        submits: tally.submits,
        repeats: tally.repeats,
    })
}

pub(super) fn image_format(plan: &Plan<'_>) -> Option<ImageFormat> {
    match plan.settings.accumulator {
        Accumulator::Count => None,
        Accumulator::Rgba8 => Some(ImageFormat::Rgba8),
        Accumulator::Rgba32f => Some(ImageFormat::Rgba32f),
    }
}

/// An image's texels as floats.
pub(super) fn pixels_of(format: ImageFormat, bytes: &[u8]) -> Vec<[f32; 4]> {
    match format {
        ImageFormat::Rgba8 => {
            bytes.chunks_exact(4).map(|texel| [0, 1, 2, 3].map(|i| f32::from(texel[i]) / 255.0)).collect()
        }
        ImageFormat::Rgba32f => bytemuck::pod_collect_to_vec(bytes),
    }
}

/// Pixel ranges whose buffers a descriptor can show whole.
pub(super) fn bands(plan: &Plan<'_>, device: &Device) -> Vec<(u32, u32)> {
    let group = u64::from(layout::WORKGROUP_SIZE);
    let largest_record = match plan.settings.passes {
        Passes::Staged => size_of::<RayRecord>(),
        _ if plan.counts_work() => size_of::<Work>(),
        _ if plan.brute() => size_of::<Carry>(),
        _ => size_of::<Count>(),
    } as u64;
    let pixels = device.adapter().limits.storage_buffer_bytes / largest_record / group * group;
    let all = plan.tiles.padded_pixels();
    let mut bands = Vec::new();
    let mut begin = 0;
    while begin < all {
        let end = (begin + pixels.max(group)).min(all);
        // Padded pixel numbers fit 32 bits (`Plan::new`).
        bands.push((begin as u32, end as u32));
        begin = end;
    }
    bands
}
