//! What a force that depends on the position does within a step (physics §5).

use nalgebra::{Matrix3, Vector3};

/// What answers the force within a step: x = compliance (M F + h).
pub(crate) struct Mechanics {
    /// Position per unit force and unit modulus, in 1/m.
    pub compliance_per_m: f64,
    /// M: strain at the stages per force at the stages, in 1/Pa.
    pub response: Matrix3<f64>,
    /// h: strain at the stages without a force, in N/Pa.
    pub history: Vector3<f64>,
}

/// F = F_in (1 + g x) at the stages, `mechanics` telling x.
pub(crate) fn with_gradient(gradient_per_m: f64, force_n: Vector3<f64>, mechanics: &Mechanics) -> Vector3<f64> {
    if gradient_per_m == 0.0 {
        return force_n;
    }
    let strength = gradient_per_m * mechanics.compliance_per_m;
    let feedback = Matrix3::from_diagonal(&(force_n * strength)) * mechanics.response;
    let given = force_n.component_mul(&(mechanics.history * strength).add_scalar(1.0));
    let solved = (Matrix3::identity() - feedback).lu().solve(&given);
    solved.unwrap_or_else(|| Vector3::repeat(f64::INFINITY))
}
