//! Tests of the diagnosis of cohorts. Signature scores are drawn from normal distributions, without any gels or records.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::class::rivals;
use super::compare::{compare_groups, fine_laws};
use super::judge::{EffectGain, EffectSearch, search_effects};
use super::law::Nodes;
use super::likelihood::SizeLikelihood;
use criticism::criteria::Criteria;
use criticism::sketch::{EffectSignature, RecordScores, ScoreSet, SignatureScore};
use documents::groups::RatioVerdict;
use posterior::monitor::SilentMonitor;
use sampling::ensemble::RandomStream;

/// Invented effects: name, number of grid points of parameters that are unidentified at the null, and `true` if sizes may have either sign.
const EFFECTS: [(&str, usize, bool); 4] =
    [("one", 1, false), ("two", 3, false), ("three", 1, true), ("twin of one", 1, false)];
const N_READINGS: usize = 6;
/// Inverse of the standard deviation of an amplitude.
const NORM: f64 = 2.0;

/// Cosines between the signatures (whitened position changes) of all effects and grid points. Grid points of one effect have similar signatures. `twin` is
/// the cosine between the twin and the first effect.
fn cosines(twin: f64) -> DMatrix<f64> {
    DMatrix::from_fn(N_READINGS, N_READINGS, |i, j| match (i.min(j), i.max(j)) {
        (a, b) if a == b => 1.0,
        (1..=3, 1..=3) => 0.8,
        (0, 5) => twin,
        _ => 0.1 * (1.0 - twin),
    })
}

/// Draws signature scores (normal numbers, one per grid point of an effect). `shifts` are the mean scores of the first and the third effect. `root` is a
/// square root of the matrix `cosines`.
fn readings(
    root: &DMatrix<f64>,
    cosines: &DMatrix<f64>,
    shifts: [f64; 2],
    stream: &mut RandomStream,
) -> Vec<SignatureScore> {
    let white = nalgebra::DVector::from_fn(N_READINGS, |_, _| stream.normal());
    let z = root * white;
    let shifted = |k: usize| z[k] + shifts[0] * cosines[(0, k)] + shifts[1] * cosines[(4, k)];
    (0..N_READINGS).map(|k| SignatureScore { z: shifted(k), norm: NORM }).collect()
}

/// Names of the effects that the cohort cannot distinguish from a claimed effect.
fn class_of(records: &[RecordScores], gained: &[EffectGain], claimed: usize, seed: u64) -> Vec<String> {
    let rivals = rivals(records, &Criteria::COHORT, gained, claimed, seed).into_iter();
    rivals.filter(|rival| Criteria::COHORT.is_equivalent(rival)).map(|rival| rival.effect).collect()
}

/// Simulates a cohort whose records show the first and the third effect with the mean scores in `shifts`, with `n_simulations` simulated records each. The
/// last cycles have a third of the fitted cycles' information.
fn cohort(shifts: &[[f64; 2]], twin: f64, n_simulations: usize, seed: u64) -> Vec<RecordScores> {
    cohort_with(1.0 / 3.0, shifts, twin, n_simulations, seed)
}

/// Simulates a cohort whose last cycles have `last` times the information of the fitted cycles.
fn cohort_with(last: f64, shifts: &[[f64; 2]], twin: f64, n_simulations: usize, seed: u64) -> Vec<RecordScores> {
    let cosines = cosines(twin);
    let root = cosines.clone().cholesky().expect("positive definite").l();
    let mut first = 0;
    let asked: Vec<EffectSignature> = EFFECTS
        .iter()
        .map(|(slug, n, has_both)| {
            let readings = first..first + n;
            first += n;
            let reach = [if *has_both { 1e9 } else { 0.0 }, 1e9];
            let (unit, power, null) = (1.0, 1.0, 0.0);
            EffectSignature {
                slug,
                parameter: "x",
                refused: None,
                readings,
                unit,
                power,
                reach,
                null,
                is_downwards: false,
            }
        })
        .collect();
    let record = |(number, shifts): (usize, &[f64; 2])| {
        let mut stream = RandomStream::new(seed, number as u64);
        let mut told = |shifts: [f64; 2]| {
            let fitted = readings(&root, &cosines, shifts, &mut stream);
            let more = readings(&root, &cosines, shifts.map(|shift| shift * last.sqrt()), &mut stream);
            let all = fitted.iter().zip(&more).map(|(a, b)| SignatureScore {
                z: (a.z + b.z * last.sqrt()) / (1.0 + last).sqrt(),
                norm: a.norm * (1.0 + last).sqrt(),
            });
            let before_and_after = Some([fitted.clone(), all.collect()]);
            ScoreSet { fitted, fitted_and_all: before_and_after }
        };
        let score_set = told(*shifts);
        let simulated = (0..n_simulations).map(|_| told([0.0; 2])).collect();
        let whole = score_set.all().to_vec();
        RecordScores { effects: asked.clone(), told: score_set, whole, simulated, cosines: vec![cosines.clone(); 3] }
    };
    shifts.iter().enumerate().map(record).collect()
}

