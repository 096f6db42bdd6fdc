//! Tests of the likelihood against dense algebra, closed forms and quadrature. Evaluation in lanes is compared with single points.

use super::super::dense_for_tests::{
    POINTS, TestRecord, covariance_m2, gaussian_models, ln_density, model, parameters,
};
use super::*;
use statrs::distribution::{Continuous, StudentsT};

fn likelihood(model: NoiseModel, record: &TestRecord) -> NoiseLikelihood {
    NoiseLikelihood::new(model, &record.time_s, &record.cycle, &record.observed_m)
}

fn every_model() -> Vec<NoiseModel> {
    let names = |mask: usize| {
        let chosen = ["ou", "gain", "student"].into_iter().enumerate().filter(|(bit, _)| mask >> bit & 1 == 1);
        std::iter::once("white").chain(chosen.map(|(_, name)| name)).collect::<Vec<_>>()
    };
    (0..8).map(|mask| model(&names(mask))).collect()
}

#[test]
fn gaussian_terms_equal_dense_algebra() {
    let record = TestRecord::irregular(120);
    let rows = record.observed_rows();
    let residual_m: Vec<f64> = rows.iter().map(|row| record.residual_m()[*row]).collect();
    for model in gaussian_models() {
        for point in POINTS {
            let parameters = parameters(model, point);
            let (dense, _) = ln_density(&covariance_m2(model, &record, &rows, &parameters), &residual_m);
            let filtered = likelihood(model, &record).ln_likelihood(&record.position_m, &parameters);
            let error = (filtered / dense - 1.0).abs();
            assert!(error < 1e-10, "{:?} at {parameters:?}: {filtered} against {dense}", model.names());
        }
    }
}

/// The variance of the offset is 10¹⁶ times the variance of the noise, so that dense algebra loses all digits. The reference is the closed form for an offset alone.
#[test]
fn an_offset_that_dwarfs_the_noise_keeps_its_digits() {
    let n = 60;
    let (sd_m, offset_sd_m) = (1e-6, 1e2);
    let residual_m: Vec<f64> = (0..n).map(|i| 1e-6 * (7.0 * i as f64).sin()).collect();
    let mean_m = residual_m.iter().sum::<f64>() / n as f64;
    let spread_m2: f64 = residual_m.iter().map(|r| (r - mean_m).powi(2)).sum();
    let variance_m2 = sd_m * sd_m + n as f64 * offset_sd_m * offset_sd_m;
    let quadratic = spread_m2 / (sd_m * sd_m) + n as f64 * mean_m * mean_m / variance_m2;
    let ln_det = (n - 1) as f64 * (sd_m * sd_m).ln() + variance_m2.ln();
    let exact = -0.5 * (quadratic + ln_det + n as f64 * (2.0 * std::f64::consts::PI).ln());
    let time_s: Vec<f64> = (0..n).map(|i| i as f64).collect();
    let observed_m: Vec<Option<f64>> = residual_m.iter().map(|r| Some(*r)).collect();
    let record = NoiseLikelihood::new(model(&["white", "ou", "gain"]), &time_s, &vec![1; n], &observed_m);
    let filtered = record.ln_likelihood(&vec![0.0; n], &[1.0, 0.0, 1.0, 0.5, 1e8]);
    assert!((filtered / exact - 1.0).abs() < 1e-12, "{filtered} against {exact}");
}

/// Gain and offset are 3,000 times the noise, for which dense algebra in f64 has an error of 2·10⁻¹⁰. The reference is dense algebra with 60 digits.
#[test]
fn a_gain_that_dwarfs_the_noise_keeps_its_digits() {
    let record = TestRecord::irregular(120);
    let filtered = likelihood(model(&["white", "gain"]), &record).ln_likelihood(&record.position_m, &[0.01, 0.03, 8.0]);
    assert!((filtered / -150_302_383.295_313_66 - 1.0).abs() < 1e-12, "{filtered}");
}

#[test]
fn white_noise_alone_is_the_sum_of_squares() {
    let record = TestRecord::irregular(200);
    let n = record.observed_rows().len() as f64;
    let sum_m2: f64 = record.residual_m().iter().map(|r| r * r).sum();
    let sd_m = 3.7e-6_f64;
    let exact = -n * (sd_m.ln() + 0.5 * (2.0 * std::f64::consts::PI).ln()) - 0.5 * sum_m2 / (sd_m * sd_m);
    let filtered = likelihood(model(&["white"]), &record).ln_likelihood(&record.position_m, &[3.7]);
    assert!((filtered / exact - 1.0).abs() < 1e-13, "{filtered} against {exact}");
}

#[test]
fn student_alone_is_independent_t() {
    let record = TestRecord::irregular(200);
    let residual_m = record.residual_m();
    for dof in [2.0, 2.5, 7.0, 40.0, 300.0] {
        let reference = StudentsT::new(0.0, 3.7e-6, dof).expect("a distribution");
        let exact: f64 = record.observed_rows().iter().map(|row| reference.ln_pdf(residual_m[*row])).sum();
        let filtered = likelihood(model(&["white", "student"]), &record).ln_likelihood(&record.position_m, &[3.7, dof]);
        assert!((filtered / exact - 1.0).abs() < 1e-12, "{dof}: {filtered} against {exact}");
    }
}

