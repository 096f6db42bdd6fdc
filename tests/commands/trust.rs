//! Tests that every command first states how far its result can be trusted.

use crate::program;

use std::path::Path;

use program::{normals, vitreo, write_instrument_experiment};
use serde_json::{Value, json};

const STEP_S: f64 = 0.04;
const ROWS_OF_CYCLE: usize = 100;

/// Positions (µm, without noise) at equal steps of an instrument under a force (µN) that holds after every row: E = 3.5 Pa, c₁ = 1.4 Pa·s, c₂ = 47 Pa·s.
fn positions_um(force_un: &[f64]) -> Vec<f64> {
    let decay = f64::exp(-STEP_S * 3.5 / 1.4);
    let (mut retarded_un, mut impulse_un_s) = (0.0, 0.0);
    let mut of_row = |force: &f64| {
        let position_um = 549.0 * (retarded_un / 3.5 + impulse_un_s / 47.0);
        retarded_un = decay * retarded_un + (1.0 - decay) * force;
        impulse_un_s += STEP_S * force;
        position_um
    };
    force_un.iter().map(&mut of_row).collect()
}

/// A row: time (s), force (µN), position (µm) and cycle.
type Row = (f64, f64, f64, usize);

/// An experiment on an instrument with 0.5 µm of added noise, stated or not. The last cycle is held out.
fn write(dir: &Path, rows: &[Row], is_noise_given: bool) {
    write_with_noise(dir, rows, is_noise_given.then_some(0.5), 0.5, &mut normals());
}

/// Writes an experiment on an instrument with noise of `noise_um` (µm); `given_um` is the stated noise, if any. The last cycle is held out.
fn write_with_noise(dir: &Path, rows: &[Row], given_um: Option<f64>, noise_um: f64, normal: &mut impl FnMut() -> f64) {
    std::fs::create_dir_all(dir).unwrap();
    let last = rows.last().unwrap().3;
    let fitted: Vec<usize> = (1..last).collect();
    let noise = given_um.map_or(String::new(), |noise_um| format!("noise_um = {noise_um}\n"));
    let toml = format!(
        "[specimen]\nid = \"gel\"\n[instrument]\ncompliance_per_m = 549.0\n[measurement]\nfile = \"trajectory.csv\"\ncalibration_cycles = {fitted:?}\nheldout_cycles = [{last}]\n{noise}source = \"synthetic: closed form\"\n"
    );
    std::fs::write(dir.join("experiment.toml"), toml).unwrap();
    let mut csv = String::from("time_s,force_uN,position_um,cycle\n");
    for (time_s, force_un, position_um, cycle) in rows {
        csv += &format!("{time_s:.6},{force_un},{:.4},{cycle}\n", position_um + noise_um * normal());
    }
    std::fs::write(dir.join("trajectory.csv"), csv).unwrap();
}

/// Rows of cycles of ±1 µN. Only the simulated cycles with indices in `kept` are returned, with new numbers. In the last one, displacements are smaller by the
/// factor `stiffer`.
fn cycles(kept: &[usize], stiffer: f64) -> Vec<Row> {
    let n_made = kept.iter().max().unwrap() + 1;
    let force_un: Vec<f64> = (0..n_made * ROWS_OF_CYCLE)
        .map(|row| if (row / (ROWS_OF_CYCLE / 2)).is_multiple_of(2) { 1.0 } else { -1.0 })
        .collect();
    let exact_um = positions_um(&force_un);
    let row = |row: usize| {
        let number = 1 + kept.iter().position(|index| *index == row / ROWS_OF_CYCLE)?;
        let size = if number == kept.len() { 1.0 / stiffer } else { 1.0 };
        Some((STEP_S * row as f64, force_un[row], size * exact_um[row], number))
    };
    (0..force_un.len()).filter_map(row).collect()
}

fn level(document: &Value) -> &str {
    document["trust"]["level"].as_str().unwrap_or_else(|| panic!("no level in {document}"))
}

fn kinds(document: &Value) -> Vec<&str> {
    document["warnings"].as_array().unwrap().iter().map(|value| value["kind"].as_str().unwrap()).collect()
}

