//! One run of a nonlinear law: stops, steps and retries.

use super::law::Bodies;
use super::point::{EQUIVALENT, StageLaw, Tensor, deviator_norm};
use super::stage::{Balance, NonlinearStage, RobotForce};
use super::{Cost, NonlinearOptions};
use crate::fe::clock::{CLOCK_ROUNDING, Grading, StepRule, Tableau};
use crate::fe::stepping::Resolution;
use crate::fe::stepping::run::gap_s;
use base::error::{Error, Result};
use laws::stages::{Load, Switch};
use rayon::prelude::*;
use record::Force;

/// Largest number of times that a step is halved because its stages do not converge.
const MOST_RETRIES: u32 = 8;

/// Index of the last stage of the five-stage method.
const LAST_STAGE: usize = 4;

/// State of the gel at a stop of the run, just before any force step there: unknowns (m), and
/// stresses relative to unit moduli (Pa) at all integration points.
pub struct RowState<'a> {
    pub row: usize,
    pub displacement: &'a [f64],
    pub stresses: &'a [Tensor<f64>],
}

/// Times and commanded force of a record, and the times at which its run stops. All times ascend.
#[derive(Clone, Copy)]
pub(super) struct RunRecorder<'a> {
    pub time_s: &'a [f64],
    pub force: Force<'a>,
    pub stops_s: &'a [f64],
}

/// Runs a nonlinear gel through a record. Calls `at_row` with the state at every stop, and
/// `at_step` with the time and the robot's displacement at the end of every step.
pub fn run(
    balance: Balance,
    bodies: &Bodies<f64>,
    load: &Load,
    RunRecorder { time_s, force, stops_s }: RunRecorder,
    options: NonlinearOptions,
    mut at_row: impl FnMut(RowState),
    mut at_step: impl FnMut(f64, f64),
) -> Result<Cost> {
    let load = load.of::<f64>();
    let switches = load.switches(time_s, force);
    let start_s = time_s.first().copied().unwrap_or(0.0);
    let length_s = time_s.last().map_or(0.0, |end_s| end_s - start_s).max(f64::MIN_POSITIVE);
    let rounding_s = CLOCK_ROUNDING * length_s;
    let mut run = NonlinearStepper::new(balance, bodies, &load, &switches, options, start_s);
    let mut coming = switches.iter().copied().enumerate().peekable();
    for (row, &row_s) in stops_s.iter().enumerate() {
        // A switch at the time of a row acts only after the row, because positions are those before
        // any force step.
        while let Some((i, switch)) = coming.next_if(|(_, switch)| switch.time_s < row_s - rounding_s) {
            run.advance_to(switch.time_s, rounding_s, &mut at_step)?;
            run.switch(switch, gap_s(time_s, &switches, i, rounding_s));
        }
        run.advance_to(row_s, rounding_s, &mut at_step)?;
        at_row(RowState { row, displacement: &run.displacement, stresses: &run.stresses });
    }
    Ok(run.cost)
}

struct NonlinearStepper<'a> {
    balance: Balance<'a>,
    bodies: &'a Bodies<f64>,
    tableau: Tableau,
    resolution: Resolution,
    rule: StepRule,
    grading: Grading,
    /// Largest accepted residual r, in the norm √(rᵀK̂⁻¹r) with the stiffness K̂ at unit Young's
    /// modulus.
    tolerance: f64,
    load: &'a Load<f64>,
    now_s: f64,
    /// Force at the input of the load's lag since the last switch.
    input: Switch,
    /// Force (N) at the output of the load's lag at the last switch.
    lagged_n: f64,
    /// Strain of every body at every integration point.
    histories: Vec<Tensor<f64>>,
    displacement: Vec<f64>,
    stresses: Vec<Tensor<f64>>,
    /// Times (s) and displacements since the switch, from which Newton's first guesses are
    /// extrapolated.
    known: Vec<(f64, Vec<f64>)>,
    cost: Cost,
}

