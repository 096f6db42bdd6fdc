//! User and engine tests of `tasks` and `gather` on small experiments: the bytes equal those of one machine, even after failures.

use crate::program;

use std::path::{Path, PathBuf};
use std::process::Command;

use program::{Run, tree, vitreo, write_instrument_experiment};

/// Four experiments of an instrument, of two species, in `dir/cohort`.
fn write_cohort(dir: &Path) {
    for (index, species) in ["ox", "ox", "pig", "pig"].iter().enumerate() {
        let experiment = dir.join(format!("cohort/eye-{index}"));
        write_instrument_experiment(&experiment, true, 0.01 * index as f64);
        edited(
            &experiment.join("experiment.toml"),
            "id = \"gel\"\n",
            &format!("id = \"eye-{index}\"\nspecies = \"{species}\"\n"),
        );
    }
}

fn edited(file: &Path, from: &str, to: &str) {
    let text = std::fs::read_to_string(file).unwrap();
    assert!(text.contains(from), "{from} in {}", file.display());
    std::fs::write(file, text.replacen(from, to, 1)).unwrap();
}

/// A list of the cohort in `dir/list`.
fn make_list(dir: &Path) {
    write_cohort(dir);
    let run = vitreo(dir, &["tasks", "sample", "cohort", "--out", "list", "--quiet"]).exits(0);
    assert!(run.stdout.contains("A list of 4 tasks is in list"), "{run}");
}

/// Files of results, in the order of the tasks.
fn results(dir: &Path) -> Vec<PathBuf> {
    let text = std::fs::read_to_string(dir.join("list/tasks.jsonl")).unwrap();
    let result = |line: &str| {
        let line: serde_json::Value = serde_json::from_str(line).unwrap();
        dir.join("list").join(line["result"].as_str().unwrap())
    };
    text.lines().map(result).collect()
}

#[track_caller]
fn says(run: &Run, words: &[&str]) {
    for word in words {
        assert!(run.stdout.contains(word), "`{word}` is missing in {run}");
    }
}

/// Runs a shell command line in `dir`, with the program as `$VITREO`.
fn shell(dir: &Path, line: &str) -> Run {
    let output = Command::new("bash")
        .args(["-c", line])
        .current_dir(dir)
        .env("VITREO", env!("CARGO_BIN_EXE_vitreo-uq"))
        .output()
        .expect("a shell");
    Run {
        code: output.status.code().unwrap_or(-1),
        stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
        stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
    }
}

/// The gathered files equal those of `groups` on one machine, and `groups` uses them without sampling again.
#[test]
fn a_gathered_cohort_has_the_bytes_of_one_machine() {
    let dir = tempfile::tempdir().unwrap();
    make_list(dir.path());
    let one = vitreo(dir.path(), &["groups", "cohort", "--out", "one", "--quiet"]);
    // One task by number, one part by two processes at once, and the rest.
    says(&vitreo(dir.path(), &["tasks", "run", "list", "--task", "2", "--quiet"]).exits(0), &["Task 2 is done"]);
    let twice = shell(
        dir.path(),
        "\"$VITREO\" tasks run list --part 0/2 --quiet & \"$VITREO\" tasks run list --part 0/2 --quiet; wait $!",
    );
    twice.exits(0);
    let partial = vitreo(dir.path(), &["gather", "list", "--quiet"]).exits(1);
    says(&partial, &["3 of 4 results exist", "Task 3 has no result", "absent"]);
    let rest = vitreo(dir.path(), &["tasks", "run", "list", "--jobs", "2", "--quiet"]).exits(0);
    says(&rest, &["1 task finished; 3 tasks had results before"]);
    let whole = vitreo(dir.path(), &["gather", "list", "--json", "-", "--quiet"]).exits(0).json();
    assert_eq!((&whole["schema"], &whole["kind"]), (&"vitreo-uq/gathered/1".into(), &"sample".into()));
    assert_eq!((&whole["results"], &whole["missing"]), (&4.into(), &serde_json::json!([])));
    let experiments = tree(&dir.path().join("one/experiments"));
    assert_eq!(experiments.len(), 4);
    assert!(experiments == tree(&dir.path().join("list/gathered/experiments")), "other bytes than on one machine");
    let again = vitreo(dir.path(), &["groups", "cohort", "--out", "list/gathered", "--quiet"]);
    assert_eq!((again.code, &again.stdout), (one.code, &one.stdout));
    assert!(tree(&dir.path().join("one")) == tree(&dir.path().join("list/gathered")));
}

