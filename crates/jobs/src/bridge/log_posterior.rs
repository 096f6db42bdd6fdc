//! Model `posterior`, which other programs can call. It maps the parameters of model and noise to the log posterior density, ln(prior × likelihood). The
//! density is over the untransformed parameters.

use serde::Deserialize;
use serde_json::Value;

use super::BridgeInput;
use super::protocol::{BridgeOutcome, InterfaceSizes, NEGATIVE_INFINITY_SUBSTITUTE, Refusal, ServedModel, config_of};
use base::error::{Error, Result};
use models::model::TrainedRange;
use posterior::gradient::PosteriorGradient;
use posterior::likelihood::ReducedPosterior;
use posterior::prepared::PreparedModel;
use posterior::problem::Problem;

/// Largest number of points whose densities one request may ask for.
pub const MAX_POINTS: usize = 10_000;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Config {
    /// Number of points whose coordinates the request lists one after another.
    #[serde(default = "one")]
    points: usize,
}

fn one() -> usize {
    1
}

impl Default for Config {
    fn default() -> Self {
        Self { points: one() }
    }
}

/// Log posterior density for the fitted cycles, with its gradient.
pub struct Posterior<'a> {
    problem: &'a Problem,
    trained: &'a [TrainedRange],
    density: ReducedPosterior<'a>,
    gradient: PosteriorGradient<'a>,
}

impl<'a> Posterior<'a> {
    /// Makes the model from a prepared reduced model.
    pub fn new(model: &'a PreparedModel) -> Self {
        let problem = &model.problem;
        let noise = problem.noise_likelihood(&problem.experiment.calibration_cycles);
        let n_rows = noise.observed_rows().last().map_or(0, |last| last + 1);
        let forward = model.local_forward(n_rows);
        let gradient = PosteriorGradient::new(forward, noise, &problem.priors, &problem.specification.fixed);
        Self { problem, trained: &model.trained, density: model.posterior(), gradient }
    }

    /// Sampled parameters, which are the inputs of the model, in order.
    pub fn inputs(&self) -> Vec<BridgeInput> {
        let input = |prior: &posterior::prior::Prior| {
            let (lower, upper) = prior.distribution.support();
            let trained = self.trained.iter().find(|range| range.name == prior.name);
            let ends = trained.map_or((lower, upper), |range| (range.lower.max(lower), range.upper.min(upper)));
            BridgeInput { prior: prior.clone(), ends }
        };
        self.problem.priors.priors().iter().map(input).collect()
    }

    /// Number of sampled parameters.
    pub fn n_inputs(&self) -> usize {
        self.problem.priors.priors().len()
    }

    /// Log-densities of several points, whose coordinates `points` lists one after another. The value is −∞ where the density is 0.
    ///
    /// # Errors
    /// [`Error::Numerical`] if a log-density is NaN, which is a fault of the model.
    pub fn log_densities(&self, points: &[f64]) -> Result<Vec<f64>> {
        let n = points.len() / self.n_inputs();
        let columns: Vec<f64> =
            (0..self.n_inputs()).flat_map(|d| points.iter().skip(d).step_by(self.n_inputs()).copied()).collect();
        let mut log_density = vec![0.0; n];
        self.density.log_density_natural(&columns, &mut log_density);
        match log_density.iter().position(|value| value.is_nan()) {
            None => Ok(log_density),
            Some(point) => {
                let what = format!("the log-density of point {point} is NaN");
                Err(Error::numerical(what, "move the point away from the ends of the supports"))
            }
        }
    }

    /// Gradient of the log-density at a point. It is 0 where the density is 0, because the finite number that replaces −∞ is constant.
    ///
    /// # Errors
    /// As [`Posterior::log_densities`]; also [`Error::Numerical`] if a parameter has no derivative.
    pub fn gradient_at(&self, point: &[f64]) -> Result<Vec<f64>> {
        let densities = self.log_densities(point)?;
        self.slope(point, densities.first().copied().unwrap_or(f64::NEG_INFINITY))
    }

    /// Gradient of the log-density at a point where its value is known.
    fn slope(&self, point: &[f64], log_density: f64) -> Result<Vec<f64>> {
        if log_density == f64::NEG_INFINITY { Ok(vec![0.0; point.len()]) } else { self.gradient.gradient(point) }
    }

    /// Log posterior densities of several points, for a response of the protocol. A density of NaN is reported as a fault of the model.
    fn served_log_densities(&self, points: &[f64]) -> BridgeOutcome<Vec<f64>> {
        self.log_densities(points).map_err(|error| Refusal::InvalidOutput(error.to_string()))
    }

    /// Gradients of the log-density at several points, whose coordinates are listed one after another.
    fn gradients(&self, points: &[f64]) -> BridgeOutcome<Vec<Vec<f64>>> {
        let densities = self.served_log_densities(points)?;
        points
            .chunks_exact(self.n_inputs())
            .zip(densities)
            .map(|(point, value)| Ok(self.slope(point, value)?))
            .collect()
    }
}

impl ServedModel for Posterior<'_> {
    fn name(&self) -> &'static str {
        "posterior"
    }

    fn sizes(&self, config: &Value) -> BridgeOutcome<InterfaceSizes> {
        let Config { points } = config_of(config)?;
        if !(1..=MAX_POINTS).contains(&points) {
            return Err(Refusal::input(format!("`points` is {points}; ask for 1 to {MAX_POINTS} in one request")));
        }
        Ok(InterfaceSizes { inputs: points * self.n_inputs(), outputs: points })
    }

    fn evaluate(&self, _config: &Value, points: &[f64]) -> BridgeOutcome<Vec<f64>> {
        Ok(self
            .served_log_densities(points)?
            .into_iter()
            .map(|value| value.max(NEGATIVE_INFINITY_SUBSTITUTE))
            .collect())
    }

    fn gradient(&self, _config: &Value, points: &[f64], sensitivity: &[f64]) -> BridgeOutcome<Vec<f64>> {
        let gradients = self.gradients(points)?;
        Ok(gradients
            .iter()
            .zip(sensitivity)
            .flat_map(|(gradient, s)| gradient.iter().map(move |slope| s * slope))
            .collect())
    }

    fn apply_jacobian(&self, _config: &Value, points: &[f64], direction: &[f64]) -> BridgeOutcome<Vec<f64>> {
        let directions = direction.chunks_exact(self.n_inputs());
        let along =
            |(values, direction): (&Vec<f64>, &[f64])| values.iter().zip(direction).map(|(a, b)| a * b).sum::<f64>();
        Ok(self.gradients(points)?.iter().zip(directions).map(along).collect())
    }
}
