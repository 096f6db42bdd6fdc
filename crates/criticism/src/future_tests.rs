//! Tests of future scores against dense algebra, and against sums over a grid where a fit lies at an end of its support.

use super::*;
use crate::NoiseValues;
use crate::test_replica::{WHITE, base_fit, replica, simulated};
use record::Record;

/// Log density of a normal vector by dense algebra.
fn ln_normal(x: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
    let factor = covariance.clone().cholesky().expect("positive definite");
    let half_ln_det: f64 = factor.l_dirty().diagonal().iter().map(|l| l.ln()).sum();
    let form = x.dot(&factor.solve(x));
    -0.5 * form - half_ln_det - 0.5 * x.len() as f64 * std::f64::consts::TAU.ln()
}

/// Covariance (m²) of the noise between two rows, for the noise parameters 4 µm, 3 µm, 0.7 s, 1.2 % and 2 µm.
fn noise_covariance(record: &Record, position_m: &[f64], [a, b]: [usize; 2]) -> f64 {
    let white = if a == b { 4e-6_f64.powi(2) } else { 0.0 };
    let process = 3e-6_f64.powi(2) * (-(record.time_s[a] - record.time_s[b]).abs() / 0.7).exp();
    let same = f64::from(u8::from(record.cycle[a] == record.cycle[b]));
    white + process + same * (0.012_f64.powi(2) * position_m[a] * position_m[b] + 2e-6_f64.powi(2))
}

/// Rows with a position up to a cycle.
fn rows_until(positions_m: &[Option<f64>], record: &Record, until: u32) -> Vec<usize> {
    (0..positions_m.len()).filter(|row| positions_m[*row].is_some() && record.cycle[*row] <= until).collect()
}

/// The linearised model is one joint normal distribution of all rows. Its log score of the last cycle, by dense algebra, is the log density of all rows less that of the
/// earlier cycles. Every third row is used, so that the dense covariance stays small.
#[test]
fn scores_are_those_of_the_joint_normal() {
    let (base, fitted) = base_fit();
    let noise = NoiseValues::new([4.0, 3.0, 0.7, 0.012, 2.0]);
    let subject = simulated(&base, &fitted.theta, &noise, 5);
    let left_out: Vec<usize> = (0..subject.fitted_m.len()).filter(|row| row % 3 != 0).collect();
    let subject = subject.without_rows(&left_out);
    let fitted = Fitted { noise, ..fitted };
    let score = future_score(&subject, &base, &fitted).expect("derivatives").expect("a cycle is held out");
    let record = &subject.experiment().record;
    let both: Vec<Option<f64>> = subject.fitted_m.iter().zip(&subject.scored_m).map(|(a, b)| a.or(*b)).collect();
    let columns = columns_m(&subject, &base, &fitted.theta).expect("derivatives");
    let (precision, step) = prior(&base, &fitted.theta);
    let ln_density = |until: u32| {
        let rows = rows_until(&both, record, until);
        let covariance = DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
            let (a, b) = (rows[i], rows[j]);
            let law: f64 = (0..columns.len()).map(|k| columns[k][a] * columns[k][b] / precision[k]).sum();
            noise_covariance(record, &fitted.position_m, [a, b]) + law
        });
        let residual = DVector::from_fn(rows.len(), |i, _| {
            let row = rows[i];
            let moved: f64 = (0..columns.len()).map(|k| columns[k][row] * step[k]).sum();
            both[row].map_or(0.0, |y| y - fitted.position_m[row] - moved)
        });
        ln_normal(&residual, &covariance)
    };
    let (all, last) = (ln_density(4) - ln_density(1), ln_density(4) - ln_density(3));
    assert!((score.all - all).abs() < 1e-6 * all.abs(), "{} {all}", score.all);
    assert!((score.last - last).abs() < 1e-6 * last.abs(), "{} {last}", score.last);
}

