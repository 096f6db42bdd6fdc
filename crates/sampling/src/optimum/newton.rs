//! Saddle-free Newton ascent of a log density with few coordinates. Derivatives are central differences.

use super::stencil::{Derivatives, differentiate, evaluate};
use crate::LogDensity;
use base::Result;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Maximum of a log density, with the curvature there.
#[derive(Debug, Clone, PartialEq)]
pub struct Optimum {
    /// Unconstrained coordinates of the maximum.
    pub location: Vec<f64>,
    /// Log density at the maximum.
    pub log_density: f64,
    /// Precision matrix, row by row: minus the Hessian of the log density, with all eigenvalues made positive.
    pub precision: Vec<f64>,
    /// `true` if the curvature is negative in every direction and the quadratic model predicts a further gain below 10⁻⁶ nats. After a climb that
    /// rounding ends, 10⁻³ nats suffice.
    pub converged: bool,
}

const MAX_ITERATIONS: usize = 500;
/// Number of iterations before steps are corrected for curved ridges. Most climbs need fewer, and a correction costs ten times as much as a plain
/// step.
const PLAIN_ITERATIONS: usize = 20;
/// Damping values that are tried at every step, relative to the curvature along the coordinates.
const DAMPINGS: [f64; 14] = [0.0, 1e-6, 1e-5, 1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0, 10.0, 100.0, 1e4];
/// Damping of the correction that leads back to a ridge. With it, the correction moves mainly along directions of strong curvature.
const RIDGE_DAMPING: f64 = 0.03;
/// Largest gain (nats) that the local quadratic model predicts for a converged climb.
const GAIN_TOLERANCE: f64 = 1e-6;
/// Change of the log density (nats) that a difference step should cause. It is far above rounding errors, and small enough for the quadratic model to
/// hold.
const DIFFERENCE_TARGET: f64 = 1e-2;

