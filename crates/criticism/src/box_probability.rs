//! Logarithm of the probability that a normal vector lies in a box. The probability may be arbitrarily small.
//!
//! The covariance is factorised as LLᵀ. Coordinates are drawn one after another, each between the box's ends given the earlier coordinates. A draw's weight is the
//! product of the probabilities of these intervals, and the probability of the box is the mean weight (Genz, *J. Comput. Graph. Stat.* 1, 141, 1992). The draws are
//! shifted by the vector μ at the saddle point of the log weight. All weights are then nearly equal, however far in the tail the box lies (Botev, *J. R. Stat. Soc. B*
//! 79, 125, 2017, doi:10.1111/rssb.12162). Fixed points replace random numbers, so equal boxes have equal probabilities. The probability is exact for one coordinate.

use std::f64::consts::{FRAC_1_SQRT_2, PI, SQRT_2, TAU};

use nalgebra::{DMatrix, DVector};
use statrs::function::erf::{erf, erfc, erfc_inv};

/// Distance from a coordinate's mean, in standard deviations, beyond which an end of the box hardly matters. The mean is conditional on the other coordinates being in
/// the box. All but 10⁻¹² of the coordinate's probability lies closer.
const FAR_SD: f64 = 7.0;
/// Number of points if one coordinate is drawn (`N_ALONE`), along each coordinate if two are drawn (`N_EACH_OF_TWO`), and in total if more are drawn (`N_OF_MORE`).
const N_ALONE: usize = 96;
const N_EACH_OF_TWO: usize = 24;
const N_OF_MORE: usize = 2048;
/// Norm of the log weight's slope at which the search for the saddle point ends.
const LEAST_SLOPE: f64 = 1e-9;
const MOST_STEPS: usize = 60;

/// Returns the log probability ln P(lower ≤ x ≤ upper) of a normal vector x with mean 0. Ends may be infinite. Returns −∞ if the matrix is not a covariance.
pub(super) fn ln_box_probability(covariance: &DMatrix<f64>, lower: &[f64], upper: &[f64]) -> f64 {
    let mut left: Vec<usize> = (0..lower.len()).collect();
    let mut sum = 0.0;
    // The first remaining coordinate and those correlated with it, directly or through others, form a group. All other coordinates are independent of the group.
    while let Some(first) = left.first() {
        let mut together = vec![*first];
        let mut next = 0;
        while let Some(one) = together.get(next).copied() {
            let linked = |k: &usize| covariance[(one, *k)] != 0.0 && !together.contains(k);
            let found: Vec<usize> = left.iter().copied().filter(linked).collect();
            together.extend(found);
            next += 1;
        }
        left.retain(|k| !together.contains(k));
        let of =
            |ends: &[f64]| -> Vec<f64> { together.iter().map(|k| ends[*k] / covariance[(*k, *k)].sqrt()).collect() };
        let correlation = DMatrix::from_fn(together.len(), together.len(), |i, j| {
            let (a, b) = (together[i], together[j]);
            covariance[(a, b)] / (covariance[(a, a)] * covariance[(b, b)]).sqrt()
        });
        sum += ln_of_correlated(&correlation, &of(lower), &of(upper));
    }
    sum
}

/// Returns the log probability of the box for correlated coordinates with variance 1.
fn ln_of_correlated(correlation: &DMatrix<f64>, lower: &[f64], upper: &[f64]) -> f64 {
    let n = lower.len();
    // Only coordinates with an end near their mean are drawn. Conditioning on them shifts the means of the other coordinates; `place` holds the shifted means.
    let mut place = DVector::zeros(n);
    let mut near: Vec<usize> = Vec::new();
    let mut tilted: Option<Tilted> = None;
    loop {
        let is_near = |k: &usize| lower[*k] - place[*k] > -FAR_SD || upper[*k] - place[*k] < FAR_SD;
        let added: Vec<usize> = (0..n).filter(|k| !near.contains(k) && is_near(k)).collect();
        if added.is_empty() {
            return tilted.map_or(0.0, |tilted| tilted.ln_probability());
        }
        near.extend(added);
        // The least likely coordinates come first, because the others depend on them.
        near.sort_by(|a, b| {
            TruncatedNormal::new(lower[*a], upper[*a]).ln_p.total_cmp(&TruncatedNormal::new(lower[*b], upper[*b]).ln_p)
        });
        let Some(found) = Tilted::new(correlation, &near, lower, upper) else { return f64::NEG_INFINITY };
        let Some(pull) = found.factor.tr_solve_lower_triangular(&found.mean()) else { return f64::NEG_INFINITY };
        let moved = |k: usize| near.iter().zip(pull.iter()).map(|(j, pull)| correlation[(k, *j)] * pull).sum::<f64>();
        place = DVector::from_fn(n, |k, _| moved(k));
        tilted = Some(found);
    }
}

