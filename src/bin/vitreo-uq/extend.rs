//! `extend`: the next revision of a study, with the error before and after.

use std::process::ExitCode;
use std::time::Instant;

use vitreo_uq::effects::Library;
use vitreo_uq::error::{Error, Place, Result};
use vitreo_uq::files::write_json_atomically;
use vitreo_uq::inference::SamplerOptions;
use vitreo_uq::study::{ModelSpecification, Study, WithProvenance};
use vitreo_uq::workflow::extend::{self, Extension, ExtensionRequest, ExtensionSummary, Misfit};
use vitreo_uq::workflow::mechanics::MeshFile;
use vitreo_uq::workflow::problem::Problem;
use vitreo_uq::workflow::{Monitor, artefacts};

use crate::options::{self, ExtendArguments, Model};
use crate::sample::{refuse_nothing_to_sample, sample_into_m0};
use crate::target::Target;
use crate::terminal::Terminal;
use crate::text::{parameter_table, significant, warning_text};

/// The file of a revision that says what extending led to.
const EXTENSION_NAME: &str = "extension.json";

pub fn run(arguments: &ExtendArguments) -> Result<ExitCode> {
    let began = Instant::now();
    let common = &arguments.common;
    let threads = options::use_threads(common.threads)?;
    crate::output::check(common.json.as_deref())?;
    let options = SamplerOptions {
        n_walkers: arguments.chains,
        max_steps: arguments.steps,
        seed: common.seed,
        threads,
        ..SamplerOptions::default()
    };
    let terminal = Terminal::new(common.quiet);
    let library = Library::default();
    let effects = &arguments.model.with;
    // The effects are what is added, not the model that is extended.
    let model = Model { with: Vec::new(), ..arguments.model.clone() };
    let target = Target::open(common, &model, &terminal)?;
    let specification = model_to_extend(&target, &model)?;
    extend::extended(&specification, effects, &library)?;
    let mesh = model.mesh.clone().map(|path| MeshFile { path, metres_per_unit: model.mesh_unit });
    let before = Problem::new(target.experiment.clone(), specification, mesh.as_ref(), &terminal)?;
    refuse_nothing_to_sample(&before)?;
    options.validate(before.priors.priors().len())?;
    let study = &target.make_study()?;
    if study.revisions()?.is_empty() {
        terminal.stage("m0, the model to extend, on the calibration cycles");
        sample_into_m0(study, &before, options.clone(), false, &terminal)?;
    }
    let (from, revision) = revisions(study, model.from.as_deref())?;
    let writer = study.begin_revision(&revision)?;
    let request = ExtensionRequest { from: &from, revision: &revision, effects, options };
    let extension = extend::run(&before, &request, &library, &terminal)?;
    let Extension { summary, problem, after } = &extension;
    terminal.stage("writing results and figures");
    let header = |kind: &str| artefacts::with_inputs(study.provenance(kind, 1, common.seed), problem);
    artefacts::write(writer.path(), problem, after, &header)?;
    let document = WithProvenance { provenance: header("extension"), body: summary };
    write_json_atomically(&writer.path().join(EXTENSION_NAME), &document)?;
    artefacts::write_timing(writer.path(), &after.timing_s, header("timing"))?;
    let written = writer.commit()?;
    terminal.finish();
    crate::output::show(common.json.as_deref(), &document, &words(summary))?;
    if !common.quiet {
        eprintln!("Results and figures: {} ({:.1} s)", written.display(), began.elapsed().as_secs_f64());
    }
    Ok(ExitCode::from(u8::from(!summary.is_sound())))
}

/// The named or last revision's model; `--noise`, `--prior` and `--set` change it before and after alike.
fn model_to_extend(target: &Target, model: &Model) -> Result<ModelSpecification> {
    let Some(study) = target.existing_study() else { return Ok(target.specification.clone()) };
    let last = study.revisions()?.pop();
    let Some(name) = model.from.clone().or(last) else { return Ok(target.specification.clone()) };
    let revision = artefacts::model_of(&study.revision_dir(&name)?, &Library::default())?;
    if model.base.is_some() {
        return Err(Error::input(
            Place::option("--base"),
            format!("the law is that of {name}"),
            "leave --base away, or make a study of another law with `sample --base … --out DIR`",
        ));
    }
    let asked = &target.specification;
    let mut specification = revision;
    if !model.noise.is_empty() {
        specification.noise = asked.noise.clone();
    }
    if model.prior.is_some() {
        specification.prior = asked.prior.clone();
    }
    specification.fixed.extend(model_values(model, &specification)?);
    Ok(specification)
}

fn model_values(model: &Model, specification: &ModelSpecification) -> Result<std::collections::BTreeMap<String, f64>> {
    specification.values_from_options(&model.set, &Library::default())
}

/// The revision to extend and the one to make.
fn revisions(study: &Study, from: Option<&str>) -> Result<(String, String)> {
    let there = study.revisions()?;
    let last = there.last().cloned().unwrap_or_else(|| "m0".into());
    let number = last[1..].parse::<u32>().unwrap_or(0);
    Ok((from.map_or(last, String::from), format!("m{}", number + 1)))
}

fn words(summary: &ExtensionSummary) -> String {
    let cycles = |cycles: &[u32]| cycles.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
    let verdict = if summary.converged { "converged" } else { "NOT CONVERGED" };
    let heldout = if summary.heldout_cycles.is_empty() {
        "no cycle held out".to_string()
    } else {
        format!("scored on cycle {}", cycles(&summary.heldout_cycles))
    };
    let mut lines = vec![
        format!("{}: {} ({}): {verdict}", summary.experiment, summary.model.title(), summary.revision),
        format!("Both models fitted to cycles {}, {heldout}.", cycles(&summary.fitted_cycles)),
        String::new(),
        parameter_table(&summary.parameters),
        String::new(),
        format!("  {:<24}{:>18}{:>20}", "error (µm)", "fitted cycles", "held-out cycle"),
        row(&format!("before ({})", summary.from), summary.before),
        row(&format!("after ({})", summary.revision), summary.after),
    ];
    lines.extend(
        summary.noise_um.map(|noise| format!("  {:<24}{:>18}{:>20}", "noise", significant(noise), significant(noise))),
    );
    lines.push(String::new());
    lines.push(summary.sentence.clone());
    for warning in &summary.warnings {
        lines.push(String::new());
        lines.push(warning_text(warning));
    }
    lines.join("\n") + "\n"
}

fn row(label: &str, misfit: Misfit) -> String {
    let heldout = misfit.rmse_heldout_um.map_or("–".into(), significant);
    format!("  {label:<24}{:>18}{heldout:>20}", significant(misfit.rmse_fitted_um))
}