impl<'a> NonlinearStepper<'a> {
    fn new(
        balance: Balance<'a>,
        bodies: &'a Bodies<f64>,
        load: &'a Load<f64>,
        switches: &[Switch],
        options: NonlinearOptions,
        start_s: f64,
    ) -> Self {
        let rule = StepRule::new(options.resolution.steps_per_doubling, bodies.fastest_s(0.0), false, 0.0);
        let largest_n = switches.iter().fold(0.0_f64, |most, switch| most.max(switch.force_n.abs()));
        let per_n = balance.0.unit_compliance_per_m().max(0.0).sqrt();
        let n_points = balance.0.n_points();
        Self {
            tolerance: options.tolerance * balance.0.share() * largest_n * per_n,
            tableau: options.scheme.tableau(),
            resolution: options.resolution,
            rule,
            grading: rule.after_switch(start_s, f64::INFINITY, true),
            load,
            now_s: start_s,
            input: Switch::to(start_s, 0.0),
            lagged_n: 0.0,
            histories: vec![[0.0; 6]; n_points * bodies.n_histories()],
            displacement: vec![0.0; balance.0.n_unknowns()],
            stresses: vec![[0.0; 6]; n_points],
            known: Vec::new(),
            cost: Cost::default(),
            balance,
            bodies,
        }
    }

    /// Applies a switch of the force. The next row or switch comes `gap_s` later.
    fn switch(&mut self, switch: Switch, gap_s: f64) {
        self.lagged_n = self.force_n(self.now_s);
        self.input = Switch { time_s: self.now_s, ..switch };
        let bodies = self.histories.chunks_exact(self.bodies.n_histories());
        let largest = bodies.map(|histories| deviator_norm(&histories[0])).fold(0.0, f64::max);
        let fastest_s = self.bodies.fastest_s(EQUIVALENT * largest).min(self.load.fastest_s());
        self.rule = StepRule::new(self.resolution.steps_per_doubling, fastest_s, false, 0.0);
        self.grading = self.rule.after_switch(self.now_s, gap_s, switch.jumps);
        self.known.clear();
    }

    /// Force (N) on the robot after the lag.
    fn force_n(&self, time_s: f64) -> f64 {
        self.load.after_lag_n(&self.input, self.lagged_n, time_s)
    }

    fn advance_to(&mut self, stop_s: f64, rounding_s: f64, at_step: &mut impl FnMut(f64, f64)) -> Result<()> {
        while stop_s - self.now_s > rounding_s {
            let left_s = stop_s - self.now_s;
            let step_s = self.rule.step_s(self.grading, self.now_s, left_s);
            // The remaining time equals the step up to rounding: the step ends at the stop.
            let end_s = if step_s > 0.75 * left_s { stop_s } else { self.now_s + step_s };
            self.step(end_s, MOST_RETRIES)?;
            at_step(end_s, self.displacement[self.balance.0.robot()]);
        }
        Ok(())
    }

    /// Takes one step, or two of half its length if its stages do not converge.
    fn step(&mut self, end_s: f64, retries: u32) -> Result<()> {
        let start_s = self.now_s;
        let (displacement, known) = (self.displacement.clone(), self.known.clone());
        let Err(reason) = self.try_step(end_s) else { return Ok(()) };
        (self.displacement, self.known) = (displacement, known);
        if retries == 0 {
            return Err(Error::numerical(
                format!(
                    "the nonlinear balance is not found at {start_s} s with a step of {:.1e} s{}: {}",
                    end_s - start_s,
                    self.load.describe_gradient(),
                    words(&reason)
                ),
                "give parameters of moderate size: a smaller coefficient, a larger index, or a stiffer gel",
            ));
        }
        self.cost.n_retries += 1;
        self.step(0.5 * (start_s + end_s), retries - 1)?;
        self.step(end_s, retries - 1)
    }

