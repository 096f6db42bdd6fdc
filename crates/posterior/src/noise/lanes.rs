//! Arithmetic on the processor's vector registers, with one parameter point per lane.

use std::ops::{Add, Div, Mul, Sub};

use pulp::Simd;

/// Number of parameter points that one pass over the rows evaluates, which is the number of f64 values in the widest register.
pub const LANES: usize = 8;

/// Vector register of f64 values. All its functions are inlined, because separate functions would be compiled without vector instructions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Register<S: Simd> {
    simd: S,
    value: S::f64s,
}

impl<S: Simd> Register<S> {
    /// Register with the value `number` in every lane.
    #[inline(always)]
    pub fn splat(simd: S, number: f64) -> Self {
        Self { simd, value: simd.splat_f64s(number) }
    }

    /// Register of this type with 0 in every lane.
    #[inline(always)]
    pub fn zero(self) -> Self {
        Self::splat(self.simd, 0.0)
    }

    /// Loads the register with number `index` from an array of lanes.
    #[inline(always)]
    pub fn load<const W: usize>(simd: S, lanes: &[f64; W], index: usize) -> Self {
        Self { simd, value: S::as_simd_f64s(&lanes[..]).0[index] }
    }

    /// Stores the register as number `index` of an array of lanes.
    #[inline(always)]
    pub fn store<const W: usize>(self, lanes: &mut [f64; W], index: usize) {
        S::as_mut_simd_f64s(&mut lanes[..]).0[index] = self.value;
    }

    /// Returns self × factor + term, rounded once if the processor has this instruction.
    #[inline(always)]
    pub fn mul_add(self, factor: Self, term: Self) -> Self {
        Self { value: self.simd.mul_add_e_f64s(self.value, factor.value, term.value), ..self }
    }

    /// Returns `above` in lanes with self > limit, and `otherwise` in all other lanes.
    #[inline(always)]
    pub fn if_above(self, limit: Self, above: Self, otherwise: Self) -> Self {
        let mask = self.simd.greater_than_f64s(self.value, limit.value);
        Self { value: self.simd.select_f64s(mask, above.value, otherwise.value), ..self }
    }
}

/// Inverse factorials 1/k! for k from 1 to 12, coefficients of Taylor's series of the exponential.
const INVERSE_FACTORIALS: [f64; 12] = {
    let mut values = [1.0; 12];
    let mut k = 1;
    while k < values.len() {
        values[k] = values[k - 1] / (k + 1) as f64;
        k += 1;
    }
    values
};

impl<S: Simd> Register<S> {
    /// Returns exp(x) − 1 for x ≤ 0, accurate to a few units in the last place.
    ///
    /// It evaluates Taylor's series at x/128. For x ≥ −40, the first neglected term is below 2·10⁻¹⁶ of the sum. Seven doublings of the argument follow by e ← e (2 +
    /// e), where e is the result so far. They lose no digits. For x < −40 the result is −1 to the last place.
    #[inline(always)]
    pub fn exp_m1_below_zero(self) -> Self {
        let floor = Self::splat(self.simd, -40.0);
        let part = self.if_above(floor, self, floor) * Self::splat(self.simd, 1.0 / 128.0);
        let mut sum = Self::splat(self.simd, INVERSE_FACTORIALS[11]);
        for k in 1..12 {
            sum = sum.mul_add(part, Self::splat(self.simd, INVERSE_FACTORIALS[11 - k]));
        }
        let mut change = sum * part;
        for _ in 0..7 {
            change = change.mul_add(change, change + change);
        }
        change
    }
}

macro_rules! operator {
    ($Trait:ident, $method:ident, $of_lanes:ident) => {
        impl<S: Simd> $Trait for Register<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self { value: self.simd.$of_lanes(self.value, other.value), ..self }
            }
        }
    };
}
operator!(Add, add, add_f64s);
operator!(Sub, sub, sub_f64s);
operator!(Mul, mul, mul_f64s);
operator!(Div, div, div_f64s);

