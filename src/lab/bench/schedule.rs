//! In which order frames are measured, how many of them, and of how much of a picture. Pure: it sees times only.

use crate::error::Result;
use crate::layout::WORKGROUP_SIZE;
use crate::render::seeds::hash;
use crate::vk::DeviceKind;

/// How much is spent on a row.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Exactly so many frames, where that was asked for.
    pub frames: Option<u32>,
    /// So many frames are enough,
    pub most: u32,
    /// and so are fewer that take this long together, ms,
    pub enough_ms: f64,
    /// but not fewer than this.
    pub fewest: u32,
    /// Frames that run before and are thrown away.
    pub warm_up: u32,
    /// A row that would take longer than this runs on a part of its rays, ms.
    pub longest_ms: f64,
}

impl Effort {
    /// A row that is worth reporting.
    pub const FULL: Self =
        Self { frames: None, most: 30, enough_ms: 3000.0, fewest: 6, warm_up: 2, longest_ms: 10_000.0 };
    /// A first look.
    pub const QUICK: Self = Self { most: 8, enough_ms: 150.0, longest_ms: 1000.0, ..Self::FULL };

    fn enough(&self, times: &[f64]) -> bool {
        let count = times.len() as u32;
        match self.frames {
            Some(frames) => count >= frames,
            None => count >= self.most || count >= self.fewest && times.iter().sum::<f64>() >= self.enough_ms,
        }
    }

    /// Frames that a slow row runs.
    fn least_frames(&self) -> u32 {
        self.warm_up + self.frames.unwrap_or(self.fewest)
    }
}

/// What can be run again and again; the time of a frame in ms.
pub trait Repeat {
    fn frame_ms(&mut self) -> Result<f64>;
}

/// Runs the rows' frames in rounds, each row once a round, in an order that is drawn anew for every round. `begin_round`
/// runs before each; `done` gets a row and its times as soon as they are enough, or the error that ended it. Only what
/// those two return ends the whole.
pub fn interleave<R: Repeat>(
    rows: Vec<R>,
    effort: &Effort,
    seed: u32,
    begin_round: &mut dyn FnMut() -> Result<()>,
    done: &mut dyn FnMut(R, Result<Vec<f64>>) -> Result<()>,
) -> Result<()> {
    let mut rows: Vec<Option<(R, Vec<f64>)>> = rows.into_iter().map(|row| Some((row, Vec::new()))).collect();
    let mut round = 0;
    while !rows.is_empty() {
        begin_round()?;
        for place in shuffled(rows.len(), seed, round) {
            let Some((mut row, mut times)) = rows[place].take() else { continue };
            match row.frame_ms() {
                Ok(ms) => times.push(ms),
                Err(error) => {
                    done(row, Err(error))?;
                    continue;
                }
            }
            if effort.enough(&times) {
                done(row, Ok(times))?;
            } else {
                rows[place] = Some((row, times));
            }
        }
        rows.retain(Option::is_some);
        round += 1;
    }
    Ok(())
}

/// The places of `count` things in a random order.
pub fn shuffled(count: usize, seed: u32, round: u32) -> Vec<usize> {
    let mut places: Vec<usize> = (0..count).collect();
    for last in (1..count).rev() {
        let drawn = u64::from(hash(last as u32, hash(round, seed)));
        // The high word of the product is uniform in 0..=last.
        places.swap(last, ((drawn * (last as u64 + 1)) >> 32) as usize);
    }
    places
}

/// How a device takes a part of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Width {
    /// Spans that a part of a picture is spread over. They run one after the other, so a wide device gets one.
    pub parts: u32,
    /// Invocations that run at once: fewer take as long as these.
    pub at_once: u32,
}

impl Width {
    /// A GPU runs some 2048 invocations on each of a hundred multiprocessors or so.
    pub fn of(kind: DeviceKind) -> Self {
        match kind {
            DeviceKind::Cpu => Self { parts: 32, at_once: 1 },
            _ => Self { parts: 1, at_once: 1 << 18 },
        }
    }
}

