//! Quantity of interest for which a record is designed.

use std::path::Path;

use base::error::{Error, Result};
use criticism::{Candidate, Fitted};
use documents::design::DesignedQuantity;
use models::model::Forward;
use nalgebra::DVector;
use posterior::monitor::Monitor;
use prediction::ensemble::Ensemble;
use prediction::quantity::Quantity;
use prediction::scenario::{Scenario, Tolerances};
use sampling::SamplerOptions;

use crate::prediction::GelPlace;
use crate::target::CreepTarget;

/// Step of the free coordinates for derivatives of a quantity of interest.
const DERIVATIVE_STEP: f64 = 1e-4;

/// Quantity of interest of a scenario, as a function of the model's parameters.
pub struct AskedQuantity {
    scenario: Scenario,
    quantity: Quantity,
    ensemble: Ensemble,
}

impl AskedQuantity {
    pub fn new(
        target: &CreepTarget,
        scenario: Option<&Path>,
        sampler: &SamplerOptions,
        monitor: &dyn Monitor,
    ) -> Result<Self> {
        let place = GelPlace::Study(target);
        let scenario = place.scenarios(scenario)?.remove(0);
        let Some(quantity) = scenario.quantities.first().copied() else {
            return Err(Error::input(
                scenario.place("quantity"),
                "a decision needs a quantity of interest, and the first scenario has none",
                "add [[scenario.quantity]] to it",
            ));
        };
        let source = place.open(&scenario, sampler, monitor)?;
        let (force, duration_s) = scenario.force_and_duration()?;
        let record = force.record(duration_s, &quantity.times_s())?;
        let ensemble = Ensemble::new(&source.gel(), &scenario, record, source.kept.clone(), monitor)?;
        Ok(Self { scenario, quantity, ensemble })
    }

    /// Value for coordinates of the model.
    fn value(&self, candidate: &Candidate, theta: &[f64]) -> Result<f64> {
        let position_m = self.ensemble.forward().trajectory_m(&candidate.parameters(theta))?;
        let value = self.quantity.value(self.ensemble.record(), &position_m, self.ensemble.strain_per_m);
        if value.is_finite() {
            return Ok(value);
        }
        Err(Error::input(
            self.scenario.place("quantity"),
            format!(
                "the quantity `{}` has no value: under this force the robot does not come so far",
                self.quantity.label()
            ),
            "give a longer duration, a larger force or a smaller distance",
        ))
    }

    /// Derivatives by the model's free coordinates, by central differences.
    pub fn derivatives(&self, (candidate, fitted): (&Candidate, &Fitted)) -> Result<DVector<f64>> {
        let derivative = |k: usize| {
            let at = |step: f64| {
                let mut theta = fitted.theta.clone();
                theta[k] = candidate.free[k].clamped(theta[k] + step);
                Ok::<_, Error>((theta[k], self.value(candidate, &theta)?))
            };
            let ((lower, less), (upper, more)) = (at(-DERIVATIVE_STEP)?, at(DERIVATIVE_STEP)?);
            Ok((more - less) / (upper - lower))
        };
        let all: Vec<f64> = (0..candidate.free.len()).map(derivative).collect::<Result<_>>()?;
        Ok(DVector::from_vec(all))
    }

    /// True if the apparatus of the scenario is uncertain, too, which no record of the gel changes.
    pub fn has_tolerances(&self) -> bool {
        self.scenario.tolerances != Tolerances::default()
    }

    pub fn designed(
        &self,
        (candidate, fitted): (&Candidate, &Fitted),
        sd: Option<[f64; 2]>,
    ) -> Result<DesignedQuantity> {
        let [sd_now, sd_expected] = sd.unwrap_or([f64::NAN; 2]);
        Ok(DesignedQuantity {
            scenario: self.scenario.name.clone(),
            quantity: self.quantity.label(),
            unit: self.quantity.unit().into(),
            value: self.value(candidate, &fitted.theta)?,
            sd_now,
            sd_expected,
        })
    }
}
