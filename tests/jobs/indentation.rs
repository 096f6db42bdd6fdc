//! Indentation by the law of Lee and Radok, from files to estimates. Independent time steps in this file give the positions.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use vitreo_uq::models::model::Forward;
use vitreo_uq::posterior::check::contradictions;
use vitreo_uq::posterior::fit;
use vitreo_uq::posterior::monitor::SilentMonitor;
use vitreo_uq::posterior::prepared::PreparedModel;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::study::ModelSpecification;
use vitreo_uq::record::{Experiment, ExperimentFiles, Note};

/// E in Pa, c₁ and c₂ in Pa·s.
const LAW: [f64; 3] = [400.0, 200.0, 3000.0];
const RADIUS_M: f64 = 5e-6;

/// Strain times force of a Lethersich body at every row in N/Pa, with the force held between rows: classical Runge–Kutta steps of both bodies' equations.
fn strains(time_s: &[f64], force_n: &[f64], [e, c1, c2]: [f64; 3]) -> Vec<f64> {
    const N_STEPS: usize = 16;
    let (mut retarded, mut flow) = (0.0, 0.0);
    let mut strains = vec![0.0];
    for row in 1..time_s.len() {
        let (force, step) = (force_n[row - 1], (time_s[row] - time_s[row - 1]) / N_STEPS as f64);
        let rate = |x: f64| (force - e * x) / c1;
        for _ in 0..N_STEPS {
            let k1 = rate(retarded);
            let k2 = rate(retarded + 0.5 * step * k1);
            let k3 = rate(retarded + 0.5 * step * k2);
            let k4 = rate(retarded + step * k3);
            retarded += step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
            flow += step * force / c2;
        }
        strains.push(retarded + flow);
    }
    strains
}

fn read(
    apparatus: &str,
    measurement: &str,
    csv: &str,
) -> vitreo_uq::base::error::Result<(Experiment, ExperimentFiles)> {
    let toml = format!(
        "[specimen]\nid = \"gel\"\n{apparatus}\n[measurement]\nfile = \"t.csv\"\nsource = \"synthetic\"\n{measurement}\n"
    );
    Experiment::from_texts("experiment.toml", toml, "t.csv", csv)
}

fn problem(experiment: Experiment, base: &str) -> Problem {
    let specification =
        ModelSpecification::default().with_options(Some(base), &[], &[], Some("generic"), &[]).expect("a model");
    Problem::new(experiment, specification, None, &SilentMonitor).expect("a model of the experiment")
}

/// Positions (m) of the reduced model, the only model of an indenter.
fn positions(problem: &Problem, parameters: &[f64]) -> Vec<f64> {
    let prepared = PreparedModel::new(problem, None, &SilentMonitor).expect("no finite elements");
    prepared.forward().trajectory_m(parameters).expect("a trajectory")
}

/// A record that begins in contact: 400 rows of a force (nN) at 100 Hz.
fn pressed(force_nn: impl Fn(f64) -> f64) -> String {
    let row = |i: usize| {
        let time_s = 0.01 * i as f64;
        format!("{time_s},{},{}\n", force_nn(time_s), 0.01 * i as f64)
    };
    String::from("time_s,force_nN,position_um\n") + &(0..400).map(row).collect::<String>()
}

const TIPS: [(&str, f64); 3] = [
    ("exponent = 1.5\ntip_radius_um = 5", 1.5),
    ("exponent = 2\nhalf_angle_deg = 35", 2.0),
    ("exponent = 1\npunch_radius_um = 5", 1.0),
];

/// k by Hertz's and Sneddon's formulas at ν = 1/2.
fn compliance(exponent: f64) -> f64 {
    match exponent {
        1.5 => 3.0 * 0.75 / (4.0 * RADIUS_M.sqrt()),
        2.0 => std::f64::consts::PI * 0.75 / (2.0 * 35_f64.to_radians().tan()),
        _ => 0.75 / (2.0 * RADIUS_M),
    }
}

