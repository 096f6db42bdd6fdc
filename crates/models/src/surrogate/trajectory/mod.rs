//! Trajectories of nonlinear laws as sums of a few time modes with polynomial amplitudes. If a sum is not accurate enough, the
//! stepper computes the trajectory instead.
//!
//! A few coordinates distinguish laws of one kind (`coordinates`). Their space is divided into fixed boxes. A box is trained on first use
//! by runs of the stepper at design points, and checked by runs at other points. The box is used if it agrees with the check runs to
//! [`TOLERANCE`] of the displacement. Otherwise it is halved, or the stepper computes its trajectories. The result in a box does not depend
//! on the order of the queries.

mod chart;
mod clocked;
mod coordinates;
mod large;
mod outside;
mod polynomial;
#[cfg(test)]
mod tests;

pub use clocked::Clock;
pub use large::{LargeScope, LargeStepper, LargeSurface, MAX_MOBILITY, MAX_RADII, MobilityRange};
pub use outside::{
    EXTERNAL_MAX_POINTS, EXTERNAL_TOLERANCE, ExternalModelFn, ExternalStepper, ExternalSurface, ExternalTraining,
};

use crate::model::Compliance;
use base::error::Result;
use base::number::{Dual, Scalar};
use chart::CoordinateBox;
use coordinates::{CoordinateKind, CoordinatePlace, CoordinateSizes, amplitude_m, stages_at, widths};
use laws::stages::{FieldStepper, NonlinearFamily, SharedStepper, Spatial, Stages};
use polynomial::Basis;
use record::{Force, OwnedForce};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError, RwLock};

/// Largest error at points that were not used for training, relative to the displacement. It is a tenth of the error of the
/// hyper-reduced model itself.
pub const TOLERANCE: f64 = 1e-4;
/// Number of runs that check a box.
const N_CHECKS: u32 = 24;
/// Smallest supported number of coordinates.
const FEWEST_COORDINATES: usize = 2;
/// Degrees of the polynomials that are tried one after the other, by number of coordinates from the smallest number up. If a degree is not
/// accurate enough, the next degree is tried with additional points.
const DEGREES: [&[usize]; 3] = [&[2, 4, 8], &[2, 3, 4, 6], &[2, 3, 5]];
/// Largest number of rows for which boxes are trained. A box stores a few dozen numbers for each row.
const MOST_ROWS: usize = 20_000;
/// Largest absolute value of a coordinate of the law, which is a logarithm. No experiment has times beyond e¹⁶ s.
const LONGEST_LN_S: f64 = 16.0;

/// Kind of the law, and index of the box along every coordinate.
type BoxKey = (CoordinateKind, Vec<i32>);
type Charts = BTreeMap<BoxKey, Arc<CoordinateBox>>;

/// Reduced model of nonlinear laws that trains boxes of trajectories for one record and reuses them.
#[derive(Debug)]
pub struct CachedStepper {
    stepper: SharedStepper,
    time_s: Vec<f64>,
    force: OwnedForce,
    force_and_impulse: [f64; 2],
    charts: RwLock<Charts>,
}

impl CachedStepper {
    /// Returns a stepper for one record, given by the rows' times (s) and the commanded force. Later calls may be for the record's first
    /// rows only.
    pub fn new(stepper: SharedStepper, time_s: &[f64], force: Force<'_>) -> Self {
        let largest_n = force.at_rows_n.iter().fold(0.0_f64, |most, f| most.max(f.abs()));
        let (mut impulse, mut most) = (0.0_f64, 0.0_f64);
        for row in 0..force.at_rows_n.len() {
            impulse += force.impulse_n_s(time_s, row);
            most = most.max(impulse.abs());
        }
        Self {
            stepper,
            time_s: time_s.to_vec(),
            force: force.into(),
            force_and_impulse: [largest_n, most],
            charts: RwLock::default(),
        }
    }

    /// Returns the place of a law among the boxes; `None` if it has none, so that the stepper must compute its trajectory.
    fn place(&self, stages: &Stages, compliance_per_m: f64) -> Option<BoxPlace> {
        let [largest_n, impulse_n_s] = self.force_and_impulse;
        if largest_n == 0.0 {
            return None;
        }
        let sizes = CoordinateSizes { force_n: largest_n, impulse_n_s, compliance_per_m };
        let law = CoordinatePlace::of(stages, sizes)?;
        let bases = bases_of(law.coordinates.len())?;
        let values: Vec<f64> = law.coordinates.iter().map(|x| x.value).collect();
        let (widths, ends) = widths(&law.kind);
        let (last, of_law) = values.split_last()?;
        if !(ends[0]..=ends[1]).contains(last) || of_law.iter().any(|x| x.abs() > LONGEST_LN_S) {
            return None;
        }
        let k_last = values.len() - 1;
        let origin: Vec<f64> = (0..=k_last).map(|k| if k == k_last { ends[0] } else { 0.0 }).collect();
        let number = |k: usize| ((values[k] - origin[k]) / widths[k]).floor();
        // A point at the upper end of the last coordinate belongs to the last box.
        let n_last = ((ends[1] - ends[0]) / widths[k_last]).round();
        let cell: Vec<f64> =
            (0..=k_last).map(|k| if k == k_last { number(k).min(n_last - 1.0) } else { number(k) }).collect();
        let end = |shift: f64| (0..=k_last).map(|k| origin[k] + (cell[k] + shift) * widths[k]).collect();
        let key = (law.kind.clone(), cell.iter().map(|number| *number as i32).collect::<Vec<i32>>());
        Some(BoxPlace { sizes, ends: [end(0.0), end(1.0)], law, values, bases, key })
    }

