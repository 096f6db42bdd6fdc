//! Reads and writes the directory of a sealed challenge. It contains an experiment, the sealed answer, and the answer's hash, which is written first.

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::full_order::trajectories_m;
use super::protocol::WHITE_M;
use super::seal::{SALT_BYTES, Sealed, open, seal};
use super::{Bench, Noise, Truth, TruthRequest};
use base::error::{Error, InputPlace, Result, Setting};
use base::files::{self, Content, TemporaryDirectory, write_atomically, write_json_atomically};
use base::sha256::sha256_hex;
use posterior::monitor::Monitor;
use record::{Apparatus, Record, RobotShape, density_toml};
use sampling::ensemble::RandomStream;

/// Name of the file with the hash of salt and answer. This file is written first.
pub const COMMITMENT_FILE: &str = "commitment.sha256";
/// Name of the file with the sealed answer.
pub const SEALED_FILE: &str = "sealed.json";
/// Beginning of the comment in `experiment.toml` that repeats the hash.
const COMMENT: &str = "# Sealed answer, SHA-256: ";

/// Content of a sealed answer: the truth, and data that tie it to the challenge's table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SealedAnswer {
    /// Truth that the data are simulated from.
    pub truth: Truth,
    /// SHA-256 hash of `trajectory.csv`, which ties the answer to these data.
    pub trajectory_sha256: String,
    /// Noise-free position (µm) of every row; empty in older answers, which lack this list.
    #[serde(default)]
    pub noise_free_um: Vec<f64>,
}

impl SealedAnswer {
    /// Computes the noise in the data of a CSV file. Returns `None` if the answer lacks the noise-free positions.
    fn noise(&self, csv: &str) -> Option<Noise> {
        let measured_um = csv.lines().skip(1).map(|line| line.split(',').nth(2)?.parse::<f64>().ok());
        let measured_um: Vec<Option<f64>> = measured_um.collect();
        if self.noise_free_um.is_empty() || measured_um.len() != self.noise_free_um.len() {
            return None;
        }
        let error_m = measured_um.iter().zip(&self.noise_free_um).map(|(y, x)| 1e-6 * (y.unwrap_or(*x) - x)).collect();
        let is_lost = measured_um.iter().map(Option::is_none).collect();
        Some(Noise { error_m, is_lost, stated_sd_m: WHITE_M })
    }
}

/// An opened challenge: its answer, noise and hash.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenedChallenge {
    /// The sealed answer.
    pub answer: SealedAnswer,
    /// Noise in the data; `None` if the answer lacks the noise-free positions.
    pub noise: Option<Noise>,
    /// Hash of salt and answer from the commitment file.
    pub commitment_sha256: String,
}

/// Directory, truth and seed of a challenge to create.
#[derive(Debug, Clone, PartialEq)]
pub struct ChallengeCase {
    /// Directory to create. It must not exist, or be empty.
    pub dir: PathBuf,
    /// Specification of the truth.
    pub order: TruthRequest,
    /// Seed of all random numbers. Equal specifications and seeds give equal files, independent of other challenges.
    pub seed: u64,
}

/// Creates challenges: draws every truth, runs the full-order model for all truths together, adds noise and seals the answers. Returns the hashes only, so that
/// the answers stay hidden.
///
/// # Errors
/// [`Error::Input`] if a directory is in use or a specification cannot be met; [`Error::File`] if a directory cannot be written.
pub fn make(cases: &[ChallengeCase], bench: &Bench, monitor: &dyn Monitor) -> Result<Vec<String>> {
    cases.iter().try_for_each(|case| check_place(&case.dir))?;
    monitor.stage("drawing the hidden effects and setting their signals");
    let draw = |case: &ChallengeCase| bench.draw(&case.order, &mut RandomStream::new(case.seed, 0));
    let truths: Vec<Truth> = cases.par_iter().map(draw).collect::<Result<_>>()?;
    let trajectories_m = trajectories_m(bench, &truths, None, monitor)?;
    let made = cases.iter().zip(truths).zip(trajectories_m);
    made.map(|((case, truth), position_m)| make_one(case, bench, truth, &position_m)).collect()
}

