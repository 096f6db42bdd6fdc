//! A table's bytes as text, its lines as cells, its cells as numbers.

use std::borrow::Cow;

/// Bytes that are looked at for an encoding.
const LOOKED_AT: usize = 4096;

/// What stands between two cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Delimiter {
    /// `,`
    Comma,
    /// `;`
    Semicolon,
    /// A tabulator.
    Tab,
    /// One blank or more; tabulators count.
    Spaces,
}

impl Delimiter {
    /// All, in the order in which they are tried.
    pub const ALL: [Self; 4] = [Self::Tab, Self::Semicolon, Self::Comma, Self::Spaces];

    /// Name in `experiment.toml`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Comma => ",",
            Self::Semicolon => ";",
            Self::Tab => "tab",
            Self::Spaces => "spaces",
        }
    }
}

/// What stands before the decimals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Decimal {
    /// `1.5`
    Point,
    /// `1,5`
    Comma,
}

impl Decimal {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Point, Self::Comma];

    /// Name in `experiment.toml`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Point => ".",
            Self::Comma => ",",
        }
    }

    /// The number that a cell holds, if it is one; not finite ones are none.
    pub fn number(self, cell: &str) -> Option<f64> {
        let plain = match self {
            Self::Point => Cow::Borrowed(cell),
            Self::Comma if cell.contains('.') => return None,
            Self::Comma => Cow::Owned(cell.replacen(',', ".", 1)),
        };
        let is_written_out = plain.chars().all(|c| c.is_ascii_digit() || "+-.eE".contains(c));
        plain.parse().ok().filter(|number: &f64| is_written_out && number.is_finite())
    }
}

/// Text of a table: UTF-8, UTF-16 with its mark or without, or else Latin-1, in which instruments write µ and °.
pub fn table_text(bytes: &[u8]) -> Cow<'_, str> {
    let utf16 = |bytes: &[u8], unit: fn([u8; 2]) -> u16| {
        let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
        Cow::Owned(char::decode_utf16(units).map(|c| c.unwrap_or('\u{fffd}')).collect())
    };
    match bytes {
        [0xff, 0xfe, rest @ ..] => return utf16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => return utf16(rest, u16::from_be_bytes),
        _ => {}
    }
    // Digits in UTF-16 have a zero byte on one side.
    let start = &bytes[..bytes.len().min(LOOKED_AT)];
    let zeros = |first: usize| start.iter().skip(first).step_by(2).filter(|byte| **byte == 0).count();
    let many = start.len() / 3;
    if many > 0 && zeros(1) > many {
        return utf16(bytes, u16::from_le_bytes);
    }
    if many > 0 && zeros(0) > many {
        return utf16(bytes, u16::from_be_bytes);
    }
    match std::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text.strip_prefix('\u{feff}').unwrap_or(text)),
        Err(_) => Cow::Owned(bytes.iter().map(|byte| char::from(*byte)).collect()),
    }
}

/// Whether a line says nothing of the table: blank, or a comment.
pub fn is_aside(line: &str) -> bool {
    let line = line.trim();
    line.is_empty() || line.starts_with(['#', '%']) || line.starts_with("//")
}

/// The cells of a line, without blanks around them and without their quotation marks.
pub fn cells(line: &str, delimiter: Delimiter) -> Vec<Cow<'_, str>> {
    let byte = match delimiter {
        Delimiter::Comma => b',',
        Delimiter::Semicolon => b';',
        Delimiter::Tab => b'\t',
        Delimiter::Spaces => return line.split_whitespace().map(|cell| cell.trim_matches('"').into()).collect(),
    };
    if !line.contains('"') {
        return line.split(char::from(byte)).map(|cell| cell.trim().into()).collect();
    }
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .delimiter(byte)
        .from_reader(line.as_bytes());
    let row = reader.records().next().and_then(Result::ok).unwrap_or_default();
    row.iter().map(|cell| Cow::Owned(cell.to_string())).collect()
}

/// The cells of a header; a comment sign before it is none of them.
pub fn header_cells(line: &str, delimiter: Delimiter) -> Vec<Cow<'_, str>> {
    cells(line.trim_start().trim_start_matches(['#', '%', '/']), delimiter)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_encoding_of_a_micrometre_is_read() {
        let text = "t [s];x [µm]\r\n0,5;1,25\r\n";
        let utf16 = |mark: bool, bytes: fn(u16) -> [u8; 2]| -> Vec<u8> {
            let units = mark.then_some(0xfeff).into_iter().chain(text.encode_utf16());
            units.flat_map(bytes).collect()
        };
        let latin: Vec<u8> = text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
        let marked = [b"\xef\xbb\xbf", text.as_bytes()].concat();
        let all = [text.as_bytes().to_vec(), marked, latin]
            .into_iter()
            .chain([true, false].map(|mark| utf16(mark, u16::to_le_bytes)))
            .chain([true, false].map(|mark| utf16(mark, u16::to_be_bytes)));
        for bytes in all {
            assert_eq!(table_text(&bytes), text, "{bytes:?}");
        }
    }

    #[test]
    fn numbers_are_those_of_their_decimal_sign() {
        assert_eq!(Decimal::Comma.number("-1,5e-3"), Some(-1.5e-3));
        assert_eq!(Decimal::Point.number("1.5"), Some(1.5));
        for (decimal, cell) in [
            (Decimal::Comma, "1.5"),
            (Decimal::Point, "1,5"),
            (Decimal::Comma, "1,234,5"),
            (Decimal::Point, "inf"),
            (Decimal::Point, "nan"),
            (Decimal::Point, ""),
        ] {
            assert_eq!(decimal.number(cell), None, "{cell}");
        }
    }

    #[test]
    fn quoted_cells_may_hold_the_delimiter() {
        assert_eq!(cells("\"a; b\"; c", Delimiter::Semicolon), ["a; b", "c"]);
        assert_eq!(cells(" 1   2\t3 ", Delimiter::Spaces), ["1", "2", "3"]);
        assert_eq!(cells("1,,3", Delimiter::Comma), ["1", "", "3"]);
    }
}
