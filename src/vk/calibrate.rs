//! The device's clock against the host's, so that what a device did can be shown beside what the host did.

use std::ffi::CStr;
use std::time::Instant;

use ash::{ext, khr, vk};

use super::device::Device;
use super::failed;
use super::timing::DeviceClock;
use crate::error::Result;

/// Which extension reads the device's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Calibrator {
    Ext,
    Khr,
}

impl Calibrator {
    pub(super) fn extension(self) -> &'static CStr {
        match self {
            Self::Ext => ext::calibrated_timestamps::NAME,
            Self::Khr => khr::calibrated_timestamps::NAME,
        }
    }

    /// The extension with which this device's own clock can be read, if there is one.
    pub(super) fn probe(
        entry: &ash::Entry,
        instance: &ash::Instance,
        raw: vk::PhysicalDevice,
        offered: impl Fn(&CStr) -> bool,
    ) -> Option<Self> {
        let known = [
            (Self::Ext, c"vkGetPhysicalDeviceCalibrateableTimeDomainsEXT"),
            (Self::Khr, c"vkGetPhysicalDeviceCalibrateableTimeDomainsKHR"),
        ];
        known.into_iter().find_map(|(calibrator, function)| {
            if !offered(calibrator.extension()) {
                return None;
            }
            // SAFETY: the instance is alive. A function that the loader does not have must not be called:
            // ash would panic.
            unsafe { entry.get_instance_proc_addr(instance.handle(), function.as_ptr())? };
            // SAFETY: the device offers the extension and the loader has its function.
            let domains = unsafe {
                match calibrator {
                    Self::Ext => ext::calibrated_timestamps::Instance::new(entry, instance)
                        .get_physical_device_calibrateable_time_domains(raw),
                    Self::Khr => khr::calibrated_timestamps::Instance::new(entry, instance)
                        .get_physical_device_calibrateable_time_domains(raw),
                }
            };
            domains.ok()?.contains(&vk::TimeDomainKHR::DEVICE).then_some(calibrator)
        })
    }
}

/// Reads the clock of a device.
pub(super) enum ClockReader {
    Ext(ext::calibrated_timestamps::Device),
    Khr(khr::calibrated_timestamps::Device),
}

impl ClockReader {
    /// The device must have been made with the extension; `None` if its driver left the function out.
    pub(super) fn new(
        instance: &ash::Instance,
        device: &ash::Device,
        calibrator: Calibrator,
    ) -> Option<Self> {
        let function = match calibrator {
            Calibrator::Ext => c"vkGetCalibratedTimestampsEXT",
            Calibrator::Khr => c"vkGetCalibratedTimestampsKHR",
        };
        // SAFETY: the device is alive and was made from the instance.
        unsafe { instance.get_device_proc_addr(device.handle(), function.as_ptr())? };
        Some(match calibrator {
            Calibrator::Ext => Self::Ext(ext::calibrated_timestamps::Device::new(instance, device)),
            Calibrator::Khr => Self::Khr(khr::calibrated_timestamps::Device::new(instance, device)),
        })
    }

    fn ticks(&self) -> std::result::Result<u64, vk::Result> {
        let domain = [vk::CalibratedTimestampInfoKHR::default().time_domain(vk::TimeDomainKHR::DEVICE)];
        // SAFETY: the device is alive as long as its reader and its clock can be read (`Calibrator::probe`).
        let (ticks, _) = unsafe {
            match self {
                Self::Ext(functions) => functions.get_calibrated_timestamps(&domain)?,
                Self::Khr(functions) => functions.get_calibrated_timestamps(&domain)?,
            }
        };
        ticks.first().copied().ok_or(vk::Result::ERROR_UNKNOWN)
    }
}

/// The same moment on both clocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair {
    pub device_ns: u64,
    pub host: Instant,
    /// By how much the host's time may be off, ns.
    pub deviation_ns: u64,
}

/// Places times of a device's clock ([`super::Timing`]) on the host's.
#[derive(Clone, Debug)]
pub struct Calibration {
    first: Pair,
    last: Pair,
    /// Time after which the device's clock starts again at 0, ns.
    range_ns: Option<u64>,
}

/// Readings of which the tightest is kept: now and then the host is interrupted in between.
const READINGS: usize = 16;
/// Between two pairs that are closer, their deviations would pass for a difference in speed, ns.
const SHORTEST_SPAN_NS: f64 = 1e9;

