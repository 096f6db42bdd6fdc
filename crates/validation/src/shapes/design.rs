//! Finds the longest robot that still moves far enough. It uses a surrogate of the stiffness as a function of aspect ratio and Poisson ratio.
//!
//! At equal volume, ln k (logarithm of the stiffness) is a smooth function of the Poisson ratio and the logarithm of the aspect ratio. The surrogate is a
//! polynomial through Chebyshev points. Its error is measured between these points.

use documents::shapes::LongestRobot;
use std::f64::consts::PI;

use rayon::prelude::*;

use super::bodies::{StudyBody, sized};
use base::error::Result;
use documents::shapes::{BodyShape, SizeRule};
use elements::fe::meridional::{Resolution, solve};
use record::Orientation;

/// Smallest and largest aspect ratio of the surrogate.
pub const ASPECTS: [f64; 2] = [1.0, 20.0];
/// Distance between the experiment's Poisson ratio and the smallest one of the surrogate. The largest one is `LARGEST_POISSON`, just below ½.
const POISSON_BELOW: f64 = 0.1;
const LARGEST_POISSON: f64 = 0.499;
/// Numbers of Chebyshev points in aspect ratio and in Poisson ratio.
const N_ASPECTS: usize = 9;
const N_POISSON: usize = 4;
/// Probability with which the longest robot must move far enough.
pub const WANTED_PROBABILITY: f64 = 0.95;

/// Surrogate of the stiffness of one shape in one orientation, at equal volume.
#[derive(Debug, Clone, PartialEq)]
pub struct StiffnessSurrogate {
    /// Shape of the bodies that the surrogate covers.
    pub shape: BodyShape,
    /// Orientation of the bodies relative to the force.
    pub orientation: Orientation,
    poisson: [f64; 2],
    /// Logarithm of the stiffness (m, divided by Young's modulus) at the Chebyshev points. The aspect ratio varies fastest.
    log_stiffness: Vec<f64>,
    /// Largest relative error of the stiffness at points between the Chebyshev points.
    pub relative_error: f64,
}

/// The `n` Chebyshev points of the first kind on [−1, 1].
fn points(n: usize) -> Vec<f64> {
    (0..n).map(|i| -(PI * (i as f64 + 0.5) / n as f64).cos()).collect()
}

/// Value at `x` of the polynomial with these values at the Chebyshev points of the first kind (barycentric interpolation).
fn interpolate(values: &[f64], x: f64) -> f64 {
    let n = values.len();
    let (mut above, mut below) = (0.0, 0.0);
    for (i, (value, point)) in values.iter().zip(points(n)).enumerate() {
        let distance = x - point;
        if distance.abs() < 1e-14 {
            return *value;
        }
        let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
        let weight = sign * (PI * (i as f64 + 0.5) / n as f64).sin() / distance;
        above += weight * value;
        below += weight;
    }
    above / below
}

fn scaled(x: f64, [lower, upper]: [f64; 2]) -> f64 {
    (2.0 * x - lower - upper) / (upper - lower)
}

fn unscaled(x: f64, [lower, upper]: [f64; 2]) -> f64 {
    0.5 * (lower + upper + x * (upper - lower))
}

impl StiffnessSurrogate {
    /// Computes the stiffness at the Chebyshev points. Further solutions between the points measure the error.
    ///
    /// # Errors
    /// Errors of the meridional solver.
    pub fn new(
        shape: BodyShape,
        orientation: Orientation,
        sphere_diameter_m: f64,
        outer_radius_m: f64,
        poisson_ratio: f64,
    ) -> Result<Self> {
        let poisson = [(poisson_ratio - POISSON_BELOW).max(-0.9), LARGEST_POISSON.max(poisson_ratio)];
        let logs = ASPECTS.map(f64::ln);
        let ln_stiffness = |aspect: f64, poisson_ratio: f64| {
            let (rule, resolution) =
                (SizeRule::EqualVolume, Resolution { order: 6, rim_layers: 5, ..Resolution::default() });
            let revolution = sized(shape, aspect, rule, sphere_diameter_m);
            let body = StudyBody { shape, orientation, rule, revolution };
            solve(revolution, outer_radius_m, poisson_ratio, body.direction(), resolution)
                .map(|meridional_solution| meridional_solution.stiffness_m.ln())
        };
        let at = |(x, y): (f64, f64)| ln_stiffness(unscaled(x, logs).exp(), unscaled(y, poisson));
        let grid: Vec<(f64, f64)> =
            points(N_POISSON).into_iter().flat_map(|y| points(N_ASPECTS).into_iter().map(move |x| (x, y))).collect();
        let log_stiffness: Vec<f64> = grid.par_iter().map(|point| at(*point)).collect::<Result<_>>()?;
        let mut surrogate = Self { shape, orientation, poisson, log_stiffness, relative_error: 0.0 };
        let between = [(-0.97, 0.9), (-0.45, -0.2), (0.1, 0.6), (0.75, -0.95), (0.98, 0.2)];
        let errors: Vec<f64> =
            between.par_iter().map(|point| Ok((surrogate.at(*point) - at(*point)?).abs())).collect::<Result<_>>()?;
        surrogate.relative_error = errors.into_iter().fold(0.0, f64::max);
        Ok(surrogate)
    }

