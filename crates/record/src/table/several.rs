//! The tables of a file with several: which of them are read, and how they are listed.

use std::path::Path;

use super::asked::{Ask, Question, TableSettings};
use super::blocks::{TableBlock, blocks, commented_rows};
use super::spelling::{ParsedUnit, clock_s};
use super::text::{cells, comment_sign};
use base::error::{Error, InputPlace, Result, Setting};
use base::units::Dimension;

/// Beginnings, in lower case, of lines that name a step of a test.
const STEPS: [&str; 5] = ["step", "interval", "segment", "schritt", "abschnitt"];

/// Returns the tables of a file's text; at least one.
pub(super) fn tables_of(file: &Path, lines: &[&str]) -> Result<Vec<TableBlock>> {
    blocks(lines).filter(|blocks| !blocks.is_empty()).ok_or_else(|| {
        let uncommented = |line: &&str| match comment_sign(line, None) {
            Some(sign) => line.trim_start()[sign.len()..].to_string(),
            None => line.to_string(),
        };
        let text: Vec<String> = lines.iter().map(uncommented).collect();
        let [found, remedy] = match blocks(&text.iter().map(String::as_str).collect::<Vec<_>>()) {
            Some(_) => [
                "every row begins with the sign of a comment, so that none is read",
                "remove the sign, as in `#3`, from the rows",
            ],
            None => [
                "the file has no two columns of numbers",
                "export the table as text: one sample on each line, with commas, semicolons, tabs or blanks between cells",
            ],
        };
        Error::input(InputPlace::file(file), found, remedy)
    })
}

/// Returns the text for each table in a list. Columns that are those of the table above it are not repeated.
fn list(all: &[TableBlock]) -> impl Iterator<Item = String> {
    let is_repeated = |place: usize| place > 0 && all[place - 1].header.names == all[place].header.names;
    (0..all.len()).map(move |place| {
        let columns = if is_repeated(place) { "the same columns".into() } else { columns(&all[place]) };
        listed(place + 1, &all[place], &columns)
    })
}

/// Returns the text for one table: its number, title, lines, number of rows and columns.
fn listed_table(number: usize, table: &TableBlock) -> String {
    listed(number, table, &columns(table))
}

fn columns(table: &TableBlock) -> String {
    match &table.header.names[..] {
        [] => format!("{} columns without names", table.layout.n_cells - table.n_empty.min(table.layout.n_cells)),
        names => names.join(", "),
    }
}

fn listed(number: usize, table: &TableBlock, columns: &str) -> String {
    let [first, last] = table.lines();
    let title = if table.title.is_empty() { String::new() } else { format!(" \"{}\"", table.title) };
    format!("table {number}{title}: lines {first} to {last}, {} rows of {columns}", table.n_rows)
}

/// Returns the tables that the user chose. Without a choice these are all tables if their columns are equal; otherwise `ask` asks for one.
pub(super) fn chosen_tables<'a>(
    file: &Path,
    lines: &[&str],
    all: &'a [TableBlock],
    given: &TableSettings,
    ask: Ask<'_>,
) -> Result<Vec<&'a TableBlock>> {
    let setting = Setting::Tables;
    let Some(said) = given.tables.as_deref() else {
        return match all[1..].iter().all(|other| has_columns_of(&all[0], other)) {
            true => Ok(all.iter().collect()),
            false => Ok(vec![ask_table(file, lines, all, "their columns differ", ask)?]),
        };
    };
    let numbers =
        said.split(',').map(|number| number.trim().parse::<usize>().ok().filter(|n| (1..=all.len()).contains(n)));
    let numbers = if said == "all" { Some((1..=all.len()).collect()) } else { numbers.collect() };
    let mut numbers: Vec<usize> = numbers.ok_or_else(|| {
        let remedy =
            format!("give numbers from 1 to {}, as in `{setting} 1` or `{setting} 1,2`, or `{setting} all`", all.len());
        Error::input(
            InputPlace::setting(setting),
            format!("`{said}` is not a list of tables in {}", file.display()),
            remedy,
        )
    })?;
    numbers.sort_unstable();
    numbers.dedup();
    let first = numbers[0];
    if let Some(other) = numbers.iter().copied().find(|other| !has_columns_of(&all[first - 1], &all[*other - 1])) {
        let listed = |number: usize| listed_table(number, &all[number - 1]);
        return Err(Error::input(
            InputPlace::file(file),
            format!(
                "tables {first} and {other} cannot be joined, because their columns differ:\n    {}\n    {}",
                listed(first),
                listed(other)
            ),
            format!("choose tables with equal columns and units, or make a record of each table with `{setting} each`"),
        ));
    }
    Ok(numbers.into_iter().map(|number| &all[number - 1]).collect())
}

