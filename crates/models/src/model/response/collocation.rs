//! Time steps of the retardation modes under a force that depends on the position.
//!
//! The force is F_in + R, with F_in the force without feedback and R the feedback by the position x. F_in is L + D e^{−λt}, with L the
//! level and D the deficit that decays at the lag's rate λ. R is F_in (e^{gx} − 1), with g the gradient. The response of a mode to F_in is
//! known exactly. R is smooth between switches of the command. A quartic through five nodes of the step approximates it. The quartic is
//! integrated exactly against e^{−ρ(h−s)}, with h the step and ρ the mode's rate. The position x at the nodes depends linearly on R at the
//! nodes. Newton's method therefore solves five equations for the five values of g x. If they have no solution near the value at the step's
//! start, the position is undefined from this step on. In this case the force diverges with the position, or changes by more in one step
//! than a quartic can follow.

use std::ops::{Add, Mul};

use pulp::{Arch, Simd, WithSimd};

use super::linear::{LinearRow, oscillating_row, row};
use super::moments::{N_FUNCTIONS, entire_functions, entire_functions_of_decay};
use super::numbers::{ComplexLanes, Number};
use super::system::{Mode, System};
use base::number::{Complex, PointScalar};

pub(super) const N_NODES: usize = N_FUNCTIONS;

/// Nodes of Radau's quadrature on [0, 1]. The last node is the end of the time step. Fast modes follow the force at the end of the step. A
/// node there reduces their error to that of the integral of the quartic.
pub(super) const NODES: [f64; N_NODES] =
    [0.057_104_196_114_517_68, 0.276_843_013_638_123_8, 0.583_590_432_368_916_8, 0.860_240_135_656_219_5, 1.0];

/// Index of the node at the end of the step.
pub(super) const END: usize = N_NODES - 1;

/// Largest number of Newton steps in one time step. Few steps are needed, since the iteration starts from the value at the end of the
/// previous time step.
const MOST_NEWTON_STEPS: usize = 12;
/// Squared size of a Newton step after which the iteration ends. The remaining error is of the order of the squared size.
const LAST_STEP_SQUARED: f64 = 1e-14;
/// Largest accepted change of the exponent g x (gradient times position) between the first node and the end of a time step.
const MOST_CHANGE: f64 = 1.5;

/// Coefficients that advance one retardation mode by a time step of length h.
#[derive(Clone, Copy)]
pub(super) struct ModeStep<T> {
    /// Decay factor e^{−ρ c h} of the mode at each node c, with ρ its rate and h the step's length.
    pub node_decay: [T; N_NODES],
    /// Coefficients over the whole step, for the force without feedback by the position.
    pub whole: LinearRow<T>,
    /// Weights of the feedback force at the nodes, for the mode's value at the end of the step.
    pub weights: [T; N_NODES],
}

/// Coefficients of all modes for a time step of one length.
pub(super) struct CollocationStep<S> {
    modes: Vec<ModeStep<S>>,
    oscillating: Vec<ModeStep<Complex<S>>>,
    /// Sum of the modes' contributions to the position at each node, for a unit of the force level.
    by_level: [S; N_NODES],
    /// Sum of the modes' contributions to the position at each node, for a unit of the level's rate.
    by_slope: [S; N_NODES],
    /// Sum of the modes' contributions to the position at each node, for a unit of the deficit (force minus level, behind a lag).
    by_deficit: [S; N_NODES],
    /// Sum of the modes' contributions to the position at node i (row), for a unit of the feedback force at node j (column).
    by_feedback: [[S; N_NODES]; N_NODES],
    length_s: S,
    rises: bool,
    /// Decay factor e^{−λ c h} of the lag at each node c, with λ the lag's rate and h the step's length.
    lag_decay: [S; N_NODES],
    /// Growth factor e^{r c h} at each node c, with r the softening rate and h the step's length.
    growth: [S; N_NODES],
}

