use nalgebra::{DMatrix, DVector};

use super::*;
pub use crate::test_protocols::*;
use crate::test_subjects::noise_of;
use models::effects::Library;

/// Returns a subject with these cycles; the last cycle is scored.
pub fn subject(cycles: &[&[f64]]) -> Subject {
    subject_with(cycles, &Library::default(), &[])
}

/// Returns a subject whose positions are those of a model with given parameter values, with noise added.
pub fn measured(subject: &Subject, effects: &[&str], values: &[f64], seed: u64) -> Subject {
    let position_m = at(subject, effects, values).1.position_m;
    let noise_m = noise_of(subject, &position_m, &NOISE, seed);
    let measured_m: Vec<f64> = position_m.iter().zip(&noise_m).map(|(x, noise)| x + noise).collect();
    subject.with_positions(&measured_m)
}

/// Cholesky factor L of the covariance of the fitted rows, from the definition of the noise, and the indices of those rows.
fn dense(subject: &Subject, position_m: &[f64]) -> (DMatrix<f64>, Vec<usize>) {
    let record = &subject.experiment().record;
    let rows: Vec<usize> = (0..record.n_rows()).filter(|row| subject.fitted_m[*row].is_some()).collect();
    let [white, process, time_s, gain, offset] = NOISE[..] else { panic!("five parameters") };
    let covariance = DMatrix::from_fn(rows.len(), rows.len(), |a, b| {
        let (i, j) = (rows[a], rows[b]);
        let mut of = (1e-6 * process).powi(2) * (-(record.time_s[i] - record.time_s[j]).abs() / time_s).exp();
        if i == j {
            of += (1e-6 * white).powi(2);
        }
        if record.cycle[i] == record.cycle[j] {
            of += gain * gain * position_m[i] * position_m[j] + (1e-6 * offset).powi(2);
        }
        of
    });
    (covariance.cholesky().expect("positive definite").l(), rows)
}

fn white(l: &DMatrix<f64>, rows: &[usize], column_m: impl Fn(usize) -> f64) -> DVector<f64> {
    l.solve_lower_triangular(&DVector::from_fn(rows.len(), |i, _| column_m(rows[i]))).expect("regular")
}

/// ‖Pg‖ of a difference g (m) of two models' positions, by dense algebra: central differences of the law, covariance from its definition, priors as rows.
pub fn dense_distance(subject: &Subject, base: &(Candidate, Fitted), difference_m: &[f64]) -> f64 {
    let (candidate, fitted) = base;
    let (l, rows) = dense(subject, &fitted.position_m);
    let (n, n_law) = (rows.len(), candidate.free.len());
    let mut a = DMatrix::zeros(n + n_law, n_law);
    for k in 0..n_law {
        let moved = |by: f64| {
            let mut theta = fitted.theta.clone();
            theta[k] += by;
            subject.trajectory_m(candidate, &theta).expect("a model")
        };
        let (up, down) = (moved(1e-3), moved(-1e-3));
        a.view_mut((0, k), (n, 1)).copy_from(&white(&l, &rows, |row| (up[row] - down[row]) / 2e-3));
        a[(n + k, k)] = 1.0 / candidate.free[k].prior.expect("a law's parameter").1;
    }
    let mut g = DVector::zeros(n + n_law);
    g.rows_mut(0, n).copy_from(&white(&l, &rows, |row| difference_m[row]));
    let solved = a.clone().svd(true, true).solve(&g, 1e-14).expect("singular vectors");
    (&g - a * solved).norm()
}

#[test]
fn a_small_effect_stands_as_far_as_dense_projection_says() {
    let subject = subject(&ONE_LEVEL);
    let base = at(&subject, &[], &[]);
    // The drift is linear in the position. It reaches 6 µm over the fitted 30 s, where the law's curvature is negligible.
    let drift = at(&subject, &["tracking-drift"], &[2e-7]);
    let difference: Vec<f64> = drift.1.position_m.iter().zip(&base.1.position_m).map(|(a, b)| a - b).collect();
    let expected = dense_distance(&subject, &base, &difference);
    let found = distance(&subject, &base.0, (&drift.0, &drift.1)).expect("a distance");
    assert!(expected > 0.1, "{expected}");
    assert!((found / expected - 1.0).abs() < 0.01, "{found} against {expected}");
}

