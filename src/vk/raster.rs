//! One triangle over a whole image, shaded by a fragment shader: all of rasterization that is needed here.

use std::sync::Arc;

use ash::vk;

use super::device::{Device, Shared};
use super::failed;
use super::image::{Image, ImageFormat};
use super::kernel::{Binding, BoundKernel, Pipeline};
use crate::error::{Error, Result};
use crate::kernels::Kernel;

/// A render pass with its pipeline and its target.
pub struct Raster {
    pub(super) pass: vk::RenderPass,
    pub(super) framebuffer: vk::Framebuffer,
    pub(super) size: (u32, u32),
    /// Descriptors of the fragment shader; its compute pipeline is never made.
    pipeline: Pipeline,
    device: Arc<Shared>,
}

impl Raster {
    /// Prepares to fill `target` (made as a colour target) by two kernels.
    pub fn new(
        device: &Device,
        vertex: &'static Kernel,
        fragment: &'static Kernel,
        constants: &[(u32, u32)],
        target: &Image,
    ) -> Result<Self> {
        let shared = device.shared.clone();
        if !shared.adapter.draws {
            return Err(Error::device(format!(
                "The queue of {} does not draw: leave `fragment` out with --methods.",
                shared.adapter.name
            )));
        }
        let what = || format!("Preparing the kernel {}", fragment.name);
        let pass = render_pass(&shared).map_err(|result| failed(&what(), result))?;
        let views = [target.view];
        let info = vk::FramebufferCreateInfo::default()
            .render_pass(pass)
            .attachments(&views)
            .width(target.size.0)
            .height(target.size.1)
            .layers(1);
        // SAFETY: pass and view belong to the device.
        let framebuffer = match unsafe { shared.raw.create_framebuffer(&info, None) } {
            Ok(framebuffer) => framebuffer,
            Err(result) => {
                // SAFETY: nothing uses the pass.
                unsafe { shared.raw.destroy_render_pass(pass, None) };
                return Err(failed(&what(), result));
            }
        };
        let pipeline = Pipeline::for_drawing(device, [vertex, fragment], constants, pass, target.size);
        match pipeline {
            Ok(pipeline) => Ok(Self { pass, framebuffer, size: target.size, pipeline, device: shared }),
            Err(error) => {
                // SAFETY: nothing uses them.
                unsafe {
                    shared.raw.destroy_framebuffer(framebuffer, None);
                    shared.raw.destroy_render_pass(pass, None);
                }
                Err(error)
            }
        }
    }

    /// Writes the descriptors of the fragment shader.
    pub fn bind<'a>(&'a self, bound: &[(u32, Binding<'a>)]) -> Result<BoundKernel<'a>> {
        self.pipeline.bind(bound)
    }
}

impl Drop for Raster {
    fn drop(&mut self) {
        // SAFETY: batches that draw wait before they go, and borrow this.
        unsafe {
            self.device.raw.destroy_framebuffer(self.framebuffer, None);
            self.device.raw.destroy_render_pass(self.pass, None);
        }
    }
}

/// A pass that clears its one colour attachment and leaves it in the GENERAL layout, as storage images are.
fn render_pass(shared: &Shared) -> std::result::Result<vk::RenderPass, vk::Result> {
    let attachments = [vk::AttachmentDescription::default()
        .format(ImageFormat::Rgba8.raw())
        .samples(vk::SampleCountFlags::TYPE_1)
        .load_op(vk::AttachmentLoadOp::CLEAR)
        .store_op(vk::AttachmentStoreOp::STORE)
        .stencil_load_op(vk::AttachmentLoadOp::DONT_CARE)
        .stencil_store_op(vk::AttachmentStoreOp::DONT_CARE)
        .initial_layout(vk::ImageLayout::UNDEFINED)
        .final_layout(vk::ImageLayout::GENERAL)];
    let colors = [vk::AttachmentReference::default().layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)];
    let passes = [vk::SubpassDescription::default()
        .pipeline_bind_point(vk::PipelineBindPoint::GRAPHICS)
        .color_attachments(&colors)];
    // From the last frame's copy to this one's writes, and from those to whoever reads the image.
    let outside = vk::SUBPASS_EXTERNAL;
    let (transfer, output, compute) = (
        vk::PipelineStageFlags::TRANSFER | vk::PipelineStageFlags::COMPUTE_SHADER,
        vk::PipelineStageFlags::COLOR_ATTACHMENT_OUTPUT,
        vk::PipelineStageFlags::COMPUTE_SHADER,
    );
    let dependencies = [
        vk::SubpassDependency::default()
            .src_subpass(outside)
            .dst_subpass(0)
            .src_stage_mask(transfer | output)
            .src_access_mask(vk::AccessFlags::COLOR_ATTACHMENT_WRITE)
            .dst_stage_mask(output)
            .dst_access_mask(vk::AccessFlags::COLOR_ATTACHMENT_WRITE),
        vk::SubpassDependency::default()
            .src_subpass(0)
            .dst_subpass(outside)
            .src_stage_mask(output)
            .src_access_mask(vk::AccessFlags::COLOR_ATTACHMENT_WRITE)
            .dst_stage_mask(compute)
            .dst_access_mask(vk::AccessFlags::SHADER_READ | vk::AccessFlags::SHADER_WRITE),
    ];
    let info = vk::RenderPassCreateInfo::default()
        .attachments(&attachments)
        .subpasses(&passes)
        .dependencies(&dependencies);
    // SAFETY: the device is alive; the description is complete.
    unsafe { shared.raw.create_render_pass(&info, None) }
}
