//! Ensembles of trajectories: the draws of a model's parameters, propagated through a scenario.

use base::error::{Error, InputPlace, Result};
use documents::posterior::{Warning, WarningKind};
use documents::prediction::PositionQuantiles;
use elements::fe::strain::largest_principal_strain;
use figures::density::{quantile_of_sorted, sorted};
use figures::number::format_significant;
use models::effects::{Effect, Stage};
use models::model::{Compliance, Forward, N_LANES, SurrogateForward};
use posterior::advice::strain_warning;
use posterior::mechanics::{FiniteElements, Mechanics};
use posterior::monitor::Monitor;
use posterior::prepared::{KeptSurrogate, PreparedModel};
use posterior::problem::Problem;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use record::{Apparatus, Control, Experiment, Record};
use std::sync::Arc;

use crate::body;
use crate::force_times::{fastest_change_s, longest_hold_s};
use crate::free_path::beyond_the_gel;
use crate::scenario::{Scenario, Tolerances};
use crate::tolerance::Tolerance;

/// Largest number of draws of a prediction.
pub const MOST_DRAWS: usize = 10_000;
/// Number of draws that full finite elements check.
const CHECKED: usize = 8;
/// Number of checked draws if the model solves for a displacement field, which takes seconds to minutes a run.
const CHECKED_SLOW: usize = 1;
/// Smallest relative error of the mesh at the largest displacement that is named.
const NAMED_MESH_ERROR: f64 = 0.01;
/// Largest share of the record's largest force, duration and relative displacement that is not an extrapolation.
pub(crate) const BEYOND: f64 = 1.05;
/// Smallest change to another force, as a fraction of the largest force.
const OTHER_FORCE: f64 = 0.2;
/// Shortest time between turning points of the force that the record tests, in intervals between its rows.
const FASTEST: f64 = 2.0;
/// Quantile of the draws' largest displacements by which a prediction is judged.
const FARTHEST_QUANTILE: f64 = 0.95;
/// Largest relative difference between twice a response and the response to twice the force in a linear model.
const LINEAR: f64 = 1e-6;
/// Number of the first random stream of the tolerances.
const TOLERANCE_STREAM: u64 = 1 << 40;
/// Bases of the tolerances' Halton sequences.
const HALTON_BASES: [u64; 3] = [2, 3, 5];

/// Draws of the parameters of a gel's model.
#[derive(Debug, Clone, PartialEq)]
pub struct Draws {
    /// Source of the draws in words.
    pub source: String,
    /// Names of the parameters that vary.
    pub names: Vec<String>,
    /// Values of the varying parameters in each draw.
    pub values: Vec<Vec<f64>>,
    /// Values of the varying parameters in another specimen of each draw of a group; empty for other sources.
    pub other_specimens: Vec<Vec<f64>>,
}

impl Draws {
    /// Returns at most `most` draws, evenly spaced.
    pub fn thinned(&self, most: usize) -> Self {
        let n = self.values.len();
        let kept = most.min(n);
        let thinned = |all: &Vec<Vec<f64>>| (0..kept).filter_map(|k| all.get(k * n / kept).cloned()).collect();
        Self {
            source: self.source.clone(),
            names: self.names.clone(),
            values: thinned(&self.values),
            other_specimens: thinned(&self.other_specimens),
        }
    }

    /// Parameters of the model for one draw, in the order of the model. Parameters of the observation have their null values, because the prediction
    /// is the robot's position and not the camera's.
    pub fn parameters(&self, problem: &Problem, draw: &[f64]) -> Vec<f64> {
        let model = &problem.model;
        let value = |name: &str| {
            let drawn = self.names.iter().position(|known| known == name).map(|k| draw[k]);
            drawn.or_else(|| problem.specification.fixed.get(name).copied()).unwrap_or(f64::NAN)
        };
        let mut parameters: Vec<f64> = model.parameters().iter().map(|spec| value(spec.name)).collect();
        let mut at = model.base().parameters().len();
        for effect in model.nuisances().iter().chain(model.effects()) {
            for parameter in effect.parameters() {
                if effect.stage() == Stage::Observation
                    && let Some(null) = (parameter.null)(model.scales())
                {
                    parameters[at] = null;
                }
                at += 1;
            }
        }
        parameters
    }
}

