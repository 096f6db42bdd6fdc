//! Document of `groups` (formats §5, `vitreo-uq/groups/1`).

use serde::{Deserialize, Serialize};

use super::posterior::Warning;

/// Body of `vitreo-uq/groups/1`. Ratios compare the groups' typical (median) specimens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct GroupsSummary {
    /// Keys that define the groups.
    pub by: Vec<String>,
    /// Margin of practical equivalence: ratios within 1 + margin of 1 count as no difference.
    pub margin: f64,
    /// The base law whose parameters are compared.
    pub law: String,
    /// Effects that occur in any specimen's model.
    pub effects: Vec<String>,
    /// Degrees of freedom of the specimens' Student t distribution; `None` for a normal distribution.
    pub student_dof: Option<f64>,
    /// Sentences on differences, equivalences and open questions, one for each parameter.
    pub sentences: Vec<String>,
    /// Every group. Groups without specimens are predicted from the other groups.
    pub groups: Vec<GroupSummary>,
    /// Comparisons of all pairs of measured groups in every parameter.
    pub contrasts: Vec<ContrastSummary>,
    /// Every specimen in each group in which it was measured.
    pub specimens: Vec<SpecimenSummary>,
    /// Number of distinct specimens.
    pub n_specimens: usize,
    /// Every experiment.
    pub experiments: Vec<ExperimentSummary>,
    /// Standard deviation between repeats of one specimen, in the logarithm or log-odds, for each parameter; `None` without repeats.
    pub within_specimen_log_sd: Option<Vec<IntervalSummary>>,
    /// Predicted creep compliance; `None` unless all of the law's parameters are compared.
    pub creep: Option<CreepSummary>,
    /// Published values for comparison. They are not used as data.
    pub published: Vec<Published>,
    /// Statistics of the population's sampler.
    pub sampler: PopulationSampler,
    /// True if the draws have converged.
    pub converged: bool,
    /// Warnings for the user.
    pub warnings: Vec<Warning>,
}

impl GroupsSummary {
    /// True if the result is sound (exit code 0).
    pub fn is_sound(&self) -> bool {
        self.converged && !self.warnings.iter().any(|warning| warning.kind.is_fatal())
    }
}

/// Median and central 90 % interval of a quantity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct IntervalSummary {
    /// Parameter that the quantity belongs to.
    pub name: String,
    /// Median.
    pub median: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// 95 % quantile.
    pub q95: f64,
}

/// A group.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct GroupSummary {
    /// Levels of the keys, joined by a comma.
    pub name: String,
    /// Number of measured specimens.
    pub specimens: usize,
    /// Number of experiments.
    pub experiments: usize,
    /// Parameters of the group's typical specimen and their variation between specimens.
    pub parameters: Vec<GroupParameter>,
    /// Correlation matrix of the parameters between specimens, on the parameters' scales, row by row: posterior median. `None` if nothing was measured.
    pub correlation: Option<Vec<Vec<f64>>>,
}

/// A parameter of a group.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct GroupParameter {
    /// Name.
    pub name: String,
    /// Median of the typical specimen's value.
    pub median: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// 95 % quantile.
    pub q95: f64,
    /// Scale of the variation between specimens: logarithm, or log-odds for a parameter with two ends.
    pub scale: ScaleName,
    /// Standard deviation between specimens on this parameter's scale, posterior median; the scale parameter if tails are heavy.
    pub between_specimen_log_sd: f64,
    /// 5 % and 95 % quantiles of the standard deviation between specimens.
    pub between_specimen_log_sd_90: [f64; 2],
    /// Central 90 % interval of a new specimen's value.
    pub new_specimen_90: [f64; 2],
    /// Pooling factor: 0 if specimens are not drawn together, 1 if all are drawn to the typical one (Gelman & Pardoe 2006, Technometrics 48:241, eq. 2).
    pub pooling: Option<f64>,
}

/// Ratio of two groups in one parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ContrastSummary {
    /// Name of the parameter.
    pub parameter: String,
    /// Group in the numerator.
    pub a: String,
    /// Group in the denominator.
    pub b: String,
    /// Median of the ratio of a to b.
    pub ratio_median: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// 95 % quantile.
    pub q95: f64,
    /// Probability that a is greater than b.
    pub probability_greater: f64,
    /// Probability that a is greater than b by more than the margin.
    pub probability_beyond_margin: f64,
    /// Probability that a is smaller than b by more than the margin.
    pub probability_below_margin: f64,
    /// True if a difference is declared: its sign (with probability 99.7 % all declared signs are right), or its excess over the margin (95 %).
    pub is_declared: bool,
    /// Verdict on the ratio, given the margin.
    pub verdict: RatioVerdict,
    /// Number of specimens that would settle the question; `None` if it is settled.
    pub more: Option<SampleSizePlan>,
}

