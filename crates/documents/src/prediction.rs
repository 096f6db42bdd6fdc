//! Documents of `predict` and `plan` (formats §5, `vitreo-uq/prediction/1` and `vitreo-uq/plan/1`).

use serde::{Deserialize, Serialize};

use super::posterior::Warning;

/// Result of `predict`: body of the JSON document `vitreo-uq/prediction/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Prediction {
    /// Source of the gel's parameters, such as a revision of a study or a new specimen of a group.
    pub gel: String,
    /// Number of draws of the gel's parameters.
    pub draws: usize,
    /// Predicted scenarios, in the order of the file.
    pub scenarios: Vec<ScenarioPrediction>,
    /// Predictions with equivalent effects, which the record cannot distinguish from the effects of the model.
    pub equivalent: Vec<EquivalentPrediction>,
    /// Sensitivity of every quantity of interest to every uncertain input.
    pub sensitivity: Vec<Sensitivity>,
    /// For a new specimen of a group: the share of every quantity's variance that is due to the uncertain group.
    #[serde(default)]
    pub group_shares: Vec<GroupShare>,
    /// Quantities of interest whose variance has no sources here, with the reason: too few draws have a value.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub without_sensitivity: Vec<String>,
    /// Warnings that concern all scenarios.
    pub warnings: Vec<Warning>,
}

/// Prediction of one scenario: a robot in a gel under a force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ScenarioPrediction {
    /// Name of the scenario.
    pub name: String,
    /// Robot and gel in words, with their sizes.
    pub apparatus: String,
    /// Times of the predicted positions, in s.
    pub time_s: Vec<f64>,
    /// Commanded force at each time, in µN.
    pub force_un: Vec<f64>,
    /// Quantiles of the robot's position over the draws, at each time, in µm. Measurement noise is not included.
    pub position_um: PositionQuantiles,
    /// Quantities of interest.
    pub quantities: Vec<PredictedQuantity>,
    /// Largest distance of the prediction from full finite elements over the checked draws and all times, in µm.
    pub full_model_error_um: f64,
    /// Number of draws that full finite elements have checked.
    pub full_runs: usize,
    /// Largest error of the position due to the finite-element mesh, in µm; `None` if it is unknown.
    pub mesh_error_um: Option<f64>,
    /// Largest error of the position due to the straight lines that a sine of the force is computed with, in µm; 0 for other forces.
    #[serde(default)]
    pub force_error_um: f64,
    /// Warnings about this scenario, such as forces beyond the record that taught the law.
    pub warnings: Vec<Warning>,
}

/// Quantiles of a position over time, in µm.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct PositionQuantiles {
    /// 5 % quantile at each time.
    pub q05: Vec<f64>,
    /// 25 % quantile at each time.
    pub q25: Vec<f64>,
    /// Median at each time.
    pub median: Vec<f64>,
    /// 75 % quantile at each time.
    pub q75: Vec<f64>,
    /// 95 % quantile at each time.
    pub q95: Vec<f64>,
}

/// Quantity of interest with its uncertainty.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct PredictedQuantity {
    /// Name of the quantity, such as `position_at_s`.
    pub name: String,
    /// Time in s or distance in µm at which the quantity is taken; `None` for the whole scenario.
    pub at: Option<f64>,
    /// Unit of the values.
    pub unit: String,
    /// Median over the draws; `None` if fewer than half of the draws have a value, such as a time to reach a distance.
    pub median: Option<f64>,
    /// 5 % quantile; `None` if the quantile lies among draws without a value.
    pub q05: Option<f64>,
    /// 95 % quantile; `None` if the quantile lies among draws without a value.
    pub q95: Option<f64>,
    /// Probability of the event that the scenario names for this quantity; `None` without such an event.
    pub probability: Option<f64>,
    /// Monte Carlo standard error of the probability.
    pub probability_se: Option<f64>,
    /// Result in words.
    pub sentence: String,
}

/// Quantities of interest of a scenario, predicted with an equivalent effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct EquivalentPrediction {
    /// Name of the scenario.
    pub scenario: String,
    /// Name of the equivalent effect, in place of the model's own.
    pub effect: String,
    /// Quantities of interest, in the order of the scenario.
    pub quantities: Vec<PredictedQuantity>,
    /// Largest distance between the medians of a quantity with this and with the model's own effect, divided by the half-width of the wider 90 % interval.
    pub disagreement: f64,
    /// True if the disagreement exceeds 1: the scenario depends on the effect that is true.
    pub disagrees: bool,
}

/// Sensitivity indices of one quantity of interest to one input. For correlated inputs the first-order and total indices are those of Kucherenko, Tarantola & Annoni
/// (2012); for independent inputs they equal Sobol's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Sensitivity {
    /// Name of the scenario.
    pub scenario: String,
    /// Name of the quantity of interest, with its time or distance.
    pub quantity: String,
    /// Name of the input: a parameter or a tolerance.
    pub input: String,
    /// First-order index: share of the variance that would vanish if this input were known.
    pub first_order: f64,
    /// Standard error of the first-order index.
    pub first_order_se: f64,
    /// Total index: share of the variance that would remain if all other inputs were known.
    pub total: f64,
    /// Standard error of the total index.
    pub total_se: f64,
    /// Shapley effect: share of the variance that is due to this input. The shares of all inputs add up to 1.
    pub shapley: f64,
    /// Standard error of the Shapley effect.
    pub shapley_se: f64,
    /// Share of the draws in which the quantity has a value. The indices hold among these draws. It is below 1 for arrivals and returns that some draws do not have.
    #[serde(default = "all_draws")]
    pub share_of_draws: f64,
}

