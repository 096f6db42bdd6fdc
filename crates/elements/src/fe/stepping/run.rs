//! One run: stops, steps, and the equations solved in a step.

use super::Resolution;
use super::gradient::{self, Mechanics};
use super::network::{Network, NetworkStep};
use super::radau::{Radau, inverted};
use super::springpot::RateRange;
use super::state_law::{StateStage, StateTracker};
use crate::fe::clock::{CLOCK_ROUNDING, Grading, StepRule};
use base::error::{Error, Result};
use laws::stages::{Load, Quantity, Stages, Switch};
use nalgebra::{Matrix3, Vector3};
use record::Force;
use std::collections::HashMap;

/// Returns the law's strain response (N/Pa) to the force at every row.
pub fn strains(
    compliance_per_m: f64,
    stages: &Stages,
    time_s: &[f64],
    force: Force<'_>,
    resolution: Resolution,
) -> Result<Vec<f64>> {
    Ok(strains_and_positions(compliance_per_m, stages, time_s, force, resolution)?
        .into_iter()
        .map(|answer| answer[0])
        .collect())
}

/// Returns the law's strain response (N/Pa) to the force, and the observed position (m), at every
/// row.
pub fn strains_and_positions(
    compliance_per_m: f64,
    stages: &Stages,
    time_s: &[f64],
    force: Force<'_>,
    resolution: Resolution,
) -> Result<Vec<[f64; 2]>> {
    let load = stages.load.of::<f64>();
    let switches = load.switches(time_s, force);
    let mut run = SteppingRun::new(compliance_per_m, stages, &load, time_s, &switches, resolution)?;
    if let Some(law) = &stages.state_law {
        let steps_s = force.step_rows().iter().map(|&row| load.action_time_s(time_s[row])).collect();
        run.state = Some(StateTracker::new(law, steps_s, &stages.law));
    }
    let mut coming = switches.iter().copied().enumerate().peekable();
    let mut answers = Vec::with_capacity(time_s.len());
    for &row_s in time_s {
        // A switch at the time of a row acts only after the row, because positions are those before
        // any force step.
        while let Some((i, switch)) = coming.next_if(|(_, switch)| switch.time_s < row_s - run.rounding_s) {
            run.advance_to(switch.time_s)?;
            run.switch(switch, gap_s(time_s, &switches, i, run.rounding_s));
        }
        run.advance_to(row_s)?;
        answers.push([run.strain_n_per_pa, run.measured()]);
    }
    Ok(answers)
}

/// Time (s) from switch `i` to the next row or switch that is later by more than rounding. Infinite
/// if there is none.
pub(crate) fn gap_s(time_s: &[f64], switches: &[Switch], i: usize, rounding_s: f64) -> f64 {
    let after_s = switches[i].time_s + rounding_s;
    let row_s = time_s.get(time_s.partition_point(|&t| t <= after_s)).copied().unwrap_or(f64::INFINITY);
    let switch_s = switches[i..].iter().map(|switch| switch.time_s).find(|&t| t > after_s).unwrap_or(f64::INFINITY);
    row_s.min(switch_s) - switches[i].time_s
}

/// Decay of the lag within a step: factors, one per stage, on the difference of lagged and input
/// force at the step's start.
fn lag_left(radau: &Radau, load: &Load<f64>, step_s: f64) -> Vector3<f64> {
    load.lag_times_in(step_s).map_or_else(Vector3::zeros, |lags| radau.resolvent(lags) * Vector3::repeat(1.0))
}

/// Force (N) after the lag at the times `at_s` (s). `start_n` is the force at the step's start.
/// `left` is the remaining fraction of the difference from the steady lagged force.
fn lagged_n(
    load: &Load<f64>,
    input: &Switch,
    [start_s, start_n]: [f64; 2],
    at_s: Vector3<f64>,
    left: &Vector3<f64>,
) -> Vector3<f64> {
    left * (start_n - load.steady_lagged_n(input, start_s)) + at_s.map(|t| load.steady_lagged_n(input, t))
}

/// Shortest time after a switch at which the response is resolved, as a fraction of the mean time
/// between rows.
const LEAST_GAP: f64 = 1e-7;

/// Shortest time (s) from any switch to the next row or switch.
fn shortest_gap_s(time_s: &[f64], switches: &[Switch], length_s: f64, rounding_s: f64) -> f64 {
    let gaps = (0..switches.len()).map(|i| gap_s(time_s, switches, i, rounding_s));
    gaps.fold(length_s, f64::min).max(LEAST_GAP * length_s / time_s.len() as f64)
}

/// Coefficients of the network and of the lag for one step length.
struct PreparedStepping {
    step_s: f64,
    network: NetworkStep,
    /// Factors, one per stage, on the difference of lagged and input force at the step's start.
    lag_left: Vector3<f64>,
}

