//! Misfits outside the library: the rate of false findings, and the right names for real ones.
//!
//! Data are made by full finite elements on a finer mesh and finer steps than the fitted model's.

use std::sync::LazyLock;

use rayon::prelude::*;
use vitreo_uq::criticism::outside::{
    OutsideKind, OutsideRequest, OutsideStructure, discrepancies, events_over_all_cycles, search,
};
use vitreo_uq::criticism::{Fitted, Search, Subject, Tangent, outliers};
use vitreo_uq::elements::fe::Stiffness;
use vitreo_uq::elements::fe::stepping::Resolution;
use vitreo_uq::elements::fe::time::FullOrderModel;
use vitreo_uq::models::effects::Library;
use vitreo_uq::models::model::{Forward, FullOrderForward};
use vitreo_uq::posterior::mechanics::{MODEL_LEVEL, robot_mesh};
use vitreo_uq::posterior::monitor::SilentMonitor;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::replica::{TABLE_I, embedded};
use vitreo_uq::posterior::study::ModelSpecification;
use vitreo_uq::record::{Apparatus, Experiment};
use vitreo_uq::sampling::ensemble::RandomStream;

const NOISE_M: f64 = 4e-6;

static BENCH: LazyLock<Bench> = LazyLock::new(Bench::new);

/// The replica's experiment, and its positions (m) without noise.
struct Bench {
    subject: Subject,
    experiment: Experiment,
    truth_m: Vec<f64>,
}

impl Bench {
    fn new() -> Self {
        let (experiment, _) = embedded().expect("embedded");
        let problem = Problem::new(experiment.clone(), ModelSpecification::default(), None, &SilentMonitor)
            .expect("the replica is sound");
        let Apparatus::Robot { robot, vitreous } = &experiment.apparatus else { panic!("the replica has a robot") };
        let mesh = robot_mesh(robot, vitreous, MODEL_LEVEL + 1).expect("a sphere");
        let stiffness = Stiffness::new(&mesh).expect("a good mesh");
        let finer = Resolution { steps_per_doubling: 2 * Resolution::default().steps_per_doubling };
        let record = &experiment.record;
        let at_ratio = FullOrderModel::new(&stiffness, vitreous.poisson_ratio).expect("positive definite");
        let full = FullOrderForward::new(&problem.model, &stiffness, at_ratio, &record.time_s, &record.force_n);
        let truth_m = full.with_resolution(finer).trajectory_m(&TABLE_I).expect("Table I has a model");
        let subject = Subject::new(&problem, &Library::default(), None, &SilentMonitor).expect("sound");
        Self { subject, experiment, truth_m }
    }

    fn with_noise(&self, position_m: &[f64], noise: Noise, seed: u64) -> Subject {
        let mut stream = RandomStream::new(seed, 99);
        let record = &self.experiment.record;
        let (mut process, mut cycle, mut gain) = (stream.normal(), 0, 0.0);
        let mut positions = Vec::with_capacity(position_m.len());
        for (row, x) in position_m.iter().enumerate() {
            if record.cycle[row] != cycle {
                (cycle, gain) = (record.cycle[row], stream.normal());
            }
            let decay = if row == 0 { 1.0 } else { (-(record.time_s[row] - record.time_s[row - 1])).exp() };
            process = decay * process + (1.0 - decay * decay).sqrt() * stream.normal();
            let white = NOISE_M * stream.normal();
            let (is_outlier, size, sign) = (stream.unit() < 0.01, 10.0 + 20.0 * stream.unit(), stream.unit() < 0.5);
            let added = match noise {
                Noise::White => 0.0,
                Noise::Correlated => NOISE_M * process,
                Noise::Gain => 0.01 * gain * x,
                Noise::Outliers if is_outlier => size * NOISE_M * if sign { 1.0 } else { -1.0 },
                Noise::Outliers => 0.0,
            };
            positions.push(x + white + added);
        }
        self.subject.with_positions(&positions)
    }

    /// Data with a structure of `sigmas` standard deviations.
    fn with_structure(&self, kind: OutsideKind, sigmas: f64, noise: Noise, seed: u64) -> Subject {
        let mut column_m = structure(kind, self, seed);
        // Backlash keeps its own size.
        let factor = if kind == OutsideKind::Backlash { 1.0 } else { self.factor(&column_m, sigmas) };
        column_m.iter_mut().for_each(|value| *value *= factor);
        let position_m: Vec<f64> = self.truth_m.iter().zip(&column_m).map(|(x, added)| x + added).collect();
        self.with_noise(&position_m, noise, 500 + seed)
    }

    fn searched(&self, data: &Subject, n_simulations: usize) -> Vec<OutsideStructure> {
        let base = data.base();
        let fitted = data.fit(&base, &[], Search::Wide).expect("fits");
        search(data, &base, &fitted, &OutsideRequest { n_simulations, seed: 3 }).expect("searches")
    }

