//! Tests of joining task results. The tests write the results by hand, and the joined document must equal the document of a single machine.

use serde_json::json;

use super::super::list::TaskInput;
use super::*;
use base::files::to_json;
use documents::calibration::CalibrationKind;
use posterior::monitor::SilentMonitor;
use validation::challenge::play::HiddenKind;
use validation::challenge::plays::PlaysRequest;
use validation::challenge::{NoiseKind, Protocol, Truth};

fn play(number: usize) -> Play {
    let third = number as f64 / 3.0;
    Play {
        number,
        sort: HiddenKind::None,
        truth: Truth::of_nothing(Protocol::Paper, NoiseKind::White, [3.5 + third, 1.4, 47.0]),
        label: "none".into(),
        said: if number.is_multiple_of(3) { "force-lag".into() } else { "none".into() },
        class: Vec::new(),
        unexplained: Vec::new(),
        first: Some("force-lag".into()),
        gains: vec![("force-lag".into(), 0.1 + 0.2 * third, None), ("slip".into(), 1e-300, Some(-0.0))],
        sentence: "A line\nand \"another\".".into(),
        seed: u64::MAX - number as u64,
        size_covered: None,
        sizes: Vec::new(),
        yardstick_um: Some(4.0),
        rmse_heldout_um: Some(third),
        true_noise_um: None,
        heldout_over_true_noise: None,
        heldout_over_predictive_noise: None,
        failure: None,
    }
}

/// Makes a list of seven challenge plays in blocks of two. Also returns the plays and the document that a single machine would write.
fn list(dir: &Path) -> (List, Vec<Play>, Vec<u8>) {
    let request = PlaysRequest { count: 7, seed: 5, ..PlaysRequest::default() };
    let work: Vec<TaskInput> = challenge::work(&request, 2).unwrap();
    let (list, _) = List::make(dir, TaskKind::Challenge, "this", request.seed, work, false).unwrap();
    let plays: Vec<Play> = (0..7).map(play).collect();
    let whole = to_json(Path::new("one.json"), &Plays::of(plays.clone()).document(request.seed)).unwrap();
    (list, plays, whole)
}

fn write(list: &List, plays: &[Play], number: usize) {
    let task = list.task(number).unwrap();
    let part = &plays[2 * number..(2 * number + 2).min(plays.len())];
    result::write(list, &task, &serde_json::to_vec(part).unwrap()).unwrap();
}

#[test]
fn parts_in_any_order_are_the_whole_byte_for_byte() {
    let dir = tempfile::tempdir().unwrap();
    let (list, plays, whole) = list(&dir.path().join("list"));
    let out = dir.path().join("out");
    for number in [2, 0, 3, 2, 1] {
        write(&list, &plays, number);
    }
    let outcome = gather(&list, &out, &SilentMonitor).unwrap();
    assert!(outcome.gathered.is_whole() && outcome.gathered.foreign.is_empty());
    assert!(std::fs::read(out.join(CHALLENGE)).unwrap() == whole, "other bytes than on one machine");
    assert_eq!(missing(&list, 0..4, &SilentMonitor).unwrap(), Vec::<usize>::new());
}

#[test]
fn what_is_missing_is_left_out_and_named() {
    let dir = tempfile::tempdir().unwrap();
    let (list, plays, _) = list(&dir.path().join("list"));
    let out = dir.path().join("out");
    let nothing = gather(&list, &out, &SilentMonitor).unwrap();
    assert!(nothing.plays.is_none() && nothing.gathered.results == 0 && !out.join(CHALLENGE).exists());
    write(&list, &plays, 1);
    write(&list, &plays, 3);
    // This result has a valid head, but its body is not a list of challenge outcomes.
    result::write(&list, &list.task(0).unwrap(), b"{}").unwrap();
    let outcome = gather(&list, &out, &SilentMonitor).unwrap();
    let numbers: Vec<usize> = outcome.plays.unwrap().plays.iter().map(|play| play.number).collect();
    assert_eq!(numbers, [2, 3, 6]);
    let faults: Vec<(usize, Fault)> =
        outcome.gathered.missing.iter().map(|missing_result| (missing_result.task, missing_result.fault)).collect();
    assert_eq!(faults, [(0, Fault::Damaged), (2, Fault::Absent)]);
}

