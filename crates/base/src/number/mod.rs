//! Number types of the numerical kernels: plain `f64`, and [`Dual`] numbers that carry a derivative.
//!
//! A model computes the stages of its response (force, mechanics, observation) in [`Dual`] numbers. The kernel that turns stages into a
//! trajectory is generic over [`Scalar`]. On `f64` it yields the trajectory. On [`Dual`] it also yields the exact derivative in one
//! direction (forward mode).

mod complex;

pub use complex::Complex;

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// Number type with the operations that a kernel needs.
pub trait Scalar:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + Mul<f64, Output = Self>
{
    /// Number with this value and a derivative of 0.
    fn constant(value: f64) -> Self;
    /// Returns eˣ.
    fn exp(self) -> Self;
    /// Returns eˣ − 1, accurate near 0.
    fn exp_m1(self) -> Self;
}

/// Number type with the further operations that are needed to compute a law's spectrum at one point.
pub trait PointScalar: Scalar {
    /// Converts a dual number to this type. For `f64` the derivative is dropped.
    fn from_dual(number: Dual) -> Self;
    /// Value without the derivative, for comparisons.
    fn value(self) -> f64;
    /// Returns `true` if the number equals `value` and its derivative is 0.
    fn is_constant(self, value: f64) -> bool;
    /// Returns sin x.
    fn sin(self) -> Self;
    /// Returns cos x.
    fn cos(self) -> Self;
    /// Returns xʸ for x > 0.
    fn pow(self, exponent: Self) -> Self;
    /// Returns √x.
    fn sqrt(self) -> Self;
}

/// Number that carries its derivative in one direction.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Dual {
    /// Value of the number.
    pub value: f64,
    /// Derivative of the value in the chosen direction.
    pub derivative: f64,
}

impl Dual {
    /// Constant 0.
    pub const ZERO: Self = Self::constant(0.0);
    /// Constant 1.
    pub const ONE: Self = Self::constant(1.0);

    /// Number with derivative 0.
    pub const fn constant(value: f64) -> Self {
        Self { value, derivative: 0.0 }
    }

    /// Number with derivative 1. Derivatives of later results are taken with respect to this number.
    pub const fn variable(value: f64) -> Self {
        Self { value, derivative: 1.0 }
    }

    /// Applies the chain rule: returns f(x) with its derivative, from `value` = f(x) and `slope` = f′(x) at this number x.
    fn chain(self, value: f64, slope: f64) -> Self {
        Self { value, derivative: slope * self.derivative }
    }

    /// Returns `true` if the number equals `value` and its derivative is 0.
    pub fn is_constant(self, value: f64) -> bool {
        self.value == value && self.derivative == 0.0
    }

    /// Returns ln x.
    pub fn ln(self) -> Self {
        self.chain(self.value.ln(), 1.0 / self.value)
    }

    /// Returns √x.
    pub fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.chain(root, 0.5 / root)
    }

    /// Returns sin x.
    pub fn sin(self) -> Self {
        self.chain(self.value.sin(), self.value.cos())
    }

    /// Returns cos x.
    pub fn cos(self) -> Self {
        self.chain(self.value.cos(), -self.value.sin())
    }

    /// Returns xʸ for x > 0.
    pub fn pow(self, exponent: Self) -> Self {
        let value = self.value.powf(exponent.value);
        let derivative =
            value * (exponent.derivative * self.value.ln() + exponent.value * self.derivative / self.value);
        Self { value, derivative }
    }
}

impl From<f64> for Dual {
    fn from(value: f64) -> Self {
        Self::constant(value)
    }
}

