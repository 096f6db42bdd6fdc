//! Numbers of a model's stages: command → load → mechanics → observation (physics §5).
//!
//! A base law and effects write themselves into [`Stages`]. The reduced model evaluates them in closed form, the full-order model by time stepping.
//! Stages define the equations, not their solution.

mod load;
mod nonlinearity;
mod observation;
mod state_law;

pub use load::{
    Load, LoadParameter, LoadUnit, MAX_GRADIENT_EXPONENT, MAX_NEWTON_STEPS, N_LOAD_PARAMETERS, Switch,
    balanced_exponent,
};
pub use nonlinearity::{NonlinearFamily, Nonlinearity, YIELD_SMOOTHING};
pub use observation::{DriftApproach, Observation};
pub use state_law::{Function, Operation, Quantity, State, StateFunction, StateLaw};

pub use crate::rheology::ElementPlace;
use crate::rheology::{AdditionalTerm, BaseLaw, Element, SpreadTerm};
use base::error::Result;
use base::number::Dual;
use record::Force;
use std::sync::Arc;

/// One model at one parameter point.
#[derive(Debug, Clone, PartialEq)]
pub struct Stages {
    /// Transformation of the commanded into the acting force.
    pub load: Load,
    /// Base law, whose parameters have names; `None` if only [`Self::law`] is given.
    pub base: Option<BaseLaw>,
    /// Law: elements in series, which all carry the same stress.
    pub law: Vec<Element>,
    /// r in 1/s: the gel's stress is e^{−rt} times the law's stress, t from the record's start.
    pub softening_rate_per_s: Dual,
    /// Poisson ratio of the gel; `None` for the experiment's value.
    pub poisson_ratio: Option<Dual>,
    /// Effect that changes the displacement field. It excludes another Poisson ratio.
    pub spatial: Option<Spatial>,
    /// Reduced model of [`Self::spatial`]; empty until one is attached.
    pub spread: Option<ReducedField>,
    /// Quantity that depends on a state. It excludes effects on the field and a force gradient.
    pub state_law: Option<StateLaw>,
    /// Transformation of the robot's into the recorded position.
    pub observation: Observation,
}

/// An effect that changes the displacement field (physics §5).
#[derive(Debug, Clone, PartialEq)]
pub enum Spatial {
    /// Linear effect: part of the field has a second element beside the law.
    Linear(LinearField),
    /// Nonlinear effect: one body of the law is nonlinear.
    Nonlinear(Nonlinearity<Dual>),
    /// Large strains: the response is x(gF)/g of a fluid whose linearisation is the law (physics §7.6).
    Large {
        /// g > 0.
        amplitude: Dual,
        /// Giesekus's α; 0 is Oldroyd-B.
        mobility: Dual,
    },
    /// Law of an external program, at these parameters. That program computes the robot's whole displacement.
    External(Vec<Dual>),
}

impl Spatial {
    /// Returns `true` if its reduced model is trained for one record, around the law that fits it, instead of once for a gel.
    pub fn is_trained_per_record(&self) -> bool {
        matches!(self, Self::Large { .. })
    }

    /// Reason why a position-dependent force cannot be combined with large strains.
    pub const EXCLUDES_FEEDBACK: &str =
        "a force that depends on the position cannot be combined with large displacements";
}

/// Element beside the law, and the part of the field that has it.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearField {
    /// Slug of the effect, which defines the part of the field.
    pub effect: &'static str,
    /// Number on which the field's shape depends, such as a radius or a Poisson ratio; `None` if there is only one shape.
    pub shape: Option<Dual>,
    /// Element beside the law in that part.
    pub beside: AdditionalTerm,
}

/// Reduced model of [`Spatial`]: the law distributed over the gel.
#[derive(Debug, Clone, PartialEq)]
pub enum ReducedField {
    /// Linear: the law at several places.
    Terms {
        /// Element beside the law, the same in every term.
        beside: AdditionalTerm,
        /// Terms of the law.
        terms: Vec<SpreadTerm>,
    },
    /// Nonlinear: a law evaluated at few points.
    Stepped(SharedStepper),
}

/// Reduced model of a nonlinear law, which is stepped through a record.
pub trait FieldStepper: std::fmt::Debug + Send + Sync {
    /// Displacement of the robot at every row (s), in m, minus that of the same stages with a linear law. At a jump it is the limit from the left.
    /// `compliance_per_m` is the displacement per force at unit creep compliance.
    ///
    /// # Errors
    /// [`base::Error::Numerical`] where the model does not cover the law, the force gradient is too strong, or the balance is not found.
    fn excess_m(&self, stages: &Stages, compliance_per_m: f64, time_s: &[f64], force: Force<'_>) -> Result<Vec<f64>>;

    /// [`Self::excess_m`] with the derivative in the direction that the stages carry.
    ///
    /// # Errors
    /// As [`Self::excess_m`].
    fn excess_dual_m(
        &self,
        stages: &Stages,
        compliance_per_m: f64,
        time_s: &[f64],
        force: Force<'_>,
    ) -> Result<Vec<Dual>>;
}

/// Stepper, shared by all stages that use it.
#[derive(Debug, Clone)]
pub struct SharedStepper(pub Arc<dyn FieldStepper>);

impl PartialEq for SharedStepper {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Stages {
    /// Stages of the law alone: the force acts as commanded, and the recorded position is the robot's.
    pub fn of_law(law: Vec<Element>) -> Self {
        Self {
            load: Load::COMMANDED,
            base: None,
            law,
            softening_rate_per_s: Dual::ZERO,
            poisson_ratio: None,
            spatial: None,
            spread: None,
            state_law: None,
            observation: Observation::IDENTITY,
        }
    }
}
