//! Mixtures of multivariate t distributions that approximate a posterior and from which points can be drawn. Their heavy tails cover errors of the
//! approximation.
//!
//! The density is q(y) = Σ w_k t₆(y; m_k, S_k), with weight w_k, location m_k and scale matrix S_k of component k, and t₆ the t density with six
//! degrees of freedom. At first there is one component per mode. A refit to weighted draws is one step of expectation and maximisation. The refit
//! reduces the Kullback–Leibler divergence from the density that the weighted draws represent (Cappé et al. 2008, doi:10.1007/s11222-008-9059-x,
//! §3.2).

use crate::ensemble::RandomStream;
use crate::optimum::{Mode, Modes};
use base::elementary;
use nalgebra::DMatrix;
use pulp::{Arch, Simd, WithSimd};
use serde::{Deserialize, Serialize};
use statrs::function::gamma::ln_gamma;

/// Degrees of freedom of each component. With six, the tails are heavy enough to cover the error of a Laplace approximation. The number is even, so
/// that a χ² number can be drawn as −2 ln Π u from uniform numbers u.
const DEGREES_OF_FREEDOM: f64 = 6.0;
/// Smallest probability of drawing from a component, even if its weight is smaller.
const SMALLEST_WEIGHT: f64 = 0.02;
/// Number of draws per coordinate that [`TMixture::fitted`] needs to fit the shape of a component.
const DRAWS_PER_COORDINATE: usize = 100;
/// Largest number of modes that get a component, largest mass first. Each component adds cost to every proposal.
const MAX_COMPONENTS: usize = 8;
/// Number of draws per coordinate below which a refit drops a component. In a refit the component's former shape counts as this number of draws.
const FEWEST_DRAWS_PER_COORDINATE: f64 = 2.0;
/// Largest number of components of a grown mixture.
const MOST_GROWN_COMPONENTS: usize = 16;
/// Number of draws per coordinate and component that a growing mixture needs.
const GROWTH_DRAWS_PER_COORDINATE: usize = 20;
/// Number of expectation–maximisation steps after each doubling of a growing mixture.
const GROWTH_STEPS: usize = 20;
/// Smallest gain in mean log density of draws outside the fit, in nats, for which a growing mixture keeps further components. A posterior that is
/// nearly Gaussian keeps one component, which is evaluated fastest.
const SMALLEST_GROWTH_GAIN: f64 = 0.05;

/// Number of points that one pass of vector instructions processes together.
const BLOCK: usize = 16;

/// Mixture of multivariate t distributions with six degrees of freedom.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TMixture {
    dimension: usize,
    components: Vec<Component>,
}

/// One t distribution of a mixture, ready for evaluation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Component {
    /// Sum of the weights up to and including this component, in [0, 1]. A uniform number chooses the first component whose sum exceeds it.
    upper: f64,
    location: Vec<f64>,
    /// Lower triangular Cholesky factor L of the scale matrix L Lᵀ, row by row.
    spread: Vec<f64>,
    /// Inverse L⁻¹ of the Cholesky factor in `spread`, row by row.
    whiten: Vec<f64>,
    /// Logarithm of the component's weight divided by the determinant of `spread`. It omits the constant that all components share.
    log_weight: f64,
}

/// Weight, location and scale matrix of a component, from which [`component`] computes the factors for evaluation.
struct ComponentShape {
    weight: f64,
    location: Vec<f64>,
    covariance: DMatrix<f64>,
}

impl TMixture {
    /// Builds a mixture with one component per mode from the modes' Laplace approximations. `None` if no mode has a usable curvature.
    pub fn from_modes(modes: &Modes, dimension: usize) -> Option<Self> {
        Self::new(Self::laplace_shapes(modes, dimension), dimension)
    }

    /// Builds a mixture with one component per mode. A component's location and shape are fitted to the draws nearest to its mode, if there are
    /// enough of them. Each entry of `points` is one draw.
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

    fn laplace_shapes(modes: &Modes, dimension: usize) -> Vec<ComponentShape> {
        let shape = |(mode, weight): (&Mode, f64)| ComponentShape {
            weight,
            location: mode.location.clone(),
            covariance: DMatrix::from_row_slice(dimension, dimension, &mode.precision)
                .try_inverse()
                .unwrap_or_else(|| DMatrix::zeros(dimension, dimension)),
        };
        modes.iter().zip(modes.weights()).take(MAX_COMPONENTS).map(shape).collect()
    }

