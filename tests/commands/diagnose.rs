//! User tests of `diagnose`: a sealed case, data with a misfit outside the library, and refusals.

use crate::program;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use program::{tree, vitreo, write_instrument_experiment};
use serde_json::Value;

/// Fewest simulated searches that are allowed.
const SIMULATIONS: [&str; 2] = ["--simulations", "99"];

fn keys(value: &Value) -> BTreeSet<&str> {
    value.as_object().unwrap_or_else(|| panic!("no object: {value}")).keys().map(String::as_str).collect()
}

/// Asserts that a value has all these keys.
#[track_caller]
fn has(value: &Value, wanted: &[&str]) {
    let there = keys(value);
    for key in wanted {
        assert!(there.contains(key), "`{key}` is missing in {value}");
    }
}

/// Writes an instrument's experiment whose positions jump by `jump_um` (µm) after row `from_row`.
fn jumping(dir: &Path, from_row: usize, jump_um: f64) -> PathBuf {
    let experiment = dir.join("jumping");
    write_instrument_experiment(&experiment, true, 0.0);
    let path = experiment.join("trajectory.csv");
    let csv = std::fs::read_to_string(&path).unwrap();
    let jump = |(line, text): (usize, &str)| {
        let mut cells: Vec<String> = text.split(',').map(String::from).collect();
        if line > from_row {
            cells[2] = (cells[2].parse::<f64>().unwrap() + jump_um).to_string();
        }
        cells.join(",") + "\n"
    };
    std::fs::write(&path, csv.lines().enumerate().map(jump).collect::<String>()).unwrap();
    experiment
}

/// A sealed challenge: the document has all keys, all files exist, and nothing else in the study changes. Without a terminal there are no control characters.
#[test]
#[ignore = "thorough"]
fn a_sealed_case_is_diagnosed_and_written_down() {
    let dir = tempfile::tempdir().unwrap();
    let case = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/hidden/paper-1");
    let case = case.to_str().unwrap();
    vitreo(dir.path(), &["sample", case, "--out", "study", "--quiet"]);
    let before = tree(&dir.path().join("study"));
    let run = vitreo(dir.path(), &[&["diagnose", "study", "--json", "-"][..], &SIMULATIONS].concat()).exits(0);
    assert!(run.stderr.chars().all(|c| c == '\n' || !c.is_control()), "{run}");
    let document = run.json();
    assert_eq!(document["schema"], "vitreo-uq/diagnosis/1");
    has(
        &document,
        &[
            "schema",
            "experiment",
            "verdict",
            "fitted_cycles",
            "heldout_cycles",
            "base",
            "extended",
            "candidates",
            "blind_spots",
            "smallest_detectable",
            "separating_protocol",
        ],
    );
    has(&document["verdict"], &["kind", "effects", "equivalent", "sentence"]);
    has(&document["base"], &["rmse_fitted_um", "rmse_heldout_um", "noise_um"]);
    assert_eq!(document["fitted_cycles"], serde_json::json!([1, 2, 3]));
    assert_eq!(document["heldout_cycles"], serde_json::json!([4]));
    // A spring in series of ten standard deviations is hidden.
    let verdict = &document["verdict"];
    assert_eq!(verdict["kind"], "missing", "{verdict}");
    let named = [&verdict["effects"], &verdict["equivalent"]].map(|list| list.as_array().unwrap());
    assert!(named.into_iter().flatten().any(|effect| effect == "instantaneous-elasticity"), "{verdict}");
    assert!(document["extended"].is_object(), "{document}");
    let candidates = document["candidates"].as_array().unwrap();
    assert_eq!(candidates.len(), vitreo_uq::models::effects::EFFECTS.len());
    for candidate in candidates {
        let wanted =
            ["effect", "status", "z", "p_familywise", "visible_fraction", "expected_parameter", "refit", "twins"];
        has(candidate, &wanted);
        let status = candidate["status"].as_str().unwrap();
        assert!(["claimed", "equivalent", "suggestive", "unsupported", "invisible"].contains(&status), "{status}");
        let refit = &candidate["refit"];
        // Here the robot moves beyond the range of the large-displacement model, and the document says so.
        if candidate["effect"] == "large-displacement" {
            assert!(
                refit.is_null() && candidate["refused"].as_str().unwrap().contains("of its radii, but"),
                "{candidate}"
            );
            continue;
        }
        has(refit, &["gain_nats", "heldout_gain_nats", "rmse_heldout_um", "log_bayes_factor", "parameters"]);
        refit["parameters"].as_array().unwrap().iter().for_each(|p| has(p, &["name", "mean", "q05", "q95"]));
    }
    document["smallest_detectable"].as_array().unwrap().iter().for_each(|d| has(d, &["effect", "parameter"]));
    // An effect that is visible at some size is neither a blind spot nor invisible.
    let sizes = document["smallest_detectable"].as_array().unwrap().iter();
    for seen in sizes.filter(|d| d["parameter"].is_number()) {
        assert!(!document["blind_spots"].as_array().unwrap().contains(&seen["effect"]), "{seen}");
        let entry = candidates.iter().find(|candidate| candidate["effect"] == seen["effect"]).unwrap();
        assert_ne!(entry["status"], "invisible", "{seen}");
    }
    let froms: Vec<&str> = document["noise"].as_array().unwrap().iter().map(|n| n["from"].as_str().unwrap()).collect();
    assert_eq!(
        froms,
        ["rest records", "short-lag differences", "cycle-to-cycle differences", "restricted maximum likelihood"]
    );
    let after = tree(&dir.path().join("study"));
    // Only the page shows the new document.
    for (name, bytes) in before.iter().filter(|(name, _)| !name.ends_with("report.html")) {
        assert!(after.get(name) == Some(bytes), "{}", name.display());
    }
    for file in
        ["m0/diagnosis.json", "m0/figures/diagnosis.pdf", "m0/figures/diagnosis.png", "m0/figures/diagnosis.svg"]
    {
        assert!(after.contains_key(Path::new(file)), "{file}");
    }
    let is_drawn = after.contains_key(Path::new("m0/figures/discrepancy.png"));
    assert_eq!(is_drawn, document["discrepancy"].is_object());
    // The document in the study equals the printed one.
    let kept: Value = serde_json::from_slice(&after[Path::new("m0/diagnosis.json")]).unwrap();
    assert_eq!(kept, document);
}

