//! Training of a hyper-reduced surrogate. Full-order runs over a box of parameters give modes and cubature, and runs at other
//! parameters verify the surrogate.
//!
//! A few runs cover every experiment on a gel, because laws are similar. In units of the modulus and of a hold's length, fields depend on
//! the ratios of the law's times to the hold and on one nonlinear number. For stiffening this number is β (x/R)², with β the stiffening
//! coefficient, x the robot's elastic displacement and R its radius. For thinning it is the index. For yielding it is the yield stress
//! divided by the force per area of the robot's surface. The training does not depend on measurements or priors. The modes are also used
//! outside the box, with larger errors.

use super::{HyperModel, HyperReducedData, N_MODES};
use crate::model::Response;
use crate::non_negative;
use crate::surrogate::pod::{EnergyProduct, Pod};
use base::error::{Error, Result};
use base::number::Dual;
use elements::fe::meridional::NonlinearBall;
use elements::fe::nonlinear::{self, Discretisation, NonlinearInput, NonlinearModel, NonlinearOptions, Scheme};
use elements::fe::spatial::GelAndRobot;
use elements::fe::stepping::Resolution;
use laws::rheology::{BaseLaw, Element};
use laws::stages::{NonlinearFamily, Nonlinearity, ReducedField, SharedStepper, Spatial, Stages, YIELD_SMOOTHING};
use rayon::prelude::*;
use record::Force;
use std::f64::consts::PI;
use std::sync::Arc;

/// Seed of the scrambled Sobol sequence. It is fixed, so that equal settings always give the same training points.
const DESIGN_SEED: u32 = 2;
/// Forces of the holds in the training record, relative to the largest force.
const HOLDS: [f64; 3] = [1.0, -1.0, 0.4];
/// Times in each hold at which fields are sampled, as fractions of the hold's length.
const TAKEN_AT: [f64; 5] = [0.004, 0.03, 0.12, 0.4, 1.0];
/// Ranges of the two viscosities c₁ and c₂ divided by Young's modulus, in units of a hold's length.
const TIMES: [[f64; 2]; 2] = [[0.02, 1.0], [0.5, 20.0]];
/// Range of β (x/R)², covered on a logarithmic scale. β is the stiffening coefficient, x the robot's elastic displacement and R its radius.
const STIFFENINGS: [f64; 2] = [0.05, 50.0];
/// Range of the shear-thinning index, covered on a linear scale.
const INDICES: [f64; 2] = [0.3, 1.0];
/// Range of the yield stress divided by the largest force per area of the robot's surface. The range is covered more densely towards 0,
/// where prior densities are largest and fields change most.
const YIELDS: [f64; 2] = [0.0, 2.0];
/// Largest number of training states to which the cubature is fitted.
const MOST_STATES: usize = 80;
/// Weight of the reduced linear stiffness relative to the states' forces, in the fit of the cubature.
const STIFFNESS_WEIGHT: f64 = 1.0;
/// Accuracy of the training runs. It is low, because the modes need the shapes of fields but not their exact times.
const TRAINING: NonlinearOptions =
    NonlinearOptions { scheme: Scheme::Euler, resolution: Resolution { steps_per_doubling: 1 }, tolerance: 1e-4 };
/// Accuracy of the verification runs, which use the method of higher order. With fewer steps they would not resolve a spring that
/// relaxes and stiffens again.
fn verification(family: NonlinearFamily) -> NonlinearOptions {
    let steps_per_doubling = match family {
        NonlinearFamily::StrainStiffening | NonlinearFamily::YieldStress => 4,
        NonlinearFamily::ShearThinning => 2,
    };
    NonlinearOptions { scheme: Scheme::Fourth, resolution: Resolution { steps_per_doubling }, tolerance: 1e-5 }
}

/// Settings of a surrogate's training.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HyperSettings {
    /// Largest residual of the cubature for the forces of the training states, relative to these forces.
    pub cubature_tolerance: f64,
    /// Largest number of points of the cubature.
    pub most_points: usize,
    /// Number of full-order runs that train the surrogate.
    pub training_runs: u32,
    /// Number of full-order runs at other parameters for verification.
    pub verification_runs: u32,
}

impl HyperSettings {
    /// Returns settings with an error of at most a thousandth of the amplitude. A yield stress needs more runs, because the place where the
    /// flow stops depends on both times of the law and on the yield stress.
    pub fn of(family: NonlinearFamily) -> Self {
        let (most_points, training_runs) = match family {
            NonlinearFamily::StrainStiffening => (40, 16),
            NonlinearFamily::ShearThinning => (40, 10),
            NonlinearFamily::YieldStress => (64, 28),
        };
        Self { cubature_tolerance: 3e-4, most_points, training_runs, verification_runs: 4 }
    }

    /// Number of full-order runs for training and verification together.
    pub fn n_runs(&self) -> usize {
        (self.training_runs + self.verification_runs) as usize
    }
}

