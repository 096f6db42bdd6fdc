//! Search for the tables of numbers in a text, with their cell layout, their headers, and their first and last lines.

use std::borrow::Cow;

use super::spelling::{ParsedUnit, clock_s, is_date_time, is_hours_minutes, split_unit, unit};
use super::text::{
    COLUMNS, Decimal, Delimiter, REMARKS, Thousands, cells, comment_sign, header_cells, is_blank_or_comment,
    is_invalid_point, n_before_names,
};
use crate::trajectory::is_lost;

/// Largest number of lines from which the layout of cells is inferred.
const LOOKED_AT: usize = 5_000;
/// Longest cell, without brackets, of a line that gives the units below the column names, in characters.
const LONGEST_UNIT: usize = 8;
/// Beginning of the line above the tables of a workbook's sheet, in the text of a workbook.
const SHEET: &str = "sheet ";
/// Smallest number of rows of a table. Fewer rows of numbers count as a preamble.
const FEWEST_ROWS: usize = 3;
/// Largest number of lines below a table that count as means and the like.
const MOST_SUMMARIES: usize = 10;
/// Longest displayed title of a table, in characters.
const LONGEST_TITLE: usize = 60;

/// Layout of a table's cells: delimiter, decimal sign and number of cells.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    pub delimiter: Delimiter,
    pub decimal: Decimal,
    /// Index of the line with the first row.
    pub first: usize,
    pub n_cells: usize,
}

/// Table of numbers in a text: consecutive rows under one header.
#[derive(Debug, Clone)]
pub(super) struct TableBlock {
    pub layout: Layout,
    /// Index of the line after the last row.
    pub end: usize,
    pub n_rows: usize,
    pub header: Header,
    /// Nearest line of words above the header; empty without such a line.
    pub title: String,
    /// Number of columns at the end that are empty in every row, because rows may end in a delimiter.
    pub n_empty: usize,
    /// Line numbers and first words of the lines behind the last row that contain a word in place of the first value, such as `Mean`.
    pub summaries: Vec<(usize, String)>,
}

impl TableBlock {
    /// Line numbers of the table's first and last row, from 1.
    pub fn lines(&self) -> [usize; 2] {
        [self.layout.first + 1, self.end]
    }
}

/// True if a cell is a number or a time. Commas inside a quoted cell between commas separate thousands (`"1,094"`).
fn is_value(cell: &str, delimiter: Delimiter, decimal: Decimal) -> bool {
    let is_grouped = || {
        let removed = Thousands::Comma.removed(cell);
        delimiter == Delimiter::Comma && removed.is_some_and(|cell| decimal.number(&cell).is_some())
    };
    decimal.number(cell).is_some()
        || clock_s(cell).is_some()
        || is_hours_minutes(cell)
        || is_date_time(cell)
        || is_grouped()
}