fn leading(judged: &EffectSearch) -> usize {
    let gain = |k: usize| judged.effects[k].best.gain_nats;
    (0..judged.effects.len()).max_by(|a, b| gain(*a).total_cmp(&gain(*b))).expect("effects")
}

/// In 60 cohorts of eight records without any effect, p of the largest gain is uniform. Its mean is 0.5 ± 0.037; the tolerance is five standard errors
/// (false failures below 1e-6). At most 19 values of p may be 0.1 or less, and at most 8 may be 0.02 or less. More occur with a binomial probability of
/// 2e-6 each.
#[test]
fn p_is_uniform_where_nothing_is_missing() {
    let p_of = |seed: u64| {
        let judged = search_effects(&cohort(&[[0.0; 2]; 8], 0.3, 60, 100 + seed), seed, &SilentMonitor);
        let least = judged.effects.iter().map(|effect| effect.p_familywise).fold(1.0, f64::min);
        (least, judged.effects[leading(&judged)].best.heldout_nats.expect("held out"))
    };
    let found: Vec<(f64, f64)> = (0..60).into_par_iter().map(p_of).collect();
    let mean = found.iter().map(|(p, _)| p).sum::<f64>() / 60.0;
    let at_most = |bar: f64| found.iter().filter(|(p, _)| *p <= bar).count();
    // Gains of exactly 0 have p = 1, which increases the mean slightly.
    assert!((mean - 0.5).abs() < 5.0 * 0.037 + 0.02, "{mean}");
    assert!(at_most(0.1) < 20 && at_most(0.02) < 9, "{} {}", at_most(0.1), at_most(0.02));
    assert!(found.iter().any(|(p, _)| *p < 0.3) && found.iter().any(|(p, _)| *p > 0.7));
    // An effect that fits by chance does not predict other cycles, so its held-out gain is negative.
    assert!(found.iter().map(|(_, heldout)| heldout).sum::<f64>() < 0.0);
}

/// Each of 20 records shows the effect at two standard deviations. The gain in log likelihood is half the sum of squares, 40 ± 9 nats, minus the cost of
/// the size law's parameters. A single record gains only 2 ± 2 nats, with which no search would claim an effect. Held-out cycles with a third of the
/// information gain a third. The diagnosis distinguishes the other effects.
///
/// The twin has a cosine of 0.99 with the first effect. The first effect is true, and leads by 1.1 ± 1.5 nats on the fitted and last cycles together. If
/// the twin were true, the twin would lead by 1.1 nats. A lead of 2 nats excludes the twin, which happens in one cohort of four. Fewer than 4 of 16
/// cohorts keep the twin in 1 of 10⁵ runs. The true effect is excluded in at most 2 of 100 cohorts, and in more than 5 of 16 cohorts in 5 of 10⁷ runs.
#[test]
fn weak_effects_add_up_and_twins_stay() {
    let (mut n_twins, mut n_true, mut heldout_nats) = (0, 0, 0.0);
    for seed in 0..16 {
        let said = cohort(&[[2.0, 0.0]; 20], 0.99, 60, 7 + seed);
        let judged = search_effects(&said, seed, &SilentMonitor);
        let best = leading(&judged);
        let effect_gain = &judged.effects[best];
        assert!(["one", "twin of one"].contains(&said[0].effects[effect_gain.effect].slug));
        assert!(
            (10.0..80.0).contains(&effect_gain.best.gain_nats) && effect_gain.p_familywise <= 0.001,
            "{effect_gain:?}"
        );
        heldout_nats += effect_gain.best.heldout_nats.expect("cycles are held out") / 16.0;
        let sum: f64 = effect_gain.of_records.iter().sum();
        assert!((sum - effect_gain.best.gain_nats).abs() < 1e-9);
        let slugs = class_of(&said, &judged.effects, best, seed);
        let is_true = said[0].effects[effect_gain.effect].slug == "one";
        let twin = if is_true { "twin of one" } else { "one" };
        assert!(slugs.iter().all(|slug| *slug == twin), "{slugs:?}");
        n_twins += slugs.len();
        n_true += usize::from(is_true || !slugs.is_empty());
    }
    assert!(n_twins >= 4 && n_true >= 11, "{n_twins} {n_true}");
    // The expected held-out gain is 13 ± 6 nats per cohort.
    assert!((heldout_nats - 13.0).abs() < 5.0 * 6.0 / 4.0, "{heldout_nats}");
}

