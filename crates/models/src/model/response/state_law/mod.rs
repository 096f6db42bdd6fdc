//! Excess of the robot's position over that of the linear law, if a quantity depends on a state (physics §5.3).
//!
//! A body with a state-dependent element responds like the unchanged body under another stress s + R. The pseudo-stress R depends
//! on the factor φ, the function of the state. For a spring of modulus E in parallel with other elements, R = −E (φ − 1) ε with ε
//! the body's strain. For an element that is the body's only one, or its only one besides springs, R = (1/φ − 1)(s − E ε). Here E
//! is the modulus of the parallel springs. For a state-dependent force, R = F (φ − 1) on all bodies. R is smooth between switches
//! of the force. A quartic through the nodes of [`super::collocation`] represents it and is integrated exactly against every
//! mode. Newton's method finds R together with the state.

mod balance;
mod modes;
mod slopes;

use self::balance::{Nodes, Source, no_element, source};
use self::modes::{Modes, Step, next, slopes};
use self::slopes::Slopes;
use super::Response;
use super::collocation::{END, N_NODES, NODES};
use super::numbers::Real;
use super::schedule::{Level, Schedule};
use super::system::{BETWEEN_ROWS, PointNumbers, System, grading};
use base::error::Result;
use base::number::{Complex, Dual};
use laws::rheology::{Accuracy, Element, RetardationSpectrum, TimeWindow};
use laws::stages::{Operation, Quantity, Stages, State, StateLaw};

/// Shortest relevant time after a switch for the pseudo-stress, divided by the shortest step. It applies if switches coincide with rows.
const WITHIN_ROWS: f64 = 0.04;
/// Assumed relative change of a quantity over the range of its state, for the choice of step lengths.
const STRENGTH: f64 = 0.1;
/// Largest ratio of a step to the previous step for which the previous step's polynomial is extrapolated.
const MOST_AHEAD: f64 = 2.5;
/// Relative difference below which two times are equal.
const CLOCK_ROUNDING: f64 = 1e-12;

/// State of the modes, of the force and of the motion between two steps.
struct Carried<T> {
    /// Response of all modes to the force, real and oscillating.
    by_force: (Vec<T>, Vec<Complex<T>>),
    /// Response of the body's modes to the pseudo-stress, real and oscillating.
    by_feedback: (Vec<T>, Vec<Complex<T>>),
    now_s: T,
    level_n: T,
    slope_n_per_s: T,
    deficit_n: T,
    growth: T,
    feedback_n: T,
    /// Pseudo-stress at the start and nodes of the last step, and the step's length in s. They give the initial guess for the next step.
    /// `None` after a jump of the force.
    before: Option<([T; N_NODES + 1], f64)>,
    position_m: T,
    path_m: T,
    largest_m: T,
    velocity: T,
}

/// Data of one run through a record with a state-dependent quantity.
struct StateLawRun<'a, T> {
    law: &'a StateLaw,
    /// Values of the state-dependent function's parameters, without derivatives.
    constants: Vec<Dual>,
    source: Source<T>,
    /// Value of the quantity if the function is added to it; `None` if the function is a factor.
    quantity: Option<T>,
    modes: Modes<T>,
    rises: bool,
    /// Times in s at which force steps begin to act, delay included, ascending.
    steps_s: Vec<T>,
    largest_n: f64,
    /// Derivatives, at each node (row), of the polynomial through values at the step's start and nodes (columns).
    slopes: [[f64; N_NODES + 1]; N_NODES],
    /// Weights of the values at the start and nodes (columns) that extrapolate to each node (row) of an equally long next step.
    next: [[f64; N_NODES + 1]; N_NODES],
}

/// Returns the excess, in m at every row, of the position with a state-dependent quantity over that of the linear law.
pub(super) fn excess_m<T: Real>(
    response: &Response,
    stages: &Stages,
    law: &StateLaw,
    compliance_per_m: T,
) -> Result<Vec<T>> {
    excess(response, stages, law, compliance_per_m, false).map(|(excess_m, _)| excess_m)
}

