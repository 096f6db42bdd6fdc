//! Tests of the misfit rule: its false alarms under every kind of noise, and its power to find a misfit.

use rayon::prelude::*;

use super::*;
use crate::noise::NoiseModel;
use base::error::{InputPlace, Setting};
use sampling::ensemble::RandomStream;

const KNOWN_M: f64 = 4e-6;
const N_PER_CYCLE: usize = 200;

/// Record of four cycles with 20 rows per second, and predicted positions (m). The force is ±1, each for 5 s. The motion of half a millimetre follows the force with
/// some delay.
fn record() -> (Record, Vec<f64>) {
    let n = 4 * N_PER_CYCLE;
    let force_n: Vec<f64> = (0..n).map(|row| if row / 100 % 2 == 0 { 1.0 } else { -1.0 }).collect();
    let mut at_m = 0.0;
    let follow = |force: &f64| {
        at_m += 0.05 * (5e-4 * force - at_m);
        at_m
    };
    let position_m = force_n.iter().map(follow).collect();
    let record = Record {
        time_s: (0..n).map(|row| 0.05 * row as f64).collect(),
        force_n,
        position_m: vec![None; n],
        cycle: (0..n).map(|row| 1 + (row / N_PER_CYCLE) as u32).collect(),
        ..Record::default()
    };
    (record, position_m)
}

/// Kind of noise. `noise` holds the white noise (µm), the slow noise (µm), its correlation time (s), the gain and the offset (µm). `lost` is the fraction of lost rows,
/// and `off` the fraction of rows with an additional error of 12 standard deviations.
struct Kind {
    noise: [f64; 5],
    lost: f64,
    off: f64,
}

fn kind(noise: [f64; 5], lost: f64, off: f64) -> Kind {
    Kind { noise, lost, off }
}

/// Residuals (m) of pure noise at every row; `None` at lost rows.
fn left_of(kind: &Kind, record: &Record, position_m: &[f64], seed: u64) -> Vec<Option<f64>> {
    use rand::SeedableRng;
    let model = NoiseModel::named(&["white", "ou", "gain"].map(String::from), &InputPlace::setting(Setting::Noise))
        .expect("named");
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let noise_m = model.simulate_m(&record.time_s, &record.cycle, position_m, &kind.noise, &mut rng);
    let mut stream = RandomStream::new(77, seed);
    let size_m = 1e-6 * kind.noise[0].hypot(kind.noise[1]);
    let mut of_row = |noise_m: f64| {
        let off_m =
            if stream.unit() < kind.off { 12.0 * size_m * if stream.unit() < 0.5 { -1.0 } else { 1.0 } } else { 0.0 };
        (stream.unit() >= kind.lost).then_some(noise_m + off_m)
    };
    noise_m.into_iter().map(&mut of_row).collect()
}

fn misfit(record: &Record, position_m: &[f64], left_m: &[Option<f64>], is_known: bool, has_gain: bool) -> Misfit {
    let noise_m = if is_known { KNOWN_M } else { 1e-6 };
    let gains = if has_gain { GainKnowledge::Learnt } else { GainKnowledge::None };
    with_split(record, position_m, left_m, gains, |remainder| Misfit::of(remainder, noise_m, is_known))
}

/// Misfit of residuals whose last cycle is held out.
fn with_split(
    record: &Record,
    position_m: &[f64],
    left_m: &[Option<f64>],
    gains: GainKnowledge,
    judge: impl Fn(&Residuals) -> Option<Misfit>,
) -> Misfit {
    let split = |is_wanted: &dyn Fn(u32) -> bool| -> Vec<Option<f64>> {
        left_m.iter().zip(&record.cycle).map(|(left, cycle)| left.filter(|_| is_wanted(*cycle))).collect()
    };
    let (fitted_m, heldout_m) = (split(&|cycle| cycle < 4), split(&|cycle| cycle == 4));
    let (fitted_m, heldout_m) = (&fitted_m[..], &heldout_m[..]);
    judge(&Residuals { record, fitted_m, heldout_m, position_m, absorbed_m: &[], gains }).expect("positions")
}

