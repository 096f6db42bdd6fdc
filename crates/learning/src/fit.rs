//! Fits of pairs (a quantity as a function of a state), with their evidence.
//!
//! All weights of a pair have a normal prior about 0 with one standard deviation τ, which is chosen by the evidence Z. Z follows from the maximum of the posterior
//! density and the curvature H there (Laplace). For n weights, ln Z = ln L + ln p(θ) − n ln τ − ½ ln det H. The gain is ln Z less that of the model without the pair.
//! Functions that the data do not support shrink to zero.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::pairs::{Pair, StateKind};
use base::error::Result;
use criticism::derivatives::columns_m;
use criticism::future::{FutureScore, future_score};
use criticism::refit::Refitted;
use criticism::{Candidate, Fitted, NoiseValues, Search, Subject, Tangent};

/// Prior standard deviations that are tried for the weights, in order. A weight of 1 changes its quantity by a factor of e over the range of states.
const SPREADS: [f64; 4] = [0.3, 1.0, 3.0, 0.08];

/// A pair (a quantity as a function of a state) with its fitted model.
pub struct PairFit {
    /// Index of the pair in the list of pairs.
    pub pair: usize,
    /// The base model with the pair; the weights have their prior.
    pub candidate: Candidate,
    /// Best fit of `candidate`.
    pub fitted: Fitted,
    /// Gain in ln evidence over the model without the pair, in nats.
    pub evidence_nats: f64,
    /// Log scores of cycles given the cycles before them; `None` if no cycle is held out.
    pub future: Option<FutureScore>,
}

/// Returns the indices of a learnt function's weights among the coordinates. The weights are the parameters of the candidate's last effect.
pub fn weights(candidate: &Candidate) -> Vec<usize> {
    let last = candidate.effects.len().checked_sub(1);
    (0..candidate.free.len()).filter(|k| candidate.free[*k].effect == last && last.is_some()).collect()
}

/// Fits a model, starting from the coordinates and noise in `start`. Each parameter of the model's last effect gets a normal approximation of its specified prior.
/// Returns the model, its fit and its ln evidence, up to a constant that all models share. Returns `None` if there is no fit or no evidence.
pub fn fit_own_priors(
    subject: &Subject,
    candidate: &Candidate,
    start: (Vec<f64>, NoiseValues),
) -> Option<(Candidate, Fitted, f64)> {
    let mut entry = candidate.clone();
    for k in weights(candidate) {
        entry.free[k].prior = Some(entry.free[k].as_normal());
    }
    fit_with_evidence(subject, entry, start)
}

/// Fits a model, starting from the coordinates and noise in `start`. Every weight of the learnt function has a normal prior of mean 0 and standard deviation `spread`.
/// Returns the model, its fit and its ln evidence, up to a constant that all models share. Returns `None` if there is no fit or no evidence.
pub fn fit_spread(
    subject: &Subject,
    candidate: &Candidate,
    spread: f64,
    start: (Vec<f64>, NoiseValues),
) -> Option<(Candidate, Fitted, f64)> {
    fit_with_evidence(subject, with_spread(candidate, spread), start)
}

fn fit_with_evidence(
    subject: &Subject,
    candidate: Candidate,
    start: (Vec<f64>, NoiseValues),
) -> Option<(Candidate, Fitted, f64)> {
    let fitted = subject.fit(&candidate, &[start], Search::Local).ok()?;
    let ln_evidence = ln_evidence(subject, &candidate, &fitted).ok()?;
    Some((candidate, fitted, ln_evidence))
}

/// Returns the model with a normal prior of mean 0 and standard deviation `spread` for every weight of the learnt function.
fn with_spread(candidate: &Candidate, spread: f64) -> Candidate {
    let mut entry = candidate.clone();
    for k in weights(candidate) {
        let unit = entry.free[k].coordinate.unit(0.0);
        entry.free[k].prior = Some((0.0, spread / unit));
    }
    entry
}

/// Log evidence (nats) of a model by Laplace's approximation, up to a constant that all models share.
fn ln_evidence(subject: &Subject, candidate: &Candidate, fitted: &Fitted) -> Result<f64> {
    let tangent = Tangent::new(subject, candidate, fitted)?;
    let of_weights = weights(candidate).into_iter().filter_map(|k| candidate.free[k].prior);
    let ln_priors: f64 = of_weights.map(|(_, sd)| sd.ln()).sum();
    Ok(fitted.objective - ln_priors - 0.5 * tangent.ln_det_precision())
}

/// The base model without a learnt function, with its log evidence.
pub struct PairlessModel<'a> {
    /// The model at its fit.
    pub refitted: &'a Refitted,
    ln_evidence: f64,
}

