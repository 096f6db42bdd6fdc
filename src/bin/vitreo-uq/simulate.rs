//! `simulate`: computes the motion under the experiment's protocol with full finite elements.

use std::collections::BTreeMap;
use std::process::ExitCode;

use vitreo_uq::base::error::{Error, InputPlace, Result, Setting};
use vitreo_uq::base::files::{self, Content, write_json_atomically};
use vitreo_uq::documents::posterior::PosteriorSummary;
use vitreo_uq::documents::simulation::MeshLevel;
use vitreo_uq::documents::simulation::SimulationSummary;
use vitreo_uq::elements::fe::time::TimeScheme;
use vitreo_uq::jobs::simulate::{self, SimulationRequest};
use vitreo_uq::jobs::simulation_files;
use vitreo_uq::models::effects::Library;
use vitreo_uq::posterior::monitor::Monitor;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::study::{ModelSpecification, POSTERIOR_NAME, Study, WithProvenance};

use crate::options::{self, Scheme, SimulateArguments};
use crate::session::Session;
use crate::text::{column_width, significant, warning_text};

pub fn run(arguments: &SimulateArguments) -> Result<ExitCode> {
    let common = &arguments.common;
    let session = Session::begin(common)?;
    let terminal = &session.terminal;
    // In this command `--set` gives values for the simulation. It does not fix parameters of the model.
    let model = options::ModelOptions { set: Vec::new(), ..arguments.model.clone() };
    let target = session.open(&model, &[], &[])?;
    let target = target.creep()?;
    let set = target.specification.values_from_options(&arguments.model.set, &Library::default())?;
    let value = |(name, value): (String, Option<f64>)| match value {
        Some(value) => Ok((name, value)),
        None => Err(Error::input(
            InputPlace::setting(Setting::Fixed),
            format!("`{name}=free` gives no value"),
            format!("give a value, as in `--set {name}=0.01`"),
        )),
    };
    let set = set.into_iter().map(value).collect::<Result<BTreeMap<String, f64>>>()?;
    let problem = target.problem(terminal)?;
    let posterior = match target.existing_study() {
        Some(study) => posterior(study, model.from.as_deref(), &target.specification)?,
        None => None,
    };
    let posterior = posterior.as_ref().map(|(revision, summary)| (revision.as_str(), summary));
    let request = SimulationRequest {
        parameters: simulate::parameters(&problem, &set, posterior)?,
        scheme: scheme(arguments.scheme, &problem),
        time_step_s: arguments.time_step_s,
        refine: arguments.refine,
    };
    let has_mesh_file = model.mesh.is_some();
    simulate::check_request(&problem, &request, has_mesh_file)?;
    let study = target.make_study()?;
    let writer = study.begin_simulation()?;
    let simulation = simulate::run(&problem, &request, has_mesh_file, terminal)?;
    terminal.stage("writing trajectory and fields");
    let document =
        WithProvenance { provenance: study.provenance("simulation", 1, common.output.seed), body: &simulation.summary };
    let stages: BTreeMap<&str, f64> = simulation.timing_s.iter().map(|(stage, s)| (stage.as_str(), *s)).collect();
    let timing = serde_json::json!({ "schema": "vitreo-uq/timing/1", "wall_s": stages });
    let written = writer.publish("simulation.json", &document, |dir| {
        simulation_files::write(dir, &problem, &simulation)?;
        write_json_atomically(&dir.join("timing.json"), &timing)
    })?;
    session.show(&document, &words(&simulation.summary, &stages))?;
    session
        .say(&format!("Trajectory, experiment.toml and fields (open fields.pvd in ParaView): {}", written.display()));
    Ok(ExitCode::SUCCESS)
}

/// Time scheme that the user requests; by default the exact scheme, if the model has one. `None` stands for the Radau scheme.
fn scheme(asked: Option<Scheme>, problem: &Problem) -> Option<TimeScheme> {
    match asked {
        Some(Scheme::Exponential) => Some(TimeScheme::Exponential),
        Some(Scheme::Midpoint) => Some(TimeScheme::Midpoint),
        Some(Scheme::Radau) => None,
        None => problem.is_exponential().then_some(TimeScheme::Exponential),
    }
}

