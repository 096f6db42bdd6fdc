//! The document of `groups` (formats §5, `vitreo-uq/groups/1`).

use serde::{Deserialize, Serialize};

use super::posterior::Warning;

/// Body of `vitreo-uq/groups/1`. Ratios are of groups' typical (median) specimens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct GroupsSummary {
    /// What groups were formed by.
    pub by: Vec<String>,
    /// Ratios within 1 + margin of 1 are no difference in practice.
    pub margin: f64,
    /// The base law whose parameters are compared.
    pub law: String,
    /// Effects of any model.
    pub effects: Vec<String>,
    /// Degrees of freedom of specimens' scatter; `None` for normal.
    pub student_dof: Option<f64>,
    /// What differs, what does not and what is open, a sentence a parameter.
    pub sentences: Vec<String>,
    /// Every group; those without specimens are predicted from the others.
    pub groups: Vec<GroupSummary>,
    /// Every pair of measured groups in every parameter.
    pub contrasts: Vec<ContrastSummary>,
    /// Every specimen in every group in which it was measured.
    pub specimens: Vec<SpecimenSummary>,
    /// Specimens, each counted once.
    pub n_specimens: usize,
    /// Every experiment.
    pub experiments: Vec<ExperimentSummary>,
    /// Spread of repeats of one specimen in the logarithm or the log-odds, a parameter each; `None` without repeats.
    pub within_specimen_log_sd: Option<Vec<IntervalSummary>>,
    /// Predicted creep; `None` where not all of the law's parameters are compared.
    pub creep: Option<CreepSummary>,
    /// Values of the literature, to look at beside: they are no data here.
    pub published: Vec<Published>,
    /// How the population was sampled.
    pub sampler: PopulationSampler,
    /// Whether the draws have converged.
    pub converged: bool,
    /// What the user should know.
    pub warnings: Vec<Warning>,
}

impl GroupsSummary {
    /// Whether the result is sound (exit code 0).
    pub fn is_sound(&self) -> bool {
        self.converged && !self.warnings.iter().any(|warning| warning.kind.is_fatal())
    }
}

/// Median and central 90 % of a quantity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct IntervalSummary {
    /// The parameter that it belongs to.
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
    /// Specimens that were measured.
    pub specimens: usize,
    /// Experiments.
    pub experiments: usize,
    /// Its typical specimen and how specimens scatter about it.
    pub parameters: Vec<GroupParameter>,
    /// Correlation between specimens of the parameters on their scales, posterior median, row by row; `None` where nothing was measured.
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
    /// Whether specimens scatter in the logarithm or, between two ends, in the log-odds.
    pub scale: ScaleName,
    /// Standard deviation between specimens on that scale (the scale parameter, where tails are heavy), posterior median.
    pub between_specimen_log_sd: f64,
    /// Its 5 % and 95 % quantiles.
    pub between_specimen_log_sd_90: [f64; 2],
    /// Central 90 % of a new specimen's value.
    pub new_specimen_90: [f64; 2],
    /// How far specimens are drawn together: 0 for not at all, 1 for all to the typical one (Gelman & Pardoe 2006, Technometrics 48:241, eq. 2).
    pub pooling: Option<f64>,
}

/// A ratio of two groups.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ContrastSummary {
    /// Parameter.
    pub parameter: String,
    /// Group above the line.
    pub a: String,
    /// Group below it.
    pub b: String,
    /// Median of a's over b's.
    pub ratio_median: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// 95 % quantile.
    pub q95: f64,
    /// Probability that a's is the greater.
    pub probability_greater: f64,
    /// Probability that it is greater by more than the margin.
    pub probability_beyond_margin: f64,
    /// Probability that it is smaller by more than the margin.
    pub probability_below_margin: f64,
    /// Whether a difference is stated: its sign (all that are stated so are right together with 99.7 %), or that it exceeds the margin (95 %).
    pub is_declared: bool,
    /// What can be said in view of the margin.
    pub verdict: RatioVerdict,
    /// What it would take to settle it; `None` where it is settled.
    pub more: Option<Plan>,
}

