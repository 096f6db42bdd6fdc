//! HTML pages of studies and cohorts, made from the documents and figures that commands wrote.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use base::sha256::sha256_hex;
use serde::de::DeserializeOwned;

use super::artefacts::{MESH_INPUT, effect_copy};
use super::equivalents;
use base::error::{Error, InputPlace, Result};
use base::files::{
    Content, FileKind, entries, forbid_links, is_folder, kind, read_if_there, refuse_link, write_atomically,
};
use documents::groups::GroupsSummary;
use documents::posterior::PosteriorSummary;
use documents::shapes::ShapesSummary;
use figures::page::{self, Figure, LadderPage, Origin, PredictionPage, RevisionPage, StudyPage};
use laws::rheology::BaseLaw;
use models::effects::Library;
use posterior::check;
use posterior::study::{
    DIAGNOSIS_NAME, EXTENSION_NAME, FINDINGS_NAME, LADDER_NAME, LEARNED_NAME, ModelSpecification, PAGE_NAME,
    POSTERIOR_NAME, Provenance, Study, WithProvenance, effect_file,
};
use record::Experiment;

const RERUN_REMEDY: &str = "run the command that wrote this file again";

/// Writes the HTML page of a study, or of the results of `groups` or `shapes`. The page goes to `out`, or beside the results if `out` is `None`. Returns
/// the page's path.
///
/// # Errors
/// [`Error::Input`] if there is nothing to show or a document is unreadable; [`Error::File`] if the operating system refuses.
pub fn write(dir: &Path, out: Option<&Path>) -> Result<PathBuf> {
    if is_folder(dir) {
        forbid_links(dir, if Study::is_study(dir) { "a study" } else { "a comparison" });
    }
    let html = if let Some(document) = read::<GroupsSummary>(&dir.join("groups.json"))? {
        page::groups(&document.body, read_figures(dir)?, &origin(document.provenance))
    } else if let Some(document) = read::<ShapesSummary>(&dir.join("shapes.json"))? {
        page::shapes(&document.body, read_figures(dir)?, &origin(document.provenance))
    } else {
        let study = Study::open(dir)?;
        let page = page::study(content(&study)?);
        match study.read_experiment()?.0.quantities() {
            Some(quantities) => quantities.translate_page(&page),
            None => page,
        }
    };
    let place = out.map_or_else(|| dir.join(PAGE_NAME), Path::to_path_buf);
    write_atomically(&place, html.as_bytes())?;
    Ok(place)
}

/// Sections of a study's page, each with its name and its HTML text. The sections show the revisions up to `revision`.
///
/// # Errors
/// As [`write()`].
pub fn parts(dir: &Path, revision: &str) -> Result<Vec<(&'static str, String)>> {
    let study = Study::open(dir)?;
    let mut content = content(&study)?;
    let quantities = study.read_experiment()?.0.quantities();
    if let Some(place) = content.revisions.iter().position(|revision_page| revision_page.name == revision) {
        content.revisions.truncate(place + 1);
    }
    let mut parts = page::study_parts(&content);
    if let Some(quantities) = quantities {
        parts.iter_mut().for_each(|(_, part)| *part = quantities.translate_page(part));
    }
    Ok(parts)
}

fn origin(provenance: Provenance) -> Origin {
    let Provenance { version, seed, inputs_sha256, .. } = provenance;
    Origin { version, seed, inputs_sha256 }
}

/// Reads all figures of a result, sorted by name. The figures are in the folder `figures`, or beside the document if there is no such folder.
fn read_figures(dir: &Path) -> Result<Vec<Figure>> {
    let folder = if is_folder(&dir.join("figures")) { "figures/" } else { "" };
    let names = entries(&dir.join(folder), "make the directory readable")?.into_iter();
    let svg = |(name, _): (std::ffi::OsString, FileKind)| name.into_string().ok().filter(|name| name.ends_with(".svg"));
    let names: Vec<String> = names.filter_map(svg).map(|name| format!("{folder}{name}")).collect();
    names.iter().filter_map(|name| read_figure(dir, name).transpose()).collect()
}

