//! Keeps a GPU's clock up over pauses. NVIDIA's driver lets it fall to a quarter or less three to four seconds after a device was opened, if the device had little to do
//! since; then it takes about a second of uninterrupted work to bring it up again, and short work alone never does. Opening another logical device of the same GPU raises it
//! at once, for three seconds at least (measured on an H100: docs/measurements.md). Large scenes take longer than that to load, and frames that the host waits for leave the device idle.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use ash::vk;

use super::device::{Device, Shared};

/// For so long the clock is up after it was raised.
const AWAKE: Duration = Duration::from_secs(2);
/// A device that was at work for so long, or for half of at least so long, keeps its clock. (A host that looks late takes it for work; ours waits at once.)
const BUSY_SPELL: Duration = Duration::from_secs(1);

/// What a device had to do lately.
pub(super) struct Wakefulness(Mutex<Lately>);

struct Lately {
    /// When the clock was up for sure.
    since: Instant,
    /// Submissions that the device is not done with, and since when there are any.
    under_way: u32,
    began: Instant,
    /// How long there were some since the clock was up.
    busy: Duration,
}

impl Lately {
    fn new(now: Instant) -> Self {
        Self { since: now, under_way: 0, began: now, busy: Duration::ZERO }
    }

    fn begin(&mut self, now: Instant) {
        if self.under_way == 0 {
            self.began = now;
        }
        self.under_way += 1;
    }

    fn end(&mut self, now: Instant) {
        self.under_way = self.under_way.saturating_sub(1);
        if self.under_way == 0 {
            let spell = now.saturating_duration_since(self.began);
            self.busy += spell;
            let elapsed = now.saturating_duration_since(self.since);
            if spell >= BUSY_SPELL || elapsed >= BUSY_SPELL && self.busy * 2 >= elapsed {
                *self = Self::new(now);
            }
        }
    }

    /// Whether the clock may have fallen. Who is told so raises it: the next one to ask is told that it is up.
    fn may_sleep(&mut self, now: Instant) -> bool {
        let sleeps = self.under_way == 0 && now.saturating_duration_since(self.since) >= AWAKE;
        if sleeps {
            *self = Self::new(now);
        }
        sleeps
    }
}

impl Wakefulness {
    pub(super) fn new() -> Self {
        Self(Mutex::new(Lately::new(Instant::now())))
    }

    fn lately(&self) -> MutexGuard<'_, Lately> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn begin(&self) {
        self.lately().begin(Instant::now());
    }

    pub(super) fn end(&self) {
        self.lately().end(Instant::now());
    }
}

impl Device {
    /// Whether the device's clock may have fallen. Who is told so calls [`Device::raise_clock`]: the next one to ask is told that it is up.
    pub fn may_sleep(&self) -> bool {
        self.shared.may_sleep()
    }

    /// Raises the device's clock, whether it fell or not, which takes about 0.1 s; work goes on meanwhile.
    pub fn raise_clock(&self) {
        self.shared.raise_clock();
    }

    /// Raises the device's clock if it may have fallen. Batches do so by themselves; before a frame whose wall time is measured it is called so that they need not.
    pub fn wake(&self) {
        self.shared.wake();
    }
}

impl Shared {
    fn may_sleep(&self) -> bool {
        self.adapter.clock_falls && self.wakefulness.lately().may_sleep(Instant::now())
    }

    pub(super) fn wake(&self) {
        if self.may_sleep() {
            self.raise_clock();
        }
    }

    fn raise_clock(&self) {
        self.wakefulness.lately().since = Instant::now();
        let priorities = [1.0];
        let queues = [vk::DeviceQueueCreateInfo::default()
            .queue_family_index(self.adapter.queue_family)
            .queue_priorities(&priorities)];
        let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues);
        let vulkan = &self.instance.shared.raw;
        // SAFETY: the adapter comes from this instance, `info` lives until the call returns, and nothing is made from the second device. One that can't be had is no loss but of
        // time.
        unsafe {
            if let Ok(second) = vulkan.create_device(self.adapter.raw, &info, None) {
                second.destroy_device(None);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_with_little_to_do_are_woken_once_and_busy_ones_never() {
        let start = Instant::now();
        let after = |ms: u64| start + Duration::from_millis(ms);
        let mut idle = Lately::new(start);
        assert!(!idle.may_sleep(after(1999)));
        assert!(idle.may_sleep(after(2000)));
        assert!(!idle.may_sleep(after(2001)), "it was told already");
        assert!(idle.may_sleep(after(4000)));

        let mut short_work = Lately::new(start);
        for frame in 0..20 {
            short_work.begin(after(100 * frame));
            short_work.end(after(100 * frame + 30));
        }
        assert!(short_work.may_sleep(after(2100)));

        let mut at_work = Lately::new(start);
        for frame in 0..20 {
            at_work.begin(after(100 * frame));
            at_work.end(after(100 * frame + 70));
        }
        assert!(!at_work.may_sleep(after(2100)));
        assert!(at_work.may_sleep(after(4100)), "what it did before counts no more");

        let mut long_work = Lately::new(start);
        long_work.begin(after(10));
        long_work.end(after(60_000));
        assert!(!long_work.may_sleep(after(61_900)));
        assert!(long_work.may_sleep(after(62_000)));

        let mut long_work_after_a_pause = Lately::new(start);
        long_work_after_a_pause.begin(after(5000));
        long_work_after_a_pause.end(after(6000));
        assert!(!long_work_after_a_pause.may_sleep(after(7999)));

        let mut two_at_a_time = Lately::new(start);
        two_at_a_time.begin(after(10));
        two_at_a_time.begin(after(20));
        two_at_a_time.end(after(900));
        assert!(!two_at_a_time.may_sleep(after(5000)), "one is under way");
        two_at_a_time.end(after(5000));
        assert!(!two_at_a_time.may_sleep(after(5001)));
    }
}
