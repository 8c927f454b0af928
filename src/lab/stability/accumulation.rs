//! Running means that freeze, and counts that do not.
//!
//! Every accumulator adds up the same rays, so its error needs no reference: the mean of those very rays is known from
//! their counts, which are taken in one go by other kernels than those that add up frame after frame.

use rayon::prelude::*;

use super::{Case, Experiment, Findings, Lab, Row};
use crate::error::{Error, Result};
use crate::lab::figure::Figure;
use crate::lab::interleave::{accumulated, digits};
use crate::lab::scenes::procedural;
use crate::layout::{Count, FRAME_SAMPLES};
use crate::reference::{accumulate, render_counts, render_means};
use crate::render::choices::{Accumulator, Passes, Sampler, Wishes};
use crate::render::geometry::Geometry;
use crate::render::picture::{Accumulated, Picture};
use crate::render::plan::{Job, Plan};
use crate::render::repeat::Repeated;
use crate::render::seeds::hash;
use crate::render::stage::Stage;
use crate::render::twin::Twin;
use crate::scene::Scene;
use crate::vk::DeviceKind;

pub const EXPERIMENT: Experiment = Experiment {
    name: "accumulation",
    what: "1 to 65,536 frames added up: bias, error, and the frame at which a mean freezes.",
    counts: "pixels",
    worst: "largest distance from the mean of the same rays",
    run,
};

/// Frames after which pictures are looked at.
const AFTER: [u32; 9] = [1, 4, 16, 64, 256, 1024, 4096, 16_384, 65_536];
const QUICK_AFTER: usize = 6;
/// Frames that are rendered and looked at one by one.
const ONE_BY_ONE: u32 = 512;
/// Frames of the picture that is shown: eight bits don't change any more.
const SHOWN: u32 = 512;
/// Frames of which the twin does all.
const TWIN_FRAMES: u32 = 64;
/// Far on, where the twin goes on with the means.
const FAR: u32 = 1 << 24;
const FAR_FRAMES: u32 = 16;
/// Half a step of eight bits.
const HALF_STEP: f64 = 0.5 / 255.0;
/// Roundoff of f32 to nearest.
const E: f64 = f64::EPSILON * (1u32 << 28) as f64;

/// The scene, and what stays the same of all variants.
struct Bench<'a, 'l> {
    lab: &'a Lab<'l>,
    scene: &'a Scene,
    geometry: &'a Geometry,
    size: (u32, u32),
}

fn run(lab: &Lab<'_>) -> Result<Findings> {
    let scene = procedural("cornell", None, lab.seed)?;
    let geometry = lab.geometry(&scene, &Wishes::default())?;
    let size = if lab.device.adapter().kind == DeviceKind::Cpu { (8, 8) } else { (64, 40) };
    let bench = Bench { lab, scene: &scene, geometry: &geometry, size };
    let after = &AFTER[..lab.pick(QUICK_AFTER, AFTER.len())];
    let variants: [(&str, Option<Accumulator>); 4] = [
        ("count", Some(Accumulator::Count)),
        ("rgba32f", Some(Accumulator::Rgba32f)),
        ("rgba8", Some(Accumulator::Rgba8)),
        ("auto", None),
    ];
    lab.observe("the mean of the rays", 0.0);
    let same_rays = bench.whole(&wishes(Some(Accumulator::Count)), after)?;
    let mut rows = Vec::new();
    for (place, (name, accumulator)) in variants.into_iter().enumerate() {
        lab.observe(name, 0.1 + 0.2 * place as f64);
        let truth =
            if accumulator.is_some() { Ok(same_rays.clone()) } else { bench.whole(&wishes(None), after) };
        let row = truth.and_then(|truth| bench.row(name, accumulator, after, &truth));
        rows.push(row.unwrap_or_else(|error| Row::undecided(name, error.to_string())));
    }
    lab.observe("picture", 0.9);
    let shown = Bench { size: lab.pick((32, 20), (80, 50)), ..bench };
    let figures = vec![shown.frozen()?];
    if !lab.quick {
        lab.observe("costs", 0.95);
        let choices = variants.map(|(name, accumulator)| (name, wishes(accumulator)));
        if let Ok(costs) = lab.costs(&scene, &geometry, &choices) {
            rows.iter_mut().zip(costs).for_each(|(row, cost)| row.gpu_ms_ratio = Some(cost));
        }
    }
    Ok(Findings { rows, figures })
}

