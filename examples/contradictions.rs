//! Counts the contradictions that `check` finds in records with and without one. It is the program of `campaigns/contradictions`.
//!
//! `cargo run --release --example contradictions -- COUNT SOUND SEED` prints one JSON document. It gives the number of detections in COUNT records of each kind,
//! and the number of false detections in SOUND correct records.

#[path = "../tests/contradictory/mod.rs"]
mod contradictory;

use std::collections::BTreeMap;

use contradictory::{KINDS, record};
use rayon::prelude::*;
use vitreo_uq::posterior::check::contradictions;

/// Distance between the seeds of two kinds.
const APART: u64 = 1_000_000;

fn called(wrong: Option<&str>, seed: u64) -> Vec<String> {
    let (experiment, files) = record(wrong, seed);
    let kinds = contradictions(&experiment, &files.interpretation).into_iter().map(|contradiction| contradiction.kind);
    // Correct sines are sampled as curves but described as lines, so this finding is correct.
    kinds.filter(|kind| kind != "curve_between_rows").collect()
}

fn main() {
    let argument = |place: usize, default: u64| -> u64 {
        std::env::args().nth(place).and_then(|text| text.parse().ok()).unwrap_or(default)
    };
    let (count, sound, seed) = (argument(1, 100), argument(2, 400), argument(3, 1));
    let first = |kind: usize| seed + APART * kind as u64;
    let found: BTreeMap<&str, usize> = KINDS
        .iter()
        .enumerate()
        .map(|(place, kind)| {
            let seeds = (0..count).into_par_iter().map(|k| first(place + 1) + k);
            (*kind, seeds.filter(|seed| called(Some(kind), *seed).iter().any(|name| name == kind)).count())
        })
        .collect();
    let of_sound: Vec<Vec<String>> = (0..sound).into_par_iter().map(|k| called(None, first(0) + k)).collect();
    let mut false_calls: BTreeMap<&str, usize> = BTreeMap::new();
    of_sound.iter().flatten().for_each(|kind| *false_calls.entry(kind).or_default() += 1);
    let called = of_sound.iter().filter(|kinds| !kinds.is_empty()).count();
    let document = serde_json::json!({
        "records": count, "found": found, "sound_records": sound, "sound_called": called, "sound_called_as": false_calls
    });
    println!("{document:#}");
}
