//! User tests of `compare`: a correct model, and one that lacks a tracker's delay.

use crate::program;

use std::path::{Path, PathBuf};

use program::{tree, vitreo};

/// Delay of the late tracker in samples of 0.05 s.
const N_LATE: usize = 1;

/// Writes the replica with positions that are one sample late into `dir`.
fn late_replica(dir: &Path) -> PathBuf {
    let replica = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/porcine-replica");
    let experiment = dir.join("late");
    std::fs::create_dir_all(&experiment).unwrap();
    let toml = std::fs::read_to_string(replica.join("experiment.toml")).unwrap();
    std::fs::write(experiment.join("experiment.toml"), toml.replace("porcine-replica", "late")).unwrap();
    let csv = std::fs::read_to_string(replica.join("trajectory.csv")).unwrap();
    let lines: Vec<&str> = csv.lines().collect();
    let mut late = String::from(lines[0]) + "\n";
    for (index, line) in lines.iter().enumerate().skip(1) {
        let earlier: Vec<&str> = lines[index.saturating_sub(N_LATE).max(1)].split(',').collect();
        let mut cells: Vec<&str> = line.split(',').collect();
        cells[2] = earlier[2];
        late += &(cells.join(",") + "\n");
    }
    std::fs::write(experiment.join("trajectory.csv"), late).unwrap();
    experiment
}

/// The primary test finds the delay soon after force steps. An existing revision gains the comparison and loses nothing. Another number of threads
/// gives the same bytes.
#[test]
#[ignore = "thorough"]
fn a_delay_is_found_where_it_is() {
    let dir = tempfile::tempdir().unwrap();
    let experiment = late_replica(dir.path());
    let path = experiment.to_str().unwrap();
    vitreo(dir.path(), &["sample", path, "--out", "study", "--quiet"]);
    let before = tree(&dir.path().join("study"));
    let run = vitreo(dir.path(), &["compare", "study", "--json", "-", "--simulations", "99"]).exits(0);
    let document = run.json();
    assert_eq!(document["schema"], "vitreo-uq/comparison/1");
    let findings = document["findings"].as_array().unwrap();
    let found = findings.iter().find(|finding| finding["where"] == "input_correlation");
    let found = found.unwrap_or_else(|| panic!("{document}"));
    assert!(found["size_um"].as_f64().unwrap() > 10.0 && found["p_familywise"].as_f64().unwrap() < 0.05, "{found}");
    let sentence = found["sentence"].as_str().unwrap();
    assert!(sentence.contains("after each force step") && sentence.contains("noise explains"), "{sentence}");
    assert!(document["rmse_fitted_um"].as_f64().unwrap() > 5.0, "{document}");
    let after = tree(&dir.path().join("study"));
    // Only the page shows the new document.
    for (name, bytes) in before.iter().filter(|(name, _)| !name.ends_with("report.html")) {
        assert!(after.get(name) == Some(bytes), "{}", name.display());
    }
    for file in ["m0/comparison.json", "m0/figures/comparison_map.png", "m0/figures/comparison_bias.svg"] {
        assert!(after.contains_key(Path::new(file)), "{file}");
    }
    let again = ["compare", "study", "--simulations", "99", "--threads", "1", "--quiet"];
    let words = vitreo(dir.path(), &again).exits(0);
    assert!(words.stdout.contains("The model fails"), "{words}");
    assert_eq!(tree(&dir.path().join("study")), after);
}

/// The replica's model is correct, so nothing is found (one seed in twenty would find something). Impossible requests are refused.
#[test]
#[ignore = "thorough"]
fn a_right_model_is_left_alone() {
    let dir = tempfile::tempdir().unwrap();
    let run = vitreo(dir.path(), &["compare", "--out", "study", "--json", "-", "--simulations", "99"]).exits(0);
    let document = run.json();
    assert_eq!(document["findings"], serde_json::json!([]), "{document}");
    assert!(document["sentence"].as_str().unwrap().starts_with("Nothing found"), "{document}");
    let names: Vec<&str> =
        document["left_out"].as_array().unwrap().iter().map(|l| l["where"].as_str().unwrap()).collect();
    assert_eq!(names, ["force_level", "superposition"]);
    vitreo(dir.path(), &["compare", "study", "--with", "tracking-drift"]).refuses(&["--with", "extend"]);
    vitreo(dir.path(), &["compare", "study", "--simulations", "10"]).refuses(&["--simulations", "39"]);
}
