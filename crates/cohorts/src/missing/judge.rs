//! Gain of a cohort by every effect, and its distribution by chance.
//!
//! A simulated cohort takes one simulated record for each record, the same for all effects. A few simulated records of each record therefore make many cohorts.

use rayon::prelude::*;

use super::law::Law;
use super::scan::{Best, Scan, Shape, Weighed};
use criticism::sketch::Said;
use posterior::monitor::{Counter, Monitor};
use sampling::ensemble::RandomStream;

/// Number of simulated cohorts.
pub const N_COHORTS: usize = 1_999;
/// Random streams that draw the simulated cohorts.
const COHORT_STREAMS: u64 = 0xc0_5075;

/// Gain of a cohort by one effect.
#[derive(Debug, Clone, PartialEq)]
pub struct Gained {
    /// Index in the library.
    pub effect: usize,
    /// Gains under the law with the best fit.
    pub best: Best,
    /// p of its rank over the whole search.
    pub p_familywise: f64,
    /// Law with the best fit.
    pub law: Law,
    /// Shape with the best fit.
    pub shape: Shape,
    /// Gain of each record under this law (nats), in the records' order.
    pub of_records: Vec<f64>,
    /// Gain of each record with its own size.
    pub by_itself: Vec<f64>,
}

/// Results of the whole search.
pub struct Judged {
    /// Effects that some record can show, in the library's order.
    pub effects: Vec<Gained>,
    /// Largest ranks of simulated cohorts (nats), ascending.
    pub largest_by_chance: Vec<f64>,
}

impl Judged {
    /// Rank that 95 of 100 simulated cohorts do not reach.
    pub fn threshold(&self) -> f64 {
        self.largest_by_chance.get(self.largest_by_chance.len() * 95 / 100).copied().unwrap_or(f64::INFINITY)
    }
}

/// Searches all effects and compares their gains with simulated cohorts.
pub fn judge(records: &[Said], seed: u64, monitor: &dyn Monitor) -> Judged {
    let n_effects = records.first().map_or(0, |record| record.effects.len());
    let scans: Vec<(usize, Scan)> =
        (0..n_effects).filter_map(|effect| Some((effect, Scan::new(records, effect)?))).collect();
    let jobs: Vec<(usize, &Scan, Shape)> =
        scans.iter().flat_map(|(effect, scan)| scan.shapes().map(move |shape| (*effect, scan, shape))).collect();
    let picks = picks(records, seed);
    let counter = Counter::new(monitor, jobs.len());
    let of_job = |(effect, scan, shape): &(usize, &Scan, Shape)| {
        let found = of_shape(records, scan, *shape, &picks);
        counter.add_one();
        (*effect, *shape, found)
    };
    let found: Vec<(usize, Shape, OfShape)> = jobs.par_iter().map(of_job).collect();
    let mut largest = vec![0.0_f64; picks.len()];
    for (effect, _) in &scans {
        let of_effect: Vec<&OfShape> = found.iter().filter(|(of, ..)| of == effect).map(|(.., own)| own).collect();
        for (cohort, largest) in largest.iter_mut().enumerate() {
            let best = of_effect.iter().map(|own| own.by_chance[cohort]).reduce(Best::larger);
            *largest = best.map_or(0.0, |best| best.rank_nats()).max(*largest);
        }
    }
    largest.sort_by(f64::total_cmp);
    let p = |rank: f64| {
        let reached = largest.len() - largest.partition_point(|own| *own < rank);
        (1 + reached) as f64 / (1 + largest.len()) as f64
    };
    let gained = |(effect, scan): &(usize, Scan)| {
        let own = found.iter().filter(|(of, ..)| of == effect);
        // The first of equal shapes wins.
        let (_, shape, best) =
            own.reduce(|one, other| if other.2.best.gain_nats > one.2.best.gain_nats { other } else { one })?;
        Some(Gained {
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
    Judged { effects, largest_by_chance: largest }
}

/// Index of the simulated record that replaces each record in each simulated cohort.
fn picks(records: &[Said], seed: u64) -> Vec<Vec<usize>> {
    let cohort = |number: usize| {
        let mut stream = RandomStream::new(seed ^ COHORT_STREAMS, number as u64);
        records.iter().map(|record| stream.below(record.simulated.len().max(1))).collect()
    };
    let can = records.iter().all(|record| !record.simulated.is_empty());
    (0..if can { N_COHORTS } else { 0 }).map(cohort).collect()
}

/// Results of one effect at one shape.
struct OfShape {
    best: Best,
    of_records: Vec<f64>,
    by_chance: Vec<Best>,
}

fn of_shape(records: &[Said], scan: &Scan, shape: Shape, picks: &[Vec<usize>]) -> OfShape {
    let own: Vec<Weighed> =
        records.iter().enumerate().map(|(k, record)| scan.weighed(k, &record.told, shape)).collect();
    let best = scan.best(&own.iter().collect::<Vec<_>>());
    let gain = |own: &Weighed| if best.gain_nats > 0.0 { scan.laws.gain(&own.fitted, best.place) } else { 0.0 };
    let of_records = own.iter().map(gain).collect();
    let by_chance: Vec<Vec<Weighed>> = records
        .par_iter()
        .enumerate()
        .map(|(k, record)| record.simulated.iter().map(|told| scan.weighed(k, told, shape)).collect())
        .collect();
    let cohort = |picks: &Vec<usize>| {
        let taken: Vec<&Weighed> = picks.iter().zip(&by_chance).map(|(pick, own)| &own[*pick]).collect();
        scan.best(&taken)
    };
    OfShape { best, of_records, by_chance: picks.par_iter().map(cohort).collect() }
}
