//! Models that other programs can call by the protocol UM-Bridge 1.0 (docs/serve.md).
//!
//! `protocol` reads and answers the requests. `trajectory` and `posterior` are the models. Each has one input vector and one output vector. Parameter
//! values and units are those of the study's documents.

mod log_posterior;
mod protocol;
mod trajectory;

pub use log_posterior::{MAX_POINTS, Posterior};
pub use posterior::outside::Endpoint;
pub use protocol::{BridgeResponse, NEGATIVE_INFINITY_SUBSTITUTE};
pub use trajectory::Trajectory;

use base::error::{Error, InputPlace, Result, Setting};
use posterior::prepared::PreparedModel;
use posterior::prior::Prior;
use protocol::ServedModel;

/// The models `trajectory` and `posterior`, made from one prepared model.
pub struct BridgeModels<'a> {
    trajectory: Trajectory<'a>,
    posterior: Posterior<'a>,
}

/// Input parameter of one of the models that other programs can call.
#[derive(Debug, Clone, PartialEq)]
pub struct BridgeInput {
    /// Prior of the parameter, with its name and unit.
    pub prior: Prior,
    /// Interval in which the posterior density is positive: smallest and largest value.
    pub ends: (f64, f64),
}

impl<'a> BridgeModels<'a> {
    /// Makes both models from a prepared model.
    ///
    /// # Errors
    /// [`Error::Input`] if every parameter is fixed.
    pub fn new(model: &'a PreparedModel) -> Result<Self> {
        if model.problem.priors.priors().is_empty() {
            return Err(Error::input(
                InputPlace::setting(Setting::Fixed),
                "every parameter is fixed, so the models have no input",
                "leave at least one parameter free",
            ));
        }
        Ok(Self { trajectory: Trajectory::new(model), posterior: Posterior::new(model) })
    }

    /// Returns the model `trajectory`.
    pub fn trajectory(&self) -> &Trajectory<'a> {
        &self.trajectory
    }

    /// Returns the model `posterior`.
    pub fn posterior(&self) -> &Posterior<'a> {
        &self.posterior
    }

    /// Answers a request to `endpoint`. `body` is the JSON text of the request.
    pub fn answer(&self, endpoint: Endpoint, body: &[u8]) -> BridgeResponse {
        protocol::answer(&[&self.trajectory as &dyn ServedModel, &self.posterior], endpoint, body)
    }

    /// Largest accepted size of a request, in bytes. The limit allows 32 bytes per number, which is more than the longest number takes.
    pub fn max_request_bytes(&self) -> usize {
        const FRAME: usize = 1 << 16;
        const NUMBER: usize = 32;
        let (n_inputs, n_rows) = (self.inputs().len(), self.trajectory.n_rows());
        FRAME + NUMBER * (n_rows + n_inputs + MAX_POINTS * (n_inputs + 1))
    }

    /// Inputs of `posterior`, in order. The first [`BridgeModels::n_trajectory_inputs`] are also the inputs of `trajectory`.
    pub fn inputs(&self) -> Vec<BridgeInput> {
        self.posterior.inputs()
    }

    /// Number of inputs of `trajectory`, which are all parameters that are not fixed, except those of the noise.
    pub fn n_trajectory_inputs(&self) -> usize {
        self.trajectory.n_inputs()
    }

    /// Number of outputs of `trajectory`, one per row of the record.
    pub fn n_rows(&self) -> usize {
        self.trajectory.n_rows()
    }
}
