//! Document of `simulate` (formats §5, `vitreo-uq/simulation/1`).

use serde::{Deserialize, Serialize};

use super::posterior::Warning;

/// Body of `vitreo-uq/simulation/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SimulationSummary {
    /// Specimen identifier of the experiment whose protocol is simulated.
    pub experiment: String,
    /// Parameters of the law.
    pub parameters: Vec<SimulationParameter>,
    /// Number of unknowns of the full-order model.
    pub unknowns: usize,
    /// Force per displacement per Pa of Young's modulus, whole body, in m.
    pub stiffness_m: f64,
    /// Time stepping scheme: `exponential` or `midpoint`.
    pub scheme: String,
    /// Number of time steps.
    pub time_steps: usize,
    /// Error of the time integration, in µm: largest distance of the stepped trajectory from compliance × ∫J dF (physics §4.5).
    pub time_integration_error_um: f64,
    /// Largest absolute displacement of the robot, in µm.
    pub largest_displacement_um: f64,
    /// Largest absolute principal strain at the ends of the holds and at the largest displacement.
    pub largest_strain: f64,
    /// Mesh levels of a convergence study; empty if none was requested.
    pub convergence: Vec<MeshLevel>,
    /// Warnings for the user.
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
    /// Source of the value.
    pub origin: String,
}

/// One line of the convergence table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct MeshLevel {
    /// Level 1, 2, 3, …. The element size is inversely proportional to it.
    pub level: usize,
    /// Number of unknowns.
    pub unknowns: usize,
    /// Force per displacement per Pa of Young's modulus, whole body, in m.
    pub stiffness_m: f64,
    /// Relative error against the exact value (physics §4.2); `None` if the robot has no exact value.
    pub relative_error: Option<f64>,
    /// Relative difference from the previous level.
    pub relative_difference: Option<f64>,
    /// Observed order of convergence in the element size, from the errors of this level and the previous one. Without an exact value: from the differences of
    /// the last three levels.
    pub order: Option<f64>,
}