/// Counts false alarms in records of pure noise. Two tests check the misfit's size and one its recurrence; each gives a false alarm in one or two of a thousand
/// records. In 250 records of one kind of noise, 0.9 alarms are expected. For slow noise with a correlation time of ten seconds, which has few independent values, 1.3
/// are expected. The probability of 10 or more alarms is below 1e-5 (Poisson). If the noise is unknown, the reference noise is 1 µm, as short lags estimate it for slow
/// noise.
#[test]
fn noise_of_every_kind_is_noise() {
    let (record, position_m) = record();
    let ar = |sd: f64, time_s: f64| [0.01, sd, time_s, 1e-6, 1e-6];
    let plain = [4.0, 0.01, 1.0, 1e-6, 1e-6];
    let kinds = [
        ("white", kind(plain, 0.0, 0.0), true),
        ("white, not given", kind(plain, 0.0, 0.0), false),
        ("slow beside white, 0.5 s", kind([4.0, 4.0, 0.5, 1e-6, 1e-6], 0.0, 0.0), true),
        ("slow beside white, 2 s", kind([4.0, 4.0, 2.0, 1e-6, 1e-6], 0.0, 0.0), true),
        ("gain", kind([4.0, 0.01, 1.0, 0.01, 1e-6], 0.0, 0.0), true),
        ("gain, not given", kind([4.0, 0.01, 1.0, 0.01, 1e-6], 0.0, 0.0), false),
        ("lost rows", kind(plain, 0.1, 0.0), true),
        ("AR(1), 0.1 s", kind(ar(6.0, 0.1), 0.0, 0.0), false),
        ("AR(1), 0.5 s", kind(ar(6.0, 0.5), 0.0, 0.0), false),
        ("AR(1), 3 s", kind(ar(6.0, 3.0), 0.0, 0.0), false),
        ("AR(1), 10 s", kind(ar(6.0, 10.0), 0.0, 0.0), false),
        ("AR(1) with outliers", kind(ar(3.0, 0.5), 0.0, 0.01), false),
    ];
    for (number, (name, kind, is_known)) in kinds.iter().enumerate() {
        let is_alarm = |seed: &u64| {
            let left_m = left_of(kind, &record, &position_m, 10_000 * number as u64 + seed);
            misfit(&record, &position_m, &left_m, *is_known, true).is_too_large()
        };
        let alarms = (0..250_u64).into_par_iter().filter(is_alarm).count();
        println!("{name}: {alarms} of 250");
        assert!(alarms < 10, "{name}: {alarms}");
    }
}

/// A recurring misfit of 6 µm is found in all of 100 records with 4 µm of noise, which is known or unknown. The total residual is 7.2 µm. A drift of 5 µm over the
/// record is not reported, because slow noise could cause it. A misfit of five times the noise is found, even if it does not recur.
#[test]
fn what_comes_again_is_no_noise() {
    let (record, position_m) = record();
    let white = kind([4.0, 0.01, 1.0, 1e-6, 1e-6], 0.0, 0.0);
    let with = |shape_m: &(dyn Fn(f64) -> f64 + Sync), is_known: bool| {
        let is_found = |seed: &u64| {
            let mut left_m = left_of(&white, &record, &position_m, *seed);
            left_m.iter_mut().zip(&record.time_s).for_each(|(left, t)| *left = left.map(|left| left + shape_m(*t)));
            misfit(&record, &position_m, &left_m, is_known, true).is_too_large()
        };
        (0..100_u64).into_par_iter().filter(is_found).count()
    };
    // This misfit has a root mean square of 6 µm.
    let again = |t: f64| {
        let phase = std::f64::consts::TAU * t / 10.0;
        6e-6 * ((2.0 * phase).sin() + (3.0 * phase + 0.4).cos())
    };
    assert_eq!((with(&again, true), with(&again, false)), (100, 100));
    let drift = |size_m: f64| move |t: f64| size_m * 12f64.sqrt() * (t / 40.0 - 0.5);
    assert_eq!(with(&drift(5e-6), false), 0);
    assert_eq!(with(&|t: f64| 2e-5 * 2f64.sqrt() * (0.31 * t * t / 10.0).sin(), true), 100);
}

/// White errors of 1.7 times the known noise are too large in all of 100 records, and errors of 1.3 times the noise in none. The root mean square of 600 errors has a
/// standard deviation of 3 %. The limit of 1.5 is thus four to five standard deviations away.
#[test]
fn white_errors_are_held_to_the_factor() {
    let (record, position_m) = record();
    let share = |factor: f64| {
        let white = kind([4.0 * factor, 0.01, 1.0, 1e-6, 1e-6], 0.0, 0.0);
        let is_found = |seed: &u64| {
            let left_m = left_of(&white, &record, &position_m, 500 + seed);
            misfit(&record, &position_m, &left_m, true, false).fitted.is_too_large
        };
        (0..100_u64).into_par_iter().filter(is_found).count()
    };
    assert!(share(1.7) >= 99 && share(1.3) == 0, "{} {}", share(1.7), share(1.3));
}

