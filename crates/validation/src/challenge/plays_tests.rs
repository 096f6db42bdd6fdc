//! Tests how plays are judged and counted, with diagnoses and truths written by hand.

use super::super::{Disturbance, HiddenEffect, NamedValue};
use super::*;
use documents::diagnosis::{
    BaseErrors, CandidateEntry, Errors, Refit, RefitParameter, Status, UnexplainedMisfit, Verdict,
};

fn truth(slugs: &[&str], ideal_class: &[&str]) -> Truth {
    let effect = |slug: &&str| HiddenEffect {
        slug: slug.to_string(),
        parameters: vec![NamedValue { name: format!("{slug}.size"), value: 2.0 }],
        signal_sigma: 9.7,
    };
    Truth {
        effects: slugs.iter().map(effect).collect(),
        ideal_class: ideal_class.iter().map(|slug| slug.to_string()).collect(),
        ..Truth::of_nothing(Protocol::Paper, NoiseKind::White, [1.0, 2.0, 3.0])
    }
}

fn outside() -> Truth {
    let disturbance = Disturbance { kind: DisturbanceKind::Slip, size: 1e-5, shape: vec![0.5; 4] };
    Truth { outside: Some(disturbance), outside_sigma: Some(20.2), ..truth(&[], &[]) }
}

fn apparatus() -> Truth {
    Truth { apparatus: Some(ApparatusError::PoissonRatio(0.45)), ..truth(&[], &[]) }
}

/// A candidate effect with a gain (nats), and with the 5 % and 95 % quantiles of its size.
fn candidate(slug: &str, gain_nats: f64, [q05, q95]: [f64; 2]) -> CandidateEntry {
    let parameter = RefitParameter { name: format!("{slug}.size"), mean: 0.5 * (q05 + q95), q05, q95 };
    CandidateEntry {
        effect: slug.into(),
        status: Status::Unsupported,
        z: 0.0,
        p_familywise: 1.0,
        visible_fraction: 1.0,
        expected_parameter: None,
        refit: Some(Refit {
            gain_nats,
            heldout_gain_nats: None,
            last_cycle_gain_nats: Some(0.1 * gain_nats),
            rmse_heldout_um: None,
            largest_change: 0.0,
            log_bayes_factor: None,
            log_bayes_factor_at_most: None,
            answers: vec![],
            parameters: vec![parameter],
            law_parameters: Vec::new(),
        }),
        twins: Vec::new(),
        refused: None,
    }
}

fn diagnosis(kind: VerdictKind, effects: &[&str], equivalent: &[&str]) -> Diagnosis {
    let strings = |slugs: &[&str]| slugs.iter().map(|slug| slug.to_string()).collect();
    Diagnosis {
        experiment: "by hand".into(),
        verdict: Verdict {
            kind,
            effects: strings(effects),
            equivalent: strings(equivalent),
            base_law: None,
            sentence: String::new(),
        },
        fitted_cycles: vec![1, 2, 3],
        heldout_cycles: vec![4],
        base: BaseErrors { rmse_fitted_um: 9.0, rmse_heldout_um: Some(9.0), noise_um: Some(4.0) },
        extended: (!effects.is_empty()).then_some(Errors {
            rmse_fitted_um: 4.0,
            rmse_heldout_um: Some(4.2),
            predictive_noise_um: Some(4.0),
        }),
        search_noise_um: 4.0,
        candidates: vec![
            candidate("delay", 3.0, [1.0, 3.0]),
            candidate("bias", 30.0, [2.1, 3.0]),
            candidate("drift", 7.0, [2.0, 4.0]),
        ],
        pairs: Vec::new(),
        blind_spots: Vec::new(),
        smallest_detectable: Vec::new(),
        separating_protocol: String::new(),
        discrepancy: None,
        noise: Vec::new(),
        unexplained: Vec::new(),
        outlier_rows: Vec::new(),
        remarks: Vec::new(),
    }
}