/// A specimen in a group.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SpecimenSummary {
    /// Name.
    pub name: String,
    /// Group.
    pub group: String,
    /// Its parameters there.
    pub parameters: Vec<SpecimenParameter>,
    /// Whether it lies far from its group.
    pub is_outlying: bool,
}

/// A parameter of a specimen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SpecimenParameter {
    /// Name.
    pub name: String,
    /// From its own measurements and the scatter of repeats in this cohort: 5 %, 50 %, 95 %.
    pub alone: [f64; 3],
    /// With what the population says.
    pub pooled: [f64; 3],
}

/// An experiment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ExperimentSummary {
    /// Name of its directory.
    pub name: String,
    /// Specimen.
    pub specimen: String,
    /// Group.
    pub group: String,
    /// On its own, each parameter: 5 %, 50 %, 95 %.
    pub alone: Vec<[f64; 3]>,
    /// Misfit on the fitted cycles, in µm.
    pub rmse_fitted_um: f64,
    /// Misfit on the cycle that was held out, in µm.
    pub rmse_heldout_um: Option<f64>,
    /// Standard deviation of the positions predicted there, root mean square over rows, in µm.
    pub predictive_sd_heldout_um: Option<f64>,
    /// The noise that misfits are measured against, in µm.
    pub noise_um: Option<f64>,
    /// Whether its own draws have converged.
    pub converged: bool,
    /// Effective number of its draws, weighted to the population.
    pub effective_draws: f64,
    /// Whether its likelihood took the draws' place.
    pub is_exact: bool,
}

/// Predicted creep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CreepSummary {
    /// Times in s.
    pub time_s: Vec<f64>,
    /// One a group, in their order.
    pub groups: Vec<CreepPrediction>,
}

/// How the population was sampled.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct PopulationSampler {
    /// Chains.
    pub chains: usize,
    /// Sweeps of each that count.
    pub sweeps: usize,
    /// Largest rank-normalised split R̂ of a group's mean or spread.
    pub rhat: f64,
    /// Smallest effective number of draws of one, bulk or tail.
    pub ess: f64,
}

/// What can be said of a ratio in view of the margin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum RatioVerdict {
    /// Above 1 + margin, with a probability of 95 %.
    Greater,
    /// Below 1/(1 + margin), with a probability of 95 %.
    Less,
    /// Between the two, with a probability of 95 %.
    Equivalent,
    /// None of these.
    Undecided,
}

/// What to expect of measuring more.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Plan {
    /// Smallest number of new specimens a group that settles the question with a chance of 80 %; `None` if 512 do not.
    pub specimens_per_group: Option<u32>,
    /// The chance with that number, or with 512.
    pub chance: f64,
}

/// Creep compliance of a group: times, and at each the median and central 90 % of the typical specimen and of a new one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CreepPrediction {
    /// Median of the typical specimen's creep compliance, in 1/Pa.
    pub median_per_pa: Vec<f64>,
    /// Its 5 % quantile.
    pub typical_q05_per_pa: Vec<f64>,
    /// Its 95 % quantile.
    pub typical_q95_per_pa: Vec<f64>,
    /// 5 % quantile of a new specimen's.
    pub new_specimen_q05_per_pa: Vec<f64>,
    /// 95 % quantile of a new specimen's.
    pub new_specimen_q95_per_pa: Vec<f64>,
    /// Share of the draws at which the law has no creep that could be computed, as where a springpot's order is 0 to the last bit; left out.
    #[serde(default)]
    pub share_left_out: f64,
}

/// A published value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Published {
    /// Parameter.
    pub parameter: String,
    /// Author and year.
    pub source: String,
    /// Species.
    pub species: String,
    /// The value, in SI.
    pub value: f64,
    /// What is published and what was derived or assumed.
    pub statement: String,
}

/// A scale's name in documents.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum ScaleName {
    /// ln x.
    Logarithm,
    /// ln((x − a)/(b − x)) between the ends a and b of the parameter's support.
    LogOdds,
}
