//! Independence move: a walker jumps to a draw from a fixed approximation of the posterior, wherever it is.
//!
//! The approximation is a mixture of multivariate t distributions with six degrees of freedom, one a mode:
//! q(y) = Σ w_k t₆(y; m_k, S_k), drawn without regard to x and accepted with (π(y)/q(y))/(π(x)/q(x)).
//! Where q is good most draws are accepted and nearly independent, between modes as within; where it is not, draws are
//! refused and the other moves do the work. Tierney 1994, doi:10.1214/aos/1176325750, §2.3.2.

use super::{Move, Points};
use crate::inference::ensemble::random::RandomStream;
use crate::inference::optimum::Modes;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Degrees of freedom: heavy enough tails for what a Laplace approximation misses, and even, so that χ² is −2 ln Π u.
const DEGREES_OF_FREEDOM: f64 = 6.0;
/// Components whose weight is below this are drawn this often all the same.
const SMALLEST_WEIGHT: f64 = 0.02;
/// Draws per coordinate that a component's shape is fitted to, at least.
const DRAWS_PER_COORDINATE: usize = 100;
/// Modes considered, heaviest first: each costs at every proposal.
const MAX_COMPONENTS: usize = 8;

/// Independence move from a mixture of t₆ distributions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Independence {
    dimension: usize,
    components: Vec<Component>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Component {
    /// Upper end of the cell of [0, 1) that chooses this component.
    upper: f64,
    location: Vec<f64>,
    /// Lower triangular factor L of the scale matrix S = L Lᵀ, row by row.
    spread: Vec<f64>,
    /// L⁻¹, row by row.
    whiten: Vec<f64>,
    /// ln(w / det L): the constant that all components share is left out.
    log_weight: f64,
}

/// A component before its factors are known.
struct Shape {
    weight: f64,
    location: Vec<f64>,
    covariance: DMatrix<f64>,
}

impl Independence {
    /// From the modes' Laplace approximations; `None` when none has a usable curvature.
    pub fn from_modes(modes: &Modes, dimension: usize) -> Option<Self> {
        Self::new(Self::laplace_shapes(modes, dimension), dimension)
    }

    /// The same with location and shape of each mode's component fitted to the draws nearest to it, where there are enough.
    /// `points` lists draws one by one.
    pub fn fitted(modes: &Modes, dimension: usize, points: &[Vec<f64>]) -> Option<Self> {
        let mut shapes = Self::laplace_shapes(modes, dimension);
        let mut members: Vec<Vec<&Vec<f64>>> = vec![Vec::new(); modes.len()];
        for point in points {
            if let Some((idx, _)) = modes.nearest(point) {
                members[idx].push(point);
            }
        }
        for (shape, members) in shapes.iter_mut().zip(&members) {
            if members.len() >= DRAWS_PER_COORDINATE * dimension
                && let Some((mean, covariance)) = moments(members, dimension)
            {
                (shape.location, shape.covariance) = (mean, covariance);
            }
        }
        Self::new(shapes, dimension)
    }

    fn laplace_shapes(modes: &Modes, dimension: usize) -> Vec<Shape> {
        let shape = |(mode, weight): (&crate::inference::optimum::Mode, f64)| Shape {
            weight,
            location: mode.location.clone(),
            covariance: DMatrix::from_row_slice(dimension, dimension, &mode.precision)
                .try_inverse()
                .unwrap_or_else(|| DMatrix::zeros(dimension, dimension)),
        };
        modes.iter().zip(modes.weights()).take(MAX_COMPONENTS).map(shape).collect()
    }

    fn new(shapes: Vec<Shape>, dimension: usize) -> Option<Self> {
        let mut components: Vec<Component> =
            shapes.into_iter().filter_map(|shape| component(shape, dimension)).collect();
        let total: f64 = components.iter().map(|component| component.upper).sum();
        let mut upper = 0.0;
        for component in &mut components {
            let weight = component.upper / total;
            component.log_weight += weight.ln();
            upper += weight;
            component.upper = upper;
        }
        (!components.is_empty()).then_some(Self { dimension, components })
    }

