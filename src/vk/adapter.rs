//! What a physical device is and can do, as plain data.

use std::ffi::CStr;

use ash::vk;

use super::cache::CacheKey;
use super::calibrate::Calibrator;
use crate::error::{Error, Result};

/// Kinds of device in the order of preference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DeviceKind {
    Discrete,
    Integrated,
    Virtual,
    Other,
    Cpu,
}

impl DeviceKind {
    pub fn name(self) -> &'static str {
        match self {
            Self::Discrete => "discrete GPU",
            Self::Integrated => "integrated GPU",
            Self::Virtual => "virtual GPU",
            Self::Other => "other",
            Self::Cpu => "CPU",
        }
    }
}

/// The limits that a render has to keep.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Largest range of a storage buffer that a descriptor may show, bytes.
    pub storage_buffer_bytes: u64,
    /// Most elements of a texel buffer.
    pub texel_elements: u64,
    /// Largest side of an image, pixels.
    pub image_side: u32,
    /// Most workgroups of one dispatch.
    pub workgroups: u32,
    /// Loop iterations after which the driver silently leaves a loop, for one invocation.
    pub loop_iterations: Option<u32>,
}

/// Invocations that run together, and what they can do among themselves in a compute shader.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Subgroup {
    /// Invocations; 0 where the driver doesn't tell.
    pub size: u32,
    pub basic: bool,
    pub vote: bool,
    pub arithmetic: bool,
    pub ballot: bool,
    pub shuffle: bool,
    pub quad: bool,
}

impl Subgroup {
    fn of(properties: &vk::PhysicalDeviceVulkan11Properties<'_>) -> Self {
        use vk::SubgroupFeatureFlags as F;
        let in_compute = properties.subgroup_supported_stages.contains(vk::ShaderStageFlags::COMPUTE);
        let has = |operation| in_compute && properties.subgroup_supported_operations.contains(operation);
        Self {
            size: properties.subgroup_size,
            basic: has(F::BASIC),
            vote: has(F::VOTE),
            arithmetic: has(F::ARITHMETIC),
            ballot: has(F::BALLOT),
            shuffle: has(F::SHUFFLE),
            quad: has(F::QUAD),
        }
    }

    /// Names of the operations that are there.
    pub fn operations(&self) -> Vec<&'static str> {
        let all = [
            ("basic", self.basic),
            ("vote", self.vote),
            ("arithmetic", self.arithmetic),
            ("ballot", self.ballot),
            ("shuffle", self.shuffle),
            ("quad", self.quad),
        ];
        all.into_iter().filter(|(_, there)| *there).map(|(name, _)| name).collect()
    }
}