impl Calibration {
    /// Reads both clocks; `None` where the device's can't be read.
    pub fn new(device: &Device) -> Result<Option<Self>> {
        let Some(pair) = read(device)? else { return Ok(None) };
        let range_ns = device.shared.adapter.timestamps.and_then(|clock| DeviceClock::new(clock).range_ns());
        Ok(Some(Self::of_pairs(pair, pair, range_ns)))
    }

    /// Of two moments. `range_ns`: after which time the device's clock starts again at 0.
    pub fn of_pairs(first: Pair, last: Pair, range_ns: Option<u64>) -> Self {
        Self { first, last, range_ns }
    }

    /// Reads both clocks once more, which corrects for a device's clock that runs at another speed.
    pub fn again(&mut self, device: &Device) -> Result<()> {
        if let Some(pair) = read(device)? {
            self.last = pair;
        }
        Ok(())
    }

    /// The larger deviation of the pairs, ns.
    pub fn deviation_ns(&self) -> u64 {
        self.first.deviation_ns.max(self.last.deviation_ns)
    }

    /// A time of the device's clock as ns after `origin`.
    pub fn host_ns(&self, device_ns: u64, origin: Instant) -> f64 {
        let host = |instant: Instant| match instant.checked_duration_since(origin) {
            Some(after) => after.as_secs_f64() * 1e9,
            None => -origin.duration_since(instant).as_secs_f64() * 1e9,
        };
        let start = host(self.first.host);
        let (device_span, host_span) = (self.after_first(self.last.device_ns), host(self.last.host) - start);
        let speed = if device_span.min(host_span) > SHORTEST_SPAN_NS { host_span / device_span } else { 1.0 };
        start + self.after_first(device_ns) * speed
    }

    /// Device time since the first pair, ns; negative before it.
    fn after_first(&self, device_ns: u64) -> f64 {
        let mut after = i128::from(device_ns) - i128::from(self.first.device_ns);
        if let Some(range) = self.range_ns.map(i128::from) {
            if after < -range / 2 {
                after += range;
            } else if after > range / 2 {
                after -= range;
            }
        }
        after as f64
    }
}

/// The tightest of some readings. The device's clock is read between two looks at the host's, so this needs no
/// clock of the host that Vulkan knows by name.
fn read(device: &Device) -> Result<Option<Pair>> {
    let shared = &device.shared;
    let (Some(reader), Some(timestamps)) = (&shared.clock, shared.adapter.timestamps) else {
        return Ok(None);
    };
    let clock = DeviceClock::new(timestamps);
    let mut tightest: Option<Pair> = None;
    for _ in 0..READINGS {
        let before = Instant::now();
        let ticks = reader.ticks().map_err(|result| failed("Reading the device's clock", result))?;
        let half = before.elapsed() / 2;
        let deviation_ns = u64::try_from(half.as_nanos()).unwrap_or(u64::MAX);
        if tightest.is_none_or(|pair| deviation_ns < pair.deviation_ns) {
            tightest = Some(Pair { device_ns: clock.ns(ticks), host: before + half, deviation_ns });
        }
    }
    Ok(tightest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn pair(device_ns: u64, host: Instant) -> Pair {
        Pair { device_ns, host, deviation_ns: 10 }
    }

    #[test]
    fn device_times_land_on_the_hosts_clock() {
        let origin = Instant::now();
        let at = |ms| origin + Duration::from_millis(ms);
        let one = Calibration::of_pairs(pair(5_000, at(1)), pair(5_000, at(1)), None);
        assert_eq!(one.host_ns(6_000, origin), 1_001_000.0);
        assert_eq!(one.host_ns(4_000, at(2)), -1_001_000.0, "before the pair and before the origin");
        // A device's clock that is a thousandth too fast, seen over ten seconds.
        let fast = Calibration::of_pairs(pair(0, at(0)), pair(10_010_000_000, at(10_000)), None);
        assert!((fast.host_ns(5_005_000_000, origin) - 5e9).abs() < 1.0);
        // Over a millisecond the same would be noise.
        let noise = Calibration::of_pairs(pair(0, at(0)), pair(1_001_000, at(1)), None);
        assert_eq!(noise.host_ns(500_000, origin), 500_000.0);
    }

    #[test]
    fn a_clock_that_starts_again_is_followed() {
        let origin = Instant::now();
        let wraps = Calibration::of_pairs(pair(990, origin), pair(990, origin), Some(1_000));
        assert_eq!(wraps.host_ns(5, origin), 15.0);
        let back = Calibration::of_pairs(pair(5, origin), pair(5, origin), Some(1_000));
        assert_eq!(back.host_ns(990, origin), -15.0);
    }
}
