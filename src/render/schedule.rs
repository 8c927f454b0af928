//! Cutting a render into dispatches and submits: small enough for the driver's patience and the
//! shader's loop limit, large enough to keep the device busy. Pure: it sees counts and times only.

use std::collections::VecDeque;
use std::ops;

use crate::layout::{FRAME_SAMPLES, Range, STAGE_ANY, STAGE_BOTH, STAGE_CLOSEST, WORKGROUP_SIZE};

/// What a device likes, before anything was measured on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Rays per ms to expect of a tree traversal, on the low side.
    pub rays_per_ms: f64,
    /// How long a dispatch may last, ms.
    pub dispatch_ms: f64,
    /// How long a submit may last, ms.
    pub submit_ms: f64,
    /// Most samples of a dispatch. Each dispatch finds the camera rays' hits again, so more is less
    /// work; but a dispatch ends with its longest pixel, so less keeps a wide device busy.
    pub samples: u32,
    /// Fewest workgroups of a dispatch, as far as there are so many: fewer would take as long on a wide device, and a
    /// dispatch that is too long would only be cut into more that are no shorter.
    pub least_workgroups: u32,
    /// Most workgroups of a dispatch.
    pub workgroups: u32,
    /// Most loop iterations of an invocation, over all its loops.
    pub loop_iterations: Option<u32>,
}

/// How a pixel's samples may be cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blocks {
    /// Anywhere: counts add up in any order.
    Free,
    /// Every so many samples, in order: running means depend on it.
    Frames(u32),
}

/// The work of one band of pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Work {
    pub pixel_begin: u32,
    pub pixel_end: u32,
    pub sample_begin: u32,
    pub sample_end: u32,
    pub triangles: u32,
    /// Every ray tests every triangle (and can be stopped between two).
    pub brute: bool,
    pub blocks: Blocks,
    /// Most pixels times samples of a range, where buffers hold something for each.
    pub room: Option<u64>,
}

/// Most triangles of a dispatch, so that one ray cannot hold up a device for long.
const MOST_PART: u32 = 1 << 20;
/// Tests of a ray up to which the fewest workgroups of a dispatch may well be in it at once.
const SHORT_RAY: f64 = 2e5;
/// Part of a dispatch that is not worth one of its own: a quarter.
const SMALL_REST: u32 = 4;
/// Ranges of one submit.
const MOST_RANGES: usize = 256;

/// Iterations that are asked of an invocation: some are left for what is not a step of a ray.
fn budget_of(loop_iterations: Option<u32>) -> Option<u32> {
    loop_iterations.map(|limit| limit - limit / 8)
}

/// Most triangles of which `brute` can test all for a frame's camera ray and its samples in one dispatch.
pub fn brute_frame_limit(loop_iterations: Option<u32>) -> u32 {
    let budget = budget_of(loop_iterations).map_or(MOST_PART, |budget| budget / (FRAME_SAMPLES + 1));
    budget.min(MOST_PART).saturating_sub(2)
}

/// Triangles of a dispatch in which `brute` tests a part of them, or all.
pub fn brute_part(loop_iterations: Option<u32>) -> u32 {
    budget_of(loop_iterations).map_or(MOST_PART, |budget| budget / 2).min(MOST_PART)
}

/// Hands out the ranges of a [`Work`].
pub struct Scheduler {
    work: Work,
    pace: Pace,
    block: u32,
    part: u32,
    next_pixel: u32,
    next_sample: u32,
    ready: VecDeque<Range>,
    rays_per_ms: f64,
}

impl Scheduler {
    pub fn new(work: Work, pace: Pace) -> Self {
        let budget = budget_of(pace.loop_iterations);
        // A tree's ray visits some multiple of log n nodes; a kernel that still runs out of iterations
        // says so, and its pixels are taken up again.
        let steps_of_ray =
            if work.brute { work.triangles + 2 } else { 64 + 64 * (work.triangles + 1).ilog2() };
        let block = budget
            .map_or(u32::MAX, |budget| (budget / steps_of_ray).saturating_sub(1))
            .clamp(1, pace.samples);
        let block = work.room.map_or(block, |room| {
            let fit = room / u64::from(WORKGROUP_SIZE);
            block.min(u32::try_from(fit).unwrap_or(u32::MAX)).max(1)
        });
        let part = if work.brute && work.blocks == Blocks::Free {
            brute_part(pace.loop_iterations)
        } else {
            u32::MAX
        };
        // In parts, each sample has its own dispatches, and the camera ray is found once for all.
        let in_parts = work.triangles > part;
        let block = if in_parts { pace.samples } else { block };
        let slowness = if work.brute { (f64::from(work.triangles) / 50.0).max(1.0) } else { 1.0 };
        Self {
            work,
            pace,
            block: match work.blocks {
                Blocks::Free => block,
                Blocks::Frames(samples) => samples,
            },
            part,
            next_pixel: work.pixel_begin,
            next_sample: work.sample_begin,
            ready: VecDeque::new(),
            rays_per_ms: pace.rays_per_ms / slowness,
        }
    }