/// Returns the name and the posterior of the revision `from`, or of the last revision. `None` if there is no revision, or if its law or effects differ from
/// `specification`.
fn posterior(
    study: &Study,
    from: Option<&str>,
    specification: &ModelSpecification,
) -> Result<Option<(String, PosteriorSummary)>> {
    let name = match from {
        Some(name) => Some(name.to_string()),
        None => study.revisions()?.pop(),
    };
    let Some(name) = name else { return Ok(None) };
    let dir = study.revision_dir(&name)?;
    let its_model = ModelSpecification::read_kept(&dir, &Library::default())?;
    if its_model.base != specification.base || its_model.effects != specification.effects {
        return Ok(None);
    }
    let path = dir.join(POSTERIOR_NAME);
    let remedy = "run `sample` again, or give every parameter with `--set`";
    let bytes = files::read(&path, Content::Document, remedy)?;
    let document: WithProvenance<PosteriorSummary> = serde_json::from_slice(&bytes).map_err(|error| {
        Error::input(
            InputPlace::file(&path).at_line(error.line()),
            format!("this is not a posterior of this program: {error}"),
            remedy,
        )
    })?;
    Ok(Some((name, document.body)))
}

fn words(summary: &SimulationSummary, seconds: &BTreeMap<&str, f64>) -> String {
    let mut lines = vec![
        format!(
            "{}: full finite elements, {} unknowns, {} time steps ({} scheme)",
            summary.experiment, summary.unknowns, summary.time_steps, summary.scheme
        ),
        String::new(),
    ];
    let parameters = summary.parameters.iter();
    let width = column_width(summary.parameters.iter().map(|p| p.name.as_str()));
    lines.extend(parameters.map(|p| {
        let label = vitreo_uq::figures::labels::parameter_label(&p.name).axis();
        format!("  {label:<width$}{:>11}   {}", significant(p.value), p.origin)
    }));
    lines.push(String::new());
    lines.push(format!("Stiffness: {:.9e} N/m per Pa of Young's modulus.", summary.stiffness_m));
    lines.push(format!(
        "Largest displacement {} µm, largest strain {}; time integration error at most {} µm.",
        significant(summary.largest_displacement_um),
        significant(summary.largest_strain),
        significant(summary.time_integration_error_um)
    ));
    if !summary.convergence.is_empty() {
        lines.push(String::new());
        lines.push(format!(
            "  {:>5}{:>10}{:>18}{:>12}{:>12}{:>7}{:>9}",
            "level", "unknowns", "stiffness (m)", "error", "difference", "order", "seconds"
        ));
        lines.extend(summary.convergence.iter().map(|level| table_row(level, seconds)));
        let is_exact = summary.convergence.iter().any(|level| level.relative_error.is_some());
        let legend = if is_exact {
            "  error: relative to the exact solution for a sphere in a container; difference: from the level before."
        } else {
            "  difference: from the level before; order: from the differences of three levels."
        };
        lines.push(legend.into());
    }
    for warning in &summary.warnings {
        lines.push(String::new());
        lines.push(warning_text(warning));
    }
    lines.join("\n") + "\n"
}

fn table_row(level: &MeshLevel, seconds: &BTreeMap<&str, f64>) -> String {
    let small = |value: Option<f64>| value.map_or("–".into(), |value| format!("{value:.1e}"));
    let seconds = seconds.get(format!("mesh level {}", level.level).as_str()).copied().unwrap_or(f64::NAN);
    format!(
        "  {:>5}{:>10}{:>18.9e}{:>12}{:>12}{:>7}{:>9.2}",
        level.level,
        level.unknowns,
        level.stiffness_m,
        small(level.relative_error),
        small(level.relative_difference),
        level.order.map_or("–".into(), |order| format!("{order:.1}")),
        seconds
    )
}
