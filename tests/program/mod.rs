//! Runs the built program as a newcomer does: in an empty directory, with arguments.
#![allow(dead_code, reason = "each test file uses its own part")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

/// Result of a run of the program.
pub struct Run {
    /// Exit code.
    pub code: i32,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

impl Run {
    /// Standard output as one JSON document.
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{error} in {self}"))
    }

    /// Checks the exit code.
    #[track_caller]
    pub fn exits(self, code: i32) -> Self {
        assert_eq!(self.code, code, "{self}");
        self
    }

    /// Checks that the run was refused with exit code 2, contains all of `words` and has a remedy.
    #[track_caller]
    pub fn refuses(self, words: &[&str]) -> Self {
        let run = self.exits(2);
        assert_eq!(run.stdout, "", "{run}");
        for word in words {
            assert!(run.stderr.contains(word), "`{word}` is missing in {run}");
        }
        run
    }
}

impl std::fmt::Display for Run {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "exit code {}\n--- stdout\n{}\n--- stderr\n{}", self.code, self.stdout, self.stderr)
    }
}

/// Runs the program in a directory.
pub fn vitreo(dir: &Path, arguments: &[&str]) -> Run {
    run(Command::new(env!("CARGO_BIN_EXE_vitreo-uq")).current_dir(dir).args(arguments))
}

/// Runs the program with its model cache below the directory; without a cache if `cache` is empty.
pub fn vitreo_with_cache(dir: &Path, cache: &str, arguments: &[&str]) -> Run {
    let program = env!("CARGO_BIN_EXE_vitreo-uq");
    run(Command::new(program).current_dir(dir).args(arguments).env("VITREO_UQ_CACHE", cache))
}

/// Runs a command of the program.
pub fn run(command: &mut Command) -> Run {
    let output: Output = command.output().expect("the program was built for this test");
    Run {
        code: output.status.code().unwrap_or(-1),
        stdout: String::from_utf8(output.stdout).expect("output is UTF-8"),
        stderr: String::from_utf8(output.stderr).expect("output is UTF-8"),
    }
}

/// All files below a directory with their bytes, by relative path.
pub fn tree(dir: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    fn collect(root: &Path, dir: &Path, files: &mut BTreeMap<PathBuf, Vec<u8>>) {
        for entry in std::fs::read_dir(dir).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                collect(root, &path, files);
            } else {
                files.insert(path.strip_prefix(root).unwrap().to_path_buf(), std::fs::read(&path).unwrap());
            }
        }
    }
    let mut files = BTreeMap::new();
    collect(dir, dir, &mut files);
    files
}