/// Truncated, changed and foreign results are named and never used. Running the list again replaces them.
#[test]
fn no_damaged_result_is_taken() {
    let dir = tempfile::tempdir().unwrap();
    make_list(dir.path());
    vitreo(dir.path(), &["tasks", "run", "list", "--quiet"]).exits(0);
    vitreo(dir.path(), &["gather", "list", "--quiet", "--out", "before"]).exits(0);
    let files = results(dir.path());
    let bytes: Vec<Vec<u8>> = files.iter().map(|file| std::fs::read(file).unwrap()).collect();
    std::fs::write(&files[0], &bytes[0][..bytes[0].len() - 1]).unwrap();
    let mut changed = bytes[1].clone();
    let last_digit = changed.iter().rposition(u8::is_ascii_digit).unwrap();
    changed[last_digit] = if changed[last_digit] == b'1' { b'2' } else { b'1' };
    std::fs::write(&files[1], changed).unwrap();
    std::fs::write(&files[2], &bytes[3]).unwrap();
    edited(&files[3], concat!("\"program\":\"", env!("CARGO_PKG_VERSION")), "\"program\":\"0.0.1");
    std::fs::write(dir.path().join("list/results/stray.task"), b"").unwrap();
    let gathered = vitreo(dir.path(), &["gather", "list", "--json", "-", "--quiet"]).exits(1).json();
    let faults: Vec<&str> =
        gathered["missing"].as_array().unwrap().iter().map(|value| value["fault"].as_str().unwrap()).collect();
    assert_eq!(faults, ["truncated", "damaged", "other-task", "other-program"]);
    assert_eq!(gathered["foreign"], serde_json::json!(["results/stray.task"]));
    assert!(tree(&dir.path().join("list/gathered")).is_empty(), "something was made of damaged results");
    says(&vitreo(dir.path(), &["tasks", "run", "list", "--quiet"]).exits(0), &["4 tasks finished; 0 tasks had"]);
    vitreo(dir.path(), &["gather", "list", "--quiet"]).exits(0);
    assert!(tree(&dir.path().join("before")) == tree(&dir.path().join("list/gathered")));
    for (file, bytes) in files.iter().zip(bytes) {
        assert!(std::fs::read(file).unwrap() == bytes, "a task that was run again has other bytes");
    }
}

/// A worker that dies while it writes, and a full disk, are named after three attempts. No partial result remains, and the next run completes the list.
#[cfg(unix)]
#[test]
fn dying_workers_and_full_disks_lose_nothing() {
    let dir = tempfile::tempdir().unwrap();
    make_list(dir.path());
    // A file beyond the limit ends the process by a signal; if the signal is ignored, it is an error.
    for (limit, words) in [("ulimit -f 8", "its worker died (signal"), ("trap '' XFSZ; ulimit -f 8", "File too large")]
    {
        let line = format!("{limit}; \"$VITREO\" tasks run list --jobs 2 --quiet");
        let run = shell(dir.path(), &line).exits(1);
        says(&run, &["0 tasks finished", "Task 0 failed", words, "run the same command again"]);
        assert!(results(dir.path()).iter().all(|file| !file.exists()), "{run}");
    }
    says(&vitreo(dir.path(), &["tasks", "run", "list", "--quiet"]).exits(0), &["4 tasks finished"]);
    says(&vitreo(dir.path(), &["gather", "list", "--quiet"]).exits(0), &["4 of 4 results exist"]);
}

/// Inputs that changed since the list was made are refused by name. A new list reuses the results of unchanged inputs.
#[test]
fn changed_input_is_named_and_the_rest_is_kept() {
    let dir = tempfile::tempdir().unwrap();
    make_list(dir.path());
    vitreo(dir.path(), &["tasks", "run", "list", "--task", "0", "--quiet"]).exits(0);
    write_instrument_experiment(&dir.path().join("cohort/eye-1"), true, 0.5);
    let run = vitreo(dir.path(), &["tasks", "run", "list", "--quiet"]).exits(1);
    says(&run, &["2 tasks finished; 1 task had", "Task 1 failed", "eye-1", "have changed since the list was made"]);
    vitreo(dir.path(), &["tasks", "sample", "cohort", "--out", "list"]).refuses(&["list has other tasks", "--force"]);
    vitreo(dir.path(), &["tasks", "sample", "cohort", "--out", "list", "--force", "--quiet"]).exits(0);
    let run = vitreo(dir.path(), &["tasks", "run", "list", "--quiet"]).exits(0);
    says(&run, &["1 task finished; 3 tasks had results before"]);
    let same = vitreo(dir.path(), &["tasks", "sample", "cohort", "--out", "list", "--quiet"]).exits(0);
    says(&same, &["exists already"]);
}

