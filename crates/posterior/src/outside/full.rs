//! Forward model by the external program itself. It requests every trajectory under the acting force, which includes all effects of load. These effects thus need no
//! first-order approximation.

use std::sync::Arc;

use super::ExternalModel;
use base::error::Result;
use base::number::Dual;
use laws::stages::{FieldStepper, Load, ReducedField, SharedStepper, Stages};
use models::model::{Forward, Model, Response};
use models::surrogate::trajectory::Clock;
use record::Force;

/// Forward model that requests each trajectory from the external program.
pub struct ExternalForward<'a> {
    outside: &'a ExternalModel,
    model: &'a Model,
    time_s: &'a [f64],
    force: Force<'a>,
    clock: Clock,
    response: Response,
}

impl<'a> ExternalForward<'a> {
    /// Creates the forward model for one record, given the times (s) of its rows and the commanded force.
    pub fn new(outside: &'a ExternalModel, model: &'a Model, time_s: &'a [f64], force: Force<'a>) -> Self {
        let response = Response::new(time_s, force, time_s.len());
        Self { outside, model, time_s, force, clock: Clock::finer(time_s, force), response }
    }

    /// Position (m) of the robot at every row, before effects of observation.
    fn robot_m(&self, law: &[f64], load: &Load) -> Result<Vec<f64>> {
        if load.is_commanded() {
            return self.outside.position_m(law, self.time_s, self.force);
        }
        let (times_s, acting_n, rows) = self.clock.acting(self.time_s, self.force, load);
        let acting = Force { at_rows_n: &acting_n, ..self.force };
        let position_m = self.outside.position_m(law, &times_s, acting)?;
        Ok(rows.iter().map(|row| position_m[*row]).collect())
    }
}

impl Forward for ExternalForward<'_> {
    fn trajectory_m(&self, parameters: &[f64]) -> Result<Vec<f64>> {
        let constants: Vec<Dual> = parameters.iter().copied().map(Dual::constant).collect();
        let mut stages = self.model.stages(&constants)?;
        let n_law = self.model.base().parameters().len();
        let answer = ProgramResponse(self.robot_m(&parameters[..n_law], &stages.load)?);
        stages.spread = Some(ReducedField::Stepped(SharedStepper(Arc::new(answer))));
        self.response.trajectory_m(&stages, 1.0)
    }
}

/// Positions (m) that the program returned, as input of the observation stage.
#[derive(Debug)]
struct ProgramResponse(Vec<f64>);

impl FieldStepper for ProgramResponse {
    fn excess_m(&self, _: &Stages, _: f64, time_s: &[f64], _: Force<'_>) -> Result<Vec<f64>> {
        Ok(self.0[..time_s.len()].to_vec())
    }

    fn excess_dual_m(&self, _: &Stages, _: f64, time_s: &[f64], _: Force<'_>) -> Result<Vec<Dual>> {
        Ok(self.0[..time_s.len()].iter().copied().map(Dual::constant).collect())
    }
}
