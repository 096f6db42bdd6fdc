//! The force on the robot: straight lines, and the equations of the actuator (physics §5).

use laws::stages::{self, Switch};
use record::Force;

/// A force F_in of straight lines on the whole body, and what the actuator makes of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Load {
    /// In the order of time; before the first no force acts.
    pub switches: Vec<Switch>,
    /// What acts on it: lag and gradient.
    pub equations: stages::Load<f64>,
}

impl Load {
    /// A commanded force at rows (s), as it is: no lag, no gradient.
    pub fn commanded<'a>(time_s: &[f64], force: impl Into<Force<'a>>) -> Self {
        Self::of(&stages::Load::COMMANDED, time_s, force.into())
    }

    /// What stages make of a commanded force at rows (s).
    pub fn of(load: &stages::Load, time_s: &[f64], force: Force<'_>) -> Self {
        let equations = load.of::<f64>();
        Self { switches: equations.switches(time_s, force), equations }
    }
}