/// Model of a gel whose parameters are drawn: the problem that taught it, and its draws.
pub struct Gel<'a> {
    /// Problem whose record taught the parameters.
    pub problem: &'a Problem,
    /// Draws of the parameters.
    pub draws: Draws,
    /// True if the problem's record taught these draws, so that forces and times beyond it are extrapolations.
    pub is_taught: bool,
    /// Seed of the draws of tolerances.
    pub seed: u64,
}

/// Prepared scenario: its reduced model, and the parameters of every draw.
pub struct Ensemble {
    prepared: PreparedModel,
    /// Parameters of every draw, in the order of the model.
    pub parameters: Vec<Vec<f64>>,
    /// Factor of the displacements in each draw, from the tolerances; 1 without tolerances.
    pub factors: Vec<f64>,
    /// Tolerances of the apparatus.
    pub tolerances: Vec<Tolerance>,
    /// Largest principal strain of the gel per displacement of the robot, in 1/m.
    pub strain_per_m: f64,
    mesh: MeshCorrection,
    seed: u64,
}

/// Correction of a new robot's mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
struct MeshCorrection {
    /// Factor of the displacements.
    factor: f64,
    /// Relative error that remains; `None` if it is unknown.
    error: Option<f64>,
}

impl MeshCorrection {
    /// Corrects the compliance of the new robot's mesh to that of high-order elements in the meridian plane, relative to the same correction of the robot that
    /// taught the law: the law has absorbed the error of that robot's mesh. A law with effects is not corrected, and its error is the difference between two
    /// meshes, of which the true error is a part.
    fn new(taught: Option<&Problem>, asked: &Problem) -> Result<Self> {
        let fe = finite_elements(asked)?;
        let is_law_alone = asked.model.is_law_alone();
        let exact = || if is_law_alone { accurate(&asked.experiment.apparatus) } else { None };
        let (mesh_per_m, exact) = rayon::join(|| fe.compliance_per_m(), exact);
        let mesh_per_m = mesh_per_m?;
        let Some((exact_per_m, error)) = exact else {
            let error = fe.comparison.map(|other| other.relative_error(mesh_per_m).abs());
            return Ok(Self { factor: 1.0, error });
        };
        let absorbed = match taught.and_then(|taught| Some((taught, accurate(&taught.experiment.apparatus)?))) {
            Some((taught, (exact_per_m, _))) => finite_elements(taught)?.compliance_per_m()? / exact_per_m,
            None => 1.0,
        };
        Ok(Self { factor: absorbed * exact_per_m / mesh_per_m, error: Some(error) })
    }
}

/// Accurate compliance (1/m) of the robot in the middle of the gel, with its relative error; `None` for other apparatus.
fn accurate(apparatus: &Apparatus) -> Option<(f64, f64)> {
    let Apparatus::Robot { robot, vitreous } = apparatus else { return None };
    body::compliance_per_m(robot, vitreous)
}

/// Result of the check of draws by full finite elements.
pub struct FullModelCheck {
    /// Number of full-order runs.
    pub runs: usize,
    /// Largest distance from the reduced model, in m.
    pub error_m: f64,
}