/// Largest change of force gradient × position between a step's first stage and its end. Up to this
/// change, Radau's method follows the force to 10⁻⁸.
const MOST_CHANGE: f64 = 0.15;
/// Largest number of times that a step is halved to satisfy [`MOST_CHANGE`]. If the change is still
/// larger, the robot is unstable.
const MOST_HALVINGS: u32 = 20;

/// Largest number of fixed-point iterations for a state-dependent quantity.
const MOST_PICARD_STEPS: usize = 200;
/// Number of fixed-point iterations before damping begins.
const SIMPLE_PICARD_STEPS: usize = 60;

/// Largest number of step lengths whose matrices are stored. Only completely irregular records need
/// more.
const MOST_LENGTHS: usize = 4096;

/// State of one run through a record.
struct SteppingRun<'a> {
    stages: &'a Stages,
    load: &'a Load<f64>,
    compliance_per_m: f64,
    radau: Radau,
    rule: StepRule,
    network: Network,
    prepared: HashMap<u64, PreparedStepping>,
    start_s: f64,
    /// Times that differ by less than this value (s) count as equal.
    rounding_s: f64,
    now_s: f64,
    grading: Grading,
    /// Force (N) at the input of the lag since the last switch.
    input: Switch,
    /// Force (N) at the output of the lag.
    lagged_n: f64,
    strain_n_per_pa: f64,
    /// Force (N) on the robot if its position is prescribed.
    reaction_n: f64,
    /// Tracker for a state-dependent quantity, if there is one.
    state: Option<StateTracker<'a>>,
}

impl<'a> SteppingRun<'a> {
    fn new(
        compliance_per_m: f64,
        stages: &'a Stages,
        load: &'a Load<f64>,
        time_s: &[f64],
        switches: &[Switch],
        resolution: Resolution,
    ) -> Result<Self> {
        let start_s = time_s.first().copied().unwrap_or(0.0);
        let length_s = time_s.last().map_or(0.0, |end_s| end_s - start_s).max(f64::MIN_POSITIVE);
        let rounding_s = CLOCK_ROUNDING * length_s;
        let shortest_s = shortest_gap_s(time_s, switches, length_s, rounding_s);
        let range = RateRange::between(shortest_s, length_s);
        let network = match stages.state_law.as_ref().map(|law| law.quantity) {
            Some(Quantity::Element(leaf)) => Network::with_depending(&stages.law, leaf, range)?,
            _ => Network::new(&stages.law, range)?,
        };
        let fastest_s = network.fastest_rate_per_s(range).recip().min(load.fastest_s());
        let feeds_back = load.depends_on_position() || stages.state_law.is_some();
        let rule =
            StepRule::new(resolution.steps_per_doubling, fastest_s, feeds_back, stages.softening_rate_per_s.value);
        Ok(Self {
            stages,
            load,
            compliance_per_m,
            radau: Radau::new(),
            grading: rule.after_switch(start_s, shortest_s, true),
            rule,
            network,
            prepared: HashMap::new(),
            start_s,
            rounding_s,
            now_s: start_s,
            input: Switch::to(start_s, 0.0),
            lagged_n: 0.0,
            strain_n_per_pa: 0.0,
            reaction_n: 0.0,
            state: None,
        })
    }

    /// Applies a switch of the force. The next row or switch comes `gap_s` later.
    fn switch(&mut self, switch: Switch, gap_s: f64) {
        self.input = switch;
        // A springpot has no shortest time scale. Steps must therefore resolve a change of the
        // force's slope like a jump.
        self.grading = self.rule.after_switch(self.now_s, gap_s, true);
    }

    fn advance_to(&mut self, stop_s: f64) -> Result<()> {
        while stop_s - self.now_s > self.rounding_s {
            let left_s = stop_s - self.now_s;
            let mut step_s = self.rule.step_s(self.grading, self.now_s, left_s);
            let mut n_halvings = 0;
            while !self.step(step_s, n_halvings < MOST_HALVINGS)? {
                (step_s, n_halvings) = (0.5 * step_s, n_halvings + 1);
            }
            // The remaining time equals the step up to rounding: the step ends at the stop.
            self.now_s = if step_s > 0.75 * left_s { stop_s } else { self.now_s + step_s };
        }
        Ok(())
    }

    /// Observed position (m), or the force (N) if the position is prescribed, before offset, scale and drift of the sensor.
    fn measured(&self) -> f64 {
        if self.stages.is_position_controlled {
            return self.reaction_n;
        }
        let position_m = self.compliance_per_m * self.strain_n_per_pa;
        self.state
            .as_ref()
            .map_or(position_m, |state| state.observed_m(position_m, [self.start_s, self.now_s], self.lagged_n))
    }

