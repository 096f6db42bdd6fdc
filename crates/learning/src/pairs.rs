//! Pairs of a quantity and a state, as effects.

use super::creep::{Creep, creep};
use super::smooth::{Basis, MOST_WEIGHTS, N_WEIGHTS, Smooth};
use base::distribution::Distribution;
use base::error::Result;
use base::number::Dual;
use base::parameter::{ParameterSpec, Support};
use criticism::Subject;
use criticism::refit::Refitted;
use laws::stages::{Operation, Stages, State};
use models::effects::{Effect, EffectParameter, QuantityName, StateEffect};
use models::model::Response;
use posterior::study::effect_file::leak;

/// A pair of a quantity and a state on which it depends, or a free memory (additional retardation times).
pub struct Pair {
    /// Name of the quantity; `creep` for a free memory.
    pub quantity: &'static str,
    /// Name of the state; for a free memory the time since a change of the force.
    pub state: &'static str,
    /// The pair as an effect that can be added to the base.
    pub effect: &'static dyn Effect,
    /// Kind of the pair, with its data.
    pub kind: StateKind,
}

/// Kind of a pair: a function of a state, or a memory.
pub enum StateKind {
    /// A function of a state.
    Function {
        /// The function and its basis.
        smooth: &'static Smooth,
        /// Quantity that the function multiplies.
        quantity: QuantityName,
        /// State on which the function depends.
        state: State,
        /// States at all rows of the record, under the model without the function.
        visited: Vec<f64>,
    },
    /// A memory: a spectrum of retardation times.
    Memory(&'static Creep),
}

/// Least number of distinct states in a record from which a function can be learnt.
const LEAST_DISTINCT: usize = 3;
/// Scale on which velocities and times since a step are resolved near 0, as a fraction of their range: most changes occur near 0.
const BENT_AT: f64 = 0.03;

/// Basis functions of a search for functions that need not be monotone.
const FREE: [Basis; 1] = [Basis::COSINES];
/// Basis functions of a search for monotone functions.
const MONOTONE: [Basis; 2] = [Basis::Ramps { n: N_WEIGHTS, falls: false }, Basis::Ramps { n: N_WEIGHTS, falls: true }];

/// Returns all meaningful pairs of a quantity and a state for a model. In a search for monotone functions each pair occurs twice, rising and falling.
///
/// # Errors
/// Errors if the model has no stages at its fit.
pub fn pairs(subject: &Subject, base: &Refitted, is_monotone: bool) -> Result<Vec<Pair>> {
    let bases: &[Basis] = if is_monotone { &MONOTONE } else { &FREE };
    let law = subject.problem().model.base();
    let elements = law.parameters().iter().filter(|spec| law.leaf(spec.name).is_some());
    let elements: Vec<QuantityName> = elements.map(|spec| QuantityName::Element(spec.name)).collect();
    let states = States::of(subject, base)?;
    let mut pairs = Vec::new();
    let mut add = |quantity: QuantityName, state: State| {
        let visited = states.at_rows(quantity, state);
        pairs.extend(bases.iter().filter_map(|basis| pair(quantity, state, visited.clone(), *basis)));
    };
    // If one element bears the whole force, a function of the force has the same effect on the force and on that element.
    let is_alone = law.parameters().len() == 1 || (elements.len() == 1 && law.parameters().len() == 2);
    for state in State::ALL {
        if state != State::Strain && (!is_alone || state == State::Force) {
            add(QuantityName::Force, state);
        }
        for quantity in &elements {
            if !(is_alone && matches!(state, State::Strain | State::Force)) {
                add(*quantity, state);
            }
        }
    }
    for state in [State::Position, State::Time] {
        add(QuantityName::Position, state);
    }
    if let Some(creep) = creep(subject) {
        pairs.push(Pair { quantity: "creep", state: "time_since_step", effect: creep, kind: StateKind::Memory(creep) });
    }
    Ok(pairs)
}

fn pair(quantity: QuantityName, state: State, visited: Vec<f64>, basis: Basis) -> Option<Pair> {
    let range = state_range(&visited);
    let mut distinct = visited.clone();
    distinct.sort_by(f64::total_cmp);
    distinct.dedup_by(|a, b| (*a - *b).abs() <= 1e-6 * (range[1] - range[0]));
    if distinct.len() < LEAST_DISTINCT || !range.iter().all(|end| end.is_finite()) {
        return None;
    }
    let is_bent = matches!(state, State::Velocity | State::TimeSinceStep);
    let smooth = leak_function(Smooth::over(range, is_bent.then(|| BENT_AT * (range[1] - range[0])), basis));
    let way = match basis {
        Basis::Cosines { .. } => "",
        Basis::Ramps { falls: false, .. } => "-rising",
        Basis::Ramps { falls: true, .. } => "-falling",
    };
    let slug = format!("{}-by-{}{way}", quantity.name(), state.name()).replace('_', "-");
    let effect = effect(slug, quantity, state, smooth, N_WEIGHTS);
    let kind = StateKind::Function { smooth, quantity, state, visited };
    Some(Pair { quantity: quantity.name(), state: state.name(), effect, kind })
}

/// Returns the smallest and the largest state of a record, extended to include 0.
pub fn state_range(visited: &[f64]) -> [f64; 2] {
    visited.iter().fold([0.0_f64; 2], |[low, high], s| [low.min(*s), high.max(*s)])
}

/// Decays of cosines over which a function is averaged: with 1 it may have kinks and near jumps, with 2 only bends.
const DECAYS: [f64; 3] = [1.0, 1.5, 2.0];

/// Returns functions with the largest number of weights for a pair, as effects; empty for a free memory.
pub fn finer_functions(pair: &Pair) -> Vec<(&'static dyn Effect, &'static Smooth)> {
    let StateKind::Function { smooth, quantity, state, .. } = &pair.kind else { return Vec::new() };
    let bases = match smooth.basis() {
        Basis::Cosines { .. } => DECAYS.map(|decay| Basis::Cosines { decay }).to_vec(),
        Basis::Ramps { falls, .. } => vec![Basis::Ramps { n: MOST_WEIGHTS, falls }],
    };
    let of = |(number, basis): (usize, &Basis)| {
        let (slug, smooth) = (format!("{}-finer-{number}", pair.effect.slug()), leak_function(smooth.with(*basis)));
        (effect(slug, *quantity, *state, smooth, MOST_WEIGHTS), smooth)
    };
    bases.iter().enumerate().map(of).collect()
}

/// Makes a function static, because effects live until the program ends.
fn leak_function(smooth: Smooth) -> &'static Smooth {
    Box::leak(Box::new(smooth))
}

