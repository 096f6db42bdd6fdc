//! Methods of evidence against closed forms, quadrature and each other.
//!
//! The standard error of importance sampling comes from thousands of weights: 6 of them fail falsely below 1e-6. That of sequential Monte Carlo is at least
//! the one of independent particles. Its particles are dependent, so 8 of them are allowed (below 1e-4 if the true error is twice as large).

use crate::density_ratio::{SavageDickey, savage_dickey};
use std::path::Path;

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, Normal};
use vitreo_uq::base::distribution::Distribution;
use vitreo_uq::base::parameter::{ParameterSpec, Support};
use vitreo_uq::posterior::prior::PriorSet;
use vitreo_uq::sampling::LogDensity;
use vitreo_uq::sampling::ensemble::RandomStream;
use vitreo_uq::sampling::evidence::importance::{self, ImportanceOptions, LARGEST_PARETO_K};
use vitreo_uq::sampling::evidence::tempering::{self, TemperingOptions};
use vitreo_uq::sampling::evidence::{Estimate, PriorCoordinates, WeightedDraws};
use vitreo_uq::sampling::optimum::{Modes, find_modes};

#[path = "../../crates/sampling/src/test_densities.rs"]
mod test_densities;
use test_densities::{Banana, Correlated, TwoBumps};

const LN_TAU: f64 = 1.837_877_066_409_345_3;

fn by_importance(density: &dyn LogDensity, starts: &[Vec<f64>]) -> Estimate {
    let modes = find_modes(density, starts).expect("finite");
    importance::evidence(density, &modes, &ImportanceOptions::default()).expect("modes")
}

fn assert_importance(found: &Estimate, exact: f64, largest_error: f64) {
    let Estimate { ln_evidence, standard_error, pareto_k, .. } = found;
    assert!((ln_evidence - exact).abs() < 6.0 * standard_error, "{ln_evidence} ± {standard_error} against {exact}");
    assert!(*standard_error < largest_error && pareto_k.is_some_and(|k| k < LARGEST_PARETO_K), "{found:?}");
}

fn assert_tempering(found: &Estimate, exact: f64, largest_error: f64) {
    let Estimate { ln_evidence, standard_error, .. } = found;
    assert!((ln_evidence - exact).abs() < 8.0 * standard_error, "{ln_evidence} ± {standard_error} against {exact}");
    assert!(*standard_error < largest_error, "{standard_error}");
}

/// ln Z = (d/2) ln 2π − ½ ln det P, over scales from 10⁻² to 10⁶.
#[test]
fn importance_sampling_gives_the_evidence_of_gaussians() {
    for dimension in [1, 3, 9] {
        let target = Correlated::new(dimension);
        let found = by_importance(&target, &[target.mean().iter().map(|m| m + 0.01).collect()]);
        let precision = DMatrix::from_row_slice(dimension, dimension, &target.precision());
        let factor = precision.cholesky().expect("positive definite");
        let ln_det = 2.0 * factor.l().diagonal().iter().map(|l| l.ln()).sum::<f64>();
        assert_importance(&found, 0.5 * dimension as f64 * LN_TAU - 0.5 * ln_det, 0.02);
    }
}

/// ∫∫ exp(−x²/2 − (y − bx²)²/2) = 2π for any bend. Two normalised bumps far apart have evidence 1.
#[test]
fn importance_sampling_gives_the_evidence_of_bent_and_of_separate_bumps() {
    let bent = by_importance(&Banana { bend: 1.5 }, &[vec![0.1, 0.1]]);
    assert_importance(&bent, LN_TAU, 0.05);
    assert!((bent.draws.mean(|x| x[0] * x[0]) - 1.0).abs() < 0.1);
    let two = TwoBumps::new(0.7, 20.0, 2.0);
    let starts: Vec<Vec<f64>> = (0..8).map(|k| vec![4.0 * f64::from(k) - 4.0, 0.5]).collect();
    let two = by_importance(&two, &starts);
    assert_importance(&two, 0.0, 0.03);
    assert!((two.draws.mean(|x| f64::from(u8::from(x[0] > 10.0))) - 0.3).abs() < 0.03);
}

