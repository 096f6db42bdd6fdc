//! One run: switches, steps, stages, and positions at rows.

use std::collections::HashMap;
use std::rc::Rc;

use super::history::{Chain, Free, Response};
use super::load::Load;
use super::output::{FieldTerm, Output, OutputState, Recorder, ResponseRecorder, UnitResponse};
use super::stages::{DIAGONAL, N_STAGES, predict};
use super::steps::{Grading, Resolution};
use super::{ChainLaw, ChainPart, StageSolve, StageWeights, TransientSystem};
use crate::fe::clock::{CLOCK_ROUNDING, FOURTH};
use crate::fe::stepping::run::gap_s;
use base::error::{Error, Result};
use laws::stages::Switch;

/// Positions and fields that a run returns, with the numbers of steps and factorisations.
#[derive(Debug, Clone, PartialEq)]
pub struct TransientRun {
    /// Displacement of the robot (m) at every row, just before any force step at the row.
    pub position_m: Vec<f64>,
    /// Values of all unknowns at the requested rows, one vector per row, in ascending time.
    pub fields: Vec<Vec<f64>>,
    /// Number of time steps.
    pub n_steps: usize,
    /// Number of factorisations of a stage's matrix.
    pub n_factors: usize,
}

/// Time scale that the first steps after a force change resolve, as a fraction of the earliest time
/// of a result. Faster processes have decayed by then, because the method is L-stable.
const SHARE_OF_FIRST_AGE: f64 = 0.03;

/// Largest number of stored factorisations. A run with a single hold of the force needs about two
/// per decade of time.
const MOST_FACTORS: usize = 48;

/// Computes the motion of a system under a load by time stepping. The system is at rest before the
/// first switch of the load. `laws` has one law for each stiffness matrix of the system. The times
/// `time_s` (s) of the rows ascend. The result contains all unknowns at the rows with the indices
/// `rows_of_fields`.
///
/// # Errors
/// [`Error::Numerical`] if the number of laws is wrong, a law is rigid, the force gradient pulls
/// the robot away, or a position is not finite.
pub fn run<L: Clone + Into<ChainLaw>>(
    system: &dyn TransientSystem,
    laws: &[L],
    load: &Load,
    time_s: &[f64],
    rows_of_fields: &[usize],
    resolution: Resolution,
) -> Result<TransientRun> {
    let (Some(&first_s), Some(&last_s)) = (time_s.first(), time_s.last()) else {
        return Ok(TransientRun { position_m: Vec::new(), fields: Vec::new(), n_steps: 0, n_factors: 0 });
    };
    let start_s = load.switches.first().map_or(first_s, |switch| switch.time_s.min(first_s));
    let rounding_s = CLOCK_ROUNDING * (last_s - start_s).max(f64::MIN_POSITIVE);
    let laws: Vec<ChainLaw> = laws.iter().cloned().map(Into::into).collect();
    let mut run = Run::new(system, &laws, load, start_s)?;
    let mut output = Output {
        time_s,
        rows_of_fields,
        rounding_s,
        row: 0,
        position_m: Vec::with_capacity(time_s.len()),
        fields: vec![],
    };
    output.record(&run.rest(start_s), &run.rest(start_s), system);
    for (i, switch) in load.switches.iter().enumerate() {
        if switch.time_s >= last_s - rounding_s {
            break;
        }
        run.advance_to(switch.time_s, rounding_s, &mut output)?;
        let gap_s = gap_s(time_s, &load.switches, i, rounding_s).min(last_s - switch.time_s);
        run.input = *switch;
        run.grading = Grading::new(resolution, switch.time_s, gap_s, switch.jumps);
        run.is_fresh = true;
    }
    run.advance_to(last_s, rounding_s, &mut output)?;
    let (n_steps, n_factors) = (run.n_steps, run.n_factors);
    if let Some(row) = output.position_m.iter().position(|x| !x.is_finite()) {
        return Err(Error::numerical(
            format!("the position at {} s is {}", time_s[row], output.position_m[row]),
            "give parameters of moderate size",
        ));
    }
    Ok(TransientRun { position_m: output.position_m, fields: output.fields, n_steps, n_factors })
}

/// Computes the response of a system at rest to one force change at time 0. `laws` has one law for
/// each stiffness matrix of the system. Positions are valid at ages from `first_age_s` to
/// `last_age_s` (s, both above 0). The ages of `terms` ascend and lie between these two.
///
/// # Errors
/// Those of [`run`].
pub fn unit_response(
    system: &dyn TransientSystem,
    laws: &[ChainLaw],
    load: &Load,
    [first_age_s, last_age_s]: [f64; 2],
    terms: &[FieldTerm],
    resolution: Resolution,
) -> Result<UnitResponse> {
    let mut run = Run::new(system, laws, load, 0.0)?;
    let mut recorder = ResponseRecorder::new(terms, system.n_unknowns());
    if let Some(change) = load.switches.first() {
        run.input = *change;
        run.grading = Grading::within(resolution, SHARE_OF_FIRST_AGE * first_age_s);
    }
    run.advance_to(last_age_s, 0.0, &mut recorder)?;
    let response = recorder.response;
    if response.position_m(last_age_s).is_finite() {
        return Ok(response);
    }
    Err(Error::numerical(
        format!("the position {last_age_s} s after a change of the force is not finite"),
        "give parameters of moderate size",
    ))
}

