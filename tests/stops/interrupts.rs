//! Signals at several moments of every command. The program ends within a second, leaves nothing half-written and says how to continue. Run again, it gives
//! the bytes of an uninterrupted run.
#![cfg(unix)]

use crate::program;

use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use program::{drifting_replica, tree, vitreo, write_instrument_experiment};

/// Time limit: one second, plus a margin for a busy test machine.
const SOON: Duration = Duration::from_secs(1 + 4);
/// Signals with their exit codes.
const SIGNALS: [(&str, i32); 3] = [("INT", 130), ("TERM", 143), ("HUP", 129)];

fn start(dir: &Path, arguments: &[&str]) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vitreo-uq"));
    command.current_dir(dir).args(arguments).env("VITREO_UQ_CACHE", dir.join("cache")).stdin(Stdio::null());
    command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

fn send(signal: &str, child: &Child) {
    let status = Command::new("kill").args([format!("-{signal}"), child.id().to_string()]).status().unwrap();
    assert!(status.success());
}

/// Returns `true` if the program ignores a signal, as `nohup` intends.
fn is_ignored(signal: &str) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    signal == "HUP" && mask.is_some_and(|mask| mask & 1 == 1)
}

/// Files except run times and data for resuming.
fn results(dir: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = tree(dir);
    files.retain(|path, _| {
        let text = path.to_string_lossy();
        !text.ends_with("timing.json")
            && !text.starts_with("cache")
            && !text.contains(".checkpoint")
            && !text.ends_with(".lock")
    });
    files
}

#[track_caller]
fn nothing_is_half_written(dir: &Path) {
    for (path, bytes) in tree(dir) {
        let text = path.to_string_lossy();
        assert!(!text.contains(".partial-") && !text.contains(".replaced"), "{text} is left");
        if text.ends_with(".json") {
            assert!(serde_json::from_slice::<serde_json::Value>(&bytes).is_ok(), "{text} is half written");
        }
    }
}

/// Waits for the first byte on standard error. Then the program has begun its work and handles signals.
fn first_word(child: &mut Child) {
    let words = child.stderr.as_mut().unwrap();
    assert!(words.read_exact(&mut [0]).is_ok(), "not a word was said");
}

/// Ending of a program that was sent a signal.
#[derive(PartialEq)]
enum Ending {
    /// Stopped by itself, in order.
    Stopped,
    /// Killed by the system, before it handled signals.
    Killed,
    /// Finished before it could be stopped.
    Done,
}

/// Waits for the end of a child that was sent a signal, and returns how it ended.
#[track_caller]
fn ends(child: Child, code: i32, dir: &Path, what: &str) -> Ending {
    let began = Instant::now();
    let output = child.wait_with_output().unwrap();
    let words = String::from_utf8_lossy(&output.stderr);
    assert!(began.elapsed() < SOON, "{what} took {:?}: {words}", began.elapsed());
    assert!(!words.contains("panicked"), "{what}: {words}");
    nothing_is_half_written(dir);
    // Before the program handles signals it has done nothing, and the system ends it.
    let Some(found) = output.status.code() else { return Ending::Killed };
    if found == code {
        assert!(words.contains("stopped by") && words.contains("what to do: run the same command"), "{what}: {words}");
        return Ending::Stopped;
    }
    assert!(matches!(found, 0 | 1), "{what} ended with {found}: {words}");
    Ending::Done
}

fn copy(from: &Path, to: &Path) {
    assert!(Command::new("cp").arg("-r").arg(from).arg(to).status().unwrap().success());
}

/// A folder with an instrument's experiment, one of another species, a study of the first, and a bead's experiment without models.
fn prepared(place: &Path) {
    drifting_replica(place);
    write_instrument_experiment(&place.join("gel"), true, 0.4);
    write_instrument_experiment(&place.join("other"), true, 0.0);
    for (name, species) in [("gel", "porcine"), ("other", "bovine")] {
        let path = place.join(name).join("experiment.toml");
        let toml = std::fs::read_to_string(&path)
            .unwrap()
            .replace("id = \"gel\"", &format!("id = \"{name}\"\nspecies = \"{species}\""));
        std::fs::write(path, toml).unwrap();
    }
    let code = vitreo(place, &["sample", "gel", "--steps", "3000", "--out", "study", "--quiet"]).code;
    assert!([0, 1].contains(&code));
}

