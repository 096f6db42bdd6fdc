//! Nonlinear least squares by the method of Levenberg and Marquardt.
//!
//! The sum of squares S(θ) = Σ rᵢ(θ)² of the residuals rᵢ is minimised over the parameters θ. Each iteration solves (JᵀJ + λ diag JᵀJ) δ = −Jᵀr for
//! the step δ, where J = ∂r/∂θ (Marquardt 1963, doi:10.1137/0111030). The damping λ depends on the gain ratio, the actual decrease of S divided by
//! the predicted decrease (Nielsen 1999). By default the search ends when an accepted step changes S by less than 10⁻⁹ of its value and every
//! coordinate by less than 10⁻⁶. These are the tolerances of the paper (Wang et al. 2013).
//!
//! Steps are projected onto the bounds of coordinates (Kanzow, Yamashita & Fukushima 2004, doi:10.1016/j.cam.2004.02.013). While S decreases beyond a
//! bound, the coordinate stays at the bound and the other coordinates continue.

use base::{Error, Result};
use nalgebra::{DMatrix, DVector};

/// Tolerances and iteration limit that end the search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerances {
    /// Largest change of the sum of squares in the last step, relative to its value.
    pub objective: f64,
    /// Largest change of each coordinate θ in the last step, relative to 1 + |θ|.
    pub parameters: f64,
    /// Number of iterations after which the search ends without convergence.
    pub max_iterations: usize,
}

impl Default for Tolerances {
    fn default() -> Self {
        Self { objective: 1e-9, parameters: 1e-6, max_iterations: 500 }
    }
}

/// Least-squares problem: its residuals, their derivatives (if known) and the bounds of the coordinates.
pub trait LeastSquaresProblem {
    /// Returns the residuals at the coordinates `theta`; `None` if the model cannot be evaluated there.
    fn residuals(&self, theta: &[f64]) -> Option<DVector<f64>>;

    /// Returns the derivatives of the residuals at the coordinates `theta`, with one row per residual and one column per coordinate. `None` requests
    /// central differences.
    fn jacobian(&self, theta: &[f64]) -> Option<DMatrix<f64>>;

    /// Returns the lower and upper bound of a coordinate, both included. By default there are no bounds.
    fn bounds(&self, _coordinate: usize) -> (f64, f64) {
        (f64::NEG_INFINITY, f64::INFINITY)
    }
}

/// Least-squares estimate with its uncertainty.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// Estimated coordinates, at which the sum of squares is smallest.
    pub theta: Vec<f64>,
    /// Covariance matrix s²(JᵀJ)⁻¹ of the estimate, row by row. J is the Jacobian, and s² is the sum of squares divided by n − p, for n residuals and
    /// p coordinates. All entries are NaN if n ≤ p or the rank of J is less than p.
    pub covariance: Vec<f64>,
    /// Standard error of each coordinate, the square root of its variance in `covariance`.
    pub standard_errors: Vec<f64>,
    /// Sum of squared residuals at the estimate, in the squared unit of the residuals.
    pub objective: f64,
    /// Residuals at the estimate, in the order of the problem.
    pub residuals: Vec<f64>,
    /// Number of steps that were tried.
    pub iterations: usize,
    /// `true` if the search met the tolerances of the objective and of the coordinates.
    pub converged: bool,
}

