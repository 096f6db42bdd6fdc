//! What a designed protocol shall teach, and how much it teaches in the linear-Gaussian model around a fit.

use nalgebra::{DMatrix, DVector};

use crate::derivatives::columns_m;
use crate::detectable::{Detectability, RANGE_TAIL};
use crate::{Candidate, Fitted, Subject};
use base::error::{Error, Result};
use models::effects::POSITION_OFFSET;

/// Purpose of a design.
pub enum Sought {
    /// Smallest uncertainty of the model's parameters.
    Parameters,
    /// Largest distance between equivalent effects.
    Effects,
    /// Largest number of detectable effects among those that the model lacks, then their smallest detectable sizes.
    Sizes {
        /// The effects.
        effects: Vec<SoughtEffect>,
        /// Distance (σ) from which an effect is detectable.
        threshold_sigma: f64,
    },
    /// Smallest uncertainty of a quantity of interest, by its derivatives with respect to the model's free coordinates.
    Quantity(DVector<f64>),
}

/// An effect that the model lacks, at the size for which protocols are compared.
pub struct SoughtEffect {
    candidate: Candidate,
    /// Coordinates of the candidate at the null of the effect, and at the compared size.
    null: Vec<f64>,
    point: Vec<f64>,
}

/// Derivatives of a record by the model's free coordinates: whitened columns and their products.
pub(super) struct RecordInformation {
    columns: Vec<Vec<f64>>,
    /// Fisher information.
    pub matrix: DMatrix<f64>,
}

