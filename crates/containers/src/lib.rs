//! Tables in files that are not text: workbooks, arrays of MATLAB and NumPy, HDF5, and tracks of TrackMate. Also texts in encodings of single languages.
//!
//! Each reader recognises its format by content and writes all tables of the file as one text: a title, a header and rows, with tabs between cells. What
//! reads text tables then reads these, so that columns, units and choices between tables follow the same rules for every format.
//!
//! To add a format, add a file with a function that makes a `TableText`, and a line in `FORMATS`. To refuse one by name, add a line in `refused.rs`.

mod arrays;
mod hdf5;
mod legacy_text;
mod matlab;
mod numpy;
mod percent;
mod refused;
mod spreadsheet;
mod table_text;
mod trackmate;

use std::cell::Cell;
use std::path::Path;
use std::sync::Once;

use base::error::{Error, InputPlace, Result};

use table_text::TableText;

/// Tables of a container, or a text in an old encoding, as UTF-8.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Converted {
    /// Name of the format, such as "workbook".
    pub format: String,
    /// The text. Tables of a container stand below their titles and headers, with tabs between cells.
    pub text: String,
    /// Contents that are not in the text, each as a sentence for the user.
    pub notes: Vec<String>,
    /// True if the lines are those of the file, which then is a text in another encoding.
    pub keeps_lines: bool,
}

/// Format of a container: its name, a check of its first bytes, and its reader. The reader returns the reason if the file is damaged.
struct Format {
    name: &'static str,
    recognises: fn(&[u8]) -> bool,
    read: fn(&[u8]) -> std::result::Result<TableText, String>,
}

/// All formats that are read.
const FORMATS: [Format; 6] = [
    Format { name: "workbook", recognises: spreadsheet::recognises, read: spreadsheet::read },
    Format { name: "HDF5 file", recognises: hdf5::recognises, read: hdf5::read },
    Format { name: "MATLAB file", recognises: matlab::recognises, read: matlab::read },
    Format { name: "NumPy array", recognises: numpy::recognises_array, read: numpy::read_array },
    Format { name: "NumPy archive", recognises: numpy::recognises_archive, read: numpy::read_archive },
    Format { name: "TrackMate file", recognises: trackmate::recognises, read: trackmate::read },
];

/// Converts the tables of a container to text. `None` if the bytes are text already. Errors name `file`.
///
/// # Errors
/// [`Error::Input`] if the file is damaged, has no table of numbers, or has a format that is known but not read. The error names the way to export a table.
pub fn convert(file: &Path, bytes: &[u8]) -> Result<Option<Converted>> {
    let refuse = |found: String, remedy: &str| Err(Error::input(InputPlace::file(file), found, remedy));
    if let Some(format) = FORMATS.iter().find(|format| (format.recognises)(bytes)) {
        return match read_guarded(format, bytes) {
            Ok(TableText { text, notes }) if !text.is_empty() => {
                Ok(Some(Converted { format: format.name.into(), text, notes, keeps_lines: false }))
            }
            Ok(TableText { notes, .. }) => {
                let why = notes.first().map_or(String::new(), |note| format!(": {note}"));
                refuse(
                    format!("the {} has no table with two columns of numbers{why}", format.name),
                    "store time, force and position as vectors of equal length, or export the table as text",
                )
            }
            Err(why) => refuse(
                format!("the {} cannot be read: {why}", format.name),
                "store the file again with the program that wrote it, or export the table as text",
            ),
        };
    }
    match refused::recognised(file, bytes) {
        Some((found, remedy)) => refuse(format!("the file is {found}, which is not read"), remedy),
        None => Ok(legacy_text::convert(bytes).map(|(encoding, text)| Converted {
            format: format!("text in {encoding}"),
            text,
            notes: Vec::new(),
            keeps_lines: true,
        })),
    }
}

thread_local! {
    static IS_READING: Cell<bool> = const { Cell::new(false) };
}

/// Reads a container. The libraries that parse containers may panic on a damaged file; such a panic becomes the reason that is returned, and nothing is
/// printed.
fn read_guarded(format: &Format, bytes: &[u8]) -> std::result::Result<TableText, String> {
    static QUIET: Once = Once::new();
    QUIET.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if !IS_READING.get() {
                before(panic);
            }
        }));
    });
    IS_READING.set(true);
    let read = std::panic::catch_unwind(|| (format.read)(bytes));
    IS_READING.set(false);
    read.unwrap_or_else(|_| Err("it is damaged".into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_left_alone() {
        for text in ["time_s,force_uN\n0,1\n", "", "\u{feff}t;F\n", "<notes> 1 2 3"] {
            assert_eq!(convert(Path::new("a.csv"), text.as_bytes()).unwrap(), None, "{text}");
        }
    }

    #[test]
    fn a_panic_of_a_parser_becomes_a_reason() {
        let format = Format { name: "test", recognises: |_| true, read: |_| panic!("slice index") };
        assert_eq!(read_guarded(&format, &[]).unwrap_err(), "it is damaged");
    }

    #[test]
    fn known_formats_that_are_not_read_are_named_with_a_remedy() {
        for (bytes, name) in [(&b"TDSm\x0e\0\0\0"[..], "LabVIEW"), (b"%PDF-1.7 ", "PDF"), (b"II*\0\x08\0\0\0", "image")]
        {
            let error = convert(Path::new("a.bin"), bytes).unwrap_err().to_string();
            assert!(error.contains(name) && error.contains("what to do"), "{error}");
        }
    }
}
