//! Exponentials and logarithms of slices of numbers, by vector instructions.
//!
//! The code has no branches and no fused multiply-add. The result for a number therefore depends neither on the other numbers of the slice
//! nor on the processor. Errors are below two units in the last place.

use pulp::{Arch, Simd, WithSimd};

/// Number 1.5·2⁵². Its sum with a small number x holds x, rounded to an integer, in the lowest bits.
const ROUNDING: f64 = 6_755_399_441_055_744.0;
/// ln 2 as the sum of `LN_2_HIGH` and `LN_2_LOW`. The last bits of `LN_2_HIGH` are zero, so its product with a small integer is exact.
const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
const EXPONENT_BIAS: u64 = 1023;
const MANTISSA_BITS: u32 = 52;
/// Bounds of x within which eˣ is a normal floating-point number.
const LARGEST_EXPONENT: f64 = 709.0;
const SMALLEST_EXPONENT: f64 = -708.0;
/// Factor 2⁵⁴, which turns every subnormal number into a normal number.
const SCALE_OF_SUBNORMAL: f64 = 18_014_398_509_481_984.0;
const BITS_OF_SCALE: f64 = 54.0;

/// Replaces every x by eˣ. The result is 0 for x < −708 and +∞ for x > 709.
pub fn exp_all(values: &mut [f64]) {
    Arch::new().dispatch(ExpAll(values));
}

/// Replaces every x by ln x. The result is −∞ at 0 and NaN for negative x.
pub fn ln_all(values: &mut [f64]) {
    Arch::new().dispatch(LnAll(values));
}

struct ExpAll<'a>(&'a mut [f64]);

impl WithSimd for ExpAll<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        for x in self.0 {
            *x = exp(*x);
        }
    }
}

struct LnAll<'a>(&'a mut [f64]);

impl WithSimd for LnAll<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        for x in self.0 {
            *x = ln(*x);
        }
    }
}

/// Replaces every x by eˣ − 1, accurate near 0. The result is −1 for x < −708 and +∞ for x > 709.
pub fn exp_m1_all(values: &mut [f64]) {
    Arch::new().dispatch(ExpM1All(values));
}

struct ExpM1All<'a>(&'a mut [f64]);

impl WithSimd for ExpM1All<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        for x in self.0 {
            let (scale, grown) = parts(*x);
            let value = scale * grown + (scale - 1.0);
            *x = if *x > LARGEST_EXPONENT { f64::INFINITY } else { value };
        }
    }
}

/// Returns eˣ for one number, with bits equal to those of [`exp_all`].
#[inline(always)]
pub fn exp(x: f64) -> f64 {
    let (scale, grown) = parts(x);
    let value = scale + scale * grown;
    let value = if x > LARGEST_EXPONENT { f64::INFINITY } else { value };
    if x < SMALLEST_EXPONENT { 0.0 } else { value }
}

/// Returns 2ᵏ and eʳ − 1, where eˣ = 2ᵏ eʳ with an integer k and |r| ≤ ln 2/2.
#[inline(always)]
fn parts(x: f64) -> (f64, f64) {
    let inside = if x > LARGEST_EXPONENT { LARGEST_EXPONENT } else { x };
    let inside = if inside < SMALLEST_EXPONENT { SMALLEST_EXPONENT } else { inside };
    let rounded = inside * std::f64::consts::LOG2_E + ROUNDING;
    let k = rounded - ROUNDING;
    let r = (inside - k * LN_2_HIGH) - k * LN_2_LOW;
    // (eʳ − 1 − r)/r² = Σ rⁿ/(n+2)!; the first omitted term is below 1e-17.
    let mut sum = 1.0 / 6_227_020_800.0;
    let mut coefficient = 1.0 / 6_227_020_800.0;
    let mut factorial_ratio = 13.0;
    for _ in 0..11 {
        coefficient *= factorial_ratio;
        factorial_ratio -= 1.0;
        sum = sum * r + coefficient;
    }
    let scale = f64::from_bits(rounded.to_bits().wrapping_add(EXPONENT_BIAS) << MANTISSA_BITS);
    (scale, r + r * r * sum)
}

