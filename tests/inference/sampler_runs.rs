//! Whole runs: the bytes are independent of threads and interruptions; modes with mass keep their walkers, and those without lose them.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;
use vitreo_uq::Error;
use vitreo_uq::sampling::LogDensity;
use vitreo_uq::sampling::ensemble::{Batches, Checkpointing, ConvergenceCriteria, RunControl, SampleOutcome};
use vitreo_uq::sampling::{SamplerOptions, sample};

/// A curved ridge, x₀ ~ N(0, 1), x₁ | x₀ ~ N(x₀², 1), x₂ ~ N(0, 1). It counts its points and sets a flag at one of them.
struct Banana {
    count: AtomicU64,
    stop_at: u64,
    stop: AtomicBool,
}

impl Banana {
    fn stopping_at(stop_at: u64) -> Self {
        Self { count: AtomicU64::new(0), stop_at, stop: AtomicBool::new(false) }
    }
}

impl LogDensity for Banana {
    fn dimension(&self) -> usize {
        3
    }
    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        let n = log_density.len();
        if self.count.fetch_add(n as u64, Ordering::Relaxed) > self.stop_at {
            self.stop.store(true, Ordering::Relaxed);
        }
        for (i, value) in log_density.iter_mut().enumerate() {
            let (a, b, c) = (points[i], points[n + i], points[2 * n + i]);
            *value = -0.5 * (a * a + (b - a * a).powi(2) + c * c);
        }
    }
}

fn options(threads: usize, batches: Batches) -> SamplerOptions {
    SamplerOptions { seed: 7, threads, batches, max_steps: 4_000, ..SamplerOptions::default() }
}

fn starts() -> Vec<Vec<f64>> {
    vec![vec![0.5, -1.0, 2.0], vec![3.0, 3.0, 3.0]]
}

/// Bits of all results that must be independent of threads and interruptions.
fn bits(outcome: &SampleOutcome) -> Vec<u64> {
    let parameters =
        outcome.parameters.iter().flat_map(|p| [p.mean, p.sd, p.rhat, p.ess_bulk, p.ess_tail, p.mcse_mean]);
    let scalars = [outcome.acceptance, outcome.autocorrelation_time];
    let numbers = outcome.draws.positions.iter().chain(&outcome.draws.log_density).copied();
    let counts = [outcome.n_steps, outcome.freeze_step, outcome.likelihood_evaluations, outcome.walkers_reseeded];
    counts.into_iter().chain(numbers.chain(parameters).chain(scalars).map(f64::to_bits)).collect()
}

fn uninterrupted() -> SampleOutcome {
    sample(&Banana::stopping_at(u64::MAX), &starts(), &options(1, Batches::Whole), &RunControl::default()).unwrap()
}

#[test]
fn threads_do_not_change_a_bit() {
    let expected = bits(&uninterrupted());
    for (threads, batches) in [(2, Batches::Whole), (3, Batches::Auto), (1, Batches::Split), (8, Batches::Split)] {
        let outcome =
            sample(&Banana::stopping_at(u64::MAX), &starts(), &options(threads, batches), &RunControl::default())
                .unwrap();
        assert_eq!(bits(&outcome), expected, "{threads} threads, {batches:?}");
    }
}

#[test]
fn interruptions_do_not_change_a_bit() {
    let whole = uninterrupted();
    let expected = bits(&whole);
    let saved = Mutex::new(Vec::new());
    let sink = |bytes: &[u8]| {
        *saved.lock().unwrap() = bytes.to_vec();
        Ok(())
    };
    let mut n_interruptions = 0;
    // The gaps have no common divisor with steps, rounds or convergence checks; the number of threads changes in between.
    let gaps = [9_001_u64, 333, 20_011, 3_001, 1, 50_021, 7_919];
    let outcome = loop {
        let density = Banana::stopping_at(gaps[n_interruptions % gaps.len()]);
        let state = saved.lock().unwrap().clone();
        let control = RunControl {
            stop: Some(&density.stop),
            checkpoint: Some(Checkpointing { sink: &sink, interval: Duration::ZERO }),
            resume: (!state.is_empty()).then_some(&state[..]),
            ..RunControl::default()
        };
        match sample(&density, &starts(), &options(1 + n_interruptions % 2, Batches::Whole), &control) {
            Ok(outcome) => break outcome,
            Err(Error::Interrupted { .. }) => n_interruptions += 1,
            Err(other) => panic!("{other}"),
        }
        assert!(n_interruptions < 10_000);
    };
    assert!(n_interruptions > 5, "{n_interruptions}");
    assert_eq!(bits(&outcome), expected);
    assert_eq!(outcome.converged, whole.converged);
}

