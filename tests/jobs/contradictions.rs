//! Contradictions between a record and its description are found, and correct records have none: a tenth of campaigns/contradictions.
//!
//! Seeds are fixed. With others a kind found in 97 % of its records fails by chance in 6·10⁻⁶ of all runs, and correct records with one false finding in 400 fail in 6·10⁻⁸.

#[path = "../contradictory/mod.rs"]
mod contradictory;

use contradictory::{KINDS, record};
use vitreo_uq::posterior::check::{contradictions, refuse_contradictions, summary};
use vitreo_uq::posterior::monitor::SilentMonitor;
use vitreo_uq::posterior::replica;
use vitreo_uq::record::ForceRule;

#[test]
fn what_contradicts_a_description_is_found() {
    for (place, kind) in KINDS.iter().enumerate() {
        let is_found = |seed: &u64| {
            let (experiment, files) = record(Some(kind), *seed);
            contradictions(&experiment, &files.interpretation).iter().any(|contradiction| contradiction.kind == *kind)
        };
        let first = 77_000_000 + 1_000 * place as u64;
        let n_found = (first..first + 10).filter(is_found).count();
        assert!(n_found >= 6, "{kind}: {n_found} of 10");
    }
}

#[test]
fn sound_records_are_left_alone() {
    let called: Vec<(u64, Vec<_>)> = (78_000_000..78_000_040)
        .map(|seed| {
            let (experiment, files) = record(None, seed);
            let mut called = contradictions(&experiment, &files.interpretation);
            // Sines are sampled as curves but described as lines, so this finding is correct.
            called.retain(|one| one.kind != "curve_between_rows" || experiment.record.force_rule == ForceRule::Hold);
            (seed, called)
        })
        .filter(|(_, called)| !called.is_empty())
        .collect();
    assert!(called.len() <= 4, "{called:?}");
    let (experiment, files) = replica::embedded().unwrap();
    assert_eq!(summary(&experiment, &files).contradictions, []);
}

#[test]
fn what_is_certain_is_refused_with_its_remedy() {
    let (experiment, files) = record(Some("against_force"), 1);
    let refused = refuse_contradictions(&experiment, &files.interpretation, &SilentMonitor).unwrap_err();
    assert_eq!(refused.exit_code(), 2);
    assert!(refused.to_string().contains("direction = \"-\""), "{refused}");
    // The remedy of another kind works: stating the force rule.
    let (experiment, mut files) = record(Some("force_between_rows"), 1);
    let refused = refuse_contradictions(&experiment, &files.interpretation, &SilentMonitor).unwrap_err().to_string();
    assert!(refused.contains("`force_between_rows`"), "{refused}");
    files.interpretation.force_rule_given = true;
    assert!(refuse_contradictions(&experiment, &files.interpretation, &SilentMonitor).is_ok());
    let document = summary(&experiment, &files);
    assert_eq!(document.understood.sentences.len(), 5);
}
