//! `tasks models`: models trained elsewhere replace those trained here.

use crate::program;

use std::path::Path;

use program::{Run, replica_with_id, tree, vitreo_with_cache};

fn says(run: &Run, words: &[&str]) {
    words.iter().for_each(|word| assert!(run.stdout.contains(word), "`{word}` is missing in {run}"));
}

/// Names of the models in a cache.
fn models(cache: &Path) -> Vec<String> {
    if !cache.exists() {
        return Vec::new();
    }
    tree(cache).keys().map(|path| path.display().to_string()).collect()
}

/// Two eyes with one apparatus and one protocol share a surrogate and a compliance. Trained without a cache and gathered into an empty one, the files equal
/// those of `sample` and `tasks sample`. Both commands find them, add nothing, and write the same bytes. The test takes about twenty seconds: finite elements
/// are solved five times.
#[test]
fn gathered_models_serve_as_trained_ones() {
    let dir = tempfile::tempdir().unwrap();
    for id in ["left", "right"] {
        replica_with_id(&dir.path().join("eyes").join(id), id);
    }
    let run = |cache: &str, arguments: &[&str]| vitreo_with_cache(dir.path(), cache, arguments);
    let list = ["tasks", "models", "eyes", "--out", "list", "--quiet"];
    says(&run("", &list).exits(0), &["A list of 2 tasks is in list"]);
    says(&run("", &["tasks", "run", "list", "--jobs", "2", "--quiet"]).exits(0), &["2 tasks finished"]);
    run("", &["gather", "list", "--quiet"]).refuses(&["VITREO_UQ_CACHE", "no models are kept here"]);
    says(
        &run("other", &["gather", "list", "--quiet"]).exits(0),
        &["2 models were added to other; 0 were already there"],
    );
    says(
        &run("other", &["gather", "list", "--quiet"]).exits(0),
        &["0 models were added to other; 2 were already there"],
    );
    let gathered = models(&dir.path().join("other"));
    assert_eq!(gathered.len(), 2, "{gathered:?}");
    let of_study = |cache: &str| {
        let out = format!("study-{}", if cache == "own" { "a" } else { "b" });
        let options = ["sample", "eyes/left", "--steps", "1000", "--no-report", "--quiet", "--out", &out];
        let found = run(cache, &options);
        run(cache, &["tasks", "sample", "eyes", "--steps", "1000", "--out", &format!("{out}-list"), "--quiet"])
            .exits(0);
        run(cache, &["tasks", "run", &format!("{out}-list"), "--task", "0", "--quiet"]).exits(0);
        let mut files = tree(&dir.path().join(&out));
        // Run times are not results.
        files.retain(|path, _| !path.ends_with("timing.json"));
        (found.code, files, tree(&dir.path().join(format!("{out}-list/results"))))
    };
    let (with, without) = (of_study("other"), of_study("own"));
    assert_eq!(models(&dir.path().join("other")), gathered, "something was trained again");
    assert!(tree(&dir.path().join("own")) == tree(&dir.path().join("other")), "other models than those trained here");
    assert_eq!((with.0, with.1.keys().collect::<Vec<_>>()), (without.0, without.1.keys().collect::<Vec<_>>()));
    for (path, bytes) in &with.1 {
        assert!(without.1[path] == *bytes, "{} differs", path.display());
    }
    assert!(with.2 == without.2 && !with.2.is_empty());
}

/// An effect adds one task for its field, common to all eyes. Another protocol adds another surrogate. A damaged result is not used.
#[test]
fn models_are_listed_by_content() {
    let dir = tempfile::tempdir().unwrap();
    for id in ["left", "right"] {
        replica_with_id(&dir.path().join("eyes").join(id), id);
    }
    let run = |arguments: &[&str]| vitreo_with_cache(dir.path(), "", arguments);
    let pieces = |list: &str| {
        let text = std::fs::read_to_string(dir.path().join(list).join("tasks.jsonl")).unwrap();
        let piece = |line: &str| serde_json::from_str::<serde_json::Value>(line).unwrap()["arguments"]["piece"].clone();
        text.lines().map(piece).collect::<Vec<_>>()
    };
    run(&["tasks", "models", "eyes", "--with", "interface-slip", "--out", "slip", "--quiet"]).exits(0);
    assert_eq!(pieces("slip"), [serde_json::json!({ "field": "interface-slip" }), "surrogate".into()]);
    let toml = dir.path().join("eyes/right/experiment.toml");
    let text = std::fs::read_to_string(&toml).unwrap();
    std::fs::write(
        &toml,
        text.replace("calibration_cycles = [1]", "calibration_cycles = [1, 2]").replace("[2, 3, 4]", "[3, 4]"),
    )
    .unwrap();
    run(&["tasks", "models", "eyes", "--out", "laws", "--quiet"]).exits(0);
    assert_eq!(pieces("laws"), ["surrogate", "compliance", "surrogate"].map(serde_json::Value::from));
    run(&["tasks", "run", "laws", "--task", "1", "--quiet"]).exits(0);
    let results = dir.path().join("laws/results");
    let file = std::fs::read_dir(&results).unwrap().next().unwrap().unwrap().path();
    let bytes = std::fs::read(&file).unwrap();
    std::fs::write(&file, &bytes[..bytes.len() - 1]).unwrap();
    let gathered = vitreo_with_cache(dir.path(), "cache", &["gather", "laws", "--quiet"]).exits(1);
    says(&gathered, &["0 of 3 results exist", "0 models were added to cache"]);
    assert!(models(&dir.path().join("cache")).is_empty());
    // The apparatus has changed since the list was made.
    std::fs::write(&toml, text.replace("diameter_mm = 0.55", "diameter_mm = 0.6")).unwrap();
    let run = run(&["tasks", "run", "laws", "--task", "2", "--quiet"]);
    assert!(run.code == 2 && run.stderr.contains("have changed since the list was made"), "{run}");
}