/// Displacement and stresses at one time of a training run.
struct TrainingState {
    displacement: Vec<f64>,
    stresses: Vec<[f64; 6]>,
}

/// Point of the training design, in units in which Young's modulus and the length of a hold are 1.
struct DesignPoint {
    law: Vec<Element>,
    nonlinearity: Nonlinearity<Dual>,
}

/// Training problem, with a full-order model and a force.
struct TrainingProblem<'a> {
    model: &'a dyn Discretisation,
    family: NonlinearFamily,
    radius_m: f64,
    /// Largest force in N. It moves the robot by its radius at unit creep compliance.
    force_n: f64,
    compliance_per_m: f64,
    time_s: Vec<f64>,
    command_n: Vec<f64>,
}

/// Trains a surrogate on full-order runs, and calls `run_done` after each run. Around a sphere at the gel's centre the runs use elements in the
/// half meridian, and finer ones for the verification. Around other robots they use the mesh.
///
/// # Errors
/// [`Error::Numerical`] if the number of modes is out of range, or if a full-order run fails.
pub fn build(
    surroundings: &GelAndRobot,
    family: NonlinearFamily,
    settings: &HyperSettings,
    run_done: &(dyn Fn() + Sync),
) -> Result<HyperModel> {
    let GelAndRobot { mesh, stiffness, poisson_ratio, sizes } = *surroundings;
    if let Some(ball) = sizes.ball {
        let (radius_m, outer_radius_m) = (ball.robot_radius_m, ball.outer_radius_m);
        let coarse = NonlinearBall::coarse(radius_m, outer_radius_m, poisson_ratio)?;
        let fine = NonlinearBall::new(radius_m, outer_radius_m, poisson_ratio)?;
        train([&coarse, &fine], surroundings, family, settings, run_done)
    } else {
        let model = NonlinearModel::new(mesh, stiffness, poisson_ratio)?;
        train([&model, &model], surroundings, family, settings, run_done)
    }
}

/// Trains on the first discretisation, and verifies on the second.
fn train(
    [model, verifying]: [&dyn Discretisation; 2],
    surroundings: &GelAndRobot,
    family: NonlinearFamily,
    settings: &HyperSettings,
    run_done: &(dyn Fn() + Sync),
) -> Result<HyperModel> {
    let workshop = TrainingProblem::new(model, surroundings.sizes.robot_radius_m, family);
    let runs: Vec<Vec<TrainingState>> = (0..settings.training_runs)
        .into_par_iter()
        .map(|index| workshop.states(index).inspect(|_| run_done()))
        .collect::<Result<_>>()?;
    let states: Vec<TrainingState> = runs.into_iter().flatten().collect();
    let energy = EnergyProduct(model.unit_stiffness());
    // The linear model's field is one of the snapshots.
    let linear = model.unit_response();
    let snapshots: Vec<Vec<f64>> =
        std::iter::once(linear).chain(states.iter().map(|state| state.displacement.clone())).collect();
    let mut pod = Pod::new(&snapshots, energy, 0.0)?;
    pod.modes.truncate(N_MODES);
    let robot: Vec<f64> = pod.modes.iter().map(|mode| mode[model.robot()]).collect();
    let robot = robot.try_into().map_err(|robot: Vec<f64>| {
        Error::numerical(
            format!("the training runs have {} independent fields; {N_MODES} are needed", robot.len()),
            "train on more runs",
        )
    })?;
    let strains: Vec<Vec<[f64; 6]>> = pod.modes.iter().map(|mode| model.strains(mode)).collect();
    let kept = kept_states(&states);
    let (volumes_m3, moduli) = (model.volumes_m3(), model.unit_moduli());
    let (columns, target) = conditions(&volumes_m3, moduli, &strains, &kept);
    let chosen = non_negative::choose(&columns, &target, settings.cubature_tolerance, settings.most_points);
    let at_points = chosen.weights.iter().flat_map(|(point, _)| {
        let strains = &strains;
        (0..6).flat_map(move |c| strains.iter().map(move |mode| mode[*point][c]))
    });
    let mut reduced = HyperReducedData {
        family,
        poisson_ratio: surroundings.poisson_ratio,
        robot,
        force_share: model.share(),
        weights_m3: chosen.weights.iter().map(|(point, weight)| weight * volumes_m3[*point]).collect(),
        strains: at_points.collect(),
        unit_moduli: [moduli[0], moduli[5]],
        singular_values: pod.singular_values.iter().map(|s| s / pod.singular_values[0]).collect(),
        cubature_residual: chosen.residual,
        training_runs: settings.training_runs as usize,
        verification_runs: settings.verification_runs as usize,
        max_relative_error: 0.0,
        fe_unknowns: model.n_unknowns(),
    };
    let ready = HyperModel::try_from(reduced.clone())?;
    let errors: Vec<f64> = (settings.training_runs..settings.training_runs + settings.verification_runs)
        .into_par_iter()
        .map(|index| workshop.distance(&ready, verifying, index).inspect(|_| run_done()))
        .collect::<Result<_>>()?;
    reduced.max_relative_error = errors.into_iter().fold(0.0, f64::max);
    HyperModel::try_from(reduced)
}