/// If an effect is linear in the position, its score is that of a mixture of five joint normal distributions of all rows, by dense algebra. The size has normal priors
/// about its null. Their precisions form a geometric progression. It goes from a fifth of a cycle's information beside the law to the precision of the default prior.
#[test]
fn scores_with_an_effect_are_those_of_a_mixture_of_joint_normals() {
    let (base, fitted) = base_fit();
    let noise = NoiseValues::new([4.0, 3.0, 0.7, 0.012, 2.0]);
    let mut candidate = replica().extended(&["tracking-drift"]).expect("addable");
    let size = candidate.free.len() - 1;
    // Without ends the joint densities are normal; other tests cover the ends.
    candidate.free.iter_mut().for_each(|free| free.ends = [f64::NEG_INFINITY, f64::INFINITY]);
    let mut theta = candidate.embed(&base, &fitted.theta);
    theta[size] = candidate.free[size].coordinate.theta(4e-7);
    let subject = simulated(&candidate, &theta, &noise, 6);
    let left_out: Vec<usize> = (0..subject.fitted_m.len()).filter(|row| row % 4 != 0).collect();
    let subject = subject.without_rows(&left_out);
    let position_m = subject.trajectory_m(&candidate, &theta).expect("a model");
    let fitted = Fitted { theta, noise, position_m, ..fitted };
    let score = future_score(&subject, &candidate, &fitted).expect("derivatives").expect("a cycle is held out");
    let record = &subject.experiment().record;
    let both: Vec<Option<f64>> = subject.fitted_m.iter().zip(&subject.scored_m).map(|(a, b)| a.or(*b)).collect();
    let columns = columns_m(&subject, &candidate, &fitted.theta).expect("derivatives");
    let rows_until = |until: u32| rows_until(&both, record, until);
    let of_noise = |rows: &[usize]| {
        DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
            noise_covariance(record, &fitted.position_m, [rows[i], rows[j]])
        })
    };
    let of_law: Vec<(f64, f64)> = candidate.free.iter().filter_map(|free| free.prior).collect();
    assert_eq!(of_law.len(), size);
    // Information of all rows about the size beside the law: the posterior precision of the size if it has no prior.
    let rows = rows_until(4);
    let inverse = of_noise(&rows).try_inverse().expect("regular");
    let a = DMatrix::from_fn(rows.len(), size + 1, |i, k| columns[k][rows[i]]);
    let mut told = a.transpose() * inverse * &a;
    (0..size).for_each(|k| told[(k, k)] += 1.0 / of_law[k].1.powi(2));
    let visible = 1.0 / told.try_inverse().expect("regular")[(size, size)];
    let free = &candidate.free[size];
    let broadest = (0.5 * (free.quantile(0.95) - free.quantile(0.05))).powi(-2);
    let narrowest = 0.2 * visible / 4.0;
    assert!(narrowest > 10.0 * broadest, "{narrowest} {broadest}");
    let ln_density = |until: u32| {
        let rows = rows_until(until);
        let noise = of_noise(&rows);
        let each = (0..5).map(|scale| {
            let precision = narrowest * (broadest / narrowest).powf(f64::from(scale) / 4.0);
            let variance = |k: usize| if k < size { of_law[k].1.powi(2) } else { 1.0 / precision };
            let step = |k: usize| if k < size { of_law[k].0 - fitted.theta[k] } else { -fitted.theta[k] };
            let covariance = DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
                let column = |k: usize| columns[k][rows[i]] * columns[k][rows[j]] * variance(k);
                noise[(i, j)] + (0..=size).map(column).sum::<f64>()
            });
            let residual = DVector::from_fn(rows.len(), |i, _| {
                let row = rows[i];
                let moved: f64 = (0..=size).map(|k| columns[k][row] * step(k)).sum();
                both[row].map_or(0.0, |y| y - fitted.position_m[row] - moved)
            });
            ln_normal(&residual, &covariance)
        });
        let each: Vec<f64> = each.collect();
        let largest = each.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        largest + (each.iter().map(|value| (value - largest).exp()).sum::<f64>() / 5.0).ln()
    };
    let (all, last) = (ln_density(4) - ln_density(1), ln_density(4) - ln_density(3));
    assert!((score.all - all).abs() < 1e-5, "{} {all}", score.all);
    assert!((score.last - last).abs() < 1e-5, "{} {last}", score.last);
}

