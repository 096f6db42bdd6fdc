//! Numbers in columns of a table before it is read as a record.

use record::table::{InspectedTable, cells, decode_detected};

/// True if a column holds a number other than 0.
pub(super) fn has_numbers(bytes: &[u8], looked: &InspectedTable, place: usize) -> bool {
    !numbers_of(bytes, looked, [place]).is_empty()
}

/// Numbers of columns with their line, for the rows in which all of them hold a number other than 0.
pub(super) fn numbers_of<const N: usize>(
    bytes: &[u8],
    looked: &InspectedTable,
    places: [usize; N],
) -> Vec<(usize, [f64; N])> {
    let layout = &looked.layout;
    let text = decode_detected(bytes);
    let lines = (1..).zip(text.lines()).filter(|(line, _)| layout.table_of(*line).is_some());
    let rows = lines.map(|(line, text)| {
        let cells = cells(text, layout.delimiter);
        (line, places.map(|place| cells.get(place).and_then(|cell| layout.number(cell)).unwrap_or(0.0)))
    });
    rows.filter(|(_, numbers)| !numbers.contains(&0.0)).collect()
}
