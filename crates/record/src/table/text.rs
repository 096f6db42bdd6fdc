//! Decoding of a table's bytes to text, splitting of lines into cells, and parsing of numbers.

use std::borrow::Cow;

/// Number of bytes in which zero bytes are counted to detect UTF-16.
const LOOKED_AT: usize = 4096;

base::named_enum! {
    /// Character between two cells. The order is that in which delimiters are tried.
    pub enum Delimiter {
        /// A tab.
        Tab = "tab",
        /// `;`
        Semicolon = ";",
        /// `,`
        Comma = ",",
        /// One or more blanks or tabs.
        Spaces = "spaces",
    }
    /// Name of the delimiter in `experiment.toml`.
    pub fn name
}

base::named_enum! {
    /// Character before the decimals of a number.
    pub enum Decimal {
        /// `1.5`
        Point = ".",
        /// `1,5`
        Comma = ",",
    }
    /// Name of the decimal sign in `experiment.toml`.
    pub fn name
}

impl Decimal {
    /// Returns the number in a cell; `None` if the cell does not contain a finite number. The minus may be typeset (U+2212), and thousands may be
    /// separated (`4 600`, `4'600`).
    pub fn number(self, cell: &str) -> Option<f64> {
        let cell = &*plain(cell)?;
        // Fortran writes double precision as `1.5D-3`.
        let cell = &*match cell.find(['D', 'd']) {
            Some(place) if place > 0 => Cow::Owned(format!("{}E{}", &cell[..place], &cell[place + 1..])),
            _ => Cow::Borrowed(cell),
        };
        let number = match self {
            Self::Point if cell.contains(',') => Cow::Owned(without_groups(cell, ',', '.')?),
            Self::Point => Cow::Borrowed(cell),
            Self::Comma if cell.contains('.') => Cow::Owned(without_groups(cell, '.', ',')?.replacen(',', ".", 1)),
            Self::Comma => Cow::Owned(cell.replacen(',', ".", 1)),
        };
        let is_written_out = number.chars().all(|c| c.is_ascii_digit() || "+-.eE".contains(c));
        number.parse().ok().filter(|number: &f64| is_written_out && number.is_finite())
    }
}

/// Characters that typeset tables and word processors use for a minus.
const MINUS: [char; 3] = ['\u{2212}', '\u{2013}', '\u{2012}'];
/// Thousands separators that cannot be decimal signs: spaces and apostrophes.
const APART: [char; 6] = [' ', '\u{a0}', '\u{202f}', '\u{2009}', '\'', '\u{2019}'];

/// Returns the text of a number with an ASCII minus and without spaces or apostrophes as thousands separators; `None` if a thousands separator is
/// misplaced.
fn plain(cell: &str) -> Option<Cow<'_, str>> {
    let has = |signs: &[char]| cell.contains(signs);
    if !has(&MINUS) && !has(&APART) {
        return Some(Cow::Borrowed(cell));
    }
    let mut text = cell.replace(MINUS, "-");
    if let Some(sign) = APART.into_iter().find(|sign| text.contains(*sign)) {
        let end = text.find(['.', ',']).unwrap_or(text.len());
        text = format!("{}{}", joined_groups(&text[..end], sign)?, &text[end..]);
    }
    Some(Cow::Owned(text))
}

/// Removes the separators `between` from a whole number such as `-1'234'567`. Returns `None` if its groups do not have three digits.
fn joined_groups(whole: &str, between: char) -> Option<String> {
    let mut groups = whole.trim_start_matches(['+', '-']).split(between);
    let first = groups.next()?;
    let are_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let is_first = (1..=3).contains(&first.len()) && are_digits(first) && !first.starts_with('0');
    (is_first && groups.all(|group| group.len() == 3 && are_digits(group))).then(|| whole.replace(between, ""))
}

/// Removes the thousands separators from a number such as `1,234.5`. Returns `None` without decimals, because the comma in `1,234` alone may be a decimal sign.
fn without_groups(cell: &str, between: char, before_decimals: char) -> Option<String> {
    let (whole, decimals) = cell.split_once(before_decimals)?;
    let whole = joined_groups(whole, between)?;
    (!decimals.contains(between)).then(|| format!("{whole}{before_decimals}{decimals}"))
}

