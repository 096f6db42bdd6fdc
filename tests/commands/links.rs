//! Studies crafted by another person, with links, pipes and all sorts of names. Nothing outside a study is read, written or removed, and no command hangs.
#![cfg(unix)]

use crate::program;

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::http;
use program::{tree, vitreo, write_instrument_experiment};

const N_STUDIES: usize = 200;
/// Number of cases in the quick test.
const N_QUICK: usize = 20;
/// Time limit, far above the need of any of the commands.
const PATIENCE: Duration = Duration::from_secs(60);
/// Text outside the study that must never appear.
const SECRET: &str = "SECRETOFNOBODY";
/// Names with a meaning to shells, options and file systems.
const NAMES: [&str; 24] = [
    ".lock",
    ".m0.checkpoint",
    ".m0.replaced",
    ".m1.replaced",
    ".m0.partial-4194303-abcdef",
    ".partial-4194303-abcdef",
    ".vitreo-uq-workbench",
    "--force",
    "-",
    "$(touch pwned)",
    "a\nb",
    "a\"b'c",
    "comparison.json",
    "corner.svg",
    "diagnosis.json",
    "extension.json",
    "figures",
    "ladder.json",
    "m1",
    "m7",
    "prior.toml",
    "report.html",
    "simulation",
    "up",
];

/// Makes a small study with one revision, a comparison and a ladder.
fn put_study(place: &Path) -> PathBuf {
    write_instrument_experiment(&place.join("gel"), true, 0.0);
    let study = place.join("study");
    let path = study.to_str().unwrap();
    for arguments in [
        &["sample", "gel", "--out", path, "--quiet"][..],
        &["compare", path, "--simulations", "59", "--quiet"],
        &["ladder", path, "--quiet"],
    ] {
        let ran = vitreo(place, arguments);
        assert!(matches!(ran.code, 0 | 1), "{ran}");
    }
    study
}

/// Writes a directory with other private files and a study that has the secret in all its texts.
fn put_outside(study: &Path, outside: &Path) {
    for (path, bytes) in tree(study) {
        let path = outside.join(path);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        let bytes = match String::from_utf8(bytes) {
            Ok(text) => text.replace("synthetic: closed form", SECRET).replace("gel", SECRET).into_bytes(),
            Err(other) => other.into_bytes(),
        };
        std::fs::write(path, bytes).unwrap();
    }
    std::fs::write(outside.join("secret"), format!("{SECRET}\n")).unwrap();
    std::fs::write(outside.join("secret.svg"), format!("<svg >{SECRET}</svg>")).unwrap();
    std::fs::write(outside.join("secret.toml"), format!("{SECRET} = ]\n")).unwrap();
}

/// All entries of a directory without following links: kind, permissions and content.
fn state(dir: &Path) -> BTreeMap<PathBuf, (String, u32, Vec<u8>)> {
    let mut found = BTreeMap::new();
    let mut waiting = vec![dir.to_path_buf()];
    while let Some(folder) = waiting.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let metadata = path.symlink_metadata().unwrap();
            let (kind, content) = match metadata.file_type() {
                kind if kind.is_symlink() => {
                    ("link", std::fs::read_link(&path).unwrap().as_os_str().as_encoded_bytes().to_vec())
                }
                kind if kind.is_dir() => ("folder", Vec::new()),
                kind if kind.is_file() => ("file", std::fs::read(&path).unwrap()),
                _ => ("other", Vec::new()),
            };
            if kind == "folder" {
                waiting.push(path.clone());
            }
            found.insert(path, (kind.to_string(), metadata.permissions().mode(), content));
        }
    }
    found
}

/// Copies a tree without following links.
fn copy(from: &Path, to: &Path) {
    let copied = Command::new("cp").arg("-a").arg(from).arg(to).status().unwrap();
    assert!(copied.success());
}

fn pick<'a, T>(random: &mut ChaCha8Rng, all: &'a [T]) -> &'a T {
    &all[random.random_range(0..all.len())]
}

