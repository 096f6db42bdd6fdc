//! Solves for a force that depends on the position, within one step (physics §5).

use laws::stages::{Load, MAX_NEWTON_STEPS};
use nalgebra::{Matrix3, Vector3};

/// Linear response to the force within a step: position = compliance × (`response` × force +
/// `history`). Position and force are vectors over the three stages.
pub(crate) struct Mechanics {
    /// Displacement for unit force at unit Young's modulus, in 1/m.
    pub compliance_per_m: f64,
    /// Strains at the stages per force at the stages, in 1/Pa.
    pub response: Matrix3<f64>,
    /// Strains at the stages if no force acts in the step, in N/Pa.
    pub history: Vector3<f64>,
}

/// Solves F = F_in e^{gx} for the forces F at the stages. F_in is `force_n`, g the load's force
/// gradient (1/m) and x the position, which follows from F by `mechanics`. Newton's method iterates
/// on g x, starting from its value at the step's start. Returns NaN if no balance is found.
pub(crate) fn with_gradient(
    load: &Load<f64>,
    start_m: f64,
    force_n: Vector3<f64>,
    mechanics: &Mechanics,
) -> Vector3<f64> {
    if !load.depends_on_position() {
        return force_n;
    }
    let gradient_per_m = load.gradient_per_m;
    let strength = gradient_per_m * mechanics.compliance_per_m;
    let mut exponent = Vector3::repeat(gradient_per_m * start_m);
    for _ in 0..MAX_NEWTON_STEPS {
        let grown_n = force_n.component_mul(&exponent.map(f64::exp));
        let rest = (mechanics.response * grown_n + mechanics.history) * strength - exponent;
        let tangent = Matrix3::identity() - mechanics.response * Matrix3::from_diagonal(&grown_n) * strength;
        let Some(step) = tangent.lu().solve(&rest) else { break };
        exponent += step;
        if step.amax() <= 1e-14 * (1.0 + exponent.amax()) {
            return force_n.component_mul(&exponent.map(f64::exp));
        }
    }
    Vector3::repeat(f64::NAN)
}

/// Change of force gradient × position between the first stage of a step and its end, for given
/// strains (N/Pa) at the stages.
pub(crate) fn change(load: &Load<f64>, compliance_per_m: f64, strain: &Vector3<f64>) -> f64 {
    let exponent = strain * (compliance_per_m * load.gradient_per_m);
    (exponent[2] - exponent[0]).abs()
}
