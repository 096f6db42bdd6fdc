//! Newton's method for the pseudo-stress, the state and the position at the nodes of a step, which depend on each other. The pseudo-stress
//! is the stress that replaces the state-dependence of a quantity.

use super::super::collocation::{END, N_NODES};
use super::super::numbers::Real;
use super::{Carried, StateLawRun, size};
use base::error::{Error, Result};
use base::number::{Dual, Scalar};
use laws::rheology::Element;
use laws::stages::{ElementPlace, Operation, Quantity, State, StateLaw};

/// Largest number of Newton steps in one time step.
const MOST_NEWTON_STEPS: usize = 40;
/// Size of a Newton step, relative to the largest force, after which the iteration ends. The remaining error is of the order of
/// its square, which is below rounding. Numbers with a derivative take one more step.
const LAST_STEP: f64 = 1e-8;
/// Smallest fraction of a Newton step that is tried.
const LEAST_SHARE: f64 = 1e-3;

/// Equation for the pseudo-stress R, which replaces the state-dependence of a quantity. It contains the force F, the body's strain ε and
/// the function φ of the state.
#[derive(Clone, Copy)]
pub enum Source<T> {
    /// State-dependent force F. The pseudo-stress is F (φ − 1), with φ the function of the state, or φ itself if the function is added.
    Force,
    /// State-dependent spring in parallel with other elements. The pseudo-stress is −E (φ − 1) ε, with E the spring's modulus, φ the
    /// function of the state and ε the body's strain. The value is E divided by the compliance (displacement per force at unit creep
    /// compliance).
    Spring(T),
    /// Other state-dependent element. The pseudo-stress is (1/φ − 1)(s − E ε), with φ the function of the state, s the stress, E the
    /// modulus of the parallel springs and ε the body's strain. The value is E divided by the compliance (displacement per force at unit
    /// creep compliance).
    Other(T),
    /// State-dependent position. There is no pseudo-stress, because the function changes the position directly.
    Position,
}

/// Force and time at `N` nodes of a step, and the response there as a linear function of the pseudo-stress.
pub struct Nodes<T, const N: usize> {
    pub force_n: [T; N],
    pub growth: [T; N],
    pub time_s: [T; N],
    /// Position, and the state-dependent body's contribution to it. Both are without pseudo-stress and before multiplication by the
    /// softening factor.
    pub known: [[T; N]; 2],
    /// Derivatives at node i (row) by the pseudo-stress at node j (column). They are the same for the position and for the body's
    /// contribution to it.
    pub by_feedback: [[T; N]; N],
}

impl<T: Real, const N: usize> Nodes<T, N> {
    /// Returns the position (`which` 0) or the state-dependent body's contribution to it (`which` 1) at the nodes, for the pseudo-stress
    /// `feedback`.
    fn answers(&self, which: usize, feedback: &[T; N]) -> [T; N] {
        std::array::from_fn(|i| {
            let answered = (0..N).fold(self.known[which][i], |sum, j| sum + self.by_feedback[i][j] * feedback[j]);
            self.growth[i] * answered
        })
    }
}

/// Residual of the equation for the pseudo-stress at the nodes, with its derivatives.
pub struct Imbalance<T, const N: usize> {
    pub left: [T; N],
    /// Derivatives of the residual at node i (row) by the pseudo-stress at node j (column), with the opposite sign.
    pub matrix: [[f64; N]; N],
    pub states: [f64; N],
    /// Derivatives of the state at node i (row) by the position at node j (column).
    pub by_position: [[f64; N]; N],
    /// Derivatives of the function by the state, at each node.
    pub by_state: [f64; N],
    /// Derivatives of the pseudo-stress that the equation demands, by the function's value.
    pub by_value: [f64; N],
    /// Derivatives of the pseudo-stress that the equation demands, by the body's strain.
    pub by_strain: [f64; N],
}