/// Creates one challenge. `position_m` holds the noise-free position (m) at every row.
fn make_one(case: &ChallengeCase, bench: &Bench, truth: Truth, position_m: &[f64]) -> Result<String> {
    let record = truth.protocol.record();
    let noise = truth.noise.draw(&record, position_m, &mut RandomStream::new(case.seed, 1));
    let csv = trajectory_csv(&record, &noise.measured_m(position_m));
    let stated_um = truth.is_noise_given.then_some(1e6 * noise.stated_sd_m);
    // With these digits the noise can be recovered to a thousandth of its size.
    let noise_free_um = position_m.iter().map(|x| (1e10 * x).round() / 1e4).collect();
    let mut salt = [0; SALT_BYTES];
    let mut stream = RandomStream::new(case.seed, 2);
    salt.chunks_mut(4).for_each(|part| part.copy_from_slice(&stream.word().to_le_bytes()));
    let answer = SealedAnswer { truth, trajectory_sha256: sha256_hex(csv.as_bytes()), noise_free_um };
    let bytes = serde_json::to_vec(&answer).map_err(|error| {
        Error::numerical(format!("the answer cannot be written as JSON: {error}"), "report the command that you ran")
    })?;
    let sealed = seal(&salt, &bytes);
    let toml = experiment_toml(bench.apparatus(), &sealed.commitment_sha256, stated_um);
    write(&case.dir, &sealed, &csv, &toml)?;
    Ok(sealed.commitment_sha256)
}

/// Writes all four files, or none of them if an error occurs.
fn write(dir: &Path, sealed: &Sealed, csv: &str, toml: &str) -> Result<()> {
    let remedy = format!("give another `{}`", Setting::Out);
    // A symbolic link stands for its target directory. The path `.` is made absolute, because it needs a name.
    let dir = &dir.canonicalize().unwrap_or_else(|_| dir.to_path_buf());
    let parent = files::folder_of(dir);
    std::fs::create_dir_all(parent).map_err(|source| Error::at_path("create", parent, source, &*remedy))?;
    let name = dir.file_name().map_or("challenge".into(), |name| name.to_string_lossy());
    let building = TemporaryDirectory::new(if dir.is_dir() { dir } else { parent }, &name)?;
    let at = |name: &str| building.path().join(name);
    write_atomically(&at(COMMITMENT_FILE), format!("{}\n", sealed.commitment_sha256).as_bytes())?;
    write_json_atomically(&at(SEALED_FILE), sealed)?;
    write_atomically(&at("trajectory.csv"), csv.as_bytes())?;
    write_atomically(&at("experiment.toml"), toml.as_bytes())?;
    building.move_to(dir, "experiment.toml", &remedy)
}

/// Checks that a directory is empty or does not exist.
///
/// # Errors
/// [`Error::Input`] if the directory is not empty.
pub fn check_place(dir: &Path) -> Result<()> {
    let is_free = match std::fs::read_dir(dir) {
        Ok(mut entries) => entries.next().is_none(),
        Err(_) => !dir.exists(),
    };
    if is_free {
        return Ok(());
    }
    Err(Error::input(
        InputPlace::setting(Setting::Out),
        format!("{} is not an empty directory", dir.display()),
        "give a directory that does not exist; a challenge never replaces files",
    ))
}

/// Opens a challenge, and checks that the answer and the data are unchanged since the hash was written.
///
/// # Errors
/// [`Error::Input`] with the file that does not match; [`Error::File`] if a file cannot be read.
pub fn open_challenge(dir: &Path) -> Result<OpenedChallenge> {
    files::forbid_links(dir, "a challenge");
    let text = |name: &str| {
        let (path, remedy) = (dir.join(name), "give the directory created by `vitreo-uq challenge new`");
        let content = if name.ends_with(".csv") { Content::Table } else { Content::Document };
        let bytes = files::read(&path, content, remedy)?;
        String::from_utf8(bytes).map_err(|_| Error::input(InputPlace::file(path), "the file is not UTF-8 text", remedy))
    };
    let refuse = |name: &str, found: &str| {
        Err(Error::input(
            InputPlace::file(dir.join(name)),
            found,
            "restore the directory as created by `vitreo-uq challenge new`; a changed challenge proves nothing",
        ))
    };
    let commitment = text(COMMITMENT_FILE)?.trim().to_string();
    let Ok(sealed) = serde_json::from_str::<Sealed>(&text(SEALED_FILE)?) else {
        return refuse(SEALED_FILE, "the file is not a sealed answer");
    };
    if sealed.commitment_sha256 != commitment {
        return refuse(SEALED_FILE, "the answer's hash differs from the one in commitment.sha256");
    }
    if !text("experiment.toml")?.lines().any(|line| line.strip_prefix(COMMENT) == Some(commitment.as_str())) {
        return refuse("experiment.toml", "its comment does not contain the hash in commitment.sha256");
    }
    let Some(answer) = open(&sealed).and_then(|bytes| serde_json::from_slice::<SealedAnswer>(&bytes).ok()) else {
        return refuse(SEALED_FILE, "the opened answer does not match its committed hash");
    };
    let csv = text("trajectory.csv")?;
    if sha256_hex(csv.as_bytes()) != answer.trajectory_sha256 {
        return refuse("trajectory.csv", "the data do not match the hash in the answer");
    }
    Ok(OpenedChallenge { noise: answer.noise(&csv), answer, commitment_sha256: commitment })
}

