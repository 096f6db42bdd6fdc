//! Reading: regular files only, and no more of them than the program can hold.
//!
//! A pipe or a device may never end, and a file that was named by mistake may be larger than the memory. Both are refused before anything is held.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::enclosed::{self, Refusal};
use super::folder::Kind;
use crate::error::{Error, Place, Result};

const MIB: u64 = 1 << 20;

/// What a file is for, and so how large it may be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Content {
    /// What people write by hand: TOML.
    Settings,
    /// A JSON document, or what else the program wrote for itself.
    Document,
    /// A CSV of measurements or draws.
    Table,
    /// A Gmsh mesh.
    Mesh,
    /// A sampler's state.
    State,
}

impl Content {
    /// The largest file of this kind that is read, in bytes.
    pub fn most_bytes(self) -> u64 {
        match self {
            Self::Settings => 4 * MIB,
            Self::Document => 64 * MIB,
            Self::Table | Self::Mesh => 1024 * MIB,
            Self::State => 4096 * MIB,
        }
    }

    fn words(self) -> &'static str {
        match self {
            Self::Settings => "settings",
            Self::Document => "a document of this program",
            Self::Table => "a table",
            Self::Mesh => "a mesh",
            Self::State => "a sampler's state",
        }
    }
}

/// Reads a regular file.
///
/// # Errors
/// [`Error::File`] with `remedy` if the operating system refuses, [`Error::Input`] for what is no regular file or larger than its kind may be.
pub fn read(path: &Path, content: Content, remedy: &str) -> Result<Vec<u8>> {
    // Looked at before it is opened: opening a pipe would wait for somebody to write into it.
    content_of(enclosed::open(path), path, content, remedy)
}

/// The same of a file in a directory that is `what` ("an experiment") and names it: no link leads there, since what it names may come from somebody else.
///
/// # Errors
/// As [`read`]; [`Error::Input`] for a link, and for a path that leads out of the directory.
pub fn read_inside(folder: &Path, inside: &str, what: &'static str, content: Content, remedy: &str) -> Result<Vec<u8>> {
    let path = folder.join(inside);
    content_of(enclosed::open_inside(folder, Path::new(inside), what), &path, content, remedy)
}

fn content_of(
    opened: std::result::Result<std::result::Result<File, Kind>, Refusal>,
    path: &Path,
    content: Content,
    remedy: &str,
) -> Result<Vec<u8>> {
    let refused = |source| Error::at_path("read", path, source, remedy);
    let file = match opened.map_err(|refusal| refusal.error("read", path, remedy))? {
        Ok(file) => file,
        Err(kind) => {
            let (what, remedy) = match kind {
                Kind::Folder => ("a directory", remedy),
                _ => ("a pipe or a device", "write the content to a file and give that"),
            };
            return Err(Error::input(Place::file(path), format!("this is {what}, not a regular file"), remedy));
        }
    };
    let metadata = file.metadata().map_err(refused)?;
    if !metadata.is_file() || metadata.len() > content.most_bytes() {
        return Err(too_large(path, content));
    }
    let mut bytes = Vec::new();
    // One byte more, by which a file that grows or does not say its size is found out.
    file.take(content.most_bytes() + 1).read_to_end(&mut bytes).map_err(refused)?;
    if bytes.len() as u64 > content.most_bytes() {
        return Err(too_large(path, content));
    }
    Ok(bytes)
}

/// What the program kept for itself, if it is there and can be read: whatever else is there counts as nothing and is made anew.
pub fn read_if_there(path: &Path, content: Content) -> Option<Vec<u8>> {
    read(path, content, "").ok()
}

fn too_large(path: &Path, content: Content) -> Error {
    Error::input(
        Place::file(path),
        format!("the file has more than the {} MiB that {} may have", content.most_bytes() / MIB, content.words()),
        match content {
            Content::Table => "check that this is the file that is meant; else split it, or keep every k-th row",
            Content::Mesh => "check that this is the file that is meant; else make the mesh coarser",
            _ => "check that this is the file that is meant",
        },
    )
}

/// A line of a table that a person or an instrument wrote: a file without line ends is no table, and its cells would fill the memory.
const LONGEST_LINE_BYTES: usize = 1 << 20;

/// Refuses what has lines that no table has.
///
/// # Errors
/// [`Error::Input`] with the line.
pub fn refuse_long_lines(path: &Path, bytes: &[u8]) -> Result<()> {
    let too_long = |line: &[u8]| line.len() > LONGEST_LINE_BYTES;
    match bytes.split(|byte| *byte == b'\n').position(too_long) {
        None => Ok(()),
        Some(index) => Err(Error::input(
            Place::file(path).at_line(index + 1),
            format!("this line has more than {} KiB", LONGEST_LINE_BYTES / 1024),
            "give a CSV with one row a line",
        )),
    }
}
