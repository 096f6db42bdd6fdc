//! `check`, `sample` and `diagnose` on an oscillation of a rheometer.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use vitreo_uq::base::error::{Error, Place, Result, Setting};
use vitreo_uq::base::files::write_json_atomically;
use vitreo_uq::documents::check::{CheckSummary, UnderstoodRecord};
use vitreo_uq::documents::oscillation::{
    OscillationCandidate, OscillationDiagnosis, OscillationMisfit, OscillationSummary,
};
use vitreo_uq::figures::labels::{model_title, of_parameter};
use vitreo_uq::figures::svg::write_figure;
use vitreo_uq::jobs::first_revision::{FIRST_REVISION, refuse_other_model};
use vitreo_uq::jobs::sweep::problem::{DEFAULT_PRIOR, SweepProblem};
use vitreo_uq::jobs::sweep::{artefacts, diagnose, job};
use vitreo_uq::models::effects::Library;
use vitreo_uq::posterior::monitor::Monitor;
use vitreo_uq::posterior::study::{DIAGNOSIS_NAME, ModelSpecification, Provenance, Study, WithProvenance};
use vitreo_uq::record::{ExperimentFiles, Sweep, SweepForm};

use crate::options::{self, Common, DiagnoseArguments, Model, SampleArguments};
use crate::terminal::Terminal;
use crate::text::{parameter_table, significant, warning_text};

/// Whether a command is to work on an oscillation.
pub fn is_one(target: Option<&PathBuf>) -> bool {
    target.is_some_and(|path| Sweep::is_one(path))
}

/// An oscillation and its study, or where that will be.
struct SweepTarget {
    sweep: Sweep,
    files: ExperimentFiles,
    dir: PathBuf,
    force: bool,
}

impl SweepTarget {
    fn open(common: &Common) -> Result<Self> {
        let path = common.target.as_deref().unwrap_or(Path::new("."));
        let (sweep, files) = Sweep::read(path)?;
        let dir = match (&common.out, Study::is_study(path)) {
            (None, true) => path.to_path_buf(),
            (Some(_), true) => {
                let found = format!("{} is a study already", path.display());
                let remedy = "leave --out away, or give the experiment instead of the study";
                return Err(Error::input(Place::setting(Setting::Out), found, remedy));
            }
            (out, false) => out.clone().unwrap_or_else(|| Study::default_dir(&sweep.specimen_id)),
        };
        if !Study::is_study(&dir) {
            Study::check_place(&dir)?;
        }
        Ok(Self { sweep, files, dir, force: common.force })
    }

    /// The model of the study's posterior, if it has one of this oscillation.
    fn model(&self) -> Result<ModelSpecification> {
        let default = ModelSpecification { prior: DEFAULT_PRIOR.into(), ..ModelSpecification::default() };
        if !Study::is_study(&self.dir) {
            return Ok(default);
        }
        let study = Study::open(&self.dir)?;
        let is_same = *study.inputs_sha256() == Study::hashes_of(&self.files)?;
        match study.revision_dir(FIRST_REVISION).ok().filter(|_| is_same) {
            Some(dir) => ModelSpecification::of_revision(&dir, &Library::default()),
            None => Ok(default),
        }
    }

    fn problem(&self, model: &Model) -> Result<SweepProblem> {
        for (option, is_given) in [("--mesh", model.mesh.is_some()), ("--from", model.from.is_some())] {
            if is_given {
                let found = "an oscillation has neither finite elements nor later revisions";
                return Err(Error::input(Place::default().at_key(option), found, format!("leave {option} away")));
            }
        }
        let specification = self.model()?.with_options(
            model.law().as_deref(),
            &model.with,
            &model.noise,
            model.prior.as_deref(),
            &model.set,
        )?;
        SweepProblem::new(self.sweep.clone(), specification, &Library::default())
    }

    fn study(&self) -> Result<Study> {
        Study::open_or_create(&self.dir, &self.files, self.force)
    }
}

