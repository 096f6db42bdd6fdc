//! `shapes`: the paper's study of robot shapes, with posterior uncertainty.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Args;
use vitreo_uq::error::{Error, Place, Result};
use vitreo_uq::experiment::{Apparatus, RobotShape, Vitreous};
use vitreo_uq::fe::time::FullOrderModel;
use vitreo_uq::report::draws::read_draws_csv;
use vitreo_uq::rheology::CreepCompliance;
use vitreo_uq::shapes::artefacts;
use vitreo_uq::shapes::bodies::PAPER_ASPECT;
use vitreo_uq::shapes::job::{self, ShapesRequest};
use vitreo_uq::shapes::summary::{ShapesSummary, summarise};
use vitreo_uq::study::WithProvenance;
use vitreo_uq::workflow::Monitor;

use crate::examine::Examined;
use crate::options::{self, Common, Model};
use crate::terminal::Terminal;

/// Arguments of `shapes`.
#[derive(Args)]
pub struct ShapesArguments {
    /// Experiment (directory with experiment.toml, or the TOML), or study; without it the embedded porcine replica
    #[arg(value_name = "EXPERIMENT|STUDY")]
    target: Option<PathBuf>,
    /// Study directory [default: vitreo-uq-out/<specimen id>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write the result as one JSON document to a file, or alone to standard output with `-`
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
    /// Threads; 0 for as many as there are cores
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    threads: usize,
    /// No progress on standard error
    #[arg(long)]
    quiet: bool,
    #[command(flatten)]
    model: Model,
    /// Length to diameter, and long to short semi-axis
    #[arg(long, value_name = "RATIO", default_value_t = PAPER_ASPECT, allow_negative_numbers = true)]
    aspect: f64,
    /// Amplitude of the force in µN [default: the experiment's]
    #[arg(long, value_name = "MICRONEWTON", allow_negative_numbers = true)]
    force: Option<f64>,
    /// Poisson ratio [default: the experiment's]
    #[arg(long, value_name = "RATIO", allow_negative_numbers = true)]
    poisson: Option<f64>,
    /// How far the longest robot must move within a hold, in mm
    #[arg(long, value_name = "MILLIMETRE", default_value_t = 0.5, allow_negative_numbers = true)]
    distance: f64,
}

impl ShapesArguments {
    /// What every command takes, but for `--force`, which is a force here.
    fn common(&self) -> Common {
        let Self { target, out, json, seed, threads, quiet, .. } = self;
        let (target, out, json) = (target.clone(), out.clone(), json.clone());
        Common { target, out, json, seed: *seed, threads: *threads, quiet: *quiet, force: false }
    }
}

/// The sphere of the paper, where the experiment's robot is none, in m.
const PAPER_DIAMETER_M: f64 = 0.55e-3;
/// A hold of the paper's cycle, in s.
const HOLD_S: f64 = 5.0;
/// Posterior draws that are carried through.
const N_DRAWS: usize = 1_000;

pub fn run(arguments: &ShapesArguments) -> Result<ExitCode> {
    let began = Instant::now();
    let common = &arguments.common();
    check(arguments)?;
    let threads = options::use_threads(common.threads)?;
    crate::output::check(common.json.as_deref())?;
    let terminal = Terminal::new(common.quiet);
    let sampler = options::default_sampler(common.seed, threads);
    let examined = Examined::open(common, &arguments.model, sampler, &terminal)?;
    let request = request(arguments, &examined)?;
    let found = job::run(&request, &terminal)?;
    let summary = summarise(&request, &found);
    terminal.stage("writing results and figures");
    let provenance = examined.provenance("shapes", common.seed);
    let written = artefacts::write(&examined.study, &found, &summary, provenance.clone())?;
    terminal.finish();
    crate::output::show(common.json.as_deref(), &WithProvenance { provenance, body: &summary }, &words(&summary))?;
    if !common.quiet {
        eprintln!("Results and figures: {} ({:.1} s)", written.display(), began.elapsed().as_secs_f64());
    }
    Ok(ExitCode::SUCCESS)
}

fn check(arguments: &ShapesArguments) -> Result<()> {
    let refuse = |option: &str, found: String, remedy: &str| Err(Error::input(Place::option(option), found, remedy));
    if !(1.0..=20.0).contains(&arguments.aspect) {
        return refuse("--aspect", format!("an aspect ratio of {}", arguments.aspect), "give one between 1 and 20");
    }
    if let Some(poisson) = arguments.poisson.filter(|own| !(0.0..=0.4999).contains(own)) {
        return refuse("--poisson", format!("a Poisson ratio of {poisson}"), "give one between 0 and 0.4999");
    }
    if let Some(force) = arguments.force.filter(|own| !(*own > 0.0 && own.is_finite())) {
        return refuse("--force", format!("a force of {force} µN"), "give a positive one");
    }
    if !(arguments.distance > 0.0 && arguments.distance.is_finite()) {
        return refuse("--distance", format!("a distance of {} mm", arguments.distance), "give a positive one");
    }
    Ok(())
}

