//! Truth test of the sampler: no wrong posterior in 400 runs started 10 % off and in 400 started from the prior. The quick test has fewer runs.

use crate::creep_posterior;

use creep_posterior::{CreepPosterior, Exact, over_cores};
use vitreo_uq::sampling::ensemble::RandomStream;
use vitreo_uq::sampling::{SamplerOptions, sample};

const N_RUNS: u64 = 12;
const N_LONG_RUNS: u64 = 400;
/// Default of a run.
const JUMP_FRACTION: f64 = 0.8;

/// Result of one run: is a standard deviation off by more than half, does the run call itself converged, and the largest errors
/// of a standard deviation and of a mean (in exact standard deviations).
struct Run {
    wrong: bool,
    converged: bool,
    worst_sd: f64,
    worst_mean: f64,
    messages: Vec<String>,
    n_evaluations: u64,
}

fn run(posterior: &CreepPosterior, exact: &Exact, starts: &[Vec<f64>], seed: u64, jump_fraction: f64) -> Run {
    let options = SamplerOptions { seed, threads: 1, jump_fraction, ..SamplerOptions::default() };
    let outcome = sample(posterior, starts, &options, &Default::default()).unwrap();
    let worst = |f: &dyn Fn(usize) -> f64| (0..4).map(f).fold(0.0, f64::max);
    let worst_sd = worst(&|d| (outcome.parameters[d].sd / exact.sd[d]).ln().abs());
    let worst_mean = worst(&|d| ((outcome.parameters[d].mean - exact.mean[d]) / exact.sd[d]).abs());
    let wrong = (0..4).any(|d| (outcome.parameters[d].sd / exact.sd[d] - 1.0).abs() > 0.5);
    Run {
        wrong,
        converged: outcome.converged,
        worst_sd,
        worst_mean,
        messages: outcome.messages,
        n_evaluations: outcome.likelihood_evaluations,
    }
}

/// Runs all seeds. With at least 6,000 effective draws, a standard deviation has a relative error of about 1 % and a mean one of
/// 0.013 standard deviations; six of those, with a margin for the number of runs, are allowed.
fn assert_truth(n_runs: u64, jump_fraction: f64, start_of: impl Fn(&CreepPosterior, u64) -> Vec<Vec<f64>> + Sync) {
    let posterior = CreepPosterior::reference(1);
    let exact = posterior.exact();
    let runs = over_cores(n_runs, |seed| run(&posterior, &exact, &start_of(&posterior, seed), seed, jump_fraction));
    let worst = |f: fn(&Run) -> f64| runs.iter().map(f).fold(0.0, f64::max);
    let n_evaluations = runs.iter().map(|run| run.n_evaluations).sum::<u64>() / n_runs;
    println!("{n_evaluations} log densities a run");
    println!("worst sd {:.3}, worst mean {:.3}", worst(|r| r.worst_sd), worst(|r| r.worst_mean));
    let unconverged: Vec<_> = runs.iter().filter(|run| !run.converged).map(|run| &run.messages).collect();
    assert_eq!(runs.iter().filter(|run| run.wrong).count(), 0, "wrong posteriors");
    assert!(unconverged.is_empty(), "{unconverged:?}");
    assert!(worst(|run| run.worst_sd) < 0.1 && worst(|run| run.worst_mean) < 0.1);
}

#[test]
fn started_ten_percent_off() {
    assert_truth(N_RUNS, JUMP_FRACTION, ten_percent_off);
}

#[test]
#[ignore = "campaigns/wrong-posteriors"]
fn started_ten_percent_off_in_many_runs() {
    assert_truth(N_LONG_RUNS, JUMP_FRACTION, ten_percent_off);
}

#[test]
fn started_from_the_prior() {
    assert_truth(N_RUNS, JUMP_FRACTION, from_the_prior);
}

#[test]
#[ignore = "campaigns/wrong-posteriors"]
fn started_from_the_prior_in_many_runs() {
    assert_truth(N_LONG_RUNS, JUMP_FRACTION, from_the_prior);
}

#[test]
fn started_from_the_prior_with_the_ensemble_s_moves_alone() {
    assert_truth(N_RUNS, 0.0, from_the_prior);
}

/// Starts for eight walkers, with every natural parameter 10 % too large or too small.
fn ten_percent_off(posterior: &CreepPosterior, seed: u64) -> Vec<Vec<f64>> {
    let mut stream = RandomStream::new(seed, 1 << 62);
    let off = |stream: &mut RandomStream| if stream.unit() < 0.5 { 0.9_f64.ln() } else { 1.1_f64.ln() };
    let centre: Vec<f64> = posterior.truth().iter().map(|x| x + off(&mut stream)).collect();
    (0..8).map(|_| centre.iter().map(|x| x + 1e-3 * stream.normal()).collect()).collect()
}

fn from_the_prior(posterior: &CreepPosterior, seed: u64) -> Vec<Vec<f64>> {
    let mut stream = RandomStream::new(seed, 1 << 62);
    (0..16).map(|_| posterior.draw_prior(&mut stream)).collect()
}