/// Minimises f by the simplex method of Nelder and Mead.
fn simplex(start: &[f64], size: f64, n_steps: usize, f: impl Fn(&[f64]) -> f64) -> (Vec<f64>, f64) {
    let mut points: Vec<(Vec<f64>, f64)> = vec![(start.to_vec(), f(start))];
    for k in 0..start.len() {
        let mut moved = start.to_vec();
        moved[k] += size;
        points.push((moved.clone(), f(&moved)));
    }
    for _ in 0..n_steps {
        points.sort_by(|a, b| a.1.total_cmp(&b.1));
        let worst = points.len() - 1;
        let centre: Vec<f64> =
            (0..start.len()).map(|k| points[..worst].iter().map(|p| p.0[k]).sum::<f64>() / worst as f64).collect();
        let towards =
            |by: f64| -> Vec<f64> { centre.iter().zip(&points[worst].0).map(|(c, w)| c + by * (c - w)).collect() };
        let tried = [1.0, 2.0, 0.5, -0.5].map(|by| {
            let point = towards(by);
            let value = f(&point);
            (point, value)
        });
        let best = tried.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)).expect("four points");
        if best.1 < points[worst].1 {
            points[worst] = best;
        } else {
            let lowest = points[0].0.clone();
            for point in &mut points[1..] {
                point.0 = point.0.iter().zip(&lowest).map(|(x, low)| 0.5 * (x + low)).collect();
                point.1 = f(&point.0);
            }
        }
    }
    points.sort_by(|a, b| a.1.total_cmp(&b.1));
    points.swap_remove(0)
}

/// The best fit of four parameters equals the optimum by another method with dense algebra, from several delays.
#[test]
fn the_best_fit_is_what_brute_force_finds() {
    let subject = subject(&[&[4.6, -4.6], &[2.3, -4.6], &[4.6, -4.6]]);
    let truth = at(&subject, &["actuator-lag"], &[0.3]);
    let other = subject.extended(&["clock-offset"]).expect("an effect");
    let found = distance(&subject, &other, (&truth.0, &truth.1)).expect("a distance");
    let (l, rows) = dense(&subject, &truth.1.position_m);
    let inverse = l.clone().try_inverse().expect("regular");
    let squared = |theta: &[f64]| -> f64 {
        let inside = theta.iter().zip(&other.free).all(|(x, free)| free.clamped(*x) == *x);
        let Some(position_m) = inside.then(|| subject.trajectory_m(&other, theta).ok()).flatten() else {
            return f64::INFINITY;
        };
        let left = DVector::from_fn(rows.len(), |i, _| truth.1.position_m[rows[i]] - position_m[rows[i]]);
        let of_law = other
            .free
            .iter()
            .enumerate()
            .filter_map(|(k, free)| free.prior.map(|(_, sd)| ((theta[k] - truth.1.theta[k]) / sd).powi(2)));
        (&inverse * left).norm_squared() + of_law.sum::<f64>()
    };
    let mut best = f64::INFINITY;
    for delay_s in [0.05, 0.25, 0.6] {
        let mut start = truth.1.theta.clone();
        start[3] = other.free[3].coordinate.theta(delay_s);
        let (mut point, mut value) = (start, f64::INFINITY);
        for size in [0.1, 0.03, 0.01] {
            (point, value) = simplex(&point, size, 120, squared);
        }
        best = best.min(value.sqrt());
    }
    assert!(best > 1.0, "{best}");
    assert!((found / best - 1.0).abs() < 0.02, "{found} against {best}");
}

#[test]
fn a_model_is_at_no_distance_from_itself_and_none_is_farther_than_the_base() {
    let subject = subject(&ONE_LEVEL);
    let base = subject.base();
    let middle = |slug: &str| {
        let candidate = subject.extended(&[slug]).expect("an effect");
        let values: Vec<f64> = candidate
            .free
            .iter()
            .filter(|free| free.effect.is_some())
            .map(|free| free.distribution.quantile(0.6))
            .collect();
        at(&subject, &[slug], &values)
    };
    let effects: Vec<&str> = subject
        .library()
        .effects()
        .iter()
        .map(|effect| effect.slug())
        .filter(|slug| subject.extended(&[slug]).is_ok())
        .collect();
    assert!(effects.len() >= 10);
    for slug in &effects {
        let truth = middle(slug);
        let to = |other: &Candidate| distance(&subject, other, (&truth.0, &truth.1)).expect("a distance");
        let whole = to(&base);
        assert!(to(&truth.0) < 1e-6, "{slug}");
        for other in &effects {
            let other = subject.extended(&[other]).expect("an effect");
            let found = to(&other);
            assert!(found <= whole * (1.0 + 1e-3) + 1e-3, "{slug} by {:?}: {found} against {whole}", other.effects);
        }
    }
}

