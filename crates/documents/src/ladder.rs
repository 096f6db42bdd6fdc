//! The document of `ladder` (formats §5, `vitreo-uq/ladder/1`).

use serde::{Deserialize, Serialize};

use super::extension::EquivalentEffects;
use super::posterior::{ModelSummary, ParameterSummary, Warning, WarningKind};
use super::trust::Trust;

/// Body of `vitreo-uq/ladder/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LadderSummary {
    /// Specimen identifier.
    pub experiment: String,
    /// Cycles that every revision is fitted to.
    pub fitted_cycles: Vec<u32>,
    /// The cycle that every revision is scored on, if there is one.
    pub heldout_cycles: Vec<u32>,
    /// The noise that errors are measured against, in µm.
    pub noise_um: Option<f64>,
    /// Where that noise comes from.
    pub noise_origin: String,
    /// One entry a revision, in their order.
    pub revisions: Vec<Rung>,
    /// How far the law's parameters move from the first revision to the last; empty for one revision.
    pub shifts: Vec<Shift>,
    /// What the figures say.
    pub sentence: String,
    /// How far the last revision and the comparison can be trusted, and why.
    #[serde(default)]
    pub trust: Trust,
}

/// A revision.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Rung {
    /// Its name.
    pub revision: String,
    /// All its effects.
    pub effects: Vec<String>,
    /// The revision that it extends; `None` for the first.
    pub from: Option<String>,
    /// Effects that it has and that one has not.
    pub added: Vec<String>,
    /// What a diagnosis could not tell from its effects.
    #[serde(default)]
    pub equivalents: Vec<EquivalentEffects>,
    /// The whole model, noise terms included.
    pub model: ModelSummary,
    /// Root mean square distance of the posterior mean from the fitted positions, by full finite elements, in µm.
    pub rmse_fitted_um: f64,
    /// The same on the scored cycle.
    pub rmse_heldout_um: Option<f64>,
    /// ln p(scored positions | fitted positions), draws averaged, by full finite elements, in nats for positions in µm.
    pub heldout_log_score_nats: Option<f64>,
    /// Monte Carlo standard error of that.
    pub heldout_log_score_mcse_nats: Option<f64>,
    /// Posterior of every sampled parameter.
    pub parameters: Vec<RungParameter>,
    /// Learnt noise from row to row, posterior median, in µm.
    pub learnt_noise_um: f64,
    /// Fraction of scored positions inside the central 50 % band.
    pub coverage_50: Option<f64>,
    /// Fraction of scored positions inside the central 90 % band.
    pub coverage_90: Option<f64>,
    /// Probability of a misfit of the scored cycle at least as large, by joint predictive simulation.
    pub joint_p: Option<f64>,
    /// Full finite-element runs behind the errors; `None` for an instrument, which has no finite elements.
    pub fe_runs: Option<usize>,
    /// Largest distance of the reduced from the full model over all draws and rows, in µm.
    pub surrogate_vs_fe_max_um: Option<f64>,
    /// Whether the posterior has converged.
    pub converged: bool,
    /// What the user should know of this revision.
    pub warnings: Vec<Warning>,
}

/// A parameter of a revision.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct RungParameter {
    /// Name, with unit.
    pub name: String,
    /// Posterior mean.
    pub mean: f64,
    /// Posterior standard deviation.
    pub sd: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// Median.
    pub median: f64,
    /// 95 % quantile.
    pub q95: f64,
}

impl From<ParameterSummary> for RungParameter {
    fn from(summary: ParameterSummary) -> Self {
        let ParameterSummary { name, mean, sd, q05, median, q95, .. } = summary;
        Self { name, mean, sd, q05, median, q95 }
    }
}

/// How far the missing effects had bent a parameter of the law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Shift {
    /// Name of the parameter.
    pub name: String,
    /// In the first revision.
    pub before: RungParameter,
    /// In the last one.
    pub after: RungParameter,
    /// Median before over median after, less one.
    pub relative: f64,
    /// Mean before less mean after, in standard deviations that the first revision claimed.
    pub in_sd_before: f64,
}

impl LadderSummary {
    /// Whether the result is sound (exit code 0): every posterior converged, every reduced model and mesh accurate, and the last revision is not to be distrusted.
    /// That earlier ones miss the measurement is a result.
    pub fn is_sound(&self) -> bool {
        self.revisions.iter().all(|rung| rung.converged) && self.trust.is_sound()
    }

    /// Warnings that a reader of the whole must see, with their revisions: what spoils the figures of any, and what is left to say of the last. That
    /// earlier ones miss the measurement is what the ladder shows.
    pub fn warnings(&self) -> impl Iterator<Item = (&str, &Warning)> {
        let last = self.revisions.len().saturating_sub(1);
        let revisions = self.revisions.iter().enumerate();
        revisions.flat_map(move |(k, rung)| {
            let is_told = move |warning: &&Warning| spoils(warning.kind) || (k == last && warning.kind.is_fatal());
            rung.warnings.iter().filter(is_told).map(|warning| (rung.revision.as_str(), warning))
        })
    }
}

/// Whether a warning says that figures are wrong, rather than that a model is.
fn spoils(kind: WarningKind) -> bool {
    use WarningKind::*;
    matches!(kind, NotConverged | SurrogateInaccurate | MeshInaccurate | Undetermined | DrawsRefused)
}
