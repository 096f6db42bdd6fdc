//! Search for structure outside the library: screening, refits, refinement, and calibration by simulated noise.

use rayon::prelude::*;

use super::screen::{Scored, Screened, kept, screen};
use super::sentence::describe;
use super::setting::SearchSetting;
use super::shape::{StructureShape, families, is_event};
use super::{OutsideKind, OutsideRequest, OutsideStructure};
use crate::NoiseValues;
use crate::derivatives::columns_m;
use crate::noise_fit::natural;
use crate::{Candidate, Fitted, Search, Subject, Tangent, outliers};
use base::error::Result;

/// Number of shapes of a family that each weighting (fitted noise, white noise) nominates for a refit.
const NOMINATED: usize = 2;
/// Distance (nats) below the best gain beyond which a family is not refined.
const REFINED_WITHIN: f64 = 12.0;
/// Least gain of a returned finding, in nats, after subtraction of its gain by chance.
const LEAST_PENALISED: f64 = 0.0;
/// Standard deviation of the relative gain in the noise `clean`, which is assumed instead of estimated from the residuals.
const CLEAN_GAIN_SD: f64 = 0.005;
/// Cosine above which an effect is reported as similar to a shape.
const TWIN_COSINE: f64 = 0.9;

/// Least penalty per free amplitude, in nats. A flexible curve must gain more than a fixed shape.
const NATS_A_DEGREE: f64 = 1.5;

/// Gains that a search for structure outside the library reaches by chance.
#[derive(Debug, Clone, PartialEq)]
pub struct OutsideNull {
    /// Penalty of each family, in nats.
    penalties: Vec<f64>,
    /// For each simulation, the largest gain of any family above that family's penalty (nats).
    excesses: Vec<f64>,
}

impl OutsideNull {
    fn new(screened: &Screened) -> Self {
        let median = |gains: &Vec<f64>| {
            let mut sorted = gains.clone();
            sorted.sort_by(f64::total_cmp);
            sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
        };
        let maxima = &screened.maxima;
        let degrees = |family: usize| {
            screened.scores.iter().filter(|score| score.family == family).map(|score| score.degrees).max().unwrap_or(0)
        };
        let penalties: Vec<f64> = maxima
            .iter()
            .enumerate()
            .map(|(family, gains)| median(gains).max(NATS_A_DEGREE * degrees(family) as f64))
            .collect();
        let n_simulations = maxima.first().map_or(0, Vec::len);
        let excess = |k: usize| {
            maxima.iter().zip(&penalties).map(|(gains, penalty)| gains[k] - penalty).fold(f64::NEG_INFINITY, f64::max)
        };
        let excesses = (0..n_simulations).map(excess).collect();
        Self { penalties, excesses }
    }

    /// Simulates the gains that a search over all kinds of structure reaches by chance in residuals of a fit. The gains depend on the protocol and the noise more than on the
    /// positions. So one result serves many simulated data sets of an experiment.
    ///
    /// # Errors
    /// Errors of [`Tangent::new`].
    pub fn of(subject: &Subject, candidate: &Candidate, fitted: &Fitted, request: &OutsideRequest) -> Result<Self> {
        let setting = SearchSetting::new(subject, candidate, fitted)?;
        let tangent = Tangent::new(subject, candidate, fitted)?;
        let screened = screen(&tangent, &setting, &families(&setting), request.n_simulations, request.seed);
        Ok(Self::new(&screened))
    }

    fn p_familywise(&self, penalised_gain_nats: f64) -> f64 {
        let as_good = self.excesses.iter().filter(|excess| **excess >= penalised_gain_nats).count();
        (1 + as_good) as f64 / (1 + self.excesses.len()) as f64
    }
}

/// A shape with its refit.
#[derive(Clone)]
struct Refit {
    family: usize,
    shape: StructureShape,
    candidate: Candidate,
    fitted: Fitted,
}

/// State of a search: the subject without outliers and the model's best fit to it.
struct OutsideSearch<'a> {
    subject: Subject,
    candidate: &'a Candidate,
    base: Fitted,
    /// Linearisation of the model at the fit `base`.
    entry: Tangent,
    /// White noise of the known or estimated size, with a small gain.
    clean: NoiseValues,
    setting: SearchSetting,
    families: Vec<Vec<StructureShape>>,
}

/// Finds structure outside the library in the fitted rows of a subject, given a model and its fit. Returns the best structure of each kind, ordered by penalised gain.
///
/// # Errors
/// Errors of [`Subject::fit`] and [`Tangent::new`].
pub fn search(
    subject: &Subject,
    candidate: &Candidate,
    fitted: &Fitted,
    request: &OutsideRequest,
) -> Result<Vec<OutsideStructure>> {
    let looking = OutsideSearch::new(subject, candidate, fitted, |_| true)?;
    looking.outsides(request)
}

