//! Largest allowed time steps after a switch of the force.
//!
//! After a switch the position moves as fast as the law's fastest modes and the lag. Consider a mode of rate ρ that has the fraction w of
//! the compliance. Collocation over a step of length h from the switch on has the relative error d w η(ρh) ΔJ(h)/J of the position. Here d
//! is the size of the switch divided by the largest force, and η the error of Radau's quadrature. ΔJ(h)/J is the relative growth of the
//! creep compliance over the step. A force with a factor e^{gx}, with g its gradient and x the position, has a further error. Let E be g x
//! at the step's end under a constant force. This exponent acts like a rate times the step, and the error is η(2E) E. [`Grading`] holds the
//! largest step for each class of switches by size. Small switches, slow modes, and fast modes with a small fraction of the compliance need
//! no short steps. Later steps may grow in proportion to the time since the switch.

/// Number of classes of switches, by their size divided by the largest force. Class 0 has the largest switches. Each further
/// class has an upper limit eight times smaller.
pub(super) const N_SIZES: usize = 3;
/// Ratio of the upper limits of neighbouring classes of switches.
pub(super) const SIZE_RATIO: f64 = 8.0;

/// Largest estimated error of a first step, relative to the position. Actual errors are smaller by a factor of a hundred or more.
const TOLERANCE: f64 = 1e-7;

/// log₂ of the ratio between successive step lengths. First steps are powers of four in seconds, so that points with nearly equal
/// rates take equal steps.
const LENGTH_RATIO_LOG2: i32 = 2;
/// Exponents of the shortest and the longest first step, as powers of four in seconds.
const EXPONENTS: [i32; 2] = [-20, 8];

/// Largest allowed step just after a switch, for each class of switches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Grading {
    /// Step length of each class, as the exponent of a power of four in seconds.
    pub(super) exponents: [i32; N_SIZES],
}

impl Grading {
    /// Grading that allows steps of any length.
    pub const NONE: Self = Self { exponents: [i32::MAX; N_SIZES] };

    /// Returns the grading with the longest steps within the tolerance.
    ///
    /// `rough` has the fraction of the compliance and the rate (1/s) of each mode, and of the lag. `modes` has each mode's gain divided by
    /// the compliance, and its rate, which is 0 for a mode that does not decay. `strength` times this gain is the mode's contribution to
    /// the rate of the exponent g x (gradient times position).
    pub fn new(rough: &[(f64, f64)], modes: &[(f64, f64)], strength: f64) -> Self {
        let mut exponents = [EXPONENTS[0]; N_SIZES];
        // The search starts at the shortest step. A class keeps its last exponent as soon as the error exceeds the class's tolerance.
        // Classes of large switches reach this point first.
        let mut first_class = 0;
        for exponent in EXPONENTS[0]..=EXPONENTS[1] {
            let length_s = length_s(exponent);
            let moved: f64 = modes.iter().map(|(gain, rate)| gain * (1.0 / rate).min(length_s)).sum();
            let lost: f64 = rough.iter().map(|(share, rate)| share * quadrature_error(rate * length_s)).sum();
            let change = strength * moved;
            let loss = lost * moved.min(1.0) + quadrature_error(2.0 * change) * change.min(1.0);
            while first_class < N_SIZES && loss > TOLERANCE * SIZE_RATIO.powi(first_class as i32) {
                first_class += 1;
            }
            exponents[first_class..].fill(exponent);
        }
        Self { exponents }
    }

    pub(super) fn longest_s(self) -> [f64; N_SIZES] {
        self.exponents.map(length_s)
    }
}

/// Length in s of a first step after a switch, from its exponent.
fn length_s(exponent: i32) -> f64 {
    (f64::from(LENGTH_RATIO_LOG2) * f64::from(exponent)).exp2()
}

/// Returns an upper bound of the error of Radau's quadrature with five nodes for e⁻ᶻˢ over s in [0, 1]. For z above 3 the bound is at most
/// six times the actual error.
fn quadrature_error(z: f64) -> f64 {
    (z / 38.0).powi(6).min(1.0 / (z + 20.0))
}
