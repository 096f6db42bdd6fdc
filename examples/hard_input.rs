//! Gives mutated files to every reader and counts the outcomes. It is the program of `campaigns/hard-input`.
//!
//! `cargo run --release --example hard_input -- variants COUNT SEED` gives COUNT valid variants to every reader that has a grammar. The exit code is 1 if a
//! reader panicked, took longer than ten seconds or more than a gigabyte, or accepted less than half of its variants.
//!
//! `cargo run --release --example hard_input -- COUNT SEED [SECONDS [PROGRAM]]` gives damaged files and prints one JSON document. The exit code is 1 if a
//! reader panicked or took longer than a minute, or if PROGRAM left a file half-written. Such inputs are kept in a folder that the output names. One in a
//! hundred inputs also goes through PROGRAM.

#[path = "../tests/mutators/mod.rs"]
mod mutators;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, ExitCode};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use mutators::{Outcome, Place, Reader, input, readers, variant};
use rayon::prelude::*;

/// Time after which an input counts as a hang.
const HANG: Duration = Duration::from_secs(60);
/// Number of successive inputs of which three go through the program.
const EVERY: u64 = 300;

fn main() -> ExitCode {
    let arguments: Vec<u64> = std::env::args().skip(1).filter_map(|text| text.parse().ok()).collect();
    let (count, seed) = (arguments.first().copied().unwrap_or(2_000), arguments.get(1).copied().unwrap_or(1));
    let most_seconds = arguments.get(2).copied().unwrap_or(u64::MAX);
    let program = std::env::args().nth(4);
    std::panic::set_hook(Box::new(|_| {}));
    if std::env::args().nth(1).is_some_and(|word| word == "variants") {
        return play_variants(count, seed);
    }
    let Ok(folder) = tempfile::tempdir().map(tempfile::TempDir::keep) else { return ExitCode::from(2) };
    let (place, readers) = (Place::new(&folder), readers());
    let began = Instant::now();
    static NUMBER: AtomicU64 = AtomicU64::new(0);
    static SINCE_MS: AtomicU64 = AtomicU64::new(0);
    let now_ms = move || u64::try_from(began.elapsed().as_millis()).unwrap_or(u64::MAX);
    let kept = folder.clone();
    std::thread::spawn(move || {
        loop {
            std::thread::sleep(Duration::from_secs(1));
            if now_ms().saturating_sub(SINCE_MS.load(Ordering::SeqCst)) > HANG.as_millis() as u64 {
                eprintln!("input {} hangs; it is in {}", NUMBER.load(Ordering::SeqCst), kept.display());
                std::process::exit(1);
            }
        }
    });
    let mut outcomes: BTreeMap<String, BTreeMap<String, u64>> = BTreeMap::new();
    let (mut played, mut n_panicked, mut n_wrong, mut slowest_s) = (0, 0, 0, 0.0_f64);
    for number in 0..count {
        if began.elapsed().as_secs() >= most_seconds {
            break;
        }
        let reader = &readers[usize::try_from(number).unwrap_or(0) % readers.len()];
        let bytes = input(reader, seed, number);
        NUMBER.store(number, Ordering::SeqCst);
        SINCE_MS.store(now_ms(), Ordering::SeqCst);
        let clock = Instant::now();
        let outcome = reader.play(&place, &bytes);
        slowest_s = slowest_s.max(clock.elapsed().as_secs_f64());
        if outcome == Outcome::Panicked {
            n_panicked += 1;
            let _ = std::fs::write(folder.join(format!("panicked-{number}-{}", reader.name)), &bytes);
            eprintln!("input {number} of {} panics", reader.name);
        }
        *outcomes.entry(reader.name.into()).or_default().entry(word(outcome)).or_default() += 1;
        played += 1;
        if let Some(program) = program.as_ref().filter(|_| number % EVERY < 3) {
            let found = through_program(program, &folder.join("program"), &readers, seed, number);
            if found != "soundly ended" {
                eprintln!("input {number} through the program: {found}");
                n_wrong += 1;
            }
            *outcomes.entry("through the program".into()).or_default().entry(found.into()).or_default() += 1;
        }
    }
    let document = serde_json::json!({
        "schema": "vitreo-uq/hard-input/1",
        "count": played,
        "seed": seed,
        "panicked": n_panicked,
        "hung": 0,
        "wrongly_ended_through_the_program": n_wrong,
        "outcomes": outcomes,
        "slowest_input_s": slowest_s,
        "seconds": began.elapsed().as_secs_f64(),
    });
    println!("{document:#}");
    if n_panicked + n_wrong > 0 {
        eprintln!("inputs that panicked are in {}", folder.display());
        return ExitCode::FAILURE;
    }
    let _ = std::fs::remove_dir_all(&folder);
    ExitCode::SUCCESS
}