/// Finds events (slips, drifts, changes of gain, disturbances) in *all* cycles, including the scored one, which no other fit uses.
///
/// The model is refitted to all cycles. A finding explains why the prediction of the scored cycle may fail; it does not improve the prediction. The field `fitted` of a finding
/// has used every cycle, so it must not be scored.
///
/// # Errors
/// Errors of [`search`].
pub fn events_over_all_cycles(
    subject: &Subject,
    candidate: &Candidate,
    fitted: &Fitted,
    request: &OutsideRequest,
) -> Result<Vec<OutsideStructure>> {
    let mut unsealed = subject.clone();
    unsealed.fitted_m = subject.fitted_m.iter().zip(&subject.scored_m).map(|(a, b)| a.or(*b)).collect();
    unsealed.scored_m = vec![None; subject.scored_m.len()];
    unsealed.fitted = subject.all.clone();
    let looking = OutsideSearch::new(&unsealed, candidate, fitted, is_event)?;
    looking.outsides(request)
}

/// Returns the largest penalised gain (nats) of any kind, with the penalties of an existing `null`. It is quick enough for every data set of a bootstrap.
///
/// # Errors
/// Errors of [`search`].
pub fn largest_outside_gain(
    subject: &Subject,
    candidate: &Candidate,
    fitted: &Fitted,
    null: &OutsideNull,
) -> Result<(f64, Option<OutsideKind>)> {
    let looking = OutsideSearch::new(subject, candidate, fitted, |_| true)?;
    let scores = screen(&looking.entry, &looking.setting, &looking.families, 0, 0).scores;
    let refits = looking.refits(scores, null)?;
    let best = refits.iter().map(|refit| (looking.penalised(refit, null), refit.shape.kind()));
    let best = best.max_by(|a, b| a.0.total_cmp(&b.0));
    Ok(best.map_or((0.0, None), |(gain, kind)| (gain, Some(kind))))
}

impl<'a> OutsideSearch<'a> {
    fn new(
        subject: &Subject,
        candidate: &'a Candidate,
        fitted: &Fitted,
        is_wanted: impl Fn(OutsideKind) -> bool,
    ) -> Result<Self> {
        let subject = subject.without_rows(&outliers::find_outliers(subject, fitted));
        let mut clean = natural(&subject.noise_prior().white());
        clean[3] = CLEAN_GAIN_SD;
        // The base is fitted from both noises. Otherwise a shape could seem to gain only because the base's noise was at a worse optimum.
        let base = subject.fit(candidate, &starts(fitted.theta.clone(), fitted, clean), Search::Local)?;
        let setting = SearchSetting::new(&subject, candidate, &base)?;
        let families = families(&setting).into_iter();
        let families = families.filter(|shapes| shapes.first().is_some_and(|shape| is_wanted(shape.kind()))).collect();
        let tangent = Tangent::new(&subject, candidate, &base)?;
        Ok(Self { subject, candidate, base, entry: tangent, clean, setting, families })
    }

    fn tangent(&self, fitted: &Fitted) -> Result<Tangent> {
        Tangent::new(&self.subject, self.candidate, fitted)
    }

    fn outsides(&self, request: &OutsideRequest) -> Result<Vec<OutsideStructure>> {
        let screened = screen(&self.entry, &self.setting, &self.families, request.n_simulations, request.seed);
        let null = OutsideNull::new(&screened);
        let refits = self.refits(screened.scores, &null)?;
        let mut best: Vec<(f64, Refit)> = Vec::new();
        for refit in refits {
            let penalised = self.penalised(&refit, &null);
            match best.iter_mut().find(|(_, other)| other.shape.kind() == refit.shape.kind()) {
                Some(same) if same.0 < penalised => *same = (penalised, refit),
                Some(_) => {}
                None => best.push((penalised, refit)),
            }
        }
        best.retain(|(penalised, _)| *penalised > LEAST_PENALISED);
        best.sort_by(|a, b| b.0.total_cmp(&a.0));
        best.into_iter().map(|(penalised, refit)| self.outside(refit, penalised, &null)).collect()
    }

