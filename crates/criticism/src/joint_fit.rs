//! Fit of one model to several records of one specimen.
//!
//! Every record has its own noise. While one record is fitted, the log likelihoods of the others are replaced by their Gauss–Newton expansions about the last fit. Expansions and
//! fits alternate until the exact objective, the sum over all records, gains nothing more.

use nalgebra::{DMatrix, DVector};

use super::derivatives::columns_m;
use super::steps::normal_equations;
use super::{Candidate, Fitted, Search, Subject};
use base::error::{Error, Result};

/// Gain (nats) of a round below which a joint fit has converged.
const LEAST_GAIN_NATS: f64 = 1e-2;
const MOST_ROUNDS: usize = 12;

/// Gauss–Newton expansion of the log likelihood of other records about a point.
pub(super) struct Elsewhere {
    at: DVector<f64>,
    ln_likelihood: f64,
    slope: DVector<f64>,
    /// Fisher information.
    information: DMatrix<f64>,
}

impl Elsewhere {
    /// Expansion about a point, as the sum over records with their own noise.
    fn about(theta: &[f64], candidate: &Candidate, records: &[(&Subject, &Fitted)]) -> Result<Self> {
        let n = theta.len();
        let at = DVector::from_column_slice(theta);
        let mut sum = Self { at, ln_likelihood: 0.0, slope: DVector::zeros(n), information: DMatrix::zeros(n, n) };
        for (subject, Fitted { noise, .. }) in records {
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

/// One model fitted to several records of one specimen.
#[derive(Debug, Clone)]
pub struct JointFit {
    /// Fits of the records, all at the same coordinates, each with its own noise and positions.
    pub records: Vec<Fitted>,
    /// Log likelihoods of all records plus the log priors of the law and of all noise, in nats, up to constants that all candidates share.
    pub objective: f64,
    /// Fisher information of the records after the first about the free coordinates.
    pub information_elsewhere: DMatrix<f64>,
}

impl JointFit {
    /// Fits a candidate to the records of one specimen. The candidate is that of the first record.
    ///
    /// # Errors
    /// [`Error::Numerical`] for no record, or if the model has no solution or no derivatives in one of them.
    pub fn of(subjects: &[Subject], candidate: &Candidate) -> Result<Self> {
        let Some((first, others)) = subjects.split_first() else {
            return Err(Error::numerical("there is no record", "give at least one record"));
        };
        let mut fits = vec![first.fit(candidate, &[], Search::Wide)?];
        for subject in others {
            let before: Vec<(&Subject, &Fitted)> = subjects.iter().zip(&fits).collect();
            let theta = fits[fits.len() - 1].theta.clone();
            let elsewhere = Elsewhere::about(&theta, candidate, &before)?;
            fits.push(subject.fit_beside(candidate, &[(theta, fits[0].noise)], Search::Wide, Some(&elsewhere))?);
        }
        let mut best = Self::at(subjects, candidate, &fits[fits.len() - 1].theta, &fits)?;
        for _ in 0..if others.is_empty() { 0 } else { MOST_ROUNDS } {
            let mut fits = best.records.clone();
            for (place, subject) in subjects.iter().enumerate() {
                let (theta, noise) = (fits[place].theta.clone(), fits[place].noise);
                let records = subjects.iter().zip(&fits).enumerate();
                let rest: Vec<(&Subject, &Fitted)> =
                    records.filter(|(other, _)| *other != place).map(|(_, record)| record).collect();
                let elsewhere = Elsewhere::about(&theta, candidate, &rest)?;
                let found = subject.fit_beside(candidate, &[(theta, noise)], Search::Local, Some(&elsewhere))?;
                fits.iter_mut().for_each(|fit| fit.theta.clone_from(&found.theta));
                fits[place] = found;
            }
            let next = Self::at(subjects, candidate, &fits[0].theta, &fits)?;
            let gain = next.objective - best.objective;
            if gain > 0.0 {
                best = next;
            }
            if gain < LEAST_GAIN_NATS {
                break;
            }
        }
        Ok(best)
    }

    /// The exact objective at a point, with the noise of each record's fit.
    fn at(subjects: &[Subject], candidate: &Candidate, theta: &[f64], fits: &[Fitted]) -> Result<Self> {
        let mut objective = candidate.ln_prior(theta);
        let mut records = Vec::new();
        for (subject, Fitted { noise, .. }) in subjects.iter().zip(fits) {
            let position_m = subject.trajectory_m(candidate, theta)?;
            let ln_likelihood = subject.fitted.ln_likelihood(&position_m, noise);
            let of_noise = subject.noise_prior().ln_density(&noise.map(f64::ln));
            objective += ln_likelihood + of_noise;
            let of_record = candidate.ln_prior(theta) + ln_likelihood + of_noise;
            records.push(Fitted {
                theta: theta.to_vec(),
                noise: *noise,
                position_m,
                objective: of_record,
                ln_likelihood,
            });
        }
        let later: Vec<(&Subject, &Fitted)> = subjects.iter().zip(&records).skip(1).collect();
        let information_elsewhere = Elsewhere::about(theta, candidate, &later)?.information;
        Ok(Self { records, objective, information_elsewhere })
    }

    /// Coordinates of the fit.
    pub fn theta(&self) -> &[f64] {
        &self.records[0].theta
    }
}

#[cfg(test)]
#[path = "joint_fit_tests.rs"]
mod tests;
