//! Statistics of the samplers' numbers, on the shaders' twin. Bounds are wide against the noise of these seeds (5 standard
//! errors and more) and narrow against what a fault does.

use std::ops::Range;

use cousu::layout::{Frame, SAMPLER_PCG, SAMPLER_PHILOX, SAMPLER_SOBOL, SAMPLER_STRATA, Triangle};
use cousu::pack::NodeArrays;
use cousu::reference::samplers::sample_numbers;
use cousu::reference::{Choices, Inputs, Traversal};
use glam::{DVec2, Vec2};
use rayon::prelude::*;

const ALL: [(&str, u32); 4] =
    [("pcg", SAMPLER_PCG), ("sobol", SAMPLER_SOBOL), ("strata", SAMPLER_STRATA), ("philox", SAMPLER_PHILOX)];

/// What numbers depend on beside pixel and sample.
struct Numbers {
    sampler: u32,
    frame: Frame,
    tree: NodeArrays,
}

impl Numbers {
    fn of(sampler: u32, seed: u32) -> Self {
        Self { sampler, frame: Frame { seed, ..Frame::default() }, tree: NodeArrays::default() }
    }

    fn get(&self, pixel: u32, sample: u32, set: &Range<u32>) -> DVec2 {
        const NONE: &[Triangle] = &[];
        let choices = Choices {
            traversal: Traversal::Brute,
            original: false,
            robust_slabs: true,
            watertight: false,
            conservative: false,
            sampler: self.sampler,
            facing: true,
            ulp_offset: false,
        };
        let inputs = Inputs { frame: &self.frame, triangles: NONE, corners: &[], tree: &self.tree, choices };
        let u: Vec2 = sample_numbers(&inputs, pixel, sample, set, &mut 0);
        u.as_dvec2()
    }

    /// Means of the two halves of a pixel's samples.
    fn halves(&self, pixel: u32, set: &Range<u32>, f: impl Fn(DVec2) -> f64) -> [f64; 2] {
        let (mut sums, mut counts) = ([0.0; 2], [0u32; 2]);
        for sample in set.clone() {
            sums[sample as usize & 1] += f(self.get(pixel, sample, set));
            counts[sample as usize & 1] += 1;
        }
        [0, 1].map(|half| sums[half] / f64::from(counts[half].max(1)))
    }

    /// Mean of a pixel's samples.
    fn mean(&self, pixel: u32, set: &Range<u32>, f: impl Fn(DVec2) -> f64) -> f64 {
        let sum: f64 = set.clone().map(|sample| f(self.get(pixel, sample, set))).sum();
        sum / set.len() as f64
    }
}

/// An occluder that hides a part of the sky, or a smooth sky, with its mean.
struct Sky {
    name: &'static str,
    value: fn(DVec2) -> f64,
    mean: f64,
}

/// The direction of a pair of numbers, seen from above: the hemisphere as a disk.
fn on_disk(u: DVec2) -> DVec2 {
    (1.0 - u.x).sqrt() * DVec2::from_angle(u.y * std::f64::consts::TAU)
}

fn half_plane(u: DVec2) -> f64 {
    f64::from(on_disk(u).dot(DVec2::new(0.8, 0.6)) > 0.3)
}

fn other_half_plane(u: DVec2) -> f64 {
    f64::from(on_disk(u).dot(DVec2::new(-0.28, 0.96)) > 0.0)
}

/// All that stands higher than a great circle.
fn great_circle(u: DVec2) -> f64 {
    let disk = on_disk(u);
    f64::from(0.6 * u.x.sqrt() + 0.8 * disk.x > 0.0)
}

fn round(u: DVec2) -> f64 {
    f64::from(on_disk(u).distance(DVec2::new(0.3, -0.2)) < 0.5)
}

/// Steps across the square, whose edges lie along no axis.
fn step(u: DVec2) -> f64 {
    f64::from(u.x + 0.7 * u.y < 0.8)
}

fn smooth(u: DVec2) -> f64 {
    u.x * u.x * u.y + u.y
}