    fn new(shapes: Vec<ComponentShape>, dimension: usize) -> Option<Self> {
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

    /// Builds a mixture of one component with the mean and covariance of weighted points. The weights add up to one. `None` if the covariance is
    /// singular.
    pub fn from_moments(points: &[Vec<f64>], weights: &[f64]) -> Option<Self> {
        Self::new(vec![moments_of(points, weights)?], points.first()?.len())
    }

    /// Returns the mixture with further components at `centres`, which share half of the total weight. They have the covariance of the heaviest
    /// component.
    pub fn with_centres(&self, centres: &[Vec<f64>]) -> Self {
        let mut shapes = self.shapes();
        let heaviest = shapes.iter().max_by(|a, b| a.weight.total_cmp(&b.weight));
        let Some(covariance) = heaviest.map(|shape| shape.covariance.clone()) else { return self.clone() };
        shapes.iter_mut().for_each(|shape| shape.weight *= 0.5);
        let weight = 0.5 / centres.len().max(1) as f64;
        let added = centres.iter().map(|centre| ComponentShape {
            weight,
            location: centre.clone(),
            covariance: covariance.clone(),
        });
        shapes.extend(added);
        Self::new(shapes, self.dimension).unwrap_or_else(|| self.clone())
    }

    /// Returns the mixture with one more, wide component of weight `share`. The component has the mean of the weighted points, and their standard
    /// deviations multiplied by `stretch`.
    pub fn with_background(&self, points: &[Vec<f64>], weights: &[f64], share: f64, stretch: f64) -> Self {
        let Some(ComponentShape { location, covariance, .. }) = moments_of(points, weights) else {
            return self.clone();
        };
        let mut shapes = self.shapes();
        shapes.iter_mut().for_each(|shape| shape.weight *= 1.0 - share);
        shapes.push(ComponentShape { weight: share, location, covariance: covariance * (stretch * stretch) });
        Self::new(shapes, self.dimension).unwrap_or_else(|| self.clone())
    }

    /// Returns the mixture with the standard deviations of every component multiplied by `stretch`.
    pub fn stretched(&self, stretch: f64) -> Self {
        let mut shapes = self.shapes();
        shapes.iter_mut().for_each(|shape| shape.covariance *= stretch * stretch);
        Self::new(shapes, self.dimension).unwrap_or_else(|| self.clone())
    }

    /// Returns the mixture with as many further components as describe the draws `points` clearly better, for example on a curved ridge. Every second
    /// draw is fitted, the others judge the fit. New components start at draws that `stream` selects far from the present ones.
    pub fn grown(&self, points: &[Vec<f64>], stream: &mut RandomStream) -> Self {
        let every_second = |first: usize| points.iter().skip(first).step_by(2).cloned().collect::<Vec<_>>();
        let (fitted, others) = (every_second(0), every_second(1));
        let weights = vec![1.0 / fitted.len().max(1) as f64; fitted.len()];
        let score =
            |mixture: &Self| others.iter().map(|point| mixture.log_density(point)).sum::<f64>() / others.len() as f64;
        let mut best = self.clone();
        loop {
            let n_components = 2 * best.n_components();
            if n_components > MOST_GROWN_COMPONENTS
                || fitted.len() < n_components * GROWTH_DRAWS_PER_COORDINATE * self.dimension
            {
                return best;
            }
            let start = best.with_centres(&best.distant(&fitted, best.n_components(), stream));
            let grown = (0..GROWTH_STEPS).fold(start, |mixture, _| mixture.refitted(&fitted, &weights));
            let gain = score(&grown) - score(&best);
            if gain.is_nan() || gain < SMALLEST_GROWTH_GAIN {
                return best;
            }
            best = grown;
        }
    }

    /// Selects `n` of the points at random, with probabilities proportional to their squared scaled distances from the nearest component.
    fn distant(&self, points: &[Vec<f64>], n: usize, stream: &mut RandomStream) -> Vec<Vec<f64>> {
        let distance2 =
            |point: &Vec<f64>| self.components.iter().map(|c| c.distance2(point)).fold(f64::INFINITY, f64::min);
        let mut total = 0.0;
        let sums: Vec<f64> = points
            .iter()
            .map(|point| {
                total += distance2(point);
                total
            })
            .collect();
        let mut one = |_| {
            let u = total * stream.unit();
            points[sums.partition_point(|sum| *sum <= u).min(points.len() - 1)].clone()
        };
        (0..n).map(&mut one).collect()
    }

    /// Returns the mixture refitted to weighted points by one step of expectation and maximisation. The weights add up to one. A component with
    /// almost no points is dropped. A component with few points keeps part of its former shape.
    pub fn refitted(&self, points: &[Vec<f64>], weights: &[f64]) -> Self {
        let mut sums: Vec<WeightedSums> = self.components.iter().map(|_| WeightedSums::new(self.dimension)).collect();
        let mut terms = vec![0.0; self.components.len()];
        let mut distances2 = terms.clone();
        for (point, weight) in points.iter().zip(weights).filter(|(_, weight)| **weight > 0.0) {
            for (k, component) in self.components.iter().enumerate() {
                distances2[k] = component.distance2(point);
                terms[k] = component.log_weight + self.exponent() * growth(distances2[k]).ln();
            }
            let top = terms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let total: f64 = terms.iter().map(|term| (term - top).exp()).sum();
            for (k, sums) in sums.iter_mut().enumerate() {
                let share = weight * (terms[k] - top).exp() / total;
                let n = self.dimension as f64;
                sums.add(point, share, share * (DEGREES_OF_FREEDOM + n) / (DEGREES_OF_FREEDOM + distances2[k]));
            }
        }
        let fewest = FEWEST_DRAWS_PER_COORDINATE * self.dimension as f64;
        let refitted = self.shapes().into_iter().zip(&sums).filter_map(|(old, sums)| {
            let n_draws = sums.effective_draws();
            if n_draws < fewest {
                return None;
            }
            let (location, covariance) = sums.moments()?;
            let covariance = (covariance * n_draws + old.covariance * fewest) / (n_draws + fewest);
            Some(ComponentShape { weight: sums.total, location, covariance })
        });
        Self::new(refitted.collect(), self.dimension).unwrap_or_else(|| self.clone())
    }

    fn shapes(&self) -> Vec<ComponentShape> {
        let n = self.dimension;
        let mut lower = 0.0;
        let shape = |component: &Component| {
            let spread = DMatrix::from_row_slice(n, n, &component.spread);
            let weight = component.upper - lower;
            lower = component.upper;
            ComponentShape { weight, location: component.location.clone(), covariance: &spread * spread.transpose() }
        };
        self.components.iter().map(shape).collect()
    }

    /// Number of components.
    pub fn n_components(&self) -> usize {
        self.components.len()
    }

    /// Normalised log density of the mixture at a point.
    pub fn ln_density(&self, point: &[f64]) -> f64 {
        self.ln_constant() + self.log_density(point)
    }

    /// Normalisation constant: the difference of [`Self::ln_density`] and [`Self::log_density`].
    pub(super) fn ln_constant(&self) -> f64 {
        let n = self.dimension as f64;
        ln_gamma(0.5 * (DEGREES_OF_FREEDOM + n))
            - ln_gamma(0.5 * DEGREES_OF_FREEDOM)
            - 0.5 * n * (DEGREES_OF_FREEDOM * std::f64::consts::PI).ln()
    }

    /// The single component of the mixture; `None` if there are several.
    pub(super) fn only(&self) -> Option<&Component> {
        if let [only] = &self.components[..] { Some(only) } else { None }
    }

    /// Log density of the mixture at a point, without the normalisation constant [`Self::ln_constant`].
    pub(super) fn log_density(&self, point: &[f64]) -> f64 {
        let term =
            |component: &Component| component.log_weight + self.exponent() * growth(component.distance2(point)).ln();
        let terms: Vec<f64> = self.components.iter().map(term).collect();
        let top = terms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        top + terms.iter().map(|term| (term - top).exp()).sum::<f64>().ln()
    }

    /// Exponent −(ν + n)/2 of the factor 1 + r²/ν in a component's density. ν are the degrees of freedom, n the dimension and r the scaled distance
    /// from the location.
    pub(super) fn exponent(&self) -> f64 {
        -0.5 * (DEGREES_OF_FREEDOM + self.dimension as f64)
    }

    /// Draws a point from the mixture into `point`. Afterwards `noise` holds the point's position in its component, L⁻¹(y − m) for the point y, the
    /// location m and the Cholesky factor L. The slices have equal length.
    pub fn draw(&self, stream: &mut RandomStream, point: &mut [f64], noise: &mut [f64]) {
        let u = stream.unit();
        let chosen = self.components.iter().position(|component| u < component.upper);
        let component = &self.components[chosen.unwrap_or(self.components.len() - 1)];
        component.draw_step(stream, point, noise);
        point.iter_mut().zip(&component.location).for_each(|(x, m)| *x += m);
    }
}

/// Returns the factor 1 + r²/ν of a component's density, given the squared scaled distance r² from its location. ν are the degrees of freedom.
#[inline(always)]
pub(super) fn growth(distance2: f64) -> f64 {
    1.0 + distance2 / DEGREES_OF_FREEDOM
}

/// Input and output of drawing one point per random stream from a single component. Coordinate d of point i is at `d * n + i`, for n streams.
/// [`Jumps::draw`] reads each stream in the order of [`TMixture::draw`].
pub(super) struct Jumps<'a> {
    pub component: &'a Component,
    /// Exponent of the density ([`TMixture::exponent`]).
    pub exponent: f64,
    pub points: &'a [f64],
    pub draws: &'a mut [f64],
    /// Result for each point: its log density under the component minus the log density of its draw.
    pub log_factors: &'a mut [f64],
}

