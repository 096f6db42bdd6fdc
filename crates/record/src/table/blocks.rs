//! Search for the tables of numbers in a text, with their cell layout, their headers, and their first and last lines.

use std::borrow::Cow;

use super::spelling::{ParsedUnit, clock_s, is_date_time, is_hours_minutes, split_unit, unit};
use super::text::{
    COLUMNS, Decimal, Delimiter, REMARKS, Thousands, cells, comment_sign, header_cells, is_blank_or_comment,
    is_invalid_point, n_before_names, whole_lines,
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
/// Largest number of lines with a note between the names of the columns and the rows.
const MOST_NOTES: usize = 3;
/// Number of lines above the rows that may hold names, units and a remark.
const HEADER_LINES: usize = 4;
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
    /// Index of a line with a single word between the first rows, such as `eoh`; `None` without such a line.
    pub marker: Option<usize>,
}

impl TableBlock {
    /// Line numbers of the table's first and last row, from 1.
    pub fn lines(&self) -> [usize; 2] {
        [self.layout.first + 1, self.end]
    }

    /// Line numbers of the first and last row on each side of the marker, from 1.
    pub fn ranges(&self) -> Vec<[usize; 2]> {
        let [first, last] = self.lines();
        self.marker.map_or(vec![[first, last]], |marker| vec![[first, marker], [marker + 2, last]])
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
        // Some programs write the first row above the word that ends their header.
        if let Some(block) = blocks.last_mut()
            && (1..FEWEST_ROWS).contains(&block.n_rows)
            && cells.len() == 1
            && is_single_word(line)
            && is_word(&cells[0])
        {
            block.marker = Some(index);
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
                marker: None,
            });
        }
        if let Some(block) = blocks.last_mut() {
            // A line of the preamble may have as many cells as the rows, such as `Size 25 6 2`.
            let is_stated = |line| !begins_with_value(line, &found);
            if after < index && block.n_rows < FEWEST_ROWS && is_stated(lines[block.layout.first]) && !is_stated(line) {
                block.layout = Layout { first: index, n_cells: cells.len(), ..found.clone() };
                (block.n_rows, block.marker) = (0, None);
            }
            // A few rows of numbers with another number of cells are the preamble of the table that follows.
            if block.layout.n_cells != cells.len() && block.n_rows < FEWEST_ROWS {
                // Unless the first row only lacks its last cells or ends in a remark, and a header of the full length stands above it.
                let whole = Layout { n_cells: cells.len(), ..block.layout.clone() };
                let may_begin = block.layout.n_cells < cells.len() || begins_with_values(lines[whole.first], &whole);
                if may_begin && header(lines, 0, &whole, 0).line.is_some() {
                    block.layout = whole;
                } else {
                    block.layout = Layout { first: index, ..whole };
                    (block.n_rows, block.marker) = (0, None);
                }
            }
            (block.end, block.n_rows) = (index + 1, block.n_rows + 1);
        }
        after = index + 1;
    }
    let mut before = 0;
    for block in &mut blocks {
        block.summaries.retain(|(line, _)| *line > block.end);
        block.marker = block.marker.filter(|marker| (block.layout.first + 1..block.end).contains(marker));
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

/// True if the cells of all columns in a line are values. The line may have further cells.
fn begins_with_values(line: &str, layout: &Layout) -> bool {
    let cells = cells(line, layout.delimiter);
    cells.iter().take(layout.n_cells).all(|cell| is_value(cell, layout.delimiter, layout.decimal))
}

fn is_single_word(line: &str) -> bool {
    line.split_whitespace().count() == 1
}

/// Returns the numbers, from 1, of the lines of a table that have the cells of a row behind a comment sign.
pub(super) fn commented_rows(lines: &[&str], block: &TableBlock) -> Vec<usize> {
    let is_commented = |index: &usize| is_commented_row(lines[*index], &block.layout);
    let begin = block.header.line.map_or(block.layout.first, |line| line + 1);
    let within = (begin..block.end).filter(is_commented);
    let below = (block.end..lines.len()).take_while(is_commented);
    within.chain(below).map(|index| index + 1).collect()
}

fn is_commented_row(line: &str, layout: &Layout) -> bool {
    let Some(sign) = comment_sign(line, None) else { return false };
    let cells = cells(&line.trim_start()[sign.len()..], layout.delimiter);
    let (n_values, n_others) = counts(&cells, layout.delimiter, layout.decimal);
    cells.len() == layout.n_cells && n_values >= 2 && n_others == 0
}

/// Number of columns at the end that are empty in every row, because rows may end in a delimiter.
fn n_empty_at_end(rows: &[&str], layout: &Layout) -> usize {
    let rows = rows.iter().filter(|line| !is_blank_or_comment(line, None)).take(LOOKED_AT);
    let rows = rows.map(|line| cells(line, layout.delimiter)).filter(|cells| cells.len() > 1);
    let empty = rows.map(|cells| cells.iter().rev().take_while(|cell| cell.is_empty()).count());
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
    /// True if the line has no name for the first column, so that names do not find their columns again.
    pub lacks_first_name: bool,
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
    let mut above: Vec<(usize, Cow<'_, str>)> = whole_lines(&lines[from..layout.first], layout.delimiter);
    above.retain(|(_, line)| has_cell(line) && !is_commented_row(line, layout));
    above.reverse();
    let n_notes = above.iter().take(MOST_NOTES).take_while(|(_, line)| is_note(line, layout, n_empty)).count();
    above.drain(..n_notes);
    above.truncate(HEADER_LINES);
    above.iter_mut().for_each(|(index, _)| *index += from);
    let first_cells = first_cells(&lines[layout.first..], layout);
    // Between blanks, a line with one name fewer lacks that of the first column only if R has written the names of rows there.
    let is_shifted = |names: &[String]| layout.delimiter == Delimiter::Spaces && names[0].is_empty();
    let names = |place: usize| {
        let (index, line) = above.get(place)?;
        let names = names_in(line, layout, n_empty)?;
        (!is_shifted(&names) || first_cells != FirstCells::Numbers && first_cells != FirstCells::WholeNumbers)
            .then_some((*index, names))
    };
    // Units below names with as many cells begin in the same cell as the names.
    let units_below = |place: usize, names: usize| {
        let [units, names] =
            [place, names].map(|place| above.get(place).map(|(_, line)| cells(line, layout.delimiter)));
        let (mut units, names) = units.zip(names)?;
        if layout.delimiter == Delimiter::Spaces || units.len() != names.len() {
            return names_in(&above[place].1, layout, n_empty);
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
        let ((line, names), mut cells) = lines.min_by_key(n_unnamed)?;
        // Beside the rows, above columns without a value, may stand a note.
        cells.truncate(layout.n_cells - n_empty.min(layout.n_cells));
        let mut units: Vec<Option<ParsedUnit>> = cells.iter().map(|cell| unit(cell)).collect();
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
        units.resize(names.len(), None);
        Some(Header { line: Some(line), names, units, foreign, ..Header::default() })
    };
    if let Some(header) = with_units(0).or_else(|| with_units(1)) {
        return header;
    }
    // A comment may have as many words as the rows have cells. Names above it are no comment, and state units.
    let is_comment = |place: usize| above.get(place).is_some_and(|(_, line)| comment_sign(line, None).is_some());
    let n_units = |names: &[String]| names.iter().filter(|name| split_unit(name).1.is_some()).count();
    let above_note = |of_note: &(usize, Vec<String>)| {
        let is_note = is_comment(0) && n_units(&of_note.1) == 0;
        let mut others = (1..above.len()).filter(|place| is_note && !is_comment(*place)).filter_map(names);
        others.find(|(_, names)| n_units(names) >= 2)
    };
    let found = names(0).map(|nearest| above_note(&nearest).unwrap_or(nearest));
    let without_one = || {
        let (index, line) = above.first().filter(|_| layout.n_cells > 2)?;
        let layout_of_names = Layout { n_cells: layout.n_cells - 1, ..layout.clone() };
        let mut names = names_in(line, &layout_of_names, n_empty)?;
        // A line that begins with an empty cell lacks another name.
        if names.first().is_none_or(String::is_empty) {
            return None;
        }
        if first_cells == FirstCells::Names {
            names.insert(0, String::new());
            return Some((*index, names, true));
        }
        // Words of a note are no names, and have no units. Whole numbers may be those that R writes before its rows.
        let are_names = n_units(&names) >= 2;
        names.push(String::new());
        let is_between_blanks = layout.delimiter == Delimiter::Spaces;
        (are_names && first_cells == FirstCells::Numbers).then_some((*index, names, is_between_blanks))
    };
    let found = found.map(|(line, names)| (line, names, false)).or_else(without_one);
    let Some((line, names, lacks_first_name)) = found else { return Header::default() };
    // LabVIEW names the quantity of the first column in its preamble, and its times are in seconds.
    let is_time = |line: &&str| line.starts_with("X_Dimension\tTime");
    let unit_of = |name: &String| match name.as_str() {
        "X_Value" if lines[..line].iter().any(is_time) => unit("s"),
        name => split_unit(name).1,
    };
    let units = names.iter().map(unit_of).collect();
    Header { line: Some(line), names, units, foreign: Vec::new(), lacks_first_name }
}

/// True for a line that cannot hold the names of the columns: a comment, a word such as `BEGIN`, or a text in a single cell.
fn is_note(line: &str, layout: &Layout, n_empty: usize) -> bool {
    let n_filled = || cells(line, layout.delimiter).iter().filter(|cell| !cell.is_empty()).count();
    let is_text = || layout.delimiter != Delimiter::Spaces && n_filled() == 1;
    names_in(line, layout, n_empty).is_none()
        && (comment_sign(line, None).is_some() || is_single_word(line) || is_text())
}

/// Number of rows whose first cells are looked at.
const FIRST_ROWS: usize = 8;

/// What the first cells of the rows are.
#[derive(Debug, Clone, Copy, PartialEq)]
enum FirstCells {
    /// Empty, or alone in quotation marks as R writes the names of rows.
    Names,
    /// Texts, or whole numbers that grow by one, which may be names of rows.
    PerhapsNames,
    WholeNumbers,
    Numbers,
}

fn first_cells(rows: &[&str], layout: &Layout) -> FirstCells {
    let rows = || rows.iter().filter(|line| !is_blank_or_comment(line, None));
    let is_between_blanks = layout.delimiter == Delimiter::Spaces;
    let is_of_r = |line: &str| line.starts_with('"') && line.matches('"').count() == 2;
    let is_empty = |line: &str| !is_between_blanks && cells(line, layout.delimiter)[0].is_empty();
    if rows().take(FEWEST_ROWS).all(|line| is_empty(line) || is_of_r(line)) {
        return FirstCells::Names;
    }
    let first = |line: &&str| {
        let cells = cells(line, layout.delimiter);
        let cell = cells.iter().find(|cell| !cell.is_empty())?;
        cell.replace(',', ".").parse::<f64>().ok().map(|number| (number, !cell.contains(['.', ','])))
    };
    let Some(firsts) = rows().take(FIRST_ROWS).map(first).collect::<Option<Vec<(f64, bool)>>>() else {
        return FirstCells::PerhapsNames;
    };
    if !firsts.iter().all(|(_, is_whole)| *is_whole) {
        FirstCells::Numbers
    } else if firsts.windows(2).all(|pair| pair[1].0 == pair[0].0 + 1.0) {
        FirstCells::PerhapsNames
    } else {
        FirstCells::WholeNumbers
    }
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
    Some(Header { line: Some(line), names, units, ..Header::default() })
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
    Some(Header { names, units, ..Header::default() })
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

#[cfg(test)]
mod tests {
    use super::*;

    fn first_table(text: &str) -> TableBlock {
        let lines: Vec<&str> = text.lines().collect();
        blocks(&lines).expect("a table").swap_remove(0)
    }

    const ROWS: &str = "0,1,0\n1,1,2\n2,1,3\n3,1,4\n";

    #[test]
    fn notes_between_names_and_rows_hide_no_names() {
        let names = ["t [s]", "F [uN]", "x [um]"];
        let header = names.join(",");
        for notes in [
            "# start",
            "start of recording",
            "start of recording,,",
            "eoh",
            "# a\n\n# b, c",
            "# one, two, three",
            "#0,0,0\n#1,1,1\n#2,2,2\n#3,3,3\n#4,4,4",
        ] {
            let table = first_table(&format!("Gel of day 3\n{header}\n{notes}\n{ROWS}"));
            assert_eq!(table.header.names, names, "{notes}");
            assert_eq!((table.header.line, table.n_rows), (Some(1), 4), "{notes}");
        }
        // Words between blanks may be as many as the columns; the names above state units.
        let table = first_table("t_s F_uN x_um\n# creep of gel\n0 1 0\n1 1 2\n2 1 3\n");
        assert_eq!(table.header.names, ["t_s", "F_uN", "x_um"]);
        // A sentence above the names is none of them.
        let table = first_table(&format!("All forces in uN, positions in um, times in s\nt,F,x\n{ROWS}"));
        assert_eq!(table.header.names, ["t", "F", "x"]);
        // More lines are a preamble.
        let table = first_table(&format!("{header}\na b\nb c\nc d\nd e\n{ROWS}"));
        assert!(table.header.names.is_empty(), "{:?}", table.header);
    }

    #[test]
    fn names_may_contain_line_breaks() {
        let table = first_table(&format!("\"t\n[s]\",\"F\n\n[uN]\",\"x [um]\"\n{ROWS}"));
        assert_eq!(table.header.names, ["t [s]", "F  [uN]", "x [um]"]);
        assert_eq!((table.header.line, table.layout.first), (Some(0), 4));
    }

    #[test]
    fn a_word_between_the_first_rows_is_left_out() {
        let table = first_table(&format!("t [s],F [uN],x [um]\n-1,0,0\neoh\n{ROWS}"));
        assert_eq!((table.header.line, table.n_rows), (Some(0), 5));
        assert_eq!(table.ranges(), [[2, 2], [4, 7]]);
        let later = first_table(&format!("t [s],F [uN],x [um]\n{ROWS}eoh\n4,1,5\n"));
        assert_eq!((later.marker, later.ranges()), (None, vec![[2, 7]]));
    }

    #[test]
    fn a_remark_behind_the_first_row_is_no_column() {
        let names = "X_Value\tLoad\tx\tComment\n";
        let table = first_table(&format!("{names}0\t1\t0\ttest\n1\t1\t2\n2\t1\t3\n3\t1\t3\n"));
        assert_eq!((&table.header.names[..], table.n_rows), (&["X_Value", "Load", "x"].map(String::from)[..], 4));
        // Without names above it, a longer line of numbers belongs to the preamble.
        let table = first_table("1\t2\t3\t4\n0\t1\t0\n1\t1\t2\n2\t1\t3\n");
        assert_eq!((table.layout.first, table.layout.n_cells), (1, 3));
    }

    #[test]
    fn a_note_beside_the_units_is_no_unit() {
        let rows = ROWS.replace('\n', ",,\n");
        let table = first_table(&format!("Time,Force,Position,,10 mm/min\n(s),(uN),(um),,20 N preload\n{rows}"));
        assert_eq!(table.header.names[..3], ["Time", "Force", "Position"]);
        assert_eq!(table.header.units[2].as_ref().map(|unit| unit.name.as_str()), Some("um"));
        assert_eq!(table.header.units.len(), 5);
        // Above values, a text in place of a unit is a name.
        let rows = ROWS.replace('\n', ",5,6\n");
        let table = first_table(&format!("Time,Force,Position,,A\n(s),(uN),(um),,20 N preload\n{rows}"));
        assert_eq!(table.header.names[0], "(s)");
    }

    /// Checks a line of a preamble that has as many cells as the rows, as instruments of thermal analysis write the size of a specimen.
    #[test]
    fn a_size_above_the_names_is_no_row() {
        let text = "Size\t25.0\t6.0\t2.0\nNsig\t4\nSig1\tTime (min)\nSig2\tTemperature\nSig3\tStrain (%)\nSig4\tStress (MPa)\nStartOfData\n0\t25\t0.1\t1\n1\t25\t0.2\t1\n2\t25\t0.3\t1\n";
        let table = first_table(text);
        assert_eq!((table.layout.first, table.header.names[2].as_str()), (7, "Strain (%)"));
    }

    #[test]
    fn names_begin_behind_a_first_column_without_values() {
        let names = "w (rad/s)\tG' (Pa)\tG'' (Pa)\n";
        for first in ["", "\"a\""] {
            let rows: String = (1..5).map(|row| format!("{first}\t{row}\t2\t3\n")).collect();
            let header = first_table(&format!("{names}{rows}")).header;
            assert_eq!(header.names, ["", "w (rad/s)", "G' (Pa)", "G'' (Pa)"], "{first}");
            assert!(header.lacks_first_name && header.units[2].is_some());
        }
        // Where the first column has other values, the last one lacks its name.
        let flagged: String = (1..5).map(|row| format!("0.{row}\t1\t2\t0\n")).collect();
        let header = first_table(&format!("{names}{flagged}")).header;
        assert_eq!(header.names, ["w (rad/s)", "G' (Pa)", "G'' (Pa)", ""]);
        assert!(!header.lacks_first_name && header.units[0].is_some());
        let between_blanks = format!("w(rad/s) G'(Pa) G''(Pa)\n{}", flagged.replace('\t', "  ").replace("0.", "  0."));
        assert_eq!(first_table(&between_blanks).header.names, ["w(rad/s)", "G'(Pa)", "G''(Pa)", ""]);
        // A column that counts the rows may be one of names.
        let rows: String = (1..5).map(|row| format!("{row}\t1\t2\t3\n")).collect();
        assert!(first_table(&format!("{names}{rows}")).header.names.is_empty());
    }

    #[test]
    fn rows_behind_a_comment_sign_are_counted() {
        let text = format!("t,F,x\n#-1,1,2\n{ROWS}# pause\n# 4,1\n//5,1,5\n# 6,1,6\n");
        let lines: Vec<&str> = text.lines().collect();
        let table = &blocks(&lines).expect("a table")[0];
        assert_eq!(commented_rows(&lines, table), [2]);
        let lines: Vec<&str> = text.lines().filter(|line| !["# pause", "# 4,1"].contains(line)).collect();
        assert_eq!(commented_rows(&lines, &blocks(&lines).expect("a table")[0]), [2, 7, 8]);
    }
}
