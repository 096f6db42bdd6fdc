//! Finds rivals of a cohort's claim: effects that the data cannot distinguish from the claimed effect.
//!
//! To test a rival, cohorts are simulated in which the rival is the true effect. Each simulated record has the rival with a probability and a size that
//! follow from the rival's size law and the record's own data. The noise is that of a record simulated without effects. The rival is excluded if the
//! claim's gain exceeds the rival's gain by as much as in the data in almost none of these cohorts (Cox, J. R. Stat. Soc. B 24:406, 1962).
//!
//! This lead of the claim over the rival is tested twice: with common size laws, and with a separate size in each record. The rival is excluded only if
//! both leads are too large for chance. With common size laws alone, effects with equal signatures could be distinguished by how similar their sizes are
//! across specimens. Nothing is known beforehand about this similarity.

use rayon::prelude::*;

use super::judge::EffectGain;
use super::scan::{BestGain, EffectScan, RecordRatios};
use criticism::criteria::Criteria;
use criticism::sketch::{RecordScores, ScoreSet};
use criticism::verdict::Rival;
use sampling::ensemble::RandomStream;

/// Number of cohorts that are simulated with each rival of the claimed effect.
const N_COHORTS: usize = 199;
const RIVAL_STREAMS: u64 = 0xc1a55;

/// Lists the effects that the data may not distinguish from the claimed effect. Each entry has a p-value: the fraction of cohorts simulated with the rival
/// in which the claim's gain leads by at least as much as in the data.
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

/// Fraction of the cohorts simulated with the rival in which the claim's gain exceeds the rival's gain by at least as much as in the data. The result is
/// the larger of two fractions: with common size laws, and with a separate size in each record. `None` if an effect cannot be evaluated.
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

/// Gain in log likelihood of a cohort (nats) by an effect, on the fitted and the last cycles together. The values of the effect's parameters that are
/// unidentified at its null, and the size law, are those that fit the fitted cycles best.
fn rank_nats(scan: &EffectScan, cohort: &[&ScoreSet]) -> f64 {
    let of = |shape| {
        let weighed: Vec<RecordRatios> =
            cohort.iter().enumerate().map(|(k, told)| scan.record_ratios(k, told, shape)).collect();
        scan.best(&weighed.iter().collect::<Vec<_>>())
    };
    scan.shapes().map(of).reduce(BestGain::larger).map_or(0.0, |best| best.rank_nats())
}

/// Distribution from which a rival effect is simulated in one record: the probability that the record has the rival, and the rival's possible sizes.
struct RivalSimulator {
    has: f64,
    /// Possible sizes of the rival: index of the signature score that the size shifts, amplitude of the shift, and relative probability.
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

    /// Draws the signature scores of a simulated record, which has the rival effect with a certain probability.
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