/// A Gaussian cut off at x₀ > −1: mass Φ(1).
struct Cut;

impl LogDensity for Cut {
    fn dimension(&self) -> usize {
        4
    }
    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        let n = log_density.len();
        for (i, value) in log_density.iter_mut().enumerate() {
            let squares: f64 = (0..4).map(|d| points[d * n + i].powi(2)).sum();
            *value = if points[i] > -1.0 { -0.5 * squares - 2.0 * LN_TAU } else { f64::NEG_INFINITY };
        }
    }
}

#[test]
fn an_edge_of_the_support_is_kept() {
    let found = by_importance(&Cut, &[vec![0.2; 4]]);
    assert_importance(&found, Normal::standard().cdf(1.0).ln(), 0.02);
    assert!(found.draws.points.iter().zip(&found.draws.weights).all(|(x, w)| x[0] > -1.0 || *w == 0.0));
}

/// Amplitude a ≥ 0 with a half-normal prior (sd 1) and a level b ~ N(0, 2²), observed as a + b = 0.1 ± 0.1 and b = 0.3 ± 0.2 (data at an end of a's
/// support), in the sampler's coordinates ln a and b.
struct Amplitude {
    prior: PriorSet,
}

const AMPLITUDE_PRIOR: &str = r#"
amplitude = { distribution = "half_normal", sd = 1.0, unit = "1", source = "this test" }
level = { distribution = "normal", mean = 0.0, sd = 2.0, unit = "1", source = "this test" }
"#;

impl Amplitude {
    fn new() -> Self {
        let specs = [
            ParameterSpec::new("amplitude", "A", "1", Support::POSITIVE),
            ParameterSpec::new("level", "l", "1", Support::REAL),
        ];
        let prior = PriorSet::from_text(Path::new("test.toml"), AMPLITUDE_PRIOR.as_bytes(), &specs, &[], &|_, _| None);
        Self { prior: prior.expect("sound") }
    }

    fn ln_likelihood(amplitude: f64, level: f64) -> f64 {
        let normal = |x: f64, sd: f64| -0.5 * (x / sd).powi(2) - sd.ln() - 0.5 * LN_TAU;
        normal(amplitude + level - 0.1, 0.1) + normal(level - 0.3, 0.2)
    }

    /// ∫ over a ≥ 0 and b by the midpoint rule on their own scales.
    fn ln_evidence(amplitudes: Option<f64>) -> f64 {
        let gaussian = |x: f64, sd: f64| (-0.5 * (x / sd).powi(2)).exp() / (sd * std::f64::consts::TAU.sqrt());
        let over_level = |a: f64| -> f64 {
            let step = 0.002;
            let levels = (-1000..1000).map(|k| (f64::from(k) + 0.5) * step);
            levels.map(|b| Self::ln_likelihood(a, b).exp() * gaussian(b, 2.0) * step).sum()
        };
        match amplitudes {
            Some(only) => over_level(only).ln(),
            None => {
                let step = 0.002;
                let terms = (0..1000).map(|k| (f64::from(k) + 0.5) * step);
                terms.map(|a| over_level(a) * 2.0 * gaussian(a, 1.0) * step).sum::<f64>().ln()
            }
        }
    }
}

impl LogDensity for Amplitude {
    fn dimension(&self) -> usize {
        2
    }
    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        let n = log_density.len();
        for (i, value) in log_density.iter_mut().enumerate() {
            *value = Self::ln_likelihood(points[i].exp(), points[n + i]);
        }
        self.prior.add_ln_pdf_unconstrained(points, log_density);
    }
}

