//! Document of `groups` (formats §5, `vitreo-uq/groups/1`).

use serde::{Deserialize, Serialize};

use super::posterior::Warning;

/// Result of `groups`, which compares groups of specimens: body of the JSON document `vitreo-uq/groups/1`. Ratios compare the groups' typical (median)
/// specimens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct GroupsSummary {
    /// Keys of the specimens' descriptions that define the groups, such as the species.
    pub by: Vec<String>,
    /// Margin of practical equivalence: a ratio between 1/(1 + margin) and 1 + margin counts as no difference.
    pub margin: f64,
    /// Name of the law whose parameters are compared.
    pub law: String,
    /// Effects that occur in the model of at least one specimen.
    pub effects: Vec<String>,
    /// Degrees of freedom of the Student t distribution of the specimens within a group; `None` for a normal distribution.
    pub student_dof: Option<f64>,
    /// Sentences on differences, equivalences and open questions, one for each parameter.
    pub sentences: Vec<String>,
    /// Results for every group. Parameters of groups without specimens are predicted from the other groups.
    pub groups: Vec<GroupSummary>,
    /// Comparisons of all pairs of measured groups in every parameter.
    pub contrasts: Vec<ContrastSummary>,
    /// Results for every specimen, in each group in which it was measured.
    pub specimens: Vec<SpecimenSummary>,
    /// Number of distinct specimens.
    pub n_specimens: usize,
    /// Results for every experiment on its own.
    pub experiments: Vec<ExperimentSummary>,
    /// Standard deviation between repeated measurements of one specimen, for each parameter in its logarithm or log-odds; `None` without repeats.
    pub within_specimen_log_sd: Option<Vec<IntervalSummary>>,
    /// Predicted creep compliance of every group; `None` if the comparison lacks a parameter of the law.
    pub creep: Option<CreepSummary>,
    /// Published values for comparison. They are not used as data.
    pub published: Vec<Published>,
    /// Statistics of the sampler for the population of specimens.
    pub sampler: PopulationSampler,
    /// True if the draws have converged.
    pub converged: bool,
    /// Warnings about the result, for the user.
    pub warnings: Vec<Warning>,
}

impl GroupsSummary {
    /// True if the draws have converged and no warning makes the result untrusted. The program exits with code 0 for such results.
    pub fn is_sound(&self) -> bool {
        self.converged && !self.warnings.iter().any(|warning| warning.kind.is_fatal())
    }
}

/// Median and central 90 % interval of a quantity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct IntervalSummary {
    /// Name of the parameter that the quantity describes.
    pub name: String,
    /// Posterior median of the quantity.
    pub median: f64,
    /// 5 % quantile of the quantity's posterior.
    pub q05: f64,
    /// 95 % quantile of the quantity's posterior.
    pub q95: f64,
}

/// Parameters of one group and their variation between its specimens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct GroupSummary {
    /// Name of the group: its values of the keys, joined by a comma.
    pub name: String,
    /// Number of the group's measured specimens.
    pub specimens: usize,
    /// Number of the group's experiments.
    pub experiments: usize,
    /// Parameters of the group's typical specimen and their variation between specimens.
    pub parameters: Vec<GroupParameter>,
    /// Posterior median of the correlation matrix of the parameters between specimens, row by row, in logarithms or log-odds. `None` if no specimen was
    /// measured.
    pub correlation: Option<Vec<Vec<f64>>>,
}

/// Posterior of one parameter of a group.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct GroupParameter {
    /// Name of the parameter.
    pub name: String,
    /// Posterior median of the typical specimen's value.
    pub median: f64,
    /// 5 % quantile of the typical specimen's value.
    pub q05: f64,
    /// 95 % quantile of the typical specimen's value.
    pub q95: f64,
    /// Scale of the variation between specimens: logarithm, or log-odds for a parameter with two ends.
    pub scale: ScaleName,
    /// Posterior median of the standard deviation between specimens, on the scale given by `scale`. For a Student t distribution, it is the scale parameter.
    pub between_specimen_log_sd: f64,
    /// 5 % and 95 % quantiles of the standard deviation between specimens.
    pub between_specimen_log_sd_90: [f64; 2],
    /// Central 90 % interval of a new specimen's value.
    pub new_specimen_90: [f64; 2],
    /// Pooling factor: 0 if the data of each specimen determine its value, 1 if all specimens are pooled to the typical one (Gelman & Pardoe 2006,
    /// Technometrics 48:241, eq. 2).
    pub pooling: Option<f64>,
}

/// Comparison of two groups in one parameter, as a ratio.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ContrastSummary {
    /// Name of the parameter.
    pub parameter: String,
    /// Name of the group in the numerator.
    pub a: String,
    /// Name of the group in the denominator.
    pub b: String,
    /// Posterior median of the parameter's ratio between groups `a` and `b`.
    pub ratio_median: f64,
    /// 5 % quantile of the ratio.
    pub q05: f64,
    /// 95 % quantile of the ratio.
    pub q95: f64,
    /// Probability that the ratio is greater than 1.
    pub probability_greater: f64,
    /// Probability that the ratio is greater than 1 + margin.
    pub probability_beyond_margin: f64,
    /// Probability that the ratio is smaller than 1/(1 + margin).
    pub probability_below_margin: f64,
    /// True if the program states a difference between the groups. It states a sign if all stated signs are right with probability 99.7 %, and a ratio outside
    /// the margin with probability 95 %.
    pub is_declared: bool,
    /// Verdict on the ratio: greater, less, equivalent or undecided.
    pub verdict: RatioVerdict,
    /// Number of further specimens that would settle the verdict; `None` if it is settled.
    pub more: Option<SampleSizePlan>,
}

