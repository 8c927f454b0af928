//! Random numbers: how errors fall, and what is correlated.
//!
//! Errors fall in real pictures; correlations and blocks are those of the twin's numbers, to which tests hold the shaders bit
//! by bit, under skies of which the mean is known.

use glam::DVec2;
use rayon::prelude::*;

use super::{Case, Experiment, Findings, Lab, Row};
use crate::error::Result;
use crate::lab::figure::Figure;
use crate::lab::interleave::digits;
use crate::lab::scenes::procedural;
use crate::layout::{ANY_CELLS, FRAME_SAMPLES, Frame, SPEC_CELLS, SPEC_REPEAT, TILE_SIDE};
use crate::pack::NodeArrays;
use crate::reference::samplers::sample_numbers;
use crate::reference::{Choices, Inputs, Traversal};
use crate::render::choices::{Passes, Sampler, Wishes};
use crate::render::geometry::Geometry;
use crate::render::picture::{Accumulated, Picture};
use crate::render::plan::{Job, Plan};
use crate::render::repeat::Repeated;
use crate::render::seeds::{hash, lcg_seeds};
use crate::render::specialize::sampler_code;
use crate::render::stage::Stage;
use crate::render::tiles::Tiles;
use crate::scene::Scene;
use crate::vk::DeviceKind;

pub const EXPERIMENT: Experiment = Experiment {
    name: "random",
    what: "Error slopes, correlations of neighbours and frames, periods, and the error of blocks of pixels.",
    counts: "checks",
    worst: "largest correlation",
    run,
};

/// Samples after which the error of a picture is taken.
const SAMPLES: &[u32] = &[4, 16, 64, 256, 1024];
const QUICK_SAMPLES: &[u32] = &[4, 16, 64, 256];
/// Slope of log error over log samples for independent numbers, and how far from it is as good.
const SLOPE: f64 = -0.5;
const SLOPE_BAND: f64 = 0.05;
/// Correlation from which on numbers are not as good as independent.
const CORRELATED: f64 = 0.01;
/// Pixels a side of the picture that correlations are taken over: 262,144 have a standard error of 0.002.
const SIDE: u32 = 512;
/// Columns and rows that pixels may be apart, and samples of each, where they are compared.
const REACH: u32 = 3;
const NEIGHBOURS_SAMPLES: [u32; 2] = [2, 4];
/// Successive frames that are compared.
const FRAMES: u32 = 3;
/// Samples of a pixel where blocks of pixels are looked at, and blocks: 4,096 have a standard error of 1.1%.
const BLOCK_SAMPLES: &[u32] = &[4, 16];
const BLOCKS: u32 = 1 << 12;
/// Error of the mean of 8x8 pixels over that of independent samples, at most.
const BLOCK_ERROR: f64 = 1.05;
const BLOCK_PIXELS: u32 = TILE_SIDE * TILE_SIDE;
/// Samples and pictures of the Cornell box whose blocks are looked at.
const BLOCK_OF_PICTURE: u32 = 16;
const PICTURES: u32 = 64;
/// The original's picture, and frames that numbers must last for.
const ORIGINAL_SIZE: [u32; 2] = [1024, 640];
const LAST: u64 = 65_536;
/// Numbers of the original's generator before they come again, 2^31.
const LCG_PERIOD: u64 = 1 << 31;

/// Where a variant's numbers come from.
#[derive(Clone, Copy, PartialEq)]
struct Source {
    sampler: Sampler,
    /// Begun again every frame.
    repeats: bool,
}

impl Source {
    /// Whether its samples are to be as good as independent, and no better.
    fn independent(self) -> bool {
        matches!(self.sampler, Sampler::Lcg | Sampler::Pcg | Sampler::Philox)
    }
}

