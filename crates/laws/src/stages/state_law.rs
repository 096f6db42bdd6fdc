//! Forces, positions and law elements that are functions of a state of the experiment, such as the path or the time (physics
//! §5.3).

use crate::rheology::ElementPlace;
use base::number::Dual;

/// Quantity of the model that may depend on a state of the experiment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Force on the robot, after all other load effects.
    Force,
    /// Observed position of the robot, before all other observation effects.
    Position,
    /// Modulus or viscosity of one element of the law.
    Element(ElementPlace),
}

base::named_enum! {
    /// State on which a quantity may depend. All states are zero before the record.
    #[derive(Hash)]
    pub enum State {
        /// Position of the robot, in m.
        Position = "position",
        /// Path ∫ |dx| that the robot has travelled since the record's start, in m.
        Path = "path",
        /// Time since the record's start, in s.
        Time = "time",
        /// Time since the last force step began to act, in s. Before the first force step it is the time since the record's start.
        TimeSinceStep = "time_since_step",
        /// Velocity of the robot, in m/s.
        Velocity = "velocity",
        /// Force on the robot in N, before the change that the function of this state causes.
        Force = "force",
        /// Largest |x| since the record's start, with x the robot's position, in m.
        LargestExcursion = "largest_excursion",
        /// Strain of one body of the law, as its contribution to the robot's displacement in m. The body is the one whose element
        /// depends on the state.
        Strain = "strain",
    }
    /// Name of the state in files and documents.
    pub fn name
}

impl State {
    /// Returns `true` if the state can be negative.
    pub fn has_sign(self) -> bool {
        matches!(self, Self::Position | Self::Velocity | Self::Force | Self::Strain)
    }

    /// Returns the state with the given name; `None` if there is none.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.name() == name)
    }

    /// Unit of the state in functions that users write.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Position | Self::Path | Self::LargestExcursion | Self::Strain => "m",
            Self::Time | Self::TimeSinceStep => "s",
            Self::Velocity => "m/s",
            Self::Force => "N",
        }
    }

    /// Returns `true` if the state depends on the robot's motion. A quantity that depends on such a state must be solved together
    /// with the motion.
    pub fn depends_on_motion(self) -> bool {
        !matches!(self, Self::Time | Self::TimeSinceStep | Self::Force)
    }
}

/// Operation by which a function of a state changes a quantity of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Operation {
    /// The quantity is multiplied by the function's value.
    Multiply,
    /// The function's value is added to the quantity, in the quantity's unit.
    Add,
}

/// Function of a state and of parameters, which changes a quantity of the model.
pub trait StateFunction: std::fmt::Debug + Send + Sync {
    /// Returns the function's value at a state and at parameters, all in SI units, with its derivative.
    fn value(&self, state: Dual, parameters: &[Dual]) -> Dual;

    /// Writes the derivative of the value with respect to each parameter to `slopes`.
    fn by_parameters(&self, state: f64, parameters: &[Dual], slopes: &mut [f64]) {
        let mut moving: Vec<Dual> = parameters.iter().map(|parameter| Dual::constant(parameter.value)).collect();
        for (k, slope) in slopes.iter_mut().enumerate() {
            moving[k].derivative = 1.0;
            *slope = self.value(Dual::constant(state), &moving).derivative;
            moving[k].derivative = 0.0;
        }
    }
}

/// Reference to a [`StateFunction`] that lives as long as the program. Two references are equal if they point to one function.
#[derive(Debug, Clone, Copy)]
pub struct Function(pub &'static dyn StateFunction);

impl PartialEq for Function {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::addr_eq(self.0, other.0)
    }
}

/// Dependence of one quantity of the model on a state, by a function.
#[derive(Debug, Clone, PartialEq)]
pub struct StateLaw {
    /// Quantity that depends on the state.
    pub quantity: Quantity,
    /// State on which the quantity depends.
    pub state: State,
    /// Operation by which the function changes the quantity.
    pub operation: Operation,
    /// Function of the state.
    pub function: Function,
    /// Parameters of the function, in SI units.
    pub parameters: Vec<Dual>,
}

impl StateLaw {
    /// Returns the value of the function at a state, for [`Self::parameters`].
    pub fn value(&self, state: Dual) -> Dual {
        self.function.0.value(state, &self.parameters)
    }
}