    /// Factor that gives a column (m) a signal of `sigmas` standard deviations in white noise, after the base has absorbed its part.
    fn factor(&self, column_m: &[f64], sigmas: f64) -> f64 {
        let clean = self.subject.with_positions(&self.truth_m);
        let base = clean.base();
        let fitted = clean.fit(&base, &[], Search::Wide).expect("fits");
        let fitted =
            Fitted { noise: vitreo_uq::criticism::NoiseValues::new([1e6 * NOISE_M, 1e-3, 1.0, 1e-5, 1e-3]), ..fitted };
        let tangent = Tangent::new(&clean, &base, &fitted).expect("derivatives");
        sigmas / tangent.visible(&[column_m.to_vec()])[0].norm()
    }
}

#[derive(Debug, Clone, Copy)]
enum Noise {
    White,
    Correlated,
    Gain,
    Outliers,
}

fn is_finding(found: &OutsideStructure) -> bool {
    found.p_familywise < 0.01 && found.gain_nats >= 10.0
}

/// Structure of a kind in unit size (m), with randomness from a seed.
fn structure(kind: OutsideKind, bench: &Bench, seed: u64) -> Vec<f64> {
    let mut stream = RandomStream::new(seed, 7);
    let time_s = &bench.experiment.record.time_s;
    let (first, second) = (stream.unit(), stream.unit());
    let moment_s = 3.0 + 24.0 * first;
    let of_time = |f: &dyn Fn(f64) -> f64| time_s.iter().map(|t| 1e-6 * f(*t)).collect::<Vec<f64>>();
    match kind {
        OutsideKind::Vibration => {
            let hz = 0.3 * 30.0_f64.powf(first);
            of_time(&|t| (2.0 * std::f64::consts::PI * (hz * t + second)).sin())
        }
        OutsideKind::Slip => of_time(&|t| f64::from(u8::from(t >= moment_s))),
        OutsideKind::Ramp => of_time(&|t| (t - (5.0 + 15.0 * first)).max(0.0)),
        OutsideKind::GainChange => {
            time_s.iter().zip(&bench.truth_m).map(|(t, x)| if *t >= moment_s { 1e-2 * x } else { 0.0 }).collect()
        }
        OutsideKind::Disturbance => of_time(&|t| (-0.5 * ((t - moment_s) / (0.1 + 0.6 * second)).powi(2)).exp()),
        _ => {
            let half_width_m = 3e-6 + 20e-6 * first;
            let mut held = 0.0_f64;
            let play = |x: &f64| {
                held = held.clamp(x - half_width_m, x + half_width_m);
                held - x
            };
            bench.truth_m.iter().map(play).collect()
        }
    }
}

/// Correct models under four kinds of noise. At a rate of 1 % two or more findings in four occur once in 1,700 times; the seeds are fixed.
#[test]
fn correct_models_have_next_to_no_findings() {
    assert_hardly_found(1, 2);
}

/// At a rate of 1 % four or more findings in 24 occur once in ten thousand times.
#[test]
#[ignore = "campaigns/long-tests"]
fn many_correct_models_have_next_to_no_findings() {
    assert_hardly_found(6, 4);
}

fn assert_hardly_found(n_each: u64, too_many: usize) {
    assert_hardly_any(n_each, too_many, |noise, seed| {
        let data = BENCH.with_noise(&BENCH.truth_m, noise, 40 + seed);
        BENCH.searched(&data, 150).into_iter().filter(is_finding).collect()
    });
}

/// Requires that fewer than `too_many` structures are found in correct models with each kind of noise and `n_each` seeds.
fn assert_hardly_any(n_each: u64, too_many: usize, find: impl Fn(Noise, u64) -> Vec<OutsideStructure> + Sync) {
    let noises = [Noise::White, Noise::Correlated, Noise::Gain, Noise::Outliers];
    let sets: Vec<(Noise, u64)> =
        noises.into_iter().flat_map(|noise| (0..n_each).map(move |seed| (noise, seed))).collect();
    let found: Vec<String> = sets
        .par_iter()
        .flat_map_iter(|(noise, seed)| {
            find(*noise, *seed).into_iter().map(move |outside| format!("{noise:?}: {}", outside.sentence))
        })
        .collect();
    assert!(found.len() < too_many, "{found:#?}");
}

/// Signals of 30 standard deviations of the white noise. The correlated noise, estimated again for each fit, absorbs most slow structures.
#[test]
fn what_is_there_is_called_by_its_name() {
    let bench = &*BENCH;
    // A slip is dated below, and a vibration biases no parameter.
    let kinds = [OutsideKind::Ramp, OutsideKind::GainChange, OutsideKind::Disturbance];
    kinds.into_par_iter().for_each(|kind| {
        let data = bench.with_structure(kind, 30.0, Noise::White, 5);
        let found = bench.searched(&data, 150);
        let first = found.first().unwrap_or_else(|| panic!("{kind:?} is not found"));
        assert!(is_finding(first) && first.kind == kind, "{kind:?}: {}", first.sentence);
    });
}

