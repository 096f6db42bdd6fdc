//! How long steps may be after a switch of the force.
//!
//! After a switch the position moves as fast as the law's fastest modes do and as the lag does. Collocation loses of a mode of rate ρ and of the
//! share w of the compliance, over a step h from the switch on, d w η(ρh) ΔJ(h)/J of the position, d the size of the switch over the largest
//! force and η the error of Radau's quadrature. Where the force follows the position by e^{gx}, g x is
//! like a rate times the step: with E what it would be at the step's end if the force stayed, η(2E) E is lost as well. [`Grading`] says how long a step may be for switches of some sizes: a small switch, slow modes or
//! fast ones of little share need no short steps. Later steps are as long as a share of the time since the switch.

/// Classes of switches by their size over the largest force: from the largest down, each up to an eighth of the one before.
pub(super) const N_SIZES: usize = 3;
pub(super) const SIZE_RATIO: f64 = 8.0;

/// Most that a first step may lose, as a share of the position, by the estimate above; what steps really lose is less by a hundred or more.
const TOLERANCE: f64 = 1e-7;

/// First steps are powers of four of a second, so that points with nearly the same rates take the same steps.
const LENGTH_RATIO_LOG2: i32 = 2;
/// Longest and shortest first steps that are told apart.
const EXPONENTS: [i32; 2] = [-20, 8];

/// How long a step may be just after a switch of each class.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Grading {
    /// Powers of four of a second.
    pub(super) exponents: [i32; N_SIZES],
}

impl Grading {
    /// Steps of any length.
    pub const NONE: Self = Self { exponents: [i32::MAX; N_SIZES] };

    /// The coarsest that keeps to the tolerance.
    ///
    /// `rough` are the shares w and rates ρ of what moves after a switch; `modes` κ and ρ of what force moves, over the compliance. Modes that do not
    /// decay have ρ = 0. `strength` turns κ into that of g x.
    pub fn new(rough: &[(f64, f64)], modes: &[(f64, f64)], strength: f64) -> Self {
        let mut exponents = [EXPONENTS[0]; N_SIZES];
        // From the finest on, as long as all shorter steps keep to the tolerance too; it is exceeded for large switches first.
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

/// A first step in s.
fn length_s(exponent: i32) -> f64 {
    (f64::from(LENGTH_RATIO_LOG2) * f64::from(exponent)).exp2()
}

/// What Radau's quadrature with five nodes errs by for e⁻ᶻˢ over [0, 1], from above within a factor of six beyond z = 3.
fn quadrature_error(z: f64) -> f64 {
    (z / 38.0).powi(6).min(1.0 / (z + 20.0))
}
