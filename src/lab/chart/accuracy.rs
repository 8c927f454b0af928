//! How far pictures are from the truth, given references that have noise of their own.

use crate::render::picture::Picture;

/// What pictures are compared with: one reference, or two that are independent of each other, at the pixels that they
/// cover fully.
pub struct Truth {
    /// Places in the picture, row by row.
    pixels: Vec<usize>,
    first: Vec<f64>,
    second: Option<Vec<f64>>,
}

/// A picture's errors, each with its standard error over the pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// Mean squared error. With two references the estimate can be negative: then the error drowns in their noise.
    pub mse: f64,
    pub mse_error: f64,
    /// Mean error, signed: positive where the picture is too bright.
    pub bias: f64,
    pub bias_error: f64,
    /// Pixels without a number, left out of the figures.
    pub not_finite: usize,
}

/// A pixel's coverage is a sum of shares, so that the last bits of 1 may be missing.
const COVERED: f32 = 1.0 - 1e-6;

impl Truth {
    /// `None` if no pixel is covered fully in every reference. They must have the same size.
    pub fn new(first: &Picture, second: Option<&Picture>) -> Option<Self> {
        let covered = |place: &usize| {
            first.coverage[*place] >= COVERED
                && second.is_none_or(|second| second.coverage[*place] >= COVERED)
        };
        let pixels: Vec<usize> = (0..first.light.len()).filter(covered).collect();
        let of = |picture: &Picture| pixels.iter().map(|&place| f64::from(picture.light[place])).collect();
        let (first, second) = (of(first), second.map(of));
        (!pixels.is_empty()).then_some(Self { pixels, first, second })
    }

    /// Pixels that are compared.
    pub fn pixels(&self) -> usize {
        self.pixels.len()
    }

    /// Mean of the pixels' light.
    pub fn mean(&self) -> f64 {
        self.first.iter().sum::<f64>() / self.first.len() as f64
    }

    /// The errors of a picture, row by row.
    ///
    /// With x = t + e and references t + e1, t + e2 whose noises are independent, E (x - r1)(x - r2) = e^2: what the
    /// references add to the mean squared error of x drops out. With one reference its variance stays in.
    pub fn errors(&self, light: &[f32]) -> Errors {
        let (mut squares, mut errors) = (Mean::default(), Mean::default());
        let mut not_finite = 0;
        for (place, &pixel) in self.pixels.iter().enumerate() {
            let x = f64::from(light[pixel]);
            if !x.is_finite() {
                not_finite += 1;
                continue;
            }
            let first = self.first[place];
            let second = self.second.as_ref().map_or(first, |second| second[place]);
            squares.add((x - first) * (x - second));
            errors.add(x - 0.5 * (first + second));
        }
        Errors {
            mse: squares.mean(),
            mse_error: squares.standard_error(),
            bias: errors.mean(),
            bias_error: errors.standard_error(),
            not_finite,
        }
    }

    /// The RMSE that a picture without any error would be told to have, give or take: the root of the mean squared
    /// error's standard error. `None` with one reference, whose noise is not known.
    ///
    /// Of a picture t the products are e1 e2, with variance v^2 where v is that of e1 and of e2. The difference of the
    /// references has variance 2 v; if it is about normal, its fourth moment is 12 v^2.
    pub fn resolution(&self) -> Option<f64> {
        let second = self.second.as_ref()?;
        let fourth: f64 = self.first.iter().zip(second).map(|(a, b)| (a - b).powi(4)).sum();
        Some(((fourth / 12.0).sqrt() / self.pixels.len() as f64).sqrt())
    }
}

/// Mean and variance of a stream of numbers (Welford 1962).
#[derive(Default)]
struct Mean {
    count: f64,
    mean: f64,
    squares: f64,
}

impl Mean {
    fn add(&mut self, value: f64) {
        self.count += 1.0;
        let difference = value - self.mean;
        self.mean += difference / self.count;
        self.squares += difference * (value - self.mean);
    }

    /// NaN without a number.
    fn mean(&self) -> f64 {
        if self.count > 0.0 { self.mean } else { f64::NAN }
    }