base::named_enum! {
    /// Thousands separator that could be mistaken for a decimal sign.
    pub enum Thousands {
        /// `1.234`
        Point = ".",
        /// `1,234`
        Comma = ",",
    }
    /// Name of the separator in `experiment.toml`.
    pub fn name
}

impl Thousands {
    fn sign(self) -> char {
        match self {
            Self::Point => '.',
            Self::Comma => ',',
        }
    }

    /// Removes the thousands separators from a cell. Returns `None` if a separator is misplaced.
    pub fn removed(self, cell: &str) -> Option<Cow<'_, str>> {
        let plain = plain(cell)?;
        if !plain.contains(self.sign()) {
            return Some(plain);
        }
        let decimal = if self == Self::Point { ',' } else { '.' };
        let end = plain.find(decimal).unwrap_or(plain.len());
        Some(Cow::Owned(format!("{}{}", joined_groups(&plain[..end], self.sign())?, &plain[end..])))
    }
}

base::named_enum! {
    /// Character encoding of a table.
    pub enum Encoding {
        /// UTF-8 with or without a byte order mark.
        Utf8 = "utf-8",
        /// UTF-16, little-endian.
        Utf16Little = "utf-16-le",
        /// UTF-16, big-endian.
        Utf16Big = "utf-16-be",
        /// Latin-1: one byte for each character. Instruments use it for µ and °.
        Latin1 = "latin-1",
    }
    /// Name of the encoding in `experiment.toml`.
    pub fn name
}

impl Encoding {
    /// Detects the encoding of a table from its bytes. UTF-16 shows in a byte order mark, or in zero bytes beside digits. Other text is UTF-8 if it
    /// is valid, and Latin-1 otherwise.
    pub fn of(bytes: &[u8]) -> Self {
        match bytes {
            [0xff, 0xfe, ..] => return Self::Utf16Little,
            [0xfe, 0xff, ..] => return Self::Utf16Big,
            _ => {}
        }
        let start = &bytes[..bytes.len().min(LOOKED_AT)];
        let zeros = |first: usize| start.iter().skip(first).step_by(2).filter(|byte| **byte == 0).count();
        let many = start.len() / 3;
        if many > 0 && zeros(1) > many {
            return Self::Utf16Little;
        }
        if many > 0 && zeros(0) > many {
            return Self::Utf16Big;
        }
        if std::str::from_utf8(bytes).is_ok() { Self::Utf8 } else { Self::Latin1 }
    }

    /// Decodes bytes to text with line feeds and without the byte order mark. Returns `None` if the encoding is UTF-8 but the bytes are not valid UTF-8.
    pub fn text(self, bytes: &[u8]) -> Option<Cow<'_, str>> {
        let text = self.decoded(bytes)?;
        // Old instruments end lines with a carriage return only.
        let has_lone_returns = text.contains('\r') && !text.contains('\n');
        Some(if has_lone_returns { Cow::Owned(text.replace('\r', "\n")) } else { text })
    }

    fn decoded(self, bytes: &[u8]) -> Option<Cow<'_, str>> {
        let utf16 = |unit: fn([u8; 2]) -> u16| {
            let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
            let text: String = char::decode_utf16(units).map(|c| c.unwrap_or('\u{fffd}')).collect();
            Some(Cow::Owned(text.strip_prefix('\u{feff}').map(String::from).unwrap_or(text)))
        };
        match self {
            Self::Utf16Little => utf16(u16::from_le_bytes),
            Self::Utf16Big => utf16(u16::from_be_bytes),
            Self::Utf8 => {
                std::str::from_utf8(bytes).ok().map(|text| text.strip_prefix('\u{feff}').unwrap_or(text).into())
            }
            Self::Latin1 => Some(Cow::Owned(bytes.iter().map(|byte| char::from(*byte)).collect())),
        }
    }
}

/// Decodes a table, with the encoding detected from its bytes.
pub fn decode_detected(bytes: &[u8]) -> Cow<'_, str> {
    Encoding::of(bytes).text(bytes).unwrap_or_else(|| String::from_utf8_lossy(bytes))
}

/// Characters that begin a comment line by default.
const COMMENTS: [&str; 3] = ["#", "%", "//"];

