//! Every file that the program reads or writes goes through here.
//!
//! Written so that a reader sees the old content or the new, never a part, and a kill or a signal leaves one of them (`under_way`); read only
//! where it is a regular file of a size that the program can hold ([`read`]); and, beneath directories that may come from somebody else, never through
//! a link ([`enclose`]).

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
    copy, create_anew, create_folders, enclose, enclose_folder, entries, exchange, is_file, is_folder, kind, open_file,
    open_lock, refuse_link, remove_all, rename,
};
pub use folder::Kind;
pub use leftovers::sweep;
pub use name::safe_name;
pub use reading::refuse_long_lines;
pub use reading::{Content, read, read_if_there, read_inside};
pub(crate) use under_way::UnderWay;
pub use under_way::{stop_writing, together};
pub use xml::xml_text;

use crate::error::{Error, Result};

const REMEDY: &str = "check that the directory exists, is writable and has room";

/// The operating system's refusal of an action on a path, as an [`Error::File`].
pub fn refused(action: &'static str, path: &Path) -> impl Fn(std::io::Error) -> Error {
    move |source| Error::at_path(action, path, source, REMEDY)
}

/// Writes a file whole or not at all: beside its place, flushed to the disk, then renamed.
///
/// # Errors
/// [`Error::File`] if the operating system refuses; the former file is then untouched.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    stream_atomically(path, |file| file.write_all(bytes))
}

/// Removes a file of a former run, if there is one.
///
/// # Errors
/// [`Error::File`] if the operating system refuses.
pub fn remove_if_there(path: &Path) -> Result<()> {
    match kind(path) {
        Some(Kind::Folder) => Err(refused("remove", path)(std::io::ErrorKind::IsADirectory.into())),
        _ => remove_all(path),
    }
}

/// Like [`write_atomically`], for content too large to be held as a whole.
///
/// # Errors
/// As [`write_atomically`].
pub fn stream_atomically(path: &Path, write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    Prepared::new(path, write)?.publish()?;
    sync_directory(folder_of(path))
}

/// Writes files that belong together: either all of them are replaced or, where one cannot be written, none is. A signal waits for the last.
///
/// # Errors
/// As [`write_atomically`].
pub fn write_together(files: &[(&Path, &[u8])]) -> Result<()> {
    let prepared = files.iter().map(|(path, bytes)| Prepared::new(path, |file| file.write_all(bytes)));
    let prepared: Vec<Prepared<'_>> = prepared.collect::<Result<_>>()?;
    let _uninterrupted = together();
    prepared.into_iter().try_for_each(Prepared::publish)?;
    files.iter().try_for_each(|(path, _)| sync_directory(folder_of(path)))
}

/// A file that is written and flushed, under a hidden name beside its place.
struct Prepared<'a> {
    path: &'a Path,
    folder: Folder,
    file: NamedTempFile<File>,
    _under_way: UnderWay,
}

impl<'a> Prepared<'a> {
    fn new(path: &'a Path, write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<Self> {
        let place = folder_of(path);
        let folder = enclosed::folder(place).map_err(|refusal| refusal.error("create a file beside", path, REMEDY))?;
        sweep(place);
        let mut builder = tempfile::Builder::new();
        let prefix = leftovers::prefix("");
        builder.prefix(&prefix);
        // As readable as any file that a program creates.
        let create = || builder.make_in(place, |hidden| folder.create_new(hidden.file_name().unwrap_or_default()));
        let (file, under_way) =
            UnderWay::begin(create, |file| file.path().to_path_buf()).map_err(refused("create a file beside", path))?;
        leftovers::mark_alive(file.as_file());
        let mut writer = BufWriter::new(file);
        write(&mut writer).map_err(refused("write", path))?;
        let file = writer.into_inner().map_err(|error| refused("write", path)(error.into_error()))?;
        file.as_file().sync_all().map_err(refused("write", path))?;
        Ok(Self { path, folder, file, _under_way: under_way })
    }

    fn publish(self) -> Result<()> {
        let _uninterrupted = together();
        let (hidden, name) = (self.file.path().file_name(), self.path.file_name());
        let (hidden, name) = (hidden.unwrap_or_default(), name.unwrap_or_default());
        self.folder.rename(hidden, &self.folder, name).map_err(refused("write", self.path))?;
        // It has its name, and nothing is left under the hidden one.
        let _ = self.file.keep();
        Ok(())
    }
}

/// A value as indented JSON with a final newline.
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

/// Writes a value as indented JSON with a final newline, whole or not at all.
///
/// # Errors
/// [`Error::File`] as [`write_atomically`]; [`Error::Numerical`] if the value cannot be written as JSON.
pub fn write_json_atomically(path: &Path, value: &impl Serialize) -> Result<()> {
    write_atomically(path, &to_json(path, value)?)
}

/// The directory that a path stands in.
pub fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Makes names in a directory durable; only Unix can.
pub fn sync_directory(path: &Path) -> Result<()> {
    let folder = enclosed::folder(path).map_err(|refusal| refusal.error("write", path, REMEDY))?;
    folder.sync().map_err(refused("write", path))
}

#[cfg(test)]
mod tests;
