//! Search among pairs of a quantity and a state: fits of every pair added to a record's model, and the criteria for the leading pair.

use super::distil::{FittedFormula, find_simplest_formula};
use super::fit::{PairFit, PairlessModel, Screen, fit_under, largest_gain, refit_pairs, score_all, search_all};
use super::pairs::{Pair, pairs};
use base::error::Result;
use criticism::bootstrap::{Bootstrap, Simulations, simulated};
use criticism::outliers;
use criticism::refit::{Refitted, refit_all};
use criticism::{Candidate, Fitted, Search, Subject, screen};
use documents::errors::ModelErrors;
use posterior::monitor::{Counter, Monitor};

/// Largest p at which a pair (a quantity as a function of a state) may be learnt.
pub const LARGEST_P: f64 = 0.02;
/// Least gain in log evidence (nats) of a learnt pair (a quantity as a function of a state). 5 nats are odds of 150 to 1.
pub const LEAST_EVIDENCE_NATS: f64 = 5.0;
/// Least gain (nats) of a learnt pair (quantity and state) in the log score of unseen cycles.
pub const LEAST_FUTURE_NATS: f64 = 3.0;
/// Largest loss (nats) of a learnt pair (quantity and state) in the log score of the last unseen cycle.
const LARGEST_LOSS_NATS: f64 = 0.1;
/// Least change of a position by a learnt pair (quantity and state), divided by the noise standard deviation.
const SMALLEST_CHANGE: f64 = 0.25;
/// Difference in log evidence (nats) below which two pairs count as equally good. 6 nats are odds of 400 to 1.
pub const EQUAL_NATS: f64 = 6.0;
/// Largest loss (nats) in the log score of unseen cycles at which a formula may replace a learnt function. `FORMULA_LOSS` times the function's gain is added to this loss.
pub const FORMULA_LOSS_NATS: f64 = 3.0;
pub const FORMULA_LOSS: f64 = 0.05;
/// Difference in log evidence (nats) up to which another pair may give a simpler formula that predicts as well.
const SIMPLER_WITHIN_NATS: f64 = 40.0;
/// Largest deficit (nats) of a library effect, in the log score of unseen cycles, at which it is preferred to the learnt function. `LIBRARY_SHARE` times the function's gain is
/// added to the deficit. A library effect has a few parameters, the function eight.
const LIBRARY_NATS: f64 = 4.0;
const LIBRARY_SHARE: f64 = 0.02;
/// Number of positions to which nonlinear models are fitted before they are fitted to all positions.
const MOST_SEARCHED_SLOWLY: usize = 200;
/// Least first-order bound of a nonlinear model's gain, as a fraction of the function's gain, at which the model is fitted.
const WITHIN_REACH: f64 = 0.5;
/// Largest number of positions in the search of pairs. If the record has more, each pair's fit is then continued with all positions.
const MOST_SEARCHED: usize = 800;
/// Random stream of the simulated searches, separate from other streams of the seed.
const STREAM: u64 = 0x1ea4;

/// Settings of `learn`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Request {
    /// Largest number of simulated searches.
    pub n_simulations: usize,
    /// Seed of all random numbers.
    pub seed: u64,
    /// True if functions of a state may only rise or only fall.
    pub is_monotone: bool,
    /// Errors of the base model's posterior predictions; `None` if the base model was not sampled. The document then shows the errors of its best fit.
    pub base_errors: Option<ModelErrors>,
}

impl Default for Request {
    fn default() -> Self {
        Self { n_simulations: 99, seed: 1, is_monotone: false, base_errors: None }
    }
}

/// A search among all pairs of a quantity and a state.
pub struct PairSearch {
    /// The record, with a library of effects that also contains every pair (a quantity as a function of a state) as an effect.
    pub subject: Subject,
    /// All pairs that the search fits.
    pub pairs: Vec<Pair>,
    /// True if the learnt functions must be monotone.
    pub is_monotone: bool,
    /// Base model with each pair (a quantity as a function of a state); `None` if the pair cannot be added to it.
    candidates: Vec<Option<Candidate>>,
    /// The base model, without any pair.
    pub base: Refitted,
    /// Fitted pairs, the best one first.
    pub learnt: Vec<PairFit>,
    /// Positions that the search used, and its largest gain.
    searched: SearchedPositions,
}

