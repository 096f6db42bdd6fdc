//! Cache on disk for reduced models that take long to build. The hash of a model's inputs is its file name.
//!
//! Each file also contains the inputs of its model ([`ModelInputs`]). A reader compares them with the requested inputs, so that it never uses the file of another
//! model.
//!
//! Models of displacement fields depend only on the apparatus, so one model serves every experiment with this apparatus. The surrogate of the law also depends on the
//! record's times and forces. All commands on this record share it. A model that cannot be read is built again, and a failure to write a model is ignored.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fmt::Debug;
use std::path::{Path, PathBuf};

use base::sha256::{Hash, hex, sha256_hex};
use etcetera::base_strategy::{BaseStrategy, choose_native_strategy};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::monitor::Monitor;
use crate::study::Kept;
use base::error::{Error, InputPlace, Result};
use base::files::{Content, file_error, folder_of, read_if_there, to_json, write_atomically};
use elements::mesh::Mesh;
use record::Force;

/// Environment variable with the directory of the cache, which replaces the user's cache directory. An empty value switches the cache off.
const PLACE: &str = "VITREO_UQ_CACHE";
/// Folder in the cache for models of this program's version. Its name is a hash of the source code.
const FOLDER: &str = models::SOURCE_HASH;

/// Inputs of a cached model, as written in its file. The length and SHA-256 of a long list represent the list.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModelInputs {
    model: String,
    program: String,
    code_sha256: String,
    input: BTreeMap<String, String>,
}

impl ModelInputs {
    /// Creates a description without inputs. `model` names the kind of model.
    pub fn new(model: &str) -> Self {
        Self {
            model: model.into(),
            program: env!("CARGO_PKG_VERSION").into(),
            code_sha256: models::SOURCE_HASH.into(),
            input: BTreeMap::new(),
        }
    }

    /// Adds one input as text. Floating-point values have enough digits to be read back exactly.
    #[must_use]
    pub fn with(mut self, name: &str, value: impl Debug) -> Self {
        self.input.insert(name.into(), format!("{value:?}"));
        self
    }

    /// Adds a list of floating-point values by its length and hash.
    #[must_use]
    pub fn with_numbers<'a>(self, name: &str, numbers: impl IntoIterator<Item = &'a f64>) -> Self {
        self.with_bytes(name, numbers.into_iter().map(|x| x.to_le_bytes()))
    }

    /// Adds the times (s) and commanded forces (N) of a record.
    #[must_use]
    pub fn with_record(self, time_s: &[f64], force: Force<'_>) -> Self {
        self.with_numbers("record time_s", time_s)
            .with_numbers("record force_n", force.at_rows_n)
            .with("record force between rows", force.rule)
    }

    /// Adds the nodes, elements and surfaces of a mesh.
    #[must_use]
    pub fn with_mesh(self, mesh: &Mesh) -> Self {
        let Mesh { connectivity, robot_nodes, outer_nodes, symmetry_y_nodes, symmetry_z_nodes, .. } = mesh;
        let places = |nodes: &[u32]| nodes.iter().map(|node| node.to_le_bytes()).collect::<Vec<_>>();
        self.with("mesh element", mesh.element_kind)
            .with_numbers("mesh node_coordinates_m", mesh.node_coordinates_m.iter().flatten())
            .with_bytes("mesh connectivity", places(connectivity))
            .with_bytes("mesh robot_nodes", places(robot_nodes))
            .with_bytes("mesh outer_nodes", places(outer_nodes))
            .with_bytes("mesh symmetry_y_nodes", places(symmetry_y_nodes))
            .with_bytes("mesh symmetry_z_nodes", places(symmetry_z_nodes))
    }

    fn with_bytes<const N: usize>(mut self, name: &str, values: impl IntoIterator<Item = [u8; N]>) -> Self {
        let (mut hash, mut count) = (Hash::new(), 0_usize);
        for bytes in values {
            hash.update(bytes);
            count += 1;
        }
        let hash = hex(&hash.finalize());
        self.input.insert(name.into(), format!("{count} values, SHA-256 {hash}"));
        self
    }

    /// SHA-256 of all inputs, which identifies the model.
    pub fn sha256(&self) -> String {
        sha256_hex(format!("{self:?}").as_bytes())
    }

    /// Path of the model's file, relative to the cache directory.
    pub fn file_name(&self) -> String {
        format!("{FOLDER}/{}.json", self.sha256())
    }

    fn path(&self) -> Option<PathBuf> {
        Some(cache_directory()?.join(self.file_name()))
    }
}