#[test]
fn a_checkpoint_of_another_problem_is_refused() {
    let saved = Mutex::new(Vec::new());
    let sink = |bytes: &[u8]| {
        *saved.lock().unwrap() = bytes.to_vec();
        Ok(())
    };
    let density = Banana::stopping_at(5_000);
    let checkpoint = || Some(Checkpointing { sink: &sink, interval: Duration::ZERO });
    let control = RunControl { stop: Some(&density.stop), checkpoint: checkpoint(), ..RunControl::default() };
    let stopped = sample(&density, &starts(), &options(1, Batches::Whole), &control).unwrap_err();
    assert!(matches!(stopped, Error::Interrupted { .. }), "{stopped}");
    let state = saved.lock().unwrap().clone();
    let resumed = |options: SamplerOptions, fingerprint: &str| {
        let control = RunControl { resume: Some(&state), fingerprint: fingerprint.into(), ..RunControl::default() };
        sample(&Banana::stopping_at(u64::MAX), &starts(), &options, &control)
    };
    assert!(resumed(options(1, Batches::Whole), "").is_ok());
    assert_eq!(resumed(options(1, Batches::Whole), "other data").unwrap_err().exit_code(), 2);
    assert_eq!(resumed(SamplerOptions { seed: 8, ..options(1, Batches::Whole) }, "").unwrap_err().exit_code(), 2);
}

#[test]
fn a_nan_stops_the_run_and_names_the_point() {
    struct Faulty;
    impl LogDensity for Faulty {
        fn dimension(&self) -> usize {
            1
        }
        fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
            for (value, x) in log_density.iter_mut().zip(points) {
                *value = if *x > 1.5 { f64::NAN } else { -0.5 * x * x };
            }
        }
    }
    let error = sample(&Faulty, &[vec![0.0]], &SamplerOptions::default(), &RunControl::default()).unwrap_err();
    assert!(error.to_string().contains("NaN") && error.to_string().contains("point"), "{error}");
}

/// Two Gaussian bumps in two dimensions, the lighter one `ratio` times as wide and at distance `gap`.
struct TwoBumps {
    weight: f64,
    gap: f64,
    ratio: f64,
}

impl LogDensity for TwoBumps {
    fn dimension(&self) -> usize {
        2
    }
    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        let n = log_density.len();
        for (i, value) in log_density.iter_mut().enumerate() {
            let (x, y) = (points[i], points[n + i]);
            let first = self.weight.ln() - 0.5 * (x * x + y * y);
            let r2 = ((x - self.gap).powi(2) + y * y) / (self.ratio * self.ratio);
            let second = (1.0 - self.weight).ln() - 2.0 * self.ratio.ln() - 0.5 * r2;
            let top = first.max(second);
            *value = top + ((first - top).exp() + (second - top).exp()).ln();
        }
    }
}

fn spread_starts() -> Vec<Vec<f64>> {
    (0..12).map(|k| vec![f64::from(k) * 5.0 - 10.0, f64::from(k % 3) - 1.0]).collect()
}

