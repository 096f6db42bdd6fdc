//! Tests of whitening, marginal standard deviations and simulated noise against dense algebra and the likelihood.

use super::super::NoiseLikelihood;
use super::super::dense_for_tests::{
    POINTS, TestRecord, covariance_m2, gaussian_models, ln_density, model, parameters,
};
use super::*;
use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

fn likelihood(model: NoiseModel, record: &TestRecord) -> NoiseLikelihood {
    NoiseLikelihood::new(model, &record.time_s, &record.cycle, &record.observed_m)
}

#[test]
fn whitened_residuals_have_the_mahalanobis_distance() {
    let record = TestRecord::irregular(120);
    let rows = record.observed_rows();
    let residual_m: Vec<f64> = rows.iter().map(|row| record.residual_m()[*row]).collect();
    for model in gaussian_models() {
        for point in POINTS {
            let parameters = parameters(model, point);
            let (_, dense) = ln_density(&covariance_m2(model, &record, &rows, &parameters), &residual_m);
            let likelihood = likelihood(model, &record);
            let columns = [vec![1.0; 120], record.residual_m()];
            let white = likelihood.whiten(&columns, &record.position_m, &parameters);
            let distance2: f64 = white[1].iter().map(|w| w * w).sum();
            assert!((distance2 / dense - 1.0).abs() < 1e-9, "{parameters:?}: {distance2} against {dense}");
        }
    }
}

/// Whitening the unit columns gives the matrix L⁻¹. It is lower triangular, turns the covariance into the identity and gives the likelihood's determinant.
#[test]
fn whitened_unit_columns_are_the_inverse_factor() {
    let record = TestRecord::irregular(50);
    let rows = record.observed_rows();
    let n = rows.len();
    let units: Vec<Vec<f64>> =
        rows.iter().map(|row| (0..50).map(|i| if i == *row { 1.0 } else { 0.0 }).collect()).collect();
    for model in gaussian_models() {
        let parameters = parameters(model, POINTS[0]);
        let likelihood = likelihood(model, &record);
        let white = likelihood.whiten(&units, &record.position_m, &parameters);
        let inverse = DMatrix::from_fn(n, n, |i, j| white[j][i]);
        let identity = &inverse * covariance_m2(model, &record, &rows, &parameters) * inverse.transpose();
        assert!((identity - DMatrix::identity(n, n)).amax() < 1e-11);
        assert_eq!(inverse.upper_triangle(), DMatrix::from_diagonal(&inverse.diagonal()));
        let distance2: f64 =
            likelihood.whiten(&[record.residual_m()], &record.position_m, &parameters)[0].iter().map(|w| w * w).sum();
        let ln_det: f64 = -2.0 * inverse.diagonal().iter().map(|l| l.ln()).sum::<f64>();
        let ln_density = -0.5 * (distance2 + ln_det + n as f64 * (2.0 * std::f64::consts::PI).ln());
        let direct = likelihood.ln_likelihood(&record.position_m, &parameters);
        assert!((ln_density / direct - 1.0).abs() < 1e-11, "{ln_density} against {direct}");
    }
}

#[test]
fn students_variance_scales_the_whitening() {
    let record = TestRecord::irregular(50);
    let (gaussian, student) = (model(&["white", "ou", "gain"]), model(&["white", "ou", "gain", "student"]));
    let columns = [record.residual_m()];
    let by = |model| likelihood(model, &record).whiten(&columns, &record.position_m, &parameters(model, POINTS[0]));
    for (w, g) in by(student)[0].iter().zip(&by(gaussian)[0]) {
        assert!((w - g * (4.0_f64 / 6.0).sqrt()).abs() < 1e-12 * g.abs());
    }
}

#[test]
fn marginal_sds_are_the_dense_diagonal() {
    let record = TestRecord::irregular(60);
    let rows: Vec<usize> = (0..60).collect();
    for model in gaussian_models() {
        for point in POINTS {
            let parameters = parameters(model, point);
            let dense = covariance_m2(model, &record, &rows, &parameters);
            let sd_m = model.marginal_sd_m(&record.time_s, &record.cycle, &record.position_m, &parameters);
            for (row, sd) in sd_m.iter().enumerate() {
                assert!((sd * sd / dense[(row, row)] - 1.0).abs() < 1e-12);
            }
        }
    }
}

/// For many degrees of freedom ν, the Student-t standard deviations tend to the Gaussian ones. At the first row, which has no past, the variance is ν/(ν − 2) times the
/// Gaussian variance.
#[test]
fn students_marginal_sds_tend_to_the_gaussian_ones() {
    let record = TestRecord::irregular(60);
    let (gaussian, student) = (model(&["white", "ou", "gain"]), model(&["white", "ou", "gain", "student"]));
    let sd_m = |model: NoiseModel, dof: f64| {
        let mut point = POINTS[0];
        point[5] = dof;
        model.marginal_sd_m(&record.time_s, &record.cycle, &record.position_m, &parameters(model, point))
    };
    let exact = sd_m(gaussian, 9.0);
    for (many, exact) in sd_m(student, 1e9).iter().zip(&exact) {
        assert!((many / exact - 1.0).abs() < 1e-8);
    }
    assert!((sd_m(student, 9.0)[0].powi(2) / exact[0].powi(2) - 9.0 / 7.0).abs() < 1e-12);
    assert!(sd_m(student, 2.0).iter().all(|sd| sd.is_infinite()));
}