impl Ensemble {
    /// Prepares a scenario with the given rows of time and force.
    ///
    /// # Errors
    /// Errors of meshing and of the reduced model; [`Error::Input`] if a tolerance is given for a model that is not linear.
    pub fn new(
        gel: &Gel<'_>,
        scenario: &Scenario,
        record: Record,
        kept: Option<KeptSurrogate>,
        monitor: &dyn Monitor,
    ) -> Result<Self> {
        let taught = &gel.problem.experiment;
        let with_effects = scenario.with_effects(gel.problem)?;
        let apparatus = Apparatus::Robot { robot: scenario.robot, vitreous: scenario.vitreous };
        let is_own = taught.apparatus == apparatus;
        let mechanics = if is_own {
            gel.problem.mechanics.clone()
        } else {
            monitor.stage("meshing the robot and assembling the finite elements");
            // The correction of the mesh needs the elements of the record's robot, too. They are kept for it.
            let of_taught = || finite_elements(gel.problem).and_then(FiniteElements::compliance_per_m).ok();
            let (mechanics, _) = rayon::join(|| Mechanics::new(&apparatus, None), of_taught);
            Arc::new(mechanics.map_err(|error| scenario.refusal_of_robot(error))?)
        };
        let experiment = Experiment {
            apparatus,
            record,
            calibration_cycles: vec![1],
            heldout_cycles: Vec::new(),
            control: Control::Force,
            ..taught.clone()
        };
        let problem = with_effects.as_ref().unwrap_or(gel.problem).for_apparatus(experiment, mechanics)?;
        refuse_unpredictable(gel, &problem, scenario)?;
        let mesh = match is_own && gel.is_taught {
            true => MeshCorrection { factor: 1.0, error: Some(0.0) },
            false => MeshCorrection::new(gel.is_taught.then_some(gel.problem), &problem)?,
        };
        let prepared = prepare(
            &problem,
            mesh.factor,
            kept.filter(|_| is_own && with_effects.is_none() && taught.control == Control::Force),
            monitor,
        )?;
        let strain_per_m = strain_per_m(finite_elements(&problem)?)?;
        let found = Self {
            prepared,
            parameters: Vec::new(),
            factors: Vec::new(),
            tolerances: Vec::new(),
            strain_per_m,
            mesh,
            seed: gel.seed,
        };
        // One draw tells whether the model is linear, which tolerances need.
        let found = found.with_draws(&gel.draws.thinned(1), 0);
        if scenario.tolerances != Tolerances::default() && !found.is_linear()? {
            return Err(Error::input(
                scenario.place("tolerance"),
                "the position of this model is not proportional to the force, so that a tolerance has no fixed factor",
                "remove the tolerance, and compare scenarios with a larger and a smaller force or diameter instead",
            ));
        }
        Ok(Self { tolerances: Tolerance::of_scenario(scenario)?, ..found }.with_draws(&gel.draws, 0))
    }

    /// The same scenario with other draws. `stream` is the number of the random stream of their tolerances.
    pub fn with_draws(&self, draws: &Draws, stream: u64) -> Self {
        let problem = self.problem();
        let parameters: Vec<Vec<f64>> = draws.values.iter().map(|draw| draws.parameters(problem, draw)).collect();
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(TOLERANCE_STREAM + stream);
        let shifts: [f64; HALTON_BASES.len()] = random.random();
        // A shifted Halton sequence covers all tolerances evenly, so that they add little sampling noise.
        let uniform = |number: usize, k: usize| (halton(number as u64 + 1, HALTON_BASES[k]) + shifts[k]).fract();
        let factor = |number: usize| {
            let of = |(k, tolerance): (usize, &Tolerance)| tolerance.factor(2.0 * uniform(number, k) - 1.0);
            self.tolerances.iter().enumerate().map(of).product()
        };
        let factors = (0..parameters.len()).map(factor).collect();
        self.with(self.prepared.clone(), parameters, factors)
    }

    /// The same draws without tolerances.
    pub fn without_tolerances(&self) -> Self {
        let factors = vec![1.0; self.parameters.len()];
        Self { tolerances: Vec::new(), ..self.with(self.prepared.clone(), self.parameters.clone(), factors) }
    }

    /// The same draws under another force, with rows of its own.
    pub fn with_record(&self, record: Record) -> Self {
        let mut problem = self.prepared.problem.clone();
        problem.experiment.record = record;
        self.with(self.prepared.for_problem(problem), self.parameters.clone(), self.factors.clone())
    }

    fn with(&self, prepared: PreparedModel, parameters: Vec<Vec<f64>>, factors: Vec<f64>) -> Self {
        Self { prepared, parameters, factors, tolerances: self.tolerances.clone(), ..*self }
    }

