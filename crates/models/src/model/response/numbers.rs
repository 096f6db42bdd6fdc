//! Number types of the kernel in addition to [`Scalar`]: eight parameter points at once, the number of one point, and complex numbers.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

use base::error::Result;
use base::number::{Complex, Dual, PointScalar, Scalar};
use laws::stages::{FieldStepper, Stages};
use record::Force;

/// Number of parameter points that are computed at once.
pub const N_LANES: usize = 8;

/// Values of one number at [`N_LANES`] parameter points.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub struct Lanes(pub [f64; N_LANES]);

impl std::borrow::Borrow<[f64; N_LANES]> for Lanes {
    fn borrow(&self) -> &[f64; N_LANES] {
        &self.0
    }
}

/// Number type of the kernel. It holds one [`Real`] number for each of one or several parameter points.
pub trait Number: Scalar {
    /// Number type of a single point.
    type Lane: Real;
    /// Number of points that the type holds.
    const N_POINTS: usize;
    /// Returns self · factor + addend, rounded once, with equal bits in every number type.
    fn mul_add(self, factor: Self, addend: Self) -> Self;
    /// Returns the number of the parameter point with the index `lane`.
    fn lane(self, lane: usize) -> Self::Lane;
    /// Sets the number of the parameter point with the index `lane`.
    fn set_lane(&mut self, lane: usize, value: Self::Lane);
    /// Returns e⁻ᶻ and its mean over [0, z], (1 − e⁻ᶻ)/z, for z = self of any sign.
    fn decay(self) -> (Self, Self);
    /// Returns ∫₀¹ e^{−a(1−s)} e^{−bs} ds for a = self and b = other. It does not overflow and stays accurate for a = b.
    fn overlap(self, other: Self) -> Self;
    /// Returns, for each point, `below` if |self| is less than `limit`, else `otherwise`.
    fn choose(self, limit: f64, below: Self, otherwise: Self) -> Self;
}

/// Number type of one parameter point, with or without a derivative.
pub(super) trait Real: PointScalar + Number<Lane = Self> + Field {
    /// Returns `true` if the values differ by less than `tolerance` and the derivatives are equal.
    fn is_close(self, other: Self, tolerance: f64) -> bool;
    /// `true` if the type carries a derivative.
    const CARRIES: bool;
    /// Converts the number to a [`Dual`]. The derivative is 0 if the type carries none.
    fn carried(self) -> Dual;
    /// Excess of a nonlinear law's position over that of the linear law, at every row, in m.
    fn excess_m(
        stepper: &dyn FieldStepper,
        stages: &Stages,
        compliance_per_m: Self,
        time_s: &[f64],
        force: Force<'_>,
    ) -> Result<Vec<Self>>;
}

/// Number type with the operations that real and complex numbers have in common.
pub(super) trait Field:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Mul<f64, Output = Self>
{
    /// Converts a real constant.
    fn real(value: f64) -> Self;
    /// Returns eᶻ for z = self.
    fn exponential(self) -> Self;
    /// Absolute value of a real number, or the larger absolute value of a complex number's two parts, without derivative.
    fn size(self) -> f64;
}

/// Builds a number of several parameter points. `of_lane` returns the number of the point with a given index.
pub(super) fn gather<S: Number>(mut of_lane: impl FnMut(usize) -> S::Lane) -> S {
    let mut number = S::constant(0.0);
    for lane in 0..S::N_POINTS {
        number.set_lane(lane, of_lane(lane));
    }
    number
}

impl Number for f64 {
    type Lane = Self;
    const N_POINTS: usize = 1;
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        f64::mul_add(self, factor, addend)
    }
    #[inline(always)]
    fn lane(self, _lane: usize) -> Self {
        self
    }
    #[inline(always)]
    fn set_lane(&mut self, _lane: usize, value: Self) {
        *self = value;
    }
    #[inline(always)]
    fn decay(self) -> (Self, Self) {
        plain_decay(self)
    }
    #[inline(always)]
    fn overlap(self, other: Self) -> Self {
        let smaller = if self < other { self } else { other };
        plain_decay(smaller).0 * plain_decay((self - other).abs()).1
    }
    #[inline(always)]
    fn choose(self, limit: f64, below: Self, otherwise: Self) -> Self {
        if self.abs() < limit { below } else { otherwise }
    }
}

