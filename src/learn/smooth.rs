//! Smooth functions of a state.

use crate::number::{Dual, Scalar as _};
use crate::stages::StateFunction;

/// Weights of a function in a search: a trend, and cosines over the range of states.
pub const N_WEIGHTS: usize = 8;
/// Most weights of a function.
pub const MOST_WEIGHTS: usize = 16;
/// Cosine k has the standard deviation k^−p of the first. In a search p is this: a prior of functions that bend, and have no kinks.
pub const DECAY: f64 = 1.5;

/// e^{g(s)} with g(s) = w₀ u + Σ wₖ cos(πku)/k^p, less the same at the state 0, so that the quantity is what it is there; u goes from 0 to 1 over the range of states, linearly
/// or as arsinh(s/s₀). Beyond the range only the trend goes on. As many functions are used as there are weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Smooth {
    /// p.
    decay: f64,
    /// u at the state s is (w(s) − `from`)/`width`.
    from: f64,
    width: f64,
    /// s₀, where w(s) is arsinh(s/s₀) and not s.
    bent_at: Option<f64>,
    /// The functions at the state 0.
    at_zero: [f64; MOST_WEIGHTS],
}

impl Smooth {
    /// Over a range of states that is not empty, with the decay p.
    pub fn over(range: [f64; 2], bent_at: Option<f64>, decay: f64) -> Self {
        let warp = |s: f64| bent_at.map_or(s, |own| (s / own).asinh());
        let [from, to] = range.map(warp);
        Self { decay, from, width: to - from, bent_at, at_zero: [0.0; MOST_WEIGHTS] }.with_decay(decay)
    }

    /// The same range with another decay p.
    pub fn with_decay(self, decay: f64) -> Self {
        let mut own = Self { decay, at_zero: [0.0; MOST_WEIGHTS], ..self };
        own.at_zero = own.functions(Dual::ZERO).map(|function| function.value);
        own
    }

    /// What the weight of function k becomes under the decay of another.
    pub fn converted(&self, weight: f64, k: usize, other: &Self) -> f64 {
        if k == 0 { weight } else { weight * (k as f64).powf(other.decay - self.decay) }
    }

    /// The functions whose weighted sum is g, less what they are at 0.
    pub fn functions(&self, state: Dual) -> [Dual; MOST_WEIGHTS] {
        let warped = match self.bent_at {
            Some(own) => {
                let x = state * own.recip();
                Dual { value: x.value.asinh(), derivative: x.derivative / (1.0 + x.value * x.value).sqrt() }
            }
            None => state,
        };
        let u = (warped - self.from) * self.width.recip();
        let inside = if (0.0..=1.0).contains(&u.value) { u } else { Dual::constant(u.value.clamp(0.0, 1.0)) };
        let cosine = (inside * std::f64::consts::PI).cos();
        // cos(k x) = 2 cos x cos((k − 1)x) − cos((k − 2)x).
        let (mut before, mut now) = (Dual::ONE, cosine);
        std::array::from_fn(|k| {
            if k == 0 {
                return u - self.at_zero[0];
            }
            let own = now * (k as f64).powf(-self.decay);
            (before, now) = (now, cosine * now * 2.0 - before);
            own - self.at_zero[k]
        })
    }
}

impl StateFunction for Smooth {
    fn value(&self, state: Dual, parameters: &[Dual]) -> Dual {
        let functions = self.functions(state);
        parameters.iter().zip(functions).fold(Dual::ZERO, |sum, (weight, function)| sum + *weight * function).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every function is 0 at the state 0, cosines are those of the library, and derivatives are differences; with and without a bend.
    #[test]
    fn functions_are_what_they_are_called() {
        for bent_at in [None, Some(3e-5)] {
            let smooth = Smooth::over([-2e-4, 6e-4], bent_at, DECAY);
            assert!(smooth.functions(Dual::ZERO).iter().all(|function| function.value == 0.0));
            for state in [-1.5e-4, 1e-5, 4e-4] {
                let found = smooth.functions(Dual::variable(state));
                let warp = |s: f64| bent_at.map_or(s, |own: f64| (s / own).asinh());
                let u = |s: f64| (warp(s) - warp(-2e-4)) / (warp(6e-4) - warp(-2e-4));
                for (k, found) in found.iter().enumerate().skip(1) {
                    let cosine = |s: f64| (std::f64::consts::PI * k as f64 * u(s)).cos() * (k as f64).powf(-DECAY);
                    assert!((found.value - (cosine(state) - cosine(0.0))).abs() < 1e-12);
                    let h = 1e-9;
                    let slope = (cosine(state + h) - cosine(state - h)) / (2.0 * h);
                    assert!((found.derivative - slope).abs() < 1e-4 * slope.abs().max(1e3), "{k} {slope} {found:?}");
                }
            }
            assert_eq!(smooth.value(Dual::constant(3e-4), &[Dual::ZERO; MOST_WEIGHTS]), Dual::ONE);
        }
    }
}
