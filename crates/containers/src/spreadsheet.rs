//! Workbooks: Excel (.xlsx, .xlsm) and OpenDocument (.ods).
//!
//! Old Excel workbooks (.xls) are refused: a damaged one makes the parser request more memory than any machine has.

use std::collections::BTreeMap;
use std::io::{Cursor, Read};

use calamine::{Data, DataType, ExcelDateTime, Ods, Reader, Xlsx};

use crate::arrays::{FEWEST_ROWS, MOST_VALUES};
use crate::percent::percent_cells;
use crate::refused::{IS_ZIP, zip_entries};
use crate::table_text::{TableText, number};

/// Largest size of a workbook's parts after decompression, in bytes.
const MOST_BYTES: u64 = 2 << 30;

/// Reason for which a sheet of an OpenDocument workbook is not read.
const IN_PERCENT: &str =
    "it has cells in percent, which are read from .xlsx workbooks only; save it as one, or show these cells as numbers";

pub fn recognises(bytes: &[u8]) -> bool {
    let is_workbook = |name: &String| name.starts_with("xl/workbook.xml") || name == "content.xml";
    bytes.starts_with(IS_ZIP) && zip_entries(bytes).0.iter().any(is_workbook)
}

pub fn read(bytes: &[u8]) -> Result<TableText, String> {
    let (entries, n_bytes) = zip_entries(bytes);
    if n_bytes > MOST_BYTES {
        return Err("its parts take more than 2 GiB after decompression".into());
    }
    let mut tables = TableText::default();
    let mut n_cells = 0;
    let mut add = |name: &str, sheet: Result<Sheet, String>| match sheet {
        Ok(sheet) => {
            n_cells += sheet.values().map(BTreeMap::len).sum::<usize>();
            write(name, &sheet, &mut tables);
        }
        Err(why) => tables.notes.push(format!("sheet `{name}` is not read: {why}")),
    };
    if entries.iter().any(|name| name == "content.xml") {
        let in_percent = sheets_in_percent(bytes);
        let mut workbook = Ods::new(Cursor::new(bytes)).map_err(|error| error.to_string())?;
        for name in workbook.sheet_names() {
            let range = workbook.worksheet_range(&name).map_err(|error| error.to_string());
            let sheet = |range: calamine::Range<Data>| {
                let mut sheet = Sheet::new();
                for (row, column, value) in range.used_cells() {
                    sheet.entry(row).or_default().insert(column, text_of(value));
                }
                sheet
            };
            let is_shown = in_percent.contains(&name);
            add(&name, if is_shown { Err(IN_PERCENT.into()) } else { range.map(sheet) });
        }
    } else {
        let mut workbook = Xlsx::new(Cursor::new(bytes)).map_err(|error| error.to_string())?;
        let in_percent = percent_cells(bytes);
        for name in workbook.sheet_names() {
            let shown = in_percent.get(&name);
            let sheet = excel_sheet(&mut workbook, &name, |row, column| {
                shown.is_some_and(|cells| cells.contains(&reference(row, column)))
            });
            add(&name, sheet);
        }
    }
    if n_cells > MOST_VALUES {
        return Err(format!("it has more than {MOST_VALUES} cells"));
    }
    Ok(tables)
}

/// Texts of a sheet's cells by row and column.
type Sheet = BTreeMap<usize, BTreeMap<usize, String>>;

/// Names of the sheets of an OpenDocument workbook that have cells in percent.
fn sheets_in_percent(bytes: &[u8]) -> Vec<String> {
    let mut text = String::new();
    let mut read = || {
        let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).ok()?;
        archive.by_name("content.xml").ok()?.read_to_string(&mut text).ok()
    };
    if read().is_none() {
        return Vec::new();
    }
    let sheets = text.split("<table:table ").skip(1).filter(|sheet| sheet.contains("office:value-type=\"percentage\""));
    let name = |sheet: &str| Some(sheet.split_once("table:name=\"")?.1.split_once('"')?.0.to_string());
    sheets.filter_map(name).collect()
}

/// Reference of a cell, such as `B7`, from its row and column, both counted from 0.
fn reference(row: u32, column: u32) -> String {
    let (mut letters, mut left) = (String::new(), column + 1);
    while left > 0 {
        letters.insert(0, char::from(b'A' + ((left - 1) % 26) as u8));
        left = (left - 1) / 26;
    }
    format!("{letters}{}", row + 1)
}

