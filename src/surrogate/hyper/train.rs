//! Training: full runs over a box, modes, cubature, and a comparison with full runs at other parameters.

use super::cubature;
use super::kernel::MOST_MODES;
use super::{HyperModel, HyperReduced, HyperRun};
use crate::effects::Stages;
use crate::error::{Error, Result};
use crate::fe::Stiffness;
use crate::fe::nonlinear::{NonlinearModel, NonlinearRun, Nonlinearity, Options, Scheme};
use crate::fe::stepping::Resolution;
use crate::mesh::Mesh;
use crate::model::TrainedRange;
use crate::number::Dual;
use crate::rheology::BaseLaw;
use crate::surrogate::pod::{EnergyProduct, Pod};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Seed of the scrambled Sobol sequence: the training design is part of the method, not of a run.
const DESIGN_SEED: u32 = 2;
/// Holds of the record that training runs go through.
const TRAINING_HOLDS: usize = 2;
/// When fields are taken, as shares of a hold.
const TAKEN_AT: [f64; 5] = [0.004, 0.03, 0.12, 0.4, 1.0];
/// States that the cubature is fitted to, at most.
const MOST_STATES: usize = 40;
/// Weight of the reduced linear stiffness beside the states' forces.
const STIFFNESS_WEIGHT: f64 = 1.0;
/// Accuracy of the full runs: shapes of fields matter, their times do not.
const TRAINING: Options =
    Options { scheme: Scheme::Euler, resolution: Resolution { steps_per_doubling: 1 }, tolerance: 1e-4 };
/// Accuracy of the runs that verify: twice as many steps, of the higher order.
const VERIFICATION: Options =
    Options { scheme: Scheme::Fourth, resolution: Resolution { steps_per_doubling: 2 }, tolerance: 1e-5 };

/// One nonlinearity with its parameter left open.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum NonlinearFamily {
    /// The parameter is β.
    StrainStiffening,
    /// The parameter is n.
    ShearThinning {
        /// s₀ in Pa.
        reference_stress_pa: f64,
    },
    /// The parameter is s_y in Pa.
    YieldStress {
        /// δ.
        smoothing: f64,
    },
}

impl NonlinearFamily {
    /// The nonlinearity at a value of the parameter.
    pub fn at(self, value: Dual) -> Nonlinearity<Dual> {
        match self {
            Self::StrainStiffening => Nonlinearity::StrainStiffening { coefficient: value },
            Self::ShearThinning { reference_stress_pa } => {
                Nonlinearity::ShearThinning { index: value, reference_stress_pa: reference_stress_pa.into() }
            }
            Self::YieldStress { smoothing } => Nonlinearity::YieldStress { stress_pa: value, smoothing },
        }
    }

    fn plain(self, value: f64) -> Nonlinearity {
        match self {
            Self::StrainStiffening => Nonlinearity::StrainStiffening { coefficient: value },
            Self::ShearThinning { reference_stress_pa } => {
                Nonlinearity::ShearThinning { index: value, reference_stress_pa }
            }
            Self::YieldStress { smoothing } => Nonlinearity::YieldStress { stress_pa: value, smoothing },
        }
    }

    /// The parameter of a nonlinearity of this family, `None` for one of another.
    pub fn parameter(self, nonlinearity: Nonlinearity<Dual>) -> Option<Dual> {
        match (self, nonlinearity) {
            (Self::StrainStiffening, Nonlinearity::StrainStiffening { coefficient }) => Some(coefficient),
            (
                Self::ShearThinning { reference_stress_pa },
                Nonlinearity::ShearThinning { index, reference_stress_pa: s },
            ) if s.is_constant(reference_stress_pa) => Some(index),
            (Self::YieldStress { smoothing }, Nonlinearity::YieldStress { stress_pa, smoothing: other })
                if smoothing == other =>
            {
                Some(stress_pa)
            }
            _ => None,
        }
    }
}

/// What a surrogate is trained for.
#[derive(Debug, Clone, PartialEq)]
pub struct HyperTraining<'a> {
    /// Base law: lethersich, burgers or two-element.
    pub law: BaseLaw,
    /// What is not linear.
    pub family: NonlinearFamily,
    /// Ranges of the law's parameters, all positive, covered on a logarithmic scale, and last that of the nonlinear one, covered evenly.
    pub ranges: &'a [TrainedRange],
    /// Poisson ratio of the gel.
    pub poisson_ratio: f64,
    /// Times of the record in s.
    pub time_s: &'a [f64],
    /// Commanded force in N.
    pub force_n: &'a [f64],
    /// Number of modes, 16 at most.
    pub n_modes: usize,
    /// What the cubature may leave of the training states' forces, relative to them.
    pub cubature_tolerance: f64,
    /// Most points of the cubature.
    pub most_points: usize,
    /// Full runs that give fields.
    pub training_runs: u32,
    /// Full runs at other parameters to compare with.
    pub verification_runs: u32,
}

