//! Work for the device: dispatches, copies, barriers and timestamps, recorded once and submitted once.

use std::sync::{Arc, PoisonError};

use ash::vk;

use super::buffer::Buffer;
use super::device::{Device, Shared};
use super::failed;
use super::image::{Image, whole_image};
use super::kernel::BoundKernel;
use super::raster::Raster;
use crate::error::Result;

/// How a stage touches a resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    HostRead,
    /// The sizes of an indirect dispatch.
    IndirectRead,
    TransferRead,
    TransferWrite,
    ShaderRead,
    /// Reads and writes by kernels.
    ShaderWrite,
}

impl Access {
    fn raw(self) -> (vk::PipelineStageFlags, vk::AccessFlags) {
        use vk::{AccessFlags as A, PipelineStageFlags as S};
        match self {
            Self::HostRead => (S::HOST, A::HOST_READ),
            Self::IndirectRead => (S::DRAW_INDIRECT, A::INDIRECT_COMMAND_READ),
            Self::TransferRead => (S::TRANSFER, A::TRANSFER_READ),
            Self::TransferWrite => (S::TRANSFER, A::TRANSFER_WRITE),
            Self::ShaderRead => (S::COMPUTE_SHADER, A::SHADER_READ),
            Self::ShaderWrite => (S::COMPUTE_SHADER, A::SHADER_READ | A::SHADER_WRITE),
        }
    }
}

/// A dependency between two uses of one resource.
#[derive(Clone, Copy)]
pub enum Hazard<'a> {
    Buffer(&'a Buffer, Access, Access),
    Image(&'a Image, Access, Access),
}

/// The time of one dispatch.
#[derive(Clone, Debug, PartialEq)]
pub struct Timing {
    pub label: String,
    /// Device time from the start of the dispatch to its end, ms; `None` on a device without timestamps.
    pub gpu_ms: Option<f64>,
}

/// What came of a batch.
#[derive(Clone, Debug, Default)]
pub struct Finished {
    pub timings: Vec<Timing>,
}

/// A command buffer with its fence and its timestamps. What it uses must outlive it; it waits for the
/// device before it goes.
pub struct Batch<'a> {
    pool: vk::CommandPool,
    commands: vk::CommandBuffer,
    fence: vk::Fence,
    timestamps: vk::QueryPool,
    /// Most dispatches that can be timed.
    capacity: u32,
    labels: Vec<String>,
    submitted: bool,
    device: Arc<Shared>,
    used: std::marker::PhantomData<&'a ()>,
}

impl<'a> Batch<'a> {
    /// Starts recording. `dispatches`: how many there will be at most.
    pub fn new(device: &Device, dispatches: u32) -> Result<Self> {
        let shared = device.shared.clone();
        let mut batch = Self {
            pool: vk::CommandPool::null(),
            commands: vk::CommandBuffer::null(),
            fence: vk::Fence::null(),
            timestamps: vk::QueryPool::null(),
            capacity: if shared.adapter.timestamps.is_some() { dispatches.max(1) } else { 0 },
            labels: Vec::new(),
            submitted: false,
            device: shared.clone(),
            used: std::marker::PhantomData,
        };
        batch.begin().map_err(|result| failed("Starting work for the device", result))?;
        Ok(batch)
    }

    fn begin(&mut self) -> std::result::Result<(), vk::Result> {
        let raw = &self.device.raw;
        let pool = vk::CommandPoolCreateInfo::default()
            .queue_family_index(self.device.adapter.queue_family)
            .flags(vk::CommandPoolCreateFlags::TRANSIENT);
        // SAFETY: the device is alive; what was made is destroyed by `drop` if a later step fails.
        unsafe {
            self.pool = raw.create_command_pool(&pool, None)?;
            let info =
                vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
            self.commands = raw.allocate_command_buffers(&info)?[0];
            self.fence = raw.create_fence(&vk::FenceCreateInfo::default(), None)?;
            let once =
                vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
            raw.begin_command_buffer(self.commands, &once)?;
            if self.capacity > 0 {
                let queries = vk::QueryPoolCreateInfo::default()
                    .query_type(vk::QueryType::TIMESTAMP)
                    .query_count(2 * self.capacity);
                self.timestamps = raw.create_query_pool(&queries, None)?;
                raw.cmd_reset_query_pool(self.commands, self.timestamps, 0, 2 * self.capacity);
            }
        }
        Ok(())
    }

