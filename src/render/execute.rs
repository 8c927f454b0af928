//! Runs a plan on a Vulkan device.

use std::thread;
use std::time::Instant;

use super::adaptive::{PILOT, Shares};
use super::band::Band;
use super::choices::{Accumulator, Passes};
use super::picture::{Accumulated, ErrorEstimate, rmse_estimate};
use super::plan::Plan;
use super::rounds::{Goal, Round, Rounds};
use super::seeds::hash;
use super::spans::{Span, Spans};
use super::stage::{Stage, Uploaded, compile};
use super::tally::{KernelTime, Progress, Tally};
use crate::error::{Error, Result, joined};
use crate::layout::{self, Budget, Carry, Count, RayRecord, Work};
use crate::vk::{Device, ImageFormat};

/// What came of a render.
#[derive(Clone, Debug)]
pub struct Outcome {
    pub accumulated: Accumulated,
    /// Samples of a camera ray that hit; the mean where each has its own number.
    pub samples: u32,
    /// Where the picture's rays are counted.
    pub error: Option<ErrorEstimate>,
    /// Rounds of samples, a pilot not counted.
    pub rounds: usize,
    pub kernels: Vec<KernelTime>,
    pub primary_rays: u64,
    /// A pilot's included.
    pub ambient_rays: u64,
    /// Rays that lost a part of the tree to a full stack (`--allow-overflow`).
    pub overflowed_rays: u64,
    /// Submits of work to the device.
    pub submits: u64,
    /// Pixels' work had to be taken up again this often (a driver's loop limit).
    pub repeats: u32,
}

/// Renders. `observe` hears of every finished submit.
pub fn run(device: &Device, plan: &Plan<'_>, observe: &mut dyn FnMut(&Progress)) -> Result<Outcome> {
    run_traced(device, plan, observe, None)
}

/// The same, and notes in `spans` what happened when.
pub fn run_traced(
    device: &Device,
    plan: &Plan<'_>,
    observe: &mut dyn FnMut(&Progress),
    spans: Option<&mut Spans>,
) -> Result<Outcome> {
    let start = Instant::now();
    let mut tally = Tally::new(plan, observe);
    tally.spans = spans;
    let (uploaded, pipelines) = thread::scope(|scope| {
        // While large scenes load the device's clock falls.
        let raising = device.may_sleep().then(|| {
            scope.spawn(|| {
                let begin = Instant::now();
                device.raise_clock();
                Ok(Span::beside("raise the device's clock", begin))
            })
        });
        let compiling = scope.spawn(|| {
            let begin = Instant::now();
            compile(device, plan).map(|pipelines| (pipelines, Span::beside("compile kernels", begin)))
        });
        let uploaded = Uploaded::new(device, plan)?;
        tally.phase("pack and upload", start);
        let begin = Instant::now();
        let (pipelines, span) = joined(compiling)?;
        tally.phase("wait for kernels", begin);
        tally.beside(span);
        if let Some(raising) = raising {
            let begin = Instant::now();
            tally.beside(joined(raising)?);
            tally.phase("wait for the device's clock", begin);
        }
        Ok::<_, Error>((uploaded, pipelines))
    })?;
    let begin = Instant::now();
    let mut stage = Stage::with(device, plan, uploaded, pipelines)?;
    tally.phase("make buffers", begin);
    let mut rounds =
        Rounds::new(plan.job.goal, plan.settings.sampler, plan.job.samples.len() as u32, plan.job.jitters);
    let in_rounds = plan.job.goal != Goal::Samples || plan.job.adaptive;
    let counts = if in_rounds {
        let shares = if plan.job.adaptive { Some(pilot(&mut stage, &mut tally)?) } else { None };
        render_in_rounds(&stage, shares.as_ref(), &mut rounds, start, &mut tally)?
    } else {
        render_at_once(&stage, &mut tally)?
    };
    let begin = Instant::now();
    let accumulated = match (&stage.image, image_format(plan)) {
        (Some(image), Some(format)) => {
            Accumulated::Means(pixels_of(format, &image.read(device, format.bytes_per_pixel())?))
        }
        _ => Accumulated::Counts(counts),
    };
    if stage.image.is_some() {
        tally.phase("read image", begin);
    }
    let samples = mean_samples(&accumulated).unwrap_or(plan.job.samples.len() as u32);
    Ok(Outcome {
        error: rmse_estimate(plan.tiles, &accumulated),
        accumulated,
        samples,
        rounds: rounds.count().max(1),
        kernels: tally.kernels.into_values().collect(),
        primary_rays: tally.totals.primary_finished,
        ambient_rays: tally.totals.ambient_finished,
        overflowed_rays: tally.totals.overflowed,
        submits: tally.submits,
        repeats: tally.repeats,
    })
}

