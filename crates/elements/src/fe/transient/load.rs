//! The force on the robot: line segments, and the equations of the actuator (physics §5).

use laws::stages::{self, Switch};
use record::Force;

/// A piecewise linear force F_in on the whole body, and the actuator's equations.
#[derive(Debug, Clone, PartialEq)]
pub struct Load {
    /// Switches in the order of time. No force acts before the first.
    pub switches: Vec<Switch>,
    /// Equations of the actuator: lag and gradient.
    pub equations: stages::Load<f64>,
}

impl Load {
    /// A commanded force at rows (s), without lag or gradient.
    pub fn commanded<'a>(time_s: &[f64], force: impl Into<Force<'a>>) -> Self {
        Self::of(&stages::Load::COMMANDED, time_s, force.into())
    }

    /// Force that stages make of a commanded force at rows (s).
    pub fn of(load: &stages::Load, time_s: &[f64], force: Force<'_>) -> Self {
        let equations = load.of::<f64>();
        Self { switches: equations.switches(time_s, force), equations }
    }
}
