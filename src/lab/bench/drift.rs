//! Whether the device ran at one speed all the time.

use std::cell::{Cell, RefCell};
use std::time::{Duration, Instant};

use crate::error::Result;
use crate::lab::statistics::Median;
use crate::render::clock::ClockProbe;
use crate::vk::{Device, DeviceKind};

/// Times of a fixed amount of work, taken now and then.
pub struct Drift<'a> {
    probe: ClockProbe<'a>,
    times: RefCell<Vec<f64>>,
    /// Shortest time of the probe so far, ms.
    fastest: Cell<f64>,
    awake: Cell<bool>,
    /// The device is the host's own processor.
    never_sleeps: bool,
}

/// Work that is handed to a waking device at a time, ms.
const LOAD_MS: f64 = 20.0;
/// So many times in a row that are within this of the fastest one seen.
const STEADY: u32 = 3;
const AS_FAST: f64 = 1.02;
const FIRST_WAKE: Duration = Duration::from_millis(1500);
/// A device that is shared, or throttled, may never come back to its fastest.
const LONGEST_WAKE: Duration = Duration::from_secs(3);
/// Successive times whose median stands for a moment.
const WINDOW: usize = 3;

impl<'a> Drift<'a> {
    pub fn new(device: &'a Device) -> Result<Self> {
        let probe = ClockProbe::new(device)?;
        let fastest = Cell::new(probe.measure()?);
        let never_sleeps = device.adapter().kind == DeviceKind::Cpu;
        Ok(Self { probe, times: RefCell::default(), fastest, awake: Cell::new(false), never_sleeps })
    }

    /// Keeps the device at work until its clock rises no more, since a device that waited for the host has let it
    /// fall; at once done where it did not.
    pub fn wake(&self) -> Result<()> {
        if self.never_sleeps {
            return Ok(());
        }
        let begin = Instant::now();
        // How fast it can be is not known at first.
        let least = if self.awake.replace(true) { Duration::ZERO } else { FIRST_WAKE };
        let mut steady = 0;
        while (steady < STEADY || begin.elapsed() < least) && begin.elapsed() < LONGEST_WAKE {
            let known = self.fastest.get();
            let probes = (LOAD_MS / known.min(LOAD_MS)) as u32;
            let ms = self.probe.measure_in_a_row(probes)?;
            steady = if ms <= known * AS_FAST { steady + 1 } else { 0 };
            self.fastest.set(known.min(ms));
        }
        Ok(())
    }

    /// Notes how fast the device is, after it was woken.
    pub fn measure(&self) -> Result<()> {
        self.wake()?;
        let ms = self.probe.measure()?;
        self.times.borrow_mut().push(ms);
        Ok(())
    }

    /// The slowest moment's time over the fastest one's; `None` if there were fewer than two.
    pub fn spread(&self) -> Option<f64> {
        spread_of(&self.times.borrow())
    }
}

fn spread_of(times: &[f64]) -> Option<f64> {
    let medians: Vec<f64> =
        times.chunks_exact(WINDOW).filter_map(Median::of).map(|median| median.median).collect();
    let slowest = medians.iter().copied().fold(0.0, f64::max);
    let fastest = medians.iter().copied().fold(f64::INFINITY, f64::min);
    (medians.len() >= 2 && fastest > 0.0).then(|| slowest / fastest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_disturbance_is_no_drift_and_a_lasting_one_is() {
        assert_eq!(spread_of(&[1.0; 5]), None);
        let mut times = vec![2.0; 20];
        times[7] = 9.0;
        assert_eq!(spread_of(&times), Some(1.0));
        times[10..].fill(2.5);
        assert_eq!(spread_of(&times), Some(1.25));
    }
}
