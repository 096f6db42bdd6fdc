//! Time stepping of linear systems whose displacement field changes its shape over time (physics
//! §3.2, §3.3).
//!
//! A system has one or more laws with common unknowns z (m). Law i relates z to a stress field wᵢ,
//! which the stiffness matrix Kᵢ converts to forces. With the damping matrix D and the mass matrix
//! M, the balance of forces is
//!
//!  Σᵢ Kᵢ wᵢ + D ż + M z̈ = F(t) f.
//!
//! F is the force and f the load vector of a unit force. The base model has one law and neither D
//! nor M. Inertia adds M z̈. A slipping interface and pore flow add D ż. A pocket has two laws. Kᵢ
//! and D need not be symmetric.
//!
//! The method is a singly diagonally implicit Runge–Kutta method of order four, L-stable and
//! stiffly accurate. A law is a chain of springs, dashpots and Kelvin–Voigt bodies, each with its
//! own field. At a stage every body is an affine function of w, and so is the chain: z = j w + h
//! and ż = c w + g. The scalars j, c and fields h, g follow from the bodies' histories. One
//! solution with Σᵢ (j₁/jᵢ) Kᵢ + c₁ D + (c₁/γΔt) M then gives w₁. Δt is the step length and γ the
//! method's diagonal coefficient. While the force holds, the system is autonomous and linear, so
//! that the method keeps its order on stiff parts.
//!
//! Steps end at the switches of the force, not at rows. Positions at rows come from cubic Hermite
//! interpolation. Its error has the method's order and a smaller constant. If the force does not
//! depend on the position, responses to one step and one ramp give the response to any force
//! ([`unit_response`]). Step lengths are powers of two that grow with the time since the switch, so
//! that few factors serve a run.

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

/// Names one of a system's matrices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChainPart {
    /// Stiffness matrix of the law with this index.
    Stiffness(usize),
    /// Damping matrix, which multiplies the rates of the unknowns.
    Damping,
    /// Mass matrix, which multiplies the accelerations.
    Mass,
}

/// Weights of a system's matrices in the matrix of the linear system of one stage.
#[derive(Debug, Clone, PartialEq)]
pub struct StageWeights {
    /// Weight of each law's stiffness matrix: the first law's compliance over the stage, divided by
    /// this law's compliance. It is 1 for the first law.
    pub stiffness: Vec<f64>,
    /// Weight of the damping matrix, in 1/(Pa·s): rate of the unknowns per unit stress of the first
    /// law.
    pub damping_per_pa_s: f64,
    /// Weight of the mass matrix, in 1/(Pa·s²): the damping matrix's weight divided by the stage's
    /// implicit time (diagonal coefficient × step length).
    pub mass_per_pa_s2: f64,
}

/// Function that solves the linear system of a stage. It replaces the right-hand side by the
/// solution.
pub type StageSolve<'a> = Box<dyn Fn(&mut [f64]) -> Result<()> + 'a>;

/// A linear system with stiffness, damping and mass matrices on common unknowns, for time stepping.
/// The robot's position is linear in the unknowns.
pub trait TransientSystem {
    /// Number of unknowns.
    fn n_unknowns(&self) -> usize;
    /// Number of laws, at least 1. Each law has its own stiffness matrix.
    fn n_laws(&self) -> usize;
    /// True if the system has a mass matrix. Velocities must then be stored.
    fn has_mass(&self) -> bool;
    /// Factorises the sum of the stiffness, damping and mass matrices with the given weights.
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

/// A law as a chain of bodies in series, each of which bears the full stress.
#[derive(Debug, Clone, PartialEq)]
pub struct ChainLaw {
    /// Springs, dashpots and Kelvin–Voigt bodies with real rates.
    pub bodies: CreepCompliance,
    /// Bodies with a complex rate λ and a complex compliance a, such as those of a springpot beside
    /// a spring. The creep compliance of a body is the real part of a (1 − e^{−λt}).
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