/// A missing cycle, and a cycle with a 20 % stiffer gel: `fit` judges the held-out cycle as `sample` does, with stated and with
/// estimated noise. Both trust a record without a fault.
#[test]
fn fit_judges_held_out_cycles_like_sample() {
    let dir = tempfile::tempdir().unwrap();
    let cases = [("missing", &[0, 2][..], 1.0, 1), ("stiffer", &[0, 1], 1.2, 1), ("sound", &[0, 1], 1.0, 0)];
    for (name, kept, stiffer, code) in cases {
        for is_noise_given in [true, false] {
            let experiment = format!("{name}-{is_noise_given}");
            write(&dir.path().join(&experiment), &cycles(kept, stiffer), is_noise_given);
            for command in ["fit", "sample"] {
                let study = format!("{experiment}-{command}");
                let run = vitreo(dir.path(), &[command, &experiment, "--out", &study, "--json", "-", "--quiet"]);
                let document = run.exits(code).json();
                assert_eq!(level(&document) == "untrusted", code == 1, "{command} of {experiment}: {document}");
                let is_misfit = kinds(&document).contains(&"misfit_above_noise");
                assert_eq!(is_misfit, code == 1, "{command} of {experiment}: {document}");
            }
        }
    }
    let words = vitreo(dir.path(), &["fit", "missing-false", "--out", "words"]).exits(1).stdout;
    assert!(
        words
            .lines()
            .nth(1)
            .unwrap()
            .starts_with("Not to be trusted as it stands: the model misses the held-out cycles")
    );
    assert!(words.contains("What to do: the model does not describe this measurement"), "{words}");
}

/// An instrument whose stated compliance is 1,000 times too large moves the law's parameters beyond the range of their priors: no command trusts them or finds that nothing is missing.
/// A factor of 10 stays within the range and is trusted.
#[test]
fn parameters_beyond_the_range_of_the_prior_are_not_trusted() {
    let dir = tempfile::tempdir().unwrap();
    for (factor, code, verdict) in [(10.0, 0, "none"), (1000.0, 1, "unexplained")] {
        let experiment = format!("by-{factor}");
        write(&dir.path().join(&experiment), &cycles(&[0, 1, 2], 1.0), true);
        let toml = dir.path().join(&experiment).join("experiment.toml");
        let text = std::fs::read_to_string(&toml).unwrap();
        let stated = format!("compliance_per_m = {:.1}", 549.0 * factor);
        std::fs::write(&toml, text.replace("compliance_per_m = 549.0", &stated)).unwrap();
        for command in ["fit", "sample"] {
            let study = format!("{experiment}-{command}");
            let run = vitreo(dir.path(), &[command, &experiment, "--out", &study, "--json", "-", "--quiet"]);
            let document = run.exits(code).json();
            assert_eq!(level(&document) == "untrusted", code == 1, "{command} of {experiment}: {document}");
            if command == "sample" {
                assert_eq!(kinds(&document).contains(&"edge_of_range"), code == 1, "{experiment}: {document}");
            }
        }
        let study = format!("{experiment}-sample");
        let found = vitreo(dir.path(), &["diagnose", &study, "--json", "-", "--quiet"]).exits(0).json();
        assert_eq!(found["verdict"]["kind"], verdict, "{experiment}: {found}");
        let sentence = found["verdict"]["sentence"].as_str().unwrap();
        assert_eq!(sentence.contains("check the units of force and position"), code == 1, "{experiment}: {sentence}");
    }
}

/// Rows at logarithmic times, whose neighbours reveal little of the noise: a power law fitted by the program's law is not trusted, with or without an estimate
/// of the noise. The program's own law stays trusted.
#[test]
fn a_wrong_law_at_logarithmic_times_is_not_trusted() {
    let dir = tempfile::tempdir().unwrap();
    let times_s: Vec<f64> = (0..200).map(|row| 0.05 * (400.0_f64).powf(row as f64 / 199.0) - 0.05).collect();
    let of_own_law = |t: f64| 549.0 * ((1.0 - (-t * 3.5 / 1.4).exp()) / 3.5 + t / 47.0);
    let of_power_law = |t: f64| 100.0 * t.powf(0.35);
    for (name, position_um, code) in [("own", &of_own_law as &dyn Fn(f64) -> f64, 0), ("power", &of_power_law, 1)] {
        let first: Vec<Row> = times_s.iter().map(|t| (*t, 1.0, position_um(*t), 1)).collect();
        // The single cycle becomes a fitted cycle, so no cycle is held out.
        write(&dir.path().join(name), &first, false);
        let toml = dir.path().join(name).join("experiment.toml");
        let text = std::fs::read_to_string(&toml).unwrap();
        let text = text
            .replace("calibration_cycles = []", "calibration_cycles = [1]")
            .replace("[1]\nheldout_cycles = [1]", "[1]\nheldout_cycles = []");
        std::fs::write(&toml, text).unwrap();
        for command in ["fit", "sample"] {
            let study = format!("{name}-{command}");
            let run =
                vitreo(dir.path(), &[command, name, "--out", &study, "--json", "-", "--quiet", "--prior", "generic"]);
            let document = run.exits(code).json();
            assert_eq!(level(&document) == "untrusted", code == 1, "{command} of {name}: {document}");
        }
    }
}

