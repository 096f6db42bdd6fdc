//! Which effects may gain most in data that were simulated without them, to first order.
//!
//! A simulated search is asked for its largest gain alone. What an effect gains where there is nothing to find is, to first order, half the square of the
//! residuals' part along its signature; effects whose part is so small that their refit cannot be the largest are not refitted.

use nalgebra::DVector;
use rayon::prelude::*;

use super::rank::directions;
use super::refit::Refitted;
use super::{Candidate, Subject, Tangent};
use base::error::Result;

/// What a refit may gain over its first-order value: a factor and nats. Noise is estimated anew, and sizes leave the tangent.
const FACTOR: f64 = 1.5;
const NATS: f64 = 1.0;

/// The directions of candidates about a reference.
pub(super) struct Screen {
    tangent: Tangent,
    position_m: Vec<f64>,
    /// Whitened unit directions of each candidate, and the sign that its support leaves it.
    directions: Vec<(Vec<DVector<f64>>, Option<f64>)>,
}

impl Screen {
    /// Of candidates that each contain the reference.
    ///
    /// # Errors
    /// As [`Tangent::new`].
    pub fn new(subject: &Subject, reference: &Refitted, candidates: &[Candidate]) -> Result<Self> {
        let tangent = Tangent::new(subject, &reference.candidate, &reference.fitted)?;
        let of =
            |candidate: &Candidate| directions(subject, (&reference.candidate, &reference.fitted), candidate, &tangent);
        let directions = candidates.par_iter().map(of).collect::<Result<_>>()?;
        Ok(Self { tangent, position_m: reference.fitted.position_m.clone(), directions })
    }

    /// What candidates may gain at most in other positions of the same rows; infinite where the first order says nothing.
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

    /// What other positions (m) than the reference's gain to first order, at the size of the change that gains most.
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
