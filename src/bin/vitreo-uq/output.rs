//! Writes the result of a command: text to standard output, JSON to a file or to standard output.

use std::borrow::Cow;
use std::io::Write;
use std::path::Path;
use std::time::Instant;

use serde::Serialize;
use vitreo_uq::base::error::{Error, InputPlace, Result};
use vitreo_uq::base::files::write_json_atomically;
use vitreo_uq::base::quantities::Quantities;

/// Checks that the JSON document can be written to its path. Commands call this function before they start long computations.
pub fn check(json: Option<&Path>) -> Result<()> {
    let Some(path) = json.filter(|path| *path != Path::new("-")) else { return Ok(()) };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if folder.is_dir() && !path.is_dir() {
        return Ok(());
    }
    Err(Error::input(
        InputPlace::default().at_key("--json"),
        format!("{} cannot be written: it is a directory, or its directory does not exist", path.display()),
        "give a file in a directory that exists, or `-` for standard output",
    ))
}

/// Writes a JSON document. A file is replaced as a whole, also through a symbolic link. A pipe or device is written to directly.
fn write_document(path: &Path, document: &impl Serialize) -> Result<()> {
    let target = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    let is_special = std::fs::metadata(&target).is_ok_and(|metadata| !metadata.is_file());
    if !is_special {
        return write_json_atomically(&target, document);
    }
    let refused = |source| Error::at_path("write", &target, source, "give a regular file, or `-` for standard output");
    let mut file = std::fs::OpenOptions::new().write(true).open(&target).map_err(refused)?;
    let json = serde_json::to_vec_pretty(document).map_err(|error| {
        Error::numerical(format!("the result cannot be written as JSON: {error}"), "report the command that was run")
    })?;
    file.write_all(&json).and_then(|()| file.write_all(b"\n")).map_err(refused)
}

/// Prints the text of a result. With `--json FILE` the document is also written; with `--json -` only the document is printed.
pub fn show(json: Option<&Path>, document: &impl Serialize, words: &str) -> Result<()> {
    let quantities = serde_json::to_value(document)
        .ok()
        .and_then(|document| Quantities::named(document.get("record_kind")?.as_str()?));
    let words = &*quantities.map_or(Cow::Borrowed(words), |quantities| quantities.translate(words));
    let text = match json {
        Some(path) if path == Path::new("-") => {
            let json = serde_json::to_string_pretty(document);
            json.map_err(|error| {
                Error::numerical(
                    format!("the result cannot be written as JSON: {error}"),
                    "report the command that was run",
                )
            })? + "\n"
        }
        Some(path) => {
            write_document(path, document)?;
            words.into()
        }
        None => words.into(),
    };
    print(&text)
}

/// Writes a text to standard output.
pub fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        // A closed pipe is no error, because a reader such as `head` may end early.
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::at_path("write", "standard output", error, "send the output elsewhere"))
        }
        _ => Ok(()),
    }
}

/// Prints the path of the results and the duration of the command, unless `quiet` is true.
pub fn print_result_path(quiet: bool, place: &Path, began: Instant) {
    if !quiet {
        let seconds = began.elapsed().as_secs_f64();
        crate::interrupt::print_message(&format!("Results and figures: {} ({seconds:.1} s)", place.display()));
    }
}