/// Changes a study as a hostile sender might, and returns descriptions of the changes.
fn craft(study: &Path, outside: &Path, random: &mut ChaCha8Rng) -> Vec<String> {
    let mut done = Vec::new();
    for _ in 0..random.random_range(1..4) {
        let all: Vec<(PathBuf, String)> = state(study).into_iter().map(|(path, (kind, ..))| (path, kind)).collect();
        let files: Vec<&PathBuf> = all.iter().filter(|pair| pair.1 == "file").map(|pair| &pair.0).collect();
        let mut folders: Vec<&PathBuf> = all.iter().filter(|pair| pair.1 == "folder").map(|pair| &pair.0).collect();
        let root = study.to_path_buf();
        folders.push(&root);
        let relative = |path: &Path| path.strip_prefix(study).unwrap().to_path_buf();
        // Position of the change: in place of a file or directory, or beside others under a meaningful name.
        let place = match random.random_range(0..5) {
            0 | 1 if !files.is_empty() => (*pick(random, &files)).clone(),
            2 if folders.len() > 1 => folders[random.random_range(0..folders.len() - 1)].clone(),
            _ => pick(random, &folders).join(pick(random, &NAMES)),
        };
        let inside = relative(&place);
        let twin = if outside.join(&inside).exists() { outside.join(&inside) } else { outside.join("secret") };
        if place.symlink_metadata().is_ok_and(|metadata| metadata.is_dir()) {
            std::fs::remove_dir_all(&place).unwrap();
        } else if place.symlink_metadata().is_ok() {
            std::fs::remove_file(&place).unwrap();
        }
        let deep = "../".repeat(inside.components().count() + 1);
        let target = match random.random_range(0..14) {
            0..=3 => twin,
            4 => outside.to_path_buf(),
            5 => outside.join(pick(random, &["secret", "secret.svg", "secret.toml", "m0", "new-file"])),
            6 => PathBuf::from(deep + "outside/secret"),
            7 => PathBuf::from(".."),
            8 => PathBuf::from("/"),
            9 => place.file_name().unwrap().into(),
            10 => PathBuf::from("nothing-is-here"),
            11 => PathBuf::from("/dev/zero"),
            12 => {
                assert!(Command::new("mkfifo").arg("--").arg(&place).status().unwrap().success());
                done.push(format!("{inside:?} is a pipe"));
                continue;
            }
            _ => {
                // Paths longer than a socket allows are skipped.
                if std::os::unix::net::UnixListener::bind(&place).is_ok() {
                    done.push(format!("{inside:?} is a socket"));
                }
                continue;
            }
        };
        symlink(&target, &place).unwrap();
        done.push(format!("{inside:?} -> {target:?}"));
    }
    // Names in the study's own texts are changed.
    let secret = outside.join("secret.toml").display().to_string();
    let edit = |name: &str, from: &str, to: &str| {
        let path = study.join(name);
        if path.symlink_metadata().is_ok_and(|metadata| metadata.is_file()) {
            let text = std::fs::read_to_string(&path).unwrap();
            std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
        }
    };
    let edits: [(&str, &str, String); 5] = [
        ("inputs.sha256", "", format!("{}  {secret}\n", "0".repeat(64))),
        ("inputs.sha256", "", format!("{}  ../outside/secret\n", "0".repeat(64))),
        ("inputs.sha256", "  trajectory.csv", "  ../outside/trajectory.csv".into()),
        ("m0/model.toml", "prior = \"", format!("prior = \"{secret}\" #")),
        ("experiment.toml", "trajectory.csv", "../outside/trajectory.csv".into()),
    ];
    if random.random_range(0..4) == 0 {
        let (name, from, to) = pick(random, &edits);
        edit(name, from, to);
        done.push(format!("{name}: {to:?}"));
    }
    done
}

/// Runs the program and kills it after the time limit. Returns the exit code and all output.
#[track_caller]
fn said(dir: &Path, arguments: &[&str]) -> (i32, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vitreo-uq"));
    command.current_dir(dir).args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let (mut out, mut err) = (child.stdout.take().unwrap(), child.stderr.take().unwrap());
    let reader = std::thread::spawn(move || {
        let mut bytes = Vec::new();
        let _ = out.read_to_end(&mut bytes);
        bytes
    });
    let waiter = std::thread::spawn(move || {
        let mut bytes = Vec::new();
        let _ = err.read_to_end(&mut bytes);
        bytes
    });
    let began = Instant::now();
    let code = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status.code().unwrap_or(-1);
        }
        if began.elapsed() > PATIENCE {
            let _ = child.kill();
            panic!("{arguments:?} hangs");
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    let all = [reader.join().unwrap(), waiter.join().unwrap()].concat();
    (code, String::from_utf8_lossy(&all).into_owned())
}

