//! What other records of a specimen say about a model's parameters, to second order.

use nalgebra::{DMatrix, DVector};

use super::derivatives::columns_m;
use super::steps::normal_equations;
use super::{Candidate, Subject};
use crate::NoiseValues;
use base::error::Result;

/// Gauss–Newton expansion of the log likelihood of other records about a point.
pub(super) struct Elsewhere {
    at: DVector<f64>,
    ln_likelihood: f64,
    slope: DVector<f64>,
    /// Fisher information.
    pub(super) information: DMatrix<f64>,
}

impl Elsewhere {
    /// Expansion about a point, as the sum over records with their own noise.
    pub(super) fn about(theta: &[f64], candidate: &Candidate, records: &[(&Subject, &NoiseValues)]) -> Result<Self> {
        let n = theta.len();
        let at = DVector::from_column_slice(theta);
        let mut sum = Self { at, ln_likelihood: 0.0, slope: DVector::zeros(n), information: DMatrix::zeros(n, n) };
        for (subject, noise) in records {
            let position_m = subject.trajectory_m(candidate, theta)?;
            let mut columns = columns_m(subject, candidate, theta)?;
            let rows = subject.fitted_m.iter().zip(&position_m);
            columns.push(rows.map(|(y, x)| y.map_or(0.0, |y| y - x)).collect());
            let (normal, slope) = normal_equations(&subject.fitted.whiten(&columns, &position_m, noise));
            sum.ln_likelihood += subject.fitted.ln_likelihood(&position_m, noise);
            sum.slope += slope;
            sum.information += normal;
        }
        Ok(sum)
    }

    /// Log likelihood of the other records at a point.
    pub(super) fn ln_likelihood(&self, theta: &[f64]) -> f64 {
        let step = DVector::from_column_slice(theta) - &self.at;
        self.ln_likelihood + self.slope.dot(&step) - 0.5 * (&self.information * &step).dot(&step)
    }

    /// Adds curvature and slope at a point to those of the fitted record.
    pub(super) fn add_to(&self, theta: &[f64], normal: &mut DMatrix<f64>, slope: &mut DVector<f64>) {
        let step = DVector::from_column_slice(theta) - &self.at;
        *normal += &self.information;
        *slope += &self.slope - &self.information * step;
    }
}