fn run(lab: &Lab<'_>) -> Result<Findings> {
    let scene = procedural("cornell", None, lab.seed)?;
    let geometry = lab.geometry(&scene, &Wishes::default())?;
    let usual = lab.plan(lab.job(&scene, (16, 10), FRAME_SAMPLES), &scene, &geometry, &Wishes::default())?;
    let fresh = |sampler: Sampler| (sampler.name(), Source { sampler, repeats: false });
    let variants = [
        fresh(Sampler::Lcg),
        fresh(Sampler::Pcg),
        ("fixed-seed", Source { sampler: Sampler::Pcg, repeats: true }),
        fresh(Sampler::Sobol),
        fresh(Sampler::Strata),
        fresh(Sampler::Philox),
        ("auto", Source { sampler: usual.settings.sampler, repeats: false }),
    ];
    let all = variants.len() as f64;
    let measured: Vec<Result<Errors>> = (variants.iter().enumerate())
        .map(|(place, &(name, source))| {
            lab.observe(name, 0.5 * place as f64 / all);
            errors(lab, &scene, &geometry, source, name == "auto")
        })
        .collect();
    let found = |wanted: &str| {
        let place = variants.iter().position(|(name, _)| *name == wanted)?;
        measured[place].as_ref().ok()
    };
    let independent = found("pcg").map(|errors| errors.of_blocks);
    let (mut rows, mut known) = (Vec::new(), Vec::<(Source, Vec<Case>)>::new());
    for (place, ((name, source), errors)) in variants.into_iter().zip(&measured).enumerate() {
        lab.observe(name, 0.5 + 0.4 * place as f64 / all);
        if known.iter().all(|(other, _)| *other != source) {
            known.push((source, of_numbers(lab, source)));
        }
        let more = known.iter().find(|(other, _)| *other == source).map_or(&[][..], |(_, cases)| cases);
        rows.push(match errors {
            Ok(errors) => row(lab, name, source, errors, independent, more),
            Err(error) => Row::undecided(name, error.to_string()),
        });
    }
    if !lab.quick {
        lab.observe("costs", 0.95);
        let choices = variants.map(|(name, source)| (name, wishes(source, name == "auto")));
        // The numbers that come again cost what they cost anyway.
        let choices: Vec<_> = [1, 0, 3, 4, 5, 6].map(|place| choices[place]).to_vec();
        for (ratio, (name, _)) in lab.costs(&scene, &geometry, &choices)?.into_iter().zip(&choices) {
            rows.iter_mut().filter(|row| row.variant == *name).for_each(|row| row.gpu_ms_ratio = Some(ratio));
        }
    }
    let mut figures = Vec::new();
    if let Some((Errors { shown: same, .. }, Errors { shown: fresh, .. })) =
        found("fixed-seed").zip(found("pcg"))
    {
        let fails: Vec<bool> =
            same.light.iter().zip(&fresh.light).map(|(a, b)| (a - b).abs() > SEEN).collect();
        figures.push(Figure::of_failure("random-fixed-seed", same, fresh, &fails));
    }
    Ok(Findings { rows, figures })
}

/// Light that is off by as much is marked.
const SEEN: f32 = 0.1;

fn wishes(source: Source, usual: bool) -> Wishes {
    match usual {
        true => Wishes::default(),
        // The fewest kernels to compile.
        false => Wishes { sampler: Some(source.sampler), passes: Some(Passes::Single), ..Wishes::default() },
    }
}

/// Root mean square errors of the Cornell box's pictures.
struct Errors {
    /// After [`SAMPLES`].
    of_pixels: Vec<f64>,
    /// Of the means of 8x8 pixels, after [`BLOCK_OF_PICTURE`] samples.
    of_blocks: f64,
    /// After 64 samples.
    shown: Picture,
}

/// No reference is needed: two seeds give two pictures whose errors are independent, so their difference has twice the
/// variance, and many seeds tell it by their spread.
fn errors(lab: &Lab<'_>, scene: &Scene, geometry: &Geometry, source: Source, usual: bool) -> Result<Errors> {
    let size = match lab.device.adapter().kind {
        DeviceKind::Cpu => lab.pick((40, 24), (64, 40)),
        _ => (256, 160),
    };
    let job = Job { size, ..lab.job(scene, size, FRAME_SAMPLES) };
    // Pictures of many lengths are made with one plan.
    let mut plan =
        lab.plan(job, scene, geometry, &wishes(source, usual))?.with_constant(SPEC_CELLS, ANY_CELLS);
    if source.repeats {
        plan = plan.with_constant(SPEC_REPEAT, FRAME_SAMPLES);
    }
    let mut stage = Stage::new(lab.device, &plan)?;
    let mut light = Vec::new();
    for seed in 0..2 {
        stage.reseed(hash(seed, lab.seed))?;
        light.push(
            lengths(lab)
                .iter()
                .map(|&samples| picture(&stage, &plan, samples))
                .collect::<Result<Vec<_>>>()?,
        );
    }
    let of_pixels = light[0].iter().zip(&light[1]).map(|(a, b)| difference(a, b) / 2f64.sqrt()).collect();
    let mut blocks = Vec::new();
    for seed in 0..PICTURES {
        stage.reseed(hash(seed, lab.seed.wrapping_add(1)))?;
        blocks.push(block_means(&picture(&stage, &plan, BLOCK_OF_PICTURE)?));
    }
    Ok(Errors { of_pixels, of_blocks: spread(&blocks), shown: light[0].swap_remove(2) })
}

