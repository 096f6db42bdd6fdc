//! The document of `diagnose` over several records (`vitreo-uq/cohort-diagnosis/1`).

use serde::{Deserialize, Serialize};

use super::diagnosis::{Status, VerdictKind};
use super::groups::RatioVerdict;

/// Body of `vitreo-uq/cohort-diagnosis/1`. Gains are in nats of log likelihood over the model without the effect; sizes count from the null of the
/// effect's first parameter, in that parameter's unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortDiagnosis {
    /// What is said.
    pub verdict: CohortVerdict,
    /// Every effect of the library, in its order.
    pub effects: Vec<CohortEffect>,
    /// Every record.
    pub specimens: Vec<CohortSpecimen>,
    /// What groups were formed by; empty where there are none.
    pub by: Vec<String>,
    /// Ratios within 1 + margin of 1 are no difference in practice.
    pub margin: f64,
    /// Sizes of the claimed effect and of those that look alike, in every group; in all records together where there is one group.
    pub groups: Vec<CohortGroup>,
    /// Every pair of groups in the mean size of the claimed effect.
    pub contrasts: Vec<CohortContrast>,
    /// The law's parameters before and after the claimed effect; empty where nothing is claimed.
    pub law: Vec<CohortLaw>,
    /// Errors of the model as it is.
    pub base: CohortErrors,
    /// Errors with the claimed effect, each record's size predicted by the cohort's law; `None` where nothing is claimed.
    pub extended: Option<CohortErrors>,
    /// Simulated records of each record, and cohorts that were made of them.
    pub simulations: CohortSimulations,
    /// What a reader should know.
    pub remarks: Vec<String>,
}

/// What is said of a cohort.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortVerdict {
    /// `missing`, `none`, or `unexplained` where records have more in them than noise and no effect is claimed.
    pub kind: VerdictKind,
    /// Claimed, or, where the verdict is `unexplained`, what helps most without being enough.
    pub effects: Vec<String>,
    /// What the cohort cannot tell from it.
    pub equivalent: Vec<String>,
    /// In words.
    pub sentence: String,
}

/// An effect over the cohort.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortEffect {
    /// Slug.
    pub effect: String,
    /// Name of the parameter that is its size; `None` where it is not looked for.
    pub parameter: Option<String>,
    /// What is said of it.
    pub status: Status,
    /// What records gain together under the common law that fits best.
    pub gain_nats: f64,
    /// p of the gain on fitted and last cycles together over the whole search, by simulated cohorts.
    pub p_familywise: f64,
    /// The gain in the log score of the last cycles under that law; `None` where none is held out.
    pub heldout_gain_nats: Option<f64>,
    /// The law; `None` where no law gains anything.
    pub law: Option<CohortSizes>,
    /// Records that can show it.
    pub records: usize,
    /// Why no record is searched for it.
    pub refused: Option<String>,
}

/// The law of sizes that fits best.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortSizes {
    /// Median size of records that have the effect.
    pub median: f64,
    /// Standard deviation of ln size between them.
    pub between_specimen_log_sd: f64,
    /// Share of records that have it.
    pub share: f64,
    /// On which side of the null sizes lie.
    pub sides: SidesName,
}

/// On which side of its null an effect's sizes lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum SidesName {
    /// Above.
    Above,
    /// Below.
    Below,
    /// Above in some records and below in others.
    Either,
}

/// A record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortSpecimen {
    /// Specimen.
    pub id: String,
    /// Name of the record's directory.
    pub experiment: String,
    /// Its group; `None` where none are formed.
    pub group: Option<String>,
    /// What it gains by every effect that is looked for.
    pub gains: Vec<CohortGain>,
    /// Probability that it has the claimed effect; `None` where nothing is claimed.
    pub probability: Option<f64>,
    /// The claimed effect's first parameter: mean over all sizes, none included; `None` where nothing is claimed.
    pub value: Option<f64>,
    /// Whether the model leaves more than the noise allows in it.
    pub leaves_too_much: bool,
    /// Positions that were left out as errors of the tracker.
    pub outliers: usize,
}

/// What a record gains.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortGain {
    /// Slug.
    pub effect: String,
    /// Under the cohort's common law: negative where the record speaks against it. The sum over records is the cohort's gain.
    pub gain_nats: f64,
    /// By itself, at the size that suits it best.
    pub own_gain_nats: f64,
}

/// Sizes of an effect in a group.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortGroup {
    /// Name; `all` where none are formed.
    pub name: String,
    /// Records.
    pub records: usize,
    /// Effect.
    pub effect: String,
    /// Parameter.
    pub parameter: String,
    /// Median size of records that have it.
    pub median: f64,
    /// 5 % quantile.
    pub q05: f64,
    /// 95 % quantile.
    pub q95: f64,
    /// Standard deviation of ln size between them, posterior median.
    pub between_specimen_log_sd: f64,
    /// Share of records that have it, posterior median.
    pub share: f64,
    /// 5 % quantile.
    pub share_q05: f64,
    /// 95 % quantile.
    pub share_q95: f64,
    /// Mean size over all records of the group, those without it counted as 0: 5 %, 50 % and 95 %.
    pub mean: [f64; 3],
    /// On which side of the null sizes lie, as is likeliest.
    pub sides: SidesName,
    /// What the group gains by the law that suits it best.
    pub gain_nats: f64,
}

/// A ratio of two groups' mean sizes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortContrast {
    /// Effect.
    pub effect: String,
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
    /// Whether a difference is stated.
    pub is_declared: bool,
    /// What can be said in view of the margin.
    pub verdict: RatioVerdict,
    /// In words.
    pub sentence: String,
}

/// A parameter of the law in a group, before and after.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortLaw {
    /// Group.
    pub group: String,
    /// Parameter.
    pub parameter: String,
    /// Geometric mean of the records' fits without the effect.
    pub before: f64,
    /// With it.
    pub after: f64,
}

/// Errors over all records.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortErrors {
    /// Root mean square (µm) over the scored cycles of all records; `None` where none is held out.
    pub rmse_heldout_um: Option<f64>,
}

/// How p was found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct CohortSimulations {
    /// Simulated records of each record.
    pub of_each_record: usize,
    /// Cohorts that were made of them.
    pub cohorts: usize,
    /// The gain on fitted and last cycles together (nats) that 95 of 100 of them stay below; `None` without any.
    pub threshold_nats: Option<f64>,
}