fn unexplained(diagnosis: Diagnosis) -> Diagnosis {
    let entry = UnexplainedMisfit {
        kind: "slip".into(),
        sentence: String::new(),
        gain_nats: 20.0,
        p_familywise: 0.01,
        size_um: 3.0,
    };
    Diagnosis { unexplained: vec![entry], ..diagnosis }
}

/// Noise of `size_um` (µm) in every row. Only one row before the scored cycle has a far larger error.
fn noise_of_um(size_um: f64) -> Noise {
    let mut error_m: Vec<f64> = (0..800).map(|row| 1e-6 * if row % 2 == 0 { size_um } else { -size_um }).collect();
    error_m[100] = 1e-3;
    Noise { error_m, is_lost: vec![false; 800], stated_sd_m: 4e-6 }
}

fn play(truth: Truth, diagnosis: &Diagnosis) -> Play {
    let noise = noise_of_um(4.0);
    judge(0, HiddenKind::of(&truth), truth, diagnosis, Some(&noise))
}

#[test]
fn a_claim_is_judged_by_its_class_its_size_and_its_error() {
    let missing = |effects: &[&str], equivalent: &[&str]| diagnosis(VerdictKind::Missing, effects, equivalent);
    let hidden = || truth(&["drift"], &["drift", "delay"]);
    let right = play(hidden(), &missing(&["drift"], &["delay", "bias"]));
    assert_eq!((right.label.as_str(), right.said.as_str()), ("drift", "drift"));
    assert_eq!(right.class, ["bias", "delay", "drift"]);
    assert_eq!(right.first.as_deref(), Some("drift"));
    let gains: Vec<(&str, f64)> = right.gains.iter().map(|(slug, gain, _)| (slug.as_str(), *gain)).collect();
    assert_eq!(gains, [("bias", 30.0), ("drift", 7.0), ("delay", 3.0)]);
    // An end of the interval counts as inside. The size of another effect, or of a pair, is not counted.
    assert_eq!(right.size_covered, Some(true));
    assert_eq!(play(truth(&["bias"], &["bias"]), &missing(&["bias"], &[])).size_covered, Some(false));
    assert_eq!(play(hidden(), &missing(&["delay"], &["drift"])).size_covered, None);
    assert_eq!(play(hidden(), &missing(&["delay", "drift"], &[])).size_covered, None);
    assert_eq!(play(truth(&["delay", "drift"], &[]), &missing(&["delay", "drift"], &[])).size_covered, None);
    assert_eq!(right.heldout_over_predictive_noise, Some(4.2 / 4.0));
    // The effects of a pair are named in alphabetical order, whatever the order of the claim.
    assert_eq!(play(truth(&["drift", "bias"], &[]), &missing(&["drift", "bias"], &["delay"])).said, "bias+drift");
}

#[test]
fn without_a_claim_there_is_no_class_and_the_largest_gain_is_first() {
    for (kind, said) in [(VerdictKind::None, "none"), (VerdictKind::Unexplained, "unexplained")] {
        let play = play(truth(&["drift"], &["drift"]), &diagnosis(kind, &[], &[]));
        assert_eq!((play.said.as_str(), play.first.as_deref()), (said, Some("bias")));
        assert!(play.class.is_empty() && play.size_covered.is_none() && play.heldout_over_predictive_noise.is_none());
    }
}

