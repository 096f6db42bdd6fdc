//! Source of a gel's parameters: a revision of a study, a group of specimens, or a prior.

use std::path::{Path, PathBuf};

use base::error::{Error, InputPlace, Result, Setting};
use base::files::{self, Content};
use documents::diagnosis::{Diagnosis, VerdictKind};
use documents::groups::GroupsSummary;
use documents::posterior::{PosteriorSummary, Warning, WarningKind};
use documents::trust::TrustLevel;
use figures::draws::read_draws_csv;
use posterior::mechanics::Mechanics;
use posterior::monitor::Monitor;
use posterior::prepared::KeptSurrogate;
use posterior::problem::Problem;
use posterior::study::{DIAGNOSIS_NAME, ModelSpecification, POSTERIOR_NAME, Provenance, Study, WithProvenance};
use prediction::ensemble::{Draws, Gel, MOST_DRAWS};
use prediction::scenario::Scenario;
use prediction::scenario_file::read_scenarios;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use record::{Apparatus, Control, Experiment, Record, Robot, Vitreous};
use sampling::SamplerOptions;
use std::sync::Arc;

use super::rivals::{Rival, rivals};
use crate::first_revision::kept_surrogate;
use crate::last_cycle::read_document;
use crate::target::CreepTarget;

/// Document of a comparison of groups.
const GROUPS_NAME: &str = "groups.json";
/// Table of draws of new specimens, beside that document.
const NEW_SPECIMENS_NAME: &str = "new-specimens.csv";

/// Where a gel's parameters come from.
pub enum GelPlace<'a> {
    /// A study, or an experiment whose study will be made.
    Study(&'a CreepTarget),
    /// Directory of a comparison of groups, and the name of the group.
    Groups {
        /// Directory that contains `groups.json`.
        dir: &'a Path,
        /// Name of the group; `None` if the comparison has one group only.
        group: Option<&'a str>,
        /// Directory of the results; `None` for `dir`.
        out: Option<&'a Path>,
    },
    /// A prior, without any record.
    Prior {
        /// Name of a built-in prior, or a file.
        name: &'a str,
        /// Directory of the results.
        dir: &'a Path,
    },
}

/// True if a directory contains a comparison of groups.
pub fn is_groups(dir: &Path) -> bool {
    dir.join(GROUPS_NAME).is_file()
}

/// Opened source: the model and its draws, and the directory of the results.
pub(crate) struct GelSource {
    pub problem: Problem,
    pub draws: Draws,
    pub is_taught: bool,
    pub kept: Option<KeptSurrogate>,
    pub rivals: Vec<Rival>,
    pub warnings: Vec<Warning>,
    /// Directory of the results.
    pub dir: PathBuf,
    /// Study of the results; `None` for groups and priors.
    pub study: Option<Study>,
    pub seed: u64,
    provenance: Provenance,
}

impl GelPlace<'_> {
    /// Robot and gel of the study; `None` for other sources.
    fn apparatus(&self) -> Result<Option<(Robot, Vitreous)>> {
        match self {
            Self::Groups { .. } | Self::Prior { .. } => Ok(None),
            Self::Study(target) => match &target.experiment.apparatus {
                Apparatus::Robot { robot, vitreous } => Ok(Some((*robot, *vitreous))),
                _ => Err(Error::input(
                    InputPlace::file(&target.experiment.specimen_id).at_key("robot"),
                    "the record is not of a robot in a gel, so that its moduli may have an unknown factor",
                    "give a study with [robot] and [vitreous]",
                )),
            },
        }
    }

    /// Scenarios of a file, at least one. Without a file, the study's own robot is the only scenario, with neither force nor quantities.
    ///
    /// # Errors
    /// Errors of reading; [`Error::Input`] if there is neither a file nor a robot of the study.
    pub(crate) fn scenarios(&self, path: Option<&Path>) -> Result<Vec<Scenario>> {
        match (path, self.apparatus()?) {
            (Some(path), apparatus) => read_scenarios(path, apparatus),
            (None, Some((robot, vitreous))) => Ok(vec![Scenario::of_robot("own robot", robot, vitreous)]),
            (None, None) => Err(Error::input(
                InputPlace::setting(Setting::Scenario),
                "only a study has a robot of its own",
                format!(
                    "give a file with [[scenario]], [scenario.robot] and [scenario.vitreous] (`{}`)",
                    Setting::Scenario
                ),
            )),
        }
    }

    /// Opens the source. `first` is a scenario whose robot the gel of a group or prior is joined with.
    ///
    /// # Errors
    /// Errors of reading and of sampling the first revision; [`Error::Input`] for a group, prior or model that cannot be predicted.
    pub(crate) fn open(&self, first: &Scenario, options: &SamplerOptions, monitor: &dyn Monitor) -> Result<GelSource> {
        match self {
            Self::Study(target) => of_study(target, options, monitor),
            Self::Groups { dir, group, out } => of_group(dir, *group, out.unwrap_or(dir), first, options.seed),
            Self::Prior { name, dir } => of_prior(name, dir, first, options.seed),
        }
    }
}

