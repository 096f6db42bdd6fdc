//! Tasks that build reduced models. Each reduced model that the experiments need is built once. `gather` puts the models into the cache, from which
//! commands read them.
//!
//! As in the cache, a model's name is the hash of all its inputs. If these inputs depend only on the apparatus, experiments with equal apparatus share one
//! task.

use std::collections::BTreeMap;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::list::{Task, TaskInput, not_json};
use super::sample::{Sampling, has_changed, read as read_measurement};
use base::error::{Error, InputPlace, Result, Setting};
use base::sha256::sha256_hex;
use cohorts::apparatus;
use cohorts::cohort::Measurement;
use models::effects::{Library, Stage};
use posterior::cache;
use posterior::learnt_displacement::{fit_base_law, surface};
use posterior::mechanics::{FiniteElements, Mechanics};
use posterior::monitor::{Counter, Monitor, SilentMonitor, refuse_if_stopped};
use posterior::prepared::{
    effect_requirements, field_built_from, field_model, field_models, surrogate, surrogate_built_from, with_fields,
};
use posterior::problem::Problem;
use record::Apparatus;

/// Kind of reduced model that a task builds.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum ReducedModelKind {
    /// Compliance of an apparatus (displacement per force), for cohorts.
    Compliance,
    /// Surrogate for an experiment's own model, as `sample` uses it.
    Surrogate,
    /// Surrogate for `diagnose`. It covers the Poisson's ratios of every effect.
    WidestSurrogate,
    /// Reduced displacement field of the effect with this slug.
    Field(String),
    /// Reduced model of large displacements, which is learned separately for each record.
    LargeDisplacement,
}

/// Arguments of a task that builds a reduced model, as the list of tasks stores them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct ModelTask {
    piece: ReducedModelKind,
    /// Name of the reduced model's file in a cache. For a model of large displacements, `content` is the SHA-256 of the experiment and its model instead,
    /// because the file's name depends on the fitted law, which is not yet known.
    content: String,
    sampling: Sampling,
}

/// Makes the tasks of all reduced models that the experiments need for `sample` and, with `every_effect`, also for `diagnose`. Also returns the number of
/// experiments that need no reduced model.
///
/// # Errors
/// [`Error::Input`] if an experiment and its model are incompatible; otherwise the errors of meshing.
pub fn work(
    measurements: &[Measurement],
    sampling: &Sampling,
    every_effect: bool,
    monitor: &dyn Monitor,
) -> Result<(Vec<TaskInput>, usize)> {
    // The names of models contain hashes of meshes, so each apparatus must be meshed once. Its mesh is dropped when its experiments are done, to save
    // memory.
    let mut alike: BTreeMap<String, Vec<&Measurement>> = BTreeMap::new();
    for measurement in measurements {
        alike.entry(format!("{:?}", measurement.experiment.apparatus)).or_default().push(measurement);
    }
    monitor.stage(&format!("meshing {} kinds of apparatus", alike.len()));
    let counter = Counter::new(monitor, alike.len());
    let of_apparatus = |group: &Vec<&Measurement>| {
        refuse_if_stopped(monitor, "nothing was written")?;
        let mut mechanics = None;
        let named = |measurement: &&Measurement| {
            let found = required_models(measurement, every_effect, &mut mechanics)
                .map_err(|error| measurement.with_name(error))?;
            Ok(found
                .into_iter()
                .map(|(piece, content)| (measurement.path.display().to_string(), piece, content))
                .collect())
        };
        let found = group.iter().map(named).collect::<Result<Vec<Vec<_>>>>()?;
        counter.add_one();
        Ok(found)
    };
    let found = alike.values().collect::<Vec<_>>().into_par_iter().map(of_apparatus).collect::<Result<Vec<_>>>()?;
    let n_without = found.iter().flatten().filter(|entries| entries.is_empty()).count();
    let mut known = std::collections::BTreeSet::new();
    let mut work: Vec<(ReducedModelKind, TaskInput)> = Vec::new();
    for (path, piece, content) in found.into_iter().flatten().flatten() {
        if known.insert(content.clone()) {
            let arguments = json!(ModelTask { piece: piece.clone(), content, sampling: sampling.clone() });
            work.push((piece, TaskInput { arguments, paths: vec![path] }));
        }
    }
    if work.is_empty() {
        return Err(Error::input(
            InputPlace::default(),
            "none of these experiments needs a reduced model, because instruments and indenters have closed forms",
            "give experiments with a [robot]",
        ));
    }
    // Displacement fields come first, because they take longest.
    work.sort_by_key(|(piece, _)| !matches!(piece, ReducedModelKind::Field(_)));
    Ok((work.into_iter().map(|(_, work)| work).collect(), n_without))
}

