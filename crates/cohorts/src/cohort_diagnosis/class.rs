//! Rivals of a cohort's claim.
//!
//! A rival is assumed to be true, and cohorts are simulated with it. In them, each record has the rival with a probability and a size from its law and the record's own
//! data. The noise is that of a simulated record. The rival may be the truth if the claim leads it in these cohorts as often as in the data (Cox, J. R. Stat. Soc. B
//! 24:406, 1962).
//!
//! The lead is tested twice: under the common laws of sizes, and with a separate size in every record. Both leads must be too large for chance. Two effects with the same
//! signature differ only in the similarity of their sizes across specimens, and nothing is known about that beforehand.

use rayon::prelude::*;

use super::judge::EffectGain;
use super::scan::{BestGain, EffectScan, RecordRatios};
use criticism::criteria::Criteria;
use criticism::sketch::{RecordScores, ScoreSet};
use criticism::verdict::Rival;
use sampling::ensemble::RandomStream;

/// Number of simulated cohorts for each rival.
const N_COHORTS: usize = 199;
const RIVAL_STREAMS: u64 = 0xc1a55;

/// Effects that the data may not distinguish from the claim. Each comes with the share of simulated cohorts in which the claim leads it by as much.
pub fn rivals(
    records: &[RecordScores],
    criteria: &Criteria,
    gained: &[EffectGain],
    claimed: usize,
    seed: u64,
) -> Vec<Rival> {
    let claim = &gained[claimed];
    let least = criteria.least_rival_share * claim.best.rank_nats();
    let others: Vec<&EffectGain> = gained
        .iter()
        .filter(|effect_gain| effect_gain.effect != claim.effect && effect_gain.best.rank_nats() > least)
        .collect();
    let rival = |effect_gain: &EffectGain| {
        Some(Rival {
            effect: records[0].effects[effect_gain.effect].slug.into(),
            deficit_nats: claim.best.rank_nats() - effect_gain.best.rank_nats(),
            separation_sigma: None,
            lead_p: Some(lead_p(records, claim, effect_gain, seed)?),
        })
    };
    others.into_par_iter().filter_map(rival).collect()
}

/// Share of cohorts simulated with the rival in which the claim leads by as much. It is the larger of two shares: under common laws, and record by record.
fn lead_p(records: &[RecordScores], claim: &EffectGain, rival: &EffectGain, seed: u64) -> Option<f64> {
    let (of_claim, of_rival) = (EffectScan::new(records, claim.effect)?, EffectScan::new(records, rival.effect)?);
    let by_itself = |scan: &EffectScan, cohort: &[&ScoreSet]| -> f64 {
        cohort.iter().enumerate().map(|(k, told)| scan.own_gain(k, told.all())).sum()
    };
    let lead_by_itself = |cohort: &[&ScoreSet]| by_itself(&of_claim, cohort) - by_itself(&of_rival, cohort);
    let measured: Vec<&ScoreSet> = records.iter().map(|record| &record.told).collect();
    let leads = [claim.best.rank_nats() - rival.best.rank_nats(), lead_by_itself(&measured)];
    if leads.iter().any(|lead| *lead <= 0.0) {
        return Some(1.0);
    }
    let carriers: Vec<RivalSimulator> =
        (0..records.len()).map(|k| RivalSimulator::of(&records[k], &of_rival, rival, k)).collect();
    let simulated_leads = |number: usize| {
        let mut stream = RandomStream::new(seed ^ RIVAL_STREAMS ^ ((rival.effect as u64) << 32), number as u64);
        let cohort: Vec<ScoreSet> =
            records.iter().zip(&carriers).map(|(record, carrier)| carrier.draw(record, &mut stream)).collect();
        let cohort: Vec<&ScoreSet> = cohort.iter().collect();
        [rank_nats(&of_claim, &cohort) - rank_nats(&of_rival, &cohort), lead_by_itself(&cohort)]
    };
    let simulated: Vec<[f64; 2]> = (0..N_COHORTS).into_par_iter().map(simulated_leads).collect();
    let p = |which: usize| {
        let reached = simulated.iter().filter(|values| values[which] >= leads[which]).count();
        (1 + reached) as f64 / (1 + N_COHORTS) as f64
    };
    Some(p(0).max(p(1)))
}

/// Gain of a cohort (nats) on fitted and last cycles together, at the shape and law with the best fit to the fitted cycles.
fn rank_nats(scan: &EffectScan, cohort: &[&ScoreSet]) -> f64 {
    let of = |shape| {
        let weighed: Vec<RecordRatios> =
            cohort.iter().enumerate().map(|(k, told)| scan.record_ratios(k, told, shape)).collect();
        scan.best(&weighed.iter().collect::<Vec<_>>())
    };
    scan.shapes().map(of).reduce(BestGain::larger).map_or(0.0, |best| best.rank_nats())
}

/// Probability that a record has the rival, with its possible grid points and sizes.
struct RivalSimulator {
    has: f64,
    /// Index of the signature score, its amplitude in units of its size, and the probability of both.
    ways: Vec<(usize, f64, f64)>,
}

impl RivalSimulator {
    fn of(record: &RecordScores, scan: &EffectScan, rival: &EffectGain, place: usize) -> Self {
        let asked = scan.request(place);
        let points: Vec<usize> = match rival.shape {
            Some(point) => vec![point],
            None => (0..asked.readings.len()).collect(),
        };
        let (mut ways, mut odds) = (Vec::new(), 0.0);
        for point in points.iter().copied().filter(|point| *point < asked.readings.len()) {
            let nodes = scan.nodes(place, &record.told.fitted, Some(point));
            let (has, sizes) = scan.laws.specimen_posterior(&nodes, rival.best.place);
            let ratio = scan.laws.ratios(&nodes)[rival.best.place.0] / points.len() as f64;
            odds += ratio;
            let reading = asked.readings.start + point;
            let way = |(size, weight): (f64, f64)| {
                let amplitude = size.signum() * (size.abs() / asked.unit).powf(asked.power);
                (reading, amplitude, weight * ratio)
            };
            if has > 0.0 {
                ways.extend(sizes.into_iter().map(way));
            }
        }
        let share = rival.law.share;
        let has = share * odds / (1.0 - share + share * odds);
        Self { has: if has.is_finite() { has } else { 0.0 }, ways }
    }

    /// Draws the scores of a simulated record, with or without the rival.
    fn draw(&self, record: &RecordScores, stream: &mut RandomStream) -> ScoreSet {
        let mut told = record.simulated[stream.below(record.simulated.len())].clone();
        let (whether, which) = (stream.unit(), stream.unit());
        let whole: f64 = self.ways.iter().map(|(.., weight)| weight).sum();
        if whether >= self.has || whole <= 0.0 {
            return told;
        }
        let mut left = which * whole;
        let is_it = |(.., weight): &&(usize, f64, f64)| {
            left -= weight;
            left <= 0.0
        };
        if let Some((reading, amplitude, _)) = self.ways.iter().find(is_it).or(self.ways.last()) {
            for (readings, cosines) in told.sets_mut().zip(&record.cosines) {
                let shift = amplitude * readings[*reading].norm;
                readings
                    .iter_mut()
                    .enumerate()
                    .for_each(|(other, score)| score.z += shift * cosines[(*reading, other)]);
            }
        }
        told
    }
}
