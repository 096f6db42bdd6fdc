//! TOML input with positions. Every error names the file, the line, the key and what the user can do.
//!
//! Experiments, priors and model specifications are read with this module, so their errors have equal wording.

use std::ops::Range;
use std::path::{Path, PathBuf};

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::error::{Error, InputPlace, Result};
use crate::units::nearest_name;

/// Placeholder that `init` writes for an unknown number.
pub const UNKNOWN: &str = "?";

/// Parsed TOML file with the line of each key.
pub struct TomlInput<'a> {
    file: PathBuf,
    text: &'a str,
    root: Spanned<DeTable<'a>>,
}

/// One table of a [`TomlInput`]. Its getters return errors that name the file, line and key.
#[derive(Clone, Copy)]
pub struct TomlTable<'a> {
    document: &'a TomlInput<'a>,
    table: &'a DeTable<'a>,
    line: usize,
}

/// Returns `text` as a quoted TOML string.
pub fn quoted(text: &str) -> String {
    toml::Value::String(text.into()).to_string()
}

/// Decodes UTF-8 bytes and removes a byte-order mark. Refuses text that is not UTF-8 or is empty.
pub fn text_of<'a>(file: &Path, bytes: &'a [u8]) -> Result<&'a str> {
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let line = 1 + bytes[..error.valid_up_to()].iter().filter(|byte| **byte == b'\n').count();
        Error::input(
            InputPlace::file(file).at_line(line),
            "this is not UTF-8 text",
            "save the file as UTF-8 (plain text, no spreadsheet format)",
        )
    })?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if text.trim().is_empty() {
        return Err(Error::input(
            InputPlace::file(file).at_line(1),
            "the file is empty",
            "write its content; the project's `data/` and `priors/` hold examples",
        ));
    }
    Ok(text)
}

impl<'a> TomlInput<'a> {
    /// Parses TOML. `file` appears only in errors.
    pub fn parse(file: &Path, text: &'a str) -> Result<Self> {
        let root = DeTable::parse(text).map_err(|error| {
            let line = line_of(text, error.span().map_or(0, |span| span.start));
            Error::input(
                InputPlace::file(file).at_line(line),
                format!("not valid TOML: {}", error.message()),
                "correct the syntax of this line; a key is written `name = value`, text in double quotes, each key once",
            )
        })?;
        Ok(Self { file: file.to_path_buf(), text, root })
    }

    /// Returns the root table.
    pub fn root(&'a self) -> TomlTable<'a> {
        TomlTable { document: self, table: self.root.get_ref(), line: 1 }
    }
}

fn line_of(text: &str, byte: usize) -> usize {
    1 + text.as_bytes().iter().take(byte).filter(|byte| **byte == b'\n').count()
}

/// Path from a table to a nested table, such as `a.b`; `[n]` marks the n-th table of a list. Tables are compared by address. `None` if `target` is not
/// nested in `from`.
fn path_to(from: &DeTable<'_>, target: &DeTable<'_>) -> Option<String> {
    from.iter().find_map(|(key, value)| {
        path_in(value.get_ref(), target).map(|rest| {
            let dot = if rest.is_empty() || rest.starts_with('[') { "" } else { "." };
            format!("{}{dot}{rest}", key.get_ref())
        })
    })
}

fn path_in(value: &DeValue<'_>, target: &DeTable<'_>) -> Option<String> {
    match value {
        DeValue::Table(table) if std::ptr::eq(table, target) => Some(String::new()),
        DeValue::Table(table) => path_to(table, target),
        DeValue::Array(items) => items.iter().enumerate().find_map(|(index, item)| {
            path_in(item.get_ref(), target).map(|rest| {
                let dot = if rest.is_empty() || rest.starts_with('[') { "" } else { "." };
                format!("[{}]{dot}{rest}", index + 1)
            })
        }),
        _ => None,
    }
}

impl<'a> TomlTable<'a> {
    /// Path of this table from the root; empty for the root table. It is computed only when an error needs it.
    fn path(&self) -> String {
        path_to(self.document.root.get_ref(), self.table).unwrap_or_default()
    }

    fn full_key(&self, key: &str) -> String {
        let path = self.path();
        if path.is_empty() { key.to_string() } else { format!("{path}.{key}") }
    }

