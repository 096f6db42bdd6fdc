//! The search's parts on models made by hand, and all of it on two effects.

use super::*;
use crate::future::FutureScore;
use crate::separation::tests::{NOISE, TWO_LEVELS, measured, subject_with};
use crate::{Fitted, rank};
use models::effects::Library;
use posterior::monitor::Silent;

const BARS: Bars = Bars { largest_p: 0.05, least_future_nats: 2.0, smallest_change: 0.25 };
const SLUGS: [&str; 3] = ["force-asymmetry", "force-bias", "tracking-drift"];
/// 8 % of the force, and 0.6 mm/h: each some ten σ and more of the records used here.
pub const BIAS: f64 = 0.08;
pub const DRIFT_M_PER_S: f64 = 2e-6;

pub fn small() -> Subject {
    subject_with(&TWO_LEVELS, &Library::only(&SLUGS), &[])
}

/// A claim predicts future cycles, and does not lose on the one that no fit has seen: a gain on earlier cycles alone was chance in six of eight records in which nothing
/// was hidden and an effect was claimed.
#[test]
fn a_claim_does_not_lose_on_the_last_cycle() {
    let gain = |future: f64, last: f64| Gain {
        fitted: 5.0,
        future: Some(future),
        last: Some(last),
        largest_change: 1.0,
        rank: 5.0 + last,
    };
    assert!(predicts(&BARS, &gain(3.0, 2.0)) && predicts(&BARS, &gain(3.0, -0.05)));
    assert!(!predicts(&BARS, &gain(3.0, -1.0)) && !predicts(&BARS, &gain(1.9, 1.0)));
    assert!(!predicts(&BARS, &Gain { last: None, future: None, ..gain(3.0, 2.0) }));
}

