//! Search for the protocol of the next record that teaches most: about the parameters, about which of several equivalent effects is true, about effects that the model
//! lacks, or about a quantity of interest.
//!
//! The information about parameters is that of the linear-Gaussian model at a fit: ½ ln det(P + F) − ½ ln det P, with the present precision P and the Fisher
//! information F of the new record under the noise of the fit (Chaloner & Verdinelli 1995, Stat. Sci. 10:273). Two effects are as far apart as the best fit of one to noise-free data of the
//! other ([`crate::separation`]); the expected lead in log likelihood is half the squared distance.
//!
//! A family of protocols is screened on few rows; the best protocols of holds are then improved by exchanging one level or boundary after the other. The best few are judged
//! on all rows.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::family::{DesignLimits, DesignedDrive, ForceDirections, family};
use super::farthest::{ANY, Pair, UnderProtocol, farthest};
use super::sought::{RecordInformation, Sought, SoughtEffect, sd_of};
use super::{Members, n_right, under_protocol};
use crate::detectable::{Detectability, find_smallest_detectable};
use crate::joint_fit::JointFit;
use crate::separation::SEPARATED_SIGMA;
use crate::{Candidate, Fitted, Free, Subject};
use base::error::{Error, Result};
use posterior::monitor::{Counter, Monitor, refuse_if_stopped};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use record::Record;

/// Largest number of rows in the screen.
const SCREENED_ROWS: f64 = 160.0;
/// Number of protocols that are improved by exchange, and that are judged on all rows.
const N_IMPROVED: usize = 3;
const N_JUDGED: usize = 6;
/// Largest number of rounds of exchanges.
const MOST_ROUNDS: usize = 4;
/// Relative improvement below which exchanges end.
const LEAST_IMPROVEMENT: f64 = 5e-3;
/// Number of parameter draws over which the information of the best protocol is averaged.
const N_ROBUST: usize = 8;
/// Number of parameter draws for which the motion under the best protocol is computed.
const N_MOVED: usize = 100;
/// Value of a visible effect beside the information about its size, in nats.
const VISIBLE_NATS: f64 = 10.0;
/// Farthest position of a protocol with a reduced force, as a part of the limit.
const SHARE_OF_LIMIT: f64 = 0.999;
/// Results that remain if the user stops a search.
const NOTHING_KEPT: &str = "nothing was written";
/// Number of simulated records that judge the verdict.
pub const N_REPEATS: usize = 40;

/// Best protocol of a search.
pub struct DesignedProtocol {
    /// The protocol.
    pub drive: DesignedDrive,
    /// Its rows, sampled as the apparatus does.
    pub record: Record,
    /// Expected information about the parameters of the first model, in nats.
    pub information_nats: f64,
    /// Expected posterior standard deviations of the first model's free parameters, in their coordinates.
    pub sd: Vec<f64>,
    /// Smallest distance (σ) between two models, and the index of the model that is closest to the first; `None` for one model.
    pub closest: Option<(f64, usize)>,
    /// Number of protocols that were compared.
    pub n_tried: usize,
}

/// A search for protocols around the fits of one or several models.
pub struct Designer<'a> {
    subject: &'a Subject,
    members: &'a Members<'a>,
    sought: Sought,
    /// Precision of the first model's parameters in their coordinates, before the new record.
    precision: DMatrix<f64>,
    /// Pairs of models to compare, those that are closest in the present record first. One pair stands for every other purpose.
    pairs: Vec<Pair>,
}

impl<'a> Designer<'a> {
    /// Begins a search. The first of the `members` is the model whose parameters are to be known; `information` is the Fisher information about them in the records so far.
    ///
    /// # Errors
    /// [`Error::Numerical`] if there is nothing to distinguish.
    pub fn new(
        subject: &'a Subject,
        members: &'a Members<'a>,
        sought: Sought,
        information: &DMatrix<f64>,
    ) -> Result<Self> {
        if matches!(sought, Sought::Effects) && members.len() < 2 {
            return Err(Error::numerical("there is one model only", "design for its parameters"));
        }
        let pairs = match sought {
            Sought::Effects => UnderProtocol::new(subject.clone(), members).pairs(),
            _ => vec![[0, 0]],
        };
        Ok(Self { subject, members, sought, precision: information + prior_precision(members[0].0), pairs })
    }

    /// The first model with its fit.
    pub fn first(&self) -> (&'a Candidate, &'a Fitted) {
        self.members[0]
    }