/// A physical device: what it is, whether it will do, and what it lacks.
#[derive(Clone)]
pub struct Adapter {
    pub(super) raw: vk::PhysicalDevice,
    pub name: String,
    pub kind: DeviceKind,
    /// Driver name and version as the driver tells them.
    pub driver: String,
    pub api_version: (u32, u32, u32),
    pub limits: Limits,
    pub subgroup: Subgroup,
    pub memory_bytes: u64,
    /// Duration of a timestamp's step in ns, and how many bits of it count; `None` without timestamps.
    pub timestamps: Option<(f64, u32)>,
    /// Optional features by name, and whether they are there.
    pub features: Vec<(&'static str, bool)>,
    /// Why it can't be used, if it can't.
    pub unusable: Option<String>,
    pub(super) queue_family: u32,
    /// Whether that family's queues draw.
    pub(super) draws: bool,
    pub(super) extensions: Vec<String>,
    /// Whether compiled kernels can be asked for statistics.
    pub(super) tells_statistics: bool,
    /// Whether the driver lets the clock of a device with little to do fall so far that short work runs slowly (`wake.rs`).
    pub(super) clock_falls: bool,
    /// Whether buffers have device addresses.
    pub(super) has_addresses: bool,
    pub(super) calibrator: Option<Calibrator>,
    pub(super) cache_key: CacheKey,
}

/// Extensions that later methods use, by the name under which a person knows them.
const OPTIONAL_EXTENSIONS: &[(&str, &CStr)] = &[
    ("acceleration structure", ash::khr::acceleration_structure::NAME),
    ("ray query", ash::khr::ray_query::NAME),
    ("ray-tracing pipeline", ash::khr::ray_tracing_pipeline::NAME),
    ("memory budget", ash::ext::memory_budget::NAME),
    ("shader clock", ash::khr::shader_clock::NAME),
];

impl Adapter {
    pub(super) fn probe(entry: &ash::Entry, instance: &ash::Instance, raw: vk::PhysicalDevice) -> Self {
        let mut vulkan12 = vk::PhysicalDeviceVulkan12Properties::default();
        let mut vulkan11 = vk::PhysicalDeviceVulkan11Properties::default();
        // SAFETY: `raw` comes from this instance.
        let base = unsafe { instance.get_physical_device_properties(raw) };
        let has_12 = base.api_version >= vk::API_VERSION_1_2;
        if has_12 {
            let mut all =
                vk::PhysicalDeviceProperties2::default().push_next(&mut vulkan12).push_next(&mut vulkan11);
            // SAFETY: a device of Vulkan 1.2 fills these structs.
            unsafe { instance.get_physical_device_properties2(raw, &mut all) };
        }
        // SAFETY: `raw` comes from this instance.
        let (families, memory, extensions) = unsafe {
            (
                instance.get_physical_device_queue_family_properties(raw),
                instance.get_physical_device_memory_properties(raw),
                instance.enumerate_device_extension_properties(raw).unwrap_or_default(),
            )
        };
        let extensions: Vec<String> = extensions
            .iter()
            .filter_map(|extension| {
                Some(extension.extension_name_as_c_str().ok()?.to_string_lossy().into_owned())
            })
            .collect();
        let offered = |name: &CStr| extensions.iter().any(|found| name.to_bytes() == found.as_bytes());
        let tells_statistics = has_12
            && offered(ash::khr::pipeline_executable_properties::NAME)
            && tells_statistics(instance, raw);
        let calibrator = Calibrator::probe(entry, instance, raw, offered);
        let mut features: Vec<_> =
            OPTIONAL_EXTENSIONS.iter().map(|(label, name)| (*label, offered(name))).collect();
        features.push(("pipeline statistics", tells_statistics));
        features.push(("calibrated timestamps", calibrator.is_some()));
        let has_addresses = has_12 && has_addresses(instance, raw);
        features.push(("buffer device address", has_addresses));
        let family = compute_family(&families);
        let kind = kind_of(base.device_type);
        let driver_id = vulkan12.driver_id;
        let text =
            |bytes: Option<&CStr>| bytes.map(|text| text.to_string_lossy().into_owned()).unwrap_or_default();
        let driver = format!(
            "{} {}",
            text(vulkan12.driver_name_as_c_str().ok()),
            text(vulkan12.driver_info_as_c_str().ok())
        );
        Self {
            raw,
            name: text(base.device_name_as_c_str().ok()),
            kind,
            driver: driver.trim().to_string(),
            api_version: (
                vk::api_version_major(base.api_version),
                vk::api_version_minor(base.api_version),
                vk::api_version_patch(base.api_version),
            ),
            limits: limits_of(&base.limits, driver_id),
            subgroup: Subgroup::of(&vulkan11),
            memory_bytes: memory
                .memory_heaps_as_slice()
                .iter()
                .filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
                .map(|heap| heap.size)
                .sum(),
            timestamps: family.and_then(|family| {
                let bits = families[family as usize].timestamp_valid_bits;
                (bits > 0).then_some((f64::from(base.limits.timestamp_period), bits))
            }),
            features,
            unusable: unusable(has_12, family, &base.limits),
            queue_family: family.unwrap_or(0),
            draws: family.is_some_and(|family| {
                families[family as usize].queue_flags.contains(vk::QueueFlags::GRAPHICS)
            }),
            tells_statistics,
            clock_falls: driver_id == vk::DriverId::NVIDIA_PROPRIETARY,
            has_addresses,
            calibrator,
            cache_key: CacheKey::of(&base),
            extensions,
        }
    }

    /// Picks from `adapters` (best first): the first usable one, or the one with this number, or the one
    /// with this part in its name.
    pub fn choose<'a>(adapters: &'a [Adapter], wanted: Option<&str>) -> Result<&'a Adapter> {
        let listed = || {
            let names: Vec<String> =
                adapters.iter().enumerate().map(|(i, adapter)| format!("{i}: {}", adapter.name)).collect();
            names.join(", ")
        };
        if adapters.is_empty() {
            return Err(Error::device(
                "No Vulkan device was found: install a driver (Debian: apt install mesa-vulkan-drivers, which \
                 also brings one that runs on the CPU); `cousu doctor` tells more.",
            ));
        }
        let chosen = match wanted {
            None => adapters.iter().find(|adapter| adapter.unusable.is_none()).unwrap_or(&adapters[0]),
            Some(text) => {
                let lower = text.trim().to_lowercase();
                let found = match lower.parse::<usize>() {
                    Ok(number) => adapters.get(number),
                    Err(_) if lower.is_empty() => None,
                    Err(_) => adapters.iter().find(|adapter| adapter.name.to_lowercase().contains(&lower)),
                };
                found.ok_or_else(|| {
                    Error::device(format!("There is no device {text:?}: choose --device from {}.", listed()))
                })?
            }
        };
        match &chosen.unusable {
            Some(reason) => {
                Err(Error::device(format!("The device {} can't be used, because {reason}.", chosen.name)))
            }
            None => Ok(chosen),
        }
    }
}