/// A job that is too short to react to the signal finishes, and the program still reports the stop.
#[test]
fn a_signal_in_the_last_moment_is_told() {
    let place = tempfile::tempdir().unwrap();
    write_instrument_experiment(&place.path().join("gel"), true, 0.0);
    for (signal, code) in [("INT", 130), ("TERM", 143)] {
        // On a busy machine the program can end before the signal arrives. Then it is started again.
        let is_told = (0..10).any(|attempt| {
            let mut child = start(place.path(), &["fit", "gel", "--out", &format!("{signal}-{attempt}")]);
            first_word(&mut child);
            send(signal, &child);
            ends(child, code, place.path(), signal) == Ending::Stopped
        });
        assert!(is_told, "the signal is lost");
    }
}

/// Every command is stopped at three moments by each signal, and then run to the end. Most finish almost before they can be stopped. Two have finite elements
/// ahead at their first output and must be stopped there. Forty runs of the program, and a few repeats for missed moments, take a minute.
#[test]
#[ignore = "thorough"]
fn every_command_stops_soon_and_runs_again() {
    let place = tempfile::tempdir().unwrap();
    let template = place.path().join("template");
    std::fs::create_dir(&template).unwrap();
    prepared(&template);
    let commands: [&[&str]; 8] = [
        &["sample", "drifting", "--steps", "3000", "--out", "new"],
        &["fit", "gel", "--out", "new"],
        &["effects", "gel"],
        &["compare", "study"],
        &["extend", "study", "--with", "tracking-drift", "--steps", "3000"],
        &["ladder", "study", "--steps", "3000"],
        &["groups", "drifting", "other", "--steps", "3000", "--sweeps", "400", "--out", "compared"],
        &["corner", "study/m0", "--out", "figure"],
    ];
    for (index, arguments) in commands.into_iter().enumerate() {
        let whole = place.path().join(format!("whole{index}"));
        copy(&template, &whole);
        let began = Instant::now();
        let code = start(&whole, arguments).wait_with_output().unwrap().status.code();
        assert!(matches!(code, Some(0 | 1)), "{arguments:?}: {code:?}");
        let took = began.elapsed();
        let dir = place.path().join(format!("stopped{index}"));
        copy(&template, &dir);
        if ["sample", "groups"].contains(&arguments[0]) {
            let mut child = start(&dir, arguments);
            first_word(&mut child);
            send("INT", &child);
            assert!(ends(child, 130, &dir, &format!("{arguments:?}")) == Ending::Stopped, "{arguments:?} went on");
        }
        for (part, (signal, code)) in [0.15, 0.45, 0.8].into_iter().zip(SIGNALS) {
            if is_ignored(signal) {
                continue;
            }
            // The duration of a run depends on the machine's load, so the moment is searched between too early and too late.
            let (mut early, mut late) = (0.0, took.as_secs_f64());
            for _ in 0..8 {
                let moment = early + part * (late - early);
                let child = start(&dir, arguments);
                std::thread::sleep(Duration::from_secs_f64(moment));
                send(signal, &child);
                match ends(child, code, &dir, &format!("{arguments:?} by {signal}")) {
                    Ending::Stopped => {
                        // A signal that arrives while the page is written finds the revision complete.
                        if arguments[0] == "extend" && dir.join("study/m1").is_dir() {
                            std::fs::remove_dir_all(&dir).unwrap();
                            copy(&template, &dir);
                        }
                        break;
                    }
                    Ending::Killed => early = moment,
                    Ending::Done => {
                        late = moment;
                        // An effect cannot be added twice, so existing results make this folder unusable.
                        std::fs::remove_dir_all(&dir).unwrap();
                        copy(&template, &dir);
                    }
                }
            }
        }
        let code = start(&dir, arguments).wait_with_output().unwrap().status.code();
        assert!(matches!(code, Some(0 | 1)), "{arguments:?}: {code:?}");
        let (expected, found) = (results(&whole), results(&dir));
        assert!(expected.keys().eq(found.keys()), "{arguments:?}: {:?} against {:?}", found.keys(), expected.keys());
        let differing: Vec<_> =
            expected.iter().filter(|(path, bytes)| found[*path] != **bytes).map(|(path, _)| path).collect();
        assert!(differing.is_empty(), "{arguments:?}: {differing:?}");
    }
}

