//! The force on the robot: straight lines, with lag and gradient where the actuator has them (physics §5).

use crate::fe::clock::{Switch, switches};
use laws::stages::{self, Stages};
use record::Force;

/// A force F_in of straight lines on the whole body, and what the actuator makes of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Load {
    /// In the order of time; before the first no force acts.
    pub switches: Vec<Switch>,
    /// τ ≥ 0 in s of τ Ḟ = F_in − F; 0 is no lag.
    pub lag_time_s: f64,
    /// g in 1/m of F e^{gx}, x the robot's position.
    pub gradient_per_m: f64,
}

impl Load {
    /// A commanded force at rows (s), as it is: no lag, no gradient.
    pub fn commanded<'a>(time_s: &[f64], force: impl Into<Force<'a>>) -> Self {
        Self::of(&Stages::of_law(Vec::new()).load, time_s, force.into())
    }

    /// What stages make of a commanded force at rows (s).
    pub fn of(load: &stages::Load, time_s: &[f64], force: Force<'_>) -> Self {
        Self {
            switches: switches(load, time_s, force),
            lag_time_s: load.lag_time_s.value,
            gradient_per_m: load.gradient_per_m.value,
        }
    }
}
