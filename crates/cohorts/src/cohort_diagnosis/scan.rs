//! Scan of one effect over a cohort: likelihood ratios of every record under every law of sizes.

use super::law::{COARSE, LikelihoodRatios, Nodes, Place, SizeLawGrid, averaged};
use super::likelihood::SizeLikelihood;
use criticism::sketch::{EffectProbe, RecordScores, ScoreSet, SignatureScore};

/// An effect, the searched laws of its sizes, and the records.
pub struct EffectScan<'a> {
    records: &'a [RecordScores],
    effect: usize,
    /// Grid of laws.
    pub laws: SizeLawGrid,
    n_points: usize,
}

/// Shape of an effect in a cohort: the parameters that are unidentified at the effect's null. `Some` holds one grid point for all records; `None` leaves every point
/// possible in each record.
pub type ShapeIndex = Option<usize>;

impl<'a> EffectScan<'a> {
    /// Creates the scan of the effect at an index of the library; `None` if no record can show the effect.
    pub fn new(records: &'a [RecordScores], effect: usize) -> Option<Self> {
        let of = |record: &RecordScores| record.effects[effect].readings.len();
        let n_points = records.iter().map(of).max()?;
        let all = |record: &'a RecordScores| {
            (0..n_points).map(move |point| likelihood(&record.effects[effect], &record.told.fitted, point))
        };
        let told: Vec<SizeLikelihood> = records.iter().flat_map(all).collect();
        let laws = SizeLawGrid::new(&told, COARSE)?;
        Some(Self { records, effect, laws, n_points })
    }

    /// All shapes of the search.
    pub fn shapes(&self) -> impl Iterator<Item = ShapeIndex> + use<> {
        (0..self.n_points).map(Some).chain((self.n_points > 1).then_some(None))
    }

    /// The effect's request for one record.
    pub fn request(&self, record: usize) -> &EffectProbe {
        &self.records[record].effects[self.effect]
    }

    /// Likelihood of the effect's size at a point of its grid, from the signature scores of a record.
    pub fn likelihood(&self, record: usize, readings: &[SignatureScore], point: usize) -> SizeLikelihood {
        likelihood(self.request(record), readings, point)
    }

    /// Likelihood ratio of every size, from the signature scores of a record.
    pub fn nodes(&self, record: usize, readings: &[SignatureScore], shape: ShapeIndex) -> Nodes {
        let of = |point: usize| self.laws.nodes(&self.likelihood(record, readings, point));
        match shape {
            Some(point) => of(point),
            None => averaged(&(0..self.n_points).map(of).collect::<Vec<_>>()),
        }
    }

    /// Likelihood ratios of a record under every law, at one shape.
    pub fn record_ratios(&self, record: usize, told: &ScoreSet, shape: ShapeIndex) -> RecordRatios {
        let of = |readings: &Vec<SignatureScore>| self.laws.ratios(&self.nodes(record, readings, shape));
        RecordRatios {
            fitted: of(&told.fitted),
            before_and_after: told
                .fitted_and_all
                .as_ref()
                .map(|signature_scoreses| signature_scoreses.each_ref().map(of)),
        }
    }

    /// Gains of a cohort under the law with the best fit to its fitted cycles.
    pub fn best(&self, cohort: &[&RecordRatios]) -> BestGain {
        let fitted: Vec<&LikelihoodRatios> = cohort.iter().map(|record_ratios| &record_ratios.fitted).collect();
        let (gain_nats, place) = self.laws.best(&fitted);
        // Each record contributes ln[1 − π + π r(all)] − ln[1 − π + π r(fitted)].
        let of = |record_ratios: &&RecordRatios| {
            let [before, after] = record_ratios.before_and_after.as_ref()?;
            Some(self.laws.gain(after, place) - self.laws.gain(before, place))
        };
        let each = cohort.iter().filter_map(of);
        let heldout_nats = each.fold(None, |sum: Option<f64>, value| Some(sum.unwrap_or(0.0) + value));
        BestGain { gain_nats, heldout_nats, place }
    }

    /// Gain of one record (nats) from the effect alone, at its best size and shape.
    pub fn own_gain(&self, record: usize, readings: &[SignatureScore]) -> f64 {
        let asked = self.request(record);
        let gain = |place: usize| {
            let z = readings[place].z;
            let is_inside = if z > 0.0 { asked.reach[1] > 0.0 } else { asked.reach[0] > 0.0 };
            if is_inside { 0.5 * z * z } else { 0.0 }
        };
        asked.readings.clone().map(gain).fold(0.0, f64::max)
    }
}

/// Likelihood ratios of one record under every law.
pub struct RecordRatios {
    /// Ratios from the fitted cycles.
    pub fitted: LikelihoodRatios,
    /// Ratios from the fitted cycles and from all cycles, as future cycles are scored; `None` if no cycle is held out.
    before_and_after: Option<[LikelihoodRatios; 2]>,
}

/// Gains of a cohort.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BestGain {
    /// Gain in log likelihood of the fitted cycles (nats), under the best law.
    pub gain_nats: f64,
    /// Gain in log score of the last cycles under that law, each given the earlier cycles of its record; `None` if no cycle is held out.
    pub heldout_nats: Option<f64>,
    /// Position of the law in the grid.
    pub place: Place,
}

impl BestGain {
    /// Gain on fitted and last cycles together, by which effects are ranked; 0 without a gain on the fitted cycles.
    pub fn rank_nats(&self) -> f64 {
        if self.gain_nats > 0.0 { self.gain_nats + self.heldout_nats.unwrap_or(0.0) } else { 0.0 }
    }

    /// The one of two shapes of an effect with the larger gain; the first if they are equal.
    pub fn larger(self, other: Self) -> Self {
        if other.gain_nats > self.gain_nats { other } else { self }
    }
}

/// First-order likelihood at a point. A record without this point has no information on it.
fn likelihood(asked: &EffectProbe, readings: &[SignatureScore], point: usize) -> SizeLikelihood {
    let place = asked.readings.start + point;
    let reading = if place < asked.readings.end { readings[place] } else { SignatureScore { z: 0.0, norm: 0.0 } };
    SizeLikelihood::of(asked, reading)
}
