//! Document of `ladder` (formats §5, `vitreo-uq/ladder/1`).

use serde::{Deserialize, Serialize};

use super::extension::EquivalentEffects;
use super::posterior::{ModelSummary, ParameterSummary, Warning, WarningKind};
use super::trust::Trust;

/// Result of `ladder`, which compares a study's revisions: body of the JSON document `vitreo-uq/ladder/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LadderSummary {
    /// Specimen identifier.
    pub experiment: String,
    /// Cycles that every revision is fitted to.
    pub fitted_cycles: Vec<u32>,
    /// The scored cycle, on which all revisions are compared; empty if no cycle is held out.
    pub heldout_cycles: Vec<u32>,
    /// Noise standard deviation that errors are compared with, in µm; `None` if it is unknown.
    pub noise_um: Option<f64>,
    /// Source of the noise standard deviation, in words.
    pub noise_origin: String,
    /// The study's revisions in their order.
    pub revisions: Vec<LadderRow>,
    /// Changes of the law's parameters from the first revision to the last; empty for a single revision.
    pub shifts: Vec<Shift>,
    /// Summary of the comparison as a sentence.
    pub sentence: String,
    /// Trust in the last revision and in the comparison, with the reason.
    #[serde(default)]
    pub trust: Trust,
}

/// A revision of the study, with its errors and parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LadderRow {
    /// Name of the revision.
    pub revision: String,
    /// All effects of the revision.
    pub effects: Vec<String>,
    /// Name of the revision that this one extends; `None` for the first.
    pub from: Option<String>,
    /// Effects that this revision has in addition to the revision that it extends.
    pub added: Vec<String>,
    /// Effects that a diagnosis could not distinguish from this revision's effects.
    #[serde(default)]
    pub equivalents: Vec<EquivalentEffects>,
    /// The whole model of the revision, including noise terms.
    pub model: ModelSummary,
    /// Root mean square residual of the fitted cycles, predicted by the full-order model's posterior mean, in µm.
    pub rmse_fitted_um: f64,
    /// Root mean square residual of the scored cycle, predicted by the full-order model's posterior mean, in µm; `None` without a scored cycle.
    pub rmse_heldout_um: Option<f64>,
    /// Log posterior predictive density of the scored positions given the fitted ones, from draws of the full-order model, in nats for positions in µm.
    pub heldout_log_score_nats: Option<f64>,
    /// Monte Carlo standard error of the log score, in nats.
    pub heldout_log_score_mcse_nats: Option<f64>,
    /// Posteriors of all sampled parameters.
    pub parameters: Vec<LadderParameter>,
    /// Posterior median of the standard deviation of the learnt white noise, in µm.
    pub learnt_noise_um: f64,
    /// Fraction of the scored positions inside the central 50 % band of the prediction.
    pub coverage_50: Option<f64>,
    /// Fraction of the scored positions inside the central 90 % band of the prediction.
    pub coverage_90: Option<f64>,
    /// Probability of a misfit of the scored cycle at least as large, from simulated measurements.
    pub joint_p: Option<f64>,
    /// Number of full-order runs that the errors come from; `None` if the experiment has no finite elements.
    pub fe_runs: Option<usize>,
    /// Largest distance of the surrogate from the full-order model over all draws and rows, in µm; `None` if it is not measured.
    pub surrogate_vs_fe_max_um: Option<f64>,
    /// True if the posterior has converged.
    pub converged: bool,
    /// Warnings on this revision.
    pub warnings: Vec<Warning>,
}

/// Posterior of one parameter of a revision.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LadderParameter {
    /// Name of the parameter, with its unit.
    pub name: String,
    /// Posterior mean.
    pub mean: f64,
    /// Posterior standard deviation.
    pub sd: f64,
    /// 5 % quantile of the posterior.
    pub q05: f64,
    /// Posterior median.
    pub median: f64,
    /// 95 % quantile of the posterior.
    pub q95: f64,
}

impl From<ParameterSummary> for LadderParameter {
    fn from(summary: ParameterSummary) -> Self {
        let ParameterSummary { name, mean, sd, q05, median, q95, .. } = summary;
        Self { name, mean, sd, q05, median, q95 }
    }
}

/// Change of one of the law's parameters from the first revision of a study to the last. It shows the bias by the effects that the first revision lacks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Shift {
    /// Name of the parameter.
    pub name: String,
    /// Posterior of the parameter in the first revision.
    pub before: LadderParameter,
    /// Posterior of the parameter in the last revision.
    pub after: LadderParameter,
    /// Posterior median in the first revision divided by that in the last, minus 1.
    pub relative: f64,
    /// Posterior median in the first revision minus that in the last, in posterior standard deviations of the first.
    pub in_sd_before: f64,
}

impl LadderSummary {
    /// True if every revision's posterior has converged and the last revision is not untrusted. The program exits with code 0 for such results. Misfits of
    /// earlier revisions are results and do not count.
    pub fn is_sound(&self) -> bool {
        self.revisions.iter().all(|rung| rung.converged) && self.trust.is_sound()
    }

    /// Returns warnings with the names of their revisions: from every revision the warnings that invalidate figures, and from the last revision also all fatal
    /// warnings. Misfits of earlier revisions are left out because the ladder shows them.
    pub fn warnings(&self) -> impl Iterator<Item = (&str, &Warning)> {
        let last = self.revisions.len().saturating_sub(1);
        let revisions = self.revisions.iter().enumerate();
        revisions.flat_map(move |(k, rung)| {
            let is_told =
                move |warning: &&Warning| invalidates_numbers(warning.kind) || (k == last && warning.kind.is_fatal());
            rung.warnings.iter().filter(is_told).map(|warning| (rung.revision.as_str(), warning))
        })
    }
}

/// True if the warning means that figures are wrong, and not only that the model is wrong.
fn invalidates_numbers(kind: WarningKind) -> bool {
    use WarningKind::*;
    matches!(kind, NotConverged | SurrogateInaccurate | MeshInaccurate | Undetermined | DrawsRefused)
}
