//! Lengths of steps: they grow geometrically after every switch, and end at switches and rows.

/// Smallest starting scale of steps after a switch, as a share of the time to the next stop. Faster processes are stable without being resolved.
const SHARE_OF_GAP: f64 = 1e-4;
/// Smallest starting scale if the force does not jump, as a share of the time to the next stop. Fast processes then follow the force from the start.
const SHARE_OF_SMOOTH_GAP: f64 = 0.1;
/// Longest step times the gel's softening rate, over η.
const SOFTENING_SHARE: f64 = 3.0;
/// Number of binary digits dropped from a step's length, so that lengths that differ by rounding of the clock share their matrices.
const DROPPED_BITS: u32 = 52 - 36;

/// Rule for steps: h ≤ η (time since the switch + scale), on a ladder of lengths η 2^(j/k), so that few lengths occur.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StepRule {
    steps_per_doubling: f64,
    /// η.
    growth: f64,
    /// Fastest time that steps resolve, in s.
    fastest_s: f64,
    /// True if the force depends on the position. This feedback has no time scale of its own.
    feeds_back: bool,
    longest_step_s: f64,
}

/// Smallest starting scale of steps after a switch, as a share of the time to the next stop.
pub(crate) fn share_of_gap(jumps: bool) -> f64 {
    if jumps { SHARE_OF_GAP } else { SHARE_OF_SMOOTH_GAP }
}

/// Grading of steps after one switch.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Grading {
    switched_s: f64,
    scale_s: f64,
}

impl StepRule {
    /// Builds the rule from the fastest time of the law and the lag, and a softening rate.
    pub fn new(steps_per_doubling: u32, fastest_s: f64, feeds_back: bool, softening_per_s: f64) -> Self {
        let steps_per_doubling = f64::from(steps_per_doubling.max(1));
        let growth = steps_per_doubling.recip().exp2() - 1.0;
        let longest_step_s = SOFTENING_SHARE * growth / softening_per_s.abs();
        Self { steps_per_doubling, growth, fastest_s, feeds_back, longest_step_s }
    }

    /// Steps after a switch, with the next stop `gap_s` later. `jumps` tells whether the force jumps.
    pub(crate) fn after_switch(&self, switched_s: f64, gap_s: f64, jumps: bool) -> Grading {
        let fastest_s = if self.feeds_back { self.fastest_s.min(gap_s) } else { self.fastest_s };
        Grading { switched_s, scale_s: fastest_s.max(share_of_gap(jumps) * gap_s) }
    }

    /// Length of the step from `now_s`, with `left_s` to the next stop.
    pub(crate) fn step_s(&self, grading: Grading, now_s: f64, left_s: f64) -> f64 {
        let scale = (now_s - grading.switched_s + grading.scale_s).min(self.longest_step_s / self.growth);
        let ladder_s =
            self.growth * ((self.steps_per_doubling * scale.log2()).floor() / self.steps_per_doubling).exp2();
        fit_step_to_stop(ladder_s, left_s)
    }
}

/// Length of the next step for a wanted length `ladder_s` and a remaining time `left_s`. It does not pass the end or leave a short rest. It is rounded to 36 binary
/// digits, 7e-12 of its value.
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
