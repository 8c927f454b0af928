//! A point of a curve: a fresh render of a plan, timed.

use crate::error::Result;
use crate::lab::bench::drift::Drift;
use crate::layout::WORKGROUP_SIZE;
use crate::render::execute;
use crate::render::picture::{Accumulated, Picture};
use crate::render::plan::{Job, Plan};
use crate::render::repeat::Repeated;
use crate::render::stage::{Stage, Uploads};
use crate::vk::{Device, DeviceKind};

/// What came of it.
pub struct Shot {
    /// Summed kernel time of each run, ms.
    pub times: Vec<f64>,
    /// Light of each pixel, row by row from the top.
    pub light: Vec<f32>,
    pub overflowed: u64,
}

/// Most runs of a point.
const MOST_RUNS: usize = 9;

/// Renders the plan, again and again until the runs took so long together: all of them give the same picture.
pub fn shoot(
    device: &Device,
    plan: &Plan<'_>,
    uploads: &mut Uploads,
    drift: &Drift<'_>,
    enough_ms: f64,
) -> Result<Shot> {
    if plan.job.adaptive {
        return shoot_whole(device, plan, drift, enough_ms);
    }
    let stage = Stage::with_uploaded(device, plan, uploads.of(device, plan)?)?;
    if device.adapter().kind == DeviceKind::Cpu {
        // Its compiler goes to work at the first dispatch, and within its time.
        Repeated::over(&stage, &[(0, WORKGROUP_SIZE)])?.frame()?;
    }
    let mut shot = Shot { times: Vec::new(), light: Vec::new(), overflowed: 0 };
    drift.wake()?;
    while wants_more(&shot.times, enough_ms) {
        let mut frames = Repeated::new(&stage)?;
        let cost = frames.frame()?;
        shot.times.push(cost.gpu_ms());
        if shot.light.is_empty() {
            let accumulated = match stage.means()? {
                Some(means) => Accumulated::Means(means),
                None => Accumulated::Counts(frames.counts()?),
            };
            shot.light = Picture::new(plan.tiles, &accumulated).light;
            shot.overflowed = cost.totals.overflowed;
            drift.wake()?;
        }
    }
    Ok(shot)
}

/// Samples of a run that is thrown away.
const WARM_UP: usize = 4;

/// The same by whole renders, for what only those do.
fn shoot_whole(device: &Device, plan: &Plan<'_>, drift: &Drift<'_>, enough_ms: f64) -> Result<Shot> {
    let mut shot = Shot { times: Vec::new(), light: Vec::new(), overflowed: 0 };
    // The first run of a kernel may pay for its compilation.
    let few = plan
        .clone()
        .with_job(Job { samples: 0..plan.job.samples.len().min(WARM_UP) as u32, ..plan.job.clone() });
    execute::run(device, &few, &mut |_| {})?;
    while wants_more(&shot.times, enough_ms) {
        drift.wake()?;
        let outcome = execute::run(device, plan, &mut |_| {})?;
        shot.times.push(outcome.kernels.iter().map(|kernel| kernel.gpu_ms).sum());
        shot.light = Picture::new(plan.tiles, &outcome.accumulated).light;
        shot.overflowed = outcome.overflowed_rays;
    }
    Ok(shot)
}

fn wants_more(times: &[f64], enough_ms: f64) -> bool {
    times.len() < MOST_RUNS && times.iter().sum::<f64>() < enough_ms || times.is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_runs_are_repeated_and_long_ones_are_not() {
        let runs = |ms: f64| (0..).find(|n| !wants_more(&vec![ms; *n], 60.0)).unwrap();
        assert_eq!([0.1, 10.0, 25.0, 100.0].map(runs), [9, 6, 3, 1]);
    }
}
