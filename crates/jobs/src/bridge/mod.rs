//! Models for other programs, by the protocol of UM-Bridge 1.0 (docs/serve.md).
//!
//! `protocol` reads requests and answers them, whatever the model; `trajectory` and `posterior` are the models. Each has one vector of inputs and one of
//! outputs, and speaks the numbers and units of the study's documents.

mod log_posterior;
mod protocol;
mod trajectory;

pub use log_posterior::{MOST_POINTS, Posterior};
pub use posterior::outside::Endpoint;
pub use protocol::{Answer, OUTSIDE};
pub use trajectory::Trajectory;

use base::error::{Error, Place, Result, Setting};
use posterior::prepared::PreparedModel;
use posterior::prior::Prior;
use protocol::Served;

/// The models of one prepared model.
pub struct Models<'a> {
    trajectory: Trajectory<'a>,
    posterior: Posterior<'a>,
}

/// A parameter that is an input, for people.
#[derive(Debug, Clone, PartialEq)]
pub struct Input {
    /// Its prior, with name and unit.
    pub prior: Prior,
    /// Smallest and largest value at which the posterior is not zero.
    pub ends: (f64, f64),
}

impl<'a> Models<'a> {
    /// Prepares both.
    ///
    /// # Errors
    /// [`Error::Input`] where every parameter is fixed.
    pub fn new(model: &'a PreparedModel) -> Result<Self> {
        if model.problem.priors.priors().is_empty() {
            return Err(Error::input(
                Place::setting(Setting::Fixed),
                "every parameter is fixed, so that the models have no input",
                "leave at least one parameter free",
            ));
        }
        Ok(Self { trajectory: Trajectory::new(model), posterior: Posterior::new(model) })
    }

    /// `trajectory`.
    pub fn trajectory(&self) -> &Trajectory<'a> {
        &self.trajectory
    }

    /// `posterior`.
    pub fn posterior(&self) -> &Posterior<'a> {
        &self.posterior
    }

    /// Answers a request; `body` is what the client sent.
    pub fn answer(&self, endpoint: Endpoint, body: &[u8]) -> Answer {
        protocol::answer(&[&self.trajectory as &dyn Served, &self.posterior], endpoint, body)
    }

    /// Bytes of the largest request that means something: a number takes 24 characters, a comma and a space at most.
    pub fn most_bytes(&self) -> usize {
        const FRAME: usize = 1 << 16;
        const NUMBER: usize = 32;
        let (n_inputs, n_rows) = (self.inputs().len(), self.trajectory.n_rows());
        FRAME + NUMBER * (n_rows + n_inputs + MOST_POINTS * (n_inputs + 1))
    }

    /// Inputs of `posterior`, in order. Those of `trajectory` are the first [`Models::n_of_trajectory`] of them.
    pub fn inputs(&self) -> Vec<Input> {
        self.posterior.inputs()
    }

    /// Number of inputs of `trajectory`: the parameters that are not of the noise.
    pub fn n_of_trajectory(&self) -> usize {
        self.trajectory.n_inputs()
    }

    /// Number of outputs of `trajectory`: the record's rows.
    pub fn n_rows(&self) -> usize {
        self.trajectory.n_rows()
    }
}