/// State of the modes and of the force between two time steps.
pub(super) struct CollocationState<S> {
    modes: Vec<S>,
    oscillating: Vec<Complex<S>>,
    pub now_s: S,
    pub level_n: S,
    pub slope_n_per_s: S,
    pub deficit_n: S,
    /// Growth factor e^{rt} at the present time t, with r the softening rate.
    growth: S,
}

impl<S: Number> CollocationState<S> {
    pub fn new(system: &System<S>) -> Self {
        let zero = S::constant(0.0);
        Self {
            modes: vec![zero; system.modes.len()],
            oscillating: vec![Complex { re: zero, im: zero }; system.oscillating.len()],
            now_s: zero,
            level_n: zero,
            slope_n_per_s: zero,
            deficit_n: zero,
            growth: S::constant(1.0),
        }
    }
}

/// Coefficients of one mode, and its contributions to the position at the nodes. The contributions are for a unit of the force level, of
/// its rate, of the deficit behind a lag and of the feedback force.
pub(super) struct OfMode<T> {
    pub step: ModeStep<T>,
    pub by_level: [T; N_NODES],
    pub by_slope: [T; N_NODES],
    pub by_deficit: [T; N_NODES],
    pub by_feedback: [[T; N_NODES]; N_NODES],
}

/// Returns the coefficients of one mode. `rows` are its coefficients from the step's start to each node. `functions` are the entire
/// functions φₖ(−ρ c h) for each node c (row) and k (column), with ρ the mode's rate and h the step. `gain` is the mode's gain times h.
/// `polynomials` are the nodes' Lagrange polynomials.
#[inline(always)]
pub(super) fn of_mode<T: Copy + Add<Output = T> + Mul<Output = T> + Mul<f64, Output = T>>(
    gain: T,
    rows: [LinearRow<T>; N_NODES],
    functions: [[T; N_FUNCTIONS]; N_NODES],
    polynomials: &[[f64; N_NODES]; N_NODES],
) -> OfMode<T> {
    let mut by_feedback = [[gain; N_NODES]; N_NODES];
    let (mut node_decay, mut by_level, mut by_deficit) = ([gain; N_NODES], [gain; N_NODES], [gain; N_NODES]);
    let by_slope = rows.map(|row| row.ramp_gain);
    for i in 0..N_NODES {
        by_feedback[i] = weights(gain, NODES[i], functions[i], polynomials);
        (node_decay[i], by_level[i], by_deficit[i]) = (rows[i].decay, rows[i].gain, rows[i].lag_gain);
    }
    let step = ModeStep { node_decay, whole: rows[END], weights: by_feedback[END] };
    OfMode { step, by_level, by_slope, by_deficit, by_feedback }
}

/// Returns the weights gain ∫₀ᶜ e^{−z(c−s)} ℓⱼ(s) ds up to c = `end`. ℓⱼ are the nodes' Lagrange polynomials, and z is the mode's rate
/// times the step. `functions` are the entire functions φₖ(−zc).
#[inline(always)]
fn weights<T: Copy + Add<Output = T> + Mul<Output = T> + Mul<f64, Output = T>>(
    gain: T,
    end: f64,
    functions: [T; N_FUNCTIONS],
    polynomials: &[[f64; N_NODES]; N_NODES],
) -> [T; N_NODES] {
    // The moments of the decay are ∫₀ᶜ e^{−z(c−s)} sᵏ ds = cᵏ⁺¹ k! φₖ₊₁(−zc).
    let mut factor = 1.0;
    let mut moments = functions;
    for k in 0..N_NODES {
        factor *= end * if k > 0 { k as f64 } else { 1.0 };
        moments[k] = functions[k] * factor;
    }
    let mut weights = [gain; N_NODES];
    for j in 0..N_NODES {
        let mut sum = moments[0] * polynomials[j][0];
        for k in 1..N_NODES {
            sum = sum + moments[k] * polynomials[j][k];
        }
        weights[j] = gain * sum;
    }
    weights
}

