//! `shapes`: repeats the paper's study of robot shapes, with posterior uncertainty.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use vitreo_uq::base::error::{Error, InputPlace, Result};
use vitreo_uq::base::number::Dual;
use vitreo_uq::documents::posterior::Warning;
use vitreo_uq::elements::fe::oldroyd::FiniteLaw;
use vitreo_uq::jobs::outcome::Outcome;
use vitreo_uq::jobs::prediction::{draws_of_revision, study_warnings};
use vitreo_uq::jobs::target::Revision;
use vitreo_uq::posterior::mechanics::{MeshFile, read_mesh};
use vitreo_uq::posterior::monitor::Monitor;
use vitreo_uq::posterior::study::WithProvenance;
use vitreo_uq::prediction::ensemble::{Draws, Gel};
use vitreo_uq::prediction::shapes::artefacts;
use vitreo_uq::prediction::shapes::bodies::PAPER_ASPECT;
use vitreo_uq::prediction::shapes::job::{self, ShapesRequest};
use vitreo_uq::prediction::shapes::summary::summarise;
use vitreo_uq::record::{Apparatus, RobotShape, Vitreous};

use crate::options::{Common, ModelOptions, OutputOptions};
use crate::report::PageArguments;
use crate::session::{RESULTS, Session};
use crate::shapes_words;

/// Arguments of `shapes`.
#[derive(Args)]
pub struct ShapesArguments {
    /// Experiment (a directory with experiment.toml, or that file) or study [default: the embedded porcine replica]
    #[arg(value_name = "EXPERIMENT|STUDY")]
    target: Option<PathBuf>,
    /// Study directory [default: vitreo-uq-out/<specimen id>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    output: OutputOptions,
    #[command(flatten)]
    model: ModelOptions,
    /// Aspect ratios, separated by commas: length to diameter of cylinders, long to short semi-axis of ellipsoids; the study uses the first and compares the others
    #[arg(long, value_name = "RATIO", default_values_t = [PAPER_ASPECT], value_delimiter = ',', allow_negative_numbers = true)]
    aspect: Vec<f64>,
    /// Force amplitude in µN, or several, separated by commas [default: the experiment's]
    #[arg(long, value_name = "MICRONEWTON", value_delimiter = ',', allow_negative_numbers = true)]
    force_un: Vec<f64>,
    /// Replace a study or revision that was made from another input or model
    #[arg(long, value_name = "", num_args = 0..=1, allow_negative_numbers = true)]
    force: Option<Option<String>>,
    /// Poisson ratio, or several, separated by commas [default: the experiment's]
    #[arg(long, value_name = "RATIO", value_delimiter = ',', allow_negative_numbers = true)]
    poisson: Vec<f64>,
}

impl ShapesArguments {
    /// Converts the arguments to the options that every command has. A number after `--force` is refused, because the user may mean `--force-un`. Any other
    /// text after it is taken as the target.
    fn common(&self) -> Result<Common> {
        let mut target = self.target.clone();
        if let Some(Some(text)) = &self.force {
            if target.is_some() || text.split(',').all(|part| part.trim().parse::<f64>().is_ok()) {
                return Err(Error::input(
                    InputPlace::default().at_key("--force"),
                    format!(
                        "`--force` takes no number such as `{text}`; it replaces a study that was made from another input"
                    ),
                    format!("give forces in µN with `--force-un {text}`"),
                ));
            }
            target = Some(PathBuf::from(text));
        }
        Ok(Common { target, out: self.out.clone(), output: self.output.clone(), force: self.force.is_some() })
    }
}

/// Diameter of the sphere in the paper, in m. It is used if the experiment's robot is not a sphere.
const PAPER_DIAMETER_M: f64 = 0.55e-3;
/// Duration of a hold in the paper's cycle, in s.
const HOLD_S: f64 = 5.0;

pub fn run(arguments: &ShapesArguments) -> Result<ExitCode> {
    let common = &arguments.common()?;
    check(arguments)?;
    let session = Session::begin(common)?;
    let terminal = &session.terminal;
    // The option `--mesh` gives an additional body of the study. The revision of the experiment is made with the experiment's own robot.
    let model = ModelOptions { mesh: None, ..arguments.model.clone() };
    let revision = session.open(&model, &[], &[])?.creep()?.revision(session.default_sampler(), terminal)?;
    let (request, of_mesh) = request(arguments, &revision)?;
    let found = job::run(&request, terminal)?;
    let mut summary = summarise(&request, &found, &forces_n(arguments, &request));
    summary.warnings.extend(study_warnings(&revision.study.revision_dir(&revision.name)?, &revision.name, false)?);
    let is_sound = !summary.warnings.iter().any(|warning| warning.kind.is_fatal());
    summary.warnings.extend(of_mesh);
    terminal.stage("writing results and figures");
    let provenance = revision.provenance("shapes", common.output.seed);
    let written = artefacts::write(&revision.study, &found, &summary, provenance.clone())?;
    let document = WithProvenance { provenance, body: summary };
    let words = shapes_words::words(&document.body);
    session.end(
        &Outcome { document, is_sound, written, study: None },
        &words,
        RESULTS,
        &PageArguments { no_report: true },
    )
}