/// Asserts that no regular file contains the secret.
#[track_caller]
fn has_no_secret(dir: &Path, what: &dyn std::fmt::Debug) {
    for (path, (kind, _, bytes)) in state(dir) {
        let is_found = kind == "file" && bytes.windows(SECRET.len()).any(|window| window == SECRET.as_bytes());
        assert!(!is_found, "{} holds the secret: {what:?}", path.display());
    }
}

fn play(numbers: std::ops::Range<usize>) {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    let base = put_study(place.path());
    put_outside(&base, &at("outside"));
    std::fs::create_dir(at("home")).unwrap();
    std::fs::create_dir(at("work")).unwrap();
    let before = state(&at("outside"));
    let mut n_refused = 0;
    let mut crafted = BTreeMap::new();
    for number in numbers {
        let name = format!("s{number:03}");
        let study = at("home").join(&name);
        copy(&base, &study);
        let random = &mut ChaCha8Rng::seed_from_u64(number as u64);
        let done = craft(&study, &at("outside"), random);
        let path = study.display().to_string();
        for arguments in [
            &["report", &path, "--quiet"][..],
            &["corner", &path, "--out", &format!("{path}/corner"), "--quiet"],
            &["compare", &path, "--simulations", "59", "--quiet"],
            &["ladder", &path, "--quiet"],
        ] {
            let (code, text) = said(&at("work"), arguments);
            assert!((0..=2).contains(&code) && !text.contains("panicked"), "{arguments:?} on {done:?}: {code} {text}");
            assert!(!text.contains(SECRET), "{arguments:?} on {done:?} says the secret: {text}");
            n_refused += usize::from(text.contains("symbolic link"));
            assert!(state(&at("outside")) == before, "{arguments:?} on {done:?} changed files outside");
            assert!(
                std::fs::read_dir(at("work")).unwrap().next().is_none(),
                "{arguments:?} on {done:?} wrote elsewhere"
            );
        }
        has_no_secret(&study, &done);
        crafted.insert(name, done);
    }
    assert!(n_refused > crafted.len() / 2, "{n_refused} refusals of links");
    // The folder of a workbench contains links, too.
    symlink(at("outside"), at("home").join("linked")).unwrap();
    symlink(at("outside"), at("home").join("vitreo-uq-out")).unwrap();
    look_by_workbench(&at("home"), &crafted);
    assert!(state(&at("outside")) == before, "the workbench changed files outside");
    has_no_secret(&at("home"), &"workbench");
    let mut names: Vec<_> = std::fs::read_dir(place.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["gel", "home", "outside", "study", "work"]);
}

/// Reads all studies of a folder as the page does.
fn look_by_workbench(home: &Path, crafted: &BTreeMap<String, Vec<String>>) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vitreo-uq"));
    command.args(["workbench", "--port", "0", "--quiet"]).current_dir(home).stdout(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut link = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut link).unwrap();
    let (address, token) = link.trim().trim_start_matches("http://").split_once('/').unwrap();
    let (address, token) = (address.parse().unwrap(), token.trim_end_matches('/'));
    let get = |path: &str| {
        let began = Instant::now();
        let (status, text) = http::ask(address, "GET", &format!("/{token}/{path}"), "", b"", PATIENCE);
        assert!(status > 0 && began.elapsed() < PATIENCE, "{path} hangs");
        assert!(!text.contains(SECRET), "{path} shows the secret: {text}");
        (status, text)
    };
    let (status, items) = get("api/items");
    assert!(status == 200 && !items.contains("linked") && !items.contains("vitreo-uq-out/m0"), "{items}");
    for (name, done) in crafted {
        let (status, text) = get(&format!("api/study?item={name}"));
        assert!([200, 422].contains(&status), "{done:?}: {status} {text}");
        get(&format!("api/rows?item={name}&revision=m0"));
        for path in ["m0/posterior.json", "m0/draws.csv", "m0/figures/corner.svg", "report.html", "up/secret.svg"] {
            let (status, text) = get(&format!("file?item={name}&path={path}"));
            assert!([200, 404, 500].contains(&status), "{done:?} {path}: {status} {text}");
        }
    }
    assert_eq!(get("api/study?item=linked").0, 422);
    let _ = child.kill();
    let _ = child.wait();
}

