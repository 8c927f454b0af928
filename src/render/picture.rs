//! What was rendered, pixel by pixel.

use crate::layout::Count;
use crate::render::tiles::Tiles;

/// What an accumulator holds in the end.
#[derive(Clone, Debug, PartialEq)]
pub enum Accumulated {
    /// Rays of each pixel, in the order of [`Tiles`].
    Counts(Vec<Count>),
    /// Mean and share of hits (in the fourth channel), row by row.
    Means(Vec<[f32; 4]>),
}

/// Ambient light and coverage, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    pub width: u32,
    pub height: u32,
    /// A of each pixel, premultiplied by its coverage; in [0, 1].
    pub light: Vec<f32>,
    /// Share of the pixel's camera rays that hit.
    pub coverage: Vec<f32>,
}

impl Picture {
    pub fn new(tiles: Tiles, accumulated: &Accumulated) -> Self {
        let pixels = tiles.width as usize * tiles.height as usize;
        let mut light = Vec::with_capacity(pixels);
        let mut coverage = Vec::with_capacity(pixels);
        for y in 0..tiles.height {
            for x in 0..tiles.width {
                let (a, alpha) = match accumulated {
                    Accumulated::Counts(counts) => of_counts(rays_of(tiles, counts, x, y), tiles.jitters),
                    Accumulated::Means(means) => {
                        let mean = means[y as usize * tiles.width as usize + x as usize];
                        (mean[0], mean[3])
                    }
                };
                light.push(a);
                coverage.push(alpha);
            }
        }
        Self { width: tiles.width, height: tiles.height, light, coverage }
    }
}

/// The counts of a pixel's camera rays.
fn rays_of(tiles: Tiles, counts: &[Count], x: u32, y: u32) -> impl Iterator<Item = &Count> {
    counts[tiles.number(x, y) as usize..].iter().step_by(tiles.padded_pixels() as usize)
}

/// Light and coverage of a pixel: of each camera ray that hits, the share of rays that escaped.
fn of_counts<'a>(rays: impl Iterator<Item = &'a Count>, jitters: u32) -> (f32, f32) {
    let (mut light, mut hits) = (0.0, 0.0);
    for count in rays {
        let traced = f64::from(count.traced0) + f64::from(count.traced1);
        if traced > 0.0 {
            light += (f64::from(count.escaped0) + f64::from(count.escaped1)) / traced;
            hits += 1.0;
        }
    }
    let jitters = f64::from(jitters.max(1));
    ((light / jitters) as f32, (hits / jitters) as f32)
}

/// Root mean square error of a picture, estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorEstimate {
    pub rmse: f64,
    /// One standard error of the mean square error, as a part of it: how far chance may have led the estimate astray.
    pub uncertainty: f64,
    /// What the mean square error may be though no ray told of it: of n rays that agree, 3 / n may be otherwise (the rule
    /// of three, at 95%).
    pub unseen: f64,
}

/// Estimates the error from the difference of each camera ray's two halves, over the pixels that are covered wholly;
/// `None` if there is none. With halves of n0 and n1 rays whose means are m0 and m1, E (m0 - m1)^2 = s^2 (1/n0 + 1/n1),
/// and the mean of all has variance s^2 / (n0 + n1). The halves' random numbers are independent, so this holds for any
/// sampler, and a pixel's camera rays are independent of each other, so their squares add up.
pub fn rmse_estimate(tiles: Tiles, accumulated: &Accumulated) -> Option<ErrorEstimate> {
    let Accumulated::Counts(counts) = accumulated else { return None };
    let (mut sum, mut sum_of_squares, mut pixels, mut rays) = (0.0, 0.0, 0.0, 0.0);
    let weight = f64::from(tiles.jitters.max(1)).powi(-2);
    for y in 0..tiles.height {
        for x in 0..tiles.width {
            let square_error = |count: &Count| {
                let (n0, n1) = (f64::from(count.traced0), f64::from(count.traced1));
                let difference = f64::from(count.escaped0) / n0 - f64::from(count.escaped1) / n1;
                (n0 * n1 > 0.0).then(|| difference * difference * n0 * n1 / (n0 + n1).powi(2))
            };
            let all: Option<f64> = rays_of(tiles, counts, x, y).map(square_error).sum();
            if let Some(square) = all.map(|square| square * weight) {
                sum += square;
                sum_of_squares += square * square;
                pixels += 1.0;
                rays += rays_of(tiles, counts, x, y)
                    .map(|c| f64::from(c.traced0) + f64::from(c.traced1))
                    .sum::<f64>();
            }
        }
    }
    let mean = sum / pixels;
    // Squares of normal deviates vary by sqrt(2) of their mean; few pixels may hide that.
    let spread = (sum_of_squares / pixels - mean * mean).max(2.0 * mean * mean) / pixels;
    let uncertainty = if mean > 0.0 { spread.sqrt() / mean } else { 0.0 };
    let unseen = 3.0 * pixels / (rays * rays);
    (pixels > 0.0).then(|| ErrorEstimate { rmse: mean.sqrt(), uncertainty, unseen })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_become_light_and_coverage() {
        let tiles = Tiles { width: 2, height: 1, jitters: 1 };
        let mut counts = vec![Count::default(); 64];
        counts[1] = Count { escaped0: 3, traced0: 4, escaped1: 1, traced1: 4 };
        let picture = Picture::new(tiles, &Accumulated::Counts(counts));
        assert_eq!((picture.light, picture.coverage), (vec![0.0, 0.5], vec![0.0, 1.0]));
    }

    #[test]
    fn the_error_of_fair_coins_is_estimated() {
        // Halves of 8 tosses each: the error of the mean of 16 is 1/8.
        let mut state = 1u32;
        let mut toss = || {
            (0..8)
                .map(|_| {
                    state = crate::render::seeds::hash(state, 7);
                    state & 1
                })
                .sum::<u32>()
        };
        let counts = (0..8 * 2504)
            .map(|_| Count { escaped0: toss(), traced0: 8, escaped1: toss(), traced1: 8 })
            .collect();
        let tiles = Tiles { width: 8, height: 2500, jitters: 1 };
        let Some(estimate) = rmse_estimate(tiles, &Accumulated::Counts(counts)) else {
            panic!("an estimate")
        };
        assert!((estimate.rmse - 0.125).abs() < 0.125 * 0.03, "{estimate:?}");
        // The square of a normal deviate has a standard deviation of sqrt(2) times its mean.
        let expected = (2.0f64 / 20_000.0).sqrt();
        assert!((estimate.uncertainty - expected).abs() < 0.1 * expected, "{estimate:?}");
    }
}
