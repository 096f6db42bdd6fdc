//! Robot's position under a force that does not depend on the position. The recursions are exact, with one exponential for each
//! mode and each distinct step length.
//!
//! Between switches the force is L + D e^{−λt}. L is the level that the force approaches, D the deficit, and λ = 1/τ the rate of
//! a lag τ. A mode Y has the rate ρ and the gain κ. Over a step h it changes by Y ← d Y + q L + k D, with d = e^{−ρh}, q = κ ∫
//! e^{−ρ(h−s)} ds and k = κ ∫ e^{−ρ(h−s)} e^{−λs} ds. If L rises linearly at the rate S, then r S is added, with r = κ ∫
//! e^{−ρ(h−s)} s ds. Behind a lag, a rising L is the command at the time τ earlier. A switch between rows acts by superposition.
//! The step is first taken without the switch. Then the response to the switch, from its time to the end of the step, is added.
//! All points therefore take equal steps, whatever their delays.

use pulp::{Arch, Simd, WithSimd};

use super::moments::entire_functions_of_decay;
use super::numbers::{ComplexLanes, Field, N_LANES, Number, Real};
use super::prepared_record::PreparedRows;
use super::system::{Mode, System};
use base::number::{Complex, PointScalar, Scalar};

/// Coefficients of all modes for each distinct step length h. Those of one step are consecutive.
struct LinearSteps<S> {
    modes: Vec<LinearRow<S>>,
    oscillating: Vec<LinearRow<Complex<S>>>,
    lag_decays: Vec<S>,
    lengths_s: Vec<f64>,
}

/// Coefficients of all modes for a step of length h.
#[derive(Clone, Copy)]
struct LinearStep<'a, S> {
    modes: &'a [LinearRow<S>],
    oscillating: &'a [LinearRow<Complex<S>>],
    /// Factor e^{−λh} by which the deficit behind a lag decays over the step, with λ the lag's rate; 0 without a lag.
    lag_decay: S,
    length_s: f64,
}

/// Coefficients of one mode Y for one step: Y ← d Y + q L + k D + r S. L is the level that the force approaches, D the deficit (force minus
/// level), and S the level's rate.
#[derive(Clone, Copy)]
pub(super) struct LinearRow<T> {
    /// Coefficient d of the mode itself, its decay over the step.
    pub decay: T,
    /// Coefficient q of the force level.
    pub gain: T,
    /// Coefficient k of the deficit behind a lag; 0 without a lag.
    pub lag_gain: T,
    /// Coefficient r of the level's rate; 0 if the level is constant over the step.
    pub ramp_gain: T,
}

impl<T: Copy> LinearRow<T> {
    pub fn filled(zero: T) -> Self {
        Self { decay: zero, gain: zero, lag_gain: zero, ramp_gain: zero }
    }
}

/// Returns the coefficients of a mode over a step of this length. `rises` is `true` if the force level changes linearly; otherwise the
/// coefficient of its rate is 0.
#[inline(always)]
pub(super) fn row<N: Number>(mode: Mode<N>, length_s: N, lag_rate: Option<N>, rises: bool) -> LinearRow<N> {
    let z = mode.rate * length_s;
    let (decay, mean) = z.decay();
    let input = mode.gain * length_s;
    let lag_gain = match lag_rate {
        Some(lag_rate) => input * z.overlap(lag_rate * length_s),
        None => N::constant(0.0),
    };
    let ramp_gain = if rises { input * length_s * entire_functions_of_decay(z)[1] } else { N::constant(0.0) };
    LinearRow { decay, gain: input * mean, lag_gain, ramp_gain }
}