    /// Whether each ray is traced over several dispatches.
    pub fn in_parts(&self) -> bool {
        self.part < self.work.triangles
    }

    /// Overrides the number of samples of a dispatch.
    pub fn with_block(mut self, block: u32) -> Self {
        let room = self.work.room.map_or(u64::MAX, |room| room / u64::from(WORKGROUP_SIZE));
        self.block = block.min(u32::try_from(room).unwrap_or(u32::MAX)).max(1);
        self
    }

    /// Starts from a rate that was learnt before, rays per ms.
    pub fn with_rate(mut self, rays_per_ms: Option<f64>) -> Self {
        self.rays_per_ms = rays_per_ms.unwrap_or(self.rays_per_ms);
        self
    }

    /// The rate that it reckons with, rays per ms.
    pub fn rate(&self) -> f64 {
        self.rays_per_ms
    }

    /// Ranges for the next submit; none when all were handed out.
    pub fn next_submit(&mut self) -> Vec<Range> {
        let patience = self.rays_per_ms * self.pace.submit_ms;
        let mut ranges = Vec::new();
        let mut rays = 0.0;
        while ranges.len() < MOST_RANGES && (ranges.is_empty() || rays < patience) {
            if self.ready.is_empty() {
                self.prepare();
            }
            let Some(range) = self.ready.pop_front() else { break };
            rays += self.rays(&range);
            ranges.push(range);
        }
        ranges
    }

    /// Learns from a submit that finished so many rays in `ms`. Pixels that hit nothing trace few rays, so
    /// what was finished counts, while [`Self::next_submit`] expects every pixel to hit.
    pub fn measured(&mut self, ranges: &[Range], finished: u64, ms: f64) {
        let nominal: f64 = ranges.iter().map(|range| self.rays(range)).sum();
        let rays = if self.in_parts() { nominal } else { nominal.min(finished as f64) };
        if ms > 0.0 && rays > 0.0 {
            // Some pixels' rays are much slower than others': go up by steps.
            self.rays_per_ms = (rays / ms).min(self.rays_per_ms * 4.0);
        }
    }

    /// Rays of a range if every camera ray hits; those of a part of the triangles count as a part.
    fn rays(&self, range: &Range) -> f64 {
        let pixels = f64::from(range.pixel_end - range.pixel_begin);
        let samples = f64::from(range.sample_end - range.sample_begin);
        let rays = match range.stage {
            STAGE_CLOSEST => 1.0,
            STAGE_ANY => samples,
            _ => 1.0 + samples,
        };
        let share =
            f64::from(range.triangle_end - range.triangle_begin) / f64::from(self.work.triangles.max(1));
        pixels * rays * share
    }

    fn least_groups(&self) -> u32 {
        let tests = if self.work.brute { f64::from(self.work.triangles.max(1)) } else { 1.0 };
        (f64::from(self.pace.least_workgroups) * (SHORT_RAY / tests).min(1.0)) as u32
    }

