//! Reader for the numbers and section marks of an MSH file, text or binary. It keeps the position
//! for error messages.

use std::path::Path;

use base::error::{Error, InputPlace, Result};

/// Remedy in errors about a file that ends early or does not follow the format.
const DAMAGED: &str = "the file is damaged or not a Gmsh 4.1 mesh: save it again with `gmsh -3 -format msh41`";

/// A reading position in the bytes of an MSH file.
pub(super) struct Scanner<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    position: usize,
    /// Line number of the last word of text, counted from 1.
    line: usize,
    /// True if numbers are stored as little-endian bytes.
    pub(super) binary: bool,
}

impl<'a> Scanner<'a> {
    pub fn new(path: &'a Path, bytes: &'a [u8]) -> Self {
        Self { path, bytes, position: 0, line: 1, binary: false }
    }

    /// Returns an error about the current position. It names the line of a text file or the byte
    /// offset of a binary one.
    pub(super) fn error(&self, found: impl std::fmt::Display, remedy: impl Into<String>) -> Error {
        if self.binary {
            let found = format!("at byte offset {}: {found}", self.position);
            Error::input(InputPlace::file(self.path), found, remedy)
        } else {
            Error::input(InputPlace::file(self.path).at_line(self.line), found.to_string(), remedy)
        }
    }

    /// Returns an error about content that violates the format.
    pub(super) fn damaged(&self, found: impl std::fmt::Display) -> Error {
        self.error(found, DAMAGED)
    }

    /// Returns an error about the file as a whole.
    pub(super) fn file_error(&self, found: impl Into<String>, remedy: impl Into<String>) -> Error {
        Error::input(InputPlace::file(self.path), found, remedy)
    }

    fn skip_whitespace(&mut self) {
        while let Some(&byte) = self.bytes.get(self.position).filter(|byte| byte.is_ascii_whitespace()) {
            self.line += usize::from(byte == b'\n');
            self.position += 1;
        }
    }

