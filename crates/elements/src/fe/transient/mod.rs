//! Time stepping of linear systems that do not separate into one field times one function of time (physics §3.2, §3.3).
//!
//! With laws Gᵢ that act on the same unknowns z, z = Gᵢ⁻¹wᵢ, a system reads
//!
//!   Σᵢ Kᵢ wᵢ + D ż + M z̈ = F(t) f.
//!
//! K w = f alone is the base model. Inertia adds M z̈, a slipping interface and pore flow add D ż, a pocket has two laws. Kᵢ and D need not be symmetric.
//!
//! Steps are taken by a singly diagonally implicit Runge–Kutta method of order four, L-stable and stiffly accurate. A law is a chain of springs, dashpots and
//! Kelvin–Voigt bodies, each of which keeps a field of its own. At a stage every body, and so the chain, is an affine function of w: z = j w + h and ż = c w + g with
//! scalars j, c and fields h, g that the bodies' histories give. One solve with Σᵢ (j₁/jᵢ) Kᵢ + c₁ D + (c₁/γΔt) M then gives w₁. While the force holds the system is
//! autonomous and linear, so the method keeps its order on stiff parts too.
//!
//! Steps end at the switches of the force, not at rows; positions at rows are read off by cubic Hermite interpolation, whose error is of the method's order with
//! a smaller constant. A force that does not depend on the position acts on a linear system, so that one step and one ramp of it give the answer to any (`respond`). Step lengths are powers of two that grow with the time since the switch, so that few factors serve a run.

mod history;
mod load;
mod output;
mod run;
mod stages;
mod steps;

pub use load::Load;
pub use output::{FieldTerm, UnitResponse};
pub use run::{TransientRun, respond, run};
pub use steps::Resolution;

use base::error::Result;
use laws::rheology::{
    CreepCompliance, Element, OscillatingMode, RetardationSpectrum, RetardedMode, SpectralMode, TimeWindow,
};

/// A matrix of a system.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Kᵢ, of the law of this index.
    Stiffness(usize),
    /// D.
    Damping,
    /// M.
    Mass,
}

/// Factors of a system's matrices in a stage's matrix.
#[derive(Debug, Clone, PartialEq)]
pub struct StageWeights {
    /// j₁/jᵢ, 1 for the first law.
    pub stiffness: Vec<f64>,
    /// c₁ in 1/(Pa·s): rate of the unknowns per unit stress of the first law.
    pub damping_per_pa_s: f64,
    /// c₁/(γΔt) in 1/(Pa·s²).
    pub mass_per_pa_s2: f64,
}

/// Replaces a right-hand side by the solution of a stage.
pub type StageSolve<'a> = Box<dyn Fn(&mut [f64]) -> Result<()> + 'a>;

/// Σᵢ Kᵢ wᵢ + D ż + M z̈ = F f, with a position that is linear in z.
pub trait TransientSystem {
    /// Number of unknowns.
    fn n_unknowns(&self) -> usize;
    /// Number of laws, at least 1.
    fn n_laws(&self) -> usize;
    /// Whether M is not zero, so that velocities are kept.
    fn has_mass(&self) -> bool;
    /// Factorises Σᵢ stiffnessᵢ Kᵢ + damping D + mass M.
    ///
    /// # Errors
    /// [`base::Error::Numerical`] where the matrix is singular.
    fn factor(&self, weights: &StageWeights) -> Result<StageSolve<'_>>;
    /// `result` += the part times `x`; nothing for parts that the system does not have.
    fn add_product(&self, part: Part, x: &[f64], result: &mut [f64]);
    /// Adds the force on the whole body (N) along x to a right-hand side.
    fn add_load(&self, force_n: f64, right_hand_side: &mut [f64]);
    /// Displacement of the robot along x (m), linear in the unknowns.
    fn position_m(&self, unknowns: &[f64]) -> f64;
}

/// A law as a chain of bodies that all carry the stress.
#[derive(Debug, Clone, PartialEq)]
pub struct ChainLaw {
    /// Springs, dashpots and Kelvin–Voigt bodies.
    pub bodies: CreepCompliance,
    /// Bodies whose rate and compliance are complex, λ and a of Re a (1 − e^{−λt}), as a springpot beside a spring has them: y' = λ (a w − y), of which the real part counts.
    pub turning: Vec<OscillatingMode<f64>>,
}

impl From<CreepCompliance> for ChainLaw {
    fn from(bodies: CreepCompliance) -> Self {
        Self { bodies, turning: Vec::new() }
    }
}

/// A law as a chain of bodies. Networks of springs and dashpots are exact; springpots are right for the times of the window.
///
/// # Errors
/// Those of [`RetardationSpectrum::of`].
pub fn chain_of(law: &[Element], window: TimeWindow) -> Result<ChainLaw> {
    let spectrum = RetardationSpectrum::of(law, window)?;
    let body = |mode: &SpectralMode| RetardedMode {
        compliance_per_pa: mode.compliance_per_pa.value,
        time_s: mode.rate_per_s.value.recip(),
    };
    let turning = |mode: &OscillatingMode| OscillatingMode {
        compliance_per_pa: mode.compliance_per_pa.map(|part| part.value),
        rate_per_s: mode.rate_per_s.map(|part| part.value),
    };
    Ok(ChainLaw {
        bodies: CreepCompliance {
            instantaneous_per_pa: spectrum.instantaneous_per_pa.value,
            retarded: spectrum.modes.iter().map(body).collect(),
            fluidity_per_pa_s: spectrum.fluidity_per_pa_s.value,
        },
        turning: spectrum.oscillating.iter().map(turning).collect(),
    })
}

#[cfg(test)]
mod tests;