/// Commands that solve finite elements and search for a minute or more are stopped during that work.
#[test]
#[ignore = "thorough"]
fn long_computations_stop_soon() {
    let place = tempfile::tempdir().unwrap();
    let dir = place.path();
    drifting_replica(dir);
    let commands: [&[&str]; 6] = [
        &["diagnose", "drifting", "--out", "study"],
        &["learn", "drifting", "--out", "study"],
        &["simulate", "drifting", "--out", "study", "--refine", "3"],
        &["shapes", "--out", "shapes"],
        &["challenge", "new", "--out", "sealed", "--seed", "13"],
        &["challenge", "run", "--count", "50", "--cache", "trajectories"],
    ];
    for arguments in commands {
        let mut n_stopped = 0;
        for ((signal, code), seconds) in SIGNALS.into_iter().zip([0.3, 1.5, 4.0]) {
            if is_ignored(signal) {
                continue;
            }
            let child = start(dir, arguments);
            std::thread::sleep(Duration::from_secs_f64(seconds));
            send(signal, &child);
            let ending = ends(child, code, dir, &format!("{arguments:?} by {signal}"));
            n_stopped += usize::from(ending == Ending::Stopped);
            // A challenge that was complete when the signal came is not replaced.
            let sealed = dir.join("sealed");
            if sealed.join("sealed.json").exists() {
                assert!(sealed.join("experiment.toml").exists());
                std::fs::remove_dir_all(sealed).unwrap();
            }
            // Some commands replace nothing from an earlier run.
            if ending == Ending::Done {
                break;
            }
        }
        assert!(n_stopped > 0, "{arguments:?} was never stopped");
    }
}

/// The terminal hangs up. Output goes nowhere, the state is kept, and the continued run gives the same bytes.
#[test]
#[ignore = "thorough"]
fn a_run_whose_terminal_hangs_up_is_resumed() {
    let place = tempfile::tempdir().unwrap();
    // A second or more of finite elements leaves a run to stop.
    drifting_replica(place.path());
    let arguments = ["sample", "drifting", "--steps", "20000", "--out", "whole"];
    let whole = vitreo(place.path(), &arguments);
    let mut arguments = arguments.map(String::from).to_vec();
    arguments[5] = "stopped".into();
    arguments.push("--resume".into());
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    // The first signal is sent when the run has made its directory. At any speed this is after it handles signals and long before its end. The others
    // arrive while it continues from the state that the first has left.
    for milliseconds in [0, 100, 200] {
        let mut child = start(place.path(), &arguments);
        // From here on every write to standard error fails.
        drop(child.stderr.take());
        while !place.path().join("stopped/.m0.checkpoint").exists() {
            assert!(child.try_wait().unwrap().is_none(), "the run ended before it made a place for its state");
            std::thread::sleep(Duration::from_millis(1));
        }
        std::thread::sleep(Duration::from_millis(milliseconds));
        send("HUP", &child);
        let began = Instant::now();
        let code = child.wait().unwrap().code();
        assert!(began.elapsed() < SOON);
        // Later signals may arrive before the program handles signals, or after its end.
        let may_be = if milliseconds == 0 { [Some(129); 3] } else { [Some(129), Some(whole.code), None] };
        assert!(is_ignored("HUP") || may_be.contains(&code), "{code:?}");
        nothing_is_half_written(place.path());
        if code == Some(whole.code) {
            break;
        }
    }
    vitreo(place.path(), &arguments).exits(whole.code);
    assert!(results(&place.path().join("stopped")) == results(&place.path().join("whole")));
}

/// A killed `ladder` cannot clean up; the next command in the study does.
#[test]
fn what_a_killed_program_leaves_is_swept() {
    let place = tempfile::tempdir().unwrap();
    prepared(place.path());
    let mut dead = Command::new("true").spawn().unwrap();
    dead.wait().unwrap();
    let mut alive = Command::new("sleep").arg("100").spawn().unwrap();
    let at = |process: u32| place.path().join(format!("study/.partial-{process}-abc"));
    [dead.id(), alive.id()].iter().for_each(|process| std::fs::write(at(*process), "half").unwrap());
    vitreo(place.path(), &["fit", "study"]).exits(0);
    assert!(!at(dead.id()).exists() && at(alive.id()).exists());
    alive.kill().unwrap();
    alive.wait().unwrap();
}