/// The scripts run the whole list when an engine calls every part, also from another directory and with a space in the path.
#[cfg(unix)]
#[test]
fn scripts_hand_over_every_task_once() {
    let dir = tempfile::tempdir().unwrap();
    write_cohort(dir.path());
    vitreo(dir.path(), &["tasks", "sample", "cohort", "--out", "my list", "--quiet"]).exits(0);
    for (engine, script) in [("slurm", "submit-slurm.sh"), ("hq", "submit-hq.sh")] {
        let options = ["--parts", "3", "--cores", "2", "--minutes", "90", "--memory-mib", "700"];
        let run =
            vitreo(dir.path(), &[&["tasks", "run", "my list", "--engine", engine][..], &options].concat()).exits(0);
        says(&run, &["3 parts of 4 tasks", script]);
    }
    let slurm = std::fs::read_to_string(dir.path().join("my list/submit-slurm.sh")).unwrap();
    for line in ["--array=0-2", "--cpus-per-task=2", "--mem=700M", "--time=90", "--requeue"] {
        assert!(slurm.contains(&format!("#SBATCH {line}\n")), "{line} in {slurm}");
    }
    let run = shell(
        Path::new("/"),
        &format!("SLURM_ARRAY_TASK_ID=1 '{}'", dir.path().join("my list/submit-slurm.sh").display()),
    );
    says(&run.exits(0), &["1 task finished"]);
    // Substitute for HyperQueue: runs the command that follows `--` for every number of the array.
    let engine = r#"#!/usr/bin/env bash
[[ "$*" == *"--array 0-2 --cpus 2 --resource mem=700 --time-limit 90m"* ]] || exit 9
while [[ $1 != -- ]]; do shift; done; shift
for id in 0 1 2; do HQ_TASK_ID=$id "$@" || exit; done
"#;
    std::fs::create_dir(dir.path().join("bin")).unwrap();
    std::fs::write(dir.path().join("bin/hq"), engine).unwrap();
    let run =
        shell(dir.path(), "chmod +x bin/hq; PATH=$PWD/bin:$PATH; cd /; \"$OLDPWD/my list/submit-hq.sh\"").exits(0);
    says(&run, &["0 tasks finished; 1 task had", "1 task finished; 0 tasks had", "2 tasks finished; 0 tasks had"]);
    vitreo(dir.path(), &["gather", "my list", "--quiet"]).exits(0);
}

/// Refusals contain a remedy.
#[test]
fn what_is_no_list_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    make_list(dir.path());
    let refuses = |arguments: &[&str], words: &[&str]| {
        let run = vitreo(dir.path(), arguments).refuses(words);
        assert!(run.stderr.contains("what to do"), "{run}");
    };
    refuses(&["tasks", "run", "cohort"], &["tasks.json", "tasks KIND --out DIR"]);
    refuses(&["gather", "nowhere"], &["nowhere"]);
    refuses(&["tasks", "sample", "cohort", "--out", "cohort"], &["no list of tasks", "not empty"]);
    refuses(&["tasks", "sample", "cohort", "--out", "new", "--block", "0"], &["--block"]);
    refuses(&["tasks", "sample", "cohort", "--out", "new", "--with", "slipp"], &["slip"]);
    refuses(&["tasks", "challenge", "--count", "0", "--out", "new"], &["--count"]);
    refuses(&["tasks", "challenge", "--effect", "slipp", "--out", "new"], &["--effect", "slipp"]);
    refuses(&["tasks", "run", "list", "--task", "4"], &["no task 4", "0 to 3"]);
    refuses(&["tasks", "run", "list", "--part", "3"], &["--part", "3/100"]);
    refuses(&["tasks", "run", "list", "--part", "3/3"], &["part 3 of 3"]);
    refuses(&["tasks", "run", "list", "--jobs", "0"], &["--jobs"]);
    refuses(&["tasks", "run", "list", "--engine", "slurm", "--cores", "0"], &["--cores"]);
    assert!(!dir.path().join("new").exists());
    let lines = dir.path().join("list/tasks.jsonl");
    edited(&lines, "eye-0", "eye-9");
    refuses(&["tasks", "run", "list"], &["tasks.jsonl", "changed or cut short", "--force"]);
    refuses(&["gather", "list"], &["tasks.jsonl"]);
}

/// Challenges in blocks: one task per block, in order, the last one shorter.
#[test]
fn challenges_come_in_blocks() {
    let dir = tempfile::tempdir().unwrap();
    let arguments =
        ["tasks", "challenge", "--count", "7", "--first", "10", "--block", "3", "--out", "list", "--json", "-"];
    let head = vitreo(dir.path(), &arguments).exits(0).json();
    assert_eq!((&head["kind"], &head["tasks"], &head["seed"]), (&"challenge".into(), &3.into(), &1.into()));
    let text = std::fs::read_to_string(dir.path().join("list/tasks.jsonl")).unwrap();
    let lines: Vec<serde_json::Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let of = |key: &str| lines.iter().map(|line| line["arguments"][key].as_u64().unwrap()).collect::<Vec<_>>();
    assert_eq!((of("first"), of("count")), (vec![10, 13, 16], vec![3, 3, 1]));
}

