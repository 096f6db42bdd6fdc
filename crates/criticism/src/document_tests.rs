//! Sentences and numbers of a document, for a search whose results are set by hand.

use nalgebra::DMatrix;

use super::*;
use crate::NoiseValues;
use crate::criteria::Criteria;
use crate::derivatives::columns_m;
use crate::outside::OutsideKind;
use crate::search::tests::{BIAS, DRIFT_M_PER_S, found, found_beside, refitted, small};
use crate::separation::tests::measured;
use crate::test_replica::replica_with;
use crate::verdict::{Addition, ClaimProposal, Evidence, Residual, ResidualTest, Rival, decide_verdict};
use models::effects::Library;
use posterior::misfit::ResidualSize;
use posterior::monitor::SilentMonitor;

const SMALL: ResidualSize = ResidualSize { rms_m: 4e-6, is_too_large: false };
const LARGE: ResidualSize = ResidualSize { rms_m: 6.4e-6, is_too_large: true };
/// Misfit of a model whose residual is 4 µm of known noise alone.
const WITHIN: Misfit = Misfit {
    fitted: SMALL,
    heldout: Some(SMALL),
    noise_m: 4e-6,
    is_known: true,
    implausible_gains: None,
    returning_m: None,
    learnt_degrees: 1.0,
};

/// Returns the verdict on a model that passes, or on the base, from its residual and from rivals that are not separated from it.
fn decided(
    model: Option<&Refitted>,
    found: &SearchResult,
    left: &Misfit,
    outside: &[OutsideStructure],
    rivals: &[&str],
) -> Verdict {
    let test = ResidualTest {
        structure: outside.iter().map(OutsideStructure::evidence).collect(),
        replaces_effects: false,
        residual: Some(Residual::Record { misfit: *left, n_positions: 100, over_predicted: None }),
    };
    let gain = Gain { fitted: 20.0, future: Some(9.0), last: Some(3.0), largest_change: 1.0, rank: 23.0 };
    let proposal = |model: &Refitted| {
        let effects = found.added(model).into_iter().map(String::from).collect();
        let addition = Addition { effects, gain, over_base: gain, p: 0.01, round: 0 };
        ClaimProposal { addition, test: Some(test.clone()), alone: None }
    };
    let rival =
        |slug: &&str| Rival { effect: slug.to_string(), deficit_nats: 1.0, separation_sigma: Some(1.0), lead_p: None };
    let evidence = Evidence {
        proposals: model.map(proposal).into_iter().collect(),
        base: Some(test.clone()),
        rivals: rivals.iter().map(rival).collect(),
    };
    decide_verdict(&evidence, &Criteria::RECORD)
}

/// Returns a report that has only a search and its verdict: nothing is unexplained.
fn plain<'a>(
    subject: &'a Subject,
    request: &'a DiagnosisRequest,
    found: &'a SearchResult,
    (verdict, model): (&'a Verdict, Option<&'a Refitted>),
) -> Report<'a> {
    let (unexplained, left, equivalent) = (&[], &WITHIN, &[]);
    Report {
        subject,
        request,
        found,
        verdict,
        model,
        unexplained,
        left,
        pattern: None,
        over_predicted: None,
        leftover: None,
        event: None,
        equivalent,
        every_position: subject,
    }
}

/// Errors of the base, and of an extended model if given, for a sentence.
fn shown(extended: Option<&Errors>) -> DocumentSource<'_> {
    DocumentSource { base: ModelErrors { rmse_fitted_um: 4.1, rmse_heldout_um: Some(9.0) }, extended }
}

/// Returns structure outside the library; only its sentence matters.
pub fn slip(model: &Refitted) -> OutsideStructure {
    OutsideStructure {
        kind: OutsideKind::Slip,
        sentence: "a slip.".into(),
        gain_nats: 30.0,
        penalised_gain_nats: 25.0,
        p_familywise: 0.005,
        size_um: 9.0,
        event_time_s: Some(12.0),
        period_s: None,
        twins: Vec::new(),
        candidate: model.candidate.clone(),
        fitted: model.fitted.clone(),
        discrepancy_m: Vec::new(),
    }
}

fn request() -> DiagnosisRequest {
    DiagnosisRequest { in_full: false, ..DiagnosisRequest::default() }
}

