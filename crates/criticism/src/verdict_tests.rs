//! Tests of every kind of verdict, from evidence made by hand.

use super::*;
use posterior::misfit::ResidualSize;

const CRITERIA: Criteria = Criteria::RECORD;
/// A gain that passes every threshold of [`Criteria::RECORD`].
const GAIN: Gain = Gain { fitted: 20.0, future: Some(9.0), last: Some(3.0), largest_change: 1.0, rank: 23.0 };

fn addition(effects: &[&str], p: f64, round: usize) -> Addition {
    let effects = effects.iter().map(|slug| slug.to_string()).collect();
    Addition { effects, gain: GAIN, over_base: GAIN, p, round }
}

/// Residual of `factor` times the noise of 4 µm on the held-out cycle.
fn misfit(factor: f64, is_known: bool, is_too_large: bool) -> Residual {
    let size = ResidualSize { rms_m: factor * 4e-6, is_too_large };
    let misfit = Misfit {
        fitted: size,
        heldout: Some(size),
        noise_m: 4e-6,
        is_known,
        implausible_gains: None,
        returning_m: None,
        learnt_degrees: 1.0,
    };
    Residual::Record { misfit, n_positions: 100, over_predicted: None }
}

fn noise() -> Residual {
    misfit(1.0, true, false)
}

fn excess() -> Residual {
    misfit(2.0, true, true)
}

fn test(residual: Residual) -> ResidualTest {
    ResidualTest { residual: Some(residual), ..ResidualTest::default() }
}

fn structure(is_of_law: bool) -> Structure {
    Structure { gain_nats: 30.0, p_familywise: 0.005, is_of_law, twins: vec![("force-bias".into(), 0.96)] }
}

/// Evidence with one effect that passes, and with the residual of its model.
fn claim(residual: Residual) -> Evidence {
    let proposal = ClaimProposal { test: Some(test(residual)), ..addition(&["force-bias"], 0.01, 0).into() };
    Evidence { proposals: vec![proposal], base: None, rivals: Vec::new() }
}

fn of_base(test: Option<ResidualTest>) -> Evidence {
    Evidence { base: test, ..Evidence::default() }
}

fn decide(evidence: &Evidence) -> (VerdictKind, Vec<String>) {
    let Verdict { kind, effects, .. } = decide_verdict(evidence, &CRITERIA);
    (kind, effects)
}

#[test]
fn an_effect_that_passes_and_leaves_noise_is_missing() {
    assert_eq!(decide(&claim(noise())), (VerdictKind::Missing, vec!["force-bias".into()]));
    assert_eq!(claim(noise()).claim(&CRITERIA), Some(0));
}

#[test]
fn each_round_spends_half_of_the_one_before_and_every_threshold_has_to_be_passed() {
    assert_eq!([0, 1, 2].map(|round| CRITERIA.p_of_round(round)), [0.05, 0.025, 0.0125]);
    let passes =
        |p: f64, round: usize, gain: Gain| CRITERIA.passes(&Addition { gain, ..addition(&["force-bias"], p, round) });
    assert!(passes(0.05, 0, GAIN) && !passes(0.051, 0, GAIN));
    assert!(passes(0.025, 1, GAIN) && !passes(0.026, 1, GAIN));
    assert!(passes(0.01, 0, Gain { largest_change: 0.25, ..GAIN }));
    assert!(!passes(0.01, 0, Gain { largest_change: 0.24, ..GAIN }));
    for future in [Some(2.0), Some(-5.0), None] {
        assert!(!passes(0.01, 0, Gain { future, ..GAIN }), "{future:?}");
    }
    // In six of eight records with a claim and no hidden effect, a gain on earlier cycles alone was chance.
    assert!(passes(0.01, 0, Gain { last: Some(-0.05), ..GAIN }));
    assert!(!passes(0.01, 0, Gain { last: Some(-1.0), ..GAIN }));
    assert!(!passes(0.01, 0, Gain { last: None, ..GAIN }));
    // The loss of an earlier step that failed counts as well.
    let behind = Addition { over_base: Gain { future: Some(1.0), ..GAIN }, ..addition(&["force-bias"], 0.01, 0) };
    assert!(!CRITERIA.passes(&behind));
}

