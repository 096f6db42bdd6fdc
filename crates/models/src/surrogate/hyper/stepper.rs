//! Time stepping of the hyper-reduced model, with a small dense Newton iteration in each step.
//!
//! Between two switches of the force, the steps grow geometrically. They are equal in ξ = ln(1 + t/θ), with t the time since the
//! switch and θ the law's fastest time, rounded down to a power of two. Steps do not end at rows, so a polynomial of degree 5 in
//! ξ interpolates the positions at rows. The lengths of steps depend on the parameters only through θ and the delay. A trajectory
//! is therefore smooth in the parameters except where θ changes to another power of two.

use super::kernel::{
    self, Advance, BlockTensor, CubaturePoints, Forces, ForcesAndTangent, HistoryTerms, LinearisedLaw,
};
use super::lanes::{LaneBlock, N_LANES, Plain};
use base::error::{Error, Result};
use base::number::{PointScalar, Scalar};
use elements::fe::clock::{CLOCK_ROUNDING, Tableau};
use elements::fe::nonlinear::Bodies;
use elements::fe::nonlinear::Scheme;
use elements::fe::nonlinear::point::{Number, StageLaw};
use laws::stages::{Load, Switch};
use pulp::Simd;
use record::Force;

/// Number of nodes of the polynomial that interpolates positions at rows.
const N_NODES: usize = 6;
/// Smallest number of steps between two switches.
const FEWEST_STEPS: usize = 3;
/// Relative increase of the number of steps each time that stiffening halves the fastest time.
const MORE_STEPS: f64 = 0.25;
/// Largest factor by which stiffening increases the number of steps.
const MOST_STEPS: f64 = 2.0;
/// Smallest time scale of the steps after a switch, divided by the time from the switch to the first row after it.
const SHARE_OF_GAP: f64 = 0.1;
/// Length of the very short step in which springs in series jump, divided by the time scale of the steps.
const SHARE_OF_JUMP: f64 = 1e-9;
/// Largest number of Newton steps in one stage of a time step.
const MOST_ITERATIONS: usize = 25;
/// Change of the modes' factors, relative to their largest value so far, after which only one more Newton step is taken. This last step
/// squares the relative error.
const NEARLY: f64 = 1e-5;

/// Cubature points (the few integration points at which the reduced model computes strains) and modes of a hyper-reduced model for one run.
#[derive(Clone, Copy)]
pub(super) struct Reduced<'a, const M: usize> {
    pub points: &'a CubaturePoints<M>,
    /// Translation of the robot in each mode.
    pub robot: [f64; M],
    /// Fraction of the robot's force that the meshed symmetric section carries.
    pub share: f64,
}

/// Settings for the fineness of a run's time steps.
#[derive(Clone, Copy)]
pub(super) struct Fineness {
    /// Number of time steps in which the time since a switch of the force doubles, without stiffening.
    pub steps_per_doubling: f64,
    /// Largest equivalent strain per force, times the modulus (Pa/N), for an elastic law. It predicts the stiffening of springs.
    pub strain_per_force: f64,
}

/// Constitutive law, with the cubature points and the modes of the reduced model that uses it. `bodies` are the law's elements in series.
#[derive(Clone, Copy)]
pub(super) struct StepperMember<'a, N, const M: usize> {
    pub reduced: Reduced<'a, M>,
    pub bodies: &'a Bodies<N>,
    pub plain_bodies: &'a Bodies<f64>,
}

/// State of a run between and during time steps.
struct StepperState<'a, B: LaneBlock, const M: usize> {
    reduced: Reduced<'a, M>,
    bodies: &'a Bodies<B::Scalar>,
    plain_bodies: &'a Bodies<f64>,
    load: Load<B::Scalar>,
    plain_load: Load<f64>,
    input: Switch<B::Scalar>,
    lagged_n: B::Scalar,
    /// Strains of the law's bodies (elements in series) at the cubature points, by block of points and then by body.
    histories: Vec<BlockTensor<B>>,
    /// Strains of the law's bodies (elements in series) at the start of the present Runge–Kutta stage, in the order of `histories`.
    started: Vec<BlockTensor<B>>,
    rates: Vec<Vec<BlockTensor<B>>>,
    given: Vec<HistoryTerms<B>>,
    plain_given: Vec<HistoryTerms<Plain>>,
    coordinates: [B::Scalar; M],
    /// Times in s and factors of the modes at earlier stages of time steps, from which the next factors are extrapolated.
    known: Vec<(f64, [f64; M])>,
    at: Vec<LinearisedLaw>,
    /// Largest factor of a mode so far.
    largest: f64,
}