/// A gain standard deviation of 0, from three cycles, is raised to its floor: the last cycle is scored with 1 %.
#[test]
fn the_gain_of_a_new_cycle_is_not_known_to_be_nothing() {
    let (base, fitted) = base_fit();
    let score = |gain: f64| {
        let mut noise = WHITE;
        noise[3] = gain;
        let fitted = Fitted { noise, ..fitted.clone() };
        future_score(replica(), &base, &fitted).expect("derivatives").expect("a cycle is held out").last
    };
    assert_eq!(score(1e-5), score(0.01));
    assert!(score(0.05) < score(0.01));
}

/// ln of the sum of exponentials of values.
fn ln_sum(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let largest = values.clone().fold(f64::NEG_INFINITY, f64::max);
    largest + values.map(|value| (value - largest).exp()).sum::<f64>().ln()
}

/// ln ∫ exp(f) over an interval by the trapezoidal rule.
fn ln_area(f: &dyn Fn(f64) -> f64, [from, to]: [f64; 2], n: usize) -> f64 {
    let width = (to - from) / n as f64;
    let half = |i: usize| if i == 0 || i == n { 0.5_f64.ln() } else { 0.0 };
    ln_sum((0..=n).map(|i| f(from + width * i as f64) + half(i))) + width.ln()
}

/// The replica's law is measured one row earlier than the log says, which is a clock offset with the impossible sign. The fitted offset stays at zero, so the effect
/// gains nothing and predicts no better. Its score is that of the base, less the cost of a possible size. If the integral ignored the end of the support, the effect
/// would gain tens of nats.
#[test]
fn an_effect_at_its_end_that_the_data_pull_against_gains_nothing() {
    let (base, fitted) = base_fit();
    let law_m = &fitted.position_m;
    let earlier_m: Vec<f64> = (0..law_m.len()).map(|row| law_m[(row + 1).min(law_m.len() - 1)]).collect();
    let subject = replica().with_positions(&earlier_m);
    let fitted = subject.fit(&base, &[], crate::Search::Wide).expect("fits");
    let fitted = Fitted { noise: NoiseValues::new([4.0, 3.0, 0.7, 0.012, 2.0]), ..fitted };
    let of_base = future_score(&subject, &base, &fitted).expect("derivatives").expect("a cycle is held out");
    for effects in [&["clock-offset"][..], &["actuator-lag"], &["clock-offset", "actuator-lag"]] {
        let candidate = subject.extended(effects).expect("addable");
        let theta = candidate.embed(&base, &fitted.theta);
        let at_null = Fitted { theta, ..fitted.clone() };
        let score = future_score(&subject, &candidate, &at_null).expect("derivatives").expect("a cycle is held out");
        let (all, last) = (score.all - of_base.all, score.last - of_base.last);
        println!("{effects:?}: {all} {last}");
        assert!((-4.0..0.5).contains(&all) && (-2.0..0.5).contains(&last), "{effects:?}: {all} {last}");
    }
}

