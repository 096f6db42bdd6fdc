//! User tests of `ladder`: the replica as recorded by a drifting camera, and a gel with one revision.

use crate::program;

use std::path::Path;

use program::{put_extended_replica, tree, vitreo, write_instrument_experiment};
use serde_json::Value;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// `extend` has fitted m0 again to three cycles and written m1, so nothing is fitted again. The parameters that the drift had biased are recovered. `--force`
/// fits m0 again, and another number of threads gives the same bytes; m1 stays unchanged.
#[test]
#[ignore = "thorough"]
fn the_error_falls_to_the_noise_and_nothing_is_fitted_twice() {
    let dir = tempfile::tempdir().unwrap();
    let extension = put_extended_replica(&dir.path().join("a"));
    let run = vitreo(dir.path(), &["ladder", "a", "--json", "-"]).exits(0);
    assert!(!run.stderr.contains("fitted to all cycles"), "{run}");
    let document = run.json();
    assert_eq!(document["schema"], "vitreo-uq/ladder/1");
    assert_eq!(
        (&document["fitted_cycles"], &document["heldout_cycles"]),
        (&serde_json::json!([1, 2, 3]), &serde_json::json!([4]))
    );
    assert_eq!(document["noise_um"], 4.0);
    let rungs = document["revisions"].as_array().unwrap();
    assert_eq!((rungs.len(), &rungs[0]["revision"], &rungs[1]["revision"]), (2, &"m0".into(), &"m1".into()));
    for (rung, which) in rungs.iter().zip(["before", "after"]) {
        for key in ["rmse_fitted_um", "rmse_heldout_um"] {
            assert_eq!(rung[key], extension[which][key], "{key} {which}");
        }
        assert!(number(&rung["fe_runs"]) > 0.0 && rung["converged"] == true, "{rung}");
        assert!(number(&rung["surrogate_vs_fe_max_um"]) < 0.4, "{rung}");
    }
    assert_eq!(rungs[1]["added"], serde_json::json!(["tracking-drift"]));
    let score = |rung: &Value| number(&rung["heldout_log_score_nats"]);
    // 200 positions miss by more than 1.5 σ, and the noise can hardly grow: tens of nats.
    assert!(score(&rungs[1]) > score(&rungs[0]) + 20.0, "{document}");
    // 200 errors with the replica's noise of 4 µm: their root mean square has a standard deviation of 4/√400 µm. The test allows five.
    let rmse_um = number(&rungs[1]["rmse_heldout_um"]);
    assert!((rmse_um - 4.0).abs() < 1.0, "{rmse_um}");
    // Density of these errors under N(0, 4²). Five parameters from 600 rows cost about ½ · 200/600 nats each, 0.8 in all, and the inferred noise changes it by
    // as much.
    let at_truth = -200.0 * (4.0_f64.ln() + 0.5 * (2.0 * std::f64::consts::PI).ln() + 0.5 * (rmse_um / 4.0).powi(2));
    assert!((score(&rungs[1]) - at_truth).abs() < 3.0, "{} against {at_truth}", score(&rungs[1]));
    // The replica's law, Table I, is recovered within five standard deviations.
    for (shift, truth) in document["shifts"].as_array().unwrap().iter().zip([3.527, 1.402, 47.37]) {
        let (mean, sd) = (number(&shift["after"]["mean"]), number(&shift["after"]["sd"]));
        assert!((mean - truth).abs() < 5.0 * sd, "{shift} against {truth}");
    }
    let files = tree(&dir.path().join("a"));
    assert!(files.contains_key(Path::new("ladder.png")) && files.contains_key(Path::new("ladder.svg")));
    assert_eq!(serde_json::from_slice::<Value>(&files[Path::new("ladder.json")]).unwrap(), document);

    let again = vitreo(dir.path(), &["ladder", "a", "--threads", "1"]).exits(0);
    assert!(!again.stderr.contains("fitted to all cycles"), "{again}");
    for word in ["Error on the last held-out cycle", "+ tracking-drift", "█", "falls", "E (Pa)"] {
        assert!(again.stdout.contains(word), "`{word}` in {again}");
    }
    assert_eq!(tree(&dir.path().join("a")), files, "the second call changes nothing");
    let anew = vitreo(dir.path(), &["ladder", "a", "--force", "--threads", "1"]).exits(0);
    assert!(
        anew.stderr.contains("m0, fitted to all cycles except the last") && !anew.stderr.contains("m1, fitted"),
        "{anew}"
    );
    let forced: Value = serde_json::from_slice(&std::fs::read(dir.path().join("a/ladder.json")).unwrap()).unwrap();
    assert_eq!(forced["revisions"][0], document["revisions"][0], "a new fit has the same bytes");
    assert_eq!(forced["revisions"][1]["rmse_heldout_um"], document["revisions"][1]["rmse_heldout_um"]);

    vitreo(dir.path(), &["ladder", "a", "--with", "clock-offset"]).refuses(&["--with", "extend"]);
    vitreo(dir.path(), &["ladder", "a", "--from", "m7"]).refuses(&["m7", "m0, m1"]);
    // The drift is a misfit of m0. If m0 is the last revision, the ladder is not trusted.
    let first = vitreo(dir.path(), &["ladder", "a", "--from", "m0", "--json", "-", "--quiet"]).exits(1).json();
    assert_eq!(first["revisions"].as_array().unwrap().len(), 1);
    assert_eq!((&first["trust"]["level"], &document["trust"]["level"]), (&"untrusted".into(), &"effective".into()));
}

/// The study is made from an experiment. With one revision there is nothing to compare, and the output says how to add the next revision.
#[test]
fn one_revision_is_one_rung() {
    let dir = tempfile::tempdir().unwrap();
    write_instrument_experiment(&dir.path().join("gel"), true, 0.0);
    let run = vitreo(dir.path(), &["ladder", "gel", "--quiet"]).exits(0);
    for word in ["nothing to compare", "vitreo-uq extend --with", "vitreo-uq diagnose", "no finite elements"] {
        assert!(run.stdout.contains(word), "`{word}` in {run}");
    }
    assert!(dir.path().join("vitreo-uq-out/gel/ladder.svg").is_file());
    write_instrument_experiment(&dir.path().join("all"), false, 0.0);
    let document = vitreo(dir.path(), &["ladder", "all", "--out", "b", "--json", "-", "--quiet"]).json();
    let rung = &document["revisions"][0];
    assert!(rung["rmse_heldout_um"].is_null() && rung["heldout_log_score_nats"].is_null());
    assert!(number(&rung["rmse_fitted_um"]) < 1.0, "{document}");
}
