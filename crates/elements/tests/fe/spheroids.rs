//! Exact stiffnesses of rigid spheroids, in an infinite medium and at the centre of a fixed sphere.

use elements::fe::exact::{SphereInContainer, sphere_in_infinite_medium_n_per_m};

/// Stiffness (force / displacement, N/m) of a rigid body of revolution, for the whole body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxialAndTransverse {
    /// Stiffness for a force along the axis of revolution.
    pub axial_n_per_m: f64,
    /// Stiffness for a force across the axis of revolution.
    pub transverse_n_per_m: f64,
}

/// Stiffness of a rigid spheroid in an infinite medium (physics §4.3): prolate, oblate or a sphere.
/// Semi-axes are in m, along and across the axis of revolution. At ν = ½ it equals Oberbeck's
/// friction. For a flat disc it is 32μ(1−ν)b/(3−4ν) along the axis.
pub fn spheroid_in_infinite_medium(
    young_modulus_pa: f64,
    poisson_ratio: f64,
    semi_axis_along_m: f64,
    semi_axis_across_m: f64,
) -> AxialAndTransverse {
    let (a, b) = (semi_axis_along_m, semi_axis_across_m);
    let shear_modulus_pa = young_modulus_pa / (2.0 * (1.0 + poisson_ratio));
    let (chi_per_m, alpha_axial, alpha_transverse) = ellipsoid_integrals(a, b);
    let stiffness = |semi_axis_m: f64, alpha: f64| {
        let denominator = (3.0 - 4.0 * poisson_ratio) * chi_per_m + semi_axis_m * semi_axis_m * alpha;
        32.0 * std::f64::consts::PI * shear_modulus_pa * (1.0 - poisson_ratio) / denominator
    };
    AxialAndTransverse { axial_n_per_m: stiffness(a, alpha_axial), transverse_n_per_m: stiffness(b, alpha_transverse) }
}

/// Returns χ₀ = ∫ dλ/Δ in 1/m, and αᵢ = ∫ dλ/((aᵢ² + λ)Δ) in 1/m³ along and across the axis. Here
/// Δ = (b² + λ)√(a² + λ), and λ runs from 0 to ∞.
fn ellipsoid_integrals(a: f64, b: f64) -> (f64, f64, f64) {
    // Square of the eccentricity, negative for oblate spheroids.
    let e2 = 1.0 - (b / a) * (b / a);
    // The series are L/(2e) = Σ e²ᵏ/(2k + 1), and (L − 2e)/(2e³), which is the sum from k = 1
    // divided by e².
    let (first, second) = if e2.abs() < 0.05 {
        let series = |from: i32| (from..from + 16).map(|k| e2.powi(k - from) / f64::from(2 * k + 1)).sum::<f64>();
        (series(0), series(1))
    } else {
        let e = e2.abs().sqrt();
        // Half of L, in a form that avoids the difference 1 − e near e = 1.
        let half = if e2 > 0.0 { ((1.0 + e) * a / b).ln() } else { e.atan() };
        (half / e, (half / e - 1.0) / e2)
    };
    let alpha_axial = 2.0 * second / a.powi(3);
    (2.0 * first / a, alpha_axial, 0.5 * (2.0 / (a * b * b) - alpha_axial))
}

/// Stiffness of a rigid spheroid at the centre of a rigid sphere (physics §4.8), from the first
/// reflections at the sphere. The error is of fifth order in the ratio of the spheroid's size to
/// `outer_radius_m`: 10⁻⁵ for the paper's sizes. Lengths are in m; the semi-axes are those of
/// [`spheroid_in_infinite_medium`].
pub fn spheroid_in_container(
    young_modulus_pa: f64,
    poisson_ratio: f64,
    semi_axis_along_m: f64,
    semi_axis_across_m: f64,
    outer_radius_m: f64,
) -> AxialAndTransverse {
    let (a2, b2, nu) = (semi_axis_along_m.powi(2), semi_axis_across_m.powi(2), poisson_ratio);
    let shear_modulus_pa = young_modulus_pa / (2.0 * (1.0 + nu));
    let kappa = 1.0 / (16.0 * std::f64::consts::PI * shear_modulus_pa * (1.0 - nu));
    let uniform = -kappa / outer_radius_m * ((3.0 - 4.0 * nu) + (3.0 - 2.0 * nu) / (2.0 * (2.0 - 3.0 * nu)));
    let quadratic = kappa / (2.0 * (2.0 - 3.0 * nu) * outer_radius_m.powi(3));
    let confined = |infinite_n_per_m: f64, semi_axis2: f64| {
        let g = quadratic * ((3.0 - 2.0 * nu) * (a2 + 2.0 * b2) / 3.0 - 2.0 * (2.0 - 3.0 * nu) * semi_axis2 / 3.0);
        1.0 / (1.0 / infinite_n_per_m + uniform + 2.0 * g)
    };
    let infinite = spheroid_in_infinite_medium(young_modulus_pa, nu, semi_axis_along_m, semi_axis_across_m);
    AxialAndTransverse {
        axial_n_per_m: confined(infinite.axial_n_per_m, a2),
        transverse_n_per_m: confined(infinite.transverse_n_per_m, b2),
    }
}

