//! f64 values that carry how far off the f32 computation of them may be: the rules of the parent module.

use std::ops::{Add, Mul, Sub};

/// Unit roundoff of f32.
pub const E: f64 = 1.0 / 16_777_216.0;
/// For the errors of f64.
pub const SPARE: f64 = 1.001;
/// Smallest normal f32: what a product may lose to underflow.
pub const TINY: f64 = f32::MIN_POSITIVE as f64;

/// A value, and how far off the f32 one may be.
#[derive(Clone, Copy)]
pub struct Bounded {
    pub value: f64,
    pub error: f64,
}

impl Bounded {
    pub fn exact(value: f32) -> Self {
        Self { value: f64::from(value), error: 0.0 }
    }

    /// Whether it is zero in f32 too.
    pub fn is_zero(self) -> bool {
        self.value == 0.0 && self.error == 0.0
    }

    /// By 1 or -1.
    pub fn times(self, sign: f64) -> Self {
        Self { value: self.value * sign, ..self }
    }

    /// How far off the f32 quotient by the absolute value of `det` may be, whose own rounding is `more` of it. `det` is further
    /// from zero than its error.
    pub fn quotient_error(self, det: Self, more: f64) -> f64 {
        let size = det.value.abs();
        let quotient = self.value.abs() / size;
        SPARE * ((self.error + quotient * det.error) / (size - det.error) + more * quotient + TINY)
    }

    /// Distance above zero in units of the error; `at_zero` where it is zero for certain.
    pub fn margin(self, at_zero: f64) -> f64 {
        if self.is_zero() { at_zero } else { self.value / self.error }
    }
}

impl Mul for Bounded {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        if self.is_zero() || other.is_zero() {
            return Self::exact(0.0);
        }
        let value = self.value * other.value;
        let before =
            self.value.abs() * other.error + other.value.abs() * self.error + self.error * other.error;
        Self { value, error: before + E * (value.abs() + before) + TINY }
    }
}

impl Add for Bounded {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        if self.is_zero() || other.is_zero() {
            return if self.is_zero() { other } else { self };
        }
        let value = self.value + other.value;
        let before = self.error + other.error;
        Self { value, error: before + E * (value.abs() + before) }
    }
}

impl Sub for Bounded {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + Self { value: -other.value, ..other }
    }
}

pub type Vector = [Bounded; 3];

pub fn dot(a: Vector, b: Vector) -> Bounded {
    let sum = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    Bounded { error: SPARE * sum.error, ..sum }
}

pub fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Largest absolute value of a component.
pub fn largest(v: Vector) -> f64 {
    v.map(|component| component.value.abs()).into_iter().fold(0.0, f64::max)
}
