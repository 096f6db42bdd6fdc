//! Tests 500 hostile names of folders, and 150 of them as those of uploaded tables. No name may be taken for an option, lead outside its folder, or change on its way into a command.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use clap::parser::ValueSource;
use clap::{ArgMatches, CommandFactory};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::home::{Item, WorkbenchFolder};
use super::jobs::{JobKind, JobRequest, commands};
use super::tables::{DescribeOutcome, Described, describe, store_upload};

const N_NAMES: usize = 500;
/// Number of names of tables. Each table is described anew, which takes a twentieth of a second.
const N_TABLES: usize = 150;
/// Texts from which random names are composed.
const PARTS: [&str; 64] = [
    "-",
    "--",
    "---",
    "--force",
    "--json=pwned.json",
    "--out",
    "--out=..",
    "-h",
    "--help",
    "--",
    "=",
    ",",
    ".",
    "..",
    "...",
    "../",
    "..\\",
    "/",
    "//",
    "\\",
    "/etc/passwd",
    "C:\\",
    "\\\\host\\share\\",
    "~",
    "~root/",
    "\0",
    "\n",
    "\r\n",
    "\t",
    "\u{7}",
    "\u{1b}[2J",
    "\u{7f}",
    "\"",
    "'",
    "`",
    "$(touch pwned)",
    "${HOME}",
    "$()",
    ";rm -rf .",
    "|",
    "&",
    "*",
    "?",
    "%2e%2e%2f",
    "%00",
    "%s%n",
    "\u{202e}",
    "\u{200f}",
    "\u{2066}",
    "\u{feff}",
    "\u{200b}",
    "CON",
    "nul",
    "COM1",
    "LPT9",
    "aux",
    " ",
    "eye",
    "眼",
    "e\u{301}",
    "😀",
    "m0",
    "vitreo-uq-out",
    ".lock",
];
const ENDINGS: [&str; 6] = [".csv", "", ".tar.gz", ".", ".--force", ".c\nsv"];
const TABLE_ROWS: usize = 40;

/// Hostile names: first the worst ones, then random ones from a fixed seed.
fn hostile_names() -> Vec<String> {
    let mut names: Vec<String> =
        ["--force.csv", "--json=pwned.json", "-", "--", "..", ".", "", " ", "\0"].map(String::from).to_vec();
    names.push("x".repeat(100_000));
    names.push(format!("{}.csv", "眼".repeat(300)));
    names.push("../".repeat(100) + "etc/passwd");
    let random = &mut ChaCha8Rng::seed_from_u64(500);
    while names.len() < N_NAMES {
        let n_parts = random.random_range(1..7);
        let mut name: String = (0..n_parts).map(|_| PARTS[random.random_range(0..PARTS.len())]).collect();
        if random.random_range(0..20) == 0 {
            name = name.repeat(random.random_range(2..100));
        }
        name += ENDINGS[random.random_range(0..ENDINGS.len())];
        names.push(name);
    }
    names
}

/// Creates a workbench folder with a secret file beside it.
fn place() -> (tempfile::TempDir, WorkbenchFolder) {
    let place = tempfile::tempdir().unwrap();
    std::fs::create_dir(place.path().join("home")).unwrap();
    std::fs::write(place.path().join("secret"), "secret").unwrap();
    let (home, item) = WorkbenchFolder::of(&place.path().join("home")).unwrap();
    assert_eq!(item, None);
    (place, home)
}

fn names_in(dir: &Path) -> BTreeSet<String> {
    let entries = std::fs::read_dir(dir).unwrap();
    entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect()
}

/// Returns how the parser understands the words of a command line: the command's name, and the values of its options and paths by name.
fn understood(words: &[String]) -> (String, BTreeMap<String, Vec<String>>) {
    let found = crate::Program::command()
        .try_get_matches_from(std::iter::once("vitreo-uq".to_string()).chain(words.iter().cloned()));
    let found = found.unwrap_or_else(|error| panic!("{error}\n{words:?}"));
    let (command, inner): (&str, &ArgMatches) = found.subcommand().unwrap();
    let ids = inner.ids().map(clap::Id::as_str).filter(|id| inner.value_source(id) == Some(ValueSource::CommandLine));
    // Names that begin with a capital are argument groups of the library Clap. They are not on the command line.
    let ids = ids.filter(|id| !id.starts_with(char::is_uppercase));
    let value = |id: &str| {
        let raw = inner.get_raw(id).into_iter().flatten();
        (id.to_string(), raw.map(|value| value.to_str().unwrap().to_string()).collect())
    };
    (command.to_string(), ids.map(value).collect())
}

