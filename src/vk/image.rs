//! Storage images.

use std::ffi::CString;
use std::sync::Arc;

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::Allocation;

use super::device::{Device, Shared};
use super::failed;
use crate::error::Result;

/// Formats that kernels read and write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFormat {
    Rgba8,
    Rgba32f,
}

impl ImageFormat {
    pub fn bytes_per_pixel(self) -> u64 {
        match self {
            Self::Rgba8 => 4,
            Self::Rgba32f => 16,
        }
    }

    pub(super) fn raw(self) -> vk::Format {
        match self {
            Self::Rgba8 => vk::Format::R8G8B8A8_UNORM,
            Self::Rgba32f => vk::Format::R32G32B32A32_SFLOAT,
        }
    }
}

/// A two-dimensional storage image; it lives in the GENERAL layout from its first clear on.
pub struct Image {
    pub(super) raw: vk::Image,
    pub(super) view: vk::ImageView,
    pub(super) size: (u32, u32),
    name: String,
    allocation: Option<Allocation>,
    device: Arc<Shared>,
}

impl Image {
    /// Makes an image of width x height pixels with undefined content.
    pub fn new(device: &Device, name: &str, format: ImageFormat, size: (u32, u32)) -> Result<Self> {
        Self::with_usage(device, name, format, size, vk::ImageUsageFlags::STORAGE)
    }

    /// Makes an rgba8 image that is drawn into.
    pub fn color_target(device: &Device, name: &str, size: (u32, u32)) -> Result<Self> {
        Self::with_usage(device, name, ImageFormat::Rgba8, size, vk::ImageUsageFlags::COLOR_ATTACHMENT)
    }

    fn with_usage(
        device: &Device,
        name: &str,
        format: ImageFormat,
        size: (u32, u32),
        usage: vk::ImageUsageFlags,
    ) -> Result<Self> {
        let shared = device.shared.clone();
        let usage = usage | vk::ImageUsageFlags::TRANSFER_SRC | vk::ImageUsageFlags::TRANSFER_DST;
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(format.raw())
            .extent(vk::Extent3D { width: size.0, height: size.1, depth: 1 })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(usage);
        // SAFETY: the device is alive; the description is complete.
        let raw = unsafe { shared.raw.create_image(&info, None) }
            .map_err(|result| failed(&format!("Making the image {name}"), result))?;
        let mut image = Self {
            raw,
            view: vk::ImageView::null(),
            size,
            name: name.to_string(),
            allocation: None,
            device: shared.clone(),
        };
        // SAFETY: the image was made by this device.
        let requirements = unsafe { shared.raw.get_image_memory_requirements(raw) };
        let allocation = shared.memory.allocate(name, requirements, MemoryLocation::GpuOnly, false)?;
        // SAFETY: the allocation meets the requirements of the image, which has no memory yet.
        let bound = unsafe { shared.raw.bind_image_memory(raw, allocation.memory(), allocation.offset()) };
        image.allocation = Some(allocation);
        bound.map_err(|result| failed(&format!("Giving memory to the image {name}"), result))?;
        if let Ok(label) = CString::new(name) {
            shared.name_object(raw, &label);
        }
        let info = vk::ImageViewCreateInfo::default()
            .image(raw)
            .view_type(vk::ImageViewType::TYPE_2D)
            .format(format.raw())
            .subresource_range(whole_image());
        // SAFETY: the image has memory.
        image.view = unsafe { shared.raw.create_image_view(&info, None) }
            .map_err(|result| failed(&format!("Viewing the image {name}"), result))?;
        Ok(image)
    }
}

/// The one level and layer that our images have.
pub(super) fn whole_image() -> vk::ImageSubresourceRange {
    vk::ImageSubresourceRange::default()
        .aspect_mask(vk::ImageAspectFlags::COLOR)
        .level_count(1)
        .layer_count(1)
}

impl Drop for Image {
    fn drop(&mut self) {
        // SAFETY: as for `Buffer`.
        unsafe {
            self.device.raw.destroy_image_view(self.view, None);
            self.device.raw.destroy_image(self.raw, None);
        }
        if let Some(allocation) = self.allocation.take() {
            self.device.memory.free(&self.name, allocation);
        }
    }
}
