//! Samples where the error is: a pilot, which is thrown away, tells how much each camera ray's light varies, and the
//! samples are shared out for the least mean square error. Since nothing of the pilot is in the picture, the shares do
//! not depend on the picture's random numbers, and it stays unbiased.

use super::choices::Sampler;
use super::rounds::MOST_SAMPLES;
use super::tiles::Tiles;
use crate::layout::Count;

/// Samples of a pixel in the pilot; with several camera rays each has four at least.
pub const PILOT: u32 = 16;
/// Fewest samples of a camera ray that hits: two of each half.
const FEWEST: u32 = 4;
/// Least variance of a pixel, as a part of the mean.
const FLOOR: f64 = 0.02;

/// How the samples are shared out among camera rays, by their numbers; 0 for those that hit nothing.
pub struct Shares {
    weights: Vec<f32>,
    hits: usize,
    powers_of_two: bool,
}

/// How the variance of a camera ray's light is found, and what follows from it.
struct Rule {
    variance: fn(&Count) -> f64,
    /// Neighbours on each side whose variance counts too, since few samples may see none where there is some.
    reach: u32,
    /// The part of a ray's own.
    own: f32,
    /// The share is in proportion to this power of the variance.
    power: f64,
    /// Only powers of two, which a sequence in base 2 fills evenly.
    powers_of_two: bool,
}

impl Rule {
    fn of(sampler: Sampler) -> Self {
        match sampler {
            // The variance of a mean of n is v / n: its sum over rays is least for n in proportion to sqrt(v).
            Sampler::Lcg | Sampler::Pcg | Sampler::Philox => {
                Self { variance: of_independent, reach: 2, own: 0.5, power: 0.5, powers_of_two: false }
            }
            // v / n^(3/2) across an edge, hence v^(2/5); and only the halves tell how well the points fit the edges.
            Sampler::Sobol | Sampler::Strata => Self {
                variance: of_halves,
                reach: 3,
                own: 0.1,
                power: 0.4,
                powers_of_two: sampler == Sampler::Sobol,
            },
        }
    }
}

/// Of one sample, if e of n independent ones escaped: e (n - e) / (n (n - 1)), without bias.
fn of_independent(count: &Count) -> f64 {
    let (e, n) = (f64::from(count.escaped0 + count.escaped1), f64::from(count.traced0 + count.traced1));
    e * (n - e) / (n * (n - 1.0).max(1.0))
}

/// The same from the difference of two halves of n / 2 samples, which need not be independent among themselves.
fn of_halves(count: &Count) -> f64 {
    let difference = f64::from(count.escaped0) - f64::from(count.escaped1);
    difference * difference / f64::from(count.traced0 + count.traced1)
}

impl Shares {
    /// From the pilot's counts.
    pub fn of_pilot(tiles: Tiles, counts: &[Count], sampler: Sampler) -> Self {
        let rule = Rule::of(sampler);
        let power = rule.power;
        let smooth = smoothed(tiles, counts, &rule);
        let hits = smooth.iter().flatten().count();
        let mean = smooth.iter().flatten().map(|v| f64::from(*v)).sum::<f64>() / hits.max(1) as f64;
        // Where nothing varies, all get the same.
        let least = if mean > 0.0 { FLOOR * mean } else { 1.0 };
        let weight = |variance: &Option<f32>| {
            variance.map_or(0.0, |variance| f64::from(variance).max(least).powf(power) as f32)
        };
        Self { weights: smooth.iter().map(weight).collect(), hits, powers_of_two: rule.powers_of_two }
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

/// The variance of each camera ray's light, from its own counts and its neighbours'; `None` for those that hit nothing.
fn smoothed(tiles: Tiles, counts: &[Count], rule: &Rule) -> Vec<Option<f32>> {
    let variance = |count: &Count| (count.traced0 > 0).then(|| (rule.variance)(count) as f32);
    let own: Vec<Option<f32>> = counts.iter().map(variance).collect();
    let mut smooth = vec![None; own.len()];
    let padded = tiles.padded_pixels() as usize;
    for ray in 0..tiles.jitters as usize {
        let place = |x: u32, y: u32| tiles.number(x, y) as usize + ray * padded;
        for y in 0..tiles.height {
            for x in 0..tiles.width {
                let Some(here) = own[place(x, y)] else { continue };
                let rows = y.saturating_sub(rule.reach)..=(y + rule.reach).min(tiles.height - 1);
                let columns = x.saturating_sub(rule.reach)..=(x + rule.reach).min(tiles.width - 1);
                let (mut sum, mut hits) = (0.0, 0.0);
                for y in rows {
                    for variance in columns.clone().filter_map(|x| own[place(x, y)]) {
                        sum += variance;
                        hits += 1.0;
                    }
                }
                smooth[place(x, y)] = Some(rule.own * here + (1.0 - rule.own) * sum / hits);
            }
        }
    }
    smooth
}

#[cfg(test)]
mod tests {
    use super::*;

    const TILES: Tiles = Tiles { width: 64, height: 32, jitters: 1 };

    /// A quarter of the picture is not hit, a quarter open, the rest varies as a fair coin.
    fn counts() -> Vec<Count> {
        let count = |number: u32| match TILES.position(number).0 {
            0..16 => Count::default(),
            16..32 => Count { escaped0: 8, traced0: 8, escaped1: 8, traced1: 8 },
            _ => Count { escaped0: 3 + number % 3, traced0: 8, escaped1: 4, traced1: 8 },
        };
        (0..TILES.numbers() as u32).map(count).collect()
    }

    #[test]
    fn shares_have_the_mean_and_grow_with_it() {
        for sampler in [Sampler::Pcg, Sampler::Sobol, Sampler::Strata] {
            let shares = Shares::of_pilot(TILES, &counts(), sampler);
            let mut before = vec![0; counts().len()];
            for mean in [16, 24, 32, 100, 5000] {
                let samples = shares.samples(mean);
                let sum: u64 = samples.iter().map(|&n| u64::from(n)).sum();
                let hits = samples.iter().filter(|&&n| n > 0).count();
                assert_eq!(hits, 48 * 32);
                let found = sum as f64 / hits as f64;
                let rounding = if sampler == Sampler::Sobol { 0.35 } else { 0.03 };
                assert!((found / f64::from(mean) - 1.0).abs() < rounding, "{sampler} {mean}: {found}");
                assert!(samples.iter().zip(&before).all(|(now, before)| now >= before), "{sampler} {mean}");
                assert!(samples.iter().all(|&n| n == 0 || n >= FEWEST && n.is_multiple_of(2)));
                before = samples;
            }
        }
    }

    #[test]
    fn an_open_pixel_gets_few_and_one_without_a_hit_none() {
        let samples = Shares::of_pilot(TILES, &counts(), Sampler::Pcg).samples(64);
        let at = |x| samples[TILES.number(x, 16) as usize];
        assert_eq!(at(5), 0);
        assert!(at(50) > 4 * at(24) && at(24) >= FEWEST, "{} {}", at(50), at(24));
    }

    #[test]
    fn where_nothing_varies_all_get_the_same() {
        let open = vec![Count { escaped0: 8, traced0: 8, escaped1: 8, traced1: 8 }; TILES.numbers() as usize];
        let samples = Shares::of_pilot(TILES, &open, Sampler::Sobol).samples(64);
        assert!(samples.iter().all(|&n| n == 64));
    }
}
