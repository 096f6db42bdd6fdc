//! Time stepping of linear systems whose response is not one field times one function of time
//! (physics §3.2, §3.3).
//!
//! The laws Gᵢ act on common unknowns z, with z = Gᵢ⁻¹wᵢ. The system reads
//!
//!  Σᵢ Kᵢ wᵢ + D ż + M z̈ = F(t) f.
//!
//! K w = f alone is the base model. Inertia adds M z̈. A slipping interface and pore flow add D ż.
//! A pocket has two laws. Kᵢ and D need not be symmetric.
//!
//! The method is a singly diagonally implicit Runge–Kutta method of order four, L-stable and
//! stiffly accurate. A law is a chain of springs, dashpots and Kelvin–Voigt bodies, each with its
//! own field. At a stage every body is an affine function of w, and so is the chain: z = j w + h
//! and ż = c w + g. The scalars j, c and fields h, g follow from the bodies' histories. One
//! solution with Σᵢ (j₁/jᵢ) Kᵢ + c₁ D + (c₁/γΔt) M then gives w₁. While the force holds, the system
//! is autonomous and linear, so that the method keeps its order on stiff parts.
//!
//! Steps end at the switches of the force, not at rows. Positions at rows come from cubic Hermite
//! interpolation. Its error has the method's order and a smaller constant. If the force does not
//! depend on the position, it acts on a linear system. Responses to one step and one ramp then give
//! the response to any force (`respond`). Step lengths are powers of two that grow with the time
//! since the switch, so that few factors serve a run.

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

/// One of a system's matrices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChainPart {
    /// Stiffness Kᵢ of the law with this index.
    Stiffness(usize),
    /// Damping matrix D.
    Damping,
    /// Mass matrix M.
    Mass,
}

/// Weights with which a system's matrices are summed to the matrix of a stage.
#[derive(Debug, Clone, PartialEq)]
pub struct StageWeights {
    /// j₁/jᵢ for every law i. It is 1 for the first law.
    pub stiffness: Vec<f64>,
    /// c₁ in 1/(Pa·s): rate of the unknowns per unit stress of the first law, the weight of D.
    pub damping_per_pa_s: f64,
    /// c₁/(γΔt) in 1/(Pa·s²), the weight of M.
    pub mass_per_pa_s2: f64,
}

/// Function that solves a stage: it replaces a right-hand side by the solution.
pub type StageSolve<'a> = Box<dyn Fn(&mut [f64]) -> Result<()> + 'a>;

/// A system Σᵢ Kᵢ wᵢ + D ż + M z̈ = F f whose position is linear in z.
pub trait TransientSystem {
    /// Number of unknowns.
    fn n_unknowns(&self) -> usize;
    /// Number of laws Gᵢ, at least 1.
    fn n_laws(&self) -> usize;
    /// True if M is not zero. Velocities must then be stored.
    fn has_mass(&self) -> bool;
    /// Factorises the matrix Σᵢ stiffnessᵢ Kᵢ + damping D + mass M.
    ///
    /// # Errors
    /// [`base::Error::Numerical`] if the matrix is singular.
    fn factor(&self, weights: &StageWeights) -> Result<StageSolve<'_>>;
    /// Adds the matrix `part` times `x` to `result`. Does nothing if the system lacks that matrix.
    fn add_product(&self, part: ChainPart, x: &[f64], result: &mut [f64]);
    /// Adds a force (N) on the whole body along x to a right-hand side.
    fn add_load(&self, force_n: f64, right_hand_side: &mut [f64]);
    /// Displacement of the robot along x (m). It is linear in the unknowns.
    fn position_m(&self, unknowns: &[f64]) -> f64;
}

/// A law as a chain of bodies. Each carries the full stress.
#[derive(Debug, Clone, PartialEq)]
pub struct ChainLaw {
    /// Springs, dashpots and Kelvin–Voigt bodies with real rates.
    pub bodies: CreepCompliance,
    /// Bodies with complex rate λ and compliance a, such as those of a springpot beside a spring.
    /// Their creep compliance is Re a (1 − e^{−λt}). They obey y' = λ (a w − y), and the strain is
    /// the real part of y.
    pub oscillating: Vec<OscillatingMode<f64>>,
}

impl From<CreepCompliance> for ChainLaw {
    fn from(bodies: CreepCompliance) -> Self {
        Self { bodies, oscillating: Vec::new() }
    }
}

/// Converts a law into a chain of bodies. Networks of springs and dashpots are converted exactly.
/// Springpots are accurate for times within the window.
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