/// Returns the equation for the pseudo-stress, and the quantity's value if the function is added to it.
pub fn source<T: Real>(law: &StateLaw, elements: &[Element], compliance_per_m: T) -> Result<(Source<T>, Option<T>)> {
    let Quantity::Element(ElementPlace { body, part }) = law.quantity else {
        return Ok((if law.quantity == Quantity::Force { Source::Force } else { Source::Position }, None));
    };
    let entry = elements.get(body).ok_or_else(no_element)?;
    let (leaf, beside): (&Element, Vec<&Element>) = match (entry, part) {
        (Element::Parallel(parts), Some(part)) => {
            let leaf = parts.get(part).ok_or_else(no_element)?;
            (leaf, parts.iter().enumerate().filter(|(place, _)| *place != part).map(|(_, other)| other).collect())
        }
        (leaf, None) => (leaf, Vec::new()),
        _ => return Err(no_element()),
    };
    let number = match leaf {
        Element::Spring { modulus_pa } | Element::Springpot { modulus_pa, .. } => T::from_dual(*modulus_pa),
        Element::Dashpot { viscosity_pa_s } => T::from_dual(*viscosity_pa_s),
        _ => return Err(no_element()),
    };
    let quantity = (law.operation == Operation::Add).then_some(number);
    if let (Element::Spring { .. }, false) = (leaf, beside.is_empty()) {
        return Ok((Source::Spring(number / compliance_per_m), quantity));
    }
    let mut springs = T::constant(0.0);
    for other in beside {
        match other {
            Element::Spring { modulus_pa } => springs += T::from_dual(*modulus_pa),
            _ => {
                return Err(Error::numerical(
                    "an element in parallel with dashpots or springpots cannot depend on a state",
                    "make the spring of that body depend on it, or write the law with bodies in series",
                ));
            }
        }
    }
    Ok((Source::Other(springs / compliance_per_m), quantity))
}

pub fn no_element() -> Error {
    Error::numerical("the law has no element for this effect's quantity", "name another element")
}