/// Positions that the search uses, all or a selection, with the base's fit to them and the search's largest gain in log evidence (nats).
struct SearchedPositions {
    subject: Subject,
    base: Refitted,
    gain_nats: f64,
}

impl PairSearch {
    /// Fits every pair, each added to a base model.
    ///
    /// # Errors
    /// Errors of fitting the base model.
    pub fn new(subject: &Subject, base: Refitted, is_monotone: bool, monitor: &dyn Monitor) -> Result<Self> {
        let pairs = pairs(subject, &base, is_monotone)?;
        let library = subject.library().clone().with_all(pairs.iter().map(|pair| pair.effect));
        let subject = subject.with_library(&library)?;
        let candidates: Vec<Option<Candidate>> =
            pairs.iter().map(|pair| subject.extended(&[pair.effect.slug()]).ok()).collect();
        monitor.stage("fitting every quantity as a function of every state");
        let few = subject.thinned(MOST_SEARCHED)?;
        let was_thinned = few.is_some();
        let (mut few, mut few_base) = match few {
            None => (subject.clone(), base.clone()),
            Some(few) => {
                let few_base = refitted_base(&few, &base)?;
                (few, few_base)
            }
        };
        let mut sought = search_all(&few, &PairlessModel::new(&few, &few_base)?, &pairs, &candidates);
        let (mut subject, mut base) = (subject, base);
        if subject.is_noise_known() {
            // Known noise bounds all noise, so that a misfit does not count as slow noise. Fits under these bounds stop early if they start far from their best point. So
            // the search above allows noise of any size, and its fits are the starts here.
            subject = subject.with_bounded_noise();
            base = Refitted::at(&subject, base.candidate.clone(), refitted_base(&subject, &base)?.fitted)?;
            few = few.with_bounded_noise();
            few_base = refitted_base(&few, &few_base)?;
            sought = refit_pairs(&few, &PairlessModel::new(&few, &few_base)?, sought);
        }
        let gain_nats = sought.iter().flatten().map(|(.., gain)| *gain).fold(f64::NEG_INFINITY, f64::max).max(0.0);
        let fits =
            if was_thinned { refit_pairs(&subject, &PairlessModel::new(&subject, &base)?, sought) } else { sought };
        let mut learnt = score_all(&subject, fits);
        learnt.sort_by(|a, b| b.evidence_nats.total_cmp(&a.evidence_nats));
        let searched = SearchedPositions { subject: few, base: few_base, gain_nats };
        Ok(Self { subject, pairs, is_monotone, candidates, base, learnt, searched })
    }
}

impl PairSearch {
    /// Returns p of the search's largest gain, from searches in data simulated from the base model.
    pub fn p(&self, request: &Request, monitor: &dyn Monitor) -> Result<f64> {
        let SearchedPositions { subject, base, gain_nats } = &self.searched;
        let screen = Screen::new(subject, base, &self.candidates)?;
        let simulations = Simulations { most: request.n_simulations, only_for: Some(LARGEST_P) };
        let counter = Counter::new(monitor, request.n_simulations);
        let largest = |number: usize| {
            let data = simulated(subject, base, request.seed ^ STREAM, number);
            let gain = largest_gain(&data, base, &screen, &self.candidates);
            counter.add_one();
            gain
        };
        Ok(Bootstrap::of(*gain_nats, simulations, largest).p(*gain_nats))
    }

