//! How long steps are: powers of two that grow with the time since the last switch.

use crate::fe::clock::{ending_well, share_of_gap};

/// How fine the steps are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resolution {
    /// n ≥ 1: steps are between 1/2n and 1/n of the time since the switch. The error falls with the fourth power of 1/n.
    pub steps_per_doubling: u32,
    /// Steps are no longer than this, in s: a system that rings long after a switch needs about ten a period.
    pub longest_step_s: f64,
}

impl Default for Resolution {
    /// Errors of less than 1e-6 of the largest position where nothing rings.
    fn default() -> Self {
        Self { steps_per_doubling: 10, longest_step_s: f64::INFINITY }
    }
}

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

    /// Steps after a change at time 0 of which the first resolve `scale_s`.
    pub fn within(resolution: Resolution, scale_s: f64) -> Self {
        Self { scale_s, ..Self::new(resolution, 0.0, 0.0, true) }
    }

    /// Length of the step from `now_s`, with `left_s` to the next switch.
    pub(super) fn step_s(&self, now_s: f64, left_s: f64) -> f64 {
        let wanted_s = (self.growth * (now_s - self.switched_s + self.scale_s)).min(self.longest_step_s);
        let ladder_s = wanted_s.log2().floor().exp2();
        ending_well(ladder_s, left_s)
    }
}
