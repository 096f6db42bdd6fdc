//! User tests of `diagnose` and `extend` over several records, on instruments with closed-form positions.

use crate::program;

use std::path::{Path, PathBuf};

use program::{tree, vitreo};
use serde_json::Value;

const FORCE_N: f64 = 4.6e-6;
const COMPLIANCE_PER_M: f64 = 549.178;
const ROWS_A_HOLD: usize = 25;
const HOLD_S: f64 = 5.0;
const N_CYCLES: usize = 4;
/// Compliance of a spring in series, in 1/Pa. With it each force step moves the robot by 30 µm at once, and the law can absorb nearly all of this motion.
const SERIES_PER_PA: f64 = 0.006;
const SIMULATIONS: [&str; 2] = ["--simulations", "39"];

/// Nearly normal numbers with variance 1, equal on every machine.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        let mut sum = 0.0;
        for _ in 0..12 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            sum += (self.0 >> 11) as f64 / (1_u64 << 53) as f64;
        }
        sum - 6.0
    }
}

/// Writes an experiment: positions of the Lethersich law in series with a spring, by superposition of the force steps, plus noise of 4 µm.
fn write(dir: &Path, name: &str, species: &str, (law, series_per_pa): ([f64; 3], f64), seed: u64) -> PathBuf {
    let [e, c1, c2] = law;
    let creep = |t: f64| if t > 0.0 { (1.0 - (-e * t / c1).exp()) / e + t / c2 + series_per_pa } else { 0.0 };
    let mut noise = Noise(seed);
    let mut csv = String::from("time_s,force_uN,position_um,cycle\n");
    for row in 0..2 * N_CYCLES * ROWS_A_HOLD {
        let (time, hold) = (HOLD_S / ROWS_A_HOLD as f64 * row as f64, row / ROWS_A_HOLD);
        let step = |k: usize| if k == 0 { 1.0 } else { 2.0 * (-1.0_f64).powi(k as i32) };
        let answer: f64 = (0..=hold).map(|k| step(k) * creep(time - HOLD_S * k as f64)).sum();
        let position_um = 1e6 * FORCE_N * COMPLIANCE_PER_M * answer + 4.0 * noise.next();
        let sign = if hold % 2 == 0 { "" } else { "-" };
        csv += &format!("{time:.4},{sign}4.6,{position_um:.4},{}\n", 1 + hold / 2);
    }
    let place = dir.join(name);
    std::fs::create_dir_all(&place).unwrap();
    std::fs::write(place.join("trajectory.csv"), csv).unwrap();
    let toml = format!(
        "[specimen]\nid = \"{name}\"\nspecies = \"{species}\"\n[instrument]\ncompliance_per_m = {COMPLIANCE_PER_M}\n\
         [measurement]\nfile = \"trajectory.csv\"\nnoise_um = 4.0\nsource = \"synthetic: closed form\"\n"
    );
    std::fs::write(place.join("experiment.toml"), toml).unwrap();
    place
}

/// Writes `n` records of two species, each record with its own law.
fn cohort(dir: &Path, n: usize, series_per_pa: f64, seed: u64) {
    for k in 0..n {
        let stretch = |j: usize| 1.0 + 0.25 * ((3 * k + 5 * j) % 7) as f64 / 6.0;
        let law = [3.527 * stretch(0), 1.402 * stretch(1), 47.37 * stretch(2)];
        let species = ["porcine", "bovine"][k % 2];
        write(dir, &format!("{species}-{k}"), species, (law, series_per_pa), seed + 1000 * k as u64);
    }
}

fn effect<'a>(document: &'a Value, slug: &str) -> &'a Value {
    let effects = document["effects"].as_array().unwrap();
    effects.iter().find(|value| value["effect"] == slug).unwrap()
}