/// Returns the coefficients of 1, s, …, s⁴ in the Lagrange polynomial that is 1 at node j and 0 at the other nodes.
pub(super) fn lagrange(j: usize) -> [f64; N_NODES] {
    let mut polynomial = [0.0; N_NODES];
    polynomial[0] = 1.0;
    for (_, node) in NODES.iter().enumerate().filter(|(k, _)| *k != j) {
        let scale = 1.0 / (NODES[j] - node);
        for power in (0..N_NODES).rev() {
            let below = if power > 0 { polynomial[power - 1] } else { 0.0 };
            polynomial[power] = (below - node * polynomial[power]) * scale;
        }
    }
    polynomial
}

impl<S: Number> CollocationStep<S> {
    /// Returns the coefficients of a step of this length (s). `rises` is `true` if the force changes linearly during a step.
    pub fn new(system: &System<S>, length_s: S, rises: bool) -> Self {
        let zero = S::constant(0.0);
        let mut step = Self {
            modes: vec![empty(zero); system.modes.len()],
            oscillating: vec![empty(Complex { re: zero, im: zero }); system.oscillating.len()],
            by_level: [zero; N_NODES],
            by_slope: [zero; N_NODES],
            by_deficit: [zero; N_NODES],
            by_feedback: [[zero; N_NODES]; N_NODES],
            length_s,
            rises,
            lag_decay: [zero; N_NODES],
            growth: [zero; N_NODES],
        };
        let polynomials = std::array::from_fn(lagrange);
        for (k, part) in NODES.into_iter().enumerate() {
            step.growth[k] = (system.softening_rate * length_s * part).exp();
            if system.shape.lagging {
                step.lag_decay[k] = (system.lag_rate * length_s * -part).exp();
            }
        }
        Arch::new().dispatch(FillModes { system, length_s, polynomials: &polynomials, step: &mut step });
        for lane in 0..S::N_POINTS {
            step.set_oscillating(system, lane, length_s.lane(lane), &polynomials);
        }
        step
    }

    /// Fills the coefficients of the oscillating modes for the parameter point with the index `lane`.
    fn set_oscillating(
        &mut self,
        system: &System<S>,
        lane: usize,
        length_s: S::Lane,
        polynomials: &[[f64; N_NODES]; N_NODES],
    ) {
        let lag_rate = system.shape.lagging.then(|| system.lag_rate.lane(lane));
        for (index, mode) in system.oscillating.iter().enumerate() {
            let mode: Mode<Complex<S::Lane>> = mode.lane(lane);
            let rate = mode.rate.times(length_s);
            let rows = NODES.map(|part| oscillating_row(mode, length_s * part, lag_rate, self.rises));
            let functions = NODES.map(|part| entire_functions(rate * -part));
            let of_mode = of_mode(mode.gain.times(length_s), rows, functions, polynomials);
            set_parts(&mut self.oscillating[index], &of_mode.step, |target, &value| target.set_lane(lane, value));
            let add = |target: &mut S, value: Complex<S::Lane>| target.set_lane(lane, target.lane(lane) + value.re);
            for i in 0..N_NODES {
                add(&mut self.by_level[i], of_mode.by_level[i]);
                add(&mut self.by_slope[i], of_mode.by_slope[i]);
                add(&mut self.by_deficit[i], of_mode.by_deficit[i]);
                for j in 0..N_NODES {
                    add(&mut self.by_feedback[i][j], of_mode.by_feedback[i][j]);
                }
            }
        }
    }
}

/// Task that fills the coefficients of the real modes at all parameter points at once.
struct FillModes<'a, S> {
    system: &'a System<S>,
    length_s: S,
    polynomials: &'a [[f64; N_NODES]; N_NODES],
    step: &'a mut CollocationStep<S>,
}

