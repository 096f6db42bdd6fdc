//! Galerkin projection of the full-order model on a few modes, with the affine split in the moduli (physics §3.4).

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::pod::dot;
use crate::error::{Error, Result};
use crate::fe::assembly::{Assembly, unit_moduli};
use crate::fe::factorisation::add_symmetric_product;

/// Reduced operators: all that is needed to answer for any Poisson ratio in the trained range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReducedOperators {
    /// Number of modes m.
    pub n_modes: usize,
    /// Vᵀ K_dev V, row by row, m × m.
    pub deviatoric: Vec<f64>,
    /// Vᵀ K_vol V, row by row, m × m.
    pub volumetric: Vec<f64>,
    /// The robot's translation in each mode.
    pub robot: Vec<f64>,
    /// Share of the whole body's force that the meshed part carries.
    pub force_share: f64,
}

impl ReducedOperators {
    /// Projects the two affine parts on the modes (offline).
    pub fn project(assembly: &Assembly, modes: &[Vec<f64>], force_share: f64) -> Self {
        let n_modes = modes.len();
        let project = |matrix| {
            let mut reduced = vec![0.0; n_modes * n_modes];
            for (j, mode) in modes.iter().enumerate() {
                let mut image = vec![0.0; mode.len()];
                add_symmetric_product(matrix, mode, &mut image);
                for (i, other) in modes.iter().enumerate() {
                    reduced[i * n_modes + j] = dot(other, &image);
                }
            }
            reduced
        };
        let robot_unknown = assembly.unknowns.robot();
        Self {
            n_modes,
            deviatoric: project(assembly.deviatoric()),
            volumetric: project(assembly.volumetric()),
            robot: modes.iter().map(|mode| mode[robot_unknown]).collect(),
            force_share,
        }
    }

    /// Reduced coordinates of the response to unit force on the whole body at unit Young's modulus (online).
    pub fn unit_response(&self, poisson_ratio: f64) -> Result<DVector<f64>> {
        let [two_mu, kappa] = unit_moduli(poisson_ratio);
        let m = self.n_modes;
        let stiffness =
            DMatrix::from_fn(m, m, |i, j| two_mu * self.deviatoric[i * m + j] + kappa * self.volumetric[i * m + j]);
        let force = DVector::from_iterator(m, self.robot.iter().map(|r| self.force_share * r));
        let cholesky = stiffness.cholesky().ok_or_else(|| {
            Error::numerical(
                format!("the reduced stiffness at Poisson ratio {poisson_ratio} is not positive definite"),
                "delete the cached surrogate and build it again",
            )
        })?;
        Ok(cholesky.solve(&force))
    }

    /// Displacement of the robot per unit force at unit Young's modulus, in 1/m.
    pub fn compliance_per_m(&self, poisson_ratio: f64) -> Result<f64> {
        let response = self.unit_response(poisson_ratio)?;
        Ok(self.robot.iter().zip(response.iter()).map(|(r, q)| r * q).sum())
    }
}
