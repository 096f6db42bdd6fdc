//! Names of the specimens in a file with several tests: experiments with one specimen id count as repeats.

use record::table::InspectedTable;

/// Beginning of the line above the tables of a workbook's sheet.
const SHEET: &str = "sheet ";
/// Keys of lines that name a specimen, in lower case. Earlier keys precede later ones.
const KEYS: [&str; 9] = [
    "specimen name",
    "specimen id",
    "specimen",
    "sample name",
    "sample id",
    "sample",
    "probenname",
    "échantillon",
    "name",
];
/// Words of sheets that are named by their program, or by a test in place of a specimen, in lower case.
const OF_NO_SPECIMEN: [&str; 22] = [
    "sheet",
    "tabelle",
    "blatt",
    "feuil",
    "feuille",
    "hoja",
    "foglio",
    "folha",
    "лист",
    "creep",
    "kriechen",
    "recovery",
    "relaxation",
    "relax",
    "test",
    "run",
    "data",
    "raw",
    "step",
    "table",
    "results",
    "cycle",
];
/// Largest number of names that are listed.
const MOST_LISTED: usize = 3;

/// Specimens of the tables of a file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SpecimenNames {
    /// Name for each table.
    pub names: Vec<String>,
    /// Sentence that tells where the names are from, and how to change them.
    pub said: String,
}

/// Names of the specimens: those of the sheets, or of a line such as `Sample: gel 3` above each table. Otherwise all tables have the specimen `of_file`.
pub(super) fn specimen_names(tables: &[InspectedTable], of_file: &str) -> SpecimenNames {
    let last_line = |table: &InspectedTable| table.layout.row_lines.last().map_or(0, |[_, last]| *last);
    let above = |place: usize| {
        let before = place.checked_sub(1).map_or(0, |before| last_line(&tables[before]));
        tables[place].preamble.iter().filter(move |(line, _)| *line > before).map(|(_, text)| text.as_str())
    };
    let of_key = |key: &str| -> Option<Vec<String>> {
        let value = |place: usize| above(place).rev().find_map(|line| value_of(line, key));
        (0..tables.len()).map(value).collect()
    };
    // A sheet's name stands above its first table.
    let mut sheet = None;
    let sheets = (0..tables.len()).map(|place| {
        sheet = above(place)
            .rev()
            .find_map(|line| line.strip_prefix(SHEET))
            .map(|name| name.trim().into())
            .or(sheet.take());
        sheet.clone()
    });
    let sheets: Option<Vec<String>> = sheets.collect();
    let sheets = sheets.filter(|names| names.iter().all(|name| names_specimen(name)) && n_distinct(names) > 1);
    let of_line = || KEYS.iter().find_map(|key| Some((of_key(key)?, format!("the lines `{key}`"))));
    // A line that names one specimen for all tables decides nothing beside sheets of several, unless these are only counted.
    let is_counted = |names: &Vec<String>| names.iter().any(|name| !name.contains(char::is_alphabetic));
    let sheets_count = sheets.as_ref().is_none_or(is_counted);
    let of_line = of_line().filter(|(names, _)| tables.len() > 1 && (sheets_count || n_distinct(names) > 1));
    match of_line.or_else(|| sheets.map(|names| (names, "the sheets".into()))) {
        Some((names, origin)) => {
            let said = format!(
                "{origin} name the specimens: {}; repeats of one specimen need the same `id` in experiment.toml",
                listed(&names)
            );
            SpecimenNames { names, said }
        }
        None => SpecimenNames {
            names: vec![of_file.into(); tables.len()],
            said: format!(
                "no names of specimens were found, and all tables count as repeats of one specimen, `{of_file}`: for other specimens change `id` in their experiment.toml"
            ),
        },
    }
}

/// Value of a line such as `Sample: gel 3`, if it has the key.
fn value_of(line: &str, key: &str) -> Option<String> {
    let (name, value) = line.split_once([':', '=', '\t', ';', ','])?;
    let is_of_commas = line[name.len()..].starts_with(',');
    let bare = |text: &str| text.trim_matches([' ', '\t', ':', '=', ';', ',', '"', '#', '\r']).to_string();
    let value = bare(value);
    // A row of column names has several cells.
    let is_single = !(value.contains(['\t', ';']) || is_of_commas && value.contains(','));
    (bare(name).to_lowercase() == key && !value.is_empty() && is_single).then_some(value)
}

/// True unless a word of a sheet's name is one of a program or a test.
fn names_specimen(sheet: &str) -> bool {
    let lower = sheet.to_lowercase();
    let mut words = lower.split(|c: char| !c.is_alphabetic()).filter(|word| !word.is_empty());
    !words.any(|word| OF_NO_SPECIMEN.contains(&word.trim_end_matches('s')) || OF_NO_SPECIMEN.contains(&word))
}

fn n_distinct(names: &[String]) -> usize {
    names.iter().collect::<std::collections::BTreeSet<_>>().len()
}

/// The first distinct names, and the number of all.
fn listed(names: &[String]) -> String {
    let mut distinct: Vec<&String> = Vec::new();
    for name in names {
        if !distinct.contains(&name) {
            distinct.push(name);
        }
    }
    let shown: Vec<String> = distinct.iter().take(MOST_LISTED).map(|name| format!("`{name}`")).collect();
    match distinct.len() {
        n if n > MOST_LISTED => format!("{}, … ({n} in all)", shown.join(", ")),
        _ => shown.join(", "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use record::table::inspect_tables;

    /// Tables of a text that has the given lines above each of them.
    fn tables(above: &[&str]) -> Vec<InspectedTable> {
        let rows = "t [s]\tF [uN]\tx [um]\n0\t1\t0\n1\t1\t2\n2\t1\t3\n";
        let text: String = above.iter().map(|line| format!("{line}\n{rows}\n")).collect();
        inspect_tables("t.txt".as_ref(), text.as_bytes()).expect("tables")
    }

    #[test]
    fn specimens_have_the_names_of_sheets_and_lines() {
        for (above, names, origin) in [
            (["sheet gel-2-10", "sheet gel-2-34"], ["gel-2-10", "gel-2-34"], "the sheets"),
            (["sheet gel a\nSample: A", "sheet gel b\nSample: A"], ["gel a", "gel b"], "the sheets"),
            (["sheet 1\nSample: A 1", "sheet 2\nSample: A 1"], ["A 1", "A 1"], "`sample`"),
            (["Name:\t\t\tday 0, 1\nSample\t3", "Name:\t\t\tday 0, 2\nSample\t4"], ["3", "4"], "`sample`"),
            (["Name:\t\t\tgel, day 0, 1", "Name:\t\t\tgel, day 0, 2"], ["gel, day 0, 1", "gel, day 0, 2"], "`name`"),
        ] {
            let found = specimen_names(&tables(&above), "file");
            assert_eq!(found.names, names, "{above:?}");
            assert!(found.said.contains(origin) && found.said.contains("`id` in experiment.toml"), "{}", found.said);
        }
    }

    #[test]
    fn without_names_the_assumption_is_stated() {
        for above in [
            ["sheet Sheet1", "sheet Sheet2"],
            ["sheet Creep", "sheet Recovery 2"],
            ["Sample: A", "Operator: B"],
            ["Sample size: 3", "Sample size: 4"],
            ["Sample,Force (N),Extension (mm)", "Sample,Force (N),Extension (mm)"],
            ["", ""],
        ] {
            let found = specimen_names(&tables(&above), "file");
            assert_eq!(found.names, ["file", "file"], "{above:?}");
            assert!(found.said.contains("repeats of one specimen, `file`: for other specimens"), "{}", found.said);
        }
    }
}
