//! Force on the robot: a piecewise linear input, and the equations of the actuator (physics §5).

use laws::stages::{self, Switch};
use record::Force;

/// A piecewise linear force on the whole body, with the equations of the actuator.
#[derive(Debug, Clone, PartialEq)]
pub struct Load {
    /// Switches of the piecewise linear force in ascending time. No force acts before the first
    /// switch.
    pub switches: Vec<Switch>,
    /// Equations of the actuator: lag and force gradient.
    pub equations: stages::Load<f64>,
}

impl Load {
    /// Load of a commanded force at rows (s), without lag or gradient.
    pub fn commanded<'a>(time_s: &[f64], force: impl Into<Force<'a>>) -> Self {
        Self::of(&stages::Load::COMMANDED, time_s, force.into())
    }

    /// Load on the robot due to a commanded force at rows (s), with the actuator's equations in
    /// `load`.
    pub fn of(load: &stages::Load, time_s: &[f64], force: Force<'_>) -> Self {
        let equations = load.of::<f64>();
        Self { switches: equations.switches(time_s, force), equations }
    }
}