/// Returns the coefficients of an oscillating mode over a step of this length. The arguments are those of [`row`].
pub(super) fn oscillating_row<N: Real>(
    mode: Mode<Complex<N>>,
    length_s: N,
    lag_rate: Option<N>,
    rises: bool,
) -> LinearRow<Complex<N>> {
    let z = mode.rate.times(length_s);
    let input = mode.gain.times(length_s);
    let lag_gain = lag_rate.map_or(Complex::real(0.0), |lag_rate| {
        let b = Complex { re: lag_rate * length_s, im: N::constant(0.0) };
        let (smaller, difference) = if z.re.value() < b.re.value() { (z, b - z) } else { (b, z - b) };
        input * (smaller * -1.0).exponential() * mean_decay(difference)
    });
    let ramp_gain = match rises {
        true => input.times(length_s) * super::moments::entire_functions(z * -1.0)[1],
        false => Complex::real(0.0),
    };
    LinearRow { decay: (z * -1.0).exponential(), gain: input * mean_decay(z), lag_gain, ramp_gain }
}

/// Returns (1 − e⁻ᶻ)/z, which is the mean of e⁻ˢ over s from 0 to z. A series is used near 0.
fn mean_decay<N: Real>(z: Complex<N>) -> Complex<N> {
    super::moments::entire_functions(z * -1.0)[0]
}

impl<S: Number> Mode<S> {
    pub fn lane(self, lane: usize) -> Mode<S::Lane> {
        Mode { gain: self.gain.lane(lane), rate: self.rate.lane(lane) }
    }
}

impl<S: Number> Mode<Complex<S>> {
    pub fn lane(self, lane: usize) -> Mode<Complex<S::Lane>> {
        Mode { gain: self.gain.lane(lane), rate: self.rate.lane(lane) }
    }
}

impl<S: Number> LinearSteps<S> {
    fn new(system: &System<S>, lengths_s: &[f64], rises: bool) -> Self {
        let (zero, n) = (S::constant(0.0), lengths_s.len());
        let mut steps = Self {
            modes: vec![LinearRow::filled(zero); n * system.modes.len()],
            oscillating: vec![LinearRow::filled(complex_zero()); n * system.oscillating.len()],
            lag_decays: vec![zero; n],
            lengths_s: lengths_s.to_vec(),
        };
        Arch::new().dispatch(FillRows { system, lengths_s, rises, rows: &mut steps.modes });
        for (step, &length_s) in lengths_s.iter().enumerate() {
            let targets = &mut steps.oscillating[step * system.oscillating.len()..][..system.oscillating.len()];
            for lane in 0..S::N_POINTS {
                let length_s = S::Lane::constant(length_s);
                let lag_rate = system.shape.lagging.then(|| system.lag_rate.lane(lane));
                for (mode, target) in system.oscillating.iter().zip(targets.iter_mut()) {
                    let of_lane = oscillating_row(mode.lane(lane), length_s, lag_rate, rises);
                    target.decay.set_lane(lane, of_lane.decay);
                    target.gain.set_lane(lane, of_lane.gain);
                    target.lag_gain.set_lane(lane, of_lane.lag_gain);
                    target.ramp_gain.set_lane(lane, of_lane.ramp_gain);
                }
                if let Some(lag_rate) = lag_rate {
                    steps.lag_decays[step].set_lane(lane, (-(lag_rate * length_s)).exp());
                }
            }
        }
        steps
    }

    fn of(&self, step: usize) -> LinearStep<'_, S> {
        let n = self.lengths_s.len();
        let [real, oscillating] = [self.modes.len() / n, self.oscillating.len() / n];
        LinearStep {
            modes: &self.modes[step * real..][..real],
            oscillating: &self.oscillating[step * oscillating..][..oscillating],
            lag_decay: self.lag_decays[step],
            length_s: self.lengths_s[step],
        }
    }
}

/// Task that fills the coefficients of the real modes, for all steps, at all points at once.
struct FillRows<'a, S> {
    system: &'a System<S>,
    lengths_s: &'a [f64],
    rises: bool,
    rows: &'a mut [LinearRow<S>],
}

impl<S: Number> WithSimd for FillRows<'_, S> {
    type Output = ();

    #[inline(always)]
    fn with_simd<V: Simd>(self, _simd: V) {
        let lag_rate = if self.system.shape.lagging { Some(self.system.lag_rate) } else { None };
        let mut targets = self.rows.iter_mut();
        for length_s in self.lengths_s {
            let length_s = S::constant(*length_s);
            for (mode, target) in self.system.modes.iter().zip(&mut targets) {
                *target = row(*mode, length_s, lag_rate, self.rises);
            }
        }
    }
}

