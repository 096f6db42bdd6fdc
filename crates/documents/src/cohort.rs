//! Document of `diagnose` on several records (`vitreo-uq/cohort-diagnosis/1`).

use serde::{Deserialize, Serialize};

use super::diagnosis::{Status, VerdictKind};
use super::groups::RatioVerdict;

/// Result of `diagnose` on several records: body of the JSON document `vitreo-uq/cohort-diagnosis/1`.
///
/// Gains are increases of the log likelihood over the model without the effect, in nats. The size of an effect is the distance of its first parameter from its
/// null, in that parameter's unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortDiagnosis {
    /// Verdict on the cohort.
    pub verdict: CohortVerdict,
    /// Results for every effect of the library, in the library's order.
    pub effects: Vec<CohortEffect>,
    /// Results for every record.
    pub specimens: Vec<CohortSpecimen>,
    /// Keys of the specimens' descriptions that define the groups; empty without groups.
    pub by: Vec<String>,
    /// Margin of practical equivalence: a ratio between 1/(1 + margin) and 1 + margin counts as no difference.
    pub margin: f64,
    /// Sizes of the claimed effect and of its equivalent effects, in each group. Without groups, a single entry for each effect covers all records.
    pub groups: Vec<CohortGroup>,
    /// Comparisons of the claimed effect's mean size between all pairs of groups.
    pub contrasts: Vec<CohortContrast>,
    /// The law's parameters before and after adding the claimed effect; empty without a claim.
    pub law: Vec<CohortLaw>,
    /// Errors of the model without the claimed effect.
    pub base: CohortErrors,
    /// Errors of the model with the claimed effect; `None` without a claim. The cohort's size distribution predicts the effect's size in each record.
    pub extended: Option<CohortErrors>,
    /// Numbers of simulated records and simulated cohorts that the p values come from.
    pub simulations: CohortSimulations,
    /// Remarks for the reader.
    pub remarks: Vec<String>,
}

/// Verdict on a cohort.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortVerdict {
    /// Kind of verdict: `missing`, `none`, or `unexplained` if records have a misfit and no effect is claimed.
    pub kind: VerdictKind,
    /// Claimed effects. If the verdict is `unexplained`: the effects that help most but do not suffice.
    pub effects: Vec<String>,
    /// Effects that the cohort cannot distinguish from the claimed effects.
    pub equivalent: Vec<String>,
    /// Verdict as a sentence.
    pub sentence: String,
}

/// Result of one effect over the cohort.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortEffect {
    /// Name of the effect in commands and files.
    pub effect: String,
    /// Name of the parameter that measures the effect's size; `None` if the effect is not searched for.
    pub parameter: Option<String>,
    /// Status of the effect.
    pub status: Status,
    /// Gain of all records together under the best common size distribution, in nats.
    pub gain_nats: f64,
    /// Probability that chance alone gives as large a gain on fitted and last cycles together, corrected for the whole search. It comes from simulated cohorts.
    pub p_familywise: f64,
    /// Gain in the log score of the last cycles under the best size distribution, in nats; `None` if no cycle is held out.
    pub heldout_gain_nats: Option<f64>,
    /// Best distribution of the effect's size over the records; `None` if no distribution gains likelihood.
    pub law: Option<SizeDistribution>,
    /// Number of records to whose model the effect can be added.
    pub records: usize,
    /// Reason why the effect cannot be added to the model of any record; `None` if it can.
    pub refused: Option<String>,
}

/// Best common distribution of an effect's size over the records: log-normal in a share of the records, and 0 in the others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SizeDistribution {
    /// Median size in the records that have the effect.
    pub median: f64,
    /// Standard deviation of the logarithm of the size between records that have the effect.
    pub between_specimen_log_sd: f64,
    /// Share of records that have the effect.
    pub share: f64,
    /// Side of the null on which the parameter lies in the records.
    pub sides: NullSide,
}

/// Side of an effect's null (the value at which it vanishes) on which its parameter lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum NullSide {
    /// The parameter lies above the null.
    Above,
    /// The parameter lies below the null.
    Below,
    /// The parameter lies above the null in some records and below it in others.
    Either,
}

