//! The three-stage Radau IIA method (order 5, L-stable): E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, §IV.5,
//! doi:10.1007/978-3-642-05221-7. Its last stage is the step's end, so that strains that jump with the stress need no special treatment.

use nalgebra::{Matrix3, Vector3};

/// Coefficients of the method.
#[derive(Debug, Clone, Copy)]
pub(super) struct Radau {
    /// Stages as shares of the step.
    pub nodes: Vector3<f64>,
    /// A: stage values are the start's value plus Δt A times the stages' rates.
    pub matrix: Matrix3<f64>,
    /// A⁻¹.
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

    /// (I + zA)⁻¹: stage values of y' = −(z/Δt)(y − y_end), as a share of the initial distance.
    pub(super) fn resolvent(&self, z: f64) -> Matrix3<f64> {
        inverted(Matrix3::identity() + self.matrix * z)
    }
}

/// The inverse. It is NaN for a singular matrix, so that the run's check of its result detects this.
pub(super) fn inverted(matrix: Matrix3<f64>) -> Matrix3<f64> {
    matrix.try_inverse().unwrap_or_else(|| Matrix3::repeat(f64::NAN))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stages integrate tⁿ⁻¹ exactly up to n = 3; the end, the last row of A, up to n = 5.
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

    /// R(−z) is the (2, 3) Padé approximation of e⁻ᶻ.
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