/// One state of a training run.
struct State {
    displacement: Vec<f64>,
    stresses: Vec<[f64; 6]>,
}

/// Trains a surrogate on full runs of a mesh, whose stiffness was assembled before.
///
/// # Errors
/// [`Error::Numerical`] where the ranges do not fit the law, where the record applies no force, and where a full run fails.
pub fn train(mesh: &Mesh, stiffness: &Stiffness, training: &HyperTraining) -> Result<HyperReduced> {
    let (n_ranges, n_parameters) = (training.ranges.len(), training.law.parameters().len() + 1);
    if n_ranges != n_parameters || !(1..=MOST_MODES).contains(&training.n_modes) {
        return Err(Error::numerical(
            format!("{n_ranges} ranges and {} modes are given", training.n_modes),
            format!("give {n_parameters} ranges and 1 to {MOST_MODES} modes"),
        ));
    }
    let model = NonlinearModel::new(mesh, stiffness, training.poisson_ratio)?;
    let (time_s, force_n) = training_record(training.time_s, training.force_n);
    let runs: Vec<Vec<State>> = (0..training.training_runs)
        .into_par_iter()
        .map(|index| states(&model, training, index, &time_s, &force_n))
        .collect::<Result<_>>()?;
    let states: Vec<State> = runs.into_iter().flatten().collect();
    let energy = EnergyProduct(model.factor().matrix());
    // The linear model's own field is among the snapshots, so that the null is exact in space.
    let linear = model.factor().unit_response();
    let snapshots: Vec<Vec<f64>> =
        std::iter::once(linear).chain(states.iter().map(|state| state.displacement.clone())).collect();
    let mut pod = Pod::new(&snapshots, energy, 0.0)?;
    pod.modes.truncate(training.n_modes);
    let points = model.points();
    let strains: Vec<Vec<[f64; 6]>> = pod.modes.iter().map(|mode| points.strains(mode)).collect();
    let kept = kept_states(&states);
    let (columns, target) = conditions(points.volumes_m3(), points.unit_moduli(), &strains, &kept);
    let chosen = cubature::choose(&columns, &target, training.cubature_tolerance, training.most_points);
    let at_points = chosen.weights.iter().flat_map(|(point, _)| {
        let strains = &strains;
        (0..6).flat_map(move |c| strains.iter().map(move |mode| mode[*point][c]))
    });
    let moduli = points.unit_moduli();
    let mut reduced = HyperReduced {
        law: training.law.name().into(),
        family: training.family,
        ranges: training.ranges.to_vec(),
        poisson_ratio: training.poisson_ratio,
        n_modes: pod.modes.len(),
        robot: pod.modes.iter().map(|mode| mode[model.robot()]).collect(),
        force_share: stiffness.assembly.unknowns.share(),
        weights_m3: chosen.weights.iter().map(|(point, weight)| weight * points.volumes_m3()[*point]).collect(),
        strains: at_points.collect(),
        unit_moduli: [moduli[0], moduli[5]],
        singular_values: pod.singular_values.iter().map(|s| s / pod.singular_values[0]).collect(),
        cubature_residual: chosen.residual,
        training_runs: training.training_runs as usize,
        verification_runs: training.verification_runs as usize,
        max_relative_error: 0.0,
        fe_unknowns: stiffness.n_unknowns(),
    };
    let ready = HyperModel::new(reduced.clone())?;
    let errors: Vec<f64> = (training.training_runs..training.training_runs + training.verification_runs)
        .into_par_iter()
        .map(|index| distance(&model, &ready, training, index, &time_s, &force_n))
        .collect::<Result<_>>()?;
    reduced.max_relative_error = errors.into_iter().fold(0.0, f64::max);
    Ok(reduced)
}

/// Few rows in the first holds of a record, with the record's forces.
fn training_record(time_s: &[f64], force_n: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let mut starts: Vec<usize> = (0..time_s.len()).filter(|&i| i == 0 || force_n[i] != force_n[i - 1]).collect();
    starts.push(time_s.len().saturating_sub(1));
    starts.dedup();
    let (mut times, mut forces) = (Vec::new(), Vec::new());
    for pair in starts.windows(2).take(TRAINING_HOLDS) {
        let (from_s, to_s, force) = (time_s[pair[0]], time_s[pair[1]], force_n[pair[0]]);
        times.push(from_s);
        forces.push(force);
        for share in &TAKEN_AT[..TAKEN_AT.len() - 1] {
            times.push(from_s + share * (to_s - from_s));
            forces.push(force);
        }
    }
    if let Some(pair) = starts[..starts.len().min(TRAINING_HOLDS + 1)].windows(2).next_back() {
        times.push(time_s[pair[1]]);
        forces.push(force_n[pair[1]]);
    }
    (times, forces)
}

