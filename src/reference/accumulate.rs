//! Where a pixel's ambient rays are added up: exact counts, or the original's running mean. Twin of
//! shaders/shared/accumulate.glsl.

use std::ops::Range;

use crate::layout::Count;

/// A count with more rays: two halves each.
pub fn add_samples(count: Count, escaped: [u32; 2], traced: [u32; 2]) -> Count {
    Count {
        escaped0: count.escaped0 + escaped[0],
        traced0: count.traced0 + traced[0],
        escaped1: count.escaped1 + escaped[1],
        traced1: count.traced1 + traced[1],
    }
}

/// The running mean of samples.end samples, given that of samples.start and the sum of the rest.
pub fn new_mean(mean: f32, sum: f32, samples: &Range<u32>) -> f32 {
    (mean * samples.start as f32 + sum) / samples.end as f32
}

/// What an rgba8 image keeps of a value: the nearest of 256 steps (of two the even one), NaN as 0; read
/// back as that step times the rounded 1/255, as Mesa's software device does (a device that divides by 255
/// differs by an ulp for some steps).
#[expect(clippy::manual_clamp, reason = "clamp keeps a NaN, max gives the other value")]
pub fn eight_bits(x: f32) -> f32 {
    let step = (x.max(0.0).min(1.0) * 255.0).round_ties_even();
    step * (1.0 / 255.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_add_half_by_half() {
        let count = add_samples(Count::default(), [1, 2], [3, 4]);
        let count = add_samples(count, [10, 20], [30, 40]);
        assert_eq!(count, Count { escaped0: 11, traced0: 33, escaped1: 22, traced1: 44 });
    }

    #[test]
    fn the_running_mean_is_the_mean() {
        let mut mean = 0.0;
        for frame in 0..8 {
            mean = new_mean(mean, frame as f32, &(4 * frame..4 * frame + 4));
        }
        assert!((mean - 28.0 / 32.0).abs() < 1e-6, "{mean}");
    }

    #[test]
    fn eight_bits_round_to_the_nearest_step() {
        for step in 0..=255 {
            let value = step as f32 / 255.0;
            for x in [value, value + 0.4 / 255.0, value - 0.4 / 255.0] {
                assert_eq!((eight_bits(x) * 255.0).round(), step as f32, "{x}");
            }
        }
        assert_eq!([eight_bits(-1.0), eight_bits(f32::NAN), eight_bits(9.0)], [0.0, 0.0, 1.0]);
    }
}
