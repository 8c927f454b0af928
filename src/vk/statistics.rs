//! What a driver's compiler tells of a kernel: registers, stack, shared memory.

use std::ffi::c_char;
use std::fmt;

use ash::{khr, vk};
use serde::Serialize;

use super::failed;
use super::kernel::Pipeline;
use crate::error::Result;

/// A value as the driver gave it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum StatisticValue {
    Bool(bool),
    Signed(i64),
    Unsigned(u64),
    Float(f64),
}

impl StatisticValue {
    /// As a count; `None` if it is none, or beyond 32 bits.
    fn count(self) -> Option<u32> {
        match self {
            Self::Bool(_) => None,
            Self::Signed(value) => u32::try_from(value).ok(),
            Self::Unsigned(value) => u32::try_from(value).ok(),
            Self::Float(value) => (value >= 0.0 && value < f64::from(u32::MAX)).then_some(value as u32),
        }
    }
}

impl fmt::Display for StatisticValue {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bool(value) => value.fmt(out),
            Self::Signed(value) => value.fmt(out),
            Self::Unsigned(value) => value.fmt(out),
            Self::Float(value) => value.fmt(out),
        }
    }
}

/// A statistic under the driver's own name.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Statistic {
    pub name: String,
    pub description: String,
    pub value: StatisticValue,
}

/// What the driver's compiler tells of a kernel (VK_KHR_pipeline_executable_properties). Names are the driver's
/// own, so a field is `None` where none of its statistics is known to be that.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PipelineStatistics {
    /// 32-bit registers of an invocation.
    pub registers: Option<u32>,
    /// Bytes of an invocation's stack, which lie in device memory.
    pub stack_bytes: Option<u32>,
    /// Shared memory of a workgroup, bytes.
    pub shared_bytes: Option<u32>,
    /// Subgroup size that the kernel was compiled for.
    pub subgroup_size: Option<u32>,
    /// Everything that the driver told.
    pub raw: Vec<Statistic>,
}

/// Parts of names in lower case, best first: NVIDIA's, then those of Mesa's drivers and AMD's.
const REGISTERS: &[&str] = &["register count", "vgprs", "number of gprs", "grf registers", "registers"];
const STACK: &[&str] = &["stack size", "scratch", "local memory", "slm size"];
const SHARED: &[&str] = &["shared memory", "workgroup memory", "lds size", "lds"];
/// Names with one of these tell something else.
const NOT_THAT: &[&str] = &["spill", "fill", "available", "instruction", "limit"];

impl PipelineStatistics {
    /// Finds what is known in the driver's list.
    pub fn of(raw: Vec<Statistic>, subgroup_size: Option<u32>) -> Self {
        Self {
            registers: find(&raw, REGISTERS),
            stack_bytes: find(&raw, STACK),
            shared_bytes: find(&raw, SHARED),
            subgroup_size,
            raw,
        }
    }
}

/// The first statistic with the best part in its name.
fn find(raw: &[Statistic], parts: &[&str]) -> Option<u32> {
    let has = |name: &str, part: &&str| name.contains(*part);
    parts.iter().find_map(|part| {
        raw.iter().find_map(|statistic| {
            let name = statistic.name.to_lowercase();
            (has(&name, part) && !NOT_THAT.iter().any(|other| has(&name, other)))
                .then(|| statistic.value.count())
                .flatten()
        })
    })
}

/// Asks for statistics of a pipeline.
pub(super) struct StatisticsReader(khr::pipeline_executable_properties::Device);

impl StatisticsReader {
    /// The device must have been made with the extension; `None` if its driver left a function out, which ash
    /// would answer with a panic.
    pub(super) fn new(instance: &ash::Instance, device: &ash::Device) -> Option<Self> {
        for function in [c"vkGetPipelineExecutablePropertiesKHR", c"vkGetPipelineExecutableStatisticsKHR"] {
            // SAFETY: the device is alive and was made from the instance.
            unsafe { instance.get_device_proc_addr(device.handle(), function.as_ptr())? };
        }
        Some(Self(khr::pipeline_executable_properties::Device::new(instance, device)))
    }
}