    /// Runs a kernel on `groups` workgroups, between two timestamps.
    pub fn dispatch(&mut self, kernel: &'a BoundKernel<'_>, push: &[u8], groups: [u32; 3], label: &str) {
        self.timed_dispatch(kernel, push, label, |raw, commands| {
            let [x, y, z] = groups;
            // SAFETY: the command buffer is recording, with pipeline and descriptors bound.
            unsafe { raw.cmd_dispatch(commands, x, y, z) }
        });
    }

    /// The same on as many workgroups as three words of `sizes` at `offset` say when it comes to that.
    pub fn dispatch_indirect(
        &mut self,
        kernel: &'a BoundKernel<'_>,
        push: &[u8],
        sizes: &'a Buffer,
        offset: u64,
        label: &str,
    ) {
        self.timed_dispatch(kernel, push, label, |raw, commands| {
            // SAFETY: as above; the buffer was made for it and holds three words at the offset.
            unsafe { raw.cmd_dispatch_indirect(commands, sizes.raw, offset) }
        });
    }

    fn timed_dispatch(
        &mut self,
        kernel: &'a BoundKernel<'_>,
        push: &[u8],
        label: &str,
        dispatch: impl FnOnce(&ash::Device, vk::CommandBuffer),
    ) {
        let raw = &self.device.raw;
        let first = 2 * self.labels.len() as u32;
        let timed = first < 2 * self.capacity;
        // SAFETY: the command buffer is recording; kernel, set and pool belong to the device and outlive
        // the batch; the push constants fit the pipeline's range.
        unsafe {
            let point = vk::PipelineBindPoint::COMPUTE;
            raw.cmd_bind_pipeline(self.commands, point, kernel.pipeline.raw);
            let layout = kernel.pipeline.layout;
            raw.cmd_bind_descriptor_sets(self.commands, point, layout, 0, &[kernel.set], &[]);
            raw.cmd_push_constants(self.commands, layout, vk::ShaderStageFlags::COMPUTE, 0, push);
            // From the moment that earlier kernels are done to the moment that this one is.
            let stage = vk::PipelineStageFlags::COMPUTE_SHADER;
            if timed {
                raw.cmd_write_timestamp(self.commands, stage, self.timestamps, first);
            }
            dispatch(raw, self.commands);
            if timed {
                raw.cmd_write_timestamp(self.commands, stage, self.timestamps, first + 1);
            }
        }
        self.labels.push(label.to_string());
    }

    /// Clears a raster's target and shades every pixel of it, between two timestamps.
    pub fn draw(&mut self, raster: &'a Raster, kernel: &'a BoundKernel<'_>, label: &str) {
        let raw = &self.device.raw;
        let first = 2 * self.labels.len() as u32;
        let timed = first < 2 * self.capacity;
        let (width, height) = raster.size;
        let clear = [vk::ClearValue::default()];
        let pass = vk::RenderPassBeginInfo::default()
            .render_pass(raster.pass)
            .framebuffer(raster.framebuffer)
            .render_area(vk::Rect2D::default().extent(vk::Extent2D { width, height }))
            .clear_values(&clear);
        let done = vk::PipelineStageFlags::BOTTOM_OF_PIPE;
        // SAFETY: the command buffer is recording; pass, kernel and set belong to the device and outlive the
        // batch.
        unsafe {
            if timed {
                raw.cmd_write_timestamp(self.commands, done, self.timestamps, first);
            }
            raw.cmd_begin_render_pass(self.commands, &pass, vk::SubpassContents::INLINE);
            let point = vk::PipelineBindPoint::GRAPHICS;
            raw.cmd_bind_pipeline(self.commands, point, kernel.pipeline.raw);
            let layout = kernel.pipeline.layout;
            raw.cmd_bind_descriptor_sets(self.commands, point, layout, 0, &[kernel.set], &[]);
            raw.cmd_draw(self.commands, 3, 1, 0, 0);
            raw.cmd_end_render_pass(self.commands);
            if timed {
                raw.cmd_write_timestamp(self.commands, done, self.timestamps, first + 1);
            }
        }
        self.labels.push(label.to_string());
    }