/// Result for one record of the cohort.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortSpecimen {
    /// Specimen identifier.
    pub id: String,
    /// Name of the record's directory.
    pub experiment: String,
    /// Group of the record; `None` without groups.
    pub group: Option<String>,
    /// Gain of this record by every effect that is searched for.
    pub gains: Vec<CohortGain>,
    /// Probability that the record has the claimed effect; `None` without a claim.
    pub probability: Option<f64>,
    /// Posterior mean of the claimed effect's first parameter, including the probability that the record lacks the effect; `None` without a claim.
    pub value: Option<f64>,
    /// True if the residuals of the model without the effect exceed the noise.
    pub leaves_too_much: bool,
    /// Number of positions left out as outliers.
    pub outliers: usize,
}

/// Gain in log likelihood of one record by one effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortGain {
    /// Name of the effect in commands and files.
    pub effect: String,
    /// Gain under the cohort's common size distribution, in nats; negative if the record contradicts the effect. The sum over the records is the cohort's gain.
    pub gain_nats: f64,
    /// Gain of the record alone, at the effect's best size in this record, in nats.
    pub own_gain_nats: f64,
}

/// Sizes of one effect in one group.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortGroup {
    /// Name of the group; `all` without groups.
    pub name: String,
    /// Number of records in the group.
    pub records: usize,
    /// Name of the effect in commands and files.
    pub effect: String,
    /// Name of the parameter that measures the effect's size.
    pub parameter: String,
    /// Posterior median of the median size in the records that have the effect.
    pub median: f64,
    /// 5 % quantile of the median size.
    pub q05: f64,
    /// 95 % quantile of the median size.
    pub q95: f64,
    /// Posterior median of the standard deviation of the logarithm of the size between records that have the effect.
    pub between_specimen_log_sd: f64,
    /// Posterior median of the share of records that have the effect.
    pub share: f64,
    /// 5 % quantile of the share of records that have the effect.
    pub share_q05: f64,
    /// 95 % quantile of the share of records that have the effect.
    pub share_q95: f64,
    /// Mean size over all records of the group, with size 0 for records without the effect: 5 %, 50 % and 95 % quantiles.
    pub mean: [f64; 3],
    /// Most probable side of the null on which the parameter lies.
    pub sides: NullSide,
    /// Gain of the group's records under the group's best size distribution, in nats.
    pub gain_nats: f64,
}

/// Comparison of an effect's mean size between two groups, as a ratio.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortContrast {
    /// Name of the effect in commands and files.
    pub effect: String,
    /// Name of the parameter that measures the effect's size.
    pub parameter: String,
    /// Name of the group in the numerator.
    pub a: String,
    /// Name of the group in the denominator.
    pub b: String,
    /// Posterior median of the ratio of the mean sizes in groups `a` and `b`.
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
    /// True if the program states a difference between the groups.
    pub is_declared: bool,
    /// Verdict on the ratio: greater, less, equivalent or undecided.
    pub verdict: RatioVerdict,
    /// The comparison as a sentence.
    pub sentence: String,
}

/// A parameter of the law in a group, before and after adding the claimed effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortLaw {
    /// Name of the group.
    pub group: String,
    /// Name of the law's parameter.
    pub parameter: String,
    /// Geometric mean of the parameter's fits in the group's records without the effect.
    pub before: f64,
    /// Geometric mean of the parameter's fits in the group's records with the effect.
    pub after: f64,
}

/// Errors of a model over all records of the cohort.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortErrors {
    /// Root mean square residual of the last held-out cycles of all records, in µm; `None` if no cycle is held out.
    pub rmse_heldout_um: Option<f64>,
}

/// Simulations from which p values are computed, with the gain that 95 % of them stay below.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortSimulations {
    /// Number of simulations for each record.
    pub of_each_record: usize,
    /// Number of cohorts composed of simulated records.
    pub cohorts: usize,
    /// Gain on fitted and last cycles together that 95 % of the simulated cohorts stay below, in nats; `None` without simulations.
    pub threshold_nats: Option<f64>,
}
