//! Tests the verdicts on artificial ranks: uniform ranks, ranks with known faults, and too few ranks.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use documents::calibration::Simulator;
use documents::posterior::ModelSummary;

fn subject() -> CalibrationSubject {
    CalibrationSubject {
        experiment: "eye".into(),
        model: ModelSummary { base: "lethersich".into(), effects: Vec::new(), noise: vec!["white".into()] },
        parameters: vec!["young_modulus_pa".into(), "noise_sd_um".into()],
        simulated_by: Simulator::FullFiniteElements,
    }
}

/// Replicates with uniform ranks. The ranks of the first parameter are changed by the function `change`.
fn replicates(n: usize, change: impl Fn(usize) -> usize) -> Vec<Replicate> {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let one = |number: usize| {
        let mut rank = || rng.random_range(0..=N_DRAWS);
        let ranks = vec![change(rank()), rank(), rank()];
        let ranked = Some(Ranked { ranks, z: vec![0.5, -0.5], converged: true });
        Replicate { number, truth: vec![1.0, 2.0], redrawn: number % 2, ranked, failure: None }
    };
    (0..n).map(one).collect()
}

/// Uniform ranks pass for 99 seeds in 100. For faulty ranks, the verdict names the parameter and its fault. For 200 halved ranks the expected place is −12
/// standard errors. For ranks shifted to both ends the spread exceeds 8.
#[test]
fn verdicts_are_those_of_the_ranks() {
    let right = judge(&subject(), &replicates(200, |rank| rank));
    assert_eq!((right.verdict.kind, right.redrawn), (CalibrationKind::Calibrated, 100));
    assert!(right.verdict.sentence.contains("as often as stated, over 200 simulated records"));
    assert_eq!(right.quantities.iter().map(|quantity| quantity.counts.len()).collect::<Vec<_>>(), [20, 20, 20]);
    assert_eq!((right.quantities[0].z_mean, right.quantities[2].z_mean), (Some(0.5), None));
    let high = judge(&subject(), &replicates(200, |rank| rank / 2));
    assert_eq!(high.verdict.kind, CalibrationKind::Miscalibrated);
    assert!(high.verdict.sentence.contains("young_modulus_pa is too high"), "{}", high.verdict.sentence);
    assert!(!high.verdict.sentence.contains("noise_sd_um"));
    let ends = |rank: usize| if rank < 50 { rank / 3 } else { N_DRAWS - (N_DRAWS - rank) / 3 };
    let narrow = judge(&subject(), &replicates(200, ends));
    assert!(narrow.verdict.sentence.contains("young_modulus_pa is too narrow"), "{}", narrow.verdict.sentence);
    assert!(narrow.quantities[0].coverage_90.share < Some(0.8));
}

/// Replicates that did not converge are counted and excluded. If too few others remain, there is no verdict.
#[test]
fn what_cannot_be_counted_is_said() {
    let mut all = replicates(60, |rank| rank);
    for replicate in all.iter_mut().take(30) {
        replicate.ranked =
            replicate.ranked.take().map(|ranked| Ranked { ranks: vec![0, 0, 0], converged: false, ..ranked });
    }
    all[40] = Replicate { ranked: None, failure: Some("no".into()), ..all[40].clone() };
    let found = judge(&subject(), &all);
    assert_eq!((found.replicates, found.ranked, found.not_converged, found.failed), (60, 29, 30, 1));
    assert_eq!((found.verdict.kind, found.quantities[0].counts.len()), (CalibrationKind::Calibrated, 5));
    assert!(found.verdict.sentence.contains("30 of 60 did not converge and are not counted, 1 of 60 could not be"));
    all.reverse();
    assert_eq!(judge(&subject(), &all), found, "the order of replicates shows");
    let few = judge(&subject(), &all[..30]);
    assert!(few.ranked >= FEWEST && few.verdict.kind != CalibrationKind::Undecided);
    let fewer = judge(&subject(), &all[..19]);
    assert_eq!((fewer.verdict.kind, fewer.quantities[0].p_holm), (CalibrationKind::Undecided, None));
    assert_eq!(judge(&subject(), &[]).verdict.kind, CalibrationKind::Undecided);
}