    /// Standard deviations of the first model's free parameters now, in their coordinates.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the record does not determine them.
    pub fn sd_now(&self) -> Result<Vec<f64>> {
        standard_deviations(&self.precision)
    }

    /// Distance (σ) of the closest models in the present record; `None` for one model.
    ///
    /// # Errors
    /// Errors of the fits.
    pub fn distance_now(&self) -> Result<Option<f64>> {
        if self.members.len() < 2 {
            return Ok(None);
        }
        Ok(Some(UnderProtocol::new(self.subject.clone(), self.members).separation()?.distance))
    }

    /// Finds the best protocol within the limits. `also` are further protocols to compare, such as the best of a shorter duration.
    ///
    /// # Errors
    /// [`Error::Numerical`] if no protocol can be computed; [`Error::Interrupted`] if the user stops the search.
    pub fn search(
        &self,
        limits: &DesignLimits,
        also: &[DesignedDrive],
        seed: u64,
        monitor: &dyn Monitor,
    ) -> Result<DesignedProtocol> {
        let also: Vec<DesignedDrive> =
            also.iter().map(|drive| drive.clone().in_directions(limits.directions)).collect();
        let drives: Vec<DesignedDrive> = also.iter().cloned().chain(family(limits, seed)).collect();
        let coarse_s = limits.interval_s.max(limits.duration_s / SCREENED_ROWS);
        let counter = Counter::new(monitor, drives.len());
        let mut n_tried = drives.len();
        let (holds, others): (Vec<_>, Vec<_>) =
            drives.into_iter().partition(|drive| !drive.neighbours(limits).is_empty());
        // A shorter protocol that needs a smaller force shows that longer ones do, too. A force of one direction leads away steadily.
        let reduces_force =
            also.iter().any(|drive| drive.amplitude < 1.0) || limits.directions != ForceDirections::Both;
        let mut screen = Screen { designer: self, limits, interval_s: coarse_s, monitor, reduces_force };
        let rank = |screen: &Screen<'_, '_>| -> Result<_> {
            let ranked = screen.best(holds.clone(), (N_JUDGED, f64::NEG_INFINITY), Some(&counter))?;
            let others = screen.best(others.clone(), (N_JUDGED, f64::NEG_INFINITY), Some(&counter))?;
            Ok((ranked, others))
        };
        let (mut ranked, mut of_others) = rank(&screen)?;
        // If few protocols keep the limit, better ones may keep it under a smaller force.
        if ranked.len() + of_others.len() < N_JUDGED && !reduces_force {
            screen.reduces_force = true;
            (ranked, of_others) = rank(&screen)?;
        }
        let begun: Vec<(f64, DesignedDrive)> = ranked.iter().take(N_IMPROVED).cloned().collect();
        ranked.extend(of_others);
        for start in begun {
            let (improved, n) = screen.improve(start)?;
            n_tried += n;
            ranked.push(improved);
        }
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        ranked.dedup_by(|a, b| a.1.holds == b.1.holds);
        ranked.truncate(N_JUDGED);
        let drives = ranked.into_iter().map(|(_, drive)| drive).chain(also.iter().cloned());
        let tried =
            // Rows that are closer than those of the screen show positions farther away.
            drives.filter_map(|drive| self.tried(drive, limits, limits.interval_s, true).ok()).collect();
        let value = |tried: &TriedDrive, pair| match self.sought {
            Sought::Effects => {
                refuse_if_stopped(monitor, NOTHING_KEPT)?;
                Ok(tried.models.closest_point(pair)?.distance)
            }
            // What is known now may be so little that the best protocol at its middle is not the best on average.
            Sought::Parameters if !self.members[0].0.is_slow() => Ok(self.mean_gain(&tried.models.subject, seed)?[0]),
            _ => self.linear_value(&tried.models.subject, &self.information(&tried.models.subject)?, 1.0),
        };
        let best = farthest(tried, &self.pairs, ANY, value)?.into_iter().next();
        let Some((separation, TriedDrive { drive, models })) = best else {
            return Err(Error::numerical(
                "no protocol can be computed within the limits",
                "allow a longer duration, or a shorter hold relative to it",
            ));
        };
        let (information_nats, sd) = self.gain(&self.information(&models.subject)?.matrix)?;
        let has_rivals = matches!(self.sought, Sought::Effects);
        Ok(DesignedProtocol {
            drive,
            record: models.subject.experiment().record.clone(),
            information_nats,
            sd,
            closest: has_rivals.then_some((separation.distance, separation.other)),
            n_tried,
        })
    }

