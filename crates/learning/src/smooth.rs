//! Smooth functions by which a quantity depends on a state.

use base::number::{Dual, Scalar as _};
use laws::stages::StateFunction;

/// Number of weights of a function during a search.
pub const N_WEIGHTS: usize = 8;
/// Largest number of weights of a function.
pub const MOST_WEIGHTS: usize = 16;

/// Basis functions of the scaled state u in [0, 1]. Their weighted sum is the exponent g of the factor [`Smooth`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Basis {
    /// A linear trend u, and cosines cos(πku)/k^p for k = 1, 2, …. A larger decay p makes the prior functions smoother.
    Cosines {
        /// Decay p of the cosines.
        decay: f64,
    },
    /// Integrals of n neighbouring hat functions. Each rises from 0 to 1 under its hat; weights are at least 0.
    Ramps {
        /// Number of hats, at most [`MOST_WEIGHTS`].
        n: usize,
        /// True if the functions fall with the state, false if they rise.
        falls: bool,
    },
}

impl Basis {
    /// Basis functions of a search: a trend and cosines whose sums bend but have no kinks.
    pub const COSINES: Self = Self::Cosines { decay: 1.5 };

    /// Constant factor of each basis function.
    fn sizes(self) -> [f64; MOST_WEIGHTS] {
        std::array::from_fn(|k| match self {
            Self::Cosines { .. } if k == 0 => 1.0,
            Self::Cosines { decay } => (k as f64).powf(-decay),
            Self::Ramps { n, .. } if k >= n => 0.0,
            Self::Ramps { n, falls } => {
                // With unit weights, all n ramps together rise by √n, like n independent changes.
                let whole = if k == 0 || k + 1 == n { 0.5 } else { 1.0 };
                (n as f64).sqrt().recip() * if falls { -1.0 } else { 1.0 } / whole
            }
        })
    }

    /// Values of the first `n_weights` basis functions, times their constant factors; the others are 0.
    fn at(self, u: Dual, sizes: &[f64; MOST_WEIGHTS], n_weights: usize) -> [Dual; MOST_WEIGHTS] {
        let inside = if (0.0..=1.0).contains(&u.value) { u } else { Dual::constant(u.value.clamp(0.0, 1.0)) };
        let mut functions = [Dual::ZERO; MOST_WEIGHTS];
        let each = functions.iter_mut().zip(sizes).take(n_weights).enumerate();
        match self {
            Self::Cosines { .. } => {
                let cosine = (inside * std::f64::consts::PI).cos();
                // cos(k x) = 2 cos x cos((k − 1)x) − cos((k − 2)x).
                let (mut before, mut now) = (cosine, Dual::ONE);
                for (k, (function, size)) in each {
                    *function = if k == 0 { u } else { now * *size };
                    (before, now) = (now, cosine * now * 2.0 - before);
                }
            }
            Self::Ramps { n, .. } => {
                let last = (n - 1) as f64;
                for (k, (function, size)) in each.take(n) {
                    // Each hat extends from x = −1 to 1; the first and the last are half hats.
                    let (x, from) = (inside * last + -(k as f64), if k == 0 { 0.5 } else { 0.0 });
                    let risen = if x.value <= -1.0 {
                        Dual::ZERO
                    } else if x.value <= 0.0 {
                        (x + 1.0) * (x + 1.0) * 0.5
                    } else if x.value <= 1.0 {
                        Dual::ONE + -((Dual::ONE + -x) * (Dual::ONE + -x) * 0.5)
                    } else {
                        Dual::ONE
                    };
                    *function = (risen + -from) * *size;
                }
            }
        }
        functions
    }
}

/// The factor e^{g(s)} by which a function of the state s multiplies a quantity. The exponent g is a weighted sum of basis functions of u, minus its value at the state
/// 0, where the quantity is unchanged. The variable u goes from 0 to 1 over the range of states, linearly or as arsinh(s/s₀). Beyond the range only a trend continues.
/// There is one basis function per weight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Smooth {
    basis: Basis,
    /// Offset and `width` that scale the (perhaps transformed) state to u = (state − `from`)/`width`, from 0 to 1 over the range of states.
    from: f64,
    width: f64,
    /// Scale s₀ of the transformation arsinh(s/s₀) of a state s; `None` if the state is not transformed.
    arsinh_scale: Option<f64>,
    /// Constant factors of the basis functions, and the functions' values at the state 0 (`at_zero`).
    sizes: [f64; MOST_WEIGHTS],
    at_zero: [f64; MOST_WEIGHTS],
}