fn complex_zero<N: Number>() -> Complex<N> {
    Complex { re: N::constant(0.0), im: N::constant(0.0) }
}

/// Switch of the force between two rows, for one parameter point. The point's delay moves the switch away from the rows.
struct BetweenRowsSwitch<N> {
    lane: usize,
    /// First row after the switch.
    row: usize,
    /// Time from the switch to the first row after it, in s.
    remaining_s: N,
    /// Change of the level at the switch, in N.
    change_n: N,
    /// Change of the level's rate at the switch, in N/s.
    bend_n_per_s: N,
}

/// Returns the switches between rows of all parameter points, in the order of the rows.
fn between_row_switches<S: Number>(record: &PreparedRows, system: &System<S>) -> Vec<BetweenRowsSwitch<S::Lane>> {
    let mut between_row_switches = Vec::with_capacity(S::N_POINTS * record.switches.len());
    let mut rows = [1; N_LANES];
    // The inner loop is over the points. Their delays are similar, so the switches are nearly sorted by row.
    for switch in &record.switches {
        let (after_n, after_slope) = system.scaled(switch.after, switch.time_s);
        let (before_n, before_slope) = system.scaled(switch.before, switch.time_s);
        let (change_n, bend_n_per_s) = (after_n - before_n, after_slope - before_slope);
        for lane in 0..S::N_POINTS {
            let delay_s = system.load.delay_s.lane(lane);
            let time_s = switch.time_s + delay_s.value();
            let mut row = rows[lane].max(switch.row);
            while row < record.n_rows && record.time_s[row] <= time_s {
                row += 1;
            }
            rows[lane] = row;
            if row < record.n_rows {
                let remaining_s = S::Lane::constant(record.time_s[row] - switch.time_s) - delay_s;
                let (change_n, bend_n_per_s) = (change_n.lane(lane), bend_n_per_s.lane(lane));
                between_row_switches.push(BetweenRowsSwitch { lane, row, remaining_s, change_n, bend_n_per_s });
            }
        }
    }
    between_row_switches.sort_by_key(|kick| kick.row);
    between_row_switches
}

/// Response of every mode, at the time `after_s` after a switch, to a unit change of the level and to a unit change of the
/// level's rate.
struct SwitchResponse<N> {
    after_s: N,
    modes: Vec<(N, N)>,
    oscillating: Vec<(Complex<N>, Complex<N>)>,
    /// Time in s by which a lag delays a linearly changing force.
    late_s: N,
    /// Decay factor e^{−λt} of the lag, with λ its rate and t the time `after_s`; 0 without a lag.
    lag_decay: N,
}

impl<N: Real> SwitchResponse<N> {
    fn new<S: Number<Lane = N>>(system: &System<S>, lane: usize, after_s: N, rises: bool) -> Self {
        let lag_rate = system.shape.lagging.then(|| system.lag_rate.lane(lane));
        let late_s = system.late_s().lane(lane);
        let real = system.modes.iter().map(|mode| row(mode.lane(lane), after_s, lag_rate, rises));
        let complex = system.oscillating.iter().map(|mode| oscillating_row(mode.lane(lane), after_s, lag_rate, rises));
        // Behind a lag of time τ, a change of the slope shifts the level by −τ times this change, and the force itself does not jump.
        let of_real = |row: LinearRow<N>| {
            let step = row.gain - row.lag_gain;
            (step, row.ramp_gain - late_s * step)
        };
        let of_complex = |row: LinearRow<Complex<N>>| {
            let step = row.gain - row.lag_gain;
            (step, row.ramp_gain - step.times(late_s))
        };
        Self {
            after_s,
            modes: real.map(of_real).collect(),
            oscillating: complex.map(of_complex).collect(),
            late_s,
            lag_decay: lag_rate.map_or(N::constant(0.0), |lag_rate| (-(lag_rate * after_s)).exp()),
        }
    }
}