    /// A protocol with rows at the given interval; an error if it moves the robot farther than the limit. `reduces_force` allows a smaller force that does not.
    fn tried(
        &self,
        mut drive: DesignedDrive,
        limits: &DesignLimits,
        interval_s: f64,
        reduces_force: bool,
    ) -> Result<TriedDrive<'a>> {
        let under = |drive: &DesignedDrive| -> Result<_> {
            let models = UnderProtocol::new(self.under(&drive.record(limits, interval_s))?, self.members);
            let farthest_m = models.position_m(0)?.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            Ok((models, farthest_m))
        };
        let (mut models, mut farthest_m) = under(&drive)?;
        if reduces_force && farthest_m > limits.largest_position_m {
            drive.amplitude *= SHARE_OF_LIMIT * limits.largest_position_m / farthest_m;
            (models, farthest_m) = under(&drive)?;
        }
        if farthest_m > limits.largest_position_m {
            return Err(Error::numerical(
                "the protocol moves the robot beyond the limit",
                "allow a larger displacement",
            ));
        }
        Ok(TriedDrive { drive, models })
    }

    /// Value of a record for a purpose other than the distance of effects, by the linear-Gaussian model. `more` is the number of rows for each row of the subject.
    fn linear_value(&self, subject: &Subject, information: &RecordInformation, more: f64) -> Result<f64> {
        let then = &self.precision + &information.matrix * more;
        Ok(match &self.sought {
            Sought::Parameters | Sought::Effects => 0.5 * (log_determinant(&then)? - log_determinant(&self.precision)?),
            Sought::Quantity(derivatives) => (sd_of(derivatives, &self.precision)? / sd_of(derivatives, &then)?).ln(),
            Sought::Sizes { effects, threshold_sigma } => {
                let precision = prior_precision(self.members[0].0) * more.recip() + &information.matrix;
                let all = effects.iter().filter(|effect| more == 1.0 || !effect.is_slow());
                let squared =
                    |effect: &SoughtEffect| effect.squared_distance(subject, self.members[0], information, &precision);
                // Information about each effect's size, if the compared size is the width of its prior. Another visible effect counts more than finer sizes.
                let value = |squared: f64| {
                    let is_visible = squared >= threshold_sigma * threshold_sigma;
                    0.5 * squared.max(0.0).ln_1p() + if is_visible { VISIBLE_NATS } else { 0.0 }
                };
                all.filter_map(squared).map(|squared| value(more * squared)).sum()
            }
        })
    }

    /// Standard deviation of the sought quantity now and after the record of a protocol; `None` for other purposes.
    ///
    /// # Errors
    /// Errors of the models.
    pub fn quantity_sd(&self, protocol: &DesignedProtocol) -> Result<Option<[f64; 2]>> {
        let Sought::Quantity(derivatives) = &self.sought else { return Ok(None) };
        let then = &self.precision + self.information(&self.under(&protocol.record)?)?.matrix;
        Ok(Some([sd_of(derivatives, &self.precision)?, sd_of(derivatives, &then)?]))
    }

    /// Smallest detectable size of every effect in the record of a protocol.
    ///
    /// # Errors
    /// Errors of the models.
    pub fn detectable(&self, protocol: &DesignedProtocol, threshold_sigma: f64) -> Result<Vec<Detectability>> {
        let (candidate, fitted) = self.members[0];
        let subject = self.under(&protocol.record)?;
        let position_m = subject.trajectory_m(candidate, &fitted.theta)?;
        find_smallest_detectable(&subject, (candidate, &Fitted { position_m, ..fitted.clone() }), threshold_sigma)
    }

    /// Fisher information of the first model's parameters in a record.
    fn information(&self, subject: &Subject) -> Result<RecordInformation> {
        RecordInformation::new(subject, self.members[0])
    }

    /// Expected information (nats) and standard deviations for a Fisher information.
    fn gain(&self, information: &DMatrix<f64>) -> Result<(f64, Vec<f64>)> {
        let then = &self.precision + information;
        let gain = 0.5 * (log_determinant(&then)? - log_determinant(&self.precision)?);
        Ok((gain, standard_deviations(&then)?))
    }

    /// Mean of the expected information (nats) over parameters drawn from what is known now, with its standard error.
    ///
    /// # Errors
    /// Errors of the models.
    pub fn mean_information(&self, protocol: &DesignedProtocol, seed: u64) -> Result<[f64; 2]> {
        self.mean_gain(&self.under(&protocol.record)?, seed)
    }

    fn mean_gain(&self, subject: &Subject, seed: u64) -> Result<[f64; 2]> {
        let (candidate, _) = self.members[0];
        let gain = |drawn: &Fitted| Ok(self.gain(&RecordInformation::new(subject, (candidate, drawn))?.matrix)?.0);
        let gains: Vec<f64> = self.drawn(N_ROBUST, seed)?.iter().map(gain).collect::<Result<_>>()?;
        let n = gains.len() as f64;
        let mean = gains.iter().sum::<f64>() / n;
        let variance = gains.iter().map(|gain| (gain - mean).powi(2)).sum::<f64>() / (n - 1.0);
        Ok([mean, (variance / n).sqrt()])
    }

    /// The first model with parameters drawn from what is known now.
    fn drawn(&self, n_draws: usize, seed: u64) -> Result<Vec<Fitted>> {
        let (candidate, fitted) = self.members[0];
        let covariance = self.precision.clone().cholesky().ok_or_else(undetermined)?.inverse();
        let lower = covariance.cholesky().ok_or_else(undetermined)?.l();
        let draw = |draw| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            random.set_stream(draw as u64);
            let normals = nalgebra::DVector::from_fn(lower.nrows(), |_, _| StandardNormal.sample(&mut random));
            let moved = &lower * normals;
            let theta = fitted.theta.iter().zip(moved.iter()).zip(&candidate.free);
            let theta = theta.map(|((theta, by), free)| free.clamped(theta + by)).collect();
            Fitted { theta, ..fitted.clone() }
        };
        Ok((0..n_draws).map(draw).collect())
    }

    /// Largest distance (m) of the robot from its start under a protocol, for each of a hundred draws of the parameters, in ascending order; empty for a model whose trajectories
    /// are stepped.
    ///
    /// # Errors
    /// Errors of the model.
    pub fn farthest_m(&self, protocol: &DesignedProtocol, seed: u64) -> Result<Vec<f64>> {
        let (candidate, _) = self.members[0];
        if candidate.is_slow() {
            return Ok(Vec::new());
        }
        let subject = self.under(&protocol.record)?;
        let farthest = |drawn: &Fitted| {
            let position_m = subject.trajectory_m(candidate, &drawn.theta)?;
            Ok(position_m.iter().fold(0.0_f64, |most, x| most.max(x.abs())))
        };
        let mut all: Vec<f64> = self.drawn(N_MOVED, seed)?.par_iter().map(farthest).collect::<Result<_>>()?;
        all.sort_by(f64::total_cmp);
        Ok(all)
    }

    /// Smallest distance (σ) between the models under other limits, by the shape of a protocol.
    ///
    /// # Errors
    /// Errors of the models.
    pub fn distance_within(&self, drive: &DesignedDrive, limits: &DesignLimits) -> Result<f64> {
        let subject = self.under(&drive.record(limits, limits.interval_s))?;
        Ok(UnderProtocol::new(subject, self.members).separation()?.distance)
    }

    /// Number of [`N_REPEATS`] simulated records of a protocol in which the true model leads every other by more than 4 nats.
    ///
    /// # Errors
    /// Errors of the fits.
    pub fn n_right(&self, protocol: &DesignedProtocol, seed: u64) -> Result<usize> {
        let models = UnderProtocol::new(self.under(&protocol.record)?, self.members);
        n_right(&models, protocol.closest.map_or(1, |(_, other)| other), (N_REPEATS, seed))
    }

    /// Subject of a record that has this protocol; all its rows are fitted.
    fn under(&self, record: &Record) -> Result<Subject> {
        under_protocol(self.subject, record, &[1], &[])
    }

    /// Expected position (m) of the first model at every row of a protocol.
    ///
    /// # Errors
    /// Errors of the model.
    pub fn expected_m(&self, protocol: &DesignedProtocol) -> Result<Vec<f64>> {
        let (candidate, fitted) = self.members[0];
        self.under(&protocol.record)?.trajectory_m(candidate, &fitted.theta)
    }
}