/// Content of a cache file: a model with its inputs.
#[derive(Serialize, Deserialize)]
struct Entry<T> {
    built_from: ModelInputs,
    #[serde(flatten)]
    model: T,
}

/// Reads the cached model with these inputs; `None` if there is none. A changed file, or a file with other inputs, is not used and causes a warning to `monitor`.
pub fn read<T: Serialize + DeserializeOwned>(built_from: &ModelInputs, monitor: &dyn Monitor) -> Option<T> {
    let path = built_from.path()?;
    let bytes = read_if_there(&path, Content::Document)?;
    let entry = serde_json::from_slice::<Kept<Entry<T>>>(&bytes).ok().and_then(Kept::unchanged);
    let fault = match entry {
        Some(entry) if entry.built_from == *built_from => return Some(entry.model),
        Some(entry) => entry.built_from.difference(built_from),
        None => "it is damaged or was changed".into(),
    };
    monitor.warn(&format!(
        "{} is not used: {fault}; the model is built again ({})",
        path.display(),
        cache_instructions()
    ));
    None
}

impl ModelInputs {
    /// Describes a difference between these inputs and the inputs `asked_for`, for a warning.
    fn difference(&self, asked_for: &Self) -> String {
        let parts = |model_inputs: &Self| {
            let fixed = [
                ("model", &model_inputs.model),
                ("program", &model_inputs.program),
                ("code", &model_inputs.code_sha256),
            ];
            let fixed = fixed.map(|(name, value)| (name.to_string(), value.clone()));
            fixed.into_iter().chain(model_inputs.input.clone()).collect::<BTreeMap<_, _>>()
        };
        let (found, expected) = (parts(self), parts(asked_for));
        let names = found.keys().chain(expected.keys()).filter(|name| found.get(*name) != expected.get(*name));
        let value =
            |parts: &BTreeMap<String, String>, name: &str| parts.get(name).cloned().unwrap_or_else(|| "nothing".into());
        // A readable difference is preferred to a difference of hashes, which represent long lists.
        let readable = |name: &&String| (value(&found, name).contains("SHA-256"), (*name).clone());
        let words = names.min_by_key(readable).map_or_else(String::new, |name| {
            format!(" ({name} is {}, but {} is required)", value(&found, name), value(&expected, name))
        });
        format!("it holds a model of other inputs{words}")
    }
}

/// Sentence that tells the user where the cache is and how to delete its models.
pub fn cache_instructions() -> String {
    match cache_directory() {
        Some(directory) => format!("models are kept in {}, and deleting it rebuilds all of them", directory.display()),
        None => "no models are kept between commands".into(),
    }
}

/// Writes a model to the cache. A failure is ignored.
pub fn write(built_from: &ModelInputs, model: &impl Serialize) {
    let Some(path) = built_from.path() else { return };
    let is_there = path.parent().is_some_and(|folder| std::fs::create_dir_all(folder).is_ok());
    if is_there && let Ok((_, bytes)) = file_of(built_from, model) {
        // Writing fails without space or permission; the model is then built again the next time.
        let _ = write_atomically(&path, &bytes);
    }
}

/// Path of a model's cache file, relative to the cache directory, and the bytes of the file.
///
/// # Errors
/// [`base::Error::Numerical`] if the model cannot be written as JSON.
pub fn file_of(built_from: &ModelInputs, model: &impl Serialize) -> Result<(String, Vec<u8>)> {
    let name = built_from.file_name();
    let bytes = to_json(Path::new(&name), &Kept::new(Entry { built_from: built_from.clone(), model }))?;
    Ok((name, bytes))
}

/// Adds a file from another computer's cache to the local cache, completely or not at all. Returns true if the file was added, and false if an equal file was already
/// there.
///
/// # Errors
/// [`base::Error::Input`] if there is no cache; [`base::Error::File`] if the file system refuses.
pub fn adopt(name: &str, bytes: &[u8]) -> Result<bool> {
    let Some(directory) = cache_directory() else {
        return Err(Error::input(
            InputPlace::default().at_key(PLACE),
            "no models are kept here: the variable is empty, or the system has no cache directory",
            format!("name a directory for the models: {PLACE}=DIR"),
        ));
    };
    let path = directory.join(name);
    if read_if_there(&path, Content::Document).is_some_and(|there| there == bytes) {
        return Ok(false);
    }
    let folder = folder_of(&path);
    std::fs::create_dir_all(folder).map_err(file_error("create", folder))?;
    write_atomically(&path, bytes)?;
    Ok(true)
}

