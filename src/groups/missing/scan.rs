//! One effect over a cohort: what every record says of every law of its sizes.

use super::law::{COARSE, Laws, Nodes, averaged};
use super::likelihood::Likelihood;
use crate::critique::sketch::{Asked, Reading, Said};

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
            (0..n_points).map(move |point| likelihood(&record.effects[effect], &record.fitted, point))
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

/// A record that has no such point says nothing of it.
fn likelihood(asked: &Asked, readings: &[Reading], point: usize) -> Likelihood {
    let place = asked.readings.start + point;
    let reading = if place < asked.readings.end { readings[place] } else { Reading { z: 0.0, norm: 0.0 } };
    Likelihood::of(asked, reading)
}