#[test]
fn the_verdict_follows_claim_structure_and_noise() {
    let data = measured(&small(), &["force-bias"], &[BIAS], 31);
    let mut found = found(&data, &[1.0; 99]);
    let request = request();
    let after = Errors { rmse_fitted_um: 4.0, rmse_heldout_um: Some(4.2), predictive_noise_um: None };
    let too_large = Misfit { heldout: Some(LARGE), returning_m: Some(5e-6), ..WITHIN };
    let kind = |found: &SearchResult, model: Option<&Refitted>, unexplained: &[OutsideStructure], left: &Misfit| {
        let verdict = decided(model, found, left, unexplained, &[]);
        let report = Report { unexplained, left, ..plain(&data, &request, found, (&verdict, model)) };
        let statuses: Vec<Status> = found.singles.iter().map(|single| report.status(single)).collect();
        (verdict.kind, verdict.effects.clone(), report.sentence(&[], &shown(model.map(|_| &after))), statuses)
    };
    let outside = [slip(&found.base)];
    // The residual decides the verdict, however large the learnt noise is.
    found.base.fitted.noise = NoiseValues::new([4.0, 5.0, 1.0, 0.01, 1.0]);
    let (none, effects, sentence, statuses) = kind(&found, None, &[], &WITHIN);
    assert_eq!((none, effects.len()), (VerdictKind::None, 0));
    // The bias moves the whole cycle, as a gain and an offset would. The sentence says why this counts as noise.
    let name = "on the last held-out cycle (noise 4.00). With each cycle's own gain and offset 4.00 µm are left; `sample` allows them only with `--noise white,gain`.";
    assert!(sentence.contains(name) && sentence.starts_with("If each cycle may have a gain"), "{sentence}");
    assert_eq!(statuses[1], Status::Suggestive);
    let (unexplained, _, sentence, statuses) = kind(&found, None, &outside, &WITHIN);
    assert_eq!(unexplained, VerdictKind::Unexplained);
    assert!(sentence.ends_with("a slip.") && statuses[1] == Status::Unsupported, "{sentence}");
    let (unexplained, effects, sentence, _) = kind(&found, None, &[], &too_large);
    assert_eq!((unexplained, effects.len()), (VerdictKind::Unexplained, 0));
    assert!(sentence.contains("1.6 times the known noise of 4.00 µm on the last held-out cycle"), "{sentence}");
    assert!(sentence.contains("5.00 µm of it recur in every cycle"), "{sentence}");
    // If no noise is given, the sentence does not call it known.
    let estimated = Misfit { is_known: false, ..WITHIN };
    let (none, _, sentence, _) = kind(&found, None, &[], &estimated);
    assert_eq!(none, VerdictKind::None);
    assert!(
        sentence.contains("(noise 4.00, estimated; 6.40 learnt, slow noise included)") && !sentence.contains("known"),
        "{sentence}"
    );
    let claimed = found.singles[1].refitted.as_ref();
    for (list, remains) in [(&outside[..0], false), (&outside[..], true)] {
        let (missing, effects, sentence, statuses) = kind(&found, claimed, list, &WITHIN);
        assert!(sentence.contains("the error on the last held-out cycle goes from 9.00 to 4.20 µm"), "{sentence}");
        assert_eq!((missing, effects), (VerdictKind::Missing, vec!["force-bias".to_string()]));
        assert_eq!(sentence.contains("Unexplained in this experiment: a slip."), remains);
        assert_eq!(statuses[1], Status::Claimed);
        assert!(statuses[0] != Status::Suggestive && statuses[2] != Status::Suggestive);
    }
    // An effect that helps but does not suffice is no cause.
    let (unexplained, effects, sentence, statuses) = kind(&found, claimed, &[], &too_large);
    assert_eq!((unexplained, effects), (VerdictKind::Unexplained, vec!["force-bias".to_string()]));
    assert!(
        sentence.starts_with("No tried effect makes the model right") && sentence.contains("not the cause"),
        "{sentence}"
    );
    assert_eq!(statuses[1], Status::Suggestive);
}