/// Compares the likelihood with the formulas of the noise module, for two observations of the process. The first observation is an outlier.
#[test]
fn an_outlier_moves_the_process_by_its_score() {
    let (sd_m, ou_sd_m, time_s, dof) = (2e-6_f64, 3e-6_f64, 0.4_f64, 5.0);
    let (first_m, second_m, step_s) = (4e-5, 1e-6, 0.1);
    let decay = (-step_s / time_s).exp();
    let variance_1 = sd_m.powi(2) + ou_sd_m.powi(2);
    let weight = (dof + 1.0) / (dof + first_m * first_m / variance_1);
    let mean_2 = decay * ou_sd_m.powi(2) / variance_1 * weight * first_m;
    let variance_2 = variance_1 - decay.powi(2) * ou_sd_m.powi(4) / variance_1;
    let t = |mean: f64, variance: f64, y: f64| StudentsT::new(mean, variance.sqrt(), dof).expect("a t").ln_pdf(y);
    let exact = t(0.0, variance_1, first_m) + t(mean_2, variance_2, second_m);
    let observed = [Some(first_m), None, Some(second_m)];
    let model = model(&["white", "ou", "student"]);
    let record = NoiseLikelihood::new(model, &[0.0, 0.03, step_s], &[1, 1, 2], &observed);
    let filtered = record.ln_likelihood(&[0.0; 3], &[2.0, 3.0, time_s, dof]);
    assert!((filtered / exact - 1.0).abs() < 1e-12, "{filtered} against {exact}");
}

/// The difference between Student-t and Gaussian likelihoods is of order 1/ν, for ν degrees of freedom. It decreases by a factor of 100 from ν = 10⁵ to 10⁷, and by 10⁵
/// more to ν = 10¹², where lost digits would be visible.
#[test]
fn many_degrees_of_freedom_are_gaussian() {
    let record = TestRecord::irregular(120);
    for names in [&["white"][..], &["white", "ou"], &["white", "gain"], &["white", "ou", "gain"]] {
        let (gaussian, student) = (model(names), model(&[names, &["student"]].concat()));
        let point = parameters(gaussian, POINTS[0]);
        let exact = likelihood(gaussian, &record).ln_likelihood(&record.position_m, &point);
        let difference = |dof: f64| {
            let point = [&point[..], &[dof]].concat();
            likelihood(student, &record).ln_likelihood(&record.position_m, &point) - exact
        };
        let ratio = difference(1e5) / difference(1e7);
        assert!((ratio - 100.0).abs() < 1.0, "{names:?}: {ratio}");
        let rest = difference(1e12) - 1e-5 * difference(1e7);
        assert!(rest.abs() < 1e-9 && difference(1e12).abs() < 1e-6, "{names:?}: {rest}");
    }
}

/// Integrates the joint density of three observations by the trapezoidal rule in arsinh y. Also compares the standard deviation of the last observation with the result
/// of `marginal_sd_m`.
#[test]
fn the_joint_density_of_every_model_integrates_to_one() {
    let (time_s, cycle, position_m) = ([0.0, 0.2, 0.5], [1, 1, 1], [3e-5, -1e-5, 4e-5]);
    let (n, width_m, step) = (61, 4e-6, 0.3);
    let node = |i: usize| {
        let u = step * (i as f64 - 0.5 * (n - 1) as f64);
        (width_m * u.sinh(), step * width_m * u.cosh())
    };
    for model in every_model() {
        let point = parameters(model, [2.0, 3.0, 0.4, 0.06, 2.5, 9.0]);
        let (mut total, mut variance_m2) = (0.0, 0.0);
        for (i, j) in (0..n * n).map(|k| (k / n, k % n)) {
            let ((a, weight_a), (b, weight_b)) = (node(i), node(j));
            for k in 0..n {
                let (c, weight_c) = node(k);
                let observed = [Some(position_m[0] + a), Some(position_m[1] + b), Some(position_m[2] + c)];
                let record = NoiseLikelihood::new(model, &time_s, &cycle, &observed);
                let mass = record.ln_likelihood(&position_m, &point).exp() * weight_a * weight_b * weight_c;
                total += mass;
                variance_m2 += mass * c * c;
            }
        }
        assert!((total - 1.0).abs() < 1e-5, "{:?}: {total}", model.names());
        let sd_m = model.marginal_sd_m(&time_s, &cycle, &position_m, &point)[2];
        assert!((variance_m2.sqrt() / sd_m - 1.0).abs() < 1e-4, "{:?}: {variance_m2} {sd_m}", model.names());
    }
}