    fn entry(&self, key: &str) -> Option<(Range<usize>, &'a Spanned<DeValue<'a>>)> {
        self.table.iter().find(|(name, _)| name.get_ref() == key).map(|(name, value)| (name.span(), value))
    }

    /// Returns the table's keys in alphabetical order.
    pub fn keys(&self) -> impl Iterator<Item = &'a str> + use<'a> {
        self.table.keys().map(|key| key.get_ref().as_ref())
    }

    /// Returns the table's keys in the order of the file.
    pub fn keys_in_order(&self) -> Vec<&'a str> {
        let mut keys: Vec<(usize, &'a str)> =
            self.table.iter().map(|(key, _)| (key.span().start, key.get_ref().as_ref())).collect();
        keys.sort_unstable();
        keys.into_iter().map(|(_, key)| key).collect()
    }

    /// Returns `true` if the key exists.
    pub fn has(&self, key: &str) -> bool {
        self.entry(key).is_some()
    }

    /// File, line and name of a key. For a missing key the line is that of the table's header.
    pub fn place(&self, key: &str) -> InputPlace {
        let line = self.entry(key).map_or(self.line, |(span, _)| line_of(self.document.text, span.start));
        InputPlace::file(&self.document.file).at_line(line).at_key(self.full_key(key))
    }

    /// Makes an error about the value of a key. `found` describes the fault, and `remedy` tells the user what to do.
    pub fn refuse(&self, key: &str, found: impl Into<String>, remedy: impl Into<String>) -> Error {
        Error::input(self.place(key), found, remedy)
    }

    /// Makes an error about this whole table instead of one of its keys.
    pub fn refuse_whole(&self, found: impl Into<String>, remedy: impl Into<String>) -> Error {
        Error::input(InputPlace::file(&self.document.file).at_line(self.line).at_key(self.path()), found, remedy)
    }

    /// Refuses the first key that is not in `known`, and suggests the most similar known key.
    pub fn only(&self, known: &[&str]) -> Result<()> {
        let Some(unknown) = self.keys().find(|key| !known.contains(key)) else { return Ok(()) };
        let dotted = known.iter().find(|name| name.strip_prefix(unknown).is_some_and(|rest| rest.starts_with('.')));
        if let Some(name) = dotted {
            let remedy = format!("quote the whole name, as in `\"{name}\"`");
            return Err(self.refuse(unknown, "a name with a dot needs quotes", remedy));
        }
        let remedy = match nearest_name(unknown, known.iter().copied()) {
            Some(near) => format!("did you mean `{near}`? Known here: {}", known.join(", ")),
            None => format!("remove it; known here: {}", known.join(", ")),
        };
        Err(self.refuse(unknown, "unknown key", remedy))
    }

    /// Makes an error for a missing key. `example` is a complete line that would be accepted.
    pub fn missing(&self, key: &str, example: &str) -> Error {
        let path = self.path();
        let found = if path.is_empty() { "missing".into() } else { format!("missing in [{path}]") };
        self.refuse(key, found, format!("add `{example}`"))
    }

    fn wrong_type(&self, key: &str, value: &DeValue<'_>, wanted: &str, example: &str) -> Error {
        if value.as_str() == Some(UNKNOWN) {
            let remedy = format!("measure it or look it up, and write it, as in `{example}`");
            return self.refuse(key, "this is not filled in yet", remedy);
        }
        self.refuse(key, format!("expected {wanted}, found {}", value.type_str()), format!("write `{example}`"))
    }

    /// Returns the text of a key; `None` if the key is absent.
    pub fn text(&self, key: &str) -> Result<Option<String>> {
        let Some((_, value)) = self.entry(key) else { return Ok(None) };
        match value.get_ref().as_str() {
            Some(text) if !text.trim().is_empty() => Ok(Some(text.trim().to_string())),
            Some(_) => Err(self.refuse(key, "the text is empty", "write text between the quotes or remove the key")),
            None => Err(self.wrong_type(key, value.get_ref(), "text", &format!("{key} = \"…\""))),
        }
    }

    /// Returns the text of a key that must be present. `example` is a line that would be accepted.
    pub fn required_text(&self, key: &str, example: &str) -> Result<String> {
        self.text(key)?.ok_or_else(|| self.missing(key, example))
    }