impl Smooth {
    /// Makes the function over a nonempty range of states.
    pub fn over(range: [f64; 2], arsinh_scale: Option<f64>, basis: Basis) -> Self {
        let warp = |s: f64| arsinh_scale.map_or(s, |value| (s / value).asinh());
        let [from, to] = range.map(warp);
        let none = [0.0; MOST_WEIGHTS];
        Self { basis, from, width: to - from, arsinh_scale, sizes: none, at_zero: none }.with(basis)
    }

    /// Returns the basis functions of the exponent.
    pub fn basis(&self) -> Basis {
        self.basis
    }

    /// Returns the function with another basis over the same range.
    pub fn with(self, basis: Basis) -> Self {
        let mut smooth = Self { basis, sizes: basis.sizes(), at_zero: [0.0; MOST_WEIGHTS], ..self };
        smooth.at_zero = smooth.functions(Dual::ZERO).map(|function| function.value);
        smooth
    }

    /// Returns the basis functions at a state, minus their values at the state 0. Their weighted sum is the exponent g.
    pub fn functions(&self, state: Dual) -> [Dual; MOST_WEIGHTS] {
        self.first(MOST_WEIGHTS, state)
    }

    /// Returns the first `n_weights` basis functions of [`Self::functions`]; the others are 0.
    fn first(&self, n_weights: usize, state: Dual) -> [Dual; MOST_WEIGHTS] {
        let mut functions = self.basis.at(self.place(state), &self.sizes, n_weights);
        let each = functions.iter_mut().zip(self.at_zero).take(n_weights);
        each.for_each(|(function, at_zero)| *function = *function - at_zero);
        functions
    }

    /// Scaled state u, from 0 to 1 over the range of states.
    fn place(&self, state: Dual) -> Dual {
        let warped = match self.arsinh_scale {
            Some(unit) => {
                let x = state * unit.recip();
                Dual { value: x.value.asinh(), derivative: x.derivative / (1.0 + x.value * x.value).sqrt() }
            }
            None => state,
        };
        (warped - self.from) * self.width.recip()
    }

    /// Returns the exponent g of a cosine basis with constant weights, by Clenshaw's recurrence. It takes a fifth of the time of separate functions, the main cost of fits.
    fn sum_of_cosines(&self, state: Dual, weights: &[Dual]) -> Dual {
        let u = self.place(state);
        let is_inside = (0.0..=1.0).contains(&u.value);
        let (sine, cosine) = (std::f64::consts::PI * u.value.clamp(0.0, 1.0)).sin_cos();
        let (mut at_zero, mut sum, mut slope) = (0.0, [0.0; 2], [0.0; 2]);
        for (k, weight) in weights.iter().enumerate().skip(1).rev() {
            let size = weight.value * self.sizes[k];
            at_zero += weight.value * self.at_zero[k];
            sum = [size + 2.0 * cosine * sum[0] - sum[1], sum[0]];
            slope = [k as f64 * size + 2.0 * cosine * slope[0] - slope[1], slope[0]];
        }
        let trend = weights.first().map_or(0.0, |weight| weight.value);
        let bends = if is_inside { std::f64::consts::PI * sine * slope[0] } else { 0.0 };
        Dual {
            value: trend * (u.value - self.at_zero[0]) + cosine * sum[0] - sum[1] - at_zero,
            derivative: (trend - bends) * u.derivative,
        }
    }
}

impl StateFunction for Smooth {
    fn value(&self, state: Dual, parameters: &[Dual]) -> Dual {
        let are_constant = parameters.iter().all(|weight| weight.derivative == 0.0);
        if are_constant && matches!(self.basis, Basis::Cosines { .. }) {
            return self.sum_of_cosines(state, parameters).exp();
        }
        let functions = self.first(parameters.len(), state);
        parameters.iter().zip(functions).fold(Dual::ZERO, |sum, (weight, function)| sum + *weight * function).exp()
    }

