//! The document of `simulate` (formats §5, `vitreo-uq/simulation/1`).

use serde::{Deserialize, Serialize};

use super::posterior::Warning;

/// Body of `vitreo-uq/simulation/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SimulationSummary {
    /// Specimen identifier of the experiment whose protocol was run.
    pub experiment: String,
    /// The law's parameters.
    pub parameters: Vec<SimulationParameter>,
    /// Unknowns of the full-order model.
    pub unknowns: usize,
    /// Force per displacement per Pa of Young's modulus, whole body, in m.
    pub stiffness_m: f64,
    /// `exponential` or `midpoint`.
    pub scheme: String,
    /// Time steps of the run.
    pub time_steps: usize,
    /// Largest distance of the stepped trajectory from compliance × ∫J dF (physics §4.5), in µm: the error of the time integration.
    pub time_integration_error_um: f64,
    /// Largest absolute displacement of the robot, in µm.
    pub largest_displacement_um: f64,
    /// Largest absolute principal strain over the fields looked at: the ends of the holds and the largest displacement.
    pub largest_strain: f64,
    /// One entry a mesh level; empty when none was asked for.
    pub convergence: Vec<MeshLevel>,
    /// What the user should know.
    pub warnings: Vec<Warning>,
}

/// Value of one parameter of the law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SimulationParameter {
    /// Name, with unit.
    pub name: String,
    /// Value in that unit.
    pub value: f64,
    /// Where the value comes from.
    pub origin: String,
}

/// One line of the convergence table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct MeshLevel {
    /// Level 1, 2, 3, …; the element size goes with its inverse.
    pub level: usize,
    /// Unknowns.
    pub unknowns: usize,
    /// Force per displacement per Pa of Young's modulus, whole body, in m.
    pub stiffness_m: f64,
    /// Relative error against the exact value (physics §4.2); `None` for robots that have none.
    pub relative_error: Option<f64>,
    /// Relative difference from the level before.
    pub relative_difference: Option<f64>,
    /// Observed order of convergence in the element size: from the errors of this level and the one before, or, without an exact value, from the
    /// differences of the last three levels.
    pub order: Option<f64>,
}