/// Returns ln x = e ln 2 + 2 artanh s. Here x = 2ᵉ m with m between √½ and √2, and s = (m − 1)/(m + 1).
#[inline(always)]
pub fn ln(x: f64) -> f64 {
    let is_subnormal = x < f64::MIN_POSITIVE;
    let normal = if is_subnormal { x * SCALE_OF_SUBNORMAL } else { x };
    let bits = normal.to_bits();
    // Subtracting the bits of √½ moves the range of the mantissa m to [√½, √2], centred on 1.
    let shifted = bits.wrapping_sub(std::f64::consts::FRAC_1_SQRT_2.to_bits());
    let exponent_bits = ((shifted as i64) >> MANTISSA_BITS) as u64;
    let mantissa = f64::from_bits(bits.wrapping_sub(exponent_bits << MANTISSA_BITS));
    // Converts a small integer to a floating-point number without a conversion instruction, which vector units may lack.
    let exponent = f64::from_bits(ROUNDING.to_bits().wrapping_add(exponent_bits)) - ROUNDING;
    let exponent = if is_subnormal { exponent - BITS_OF_SCALE } else { exponent };
    let f = mantissa - 1.0;
    let s = f / (2.0 + f);
    let z = s * s;
    // Σ z^k/(2k+3); the first omitted term is below 1e-17 of the sum.
    let mut sum = 1.0 / 23.0;
    let mut odd = 23.0;
    for _ in 0..10 {
        odd -= 2.0;
        sum = sum * z + 1.0 / odd;
    }
    // 2 artanh s = f − s (f − 2 z Σ) with f = m − 1 and z = s². The leading term f is exact.
    let tail = s * (f - 2.0 * z * sum);
    let value = exponent * LN_2_HIGH + (f - (tail - exponent * LN_2_LOW));
    let value = if x == f64::INFINITY { f64::INFINITY } else { value };
    let value = if x == 0.0 { f64::NEG_INFINITY } else { value };
    if x < 0.0 || x.is_nan() { f64::NAN } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares exponentials and logarithms with the standard library, over numbers of all magnitudes and at the ends of the range.
    #[test]
    fn agree_with_the_standard_library() {
        let mut largest = [0.0_f64; 2];
        for i in 0..400_000 {
            let x = -700.0 + 1400.0 * f64::from(i) / 400_000.0;
            let small = 1e-3 * x;
            for x in [x, small] {
                largest[0] = largest[0].max((exp(x) / x.exp() - 1.0).abs());
            }
            for y in [x.exp(), small.exp(), 1.0 + 1e-9 * x] {
                let reference = y.ln();
                if reference != 0.0 {
                    largest[1] = largest[1].max((ln(y) / reference - 1.0).abs());
                }
            }
        }
        assert!(largest.iter().all(|error| *error < 5e-16), "{largest:?}");
        let mut lost = [-3e-9, -1e-4, -0.3, -0.4, -5.0, -800.0, 2.0];
        let expected = lost.map(f64::exp_m1);
        exp_m1_all(&mut lost);
        assert!(lost.iter().zip(expected).all(|(a, b)| (a / b - 1.0).abs() < 1e-15), "{lost:?}");
        assert_eq!([exp(0.0), exp(1e4), exp(-1e4), ln(1.0)], [1.0, f64::INFINITY, 0.0, 0.0]);
        assert!(exp(f64::NAN).is_nan() && ln(f64::NAN).is_nan() && ln(-1.0).is_nan());
        assert_eq!([ln(0.0), ln(f64::INFINITY)], [f64::NEG_INFINITY, f64::INFINITY]);
        assert!((ln(3e-310) / 3e-310_f64.ln() - 1.0).abs() < 1e-15);
    }

    /// The results for slices of any length equal those for single numbers to the last bit.
    #[test]
    fn slices_have_the_bits_of_single_numbers() {
        for n in [1, 3, 8, 17] {
            let values: Vec<f64> = (0..n).map(|i| 0.1 + 3.7 * f64::from(i)).collect();
            let (mut exponentials, mut logarithms) = (values.clone(), values.clone());
            exp_all(&mut exponentials);
            ln_all(&mut logarithms);
            for i in 0..values.len() {
                assert_eq!(exponentials[i].to_bits(), exp(values[i]).to_bits());
                assert_eq!(logarithms[i].to_bits(), ln(values[i]).to_bits());
            }
        }
    }
}