/// Residuals that the parameters can absorb do not count as recurring, nor do residuals of cycles with different commands.
#[test]
fn what_parameters_can_make_and_other_commands_do_not_count() {
    let (mut record, position_m) = record();
    let shape: Vec<f64> = record.time_s.iter().map(|t| 1e-5 * (1.3 * t.rem_euclid(10.0)).sin()).collect();
    let white = kind([4.0, 0.01, 1.0, 1e-6, 1e-6], 0.0, 0.0);
    let left_m: Vec<Option<f64>> = left_of(&white, &record, &position_m, 3)
        .iter()
        .zip(&shape)
        .map(|(left, s)| left.map(|left| left + s))
        .collect();
    let found = |record: &Record, absorbed_m: &[Vec<f64>]| {
        let none = vec![None; left_m.len()];
        let remainder = Residuals {
            record,
            fitted_m: &left_m,
            heldout_m: &none,
            position_m: &position_m,
            absorbed_m,
            gains: GainKnowledge::Learnt,
        };
        Misfit::of(&remainder, 1e-6, false).expect("positions").returning_m
    };
    let returning_m = found(&record, &[]).expect("it comes again");
    // The test removes at most half of the misfit's energy as an offset, a slope or a multiple of the motion.
    assert!(returning_m > 4e-6 && returning_m < 1e-5, "{returning_m}");
    assert_eq!(found(&record, &[shape]), None);
    record.force_n.iter_mut().zip(&record.cycle).for_each(|(force, cycle)| *force *= f64::from(*cycle));
    assert_eq!(found(&record, &[]), None);
}

#[test]
fn directions_are_those_in_which_draws_spread() {
    let mean_m = vec![1.0, 2.0, 3.0];
    let draws = [[2.0, 2.0, 3.0], [1.0, 5.0, 3.0], [0.0, -1.0, 3.0]].map(|draw| draw.to_vec());
    let directions = directions_of_spread(&draws, &mean_m, 5);
    assert_eq!(directions.len(), 2);
    assert!(directions.iter().all(|direction| direction[2] == 0.0 && (dot(direction, direction) - 1.0).abs() < 1e-12));
}

/// Held-out residuals of five times the fitted residuals are too large in all of 100 records, although they do not recur. This holds for estimated and for unknown
/// noise. The residuals of the fitted cycles are not called too large.
#[test]
fn noise_is_as_large_in_held_out_cycles_as_in_fitted_ones() {
    let (record, position_m) = record();
    let white = kind([4.0, 0.01, 1.0, 1e-6, 1e-6], 0.0, 0.0);
    let is_found = |seed: &u64| {
        let mut left_m = left_of(&white, &record, &position_m, 700 + seed);
        let held_out = left_m.iter_mut().zip(&record.cycle).filter(|(_, cycle)| **cycle == 4);
        held_out.for_each(|(left, _)| *left = left.map(|left| left + 2e-5));
        let estimated = misfit(&record, &position_m, &left_m, false, false);
        let unknown = with_split(&record, &position_m, &left_m, GainKnowledge::None, Misfit::relative_to_fitted);
        [estimated, unknown]
            .iter()
            .all(|misfit| misfit.heldout.is_some_and(|size| size.is_too_large) && !misfit.fitted.is_too_large)
    };
    assert_eq!((0..100_u64).into_par_iter().filter(is_found).count(), 100);
}

/// The held-out cycle has a gain of 3 % and an offset, with 4 µm of known noise. Gain and offset are a misfit if the fitted cycles have none. They are noise if the
/// fitted cycles have equally large gains and offsets, or if the model declares them. With gains of 3 % in all cycles, the test gives a false alarm in one record of a
/// thousand.
#[test]
fn a_held_out_gain_needs_fitted_ones() {
    let (record, position_m) = record();
    let white = [4.0, 0.01, 1.0, 1e-6, 1e-6];
    let found = |noise: [f64; 5], heldout_gain: f64, gains: GainKnowledge, seed: u64| {
        let left_m = left_of(&kind(noise, 0.0, 0.0), &record, &position_m, 900 + seed);
        let function = |(row, left): (usize, &Option<f64>)| left.map(|left| left + heldout_gain * position_m[row]);
        let part = |is_wanted: &dyn Fn(u32) -> bool| -> Vec<Option<f64>> {
            let all = left_m.iter().enumerate().zip(&record.cycle);
            all.map(|(own_row, cycle)| function(own_row).filter(|_| is_wanted(*cycle))).collect()
        };
        let mut fitted_m = part(&|cycle| cycle < 4);
        fitted_m
            .iter_mut()
            .enumerate()
            .for_each(|(row, left)| *left = left.map(|left| left - heldout_gain * position_m[row]));
        let remainder = Residuals {
            record: &record,
            fitted_m: &fitted_m,
            heldout_m: &part(&|cycle| cycle == 4),
            position_m: &position_m,
            absorbed_m: &[],
            gains,
        };
        Misfit::of(&remainder, KNOWN_M, true).expect("positions").heldout.is_some_and(|size| size.is_too_large)
    };
    let count = |noise: [f64; 5], gain: f64, gains: GainKnowledge| {
        (0..100_u64).into_par_iter().filter(|seed| found(noise, gain, gains, *seed)).count()
    };
    let with_gains = [4.0, 0.01, 1.0, 0.03, 1e-6];
    assert_eq!(count(white, 0.15, GainKnowledge::Learnt), 100);
    assert_eq!(count(white, 0.15, GainKnowledge::Declared), 0);
    // In 100 records, 0.1 false alarms are expected. The probability of 4 or more is below 1e-5.
    assert!(count(with_gains, 0.0, GainKnowledge::Learnt) < 4);
}