/// Without a held-out cycle nothing is claimed. An effect that gains more than the structure outside the library is named nevertheless.
#[test]
fn an_effect_that_no_cycle_tests_is_named() {
    let data = measured(&small(), &["force-bias"], &[BIAS], 31);
    let every: Vec<u32> = (1..=data.experiment().record.n_cycles()).collect();
    let data = data.with_cycles(&every, &[]).expect("cycles");
    let found = found(&data, &[1.0; 99]);
    let request = request();
    let gain_of = |single: &Single| single.gain.map_or(f64::NEG_INFINITY, |gain| gain.fitted);
    let best = found.singles.iter().max_by(|a, b| gain_of(a).total_cmp(&gain_of(b))).expect("effects");
    let gain_nats = gain_of(best);
    for (of_structure, is_named) in [(0.5 * gain_nats, true), (2.0 * gain_nats, false)] {
        let outside = [OutsideStructure { gain_nats: of_structure, ..slip(&found.base) }];
        let verdict = decided(None, &found, &WITHIN, &outside, &[]);
        let report = Report { unexplained: &outside, ..plain(&data, &request, &found, (&verdict, None)) };
        let sentence = report.sentence(&[], &shown(None));
        assert_eq!(sentence.contains(&format!("Of the library, {} explains most", best.slug)), is_named, "{sentence}");
        assert_eq!(sentence.contains("a slip."), !is_named, "{sentence}");
        assert_eq!(report.status(best) == Status::Suggestive, is_named);
    }
}

#[test]
#[ignore = "thorough"]
fn a_rival_that_is_not_separated_is_named() {
    let data = measured(&small(), &["force-bias"], &[BIAS], 32);
    let found = found(&data, &[1.0; 99]);
    let claimed = found.singles[1].refitted.as_ref();
    let verdict = decided(claimed, &found, &WITHIN, &[], &["force-asymmetry"]);
    let request = request();
    let report = plain(&data, &request, &found, (&verdict, claimed));
    let statuses: Vec<Status> = found.singles[..2].iter().map(|single| report.status(single)).collect();
    assert_eq!(statuses, [Status::Equivalent, Status::Claimed]);
    let sentence = report.sentence(&[], &shown(None));
    assert!(sentence.contains("cannot distinguish it from force-asymmetry"), "{sentence}");
}

/// A signal of s σ gains s²/2 nats on average. The threshold is 1 σ above the signal whose gain equals the threshold of the simulated searches.
#[test]
fn the_threshold_is_the_signal_that_gains_it() {
    let data = measured(&small(), &[], &[], 33);
    for (simulated, sigma) in [(8.0, 5.0), (0.5, 3.0)] {
        let found = found(&data, &[simulated; 20]);
        let request = request();
        let nothing = decided(None, &found, &WITHIN, &[], &[]);
        let report = plain(&data, &request, &found, (&nothing, None));
        assert!((report.threshold_sigma() - sigma).abs() < 1e-12);
    }
}

/// The predictive noise agrees with dense algebra. It consists of the parameters' uncertainty, given the fitted rows, and of the noise of one position, with the fitted
/// gain, however small.
#[test]
fn predictive_noise_is_that_of_dense_algebra() {
    let data = measured(&small(), &[], &[], 34);
    let found = found(&data, &[]);
    let mut model = found.base.clone();
    model.fitted.noise = NoiseValues::new([4.0, 2.0, 0.8, 0.002, 1.0]);
    let request = request();
    let nothing = decided(None, &found, &WITHIN, &[], &[]);
    let report = plain(&data, &request, &found, (&nothing, None));
    let errors = report.errors(&model).expect("a fit");
    let scored: Vec<usize> = (0..data.scored_m.len()).filter(|row| data.scored_m[*row].is_some()).collect();
    let x_m = &model.fitted.position_m;
    let record = &data.experiment().record;
    let rows: Vec<usize> = (0..data.fitted_m.len()).filter(|row| data.fitted_m[*row].is_some()).collect();
    let inverse = DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
        let (a, b) = (rows[i], rows[j]);
        let white = if a == b { 4e-6_f64.powi(2) } else { 0.0 };
        let process = 2e-6_f64.powi(2) * (-(record.time_s[a] - record.time_s[b]).abs() / 0.8).exp();
        let same = f64::from(u8::from(record.cycle[a] == record.cycle[b]));
        white + process + same * (0.002_f64.powi(2) * x_m[a] * x_m[b] + 1e-6_f64.powi(2))
    })
    .try_inverse()
    .expect("regular");
    let columns = columns_m(&data, &model.candidate, &model.fitted.theta).expect("derivatives");
    let a = DMatrix::from_fn(rows.len(), columns.len(), |i, k| columns[k][rows[i]]);
    let mut told = a.transpose() * inverse * &a;
    for (k, free) in model.candidate.free.iter().enumerate() {
        told[(k, k)] += free.prior.map_or(0.0, |(_, sd)| sd.powi(-2));
    }
    let covariance = told.try_inverse().expect("regular");
    let variance_m2 = |row: &usize| {
        let slope = DMatrix::from_fn(columns.len(), 1, |k, _| columns[k][*row]);
        let of_parameters = (slope.transpose() * &covariance * &slope)[(0, 0)];
        of_parameters + 21e-12 + 0.002_f64.powi(2) * x_m[*row].powi(2)
    };
    let expected_um = 1e6 * (scored.iter().map(variance_m2).sum::<f64>() / scored.len() as f64).sqrt();
    let found_um = errors.predictive_noise_um.expect("scored");
    assert!((found_um / expected_um - 1.0).abs() < 1e-4, "{found_um} {expected_um}");
}

