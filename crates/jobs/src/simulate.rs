//! `simulate`: steps the full finite-element model through the experiment's protocol and computes the displacement fields.

use documents::simulation::{SimulationParameter, SimulationSummary};
use std::collections::BTreeMap;
use std::time::Instant;

use super::convergence;
use base::error::{Error, InputPlace, Result, Setting};
use base::number::Dual;
use documents::posterior::PosteriorSummary;
use elements::fe::stepping::Resolution;
use elements::fe::strain::largest_principal_strain;
use elements::fe::time::TimeScheme;
use elements::mesh::Mesh;
use laws::rheology::CreepCompliance;
use models::model::{Forward, FullOrderForward, FullRun, Response};
use posterior::advice::strain_warning;
use posterior::mechanics::FiniteElements;
use posterior::monitor::Monitor;
use posterior::prepared::field_models;
use posterior::problem::Problem;
use record::{Control, OwnedForce, Record};

/// Largest number of displacement fields that a run writes.
const MOST_FIELDS: usize = 20;
/// Largest number of time steps of a run.
const MOST_STEPS: usize = 20_000_000;
/// Settings of `simulate` that the caller chooses.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulationRequest {
    /// Values of all parameters, each with its origin.
    pub parameters: Vec<SimulationParameter>,
    /// Time integration scheme for a law of springs and dashpots without effects. `None` selects `radau`, which also handles effects and springpots.
    pub scheme: Option<TimeScheme>,
    /// Longest time step in s. `None` selects one step per interval between rows.
    pub time_step_s: Option<f64>,
    /// Finest level of a mesh convergence table over the built-in meshes; `None` for no table.
    pub refine: Option<usize>,
}

/// Result of a simulation.
pub struct Simulation {
    /// Document of the result, for people and scripts.
    pub summary: SimulationSummary,
    /// Position (m) at each row of the protocol.
    pub position_m: Vec<f64>,
    /// Displacement fields that are written: the row, and the displacement vector (m) of each node.
    pub fields: Vec<(usize, Vec<[f64; 3]>)>,
    /// Mesh on whose nodes the fields are given.
    pub mesh: Mesh,
    /// Wall-clock time of each stage, in s.
    pub timing_s: Vec<(String, f64)>,
}

/// Chooses the value of each parameter. The first available source is used: `set`, the posterior median, the model's fixed value, the prior median.
///
/// # Errors
/// [`Error::Input`] if `set` names a noise parameter, because noise is not simulated.
pub fn parameters(
    problem: &Problem,
    set: &BTreeMap<String, f64>,
    posterior: Option<(&str, &PosteriorSummary)>,
) -> Result<Vec<SimulationParameter>> {
    if let Some(noise) = problem.noise.parameters().iter().find(|p| set.contains_key(p.name)) {
        return Err(Error::input(
            InputPlace::setting(Setting::Fixed),
            format!("{} is given, but a simulation has no noise", noise.name),
            "leave this parameter out; add noise to the trajectory afterwards if you need it",
        ));
    }
    let value = |name: &str| -> Result<(f64, String)> {
        if let Some(value) = set.get(name) {
            return Ok((*value, "set".into()));
        }
        let sampled = posterior.and_then(|(revision, summary)| {
            let found = summary.parameters.iter().find(|p| p.name == name);
            found.map(|p| (p.median, format!("posterior median of {revision}")))
        });
        let fixed = || problem.specification.fixed.get(name).map(|value| (*value, "fixed by the model".to_string()));
        let prior = || {
            let found = problem.priors.get(name);
            found.map(|prior| (prior.distribution.quantile(0.5), "median of its prior".to_string()))
        };
        sampled.or_else(fixed).or_else(prior).ok_or_else(|| {
            Error::input(
                InputPlace::setting(Setting::Fixed),
                format!("{name} has no value"),
                format!("give a value with `{} {name}=VALUE`", Setting::Fixed),
            )
        })
    };
    let entry = |parameter: &base::parameter::ParameterSpec| {
        let (value, origin) = value(parameter.name)?;
        Ok(SimulationParameter { name: parameter.name.into(), value, origin })
    };
    problem.model.parameters().iter().map(entry).collect()
}