/// Both weights are within 0.05, and no walker of the minority is moved. A run has more than 1,000 effective draws: one standard error
/// of a weight is below √(0.21/1000) = 0.0145, and three of those (2 in 1,000) are allowed for fixed seeds.
fn assert_both_weights(jump_fraction: f64, ratio: f64) {
    for seed in 1..=5 {
        let target = TwoBumps { weight: 0.7, gap: 30.0, ratio };
        let options = SamplerOptions { seed, jump_fraction, max_steps: 100_000, ..SamplerOptions::default() };
        let outcome = sample(&target, &spread_starts(), &options, &RunControl::default()).unwrap();
        assert_eq!(outcome.modes.len(), 2);
        assert_eq!(outcome.walkers_reseeded, 0);
        let column = outcome.draws.column(0).values;
        let weight = column.iter().filter(|&&x| x < 15.0).count() as f64 / column.len() as f64;
        assert!((weight - 0.7).abs() < 0.05, "weight {weight}, {:?}", outcome.messages);
        assert!(outcome.converged, "{:?}", outcome.messages);
    }
}

#[test]
fn two_modes_keep_their_weights() {
    assert_both_weights(0.8, 1.0);
    assert_both_weights(0.8, 3.0);
}

#[test]
fn two_modes_keep_their_weights_by_the_ensemble_s_moves_alone() {
    assert_both_weights(0.0, 1.0);
}

/// A spike with negligible mass (10⁻⁸) but nine nats above the bulk. Optimisers end there and walkers would stay; none may.
#[test]
fn a_mode_without_mass_keeps_no_walker() {
    let target = TwoBumps { weight: 1e-8, gap: 8.0, ratio: 1.0 };
    struct Narrow(TwoBumps);
    impl LogDensity for Narrow {
        fn dimension(&self) -> usize {
            2
        }
        fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
            // The first bump shrunk by 10⁶ in both directions keeps its mass and rises by 27.6 nats.
            let n = log_density.len();
            for (i, value) in log_density.iter_mut().enumerate() {
                let (x, y) = (points[i], points[n + i]);
                let spike = self.0.weight.ln() + 2.0 * 1e6_f64.ln() - 0.5e12 * (x * x + y * y);
                let bulk = -0.5 * ((x - self.0.gap).powi(2) + y * y);
                let top = spike.max(bulk);
                *value = top + ((spike - top).exp() + (bulk - top).exp()).ln();
            }
        }
    }
    let mut starts = spread_starts();
    starts.push(vec![1e-7, -1e-7]);
    let outcome = sample(&Narrow(target), &starts, &SamplerOptions::default(), &RunControl::default()).unwrap();
    assert!(outcome.converged, "{:?}", outcome.messages);
    assert_eq!(outcome.modes.len(), 2);
    let column = outcome.draws.column(0).values;
    assert!(column.iter().all(|&x| x > 1.0), "a walker stayed at the spike");
}

#[test]
fn too_few_steps_are_said_in_words() {
    let options = SamplerOptions { max_steps: 64, ..SamplerOptions::default() };
    let outcome = sample(&Banana::stopping_at(u64::MAX), &starts(), &options, &RunControl::default()).unwrap();
    assert!(!outcome.converged);
    assert!(outcome.messages.iter().any(|message| message.contains("required")), "{:?}", outcome.messages);
    assert_eq!(outcome.n_steps, 64);
    assert!(!outcome.draws.is_empty());
}

/// Convergence criteria that any run meets.
const NO_DEMANDS: ConvergenceCriteria =
    ConvergenceCriteria { autocorrelation_times: 1.0, rhat: 10.0, ess: 1.0, rhat_walkers: 10.0 };

/// Only steps after the burn-in are kept, all of them.
#[test]
fn a_freeze_discards_the_burn_in() {
    let options = SamplerOptions { store_every: Some(1), ..options(1, Batches::Whole) };
    let outcome = sample(&Banana::stopping_at(u64::MAX), &starts(), &options, &RunControl::default()).unwrap();
    assert!(outcome.freeze_step >= 128, "{}", outcome.freeze_step);
    assert_eq!(outcome.draws.n_steps as u64, outcome.n_steps - outcome.freeze_step);
}

