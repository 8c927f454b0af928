//! A small explicit Vulkan compute layer: devices, memory, kernels, barriers, timestamps. It knows
//! nothing of rays or trees.

mod adapter;
mod barrier;
mod batch;
mod buffer;
mod cache;
mod calibrate;
mod device;
mod image;
mod instance;
mod kernel;
mod memory;
mod raster;
mod statistics;
mod timing;
mod upload;
mod wake;

pub use adapter::{Adapter, DeviceKind, Limits, Subgroup, WORKGROUP_INVOCATIONS};
pub use barrier::{Access, Hazard};
pub use batch::Batch;
pub use buffer::{Buffer, BufferUse};
pub use calibrate::{Calibration, Pair};
pub use device::Device;
pub use image::{Image, ImageFormat};
pub use instance::{Instance, VALIDATION_LAYER};
pub use kernel::{Binding, BoundKernel, Pipeline};
pub use raster::Raster;
pub use statistics::{PipelineStatistics, Statistic, StatisticValue};
pub use timing::{Finished, HostTimes, Timing};

use crate::error::Error;

/// An error of a Vulkan call in words: what was being done, what the driver said, what to do.
fn failed(what: &str, result: ash::vk::Result) -> Error {
    use ash::vk::Result as R;
    let advice = match result {
        R::ERROR_DEVICE_LOST => "the device was lost; try again, or choose another with --device",
        R::ERROR_OUT_OF_DEVICE_MEMORY | R::ERROR_OUT_OF_HOST_MEMORY => {
            "memory ran out; render a smaller image or scene, or choose another device with --device"
        }
        _ => "update the driver or choose another device with --device (`cousu doctor` shows what is there)",
    };
    Error::device(format!("{what} failed with {result:?}: {advice}."))
}