/// A jump of 40 µm, ten times the noise: its time is known to one row except once in a million, its size to five standard deviations.
#[test]
fn a_slip_is_dated_and_sized() {
    let bench = &*BENCH;
    let moment_s = 13.0;
    let time_s = &bench.experiment.record.time_s;
    let slipped: Vec<f64> =
        time_s.iter().zip(&bench.truth_m).map(|(t, x)| x + if *t >= moment_s { 40e-6 } else { 0.0 }).collect();
    let data = bench.with_noise(&slipped, Noise::White, 8);
    let first = bench.searched(&data, 150).swap_remove(0);
    assert_eq!(first.kind, OutsideKind::Slip, "{}", first.sentence);
    assert!((first.event_time_s.expect("an event") - moment_s).abs() < 0.06, "{}", first.sentence);
    let amplitude_um = first.fitted.theta.last().expect("an amplitude");
    assert!((amplitude_um - 40.0).abs() < 5.0, "{amplitude_um} µm");
    assert!(first.sentence.contains("cycle 2") && first.sentence.contains("up"), "{}", first.sentence);
}

/// The search does not see the scored cycle; the search over all cycles does.
#[test]
#[ignore = "thorough"]
fn an_event_in_the_scored_cycle_is_found_over_all_cycles_only() {
    let bench = &*BENCH;
    let time_s = &bench.experiment.record.time_s;
    let slipped: Vec<f64> =
        time_s.iter().zip(&bench.truth_m).map(|(t, x)| x + if *t >= 33.0 { 60e-6 } else { 0.0 }).collect();
    let data = bench.with_noise(&slipped, Noise::White, 9);
    let base = data.base();
    let fitted = data.fit(&base, &[], Search::Wide).expect("fits");
    let request = OutsideRequest { n_simulations: 150, seed: 3 };
    assert!(!search(&data, &base, &fitted, &request).expect("searches").iter().any(is_finding));
    let all = events_over_all_cycles(&data, &base, &fitted, &request).expect("searches");
    assert!(is_finding(&all[0]) && all[0].kind == OutsideKind::Slip, "{}", all[0].sentence);
    assert!((all[0].event_time_s.expect("an event") - 33.0).abs() < 0.06, "{}", all[0].sentence);
}

/// The reported structure is nearly orthogonal to the derivatives of the model at the base's fit. Its bands have
/// plausible sizes.
#[test]
fn a_discrepancy_bends_no_parameter() {
    let bench = &*BENCH;
    let data = bench.with_structure(OutsideKind::Vibration, 20.0, Noise::White, 3);
    let base = data.base();
    let fitted = data.fit(&base, &[], Search::Wide).expect("fits");
    let request = OutsideRequest { n_simulations: 20, seed: 3 };
    for found in discrepancies(&data, &base, &fitted, &request).expect("fits") {
        assert!(found.mean_m.iter().chain(&found.sd_m).all(|value| value.is_finite()), "{:?}", found.axis);
        assert!(found.sd_m.iter().all(|sd| *sd >= 0.0 && *sd < 1e-4), "{:?}", found.axis);
    }
    let first = search(&data, &base, &fitted, &request).expect("searches").swap_remove(0);
    let refit = Fitted { noise: first.fitted.noise, ..fitted.clone() };
    let at_refit = Tangent::new(&data, &base, &refit).expect("derivatives");
    let whole = &at_refit.whiten(std::slice::from_ref(&first.discrepancy_m))[0];
    let left = at_refit.project(whole.clone());
    assert!((left.norm() / whole.norm() - 1.0).abs() < 0.02, "{} of {}", left.norm(), whole.norm());
}

/// Only rows far from the prediction are named.
#[test]
fn single_rows_far_off_are_outliers() {
    let bench = &*BENCH;
    let mut position_m = bench.truth_m.clone();
    for row in [57, 310, 488] {
        position_m[row] += 80e-6;
    }
    let data = bench.with_noise(&position_m, Noise::White, 21);
    let fitted = data.fit(&data.base(), &[], Search::Wide).expect("fits");
    assert_eq!(outliers::find_outliers(&data, &fitted), [57, 310, 488]);
}

/// Events over all cycles under the four kinds of noise: three of 320 controls had one that gains 7 nats at p ≤ 1 %. So two or more in four occur less than
/// once in 1,900 times.
#[test]
fn correct_models_have_next_to_no_events() {
    assert_hardly_any_event(1, 2);
}

/// Three or more in 12 occur less than once in five thousand times.
#[test]
#[ignore = "campaigns/long-tests"]
fn many_correct_models_have_next_to_no_events() {
    assert_hardly_any_event(3, 3);
}

fn assert_hardly_any_event(n_each: u64, too_many: usize) {
    assert_hardly_any(n_each, too_many, |noise, seed| {
        let data = BENCH.with_noise(&BENCH.truth_m, noise, 70 + seed);
        let base = data.base();
        let fitted = data.fit(&base, &[], Search::Wide).expect("fits");
        let request = OutsideRequest { n_simulations: 199, seed: 3 };
        let found = events_over_all_cycles(&data, &base, &fitted, &request).expect("searches");
        let is_alarm = |event: &OutsideStructure| event.p_familywise <= 0.01 && event.penalised_gain_nats >= 7.0;
        found.into_iter().find(is_alarm).into_iter().collect()
    });
}
