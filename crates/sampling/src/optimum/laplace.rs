//! Modes of a posterior with their masses in the Laplace approximation.

use super::Optimum;
use crate::ensemble::RandomStream;
use nalgebra::{DMatrix, DVector};

/// Mode of a posterior: a maximum, and the Gaussian with the curvature there (Laplace approximation).
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Mode {
    /// Unconstrained coordinates of the maximum.
    pub location: Vec<f64>,
    /// Log density at the maximum.
    pub log_density: f64,
    /// Precision matrix of the Laplace approximation, row by row.
    pub precision: Vec<f64>,
    /// Logarithm of the mode's probability mass in the Laplace approximation: ln p + (d/2) ln 2π − ½ ln det(precision), for d coordinates and the log
    /// density ln p at the maximum.
    pub log_mass: f64,
    /// `true` if the search ended at a maximum with negative curvature in every direction.
    pub converged: bool,
}

/// Distinct modes of a posterior, largest probability mass first.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Modes {
    modes: Vec<Mode>,
}

/// Distance below which two optima are one mode, in standard deviations of the Laplace approximation of either optimum.
const SAME_MODE_DISTANCE: f64 = 1.0;

impl Mode {
    fn new(optimum: &Optimum) -> Self {
        let n = optimum.location.len();
        let log_det = match DMatrix::from_row_slice(n, n, &optimum.precision).cholesky() {
            Some(factor) => 2.0 * factor.l_dirty().diagonal().iter().map(|l| l.ln()).sum::<f64>(),
            // The matrix is numerically singular, so the mass is unknown.
            None => f64::INFINITY,
        };
        Self {
            location: optimum.location.clone(),
            log_density: optimum.log_density,
            precision: optimum.precision.clone(),
            log_mass: optimum.log_density + 0.5 * n as f64 * std::f64::consts::TAU.ln() - 0.5 * log_det,
            converged: optimum.converged,
        }
    }

    /// Distance of a point from the maximum, in standard deviations of the Laplace approximation.
    pub fn distance(&self, point: &[f64]) -> f64 {
        let n = self.location.len();
        let away: Vec<f64> = point.iter().zip(&self.location).map(|(x, m)| x - m).collect();
        let form: f64 = (0..n * n).map(|k| away[k / n] * self.precision[k] * away[k % n]).sum();
        form.max(0.0).sqrt()
    }

    /// Draws a point from the Laplace approximation with its standard deviations multiplied by `spread`.
    pub fn draw(&self, spread: f64, stream: &mut RandomStream) -> Vec<f64> {
        let n = self.location.len();
        let noise = DVector::from_fn(n, |_, _| stream.normal());
        // For the precision matrix L Lᵀ and a standard normal vector z, the vector L⁻ᵀ z has the inverse of the precision matrix as covariance.
        let step = DMatrix::from_row_slice(n, n, &self.precision)
            .cholesky()
            .and_then(|factor| factor.l().transpose().solve_upper_triangular(&noise))
            .unwrap_or_else(|| noise * 1e-3);
        self.location.iter().zip(step.iter()).map(|(m, s)| m + spread * s).collect()
    }
}

impl Modes {
    /// Makes a set that contains one mode.
    pub fn from_mode(mode: &Mode) -> Self {
        Self { modes: vec![mode.clone()] }
    }

    /// Adds an optimum as a new mode. If it belongs to a known mode, the better of the two is kept.
    pub fn add(&mut self, optimum: &Optimum) {
        let mode = Mode::new(optimum);
        let same =
            |known: &Mode| known.distance(&mode.location).min(mode.distance(&known.location)) < SAME_MODE_DISTANCE;
        match self.modes.iter().position(same) {
            Some(idx) => {
                let known = &mut self.modes[idx];
                if (mode.converged, mode.log_density) > (known.converged, known.log_density) {
                    *known = mode;
                }
            }
            None => self.modes.push(mode),
        }
        self.modes.sort_by(|a, b| b.log_mass.total_cmp(&a.log_mass));
    }

    /// Returns the mode nearest to a point, with its index; `None` without modes. Distances are in standard deviations of each mode.
    pub fn nearest(&self, point: &[f64]) -> Option<(usize, &Mode)> {
        self.modes.iter().enumerate().min_by(|a, b| a.1.distance(point).total_cmp(&b.1.distance(point)))
    }

    /// Returns the mode that a uniform number u in [0, 1) selects in proportion to the modes' weights; `None` without modes.
    pub fn at_cumulative_weight(&self, u: f64) -> Option<&Mode> {
        let mut cumulated = 0.0;
        let reached = |weight: f64| {
            cumulated += weight;
            u < cumulated
        };
        let idx = self.weights().into_iter().position(reached).unwrap_or(self.modes.len().saturating_sub(1));
        self.modes.get(idx)
    }

    /// Iterates over the modes, largest mass first.
    pub fn iter(&self) -> impl Iterator<Item = &Mode> {
        self.modes.iter()
    }

    /// Number of modes.
    pub fn len(&self) -> usize {
        self.modes.len()
    }

    /// Returns `true` if no mode was found.
    pub fn is_empty(&self) -> bool {
        self.modes.is_empty()
    }

    /// Probability mass of each mode in the Laplace approximation, divided by the total mass.
    pub fn weights(&self) -> Vec<f64> {
        let heaviest = self.modes.first().map_or(0.0, |mode| mode.log_mass);
        let masses: Vec<f64> = self.modes.iter().map(|mode| (mode.log_mass - heaviest).exp()).collect();
        let total: f64 = masses.iter().sum();
        masses.into_iter().map(|mass| mass / total).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::find_modes;
    use super::*;
    use crate::test_densities::TwoBumps;

    #[test]
    fn both_bumps_are_found_with_their_masses() {
        let target = TwoBumps::new(0.7, 20.0, 2.0);
        let starts: Vec<Vec<f64>> = (0..16).map(|k| vec![f64::from(k) * 2.0 - 6.0, 0.5]).collect();
        let modes = find_modes(&target, &starts).unwrap();
        assert_eq!(modes.len(), 2);
        assert!((modes.weights()[0] - 0.7).abs() < 1e-3, "{:?}", modes.weights());
        assert!(modes.iter().map(|mode| mode.log_mass.exp()).sum::<f64>() - 1.0 < 1e-3);
    }

    /// Checks that the mean squared distance of draws from the maximum is the dimension d. For 20,000 draws and d = 2, its standard error is
    /// √(2·2/20000) = 0.014. The tolerance is six standard errors.
    #[test]
    fn draws_have_the_approximation_s_covariance() {
        let optimum = Optimum {
            location: vec![1.0, -2.0],
            log_density: 0.0,
            precision: vec![5.0, 3.0, 3.0, 2.0],
            converged: true,
        };
        let mode = Mode::new(&optimum);
        let mut stream = RandomStream::new(4, 0);
        let mean_square = (0..20_000).map(|_| mode.distance(&mode.draw(1.0, &mut stream)).powi(2)).sum::<f64>() / 2e4;
        assert!((mean_square - 2.0).abs() < 0.09, "{mean_square}");
    }
}
