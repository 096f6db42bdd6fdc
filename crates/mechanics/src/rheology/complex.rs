//! Complex numbers that carry a derivative.

use std::ops::{Add, Mul, Sub};

use crate::number::{Dual, Scalar};

/// re + i im.
#[derive(Debug, Clone, Copy)]
pub(super) struct ComplexDual {
    pub re: Dual,
    pub im: Dual,
}

impl ComplexDual {
    pub(super) const fn constant(re: f64, im: f64) -> Self {
        Self { re: Dual::constant(re), im: Dual::constant(im) }
    }

    pub(super) fn reciprocal(self) -> Self {
        let square = self.re * self.re + self.im * self.im;
        Self { re: self.re / square, im: -self.im / square }
    }

    pub(super) fn exp(self) -> Self {
        let size = self.re.exp();
        Self { re: size * self.im.cos(), im: size * self.im.sin() }
    }
}

impl Add for ComplexDual {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }
}

impl Sub for ComplexDual {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { re: self.re - other.re, im: self.im - other.im }
    }
}

impl Mul for ComplexDual {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }
}

impl Mul<Dual> for ComplexDual {
    type Output = Self;
    fn mul(self, factor: Dual) -> Self {
        Self { re: self.re * factor, im: self.im * factor }
    }
}