/// Compares the sample covariance of N = 20,000 draws of 14 rows with the exact covariance Σ. The standard error of an entry is √((ΣᵢᵢΣⱼⱼ + Σᵢⱼ²)/N). The limit is 6.2
/// standard errors for each of 105 entries of 4 models. It fails by chance with a probability of 420 · 6·10⁻¹⁰ = 2·10⁻⁷.
#[test]
fn simulated_noise_has_the_dense_covariance() {
    let record = TestRecord::irregular(14);
    let rows: Vec<usize> = (0..14).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(31);
    let n_draws = 20_000;
    for model in gaussian_models() {
        let parameters = parameters(model, POINTS[0]);
        let exact = covariance_m2(model, &record, &rows, &parameters);
        let mut sum = DMatrix::zeros(14, 14);
        for _ in 0..n_draws {
            let draw = model.simulate_m(&record.time_s, &record.cycle, &record.position_m, &parameters, &mut rng);
            let draw = nalgebra::DVector::from_vec(draw);
            sum += &draw * draw.transpose();
        }
        for (i, j) in (0..14).flat_map(|i| (0..=i).map(move |j| (i, j))) {
            let standard_error = ((exact[(i, i)] * exact[(j, j)] + exact[(i, j)].powi(2)) / f64::from(n_draws)).sqrt();
            let error = (sum[(i, j)] / f64::from(n_draws) - exact[(i, j)]) / standard_error;
            assert!(error.abs() < 6.2, "{:?} at {i}, {j}: {error} standard errors", model.names());
        }
    }
}

/// If draws have the likelihood's density p, the expectation of q/p is 1 for any other density q. Here q is p at a smaller scale, so that the ratios are bounded. The
/// mean ratio of 20,000 draws lies within 5.5 standard errors of 1, with a false failure in 4·10⁻⁸ of all cases. A sampler whose white noise and process are 10 % too
/// large must fail.
#[test]
fn simulated_noise_has_the_likelihoods_density() {
    let record = TestRecord::irregular(9);
    let model = model(&["white", "ou", "gain", "student"]);
    let truth = parameters(model, [4.0, 3.0, 0.5, 0.03, 5.0, 5.0]);
    let mut other = truth.clone();
    // Near the predictions the ratio q/p is 0.8⁻⁹, and every innovation influences it.
    for index in [0, 1, 3, 4] {
        other[index] *= 0.8;
    }
    let n_draws = 20_000;
    let z_score = |drawn_at: &[f64], seed: u64| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..n_draws {
            let noise_m = model.simulate_m(&record.time_s, &record.cycle, &record.position_m, drawn_at, &mut rng);
            let observed: Vec<Option<f64>> =
                record.position_m.iter().zip(&noise_m).map(|(x, noise)| Some(x + noise)).collect();
            let likelihood = NoiseLikelihood::new(model, &record.time_s, &record.cycle, &observed);
            let ln = |point: &[f64]| likelihood.ln_likelihood(&record.position_m, point);
            let ratio = (ln(&other) - ln(&truth)).exp();
            sum += ratio;
            squares += ratio * ratio;
        }
        let n = f64::from(n_draws);
        let mean = sum / n;
        (mean - 1.0) / ((squares / n - mean * mean) / n).sqrt()
    };
    let z = z_score(&truth, 5);
    assert!(z.abs() < 5.5, "{z} standard errors");
    let mut wrong = truth.clone();
    wrong[0] *= 1.1;
    wrong[1] *= 1.1;
    assert!(z_score(&wrong, 6).abs() > 5.5, "the comparison must see a wrong sampler");
}

/// Kolmogorov–Smirnov test of n = 10,000 draws, whose largest distance between distribution functions must be below 2.75/√n. Each test fails by chance with a
/// probability of 5·10⁻⁷.
#[test]
fn polar_draws_are_students_t() {
    use statrs::distribution::{ContinuousCDF, StudentsT};
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    for dof in [2.0, 4.5, 60.0] {
        let reference = StudentsT::new(0.0, 1.0, dof).expect("a distribution");
        let n = 10_000;
        let mut p: Vec<f64> = (0..n).map(|_| reference.cdf(student_t(dof, &mut rng))).collect();
        p.sort_by(f64::total_cmp);
        let distance =
            p.iter().enumerate().map(|(i, p)| (p - (i as f64 + 0.5) / f64::from(n)).abs()).fold(0.0, f64::max);
        assert!(distance < 2.75 / f64::from(n).sqrt(), "{dof}: {distance}");
    }
}

#[test]
fn outside_the_support_is_nan() {
    let record = TestRecord::irregular(10);
    let model = model(&["white", "student"]);
    let nan = |values: &[f64]| values.iter().all(|value| value.is_nan());
    let parameters = [4.0, 1.0];
    let white = likelihood(model, &record).whiten(&[record.residual_m()], &record.position_m, &parameters);
    assert!(nan(&white[0]));
    assert!(nan(&model.marginal_sd_m(&record.time_s, &record.cycle, &record.position_m, &parameters)));
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    assert!(nan(&model.simulate_m(&record.time_s, &record.cycle, &record.position_m, &parameters, &mut rng)));
}