/// Nearly normal numbers by a fixed recurrence: twelve uniform ones minus six.
pub fn normals() -> impl FnMut() -> f64 {
    let mut state = 88_172_645_463_325_252_u64;
    let mut uniform = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    move || (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}

/// Writes an instrument's experiment into `dir`: two cycles of ±1 µN for 2 s each, E = 3.5 Pa, c₁ = 1.4 Pa·s, c₂ = 47 Pa·s, 0.5 µm of noise
/// by a fixed recurrence, and `drift_um_per_s` from the second cycle on. The second cycle is held out if `heldout` is set.
pub fn write_instrument_experiment(dir: &Path, heldout: bool, drift_um_per_s: f64) {
    std::fs::create_dir_all(dir).unwrap();
    let mut toml = String::from(
        "[specimen]\nid = \"gel\"\n[instrument]\ncompliance_per_m = 549.0\n[measurement]\nfile = \"trajectory.csv\"\n",
    );
    toml += if heldout {
        "calibration_cycles = [1]\nheldout_cycles = [2]\n"
    } else {
        "calibration_cycles = [1, 2]\nheldout_cycles = []\n"
    };
    toml += "noise_um = 0.5\nsource = \"synthetic: closed form\"\n";
    std::fs::write(dir.join("experiment.toml"), toml).unwrap();
    let (young_modulus_pa, viscosity_1_pa_s, viscosity_2_pa_s, compliance_per_m) = (3.5, 1.4, 47.0, 549.0);
    let mut normal = normals();
    let mut csv = String::from("time_s,force_uN,position_um,cycle\n");
    let (mut retarded_un, mut impulse_un_s) = (0.0, 0.0);
    let step_s = 0.04;
    let decay = f64::exp(-step_s * young_modulus_pa / viscosity_1_pa_s);
    for row in 0..200 {
        let force_un = if (row / 50) % 2 == 0 { 1.0 } else { -1.0 };
        let noise_um = 0.5 * normal();
        let exact_um = compliance_per_m * (retarded_un / young_modulus_pa + impulse_un_s / viscosity_2_pa_s);
        let drift_um = drift_um_per_s * step_s * f64::from((row - 100).max(0));
        csv += &format!(
            "{:.2},{force_un},{:.4},{}\n",
            step_s * f64::from(row),
            exact_um + noise_um + drift_um,
            1 + row / 100
        );
        retarded_un = decay * retarded_un + (1.0 - decay) * force_un;
        impulse_un_s += step_s * force_un;
    }
    std::fs::write(dir.join("trajectory.csv"), csv).unwrap();
}

/// Puts a study of [`drifting_replica`] with m0, and m1 with the drift, into a directory. Returns the document of `extend`. The study is made once for all tests of a program.
pub fn put_extended_replica(study: &Path) -> &'static Value {
    static MADE: std::sync::OnceLock<(BTreeMap<PathBuf, Vec<u8>>, Value)> = std::sync::OnceLock::new();
    let (files, said) = MADE.get_or_init(|| {
        let place = tempfile::tempdir().unwrap();
        let experiment = drifting_replica(place.path());
        let path = experiment.to_str().unwrap();
        let run = vitreo(place.path(), &["extend", path, "--with", "tracking-drift", "--json", "-", "--out", "a"]);
        let said = run.exits(0).json();
        (tree(&place.path().join("a")), said)
    });
    for (name, bytes) in files {
        let path = study.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
    said
}

/// Velocity of the drift of [`drifting_replica`].
pub const DRIFT_UM_PER_S: f64 = 1.0;

/// Writes the replica as the experiment of another specimen into `experiment`.
pub fn replica_with_id(experiment: &Path, id: &str) {
    let replica = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/porcine-replica");
    std::fs::create_dir_all(experiment).unwrap();
    let toml = std::fs::read_to_string(replica.join("experiment.toml")).unwrap();
    let toml = toml.replace("id = \"porcine-replica\"", &format!("id = \"{id}\""));
    std::fs::write(experiment.join("experiment.toml"), toml).unwrap();
    // Two specimens never have equal rows: the last position depends on the name.
    let rows = std::fs::read_to_string(replica.join("trajectory.csv")).unwrap();
    let (before, last) = rows.trim_end().rsplit_once('\n').unwrap();
    let mut cells: Vec<String> = last.split(',').map(String::from).collect();
    let shift_um: f64 = id.bytes().map(|byte| 1e-4 * f64::from(byte)).sum();
    cells[2] = format!("{:.4}", cells[2].parse::<f64>().unwrap() + shift_um);
    std::fs::write(experiment.join("trajectory.csv"), format!("{before}\n{}\n", cells.join(","))).unwrap();
}

/// Writes the replica with a drift of 1 µm/s in its positions into `dir`.
pub fn drifting_replica(dir: &Path) -> PathBuf {
    let replica = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/porcine-replica");
    let experiment = dir.join("drifting");
    std::fs::create_dir_all(&experiment).unwrap();
    let toml = std::fs::read_to_string(replica.join("experiment.toml")).unwrap();
    std::fs::write(experiment.join("experiment.toml"), toml.replace("porcine-replica", "drifting")).unwrap();
    let csv = std::fs::read_to_string(replica.join("trajectory.csv")).unwrap();
    let drift = |(index, line): (usize, &str)| {
        let mut cells: Vec<String> = line.split(',').map(String::from).collect();
        if let (true, Ok(time_s), Ok(position_um)) = (index > 0, cells[0].parse::<f64>(), cells[2].parse::<f64>()) {
            cells[2] = (position_um + DRIFT_UM_PER_S * time_s).to_string();
        }
        cells.join(",") + "\n"
    };
    let drifting: String = csv.lines().enumerate().map(drift).collect();
    std::fs::write(experiment.join("trajectory.csv"), drifting).unwrap();
    experiment
}