/// The score equals a sum over the size. For each size, the law's parameters are integrated by dense algebra; prior and posterior end with the support.
#[test]
fn scores_at_an_end_are_those_of_a_sum_over_the_size() {
    let (base, fitted) = base_fit();
    let law_m = &fitted.position_m;
    for (shift, subject) in [(1_usize, "earlier"), (0, "as the log says")] {
        let moved_m: Vec<f64> = (0..law_m.len()).map(|row| law_m[(row + shift).min(law_m.len() - 1)]).collect();
        let noise = NoiseValues::new([4.0, 3.0, 0.7, 0.012, 2.0]);
        let errors_m: Vec<f64> = (0..law_m.len()).map(|row| 4e-6 * (1.7 * (row * row % 97) as f64).sin()).collect();
        let measured_m: Vec<f64> = moved_m.iter().zip(&errors_m).map(|(x, error)| x + error).collect();
        let data = replica().with_positions(&measured_m);
        let left_out: Vec<usize> = (0..data.fitted_m.len()).filter(|row| row % 4 != 0).collect();
        let data = data.without_rows(&left_out);
        let candidate = data.extended(&["clock-offset"]).expect("addable");
        let size = candidate.free.len() - 1;
        let free = &candidate.free[size];
        assert_eq!((free.null, free.ends[0]), (Some(0.0), 0.0));
        let theta = candidate.embed(&base, &fitted.theta);
        let fitted = Fitted { theta, noise, ..fitted.clone() };
        let score = future_score(&data, &candidate, &fitted).expect("derivatives").expect("a cycle is held out");
        let record = &data.experiment().record;
        let both: Vec<Option<f64>> = data.fitted_m.iter().zip(&data.scored_m).map(|(a, b)| a.or(*b)).collect();
        let columns = columns_m(&data, &candidate, &fitted.theta).expect("derivatives");
        let of_law: Vec<(f64, f64)> = candidate.free.iter().filter_map(|free| free.prior).collect();
        let rows_until = |until: u32| rows_until(&both, record, until);
        // Covariance of noise and law. The ends of the law's parameters are far enough to ignore.
        let beside = |rows: &[usize]| {
            DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
                let (a, b) = (rows[i], rows[j]);
                let law: f64 = (0..size).map(|k| columns[k][a] * columns[k][b] * of_law[k].1.powi(2)).sum();
                noise_covariance(record, &fitted.position_m, [a, b]) + law
            })
        };
        // Coefficients of ln density = c₀ + c₁ δ − ½ c₂ δ².
        let parabola = |until: u32| {
            let rows = rows_until(until);
            let covariance = beside(&rows);
            let residual = DVector::from_fn(rows.len(), |i, _| {
                let law: f64 = (0..size).map(|k| columns[k][rows[i]] * (of_law[k].0 - fitted.theta[k])).sum();
                both[rows[i]].map_or(0.0, |y| y - fitted.position_m[rows[i]] - law)
            });
            let slope = DVector::from_fn(rows.len(), |i, _| columns[size][rows[i]]);
            let solved = covariance.clone().cholesky().expect("positive definite").solve(&slope);
            (ln_normal(&residual, &covariance), residual.dot(&solved), slope.dot(&solved))
        };
        let (_, pull, visible) = parabola(4);
        println!("{subject}: pulled by {} standard deviations", pull / visible.sqrt());
        let broadest = (0.5 * (free.quantile(0.95) - free.quantile(0.05))).powi(-2);
        let narrowest = (0.2 * visible / 4.0).max(broadest);
        let ln_density = |until: u32| {
            let (c0, c1, c2) = parabola(until);
            let of_scale = |scale: i32| {
                let precision = narrowest * (broadest / narrowest).powf(f64::from(scale) / 4.0);
                let prior = |x: f64| -0.5 * precision * x * x;
                let joint = |x: f64| c1 * x - 0.5 * c2 * x * x + prior(x);
                c0 + ln_area(&joint, free.ends, 400_000) - ln_area(&prior, free.ends, 400_000)
            };
            ln_sum((0..5).map(of_scale)) - 5.0_f64.ln()
        };
        let (all, last) = (ln_density(4) - ln_density(1), ln_density(4) - ln_density(3));
        // The probability of the support far in the tail is accurate to 1e-3, as its own tests show.
        assert!((score.all - all).abs() < 1e-3, "{subject}: {} {all}", score.all);
        assert!((score.last - last).abs() < 1e-3, "{subject}: {} {last}", score.last);
    }
}