/// Log probability that a standard normal variable lies between `lower` and `upper`.
pub(super) fn ln_within(lower: f64, upper: f64) -> f64 {
    TruncatedNormal::new(lower, upper).ln_p
}

/// A standard normal variable that is truncated to an interval.
struct TruncatedNormal {
    /// Log probability of the standard normal variable between the ends.
    ln_p: f64,
    /// Density at the lower and at the upper end, divided by the probability between the ends.
    at_lower: f64,
    at_upper: f64,
}

/// Length of an interval, relative to the scale of the density, below which the density is approximated by a parabola.
const SHORT: f64 = 1e-4;

impl TruncatedNormal {
    fn new(lower: f64, upper: f64) -> Self {
        if upper <= 0.0 && lower < 0.0 {
            let mirrored = Self::new(-upper, -lower);
            return Self { at_lower: mirrored.at_upper, at_upper: mirrored.at_lower, ..mirrored };
        }
        if lower < 0.0 {
            let p = 0.5 * (erf(upper * FRAC_1_SQRT_2) - erf(lower * FRAC_1_SQRT_2));
            return Self { ln_p: p.ln(), at_lower: density(lower) / p, at_upper: density(upper) / p };
        }
        let over_density = mass_over_density(lower, upper);
        let ln_p = -0.5 * (lower * lower + TAU.ln()) + over_density.ln();
        Self { ln_p, at_lower: 1.0 / over_density, at_upper: fall(lower, upper) / over_density }
    }

    /// Derivative of the log probability with respect to a downward shift of both ends.
    fn slope(&self) -> f64 {
        self.at_lower - self.at_upper
    }

    /// Derivative of [`Self::slope`] with respect to the same shift. The variance of the truncated variable is 1 plus this value.
    fn curvature(&self, lower: f64, upper: f64) -> f64 {
        let product = |end: f64, density: f64| if density == 0.0 { 0.0 } else { end * density };
        (product(lower, self.at_lower) - product(upper, self.at_upper) - self.slope().powi(2)).clamp(-1.0, 0.0)
    }
}

fn density(x: f64) -> f64 {
    (-0.5 * x * x).exp() / TAU.sqrt()
}

/// Ratio φ(upper)/φ(lower) of standard normal densities.
fn fall(lower: f64, upper: f64) -> f64 {
    if upper.is_infinite() { 0.0 } else { (0.5 * (lower - upper) * (lower + upper)).exp() }
}

/// Standard normal probability between two ends, divided by the density at the lower end. The lower end must not be negative.
fn mass_over_density(lower: f64, upper: f64) -> f64 {
    let length = upper - lower;
    if length * (1.0 + lower) < SHORT {
        return length * (1.0 - length * (lower / 2.0 - length * (lower * lower - 1.0) / 6.0));
    }
    mills(lower) - fall(lower, upper) * mills(upper)
}

/// Mills' ratio Q(x)/φ(x) of a standard normal's upper tail probability to its density, for x ≥ 0.
fn mills(x: f64) -> f64 {
    if x < 25.0 {
        return (0.5 * PI).sqrt() * (0.5 * x * x).exp() * erfc(x * FRAC_1_SQRT_2);
    }
    let inverse_square = 1.0 / (x * x);
    let series = [105.0, -15.0, 3.0, -1.0].iter().fold(0.0, |sum, term| (sum + term) * inverse_square);
    (1.0 + series) / x
}

