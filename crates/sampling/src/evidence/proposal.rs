//! Proposal distributions for posteriors with funnels and curved ridges. A triangular map transforms a mixture of t distributions.
//!
//! In a funnel, the spread of some coordinates depends on other coordinates; on a curved ridge, their location does. A few ellipses cannot describe
//! such a posterior. The map orders the coordinates x by standard deviation, largest first. Let y be the coordinates before coordinate d in this
//! order. Then
//!
//! x_d = μ_d(y) + exp(λ_d(y)) w_d,
//!
//! where the location μ is a sum of parabolas, the log spread λ is linear and w are the mixture's coordinates. The functions μ and λ are fitted to
//! weighted draws by penalised likelihood, as if w were standard normal. The map is invertible for any coefficients, so a poor fit only makes the
//! draws less efficient.

use nalgebra::{DMatrix, DVector};

use super::weighted::{effective_size, resampled_indices};
use crate::ensemble::RandomStream;
use crate::t_mixture::TMixture;

/// Limit of a coordinate's deviation, in standard deviations, in its influence on later coordinates. It bounds the parabolas of the map.
const LARGEST_PULL: f64 = 4.0;
/// Number of passes that fit first the location and then the log spread of a coordinate.
const N_PASSES: usize = 3;
/// Number of Fisher scoring steps for the log spread in each pass.
const N_SPREAD_STEPS: usize = 3;
/// Prior standard deviation of the coefficients of a coordinate's log spread, in standardised coordinates.
const SPREAD_SLOPE_SD: f64 = 0.5;
/// Prior standard deviation of the coefficients of a coordinate's location, in standardised coordinates.
const LOCATION_SLOPE_SD: f64 = 1.0;
/// Smallest log spread of a coordinate. It prevents a standard deviation of zero for draws that lie in a plane.
const SMALLEST_LN_SPREAD: f64 = -12.0;
/// Number of mixture components that start at single draws. They are added to one component with the mean and covariance of all draws.
const ADDED_COMPONENTS: usize = 2;
/// Number of expectation–maximisation steps that fit the mixture of a proposal.
const FIT_STEPS: usize = 2;

/// Location and spread of one coordinate as functions of the coordinates before it in the map's order.
#[derive(Debug, Clone)]
struct Conditional {
    coordinate: usize,
    centre: f64,
    sd: f64,
    /// Coefficients of the location: a constant, then a linear and a quadratic coefficient for each earlier coordinate.
    location: Vec<f64>,
    /// Coefficients of the log spread: a constant, then one coefficient for each earlier coordinate.
    ln_spread: Vec<f64>,
}

impl Conditional {
    /// Returns the location and the log spread for standardised values of the earlier coordinates.
    fn at(&self, before: &[f64]) -> (f64, f64) {
        let (mut location, mut ln_spread) = (self.location[0], self.ln_spread[0]);
        for (j, y) in before.iter().enumerate() {
            let y = pull(*y);
            location += y * (self.location[1 + 2 * j] + y * self.location[2 + 2 * j]);
            ln_spread += y * self.ln_spread[1 + j];
        }
        (location, ln_spread.max(SMALLEST_LN_SPREAD))
    }
}

fn pull(y: f64) -> f64 {
    y.clamp(-LARGEST_PULL, LARGEST_PULL)
}

/// Triangular map from a mixture's coordinates w to points x of the posterior.
#[derive(Debug, Clone)]
pub struct Map {
    conditionals: Vec<Conditional>,
}

impl Map {
    /// Returns the identity map, by which points are equal to the mixture's coordinates.
    pub fn identity(dimension: usize) -> Self {
        let conditional = |coordinate: usize| Conditional {
            coordinate,
            centre: 0.0,
            sd: 1.0,
            location: vec![0.0; 1 + 2 * coordinate],
            ln_spread: vec![0.0; 1 + coordinate],
        };
        Self { conditionals: (0..dimension).map(conditional).collect() }
    }