/// Checks that the parser understands every command for an item as intended.
fn is_understood(home: &WorkbenchFolder, item: &Item) {
    let place = |inside: &Path| home.dir().join(inside).display().to_string();
    let study = place(&item.study);
    let item = Item { revisions: vec!["m0".into(), "m1".into()], ..item.clone() };
    let built = |kind: JobKind, with: &[&str], is_replaced: bool| {
        let with = with.iter().map(|name| (*name).to_string()).collect();
        let wish = JobRequest { item: item.name.clone(), kind, revision: None, with };
        let members: Vec<_> = item.experiment.clone().into_iter().collect();
        commands(home.dir(), &wish, &item, is_replaced, &members)
    };
    let check = |words: &[String], command: &str, expected: &[(&str, &[&str])]| {
        let (found, given) = understood(words);
        let values = |names: &[&str]| names.iter().map(|name| (*name).to_string()).collect::<Vec<String>>();
        let expected: BTreeMap<String, Vec<String>> =
            expected.iter().map(|(id, names)| ((*id).to_string(), values(names))).collect();
        assert_eq!((found.as_str(), &given), (command, &expected), "{words:?}");
    };
    let sample = built(JobKind::Sample, &[], false).unwrap();
    match &item.experiment {
        Some(experiment) => check(&sample[0], "sample", &[("target", &[&place(experiment)]), ("out", &[&study])]),
        None => check(&sample[0], "sample", &[("target", &[&study])]),
    }
    check(&sample[1], "compare", &[("target", &[&study]), ("from", &["m0"])]);
    let (_, given) = understood(&built(JobKind::Sample, &[], true).unwrap()[0]);
    assert!(given.contains_key("force"));
    for (kind, command) in [(JobKind::Compare, "compare"), (JobKind::Diagnose, "diagnose"), (JobKind::Learn, "learn")] {
        check(&built(kind, &[], false).unwrap()[0], command, &[("target", &[&study]), ("from", &["m1"])]);
    }
    let extend = built(JobKind::Extend, &["wall-slip", "drift"], false).unwrap();
    let with: &[&str] = &["wall-slip", "drift"];
    check(&extend[0], "extend", &[("target", &[&study]), ("from", &["m1"]), ("with", with)]);
    check(&extend[1], "compare", &[("target", &[&study])]);
    check(&extend[2], "ladder", &[("target", &[&study])]);
    let paths = ["m0", "m1", "m2"].map(|name| format!("{study}/{name}"));
    let paths: Vec<&str> = paths.iter().map(String::as_str).collect();
    check(&extend[3], "corner", &[("paths", &paths), ("out", &[&format!("{study}/corner")])]);
    let file = format!("./{}/m1/learned-effect.toml", item.study.display());
    match built(JobKind::Adopt, &[], false) {
        Ok(adopt) => {
            check(&adopt[0], "extend", &[("target", &[&study]), ("from", &["m1"]), ("with", &[&file])]);
        }
        Err(error) => assert!(file.contains(',') && error.to_string().contains("contains a comma"), "{error}"),
    }
    if let Some(member) = &item.experiment {
        let groups = built(JobKind::Groups, &["species"], false).unwrap();
        let out = place(Path::new(super::home::GROUPS));
        let member = member.display().to_string();
        check(&groups[0], "groups", &[("paths", &[&member]), ("by", &["species"]), ("out", &[&out])]);
        check(&groups[1], "report", &[("study", &[&study])]);
    }
}