    /// Returns the leading pair that predicts unseen cycles, or the reason why there is none.
    ///
    /// # Errors
    /// The reason, in words.
    pub fn choose_pair(&self, p: f64) -> std::result::Result<&PairFit, String> {
        let predicts = |learnt: &&PairFit| match learnt.future.zip(self.base.future) {
            Some((future_score, base)) => {
                future_score.all - base.all > LEAST_FUTURE_NATS && future_score.last - base.last > -LARGEST_LOSS_NATS
            }
            None => false,
        };
        let shows = |learnt: &&PairFit| {
            let changes = learnt.fitted.position_m.iter().zip(&self.base.fitted.position_m);
            let largest_m = changes.fold(0.0_f64, |largest, (a, b)| largest.max((a - b).abs()));
            largest_m >= SMALLEST_CHANGE * self.subject.reference_noise_m()
        };
        let Some(leading) = self.learnt.first() else {
            let is_outside = self.subject.problem().outside().is_some();
            let why = if is_outside {
                "another program computes the law"
            } else {
                "no function of a state can be fitted to this record"
            };
            return Err(why.into());
        };
        if p > LARGEST_P {
            return Err("no gain beyond chance".into());
        }
        let is_near = |pair_fit: &&PairFit| leading.evidence_nats - pair_fit.evidence_nats <= EQUAL_NATS;
        let Some(chosen) = self.learnt.iter().filter(is_near).filter(predicts).find(shows) else {
            return Err("none predicts unseen cycles".into());
        };
        if chosen.evidence_nats < LEAST_EVIDENCE_NATS {
            return Err(format!(
                "the evidence is {:.1} nats, but {LEAST_EVIDENCE_NATS:.0} are required",
                chosen.evidence_nats
            ));
        }
        Ok(chosen)
    }

    /// Returns the slugs of library effects that predict unseen cycles as well as the learnt function of `chosen`.
    pub fn find_preferred_effects(&self, chosen: &PairFit, monitor: &dyn Monitor) -> Vec<String> {
        let names: Vec<&str> = self.pairs.iter().map(|pair| pair.effect.slug()).collect();
        let others = self.subject.library().effects().iter().filter(|effect| !names.contains(&effect.slug()));
        let candidates = others.filter_map(|effect| self.subject.extended(&[effect.slug()]).ok());
        let (slow, quick): (Vec<Candidate>, _) = candidates.partition(|candidate| candidate.model.is_nonlinear());
        let mut refitted = refit_all(&self.subject, &quick, &[&self.base], Search::Wide, monitor);
        let all_slow = || refit_all(&self.subject, &slow, &[&self.base], Search::Wide, monitor);
        refitted.extend(self.refit_slow(&slow, chosen, monitor).unwrap_or_else(|_| all_slow()));
        let Some((learnt, base)) = chosen.future.zip(self.base.future) else { return Vec::new() };
        let allowed = LIBRARY_NATS + LIBRARY_SHARE * (learnt.all - base.all).max(0.0);
        let mut good: Vec<(f64, String)> = refitted
            .into_iter()
            .flatten()
            .filter_map(|refitted| Some((refitted.future?.all, refitted.candidate.effects.last()?.clone())))
            .filter(|(score, _)| *score >= learnt.all - allowed)
            .collect();
        good.sort_by(|a, b| b.0.total_cmp(&a.0));
        good.into_iter().map(|(_, slug)| slug).collect()
    }