/// Light of each block of 8x8 pixels that sees the scene wholly.
fn block_means(picture: &Picture) -> Vec<f64> {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let side = TILE_SIDE as usize;
    let block = |(x, y): (usize, usize)| {
        let pixels = (0..side * side).map(|k| (y + k / side) * width + x + k % side);
        let covered = pixels.clone().all(|place| picture.coverage[place] > 0.0);
        let sum: f64 = pixels.map(|place| f64::from(picture.light[place])).sum();
        covered.then(|| sum / (side * side) as f64)
    };
    let corners = (0..height / side).flat_map(|y| (0..width / side).map(move |x| (x * side, y * side)));
    corners.filter_map(block).collect()
}

/// Standard deviation of each value over the lists, root mean square over the values.
fn spread(lists: &[Vec<f64>]) -> f64 {
    let count = lists.len() as f64;
    let values = lists.first().map_or(0, Vec::len);
    let variance = |place: usize| {
        let mean = lists.iter().map(|list| list[place]).sum::<f64>() / count;
        lists.iter().map(|list| (list[place] - mean).powi(2)).sum::<f64>() / (count - 1.0)
    };
    ((0..values).map(variance).sum::<f64>() / values.max(1) as f64).sqrt()
}

fn lengths(lab: &Lab<'_>) -> &'static [u32] {
    lab.pick(QUICK_SAMPLES, SAMPLES)
}

fn picture(stage: &Stage<'_>, plan: &Plan<'_>, samples: u32) -> Result<Picture> {
    let mut repeated = Repeated::new(stage)?;
    repeated.advance(samples)?;
    Ok(Picture::new(plan.tiles, &Accumulated::Counts(repeated.counts()?)))
}

/// Root mean square over the pixels that see the scene.
fn difference(a: &Picture, b: &Picture) -> f64 {
    let off = a.light.iter().zip(&b.light).zip(&a.coverage).filter(|(_, coverage)| **coverage > 0.0);
    let squares: Vec<f64> = off.map(|((a, b), _)| f64::from(a - b).powi(2)).collect();
    (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
}

/// Slope of log error over log samples, by least squares.
fn slope(samples: &[u32], errors: &[f64]) -> f64 {
    let points =
        samples.iter().zip(errors).map(|(&n, error)| DVec2::new(f64::from(n).ln(), error.max(1e-12).ln()));
    let points: Vec<DVec2> = points.collect();
    let mean = points.iter().sum::<DVec2>() / points.len() as f64;
    let (over, under) = points
        .iter()
        .map(|point| *point - mean)
        .fold((0.0, 0.0), |(over, under), off| (over + off.x * off.y, under + off.x * off.x));
    over / under
}

/// What can be said of the numbers without a picture.
fn of_numbers(lab: &Lab<'_>, source: Source) -> Vec<Case> {
    let numbers = Numbers::of(source, lab.seed);
    let mut cases: Vec<Case> = correlations(source, &numbers).into();
    cases.extend([blocks(lab, &numbers), period(source, lab.seed)]);
    cases
}

fn row(
    lab: &Lab<'_>,
    name: &str,
    source: Source,
    errors: &Errors,
    independent: Option<f64>,
    more: &[Case],
) -> Row {
    let mut cases = vec![falling(lab, source, &errors.of_pixels)];
    cases.extend(independent.map(|independent| {
        let ratio = errors.of_blocks / independent;
        // Two lots of independent samples may well be so far apart.
        let fails = ratio > BLOCK_ERROR && (source.repeats || !source.independent());
        case("blocks of the Cornell box", &[fails], None, format!("{ratio:.3} times pcg's error"))
    }));
    cases.extend_from_slice(more);
    Row::of(name, cases)
}

fn case(name: &str, fails: &[bool], worst: Option<f64>, note: String) -> Case {
    let failures = fails.iter().filter(|&&fails| fails).count() as u64;
    Case {
        case: name.into(),
        trials: fails.len() as u64,
        failures,
        worst,
        note: Some(note),
        ..Case::default()
    }
}

fn falling(lab: &Lab<'_>, source: Source, errors: &[f64]) -> Case {
    let slope = slope(lengths(lab), errors);
    // Points that fill the square do better than independent ones.
    let too_steep = source.independent() && slope < SLOPE - SLOPE_BAND;
    let each: Vec<String> =
        lengths(lab).iter().zip(errors).map(|(n, e)| format!("{} at {n}", digits(*e))).collect();
    let note = format!("error falls as samples^{slope:.3}: {}", each.join(", "));
    case("slope", &[slope.is_nan() || slope > SLOPE + SLOPE_BAND || too_steep], None, note)
}

/// Sums over pairs, for their correlation.
#[derive(Clone, Copy, Default)]
struct Pairs {
    count: f64,
    sums: DVec2,
    squares: DVec2,
    product: f64,
}

impl Pairs {
    fn add(self, a: f64, b: f64) -> Self {
        let pair = DVec2::new(a, b);
        Self {
            count: self.count + 1.0,
            sums: self.sums + pair,
            squares: self.squares + pair * pair,
            product: self.product + a * b,
        }
    }

    fn correlation(self) -> f64 {
        let mean = self.sums / self.count;
        let spread = self.squares / self.count - mean * mean;
        (self.product / self.count - mean.x * mean.y) / (spread.x * spread.y).sqrt().max(1e-30)
    }
}

/// Of the means of a pixel's first samples, under each sky: of pixels that lie near each other, and of a pixel's successive
/// frames.
fn correlations(source: Source, numbers: &Numbers) -> [Case; 2] {
    let tiles = Tiles { width: SIDE, height: SIDE, jitters: 1 };
    let pixels = || (0..tiles.numbers() as u32).into_par_iter();
    let of = |a: &[Means], b: &[Means], (dx, dy): (u32, u32), sky: usize| {
        let places = (0..SIDE - dy).flat_map(|y| (0..SIDE - dx).map(move |x| (x, y)));
        let pairs = places.fold(Pairs::default(), |pairs, (x, y)| {
            let [here, there] =
                [tiles.number(x, y), tiles.number(x + dx, y + dy)].map(|number| number as usize);
            pairs.add(a[here][sky], b[there][sky])
        });
        pairs.correlation()
    };
    let mut beside = Vec::new();
    for samples in NEIGHBOURS_SAMPLES {
        let means: Vec<Means> =
            pixels().map(|pixel| numbers.mean(pixel, 0..samples, &mut numbers.state(pixel))).collect();
        let each = (1..REACH * REACH).into_par_iter().flat_map_iter(|place| {
            let means = &means;
            (0..SKIES.len()).map(move |sky| of(means, means, (place % REACH, place / REACH), sky).abs())
        });
        beside.extend(each.collect::<Vec<_>>());
    }
    let frames: Vec<[Means; FRAMES as usize]> = pixels().map(|pixel| numbers.frames(pixel)).collect();
    let frame = |place: usize| -> Vec<Means> { frames.iter().map(|frames| frames[place]).collect() };
    let mut after = Vec::new();
    for place in 1..FRAMES as usize {
        let [before, now] = [frame(place - 1), frame(place)];
        after.extend((0..SKIES.len()).map(|sky| of(&before, &now, (0, 0), sky)));
    }
    // Where one frame errs, the next may make up for it: that is what points that fill the square do.
    let bad = |r: &f64| if source.independent() { r.abs() } else { r.max(0.0) };
    let (least, most) = range(&after);
    let harm: Vec<f64> = after.iter().map(bad).collect();
    let check = |name: &str, correlations: &[f64], note: String| {
        let fails: Vec<bool> = correlations.iter().map(|r| r.is_nan() || *r > CORRELATED).collect();
        case(name, &fails, Some(range(correlations).1), note)
    };
    let up_to = format!(
        "pixels up to {0} columns and {0} rows apart, {NEIGHBOURS_SAMPLES:?} samples each",
        REACH - 1
    );
    [
        check("neighbouring pixels", &beside, up_to),
        check("successive frames", &harm, format!("correlations from {least:.4} to {most:.4}")),
    ]
}

/// The least and the largest.
fn range(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), value| (a.min(*value), b.max(*value)))
}