/// Integrals over two sizes with ends and a parameter without ends equal sums over a grid. The data pull the sizes inwards, outwards, or outwards by hundreds of nats. In
/// some cases the columns are hardly separable.
#[test]
#[ignore = "thorough"]
fn integrals_with_several_ends_are_those_of_a_grid() {
    let reach = [[f64::NEG_INFINITY, f64::INFINITY], [0.0, 6.0], [-0.4, 3.0]];
    let (precision, step) = ([0.3, 0.5, 1.0], [0.2, 0.0, -0.1]);
    for (correlation, slope) in [
        (0.0, [1.0, 2.0, -1.0]),
        (0.9, [0.5, -6.0, 4.0]),
        (-0.9, [-2.0, -6.0, -3.0]),
        (0.98, [1.0, -80.0, -60.0]),
        (0.5, [3.0, -200.0, 30.0]),
    ] {
        let sd = [2.0, 3.0, 2.5];
        let shared = |i: usize, j: usize| if i * j == 0 { 0.1 } else { correlation };
        let told = DMatrix::from_fn(3, 3, |i, j| sd[i] * sd[j] * if i == j { 1.0 } else { shared(i, j) });
        let slope = DVector::from_row_slice(&slope);
        let found = ln_integral(&told, &slope, &precision, &step, &reach);
        // A formula integrates the first coordinate, the grid the others.
        let value = told[(0, 0)] + precision[0];
        let exponent = |x: f64, y: f64| {
            let pull = slope[0] + precision[0] * step[0] - told[(0, 1)] * x - told[(0, 2)] * y;
            let first =
                0.5 * pull * pull / value + 0.5 * (precision[0] / value).ln() - 0.5 * precision[0] * step[0] * step[0];
            let of_data = slope[1] * x + slope[2] * y
                - 0.5 * (told[(1, 1)] * x * x + 2.0 * told[(1, 2)] * x * y + told[(2, 2)] * y * y);
            first + of_data
        };
        let prior = |k: usize, x: f64| -0.5 * precision[k] * (x - step[k]).powi(2);
        let joint = |x: f64| ln_area(&|y| exponent(x, y) + prior(1, x) + prior(2, y), reach[2], 2500);
        // The integrand decays within hundredths of the end to which it is pulled.
        let near = ln_area(&joint, [0.0, 0.2], 1000);
        let expected = ln_sum([near, ln_area(&joint, [0.2, 6.0], 1200)].into_iter())
            - ln_area(&|x| prior(1, x), reach[1], 4000)
            - ln_area(&|y| prior(2, y), reach[2], 4000);
        assert!((found - expected).abs() < 2e-3, "{correlation} {slope}: {found} {expected}");
    }
}

/// A parameter without a derivative does not affect the integral, wherever its support ends.
#[test]
fn a_parameter_without_a_derivative_changes_nothing() {
    let told = DMatrix::from_row_slice(2, 2, &[4.0, 1.0, 1.0, 3.0]);
    let slope = DVector::from_row_slice(&[2.0, -9.0]);
    let reach = [[-1.0, f64::INFINITY], [0.0, 5.0]];
    let (precision, step) = ([0.3, 0.7], [0.1, 0.0]);
    let alone = ln_integral(&told, &slope, &precision, &step, &reach);
    for values in [[0.0, 2.0], [-0.1, 0.1], [f64::NEG_INFINITY, f64::INFINITY]] {
        let found = ln_integral(
            &told.clone().resize(3, 3, 0.0),
            &slope.clone().resize_vertically(3, 0.0),
            &[0.3, 0.7, 0.5],
            &[0.1, 0.0, 0.05],
            &[reach[0], reach[1], values],
        );
        assert!((found - alone).abs() < 5e-4, "{values:?}: {found} {alone}");
    }
    let (base, fitted) = base_fit();
    let zero = base.with_columns(vec![vec![0.0; fitted.position_m.len()]]);
    let score = |candidate: &Candidate, theta: Vec<f64>| {
        let fitted = Fitted { theta, ..fitted.clone() };
        future_score(replica(), candidate, &fitted).expect("derivatives").expect("a cycle is held out")
    };
    let (without, with) =
        (score(&base, fitted.theta.clone()), score(&zero, [fitted.theta.clone(), vec![0.0]].concat()));
    assert!((without.all - with.all).abs() < 1e-8 && (without.last - with.last).abs() < 1e-8, "{without:?} {with:?}");
}