impl<S: Number> WithSimd for FillModes<'_, S> {
    type Output = ();

    #[inline(always)]
    fn with_simd<V: Simd>(self, _simd: V) {
        let Self { system, length_s, step, polynomials } = self;
        let zero = S::constant(0.0);
        let lag_rate = if system.shape.lagging { Some(system.lag_rate) } else { None };
        for (mode, target) in system.modes.iter().zip(step.modes.iter_mut()) {
            let mut rows = [LinearRow::filled(zero); N_NODES];
            let mut functions = [[zero; N_FUNCTIONS]; N_NODES];
            for k in 0..N_NODES {
                let part_s = length_s * NODES[k];
                rows[k] = row(*mode, part_s, lag_rate, step.rises);
                functions[k] = entire_functions_of_decay(mode.rate * part_s);
            }
            let of_mode = of_mode(mode.gain * length_s, rows, functions, polynomials);
            *target = of_mode.step;
            for i in 0..N_NODES {
                step.by_level[i] += of_mode.by_level[i];
                step.by_slope[i] += of_mode.by_slope[i];
                step.by_deficit[i] += of_mode.by_deficit[i];
                for j in 0..N_NODES {
                    step.by_feedback[i][j] += of_mode.by_feedback[i][j];
                }
            }
        }
    }
}

fn empty<T: Copy>(zero: T) -> ModeStep<T> {
    ModeStep { node_decay: [zero; N_NODES], whole: LinearRow::filled(zero), weights: [zero; N_NODES] }
}

fn set_parts<T, U>(target: &mut ModeStep<T>, source: &ModeStep<U>, mut set: impl FnMut(&mut T, &U)) {
    for k in 0..N_NODES {
        set(&mut target.node_decay[k], &source.node_decay[k]);
        set(&mut target.weights[k], &source.weights[k]);
    }
    set(&mut target.whole.decay, &source.whole.decay);
    set(&mut target.whole.gain, &source.whole.gain);
    set(&mut target.whole.lag_gain, &source.whole.lag_gain);
    set(&mut target.whole.ramp_gain, &source.whole.ramp_gain);
}

/// Advances the state of the modes and of the force by one time step.
#[inline(always)]
pub(super) fn advance<S: Number>(system: &System<S>, step: &CollocationStep<S>, state: &mut CollocationState<S>) {
    let feedback = feedback_at_nodes(system, step, state);
    let (level_n, slope, deficit_n) = (state.level_n, state.slope_n_per_s, state.deficit_n);
    for (y, mode) in state.modes.iter_mut().zip(&step.modes) {
        let mut next = mode.whole.gain.mul_add(level_n, mode.whole.lag_gain * deficit_n);
        if step.rises {
            next = mode.whole.ramp_gain.mul_add(slope, next);
        }
        for k in 0..N_NODES {
            next = mode.weights[k].mul_add(feedback[k], next);
        }
        *y = mode.whole.decay.mul_add(*y, next);
    }
    for (y, mode) in state.oscillating.iter_mut().zip(&step.oscillating) {
        let mut next = mode.whole.gain.times(level_n) + mode.whole.lag_gain.times(deficit_n);
        if step.rises {
            next = next + mode.whole.ramp_gain.times(slope);
        }
        for k in 0..N_NODES {
            next = next + mode.weights[k].times(feedback[k]);
        }
        *y = mode.whole.decay * *y + next;
    }
    state.deficit_n = deficit_n * step.lag_decay[END];
    state.growth = state.growth * step.growth[END];
    state.now_s += step.length_s;
    if step.rises {
        state.level_n += slope * step.length_s;
    }
}