impl Jumps<'_> {
    /// Draws one point from each stream, and fills `draws` and `log_factors`.
    pub fn draw(self, streams: &mut [RandomStream]) {
        let n = streams.len();
        // The work space holds normal numbers in the layout of the points, followed by one row of products of uniform numbers.
        let mut space = vec![0.0; self.points.len() + n];
        let (noise, products) = space.split_at_mut(self.points.len());
        for (i, stream) in streams.iter_mut().enumerate() {
            // `draw` reads this word to choose a component. It is read here as well, so that both functions give equal draws.
            stream.word();
            products[i] = stream.unit() * stream.unit() * stream.unit();
            noise.iter_mut().skip(i).step_by(n).for_each(|z| *z = stream.normal());
        }
        Arch::new().dispatch(JumpsOfNoise { jumps: self, noise, products, n });
    }
}

struct JumpsOfNoise<'a> {
    jumps: Jumps<'a>,
    noise: &'a mut [f64],
    products: &'a mut [f64],
    n: usize,
}

impl WithSimd for JumpsOfNoise<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { jumps: Jumps { component, exponent, points, draws, log_factors }, noise, products, n } = self;
        let dimension = component.location.len();
        // The squared distances of the draws overwrite `products`. The squared distances of the points are stored in `log_factors`.
        for product in products.iter_mut() {
            *product = (DEGREES_OF_FREEDOM / (-2.0 * elementary::ln(*product))).sqrt();
        }
        for d in 0..dimension {
            for i in 0..n {
                noise[d * n + i] *= products[i];
            }
        }
        products.fill(0.0);
        log_factors.fill(0.0);
        for d in 0..dimension {
            let draws = &mut draws[d * n..(d + 1) * n];
            let (spread, whiten) = (&component.spread[d * dimension..], &component.whiten[d * dimension..]);
            // Each pass computes two sums in blocks that stay in registers: the draw's coordinate, and the point's position L⁻¹(y − m) for the point
            // y, location m and factor L.
            let mut first = 0;
            while first < n {
                let width = if n - first < BLOCK { n - first } else { BLOCK };
                let (mut steps, mut places) = ([0.0; BLOCK], [0.0; BLOCK]);
                for e in 0..=d {
                    let (noise, points) = (&noise[e * n + first..][..width], &points[e * n + first..][..width]);
                    for k in 0..width {
                        steps[k] += spread[e] * noise[k];
                        places[k] += whiten[e] * (points[k] - component.location[e]);
                    }
                }
                for k in 0..width {
                    let z = noise[d * n + first + k];
                    draws[first + k] = steps[k] + component.location[d];
                    products[first + k] += z * z;
                    log_factors[first + k] += places[k] * places[k];
                }
                first += width;
            }
        }
        for i in 0..n {
            log_factors[i] = exponent * elementary::ln(growth(log_factors[i]) / growth(products[i]));
        }
    }
}

