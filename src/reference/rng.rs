//! Random numbers. Twin of shaders/shared/rng.glsl.

use glam::Vec2;

/// Four hashes of a pixel's sample: PCG4D of Jarzynski and Olano, "Hash Functions for GPU Rendering"
/// (2020). Every (pixel, sample, dimension, seed) has its own.
pub fn pcg4d(v: [u32; 4]) -> [u32; 4] {
    let [x, y, z, w] = v.map(|lane| lane.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    mix(mix([x, y, z, w]).map(|lane| lane ^ (lane >> 16)))
}

fn mix([mut x, mut y, mut z, mut w]: [u32; 4]) -> [u32; 4] {
    x = x.wrapping_add(y.wrapping_mul(w));
    y = y.wrapping_add(z.wrapping_mul(x));
    z = z.wrapping_add(x.wrapping_mul(y));
    w = w.wrapping_add(y.wrapping_mul(z));
    [x, y, z, w]
}

/// Multiples of 2^-24 in [0, 1).
pub fn unit_floats(bits: [u32; 2]) -> Vec2 {
    Vec2::new((bits[0] >> 8) as f32, (bits[1] >> 8) as f32) * f32::EPSILON * 0.5
}

/// The original's generator, modulus 2^31 (constants of the C standard's example rand).
pub fn lcg_step(state: u32) -> u32 {
    1_103_515_245_u32.wrapping_mul(state).wrapping_add(12345) & 0x7fff_ffff
}

/// The original's u = x / 2^31, which may round up to 1.
pub fn lcg_float(state: u32) -> f32 {
    state as f32 * 4.656_613e-10
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::testing::Random;

    /// The published steps, modulo 2^32 in u128 and one assignment after the other.
    fn published(mut v: [u128; 4]) -> [u128; 4] {
        const M: u128 = 1 << 32;
        for lane in &mut v {
            *lane = (*lane * 1_664_525 + 1_013_904_223) % M;
        }
        for round in 0..2 {
            for (into, a, b) in [(0, 1, 3), (1, 2, 0), (2, 0, 1), (3, 1, 2)] {
                v[into] = (v[into] + v[a] * v[b]) % M;
            }
            if round == 0 {
                for lane in &mut v {
                    *lane ^= *lane / 65536;
                }
            }
        }
        v
    }

    #[test]
    fn pcg4d_is_the_published_function() {
        let mut random = Random::new(3);
        for _ in 0..10_000 {
            let v = [random.bits(), random.bits(), random.bits(), random.bits()];
            assert_eq!(pcg4d(v).map(u128::from), published(v.map(u128::from)), "{v:?}");
        }
    }

    #[test]
    fn pcg4d_fills_256_bins_evenly() {
        // Neighbouring pixels and samples, as a render asks for them; each of the four hashes, and the
        // pairs that a direction is made of.
        let (pixels, samples) = (256u32, 256u32);
        let mut bins = [[0u32; 256]; 5];
        for pixel in 0..pixels {
            for sample in 0..samples {
                let hash = pcg4d([pixel, sample, 0, 1]);
                for lane in 0..4 {
                    bins[lane][(hash[lane] >> 24) as usize] += 1;
                }
                bins[4][((hash[0] >> 28) << 4 | hash[1] >> 28) as usize] += 1;
            }
        }
        let expected = f64::from(pixels * samples) / 256.0;
        for counts in bins {
            let chi2: f64 = counts.iter().map(|&n| (f64::from(n) - expected).powi(2) / expected).sum();
            println!("chi-square, 255 degrees of freedom: {chi2}");
            // 255 +- 4.5 standard deviations of sqrt(2 * 255): a good generator fails once in 10^5.
            assert!((255.0 - 102.0..255.0 + 102.0).contains(&chi2), "{chi2}");
        }
    }

    #[test]
    fn unit_floats_are_multiples_of_2_to_the_minus_24_below_1() {
        let ends = unit_floats([0xff, u32::MAX]);
        assert_eq!(ends, Vec2::new(0.0, 1.0 - 2f32.powi(-24)));
        assert_eq!(unit_floats([0x100, 0x8000_0000]), Vec2::new(2f32.powi(-24), 0.5));
    }

    /// a^n and (a^n - 1) / (a - 1) modulo 2^31, by squaring of the affine map.
    fn power(n: u64) -> (u64, u64) {
        const M: u64 = 1 << 31;
        let (mut a, mut b) = (1_103_515_245_u64, 12345_u64);
        let (mut total_a, mut total_b) = (1, 0);
        let mut left = n;
        while left > 0 {
            if left & 1 == 1 {
                (total_a, total_b) = (total_a * a % M, (a * total_b + b) % M);
            }
            (a, b) = (a * a % M, (a * b + b) % M);
            left >>= 1;
        }
        (total_a, total_b)
    }

    #[test]
    fn lcg_follows_the_closed_form() {
        let start = 0x1234_5678_u32;
        let mut state = start;
        for n in 1..=100_000_u64 {
            state = lcg_step(state);
            if n % 997 == 0 || n < 100 {
                let (a, b) = power(n);
                assert_eq!(u64::from(state), (a * u64::from(start) + b) % (1 << 31), "after {n} steps");
            }
        }
        // A full period of 2^31 returns to the start.
        assert_eq!(power(1 << 31), (1, 0));
    }

    #[test]
    fn lcg_float_divides_by_2_to_the_31_and_may_round_to_1() {
        assert_eq!(lcg_float(1 << 30), 0.5);
        assert_eq!(lcg_float(0x7fff_ffff), 1.0);
        assert_eq!(lcg_float(1), 2f32.powi(-31));
    }
}