/// Checks a request before anything is computed.
///
/// # Errors
/// [`Error::Input`] in these cases:
/// - The experiment has no finite elements, or the scheme cannot handle the model.
/// - The time step is not positive, is too small, or is given to a scheme that chooses its own steps.
/// - The convergence table has too many levels, or the mesh comes from a file.
pub fn check_request(problem: &Problem, request: &SimulationRequest, has_mesh_file: bool) -> Result<()> {
    finite_elements(problem)?;
    if problem.experiment.control == Control::Position {
        let found =
            "the position of this record is prescribed, and a simulation writes the positions under a prescribed force";
        let remedy = "give an experiment with a prescribed force, or fit this one";
        return Err(Error::input(InputPlace::file(&problem.experiment.specimen_id), found, remedy));
    }
    let refuse =
        |setting: Setting, found: String, remedy: &str| Err(Error::input(InputPlace::setting(setting), found, remedy));
    if request.scheme.is_some() && !problem.is_exponential() {
        return refuse(
            Setting::Scheme,
            format!(
                "the {} scheme handles only laws of springs and dashpots without effects",
                scheme_name(request.scheme)
            ),
            &format!("leave out {}: `radau` handles effects and springpots", Setting::Scheme),
        );
    }
    if let Some(step_s) = request.time_step_s {
        if request.scheme != Some(TimeScheme::Midpoint) {
            return refuse(
                Setting::TimeStep,
                format!("the {} scheme chooses its own steps", scheme_name(request.scheme)),
                &format!("leave out the time step, or choose `{} midpoint`", Setting::Scheme),
            );
        }
        if !(step_s.is_finite() && step_s > 0.0) {
            return refuse(
                Setting::TimeStep,
                format!("{step_s} is not a valid time step"),
                "give a number above zero, in seconds",
            );
        }
    }
    let steps = n_steps(&problem.experiment.record, request.time_step_s);
    if steps > MOST_STEPS as f64 {
        return refuse(
            Setting::TimeStep,
            format!("the run would take {steps:.1e} time steps"),
            &format!("give a longer step: the limit is {MOST_STEPS} steps"),
        );
    }
    if let Some(levels) = request.refine {
        let finest = convergence::max_refinement_level(&problem.experiment.apparatus);
        if levels == 0 || levels > finest {
            return refuse(
                Setting::Refine,
                format!("{levels} mesh levels are not possible"),
                &format!("ask for 1 to {finest} levels"),
            );
        }
        if has_mesh_file {
            return refuse(
                Setting::Refine,
                "a mesh from a file cannot be refined here".into(),
                &format!(
                    "leave out {} for the built-in meshes, or run `simulate` on several files and compare the stiffness",
                    Setting::Mesh
                ),
            );
        }
    }
    Ok(())
}

pub(super) fn finite_elements(problem: &Problem) -> Result<&FiniteElements> {
    if let Some(outside) = problem.outside() {
        return Err(Error::input(
            InputPlace::setting(Setting::Forward),
            format!("{} is another program's model, which `simulate` cannot run", outside.title()),
            format!("send requests to its server, or leave out {}", Setting::Forward),
        ));
    }
    problem.finite_elements().ok_or_else(|| {
        Error::input(
            InputPlace::default().at_key("robot"),
            "an instrument or an indenter has no finite elements to simulate",
            "give an experiment with [robot] and [vitreous]; for instruments and indenters use `sample` or `fit`",
        )
    })
}