/// Share of the draws in documents that do not state it.
fn all_draws() -> f64 {
    1.0
}

/// Share of the variance of a quantity for a new specimen that would vanish if the group were known exactly. The rest is the scatter between specimens and the tolerances.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct GroupShare {
    /// Name of the scenario.
    pub scenario: String,
    /// Name of the quantity of interest, with its time or distance.
    pub quantity: String,
    /// Share of the variance.
    pub share: f64,
    /// Monte Carlo standard error of the share.
    pub share_se: f64,
    /// Share of the draws in which the quantity has a value. The share of the variance holds among these draws. It is below 1 for arrivals and returns that some draws do not have.
    #[serde(default = "all_draws")]
    pub share_of_draws: f64,
}

impl Prediction {
    /// True if no warning makes the prediction untrusted. The program exits with code 0 for such results.
    pub fn is_sound(&self) -> bool {
        let all = self.warnings.iter().chain(self.scenarios.iter().flat_map(|scenario| &scenario.warnings));
        !all.into_iter().any(|warning| warning.kind.is_fatal())
    }
}

/// Result of `plan`: body of the JSON document `vitreo-uq/plan/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Plan {
    /// Source of the gel's parameters.
    pub gel: String,
    /// Robot and gel in words, with their sizes.
    pub apparatus: String,
    /// Robots that were compared, in the order of the file; empty for one robot of a given size.
    pub robots: Vec<PlannedRobot>,
    /// Distance that the robot must reach, in mm.
    pub reach_mm: f64,
    /// Time within which it must be reached, in s.
    pub within_s: f64,
    /// Requested probability.
    pub probability: f64,
    /// True if a force within the limits reaches the target with the requested probability.
    pub feasible: bool,
    /// Planned force: each value holds from its time until the next. If the target cannot be reached, the force with the highest probability.
    pub force: Vec<ForceStep>,
    /// Probability of success over the draws with which the force was planned.
    pub probability_promised: f64,
    /// Share of success among other draws, by full finite elements.
    pub probability_checked: f64,
    /// Binomial standard error of `probability_checked`.
    pub probability_checked_se: f64,
    /// Number of draws that full finite elements have checked.
    pub full_runs: usize,
    /// Limit that binds; empty if none does.
    pub limit: String,
    /// Position over time under the planned force.
    pub tube: ScenarioPrediction,
    /// File for the controller: time and force. Empty if the plan is not feasible.
    pub protocol_file: String,
    /// Result in words.
    pub sentence: String,
    /// Success of the planned force with equivalent effects, which the record cannot distinguish from the effects of the model.
    pub equivalent: Vec<EquivalentPlan>,
    /// Warnings that concern the gel's parameters and its effects.
    pub warnings: Vec<Warning>,
}

/// Robot of a comparison, with the force that it needs for the target.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct PlannedRobot {
    /// Name of its scenario.
    pub name: String,
    /// Robot and gel in words, with their sizes.
    pub apparatus: String,
    /// Length of the robot, in mm; the diameter of a sphere.
    pub length_mm: f64,
    /// Volume of the robot, in mm³.
    pub volume_mm3: f64,
    /// Largest force of the limits for this robot, in µN.
    pub largest_force_un: f64,
    /// True if a force within the limits reaches the target with the requested probability.
    pub feasible: bool,
    /// Largest force of the plan for this robot, in µN.
    pub force_un: f64,
    /// Probability of success under that force.
    pub probability: f64,
    /// Distance that the largest force of the limits reaches in time with the requested probability, in mm.
    pub reach_mm: f64,
    /// True if no other feasible robot of at least this volume needs a smaller force: the robot is on the Pareto front of volume against force.
    pub on_front: bool,
    /// True for the robot that the plan is for.
    pub chosen: bool,
}

/// Success of a planned force with an equivalent effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct EquivalentPlan {
    /// Name of the equivalent effect, in place of the model's own.
    pub effect: String,
    /// Probability of success over the draws of its model.
    pub probability: f64,
}

impl EquivalentPlan {
    /// Result in words.
    pub fn sentence(&self) -> String {
        format!(
            "With {} instead, which the record cannot distinguish: success in {:.1} % of draws",
            self.effect,
            100.0 * self.probability
        )
    }
}

/// Change of the force to a new value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct ForceStep {
    /// Time from which the force acts, in s.
    pub time_s: f64,
    /// Force in µN.
    pub force_un: f64,
}

impl Plan {
    /// True if the plan is feasible and no warning makes it untrusted. The program exits with code 0 for such results.
    pub fn is_sound(&self) -> bool {
        self.feasible && !self.warnings.iter().chain(&self.tube.warnings).any(|warning| warning.kind.is_fatal())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_success_with_an_equivalent_effect_is_told_in_percent() {
        let other = EquivalentPlan { effect: "interface-slip".into(), probability: 0.8314 };
        let expected = "With interface-slip instead, which the record cannot distinguish: success in 83.1 % of draws";
        assert_eq!(other.sentence(), expected);
    }
}
