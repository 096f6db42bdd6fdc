//! `shapes`: repeats the paper's study of robot shapes, with posterior uncertainty.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use vitreo_uq::base::error::{Error, InputPlace, Result};
use vitreo_uq::base::number::Dual;
use vitreo_uq::documents::posterior::Warning;
use vitreo_uq::documents::shapes::ShapesSummary;
use vitreo_uq::elements::fe::oldroyd::FiniteLaw;
use vitreo_uq::figures::draws::read_draws_csv;
use vitreo_uq::jobs::outcome::Outcome;
use vitreo_uq::jobs::target::Revision;
use vitreo_uq::laws::rheology::CreepCompliance;
use vitreo_uq::posterior::mechanics::{MeshFile, read_mesh};
use vitreo_uq::posterior::monitor::Monitor;
use vitreo_uq::posterior::study::WithProvenance;
use vitreo_uq::record::{Apparatus, RobotShape, Vitreous};
use vitreo_uq::validation::shapes::artefacts;
use vitreo_uq::validation::shapes::bodies::PAPER_ASPECT;
use vitreo_uq::validation::shapes::job::{self, ShapesRequest};
use vitreo_uq::validation::shapes::summary::summarise;

use crate::options::{Common, ModelOptions};
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
    /// Write the result as one JSON document to a file, or with `-` to standard output in place of the text
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
    /// Number of threads; 0 for as many as there are cores
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    threads: usize,
    /// Do not show progress on standard error
    #[arg(long)]
    quiet: bool,
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
        let Self { target, out, json, seed, threads, quiet, .. } = self;
        let (mut target, out, json) = (target.clone(), out.clone(), json.clone());
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
        Ok(Common { target, out, json, seed: *seed, threads: *threads, quiet: *quiet, force: self.force.is_some() })
    }
}

/// Diameter of the sphere in the paper, in m. It is used if the experiment's robot is not a sphere.
const PAPER_DIAMETER_M: f64 = 0.55e-3;
/// Duration of a hold in the paper's cycle, in s.
const HOLD_S: f64 = 5.0;
/// Number of posterior draws for which displacements are computed.
const N_DRAWS: usize = 1_000;

pub fn run(arguments: &ShapesArguments) -> Result<ExitCode> {
    let common = &arguments.common()?;
    check(arguments)?;
    let session = Session::begin(common)?;
    let terminal = &session.terminal;
    // The option `--mesh` gives an additional body of the study. The revision of the experiment is made with the experiment's own robot.
    let model = ModelOptions { mesh: None, ..arguments.model.clone() };
    let revision = session.open(&model, &[], &[])?.creep()?.revision(session.default_sampler(), terminal)?;
    let (request, warnings) = request(arguments, &revision)?;
    let found = job::run(&request, terminal)?;
    let summary = ShapesSummary { warnings, ..summarise(&request, &found, &forces_n(arguments, &request)) };
    terminal.stage("writing results and figures");
    let provenance = revision.provenance("shapes", common.seed);
    let written = artefacts::write(&revision.study, &found, &summary, provenance.clone())?;
    let document = WithProvenance { provenance, body: summary };
    let words = shapes_words::words(&document.body);
    session.end(
        &Outcome { document, is_sound: true, written, study: None },
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

fn request(arguments: &ShapesArguments, revision: &Revision) -> Result<(ShapesRequest, Vec<Warning>)> {
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
    let (laws, mean) = laws(revision)?;
    let request = ShapesRequest {
        sphere_diameter_m,
        vitreous: *vitreous,
        aspects: arguments.aspect.clone(),
        poisson_ratios,
        force_n: arguments.force_un.first().map_or(amplitude, |force| 1e-6 * force),
        hold_s: HOLD_S,
        laws,
        finite_law: mean.and_then(|mean| FiniteLaw::new(&revision.problem.model.base().elements(&mean), 0.0)),
        own_mesh,
    };
    Ok((request, warnings))
}

/// Force amplitudes for which displacements are reported, in N.
fn forces_n(arguments: &ShapesArguments, request: &ShapesRequest) -> Vec<f64> {
    match &arguments.force_un[..] {
        [] => vec![request.force_n],
        given => given.iter().map(|force| 1e-6 * force).collect(),
    }
}

/// Creep compliance of the gel for posterior draws of the revision, and the law's parameters at the posterior mean. `None` for the parameters if there are no
/// draws.
fn laws(revision: &Revision) -> Result<(Vec<CreepCompliance>, Option<Vec<Dual>>)> {
    let model = &revision.problem.model;
    if !model.effects().is_empty() || !model.base().is_exponential() {
        return Err(Error::input(
            InputPlace::file(revision.study.dir()).at_key(&revision.name),
            "shapes are compared in a gel of springs and dashpots alone, but this revision has further effects",
            "choose a revision without effects (--from m0)",
        ));
    }
    let table = read_draws_csv(&revision.study.revision_dir(&revision.name)?.join("draws.csv"))?;
    let column = |name: &str| {
        table.parameter_names.iter().position(|parameter_name| parameter_name == name).map(|index| table.column(index))
    };
    let fixed = &revision.problem.specification.fixed;
    let columns: Vec<(Option<Vec<f64>>, f64)> = model
        .base()
        .parameters()
        .iter()
        .map(|spec| (column(spec.name), fixed.get(spec.name).copied().unwrap_or(f64::NAN)))
        .collect();
    let n = table.n_draws();
    let law = |draw: usize| {
        let parameters: Vec<f64> =
            columns.iter().map(|(values, fixed)| values.as_ref().map_or(*fixed, |values| values[draw])).collect();
        model.base().creep_compliance(&parameters)
    };
    let mean = |(values, fixed): &(Option<Vec<f64>>, f64)| {
        let mean = values.as_ref().map_or(*fixed, |values| values.iter().sum::<f64>() / n as f64);
        Dual::constant(mean)
    };
    let mean = (n > 0).then(|| columns.iter().map(mean).collect());
    Ok(((0..n).step_by(n.div_ceil(N_DRAWS).max(1)).filter_map(law).collect(), mean))
}