    /// Refits the nominated shapes and returns the best refit of each family.
    fn refits(&self, scored_structures: Vec<Scored>, null: &OutsideNull) -> Result<Vec<Refit>> {
        let clean = self.tangent(&Fitted { noise: self.clean, ..self.base.clone() })?;
        let clean = screen(&clean, &self.setting, &self.families, 0, 0).scores;
        let mut nominated: Vec<(usize, StructureShape)> = Vec::new();
        for family in 0..self.families.len() {
            for scores in [&scored_structures, &clean] {
                for shape in leaders(scores, family) {
                    if !nominated.contains(&(family, shape)) {
                        nominated.push((family, shape));
                    }
                }
            }
        }
        let refitted: Vec<Option<Refit>> =
            nominated.par_iter().map(|(family, shape)| self.refit(*family, *shape)).collect::<Result<_>>()?;
        let mut best: Vec<Refit> = Vec::new();
        for refit in refitted.into_iter().flatten() {
            match best.iter_mut().find(|other| other.family == refit.family) {
                Some(same) if same.fitted.objective < refit.fitted.objective => *same = refit,
                Some(_) => {}
                None => best.push(refit),
            }
        }
        let leading = best.iter().map(|refit| self.penalised(refit, null)).fold(LEAST_PENALISED, f64::max);
        best.into_par_iter()
            .map(|refit| {
                let is_near = self.penalised(&refit, null) > leading - REFINED_WITHIN;
                if is_near { self.refined(refit) } else { Ok(refit) }
            })
            .collect()
    }

    fn penalised(&self, refit: &Refit, null: &OutsideNull) -> f64 {
        self.gain(refit) - null.penalties.get(refit.family).copied().unwrap_or(0.0)
    }

    fn gain(&self, refit: &Refit) -> f64 {
        refit.fitted.objective - self.base.objective
    }

    /// Refits the model with a shape; `None` if the model absorbs all of the shape.
    fn refit(&self, family: usize, shape: StructureShape) -> Result<Option<Refit>> {
        let columns = shape.columns_m(&self.setting);
        let kept = kept(&self.entry, &columns);
        if kept.is_empty() {
            return Ok(None);
        }
        let candidate = self.candidate.with_columns(kept.iter().map(|place| columns[*place].clone()).collect());
        let start = candidate.embed(self.candidate, &self.base.theta);
        let fitted = self.subject.fit(&candidate, &starts(start, &self.base, self.clean), Search::Local)?;
        Ok(Some(Refit { family, shape, candidate, fitted }))
    }

    /// Returns the model without the shape's columns, with the parameters and noise of a refit.
    fn without_columns(&self, refit: &Refit) -> Result<Fitted> {
        let n_free = self.candidate.dimension();
        let theta = refit.fitted.theta[..n_free].to_vec();
        let position_m = self.subject.trajectory_m(self.candidate, &theta)?;
        Ok(Fitted { theta, position_m, ..refit.fitted.clone() })
    }

    /// Moves the shape on finer and finer grids. Each grid is weighted by the noise of the shape's own refit.
    fn refined(&self, mut refit: Refit) -> Result<Refit> {
        for fineness in [1.0, 0.5, 0.2] {
            let near = refit.shape.neighbours(&self.setting, fineness);
            if near.is_empty() {
                break;
            }
            let tangent = self.tangent(&self.without_columns(&refit)?)?;
            let scores = screen(&tangent, &self.setting, &[near], 0, 0).scores;
            let Some(best) = scores.iter().max_by(|a, b| a.gain_nats.total_cmp(&b.gain_nats)) else { break };
            if let Some(moved) = self.refit(refit.family, best.shape)?
                && moved.fitted.objective > refit.fitted.objective
            {
                refit = moved;
            }
        }
        Ok(refit)
    }

    fn outside(&self, refit: Refit, penalised_gain_nats: f64, null: &OutsideNull) -> Result<OutsideStructure> {
        let without = self.without_columns(&refit)?;
        let tangent = self.tangent(&without)?;
        let n_own = self.candidate.dimension();
        let amplitudes = &refit.fitted.theta[n_own..];
        let columns = &refit.candidate.columns[self.candidate.columns.len()..];
        let sum_m: Vec<f64> = (0..self.setting.time_s.len())
            .map(|row| columns.iter().zip(amplitudes).map(|(column, amplitude)| column[row] * amplitude).sum())
            .collect();
        let discrepancy_m = self.unabsorbed(&tangent, &without, sum_m)?;
        let rows = &self.setting.rows;
        let squares: f64 = rows.iter().map(|row| discrepancy_m[*row].powi(2)).sum();
        let size_um = 1e6 * (squares / rows.len().max(1) as f64).sqrt();
        let amplitude_sds: Vec<f64> = tangent.visible(columns).iter().map(|visible| 1.0 / visible.norm()).collect();
        let twins = self.twins(&tangent, &without, &discrepancy_m);
        let cycle = &self.subject.experiment().record.cycle;
        let words = describe(refit.shape, amplitudes, &amplitude_sds, size_um, &self.setting, cycle);
        Ok(OutsideStructure {
            kind: refit.shape.kind(),
            sentence: with_twins(words.sentence, &twins),
            gain_nats: self.gain(&refit),
            penalised_gain_nats,
            p_familywise: null.p_familywise(penalised_gain_nats),
            size_um,
            event_time_s: words.event_time_s,
            period_s: words.period_s,
            twins,
            candidate: refit.candidate,
            fitted: refit.fitted,
            discrepancy_m,
        })
    }