fn ratios(found: AxialAndTransverse, axial: f64, transverse: f64) -> [f64; 2] {
    [found.axial_n_per_m / axial - 1.0, found.transverse_n_per_m / transverse - 1.0]
}

#[test]
fn a_round_spheroid_is_a_sphere() {
    for nu in [0.0, 0.3, 0.48, 0.5] {
        let k = sphere_in_infinite_medium_n_per_m(2.0, nu, 0.275e-3);
        for error in ratios(spheroid_in_infinite_medium(2.0, nu, 0.275e-3, 0.275e-3), k, k) {
            assert!(error.abs() < 1e-14, "{error:e}");
        }
        let k = SphereInContainer::new(nu, 0.275e-3, 10e-3).stiffness_n_per_m(2.0);
        for error in ratios(spheroid_in_container(2.0, nu, 0.275e-3, 0.275e-3, 10e-3), k, k) {
            // The expected error is 0.0275⁵ = 1.6·10⁻⁸.
            assert!(error.abs() < 1e-7, "{error:e}");
        }
    }
}

/// Checks closed forms and series of the integrals for prolate and oblate spheroids, and where one
/// form replaces the other.
#[test]
fn spheroid_integrals_are_those_of_their_definition() {
    for (a, b) in [(68.0, 7.0), (1.03, 1.0), (1.02, 1.0), (1.0, 1.0), (1.0, 1.02), (1.0, 1.03), (0.1, 1.0)] {
        // The substitution λ = t²/(1 − t)² maps [0, 1) to [0, ∞). The midpoint rule integrates over
        // t.
        let n = 200_000;
        let mut sums = [0.0; 3];
        for i in 0..n {
            let t = (f64::from(i) + 0.5) / f64::from(n);
            let lambda = (t / (1.0 - t)).powi(2);
            let d_lambda = 2.0 * t / (1.0 - t).powi(3) / f64::from(n);
            let delta = (b * b + lambda) * (a * a + lambda).sqrt();
            sums[0] += d_lambda / delta;
            sums[1] += d_lambda / (delta * (a * a + lambda));
            sums[2] += d_lambda / (delta * (b * b + lambda));
        }
        let (chi, axial, transverse) = ellipsoid_integrals(a, b);
        for (found, sum) in [chi, axial, transverse].into_iter().zip(sums) {
            assert!((found / sum - 1.0).abs() < 1e-8, "a = {a}, b = {b}: {found} against {sum}");
        }
    }
}

/// Compares with Oberbeck's friction in the form of Chwang & Wu (1975), who derive it from
/// distributed singularities, doi:10.1017/S0022112075000614.
#[test]
fn incompressible_spheroid_has_oberbecks_friction() {
    let (a, b): (f64, f64) = (68.0, 7.0);
    let e = (1.0 - b * b / (a * a)).sqrt();
    let l = ((1.0 + e) / (1.0 - e)).ln();
    let axial = 8.0 / 3.0 * e.powi(3) / (-2.0 * e + (1.0 + e * e) * l);
    let transverse = 16.0 / 3.0 * e.powi(3) / (2.0 * e + (3.0 * e * e - 1.0) * l);
    let drag = 6.0 * std::f64::consts::PI * a;
    for error in ratios(spheroid_in_infinite_medium(3.0, 0.5, a, b), drag * axial, drag * transverse) {
        assert!(error.abs() < 1e-12, "{error:e}");
    }
}

#[test]
fn flat_spheroid_is_a_disc() {
    let nu = 0.3;
    let shear_modulus_pa = 1.0 / (2.0 * (1.0 + nu));
    let axial = 32.0 * shear_modulus_pa * (1.0 - nu) / (3.0 - 4.0 * nu);
    // The difference from the disc's limit is linear in the thickness.
    let found = spheroid_in_infinite_medium(1.0, nu, 1e-6, 1.0);
    assert!((found.axial_n_per_m / axial - 1.0).abs() < 1e-5);
    // Limits of a disc at ν = ½: 16μb along the axis and 32μb/3 across it.
    let errors = ratios(spheroid_in_infinite_medium(3.0, 0.5, 1e-6, 1.0), 16.0, 32.0 / 3.0);
    assert!(errors.iter().all(|e| e.abs() < 1e-5), "{errors:?}");
}
