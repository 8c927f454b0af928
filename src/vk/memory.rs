//! Device memory, by name, with an account of what is alive.

use std::collections::BTreeMap;
use std::mem::ManuallyDrop;
use std::sync::{Mutex, MutexGuard, PoisonError};

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{
    Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc,
};

use crate::error::{Error, Result};

/// The allocator of a device.
pub(super) struct Memory {
    state: Mutex<State>,
}

struct State {
    allocator: ManuallyDrop<Allocator>,
    /// How many allocations of each name are alive.
    alive: BTreeMap<String, usize>,
}

impl Memory {
    pub(super) fn new(
        instance: &ash::Instance,
        device: &ash::Device,
        physical_device: vk::PhysicalDevice,
        has_addresses: bool,
    ) -> Result<Self> {
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.clone(),
            device: device.clone(),
            physical_device,
            debug_settings: Default::default(),
            buffer_device_address: has_addresses,
            allocation_sizes: Default::default(),
        })
        .map_err(|error| {
            Error::device(format!("Device memory can't be managed ({error}): update the driver."))
        })?;
        Ok(Self {
            state: Mutex::new(State { allocator: ManuallyDrop::new(allocator), alive: BTreeMap::new() }),
        })
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn allocate(
        &self,
        name: &str,
        requirements: vk::MemoryRequirements,
        location: MemoryLocation,
        linear: bool,
    ) -> Result<Allocation> {
        let mut state = self.state();
        let request = AllocationCreateDesc {
            name,
            requirements,
            location,
            linear,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        };
        let allocation = state.allocator.allocate(&request).map_err(|error| {
            Error::device(format!(
                "The device has no {:.0} MB for {name} ({error}): render a smaller image or scene, or choose \
                 another device with --device.",
                requirements.size as f64 / 1e6
            ))
        })?;
        *state.alive.entry(name.to_string()).or_default() += 1;
        Ok(allocation)
    }

    pub(super) fn free(&self, name: &str, allocation: Allocation) {
        let mut state = self.state();
        if let Some(count) = state.alive.get_mut(name) {
            *count -= 1;
        }
        state.alive.retain(|_, count| *count > 0);
        // The allocator fails only on an allocation that is not its own.
        let _ = state.allocator.free(allocation);
    }

    /// Names of the allocations that are alive.
    pub(super) fn alive(&self) -> Vec<String> {
        self.state().alive.keys().cloned().collect()
    }

    /// Bytes of all allocations that are alive.
    pub(super) fn bytes(&self) -> u64 {
        self.state().allocator.generate_report().total_allocated_bytes
    }

    /// Gives all memory back.
    ///
    /// # Safety
    /// Nothing may use the memory any more, the device must still exist, and this must be called once.
    pub(super) unsafe fn release(&self) {
        // SAFETY: called once, says the caller.
        unsafe { ManuallyDrop::drop(&mut self.state().allocator) };
    }
}
