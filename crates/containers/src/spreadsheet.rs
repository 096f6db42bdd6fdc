//! Workbooks: Excel (.xlsx, .xlsm, .xlsb, .xls) and OpenDocument (.ods).

use std::io::Cursor;

use calamine::{Data, ExcelDateTime, Reader, open_workbook_auto_from_rs};

use crate::arrays::MOST_VALUES;
use crate::refused::{IS_ZIP, zip_entries};
use crate::table_text::{TableText, number};

/// First bytes of Microsoft's compound files, to which old Excel workbooks belong.
const COMPOUND: &[u8] = &[0xd0, 0xcf, 0x11, 0xe0, 0xa1, 0xb1, 0x1a, 0xe1];
/// Largest size of a workbook's parts after decompression, in bytes.
const MOST_BYTES: u64 = 2 << 30;

pub fn recognises(bytes: &[u8]) -> bool {
    let is_workbook = |name: &String| name.starts_with("xl/workbook") || name == "content.xml";
    bytes.starts_with(COMPOUND) || bytes.starts_with(IS_ZIP) && zip_entries(bytes).0.iter().any(is_workbook)
}

pub fn read(bytes: &[u8]) -> Result<TableText, String> {
    if zip_entries(bytes).1 > MOST_BYTES {
        return Err("its parts take more than 2 GiB after decompression".into());
    }
    let mut workbook = open_workbook_auto_from_rs(Cursor::new(bytes)).map_err(|error| error.to_string())?;
    let mut tables = TableText::default();
    for sheet in workbook.sheet_names() {
        let range = match workbook.worksheet_range(&sheet) {
            Ok(range) => range,
            Err(error) => {
                tables.notes.push(format!("sheet `{sheet}` is not read: {error}"));
                continue;
            }
        };
        if range.height().saturating_mul(range.width()) > MOST_VALUES {
            return Err(format!("sheet `{sheet}` has more than {MOST_VALUES} cells"));
        }
        if range.is_empty() {
            continue;
        }
        tables.title(&format!("sheet {sheet}"));
        for row in range.rows() {
            tables.row(row.iter().map(cell));
        }
    }
    Ok(tables)
}

/// Text of a cell. An error value of a formula becomes an empty cell.
fn cell(cell: &Data) -> String {
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
        let seconds = 86_400.0 * days;
        let (hours, minutes) = ((seconds / 3600.0).floor(), (seconds / 60.0).floor() % 60.0);
        return format!("{hours:02}:{minutes:02}:{:09.6}", seconds % 60.0);
    }
    let (year, month, day, hour, minute, second, milli) = time.to_ymd_hms_milli();
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{milli:03}")
}
