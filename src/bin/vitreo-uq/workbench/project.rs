//! The records of a workbench's folder as one table, and changes of whole records: description, name, copy, deletion and its undo.

use std::io::{Cursor, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize};
use vitreo_uq::base::error::{Error, InputPlace, Result};
use vitreo_uq::base::files::{self, Content};
use vitreo_uq::documents::posterior::{ParameterSummary, PosteriorSummary};
use vitreo_uq::documents::trust::TrustLevel;
use vitreo_uq::figures::labels::parameter_label;
use vitreo_uq::posterior::study::{POSTERIOR_NAME, WithProvenance};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::choice::{read_description, replace_description, with_keys};
use super::home::{DESCRIPTION, Item, WorkbenchFolder, is_plain, share_study};

/// Number of parameters of a model that the table shows: those of the law come first.
const N_PARAMETERS: usize = 3;
/// Folder of deleted records within the workbench's private folder.
const DELETED: &str = "deleted";
const WRITABLE: &str = "make the folder writable";

/// Row of the table: a record, with the last model of its study.
#[derive(Debug, Serialize)]
pub struct RecordRow {
    name: String,
    is_experiment: bool,
    is_sheet: bool,
    species: Option<String>,
    region: Option<String>,
    /// Name of the last revision; `None` if no model is fitted yet.
    revision: Option<String>,
    #[serde(flatten)]
    model: Option<ModelCells>,
}

/// Cells of a fitted model.
#[derive(Debug, Serialize)]
struct ModelCells {
    effects: Vec<String>,
    parameters: Vec<ParameterCell>,
    trust: TrustLevel,
    rmse_heldout_um: Option<f64>,
    noise_um: Option<f64>,
}

#[derive(Debug, Serialize)]
struct ParameterCell {
    symbol: String,
    unit: String,
    q05: f64,
    median: f64,
    q95: f64,
}

/// All records, studies and results of groups. `is_current` says whether a study has the record of its experiment; models of other records are not shown.
pub fn rows(home: &WorkbenchFolder, is_current: impl Fn(&Item) -> bool) -> Vec<RecordRow> {
    let row = |mut item: Item| {
        if !item.revisions.is_empty() && !is_current(&item) {
            item.revisions.clear();
        }
        let [species, region] = home.specimen_keys(&item, ["species", "region"]);
        let revision = item.revisions.last().cloned();
        let model = revision.as_ref().and_then(|name| model_cells(&home.dir().join(&item.study).join(name)));
        RecordRow {
            is_experiment: item.experiment.is_some(),
            is_sheet: !item.figures.is_empty(),
            name: item.name,
            species,
            region,
            revision,
            model,
        }
    };
    home.items().into_iter().map(row).collect()
}

fn model_cells(dir: &Path) -> Option<ModelCells> {
    let bytes = files::read_if_there(&dir.join(POSTERIOR_NAME), Content::Document)?;
    let posterior: PosteriorSummary = serde_json::from_slice::<WithProvenance<PosteriorSummary>>(&bytes).ok()?.body;
    let cell = |parameter: &ParameterSummary| {
        let label = parameter_label(&parameter.name);
        let (q05, median, q95) = (parameter.q05, parameter.median, parameter.q95);
        ParameterCell { symbol: label.symbol, unit: label.unit, q05, median, q95 }
    };
    Some(ModelCells {
        effects: posterior.model.effects.clone(),
        parameters: posterior.parameters.iter().take(N_PARAMETERS).map(cell).collect(),
        trust: posterior.trust.level,
        rmse_heldout_um: posterior.heldout.rmse_um,
        noise_um: posterior.heldout.noise_um,
    })
}

/// Request of the page to change a record.
#[derive(Debug, Deserialize)]
#[serde(tag = "change", rename_all = "lowercase")]
pub enum RecordChange {
    /// Writes another description in place of the one that the page read.
    Describe { item: String, before: String, text: String },
    /// Gives the record another name.
    Rename { item: String, name: String },
    /// Copies the record under another name, without its models.
    Duplicate { item: String, name: String },
    /// Moves the record and its models, or only its last revision, into the private folder.
    Delete { item: String, revision: Option<String> },
    /// Brings back what was deleted under this number.
    Undo { number: u32 },
}

/// What a change led to.
#[derive(Debug, Default, PartialEq, Eq, Serialize)]
pub struct RecordChanged {
    /// Name of the record to open; `None` if there is none.
    item: Option<String>,
    /// Number by which a deletion can be undone.
    undo: Option<u32>,
}