impl<T: Real> StateLawRun<'_, T> {
    /// Returns the pseudo-stress and the positions at the nodes, and the velocity at the last node. Newton's method starts from `guess`.
    /// The results carry derivatives if the number type does.
    pub fn balance<const N: usize>(
        &self,
        nodes: &Nodes<T, N>,
        now: &Carried<T>,
        length_s: Option<T>,
        guess: [T; N],
    ) -> Result<([T; N], [T; N], T)> {
        let ended = |feedback: [T; N]| {
            let position_m = nodes.answers(0, &feedback);
            let velocity = self.velocity(now, &position_m, length_s);
            Ok((feedback, position_m, velocity))
        };
        if matches!(self.source, Source::Position) {
            return ended([T::constant(0.0); N]);
        }
        // If the state does not depend on the motion, the equations are linear and one Newton step solves them.
        let is_linear = !self.law.state.depends_on_motion() && !T::CARRIES;
        let mut feedback = guess;
        let mut before = f64::INFINITY;
        let mut last_step: Option<([T; N], f64)> = None;
        let mut is_last = false;
        for _ in 0..MOST_NEWTON_STEPS {
            let Imbalance { left, matrix, .. } = self.imbalance(nodes, now, &feedback, length_s);
            let size = left.iter().fold(0.0_f64, |most, left| most.max(left.value().abs()));
            // A Newton step that increases the residual, or makes it NaN, is halved.
            if let Some((step, share)) =
                last_step.filter(|(_, share)| (size.is_nan() || size > before) && *share > LEAST_SHARE && !is_last)
            {
                feedback = std::array::from_fn(|i| feedback[i] + step[i] * (-0.5 * share));
                last_step = Some((step, 0.5 * share));
                continue;
            }
            if !size.is_finite() {
                break;
            }
            let step = solved(matrix, left).ok_or_else(|| no_balance(now.now_s.value()))?;
            feedback = std::array::from_fn(|i| feedback[i] + step[i]);
            let is_small = step.iter().all(|step| step.value().abs() <= LAST_STEP * self.largest_n);
            if is_last || is_linear || (is_small && !T::CARRIES) {
                return ended(feedback);
            }
            is_last = is_small;
            (before, last_step) = (size, Some((step, 1.0)));
        }
        Err(no_balance(now.now_s.value()))
    }

    /// Returns the residual of the equation for the pseudo-stress at the nodes, with its derivatives.
    pub fn imbalance<const N: usize>(
        &self,
        nodes: &Nodes<T, N>,
        now: &Carried<T>,
        feedback: &[T; N],
        length_s: Option<T>,
    ) -> Imbalance<T, N> {
        let [position_m, share_m] = [0, 1].map(|which| nodes.answers(which, feedback));
        let (states, by_position) = self.states(nodes, now, &position_m, &share_m, length_s);
        let mut at = Imbalance {
            left: [T::constant(0.0); N],
            matrix: [[0.0; N]; N],
            states: states.map(|state| state.value()),
            by_position,
            by_state: [0.0; N],
            by_value: [0.0; N],
            by_strain: [0.0; N],
        };
        for i in 0..N {
            let strain = share_m[i] / nodes.growth[i];
            let slope = self.law.function.0.value(Dual::variable(states[i].value()), &self.constants);
            let value =
                if T::CARRIES { T::from_dual(self.law.value(states[i].carried())) } else { T::from_dual(slope) };
            let (target, by_value, by_strain) = self.feedback(value, nodes.force_n[i], strain);
            at.left[i] = target - feedback[i];
            (at.by_state[i], at.by_value[i], at.by_strain[i]) = (slope.derivative, by_value, by_strain);
            // `state` holds the derivatives of the state at node i by the pseudo-stress at every node.
            let mut state = [0.0; N];
            for k in (0..N).filter(|k| by_position[i][*k] != 0.0) {
                let by_answer = by_position[i][k] * nodes.growth[k].value();
                (0..N).for_each(|j| state[j] += by_answer * nodes.by_feedback[k][j].value());
            }
            for j in 0..N {
                let by_state = by_value * slope.derivative * state[j];
                at.matrix[i][j] = f64::from(u8::from(i == j)) - by_state - by_strain * nodes.by_feedback[i][j].value();
            }
        }
        at
    }

    /// Returns the pseudo-stress that the equation demands for a value of the function, and its derivatives by this value and by the
    /// strain.
    fn feedback(&self, value: T, force_n: T, strain: T) -> (T, f64, f64) {
        let one = T::constant(1.0);
        let (factor, by_value) = match (self.law.operation, self.quantity) {
            (Operation::Add, Some(quantity)) => (one + value / quantity, 1.0 / quantity.value()),
            _ => (value, 1.0),
        };
        match self.source {
            Source::Force if self.law.operation == Operation::Add => (value, 1.0, 0.0),
            Source::Force => (force_n * (factor - one), force_n.value(), 0.0),
            Source::Spring(modulus) => {
                let held = modulus * strain;
                (-(held * (factor - one)), -by_value * held.value(), -(modulus * (factor - one)).value())
            }
            Source::Other(springs) => {
                let (borne, share) = (force_n - springs * strain, one / factor - one);
                let by_value = -by_value * borne.value() / factor.value().powi(2);
                (share * borne, by_value, -(share * springs).value())
            }
            Source::Position => (T::constant(0.0), 0.0, 0.0),
        }
    }

    fn velocity(&self, now: &Carried<T>, position_m: &[T], length_s: Option<T>) -> T {
        match length_s {
            Some(length_s) if position_m.len() == N_NODES => self.velocity_at(END, now, position_m, length_s),
            _ => now.velocity,
        }
    }

    fn velocity_at(&self, node: usize, now: &Carried<T>, position_m: &[T], length_s: T) -> T {
        self.slope_at(node, now.position_m, position_m, length_s)
    }

    /// Derivative in time, at a node, of the polynomial through these values at the step's start and nodes.
    pub fn slope_at(&self, node: usize, begin: T, at_nodes: &[T], length_s: T) -> T {
        let slopes = &self.slopes[node];
        at_nodes.iter().zip(&slopes[1..]).fold(begin * slopes[0], |sum, (x, slope)| sum + *x * *slope) / length_s
    }

    /// Returns the states at the nodes, and their derivatives by the positions there.
    fn states<const N: usize>(
        &self,
        nodes: &Nodes<T, N>,
        now: &Carried<T>,
        position_m: &[T; N],
        share_m: &[T; N],
        length_s: Option<T>,
    ) -> ([T; N], [[f64; N]; N]) {
        let identity = |i: usize, j: usize| f64::from(u8::from(i == j));
        let mut by_position = [[0.0; N]; N];
        let mut states = *position_m;
        match self.law.state {
            State::Position => by_position = std::array::from_fn(|i| std::array::from_fn(|j| identity(i, j))),
            State::Strain => {
                // The pseudo-stress changes the body's displacement and the robot's position equally.
                states = *share_m;
                by_position = std::array::from_fn(|i| std::array::from_fn(|j| identity(i, j)));
            }
            State::Path => {
                let (mut path_m, mut before, mut by) = (now.path_m, now.position_m, [0.0; N]);
                for i in 0..N {
                    let moved = position_m[i] - before;
                    let sign = if moved.value() < 0.0 { -1.0 } else { 1.0 };
                    path_m += size(moved);
                    by[i] += sign;
                    if i > 0 {
                        by[i - 1] -= sign;
                    }
                    (states[i], by_position[i], before) = (path_m, by, position_m[i]);
                }
            }
            State::LargestExcursion => {
                let (mut largest_m, mut by) = (now.largest_m, [0.0; N]);
                for i in 0..N {
                    let item = size(position_m[i]);
                    if item.value() > largest_m.value() {
                        (largest_m, by) = (item, [0.0; N]);
                        by[i] = if position_m[i].value() < 0.0 { -1.0 } else { 1.0 };
                    }
                    (states[i], by_position[i]) = (largest_m, by);
                }
            }
            State::Velocity => match length_s {
                Some(length_s) if N == N_NODES => {
                    for i in 0..N {
                        states[i] = self.velocity_at(i, now, position_m, length_s);
                        by_position[i] = std::array::from_fn(|j| self.slopes[i][j + 1] / length_s.value());
                    }
                }
                _ => states = [now.velocity; N],
            },
            State::Time => states = nodes.time_s,
            State::TimeSinceStep => {
                let since = self.since_step(nodes.time_s[0], true);
                states = nodes.time_s.map(|time_s| since + (time_s - nodes.time_s[0]));
            }
            State::Force => states = nodes.force_n,
        }
        (states, by_position)
    }
}