/// Gains that grow by 4 % from cycle to cycle, and a gain of 200 %, are no noise, whether the model declares gains or learns them. Independent gains of 4 % are. In 100 records of
/// independent gains, 0.1 false alarms are expected; the probability of 4 or more is below 1e-5.
#[test]
fn gains_that_grow_steadily_or_are_large_are_a_misfit() {
    let (record, position_m) = record();
    let found = |seed: u64, gain_of: &dyn Fn(u32) -> f64, sd: f64, gains: GainKnowledge, is_known: bool| {
        let left_m = left_of(&kind([4.0, 0.01, 1.0, sd, 1e-6], 0.0, 0.0), &record, &position_m, 7_000 + seed);
        let rows = left_m.iter().zip(&position_m).zip(&record.cycle);
        let left_m: Vec<Option<f64>> =
            rows.map(|((left, x), cycle)| left.map(|left| left + gain_of(*cycle) * x)).collect();
        with_split(&record, &position_m, &left_m, gains, |remainder| Misfit::of(remainder, KNOWN_M, is_known))
    };
    // Slow residuals of unknown noise are no misfit by their size alone.
    let growing = found(0, &|cycle| 0.04 * f64::from(cycle), 1e-6, GainKnowledge::Learnt, false);
    assert!(growing.is_too_large(), "{growing:?}");
    for gains in [GainKnowledge::Learnt, GainKnowledge::Declared] {
        for seed in 0..20 {
            let growing = found(seed, &|cycle| 0.04 * f64::from(cycle), 1e-6, gains, true);
            let Some(ImplausibleGains::Steady(change)) = growing.implausible_gains else { panic!("{growing:?}") };
            assert!((change - 0.04).abs() < 0.004 && growing.is_too_large(), "{growing:?}");
            let large = found(seed, &|cycle| if cycle == 2 { 2.0 } else { 0.0 }, 1e-6, gains, true);
            assert!(matches!(large.implausible_gains, Some(ImplausibleGains::Large(gain)) if (gain - 2.0).abs() < 0.1));
            assert!(large.is_too_large(), "{large:?}");
        }
    }
    let independent = (0..100).filter(|seed| {
        let found = found(*seed, &|_| 0.0, 0.04, GainKnowledge::Declared, true);
        found.implausible_gains.is_some() || found.is_too_large()
    });
    assert!(independent.count() < 4);
}

/// All rows belong to one continuous hold. The held-out rows then have the gain and the offset of the fitted rows, even if the model declares gains. A growing misfit
/// is therefore not removed.
#[test]
fn a_cycle_within_an_unbroken_hold_has_no_gain_of_its_own() {
    let (mut record, _) = record();
    record.force_n.fill(1.0);
    let position_m: Vec<f64> = record.time_s.iter().map(|t| 1e-4 * t).collect();
    let white = kind([4.0, 0.01, 1.0, 1e-6, 1e-6], 0.0, 0.0);
    let mut left_m = left_of(&white, &record, &position_m, 40);
    let held_out = left_m.iter_mut().zip(&record.cycle).filter(|(_, cycle)| **cycle == 4);
    held_out.for_each(|(left, _)| *left = left.map(|left| left + 2e-5));
    let found = misfit(&record, &position_m, &left_m, true, true);
    assert!(found.heldout.is_some_and(|size| size.is_too_large && size.rms_m > 1.5e-5), "{found:?}");
}