/// Returns the robot's displacement (m) minus that of the linear law at every row, as the limit from the left.
///
/// Both laws take the same time steps, so that most errors of steps and interpolation cancel. For a linear law all of these errors cancel.
#[inline(always)]
pub fn run<B: LaneBlock, S: Simd, const M: usize>(
    simd: S,
    law: StepperMember<B::Scalar, M>,
    linear: StepperMember<B::Scalar, 1>,
    fineness: Fineness,
    load: &Load,
    time_s: &[f64],
    force: Force<'_>,
) -> Result<Vec<B::Scalar>> {
    let zero = B::Scalar::constant(0.0);
    let mut found = vec![zero; time_s.len()];
    let (Some(&start_s), Some(&end_s)) = (time_s.first(), time_s.last()) else { return Ok(found) };
    let rounding_s = CLOCK_ROUNDING * (end_s - start_s);
    let switches = load.of::<B::Scalar>().switches(time_s, force);
    let (mut state, mut beside) = (StepperState::<B, M>::new(law, load), StepperState::<B, 1>::new(linear, load));
    let slowest_s = load.fastest_s();
    let mut row = time_s.partition_point(|&t| t <= start_s + rounding_s);
    for (i, switch) in switches.iter().enumerate() {
        let begin_s = switch.time_s;
        if begin_s.value() >= end_s - rounding_s {
            break;
        }
        state.switch(*switch);
        beside.switch(*switch);
        let next_s = switches.get(i + 1).map_or(end_s, |next| next.time_s.value());
        let length_s = match switches.get(i + 1) {
            Some(next) if next_s < end_s => next.time_s - begin_s,
            _ => B::Scalar::constant(end_s) - begin_s,
        };
        if length_s.value() <= rounding_s {
            continue;
        }
        let stop_s = next_s.min(end_s);
        let first_s = time_s.get(row).map_or(length_s.value(), |&t| t - begin_s.value());
        let largest = kernel::largest_equivalent(&state.histories, law.bodies.n_histories());
        let doublings_of = |time_s: f64| time_s.min(slowest_s).log2().floor();
        let fastest = doublings_of(law.plain_bodies.fastest_s(largest));
        // After a reversal of the force, a stiffened spring relaxes and stiffens again in the other direction within one doubling of the
        // time. Additional steps resolve this change.
        let at_end_n = switch.input_n(B::Scalar::constant(stop_s)).value().abs();
        let pushes_n = switch.force_n.value().abs().max(at_end_n);
        let elastic = fineness.strain_per_force * pushes_n / law.plain_bodies.modulus_pa;
        let largest = largest.max(kernel::stiffened_strain(law.plain_bodies, elastic));
        let stiffened =
            doublings_of(law.plain_bodies.fastest_s(0.0)) - doublings_of(law.plain_bodies.fastest_s(largest));
        let steps_per_doubling = fineness.steps_per_doubling * (1.0 + MORE_STEPS * stiffened).min(MOST_STEPS);
        let fastest_s = fastest.exp2();
        let scale_s = fastest_s.max(SHARE_OF_GAP * first_s.min(length_s.value()));
        let mut nodes = state.hold(simd, begin_s, length_s, scale_s, steps_per_doubling)?;
        let linear = beside.hold(simd, begin_s, length_s, scale_s, steps_per_doubling)?;
        nodes.iter_mut().zip(linear).for_each(|(node, linear)| *node = *node - linear);
        let per_node = (length_s * (1.0 / scale_s) + B::Scalar::constant(1.0)).ln() * (1.0 / (nodes.len() - 1) as f64);
        while row < time_s.len() && time_s[row] <= stop_s + rounding_s {
            let since = (B::Scalar::constant(time_s[row]) - begin_s) * (1.0 / scale_s) + B::Scalar::constant(1.0);
            found[row] = interpolated(&nodes, since.ln() / per_node);
            row += 1;
        }
    }
    Ok(found)
}

