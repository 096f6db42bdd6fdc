//! Document of `design` (formats §5, `vitreo-uq/design/1`).

use serde::{Deserialize, Serialize};

use super::posterior::Warning;

/// Result of `design`, the protocol of the next record: body of the JSON document `vitreo-uq/design/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Design {
    /// Specimen identifier.
    pub experiment: String,
    /// Name of the revision whose model is designed for.
    pub revision: String,
    /// Purpose: `parameters`, `effects`, `detection` or `decision`.
    pub goal: String,
    /// Effects that the present record cannot distinguish, the claimed one first; empty for the goal `parameters`.
    pub effects: Vec<String>,
    /// Distance of the closest two models in the present record, in standard deviations of the noise; `None` for one model.
    pub separation_now_sigma: Option<f64>,
    /// Largest force of the protocols, in µN.
    pub largest_force_un: f64,
    /// Largest distance of the expected position from its start, in µm.
    pub largest_displacement_um: f64,
    /// Time between samples, in s.
    pub interval_s: f64,
    /// Number of protocols that were compared.
    pub protocols_tried: usize,
    /// Recommended protocol.
    pub recommended: RecommendedProtocol,
    /// Quantity of interest that the protocol is designed for; `None` for other purposes.
    pub quantity: Option<DesignedQuantity>,
    /// Smallest detectable size of every effect that the model lacks; empty for other purposes.
    pub detectable: Vec<DesignedDetection>,
    /// Best protocol of each duration.
    pub front: Vec<FrontProtocol>,
    /// Pairs of effects that the recommended protocol does not separate.
    pub helpless: Vec<HelplessPair>,
    /// Later records of the specimen that the design takes into account.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub after: Vec<LaterRecord>,
    /// Models of the class and their standing by all records; empty for one model.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub models: Vec<ModelStanding>,
    /// Reason why no further record is needed; `None` if one is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stop: Option<String>,
    /// Warnings about the result, for the user.
    pub warnings: Vec<Warning>,
}

/// Later record of the specimen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct LaterRecord {
    /// Its specimen identifier.
    pub experiment: String,
    /// Root mean square residual (µm) of the likeliest model, fitted to all records.
    pub rmse_um: f64,
    /// Noise standard deviation of a position (µm), known or estimated; `None` if it is unknown.
    pub noise_um: Option<f64>,
}

/// Standing of one of several models after all records.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ModelStanding {
    /// Effects of the model.
    pub effects: String,
    /// Log likelihood by which its best fit trails that of the first model, in nats.
    pub trails_by_nats: f64,
    /// Probability among the models, all equally probable before the records, by Laplace's approximation.
    pub probability: f64,
}

/// Recommended protocol with the expected knowledge after its record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct RecommendedProtocol {
    /// File for the controller: time and force.
    pub protocol_file: String,
    /// Directory with a description and a table for the new record, in which the positions are missing.
    pub record_dir: String,
    /// Protocol in words.
    pub protocol: String,
    /// Duration in s.
    pub duration_s: f64,
    /// Expected information about the parameters, in nats, averaged over draws of the parameters.
    pub expected_information_nats: f64,
    /// Standard error of the expected information, from the draws.
    pub standard_error: f64,
    /// Parameters with their uncertainty now and after the record.
    pub parameters: Vec<DesignedParameter>,
    /// Distance of the closest two models after the record, in standard deviations of the noise; `None` for one model.
    pub separation_sigma: Option<f64>,
    /// Share of simulated records in which the true effect leads every other by more than 4 nats; `None` for one model.
    pub verdict_right_probability: Option<f64>,
    /// Number of these simulated records.
    pub simulated_records: usize,
    /// Recommendation in words.
    pub sentence: String,
}

/// Expected uncertainty of a parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct DesignedParameter {
    /// Name of the parameter, with its unit.
    pub name: String,
    /// Value at the fit.
    pub value: f64,
    /// Standard deviation now.
    pub sd_now: f64,
    /// Expected standard deviation after the present and the designed record.
    pub sd_expected: f64,
}

/// Expected uncertainty of a quantity of interest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct DesignedQuantity {
    /// Name of its scenario.
    pub scenario: String,
    /// Quantity, with its time or distance.
    pub quantity: String,
    /// Unit of the values.
    pub unit: String,
    /// Value at the fit.
    pub value: f64,
    /// Standard deviation now.
    pub sd_now: f64,
    /// Expected standard deviation after the present and the designed record.
    pub sd_expected: f64,
}

/// Smallest size of an effect that the present and the designed record show, each by itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct DesignedDetection {
    /// Name of the effect.
    pub effect: String,
    /// Name of its first parameter, with its unit.
    pub parameter: String,
    /// Smallest detectable value in the present record; `None` if no value in the prior's range is detectable.
    pub smallest_now: Option<f64>,
    /// Smallest detectable value in the designed record; `None` if no value in the prior's range is detectable.
    pub smallest_expected: Option<f64>,
}

/// Best protocol of one duration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct FrontProtocol {
    /// Duration in s.
    pub duration_s: f64,
    /// Expected information about the parameters, in nats.
    pub expected_information_nats: f64,
    /// Distance of the closest two models, in standard deviations of the noise; `None` for one model.
    pub separation_sigma: Option<f64>,
    /// Protocol in words.
    pub protocol: String,
    /// File for the controller.
    pub protocol_file: String,
}

/// Pair of effects that no protocol within the limits separates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct HelplessPair {
    /// Names of the effects.
    pub pair: [String; 2],
    /// Limit whose change would separate them, with the factor; or that none of the tried changes does.
    pub limit: String,
}

impl Design {
    /// True if the protocol serves the goal: the effects are separated, or the parameters become better known. The program exits with code 0 for such results.
    pub fn is_sound(&self) -> bool {
        self.helpless.is_empty() && !self.warnings.iter().any(|warning| warning.kind.is_fatal())
    }
}