    /// Returns the part of a column (m) that the model's parameters cannot absorb.
    fn unabsorbed(&self, tangent: &Tangent, fitted: &Fitted, column_m: Vec<f64>) -> Result<Vec<f64>> {
        let white = tangent.whiten(std::slice::from_ref(&column_m));
        let Some(step) = tangent.absorbing_step(&white[0]) else { return Ok(column_m) };
        let mut left_m = column_m;
        for (column, by) in columns_m(&self.subject, self.candidate, &fitted.theta)?.iter().zip(step) {
            left_m.iter_mut().zip(column).for_each(|(left, value)| *left -= by * value);
        }
        Ok(left_m)
    }

    /// Returns the effects whose signature at the null is nearly parallel to a discrepancy (m), with the cosines.
    fn twins(&self, tangent: &Tangent, fitted: &Fitted, discrepancy_m: &[f64]) -> Vec<(String, f64)> {
        let matrix = &tangent.visible(&[discrepancy_m.to_vec()])[0];
        let mut twins = Vec::new();
        for effect in self.subject.library().effects() {
            let cosine = self
                .signatures(fitted, effect.slug())
                .iter()
                .map(|signature| {
                    let whole = &tangent.whiten(std::slice::from_ref(signature))[0];
                    let visible = tangent.project(whole.clone());
                    let is_visible = visible.norm() > 1e-3 * whole.norm();
                    if is_visible { (visible.dot(matrix) / (visible.norm() * matrix.norm())).abs() } else { 0.0 }
                })
                .fold(0.0, f64::max);
            if cosine > TWIN_COSINE {
                twins.push((effect.slug().to_string(), cosine));
            }
        }
        twins.sort_by(|a, b| b.1.total_cmp(&a.1));
        twins
    }

    /// Derivatives (m per unit of the coordinate) of the position with respect to the first parameter of an effect that the model lacks. There is one column per grid point of the
    /// parameters unidentified at the effect's null.
    fn signatures(&self, fitted: &Fitted, slug: &str) -> Vec<Vec<f64>> {
        let base = self.subject.base();
        let added = self.candidate.effects.iter().filter(|effect| !base.effects.contains(effect)).map(String::as_str);
        let effects: Vec<&str> = added.chain([slug]).collect();
        let Ok(extended) = self.subject.extended(&effects) else { return Vec::new() };
        let extended = extended.with_columns(self.candidate.columns.clone());
        let new = |name: &str| self.candidate.free.iter().all(|free| free.name != name);
        let Some(place) = extended.free.iter().position(|free| free.null.is_some() && new(free.name)) else {
            return Vec::new();
        };
        let mut list = Vec::new();
        for quantile in [0.15, 0.5, 0.85] {
            let mut theta = extended.embed(self.candidate, &fitted.theta);
            for (k, free) in extended.free.iter().enumerate() {
                if free.is_unidentified_at_null() && new(free.name) {
                    theta[k] = free.quantile(quantile);
                }
            }
            if let Ok(columns) = columns_m(&self.subject, &extended, &theta) {
                list.push(columns[place].clone());
            }
        }
        list
    }
}

/// Starts at the coordinates of another fit: one with that fit's noise, one with noise that was not estimated from the residuals.
pub(super) fn starts(theta: Vec<f64>, fitted: &Fitted, clean: NoiseValues) -> [(Vec<f64>, NoiseValues); 2] {
    [(theta.clone(), fitted.noise), (theta, clean)]
}

/// Leading shapes of a family, none of which are neighbours on the family's grid.
fn leaders(scores: &[Scored], family: usize) -> Vec<StructureShape> {
    let mut of_family: Vec<(usize, &Scored)> =
        scores.iter().filter(|score| score.family == family && score.degrees > 0).enumerate().collect();
    of_family.sort_by(|a, b| b.1.gain_nats.total_cmp(&a.1.gain_nats));
    let mut chosen: Vec<(usize, StructureShape)> = Vec::new();
    for (place, score) in of_family {
        if chosen.len() == NOMINATED {
            break;
        }
        if chosen.iter().all(|(other, _)| other.abs_diff(place) > 2) {
            chosen.push((place, score.shape));
        }
    }
    chosen.into_iter().map(|(_, shape)| shape).collect()
}

fn with_twins(sentence: String, twins: &[(String, f64)]) -> String {
    if twins.is_empty() {
        return sentence;
    }
    let names: Vec<String> = twins.iter().take(3).map(|(slug, _)| format!("`{slug}`")).collect();
    format!(
        "{sentence} In this experiment its shape is nearly that of {}: the two cannot be distinguished by shape.",
        names.join(" or ")
    )
}
