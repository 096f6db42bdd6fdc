//! Plays mutated files to every reader and counts what becomes of them: the program of `campaigns/hard-input`.
//!
//! `cargo run --release --example hard_input -- COUNT SEED [SECONDS]` prints one JSON document. It ends with exit code 1 if anything panicked or took longer
//! than a minute; what did is kept in a folder that it names.

#[path = "../tests/mutators/mod.rs"]
mod mutators;

use std::collections::BTreeMap;
use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use mutators::{Outcome, Place, input, readers};

/// An input that takes longer is a hang.
const HANG: Duration = Duration::from_secs(60);

fn main() -> ExitCode {
    let arguments: Vec<u64> = std::env::args().skip(1).filter_map(|text| text.parse().ok()).collect();
    let (count, seed) = (arguments.first().copied().unwrap_or(2_000), arguments.get(1).copied().unwrap_or(1));
    let most_seconds = arguments.get(2).copied().unwrap_or(u64::MAX);
    std::panic::set_hook(Box::new(|_| {}));
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
    let mut outcomes: BTreeMap<&str, BTreeMap<String, u64>> = BTreeMap::new();
    let (mut played, mut n_panicked, mut slowest_s) = (0, 0, 0.0_f64);
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
        *outcomes.entry(reader.name).or_default().entry(format!("{outcome:?}").to_lowercase()).or_default() += 1;
        played += 1;
    }
    let document = serde_json::json!({
        "schema": "vitreo-uq/hard-input/1",
        "count": played,
        "seed": seed,
        "panicked": n_panicked,
        "hung": 0,
        "outcomes": outcomes,
        "slowest_input_s": slowest_s,
        "seconds": began.elapsed().as_secs_f64(),
    });
    println!("{document:#}");
    if n_panicked > 0 {
        eprintln!("inputs that panicked are in {}", folder.display());
        return ExitCode::FAILURE;
    }
    let _ = std::fs::remove_dir_all(&folder);
    ExitCode::SUCCESS
}