/// `sample`.
pub fn sample(arguments: &SampleArguments) -> Result<ExitCode> {
    let began = Instant::now();
    let common = &arguments.common;
    let threads = options::use_threads(common.threads)?;
    crate::output::check(common.json.as_deref())?;
    let options = options::sampler(arguments.chains, arguments.steps, common.seed, threads);
    let terminal = Terminal::new(common.quiet);
    let target = SweepTarget::open(common)?;
    let problem = target.problem(&arguments.model)?;
    if problem.priors.priors().is_empty() {
        let found = "every parameter is fixed, so there is nothing to infer";
        return Err(Error::input(Place::setting(Setting::Fixed), found, "leave at least one parameter free"));
    }
    options.validate(problem.priors.priors().len())?;
    let study = target.study()?;
    refuse_other_model(&study, &problem.specification, common.force)?;
    let revision = study.begin_revision(FIRST_REVISION)?;
    let result = job::run(&problem, &options, &terminal)?;
    terminal.stage("writing results and figures");
    let header = |kind: &str| provenance(study.provenance(kind, 1, common.seed), &problem);
    artefacts::write(revision.path(), &problem, &result, &header)?;
    let written = revision.commit()?;
    terminal.finish();
    let document = WithProvenance { provenance: header("oscillation"), body: &result.summary };
    crate::output::show(common.json.as_deref(), &document, &posterior_words(&result.summary))?;
    crate::output::say_where(common.quiet, &written, began);
    Ok(ExitCode::from(u8::from(!result.summary.is_sound())))
}

fn provenance(header: Provenance, problem: &SweepProblem) -> Provenance {
    vitreo_uq::jobs::artefacts::with_prior(header, &problem.priors)
}

fn errors_words(misfit: &OscillationMisfit) -> String {
    let percent = |share: f64| format!("{} %", significant(100.0 * share));
    let origin = if misfit.errors_known { "said by the table" } else { "learnt" };
    let mut text = format!(
        "Fitted frequencies: G′ and G″ miss by {} of |G*| (errors {}, {origin}).",
        percent(misfit.relative_fitted),
        percent(misfit.error_relative)
    );
    if let (Some(relative), Some(over)) = (misfit.relative_heldout, misfit.heldout_over_error) {
        text += &format!("\nHeld-out frequencies: by {}, {} × their errors.", percent(relative), significant(over));
    }
    text + &format!(
        "\nProbability that noise leaves as much: {}.",
        if misfit.p < 0.01 { "below 0.01".into() } else { format!("{:.2}", misfit.p) }
    )
}

fn posterior_words(summary: &OscillationSummary) -> String {
    let verdict = if summary.converged { "converged" } else { "NOT CONVERGED" };
    let frequencies = &summary.frequencies;
    let mut lines = vec![
        format!(
            "{}: {} model, {} frequencies from {} to {} Hz, Poisson ratio {}: {verdict}",
            summary.experiment,
            model_title(&summary.model),
            frequencies.fitted + frequencies.heldout,
            significant(frequencies.lowest_hz),
            significant(frequencies.highest_hz),
            summary.poisson_ratio
        ),
        String::new(),
        parameter_table(&summary.parameters),
        String::new(),
        errors_words(&summary.misfit),
    ];
    for warning in &summary.warnings {
        lines.push(String::new());
        lines.push(warning_text(warning));
    }
    lines.join("\n") + "\n"
}

/// `diagnose`.
pub fn diagnose(arguments: &DiagnoseArguments) -> Result<ExitCode> {
    let began = Instant::now();
    let common = &arguments.common;
    options::use_threads(common.threads)?;
    crate::output::check(common.json.as_deref())?;
    let terminal = Terminal::new(common.quiet);
    let target = SweepTarget::open(common)?;
    let problem = target.problem(&arguments.model)?;
    let study = target.study()?;
    let found = diagnose::run(&problem, common.seed, &Library::default(), &terminal)?;
    let header = provenance(study.provenance("oscillation-diagnosis", 1, common.seed), &problem);
    let document = WithProvenance { provenance: header, body: &found };
    let path = study.dir().join(DIAGNOSIS_NAME);
    write_json_atomically(&path, &document)?;
    terminal.finish();
    crate::output::show(common.json.as_deref(), &document, &diagnosis_words(&found))?;
    if !common.quiet {
        crate::interrupt::say(&format!("Result: {} ({:.1} s)", path.display(), began.elapsed().as_secs_f64()));
    }
    Ok(ExitCode::SUCCESS)
}

