//! The command line of a process of this program that another one starts.
//!
//! Names of files and folders come from people and from other programs. Here alone they become words of a command, so that none of them is ever taken for an option.

use std::path::Path;

use vitreo_uq::base::error::{Error, Place, Result};

/// The words of a command: its name, options (without their dashes) with their values, and paths that no option names. A value stands in one word with its option, and behind `--` no word is
/// an option.
pub fn words(command: &[&str], options: &[(&str, Option<String>)], paths: &[String]) -> Vec<String> {
    let option = |(name, value): &(&str, Option<String>)| match value {
        Some(value) => format!("--{name}={value}"),
        None => format!("--{name}"),
    };
    let mut words: Vec<String> = command.iter().map(|word| (*word).to_string()).collect();
    words.extend(options.iter().map(option));
    words.push("--".into());
    words.extend_from_slice(paths);
    words
}

/// A path as a word that means the same from any directory.
///
/// # Errors
/// [`Error::Input`] for a path that is no text.
pub fn absolute(path: &Path) -> Result<String> {
    let whole = std::path::absolute(path)
        .map_err(|source| Error::at_path("find", path, source, "name the folder by its whole path"))?;
    whole
        .into_os_string()
        .into_string()
        .map_err(|_| Error::input(Place::file(path), "the name of this folder is no Unicode text", "rename the folder"))
}