/// Solves a linear system by elimination with pivoting; `None` if the matrix is singular. The right side may carry derivatives.
pub fn solved<T: Scalar, const N: usize>(mut matrix: [[f64; N]; N], mut right: [T; N]) -> Option<[T; N]> {
    for k in 0..N {
        let pivot = (k..N).max_by(|&a, &b| matrix[a][k].abs().total_cmp(&matrix[b][k].abs()))?;
        if matrix[pivot][k] == 0.0 || !matrix[pivot][k].is_finite() {
            return None;
        }
        matrix.swap(k, pivot);
        right.swap(k, pivot);
        for i in k + 1..N {
            let factor = matrix[i][k] / matrix[k][k];
            for j in k..N {
                matrix[i][j] -= factor * matrix[k][j];
            }
            right[i] += right[k] * -factor;
        }
    }
    for k in (0..N).rev() {
        for j in k + 1..N {
            right[k] += right[j] * -matrix[k][j];
        }
        right[k] = right[k] * matrix[k][k].recip();
    }
    Some(right)
}

pub fn no_balance(time_s: f64) -> Error {
    Error::numerical(
        format!(
            "no consistent force and position exist {time_s} s after the record's start: the quantity changes too fast with its state"
        ),
        "take parameters nearer to their null values",
    )
}