    /// The same draws for another robot in the middle of a gel, whose displacements differ by one factor. `reference_per_m` is the compliance of this ensemble's robot by
    /// [`body::compliance_per_m`]. `None` for models with effects, for tolerances, and for bodies without an accurate compliance. The strain is unknown.
    pub fn for_robot(&self, scenario: &Scenario, reference_per_m: f64) -> Option<Self> {
        let is_plain =
            self.tolerances.is_empty() && scenario.tolerances == Tolerances::default() && scenario.effects.is_empty();
        if !(is_plain && self.problem().model.is_law_alone()) {
            return None;
        }
        let (compliance_per_m, error) = body::compliance_per_m(&scenario.robot, &scenario.vitreous)?;
        let factor = compliance_per_m / reference_per_m;
        let factors = self.factors.iter().map(|other| factor * other).collect();
        Some(Self {
            strain_per_m: f64::NAN,
            mesh: MeshCorrection { factor: f64::NAN, error: Some(error) },
            ..self.with(self.prepared.clone(), self.parameters.clone(), factors)
        })
    }

    /// Problem of the scenario.
    pub fn problem(&self) -> &Problem {
        &self.prepared.problem
    }

    /// Rows of the scenario.
    pub fn record(&self) -> &Record {
        &self.prepared.problem.experiment.record
    }

    /// Reduced forward model of the scenario.
    pub fn forward(&self) -> SurrogateForward<'_> {
        self.prepared.forward()
    }

    /// True if the position is proportional to the force: the response to half the force is half the response. Under twice the force a position with feedback may diverge.
    ///
    /// # Errors
    /// Errors of the model.
    pub fn is_linear(&self) -> Result<bool> {
        let Some(first) = self.parameters.first() else { return Ok(true) };
        let position_m = self.forward().trajectory_m(first)?;
        let force_n = self.record().force_n.iter().map(|force| 0.5 * force).collect();
        let halved_m = self.with_record(Record { force_n, ..self.record().clone() }).forward().trajectory_m(first)?;
        let largest_m = position_m.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        Ok(position_m.iter().zip(&halved_m).all(|(x, half)| (x - 2.0 * half).abs() <= LINEAR * largest_m))
    }

    /// Trajectories (m at every row) of the given draws.
    ///
    /// # Errors
    /// Errors of the model for any draw.
    pub fn trajectories_m(
        &self,
        draws: impl IntoParallelIterator<Item = usize, Iter: IndexedParallelIterator>,
    ) -> Result<Vec<Vec<f64>>> {
        let forward = self.forward();
        let of_chunk = |draws: Vec<usize>| {
            let points: Vec<Vec<f64>> = draws.iter().map(|draw| self.parameters[*draw].clone()).collect();
            let mut trajectories_m = forward.trajectories_m(&points)?;
            for (position_m, draw) in trajectories_m.iter_mut().zip(&draws) {
                position_m.iter_mut().for_each(|x| *x *= self.factors[*draw]);
            }
            Ok(trajectories_m)
        };
        let chunks: Vec<Vec<Vec<f64>>> = draws.into_par_iter().chunks(N_LANES).map(of_chunk).collect::<Result<_>>()?;
        Ok(chunks.into_iter().flatten().collect())
    }

    /// Trajectories (m) of the given draws by full finite elements.
    ///
    /// # Errors
    /// Errors of the full-order model.
    pub fn full_trajectories_m(&self, draws: &[usize]) -> Result<Vec<Vec<f64>>> {
        let Some(full) = self.problem().full_forward()? else { return Ok(Vec::new()) };
        let trajectory = |draw: &usize| {
            let mut position_m = full.trajectory_m(&self.parameters[*draw])?;
            position_m.iter_mut().for_each(|x| *x *= self.mesh.factor * self.factors[*draw]);
            Ok(position_m)
        };
        draws.par_iter().map(trajectory).collect()
    }

    /// True if a run of the full-order model takes seconds or more.
    pub fn is_slow(&self) -> bool {
        self.problem().model.field().is_some()
    }

    /// Checks some draws by full finite elements, evenly spaced among all.
    ///
    /// # Errors
    /// Errors of the full-order model.
    pub fn check(&self, trajectories_m: &[Vec<f64>]) -> Result<FullModelCheck> {
        let n = self.parameters.len();
        let checked = if self.is_slow() { CHECKED_SLOW } else { CHECKED }.min(n);
        let draws: Vec<usize> = (0..checked).map(|k| k * n / checked).collect();
        let full_m = self.full_trajectories_m(&draws)?;
        let distance = |(draw, full): (&usize, &Vec<f64>)| {
            trajectories_m[*draw].iter().zip(full).fold(0.0_f64, |most, (x, y)| most.max((x - y).abs()))
        };
        Ok(FullModelCheck { runs: full_m.len(), error_m: draws.iter().zip(&full_m).map(distance).fold(0.0, f64::max) })
    }

    /// Largest error of a position due to the mesh, as a fraction of the position; `None` if it is unknown. The robot that taught the law has none, because
    /// the law has absorbed it.
    pub fn mesh_error(&self) -> Option<f64> {
        self.mesh.error
    }
}

