use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::contour::tests::signed_area;

fn normals(n: usize, seed: u64) -> Vec<f64> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    (0..n).map(|_| StandardNormal.sample(&mut rng)).collect()
}

fn integral(marginal: &Marginal) -> f64 {
    marginal.density.iter().sum::<f64>() * (marginal.x[1] - marginal.x[0])
}

#[test]
fn marginals_integrate_to_one_and_keep_their_moments() {
    for (n, scale) in [(200, 1.0), (10_000, 1e-9), (10_000, 1e7)] {
        let draws: Vec<f64> = normals(n, 1).into_iter().map(|z| scale * (3.0 + z)).collect();
        let marginal = marginal(&sorted(&draws), Support::default()).unwrap();
        assert!((integral(&marginal) - 1.0).abs() < 1e-4, "{n}: {}", integral(&marginal));
        let step = marginal.x[1] - marginal.x[0];
        let mean: f64 = marginal.x.iter().zip(&marginal.density).map(|(x, d)| x * d * step).sum();
        let exact = draws.iter().sum::<f64>() / n as f64;
        assert!((mean - exact).abs() < 0.01 * scale, "{mean} {exact}");
    }
}

#[test]
fn a_marginal_against_the_normal_density() {
    // For 20,000 draws, the kernel estimate at the mode has a standard deviation below 0.005. The limit of 0.03 is six standard deviations.
    let marginal = marginal(&sorted(&normals(20_000, 2)), Support::default()).unwrap();
    for (x, density) in marginal.x.iter().zip(&marginal.density) {
        let exact = (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt();
        assert!((density - exact).abs() < 0.03, "{x}: {density} {exact}");
    }
}

#[test]
fn hard_limits_are_reflected() {
    let draws: Vec<f64> = normals(20_000, 3).into_iter().map(f64::abs).collect();
    let support = Support { lower: 0.0, upper: f64::INFINITY };
    let marginal = marginal(&sorted(&draws), support).unwrap();
    assert!(marginal.x[0] > 0.0 && (integral(&marginal) - 1.0).abs() < 1e-6);
    // A half-normal distribution has the density √(2/π) = 0.798 at zero. Without reflection the estimate would be half of it. Its standard deviation is about
    // 0.012.
    assert!((marginal.density[0] - 0.798).abs() < 0.08, "{}", marginal.density[0]);
}

#[test]
fn mass_contours_enclose_the_area_of_the_normal_ellipse() {
    // The region with the fraction p of a normal distribution has the area 2π σ₁σ₂ √(1−ρ²) · (−ln(1−p)). For 40,000 draws, the quantile of the contour has an
    // error of √(p(1−p)/n)/(1−p), which is 0.7 % of the area. The limit of 6 % is more than eight such errors (false failure below 1e-15).
    let (n, sd_x, sd_y) = (40_000, 0.3, 20.0);
    for correlation in [0.0f64, 0.4, -0.95, 0.999] {
        let (z, w) = (normals(n, 4), normals(n, 5));
        let x: Vec<f64> = z.iter().map(|z| 3.0 + sd_x * z).collect();
        let mixed = |z: f64, w: f64| correlation * z + (1.0 - correlation * correlation).sqrt() * w;
        let y: Vec<f64> = z.iter().zip(&w).map(|(&z, &w)| -7.0 + sd_y * mixed(z, w)).collect();
        let joint = JointDensity::new(&x, &y, Support::default(), Support::default()).unwrap();
        for mass in [0.5, 0.9] {
            let area: f64 = joint.contour(mass).iter().map(|points| signed_area(points).abs()).sum();
            let chi_squared = -2.0 * f64::ln(1.0 - mass);
            let exact = std::f64::consts::PI * sd_x * sd_y * (1.0 - correlation * correlation).sqrt() * chi_squared;
            assert!((area / exact - 1.0).abs() < 0.06, "ρ = {correlation}, mass {mass}: {area} against {exact}");
            let threshold = joint.threshold(mass);
            let inside = x.iter().zip(&y).filter(|(x, y)| !joint.is_outside(**x, **y, threshold)).count();
            assert!((inside as f64 / n as f64 - mass).abs() < 1e-3, "{inside}");
        }
    }
}

#[test]
fn separate_modes_stay_separate() {
    let z = normals(10_000, 6);
    let x: Vec<f64> = z.iter().enumerate().map(|(i, z)| 0.2 * z + if i % 3 == 0 { 2.0 } else { -2.0 }).collect();
    let y = normals(10_000, 7);
    let marginal = marginal(&sorted(&x), Support::default()).unwrap();
    let peak = marginal.density.iter().copied().fold(0.0, f64::max);
    // Two thirds of the draws come from a normal distribution with a standard deviation of 0.2, so its peak has the height 1.33.
    assert!((peak - 1.33).abs() < 0.2, "{peak}");
    let joint = JointDensity::new(&x, &y, Support::default(), Support::default()).unwrap();
    assert_eq!(joint.contour(0.5).iter().filter(|points| points.len() > 40).count(), 2);
}

#[test]
fn constant_draws_have_no_density() {
    assert!(marginal(&[2.0; 100], Support::default()).is_none());
    assert!(JointDensity::new(&[1.0; 50], &normals(50, 8), Support::default(), Support::default()).is_none());
}

#[test]
fn an_outlier_does_not_coarsen_the_grid() {
    let mut draws = normals(5_000, 9);
    draws.push(1e6);
    let marginal = marginal(&sorted(&draws), Support::default()).unwrap();
    assert!(marginal.x[1] - marginal.x[0] < 0.05);
}
