//! Tests of the noise's optimum against a brute-force search from many starts.

use super::super::test_subjects::{Protocol, noise_of, random_sizes, subject, truth_of};
use super::super::{Search, Subject};
use super::*;
use crate::NoiseValues;
use sampling::ensemble::RandomStream;

/// Returns the best of many climbs. Each is a pattern search that shares no code with the climb under test.
fn by_brute_force(objective: &Objective, prior: &NoisePrior, seed: u64) -> (LogNoise, f64) {
    let mut stream = RandomStream::new(99, seed);
    let draw = |stream: &mut RandomStream| -> LogNoise {
        NoiseValues::from_fn(5, |index| {
            let [lower, upper] = prior.ends(index);
            let (lower, upper) = if index == 2 { (lower, upper) } else { (lower + 2.0, upper - 2.0) };
            lower + (upper - lower) * stream.unit()
        })
    };
    let mut points: Vec<LogNoise> = (0..400).map(|_| draw(&mut stream)).collect();
    let values = objective.evaluate(&points);
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|a, b| values[*b].total_cmp(&values[*a]));
    points = order.iter().take(8).map(|place| points[*place]).collect();
    let mut best = (NoiseValues::new([0.0; 5]), f64::NEG_INFINITY);
    for mut here in points {
        let mut value = objective.evaluate(&[here])[0];
        let mut width = 1.0;
        while width > 0.01 {
            let around: Vec<LogNoise> = (0..24)
                .map(|_| prior.clamped(NoiseValues::from_fn(5, |index| here[index] + width * stream.normal())))
                .collect();
            let values = objective.evaluate(&around);
            let top = (0..24).max_by(|a, b| values[*a].total_cmp(&values[*b])).unwrap_or(0);
            if values[top] > value {
                (here, value) = (around[top], values[top]);
                width *= 1.2;
            } else {
                width *= 0.8;
            }
        }
        if value > best.1 {
            best = (here, value);
        }
    }
    best
}

/// Losses (nats) of the search relative to brute force, over `n` records with one kind of noise at the fit of the base. Also returns the mean white noise (µm).
fn losses(subject: &Subject, truth_m: impl Fn(u64) -> Vec<f64>, noise: &NoiseValues, n: u64) -> (Vec<f64>, f64) {
    let mut losses = Vec::new();
    let mut mean_white = 0.0;
    for seed in 0..n {
        let truth_m = truth_m(seed);
        let noise_m = noise_of(subject, &truth_m, noise, 9000 + seed);
        let data = subject.with_positions(&truth_m.iter().zip(noise_m).map(|(x, e)| x + e).collect::<Vec<_>>());
        let fitted = data.fit(&data.base(), &[], Search::Wide).expect("fits");
        let prior = data.noise_prior();
        let (best, value) = fit(&data.fitted, &prior, &fitted.position_m, &prior.white(), true);
        let objective = Objective::new(&data.fitted, &prior, &fitted.position_m);
        let (forced, forced_value) = by_brute_force(&objective, &prior, seed);
        if forced_value - value > 0.05 {
            println!("{seed}: {:?} against {:?}", natural(&best), natural(&forced));
        }
        losses.push(forced_value - value);
        mean_white += best[0].exp() / n as f64;
    }
    losses.sort_by(f64::total_cmp);
    (losses, mean_white)
}

/// Brute force finds no noise that is more than 0.1 nat better, on correct models and on models that lack an effect.
#[test]
#[ignore = "thorough"]
fn no_search_finds_a_better_noise() {
    assert_nothing_better(2, &["clock-offset"]);
}

#[test]
#[ignore = "campaigns/long-tests"]
fn no_search_finds_a_better_noise_of_many_records() {
    assert_nothing_better(6, &["clock-offset", "softening", "fractional-damping", "tracking-drift"]);
}

/// Compares the search with brute force over `n` records of every kind of noise, and of every effect that the model lacks.
fn assert_nothing_better(n: u64, lacking: &[&str]) {
    let subject = subject(Protocol::Paper);
    let plain = truth_of(&subject, &[], &[]);
    let kinds = [
        ("white", NoiseValues::new([4.0, 1e-6, 1.0, 1e-9, 1e-6])),
        ("process", NoiseValues::new([4.0, 4.0, 1.0, 1e-9, 1e-6])),
        ("fast process", NoiseValues::new([2.0, 5.0, 0.15, 1e-9, 1e-6])),
        ("gain", NoiseValues::new([4.0, 1e-6, 1.0, 0.01, 2.0])),
    ];
    let mut worst = 0.0_f64;
    for (name, noise) in &kinds {
        let (losses, white_um) = losses(&subject, |_| plain.clone(), noise, n);
        println!(
            "{name}: white {white_um:.3} of {}, median loss {:.4}, largest {:.4}",
            noise[0],
            losses[n as usize / 2],
            losses[n as usize - 1]
        );
        worst = worst.max(losses[n as usize - 1]);
    }
    for slug in lacking {
        let truth = |seed: u64| truth_of(&subject, &[slug], &random_sizes(&subject, slug, seed));
        let (losses, _) = losses(&subject, truth, &kinds[0].1, n);
        println!("lacking {slug}: median loss {:.4}, largest {:.4}", losses[n as usize / 2], losses[n as usize - 1]);
        worst = worst.max(losses[n as usize - 1]);
    }
    assert!(worst < 0.1, "{worst}");
}

/// Under white noise, the posterior of the variance σ² + σ_ou² lies around the mean square of the n residuals. Its relative standard deviation is √(2/n). The mean of 800
/// draws from eight walks is accurate to about a tenth of that. The tolerance is one standard deviation, which leaves room for the prior of the slow noise. The test
/// fails falsely with a probability below 10⁻⁶.
#[test]
fn draws_follow_the_posterior() {
    let subject = subject(Protocol::Paper);
    let truth_m = truth_of(&subject, &[], &[]);
    let noise_m = noise_of(&subject, &truth_m, &NoiseValues::new([4.0, 1e-6, 1.0, 1e-9, 1e-6]), 12);
    let data = subject.with_positions(&truth_m.iter().zip(noise_m).map(|(x, e)| x + e).collect::<Vec<_>>());
    let prior = data.noise_prior();
    let mut stream = RandomStream::new(8, 0);
    let drawn = draws(&data.fitted, &prior, &truth_m, &prior.white(), 800, &mut stream);
    // Logarithm of the standard deviation from row to row, √(σ² + σ_ou²).
    let total: Vec<f64> = drawn.iter().map(|d| 0.5 * ((2.0 * d[0]).exp() + (2.0 * d[1]).exp()).ln()).collect();
    let mean = total.iter().sum::<f64>() / 800.0;
    let sd = (total.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 799.0).sqrt();
    // With 600 residuals about the truth, the logarithm of their root mean square has an error of 1/√1200.
    let squares: f64 =
        data.fitted_m.iter().zip(&truth_m).filter_map(|(y, x)| Some((1e6 * (y.as_ref()? - x)).powi(2))).sum();
    let expected = 0.5 * (squares / data.n_fitted() as f64).ln();
    let spread = 1.0 / (2.0 * data.n_fitted() as f64).sqrt();
    assert!(
        (mean - expected).abs() < spread && sd / spread > 0.7 && sd / spread < 1.6,
        "{mean} {expected} {sd} {spread}"
    );
}
