//! Forces of every shape, continuous in time and not as the rows show them. Fits under the experiment's force rule are unbiased, and their intervals cover the truth as stated.
//!
//! The motion comes from Runge–Kutta steps on the law's definition, a hundredth of a row long, under the continuous force.

use std::f64::consts::PI;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use vitreo_uq::posterior::check::contradictions;
use vitreo_uq::posterior::fit;
use vitreo_uq::posterior::monitor::SilentMonitor;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::study::ModelSpecification;
use vitreo_uq::record::{Experiment, Interpretation};

/// E (Pa), c₁, c₂ (Pa·s).
const TRUTH: [f64; 3] = [3.5, 1.4, 47.0];
const COMPLIANCE_PER_M: f64 = 549.0;
const FORCE_UN: f64 = 4.6;
const NOISE_UM: f64 = 4.0;
const INTERVAL_S: f64 = 0.02;
const N_ROWS: usize = 1000;
const STEPS_A_ROW: usize = 100;
/// Half width of the 90 % interval of a standard normal.
const Z_90: f64 = 1.644_854;

/// A drive: the experiment's force rule, and the force in µN at a time in s.
struct Drive {
    name: &'static str,
    rule: &'static str,
    force_un: Box<dyn Fn(f64) -> f64>,
}

fn drives() -> Vec<Drive> {
    // Random holds of about a second, which switch at rows.
    let mut rng = ChaCha8Rng::seed_from_u64(17);
    let mut signs = vec![1.0_f64];
    while signs.len() < N_ROWS {
        let last = signs[signs.len() - 1];
        signs.push(if rng.random::<f64>() < INTERVAL_S { -last } else { last });
    }
    let linear = |name, force_un| Drive { name, rule: "linear", force_un };
    vec![
        linear("sine", Box::new(|t: f64| (2.0 * PI * 0.25 * t).sin())),
        linear("triangle", Box::new(|t: f64| 1.0 - 4.0 * ((0.2 * t).fract() - 0.5).abs())),
        linear("ramp", Box::new(|t: f64| 0.1 * t - 0.7)),
        // Up to 0.5 Hz: lines between 100 rows per period are smaller than a sine by (2π/100)²/12 of it, 0.03 %.
        linear("chirp", Box::new(|t: f64| (2.0 * PI * (0.1 + 0.01 * t) * t).cos())),
        Drive {
            name: "random telegraph",
            rule: "hold",
            force_un: Box::new(move |t: f64| signs[((t / INTERVAL_S + 1e-6) as usize).min(N_ROWS - 1)]),
        },
    ]
}

/// Position (µm) at every row without noise, as the limit from the left: c₁ ẏ + E y = F, ż = F/c₂ by the classical Runge–Kutta method.
fn motion_um(drive: &Drive) -> Vec<f64> {
    let [e, c1, c2] = TRUTH;
    let step_s = INTERVAL_S / STEPS_A_ROW as f64;
    let (mut y, mut z, mut found) = (0.0, 0.0, vec![0.0]);
    for row in 0..N_ROWS - 1 {
        for k in 0..STEPS_A_ROW {
            let t = INTERVAL_S * row as f64 + step_s * k as f64;
            // A force that jumps at the row's end does so after it.
            let force = |share: f64| FORCE_UN * (drive.force_un)(t + share.min(1.0 - 1e-6) * step_s);
            let (f0, f1, f2) = (force(0.0), force(0.5), force(1.0));
            let rate = |f: f64, y: f64| (f - e * y) / c1;
            let k1 = rate(f0, y);
            let k2 = rate(f1, y + 0.5 * step_s * k1);
            let k3 = rate(f1, y + 0.5 * step_s * k2);
            let k4 = rate(f2, y + step_s * k3);
            y += step_s / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
            z += step_s / 6.0 * (f0 + 4.0 * f1 + f2) / c2;
        }
        found.push(COMPLIANCE_PER_M * (y + z));
    }
    found
}

fn experiment(drive: &Drive, rule: &str, motion_um: &[f64], seed: u64) -> Experiment {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut csv = String::from("time_s,force_uN,position_um,cycle\n");
    for (row, x) in motion_um.iter().enumerate() {
        let t = INTERVAL_S * row as f64;
        let noise: f64 = rng.sample(StandardNormal);
        let cycle = 1 + usize::from(row >= N_ROWS / 2);
        csv += &format!("{t:.2},{:.9},{:.6},{cycle}\n", FORCE_UN * (drive.force_un)(t), x + NOISE_UM * noise);
    }
    let toml = format!(
        "[specimen]\nid = \"drive\"\n[instrument]\ncompliance_per_m = {COMPLIANCE_PER_M}\n[measurement]\nfile = \"drive.csv\"\nforce = \"{rule}\"\n\
         calibration_cycles = [1, 2]\nnoise_um = {NOISE_UM}\nsource = \"synthetic: Runge–Kutta\"\n"
    );
    Experiment::from_texts("experiment.toml", toml, "drive.csv", csv).expect("a sound experiment").0
}