/// A calibration in several blocks by two workers equals, byte for byte, that of one task in one process. The document judges its ranks. With 30 replicates a
/// correct program is called wrong in at most one of a hundred seeds; this seed is fixed.
#[test]
fn a_calibration_is_the_same_in_any_blocks() {
    let dir = tempfile::tempdir().unwrap();
    write_instrument_experiment(&dir.path().join("eye"), true, 0.0);
    let list = |out: &str, block: &str| {
        let options = ["tasks", "calibration", "eye", "--count", "30", "--quiet"];
        vitreo(dir.path(), &[&options[..], &["--block", block, "--out", out]].concat()).exits(0)
    };
    says(&list("one", "30"), &["A list of 1 tasks is in one"]);
    says(&list("many", "6"), &["A list of 5 tasks is in many"]);
    vitreo(dir.path(), &["tasks", "run", "one", "--task", "0", "--threads", "1", "--quiet"]).exits(0);
    vitreo(dir.path(), &["tasks", "run", "many", "--task", "3", "--quiet"]).exits(0);
    let partial = vitreo(dir.path(), &["gather", "many", "--out", "part", "--quiet"]).exits(1);
    says(&partial, &["1 of 5 results exist", "There is no verdict on the posteriors", "20 are needed"]);
    vitreo(dir.path(), &["tasks", "run", "many", "--jobs", "2", "--quiet"]).exits(0);
    let run = vitreo(dir.path(), &["gather", "many", "--quiet"]).exits(0);
    says(&run, &["5 of 5 results exist", "The posteriors are calibrated", "log_density", "calibration.json"]);
    vitreo(dir.path(), &["gather", "one", "--quiet"]).exits(0);
    let (one, many) = (tree(&dir.path().join("one/gathered")), tree(&dir.path().join("many/gathered")));
    let names: Vec<String> = one.keys().map(|path| path.display().to_string()).collect();
    assert_eq!(
        names,
        ["calibration.json", "figures/calibration.pdf", "figures/calibration.png", "figures/calibration.svg"]
    );
    assert!(one == many, "the gathered files depend on the blocks");
    let found: serde_json::Value = serde_json::from_slice(&one[Path::new("calibration.json")]).unwrap();
    assert_eq!((&found["schema"], &found["simulated_by"]), (&"vitreo-uq/calibration/1".into(), &"closed-form".into()));
    let (ranked, unranked) = (&found["ranked"], found["not_converged"].as_u64().unwrap());
    assert_eq!(ranked.as_u64().unwrap() + unranked, 30, "{found:#}");
    for value in found["quantities"].as_array().unwrap() {
        let counts = value["counts"].as_array().unwrap().iter().map(|count| count.as_u64().unwrap());
        assert_eq!(counts.sum::<u64>(), ranked.as_u64().unwrap(), "{value}");
    }
    // Another seed draws other truths.
    let options = ["tasks", "calibration", "eye", "--count", "30", "--seed", "2", "--out", "other", "--quiet"];
    vitreo(dir.path(), &options).exits(0);
    let id = |list: &str| std::fs::read_to_string(dir.path().join(list).join("tasks.jsonl")).unwrap();
    assert!(!id("other").contains(id("one").split('"').nth(5).unwrap()));
}

/// Impossible calibrations are refused before any computation, and a task refuses an experiment that has changed.
#[test]
fn calibrations_that_cannot_be_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    write_instrument_experiment(&dir.path().join("eye"), true, 0.0);
    let refuses = |options: &[&str], words: &[&str]| {
        let run = vitreo(dir.path(), &[&["tasks", "calibration", "eye", "--out", "new"][..], options].concat());
        assert!(run.refuses(words).stderr.contains("what to do"));
    };
    refuses(&["--count", "19"], &["--count", "20 to 100000"]);
    refuses(&["--count", "100001"], &["--count"]);
    refuses(&["--block", "0"], &["--block"]);
    refuses(&["--chains", "7"], &["--chains"]);
    refuses(&["--with", "slipp"], &["slip"]);
    vitreo(dir.path(), &["tasks", "calibration", ".", "--out", "new", "--with", "large-displacement"])
        .refuses(&["large-displacement"]);
    vitreo(dir.path(), &["tasks", "calibration", "nowhere", "--out", "new"]).refuses(&["nowhere"]);
    assert!(!dir.path().join("new").exists());
    vitreo(dir.path(), &["tasks", "calibration", "eye", "--count", "20", "--out", "list", "--quiet"]).exits(0);
    write_instrument_experiment(&dir.path().join("eye"), true, 0.5);
    let run = vitreo(dir.path(), &["tasks", "run", "list", "--task", "0", "--quiet"]).exits(2);
    assert!(run.stderr.contains("have changed since the list was made"), "{run}");
}