    /// Of the mean.
    fn standard_error(&self) -> f64 {
        if self.count > 1.0 { (self.squares / (self.count - 1.0) / self.count).sqrt() } else { f64::INFINITY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::seeds::hash;

    const PIXELS: u32 = 4000;

    /// A number of mean 0 and variance 1, from 12 uniform ones.
    fn noise(pixel: u32, seed: u32) -> f64 {
        (0..12).map(|i| f64::from(hash(12 * pixel + i, seed)) / 4294967296.0).sum::<f64>() - 6.0
    }

    fn truth_at(pixel: u32) -> f64 {
        f64::from(pixel % 64) / 64.0
    }

    /// The truth, moved and with noise.
    fn picture(shift: f64, sigma: f64, seed: u32) -> Picture {
        let light = (0..PIXELS).map(|i| (truth_at(i) + shift + sigma * noise(i, seed)) as f32).collect();
        Picture { width: 64, height: PIXELS.div_ceil(64), light, coverage: vec![1.0; PIXELS as usize] }
    }

    #[test]
    fn the_product_of_two_references_does_not_see_their_noise() {
        // Errors far below the references' own: over many trials the mean is right, and so is its standard error.
        let (sigma, reference_sigma) = (0.002, 0.02);
        let (mut sum, mut told, mut apart) = (0.0, 0.0, 0.0);
        let trials = 60;
        for trial in 0..trials {
            let [a, b] = [1, 2].map(|i| picture(0.0, reference_sigma, 1000 * i + trial));
            let errors = Truth::new(&a, Some(&b)).unwrap().errors(&picture(0.0, sigma, 7 + trial).light);
            sum += errors.mse;
            told += errors.mse_error / f64::from(trials);
            apart += (errors.mse - sigma * sigma).powi(2) / f64::from(trials);
        }
        let error = told / f64::from(trials).sqrt();
        let mse = sum / f64::from(trials);
        assert!((mse - sigma * sigma).abs() < 4.0 * error, "{mse} +- {error}");
        assert!((apart.sqrt() / told - 1.0).abs() < 0.35, "{} {told}", apart.sqrt());
    }

    #[test]
    fn one_reference_adds_its_variance() {
        let errors = Truth::new(&picture(0.0, 0.02, 1), None).unwrap().errors(&picture(0.0, 0.01, 2).light);
        assert!((errors.mse - 0.0005).abs() < 4.0 * errors.mse_error, "{errors:?}");
        assert!(errors.mse_error < 2e-5);
    }

    #[test]
    fn a_shift_is_the_bias_and_noise_is_none() {
        let [a, b] = [1, 2].map(|seed| picture(0.0, 0.01, seed));
        let truth = Truth::new(&a, Some(&b)).unwrap();
        for shift in [-0.03, 0.0, 0.001] {
            let errors = truth.errors(&picture(shift, 0.02, 3).light);
            assert!((errors.bias - shift).abs() < 4.0 * errors.bias_error, "{shift}: {errors:?}");
            assert!(errors.bias_error < 5e-4);
        }
    }

    #[test]
    fn the_resolution_is_what_a_perfect_picture_is_told() {
        let (mut square, trials) = (0.0, 200);
        let mut resolution = 0.0;
        for trial in 0..trials {
            let [a, b] = [1, 2].map(|i| picture(0.0, 0.01, 1000 * i + trial));
            let truth = Truth::new(&a, Some(&b)).unwrap();
            square += truth.errors(&picture(0.0, 0.0, 0).light).mse.powi(2) / f64::from(trials);
            resolution = truth.resolution().unwrap();
        }
        let seen = square.sqrt().sqrt();
        assert!((resolution / seen - 1.0).abs() < 0.1, "{resolution} {seen}");
        assert!(Truth::new(&picture(0.0, 0.01, 1), None).unwrap().resolution().is_none());
    }

    #[test]
    fn only_pixels_that_all_references_cover_count() {
        let (mut a, mut b, mut x) = (picture(0.0, 0.0, 1), picture(0.0, 0.0, 2), picture(0.1, 0.0, 3));
        a.coverage[5] = 0.0;
        b.coverage[6] = 0.5;
        x.light[5] = 9.0;
        x.light[6] = 9.0;
        x.light[7] = f32::NAN;
        let truth = Truth::new(&a, Some(&b)).unwrap();
        assert_eq!(truth.pixels(), PIXELS as usize - 2);
        let errors = truth.errors(&x.light);
        assert_eq!(errors.not_finite, 1);
        assert!((errors.bias - 0.1).abs() < 1e-6 && (errors.mse - 0.01).abs() < 1e-6, "{errors:?}");
        a.coverage.fill(0.0);
        assert!(Truth::new(&a, Some(&b)).is_none());
    }
}