    /// Makes the ranges of the next pixels and samples.
    fn prepare(&mut self) {
        if self.next_sample >= self.work.sample_end {
            return;
        }
        let samples = self.next_sample..self.next_sample.saturating_add(self.block).min(self.work.sample_end);
        let per_pixel = match self.part {
            part if part < self.work.triangles => f64::from(part) / f64::from(self.work.triangles),
            _ => f64::from(samples.end - samples.start) + 1.0,
        };
        let wanted = self.rays_per_ms * self.pace.dispatch_ms / per_pixel / f64::from(WORKGROUP_SIZE);
        let groups = (wanted as u32).max(self.least_groups()).clamp(1, self.pace.workgroups);
        let most = match self.work.room {
            None => self.pace.workgroups,
            Some(room) => {
                let fit = room / (u64::from(samples.end - samples.start) * u64::from(WORKGROUP_SIZE));
                self.pace.workgroups.min(u32::try_from(fit).unwrap_or(u32::MAX)).max(1)
            }
        };
        let groups = groups.min(most);
        // A running mean that stalls must not hear of one part of the directions first: each frame is a set of its own.
        let set = match self.work.blocks {
            Blocks::Free => self.work.sample_begin..self.work.sample_end,
            Blocks::Frames(_) => samples.clone(),
        };
        let begin = self.next_pixel;
        // A small rest goes with the last dispatch: by itself it would take as long as its slowest workgroup does.
        let rest = (self.work.pixel_end - begin).div_ceil(WORKGROUP_SIZE);
        let small = rest > groups && rest <= most && rest - groups <= groups / SMALL_REST;
        let groups = if small { rest } else { groups };
        let end = begin.saturating_add(groups.saturating_mul(WORKGROUP_SIZE)).min(self.work.pixel_end);
        let whole = Range {
            pixel_begin: begin,
            pixel_end: end,
            sample_begin: samples.start,
            sample_end: samples.end,
            triangle_begin: 0,
            triangle_end: self.work.triangles,
            pixel_base: self.work.pixel_begin,
            stage: STAGE_BOTH,
            set_begin: set.start,
            set_end: set.end,
            ..Range::default()
        };
        if self.work.triangles <= self.part {
            self.ready.push_back(whole);
        } else {
            self.prepare_parts(whole, samples.clone());
        }
        self.next_pixel = end;
        if end >= self.work.pixel_end {
            self.next_pixel = self.work.pixel_begin;
            self.next_sample = samples.end;
        }
    }