    /// Returns the trained excess (m) over the linear law's position at every row; `None` if the stepper must compute this excess.
    fn learnt<N: Scalar>(
        &self,
        stages: &Stages,
        compliance_per_m: f64,
        time_s: &[f64],
        force: Force<'_>,
        of: impl Fn(Dual) -> N,
    ) -> Option<Vec<N>> {
        let n_rows = time_s.len();
        let is_own = n_rows <= MOST_ROWS
            && self.time_s.get(..n_rows) == Some(time_s)
            && self.force.get().first(force.at_rows_n.len()) == force;
        if !is_own {
            return None;
        }
        let BoxPlace { sizes, ends, law, values, bases, key } = self.place(stages, compliance_per_m)?;
        let CoordinatePlace { kind, coordinates, modulus_pa } = law;
        let chart = self.chart(key, ends);
        // The trained quantity is the excess divided by the distance from the linear law, so that the excess vanishes exactly for
        // a linear law.
        let run = |coordinates: &[f64]| {
            let at = stages_at(stages, coordinates, sizes)?;
            let inverse = 1.0 / kind.beyond_null(*coordinates.last()?);
            let mut excess_m = self.stepper.0.excess_m(&at, compliance_per_m, &self.time_s, self.force.get()).ok()?;
            excess_m.iter_mut().for_each(|x| *x *= inverse);
            Some((excess_m, inverse * amplitude_m(&at, sizes)))
        };
        let coordinates: Vec<N> = coordinates.into_iter().map(&of).collect();
        let (surface, place) = chart.surface(&values, &coordinates, bases, TOLERANCE, &run)?;
        let factor = kind.beyond_null(*coordinates.last()?) / of(modulus_pa);
        Some(surface.excess_m(bases, &place, factor, n_rows))
    }

    fn chart(&self, key: BoxKey, [lower, upper]: [Vec<f64>; 2]) -> Arc<CoordinateBox> {
        if let Some(chart) = self.charts.read().unwrap_or_else(PoisonError::into_inner).get(&key) {
            return chart.clone();
        }
        let mut charts = self.charts.write().unwrap_or_else(PoisonError::into_inner);
        charts.entry(key).or_insert_with(|| Arc::new(CoordinateBox::new(lower, upper))).clone()
    }
}

/// Place of a law among the boxes.
struct BoxPlace {
    sizes: CoordinateSizes,
    /// Lower and upper ends of the box.
    ends: [Vec<f64>; 2],
    law: CoordinatePlace,
    /// Values of the law's coordinates.
    values: Vec<f64>,
    bases: &'static [Basis],
    key: BoxKey,
}

impl FieldStepper for CachedStepper {
    fn excess_m(&self, stages: &Stages, compliance_per_m: f64, time_s: &[f64], force: Force<'_>) -> Result<Vec<f64>> {
        match self.learnt(stages, compliance_per_m, time_s, force, |x| x.value) {
            Some(excess_m) => Ok(excess_m),
            None => self.stepper.0.excess_m(stages, compliance_per_m, time_s, force),
        }
    }

    fn excess_dual_m(
        &self,
        stages: &Stages,
        compliance_per_m: f64,
        time_s: &[f64],
        force: Force<'_>,
    ) -> Result<Vec<Dual>> {
        match self.learnt(stages, compliance_per_m, time_s, force, |x| x) {
            Some(excess_m) => Ok(excess_m),
            None => self.stepper.0.excess_dual_m(stages, compliance_per_m, time_s, force),
        }
    }

    fn untrained(&self, stages: &Stages, compliance_per_m: f64) -> Option<SharedStepper> {
        if self.time_s.len() > MOST_ROWS {
            return None;
        }
        let BoxPlace { key, values, .. } = self.place(stages, compliance_per_m)?;
        let charts = self.charts.read().unwrap_or_else(PoisonError::into_inner);
        let is_made = charts.get(&key).is_some_and(|chart| chart.is_made(&values));
        (!is_made).then(|| self.stepper.clone())
    }
}

/// Returns the polynomials of `n_coordinates` coordinates, with one basis for each degree, in ascending order.
fn bases_of(n_coordinates: usize) -> Option<&'static [Basis]> {
    static BASES: [OnceLock<Option<Vec<Basis>>>; DEGREES.len()] = [const { OnceLock::new() }; DEGREES.len()];
    let place = n_coordinates.checked_sub(FEWEST_COORDINATES)?;
    let make = || DEGREES[place].iter().map(|degree| Basis::new(n_coordinates, *degree, N_CHECKS)).collect();
    BASES.get(place)?.get_or_init(make).as_deref()
}

/// Returns a compliance whose nonlinear laws reuse trained trajectories for one record, given by the rows' times (s) and the
/// commanded force.
pub fn with_trajectory_cache<'f>(compliance: &Compliance, time_s: &[f64], force: impl Into<Force<'f>>) -> Compliance {
    let record = Arc::new((time_s.to_vec(), OwnedForce::from(force.into())));
    let steppers: Mutex<BTreeMap<NonlinearFamily, SharedStepper>> = Mutex::default();
    compliance.clone().with_stepper(move |stages, stepper| {
        let Some(Spatial::Nonlinear(law)) = stages.spatial else { return stepper };
        let mut steppers = steppers.lock().unwrap_or_else(PoisonError::into_inner);
        let remembering = || SharedStepper(Arc::new(CachedStepper::new(stepper, &record.0, record.1.get())));
        steppers.entry(law.family()).or_insert_with(remembering).clone()
    })
}
