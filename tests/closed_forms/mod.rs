//! Closed forms for comparison in tests, written from the physics and independent of the library.
#![allow(dead_code, reason = "each test file uses its own part")]

use std::f64::consts::PI;

/// Rigid prolate spheroid in the middle of a rigid sphere (physics §4.3, §4.8).
#[derive(Clone, Copy)]
pub struct Spheroid {
    /// Half the long axis in m.
    pub semi_major_m: f64,
    /// Half the short axes in m.
    pub semi_minor_m: f64,
    /// Radius of the fixed outer sphere in m.
    pub outer_radius_m: f64,
}

impl Spheroid {
    /// Force per displacement (N/m, whole body) at a Young's modulus of 1 Pa, for motion along the long axis or across it.
    pub fn stiffness_n_per_m(self, poisson_ratio: f64, along: bool) -> f64 {
        let Self { semi_major_m: a, semi_minor_m: b, outer_radius_m: outer } = self;
        let nu = poisson_ratio;
        let mu = 1.0 / (2.0 * (1.0 + nu));
        let e = (1.0 - (b / a).powi(2)).sqrt();
        let l = ((1.0 + e) / (1.0 - e)).ln();
        let chi = l / (a * e);
        let alpha_along = (l - 2.0 * e) / (a * e).powi(3);
        let alpha_across = (2.0 / (a * b * b) - alpha_along) / 2.0;
        let (axis, alpha) = if along { (a, alpha_along) } else { (b, alpha_across) };
        let unbounded = 32.0 * PI * mu * (1.0 - nu) / ((3.0 - 4.0 * nu) * chi + axis * axis * alpha);
        let kappa = 1.0 / (16.0 * PI * mu * (1.0 - nu));
        let b_2 = kappa / (2.0 * (2.0 - 3.0 * nu) * outer.powi(3));
        let b_0 = -kappa / outer * ((3.0 - 4.0 * nu) + (3.0 - 2.0 * nu) / (2.0 * (2.0 - 3.0 * nu)));
        let squares = a * a + 2.0 * b * b;
        let g = b_2 * ((3.0 - 2.0 * nu) * squares / 3.0 - 2.0 * (2.0 - 3.0 * nu) * axis * axis / 3.0);
        1.0 / (1.0 / unbounded + b_0 + 2.0 * g)
    }
}