/// Returns e⁻ᶻ and (1 − e⁻ᶻ)/z within a few roundings. The code has no branches, so that a loop over lanes becomes vector
/// instructions.
///
/// Let −z = k ln 2 + r with an integer k. Then e⁻ᶻ − 1 = 2ᵏ (eʳ − 1) + (2ᵏ − 1). Fused operations are avoided, so that all builds
/// give equal bits.
#[inline(always)]
fn plain_decay(z: f64) -> (f64, f64) {
    // Adding this constant to a number leaves the nearest integer in the last bits of the sum.
    const ROUNDING: f64 = 6_755_399_441_055_744.0;
    // ln 2 in two parts. The last bits of the first part are zeros, so that its product with k is exact.
    const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    const EXPONENT_BIAS: u64 = 1023;
    const MANTISSA_BITS: u32 = 52;
    // The argument is limited to the range in which e⁻ᶻ is a normal number. NaN stays NaN.
    let x = if z > 708.0 { -708.0 } else { -z };
    let x = if x > 709.0 { 709.0 } else { x };
    let rounded = x * std::f64::consts::LOG2_E + ROUNDING;
    let k = rounded - ROUNDING;
    let r = (x - k * LN_2_HIGH) - k * LN_2_LOW;
    // The series is (eʳ − 1 − r)/r² = Σ rⁿ/(n+2)!. Its first omitted term is below 1e-17 for |r| up to ln 2/2.
    let mut sum = 1.0 / 6_227_020_800.0;
    let mut factorial_ratio = 13.0;
    let mut coefficient = 1.0 / 6_227_020_800.0;
    for _ in 0..11 {
        coefficient *= factorial_ratio;
        factorial_ratio -= 1.0;
        sum = sum * r + coefficient;
    }
    let grown = r + r * r * sum;
    let scale = f64::from_bits(rounded.to_bits().wrapping_add(EXPONENT_BIAS) << MANTISSA_BITS);
    let lost = scale * grown + (scale - 1.0);
    (scale * grown + scale, if z == 0.0 { 1.0 } else { -lost / z })
}

impl Real for f64 {
    const CARRIES: bool = false;
    fn is_close(self, other: Self, tolerance: f64) -> bool {
        (self - other).abs() <= tolerance
    }
    fn carried(self) -> Dual {
        Dual::constant(self)
    }
    fn excess_m(
        stepper: &dyn FieldStepper,
        stages: &Stages,
        compliance_per_m: Self,
        time_s: &[f64],
        force: Force<'_>,
    ) -> Result<Vec<Self>> {
        stepper.excess_m(stages, compliance_per_m, time_s, force)
    }
}

impl Field for f64 {
    fn real(value: f64) -> Self {
        value
    }
    fn exponential(self) -> Self {
        self.exp()
    }
    fn size(self) -> f64 {
        self.abs()
    }
}

impl Number for Dual {
    type Lane = Self;
    const N_POINTS: usize = 1;
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        Self {
            value: f64::mul_add(self.value, factor.value, addend.value),
            derivative: f64::mul_add(
                self.value,
                factor.derivative,
                f64::mul_add(self.derivative, factor.value, addend.derivative),
            ),
        }
    }
    #[inline(always)]
    fn lane(self, _lane: usize) -> Self {
        self
    }
    #[inline(always)]
    fn set_lane(&mut self, _lane: usize, value: Self) {
        *self = value;
    }
    fn decay(self) -> (Self, Self) {
        let z = self.value;
        let (left, mean) = z.decay();
        let slope = if z.abs() < SERIES_BELOW {
            // The derivative is −Σ (k+1)(−z)ᵏ/(k+2)!, summed by Horner's scheme. The first omitted term is below 1e-17.
            let (mut sum, mut factorial) = (0.0, 1_307_674_368_000.0);
            for k in (0..14).rev() {
                sum = sum * -z + f64::from(k + 1) / factorial;
                factorial /= f64::from(k + 2);
            }
            -sum
        } else {
            (left - mean) / z
        };
        (
            Self { value: left, derivative: -left * self.derivative },
            Self { value: mean, derivative: slope * self.derivative },
        )
    }
    fn overlap(self, other: Self) -> Self {
        let (smaller, difference) = if self.value < other.value { (self, other - self) } else { (other, self - other) };
        smaller.decay().0 * difference.decay().1
    }
    #[inline(always)]
    fn choose(self, limit: f64, below: Self, otherwise: Self) -> Self {
        if self.value.abs() < limit { below } else { otherwise }
    }
}

/// Size of z below which the series of (1 − e⁻ᶻ)/z is differentiated term by term. The closed form of the derivative loses digits
/// there.
const SERIES_BELOW: f64 = 0.5;

impl Real for Dual {
    const CARRIES: bool = true;
    fn is_close(self, other: Self, tolerance: f64) -> bool {
        (self.value - other.value).abs() <= tolerance && self.derivative == other.derivative
    }
    fn carried(self) -> Dual {
        self
    }
    fn excess_m(
        stepper: &dyn FieldStepper,
        stages: &Stages,
        compliance_per_m: Self,
        time_s: &[f64],
        force: Force<'_>,
    ) -> Result<Vec<Self>> {
        stepper.excess_dual_m(stages, compliance_per_m.value, time_s, force)
    }
}

impl Field for Dual {
    fn real(value: f64) -> Self {
        Self::constant(value)
    }
    fn exponential(self) -> Self {
        self.exp()
    }
    fn size(self) -> f64 {
        self.value.abs()
    }
}