/// A proposal that does not pass is not claimed, for any residual.
#[test]
fn nothing_is_missing_where_no_proposal_passes_and_the_base_leaves_noise() {
    let mut evidence = claim(noise());
    evidence.proposals[0].addition.p = 0.2;
    assert_eq!(evidence.next_test(&CRITERIA), Some(None));
    evidence.base = Some(test(noise()));
    assert_eq!(decide(&evidence), (VerdictKind::None, Vec::new()));
    assert!(!decide_verdict(&evidence, &CRITERIA).is_doubtful);
}

/// A residual of 1.35 times the known noise in 100 positions is doubtful. White noise is never so large; slow noise may be.
#[test]
fn a_large_residual_beside_known_noise_is_doubtful() {
    let is_doubtful = |factor: f64, is_known: bool| {
        let verdict = decide_verdict(&of_base(Some(test(misfit(factor, is_known, false)))), &CRITERIA);
        assert_eq!(verdict.kind, VerdictKind::None);
        verdict.is_doubtful
    };
    assert!(is_doubtful(1.35, true) && !is_doubtful(1.29, true));
    // A residual cannot exceed a noise that was estimated from it.
    assert!(!is_doubtful(1.35, false));
}

#[test]
fn an_untested_residual_is_not_noise() {
    assert_eq!(decide(&of_base(None)), (VerdictKind::Unexplained, Vec::new()));
    let mut evidence = claim(noise());
    evidence.proposals[0].test = None;
    assert_eq!(evidence.next_test(&CRITERIA), Some(Some(0)));
    assert_eq!(decide(&evidence), (VerdictKind::Unexplained, vec!["force-bias".into()]));
}

#[test]
fn a_misfit_that_stays_is_unexplained() {
    assert_eq!(decide(&of_base(Some(test(excess())))), (VerdictKind::Unexplained, Vec::new()));
    // The effect helps but is not the cause, so it has no rivals.
    assert_eq!(decide(&claim(excess())), (VerdictKind::Unexplained, vec!["force-bias".into()]));
    assert_eq!(claim(excess()).claim(&CRITERIA), None);
}

/// A noise model may absorb a claim's residual. The claim's error on the held-out cycle is therefore judged by its own predictive noise. The base claims nothing, so this
/// does not apply to it.
#[test]
fn a_claim_that_leaves_more_than_its_predictive_noise_is_unexplained() {
    let leaves = |factor: f64| {
        let Residual::Record { misfit, n_positions, .. } = noise() else { unreachable!("of a record") };
        Residual::Record { misfit, n_positions, over_predicted: Some(factor) }
    };
    assert_eq!(decide(&claim(leaves(1.49))), (VerdictKind::Missing, vec!["force-bias".into()]));
    // Error of 24.6 µm with a predictive noise of 9.4 µm.
    assert_eq!(decide(&claim(leaves(24.6 / 9.4))), (VerdictKind::Unexplained, vec!["force-bias".into()]));
    // Of a pair, only the leading effect helps, and its residual is judged by the same rule.
    let pair =
        ClaimProposal { test: Some(test(leaves(2.6))), ..addition(&["force-bias", "tracking-drift"], 0.01, 1).into() };
    let mut evidence = Evidence { proposals: vec![pair, addition(&["force-bias"], 0.01, 0).into()], ..claim(noise()) };
    assert_eq!(evidence.next_test(&CRITERIA), Some(Some(1)));
    evidence.proposals[1].test = Some(test(leaves(2.7)));
    assert_eq!(decide(&evidence), (VerdictKind::Unexplained, vec!["force-bias".into()]));
    // A cohort's claim has an error of 1.76 µm at a noise of 0.1 µm.
    let of_cohort = |factor: f64| {
        let mut evidence = claim(Residual::CohortClaim(Some(factor)));
        evidence.proposals[0].addition = Addition::of_gains("force-bias", 20.0, [Some(9.0); 2], 0.005);
        (decide_verdict(&evidence, &Criteria::COHORT).kind, evidence.claim(&Criteria::COHORT))
    };
    assert_eq!(of_cohort(1.49), (VerdictKind::Missing, Some(0)));
    assert_eq!(of_cohort(17.6), (VerdictKind::Unexplained, None));
}

