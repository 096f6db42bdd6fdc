//! `corner`: draws one or several posteriors into one corner plot. A posterior is a study of this program, or a CSV file of draws from any program.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use vitreo_uq::posterior::study::ModelSpecification;

use vitreo_uq::base::error::{Error, InputPlace, Result, Setting};
use vitreo_uq::base::files;
use vitreo_uq::figures::corner::{CornerOptions, ParameterColumn, Posterior, PriorCurve, corner};
use vitreo_uq::figures::density::{Support, estimate_support, sorted};
use vitreo_uq::figures::draws::read_draws_csv;
use vitreo_uq::figures::labels::{ParameterLabel, parameter_label};
use vitreo_uq::figures::palette::series;
use vitreo_uq::figures::svg::{FIGURE_FORMATS, Svg, write_figure};
use vitreo_uq::jobs::artefacts;
use vitreo_uq::models::effects::Library;
use vitreo_uq::posterior::monitor::Monitor;
use vitreo_uq::posterior::prior::{Prior, PriorSet};
use vitreo_uq::posterior::replica;
use vitreo_uq::posterior::study::{POSTERIOR_NAME, Study};

use crate::corner_data::{FittedData, describe_data_differences};
use crate::options::{self, CornerArguments};
use crate::output;
use crate::terminal::Terminal;

const NOTHING_REMEDY: &str =
    "give a study, a revision (study/m0), or a CSV file of draws; `vitreo-uq sample` creates a study";
const PATH_REMEDY: &str = "give a study, a revision (study/m0), or a CSV file of draws with one column per parameter";

/// One parameter of a posterior, with its draws.
struct Column {
    name: String,
    label: ParameterLabel,
    draws: Vec<f64>,
    support: Support,
    prior: Option<Prior>,
    /// Prior density: parameter values and densities over the range of all posteriors' draws. Empty if the prior is unknown.
    curve: (Vec<f64>, Vec<f64>),
}

/// A posterior with its label in the legend.
struct LoadedPosterior {
    label: String,
    columns: Vec<Column>,
    /// Data that the posterior was fitted to; `None` if they are unknown.
    data: Option<FittedData>,
}

pub fn run(arguments: &CornerArguments) -> Result<ExitCode> {
    let references = references(&arguments.reference)?;
    options::use_threads(0)?;
    output::check(arguments.json.as_deref())?;
    let paths = match arguments.paths.as_slice() {
        [] => vec![Study::default_dir(&replica::embedded()?.0.specimen_id)],
        paths => paths.to_vec(),
    };
    let mut loaded = load_all(&paths, &arguments.parameters)?;
    make_labels_unique(&mut loaded, &paths);
    refuse_unknown("--reference", references.keys(), &loaded)?;
    let names: Vec<&str> = loaded.iter().map(|posterior| posterior.label.as_str()).collect();
    let data: Vec<Option<FittedData>> = loaded.iter().map(|posterior| posterior.data.clone()).collect();
    let (legend, note) = match describe_data_differences(&names, &data) {
        Some((added, note)) => {
            (names.iter().zip(added).map(|(name, added)| format!("{name} ({added})")).collect(), Some(note))
        }
        None => (names.iter().map(ToString::to_string).collect::<Vec<String>>(), None),
    };
    if let Some(note) = &note {
        Terminal::new(arguments.quiet).warn(note);
    }
    let figure = draw(&loaded, &legend, &references, "")?;
    let (dir, stem) = figure_path(&arguments.out)?;
    std::fs::create_dir_all(&dir)
        .map_err(|source| Error::at_path("create", &dir, source, "choose a writable place with `--out`"))?;
    write_figure(&dir, &stem, &figure)?;
    let files = FIGURE_FORMATS.map(|extension| dir.join(format!("{stem}.{extension}")).display().to_string());
    let document = serde_json::json!({
        "schema": "vitreo-uq/corner/1", "version": env!("CARGO_PKG_VERSION"), "posteriors": names, "data": data, "note": note, "files": files
    });
    let words = match arguments.quiet {
        true => String::new(),
        false => format!("Corner plot of {}:\n  {}\n", names.join(", "), files.join("\n  ")),
    };
    output::show(arguments.json.as_deref(), &document, &words)?;
    Ok(ExitCode::SUCCESS)
}

