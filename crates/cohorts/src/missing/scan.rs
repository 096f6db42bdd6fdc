//! One effect over a cohort: what every record says of every law of its sizes.

use super::law::{COARSE, Laws, Nodes, Place, Ratios, averaged};
use super::likelihood::Likelihood;
use criticism::sketch::{Asked, Reading, Said, Told};

/// An effect, the laws of its sizes that are looked at, and the records.
pub struct Scan<'a> {
    records: &'a [Said],
    effect: usize,
    /// The grid of laws.
    pub laws: Laws,
    n_points: usize,
}

/// What means nothing at an effect's null, in a cohort: at one point of its grid in all records, or (`None`) at any point in each.
pub type Shape = Option<usize>;

impl<'a> Scan<'a> {
    /// Of the effect at a place of the library; `None` where no record can show it.
    pub fn new(records: &'a [Said], effect: usize) -> Option<Self> {
        let of = |record: &Said| record.effects[effect].readings.len();
        let n_points = records.iter().map(of).max()?;
        let all = |record: &'a Said| {
            (0..n_points).map(move |point| likelihood(&record.effects[effect], &record.told.fitted, point))
        };
        let told: Vec<Likelihood> = records.iter().flat_map(all).collect();
        let laws = Laws::new(&told, COARSE)?;
        Some(Self { records, effect, laws, n_points })
    }

    /// Every shape that is looked at.
    pub fn shapes(&self) -> impl Iterator<Item = Shape> + use<> {
        (0..self.n_points).map(Some).chain((self.n_points > 1).then_some(None))
    }

    /// What a record is asked.
    pub fn asked(&self, record: usize) -> &Asked {
        &self.records[record].effects[self.effect]
    }

    /// What readings of a record say of the effect's size at a point of its grid.
    pub fn likelihood(&self, record: usize, readings: &[Reading], point: usize) -> Likelihood {
        likelihood(self.asked(record), readings, point)
    }

    /// What readings of a record say of every size.
    pub fn nodes(&self, record: usize, readings: &[Reading], shape: Shape) -> Nodes {
        let of = |point: usize| self.laws.nodes(&self.likelihood(record, readings, point));
        match shape {
            Some(point) => of(point),
            None => averaged(&(0..self.n_points).map(of).collect::<Vec<_>>()),
        }
    }

    /// What a record says of every law at a shape.
    pub fn weighed(&self, record: usize, told: &Told, shape: Shape) -> Weighed {
        let of = |readings: &Vec<Reading>| self.laws.ratios(&self.nodes(record, readings, shape));
        Weighed {
            fitted: of(&told.fitted),
            before_and_after: told.before_and_after.as_ref().map(|own| own.each_ref().map(of)),
        }
    }

    /// What a cohort gains under the law that suits its fitted cycles best.
    pub fn best(&self, cohort: &[&Weighed]) -> Best {
        let fitted: Vec<&Ratios> = cohort.iter().map(|own| &own.fitted).collect();
        let (gain_nats, place) = self.laws.best(&fitted);
        // ln[1 − π + π r(all)] − ln[1 − π + π r(fitted)], summed.
        let of = |own: &&Weighed| {
            let [before, after] = own.before_and_after.as_ref()?;
            Some(self.laws.gain(after, place) - self.laws.gain(before, place))
        };
        let each = cohort.iter().filter_map(of);
        let heldout_nats = each.fold(None, |sum: Option<f64>, own| Some(sum.unwrap_or(0.0) + own));
        Best { gain_nats, heldout_nats, place }
    }

    /// What readings of a record gain (nats) from the effect by itself, at whatever size and shape suits them best.
    pub fn own_gain(&self, record: usize, readings: &[Reading]) -> f64 {
        let asked = self.asked(record);
        let gain = |place: usize| {
            let z = readings[place].z;
            let is_inside = if z > 0.0 { asked.reach[1] > 0.0 } else { asked.reach[0] > 0.0 };
            if is_inside { 0.5 * z * z } else { 0.0 }
        };
        asked.readings.clone().map(gain).fold(0.0, f64::max)
    }
}

/// What one record says of every law.
pub struct Weighed {
    /// By the fitted cycles.
    pub fitted: Ratios,
    /// By them and by all, as future cycles are scored; `None` where no cycle is held out.
    before_and_after: Option<[Ratios; 2]>,
}

/// What a cohort gains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Best {
    /// In log likelihood of the fitted cycles (nats), under the law that suits them best.
    pub gain_nats: f64,
    /// In the log score of the last cycles, each given those before it in its record, under that law; `None` where none is held out.
    pub heldout_nats: Option<f64>,
    /// The law.
    pub place: Place,
}

impl Best {
    /// On fitted and last cycles together, by which effects rank; what no fitted cycle gains by ranks nowhere.
    pub fn rank_nats(&self) -> f64 {
        if self.gain_nats > 0.0 { self.gain_nats + self.heldout_nats.unwrap_or(0.0) } else { 0.0 }
    }

    /// Of the shapes of one effect that which gains most; of equals the first.
    pub fn larger(self, other: Self) -> Self {
        if other.gain_nats > self.gain_nats { other } else { self }
    }
}

/// A record that has no such point says nothing of it.
fn likelihood(asked: &Asked, readings: &[Reading], point: usize) -> Likelihood {
    let place = asked.readings.start + point;
    let reading = if place < asked.readings.end { readings[place] } else { Reading { z: 0.0, norm: 0.0 } };
    Likelihood::of(asked, reading)
}