impl<'a> PairlessModel<'a> {
    /// Computes the log evidence of a model at its fit.
    ///
    /// # Errors
    /// Errors of computing derivatives at the fit.
    pub fn new(subject: &Subject, refitted: &'a Refitted) -> Result<Self> {
        let tangent = Tangent::new(subject, &refitted.candidate, &refitted.fitted)?;
        Ok(Self { refitted, ln_evidence: refitted.fitted.objective - 0.5 * tangent.ln_det_precision() })
    }
}

/// Fits a pair's model with each prior standard deviation in `spreads` and keeps the fit with the highest evidence; `None` if the model cannot be fitted.
fn fit(
    subject: &Subject,
    (base, ln_evidence_of_base): (&(Vec<f64>, NoiseValues), f64),
    smaller: &Candidate,
    candidate: &Candidate,
    spreads: &[f64],
) -> Option<(Candidate, Fitted, f64)> {
    let mut best: Option<(Candidate, Fitted, f64)> = None;
    for spread in spreads {
        let start = best.as_ref().map_or_else(
            || (candidate.embed(smaller, &base.0), base.1),
            |(_, fitted, _)| (fitted.theta.clone(), fitted.noise),
        );
        let Some((entry, fitted, ln_evidence)) = fit_spread(subject, candidate, *spread, start) else { continue };
        let gain = ln_evidence - ln_evidence_of_base;
        if best.as_ref().is_none_or(|(_, _, before)| gain > *before) {
            best = Some((entry, fitted, gain));
        }
    }
    best
}

/// Model of a pair (a quantity as a function of a state), its fit in the search, and its gain in log evidence (nats).
pub type SearchedFit = (Candidate, Fitted, f64);

/// Adds each pair of a quantity and a state to the base model and fits it; `None` for a pair without a model.
pub fn search_all(
    subject: &Subject,
    base: &PairlessModel<'_>,
    pairs: &[Pair],
    candidates: &[Option<Candidate>],
) -> Vec<Option<SearchedFit>> {
    let start = (base.refitted.fitted.theta.clone(), base.refitted.fitted.noise);
    let of = |place: usize| {
        let candidate = candidates[place].as_ref()?;
        let spreads: &[f64] = if matches!(pairs[place].kind, StateKind::Memory(_)) { &SPREADS[..1] } else { &SPREADS };
        fit(subject, (&start, base.ln_evidence), &base.refitted.candidate, candidate, spreads)
    };
    (0..pairs.len()).into_par_iter().map(of).collect()
}

/// Refits pairs to the positions and under the noise of `subject`, starting from fits under other conditions.
pub fn refit_pairs(
    subject: &Subject,
    base: &PairlessModel<'_>,
    sought: Vec<Option<SearchedFit>>,
) -> Vec<Option<SearchedFit>> {
    let of = |sought: Option<SearchedFit>| {
        let (candidate, fitted, _) = sought?;
        let (candidate, fitted, ln_evidence) = fit_with_evidence(subject, candidate, (fitted.theta, fitted.noise))?;
        Some((candidate, fitted, ln_evidence - base.ln_evidence))
    };
    sought.into_par_iter().map(of).collect()
}

/// Scores the predictions of fitted pairs. Pairs without a fit are left out.
pub fn score_all(subject: &Subject, fits: Vec<Option<SearchedFit>>) -> Vec<PairFit> {
    let of = |(pair, fit): (usize, Option<SearchedFit>)| {
        let (candidate, fitted, evidence_nats) = fit?;
        let future = future(subject, &candidate, &fitted).ok()?;
        Some(PairFit { pair, candidate, fitted, evidence_nats, future })
    };
    fits.into_par_iter().enumerate().filter_map(of).collect()
}

/// Fits the model of a pair (a quantity as a function of a state) to a subject with another noise model, and scores its predictions. `None` if there is no fit or no
/// held-out cycle.
pub fn fit_under(subject: &Subject, learnt: &PairFit) -> Option<(Fitted, FutureScore)> {
    let start = (learnt.fitted.theta.clone(), learnt.fitted.noise);
    let fitted = subject.fit(&learnt.candidate, &[start], Search::Local).ok()?;
    let future = future(subject, &learnt.candidate, &fitted).ok()??;
    Some((fitted, future))
}

/// Log scores of future cycles for a model whose weights keep the prior of the fit.
fn future(subject: &Subject, candidate: &Candidate, fitted: &Fitted) -> Result<Option<FutureScore>> {
    let mut entry = candidate.clone();
    weights(candidate).into_iter().for_each(|k| entry.free[k].null = None);
    future_score(subject, &entry, fitted)
}

