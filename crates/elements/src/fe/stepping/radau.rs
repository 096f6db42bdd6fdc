//! The three-stage Radau IIA method (order 5, L-stable). Source: E. Hairer, G. Wanner, Solving
//! Ordinary Differential Equations II, §IV.5, doi:10.1007/978-3-642-05221-7. Its last stage is the
//! step's end, so that strains that jump with the stress need no special treatment.

use nalgebra::{Matrix3, Vector3};

/// Coefficients of the Radau IIA method.
#[derive(Debug, Clone, Copy)]
pub(super) struct Radau {
    /// Time of each stage, as a fraction of the step.
    pub nodes: Vector3<f64>,
    /// Coefficient matrix: values at the stages are the value at the start plus the step's length
    /// times this matrix times the rates at the stages.
    pub matrix: Matrix3<f64>,
    /// Inverse of the coefficient matrix.
    pub inverse: Matrix3<f64>,
}

impl Radau {
    pub fn new() -> Self {
        let root = 6.0_f64.sqrt();
        let matrix = Matrix3::new(
            (88.0 - 7.0 * root) / 360.0,
            (296.0 - 169.0 * root) / 1800.0,
            (-2.0 + 3.0 * root) / 225.0,
            (296.0 + 169.0 * root) / 1800.0,
            (88.0 + 7.0 * root) / 360.0,
            (-2.0 - 3.0 * root) / 225.0,
            (16.0 - root) / 36.0,
            (16.0 + root) / 36.0,
            1.0 / 9.0,
        );
        let nodes = Vector3::new((4.0 - root) / 10.0, (4.0 + root) / 10.0, 1.0);
        Self { nodes, matrix, inverse: inverted(matrix) }
    }

    /// Returns (I + zA)⁻¹, with the coefficient matrix A. Its row sums are the values at the stages
    /// for the decay y' = −(z/Δt) y from 1, in a step of length Δt.
    pub(super) fn resolvent(&self, z: f64) -> Matrix3<f64> {
        inverted(Matrix3::identity() + self.matrix * z)
    }
}

/// Inverse of a matrix. For a singular matrix it is NaN, so that the final check of the run's
/// result detects this.
pub(super) fn inverted(matrix: Matrix3<f64>) -> Matrix3<f64> {
    matrix.try_inverse().unwrap_or_else(|| Matrix3::repeat(f64::NAN))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks the exactness of the integrals of tⁿ⁻¹. The stages are exact up to n = 3. The end,
    /// given by the last row of A, is exact up to n = 5.
    #[test]
    fn polynomials_are_integrated_exactly() {
        let radau = Radau::new();
        for n in 1..=5_i32 {
            let integral = radau.matrix * radau.nodes.map(|c| c.powi(n - 1)) * f64::from(n);
            let exact = radau.nodes.map(|c| c.powi(n));
            assert!((integral[2] - 1.0).abs() < 1e-14, "{n}");
            assert!(n > 3 || (integral - exact).amax() < 1e-14, "{n}");
        }
    }

    /// Checks that the method's factor for a decay, R(−z), is the (2, 3) Padé approximation of e⁻ᶻ.
    #[test]
    fn the_end_of_a_decay_is_the_pade_approximation() {
        let radau = Radau::new();
        for z in [1e-3, 0.3, 2.0, 1e3, 1e12] {
            let found = (radau.resolvent(z) * Vector3::repeat(1.0))[2];
            let numerator = 1.0 - 2.0 * z / 5.0 + z * z / 20.0;
            let pade = numerator / (1.0 + 3.0 * z / 5.0 + 3.0 * z * z / 20.0 + z.powi(3) / 60.0);
            assert!((found - pade).abs() < 1e-14, "{z}: {found} {pade}");
        }
    }
}
