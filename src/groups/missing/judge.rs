//! What a cohort gains by every effect, and what it would gain by chance.
//!
//! A simulated cohort takes of every record one of its simulated ones, the same for all effects. So few simulated records of each record make many cohorts.

use rayon::prelude::*;

use super::law::{Law, Place, Ratios};
use super::scan::{Scan, Shape};
use crate::critique::sketch::{Reading, Said};
use crate::inference::ensemble::RandomStream;
use crate::workflow::{Counter, Monitor};

/// Simulated cohorts.
pub const N_COHORTS: usize = 1_999;
/// Streams of the draws of simulated cohorts.
const COHORT_STREAMS: u64 = 0xc0_5075;

/// What a cohort gains by an effect.
#[derive(Debug, Clone, PartialEq)]
pub struct Gained {
    /// Place in the library.
    pub effect: usize,
    /// In log likelihood (nats) under the law that fits best.
    pub gain_nats: f64,
    /// p over the whole search.
    pub p_familywise: f64,
    /// The same of the last, held-out cycles under that law; `None` where no record has one.
    pub heldout_gain_nats: Option<f64>,
    /// The law.
    pub law: Law,
    /// Its place in the grid.
    pub place: Place,
    /// The shape at which it was found.
    pub shape: Shape,
    /// What each record gains under it (nats), in the records' order.
    pub of_records: Vec<f64>,
    /// What each gains by itself.
    pub by_itself: Vec<f64>,
}

/// The whole search.
pub struct Judged {
    /// Effects that some record can show, in the library's order.
    pub effects: Vec<Gained>,
    /// Largest gains of simulated cohorts, ascending.
    pub largest_by_chance: Vec<f64>,
}

impl Judged {
    /// The gain that 95 of 100 simulated cohorts stay below.
    pub fn threshold(&self) -> f64 {
        self.largest_by_chance.get(self.largest_by_chance.len() * 95 / 100).copied().unwrap_or(f64::INFINITY)
    }
}

/// Searches.
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
    for (_, _, own) in &found {
        largest.iter_mut().zip(&own.by_chance).for_each(|(largest, gain)| *largest = largest.max(*gain));
    }
    largest.sort_by(f64::total_cmp);
    let p = |gain: f64| {
        let reached = largest.len() - largest.partition_point(|own| *own < gain);
        (1 + reached) as f64 / (1 + largest.len()) as f64
    };
    let gained = |(effect, scan): &(usize, Scan)| {
        let own = found.iter().filter(|(of, ..)| of == effect);
        // Of equals the first.
        let (_, shape, best) = own.reduce(|best, other| if other.2.gain > best.2.gain { other } else { best })?;
        Some(Gained {
            effect: *effect,
            gain_nats: best.gain,
            p_familywise: p(best.gain),
            heldout_gain_nats: heldout(records, scan, *shape, best.place),
            law: scan.laws.law(best.place),
            place: best.place,
            shape: *shape,
            of_records: best.of_records.clone(),
            by_itself: records.iter().enumerate().map(|(k, record)| scan.own_gain(k, &record.fitted)).collect(),
        })
    };
    let effects = scans.iter().filter_map(gained).collect();
    Judged { effects, largest_by_chance: largest }
}

/// Which simulated record stands for each record in each simulated cohort.
fn picks(records: &[Said], seed: u64) -> Vec<Vec<usize>> {
    let cohort = |number: usize| {
        let mut stream = RandomStream::new(seed ^ COHORT_STREAMS, number as u64);
        records.iter().map(|record| stream.below(record.simulated.len().max(1))).collect()
    };
    let can = records.iter().all(|record| !record.simulated.is_empty());
    (0..if can { N_COHORTS } else { 0 }).map(cohort).collect()
}

/// One effect at one shape.
struct OfShape {
    gain: f64,
    place: Place,
    of_records: Vec<f64>,
    by_chance: Vec<f64>,
}

fn of_shape(records: &[Said], scan: &Scan, shape: Shape, picks: &[Vec<usize>]) -> OfShape {
    let ratios = |record: usize, readings: &[Reading]| scan.laws.ratios(&scan.nodes(record, readings, shape));
    let own: Vec<Ratios> = records.iter().enumerate().map(|(k, record)| ratios(k, &record.fitted)).collect();
    let own: Vec<&Ratios> = own.iter().collect();
    let (gain, place) = scan.laws.best(&own);
    let of_records = if gain > 0.0 { scan.laws.gains(&own, place) } else { vec![0.0; records.len()] };
    let by_chance: Vec<Vec<Ratios>> = records
        .par_iter()
        .enumerate()
        .map(|(k, record)| record.simulated.iter().map(|readings| ratios(k, readings)).collect())
        .collect();
    let cohort = |picks: &Vec<usize>| {
        let taken: Vec<&Ratios> = picks.iter().zip(&by_chance).map(|(pick, own)| &own[*pick]).collect();
        scan.laws.best(&taken).0
    };
    OfShape { gain, place, of_records, by_chance: picks.par_iter().map(cohort).collect() }
}

/// The gain in the log score of the last cycles, each given those before it in its record, under the law that the fitted cycles of all records led to:
/// ln[1 − π + π r(all)] − ln[1 − π + π r(fitted)], summed.
fn heldout(records: &[Said], scan: &Scan, shape: Shape, place: Place) -> Option<f64> {
    let of = |(k, record): (usize, &Said)| {
        let [before, after] = record.before_and_after.as_ref()?;
        let ln = |readings: &[Reading]| {
            let ratios = scan.laws.ratios(&scan.nodes(k, readings, shape));
            scan.laws.gains(&[&ratios], place)[0]
        };
        Some(ln(after) - ln(before))
    };
    let each: Vec<f64> = records.iter().enumerate().filter_map(of).collect();
    (!each.is_empty()).then(|| each.iter().sum())
}