/// Independent numbers, so that frames may be cut anywhere; `auto`'s own where nothing is chosen.
fn wishes(accumulator: Option<Accumulator>) -> Wishes {
    Wishes { accumulator, sampler: accumulator.map(|_| Sampler::Pcg), ..Wishes::default() }
}

/// How far from the mean of its rays a pixel may be after so many frames.
///
/// A count is exact, and its mean rounds once to f32. A running mean of at most 1 rounds product, sum and quotient in each
/// frame, the last by 2.5 ulp at most (Vulkan), which is by 7 e; and of the error before, frame n keeps (n - 1) / n. So n
/// times the error after n frames is at most 7 e (1 + 2 + ... + n), and the error 7 e (n + 1) / 2, as long as f32 holds the
/// numbers of the samples. More than half a step of eight bits is seen; eight bits can't be nearer than that.
fn allowed(accumulator: Accumulator, frames: u32) -> f64 {
    match accumulator {
        Accumulator::Count => E * 0.5 * (1.0 + 1e-6),
        Accumulator::Rgba32f => (3.5 * E * (f64::from(frames) + 1.0)).min(HALF_STEP),
        Accumulator::Rgba8 => HALF_STEP * (1.0 + 1e-4),
    }
}

impl Bench<'_, '_> {
    fn plan(&self, wishes: &Wishes, samples: std::ops::Range<u32>) -> Result<Plan<'_>> {
        let job = Job { samples, ..self.lab.job(self.scene, self.size, FRAME_SAMPLES) };
        self.lab.plan(job, self.scene, self.geometry, wishes)
    }

    /// Eight bits after they froze, beside the mean of the same rays.
    fn frozen(&self) -> Result<Figure> {
        let plan = self.plan(&wishes(Some(Accumulator::Rgba8)), 0..FRAME_SAMPLES * SHOWN)?;
        let failing = self.lab.picture(&plan)?;
        let truth = self.whole(&wishes(Some(Accumulator::Count)), &[SHOWN])?.concat();
        let off = |(light, truth): (&f32, &f64)| {
            (f64::from(*light) - truth).abs() > allowed(Accumulator::Rgba8, SHOWN)
        };
        let fails: Vec<bool> = failing.light.iter().zip(&truth).map(off).collect();
        let survivor =
            Picture { light: truth.iter().map(|light| *light as f32).collect(), ..failing.clone() };
        Ok(Figure::of_failure("accumulation-rgba8", &failing, &survivor, &fails))
    }

    /// The mean of each pixel's rays after these numbers of frames, in one go each; row by row.
    fn whole(&self, wishes: &Wishes, after: &[u32]) -> Result<Vec<Vec<f64>>> {
        let mean = |&frames: &u32| {
            let plan = self.plan(wishes, 0..FRAME_SAMPLES * frames)?;
            match self.lab.render(&plan)?.accumulated {
                Accumulated::Counts(counts) => Ok(means(&plan, &counts)),
                Accumulated::Means(_) => Err(Error::other("Rays were not counted: report this as a bug.")),
            }
        };
        after.iter().map(mean).collect()
    }

    /// Frame after frame, against the mean of the same rays.
    fn row(
        &self,
        name: &str,
        accumulator: Option<Accumulator>,
        after: &[u32],
        truth: &[Vec<f64>],
    ) -> Result<Row> {
        // One dispatch a frame is the fewest.
        let passes = accumulator.filter(|kept| *kept != Accumulator::Count).map(|_| Passes::Single);
        let wishes = Wishes { passes, ..wishes(accumulator) };
        let plan = self.plan(&wishes, 0..FRAME_SAMPLES)?;
        let accumulator = plan.settings.accumulator;
        let stage = Stage::new(self.lab.device, &plan)?;
        let mut repeated = Repeated::new(&stage)?;
        let look = |repeated: &Repeated<'_>| -> Result<Picture> {
            Ok(Picture::new(plan.tiles, &accumulated(&stage, repeated)?))
        };
        let (mut frames, mut cases, mut moved) = (0, Vec::new(), 0);
        let mut picture = look(&repeated)?;
        for (&after, truth) in after.iter().zip(truth) {
            while frames < after {
                let next = if frames < ONE_BY_ONE { 1 } else { after - frames };
                repeated.advance(next * FRAME_SAMPLES)?;
                frames += next;
                let now = if frames <= ONE_BY_ONE && accumulator == Accumulator::Rgba8 || frames == after {
                    look(&repeated)?
                } else {
                    continue;
                };
                moved = if now.light == picture.light { moved } else { frames };
                picture = now;
            }
            cases.push(case(&picture, truth, after, allowed(accumulator, after)));
        }
        repeated.advance(FRAME_SAMPLES)?;
        let still = look(&repeated)?.light != picture.light;
        let mut said = vec![match (accumulator, still) {
            (Accumulator::Count, _) => "exact, it never freezes".to_string(),
            (_, true) => format!("pixels still change in frame {}", frames + 1),
            (_, false) => format!("no pixel changes after frame {moved}"),
        }];
        said.push(match self.apart_from_twin(&wishes)? {
            0 => "the device's bits are the twin's".into(),
            apart => format!("{apart} texels differ from the twin's"),
        });
        if accumulator == Accumulator::Rgba32f {
            said.extend((!self.lab.quick).then(|| self.limit()));
        }
        if accumulator == Accumulator::Rgba8 {
            said.push(
                "half a step is more than any frame moves a mean m after 510 max(m, 1 - m) frames".into(),
            );
        }
        Ok(Row::of(name, cases).noting(said.join("; ")))
    }

    /// Texels or counts that differ from the twin's, which does all of it: the first frames and, for means, some that go on
    /// with them far on.
    fn apart_from_twin(&self, wishes: &Wishes) -> Result<usize> {
        let first = self.plan(wishes, 0..FRAME_SAMPLES)?;
        let eight_bit = first.settings.accumulator == Accumulator::Rgba8;
        let twin = Twin::new(&first);
        let stage = Stage::new(self.lab.device, &first)?;
        let run = |stage: &Stage<'_>, frames: u32| -> Result<Accumulated> {
            let mut repeated = Repeated::new(stage)?;
            (0..frames).try_for_each(|_| repeated.frame().map(drop))?;
            accumulated(stage, &repeated)
        };
        let pixels = self.size.0 as usize * self.size.1 as usize;
        let mut expected = vec![[0.0; 4]; pixels];
        let mut twins = |plan: &Plan<'_>, frames: u32| {
            for begin in (0..frames).map(|frame| plan.job.samples.start + frame * FRAME_SAMPLES) {
                render_means(
                    &twin.inputs(plan),
                    &mut expected,
                    begin..begin + FRAME_SAMPLES,
                    None,
                    eight_bit,
                );
            }
            expected.clone()
        };
        // The host divides steps of eight bits by 255, the twin multiplies by 1/255.
        let kept = |texel: &[f32; 4]| texel.map(|x| if eight_bit { (x * 255.0).round() } else { x });
        let apart = |found: &Accumulated, expected: &[[f32; 4]]| match found {
            Accumulated::Means(found) => {
                found.iter().zip(expected).filter(|(a, b)| kept(a) != kept(b)).count()
            }
            Accumulated::Counts(_) => pixels,
        };
        match run(&stage, TWIN_FRAMES)? {
            Accumulated::Counts(counts) => {
                let samples = 0..TWIN_FRAMES * FRAME_SAMPLES;
                let twin = render_counts(&twin.inputs(&first), samples, None).counts;
                Ok(counts.iter().zip(&twin).filter(|(a, b)| a != b).count())
            }
            found => {
                let near = apart(&found, &twins(&first, TWIN_FRAMES));
                let begin = FAR * FRAME_SAMPLES;
                let second = self.plan(wishes, begin..begin + FRAME_SAMPLES)?;
                let mut far = Stage::new(self.lab.device, &second)?;
                far.take_means_of(stage);
                Ok(near + apart(&run(&far, FAR_FRAMES)?, &twins(&second, FAR_FRAMES)))
            }
        }
    }

    /// Where a running mean in floats ends, by the twin's arithmetic on sums drawn at random.
    fn limit(&self) -> String {
        let means: &[u32] = self.lab.pick(&[192], &[64, 192, 243]);
        let most = self.lab.pick(23, 24);
        let limits: Vec<(f64, Option<u32>)> =
            means.par_iter().map(|&mean| (f64::from(mean) / 256.0, leaves(mean, most))).collect();
        let each = limits.iter().map(|(mean, frame)| match frame {
            Some(power) => format!("2^{power} frames about {}", digits(*mean)),
            None => format!("more than 2^{most} frames about {}", digits(*mean)),
        });
        format!(
            "by the twin on random sums its mean is off by more than half a step of eight bits after {}",
            each.collect::<Vec<_>>().join(", ")
        )
    }
}

