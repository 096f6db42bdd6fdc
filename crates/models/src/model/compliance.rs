//! Displacement per force at unit creep compliance: a number, or a function of the Poisson ratio.

use std::sync::Arc;

use base::error::{Error, Result};
use base::number::Dual;
use laws::stages::{Spread, Stages, Stepped};

/// Compliance (1/m) as a function of the Poisson ratio.
type OfPoissonRatio = dyn Fn(Dual) -> Result<Dual> + Send + Sync;

/// The terms into which an effect that changes the field splits the law.
type OfStages = dyn Fn(&Stages) -> Result<Option<Spread>> + Send + Sync;

/// What turns ∫J dF into a position.
#[derive(Clone)]
pub struct Compliance {
    /// At the experiment's Poisson ratio, or an instrument's, in 1/m.
    given_per_m: f64,
    /// At others; `None` where there is no model of them.
    family: Option<Arc<OfPoissonRatio>>,
    /// Of the other effects that change the field.
    spread: Option<Arc<OfStages>>,
}

impl Compliance {
    /// One compliance (1/m).
    pub fn given(per_m: f64) -> Self {
        Self { given_per_m: per_m, family: None, spread: None }
    }

    /// One compliance (1/m) at the experiment's Poisson ratio, and a family for others.
    pub fn family(per_m: f64, of_poisson_ratio: impl Fn(Dual) -> Result<Dual> + Send + Sync + 'static) -> Self {
        Self { given_per_m: per_m, family: Some(Arc::new(of_poisson_ratio)), spread: None }
    }

    /// The same with the terms of effects that change the field.
    pub fn with_spread(self, of_stages: impl Fn(&Stages) -> Result<Option<Spread>> + Send + Sync + 'static) -> Self {
        Self { spread: Some(Arc::new(of_stages)), ..self }
    }

    /// The same with other steppers in the place of those of laws that are not linear.
    pub fn with_stepper(self, change: impl Fn(&Stages, Stepped) -> Stepped + Send + Sync + 'static) -> Self {
        let Some(of_stages) = self.spread.clone() else { return self };
        self.with_spread(move |stages| {
            Ok(match of_stages(stages)? {
                Some(Spread::Stepped(stepper)) => Some(Spread::Stepped(change(stages, stepper))),
                other => other,
            })
        })
    }

    /// The same with what answers for an effect that is learnt for one record, which may come later.
    pub fn with_learnt(self, stepper: impl Fn() -> Option<Stepped> + Send + Sync + 'static) -> Self {
        let others = self.spread.clone();
        self.with_spread(move |stages| match (&stages.spatial, stepper(), &others) {
            (Some(spatial), Some(stepper), _) if spatial.is_learnt_for_record() => Ok(Some(Spread::Stepped(stepper))),
            (_, _, Some(others)) => others(stages),
            (_, _, None) => Err(no_field()),
        })
    }

    /// Completes stages by the terms of their field, and gives the compliance (1/m) that goes with them.
    ///
    /// # Errors
    /// Those of [`Self::per_m`], and [`Error::Numerical`] where there is no model of the stages' field.
    pub fn resolve(&self, stages: &mut Stages) -> Result<Dual> {
        if stages.spatial.is_some() {
            let of_stages = self.spread.as_ref().ok_or_else(no_field)?;
            stages.spread = of_stages(stages)?;
        }
        self.per_m(stages.poisson_ratio)
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

fn no_field() -> Error {
    Error::numerical(
        "there is no reduced model of this effect's field",
        "give an experiment with [robot] and [vitreous]",
    )
}
