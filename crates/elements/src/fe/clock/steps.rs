//! Lengths of time steps. They grow geometrically after every switch of the force, and steps end at
//! switches and rows.

/// Shortest time scale that the first steps after a force jump resolve, as a fraction of the time
/// to the next stop. Faster processes stay stable but are not resolved.
const SHARE_OF_GAP: f64 = 1e-4;
/// Shortest time scale that the first steps after a switch without a force jump resolve, as a
/// fraction of the time to the next stop. Fast processes then follow the force from the start.
const SHARE_OF_SMOOTH_GAP: f64 = 0.1;
/// Upper bound of step length × the gel's softening rate, divided by the growth factor of the
/// steps.
const SOFTENING_SHARE: f64 = 3.0;
/// Number of binary digits dropped from a step's length. Lengths that differ only by rounding of
/// the clock then use the same matrices.
const DROPPED_BITS: u32 = 52 - 36;

/// Rule for step lengths: at most the growth factor × (time since the switch + starting scale).
/// Lengths are the growth factor × 2^(j/k) s, with integers j and k steps per doubling, so that few
/// different lengths occur.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StepRule {
    steps_per_doubling: f64,
    /// Growth factor: largest ratio of a step's length to the time since the switch.
    growth: f64,
    /// Shortest time scale (s) that the steps resolve.
    fastest_s: f64,
    /// True if the force depends on the position. This feedback has no time scale, so that the time
    /// to the next stop limits the first steps.
    feeds_back: bool,
    longest_step_s: f64,
}

/// Shortest time scale that the first steps after a switch resolve, as a fraction of the time to
/// the next stop. `jumps` tells whether the force jumps.
pub(crate) fn share_of_gap(jumps: bool) -> f64 {
    if jumps { SHARE_OF_GAP } else { SHARE_OF_SMOOTH_GAP }
}

/// Time of the last switch, and the time scale that the first steps after it resolve.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Grading {
    switched_s: f64,
    scale_s: f64,
}

impl StepRule {
    /// Builds the rule for step lengths. `fastest_s` is the shortest time scale of the law and of
    /// the load's lag, and `softening_per_s` the gel's softening rate.
    pub fn new(steps_per_doubling: u32, fastest_s: f64, feeds_back: bool, softening_per_s: f64) -> Self {
        let steps_per_doubling = f64::from(steps_per_doubling.max(1));
        let growth = steps_per_doubling.recip().exp2() - 1.0;
        let longest_step_s = SOFTENING_SHARE * growth / softening_per_s.abs();
        Self { steps_per_doubling, growth, fastest_s, feeds_back, longest_step_s }
    }

    /// Grading of the steps after a switch at `switched_s`. The next stop comes `gap_s` later.
    /// `jumps` tells whether the force jumps.
    pub(crate) fn after_switch(&self, switched_s: f64, gap_s: f64, jumps: bool) -> Grading {
        let fastest_s = if self.feeds_back { self.fastest_s.min(gap_s) } else { self.fastest_s };
        Grading { switched_s, scale_s: fastest_s.max(share_of_gap(jumps) * gap_s) }
    }

    /// Length (s) of the step that starts at `now_s`, if the next stop is `left_s` away.
    pub(crate) fn step_s(&self, grading: Grading, now_s: f64, left_s: f64) -> f64 {
        let scale = (now_s - grading.switched_s + grading.scale_s).min(self.longest_step_s / self.growth);
        let ladder_s =
            self.growth * ((self.steps_per_doubling * scale.log2()).floor() / self.steps_per_doubling).exp2();
        fit_step_to_stop(ladder_s, left_s)
    }
}

/// Length of the next step, for a wanted length `ladder_s` and a time `left_s` to the stop. The
/// step does not pass the stop, nor leave a very short last step. Its length is rounded to 36
/// binary digits, which changes it by a relative 7e-12.
pub(crate) fn fit_step_to_stop(ladder_s: f64, left_s: f64) -> f64 {
    let length_s = if ladder_s >= left_s {
        left_s
    } else if 2.0 * ladder_s >= left_s {
        0.5 * left_s
    } else {
        ladder_s
    };
    let half = 1_u64 << (DROPPED_BITS - 1);
    f64::from_bits(((length_s.to_bits() + half) >> DROPPED_BITS) << DROPPED_BITS)
}
