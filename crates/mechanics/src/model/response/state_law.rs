//! The robot's position where a quantity depends on a state (physics §5.3): what it adds to the linear law's answer.
//!
//! A body whose element depends on a state answers as if it did not, to another stress: s + R. Where the element is a spring of modulus E beside others, R = −E (φ − 1) ε with
//! ε the body's strain; where it is the body, or the only one of its parts that is no spring, R = (1/φ − 1)(s − E ε), E the modulus of the springs beside it; a force that
//! depends is R = F (φ − 1) on all bodies. R is smooth between switches: a quartic through the nodes of [`super::collocation`], integrated exactly against every mode, and found with the
//! state by Newton's method.

use super::Response;
use super::collocation::{END, ModeStep, N_NODES, NODES, lagrange, of_mode};
use super::linear::{oscillating_row, row};
use super::moments::{entire_functions, entire_functions_of_decay};
use super::numbers::Real;
use super::schedule::{Level, Schedule};
use super::system::{BETWEEN_ROWS, Lowered, Mode, System, grading};
use crate::error::{Error, Result};
use crate::number::{Complex, Dual};
use crate::rheology::{Accuracy, Element, RetardationSpectrum, TimeWindow};
use crate::stages::{Leaf, Operation, Quantity, Stages, State, StateLaw};

/// Most steps of Newton's method at one step in time.
const MOST_NEWTON_STEPS: usize = 40;
/// A step of Newton's method that changes no node by more than this share of the largest force is the last but one: the one after it brings the derivative.
const LAST_STEP: f64 = 1e-12;
/// Shortest time after a switch that matters to R where switches fall on rows, as a part of the shortest step.
const WITHIN_ROWS: f64 = 0.04;
/// By how much a quantity is taken to change over the range of what moves it, for the lengths of steps.
const STRENGTH: f64 = 0.1;
/// Least share of a step of Newton's method that is tried.
const LEAST_SHARE: f64 = 1e-3;
/// Times nearer than this share of themselves are the same.
const CLOCK_ROUNDING: f64 = 1e-12;

/// How R follows from force, strain and the function.
#[derive(Clone, Copy)]
enum Source<T> {
    /// F (φ − 1), or the function itself.
    Force,
    /// −E (φ − 1) ε.
    Spring(T),
    /// (1/φ − 1)(s − E ε), E of the springs beside it.
    Other(T),
    /// None: the position is multiplied.
    Position,
}

/// Modes that answer the force, those of the body that depends first, each with what they are to R.
struct Modes<T> {
    real: Vec<Mode<T>>,
    oscillating: Vec<Mode<Complex<T>>>,
    /// How many of each are the body's.
    n_real: usize,
    n_oscillating: usize,
    /// C J₀ of the whole and of the body.
    instantaneous: [T; 2],
}

/// A step of one length.
struct Step<T> {
    real: Vec<ModeStep<T>>,
    oscillating: Vec<ModeStep<Complex<T>>>,
    /// Σ Y at the nodes of all modes, and of the body's, by level, slope and deficit.
    by_force: [[[T; N_NODES]; 3]; 2],
    /// Σ Y of the body's by R at the nodes.
    by_feedback: [[T; N_NODES]; N_NODES],
    length_s: T,
    lag_decay: [T; N_NODES],
    growth: [T; N_NODES],
}

/// What is carried from step to step.
struct Carried<T> {
    /// Under the force, all modes; under R, the body's.
    by_force: (Vec<T>, Vec<Complex<T>>),
    by_feedback: (Vec<T>, Vec<Complex<T>>),
    now_s: T,
    level_n: T,
    slope_n_per_s: T,
    deficit_n: T,
    growth: T,
    feedback_n: T,
    position_m: T,
    path_m: T,
    largest_m: T,
    velocity: T,
}

/// One run.
struct Run<'a, T> {
    law: &'a StateLaw,
    /// The function's parameters without what they carry.
    constants: Vec<Dual>,
    source: Source<T>,
    /// The quantity itself, where the function is added to it.
    quantity: Option<T>,
    modes: Modes<T>,
    rises: bool,
    /// Times of force steps after the delay, ascending.
    steps_s: Vec<T>,
    largest_n: f64,
    /// Derivatives at the nodes of the polynomial through the step's begin and the nodes.
    slopes: [[f64; N_NODES + 1]; N_NODES],
}