/// The parameters of a claimed pair are those of the joint model. A Bayes factor refers to an effect alone, and is below the effect's gain by the cost of its prior. The
/// document's p counts simulated searches.
#[test]
#[ignore = "thorough"]
fn a_document_holds_the_claim_with_sizes_of_the_whole_model() {
    let data = measured(&small(), &["force-bias", "tracking-drift"], &[BIAS, DRIFT_M_PER_S], 35);
    let found = found(&data, &[1.0, 1e9, 2.0, 1e9]);
    let pair = refitted(&data, &found, &["force-bias", "tracking-drift"]);
    let verdict = decided(Some(&pair), &found, &WITHIN, &[], &[]);
    let request = request();
    let report = plain(&data, &request, &found, (&verdict, Some(&pair)));
    let document = report.document(vec![3], &SilentMonitor).expect("a document");
    assert_eq!(document.verdict.effects, ["force-bias", "tracking-drift"]);
    assert_eq!((&document.outlier_rows[..], &document.heldout_cycles[..]), (&[3][..], &[4][..]));
    let (before, after) =
        (document.base.rmse_heldout_um, document.extended.as_ref().and_then(|errors| errors.rmse_heldout_um));
    let (before, after) = (before.expect("scored"), after.expect("scored"));
    assert!(before > 2.0 * after, "{before} {after}");
    let words = format!("goes from {} to {} µm", short(before), short(after));
    assert!(document.verdict.sentence.contains(&words), "{}", document.verdict.sentence);
    let mut n_apart = 0;
    for (place, slug) in ["force-bias", "tracking-drift"].into_iter().enumerate() {
        let entry = document.candidates.iter().find(|entry| entry.effect == slug).expect("of the library");
        assert_eq!((entry.status, entry.p_familywise), (Status::Claimed, 3.0 / 5.0));
        let refit = entry.refit.as_ref().expect("refitted");
        let single = found.single(slug).and_then(|single| single.refitted.as_ref()).expect("refitted");
        let gain = single.fitted.objective - found.base.fitted.objective;
        assert_eq!(refit.gain_nats, gain);
        let factor = refit.log_bayes_factor.expect("claimed");
        assert!(factor > 0.0 && factor < gain, "{slug}: {factor} of {gain}");
        let [parameter] = &refit.parameters[..] else { panic!("{:?}", refit.parameters) };
        let half = 0.5 * (parameter.q95 - parameter.q05);
        let size = |model: &Refitted, place: usize| {
            let k = 3 + place;
            model.candidate.free[k].coordinate.value(model.fitted.theta[k])
        };
        assert!((parameter.mean - size(&pair, place)).abs() < 0.6 * half, "{parameter:?}");
        n_apart += usize::from((size(single, 0) - size(&pair, place)).abs() > 1.2 * half);
    }
    assert!(n_apart > 0);
    let other = document.candidates.iter().find(|entry| entry.effect == "force-asymmetry").expect("of the library");
    assert!(other.refit.as_ref().expect("refitted").log_bayes_factor.is_none());
    // The status of an unclaimed effect that gains more than chance is called weaker, not unsupported.
    let standing = |p_familywise: f64| {
        let entry = CandidateEntry { status: Status::Unsupported, p_familywise, ..other.clone() };
        document.status_words(&entry)
    };
    assert_eq!([standing(0.01), standing(0.4)], ["weaker than the claim", "no more than chance"]);
}

