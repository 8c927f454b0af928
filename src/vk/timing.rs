//! When a batch was recorded, handed over and done: by the host's clock and by the device's.

use std::time::Instant;

/// How the device counts time.
#[derive(Clone, Copy, Debug)]
pub(super) struct DeviceClock {
    /// Duration of a tick, ns.
    period_ns: f64,
    /// How many bits of a tick count; they wrap around.
    bits: u32,
}

impl DeviceClock {
    pub(super) fn new((period_ns, bits): (f64, u32)) -> Self {
        Self { period_ns, bits: bits.min(64) }
    }

    fn mask(self) -> u64 {
        if self.bits >= 64 { u64::MAX } else { (1 << self.bits) - 1 }
    }

    /// Ticks as ns since the clock last stood at 0.
    pub(super) fn ns(self, ticks: u64) -> u64 {
        // Ticks can pass 2^53; the period is a 24-bit float, so 32 bits behind the point hold it.
        let period = (self.period_ns * 4_294_967_296.0) as u128;
        u64::try_from((u128::from(ticks & self.mask()) * period) >> 32).unwrap_or(u64::MAX)
    }

    /// Time from one count of ticks to a later one, ms.
    pub(super) fn ms_between(self, from: u64, to: u64) -> f64 {
        (to.wrapping_sub(from) & self.mask()) as f64 * self.period_ns * 1e-6
    }

    /// Time after which the clock stands at 0 again, ns; `None` if no one lives to see it.
    pub(super) fn range_ns(self) -> Option<u64> {
        (self.bits < 64).then(|| self.ns(u64::MAX).saturating_add(self.ns(1)))
    }
}

/// The time of one dispatch.
#[derive(Clone, Debug, PartialEq)]
pub struct Timing {
    pub label: String,
    /// Device time from the start of the dispatch to its end, ms; `None` on a device without timestamps.
    pub gpu_ms: Option<f64>,
    /// The device's clock at the start, ns; [`super::Calibration`] places it on the host's clock.
    pub start_ns: Option<u64>,
    /// The device's clock at the end, ns.
    pub end_ns: Option<u64>,
}

impl Timing {
    /// `ticks` at start and end.
    pub(super) fn new(label: String, ticks: Option<(u64, u64)>, clock: DeviceClock) -> Self {
        Self {
            label,
            gpu_ms: ticks.map(|(start, end)| clock.ms_between(start, end)),
            start_ns: ticks.map(|(start, _)| clock.ns(start)),
            end_ns: ticks.map(|(_, end)| clock.ns(end)),
        }
    }
}

/// What the host did with a batch, by its own clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HostTimes {
    /// Recording began.
    pub record: Instant,
    /// Recording was over and the work was handed to the driver.
    pub submit: Instant,
    /// The driver had taken it.
    pub submitted: Instant,
    /// The host began to wait.
    pub wait: Instant,
    /// The device was done.
    pub waited: Instant,
    /// The timestamps were read, for which some drivers wait until all other work is done too.
    pub read: Instant,
}

/// What came of a batch.
#[derive(Clone, Debug)]
pub struct Finished {
    /// One for each dispatch, in order.
    pub timings: Vec<Timing>,
    pub host: HostTimes,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_become_ns_without_loss_and_wrap_around() {
        let nanoseconds = DeviceClock::new((1.0, 64));
        assert_eq!(nanoseconds.ns(1_700_000_000_123_456_789), 1_700_000_000_123_456_789);
        assert_eq!(nanoseconds.range_ns(), None);
        let short = DeviceClock::new((52.083_332_061_767_58, 36));
        assert_eq!(short.ns(12), 624);
        assert_eq!(short.ns((1 << 36) + 12), 624, "bits beyond the valid ones do not count");
        let ms = short.ms_between((1 << 36) - 6, 6);
        assert!((ms - 12.0 * 52.083_332e-6).abs() < 1e-9, "{ms}");
        assert!(short.range_ns().is_some_and(|range| range.abs_diff(3_579_139_325_952) < 1_000_000));
    }
}
