//! What a caller decides about a run.

use super::moves::{Move, default_move};
use base::error::{Place, Setting};
use base::{Error, Result};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Settings of a run. All of them, except the number of threads and how batches are split, are part of what fixes the
/// result to the last bit.
#[derive(Clone)]
pub struct SamplerOptions {
    /// Walkers of one ensemble: even, at least 8 and more than twice the dimension.
    pub n_walkers: usize,
    /// Independent ensembles, at least 4.
    pub n_ensembles: usize,
    /// Steps of each walker after which the run ends, burn-in included.
    pub max_steps: u64,
    /// Seed of all random streams.
    pub seed: u64,
    /// How walkers propose.
    pub kernel: Arc<dyn Move>,
    /// Largest fraction of half-steps that jump into the posterior's approximation ([`super::moves::Independence`]) instead of
    /// moving by `kernel`; less is used where jumps are refused. 0 for none.
    pub jump_fraction: f64,
    /// Keep every so many steps. `None`: every step at first, twice as rarely each time that `max_stored_steps` are full.
    pub store_every: Option<u64>,
    /// Steps of each ensemble that are kept when `store_every` is `None`; even.
    pub max_stored_steps: usize,
    /// End as soon as the demands are met; otherwise go on to `max_steps`.
    pub stop_when_converged: bool,
    /// When a run counts as converged.
    pub demands: Demands,
    /// Threads; 0 for as many as there are cores.
    pub threads: usize,
    /// Whether one ensemble's batch is split over threads.
    pub batches: Batches,
}

/// When a run counts as converged, all parameters considered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Demands {
    /// Steps after the freeze, in autocorrelation times.
    pub autocorrelation_times: f64,
    /// Largest R̂ over ensembles.
    pub rhat: f64,
    /// Smallest effective sample size, bulk and tail.
    pub ess: f64,
    /// Largest R̂ over single walkers: above it walkers keep to separate regions. Looser, since one walker's chain is short.
    pub rhat_walkers: f64,
}

/// Whether one ensemble's batch of log densities is split over threads. The values are the same bytes either way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Batches {
    /// Split when threads outnumber ensembles and a point is measured to cost more than 20 µs.
    #[default]
    Measured,
    /// Never split: the density is cheap.
    Whole,
    /// Always split: the density is dear.
    Split,
}

impl Default for Demands {
    fn default() -> Self {
        Self { autocorrelation_times: 50.0, rhat: 1.01, ess: 1000.0, rhat_walkers: 1.1 }
    }
}

impl Default for SamplerOptions {
    fn default() -> Self {
        Self {
            n_walkers: 32,
            n_ensembles: 4,
            max_steps: 50_000,
            seed: 1,
            kernel: Arc::new(default_move()),
            jump_fraction: 0.8,
            store_every: None,
            max_stored_steps: 1000,
            stop_when_converged: true,
            demands: Demands::default(),
            threads: 0,
            batches: Batches::Measured,
        }
    }
}

/// Fewest steps that leave room for a burn-in and a draw.
const FEWEST_STEPS: u64 = 32;
/// Most steps: days of the cheapest model.
const MOST_STEPS: u64 = 1_000_000_000;
/// Most walkers of an ensemble: more than any model has use for, and their draws still fit into memory.
const MOST_WALKERS: usize = 4_096;

