//! Document of `diagnose` on several records (`vitreo-uq/cohort-diagnosis/1`).

use serde::{Deserialize, Serialize};

use super::diagnosis::{Status, VerdictKind};
use super::groups::RatioVerdict;

/// Body of `vitreo-uq/cohort-diagnosis/1`. Gains are in nats of log likelihood over the model without the effect. Sizes are distances from the null of the
/// effect's first parameter, in that parameter's unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortDiagnosis {
    /// Verdict on the cohort.
    pub verdict: CohortVerdict,
    /// Every effect of the library, in the library's order.
    pub effects: Vec<CohortEffect>,
    /// Every record.
    pub specimens: Vec<CohortSpecimen>,
    /// Keys that define the groups; empty without groups.
    pub by: Vec<String>,
    /// Margin of practical equivalence: ratios within 1 + margin of 1 count as no difference.
    pub margin: f64,
    /// Sizes of the claimed effect and of its equivalent effects, for each group. A single entry covers all records if there is only one group.
    pub groups: Vec<CohortGroup>,
    /// Comparisons of the claimed effect's mean size between all pairs of groups.
    pub contrasts: Vec<CohortContrast>,
    /// The law's parameters before and after adding the claimed effect; empty without a claim.
    pub law: Vec<CohortLaw>,
    /// Errors of the study's model without the claimed effect.
    pub base: CohortErrors,
    /// Errors with the claimed effect, with each record's size predicted by the cohort's size distribution; `None` without a claim.
    pub extended: Option<CohortErrors>,
    /// Numbers of simulated records and simulated cohorts.
    pub simulations: CohortSimulations,
    /// Remarks for the reader.
    pub remarks: Vec<String>,
}

/// Verdict on a cohort.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortVerdict {
    /// `missing`, `none`, or `unexplained` if records have a misfit and no effect is claimed.
    pub kind: VerdictKind,
    /// Claimed effects. If the verdict is `unexplained`: effects that help most without being sufficient.
    pub effects: Vec<String>,
    /// Effects that the cohort cannot distinguish from the claimed ones.
    pub equivalent: Vec<String>,
    /// Verdict as a sentence.
    pub sentence: String,
}

/// Result of one effect over the cohort.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortEffect {
    /// Slug of the effect.
    pub effect: String,
    /// Name of the parameter that measures the effect's size; `None` if the effect is not searched for.
    pub parameter: Option<String>,
    /// Status of the effect.
    pub status: Status,
    /// Summed gain of all records under the best common size distribution.
    pub gain_nats: f64,
    /// p of the gain on fitted and last cycles together, over the whole search, from simulated cohorts.
    pub p_familywise: f64,
    /// Gain in the log score of the last cycles under the best size distribution; `None` if no cycle is held out.
    pub heldout_gain_nats: Option<f64>,
    /// Best size distribution; `None` if no distribution gains likelihood.
    pub law: Option<SizeDistribution>,
    /// Number of records that can show the effect.
    pub records: usize,
    /// Reason why no record is searched for the effect; `None` if it is searched for.
    pub refused: Option<String>,
}

/// Best common distribution of an effect's size over the records.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SizeDistribution {
    /// Median size in the records that have the effect.
    pub median: f64,
    /// Standard deviation of ln size between records that have the effect.
    pub between_specimen_log_sd: f64,
    /// Share of records that have the effect.
    pub share: f64,
    /// Side of the null on which sizes lie.
    pub sides: NullSide,
}

/// Side of an effect's null on which its sizes lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum NullSide {
    /// Above the null.
    Above,
    /// Below the null.
    Below,
    /// Above in some records and below in others.
    Either,
}

/// Result of one record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortSpecimen {
    /// Specimen identifier.
    pub id: String,
    /// Name of the record's directory.
    pub experiment: String,
    /// Group of the record; `None` without groups.
    pub group: Option<String>,
    /// Gains by every effect that is searched for.
    pub gains: Vec<CohortGain>,
    /// Probability that the record has the claimed effect; `None` without a claim.
    pub probability: Option<f64>,
    /// First parameter of the claimed effect: mean over its whole posterior, including the probability of no effect; `None` without a claim.
    pub value: Option<f64>,
    /// True if the residual exceeds the noise.
    pub leaves_too_much: bool,
    /// Number of positions left out as tracker errors.
    pub outliers: usize,
}

/// Gain of one record by one effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortGain {
    /// Slug of the effect.
    pub effect: String,
    /// Gain under the cohort's common size distribution; negative if the record speaks against the effect. The sum over records is the cohort's gain.
    pub gain_nats: f64,
    /// Gain of the record alone, at its best size.
    pub own_gain_nats: f64,
}

/// Sizes of an effect in a group.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortGroup {
    /// Name of the group; `all` without groups.
    pub name: String,
    /// Number of records.
    pub records: usize,
    /// Slug of the effect.
    pub effect: String,
    /// Name of the parameter.
    pub parameter: String,
    /// Median size in the records that have the effect.
    pub median: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// 95 % quantile.
    pub q95: f64,
    /// Standard deviation of ln size between records that have the effect, posterior median.
    pub between_specimen_log_sd: f64,
    /// Share of records that have the effect, posterior median.
    pub share: f64,
    /// 5 % quantile of the share.
    pub share_q05: f64,
    /// 95 % quantile of the share.
    pub share_q95: f64,
    /// Mean size over all records of the group, with size 0 for records without the effect: 5 %, 50 % and 95 % quantiles.
    pub mean: [f64; 3],
    /// Most probable side of the null on which sizes lie.
    pub sides: NullSide,
    /// Gain of the group by its best size distribution.
    pub gain_nats: f64,
}

/// Ratio of two groups' mean sizes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortContrast {
    /// Slug of the effect.
    pub effect: String,
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
    /// True if a difference is declared.
    pub is_declared: bool,
    /// Verdict on the ratio, given the margin.
    pub verdict: RatioVerdict,
    /// Comparison as a sentence.
    pub sentence: String,
}

/// A parameter of the law in a group, before and after adding the claimed effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortLaw {
    /// Name of the group.
    pub group: String,
    /// Name of the parameter.
    pub parameter: String,
    /// Geometric mean of the records' fits without the effect.
    pub before: f64,
    /// Geometric mean of the records' fits with the effect.
    pub after: f64,
}

/// Errors over all records.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortErrors {
    /// Root mean square error over the held-out cycles of all records, in µm; `None` if no cycle is held out.
    pub rmse_heldout_um: Option<f64>,
}

/// Numbers of simulations that p is computed from, and the gain that chance rarely exceeds in them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortSimulations {
    /// Number of simulations of each record.
    pub of_each_record: usize,
    /// Number of cohorts composed of simulated records.
    pub cohorts: usize,
    /// Gain on fitted and last cycles together, in nats, that 95 % of the simulated cohorts stay below; `None` without simulations.
    pub threshold_nats: Option<f64>,
}