/// Returns the excess (m) of the position over that of the linear law at every row. Also returns the derivatives of the excess by each
/// parameter of the function, indexed by parameter and then by row.
pub(super) fn excess_and_slopes_m(
    response: &Response,
    stages: &Stages,
    law: &StateLaw,
    compliance_per_m: f64,
) -> Result<(Vec<f64>, Vec<Vec<f64>>)> {
    excess(response, stages, law, compliance_per_m, true)
}

fn excess<T: Real>(
    response: &Response,
    stages: &Stages,
    law: &StateLaw,
    compliance_per_m: T,
    has_slopes: bool,
) -> Result<(Vec<T>, Vec<Vec<f64>>)> {
    let TimeWindow { shortest_s, longest_s } = response.window;
    let at_rows = !response.record.is_linear && stages.load.acts_at_rows();
    let window = TimeWindow { shortest_s: shortest_s * if at_rows { WITHIN_ROWS } else { BETWEEN_ROWS }, longest_s };
    let spectrum = |law: &[Element]| RetardationSpectrum::<T>::of_law_with_accuracy(law, window, Accuracy::Fast);
    let (elements, others): (&[Element], Vec<Element>) = match law.quantity {
        Quantity::Element(leaf) => {
            let entry = stages.law.get(leaf.body..=leaf.body).ok_or_else(no_element)?;
            (entry, [&stages.law[..leaf.body], &stages.law[leaf.body + 1..]].concat())
        }
        Quantity::Force | Quantity::Position => (&stages.law, Vec::new()),
    };
    let [of_body, of_others] = [spectrum(elements)?, spectrum(&others)?];
    let softening = T::from_dual(stages.softening_rate_per_s);
    let modes = Modes::new([&of_body, &of_others], compliance_per_m, softening);
    let mut whole = of_body;
    whole.modes.extend(of_others.modes);
    whole.oscillating.extend(of_others.oscillating);
    whole.instantaneous_per_pa += of_others.instantaneous_per_pa;
    whole.fluidity_per_pa_s += of_others.fluidity_per_pa_s;
    let record = &response.record;
    let mut lowered = PointNumbers::with_spectrum(stages, &whole, compliance_per_m, record.largest_n);
    let lag_rate = stages.load.of::<f64>().lag_rate_per_s();
    let total = whole.instantaneous_per_pa.value()
        + whole.modes.iter().map(|mode| mode.compliance_per_pa.value()).sum::<f64>()
        + whole.fluidity_per_pa_s.value() * longest_s;
    lowered.grading = grading(&whole, lag_rate, STRENGTH / total.max(f64::MIN_POSITIVE));
    let system = System::<T>::gather(&[&lowered]);
    let schedule = Schedule::new(record, &system);
    let (source, quantity) = source(law, &stages.law, compliance_per_m)?;
    let load = stages.load.of::<T>();
    let start_s = response.time_s.first().copied().unwrap_or(0.0);
    let steps = response.force.get().step_rows();
    let mut run = StateLawRun {
        law,
        constants: law.parameters.iter().map(|p| Dual::constant(p.value)).collect(),
        source,
        quantity,
        modes,
        rises: record.is_linear,
        steps_s: steps.iter().map(|&row| load.action_time_s(response.time_s[row] - start_s)).collect(),
        largest_n: record.largest_n.max(load.start_n().value().abs()).max(f64::MIN_POSITIVE),
        slopes: slopes(),
        next: next(1.0),
    };
    let steps: Vec<Step<T>> =
        schedule.length_s.iter().map(|&length_s| Step::new(&run.modes, &system, length_s, run.rises)).collect();
    let n_parameters = if has_slopes { law.parameters.len() } else { 0 };
    let mut slopes = Slopes::new(n_parameters, &run.modes, record.n_rows);
    let excess_m = run.through(&system, &schedule, &steps, has_slopes.then_some(&mut slopes), record.n_rows)?;
    Ok((excess_m, slopes.excess_m()))
}

