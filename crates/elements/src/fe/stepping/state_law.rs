//! A quantity that depends on a state (physics §5.3), computed from its definition. The quantity is
//! an element's modulus, the force or the observed position. At every stage it is the value of a
//! function of the state at that stage.

use crate::fe::clock::CLOCK_ROUNDING;
use base::number::Dual;
use laws::rheology::Element;
use laws::stages::{ElementPlace, Operation, Quantity, State, StateLaw};
use nalgebra::{Matrix3, Vector3};

/// State at the end of the last step, for a law with a state-dependent quantity.
#[derive(Clone)]
pub(super) struct StateTracker<'a> {
    law: &'a StateLaw,
    /// Times at which force steps start to act, in s.
    steps_s: Vec<f64>,
    path_m: f64,
    largest_m: f64,
    velocity_m_per_s: f64,
    begin_m: f64,
    value: f64,
    /// Modulus or viscosity of the state-dependent element; NaN if instead the force or the
    /// position depends on the state.
    quantity: f64,
}

/// Data that the three stages of a step share.
pub(super) struct StateStage {
    pub step_s: f64,
    /// Times of the stages (s), counted from the record's start.
    pub time_s: Vector3<f64>,
    /// Times of the stages (s) on the record's clock.
    pub absolute_s: Vector3<f64>,
    pub force_n: Vector3<f64>,
    /// Inverse of the coefficient matrix of Radau's method.
    pub inverse: Matrix3<f64>,
    /// Position (m) at the start of the step.
    pub begin_m: f64,
}

impl<'a> StateTracker<'a> {
    pub fn new(law: &'a StateLaw, steps_s: Vec<f64>, elements: &[Element]) -> Self {
        let quantity = match law.quantity {
            Quantity::Element(leaf) => number_of(elements, leaf),
            Quantity::Force | Quantity::Position => f64::NAN,
        };
        let value = law.value(Dual::ZERO).value;
        Self { law, steps_s, path_m: 0.0, largest_m: 0.0, velocity_m_per_s: 0.0, begin_m: 0.0, value, quantity }
    }

    /// First guess, at every stage, of the value of the function of the state.
    pub(super) fn guess(&self) -> Vector3<f64> {
        Vector3::repeat(self.value)
    }

    /// Factor on the state-dependent element's stress at every stage, for given values of the
    /// function of the state.
    pub(super) fn element_factors(&self, values: &Vector3<f64>) -> Vector3<f64> {
        match (self.law.quantity, self.law.operation) {
            (Quantity::Element(_), Operation::Multiply) => *values,
            (Quantity::Element(_), Operation::Add) => values.map(|value| 1.0 + value / self.quantity),
            _ => Vector3::repeat(1.0),
        }
    }

    /// Force (N) at every stage, for given values of the function of the state.
    pub(super) fn force_n(&self, force_n: &Vector3<f64>, values: &Vector3<f64>) -> Vector3<f64> {
        match (self.law.quantity, self.law.operation) {
            (Quantity::Force, Operation::Multiply) => force_n.component_mul(values),
            (Quantity::Force, Operation::Add) => force_n + values,
            _ => *force_n,
        }
    }

    /// Observed position (m), including the function of the state if it acts on the observation.
    pub(super) fn observed_m(&self, position_m: f64, [start_s, now_s]: [f64; 2], force_n: f64) -> f64 {
        if self.law.quantity != Quantity::Position {
            return position_m;
        }
        let state = match self.law.state {
            State::Position | State::Strain => position_m,
            State::Path => self.path_m,
            State::Time => now_s - start_s,
            State::TimeSinceStep => now_s - self.last_step_s(now_s).unwrap_or(start_s),
            State::Velocity => self.velocity_m_per_s,
            State::Force => force_n,
            State::LargestExcursion => self.largest_m,
        };
        let value = self.law.value(Dual::constant(state)).value;
        if self.law.operation == Operation::Add { position_m + value } else { position_m * value }
    }

    /// Time (s) at which the last force step before `now_s` started to act.
    fn last_step_s(&self, now_s: f64) -> Option<f64> {
        let acting = self.steps_s.partition_point(|step_s| *step_s < now_s - CLOCK_ROUNDING * now_s.abs());
        acting.checked_sub(1).map(|last| self.steps_s[last])
    }

    /// Value of the state at every stage of a step. `position_m` is the position and `share_m` the
    /// element's contribution to it, both in m.
    fn states(&self, stage: &StateStage, position_m: &Vector3<f64>, share_m: &Vector3<f64>) -> Vector3<f64> {
        match self.law.state {
            State::Position => *position_m,
            State::Strain => *share_m,
            State::Path => {
                let (mut path_m, mut before) = (self.path_m + (stage.begin_m - self.begin_m).abs(), stage.begin_m);
                position_m.map(|x| {
                    path_m += (x - before).abs();
                    before = x;
                    path_m
                })
            }
            State::LargestExcursion => {
                let mut largest_m = self.largest_m;
                position_m.map(|x| {
                    largest_m = largest_m.max(x.abs());
                    largest_m
                })
            }
            State::Velocity => stage.inverse * (position_m.add_scalar(-stage.begin_m)) / stage.step_s,
            State::Time => stage.time_s,
            State::TimeSinceStep => {
                let start_s = stage.absolute_s[0] - stage.time_s[0];
                stage.absolute_s.add_scalar(-self.last_step_s(stage.absolute_s[0]).unwrap_or(start_s))
            }
            State::Force => stage.force_n,
        }
    }

    /// Value of the function of the state at every stage, for the arguments of [`Self::states`].
    pub(super) fn values(&self, stage: &StateStage, position_m: &Vector3<f64>, share_m: &Vector3<f64>) -> Vector3<f64> {
        self.states(stage, position_m, share_m).map(|state| self.law.value(Dual::constant(state)).value)
    }

    /// Advances the state to the end of a step.
    pub(super) fn take(&mut self, stage: &StateStage, position_m: &Vector3<f64>, values: &Vector3<f64>) {
        self.path_m += (stage.begin_m - self.begin_m).abs();
        let mut before = stage.begin_m;
        for x in position_m.iter() {
            self.path_m += (x - before).abs();
            self.largest_m = self.largest_m.max(x.abs());
            before = *x;
        }
        self.velocity_m_per_s = (stage.inverse * (position_m.add_scalar(-stage.begin_m)))[2] / stage.step_s;
        self.begin_m = before;
        self.value = values[2];
    }
}

/// Modulus or viscosity of the element at `leaf`.
fn number_of(elements: &[Element], leaf: ElementPlace) -> f64 {
    let element = match (elements.get(leaf.body), leaf.part) {
        (Some(Element::Parallel(parts)), Some(part)) => parts.get(part),
        (entry, _) => entry,
    };
    match element {
        Some(Element::Spring { modulus_pa } | Element::Springpot { modulus_pa, .. }) => modulus_pa.value,
        Some(Element::Dashpot { viscosity_pa_s }) => viscosity_pa_s.value,
        _ => f64::NAN,
    }
}
