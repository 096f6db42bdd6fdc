//! User tests of `report`: one page that fetches nothing, agrees with the documents, and lists commands that reproduce the study.

use crate::program;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use program::{drifting_replica, tree, vitreo, write_instrument_experiment};

fn page(study: &Path) -> String {
    std::fs::read_to_string(study.join("report.html")).expect("a page")
}

/// Text of the page's list of commands.
fn commands(page: &str) -> Vec<String> {
    let (_, rest) = page.split_once("<pre>").expect("commands");
    let (list, _) = rest.split_once("</pre>").expect("an end");
    list.lines().map(|line| line.replace("&quot;", "\"")).collect()
}

/// Files of a study that a second run reproduces: all except wall-clock times and locks.
fn lasting(study: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = tree(study);
    files.retain(|path, _| !path.ends_with("timing.json") && !path.ends_with(".lock"));
    files
}

/// Runs a page's commands again and compares the files with the study's, byte for byte.
fn assert_made_again(dir: &Path, experiment: &str, study: &str) {
    for line in commands(&page(&dir.join(study))) {
        let words: Vec<String> = line
            .split_whitespace()
            .skip(1)
            .map(|word| match word {
                "EXPERIMENT" => experiment.into(),
                "STUDY" => "again".into(),
                file if file.ends_with("model.toml") => format!("{study}/{file}"),
                word => word.into(),
            })
            .collect();
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        let run = vitreo(dir, &[&words[..], &["--quiet"]].concat());
        assert!(run.code < 2, "{line}: {run}");
    }
    let (made, again) = (lasting(&dir.join(study)), lasting(&dir.join("again")));
    assert_eq!(made.keys().collect::<Vec<_>>(), again.keys().collect::<Vec<_>>());
    let other: Vec<&PathBuf> =
        made.iter().filter(|(path, bytes)| again[*path] != **bytes).map(|(path, _)| path).collect();
    assert!(other.is_empty(), "{other:?}");
}

/// Asserts that nothing is fetched and nothing runs: no address, no script, links only within the page.
fn assert_self_contained(page: &str) {
    for word in ["<script", "<link", "<img", "<iframe", "src=", "url(", "@import", "javascript:"] {
        assert!(!page.contains(word), "{word}");
    }
    assert!(page.match_indices("href=\"").all(|(at, _)| page[at..].starts_with("href=\"#")), "a link leads out");
    assert!(page.len() < 3_000_000, "{} bytes", page.len());
}

/// The drift makes m0 fail, and the page says so; with the effect it is sound. A ladder of a replaced posterior is not shown.
#[test]
#[ignore = "thorough"]
fn a_study_is_one_page_whose_commands_make_it_again() {
    let dir = tempfile::tempdir().unwrap();
    let (at, study) = (dir.path(), dir.path().join("a"));
    drifting_replica(at);
    let run = vitreo(at, &["sample", "drifting", "--out", "a"]).exits(1);
    assert!(run.stderr.contains("Report: a/report.html"), "{run}");
    let failing = page(&study);
    for words in
        ["Not to be trusted as it stands", "Exit code 1", "800 positions were measured", "1 of 4 cycles were fitted"]
    {
        assert!(failing.contains(words), "`{words}`");
    }
    let posterior = vitreo(at, &["compare", "a", "--json", "-", "--quiet"]).exits(0).json();
    let extension = vitreo(at, &["extend", "a", "--with", "tracking-drift", "--json", "-", "--quiet"]).exits(0).json();
    let ladder = vitreo(at, &["ladder", "a", "--json", "-", "--quiet"]).exits(0).json();
    let whole = page(&study);
    for document in [&posterior, &extension, &ladder] {
        let sentence = document["sentence"].as_str().unwrap();
        assert!(whole.contains(sentence), "`{sentence}`");
    }
    for words in [
        "Predictions can be trusted; parameters are effective values",
        "The largest strain at the integration points is",
        "Exit code 0",
        "Failure map",
        "in sd",
        "vitreo-uq diagnose STUDY",
    ] {
        assert!(whole.contains(words), "`{words}`");
    }
    assert_self_contained(&whole);
    // The predictive figures of both models, three of the comparison, the corners, traces and singular values of both, the ladder.
    assert!(whole.matches("<figure>").count() >= 10, "{}", whole.matches("<figure>").count());
    assert_made_again(at, "drifting", "a");

    vitreo(at, &["sample", "a", "--seed", "2", "--quiet"]).exits(1);
    assert!(!page(&study).contains(ladder["sentence"].as_str().unwrap()), "an old ladder is shown");
}