/// Returns the value at `place` of the polynomial through the nearest nodes. The nodes are at 0, 1, 2, …
#[inline(always)]
fn interpolated<N: Number>(nodes: &[N], place: N) -> N {
    let n = nodes.len().min(N_NODES);
    let first = (place.value().floor() as usize).saturating_sub(n / 2 - 1).min(nodes.len() - n);
    let mut distance = [N::constant(0.0); N_NODES];
    for (k, d) in distance[..n].iter_mut().enumerate() {
        *d = place + N::constant(-((first + k) as f64));
    }
    // The products of the distances to the nodes on either side give the Lagrange polynomials.
    let mut behind = [N::constant(1.0); N_NODES + 1];
    for k in (0..n).rev() {
        behind[k] = behind[k + 1] * distance[k];
    }
    let (mut before, mut sum) = (N::constant(1.0), N::constant(0.0));
    for k in 0..n {
        sum += nodes[first + k] * before * behind[k + 1] * (1.0 / denominator(k, n));
        before = before * distance[k];
    }
    sum
}

/// Returns the product of (k − j) over all j < n except k.
#[inline(always)]
fn denominator(k: usize, n: usize) -> f64 {
    (0..n).filter(|j| *j != k).map(|j| k as f64 - j as f64).product()
}

impl<'a, B: LaneBlock, const M: usize> StepperState<'a, B, M> {
    #[inline(always)]
    fn new(member: StepperMember<'a, B::Scalar, M>, load: &Load) -> Self {
        let StepperMember { reduced, bodies, plain_bodies } = member;
        let (zero, blank) = (B::Scalar::constant(0.0), B::constant(Plain([0.0; N_LANES])));
        let n_blocks = reduced.points.n_blocks();
        let histories = vec![[blank; 6]; n_blocks * bodies.n_histories()];
        let empty = Plain([0.0; N_LANES]);
        Self {
            reduced,
            bodies,
            plain_bodies,
            load: load.of(),
            plain_load: load.of(),
            input: Switch::to(zero, zero),
            lagged_n: zero,
            started: histories.clone(),
            rates: vec![histories.clone(); Scheme::Fourth.tableau().nodes.len()],
            given: vec![HistoryTerms { offset: [blank; 6], taken: [blank; 6] }; n_blocks],
            plain_given: vec![HistoryTerms { offset: [empty; 6], taken: [empty; 6] }; n_blocks],
            histories,
            coordinates: [zero; M],
            known: Vec::with_capacity(16),
            at: Vec::with_capacity(n_blocks),
            largest: 0.0,
        }
    }

    #[inline(always)]
    fn switch(&mut self, switch: Switch<B::Scalar>) {
        self.lagged_n = self.force_n(switch.time_s);
        self.input = switch;
        self.known.clear();
    }

    /// Returns the force (N) after the lag.
    #[inline(always)]
    fn force_n(&self, time_s: B::Scalar) -> B::Scalar {
        self.load.after_lag_n(&self.input, self.lagged_n, time_s)
    }

    #[inline(always)]
    fn position(&self) -> B::Scalar {
        let mut x = B::Scalar::constant(0.0);
        for (r, z) in self.reduced.robot.iter().zip(&self.coordinates) {
            x += *z * *r;
        }
        x
    }

    /// Steps from a switch of the force to the next switch. It returns the positions at the steps' ends, with the position just after the
    /// switch first.
    #[inline(always)]
    fn hold<S: Simd>(
        &mut self,
        simd: S,
        begin_s: B::Scalar,
        length_s: B::Scalar,
        scale_s: f64,
        steps_per_doubling: f64,
    ) -> Result<Vec<B::Scalar>> {
        let doublings = (length_s.value() / scale_s).ln_1p() / std::f64::consts::LN_2;
        let n = ((steps_per_doubling * doublings).ceil() as usize).max(FEWEST_STEPS);
        let logarithm = (length_s * (1.0 / scale_s) + B::Scalar::constant(1.0)).ln() * (1.0 / n as f64);
        // Springs in series jump with the force. A very short implicit step gives the jump.
        let jumps = self.plain_bodies.instantaneous_per_pa > 0.0;
        let mut nodes = Vec::with_capacity(n + 1);
        let mut from_s = begin_s;
        for k in 0..=n {
            let to_s = begin_s + (logarithm * k as f64).exp_m1() * scale_s;
            if k > 0 || jumps {
                let (step_s, scheme) = match k {
                    0 => (B::Scalar::constant(SHARE_OF_JUMP * scale_s), Scheme::Euler),
                    _ => (to_s - from_s, Scheme::Fourth),
                };
                self.step(simd, from_s, step_s, scheme)?;
            } else {
                self.remember(begin_s.value());
            }
            from_s = to_s;
            nodes.push(self.position());
        }
        Ok(nodes)
    }

