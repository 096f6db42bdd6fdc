//! The force on the robot: piecewise constant, with lag and gradient where the actuator has them (physics §5).

use crate::fe::clock::Switch;

/// A piecewise-constant force F_in on the whole body, and what the actuator makes of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Load {
    /// In the order of time; before the first no force acts.
    pub switches: Vec<Switch>,
    /// τ ≥ 0 in s of τ Ḟ = F_in − F; 0 is no lag.
    pub lag_time_s: f64,
    /// g in 1/m of F (1 + g x), x the robot's position.
    pub gradient_per_m: f64,
}

impl Load {
    /// Row i's force (N) holds on [tᵢ, tᵢ₊₁); no lag, no gradient.
    pub fn held(time_s: &[f64], force_n: &[f64]) -> Self {
        let mut switches = Vec::new();
        let mut last_n = 0.0;
        for (&time_s, &force_n) in time_s.iter().zip(force_n) {
            if force_n != last_n {
                last_n = force_n;
                switches.push(Switch { time_s, force_n });
            }
        }
        Self { switches, lag_time_s: 0.0, gradient_per_m: 0.0 }
    }
}
