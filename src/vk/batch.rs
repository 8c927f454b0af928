//! Work for the device: dispatches, copies and timestamps, recorded once and submitted once.

use std::sync::{Arc, PoisonError};
use std::time::Instant;

use ash::vk;

use super::buffer::{Buffer, BufferUse};
use super::device::{Device, Shared};
use super::failed;
use super::kernel::BoundKernel;
use super::raster::Raster;
use super::timing::{DeviceClock, Finished, HostTimes, Timing};
use crate::error::{Error, Result};

/// A command buffer with its fence and its timestamps. What it uses must outlive it; it waits for the
/// device before it goes.
pub struct Batch<'a> {
    pool: vk::CommandPool,
    pub(super) commands: vk::CommandBuffer,
    fence: vk::Fence,
    timestamps: vk::QueryPool,
    /// Most dispatches that can be timed.
    capacity: u32,
    labels: Vec<String>,
    submitted: bool,
    waits_after_each: bool,
    /// Why a dispatch that was waited for failed; the batch tells it when it is submitted.
    failure: Option<vk::Result>,
    host: HostTimes,
    pub(super) device: Arc<Shared>,
    used: std::marker::PhantomData<&'a ()>,
}

impl<'a> Batch<'a> {
    /// Starts recording. `dispatches`: how many there will be at most.
    pub fn new(device: &Device, dispatches: u32) -> Result<Self> {
        let shared = device.shared.clone();
        shared.wake();
        let now = Instant::now();
        let mut batch = Self {
            pool: vk::CommandPool::null(),
            commands: vk::CommandBuffer::null(),
            fence: vk::Fence::null(),
            timestamps: vk::QueryPool::null(),
            capacity: if shared.adapter.timestamps.is_some() { dispatches.max(1) } else { 0 },
            labels: Vec::new(),
            submitted: false,
            waits_after_each: false,
            failure: None,
            host: HostTimes { record: now, submit: now, submitted: now, wait: now, waited: now, read: now },
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

    /// Runs a kernel on `groups` workgroups in x, y and z, between two timestamps. `push`: its push constants,
    /// if it has any.
    pub fn dispatch(&mut self, kernel: &'a BoundKernel<'_>, push: &[u8], groups: [u32; 3], label: &str) {
        let [x, y, z] = groups;
        // SAFETY: the command buffer is recording, and the kernel with its descriptors is bound.
        self.timed(kernel, push, label, |batch| unsafe {
            batch.device.raw.cmd_dispatch(batch.commands, x, y, z);
        });
    }

    /// Has the host wait for each dispatch that follows before it goes on recording.
    pub fn wait_after_each(&mut self) {
        self.waits_after_each = true;
    }

    /// Hands over what is recorded, waits until the device is done with it, and goes on recording.
    fn wait_here(&mut self) -> std::result::Result<(), vk::Result> {
        let raw = &self.device.raw;
        let commands = [self.commands];
        let work = vk::SubmitInfo::default().command_buffers(&commands);
        // SAFETY: the command buffer is recording and is done before it is replaced by another one of its pool; the
        // fence is waited for before it is reset; the queue is ours while we hold its lock.
        unsafe {
            raw.end_command_buffer(self.commands)?;
            {
                let queue = self.device.queue.lock().unwrap_or_else(PoisonError::into_inner);
                raw.queue_submit(*queue, &[work], self.fence)?;
            }
            self.submitted = true;
            self.device.wakefulness.begin();
            raw.wait_for_fences(&[self.fence], true, u64::MAX)?;
            self.submitted = false;
            self.device.wakefulness.end();
            raw.reset_fences(&[self.fence])?;
            let info =
                vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
            self.commands = raw.allocate_command_buffers(&info)?[0];
            let once =
                vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
            raw.begin_command_buffer(self.commands, &once)
        }
    }

    /// How many dispatches are recorded.
    pub fn dispatches(&self) -> usize {
        self.labels.len()
    }

    /// The same with numbers of workgroups that the device reads: three words at `offset` (in bytes, a multiple
    /// of 4) of a buffer that was made for it ([`BufferUse::Indirect`]). What wrote them needs a barrier to
    /// [`super::Access::IndirectRead`], and keeps them within [`super::Limits::workgroups`].
    pub fn dispatch_indirect(
        &mut self,
        kernel: &'a BoundKernel<'_>,
        push: &[u8],
        groups: &'a Buffer,
        offset: u64,
        label: &str,
    ) -> Result<()> {
        let inside = offset.checked_add(12).is_some_and(|end| end <= groups.bytes);
        if groups.usage != BufferUse::Indirect || !offset.is_multiple_of(4) || !inside {
            return Err(Error::other(format!(
                "The numbers of workgroups of {label} can't be read at byte {offset} of the buffer {}: report this \
                 as a bug.",
                groups.name()
            )));
        }
        // SAFETY: the command buffer is recording, the kernel with its descriptors is bound, and the three
        // words lie in a buffer for indirect dispatches that outlives the batch.
        self.timed(kernel, push, label, |batch| unsafe {
            batch.device.raw.cmd_dispatch_indirect(batch.commands, groups.raw, offset);
        });
        Ok(())
    }

    /// Binds a kernel and records `work` between two timestamps: from the moment that earlier kernels are done to
    /// the moment that this one is.
    fn timed(&mut self, kernel: &'a BoundKernel<'_>, push: &[u8], label: &str, work: impl FnOnce(&Self)) {
        let raw = &self.device.raw;
        let first = 2 * self.labels.len() as u32;
        let timed = first < 2 * self.capacity;
        let stage = vk::PipelineStageFlags::COMPUTE_SHADER;
        // SAFETY: the command buffer is recording; kernel, set and pool belong to the device and outlive
        // the batch; the push constants fit the pipeline's range.
        unsafe {
            let point = vk::PipelineBindPoint::COMPUTE;
            raw.cmd_bind_pipeline(self.commands, point, kernel.pipeline.raw);
            let layout = kernel.pipeline.layout;
            raw.cmd_bind_descriptor_sets(self.commands, point, layout, 0, &[kernel.set], &[]);
            if !push.is_empty() {
                raw.cmd_push_constants(self.commands, layout, vk::ShaderStageFlags::COMPUTE, 0, push);
            }
            if timed {
                raw.cmd_write_timestamp(self.commands, stage, self.timestamps, first);
            }
        }
        work(self);
        if timed {
            // SAFETY: the command buffer is recording, and the pool has room for this query.
            unsafe {
                self.device.raw.cmd_write_timestamp(self.commands, stage, self.timestamps, first + 1);
            }
        }
        self.labels.push(label.to_string());
        if self.waits_after_each && self.failure.is_none() {
            self.failure = self.wait_here().err();
        }
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

    /// Hands the work to the device and returns at once.
    pub fn submit(&mut self) -> Result<()> {
        if let Some(result) = self.failure {
            return Err(failed("Waiting for the device", result));
        }
        let raw = &self.device.raw;
        let commands = [self.commands];
        let work = vk::SubmitInfo::default().command_buffers(&commands);
        self.host.submit = Instant::now();
        let queue = self.device.queue.lock().unwrap_or_else(PoisonError::into_inner);
        // SAFETY: recording ends here; the queue is ours while we hold its lock.
        unsafe {
            raw.end_command_buffer(self.commands)
                .and_then(|()| raw.queue_submit(*queue, &[work], self.fence))
                .map_err(|result| failed("Handing work to the device", result))?;
        }
        self.submitted = true;
        self.device.wakefulness.begin();
        self.host.submitted = Instant::now();
        Ok(())
    }

    /// Waits until the device is done, and tells how long each dispatch took.
    pub fn wait(mut self) -> Result<Finished> {
        let raw = &self.device.raw;
        let mut ticks = vec![0u64; 2 * self.labels.len().min(self.capacity as usize)];
        self.host.wait = Instant::now();
        // SAFETY: the fence was given to the submission; the queries were written by it.
        unsafe {
            raw.wait_for_fences(&[self.fence], true, u64::MAX)
                .map_err(|result| failed("Waiting for the device", result))?;
            self.host.waited = Instant::now();
            self.submitted = false;
            self.device.wakefulness.end();
            if !ticks.is_empty() {
                raw.get_query_pool_results(self.timestamps, 0, &mut ticks, vk::QueryResultFlags::TYPE_64)
                    .map_err(|result| failed("Reading the timestamps", result))?;
            }
        }
        self.host.read = Instant::now();
        let clock = DeviceClock::new(self.device.adapter.timestamps.unwrap_or((1.0, 64)));
        let labels = std::mem::take(&mut self.labels);
        let timings = labels.into_iter().enumerate().map(|(place, label)| {
            let pair = ticks.get(2 * place..2 * place + 2).map(|pair| (pair[0], pair[1]));
            Timing::new(label, pair, clock)
        });
        Ok(Finished { timings: timings.collect(), host: self.host })
    }
}

impl Drop for Batch<'_> {
    fn drop(&mut self) {
        let raw = &self.device.raw;
        // SAFETY: nothing is destroyed before the device is done with it.
        unsafe {
            if self.submitted {
                let _ = raw.wait_for_fences(&[self.fence], true, u64::MAX);
                self.device.wakefulness.end();
            }
            raw.destroy_query_pool(self.timestamps, None);
            raw.destroy_fence(self.fence, None);
            raw.destroy_command_pool(self.pool, None);
        }
    }
}