/// Minimises the sum of squared residuals, starting from the coordinates `start`.
///
/// # Errors
/// [`Error::Numerical`] if there are no residuals, or if the residuals or their derivatives are not finite at the start.
pub fn fit(problem: &dyn LeastSquaresProblem, start: &[f64], tolerances: &Tolerances) -> Result<Fit> {
    let bounds: Vec<(f64, f64)> = (0..start.len()).map(|j| problem.bounds(j)).collect();
    let mut point = TrustPoint::at(problem, within(&bounds, start.to_vec())).ok_or_else(|| {
        Error::numerical(
            format!("the residuals cannot be computed at the start {start:?}"),
            "start from parameters at which the model can be evaluated",
        )
    })?;
    let mut damping = Damping::new();
    let mut iterations = 0;
    let mut converged = false;
    while !converged && iterations < tolerances.max_iterations {
        iterations += 1;
        let Some(step) = point.step(damping.lambda, &bounds) else {
            if !damping.refuse() {
                break;
            }
            continue;
        };
        let theta = within(&bounds, point.theta.iter().zip(step.iter()).map(|(t, s)| t + s).collect());
        let step = DVector::from_iterator(theta.len(), theta.iter().zip(&point.theta).map(|(new, old)| new - old));
        let small = step.iter().zip(&point.theta).all(|(s, t)| s.abs() <= tolerances.parameters * (1.0 + t.abs()));
        let promised = point.promised(&step);
        // Near the rounding error no step decreases the sum of squares any further. A very small predicted decrease therefore also ends the search.
        if small && promised <= tolerances.objective * point.objective {
            converged = damping.lambda <= 1.0;
        }
        let trial = TrustPoint::at(problem, theta).filter(|trial| trial.objective <= point.objective);
        match trial {
            Some(trial) => {
                let gain = point.objective - trial.objective;
                converged |= small && gain <= tolerances.objective * point.objective;
                damping.accept(gain / promised.max(f64::MIN_POSITIVE));
                point = trial;
            }
            None if !converged && !damping.refuse() => break,
            None => {}
        }
    }
    Ok(point.finish(iterations, converged))
}

/// Moves every coordinate that lies beyond a bound onto the bound.
fn within(bounds: &[(f64, f64)], mut theta: Vec<f64>) -> Vec<f64> {
    for (t, (lower, upper)) in theta.iter_mut().zip(bounds) {
        *t = t.max(*lower).min(*upper);
    }
    theta
}

/// Damping λ of the Levenberg–Marquardt steps, changed by Nielsen's rule.
struct Damping {
    lambda: f64,
    growth: f64,
}

impl Damping {
    fn new() -> Self {
        Self { lambda: 1e-3, growth: 2.0 }
    }

    fn accept(&mut self, gain_ratio: f64) {
        self.lambda = (self.lambda * (1.0 - (2.0 * gain_ratio - 1.0).powi(3)).max(1.0 / 3.0)).max(1e-14);
        self.growth = 2.0;
    }

    /// Increases the damping after a rejected step. Returns `false` if the damping is so large that further steps cannot help.
    fn refuse(&mut self) -> bool {
        self.lambda *= self.growth;
        self.growth *= 2.0;
        self.lambda < 1e30
    }
}

struct TrustPoint {
    theta: Vec<f64>,
    residuals: DVector<f64>,
    /// Matrix JᵀJ, with the Jacobian J.
    normal: DMatrix<f64>,
    jacobian: DMatrix<f64>,
    objective: f64,
}

impl TrustPoint {
    fn at(problem: &dyn LeastSquaresProblem, theta: Vec<f64>) -> Option<Self> {
        let residuals = problem.residuals(&theta)?;
        let objective = residuals.norm_squared();
        if !objective.is_finite() || residuals.is_empty() {
            return None;
        }
        let jacobian = match problem.jacobian(&theta) {
            Some(jacobian) => jacobian,
            None => central_differences(problem, &theta, residuals.len())?,
        };
        if jacobian.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let normal = jacobian.tr_mul(&jacobian);
        Some(Self { theta, residuals, normal, jacobian, objective })
    }

    /// Indices of the coordinates that are held at a bound, because the sum of squares decreases beyond the bound.
    fn held(&self, bounds: &[(f64, f64)]) -> Vec<usize> {
        let downhill = -self.jacobian.tr_mul(&self.residuals);
        let is_held = |&j: &usize| {
            let (lower, upper) = bounds[j];
            (self.theta[j] <= lower && downhill[j] < 0.0) || (self.theta[j] >= upper && downhill[j] > 0.0)
        };
        (0..self.theta.len()).filter(is_held).collect()
    }