    /// Fits those nonlinear models whose first-order bound on the gain is large enough. Each is fitted to a few positions first, and then to all.
    fn refit_slow(
        &self,
        candidates: &[Candidate],
        chosen: &PairFit,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Option<Refitted>>> {
        let screen = screen::Screen::new(&self.subject, &self.base, candidates)?;
        let least = WITHIN_REACH * screen.gain_nats(&self.subject, &chosen.fitted.position_m);
        let bounded = candidates.iter().zip(screen.bounds_nats(&self.subject));
        let candidates: Vec<Candidate> =
            bounded.filter(|(_, bound)| *bound >= least).map(|(candidate, _)| candidate.clone()).collect();
        let Some(few) = self.subject.thinned(MOST_SEARCHED_SLOWLY)? else {
            return Ok(refit_all(&self.subject, &candidates, &[&self.base], Search::Wide, monitor));
        };
        let base = refitted_base(&few, &self.base)?;
        let sought = refit_all(&few, &candidates, &[&base], Search::Wide, monitor).into_iter().flatten();
        let finished = sought.map(|refitted| {
            let start = (refitted.fitted.theta, refitted.fitted.noise);
            let fitted = self.subject.fit(&refitted.candidate, &[start], Search::Local).ok()?;
            Refitted::at(&self.subject, refitted.candidate, fitted).ok()
        });
        Ok(finished.collect())
    }

    /// Returns the fraction of the squared error, beyond the noise, that a fit removes; `None` if the error does not exceed the noise.
    pub fn explained(&self, fitted: &Fitted) -> Option<f64> {
        let is_scored = self.subject.scored_m.iter().any(Option::is_some);
        let rows = if is_scored { &self.subject.scored_m } else { &self.subject.fitted_m };
        let noise = self.subject.reference_noise_m().powi(2);
        let [before, after] =
            [&self.base.fitted, fitted].map(|fitted| fitted.rmse_m(rows).map(|rmse| (rmse * rmse - noise).max(0.0)));
        let (before, after) = (before?, after?);
        (before > 0.0).then(|| (1.0 - after / before).clamp(-1.0, 1.0))
    }

    /// Finds the simplest formula that predicts unseen cycles nearly as well as the learnt function. Formulas of the chosen pair may have any number of parameters. Formulas of
    /// other pairs with nearly equal evidence may have only one: a line in another state may predict as well as a function with eight weights. All fits use the noise terms of the
    /// model's specification, because the formula is added to that model. Slow noise, which only the search allows, would absorb slow changes and leave only fast ones to the
    /// formula.
    pub fn write_formula<'a>(&'a self, chosen: &'a PairFit) -> (&'a PairFit, Option<FittedFormula>) {
        let Ok((subject, base)) = with_own_noise(&self.subject, &self.base) else { return (chosen, None) };
        let Some(((function, of_function), of_base)) = fit_under(&subject, chosen).zip(base.future) else {
            return (chosen, None);
        };
        // If even the function's residual exceeds the noise, the excess is model error that is correlated between rows. Each nat then counts correspondingly less.
        let left = (1e-6 * function.noise[0] / subject.reference_noise_m()).powi(2).max(1.0);
        let gain = of_function.all - of_base.all;
        let least = of_function.all - FORMULA_LOSS_NATS * left - FORMULA_LOSS * gain;
        let is_within = |other: &&PairFit| other.evidence_nats > chosen.evidence_nats - SIMPLER_WITHIN_NATS;
        let formulas = self.learnt.iter().filter(is_within).filter_map(|pair_fit| {
            let (pair, most) = (&self.pairs[pair_fit.pair], if pair_fit.pair == chosen.pair { usize::MAX } else { 1 });
            Some((pair_fit, find_simplest_formula(&subject, &base, pair, (least, most))?))
        });
        let simplest = formulas.min_by(|(_, a), (_, b)| {
            let n = |fitted_formula: &FittedFormula| fitted_formula.parameters.len();
            n(a).cmp(&n(b)).then(b.score.total_cmp(&a.score))
        });
        simplest.map_or((chosen, None), |(pair_fit, formula)| (pair_fit, Some(formula)))
    }

    /// Returns whether a fitted pair differs from `pair` in its quantity or state. A function with the opposite direction does not count as another.
    pub fn is_another(&self, other: &PairFit, pair: &Pair) -> bool {
        let entry = &self.pairs[other.pair];
        (entry.quantity, entry.state) != (pair.quantity, pair.state)
    }
}

/// Refits a base model under the positions and the noise of `subject`. The result has no score of future cycles.
fn refitted_base(subject: &Subject, base: &Refitted) -> Result<Refitted> {
    let start = (base.fitted.theta.clone(), base.fitted.noise);
    let fitted = subject.fit(&base.candidate, &[start], Search::Local)?;
    Ok(Refitted { fitted, future: None, ..base.clone() })
}

/// Fits a record's base model without outliers; returns the record without outliers and the model.
///
/// # Errors
/// Errors of the fit.
pub fn fitted_base(subject: &Subject) -> Result<(Subject, Refitted)> {
    let (subject, fitted, _) = outliers::exclude_outliers(subject, &subject.base())?;
    let base = Refitted::at(&subject, subject.base(), fitted)?;
    Ok((subject, base))
}

/// Refits a record's model with only the noise terms of its specification; returns the record and the model.
///
/// # Errors
/// Errors of the fit.
pub fn with_own_noise(subject: &Subject, base: &Refitted) -> Result<(Subject, Refitted)> {
    let subject = subject.clone().with_specified_noise();
    let fitted = subject.fit(&base.candidate, &[(base.fitted.theta.clone(), base.fitted.noise)], Search::Local)?;
    let base = Refitted::at(&subject, base.candidate.clone(), fitted)?;
    Ok((subject, base))
}
