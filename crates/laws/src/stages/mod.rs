//! What the stages of a model compute: command → load → mechanics → observation (physics §5), as numbers.
//!
//! A base law and effects write themselves into [`Stages`]; the reduced model evaluates them in closed form and the full-order model by its
//! own time stepping. Stages say which equations hold, never how they are solved.

mod load;
mod nonlinearity;
mod observation;
mod state_law;

pub use load::{
    LARGEST_EXPONENT, Load, LoadNumber, LoadUnit, MOST_NEWTON_STEPS, N_LOAD_NUMBERS, Switch, balanced_exponent,
};
pub use nonlinearity::{NonlinearFamily, Nonlinearity, YIELD_SMOOTHING};
pub use observation::{Approach, Observation};
pub use state_law::{Function, Operation, Quantity, State, StateFunction, StateLaw};

pub use crate::rheology::Leaf;
use crate::rheology::{BaseLaw, Beside, Element, SpreadTerm};
use base::error::Result;
use base::number::Dual;
use record::Force;
use std::sync::Arc;

/// One model at one point of its parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Stages {
    /// From the commanded to the acting force.
    pub load: Load,
    /// The base law, whose parameters have names; `None` where there is only [`Self::law`].
    pub base: Option<BaseLaw>,
    /// The law: elements in series, which all carry the stress.
    pub law: Vec<Element>,
    /// r in 1/s: the gel's stress is e^{−rt} times the law's, t from the record's start.
    pub softening_rate_per_s: Dual,
    /// Poisson ratio of the gel; `None` for the experiment's.
    pub poisson_ratio: Option<Dual>,
    /// What else changes the displacement field; not beside another Poisson ratio.
    pub spatial: Option<Spatial>,
    /// What a reduced model makes of it; empty until one has.
    pub spread: Option<Spread>,
    /// A quantity that depends on a state; beside nothing that changes the field, and no force gradient.
    pub state_law: Option<StateLaw>,
    /// From the robot's to the recorded position.
    pub observation: Observation,
}

/// An effect that changes the displacement field (physics §5).
#[derive(Debug, Clone, PartialEq)]
pub enum Spatial {
    /// A linear one: in part of the field something stands beside the law.
    Linear(LinearField),
    /// One body of the law is not linear.
    Nonlinear(Nonlinearity<Dual>),
    /// Strains may be large: the response is x(gF)/g of a fluid that the law linearises (physics §7.6).
    Large {
        /// g > 0.
        amplitude: Dual,
        /// Giesekus's α; 0 is Oldroyd-B.
        mobility: Dual,
    },
    /// Another program's law, at its parameters: all of the robot's displacement is its own.
    Outside(Vec<Dual>),
}

impl Spatial {
    /// Whether its reduced model is learnt for one record, about the law that fits it, and not built for a gel.
    pub fn is_learnt_for_record(&self) -> bool {
        matches!(self, Self::Large { .. })
    }

    /// Why a force that depends on the position cannot stand beside strains that may be large.
    pub const BARS_FEEDBACK: &str = "a force that depends on the position is not run with large displacements";
}

/// What stands beside the law, and where.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearField {
    /// Slug of the effect, which knows the field.
    pub effect: &'static str,
    /// The number that the field's shape depends on, such as a radius or a Poisson ratio; `None` where there is one shape only.
    pub shape: Option<Dual>,
    /// What stands beside the law there.
    pub beside: Beside,
}

/// The law spread over the gel: what a reduced model makes of [`Spatial`].
#[derive(Debug, Clone, PartialEq)]
pub enum Spread {
    /// The law in several places at once, all linear.
    Terms {
        /// What stands beside the law in every term.
        beside: Beside,
        /// The terms.
        terms: Vec<SpreadTerm>,
    },
    /// A law that is not linear, at few points.
    Stepped(Stepped),
}

/// A reduced model of a law that is not linear, which is stepped through a record.
pub trait FieldStepper: std::fmt::Debug + Send + Sync {
    /// By how much (m) the robot's displacement at every row (s) exceeds that of the same stages with a linear law, the limit from the left;
    /// `compliance_per_m` is the displacement per force at unit creep compliance.
    ///
    /// # Errors
    /// [`base::Error::Numerical`] where the law is none that is served, a force gradient is refused, or the balance is not found.
    fn excess_m(&self, stages: &Stages, compliance_per_m: f64, time_s: &[f64], force: Force<'_>) -> Result<Vec<f64>>;

    /// The same with the derivative in the direction that the stages carry.
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

/// A stepper, shared by all stages that it serves.
#[derive(Debug, Clone)]
pub struct Stepped(pub Arc<dyn FieldStepper>);

impl PartialEq for Stepped {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Stages {
    /// The law alone: the force acts as commanded, and the position is recorded as it is.
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
            observation: Observation::AS_IT_IS,
        }
    }
}
