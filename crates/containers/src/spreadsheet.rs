//! Workbooks: Excel (.xlsx, .xlsm) and OpenDocument (.ods).
//!
//! Old Excel workbooks (.xls) are refused: a damaged one makes the parser request more memory than any machine has.

use std::collections::BTreeMap;
use std::io::Cursor;

use calamine::{Data, ExcelDateTime, Ods, Reader, Xlsx};

use crate::arrays::{FEWEST_ROWS, MOST_VALUES};
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
        for name in workbook.sheet_names() {
            let sheet = excel_sheet(&mut workbook, &name);
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

/// Reads the cells of a sheet one by one. A table of all cells would take terabytes if a single cell stands in the last row and column.
fn excel_sheet(workbook: &mut Xlsx<Cursor<&[u8]>>, name: &str) -> Result<Sheet, String> {
    let mut sheet = Sheet::new();
    let mut cells = workbook.worksheet_cells_reader(name).map_err(|error| error.to_string())?;
    while let Some(cell) = cells.next_cell().map_err(|error| error.to_string())? {
        let (row, column) = cell.get_position();
        let value = Data::from(cell.get_value().clone());
        if value != Data::Empty {
            sheet.entry(row as usize).or_default().insert(column as usize, text_of(&value));
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
