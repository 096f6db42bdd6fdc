//! One trait for the full and the reduced model, so that nothing downstream can tell them apart.

use super::convolve_m;
use crate::error::{Error, Result};
use crate::fe::time::{FullOrderModel, SolvedLoad, TimeScheme};
use crate::rheology::BaseLaw;

/// Parameters → trajectory.
pub trait Forward: Sync {
    /// Position (m) at every row of the record, the limit from the left, for the law's parameters (SI, the order of
    /// [`BaseLaw::parameters`]).
    fn trajectory_m(&self, law_parameters: &[f64]) -> Result<Vec<f64>>;
}

/// The full-order model: internal fields stepped through the record.
pub struct FullForward<'a> {
    /// Factorised finite elements.
    pub model: &'a FullOrderModel<'a>,
    /// The record's force, solved.
    pub load: &'a SolvedLoad<'a>,
    /// Constitutive law.
    pub law: BaseLaw,
    /// Time integrator.
    pub scheme: TimeScheme,
}

impl Forward for FullForward<'_> {
    fn trajectory_m(&self, law_parameters: &[f64]) -> Result<Vec<f64>> {
        Ok(self.model.trajectory(self.load, &self.law.creep_compliance(law_parameters)?, self.scheme))
    }
}

/// Range of one parameter over which a surrogate was trained and verified.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TrainedRange {
    /// Parameter name, with unit.
    pub name: String,
    /// Lower end.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
}

impl TrainedRange {
    /// Whether a value may be asked for.
    pub fn contains(&self, value: f64) -> bool {
        (self.lower..=self.upper).contains(&value)
    }
}

/// The reduced model at a fixed Poisson ratio: one compliance and the law's convolution.
pub struct ReducedForward<'a> {
    /// Displacement per force at unit creep compliance, in 1/m.
    pub compliance_per_m: f64,
    /// Constitutive law.
    pub law: BaseLaw,
    /// Times of the record in s.
    pub time_s: &'a [f64],
    /// Commanded force of the record in N.
    pub force_n: &'a [f64],
    /// Trained ranges of the law's parameters; empty where the compliance is exact (an instrument's).
    pub trained: &'a [TrainedRange],
}

impl Forward for ReducedForward<'_> {
    fn trajectory_m(&self, law_parameters: &[f64]) -> Result<Vec<f64>> {
        for (range, &value) in self.trained.iter().zip(law_parameters) {
            if !range.contains(value) {
                return Err(Error::OutsideTrainedRange {
                    parameter: range.name.clone(),
                    value,
                    lower: range.lower,
                    upper: range.upper,
                });
            }
        }
        Ok(convolve_m(self.compliance_per_m, &self.law.creep_compliance(law_parameters)?, self.time_s, self.force_n))
    }
}