    fn at(&self, (x, y): (f64, f64)) -> f64 {
        let rows: Vec<f64> = self.log_stiffness.chunks_exact(N_ASPECTS).map(|row| interpolate(row, x)).collect();
        interpolate(&rows, y)
    }

    /// Stiffness divided by Young's modulus: force per displacement per Pa, in m. `None` outside the surrogate's range.
    pub fn stiffness_m(&self, aspect: f64, poisson_ratio: f64) -> Option<f64> {
        let point = (scaled(aspect.ln(), ASPECTS.map(f64::ln)), scaled(poisson_ratio, self.poisson));
        let inside = |x: f64| x.abs() <= 1.0 + 1e-12;
        (inside(point.0) && inside(point.1)).then(|| self.at(point).exp())
    }
}

/// Returns the largest aspect ratio at which the displacement reaches `distance_m` with probability 95 %. The displacement is `force_per_pa` divided by the
/// stiffness. `force_per_pa` holds F·J(t) (force times creep compliance, N/Pa) for each posterior draw.
pub fn longest(
    surrogate: &StiffnessSurrogate,
    sphere_diameter_m: f64,
    poisson_ratio: f64,
    force_per_pa: &[f64],
    distance_m: f64,
) -> LongestRobot {
    let mut ascending = force_per_pa.to_vec();
    ascending.sort_by(f64::total_cmp);
    let place = ((1.0 - WANTED_PROBABILITY) * ascending.len() as f64) as usize;
    // Largest stiffness at which enough posterior draws reach the distance.
    let most_m = ascending.get(place).map_or(f64::NAN, |smallest| smallest / distance_m);
    let moves = |aspect: f64| surrogate.stiffness_m(aspect, poisson_ratio).is_some_and(|value| value <= most_m);
    let is_limit_of_range = moves(ASPECTS[1]);
    let aspect = if is_limit_of_range {
        Some(ASPECTS[1])
    } else if moves(ASPECTS[0]) {
        let (mut short, mut long) = (ASPECTS[0].ln(), ASPECTS[1].ln());
        for _ in 0..60 {
            let middle = 0.5 * (short + long);
            if moves(middle.exp()) { short = middle } else { long = middle }
        }
        Some(short.exp())
    } else {
        None
    };
    let length_m = aspect.map(|aspect| {
        let revolution = sized(surrogate.shape, aspect, SizeRule::EqualVolume, sphere_diameter_m);
        let body = StudyBody {
            shape: surrogate.shape,
            orientation: surrogate.orientation,
            rule: SizeRule::EqualVolume,
            revolution,
        };
        body.sizes_m()[0]
    });
    LongestRobot {
        shape: surrogate.shape,
        orientation: match surrogate.orientation {
            Orientation::Horizontal => "horizontal".into(),
            Orientation::Vertical => "vertical".into(),
        },
        aspect,
        length_m,
        is_limit_of_range,
        surrogate_relative_error: surrogate.relative_error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpolation_is_exact_for_polynomials() {
        let of = |x: f64| 3.0 - x + 0.5 * x.powi(3) - 2.0 * x.powi(5);
        let values: Vec<f64> = points(6).into_iter().map(of).collect();
        for x in [-1.0, -0.31, 0.0, 0.77, 1.0] {
            assert!((interpolate(&values, x) - of(x)).abs() < 1e-13);
        }
    }

    /// The longest robot of the surrogate agrees with its definition. At its aspect ratio, the solver itself gives the stiffness at which 19 of 20 draws just
    /// reach the distance.
    #[test]
    fn the_longest_robot_moves_just_far_enough() {
        let (diameter_m, outer_m, nu) = (0.55e-3, 10e-3, 0.48);
        let (shape, orientation) = (BodyShape::Ellipsoid, Orientation::Vertical);
        let surrogate = StiffnessSurrogate::new(shape, orientation, diameter_m, outer_m, nu).unwrap();
        assert!(surrogate.relative_error < 1e-3, "{}", surrogate.relative_error);
        let draws: Vec<f64> = (0..20).map(|i| 1.8e-6 * (1.0 + 0.01 * f64::from(i))).collect();
        let found = longest(&surrogate, diameter_m, nu, &draws, 0.55e-3);
        let revolution = sized(shape, found.aspect.unwrap(), SizeRule::EqualVolume, diameter_m);
        let body = StudyBody { shape, orientation, rule: SizeRule::EqualVolume, revolution };
        let stiffness_m = solve(revolution, outer_m, nu, body.direction(), Resolution::default()).unwrap().stiffness_m;
        // 95 % of twenty draws are all draws except the lowest.
        assert!((draws[1] / stiffness_m / 0.55e-3 - 1.0).abs() < 2e-3, "{found:?}");
        assert!(!found.is_limit_of_range && (found.length_m.unwrap() / body.sizes_m()[0] - 1.0).abs() < 1e-12);
        assert_eq!(longest(&surrogate, diameter_m, nu, &draws, 10e-3).aspect, None);
        assert!(longest(&surrogate, diameter_m, nu, &draws, 1e-5).is_limit_of_range);
    }
}