/// Computes the position (m) at every row, before multiplication by the softening factor.
pub fn run<S: Number>(record: &PreparedRows, system: &System<S>, position_m: &mut [S]) {
    let zero = S::constant(0.0);
    let longest = record.holds.iter().map(|hold| hold.rows.len()).max().unwrap_or(0);
    let mut sweep = LinearSweep {
        system,
        steps: LinearSteps::new(system, &record.step_s, record.is_linear),
        modes: vec![zero; system.modes.len()],
        oscillating: vec![complex_zero(); system.oscillating.len()],
        is_linear: record.is_linear,
        late_s: system.late_s(),
        level_n: zero,
        slope_n_per_s: zero,
        deficit_n: zero,
        deficits_n: vec![zero; if system.shape.lagging { longest } else { 0 }],
        input: vec![zero; system.modes.len()],
        oscillating_input: vec![complex_zero(); system.oscillating.len()],
    };
    if !system.shape.delayed {
        for hold in &record.holds {
            let (level_n, slope_n_per_s) = system.scaled(hold.line, hold.line.from_s);
            sweep.change_level(level_n + system.load.start_n(), slope_n_per_s);
            sweep.advance(hold.step, &mut position_m[hold.rows.clone()]);
        }
        return;
    }
    sweep.change_level(system.load.start_n(), zero);
    let between_row_switches = between_row_switches(record, system);
    let mut waiting = between_row_switches.iter().peekable();
    let mut responses: Vec<Option<SwitchResponse<S::Lane>>> = (0..S::N_POINTS).map(|_| None).collect();
    for hold in &record.holds {
        let mut row = hold.rows.start;
        while row < hold.rows.end {
            let end = waiting.peek().map_or(hold.rows.end, |kick| hold.rows.end.min(kick.row + 1));
            sweep.advance(hold.step, &mut position_m[row..end]);
            while let Some(kick) = waiting.next_if(|kick| kick.row < end) {
                sweep.kick(kick, &mut responses[kick.lane], record.tolerance_s, &mut position_m[kick.row]);
            }
            row = end;
        }
    }
}

/// State of the modes and of the force during one pass through the record.
struct LinearSweep<'a, S> {
    system: &'a System<S>,
    steps: LinearSteps<S>,
    modes: Vec<S>,
    oscillating: Vec<Complex<S>>,
    is_linear: bool,
    /// Time in s by which a lag delays a linearly changing force.
    late_s: S,
    /// Level in N that the force approaches.
    level_n: S,
    slope_n_per_s: S,
    deficit_n: S,
    /// Deficit (force minus level) in N at the beginning of each step of one hold.
    deficits_n: Vec<S>,
    /// Input to every real mode over a step from the level and, if the level changes linearly, from its rate.
    input: Vec<S>,
    oscillating_input: Vec<Complex<S>>,
}

