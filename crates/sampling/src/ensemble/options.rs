//! Options of a sampling run.

use super::moves::{Move, default_move};
use base::error::{InputPlace, Setting};
use base::{Error, Result};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Settings of a run. They determine the result to the last bit, except for the number of threads and the splitting of batches,
/// which do not influence it.
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
    /// Move that proposes new positions.
    pub kernel: Arc<dyn Move>,
    /// Largest fraction of half-steps that jump into the posterior's approximation ([`super::moves::Independence`]) instead of
    /// using `kernel`. The fraction is reduced if few jumps are accepted. 0 disables jumps.
    pub jump_fraction: f64,
    /// Interval between kept steps. `None` keeps every step at first and doubles the interval each time that `max_stored_steps` are full.
    pub store_every: Option<u64>,
    /// Steps of each ensemble that are kept when `store_every` is `None`; even.
    pub max_stored_steps: usize,
    /// True ends the run as soon as the demands are met. Otherwise it continues to `max_steps`.
    pub stop_when_converged: bool,
    /// Convergence criteria.
    pub convergence: ConvergenceCriteria,
    /// Number of threads; 0 for one per core.
    pub threads: usize,
    /// Splitting of one ensemble's batch over threads.
    pub batches: Batches,
}

/// Convergence criteria for all parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConvergenceCriteria {
    /// Steps after the freeze, in autocorrelation times.
    pub autocorrelation_times: f64,
    /// Largest R̂ over ensembles.
    pub rhat: f64,
    /// Smallest effective sample size, bulk and tail.
    pub ess: f64,
    /// Largest R̂ over single walkers. Above it, walkers stay in separate regions. This limit is looser, because one walker's chain is short.
    pub rhat_walkers: f64,
}

/// Splitting of one ensemble's batch of log densities over threads. It does not change the bytes of the values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Batches {
    /// Split if threads outnumber ensembles and the measured cost of a point exceeds 20 µs.
    #[default]
    Auto,
    /// Never split: the density is cheap.
    Whole,
    /// Always split: the density is expensive.
    Split,
}

impl Default for ConvergenceCriteria {
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
            convergence: ConvergenceCriteria::default(),
            threads: 0,
            batches: Batches::Auto,
        }
    }
}

/// Smallest number of steps that allows a burn-in and a draw.
const FEWEST_STEPS: u64 = 32;
/// Largest number of steps: days for the cheapest model.
const MOST_STEPS: u64 = 1_000_000_000;
/// Largest number of walkers of an ensemble: more than any model needs, with draws that still fit into memory.
const MOST_WALKERS: usize = 4_096;

impl SamplerOptions {
    /// Rejects settings that cannot give a valid run.
    ///
    /// # Errors
    /// [`Error::Input`] that names the option.
    pub fn validate(&self, dimension: usize) -> Result<()> {
        let refuse = |place: InputPlace, found: String, remedy: String| Err(Error::input(place, found, remedy));
        let fewest = self.fewest_walkers(dimension);
        if !self.n_walkers.is_multiple_of(2) || self.n_walkers < fewest {
            return refuse(
                InputPlace::setting(Setting::Chains),
                format!("{} walkers for {dimension} parameters", self.n_walkers),
                format!(
                    "use an even number of walkers, at least {fewest} (more than twice the parameters); 32 is a good choice"
                ),
            );
        }
        if self.n_walkers > MOST_WALKERS {
            let found = format!("{} walkers", self.n_walkers);
            return refuse(
                InputPlace::setting(Setting::Chains),
                found,
                format!("use at most {MOST_WALKERS} walkers; 32 is a good choice"),
            );
        }
        if self.max_steps > MOST_STEPS {
            let found = format!("{} steps", self.max_steps);
            return refuse(
                InputPlace::setting(Setting::Steps),
                found,
                format!("allow at most {MOST_STEPS} steps; thousands are usual"),
            );
        }
        if self.n_ensembles < 4 {
            let found = format!("{} ensembles", self.n_ensembles);
            return refuse(
                InputPlace::default().at_key("ensembles"),
                found,
                "use at least 4 independent ensembles: convergence is judged between them".into(),
            );
        }
        if self.max_steps < FEWEST_STEPS {
            let found = format!("{} steps", self.max_steps);
            return refuse(
                InputPlace::setting(Setting::Steps),
                found,
                format!("allow at least {FEWEST_STEPS} steps; thousands are usual"),
            );
        }
        if self.store_every == Some(0) || self.max_stored_steps < 16 || !self.max_stored_steps.is_multiple_of(2) {
            return refuse(
                InputPlace::default().at_key("store_every"),
                format!("an interval of {:?} steps and at most {} kept steps", self.store_every, self.max_stored_steps),
                "use an interval of at least 1 step and an even number of at least 16 kept steps".into(),
            );
        }
        if !(0.0..=0.9).contains(&self.jump_fraction) {
            let found = format!("a jump fraction of {}", self.jump_fraction);
            return refuse(
                InputPlace::default().at_key("jump_fraction"),
                found,
                "use at least 0 and at most 0.9: the ensemble's own moves need the rest".into(),
            );
        }
        Ok(())
    }

    fn fewest_walkers(&self, dimension: usize) -> usize {
        (2 * dimension + 2).max(8)
    }
}

/// Monitoring, interruption and checkpoints of a run. Nothing here changes the result.
#[derive(Default)]
pub struct RunControl<'a> {
    /// Stop request. If another thread sets it to true, the run ends at the next step with [`Error::Interrupted`] and saves its state.
    pub stop: Option<&'a AtomicBool>,
    /// Callback for progress, called a few times per second.
    pub progress: Option<&'a (dyn Fn(&Progress) + Sync)>,
    /// Regular saving of the state; `None` disables it.
    pub checkpoint: Option<Checkpointing<'a>>,
    /// Bytes from a checkpoint sink, from which the run continues.
    pub resume: Option<&'a [u8]>,
    /// Hash of the data, prior and model behind the log density. A checkpoint with another fingerprint is refused.
    pub fingerprint: String,
}

/// Regular saving of a run's state.
pub struct Checkpointing<'a> {
    /// Callback that stores the complete state and replaces the earlier one (see [`base::files::write_atomically`]).
    pub sink: &'a (dyn Fn(&[u8]) -> Result<()> + Sync),
    /// Wall time between two saved states, increased if saving would take more than 2 % of the time.
    pub interval: Duration,
}

/// Phase of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Phase {
    /// Burn-in: walkers spread, and draws will be discarded.
    BurnIn,
    /// Sampling after a freeze: draws are kept.
    Sampling,
}

/// Progress of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Present phase.
    pub phase: Phase,
    /// Steps of the slowest ensemble.
    pub steps: u64,
    /// Step of the next judgement, at which the run may end.
    pub next_check_step: u64,
    /// Step at which the run ends at the latest.
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