    #[inline(always)]
    fn remember(&mut self, time_s: f64) {
        self.known.push((time_s, self.coordinates.map(|z| z.value())));
    }

    #[inline(always)]
    fn step<S: Simd>(&mut self, simd: S, from_s: B::Scalar, step_s: B::Scalar, scheme: Scheme) -> Result<()> {
        let Tableau { diagonal, nodes, matrix } = scheme.tableau();
        let stage_s = step_s * diagonal;
        let law = StageLaw::new(self.bodies, stage_s);
        let plain_law = StageLaw::new(self.plain_bodies, stage_s.value());
        for (stage, (node, weights)) in nodes.iter().zip(matrix).enumerate() {
            let time_s = from_s + step_s * *node;
            for (place, start) in self.histories.iter().enumerate() {
                let mut history = *start;
                for (rates, weight) in self.rates.iter().zip(*weights) {
                    let weight = B::splat(step_s * *weight);
                    for (h, r) in history.iter_mut().zip(&rates[place]) {
                        *h = *h + weight * *r;
                    }
                }
                self.started[place] = history;
            }
            let guess = match self.known.is_empty() {
                true => self.coordinates.map(|z| z.value()),
                false => self.extrapolated(stage, time_s.value()),
            };
            self.solve(simd, &law, &plain_law, time_s, guess)?;
            self.remember(time_s.value());
            let is_last = stage + 1 == nodes.len();
            let target = if is_last { &mut self.histories } else { &mut self.rates[stage] };
            target.copy_from_slice(&self.started);
            simd.vectorize(Advance {
                points: self.reduced.points,
                law: &law,
                given: &self.given,
                coordinates: &self.coordinates,
                at: &self.at,
                histories: target,
            });
            if !is_last {
                let inverse = B::splat(B::Scalar::constant(1.0) / stage_s);
                for (rate, start) in target.iter_mut().zip(&self.started) {
                    for (r, s) in rate.iter_mut().zip(start) {
                        *r = (*r - *s) * inverse;
                    }
                }
            }
        }
        // The next step extrapolates from the middle, the third quarter and the end of this step.
        if nodes.len() > 1 {
            let last = self.known.len() - 1;
            let kept = [self.known[last - 1], self.known[last - 3], self.known[last]];
            self.known.clear();
            self.known.extend(kept);
        }
        Ok(())
    }

    /// Returns an initial guess of the modes' factors, by the parabola through three earlier values.
    #[inline(always)]
    fn extrapolated(&self, stage: usize, time_s: f64) -> [f64; M] {
        let mut guess = [0.0; M];
        let n = self.known.len();
        let places = if stage == 4 { [n - 4, n - 3, n - 1] } else { [n.saturating_sub(3), n.saturating_sub(2), n - 1] };
        let distinct = if stage == 4 { 3 } else { n.min(3) };
        let chosen = &places[3 - distinct..];
        for i in chosen {
            let (t_i, u) = &self.known[*i];
            let others = chosen.iter().filter(|j| *j != i);
            let weight: f64 = others.map(|j| (time_s - self.known[*j].0) / (t_i - self.known[*j].0)).product();
            guess.iter_mut().zip(u).for_each(|(g, u)| *g += weight * u);
        }
        guess
    }