/// Specimen identifier of the challenge with the hash `commitment`.
pub fn specimen_id(commitment: &str) -> String {
    format!("challenge-{}", commitment.get(..8).unwrap_or(commitment))
}

fn trajectory_csv(record: &Record, measured_m: &[Option<f64>]) -> String {
    let mut csv = String::from("time_s,force_uN,position_um,cycle\n");
    for (row, position_m) in measured_m.iter().enumerate() {
        let (time_s, force_un) = (record.time_s[row], 1e6 * record.force_n[row]);
        let position_um = position_m.map_or(String::new(), |x| format!("{:.3}", 1e6 * x));
        csv += &format!("{time_s:.2},{force_un:.2},{position_um},{}\n", record.cycle[row]);
    }
    csv
}

fn experiment_toml(apparatus: &Apparatus, commitment: &str, noise_um: Option<f64>) -> String {
    let decimal = |value: f64| format!("{value:.10e}").parse::<f64>().unwrap_or(value);
    let noise =
        noise_um.map_or(String::new(), |noise_um| format!("noise_um = {:?}\n", (100.0 * noise_um).round() / 100.0));
    let of_apparatus = match apparatus {
        Apparatus::Instrument { compliance_per_m, .. } => {
            format!("[instrument]\ncompliance_per_m = {compliance_per_m}\n")
        }
        Apparatus::Indenter(indenter) => indenter.toml(),
        Apparatus::Robot { robot, vitreous } => {
            let diameter_m = match robot.shape {
                RobotShape::Sphere { diameter_m }
                | RobotShape::Ellipsoid { diameter_m, .. }
                | RobotShape::Cylinder { diameter_m, .. } => diameter_m,
            };
            format!(
                "[robot]\nshape = \"sphere\"\ndiameter_mm = {}\n{}\n[vitreous]\ndiameter_mm = {}\npoisson_ratio = {}\n{}",
                decimal(1e3 * diameter_m),
                density_toml(robot.density_kg_m3),
                decimal(1e3 * vitreous.diameter_m),
                vitreous.poisson_ratio,
                density_toml(vitreous.density_kg_m3)
            )
        }
    };
    format!(
        "# SYNTHETIC. A challenge: data by full finite elements, never by the reduced models that are fitted, plus noise. Something may be hidden\n\
         # in them. `vitreo-uq challenge reveal` opens the answer, which was sealed before the data were written.\n\
         {COMMENT}{commitment}\n\
         [specimen]\nid = \"{}\"\nspecies = \"porcine\"\n\n{of_apparatus}\n\
         [measurement]\nfile = \"trajectory.csv\"\ncalibration_cycles = [1]\nheldout_cycles = [2, 3, 4]\n{noise}\
         source = \"synthetic: full finite elements, with a sealed answer\"\n",
        specimen_id(commitment)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::challenge::{NoiseKind, Protocol};

    /// Writes a complete challenge to `dir` without running finite elements.
    fn written(dir: &Path, salt: &[u8; SALT_BYTES], law: [f64; 3]) -> Sealed {
        let truth = Truth::of_nothing(Protocol::Paper, NoiseKind::White, law);
        let mut measured_m = vec![Some(1e-6); 800];
        measured_m[7] = None;
        let csv = trajectory_csv(&Protocol::Paper.record(), &measured_m);
        let (trajectory_sha256, noise_free_um) = (sha256_hex(csv.as_bytes()), vec![0.25; 800]);
        let answer = SealedAnswer { truth, trajectory_sha256, noise_free_um };
        let sealed = seal(salt, &serde_json::to_vec(&answer).expect("JSON"));
        let toml = experiment_toml(
            &Apparatus::Instrument { compliance_per_m: 1.0, is_stress_strain: false },
            &sealed.commitment_sha256,
            Some(4.0),
        );
        for (name, text) in [
            (COMMITMENT_FILE, sealed.commitment_sha256.clone() + "\n"),
            (SEALED_FILE, serde_json::to_string(&sealed).expect("JSON")),
            ("trajectory.csv", csv),
            ("experiment.toml", toml),
        ] {
            std::fs::write(dir.join(name), text).expect("writable");
        }
        sealed
    }

    /// An older answer without noise-free positions can be opened. Its noise is unknown.
    #[test]
    fn an_older_answer_opens_without_its_noise() {
        let truth = Truth::of_nothing(Protocol::Paper, NoiseKind::White, [1.0, 2.0, 3.0]);
        let answer = SealedAnswer { truth, trajectory_sha256: String::new(), noise_free_um: vec![1.0; 800] };
        let mut json = serde_json::to_value(&answer).expect("JSON");
        json.as_object_mut().expect("an object").remove("noise_free_um");
        json["truth"].as_object_mut().expect("an object").remove("is_noise_given");
        let csv = trajectory_csv(&Protocol::Paper.record(), &vec![Some(0.0); 800]);
        let older: SealedAnswer = serde_json::from_value(json).expect("an answer");
        assert!(older.truth.is_noise_given && older.noise(&csv).is_none());
    }

    /// The experiment states the noise standard deviation if and only if the truth says so.
    #[test]
    fn the_noise_is_stated_or_left_to_be_estimated() {
        let toml = |noise_um| {
            experiment_toml(&Apparatus::Instrument { compliance_per_m: 1.0, is_stress_strain: false }, "00", noise_um)
        };
        assert!(toml(Some(4.0)).contains("\nnoise_um = 4.0\n") && toml(Some(4.729_6)).contains("\nnoise_um = 4.73\n"));
        assert!(!toml(None).contains("noise_um"));
    }

    /// A change to any of the four files is detected. An answer with other physics for the same data is also refused, even if its hash is replaced too.
    #[test]
    fn no_file_of_a_challenge_can_be_changed() {
        let folder = tempfile::tempdir().expect("a temporary directory");
        let dir = folder.path();
        let (salt, law) = ([3; SALT_BYTES], [1.0, 2.0, 3.0]);
        let other = written(dir, &[4; SALT_BYTES], [9.0, 2.0, 3.0]);
        let sealed = written(dir, &salt, law);
        let opened = open_challenge(dir).expect("whole");
        assert_eq!(opened.commitment_sha256, sealed.commitment_sha256);
        // The measured position is 1 µm, the true one 0.25 µm, and one position is lost.
        let noise = opened.noise.expect("sealed");
        assert!((noise.rms_m(|_| true).expect("rows") - 0.75e-6).abs() < 1e-18);
        assert_eq!((noise.rms_m(|row| row == 7), noise.is_lost.iter().filter(|is| **is).count()), (None, 1));
        let json = |sealed: &Sealed| serde_json::to_string(sealed).expect("JSON");
        let forged = Sealed { answer: seal(&salt, b"{}").answer, ..sealed.clone() };
        for (name, text) in [
            (SEALED_FILE, json(&other)),
            (SEALED_FILE, json(&forged)),
            (SEALED_FILE, "{}".into()),
            (COMMITMENT_FILE, other.commitment_sha256.clone()),
            ("experiment.toml", "# Sealed answer, SHA-256: 00\n".into()),
            ("trajectory.csv", "time_s,force_uN,position_um,cycle\n".into()),
        ] {
            written(dir, &salt, law);
            std::fs::write(dir.join(name), text).expect("writable");
            let refusal = open_challenge(dir).expect_err("changed").to_string();
            assert!(refusal.contains(name), "{name}: {refusal}");
        }
        // If the answer and its hash are both replaced, the hash differs from the comment in the experiment.
        written(dir, &salt, law);
        std::fs::write(dir.join(COMMITMENT_FILE), &other.commitment_sha256).expect("writable");
        std::fs::write(dir.join(SEALED_FILE), json(&other)).expect("writable");
        assert!(open_challenge(dir).expect_err("changed").to_string().contains("experiment.toml"));
    }
}