/// Two bumps with starts in the first only. A few walkers find the other, and both have weight.
fn unknown_bump(seed: u64, gap: f64, max_steps: u64, stop_when_converged: bool) -> SampleOutcome {
    let target = TwoBumps { weight: 0.3, gap, ratio: 2.0 };
    let options = SamplerOptions {
        seed,
        max_steps,
        jump_fraction: 0.0,
        store_every: Some(1),
        stop_when_converged,
        convergence: NO_DEMANDS,
        ..SamplerOptions::default()
    };
    sample(&target, &[vec![-0.5, 0.5]], &options, &RunControl::default()).unwrap()
}

/// At the first check a quarter of 400 steps is over. If walkers are then in a bump without starts, no time is left to burn in again, and the run does not count as converged
/// even if it meets the other criteria. Otherwise there is no remark. With more steps there is time. Seeds are consecutive, and some of them find the bump.
#[test]
fn walkers_left_behind_to_the_end_are_said_and_not_called_converged() {
    let mut n_found = 0;
    for seed in 1..=8 {
        let short = unknown_bump(seed, 14.0, 400, true);
        if short.modes.len() == 1 {
            assert!(
                short.messages.iter().all(|message| !message.contains("not joined the others")),
                "{:?}",
                short.messages
            );
            continue;
        }
        n_found += 1;
        assert!(!short.converged, "seed {seed}");
        assert!(short.messages.iter().all(|message| message.contains("not joined the others")), "{:?}", short.messages);
        assert_eq!(short.messages.len(), 1);
        let long = unknown_bump(seed, 14.0, 20_000, true);
        assert!(long.converged && long.messages.is_empty(), "{:?}", long.messages);
    }
    assert!(n_found > 0);
}

/// The other bump may be found too late for another burn-in but before the end; this is reported. New walkers would break the chains of the kept draws: more than half of
/// the 128 would change bumps at once, whereas the moves change a dozen or two. Seeds are consecutive: no run moves many at once, and some find the bump that late.
#[test]
fn a_mode_found_after_the_last_freeze_moves_nobody() {
    let mut n_late = 0;
    for seed in 1..=18 {
        let outcome = unknown_bump(seed, 16.0, 3_000, false);
        let most = most_walkers_that_leap(&outcome);
        assert!(most < 48, "seed {seed}: {most} walkers changed bumps at once");
        let is_said = outcome.messages.iter().any(|message| message.contains("not joined the others"));
        if is_said {
            assert!(outcome.modes.len() == 2 && most > 0, "seed {seed}: {:?}", outcome.messages);
            n_late += 1;
        }
    }
    assert!(n_late > 0);
}

/// Largest number of walkers of all ensembles that change bumps in one kept step.
fn most_walkers_that_leap(outcome: &SampleOutcome) -> usize {
    let draws = &outcome.draws;
    let walkers = || (0..draws.n_ensembles).flat_map(|e| (0..draws.n_walkers).map(move |w| (e, w)));
    let leaps =
        |step: usize, (e, w): (usize, usize)| (draws.value(e, step, w, 0) - draws.value(e, step - 1, w, 0)).abs() > 5.0;
    (1..draws.n_steps).map(|step| walkers().filter(|&walker| leaps(step, walker)).count()).max().unwrap_or(0)
}

/// Walkers that divide correctly between two bumps but never change over contain no information about the weights. The bumps'
/// scales are so different that no move leads from one to the other. Only R̂ over walkers reveals this.
#[test]
fn walkers_that_keep_to_their_bumps_are_not_called_converged() {
    let target = TwoBumps { weight: 0.6, gap: 30.0, ratio: 1e-4 };
    let options = SamplerOptions { jump_fraction: 0.0, max_steps: 4_000, ..SamplerOptions::default() };
    let starts = [vec![0.5, 0.5], vec![30.0, 1e-5]];
    let outcome = sample(&target, &starts, &options, &RunControl::default()).unwrap();
    assert_eq!(outcome.modes.len(), 2);
    let column = outcome.draws.column(0).values;
    let share = column.iter().filter(|&&x| x < 15.0).count() as f64 / column.len() as f64;
    assert!((share - 0.6).abs() < 0.02, "{share}");
    assert!(!outcome.converged);
    assert!(outcome.messages.iter().any(|message| message.contains("walkers stay")), "{:?}", outcome.messages);
}
