//! Writing a file so that a reader sees the old content or the new, never a part, and a kill leaves one of them.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use serde::Serialize;

use crate::error::{Error, Result};

const REMEDY: &str = "check that the directory exists, is writable and has room";

/// The operating system's refusal of an action on a path, as an [`Error::File`].
pub(crate) fn refused(action: &'static str, path: &Path) -> impl Fn(std::io::Error) -> Error {
    move |source| Error::at_path(action, path, source, REMEDY)
}

/// Writes a file whole or not at all: beside its place, flushed to the disk, then renamed.
///
/// # Errors
/// [`Error::File`] if the operating system refuses; the former file is then untouched.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    stream_atomically(path, |file| file.write_all(bytes))
}

/// Like [`write_atomically`], for content too large to be held as a whole.
///
/// # Errors
/// As [`write_atomically`].
pub fn stream_atomically(path: &Path, write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    let folder = folder_of(path);
    let mut builder = tempfile::Builder::new();
    builder.prefix(".partial-");
    // As readable as any file that a program creates; temporary files are private otherwise.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut writer = BufWriter::new(builder.tempfile_in(folder).map_err(refused("create a file beside", path))?);
    write(&mut writer).map_err(refused("write", path))?;
    let file = writer.into_inner().map_err(|error| refused("write", path)(error.into_error()))?;
    file.as_file().sync_all().map_err(refused("write", path))?;
    file.persist(path).map_err(|error| refused("write", path)(error.error))?;
    sync_directory(folder)
}

/// Writes a value as indented JSON with a final newline, whole or not at all.
///
/// # Errors
/// [`Error::File`] as [`write_atomically`]; [`Error::Numerical`] if the value cannot be written as JSON.
pub fn write_json_atomically(path: &Path, value: &impl Serialize) -> Result<()> {
    let mut bytes = serde_json::to_vec_pretty(value).map_err(|error| {
        Error::numerical(
            format!("{} cannot be written as JSON: {error}", path.display()),
            "report this with the command that was run",
        )
    })?;
    bytes.push(b'\n');
    write_atomically(path, &bytes)
}

/// The directory that a path stands in.
pub(crate) fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Makes names in a directory durable; only Unix can.
pub(crate) fn sync_directory(path: &Path) -> Result<()> {
    if cfg!(unix) {
        File::open(path).and_then(|directory| directory.sync_all()).map_err(refused("write", path))?;
    }
    Ok(())
}