impl<S: Number> LinearSweep<'_, S> {
    /// Changes the level and its rate. Behind a lag the force itself does not jump, so the deficit (force minus level) takes up the change.
    fn change_level(&mut self, command_n: S, slope_n_per_s: S) {
        let mut level_n = command_n;
        if self.is_linear {
            level_n = level_n - slope_n_per_s * self.late_s;
            self.slope_n_per_s = slope_n_per_s;
        }
        if self.system.shape.lagging {
            self.deficit_n = self.deficit_n + self.level_n - level_n;
        }
        self.level_n = level_n;
    }

    fn advance(&mut self, step: usize, position_m: &mut [S]) {
        let step = self.steps.of(step);
        for (input, row) in self.input.iter_mut().zip(step.modes) {
            *input = row.gain * self.level_n;
        }
        for (input, row) in self.oscillating_input.iter_mut().zip(step.oscillating) {
            *input = row.gain.times(self.level_n);
        }
        if self.is_linear {
            for (input, row) in self.input.iter_mut().zip(step.modes) {
                *input += row.ramp_gain * self.slope_n_per_s;
            }
            for (input, row) in self.oscillating_input.iter_mut().zip(step.oscillating) {
                *input = *input + row.ramp_gain.times(self.slope_n_per_s);
            }
            // If the force changes linearly, `advance` receives one row at a time, so the level is updated here for the next row.
            self.level_n += self.slope_n_per_s * step.length_s;
        }
        Arch::new().dispatch(LinearRows {
            step,
            system: self.system,
            modes: &mut self.modes,
            oscillating: &mut self.oscillating,
            level_n: self.level_n,
            deficit_n: &mut self.deficit_n,
            deficits_n: &mut self.deficits_n,
            input: &self.input,
            oscillating_input: &self.oscillating_input,
            position_m,
        });
    }

    /// Adds the response to a switch in the last step, from the switch to the step's end.
    fn kick(
        &mut self,
        kick: &BetweenRowsSwitch<S::Lane>,
        known: &mut Option<SwitchResponse<S::Lane>>,
        tolerance_s: f64,
        position_m: &mut S,
    ) {
        if known.as_ref().is_none_or(|known| !known.after_s.is_close(kick.remaining_s, tolerance_s)) {
            *known = None;
        }
        let response =
            known.get_or_insert_with(|| SwitchResponse::new(self.system, kick.lane, kick.remaining_s, self.is_linear));
        let (lane, change, bend) = (kick.lane, kick.change_n, kick.bend_n_per_s);
        // Between constant forces the change of slope is 0, and adding it leaves all bits of the result unchanged.
        let level = change + (kick.remaining_s - response.late_s) * bend;
        let left = response.lag_decay * (change - response.late_s * bend);
        let mut moved = self.system.instantaneous.lane(lane) * (level - left);
        for (state, &(step, ramp)) in self.modes.iter_mut().zip(&response.modes) {
            let added = step * change + ramp * bend;
            moved += added;
            state.set_lane(lane, state.lane(lane) + added);
        }
        for (state, &(step, ramp)) in self.oscillating.iter_mut().zip(&response.oscillating) {
            let added = step.times(change) + ramp.times(bend);
            moved += added.re;
            state.re.set_lane(lane, state.re.lane(lane) + added.re);
            state.im.set_lane(lane, state.im.lane(lane) + added.im);
        }
        self.level_n.set_lane(lane, self.level_n.lane(lane) + level);
        self.slope_n_per_s.set_lane(lane, self.slope_n_per_s.lane(lane) + bend);
        self.deficit_n.set_lane(lane, self.deficit_n.lane(lane) - left);
        position_m.set_lane(lane, position_m.lane(lane) + moved);
    }
}

/// Task that advances all modes through consecutive equal steps under one level.
struct LinearRows<'a, S> {
    step: LinearStep<'a, S>,
    system: &'a System<S>,
    modes: &'a mut [S],
    oscillating: &'a mut [Complex<S>],
    level_n: S,
    deficit_n: &'a mut S,
    deficits_n: &'a mut [S],
    input: &'a [S],
    oscillating_input: &'a [Complex<S>],
    position_m: &'a mut [S],
}

impl<S: Number> WithSimd for LinearRows<'_, S> {
    type Output = ();

    #[inline(always)]
    fn with_simd<V: Simd>(self, _simd: V) {
        let Self { step, system, level_n, position_m, deficits_n, .. } = self;
        if system.shape.lagging {
            let mut deficit_n = *self.deficit_n;
            for (position, known) in position_m.iter_mut().zip(deficits_n.iter_mut()) {
                // A step uses the deficit at its beginning.
                *known = deficit_n;
                deficit_n = deficit_n * step.lag_decay;
                *position = system.instantaneous * (level_n + deficit_n);
            }
            *self.deficit_n = deficit_n;
        } else {
            position_m.fill(system.instantaneous * level_n);
        }
        let mut part = PendingModes {
            rows: step.modes,
            inputs: self.input,
            oscillating_inputs: self.oscillating_input,
            states: self.modes,
            oscillating_rows: step.oscillating,
            oscillating: self.oscillating,
            deficits_n,
            lagging: system.shape.lagging,
        };
        // Modes are computed in blocks whose states stay in registers. All blocks have nearly equal widths, since a narrow block
        // idles while its recursion finishes. An oscillating mode shares a block with real modes for this reason.
        let mut n_blocks = part.rows.len().div_ceil(WIDEST);
        while n_blocks > 0 {
            match part.rows.len().div_ceil(n_blocks) {
                1 => part.block::<1>(position_m),
                2 => part.block::<2>(position_m),
                3 => part.block::<3>(position_m),
                4 => part.block::<4>(position_m),
                5 => part.block::<5>(position_m),
                6 => part.block::<6>(position_m),
                7 => part.block::<7>(position_m),
                _ => part.block::<WIDEST>(position_m),
            }
            n_blocks -= 1;
        }
        while !part.oscillating.is_empty() {
            part.block::<0>(position_m);
        }
    }
}