/// The best fit comes closest to a truth: no start over sizes and times of a second retardation ends closer.
#[test]
fn no_start_comes_closer_than_the_best_fit() {
    let subject = subject(&TWO_LEVELS);
    let other = subject.extended(&["second-retardation"]).expect("an effect");
    for slug in ["actuator-lag", "softening", "instantaneous-elasticity"] {
        let candidate = subject.extended(&[slug]).expect("an effect");
        let size = candidate.free.last().expect("the effect's").distribution.quantile(0.6);
        let (candidate, fitted) = at(&subject, &[slug], &[size]);
        let found = distance(&subject, &other, (&candidate, &fitted)).expect("a distance");
        let truth =
            RivalTruth { candidate: &candidate, theta: &fitted.theta, noise: NOISE, position_m: &fitted.position_m };
        let imitation = RivalFit::new(&subject, &other, &truth);
        let null = other.embed(&candidate, &fitted.theta);
        for start in away_from_null(&other, &null).into_iter().step_by(5) {
            let closest = imitation.descend(start.clone()).map_or(f64::INFINITY, |point| point.squared.sqrt());
            assert!(found < 1.02 * closest + 0.02, "{slug}: {found} against {closest} from {start:?}");
        }
    }
}

/// The law's priors are centred at the truth, wherever it lies, and contribute their nominal cost.
#[test]
fn a_law_away_from_its_priors_is_at_no_distance_from_itself() {
    let subject = subject(&ONE_LEVEL);
    let away = |candidate: &Candidate, values: &[f64]| {
        let mut theta: Vec<f64> = candidate.free.iter().map(|free| free.quantile(0.9)).collect();
        let n_law = theta.len() - values.len();
        (n_law..theta.len()).for_each(|k| theta[k] = candidate.free[k].coordinate.theta(values[k - n_law]));
        let position_m = subject.trajectory_m(candidate, &theta).expect("a model");
        Fitted { theta, noise: NOISE, position_m, objective: 0.0, ln_likelihood: 0.0 }
    };
    let base = subject.base();
    let law = away(&base, &[]);
    assert!(distance(&subject, &base, (&base, &law)).expect("a distance") < 1e-6);
    let drifting = subject.extended(&["tracking-drift"]).expect("an effect");
    let truth = away(&drifting, &[2e-7]);
    let difference: Vec<f64> = truth.position_m.iter().zip(&law.position_m).map(|(a, b)| a - b).collect();
    let expected = dense_distance(&subject, &(base.clone(), law), &difference);
    let found = distance(&subject, &base, (&drifting, &truth)).expect("a distance");
    assert!((found / expected - 1.0).abs() < 0.01, "{found} against {expected}");
}

#[test]
fn a_second_level_separates_a_bias_from_an_asymmetry() {
    let between = |cycles: &[&[f64]]| {
        let subject = subject(cycles);
        let truth = at(&subject, &["force-bias"], &[0.05]);
        let other = subject.extended(&["force-asymmetry"]).expect("an effect");
        distance(&subject, &other, (&truth.0, &truth.1)).expect("a distance")
    };
    let (one, two) = (between(&ONE_LEVEL), between(&TWO_LEVELS));
    // (1.05, −0.95) is 1.05 (1, −0.95/1.05): an asymmetry with a law that is softer by 5 %. Only the law's priors penalise this change. The data determine the law to a
    // fraction of a per cent, which leaves hardly any alternative.
    let base = subject(&ONE_LEVEL).base();
    let of_law = base.free.iter().filter_map(|free| free.prior.map(|(_, sd)| (1.05_f64.ln() / sd).powi(2)));
    let expected = of_law.sum::<f64>().sqrt();
    assert!(one < 1.001 * expected && one > 0.9 * expected, "{one} {expected}");
    assert!(two > SEPARATED_SIGMA, "{two}");
}