#[test]
fn all_three_ways_agree_with_quadrature_where_an_amplitude_is_next_to_nothing() {
    let target = Amplitude::new();
    let seen = PriorCoordinates::new(&target, target.prior.distributions());
    let exact = Amplitude::ln_evidence(None);
    let start = |amplitude: f64, level: f64| vec![seen.from_natural(0, amplitude), seen.from_natural(1, level)];
    let weighted = by_importance(&seen, &[start(0.1, 0.2), start(0.003, 0.0)]);
    assert_importance(&weighted, exact, 0.03);
    let tempered = tempering::evidence(&seen, &Modes::default(), &TemperingOptions::default()).expect("finite");
    assert_tempering(&tempered, exact, 0.06);
    let exact_ratio = exact - Amplitude::ln_evidence(Some(0.0));
    for draws in [&weighted.draws, &tempered.draws] {
        let ratio = savage_dickey(draws, |u| seen.natural(0, u[0]), 0.0, &Distribution::HalfNormal { sd: 1.0 });
        let SavageDickey::Ratio { ln_bayes_factor, standard_error } = ratio else { panic!("{ratio:?}") };
        // The error comes from ten parts; the shape of the density adds a little.
        let off = (ln_bayes_factor - exact_ratio).abs();
        assert!(off < 8.0 * standard_error + 0.05 && standard_error < 0.1, "{ratio:?} against {exact_ratio}");
    }
}

/// A standard normal prior in twelve dimensions and a likelihood exp(−(u − m)ᵀA(u − m)/2) with correlated neighbours:
/// Z = det(I + A)^(−1/2) exp(−mᵀ(I + A⁻¹)⁻¹m/2).
struct Gaussian {
    precision: DMatrix<f64>,
    centre: DVector<f64>,
}

impl Gaussian {
    fn new() -> Self {
        let precision = DMatrix::from_fn(12, 12, |i, j| match i.abs_diff(j) {
            0 => 200.0 * (1.0 + i as f64),
            1 => -95.0,
            _ => 0.0,
        });
        Self { precision, centre: DVector::from_fn(12, |i, _| 0.2 * i as f64 - 1.0) }
    }

    fn ln_evidence(&self) -> f64 {
        let one = DMatrix::<f64>::identity(12, 12);
        let spread = &one + self.precision.clone().try_inverse().expect("positive definite");
        let inverse = spread.try_inverse().expect("positive definite");
        -0.5 * (one + &self.precision).determinant().ln() - 0.5 * self.centre.dot(&(inverse * &self.centre))
    }
}

impl LogDensity for Gaussian {
    fn dimension(&self) -> usize {
        12
    }
    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        let n = log_density.len();
        for (i, value) in log_density.iter_mut().enumerate() {
            let u = DVector::from_fn(12, |d, _| points[d * n + i]);
            let away = &u - &self.centre;
            *value = -0.5 * u.norm_squared() - 6.0 * LN_TAU - 0.5 * away.dot(&(&self.precision * &away));
        }
    }
}

#[test]
fn both_ways_give_the_evidence_of_twelve_dimensions() {
    let target = Gaussian::new();
    let exact = target.ln_evidence();
    assert_importance(&by_importance(&target, &[vec![0.1; 12]]), exact, 0.02);
    let options = TemperingOptions { n_particles: 500, ..TemperingOptions::default() };
    assert_tempering(&tempering::evidence(&target, &Modes::default(), &options).expect("finite"), exact, 0.15);
}

/// Gaussian likelihoods of every coordinate; one is bimodal with equal modes ±3. Z of a coordinate with prior N(0, 5²) and likelihood N(x; m, s²) is
/// N(m; 0, 25 + s²).
struct Tempered {
    prior: PriorSet,
}

const NAMES: [&str; 5] = ["a", "b", "c", "d", "e"];

