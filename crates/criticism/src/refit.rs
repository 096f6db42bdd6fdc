//! Refits of a reference model with every effect, and with leading pairs of effects, added.

use rayon::prelude::*;

use super::future::{FutureScore, future_score};
use super::{Candidate, Fitted, Search, Subject};
use crate::NoiseValues;
use base::error::Result;
use posterior::monitor::{Counter, Monitor};

/// A model with its fit and its scores of future cycles.
#[derive(Clone)]
pub struct Refitted {
    /// Model of the mean position.
    pub candidate: Candidate,
    /// Best fit of the model.
    pub fitted: Fitted,
    /// Log scores of future cycles; `None` when no cycle is held out.
    pub future: Option<FutureScore>,
}

/// Gains of a model over another one that it is compared with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gain {
    /// Gain over the smaller model, in log likelihood of the fitted cycles with the noise estimated anew, in nats.
    pub fitted: f64,
    /// Gain in the log score of future cycles, in nats; `None` when no cycle is held out.
    pub future: Option<f64>,
    /// Gain in the log score of the last cycle, in nats; `None` when no cycle is held out.
    pub last: Option<f64>,
    /// Largest change of a predicted position, divided by the known or estimated noise standard deviation.
    pub largest_change: f64,
    /// Value by which candidates are ranked: fitted plus last-cycle gain, less two nats for each parameter beyond one per effect.
    pub rank: f64,
}

/// Penalty of the rank, in nats, for each parameter beyond one per effect.
const NATS_PER_PARAMETER: f64 = 2.0;

impl Refitted {
    /// Fits a model from the search's own starts and from the fits of the smaller models in `contained`. `search` sets the thoroughness.
    ///
    /// # Errors
    /// [`base::Error::Numerical`] if the model has no solution at any start.
    pub fn new(subject: &Subject, candidate: Candidate, contained: &[&Self], search: Search) -> Result<Self> {
        let starts: Vec<(Vec<f64>, NoiseValues)> = contained
            .iter()
            .map(|smaller| (candidate.embed(&smaller.candidate, &smaller.fitted.theta), smaller.fitted.noise))
            .collect();
        let fitted = subject.fit(&candidate, &starts, search)?;
        debug_assert!(
            contained.iter().all(|smaller| fitted.objective >= smaller.fitted.objective - 1e-6),
            "a model with {:?} fits no worse than one that it contains: {} against {:?}",
            candidate.effects,
            fitted.objective,
            contained.iter().map(|smaller| (&smaller.candidate.effects, smaller.fitted.objective)).collect::<Vec<_>>()
        );
        Self::at(subject, candidate, fitted)
    }

    /// Scores a model at an existing fit.
    ///
    /// # Errors
    /// Errors of scoring the future cycles.
    pub fn at(subject: &Subject, candidate: Candidate, fitted: Fitted) -> Result<Self> {
        let future = future_score(subject, &candidate, &fitted)?;
        Ok(Self { candidate, fitted, future })
    }

    /// Gain over a smaller model that this one contains.
    pub fn gain_over(&self, smaller: &Self, subject: &Subject) -> Gain {
        let both = self.future.zip(smaller.future);
        let last = both.map(|(future_score, other)| future_score.last - other.last);
        let fitted = self.fitted.objective - smaller.fitted.objective;
        let largest_m = self.fitted.position_m.iter().zip(&smaller.fitted.position_m);
        let largest_m = largest_m.fold(0.0, |largest: f64, (a, b)| largest.max((a - b).abs()));
        let n_effects = self.candidate.effects.len() - smaller.candidate.effects.len();
        let n_parameters = self.candidate.free.len() - smaller.candidate.free.len();
        let penalty = NATS_PER_PARAMETER * n_parameters.saturating_sub(n_effects) as f64;
        Gain {
            fitted,
            future: both.map(|(future_score, other)| future_score.all - other.all),
            last,
            largest_change: largest_m / subject.reference_noise_m(),
            rank: fitted + last.unwrap_or(0.0) - penalty,
        }
    }
}

/// Refits models. The starts of each model include the fits of those models in `contained` that it contains. The result is `None` for a model that cannot be evaluated.
pub fn refit_all(
    subject: &Subject,
    candidates: &[Candidate],
    contained: &[&Refitted],
    search: Search,
    monitor: &dyn Monitor,
) -> Vec<Option<Refitted>> {
    let counter = Counter::new(monitor, candidates.len());
    let refit = |candidate: &Candidate| {
        let is_contained =
            |smaller: &&&Refitted| smaller.candidate.effects.iter().all(|slug| candidate.effects.contains(slug));
        let inside: Vec<&Refitted> = contained.iter().filter(is_contained).copied().collect();
        let refitted = Refitted::new(subject, candidate.clone(), &inside, search).ok();
        counter.add_one();
        refitted
    };
    candidates.par_iter().map(refit).collect()
}