/// Climbs from a start to a maximum of the log density. `None` if the log density cannot be differentiated at the start or on the way up, because it
/// is −∞.
///
/// Coordinates are scaled by the diagonal of the curvature matrix. A step is (|Λ| + μ)⁻¹ times the gradient along the eigenvectors, where Λ are the
/// eigenvalues of the scaled matrix and μ is a damping. Steps for several μ are evaluated in one batch and the best is used, so no trust region is
/// needed.
///
/// # Errors
/// [`base::Error::Numerical`] when a log density is +∞.
pub fn maximise(density: &dyn LogDensity, start: &[f64]) -> Result<Option<Optimum>> {
    let Some((mut x, mut value, mut steps)) = beginning(density, start)? else { return Ok(None) };
    let mut refined = false;
    for iteration in 0.. {
        let Some(derivatives) = differentiate(density, &x, value, &mut steps)? else { return Ok(None) };
        let local = Local::new(&derivatives);
        let adapted = adapted_steps(&x, value, &derivatives, &steps);
        let settled = adapted.iter().zip(&steps).all(|(new, old)| (0.5..2.0).contains(&(new / old)));
        steps = adapted;
        // The curvature in the result must come from difference steps of a suitable size.
        let at_rest = local.gain < GAIN_TOLERANCE && local.is_maximum();
        if (at_rest && (settled || refined)) || iteration == MAX_ITERATIONS {
            return Ok(Some(local.optimum(&x, value, at_rest)));
        }
        refined = at_rest;
        let mut candidates = local.candidates(&x);
        let mut values = evaluate(density, &candidates, value)?;
        if iteration >= PLAIN_ITERATIONS && values[0] - value < 0.5 * local.gain {
            let corrected = local.corrected(density, &candidates, &values, &steps)?;
            values.extend(evaluate(density, &corrected, value)?);
            candidates.extend(corrected);
        }
        let best = (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(0);
        if values[best] > value {
            (x, value) = (candidates[best].clone(), values[best]);
        } else if !at_rest && settled {
            // No candidate is higher, because of rounding errors or a kink of the density, so the climb ends.
            return Ok(Some(local.optimum(&x, value, local.gain < 1e-3 && local.is_maximum())));
        }
    }
    Ok(None)
}

/// Returns the value and curvature of the log density at `point`, which need not be a maximum. `None` if the density cannot be differentiated there.
/// The difference steps are adapted twice, each time by a factor of at most ten.
///
/// # Errors
/// [`base::Error::Numerical`] when a log density is +∞.
pub fn fit_local_gaussian(density: &dyn LogDensity, point: &[f64]) -> Result<Option<Optimum>> {
    let Some((x, value, mut steps)) = beginning(density, point)? else { return Ok(None) };
    for _ in 0..2 {
        let Some(derivatives) = differentiate(density, &x, value, &mut steps)? else { return Ok(None) };
        steps = adapted_steps(&x, value, &derivatives, &steps);
    }
    let derivatives = differentiate(density, &x, value, &mut steps)?;
    Ok(derivatives.map(|derivatives| Local::new(&derivatives).optimum(&x, value, false)))
}

/// A point, its log density and its initial difference steps.
type StartPoint = (DVector<f64>, f64, DVector<f64>);

/// Returns `point` with its log density and initial difference steps; `None` outside the support.
fn beginning(density: &dyn LogDensity, point: &[f64]) -> Result<Option<StartPoint>> {
    let x = DVector::from_column_slice(point);
    let value = evaluate(density, std::slice::from_ref(&x), f64::NEG_INFINITY)?[0];
    let steps = x.map(|coordinate| 1e-3 * (1.0 + coordinate.abs()));
    Ok((value.is_finite() && !x.is_empty()).then_some((x, value, steps)))
}

/// Returns the difference steps at which each coordinate alone changes the log density by [`DIFFERENCE_TARGET`].
fn adapted_steps(x: &DVector<f64>, value: f64, derivatives: &Derivatives, steps: &DVector<f64>) -> DVector<f64> {
    let target = DIFFERENCE_TARGET.max(1e-9 * value.abs());
    DVector::from_fn(x.len(), |i, _| {
        let curvature = derivatives.hessian[(i, i)].abs();
        let wanted = (2.0 * target / curvature.max(1e-300)).sqrt();
        let widest = 0.1 * (1.0 + x[i].abs());
        // A step changes at most tenfold at a time, because a single curvature may be an outlier.
        wanted.clamp(0.1 * steps[i], 10.0 * steps[i]).clamp(1e-9 * (1.0 + x[i].abs()), widest)
    })
}

/// Local quadratic model of the log density in scaled coordinates u, with x = D u for a diagonal matrix D. The matrix −D H D, with H the Hessian, has
/// diagonal entries of ±1, or smaller entries for flat coordinates.
struct Local {
    scale: DVector<f64>,
    eigen: SymmetricEigen<f64, nalgebra::Dyn>,
    /// Gradient with respect to the scaled coordinates, in the basis of the eigenvectors.
    slope: DVector<f64>,
    /// Gain (nats) that the model predicts for a full step, ½ gᵀ|Λ|⁻¹g with the gradient g and the eigenvalues Λ.
    gain: f64,
}

impl Local {
    fn new(derivatives: &Derivatives) -> Self {
        let hessian = &derivatives.hessian;
        let largest = (0..hessian.nrows()).map(|i| hessian[(i, i)].abs()).fold(0.0, f64::max);
        let floor = (1e-12 * largest).max(1e-6);
        let scale = DVector::from_fn(hessian.nrows(), |i, _| hessian[(i, i)].abs().max(floor).sqrt().recip());
        let scaled = DMatrix::from_fn(hessian.nrows(), hessian.ncols(), |i, j| -hessian[(i, j)] * scale[i] * scale[j]);
        let eigen = SymmetricEigen::new(scaled);
        let slope = eigen.eigenvectors.transpose() * derivatives.gradient.component_mul(&scale);
        let gain = 0.5 * slope.iter().zip(&eigen.eigenvalues).map(|(g, l)| g * g / Self::stiff(*l)).sum::<f64>();
        Self { scale, eigen, slope, gain }
    }

    fn stiff(eigenvalue: f64) -> f64 {
        eigenvalue.abs().max(1e-8)
    }

    fn is_maximum(&self) -> bool {
        self.eigen.eigenvalues.iter().all(|&l| l > 1e-8)
    }

    /// Converts a step from the basis of the eigenvectors to the density's coordinates. The step is shortened so that no coordinate x changes by more
    /// than 3 + |x|. Three units of a logarithm are a factor of twenty.
    fn bounded_step(&self, x: &DVector<f64>, along: DVector<f64>) -> DVector<f64> {
        let step = (&self.eigen.eigenvectors * along).component_mul(&self.scale);
        let longest = step.iter().zip(x).map(|(s, x)| s.abs() / (3.0 + x.abs())).fold(0.0, f64::max);
        if longest > 1.0 { step / longest } else { step }
    }

    fn candidates(&self, x: &DVector<f64>) -> Vec<DVector<f64>> {
        let mut candidates = Vec::new();
        let mut push = |along: DVector<f64>| candidates.push(x + self.bounded_step(x, along));
        for mu in DAMPINGS {
            push(self.slope.zip_map(&self.eigen.eigenvalues, |g, l| g / (Self::stiff(l) + mu)));
        }
        for (k, &l) in self.eigen.eigenvalues.iter().enumerate() {
            // Where the curvature is positive, steps in both directions are tried, because the gradient may vanish there.
            if l < -1e-8 {
                for length in [-1.0, -0.1, 0.1, 1.0] {
                    push(DVector::from_fn(x.len(), |i, _| if i == k { length } else { 0.0 }));
                }
            }
        }
        candidates
    }

    /// Returns the candidate points, each moved back to a curved ridge. A long step in directions of weak curvature leaves the ridge, because the
    /// quadratic model fails. The correction is a second step with the gradient at the end of the first step and the earlier curvature.
    fn corrected(
        &self,
        density: &dyn LogDensity,
        candidates: &[DVector<f64>],
        values: &[f64],
        steps: &DVector<f64>,
    ) -> Result<Vec<DVector<f64>>> {
        let n = steps.len();
        let ends: Vec<&DVector<f64>> =
            candidates.iter().zip(values).take(DAMPINGS.len()).filter(|(_, v)| v.is_finite()).map(|(c, _)| c).collect();
        let shifted = |end: &DVector<f64>, d: usize, sign: f64| {
            let mut point = end.clone();
            point[d] += sign * steps[d];
            point
        };
        let around = |end: &&DVector<f64>| -> Vec<DVector<f64>> {
            (0..n).flat_map(|d| [shifted(end, d, 1.0), shifted(end, d, -1.0)]).collect()
        };
        let points: Vec<DVector<f64>> = ends.iter().flat_map(around).collect();
        let values = evaluate(density, &points, f64::NEG_INFINITY)?;
        let correct = |(end, values): (&&DVector<f64>, &[f64])| {
            let gradient = DVector::from_fn(n, |d, _| (values[2 * d] - values[2 * d + 1]) / (2.0 * steps[d]));
            let slope = self.eigen.eigenvectors.transpose() * gradient.component_mul(&self.scale);
            let along = slope.zip_map(&self.eigen.eigenvalues, |g, l| g / (Self::stiff(l) + RIDGE_DAMPING));
            *end + self.bounded_step(end, along)
        };
        let corrected = ends.iter().zip(values.chunks(2 * n)).map(correct);
        Ok(corrected.filter(|point| point.iter().all(|x| x.is_finite())).collect())
    }

    fn optimum(&self, x: &DVector<f64>, value: f64, converged: bool) -> Optimum {
        let vectors = &self.eigen.eigenvectors;
        let stiff = DMatrix::from_diagonal(&self.eigen.eigenvalues.map(Self::stiff));
        let scaled = vectors * stiff * vectors.transpose();
        let n = x.len();
        let entry = |i: usize, j: usize| 0.5 * (scaled[(i, j)] + scaled[(j, i)]) / (self.scale[i] * self.scale[j]);
        let precision = (0..n * n).map(|k| entry(k / n, k % n)).collect();
        Optimum { location: x.as_slice().to_vec(), log_density: value, precision, converged }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_densities::{Banana, Correlated};

    #[test]
    fn a_gaussian_is_found_from_afar_with_its_curvature() {
        let target = Correlated::new(4);
        let optimum = maximise(&target, &[30.0, -20.0, 5.0, 100.0]).unwrap().unwrap();
        assert!(optimum.converged);
        assert!(optimum.location.iter().zip(target.mean()).all(|(x, m)| (x - m).abs() < 1e-4));
        for (found, exact) in optimum.precision.iter().zip(target.precision()) {
            assert!((found - exact).abs() < 1e-4 * exact.abs().max(1.0), "{found} against {exact}");
        }
    }

    #[test]
    fn a_curved_ridge_is_followed() {
        let optimum = maximise(&Banana { bend: 10.0 }, &[-3.0, 40.0]).unwrap().unwrap();
        assert!(optimum.converged);
        assert!(optimum.location[0].abs() < 1e-2 && optimum.location[1].abs() < 1e-2, "{:?}", optimum.location);
    }

    #[test]
    fn outside_the_support_there_is_nothing_to_climb() {
        struct Nowhere;
        impl LogDensity for Nowhere {
            fn dimension(&self) -> usize {
                1
            }
            fn log_density(&self, _points: &[f64], log_density: &mut [f64]) {
                log_density.fill(f64::NEG_INFINITY);
            }
        }
        assert_eq!(maximise(&Nowhere, &[0.0]).unwrap(), None);
    }
}
