//! A plan on a device: its kernels compiled, its scene uploaded.

use std::rc::Rc;
use std::thread;

use rayon::prelude::*;

use super::auto;
use super::choices::Passes;
use super::execute::{image_format, pixels_of};
use super::geometry::Geometry;
use super::plan::Plan;
use super::schedule::Pace;
use crate::error::{Error, Result, joined};
use crate::kernels::NodeLayout;
use crate::layout::{Frame, Range};
use crate::vk::{Batch, Buffer, BufferUse, Device, DeviceKind, Image, Pipeline, PipelineStatistics};

/// The scene's arrays on a device; plans that read the same ones may share them.
#[derive(Clone)]
pub struct Uploaded {
    pub nodes: Rc<Buffer>,
    pub triangles: Rc<Buffer>,
}

impl Uploaded {
    pub fn new(device: &Device, plan: &Plan<'_>) -> Result<Self> {
        // Nodes are packed while triangles travel.
        let (nodes, triangles) = thread::scope(|scope| {
            let packing = scope.spawn(|| Ok(plan.node_bytes()));
            let triangles = Buffer::with_content(device, "triangles", usage_of(plan), plan.triangle_bytes())?;
            Ok::<_, Error>((joined(packing)?, triangles))
        })?;
        Ok(Self { nodes: Self::upload_nodes(device, plan, &nodes)?, triangles: Rc::new(triangles) })
    }

    /// The plan's frame, for kernels that read these arrays.
    pub fn frame(&self, device: &Device, plan: &Plan<'_>) -> Result<Buffer> {
        frame_buffer(device, plan.frame, &self.nodes, &self.triangles)
    }

    fn upload_nodes(device: &Device, plan: &Plan<'_>, nodes: &[u8]) -> Result<Rc<Buffer>> {
        Ok(Rc::new(Buffer::with_content(device, "nodes", usage_of(plan), nodes)?))
    }
}

/// The frame as kernels take it: with the device addresses of the arrays, where they have any.
fn frame_buffer(device: &Device, frame: Frame, nodes: &Buffer, triangles: &Buffer) -> Result<Buffer> {
    let halves = |buffer: &Buffer| {
        let address = buffer.address().unwrap_or(0);
        (address as u32, (address >> 32) as u32)
    };
    let (nodes_low, nodes_high) = halves(nodes);
    let (triangles_low, triangles_high) = halves(triangles);
    let frame = Frame { nodes_low, nodes_high, triangles_low, triangles_high, ..frame };
    Buffer::uniform(device, "frame", bytemuck::bytes_of(&frame))
}

fn usage_of(plan: &Plan<'_>) -> BufferUse {
    if plan.texels() { BufferUse::Texels } else { BufferUse::Addressed }
}

/// Arrays that were uploaded, found again by plans that read the same ones: geometry, layout of nodes, growth of
/// boxes and whether they are texel buffers are theirs.
#[derive(Default)]
pub struct Uploads {
    known: Vec<(Key, Uploaded)>,
}

/// What the arrays follow from; of the growth of boxes, the bits.
#[derive(Clone, Copy, PartialEq)]
struct Key {
    geometry: *const Geometry,
    texels: bool,
    corners: bool,
    layout: NodeLayout,
    faces: Option<(u32, u64)>,
    pad: u32,
}

impl Uploads {
    /// The plan's arrays, uploaded now if they are not there.
    pub fn of(&mut self, device: &Device, plan: &Plan<'_>) -> Result<Uploaded> {
        let key = Key {
            geometry: plan.geometry,
            texels: plan.texels(),
            corners: plan.corners.is_some(),
            layout: plan.node_layout(),
            faces: plan.face_measures().map(|(pad, size)| (pad.to_bits(), size.to_bits())),
            pad: plan.node_pad().to_bits(),
        };
        if let Some((_, uploaded)) = self.known.iter().find(|(known, _)| *known == key) {
            return Ok(uploaded.clone());
        }
        let same = |known: &Key| {
            known.geometry == key.geometry && known.texels == key.texels && known.corners == key.corners
        };
        let uploaded = match self.known.iter().find(|(known, _)| same(known)) {
            Some((_, there)) => Uploaded {
                nodes: Uploaded::upload_nodes(device, plan, &plan.node_bytes())?,
                triangles: there.triangles.clone(),
            },
            None => Uploaded::new(device, plan)?,
        };
        self.known.push((key, uploaded.clone()));
        Ok(uploaded)
    }

    /// Frees what no stage uses any more.
    pub fn forget_unused(&mut self) {
        self.known.retain(|(_, uploaded)| Rc::strong_count(&uploaded.nodes) > 1);
    }
}

/// What the driver's compiler tells of the kernel that traces a plan's ambient rays, compiled for this alone; `None`
/// where the device doesn't tell.
pub fn traversal_statistics(device: &Device, plan: &Plan<'_>) -> Result<Option<PipelineStatistics>> {
    if !device.adapter().features.contains(&("pipeline statistics", true)) {
        return Ok(None);
    }
    let place = match plan.settings.passes {
        Passes::Single => 0,
        Passes::Split => 2,
        Passes::Staged => 4,
    };
    let Some(kernel) = plan.kernels.get(place) else { return Ok(None) };
    Pipeline::with_statistics(device, kernel, &plan.constants, size_of::<Range>() as u32)?.statistics()
}