impl<T: Real> StateLawRun<'_, T> {
    /// Steps through the whole schedule and returns the excess (m) over the linear law's position at the rows.
    fn through(
        &mut self,
        system: &System<T>,
        schedule: &Schedule<T>,
        steps: &[Step<T>],
        mut slopes: Option<&mut Slopes>,
        n_rows: usize,
    ) -> Result<Vec<T>> {
        let zero = T::constant(0.0);
        let zeros = |n: usize| vec![zero; n];
        let complex = |n: usize| vec![Complex { re: zero, im: zero }; n];
        let mut now = Carried {
            by_force: (zeros(self.modes.real.len()), complex(self.modes.oscillating.len())),
            by_feedback: (zeros(self.modes.n_real), complex(self.modes.n_oscillating)),
            now_s: zero,
            level_n: zero,
            slope_n_per_s: zero,
            deficit_n: zero,
            growth: T::constant(1.0),
            feedback_n: zero,
            before: None,
            position_m: zero,
            path_m: zero,
            largest_m: zero,
            velocity: zero,
        };
        let late_s = system.late_s();
        let mut excess_m = vec![zero; n_rows];
        if let Some(first) = excess_m.first_mut() {
            *first = self.excess(&now);
            if let Some(slopes) = &mut slopes {
                self.note_slopes(slopes, &now, 0);
            }
        }
        for piece in &schedule.pieces {
            let level: &Level<T> = &schedule.levels[piece.level];
            let (before_n, mut level_n) = (now.level_n + now.deficit_n, level.force_n);
            if schedule.is_linear {
                level_n += level.slope_n_per_s * (now.now_s - level.from_s - late_s);
                now.slope_n_per_s = level.slope_n_per_s;
            }
            if system.shape.lagging {
                now.deficit_n += now.level_n - level_n;
            }
            now.level_n = level_n;
            if (now.level_n + now.deficit_n).value() != before_n.value() {
                now.before = None;
                self.jump(&mut now, slopes.as_deref_mut())?;
            }
            for step in 0..piece.n_steps() {
                self.advance(&steps[piece.length], &mut now, slopes.as_deref_mut())?;
                if let Some(row) = piece.end_row(step) {
                    excess_m[row] = self.excess(&now);
                    if let Some(slopes) = &mut slopes {
                        self.note_slopes(slopes, &now, row);
                    }
                }
            }
        }
        Ok(excess_m)
    }

    /// Returns the excess (m) of the position over that of the linear law, in the state `now`.
    fn excess(&self, now: &Carried<T>) -> T {
        let (one, force_n) = (T::constant(1.0), now.level_n + now.deficit_n);
        match self.source {
            Source::Position => {
                let position_m = now.position_m;
                let state = self.state_now(now, force_n);
                let value = T::from_dual(self.law.value(state.carried()));
                if self.law.operation == Operation::Add { value } else { position_m * (value - one) }
            }
            _ => now.growth * (self.modes.instantaneous[1] * now.feedback_n + sum(&now.by_feedback)),
        }
    }

    fn state_now(&self, now: &Carried<T>, force_n: T) -> T {
        match self.law.state {
            State::Position | State::Strain => now.position_m,
            State::Path => now.path_m,
            State::Time => now.now_s,
            State::TimeSinceStep => self.since_step(now.now_s, false),
            State::Velocity => now.velocity,
            State::Force => force_n,
            State::LargestExcursion => now.largest_m,
        }
    }

    /// Returns the time in s since the last force step began to act, as the limit from the right (`is_after`) or from the left.
    fn since_step(&self, now_s: T, is_after: bool) -> T {
        let rounding_s = CLOCK_ROUNDING * now_s.value().abs();
        let limit_s = now_s.value() + if is_after { rounding_s } else { -rounding_s };
        let acting = self.steps_s.partition_point(|step_s| step_s.value() < limit_s);
        acting.checked_sub(1).map_or(now_s, |last| now_s - self.steps_s[last])
    }

    /// Updates position and pseudo-stress after a jump of the force.
    fn jump(&self, now: &mut Carried<T>, slopes: Option<&mut Slopes>) -> Result<()> {
        let force_n = now.level_n + now.deficit_n;
        let [whole, item] = self.modes.instantaneous;
        if whole.value() == 0.0 {
            return Ok(());
        }
        let split = self.known(now);
        let nodes = Nodes {
            force_n: [force_n],
            growth: [now.growth],
            time_s: [now.now_s],
            known: [[whole * force_n + split[0]], [item * force_n + split[1]]],
            by_feedback: [[item]],
        };
        let (feedback, position, _) = self.balance(&nodes, now, None, [now.feedback_n])?;
        if let Some(slopes) = slopes {
            self.follow(slopes, (&nodes, now), (&feedback, &position), None)?;
        }
        now.feedback_n = feedback[0];
        self.moved(now, &position);
        Ok(())
    }

    /// Returns the sum of all modes' contributions to the position, and the sum for the state-dependent body's modes. Both include the
    /// response to the pseudo-stress in earlier steps.
    fn known(&self, now: &Carried<T>) -> [T; 2] {
        let of_feedback = sum(&now.by_feedback);
        let (real, oscillating) = &now.by_force;
        let own_re = oscillating[..self.modes.n_oscillating].iter().fold(T::constant(0.0), |sum, y| sum + y.re);
        let item = real[..self.modes.n_real].iter().fold(own_re, |sum, y| sum + *y);
        [sum(&now.by_force) + of_feedback, item + of_feedback]
    }

    fn moved(&self, now: &mut Carried<T>, position_m: &[T]) {
        for &x in position_m {
            now.path_m += size(x - now.position_m);
            now.position_m = x;
            if size(x).value() > now.largest_m.value() {
                now.largest_m = size(x);
            }
        }
    }

    /// Returns an initial guess of the pseudo-stress at the nodes of a step. It extrapolates the polynomial of the previous step. If the
    /// polynomial differs too much from its tangent, as after a kink, the tangent is extrapolated instead.
    fn ahead(&self, now: &Carried<T>, length_s: f64) -> [T; N_NODES] {
        let Some((at, before_s)) = &now.before else { return [now.feedback_n; N_NODES] };
        let (ratio, zero) = (length_s / before_s, T::constant(0.0));
        let sum =
            |weights: &[f64; N_NODES + 1]| at.iter().zip(weights).fold(zero, |sum, (r, weight)| sum + *r * *weight);
        let slope = sum(&self.slopes[END]);
        let tangent = NODES.map(|part| now.feedback_n + slope * (ratio * part));
        if ratio > MOST_AHEAD {
            return tangent;
        }
        let polynomial = if ratio == 1.0 {
            self.next.map(|weights| sum(&weights))
        } else {
            next(ratio).map(|weights| sum(&weights))
        };
        let changed = (now.feedback_n - at[0]).value().abs();
        let parts = (polynomial[END] - tangent[END]).value().abs() > changed;
        if parts { tangent } else { polynomial }
    }

    fn advance(&self, step: &Step<T>, now: &mut Carried<T>, slopes: Option<&mut Slopes>) -> Result<()> {
        let zero = T::constant(0.0);
        let [whole, item] = self.modes.instantaneous;
        let mut known = [[zero; N_NODES]; 2];
        let mut force_n = [zero; N_NODES];
        for i in 0..N_NODES {
            force_n[i] = now.deficit_n * step.lag_decay[i] + now.level_n;
            if self.rises {
                force_n[i] += now.slope_n_per_s * step.length_s * NODES[i];
            }
            for (known, by) in known.iter_mut().zip(&step.by_force) {
                known[i] = by[0][i] * now.level_n + by[2][i] * now.deficit_n;
                if self.rises {
                    known[i] = by[1][i] * now.slope_n_per_s + known[i];
                }
            }
        }
        let mut add = |place: usize, limit: usize, decayed: [T; N_NODES]| {
            for i in 0..N_NODES {
                known[0][i] += decayed[i];
                if place < limit {
                    known[1][i] += decayed[i];
                }
            }
        };
        for (place, (step, &y)) in step.real.iter().zip(&now.by_force.0).enumerate() {
            let y = now.by_feedback.0.get(place).map_or(y, |item| y + *item);
            add(place, self.modes.n_real, step.node_decay.map(|decay| decay * y));
        }
        for (place, (step, &y)) in step.oscillating.iter().zip(&now.by_force.1).enumerate() {
            let y = now.by_feedback.1.get(place).map_or(y, |complex| y + *complex);
            add(place, self.modes.n_oscillating, step.node_decay.map(|decay| (decay * y).re));
        }
        let mut by_feedback = step.by_feedback;
        for i in 0..N_NODES {
            known[0][i] = whole * force_n[i] + known[0][i];
            known[1][i] = item * force_n[i] + known[1][i];
            by_feedback[i][i] += item;
        }
        let growth = step.growth.map(|growth| now.growth * growth);
        let time_s = NODES.map(|part| now.now_s + step.length_s * part);
        let nodes = Nodes { force_n, growth, time_s, known, by_feedback };
        let guess = self.ahead(now, step.length_s.value());
        let (feedback, position_m, velocity) = self.balance(&nodes, now, Some(step.length_s), guess)?;
        if let Some(slopes) = slopes {
            self.follow(slopes, (&nodes, now), (&feedback, &position_m), Some(step))?;
        }
        let mut at = [now.feedback_n; N_NODES + 1];
        at[1..].copy_from_slice(&feedback);
        now.before = Some((at, step.length_s.value()));
        for (place, (step, y)) in step.real.iter().zip(&mut now.by_force.0).enumerate() {
            let mut next = step.whole.gain * now.level_n + step.whole.lag_gain * now.deficit_n;
            if self.rises {
                next = step.whole.ramp_gain * now.slope_n_per_s + next;
            }
            *y = step.whole.decay * *y + next;
            if let Some(entry) = now.by_feedback.0.get_mut(place) {
                *entry = (0..N_NODES).fold(step.whole.decay * *entry, |sum, k| sum + step.weights[k] * feedback[k]);
            }
        }
        for (place, (step, y)) in step.oscillating.iter().zip(&mut now.by_force.1).enumerate() {
            let mut next = step.whole.gain.times(now.level_n) + step.whole.lag_gain.times(now.deficit_n);
            if self.rises {
                next = next + step.whole.ramp_gain.times(now.slope_n_per_s);
            }
            *y = step.whole.decay * *y + next;
            if let Some(current) = now.by_feedback.1.get_mut(place) {
                let weighted = |sum: Complex<T>, k: usize| sum + step.weights[k].times(feedback[k]);
                *current = (0..N_NODES).fold(step.whole.decay * *current, weighted);
            }
        }
        now.deficit_n = now.deficit_n * step.lag_decay[END];
        now.growth = growth[END];
        now.now_s += step.length_s;
        if self.rises {
            now.level_n += now.slope_n_per_s * step.length_s;
        }
        now.feedback_n = feedback[END];
        now.velocity = velocity;
        self.moved(now, &position_m);
        Ok(())
    }
}

fn sum<T: Real>((real, oscillating): &(Vec<T>, Vec<Complex<T>>)) -> T {
    let of_real = real.iter().fold(T::constant(0.0), |sum, y| sum + *y);
    oscillating.iter().fold(of_real, |sum, y| sum + y.re)
}

fn size<T: Real>(x: T) -> T {
    if x.value() < 0.0 { -x } else { x }
}