/// Responses of the laws and factorised matrix for one step length. All stages of a step use them.
struct PreparedTransient<'a> {
    responses: Vec<Response>,
    solve: StageSolve<'a>,
    /// Stress field of the first law per unit force; `None` if the force does not depend on the
    /// position.
    stress_per_n: Option<Vec<f64>>,
}

struct Run<'a> {
    system: &'a dyn TransientSystem,
    load: &'a Load,
    chains: Vec<Chain>,
    free: Vec<Free>,
    factors: HashMap<u64, Rc<PreparedTransient<'a>>>,
    grading: Grading,
    now: OutputState,
    /// True before the first step after a switch. The rates from before the switch are then
    /// invalid.
    is_fresh: bool,
    input: Switch,
    lagged_n: f64,
    accelerations: Vec<Vec<f64>>,
    predicted_velocity: Vec<f64>,
    scratch: Vec<f64>,
    n_steps: usize,
    n_factors: usize,
}

impl<'a> Run<'a> {
    fn new(system: &'a dyn TransientSystem, laws: &[ChainLaw], load: &'a Load, start_s: f64) -> Result<Self> {
        if laws.len() != system.n_laws() || laws.is_empty() {
            return Err(Error::numerical(
                format!("the system has {} laws and {} are given", system.n_laws(), laws.len()),
                "give as many laws as the system has, at least one",
            ));
        }
        let n = system.n_unknowns();
        let n_velocities = if system.has_mass() { n } else { 0 };
        Ok(Self {
            system,
            load,
            chains: laws.iter().map(|law| Chain::new(law, n)).collect(),
            free: vec![Free::new(n); laws.len()],
            factors: HashMap::new(),
            grading: Grading::new(Resolution::default(), start_s, 1.0, true),
            now: OutputState { time_s: start_s, unknowns: vec![0.0; n], rates_per_s: vec![0.0; n] },
            is_fresh: true,
            input: Switch::to(start_s, 0.0),
            lagged_n: 0.0,
            accelerations: vec![vec![0.0; n_velocities]; N_STAGES],
            predicted_velocity: vec![0.0; n_velocities],
            scratch: vec![0.0; n],
            n_steps: 0,
            n_factors: 0,
        })
    }

    fn rest(&self, time_s: f64) -> OutputState {
        let zeros = vec![0.0; self.now.unknowns.len()];
        OutputState { time_s, unknowns: zeros.clone(), rates_per_s: zeros }
    }

    fn advance_to(&mut self, stop_s: f64, rounding_s: f64, recorder: &mut dyn Recorder) -> Result<()> {
        // Before the first switch nothing moves.
        if self.n_steps == 0 && self.input.force_n == 0.0 && self.input.slope_n_per_s == 0.0 {
            let rest = self.rest(stop_s);
            recorder.record(&self.now, &rest, self.system);
            self.now = rest;
            return Ok(());
        }
        while stop_s - self.now.time_s > rounding_s {
            let left_s = stop_s - self.now.time_s;
            let step_s = self.grading.step_s(self.now.time_s, left_s);
            let before = self.now.clone();
            self.step(step_s)?;
            // The remaining time equals the step up to rounding: the step ends at the stop.
            self.now.time_s = if step_s > 0.75 * left_s { stop_s } else { before.time_s + step_s };
            let rates_per_s = if self.is_fresh { self.now.rates_per_s.clone() } else { before.rates_per_s };
            recorder.record(&OutputState { rates_per_s, ..before }, &self.now, self.system);
            self.is_fresh = false;
        }
        Ok(())
    }

