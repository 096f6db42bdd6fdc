//! Verdicts on data whose only fault is their noise, and on data of another law.
//!
//! The tests check the algorithm, not the mechanics: motions are those of the model, in closed form, on an instrument.

use rayon::prelude::*;

use super::diagnose::{DiagnosisRequest, diagnose};
use super::test_subjects::{Protocol, noise_of, subject, truth_of};
use super::{Search, Subject};
use crate::NoiseValues;
use documents::diagnosis::{Diagnosis, VerdictKind};
use models::effects::Library;
use posterior::misfit::{GainKnowledge, Misfit, Residuals};
use posterior::monitor::SilentMonitor;
use posterior::problem::Problem;
use posterior::study::ModelSpecification;
use sampling::ensemble::RandomStream;

/// Effects that are quick to fit and that together can describe many misfits.
const QUICK: [&str; 6] =
    ["actuator-lag", "clock-offset", "force-bias", "instantaneous-elasticity", "second-retardation", "tracking-drift"];
/// Effects for tests whose verdict does not depend on the selection.
const FEW: [&str; 3] = ["clock-offset", "force-bias", "instantaneous-elasticity"];

/// Noise of a control. `parameters` are white and slow standard deviation (µm), correlation time (s), gain, and offset (µm). `off` is the fraction of rows moved by 12
/// standard deviations of a row, `lost` that of rows without a position. `is_given` tells whether the white noise is given.
#[derive(Clone, Copy)]
struct Noise {
    parameters: NoiseValues,
    off: f64,
    lost: f64,
    is_given: bool,
}

const NONE: f64 = 1e-6;
const WHITE: Noise =
    Noise { parameters: NoiseValues::new([4.0, NONE, 1.0, NONE, NONE]), off: 0.0, lost: 0.0, is_given: true };

fn autoregressive(sd_um: f64, time_s: f64) -> Noise {
    Noise { parameters: NoiseValues::new([NONE, sd_um, time_s, NONE, NONE]), is_given: false, ..WHITE }
}

/// Returns a subject with positions (m), one per row, and a selection of effects. Its noise of 4 µm may be given or not.
fn measured(position_m: &[Option<f64>], is_given: bool, effects: &[&str]) -> Subject {
    let mut experiment = subject(Protocol::Paper).experiment().clone();
    experiment.record.position_m = position_m.to_vec();
    experiment.noise_sd_m = is_given.then_some(4e-6);
    let problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).expect("sound");
    Subject::new(&problem, &Library::only(effects), None, &SilentMonitor).expect("sound")
}

fn control(still: &Subject, noise: &Noise, seed: u64) -> Subject {
    let position_m = truth_of(still, &[], &[]);
    let noise_m = noise_of(still, &position_m, &noise.parameters, seed);
    let mut stream = RandomStream::new(4243, seed);
    let off_m = 12e-6 * noise.parameters[0].hypot(noise.parameters[1]);
    let mut of_row = |(x, noise_m): (&f64, f64)| {
        let sign = if stream.unit() < 0.5 { -1.0 } else { 1.0 };
        let off_m = if stream.unit() < noise.off { sign * off_m } else { 0.0 };
        (stream.unit() >= noise.lost).then_some(x + noise_m + off_m)
    };
    let positions: Vec<Option<f64>> = position_m.iter().zip(noise_m).map(&mut of_row).collect();
    measured(&positions, noise.is_given, &QUICK)
}

fn diagnosed(subject: &Subject, seed: u64) -> Diagnosis {
    let request = DiagnosisRequest { in_full: false, seed, ..DiagnosisRequest::default() };
    diagnose(subject, &request, &SilentMonitor).expect("a diagnosis").diagnosis
}