/// A constant force on a standard linear solid: δ^p = k F (1/E₀ + (1 − e^{−Et/c₁})/E), realised by a Burgers body whose last dashpot contributes 10⁻¹² of that.
#[test]
fn a_standard_linear_solid_creeps_as_its_closed_form() {
    let [e, c1, e0] = [400.0, 200.0, 900.0];
    for (tip, exponent) in TIPS {
        let (experiment, _) = read(&format!("[indenter]\n{tip}"), "", &pressed(|_| 10.0)).expect("a record");
        let problem = problem(experiment, "burgers");
        let names: Vec<&str> = problem.model.parameters().iter().map(|spec| spec.name).collect();
        let value = |name: &&str| match *name {
            "young_modulus_pa" => e,
            "viscosity_1_pa_s" => c1,
            "viscosity_2_pa_s" => 1e15,
            "instantaneous_modulus_pa" => e0,
            "position-offset.offset_m" => 3e-7,
            other => panic!("{other}"),
        };
        let found_m = positions(&problem, &names.iter().map(value).collect::<Vec<f64>>());
        let record = &problem.experiment.record;
        for (row, found_m) in found_m.iter().enumerate().skip(1) {
            let time_s = record.time_s[row] - record.time_s[0];
            let creep = 1.0 / e0 - (-time_s * e / c1).exp_m1() / e;
            let depth_m = (compliance(exponent) * 10e-9 * creep).powf(1.0 / exponent);
            assert!(((found_m - 3e-7) / depth_m - 1.0).abs() < 1e-9, "p = {exponent}, row {row}: {found_m}");
        }
    }
}

/// A force ramp on a Lethersich body: δ^p = k r ∫₀ᵗ J, with J integrated in closed form by hand. The force holds its mean over each interval, an error of (Δt)² times the
/// curvature: below 2·10⁻⁵ after the first twenty rows.
#[test]
fn a_ramp_is_the_integral_of_the_creep() {
    let [e, c1, c2] = LAW;
    for (tip, exponent) in TIPS {
        let (experiment, _) =
            read(&format!("[indenter]\n{tip}"), "", &pressed(|t| 5.0 * (t + 0.005))).expect("a record");
        let problem = problem(experiment, "lethersich");
        let found_m = positions(&problem, &[e, c1, c2, 0.0]);
        let record = &problem.experiment.record;
        for (row, found_m) in found_m.iter().enumerate().skip(20) {
            let (t, tau) = (record.time_s[row], c1 / e);
            let integral = (t + tau * (-t / tau).exp_m1()) / e + 0.5 * t * t / c2;
            let depth_m = (compliance(exponent) * 5e-9 * integral).powf(1.0 / exponent);
            assert!((found_m / depth_m - 1.0).abs() < 2e-4, "p = {exponent}, row {row}: {found_m} {depth_m}");
        }
        // The held force steps themselves, by time steps.
        let strains = strains(&record.time_s, &record.force_n, LAW);
        for row in 1..record.n_rows() {
            let depth_m = (compliance(exponent) * strains[row]).powf(1.0 / exponent);
            assert!(
                (found_m[row] / depth_m - 1.0).abs() < 1e-7,
                "p = {exponent}, row {row}: {} {depth_m}",
                found_m[row]
            );
        }
    }
}

/// A flat punch is an instrument of the compliance (1 − ν²)/(2a).
#[test]
fn a_flat_punch_is_an_instrument() {
    let csv = pressed(|t| 4.0 + (3.0 * t).sin());
    let (punch, _) = read("[indenter]\nexponent = 1\npunch_radius_um = 5", "", &csv).expect("a record");
    let given = format!("[instrument]\ncompliance_per_m = {}", 0.75 / (2.0 * RADIUS_M));
    let (instrument, _) = read(&given, "", &csv).expect("a record");
    assert_eq!(punch.record.time_s, instrument.record.time_s);
    let punch_m = positions(&problem(punch, "lethersich"), &[400.0, 200.0, 3000.0, 0.0]);
    let instrument_m = positions(&problem(instrument, "lethersich"), &LAW);
    let amplitude_m = instrument_m.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    assert!(punch_m.iter().zip(&instrument_m).all(|(a, b)| (a - b).abs() < 1e-12 * amplitude_m));
}