/// The first power of two of frames after which a running mean of sums about 4 `mean` / 256 is off by more than half a step.
fn leaves(mean: u32, most: u32) -> Option<u32> {
    let (mut kept, mut exact) = (0.0f32, 0u64);
    for frame in 1..=1u32 << most {
        let drawn = hash(frame, mean);
        let sum = (0..FRAME_SAMPLES).filter(|byte| (drawn >> (8 * byte) & 255) < mean).count() as u32;
        exact += u64::from(sum);
        let samples = FRAME_SAMPLES * (frame - 1)..FRAME_SAMPLES * frame;
        kept = accumulate::new_mean(kept, sum as f32, &samples);
        if frame.is_power_of_two() {
            let truth = exact as f64 / (f64::from(FRAME_SAMPLES) * f64::from(frame));
            if (f64::from(kept) - truth).abs() > HALF_STEP {
                return Some(frame.ilog2());
            }
        }
    }
    None
}

/// Means row by row.
fn means(plan: &Plan<'_>, counts: &[Count]) -> Vec<f64> {
    let (width, height) = plan.job.size;
    let mean = |place: u32| {
        let count = counts[plan.tiles.number(place % width, place / width) as usize];
        let [escaped, traced] = [[count.escaped0, count.escaped1], [count.traced0, count.traced1]]
            .map(|halves| f64::from(halves[0]) + f64::from(halves[1]));
        if traced > 0.0 { escaped / traced } else { 0.0 }
    };
    (0..width * height).map(mean).collect()
}