impl LogDensity for Tempered {
    fn dimension(&self) -> usize {
        NAMES.len()
    }
    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        let n = log_density.len();
        let normal = |x: f64, sd: f64| -0.5 * (x / sd).powi(2) - sd.ln() - 0.5 * LN_TAU;
        for (i, value) in log_density.iter_mut().enumerate() {
            let first = points[i];
            let two = 0.5 * normal(first - 3.0, 0.1).exp() + 0.5 * normal(first + 3.0, 0.1).exp();
            *value = two.ln() + (1..NAMES.len()).map(|d| normal(points[d * n + i] - d as f64, 0.1)).sum::<f64>();
        }
        self.prior.add_ln_pdf_unconstrained(points, log_density);
    }
}

#[test]
fn both_ways_give_the_evidence_of_two_modes_and_do_not_depend_on_threads() {
    let specs = NAMES.map(|name| ParameterSpec::new(name, "", "1", Support::REAL));
    let table = |name: &&str| {
        format!(
            "{name} = {{ distribution = \"normal\", mean = 0.0, sd = 5.0, unit = \"1\", source = \"this test\" }}\n"
        )
    };
    let text: String = NAMES.iter().map(table).collect();
    let prior = PriorSet::from_text(Path::new("test.toml"), text.as_bytes(), &specs, &[], &|_, _| None);
    let target = Tempered { prior: prior.expect("sound") };
    let seen = PriorCoordinates::new(&target, target.prior.distributions());
    let options = TemperingOptions { n_particles: 500, ..TemperingOptions::default() };
    let found = tempering::evidence(&seen, &Modes::default(), &options).expect("finite");
    let variance: f64 = 25.01;
    let exact: f64 = [3.0_f64, 1.0, 2.0, 3.0, 4.0]
        .iter()
        .map(|m| -0.5 * m * m / variance - 0.5 * variance.ln() - 0.5 * LN_TAU)
        .sum();
    assert_tempering(&found, exact, 0.15);
    let starts: Vec<Vec<f64>> =
        [-3.0, 3.0].map(|a| (0..5).map(|d| seen.from_natural(d, if d == 0 { a } else { d as f64 })).collect()).to_vec();
    assert_importance(&by_importance(&seen, &starts), exact, 0.03);
    // The weights of modes fluctuate, as 500 particles are resampled about sixty times: 0.2 is about four errors of three replicates.
    assert!((found.draws.mean(|x| f64::from(u8::from(x[0] > 0.0))) - 0.5).abs() < 0.2);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let alone = pool.install(|| tempering::evidence(&seen, &Modes::default(), &options)).expect("finite");
    assert_eq!(alone, found);
}

/// Normal draws: the density at a null inside, at three errors of 0.02, and at one out of reach.
#[test]
fn the_density_ratio_is_exact_for_a_gaussian_and_refuses_what_it_cannot_see() {
    let mut stream = RandomStream::new(6, 0);
    let points: Vec<Vec<f64>> = (0..20_000).map(|_| vec![0.3 + 0.2 * stream.normal()]).collect();
    let draws = WeightedDraws::new(points, &[0.0; 20_000]);
    let prior = Distribution::Normal { mean: 0.0, sd: 2.0 };
    let ratio = savage_dickey(&draws, |x| x[0], 0.0, &prior);
    let exact = (0.2_f64 / 2.0).ln() + 0.5 * 1.5 * 1.5;
    let SavageDickey::Ratio { ln_bayes_factor, standard_error } = ratio else { panic!("{ratio:?}") };
    assert!((ln_bayes_factor - exact).abs() < 8.0 * standard_error && standard_error < 0.03, "{ratio:?} {exact}");
    let refusal = |null: f64, prior: &Distribution| match savage_dickey(&draws, |x| x[0], null, prior) {
        SavageDickey::NotApplicable(reason) => reason,
        other => panic!("{other:?}"),
    };
    assert!(refusal(-1.5, &prior).contains("too plain"));
    assert!(refusal(0.0, &Distribution::LogNormal { median: 1.0, log_sd: 1.0 }).contains("prior's density"));
}