/// Refuses scenarios that the model cannot predict.
fn refuse_unpredictable(gel: &Gel<'_>, problem: &Problem, scenario: &Scenario) -> Result<()> {
    let refuse = |key: &str, found: String, remedy: &str| Err(Error::input(scenario.place(key), found, remedy));
    if let Some(effect) = problem.model.effects().iter().find(|effect| effect.is_learnt_for_record()) {
        let found =
            format!("the reduced model of {} is learnt for one record, and holds for that record only", effect.slug());
        return refuse("effects", found, "predict from a revision without this effect");
    }
    if let Some(effect) =
        problem.model.effects().iter().find(|effect| effect.refers_to_largest_force() && !gel.is_taught)
    {
        let found = format!("{} refers to the largest force of a record, and this gel has no record", effect.slug());
        return refuse("effects", found, "predict from the study of a specimen, or leave the effect out");
    }
    if problem.experiment.record.force_n.iter().all(|force| *force == 0.0) {
        return refuse("force", "the force is zero at all times".into(), "give a force that moves the robot");
    }
    Ok(())
}

/// Prepares the reduced model. A law without effects needs the compliance of the finite elements only.
fn prepare(
    problem: &Problem,
    mesh_factor: f64,
    kept: Option<KeptSurrogate>,
    monitor: &dyn Monitor,
) -> Result<PreparedModel> {
    if !problem.model.is_law_alone() {
        return PreparedModel::unverified(problem, kept, monitor);
    }
    let compliance = Compliance::fixed(mesh_factor * finite_elements(problem)?.compliance_per_m()?);
    Ok(PreparedModel::given(problem, compliance, Vec::new()))
}

fn finite_elements(problem: &Problem) -> Result<&FiniteElements> {
    problem.finite_elements().ok_or_else(|| {
        Error::input(
            InputPlace::default().at_key("robot"),
            "the position of another program's model cannot be predicted for a new robot",
            "give a study with a base law of this program",
        )
    })
}

/// Entry of the van der Corput sequence in a base: the number's digits mirrored at the point.
fn halton(mut number: u64, base: u64) -> f64 {
    let (mut value, mut digit) = (0.0, 1.0 / base as f64);
    while number > 0 {
        value += digit * (number % base) as f64;
        number /= base;
        digit /= base as f64;
    }
    value
}

/// Largest principal strain of the gel per displacement of the robot (1/m), of the linear displacement field.
fn strain_per_m(fe: &FiniteElements) -> Result<f64> {
    let unknowns = &fe.stiffness.assembly.unknowns;
    let moved = fe.compliance_per_m()?;
    let field: Vec<f64> = fe.field_per_n()?.iter().map(|u| u / moved).collect();
    largest_principal_strain(&fe.mesh, &unknowns.nodal_displacement(&field))
}