impl GelSource {
    pub fn gel(&self) -> Gel<'_> {
        Gel { problem: &self.problem, draws: self.draws.clone(), is_taught: self.is_taught, seed: self.seed }
    }

    /// Source of a gel that no record of its own has taught. `input` is the name and the bytes of the file that the draws come from.
    fn without_record(problem: Problem, draws: Draws, dir: &Path, seed: u64, input: (&str, &[u8])) -> Self {
        let inputs = [(input.0.to_string(), base::sha256::sha256_hex(input.1))].into();
        Self {
            problem,
            draws,
            is_taught: false,
            kept: None,
            rivals: Vec::new(),
            warnings: Vec::new(),
            dir: dir.to_path_buf(),
            study: None,
            seed,
            provenance: Provenance::new("prediction", 1, 1, inputs),
        }
    }

    /// Header of a document about this source.
    pub fn provenance(&self, kind: &str, seed: u64) -> Provenance {
        Provenance { schema: format!("vitreo-uq/{kind}/1"), seed, ..self.provenance.clone() }
    }
}

fn of_study(target: &CreepTarget, options: &SamplerOptions, monitor: &dyn Monitor) -> Result<GelSource> {
    let revision = target.revision(options.clone(), monitor)?;
    let (study, name, problem) = (revision.study, revision.name, revision.problem);
    if problem.experiment.control == Control::Position && !problem.model.is_law_alone() {
        return Err(Error::input(
            InputPlace::file(study.dir()).at_key(&name),
            "this revision has effects on a commanded position, which do not act under a commanded force",
            format!("choose a revision without effects (`{} m0`)", Setting::Revision),
        ));
    }
    let dir = study.revision_dir(&name)?;
    let posterior = files::read(&dir.join(POSTERIOR_NAME), Content::Document, "run `vitreo-uq sample` again")?;
    let draws = draws_of_revision(&dir, &name, &problem)?;
    let rivals = rivals(&study, &name, &problem, options, monitor)?;
    Ok(GelSource {
        // Predictions with each equivalent effect show whether the choice between them matters here.
        warnings: study_warnings(&dir, &name, !rivals.is_empty())?,
        rivals,
        kept: kept_surrogate(&study, monitor),
        provenance: crate::artefacts::with_inputs(study.provenance("prediction", 1, options.seed), &problem)
            .with_input(format!("{name}/{POSTERIOR_NAME}"), &posterior)
            .with_quantities(None),
        draws,
        is_taught: true,
        dir: study.dir().to_path_buf(),
        study: Some(study),
        seed: options.seed,
        problem,
    })
}

/// Draws of the parameters of a revision's model, at most as many as a prediction takes.
///
/// # Errors
/// Errors of reading the table of draws.
pub fn draws_of_revision(dir: &Path, name: &str, problem: &Problem) -> Result<Draws> {
    let table = read_draws_csv(&dir.join("draws.csv"))?;
    let is_parameter = |k: &usize| problem.model.parameters().iter().any(|spec| spec.name == table.parameter_names[*k]);
    let columns: Vec<usize> = (0..table.parameter_names.len()).filter(is_parameter).collect();
    let n = table.parameter_names.len();
    let draws = Draws {
        source: format!("{}, revision {name}", problem.experiment.specimen_id),
        names: columns.iter().map(|k| table.parameter_names[*k].clone()).collect(),
        values: table.values.chunks_exact(n).map(|draw| columns.iter().map(|k| draw[*k]).collect()).collect(),
        other_specimens: Vec::new(),
    };
    Ok(draws.thinned(MOST_DRAWS))
}