/// First-order gains of pairs (a quantity as a function of a state) in simulated data. They select the pairs that are worth fitting.
pub struct Screen {
    tangent: Tangent,
    position_m: Vec<f64>,
    /// For each candidate, the changes of the whitened positions per unit of each weight, one column per weight. The part that the base model absorbs is removed.
    /// `None` if the candidate has no derivatives.
    directions: Vec<Option<DMatrix<f64>>>,
    units: Vec<Vec<f64>>,
}

impl Screen {
    /// Computes the whitened directions of every candidate's weights at the fit of the base.
    ///
    /// # Errors
    /// Errors of computing the base's derivatives at its fit.
    pub fn new(subject: &Subject, base: &Refitted, candidates: &[Option<Candidate>]) -> Result<Self> {
        let tangent = Tangent::new(subject, &base.candidate, &base.fitted)?;
        let of = |candidate: &Option<Candidate>| {
            let candidate = candidate.as_ref()?;
            let theta = candidate.embed(&base.candidate, &base.fitted.theta);
            let columns = columns_m(subject, candidate, &theta).ok()?;
            let weight_columns: Vec<Vec<f64>> = weights(candidate).into_iter().map(|k| columns[k].clone()).collect();
            Some(DMatrix::from_columns(&tangent.visible(&weight_columns)))
        };
        let directions = candidates.par_iter().map(of).collect();
        let unit = |candidate: &Option<Candidate>| {
            let entry = candidate.as_ref();
            entry.map_or(Vec::new(), |candidate| {
                weights(candidate).iter().map(|k| candidate.free[*k].coordinate.unit(0.0)).collect()
            })
        };
        let units = candidates.iter().map(unit).collect();
        Ok(Self { tangent, position_m: base.fitted.position_m.clone(), directions, units })
    }

    /// Returns the first-order gains in log evidence (nats) of all pairs for the positions in `data`; −∞ for a pair without directions.
    fn gains_nats(&self, data: &Subject) -> Vec<f64> {
        let left_m = data.fitted_m.iter().zip(&self.position_m).map(|(y, x)| y.map_or(0.0, |y| y - x)).collect();
        let residual = self.tangent.project(self.tangent.whiten(&[left_m]).swap_remove(0));
        let gain = |(directions, units): (&Option<DMatrix<f64>>, &Vec<f64>)| {
            let Some(directions) = directions else { return f64::NEG_INFINITY };
            let of_spread = |spread: &f64| -> Option<f64> {
                let sds: Vec<f64> = units.iter().map(|unit| spread / unit).collect();
                let scaled = DMatrix::from_fn(directions.nrows(), sds.len(), |i, j| directions[(i, j)] * sds[j]);
                let n = sds.len();
                let information = scaled.tr_mul(&scaled) + DMatrix::identity(n, n);
                let slope: DVector<f64> = scaled.tr_mul(&residual);
                let factor = information.cholesky()?;
                let ln_det: f64 = factor.l_dirty().diagonal().iter().take(n).map(|l| 2.0 * l.ln()).sum();
                Some(0.5 * slope.dot(&factor.solve(&slope)) - 0.5 * ln_det)
            };
            SPREADS.iter().filter_map(of_spread).fold(f64::NEG_INFINITY, f64::max)
        };
        self.directions.iter().zip(&self.units).map(gain).collect()
    }
}

/// Number of pairs (quantity and state) that are fitted to each simulated record: those with the largest first-order gains.
const N_REFITTED: usize = 2;

/// Returns the largest gain in log evidence (nats) that a search finds in data in which no quantity depends on a state.
pub fn largest_gain(data: &Subject, base: &Refitted, screen: &Screen, candidates: &[Option<Candidate>]) -> f64 {
    let start = (base.fitted.theta.clone(), base.fitted.noise);
    let Ok(fitted) = data.fit(&base.candidate, &[start], Search::Local) else { return f64::INFINITY };
    let Ok(ln_evidence) =
        Tangent::new(data, &base.candidate, &fitted).map(|tangent| fitted.objective - 0.5 * tangent.ln_det_precision())
    else {
        return f64::INFINITY;
    };
    let gains = screen.gains_nats(data);
    let mut order: Vec<usize> = (0..candidates.len()).filter(|place| candidates[*place].is_some()).collect();
    order.sort_by(|a, b| gains[*b].total_cmp(&gains[*a]));
    let start = (fitted.theta, fitted.noise);
    let found = order.iter().take(N_REFITTED).filter_map(|place| {
        let candidate = candidates[*place].as_ref()?;
        fit(data, (&start, ln_evidence), &base.candidate, candidate, &SPREADS[..1]).map(|(_, _, gain)| gain)
    });
    found.fold(0.0, f64::max)
}
