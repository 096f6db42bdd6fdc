//! File that `init` reads: text as it is, or a container whose tables are converted to text.

use std::path::{Path, PathBuf};

use base::error::{Error, InputPlace, Result};
use base::files::{self, Content};
use base::sha256::sha256_hex;
use containers::{Converted, convert};

/// Text of a file with tables, and its origin.
pub struct TableSource {
    /// Path that messages name. For a container, it says that line numbers are those of the converted text.
    pub place: PathBuf,
    /// File name of the text in an experiment.
    pub name: String,
    /// The text in its encoding.
    pub bytes: Vec<u8>,
    /// Sentences about the conversion; empty for a text file.
    pub notes: Vec<String>,
    /// True if the file stores numbers, which have no signs between thousands.
    pub has_stored_numbers: bool,
    /// Origin of the table for the key `source`: the container and its hash, or "not stated".
    pub origin: String,
}

impl TableSource {
    /// Reads a file. A container is recognised by its content and converted to text.
    ///
    /// # Errors
    /// [`Error::File`] if the file cannot be read; [`Error::Input`] for a file name that TOML cannot hold, and the errors of [`convert`].
    pub fn read(file: &Path) -> Result<Self> {
        let bytes = files::read(file, Content::Table, "give a table that can be read")?;
        let name = file_name(file)?;
        let Some(Converted { format, text, mut notes, keeps_lines }) = convert(file, &bytes)? else {
            let origin = "not stated".into();
            return Ok(Self { place: file.into(), name, bytes, notes: Vec::new(), has_stored_numbers: false, origin });
        };
        let origin = format!("{format} {name}, SHA-256 {}", sha256_hex(&bytes));
        let bytes = text.into_bytes();
        if keeps_lines {
            return Ok(Self {
                place: file.into(),
                name,
                bytes,
                notes: vec![format!("the {format} is converted to UTF-8")],
                has_stored_numbers: false,
                origin,
            });
        }
        notes.insert(0, format!("the tables of the {format} are converted to text, with tabs between cells"));
        let stem = Path::new(&name).file_stem().map_or("table".into(), |stem| stem.to_string_lossy().into_owned());
        Ok(Self {
            place: PathBuf::from(format!("{} (as text)", file.display())),
            name: format!("{stem}.tsv"),
            bytes,
            notes,
            has_stored_numbers: true,
            origin,
        })
    }

    /// File name without its extension.
    pub fn stem(&self) -> String {
        Path::new(&self.name).file_stem().map_or("specimen".into(), |stem| stem.to_string_lossy().into_owned())
    }
}

fn file_name(file: &Path) -> Result<String> {
    let name = file.file_name().and_then(|name| name.to_str()).filter(|name| !name.contains(char::is_control));
    name.map(String::from).ok_or_else(|| {
        Error::input(
            InputPlace::file(file),
            "this file name contains control characters or is not Unicode",
            "rename the table to letters, digits and dots",
        )
    })
}
