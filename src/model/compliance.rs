//! Displacement per force at unit creep compliance: a number, or a function of the Poisson ratio.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::number::Dual;

/// Compliance (1/m) as a function of the Poisson ratio.
type OfPoissonRatio = dyn Fn(Dual) -> Result<Dual> + Send + Sync;

/// What turns ∫J dF into a position.
#[derive(Clone)]
pub struct Compliance {
    /// At the experiment's Poisson ratio, or an instrument's, in 1/m.
    given_per_m: f64,
    /// At others; `None` where there is no model of them.
    family: Option<Arc<OfPoissonRatio>>,
}

impl Compliance {
    /// One compliance (1/m).
    pub fn given(per_m: f64) -> Self {
        Self { given_per_m: per_m, family: None }
    }

    /// One compliance (1/m) at the experiment's Poisson ratio, and a family for others.
    pub fn family(per_m: f64, of_poisson_ratio: impl Fn(Dual) -> Result<Dual> + Send + Sync + 'static) -> Self {
        Self { given_per_m: per_m, family: Some(Arc::new(of_poisson_ratio)) }
    }

    /// The compliance (1/m) at the experiment's Poisson ratio, or an instrument's.
    pub fn given_per_m(&self) -> f64 {
        self.given_per_m
    }

    /// The compliance (1/m) at a Poisson ratio, `None` for the experiment's.
    ///
    /// # Errors
    /// [`Error::OutsideTrainedRange`], or [`Error::Numerical`] where there is no model of other ratios.
    pub fn per_m(&self, poisson_ratio: Option<Dual>) -> Result<Dual> {
        match (poisson_ratio, &self.family) {
            (None, _) => Ok(Dual::constant(self.given_per_m)),
            (Some(ratio), Some(family)) => family(ratio),
            (Some(ratio), None) => Err(Error::numerical(
                format!("the reduced model was not trained for Poisson ratio {}", ratio.value),
                "train it over a range of Poisson ratios",
            )),
        }
    }
}
