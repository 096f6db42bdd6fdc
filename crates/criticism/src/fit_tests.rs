//! Tests of the fits of candidates.

use super::*;
use crate::refit::Refitted;
use crate::test_replica::{WHITE, base_fit, replica, replica_with, simulated, simulated_in};
use models::effects::{Effect, Library};
use posterior::fit;
use posterior::monitor::SilentMonitor;

/// Under fixed white noise and very weak priors, the base fit equals the least-squares estimate of the command `fit`. That command has its own search and analytic
/// derivatives.
#[test]
fn the_base_fit_is_the_least_squares_estimate() {
    let (base, fitted) = base_fit();
    let mut specification = replica().specification().clone();
    specification.noise = vec!["white".into()];
    let experiment = replica().experiment().clone();
    let problem = replica().problem().with_experiment(experiment, specification, replica().library()).expect("sound");
    let estimate = fit::run(&problem, None, &SilentMonitor).expect("fits");
    for (ours, theirs) in base.parameters(&fitted.theta).iter().zip(&estimate.model_parameters) {
        assert!((ours / theirs - 1.0).abs() < 2e-3, "{ours} {theirs}");
    }
}

/// The objective is the sum of the log likelihood and the log priors, each computed separately.
#[test]
fn the_objective_is_likelihood_plus_priors() {
    let (base, fitted) = base_fit();
    let forward = replica().trajectory_m(&base, &fitted.theta).expect("a model");
    let likelihood = replica().fitted.ln_likelihood(&forward, &fitted.noise);
    let noise = replica().noise_prior().ln_density(&fitted.noise.map(f64::ln));
    let sum = likelihood + base.ln_prior(&fitted.theta) + noise;
    assert!((fitted.objective - sum).abs() < 1e-6, "{} {sum}", fitted.objective);
    assert!((fitted.ln_likelihood - likelihood).abs() < 1e-6);
}

/// At its null, an effect has the very value that its stage skips: an order of a springpot one rounding above 1 is another law. No coordinate leaves the ends by rounding.
#[test]
fn a_null_is_exact() {
    for effect in replica().library().effects() {
        let Ok(candidate) = replica().extended(&[effect.slug()]) else { continue };
        for free in &candidate.free {
            let parameter = effect.parameters().iter().find(|parameter| parameter.spec.name == free.name);
            let null = parameter.and_then(|parameter| (parameter.null)(&replica().experiment().scales()));
            assert_eq!(free.null.map(|theta| free.value(theta)), null, "{}", free.name);
            let Some(support) = parameter.map(|parameter| parameter.spec.support) else { continue };
            assert!(
                free.ends.iter().all(|end| (support.lower..=support.upper).contains(&free.value(*end))),
                "{}",
                free.name
            );
        }
    }
}

/// Every linear effect fits no worse than the base. Every second compatible pair of neighbours in the library fits no worse than each of its effects.
#[test]
fn a_larger_model_never_fits_worse() {
    assert_no_worse(false);
}

/// Every effect, and every pair, fits no worse than the models that it contains.
#[test]
#[ignore = "campaigns/long-tests"]
fn no_larger_model_fits_worse() {
    assert_no_worse(true);
}

fn assert_no_worse(is_whole: bool) {
    let (candidate, _) = base_fit();
    let whole = is_whole.then(|| replica_with(&Library::default()));
    let data = whole.as_ref().unwrap_or_else(|| replica());
    let base = Refitted::new(data, candidate, &[], Search::Wide).expect("fits");
    // Large displacements can be added only after a search has learnt them; tests/critique/large.rs fits them.
    let effects = data.library().effects().iter();
    let slugs: Vec<&str> = effects.map(|effect| effect.slug()).filter(|slug| *slug != "large-displacement").collect();
    let single = |slug: &&str| {
        Refitted::new(data, data.extended(&[slug]).expect("addable"), &[&base], Search::Wide).expect("fits")
    };
    let singles: Vec<Refitted> = slugs.iter().map(single).collect();
    for (i, a) in singles.iter().enumerate() {
        assert!(a.fitted.objective >= base.fitted.objective - 1e-9, "{}", slugs[i]);
        for (j, b) in singles.iter().enumerate().skip(i + 1) {
            if !is_whole && (j > i + 1 || i % 2 == 1) {
                continue;
            }
            let Ok(candidate) = data.extended(&[slugs[i], slugs[j]]) else { continue };
            let pair = Refitted::new(data, candidate, &[&base, a, b], Search::Local).expect("fits");
            let most = a.fitted.objective.max(b.fitted.objective);
            // Starts are ordered before the climbs, so the best of them is within the climb's tolerance of both effects alone.
            assert!(pair.fitted.objective >= most - 1e-6, "{} {}", slugs[i], slugs[j]);
        }
    }
}

/// Each effect is found again in data simulated by the reduced model, with its parameters at the middle of their priors. This tests the algorithm, not the physics.
#[test]
#[ignore = "thorough"]
fn effects_are_found_again() {
    assert_found_again(replica(), |_| true);
}

#[test]
#[ignore = "campaigns/long-tests"]
fn effects_that_change_the_field_are_found_again() {
    let data = replica_with(&Library::default());
    assert_found_again(&data, |effect| effect.field().is_some() && effect.slug() != "large-displacement");
}