/// Corner plot of a study's revisions, with the chosen parameters; with all if none is chosen. `name` names the study in the title.
pub fn of_revisions(study: &Path, revisions: &[String], chosen: &[String], name: &str) -> Result<Svg> {
    let paths: Vec<PathBuf> = revisions.iter().map(|revision| study.join(revision)).collect();
    draw(&load_all(&paths, chosen)?, revisions, &BTreeMap::new(), name)
}

fn draw(loaded: &[LoadedPosterior], legend: &[String], references: &BTreeMap<String, f64>, title: &str) -> Result<Svg> {
    let posteriors: Vec<Posterior> = loaded
        .iter()
        .zip(legend)
        .enumerate()
        .map(|(i, (posterior, label))| Posterior {
            label,
            colour: series(i),
            parameters: posterior.columns.iter().map(|column| parameter(column, references)).collect(),
        })
        .collect();
    corner(&posteriors, &CornerOptions { title, ..CornerOptions::default() })
}

/// Loads posteriors with the chosen parameters, and with their prior densities. No choice means all parameters.
fn load_all(paths: &[PathBuf], chosen: &[String]) -> Result<Vec<LoadedPosterior>> {
    let mut loaded = paths.iter().map(|path| load(path)).collect::<Result<Vec<_>>>()?;
    refuse_unknown("--parameters", chosen.iter(), &loaded)?;
    if !chosen.is_empty() {
        loaded.iter_mut().for_each(|posterior| posterior.columns.retain(|column| chosen.contains(&column.name)));
    }
    draw_priors(&mut loaded);
    Ok(loaded)
}

/// Parses reference values of the form `NAME=VALUE`.
fn references(texts: &[String]) -> Result<BTreeMap<String, f64>> {
    let refuse =
        |found: String, remedy: &str| Err(Error::input(InputPlace::default().at_key("--reference"), found, remedy));
    let mut references = BTreeMap::new();
    for text in texts {
        let remedy = "write NAME=VALUE with a finite number, as in `--reference young_modulus_pa=3.527`";
        let Some((name, value)) = text.split_once('=') else { return refuse(format!("`{text}` has no `=`"), remedy) };
        match value.trim().parse::<f64>() {
            Ok(number) if number.is_finite() => {
                if references.insert(name.trim().to_string(), number).is_some() {
                    return refuse(format!("{} is given more than once", name.trim()), "give each parameter once");
                }
            }
            _ => return refuse(format!("`{value}` is not a finite number"), remedy),
        }
    }
    Ok(references)
}

/// Refuses a name in an option that is not a parameter, because it is probably a typing error.
fn refuse_unknown<'a>(
    option: &str,
    mut names: impl Iterator<Item = &'a String>,
    loaded: &[LoadedPosterior],
) -> Result<()> {
    let mut known: Vec<&str> =
        loaded.iter().flat_map(|p| p.columns.iter().map(|column| column.name.as_str())).collect();
    known.sort_unstable();
    known.dedup();
    match names.find(|name| !known.contains(&name.as_str())) {
        Some(unknown) => Err(Error::input(
            InputPlace::default().at_key(option),
            format!("no posterior has the parameter `{unknown}`"),
            format!("use one of {}", known.join(", ")),
        )),
        None => Ok(()),
    }
}

fn load(path: &Path) -> Result<LoadedPosterior> {
    if Study::is_study(path) {
        let revision = Study::open(path)?.revisions()?.pop().ok_or_else(|| {
            Error::input(InputPlace::file(path), "this study has no posterior", "run `vitreo-uq sample` on it first")
        })?;
        return load_revision(&path.join(revision));
    }
    if files::is_folder(path) {
        return load_revision(path);
    }
    let label = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    // The file `draws.csv` in a revision's directory stands for the whole revision, with its priors and data.
    match path.parent() {
        Some(dir) if dir.join(POSTERIOR_NAME).is_file() && path.file_name().is_some_and(|n| n == "draws.csv") => {
            load_revision(dir)
        }
        _ => load_csv(path, label, None),
    }
}

