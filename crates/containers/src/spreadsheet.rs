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
        if has_percent_cells(bytes) {
            return Err("it has cells in percent, whose values are not those that the sheet shows".into());
        }
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
            add(&name, range.map(sheet));
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

/// True if an OpenDocument workbook has cells in percent.
fn has_percent_cells(bytes: &[u8]) -> bool {
    let mut text = Vec::new();
    let mut read = || {
        let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).ok()?;
        archive.by_name("content.xml").ok()?.read_to_end(&mut text).ok()
    };
    read().is_some() && text.windows(WITH_PERCENT.len()).any(|window| window == WITH_PERCENT)
}

/// Attribute of OpenDocument cells in percent.
const WITH_PERCENT: &[u8] = b"office:value-type=\"percentage\"";

/// Reference of a cell, such as `B7`, from its row and column, both counted from 0.
fn reference(row: u32, column: u32) -> String {
    let (mut letters, mut left) = (String::new(), column + 1);
    while left > 0 {
        letters.insert(0, char::from(b'A' + ((left - 1) % 26) as u8));
        left = (left - 1) / 26;
    }
    format!("{letters}{}", row + 1)
}

/// Reads the cells of a sheet one by one. A table of all cells would take terabytes if a single cell stands in the last row and column. Cells in percent hold what the sheet
/// shows, and the name above them states the percent.
fn excel_sheet(
    workbook: &mut Xlsx<Cursor<&[u8]>>,
    name: &str,
    is_in_percent: impl Fn(u32, u32) -> bool,
) -> Result<Sheet, String> {
    let mut sheet = Sheet::new();
    // Last text of each column, and whether a number in percent follows it.
    let mut names: BTreeMap<u32, (u32, bool)> = BTreeMap::new();
    let mut cells = workbook.worksheet_cells_reader(name).map_err(|error| error.to_string())?;
    while let Some(cell) = cells.next_cell().map_err(|error| error.to_string())? {
        let (row, column) = cell.get_position();
        let mut value = Data::from(cell.get_value().clone());
        match value {
            Data::Empty => continue,
            Data::String(_) => drop(names.insert(column, (row, false))),
            Data::Int(_) | Data::Float(_) if is_in_percent(row, column) => {
                value = Data::Float(hundredfold(value.as_f64().unwrap_or(f64::NAN)));
                names.entry(column).and_modify(|name| name.1 = true);
            }
            _ => {}
        }
        sheet.entry(row as usize).or_default().insert(column as usize, text_of(&value));
    }
    for (column, (row, _)) in names.into_iter().filter(|(_, (_, has_percent))| *has_percent) {
        let name = sheet.get_mut(&(row as usize)).and_then(|cells| cells.get_mut(&(column as usize)));
        if let Some(name) = name.filter(|name| !name.contains('%')) {
            name.push_str(" (%)");
        }
    }
    Ok(sheet)
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