/// A result file is refused after any of its bytes is changed, and after any truncation.
#[test]
fn no_changed_byte_goes_unnoticed() {
    let dir = tempfile::tempdir().unwrap();
    let (list, plays, _) = list(&dir.path().join("list"));
    write(&list, &plays, 3);
    let task = list.task(3).unwrap();
    let path = list.result_path(&task);
    let sound = std::fs::read(&path).unwrap();
    assert!(result::read(&list, &task).is_ok());
    for place in 0..sound.len() {
        let mut changed = sound.clone();
        changed[place] ^= 1;
        std::fs::write(&path, &changed).unwrap();
        assert!(result::read(&list, &task).is_err(), "byte {place} was changed");
    }
    for length in (0..sound.len()).step_by(7) {
        std::fs::write(&path, &sound[..length]).unwrap();
        assert!(result::read(&list, &task).is_err(), "{length} bytes are left");
    }
    std::fs::write(&path, [sound.as_slice(), b"1"].concat()).unwrap();
    assert_eq!(result::read(&list, &task), Err(Fault::Damaged));
}

/// Makes a calibration list of two tasks whose ranks are given by `rank`.
fn calibration(dir: &Path, rank: impl Fn(usize) -> usize) -> List {
    let sampling = json!({ "with": [], "noise": [], "set": [], "n_walkers": 32, "max_steps": 100, "seed": 3 });
    let part = |first: usize| {
        let arguments = json!({ "sampling": sampling, "name": "eye", "inputs_sha256": "0a", "content_sha256": "0b", "first": first, "count": 100 });
        TaskInput { arguments, paths: vec!["eye".into()] }
    };
    let (list, _) = List::make(dir, TaskKind::Calibration, "this", 3, vec![part(0), part(100)], false).unwrap();
    let subject = json!({ "experiment": "eye", "model": { "base": "lethersich", "effects": [], "noise": ["white"] },
        "parameters": ["young_modulus_pa"], "simulated_by": "closed-form" });
    for number in 0..2 {
        let line = |k: usize| {
            let ranked = json!({ "ranks": [rank(k), k % 100], "z": [0.5], "converged": true });
            json!({ "number": k, "truth": [1.0], "redrawn": 0, "ranked": ranked, "failure": null }).to_string() + "\n"
        };
        let body = format!("{subject}\n") + &(100 * number..100 * (number + 1)).map(line).collect::<String>();
        result::write(&list, &list.task(number).unwrap(), body.as_bytes()).unwrap();
    }
    list
}

/// A calibration passes if the ranks are uniform, and fails if the posteriors are too high. A result with a missing rank counts as damaged.
#[test]
fn ranks_of_all_tasks_make_one_verdict() {
    let dir = tempfile::tempdir().unwrap();
    let right =
        gather(&calibration(&dir.path().join("right"), |k| k % 100), &dir.path().join("a"), &SilentMonitor).unwrap();
    let found = right.calibration.unwrap();
    assert_eq!((found.verdict.kind, found.replicates), (CalibrationKind::Calibrated, 200));
    assert_eq!(found.quantities[0].counts, [10; 20]);
    let wrong = calibration(&dir.path().join("wrong"), |k| k % 100 / 2);
    let found = gather(&wrong, &dir.path().join("b"), &SilentMonitor).unwrap().calibration.unwrap();
    assert_eq!(found.verdict.kind, CalibrationKind::Miscalibrated);
    assert!(found.verdict.sentence.contains("young_modulus_pa is too high"), "{}", found.verdict.sentence);
    let document: serde_json::Value =
        serde_json::from_slice(&std::fs::read(dir.path().join("b").join(CALIBRATION)).unwrap()).unwrap();
    assert_eq!((&document["seed"], &document["inputs_sha256"]), (&3.into(), &json!({ "eye": "0a" })));
    let task = wrong.task(1).unwrap();
    let body = String::from_utf8(result::read(&wrong, &task).unwrap()).unwrap();
    result::write(&wrong, &task, body.replacen("\"ranks\":[0,0]", "\"ranks\":[0]", 1).as_bytes()).unwrap();
    let partial = gather(&wrong, &dir.path().join("b"), &SilentMonitor).unwrap();
    assert_eq!((partial.gathered.missing[0].fault, partial.calibration.unwrap().replicates), (Fault::Damaged, 100));
}
