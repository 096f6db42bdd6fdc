//! Reduced models that took long to build, kept on disk under the hash of all that they were built from.
//!
//! Those of fields depend on the apparatus, not on what is measured with it: one serves every experiment of a laboratory. The surrogate of the law depends on the
//! record's times and forces, too: one serves every command on that record. A cache is a convenience: what cannot be read is built again, and what cannot be
//! written is not kept.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use etcetera::base_strategy::{BaseStrategy, choose_native_strategy};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::study::Kept;
use base::error::{Error, Place, Result};
use base::files::{Content, folder_of, read_if_there, refused, to_json, write_atomically, write_json_atomically};

/// Where models are kept, instead of the user's directory for caches; empty for nowhere.
const PLACE: &str = "VITREO_UQ_CACHE";
/// The folder of this program's models there.
const FOLDER: &str = models::SOURCE_HASH;

/// The model that is kept under a hash; `None` where there is none that can be read, or where it was changed.
pub fn read<T: Serialize + DeserializeOwned>(hash: &str) -> Option<T> {
    let bytes = read_if_there(&path(hash)?, Content::Document)?;
    serde_json::from_slice::<Kept<T>>(&bytes).ok()?.unchanged()
}

/// Keeps a model.
pub fn write(hash: &str, model: &impl Serialize) {
    let Some(path) = path(hash) else { return };
    let is_there = path.parent().is_some_and(|folder| std::fs::create_dir_all(folder).is_ok());
    if is_there {
        // Refused where there is no room or no right to write: the model is then built again the next time.
        let _ = write_json_atomically(&path, &Kept::new(model));
    }
}

/// A model as it is kept: the name of its file below the cache's directory, and its bytes.
///
/// # Errors
/// [`base::Error::Numerical`] where it cannot be written as JSON.
pub fn file_of(hash: &str, model: &impl Serialize) -> Result<(String, Vec<u8>)> {
    let name = file_name(hash);
    let bytes = to_json(Path::new(&name), &Kept::new(model))?;
    Ok((name, bytes))
}

/// Puts a file from another cache into this one, whole or not at all; one that is there already with these bytes is left alone. Whether it was put there now.
///
/// # Errors
/// [`base::Error::Input`] where nothing is to be kept; [`base::Error::File`] where the file system refuses.
pub fn adopt(name: &str, bytes: &[u8]) -> Result<bool> {
    let Some(directory) = cache_directory() else {
        return Err(Error::input(
            Place::default().at_key(PLACE),
            "no models are kept here: the variable is empty, or the system has no directory for caches",
            format!("name a directory for them: {PLACE}=DIR"),
        ));
    };
    let path = directory.join(name);
    if read_if_there(&path, Content::Document).is_some_and(|there| there == bytes) {
        return Ok(false);
    }
    let folder = folder_of(&path);
    std::fs::create_dir_all(folder).map_err(refused("create", folder))?;
    write_atomically(&path, bytes)?;
    Ok(true)
}

/// Whether a name is one that [`file_of`] gives: nothing else is ever put into the cache.
pub fn is_file_name(name: &str) -> bool {
    let hash =
        name.strip_prefix(FOLDER).and_then(|rest| rest.strip_prefix('/')).and_then(|own| own.strip_suffix(".json"));
    hash.is_some_and(|hash| hash.len() == 64 && hash.bytes().all(|byte| byte.is_ascii_hexdigit()))
}

/// Name of a model's file below the cache's directory.
pub fn file_name(hash: &str) -> String {
    format!("{FOLDER}/{hash}.json")
}

/// The hash is that of content; that of the sources of mechanics keeps programs apart that would build another model from it.
fn path(hash: &str) -> Option<PathBuf> {
    Some(cache_directory()?.join(file_name(hash)))
}

/// The directory for all that is kept between commands and belongs to no study: the one in `VITREO_UQ_CACHE`, or else the system's for users' caches; `None` where
/// that variable is empty or the system has none.
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

    #[test]
    fn the_place_can_be_asked_for_or_switched_off() {
        assert_eq!(directory(Some("here".into())), Some("here".into()));
        assert_eq!(directory(Some("".into())), None);
        assert!(directory(None).is_none_or(|place| place.is_absolute() && place.ends_with("vitreo-uq")));
    }

    #[test]
    fn what_is_kept_comes_back_and_damage_is_none() {
        #[derive(Debug, PartialEq, Serialize, serde::Deserialize)]
        struct Model {
            values: Vec<f64>,
        }
        let hash = format!("test-{}", std::process::id());
        let Some(path) = path(&hash) else { return };
        assert_eq!(read::<Model>(&hash), None);
        write(&hash, &Model { values: vec![0.1, 1e-300] });
        assert_eq!(read::<Model>(&hash), Some(Model { values: vec![0.1, 1e-300] }));
        let text = std::fs::read_to_string(&path).unwrap();
        for changed in [text.replace("0.1", "0.2"), text[..text.len() / 2].into()] {
            std::fs::write(&path, changed).unwrap();
            assert_eq!(read::<Model>(&hash), None);
        }
        std::fs::remove_file(path).unwrap();
    }
}