/// Implements the operators of a number with its derivative, a struct with the fields `value` and `derivative` of the type `$Part`.
#[macro_export]
macro_rules! dual_operators {
    ($Dual:ident, $Part:ty) => {
        impl std::ops::Add for $Dual {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                Self { value: self.value + other.value, derivative: self.derivative + other.derivative }
            }
        }

        impl std::ops::Sub for $Dual {
            type Output = Self;
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                Self { value: self.value - other.value, derivative: self.derivative - other.derivative }
            }
        }

        impl std::ops::Mul for $Dual {
            type Output = Self;
            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                Self {
                    value: self.value * other.value,
                    derivative: self.derivative * other.value + self.value * other.derivative,
                }
            }
        }

        impl std::ops::Div for $Dual {
            type Output = Self;
            #[inline(always)]
            fn div(self, other: Self) -> Self {
                let value = self.value / other.value;
                Self { value, derivative: (self.derivative - value * other.derivative) / other.value }
            }
        }

        impl std::ops::Neg for $Dual {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self { value: -self.value, derivative: -self.derivative }
            }
        }

        impl std::ops::Mul<$Part> for $Dual {
            type Output = Self;
            #[inline(always)]
            fn mul(self, other: $Part) -> Self {
                Self { value: self.value * other, derivative: self.derivative * other }
            }
        }
    };
}

dual_operators!(Dual, f64);

/// Implements operators of a struct around an array as loops over its lanes. The loops become vector instructions if the caller is compiled for them.
#[macro_export]
macro_rules! elementwise {
    ($Lanes:ident, $($Trait:ident $method:ident $operator:tt)*) => {
        $(impl std::ops::$Trait for $Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                let mut result = self;
                for lane in 0..self.0.len() {
                    result.0[lane] = self.0[lane] $operator other.0[lane];
                }
                result
            }
        })*
    };
}

impl AddAssign for Dual {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Add<f64> for Dual {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: f64) -> Self {
        Self { value: self.value + other, ..self }
    }
}

impl Sub<f64> for Dual {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: f64) -> Self {
        Self { value: self.value - other, ..self }
    }
}

impl Scalar for f64 {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn exp(self) -> Self {
        f64::exp(self)
    }
    #[inline(always)]
    fn exp_m1(self) -> Self {
        f64::exp_m1(self)
    }
}

impl Scalar for Dual {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self::constant(value)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        let value = self.value.exp();
        self.chain(value, value)
    }
    #[inline(always)]
    fn exp_m1(self) -> Self {
        self.chain(self.value.exp_m1(), self.value.exp())
    }
}

impl PointScalar for f64 {
    #[inline(always)]
    fn from_dual(number: Dual) -> Self {
        number.value
    }
    #[inline(always)]
    fn value(self) -> f64 {
        self
    }
    #[inline(always)]
    fn is_constant(self, value: f64) -> bool {
        self == value
    }
    fn sin(self) -> Self {
        f64::sin(self)
    }
    fn cos(self) -> Self {
        f64::cos(self)
    }
    fn pow(self, exponent: Self) -> Self {
        self.powf(exponent)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
}

impl PointScalar for Dual {
    #[inline(always)]
    fn from_dual(number: Dual) -> Self {
        number
    }
    #[inline(always)]
    fn value(self) -> f64 {
        self.value
    }
    #[inline(always)]
    fn is_constant(self, value: f64) -> bool {
        Dual::is_constant(self, value)
    }
    fn sin(self) -> Self {
        Dual::sin(self)
    }
    fn cos(self) -> Self {
        Dual::cos(self)
    }
    fn pow(self, exponent: Self) -> Self {
        Dual::pow(self, exponent)
    }
    fn sqrt(self) -> Self {
        Dual::sqrt(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares every operation with a central difference, whose error is about 1e-10.
    #[test]
    fn derivatives_equal_central_differences() {
        let function = |x: Dual| {
            let a = (x * x + 0.3).sqrt().sin() / (x.exp() - x.ln()) + x.pow(x * 0.5) - x.exp_m1();
            -a * 2.0 + (x - 0.1).cos() + Dual::constant(2.0).pow(x)
        };
        for x in [0.4, 1.3, 2.0] {
            let h = 1e-5;
            let at = |x: f64| function(Dual::constant(x)).value;
            let difference = (at(x + h) - at(x - h)) / (2.0 * h);
            let found = function(Dual::variable(x));
            assert!((found.derivative - difference).abs() < 1e-8, "{x}: {} {difference}", found.derivative);
            assert_eq!(found.value, at(x));
        }
    }

    #[test]
    fn a_moving_zero_is_not_the_constant_zero() {
        assert!(Dual::ZERO.is_constant(0.0));
        assert!(!Dual::variable(0.0).is_constant(0.0));
    }
}