/// Slow noise alone counts as noise and is reported as an estimate, although short lags show at most a third of it. This also holds with outliers and lost rows. At most
/// one search in a hundred has a false claim. So one of the first four verdicts is not `none` in one of twenty-five choices of seeds; these seeds are fixed.
/// `VITREO_UQ_CONTROLS` sets a larger number of records of each kind, and adds kinds.
#[test]
#[ignore = "campaigns/long-tests"]
fn noise_that_is_not_given_is_not_a_misfit() {
    let n: u64 = std::env::var("VITREO_UQ_CONTROLS").ok().and_then(|n| n.parse().ok()).unwrap_or(1);
    let slow = autoregressive(6.0, 0.475);
    let kinds = [
        ("AR(1) 0.475 s", slow),
        ("AR(1) 0.475 s, outliers", Noise { off: 0.01, ..slow }),
        ("AR(1) 4 s", autoregressive(4.0, 4.0)),
        ("AR(1) 0.475 s, lost rows", Noise { lost: 0.1, ..slow }),
        ("AR(1) 0.1 s", autoregressive(6.0, 0.1)),
        ("AR(1) 10 s", autoregressive(6.0, 10.0)),
        ("white", WHITE),
        ("white, not given", Noise { is_given: false, ..WHITE }),
        ("outliers", Noise { off: 0.01, ..WHITE }),
        ("outliers, not given", Noise { off: 0.01, is_given: false, ..WHITE }),
        ("gain", Noise { parameters: NoiseValues::new([4.0, NONE, 1.0, 0.01, NONE]), ..WHITE }),
        (
            "gain, not given",
            Noise { parameters: NoiseValues::new([4.0, NONE, 1.0, 0.01, NONE]), is_given: false, ..WHITE },
        ),
        ("slow beside what is given", Noise { parameters: NoiseValues::new([4.0, 4.0, 1.0, NONE, NONE]), ..WHITE }),
        ("lost rows", Noise { lost: 0.1, ..WHITE }),
    ];
    let still = subject(Protocol::Paper);
    let n_kinds = if n > 1 { kinds.len() } else { 4 };
    let cases: Vec<(usize, u64)> = (0..n_kinds).flat_map(|kind| (0..n).map(move |seed| (kind, seed))).collect();
    let others: Vec<(usize, u64, Diagnosis)> = cases
        .into_par_iter()
        .map(|(kind, seed)| (kind, seed, diagnosed(&control(&still, &kinds[kind].1, 100 * kind as u64 + seed), seed)))
        .collect();
    for (kind, (name, noise)) in kinds.iter().enumerate().take(n_kinds) {
        let function = || others.iter().filter(|other| other.0 == kind);
        let wrong: Vec<_> = function().filter(|other| other.2.verdict.kind != VerdictKind::None).collect();
        println!("{name}: {} of {n} not none", wrong.len());
        wrong.iter().for_each(|(_, seed, other)| println!("  seed {seed}: {}", other.verdict.sentence));
        assert!(n > 1 || wrong.is_empty());
        for (.., diagnosis) in function().filter(|other| other.2.verdict.kind == VerdictKind::None) {
            assert_eq!(diagnosis.verdict.sentence.contains("estimated"), !noise.is_given);
            let true_um = noise.parameters[0].hypot(noise.parameters[1]);
            // For slow noise with a correlation time of 10 s, four cycles give a few independent values. For 0.5 s they give some sixty, with an error of a tenth.
            let ratio = diagnosis.search_noise_um / true_um;
            assert!(noise.parameters[2] > 0.5 || noise.is_given || (0.6..1.6).contains(&ratio), "{ratio}");
        }
    }
}

/// The hardest kind of noise of that test, with few effects. A false claim has a probability of one in a hundred, and the seed is fixed.
#[test]
#[ignore = "thorough"]
fn slow_noise_with_outliers_is_not_a_misfit() {
    let slow = Noise { off: 0.01, ..autoregressive(6.0, 0.475) };
    let position_m = control(&subject(Protocol::Paper), &slow, 100).problem().experiment.record.position_m.clone();
    let diagnosis = diagnosed(&measured(&position_m, false, &FEW[..2]), 0);
    assert_eq!(diagnosis.verdict.kind, VerdictKind::None, "{}", diagnosis.verdict.sentence);
    assert!(diagnosis.verdict.sentence.contains("estimated"));
    let ratio = diagnosis.search_noise_um / 6.0;
    assert!((0.6..1.6).contains(&ratio), "{ratio}");
}

/// The data creep with the square root of time, while the law has one relaxation time. Effects help, but none suffices. The noise is 0.1 µm.
#[test]
#[ignore = "campaigns/long-tests"]
fn a_wrong_law_is_called_wrong_first() {
    let still = subject(Protocol::Paper);
    let record = &still.experiment().record;
    // The motion reaches half a millimetre one second after a change of the force.
    let of_row = |row: usize| {
        let steps = record.force_step_rows().into_iter().filter(|step| *step < row);
        let before_n = |step: usize| step.checked_sub(1).map_or(0.0, |before| record.force_n[before]);
        let response = |step: usize| {
            (record.force_n[step] - before_n(step)) / 4.6e-6 * (record.time_s[row] - record.time_s[step]).sqrt()
        };
        5e-4 * steps.map(response).sum::<f64>()
    };
    let mut stream = RandomStream::new(9, 9);
    let position_m: Vec<Option<f64>> =
        (0..record.n_rows()).map(|row| Some(of_row(row) + 1e-7 * stream.normal())).collect();
    let data = measured(&position_m, false, &FEW);
    let diagnosis = diagnosed(&data, 1);
    let verdict = &diagnosis.verdict;
    println!("{}", verdict.sentence);
    assert_eq!(verdict.kind, VerdictKind::Unexplained, "{}", verdict.sentence);
    assert!(verdict.effects.len() <= 1 && verdict.equivalent.is_empty(), "{:?}", verdict.effects);
    assert!(verdict.sentence.starts_with("No tried effect makes the model right"), "{}", verdict.sentence);
    let named = diagnosis.candidates.iter().find(|entry| verdict.effects.contains(&entry.effect)).expect("what helps");
    assert_eq!(diagnosis.status_words(named), "helps, not enough");
    assert!(diagnosis.extended.is_some());
}