/// If a larger model keeps a misfit, the leading effect alone is considered next, and then the base.
#[test]
fn no_effect_is_added_for_the_sake_of_a_misfit_that_stays() {
    let pair =
        ClaimProposal { test: Some(test(excess())), ..addition(&["force-bias", "tracking-drift"], 0.01, 1).into() };
    let mut evidence = Evidence { proposals: vec![pair, addition(&["force-bias"], 0.01, 0).into()], ..claim(noise()) };
    assert_eq!(evidence.next_test(&CRITERIA), Some(Some(1)));
    evidence.proposals[1].test = Some(test(excess()));
    assert_eq!(evidence.next_test(&CRITERIA), None);
    assert_eq!(decide(&evidence), (VerdictKind::Unexplained, vec!["force-bias".into()]));
    evidence.proposals[1].addition.p = 0.2;
    assert_eq!(evidence.next_test(&CRITERIA), Some(None));
}

#[test]
fn structure_beside_a_claim_leaves_it_and_structure_alone_is_unexplained() {
    let mut evidence = claim(noise());
    evidence.proposals[0].test.as_mut().expect("tested").structure = vec![structure(true)];
    let found = decide_verdict(&evidence, &CRITERIA);
    assert_eq!((found.kind, found.has_structure), (VerdictKind::Missing, true));
    let alone = ResidualTest { structure: vec![structure(false)], ..test(noise()) };
    assert_eq!(decide(&of_base(Some(alone))), (VerdictKind::Unexplained, Vec::new()));
}

/// A slip replaces a claim. If a curve that may belong to the law replaces it, the leading effect is reported as helping, provided that its own residual is a misfit.
#[test]
fn structure_takes_the_place_of_a_claim() {
    let mut evidence = claim(noise());
    let replaced = |is_of_law: bool| {
        Some(ResidualTest { structure: vec![structure(is_of_law)], replaces_effects: true, ..test(noise()) })
    };
    evidence.proposals[0].test = replaced(false);
    assert!(evidence.next_test(&CRITERIA).is_none() && !evidence.is_replaced_by_law(&CRITERIA));
    assert_eq!(decide(&evidence), (VerdictKind::Unexplained, Vec::new()));
    evidence.proposals[0].test = replaced(true);
    assert!(evidence.is_replaced_by_law(&CRITERIA));
    evidence.proposals[0].alone = Some(noise());
    assert_eq!(decide(&evidence), (VerdictKind::Unexplained, Vec::new()));
    evidence.proposals[0].alone = Some(excess());
    assert_eq!(decide(&evidence), (VerdictKind::Unexplained, vec!["force-bias".into()]));
    assert_eq!(decide_verdict(&evidence, &CRITERIA).residual, Some(excess()));
}

#[test]
fn structure_is_held_against_chance_and_the_claim() {
    let claim = addition(&["force-bias"], 0.01, 0);
    let of = |gain_nats: f64| Structure { gain_nats, ..structure(true) };
    assert!(CRITERIA.is_significant(&of(5.5)) && !CRITERIA.is_significant(&of(5.4)));
    assert!(!CRITERIA.is_significant(&Structure { p_familywise: 0.021, ..of(30.0) }));
    // The claim gains 20 nats.
    assert!(CRITERIA.adds_to_claim(&of(2.0), &claim) && !CRITERIA.adds_to_claim(&of(1.9), &claim));
    assert!(CRITERIA.replaces_claim(&of(18.6), &claim, true) && !CRITERIA.replaces_claim(&of(18.4), &claim, true));
    assert!(CRITERIA.replaces_claim(&of(24.6), &claim, false) && !CRITERIA.replaces_claim(&of(24.4), &claim, false));
    assert!(CRITERIA.replaces_claim(&of(10.6), &addition(&["force-bias", "tracking-drift"], 0.01, 1), true));
    assert!(CRITERIA.resembles_effect(&of(9.0), |slug| slug == "force-bias"));
    assert!(!CRITERIA.resembles_effect(&of(9.0), |slug| slug == "tracking-drift"));
}

fn rival(deficit_nats: f64, separation_sigma: Option<f64>, lead_p: Option<f64>) -> Rival {
    Rival { effect: "clock-offset".into(), deficit_nats, separation_sigma, lead_p }
}

#[test]
fn several_effects_are_equivalent() {
    let mut evidence = claim(noise());
    evidence.rivals = vec![
        Rival { effect: "force-asymmetry".into(), ..rival(5.9, Some(3.9), None) },
        rival(5.9, Some(4.0), None),
        rival(6.1, Some(0.0), None),
    ];
    assert_eq!(decide_verdict(&evidence, &CRITERIA).equivalent, ["force-asymmetry"]);
    // An effect that only helps has no equivalent effects.
    evidence.proposals[0].test = Some(test(excess()));
    assert!(decide_verdict(&evidence, &CRITERIA).equivalent.is_empty());
}