    fn prepared(&mut self, step_s: f64) -> Result<Rc<PreparedTransient<'a>>> {
        if let Some(prepared) = self.factors.get(&step_s.to_bits()) {
            return Ok(prepared.clone());
        }
        if self.factors.len() >= MOST_FACTORS {
            self.factors.clear();
        }
        let responses: Vec<Response> = self.chains.iter().map(|chain| chain.response(step_s)).collect();
        if responses
            .iter()
            .any(|response| !(response.compliance_per_pa > 0.0 && response.compliance_per_pa.is_finite()))
        {
            return Err(Error::numerical(
                format!("the response of a law to a step of {step_s} s is {responses:?}"),
                "give positive and finite moduli and viscosities",
            ));
        }
        let weights = StageWeights {
            stiffness: responses.iter().map(|r| responses[0].compliance_per_pa / r.compliance_per_pa).collect(),
            damping_per_pa_s: responses[0].rate_per_pa_s,
            mass_per_pa_s2: responses[0].rate_per_pa_s / (DIAGONAL * step_s),
        };
        let solve = self.system.factor(&weights)?;
        let stress_per_n = if !self.load.equations.depends_on_position() {
            None
        } else {
            let mut stress = vec![0.0; self.system.n_unknowns()];
            self.system.add_load(1.0, &mut stress);
            solve(&mut stress)?;
            Some(stress)
        };
        self.n_factors += 1;
        let prepared = Rc::new(PreparedTransient { responses, solve, stress_per_n });
        self.factors.insert(step_s.to_bits(), prepared.clone());
        Ok(prepared)
    }

    fn step(&mut self, step_s: f64) -> Result<()> {
        let prepared = self.prepared(step_s)?;
        let implicit_s = DIAGONAL * step_s;
        let equations = &self.load.equations;
        let (start_n, mut lag_rates) = (self.lagged_n, [0.0; N_STAGES]);
        let velocity = self.now.rates_per_s.clone();
        for stage in 0..N_STAGES {
            let input_n = self.input.input_n(self.now.time_s + FOURTH.nodes[stage] * step_s);
            let earlier: f64 = FOURTH.matrix[stage].iter().zip(lag_rates).map(|(a, rate)| a * step_s * rate).sum();
            let (force_n, rate) = equations.at_implicit_stage(input_n, start_n, earlier, implicit_s);
            lag_rates[stage] = rate;
            self.lagged_n = force_n;

            for (chain, free) in self.chains.iter_mut().zip(&mut self.free) {
                chain.begin_stage(stage, step_s, free);
            }
            let mut stress = vec![0.0; self.scratch.len()];
            self.add_histories(stage, step_s, &velocity, &prepared, &mut stress);
            let (free, response) = (&self.free[0], prepared.responses[0]);
            match &prepared.stress_per_n {
                None => {
                    self.system.add_load(force_n, &mut stress);
                    (prepared.solve)(&mut stress)?;
                }
                Some(stress_per_n) => {
                    (prepared.solve)(&mut stress)?;
                    let position_m = |stress: &[f64]| response.compliance_per_pa * self.system.position_m(stress);
                    let history_m = position_m(&stress) + self.system.position_m(&free.strain_m);
                    let per_n = position_m(stress_per_n);
                    let force_n = equations.balanced_n(force_n, history_m, per_n);
                    equations.check_feedback(&[history_m + force_n * per_n], self.now.time_s)?;
                    stress.iter_mut().zip(stress_per_n).for_each(|(w, per_n)| *w += force_n * per_n);
                }
            }
            for (k, w) in stress.iter().enumerate() {
                self.now.unknowns[k] = response.compliance_per_pa * w + free.strain_m[k];
                self.now.rates_per_s[k] = response.rate_per_pa_s * w + free.rate_m_per_s[k];
            }
            if self.system.has_mass() {
                let ends = self.now.rates_per_s.iter().zip(&self.predicted_velocity);
                let accelerations = ends.map(|(end, predicted)| (end - predicted) / implicit_s);
                self.accelerations[stage].iter_mut().zip(accelerations).for_each(|(a, value)| *a = value);
            }
            let others = self.chains.iter_mut().zip(&self.free).zip(&prepared.responses).enumerate();
            for (i, ((chain, free), response)) in others {
                if i > 0 {
                    for ((w, z), h) in stress.iter_mut().zip(&self.now.unknowns).zip(&free.strain_m) {
                        *w = (z - h) / response.compliance_per_pa;
                    }
                }
                chain.end_stage(stage, step_s, &stress);
            }
        }
        self.n_steps += 1;
        Ok(())
    }

    /// Adds the histories' contribution to the right-hand side: − D g₁ − M (g₁ − predicted
    /// velocity)/γΔt − Σ Kᵢ (h₁ − hᵢ)/jᵢ. hᵢ and gᵢ are strain and rate of law i at zero stress,
    /// and jᵢ is its compliance. D and M are the damping and mass matrices, Kᵢ the stiffnesses, γΔt
    /// the stage's implicit time.
    fn add_histories(
        &mut self,
        stage: usize,
        step_s: f64,
        velocity: &[f64],
        prepared: &PreparedTransient,
        right_hand_side: &mut [f64],
    ) {
        let scratch = &mut self.scratch;
        let first = &self.free[0];
        scratch.iter_mut().zip(&first.rate_m_per_s).for_each(|(s, g)| *s = -g);
        self.system.add_product(ChainPart::Damping, scratch, right_hand_side);
        if self.system.has_mass() {
            predict(stage, step_s, velocity, &self.accelerations, &mut self.predicted_velocity);
            let implicit_s = DIAGONAL * step_s;
            for ((s, g), predicted) in scratch.iter_mut().zip(&first.rate_m_per_s).zip(&self.predicted_velocity) {
                *s = (predicted - g) / implicit_s;
            }
            self.system.add_product(ChainPart::Mass, scratch, right_hand_side);
        }
        for (i, (free, response)) in self.free.iter().zip(&prepared.responses).enumerate().skip(1) {
            for ((s, value), h) in scratch.iter_mut().zip(&free.strain_m).zip(&first.strain_m) {
                *s = (value - h) / response.compliance_per_pa;
            }
            self.system.add_product(ChainPart::Stiffness(i), scratch, right_hand_side);
        }
    }
}