/// A protocol with the models under it.
struct TriedDrive<'a> {
    drive: DesignedDrive,
    models: UnderProtocol<'a>,
}

/// Comparison of protocols on coarse rows, with the models to first order.
struct Screen<'a, 'b> {
    designer: &'b Designer<'a>,
    limits: &'b DesignLimits,
    interval_s: f64,
    monitor: &'b dyn Monitor,
    /// True if protocols that move the robot too far are tried with a smaller force.
    reduces_force: bool,
}

impl Screen<'_, '_> {
    /// The best few of several protocols above a value, with their values, scaled to the rows of the apparatus.
    fn best(
        &self,
        drives: Vec<DesignedDrive>,
        (keep, floor): (usize, f64),
        counter: Option<&Counter>,
    ) -> Result<Vec<(f64, DesignedDrive)>> {
        let designer = self.designer;
        let tried = drives.into_par_iter().filter_map(|drive| {
            refuse_if_stopped(self.monitor, NOTHING_KEPT).ok()?;
            designer.tried(drive, self.limits, self.interval_s, self.reduces_force).ok()
        });
        let tried: Vec<TriedDrive> = tried.collect();
        refuse_if_stopped(self.monitor, NOTHING_KEPT)?;
        let more_rows = self.interval_s / self.limits.interval_s;
        let value = |tried: &TriedDrive, pair| {
            refuse_if_stopped(self.monitor, NOTHING_KEPT)?;
            let subject = &tried.models.subject;
            let value = match designer.sought {
                Sought::Effects => more_rows.sqrt() * tried.models.first_order_distance(pair)?,
                _ => designer.linear_value(subject, &designer.information(subject)?, more_rows)?,
            };
            if pair == designer.pairs[0] {
                counter.into_iter().for_each(Counter::add_one);
            }
            if value.is_finite() { Ok(value) } else { Err(undetermined()) }
        };
        let best = farthest(tried, &designer.pairs, (keep, floor), value)?;
        Ok(best.into_iter().map(|(separation, tried)| (separation.distance, tried.drive)).collect())
    }