impl Component {
    fn draw_step(&self, stream: &mut RandomStream, step: &mut [f64], noise: &mut [f64]) {
        let product = stream.unit() * stream.unit() * stream.unit();
        let stretch = (DEGREES_OF_FREEDOM / (-2.0 * product.ln())).sqrt();
        noise.iter_mut().for_each(|z| *z = stretch * stream.normal());
        let n = step.len();
        for (i, x) in step.iter_mut().enumerate() {
            let row = &self.spread[i * n..=i * n + i];
            *x = row.iter().zip(&*noise).map(|(l, z)| l * z).sum();
        }
    }

    /// Squared scaled distance |L⁻¹(y − m)|² of a point y from the component's location m, with the Cholesky factor L of the scale matrix.
    pub(super) fn distance2(&self, point: &[f64]) -> f64 {
        let n = point.len();
        let row = |i: usize| -> f64 {
            let entries = self.whiten[i * n..=i * n + i].iter();
            entries.zip(point).zip(&self.location).map(|((l, x), m)| l * (x - m)).sum()
        };
        (0..n).map(|i| row(i).powi(2)).sum()
    }
}

fn component(shape: ComponentShape, dimension: usize) -> Option<Component> {
    let spread = shape.covariance.cholesky()?.l();
    let whiten = spread.solve_lower_triangular(&DMatrix::identity(dimension, dimension))?;
    let log_det: f64 = spread.diagonal().iter().map(|l| l.ln()).sum();
    let rows = |matrix: DMatrix<f64>| matrix.transpose().as_slice().to_vec();
    let finite = log_det.is_finite() && whiten.iter().chain(&spread).all(|x| x.is_finite());
    finite.then(|| Component {
        // This field holds the weight until all weights are known.
        upper: shape.weight.max(SMALLEST_WEIGHT),
        location: shape.location,
        spread: rows(spread),
        whiten: rows(whiten),
        log_weight: -log_det,
    })
}