/// Quantiles of the position over the trajectories, in µm.
pub fn quantiles_um(trajectories_m: &[Vec<f64>]) -> PositionQuantiles {
    let n_rows = trajectories_m.first().map_or(0, Vec::len);
    let at_row = |row: usize| {
        let mut at_row: Vec<f64> = trajectories_m.iter().map(|trajectory| 1e6 * trajectory[row]).collect();
        quantiles(&mut at_row, [0.05, 0.25, 0.5, 0.75, 0.95])
    };
    let rows: Vec<[f64; 5]> = (0..n_rows).into_par_iter().map(at_row).collect();
    let [q05, q25, median, q75, q95] = [0, 1, 2, 3, 4].map(|k| rows.iter().map(|row| row[k]).collect());
    PositionQuantiles { q05, q25, median, q75, q95 }
}

/// Quantiles at ascending probabilities, by linear interpolation between neighbouring values as in [`figures::density::quantile_of_sorted`]; the values change their order.
fn quantiles<const N: usize>(values: &mut [f64], ascending: [f64; N]) -> [f64; N] {
    let Some(last) = values.len().checked_sub(1) else { return [f64::NAN; N] };
    let mut smaller = 0;
    ascending.map(|probability| {
        let position = probability * last as f64;
        let below = position.floor() as usize;
        let (_, value, larger) = values[smaller..].select_nth_unstable_by(below - smaller, f64::total_cmp);
        smaller = below;
        let next = larger.iter().copied().reduce(f64::min).unwrap_or(*value);
        *value + (position - below as f64) * (next - *value)
    })
}

/// Warnings about a scenario: extrapolation beyond the record that taught the law, large strains, a coarse mesh, and effects that are left out.
pub fn warnings(gel: &Gel<'_>, ensemble: &Ensemble, trajectories_m: &[Vec<f64>]) -> Vec<Warning> {
    let farthest = |x: &Vec<f64>| x.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let each_m = sorted(&trajectories_m.iter().map(farthest).collect::<Vec<f64>>());
    // Beyond this quantile are single draws, which do not condemn all others.
    let farthest_m = quantile_of_sorted(&each_m, FARTHEST_QUANTILE);
    let of_prediction = |warning: Warning| {
        Warning {
        advice: "the prediction assumes that the law holds at this amplitude: test it by a record with as large a displacement".into(),
        ..warning
    }
    };
    let mut warnings: Vec<Warning> =
        strain_warning(ensemble.strain_per_m * farthest_m).map(of_prediction).into_iter().collect();
    if let Some(error) = ensemble.mesh_error().filter(|error| *error > NAMED_MESH_ERROR) {
        warnings.push(Warning {
            kind: WarningKind::MeshTooCoarse,
            text: format!(
                "two meshes of this robot differ by {} % in the displacement",
                format_significant(100.0 * error, 2)
            ),
            advice: "read the bands as this much wider".into(),
        });
    }
    if let Apparatus::Robot { robot, vitreous } = &ensemble.problem().experiment.apparatus {
        warnings.extend(beyond_the_gel((robot, vitreous), &each_m, 1.0 - FARTHEST_QUANTILE));
    }
    if gel.is_taught {
        warnings.extend(extrapolations(gel.problem, ensemble, farthest_m));
        warnings.extend(other_poisson_ratio(gel.problem, ensemble.problem()));
    }
    let model = &ensemble.problem().model;
    let observed = model.effects().iter().filter(|effect| effect.stage() == Stage::Observation);
    for effect in observed {
        warnings.push(Warning {
            kind: WarningKind::Extrapolation,
            text: format!(
                "{} belongs to the camera of the record and is left out: the prediction is the robot's position",
                effect.slug()
            ),
            advice: "add it to the prediction before a comparison with a record of the same camera".into(),
        });
    }
    let is_of_record =
        |effect: &&&dyn Effect| gel.problem.model.effects().iter().any(|own| own.slug() == effect.slug());
    let of_load = model.effects().iter().filter(|effect| effect.stage() == Stage::Load);
    for effect in of_load.filter(is_of_record) {
        warnings.push(Warning {
            kind: WarningKind::Extrapolation,
            text: format!(
                "{} belongs to the actuator of the record; the prediction holds for the same actuator",
                effect.slug()
            ),
            advice: "another actuator moves the robot otherwise; no revision without this effect tells how, because its law has absorbed the effect".into(),
        });
    }
    warnings
}