/// All samples, band after band: only one band's buffers are there at a time.
fn render_at_once(stage: &Stage<'_>, tally: &mut Tally<'_>) -> Result<Vec<Count>> {
    let samples = stage.plan.job.samples.clone();
    let mut counts = Vec::new();
    for (begin, end) in bands(stage.plan, stage.device) {
        let start = Instant::now();
        let band = Band::new(stage, begin, end)?;
        tally.phase("make buffers", start);
        band.render(samples.clone(), tally)?;
        let start = Instant::now();
        counts.extend(band.counts(|_| samples.len() as u64)?);
        tally.phase("read counts", start);
    }
    Ok(counts)
}

/// Rounds of samples until the goal is reached. The counts of all bands after each tell how far it is.
fn render_in_rounds(
    stage: &Stage<'_>,
    shares: Option<&Shares>,
    rounds: &mut Rounds,
    start: Instant,
    tally: &mut Tally<'_>,
) -> Result<Vec<Count>> {
    let plan = stage.plan;
    let first = plan.job.samples.start;
    let mut bands = all_bands(stage)?;
    let mut given = vec![0; plan.tiles.numbers() as usize];
    let mut counts = Vec::new();
    while let Some(mean) = rounds.next() {
        let wanted = match shares {
            Some(shares) => shares.samples(mean),
            None => vec![mean; given.len()],
        };
        let begin = first + least(&given).unwrap_or(0);
        let end = first + wanted.iter().copied().max().unwrap_or(0);
        tally.begin_round(rounds, mean, begin..end);
        counts.clear();
        for band in &mut bands {
            let pixels = band.pixels();
            let pixels = pixels.start as usize..pixels.end as usize;
            if shares.is_some() {
                let budget = |(given, wanted): (&u32, &u32)| Budget {
                    begin: first + given,
                    end: first + wanted,
                    ..Budget::default()
                };
                let budgets: Vec<Budget> =
                    given[pixels.clone()].iter().zip(&wanted[pixels.clone()]).map(budget).collect();
                band.set_budgets(&budgets)?;
            }
            band.render(begin..end, tally)?;
            let begin = Instant::now();
            counts.extend(band.counts(|place| u64::from(wanted[pixels.start + place]))?);
            tally.phase("read counts", begin);
        }
        given = wanted;
        let accumulated = Accumulated::Counts(counts);
        let error = rmse_estimate(plan.tiles, &accumulated);
        let Accumulated::Counts(back) = accumulated else { return Ok(Vec::new()) };
        counts = back;
        // Without a pixel that is covered there is no error.
        let nothing_hit = counts.iter().all(|count| count.traced0 == 0);
        let error = error.unwrap_or(ErrorEstimate { rmse: 0.0, uncertainty: 0.0, unseen: 0.0 });
        let ErrorEstimate { rmse, uncertainty, unseen } = error;
        tally.rmse = Some(rmse);
        rounds.finished(Round { samples: mean, rmse, uncertainty, unseen, elapsed: start.elapsed() });
        if nothing_hit {
            break;
        }
    }
    Ok(counts)
}