/// Force, strain and state at so many places at once.
struct Nodes<T, const N: usize> {
    force_n: [T; N],
    growth: [T; N],
    time_s: [T; N],
    /// Position and the body's share without R.
    known: [[T; N]; 2],
    /// Both by R at the nodes.
    by_feedback: [[T; N]; N],
}

impl<T: Real, const N: usize> Nodes<T, N> {
    /// The position, or the body's share of it, at the nodes under R.
    fn answers(&self, which: usize, feedback: &[T; N]) -> [T; N] {
        std::array::from_fn(|i| {
            let answered = (0..N).fold(self.known[which][i], |sum, j| self.by_feedback[i][j].mul_add(feedback[j], sum));
            self.growth[i] * answered
        })
    }
}

/// What the stages' state law adds to the linear law's position at every row, in m.
pub(super) fn excess_m<T: Real>(
    response: &Response,
    stages: &Stages,
    law: &StateLaw,
    compliance_per_m: T,
) -> Result<Vec<T>> {
    let TimeWindow { shortest_s, longest_s } = response.window;
    let at_rows =
        !response.record.is_linear && stages.load.delay_s.is_constant(0.0) && stages.load.lag_time_s.value == 0.0;
    let window = TimeWindow { shortest_s: shortest_s * if at_rows { WITHIN_ROWS } else { BETWEEN_ROWS }, longest_s };
    let spectrum = |law: &[Element]| RetardationSpectrum::<T>::with_accuracy(law, window, Accuracy::Fast);
    let (own, others): (&[Element], Vec<Element>) = match law.quantity {
        Quantity::Element(leaf) => {
            let own = stages.law.get(leaf.body..=leaf.body).ok_or_else(no_element)?;
            (own, [&stages.law[..leaf.body], &stages.law[leaf.body + 1..]].concat())
        }
        Quantity::Force | Quantity::Position => (&stages.law, Vec::new()),
    };
    let [of_body, of_others] = [spectrum(own)?, spectrum(&others)?];
    let softening = T::of(stages.softening_rate_per_s);
    let modes = Modes::new([&of_body, &of_others], compliance_per_m, softening);
    let mut whole = of_body;
    whole.modes.extend(of_others.modes);
    whole.oscillating.extend(of_others.oscillating);
    whole.instantaneous_per_pa += of_others.instantaneous_per_pa;
    whole.fluidity_per_pa_s += of_others.fluidity_per_pa_s;
    let record = &response.record;
    let mut lowered = Lowered::with_spectrum(stages, &whole, compliance_per_m, record.largest_n);
    let lag_rate = (stages.load.lag_time_s.value > 0.0).then(|| 1.0 / stages.load.lag_time_s.value);
    let total = whole.instantaneous_per_pa.value()
        + whole.modes.iter().map(|mode| mode.compliance_per_pa.value()).sum::<f64>()
        + whole.fluidity_per_pa_s.value() * longest_s;
    lowered.grading = grading(&whole, lag_rate, STRENGTH / total.max(f64::MIN_POSITIVE));
    let system = System::<T>::gather(&[&lowered]);
    let schedule = Schedule::new(record, &system);
    let (source, quantity) = source(law, &stages.law, compliance_per_m)?;
    let delay_s = T::of(stages.load.delay_s);
    let start_s = response.time_s.first().copied().unwrap_or(0.0);
    let steps = response.force.get().step_rows();
    let mut run = Run {
        law,
        constants: law.parameters.iter().map(|p| Dual::constant(p.value)).collect(),
        source,
        quantity,
        modes,
        rises: record.is_linear,
        steps_s: steps.iter().map(|&row| delay_s + T::constant(response.time_s[row] - start_s)).collect(),
        largest_n: record.largest_n.max(stages.load.offset_n.value.abs()).max(f64::MIN_POSITIVE),
        slopes: slopes(),
    };
    let steps: Vec<Step<T>> = schedule.length_s.iter().map(|&length_s| run.step(&system, length_s)).collect();
    run.through(&system, &schedule, &steps, record.n_rows)
}

fn no_element() -> Error {
    Error::numerical("the law has no such element where this effect would find it", "name another element")
}