/// True if a table has the columns and units of another, in the same order. A table without a header has those of the table above it.
fn has_columns_of(first: &TableBlock, other: &TableBlock) -> bool {
    let is_bare = other.header.names.is_empty() && other.layout.n_cells == first.layout.n_cells;
    is_bare || other.header.names == first.header.names && other.header.units == first.header.units
}

/// Times of a table, in the unit of their column. Without a unit of time they are those of the first column.
fn times(lines: &[&str], table: &TableBlock) -> Vec<f64> {
    let is_time = |unit: &Option<_>| unit.as_ref().is_some_and(|unit: &ParsedUnit| unit.dimension == Dimension::Time);
    let at = table.header.units.iter().position(is_time).unwrap_or(0);
    let rows = lines[table.layout.first..table.end].iter().map(|line| cells(line, table.layout.delimiter));
    rows.filter_map(|row| row.get(at).and_then(|cell| table.layout.decimal.number(cell).or_else(|| clock_s(cell))))
        .collect()
}

/// True if the times of a table ascend and begin behind those of an earlier one.
fn continues(lines: &[&str], first: &TableBlock, other: &TableBlock) -> bool {
    let [before, after] = [first, other].map(|table| times(lines, table));
    let ascend = |times: &[f64]| times.windows(2).all(|pair| pair[0] <= pair[1]) && times.first() < times.last();
    ascend(&before) && ascend(&after) && before.last() < after.first()
}

/// True if a line above the table, from index `from` on, names a step other than the first, as in `Interval: 2`.
fn names_step(lines: &[&str], from: usize, table: &TableBlock) -> bool {
    lines[from..table.header.line.unwrap_or(table.layout.first)].iter().any(|line| {
        let line = line.trim_start_matches("sheet ").trim_start_matches(['[', '#', ' ', '"']).to_lowercase();
        let mut numbers = line.split(|c: char| !c.is_ascii_digit()).filter_map(|number| number.parse::<u32>().ok());
        STEPS.iter().any(|word| line.starts_with(word)) && numbers.next().is_none_or(|number| number > 1)
    })
}

/// Numbers, from 1, of the first two successive tables with equal columns that may be parts of one test: the times go on, or the second table is named as a further step.
fn parts_of_one_test(lines: &[&str], all: &[TableBlock]) -> Option<[usize; 2]> {
    let mut pairs = (1..all.len()).map(|other| [other - 1, other]);
    let are_parts = |[first, other]: &[usize; 2]| {
        let pair = [&all[*first], &all[*other]];
        let is_step = || names_step(lines, all[other - 1].end, pair[1]);
        has_columns_of(pair[0], pair[1]) && (continues(lines, pair[0], pair[1]) || is_step())
    };
    pairs.find(are_parts).map(|pair| pair.map(|place| place + 1))
}

/// Asks the user to choose one of several tables that cannot be read as one recording. `why` is the reason that the error names if the user gives no
/// answer.
pub(super) fn ask_table<'a>(
    file: &Path,
    lines: &[&str],
    all: &'a [TableBlock],
    why: &str,
    ask: Ask<'_>,
) -> Result<&'a TableBlock> {
    let list: Vec<String> = list(all).collect();
    let question = Question {
        text: format!("which table ({})", list.join("; ")),
        choices: (1..=all.len()).map(|number| number.to_string()).collect(),
        also: Vec::new(),
        proposal: None,
    };
    match ask(&question).and_then(|answer| all.get(answer.parse::<usize>().ok()?.checked_sub(1)?)) {
        Some(table) => Ok(table),
        None => {
            let setting = Setting::Tables;
            let join = match parts_of_one_test(lines, all) {
                Some([first, other]) => format!(" join steps of one test, as in `{setting} {first},{other}`;"),
                None => String::new(),
            };
            Err(Error::input(
                InputPlace::file(file),
                format!("the file contains {} tables, and {why}:\n    {}", all.len(), list.join("\n    ")),
                format!("choose one with `{setting} 1`;{join} make a record of each table with `{setting} each`"),
            ))
        }
    }
}

