//! Entire functions φₖ of exponential integrators, for real and complex arguments.

use super::numbers::{Field, Number};

/// Number of entire functions φₖ. It equals the number of collocation nodes.
pub(super) const N_FUNCTIONS: usize = 5;

/// Size of the argument below which the functions are computed by series. For larger arguments a recursion is used, which loses
/// at most one digit.
const SERIES_BELOW: f64 = 1.0;
const N_TERMS: u32 = 17;

/// Returns the entire functions φ₁(w) … φ₅(w), defined by φ₀ = eʷ, φₖ₊₁ = (φₖ − 1/k!)/w and φₖ(0) = 1/k!.
pub(super) fn entire_functions<T: Field>(w: T) -> [T; N_FUNCTIONS] {
    let mut functions = [T::real(1.0); N_FUNCTIONS];
    if w.size() < SERIES_BELOW {
        // The series is φ₅ = Σ wⁿ/(n+5)! = (1/5!)(1 + w/6 (1 + w/7 (1 + …))).
        let mut sum = T::real(1.0);
        for n in (1..=N_TERMS).rev() {
            sum = T::real(1.0) + w * sum * (1.0 / f64::from(n + 5));
        }
        functions[4] = sum * (1.0 / 120.0);
        for (k, factorial) in [(3, 24.0), (2, 6.0), (1, 2.0), (0, 1.0)] {
            functions[k] = w * functions[k + 1] + T::real(1.0 / factorial);
        }
    } else {
        let mut last = w.exponential();
        for (function, factorial) in functions.iter_mut().zip([1.0, 1.0, 2.0, 6.0, 24.0]) {
            last = (last - T::real(1.0 / factorial)) / w;
            *function = last;
        }
    }
    functions
}

/// Returns the entire functions φ₁(−z) … φ₅(−z) for one or several parameter points. The size of each point's z decides between series and
/// recursion.
#[inline(always)]
pub(super) fn entire_functions_of_decay<S: Number>(z: S) -> [S; N_FUNCTIONS] {
    let w = -z;
    let one = S::constant(1.0);
    let mut sum = one;
    for n in (1..=N_TERMS).rev() {
        sum = (w * sum).mul_add(S::constant(1.0 / f64::from(n + 5)), one);
    }
    let mut series = [sum * (1.0 / 120.0); N_FUNCTIONS];
    let inverse_factorials = [1.0, 1.0, 0.5, 1.0 / 6.0, 1.0 / 24.0];
    for k in (0..N_FUNCTIONS - 1).rev() {
        series[k] = w.mul_add(series[k + 1], S::constant(inverse_factorials[k + 1]));
    }
    let mut last = z.decay().0;
    let inverse = one / w;
    let mut functions = [one; N_FUNCTIONS];
    for k in 0..N_FUNCTIONS {
        last = (last - S::constant(inverse_factorials[k])) * inverse;
        functions[k] = z.choose(SERIES_BELOW, series[k], last);
    }
    functions
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks that the functions for real and for complex arguments agree, on either side of the series' limit.
    #[test]
    fn real_and_complex_arguments_give_the_same() {
        for z in [-40.0, -3.0, -0.3, 0.0, 1e-9, 0.2, 0.999_999, 1.0, 3.0, 40.0, 800.0] {
            for (found, expected) in entire_functions_of_decay(z).iter().zip(entire_functions(-z)) {
                assert!((found / expected - 1.0).abs() < 1e-13, "{z}: {found} against {expected}");
            }
        }
    }
}