/// Returns the feedback force F_in (e^{gx} − 1) at the nodes of the step, in N, by Newton's method. F_in is the force without feedback, g
/// the gradient and x the position.
#[inline(always)]
fn feedback_at_nodes<S: Number>(
    system: &System<S>,
    step: &CollocationStep<S>,
    state: &CollocationState<S>,
) -> [S; N_NODES] {
    let (zero, one) = (S::constant(0.0), S::constant(1.0));
    // `known` is the sum of the modes' contributions to the position at the nodes without feedback. The inner loop is over the nodes, so
    // that consecutive additions belong to different sums.
    let mut known = [zero; N_NODES];
    for i in 0..N_NODES {
        known[i] = step.by_level[i].mul_add(state.level_n, step.by_deficit[i] * state.deficit_n);
        if step.rises {
            known[i] = step.by_slope[i].mul_add(state.slope_n_per_s, known[i]);
        }
    }
    for (&y, mode) in state.modes.iter().zip(&step.modes) {
        for i in 0..N_NODES {
            known[i] = mode.node_decay[i].mul_add(y, known[i]);
        }
    }
    for (&y, mode) in state.oscillating.iter().zip(&step.oscillating) {
        for i in 0..N_NODES {
            known[i] += (mode.node_decay[i] * y).re;
        }
    }
    let mut force_n = [zero; N_NODES];
    for i in 0..N_NODES {
        force_n[i] = state.deficit_n.mul_add(step.lag_decay[i], state.level_n);
        if step.rises {
            force_n[i] = (state.slope_n_per_s * NODES[i]).mul_add(step.length_s, force_n[i]);
        }
    }
    // With the feedback, the equations for the exponents at the nodes are g x = known + Σ by_force (e^{gx} − 1).
    let mut by_force = [[zero; N_NODES]; N_NODES];
    for i in 0..N_NODES {
        let strength = system.load.gradient_per_m * state.growth * step.growth[i];
        known[i] = strength * system.instantaneous.mul_add(force_n[i], known[i]);
        for j in 0..N_NODES {
            by_force[i][j] = strength * step.by_feedback[i][j] * force_n[j];
        }
        by_force[i][i] += strength * system.instantaneous * force_n[i];
    }
    // The initial guess depends only on the state at the step's start. A point that waits in steps of length 0 must keep all bits
    // of its state.
    let (flowed, start_n) = (flowed_m_per_growth(state), state.level_n + state.deficit_n);
    let start = system.load.gradient_per_m * state.growth * system.instantaneous.mul_add(start_n, flowed);
    let mut exponent = [start; N_NODES];
    // `size` is the squared size of each parameter point's last Newton step. Each point has its own size, so that its result does not
    // depend on its neighbours.
    let mut size = one;
    for _ in 0..MOST_NEWTON_STEPS {
        let (mut matrix, mut right) = (by_force, known);
        for j in 0..N_NODES {
            let (grown, mean) = (-exponent[j]).decay();
            let change = mean * exponent[j];
            for i in 0..N_NODES {
                right[i] = by_force[i][j].mul_add(change, right[i]);
                matrix[i][j] = -(matrix[i][j] * grown);
            }
            right[j] = right[j] - exponent[j];
            matrix[j][j] += one;
        }
        let moved = solve(matrix, right);
        let mut squared = zero;
        for k in 0..N_NODES {
            squared = moved[k].mul_add(moved[k], squared);
            exponent[k] = size.choose(LAST_STEP_SQUARED, exponent[k], exponent[k] + moved[k]);
        }
        size = size.choose(LAST_STEP_SQUARED, size, squared);
        let mut are_done = true;
        for lane in 0..S::N_POINTS {
            are_done &= size.lane(lane).value() < LAST_STEP_SQUARED;
        }
        if are_done {
            break;
        }
    }
    let (none, change) = (S::constant(f64::NAN), exponent[END] - exponent[0]);
    let mut feedback = [zero; N_NODES];
    for k in 0..N_NODES {
        let found = (-exponent[k]).decay().1 * exponent[k] * force_n[k];
        feedback[k] = size.choose(LAST_STEP_SQUARED, change.choose(MOST_CHANGE, found, none), none);
    }
    feedback
}

/// Solves a linear system by elimination without pivoting. The matrix is the identity plus a feedback matrix. A diagonal entry vanishes
/// only if the force diverges.
#[inline(always)]
pub(super) fn solve<S: Number>(mut matrix: [[S; N_NODES]; N_NODES], mut right: [S; N_NODES]) -> [S; N_NODES] {
    for k in 0..N_NODES {
        let inverse = S::constant(1.0) / matrix[k][k];
        for j in k + 1..N_NODES {
            matrix[k][j] = matrix[k][j] * inverse;
        }
        right[k] = right[k] * inverse;
        for i in k + 1..N_NODES {
            let factor = -matrix[i][k];
            for j in k + 1..N_NODES {
                matrix[i][j] = factor.mul_add(matrix[k][j], matrix[i][j]);
            }
            right[i] = factor.mul_add(right[k], right[i]);
        }
    }
    for k in (0..N_NODES - 1).rev() {
        for j in k + 1..N_NODES {
            right[k] = (-matrix[k][j]).mul_add(right[j], right[k]);
        }
    }
    right
}