/// Approach, hold and retraction of a sphere at 100 Hz: 1 s free, 1.5 s with the force growing as (t/1.5)^1.5 to 10 nN, 3 s of hold, 1 s of retraction. The free tip shows 11.2 nN. Heights
/// decrease as the tip goes in and are 40 µm at contact.
fn indentation(exponent: f64, force_sd_nn: f64, position_sd_um: f64, seed: u64) -> String {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let normal = Normal::new(0.0, 1.0).expect("a spread");
    let (n_free, n_growing, n_pressed, n_rows) = (100, 250, 550, 650);
    let time_s: Vec<f64> = (0..n_rows).map(|i| 0.01 * i as f64).collect();
    let pressing_n = |row: usize| match row {
        row if row < n_free || row >= n_pressed => 0.0,
        row if row < n_growing => 10e-9 * ((row - n_free + 1) as f64 / (n_growing - n_free) as f64).powf(1.5),
        _ => 10e-9,
    };
    let force_n: Vec<f64> = (0..n_rows).map(pressing_n).collect();
    let strains = strains(&time_s[..n_pressed], &force_n[..n_pressed], LAW);
    let mut csv = String::from("Time [s],Force [nN],Height [um]\n");
    for row in 0..n_rows {
        let depth_um = match row {
            row if row < n_free => 0.1 * (row as f64 - n_free as f64),
            row if row < n_pressed => 1e6 * (compliance(exponent) * strains[row]).powf(1.0 / exponent),
            _ => {
                1e6 * (compliance(exponent) * strains[n_pressed - 1]).powf(1.0 / exponent)
                    - 0.1 * (row - n_pressed + 1) as f64
            }
        };
        let force_nn = 11.2 + 1e9 * force_n[row] + force_sd_nn * normal.sample(&mut random);
        let height_um = 40.0 - depth_um + position_sd_um * normal.sample(&mut random);
        csv += &format!("{},{force_nn:.7},{height_um:.7}\n", time_s[row]);
    }
    csv
}

const COLUMNS: &str = "direction = \"-\"\ncycle_starts_s = [0, 4.5]\n[measurement.columns]\ntime = \"Time [s]\"\nforce = \"Force [nN]\"\nposition = \"Height [um]\"";