/// Spans of about this share of `elements` (a multiple of the workgroup's size, such as pixel numbers), spread over all
/// of them; each begins and ends between two workgroups. A smaller share lies within a larger one.
pub fn spans(elements: u32, share: f64, width: Width) -> Vec<(u32, u32)> {
    let groups = elements / WORKGROUP_SIZE;
    let parts = width.parts;
    if share >= 1.0 || groups <= parts {
        return vec![(0, elements)];
    }
    let edge = |part: u32| (u64::from(groups) * u64::from(part) / u64::from(parts)) as u32;
    let span = |part: u32| {
        let (first, room) = (edge(part), edge(part + 1) - edge(part));
        let taken = ((f64::from(room) * share).round() as u32).clamp(1, room);
        // Each at another place of its part, so that they do not all meet the same columns.
        let place = (u64::from(hash(part, 0)) * u64::from(room)) >> 32;
        let before = (place * u64::from(room - taken) / u64::from(room)) as u32;
        ((first + before) * WORKGROUP_SIZE, (first + before + taken) * WORKGROUP_SIZE)
    };
    (0..parts).map(span).collect()
}

/// Elements in spans.
pub fn elements_in(spans: &[(u32, u32)]) -> u64 {
    spans.iter().map(|(begin, end)| u64::from(end - begin)).sum()
}

/// Measured times of a part tell enough from here on, ms.
const TELLING_MS: f64 = 300.0;

/// Runs a frame over spans; its time in ms.
pub type FrameOver<'a> = dyn FnMut(&[(u32, u32)]) -> Result<f64> + 'a;