/// The replica strains its gel by more than 1 %. Its parameters are effective values, and the output says so first, with the reason.
#[test]
fn a_large_strain_makes_parameters_effective() {
    let dir = tempfile::tempdir().unwrap();
    let run = vitreo(dir.path(), &["fit"]).exits(0);
    let second = run.stdout.lines().nth(1).unwrap();
    assert!(
        second.starts_with("Predictions can be trusted; parameters are effective values: the largest strain"),
        "{run}"
    );
    let document: Value =
        serde_json::from_slice(&std::fs::read(dir.path().join("vitreo-uq-out/porcine-replica/fit.json")).unwrap())
            .unwrap();
    assert_eq!(level(&document), "effective");
    assert!(document["trust"]["reason"].as_str().unwrap().contains("largest strain"));
    // Without finite elements no strain is known, so the parameters stay trusted.
    write_instrument_experiment(&dir.path().join("gel"), true, 0.0);
    let run = vitreo(dir.path(), &["sample", "gel", "--out", "study"]).exits(0);
    assert!(run.stdout.lines().nth(1).unwrap().starts_with("Parameters can be trusted: "), "{run}");
    let page = std::fs::read_to_string(dir.path().join("study/report.html")).unwrap();
    assert!(
        page.contains("Parameters can be trusted") && !page.contains("Sound, as far as"),
        "the page says the level"
    );
}

/// Writes a diagnosis that claims `clock-offset` and names `rivals` as equivalent, in the format of `diagnose`.
fn put_diagnosis(study: &Path, rivals: &[&str]) {
    let posterior: Value = serde_json::from_slice(&std::fs::read(study.join("m0/posterior.json")).unwrap()).unwrap();
    let candidate = |effect: &str, status: &str, name: &str, mean: f64| {
        json!({"effect": effect, "status": status, "z": 9.0, "p_familywise": 0.01, "visible_fraction": 0.5, "expected_parameter": null, "twins": [], "refused": null,
            "refit": {"gain_nats": 30.0, "heldout_gain_nats": 9.0, "last_cycle_gain_nats": 9.0, "rmse_heldout_um": 0.52, "largest_change": 3.0, "log_bayes_factor": 20.0,
                "parameters": [{"name": name, "mean": mean, "q05": 0.9 * mean, "q95": 1.1 * mean}],
                "law_parameters": [{"name": "young_modulus_pa", "mean": 100.0 * mean, "q05": 99.0 * mean, "q95": 101.0 * mean}]}})
    };
    let status = if rivals.is_empty() { "unsupported" } else { "equivalent" };
    let diagnosis = json!({"schema": "vitreo-uq/diagnosis/1", "version": posterior["version"], "seed": 1, "inputs_sha256": posterior["inputs_sha256"], "experiment": "gel",
        "verdict": {"kind": "missing", "effects": ["clock-offset"], "equivalent": rivals, "sentence": "The model lacks clock-offset."},
        "fitted_cycles": [1], "heldout_cycles": [2], "base": {"rmse_fitted_um": 2.0, "rmse_heldout_um": 2.0, "noise_um": 0.5},
        "search_noise_um": 0.5,
        "extended": null, "candidates": [candidate("clock-offset", "claimed", "clock-offset.delay_s", 0.0512), candidate("actuator-lag", status, "actuator-lag.time_s", 0.0487)],
        "pairs": [], "blind_spots": [], "smallest_detectable": [], "separating_protocol": "", "noise": [], "unexplained": [], "discrepancy": null, "outlier_rows": [], "remarks": []});
    std::fs::write(study.join("m0/diagnosis.json"), serde_json::to_vec(&diagnosis).unwrap()).unwrap();
}