/// Parameters of one Sobol point: the law's on a logarithmic scale, the nonlinear one evenly.
fn design_point(training: &HyperTraining, index: u32) -> (Vec<f64>, f64) {
    let coordinate = |dimension: u32| f64::from(sobol_burley::sample(index, dimension, DESIGN_SEED));
    let (last, law) = training.ranges.split_last().map_or((None, training.ranges), |(last, law)| (Some(last), law));
    let on_log =
        |(range, d): (&TrainedRange, u32)| (range.lower.ln() + coordinate(d) * (range.upper / range.lower).ln()).exp();
    let parameters = law.iter().zip(0_u32..).map(on_log).collect();
    let even = |range: &TrainedRange| range.lower + coordinate(law.len() as u32) * (range.upper - range.lower);
    (parameters, last.map_or(0.0, even))
}

fn states(
    model: &NonlinearModel,
    training: &HyperTraining,
    index: u32,
    time_s: &[f64],
    force_n: &[f64],
) -> Result<Vec<State>> {
    let (parameters, value) = design_point(training, index);
    let load = Stages::of_law(Vec::new()).load;
    let nonlinearity = training.family.plain(value);
    let what = NonlinearRun { law: training.law, parameters: &parameters, nonlinearity, load: &load, time_s, force_n };
    let mut states = Vec::new();
    model.watch(&what, TRAINING, |at| {
        if at.row > 0 {
            states.push(State { displacement: at.displacement.to_vec(), stresses: at.stresses.to_vec() });
        }
    })?;
    Ok(states)
}

/// At most [`MOST_STATES`] of the states, evenly.
fn kept_states(states: &[State]) -> Vec<&State> {
    let n = states.len().min(MOST_STATES);
    (0..n).map(|k| &states[k * states.len() / n]).collect()
}

/// Columns (one a point) and right-hand side of the cubature's conditions: every state's forces on the modes, and the reduced linear stiffness.
fn conditions(
    volumes_m3: &[f64],
    moduli: [f64; 6],
    strains: &[Vec<[f64; 6]>],
    states: &[&State],
) -> (Vec<f64>, Vec<f64>) {
    let m = strains.len();
    let n_rows = states.len() * m + m * (m + 1);
    let work =
        |a: &[f64; 6], b: &[f64; 6], range: std::ops::Range<usize>| range.map(|c| moduli[c] * a[c] * b[c]).sum::<f64>();
    let mut columns = vec![0.0; n_rows * volumes_m3.len()];
    columns.par_chunks_exact_mut(n_rows).enumerate().for_each(|(point, column)| {
        let mut places = column.iter_mut();
        let mut push = |value: f64| {
            if let Some(place) = places.next() {
                *place = value * volumes_m3[point];
            }
        };
        for state in states {
            strains.iter().for_each(|mode| push(work(&mode[point], &state.stresses[point], 0..6)));
        }
        for i in 0..m {
            for j in i..m {
                push(STIFFNESS_WEIGHT * work(&strains[i][point], &strains[j][point], 0..5));
                push(STIFFNESS_WEIGHT * work(&strains[i][point], &strains[j][point], 5..6));
            }
        }
    });
    let mut target = vec![0.0; n_rows];
    for column in columns.chunks_exact(n_rows) {
        target.iter_mut().zip(column).for_each(|(t, c)| *t += c);
    }
    // Every state's forces count alike.
    let mut scale = vec![1.0; n_rows];
    for (scale, target) in scale[..states.len() * m].chunks_exact_mut(m).zip(target.chunks_exact(m)) {
        let norm = target.iter().map(|t| t * t).sum::<f64>().sqrt();
        scale.fill(if norm > 0.0 { 1.0 / norm } else { 0.0 });
    }
    columns.par_chunks_exact_mut(n_rows).for_each(|column| {
        column.iter_mut().zip(&scale).for_each(|(c, s)| *c *= s);
    });
    target.iter_mut().zip(&scale).for_each(|(t, s)| *t *= s);
    (columns, target)
}

/// Largest distance of the reduced from the full trajectory at a design point, relative to the latter's amplitude.
fn distance(
    model: &NonlinearModel,
    ready: &HyperModel,
    training: &HyperTraining,
    index: u32,
    time_s: &[f64],
    force_n: &[f64],
) -> Result<f64> {
    let (parameters, value) = design_point(training, index);
    let load = Stages::of_law(Vec::new()).load;
    let nonlinearity = training.family.plain(value);
    let what = NonlinearRun { law: training.law, parameters: &parameters, nonlinearity, load: &load, time_s, force_n };
    let full = model.run(&what, &[], VERIFICATION)?.displacement_m;
    let parameters: Vec<Dual> = parameters.into_iter().map(Dual::constant).collect();
    let nonlinearity = nonlinearity.constant();
    let reduced = ready.run(&HyperRun { parameters: &parameters, nonlinearity, load: &load, time_s, force_n })?;
    let amplitude = full.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
    let distance = reduced.iter().zip(&full).fold(0.0_f64, |d, (r, x)| d.max((r - x).abs()));
    Ok(if amplitude > 0.0 { distance / amplitude } else { 0.0 })
}
