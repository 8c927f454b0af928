//! Buffers.

use std::ffi::CString;
use std::sync::Arc;

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::Allocation;

use super::device::{Device, Shared};
use super::failed;
use crate::error::{Error, Result};

/// What a buffer is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BufferUse {
    /// Read and written by kernels.
    Storage,
    /// The same, and its numbers of workgroups are read by indirect dispatches.
    Indirect,
    /// Read by kernels through a view of 16-byte texels.
    Texels,
    /// Read and written by kernels, also by its device address where the device has them.
    Addressed,
    /// A small block of constants that the host writes.
    Uniform,
    /// Written by the host, copied to the device.
    Upload,
    /// Written by the device, read by the host.
    Readback,
}

/// A named buffer with its memory.
pub struct Buffer {
    pub(super) raw: vk::Buffer,
    pub(super) view: Option<vk::BufferView>,
    pub(super) bytes: u64,
    pub(super) usage: BufferUse,
    address: Option<u64>,
    name: String,
    allocation: Option<Allocation>,
    device: Arc<Shared>,
}

impl Buffer {
    /// Makes a buffer of `bytes` (at least 16) with undefined content.
    pub fn new(device: &Device, name: &str, usage: BufferUse, bytes: u64) -> Result<Self> {
        let shared = device.shared.clone();
        let bytes = bytes.max(16);
        let has_address = usage == BufferUse::Addressed && shared.adapter.has_addresses;
        let transfer = vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST;
        let (flags, location) = match usage {
            BufferUse::Addressed if has_address => {
                let both = vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS;
                (both | transfer, MemoryLocation::GpuOnly)
            }
            BufferUse::Storage | BufferUse::Addressed => {
                (vk::BufferUsageFlags::STORAGE_BUFFER | transfer, MemoryLocation::GpuOnly)
            }
            BufferUse::Indirect => {
                let both = vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::INDIRECT_BUFFER;
                (both | transfer, MemoryLocation::GpuOnly)
            }
            BufferUse::Texels => {
                let both = vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER | vk::BufferUsageFlags::STORAGE_BUFFER;
                (both | transfer, MemoryLocation::GpuOnly)
            }
            BufferUse::Uniform => (vk::BufferUsageFlags::UNIFORM_BUFFER, MemoryLocation::CpuToGpu),
            BufferUse::Upload => (vk::BufferUsageFlags::TRANSFER_SRC, MemoryLocation::CpuToGpu),
            BufferUse::Readback => (vk::BufferUsageFlags::TRANSFER_DST, MemoryLocation::GpuToCpu),
        };
        let info = vk::BufferCreateInfo::default().size(bytes).usage(flags);
        // SAFETY: the device is alive; the description is complete.
        let raw = unsafe { shared.raw.create_buffer(&info, None) }
            .map_err(|result| failed(&format!("Making the buffer {name}"), result))?;
        let mut buffer = Self {
            raw,
            view: None,
            bytes,
            usage,
            address: None,
            name: name.to_string(),
            allocation: None,
            device: shared.clone(),
        };
        // SAFETY: the buffer was made by this device.
        let requirements = unsafe { shared.raw.get_buffer_memory_requirements(raw) };
        let allocation = shared.memory.allocate(name, requirements, location, true)?;
        // SAFETY: the allocation meets the requirements of the buffer, which has no memory yet.
        let bound = unsafe { shared.raw.bind_buffer_memory(raw, allocation.memory(), allocation.offset()) };
        buffer.allocation = Some(allocation);
        bound.map_err(|result| failed(&format!("Giving memory to the buffer {name}"), result))?;
        if let Ok(label) = CString::new(name) {
            shared.name_object(raw, &label);
        }
        if usage == BufferUse::Texels {
            let info = vk::BufferViewCreateInfo::default()
                .buffer(raw)
                .format(vk::Format::R32G32B32A32_UINT)
                .range(vk::WHOLE_SIZE);
            // SAFETY: the buffer has memory and was made for texels of any format.
            let view = unsafe { shared.raw.create_buffer_view(&info, None) }
                .map_err(|result| failed(&format!("Viewing the buffer {name} as texels"), result))?;
            buffer.view = Some(view);
        }
        if has_address {
            let info = vk::BufferDeviceAddressInfo::default().buffer(raw);
            // SAFETY: the device has the feature, and the buffer has memory and was made for it.
            buffer.address = Some(unsafe { shared.raw.get_buffer_device_address(&info) });
        }
        Ok(buffer)
    }

    /// Its device address, if it was made to have one.
    pub fn address(&self) -> Option<u64> {
        self.address
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The host's view of an upload, uniform or readback buffer.
    pub fn mapped(&self) -> Result<&[u8]> {
        self.allocation.as_ref().and_then(Allocation::mapped_slice).ok_or_else(|| self.not_mapped())
    }

    /// The same, to write.
    pub fn mapped_mut(&mut self) -> Result<&mut [u8]> {
        let error = self.not_mapped();
        self.allocation.as_mut().and_then(Allocation::mapped_slice_mut).ok_or(error)
    }

    fn not_mapped(&self) -> Error {
        Error::device(format!("The buffer {} is out of the host's reach: update the driver.", self.name))
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        // SAFETY: batches keep no buffer alive, so the caller waits for its batches before it drops
        // buffers; `Batch` waits when it is dropped.
        unsafe {
            if let Some(view) = self.view {
                self.device.raw.destroy_buffer_view(view, None);
            }
            self.device.raw.destroy_buffer(self.raw, None);
        }
        if let Some(allocation) = self.allocation.take() {
            self.device.memory.free(&self.name, allocation);
        }
    }
}