/// Lists the models that one experiment needs, each with its content hash. `mechanics` holds the finite elements of the experiment's apparatus. They are
/// computed and stored here if `mechanics` is `None`.
fn required_models(
    measurement: &Measurement,
    every_effect: bool,
    mechanics: &mut Option<std::sync::Arc<Mechanics>>,
) -> Result<Vec<(ReducedModelKind, String)>> {
    if !matches!(measurement.experiment.apparatus, Apparatus::Robot { .. }) {
        return Ok(Vec::new());
    }
    let (experiment, model) = (measurement.experiment.clone(), measurement.specification.clone());
    let problem = match mechanics {
        Some(mechanics) => Problem::with_mechanics(experiment, model, &Library::default(), mechanics.clone())?,
        None => Problem::new(experiment, model, None, &SilentMonitor)?,
    };
    *mechanics = Some(problem.mechanics.clone());
    let Some(fe) = problem.finite_elements() else { return Ok(Vec::new()) };
    let mut found = vec![(ReducedModelKind::Surrogate, surrogate_built_from(&problem, fe)?.file_name())];
    found.extend(apparatus::cache_file_name(measurement).map(|name| (ReducedModelKind::Compliance, name)));
    let mut effects = problem.model.effects().to_vec();
    if every_effect {
        let library = Library::default();
        let (widest, all) = effect_requirements(&problem, fe, &library, library.effects())?;
        if let Some(widest) = widest {
            found.push((ReducedModelKind::WidestSurrogate, surrogate_built_from(&widest, fe)?.file_name()));
        }
        effects = all;
    }
    for effect in effects {
        match effect.field() {
            Some(field) if !field.is_learnt_for_record() => {
                let slug = effect.slug();
                found.push((ReducedModelKind::Field(slug.into()), field_built_from(fe, slug).file_name()));
            }
            Some(_) if problem.model.effects().iter().any(|entry| entry.slug() == effect.slug()) => {
                found.push((ReducedModelKind::LargeDisplacement, content(measurement)));
            }
            _ => {}
        }
    }
    Ok(found)
}

/// SHA-256 of an experiment and its model.
fn content(measurement: &Measurement) -> String {
    sha256_hex(format!("{}\n{:?}", measurement.inputs_sha256, measurement.specification).as_bytes())
}

/// Builds a task's reduced model, or reads it from the cache. Returns the body of the result file: one line with the model's file name in a cache, then
/// the content of this file.
///
/// # Errors
/// [`Error::Input`] if the experiment has changed since the list was made; otherwise the errors of the finite elements.
pub fn run(task: &Task, monitor: &dyn Monitor) -> Result<Vec<u8>> {
    let ModelTask { piece, content: wanted, sampling } = task.arguments_as()?;
    let measurement = read_measurement(task.path()?, &sampling, &SilentMonitor)?;
    if piece == ReducedModelKind::LargeDisplacement && content(&measurement) != wanted {
        return Err(has_changed(&measurement));
    }
    let (name, bytes) = built(&measurement, &piece, monitor)?;
    if piece != ReducedModelKind::LargeDisplacement && name != wanted {
        return Err(has_changed(&measurement));
    }
    let mut body = serde_json::to_vec(&json!({ "file": name })).map_err(|error| not_json(&error))?;
    body.push(b'\n');
    body.extend_from_slice(&bytes);
    Ok(body)
}