/// Samples of a camera ray that hit, on the average; `None` if nothing was hit or nothing counted.
fn mean_samples(accumulated: &Accumulated) -> Option<u32> {
    let Accumulated::Counts(counts) = accumulated else { return None };
    let traced = counts.iter().map(|count| u64::from(count.traced0) + u64::from(count.traced1));
    let (sum, hits) = traced.filter(|&n| n > 0).fold((0, 0u64), |(sum, hits), n| (sum + n, hits + 1));
    (hits > 0).then(|| (sum as f64 / hits as f64).round() as u32)
}

fn least(given: &[u32]) -> Option<u32> {
    given.iter().copied().filter(|&samples| samples > 0).min()
}

fn all_bands<'a>(stage: &'a Stage<'a>) -> Result<Vec<Band<'a>>> {
    bands(stage.plan, stage.device).into_iter().map(|(begin, end)| Band::new(stage, begin, end)).collect()
}

/// Renders a few samples with random numbers of their own, and shares out the samples to come by what they tell.
fn pilot(stage: &mut Stage<'_>, tally: &mut Tally<'_>) -> Result<Shares> {
    let begin = Instant::now();
    let plan = stage.plan;
    stage.reseed(hash(plan.job.seed, PILOT_SEED))?;
    let first = plan.job.samples.start;
    let samples = first..first + (PILOT / plan.job.jitters).next_multiple_of(2).max(4);
    let mut counts = Vec::new();
    for (begin, end) in bands(plan, stage.device) {
        let mut band = Band::new(stage, begin, end)?;
        let budget = Budget { begin: samples.start, end: samples.end, ..Budget::default() };
        band.set_budgets(&vec![budget; (end - begin) as usize])?;
        band.render(samples.clone(), tally)?;
        counts.extend(band.counts(|_| samples.len() as u64)?);
    }
    stage.reseed(plan.job.seed)?;
    tally.phase("pilot", begin);
    Ok(Shares::of_pilot(plan.tiles, &counts, plan.settings.sampler))
}

/// Makes the pilot's seed from the picture's.
const PILOT_SEED: u32 = 0x7069_6c6f;

pub(super) fn image_format(plan: &Plan<'_>) -> Option<ImageFormat> {
    match plan.settings.accumulator {
        Accumulator::Count => None,
        Accumulator::Rgba8 => Some(ImageFormat::Rgba8),
        Accumulator::Rgba32f => Some(ImageFormat::Rgba32f),
    }
}

/// An image's texels as floats.
pub(super) fn pixels_of(format: ImageFormat, bytes: &[u8]) -> Vec<[f32; 4]> {
    match format {
        ImageFormat::Rgba8 => {
            bytes.chunks_exact(4).map(|texel| [0, 1, 2, 3].map(|i| f32::from(texel[i]) / 255.0)).collect()
        }
        ImageFormat::Rgba32f => bytemuck::pod_collect_to_vec(bytes),
    }
}

/// Pixel ranges whose buffers a descriptor can show whole.
pub fn bands(plan: &Plan<'_>, device: &Device) -> Vec<(u32, u32)> {
    let group = u64::from(layout::WORKGROUP_SIZE);
    let largest_record = match plan.settings.passes {
        Passes::Staged => size_of::<RayRecord>(),
        _ if plan.counts_work() => size_of::<Work>(),
        _ if plan.brute() => size_of::<Carry>(),
        _ => size_of::<Count>(),
    } as u64;
    let pixels = device.adapter().limits.storage_buffer_bytes / largest_record / group * group;
    let all = plan.tiles.numbers();
    let mut bands = Vec::new();
    let mut begin = 0;
    while begin < all {
        let end = (begin + pixels.max(group)).min(all);
        // Padded pixel numbers fit 32 bits (`Plan::new`).
        bands.push((begin as u32, end as u32));
        begin = end;
    }
    bands
}