/// Returns the mean and covariance matrix of weighted points as a component of weight 1. The weights add up to one. `None` if there are no points, or
/// if they lie in a plane.
fn moments_of(points: &[Vec<f64>], weights: &[f64]) -> Option<ComponentShape> {
    let mut sums = WeightedSums::new(points.first()?.len());
    points
        .iter()
        .zip(weights)
        .filter(|(_, weight)| **weight > 0.0)
        .for_each(|(point, weight)| sums.add(point, *weight, *weight));
    let (location, covariance) = sums.moments()?;
    Some(ComponentShape { weight: 1.0, location, covariance })
}

/// Sums over weighted points from which a component is fitted. Each point has a *pull*: its weight × (ν + n)/(ν + r²), with ν the degrees of freedom,
/// n the dimension and r the scaled distance. Distant points therefore count less.
struct WeightedSums {
    /// Sum of the weights.
    total: f64,
    /// Sum of the squared weights.
    squares: f64,
    /// Sum of the pulls, the reduced weights of the points.
    pull: f64,
    /// Sum of pull · (x − origin) over the points x.
    first: Vec<f64>,
    /// Sum of pull · (x − origin)(x − origin)ᵀ over the points x; only the lower triangle is set.
    second: DMatrix<f64>,
    /// First point, which is subtracted from all points so that the sums lose no significant digits.
    origin: Vec<f64>,
}

impl WeightedSums {
    fn new(dimension: usize) -> Self {
        let (first, second) = (vec![0.0; dimension], DMatrix::zeros(dimension, dimension));
        Self { total: 0.0, squares: 0.0, pull: 0.0, first, second, origin: Vec::new() }
    }

    fn add(&mut self, point: &[f64], weight: f64, pull: f64) {
        if self.origin.is_empty() {
            self.origin = point.to_vec();
        }
        self.total += weight;
        self.squares += weight * weight;
        self.pull += pull;
        for i in 0..point.len() {
            let away = pull * (point[i] - self.origin[i]);
            self.first[i] += away;
            for (j, (x, origin)) in point.iter().zip(&self.origin).take(i + 1).enumerate() {
                self.second[(i, j)] += away * (x - origin);
            }
        }
    }

    fn effective_draws(&self) -> f64 {
        if self.squares > 0.0 { self.total * self.total / self.squares } else { 0.0 }
    }