/// Result of a specimen in a group.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SpecimenSummary {
    /// Name of the specimen.
    pub name: String,
    /// Name of the group.
    pub group: String,
    /// Parameters of the specimen in this group.
    pub parameters: Vec<SpecimenParameter>,
    /// True if the specimen lies far from its group.
    pub is_outlying: bool,
}

/// A parameter of a specimen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SpecimenParameter {
    /// Name of the parameter.
    pub name: String,
    /// Quantiles from the specimen's own measurements and the variation of repeats in this cohort: 5 %, 50 %, 95 %.
    pub alone: [f64; 3],
    /// Quantiles after pooling with the population: 5 %, 50 %, 95 %.
    pub pooled: [f64; 3],
}

/// Result of an experiment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ExperimentSummary {
    /// Name of the experiment's directory.
    pub name: String,
    /// Specimen identifier.
    pub specimen: String,
    /// Name of the group.
    pub group: String,
    /// Quantiles of each parameter from this experiment alone: 5 %, 50 %, 95 %.
    pub alone: Vec<[f64; 3]>,
    /// Root mean square residual on the fitted cycles, in µm.
    pub rmse_fitted_um: f64,
    /// Root mean square residual on the held-out cycle, in µm.
    pub rmse_heldout_um: Option<f64>,
    /// Standard deviation of the predicted positions on the held-out cycle, root mean square over rows, in µm.
    pub predictive_sd_heldout_um: Option<f64>,
    /// Noise that residuals are compared with, in µm.
    pub noise_um: Option<f64>,
    /// True if the experiment's own draws have converged.
    pub converged: bool,
    /// Effective number of the experiment's draws after weighting to the population.
    pub effective_draws: f64,
    /// True if the experiment's likelihood was evaluated directly instead of reweighting its draws.
    pub is_exact: bool,
}

/// Predicted creep compliance of all groups.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CreepSummary {
    /// Times, in s.
    pub time_s: Vec<f64>,
    /// Predictions for each group, in the groups' order.
    pub groups: Vec<CreepPrediction>,
}

/// Statistics of the population's sampler.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct PopulationSampler {
    /// Number of chains.
    pub chains: usize,
    /// Number of sweeps of each chain after warm-up.
    pub sweeps: usize,
    /// Largest rank-normalised split R̂ of a group's mean or spread.
    pub rhat: f64,
    /// Smallest effective number of draws of a group's mean or spread, bulk or tail.
    pub ess: f64,
}

/// Verdict on a ratio, given the margin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum RatioVerdict {
    /// Above 1 + margin with probability 95 %.
    Greater,
    /// Below 1/(1 + margin) with probability 95 %.
    Less,
    /// Between 1/(1 + margin) and 1 + margin with probability 95 %.
    Equivalent,
    /// None of the other verdicts reaches 95 %.
    Undecided,
}

/// Expected benefit of measuring more specimens.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SampleSizePlan {
    /// Smallest number of new specimens in each group that settles the question with probability 80 %; `None` if 512 are too few.
    pub specimens_per_group: Option<u32>,
    /// Probability of settling the question with `specimens_per_group` specimens, or with 512.
    pub chance: f64,
}

/// Creep compliance of a group at each time: median and 90 % interval of the typical specimen, and 90 % interval of a new specimen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CreepPrediction {
    /// Median of the typical specimen's creep compliance, in 1/Pa.
    pub median_per_pa: Vec<f64>,
    /// 5 % quantile of the typical specimen's creep compliance, in 1/Pa.
    pub typical_q05_per_pa: Vec<f64>,
    /// 95 % quantile of the typical specimen's creep compliance, in 1/Pa.
    pub typical_q95_per_pa: Vec<f64>,
    /// 5 % quantile of a new specimen's creep compliance, in 1/Pa.
    pub new_specimen_q05_per_pa: Vec<f64>,
    /// 95 % quantile of a new specimen's creep compliance, in 1/Pa.
    pub new_specimen_q95_per_pa: Vec<f64>,
    /// Share of draws left out because the law's creep compliance cannot be computed, for example if a springpot's order is 0 within rounding.
    #[serde(default)]
    pub share_left_out: f64,
}

/// A published value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Published {
    /// Name of the parameter.
    pub parameter: String,
    /// Author and year.
    pub source: String,
    /// Species.
    pub species: String,
    /// Value in SI units.
    pub value: f64,
    /// Statement of the published quantity and of derived or assumed parts.
    pub statement: String,
}

/// Name of a scale in documents.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum ScaleName {
    /// ln x.
    Logarithm,
    /// ln((x − a)/(b − x)) between the ends a and b of the parameter's support.
    LogOdds,
}
