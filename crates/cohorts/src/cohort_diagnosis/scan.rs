//! Evaluates one effect in all records of a cohort: likelihood ratios of each record under each size law of a grid.

use super::law::{COARSE, LikelihoodRatios, Nodes, Place, SizeLawGrid, averaged};
use super::likelihood::SizeLikelihood;
use criticism::sketch::{EffectSignature, RecordScores, ScoreSet, SignatureScore};

/// One effect in all records of a cohort, with a grid of distributions of the effect's sizes (size laws).
pub struct EffectScan<'a> {
    records: &'a [RecordScores],
    effect: usize,
    /// Grid of size laws: distributions of the effect's sizes over specimens.
    pub laws: SizeLawGrid,
    n_points: usize,
}

/// Shape of an effect: the values of its parameters that are unidentified at its null, on a grid. `Some` holds the index of one grid point for all
/// records. With `None`, every grid point is possible in each record.
pub type ShapeIndex = Option<usize>;

impl<'a> EffectScan<'a> {
    /// Prepares the effect with the index `effect` in the library; `None` if no record can show this effect.
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

    /// Returns all shapes of the effect that the search tries. A shape sets the parameters that are unidentified at the effect's null to one grid point.
    /// If there are several grid points, the last shape (`None`) allows every grid point in each record.
    pub fn shapes(&self) -> impl Iterator<Item = ShapeIndex> + use<> {
        (0..self.n_points).map(Some).chain((self.n_points > 1).then_some(None))
    }

    /// Properties of the effect in one record: the indices of its signature scores, and the unit and range of its size.
    pub fn request(&self, record: usize) -> &EffectSignature {
        &self.records[record].effects[self.effect]
    }

    /// Likelihood of the effect's size in a record, from the record's signature scores at the grid point `point` of the effect's other parameters.
    pub fn likelihood(&self, record: usize, readings: &[SignatureScore], point: usize) -> SizeLikelihood {
        likelihood(self.request(record), readings, point)
    }

    /// Likelihood ratio of each size on the grid, from the signature scores of a record. `shape` gives the effect's parameters that are unidentified at
    /// its null.
    pub fn nodes(&self, record: usize, readings: &[SignatureScore], shape: ShapeIndex) -> Nodes {
        let of = |point: usize| self.laws.nodes(&self.likelihood(record, readings, point));
        match shape {
            Some(point) => of(point),
            None => averaged(&(0..self.n_points).map(of).collect::<Vec<_>>()),
        }
    }

    /// Likelihood ratios of a record under each size law (distribution of the effect's sizes). `shape` gives the effect's parameters that are unidentified
    /// at its null.
    pub fn record_ratios(&self, record: usize, told: &ScoreSet, shape: ShapeIndex) -> RecordRatios {
        let of = |readings: &Vec<SignatureScore>| self.laws.ratios(&self.nodes(record, readings, shape));
        RecordRatios {
            fitted: of(&told.fitted),
            before_and_after: told.fitted_and_all.as_ref().map(|score_sets| score_sets.each_ref().map(of)),
        }
    }

    /// Finds the distribution of the effect's sizes (size law) that fits the fitted cycles of a cohort best. Returns the gains in log likelihood under
    /// this law.
    pub fn best(&self, cohort: &[&RecordRatios]) -> BestGain {
        let fitted: Vec<&LikelihoodRatios> = cohort.iter().map(|record_ratios| &record_ratios.fitted).collect();
        let (gain_nats, place) = self.laws.best(&fitted);
        // Each record contributes its gain in log likelihood from all cycles, minus its gain from the fitted cycles.
        let of = |record_ratios: &&RecordRatios| {
            let [before, after] = record_ratios.before_and_after.as_ref()?;
            Some(self.laws.gain(after, place) - self.laws.gain(before, place))
        };
        let each = cohort.iter().filter_map(of);
        let heldout_nats = each.fold(None, |sum: Option<f64>, value| Some(sum.unwrap_or(0.0) + value));
        BestGain { gain_nats, heldout_nats, place }
    }

    /// Gain in log likelihood (nats) of one record. The size and the other parameters of the effect are those that fit this record best.
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

/// Likelihood ratios of one record with and without the effect, under each distribution of the effect's sizes (size law).
pub struct RecordRatios {
    /// Likelihood ratios from the fitted cycles.
    pub fitted: LikelihoodRatios,
    /// Likelihood ratios from the fitted cycles, and from all cycles, with the noise that predictions of future cycles assume. `None` if no cycle is held
    /// out.
    before_and_after: Option<[LikelihoodRatios; 2]>,
}

/// Gains in log likelihood of a cohort by an effect, under the best-fitting distribution of the effect's sizes (size law).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BestGain {
    /// Gain in log likelihood on the fitted cycles (nats).
    pub gain_nats: f64,
    /// Gain of the log score on the last cycles (nats) under the best size law. Each last cycle is predicted from the earlier cycles of its record. `None`
    /// if no cycle is held out.
    pub heldout_nats: Option<f64>,
    /// Position of the best size law (distribution of the effect's sizes) in its grid.
    pub place: Place,
}

impl BestGain {
    /// Gain on the fitted and the last cycles together (nats), by which effects are ranked. The result is 0 if the effect has no gain on the fitted
    /// cycles.
    pub fn rank_nats(&self) -> f64 {
        if self.gain_nats > 0.0 { self.gain_nats + self.heldout_nats.unwrap_or(0.0) } else { 0.0 }
    }

    /// Returns whichever of two gains is larger on the fitted cycles, or `self` if both are equal.
    pub fn larger(self, other: Self) -> Self {
        if other.gain_nats > self.gain_nats { other } else { self }
    }
}

/// First-order likelihood of an effect's size at one grid point of its parameters that are unidentified at the null. A record without this grid point has
/// no information.
fn likelihood(asked: &EffectSignature, readings: &[SignatureScore], point: usize) -> SizeLikelihood {
    let place = asked.readings.start + point;
    let reading = if place < asked.readings.end { readings[place] } else { SignatureScore { z: 0.0, norm: 0.0 } };
    SizeLikelihood::of(asked, reading)
}