/// Simulates the protocol, and computes the convergence table if requested.
///
/// # Errors
/// As [`check_request`]; also the errors of meshing, factorisation and stepping.
pub fn run(
    problem: &Problem,
    request: &SimulationRequest,
    has_mesh_file: bool,
    monitor: &dyn Monitor,
) -> Result<Simulation> {
    check_request(problem, request, has_mesh_file)?;
    let fe = finite_elements(problem)?;
    let mut timing_s = Vec::new();
    let clock = Instant::now();
    monitor.stage("running the full finite-element model");
    let values: Vec<f64> = request.parameters.iter().map(|p| p.value).collect();
    let record = &problem.experiment.record;
    let grid = TimeGrid::new(record, request.time_step_s);
    let written_rows = field_rows(record);
    let run = match (request.scheme, problem.model.base().creep_compliance(&values)) {
        (Some(scheme), Some(law)) => run_law(fe, &grid, &law, scheme, &written_rows)?,
        _ => run_all_stages(problem, fe, &values, &written_rows)?,
    };
    let FullOrderRun { rows, position_m, fields, mesh, compliance_per_m, extreme_row } = run;
    let mesh = mesh.unwrap_or_else(|| fe.mesh.clone());
    let exact_m = reference_trajectory_m(problem, fe, compliance_per_m, &values)?;
    let mut largest_strain = 0.0_f64;
    for field in &fields {
        largest_strain = largest_strain.max(largest_principal_strain(&mesh, field)?);
    }
    timing_s.push(("full finite elements".to_string(), clock.elapsed().as_secs_f64()));
    let convergence = match request.refine {
        Some(levels) => convergence::table(&problem.experiment.apparatus, levels, monitor, &mut timing_s)?,
        None => Vec::new(),
    };
    let distance_m = position_m.iter().zip(&exact_m).fold(0.0_f64, |d, (x, y)| d.max((x - y).abs()));
    let summary = SimulationSummary {
        experiment: problem.experiment.specimen_id.clone(),
        parameters: request.parameters.clone(),
        unknowns: fe.stiffness.n_unknowns(),
        stiffness_m: 1.0 / compliance_per_m,
        scheme: scheme_name(request.scheme).into(),
        time_steps: grid.time_s.len().saturating_sub(1),
        time_integration_error_um: 1e6 * distance_m,
        largest_displacement_um: 1e6 * position_m[extreme_row].abs(),
        largest_strain,
        convergence,
        warnings: strain_warning(largest_strain).into_iter().chain(fe.mesh_warnings.clone()).collect(),
    };
    let fields = rows.into_iter().zip(fields).filter(|(row, _)| written_rows.contains(row)).collect();
    Ok(Simulation { summary, position_m, fields, mesh, timing_s })
}

fn scheme_name(scheme: Option<TimeScheme>) -> &'static str {
    match scheme {
        Some(TimeScheme::Exponential) => "exponential",
        Some(TimeScheme::Midpoint) => "midpoint",
        None => "radau",
    }
}

/// Trajectory and fields of a run of the full-order model.
struct FullOrderRun {
    /// Row of each entry of `fields`, in order.
    rows: Vec<usize>,
    position_m: Vec<f64>,
    fields: Vec<Vec<[f64; 3]>>,
    /// Mesh of the fields, if it differs from the mesh of the model.
    mesh: Option<Mesh>,
    compliance_per_m: f64,
    /// Row at which the displacement is largest.
    extreme_row: usize,
}

/// Returns two results: the rows whose fields must be computed, and the row of the largest displacement. The rows to compute are `written_rows` and the
/// row of the largest displacement.
fn rows_with_extreme(written_rows: &[usize], position_m: &[f64]) -> (Vec<usize>, usize) {
    let extreme_row =
        (0..position_m.len()).fold(0, |a, b| if position_m[b].abs() > position_m[a].abs() { b } else { a });
    let mut rows = written_rows.to_vec();
    rows.push(extreme_row);
    rows.sort_unstable();
    rows.dedup();
    (rows, extreme_row)
}

fn run_law(
    fe: &FiniteElements,
    grid: &TimeGrid,
    law: &CreepCompliance,
    scheme: TimeScheme,
    written_rows: &[usize],
) -> Result<FullOrderRun> {
    let model = fe.full_order()?;
    let load = model.solve_load(&grid.time_s, grid.force.get());
    let stepped_m = model.trajectory(&load, law, scheme);
    let position_m: Vec<f64> = grid.place_of_row.iter().map(|&place| stepped_m[place]).collect();
    let (rows, extreme_row) = rows_with_extreme(written_rows, &position_m);
    let places: Vec<usize> = rows.iter().map(|&row| grid.place_of_row[row]).collect();
    let unknowns = &fe.stiffness.assembly.unknowns;
    let fields = model.fields_with_scheme(&load, law, &places, scheme);
    let fields = fields.iter().map(|field| unknowns.nodal_displacement(field)).collect();
    Ok(FullOrderRun { rows, position_m, fields, mesh: None, compliance_per_m: model.compliance_per_m(), extreme_row })
}