    /// Computes the damped step; `None` if it is not finite. The step follows from the QR factors of the Jacobian J stacked on √(λ diag JᵀJ), which
    /// avoids squaring the condition number. Coordinates that are held at a bound do not move.
    fn step(&self, lambda: f64, bounds: &[(f64, f64)]) -> Option<DVector<f64>> {
        let (n, p) = self.jacobian.shape();
        let largest = (0..p).map(|j| self.normal[(j, j)]).fold(0.0, f64::max);
        let mut stacked = DMatrix::zeros(n + p, p);
        stacked.rows_mut(0, n).copy_from(&self.jacobian);
        for j in self.held(bounds) {
            stacked.column_mut(j).fill(0.0);
        }
        for j in 0..p {
            // A minimum damping keeps a parameter without influence at its value.
            stacked[(n + j, j)] = (lambda * self.normal[(j, j)].max(1e-12 * largest)).sqrt();
        }
        let mut right = DVector::zeros(n + p);
        right.rows_mut(0, n).copy_from(&(-&self.residuals));
        let qr = stacked.qr();
        qr.q_tr_mul(&mut right);
        let step = qr.r().solve_upper_triangular(&right.rows(0, p).into_owned())?;
        step.iter().all(|s| s.is_finite()).then_some(step)
    }

    /// Decrease of the sum of squares that the linearised residuals predict for a step.
    fn promised(&self, step: &DVector<f64>) -> f64 {
        let linear = &self.residuals + &self.jacobian * step;
        (self.objective - linear.norm_squared()).max(0.0)
    }

    fn finish(self, iterations: usize, converged: bool) -> Fit {
        let (n, p) = self.jacobian.shape();
        let variance = if n > p { self.objective / (n - p) as f64 } else { f64::NAN };
        let covariance = match inverse_normal(&self.jacobian) {
            Some(inverse) => inverse * variance,
            None => DMatrix::from_element(p, p, f64::NAN),
        };
        Fit {
            standard_errors: covariance.diagonal().iter().map(|v| v.sqrt()).collect(),
            covariance: covariance.transpose().as_slice().to_vec(),
            objective: self.objective,
            residuals: self.residuals.as_slice().to_vec(),
            theta: self.theta,
            iterations,
            converged,
        }
    }
}

/// Computes (JᵀJ)⁻¹ from the QR factors of the Jacobian J; `None` if J does not have full rank numerically.
fn inverse_normal(jacobian: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let p = jacobian.ncols();
    if jacobian.nrows() < p {
        return None;
    }
    // Columns are scaled to unit length, so the rank test does not depend on units.
    let norms = DVector::from_fn(p, |j, _| jacobian.column(j).norm());
    if norms.iter().any(|&norm| norm == 0.0) {
        return None;
    }
    let scaled = DMatrix::from_fn(jacobian.nrows(), p, |i, j| jacobian[(i, j)] / norms[j]);
    let r = scaled.qr().r();
    if r.diagonal().iter().any(|d| d.abs() < 1e-13) {
        return None;
    }
    let inverse = r.solve_upper_triangular(&DMatrix::identity(p, p))?;
    let inverse = DMatrix::from_fn(p, p, |i, j| inverse[(i, j)] / norms[i]);
    Some(&inverse * inverse.transpose())
}

fn central_differences(problem: &dyn LeastSquaresProblem, theta: &[f64], n: usize) -> Option<DMatrix<f64>> {
    let mut jacobian = DMatrix::zeros(n, theta.len());
    for j in 0..theta.len() {
        // A step near the cube root of the floating-point precision balances truncation and rounding errors.
        let step = 6e-6 * (1.0 + theta[j].abs());
        let mut shifted = theta.to_vec();
        shifted[j] = theta[j] + step;
        let above = problem.residuals(&shifted)?;
        shifted[j] = theta[j] - step;
        let below = problem.residuals(&shifted)?;
        jacobian.set_column(j, &((above - below) / (2.0 * step)));
    }
    Some(jacobian)
}

#[cfg(test)]
mod tests {
    use super::*;

    struct QuadraticModel<F> {
        data: Vec<(f64, f64)>,
        f: F,
    }

