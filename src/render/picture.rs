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
    /// `samples`: ambient rays that were asked for at each pixel.
    pub fn new(tiles: Tiles, accumulated: &Accumulated, samples: u32) -> Self {
        let pixels = tiles.width as usize * tiles.height as usize;
        let mut light = Vec::with_capacity(pixels);
        let mut coverage = Vec::with_capacity(pixels);
        for y in 0..tiles.height {
            for x in 0..tiles.width {
                let (a, alpha) = match accumulated {
                    Accumulated::Counts(counts) => of_count(&counts[tiles.number(x, y) as usize], samples),
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

fn of_count(count: &Count, samples: u32) -> (f32, f32) {
    let asked = f64::from(samples.max(1));
    let escaped = f64::from(count.escaped0) + f64::from(count.escaped1);
    let traced = f64::from(count.traced0) + f64::from(count.traced1);
    ((escaped / asked) as f32, (traced / asked) as f32)
}

/// Root mean square error of the picture, estimated from the difference of each pixel's two halves over
/// the pixels that have both; `None` if there is none. With halves of n0 and n1 rays whose means are m0
/// and m1, E (m0 - m1)^2 = s^2 (1/n0 + 1/n1), and the mean of all has variance s^2 / (n0 + n1).
pub fn rmse_estimate(accumulated: &Accumulated) -> Option<f64> {
    let Accumulated::Counts(counts) = accumulated else { return None };
    let mut sum = 0.0;
    let mut pixels = 0u64;
    for count in counts.iter().filter(|count| count.traced0 > 0 && count.traced1 > 0) {
        let (n0, n1) = (f64::from(count.traced0), f64::from(count.traced1));
        let difference = f64::from(count.escaped0) / n0 - f64::from(count.escaped1) / n1;
        sum += difference * difference * n0 * n1 / (n0 + n1).powi(2);
        pixels += 1;
    }
    (pixels > 0).then(|| (sum / pixels as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_become_light_and_coverage() {
        let tiles = Tiles { width: 2, height: 1 };
        let mut counts = vec![Count::default(); 64];
        counts[1] = Count { escaped0: 3, traced0: 4, escaped1: 1, traced1: 4 };
        let picture = Picture::new(tiles, &Accumulated::Counts(counts), 8);
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
        let counts = (0..20_000)
            .map(|_| Count { escaped0: toss(), traced0: 8, escaped1: toss(), traced1: 8 })
            .collect();
        let rmse = rmse_estimate(&Accumulated::Counts(counts)).unwrap();
        assert!((rmse - 0.125).abs() < 0.125 * 0.03, "{rmse}");
    }
}