    fn try_step(&mut self, end_s: f64) -> Result<()> {
        let (start_s, n) = (self.now_s, self.bodies.n_histories());
        let step_s = end_s - start_s;
        let Tableau { diagonal, nodes, matrix } = self.tableau;
        let law = StageLaw::new(self.bodies, diagonal * step_s);
        // A spring in series jumps with the force. Displacements from before the switch are then
        // useless as a guess.
        if self.known.is_empty() && self.bodies.instantaneous_per_pa == 0.0 {
            self.known.push((start_s, self.displacement.clone()));
        }
        let mut rates: Vec<Vec<Tensor<f64>>> = Vec::with_capacity(nodes.len());
        for (stage, (node, weights)) in nodes.iter().zip(matrix).enumerate() {
            let is_last = stage + 1 == nodes.len();
            let time_s = if is_last { end_s } else { start_s + node * step_s };
            let mut histories = started(&self.histories, &rates, weights, step_s);
            let input_n = self.force_n(time_s);
            let force_n = self.balance.0.share() * input_n;
            let push = RobotForce { force_n, load: self.load };
            let mut displacement = self.extrapolated(stage, time_s);
            let problem = NonlinearStage { law: &law, histories: &histories, n_histories: n, push };
            let solved = self.balance.solve(&problem, &mut displacement, self.tolerance)?;
            self.load.check_feedback(&[displacement[self.balance.0.robot()]], time_s)?;
            self.cost.n_stages += 1;
            self.cost.n_evaluations += solved.n_evaluations;
            self.cost.n_gradients += solved.n_gradients;
            let starts = if is_last { Vec::new() } else { histories.clone() };
            let given = solved.strains.par_iter().zip(&solved.stresses);
            histories.par_chunks_exact_mut(n).zip(given).for_each(|(histories, (strain, stress))| {
                law.advance(strain, stress, histories);
            });
            self.known.push((time_s, displacement.clone()));
            if is_last {
                self.histories = histories;
                self.displacement = displacement;
                self.stresses = solved.stresses;
            } else {
                rates.push(differences(&starts, &histories, 1.0 / (diagonal * step_s)));
            }
        }
        self.now_s = end_s;
        self.cost.n_steps += 1;
        // The next step extrapolates from the middle, the third quarter and the end of this one.
        // With a single-stage method it extrapolates from the ends of the last three steps.
        if nodes.len() == 1 {
            let surplus = self.known.len().saturating_sub(3);
            self.known.drain(..surplus);
        } else {
            let last = self.known.len() - 1;
            self.known = [last - 1, last - 3, last].map(|i| std::mem::take(&mut self.known[i])).to_vec();
        }
        Ok(())
    }

    /// Guess of the displacement at a stage: the parabola through three known displacements.
    fn extrapolated(&self, stage: usize, time_s: f64) -> Vec<f64> {
        if self.known.is_empty() {
            return self.displacement.clone();
        }
        // The last three known times are widely spaced and close to the stage, except for the last
        // of five stages.
        let n = self.known.len();
        let places = if stage == LAST_STAGE { vec![n - 4, n - 3, n - 1] } else { (n.saturating_sub(3)..n).collect() };
        let chosen: Vec<&(f64, Vec<f64>)> = places.into_iter().map(|place| &self.known[place]).collect();
        let mut guess = vec![0.0; self.displacement.len()];
        for (i, (t_i, u)) in chosen.iter().enumerate() {
            let others = chosen.iter().enumerate().filter(|(j, _)| *j != i);
            let weight: f64 = others.map(|(_, (t_j, _))| (time_s - t_j) / (t_i - t_j)).product();
            guess.iter_mut().zip(u).for_each(|(g, u)| *g += weight * u);
        }
        guess
    }
}

/// Strains from which a stage starts: the strains at the step's start plus the step length times
/// the weighted sum of the earlier stages' rates.
fn started(start: &[Tensor<f64>], rates: &[Vec<Tensor<f64>>], weights: &[f64], step_s: f64) -> Vec<Tensor<f64>> {
    let mut histories = start.to_vec();
    for (rates, weight) in rates.iter().zip(weights) {
        let weight = weight * step_s;
        histories.par_iter_mut().zip(rates).for_each(|(history, rate)| {
            history.iter_mut().zip(rate).for_each(|(h, r)| *h += weight * r);
        });
    }
    histories
}

fn differences(from: &[Tensor<f64>], to: &[Tensor<f64>], factor: f64) -> Vec<Tensor<f64>> {
    let difference = |(a, b): (&Tensor<f64>, &Tensor<f64>)| std::array::from_fn(|i| factor * (b[i] - a[i]));
    from.par_iter().zip(to).map(difference).collect()
}

/// Text of an error without its remedy.
fn words(error: &Error) -> String {
    match error {
        Error::Numerical { what, .. } => what.clone(),
        other => other.to_string(),
    }
}