    impl<F: Fn(f64, &[f64]) -> f64> LeastSquaresProblem for QuadraticModel<F> {
        fn residuals(&self, theta: &[f64]) -> Option<DVector<f64>> {
            Some(DVector::from_iterator(self.data.len(), self.data.iter().map(|&(x, y)| (self.f)(x, theta) - y)))
        }
        fn jacobian(&self, _theta: &[f64]) -> Option<DMatrix<f64>> {
            None
        }
    }

    /// Compares the fit of a line with the textbook formulas for the slope, the intercept and their standard errors.
    #[test]
    fn straight_line_has_the_textbook_estimate_and_errors() {
        let data: Vec<(f64, f64)> =
            (0..20).map(|i| (f64::from(i), 2.0 - 0.7 * f64::from(i) + f64::from((i * 37) % 11) - 5.0)).collect();
        let n = data.len() as f64;
        let (mx, my) = (data.iter().map(|d| d.0).sum::<f64>() / n, data.iter().map(|d| d.1).sum::<f64>() / n);
        let sxx: f64 = data.iter().map(|d| (d.0 - mx).powi(2)).sum();
        let slope = data.iter().map(|d| (d.0 - mx) * (d.1 - my)).sum::<f64>() / sxx;
        let intercept = my - slope * mx;
        let rss: f64 = data.iter().map(|d| (d.1 - intercept - slope * d.0).powi(2)).sum();
        let s2 = rss / (n - 2.0);
        let found =
            fit(&QuadraticModel { data, f: |x, t: &[f64]| t[0] + t[1] * x }, &[0.0, 0.0], &Tolerances::default())
                .unwrap();
        assert!(found.converged);
        let exact = [intercept, slope, (s2 * (1.0 / n + mx * mx / sxx)).sqrt(), (s2 / sxx).sqrt()];
        let ours = [found.theta[0], found.theta[1], found.standard_errors[0], found.standard_errors[1]];
        for (a, b) in ours.iter().zip(exact) {
            assert!((a - b).abs() < 1e-7 * b.abs().max(1.0), "{ours:?} against {exact:?}");
        }
        assert!((found.objective / rss - 1.0).abs() < 1e-12);
    }

    /// Compares a fit with the certified values and standard deviations of NIST StRD Misra1a, y = b₁(1 − exp(−b₂x)). The fit starts from NIST's more
    /// distant starting point.
    #[test]
    fn misra1a_is_certified() {
        let y = [10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40, 75.47, 81.78];
        let x = [77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0];
        let model = QuadraticModel {
            data: x.into_iter().zip(y).collect(),
            f: |x: f64, t: &[f64]| t[0] * (1.0 - (-t[1].exp() * x).exp()),
        };
        // The logarithm of the rate b₂ is fitted, as for all positive parameters.
        let found = fit(&model, &[500.0, 1e-4_f64.ln()], &Tolerances::default()).unwrap();
        assert!(found.converged, "{found:?}");
        let rate = found.theta[1].exp();
        for (ours, certified) in [
            (found.theta[0], 2.3894212918e2),
            (rate, 5.5015643181e-4),
            (found.standard_errors[0], 2.7070075241),
            (rate * found.standard_errors[1], 7.2668688436e-6),
            (found.objective, 1.2455138894e-1),
        ] {
            assert!((ours / certified - 1.0).abs() < 1e-6, "{ours} against {certified}");
        }
    }

    #[test]
    fn noise_free_data_give_the_truth() {
        let truth = [1.3_f64, -0.4, 0.8];
        let f = |x: f64, t: &[f64]| t[0].exp() * (1.0 - (-x * t[1].exp()).exp()) + t[2] * x;
        let data = (1..60).map(|i| f64::from(i) * 0.1).map(|x| (x, f(x, &truth))).collect();
        let found = fit(&QuadraticModel { data, f }, &[0.0, 0.0, 0.0], &Tolerances::default()).unwrap();
        assert!(found.converged);
        assert!(found.theta.iter().zip(truth).all(|(a, b)| (a - b).abs() < 1e-6), "{:?}", found.theta);
    }

