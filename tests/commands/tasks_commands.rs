//! `tasks commands`: commands run anywhere, and the gathered files equal those of a local run.

use crate::program;

use std::path::Path;
#[cfg(unix)]
use std::process::Command;

use program::{Run, tree, vitreo, write_instrument_experiment};

const LIST: &str = "\
# two gels
vitreo-uq fit 'gel a' --out {out}/study --json {out}/fit.json --quiet
check gel-b --json {out}/check.json --quiet   # the second one
sample gel-b --steps 1000 --no-report --out {out} --quiet
";

/// Two experiments and a list of commands in `dir`.
fn write_all(dir: &Path, list: &str) {
    write_instrument_experiment(&dir.join("gel a"), true, 0.0);
    write_instrument_experiment(&dir.join("gel-b"), true, 0.02);
    std::fs::write(dir.join("list.txt"), list).unwrap();
}

fn says(run: &Run, words: &[&str]) {
    words.iter().for_each(|word| assert!(run.stdout.contains(word), "`{word}` is missing in {run}"));
}

/// Every file equals that of a separate run, except for run times. Exit codes are kept, and changed inputs are named.
#[test]
fn gathered_commands_have_the_bytes_of_one_machine() {
    let dir = tempfile::tempdir().unwrap();
    write_all(dir.path(), LIST);
    let run = |arguments: &[&str]| vitreo(dir.path(), arguments);
    says(&run(&["tasks", "commands", "list.txt", "--out", "list"]).exits(0), &["A list of 3 tasks is in list"]);
    says(&run(&["tasks", "run", "list", "--jobs", "2", "--quiet"]).exits(0), &["3 tasks finished"]);
    says(&run(&["gather", "list", "--quiet"]).exits(0), &["3 of 3 results exist", "commands.csv"]);
    std::fs::create_dir(dir.path().join("direct")).unwrap();
    std::fs::create_dir_all(dir.path().join("direct/0")).unwrap();
    std::fs::create_dir_all(dir.path().join("direct/1")).unwrap();
    run(&["fit", "gel a", "--out", "direct/0/study", "--json", "direct/0/fit.json", "--quiet"]).exits(0);
    run(&["check", "gel-b", "--json", "direct/1/check.json", "--quiet"]).exits(0);
    let sampled = run(&["sample", "gel-b", "--steps", "1000", "--no-report", "--out", "direct/2", "--quiet"]);
    let mut direct = tree(&dir.path().join("direct"));
    direct.retain(|path, _| !path.ends_with("timing.json") && !path.ends_with(".lock"));
    let mut gathered = tree(&dir.path().join("list/gathered"));
    let table = String::from_utf8(gathered.remove(Path::new("commands.csv")).unwrap()).unwrap();
    assert_eq!(gathered.keys().collect::<Vec<_>>(), direct.keys().collect::<Vec<_>>());
    for (path, bytes) in &gathered {
        assert!(direct[path] == *bytes, "{} differs", path.display());
    }
    let rows: Vec<&str> = table.lines().collect();
    assert_eq!(rows[0], "folder,exit_code,command");
    assert!(rows[1].starts_with("0,0,fit 'gel a' --out ") && rows[2].starts_with("1,0,check gel-b"), "{table}");
    assert!(rows[3].starts_with(&format!("2,{},sample gel-b", sampled.code)), "{table}");
    // One experiment changes: its results do not match the list, and those of the other are reused.
    write_instrument_experiment(&dir.path().join("gel-b"), true, 0.5);
    run(&["tasks", "commands", "list.txt", "--out", "list"]).refuses(&["list has other tasks", "--force"]);
    let old = run(&["tasks", "run", "list", "--task", "1", "--quiet"]).exits(0);
    says(&old, &["Task 1 already has its result"]);
    std::fs::remove_dir_all(dir.path().join("list/results")).unwrap();
    std::fs::create_dir(dir.path().join("list/results")).unwrap();
    let run_again = run(&["tasks", "run", "list", "--quiet"]).exits(1);
    says(&run_again, &["1 task finished", "Task 1 failed", "gel-b", "changed since the list was made"]);
    run(&["tasks", "commands", "list.txt", "--out", "list", "--force", "--quiet"]).exits(0);
    says(&run(&["tasks", "run", "list", "--quiet"]).exits(0), &["2 tasks finished; 1 task had"]);
}

