//! Model `trajectory`, which other programs can call. It maps the model's parameters to positions (µm) at the record's rows, by the reduced or the
//! full-order model.

use std::sync::OnceLock;

use serde::Deserialize;
use serde_json::Value;

use super::protocol::{BridgeOutcome, InterfaceSizes, Refusal, ServedModel, config_of};
use base::error::{Error, Result};
use models::model::{Forward, FullOrderForward, SurrogateForward};
use posterior::likelihood::{ParameterSource, sources};
use posterior::prepared::PreparedModel;
use posterior::problem::Problem;

const UM_PER_M: f64 = 1e6;

/// Choice between the reduced and the full-order model in a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum ModelChoice {
    #[default]
    Reduced,
    Full,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Config {
    #[serde(default)]
    model: ModelChoice,
}

/// Positions at all rows of the record as a function of the model's parameters.
pub struct Trajectory<'a> {
    problem: &'a Problem,
    reduced: SurrogateForward<'a>,
    /// Full-order model, prepared when a request first needs it. `None` for an experiment without finite elements, such as an instrument.
    full: OnceLock<Option<FullOrderForward<'a>>>,
    /// Source of each model parameter: an input or a fixed value.
    sources: Vec<ParameterSource>,
    n_inputs: usize,
}

impl<'a> Trajectory<'a> {
    /// Makes the model from a prepared reduced model.
    pub fn new(model: &'a PreparedModel) -> Self {
        let problem = &model.problem;
        let mut sources = sources(&problem.model, problem.noise, &problem.priors, &problem.specification.fixed);
        sources.truncate(problem.model.parameters().len());
        let n_inputs = sources.iter().filter(|source| matches!(source, ParameterSource::Sampled(_))).count();
        let reduced = model.forward();
        Self { problem, reduced, full: OnceLock::new(), sources, n_inputs }
    }

    /// Number of model parameters that are not fixed.
    pub fn n_inputs(&self) -> usize {
        self.n_inputs
    }

    /// Number of rows of the record.
    pub fn n_rows(&self) -> usize {
        self.problem.experiment.record.n_rows()
    }

    fn full(&self) -> Result<Option<&FullOrderForward<'a>>> {
        if let Some(full) = self.full.get() {
            return Ok(full.as_ref());
        }
        let full = self.problem.full_forward()?;
        Ok(self.full.get_or_init(|| full).as_ref())
    }

    /// Values of all model parameters at a point, including the fixed parameters. Values outside a parameter's support are refused.
    fn parameters(&self, point: &[f64]) -> Result<Vec<f64>> {
        let value = |source: &ParameterSource| match *source {
            // The model's parameters come before those of the noise, so the index of a prior is also the index of the input.
            ParameterSource::Sampled(index) => point[index],
            ParameterSource::Fixed(value) => value,
        };
        let parameters: Vec<f64> = self.sources.iter().map(value).collect();
        let specs = self.problem.model.parameters();
        match specs.iter().zip(&parameters).find(|(spec, value)| !spec.support.contains(**value)) {
            None => Ok(parameters),
            Some((spec, value)) => {
                let what = format!("{} = {value} {} lies outside {}", spec.name, spec.unit, spec.support);
                Err(Error::numerical(what, "give a value inside this range"))
            }
        }
    }

    /// Positions in µm at all rows, computed by the reduced model. `point` has [`Trajectory::n_inputs`] numbers.
    ///
    /// # Errors
    /// [`Error::Numerical`] or [`Error::OutsideTrainedRange`] if the model has no trajectory at the point.
    pub fn reduced_um(&self, point: &[f64]) -> Result<Vec<f64>> {
        self.positions_um(&self.reduced, point)
    }

    fn positions_um(&self, forward: &dyn Forward, point: &[f64]) -> Result<Vec<f64>> {
        let position_m = forward.trajectory_m(&self.parameters(point)?)?;
        if position_m.iter().any(|x| !x.is_finite()) {
            let what = format!("the position is not finite at {point:?}");
            return Err(Error::numerical(what, "move the point away from the ends of the supports"));
        }
        Ok(position_m.into_iter().map(|x| UM_PER_M * x).collect())
    }

    /// Refuses requests for derivatives of the full-order model. Only the reduced model has derivatives.
    fn refuse_full(config: &Value) -> BridgeOutcome<()> {
        match config_of::<Config>(config)?.model {
            ModelChoice::Reduced => Ok(()),
            ModelChoice::Full => Err(Refusal::UnsupportedFeature(
                "the full model has no derivatives: leave `config` out to use the reduced model".into(),
            )),
        }
    }
}

impl ServedModel for Trajectory<'_> {
    fn name(&self) -> &'static str {
        "trajectory"
    }

    fn sizes(&self, config: &Value) -> BridgeOutcome<InterfaceSizes> {
        config_of::<Config>(config)?;
        Ok(InterfaceSizes { inputs: self.n_inputs, outputs: self.n_rows() })
    }

    fn evaluate(&self, config: &Value, point: &[f64]) -> BridgeOutcome<Vec<f64>> {
        let forward: &dyn Forward = match config_of::<Config>(config)?.model {
            ModelChoice::Reduced => &self.reduced,
            ModelChoice::Full => self.full()?.ok_or_else(|| {
                Refusal::input(match self.problem.outside() {
                    Some(outside) => format!("the full model is the program {}: send requests to it", outside.title()),
                    None => "an instrument has a given compliance and no full model: leave `config` out".into(),
                })
            })?,
        };
        Ok(self.positions_um(forward, point)?)
    }

    fn gradient(&self, config: &Value, point: &[f64], sensitivity: &[f64]) -> BridgeOutcome<Vec<f64>> {
        Self::refuse_full(config)?;
        let parameters = self.parameters(point)?;
        let sampled =
            self.sources.iter().enumerate().filter(|(_, source)| matches!(source, ParameterSource::Sampled(_)));
        let slope = |(place, _): (usize, &ParameterSource)| -> BridgeOutcome<f64> {
            let derivative_m = self.reduced.derivative_m(&parameters, place)?;
            Ok(UM_PER_M * derivative_m.iter().zip(sensitivity).map(|(d, s)| d * s).sum::<f64>())
        };
        sampled.map(slope).collect()
    }

    fn apply_jacobian(&self, config: &Value, point: &[f64], direction: &[f64]) -> BridgeOutcome<Vec<f64>> {
        Self::refuse_full(config)?;
        let part = |source: &ParameterSource| match *source {
            ParameterSource::Sampled(index) => direction[index],
            ParameterSource::Fixed(_) => 0.0,
        };
        let along: Vec<f64> = self.sources.iter().map(part).collect();
        let derivative_m = self.reduced.derivative_along_m(&self.parameters(point)?, &along)?;
        Ok(derivative_m.into_iter().map(|d| UM_PER_M * d).collect())
    }
}
