//! A logical device with one compute queue.

use std::ffi::CStr;
use std::path::Path;
use std::sync::{Arc, Mutex};

use ash::{ext, khr, vk};

use super::adapter::Adapter;
use super::cache::PipelineCache;
use super::calibrate::ClockReader;
use super::failed;
use super::instance::Instance;
use super::memory::Memory;
use super::statistics::StatisticsReader;
use super::wake::Wakefulness;
use crate::error::Result;

/// A device; everything made from it keeps it alive.
#[derive(Clone)]
pub struct Device {
    pub(super) shared: Arc<Shared>,
}

pub(super) struct Shared {
    pub(super) raw: ash::Device,
    pub(super) memory: Memory,
    /// Submission must not happen from two threads at once.
    pub(super) queue: Mutex<vk::Queue>,
    pub(super) adapter: Adapter,
    pub(super) pipelines: PipelineCache,
    names: Option<ext::debug_utils::Device>,
    /// `None` where the device tells no statistics of kernels.
    pub(super) statistics: Option<StatisticsReader>,
    /// `None` where the device's clock can't be read.
    pub(super) clock: Option<ClockReader>,
    pub(super) wakefulness: Wakefulness,
    pub(super) instance: Instance,
}

impl Device {
    pub fn open(instance: &Instance, adapter: &Adapter) -> Result<Self> {
        Self::open_with_cache(instance, adapter, None)
    }

    /// The same, and keeps compiled kernels in a folder, if there is one, from run to run.
    pub fn open_with_cache(instance: &Instance, adapter: &Adapter, cache: Option<&Path>) -> Result<Self> {
        let priorities = [1.0];
        let queues = [vk::DeviceQueueCreateInfo::default()
            .queue_family_index(adapter.queue_family)
            .queue_priorities(&priorities)];
        // Where it is offered, the specification demands that it is enabled.
        let subset = c"VK_KHR_portability_subset";
        let mut extensions = Vec::new();
        if adapter.extensions.iter().any(|name| name.as_bytes() == subset.to_bytes()) {
            extensions.push(subset.as_ptr());
        }
        if let Some(calibrator) = adapter.calibrator {
            extensions.push(calibrator.extension().as_ptr());
        }
        let mut executables = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default()
            .pipeline_executable_info(true);
        if adapter.tells_statistics {
            extensions.push(khr::pipeline_executable_properties::NAME.as_ptr());
        }
        let mut info =
            vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&extensions);
        if adapter.tells_statistics {
            info = info.push_next(&mut executables);
        }
        let mut addresses =
            vk::PhysicalDeviceBufferDeviceAddressFeatures::default().buffer_device_address(true);
        if adapter.has_addresses {
            info = info.push_next(&mut addresses);
        }
        let vulkan = &instance.shared.raw;
        // SAFETY: the adapter comes from this instance; `info` lives until the call returns.
        let raw = unsafe { vulkan.create_device(adapter.raw, &info, None) }
            .map_err(|result| failed(&format!("Opening the device {}", adapter.name), result))?;
        let memory = match Memory::new(vulkan, &raw, adapter.raw, adapter.has_addresses) {
            Ok(memory) => memory,
            Err(error) => {
                // SAFETY: nothing was made from the device.
                unsafe { raw.destroy_device(None) };
                return Err(error);
            }
        };
        // SAFETY: the device was made with one queue of this family.
        let queue = unsafe { raw.get_device_queue(adapter.queue_family, 0) };
        let names = instance.shared.names_objects.then(|| ext::debug_utils::Device::new(vulkan, &raw));
        let statistics = adapter.tells_statistics.then(|| StatisticsReader::new(vulkan, &raw)).flatten();
        let clock = adapter.calibrator.and_then(|calibrator| ClockReader::new(vulkan, &raw, calibrator));
        let pipelines = match cache {
            Some(folder) => PipelineCache::open(&raw, &adapter.cache_key, folder),
            None => PipelineCache::none(),
        };
        Ok(Self {
            shared: Arc::new(Shared {
                raw,
                pipelines,
                memory,
                queue: Mutex::new(queue),
                adapter: adapter.clone(),
                names,
                statistics,
                clock,
                wakefulness: Wakefulness::new(),
                instance: instance.clone(),
            }),
        })
    }

    pub fn adapter(&self) -> &Adapter {
        &self.shared.adapter
    }

    pub fn instance(&self) -> &Instance {
        &self.shared.instance
    }

    /// Memory that buffers and images take, bytes.
    pub fn allocated_bytes(&self) -> u64 {
        self.shared.memory.bytes()
    }

    /// Names of the buffers and images that are alive.
    pub fn allocations(&self) -> Vec<String> {
        self.shared.memory.alive()
    }
}

impl Shared {
    /// Gives an object the name under which validation messages speak of it.
    pub(super) fn name_object<T: vk::Handle>(&self, handle: T, name: &CStr) {
        let Some(functions) = &self.names else { return };
        let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(handle).object_name(name);
        // SAFETY: the handle is alive and belongs to this device. A name that is not taken is no loss.
        let _ = unsafe { functions.set_debug_utils_object_name(&info) };
    }
}

impl Drop for Shared {
    fn drop(&mut self) {
        // SAFETY: what is made from the device holds an `Arc` of it, so nothing is left but memory
        // blocks; the queue must be idle before they go.
        unsafe {
            let _ = self.raw.device_wait_idle();
            self.pipelines.close(&self.raw);
            self.memory.release();
            self.raw.destroy_device(None);
        }
    }
}