/// A sweep has no future cycles. Only nats distinguish its rivals.
#[test]
fn a_sweep_is_judged_by_p_and_held_out_frequencies() {
    let criteria = Criteria::SWEEP;
    let addition = |p: f64, last: Option<f64>| Addition::of_gains("mass", 20.0, [None, last], p);
    let passes = |p: f64, last: Option<f64>| criteria.passes(&addition(p, last));
    assert!(passes(0.01, None) && passes(0.01, Some(-0.09)));
    assert!(!passes(0.01, Some(-0.1)) && !passes(0.011, None));
    assert!(criteria.is_equivalent(&rival(1.9, None, None)) && !criteria.is_equivalent(&rival(2.1, None, None)));
    let kind = |p: f64| {
        let mut evidence = claim(Residual::Sweep(p));
        evidence.proposals[0].addition = addition(0.005, None);
        decide_verdict(&evidence, &criteria).kind
    };
    assert_eq!(
        [0.01, 0.009, f64::NAN].map(kind),
        [VerdictKind::Missing, VerdictKind::Unexplained, VerdictKind::Unexplained]
    );
}

/// Simulated cohorts distinguish a cohort's rivals. If nothing is claimed and records have a residual above the noise, the verdict is unexplained.
#[test]
fn a_cohort_is_judged_by_p_and_held_out_cycles() {
    let criteria = Criteria::COHORT;
    let addition = |heldout: Option<f64>, p: f64| Addition::of_gains("mass", 20.0, [heldout; 2], p);
    assert!(criteria.passes(&addition(Some(2.1), 0.01)) && !criteria.passes(&addition(Some(2.1), 0.011)));
    assert!(!criteria.passes(&addition(Some(2.0), 0.01)) && !criteria.passes(&addition(None, 0.01)));
    assert!(criteria.is_equivalent(&rival(30.0, None, Some(0.021))));
    assert!(!criteria.is_equivalent(&rival(0.1, None, Some(0.02))));
    let kind = |n: usize| decide_verdict(&of_base(Some(test(Residual::Cohort(n)))), &criteria).kind;
    assert_eq!([0, 1].map(kind), [VerdictKind::None, VerdictKind::Unexplained]);
    let nothing = decide_verdict(&of_base(Some(test(Residual::Cohort(1)))), &criteria);
    let status = |gain_nats: Option<f64>, p: f64| {
        let visible_fraction = gain_nats.map(|_| 1.0);
        nothing.status(&EffectEvidence { effect: "mass", gain_nats, p, visible_fraction }, &criteria)
    };
    assert_eq!(status(Some(1.0), 0.05), Status::Suggestive);
    assert_eq!(status(Some(1.0), 0.051), Status::Unsupported);
    assert_eq!(status(None, 1.0), Status::Invisible);
}

#[test]
fn a_status_is_that_of_gain_visibility_and_verdict() {
    let effect = |gain: f64, visible_fraction: Option<f64>| EffectEvidence {
        effect: "tracking-drift",
        gain_nats: Some(gain),
        p: 0.5,
        visible_fraction,
    };
    let nothing = decide_verdict(&of_base(Some(test(noise()))), &CRITERIA);
    let of = |gain: f64, visible: Option<f64>| nothing.status(&effect(gain, visible), &CRITERIA);
    assert_eq!(of(2.1, Some(0.5)), Status::Suggestive);
    assert_eq!(of(1.9, Some(0.5)), Status::Unsupported);
    assert_eq!(of(1.9, Some(0.9e-3)), Status::Invisible);
    assert_eq!(of(2.1, Some(0.9e-3)), Status::Suggestive);
    assert_eq!(of(1.9, None), Status::Invisible);
    let bias = EffectEvidence { effect: "force-bias", ..effect(20.0, Some(0.5)) };
    let missing = decide_verdict(&claim(noise()), &CRITERIA);
    assert_eq!(missing.status(&bias, &CRITERIA), Status::Claimed);
    assert_eq!(missing.status(&effect(9.0, Some(0.5)), &CRITERIA), Status::Unsupported);
    assert_eq!(decide_verdict(&claim(excess()), &CRITERIA).status(&bias, &CRITERIA), Status::Suggestive);
}
