//! Blocks of numbers at eight cubature points, either plain or with a derivative.
//!
//! The compiler converts loops over the eight lanes into vector instructions if the processor has them (see
//! [`pulp::Arch::dispatch`] in the stepper).

use base::number::Dual;
use elements::fe::nonlinear::point::Number;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Number of points in a block.
pub(super) const N_LANES: usize = 8;

/// Number type of the kernel, with one number for each point of a block.
pub(super) trait LaneBlock:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Mul<Plain, Output = Self>
{
    /// Number type that all points of a block share.
    type Scalar: Number;
    /// Returns a block with this number at all points.
    fn splat(value: Self::Scalar) -> Self;
    /// Returns a block of constants without derivatives.
    fn constant(values: Plain) -> Self;
    /// Returns the values without derivatives.
    fn values(self) -> Plain;
    /// Returns √x for x > 0.
    fn sqrt(self) -> Self;
    /// Returns eˣ.
    fn exp(self) -> Self;
    /// Returns ln x for x > 0.
    fn ln(self) -> Self;
    /// Returns, for each point, `above` if `sign` is positive, else `below`.
    fn choose(sign: Self, above: Self, below: Self) -> Self;
    /// Returns the sum over the points.
    fn sum(self) -> Self::Scalar;
}

/// Eight numbers, one for each point of a block.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub(super) struct Plain(pub [f64; N_LANES]);

base::elementwise!(Plain, Add add + Sub sub - Mul mul * Div div /);

/// Applies a function to every lane. Unlike `array::map`, the loop becomes part of the calling vector code.
#[inline(always)]
fn each(x: Plain, function: impl Fn(f64) -> f64) -> Plain {
    let mut result = x;
    for l in 0..N_LANES {
        result.0[l] = function(x.0[l]);
    }
    result
}

impl Neg for Plain {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        each(self, |x| -x)
    }
}

impl Plain {
    /// Returns `true` if the absolute value of every lane is at most the limit of this lane.
    #[inline(always)]
    pub(super) fn is_within(self, limit: Self) -> bool {
        let mut beyond = 0_u64;
        for l in 0..N_LANES {
            beyond |= u64::from(self.0[l].abs() > limit.0[l]);
        }
        beyond == 0
    }

    /// Returns the largest absolute value.
    #[inline(always)]
    pub(super) fn largest(self) -> f64 {
        let mut most = 0.0;
        for l in 0..N_LANES {
            most = if self.0[l].abs() > most { self.0[l].abs() } else { most };
        }
        most
    }
}

const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
/// Constant 1.5·2⁵². Its sum with a small number holds this number, rounded to an integer, in the low bits.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

/// Returns eˣ to a few units of rounding. It uses eˣ = 2ᵏ eʳ with |r| ≤ ½ ln 2, and Taylor's polynomial of degree 13 for eʳ.
#[inline(always)]
fn exp(x: f64) -> f64 {
    let x = if x > 700.0 { 700.0 } else { x };
    let x = if x < -700.0 { -700.0 } else { x };
    let shifted = x * std::f64::consts::LOG2_E + ROUNDER;
    let k = shifted - ROUNDER;
    let r = (x - k * LN_2_HIGH) - k * LN_2_LOW;
    let mut sum = 1.0 / 6_227_020_800.0;
    for inverse in EXP_COEFFICIENTS {
        sum = sum * r + inverse;
    }
    let exponent = shifted.to_bits().wrapping_add(1023) << 52;
    sum * f64::from_bits(exponent)
}

/// Coefficients 1/12!, …, 1/1!, 1 of Taylor's polynomial of eʳ, highest power first.
const EXP_COEFFICIENTS: [f64; 13] = [
    1.0 / 479_001_600.0,
    1.0 / 39_916_800.0,
    1.0 / 3_628_800.0,
    1.0 / 362_880.0,
    1.0 / 40_320.0,
    1.0 / 5040.0,
    1.0 / 720.0,
    1.0 / 120.0,
    1.0 / 24.0,
    1.0 / 6.0,
    0.5,
    1.0,
    1.0,
];

/// Returns ln x for normal x > 0. It uses x = 2ᵏ m with √½ < m ≤ √2, and the series of ln m = 2 artanh((m − 1)/(m + 1)).
#[inline(always)]
fn ln(x: f64) -> f64 {
    let bits = x.to_bits();
    // The constant holds the bits of √½, so that mantissas above √2 move to the next power.
    let shifted = bits.wrapping_sub(0x3fe6_a09e_667f_3bcd);
    let exponent = (shifted as i64) >> 52;
    let m = f64::from_bits(bits.wrapping_sub((exponent as u64) << 52));
    // A small integer is converted to a floating-point number without a conversion instruction.
    let k = f64::from_bits((exponent as u64).wrapping_add(ROUNDER.to_bits())) - ROUNDER;
    let z = (m - 1.0) / (m + 1.0);
    let squared = z * z;
    let mut sum = 1.0 / 21.0;
    for inverse in [19.0, 17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0] {
        sum = sum * squared + 1.0 / inverse;
    }
    (k * LN_2_HIGH + 2.0 * z) + (2.0 * z * squared * sum + k * LN_2_LOW)
}