#[test]
fn nothing_outside_a_crafted_study_is_touched() {
    play(0..N_QUICK);
}

#[test]
#[ignore = "campaigns/long-tests"]
fn nothing_outside_200_crafted_studies_is_touched() {
    play(0..N_STUDIES);
}

/// Links inside a study are named by every command, with the expected words.
#[test]
fn links_in_a_study_are_named() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    let base = put_study(place.path());
    put_outside(&base, &at("outside"));
    let before = state(&at("outside"));
    let studies = |name: &str| {
        let study = at(name);
        copy(&base, &study);
        study
    };
    let words = ["symbolic link; links inside a study are not followed", "what to do: put a copy"];
    let refused = |study: &Path, command: &str, link: &str| {
        vitreo(place.path(), &[command, study.to_str().unwrap(), "--quiet"]).refuses(&[link, words[0], words[1]]);
        assert!(state(&at("outside")) == before, "{command} through {link}");
    };
    let study = studies("lock");
    std::fs::remove_file(study.join(".lock")).unwrap();
    symlink(at("outside/secret"), study.join(".lock")).unwrap();
    refused(&study, "compare", "lock/.lock");
    let study = studies("figure");
    symlink(at("outside/secret"), study.join("m0/figures/x.csv")).unwrap();
    refused(&study, "compare", "figure/m0/figures/x.csv");
    let study = studies("up");
    symlink("..", study.join("m0/up")).unwrap();
    refused(&study, "compare", "up/m0/up");
    let study = studies("revision");
    std::fs::remove_dir_all(study.join("m0")).unwrap();
    symlink(at("outside/m0"), study.join("m0")).unwrap();
    for command in ["compare", "report", "ladder", "corner"] {
        refused(&study, command, "revision/m0");
    }
    let study = studies("table");
    std::fs::remove_file(study.join("trajectory.csv")).unwrap();
    symlink(at("outside/trajectory.csv"), study.join("trajectory.csv")).unwrap();
    refused(&study, "report", "table/trajectory.csv");
    // The study itself may be reached by a link, and writing replaces a link.
    let study = studies("real");
    std::fs::remove_file(study.join("report.html")).unwrap();
    symlink(at("outside/secret"), study.join("report.html")).unwrap();
    symlink(&study, at("named")).unwrap();
    vitreo(place.path(), &["report", "named"]).exits(0);
    vitreo(place.path(), &["compare", "named", "--simulations", "59"]).exits(0);
    assert!(study.join("report.html").symlink_metadata().unwrap().is_file());
    assert!(state(&at("outside")) == before);
}

