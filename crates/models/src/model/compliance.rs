//! Displacement per force at unit creep compliance (1/m), as a number or as a function of the Poisson ratio.

use std::sync::Arc;

use base::error::{Error, Result};
use base::number::Dual;
use laws::stages::{ReducedField, SharedStepper, Stages};

/// Function that returns the compliance (1/m) at a Poisson ratio.
type OfPoissonRatio = dyn Fn(Dual) -> Result<Dual> + Send + Sync;

/// Function that returns the reduced model of an effect on the displacement field, from the stages (equations) of a model.
type OfStages = dyn Fn(&Stages) -> Result<Option<ReducedField>> + Send + Sync;

/// Displacement per force at unit creep compliance, in 1/m. Its product with the convolution ∫J dF of creep compliance J and force F is the
/// position.
#[derive(Clone)]
pub struct Compliance {
    /// Compliance at the experiment's Poisson ratio, or the instrument's compliance, in 1/m.
    given_per_m: f64,
    /// Function that returns the compliance at any Poisson ratio; `None` if no model covers other ratios than the experiment's.
    family: Option<Arc<OfPoissonRatio>>,
    /// Function that returns the reduced models of effects on the displacement field; `None` without such models.
    spread: Option<Arc<OfStages>>,
}

impl Compliance {
    /// Returns a compliance (1/m) that is known only at the experiment's Poisson ratio.
    pub fn fixed(per_m: f64) -> Self {
        Self { given_per_m: per_m, family: None, spread: None }
    }

    /// Returns a compliance that is `per_m` (1/m) at the experiment's Poisson ratio, and `of_poisson_ratio` at a fitted ratio.
    pub fn family(per_m: f64, of_poisson_ratio: impl Fn(Dual) -> Result<Dual> + Send + Sync + 'static) -> Self {
        Self { given_per_m: per_m, family: Some(Arc::new(of_poisson_ratio)), spread: None }
    }

    /// Sets the function that returns the reduced model of an effect on the displacement field, from the stages of a model.
    pub fn with_spread(
        self,
        of_stages: impl Fn(&Stages) -> Result<Option<ReducedField>> + Send + Sync + 'static,
    ) -> Self {
        Self { spread: Some(Arc::new(of_stages)), ..self }
    }

    /// Replaces every stepper (reduced model of a nonlinear law that is stepped in time) by the result of `change`.
    pub fn with_stepper(
        self,
        change: impl Fn(&Stages, SharedStepper) -> SharedStepper + Send + Sync + 'static,
    ) -> Self {
        let Some(of_stages) = self.spread.clone() else { return self };
        self.with_spread(move |stages| {
            Ok(match of_stages(stages)? {
                Some(ReducedField::Stepped(stepper)) => Some(ReducedField::Stepped(change(stages, stepper))),
                other => other,
            })
        })
    }

    /// Adds the stepper of an effect whose reduced model is trained for one record. `stepper` returns `None` until the model is trained.
    pub fn with_trained(self, stepper: impl Fn() -> Option<SharedStepper> + Send + Sync + 'static) -> Self {
        let others = self.spread.clone();
        self.with_spread(move |stages| match (&stages.spatial, stepper(), &others) {
            (Some(spatial), Some(stepper), _) if spatial.is_trained_per_record() => {
                Ok(Some(ReducedField::Stepped(stepper)))
            }
            (_, _, Some(others)) => others(stages),
            (_, _, None) => Err(no_field()),
        })
    }

    /// Completes the stages by the reduced model of their effect on the displacement field. Returns the compliance (1/m) at the stages'
    /// Poisson ratio.
    ///
    /// # Errors
    /// Errors of [`Self::per_m`]. [`Error::Numerical`] if the stages' displacement field has no reduced model.
    pub fn resolve(&self, stages: &mut Stages) -> Result<Dual> {
        if stages.spatial.is_some() {
            let of_stages = self.spread.as_ref().ok_or_else(no_field)?;
            stages.spread = of_stages(stages)?;
        }
        self.per_m(stages.poisson_ratio)
    }

    /// Compliance (1/m) at the experiment's Poisson ratio; for an instrument, the instrument's compliance (1/m).
    pub fn experiment_per_m(&self) -> f64 {
        self.given_per_m
    }

    /// Compliance (1/m) at a Poisson ratio. `None` stands for the experiment's ratio.
    ///
    /// # Errors
    /// [`Error::OutsideTrainedRange`] if the ratio is outside the trained range. [`Error::Numerical`] if there is no model of
    /// other ratios.
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

fn no_field() -> Error {
    Error::numerical(
        "there is no reduced model of this effect's displacement field",
        "give an experiment with [robot] and [vitreous]",
    )
}