/// Returns the sum of the modes' contributions to the position in m, before multiplication by the softening factor e^{rt}.
#[inline(always)]
fn flowed_m_per_growth<S: Number>(state: &CollocationState<S>) -> S {
    let mut sum = S::constant(0.0);
    for &y in &state.modes {
        sum += y;
    }
    for y in &state.oscillating {
        sum += y.re;
    }
    sum
}

/// Returns the position of the robot in m. Newton's method solves x = e^{rt} (Σ Y + c F_in e^{gx}) for g x. Here x is the position, g the
/// gradient, F_in the force without feedback, Σ Y the sum of the modes, c the instantaneous compliance (m/N) and e^{rt} the softening
/// factor.
#[inline(always)]
pub(super) fn position_m<S: Number>(system: &System<S>, state: &CollocationState<S>) -> S {
    let one = S::constant(1.0);
    let flowed_m = state.growth * flowed_m_per_growth(state);
    let jump_m = state.growth * system.instantaneous * (state.level_n + state.deficit_n);
    let known = system.load.gradient_per_m * flowed_m;
    let by_force = system.load.gradient_per_m * jump_m;
    let mut exponent = known;
    let mut size = one;
    for _ in 0..MOST_NEWTON_STEPS {
        let grown = by_force * (-exponent).decay().0;
        let moved = (known + grown - exponent) / (one - grown);
        exponent = size.choose(LAST_STEP_SQUARED, exponent, exponent + moved);
        size = size.choose(LAST_STEP_SQUARED, size, moved * moved);
        let mut are_done = true;
        for lane in 0..S::N_POINTS {
            are_done &= size.lane(lane).value() < LAST_STEP_SQUARED;
        }
        if are_done {
            break;
        }
    }
    let found = jump_m.mul_add((-exponent).decay().0, flowed_m);
    size.choose(LAST_STEP_SQUARED, found, S::constant(f64::NAN))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks that nodes and weights integrate polynomials up to degree 8 exactly over the step, as Radau's quadrature does. A
    /// wrong digit in a node would fail the test.
    #[test]
    fn nodes_are_those_of_radau() {
        let weights = weights(1.0, 1.0, entire_functions_of_decay(0.0), &std::array::from_fn(lagrange));
        for degree in 0..9 {
            let sum: f64 = NODES.iter().zip(weights).map(|(node, weight)| weight * node.powi(degree)).sum();
            assert!((sum - 1.0 / f64::from(degree + 1)).abs() < 1e-14, "degree {degree}: {sum}");
        }
    }

    /// Compares the integral ∫₀ᶜ e^{−z(c−s)} s³ ds by the weights with a trapezoidal sum that Richardson's extrapolation refines, for small
    /// and large z.
    #[test]
    fn weights_integrate_against_any_decay() {
        for (rate, end) in [(1e-9, 1.0), (0.9, NODES[2]), (1.1, 1.0), (7.0, NODES[0]), (60.0, 1.0)] {
            let functions = entire_functions_of_decay(rate * end);
            let weights = weights(2.0, end, functions, &std::array::from_fn(lagrange));
            let found: f64 = NODES.iter().zip(weights).map(|(node, weight)| weight * node.powi(3)).sum();
            let sum = |n: u32| -> f64 {
                let value = |k: u32| {
                    let s = end * f64::from(k) / f64::from(n);
                    2.0 * (-rate * (end - s)).exp() * s.powi(3)
                };
                ((1..n).map(value).sum::<f64>() + 0.5 * (value(0) + value(n))) * end / f64::from(n)
            };
            let expected = (4.0 * sum(20_000) - sum(10_000)) / 3.0;
            assert!((found / expected - 1.0).abs() < 1e-10, "rate {rate}: {found} against {expected}");
        }
    }
}