/// Warnings of a revision about its predictions: all warnings that limit the trust in its posterior, and the missing effect of its diagnosis. `judges_equivalents` leaves out the
/// posterior's warning about equivalent effects.
pub fn study_warnings(dir: &Path, revision: &str, judges_equivalents: bool) -> Result<Vec<Warning>> {
    let posterior: Option<WithProvenance<PosteriorSummary>> = read_document(&dir.join(POSTERIOR_NAME));
    let all = posterior.map_or_else(Vec::new, |document| document.body.warnings);
    let of_record =
        |warning: Warning| Warning { text: format!("in the record that taught the law, {}", warning.text), ..warning };
    let counts = |warning: &Warning| {
        let is_judged = judges_equivalents && warning.kind == WarningKind::ModelIncomplete;
        warning.kind.level() != TrustLevel::Trusted && !is_judged
    };
    let mut warnings: Vec<Warning> = all.into_iter().filter(counts).map(of_record).collect();
    let diagnosis: Option<WithProvenance<Diagnosis>> = read_document(&dir.join(DIAGNOSIS_NAME));
    if let Some(verdict) =
        diagnosis.map(|document| document.body.verdict).filter(|verdict| verdict.kind != VerdictKind::None)
    {
        warnings.push(Warning {
            kind: WarningKind::ModelIncomplete,
            text: format!("the diagnosis of {revision} finds: {}", verdict.sentence.trim_end_matches('.')),
            advice: "extend the study with the missing effect, then predict from the new revision".into(),
        });
    }
    Ok(warnings)
}

fn of_group(dir: &Path, group: Option<&str>, out: &Path, first: &Scenario, seed: u64) -> Result<GelSource> {
    let path = dir.join(GROUPS_NAME);
    let bytes = files::read(&path, Content::Document, "give the directory that `vitreo-uq groups` has written")?;
    let refuse = |found: String, remedy: String| Err(Error::input(InputPlace::file(&path), found, remedy));
    let Ok(document) = serde_json::from_slice::<WithProvenance<GroupsSummary>>(&bytes) else {
        return refuse("this is no result of `groups`".into(), "run `vitreo-uq groups` again".into());
    };
    let summary = document.body;
    let names: Vec<&str> = summary.groups.iter().map(|group| group.name.as_str()).collect();
    let name = match (group, &names[..]) {
        (Some(name), _) if names.contains(&name) => name,
        (None, [only]) => only,
        (group, _) => {
            let found =
                group.map_or("the comparison has several groups".into(), |name| format!("there is no group `{name}`"));
            return refuse(found, format!("give `{} NAME`, with one of: {}", Setting::NewEye, names.join("; ")));
        }
    };
    let draws = new_specimens(&dir.join(NEW_SPECIMENS_NAME), name)?;
    let specification = ModelSpecification::default().with_options(Some(&summary.law), &[], &[], None, &[])?;
    let problem = problem_of_gel(name, specification, first)?;
    let mut warnings: Vec<Warning> = summary.warnings.into_iter().filter(|warning| warning.kind.is_fatal()).collect();
    if !summary.effects.is_empty() {
        warnings.push(Warning {
            kind: WarningKind::ModelIncomplete,
            text: format!(
                "the specimens' models have effects that a new specimen is predicted without: {}",
                summary.effects.join(", ")
            ),
            advice: "predict from the study of one specimen to include them".into(),
        });
    }
    warnings.push(Warning {
        kind: WarningKind::Extrapolation,
        text: "a group has no record of its own, so that forces, durations, displacements and Poisson ratios other than those of its specimens are not named".into(),
        advice: "compare them with the specimens' records, or predict from the study of one specimen".into(),
    });
    let draws = draws.thinned(MOST_DRAWS);
    files::create_folders(out, "choose another directory with `--out`")?;
    Ok(GelSource { warnings, ..GelSource::without_record(problem, draws, out, seed, (GROUPS_NAME, &bytes)) })
}