    /// Improves a protocol of holds by the best exchange of one level or boundary in each round. Also returns the number of protocols that were compared.
    fn improve(&self, mut best: (f64, DesignedDrive)) -> Result<((f64, DesignedDrive), usize)> {
        let mut n_tried = 0;
        for _ in 0..MOST_ROUNDS {
            let neighbours = best.1.neighbours(self.limits);
            n_tried += neighbours.len();
            let Some(found) = self.best(neighbours, (1, best.0), None)?.into_iter().next() else { break };
            let is_small = found.0 - best.0 < LEAST_IMPROVEMENT * best.0.abs();
            best = found;
            if is_small {
                break;
            }
        }
        Ok((best, n_tried))
    }
}

/// True if a distance separates two effects.
pub fn separates(distance: f64) -> bool {
    distance >= SEPARATED_SIGMA
}

/// Log evidence of a model in several records, up to a constant that all models of one law share: Laplace's approximation around the joint fit, with the normal approximations
/// of the effects' priors.
///
/// # Errors
/// [`Error::Numerical`] if the records do not determine the parameters.
pub fn ln_evidence(candidate: &Candidate, fit: &JointFit) -> Result<f64> {
    let precision = &fit.information + prior_precision(candidate);
    let of_effect = |(free, theta): (&Free, &f64)| {
        let (mean, sd) = free.as_normal();
        free.prior.is_none().then(|| -0.5 * ((theta - mean) / sd).powi(2) - sd.ln())
    };
    let of_effects: f64 = candidate.free.iter().zip(fit.theta()).filter_map(of_effect).sum();
    Ok(fit.objective + of_effects - 0.5 * log_determinant(&precision)?)
}

/// Precision of the priors of a candidate's free parameters, in their coordinates. A parameter of an effect has its prior's own width.
fn prior_precision(candidate: &Candidate) -> DMatrix<f64> {
    let precision = candidate.free.iter().map(|free| {
        let (_, sd) = free.prior.unwrap_or_else(|| free.as_normal());
        if sd > 0.0 { 1.0 / (sd * sd) } else { 0.0 }
    });
    DMatrix::from_diagonal(&nalgebra::DVector::from_vec(precision.collect()))
}

/// Logarithm of the determinant of a positive definite matrix.
fn log_determinant(matrix: &DMatrix<f64>) -> Result<f64> {
    let factor = matrix.clone().cholesky().ok_or_else(undetermined)?;
    Ok(2.0 * factor.l().diagonal().iter().map(|entry| entry.ln()).sum::<f64>())
}

/// Standard deviations of parameters with a given precision.
fn standard_deviations(precision: &DMatrix<f64>) -> Result<Vec<f64>> {
    let covariance = precision.clone().cholesky().ok_or_else(undetermined)?.inverse();
    Ok(covariance.diagonal().iter().map(|variance| variance.sqrt()).collect())
}

fn undetermined() -> Error {
    Error::numerical("the parameters have no finite uncertainty", "fix one of the model's parameters")
}