/// Limits for a valid variant's time, and for the memory of all variants.
const LONG: Duration = Duration::from_secs(10);
const MOST_MIB: u64 = 1024;

/// Gives valid variants to every reader with a grammar, one reader per thread.
fn play_variants(count: u64, seed: u64) -> ExitCode {
    let began = Instant::now();
    let of_reader = |reader: &Reader| {
        let Ok(folder) = tempfile::tempdir() else { return serde_json::json!({ "panicked": "no room" }) };
        let place = Place::new(folder.path());
        let (mut outcomes, mut panicked, mut slowest, mut bytes_read) =
            (BTreeMap::<String, u64>::new(), Vec::new(), Duration::ZERO, 0);
        for number in 0..count {
            let Some(bytes) = variant(reader, seed, number) else { continue };
            bytes_read += bytes.len();
            let clock = Instant::now();
            let outcome = reader.play(&place, &bytes);
            slowest = slowest.max(clock.elapsed());
            if outcome == Outcome::Panicked {
                panicked.push(number);
            }
            *outcomes.entry(word(outcome)).or_default() += 1;
        }
        let is_sound = panicked.is_empty()
            && slowest < LONG
            && outcomes.get("accepted").is_some_and(|accepted| 2 * accepted >= count);
        serde_json::json!({ "outcomes": outcomes, "panicked": panicked, "slowest_s": slowest.as_secs_f64(), "bytes": bytes_read, "is_sound": is_sound })
    };
    let readers: Vec<Reader> = readers().into_iter().filter(|reader| reader.grammar.is_some()).collect();
    let played: BTreeMap<&str, serde_json::Value> =
        readers.par_iter().map(|reader| (reader.name, of_reader(reader))).collect();
    let most_mib = largest_memory_mib();
    let is_sound =
        played.values().all(|value| value["is_sound"] == true) && most_mib.is_none_or(|most| most < MOST_MIB);
    let document = serde_json::json!({ "schema": "vitreo-uq/valid-variants/1", "count": count, "seed": seed, "readers": played,
        "largest_memory_mib": most_mib, "is_sound": is_sound, "seconds": began.elapsed().as_secs_f64() });
    println!("{document:#}");
    if is_sound { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Peak memory of this process in MiB, as reported by Linux.
fn largest_memory_mib() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix(" kB")?.parse::<u64>().ok()? / 1024)
}

fn word(outcome: Outcome) -> String {
    format!("{outcome:?}").to_lowercase()
}

/// Gives a mutated experiment or table of draws to the program itself. Checks its exit and its remaining files.
fn through_program(program: &str, folder: &Path, readers: &[Reader], seed: u64, number: u64) -> &'static str {
    let names = ["experiment.toml", "trajectory.csv", "draws.csv"];
    let name = names[usize::try_from(number % 3).unwrap_or(0)];
    let Some(reader) = readers.iter().find(|reader| reader.name == name) else { return "no such reader" };
    let _ = std::fs::remove_dir_all(folder);
    let experiment = folder.join("gel");
    let others = readers.iter().filter(|reader| names.contains(&reader.name));
    let is_written = std::fs::create_dir_all(&experiment).is_ok()
        && others.into_iter().all(|other| std::fs::write(experiment.join(other.name), &other.samples[0]).is_ok())
        && std::fs::write(experiment.join(name), input(reader, seed, number)).is_ok();
    if !is_written {
        return "no room";
    }
    let arguments = if name == "draws.csv" {
        ["corner", "gel/draws.csv", "--out", "figure"]
    } else {
        ["fit", "gel", "--out", "study"]
    };
    let Ok(output) = Command::new(program).current_dir(folder).args(arguments).output() else { return "not started" };
    let words = String::from_utf8_lossy(&output.stderr);
    let is_left = |folder: &Path| {
        std::fs::read_dir(folder).is_ok_and(|entries| {
            entries.flatten().any(|entry| entry.file_name().to_string_lossy().contains(".partial-"))
        })
    };
    match output.status.code() {
        _ if words.contains("panicked") => "panicked",
        _ if is_left(folder) || is_left(&folder.join("study")) => "half written",
        Some(2) if !words.contains("what to do: ") => "refused without a remedy",
        Some(0..=2) => "soundly ended",
        _ => "killed",
    }
}