base::elementwise!(Lanes, Add add + Sub sub - Mul mul * Div div /);

/// Lanes from a function of a lane's index. Unlike `std::array::from_fn`, the loop becomes part of the calling vector code.
#[inline(always)]
fn each(of_lane: impl Fn(usize) -> f64) -> Lanes {
    let mut lanes = Lanes([0.0; N_LANES]);
    for lane in 0..N_LANES {
        lanes.0[lane] = of_lane(lane);
    }
    lanes
}

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        each(|lane| -self.0[lane])
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Mul<f64> for Lanes {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: f64) -> Self {
        self * Self([other; N_LANES])
    }
}

impl Scalar for Lanes {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self([value; N_LANES])
    }
    #[inline(always)]
    fn exp(self) -> Self {
        each(|lane| self.0[lane].exp())
    }
    #[inline(always)]
    fn exp_m1(self) -> Self {
        each(|lane| self.0[lane].exp_m1())
    }
}

impl Number for Lanes {
    type Lane = f64;
    const N_POINTS: usize = N_LANES;
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        each(|lane| self.0[lane].mul_add(factor.0[lane], addend.0[lane]))
    }
    #[inline(always)]
    fn lane(self, lane: usize) -> f64 {
        self.0[lane]
    }
    #[inline(always)]
    fn set_lane(&mut self, lane: usize, value: f64) {
        self.0[lane] = value;
    }
    #[inline(always)]
    fn decay(self) -> (Self, Self) {
        let (mut left, mut mean) = (self, self);
        for lane in 0..N_LANES {
            (left.0[lane], mean.0[lane]) = plain_decay(self.0[lane]);
        }
        (left, mean)
    }
    #[inline(always)]
    fn overlap(self, other: Self) -> Self {
        each(|lane| self.0[lane].overlap(other.0[lane]))
    }
    #[inline(always)]
    fn choose(self, limit: f64, below: Self, otherwise: Self) -> Self {
        each(|lane| if self.0[lane].abs() < limit { below.0[lane] } else { otherwise.0[lane] })
    }
}

/// Complex number at several parameter points. The number of each point can be read and set.
pub(super) trait ComplexLanes<L> {
    /// Number of the parameter point with the index `lane`.
    fn lane(self, lane: usize) -> Complex<L>;
    /// Replaces the number of the parameter point with the index `lane`.
    fn set_lane(&mut self, lane: usize, value: Complex<L>);
}

impl<N: Number> ComplexLanes<N::Lane> for Complex<N> {
    fn lane(self, lane: usize) -> Complex<N::Lane> {
        Complex { re: self.re.lane(lane), im: self.im.lane(lane) }
    }
    fn set_lane(&mut self, lane: usize, value: Complex<N::Lane>) {
        self.re.set_lane(lane, value.re);
        self.im.set_lane(lane, value.im);
    }
}

impl<N: Real> Field for Complex<N> {
    fn real(value: f64) -> Self {
        Self::constant(value, 0.0)
    }
    fn exponential(self) -> Self {
        self.exp()
    }
    fn size(self) -> f64 {
        self.re.value().abs().max(self.im.value().abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks decays against the standard library's functions, from the smallest arguments to full decay.
    #[test]
    fn decays_are_those_of_the_standard_library() {
        for i in -300..=960 {
            let z = 10.0_f64.powf(0.003 * f64::from(i) * f64::from(if i < 0 { 5 } else { 1 }));
            let (left, mean) = z.decay();
            assert!((left / (-z).exp() - 1.0).abs() < 1e-13 || z > 700.0, "{z}: {left}");
            assert!((mean * z / -(-z).exp_m1() - 1.0).abs() < 1e-15, "{z}: {mean}");
        }
        assert_eq!(0.0.decay(), (1.0, 1.0));
        for z in [-1e-9, -0.3, -0.6, -2.0, -40.0, -700.0] {
            let (grown, mean) = z.decay();
            assert!((grown / (-z).exp() - 1.0).abs() < 1e-13 && (mean * z / -(-z).exp_m1() - 1.0).abs() < 1e-13, "{z}");
            // The reference is d/dz of the mean by a central difference, whose own error is below 1e-9.
            let h = 1e-6 * z.abs().min(40.0);
            let difference = ((z + h).decay().1 - (z - h).decay().1) / (2.0 * h);
            let found = Dual::variable(z).decay().1.derivative;
            assert!(z > -1e-3 || (found / difference - 1.0).abs() < 1e-8, "{z}: {found} {difference}");
        }
        assert!((-1e9).decay().0 > 1e300);
        let (left, mean) = 1e9.decay();
        assert!(left < 1e-300 && (mean * 1e9 - 1.0).abs() < 1e-15);
        assert!(f64::NAN.decay().1.is_nan());
    }
}
