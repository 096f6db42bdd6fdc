//! Largest steps after a switch of the force.
//!
//! After a switch the position moves as fast as the law's fastest modes and the lag. For a mode of rate ρ and share w of the compliance, collocation
//! over a step h from the switch on has the error d w η(ρh) ΔJ(h)/J of the position. Here d is the size of the switch over the largest
//! force, and η the error of Radau's quadrature. Where the force follows the position by e^{gx}, g x acts
//! like a rate times the step. With E its value at the step's end under a constant force, η(2E) E is a further error. [`Grading`] holds the step lengths for switches
//! of some sizes. Small switches, slow modes and fast modes of small share need no short steps. Later steps may be as long as a share of the time since the switch.

/// Number of classes of switches by size over the largest force, from the largest down. A class's upper limit is an eighth of the previous one's.
pub(super) const N_SIZES: usize = 3;
pub(super) const SIZE_RATIO: f64 = 8.0;

/// Largest estimated error of a first step, as a share of the position. Actual errors are smaller by a factor of a hundred or more.
const TOLERANCE: f64 = 1e-7;

/// First steps are powers of four of a second, so that points with nearly equal rates take equal steps.
const LENGTH_RATIO_LOG2: i32 = 2;
/// Exponents of the shortest and the longest first step.
const EXPONENTS: [i32; 2] = [-20, 8];

/// Largest step just after a switch of each class.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Grading {
    /// Exponents of powers of four of a second.
    pub(super) exponents: [i32; N_SIZES],
}

impl Grading {
    /// Grading that allows steps of any length.
    pub const NONE: Self = Self { exponents: [i32::MAX; N_SIZES] };

    /// Coarsest grading within the tolerance.
    ///
    /// `rough` are shares w and rates ρ of the parts that move after a switch. `modes` are κ over the compliance, and ρ, of the parts that a force moves. Modes that do not
    /// decay have ρ = 0. `strength` converts κ into the rate of g x.
    pub fn new(rough: &[(f64, f64)], modes: &[(f64, f64)], strength: f64) -> Self {
        let mut exponents = [EXPONENTS[0]; N_SIZES];
        // The search starts at the finest length and ends where the tolerance is exceeded, which happens for large switches first.
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

/// Length of a first step in s.
fn length_s(exponent: i32) -> f64 {
    (f64::from(LENGTH_RATIO_LOG2) * f64::from(exponent)).exp2()
}

/// Error of Radau's quadrature with five nodes for e⁻ᶻˢ over [0, 1]. It is an upper bound, within a factor of six beyond z = 3.
fn quadrature_error(z: f64) -> f64 {
    (z / 38.0).powi(6).min(1.0 / (z + 20.0))
}