fn load_revision(dir: &Path) -> Result<LoadedPosterior> {
    files::forbid_links(dir, "a revision");
    let draws = dir.join("draws.csv");
    files::refuse_link(&draws)?;
    if !files::is_file(&draws) {
        return Err(Error::input(InputPlace::file(dir), "this directory has no draws", PATH_REMEDY));
    }
    let name = |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned());
    let full = dir.canonicalize().unwrap_or_else(|_| dir.to_path_buf());
    let study = full.parent().and_then(name);
    let label = [study, name(&full)].into_iter().flatten().collect::<Vec<_>>().join(" ");
    // The priors give the hard limits of parameters. If the file of priors is missing, the limits are estimated from the draws.
    let priors =
        ModelSpecification::of_revision(dir, &Library::default()).and_then(|model| PriorSet::read(&model.prior)).ok();
    Ok(LoadedPosterior { data: FittedData::of_revision(dir), ..load_csv(&draws, label, priors.as_ref())? })
}

fn load_csv(path: &Path, label: String, priors: Option<&PriorSet>) -> Result<LoadedPosterior> {
    if files::kind(path).is_none() {
        return Err(Error::input(InputPlace::file(path), "this file or directory does not exist", NOTHING_REMEDY));
    }
    let table = read_draws_csv(path)?;
    let columns = table.parameter_names.iter().enumerate().map(|(i, name)| {
        let draws = table.column(i);
        let prior = priors.and_then(|priors| priors.get(name));
        let support = match prior {
            Some(prior) => {
                let (lower, upper) = prior.distribution.support();
                Support { lower, upper }
            }
            None => estimate_support(&sorted(&draws)),
        };
        let (prior, curve) = (prior.cloned(), (Vec::new(), Vec::new()));
        Column { name: name.clone(), label: parameter_label(name), draws, support, prior, curve }
    });
    Ok(LoadedPosterior { label, columns: columns.collect(), data: None })
}

/// Computes the density of each prior over the range of the draws of all posteriors.
fn draw_priors(loaded: &mut [LoadedPosterior]) {
    let mut ranges: BTreeMap<String, [f64; 2]> = BTreeMap::new();
    for column in loaded.iter().flat_map(|posterior| &posterior.columns) {
        let range = ranges.entry(column.name.clone()).or_insert([f64::INFINITY, f64::NEG_INFINITY]);
        *range = column.draws.iter().fold(*range, |[lower, upper], x| [lower.min(*x), upper.max(*x)]);
    }
    for column in loaded.iter_mut().flat_map(|posterior| &mut posterior.columns) {
        if let (Some(prior), Some(range)) = (&column.prior, ranges.get(&column.name)) {
            column.curve = artefacts::prior_curve(prior, range);
        }
    }
}

/// Adds the paths to the labels of posteriors that have equal names.
fn make_labels_unique(loaded: &mut [LoadedPosterior], paths: &[PathBuf]) {
    let labels: Vec<String> = loaded.iter().map(|posterior| posterior.label.clone()).collect();
    for (i, posterior) in loaded.iter_mut().enumerate() {
        if labels.iter().filter(|label| **label == labels[i]).count() > 1 {
            posterior.label = paths[i].display().to_string();
        }
    }
}

fn parameter<'a>(column: &'a Column, references: &BTreeMap<String, f64>) -> ParameterColumn<'a> {
    ParameterColumn {
        name: &column.name,
        symbol: &column.label.symbol,
        unit: &column.label.unit,
        draws: &column.draws,
        support: column.support,
        prior: column.prior.as_ref().map(|_| PriorCurve { x: &column.curve.0, density: &column.curve.1 }),
        reference: references.get(&column.name).copied(),
    }
}

/// Directory of the figure's files, and their name without the extension of a figure.
fn figure_path(out: &Path) -> Result<(PathBuf, String)> {
    let is_figure = out.extension().is_some_and(|extension| FIGURE_FORMATS.iter().any(|format| extension == *format));
    let name = if is_figure { out.file_stem() } else { out.file_name() };
    let Some(stem) = name.filter(|_| !out.is_dir()) else {
        return Err(Error::input(
            InputPlace::setting(Setting::Out),
            format!("{} is a directory", out.display()),
            "give a file name without extension, such as `--out figures/corner`",
        ));
    };
    let dir = out.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Ok((dir.to_path_buf(), stem.to_string_lossy().into_owned()))
}