fn effect(
    slug: String,
    quantity: QuantityName,
    state: State,
    smooth: &'static Smooth,
    n_weights: usize,
) -> &'static dyn Effect {
    let is_monotone = matches!(smooth.basis(), Basis::Ramps { .. });
    let support = if is_monotone { Support { lower: 0.0, upper: f64::INFINITY } } else { Support::REAL };
    let prior: &'static (dyn Fn(&record::CharacteristicSizes) -> Distribution + Send + Sync) = if is_monotone {
        &|_| Distribution::HalfNormal { sd: 1.0 }
    } else {
        &|_| Distribution::Normal { mean: 0.0, sd: 1.0 }
    };
    let parameter = |k: usize| EffectParameter {
        spec: ParameterSpec::new(leak(format!("{slug}.weight_{k}")), "w", "1", support),
        null: &|_| Some(0.0),
        prior,
        prior_source: "smooth functions about zero",
    };
    // Names of effects live until the program ends; a command makes only some dozens.
    Box::leak(Box::new(StateEffect {
        slug: leak(slug.clone()),
        summary: leak(format!("{} depends on {}", quantity.name(), state.name())),
        equation: leak(format!("{} × exp(g({}))", quantity.name(), state.name())),
        quantity,
        state,
        operation: Operation::Multiply,
        function: smooth,
        parameters: Box::leak((0..n_weights).map(parameter).collect::<Vec<_>>().into_boxed_slice()),
    }))
}

/// States at the rows of a record under a model.
struct States {
    time_s: Vec<f64>,
    force_n: Vec<f64>,
    step_rows: Vec<usize>,
    position_m: Vec<f64>,
    /// For each body of the law in series, its contribution to the position (m) at every row.
    share_m: Vec<Vec<f64>>,
    law: laws::rheology::BaseLaw,
}

impl States {
    fn of(subject: &Subject, base: &Refitted) -> Result<Self> {
        let record = &subject.experiment().record;
        let theta = base.candidate.parameters(&base.fitted.theta);
        let stages = base.candidate.model.stages(&theta.into_iter().map(Dual::constant).collect::<Vec<_>>())?;
        let response = Response::new(&record.time_s, record.force(), record.n_rows());
        let compliance_per_m = subject.compliance().experiment_per_m();
        let share = |body: usize| {
            let law = vec![stages.law[body].clone()];
            let entry = Stages {
                load: stages.load.clone(),
                softening_rate_per_s: stages.softening_rate_per_s,
                ..Stages::of_law(law)
            };
            response.trajectory_m(&entry, compliance_per_m)
        };
        let share_m: Vec<Vec<f64>> = (0..stages.law.len()).map(share).collect::<Result<_>>()?;
        let n_rows = record.n_rows();
        let position_m = (0..n_rows).map(|row| share_m.iter().map(|share| share[row]).sum()).collect();
        let (time_s, force_n) = (record.time_s.clone(), record.force_n.clone());
        let law = subject.problem().model.base();
        Ok(Self { time_s, force_n, step_rows: record.force_step_rows(), position_m, share_m, law })
    }

    fn at_rows(&self, quantity: QuantityName, state: State) -> Vec<f64> {
        let rows = 0..self.time_s.len();
        let moved = |row: usize| if row == 0 { 0.0 } else { self.position_m[row] - self.position_m[row - 1] };
        let start_s = self.time_s.first().copied().unwrap_or(0.0);
        match state {
            State::Position => self.position_m.clone(),
            State::Path => {
                let mut path_m = 0.0;
                rows.map(|row| {
                    path_m += moved(row).abs();
                    path_m
                })
                .collect()
            }
            State::Time => self.time_s.iter().map(|time_s| time_s - start_s).collect(),
            State::TimeSinceStep => {
                let last = |row: usize| self.step_rows.partition_point(|step| *step < row).checked_sub(1);
                let from_s = |row: usize| last(row).map_or(start_s, |step| self.time_s[self.step_rows[step]]);
                rows.map(|row| self.time_s[row] - from_s(row)).collect()
            }
            State::Velocity => rows
                .map(|row| if row == 0 { 0.0 } else { moved(row) / (self.time_s[row] - self.time_s[row - 1]) })
                .collect(),
            State::Force => self.force_n.clone(),
            State::LargestExcursion => {
                let mut largest_m = 0.0_f64;
                self.position_m
                    .iter()
                    .map(|x| {
                        largest_m = largest_m.max(x.abs());
                        largest_m
                    })
                    .collect()
            }
            State::Strain => match quantity {
                QuantityName::Element(name) => {
                    self.law.leaf(name).and_then(|leaf| self.share_m.get(leaf.body)).cloned().unwrap_or_default()
                }
                QuantityName::Force | QuantityName::Position => Vec::new(),
            },
        }
    }
}