impl Pipeline {
    /// What the driver's compiler tells of this kernel; `None` where the device doesn't tell, or where the kernel
    /// was not made by [`Pipeline::with_statistics`].
    pub fn statistics(&self) -> Result<Option<PipelineStatistics>> {
        let (true, Some(StatisticsReader(functions))) = (self.captures, &self.device.statistics) else {
            return Ok(None);
        };
        let fail = |result| failed(&format!("Asking for statistics of {}", self.kernel.name), result);
        let info = vk::PipelineInfoKHR::default().pipeline(self.raw);
        // SAFETY: the device has the extension with its feature, and the pipeline is alive.
        let executables = unsafe { functions.get_pipeline_executable_properties(&info) }.map_err(fail)?;
        let mut raw = Vec::new();
        for index in 0..executables.len() as u32 {
            let info = vk::PipelineExecutableInfoKHR::default().pipeline(self.raw).executable_index(index);
            // SAFETY: as above; the pipeline has an executable of this index and captured its statistics.
            let found = unsafe { functions.get_pipeline_executable_statistics(&info) }.map_err(fail)?;
            raw.extend(found.iter().filter_map(statistic));
        }
        let subgroup = executables.iter().map(|executable| executable.subgroup_size).find(|size| *size > 0);
        Ok(Some(PipelineStatistics::of(raw, subgroup)))
    }
}

/// `None` for a format of value that is not known.
fn statistic(found: &vk::PipelineExecutableStatisticKHR<'_>) -> Option<Statistic> {
    use vk::PipelineExecutableStatisticFormatKHR as Format;
    // SAFETY: the union was zeroed and the driver wrote the member that the format names; any bits are a value
    // of each member.
    let value = unsafe {
        match found.format {
            Format::BOOL32 => StatisticValue::Bool(found.value.b32 != 0),
            Format::INT64 => StatisticValue::Signed(found.value.i64),
            Format::UINT64 => StatisticValue::Unsigned(found.value.u64),
            Format::FLOAT64 => StatisticValue::Float(found.value.f64),
            _ => return None,
        }
    };
    Some(Statistic { name: text(&found.name), description: text(&found.description), value })
}

/// Text up to its end, whether or not the driver marked that.
fn text(letters: &[c_char]) -> String {
    let bytes: Vec<u8> = letters.iter().map(|&letter| letter as u8).take_while(|&byte| byte != 0).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(list: &[(&str, u64)]) -> [Option<u32>; 3] {
        let statistic = |(name, value): &(&str, u64)| Statistic {
            name: name.to_string(),
            description: String::new(),
            value: StatisticValue::Unsigned(*value),
        };
        let found = PipelineStatistics::of(list.iter().map(statistic).collect(), None);
        [found.registers, found.stack_bytes, found.shared_bytes]
    }

    #[test]
    fn the_names_of_several_drivers_are_understood() {
        let nvidia = [
            ("Register Count", 62),
            ("Binary Size", 9216),
            ("Stack Size", 272),
            ("Local Memory Size", 0),
            ("Shared Memory Size", 1024),
        ];
        assert_eq!(of(&nvidia), [Some(62), Some(272), Some(1024)]);
        let radv = [
            ("SGPRs", 128),
            ("VGPRs", 48),
            ("Spilled SGPRs", 0),
            ("Spilled VGPRs", 3),
            ("LDS size", 512),
            ("Scratch size", 64),
        ];
        assert_eq!(of(&radv), [Some(48), Some(64), Some(512)]);
        let anv = [("Instruction Count", 900), ("Spill count", 0), ("Scratch Memory Size", 128)];
        assert_eq!(of(&anv), [None, Some(128), None]);
        assert_eq!(of(&[]), [None; 3]);
        assert_eq!(of(&[("REGISTER COUNT", u64::MAX)]), [None; 3], "no number of registers");
    }

    #[test]
    fn a_name_without_end_is_cut_at_the_field() {
        assert_eq!(text(&[b'a' as c_char; 256]).len(), 256);
        assert_eq!(text(&[b'a' as c_char, 0, b'b' as c_char]), "a");
    }
}