    /// ln q up to a constant.
    fn log_density(&self, point: &[f64]) -> f64 {
        let term =
            |component: &Component| component.log_weight + self.exponent() * growth(component.distance2(point)).ln();
        let top = self.components.iter().map(term).fold(f64::NEG_INFINITY, f64::max);
        top + self.components.iter().map(|component| (term(component) - top).exp()).sum::<f64>().ln()
    }

    /// Power of 1 + r²/ν in the density.
    fn exponent(&self) -> f64 {
        -0.5 * (DEGREES_OF_FREEDOM + self.dimension as f64)
    }

    /// Replaces a point by a draw; returns ln q(point) − ln q(draw).
    #[inline]
    fn jump(&self, stream: &mut RandomStream, point: &mut [f64], noise: &mut [f64]) -> f64 {
        if let [only] = &self.components[..] {
            // With one component constants cancel, one logarithm is enough and the draw's distance is that of its noise.
            let before = growth(only.distance2(point));
            self.draw(stream, point, noise);
            let after = growth(noise.iter().map(|z| z * z).sum());
            return self.exponent() * (before / after).ln();
        }
        let before = self.log_density(point);
        self.draw(stream, point, noise);
        before - self.log_density(point)
    }

    fn draw(&self, stream: &mut RandomStream, point: &mut [f64], noise: &mut [f64]) {
        let u = stream.unit();
        let chosen = self.components.iter().position(|component| u < component.upper);
        let component = &self.components[chosen.unwrap_or(self.components.len() - 1)];
        let product = stream.unit() * stream.unit() * stream.unit();
        let stretch = (DEGREES_OF_FREEDOM / (-2.0 * product.ln())).sqrt();
        noise.iter_mut().for_each(|z| *z = stretch * stream.normal());
        let n = self.dimension;
        for (i, x) in point.iter_mut().enumerate() {
            let row = &component.spread[i * n..=i * n + i];
            *x = component.location[i] + row.iter().zip(&*noise).map(|(l, z)| l * z).sum::<f64>();
        }
    }
}

/// 1 + r²/ν.
fn growth(distance2: f64) -> f64 {
    1.0 + distance2 / DEGREES_OF_FREEDOM
}

impl Component {
    /// |L⁻¹(y − m)|².
    fn distance2(&self, point: &[f64]) -> f64 {
        let n = point.len();
        let row = |i: usize| -> f64 {
            let entries = self.whiten[i * n..=i * n + i].iter();
            entries.zip(point).zip(&self.location).map(|((l, x), m)| l * (x - m)).sum()
        };
        (0..n).map(|i| row(i).powi(2)).sum()
    }
}

fn component(shape: Shape, dimension: usize) -> Option<Component> {
    let spread = shape.covariance.cholesky()?.l();
    let whiten = spread.solve_lower_triangular(&DMatrix::identity(dimension, dimension))?;
    let log_det: f64 = spread.diagonal().iter().map(|l| l.ln()).sum();
    let rows = |matrix: DMatrix<f64>| matrix.transpose().as_slice().to_vec();
    let finite = log_det.is_finite() && whiten.iter().chain(&spread).all(|x| x.is_finite());
    finite.then(|| Component {
        // Holds the weight until all weights are known.
        upper: shape.weight.max(SMALLEST_WEIGHT),
        location: shape.location,
        spread: rows(spread),
        whiten: rows(whiten),
        log_weight: -log_det,
    })
}

fn moments(points: &[&Vec<f64>], dimension: usize) -> Option<(Vec<f64>, DMatrix<f64>)> {
    let n = points.len() as f64;
    let mean: Vec<f64> = (0..dimension).map(|d| points.iter().map(|point| point[d]).sum::<f64>() / n).collect();
    let mut covariance = DMatrix::zeros(dimension, dimension);
    for point in points {
        for i in 0..dimension {
            for j in 0..=i {
                covariance[(i, j)] += (point[i] - mean[i]) * (point[j] - mean[j]) / n;
            }
        }
    }
    covariance.fill_upper_triangle_with_lower_triangle();
    // Not positive definite (walkers in a plane, overflow): the Laplace approximation stays.
    covariance.clone().cholesky().map(|_| (mean, covariance))
}

impl Move for Independence {
    fn name(&self) -> String {
        format!("independence(components={})", self.components.len())
    }