/// Returns true if [`file_of`] can have produced this name and these bytes. Only such files may be added to the cache.
pub fn is_entry(name: &str, bytes: &[u8]) -> bool {
    #[derive(Deserialize)]
    struct Named {
        built_from: ModelInputs,
    }
    serde_json::from_slice::<Named>(bytes).is_ok_and(|named| named.built_from.file_name() == name)
}

/// Directory of the cache, for data that commands share and that belong to no study. It is the value of `VITREO_UQ_CACHE`, or a directory among the system's user
/// caches. `None` if the variable is empty or the system has no user caches.
pub fn cache_directory() -> Option<PathBuf> {
    directory(std::env::var_os(PLACE))
}

fn directory(asked_for: Option<OsString>) -> Option<PathBuf> {
    match asked_for {
        Some(place) => Some(PathBuf::from(place)).filter(|place| !place.as_os_str().is_empty()),
        None => Some(choose_native_strategy().ok()?.cache_dir().join("vitreo-uq")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::monitor::{SilentMonitor, WarningCollector};

    #[test]
    fn the_place_can_be_asked_for_or_switched_off() {
        assert_eq!(directory(Some("here".into())), Some("here".into()));
        assert_eq!(directory(Some("".into())), None);
        assert!(directory(None).is_none_or(|place| place.is_absolute() && place.ends_with("vitreo-uq")));
    }

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct CachedModel {
        values: Vec<f64>,
    }

    /// Inputs that no other test and no other process uses.
    fn input(diameter_mm: f64) -> ModelInputs {
        ModelInputs::new("test").with("diameter_mm", diameter_mm).with("process", std::process::id())
    }

    #[test]
    fn what_is_kept_comes_back_and_damage_is_none() {
        let built_from = input(0.1);
        let Some(path) = built_from.path() else { return };
        let warned = WarningCollector::new(&SilentMonitor);
        assert_eq!(read::<CachedModel>(&built_from, &warned), None);
        write(&built_from, &CachedModel { values: vec![0.1, 1e-300] });
        assert_eq!(read::<CachedModel>(&built_from, &warned), Some(CachedModel { values: vec![0.1, 1e-300] }));
        assert!(warned.take().is_empty());
        let text = std::fs::read_to_string(&path).unwrap();
        for changed in [text.replace("0.1", "0.2"), text[..text.len() / 2].into()] {
            std::fs::write(&path, changed).unwrap();
            assert_eq!(read::<CachedModel>(&built_from, &warned), None);
            let text = warned.take().concat();
            assert!(text.contains(&path.display().to_string()) && text.contains("damaged or was changed"));
        }
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn a_model_under_the_name_of_another_is_not_used() {
        let (small, large) = (input(0.55), input(1.1));
        let (Some(small_path), Some(large_path)) = (small.path(), large.path()) else { return };
        write(&large, &CachedModel { values: vec![2.0] });
        std::fs::rename(large_path, &small_path).unwrap();
        let warned = WarningCollector::new(&SilentMonitor);
        assert_eq!(read::<CachedModel>(&small, &warned), None);
        let text = warned.take().concat();
        let directory = cache_directory().unwrap();
        for words in [&small_path, &directory].map(|path| path.display().to_string()) {
            assert!(text.contains(&words), "`{words}` is missing in {text}");
        }
        assert!(text.contains("diameter_mm is 1.1, but 0.55 is required"), "{text}");
        std::fs::remove_file(small_path).unwrap();
    }

    #[test]
    fn inputs_that_differ_anywhere_have_other_names() {
        let force = Force { at_rows_n: &[1.0, 2.0], rule: record::ForceRule::Hold };
        let of = |time_s: &[f64], force| ModelInputs::new("test").with_record(time_s, force).sha256();
        let first = of(&[0.0, 1.0], force);
        assert_eq!(first, of(&[0.0, 1.0], force));
        assert_ne!(first, of(&[0.0, 1.0 + f64::EPSILON], force));
        assert_ne!(first, of(&[0.0, 1.0], Force { rule: record::ForceRule::Linear, ..force }));
        assert_ne!(first, of(&[0.0, 1.0], Force { at_rows_n: &[1.0], ..force }));
    }
}
