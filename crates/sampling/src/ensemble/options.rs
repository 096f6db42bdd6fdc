//! Settings of a sampling run, and the means to monitor, stop and resume a run.

use super::moves::{Move, default_move};
use base::error::{InputPlace, Setting};
use base::{Error, Result};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Settings of a sampling run. All of them except `threads` and `batches` influence the result, and together they determine it to the last bit.
#[derive(Clone)]
pub struct SamplerOptions {
    /// Number of walkers per ensemble. It must be even, at least 8 and more than twice the dimension.
    pub n_walkers: usize,
    /// Number of independent ensembles, at least 4.
    pub n_ensembles: usize,
    /// Number of steps, burn-in included, after which the run ends even without convergence.
    pub max_steps: u64,
    /// Seed of all random streams.
    pub seed: u64,
    /// Move that proposes new positions from those of other walkers.
    pub kernel: Arc<dyn Move>,
    /// Largest fraction of half-steps that jump to draws from an approximation of the posterior ([`super::moves::Independence`]) instead of using
    /// `kernel`. The fraction decreases if few jumps are accepted. 0 disables jumps.
    pub jump_fraction: f64,
    /// Interval between kept steps, in steps. `None` keeps every step at first, and doubles the interval each time that `max_stored_steps` steps are
    /// stored.
    pub store_every: Option<u64>,
    /// Largest number of kept steps per ensemble if `store_every` is `None`; even.
    pub max_stored_steps: usize,
    /// `true` ends the run as soon as the convergence criteria are met. Otherwise it continues to `max_steps`.
    pub stop_when_converged: bool,
    /// Criteria that a converged run meets.
    pub convergence: ConvergenceCriteria,
    /// Number of threads; 0 for one per core.
    pub threads: usize,
    /// Rule for splitting the points of an ensemble over threads.
    pub batches: Batches,
}

/// Criteria for the convergence of a run. Every parameter must meet all of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConvergenceCriteria {
    /// Smallest number of steps after the burn-in, in autocorrelation times.
    pub autocorrelation_times: f64,
    /// Largest R̂ of the comparison between ensembles.
    pub rhat: f64,
    /// Smallest effective sample size, for the bulk and for the tails.
    pub ess: f64,
    /// Largest R̂ of the comparison between single walkers. A larger R̂ means that some walkers stay in separate regions. This threshold is less
    /// strict than `rhat`, because the chain of one walker is short.
    pub rhat_walkers: f64,
}

/// Rule for splitting an ensemble's batch of points over threads. It does not change any computed value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Batches {
    /// Splits batches if there are more threads than ensembles and a point takes more than 20 µs, as measured at the start.
    #[default]
    Auto,
    /// Never splits batches, which suits a cheap density.
    Whole,
    /// Always splits batches, which suits an expensive density.
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

/// Smallest allowed number of steps, enough for a burn-in and a few draws.
const FEWEST_STEPS: u64 = 32;
/// Largest allowed number of steps, which takes the cheapest model days.
const MOST_STEPS: u64 = 1_000_000_000;
/// Largest allowed number of walkers per ensemble. No model needs more, and the draws of this number fit into memory.
const MOST_WALKERS: usize = 4_096;

impl SamplerOptions {
    /// Checks the settings for a problem with `dimension` coordinates.
    ///
    /// # Errors
    /// [`Error::Input`] that names the setting which cannot give a valid run.
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
                "use at least 4 independent ensembles: the convergence check compares them".into(),
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
                "use a fraction from 0 to 0.9: the other moves need the remaining half-steps".into(),
            );
        }
        Ok(())
    }

    fn fewest_walkers(&self, dimension: usize) -> usize {
        (2 * dimension + 2).max(8)
    }
}

/// Means to watch, stop and resume a run, which do not change its result.
#[derive(Default)]
pub struct RunControl<'a> {
    /// Stop request. If another thread sets it to `true`, the run saves its state at the next step and ends with [`Error::Interrupted`].
    pub stop: Option<&'a AtomicBool>,
    /// Function that the run calls a few times per second with its progress.
    pub progress: Option<&'a (dyn Fn(&Progress) + Sync)>,
    /// Settings for regular checkpoints; `None` saves no state.
    pub checkpoint: Option<Checkpointing<'a>>,
    /// Bytes of a checkpoint from which the run continues.
    pub resume: Option<&'a [u8]>,
    /// Hash of the data, prior and model that define the log density. A checkpoint with another fingerprint is refused.
    pub fingerprint: String,
}

/// Settings for regular checkpoints.
pub struct Checkpointing<'a> {
    /// Function that stores the complete state and replaces the earlier one (see [`base::files::write_atomically`]).
    pub sink: &'a (dyn Fn(&[u8]) -> Result<()> + Sync),
    /// Wall-clock time between two checkpoints. It is increased if saving takes more than 2 % of the time.
    pub interval: Duration,
}

/// Phase of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Phase {
    /// Burn-in, in which walkers spread over the posterior. Draws of this phase are discarded.
    BurnIn,
    /// Sampling after the burn-in, with fixed moves. Draws of this phase are kept.
    Sampling,
}

/// Progress of a run at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Phase of the run at this moment.
    pub phase: Phase,
    /// Number of steps of the slowest ensemble.
    pub steps: u64,
    /// Step of the next convergence check. The run may end there.
    pub next_check_step: u64,
    /// Step at which the run ends even without convergence.
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
                matches!(&error, Error::Input { remedy, .. } if ["at least", "at most", "more", "from 0 to"].iter().any(|word| remedy.contains(word)))
            );
        }
        assert!(SamplerOptions { n_walkers: 10, ..Default::default() }.validate(4).is_ok());
    }
}
