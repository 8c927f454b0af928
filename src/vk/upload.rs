//! Moving data between host and device.

use super::barrier::{Access, Hazard};
use super::batch::Batch;
use super::buffer::{Buffer, BufferUse};
use super::device::Device;
use super::image::Image;
use crate::error::Result;

/// Data travels in pieces of this size, so that staging never doubles the memory of a large scene.
const PIECE_BYTES: usize = 64 << 20;

impl Buffer {
    /// Makes a buffer with this content, ready for kernels.
    pub fn with_content(device: &Device, name: &str, usage: BufferUse, content: &[u8]) -> Result<Self> {
        let buffer = Buffer::new(device, name, usage, content.len() as u64)?;
        let piece_bytes = content.len().min(PIECE_BYTES) as u64;
        let mut staging = Buffer::new(device, &format!("{name} (staging)"), BufferUse::Upload, piece_bytes)?;
        for (number, piece) in content.chunks(PIECE_BYTES).enumerate() {
            staging.mapped_mut()?[..piece.len()].copy_from_slice(piece);
            let mut batch = Batch::new(device, 0)?;
            let offset = (number * PIECE_BYTES) as u64;
            batch.copy(&staging, &buffer, offset, piece.len() as u64);
            batch.barrier(&[Hazard::Buffer(&buffer, Access::TransferWrite, Access::ShaderRead)]);
            if usage == BufferUse::Indirect {
                batch.barrier(&[Hazard::Buffer(&buffer, Access::TransferWrite, Access::IndirectRead)]);
            }
            batch.submit()?;
            batch.wait()?;
        }
        Ok(buffer)
    }

    /// Makes a uniform block with this content.
    pub fn uniform(device: &Device, name: &str, content: &[u8]) -> Result<Self> {
        let mut buffer = Buffer::new(device, name, BufferUse::Uniform, content.len() as u64)?;
        buffer.mapped_mut()?[..content.len()].copy_from_slice(content);
        Ok(buffer)
    }

    /// Reads a storage buffer that kernels have written; they must be done.
    pub fn read(&self, device: &Device) -> Result<Vec<u8>> {
        let readback =
            Buffer::new(device, &format!("{} (readback)", self.name()), BufferUse::Readback, self.bytes)?;
        let mut batch = Batch::new(device, 0)?;
        batch.barrier(&[Hazard::Buffer(self, Access::ShaderWrite, Access::TransferRead)]);
        batch.copy(self, &readback, 0, self.bytes);
        batch.barrier(&[Hazard::Buffer(&readback, Access::TransferWrite, Access::HostRead)]);
        batch.submit()?;
        batch.wait()?;
        let bytes = usize::try_from(self.bytes).unwrap_or(usize::MAX);
        Ok(readback.mapped()?[..bytes].to_vec())
    }
}

impl Image {
    /// Reads all pixels, row by row; `bytes_per_pixel` as of its format. Kernels must be done.
    pub fn read(&self, device: &Device, bytes_per_pixel: u64) -> Result<Vec<u8>> {
        let bytes = u64::from(self.size.0) * u64::from(self.size.1) * bytes_per_pixel;
        let readback = Buffer::new(device, "image (readback)", BufferUse::Readback, bytes)?;
        let mut batch = Batch::new(device, 0)?;
        batch.copy_image(self, &readback);
        batch.barrier(&[Hazard::Buffer(&readback, Access::TransferWrite, Access::HostRead)]);
        batch.submit()?;
        batch.wait()?;
        Ok(readback.mapped()?[..usize::try_from(bytes).unwrap_or(usize::MAX)].to_vec())
    }
}