/// The mean of 8x8 neighbouring pixels, each under the same sky, over what independent samples would err.
fn blocks(lab: &Lab<'_>, numbers: &Numbers) -> Case {
    let blocks = lab.pick(BLOCKS, 4 * BLOCKS);
    let mut ratios = Vec::new();
    for &samples in BLOCK_SAMPLES {
        let squares = |block: u32| {
            let pixels = BLOCK_PIXELS * block..BLOCK_PIXELS * (block + 1);
            let sums = pixels.map(|pixel| numbers.mean(pixel, 0..samples, &mut numbers.state(pixel)));
            let mean = sums.fold([0.0; SKIES.len()], add).map(|sum| sum / f64::from(BLOCK_PIXELS));
            std::array::from_fn(|sky| (mean[sky] - SKIES[sky].mean).powi(2))
        };
        let sums = (0..blocks).into_par_iter().map(squares).reduce(|| [0.0; SKIES.len()], add);
        for (sky, sum) in SKIES.iter().zip(sums) {
            let variance = sky.mean * (1.0 - sky.mean) / f64::from(samples * BLOCK_PIXELS);
            ratios.push((sum / f64::from(blocks) / variance).sqrt());
        }
    }
    let fails: Vec<bool> = ratios.iter().map(|ratio| *ratio > BLOCK_ERROR).collect();
    let (least, most) = range(&ratios);
    let note = format!("{least:.3} to {most:.3} times the error of independent samples");
    case("blocks of 8x8 pixels", &fails, None, note)
}