/// A jump in a fitted cycle is not an effect. It is described and drawn, and widens predictions by its size. One thread gives the same bytes.
#[test]
#[ignore = "thorough"]
fn what_is_not_of_the_library_is_named_and_drawn() {
    let dir = tempfile::tempdir().unwrap();
    let experiment = jumping(dir.path(), 60, 8.0);
    let path = experiment.to_str().unwrap();
    let words = vitreo(dir.path(), &[&["diagnose", path, "--out", "study"][..], &SIMULATIONS].concat()).exits(0);
    for part in [
        "Unexplained in this experiment: The position jumps",
        "widens the standard deviation of predictions",
        "figures/discrepancy.png",
    ] {
        assert!(words.stdout.contains(part), "`{part}` is missing in {words}");
    }
    assert_eq!(words.stdout.matches("Unexplained in this experiment").count(), 1, "{words}");
    let study = tree(&dir.path().join("study"));
    for file in ["m0/figures/discrepancy.png", "m0/figures/discrepancy.svg"] {
        assert!(study.contains_key(Path::new(file)), "{file}");
    }
    let document: Value = serde_json::from_slice(&study[Path::new("m0/diagnosis.json")]).unwrap();
    assert_eq!(document["verdict"]["kind"], "unexplained");
    let discrepancy = &document["discrepancy"];
    let wanted = ["axis", "sentence", "size_um", "p_familywise", "predictive_noise_um"];
    has(discrepancy, &wanted);
    let number = |key: &str| discrepancy[key].as_f64().unwrap_or_else(|| panic!("{key} in {discrepancy}"));
    let (size, from, to) =
        (number("size_um"), number("predictive_noise_um"), number("predictive_noise_with_discrepancy_um"));
    assert!(size > 0.5 && (to - from.hypot(size)).abs() < 0.05 * to, "{discrepancy}");
    let again = [&["diagnose", "study", "--threads", "1", "--quiet"][..], &SIMULATIONS].concat();
    vitreo(dir.path(), &again).exits(0);
    assert_eq!(tree(&dir.path().join("study")), study);
}