/// Text of the description of a record.
pub fn description(home: &WorkbenchFolder, item: &Item) -> Result<String> {
    read_description(&experiment_dir(home, item)?)
}

/// Changes a record. Changes are made one after the other.
pub fn change(home: &WorkbenchFolder, change: &RecordChange) -> Result<RecordChanged> {
    static ONE: Mutex<()> = Mutex::new(());
    let _one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    let opens = |item: &str| RecordChanged { item: Some(item.to_string()), undo: None };
    match change {
        RecordChange::Describe { item, before, text } => {
            let found = home.find(item)?;
            if description(home, &found)?.lines().ne(before.lines()) {
                let words = "the description has changed since it was shown";
                return Err(Error::input(InputPlace::file(item), words, "close and open it, and change it again"));
            }
            replace_description(&experiment_dir(home, &found)?, text)?;
            Ok(opens(item))
        }
        RecordChange::Rename { item, name } => {
            let from = experiment_dir(home, &home.find(item)?)?;
            let name = free_name(home, name)?;
            files::rename(&from, &home.dir().join(&name))?;
            Ok(opens(&name))
        }
        RecordChange::Duplicate { item, name } => {
            let from = experiment_dir(home, &home.find(item)?)?;
            let name = free_name(home, name)?;
            duplicate(&from, &home.dir().join(&name), &name)?;
            Ok(opens(&name))
        }
        RecordChange::Delete { item, revision } => {
            let item = home.find(item)?;
            let paths = match revision {
                Some(name) => paths_of_revision(&item, name)?,
                // A study that belongs to another record as well stays with that one.
                None => {
                    item.experiment.iter().chain((!home.shares_study(&item)).then_some(&item.study)).cloned().collect()
                }
            };
            let undo = Some(delete(home, &item, paths)?);
            Ok(RecordChanged { item: revision.as_ref().map(|_| item.name), undo })
        }
        RecordChange::Undo { number } => undo(home, *number).map(|item| RecordChanged { item, undo: None }),
    }
}

fn experiment_dir(home: &WorkbenchFolder, item: &Item) -> Result<PathBuf> {
    let missing = || {
        let remedy = "open the experiment that the study was made from";
        Error::input(InputPlace::file(&item.study), "this is a study without its experiment", remedy)
    };
    item.experiment.as_ref().map(|inside| home.dir().join(inside)).ok_or_else(missing)
}

/// A name as the name of a folder, if none has it yet.
fn free_name(home: &WorkbenchFolder, name: &str) -> Result<String> {
    let safe = files::safe_name(name);
    if home.is_free(&safe) {
        return Ok(safe);
    }
    let found = format!("there is already something of the name `{safe}` in this folder");
    Err(Error::input(InputPlace::file(home.dir()), found, "choose another name"))
}

/// Description of the record in the folder `dir` with another identifier of the specimen.
fn with_id(dir: &Path, id: &str) -> Result<String> {
    let id = toml::Value::String(id.to_string()).to_string();
    with_keys(&read_description(dir)?, "specimen", &[("id", Some(id))]).ok_or_else(|| {
        let place = InputPlace::file(dir.join(DESCRIPTION)).at_key("specimen");
        Error::input(place, "this page cannot change the layout of its lines", "change the `id` in an editor")
    })
}

/// Gives a new record an identifier of its own, if another record has the same, so that a fit of one does not replace the models of the other.
pub fn separate(home: &WorkbenchFolder, name: &str) -> Result<()> {
    let items = home.items();
    match items.iter().find(|item| item.name == name) {
        Some(item) if share_study(&items, item) => {
            let dir = home.dir().join(name);
            files::write_atomically(&dir.join(DESCRIPTION), with_id(&dir, name)?.as_bytes())
        }
        _ => Ok(()),
    }
}

/// Copies the files of a record. Its specimen gets the new name, so that its study is another one.
fn duplicate(from: &Path, to: &Path, name: &str) -> Result<()> {
    let text = with_id(from, name)?;
    files::create_folders(to, WRITABLE)?;
    for (file, kind) in files::entries(from, WRITABLE)? {
        if kind == files::FileKind::File && !file.to_string_lossy().starts_with('.') && file != DESCRIPTION {
            files::copy(&from.join(&file), &to.join(&file))?;
        }
    }
    files::write_atomically(&to.join(DESCRIPTION), text.as_bytes())
}

