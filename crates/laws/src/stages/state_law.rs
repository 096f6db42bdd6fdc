//! Quantities that depend on a state of the experiment by a function (physics §5.3).

use crate::rheology::ElementPlace;
use base::number::Dual;

/// Quantity that may depend on a state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Force on the robot, after all other load effects.
    Force,
    /// Observed position of the robot, before all other observation effects.
    Position,
    /// Modulus or viscosity of one element of the law.
    Element(ElementPlace),
}

/// State on which a quantity may depend. All states are zero before the record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum State {
    /// Position of the robot, in m.
    Position,
    /// Path ∫ |dx| that the robot has travelled since the record's start, in m.
    Path,
    /// Time since the record's start, in s.
    Time,
    /// Time since the last force step began to act, in s. Before the first force step it is the time since the record's start.
    TimeSinceStep,
    /// Velocity of the robot, in m/s.
    Velocity,
    /// Force on the robot in N, without the change by the state law itself.
    Force,
    /// Largest |x| since the record's start, with x the robot's position, in m.
    LargestExcursion,
    /// Strain of the body that has the element, given as its contribution to the robot's displacement in m.
    Strain,
}

impl State {
    /// All states, each with its name.
    pub const ALL: [(Self, &'static str); 8] = [
        (Self::Position, "position"),
        (Self::Path, "path"),
        (Self::Time, "time"),
        (Self::TimeSinceStep, "time_since_step"),
        (Self::Velocity, "velocity"),
        (Self::Force, "force"),
        (Self::LargestExcursion, "largest_excursion"),
        (Self::Strain, "strain"),
    ];

    /// Name of the state in files and documents.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(state, _)| *state == self).map_or("", |(_, name)| name)
    }

    /// Returns `true` if the state can be negative.
    pub fn has_sign(self) -> bool {
        matches!(self, Self::Position | Self::Velocity | Self::Force | Self::Strain)
    }

    /// State with this name; `None` if there is none.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(_, state_name)| *state_name == name).map(|(state, _)| *state)
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

    /// Returns `true` if the state depends on the robot's motion. Quantity and motion must then be solved together.
    pub fn depends_on_motion(self) -> bool {
        !matches!(self, Self::Time | Self::TimeSinceStep | Self::Force)
    }
}

/// Operation by which the function changes the quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Operation {
    /// Multiplies the quantity by the function.
    Multiply,
    /// Adds the function to the quantity, in the quantity's unit.
    Add,
}

/// Function of a state and of parameters.
pub trait StateFunction: std::fmt::Debug + Send + Sync {
    /// Returns the value at a state and parameters (SI). It carries their derivative.
    fn value(&self, state: Dual, parameters: &[Dual]) -> Dual;

    /// Writes the derivative by each parameter, at a state, to `slopes`.
    fn by_parameters(&self, state: f64, parameters: &[Dual], slopes: &mut [f64]) {
        let mut moving: Vec<Dual> = parameters.iter().map(|parameter| Dual::constant(parameter.value)).collect();
        for (k, slope) in slopes.iter_mut().enumerate() {
            moving[k].derivative = 1.0;
            *slope = self.value(Dual::constant(state), &moving).derivative;
            moving[k].derivative = 0.0;
        }
    }
}

/// Function that lives as long as the program.
#[derive(Debug, Clone, Copy)]
pub struct Function(pub &'static dyn StateFunction);

impl PartialEq for Function {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::addr_eq(self.0, other.0)
    }
}

/// Quantity that depends on a state.
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