/// Errors of E, c₁ and c₂ in their standard errors.
fn standardised(experiment: Experiment) -> [f64; 3] {
    let problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).expect("a problem");
    let summary = fit::run(&problem, None, &SilentMonitor).expect("a fit").summary;
    std::array::from_fn(|k| {
        let found = &summary.parameters[k];
        (found.value - TRUTH[k]) / found.standard_error.expect("determined")
    })
}

/// Asserts coverage and mean error (in its own standard error) for every drive and parameter.
fn assert_unbiased(n_replicates: u64, covered_between: [usize; 2], largest_mean: f64) {
    for drive in drives() {
        let motion_um = motion_um(&drive);
        let of = |seed: u64| standardised(experiment(&drive, drive.rule, &motion_um, seed));
        let errors: Vec<[f64; 3]> = (0..n_replicates).map(of).collect();
        for (k, name) in ["E", "c1", "c2"].into_iter().enumerate() {
            let covered = errors.iter().filter(|error| error[k].abs() < Z_90).count();
            let mean = errors.iter().map(|error| error[k]).sum::<f64>() / (n_replicates as f64).sqrt();
            println!(
                "{:<18}{name:<4}{covered} of {n_replicates} covered, mean error {mean:+.2} standard errors",
                drive.name
            );
            assert!((covered_between[0]..=covered_between[1]).contains(&covered), "{} {name}: {covered}", drive.name);
            assert!(mean.abs() < largest_mean, "{} {name}: {mean}", drive.name);
        }
    }
}

/// 30 replicates: a correct interval covers 21 to 30 with probability 0.9998, and a mean exceeds 4 standard errors with 6·10⁻⁵. With 15 of each, 4 in 1000 runs fail falsely.
#[test]
fn forces_of_any_shape_are_fitted_without_bias() {
    assert_unbiased(30, [21, 30], 4.0);
}

/// 200 replicates: a correct interval covers 164 to 195 of them with probability 0.9997; 5 in 1000 runs fail falsely for all 15. Compare the printed coverage with 85 to 95 %. Lines between
/// 200 rows per period are smaller than a sine by (2π/200)²/12 = 8·10⁻⁵. E is too low by this fraction, a quarter of its standard error here.
#[test]
#[ignore = "campaigns/long-tests: 1,000 fits"]
fn forces_of_any_shape_are_covered_in_200_replicates() {
    assert_unbiased(200, [164, 195], 4.0);
}

/// A warning names too few rows of a sine with lines between them. The corners of a triangle are not taken for a curve.
#[test]
fn too_few_rows_of_a_curve_are_said() {
    for (name, every, is_said) in [("sine", 1, false), ("sine", 4, true), ("triangle", 4, false), ("ramp", 4, false)] {
        let drive = drives().into_iter().find(|drive| drive.name == name).expect("a drive");
        let mut experiment = experiment(&drive, "linear", &motion_um(&drive), 3);
        let record = &mut experiment.record;
        let keep = |row: &usize| row.is_multiple_of(every);
        let kept = |values: &[f64]| (0..values.len()).filter(keep).map(|row| values[row]).collect::<Vec<f64>>();
        if every > 1 {
            // Rows inserted at zero crossings of the force are removed with the omitted rows.
            let kept_rows: Vec<usize> = (0..record.n_rows()).filter(|row| !record.force_rows.contains(row)).collect();
            for values in [&mut record.time_s, &mut record.force_n] {
                *values = kept(&kept_rows.iter().map(|&row| values[row]).collect::<Vec<f64>>());
            }
            record.position_m = kept_rows.iter().map(|&row| record.position_m[row]).step_by(every).collect();
            record.cycle = kept_rows.iter().map(|&row| record.cycle[row]).step_by(every).collect();
            record.force_rows.clear();
        }
        let understood = Interpretation { force_rule_given: true, ..Interpretation::default() };
        let kinds: Vec<String> = contradictions(&experiment, &understood).into_iter().map(|one| one.kind).collect();
        assert_eq!(kinds.contains(&"curve_between_rows".to_string()), is_said, "{name} {every}: {kinds:?}");
    }
}

/// Fits of the records under the wrong rule are biased by many standard errors, so the tests above can fail.
#[test]
fn a_force_held_that_goes_in_lines_is_biased() {
    for drive in drives().into_iter().filter(|drive| drive.rule == "linear") {
        let motion_um = motion_um(&drive);
        let largest = (0..5)
            .map(|seed| standardised(experiment(&drive, "hold", &motion_um, seed)))
            .fold([0.0; 3], |sum, error| std::array::from_fn(|k| sum[k] + error[k] / 5_f64.sqrt()))
            .into_iter()
            .fold(0.0_f64, |most, mean| most.max(mean.abs()));
        println!("{:<18}held: {largest:.1} standard errors", drive.name);
        assert!(largest > 6.0, "{}: {largest}", drive.name);
    }
}
