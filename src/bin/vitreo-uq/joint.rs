//! `sample` on several records of one specimen.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use vitreo_uq::base::error::{Error, Place, Result};
use vitreo_uq::base::files::write_json_atomically;
use vitreo_uq::documents::joint::JointSummary;
use vitreo_uq::documents::posterior::ModelSummary;
use vitreo_uq::figures::labels::{model_title, of_parameter};
use vitreo_uq::figures::svg::write_figure;
use vitreo_uq::jobs::sweep::artefacts::joint_figure;
use vitreo_uq::jobs::sweep::joint::{Joint, Member};
use vitreo_uq::jobs::sweep::problem::{DEFAULT_PRIOR, SweepProblem};
use vitreo_uq::models::effects::Library;
use vitreo_uq::posterior::check;
use vitreo_uq::posterior::monitor::Monitor;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::reduced::Reduced;
use vitreo_uq::posterior::study::{ModelSpecification, Provenance, Study, WithProvenance};
use vitreo_uq::record::{Experiment, Sweep};

use crate::options::{self, SampleArguments};
use crate::terminal::Terminal;
use crate::text::{parameter_table, significant, warning_text};

/// Name of the result and of its figure.
const NAME: &str = "joint";

/// A record, ready to be computed.
enum Record {
    Creep(Box<(Problem, Reduced)>),
    Oscillation(Box<SweepProblem>),
}

pub fn sample(arguments: &SampleArguments) -> Result<ExitCode> {
    let began = Instant::now();
    let common = &arguments.common;
    let threads = options::use_threads(common.threads)?;
    crate::output::check(common.json.as_deref())?;
    let options = options::sampler(arguments.chains, arguments.steps, common.seed, threads);
    let terminal = Terminal::new(common.quiet);
    let model = &arguments.model;
    for (option, is_given) in [
        ("--with", !model.with.is_empty()),
        ("--noise", !model.noise.is_empty()),
        ("--mesh", model.mesh.is_some()),
        ("--from", model.from.is_some()),
        ("--resume", arguments.resume),
    ] {
        if is_given {
            let found = "several records share the law alone, with white noise each";
            return Err(Error::input(
                Place::default().at_key(option),
                found,
                format!("leave {option} away, or sample one record"),
            ));
        }
    }
    let default = ModelSpecification { prior: DEFAULT_PRIOR.into(), ..ModelSpecification::default() };
    let specification = default.with_options(model.law().as_deref(), &[], &[], model.prior.as_deref(), &model.set)?;
    let paths: Vec<&PathBuf> = common.target.iter().chain(&arguments.others).collect();
    let mut header = Provenance::new(NAME, 1, common.seed, std::collections::BTreeMap::new());
    let mut records = Vec::new();
    for (number, path) in paths.iter().enumerate() {
        let files = if Sweep::is_one(path) {
            let (sweep, files) = Sweep::read(path)?;
            let problem = SweepProblem::new(sweep, specification.clone(), &Library::default())?;
            records.push(Record::Oscillation(Box::new(problem)));
            files
        } else {
            let (experiment, files) = Experiment::read(path)?;
            check::refuse_certain(&experiment, &files.understood, &terminal)?;
            let problem = Problem::new(experiment, specification.clone(), None, &terminal)?;
            let reduced = Reduced::new(&problem, None, &terminal)?;
            records.push(Record::Creep(Box::new((problem, reduced))));
            files
        };
        for (name, hash) in Study::hashes_of(&files)? {
            header.inputs_sha256.insert(format!("record {}: {name}", number + 1), hash);
        }
    }
    let densities: Vec<_> = records
        .iter()
        .map(|record| match record {
            Record::Creep(creep) => Some(creep.0.posterior(&creep.1)),
            Record::Oscillation(_) => None,
        })
        .collect();
    let pairs = records.iter().zip(&densities);
    let members: Vec<Member<'_>> = pairs.filter_map(|(record, density)| member_of(record, density.as_ref())).collect();
    let joint = Joint::new(members, specification.base.parameters())?;
    options.validate(joint.priors.priors().len())?;
    let id = records.first().map_or(String::new(), |record| id_of(record).to_string());
    let dir = common.out.clone().unwrap_or_else(|| Study::default_dir(&format!("{id}-{NAME}")));
    if !dir.join(format!("{NAME}.json")).is_file() {
        Study::check_place(&dir)?;
    }
    let summary = ModelSummary { noise: vec!["own".into()], ..specification.summary() };
    let result = joint.run(summary, &options, &terminal)?;
    terminal.stage("writing results and figures");
    std::fs::create_dir_all(&dir)
        .map_err(|error| Error::at_path("create", &dir, error, "choose a writable place with `--out`"))?;
    write_figure(&dir, NAME, &joint_figure(&id, &joint.priors, &result)?)?;
    let provenance = vitreo_uq::jobs::artefacts::with_prior(header, &joint.priors);
    let document = WithProvenance { provenance, body: &result.summary };
    write_json_atomically(&dir.join(format!("{NAME}.json")), &document)?;
    terminal.finish();
    crate::output::show(common.json.as_deref(), &document, &words(&result.summary))?;
    if !common.quiet {
        let seconds = began.elapsed().as_secs_f64();
        crate::interrupt::say(&format!("Results and figure: {} ({seconds:.1} s)", dir.display()));
    }
    Ok(ExitCode::from(u8::from(!result.summary.is_sound())))
}

fn id_of(record: &Record) -> &str {
    match record {
        Record::Creep(creep) => &creep.0.experiment.specimen_id,
        Record::Oscillation(problem) => &problem.sweep.specimen_id,
    }
}

fn member_of<'a>(
    record: &'a Record,
    density: Option<&'a vitreo_uq::posterior::likelihood::ReducedPosterior<'a>>,
) -> Option<Member<'a>> {
    let id = id_of(record).to_string();
    match record {
        Record::Creep(creep) => density.map(|density| Member { id, kind: "creep", density, priors: &creep.0.priors }),
        Record::Oscillation(problem) => {
            Some(Member { id, kind: "oscillation", density: &**problem, priors: &problem.priors })
        }
    }
}

fn words(summary: &JointSummary) -> String {
    let verdict = if summary.converged { "converged" } else { "NOT CONVERGED" };
    let mut lines = vec![
        format!("{} records, one {} law: {verdict}", summary.records.len(), model_title(&summary.model)),
        String::new(),
        parameter_table(&summary.parameters),
        String::new(),
        "Each record alone (best fit, one standard deviation):".into(),
    ];
    for (number, record) in summary.records.iter().enumerate() {
        let law: Vec<String> = record
            .law
            .iter()
            .map(|own| {
                let label = of_parameter(&own.name);
                let [value, lower, upper] = [own.value, own.lower, own.upper].map(significant);
                format!("{} = {value} ({lower} to {upper}) {}", label.symbol, label.unit)
            })
            .collect();
        lines.push(format!("  record {}, {} ({}): {}", number + 1, record.kind, record.id, law.join(", ")));
    }
    let p = summary.agreement.p;
    let shown = if p < 0.001 { "below 0.001".into() } else { format!("{p:.3}") };
    lines.push(format!("Probability that records of one law differ as much: {shown}."));
    for warning in &summary.warnings {
        lines.push(String::new());
        lines.push(warning_text(warning));
    }
    lines.join("\n") + "\n"
}