fn run_all_stages(
    problem: &Problem,
    fe: &FiniteElements,
    values: &[f64],
    written_rows: &[usize],
) -> Result<FullOrderRun> {
    let record = &problem.experiment.record;
    let at_ratio = fe.full_order()?.clone();
    let full = FullOrderForward::new(&problem.model, &fe.stiffness, at_ratio, &record.time_s, record.force())
        .in_surroundings(fe.surroundings());
    let position_m = full.trajectory_m(values)?;
    let (rows, extreme_row) = rows_with_extreme(written_rows, &position_m);
    let FullRun { position_m, fields, mesh, compliance_per_m } = full.run(values, &rows)?;
    Ok(FullOrderRun { rows, position_m, fields, mesh, compliance_per_m, extreme_row })
}

/// Reference trajectory (m), from which the time integration error of a run is estimated. For linear models, the reference is the closed form with the
/// elastic compliance of the run. For nonlinear models, it is the full-order trajectory with time steps twice as long. The difference from the run is then
/// several times the run's error.
fn reference_trajectory_m(
    problem: &Problem,
    fe: &FiniteElements,
    compliance_per_m: f64,
    values: &[f64],
) -> Result<Vec<f64>> {
    let record = &problem.experiment.record;
    if problem.model.effects().iter().any(|effect| effect.is_nonlinear()) {
        let resolution = Resolution { steps_per_doubling: Resolution::default().steps_per_doubling / 2 };
        let at_ratio = fe.full_order()?.clone();
        return FullOrderForward::new(&problem.model, &fe.stiffness, at_ratio, &record.time_s, record.force())
            .in_surroundings(fe.surroundings())
            .with_resolution(resolution)
            .trajectory_m(values);
    }
    let constants: Vec<Dual> = values.iter().map(|value| Dual::constant(*value)).collect();
    let mut stages = problem.model.stages(&constants)?;
    stages.spread =
        field_models(fe, None, problem.model.effects(), &posterior::monitor::SilentMonitor)?.spread(&stages)?;
    Response::new(&record.time_s, record.force(), record.n_rows()).trajectory_m(&stages, compliance_per_m)
}

/// Times of the record, with further times between them so that no step is longer than requested.
struct TimeGrid {
    time_s: Vec<f64>,
    force: OwnedForce,
    /// Index in `time_s` of each row of the record.
    place_of_row: Vec<usize>,
}

/// Number of time steps into which an interval is divided. It is a floating-point number, because it may exceed the range of integers.
fn n_parts(interval_s: f64, longest_s: Option<f64>) -> f64 {
    // The factor avoids an extra step, due to rounding, if the interval is a multiple of the longest step.
    longest_s.map_or(1.0, |longest_s| (interval_s / longest_s * (1.0 - 1e-9)).ceil().max(1.0))
}

fn n_steps(record: &Record, longest_s: Option<f64>) -> f64 {
    record.time_s.windows(2).map(|pair| n_parts(pair[1] - pair[0], longest_s)).sum()
}

impl TimeGrid {
    fn new(record: &Record, longest_s: Option<f64>) -> Self {
        let (mut time_s, mut force_n, mut place_of_row) = (Vec::new(), Vec::new(), Vec::new());
        for (row, &time) in record.time_s.iter().enumerate() {
            place_of_row.push(time_s.len());
            let interval_s = record.time_s.get(row + 1).map_or(0.0, |next| next - time);
            let parts = n_parts(interval_s, longest_s);
            for part in 0..parts as usize {
                let at_s = time + interval_s * part as f64 / parts;
                time_s.push(at_s);
                force_n.push(record.force().at_n(&record.time_s, at_s));
            }
        }
        Self { time_s, force: OwnedForce { at_rows_n: force_n, rule: record.force_rule }, place_of_row }
    }
}

/// Rows at which displacement fields are written: the ends of force holds, and the last row. Too many rows are thinned evenly.
fn field_rows(record: &Record) -> Vec<usize> {
    let mut rows: Vec<usize> = record.force_step_rows().into_iter().filter(|&row| row > 0).collect();
    if record.n_rows() > 0 {
        rows.push(record.n_rows() - 1);
    }
    rows.dedup();
    let n = rows.len();
    if n <= MOST_FIELDS {
        return rows;
    }
    (1..=MOST_FIELDS).map(|k| rows[k * n / MOST_FIELDS - 1]).collect()
}

#[cfg(test)]
#[path = "simulate_tests.rs"]
mod tests;