/// Base and singles at their fits, with the gains of simulated searches given.
pub fn found(data: &Subject, simulated: &[f64]) -> Found {
    let base = Refitted::new(data, data.base(), &[], Search::Wide).expect("fits");
    let slugs: Vec<&'static str> = data.library().effects().iter().map(|effect| effect.slug()).collect();
    let models: Vec<Candidate> = slugs.iter().map(|slug| data.extended(&[slug]).expect("addable")).collect();
    let all: Vec<&Candidate> = models.iter().collect();
    let scores = rank::scores(data, &base.candidate, &base.fitted, &all, 1).expect("derivatives");
    let single = |((slug, candidate), score): ((&'static str, &Candidate), Score)| {
        let refitted = Refitted::new(data, candidate.clone(), &[&base], Search::Wide).expect("fits");
        let gain = Some(refitted.gain_over(&base, data));
        Single { slug, refused: None, refitted: Some(refitted), gain, score: Some(score) }
    };
    let singles = slugs.into_iter().zip(&models).zip(scores).map(single).collect();
    let simulations = Simulations { most: simulated.len(), only_for: None };
    let bootstrap = Bootstrap::of(f64::INFINITY, simulations, |number| simulated[number]);
    Found { base, singles, bootstrap, pairs: Vec::new(), steps: Vec::new(), claimed: None }
}

pub fn refitted(data: &Subject, found: &Found, effects: &[&str]) -> Refitted {
    let singles: Vec<&Refitted> = found.singles.iter().filter_map(|single| single.refitted.as_ref()).collect();
    let inside = singles.into_iter().filter(|s| s.candidate.effects.iter().all(|e| effects.contains(&e.as_str())));
    let contained: Vec<&Refitted> = inside.chain([&found.base]).collect();
    Refitted::new(data, data.extended(effects).expect("addable"), &contained, Search::Local).expect("fits")
}

#[test]
fn each_round_spends_half_of_the_one_before_and_every_bar_has_to_be_passed() {
    assert_eq!([0, 1, 2].map(|round| BARS.p_of_round(round)), [0.05, 0.025, 0.0125]);
    let gain = Gain { fitted: 20.0, future: Some(2.1), last: Some(1.0), largest_change: 0.25, rank: 20.0 };
    assert!(passes(&BARS, &gain, 0.05, 0));
    assert!(passes(&BARS, &gain, 0.025, 1) && !passes(&BARS, &gain, 0.026, 1));
    assert!(!passes(&BARS, &gain, 0.051, 0));
    assert!(!passes(&BARS, &Gain { largest_change: 0.24, ..gain }, 0.01, 0));
    for future in [Some(2.0), Some(-5.0), None] {
        assert!(!passes(&BARS, &Gain { future, ..gain }, 0.01, 0), "{future:?}");
    }
}

/// Models with numbers of their own: a gain is made of differences, and changes are counted in the noise.
#[test]
fn a_gain_is_the_difference_of_two_models() {
    let subject = subject_with(&TWO_LEVELS, &Library::default(), &[]);
    let model = |effects: &[&str], objective: f64, future: Option<FutureScore>, moved_m: f64| {
        let candidate = subject.extended(effects).expect("addable");
        let mut position_m = vec![1e-4; subject.fitted_m.len()];
        position_m[7] -= moved_m;
        position_m[9] += 0.5 * moved_m;
        let theta = vec![0.0; candidate.free.len()];
        let fitted = Fitted { theta, noise: NOISE, position_m, objective, ln_likelihood: objective };
        Refitted { candidate, fitted, future }
    };
    let scores = |all: f64, last: f64| Some(FutureScore { all, last });
    let smaller = model(&[], 100.0, scores(50.0, 20.0), 0.0);
    let gain = model(&["force-bias"], 112.0, scores(59.0, 23.0), 6e-6).gain_over(&smaller, &subject);
    // The yardstick is 4 µm.
    let expected = Gain { fitted: 12.0, future: Some(9.0), last: Some(3.0), largest_change: 1.5, rank: 15.0 };
    assert!((gain.largest_change - 1.5).abs() < 1e-9);
    assert_eq!(Gain { largest_change: 1.5, ..gain }, expected);
    // Two nats for the second parameter of one effect, and for it alone.
    let second = subject.extended(&["second-retardation"]).expect("addable");
    assert_eq!(second.free.iter().filter(|free| free.effect.is_some()).count(), 2);
    let gain = model(&["force-bias", "second-retardation"], 112.0, None, 0.0).gain_over(&smaller, &subject);
    assert_eq!((gain.rank, gain.future, gain.last), (10.0, None, None));
}

#[test]
fn what_a_base_has_is_not_added() {
    let subject = subject_with(&TWO_LEVELS, &Library::only(&SLUGS), &["tracking-drift"]);
    let data = measured(&subject, &[], &[DRIFT_M_PER_S], 3);
    assert_eq!(addable(&data, "tracking-drift").err().as_deref(), Some("the model has `tracking-drift` already"));
    let found = Found { claimed: None, ..found_beside(&data, &["force-bias"]) };
    let bias = found.single("force-bias").and_then(|single| single.refitted.as_ref()).expect("fits");
    assert_eq!(found.added(bias), ["force-bias"]);
    assert!(found.added(&found.base).is_empty());
    let slugs: Vec<Vec<String>> = additions_to(&data, bias).into_iter().map(|larger| larger.effects).collect();
    assert_eq!(slugs, [["tracking-drift", "force-bias", "force-asymmetry"]]);
}

/// Base and some singles, none of which is judged.
pub fn found_beside(data: &Subject, slugs: &[&'static str]) -> Found {
    let base = Refitted::new(data, data.base(), &[], Search::Local).expect("fits");
    let single = |slug: &&'static str| {
        let candidate = data.extended(&[slug]).expect("addable");
        let refitted = Refitted::new(data, candidate, &[&base], Search::Local).ok();
        Single { slug, refused: None, refitted, gain: None, score: None }
    };
    let singles = slugs.iter().map(single).collect();
    let bootstrap = Bootstrap::of(0.0, Simulations { most: 1, only_for: None }, |_| 0.0);
    Found { base, singles, bootstrap, pairs: Vec::new(), steps: Vec::new(), claimed: None }
}

/// A base whose noise was badly searched gets the noise that a larger model was given.
#[test]
fn a_larger_model_does_not_win_by_its_noise() {
    let data = measured(&small(), &[], &[], 4);
    let good = Refitted::new(&data, data.base(), &[], Search::Wide).expect("fits");
    let mut bad = good.clone();
    (bad.fitted.noise, bad.fitted.objective) =
        (crate::NoiseValues::new([40.0, 1.0, 1.0, 0.1, 1.0]), good.fitted.objective - 50.0);
    let better = base_from(&data, &bad, &[None, Some(good.clone())]).expect("a better one");
    assert!((better.fitted.objective - good.fitted.objective).abs() < 0.1);
    assert!(base_from(&data, &good, &[Some(good.clone())]).is_none());
}

/// What stands beside a sufficient effect is taken back, what is needed stays: the needless one has a χ² of one degree to gain, 4 nats or more once in 200
/// records, and the seed is fixed.
#[test]
fn a_needless_effect_is_taken_back() {
    for (truth, values, left) in [
        (&["tracking-drift"][..], &[DRIFT_M_PER_S][..], &["tracking-drift"][..]),
        (&["force-bias", "tracking-drift"], &[BIAS, DRIFT_M_PER_S], &["force-bias", "tracking-drift"]),
        (&["force-bias"], &[BIAS], &["force-bias"]),
    ] {
        let data = measured(&small(), truth, values, 5);
        let found = found_beside(&data, &["force-bias", "tracking-drift"]);
        let pair = refitted(&data, &found, &["force-bias", "tracking-drift"]);
        // One simulated search has no p below a half.
        let kept = without_needless(&data, &Bars { largest_p: 0.5, ..BARS }, &found, pair.clone());
        assert_eq!(found.added(&kept), left);
        // What would not be claimed by itself is not what a claim is cut down to.
        let kept = without_needless(&data, &Bars { largest_p: 0.4, ..BARS }, &found, pair);
        assert_eq!(found.added(&kept), ["force-bias", "tracking-drift"]);
    }
}

/// A pair is judged by what it has over the single that stands, and is not tried where that is little.
#[test]
fn a_pair_is_weighed_against_the_single() {
    let data = measured(&small(), &["tracking-drift"], &[DRIFT_M_PER_S], 6);
    let mut found = found(&data, &[1.0; 99]);
    let pair = refitted(&data, &found, &["force-bias", "tracking-drift"]);
    let gain = pair.gain_over(&found.base, &data);
    found.pairs = vec![(pair.clone(), gain)];
    let single = found.single("tracking-drift").and_then(|single| single.refitted.clone()).expect("fits");
    let (_, difference) = next_larger(&data, &found, &single, 1, &Silent).expect("a pair");
    assert!((difference.fitted - (pair.fitted.objective - single.fitted.objective)).abs() < 1e-9);
    let all = |model: &Refitted| model.future.expect("a cycle is held out").all;
    assert!((difference.future.expect("a cycle is held out") - (all(&pair) - all(&single))).abs() < 1e-9);
    let change = |(a, b): (&f64, &f64)| (a - b).abs() / 4e-6;
    let largest = pair.fitted.position_m.iter().zip(&single.fitted.position_m).map(change).fold(0.0, f64::max);
    assert!((difference.largest_change - largest).abs() < 1e-9);
    let effort = Effort { n_simulations: 99, in_full: false, seed: 1 };
    rounds(&data, &BARS, &effort, &mut found, &Silent);
    let added = found.claimed.as_ref().map(|claimed| found.added(claimed));
    assert_eq!(added, Some(vec!["tracking-drift"]));
    assert_eq!((found.steps.len(), found.steps[0].p), (1, 0.01));
}

/// Where the single fails, a pair has to pass beside it and to predict as a whole; what fails is reported and not claimed.
#[test]
fn a_pair_beside_a_failed_single_has_to_make_good_what_that_lost() {
    let data = measured(&small(), &["force-bias", "tracking-drift"], &[BIAS, DRIFT_M_PER_S], 7);
    let effort = Effort { n_simulations: 19, in_full: false, seed: 1 };
    // Ten simulated searches decide the second round.
    let bars = Bars { largest_p: 0.2, ..BARS };
    let mut found = found(&data, &[1.0; 99]);
    let pair = refitted(&data, &found, &["force-bias", "tracking-drift"]);
    let gain = pair.gain_over(&found.base, &data);
    found.pairs = vec![(pair, gain)];
    let claim = |found: &mut Found, base_ahead: f64, first_p_is_large: bool| {
        if first_p_is_large {
            found.bootstrap = Bootstrap::of(0.0, Simulations { most: 99, only_for: None }, |_| 1e9);
        }
        let future = found.base.future.as_mut().expect("a cycle is held out");
        (future.all, found.steps) = (future.all + base_ahead, Vec::new());
        for single in &mut found.singles {
            single.gain = single.refitted.as_ref().map(|refitted| refitted.gain_over(&found.base, &data));
        }
        found.claimed = None;
        rounds(&data, &bars, &effort, found, &Silent);
        let steps: Vec<bool> = found.steps.iter().map(|step| step.is_claimed).collect();
        (steps, found.claimed.as_ref().map(|claimed| found.added(claimed).len()))
    };
    assert_eq!(claim(&mut found, 0.0, false), (vec![true, true], Some(2)));
    // A single whose p is large stands for nothing, and the pair for itself.
    assert_eq!(claim(&mut found, 0.0, true), (vec![false, true], Some(2)));
    // The base predicts better than either.
    let ahead = gain.future.expect("a cycle is held out") + 1.0;
    assert_eq!(claim(&mut found, ahead, true), (vec![false, false], None));
    // Nothing beside the failed single.
    found.pairs.clear();
    assert_eq!(claim(&mut found, 0.0, true), (vec![false], None));
}

/// Each effect of a claim is replaced by each other one, beside the rest of the claim.
#[test]
fn every_effect_of_a_claim_is_replaced() {
    let data = measured(&small(), &["force-bias", "tracking-drift"], &[BIAS, DRIFT_M_PER_S], 8);
    let found = found_beside(&data, &SLUGS);
    let pair = refitted(&data, &found, &["force-bias", "tracking-drift"]);
    let list = replacements(&data, &found, &pair);
    let named: Vec<(&str, Vec<&str>)> = list.iter().map(|(slug, model)| (*slug, found.added(model))).collect();
    assert_eq!(
        named,
        [
            ("force-asymmetry", vec!["tracking-drift", "force-asymmetry"]),
            ("force-asymmetry", vec!["force-bias", "force-asymmetry"]),
        ]
    );
    let single = found.single("tracking-drift").and_then(|single| single.refitted.clone()).expect("fits");
    let list = replacements(&data, &found, &single);
    let named: Vec<(&str, Vec<&str>)> = list.iter().map(|(slug, model)| (*slug, found.added(model))).collect();
    assert_eq!(named, [("force-asymmetry", vec!["force-asymmetry"]), ("force-bias", vec!["force-bias"])]);
}

/// Two effects of many σ are claimed, one a round; one is claimed alone; and the correct model is left alone (p ≤ 0.05 has a chance of one in twenty; the
/// seed is fixed).
#[test]
#[ignore = "thorough"]
fn a_search_adds_what_is_missing_and_no_more() {
    for (truth, values) in
        [(&[][..], &[][..]), (&["force-bias"], &[BIAS]), (&["force-bias", "tracking-drift"], &[BIAS, DRIFT_M_PER_S])]
    {
        let data = measured(&small(), truth, values, 9);
        let effort = Effort { n_simulations: 99, in_full: false, seed: 1 };
        let found = search(&data, &BARS, &effort, &Silent).expect("a search");
        let claimed = found.claimed.as_ref().map_or(Vec::new(), |claimed| found.added(claimed));
        assert_eq!(claimed, truth);
        assert_eq!(found.steps.iter().filter(|step| step.is_claimed).count(), truth.len());
        assert!(found.steps.iter().zip(0..).all(|(step, round)| !step.is_claimed || step.p <= BARS.p_of_round(round)));
        assert!(found.pairs.is_sorted_by(|a, b| a.1.rank >= b.1.rank));
        for (pair, _) in &found.pairs {
            let best = found
                .added(pair)
                .iter()
                .filter_map(|slug| found.single(slug)?.refitted.as_ref())
                .fold(f64::NEG_INFINITY, |best, single| best.max(single.fitted.objective));
            assert!(pair.fitted.objective >= best - 1e-6, "{:?}", pair.candidate.effects);
        }
    }
}
