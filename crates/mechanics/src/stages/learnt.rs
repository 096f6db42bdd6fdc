//! What was learnt of a law that another program computes, for one record: a linear law with its amplitudes, and what it leaves of the trajectories.
//!
//! The linear law is Σ aₘ (1 − e^{−rₘt}) at given rates, with a spring and a dashpot beside it; it need not be physical. What stands before it (load) and after it (observation) acts on it as on any law.
//! What it leaves is added as it was learnt, under the force as it is commanded.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::experiment::{Force, KeptForce};
use crate::number::{Dual, PointScalar};
use crate::rheology::{RetardationSpectrum, SpectralMode};

/// What of it belongs to the record: shared by all points.
#[derive(Debug, PartialEq)]
pub struct LearntRecord {
    /// Times of all rows, in s.
    pub time_s: Vec<f64>,
    /// The commanded force at them.
    pub force: KeptForce,
    /// Rates rₘ in 1/s.
    pub rates_per_s: Vec<f64>,
    /// Of every time mode what it is as a linear law, in m/N for a unit of the mode: the spring's compliance, those of the rates, the dashpot's fluidity (1/s).
    pub laws: Vec<Vec<f64>>,
    /// Of every time mode what the linear law leaves, in m at every row for a unit of the mode.
    pub left_m: Vec<Vec<f64>>,
}

/// It at one point of the law's parameters.
#[derive(Debug, Clone)]
pub struct Learnt {
    /// What belongs to the record.
    pub record: Arc<LearntRecord>,
    /// Amplitudes of its time modes.
    pub amplitudes: Vec<Dual>,
}

impl PartialEq for Learnt {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.record, &other.record) && self.amplitudes == other.amplitudes
    }
}

impl Learnt {
    /// The linear law, in m/N in place of 1/Pa.
    pub fn spectrum<T: PointScalar>(&self) -> RetardationSpectrum<T> {
        let n_rates = self.record.rates_per_s.len();
        let mut numbers = vec![T::constant(0.0); n_rates + 2];
        for (law, amplitude) in self.record.laws.iter().zip(&self.amplitudes) {
            let amplitude = T::of(*amplitude);
            numbers.iter_mut().zip(law).for_each(|(number, of_mode)| *number += amplitude * *of_mode);
        }
        let modes = self.record.rates_per_s.iter().zip(&numbers[1..]);
        RetardationSpectrum {
            instantaneous_per_pa: numbers[0],
            modes: modes
                .map(|(rate, of_mode)| SpectralMode { compliance_per_pa: *of_mode, rate_per_s: T::constant(*rate) })
                .collect(),
            oscillating: Vec::new(),
            fluidity_per_pa_s: numbers[n_rates + 1],
        }
    }

    /// What the linear law leaves, in m at rows of the record that was learnt.
    ///
    /// # Errors
    /// [`Error::Numerical`] for times that are no rows of it, and for another force.
    pub fn left_m<T: PointScalar>(&self, time_s: &[f64], force: Force<'_>) -> Result<Vec<T>> {
        let (own_s, own) = (&self.record.time_s, &self.record.force);
        let is_first = own_s.get(..time_s.len()) == Some(time_s) && own.get().first(time_s.len()) == force;
        let rows: Vec<usize> = if is_first {
            Vec::new()
        } else {
            let row = |(at_s, force_n): (&f64, &f64)| {
                let row = own_s.binary_search_by(|own| own.total_cmp(at_s)).ok();
                row.filter(|row| own.at_rows_n[*row] == *force_n && own.rule == force.rule)
            };
            time_s.iter().zip(force.at_rows_n).map(row).collect::<Option<_>>().ok_or_else(|| {
                Error::numerical(
                    "the trajectories of somebody else's law were learnt for another record, or another force",
                    "learn them for this one",
                )
            })?
        };
        let mut left_m = vec![T::constant(0.0); time_s.len()];
        for (of_mode, amplitude) in self.record.left_m.iter().zip(&self.amplitudes) {
            let amplitude = T::of(*amplitude);
            if is_first {
                left_m.iter_mut().zip(of_mode).for_each(|(x, value)| *x += amplitude * *value);
            } else {
                left_m.iter_mut().zip(&rows).for_each(|(x, row)| *x += amplitude * of_mode[*row]);
            }
        }
        Ok(left_m)
    }
}