fn of_prior(name: &str, dir: &Path, first: &Scenario, seed: u64) -> Result<GelSource> {
    let specification = ModelSpecification::default().with_options(None, &[], &[], Some(name), &[])?;
    let problem = problem_of_gel(name, specification, first)?;
    let parameters = problem.model.parameters();
    let is_parameter = |name: &str| parameters.iter().any(|spec| spec.name == name);
    let names: Vec<&str> = problem.priors.names().collect();
    let columns: Vec<usize> = (0..names.len()).filter(|k| is_parameter(names[*k])).collect();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = || {
        let all = problem.priors.draw(&mut random);
        columns.iter().map(|k| all[*k]).collect()
    };
    let draws = Draws {
        source: format!("the prior {name}"),
        values: (0..MOST_DRAWS).map(|_| draw()).collect(),
        other_specimens: Vec::new(),
        names: columns.iter().map(|k| names[*k].to_string()).collect(),
    };
    files::create_folders(dir, "choose another directory with `--out`")?;
    let text = problem.priors.text().to_string();
    Ok(GelSource::without_record(problem, draws, dir, seed, ("prior", text.as_bytes())))
}

/// Model of a gel without a record, with the robot of a scenario.
fn problem_of_gel(name: &str, specification: ModelSpecification, first: &Scenario) -> Result<Problem> {
    let Scenario { robot, vitreous, .. } = *first;
    let apparatus = Apparatus::Robot { robot, vitreous };
    let mechanics = Mechanics::new(&apparatus, None).map_err(|error| first.refusal_of_robot(error))?;
    let record = Record {
        time_s: vec![0.0, 1.0],
        force_n: vec![1e-6; 2],
        position_m: vec![None; 2],
        cycle: vec![1; 2],
        ..Record::default()
    };
    let experiment = Experiment {
        specimen_id: name.into(),
        species: None,
        region: None,
        apparatus,
        record,
        calibration_cycles: vec![1],
        heldout_cycles: Vec::new(),
        noise_sd_m: None,
        fits_position_offset: false,
        source: "no record".into(),
        control: Control::Force,
        largest_strain: None,
    };
    Problem::with_mechanics(experiment, specification, &models::effects::Library::default(), Arc::new(mechanics))
}

/// Draws of a new specimen of a group: two specimens for each draw of the population.
fn new_specimens(path: &Path, group: &str) -> Result<Draws> {
    let remedy = "run `vitreo-uq groups` again: it writes the draws of new specimens";
    let bytes = files::read(path, Content::Table, remedy)?;
    let refuse = |found: String| Error::input(InputPlace::file(path), found, remedy);
    let mut reader = csv::Reader::from_reader(bytes.as_slice());
    let header = reader.headers().map_err(|error| refuse(error.to_string()))?.clone();
    if header.iter().nth(1) != Some("draw") {
        return Err(refuse("the table has no column `draw` behind the group".into()));
    }
    let names: Vec<String> = header.iter().skip(2).map(String::from).collect();
    let mut specimens = Vec::new();
    for row in reader.records() {
        let row = row.map_err(|error| refuse(error.to_string()))?;
        if row.get(0) == Some(group) {
            let draw: Option<Vec<f64>> =
                row.iter().skip(2).map(|cell| cell.parse().ok().filter(|x: &f64| x.is_finite())).collect();
            specimens.push(draw.ok_or_else(|| refuse(format!("a draw of {group} is not a list of numbers")))?);
        }
    }
    if specimens.is_empty() || specimens.len() % 2 == 1 {
        return Err(refuse(format!("there are {} new specimens of {group}, not two for each draw", specimens.len())));
    }
    let every_second = |first: usize| specimens.iter().skip(first).step_by(2).cloned().collect();
    let source = format!("a new specimen of {group}");
    Ok(Draws { source, names, values: every_second(0), other_specimens: every_second(1) })
}