    fn by_parameters(&self, state: f64, parameters: &[Dual], slopes: &mut [f64]) {
        let functions = self.first(parameters.len(), Dual::constant(state));
        let each = parameters.iter().zip(&functions);
        let factor = each.map(|(weight, function)| weight.value * function.value).sum::<f64>().exp();
        slopes.iter_mut().zip(&functions).for_each(|(slope, function)| *slope = factor * function.value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every basis function is 0 at the state 0. Cosines equal those of the standard library, and derivatives equal differences, with and without arsinh.
    #[test]
    fn functions_are_what_they_are_called() {
        for arsinh_scale in [None, Some(3e-5)] {
            let smooth = Smooth::over([-2e-4, 6e-4], arsinh_scale, Basis::COSINES);
            assert!(smooth.functions(Dual::ZERO).iter().all(|function| function.value == 0.0));
            for state in [-1.5e-4, 1e-5, 4e-4] {
                let found = smooth.functions(Dual::variable(state));
                let warp = |s: f64| arsinh_scale.map_or(s, |value: f64| (s / value).asinh());
                let u = |s: f64| (warp(s) - warp(-2e-4)) / (warp(6e-4) - warp(-2e-4));
                for (k, found) in found.iter().enumerate().skip(1) {
                    let cosine = |s: f64| (std::f64::consts::PI * k as f64 * u(s)).cos() * (k as f64).powf(-1.5);
                    assert!((found.value - (cosine(state) - cosine(0.0))).abs() < 1e-12);
                    let h = 1e-9;
                    let slope = (cosine(state + h) - cosine(state - h)) / (2.0 * h);
                    assert!((found.derivative - slope).abs() < 1e-4 * slope.abs().max(1e3), "{k} {slope} {found:?}");
                }
            }
            assert_eq!(smooth.value(Dual::constant(3e-4), &[Dual::ZERO; MOST_WEIGHTS]), Dual::ONE);
        }
    }
    /// The factor and its slopes for constant weights equal those of the sum of the basis functions. The test covers the range, both sides beyond it, and every number of
    /// weights.
    #[test]
    fn sums_of_cosines_are_those_of_the_functions() {
        for arsinh_scale in [None, Some(3e-5)] {
            let smooth = Smooth::over([-2e-4, 6e-4], arsinh_scale, Basis::Cosines { decay: 1.0 });
            for n_weights in [1, 2, N_WEIGHTS, MOST_WEIGHTS] {
                let weights: Vec<Dual> = (0..n_weights).map(|k| Dual::constant(0.7 - 0.3 * k as f64)).collect();
                for state in [-3e-4, -2e-4, -1e-4, 0.0, 2.3e-4, 6e-4, 9e-4].map(Dual::variable) {
                    let functions = smooth.functions(state);
                    let each = weights.iter().zip(functions);
                    let g = each.fold(Dual::ZERO, |sum, (weight, function)| sum + *weight * function);
                    let found = smooth.sum_of_cosines(state, &weights);
                    assert!((found.value - g.value).abs() < 1e-12, "{n_weights} {state:?}: {found:?} {g:?}");
                    assert!(
                        (found.derivative - g.derivative).abs() < 1e-12 * 1e6,
                        "{n_weights} {state:?}: {found:?} {g:?}"
                    );
                    let mut slopes = vec![0.0; n_weights];
                    smooth.by_parameters(state.value, &weights, &mut slopes);
                    for (k, slope) in slopes.iter().enumerate() {
                        let mut moving = weights.clone();
                        moving[k].derivative = 1.0;
                        let expected = smooth.value(Dual::constant(state.value), &moving).derivative;
                        assert!((slope - expected).abs() < 1e-12 * expected.abs().max(1.0), "{slope} {expected}");
                    }
                }
            }
        }
    }
    /// Rising ramps never fall and falling ramps never rise. All n ramps together rise by √n, and each ramp rises under its own hat only. Derivatives equal differences.
    #[test]
    fn ramps_go_one_way() {
        for (n, falls) in [(2, false), (8, true), (MOST_WEIGHTS, false)] {
            let smooth = Smooth::over([0.0, 2.0], None, Basis::Ramps { n, falls });
            let sign = if falls { -1.0 } else { 1.0 };
            let at = |state: f64| smooth.functions(Dual::variable(state));
            for k in 0..n {
                let mut before = 0.0;
                for step in 0..=400 {
                    let (state, h) = (step as f64 / 200.0, 1e-6);
                    let dual = at(state)[k];
                    assert!(sign * dual.value >= before - 1e-15, "{n} {k} {state}");
                    before = sign * dual.value;
                    if step > 0 && step < 400 {
                        let slope = (at(state + h)[k].value - at(state - h)[k].value) / (2.0 * h);
                        assert!((dual.derivative - slope).abs() < 1e-4, "{n} {k} {state}: {slope} {dual:?}");
                    }
                    let hat = 2.0 * k as f64 / (n - 1) as f64;
                    if (state - hat).abs() > 2.0 / (n - 1) as f64 {
                        assert_eq!(dual.derivative, 0.0);
                    }
                }
                assert!((before - (n as f64).sqrt().recip()).abs() < 1e-12);
            }
            assert!(at(1.0)[n..].iter().all(|dual| dual.value == 0.0));
        }
    }
}
