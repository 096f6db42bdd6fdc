//! User tests of `groups` on a part of the synthetic cohort.

use crate::program;

use std::path::{Path, PathBuf};

use program::{tree, vitreo};
use serde_json::Value;
use vitreo_uq::cohorts::cohort;
use vitreo_uq::posterior::monitor::{SilentMonitor, WarningCollector};

const SOME: [&str; 8] = [
    "bovine-01-central",
    "bovine-02-central",
    "bovine-03-central",
    "human-01-central",
    "human-02-anterior",
    "porcine-01-central",
    "porcine-01-central-repeat",
    "porcine-02-central",
];

/// Copies some experiments of the cohort into `dir/cohort`.
fn copied(dir: &Path, names: &[&str]) -> PathBuf {
    let cohort = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/cohort");
    let target = dir.join("cohort");
    for name in names {
        std::fs::create_dir_all(target.join(name)).unwrap();
        for file in ["experiment.toml", "trajectory.csv"] {
            std::fs::copy(cohort.join(name).join(file), target.join(name).join(file)).unwrap();
        }
    }
    target
}

fn edited(file: &Path, from: &str, to: &str) {
    let text = std::fs::read_to_string(file).unwrap();
    assert!(text.contains(from), "{from} in {}", file.display());
    std::fs::write(file, text.replacen(from, to, 1)).unwrap();
}

#[track_caller]
fn has(value: &Value, keys: &[&str]) {
    for key in keys {
        assert!(value.get(key).is_some(), "`{key}` is missing in {value}");
    }
}

/// The document has all required keys, every file exists, one and two threads write the same bytes, and kept results are used again.
#[test]
#[ignore = "thorough"]
fn a_cohort_is_compared_and_written_down() {
    let dir = tempfile::tempdir().unwrap();
    copied(dir.path(), &SOME);
    let one = vitreo(dir.path(), &["groups", "cohort", "--json", "-", "--threads", "1", "--out", "one"]).exits(0);
    assert!(one.stderr.contains("sampling every experiment on its own"), "{one}");
    let document = one.json();
    has(&document, &["schema", "version", "seed", "inputs_sha256", "margin", "groups", "contrasts"]);
    assert_eq!(document["schema"], "vitreo-uq/groups/1");
    assert_eq!(document["margin"], 0.2);
    let group = &document["groups"][0];
    assert_eq!((&group["name"], &group["specimens"]), (&"bovine".into(), &3.into()));
    assert_eq!(document["groups"][2]["specimens"], 2, "a repeat is no specimen");
    has(&group["parameters"][0], &["name", "median", "q05", "q95", "between_specimen_log_sd"]);
    assert_eq!(document["contrasts"].as_array().unwrap().len(), 9);
    let contrast = &document["contrasts"][0];
    has(
        contrast,
        &["parameter", "a", "b", "ratio_median", "q05", "q95", "probability_greater", "probability_beyond_margin"],
    );
    assert_eq!((&contrast["a"], &contrast["b"]), (&"bovine".into(), &"human".into()));
    let two = vitreo(dir.path(), &["groups", "cohort", "--threads", "2", "--out", "two", "--quiet"]).exits(0);
    assert!(two.stdout.contains("bovine / human") && two.stderr.is_empty(), "{two}");
    let files = tree(&dir.path().join("one"));
    assert!(files == tree(&dir.path().join("two")), "files differ between one thread and two");
    let mut expected = vec!["groups.json", "groups.csv", "contrasts.csv", "specimens.csv", "population.nc"];
    expected.extend(["figures/groups.svg", "figures/groups.png", "figures/contrasts.png", "figures/corner.png"]);
    expected.push("figures/creep.png");
    for name in expected {
        assert!(files.contains_key(&Path::new("species").join(name)), "{name} is missing");
    }
    vitreo(dir.path(), &["groups", "cohort", "--by", "species,region", "--out", "one", "--quiet"]).exits(0);
    assert!(dir.path().join("one/species-region/groups.json").is_file());
    assert!(tree(&dir.path().join("one/experiments")) == tree(&dir.path().join("two/experiments")));
}