/// Returns the characters that make a line a comment, such as `#`; `None` if the line is not a comment. If `comment` is given, only these characters
/// count.
pub fn comment_sign<'a>(line: &str, comment: Option<&'a str>) -> Option<&'a str> {
    let line = line.trim_start();
    match comment {
        Some(sign) => line.starts_with(sign).then_some(sign),
        None => COMMENTS.into_iter().find(|sign| line.starts_with(sign)),
    }
}

/// True if a line is blank, a comment, or the row of a point that an instrument calls invalid.
pub fn is_blank_or_comment(line: &str, comment: Option<&str>) -> bool {
    line.trim().is_empty() || comment_sign(line, comment).is_some() || is_invalid_point(line)
}

/// True if a line only holds the number of a point and a word in brackets, such as `12 (invalid)`.
pub(super) fn is_invalid_point(line: &str) -> bool {
    let whole = line.trim_matches([' ', '\t', ',', ';', '"', '\r']);
    let behind = whole.trim_start_matches(|c: char| c.is_ascii_digit());
    let word = behind.trim_start().strip_prefix('(').and_then(|rest| rest.strip_suffix(')'));
    behind.len() < whole.len() && word.is_some_and(|word| !word.is_empty() && word.chars().all(char::is_alphabetic))
}

/// Splits a line into cells and removes surrounding spaces and quotation marks.
pub fn cells(line: &str, delimiter: Delimiter) -> Vec<Cow<'_, str>> {
    let byte = match delimiter {
        Delimiter::Comma => b',',
        Delimiter::Semicolon => b';',
        Delimiter::Tab => b'\t',
        Delimiter::Spaces => return cells_between_spaces(line),
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

/// Cells between spaces, without quotation marks around one or several of them. A mark that closes none belongs to the cell, as in `G"`.
fn cells_between_spaces(line: &str) -> Vec<Cow<'_, str>> {
    let mut is_open = false;
    let cell = |text| {
        let inner = str::strip_prefix(text, '"');
        is_open |= inner.is_some();
        let text = inner.unwrap_or(text);
        let closed = text.strip_suffix('"').filter(|_| is_open);
        is_open &= closed.is_none();
        closed.unwrap_or(text).into()
    };
    line.split_whitespace().map(cell).collect()
}

/// Largest number of lines that one line of column names takes because its cells contain line breaks.
const MOST_BROKEN: usize = 40;

/// Returns lines with their indices. Lines of a cell in quotation marks that contains line breaks are joined by blanks and have the index of the first one.
pub(super) fn whole_lines<'a>(lines: &[&'a str], delimiter: Delimiter) -> Vec<(usize, Cow<'a, str>)> {
    let mut whole = Vec::new();
    let mut rest = 0;
    while rest < lines.len() {
        let n_lines = n_broken(&lines[rest..], delimiter);
        let text = match n_lines {
            1 => Cow::Borrowed(lines[rest]),
            _ => lines[rest..rest + n_lines].iter().map(|line| line.trim()).collect::<Vec<_>>().join(" ").into(),
        };
        whole.push((rest, text));
        rest += n_lines;
    }
    whole
}

/// Number of lines, from the first one on, up to the end of the cells that begin in it; 1 if a quotation mark closes nowhere.
fn n_broken(lines: &[&str], delimiter: Delimiter) -> usize {
    let between = match delimiter {
        Delimiter::Comma => ',',
        Delimiter::Semicolon => ';',
        Delimiter::Tab => '\t',
        Delimiter::Spaces => return 1,
    };
    // A quotation mark opens a cell at its start only. Two marks within a cell are one of its characters.
    let (mut is_open, mut may_open) = (false, true);
    for (place, line) in lines.iter().enumerate().take(MOST_BROKEN) {
        for c in line.chars() {
            match c {
                '"' if is_open || may_open => (is_open, may_open) = (!is_open, true),
                ' ' if may_open => {}
                _ if !is_open => may_open = c == between,
                _ => {}
            }
        }
        if !is_open {
            return place + 1;
        }
    }
    1
}

/// Key of the comment that names the columns.
pub const COLUMNS: &str = "columns";

/// Lower-case names of columns that contain comments instead of numbers.
pub(super) const REMARKS: [&str; 6] = ["", "comment", "comments", "note", "notes", "remarks"];