/// Reads the cells of a sheet one by one. A table of all cells would take terabytes if a single cell stands in the last row and column. Columns of numbers that are all shown
/// in percent get the numbers that the sheet shows.
fn excel_sheet(
    workbook: &mut Xlsx<Cursor<&[u8]>>,
    name: &str,
    is_in_percent: impl Fn(u32, u32) -> bool,
) -> Result<Sheet, String> {
    let mut sheet = Sheet::new();
    // Rows and values of each column of which every number is in percent; `None` for other columns.
    let mut in_percent: BTreeMap<u32, Option<Vec<(u32, f64)>>> = BTreeMap::new();
    let mut cells = workbook.worksheet_cells_reader(name).map_err(|error| error.to_string())?;
    while let Some(cell) = cells.next_cell().map_err(|error| error.to_string())? {
        let (row, column) = cell.get_position();
        let value = Data::from(cell.get_value().clone());
        if let Data::Int(_) | Data::Float(_) = value {
            let values = in_percent.entry(column).or_insert(Some(Vec::new()));
            match values {
                Some(values) if is_in_percent(row, column) => values.push((row, value.as_f64().unwrap_or(f64::NAN))),
                _ => *values = None,
            }
        }
        if value != Data::Empty {
            sheet.entry(row as usize).or_default().insert(column as usize, text_of(&value));
        }
    }
    for (column, values) in in_percent {
        let Some(values) = values.filter(|values| values.len() >= FEWEST_ROWS) else { continue };
        show_percent(&mut sheet, column as usize, &values);
    }
    Ok(sheet)
}

/// Names of a plain number as a unit.
const PLAIN: [&str; 7] = ["-", "1", "mm/mm", "m/m", "[-]", "(-)", "[mm/mm]"];

/// Writes the values of a column as they are shown in percent, if the text above them says so or states no unit; then it states the percent. `values` are rows and values.
fn show_percent(sheet: &mut Sheet, column: usize, values: &[(u32, f64)]) {
    let above = (values[0].0 as usize).checked_sub(1);
    let Some(name) = above.and_then(|row| sheet.get_mut(&row)?.get_mut(&column)) else { return };
    if PLAIN.contains(&name.trim()) {
        *name = "%".into();
    } else if !name.contains(['%', '(', '[']) {
        name.push_str(" (%)");
    } else if !name.contains('%') {
        return;
    }
    for (row, value) in values {
        sheet.entry(*row as usize).or_default().insert(column, number(hundredfold(*value)));
    }
}

fn write(name: &str, sheet: &Sheet, tables: &mut TableText) {
    let Some(first) = sheet.values().filter_map(|row| row.keys().next()).min() else { return };
    let mut n_values: BTreeMap<usize, usize> = BTreeMap::new();
    for column in sheet.values().flat_map(BTreeMap::keys) {
        *n_values.entry(*column).or_default() += 1;
    }
    // Tables end at the last column with several values. A cell to the right of it belongs to its row alone.
    let width = n_values.iter().rev().find(|(_, n)| **n >= FEWEST_ROWS).map_or(*first, |(column, _)| *column);
    tables.title(&format!("sheet {name}"));
    let mut before = None;
    for (row, cells) in sheet {
        if before.is_some_and(|before| before + 1 < *row) {
            tables.row([]);
        }
        before = Some(*row);
        let last = cells.keys().next_back().map_or(width, |last| width.max(*last));
        tables.row((*first..=last).map(|column| cells.get(&column).cloned().unwrap_or_default()));
    }
}

/// A hundred times a value, without the digits that the product adds.
fn hundredfold(value: f64) -> f64 {
    format!("{:.14e}", 100.0 * value).parse().unwrap_or(f64::NAN)
}

/// Text of a cell. An error value of a formula becomes an empty cell.
fn text_of(cell: &Data) -> String {
    match cell {
        Data::Int(value) => value.to_string(),
        Data::Float(value) => number(*value),
        Data::String(text) | Data::DateTimeIso(text) | Data::DurationIso(text) => text.clone(),
        Data::Bool(value) => u8::from(*value).to_string(),
        Data::DateTime(time) => date_or_clock(time),
        Data::Error(_) | Data::Empty => String::new(),
    }
}