/// Reads the documents and figures that the page of a study shows.
fn content(study: &Study) -> Result<StudyPage> {
    let (experiment, files) = study.read_experiment()?;
    let names = study.revisions()?;
    let mut content = StudyPage {
        record: check::summary(&experiment, &files),
        revisions: Vec::new(),
        ladder: None,
        predictions: Vec::new(),
        version: String::new(),
        inputs_sha256: study.inputs_sha256().clone(),
        commands: Vec::new(),
    };
    let mut posteriors_sha256 = BTreeMap::new();
    for name in &names {
        let revision = StoredRevision::read(study, name)?;
        let posterior = &revision.posterior.provenance;
        content.version.clone_from(&posterior.version);
        content.inputs_sha256.extend(posterior.inputs_sha256.clone());
        content.commands.extend(revision.commands(study, name, &experiment)?);
        posteriors_sha256.insert(format!("{name}/{POSTERIOR_NAME}"), revision.posterior_sha256.clone());
        let page = revision.into_page(name)?;
        content.revisions.push(RevisionPage { equivalents: equivalents::revision_equivalents(study, name)?, ..page });
    }
    if content.revisions.is_empty() {
        return Err(Error::input(
            InputPlace::file(study.dir()),
            "the study has no revision yet",
            "run `vitreo-uq sample` on the study first",
        ));
    }
    // A comparison that was made from other posteriors is out of date, so the page does not show it.
    let ladder = read::<documents::ladder::LadderSummary>(&study.dir().join(LADDER_NAME))?;
    let is_of_these = |(name, hash): (&String, &String)| {
        ladder.as_ref().is_some_and(|ladder| ladder.provenance.inputs_sha256.get(name) == Some(hash))
    };
    if posteriors_sha256.iter().all(is_of_these)
        && let Some(WithProvenance { provenance, body: summary }) = ladder
        && let Some(figure) = read_figure(study.dir(), "ladder.svg")?
    {
        content.commands.push(format!("vitreo-uq ladder STUDY --seed {}", provenance.seed));
        content.ladder = Some(LadderPage { summary, figure });
    }
    content.predictions = predictions(study, &posteriors_sha256)?;
    Ok(content)
}

/// Predictions and plans of a study that were made from its present posteriors.
fn predictions(study: &Study, posteriors_sha256: &BTreeMap<String, String>) -> Result<Vec<PredictionPage>> {
    let is_present = |provenance: &Provenance| {
        let inputs = &provenance.inputs_sha256;
        posteriors_sha256.iter().any(|(name, hash)| inputs.get(name) == Some(hash))
    };
    let mut list = Vec::new();
    let prediction = read::<documents::prediction::Prediction>(&study.dir().join("prediction.json"))?;
    if let Some(document) = prediction.filter(|document| is_present(&document.provenance))
        && let Some(figure) = read_figure(study.dir(), "prediction.svg")?
    {
        let of_scenario = |scenario: &documents::prediction::ScenarioPrediction| {
            let name = scenario.name.clone();
            scenario.quantities.iter().map(move |quantity| format!("{name}: {}", quantity.sentence)).collect::<Vec<_>>()
        };
        let found = document.body;
        let of_scenarios = found.scenarios.iter().flat_map(|scenario| scenario.warnings.clone());
        list.push(PredictionPage {
            sentences: found.scenarios.iter().flat_map(of_scenario).collect(),
            warnings: of_scenarios.chain(found.warnings.clone()).collect(),
            caption: "Predicted positions: median, 50 % and 90 % bands",
            figure,
        });
    }
    let plan = read::<documents::prediction::Plan>(&study.dir().join("plan.json"))?;
    if let Some(document) = plan.filter(|document| is_present(&document.provenance))
        && let Some(figure) = read_figure(study.dir(), "plan.svg")?
    {
        let found = document.body;
        let warnings = found.tube.warnings.into_iter().chain(found.warnings).collect();
        list.push(PredictionPage {
            sentences: vec![found.sentence],
            warnings,
            caption: "Planned force and expected position",
            figure,
        });
        if let Some(figure) = read_figure(study.dir(), "plan-robots.svg")? {
            list.push(PredictionPage {
                sentences: Vec::new(),
                warnings: Vec::new(),
                caption: "Compared robots: the force that each needs against its volume",
                figure,
            });
        }
    }
    let design = read::<documents::design::Design>(&study.dir().join("design.json"))?;
    if let Some(document) = design.filter(|document| is_present(&document.provenance))
        && let Some(figure) = read_figure(study.dir(), "design.svg")?
    {
        let found = document.body;
        list.push(PredictionPage {
            sentences: found.stop.into_iter().chain([found.recommended.sentence]).collect(),
            warnings: found.warnings,
            caption: "Protocol of the next record and expected position",
            figure,
        });
    }
    Ok(list)
}