/// With the claimed effect the error is 7 µm, but the drawn noise is only 4 µm. The predictive noise of 12.9 µm is too large, because of a gain's lower limit,
/// and hides the misfit. The drawn noise shows it. Noise of other cycles does not count.
#[test]
fn an_error_is_counted_against_the_noise_that_was_drawn() {
    let nothing = diagnosis(VerdictKind::None, &[], &[]);
    let mut diagnosis = diagnosis(VerdictKind::Missing, &["drift"], &[]);
    let errors = |rmse_um: f64, predictive_um: f64| Errors {
        rmse_fitted_um: rmse_um,
        rmse_heldout_um: Some(rmse_um),
        predictive_noise_um: Some(predictive_um),
    };
    let hidden = || truth(&["drift"], &["drift"]);
    diagnosis.extended = Some(errors(7.0, 12.9));
    let far = play(hidden(), &diagnosis);
    assert!((far.true_noise_um.expect("scored") - 4.0).abs() < 1e-9, "{far:?}");
    assert!((far.heldout_over_true_noise.expect("scored") - 7.0 / 4.0).abs() < 1e-9);
    assert!((far.heldout_over_predictive_noise.expect("scored") - 7.0 / 12.9).abs() < 1e-9);
    let tallied = tally(std::slice::from_ref(&far));
    assert_eq!((tallied.heldout_at_predictive_noise, tallied.heldout_at_true_noise), (Some(1.0), Some(0.0)));
    // The error of the true model is the drawn noise, so the ratio is 1.
    diagnosis.extended = Some(errors(4.0, 4.0));
    let near = play(hidden(), &diagnosis);
    assert!((near.heldout_over_true_noise.expect("scored") - 1.0).abs() < 1e-9);
    assert_eq!(tally(&[far, near]).heldout_at_true_noise, Some(0.5));
    // Without a claim, the error of the base model counts.
    let none = play(truth(&[], &[]), &nothing);
    assert_eq!((none.rmse_heldout_um, none.heldout_over_predictive_noise), (Some(9.0), None));
    assert!((none.heldout_over_true_noise.expect("scored") - 9.0 / 4.0).abs() < 1e-9);
    let unknown = judge(0, HiddenKind::Single, hidden(), &diagnosis, None);
    assert_eq!((unknown.heldout_over_true_noise, unknown.heldout_over_predictive_noise), (None, Some(1.0)));
}

/// The stored result of a challenge suffices to count the coverage of intervals again, also for pairs.
#[test]
fn sizes_of_what_was_named_are_kept_with_their_intervals() {
    let both = play(truth(&["drift", "bias"], &[]), &diagnosis(VerdictKind::Missing, &["drift", "bias"], &[]));
    let size =
        |name: &str, q05: f64, q95: f64| NamedSize { name: name.into(), value: 2.0, mean: 0.5 * (q05 + q95), q05, q95 };
    assert_eq!(both.sizes, [size("drift.size", 2.0, 4.0), size("bias.size", 2.1, 3.0)]);
    assert_eq!(both.size_covered, None);
    let one = play(truth(&["drift", "bias"], &[]), &diagnosis(VerdictKind::Missing, &["bias"], &[]));
    assert_eq!(one.sizes.len(), 1);
    assert!(play(truth(&["drift"], &[]), &diagnosis(VerdictKind::None, &[], &[])).sizes.is_empty());
    let kept: Play = serde_json::from_str(&serde_json::to_string(&both).expect("JSON")).expect("a play");
    assert_eq!(kept, both);
}