/// Number of cells before the names of the columns, for which the rows have no cells. They are empty, or one of them is a title such as `Interval data:`.
pub(super) fn n_before_names(names: &[Cow<'_, str>], n_cells: usize) -> usize {
    let n_more = names.len().saturating_sub(n_cells);
    let is_title = |name: &Cow<'_, str>| name.ends_with(':');
    let has_remark = names.last().is_some_and(|last| REMARKS.contains(&last.to_lowercase().as_str()));
    let has_title =
        n_more == 1 && !has_remark && names.iter().position(is_title) == Some(0) && !names[1..].iter().any(is_title);
    if has_title || names[..n_more].iter().all(|name| name.is_empty()) { n_more } else { 0 }
}

/// Splits a header into column names and removes a leading comment sign. The rows below the header have `n_cells` cells.
///
/// If spaces separate the cells, names may contain single spaces. In this case at least two spaces must separate the names, or each name must end in
/// a unit in brackets.
pub fn header_cells<'a>(
    whole: &'a str,
    delimiter: Delimiter,
    comment: Option<&str>,
    n_cells: usize,
) -> Vec<Cow<'a, str>> {
    let mut line = whole.trim_start();
    while let Some(sign) = comment_sign(line, comment) {
        line = line[sign.len()..].trim_start();
    }
    // Exports of JPK name the columns in a comment `# columns: …`.
    if line.len() < whole.trim_start().len()
        && let Some((key, names)) = line.split_once(':')
        && key == COLUMNS
    {
        line = names;
    }
    if comment_sign(whole, comment).is_none() {
        // The first column may have no name, so its line may begin with a tab.
        let mut with_empty = cells(whole, delimiter);
        with_empty.drain(..n_before_names(&with_empty, n_cells));
        if with_empty.len() == n_cells || delimiter != Delimiter::Spaces {
            return with_empty;
        }
    }
    let by_each_blank = cells(line, delimiter);
    if delimiter != Delimiter::Spaces || by_each_blank.len() == n_cells {
        return by_each_blank;
    }
    let named = |cells: Vec<&'a str>| -> Vec<Cow<'a, str>> {
        let cells = cells.into_iter().map(|cell| cell.trim().trim_matches('"'));
        cells.filter(|cell| !cell.is_empty()).map(Cow::Borrowed).collect()
    };
    let by_wide_blanks = named(line.split("  ").flat_map(|part| part.split('\t')).collect());
    let by_brackets = named(line.split_inclusive([']', ')']).collect());
    if let Some(names) = [by_wide_blanks, by_brackets].into_iter().find(|names| names.len() == n_cells) {
        return names;
    }
    // R's `write.table` numbers the rows in a column without a name.
    if by_each_blank.len() + 1 == n_cells {
        return std::iter::once(Cow::Borrowed("")).chain(by_each_blank).collect();
    }
    by_each_blank
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
            assert_eq!(decode_detected(&bytes), text, "{bytes:?}");
        }
    }

    #[test]
    fn lines_may_end_in_a_carriage_return_alone() {
        assert_eq!(decode_detected(b"t,x\r0,1\r"), "t,x\n0,1\n");
        assert_eq!(decode_detected(b"t,x\r\n0,1\r\n"), "t,x\r\n0,1\r\n");
    }

    #[test]
    fn a_said_encoding_is_taken_or_refused() {
        assert_eq!(Encoding::Latin1.text(b"\xb5m").unwrap(), "µm");
        assert_eq!(Encoding::Utf8.text(b"\xb5m"), None);
        assert_eq!(Encoding::Utf16Big.text(b"\0a\0b").unwrap(), "ab");
    }

    #[test]
    fn names_between_blanks_may_hold_blanks() {
        let names = ["Time [s]", "Force [uN]", "Position [um]"];
        let spaces = |line| header_cells(line, Delimiter::Spaces, None, 3);
        for line in [
            "Time [s]  Force [uN]  Position [um]",
            "# Time [s]   Force [uN] \t Position [um] ",
            "Time [s] Force [uN] Position [um]",
        ] {
            assert_eq!(spaces(line), names, "{line}");
        }
        assert_eq!(spaces("t F x"), ["t", "F", "x"]);
        assert_eq!(spaces("elapsed time  F  x"), ["elapsed time", "F", "x"]);
        assert_eq!(header_cells("! t x", Delimiter::Spaces, Some("!"), 2), ["t", "x"]);
        assert_eq!(spaces("# columns: seriesTime vDeflection height"), ["seriesTime", "vDeflection", "height"]);
        assert_eq!(spaces("\"time_s\" \"force_uN\""), ["", "time_s", "force_uN"]);
        assert_eq!(header_cells("\t[s]\t[Pa]", Delimiter::Tab, None, 3), ["", "[s]", "[Pa]"]);
    }

    #[test]
    fn a_named_comment_sign_is_the_only_one() {
        assert!(
            is_blank_or_comment(" # a", None)
                && is_blank_or_comment("// a", None)
                && is_blank_or_comment(" ", Some("!"))
        );
        assert!(
            is_blank_or_comment("! a", Some("!"))
                && !is_blank_or_comment("# a", Some("!"))
                && !is_blank_or_comment("! a", None)
        );
    }

    #[test]
    fn numbers_are_those_of_their_decimal_sign() {
        assert_eq!(Decimal::Comma.number("-1,5e-3"), Some(-1.5e-3));
        assert_eq!(Decimal::Point.number("1.5"), Some(1.5));
        assert_eq!(Decimal::Point.number("-1.5D-03"), Some(-1.5e-3));
        assert_eq!(Decimal::Point.number("-4,600.25"), Some(-4600.25));
        assert_eq!(Decimal::Comma.number("1.234.567,5"), Some(1_234_567.5));
        assert_eq!(Decimal::Point.number("\u{2212}4.6"), Some(-4.6));
        assert_eq!(Decimal::Point.number("\u{2013}4'600.5"), Some(-4600.5));
        assert_eq!(Decimal::Comma.number("12\u{a0}345,5"), Some(12_345.5));
        assert_eq!(Thousands::Point.removed("-1.078").as_deref(), Some("-1078"));
        assert_eq!(Thousands::Comma.removed("1,234.5").as_deref(), Some("1234.5"));
        for cell in ["0.123", "12.34", "1234.567"] {
            assert_eq!(Thousands::Point.removed(cell), None, "{cell}");
        }
        for (decimal, cell) in [
            (Decimal::Comma, "1.5"),
            (Decimal::Comma, "1.234"),
            (Decimal::Point, "1,5"),
            (Decimal::Point, "1,234"),
            (Decimal::Point, "0,123.5"),
            (Decimal::Point, "1,23.5"),
            (Decimal::Point, "1.5,000"),
            (Decimal::Comma, "1,234,5"),
            (Decimal::Point, "inf"),
            (Decimal::Point, "nan"),
            (Decimal::Point, "1 2"),
            (Decimal::Point, "12 34.5"),
            (Decimal::Point, "4-600"),
            (Decimal::Point, "D-03"),
            (Decimal::Point, "1.5d"),
            (Decimal::Point, ""),
        ] {
            assert_eq!(decimal.number(cell), None, "{cell}");
        }
    }

    #[test]
    fn quoted_cells_may_hold_line_breaks() {
        let joined = |lines: &[&str]| {
            let whole = whole_lines(lines, Delimiter::Comma);
            whole.into_iter().map(|(index, line)| (index, line.into_owned())).collect::<Vec<_>>()
        };
        let line = |index: usize, text: &str| (index, text.to_string());
        assert_eq!(
            joined(&["a", "\"t", "(s)\",\"x \"\"1\"\"", "(um)\"", "0,1"]),
            [line(0, "a"), line(1, "\"t (s)\",\"x \"\"1\"\" (um)\""), line(4, "0,1")]
        );
        // A mark within a cell is an inch or a loss modulus, and one that closes nowhere is a character.
        for lines in [["5\" tip,G\"", "0,1"], ["\"t,x", "0,1"]] {
            assert_eq!(joined(&lines).len(), 2, "{lines:?}");
        }
    }

    #[test]
    fn quoted_cells_may_hold_the_delimiter() {
        assert_eq!(cells("\"a; b\"; c", Delimiter::Semicolon), ["a; b", "c"]);
        assert_eq!(cells(" 1   2\t3 ", Delimiter::Spaces), ["1", "2", "3"]);
        assert_eq!(cells("1,,3", Delimiter::Comma), ["1", "", "3"]);
    }
}
