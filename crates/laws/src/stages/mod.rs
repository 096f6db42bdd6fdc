//! Equations of a model at one parameter point, in stages from the commanded force over the acting force and the gel to the
//! recorded position (physics §5).
//!
//! A base law and its effects write their equations into [`Stages`]. The reduced model solves the equations in closed form, the
//! full-order model by time stepping.

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

/// Equations of one model at one parameter point.
#[derive(Debug, Clone, PartialEq)]
pub struct Stages {
    /// Transformation of the commanded force into the acting force.
    pub load: Load,
    /// Base law with named parameters; `None` if only [`Self::law`] is given.
    pub base: Option<BaseLaw>,
    /// Elements of the gel's law, in series. Each element carries the whole stress.
    pub law: Vec<Element>,
    /// Softening rate r in 1/s. The gel's stress is e^{−rt} times the law's stress, with t from the record's start.
    pub softening_rate_per_s: Dual,
    /// Poisson ratio of the gel; `None` for the experiment's value.
    pub poisson_ratio: Option<Dual>,
    /// Effect that changes the displacement field; `None` without such an effect. It cannot be combined with a changed Poisson
    /// ratio.
    pub spatial: Option<Spatial>,
    /// Reduced model of [`Self::spatial`]; `None` until one is attached.
    pub spread: Option<ReducedField>,
    /// Force, position or law element that depends on a state such as the path; `None` if there is none. It cannot be combined
    /// with effects on the displacement field or with a force gradient.
    pub state_law: Option<StateLaw>,
    /// Transformation of the robot's position into the recorded position.
    pub observation: Observation,
    /// `true` if the robot's position is prescribed and the force is measured. The load then transforms the commanded position, and the observation the force.
    /// Wherever names and units say force, the position in m is meant, and the other way round.
    pub is_position_controlled: bool,
}

/// Effect that changes the displacement field (physics §5).
#[derive(Debug, Clone, PartialEq)]
pub enum Spatial {
    /// Linear effect: one region of the gel has an additional element in parallel with the law.
    Linear(LinearField),
    /// Nonlinear effect: one element of the law is nonlinear.
    Nonlinear(Nonlinearity<Dual>),
    /// Large strains. The robot's position is x(gF)/g, with F the force and g a scale factor (physics §7.6). x(F) is the response
    /// of a fluid that follows the law at small strains.
    Large {
        /// Scale factor g > 0 of the force, which sets the size of the strains.
        amplitude: Dual,
        /// Mobility α of a Giesekus fluid; 0 for an Oldroyd-B fluid.
        mobility: Dual,
    },
    /// Law of an external program, with its parameter values. The program computes the robot's displacement.
    External(Vec<Dual>),
}

impl Spatial {
    /// Returns `true` if the effect's reduced model is trained for each record, at parameters near the record's best fit. Other
    /// reduced models are trained once for each gel.
    pub fn is_trained_per_record(&self) -> bool {
        matches!(self, Self::Large { .. })
    }

    /// Reason why a position-dependent force cannot be combined with large strains.
    pub const EXCLUDES_FEEDBACK: &str =
        "a force that depends on the position cannot be combined with large displacements";
}

/// Linear effect on the displacement field. One region of the gel has an additional element in parallel with the law.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearField {
    /// Name of the effect in files. It determines the region.
    pub effect: &'static str,
    /// Parameter on which the shape of the field depends, such as a radius or a Poisson ratio; `None` if the shape is fixed.
    pub shape: Option<Dual>,
    /// Element that the region has in parallel with the law.
    pub beside: AdditionalTerm,
}

/// Reduced model of an effect on the displacement field.
#[derive(Debug, Clone, PartialEq)]
pub enum ReducedField {
    /// Reduced model of a linear effect, as a sum of terms.
    Terms {
        /// Additional element in parallel with the law in every term.
        beside: AdditionalTerm,
        /// Terms of the sum. Each has a weight and a factor of the additional element.
        terms: Vec<SpreadTerm>,
    },
    /// Reduced model that is evaluated for a whole record: of a nonlinear effect, of large strains or of an external program.
    Stepped(SharedStepper),
}

/// Reduced model that computes the excess displacement of a law for a whole record.
pub trait FieldStepper: std::fmt::Debug + Send + Sync {
    /// Returns the excess displacement of the robot in m at every row: its displacement minus that of a linear law under the same
    /// force. `time_s` are the times of the rows in s. At a jump of the force the result is the limit from the left.
    /// `compliance_per_m` is the displacement per force at unit creep compliance.
    ///
    /// # Errors
    /// [`base::Error::Numerical`] if the model does not cover the law, if the force gradient is too strong, or if no balance of
    /// forces is found.
    fn excess_m(&self, stages: &Stages, compliance_per_m: f64, time_s: &[f64], force: Force<'_>) -> Result<Vec<f64>>;

    /// [`Self::excess_m`] with its derivative along the direction of the derivatives in `stages`.
    ///
    /// # Errors
    /// Errors of [`Self::excess_m`].
    fn excess_dual_m(
        &self,
        stages: &Stages,
        compliance_per_m: f64,
        time_s: &[f64],
        force: Force<'_>,
    ) -> Result<Vec<Dual>>;

    /// Stepper that needs no training, if this one would first be trained for these stages; `None` if it is ready. It serves trajectories
    /// that are needed once, and differs by the error of the training.
    fn untrained(&self, _stages: &Stages, _compliance_per_m: f64) -> Option<SharedStepper> {
        None
    }
}

/// Reduced model that all [`Stages`] with one effect share.
#[derive(Debug, Clone)]
pub struct SharedStepper(pub Arc<dyn FieldStepper>);

impl PartialEq for SharedStepper {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Stages {
    /// Replaces a stepper that would first be trained by the one that needs no training, and returns whether it did.
    pub fn avoid_training(&mut self, compliance_per_m: f64) -> bool {
        let Some(ReducedField::Stepped(SharedStepper(stepper))) = &self.spread else { return false };
        let Some(untrained) = stepper.untrained(self, compliance_per_m) else { return false };
        self.spread = Some(ReducedField::Stepped(untrained));
        true
    }

    /// Returns stages with a law and no effects. The force acts as commanded, and the recorded position is the robot's position.
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
            is_position_controlled: false,
        }
    }
}
