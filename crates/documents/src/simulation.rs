//! Document of `simulate` (formats §5, `vitreo-uq/simulation/1`).

use serde::{Deserialize, Serialize};

use super::posterior::Warning;

/// Result of `simulate`: body of the JSON document `vitreo-uq/simulation/1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SimulationSummary {
    /// Specimen identifier of the experiment whose protocol is simulated.
    pub experiment: String,
    /// Parameters of the gel's law that the simulation uses.
    pub parameters: Vec<SimulationParameter>,
    /// Number of unknowns of the full-order model.
    pub unknowns: usize,
    /// Stiffness of the whole body: force per displacement, divided by Young's modulus, in m.
    pub stiffness_m: f64,
    /// Time stepping scheme: `exponential` or `midpoint`.
    pub scheme: String,
    /// Number of time steps.
    pub time_steps: usize,
    /// Error of the time integration, in µm: largest distance of the computed trajectory from the exact response to the force history (physics §4.5).
    pub time_integration_error_um: f64,
    /// Largest absolute displacement of the robot, in µm.
    pub largest_displacement_um: f64,
    /// Largest absolute principal strain at the ends of the holds and at the largest displacement.
    pub largest_strain: f64,
    /// Mesh levels of a convergence study; empty if none was requested.
    pub convergence: Vec<MeshLevel>,
    /// Warnings about the strains and the mesh.
    pub warnings: Vec<Warning>,
}

/// Value of one parameter of the law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct SimulationParameter {
    /// Name of the parameter, with its unit.
    pub name: String,
    /// Value in the unit of the parameter's name.
    pub value: f64,
    /// Source of the value, in words.
    pub origin: String,
}

/// One mesh of a convergence study, with its stiffness and errors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct MeshLevel {
    /// Refinement level of the mesh, from 1. The element size is inversely proportional to the level.
    pub level: usize,
    /// Number of unknowns on this mesh.
    pub unknowns: usize,
    /// Stiffness of the whole body on this mesh: force per displacement, divided by Young's modulus, in m.
    pub stiffness_m: f64,
    /// Relative error of the stiffness against the exact value (physics §4.2); `None` if no exact value is known for this robot.
    pub relative_error: Option<f64>,
    /// Relative difference of the stiffness from that of the next coarser mesh; `None` for the coarsest.
    pub relative_difference: Option<f64>,
    /// Observed order of convergence in the element size. It comes from the errors of this mesh and the next coarser one. Without an exact value, it comes from
    /// the differences of the last three meshes.
    pub order: Option<f64>,
}