/// Answers to the questions that the page asks about the table of the function [`table`].
fn answers(home: &WorkbenchFolder) -> BTreeMap<String, String> {
    let mut answers = BTreeMap::new();
    for number in 0..9 {
        let upload = store_upload(home, "plain.csv", 9000 + number, table().as_bytes()).unwrap();
        let described =
            Described { upload, file: "plain.csv".into(), answers: answers.clone(), ..Described::default() };
        match describe(home, &described).unwrap() {
            DescribeOutcome::Written { item, .. } => {
                std::fs::remove_dir_all(home.dir().join(item)).unwrap();
                return answers;
            }
            DescribeOutcome::Questions { questions, .. } => {
                let asked = serde_json::to_value(&questions).unwrap();
                for value in asked.as_array().unwrap() {
                    let first = value["choices"].get(0).and_then(serde_json::Value::as_str);
                    let answer = value["proposal"].as_str().or(first).unwrap_or("1");
                    answers.insert(value["text"].as_str().unwrap().to_string(), answer.to_string());
                }
            }
        }
    }
    panic!("questions without end: {answers:?}");
}

fn table() -> String {
    let row = |row: usize| {
        let force_un = if (row / 10).is_multiple_of(2) { 1.0 } else { -1.0 };
        format!("{:.2},{force_un},{:.3},{}\n", 0.1 * row as f64, (row % 10) as f64 * force_un, 1 + row / 20)
    };
    "time_s,force_uN,position_um,cycle\n".to_string() + &(0..TABLE_ROWS).map(row).collect::<String>()
}

#[test]
fn hostile_names_of_tables_become_plain_folders() {
    let (outside, home) = place();
    let answers = answers(&home);
    let mut items = BTreeSet::new();
    for (number, name) in hostile_names().iter().enumerate().take(N_TABLES) {
        let upload = store_upload(&home, name, number as u64, table().as_bytes()).unwrap();
        let described = Described { upload, file: name.clone(), answers: answers.clone(), ..Described::default() };
        let DescribeOutcome::Written { item, .. } =
            describe(&home, &described).unwrap_or_else(|error| panic!("{name:?}: {error}"))
        else {
            panic!("{name:?}: something else is asked")
        };
        assert!(!item.starts_with(['-', '.']) && item.len() <= 85 && !item.ends_with('.'), "{name:?} became {item:?}");
        let is_plain = |c: char| c.is_alphanumeric() || matches!(c, '-' | '_' | '.');
        assert!(item.chars().all(is_plain), "{name:?} became {item:?}");
        for file in names_in(&home.dir().join(&item)) {
            assert!(!file.starts_with(['-', '.']) && file.chars().all(is_plain), "{name:?} has {file:?}");
        }
        is_understood(&home, &home.find(&item).unwrap());
        assert!(items.insert(item), "{name:?} took another's place");
    }
    assert_eq!(items.len(), N_TABLES);
    items.insert(".vitreo-uq-workbench".into());
    assert_eq!(names_in(home.dir()), items);
    assert_eq!(names_in(outside.path()), BTreeSet::from(["home".to_string(), "secret".to_string()]));
}

/// Folders that other programs make can have any name that the file system allows. None may be taken for an option.
#[cfg(unix)]
#[test]
fn hostile_names_of_folders_are_no_options() {
    let (_outside, home) = place();
    let mut made = BTreeSet::new();
    for name in hostile_names() {
        let mut name = name.replace('/', "\u{2215}").replace('\0', "");
        while name.len() > 255 {
            name.pop();
        }
        if matches!(name.as_str(), "" | "." | "..") || !made.insert(name.clone()) {
            continue;
        }
        let experiment = home.dir().join(&name);
        std::fs::create_dir_all(&experiment).unwrap();
        let id = toml::Value::String(format!("{name}-of")).to_string();
        std::fs::write(experiment.join("experiment.toml"), format!("[specimen]\nid = {id}\n")).unwrap();
        let study = home.dir().join("vitreo-uq-out").join(&name);
        std::fs::create_dir_all(&study).unwrap();
        std::fs::write(study.join("inputs.sha256"), "").unwrap();
    }
    let items = home.items();
    let n_experiments = items.iter().filter(|item| item.experiment.is_some()).count();
    let n_visible = made.iter().filter(|name| !name.starts_with('.')).count();
    assert_eq!((n_experiments, n_visible > 300), (n_visible, true));
    assert!(items.len() > n_visible + 200, "{} items of {} folders", items.len(), made.len());
    items.iter().for_each(|item| is_understood(&home, item));
}