/// A manipulated list of tasks, with recomputed hashes, writes nothing outside its directory.
#[test]
fn a_crafted_list_of_tasks_writes_nowhere_else() {
    let hash = |text: &str| vitreo_uq::base::sha256::sha256_hex(text.as_bytes());
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    write_instrument_experiment(&at("gel"), true, 0.0);
    std::fs::write(at("lines.txt"), "check gel --json {out}/check.json --out {out}/record --quiet\n").unwrap();
    vitreo(place.path(), &["tasks", "commands", "lines.txt", "--out", "list", "--quiet"]).exits(0);
    let read = |name: &str| -> serde_json::Value {
        serde_json::from_slice(&std::fs::read(at("list").join(name)).unwrap()).unwrap()
    };
    let (head, line) = (read("tasks.json"), read("tasks.jsonl"));
    let write = |line: &serde_json::Value| {
        let text = format!("{line}\n");
        let mut head = head.clone();
        head["lines_sha256"] = hash(&text).into();
        std::fs::write(at("list/tasks.jsonl"), text).unwrap();
        std::fs::write(at("list/tasks.json"), head.to_string()).unwrap();
    };
    // An attacker knows the program, and gives each task the id of its arguments.
    let with_words = |words: &[&str]| {
        let mut line = line.clone();
        line["arguments"]["words"] = serde_json::json!(words);
        line["arguments"]["inputs"] = serde_json::json!({});
        let id = hash(&format!("{}\ncommands\n{}", head["program"].as_str().unwrap(), line["arguments"]));
        line["result"] = format!("results/{}.task", &id[..24]).into();
        line["id"] = id.into();
        line
    };
    let names = || {
        let mut names: Vec<_> = std::fs::read_dir(place.path()).unwrap().map(|dir| dir.unwrap().file_name()).collect();
        names.sort();
        names
    };
    let before = names();
    let escaped = at("escaped").display().to_string();
    for (key, value) in [
        ("result", "../escaped.task".to_string()),
        ("result", escaped.clone()),
        ("result", "results/other.task".to_string()),
        ("id", format!("../../escaped{}", "0".repeat(52))),
        ("id", format!("{escaped}{}", "0".repeat(52))),
        ("id", "x".to_string()),
    ] {
        let mut changed = line.clone();
        changed[key] = value.into();
        write(&changed);
        for arguments in [&["tasks", "run", "list", "--task", "0"][..], &["gather", "list", "--quiet"]] {
            vitreo(place.path(), arguments).refuses(&["tasks.jsonl, line 1", "do not match this task"]);
        }
        assert_eq!(names(), before, "{key}");
    }
    write(&with_words(&["check", "--json", "{out}/a.json", "--out", "{out}/record", "--quiet"]));
    vitreo(place.path(), &["tasks", "run", "list", "--task", "0"]).exits(0);
    for place_of in ["../escaped", escaped.as_str(), "{out}/../../escaped", "escaped"] {
        for words in [
            vec!["check", "--json", place_of, "--out", "{out}/record"],
            vec!["check", "--json", "{out}/a.json", "--out", place_of],
            vec!["sample", "--steps", "1", "--out", place_of, "--json", "{out}/a"],
        ] {
            write(&with_words(&words));
            let text = format!("`{place_of}` is not below `{{out}}`");
            vitreo(place.path(), &["tasks", "run", "list", "--task", "0"]).refuses(&["tasks.jsonl, line 1", &text]);
            assert_eq!(names(), before, "{words:?}");
        }
    }
    for words in [&["workbench", "{out}"][..], &["tasks", "run", "list", "--part", "{out}"], &["rm", "{out}"]] {
        write(&with_words(words));
        vitreo(place.path(), &["tasks", "run", "list", "--task", "0"]).refuses(&["line 1"]);
    }
    // Results that would go through a link.
    write(&line);
    std::fs::create_dir(at("elsewhere")).unwrap();
    std::fs::remove_dir_all(at("list/results")).unwrap();
    symlink(at("elsewhere"), at("list/results")).unwrap();
    let words = "symbolic link; links inside a list of tasks are not followed";
    vitreo(place.path(), &["tasks", "run", "list", "--task", "0"]).refuses(&["list/results", words]);
    assert!(std::fs::read_dir(at("elsewhere")).unwrap().next().is_none());
}

/// The crafted studies of the tests above contain all kinds of changes.
#[test]
fn crafted_studies_have_all_sorts_of_things() {
    let place = tempfile::tempdir().unwrap();
    let base = place.path().join("base");
    std::fs::create_dir_all(base.join("m0/figures")).unwrap();
    for name in ["inputs.sha256", "experiment.toml", "trajectory.csv", "m0/model.toml", "m0/figures/corner.svg"] {
        std::fs::write(base.join(name), "prior = \"a\"  trajectory.csv").unwrap();
    }
    put_outside(&base, &place.path().join("outside"));
    let mut counts = BTreeMap::new();
    for number in 0..N_STUDIES {
        let study = place.path().join(format!("s{number}"));
        copy(&base, &study);
        let done = craft(&study, &place.path().join("outside"), &mut ChaCha8Rng::seed_from_u64(number as u64));
        assert!(!done.is_empty() || number > 0);
        for (path, (kind, ..)) in state(&study) {
            let is_pipe = path.symlink_metadata().unwrap().file_type().is_fifo();
            *counts.entry(if is_pipe { "pipe".to_string() } else { kind }).or_insert(0) += 1;
        }
    }
    assert!(counts["link"] > 200 && counts["pipe"] > 5 && counts["other"] > 5, "{counts:?}");
}