/// How R follows, and the quantity where the function is added to it.
fn source<T: Real>(law: &StateLaw, elements: &[Element], compliance_per_m: T) -> Result<(Source<T>, Option<T>)> {
    let Quantity::Element(Leaf { body, part }) = law.quantity else {
        return Ok((if law.quantity == Quantity::Force { Source::Force } else { Source::Position }, None));
    };
    let own = elements.get(body).ok_or_else(no_element)?;
    let (leaf, beside): (&Element, Vec<&Element>) = match (own, part) {
        (Element::Parallel(parts), Some(part)) => {
            let leaf = parts.get(part).ok_or_else(no_element)?;
            (leaf, parts.iter().enumerate().filter(|(place, _)| *place != part).map(|(_, other)| other).collect())
        }
        (leaf, None) => (leaf, Vec::new()),
        _ => return Err(no_element()),
    };
    let number = match leaf {
        Element::Spring { modulus_pa } | Element::Springpot { modulus_pa, .. } => T::of(*modulus_pa),
        Element::Dashpot { viscosity_pa_s } => T::of(*viscosity_pa_s),
        _ => return Err(no_element()),
    };
    let quantity = (law.operation == Operation::Add).then_some(number);
    if let (Element::Spring { .. }, false) = (leaf, beside.is_empty()) {
        return Ok((Source::Spring(number / compliance_per_m), quantity));
    }
    let mut springs = T::constant(0.0);
    for other in beside {
        match other {
            Element::Spring { modulus_pa } => springs += T::of(*modulus_pa),
            _ => {
                return Err(Error::numerical(
                    "an element beside others that are no springs cannot depend on a state",
                    "let the spring of that body depend, or write the law with bodies in series",
                ));
            }
        }
    }
    Ok((Source::Other(springs / compliance_per_m), quantity))
}

impl<T: Real> Modes<T> {
    /// Of the body's spectrum and the others'.
    fn new(spectra: [&RetardationSpectrum<T>; 2], compliance_per_m: T, softening: T) -> Self {
        let mut modes = Self {
            real: vec![],
            oscillating: vec![],
            n_real: 0,
            n_oscillating: 0,
            instantaneous: [T::constant(0.0); 2],
        };
        for (place, spectrum) in spectra.into_iter().enumerate() {
            modes.real.extend(spectrum.modes.iter().map(|mode| Mode {
                gain: compliance_per_m * mode.compliance_per_pa * mode.rate_per_s,
                rate: mode.rate_per_s + softening,
            }));
            if spectrum.fluidity_per_pa_s.value() != 0.0 {
                modes.real.push(Mode { gain: compliance_per_m * spectrum.fluidity_per_pa_s, rate: softening });
            }
            modes.oscillating.extend(spectrum.oscillating.iter().map(|mode| {
                let complex = |[re, im]: [T; 2]| Complex { re, im };
                let rate = complex(mode.rate_per_s);
                let gain = (complex(mode.compliance_per_pa) * rate).times(compliance_per_m);
                Mode { gain, rate: Complex { re: rate.re + softening, im: rate.im } }
            }));
            let instantaneous = compliance_per_m * spectrum.instantaneous_per_pa;
            modes.instantaneous[0] += instantaneous;
            if place == 0 {
                (modes.n_real, modes.n_oscillating) = (modes.real.len(), modes.oscillating.len());
                modes.instantaneous[1] = instantaneous;
            }
        }
        modes
    }
}

/// Derivatives at the nodes of the polynomial through the begin of a step of length 1 and its nodes, by the values there.
fn slopes() -> [[f64; N_NODES + 1]; N_NODES] {
    let mut places = [0.0; N_NODES + 1];
    places[1..].copy_from_slice(&NODES);
    // ℓⱼ'(x) = Σ_k 1/(xⱼ − x_k) Π_{m≠j,k} (x − x_m)/(xⱼ − x_m).
    let slope = |j: usize, x: f64| -> f64 {
        let others = |k: usize| (0..=N_NODES).filter(move |m| *m != j && *m != k);
        let product = |k: usize| others(k).map(|m| (x - places[m]) / (places[j] - places[m])).product::<f64>();
        (0..=N_NODES).filter(|k| *k != j).map(|k| product(k) / (places[j] - places[k])).sum()
    };
    std::array::from_fn(|i| std::array::from_fn(|j| slope(j, NODES[i])))
}

