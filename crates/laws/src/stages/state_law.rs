//! Quantity that depends on a state of the experiment (physics §5.3): the quantity, the state and the function.

use crate::rheology::ElementPlace;
use base::number::Dual;

/// Quantity that depends on the state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Force on the robot, after all other effects of load.
    Force,
    /// Observed position of the robot, before all other effects of observation.
    Position,
    /// Modulus or viscosity of one element of the law.
    Element(ElementPlace),
}

/// State on which the quantity depends. All states are zero before the record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum State {
    /// Position of the robot, in m.
    Position,
    /// Path ∫ |dx| that the robot has travelled, in m.
    Path,
    /// Time since the record's start, in s.
    Time,
    /// Time since the last force step began to act, in s; before the first one, time since the record's start.
    TimeSinceStep,
    /// Velocity of the robot, in m/s.
    Velocity,
    /// Force before the quantity's own dependence, in N.
    Force,
    /// Largest |x| so far, in m.
    LargestExcursion,
    /// Strain of the element's own body, as its share of the displacement, in m.
    Strain,
}

impl State {
    /// All states, with their names.
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

    /// State with this name, if there is one.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(_, state_name)| *state_name == name).map(|(state, _)| *state)
    }

    /// Unit of the state in written functions.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Position | Self::Path | Self::LargestExcursion | Self::Strain => "m",
            Self::Time | Self::TimeSinceStep => "s",
            Self::Velocity => "m/s",
            Self::Force => "N",
        }
    }

    /// Returns `true` if the state follows from the robot's position, so that quantity and motion must be solved together.
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

/// Function of a state.
pub trait StateFunction: std::fmt::Debug + Send + Sync {
    /// Value at a state and at parameters (SI), with the derivative that they carry.
    fn value(&self, state: Dual, parameters: &[Dual]) -> Dual;

    /// Writes the derivatives with respect to the parameters at a state to `slopes`.
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
    /// Quantity that depends.
    pub quantity: Quantity,
    /// State on which it depends.
    pub state: State,
    /// Operation by which the function enters.
    pub operation: Operation,
    /// Function of the state.
    pub function: Function,
    /// Parameters of the function (SI).
    pub parameters: Vec<Dual>,
}

impl StateLaw {
    /// Value of the function at a state.
    pub fn value(&self, state: Dual) -> Dual {
        self.function.0.value(state, &self.parameters)
    }
}
