//! Fit of one model to several records of one specimen.
//!
//! Every record has its own noise. While one record is fitted, the log likelihoods of the others are replaced by their Gauss–Newton expansions about the last fit. Expansions and
//! fits alternate until the exact objective, the sum over all records, gains nothing more.

use nalgebra::DMatrix;

use super::elsewhere::Elsewhere;
use super::{Candidate, Fitted, Search, Subject};
use crate::NoiseValues;
use base::error::{Error, Result};

/// Gain (nats) of a round below which a joint fit has converged.
const LEAST_GAIN_NATS: f64 = 1e-2;
const MOST_ROUNDS: usize = 12;

/// One model fitted to several records of one specimen.
#[derive(Debug, Clone)]
pub struct JointFit {
    /// Fits of the records, all at the same coordinates, each with its own noise and positions.
    pub records: Vec<Fitted>,
    /// Log likelihoods of all records plus the log priors of the law and of all noise, in nats, up to constants that all candidates share.
    pub objective: f64,
    /// Fisher information of all records about the free coordinates.
    pub information: DMatrix<f64>,
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
            let before: Vec<(&Subject, &NoiseValues)> = with_noise(subjects, &fits).collect();
            let theta = fits[fits.len() - 1].theta.clone();
            let elsewhere = Elsewhere::about(&theta, candidate, &before)?;
            fits.push(subject.fit_beside(candidate, &[(theta, fits[0].noise)], Search::Wide, Some(&elsewhere))?);
        }
        let (mut best, mut objective) = at(subjects, candidate, &fits)?;
        for _ in 0..if others.is_empty() { 0 } else { MOST_ROUNDS } {
            let mut fits = best.clone();
            for (place, subject) in subjects.iter().enumerate() {
                let (theta, noise) = (fits[place].theta.clone(), fits[place].noise);
                let records = with_noise(subjects, &fits).enumerate();
                let rest: Vec<(&Subject, &NoiseValues)> =
                    records.filter(|(other, _)| *other != place).map(|(_, record)| record).collect();
                let elsewhere = Elsewhere::about(&theta, candidate, &rest)?;
                let found = subject.fit_beside(candidate, &[(theta, noise)], Search::Local, Some(&elsewhere))?;
                fits.iter_mut().for_each(|fit| fit.theta.clone_from(&found.theta));
                fits[place] = found;
            }
            let (next, next_objective) = at(subjects, candidate, &fits)?;
            let gain = next_objective - objective;
            if gain > 0.0 {
                (best, objective) = (next, next_objective);
            }
            if gain < LEAST_GAIN_NATS {
                break;
            }
        }
        let all: Vec<(&Subject, &NoiseValues)> = with_noise(subjects, &best).collect();
        let information = Elsewhere::about(&best[0].theta, candidate, &all)?.information;
        Ok(Self { records: best, objective, information })
    }

    /// A candidate before any record: at the middle of its priors, without information from data.
    ///
    /// # Errors
    /// As [`Subject::at_prior`].
    pub fn before_data(subject: &Subject, candidate: &Candidate) -> Result<Self> {
        let fitted = subject.at_prior(candidate)?;
        let n = candidate.free.len();
        Ok(Self { objective: fitted.objective, records: vec![fitted], information: DMatrix::zeros(n, n) })
    }

    /// Coordinates of the fit.
    pub fn theta(&self) -> &[f64] {
        &self.records[0].theta
    }
}

/// Fits of all records at the coordinates of the last, each with its own noise, and their exact objective.
fn at(subjects: &[Subject], candidate: &Candidate, fits: &[Fitted]) -> Result<(Vec<Fitted>, f64)> {
    let theta = &fits[fits.len() - 1].theta;
    let ln_prior = candidate.ln_prior(theta);
    let of_record = |(subject, fit): (&Subject, &Fitted)| {
        let (theta, noise) = (theta.clone(), fit.noise);
        let position_m = subject.trajectory_m(candidate, &theta)?;
        let ln_likelihood = subject.fitted.ln_likelihood(&position_m, &noise);
        let objective = ln_prior + ln_likelihood + subject.noise_prior().ln_density(&noise.map(f64::ln));
        Ok(Fitted { theta, noise, position_m, objective, ln_likelihood })
    };
    let records: Vec<Fitted> = subjects.iter().zip(fits).map(of_record).collect::<Result<_>>()?;
    let objective = ln_prior + records.iter().map(|record| record.objective - ln_prior).sum::<f64>();
    Ok((records, objective))
}

fn with_noise<'a>(subjects: &'a [Subject], fits: &'a [Fitted]) -> impl Iterator<Item = (&'a Subject, &'a NoiseValues)> {
    subjects.iter().zip(fits.iter().map(|fit| &fit.noise))
}

#[cfg(test)]
#[path = "joint_fit_tests.rs"]
mod tests;