/// Returns the value at the fraction `share` of a range, on a logarithmic scale.
fn on_log([lower, upper]: [f64; 2], share: f64) -> f64 {
    lower * (upper / lower).powf(share)
}

fn between([lower, upper]: [f64; 2], share: f64) -> f64 {
    lower + share * (upper - lower)
}

impl<'a> TrainingProblem<'a> {
    fn new(model: &'a dyn Discretisation, radius_m: f64, family: NonlinearFamily) -> Self {
        let compliance_per_m = model.share() * model.unit_compliance_per_m();
        let force_n = radius_m / compliance_per_m;
        let (mut time_s, mut command_n) = (vec![0.0], Vec::new());
        for (hold, level) in (0_u8..).zip(HOLDS) {
            time_s.extend(TAKEN_AT.map(|share| f64::from(hold) + share));
            command_n.extend([level * force_n; TAKEN_AT.len()]);
        }
        command_n.push(0.0);
        Self { model, family, radius_m, force_n, compliance_per_m, time_s, command_n }
    }

    /// Returns the law and the nonlinearity at the Sobol point with this index.
    fn design_point(&self, index: u32) -> DesignPoint {
        let share = |dimension: u32| f64::from(sobol_burley::sample(index, dimension, DESIGN_SEED));
        let viscosities = [on_log(TIMES[0], share(0)), on_log(TIMES[1], share(1))];
        let parameters = [1.0, viscosities[0], viscosities[1]].map(Dual::constant);
        let surface_pa = self.force_n / (4.0 * PI * self.radius_m * self.radius_m);
        let nonlinearity = match self.family {
            NonlinearFamily::StrainStiffening => {
                Nonlinearity::StrainStiffening { coefficient: on_log(STIFFENINGS, share(2)) }
            }
            NonlinearFamily::ShearThinning => {
                Nonlinearity::ShearThinning { index: between(INDICES, share(2)), reference_stress_pa: surface_pa }
            }
            NonlinearFamily::YieldStress => Nonlinearity::YieldStress {
                stress_pa: surface_pa * between(YIELDS, share(2) * share(2)),
                smoothing: YIELD_SMOOTHING,
            },
        };
        DesignPoint { law: BaseLaw::Lethersich.elements(&parameters), nonlinearity: nonlinearity.constant() }
    }

    fn states(&self, index: u32) -> Result<Vec<TrainingState>> {
        let DesignPoint { law, nonlinearity } = self.design_point(index);
        let (load, time_s) = (&Stages::of_law(Vec::new()).load, &self.time_s);
        let force = (&self.command_n).into();
        let what = NonlinearInput { law: &law, nonlinearity, load, time_s, force };
        let mut states = Vec::new();
        nonlinear::run_with_row_states(self.model, &what, TRAINING, |at| {
            if at.row > 0 {
                states.push(TrainingState { displacement: at.displacement.to_vec(), stresses: at.stresses.to_vec() });
            }
        })?;
        Ok(states)
    }

    /// Returns the largest difference of the reduced from the full-order trajectory at a design point, relative to the full-order
    /// amplitude.
    fn distance(&self, ready: &HyperModel, verifying: &dyn Discretisation, index: u32) -> Result<f64> {
        let DesignPoint { law, nonlinearity } = self.design_point(index);
        let mut stages = Stages::of_law(law);
        stages.spatial = Some(Spatial::Nonlinear(nonlinearity));
        let record = (self.time_s.as_slice(), Force::from(&self.command_n));
        let options = verification(self.family);
        let full =
            nonlinear::run_stages(verifying, &stages, record, &[], options, self.compliance_per_m)?.displacement_m;
        stages.spread = Some(ReducedField::Stepped(SharedStepper(Arc::new(ready.clone()))));
        let response = Response::new(&self.time_s, &self.command_n, self.time_s.len());
        let reduced = response.trajectory_m(&stages, self.compliance_per_m)?;
        let amplitude = full.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
        let distance = reduced.iter().zip(&full).fold(0.0_f64, |d, (r, x)| d.max((r - x).abs()));
        Ok(if amplitude > 0.0 { distance / amplitude } else { 0.0 })
    }
}

/// Selects at most [`MOST_STATES`] of the states at even intervals.
fn kept_states(states: &[TrainingState]) -> Vec<&TrainingState> {
    let n = states.len().min(MOST_STATES);
    (0..n).map(|k| &states[k * states.len() / n]).collect()
}

/// Returns the matrix (one column for each integration point) and the right-hand side of the cubature's equations. Their rows are
/// the forces of every state on the modes, and the entries of the reduced linear stiffness.
fn conditions(
    volumes_m3: &[f64],
    moduli: [f64; 6],
    strains: &[Vec<[f64; 6]>],
    states: &[&TrainingState],
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
    // The rows are scaled so that the forces of all states have equal weights.
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