/// Quantile of a standard normal variable truncated to an interval, at the probability `share`.
fn quantile_within(lower: f64, upper: f64, share: f64) -> f64 {
    if upper <= 0.0 && lower < 0.0 {
        return -quantile_within(-upper, -lower, 1.0 - share);
    }
    let tail = |x: f64| 0.5 * erfc(x * FRAC_1_SQRT_2);
    let found = if lower > 5.0 {
        // Newton's method for x. It solves for ln(Q(x)/φ(lower)), with the upper tail probability Q and the density φ.
        let wanted = (mills(lower) - share * mass_over_density(lower, upper)).ln();
        let mut x = (lower * lower + 2.0 * (mills(lower).ln() - wanted)).max(0.0).sqrt();
        for _ in 0..4 {
            let ratio = mills(x);
            x += ratio * (0.5 * (lower - x) * (lower + x) + ratio.ln() - wanted);
        }
        x
    } else if lower < 0.0 {
        let (below, above) = (tail(-lower), tail(upper));
        let p = (1.0 - below - above) * share + below;
        if p < 0.5 {
            -SQRT_2 * erfc_inv(2.0 * p)
        } else {
            SQRT_2 * erfc_inv(2.0 * (above + (1.0 - below - above) * (1.0 - share)))
        }
    } else {
        let (most, least) = (tail(lower), tail(upper));
        SQRT_2 * erfc_inv(2.0 * (least + (most - least) * (1.0 - share)))
    };
    found.clamp(lower, upper)
}

/// A box whose coordinates are drawn one after another, with the shifts at the saddle point.
struct Tilted {
    /// Cholesky factor of the correlation matrix.
    factor: DMatrix<f64>,
    /// Rows of the Cholesky factor, each divided by its diagonal entry. The same entries divide the ends `lower` and `upper`.
    rows: DMatrix<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// Coordinates x at the saddle point. The last entry of `x` and of `shift` is 0.
    x: Vec<f64>,
    shift: Vec<f64>,
}

impl Tilted {
    fn new(correlation: &DMatrix<f64>, chosen: &[usize], lower: &[f64], upper: &[f64]) -> Option<Self> {
        let n = chosen.len();
        let factor = DMatrix::from_fn(n, n, |i, j| correlation[(chosen[i], chosen[j])]).cholesky()?.unpack();
        let rows = DMatrix::from_fn(n, n, |i, j| if j < i { factor[(i, j)] / factor[(i, i)] } else { 0.0 });
        let scaled = |ends: &[f64]| (0..n).map(|i| ends[chosen[i]] / factor[(i, i)]).collect();
        let (lower, upper) = (scaled(lower), scaled(upper));
        let mut tilted = Self { factor, rows, lower, upper, x: vec![0.0; n], shift: vec![0.0; n] };
        tilted.find_saddle();
        Some(tilted)
    }

    fn n(&self) -> usize {
        self.lower.len()
    }

    /// Returns the ends of coordinate `k`, given the earlier coordinates in `x`, less the coordinate's shift.
    fn ends(&self, k: usize, x: &[f64], shift: f64) -> [f64; 2] {
        let moved = shift + (0..k).map(|j| self.rows[(k, j)] * x[j]).sum::<f64>();
        [self.lower[k] - moved, self.upper[k] - moved]
    }

    /// Logarithm of the weight of a point x, for the shifts μ: ψ(x; μ) = Σ [μ²/2 − xμ + ln P(ends given x, less μ)], summed over coordinates.
    fn ln_weight(&self, x: &[f64]) -> f64 {
        let of_coordinate = |k: usize| {
            let [lower, upper] = self.ends(k, x, self.shift[k]);
            ln_within(lower, upper) + self.shift[k] * (0.5 * self.shift[k] - x[k])
        };
        (0..self.n()).map(of_coordinate).sum()
    }

    /// Derivatives of the log weight ([`Self::ln_weight`]) with respect to the coordinates x and then the shifts, without the last coordinate. Also the second derivatives.
    fn slopes(&self, x: &[f64], shift: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
        let (n, m) = (self.n(), self.n() - 1);
        let (mut slope, mut curvature) = (vec![0.0; n], vec![0.0; n]);
        for k in 0..n {
            let [lower, upper] = self.ends(k, x, shift[k]);
            let within = TruncatedNormal::new(lower, upper);
            (slope[k], curvature[k]) = (within.slope(), within.curvature(lower, upper));
        }
        let rows = &self.rows;
        let gradient = DVector::from_fn(2 * m, |i, _| match i.checked_sub(m) {
            None => -shift[i] + (i + 1..n).map(|k| slope[k] * rows[(k, i)]).sum::<f64>(),
            Some(i) => shift[i] - x[i] + slope[i],
        });
        let mixed = |i: usize, j: usize| curvature[i] * rows[(i, j)] - if i == j { 1.0 } else { 0.0 };
        let jacobian = DMatrix::from_fn(2 * m, 2 * m, |i, j| match (i.checked_sub(m), j.checked_sub(m)) {
            (None, None) => (0..n).map(|k| rows[(k, i)] * curvature[k] * rows[(k, j)]).sum(),
            (None, Some(j)) => mixed(j, i),
            (Some(i), None) => mixed(i, j),
            (Some(i), Some(j)) if i == j => 1.0 + curvature[i],
            _ => 0.0,
        });
        (gradient, jacobian)
    }