/// Returns sentences that name lines beside the rows that are not read: means below them, a word between them, and rows behind a comment sign.
pub(super) fn describe_left_out(lines: &[&str], read: &[&TableBlock]) -> Vec<String> {
    let named = |(line, word): &(usize, String)| format!("line {line} (`{word}`)");
    let summaries: Vec<String> = read.iter().flat_map(|table| &table.summaries).map(named).collect();
    let mut sentences = Vec::new();
    if !summaries.is_empty() {
        sentences.push(format!("left out below the rows: {}", summaries.join(", ")));
    }
    for marker in read.iter().filter_map(|table| table.marker) {
        sentences.push(format!("left out between the rows: line {} (`{}`)", marker + 1, lines[marker].trim()));
    }
    let commented: Vec<usize> = read.iter().flat_map(|table| commented_rows(lines, table)).collect();
    if let Some(first) = commented.first() {
        let sign = comment_sign(lines[first - 1], None).unwrap_or_default();
        sentences.push(format!(
            "{} rows begin with `{sign}` and are left out as comments, the first in line {first}: remove the sign from rows that count",
            commented.len()
        ));
    }
    sentences
}

/// Largest number of tables beside those that are read that are listed.
const MOST_LISTED: usize = 3;

/// Returns sentences that tell for each table of a file whether it is read; empty for a single table. Many tables that are not read are counted.
pub(super) fn describe_tables(all: &[TableBlock], read: &[&TableBlock]) -> Vec<String> {
    if all.len() == 1 {
        return Vec::new();
    }
    let is_read = |table: &TableBlock| read.iter().any(|other| other.lines() == table.lines());
    let n_others = all.iter().filter(|table| !is_read(table)).count();
    let said = |(text, table): (String, &TableBlock)| match is_read(table) {
        true => Some(format!("{text}: read")),
        false => (n_others <= MOST_LISTED).then(|| format!("{text}: not read")),
    };
    let mut sentences: Vec<String> = list(all).zip(all).filter_map(said).collect();
    if let Some(place) = all.iter().position(is_read).filter(|_| n_others > MOST_LISTED) {
        sentences[0] = format!("{}: read", listed_table(place + 1, &all[place]));
    }
    if n_others > MOST_LISTED {
        sentences.push(format!("the other {n_others} tables: not read"));
    }
    if read.len() > 1 {
        sentences.push("the tables are joined in time, each with its own force".into());
    }
    sentences
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(above: &str, times: &[[u32; 4]]) -> String {
        let table = |times: &[u32; 4]| times.map(|t| format!("{t},1,{}\n", 10 * t)).concat();
        let above = |number: usize| above.replace('N', &number.to_string());
        (1..)
            .zip(times)
            .map(|(number, times)| format!("{}\nt [s],F [uN],x [um]\n{}\n", above(number), table(times)))
            .collect()
    }

    #[test]
    fn only_parts_of_one_test_are_joined() {
        let anew = [[0, 1, 2, 3]; 3];
        for (above, times, pair) in [
            ("gel N", anew, None),
            ("Interval: 1", anew, None),
            ("Interval: N", anew, Some([1, 2])),
            ("sheet Step N", anew, Some([1, 2])),
            ("[step]", anew, Some([1, 2])),
            ("gel N", [[0, 1, 2, 3], [0, 1, 2, 3], [9, 10, 11, 12]], Some([2, 3])),
            ("gel N", [[0, 1, 2, 3], [9, 4, 8, 2], [3, 1, 2, 8]], None),
        ] {
            let text = lines(above, &times);
            let lines: Vec<&str> = text.lines().collect();
            let all = tables_of(Path::new("t.csv"), &lines).unwrap();
            assert_eq!(parts_of_one_test(&lines, &all), pair, "{above} {times:?}");
            let refused = ask_table(Path::new("t.csv"), &lines, &all, "they differ", &mut |_| None).unwrap_err();
            assert_eq!(refused.to_string().contains("join steps"), pair.is_some(), "{refused}");
        }
    }

    #[test]
    fn tables_that_are_not_read_are_listed_or_counted() {
        let text = lines("gel N", &[[0, 1, 2, 3]; 6]);
        let lines: Vec<&str> = text.lines().collect();
        let all = tables_of(Path::new("t.csv"), &lines).unwrap();
        assert_eq!(
            describe_tables(&all, &[&all[1]]),
            [
                "table 2 \"gel 2\": lines 10 to 13, 4 rows of t [s], F [uN], x [um]: read",
                "the other 5 tables: not read"
            ]
        );
        let few = describe_tables(&all[..3], &[&all[0]]);
        assert_eq!((few.len(), few[2].ends_with("lines 17 to 20, 4 rows of the same columns: not read")), (3, true));
    }
}
