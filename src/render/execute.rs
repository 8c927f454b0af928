//! Runs a plan on a Vulkan device.

use super::band::{Band, Inputs};
use super::choices::Accumulator;
use super::picture::Accumulated;
use super::plan::Plan;
use super::schedule::Pace;
use super::tally::{KernelTime, Progress, Tally};
use crate::error::Result;
use crate::kernels::Kernel;
use crate::layout::{self, Carry, Count, Range, Work};
use crate::vk::{Batch, Buffer, BufferUse, Device, DeviceKind, Image, ImageFormat, Pipeline};

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
    Ok(run_kernel(device, plan, plan.kernel, observe)?.0)
}

/// Renders with a kernel that stands in for the plan's; what it wrote of each pixel's work, by pixel number, if it
/// counts that.
pub(super) fn run_kernel(
    device: &Device,
    plan: &Plan<'_>,
    kernel: &'static Kernel,
    observe: &mut dyn FnMut(&Progress),
) -> Result<(Outcome, Vec<Work>)> {
    let usage = if plan.texels { BufferUse::Texels } else { BufferUse::Storage };
    let nodes = Buffer::with_content(device, "nodes", usage, &plan.node_bytes())?;
    let triangles = Buffer::with_content(device, "triangles", usage, plan.triangle_bytes())?;
    let frame = Buffer::uniform(device, "frame", bytemuck::bytes_of(&plan.frame))?;
    let pipeline = Pipeline::new(device, kernel, &plan.constants, size_of::<Range>() as u32)?;
    let image = new_image(device, plan)?;
    let inputs = Inputs {
        device,
        plan,
        pipeline: &pipeline,
        nodes: &nodes,
        triangles: &triangles,
        frame: &frame,
        image: image.as_ref(),
        counts_work: kernel.bindings.iter().any(|(binding, _)| *binding == layout::BINDING_WORK),
        pace: pace(device),
    };
    let mut tally = Tally::new(plan, observe);
    let mut counts: Vec<Count> = Vec::new();
    let mut work: Vec<Work> = Vec::new();
    for (begin, end) in bands(&inputs) {
        let band = Band::new(&inputs, begin, end)?;
        counts.extend(band.render(&mut tally)?);
        work.extend(band.work()?);
    }
    let accumulated = match (&image, image_format(plan)) {
        (Some(image), Some(format)) => {
            Accumulated::Means(pixels_of(format, &image.read(device, format.bytes_per_pixel())?))
        }
        _ => Accumulated::Counts(counts),
    };
    let outcome = Outcome {
        accumulated,
        kernels: tally.kernels.into_values().collect(),
        primary_rays: tally.totals.primary_finished,
        ambient_rays: tally.totals.ambient_finished,
        overflowed_rays: tally.totals.overflowed,
        submits: tally.submits,
        repeats: tally.repeats,
    };
    Ok((outcome, work))
}

pub(super) fn image_format(plan: &Plan<'_>) -> Option<ImageFormat> {
    match plan.settings.accumulator {
        Accumulator::Count => None,
        Accumulator::Rgba8 => Some(ImageFormat::Rgba8),
        Accumulator::Rgba32f => Some(ImageFormat::Rgba32f),
    }
}

fn new_image(device: &Device, plan: &Plan<'_>) -> Result<Option<Image>> {
    let Some(format) = image_format(plan) else { return Ok(None) };
    let image = Image::new(device, "mean image", format, plan.job.size)?;
    let mut batch = Batch::new(device, 0)?;
    batch.clear_image(&image);
    batch.submit()?;
    batch.wait()?;
    Ok(Some(image))
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
fn bands(inputs: &Inputs<'_>) -> Vec<(u32, u32)> {
    let Inputs { device, plan, .. } = *inputs;
    let group = u64::from(layout::WORKGROUP_SIZE);
    let carried = if plan.brute() { size_of::<Carry>() } else { 0 };
    let counted = if inputs.counts_work { size_of::<Work>() } else { 0 };
    let largest_record = size_of::<Count>().max(carried).max(counted) as u64;
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

/// What a device is expected to do before it was measured: for GPUs that may be integrated, slow enough to stay
/// far from the two seconds after which drivers give up.
fn pace(device: &Device) -> Pace {
    let adapter = device.adapter();
    let (rays_per_ms, dispatch_ms, submit_ms, samples) = match adapter.kind {
        DeviceKind::Discrete => (4e5, 100.0, 200.0, 16),
        DeviceKind::Integrated | DeviceKind::Virtual | DeviceKind::Other => (3e4, 50.0, 100.0, 16),
        DeviceKind::Cpu => (1e3, 100.0, 250.0, 1024),
    };
    let limits = &adapter.limits;
    Pace {
        rays_per_ms,
        dispatch_ms,
        submit_ms,
        samples,
        workgroups: limits.workgroups,
        loop_iterations: limits.loop_iterations,
    }
}