/// List of the folders and files of one deletion, with paths inside the workbench's folder. Each is kept under its number in the list.
#[derive(Serialize, Deserialize)]
struct Deleted {
    name: String,
    paths: Vec<PathBuf>,
}

/// A revision with the files of the study that compare it with others. Revisions that were made from it would lose their origin, so only the last one is deleted.
fn paths_of_revision(item: &Item, name: &String) -> Result<Vec<PathBuf>> {
    if item.revisions.last() != Some(name) {
        let found = format!("{name} is not the last revision, and later ones were made from it");
        return Err(Error::input(InputPlace::file(&item.study), found, "delete the later revisions first"));
    }
    let others = ["ladder", "laws", "corner", "prediction", "plan", "design"]
        .map(|stem| ["json", "svg", "png", "pdf"].map(|ending| format!("{stem}.{ending}")));
    let tables = ["prediction.csv", "plan-tube.csv", "plan-protocol.csv", "report.html"].map(String::from);
    let others = others.into_iter().flatten().chain(tables);
    Ok(std::iter::once(name.clone()).chain(others).map(|inside| item.study.join(inside)).collect())
}

fn delete(home: &WorkbenchFolder, item: &Item, mut paths: Vec<PathBuf>) -> Result<u32> {
    paths.retain(|inside| files::kind(&home.dir().join(inside)).is_some());
    let folder = |number: &u32| home.own().join(DELETED).join(number.to_string());
    let number = (1..).find(|number| files::kind(&folder(number)).is_none()).unwrap_or(u32::MAX);
    files::create_folders(&folder(&number), WRITABLE)?;
    // The list comes first: whatever is moved can then be found again.
    let list = folder(&number).join("deleted.json");
    files::write_json_atomically(&list, &Deleted { name: item.name.clone(), paths: paths.clone() })?;
    let moves: Vec<(PathBuf, PathBuf)> = paths
        .iter()
        .enumerate()
        .map(|(place, inside)| (home.dir().join(inside), folder(&number).join(place.to_string())))
        .collect();
    for (done, (from, to)) in moves.iter().enumerate() {
        if let Err(error) = files::rename(from, to) {
            // All or nothing: what was moved goes back.
            for (from, to) in &moves[..done] {
                files::rename(to, from)?;
            }
            files::remove_all(&folder(&number))?;
            return Err(error);
        }
    }
    Ok(number)
}

fn undo(home: &WorkbenchFolder, number: u32) -> Result<Option<String>> {
    let folder = home.own().join(DELETED).join(number.to_string());
    let by_hand = "move the files of this folder back by hand";
    let bytes = files::read(&folder.join("deleted.json"), Content::Document, "the deletion was undone before")?;
    let deleted: Deleted = serde_json::from_slice(&bytes)
        .map_err(|error| Error::input(InputPlace::file(&folder), error.to_string(), by_hand))?;
    // The list may come from a stranger. Links are followed in hidden folders only, so no part of a path may be hidden.
    if !deleted.paths.iter().all(|inside| inside.components().next().is_some() && inside.components().all(is_plain)) {
        return Err(Error::input(InputPlace::file(&folder), "its list names places outside this folder", by_hand));
    }
    let places = deleted.paths.iter().enumerate();
    let moves = places.map(|(place, inside)| (folder.join(place.to_string()), home.dir().join(inside)));
    let moves: Vec<(PathBuf, PathBuf)> = moves.filter(|(from, _)| files::kind(from).is_some()).collect();
    // Files that compare revisions are made anew by later commands, and the newer ones stay.
    let is_taken = |to: &Path| files::kind(to).is_some();
    if let Some((_, to)) = moves.iter().find(|(_, to)| files::is_folder(to)) {
        let found = "there is something of this name again";
        return Err(Error::input(InputPlace::file(to), found, "rename it, and undo once more"));
    }
    for (from, to) in moves.iter().filter(|(_, to)| !is_taken(to)) {
        files::rename(from, to)?;
    }
    files::remove_all(&folder)?;
    Ok(home.items().into_iter().map(|item| item.name).find(|name| *name == deleted.name))
}

/// Largest size of an archive, in bytes.
const LARGEST_ARCHIVE: u64 = 1 << 30;

