//! Tests of the comparison of revisions: sentences, branches and shifts.

use super::*;
use rung_for_tests::make_rung;

#[path = "../../figures/src/rung_for_tests.rs"]
mod rung_for_tests;

#[test]
fn sentences_claim_what_was_scored() {
    let say = |was: f64, is: f64| {
        let rungs = [make_rung("m0", None, &[], Some(was)), make_rung("m1", Some("m0"), &["clock-offset"], Some(is))];
        sentence(&rungs, Some(4.0), 200)
    };
    // A root mean square over 200 positions has a standard error of 5 %. An error of up to three standard errors above a noise of 4 µm (4.6 µm) counts as
    // equal to the noise.
    let fallen = say(12.0, 4.5);
    assert!(
        fallen.contains("clock-offset") && fallen.contains("falls: from 12.000 to 4.500 µm, the noise"),
        "{fallen}"
    );
    assert!(fallen.contains("+750.0 nats"), "{fallen}");
    assert!(say(12.0, 4.7).contains("still above the noise"));
    assert!(say(4.0, 12.0).contains("rises") && say(4.3, 4.0).contains("within its uncertainty"));
    let unscored = [make_rung("m0", None, &[], None), make_rung("m1", Some("m0"), &["clock-offset"], None)];
    assert!(sentence(&unscored, None, 0).contains("at most suggestive"));
    assert!(sentence(&unscored[..1], None, 0).contains("nothing to compare"));
}

/// If m2 extends m0 instead of m1, its added effects are those that m0 lacks.
#[test]
fn branches_are_compared_with_what_they_extend() {
    let rungs = [
        make_rung("m0", None, &[], Some(9.0)),
        make_rung("m1", Some("m0"), &["a"], Some(5.0)),
        make_rung("m2", Some("m0"), &["b"], Some(4.0)),
        make_rung("m3", Some("m1"), &["a", "c"], Some(4.0)),
    ];
    let effects_of: Vec<_> = rungs.iter().map(|rung| (rung.revision.clone(), rung.effects.clone())).collect();
    let added: Vec<Vec<String>> = rungs.iter().map(|rung| added(rung, &effects_of)).collect();
    assert_eq!(added, [vec![], vec!["a".to_string()], vec!["b".into()], vec!["c".into()]]);
}

/// Young's modulus changes from 3.9 ± 0.1 to 3.4 Pa, which is a shift of 5 standard deviations, or 14.7 %.
#[test]
fn shifts_are_counted_in_what_the_first_revision_claimed() {
    let rungs = [make_rung("m0", None, &[], Some(9.0)), make_rung("m1", Some("m0"), &["a"], Some(4.0))];
    let found = shifts(BaseLaw::default(), &rungs);
    assert_eq!(found.len(), 1);
    assert!((found[0].in_sd_before - 5.0).abs() < 1e-9 && (found[0].relative - 0.5 / 3.4).abs() < 1e-9, "{found:?}");
    assert!(shifts(BaseLaw::default(), &rungs[..1]).is_empty());
}
