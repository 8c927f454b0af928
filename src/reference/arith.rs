//! Arithmetic that gives the same bits on every device: each operation is rounded by itself, in the
//! order of the shaders' text. Twin of shaders/shared/arith.glsl.

use glam::{Vec2, Vec3};

/// Smallest determinant taken for a triangle that the ray can meet, 2^-120: below it [`reciprocal`] overflows.
pub const SMALLEST_DETERMINANT: f32 = 7.523_164e-37;

/// 2^120: from here on it underflows.
pub const LARGEST_DETERMINANT: f32 = 1.329_228e36;

pub fn dot3(a: Vec3, b: Vec3) -> f32 {
    a.x * b.x + a.y * b.y + a.z * b.z
}

pub fn cross3(a: Vec3, b: Vec3) -> Vec3 {
    Vec3::new(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
}

pub fn max_abs(v: Vec3) -> f32 {
    v.x.abs().max(v.y.abs().max(v.z.abs()))
}

/// Smaller of each component; of a number and a NaN the number, unlike glam's.
pub fn min3(a: Vec3, b: Vec3) -> Vec3 {
    Vec3::new(a.x.min(b.x), a.y.min(b.y), a.z.min(b.z))
}

/// Larger of each component; of a number and a NaN the number, unlike glam's.
pub fn max3(a: Vec3, b: Vec3) -> Vec3 {
    Vec3::new(a.x.max(b.x), a.y.max(b.y), a.z.max(b.z))
}

/// 1/x for 2^-120 < x < 2^120, within 2 ulp: a guess from the exponent, four Newton steps.
pub fn reciprocal(x: f32) -> f32 {
    let mut r = f32::from_bits(0x7ef3_11c7_u32.wrapping_sub(x.to_bits()));
    for _ in 0..4 {
        let error = 2.0 - x * r;
        r *= error;
    }
    r
}

/// 1/sqrt(x) for 2^-120 < x < 2^120, within 3 ulp, in the same way; finite for x = 0.
pub fn reciprocal_sqrt(x: f32) -> f32 {
    let mut r = f32::from_bits(0x5f37_59df_u32.wrapping_sub(x.to_bits() >> 1));
    let half_x = 0.5 * x;
    for _ in 0..4 {
        let error = 1.5 - half_x * r * r;
        r *= error;
    }
    r
}

/// (cos, sin) of 2 pi u for 0 <= u <= 1, within 2^-22: an eighth of a turn by Taylor polynomials.
#[expect(clippy::excessive_precision, reason = "the digits of the shader")]
pub fn cos_sin_turn(u: f32) -> Vec2 {
    let quarter = (u * 4.0 + 0.5).floor();
    let x = (u - quarter * 0.25) * std::f32::consts::TAU;
    let x2 = x * x;
    let c = 1.0 + x2 * (-0.5 + x2 * (4.16666667e-2 + x2 * (-1.38888889e-3 + x2 * 2.48015873e-5)));
    let s = x + x * x2 * (-0.166666667 + x2 * (8.33333333e-3 + x2 * (-1.98412698e-4 + x2 * 2.75573192e-6)));
    let turn = quarter as i32 & 3;
    let odd = if turn & 1 == 1 { Vec2::new(-s, c) } else { Vec2::new(c, s) };
    if turn & 2 == 2 { -odd } else { odd }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::testing::Random;

    const MILLION: usize = 1_000_000;

    /// Values over the whole stated range, 2^-120 to 2^120, and its ends.
    fn positive_values() -> impl Iterator<Item = f32> {
        let mut random = Random::new(1);
        let (low, high) = (2f32.powi(-120).to_bits() + 1, 2f32.powi(120).to_bits() - 1);
        let ends = [low, high, 1f32.to_bits() - 1, 1f32.to_bits(), 1f32.to_bits() + 1];
        let spread = (0..MILLION).map(move |_| low + random.below(high - low));
        spread.chain(ends).map(f32::from_bits)
    }

    /// Distance in units of the last place of the exact value's binade.
    fn ulps(got: f32, exact: f64) -> f64 {
        (f64::from(got) - exact).abs() / (exact.log2().floor() - 23.0).exp2()
    }

    /// Largest relative error, in units of 2^-24, over all f32 from 1 to 4. The functions scale exactly: the
    /// guess of 1/4^n x is 4^n (or 2^n) times that of x, and so is every step, so this is all there is.
    fn worst_relative(f: impl Fn(f32) -> f32, exact: impl Fn(f64) -> f64) -> f64 {
        let values = (1f32.to_bits()..4f32.to_bits()).map(f32::from_bits);
        let error = |x: f32| (f64::from(f(x)) / exact(f64::from(x)) - 1.0).abs();
        values.map(error).fold(0.0, f64::max) * 2f64.powi(24)
    }

    #[test]
    fn reciprocal_is_within_2_ulp() {
        let exact = |x: f64| 1.0 / x;
        let worst = positive_values().map(|x| ulps(reciprocal(x), exact(x.into()))).fold(0.0, f64::max);
        let relative = worst_relative(reciprocal, exact);
        println!("reciprocal: {worst} ulp, {relative} x 2^-24");
        assert!(worst <= 2.0, "{worst} ulp");
        assert!(relative <= 2.0, "{relative} x 2^-24, more than exact.rs allows for");
    }

    #[test]
    fn reciprocal_sqrt_is_within_3_ulp_and_finite_at_zero() {
        let exact = |x: f64| 1.0 / x.sqrt();
        let worst = positive_values().map(|x| ulps(reciprocal_sqrt(x), exact(x.into()))).fold(0.0, f64::max);
        println!("reciprocal_sqrt: {worst} ulp, {} x 2^-24", worst_relative(reciprocal_sqrt, exact));
        assert!(worst <= 3.0, "{worst} ulp");
        assert!(reciprocal_sqrt(0.0).is_finite());
    }

    #[test]
    fn cos_sin_turn_is_within_2_to_the_minus_22() {
        let mut random = Random::new(2);
        let mut worst = 0f64;
        let spread = (0..MILLION).map(|_| random.unit());
        for u in spread.chain([0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0 - 2f32.powi(-24), 1.0]) {
            let got = cos_sin_turn(u);
            let (sin, cos) = (f64::from(u) * std::f64::consts::TAU).sin_cos();
            worst = worst.max((f64::from(got.x) - cos).abs()).max((f64::from(got.y) - sin).abs());
        }
        println!("cos_sin_turn: {worst:e} = 2^{}", worst.log2());
        assert!(worst <= 2f64.powi(-22), "{worst:e}");
    }

    #[test]
    fn min_and_max_prefer_numbers_to_nan() {
        let (nan, one) = (Vec3::NAN, Vec3::ONE);
        for v in [min3(nan, one), min3(one, nan), max3(nan, one), max3(one, nan)] {
            assert_eq!(v, one);
        }
        assert_eq!(max_abs(Vec3::new(-3.0, 2.0, 1.0)), 3.0);
    }

    #[test]
    fn dot_and_cross_follow_the_right_hand() {
        assert_eq!(cross3(Vec3::X, Vec3::Y), Vec3::Z);
        assert_eq!(cross3(Vec3::Y, Vec3::Z), Vec3::X);
        assert_eq!(cross3(Vec3::Z, Vec3::X), Vec3::Y);
        assert_eq!(dot3(Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)), 32.0);
        // In the written order the large terms cancel first and leave the last one; in another they
        // would swallow it.
        assert_eq!(dot3(Vec3::new(1e8, -1e8, 1.0), Vec3::ONE), 1.0);
    }
}