    /// Solves for the modes' factors at which forces are in balance in one Runge–Kutta stage of a time step. The stage starts from the
    /// strains in `self.started`. Stores the factors in `self.coordinates` and the linearised law in `self.at`.
    #[inline(always)]
    fn solve<S: Simd>(
        &mut self,
        simd: S,
        law: &StageLaw<B::Scalar>,
        plain_law: &StageLaw<f64>,
        time_s: B::Scalar,
        guess: [f64; M],
    ) -> Result<()> {
        let Reduced { points, robot, share, .. } = self.reduced;
        let histories = self.started.chunks_exact(self.bodies.n_histories());
        for ((given, plain), histories) in self.given.iter_mut().zip(&mut self.plain_given).zip(histories) {
            *given = HistoryTerms::new(law, histories);
            *plain = given.values();
        }
        let input_n = self.force_n(time_s);
        let force_n = share * input_n.value();
        let mut z = guess;
        let mut tangent;
        let mut is_near = false;
        let mut size = f64::INFINITY;
        for _ in 0..MOST_ITERATIONS {
            if is_near && !B::Scalar::HAS_DERIVATIVE {
                break;
            }
            let force;
            let (given, at) = (&self.plain_given[..], &mut self.at);
            (force, tangent) = simd.vectorize(ForcesAndTangent { points, law: plain_law, given, coordinates: &z, at });
            let x: f64 = robot.iter().zip(&z).map(|(r, z)| r * z).sum();
            let push_n = self.plain_load.acting_n(force_n, x);
            let slope = self.plain_load.acting_slope(push_n);
            let mut step = [0.0; M];
            for i in 0..M {
                step[i] = robot[i] * push_n - force[i];
                for j in 0..M {
                    tangent[i][j] -= slope * robot[i] * robot[j];
                }
            }
            if !factorise(&mut tangent) {
                return Err(diverged(time_s.value(), f64::NAN));
            }
            if is_near {
                // One more step uses numbers with derivatives, with the tangent from the end of the iteration.
                let at = z.map(B::Scalar::constant);
                let force = simd.vectorize(Forces { points, law, given: &self.given, coordinates: &at });
                let mut x = B::Scalar::constant(0.0);
                robot.iter().zip(&at).for_each(|(r, z)| x += *z * *r);
                let push = self.load.acting_n(input_n, x) * share;
                let mut rest = std::array::from_fn(|i| push * robot[i] - force[i]);
                substitute(&tangent, &mut rest);
                self.coordinates = std::array::from_fn(|i| at[i] + rest[i]);
                break;
            }
            substitute(&tangent, &mut step);
            z.iter_mut().zip(&step).for_each(|(z, s)| *z += s);
            self.largest = z.iter().fold(self.largest, |most, z| most.max(z.abs()));
            size = step.iter().fold(0.0_f64, |most, s| most.max(s.abs()));
            // The balance of a linear law under a given force is exact after one step.
            is_near =
                size <= NEARLY * self.largest || (plain_law.is_linear() && !self.plain_load.depends_on_position());
        }
        if !is_near {
            return Err(diverged(time_s.value(), size / self.largest));
        }
        if !B::Scalar::HAS_DERIVATIVE {
            self.coordinates = z.map(B::Scalar::constant);
        }
        let x = self.position().value();
        if !x.is_finite() {
            return Err(diverged(time_s.value(), f64::NAN));
        }
        self.plain_load.check_feedback(&[x], time_s.value())
    }
}

/// Computes the LU factors of a small matrix in place, with the inverse pivots on the diagonal. Returns `false` if a pivot
/// vanishes. The tangent is nearly symmetric and positive definite, so that no pivoting is needed.
#[inline(always)]
fn factorise<const M: usize>(matrix: &mut [[f64; M]; M]) -> bool {
    for k in 0..M {
        let inverse = 1.0 / matrix[k][k];
        if !(inverse.abs() > 0.0 && inverse.is_finite()) {
            return false;
        }
        matrix[k][k] = inverse;
        let pivot_row = matrix[k];
        for row in &mut matrix[k + 1..] {
            let factor = row[k] * inverse;
            row[k] = factor;
            for j in k + 1..M {
                row[j] -= factor * pivot_row[j];
            }
        }
    }
    true
}

#[inline(always)]
fn substitute<N: Number, const M: usize>(factors: &[[f64; M]; M], vector: &mut [N; M]) {
    for i in 0..M {
        for j in 0..i {
            vector[i] = vector[i] - vector[j] * factors[i][j];
        }
    }
    for i in (0..M).rev() {
        for j in i + 1..M {
            vector[i] = vector[i] - vector[j] * factors[i][j];
        }
        vector[i] = vector[i] * factors[i][i];
    }
}

fn diverged(time_s: f64, change: f64) -> Error {
    Error::numerical(
        format!(
            "the reduced nonlinear balance is not found at {time_s} s: the last Newton step is {change:.1e} of the largest displacement"
        ),
        "give parameters inside the trained range, or use the full-order model",
    )
}