/// Builds a model. Returns its file name relative to a cache's directory, and the file's bytes.
fn built(measurement: &Measurement, piece: &ReducedModelKind, monitor: &dyn Monitor) -> Result<(String, Vec<u8>)> {
    if *piece == ReducedModelKind::Compliance {
        return apparatus::cache_file(measurement, monitor);
    }
    let problem = Problem::new(measurement.experiment.clone(), measurement.specification.clone(), None, monitor)?;
    let fe = problem.finite_elements().ok_or_else(|| no_longer("this experiment has no finite elements"))?;
    let library = Library::default();
    match piece {
        ReducedModelKind::Compliance | ReducedModelKind::Surrogate => {
            let (built_from, found) = surrogate(&problem, fe, None, monitor)?;
            cache::file_of(&built_from, &found)
        }
        ReducedModelKind::WidestSurrogate => {
            let (widest, _) = effect_requirements(&problem, fe, &library, library.effects())?;
            let (built_from, found) = surrogate(widest.as_ref().unwrap_or(&problem), fe, None, monitor)?;
            cache::file_of(&built_from, &found)
        }
        ReducedModelKind::Field(slug) => {
            let entry = problem.model.effects().iter().copied().find(|effect| effect.slug() == slug);
            let effect = entry.or_else(|| library.get(slug)).ok_or_else(|| no_longer("there is no such effect"))?;
            cache::file_of(&field_built_from(fe, slug), &field_model(fe, effect, monitor)?)
        }
        ReducedModelKind::LargeDisplacement => large(&problem, fe, monitor),
    }
}

/// Learns the reduced model of large displacements, as `sample` does. Returns the file's name and bytes.
fn large(problem: &Problem, fe: &FiniteElements, monitor: &dyn Monitor) -> Result<(String, Vec<u8>)> {
    let (_, surrogate) = surrogate(problem, fe, None, monitor)?;
    let fields = field_models(fe, None, problem.model.effects(), monitor)?;
    let compliance = with_fields(surrogate.compliance(fe.poisson_ratio)?, &fields);
    let law = fit_base_law(problem, &compliance)?;
    let with_load = problem.model.effects().iter().any(|effect| effect.stage() == Stage::Load);
    let (built_from, found) = surface(problem, &law, with_load, monitor)?;
    cache::file_of(&built_from, &found)
}

fn no_longer(found: &str) -> Error {
    Error::input(
        InputPlace::default(),
        found,
        format!("make the list again with the same command and `{}`", Setting::Force),
    )
}

#[derive(Deserialize)]
struct Manifest {
    file: String,
}

/// Puts the reduced model in a result's body into the cache. Returns `true` if the cache did not have the model before; `None` if the result names no
/// cache file.
///
/// # Errors
/// As [`cache::adopt`].
pub fn adopt(body: &[u8]) -> Result<Option<bool>> {
    let Some((name, bytes)) = file_of(body) else { return Ok(None) };
    cache::adopt(&name, bytes).map(Some)
}

fn file_of(body: &[u8]) -> Option<(String, &[u8])> {
    let end = body.iter().position(|byte| *byte == b'\n')?;
    let (Manifest { file }, bytes) = (serde_json::from_slice(&body[..end]).ok()?, &body[end + 1..]);
    cache::is_entry(&file, bytes).then_some((file, bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A result is accepted only if it contains a reduced model of this program under the model's own name. Nothing else is written into the cache.
    #[test]
    fn no_other_file_is_written() {
        let entry = |diameter_mm: f64| {
            cache::file_of(&cache::ModelInputs::new("test").with("diameter_mm", diameter_mm), &json!({})).unwrap()
        };
        let (name, bytes) = entry(0.55);
        let body = |name: &str| [&serde_json::to_vec(&json!({ "file": name })).unwrap(), &b"\n"[..], &bytes].concat();
        assert_eq!(file_of(&body(&name)), Some((name.clone(), &bytes[..])));
        let (of_another, _) = entry(1.1);
        for other in ["../x.json", "/etc/x.json", &name[1..], &format!("{name}/x"), "", &of_another] {
            assert_eq!(file_of(&body(other)), None, "{other}");
        }
        assert_eq!(file_of(b"{}"), None);
    }
}