impl RecordInformation {
    /// Derivatives of the fitted rows of a subject at a fit.
    pub fn new(subject: &Subject, (candidate, fitted): (&Candidate, &Fitted)) -> Result<Self> {
        let position_m = subject.trajectory_m(candidate, &fitted.theta)?;
        let columns_m = columns_m(subject, candidate, &fitted.theta)?;
        let mut columns = subject.fitted.whiten(&columns_m, &position_m, &fitted.noise);
        // A new record has an unknown offset of its own, of which the present records say nothing.
        if let Some(place) = candidate.free.iter().position(|free| free.name == POSITION_OFFSET) {
            let of_offset = columns[place].clone();
            columns[place].fill(0.0);
            let square = dot(&of_offset, &of_offset);
            for column in columns.iter_mut().filter(|_| square > 0.0) {
                let share = dot(column, &of_offset) / square;
                column.iter_mut().zip(&of_offset).for_each(|(x, offset)| *x -= share * offset);
            }
        }
        let matrix = DMatrix::from_fn(columns.len(), columns.len(), |i, j| dot(&columns[i], &columns[j]));
        Ok(Self { columns, matrix })
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

impl SoughtEffect {
    /// Effects that can be added to a base model, each at its smallest detectable size in the present record, or at the largest size of its prior where none is
    /// detectable. Effects that cannot be added are left out.
    pub fn all(subject: &Subject, base: (&Candidate, &Fitted), detectable: &[Detectability]) -> Vec<Self> {
        let effect = |now: &Detectability| -> Option<Self> {
            let names = base.0.effects.get(subject.specification().effects.len()..).unwrap_or(&[]);
            let slugs: Vec<&str> = names.iter().map(String::as_str).chain([now.effect.as_str()]).collect();
            let candidate = subject.extended(&slugs).ok()?;
            let last = candidate.effects.len() - 1;
            let of_effect = |free: &crate::Free| free.effect == Some(last);
            let place = candidate.free.iter().position(|free| of_effect(free) && free.null.is_some())?;
            let mut null = candidate.embed(base.0, &base.1.theta);
            for (value, free) in null.iter_mut().zip(&candidate.free) {
                if of_effect(free) && free.null.is_none() {
                    *value = free.quantile(0.5);
                }
            }
            let mut point = null.clone();
            let size = &candidate.free[place];
            point[place] =
                now.smallest.map_or_else(|| size.quantile(1.0 - RANGE_TAIL), |value| size.coordinate.theta(value));
            Some(Self { candidate, null, point })
        };
        detectable.iter().filter_map(effect).collect()
    }

    /// True if a trajectory of the effect takes milliseconds, too long for the screen of all protocols.
    pub(super) fn is_slow(&self) -> bool {
        self.candidate.is_slow()
    }

    /// Squared distance (σ²) of the base model from data with the effect, to first order. `precision` is that of the base model's parameters in this record, priors
    /// included; `None` if the effect has no solution.
    pub(super) fn squared_distance(
        &self,
        subject: &Subject,
        base: (&Candidate, &Fitted),
        information: &RecordInformation,
        precision: &DMatrix<f64>,
    ) -> Option<f64> {
        let [without_m, with_m] =
            [&self.null, &self.point].map(|theta| subject.trajectory_m(&self.candidate, theta).ok());
        let (without_m, with_m) = (without_m?, with_m?);
        let change_m: Vec<f64> = with_m.iter().zip(&without_m).map(|(with, without)| with - without).collect();
        let white = subject.fitted.whiten(&[change_m], &without_m, &base.1.noise).swap_remove(0);
        let products = information.columns.iter().map(|column| dot(column, &white));
        let slope = DVector::from_iterator(information.columns.len(), products);
        let absorbed = precision.clone().cholesky()?.solve(&slope).dot(&slope);
        Some(dot(&white, &white) - absorbed).filter(|squared| squared.is_finite())
    }
}

/// Standard deviation of a quantity with these derivatives, for parameters of a given precision.
pub(super) fn sd_of(derivatives: &DVector<f64>, precision: &DMatrix<f64>) -> Result<f64> {
    let factor = precision.clone().cholesky().ok_or_else(|| {
        Error::numerical("the parameters have no finite uncertainty", "fix one of the model's parameters")
    })?;
    Ok(factor.solve(derivatives).dot(derivatives).max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Search;
    use models::effects::Library;
    use posterior::monitor::SilentMonitor;
    use posterior::problem::Problem;
    use posterior::replica::embedded;
    use posterior::study::ModelSpecification;
    use record::Apparatus;

    /// The information of a record with an unknown offset is the Schur complement of the offset in the information of all parameters.
    #[test]
    fn a_new_record_has_an_offset_of_its_own() {
        let (mut experiment, _) = embedded().expect("embedded");
        experiment.apparatus = Apparatus::Instrument { compliance_per_m: 549.178, is_stress_strain: false };
        experiment.fits_position_offset = true;
        let problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).expect("sound");
        let subject = Subject::new(&problem, &Library::only(&[]), None, &SilentMonitor).expect("sound");
        let base = subject.base();
        let fitted = subject.fit(&base, &[], Search::Wide).expect("fits");
        let found = RecordInformation::new(&subject, (&base, &fitted)).expect("derivatives").matrix;
        let position_m = subject.trajectory_m(&base, &fitted.theta).expect("a model");
        let columns_m = columns_m(&subject, &base, &fitted.theta).expect("derivatives");
        let columns = subject.fitted.whiten(&columns_m, &position_m, &fitted.noise);
        let all = DMatrix::from_fn(columns.len(), columns.len(), |i, j| dot(&columns[i], &columns[j]));
        let k = base.free.iter().position(|free| free.name == POSITION_OFFSET).expect("an offset");
        for i in 0..columns.len() {
            for j in 0..columns.len() {
                let expected =
                    if i == k || j == k { 0.0 } else { all[(i, j)] - all[(i, k)] * all[(k, j)] / all[(k, k)] };
                let scale = (all[(i, i)] * all[(j, j)]).sqrt();
                assert!((found[(i, j)] - expected).abs() < 1e-9 * scale, "{i} {j}: {} {expected}", found[(i, j)]);
            }
        }
    }
}
