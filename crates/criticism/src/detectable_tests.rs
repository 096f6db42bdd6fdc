use super::*;
use crate::separation::distance;
use crate::separation::tests::{ONE_LEVEL, at, dense_distance, subject, subject_with};
use models::effects::Library;

const THRESHOLD: f64 = 4.0;

#[test]
fn the_smallest_size_is_just_seen_and_half_of_it_is_not() {
    let subject = subject(&ONE_LEVEL);
    let base = at(&subject, &[], &[]);
    let found = find_smallest_detectable(&subject, (&base.0, &base.1), THRESHOLD).expect("sizes");
    assert!(found.len() >= 10, "{found:?}");
    let mut n_checked = 0;
    for entry in &found {
        assert!(entry.visible_fraction >= 0.0 && entry.visible_fraction <= 1.0 + 1e-9, "{entry:?}");
        assert_eq!(entry.smallest.is_some(), entry.largest_distance >= THRESHOLD, "{entry:?}");
        let candidate = subject.extended(&[&entry.effect]).expect("an effect");
        let of_effect: Vec<_> = candidate.free.iter().filter(|free| free.effect.is_some()).collect();
        let Some(smallest) = entry.smallest.filter(|_| of_effect.len() == 1) else { continue };
        let null = of_effect[0].coordinate.value(of_effect[0].null.expect("a null"));
        let seen = |size: f64| {
            let truth = at(&subject, &[&entry.effect], &[size]);
            distance(&subject, &base.0, (&truth.0, &truth.1)).expect("a distance")
        };
        let whole = seen(smallest);
        assert!((0.999 * THRESHOLD..1.05 * THRESHOLD).contains(&whole), "{entry:?} {whole}");
        assert!(seen(null + 0.5 * (smallest - null)) < THRESHOLD, "{entry:?}");
        n_checked += 1;
    }
    assert!(n_checked >= 7, "{n_checked}");
}

/// The base has an effect that comes after the others in the library's order. The smallest sizes belong to the added effect, not to the base's.
#[test]
fn sizes_are_those_of_the_effect_that_a_base_with_effects_lacks() {
    let library = Library::only(&["clock-offset", "force-bias", "tracking-drift"]);
    let subject = subject_with(&ONE_LEVEL, &library, &["tracking-drift"]);
    let base = at(&subject, &[], &[1e-7]);
    let found = find_smallest_detectable(&subject, (&base.0, &base.1), THRESHOLD).expect("sizes");
    let slugs: Vec<&str> = found.iter().map(|entry| entry.effect.as_str()).collect();
    assert_eq!(slugs, ["clock-offset", "force-bias"]);
    for entry in &found {
        let smallest = entry.smallest.expect("a visible effect");
        // In the model's order the base's drift comes last.
        let truth = at(&subject, &[&entry.effect], &[smallest, 1e-7]);
        let whole = distance(&subject, &base.0, (&truth.0, &truth.1)).expect("a distance");
        assert!((0.999 * THRESHOLD..1.05 * THRESHOLD).contains(&whole), "{entry:?} {whole}");
    }
}

#[test]
fn a_linear_effect_is_seen_from_the_size_that_dense_algebra_gives() {
    let subject = subject(&ONE_LEVEL);
    let base = at(&subject, &[], &[]);
    let velocity = 1e-9;
    let unit: Vec<f64> = subject.experiment().record.time_s.iter().map(|t| velocity * t).collect();
    let expected = velocity * THRESHOLD / dense_distance(&subject, &base, &unit);
    let found = find_smallest_detectable(&subject, (&base.0, &base.1), THRESHOLD).expect("sizes");
    let drift = found.iter().find(|entry| entry.effect == "tracking-drift").expect("an effect of the library");
    let smallest = drift.smallest.expect("a visible effect");
    assert!((smallest.abs() / expected - 1.0).abs() < 0.02, "{smallest} against {expected}");
    assert!(!drift.is_blind_spot());
}
