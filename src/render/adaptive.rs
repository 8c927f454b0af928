//! Samples where the error is: a pilot, which is thrown away, tells how much each camera ray's light varies, and the
//! samples are shared out for the least mean square error. Since nothing of the pilot is in the picture, the shares do
//! not depend on the picture's random numbers, and it stays unbiased.

use super::choices::Sampler;
use super::rounds::MOST_SAMPLES;
use super::tiles::Tiles;
use crate::layout::Count;

/// Samples of the pilot.
pub const PILOT: u32 = 16;
/// Fewest samples of a camera ray that hits: two of each half.
const FEWEST: u32 = 4;
/// Neighbours on each side whose variance is taken for a pixel's own, since a pilot of few samples may see none where
/// there is some.
const REACH: u32 = 2;
/// Least variance of a pixel, as a part of the mean.
const FLOOR: f64 = 0.05;

/// How the samples are shared out among camera rays, by their numbers; 0 for those that hit nothing.
pub struct Shares {
    weights: Vec<f32>,
    hits: usize,
    /// Only powers of two, which a sequence in base 2 fills evenly.
    powers_of_two: bool,
}

impl Shares {
    /// From the pilot's counts. The variance of a mean of n independent samples is v / n, so the sum over pixels is
    /// least for n in proportion to sqrt(v); stratified samples have v / n^(3/2) across an edge, hence v^(2/5).
    pub fn of_pilot(tiles: Tiles, counts: &[Count], sampler: Sampler) -> Self {
        let power = match sampler {
            Sampler::Lcg | Sampler::Pcg | Sampler::Philox => 0.5,
            Sampler::Sobol | Sampler::Strata => 0.4,
        };
        let smooth = smoothed(tiles, counts);
        let hits = smooth.iter().filter(|variance| **variance > 0.0).count();
        let mean = smooth.iter().map(|v| f64::from(*v)).sum::<f64>() / hits.max(1) as f64;
        let weight = |&variance: &f32| match variance {
            0.0 => 0.0,
            some => f64::from(some).max(FLOOR * mean).powf(power) as f32,
        };
        Self { weights: smooth.iter().map(weight).collect(), hits, powers_of_two: sampler == Sampler::Sobol }
    }

    /// Samples of each camera ray when a ray that hits gets `mean` of them on the average. They never fall as `mean`
    /// grows.
    pub fn samples(&self, mean: u32) -> Vec<u32> {
        let wanted = u64::from(mean) * self.hits as u64;
        let sum = |scale: f64| self.weights.iter().map(|&w| u64::from(self.of_weight(w, scale))).sum::<u64>();
        let (mut low, mut high) = (0.0, 1.0);
        while sum(high) < wanted && high < 1e12 {
            (low, high) = (high, high * 2.0);
        }
        for _ in 0..30 {
            let middle = 0.5 * (low + high);
            if sum(middle) <= wanted { low = middle } else { high = middle }
        }
        self.weights.iter().map(|&weight| self.of_weight(weight, low)).collect()
    }

    fn of_weight(&self, weight: f32, scale: f64) -> u32 {
        if weight == 0.0 {
            return 0;
        }
        let samples = (f64::from(weight) * scale).min(f64::from(MOST_SAMPLES));
        let samples = if self.powers_of_two {
            samples.max(1.0).log2().round().exp2()
        } else {
            (samples * 0.5).round() * 2.0
        };
        (samples as u32).max(FEWEST)
    }
}

/// The variance of one sample, from each camera ray's own counts and its neighbours'. That of e escaped rays of n is
/// p (1 - p) with p = (e + 1/2) / (n + 1) (Krichevsky and Trofimov 1981), so that no ray's is 0 that hits.
fn smoothed(tiles: Tiles, counts: &[Count]) -> Vec<f32> {
    let variance = |count: &Count| -> f32 {
        let traced = count.traced0 + count.traced1;
        let share = (f64::from(count.escaped0 + count.escaped1) + 0.5) / (f64::from(traced) + 1.0);
        if traced == 0 { 0.0 } else { (share * (1.0 - share)) as f32 }
    };
    let own: Vec<f32> = counts.iter().map(variance).collect();
    let mut smooth = vec![0.0; own.len()];
    let padded = tiles.padded_pixels() as usize;
    for ray in 0..tiles.jitters as usize {
        let at = |x: u32, y: u32| own[tiles.number(x, y) as usize + ray * padded];
        for y in 0..tiles.height {
            for x in 0..tiles.width {
                if at(x, y) == 0.0 {
                    continue;
                }
                let (mut sum, mut hits) = (0.0, 0.0);
                for y in y.saturating_sub(REACH)..=(y + REACH).min(tiles.height - 1) {
                    for x in x.saturating_sub(REACH)..=(x + REACH).min(tiles.width - 1) {
                        sum += at(x, y);
                        hits += f32::from(u8::from(at(x, y) > 0.0));
                    }
                }
                smooth[tiles.number(x, y) as usize + ray * padded] = 0.5 * at(x, y) + 0.5 * sum / hits;
            }
        }
    }
    smooth
}