fn add<const N: usize>(a: [f64; N], b: [f64; N]) -> [f64; N] {
    std::array::from_fn(|place| a[place] + b[place])
}

/// Whether any number is drawn twice in as many frames as are added up, in the original's picture.
fn period(source: Source, seed: u32) -> Case {
    let samples = u64::from(FRAME_SAMPLES);
    let mut fails = Vec::new();
    let note = match source.sampler {
        _ if source.repeats => "each frame draws the numbers of the first".into(),
        Sampler::Lcg => {
            let pixels = ORIGINAL_SIZE[0] * ORIGINAL_SIZE[1];
            let gaps = gaps(&lcg_seeds(0, pixels, seed));
            let share = |frames: u64| {
                let shared = gaps.iter().filter(|gap| **gap < 2 * samples * frames).count();
                shared as f64 / gaps.len() as f64 * 100.0
            };
            // A pixel that draws what another drew adds nothing to what they have in common.
            fails.push(share(LAST) > 0.0);
            let whole = LCG_PERIOD as f64 / (2 * samples * u64::from(pixels)) as f64;
            format!(
                "all pixels walk one cycle of 2^31 numbers, spent after {whole:.0} frames of {}x{}; of the pixels draw \
                 another's numbers: {:.2}% in 1 frame, {:.0}% in {whole:.0}, {:.0}% in {LAST}",
                ORIGINAL_SIZE[0],
                ORIGINAL_SIZE[1],
                share(1),
                share(whole as u64),
                share(LAST)
            )
        }
        Sampler::Sobol => "a pixel's two sequences have 2^31 points each, under seeds of their own".into(),
        _ => "a function of pixel and sample, of which there are 2^32 each".into(),
    };
    // Of the others it is known by how they are made, not measured: no trial.
    case("period", &fails, None, note)
}

/// For each of these states, how many numbers are drawn from it before the next of them comes.
fn gaps(states: &[u32]) -> Vec<u64> {
    let mut places: Vec<u64> = states.par_iter().map(|&state| place_on_cycle(state)).collect();
    places.par_sort_unstable();
    let next = places.iter().skip(1).copied().chain(places.first().map(|first| first + LCG_PERIOD));
    places.iter().zip(next).map(|(place, next)| next - place).collect()
}

/// After how many steps from 0 the original's generator comes to a state. The last k bits have period 2^k, so the number of
/// steps is found bit by bit (Knuth 1997, section 3.2.1.2).
fn place_on_cycle(state: u32) -> u64 {
    let (mut steps, mut here) = (0, 0u32);
    // What 2^bit steps do: x goes to a x + c.
    let (mut a, mut c) = (1_103_515_245u32, 12345u32);
    for bit in 0..31 {
        if (here ^ state) >> bit & 1 == 1 {
            steps |= 1 << bit;
            here = a.wrapping_mul(here).wrapping_add(c);
        }
        c = a.wrapping_mul(c).wrapping_add(c);
        a = a.wrapping_mul(a);
    }
    steps
}

/// A part of the square of numbers that is open sky, with its share.
struct Sky {
    open: fn(DVec2) -> bool,
    mean: f64,
}

const SKIES: [Sky; 3] = [
    // Half the sky, by the azimuth.
    Sky { open: |u| (u.y + 0.29).fract() < 0.5, mean: 0.5 },
    // A hole.
    Sky { open: |u| u.distance_squared(DVec2::new(0.4, 0.6)) < 0.08, mean: std::f64::consts::PI * 0.08 },
    // An edge that lies along no axis.
    Sky { open: |u| u.x + 0.7 * u.y < 0.8, mean: (0.8 * 0.8 - 0.1 * 0.1) / 1.4 },
];