fn diagnosis_words(found: &OscillationDiagnosis) -> String {
    let mut lines = vec![
        format!("{}: {} model", found.experiment, model_title(&found.model)),
        String::new(),
        found.verdict.sentence.clone(),
        String::new(),
        errors_words(&found.base),
    ];
    if let Some(extended) = &found.extended {
        lines.push(format!("With {}:", found.verdict.effects.join(" and ")));
        lines.push(errors_words(extended));
    }
    lines.push(String::new());
    lines.push(format!("  {:<26}{:>12}{:>12}{:>9}   {}", "effect", "gain (nats)", "held-out", "p", "size"));
    lines.extend(found.candidates.iter().map(row));
    lines.push(String::new());
    lines.push("Other effects need a record in time: an oscillation shows those of the law alone.".into());
    lines.join("\n") + "\n"
}

fn row(candidate: &OscillationCandidate) -> String {
    let heldout = candidate.heldout_gain_nats.map_or("–".into(), |gain| format!("{gain:.1}"));
    let sizes: Vec<String> = candidate
        .parameters
        .iter()
        .map(|own| {
            let label = of_parameter(&own.name);
            let name = label.symbol.rsplit(' ').next().unwrap_or_default().to_string();
            let range = format!("{} to {}", significant(own.lower), significant(own.upper));
            let unit = if label.unit == "–" { String::new() } else { format!(" {}", label.unit) };
            format!("{name} = {} ({range}){unit}", significant(own.value))
        })
        .collect();
    let gain = format!("{:.1}", candidate.gain_nats);
    format!("  {:<26}{gain:>12}{heldout:>12}{:>9.3}   {}", candidate.effect, candidate.p_familywise, sizes.join(", "))
}

/// `check`: what was understood, and the moduli drawn.
pub fn check(path: &Path, out: &Path, json: Option<&Path>, quiet: bool) -> Result<ExitCode> {
    let (sweep, files) = Sweep::read(path)?;
    let dir = out.parent().filter(|dir| !dir.as_os_str().is_empty()).map_or(PathBuf::from("."), PathBuf::from);
    let stem = out.file_name().map_or("record".into(), |name| name.to_string_lossy().into_owned());
    write_figure(&dir, &stem, &artefacts::raw_figure(&sweep)?)?;
    let summary = understood(&sweep);
    let provenance = Provenance::new("check", 1, 0, Study::hashes_of(&files)?);
    let words = summary.understood.sentences.join("\n") + "\n\nNothing contradicts the description.\n";
    crate::output::show(json, &WithProvenance { provenance, body: &summary }, &words)?;
    if !quiet {
        crate::interrupt::say(&format!("Figure: {}.svg and .png", out.display()));
    }
    Ok(ExitCode::SUCCESS)
}

fn understood(sweep: &Sweep) -> CheckSummary {
    let n_heldout = sweep.rows.iter().filter(|row| row.is_heldout).count();
    let [lowest_hz, highest_hz] = sweep.range_hz().map(significant);
    let moduli: Vec<[f64; 2]> = sweep.rows.iter().map(|row| sweep.form.moduli(row.pair)).collect();
    let range = |k: usize| {
        let ends = moduli
            .iter()
            .map(|pair| pair[k])
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)]);
        ends.map(significant)
    };
    let [[low, high], [lowest, highest]] = [range(0), range(1)];
    let form = match sweep.form {
        SweepForm::StorageAndLoss => "storage and loss modulus",
        SweepForm::ModulusAndPhase => "modulus and phase",
    };
    let errors = if sweep.has_errors() { "with their errors" } else { "without errors: one relative size is learnt" };
    let sentences = vec![
        format!("{}: an oscillation, {form}, {errors}.", sweep.specimen_id),
        format!(
            "{} frequencies from {lowest_hz} to {highest_hz} Hz; {} rows lack a number.",
            sweep.rows.len(),
            sweep.n_incomplete
        ),
        format!("G′ from {low} to {high} Pa, G″ from {lowest} to {highest} Pa."),
        format!("Poisson ratio {}: G = E/{}.", sweep.poisson_ratio, significant(2.0 + 2.0 * sweep.poisson_ratio)),
        format!("{} frequencies are fitted, {n_heldout} are held out.", sweep.rows.len() - n_heldout),
    ];
    let understood = UnderstoodRecord { rows: sweep.rows.len(), positions: sweep.rows.len(), cycles: 1, sentences };
    CheckSummary { experiment: sweep.specimen_id.clone(), understood, contradictions: Vec::new() }
}
