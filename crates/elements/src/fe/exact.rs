//! Exact stiffnesses of a rigid sphere for the verification of the finite elements (physics §4). A
//! stiffness is the force on the whole sphere divided by its displacement.

use nalgebra::{Matrix4, Vector4};

/// Stiffness (force / displacement, N/m) of a rigid sphere in an infinite medium (physics §4.1).
pub fn sphere_in_infinite_medium_n_per_m(young_modulus_pa: f64, poisson_ratio: f64, radius_m: f64) -> f64 {
    let shear_modulus_pa = young_modulus_pa / (2.0 * (1.0 + poisson_ratio));
    24.0 * std::f64::consts::PI * shear_modulus_pa * radius_m * (1.0 - poisson_ratio) / (5.0 - 6.0 * poisson_ratio)
}

/// Solution for a rigid sphere at the centre of a rigid spherical container. It is a combination of
/// the four displacement modes of physics §4.2, for unit displacement of the sphere.
#[derive(Debug, Clone, Copy)]
pub struct SphereInContainer {
    poisson_ratio: f64,
    radius_m: f64,
    amplitudes: Vector4<f64>,
}

impl SphereInContainer {
    /// Computes the amplitudes of the four modes from the displacement's boundary values: 1 along x
    /// on the sphere, 0 on the container. Radii are in m, with 0 < `radius_m` < `outer_radius_m`.
    pub fn new(poisson_ratio: f64, radius_m: f64, outer_radius_m: f64) -> Self {
        // Lengths in units of the sphere's radius keep the system well conditioned.
        let (inner, outer) = (modes(poisson_ratio, 1.0), modes(poisson_ratio, outer_radius_m / radius_m));
        let system = Matrix4::from_fn(|row, mode| [inner[mode].0, inner[mode].1, outer[mode].0, outer[mode].1][row]);
        let amplitudes = system.lu().solve(&Vector4::new(1.0, 0.0, 0.0, 0.0)).unwrap_or(Vector4::repeat(f64::NAN));
        Self { poisson_ratio, radius_m, amplitudes }
    }

    /// Stiffness (force / displacement, N/m) of the sphere.
    pub fn stiffness_n_per_m(&self, young_modulus_pa: f64) -> f64 {
        let shear_modulus_pa = young_modulus_pa / (2.0 * (1.0 + self.poisson_ratio));
        16.0 * std::f64::consts::PI * shear_modulus_pa * (1.0 - self.poisson_ratio) * self.amplitudes[1] * self.radius_m
    }

    /// Displacement of the medium at a point (m), for unit displacement of the sphere along x.
    pub fn displacement(&self, point_m: [f64; 3]) -> [f64; 3] {
        let r = point_m.iter().map(|x| x * x).sum::<f64>().sqrt();
        let n = point_m.map(|x| x / r);
        let modes = modes(self.poisson_ratio, r / self.radius_m);
        let a: f64 = modes.iter().zip(self.amplitudes.iter()).map(|(m, c)| m.0 * c).sum();
        let b: f64 = modes.iter().zip(self.amplitudes.iter()).map(|(m, c)| m.1 * c).sum();
        std::array::from_fn(|i| b * n[0] * n[i] + if i == 0 { a } else { 0.0 })
    }
}

/// Coefficients (A, B) of the four displacement modes A e_x + B (e_x·n) n at a distance `r` from
/// the centre, in sphere radii. e_x is the direction of the force, n the direction from the centre.
fn modes(nu: f64, r: f64) -> [(f64, f64); 4] {
    [
        (1.0, 0.0),
        ((3.0 - 4.0 * nu) / r, 1.0 / r),
        (r.powi(-3), -3.0 * r.powi(-3)),
        ((3.0 - 2.0 * nu) * r * r, -2.0 * (2.0 - 3.0 * nu) * r * r),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_numbers_and_limits() {
        // The value is that of physics §4.10.
        let k = SphereInContainer::new(0.48, 0.275e-3, 10e-3).stiffness_n_per_m(1.0);
        assert!((k / 1.820902396e-3 - 1.0).abs() < 1e-9, "{k}");
        let k = sphere_in_infinite_medium_n_per_m(1.0, 0.48, 0.275e-3);
        assert!((k / 1.718183641e-3 - 1.0).abs() < 1e-9, "{k}");
        // A container at a great distance has no effect.
        let k = SphereInContainer::new(0.3, 1.0, 1e7).stiffness_n_per_m(1.0);
        assert!((k / sphere_in_infinite_medium_n_per_m(1.0, 0.3, 1.0) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn incompressible_limit_is_stokes_in_a_container() {
        let (lambda, nu) = (0.3_f64, 0.5 - 1e-7);
        let factor = (1.0 - lambda.powi(5))
            / (1.0 - 9.0 * lambda / 4.0 + 5.0 * lambda.powi(3) / 2.0 - 9.0 * lambda.powi(5) / 4.0 + lambda.powi(6));
        let k = SphereInContainer::new(nu, lambda, 1.0).stiffness_n_per_m(3.0);
        assert!((k / (6.0 * std::f64::consts::PI * lambda * factor) - 1.0).abs() < 1e-5);
    }
}