fn skies() -> [Sky; 6] {
    let segment = |b: f64| (b.acos() - b * (1.0 - b * b).sqrt()) / std::f64::consts::PI;
    [
        Sky { name: "half-plane", value: half_plane, mean: segment(0.3) },
        Sky { name: "half-plane through the middle", value: other_half_plane, mean: 0.5 },
        // Lambert: a half disk and a half ellipse.
        Sky { name: "great circle", value: great_circle, mean: 0.5 + 0.5 * 0.6 },
        Sky { name: "disk", value: round, mean: 0.25 },
        Sky { name: "step", value: step, mean: (0.8 * 0.8 - 0.1 * 0.1) / 1.4 },
        Sky { name: "smooth", value: smooth, mean: 1.0 / 6.0 + 0.5 },
    ]
}

fn rmse(errors: impl ParallelIterator<Item = f64>) -> f64 {
    let (sum, count) =
        errors.map(|error| (error * error, 1u64)).reduce(|| (0.0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    (sum / count as f64).sqrt()
}

/// Error of a pixel's mean after so many samples, over many pixels.
fn pixel_rmse(numbers: &Numbers, sky: &Sky, samples: u32, pixels: u32) -> f64 {
    rmse((0..pixels).into_par_iter().map(|pixel| numbers.mean(pixel, &(0..samples), sky.value) - sky.mean))
}

/// How far the counts of bins are from even ones, in standard deviations of independent points.
fn unevenness(bins: &[u32]) -> f64 {
    let expected = f64::from(bins.iter().sum::<u32>()) / bins.len() as f64;
    let chi2: f64 = bins.iter().map(|&count| (f64::from(count) - expected).powi(2) / expected).sum();
    let freedom = bins.len() as f64 - 1.0;
    (chi2 - freedom) / (2.0 * freedom).sqrt()
}

/// Of points: each coordinate in 256 bins, and both in 16 x 16.
fn bins(points: impl Iterator<Item = DVec2>) -> [Vec<u32>; 3] {
    let mut bins = [vec![0; 256], vec![0; 256], vec![0; 256]];
    for u in points {
        assert!(u.min_element() >= 0.0 && u.max_element() < 1.0, "{u}");
        bins[0][(u.x * 256.0) as usize] += 1;
        bins[1][(u.y * 256.0) as usize] += 1;
        bins[2][(u.x * 16.0) as usize * 16 + (u.y * 16.0) as usize] += 1;
    }
    bins
}

/// One sample of every pixel is spread like independent points (for strata: where a half has a single cell); all samples
/// of all pixels are spread at least as evenly.
#[test]
fn numbers_are_uniform() {
    for (name, sampler) in ALL {
        let numbers = Numbers::of(sampler, 11);
        for sample in [4, 5, 1000, 1 << 20] {
            let set = sample & !1..(sample & !1) + 2;
            let points = (0..1 << 16).map(|pixel| numbers.get(pixel, sample, &set));
            for (place, bins) in bins(points).iter().enumerate() {
                let uneven = unevenness(bins);
                assert!(uneven.abs() < 5.0, "{name}: sample {sample}, bins {place}: {uneven}");
            }
        }
        for set in [0..16, 3..27, 5..6] {
            let points = (0..1 << 12)
                .flat_map(|pixel| set.clone().map(move |sample| (pixel, sample)))
                .map(|(pixel, sample)| numbers.get(pixel, sample, &set));
            for (place, bins) in bins(points).iter().enumerate() {
                let uneven = unevenness(bins);
                assert!(uneven < 5.0, "{name}: samples {set:?}, bins {place}: {uneven}");
            }
        }
    }
}

fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let count = pairs.len() as f64;
    let mean = pairs.iter().fold(DVec2::ZERO, |sum, &pair| sum + DVec2::from(pair)) / count;
    let (mut xy, mut squares) = (0.0, DVec2::ZERO);
    for &pair in pairs {
        let off = DVec2::from(pair) - mean;
        xy += off.x * off.y;
        squares += off * off;
    }
    xy / (squares.x * squares.y).sqrt()
}

/// 65,536 pixels: a standard error of 0.004.
#[test]
fn halves_neighbours_and_seeds_are_independent() {
    let width = 256;
    for (name, sampler) in ALL {
        for sky in &skies()[..5] {
            let halves = |seed: u32| -> Vec<[f64; 2]> {
                let numbers = Numbers::of(sampler, seed);
                (0..width * width)
                    .into_par_iter()
                    .map(|pixel| numbers.halves(pixel, &(0..16), sky.value))
                    .collect()
            };
            let (here, elsewhere) = (halves(3), halves(4));
            let against = |shift: usize, a: usize, b: usize| -> f64 {
                let pairs: Vec<_> = here.iter().zip(&here[shift..]).map(|(x, y)| (x[a], y[b])).collect();
                correlation(&pairs)
            };
            let seeds: Vec<_> = here.iter().zip(&elsewhere).map(|(x, y)| (x[0], y[0])).collect();
            let found = [
                ("halves", against(0, 0, 1)),
                ("neighbours", against(1, 0, 0)),
                ("neighbours' other halves", against(1, 0, 1)),
                ("second neighbours", against(2, 1, 1)),
                ("tiles", against(64, 0, 0)),
                ("rows", against(width as usize, 0, 0)),
                ("seeds", correlation(&seeds)),
            ];
            for (what, r) in found {
                assert!(r.abs() < 0.02, "{name}, {}: {what} correlate by {r}", sky.name);
            }
        }
    }
}

/// Few samples of pixels whose numbers are near: 262,144 pixels, a standard error of 0.002. Two Sobol points of pixels 10
/// numbers apart correlated by 0.2 while their seeds' weak bits turned the first digits.
#[test]
fn pixels_are_independent_at_every_distance() {
    for (name, sampler) in ALL {
        let numbers = Numbers::of(sampler, 5);
        for samples in [2, 4] {
            for sky in &skies()[2..5] {
                let means: Vec<f64> = (0..1 << 18)
                    .into_par_iter()
                    .map(|pixel| numbers.mean(pixel, &(0..samples), sky.value))
                    .collect();
                (1..=64usize).into_par_iter().for_each(|shift| {
                    let pairs: Vec<_> = means.iter().copied().zip(means[shift..].iter().copied()).collect();
                    let r = correlation(&pairs);
                    let what = || format!("{name}, {}: {samples} samples {shift} apart", sky.name);
                    assert!(r.abs() < 0.011, "{} correlate by {r}", what());
                });
            }
        }
    }
}

/// The halves' difference tells the error: of independent samples and of the others alike.
#[test]
fn the_error_estimate_holds() {
    for (name, sampler) in ALL {
        let numbers = Numbers::of(sampler, 21);
        for sky in &skies() {
            let halves: Vec<[f64; 2]> =
                (0..30_000).into_par_iter().map(|pixel| numbers.halves(pixel, &(0..32), sky.value)).collect();
            let error = rmse(halves.par_iter().map(|[a, b]| (a + b) / 2.0 - sky.mean));
            let estimate = rmse(halves.par_iter().map(|[a, b]| (a - b) / 2.0));
            let off = estimate / error - 1.0;
            assert!(off.abs() < 0.03, "{name}, {}: {estimate} estimated, {error} found", sky.name);
        }
    }
}

/// Cells in the same order at all pixels leave no pattern: the mean of 8x8 pixels has an eighth of a pixel's error.
#[test]
fn strata_of_neighbouring_pixels_err_apart() {
    let numbers = Numbers::of(SAMPLER_STRATA, 31);
    for sky in &skies()[..4] {
        for samples in [2, 9, 16, 30] {
            let blocks = 2048u32;
            let mean = |block: u32| {
                let pixels = 64 * block..64 * block + 64;
                pixels.map(|pixel| numbers.mean(pixel, &(0..samples), sky.value)).sum::<f64>() / 64.0
            };
            let error = rmse((0..blocks).into_par_iter().map(|block| mean(block) - sky.mean));
            let independent = (sky.mean * (1.0 - sky.mean) / f64::from(samples) / 64.0).sqrt();
            let what = format!("{}, {samples} samples: {error}", sky.name);
            assert!(error < 1.05 * independent, "{what}, independent {independent}");
            let alone = pixel_rmse(&numbers, sky, samples, 1 << 14) / 8.0;
            assert!((error / alone - 1.0).abs() < 0.1, "{what}, a pixel's {alone}");
        }
    }
}

/// Exponent of the error's fall with the number of samples: least squares of logarithms.
fn slope(numbers: &Numbers, sky: &Sky) -> f64 {
    let points: Vec<(f64, f64)> =
        (4..=9).map(|m| (f64::from(m), pixel_rmse(numbers, sky, 1 << m, 4096).log2())).collect();
    let count = points.len() as f64;
    let (x, y) =
        points.iter().fold((0.0, 0.0), |sum, point| (sum.0 + point.0 / count, sum.1 + point.1 / count));
    let (xy, xx) = points.iter().fold((0.0, 0.0), |sum, point| {
        (sum.0 + (point.0 - x) * (point.1 - y), sum.1 + (point.0 - x).powi(2))
    });
    xy / xx
}

/// Independent samples: -1/2. Jittered cells: -1 on a smooth sky, -3/4 at an edge. Nets: -3/4 at an edge, and -3/2 but for the
/// root of a logarithm on a smooth sky (Owen 1997), which takes a tenth at these numbers.
#[test]
fn errors_fall_as_they_should() {
    let [edge, .., smooth] = skies();
    for (sampler, at_edge, on_smooth) in [
        (SAMPLER_PCG, -0.5, -0.5),
        (SAMPLER_PHILOX, -0.5, -0.5),
        (SAMPLER_STRATA, -0.75, -1.0),
        (SAMPLER_SOBOL, -0.75, -1.4),
    ] {
        let numbers = Numbers::of(sampler, 41);
        for (sky, expected) in [(&edge, at_edge), (&smooth, on_smooth)] {
            let found = slope(&numbers, sky);
            assert!((found - expected).abs() < 0.06, "sampler {sampler}, {}: {found}", sky.name);
        }
    }
}

/// No number of samples is worse than the power of two below it where something is hidden, as in every picture. On a smooth sky
/// powers of two do better than the -1 that holds for all numbers (Owen 1997), so there the next ones may fall back,
/// though never near independent samples.
#[test]
fn any_number_of_sobol_points_is_good() {
    let numbers = Numbers::of(SAMPLER_SOBOL, 51);
    for sky in &skies() {
        let [at16, at24, at32, at40, at48] =
            [16, 24, 32, 40, 48].map(|samples| pixel_rmse(&numbers, sky, samples, 1 << 15));
        let found = [at24 / at16, at40 / at32, at48 / at32];
        let most = if sky.name == "smooth" { [1.0, 1.6, 1.0] } else { [1.0; 3] };
        assert!(found.iter().zip(most).all(|(found, most)| *found <= most), "{}: {found:?}", sky.name);
        let independent = pixel_rmse(&Numbers::of(SAMPLER_PCG, 51), sky, 40, 1 << 12);
        assert!(at40 < 0.6 * independent, "{}: {at40}, independent {independent}", sky.name);
    }
}

/// Any number of cells, from an even sample number and from an odd one: the mean over many pixels is the integral.
#[test]
fn strata_of_any_number_are_unbiased() {
    let numbers = Numbers::of(SAMPLER_STRATA, 61);
    let height = Sky { name: "height", value: |u| u.x, mean: 0.5 };
    let azimuth = Sky { name: "azimuth", value: |u| (u.y - 0.5).abs(), mean: 0.25 };
    let low = Sky { name: "low", value: |u| f64::from(u.x < 0.3), mean: 0.3 };
    let [half_plane, .., smooth] = skies();
    for sky in [&height, &azimuth, &low, &half_plane, &smooth] {
        for samples in 1..=80 {
            let begin = 7 + samples % 3;
            let pixels = 4096;
            let means: Vec<f64> = (0..pixels)
                .into_par_iter()
                .map(|pixel| numbers.mean(pixel, &(begin..begin + samples), sky.value))
                .collect();
            let mean = means.iter().sum::<f64>() / f64::from(pixels);
            let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / f64::from(pixels - 1);
            let error = (mean - sky.mean) / (variance / f64::from(pixels)).sqrt();
            assert!(
                error.abs() < 4.0,
                "{}: {samples} samples give {mean}, {error} standard errors off",
                sky.name
            );
        }
    }
}