    /// Computes the location and the scale matrix of a component from the sums. `None` if the scale matrix is not positive definite, because points
    /// lie in a plane or sums overflow.
    fn moments(&self) -> Option<(Vec<f64>, DMatrix<f64>)> {
        let n = self.first.len();
        let mean: Vec<f64> = self.first.iter().map(|sum| sum / self.pull).collect();
        let mut covariance = DMatrix::from_fn(n, n, |i, j| {
            let (i, j) = (i.max(j), i.min(j));
            (self.second[(i, j)] - self.pull * mean[i] * mean[j]) / self.total
        });
        covariance.fill_upper_triangle_with_lower_triangle();
        covariance.clone().cholesky()?;
        Some((mean.iter().zip(&self.origin).map(|(mean, origin)| origin + mean).collect(), covariance))
    }
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
    // If the covariance is not positive definite, the component keeps the Laplace approximation. The cause is points in a plane or overflow.
    covariance.clone().cholesky().map(|_| (mean, covariance))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimum::Optimum;

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

    /// Checks that draws follow the density: for a normalised Gaussian inside either component, importance weights of the draws average to one. The
    /// tolerance is six standard errors, estimated from the weights.
    #[test]
    fn density_belongs_to_the_draws() {
        let q = TMixture::from_modes(&two_modes(), 2).unwrap();
        let mut stream = RandomStream::new(8, 0);
        let n_draws = 200_000;
        for (centre, sd) in [([0.2, 1.0], [0.3, 0.7]), ([30.0, 0.5], [1.5, 0.6])] {
            let mut weights = Vec::with_capacity(n_draws);
            let (mut point, mut noise) = ([0.0; 2], [0.0; 2]);
            for _ in 0..n_draws {
                q.draw(&mut stream, &mut point, &mut noise);
                let r2: f64 = (0..2).map(|d| ((point[d] - centre[d]) / sd[d]).powi(2)).sum();
                let ln_gaussian = -0.5 * r2 - (sd[0] * sd[1]).ln() - std::f64::consts::TAU.ln();
                weights.push((ln_gaussian - q.ln_density(&point)).exp());
            }
            let mean = weights.iter().sum::<f64>() / n_draws as f64;
            let variance = weights.iter().map(|w| (w - mean).powi(2)).sum::<f64>() / n_draws as f64;
            let error = (variance / n_draws as f64).sqrt();
            assert!((mean - 1.0).abs() < 6.0 * error && error < 0.01, "{mean} ± {error}");
        }
    }

    #[test]
    fn fitting_takes_the_draws_moments() {
        let modes = two_modes();
        let mut stream = RandomStream::new(9, 0);
        let points: Vec<Vec<f64>> = (0..2_000).map(|_| vec![1.0 + 0.1 * stream.normal(), stream.normal()]).collect();
        let q = TMixture::fitted(&modes, 2, &points).unwrap();
        let narrow = q.components.iter().find(|component| component.spread[0] < 0.2).unwrap();
        assert!((narrow.location[0] - 1.0).abs() < 0.02 && (narrow.spread[0] - 0.1).abs() < 0.01);
        assert_eq!(q.components.len(), 2);
    }

    /// A banana of relative width 0.1 needs several components, a Gaussian one. The grown mixture must describe new draws better, not only its own.
    #[test]
    fn a_mixture_grows_on_a_curved_ridge_only() {
        let mut stream = RandomStream::new(10, 0);
        let mut draws = |bend: f64| -> Vec<Vec<f64>> {
            let mut one = |_| {
                let along = stream.normal();
                vec![along, bend * along * along + 0.1 * stream.normal()]
            };
            (0..8_000).map(&mut one).collect()
        };
        for (bend, grows) in [(0.0, false), (1.0, true)] {
            let (points, new) = (draws(bend), draws(bend));
            let one = TMixture::from_moments(&points, &vec![1.0 / 8_000.0; 8_000]).unwrap();
            let grown = one.grown(&points, &mut RandomStream::new(11, 0));
            assert_eq!(grown.n_components() > 1, grows, "{}", grown.n_components());
            let gain = new.iter().map(|x| grown.ln_density(x) - one.ln_density(x)).sum::<f64>() / 8_000.0;
            assert_eq!(gain > 0.5, grows, "{gain}");
        }
    }
}
