//! First-order bounds of the gains of effects, in data that were simulated without these effects.
//!
//! Of a simulated search only the largest gain is needed. To first order, the gain of an effect that is absent from the data is half the square of the residual's
//! component along the effect's signature. Effects whose bound is too small to be the largest are not refitted.

use nalgebra::DVector;
use rayon::prelude::*;

use super::rank::directions;
use super::refit::Refitted;
use super::{Candidate, Subject, Tangent};
use base::error::Result;

/// Factor by which a refit's gain may exceed its first-order value, with `NATS` added. The noise is estimated anew, and large effects deviate from the tangent.
const FACTOR: f64 = 1.5;
const NATS: f64 = 1.0;

/// Whitened signatures of candidates at the fit of a reference.
pub struct Screen {
    tangent: Tangent,
    position_m: Vec<f64>,
    /// Whitened unit directions of each candidate, and the sign of the added effect's support.
    directions: Vec<(Vec<DVector<f64>>, Option<f64>)>,
}

impl Screen {
    /// Computes the signatures of candidates that each contain the reference.
    ///
    /// # Errors
    /// Errors of [`Tangent::new`].
    pub fn new(subject: &Subject, reference: &Refitted, candidates: &[Candidate]) -> Result<Self> {
        let tangent = Tangent::new(subject, &reference.candidate, &reference.fitted)?;
        let of =
            |candidate: &Candidate| directions(subject, (&reference.candidate, &reference.fitted), candidate, &tangent);
        let directions = candidates.par_iter().map(of).collect::<Result<_>>()?;
        Ok(Self { tangent, position_m: reference.fitted.position_m.clone(), directions })
    }

    /// Returns upper bounds (nats) of the candidates' gains for other positions of the same rows; infinite if there is no first-order bound.
    pub fn bounds_nats(&self, data: &Subject) -> Vec<f64> {
        let residual = self.residual(data);
        let bound = |(directions, sign): &(Vec<DVector<f64>>, Option<f64>)| {
            if directions.is_empty() {
                return f64::INFINITY;
            }
            let along = |direction: &DVector<f64>| {
                let z = direction.dot(&residual);
                sign.map_or(z.abs(), |sign| (sign * z).max(0.0))
            };
            let largest = directions.iter().map(along).fold(0.0, f64::max);
            FACTOR * 0.5 * largest * largest + NATS
        };
        self.directions.iter().map(bound).collect()
    }

    /// First-order gain (nats) in `data` of a model whose positions (m) differ from the reference's. The difference is scaled to its best size.
    pub fn gain_nats(&self, data: &Subject, position_m: &[f64]) -> f64 {
        let change_m = position_m.iter().zip(&self.position_m).map(|(a, b)| a - b).collect();
        let change = self.tangent.project(self.tangent.whiten(&[change_m]).swap_remove(0));
        let along = change.dot(&self.residual(data)) / change.norm().max(f64::MIN_POSITIVE);
        0.5 * along * along
    }

    fn residual(&self, data: &Subject) -> DVector<f64> {
        let left_m = data.fitted_m.iter().zip(&self.position_m).map(|(y, x)| y.map_or(0.0, |y| y - x)).collect();
        self.tangent.project(self.tangent.whiten(&[left_m]).swap_remove(0))
    }
}