/// How much of a picture of so many elements a row may take, in (0, 1], found by running growing parts of it:
/// `run` gives the time of a frame over spans. Never less than the device runs at once, since such a part would take
/// as long as a larger one.
pub fn share_that_fits(elements: u32, effort: &Effort, width: Width, run: &mut FrameOver<'_>) -> Result<f64> {
    let first = f64::from(width.parts) / f64::from((elements / WORKGROUP_SIZE).max(width.parts));
    let least = (f64::from(width.at_once) / f64::from(elements)).clamp(first, 1.0);
    let mut share = first;
    // Drivers that compile at the first dispatch do it now.
    run(&spans(elements, share, width))?;
    loop {
        let part = spans(elements, share, width);
        let ms = run(&part)?;
        let taken = elements_in(&part).max(u64::from(width.at_once)).clamp(1, u64::from(elements.max(1)));
        let whole_ms = ms * f64::from(elements) / taken as f64;
        let row_ms = whole_ms * f64::from(effort.least_frames());
        if share >= least && row_ms <= effort.longest_ms {
            return Ok(1.0);
        }
        if share >= least && ms >= TELLING_MS || share >= 1.0 {
            return Ok((effort.longest_ms / row_ms).clamp(least, 1.0));
        }
        // Not far beyond the least, where the first times tell.
        share = if share < least { (share * 8.0).min(least) } else { (share * 8.0).min(1.0) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;

    struct Fake {
        ms: f64,
        fails_at: Option<u32>,
        frames: u32,
    }

    impl Repeat for Fake {
        fn frame_ms(&mut self) -> Result<f64> {
            self.frames += 1;
            if self.fails_at == Some(self.frames) { Err(Error::device("lost")) } else { Ok(self.ms) }
        }
    }

    fn fake(ms: f64) -> Fake {
        Fake { ms, fails_at: None, frames: 0 }
    }

    #[test]
    fn rows_end_by_frames_or_by_time_and_a_failed_one_alone() {
        let rows = vec![fake(1.0), fake(2000.0), Fake { fails_at: Some(2), ..fake(3.0) }, fake(250.0)];
        let (mut rounds, mut ended) = (0, Vec::new());
        let mut begin = || {
            rounds += 1;
            Ok(())
        };
        interleave(rows, &Effort::FULL, 5, &mut begin, &mut |row, times| {
            ended.push((row.ms, times.map(|times| times.len()).ok()));
            Ok(())
        })
        .unwrap();
        ended.sort_by(|a, b| a.0.total_cmp(&b.0));
        assert_eq!(ended, [(1.0, Some(30)), (3.0, None), (250.0, Some(12)), (2000.0, Some(6))]);
        assert_eq!(rounds, 30);
    }

    #[test]
    fn every_order_is_a_permutation_and_rounds_differ() {
        let sorted = |mut places: Vec<usize>| {
            places.sort_unstable();
            places
        };
        for round in 0..50 {
            assert_eq!(sorted(shuffled(9, 3, round)), (0..9).collect::<Vec<_>>());
        }
        assert_ne!(shuffled(9, 3, 0), shuffled(9, 3, 1));
        let first: Vec<usize> = (0..3000).map(|round| shuffled(3, 1, round)[0]).collect();
        for place in 0..3 {
            let share = first.iter().filter(|&&drawn| drawn == place).count();
            assert!((900..1100).contains(&share), "{place}: {share}");
        }
    }

    #[test]
    fn spans_are_nested_in_order_and_of_the_size_asked_for() {
        let elements = 64 * 10_240;
        let cpu = Width::of(DeviceKind::Cpu);
        let mut larger = spans(elements, 1.0, cpu);
        for share in [0.9, 0.4, 0.05, 0.004] {
            let smaller = spans(elements, share, cpu);
            let got = elements_in(&smaller) as f64 / f64::from(elements);
            assert!((got / share - 1.0).abs() < 0.25, "{share}: {got}");
            assert!(smaller.windows(2).all(|pair| pair[0].1 <= pair[1].0));
            for &(begin, end) in &smaller {
                assert!(begin % 64 == 0 && end % 64 == 0 && begin < end);
                assert!(larger.iter().any(|&(first, last)| first <= begin && end <= last), "{share}");
            }
            larger = smaller;
        }
        assert_eq!(spans(64 * 20, 0.01, cpu), [(0, 64 * 20)]);
    }

    #[test]
    fn a_slow_row_gets_a_part_and_a_fast_one_all() {
        let elements = 64 * 10_240u32;
        let fits = |ms_per_element: f64| {
            share_that_fits(elements, &Effort::FULL, Width::of(DeviceKind::Cpu), &mut |spans| {
                Ok(ms_per_element * elements_in(spans) as f64)
            })
            .unwrap()
        };
        let whole_ms = |ms: f64| ms / f64::from(elements);
        assert_eq!(fits(whole_ms(100.0)), 1.0);
        assert_eq!(fits(whole_ms(1240.0)), 1.0);
        assert!((fits(whole_ms(20_000.0)) - 0.0625).abs() < 0.01);
        assert!((fits(whole_ms(1e7)) - 32.0 / 10_240.0).abs() < 1e-6, "never less than the smallest part");
    }

    /// A device that runs many invocations at once takes as long for fewer: what a small part of the picture takes says
    /// little of the whole.
    #[test]
    fn a_wide_device_is_not_judged_by_a_part_that_it_does_not_notice() {
        let elements = 64 * 10_240u32;
        let width = Width::of(DeviceKind::Discrete);
        let fits = |ms_when_full: f64| {
            share_that_fits(elements, &Effort::FULL, width, &mut |spans| {
                let taken = elements_in(spans).max(u64::from(width.at_once));
                Ok(ms_when_full * taken as f64 / f64::from(elements))
            })
            .unwrap()
        };
        assert_eq!(fits(1000.0), 1.0);
        assert!((fits(2000.0) - 0.625).abs() < 0.05);
        assert!((fits(1e6) - f64::from(width.at_once) / f64::from(elements)).abs() < 1e-6);
        assert_eq!(spans(elements, 0.4, width).len(), 1);
    }
}