impl Register<pulp::Scalar> {
    /// Value of a scalar register, which has one lane.
    pub fn number(self) -> f64 {
        self.value
    }
}

/// Running product of factors 1 + u with u ≥ 0, whose logarithm is taken once at the end.
///
/// The product minus one is stored, so that no digits are lost for factors close to one. The product is multiplied by 2⁻⁵⁰⁰ whenever it exceeds 2⁵⁰⁰.
#[derive(Debug, Clone, Copy)]
pub(super) struct Product<S: Simd> {
    excess: Register<S>,
    scalings: Register<S>,
}

/// Scaling factor 2⁵⁰⁰ of a [`Product`], which keeps the product finite.
const SCALING: f64 = f64::from_bits((1023 + 500) << 52);

impl<S: Simd> Product<S> {
    #[inline(always)]
    pub fn one(simd: S) -> Self {
        Self { excess: Register::splat(simd, 0.0), scalings: Register::splat(simd, 0.0) }
    }

    /// Multiplies the product by 1 + u, with u at most about 2⁵⁰⁰.
    #[inline(always)]
    pub fn grow(&mut self, u: Register<S>) {
        let simd = u.simd;
        let excess = self.excess.mul_add(u, self.excess + u);
        let limit = Register::splat(simd, SCALING);
        let scaled = excess.mul_add(Register::splat(simd, 1.0 / SCALING), Register::splat(simd, 1.0 / SCALING - 1.0));
        let counted = self.scalings + Register::splat(simd, 1.0);
        self.excess = excess.if_above(limit, scaled, excess);
        self.scalings = excess.if_above(limit, counted, self.scalings);
    }

    /// Stores the product as register number `index` of arrays of lanes.
    #[inline(always)]
    pub fn store<const W: usize>(self, lanes: &mut Products<W>, index: usize) {
        self.excess.store(&mut lanes.excess, index);
        self.scalings.store(&mut lanes.scalings, index);
    }
}

/// Products of all lanes, each stored as product minus one and number of scalings.
#[derive(Debug, Clone, Copy)]
pub(super) struct Products<const W: usize> {
    excess: [f64; W],
    scalings: [f64; W],
}

impl<const W: usize> Products<W> {
    pub const ONE: Self = Self { excess: [0.0; W], scalings: [0.0; W] };

    /// Logarithm of one lane's product.
    pub fn ln(&self, lane: usize) -> f64 {
        self.excess[lane].ln_1p() + self.scalings[lane] * SCALING.ln()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::Scalar;

    #[test]
    fn exponentials_keep_their_digits() {
        for i in 0..2000 {
            let x = -10_f64.powf(-12.0 + 0.0075 * f64::from(i));
            let change = Register::splat(Scalar, x).exp_m1_below_zero().number();
            assert!((change / x.exp_m1() - 1.0).abs() < 2e-15, "at {x}: {change} against {}", x.exp_m1());
        }
        let never = Register::splat(Scalar, f64::NEG_INFINITY).exp_m1_below_zero().number();
        assert!((never + 1.0).abs() < 1e-15);
    }

    /// Compares the logarithm of a product with the sum of logarithms, for factors from 1 + 10⁻¹² to 10¹⁴⁰.
    #[test]
    fn products_are_sums_of_logarithms() {
        for exponents in [-12.0..-11.0, -3.0..3.0, 100.0..140.0] {
            let mut product = Product::one(Scalar);
            let mut sum = 0.0;
            for i in 0..300 {
                let u = 10_f64.powf(exponents.start + (exponents.end - exponents.start) * f64::from(i) / 300.0);
                product.grow(Register::splat(Scalar, u));
                sum += u.ln_1p();
            }
            let mut lanes = Products::<1>::ONE;
            product.store(&mut lanes, 0);
            assert!((lanes.ln(0) / sum - 1.0).abs() < 1e-13, "{} against {sum}", lanes.ln(0));
        }
    }
}