/// Equivalent effects stay beside the name in every later revision: in the document, the output, the ladder and the page, with both tables. A later diagnosis
/// that separates them ends this. Effects that no diagnosis claimed count as untested.
#[test]
fn equivalent_effects_stay_beside_the_name() {
    let dir = tempfile::tempdir().unwrap();
    write_instrument_experiment(&dir.path().join("gel"), true, 0.0);
    vitreo(dir.path(), &["sample", "gel", "--out", "study", "--quiet", "--no-report"]).exits(0);
    let study = dir.path().join("study");
    put_diagnosis(&study, &["actuator-lag"]);
    let run = vitreo(dir.path(), &["extend", "study", "--with", "clock-offset"]);
    assert!(run.code < 2, "{run}");
    for words in
        ["+ clock-offset (or: actuator-lag)", "cannot tell clock-offset from actuator-lag", "actuator-lag.time_s"]
    {
        assert!(run.stdout.contains(words), "{words} in {run}");
    }
    let read = |name: &str| -> Value { serde_json::from_slice(&std::fs::read(study.join(name)).unwrap()).unwrap() };
    // The modulus depends on which of both is true.
    let words = "young_modulus_pa has another value with actuator-lag in place of clock-offset";
    for name in ["m1/extension.json", "m1/posterior.json"] {
        let document = read(name);
        let warnings = document["warnings"].as_array().unwrap();
        let is_named = warnings.iter().any(|warning| warning["text"].as_str().unwrap().contains(words));
        assert!(is_named && level(&document) != "trusted", "{name}: {document}");
    }
    assert!(run.stdout.contains("young_modulus_pa, with actuator-lag"), "{run}");
    let value = &read("m1/extension.json")["equivalents"][0];
    assert_eq!((&value["rivals"], &value["diagnosis_of"]), (&json!(["actuator-lag"]), &json!("m0")));
    assert_eq!(value["refits"][1]["parameters"][0]["name"], "actuator-lag.time_s");
    // One more, untested effect is added: the first class stays, and the second has no test.
    let run = vitreo(dir.path(), &["extend", "study", "--with", "tracking-drift"]);
    assert!(run.code < 2, "{run}");
    for words in
        ["+ clock-offset (or: actuator-lag) + tracking-drift", "The equivalents of tracking-drift were not tested"]
    {
        assert!(run.stdout.contains(words), "{words} in {run}");
    }
    let ladder = vitreo(dir.path(), &["ladder", "study"]);
    assert!(ladder.code < 2 && ladder.stdout.contains("+ clock-offset (or: actuator-lag)"), "{ladder}");
    let page = || std::fs::read_to_string(study.join("report.html")).unwrap();
    for words in [
        "+ clock-offset (or: actuator-lag) + tracking-drift",
        "cannot tell clock-offset from actuator-lag",
        "actuator-lag.time_s",
    ] {
        assert!(page().contains(words), "{words} in the page");
    }
    put_diagnosis(&study, &[]);
    vitreo(dir.path(), &["report", "study"]).exits(0);
    assert!(!page().contains("(or: actuator-lag) +"), "a later diagnosis has separated them");
    let ladder = vitreo(dir.path(), &["ladder", "study", "--json", "-", "--quiet"]).json();
    assert_eq!(ladder["revisions"][1]["equivalents"][0]["rivals"], json!([]));
}

/// Four records contain a force bias and a wave of 2 µm outside the library, at a known noise of 0.1 µm. The bias gains in all records but leaves most of the
/// misfit, so the diagnosis names the bias but its verdict is `unexplained`. Without the wave the verdict is `missing`.
#[test]
fn a_claim_of_a_cohort_that_leaves_most_is_unexplained() {
    let dir = tempfile::tempdir().unwrap();
    for (name, wave_um, kind) in [("wave", 2.0, "unexplained"), ("plain", 0.0, "missing")] {
        let force_un: Vec<f64> =
            (0..3 * ROWS_OF_CYCLE).map(|row| if (row / 50).is_multiple_of(2) { 1.0 } else { -1.0 }).collect();
        let biased_un: Vec<f64> = force_un.iter().map(|force| force + 0.03).collect();
        let exact_um = positions_um(&biased_un);
        let mut normal = normals();
        let mut directories = Vec::new();
        for number in 0..4 {
            let stiffer = 1.0 + 0.1 * f64::from(number);
            let row = |row: usize| {
                let phase = std::f64::consts::TAU * (row % ROWS_OF_CYCLE) as f64 / ROWS_OF_CYCLE as f64;
                let position_um = exact_um[row] / stiffer + wave_um * (5.0 * phase).sin();
                (STEP_S * row as f64, force_un[row], position_um, 1 + row / ROWS_OF_CYCLE)
            };
            let rows: Vec<Row> = (0..force_un.len()).map(row).collect();
            let directory = format!("{name}{number}");
            write_with_noise(&dir.path().join(&directory), &rows, Some(0.1), 0.1, &mut normal);
            directories.push(directory);
        }
        let records: Vec<&str> = directories.iter().map(String::as_str).collect();
        let arguments =
            [&["diagnose"], &records[..], &["--simulations", "19", "--out", name, "--json", "-", "--quiet"]];
        let document = vitreo(dir.path(), &arguments.concat()).exits(0).json();
        let verdict = &document["verdict"];
        assert_eq!(verdict["kind"], kind, "{verdict}");
        assert_eq!(verdict["effects"].as_array().unwrap().len(), 1, "{verdict}");
        let says = verdict["sentence"].as_str().unwrap().contains("times the error that noise and parameters allow");
        assert_eq!(says, wave_um > 0.0, "{verdict}");
    }
}