/// Largest number of real modes in a block.
const WIDEST: usize = 8;

/// Modes that have not been advanced through the rows yet.
struct PendingModes<'a, S> {
    rows: &'a [LinearRow<S>],
    inputs: &'a [S],
    oscillating_inputs: &'a [Complex<S>],
    states: &'a mut [S],
    oscillating_rows: &'a [LinearRow<Complex<S>>],
    oscillating: &'a mut [Complex<S>],
    deficits_n: &'a [S],
    lagging: bool,
}

impl<S: Number> PendingModes<'_, S> {
    /// Advances the first `B` real modes, and one oscillating mode if any is left, through the rows. It adds their values to the
    /// position.
    #[inline(always)]
    fn block<const B: usize>(&mut self, position_m: &mut [S]) {
        match (self.oscillating.is_empty(), self.lagging) {
            (true, false) => self.take::<B, 0, false>(position_m),
            (true, true) => self.take::<B, 0, true>(position_m),
            (false, false) => self.take::<B, 1, false>(position_m),
            (false, true) => self.take::<B, 1, true>(position_m),
        }
    }

    #[inline(always)]
    fn take<const B: usize, const O: usize, const LAGGING: bool>(&mut self, position_m: &mut [S]) {
        // Closures would be compiled as separate functions without vector instructions.
        let zero = S::constant(0.0);
        let (mut state, mut decay, mut input, mut lag_gain) = ([zero; B], [zero; B], [zero; B], [zero; B]);
        for k in 0..B {
            (state[k], decay[k]) = (self.states[k], self.rows[k].decay);
            (input[k], lag_gain[k]) = (self.inputs[k], self.rows[k].lag_gain);
        }
        let none = Complex { re: zero, im: zero };
        let (mut turning, mut turn, mut drive, mut lag_drive) = ([none; O], [none; O], [none; O], [none; O]);
        for k in 0..O {
            (turning[k], turn[k]) = (self.oscillating[k], self.oscillating_rows[k].decay);
            drive[k] = self.oscillating_inputs[k];
            lag_drive[k] = self.oscillating_rows[k].lag_gain;
        }
        for row in 0..position_m.len() {
            let deficit_n = if LAGGING { self.deficits_n[row] } else { zero };
            let mut sum = position_m[row];
            for k in 0..B {
                let acting = if LAGGING { lag_gain[k].mul_add(deficit_n, input[k]) } else { input[k] };
                state[k] = decay[k].mul_add(state[k], acting);
                sum += state[k];
            }
            for k in 0..O {
                let mut acting = drive[k];
                if LAGGING {
                    acting.re = lag_drive[k].re.mul_add(deficit_n, acting.re);
                    acting.im = lag_drive[k].im.mul_add(deficit_n, acting.im);
                }
                let Complex { re, im } = turning[k];
                turning[k].re = turn[k].re.mul_add(re, (-turn[k].im).mul_add(im, acting.re));
                turning[k].im = turn[k].re.mul_add(im, turn[k].im.mul_add(re, acting.im));
                sum += turning[k].re;
            }
            position_m[row] = sum;
        }
        let (done, states) = std::mem::take(&mut self.states).split_at_mut(B);
        done.copy_from_slice(&state);
        let (turned, oscillating) = std::mem::take(&mut self.oscillating).split_at_mut(O);
        turned.copy_from_slice(&turning);
        (self.states, self.oscillating) = (states, oscillating);
        (self.rows, self.inputs) = (&self.rows[B..], &self.inputs[B..]);
        self.oscillating_rows = &self.oscillating_rows[O..];
        self.oscillating_inputs = &self.oscillating_inputs[O..];
    }
}