fn check(arguments: &ShapesArguments) -> Result<()> {
    let refuse = |option: &str, found: String, remedy: &str| {
        Err(Error::input(InputPlace::default().at_key(option), found, remedy))
    };
    if let Some(aspect) = arguments.aspect.iter().find(|value| !(1.0..=20.0).contains(*value)) {
        return refuse("--aspect", format!("an aspect ratio of {aspect}"), "give a ratio between 1 and 20");
    }
    if let Some(poisson) = arguments.poisson.iter().find(|value| !(0.0..=0.4999).contains(*value)) {
        return refuse("--poisson", format!("a Poisson ratio of {poisson}"), "give a ratio between 0 and 0.4999");
    }
    if let Some(force) = arguments.force_un.iter().find(|value| !(**value > 0.0 && value.is_finite())) {
        return refuse("--force-un", format!("a force of {force} µN"), "give a positive force");
    }
    Ok(())
}

fn request<'a>(arguments: &ShapesArguments, revision: &'a Revision) -> Result<(ShapesRequest<'a>, Vec<Warning>)> {
    let experiment = &revision.problem.experiment;
    let Apparatus::Robot { robot, vitreous } = &experiment.apparatus else {
        return Err(Error::input(
            InputPlace::file(revision.study.dir().join("experiment.toml")).at_key("instrument"),
            "shapes need the size of the gel around the robot, which an experiment with [instrument] does not give",
            "give an experiment with [robot] and [vitreous], or none for the embedded replica",
        ));
    };
    let sphere_diameter_m = match robot.shape {
        RobotShape::Sphere { diameter_m } => diameter_m,
        _ => PAPER_DIAMETER_M,
    };
    let poisson_ratios = match &arguments.poisson[..] {
        [] => vec![vitreous.poisson_ratio],
        given => given.to_vec(),
    };
    let (own_mesh, warnings) = match arguments.model.mesh.clone() {
        Some(path) => {
            let file = MeshFile { path, metres_per_unit: arguments.model.mesh_unit };
            let poisson_ratio = poisson_ratios.iter().copied().fold(0.0, f64::max);
            let (mesh, warnings) = read_mesh(&file, None, &Vitreous { poisson_ratio, ..*vitreous })?;
            (Some(mesh), warnings)
        }
        None => (None, Vec::new()),
    };
    let amplitude = experiment.record.force_n.iter().fold(0.0_f64, |most, force| most.max(force.abs()));
    let draws = draws(revision)?;
    let request = ShapesRequest {
        sphere_diameter_m,
        vitreous: *vitreous,
        aspects: arguments.aspect.clone(),
        poisson_ratios,
        force_n: arguments.force_un.first().map_or(amplitude, |force| 1e-6 * force),
        hold_s: HOLD_S,
        finite_law: finite_law(revision, &draws),
        gel: Gel { problem: &revision.problem, draws, is_taught: true, seed: arguments.output.seed },
        own_mesh,
    };
    Ok((request, warnings))
}

/// Force amplitudes for which displacements are reported, in N.
fn forces_n(arguments: &ShapesArguments, request: &ShapesRequest<'_>) -> Vec<f64> {
    match &arguments.force_un[..] {
        [] => vec![request.force_n],
        given => given.iter().map(|force| 1e-6 * force).collect(),
    }
}

/// Draws of the gel's law.
fn draws(revision: &Revision) -> Result<Draws> {
    let Revision { study, name, problem, .. } = revision;
    if !problem.model.effects().is_empty() {
        return Err(Error::input(
            InputPlace::file(study.dir()).at_key(name),
            "shapes are compared in a gel without further effects, but this revision has some",
            "choose a revision without effects (--from m0)",
        ));
    }
    draws_of_revision(&study.revision_dir(name)?, name, problem)
}

/// Law of the gel for large strains, at the mean of the draws; `None` if the law has no such form.
fn finite_law(revision: &Revision, draws: &Draws) -> Option<FiniteLaw> {
    let problem = &revision.problem;
    let base = problem.model.base();
    if !base.is_exponential() || draws.values.is_empty() {
        return None;
    }
    let all: Vec<Vec<f64>> = draws.values.iter().map(|draw| draws.parameters(problem, draw)).collect();
    let mean = |k: usize| Dual::constant(all.iter().map(|parameters| parameters[k]).sum::<f64>() / all.len() as f64);
    FiniteLaw::new(&base.elements(&(0..base.parameters().len()).map(mean).collect::<Vec<Dual>>()), 0.0)
}