/// Under each sky.
type Means = [f64; SKIES.len()];

/// What numbers depend on beside pixel and sample.
struct Numbers {
    source: Source,
    frame: Frame,
    tree: NodeArrays,
}

impl Numbers {
    fn of(source: Source, seed: u32) -> Self {
        Self { source, frame: Frame { seed, ..Frame::default() }, tree: NodeArrays::default() }
    }

    /// Of `lcg`, before a pixel's first sample.
    fn state(&self, pixel: u32) -> u32 {
        lcg_seeds(pixel, pixel + 1, self.frame.seed)[0]
    }

    /// Mean of a pixel's samples under each sky.
    fn mean(&self, pixel: u32, set: std::ops::Range<u32>, state: &mut u32) -> Means {
        let choices = Choices {
            traversal: Traversal::Brute,
            original: false,
            robust_slabs: true,
            watertight: false,
            conservative: false,
            sampler: sampler_code(self.source.sampler),
            facing: true,
            ulp_offset: false,
        };
        let inputs = Inputs { frame: &self.frame, triangles: &[], corners: &[], tree: &self.tree, choices };
        let mut open = [0u32; SKIES.len()];
        for sample in set.clone() {
            let sample = if self.source.repeats { sample % FRAME_SAMPLES } else { sample };
            let u = sample_numbers(&inputs, pixel, sample, &set, state).as_dvec2();
            SKIES.iter().zip(&mut open).for_each(|(sky, open)| *open += u32::from((sky.open)(u)));
        }
        open.map(|open| f64::from(open) / f64::from(set.end - set.start))
    }

    /// Of the first frames.
    fn frames(&self, pixel: u32) -> [Means; FRAMES as usize] {
        let mut state = self.state(pixel);
        std::array::from_fn(|frame| {
            let begin = FRAME_SAMPLES * frame as u32;
            self.mean(pixel, begin..begin + FRAME_SAMPLES, &mut state)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::rng::lcg_step;

    #[test]
    fn slopes_of_known_errors() {
        for power in [0.0, -0.5, -1.5] {
            let errors: Vec<f64> = SAMPLES.iter().map(|&n| 0.3 * f64::from(n).powf(power)).collect();
            assert!((slope(SAMPLES, &errors) - power).abs() < 1e-12);
        }
    }

    #[test]
    fn the_spread_is_that_of_each_value() {
        let lists = [vec![1.0, 10.0], vec![3.0, 10.0], vec![2.0, 16.0]];
        assert!((spread(&lists) - ((1.0f64 + 12.0) / 2.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn places_on_the_cycle_are_steps() {
        let mut state = 0;
        for steps in 0..100_000 {
            assert_eq!(place_on_cycle(state), steps);
            state = lcg_step(state);
        }
        let far = 0x1234_5678;
        assert_eq!((place_on_cycle(lcg_step(far)) + LCG_PERIOD - place_on_cycle(far)) % LCG_PERIOD, 1);
    }

    #[test]
    fn gaps_go_round_the_cycle() {
        let after = |steps| (0..steps).fold(0, |state, _| lcg_step(state));
        assert_eq!(gaps(&[after(30), after(0), after(7)]), [7, 23, LCG_PERIOD - 30]);
    }

    #[test]
    fn correlations_of_known_pairs() {
        let of = |pair: fn(f64) -> f64| {
            (0..1000)
                .fold(Pairs::default(), |pairs, n| pairs.add(f64::from(n), pair(f64::from(n))))
                .correlation()
        };
        assert!((of(|x| 2.0 * x + 1.0) - 1.0).abs() < 1e-9);
        assert!((of(|x| -x) + 1.0).abs() < 1e-9);
        assert!(of(|x| (x - 499.5).abs()).abs() < 1e-9);
    }

    /// The skies' shares, by the middles of a fine grid.
    #[test]
    fn skies_have_their_means() {
        let side = 2000;
        for sky in &SKIES {
            let middle = |k: i32| (f64::from(k) + 0.5) / f64::from(side);
            let open = (0..side).flat_map(|x| (0..side).map(move |y| DVec2::new(middle(x), middle(y))));
            let share = open.filter(|u| (sky.open)(*u)).count() as f64 / f64::from(side).powi(2);
            assert!((share - sky.mean).abs() < 1e-4, "{share} {}", sky.mean);
        }
    }
}