/// Documents of one revision, as read from disk.
struct StoredRevision {
    dir: PathBuf,
    posterior: WithProvenance<PosteriorSummary>,
    posterior_sha256: String,
    comparison: Option<WithProvenance<documents::comparison::Comparison>>,
    diagnosis: Option<WithProvenance<documents::diagnosis::Diagnosis>>,
    learned: Option<WithProvenance<documents::learned::Learned>>,
    extension: Option<WithProvenance<documents::extension::ExtensionSummary>>,
}

impl StoredRevision {
    fn read(study: &Study, name: &str) -> Result<Self> {
        let dir = study.revision_dir(name)?;
        let path = dir.join(POSTERIOR_NAME);
        let bytes = base::files::read(&path, Content::Document, "check that the study is complete and readable")?;
        Ok(Self {
            posterior: parsed(&path, &bytes)?,
            posterior_sha256: sha256_hex(&bytes),
            comparison: read(&dir.join(FINDINGS_NAME))?,
            diagnosis: read(&dir.join(DIAGNOSIS_NAME))?,
            learned: read(&dir.join(LEARNED_NAME))?,
            extension: read(&dir.join(EXTENSION_NAME))?,
            dir,
        })
    }

    /// Command lines that reproduce the revision, its comparison, its diagnosis and its learned correction.
    fn commands(&self, study: &Study, name: &str, experiment: &Experiment) -> Result<Vec<String>> {
        let Self { posterior, comparison, diagnosis, learned, extension, .. } = self;
        let library = Library::default();
        let model = |revision: &str| -> Result<ModelSpecification> {
            ModelSpecification::read_kept(&study.revision_dir(revision)?, &library)
        };
        let mut settings = format!(" --seed {} --chains {}", posterior.provenance.seed, posterior.body.sampler.walkers);
        // A run that did not converge ended at its largest number of steps, so the command must state this number.
        if !posterior.body.converged {
            settings += &format!(" --steps {}", posterior.body.sampler.steps);
        }
        if posterior.provenance.inputs_sha256.contains_key(MESH_INPUT) {
            settings += " --mesh MESH";
        }
        let made = match extension {
            None => {
                let (before, now) = (ModelSpecification::default(), model(name)?);
                let with = option("with", &named(&now.effects, name));
                format!("vitreo-uq sample EXPERIMENT --out STUDY{with}{}{settings}", options(&before, &now, name))
            }
            Some(WithProvenance { body, .. }) => {
                let (before, now) = (model(&body.from)?, model(name)?);
                let with = option("with", &named(&body.effects, name));
                format!("vitreo-uq extend STUDY --from {}{with}{}{settings}", body.from, options(&before, &now, name))
            }
        };
        let asked = |command: &str, seed: u64| format!("vitreo-uq {command} STUDY --from {name} --seed {seed}");
        let compared = comparison.as_ref().map(|document| {
            let asked = asked("compare", document.provenance.seed);
            format!("{asked} --simulations {}", document.body.simulated_records)
        });
        let diagnosed = diagnosis.as_ref().map(|document| asked("diagnose", document.provenance.seed));
        let learned = learned.as_ref().map(|document| {
            let monotone = if document.body.monotone { " --monotone" } else { "" };
            let asked = format!("{}{monotone}", asked("learn", document.provenance.seed));
            let (fitted, scored) = (&document.body.fitted_cycles, &document.body.heldout_cycles);
            let last = fitted.last().filter(|_| *scored != experiment.for_comparison().heldout_cycles);
            last.map_or(asked.clone(), |last| format!("{asked} --first-cycles {last}"))
        });
        Ok(std::iter::once(made).chain(compared).chain(diagnosed).chain(learned).collect())
    }