/// Twenty-four noisy indentations per tip, fitted over the approach and two seconds of the hold. With δ the errors of ln E, ln c₁, ln c₂ and b, Σ δᵀC⁻¹δ is χ² with 96 degrees of freedom. Each asserted
/// end is exceeded falsely once in a million. The uncertainty of the force from the free tip's scatter (10⁻⁵ of it) moves no parameter by a tenth of its error.
#[test]
fn known_parameters_come_back() {
    const N_RECORDS: u64 = 24;
    for (tip, exponent) in [TIPS[0], TIPS[1]] {
        let distance = |seed: u64| {
            let csv = indentation(exponent, 1e-4, 3e-3, seed);
            let (experiment, files) =
                read(&format!("[indenter]\n{tip}"), &format!("noise_um = 0.003\n{COLUMNS}"), &csv).expect("a record");
            assert_eq!((experiment.calibration_cycles.clone(), experiment.heldout_cycles.clone()), (vec![1], vec![2]));
            assert!(files.notes.iter().any(|note| matches!(note, Note::Contact { n_after, .. } if *n_after >= 99)));
            assert!(!files.notes.iter().any(|note| matches!(note, Note::TipUnknown { .. })));
            let found = fit::run(&problem(experiment, "lethersich"), None, &SilentMonitor).expect("a fit");
            assert!(found.summary.converged, "{seed}: {:?}", found.summary);
            let names: Vec<&str> = found.summary.parameters.iter().map(|p| p.name.as_str()).collect();
            assert_eq!(names[3], "position-offset.offset_m");
            // Positions count from the start of the record, which is contact or a row or two before it.
            let n_before = files.notes.iter().find_map(|note| match note {
                Note::Contact { n_before, .. } => Some(*n_before),
                _ => None,
            });
            let origin: Vec<f64> = csv
                .lines()
                .nth(1 + n_before.expect("a note"))
                .expect("a row")
                .split(',')
                .map(|x| x.parse().expect("a number"))
                .collect();
            let contact_m = 1e-6 * (origin[2] - 40.0);
            let value = |k: usize| found.summary.parameters[k].value;
            let mut delta = nalgebra::DVector::from_fn(4, |k, _| if k < 3 { (value(k) / LAW[k]).ln() } else { 0.0 });
            let error_m = found.summary.parameters[3].standard_error.expect("an error");
            // The covariance is in the search's coordinates; for b, in units derived from its error.
            let covariance = nalgebra::DMatrix::from_row_slice(4, 4, &found.covariance);
            delta[3] = (value(3) - contact_m) / error_m * covariance[(3, 3)].sqrt();
            delta.dot(&covariance.cholesky().expect("positive").solve(&delta))
        };
        let sum: f64 = (0..N_RECORDS).into_par_iter().map(|seed| distance(100 + seed)).sum();
        let chi = ChiSquared::new(4.0 * N_RECORDS as f64).expect("degrees of freedom");
        let ends = [chi.inverse_cdf(1e-6), chi.inverse_cdf(1.0 - 1e-6)];
        assert!((ends[0]..ends[1]).contains(&sum), "p = {exponent}: {sum} is not within {ends:?}");
    }
}

/// Without its approach, a record begins in the hold. A tip that was free for few rows has its approach, although the force of the free tip is unknown then.
#[test]
fn a_hold_without_its_approach_is_named() {
    let csv = indentation(1.5, 1e-4, 3e-3, 1);
    for (first_row, is_missing) in [(0, false), (90, false), (300, true)] {
        let kept = csv.lines().enumerate().filter(|(line, _)| *line == 0 || *line > first_row);
        let rows: String = kept.map(|(_, line)| format!("{line}\n")).collect();
        let (experiment, files) =
            read(&format!("[indenter]\n{}", TIPS[0].0), &format!("noise_um = 0.003\n{COLUMNS}"), &rows)
                .expect("a record");
        let found = contradictions(&experiment, &files.interpretation);
        assert_eq!(found.iter().any(|own| own.kind == "approach_missing"), is_missing, "{first_row}");
    }
}

/// A camera whose zero is 2,500 µm away: the law is recovered within 5 standard errors (one failure in 4·10⁵). The remaining offset is the first position's noise.
#[test]
fn an_unknown_offset_is_fitted() {
    let law = [3.5, 1.4, 47.0];
    let time_s: Vec<f64> = (0..400).map(|i| 0.05 * f64::from(i)).collect();
    let force_n: Vec<f64> = (0..400).map(|i| if (i / 100) % 2 == 0 { 1e-6 } else { -1e-6 }).collect();
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let noise = Normal::new(0.0, 2.0).expect("a spread");
    let strains = strains(&time_s, &force_n, law);
    let mut csv = String::from("time_s,force_uN,position_um,cycle\n");
    let mut first_um = 0.0;
    for row in 0..400 {
        let exact_um = 1e6 * 549.0 * strains[row];
        let noise_um: f64 = noise.sample(&mut random);
        if row == 0 {
            first_um = exact_um + noise_um;
        }
        csv +=
            &format!("{},{},{:.5},{}\n", time_s[row], 1e6 * force_n[row], 2500.0 + exact_um + noise_um, 1 + row / 200);
    }
    let instrument = "[instrument]\ncompliance_per_m = 549.0";
    let (experiment, files) = read(instrument, "noise_um = 2.0\nzero = \"fit\"", &csv).expect("a record");
    assert!(files.notes.contains(&Note::PositionOffsetFitted));
    let found = fit::run(&problem(experiment, "lethersich"), None, &SilentMonitor).expect("a fit");
    let expected = [law[0], law[1], law[2], -1e-6 * first_um];
    for (parameter, truth) in found.summary.parameters.iter().zip(expected) {
        let error = parameter.standard_error.expect("an error");
        assert!((parameter.value - truth).abs() < 5.0 * error, "{parameter:?} for {truth}");
    }
}