/// Commands reproduce the model's options as given. A name that looks like markup stays text.
#[test]
#[ignore = "thorough"]
fn commands_have_the_models_options_and_names_are_only_names() {
    let dir = tempfile::tempdir().unwrap();
    let at = dir.path();
    write_instrument_experiment(&at.join("gel"), true, 0.0);
    let file = at.join("gel/experiment.toml");
    let name = "<b onload=x>gel & \\\"jelly\\\"</b>";
    std::fs::write(&file, std::fs::read_to_string(&file).unwrap().replace("id = \"gel\"", &format!("id = \"{name}\"")))
        .unwrap();
    let options = [
        "--base",
        "burgers",
        "--noise",
        "white,gain",
        "--set",
        "noise_sd_um=0.5",
        "--with",
        "force-bias",
        "--seed",
        "3",
    ];
    let run = vitreo(at, &[&["sample", "gel", "--out", "a", "--quiet"], &options[..]].concat());
    assert!(run.code < 2, "{run}");
    let page = page(&at.join("a"));
    assert!(page.contains("&lt;b onload=x&gt;gel &amp; ") && !page.contains("<b onload"), "markup in a name");
    assert_self_contained(&page);
    let [command] = &commands(&page)[..] else { panic!("{:?}", commands(&page)) };
    for option in ["--base burgers", "--noise white,gain", "--set noise_sd_um=0.5", "--with force-bias", "--seed 3"] {
        assert!(command.contains(option), "{command}");
    }
    assert_made_again(at, "gel", "a");
}

#[test]
fn what_cannot_be_shown_is_refused_and_what_is_not_wanted_is_not_written() {
    let dir = tempfile::tempdir().unwrap();
    let at = dir.path();
    write_instrument_experiment(&at.join("gel"), true, 0.0);
    vitreo(at, &["report", "gel"]).refuses(&["this is not a study"]);
    vitreo(at, &["fit", "gel", "--out", "fitted", "--quiet"]).exits(0);
    vitreo(at, &["report", "fitted"]).refuses(&["no revision yet", "vitreo-uq sample"]);
    let run = vitreo(at, &["sample", "gel", "--out", "a", "--quiet", "--no-report"]);
    assert!(run.code < 2 && !at.join("a/report.html").exists(), "{run}");
    let run = vitreo(at, &["report", "a", "--out", "elsewhere.html"]).exits(0);
    assert!(run.stderr.contains("elsewhere.html") && !at.join("a/report.html").exists(), "{run}");

    let corner = at.join("a/m0/figures/corner.svg");
    let drawing = std::fs::read_to_string(&corner).unwrap();
    std::fs::write(&corner, drawing.replace("</svg>", "<script>1</script></svg>")).unwrap();
    vitreo(at, &["report", "a"]).refuses(&["corner.svg", "not a figure of this program"]);
    std::fs::write(&corner, drawing).unwrap();
    let posterior = at.join("a/m0/posterior.json");
    let text = std::fs::read_to_string(&posterior).unwrap();
    std::fs::write(&posterior, text.replace("\"heldout\"", "\"held\"")).unwrap();
    vitreo(at, &["report", "a"]).refuses(&["posterior.json", "this document is unreadable", "again"]);
    assert!(!at.join("a/report.html").exists());
}

/// The document of `challenge run` becomes a page. Any other document is refused with its line.
#[test]
#[ignore = "thorough"]
fn played_challenges_are_a_page() {
    let place = tempfile::tempdir().unwrap();
    let play = ["challenge", "run", "--count", "1", "--only", "none", "--json", "plays.json", "--quiet"];
    vitreo(place.path(), &play).exits(0);
    vitreo(place.path(), &["report", "plays.json", "--out", "plays.html", "--quiet"]).exits(0);
    let page = std::fs::read_to_string(place.path().join("plays.html")).unwrap();
    assert_self_contained(&page);
    assert!(page.contains("nothing hidden: an effect claimed") && page.contains("1 record"));
    std::fs::write(place.path().join("other.json"), "{\"played\": 3}").unwrap();
    let refused = vitreo(place.path(), &["report", "other.json"]).exits(2);
    assert!(refused.stderr.contains("challenge run --json") && !place.path().join("report.html").exists());
}