    fn into_page(self, name: &str) -> Result<RevisionPage> {
        let stems = [
            "predictive",
            "comparison",
            "comparison_map",
            "comparison_bias",
            "diagnosis",
            "fingerprints",
            "discrepancy",
            "learned",
            "corner",
            "trace",
            "singular_values",
        ];
        let mut figures = BTreeMap::new();
        for stem in stems {
            if let Some(drawing) = read_figure(&self.dir, &format!("figures/{stem}.svg"))? {
                figures.insert(stem.into(), Figure { file: format!("{name}/{}", drawing.file), ..drawing });
            }
        }
        Ok(RevisionPage {
            name: name.into(),
            posterior: self.posterior.body,
            comparison: self.comparison.map(|document| document.body),
            diagnosis: self.diagnosis.map(|document| document.body),
            learned: self.learned.map(|document| document.body),
            extension: self.extension.map(|document| document.body),
            equivalents: Vec::new(),
            figures,
        })
    }
}

/// Value of the option `--with` that names the effects, separated by commas. An effect from a file is named by the path of its copy in the revision.
fn named(effects: &[String], revision: &str) -> String {
    let name = |slug: &String| match effect_file::definition(slug) {
        Some(_) => format!("{revision}/{}", effect_copy(slug)),
        None => slug.clone(),
    };
    effects.iter().map(name).collect::<Vec<_>>().join(",")
}

/// Command-line options that turn the model `before` into the model `now`. The option for effects is not included.
fn options(before: &ModelSpecification, now: &ModelSpecification, name: &str) -> String {
    let mut text = String::new();
    if now.base != before.base {
        let base = match &now.base {
            BaseLaw::Network(_) | BaseLaw::Outside(_) => format!("{name}/model.toml"),
            named => named.name().into(),
        };
        text += &option("base", &base);
    }
    if now.noise != before.noise {
        text += &option("noise", &now.noise.join(","));
    }
    if now.prior != before.prior {
        let is_file = now.prior.ends_with(".toml");
        text += &option("prior", &if is_file { format!("{name}/{}", now.prior) } else { now.prior.clone() });
    }
    let is_new = |name: &String| !before.freed.contains(name);
    now.freed.iter().filter(|name| is_new(name)).for_each(|name| text += &option("set", &format!("{name}=free")));
    for (name, value) in now.fixed.iter().filter(|(name, value)| before.fixed.get(*name) != Some(*value)) {
        text += &option("set", &format!("{name}={value}"));
    }
    text
}

fn option(name: &str, value: &str) -> String {
    if value.is_empty() { String::new() } else { format!(" --{name} {value}") }
}

/// Reads a document; `None` if it does not exist.
fn read<T: DeserializeOwned>(path: &Path) -> Result<Option<WithProvenance<T>>> {
    if kind(path).is_none() {
        return Ok(None);
    }
    parsed(path, &base::files::read(path, Content::Document, RERUN_REMEDY)?).map(Some)
}

fn parsed<T: DeserializeOwned>(path: &Path, bytes: &[u8]) -> Result<T> {
    serde_json::from_slice(bytes).map_err(|error| {
        let place = InputPlace::file(path).at_line(error.line());
        Error::input(place, format!("this document is unreadable: {error}"), RERUN_REMEDY)
    })
}

/// Reads a figure; `None` if it does not exist.
fn read_figure(dir: &Path, file: &str) -> Result<Option<Figure>> {
    let path = dir.join(file);
    refuse_link(&path)?;
    let Some(bytes) = read_if_there(&path, Content::Document) else { return Ok(None) };
    let refused = || Error::input(InputPlace::file(&path), "this is not a figure of this program", RERUN_REMEDY);
    let svg = String::from_utf8(bytes).map_err(|_| refused())?;
    // The page embeds the SVG text unchanged, so the file must contain only a drawing: no scripts, links or foreign objects.
    if !svg.starts_with("<svg ") || svg.contains("<script") || svg.contains("<foreignObject") || svg.contains("href=") {
        return Err(refused());
    }
    Ok(Some(Figure { file: file.into(), svg: Some(svg) }))
}