impl LaneBlock for Plain {
    type Scalar = f64;
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self([value; N_LANES])
    }
    #[inline(always)]
    fn constant(values: Plain) -> Self {
        values
    }
    #[inline(always)]
    fn values(self) -> Plain {
        self
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        each(self, f64::sqrt)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        each(self, exp)
    }
    #[inline(always)]
    fn ln(self) -> Self {
        each(self, ln)
    }
    #[inline(always)]
    fn choose(sign: Self, above: Self, below: Self) -> Self {
        let mut result = below;
        for l in 0..N_LANES {
            result.0[l] = if sign.0[l] > 0.0 { above.0[l] } else { below.0[l] };
        }
        result
    }
    #[inline(always)]
    fn sum(self) -> f64 {
        let x = self.0;
        ((x[0] + x[4]) + (x[1] + x[5])) + ((x[2] + x[6]) + (x[3] + x[7]))
    }
}

/// Eight numbers with derivatives, one for each point of a block.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DualLanes {
    value: Plain,
    derivative: Plain,
}

base::dual_operators!(DualLanes, Plain);

impl LaneBlock for DualLanes {
    type Scalar = Dual;
    #[inline(always)]
    fn splat(value: Dual) -> Self {
        Self { value: Plain([value.value; N_LANES]), derivative: Plain([value.derivative; N_LANES]) }
    }
    #[inline(always)]
    fn constant(values: Plain) -> Self {
        Self { value: values, derivative: Plain([0.0; N_LANES]) }
    }
    #[inline(always)]
    fn values(self) -> Plain {
        self.value
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = LaneBlock::sqrt(self.value);
        Self { value: root, derivative: self.derivative / (root + root) }
    }
    #[inline(always)]
    fn exp(self) -> Self {
        let value = LaneBlock::exp(self.value);
        Self { value, derivative: value * self.derivative }
    }
    #[inline(always)]
    fn ln(self) -> Self {
        Self { value: LaneBlock::ln(self.value), derivative: self.derivative / self.value }
    }
    #[inline(always)]
    fn choose(sign: Self, above: Self, below: Self) -> Self {
        Self {
            value: Plain::choose(sign.value, above.value, below.value),
            derivative: Plain::choose(sign.value, above.derivative, below.derivative),
        }
    }
    #[inline(always)]
    fn sum(self) -> Dual {
        Dual { value: self.value.sum(), derivative: self.derivative.sum() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponentials_and_logarithms_are_those_of_the_standard_library() {
        for i in -3000..3000 {
            let x = 0.11 * f64::from(i);
            assert!((exp(x) / x.exp() - 1.0).abs() < 1e-15 * (2.0 + x.abs()), "{x}");
            let y = x.exp();
            assert!((ln(y) - y.ln()).abs() < 4e-16 * (1.0 + x.abs()), "{x}");
        }
        assert!((ln(1.0), exp(0.0)) == (0.0, 1.0));
        assert!((ln(1.0 + 1e-9) / 1e-9_f64.ln_1p() - 1.0).abs() < 1e-6);
    }

    /// Compares every operation with [`Dual`], lane by lane.
    #[test]
    fn derivatives_are_those_of_dual_numbers() {
        let x = Dual { value: 0.7, derivative: 1.3 };
        let y = Dual { value: 2.1, derivative: -0.4 };
        let (a, b) = (DualLanes::splat(x), DualLanes::splat(y));
        let function = (a * b - a / b + (-b).exp() * Plain([3.0; N_LANES])).sqrt() + a.ln();
        let exact = (x * y - x / y + base::number::Scalar::exp(-y) * 3.0).sqrt() + x.ln();
        let found = function.sum();
        assert!((found.value - 8.0 * exact.value).abs() < 1e-13);
        assert!((found.derivative - 8.0 * exact.derivative).abs() < 1e-13);
        let DualLanes { value, derivative } = function;
        assert!(value.0.iter().all(|v| *v == value.0[0]) && derivative.0.iter().all(|d| *d == derivative.0[0]));
        assert_eq!(Plain([-3.0, 0.0, 1.0, 2.0, 0.0, 0.0, 0.0, 0.0]).largest(), 3.0);
    }
}
