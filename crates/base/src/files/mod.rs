//! Functions that read and write files.
//!
//! A reader sees either the old or the new content of a file, never an incomplete one. This also holds after a kill or a signal (`under_way`). Only
//! regular files of limited size are read ([`read`]). Links are not followed inside directories that may come from another person ([`forbid_links`]).

mod directory;
mod enclosed;
mod folder;
mod leftovers;
mod name;
mod reading;
mod under_way;
mod xml;

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use serde::Serialize;
use tempfile::NamedTempFile;

use folder::Folder;

pub use directory::TemporaryDirectory;
pub use enclosed::{
    copy, create_folders, create_or_replace, entries, exchange, forbid_links, forbid_links_in_user_folder, is_file,
    is_folder, kind, open_file, open_lock, refuse_link, remove_all, rename,
};
pub use folder::FileKind;
pub use leftovers::remove_stale_files;
pub use name::safe_name;
pub use reading::refuse_long_lines;
pub use reading::{Content, read, read_if_there, read_inside};
pub(crate) use under_way::HiddenPath;
pub use under_way::{hold_gate, stop_writing};
pub use xml::xml_text;

use crate::error::{Error, Result};

const REMEDY: &str = "check that the directory exists, is writable and has room";

/// Returns a converter from the operating system's error to an [`Error::File`]. `action` is the verb for the operation that was tried at
/// `path`, such as "read".
pub fn file_error(action: &'static str, path: &Path) -> impl Fn(std::io::Error) -> Error {
    move |source| Error::at_path(action, path, source, REMEDY)
}

/// Writes a file completely or not at all. The content goes to a hidden file in the same directory, which is flushed to the disk and then
/// renamed.
///
/// # Errors
/// [`Error::File`] if the operating system refuses. An existing file then stays unchanged.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    stream_atomically(path, |file| file.write_all(bytes))
}

/// Removes a file if it exists.
///
/// # Errors
/// [`Error::File`] if the operating system refuses.
pub fn remove_if_there(path: &Path) -> Result<()> {
    match kind(path) {
        Some(FileKind::Folder) => Err(file_error("remove", path)(std::io::ErrorKind::IsADirectory.into())),
        _ => remove_all(path),
    }
}

/// Writes a file completely or not at all, like [`write_atomically`], if its content is too large for the memory. `write` writes the
/// content piece by piece.
///
/// # Errors
/// Errors of [`write_atomically`].
pub fn stream_atomically(path: &Path, write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    PreparedWrite::new(path, write)?.publish()?;
    sync_directory(folder_of(path))
}

/// Writes several files that belong together. If one of them cannot be written, none is replaced. A signal takes effect only after the last file.
///
/// # Errors
/// Errors of [`write_atomically`].
pub fn write_together(files: &[(&Path, &[u8])]) -> Result<()> {
    let prepared = files.iter().map(|(path, bytes)| PreparedWrite::new(path, |file| file.write_all(bytes)));
    let prepared: Vec<PreparedWrite<'_>> = prepared.collect::<Result<_>>()?;
    let _uninterrupted = hold_gate();
    prepared.into_iter().try_for_each(PreparedWrite::publish)?;
    files.iter().try_for_each(|(path, _)| sync_directory(folder_of(path)))
}

/// New content of a file, written and flushed under a hidden name in the file's directory but not yet renamed.
struct PreparedWrite<'a> {
    path: &'a Path,
    folder: Folder,
    file: NamedTempFile<File>,
    _under_way: HiddenPath,
}

impl<'a> PreparedWrite<'a> {
    fn new(path: &'a Path, write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<Self> {
        let place = folder_of(path);
        let folder = enclosed::folder(place).map_err(|refusal| refusal.error("create a file beside", path, REMEDY))?;
        remove_stale_files(place);
        let mut builder = tempfile::Builder::new();
        let prefix = leftovers::prefix("");
        builder.prefix(&prefix);
        // The file gets the permissions that the system gives to new files.
        let create = || builder.make_in(place, |hidden| folder.create_new(hidden.file_name().unwrap_or_default()));
        let (file, under_way) = HiddenPath::begin(create, |file| file.path().to_path_buf())
            .map_err(file_error("create a file beside", path))?;
        leftovers::mark_alive(file.as_file());
        let mut writer = BufWriter::new(file);
        write(&mut writer).map_err(file_error("write", path))?;
        let file = writer.into_inner().map_err(|error| file_error("write", path)(error.into_error()))?;
        file.as_file().sync_all().map_err(file_error("write", path))?;
        Ok(Self { path, folder, file, _under_way: under_way })
    }

    fn publish(self) -> Result<()> {
        let _uninterrupted = hold_gate();
        let (hidden, name) = (self.file.path().file_name(), self.path.file_name());
        let (hidden, name) = (hidden.unwrap_or_default(), name.unwrap_or_default());
        self.folder.rename(hidden, &self.folder, name).map_err(file_error("write", self.path))?;
        // The file already has its final name, so nothing must remove the hidden name.
        let _ = self.file.keep();
        Ok(())
    }
}

/// Converts a value to indented JSON with a final newline. `path` appears only in the error.
///
/// # Errors
/// [`Error::Numerical`] if the value cannot be written as JSON.
pub fn to_json(path: &Path, value: &impl Serialize) -> Result<Vec<u8>> {
    let mut bytes = serde_json::to_vec_pretty(value).map_err(|error| {
        Error::numerical(
            format!("{} cannot be written as JSON: {error}", path.display()),
            "report this with the command that was run",
        )
    })?;
    bytes.push(b'\n');
    Ok(bytes)
}

/// Writes a value as indented JSON with a final newline, completely or not at all.
///
/// # Errors
/// Errors of [`write_atomically`]. [`Error::Numerical`] if the value cannot be written as JSON.
pub fn write_json_atomically(path: &Path, value: &impl Serialize) -> Result<()> {
    write_atomically(path, &to_json(path, value)?)
}

/// Directory that contains a path.
pub fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Waits until the names in a directory are written to the disk, so that they survive a power failure. Has an effect only on Unix.
pub fn sync_directory(path: &Path) -> Result<()> {
    let folder = enclosed::folder(path).map_err(|refusal| refusal.error("write", path, REMEDY))?;
    folder.sync().map_err(file_error("write", path))
}

#[cfg(test)]
mod tests;
