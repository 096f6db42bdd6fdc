//! How long steps are: powers of two that grow with the time since the last switch.

use super::Resolution;
use crate::fe::clock::{ending_well, share_of_gap};

/// Steps since one switch: h ≤ η (time since the switch + scale).
#[derive(Debug, Clone, Copy)]
pub(super) struct Grading {
    growth: f64,
    switched_s: f64,
    scale_s: f64,
    longest_step_s: f64,
}

impl Grading {
    /// Steps after a switch that is followed by a row or switch `gap_s` later; `jumps` where the force does.
    pub fn new(resolution: Resolution, switched_s: f64, gap_s: f64, jumps: bool) -> Self {
        let Resolution { steps_per_doubling, longest_step_s } = resolution;
        let growth = f64::from(steps_per_doubling.max(1)).recip();
        Self { growth, switched_s, scale_s: share_of_gap(jumps) * gap_s, longest_step_s }
    }

    /// Length of the step from `now_s`, with `left_s` to the next switch.
    pub(super) fn step_s(&self, now_s: f64, left_s: f64) -> f64 {
        let wanted_s = (self.growth * (now_s - self.switched_s + self.scale_s)).min(self.longest_step_s);
        let ladder_s = wanted_s.log2().floor().exp2();
        ending_well(ladder_s, left_s)
    }
}