    /// Returns `true` if a key still holds the mark of an unknown value.
    pub fn is_unknown(&self, key: &str) -> bool {
        self.entry(key).is_some_and(|(_, value)| value.get_ref().as_str() == Some(UNKNOWN))
    }

    /// Returns `true` if a key holds a number.
    pub fn is_number(&self, key: &str) -> bool {
        self.entry(key).is_some_and(|(_, value)| matches!(value.get_ref(), DeValue::Float(_) | DeValue::Integer(_)))
    }

    /// Returns the finite number of a key, written as an integer or a float; `None` if the key is absent.
    pub fn number(&self, key: &str) -> Result<Option<f64>> {
        let Some((_, value)) = self.entry(key) else { return Ok(None) };
        let text = match value.get_ref() {
            DeValue::Float(float) => float.as_str(),
            DeValue::Integer(integer) if integer.radix() == 10 => integer.as_str(),
            other => return Err(self.wrong_type(key, other, "a decimal number", &format!("{key} = 1.0"))),
        };
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(Some(number)),
            _ => Err(self.refuse(key, format!("`{text}` is not a finite number"), "write a finite decimal number")),
        }
    }

    /// Returns the finite number of a key that must be present. `example` is a line that would be accepted.
    pub fn required_number(&self, key: &str, example: &str) -> Result<f64> {
        self.number(key)?.ok_or_else(|| self.missing(key, example))
    }

    /// Returns the number above zero of a key that must be present. `example` is a line that would be accepted.
    pub fn required_positive(&self, key: &str, example: &str) -> Result<f64> {
        let value = self.required_number(key, example)?;
        self.check_positive(key, value, example)
    }

    /// Returns the number above zero of a key; `None` if the key is absent.
    pub fn positive(&self, key: &str, example: &str) -> Result<Option<f64>> {
        self.number(key)?.map(|value| self.check_positive(key, value, example)).transpose()
    }

    /// Returns the number above zero of a key that must be present. The number must lie between `sizes[0]` and `sizes[1]`.
    pub fn required_within(&self, key: &str, example: &str, sizes: [f64; 2]) -> Result<f64> {
        let value = self.required_positive(key, example)?;
        self.require_range(key, value, sizes)
    }

    /// Returns `value`, or an error if it lies outside the given range. Such a value is probably a typing error, and the computation could
    /// not handle it.
    pub fn require_range(&self, key: &str, value: f64, [smallest, largest]: [f64; 2]) -> Result<f64> {
        if (smallest..=largest).contains(&value) {
            return Ok(value);
        }
        Err(self.refuse(
            key,
            format!("{value:e} is outside the allowed range"),
            format!("check the number and its unit; the range is {smallest:e} to {largest:e}"),
        ))
    }

    fn check_positive(&self, key: &str, value: f64, example: &str) -> Result<f64> {
        if value > 0.0 {
            return Ok(value);
        }
        Err(self.refuse(
            key,
            format!("{value} is not above zero"),
            format!("give a number above zero, as in `{example}`"),
        ))
    }

    /// Returns the list of finite numbers of a key; `None` if the key is absent.
    pub fn numbers(&self, key: &str) -> Result<Option<Vec<f64>>> {
        let example = format!("{key} = [0.0, 5.0]");
        let Some(values) = self.array(key, "a list of numbers", &example)? else { return Ok(None) };
        let found = values.iter().map(|value| {
            finite(value.get_ref()).ok_or_else(|| self.wrong_type(key, value.get_ref(), "finite numbers", &example))
        });
        found.collect::<Result<_>>().map(Some)
    }

    /// Returns the list of intervals `[start, end]` of a key, with start ≤ end; `None` if the key is absent.
    pub fn intervals(&self, key: &str) -> Result<Option<Vec<[f64; 2]>>> {
        self.pairs_that(key, "a pair of numbers with the smaller first", |[from, to]| from <= to)
    }

    /// Returns the list of pairs of finite numbers of a key; `None` if the key is absent.
    pub fn pairs(&self, key: &str) -> Result<Option<Vec<[f64; 2]>>> {
        self.pairs_that(key, "a pair of numbers", |_| true)
    }

