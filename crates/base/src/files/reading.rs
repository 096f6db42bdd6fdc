//! Reads regular files up to a size limit.
//!
//! A pipe or a device may never end, and a file named by mistake may exceed the memory. Both are refused before their content is read into memory.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::enclosed::{self, Refusal};
use super::folder::FileKind;
use crate::error::{Error, InputPlace, Result};

const MIB: u64 = 1 << 20;

crate::named_enum! {
    /// Purpose of a file. It determines the file's size limit.
    pub enum Content {
        /// TOML file that people write.
        Settings = "settings",
        /// JSON document, or other data that the program itself wrote.
        Document = "a document of this program",
        /// CSV table of measurements or draws.
        Table = "a table",
        /// Mesh in Gmsh's format.
        Mesh = "a mesh",
        /// Checkpoint of a sampler.
        State = "a sampler's state",
    }
    fn words
}

impl Content {
    /// Largest accepted size, in bytes.
    pub fn max_bytes(self) -> u64 {
        match self {
            Self::Settings => 4 * MIB,
            Self::Document => 64 * MIB,
            Self::Table | Self::Mesh => 1024 * MIB,
            Self::State => 4096 * MIB,
        }
    }
}

/// Reads a regular file.
///
/// # Errors
/// [`Error::File`] with `remedy` if the operating system refuses, [`Error::Input`] for anything but a regular file and for a file above its size limit.
pub fn read(path: &Path, content: Content, remedy: &str) -> Result<Vec<u8>> {
    // The kind is checked before opening, because opening a pipe would wait for a writer.
    content_of(enclosed::open(path), path, content, remedy)
}

/// Reads the file `folder/inside`, where `inside` is named in a file of `folder`. Links are refused, because the directory may come from another person.
/// `what` describes the directory in messages ("an experiment").
///
/// # Errors
/// Errors of [`read`]. [`Error::Input`] for a link, and for a path that leads out of the directory.
pub fn read_inside(folder: &Path, inside: &str, what: &'static str, content: Content, remedy: &str) -> Result<Vec<u8>> {
    let path = folder.join(inside);
    content_of(enclosed::open_inside(folder, Path::new(inside), what), &path, content, remedy)
}

fn content_of(
    opened: std::result::Result<std::result::Result<File, FileKind>, Refusal>,
    path: &Path,
    content: Content,
    remedy: &str,
) -> Result<Vec<u8>> {
    let refused = |source| Error::at_path("read", path, source, remedy);
    let file = match opened.map_err(|refusal| refusal.error("read", path, remedy))? {
        Ok(file) => file,
        Err(kind) => {
            let (what, remedy) = match kind {
                FileKind::Folder => ("a directory", remedy),
                _ => ("a pipe or a device", "write the content to a file and give that file"),
            };
            return Err(Error::input(InputPlace::file(path), format!("this is {what}, not a regular file"), remedy));
        }
    };
    let metadata = file.metadata().map_err(refused)?;
    if !metadata.is_file() || metadata.len() > content.max_bytes() {
        return Err(too_large(path, content));
    }
    let mut bytes = Vec::new();
    // Reading one byte beyond the limit detects a file that grows or does not report its size.
    file.take(content.max_bytes() + 1).read_to_end(&mut bytes).map_err(refused)?;
    if bytes.len() as u64 > content.max_bytes() {
        return Err(too_large(path, content));
    }
    Ok(bytes)
}

/// Reads a file that the program itself wrote. `None` if the file is missing or unreadable; the caller then computes the content again.
pub fn read_if_there(path: &Path, content: Content) -> Option<Vec<u8>> {
    read(path, content, "").ok()
}

fn too_large(path: &Path, content: Content) -> Error {
    Error::input(
        InputPlace::file(path),
        format!("the file exceeds the limit of {} MiB for {}", content.max_bytes() / MIB, content.words()),
        match content {
            Content::Table => "check that this is the right file; if so, split it or keep every k-th row",
            Content::Mesh => "check that this is the right file; if so, make the mesh coarser",
            _ => "check that this is the right file",
        },
    )
}

/// Largest length of a line in a table, in bytes. A file without line ends is not a table, and its single cell would fill the memory.
const LONGEST_LINE_BYTES: usize = 1 << 20;

/// Refuses a table if one of its lines is too long. `path` appears only in the error.
///
/// # Errors
/// [`Error::Input`] with the line number.
pub fn refuse_long_lines(path: &Path, bytes: &[u8]) -> Result<()> {
    let too_long = |line: &[u8]| line.len() > LONGEST_LINE_BYTES;
    match bytes.split(|byte| *byte == b'\n').position(too_long) {
        None => Ok(()),
        Some(index) => Err(Error::input(
            InputPlace::file(path).at_line(index + 1),
            format!("this line has more than {} KiB", LONGEST_LINE_BYTES / 1024),
            "give a CSV with one row per line",
        )),
    }
}
