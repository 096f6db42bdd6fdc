//! Step lengths: powers of two that grow with the time since the last switch of the force.

use crate::fe::clock::{fit_step_to_stop, share_of_gap};

/// Refinement of the time steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resolution {
    /// Number n ≥ 1: the length of a step is 1/(2n) to 1/n of the time since the last switch of the
    /// force. The error is inversely proportional to the fourth power of n.
    pub steps_per_doubling: u32,
    /// Longest step, in s. A system that oscillates long after a switch needs about ten steps per
    /// period.
    pub longest_step_s: f64,
}

impl Default for Resolution {
    /// Settings for errors below 1e-6 of the largest position, if nothing oscillates.
    fn default() -> Self {
        Self { steps_per_doubling: 10, longest_step_s: f64::INFINITY }
    }
}

/// Bound of the step lengths after a switch of the force: `growth` × (time since the switch +
/// `scale_s`).
#[derive(Debug, Clone, Copy)]
pub(super) struct Grading {
    growth: f64,
    switched_s: f64,
    scale_s: f64,
    longest_step_s: f64,
}

impl Grading {
    /// Returns the bounds of the step lengths after a switch of the force at `switched_s`. The next
    /// row or switch comes `gap_s` later. `jumps` is true if the force jumps at the switch.
    pub fn new(resolution: Resolution, switched_s: f64, gap_s: f64, jumps: bool) -> Self {
        let Resolution { steps_per_doubling, longest_step_s } = resolution;
        let growth = f64::from(steps_per_doubling.max(1)).recip();
        Self { growth, switched_s, scale_s: share_of_gap(jumps) * gap_s, longest_step_s }
    }

    /// Returns the bounds of the step lengths after a force change at time 0. The first steps
    /// resolve the time scale `scale_s` (s).
    pub fn within(resolution: Resolution, scale_s: f64) -> Self {
        Self { scale_s, ..Self::new(resolution, 0.0, 0.0, true) }
    }

    /// Length (s) of the step that starts at `now_s`, if the next switch of the force is `left_s`
    /// away.
    pub(super) fn step_s(&self, now_s: f64, left_s: f64) -> f64 {
        let wanted_s = (self.growth * (now_s - self.switched_s + self.scale_s)).min(self.longest_step_s);
        let ladder_s = wanted_s.log2().floor().exp2();
        fit_step_to_stop(ladder_s, left_s)
    }
}