/// `diagnose` and `sample` judge a residual alike. The data have a shape of 5 µm that repeats in every cycle, beside 4 µm of known noise. The search's noise absorbs the
/// shape, but `diagnose` must call it a misfit, as `sample` does with white noise alone. Without the shape, `sample` finds no misfit; the controls above require the same
/// of `diagnose`. tests/commands/diagnose.rs runs both commands on a shorter record.
#[test]
#[ignore = "campaigns/long-tests"]
fn known_noise_binds_both_commands() {
    let still = subject(Protocol::Paper);
    let truth_m = truth_of(&still, &[], &[]);
    let record = still.experiment().record.clone();
    let noise_m = noise_of(&still, &truth_m, &WHITE.parameters, 17);
    let again_m = |t: f64| 7e-6 * (std::f64::consts::TAU * 0.3 * t + 0.5).sin();
    let with = |size: f64| {
        let of_row = |row: usize| Some(truth_m[row] + noise_m[row] + size * again_m(record.time_s[row]));
        measured(&(0..truth_m.len()).map(of_row).collect::<Vec<_>>(), true, &FEW)
    };
    let diagnosis = diagnosed(&with(1.0), 2);
    assert_ne!(diagnosis.verdict.kind, VerdictKind::None, "{}", diagnosis.verdict.sentence);
    for (data, is_misfit) in [(with(1.0), true), (with(0.0), false)] {
        // The method of `sample`: a fit with white noise, its residuals, the misfit rule.
        let model_m = data.fit(&data.base(), &[], Search::Wide).expect("fits").position_m;
        let left = |positions: &[Option<f64>]| -> Vec<Option<f64>> {
            positions.iter().zip(&model_m).map(|(y, x)| y.map(|y| y - x)).collect()
        };
        let remainder = Residuals {
            record: &record,
            fitted_m: &left(&data.fitted_m),
            heldout_m: &left(&data.scored_m),
            position_m: &model_m,
            absorbed_m: &[],
            gains: GainKnowledge::None,
        };
        let of_sample = Misfit::of(&remainder, 4e-6, true).expect("positions");
        assert_eq!(of_sample.is_too_large(), is_misfit);
    }
}

/// Three parts of one unbroken hold are named as cycles, with the last one held out and 4 µm of known noise. If the motion in the last part leaves the law, a gain and an
/// offset of that part would absorb all of the misfit. The verdict must then not be `none`. If the motion follows the law, the verdict is `none`.
#[test]
fn a_part_of_an_unbroken_hold_has_no_gain_of_its_own() {
    let mut experiment = subject(Protocol::Paper).experiment().clone();
    let record = &mut experiment.record;
    record.force_n.fill(4.6e-6);
    let n_rows = record.n_rows();
    record.cycle = (0..n_rows).map(|row| 1 + (3 * row / n_rows) as u32).collect();
    (experiment.calibration_cycles, experiment.heldout_cycles) = (vec![1, 2], vec![3]);
    experiment.noise_sd_m = Some(4e-6);
    let made = |experiment: record::Experiment| {
        let problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).expect("sound");
        Subject::new(&problem, &Library::only(&FEW[..2]), None, &SilentMonitor).expect("sound")
    };
    let still = made(experiment.clone());
    let truth_m = truth_of(&still, &[], &[]);
    let noise_m = noise_of(&still, &truth_m, &WHITE.parameters, 7);
    for (slower, is_sound) in [(0.0, true), (1.2e-6, false)] {
        let mut measured = experiment.clone();
        let begins_s = measured.record.time_s[2 * n_rows / 3];
        let of_row = |row: usize| {
            let since_s = (measured.record.time_s[row] - begins_s).max(0.0);
            Some(truth_m[row] + noise_m[row] + slower * since_s)
        };
        measured.record.position_m = (0..n_rows).map(of_row).collect();
        let verdict = diagnosed(&made(measured), 3).verdict;
        assert_eq!(verdict.kind == VerdictKind::None, is_sound, "{}", verdict.sentence);
    }
}

/// In the real measurement beside the project, if present, an effect may help, but none is the cause.
#[test]
#[ignore = "campaigns/long-tests"]
fn a_real_measurement_of_another_law_is_not_explained() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/keizer-2022-cycles");
    if !path.exists() {
        println!("skipped: {} is not there", path.display());
        return;
    }
    let (experiment, _) = record::Experiment::read(&path).expect("an experiment");
    let specification = ModelSpecification { prior: "generic".into(), ..ModelSpecification::default() };
    let problem = Problem::new(experiment, specification, None, &SilentMonitor).expect("sound");
    let data = Subject::new(&problem, &Library::only(&QUICK), None, &SilentMonitor).expect("sound");
    let diagnosis = diagnosed(&data, 1);
    println!("{}", diagnosis.verdict.sentence);
    assert_eq!(diagnosis.verdict.kind, VerdictKind::Unexplained);
    assert!(diagnosis.verdict.effects.len() <= 1);
}