/// No fit uses the jump in the held-out cycle. The diagnosis reports it and claims nothing from it.
#[test]
fn an_event_in_the_held_out_cycle_is_said() {
    let dir = tempfile::tempdir().unwrap();
    let experiment = jumping(dir.path(), 150, 8.0);
    let path = experiment.to_str().unwrap();
    let arguments = [&["diagnose", path, "--out", "study", "--json", "-", "--quiet"][..], &SIMULATIONS].concat();
    let document = vitreo(dir.path(), &arguments).exits(0).json();
    assert_ne!(document["verdict"]["kind"], "missing", "{document}");
    let remarks = document["remarks"].as_array().unwrap();
    let said = remarks.iter().filter_map(Value::as_str).find(|remark| remark.contains("no fit has seen"));
    let said = said.unwrap_or_else(|| panic!("{document}"));
    assert!(said.contains("cycle 2") && said.contains("jumps up"), "{said}");
}

#[test]
fn what_cannot_be_asked_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let refuses = |arguments: &[&str], words: &[&str]| {
        vitreo(dir.path(), &[&["diagnose", "--out", "study"][..], arguments].concat()).refuses(words);
    };
    refuses(&["--smallest", "-1"], &["--smallest", "-1 is not a valid size", "--smallest 0.25"]);
    refuses(&["--smallest", "NaN"], &["--smallest", "NaN is not a valid size"]);
    refuses(&["--smallest", "much"], &["--smallest", "much"]);
    refuses(&["--simulations", "10"], &["--simulations", "99"]);
    assert!(!dir.path().join("study").exists(), "something was written");
}

/// A misfit of 1.2 µm, fixed in the phase of every cycle, exceeds the known noise of 0.5 µm. Then `sample` does not trust its posterior, and `diagnose` does
/// not say that nothing is missing. Without the misfit neither complains.
#[test]
#[ignore = "thorough"]
fn sample_and_diagnose_agree_on_what_the_known_noise_allows() {
    let dir = tempfile::tempdir().unwrap();
    for (name, size_um, is_misfit) in [("bent", 1.2, true), ("plain", 0.0, false)] {
        let experiment = dir.path().join(name);
        write_instrument_experiment(&experiment, true, 0.0);
        let path = experiment.join("trajectory.csv");
        let csv = std::fs::read_to_string(&path).unwrap();
        let bent = |(line, text): (usize, &str)| {
            let mut cells: Vec<String> = text.split(',').map(String::from).collect();
            if line > 0 {
                let phase = std::f64::consts::TAU * ((line - 1) % 100) as f64 / 100.0;
                let shape_um = size_um * ((2.0 * phase).sin() + (3.0 * phase + 0.5).cos() + (5.0 * phase).sin());
                cells[2] = (cells[2].parse::<f64>().unwrap() + shape_um).to_string();
            }
            cells.join(",") + "\n"
        };
        std::fs::write(&path, csv.lines().enumerate().map(bent).collect::<String>()).unwrap();
        let study = format!("{name}-study");
        let sampled =
            vitreo(dir.path(), &["sample", experiment.to_str().unwrap(), "--out", &study, "--json", "-", "--quiet"]);
        assert_eq!(sampled.code, i32::from(is_misfit), "{sampled}");
        let kinds = sampled.json()["warnings"].to_string();
        assert_eq!(kinds.contains("misfit_above_noise"), is_misfit, "{kinds}");
        let run = vitreo(dir.path(), &[&["diagnose", &study, "--json", "-", "--quiet"][..], &SIMULATIONS].concat());
        let document = run.exits(0).json();
        assert_eq!(document["verdict"]["kind"] != "none", is_misfit, "{}", document["verdict"]);
    }
}