/// Parameters of one specimen in one of its groups.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SpecimenSummary {
    /// Name of the specimen.
    pub name: String,
    /// Name of the group in which the specimen was measured.
    pub group: String,
    /// Parameters of the specimen in this group.
    pub parameters: Vec<SpecimenParameter>,
    /// True if the specimen lies far from its group.
    pub is_outlying: bool,
}

/// Quantiles of one parameter of a specimen, with and without the information of other specimens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SpecimenParameter {
    /// Name of the parameter.
    pub name: String,
    /// Quantiles from the specimen's own measurements and the variation of repeats in this cohort: 5 %, 50 % and 95 %.
    pub alone: [f64; 3],
    /// Quantiles from the measurements of all specimens: 5 %, 50 % and 95 %. They are closer to the typical specimen.
    pub pooled: [f64; 3],
}

/// Posterior and errors of one experiment on its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ExperimentSummary {
    /// Name of the experiment's directory.
    pub name: String,
    /// Specimen identifier.
    pub specimen: String,
    /// Name of the group.
    pub group: String,
    /// Quantiles of each parameter from this experiment alone: 5 %, 50 % and 95 %.
    pub alone: Vec<[f64; 3]>,
    /// Root mean square residual on the fitted cycles, in µm.
    pub rmse_fitted_um: f64,
    /// Root mean square residual on the held-out cycle, in µm.
    pub rmse_heldout_um: Option<f64>,
    /// Standard deviation of the predicted positions of the held-out cycle, as a root mean square over its rows, in µm.
    pub predictive_sd_heldout_um: Option<f64>,
    /// Noise standard deviation that residuals are compared with, in µm; `None` if it is unknown.
    pub noise_um: Option<f64>,
    /// Warnings that the residuals of this experiment alone give, by the tests of `sample`.
    pub residual_warnings: Vec<Warning>,
    /// True if the draws of this experiment's posterior have converged.
    pub converged: bool,
    /// Effective number of this experiment's draws after they are reweighted with the population's distribution.
    pub effective_draws: f64,
    /// True if the population's sampler evaluated the experiment's likelihood directly. Otherwise it reweighted the experiment's draws.
    pub is_exact: bool,
}

/// Creep compliance that is predicted for every group, as a function of time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CreepSummary {
    /// Times of the predictions, in s.
    pub time_s: Vec<f64>,
    /// Predictions for each group, in the groups' order.
    pub groups: Vec<CreepPrediction>,
}

/// Statistics of the sampler for the population of specimens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct PopulationSampler {
    /// Number of Markov chains.
    pub chains: usize,
    /// Number of sweeps of each chain after warm-up.
    pub sweeps: usize,
    /// Largest convergence diagnostic R̂, rank-normalised and split, of a group's mean or spread.
    pub rhat: f64,
    /// Smallest effective sample size, bulk or tail, of a group's mean or spread.
    pub ess: f64,
}

/// Verdicts on the ratio of two groups. The margin of practical equivalence decides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum RatioVerdict {
    /// The ratio is above 1 + margin with probability 95 %.
    Greater,
    /// The ratio is below 1/(1 + margin) with probability 95 %.
    Less,
    /// The ratio is between 1/(1 + margin) and 1 + margin with probability 95 %.
    Equivalent,
    /// None of the other verdicts has a probability of 95 %.
    Undecided,
}

/// Number of further specimens that a comparison of two groups needs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SampleSizePlan {
    /// Smallest number of new specimens in each group that settles the verdict with probability 80 %; `None` if 512 are too few.
    pub specimens_per_group: Option<u32>,
    /// Probability that `specimens_per_group` specimens, or 512, settle the verdict.
    pub chance: f64,
}

/// Predicted creep compliance of one group at each time, for its typical specimen and for a new specimen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CreepPrediction {
    /// Posterior median of the typical specimen's creep compliance, in 1/Pa.
    pub median_per_pa: Vec<f64>,
    /// 5 % quantile of the typical specimen's creep compliance, in 1/Pa.
    pub typical_q05_per_pa: Vec<f64>,
    /// 95 % quantile of the typical specimen's creep compliance, in 1/Pa.
    pub typical_q95_per_pa: Vec<f64>,
    /// 5 % quantile of a new specimen's creep compliance, in 1/Pa.
    pub new_specimen_q05_per_pa: Vec<f64>,
    /// 95 % quantile of a new specimen's creep compliance, in 1/Pa.
    pub new_specimen_q95_per_pa: Vec<f64>,
    /// Share of posterior draws that the prediction omits because the law's creep compliance cannot be computed, for example if a springpot's order is 0 within rounding.
    #[serde(default)]
    pub share_left_out: f64,
}

/// A value from the literature, for comparison.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Published {
    /// Name of the parameter.
    pub parameter: String,
    /// Author and year of the publication.
    pub source: String,
    /// Species of the published specimens.
    pub species: String,
    /// Value in SI units.
    pub value: f64,
    /// Statement of the measured quantity, and of the parts of the value that are derived or assumed.
    pub statement: String,
}

/// Scales on which a parameter's variation between specimens is described.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum ScaleName {
    /// Logarithm of the parameter: ln x.
    Logarithm,
    /// Log-odds of a parameter x with support from a to b: ln((x − a)/(b − x)).
    LogOdds,
}
