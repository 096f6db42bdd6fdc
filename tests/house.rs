//! What holds of the project's own text: modules use only those before them, rooms have no circles, citations lead somewhere.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Pages that the code cites by section, under the word that stands before the sign.
const PAGES: [(&str, &str); 2] = [("physics", "docs/physics.md"), ("formats", "docs/formats.md")];
const CITING: [&str; 10] = [
    "src",
    "crates",
    "tests",
    "examples",
    "benches",
    "docs",
    "campaigns",
    "README.md",
    "ARCHITECTURE.md",
    "CONTRIBUTING.md",
];

/// Modules of the library in the order in which data flow, as `lib.rs` and ARCHITECTURE.md name them.
const ORDER: [&str; 29] = [
    "error",
    "files",
    "units",
    "parameter",
    "elementary",
    "number",
    "distribution",
    "toml_input",
    "experiment",
    "rheology",
    "stages",
    "mesh",
    "fe",
    "effects",
    "model",
    "surrogate",
    "inference",
    "documents",
    "report",
    "page",
    "study",
    "workflow",
    "sweep",
    "critique",
    "learn",
    "shapes",
    "groups",
    "tasks",
    "schemas",
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Text files under a place, in the order of their names.
fn files(place: &Path) -> Vec<PathBuf> {
    if place.is_file() {
        let is_text = place.extension().is_some_and(|ending| ["rs", "md", "py", "sh"].iter().any(|own| ending == *own));
        return if is_text { vec![place.to_path_buf()] } else { Vec::new() };
    }
    let entries = fs::read_dir(place).expect("a directory of the project");
    let mut inside: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    inside.sort();
    inside.iter().flat_map(|path| files(path)).collect()
}

/// Sources of all crates, each with its crate's `src`.
fn sources() -> Vec<(PathBuf, PathBuf)> {
    let crates =
        ["", "crates/figures", "crates/inference", "crates/mechanics"].map(|place| root().join(place).join("src"));
    crates.into_iter().flat_map(|src| files(&src).into_iter().map(move |path| (src.clone(), path))).collect()
}

/// Numbers of a page's headings: "## 3 Finite elements", "### 3.1 Balance".
fn sections(page: &str) -> BTreeSet<String> {
    let text = fs::read_to_string(root().join(page)).expect("a page");
    let numbers = text.lines().filter(|line| line.starts_with('#')).filter_map(|line| line.split(' ').nth(1));
    numbers.filter(|word| word.starts_with(|c: char| c.is_ascii_digit())).map(String::from).collect()
}

/// Sections that a line cites of a page: "physics §4.1–§4.3, §4.8" are 4.1, 4.3 and 4.8.
fn cited(line: &str, word: &str) -> Vec<String> {
    let line = line.replace('P', "p");
    let mut found = Vec::new();
    for (at, _) in line.match_indices(&format!("{word} §")) {
        let mut rest = &line[at + word.len() + 1..];
        while let Some(after) = rest.strip_prefix('§') {
            let end = after.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(after.len());
            found.push(after[..end].trim_end_matches('.').to_string());
            rest = &after[end..];
            rest = [", ", "–", " and "].iter().find_map(|joint| rest.strip_prefix(joint)).unwrap_or("");
        }
    }
    found
}

/// A reader who follows a citation arrives.
#[test]
fn every_cited_section_exists() {
    assert_eq!(cited("by Physics §4.1–§4.3, §4.8. See physics §3", "physics"), ["4.1", "4.3", "4.8", "3"]);
    for (word, page) in PAGES {
        let sections = sections(page);
        let mut n_citations = 0;
        for path in CITING.iter().flat_map(|place| files(&root().join(place))) {
            let text = fs::read_to_string(&path).expect("text");
            for (number, line) in text.lines().enumerate() {
                for section in cited(line, word) {
                    n_citations += 1;
                    let place = path.strip_prefix(root()).unwrap_or(&path).display();
                    assert!(sections.contains(&section), "{place}:{}: {page} has no section {section}", number + 1);
                }
            }
        }
        assert!(n_citations > 20, "{word} is cited {n_citations} times");
    }
}

/// Modules of the crate that a text names, tests left out: "crate::fe::exact" is fe.
fn named_modules(text: &str) -> BTreeSet<&str> {
    let own = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or(text);
    let after = own.split("crate::").skip(1);
    after.map(|rest| rest.split(|c: char| !c.is_ascii_lowercase() && c != '_').next().unwrap_or("")).collect()
}

/// Data flow one way: a module uses only those before it, and the two places that name their order agree.
#[test]
fn modules_use_only_those_before_them() {
    assert_eq!(named_modules("use crate::fe::exact;\n#[cfg(test)]\nmod tests {\nuse crate::model;"), ["fe"].into());
    let lib = fs::read_to_string(root().join("src/lib.rs")).expect("lib.rs");
    let entries = lib.lines().filter(|line| line.starts_with("//! - "));
    let documented: Vec<&str> = entries.filter_map(|line| line.split('`').nth(1)).collect();
    assert_eq!(documented, ORDER, "the order in lib.rs");
    let architecture = fs::read_to_string(root().join("ARCHITECTURE.md")).expect("ARCHITECTURE.md");
    let drawn = architecture.split("```").nth(1).expect("the house, drawn");
    let mut rest = drawn;
    for module in ORDER {
        let at = rest.find(module).unwrap_or_else(|| panic!("ARCHITECTURE.md does not draw {module} here: {rest}"));
        rest = &rest[at + module.len()..];
    }
    for (src, path) in sources() {
        let inside = path.strip_prefix(&src).expect("inside its crate");
        let name = inside.components().next().expect("a name").as_os_str().to_string_lossy().replace(".rs", "");
        let Some(own) = ORDER.iter().position(|module| *module == name) else {
            assert!(["lib", "bin"].contains(&&*name), "{name} is in no order");
            continue;
        };
        if inside.to_string_lossy().ends_with("tests.rs") {
            continue;
        }
        let text = fs::read_to_string(&path).expect("text");
        for used in named_modules(&text) {
            let place = ORDER.iter().position(|module| *module == used);
            assert!(place.is_none_or(|place| place <= own), "{}: {used} comes after {name}", inside.display());
        }
    }
}

/// Modules beside one that it names: "super::a::x" and "super::{b, c::y}" are a, b and c.
fn named_siblings(text: &str, path: &str) -> BTreeSet<String> {
    let own = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or(text);
    let code: String = own.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
    let word = |from: &str| from.trim().chars().take_while(|c| c.is_ascii_alphanumeric() || *c == '_').collect();
    let mut found = BTreeSet::new();
    for (at, _) in code.match_indices(path) {
        let rest = &code[at + path.len()..];
        // Not super::super, which is named elsewhere.
        if code[..at].ends_with("super::") {
            continue;
        }
        let Some(group) = rest.strip_prefix('{') else {
            found.insert(word(rest));
            continue;
        };
        let mut depth = 0;
        for part in group.split_inclusive([',', '{', '}']) {
            if depth == 0 {
                found.insert(word(part));
            }
            depth += i32::from(part.ends_with('{')) - i32::from(part.ends_with('}'));
            if depth < 0 {
                break;
            }
        }
    }
    found.remove("");
    found
}

/// Inside a room, too, nobody leans on whom he holds: files beside each other can be put in an order.
#[test]
fn no_room_has_a_circle() {
    assert_eq!(named_siblings("use super::{a, b::{C, D}, e};", "super::"), ["a", "b", "e"].map(String::from).into());
    let mut rooms: BTreeMap<PathBuf, Vec<PathBuf>> = BTreeMap::new();
    for (_, path) in sources() {
        let room = path.parent().expect("a room").to_path_buf();
        rooms.entry(room).or_default().push(path);
    }
    for (room, inside) in rooms {
        let name = |path: &Path| path.file_stem().expect("a name").to_string_lossy().into_owned();
        let is_program = room.ends_with("bin/vitreo-uq");
        let uses = |path: &PathBuf| {
            let text = fs::read_to_string(path).expect("text");
            (name(path), named_siblings(&text, if is_program { "crate::" } else { "super::" }))
        };
        let is_house =
            |path: &&PathBuf| !["mod", "lib", "main"].contains(&&*name(path)) && !name(path).ends_with("tests");
        let mut left: BTreeMap<String, BTreeSet<String>> = inside.iter().filter(is_house).map(uses).collect();
        // Those that use nobody who is left go, one after another.
        while let Some(free) = left.iter().find(|(own, uses)| !uses.iter().any(|x| x != *own && left.contains_key(x))) {
            let free = free.0.clone();
            left.remove(&free);
        }
        assert!(left.is_empty(), "in {} stand in a circle, or use one: {:?}", room.display(), left.keys());
    }
}

/// Files of libraries that write commands of the program, options included.
const WRITING_COMMANDS: [&str; 2] = ["crates/figures/src/page/study.rs", "crates/jobs/src/tasks/list.rs"];

/// Numbers of the lines before a file's tests that name an option of the command line.
fn lines_naming_flags(text: &str) -> Vec<usize> {
    let before_tests = text.lines().take_while(|line| *line != "#[cfg(test)]");
    let names_a_flag = |line: &str| {
        let is_code = !line.trim_start().starts_with("//");
        let after_quote =
            line.match_indices("\"--").any(|(at, _)| line[at + 3..].starts_with(|c: char| c.is_ascii_lowercase()));
        is_code && (after_quote || line.contains("Place::option"))
    };
    before_tests.enumerate().filter(|(_, line)| names_a_flag(line)).map(|(index, _)| index + 1).collect()
}

/// Errors of libraries name settings; the program alone knows its options.
#[test]
fn libraries_name_no_flags() {
    let made_up = "let a = Place::option(x);\n// \"--out\"\nlet b = \"--out\";\nlet c = \"--\";\n#[cfg(test)]\nlet d = \"--out\";";
    assert_eq!(lines_naming_flags(made_up), [1, 3]);
    let is_test = |path: &Path| {
        let name = path.file_stem().and_then(|name| name.to_str()).unwrap_or_default();
        name == "tests" || name.ends_with("_tests")
    };
    let mut n_files = 0;
    for path in files(&root().join("crates")) {
        let place = path.strip_prefix(root()).unwrap_or(&path).to_string_lossy().replace('\\', "/");
        let is_library = place.contains("/src/") && !place.starts_with("crates/python/") && place.ends_with(".rs");
        if !is_library || is_test(&path) || WRITING_COMMANDS.contains(&place.as_str()) {
            continue;
        }
        n_files += 1;
        let found = lines_naming_flags(&fs::read_to_string(&path).expect("text"));
        assert!(
            found.is_empty(),
            "{place}: lines {found:?} name options: name a `Setting` of crates/base/src/error.rs"
        );
    }
    assert!(n_files > 100, "{n_files} files");
}
