//! Complex numbers whose real and imaginary parts are of any scalar type.

use std::ops::{Add, Div, Mul, Sub};

use super::{Dual, PointScalar, Scalar};

/// Complex number re + i im.
#[derive(Debug, Clone, Copy)]
pub struct Complex<N> {
    /// Real part.
    pub re: N,
    /// Imaginary part.
    pub im: N,
}

impl<N: Scalar> Complex<N> {
    /// Number with constant real and imaginary parts (derivative 0).
    pub fn constant(re: f64, im: f64) -> Self {
        Self { re: N::constant(re), im: N::constant(im) }
    }

    /// Multiplies by a real number.
    #[inline(always)]
    pub fn times(self, factor: N) -> Self {
        Self { re: self.re * factor, im: self.im * factor }
    }

    /// Returns the reciprocal 1/z of this number z.
    pub fn reciprocal(self) -> Self {
        let square = self.re * self.re + self.im * self.im;
        Self { re: self.re / square, im: -self.im / square }
    }
}

impl<N: PointScalar> Complex<N> {
    /// Returns the exponential eᶻ of this number z.
    pub fn exp(self) -> Self {
        let (size, sin, cos) = (self.re.exp(), self.im.sin(), self.im.cos());
        Self { re: size * cos, im: size * sin }
    }
}

impl<N: Scalar> Add for Complex<N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }
}

impl<N: Scalar> Sub for Complex<N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { re: self.re - other.re, im: self.im - other.im }
    }
}

impl<N: Scalar> Mul for Complex<N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }
}

impl<N: Scalar> Mul<f64> for Complex<N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: f64) -> Self {
        self.times(N::constant(other))
    }
}

impl Mul<Dual> for Complex<Dual> {
    type Output = Self;
    fn mul(self, factor: Dual) -> Self {
        self.times(factor)
    }
}

impl<N: Scalar> Div for Complex<N> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let norm = other.re * other.re + other.im * other.im;
        let product = self * Self { re: other.re, im: -other.im };
        Self { re: product.re / norm, im: product.im / norm }
    }
}
