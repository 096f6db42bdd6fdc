//! A separately logged force: it is exact if it switches between samples, as a force or as a coil's current. Tables that cannot be aligned are refused with a remedy.

use std::path::{Path, PathBuf};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use vitreo_uq::posterior::fit;
use vitreo_uq::posterior::monitor::SilentMonitor;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::study::ModelSpecification;
use vitreo_uq::record::Experiment;

const TRUTH: [f64; 3] = [3.5, 1.4, 47.0];
const COMPLIANCE_PER_M: f64 = 549.0;
/// Time (s) and force (µN) of every switch; none coincides with a sample.
const SWITCHES: [(f64, f64); 6] =
    [(0.013, 4.6), (2.487, -4.6), (5.021, 2.3), (7.533, 0.0), (9.969, 4.6), (12.511, -2.3)];
const N_ROWS: usize = 300;
const INTERVAL_S: f64 = 0.05;

/// Position in µm at a time: the superposition of the law's creep, written out.
fn position_um(t: f64) -> f64 {
    let [e, c1, c2] = TRUTH;
    let creep = |age: f64| (1.0 - (-age * e / c1).exp()) / e + age / c2;
    let before = std::iter::once(0.0).chain(SWITCHES.iter().map(|switch| switch.1));
    let changes = SWITCHES.iter().zip(before).map(|((at, to), from)| (*at, to - from));
    COMPLIANCE_PER_M * changes.filter(|(at, _)| *at < t).map(|(at, change)| change * creep(t - at)).sum::<f64>()
}

struct Files {
    folder: tempfile::TempDir,
}

impl Files {
    /// Directory of an experiment with noise (µm) in the camera's rows, a force log and its TOML lines.
    fn new(noise_um: f64, seed: u64, camera_zero_s: f64, log: &str, actuation: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut csv = String::from("time_s,position_um,cycle\n");
        for row in 0..N_ROWS {
            let t = INTERVAL_S * row as f64;
            let noise: f64 = rng.sample(StandardNormal);
            csv += &format!("{:.3},{:.9},{}\n", camera_zero_s + t, position_um(t) + noise_um * noise, 1 + row / 200);
        }
        let toml = format!(
            "[specimen]\nid = \"log\"\n[instrument]\ncompliance_per_m = {COMPLIANCE_PER_M}\n[measurement]\nfile = \"camera.csv\"\n\
             calibration_cycles = [1, 2]\nsource = \"synthetic: superposition\"\n{actuation}"
        );
        let files = Self { folder };
        for (name, text) in [("experiment.toml", toml.as_str()), ("camera.csv", &csv), ("coil.csv", log)] {
            std::fs::write(files.path().join(name), text).expect("a file");
        }
        files
    }

    fn path(&self) -> PathBuf {
        self.folder.path().to_path_buf()
    }

    fn experiment(&self) -> Experiment {
        Experiment::read(Path::new(&self.path())).expect("a sound experiment").0
    }

    fn refusal(&self) -> String {
        Experiment::read(Path::new(&self.path())).expect_err("refused").to_string()
    }
}

const OF_FORCE: &str = "[actuation]\nfile = \"coil.csv\"\n[actuation.columns]\ntime = \"t_ms\"\nforce = \"F_nN\"\n";

fn log_of_force() -> String {
    let rows = SWITCHES.iter().map(|(t, force_un)| format!("{:.0},{:.0}\n", 1e3 * t, 1e3 * force_un));
    format!("t_ms,F_nN\n{}", rows.collect::<String>())
}

/// Fitted parameters over the true ones.
fn ratios(experiment: Experiment) -> [f64; 3] {
    let problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).expect("a problem");
    let summary = fit::run(&problem, None, &SilentMonitor).expect("a fit").summary;
    std::array::from_fn(|k| summary.parameters[k].value / TRUTH[k])
}

#[test]
fn switches_between_samples_are_exact() {
    let experiment = Files::new(0.0, 1, 0.0, &log_of_force(), OF_FORCE).experiment();
    let record = &experiment.record;
    assert_eq!((record.n_rows(), record.n_samples()), (N_ROWS + SWITCHES.len(), N_ROWS));
    let switched: Vec<(f64, f64)> =
        record.force_rows.iter().map(|&row| (record.time_s[row], record.force_n[row])).collect();
    assert_eq!(switched, SWITCHES.map(|(t, force_un)| (t, force_un / 1e6)));
    assert!((record.median_interval_s().expect("rows") - INTERVAL_S).abs() < 1e-12);
    for ratio in ratios(experiment) {
        assert!((ratio - 1.0).abs() < 1e-6, "{ratio}");
    }
}