/// Invalid commands are refused with their line before anything runs. Later failures are reported with the command's own message.
#[test]
fn broken_commands_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let list = |text: &str| {
        write_all(dir.path(), text);
        vitreo(dir.path(), &["tasks", "commands", "list.txt", "--out", "list", "--force", "--quiet"])
    };
    for (line, words) in [
        ("fit gel-b --cains 3 --out {out}", "--cains"),
        ("fti gel-b --out {out}", "fti"),
        ("serve {out} --quiet", "does not end by itself"),
        ("gather gel-b --out {out}", "a list cannot contain lists"),
        ("fit gel-b --out study", "{out}"),
    ] {
        list(&format!("check gel-b --json {{out}}/a.json\n\n{line}\n")).refuses(&["list.txt, line 3", words]);
    }
    list("# nothing\n").refuses(&["0 tasks"]);
    assert!(!dir.path().join("list").exists(), "a list was made of broken commands");
    list("fit gel-c --out {out}\ncheck gel-b --json {out}/b.json\n").exits(0);
    let run = vitreo(dir.path(), &["tasks", "run", "list", "--quiet"]).exits(1);
    says(&run, &["1 task finished", "Task 0 failed", "fit gel-c", "gel-c"]);
    let gathered = vitreo(dir.path(), &["gather", "list", "--quiet"]).exits(1);
    says(&gathered, &["1 of 2 results exist", "Task 0 has no result"]);
    let table = std::fs::read_to_string(dir.path().join("list/gathered/commands.csv")).unwrap();
    assert!(table.contains("\n0,,fit gel-c") && table.contains("\n1,0,check gel-b"), "{table}");
}

/// Ctrl-C ends the workers and the commands that they run.
#[cfg(target_os = "linux")]
#[test]
fn no_command_outlives_its_list() {
    use std::time::{Duration, Instant};
    let dir = tempfile::tempdir().unwrap();
    write_all(dir.path(), "sample gel-b --steps 100000000 --out {out}/endless --quiet\n");
    vitreo(dir.path(), &["tasks", "commands", "list.txt", "--out", "list", "--quiet"]).exits(0);
    let program = env!("CARGO_BIN_EXE_vitreo-uq");
    let mut child = Command::new(program).args(["tasks", "run", "list", "--quiet"]).current_dir(&dir).spawn().unwrap();
    let place = std::fs::canonicalize(dir.path()).unwrap();
    // Processes whose working directory is this test's, such as the workers and their commands.
    let running = || {
        let all = std::fs::read_dir("/proc").unwrap().filter_map(|entry| Some(entry.ok()?.path()));
        let is_here = |path: &std::path::PathBuf| std::fs::read_link(path.join("cwd")).is_ok_and(|cwd| cwd == place);
        let is_alive =
            |path: &std::path::PathBuf| std::fs::read(path.join("cmdline")).is_ok_and(|line| !line.is_empty());
        all.filter(|path| is_here(path) && is_alive(path)).count()
    };
    let begun = Instant::now();
    while running() < 3 {
        assert!(begun.elapsed() < Duration::from_secs(60), "list, worker and command do not run");
        std::thread::sleep(Duration::from_millis(10));
    }
    Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    child.wait().unwrap();
    let stopped = Instant::now();
    while running() > 0 {
        assert!(stopped.elapsed() < Duration::from_secs(20), "{} processes go on", running());
        std::thread::sleep(Duration::from_millis(10));
    }
    assert_eq!(std::fs::read_dir(dir.path().join("list/results")).unwrap().count(), 0);
}
