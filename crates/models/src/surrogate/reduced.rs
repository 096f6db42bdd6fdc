//! Galerkin projection of the full-order model on a few modes. The stiffness is split into deviatoric and volumetric matrices,
//! which are multiplied by the moduli (physics §3.4).

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::pod::dot;
use base::error::{Error, Result};
use base::number::Dual;
use elements::fe::assembly::{Assembly, unit_moduli};
use elements::fe::factorisation::add_symmetric_product;

/// Reduced operators, which give the response for any Poisson ratio in the trained range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReducedOperators {
    /// Number m of modes.
    pub n_modes: usize,
    /// Reduced deviatoric stiffness Vᵀ K_dev V, m × m, row by row. K_dev is the full-order matrix, and the m columns of V are the modes.
    pub deviatoric: Vec<f64>,
    /// Reduced volumetric stiffness Vᵀ K_vol V, m × m, row by row. K_vol is the full-order matrix, and the m columns of V are the modes.
    pub volumetric: Vec<f64>,
    /// Translation of the robot in each mode.
    pub robot: Vec<f64>,
    /// Fraction of the whole robot's force that the meshed symmetric section carries.
    pub force_share: f64,
}

impl ReducedOperators {
    /// Projects the deviatoric and the volumetric stiffness on the modes.
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

    /// Returns `true` if every list has the length that follows from the number of modes, and every number is finite.
    pub fn is_whole(&self) -> bool {
        let Self { n_modes, deviatoric, volumetric, robot, force_share } = self;
        let square = n_modes.checked_mul(*n_modes);
        *n_modes > 0
            && [deviatoric, volumetric].iter().all(|values| Some(values.len()) == square)
            && robot.len() == *n_modes
            && [deviatoric, volumetric, robot].into_iter().flatten().chain([force_share]).all(|x| x.is_finite())
    }

    /// Returns the factors of the modes in the response to a unit force on the whole robot, at unit Young's modulus.
    pub fn unit_response(&self, poisson_ratio: f64) -> Result<DVector<f64>> {
        let [two_mu, kappa] = unit_moduli(poisson_ratio);
        let force = DVector::from_iterator(self.n_modes, self.robot.iter().map(|r| self.force_share * r));
        let cholesky = self.combined(two_mu, kappa).cholesky().ok_or_else(|| {
            Error::numerical(
                format!("the reduced stiffness at Poisson ratio {poisson_ratio} is not positive definite"),
                "delete the cached surrogate and build it again",
            )
        })?;
        Ok(cholesky.solve(&force))
    }

    fn combined(&self, deviatoric: f64, volumetric: f64) -> DMatrix<f64> {
        let m = self.n_modes;
        DMatrix::from_fn(m, m, |i, j| deviatoric * self.deviatoric[i * m + j] + volumetric * self.volumetric[i * m + j])
    }

    /// Displacement of the robot per unit force at unit Young's modulus, in 1/m, at a Poisson ratio.
    pub fn compliance_per_m(&self, poisson_ratio: f64) -> Result<f64> {
        Ok(self.dual_compliance_per_m(Dual::constant(poisson_ratio))?.value)
    }

    /// Returns the displacement C per unit force (1/m) with its derivative by the Poisson ratio ν. The factors q of the modes solve K(ν)
    /// q = s r, with K the reduced stiffness. Then C = rᵀq and dC = −qᵀ dK q / s. r is the robot's translation in the modes, and s the
    /// fraction of the force on the mesh.
    pub fn dual_compliance_per_m(&self, poisson_ratio: Dual) -> Result<Dual> {
        let response = self.unit_response(poisson_ratio.value)?;
        let value = self.robot.iter().zip(response.iter()).map(|(r, q)| r * q).sum();
        if poisson_ratio.derivative == 0.0 {
            return Ok(Dual::constant(value));
        }
        let [two_mu_slope, kappa_slope] = unit_moduli_slopes(poisson_ratio.value);
        let slope = -response.dot(&(self.combined(two_mu_slope, kappa_slope) * &response)) / self.force_share;
        Ok(Dual { value, derivative: slope * poisson_ratio.derivative })
    }
}

/// Derivatives of [`unit_moduli`] with respect to the Poisson ratio.
fn unit_moduli_slopes(poisson_ratio: f64) -> [f64; 2] {
    let [two_mu, kappa] = unit_moduli(poisson_ratio);
    [-two_mu * two_mu, 6.0 * kappa * kappa]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edited_operators_are_not_whole() {
        let whole = || ReducedOperators {
            n_modes: 1,
            deviatoric: vec![3.0],
            volumetric: vec![0.5],
            robot: vec![1.0],
            force_share: 0.25,
        };
        assert!(whole().is_whole());
        for n_modes in [0, 2, usize::MAX] {
            assert!(!ReducedOperators { n_modes, ..whole() }.is_whole());
        }
        assert!(!ReducedOperators { deviatoric: vec![], ..whole() }.is_whole());
        assert!(!ReducedOperators { robot: vec![], ..whole() }.is_whole());
        assert!(!ReducedOperators { volumetric: vec![f64::INFINITY], ..whole() }.is_whole());
    }

    /// Compares the derivative with a central difference, whose error is about 1e-9.
    #[test]
    fn the_compliance_has_its_derivative() {
        let operators = ReducedOperators {
            n_modes: 2,
            deviatoric: vec![3.0, 0.4, 0.4, 2.0],
            volumetric: vec![0.5, 0.1, 0.1, 0.7],
            robot: vec![1.0, 0.3],
            force_share: 0.25,
        };
        for ratio in [0.2, 0.48] {
            let at = |ratio: f64| operators.compliance_per_m(ratio).expect("positive definite");
            let found = operators.dual_compliance_per_m(Dual::variable(ratio)).expect("positive definite").derivative;
            let difference = (at(ratio + 1e-6) - at(ratio - 1e-6)) / 2e-6;
            assert!((found / difference - 1.0).abs() < 1e-7, "{ratio}: {found} against {difference}");
        }
    }
}