    /// Reads the next word of text, in text and binary files. Returns an empty word at the end of
    /// the file.
    fn word(&mut self) -> &'a [u8] {
        self.skip_whitespace();
        let rest = &self.bytes[self.position..];
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.position += length;
        &rest[..length]
    }

    /// Reads the mark that opens the next section, and returns its name without `$`. Returns `None`
    /// at the end of the file.
    pub(super) fn section(&mut self) -> Result<Option<&'a str>> {
        let word = self.word();
        if word.is_empty() {
            return Ok(None);
        }
        match std::str::from_utf8(word).ok().and_then(|word| word.strip_prefix('$')) {
            Some(name) => {
                if self.binary {
                    // In a binary file, the numbers start directly after the line break.
                    self.end_of_line();
                }
                Ok(Some(name))
            }
            None => Err(self.damaged(format!("found `{}`, expected a section such as `$Nodes`", printable(word)))),
        }
    }

    /// Reads the mark that closes the section `name`. Any other content is an error.
    pub(super) fn end_of_section(&mut self, name: &str) -> Result<()> {
        let word = self.word();
        if word.strip_prefix(b"$End") == Some(name.as_bytes()) {
            Ok(())
        } else {
            Err(self.damaged(format!("found `{}`, expected `$End{name}`", printable(word))))
        }
    }

    /// Skips the section `name`.
    pub(super) fn skip_section(&mut self, name: &str) -> Result<()> {
        let mark = format!("$End{name}");
        let rest = &self.bytes[self.position..];
        match rest.windows(mark.len()).position(|window| window == mark.as_bytes()) {
            Some(length) => {
                self.line += rest[..length].iter().filter(|&&byte| byte == b'\n').count();
                self.position += length + mark.len();
                Ok(())
            }
            None => Err(self.damaged(format!("section `${name}` is not closed by `{mark}`"))),
        }
    }

    /// Moves to the first byte after the next line break.
    pub(super) fn end_of_line(&mut self) {
        let rest = &self.bytes[self.position..];
        let length = rest.iter().position(|&byte| byte == b'\n').map_or(rest.len(), |length| length + 1);
        self.line += usize::from(rest[..length].ends_with(b"\n"));
        self.position += length;
    }

    /// Reads a number written as text, in text and binary files.
    pub(super) fn text_number<T: std::str::FromStr>(&mut self, what: &str) -> Result<T> {
        let word = self.word();
        if word.is_empty() {
            return Err(self.damaged(format!("the file ends before {what}")));
        }
        std::str::from_utf8(word)
            .ok()
            .and_then(|word| word.parse().ok())
            .ok_or_else(|| self.damaged(format!("found `{}`, expected {what}", printable(word))))
    }

    /// Reads a name in double quotes, in text and binary files.
    pub(super) fn quoted(&mut self, what: &str) -> Result<String> {
        self.skip_whitespace();
        let rest = &self.bytes[self.position..];
        let inner = rest.strip_prefix(b"\"").and_then(|rest| {
            let length = rest.iter().position(|&byte| byte == b'"' || byte == b'\n')?;
            (rest[length] == b'"').then(|| &rest[..length])
        });
        match inner {
            Some(inner) => {
                self.position += inner.len() + 2;
                Ok(String::from_utf8_lossy(inner).into_owned())
            }
            None => Err(self.damaged(format!("found no double quotes, expected {what} in double quotes"))),
        }
    }

    fn raw<const N: usize>(&mut self, what: &str) -> Result<[u8; N]> {
        match self.bytes[self.position..].first_chunk::<N>() {
            Some(chunk) => {
                self.position += N;
                Ok(*chunk)
            }
            None => Err(self.damaged(format!("the file ends within {what}"))),
        }
    }

    /// Reads the integer 1 that shows the byte order of a binary file.
    pub(super) fn byte_order(&mut self) -> Result<()> {
        let marker = self.raw("the byte-order marker")?;
        match i32::from_le_bytes(marker) {
            1 => Ok(()),
            0x0100_0000 => Err(self.error(
                "the numbers are stored with the most significant byte first",
                "save the mesh as text with `gmsh -3 -format msh41 -bin 0`",
            )),
            other => Err(self.damaged(format!("found {other}, expected the byte-order marker 1"))),
        }
    }

    /// Reads a 4-byte signed integer.
    pub(super) fn int(&mut self, what: &str) -> Result<i32> {
        if self.binary { Ok(i32::from_le_bytes(self.raw(what)?)) } else { self.text_number(what) }
    }

    /// Reads an 8-byte unsigned integer.
    pub(super) fn size(&mut self, what: &str) -> Result<u64> {
        if self.binary { Ok(u64::from_le_bytes(self.raw(what)?)) } else { self.text_number(what) }
    }

    /// Reads a finite double-precision number.
    pub(super) fn double(&mut self, what: &str) -> Result<f64> {
        let value = if self.binary { f64::from_le_bytes(self.raw(what)?) } else { self.text_number(what)? };
        if value.is_finite() {
            Ok(value)
        } else {
            Err(self.damaged(format!("found {value}, expected {what} as a finite number")))
        }
    }

    /// Reads a number of items. In a binary file an item has at least `bytes_each` bytes. It is an
    /// error if the remaining bytes cannot hold the items. A damaged count therefore never
    /// allocates memory.
    pub(super) fn count(&mut self, what: &str, bytes_each: usize) -> Result<usize> {
        let count = self.size(what)?;
        // In a text file the shortest item is a digit and a separator.
        let bytes_each = if self.binary { bytes_each } else { 2 };
        let room = self.bytes.len().saturating_sub(self.position) / bytes_each + 1;
        match usize::try_from(count) {
            Ok(count) if count <= room => Ok(count),
            _ => Err(self.damaged(format!("{what} is {count}, more than the rest of the file can hold"))),
        }
    }
}

/// Shortens a word and makes it printable.
fn printable(word: &[u8]) -> String {
    if word.is_empty() {
        return "end of file".to_owned();
    }
    String::from_utf8_lossy(word).chars().take(24).map(|c| if c.is_control() { '?' } else { c }).collect()
}