    /// Fits the map to weighted points of the posterior. The weights add up to one. `None` if a coordinate does not vary.
    pub fn fitted(points: &[Vec<f64>], weights: &[f64]) -> Option<Self> {
        let dimension = points.first()?.len();
        let moments = |d: usize| {
            let mean: f64 = points.iter().zip(weights).map(|(x, w)| w * x[d]).sum();
            (mean, points.iter().zip(weights).map(|(x, w)| w * (x[d] - mean).powi(2)).sum::<f64>().sqrt())
        };
        let moments: Vec<(f64, f64)> = (0..dimension).map(moments).collect();
        if !moments.iter().all(|(mean, sd)| mean.is_finite() && *sd > 0.0 && sd.is_finite()) {
            return None;
        }
        let mut order: Vec<usize> = (0..dimension).collect();
        order.sort_by(|a, b| moments[*b].1.total_cmp(&moments[*a].1));
        let used: Vec<usize> = (0..points.len()).filter(|i| weights[*i] > 0.0).collect();
        let n_effective = effective_size(weights);
        let counts: Vec<f64> = used.iter().map(|i| n_effective * weights[*i]).collect();
        // Rows are standardised coordinates in the map's order; columns are points.
        let standard = DMatrix::from_fn(dimension, used.len(), |k, i| {
            (points[used[i]][order[k]] - moments[order[k]].0) / moments[order[k]].1
        });
        let conditional = |k: usize| {
            let (location, ln_spread) = fit_conditional(&standard, k, &counts)?;
            let (centre, sd) = moments[order[k]];
            Some(Conditional { coordinate: order[k], centre, sd, location, ln_spread })
        };
        Some(Self { conditionals: (0..dimension).map(conditional).collect::<Option<_>>()? })
    }

    /// Returns the point x for the mixture's coordinates w, and the log Jacobian determinant ln |dx/dw|.
    pub fn point(&self, w: &[f64]) -> (Vec<f64>, f64) {
        let mut before = Vec::with_capacity(w.len());
        let (mut x, mut ln_volume) = (vec![0.0; w.len()], 0.0);
        for (conditional, w) in self.conditionals.iter().zip(w) {
            let (location, ln_spread) = conditional.at(&before);
            let y = location + ln_spread.exp() * w;
            x[conditional.coordinate] = conditional.centre + conditional.sd * y;
            ln_volume += conditional.sd.ln() + ln_spread;
            before.push(y);
        }
        (x, ln_volume)
    }

    /// Returns the mixture's coordinates w for a point x, and the log Jacobian determinant ln |dx/dw|.
    pub fn to_mixture_coordinates(&self, x: &[f64]) -> (Vec<f64>, f64) {
        let mut before = Vec::with_capacity(x.len());
        let (mut w, mut ln_volume) = (Vec::with_capacity(x.len()), 0.0);
        for conditional in &self.conditionals {
            let (location, ln_spread) = conditional.at(&before);
            let y = (x[conditional.coordinate] - conditional.centre) / conditional.sd;
            w.push((y - location) * (-ln_spread).exp());
            ln_volume += conditional.sd.ln() + ln_spread;
            before.push(y);
        }
        (w, ln_volume)
    }
}

/// Fits the location and the log spread of row k of the standardised coordinates as functions of the rows before it. Columns are points with weights
/// `counts`. Returns the coefficients of the location and of the log spread.
fn fit_conditional(standard: &DMatrix<f64>, k: usize, counts: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
    let n = counts.len();
    let linear = DMatrix::from_fn(1 + k, n, |row, i| if row == 0 { 1.0 } else { pull(standard[(row - 1, i)]) });
    let parabolas = DMatrix::from_fn(1 + 2 * k, n, |row, i| match row {
        0 => 1.0,
        row if row % 2 == 1 => linear[(row.div_ceil(2), i)],
        row => linear[(row / 2, i)].powi(2),
    });
    let target: Vec<f64> = standard.row(k).iter().copied().collect();
    let mut location = DVector::zeros(1 + 2 * k);
    let mut ln_spread = DVector::zeros(1 + k);
    let information =
        penalised(&weighted_squares(&linear, &counts.iter().map(|c| 2.0 * c).collect::<Vec<_>>()), SPREAD_SLOPE_SD);
    let information = information.cholesky()?;
    for pass in 0..N_PASSES {
        let precisions: Vec<f64> =
            (0..n).map(|i| (-2.0 * linear.column(i).dot(&ln_spread).max(SMALLEST_LN_SPREAD)).exp()).collect();
        let pulls: Vec<f64> = counts.iter().zip(&precisions).map(|(count, precision)| count * precision).collect();
        let squares = penalised(&weighted_squares(&parabolas, &pulls), LOCATION_SLOPE_SD);
        let right = &parabolas * DVector::from_iterator(n, pulls.iter().zip(&target).map(|(pull, y)| pull * y));
        location = squares.cholesky()?.solve(&right);
        let residuals2: Vec<f64> = (0..n).map(|i| (target[i] - parabolas.column(i).dot(&location)).powi(2)).collect();
        if pass == 0 {
            let total: f64 = counts.iter().sum();
            let mean = residuals2.iter().zip(counts).map(|(r2, count)| r2 * count).sum::<f64>() / total;
            ln_spread[0] = (0.5 * mean.ln()).max(SMALLEST_LN_SPREAD);
        }
        // Fisher scoring steps minimise Σ counts (λ + r² e^(−2λ) / 2), with the log spread λ and the residual r of each point.
        for _ in 0..N_SPREAD_STEPS {
            let mut slope = DVector::from_fn(1 + k, |row, _| {
                if row == 0 { 0.0 } else { -ln_spread[row] / (SPREAD_SLOPE_SD * SPREAD_SLOPE_SD) }
            });
            for ((features, count), residual2) in linear.column_iter().zip(counts).zip(&residuals2) {
                let lambda = features.dot(&ln_spread).max(SMALLEST_LN_SPREAD);
                slope.axpy(count * (residual2 * (-2.0 * lambda).exp() - 1.0), &features, 1.0);
            }
            let change = information.solve(&slope);
            let largest = change.amax().max(1.0);
            ln_spread += change / largest;
        }
    }
    let is_finite = location.iter().chain(ln_spread.iter()).all(|x| x.is_finite());
    is_finite.then(|| (location.as_slice().to_vec(), ln_spread.as_slice().to_vec()))
}