    /// Finds the saddle point by Newton's steps, which are shortened if the slope does not fall. Any shift gives the right probability; the saddle point needs the fewest
    /// points.
    fn find_saddle(&mut self) {
        let m = self.n() - 1;
        if m == 0 {
            return;
        }
        let (mut gradient, mut jacobian) = self.slopes(&self.x, &self.shift);
        for _ in 0..MOST_STEPS {
            if gradient.norm() < LEAST_SLOPE {
                return;
            }
            let Some(step) = jacobian.lu().solve(&gradient) else { return };
            let mut length = 1.0;
            loop {
                let (mut x, mut shift) = (self.x.clone(), self.shift.clone());
                (0..m).for_each(|k| {
                    x[k] -= length * step[k];
                    shift[k] -= length * step[m + k];
                });
                let (trial, of_trial) = self.slopes(&x, &shift);
                if trial.norm() < gradient.norm() {
                    (self.x, self.shift, gradient, jacobian) = (x, shift, trial, of_trial);
                    break;
                }
                length *= 0.5;
                if length < 1e-6 {
                    return;
                }
            }
        }
    }

    /// Approximate mean of the coordinates, given that they lie in the box.
    fn mean(&self) -> DVector<f64> {
        DVector::from_fn(self.n(), |k, _| {
            let [lower, upper] = self.ends(k, &self.x, self.shift[k]);
            self.shift[k] + TruncatedNormal::new(lower, upper).slope()
        })
    }

    fn ln_probability(&self) -> f64 {
        let n_drawn = self.n() - 1;
        let at_saddle = self.ln_weight(&self.x);
        if n_drawn == 0 {
            return at_saddle;
        }
        let mut x = vec![0.0; self.n()];
        let mut sum = 0.0;
        for_points(n_drawn, |point, weight| {
            for (k, share) in point.iter().enumerate() {
                let [lower, upper] = self.ends(k, &x, self.shift[k]);
                x[k] = self.shift[k] + quantile_within(lower, upper, *share);
            }
            sum += weight * (self.ln_weight(&x) - at_saddle).exp();
        });
        at_saddle + sum.ln()
    }
}

/// Calls `visit` with points of the unit cube and their weights, which sum to one. The points are equally spaced, or a Kronecker sequence in more than two dimensions.
/// The substitution w = t³(10 − 15t + 6t²) gives the ends of the cube zero weight. Integrands are steep at the ends, and both rules are best for periodic integrands.
fn for_points(n_dimensions: usize, mut visit: impl FnMut(&[f64], f64)) {
    let bent = |t: f64| (t.powi(3) * (10.0 - t * (15.0 - 6.0 * t)), 30.0 * (t * (1.0 - t)).powi(2));
    let mut point = vec![0.0; n_dimensions];
    let mut visit_at = |n: usize, t: &dyn Fn(usize) -> f64| {
        let mut weight = 1.0 / n as f64;
        for (dimension, share) in point.iter_mut().enumerate() {
            let (bent, slope) = bent(t(dimension));
            *share = bent;
            weight *= slope;
        }
        visit(&point, weight);
    };
    let middle = |number: usize, n: usize| (number as f64 + 0.5) / n as f64;
    match n_dimensions {
        1 => (0..N_ALONE).for_each(|number| visit_at(N_ALONE, &|_| middle(number, N_ALONE))),
        2 => {
            let n = N_EACH_OF_TWO;
            (0..n * n).for_each(|number| visit_at(n * n, &|d| middle(if d == 0 { number / n } else { number % n }, n)));
        }
        _ => {
            // Root of xᵈ⁺¹ = x + 1 in d dimensions. Fractions approximate its powers poorly, so the points are evenly spread.
            let ratio = (0..60).fold(1.5_f64, |x, _| (1.0 + x).powf(1.0 / (n_dimensions + 1) as f64));
            let t = |number: usize, d: usize| ((number as f64 + 0.5) * ratio.powi(-(d as i32) - 1)).fract();
            (0..N_OF_MORE).for_each(|number| visit_at(N_OF_MORE, &|d| t(number, d)));
        }
    }
}

#[cfg(test)]
#[path = "box_probability_tests.rs"]
mod tests;
