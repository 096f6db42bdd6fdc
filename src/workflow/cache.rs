//! Reduced models that took long to build, kept on disk under the hash of all that they were built from.
//!
//! Those of fields depend on the apparatus, not on what is measured with it: one serves every experiment of a laboratory. The surrogate of the law depends on the
//! record's times and forces, too: one serves every command on that record. A cache is a convenience: what cannot be read is built again, and what cannot be
//! written is not kept.

use std::ffi::OsString;
use std::path::PathBuf;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::files::{Content, read_if_there, write_json_atomically};
use crate::study::Kept;

/// Where models are kept, instead of the user's directory for caches; empty for nowhere.
const PLACE: &str = "VITREO_UQ_CACHE";

/// The model that is kept under a hash; `None` where there is none that can be read, or where it was changed.
pub(super) fn read<T: Serialize + DeserializeOwned>(hash: &str) -> Option<T> {
    let bytes = read_if_there(&path(hash)?, Content::Document)?;
    serde_json::from_slice::<Kept<T>>(&bytes).ok()?.unchanged()
}

/// Keeps a model.
pub(super) fn write(hash: &str, model: &impl Serialize) {
    let Some(path) = path(hash) else { return };
    let is_there = path.parent().is_some_and(|folder| std::fs::create_dir_all(folder).is_ok());
    if is_there {
        // Refused where there is no room or no right to write: the model is then built again the next time.
        let _ = write_json_atomically(&path, &Kept::new(model));
    }
}

/// The hash is that of content; that of the sources of mechanics keeps programs apart that would build another model from it.
fn path(hash: &str) -> Option<PathBuf> {
    folder(|name| std::env::var_os(name))
        .map(|folder| folder.join(env!("VITREO_UQ_MECHANICS")).join(format!("{hash}.json")))
}

/// The directory for caches: the one that is asked for, or what the system has for users' caches.
fn folder(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    if let Some(place) = variable(PLACE) {
        return Some(PathBuf::from(place)).filter(|place| !place.as_os_str().is_empty());
    }
    let absolute = |name: &str| variable(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let of_system = if cfg!(windows) {
        absolute("LOCALAPPDATA")
    } else {
        let below_home = if cfg!(target_vendor = "apple") { "Library/Caches" } else { ".cache" };
        absolute("XDG_CACHE_HOME").or_else(|| absolute("HOME").map(|home| home.join(below_home)))
    };
    of_system.map(|folder| folder.join("vitreo-uq"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(variables: &'static [(&str, &str)]) -> Option<PathBuf> {
        folder(|name| variables.iter().find(|(own, _)| *own == name).map(|(_, value)| OsString::from(value)))
    }

    #[test]
    fn the_place_can_be_asked_for_or_switched_off() {
        assert_eq!(with(&[("VITREO_UQ_CACHE", "here"), ("HOME", "/home/a")]), Some("here".into()));
        assert_eq!(with(&[("VITREO_UQ_CACHE", ""), ("HOME", "/home/a")]), None);
        assert_eq!(with(&[]), None);
    }

    #[cfg(all(unix, not(target_vendor = "apple")))]
    #[test]
    fn users_caches_stand_where_the_system_has_them() {
        assert_eq!(with(&[("HOME", "/home/a")]), Some("/home/a/.cache/vitreo-uq".into()));
        assert_eq!(with(&[("XDG_CACHE_HOME", "/c"), ("HOME", "/home/a")]), Some("/c/vitreo-uq".into()));
        assert_eq!(
            with(&[("XDG_CACHE_HOME", "relative"), ("HOME", "/home/a")]),
            Some("/home/a/.cache/vitreo-uq".into())
        );
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
