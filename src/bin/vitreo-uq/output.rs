//! Where a command's result goes: words to standard output, JSON where it is asked for.

use std::io::Write;
use std::path::Path;

use serde::Serialize;
use vitreo_uq::error::{Error, Result};
use vitreo_uq::files::write_json_atomically;

use crate::options::Common;

/// Prints the words, or with `--json -` the document alone; writes the document where `--json FILE` says.
pub fn show(common: &Common, document: &impl Serialize, words: &str) -> Result<()> {
    let text = match common.json.as_deref() {
        Some(path) if path == Path::new("-") => {
            let json = serde_json::to_string_pretty(document);
            json.map_err(|error| {
                Error::numerical(format!("the result is no JSON: {error}"), "report the command that was run")
            })? + "\n"
        }
        Some(path) => {
            write_json_atomically(path, document)?;
            words.into()
        }
        None => words.into(),
    };
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        // A reader such as `head` may close the pipe early.
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::at_path("write", "standard output", error, "send the output elsewhere"))
        }
        _ => Ok(()),
    }
}
