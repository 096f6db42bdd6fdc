//! Gain in log likelihood of a cohort by adding each effect, and the distribution of the largest gain that arises by chance.
//!
//! A simulated cohort replaces each measured record by a record that was simulated without any effect. A few simulated records of each measured
//! record can be combined to many cohorts. The searches for all effects use one list of combinations.

use rayon::prelude::*;

use super::law::SizeLaw;
use super::scan::{BestGain, EffectScan, RecordRatios, ShapeIndex};
use criticism::sketch::RecordScores;
use posterior::monitor::{Counter, Monitor};
use sampling::ensemble::RandomStream;

/// Number of simulated cohorts.
pub const N_COHORTS: usize = 1_999;
/// Constant that separates the random streams of the simulated cohorts from other streams.
const COHORT_STREAMS: u64 = 0xc0_5075;

/// Gain in log likelihood of a cohort by one effect, with the best-fitting size law and values of the effect's other parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectGain {
    /// Index of the effect in the library.
    pub effect: usize,
    /// Gains in log likelihood on the fitted and on the held-out cycles, with the best-fitting distribution of the effect's sizes over specimens
    /// (`law`).
    pub best: BestGain,
    /// Probability that a search of a simulated cohort without any effect gains at least as much. The gain is the sum over the fitted and the last
    /// cycles.
    pub p_familywise: f64,
    /// Best-fitting distribution of the effect's sizes over specimens.
    pub law: SizeLaw,
    /// Best-fitting grid point of the effect's parameters that are unidentified at its null (shape).
    pub shape: ShapeIndex,
    /// Gain in log likelihood (nats) of each record with the distribution of sizes in `law`, in the order of the records.
    pub of_records: Vec<f64>,
    /// Gain in log likelihood (nats) of each record if the effect has a separate size in each record.
    pub by_itself: Vec<f64>,
}

/// Result of the search over all effects.
pub struct EffectSearch {
    /// Effects that at least one record can show, in the order of the library.
    pub effects: Vec<EffectGain>,
    /// Largest gain (nats) over all effects in each simulated cohort without an effect, in ascending order. The gain is the sum over the fitted and
    /// the last cycles.
    pub largest_by_chance: Vec<f64>,
}

impl EffectSearch {
    /// Gain (nats) that only 5 of 100 simulated cohorts without an effect reach. The gain is the sum over the fitted and the last cycles.
    pub fn threshold(&self) -> f64 {
        self.largest_by_chance.get(self.largest_by_chance.len() * 95 / 100).copied().unwrap_or(f64::INFINITY)
    }
}

/// Computes the gain in log likelihood by each effect, and compares the gain with those in cohorts simulated without an effect.
pub fn search_effects(records: &[RecordScores], seed: u64, monitor: &dyn Monitor) -> EffectSearch {
    let n_effects = records.first().map_or(0, |record| record.effects.len());
    let scans: Vec<(usize, EffectScan)> =
        (0..n_effects).filter_map(|effect| Some((effect, EffectScan::new(records, effect)?))).collect();
    let jobs: Vec<(usize, &EffectScan, ShapeIndex)> =
        scans.iter().flat_map(|(effect, scan)| scan.shapes().map(move |shape| (*effect, scan, shape))).collect();
    let picks = picks(records, seed);
    let counter = Counter::new(monitor, jobs.len());
    let of_job = |(effect, scan, shape): &(usize, &EffectScan, ShapeIndex)| {
        let found = of_shape(records, scan, *shape, &picks);
        counter.add_one();
        (*effect, *shape, found)
    };
    let found: Vec<(usize, ShapeIndex, ShapeGains)> = jobs.par_iter().map(of_job).collect();
    let mut largest = vec![0.0_f64; picks.len()];
    for (effect, _) in &scans {
        let of_effect: Vec<&ShapeGains> =
            found.iter().filter(|(of, ..)| of == effect).map(|(.., of_shape)| of_shape).collect();
        for (cohort, largest) in largest.iter_mut().enumerate() {
            let best = of_effect.iter().map(|of_shape| of_shape.by_chance[cohort]).reduce(BestGain::larger);
            *largest = best.map_or(0.0, |best| best.rank_nats()).max(*largest);
        }
    }
    largest.sort_by(f64::total_cmp);
    let p = |rank: f64| {
        let reached = largest.len() - largest.partition_point(|value| *value < rank);
        (1 + reached) as f64 / (1 + largest.len()) as f64
    };
    let gained = |(effect, scan): &(usize, EffectScan)| {
        let filter = found.iter().filter(|(of, ..)| of == effect);
        // If several grid points have the largest gain, the first is chosen.
        let (_, shape, best) =
            filter.reduce(|one, other| if other.2.best.gain_nats > one.2.best.gain_nats { other } else { one })?;
        Some(EffectGain {
            effect: *effect,
            best: best.best,
            p_familywise: p(best.best.rank_nats()),
            law: scan.laws.law(best.best.place),
            shape: *shape,
            of_records: best.of_records.clone(),
            by_itself: records.iter().enumerate().map(|(k, record)| scan.own_gain(k, &record.told.fitted)).collect(),
        })
    };
    let effects = scans.iter().filter_map(gained).collect();
    EffectSearch { effects, largest_by_chance: largest }
}

/// Returns, for each simulated cohort, the index of the simulated record that replaces each measured record.
fn picks(records: &[RecordScores], seed: u64) -> Vec<Vec<usize>> {
    let cohort = |number: usize| {
        let mut stream = RandomStream::new(seed ^ COHORT_STREAMS, number as u64);
        records.iter().map(|record| stream.below(record.simulated.len().max(1))).collect()
    };
    let can = records.iter().all(|record| !record.simulated.is_empty());
    (0..if can { N_COHORTS } else { 0 }).map(cohort).collect()
}

/// Gains of one effect in the measured and the simulated cohorts, at one grid point of its parameters that are unidentified at the null.
struct ShapeGains {
    best: BestGain,
    of_records: Vec<f64>,
    by_chance: Vec<BestGain>,
}

fn of_shape(records: &[RecordScores], scan: &EffectScan, shape: ShapeIndex, picks: &[Vec<usize>]) -> ShapeGains {
    let ratios_of_records: Vec<RecordRatios> =
        records.iter().enumerate().map(|(k, record)| scan.record_ratios(k, &record.told, shape)).collect();
    let best = scan.best(&ratios_of_records.iter().collect::<Vec<_>>());
    let gain = |record_ratios: &RecordRatios| {
        if best.gain_nats > 0.0 { scan.laws.gain(&record_ratios.fitted, best.place) } else { 0.0 }
    };
    let of_records = ratios_of_records.iter().map(gain).collect();
    let by_chance: Vec<Vec<RecordRatios>> = records
        .par_iter()
        .enumerate()
        .map(|(k, record)| record.simulated.iter().map(|told| scan.record_ratios(k, told, shape)).collect())
        .collect();
    let cohort = |picks: &Vec<usize>| {
        let taken: Vec<&RecordRatios> = picks.iter().zip(&by_chance).map(|(pick, ratios)| &ratios[*pick]).collect();
        scan.best(&taken)
    };
    ShapeGains { best, of_records, by_chance: picks.par_iter().map(cohort).collect() }
}