    fn pairs_that(&self, key: &str, wanted: &str, is_valid: fn(&[f64; 2]) -> bool) -> Result<Option<Vec<[f64; 2]>>> {
        let example = format!("{key} = [[1.0, 2.5], [30.0, 31.0]]");
        let Some(values) = self.array(key, "a list of pairs of numbers", &example)? else { return Ok(None) };
        let pair = |value: &DeValue<'_>| {
            let DeValue::Array(ends) = value else { return None };
            let ends: Vec<f64> = ends.iter().map(|end| finite(end.get_ref())).collect::<Option<_>>()?;
            <[f64; 2]>::try_from(ends).ok().filter(is_valid)
        };
        let found = values.iter().map(|value| {
            let refusal = || self.refuse(key, format!("an entry is not {wanted}"), format!("write `{example}`"));
            pair(value.get_ref()).ok_or_else(refusal)
        });
        found.collect::<Result<_>>().map(Some)
    }

    /// Returns the list of integers of at least 1 of a key; `None` if the key is absent.
    pub fn counts(&self, key: &str) -> Result<Option<Vec<u32>>> {
        let example = format!("{key} = [1, 2]");
        let Some(values) = self.array(key, "a list of cycle numbers", &example)? else { return Ok(None) };
        let count = |value: &DeValue<'_>| match value {
            DeValue::Integer(integer) if integer.radix() == 10 => {
                integer.as_str().parse::<u32>().ok().filter(|count| *count >= 1)
            }
            _ => None,
        };
        values
            .iter()
            .map(|value| {
                count(value.get_ref()).ok_or_else(|| {
                    self.refuse(key, "an entry is not a whole number from 1 upwards", format!("write `{example}`"))
                })
            })
            .collect::<Result<_>>()
            .map(Some)
    }

    /// Returns the list of texts of a key; `None` if the key is absent.
    pub fn texts(&self, key: &str) -> Result<Option<Vec<String>>> {
        let example = format!("{key} = [\"…\"]");
        let Some(values) = self.array(key, "a list of texts", &example)? else { return Ok(None) };
        values
            .iter()
            .map(|value| match value.get_ref().as_str() {
                Some(text) => Ok(text.to_string()),
                None => Err(self.wrong_type(key, value.get_ref(), "text in the list", &example)),
            })
            .collect::<Result<_>>()
            .map(Some)
    }

    fn array(&self, key: &str, wanted: &str, example: &str) -> Result<Option<&'a [Spanned<DeValue<'a>>]>> {
        let Some((_, value)) = self.entry(key) else { return Ok(None) };
        match value.get_ref().as_array() {
            Some(values) => Ok(Some(values)),
            None => Err(self.wrong_type(key, value.get_ref(), wanted, example)),
        }
    }

    /// Returns the tables in the list of a key that must be present. `example` is a line that would be accepted.
    pub fn tables(&self, key: &str, example: &str) -> Result<Vec<TomlTable<'a>>> {
        let Some(values) = self.array(key, "a list of tables", example)? else {
            return Err(self.missing(key, example));
        };
        let document = self.document;
        let table = |value: &'a Spanned<DeValue<'a>>| match value.get_ref().as_table() {
            Some(table) => Ok(TomlTable { document, table, line: line_of(document.text, value.span().start) }),
            None => Err(self.wrong_type(key, value.get_ref(), "a table in the list", example)),
        };
        values.iter().map(table).collect()
    }

    /// Returns the nested table of a key; `None` if the key is absent.
    pub fn table(&self, key: &str) -> Result<Option<TomlTable<'a>>> {
        let Some((span, value)) = self.entry(key) else { return Ok(None) };
        match value.get_ref().as_table() {
            Some(table) => {
                let line = line_of(self.document.text, span.start);
                Ok(Some(TomlTable { document: self.document, table, line }))
            }
            None => Err(self.wrong_type(key, value.get_ref(), "a table", &format!("[{}]", self.full_key(key)))),
        }
    }

    /// Returns the nested table of a key that must be present.
    pub fn required_table(&self, key: &str) -> Result<TomlTable<'a>> {
        self.table(key)?.ok_or_else(|| self.missing(key, &format!("[{}]", self.full_key(key))))
    }
}
/// Converts an integer or a float to a finite number; `None` for other values.
fn finite(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Float(float) => float.as_str().parse::<f64>().ok().filter(|number| number.is_finite()),
        DeValue::Integer(integer) if integer.radix() == 10 => integer.as_str().parse::<f64>().ok(),
        _ => None,
    }
}