    /// Fits an exponential plus a constant, from a start at which the first steps exceed the bound of the rate. The search moves along the bound and
    /// then to the true values. If the true rate is beyond the bound, the search ends on the bound, at the best values of the other coordinates.
    #[test]
    fn bounds_do_not_stop_the_other_coordinates() {
        struct Bounded<F>(QuadraticModel<F>, Vec<(f64, f64)>);
        impl<F: Fn(f64, &[f64]) -> f64> LeastSquaresProblem for Bounded<F> {
            fn residuals(&self, theta: &[f64]) -> Option<DVector<f64>> {
                let is_within = theta.iter().zip(&self.1).all(|(t, (lower, upper))| t >= lower && t <= upper);
                assert!(is_within, "{theta:?} is beyond its bounds");
                self.0.residuals(theta)
            }
            fn jacobian(&self, theta: &[f64]) -> Option<DMatrix<f64>> {
                let step = 1e-6;
                let change = |j: usize| {
                    let shifted = |by: f64| {
                        theta.iter().enumerate().map(|(i, t)| if i == j { t + by } else { *t }).collect::<Vec<_>>()
                    };
                    (self.0.residuals(&shifted(step)).unwrap() - self.0.residuals(&shifted(-step)).unwrap())
                        / (2.0 * step)
                };
                Some(DMatrix::from_columns(&(0..theta.len()).map(change).collect::<Vec<_>>()))
            }
            fn bounds(&self, coordinate: usize) -> (f64, f64) {
                self.1[coordinate]
            }
        }
        let f = |x: f64, t: &[f64]| t[0] * (-t[1].exp() * x).exp() + t[2];
        let truth = [2.0, 0.5_f64, 0.3];
        let data: Vec<(f64, f64)> = (0..50).map(|i| 0.1 * f64::from(i)).map(|x| (x, f(x, &truth))).collect();
        let none = (f64::NEG_INFINITY, f64::INFINITY);
        let start = [-1.0, -1.9, 4.0];
        let wide = Bounded(QuadraticModel { data: data.clone(), f }, vec![none, (-2.0, 2.0), (-5.0, 5.0)]);
        let found = fit(&wide, &start, &Tolerances::default()).unwrap();
        assert!(found.converged && found.theta.iter().zip(truth).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?}");
        let narrow = Bounded(QuadraticModel { data: data.clone(), f }, vec![none, (-2.0, 0.2), (-5.0, 5.0)]);
        let found = fit(&narrow, &start, &Tolerances::default()).unwrap();
        let given = QuadraticModel { data, f: |x: f64, t: &[f64]| f(x, &[t[0], 0.2, t[1]]) };
        let best = fit(&given, &[1.0, 0.0], &Tolerances::default()).unwrap();
        assert!(found.converged && found.theta[1] == 0.2, "{found:?}");
        assert!((found.objective / best.objective - 1.0).abs() < 1e-6, "{} {}", found.objective, best.objective);
    }

    #[test]
    fn a_parameter_without_influence_has_no_error() {
        let data = (0..10).map(|i| (f64::from(i), 3.0 + f64::from(i % 2))).collect();
        let found = fit(&QuadraticModel { data, f: |_, t: &[f64]| t[0] }, &[0.0, 7.0], &Tolerances::default()).unwrap();
        assert!((found.theta[0] - 3.5).abs() < 1e-6 && (found.theta[1] - 7.0).abs() < 1e-6, "{found:?}");
        assert!(found.standard_errors.iter().all(|e| e.is_nan()));
    }

    #[test]
    fn a_start_without_residuals_is_an_error() {
        struct Nothing;
        impl LeastSquaresProblem for Nothing {
            fn residuals(&self, _theta: &[f64]) -> Option<DVector<f64>> {
                None
            }
            fn jacobian(&self, _theta: &[f64]) -> Option<DMatrix<f64>> {
                None
            }
        }
        let error = fit(&Nothing, &[1.0], &Tolerances::default()).unwrap_err().to_string();
        assert!(error.contains("the residuals cannot be computed at the start [1.0]"), "{error}");
    }
}
