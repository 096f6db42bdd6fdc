//! Formats that are recognised and refused, each with the way to export a table.

use std::io::Cursor;
use std::path::Path;

/// First bytes of a ZIP archive.
pub const IS_ZIP: &[u8] = b"PK\x03\x04";

/// Names of the parts of a ZIP archive, and their total size in bytes after decompression. Both are empty for other files.
pub fn zip_entries(bytes: &[u8]) -> (Vec<String>, u64) {
    let Ok(mut archive) = zip::ZipArchive::new(Cursor::new(bytes)) else { return (Vec::new(), 0) };
    // Sizes come from the central directory: programs that write a workbook as a stream leave them out of the parts themselves.
    let sizes = (0..archive.len()).map(|place| archive.by_index_raw(place).map_or(u64::MAX, |part| part.size()));
    let n_bytes = sizes.fold(0, u64::saturating_add);
    (archive.file_names().flatten().map(String::from).collect(), n_bytes)
}

/// First bytes of a format, its name, and the remedy.
const BY_START: [(&[u8], &str, &str); 25] = [
    (
        b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",
        "an old workbook or project of Office or an instrument",
        "open it with the program that wrote it or a spreadsheet program, and save it as .xlsx or CSV",
    ),
    (b"TDSm", "a LabVIEW measurement (TDMS)", TABLE_IN_PROGRAM),
    (b"\x0e\x03\x13\x01", "an HDF4 file", "convert it to HDF5 with h4toh5, or export the table as text"),
    (
        b"%PDF",
        "a PDF document",
        "ask the authors for the table, or trace the curve with a plot digitiser and save it as text",
    ),
    (b"\x89PNG", "an image", IMAGE),
    (b"\xff\xd8\xff", "an image", IMAGE),
    (b"GIF8", "an image", IMAGE),
    (b"II*\0", "an image or a stack of images", IMAGE),
    (b"MM\0*", "an image or a stack of images", IMAGE),
    (b"RIFF", "a video or sound", IMAGE),
    (b"\x1a\x45\xdf\xa3", "a video", IMAGE),
    (b"\x1f\x8b", "a compressed file", UNPACK),
    (b"BZh", "a compressed file", UNPACK),
    (b"\xfd7zXZ", "a compressed file", UNPACK),
    (b"7z\xbc\xaf\x27\x1c", "a compressed archive", UNPACK),
    (b"Rar!", "a compressed archive", UNPACK),
    (
        b"SQLite format 3",
        "an SQLite database",
        "export the table as CSV, as with `sqlite3 -csv -header FILE \"SELECT * FROM …\"`",
    ),
    (b"PAR1", "a Parquet table", "export it as CSV, as with `pandas.read_parquet(…).to_csv(…)`"),
    (b"ARROW1", "an Arrow table", "export it as CSV, as with `pandas.read_feather(…).to_csv(…)`"),
    (b"RDX", "an R workspace", "export the table in R with `write.csv`"),
    (b"CPYA", "an Origin project", "export the worksheet in Origin as ASCII, or as an Excel workbook"),
    (b"\\*File list", "a Nanoscope file", "export the curve as text with the instrument's program or Gwyddion"),
    (b"CDF\x01", "a NetCDF 3 file", NETCDF),
    (b"CDF\x02", "a NetCDF 3 file", NETCDF),
    (b"{\\rtf", "a word processor's document", "copy the table into a spreadsheet, and save it as .xlsx or CSV"),
];
const TABLE_IN_PROGRAM: &str = "export the table as text with the program that wrote it, or with `nptdms`: `TdmsFile.read(…).as_dataframe().to_csv(…)`";
const IMAGE: &str = "track the bead first, as with TrackMate, and give the table of positions";
const UNPACK: &str = "unpack it, and give the table that it contains";
const NETCDF: &str = "convert it with `nccopy -k netCDF-4`, or export the table as text";

/// Name of a format that is not read, and the remedy; `None` for text.
pub fn recognised(file: &Path, bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    if bytes.starts_with(IS_ZIP) {
        let entries = zip_entries(bytes).0;
        let has = |start: &str| entries.iter().any(|name| name.starts_with(start));
        return Some(if has("xl/") {
            ("a binary Excel workbook", "save it as .xlsx or CSV")
        } else if has("word/") {
            ("a word processor's document", "copy the table into a spreadsheet, and save it as .xlsx or CSV")
        } else if has("header.properties") {
            (
                "a binary JPK force curve",
                "export it as text in the JPK data processing program, with the columns height, vertical deflection and time",
            )
        } else if has("Index/") {
            ("a Numbers or Pages document", "export it as an Excel workbook or CSV")
        } else {
            ("a ZIP archive", UNPACK)
        });
    }
    if let Some((_, name, remedy)) = BY_START.iter().find(|(start, ..)| bytes.starts_with(start)) {
        return Some((name, remedy));
    }
    if bytes.get(4..8) == Some(b"ftyp") {
        return Some(("a video", IMAGE));
    }
    let start = &bytes[..bytes.len().min(4096)];
    let has = |word: &[u8]| start.windows(word.len()).any(|window| window == word);
    if has(b"<Workbook") && has(b"schemas-microsoft-com:office:spreadsheet") {
        return Some((
            "an XML spreadsheet of Excel 2003",
            "open it in a spreadsheet program, and save it as .xlsx or CSV",
        ));
    }
    if has(b"<html")
        || start.trim_ascii_start().starts_with(b"<?xml")
        || start.trim_ascii_start().starts_with(b"<!DOCTYPE")
    {
        return Some((
            "an XML or HTML document without tracks of TrackMate",
            "export the table as text, with one row a line",
        ));
    }
    if matches!(start.trim_ascii_start(), [b'{', rest @ ..] if rest.trim_ascii_start().starts_with(b"\"")) {
        return Some((
            "a JSON document",
            "export the table as text, with one row a line, as with `pandas.DataFrame(…).to_csv(…)`",
        ));
    }
    let ending = file.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
    // Igor's binary waves begin with their version, 1 to 7, in either byte order.
    if matches!(bytes, [1..=7, 0, ..] | [0, 1..=7, ..]) && ["ibw", "pxp"].contains(&ending.as_str()) {
        return Some((
            "an Igor binary wave",
            "export it in Igor as text, with `Save/J` or Data > Save Waves > Save Delimited Text",
        ));
    }
    // Python's pickles of protocol 2 and later.
    if matches!(bytes, [0x80, 2..=5, ..]) && ["pkl", "pickle", "p"].contains(&ending.as_str()) {
        return Some(("a Python pickle", "load it in Python, and save the arrays with `numpy.savez` or as CSV"));
    }
    None
}