impl SamplerOptions {
    /// Refuses settings that cannot give a sound run.
    ///
    /// # Errors
    /// [`Error::Input`] naming the option.
    pub fn validate(&self, dimension: usize) -> Result<()> {
        let refuse = |place: Place, found: String, remedy: String| Err(Error::input(place, found, remedy));
        let fewest = self.fewest_walkers(dimension);
        if !self.n_walkers.is_multiple_of(2) || self.n_walkers < fewest {
            return refuse(
                Place::setting(Setting::Chains),
                format!("{} walkers for {dimension} parameters", self.n_walkers),
                format!(
                    "use an even number of walkers, at least {fewest} (more than twice the parameters); 32 is a good choice"
                ),
            );
        }
        if self.n_walkers > MOST_WALKERS {
            let found = format!("{} walkers", self.n_walkers);
            return refuse(
                Place::setting(Setting::Chains),
                found,
                format!("use at most {MOST_WALKERS} walkers; 32 is a good choice"),
            );
        }
        if self.max_steps > MOST_STEPS {
            let found = format!("{} steps", self.max_steps);
            return refuse(
                Place::setting(Setting::Steps),
                found,
                format!("allow at most {MOST_STEPS} steps; thousands are usual"),
            );
        }
        if self.n_ensembles < 4 {
            let found = format!("{} ensembles", self.n_ensembles);
            return refuse(
                Place::default().at_key("ensembles"),
                found,
                "use at least 4 independent ensembles: convergence is judged between them".into(),
            );
        }
        if self.max_steps < FEWEST_STEPS {
            let found = format!("{} steps", self.max_steps);
            return refuse(
                Place::setting(Setting::Steps),
                found,
                format!("allow at least {FEWEST_STEPS} steps; thousands are usual"),
            );
        }
        if self.store_every == Some(0) || self.max_stored_steps < 16 || !self.max_stored_steps.is_multiple_of(2) {
            return refuse(
                Place::default().at_key("store_every"),
                format!("keep every {:?} steps, at most {}", self.store_every, self.max_stored_steps),
                "keep every 1 or more steps, and an even number of at least 16".into(),
            );
        }
        if !(0.0..=0.9).contains(&self.jump_fraction) {
            let found = format!("a jump fraction of {}", self.jump_fraction);
            return refuse(
                Place::default().at_key("jump_fraction"),
                found,
                "use 0 to 0.9: more would leave nothing to the ensemble's moves".into(),
            );
        }
        Ok(())
    }

    fn fewest_walkers(&self, dimension: usize) -> usize {
        (2 * dimension + 2).max(8)
    }
}

/// How a run is watched, interrupted and kept. Nothing here changes the result.
#[derive(Default)]
pub struct RunControl<'a> {
    /// Set to true from anywhere: the run ends at the next step with [`Error::Interrupted`], its state saved.
    pub stop: Option<&'a AtomicBool>,
    /// Called a few times a second.
    pub progress: Option<&'a (dyn Fn(&Progress) + Sync)>,
    /// Where the state goes while the run lasts.
    pub checkpoint: Option<Checkpointing<'a>>,
    /// Bytes that a checkpoint sink was given: the run goes on from there.
    pub resume: Option<&'a [u8]>,
    /// What the log density was built from (a hash of data, prior and model): a checkpoint of another is refused.
    pub fingerprint: String,
}

/// Regular saving of a run's state.
pub struct Checkpointing<'a> {
    /// Takes the complete state; replaces what it was given before (see [`base::files::write_atomically`]).
    pub sink: &'a (dyn Fn(&[u8]) -> Result<()> + Sync),
    /// Wall time between two states; stretched where saving would take more than 2 % of the time.
    pub interval: Duration,
}

/// What a run is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Phase {
    /// Walkers spread; draws will be discarded.
    BurnIn,
    /// Frozen: draws count.
    Sampling,
}

/// How far a run is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// What it is doing.
    pub phase: Phase,
    /// Steps of the slowest ensemble.
    pub steps: u64,
    /// Step of the next judgement; the run may end there.
    pub next_judgement: u64,
    /// Step at which it ends at the latest.
    pub max_steps: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unsound_settings_are_refused_with_a_remedy() {
        let wrong = [
            SamplerOptions { n_walkers: 31, ..Default::default() },
            SamplerOptions { n_walkers: 8, ..Default::default() },
            SamplerOptions { n_ensembles: 3, ..Default::default() },
            SamplerOptions { max_steps: 5, ..Default::default() },
            SamplerOptions { store_every: Some(0), ..Default::default() },
            SamplerOptions { jump_fraction: 1.0, ..Default::default() },
            SamplerOptions { n_walkers: 1 << 62, ..Default::default() },
            SamplerOptions { max_steps: 1 << 63, ..Default::default() },
        ];
        for options in wrong {
            let error = options.validate(4).unwrap_err();
            assert!(
                matches!(&error, Error::Input { remedy, .. } if ["at least", "at most", "more"].iter().any(|word| remedy.contains(word)))
            );
        }
        assert!(SamplerOptions { n_walkers: 10, ..Default::default() }.validate(4).is_ok());
    }
}