fn assert_found_again(subject: &Subject, is_asked: fn(&dyn Effect) -> bool) {
    let (base, fitted) = base_fit();
    for effect in subject.library().effects().iter().filter(|effect| is_asked(**effect)) {
        let candidate = subject.extended(&[effect.slug()]).expect("addable");
        let mut theta = candidate.embed(&base, &fitted.theta);
        for (k, free) in candidate.free.iter().enumerate() {
            if free.effect.is_some() {
                theta[k] = free.quantile(0.55);
            }
        }
        let data = simulated_in(subject, &candidate, &theta, &WHITE, 11);
        let alone = data.fit(&base, &[], Search::Wide).expect("fits");
        let start = (candidate.embed(&base, &alone.theta), alone.noise);
        let with = data.fit(&candidate, &[start], Search::Wide).expect("fits");
        let truth = simulated_objective(&data, &candidate, &theta);
        // The fit's objective is no lower than that of the truth. It leads by half a χ² of up to 10 parameters: more than 27 nats have a probability of 5e-8.
        assert!(with.objective >= truth - 1e-3, "{}: {} below {truth}", effect.slug(), with.objective);
        assert!(with.objective < truth + 27.0, "{}", effect.slug());
    }
}

/// Objective of the true parameters, with the noise fitted.
fn simulated_objective(data: &Subject, candidate: &Candidate, theta: &[f64]) -> f64 {
    let position_m = data.trajectory_m(candidate, theta).expect("a model");
    let (_, value) = noise_fit::fit(&data.fitted, &data.noise_prior(), &position_m, &WHITE.map(f64::ln), true);
    value + candidate.ln_prior(theta)
}

/// Columns of free amplitude are fitted together with the law.
#[test]
fn columns_find_their_amplitude() {
    let (base, fitted) = base_fit();
    let record = &replica().experiment().record;
    let wave: Vec<f64> = record.time_s.iter().map(|t| (5.0 * t).sin()).collect();
    let with = base.with_columns(vec![wave]);
    let mut theta = fitted.theta.clone();
    theta.push(6e-6);
    let data = simulated(&with, &theta, &WHITE, 3);
    let start = (with.embed(&base, &fitted.theta), WHITE);
    let found = data.fit(&with, &[start], Search::Wide).expect("fits");
    // The amplitude is 6 µm with a standard error of 4 µm √(2/600) = 0.23 µm. Five standard errors are exceeded with a probability below 1e-6.
    assert!((found.theta[base.free.len()] - 6e-6).abs() < 1.2e-6, "{}", found.theta[base.free.len()]);
}

/// Checks Broyden's rule with numbers that can be computed by hand. Updated derivatives predict the last move and stay unchanged across it. Columns of free amplitude are
/// not updated. If the rule is off, the derivatives are dropped.
#[test]
fn guessed_derivatives_agree_with_the_last_move() {
    let position = |theta: &[f64]| vec![theta[0] * theta[0] + theta[1] + 3.0 * theta[2], theta[0] * theta[1]];
    let (from, to) = ([1.0, 2.0, 0.5], [1.3, 1.8, 0.9]);
    let columns = vec![vec![2.0, 2.0], vec![1.0, 1.0], vec![3.0, 0.0]];
    let start = FitPoint {
        theta: from.to_vec(),
        position_m: position(&from),
        log_noise: NoiseValues::new([0.0; 5]),
        objective: 0.0,
        columns_m: Some(columns.clone()),
        is_guessed: false,
    };
    let mut point = start.clone();
    point.move_to(&to, position(&to), 1.0, 2);
    assert!(point.is_guessed);
    let guessed = point.columns_m.clone().expect("guessed");
    let along = |columns: &[Vec<f64>], step: [f64; 3], row: usize| -> f64 {
        columns.iter().zip(step).map(|(column, step)| column[row] * step).sum()
    };
    for row in 0..2 {
        let change = position(&to)[row] - position(&from)[row];
        assert!((along(&guessed, [0.3, -0.2, 0.4], row) - change).abs() < 1e-12);
        let across = [0.2, 0.3, 0.0];
        assert!((along(&guessed, across, row) - along(&columns, across, row)).abs() < 1e-12);
    }
    assert_eq!(guessed[2], columns[2]);
    assert!((guessed[0][0] - columns[0][0]).abs() > 0.1);
    point.drop_broyden_derivatives();
    assert!(point.columns_m.is_none() && !point.is_guessed);
    let mut fast = start;
    fast.move_to(&to, position(&to), 1.0, 0);
    assert!(fast.columns_m.is_none() && !fast.is_guessed);
}

/// A fit with the noise terms of the model's specification has no other terms, wherever it starts. Slow noise of twice the white noise is then fitted as white noise.
#[test]
fn a_fit_with_the_models_own_noise_has_no_other() {
    let (base, fitted) = base_fit();
    assert_eq!(replica().specification().noise.len(), 3);
    let data = simulated(&base, &fitted.theta, &NoiseValues::new([4.0, 8.0, 1.0, 0.01, 1.0]), 12);
    let every = data.fit(&base, &[], Search::Wide).expect("fits");
    assert!(every.noise[1] > 4.0, "{:?}", every.noise);
    let found = data.with_specified_noise().fit(&base, &[(every.theta, every.noise)], Search::Local).expect("fits");
    let [white, process, _, gain, offset] = found.noise[..] else { panic!("five parameters") };
    assert!(white > 6.0 && process < 0.01 && gain < 1e-4 && offset < 0.01, "{:?}", found.noise);
    assert!(found.objective < every.objective);
}