fn request(arguments: &ShapesArguments, examined: &Examined) -> Result<ShapesRequest> {
    let experiment = &examined.problem.experiment;
    let Apparatus::Robot { robot, vitreous } = &experiment.apparatus else {
        return Err(Error::input(
            Place::file(examined.study.dir().join("experiment.toml")).at_key("instrument"),
            "shapes need the size of the gel around the robot, and this experiment is another instrument's",
            "give an experiment with [robot] and [vitreous], or none for the embedded replica",
        ));
    };
    let sphere_diameter_m = match robot.shape {
        RobotShape::Sphere { diameter_m } => diameter_m,
        _ => PAPER_DIAMETER_M,
    };
    let amplitude = experiment.record.force_n.iter().fold(0.0_f64, |most, force| most.max(force.abs()));
    Ok(ShapesRequest {
        sphere_diameter_m,
        vitreous: Vitreous { poisson_ratio: arguments.poisson.unwrap_or(vitreous.poisson_ratio), ..*vitreous },
        aspect: arguments.aspect,
        force_n: arguments.force.map_or(amplitude, |force| 1e-6 * force),
        hold_s: HOLD_S,
        distance_m: 1e-3 * arguments.distance,
        laws: laws(examined)?,
        own_stiffness_m: arguments.model.mesh.as_ref().map(|_| own_stiffness_m(examined)).transpose()?,
    })
}

/// Stiffness of the body of the mesh that the user gave.
fn own_stiffness_m(examined: &Examined) -> Result<f64> {
    let fe = examined.problem.finite_elements().ok_or_else(|| {
        Error::numerical("the mesh has no finite elements", "give an experiment with [robot] and [vitreous]")
    })?;
    Ok(1.0 / FullOrderModel::new(&fe.stiffness, fe.poisson_ratio)?.compliance_per_m())
}

/// Posterior draws of the revision, as creep compliances.
fn laws(examined: &Examined) -> Result<Vec<CreepCompliance>> {
    let model = &examined.problem.model;
    if !model.effects().is_empty() || !model.base().is_exponential() {
        return Err(Error::input(
            Place::file(examined.study.dir()).at_key(&examined.revision),
            "shapes are compared in a gel of springs and dashpots alone, and this revision's model is more",
            "choose a revision without effects (--from m0)",
        ));
    }
    let table = read_draws_csv(&examined.study.revision_dir(&examined.revision)?.join("draws.csv"))?;
    let column = |name: &str| table.parameter_names.iter().position(|own| own == name).map(|index| table.column(index));
    let fixed = &examined.problem.specification.fixed;
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
    Ok((0..n).step_by(n.div_ceil(N_DRAWS).max(1)).filter_map(law).collect())
}

fn words(summary: &ShapesSummary) -> String {
    let mut text = String::new();
    let mut line = |words: String| {
        text += &words;
        text.push('\n');
    };
    line(format!(
        "Aspect ratio {:.3}, Poisson ratio {}, gel of {} mm, force ±{} µN",
        summary.aspect, summary.poisson_ratio, summary.vitreous_diameter_mm, summary.force_un
    ));
    line(String::new());
    line(format!(
        "  {:<24}{:>10}{:>11}{:>10}{:>10}{:>10}{:>24}",
        "body", "stiffness", "/ sphere", "surface", "error", "3D − it", "displacement after 5 s"
    ));
    let mut rule = None;
    for body in &summary.bodies {
        if rule != Some(body.size_rule) {
            line(format!("  at {}", body.size_rule.title()));
            rule = Some(body.size_rule);
        }
        let name = match &body.orientation {
            Some(orientation) => format!("{}, {orientation}", body.shape.name()),
            None => body.shape.name().into(),
        };
        let moved = body.displacement_5s_um;
        line(format!(
            "    {name:<22}{:>7.4} mm{:>11.4}{:>10.3}{:>10.0e}{:>10.0e}{:>24}",
            1e3 * body.stiffness_m,
            body.ratio_to_sphere,
            body.surface_ratio,
            body.relative_error,
            body.relative_difference_3d,
            format!("{:.0} ({:.0}–{:.0}) µm", moved.median, moved.q05, moved.q95)
        ));
    }
    if let Some(own) = summary.own_body {
        let moved = own.displacement_5s_um;
        line(format!(
            "  {:<24}{:>7.4} mm{:>11.4}{:>54}",
            "your mesh",
            1e3 * own.stiffness_m,
            own.ratio_to_sphere,
            format!("{:.0} ({:.0}–{:.0}) µm", moved.median, moved.q05, moved.q95)
        ));
    }
    line(String::new());
    line("The paper says that:".into());
    for claim in &summary.claims {
        let verdict = serde_json::to_value(claim.verdict).ok().and_then(|own| own.as_str().map(String::from));
        line(format!("  {:<15}{} ({})", verdict.unwrap_or_default().to_uppercase(), claim.claim, claim.numbers));
    }
    line(String::new());
    line(
        "What predicts the resistance, the sphere's times a ratio of lengths, at equal volume (rms error, worst):"
            .into(),
    );
    for own in &summary.predictors {
        line(format!(
            "  {:<50}{:>6.1} %{:>8.1} % ({})",
            own.predictor,
            100.0 * own.rms_relative_error,
            100.0 * own.largest_relative_error,
            own.worst
        ));
    }
    line(String::new());
    line(format!(
        "The longest that moves {} mm in {} s with 95 %, at the sphere's volume:",
        summary.wanted_displacement_mm, summary.hold_s
    ));
    for own in &summary.longest {
        let found = match (own.aspect, own.length_m) {
            (Some(aspect), Some(length_m)) => {
                let or_longer = if own.is_limit_of_range { ", or longer" } else { "" };
                format!("{:.2} mm (aspect ratio {aspect:.1}{or_longer})", 1e3 * length_m)
            }
            _ => "none".into(),
        };
        line(format!("  {}, {}: {found}", own.shape.name(), own.orientation));
    }
    text
}
