//! Whether the device ran at one speed all the time.

use std::cell::RefCell;

use crate::error::Result;
use crate::lab::statistics::Median;
use crate::render::clock::ClockProbe;
use crate::vk::Device;

/// Times of a fixed amount of work, taken now and then.
pub struct Drift<'a> {
    probe: ClockProbe<'a>,
    times: RefCell<Vec<f64>>,
}

/// Successive times whose median stands for a moment.
const WINDOW: usize = 3;

impl<'a> Drift<'a> {
    pub fn new(device: &'a Device) -> Result<Self> {
        let probe = ClockProbe::new(device)?;
        // The first ones show how the device wakes up.
        probe.measure()?;
        probe.measure()?;
        Ok(Self { probe, times: RefCell::default() })
    }

    pub fn measure(&self) -> Result<()> {
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