/// A study is used with the model of its last revision.
#[test]
#[ignore = "campaigns/long-tests"]
fn studies_bring_their_models() {
    let dir = tempfile::tempdir().unwrap();
    copied(dir.path(), &SOME[..4]);
    for name in &SOME[..4] {
        let experiment = format!("cohort/{name}");
        let study = format!("studies/{name}");
        vitreo(dir.path(), &["sample", &experiment, "--out", &study, "--base", "burgers", "--quiet"]);
    }
    let run = vitreo(dir.path(), &["groups", "studies", "--json", "-", "--quiet"]);
    let document = run.json();
    assert_eq!(document["law"], "burgers");
    assert_eq!(document["groups"][0]["parameters"].as_array().unwrap().len(), 4);
    vitreo(dir.path(), &["groups", "studies", "cohort/human-01-central", "--quiet"]).refuses(&["same measurement"]);
}

/// Experiments that cannot be compared are named with a remedy, and nothing is written.
#[test]
fn what_cannot_be_compared_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let cohort = copied(dir.path(), &SOME[..6]);
    std::fs::create_dir(dir.path().join("empty")).unwrap();
    let refuses = |arguments: &[&str], words: &[&str]| {
        let run = vitreo(dir.path(), &[&["groups"], arguments].concat()).refuses(words);
        assert!(run.stderr.contains("what to do") && !dir.path().join("vitreo-uq-out").exists(), "{run}");
    };
    refuses(&["nowhere"], &["nowhere"]);
    refuses(&["empty"], &["no experiment was found"]);
    refuses(&["cohort", "--by", "colour"], &["`colour` is not a known key"]);
    refuses(&["cohort", "--by", "species,species"], &["more than once"]);
    refuses(&["cohort", "--margin", "-1"], &["--margin"]);
    refuses(&["cohort", "--leave-out", "nobody"], &["no experiment is called `nobody`"]);
    refuses(&["cohort", "cohort/bovine-01-central"], &["same measurement"]);

    edited(&cohort.join("human-01-central/trajectory.csv"), "position_um", "position_furlong");
    let words = ["human-01-central", "trajectory.csv", "line 1", "position_furlong", "--leave-out human-01-central"];
    refuses(&["cohort"], &words);
    vitreo(dir.path(), &["groups", "cohort", "--leave-out", "human-01-central", "--quiet", "--out", "without"])
        .exits(0);
    edited(&cohort.join("human-02-anterior/experiment.toml"), "species = \"human\"\n", "");
    refuses(
        &["cohort", "--leave-out", "human-01-central"],
        &["human-02-anterior", "the experiment has no species", "--leave-out human-02-anterior"],
    );
    let run = vitreo(
        dir.path(),
        &["groups", "cohort", "--leave-out", "human-01-central", "--leave-out", "human-02", "--out", "without"],
    );
    run.refuses(&["comparison of other experiments", "--force"]);
}

/// A remark about many experiments appears once, with a few of their names.
#[test]
fn the_same_note_of_many_experiments_is_said_once() {
    let place = tempfile::tempdir().unwrap();
    for k in 0..20 {
        let gel = place.path().join(format!("eyes/gel-{k:02}"));
        program::write_instrument_experiment(&gel, true, 0.1 * f64::from(k));
        let toml = std::fs::read_to_string(gel.join("experiment.toml")).unwrap();
        let without = toml.replace("source = \"synthetic: closed form\"\n", "");
        std::fs::write(gel.join("experiment.toml"), without.replace("id = \"gel\"", &format!("id = \"{k}\""))).unwrap();
    }
    let heard = WarningCollector::new(&SilentMonitor);
    let measurements = cohort::read(&[place.path().join("eyes")], &[], &Ok, &heard).unwrap();
    let notes = heard.take();
    assert_eq!((measurements.len(), notes.len()), (20, 1), "{notes:?}");
    assert!(
        notes[0].starts_with("gel-00, gel-01, gel-02 and 17 others: `measurement.source` is not given"),
        "{notes:?}"
    );
    // The rows of one gel under the name of another would count twice.
    let rows = std::fs::read(place.path().join("eyes/gel-00/trajectory.csv")).unwrap();
    std::fs::write(place.path().join("eyes/gel-01/trajectory.csv"), rows).unwrap();
    let refused = cohort::read(&[place.path().join("eyes")], &[], &Ok, &heard);
    assert!(refused.is_err_and(|error| error.to_string().contains("same measurement")));
}
