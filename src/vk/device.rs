//! A logical device with one compute queue.

use std::ffi::CStr;
use std::sync::{Arc, Mutex};

use ash::{ext, vk};

use super::adapter::Adapter;
use super::failed;
use super::instance::Instance;
use super::memory::Memory;
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
    names: Option<ext::debug_utils::Device>,
    instance: Instance,
}

impl Device {
    pub fn open(instance: &Instance, adapter: &Adapter) -> Result<Self> {
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
        let info =
            vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&extensions);
        let vulkan = &instance.shared.raw;
        // SAFETY: the adapter comes from this instance; `info` lives until the call returns.
        let raw = unsafe { vulkan.create_device(adapter.raw, &info, None) }
            .map_err(|result| failed(&format!("Opening the device {}", adapter.name), result))?;
        let memory = match Memory::new(vulkan, &raw, adapter.raw) {
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
        Ok(Self {
            shared: Arc::new(Shared {
                raw,
                memory,
                queue: Mutex::new(queue),
                adapter: adapter.clone(),
                names,
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
            self.memory.release();
            self.raw.destroy_device(None);
        }
    }
}
