//! Models for other programs, served by the protocol of UM-Bridge 1.0 (docs/serve.md).
//!
//! `protocol` reads and answers requests to any model; `trajectory` and `posterior` are the models.
//! Each model has one input vector and one output vector, with the numbers and units of the study's documents.

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

/// The two models that one prepared model offers.
pub struct BridgeModels<'a> {
    trajectory: Trajectory<'a>,
    posterior: Posterior<'a>,
}

/// Description of an input parameter for people.
#[derive(Debug, Clone, PartialEq)]
pub struct BridgeInput {
    /// Prior of the parameter, with name and unit.
    pub prior: Prior,
    /// Smallest and largest value at which the posterior density is positive.
    pub ends: (f64, f64),
}

impl<'a> BridgeModels<'a> {
    /// Prepares both models.
    ///
    /// # Errors
    /// [`Error::BridgeInput`] if every parameter is fixed.
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

    /// Answers a request with the given `body`.
    pub fn answer(&self, endpoint: Endpoint, body: &[u8]) -> BridgeResponse {
        protocol::answer(&[&self.trajectory as &dyn ServedModel, &self.posterior], endpoint, body)
    }

    /// Size limit of a request in bytes. A number takes at most 24 characters, a comma and a space.
    pub fn max_request_bytes(&self) -> usize {
        const FRAME: usize = 1 << 16;
        const NUMBER: usize = 32;
        let (n_inputs, n_rows) = (self.inputs().len(), self.trajectory.n_rows());
        FRAME + NUMBER * (n_rows + n_inputs + MAX_POINTS * (n_inputs + 1))
    }

    /// Inputs of `posterior`, in order. The first [`BridgeModels::n_trajectory_inputs`] of them are the inputs of `trajectory`.
    pub fn inputs(&self) -> Vec<BridgeInput> {
        self.posterior.inputs()
    }

    /// Number of inputs of `trajectory`, which takes every parameter except those of the noise.
    pub fn n_trajectory_inputs(&self) -> usize {
        self.trajectory.n_inputs()
    }

    /// Number of outputs of `trajectory`, which is the record's number of rows.
    pub fn n_rows(&self) -> usize {
        self.trajectory.n_rows()
    }
}