/// Returns the matrix Σ wᵢ fᵢ fᵢᵀ, where fᵢ is column i of `features` and wᵢ its weight.
fn weighted_squares(features: &DMatrix<f64>, weights: &[f64]) -> DMatrix<f64> {
    let mut weighted = features.clone();
    for (mut column, weight) in weighted.column_iter_mut().zip(weights) {
        column *= *weight;
    }
    weighted * features.transpose()
}

/// Adds the precision 1/sd² of a normal prior to the diagonal of a matrix, except in its first row, which belongs to the constant.
fn penalised(squares: &DMatrix<f64>, sd: f64) -> DMatrix<f64> {
    let mut sum = squares.clone();
    (1..sum.nrows()).for_each(|k| sum[(k, k)] += 1.0 / (sd * sd));
    sum
}

/// Proposal distribution: a mixture of t distributions, transformed by a map.
#[derive(Debug, Clone)]
pub struct Proposal {
    /// Map from the mixture's coordinates to points.
    pub map: Map,
    mixture: TMixture,
    /// Constant term that is added to the mixture's unnormalised log density.
    ln_constant: f64,
}

impl Proposal {
    fn new(map: Map, mixture: TMixture) -> Self {
        Self { map, ln_constant: mixture.ln_constant(), mixture }
    }

    /// Makes a proposal without transformation, whose points are the mixture's coordinates.
    pub fn plain(mixture: TMixture, dimension: usize) -> Self {
        Self::new(Map::identity(dimension), mixture)
    }

    /// Fits the map and then the mixture to weighted points. The weights add up to one. `None` if the fit fails, for example because the points lie
    /// in a plane.
    pub fn fitted(points: &[Vec<f64>], weights: &[f64], stream: &mut RandomStream) -> Option<Self> {
        let map = Map::fitted(points, weights)?;
        let straight: Vec<Vec<f64>> = points.iter().map(|x| map.to_mixture_coordinates(x).0).collect();
        let centres: Vec<Vec<f64>> =
            resampled_indices(weights, ADDED_COMPONENTS, stream).into_iter().map(|i| straight[i].clone()).collect();
        let start = TMixture::from_moments(&straight, weights)?.with_centres(&centres);
        let mixture = (0..FIT_STEPS).fold(start, |mixture, _| mixture.refitted(&straight, weights));
        Some(Self::new(map, mixture))
    }

    /// Returns the proposal with one more, wide component of weight `share`. In the mixture's coordinates, the component has the mean of the weighted
    /// points, and their standard deviations multiplied by `stretch`.
    pub fn with_background(&self, points: &[Vec<f64>], weights: &[f64], share: f64, stretch: f64) -> Self {
        let straight: Vec<Vec<f64>> = points.iter().map(|x| self.map.to_mixture_coordinates(x).0).collect();
        let mixture = self.mixture.with_background(&straight, weights, share, stretch);
        Self::new(self.map.clone(), mixture)
    }