    /// Makes earlier uses of the resources visible to later ones, from stage to stage.
    pub fn barrier(&mut self, hazards: &[Hazard<'a>]) {
        let mut from_stages = vk::PipelineStageFlags::empty();
        let mut to_stages = vk::PipelineStageFlags::empty();
        let mut buffers = Vec::new();
        let mut images = Vec::new();
        for hazard in hazards {
            let (Hazard::Buffer(_, from, to) | Hazard::Image(_, from, to)) = *hazard;
            let ((from_stage, from_access), (to_stage, to_access)) = (from.raw(), to.raw());
            from_stages |= from_stage;
            to_stages |= to_stage;
            match hazard {
                Hazard::Buffer(buffer, ..) => buffers.push(
                    vk::BufferMemoryBarrier::default()
                        .src_access_mask(from_access)
                        .dst_access_mask(to_access)
                        .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                        .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                        .buffer(buffer.raw)
                        .size(vk::WHOLE_SIZE),
                ),
                Hazard::Image(image, ..) => images.push(
                    image_barrier(image)
                        .src_access_mask(from_access)
                        .dst_access_mask(to_access)
                        .old_layout(vk::ImageLayout::GENERAL)
                        .new_layout(vk::ImageLayout::GENERAL),
                ),
            }
        }
        if hazards.is_empty() {
            return;
        }
        let none = vk::DependencyFlags::empty();
        // SAFETY: the command buffer is recording; the resources belong to the device.
        unsafe {
            self.device.raw.cmd_pipeline_barrier(
                self.commands,
                from_stages,
                to_stages,
                none,
                &[],
                &buffers,
                &images,
            );
        }
    }

    /// Fills a buffer with a word.
    pub fn fill(&mut self, buffer: &'a Buffer, word: u32) {
        // SAFETY: the command buffer is recording; our buffers can be written by transfers.
        unsafe { self.device.raw.cmd_fill_buffer(self.commands, buffer.raw, 0, vk::WHOLE_SIZE, word) };
    }

    /// Copies `bytes` from the start of one buffer into another at `offset`.
    pub fn copy(&mut self, from: &'a Buffer, to: &'a Buffer, offset: u64, bytes: u64) {
        let region = vk::BufferCopy::default().dst_offset(offset).size(bytes);
        // SAFETY: the command buffer is recording; the region lies within both buffers.
        unsafe { self.device.raw.cmd_copy_buffer(self.commands, from.raw, to.raw, &[region]) };
    }

    /// Brings a new image into its layout and sets all of it to 0, ready for kernels.
    pub fn clear_image(&mut self, image: &'a Image) {
        let (undefined, general) = (vk::ImageLayout::UNDEFINED, vk::ImageLayout::GENERAL);
        self.change_layout(image, (Access::TransferRead, undefined), (Access::TransferWrite, general));
        let black = vk::ClearColorValue { float32: [0.0; 4] };
        // SAFETY: the command buffer is recording; the image has memory and this layout.
        unsafe {
            let raw = &self.device.raw;
            raw.cmd_clear_color_image(self.commands, image.raw, general, &black, &[whole_image()]);
        }
        self.barrier(&[Hazard::Image(image, Access::TransferWrite, Access::ShaderWrite)]);
    }

    /// Copies all pixels of an image that kernels have written into a buffer, row by row.
    pub fn copy_image(&mut self, image: &'a Image, to: &'a Buffer) {
        let region = vk::BufferImageCopy::default()
            .image_subresource(
                vk::ImageSubresourceLayers::default().aspect_mask(vk::ImageAspectFlags::COLOR).layer_count(1),
            )
            .image_extent(vk::Extent3D { width: image.size.0, height: image.size.1, depth: 1 });
        let (general, source) = (vk::ImageLayout::GENERAL, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
        self.change_layout(image, (Access::ShaderWrite, general), (Access::TransferRead, source));
        // SAFETY: the command buffer is recording; the buffer holds all pixels.
        unsafe {
            self.device.raw.cmd_copy_image_to_buffer(self.commands, image.raw, source, to.raw, &[region]);
        }
        self.change_layout(image, (Access::TransferRead, source), (Access::ShaderWrite, general));
    }

    fn change_layout(
        &mut self,
        image: &'a Image,
        (from, old): (Access, vk::ImageLayout),
        (to, new): (Access, vk::ImageLayout),
    ) {
        let ((from_stage, from_access), (to_stage, to_access)) = (from.raw(), to.raw());
        let change = image_barrier(image)
            .src_access_mask(from_access)
            .dst_access_mask(to_access)
            .old_layout(old)
            .new_layout(new);
        let none = vk::DependencyFlags::empty();
        // SAFETY: the command buffer is recording; the image is in its old layout.
        unsafe {
            self.device.raw.cmd_pipeline_barrier(
                self.commands,
                from_stage,
                to_stage,
                none,
                &[],
                &[],
                &[change],
            );
        }
    }

    /// Hands the work to the device and returns at once.
    pub fn submit(&mut self) -> Result<()> {
        let raw = &self.device.raw;
        let commands = [self.commands];
        let work = vk::SubmitInfo::default().command_buffers(&commands);
        let queue = self.device.queue.lock().unwrap_or_else(PoisonError::into_inner);
        // SAFETY: recording ends here; the queue is ours while we hold its lock.
        unsafe {
            raw.end_command_buffer(self.commands)
                .and_then(|()| raw.queue_submit(*queue, &[work], self.fence))
                .map_err(|result| failed("Handing work to the device", result))?;
        }
        self.submitted = true;
        Ok(())
    }

    /// Waits until the device is done, and tells how long each dispatch took.
    pub fn wait(mut self) -> Result<Finished> {
        let raw = &self.device.raw;
        let mut ticks = vec![0u64; 2 * self.labels.len().min(self.capacity as usize)];
        // SAFETY: the fence was given to the submission; the queries were written by it.
        unsafe {
            raw.wait_for_fences(&[self.fence], true, u64::MAX)
                .map_err(|result| failed("Waiting for the device", result))?;
            self.submitted = false;
            if !ticks.is_empty() {
                raw.get_query_pool_results(self.timestamps, 0, &mut ticks, vk::QueryResultFlags::TYPE_64)
                    .map_err(|result| failed("Reading the timestamps", result))?;
            }
        }
        let (period_ns, bits) = self.device.adapter.timestamps.unwrap_or((1.0, 64));
        let mask = if bits >= 64 { u64::MAX } else { (1 << bits) - 1 };
        let labels = std::mem::take(&mut self.labels);
        let timings = labels.into_iter().enumerate().map(|(place, label)| Timing {
            label,
            gpu_ms: ticks.get(2 * place..2 * place + 2).map(|pair| {
                let steps = pair[1].wrapping_sub(pair[0]) & mask;
                steps as f64 * period_ns * 1e-6
            }),
        });
        Ok(Finished { timings: timings.collect() })
    }
}

fn image_barrier(image: &Image) -> vk::ImageMemoryBarrier<'static> {
    vk::ImageMemoryBarrier::default()
        .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
        .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
        .image(image.raw)
        .subresource_range(whole_image())
}

impl Drop for Batch<'_> {
    fn drop(&mut self) {
        let raw = &self.device.raw;
        // SAFETY: nothing is destroyed before the device is done with it.
        unsafe {
            if self.submitted {
                let _ = raw.wait_for_fences(&[self.fence], true, u64::MAX);
            }
            raw.destroy_query_pool(self.timestamps, None);
            raw.destroy_fence(self.fence, None);
            raw.destroy_command_pool(self.pool, None);
        }
    }
}