/// A claim gets its evidence. An effect that cannot come near the claim gets a bound instead, and a remark names it. The bound holds: log Bayes factors stay below gains
/// plus the possible widening of the posterior.
#[test]
#[ignore = "thorough"]
fn what_cannot_come_near_the_claim_gets_a_bound() {
    let data = measured(&small(), &["force-bias"], &[BIAS], 36);
    let mut found = found(&data, &[1.0; 99]);
    let claimed = found.single("force-bias").and_then(|single| single.refitted.clone());
    let verdict = decided(claimed.as_ref(), &found, &WITHIN, &[], &[]);
    let request = DiagnosisRequest::default();
    let weighed = |found: &SearchResult| {
        EvidenceSet::new(&data, &request, (found, claimed.as_ref()), &SilentMonitor).expect("weighed")
    };
    let at = |found: &SearchResult, slug: &str| weighed(found).factor(slug);
    let BayesFactor::Known(claim) = at(&found, "force-bias") else { panic!("the claim is weighed") };
    let gain = found.single("force-bias").and_then(|single| single.gain).expect("refitted").fitted;
    assert!(claim > 20.0 && claim < gain + 5.0, "{claim} {gain}");
    let drift = found.singles.iter().position(|single| single.slug == "tracking-drift").expect("of the library");
    let with_gain = |found: &mut SearchResult, nats: f64| {
        let single = &mut found.singles[drift];
        single.gain = single.gain.map(|gain| Gain { fitted: nats, ..gain });
    };
    with_gain(&mut found, 3.0);
    assert_eq!(at(&found, "tracking-drift"), BayesFactor::AtMost(8.0));
    with_gain(&mut found, 1.9);
    assert_eq!(at(&found, "tracking-drift"), BayesFactor::Unknown);
    with_gain(&mut found, claim - 14.9);
    let BayesFactor::Known(near) = at(&found, "tracking-drift") else { panic!("within reach") };
    let single = found.single("tracking-drift").and_then(|single| single.refitted.as_ref()).expect("refitted");
    assert!(near < single.fitted.objective - found.base.fitted.objective + 5.0, "{near}");
    with_gain(&mut found, 3.0);
    let weighing = weighed(&found);
    assert!(weighing.remarks.iter().any(|remark| remark.contains("tracking-drift")), "{:?}", weighing.remarks);
    let report = plain(&data, &request, &found, (&verdict, claimed.as_ref()));
    let entry = report.candidate(&found.singles[drift], Vec::new(), None, &weighing).expect("derivatives");
    let refit = entry.refit.expect("refitted");
    assert_eq!((refit.log_bayes_factor, refit.log_bayes_factor_at_most), (None, Some(8.0)));
    assert_eq!(refit.parameters.len(), 1);
}

/// Beside a claim, a nonlinear law only gets an upper bound of its Bayes factor, however large its gain is. A remark names the law, and another the claim, which the evidence does not favour: the replica has
/// no bias of the force.
#[test]
#[ignore = "thorough"]
fn a_law_that_is_not_linear_is_not_weighed_beside_a_claim() {
    const SLUGS: [&str; 2] = ["force-bias", "strain-stiffening"];
    let data = replica_with(&Library::only(&SLUGS));
    let mut found = found_beside(&data, &SLUGS);
    let near = Gain { fitted: 1e3, future: None, last: None, largest_change: 1.0, rank: 1e3 };
    found.singles.iter_mut().for_each(|single| single.gain = Some(near));
    let claimed = found.singles[0].refitted.as_ref();
    let request = DiagnosisRequest::default();
    let weighing = EvidenceSet::new(&data, &request, (&found, claimed), &SilentMonitor).expect("weighed");
    assert!(matches!(weighing.factor("force-bias"), BayesFactor::Known(_)));
    assert_eq!(weighing.factor("strain-stiffening"), BayesFactor::AtMost(1005.0));
    let [remark, against] = &weighing.remarks[..] else { panic!("{:?}", weighing.remarks) };
    assert!(against.starts_with("the evidence is against force-bias"), "{against}");
    assert!(remark.contains("strain-stiffening") && remark.contains("because nonlinear laws take long"), "{remark}");
}

/// Two modes are reported with their probabilities; a single mode is not mentioned.
#[test]
fn two_answers_are_said() {
    let answer = |probability: f64, mean: f64| {
        let (q05, q95) = (0.9 * mean, 1.1 * mean);
        PosteriorMode { probability, parameters: vec![RefitParameter { name: "a.size".into(), mean, q05, q95 }] }
    };
    assert_eq!(in_words(&[]), None);
    assert_eq!(
        in_words(&[answer(0.7, 2.0), answer(0.3, 30.0)]).expect("two"),
        "The posterior has two modes: a.size = 2.00 (1.80 to 2.20 at 90 %) with probability 0.70 or a.size = 30.0 (27.0 to 33.0 at 90 %) with probability 0.30"
    );
}
