//! `extend`: the next revision of a study, with the error before and after.

use std::process::ExitCode;
use std::time::Instant;
use vitreo_uq::figures::labels::model_title;

use vitreo_uq::base::error::{Error, Place, Result, Setting};
use vitreo_uq::base::files::write_json_atomically;
use vitreo_uq::documents::extension::{ExtensionSummary, Misfit};
use vitreo_uq::figures::number::listed;
use vitreo_uq::jobs::artefacts;
use vitreo_uq::jobs::extend::{self, Extension, ExtensionRequest};
use vitreo_uq::models::effects::Library;
use vitreo_uq::posterior::mechanics::MeshFile;
use vitreo_uq::posterior::monitor::Monitor;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::study::{EXTENSION_NAME, RevisionWriter, Study, WithProvenance, named_effects};

use crate::examine::Begun;
use crate::options::{self, Common, ExtendArguments, Model};
use crate::target::Target;
use crate::terminal::Terminal;
use crate::text::{parameter_table, significant, warning_text};
use vitreo_uq::jobs::first_revision::make_first_revision;
use vitreo_uq::posterior::sample::refuse_nothing_to_sample;

pub fn run(arguments: &ExtendArguments) -> Result<ExitCode> {
    let at = Instant::now();
    let common = &arguments.common;
    let threads = options::use_threads(common.threads)?;
    crate::output::check(common.json.as_deref())?;
    let terminal = Terminal::new(common.quiet);
    let begun = Begun { at, common, page: &arguments.page, terminal: &terminal };
    let Extended { study, writer, document } = extended(common, arguments, threads, &terminal)?;
    begun.end(&study, writer, &document, &words(&document.body))?;
    Ok(ExitCode::from(u8::from(!document.body.is_sound())))
}

/// A revision that was extended, before it is made visible.
pub struct Extended {
    /// Its study.
    pub study: Study,
    /// The revision.
    pub writer: RevisionWriter,
    /// What came of it.
    pub document: WithProvenance<ExtensionSummary>,
}

/// Extends what `common` names; all else is in the arguments.
pub fn extended(common: &Common, arguments: &ExtendArguments, threads: usize, terminal: &Terminal) -> Result<Extended> {
    let options = options::sampler(arguments.chains, arguments.steps, common.seed, threads);
    let library = Library::default();
    let effects = &named_effects(&arguments.model.with)?;
    // Effects and values are of the model that is made; all else changes the model that is extended, too.
    let model = Model { with: Vec::new(), set: Vec::new(), ..arguments.model.clone() };
    let target = Target::open(common, &model, terminal)?;
    target.check(terminal)?;
    if let (Some(_), Some(study)) = (model.law(), target.existing_study())
        && !study.revisions()?.is_empty()
    {
        return Err(Error::input(
            Place::setting(Setting::Base),
            "the study has a base law already",
            "leave --base (or --forward) away, or make a study of another law with `sample --base … --out DIR`",
        ));
    }
    let specification = extend::extended(&target.specification, effects, &library)?;
    let values = specification.values_from_options(&arguments.model.set, &library)?;
    let mesh = model.mesh.clone().map(|path| MeshFile { path, metres_per_unit: model.mesh_unit });
    let before = Problem::new(target.experiment.clone(), target.specification.clone(), mesh.as_ref(), terminal)?;
    let (from, revision, earlier) = match target.existing_study() {
        Some(study) => revisions(study, model.from.as_deref())?,
        None => ("m0".into(), "m1".into(), 0),
    };
    let request = ExtensionRequest { from: &from, revision: &revision, effects, values, earlier, options };
    // What can be refused is refused here, before anything is sampled or written.
    let pair = extend::compared(&before, &request, &library)?;
    for problem in [&before, &pair.before, &pair.after] {
        refuse_nothing_to_sample(problem)?;
        request.options.validate(problem.priors.priors().len())?;
    }
    let study = target.make_study()?;
    if study.revisions()?.is_empty() {
        terminal.stage("m0, the model to extend, on the calibration cycles");
        make_first_revision(&study, &before, request.options.clone(), false, terminal)?;
    }
    let writer = study.begin_revision(&revision)?;
    let Extension { summary, problem, after } = extend::run(pair, &request, terminal)?;
    terminal.stage("writing results and figures");
    let header = |kind: &str| artefacts::with_inputs(study.provenance(kind, 1, common.seed), &problem);
    artefacts::write(writer.path(), &problem, &after, &header)?;
    let document = WithProvenance { provenance: header("extension"), body: summary };
    write_json_atomically(&writer.path().join(EXTENSION_NAME), &document)?;
    artefacts::write_timing(writer.path(), &after.timing_s, header("timing"))?;
    Ok(Extended { study, writer, document })
}

/// The revision to extend, the one to make, and how many extensions there are already.
fn revisions(study: &Study, from: Option<&str>) -> Result<(String, String, usize)> {
    let there = study.revisions()?;
    let last = there.last().cloned().unwrap_or_else(|| "m0".into());
    let number = last[1..].parse::<u32>().unwrap_or(0);
    Ok((from.map_or(last, String::from), format!("m{}", number + 1), there.len().saturating_sub(1)))
}

fn words(summary: &ExtensionSummary) -> String {
    let verdict = if summary.converged { "converged" } else { "NOT CONVERGED" };
    let heldout = if summary.heldout_cycles.is_empty() {
        "no cycle held out".to_string()
    } else {
        format!("scored on cycle {}", listed(&summary.heldout_cycles))
    };
    let mut lines = vec![
        format!("{}: {} ({}): {verdict}", summary.experiment, model_title(&summary.model), summary.revision),
        format!("Both models fitted to cycles {}, {heldout}.", listed(&summary.fitted_cycles)),
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