    /// Takes a step with a state-dependent quantity, and returns true. Iterates until the
    /// quantity's factors at the stages agree with the resulting states. If an optional step is too
    /// long for this, takes no step and returns false.
    fn step_with_state(&mut self, step_s: f64, is_optional: bool) -> Result<bool> {
        let Some(mut followed) = self.state.take() else { return Ok(true) };
        let (start_s, since_s) = (self.now_s, self.now_s - self.start_s);
        let at_nodes_s = self.radau.nodes.map(|node| start_s + node * step_s);
        let lagged_n = lagged_n(
            self.load,
            &self.input,
            [start_s, self.lagged_n],
            at_nodes_s,
            &lag_left(&self.radau, self.load, step_s),
        );
        let rate = self.stages.softening_rate_per_s.value;
        let amplified = self.radau.nodes.map(|node| (rate * (since_s + node * step_s)).exp());
        let stage = StateStage {
            step_s,
            time_s: at_nodes_s.map(|t| t - self.start_s),
            absolute_s: at_nodes_s,
            force_n: lagged_n,
            inverse: self.radau.inverse,
            begin_m: self.compliance_per_m * self.strain_n_per_pa,
        };
        let mut values = followed.guess();
        let solved = (0..MOST_PICARD_STEPS).find_map(|turn| {
            let step = self.network.prepare_with(&self.radau, step_s, followed.element_factors(&values));
            let history = self.network.begin(&step);
            let stress = followed.force_n(&lagged_n, &values).component_mul(&amplified);
            let strain = step.compliance * stress + history;
            let matrix = self.network.strain_of_depending(&step, &stress);
            let found = followed.values(&stage, &(strain * self.compliance_per_m), &(matrix * self.compliance_per_m));
            let distance = (found - values).amax() / (1.0 + found.amax());
            // The values may oscillate. Their mean is then closer to the solution.
            values = if turn < SIMPLE_PICARD_STEPS { found } else { (found + values) * 0.5 };
            (distance < 1e-13).then_some((step, stress, strain))
        });
        let change = (values[2] - values[0]).abs() / values.amax().max(f64::MIN_POSITIVE);
        let is_followed = solved.is_some() && change < MOST_CHANGE;
        if !is_followed && is_optional {
            self.state = Some(followed);
            return Ok(false);
        }
        let Some((step, stress, strain)) = solved else {
            return Err(Error::numerical(
                format!("the iteration for the state-dependent quantity does not converge at {start_s} s"),
                "take parameters nearer to their nulls",
            ));
        };
        followed.take(&stage, &(strain * self.compliance_per_m), &values);
        self.network.end(&step, &stress);
        self.lagged_n = lagged_n[2];
        self.strain_n_per_pa = strain[2];
        self.state = Some(followed);
        Ok(true)
    }

    /// Takes a step and returns true. If the force changes too much within an optional step, takes
    /// no step and returns false.
    fn step(&mut self, step_s: f64, is_optional: bool) -> Result<bool> {
        if self.state.is_some() {
            return self.step_with_state(step_s, is_optional);
        }
        if self.prepared.len() >= MOST_LENGTHS {
            self.prepared.clear();
        }
        let (network, radau, load) = (&mut self.network, &self.radau, self.load);
        let prepared = self.prepared.entry(step_s.to_bits()).or_insert_with(|| PreparedStepping {
            step_s,
            network: network.prepare(radau, step_s),
            lag_left: lag_left(radau, load, step_s),
        });
        let at_nodes_s = radau.nodes.map(|node| self.now_s + node * prepared.step_s);
        let lagged_n = lagged_n(load, &self.input, [self.now_s, self.lagged_n], at_nodes_s, &prepared.lag_left);
        let since_s = self.now_s - self.start_s;
        let rate = self.stages.softening_rate_per_s.value;
        let amplified = self.radau.nodes.map(|node| (rate * (since_s + node * prepared.step_s)).exp());
        let history = network.begin(&prepared.network);
        if self.stages.is_position_controlled {
            // The lag follows the commanded position (m).
            let strain = lagged_n / self.compliance_per_m;
            let stress = inverted(prepared.network.compliance) * (strain - history);
            network.end(&prepared.network, &stress);
            self.lagged_n = lagged_n[2];
            self.strain_n_per_pa = strain[2];
            self.reaction_n = stress[2] / amplified[2];
            return Ok(true);
        }
        let response = prepared.network.compliance * Matrix3::from_diagonal(&amplified);
        let mechanics = Mechanics { compliance_per_m: self.compliance_per_m, response, history };
        let start_m = self.compliance_per_m * self.strain_n_per_pa;
        let force_n = gradient::with_gradient(load, start_m, lagged_n, &mechanics);
        let strain = mechanics.response * force_n + mechanics.history;
        let change = gradient::change(load, self.compliance_per_m, &strain);
        // A change that is not a number also counts as too large.
        if is_optional && load.depends_on_position() && (change.is_nan() || change >= MOST_CHANGE) {
            return Ok(false);
        }
        load.check_feedback((strain * self.compliance_per_m).as_slice(), self.now_s)?;
        network.end(&prepared.network, &force_n.component_mul(&amplified));
        self.lagged_n = lagged_n[2];
        self.strain_n_per_pa = strain[2];
        Ok(true)
    }
}