#[test]
fn cycles_start_where_they_are_said_to() {
    let csv = pressed(|_| 10.0);
    let instrument = "[instrument]\ncompliance_per_m = 549.0";
    let (experiment, _) = read(instrument, "cycle_starts_s = [0, 1.5, 3]", &csv).expect("a record");
    let starts = |cycle: u32| experiment.record.cycle.iter().position(|index| *index == cycle).expect("a cycle");
    assert_eq!([1, 2, 3].map(starts), [0, 150, 300]);
    let refused = |measurement: &str, csv: &str, words: &[&str]| {
        let message = read(instrument, measurement, csv).expect_err("refused").to_string();
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
    };
    refused("cycle_starts_s = [0, 3, 1]", &csv, &["line 8", "do not ascend"]);
    refused("cycle_starts_s = []", &csv, &["line 8", "do not ascend"]);
    refused("cycle_starts_s = [0, 9]", &csv, &["line 8", "the cycle that starts at 9 s has no rows"]);
    refused("cycle_starts_s = [0, \"x\"]", &csv, &["cycle_starts_s", "numbers"]);
    let with_cycles = "time_s,force_uN,position_um,cycle\n".to_string()
        + &(0..20).map(|i| format!("{i},1,{i},1\n")).collect::<String>();
    refused("cycle_starts_s = [0]", &with_cycles, &["also has a `cycle` column", "remove `cycle_starts_s`"]);
}

#[test]
fn what_an_indenter_cannot_have_is_refused() {
    let refused = |apparatus: &str, measurement: &str, words: &[&str]| {
        let csv = indentation(1.5, 1e-4, 3e-3, 1);
        let message = read(apparatus, measurement, &csv).expect_err("refused").to_string();
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
    };
    let sphere = "[indenter]\nexponent = 1.5";
    refused(sphere, &format!("zero = \"first\"\n{COLUMNS}"), &["zero", "contact point", "fitted"]);
    refused(sphere, &COLUMNS.replace("\"-\"", "\"+\""), &["falls by", "direction = \"-\""]);
    refused(
        sphere,
        &COLUMNS.replace("[0, 4.5]", "[0, 0.2, 4.5]"),
        &["contact begins only in cycle 2", "cycle_starts_s"],
    );
    refused(&format!("{sphere}\n[instrument]\ncompliance_per_m = 1.0"), COLUMNS, &["both [indenter] and [instrument]"]);
    // Effects that act on a linear position cannot be added.
    let (experiment, files) = read(sphere, COLUMNS, &indentation(1.5, 1e-4, 3e-3, 1)).expect("a record");
    assert!(files.notes.iter().any(|note| matches!(note, Note::TipUnknown { .. })));
    let effects = ["force-gradient".to_string()];
    let specification =
        ModelSpecification::default().with_options(None, &effects, &[], Some("generic"), &[]).expect("a model");
    let error = Problem::new(experiment, specification, None, &SilentMonitor).err().expect("refused").to_string();
    assert!(error.contains("force-gradient") && error.contains("indenter"), "{error}");
}
