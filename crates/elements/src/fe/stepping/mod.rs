//! Time stepping of the full-order model for any combination of model stages. Every effect of load,
//! mechanics and observation is computed from its definition.
//!
//! The load is one force F(t) along x, and the law is homogeneous. Every unknown is therefore the
//! field of a unit force times one function of time (physics §3.3): u(x, t) = U(x) q(t). U = K̂⁻¹f̂
//! follows from the stiffness K̂ at unit Young's modulus and the load f̂ of a unit force. q is the
//! law's strain response (N/Pa) to the stress F e^{rt}, with the gel's softening rate r. The finite
//! elements give the field U, and the steps below give q. This module uses no creep compliance,
//! spectrum or closed form.
//!
//! The three-stage Radau IIA method advances q. The law is a network of springs, dashpots and
//! springpots, each with its own strain. Lag, force gradient and softening are solved together with
//! it at the method's stages. Steps end at every row and at every switch of the delayed command.
//! They grow geometrically after a switch.
//!
//! At the default [`Resolution`] the error of the robot's position is below 2e-8 of the largest
//! position.

mod gradient;
mod network;
mod radau;
pub mod run;
mod springpot;
mod state_law;

use super::time::FullOrderModel;
use base::error::{Error, Result};
use laws::stages::Stages;
use record::Force;

/// Refinement of the time steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Resolution {
    /// Number of steps during which the time since a switch doubles, at least 1. The error is
    /// inversely proportional to its fifth power.
    pub steps_per_doubling: u32,
}

impl Default for Resolution {
    /// Settings with an error of the robot's position below 2e-8 of the largest position.
    fn default() -> Self {
        Self { steps_per_doubling: 12 }
    }
}

/// Result of a run: values at every row, just before any force step at the row.
#[derive(Debug, Clone, PartialEq)]
pub struct SteppingResult {
    /// Recorded position, in m.
    pub position_m: Vec<f64>,
    /// Displacement of the robot, in m.
    pub displacement_m: Vec<f64>,
    /// Strain response of the law to the force at every row, in N/Pa.
    strain_n_per_pa: Vec<f64>,
}

impl FullOrderModel {
    /// Computes the model's motion through a record of ascending times (s) and commanded force. No
    /// force acts before the first row.
    ///
    /// The Poisson ratio is that of this model's factorisation; the value in `stages` is ignored.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the force gradient is too large, the law has an element without
    /// stiffness, or the position is not finite.
    pub fn step<'f>(
        &self,
        stages: &Stages,
        time_s: &[f64],
        force: impl Into<Force<'f>>,
        resolution: Resolution,
    ) -> Result<SteppingResult> {
        let compliance_per_m = self.compliance_per_m();
        let answers = run::strains_and_positions(compliance_per_m, stages, time_s, force.into(), resolution)?;
        let strain_n_per_pa: Vec<f64> = answers.iter().map(|answer| answer[0]).collect();
        let displacement_m: Vec<f64> = strain_n_per_pa.iter().map(|q| compliance_per_m * q).collect();
        let start_s = time_s.first().copied().unwrap_or(0.0);
        let observation = stages.observation.of::<f64>();
        let observe = |(answer, t): (&[f64; 2], &f64)| observation.recorded_m(answer[1], t - start_s);
        let position_m: Vec<f64> = answers.iter().zip(time_s).map(observe).collect();
        if let Some(row) = position_m.iter().position(|x| !x.is_finite()) {
            return Err(Error::numerical(
                format!("the position at {} s is {}", time_s[row], position_m[row]),
                "give parameters of moderate size",
            ));
        }
        Ok(SteppingResult { position_m, displacement_m, strain_n_per_pa })
    }

    /// Displacement (m) of all unknowns at the rows with the indices `rows`, one vector per row.
    /// Indices beyond the run's rows are omitted.
    pub fn fields_of(&self, stepped: &SteppingResult, rows: &[usize]) -> Vec<Vec<f64>> {
        let field_per_n = self.field_per_n();
        let strains = rows.iter().filter_map(|&row| stepped.strain_n_per_pa.get(row));
        strains.map(|q| field_per_n.iter().map(|u| u * q).collect()).collect()
    }
}

#[cfg(test)]
pub(crate) mod tests;
