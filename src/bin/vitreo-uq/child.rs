//! Makes the command line of a process that this program starts from its own executable.
//!
//! Names of files and folders come from people and other programs. Only this module turns them into words of a command line, so that no name can be taken for
//! an option.

use std::path::Path;

use vitreo_uq::base::error::{Error, InputPlace, Result};

/// Returns the words of a command line: the command's name, options (named without dashes) with their values, and positional paths. A value is in one word with
/// its option. The word `--` follows the options, so no path can be taken for an option.
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

/// A path as one word of a command line that a message shows: quoted if a shell would divide or change it.
pub fn in_shell(path: &Path) -> String {
    let text = path.display().to_string();
    shlex::try_quote(&text).map_or_else(|_| text.clone(), |word| word.into_owned())
}

/// Converts a path to a text that is valid from any directory.
///
/// # Errors
/// [`Error::Input`] if the path is not Unicode.
pub fn absolute(path: &Path) -> Result<String> {
    let whole = std::path::absolute(path)
        .map_err(|source| Error::at_path("find", path, source, "give the folder's absolute path"))?;
    whole.into_os_string().into_string().map_err(|_| {
        Error::input(InputPlace::file(path), "the name of this folder is not Unicode", "rename the folder")
    })
}