/// The pixels that see the scene.
fn case(picture: &Picture, truth: &[f64], frames: u32, allowed: f64) -> Case {
    let off: Vec<f64> = picture
        .light
        .iter()
        .zip(truth)
        .zip(&picture.coverage)
        .filter(|(_, coverage)| **coverage > 0.0)
        .map(|((light, truth), _)| f64::from(*light) - truth)
        .collect();
    let count = off.len().max(1) as f64;
    let bias = off.iter().sum::<f64>() / count;
    let rmse = (off.iter().map(|off| off * off).sum::<f64>() / count).sqrt();
    Case {
        case: format!("{frames} frames"),
        trials: off.len() as u64,
        failures: off.iter().filter(|off| off.is_nan() || off.abs() > allowed).count() as u64,
        worst: Some(off.iter().fold(0.0, |worst, off| off.abs().max(worst))),
        note: Some(format!("bias {}, RMSE {}, {} allowed", digits(bias), digits(rmse), digits(allowed))),
        ..Case::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_running_mean_in_floats_holds_for_a_million_frames_and_not_for_ever() {
        assert_eq!(leaves(192, 20), None);
        assert!(leaves(192, 24).is_some_and(|power| power > 20));
    }

    /// The bound that a pixel may not exceed, on sums that are worst for it and on random ones.
    #[test]
    fn running_means_keep_to_their_bound() {
        let draws: [fn(u32) -> u32; 4] =
            [|frame| hash(frame, 1) % 5, |frame| u32::from(frame % 3 == 0), |frame| 4 * (frame % 2), |_| 3];
        for draw in draws {
            let (mut kept, mut exact) = (0.0f32, 0u64);
            for frame in 1..=65_536 {
                exact += u64::from(draw(frame));
                let samples = FRAME_SAMPLES * (frame - 1)..FRAME_SAMPLES * frame;
                kept = accumulate::new_mean(kept, draw(frame) as f32, &samples);
                let off = f64::from(kept) - exact as f64 / f64::from(4 * frame);
                assert!(off.abs() <= allowed(Accumulator::Rgba32f, frame), "frame {frame}: {off}");
            }
        }
    }

    /// Whatever the rays say: later than this, a frame moves a mean by less than half a step.
    #[test]
    fn eight_bits_freeze_by_frame_510() {
        for sum in 0..=4 {
            for step in 0..=255 {
                let kept = accumulate::eight_bits(step as f32 / 255.0);
                for frame in [512u32, 1024, 65_536] {
                    let samples = FRAME_SAMPLES * (frame - 1)..FRAME_SAMPLES * frame;
                    let next = accumulate::eight_bits(accumulate::new_mean(kept, sum as f32, &samples));
                    assert_eq!(next, kept, "{sum} after {kept} in frame {frame}");
                }
            }
        }
    }
}