/// The forces as a current with an offset and a square, on a clock with another zero, in a table with semicolons and decimal commas.
#[test]
fn a_current_is_calibrated_on_the_cameras_clock() {
    let calibration = [1e-7, 2e-6, 1e-7];
    let current_a = |force_n: f64| {
        let [a0, a1, a2] = calibration;
        ((a1 * a1 - 4.0 * a2 * (a0 - force_n)).sqrt() - a1) / (2.0 * a2)
    };
    let rows = std::iter::once((-1.0, 0.0)).chain(SWITCHES);
    let row = |(t, force_un): (f64, f64)| {
        format!("{:.6};{:.9}\n", 100.0 + t, 1e3 * current_a(1e-6 * force_un)).replace('.', ",")
    };
    let log = format!("t;I\n{}", rows.map(row).collect::<String>());
    let actuation = "[actuation]\nfile = \"coil.csv\"\ndelimiter = \";\"\ndecimal = \",\"\nforce = \"hold\"\ncalibration = [1e-7, 2e-6, 1e-7]\n\
                     [actuation.columns]\ntime = \"t\"\ncurrent = \"I\"\n[actuation.units]\ntime = \"s\"\ncurrent = \"mA\"\n";
    let experiment = Files::new(0.0, 1, 100.0, &log, actuation).experiment();
    for ratio in ratios(experiment) {
        assert!((ratio - 1.0).abs() < 1e-5, "{ratio}");
    }
}

/// The noise is 4 µm. The mean of 20 fits is within 4 of its standard errors, about 3·10⁻³ each, of the truth; false failures 2 in 10,000. The camera's own rows show each
/// force switch at the next sample, which biases the fit by more than that.
#[test]
fn a_log_leaves_no_bias_where_the_cameras_rows_do() {
    let mut sums = [[0.0; 3]; 2];
    let n = 20;
    for seed in 0..n {
        let logged = Files::new(4.0, seed, 0.0, &log_of_force(), OF_FORCE).experiment();
        let mut sampled = logged.clone();
        let record = &mut sampled.record;
        let keep: Vec<usize> = (0..record.n_rows()).filter(|row| !record.force_rows.contains(row)).collect();
        record.time_s = keep.iter().map(|&row| record.time_s[row]).collect();
        record.force_n = keep.iter().map(|&row| record.force_n[row]).collect();
        record.position_m = keep.iter().map(|&row| record.position_m[row]).collect();
        record.cycle = keep.iter().map(|&row| record.cycle[row]).collect();
        record.force_rows.clear();
        for (sum, experiment) in sums.iter_mut().zip([logged, sampled]) {
            ratios(experiment).iter().zip(sum).for_each(|(ratio, sum)| *sum += (ratio - 1.0) / n as f64);
        }
    }
    println!("mean errors with the log {:?}, without {:?}", sums[0], sums[1]);
    assert!(sums[0].iter().all(|error| error.abs() < 0.01), "{:?}", sums[0]);
    assert!(sums[1].iter().any(|error| error.abs() > 0.02), "{:?}", sums[1]);
}

#[test]
fn what_cannot_be_brought_together_is_refused() {
    let refusal = |log: &str, actuation: &str| Files::new(0.0, 1, 0.0, log, actuation).refusal();
    let later = "t_ms,F_nN\n90000,4600\n95000,0\n";
    for (log, actuation, words) in [
        (later, OF_FORCE.to_string(), "one clock"),
        (&log_of_force(), format!("{OF_FORCE}current = 2\n"), "a force and a current"),
        (&log_of_force(), OF_FORCE.replace("F_nN", "G_nN"), "lacks this column"),
        (
            &log_of_force(),
            OF_FORCE.replace("F_nN\"\n", "F_nN\"\n[actuation.units]\nforce = \"T\"\n"),
            "`T` is not a unit of this quantity",
        ),
        (
            &log_of_force(),
            OF_FORCE.replace("file =", "calibration = [1.0]\nfile ="),
            "the calibration converts a current",
        ),
        (&log_of_force(), OF_FORCE.replace("coil.csv", "../coil.csv"), "plain path"),
        (&log_of_force(), OF_FORCE.replace("coil.csv", "gone.csv"), "gone.csv"),
        ("t_ms,I_mA\n13,1\n2000,2\n", OF_FORCE.replace("force = \"F_nN\"", "current = \"I_mA\""), "calibration"),
    ] {
        let found = refusal(log, &actuation);
        assert!(found.contains(words), "{words}: {found}");
    }
}