    /// The camera rays, then each sample's rays, through one part of the triangles after the other.
    fn prepare_parts(&mut self, whole: Range, samples: ops::Range<u32>) {
        let mut stage = |stage: u32, sample: u32| {
            let mut first = 0;
            while first < self.work.triangles {
                let last = first.saturating_add(self.part).min(self.work.triangles);
                self.ready.push_back(Range {
                    sample_begin: sample,
                    sample_end: sample + 1,
                    triangle_begin: first,
                    triangle_end: last,
                    stage,
                    ..whole
                });
                first = last;
            }
        };
        stage(STAGE_CLOSEST, samples.start);
        for sample in samples {
            stage(STAGE_ANY, sample);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CPU: Pace = Pace {
        rays_per_ms: 500.0,
        dispatch_ms: 100.0,
        submit_ms: 250.0,
        samples: 1024,
        least_workgroups: 1,
        workgroups: 65_535,
        loop_iterations: Some(65_535),
    };

    fn work(triangles: u32, brute: bool, blocks: Blocks) -> Work {
        Work {
            pixel_begin: 64,
            pixel_end: 64 * 101,
            sample_begin: 3,
            sample_end: 200,
            triangles,
            brute,
            blocks,
            room: None,
        }
    }

    fn all(work: Work, pace: Pace) -> Vec<Range> {
        let mut scheduler = Scheduler::new(work, pace);
        let mut ranges = Vec::new();
        loop {
            let submit = scheduler.next_submit();
            if submit.is_empty() {
                return ranges;
            }
            scheduler.measured(&submit, 100_000, 37.0);
            ranges.extend(submit);
        }
    }

    #[test]
    fn every_pixel_gets_every_sample_once() {
        for work in
            [work(5456, false, Blocks::Free), work(32, true, Blocks::Free), work(9, false, Blocks::Frames(4))]
        {
            let mut seen = vec![0u8; 101 * 200];
            for range in all(work, CPU) {
                assert_eq!((range.pixel_base, range.stage), (64, STAGE_BOTH));
                for tile in range.pixel_begin / 64..range.pixel_end / 64 {
                    for sample in range.sample_begin..range.sample_end {
                        seen[(tile * 200 + sample) as usize] += 1;
                    }
                }
            }
            for tile in 0..101 {
                for sample in 0..200 {
                    assert_eq!(seen[tile * 200 + sample], u8::from(tile >= 1 && sample >= 3));
                }
            }
        }
    }

    #[test]
    fn an_invocation_keeps_within_the_loop_limit() {
        for triangles in [1, 32, 5456, 40_000, 3_000_000] {
            for range in
                all(Work { pixel_end: 128, sample_end: 8, ..work(triangles, true, Blocks::Free) }, CPU)
            {
                let tests = u64::from(range.triangle_end - range.triangle_begin);
                let rays =
                    u64::from(range.sample_end - range.sample_begin) + u64::from(range.stage == STAGE_BOTH);
                assert!(tests * rays <= 65_535, "{range:?}");
            }
        }
    }

    #[test]
    fn parts_cover_all_triangles_for_the_camera_ray_and_each_sample() {
        let work = Work { pixel_end: 128, sample_end: 6, ..work(100_000, true, Blocks::Free) };
        let ranges = all(work, CPU);
        assert_eq!(sum_of(&ranges, STAGE_CLOSEST), 100_000);
        assert_eq!(sum_of(&ranges, STAGE_ANY), 3 * 100_000);
    }

    fn sum_of(ranges: &[Range], stage: u32) -> u32 {
        ranges
            .iter()
            .filter(|range| range.stage == stage)
            .map(|range| range.triangle_end - range.triangle_begin)
            .sum()
    }

    #[test]
    fn frames_stay_whole_and_in_order() {
        let mut next = vec![3; 101];
        for range in all(work(9, false, Blocks::Frames(4)), CPU) {
            assert!(range.sample_end - range.sample_begin == 4 || range.sample_end == 200);
            for tile in range.pixel_begin / 64..range.pixel_end / 64 {
                assert_eq!(next[tile as usize], range.sample_begin);
                next[tile as usize] = range.sample_end;
            }
        }
    }

    /// A dispatch of one workgroup takes as long as one of a thousand there: cutting it smaller would never end.
    #[test]
    fn a_wide_device_s_dispatches_do_not_shrink_without_end() {
        let pace = Pace { least_workgroups: 1024, loop_iterations: None, ..CPU };
        let work = Work {
            pixel_begin: 0,
            pixel_end: 64 * 10_240,
            sample_begin: 0,
            sample_end: 4,
            ..work(70_000, true, Blocks::Free)
        };
        let mut scheduler = Scheduler::new(work, pace);
        let mut ranges = 0;
        loop {
            let submit = scheduler.next_submit();
            if submit.is_empty() {
                break;
            }
            ranges += submit.len();
            let finished =
                submit.iter().map(|range| u64::from(range.pixel_end - range.pixel_begin) * 5).sum();
            scheduler.measured(&submit, finished, 400.0 * submit.len() as f64);
        }
        assert_eq!(ranges, 10);
    }

    #[test]
    fn a_small_rest_goes_with_the_dispatch_before_it() {
        // 64 samples and a camera ray, of 1,000 rays per ms for 65 ms: 1,000 workgroups of 64 pixels.
        let pace = Pace { rays_per_ms: 64e3, dispatch_ms: 65.0, loop_iterations: None, ..CPU };
        for (workgroups, most, expected) in [
            (1_250, 65_535, vec![1_250]),
            (1_251, 65_535, vec![1_000, 251]),
            (2_200, 65_535, vec![1_000, 1_200]),
            (1_250, 1_100, vec![1_000, 250]),
        ] {
            let work = Work {
                pixel_begin: 0,
                pixel_end: 64 * workgroups,
                sample_begin: 0,
                sample_end: 64,
                ..work(9, false, Blocks::Free)
            };
            let mut scheduler = Scheduler::new(work, Pace { workgroups: most, ..pace });
            let mut sizes = Vec::new();
            loop {
                let submit = scheduler.next_submit();
                if submit.is_empty() {
                    break;
                }
                sizes.extend(submit.iter().map(|range| (range.pixel_end - range.pixel_begin) / 64));
            }
            assert_eq!(sizes, expected);
        }
    }

    #[test]
    fn a_fast_device_gets_one_dispatch() {
        let pace = Pace { rays_per_ms: 1e6, loop_iterations: None, ..CPU };
        let whole = Work {
            pixel_begin: 0,
            pixel_end: 1 << 20,
            sample_begin: 0,
            sample_end: 64,
            ..work(9, false, Blocks::Free)
        };
        assert_eq!(all(whole, pace).len(), 1);
    }
}