    fn propose(
        &self,
        moving: Points,
        _complement: Points,
        _shared: &mut RandomStream,
        own: &mut [RandomStream],
        proposals: &mut [f64],
        log_factors: &mut [f64],
    ) {
        // Work space on the stack for the usual dimensions, so that the hot loop allocates nothing.
        let mut few = [0.0; 2 * 16];
        let mut many;
        let space = if self.dimension <= 16 {
            &mut few[..2 * self.dimension]
        } else {
            many = vec![0.0; 2 * self.dimension];
            &mut many[..]
        };
        let (point, noise) = space.split_at_mut(self.dimension);
        let n = moving.n;
        for (i, stream) in own.iter_mut().enumerate() {
            point.iter_mut().enumerate().for_each(|(d, x)| *x = moving.coordinates[d * n + i]);
            log_factors[i] = self.jump(stream, point, noise);
            point.iter().enumerate().for_each(|(d, x)| proposals[d * n + i] = *x);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inference::optimum::Optimum;

    fn two_modes() -> Modes {
        let mut modes = Modes::default();
        for (location, precision) in [(0.0, 4.0), (30.0, 0.25)] {
            modes.add(&Optimum {
                location: vec![location, 1.0],
                log_density: 0.0,
                precision: vec![precision, 0.3, 0.3, 1.0],
                converged: true,
            });
        }
        modes
    }

    /// The density must be that of the draws: importance weights of a normalised Gaussian inside either component average to
    /// one, with a standard error found from the weights themselves (six of which are allowed).
    #[test]
    fn density_belongs_to_the_draws() {
        let q = Independence::from_modes(&two_modes(), 2).unwrap();
        let mut stream = RandomStream::new(8, 0);
        let n_draws = 200_000;
        for (centre, sd) in [([0.2, 1.0], [0.3, 0.7]), ([30.0, 0.5], [1.5, 0.6])] {
            let mut weights = Vec::with_capacity(n_draws);
            let (mut point, mut noise) = ([0.0; 2], [0.0; 2]);
            for _ in 0..n_draws {
                q.draw(&mut stream, &mut point, &mut noise);
                let r2: f64 = (0..2).map(|d| ((point[d] - centre[d]) / sd[d]).powi(2)).sum();
                // t₆ in two dimensions is normalised by Γ(4)/(Γ(3)·6π) = 1/2π, as the Gaussian is.
                weights.push((-0.5 * r2 - (sd[0] * sd[1]).ln() - q.log_density(&point)).exp());
            }
            let mean = weights.iter().sum::<f64>() / n_draws as f64;
            let variance = weights.iter().map(|w| (w - mean).powi(2)).sum::<f64>() / n_draws as f64;
            let error = (variance / n_draws as f64).sqrt();
            assert!((mean - 1.0).abs() < 6.0 * error && error < 0.01, "{mean} ± {error}");
        }
    }

    #[test]
    fn the_short_way_of_one_component_is_the_long_one() {
        let mut modes = Modes::default();
        modes.add(&Optimum {
            location: vec![1.0, 2.0],
            log_density: 0.0,
            precision: vec![3.0, 1.0, 1.0, 2.0],
            converged: true,
        });
        let q = Independence::from_modes(&modes, 2).unwrap();
        let mut stream = RandomStream::new(3, 1);
        for _ in 0..100 {
            let before = [stream.normal(), 5.0 * stream.normal()];
            let (mut point, mut noise) = (before, [0.0; 2]);
            let factor = q.jump(&mut stream, &mut point, &mut noise);
            assert!((factor - (q.log_density(&before) - q.log_density(&point))).abs() < 1e-12);
        }
    }

    #[test]
    fn fitting_takes_the_draws_moments() {
        let modes = two_modes();
        let mut stream = RandomStream::new(9, 0);
        let points: Vec<Vec<f64>> = (0..2_000).map(|_| vec![1.0 + 0.1 * stream.normal(), stream.normal()]).collect();
        let q = Independence::fitted(&modes, 2, &points).unwrap();
        let narrow = q.components.iter().find(|component| component.spread[0] < 0.2).unwrap();
        assert!((narrow.location[0] - 1.0).abs() < 0.02 && (narrow.spread[0] - 0.1).abs() < 0.01);
        assert_eq!(q.components.len(), 2);
    }
}
