//! Time stepping of linear systems that do not separate into one field times one function of time (physics §3.2, §3.3).
//!
//! A system whose laws Gᵢ act on common unknowns z, z = Gᵢ⁻¹wᵢ, reads
//!
//!   Σᵢ Kᵢ wᵢ + D ż + M z̈ = F(t) f.
//!
//! K w = f alone is the base model. Inertia adds M z̈, a slipping interface and pore flow add D ż, a pocket has two laws. Kᵢ and D need not be symmetric.
//!
//! The method is a singly diagonally implicit Runge–Kutta method of order four, L-stable and stiffly accurate. A law is a chain of springs, dashpots and
//! Kelvin–Voigt bodies, each with its own field. At a stage every body, and so the chain, is an affine function of w: z = j w + h and ż = c w + g with
//! scalars j, c and fields h, g from the bodies' histories. One solve with Σᵢ (j₁/jᵢ) Kᵢ + c₁ D + (c₁/γΔt) M then gives w₁. While the force holds, the system is
//! autonomous and linear, so that the method keeps its order on stiff parts.
//!
//! Steps end at the switches of the force, not at rows. Positions at rows come from cubic Hermite interpolation, whose error has the method's order and
//! a smaller constant. A force that does not depend on the position acts on a linear system. Responses to one step and one ramp then give the response to any force (`respond`).
//! Step lengths are powers of two that grow with the time since the switch, so that few factors serve a run.

mod history;
mod load;
mod output;
mod run;
mod stages;
mod steps;

pub use load::Load;
pub use output::{FieldTerm, UnitResponse};
pub use run::{TransientRun, run, unit_response};
pub use steps::Resolution;

use base::error::Result;
use laws::rheology::{
    CreepCompliance, Element, OscillatingMode, RetardationSpectrum, RetardedMode, SpectralMode, TimeWindow,
};

/// A matrix of a system.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChainPart {
    /// Kᵢ of the law with this index.
    Stiffness(usize),
    /// D.
    Damping,
    /// M.
    Mass,
}

/// Weights of a system's matrices in the matrix of a stage.
#[derive(Debug, Clone, PartialEq)]
pub struct StageWeights {
    /// j₁/jᵢ, 1 for the first law.
    pub stiffness: Vec<f64>,
    /// c₁ in 1/(Pa·s): rate of the unknowns per unit stress of the first law.
    pub damping_per_pa_s: f64,
    /// c₁/(γΔt) in 1/(Pa·s²).
    pub mass_per_pa_s2: f64,
}

/// Function that replaces a right-hand side by the solution of a stage.
pub type StageSolve<'a> = Box<dyn Fn(&mut [f64]) -> Result<()> + 'a>;

/// Σᵢ Kᵢ wᵢ + D ż + M z̈ = F f, with a position that is linear in z.
pub trait TransientSystem {
    /// Number of unknowns.
    fn n_unknowns(&self) -> usize;
    /// Number of laws, at least 1.
    fn n_laws(&self) -> usize;
    /// True if M is not zero, so that velocities must be stored.
    fn has_mass(&self) -> bool;
    /// Factorises Σᵢ stiffnessᵢ Kᵢ + damping D + mass M.
    ///
    /// # Errors
    /// [`base::Error::Numerical`] if the matrix is singular.
    fn factor(&self, weights: &StageWeights) -> Result<StageSolve<'_>>;
    /// `result` += the part times `x`. Does nothing for parts that the system lacks.
    fn add_product(&self, part: ChainPart, x: &[f64], result: &mut [f64]);
    /// Adds the force on the whole body (N) along x to a right-hand side.
    fn add_load(&self, force_n: f64, right_hand_side: &mut [f64]);
    /// Displacement of the robot along x (m), linear in the unknowns.
    fn position_m(&self, unknowns: &[f64]) -> f64;
}

/// A law as a chain of bodies that all carry the full stress.
#[derive(Debug, Clone, PartialEq)]
pub struct ChainLaw {
    /// Springs, dashpots and Kelvin–Voigt bodies.
    pub bodies: CreepCompliance,
    /// Bodies with complex rate λ and compliance a, Re a (1 − e^{−λt}), as of a springpot beside a spring. y' = λ (a w − y), and the strain is the real part of y.
    pub oscillating: Vec<OscillatingMode<f64>>,
}

impl From<CreepCompliance> for ChainLaw {
    fn from(bodies: CreepCompliance) -> Self {
        Self { bodies, oscillating: Vec::new() }
    }
}

/// Converts a law into a chain of bodies. Networks of springs and dashpots are exact; springpots are accurate within the window's times.
///
/// # Errors
/// Those of [`RetardationSpectrum::of_law`].
pub fn to_chain(law: &[Element], window: TimeWindow) -> Result<ChainLaw> {
    let spectrum = RetardationSpectrum::of_law(law, window)?;
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
        oscillating: spectrum.oscillating.iter().map(turning).collect(),
    })
}

#[cfg(test)]
mod tests;