/// Whether a device with VK_KHR_pipeline_executable_properties also has the extension's one feature.
fn tells_statistics(instance: &ash::Instance, raw: vk::PhysicalDevice) -> bool {
    let mut executables = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default();
    let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut executables);
    // SAFETY: `raw` comes from this instance, and the device has the extension of the struct.
    unsafe { instance.get_physical_device_features2(raw, &mut features) };
    executables.pipeline_executable_info == vk::TRUE
}

/// Whether the buffers of a device of Vulkan 1.2 have device addresses.
fn has_addresses(instance: &ash::Instance, raw: vk::PhysicalDevice) -> bool {
    let mut addresses = vk::PhysicalDeviceBufferDeviceAddressFeatures::default();
    let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut addresses);
    // SAFETY: `raw` comes from this instance, and Vulkan 1.2 has the struct.
    unsafe { instance.get_physical_device_features2(raw, &mut features) };
    addresses.buffer_device_address == vk::TRUE
}

fn kind_of(device_type: vk::PhysicalDeviceType) -> DeviceKind {
    match device_type {
        vk::PhysicalDeviceType::DISCRETE_GPU => DeviceKind::Discrete,
        vk::PhysicalDeviceType::INTEGRATED_GPU => DeviceKind::Integrated,
        vk::PhysicalDeviceType::VIRTUAL_GPU => DeviceKind::Virtual,
        vk::PhysicalDeviceType::CPU => DeviceKind::Cpu,
        _ => DeviceKind::Other,
    }
}

/// The first queue family that computes, one that draws as well before others.
fn compute_family(families: &[vk::QueueFamilyProperties]) -> Option<u32> {
    let first = |flags| families.iter().position(|family| family.queue_flags.contains(flags));
    let place =
        first(vk::QueueFlags::COMPUTE | vk::QueueFlags::GRAPHICS).or(first(vk::QueueFlags::COMPUTE))?;
    u32::try_from(place).ok()
}

fn limits_of(limits: &vk::PhysicalDeviceLimits, driver: vk::DriverId) -> Limits {
    Limits {
        storage_buffer_bytes: u64::from(limits.max_storage_buffer_range),
        texel_elements: u64::from(limits.max_texel_buffer_elements),
        image_side: limits.max_image_dimension2_d,
        workgroups: limits.max_compute_work_group_count[0],
        // Gallium's LP_MAX_TGSI_LOOP_ITERATIONS, over all loops of an invocation together.
        loop_iterations: (driver == vk::DriverId::MESA_LLVMPIPE).then_some(65_535),
    }
}

/// Storage buffers that the kernels bind at most.
const STORAGE_BUFFERS: u32 = 8;
/// Invocations of the kernels' largest workgroups.
pub const WORKGROUP_INVOCATIONS: u32 = 256;

fn unusable(has_12: bool, family: Option<u32>, limits: &vk::PhysicalDeviceLimits) -> Option<String> {
    if !has_12 {
        return Some("its driver has no Vulkan 1.2: update the driver".into());
    }
    if family.is_none() {
        return Some("it has no compute queue".into());
    }
    let invocations = limits.max_compute_work_group_invocations.min(limits.max_compute_work_group_size[0]);
    if invocations < WORKGROUP_INVOCATIONS {
        return Some(format!("its workgroups have fewer than {WORKGROUP_INVOCATIONS} invocations"));
    }
    if limits.max_per_stage_descriptor_storage_buffers < STORAGE_BUFFERS {
        return Some(format!("its shaders take fewer than {STORAGE_BUFFERS} storage buffers"));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_with_too_small_workgroups_is_refused() {
        let with = |invocations, side| vk::PhysicalDeviceLimits {
            max_compute_work_group_invocations: invocations,
            max_compute_work_group_size: [side, 1024, 64],
            max_per_stage_descriptor_storage_buffers: STORAGE_BUFFERS,
            ..Default::default()
        };
        let refusal = |limits| unusable(true, Some(0), &limits);
        assert_eq!(refusal(with(256, 256)), None);
        for limits in [with(128, 1024), with(1024, 128)] {
            assert_eq!(refusal(limits).as_deref(), Some("its workgroups have fewer than 256 invocations"));
        }
    }
}