/// A spring in series in all six records is claimed, or equivalent to the claim. The document has all required keys, every file exists, and one and two threads
/// write the same bytes.
#[test]
fn what_records_have_in_common_is_found_and_written_down() {
    let dir = tempfile::tempdir().unwrap();
    cohort(&dir.path().join("eyes"), 6, SERIES_PER_PA, 7);
    let first = [&["diagnose", "eyes", "--out", "one", "--json", "-", "--threads", "1"][..], &SIMULATIONS].concat();
    let run = vitreo(dir.path(), &first).exits(0);
    let document = run.json();
    assert_eq!(document["schema"], "vitreo-uq/cohort-diagnosis/1");
    for key in ["version", "seed", "inputs_sha256", "verdict", "specimens", "groups", "base", "extended", "contrasts"] {
        assert!(document.get(key).is_some(), "`{key}` is missing in {document}");
    }
    let verdict = &document["verdict"];
    assert_eq!(verdict["kind"], "missing", "{verdict}");
    let named = [&verdict["effects"], &verdict["equivalent"]].map(|list| list.as_array().unwrap());
    assert!(named.into_iter().flatten().any(|slug| slug == "instantaneous-elasticity"), "{verdict}");
    let claimed = effect(&document, verdict["effects"][0].as_str().unwrap());
    assert!(claimed["p_familywise"].as_f64().unwrap() <= 0.01 && claimed["heldout_gain_nats"].as_f64().unwrap() > 2.0);
    let specimens = document["specimens"].as_array().unwrap();
    let gain_of = |specimen: &Value| {
        let gains = specimen["gains"].as_array().unwrap();
        gains.iter().find(|gain| gain["effect"] == claimed["effect"]).unwrap()["gain_nats"].as_f64().unwrap()
    };
    let sum: f64 = specimens.iter().map(gain_of).sum();
    assert_eq!(specimens.len(), 6);
    assert!((sum - claimed["gain_nats"].as_f64().unwrap()).abs() < 1e-6, "{sum} {claimed}");
    // Effects that need finite elements are not tried on an instrument, and the document says so.
    assert!(effect(&document, "interface-slip")["refused"].is_string());
    let names: Vec<&str> =
        document["groups"].as_array().unwrap().iter().map(|value| value["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["bovine", "porcine"]);
    // The effect is equally large in both species.
    assert_eq!(document["contrasts"][0]["is_declared"], false, "{}", document["contrasts"]);
    let second = [&["diagnose", "eyes", "--out", "two", "--threads", "2", "--quiet"][..], &SIMULATIONS].concat();
    let words = vitreo(dir.path(), &second).exits(0).stdout;
    assert!(words.contains("is missing") && words.contains("extend DIR"), "{words}");
    let files = tree(&dir.path().join("one"));
    assert!(files == tree(&dir.path().join("two")), "files differ between one thread and two");
    for name in ["cohort-diagnosis.json", "gains.csv", "figures/cohort.svg", "figures/cohort.png"] {
        assert!(files.contains_key(&Path::new("diagnosis").join(name)), "{name} is missing");
    }
}

/// Nothing is claimed in records without an effect.
#[test]
fn records_that_lack_nothing_are_left_alone() {
    let dir = tempfile::tempdir().unwrap();
    cohort(&dir.path().join("eyes"), 6, 0.0, 19);
    let arguments = [&["diagnose", "eyes", "--json", "-", "--quiet"][..], &SIMULATIONS].concat();
    let document = vitreo(dir.path(), &arguments).exits(0).json();
    assert_eq!(document["verdict"]["kind"], "none", "{}", document["verdict"]);
    assert!(document["extended"].is_null() && document["groups"].as_array().unwrap().is_empty());
    assert!(dir.path().join("vitreo-uq-out/cohort/diagnosis/cohort-diagnosis.json").is_file());
}

/// Input that is not a cohort is refused with a remedy, and nothing is written.
#[test]
fn what_is_no_cohort_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    cohort(&dir.path().join("eyes"), 2, 0.0, 3);
    std::fs::create_dir(dir.path().join("empty")).unwrap();
    let refuses = |arguments: &[&str], words: &[&str]| {
        let run = vitreo(dir.path(), &[&["diagnose"], arguments].concat()).refuses(words);
        assert!(run.stderr.contains("what to do") && !dir.path().join("vitreo-uq-out").exists(), "{run}");
    };
    refuses(&["empty"], &["no experiment was found"]);
    refuses(&["eyes", "--leave-out", "bovine-1"], &["1 record is too few for a cohort"]);
    refuses(&["eyes", "--by", "colour"], &["`colour` is not a known key"]);
    refuses(&["eyes", "--by", "region"], &["the experiment has no region"]);
    refuses(&["eyes", "--margin", "-1"], &["--margin"]);
    refuses(&["eyes", "--simulations", "5"], &["5 simulations"]);
    refuses(&["eyes", "--from", "m0"], &["--from"]);
    refuses(&["eyes/porcine-0", "eyes/porcine-0"], &["same measurement"]);
}

/// Every record gets the effect in its own study. Repeating the command changes nothing.
#[test]
fn a_cohort_is_extended_in_one_command() {
    let dir = tempfile::tempdir().unwrap();
    cohort(&dir.path().join("eyes"), 2, SERIES_PER_PA, 23);
    let arguments =
        ["extend", "eyes", "--with", "instantaneous-elasticity", "--out", "studies", "--no-report", "--quiet"];
    let run = vitreo(dir.path(), &arguments);
    assert!(run.code <= 1 && run.stdout.contains("porcine-0") && run.stdout.contains("bovine-1"), "{run}");
    for name in ["porcine-0", "bovine-1"] {
        assert!(dir.path().join("studies").join(name).join("m1/extension.json").is_file(), "{name}");
    }
    let before = tree(&dir.path().join("studies"));
    let again = vitreo(dir.path(), &arguments).exits(0);
    assert_eq!(again.stdout.matches("already has the effect").count(), 2, "{again}");
    assert!(before == tree(&dir.path().join("studies")));
    vitreo(dir.path(), &["extend", "eyes", "--with", "instantaneous-elasticity", "--json", "-"]).refuses(&["--json"]);
}
