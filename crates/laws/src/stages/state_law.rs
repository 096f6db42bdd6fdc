//! A quantity that depends on a state of the experiment (physics §5.3): which quantity, which state, and how.

use crate::rheology::Leaf;
use base::number::Dual;

/// What depends on the state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// The force on the robot, after all other effects of load.
    Force,
    /// The robot's position as it is observed, before all other effects of observation.
    Position,
    /// The modulus or the viscosity of an element of the law.
    Element(Leaf),
}

/// What it depends on; all are zero before the record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum State {
    /// The robot's position, in m.
    Position,
    /// ∫ |dx|, the path that the robot has travelled, in m.
    Path,
    /// Time since the record's start, in s.
    Time,
    /// Time since the last force step came to act, in s; before the first, since the record's start.
    TimeSinceStep,
    /// The robot's velocity, in m/s.
    Velocity,
    /// The force before the quantity's own dependence, in N.
    Force,
    /// The largest |x| so far, in m.
    LargestExcursion,
    /// By how much the element's own body is strained: its share of the displacement, in m.
    Strain,
}

impl State {
    /// All of them, with their names.
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

    /// Name in files and documents.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(state, _)| *state == self).map_or("", |(_, name)| name)
    }

    /// Whether it may be below 0.
    pub fn has_sign(self) -> bool {
        matches!(self, Self::Position | Self::Velocity | Self::Force | Self::Strain)
    }

    /// The state of a name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(_, own)| *own == name).map(|(state, _)| *state)
    }

    /// Unit in which functions of it are written.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Position | Self::Path | Self::LargestExcursion | Self::Strain => "m",
            Self::Time | Self::TimeSinceStep => "s",
            Self::Velocity => "m/s",
            Self::Force => "N",
        }
    }

    /// Whether it follows from where the robot is, so that the quantity and the robot's motion have to be found together.
    pub fn is_of_motion(self) -> bool {
        !matches!(self, Self::Time | Self::TimeSinceStep | Self::Force)
    }
}

/// How the function enters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Operation {
    /// The quantity times the function.
    Multiply,
    /// The quantity plus the function, in the quantity's unit.
    Add,
}

/// A function of a state.
pub trait StateFunction: std::fmt::Debug + Send + Sync {
    /// Its value at a state and at parameters (SI), with the derivative that they carry.
    fn value(&self, state: Dual, parameters: &[Dual]) -> Dual;

    /// Its derivatives by the parameters at a state.
    fn by_parameters(&self, state: f64, parameters: &[Dual], slopes: &mut [f64]) {
        let mut moving: Vec<Dual> = parameters.iter().map(|own| Dual::constant(own.value)).collect();
        for (k, slope) in slopes.iter_mut().enumerate() {
            moving[k].derivative = 1.0;
            *slope = self.value(Dual::constant(state), &moving).derivative;
            moving[k].derivative = 0.0;
        }
    }
}

/// A function that lives as long as the program.
#[derive(Debug, Clone, Copy)]
pub struct Function(pub &'static dyn StateFunction);

impl PartialEq for Function {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::addr_eq(self.0, other.0)
    }
}

/// A quantity that depends on a state.
#[derive(Debug, Clone, PartialEq)]
pub struct StateLaw {
    /// What depends.
    pub quantity: Quantity,
    /// On what.
    pub state: State,
    /// How it enters.
    pub operation: Operation,
    /// The function.
    pub function: Function,
    /// Its parameters (SI).
    pub parameters: Vec<Dual>,
}

impl StateLaw {
    /// The function's value.
    pub fn value(&self, state: Dual) -> Dual {
        self.function.0.value(state, &self.parameters)
    }
}