/// A ZIP archive of a record and its study, without hidden files and links.
pub fn archive(home: &WorkbenchFolder, item: &Item) -> Result<Vec<u8>> {
    let mut left = LARGEST_ARCHIVE;
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let mut folders: Vec<PathBuf> = item.experiment.iter().chain([&item.study]).cloned().collect();
    folders.dedup();
    while let Some(inside) = folders.pop() {
        let folder = home.dir().join(&inside);
        if files::kind(&folder).is_none() {
            continue;
        }
        for (name, kind) in files::entries(&folder, WRITABLE)? {
            let path = inside.join(&name);
            match kind {
                _ if name.to_string_lossy().starts_with('.') => {}
                files::FileKind::Folder => folders.push(path),
                files::FileKind::File => {
                    let by_hand = "copy the folder by hand";
                    let refused = |error| Error::at_path("read", &path, error, by_hand);
                    let mut bytes = Vec::new();
                    // One byte beyond the limit tells that it is exceeded.
                    let file = files::open_file(&home.dir().join(&path))?;
                    file.take(left + 1).read_to_end(&mut bytes).map_err(refused)?;
                    left = left.checked_sub(bytes.len() as u64).ok_or_else(|| {
                        let found = "the record and its study exceed 1 GiB";
                        Error::input(InputPlace::file(&item.study), found, by_hand)
                    })?;
                    append(&mut archive, &path, &bytes)
                        .map_err(|error| Error::at_path("archive", &path, error, "copy the folder by hand"))?;
                }
                _ => {}
            }
        }
    }
    let finished = archive.finish().map_err(std::io::Error::from);
    let refused = |error| Error::at_path("archive", &item.study, error, "copy the folder by hand");
    finished.map(Cursor::into_inner).map_err(refused)
}