/// Each of 20 records shows the effect at 0.7 standard deviations in its fitted cycles, and at 2.1 in all cycles. The mean score in the fitted cycles is
/// 0.7 ± 0.22, which alone gains 4.9 ± 3.1 nats. Chance gains 7.5 nats in one cohort of a thousand. The fitted cycles alone gain 7.5 nats with a
/// probability of 0.22, and in 7 or 8 of 8 cohorts in 2 of 10⁴ runs.
///
/// With the last cycles, all cohorts gain 7.5 nats, unless the mean score in the fitted cycles is negative or above 1.4. Such a mean score has a
/// probability below 0.005, and occurs in 3 of 8 cohorts in 1 of 10⁵ runs.
#[test]
fn last_cycles_count_for_p() {
    let is_rare = |said: &[RecordScores], seed: u64| {
        let judged = search_effects(said, seed, &SilentMonitor);
        judged.effects.iter().any(|effect| said[0].effects[effect.effect].slug == "one" && effect.p_familywise <= 0.001)
    };
    let (mut n_with, mut n_without) = (0, 0);
    for seed in 0..8 {
        let mut said = cohort_with(8.0, &[[0.7, 0.0]; 20], 0.3, 60, 300 + seed);
        n_with += usize::from(is_rare(&said, seed));
        for record in &mut said {
            std::iter::once(&mut record.told).chain(&mut record.simulated).for_each(|told| told.fitted_and_all = None);
        }
        n_without += usize::from(is_rare(&said, seed));
    }
    assert!(n_with >= 6 && n_without < 7, "{n_with} {n_without}");
}

/// The diagnosis does not distinguish two effects with equal signatures by how similar their sizes are across specimens. Here one effect has equal sizes
/// in all records. The sizes of the other effect differ by a factor of 16 between neighbouring records.
#[test]
fn like_sizes_are_no_proof() {
    let mut said = cohort(&[[4.0, 0.0]; 20], 0.999_999, 60, 57);
    for (k, record) in said.iter_mut().enumerate() {
        let norm = if k % 2 == 0 { 0.5 } else { 8.0 };
        let all = std::iter::once(&mut record.told).chain(&mut record.simulated);
        all.flat_map(ScoreSet::sets_mut).for_each(|readings| readings[0].norm = norm);
    }
    let judged = search_effects(&said, 3, &SilentMonitor);
    let best = leading(&judged);
    let slug = |k: usize| said[0].effects[judged.effects[k].effect].slug;
    assert_eq!(slug(best), "twin of one");
    let first = judged.effects.iter().find(|effect| said[0].effects[effect.effect].slug == "one").expect("searched");
    assert!(judged.effects[best].best.gain_nats > first.best.gain_nats + 5.0, "{first:?}");
    assert_eq!(class_of(&said, &judged.effects, best, 3), ["one"]);
}

/// Gains of records add up even if the effect's sign differs between records. The best size law then allows both signs.
#[test]
fn either_sign_is_found() {
    let shifts: Vec<[f64; 2]> = (0..20).map(|k| [0.0, if k % 2 == 0 { 2.5 } else { -2.5 }]).collect();
    let said = cohort(&shifts, 0.3, 60, 31);
    let judged = search_effects(&said, 1, &SilentMonitor);
    let effect_gain = &judged.effects[leading(&judged)];
    assert_eq!(said[0].effects[effect_gain.effect].slug, "three");
    assert!(effect_gain.p_familywise <= 0.001 && effect_gain.law.sides == super::law::Sides::Both, "{effect_gain:?}");
}

/// Ten records per group give the means and standard deviations of sizes. A factor of two between the sizes is declared as a difference; equal sizes are
/// not. A group without the effect gains 4 nats by chance in one of a hundred cohorts. This happens in four of ten cohorts in 2 of 10⁶ runs. The fraction
/// of specimens with the effect is not tested there, because sizes that no record can show may be in all records.
#[test]
fn groups_are_compared() {
    let mut stream = RandomStream::new(11, 0);
    let mut group = |mean: f64| -> Vec<SizeLikelihood> {
        let mut function = || {
            let z = mean + stream.normal();
            SizeLikelihood { height: 0.5 * z * z, z, norm: 1.0, unit: 1.0, power: 1.0, reach: [0.0, 1e9] }
        };
        (0..10).map(|_| function()).collect()
    };
    let (mut n_stated, mut n_false, mut n_loud) = (0, 0, 0);
    for _ in 0..10 {
        let groups = [group(6.0), group(3.0), group(3.0), group(0.0)];
        let laws = fine_laws(&groups.concat()).expect("they show something");
        let nodes: Vec<Vec<Nodes>> =
            groups.iter().map(|group| group.iter().map(|likelihood| laws.nodes(likelihood)).collect()).collect();
        let pair = |a: usize, b: usize| {
            let of = |k: usize| nodes[k].iter().collect::<Vec<_>>();
            compare_groups(&laws, &[of(a), of(b)], 0.2)
        };
        let twice = pair(0, 1);
        n_stated += usize::from(twice.ratios[0].1.verdict() == RatioVerdict::Greater);
        let [low, _, high] = twice.ratios[0].1.ratio;
        assert!(low < 3.2 && high > 1.3, "{low} {high}");
        n_false += usize::from(pair(1, 2).ratios[0].1.is_declared());
        let none = pair(0, 3);
        assert!(none.ratios[0].1.is_declared(), "{:?}", none.groups[1]);
        n_loud += usize::from(none.groups[1].gain_nats >= 4.0);
        assert!(none.groups[0].share[1] > 0.8, "{:?}", none.groups[0]);
    }
    assert!(n_stated >= 8 && n_false <= 1 && n_loud <= 3, "{n_stated} {n_false} {n_loud}");
}
