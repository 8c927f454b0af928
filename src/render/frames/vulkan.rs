//! Frames on Vulkan.

use super::{Frames, check, groups_of, range_of};
use crate::error::Result;
use crate::layout::{self, Counters, Range};
use crate::render::execute::{image_format, pixels_of};
use crate::render::plan::Plan;
use crate::render::seeds::lcg_seeds;
use crate::render::tally::Totals;
use crate::vk::{Access, Batch, Binding, BoundKernel, Buffer, BufferUse, Device, Hazard, Image, Pipeline};

/// What the frames of a plan work on.
pub struct Stage<'a> {
    device: &'a Device,
    plan: &'a Plan<'a>,
    pipeline: Pipeline,
    nodes: Buffer,
    triangles: Buffer,
    frame: Buffer,
    unused: Buffer,
    carry: Buffer,
    counters: Buffer,
    seeds: Buffer,
    first_seeds: Buffer,
    image: Image,
}

impl<'a> Stage<'a> {
    /// The plan's accumulator must be an image and its accessor the storage buffer, as in the original.
    pub fn new(device: &'a Device, plan: &'a Plan<'a>) -> Result<Self> {
        let storage = |name, content: &[u8]| Buffer::with_content(device, name, BufferUse::Storage, content);
        let states = lcg_seeds(0, plan.tiles.padded_pixels() as u32, plan.job.seed);
        let counter_bytes = (layout::COUNTER_SLOTS as usize * size_of::<Counters>()) as u64;
        let format = image_format(plan).unwrap_or(crate::vk::ImageFormat::Rgba8);
        Ok(Self {
            pipeline: Pipeline::new(device, plan.kernel(), &plan.constants, size_of::<Range>() as u32)?,
            nodes: storage("nodes", &plan.node_bytes())?,
            triangles: storage("triangles", plan.triangle_bytes())?,
            frame: Buffer::uniform(device, "frame", bytemuck::bytes_of(&plan.frame))?,
            unused: storage("unused", &[0; 16])?,
            carry: storage("carry", &[0; 32])?,
            counters: Buffer::new(device, "counters", BufferUse::Storage, counter_bytes)?,
            seeds: storage("seeds", bytemuck::cast_slice(&states))?,
            first_seeds: storage("first seeds", bytemuck::cast_slice(&states))?,
            image: Image::new(device, "mean image", format, plan.job.size)?,
            device,
            plan,
        })
    }

    pub fn bind(&self) -> Result<VulkanFrames<'_>> {
        let kernel = self.pipeline.bind(&[
            (layout::BINDING_FRAME, Binding::Buffer(&self.frame)),
            (layout::BINDING_NODES, Binding::Buffer(&self.nodes)),
            (layout::BINDING_TRIANGLES, Binding::Buffer(&self.triangles)),
            (layout::BINDING_COUNTS, Binding::Buffer(&self.unused)),
            (layout::BINDING_IMAGE, Binding::Image(&self.image)),
            (layout::BINDING_SEEDS, Binding::Buffer(&self.seeds)),
            (layout::BINDING_CARRY, Binding::Buffer(&self.carry)),
            (layout::BINDING_BUDGETS, Binding::Buffer(&self.unused)),
            (layout::BINDING_COUNTERS, Binding::Buffer(&self.counters)),
        ])?;
        let mut frames = VulkanFrames { stage: self, kernel };
        frames.restart()?;
        Ok(frames)
    }
}

/// A stage with its descriptors.
pub struct VulkanFrames<'a> {
    stage: &'a Stage<'a>,
    kernel: BoundKernel<'a>,
}

impl Frames for VulkanFrames<'_> {
    fn frame(&mut self, number: u32) -> Result<f64> {
        let Stage { device, plan, counters, .. } = self.stage;
        let groups = groups_of(plan, device.adapter().limits.workgroups)?;
        let mut batch = Batch::new(device, 1)?;
        batch.fill(counters, 0);
        batch.barrier(&[
            Hazard::Buffer(counters, Access::TransferWrite, Access::ShaderWrite),
            Hazard::Buffer(&self.stage.seeds, Access::ShaderWrite, Access::ShaderWrite),
            Hazard::Image(&self.stage.image, Access::ShaderWrite, Access::ShaderWrite),
        ]);
        let start = std::time::Instant::now();
        batch.dispatch(
            &self.kernel,
            bytemuck::bytes_of(&range_of(plan, number)),
            [groups, 1, 1],
            self.kernel.name(),
        );
        batch.submit()?;
        let finished = batch.wait()?;
        let wall_ms = start.elapsed().as_secs_f64() * 1e3;
        check(plan, &Totals::of(&bytemuck::pod_collect_to_vec::<u8, Counters>(&counters.read(device)?)))?;
        Ok(finished.timings.first().and_then(|timing| timing.gpu_ms).unwrap_or(wall_ms))
    }

    fn restart(&mut self) -> Result<()> {
        let Stage { device, seeds, first_seeds, image, .. } = self.stage;
        let mut batch = Batch::new(device, 0)?;
        batch.clear_image(image);
        batch.barrier(&[
            Hazard::Buffer(seeds, Access::ShaderWrite, Access::TransferWrite),
            Hazard::Buffer(first_seeds, Access::TransferWrite, Access::TransferRead),
        ]);
        batch.copy(first_seeds, seeds, 0, seeds.bytes());
        batch.barrier(&[Hazard::Buffer(seeds, Access::TransferWrite, Access::ShaderWrite)]);
        batch.submit()?;
        batch.wait()?;
        Ok(())
    }

    fn image(&mut self) -> Result<Vec<[f32; 4]>> {
        let Stage { device, plan, image, .. } = self.stage;
        let format = image_format(plan).unwrap_or(crate::vk::ImageFormat::Rgba8);
        Ok(pixels_of(format, &image.read(device, format.bytes_per_pixel())?))
    }
}