/// What all bands of a render share.
pub struct Stage<'a> {
    pub device: &'a Device,
    pub plan: &'a Plan<'a>,
    /// Of the plan's kernels.
    pub pipelines: Vec<Pipeline>,
    pub nodes: Rc<Buffer>,
    pub triangles: Rc<Buffer>,
    pub frame: Buffer,
    /// Seed of the random numbers.
    pub seed: u32,
    /// Running means, where they are kept.
    pub image: Option<Image>,
    pub pace: Pace,
}

/// A plan's kernels, made ready for the device, several at once where there are threads for it.
pub fn compile(device: &Device, plan: &Plan<'_>) -> Result<Vec<Pipeline>> {
    for kernel in &plan.kernels {
        auto::check_subgroup(kernel, device.adapter())?;
    }
    let one = |kernel: &&'static _| Pipeline::new(device, kernel, &plan.constants, size_of::<Range>() as u32);
    plan.kernels.par_iter().map(one).collect()
}

impl<'a> Stage<'a> {
    pub fn new(device: &'a Device, plan: &'a Plan<'a>) -> Result<Self> {
        Self::with_uploaded(device, plan, Uploaded::new(device, plan)?)
    }

    /// With arrays that are there already; they must be the plan's.
    pub fn with_uploaded(device: &'a Device, plan: &'a Plan<'a>, uploaded: Uploaded) -> Result<Self> {
        Self::with(device, plan, uploaded, compile(device, plan)?)
    }

    /// With arrays and kernels that are there already; they must be the plan's.
    pub fn with(
        device: &'a Device,
        plan: &'a Plan<'a>,
        uploaded: Uploaded,
        pipelines: Vec<Pipeline>,
    ) -> Result<Self> {
        Ok(Self {
            device,
            plan,
            pipelines,
            frame: uploaded.frame(device, plan)?,
            nodes: uploaded.nodes,
            triangles: uploaded.triangles,
            seed: plan.frame.seed,
            image: new_image(device, plan)?,
            pace: pace(device, plan),
        })
    }

    /// Takes other random numbers from now on; nothing may be under way.
    pub fn reseed(&mut self, seed: u32) -> Result<()> {
        let frame = Frame { seed, ..self.plan.frame };
        self.frame = frame_buffer(self.device, frame, &self.nodes, &self.triangles)?;
        self.seed = seed;
        Ok(())
    }

    /// Running means of each pixel and its share of hits (in the fourth channel), row by row; none where rays are
    /// counted.
    pub fn means(&self) -> Result<Option<Vec<[f32; 4]>>> {
        let Some((image, format)) = self.image.as_ref().zip(image_format(self.plan)) else { return Ok(None) };
        Ok(Some(pixels_of(format, &image.read(self.device, format.bytes_per_pixel())?)))
    }

    /// Goes on with the running means of another stage, whose picture must have the same size and format.
    pub fn take_means_of(&mut self, other: Stage<'_>) {
        self.image = other.image;
    }
}

/// What the device's compiler tells of each of the plan's kernels; none where the device doesn't tell.
pub fn statistics(device: &Device, plan: &Plan<'_>) -> Result<Vec<PipelineStatistics>> {
    let mut found = Vec::new();
    for &kernel in &plan.kernels {
        let push_bytes = size_of::<Range>() as u32;
        found.extend(Pipeline::with_statistics(device, kernel, &plan.constants, push_bytes)?.statistics()?);
    }
    Ok(found)
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

/// What a device is expected to do before it was measured: for GPUs that may be integrated, slow enough to stay
/// far from the two seconds after which drivers give up.
fn pace(device: &Device, plan: &Plan<'_>) -> Pace {
    let adapter = device.adapter();
    let (rays_per_ms, dispatch_ms, submit_ms, samples, least_workgroups) = match adapter.kind {
        DeviceKind::Discrete => (4e5, 100.0, 200.0, 16, 1024),
        DeviceKind::Integrated | DeviceKind::Virtual | DeviceKind::Other => (3e4, 50.0, 100.0, 16, 128),
        DeviceKind::Cpu => (4e3, 100.0, 250.0, 1024, 1),
    };
    // Where the work of a pixel is spread over many invocations, no long pixel holds up a dispatch.
    let samples = if plan.settings.passes == Passes::Single { samples } else { 1024 };
    let limits = &adapter.limits;
    Pace {
        rays_per_ms,
        dispatch_ms,
        submit_ms,
        samples,
        least_workgroups,
        workgroups: (limits.workgroups / plan.sample_lanes()).max(1),
        // Rays that go together share their iterations.
        loop_iterations: limits
            .loop_iterations
            .filter(|_| !plan.tuning.unguarded)
            .map(|limit| limit.saturating_mul(plan.rays_together())),
    }
}