    /// Draws n points from the proposal.
    pub fn draw(&self, n: usize, dimension: usize, stream: &mut RandomStream) -> Vec<Vec<f64>> {
        let (mut w, mut noise) = (vec![0.0; dimension], vec![0.0; dimension]);
        let mut one = |_| {
            self.mixture.draw(stream, &mut w, &mut noise);
            self.map.point(&w).0
        };
        (0..n).map(&mut one).collect()
    }

    /// Normalised log density of the proposal at a point.
    pub fn ln_density(&self, x: &[f64]) -> f64 {
        let (w, ln_volume) = self.map.to_mixture_coordinates(x);
        self.ln_constant + self.mixture.log_density(&w) - ln_volume
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns draws from a funnel with their weights: x₁ = 3y and x₀ = 0.1 + 0.05 y² + 0.01 e^(y/2) z. Here y and z are independent standard
    /// normals. The map puts x₁ first.
    fn funnel() -> (Vec<Vec<f64>>, Vec<f64>) {
        let mut stream = RandomStream::new(5, 0);
        let mut one = |_| {
            let wide = 3.0 * stream.normal();
            let narrow = 0.1 + 0.05 * (wide / 3.0).powi(2) + 0.01 * (wide / 6.0).exp() * stream.normal();
            vec![narrow, wide]
        };
        let points: Vec<Vec<f64>> = (0..5_000).map(&mut one).collect();
        let weights = vec![1.0 / 5_000.0; 5_000];
        (points, weights)
    }

    #[test]
    fn going_there_and_back_is_the_identity() {
        let (points, weights) = funnel();
        let map = Map::fitted(&points, &weights).expect("spread");
        for point in points.iter().step_by(100).chain([&vec![5.0, -40.0]]) {
            let (w, ln_volume) = map.to_mixture_coordinates(point);
            let (back, same) = map.point(&w);
            assert!(back.iter().zip(point).all(|(a, b)| (a - b).abs() < 1e-9 * (1.0 + b.abs())), "{back:?} {point:?}");
            assert!((ln_volume - same).abs() < 1e-9);
        }
    }

    /// Compares the map's ln |dx/dw| with the determinant of a matrix of difference quotients.
    #[test]
    fn volumes_are_those_of_the_map_s_derivative() {
        let (points, weights) = funnel();
        let map = Map::fitted(&points, &weights).expect("spread");
        for w in [[0.3, -0.4], [-1.2, 2.0], [2.1, 0.7]] {
            let step = 1e-5;
            let column = |d: usize| {
                let shifted =
                    |by: f64| map.point(&std::array::from_fn::<f64, 2, _>(|k| w[k] + if k == d { by } else { 0.0 })).0;
                let (up, down) = (shifted(step), shifted(-step));
                [(up[0] - down[0]) / (2.0 * step), (up[1] - down[1]) / (2.0 * step)]
            };
            let (a, b) = (column(0), column(1));
            let determinant: f64 = a[0] * b[1] - a[1] * b[0];
            assert!((determinant.abs().ln() - map.point(&w).1).abs() < 1e-6);
        }
    }

    /// Checks that the map transforms the draws to standard normals with independent spreads. For 5,000 draws the standard errors are 0.014 for
    /// means, 0.010 for standard deviations and about 0.03 for the correlation of squares. The tolerance is six standard errors.
    #[test]
    fn a_funnel_is_made_straight() {
        let (points, weights) = funnel();
        let map = Map::fitted(&points, &weights).expect("spread");
        let straight: Vec<Vec<f64>> = points.iter().map(|x| map.to_mixture_coordinates(x).0).collect();
        let mean = |of: &dyn Fn(&[f64]) -> f64| straight.iter().map(|w| of(w)).sum::<f64>() / 5_000.0;
        for d in 0..2 {
            assert!(mean(&|w| w[d]).abs() < 0.09 && (mean(&|w| w[d] * w[d]).sqrt() - 1.0).abs() < 0.06);
        }
        assert!(mean(&|w| w[0] * w[1]).abs() < 0.09);
        assert!(mean(&|w| w[0] * (w[1] * w[1] - 1.0)).abs() < 0.15);
        assert!(mean(&|w| w[1] * (w[0] * w[0] - 1.0)).abs() < 0.15);
    }
}