/// Warning about a Poisson ratio other than that with which the law was inferred.
fn other_poisson_ratio(taught: &Problem, asked: &Problem) -> Option<Warning> {
    let ratio = |problem: &Problem| problem.experiment.scales().poisson_ratio;
    let (taught, asked) = (ratio(taught)?, ratio(asked)?);
    (taught != asked).then(|| Warning {
        kind: WarningKind::Extrapolation,
        text: format!("the law was inferred at a Poisson ratio of {taught}, and the scenario has {asked}: the record determines the moduli for its own ratio only"),
        advice: "fit the record again with this Poisson ratio, or keep that of the record".into(),
    })
}

/// Warnings about forces, durations and displacements beyond the record that taught the law.
fn extrapolations(problem: &Problem, ensemble: &Ensemble, farthest_m: f64) -> Vec<Warning> {
    let (taught, asked) = (problem.experiment.scales(), ensemble.problem().experiment.scales());
    let taught_m = problem.experiment.record.position_m.iter().flatten().fold(0.0_f64, |most, x| most.max(x.abs()));
    let [own, other] = [problem, ensemble.problem()].map(|problem| &problem.experiment.record);
    let hold_s = |record: &Record, least_n: f64| longest_hold_s(&record.time_s, &record.force_n, least_n);
    let [own_n, other_n] = [taught, asked].map(|scales| OTHER_FORCE * scales.largest_force_n);
    let mut list: Vec<(String, f64)> = vec![("the duration".into(), asked.duration_s / taught.duration_s)];
    if problem.experiment.control == Control::Force {
        // A whole record is the longest hold of a single step.
        if list[0].1 <= BEYOND {
            list.push(("the longest time at one force".into(), hold_s(other, other_n) / hold_s(own, own_n)));
        }
        list.push(("the largest force".into(), asked.largest_force_n / taught.largest_force_n));
        if let (Some(taught_radius_m), Some(radius_m)) = (taught.robot_radius_m, asked.robot_radius_m) {
            let ratio = (farthest_m / radius_m) / (taught_m / taught_radius_m);
            list.push(("the largest displacement over the robot's radius".into(), ratio));
        }
    }
    let beyond = list.into_iter().filter(|(_, ratio)| *ratio > BEYOND);
    let (fastest_s, interval_s) =
        (fastest_change_s(&other.time_s, &other.force_n, other_n).min(asked.duration_s), shortest_interval_s(own));
    let too_fast = (fastest_s < FASTEST * interval_s).then(|| Warning {
        kind: WarningKind::Extrapolation,
        text: format!(
            "the prediction asks for the motion within {} s, and the rows of the record that taught the law are {} s apart",
            format_significant(fastest_s, 3),
            format_significant(interval_s, 3)
        ),
        advice: "the law is not tested at times this short: record a cycle with more rows a second".into(),
    });
    beyond.map(|(quantity, ratio)| beyond_record(&quantity, ratio)).chain(too_fast).collect()
}

/// Warning about a quantity that is `ratio` times that of the record.
pub(crate) fn beyond_record(quantity: &str, ratio: f64) -> Warning {
    Warning {
        kind: WarningKind::Extrapolation,
        text: format!("{quantity} is {} times that of the record that taught the law", format_significant(ratio, 3)),
        advice: "the law is not tested there: record a cycle in this range, or stay within the record".into(),
    }
}

/// Shortest interval (s) between rows of a record that have a position.
fn shortest_interval_s(record: &Record) -> f64 {
    let rows = (0..record.n_rows()).filter(|row| record.position_m[*row].is_some());
    let times_s: Vec<f64> = rows.map(|row| record.time_s[row]).collect();
    times_s.windows(2).map(|pair| pair[1] - pair[0]).filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min)
}