/// Adds a file without times and owners.
fn append(archive: &mut ZipWriter<Cursor<Vec<u8>>>, path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    archive.start_file_from_path(path, SimpleFileOptions::default())?;
    archive.write_all(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use zip::ZipArchive;

    fn folder() -> (tempfile::TempDir, WorkbenchFolder) {
        let place = tempfile::tempdir().unwrap();
        let put = |path: &str, text: &str| {
            let path = place.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        put("eye/experiment.toml", "[specimen]\nid = \"left\"\nspecies = \"porcine\"\n");
        put("eye/trajectory.csv", "time_s,force_uN,position_um\n");
        put("vitreo-uq-out/left/inputs.sha256", "");
        put("vitreo-uq-out/left/m0/posterior.json", "{}");
        let home = WorkbenchFolder::of(place.path()).unwrap().0;
        (place, home)
    }

    fn changed(home: &WorkbenchFolder, wish: serde_json::Value) -> RecordChanged {
        change(home, &serde_json::from_value(wish).unwrap()).unwrap()
    }

    #[test]
    fn a_deleted_record_comes_back_with_its_models() {
        let (_place, home) = folder();
        let before = home.items();
        let deleted = changed(&home, serde_json::json!({ "change": "delete", "item": "eye" }));
        assert!(home.items().is_empty());
        let back = changed(&home, serde_json::json!({ "change": "undo", "number": deleted.undo }));
        assert_eq!((home.items(), back.item.as_deref()), (before, Some("eye")));
        let again = change(&home, &RecordChange::Undo { number: 1 }).unwrap_err().to_string();
        assert!(again.contains("the deletion was undone before"), "{again}");
    }

    #[test]
    fn a_record_is_renamed_and_copied_but_never_written_over() {
        let (place, home) = folder();
        changed(&home, serde_json::json!({ "change": "rename", "item": "eye", "name": "Auge 1" }));
        assert_eq!(home.items()[0].revisions, ["m0"], "the models stay with the record");
        changed(&home, serde_json::json!({ "change": "duplicate", "item": "Auge-1", "name": "copy" }));
        let copy = home.find("copy").unwrap();
        assert_eq!((copy.study.as_path(), copy.revisions.len()), (Path::new("vitreo-uq-out/copy"), 0));
        assert!(place.path().join("copy/trajectory.csv").is_file());
        for name in ["copy", "vitreo-uq-out"] {
            let refused = change(&home, &RecordChange::Rename { item: "Auge-1".into(), name: name.into() });
            assert!(refused.unwrap_err().to_string().contains("already something of the name"));
        }
        let outside = changed(&home, serde_json::json!({ "change": "rename", "item": "copy", "name": "../../x" }));
        assert_eq!(outside.item.as_deref(), Some("x"));
    }

    #[test]
    fn records_of_one_specimen_do_not_take_each_others_models() {
        let (place, home) = folder();
        std::fs::create_dir(place.path().join("eye-2")).unwrap();
        std::fs::copy(place.path().join("eye/experiment.toml"), place.path().join("eye-2/experiment.toml")).unwrap();
        let second = home.find("eye-2").unwrap();
        assert!(home.shares_study(&second));
        changed(&home, serde_json::json!({ "change": "delete", "item": "eye-2" }));
        assert_eq!(home.find("eye").unwrap().revisions, ["m0"], "the models stay with the other record");
    }

    #[test]
    fn a_list_of_a_stranger_moves_nothing_outside() {
        let (place, home) = folder();
        let deleted = place.path().join(".vitreo-uq-workbench/deleted/1");
        std::fs::create_dir_all(&deleted).unwrap();
        std::fs::write(deleted.join("0"), "key").unwrap();
        for path in [".x/key", "../key", "/tmp/key", "", "eye/../../key"] {
            let list = serde_json::json!({ "name": "eye", "paths": [path] });
            std::fs::write(deleted.join("deleted.json"), list.to_string()).unwrap();
            let refused = change(&home, &RecordChange::Undo { number: 1 }).unwrap_err().to_string();
            assert!(refused.contains("outside this folder"), "{path}: {refused}");
            assert!(deleted.join("0").is_file());
        }
    }

    #[test]
    fn newer_figures_stay_where_a_revision_comes_back() {
        let (place, home) = folder();
        let study = place.path().join("vitreo-uq-out/left");
        std::fs::write(study.join("report.html"), "old").unwrap();
        let deleted = changed(&home, serde_json::json!({ "change": "delete", "item": "eye", "revision": "m0" }));
        std::fs::write(study.join("report.html"), "new").unwrap();
        changed(&home, serde_json::json!({ "change": "undo", "number": deleted.undo }));
        assert_eq!(std::fs::read_to_string(study.join("report.html")).unwrap(), "new");
        assert!(study.join("m0").is_dir());
    }

    #[test]
    fn only_the_last_revision_is_deleted_alone() {
        let (place, home) = folder();
        let study = place.path().join("vitreo-uq-out/left");
        std::fs::create_dir(study.join("m1")).unwrap();
        std::fs::write(study.join("ladder.json"), "{}").unwrap();
        let delete = |name: &str| serde_json::json!({ "change": "delete", "item": "eye", "revision": name });
        let refused = change(&home, &serde_json::from_value(delete("m0")).unwrap()).unwrap_err().to_string();
        assert!(refused.contains("m0 is not the last revision"), "{refused}");
        let deleted = changed(&home, delete("m1"));
        assert_eq!((home.find("eye").unwrap().revisions.len(), study.join("ladder.json").exists()), (1, false));
        changed(&home, serde_json::json!({ "change": "undo", "number": deleted.undo }));
        assert_eq!((home.find("eye").unwrap().revisions.len(), study.join("ladder.json").exists()), (2, true));
    }

    #[test]
    fn an_archive_holds_the_record_and_its_study() {
        let (place, home) = folder();
        std::fs::write(place.path().join("eye/.hidden"), "secret").unwrap();
        let bytes = archive(&home, &home.find("eye").unwrap()).unwrap();
        let archive = ZipArchive::new(Cursor::new(bytes)).unwrap();
        let mut names: Vec<String> = archive.file_names().map(|name| name.unwrap().into_owned()).collect();
        names.sort();
        let study = "vitreo-uq-out/left";
        let wanted = ["eye/experiment.toml", "eye/trajectory.csv"].map(String::from).into_iter();
        let wanted = wanted.chain(["inputs.sha256", "m0/posterior.json"].map(|name| format!("{study}/{name}")));
        assert_eq!(names, wanted.collect::<Vec<String>>());
    }

    #[test]
    fn the_table_lists_every_record() {
        let (_place, home) = folder();
        let rows = serde_json::to_value(rows(&home, |_| true)).unwrap();
        assert_eq!(
            (&rows[0]["name"], &rows[0]["species"], &rows[0]["region"]),
            (&"eye".into(), &"porcine".into(), &serde_json::Value::Null)
        );
        assert_eq!(
            (&rows[0]["revision"], &rows[0]["trust"]),
            (&"m0".into(), &serde_json::Value::Null),
            "a damaged posterior has no cells"
        );
    }
}
