//! Document of `ladder` (formats §5, `vitreo-uq/ladder/1`).

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
    /// The cycle that every revision is scored on; empty if no cycle is held out.
    pub heldout_cycles: Vec<u32>,
    /// Noise that errors are compared with, in µm.
    pub noise_um: Option<f64>,
    /// Source of the noise value.
    pub noise_origin: String,
    /// The revisions, in their order.
    pub revisions: Vec<LadderRow>,
    /// Changes of the law's parameters from the first revision to the last; empty for a single revision.
    pub shifts: Vec<Shift>,
    /// Summary of the figures, as a sentence.
    pub sentence: String,
    /// Trust in the last revision and in the comparison, with the reason.
    #[serde(default)]
    pub trust: Trust,
}

/// A revision.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LadderRow {
    /// Name of the revision.
    pub revision: String,
    /// All effects of the revision.
    pub effects: Vec<String>,
    /// The revision that it extends; `None` for the first.
    pub from: Option<String>,
    /// Effects of this revision that the extended one lacks.
    pub added: Vec<String>,
    /// Effects that a diagnosis could not distinguish from this revision's effects.
    #[serde(default)]
    pub equivalents: Vec<EquivalentEffects>,
    /// The whole model, including noise terms.
    pub model: ModelSummary,
    /// Root mean square distance of the full-order model's posterior mean from the fitted positions, in µm.
    pub rmse_fitted_um: f64,
    /// Root mean square distance of the full-order model's posterior mean from the scored positions, in µm.
    pub rmse_heldout_um: Option<f64>,
    /// ln p(scored positions | fitted positions), averaged over draws of the full-order model, in nats for positions in µm.
    pub heldout_log_score_nats: Option<f64>,
    /// Monte Carlo standard error of the log score.
    pub heldout_log_score_mcse_nats: Option<f64>,
    /// Posterior of every sampled parameter.
    pub parameters: Vec<LadderParameter>,
    /// Learnt noise from row to row, posterior median, in µm.
    pub learnt_noise_um: f64,
    /// Fraction of scored positions inside the central 50 % band.
    pub coverage_50: Option<f64>,
    /// Fraction of scored positions inside the central 90 % band.
    pub coverage_90: Option<f64>,
    /// Probability of a misfit of the scored cycle at least as large, by joint predictive simulation.
    pub joint_p: Option<f64>,
    /// Number of full-order runs behind the errors; `None` for an instrument, which has no finite elements.
    pub fe_runs: Option<usize>,
    /// Largest distance of the surrogate from the full-order model over all draws and rows, in µm.
    pub surrogate_vs_fe_max_um: Option<f64>,
    /// True if the posterior has converged.
    pub converged: bool,
    /// Warnings on this revision.
    pub warnings: Vec<Warning>,
}

/// A parameter of a revision.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LadderParameter {
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

impl From<ParameterSummary> for LadderParameter {
    fn from(summary: ParameterSummary) -> Self {
        let ParameterSummary { name, mean, sd, q05, median, q95, .. } = summary;
        Self { name, mean, sd, q05, median, q95 }
    }
}

/// Bias of a law's parameter by the missing effects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Shift {
    /// Name of the parameter.
    pub name: String,
    /// Posterior in the first revision.
    pub before: LadderParameter,
    /// Posterior in the last revision.
    pub after: LadderParameter,
    /// Median before divided by median after, minus 1.
    pub relative: f64,
    /// Mean before minus mean after, in standard deviations of the first revision.
    pub in_sd_before: f64,
}

impl LadderSummary {
    /// True if the result is sound (exit code 0): every posterior has converged, every surrogate and mesh is accurate, and the last revision is trusted.
    /// Misfits of earlier revisions are a result and do not matter here.
    pub fn is_sound(&self) -> bool {
        self.revisions.iter().all(|rung| rung.converged) && self.trust.is_sound()
    }

    /// Warnings with their revisions: from every revision those that make figures wrong, and from the last revision all fatal ones. Misfits of earlier
    /// revisions are left out because the ladder shows them.
    pub fn warnings(&self) -> impl Iterator<Item = (&str, &Warning)> {
        let last = self.revisions.len().saturating_sub(1);
        let revisions = self.revisions.iter().enumerate();
        revisions.flat_map(move |(k, rung)| {
            let is_told =
                move |warning: &&Warning| invalidates_figures(warning.kind) || (k == last && warning.kind.is_fatal());
            rung.warnings.iter().filter(is_told).map(|warning| (rung.revision.as_str(), warning))
        })
    }
}

/// True if the warning says that figures are wrong, not only that a model is.
fn invalidates_figures(kind: WarningKind) -> bool {
    use WarningKind::*;
    matches!(kind, NotConverged | SurrogateInaccurate | MeshInaccurate | Undetermined | DrawsRefused)
}
