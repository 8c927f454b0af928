//! Dependencies between uses of a resource, and images, whose layouts change with them.

use ash::vk;

use super::batch::Batch;
use super::buffer::Buffer;
use super::image::{Image, whole_image};

/// How a stage touches a resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    HostRead,
    TransferRead,
    TransferWrite,
    ShaderRead,
    /// Reads and writes by kernels.
    ShaderWrite,
    /// Numbers of workgroups, read by an indirect dispatch.
    IndirectRead,
}

impl Access {
    fn raw(self) -> (vk::PipelineStageFlags, vk::AccessFlags) {
        use vk::{AccessFlags as A, PipelineStageFlags as S};
        match self {
            Self::HostRead => (S::HOST, A::HOST_READ),
            Self::TransferRead => (S::TRANSFER, A::TRANSFER_READ),
            Self::TransferWrite => (S::TRANSFER, A::TRANSFER_WRITE),
            Self::ShaderRead => (S::COMPUTE_SHADER, A::SHADER_READ),
            Self::ShaderWrite => (S::COMPUTE_SHADER, A::SHADER_READ | A::SHADER_WRITE),
            Self::IndirectRead => (S::DRAW_INDIRECT, A::INDIRECT_COMMAND_READ),
        }
    }
}

/// A dependency between two uses of one resource.
#[derive(Clone, Copy)]
pub enum Hazard<'a> {
    Buffer(&'a Buffer, Access, Access),
    Image(&'a Image, Access, Access),
}

impl<'a> Batch<'a> {
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
}

fn image_barrier(image: &Image) -> vk::ImageMemoryBarrier<'static> {
    vk::ImageMemoryBarrier::default()
        .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
        .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
        .image(image.raw)
        .subresource_range(whole_image())
}