/// Returns the number of cells in a line that are numbers or times, and the number of other cells. Cells that mean a lost position do not count.
fn counts(cells: &[Cow<'_, str>], delimiter: Delimiter, decimal: Decimal) -> (i64, i64) {
    let is_value = |cell: &str| is_value(cell, delimiter, decimal);
    let n_values = cells.iter().filter(|cell| is_value(cell)).count() as i64;
    let n_others = cells.iter().filter(|cell| !is_value(cell) && !is_lost(cell)).count() as i64;
    (n_values, n_others)
}

/// Finds the layout in which most cells of a block of lines are numbers or times; `None` without such a block.
fn layout(lines: &[&str]) -> Option<Layout> {
    let mut best: Option<(i64, Layout)> = None;
    for delimiter in Delimiter::ALL {
        for decimal in Decimal::ALL {
            // Quotes keep decimal commas apart from those between cells.
            if (delimiter, decimal) == (Delimiter::Comma, Decimal::Comma)
                && !lines.iter().any(|line| line.contains('"'))
            {
                continue;
            }
            let mut run: Option<(i64, Layout)> = None;
            let mut finish = |run: &mut Option<(i64, Layout)>| {
                if let Some((score, layout)) = run.take()
                    && best.as_ref().is_none_or(|(most, _)| score > *most)
                {
                    best = Some((score, layout));
                }
            };
            for (index, line) in lines.iter().enumerate().filter(|(_, line)| !is_blank_or_comment(line, None)) {
                let cells = cells(line, delimiter);
                let (n_values, n_others) = counts(&cells, delimiter, decimal);
                if n_values < 2 || n_values < n_others {
                    finish(&mut run);
                    continue;
                }
                if run.as_ref().is_some_and(|(_, layout)| layout.n_cells != cells.len()) {
                    finish(&mut run);
                }
                let fresh = Layout { delimiter, decimal, first: index, n_cells: cells.len() };
                run.get_or_insert((0, fresh)).0 += n_values - n_others;
            }
            finish(&mut run);
        }
    }
    best.map(|(_, layout)| layout)
}

/// Finds the tables of a text, in order. Returns at least one table, or `None` if there is no block of numbers.
///
/// A header or the name of a workbook's sheet between rows begins a new table. Other lines between rows belong to the current table and cause an error when it is read.
pub(super) fn blocks(lines: &[&str]) -> Option<Vec<TableBlock>> {
    let found = layout(&lines[..lines.len().min(LOOKED_AT)])?;
    let mut blocks: Vec<TableBlock> = Vec::new();
    // The next header may begin at the line with the index `after`, which follows the last row found so far.
    let mut after = 0;
    for (index, line) in lines.iter().enumerate().filter(|(_, line)| !is_blank_or_comment(line, None)) {
        let cells = cells(line, found.delimiter);
        let (n_values, n_others) = counts(&cells, found.delimiter, found.decimal);
        // A row of a table that has begun may lack all values except its time.
        let is_row = n_values >= 2 && n_values >= n_others || n_values == 1 && n_others == 0 && !blocks.is_empty();
        let is_new_sheet = lines[after..index].iter().any(|line| line.starts_with(SHEET));
        // A line of words with two numbers is a preamble, such as one above the next table of an export.
        let is_preamble = n_others > 0
            && !is_new_sheet
            && blocks.last().is_some_and(|block| block.n_rows >= FEWEST_ROWS && cells.len() < block.layout.n_cells);
        // Programs write means and standard deviations below a table.
        if let Some(block) = blocks.last_mut()
            && !is_new_sheet
            && block.n_rows >= FEWEST_ROWS
            && block.layout.n_cells == cells.len()
            && n_values > 0
            && is_word(&cells[0])
            && begins_with_value(lines[block.layout.first], &found)
        {
            block.summaries.push((index + 1, cells[0].to_string()));
            continue;
        }
        if !is_row || is_preamble {
            continue;
        }
        let fresh = Layout { first: index, n_cells: cells.len(), ..found.clone() };
        let begins = match blocks.last() {
            None => true,
            Some(_) if after == index => false,
            Some(_) => is_new_sheet || header(lines, after, &fresh, 0).line.is_some(),
        };
        if begins {
            blocks.push(TableBlock {
                layout: fresh,
                end: 0,
                n_rows: 0,
                header: Header::default(),
                title: String::new(),
                n_empty: 0,
                summaries: Vec::new(),
            });
        }
        if let Some(block) = blocks.last_mut() {
            // A few rows of numbers with another number of cells are the preamble of the table that follows.
            if block.layout.n_cells != cells.len() && block.n_rows < FEWEST_ROWS {
                // Unless the first row only lacks its last cells, and a header of the full length stands above it.
                let whole = Layout { n_cells: cells.len(), ..block.layout.clone() };
                if block.layout.n_cells < cells.len() && header(lines, 0, &whole, 0).line.is_some() {
                    block.layout = whole;
                } else {
                    block.layout = Layout { first: index, ..whole };
                    block.n_rows = 0;
                }
            }
            (block.end, block.n_rows) = (index + 1, block.n_rows + 1);
        }
        after = index + 1;
    }
    let mut before = 0;
    for block in &mut blocks {
        block.summaries.retain(|(line, _)| *line > block.end);
        // So many lines are rows, whose first column contains names and numbers.
        if block.summaries.len() > MOST_SUMMARIES {
            (block.end, block.n_rows) =
                (block.summaries[block.summaries.len() - 1].0, block.n_rows + block.summaries.len());
            block.summaries.clear();
        }
        let rows = &lines[block.layout.first..block.end];
        block.n_empty = n_empty_at_end(rows, &block.layout);
        block.header = header(lines, before, &block.layout, block.n_empty);
        block.title = title(lines, before, block);
        before = block.end;
    }
    let has_tables = blocks.iter().any(|block| block.n_rows >= FEWEST_ROWS);
    blocks.retain(|block| !has_tables || block.n_rows >= FEWEST_ROWS);
    Some(blocks)
}

fn is_word(cell: &str) -> bool {
    cell.contains(char::is_alphabetic) && !cell.contains(|c: char| c.is_ascii_digit()) && !is_lost(cell)
}

fn begins_with_value(line: &str, layout: &Layout) -> bool {
    cells(line, layout.delimiter).first().is_some_and(|cell| is_value(cell, layout.delimiter, layout.decimal))
}

/// Number of columns at the end that are empty in every row, because rows may end in a delimiter.
fn n_empty_at_end(rows: &[&str], layout: &Layout) -> usize {
    let rows = rows.iter().filter(|line| !is_blank_or_comment(line, None)).take(LOOKED_AT);
    let empty = rows.map(|line| {
        let cells = cells(line, layout.delimiter);
        cells.iter().rev().take_while(|cell| cell.is_empty()).count()
    });
    empty.min().unwrap_or(0)
}

/// Header of a table: its line, the names of the columns, and their units.
#[derive(Debug, Clone, Default)]
pub(super) struct Header {
    /// Index of the header's line; `None` without a header.
    pub line: Option<usize>,
    pub names: Vec<String>,
    pub units: Vec<Option<ParsedUnit>>,
    /// Indices of columns with a unit that the program does not use, such as a temperature or a voltage.
    pub foreign: Vec<usize>,
}

/// Returns the cells of a line as column names. `None` unless the number of cells matches the rows and at least two cells are words. The last `n_empty` columns need no
/// name.
fn names_in(line: &str, layout: &Layout, n_empty: usize) -> Option<Vec<String>> {
    as_names(header_cells(line, layout.delimiter, None, layout.n_cells), layout, n_empty)
}

fn as_names(cells: Vec<Cow<'_, str>>, layout: &Layout, n_empty: usize) -> Option<Vec<String>> {
    let mut found: Vec<String> = cells.into_iter().map(Cow::into_owned).collect();
    // Columns at the end may have a name although the rows have no cells for them. Between blanks, the words of a name are cells of their own.
    let is_remark = |last: &String| REMARKS.contains(&last.to_lowercase().as_str());
    while found.len() > layout.n_cells && (layout.delimiter != Delimiter::Spaces || found.last().is_some_and(is_remark))
    {
        found.pop();
    }
    if (layout.n_cells - n_empty.min(layout.n_cells)..layout.n_cells).contains(&found.len()) {
        found.resize(layout.n_cells, String::new());
    }
    let n_words =
        found.iter().filter(|cell| !cell.is_empty() && !is_value(cell, layout.delimiter, layout.decimal)).count();
    (found.len() == layout.n_cells && n_words >= 2).then_some(found)
}

/// Finds the header of a table with the given layout, among the lines from index `from` to the first row. The header is empty if there is none.
fn header(lines: &[&str], from: usize, layout: &Layout, n_empty: usize) -> Header {
    let in_preamble = || commented_header(lines, from, layout, n_empty).or_else(|| listed_header(lines, from, layout));
    if let Some(header) = in_preamble() {
        return header;
    }
    let has_cell =
        |line: &str| !is_invalid_point(line) && cells(line, layout.delimiter).iter().any(|cell| !cell.is_empty());
    let mut above: Vec<usize> = (from..layout.first).rev().filter(|index| has_cell(lines[*index])).take(4).collect();
    // A single word, such as `BEGIN`, marks where the rows begin.
    let is_word = |line: &str| cells(line, layout.delimiter).len() == 1 && line.split_whitespace().count() == 1;
    if above.first().is_some_and(|index| is_word(lines[*index])) {
        above.remove(0);
    }
    let names =
        |place: usize| above.get(place).and_then(|index| Some((*index, names_in(lines[*index], layout, n_empty)?)));
    // Units below names with as many cells begin in the same cell as the names.
    let units_below = |place: usize, names: usize| {
        let [units, names] =
            [place, names].map(|place| above.get(place).map(|index| cells(lines[*index], layout.delimiter)));
        let (mut units, names) = units.zip(names)?;
        if layout.delimiter == Delimiter::Spaces || units.len() != names.len() {
            return names_in(lines[above[place]], layout, n_empty);
        }
        units.drain(..n_before_names(&names, layout.n_cells));
        as_names(units, layout, n_empty)
    };
    // Programs write the units below the names, and some write a line of remarks below the units.
    let with_units = |place: usize| {
        // A line of remarks may also stand between names and units, and leaves columns with units without a name.
        let with_cells = |at: usize| Some((names(at)?, units_below(place, at)?));
        let n_unnamed = |found: &((usize, Vec<String>), Vec<String>)| {
            let ((_, names), cells) = found;
            names.iter().zip(cells).filter(|(name, unit)| name.is_empty() && !unit.is_empty()).count()
        };
        let lines = [place + 1, place + 2].into_iter().filter_map(with_cells);
        let ((line, names), cells) = lines.min_by_key(n_unnamed)?;
        let units: Vec<Option<ParsedUnit>> = cells.iter().map(|cell| unit(cell)).collect();
        let length = |cell: &String| cell.trim_matches(['[', ']', '(', ')']).chars().count();
        let is_bracketed = |cell: &&String| cell.starts_with(['[', '(']) && cell.ends_with([']', ')']);
        let are_bracketed = cells.iter().filter(|cell| !cell.is_empty()).all(|cell| is_bracketed(&cell));
        let fewest = if are_bracketed { 0 } else { 2 };
        let n_units = cells.iter().zip(&units).filter(|(cell, unit)| unit.is_some() || *cell == "-").count();
        if n_units < fewest || cells.iter().any(|cell| length(cell) > LONGEST_UNIT) {
            return None;
        }
        // A unit line may contain units that the program does not use, such as °C.
        let is_foreign = |at: &usize| units[*at].is_none() && cells[*at].chars().any(char::is_alphabetic);
        let foreign = (0..units.len()).filter(is_foreign).collect();
        Some(Header { line: Some(line), names, units, foreign })
    };
    if let Some(header) = with_units(0).or_else(|| with_units(1)) {
        return header;
    }
    let Some((line, names)) = names(0) else { return Header::default() };
    // LabVIEW names the quantity of the first column in its preamble, and its times are in seconds.
    let is_time = |line: &&str| line.starts_with("X_Dimension\tTime");
    let unit_of = |name: &String| match name.as_str() {
        "X_Value" if lines[..line].iter().any(is_time) => unit("s"),
        name => split_unit(name).1,
    };
    let units = names.iter().map(unit_of).collect();
    Header { line: Some(line), names, units, foreign: Vec::new() }
}

/// Finds a header in the comments above a table, as JPK writes it: `# columns: …` and `# units: …`. `None` without such comments.
fn commented_header(lines: &[&str], from: usize, layout: &Layout, n_empty: usize) -> Option<Header> {
    let comment = |key: &str| {
        (from..layout.first).rev().find_map(|index| {
            let line = lines[index].trim_start();
            let (found, rest) = line[comment_sign(line, None)?.len()..].split_once(':')?;
            (found.trim() == key).then_some((index, rest))
        })
    };
    let (line, _) = comment(COLUMNS)?;
    let names = names_in(lines[line], layout, n_empty)?;
    let given: Vec<_> = comment("units").map_or(Vec::new(), |(_, units)| units.split_whitespace().map(unit).collect());
    let units = if given.len() == names.len() { given } else { names.iter().map(|name| split_unit(name).1).collect() };
    Some(Header { line: Some(line), names, units, foreign: Vec::new() })
}

/// Finds names that a preamble lists one a line, as instruments of thermal analysis write them: `Sig1`, a tab, `Time (min)`. `None` unless every column has
/// such a line. The header has no line of its own, so columns are described by their numbers.
fn listed_header(lines: &[&str], from: usize, layout: &Layout) -> Option<Header> {
    let named = |number: usize| {
        lines[from..layout.first].iter().find_map(|line| {
            let (key, name) = line.split_once(['\t', ' '])?;
            (key == format!("Sig{number}")).then(|| name.trim().to_string())
        })
    };
    let names: Vec<String> = (1..=layout.n_cells).map(named).collect::<Option<_>>()?;
    let units = names.iter().map(|name| split_unit(name).1).collect();
    Some(Header { line: None, names, units, foreign: Vec::new() })
}

/// Returns the name of the sheet that begins above a table, or the nearest line above its header; empty if there is none. The search ends at index `from`.
fn title(lines: &[&str], from: usize, block: &TableBlock) -> String {
    let mut above = from..block.header.line.unwrap_or(block.layout.first);
    let sheet = above.clone().rfind(|index| lines[*index].starts_with(SHEET));
    let above = sheet.or_else(|| above.rfind(|index| lines[*index].contains(char::is_alphanumeric)));
    // Delimiters behind the words are those of empty cells.
    let line = above.map_or("", |index| lines[index].trim_matches([',', ';', '\t', ' ']));
    let words: Vec<&str> = line.split_whitespace().collect();
    words.join(" ").chars().take(LONGEST_TITLE).collect()
}
