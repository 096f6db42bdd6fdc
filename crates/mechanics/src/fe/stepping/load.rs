//! The load as it is defined (physics §5): delay, factors by sign, offset, lag, gradient.

use crate::error::{Error, Result};
use crate::stages::{LARGEST_FEEDBACK, Load};
use nalgebra::{Matrix3, Vector3};

/// A change of the force that enters the lag.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Switch {
    pub time_s: f64,
    pub force_n: f64,
}

/// The changes of the force, from the record's start on, after delay, factors and offset; the first is the offset's.
pub(crate) fn switches(load: &Load, time_s: &[f64], force_n: &[f64]) -> Vec<Switch> {
    let Some(&start_s) = time_s.first() else { return Vec::new() };
    let mut switches = vec![Switch { time_s: start_s, force_n: load.offset_n.value }];
    let mut commanded_n = 0.0;
    for (&time_s, &force_n) in time_s.iter().zip(force_n) {
        if force_n != commanded_n {
            commanded_n = force_n;
            let factor = if force_n < 0.0 { load.negative_factor.value } else { load.positive_factor.value };
            let force_n = force_n * factor + load.offset_n.value;
            switches.push(Switch { time_s: time_s + load.delay_s.value, force_n });
        }
    }
    switches
}

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

/// Refuses positions (m) at which the gradient is too strong for what the model says of it.
pub(crate) fn check_feedback(gradient_per_m: f64, position_m: &[f64], time_s: f64) -> Result<()> {
    if gradient_per_m == 0.0 {
        return Ok(());
    }
    // What is not a number is too strong as well.
    let shares = position_m.iter().map(|x| (gradient_per_m * x).abs());
    let Some(feedback) = shares.filter(|share| share.is_nan() || *share >= LARGEST_FEEDBACK).reduce(f64::max) else {
        return Ok(());
    };
    Err(Error::numerical(
        format!(
            "the force's gradient changes the force by a share of {feedback:.3} at {time_s} s; {LARGEST_FEEDBACK} and more is refused"
        ),
        "use a smaller gradient, or a stiffer gel",
    ))
}