/// Nineteen challenges whose counts all differ, so that a rate with a wrong denominator is detected.
#[test]
fn shares_are_counted_over_what_they_are_shares_of() {
    let missing = |effects: &[&str], equivalent: &[&str]| diagnosis(VerdictKind::Missing, effects, equivalent);
    let none = || diagnosis(VerdictKind::None, &[], &[]);
    let far = |mut of: Diagnosis| {
        of.extended.as_mut().expect("a claim").rmse_heldout_um = Some(4.41);
        of
    };
    let drift = || truth(&["drift"], &["drift", "delay"]);
    let bias = || truth(&["bias"], &["bias"]);
    let pair = || truth(&["drift", "bias"], &["drift", "bias"]);
    let mut plays = vec![
        // Seven challenges with a single effect. There are five claims, three of them in class. In six, the leading effect is the hidden one or is equivalent
        // to it.
        play(drift(), &missing(&["drift"], &["delay", "bias"])),
        play(drift(), &far(missing(&["delay"], &["drift"]))),
        play(drift(), &missing(&["delay"], &[])),
        play(bias(), &missing(&["bias"], &[])),
        play(bias(), &missing(&["drift"], &[])),
        play(bias(), &none()),
        play(bias(), &none()),
        // Three challenges with pairs. One pair is found completely.
        play(pair(), &missing(&["drift", "bias"], &[])),
        play(pair(), &missing(&["drift"], &["delay"])),
        play(pair(), &missing(&["bias"], &[])),
        // Five challenges without hidden effects: one effect is claimed, and two are called unexplained.
        play(truth(&[], &[]), &none()),
        play(truth(&[], &[]), &missing(&["delay"], &[])),
        play(truth(&[], &[]), &unexplained(diagnosis(VerdictKind::Unexplained, &[], &[]))),
        play(apparatus(), &unexplained(diagnosis(VerdictKind::Unexplained, &[], &[]))),
        play(apparatus(), &none()),
        // Four challenges outside the library. Two are called unexplained, one is claimed as an effect, and one is claimed as an effect with a misfit left
        // unexplained.
        play(outside(), &unexplained(diagnosis(VerdictKind::Unexplained, &[], &[]))),
        play(outside(), &unexplained(diagnosis(VerdictKind::Unexplained, &[], &[]))),
        play(outside(), &missing(&["delay"], &[])),
        play(outside(), &unexplained(missing(&["delay"], &[]))),
    ];
    let found = tally(&plays);
    assert_eq!((found.played, found.failed), (19, 0));
    assert_eq!(found.class_coverage, Some(3.0 / 7.0));
    assert_eq!(found.mean_class_size, Some((3.0 + 2.0 + 1.0 + 1.0 + 1.0) / 5.0));
    assert_eq!(found.ideal_class_size, Some((2.0 + 2.0 + 2.0 + 1.0 + 1.0) / 5.0));
    // Three claims are `drift` or equivalent to it, and one is `bias`. Two plays have no claim, but `bias` has the largest gain.
    assert_eq!(found.first_place_separated, Some(6.0 / 7.0));
    assert_eq!((found.false_claims, found.false_unexplained), (Some(1.0 / 5.0), Some(2.0 / 5.0)));
    assert_eq!(found.pair_coverage, Some(1.0 / 3.0));
    assert_eq!((found.unexplained_called, found.misattributed), (Some(2.0 / 4.0), Some(1.0 / 4.0)));
    // The size of `drift` is inside its interval, the size of `bias` is outside.
    assert_eq!(found.interval_coverage_90, Some(1.0 / 2.0));
    // Three single effects and a pair are in class. The error of one of them exceeds 1.1 times the noise.
    assert_eq!(found.heldout_at_predictive_noise, Some(3.0 / 4.0));
    assert_eq!(found.heldout_at_true_noise, Some(3.0 / 4.0));
    let of = |truth: &str, said: &str| {
        found.confusion.iter().find(|entry| entry.truth == truth && entry.said == said).map_or(0, |entry| entry.count)
    };
    assert_eq!((of("drift", "delay"), of("bias+drift", "bias+drift"), of("outside", "unexplained")), (2, 1, 2));
    assert_eq!(found.confusion.iter().map(|entry| entry.count).sum::<usize>(), 19);
    let group = |sort: HiddenKind| {
        let group = found.groups.iter().find(|group| group.sort == sort).expect("played");
        (group.played, group.right, group.claimed, group.signal_sigma)
    };
    assert_eq!(group(HiddenKind::Single), (7, 3, 5, Some(10)));
    assert_eq!(group(HiddenKind::Pair), (3, 1, 3, Some(10)));
    assert_eq!(group(HiddenKind::None), (3, 1, 1, None));
    assert_eq!(group(HiddenKind::Apparatus), (2, 1, 0, None));
    assert_eq!(group(HiddenKind::Outside), (4, 2, 2, Some(20)));
    // A failed diagnosis counts neither as a claim nor as right.
    plays = vec![failed(0, HiddenKind::None, truth(&[], &[]), &Error::numerical("no model", "try again"))];
    let found = tally(&plays);
    assert_eq!((found.failed, found.false_claims, found.false_unexplained), (1, Some(0.0), Some(0.0)));
    assert_eq!((found.class_coverage, found.groups[0].right), (None, 0));
}