/// Text of a date with its time, or of a time of day. Excel stores both as days.
fn date_or_clock(time: &ExcelDateTime) -> String {
    let days = time.as_f64();
    if time.is_duration() || (0.0..1.0).contains(&days) {
        // Microseconds are rounded first, so that no clock shows 60 seconds.
        let seconds = (86_400e6 * days).round() / 1e6;
        let (hours, minutes) = ((seconds / 3600.0).floor(), (seconds / 60.0).floor() % 60.0);
        return format!("{hours:02}:{minutes:02}:{:09.6}", seconds % 60.0);
    }
    let (year, month, day, hour, minute, second, milli) = time.to_ymd_hms_milli();
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{milli:03}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    /// A workbook of one sheet. Cells are texts, or numbers with `%` behind those in percent.
    fn workbook(rows: &[&[&str]]) -> Vec<u8> {
        let cell = |row: usize, column: usize, text: &str| {
            let at = reference(row as u32, column as u32);
            match (text.strip_suffix('%').and_then(|value| value.parse::<f64>().ok()), text.parse::<f64>()) {
                (Some(value), _) => format!("<c r=\"{at}\" s=\"1\"><v>{value}</v></c>"),
                (None, Ok(value)) => format!("<c r=\"{at}\" s=\"0\"><v>{value}</v></c>"),
                (None, Err(_)) => format!("<c r=\"{at}\" t=\"inlineStr\"><is><t>{text}</t></is></c>"),
            }
        };
        let row = |(number, cells): (usize, &&[&str])| {
            let cells: String = cells.iter().enumerate().map(|(column, text)| cell(number, column, text)).collect();
            format!("<row r=\"{}\">{cells}</row>", number + 1)
        };
        let rows: String = rows.iter().enumerate().map(row).collect();
        let sheet = format!("<worksheet><sheetData>{rows}</sheetData></worksheet>");
        let relation = |id: &str, kind: &str, target: &str| {
            let schema = "http://schemas.openxmlformats.org/officeDocument/2006/relationships";
            format!(
                "<Relationships><Relationship Id=\"{id}\" Type=\"{schema}/{kind}\" Target=\"{target}\"/></Relationships>"
            )
        };
        let parts = [
            ("_rels/.rels", relation("rId1", "officeDocument", "xl/workbook.xml")),
            (
                "xl/workbook.xml",
                "<workbook xmlns:r=\"http://schemas.openxmlformats.org/officeDocument/2006/relationships\"><sheets><sheet name=\"A &amp; B\" sheetId=\"1\" r:id=\"rId1\"/></sheets></workbook>".into(),
            ),
            ("xl/_rels/workbook.xml.rels", relation("rId1", "worksheet", "worksheets/sheet1.xml")),
            (
                "xl/styles.xml",
                "<styleSheet><cellXfs><xf numFmtId=\"0\"/><xf numFmtId=\"10\"/></cellXfs></styleSheet>".into(),
            ),
            ("xl/worksheets/sheet1.xml", sheet),
        ];
        let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
        for (name, text) in parts {
            archive.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
            archive.write_all(text.as_bytes()).unwrap();
        }
        archive.finish().unwrap().into_inner()
    }

    /// Columns of numbers that are all in percent hold what the sheet shows, unless their name has another unit.
    #[test]
    fn columns_in_percent_hold_what_is_shown() {
        let last = |rows: &[&[&str]]| read(&workbook(rows)).expect("a workbook").text;
        let text = last(&[&["t (s)", "Strain (%)"], &["0", "0.05%"], &["1", "0.1492%"], &["2", "0.2%"]]);
        assert!(text.contains("Strain (%)\n0\t5\n1\t14.92\n2\t20\n"), "{text}");
        let text = last(&[&["t (s)", "Strain"], &["0", "0.05%"], &["1", "0.1%"], &["2", "0.2%"], &["end", "of test"]]);
        assert!(text.contains("Strain (%)\n0\t5\n1\t10\n2\t20\n"), "{text}");
        let text = last(&[&["t", "Strain"], &["s", "-"], &["0", "0.05%"], &["1", "0.1%"], &["2", "0.2%"]]);
        assert!(text.contains("Strain\ns\t%\n0\t5\n1\t10\n2\t20\n"), "{text}");
        for rows in [
            [["t (s)", "Strain"], ["0", "0.05%"], ["1", "0.1"], ["2", "0.2%"]],
            [["t (s)", "Strain (mm/mm)"], ["0", "0.05%"], ["1", "0.1%"], ["2", "0.2%"]],
        ] {
            let text = last(&rows.each_ref().map(|row| &row[..]));
            assert!(text.contains("\n0\t0.05\n1\t0.1\n2\t0.2\n"), "{text}");
        }
    }
}