/// A lane equals the single point except for rounding, and is bitwise independent of the other lanes.
#[test]
fn lanes_are_independent_points() {
    let record = TestRecord::irregular(150);
    for model in every_model() {
        let likelihood = likelihood(model, &record);
        let n_parameters = model.parameters().len();
        let scaled = |lane: usize| 1.0 + 1e-3 * lane as f64;
        // Lane k holds point (k + turn) mod 8; the last point is outside the support.
        let evaluate = |turn: usize| {
            let point = |lane: usize| (lane + turn) % LANES;
            let mut points: Vec<Vec<f64>> =
                POINTS.iter().map(|p| parameters(model, *p)).chain([parameters(model, [-1.0; 6])]).collect();
            points.rotate_left(turn);
            let lanes: Vec<[f64; LANES]> =
                (0..n_parameters).map(|p| std::array::from_fn(|lane| points[lane][p])).collect();
            let position_m: Vec<[f64; LANES]> =
                record.position_m.iter().map(|x| std::array::from_fn(|lane| x * scaled(point(lane)))).collect();
            let mut out = [0.0; LANES];
            likelihood.ln_likelihood_lanes(&position_m, &lanes, &mut out);
            out.rotate_right(turn);
            out
        };
        let out = evaluate(0);
        for (lane, point) in POINTS.iter().enumerate() {
            let position_m: Vec<f64> = record.position_m.iter().map(|x| x * scaled(lane)).collect();
            let alone = likelihood.ln_likelihood(&position_m, &parameters(model, *point));
            assert!((out[lane] / alone - 1.0).abs() < 1e-12, "{:?}: {} {alone}", model.names(), out[lane]);
        }
        assert_eq!(out[LANES - 1], f64::NEG_INFINITY);
        for turn in 1..LANES {
            assert_eq!(out.map(f64::to_bits), evaluate(turn).map(f64::to_bits), "{:?}", model.names());
        }
    }
}

/// For eight or sixteen points at once, a common trajectory gives bitwise the results of equal trajectories in all lanes.
#[test]
fn wide_passes_have_the_bits_of_narrow_ones() {
    let record = TestRecord::irregular(150);
    let shared: Vec<SharedPosition> = record.position_m.iter().copied().map(SharedPosition).collect();
    let lanes_m: Vec<[f64; LANES]> = record.position_m.iter().map(|x| [*x; LANES]).collect();
    for model in every_model() {
        let likelihood = likelihood(model, &record);
        let point = |k: usize| parameters(model, POINTS[k % POINTS.len()]);
        let points: Vec<Vec<f64>> =
            (0..2 * LANES).map(|k| point(k).iter().map(|value| value * (1.0 + 0.01 * k as f64)).collect()).collect();
        let wide: Vec<[f64; 2 * LANES]> =
            (0..points[0].len()).map(|p| std::array::from_fn(|lane| points[lane][p])).collect();
        let mut of_wide = [0.0; 2 * LANES];
        likelihood.ln_likelihood_shared(&shared, &wide, &mut of_wide);
        for (half, of_wide) in of_wide.chunks(LANES).enumerate() {
            let narrow: Vec<[f64; LANES]> =
                wide.iter().map(|all| std::array::from_fn(|lane| all[half * LANES + lane])).collect();
            let (mut of_shared, mut of_lanes) = ([0.0; LANES], [0.0; LANES]);
            likelihood.ln_likelihood_shared(&shared, &narrow, &mut of_shared);
            likelihood.ln_likelihood_lanes(&lanes_m, &narrow, &mut of_lanes);
            let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<u64>>();
            assert_eq!(bits(of_wide), bits(&of_shared), "{:?}", model.names());
            assert_eq!(bits(of_wide), bits(&of_lanes), "{:?}", model.names());
        }
    }
}

#[test]
fn outside_the_support_is_minus_infinity_and_lost_positions_are_nan() {
    let record = TestRecord::irregular(40);
    let model = model(&["white", "ou", "gain", "student"]);
    let likelihood = likelihood(model, &record);
    let sound = parameters(model, POINTS[0]);
    assert!(likelihood.ln_likelihood(&record.position_m, &sound).is_finite());
    for (index, value) in [(0, 0.0), (0, -1.0), (1, -1.0), (2, f64::NAN), (3, 1e60), (4, f64::INFINITY), (5, 1.9)] {
        let mut point = sound.clone();
        point[index] = value;
        assert_eq!(likelihood.ln_likelihood(&record.position_m, &point), f64::NEG_INFINITY);
    }
    let mut position_m = record.position_m.clone();
    position_m[20] = f64::NAN;
    assert!(record.observed_m[20].is_some() && likelihood.ln_likelihood(&position_m, &sound).is_nan());
}

#[test]
fn the_constant_of_the_t_is_a_ratio_of_gamma_functions() {
    use statrs::function::gamma::ln_gamma;
    for dof in [2.0, 2.1, 3.0, 5.7, 20.0, 150.0] {
        let exact = ln_gamma(0.5 * (dof + 1.0)) - ln_gamma(0.5 * dof) - 0.5 * (0.5 * dof).ln();
        assert!((ln_student_constant(dof) - exact).abs() < 1e-12, "{dof}: {} {exact}", ln_student_constant(dof));
    }
    assert!((ln_student_constant(1e9) + 0.25e-9).abs() < 1e-15);
}