impl<T: Real> Run<'_, T> {
    fn step(&self, system: &System<T>, length_s: T) -> Step<T> {
        let zero = T::constant(0.0);
        let polynomials = std::array::from_fn(lagrange);
        let lag_rate = system.shape.lagging.then_some(system.lag_rate);
        let mut step = Step {
            real: Vec::with_capacity(self.modes.real.len()),
            oscillating: Vec::with_capacity(self.modes.oscillating.len()),
            by_force: [[[zero; N_NODES]; 3]; 2],
            by_feedback: [[zero; N_NODES]; N_NODES],
            length_s,
            lag_decay: NODES.map(|part| lag_rate.map_or(zero, |rate| (rate * length_s * -part).exp())),
            growth: NODES.map(|part| (system.softening_rate * length_s * part).exp()),
        };
        for (place, mode) in self.modes.real.iter().enumerate() {
            let rows = NODES.map(|part| row(*mode, length_s * part, lag_rate, self.rises));
            let functions = NODES.map(|part| entire_functions_of_decay(mode.rate * length_s * part));
            let of_mode = of_mode(mode.gain * length_s, rows, functions, &polynomials);
            let by_force = [of_mode.by_level, of_mode.by_slope, of_mode.by_deficit];
            step.add(place < self.modes.n_real, by_force, of_mode.by_feedback);
            step.real.push(of_mode.step);
        }
        for (place, mode) in self.modes.oscillating.iter().enumerate() {
            let rows = NODES.map(|part| oscillating_row(*mode, length_s * part, lag_rate, self.rises));
            let functions = NODES.map(|part| entire_functions(mode.rate.times(length_s) * -part));
            let of_mode = of_mode(mode.gain.times(length_s), rows, functions, &polynomials);
            let by_force = [of_mode.by_level, of_mode.by_slope, of_mode.by_deficit].map(|by| by.map(|z| z.re));
            let by_feedback = of_mode.by_feedback.map(|by| by.map(|z| z.re));
            step.add(place < self.modes.n_oscillating, by_force, by_feedback);
            step.oscillating.push(of_mode.step);
        }
        step
    }

    /// Through all steps of a schedule; what is added at the rows.
    fn through(
        &mut self,
        system: &System<T>,
        schedule: &Schedule<T>,
        steps: &[Step<T>],
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
            position_m: zero,
            path_m: zero,
            largest_m: zero,
            velocity: zero,
        };
        let late_s = system.late_s();
        let mut excess_m = vec![zero; n_rows];
        if let Some(first) = excess_m.first_mut() {
            *first = self.excess(&now);
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
                self.jump(&mut now)?;
            }
            for step in 0..piece.n_steps() {
                self.advance(&steps[piece.length], &mut now)?;
                if let Some(row) = piece.end_row(step) {
                    excess_m[row] = self.excess(&now);
                }
            }
        }
        Ok(excess_m)
    }

    /// What is added now.
    fn excess(&self, now: &Carried<T>) -> T {
        let (one, force_n) = (T::constant(1.0), now.level_n + now.deficit_n);
        match self.source {
            Source::Position => {
                let position_m = now.position_m;
                let state = self.state_now(now, force_n);
                let value = T::of(self.law.value(state.carried()));
                if self.law.operation == Operation::Add { value } else { position_m * (value - one) }
            }
            _ => now.growth * self.modes.instantaneous[1].mul_add(now.feedback_n, sum(&now.by_feedback)),
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

    /// Time since the last step came to act: the limit from the right, or from the left.
    fn since_step(&self, now_s: T, is_after: bool) -> T {
        let rounding_s = CLOCK_ROUNDING * now_s.value().abs();
        let limit_s = now_s.value() + if is_after { rounding_s } else { -rounding_s };
        let acting = self.steps_s.partition_point(|step_s| step_s.value() < limit_s);
        acting.checked_sub(1).map_or(now_s, |last| now_s - self.steps_s[last])
    }

    /// The force has jumped: the position and R do, where something answers at once.
    fn jump(&self, now: &mut Carried<T>) -> Result<()> {
        let force_n = now.level_n + now.deficit_n;
        let [whole, own] = self.modes.instantaneous;
        if whole.value() == 0.0 {
            return Ok(());
        }
        let split = self.known(now);
        let nodes = Nodes {
            force_n: [force_n],
            growth: [now.growth],
            time_s: [now.now_s],
            known: [[whole.mul_add(force_n, split[0])], [own.mul_add(force_n, split[1])]],
            by_feedback: [[own]],
        };
        let (feedback, position, _) = self.balance(&nodes, now, None)?;
        now.feedback_n = feedback[0];
        self.moved(now, &position);
        Ok(())
    }

    /// Σ Y of all modes and of the body's, both with what R has left.
    fn known(&self, now: &Carried<T>) -> [T; 2] {
        let of_feedback = sum(&now.by_feedback);
        let (real, oscillating) = &now.by_force;
        let own_re = oscillating[..self.modes.n_oscillating].iter().fold(T::constant(0.0), |sum, y| sum + y.re);
        let own = real[..self.modes.n_real].iter().fold(own_re, |sum, y| sum + *y);
        [sum(&now.by_force) + of_feedback, own + of_feedback]
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

    fn advance(&self, step: &Step<T>, now: &mut Carried<T>) -> Result<()> {
        let zero = T::constant(0.0);
        let [whole, own] = self.modes.instantaneous;
        let mut known = [[zero; N_NODES]; 2];
        let mut force_n = [zero; N_NODES];
        for i in 0..N_NODES {
            force_n[i] = now.deficit_n.mul_add(step.lag_decay[i], now.level_n);
            if self.rises {
                force_n[i] += now.slope_n_per_s * step.length_s * NODES[i];
            }
            for (known, by) in known.iter_mut().zip(&step.by_force) {
                known[i] = by[0][i].mul_add(now.level_n, by[2][i] * now.deficit_n);
                if self.rises {
                    known[i] = by[1][i].mul_add(now.slope_n_per_s, known[i]);
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
            let y = now.by_feedback.0.get(place).map_or(y, |own| y + *own);
            add(place, self.modes.n_real, step.node_decay.map(|decay| decay * y));
        }
        for (place, (step, &y)) in step.oscillating.iter().zip(&now.by_force.1).enumerate() {
            let y = now.by_feedback.1.get(place).map_or(y, |own| y + *own);
            add(place, self.modes.n_oscillating, step.node_decay.map(|decay| (decay * y).re));
        }
        let mut by_feedback = step.by_feedback;
        for i in 0..N_NODES {
            known[0][i] = whole.mul_add(force_n[i], known[0][i]);
            known[1][i] = own.mul_add(force_n[i], known[1][i]);
            by_feedback[i][i] += own;
        }
        let growth = step.growth.map(|growth| now.growth * growth);
        let time_s = NODES.map(|part| now.now_s + step.length_s * part);
        let nodes = Nodes { force_n, growth, time_s, known, by_feedback };
        let (feedback, position_m, velocity) = self.balance(&nodes, now, Some(step.length_s))?;
        for (place, (step, y)) in step.real.iter().zip(&mut now.by_force.0).enumerate() {
            let mut next = step.whole.gain.mul_add(now.level_n, step.whole.lag_gain * now.deficit_n);
            if self.rises {
                next = step.whole.ramp_gain.mul_add(now.slope_n_per_s, next);
            }
            *y = step.whole.decay.mul_add(*y, next);
            if let Some(own) = now.by_feedback.0.get_mut(place) {
                *own = (0..N_NODES).fold(step.whole.decay * *own, |sum, k| step.weights[k].mul_add(feedback[k], sum));
            }
        }
        for (place, (step, y)) in step.oscillating.iter().zip(&mut now.by_force.1).enumerate() {
            let mut next = step.whole.gain.times(now.level_n) + step.whole.lag_gain.times(now.deficit_n);
            if self.rises {
                next = next + step.whole.ramp_gain.times(now.slope_n_per_s);
            }
            *y = step.whole.decay * *y + next;
            if let Some(own) = now.by_feedback.1.get_mut(place) {
                let weighted = |sum: Complex<T>, k: usize| sum + step.weights[k].times(feedback[k]);
                *own = (0..N_NODES).fold(step.whole.decay * *own, weighted);
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

    /// R and the positions at the nodes, and the velocity at the last, by Newton's method with the derivatives of values.
    fn balance<const N: usize>(
        &self,
        nodes: &Nodes<T, N>,
        now: &Carried<T>,
        length_s: Option<T>,
    ) -> Result<([T; N], [T; N], T)> {
        let ended = |feedback: [T; N]| {
            let position_m = nodes.answers(0, &feedback);
            let velocity = self.velocity(now, &position_m, length_s);
            Ok((feedback, position_m, velocity))
        };
        if matches!(self.source, Source::Position) {
            return ended([T::constant(0.0); N]);
        }
        let mut feedback = [now.feedback_n; N];
        let mut before = f64::INFINITY;
        let mut last_step: Option<([T; N], f64)> = None;
        let mut is_last = false;
        for _ in 0..MOST_NEWTON_STEPS {
            let (left, matrix) = self.imbalance(nodes, now, &feedback, length_s);
            let size = left.iter().fold(0.0_f64, |most, left| most.max(left.value().abs()));
            // A step that leads away was too long. What is not a number leads away.
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
            if is_last {
                return ended(feedback);
            }
            is_last = step.iter().all(|step| step.value().abs() <= LAST_STEP * self.largest_n);
            (before, last_step) = (size, Some((step, 1.0)));
        }
        Err(no_balance(now.now_s.value()))
    }

    /// What R lacks at the nodes, and the derivatives of R less that by R.
    fn imbalance<const N: usize>(
        &self,
        nodes: &Nodes<T, N>,
        now: &Carried<T>,
        feedback: &[T; N],
        length_s: Option<T>,
    ) -> ([T; N], [[f64; N]; N]) {
        let [position_m, share_m] = [0, 1].map(|which| nodes.answers(which, feedback));
        let (states, by_position) = self.states(nodes, now, &position_m, &share_m, length_s);
        let mut matrix = [[0.0; N]; N];
        let mut left = [T::constant(0.0); N];
        for i in 0..N {
            let strain = share_m[i] / nodes.growth[i];
            let slope = self.law.function.0.value(Dual::variable(states[i].value()), &self.constants);
            let value = if T::CARRIES { T::of(self.law.value(states[i].carried())) } else { T::of(slope) };
            let (target, by_value, by_strain) = self.feedback(value, nodes.force_n[i], strain);
            left[i] = target - feedback[i];
            for j in 0..N {
                let moved = |k: usize| nodes.growth[k].value() * nodes.by_feedback[k][j].value();
                let state: f64 = (0..N).map(|k| by_position[i][k] * moved(k)).sum();
                let by_state = by_value * slope.derivative * state;
                matrix[i][j] = f64::from(u8::from(i == j)) - by_state - by_strain * nodes.by_feedback[i][j].value();
            }
        }
        (left, matrix)
    }

    /// R, and its derivatives by the function's value and by the strain.
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
        let slopes = &self.slopes[node];
        let begin = now.position_m * slopes[0];
        position_m.iter().zip(&slopes[1..]).fold(begin, |sum, (x, slope)| sum + *x * *slope) / length_s
    }

    /// States at the nodes, and their derivatives by the positions there.
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
                // R moves the body and the robot by the same.
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
                    let own = size(position_m[i]);
                    if own.value() > largest_m.value() {
                        (largest_m, by) = (own, [0.0; N]);
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

impl<T: Real> Step<T> {
    fn add(&mut self, is_own: bool, by_force: [[T; N_NODES]; 3], by_feedback: [[T; N_NODES]; N_NODES]) {
        let n_sums = if is_own { 2 } else { 1 };
        for sums in &mut self.by_force[..n_sums] {
            for (sum, by) in sums.iter_mut().zip(&by_force) {
                (0..N_NODES).for_each(|i| sum[i] += by[i]);
            }
        }
        if is_own {
            for (sum, by) in self.by_feedback.iter_mut().zip(&by_feedback) {
                (0..N_NODES).for_each(|j| sum[j] += by[j]);
            }
        }
    }
}

/// The solution of a system of values for numbers that may carry a derivative, by elimination with pivots; none where there is none.
fn solved<T: Real, const N: usize>(mut matrix: [[f64; N]; N], mut right: [T; N]) -> Option<[T; N]> {
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

fn sum<T: Real>((real, oscillating): &(Vec<T>, Vec<Complex<T>>)) -> T {
    let of_real = real.iter().fold(T::constant(0.0), |sum, y| sum + *y);
    oscillating.iter().fold(of_real, |sum, y| sum + y.re)
}

fn size<T: Real>(x: T) -> T {
    if x.value() < 0.0 { -x } else { x }
}

fn no_balance(time_s: f64) -> Error {
    Error::numerical(
        format!(
            "no force and position that agree are found {time_s} s after the record's start: the quantity changes too fast with its state"
        ),
        "take parameters nearer to their nulls",
    )
}
