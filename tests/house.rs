//! Tests of the project's own source text: order of crates, no cycles among files, small crates, valid citations.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Pages that the code cites by section, each after the word that precedes the sign § in a citation.
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

/// Largest allowed size of a library crate, in lines of code.
const MOST_LINES: usize = 12_000;
/// Crates outside the library: a Python module and a build script's helper.
const BESIDE: [&str; 2] = ["python", "source-hash"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Text files under a path, sorted by name.
fn files(place: &Path) -> Vec<PathBuf> {
    if place.is_file() {
        let is_text =
            place.extension().is_some_and(|ending| ["rs", "md", "py", "sh"].iter().any(|name| ending == *name));
        return if is_text { vec![place.to_path_buf()] } else { Vec::new() };
    }
    let entries = fs::read_dir(place).expect("a directory of the project");
    let mut inside: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    inside.sort();
    inside.iter().flat_map(|path| files(path)).collect()
}

/// Returns the numbers of a page's headings, such as 3.1 in "### 3.1 Balance".
fn sections(page: &str) -> BTreeSet<String> {
    let text = fs::read_to_string(root().join(page)).expect("a page");
    let numbers = text.lines().filter(|line| line.starts_with('#')).filter_map(|line| line.split(' ').nth(1));
    numbers.filter(|word| word.starts_with(|c: char| c.is_ascii_digit())).map(String::from).collect()
}

/// Returns the sections of a page that a line cites: 4.1, 4.3 and 4.8 for "physics §4.1–§4.3, §4.8".
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

/// Every cited section exists.
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

/// Names of the workspace's library crates.
fn library_crates() -> BTreeSet<String> {
    let entries = fs::read_dir(root().join("crates")).expect("crates");
    let names = entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned());
    names.filter(|name| !BESIDE.contains(&name.as_str())).collect()
}

/// Dependencies that a manifest lists under `[dependencies]`.
fn dependencies(manifest: &str) -> Vec<&str> {
    let lines = manifest.lines().skip_while(|line| *line != "[dependencies]").skip(1);
    let entries = lines.take_while(|line| !line.starts_with('['));
    entries.filter_map(|line| line.split(['.', ' ', '=']).next()).filter(|name| !name.is_empty()).collect()
}

/// The map in `lib.rs` lists every library crate, and a crate depends only on those before it.
#[test]
fn crates_stand_in_their_order() {
    assert_eq!(dependencies("[a]\nz = 1\n[dependencies]\nb.workspace = true\nc = \"1\"\n\n[d]\ne = 1"), ["b", "c"]);
    let lib = fs::read_to_string(root().join("src/lib.rs")).expect("lib.rs");
    let map = lib.split("//! # Map\n").nth(1).expect("a map");
    let order: Vec<&str> = map
        .lines()
        .filter_map(|line| line.strip_prefix("//! - [`")?.split_once("`]: "))
        .map(|(name, _)| name)
        .collect();
    let crates = library_crates();
    let listed: BTreeSet<String> = order.iter().map(|name| name.to_string()).collect();
    assert_eq!(listed, crates, "the map in src/lib.rs lists other crates than there are");
    assert_eq!(order.len(), crates.len(), "the map in src/lib.rs lists a crate twice: {order:?}");
    let mut n_internal = 0;
    for (place, name) in order.iter().enumerate() {
        let manifest = fs::read_to_string(root().join("crates").join(name).join("Cargo.toml")).expect("a manifest");
        for used in dependencies(&manifest).into_iter().filter(|used| crates.contains(*used)) {
            n_internal += 1;
            assert!(order[..place].contains(&used), "{name} depends on {used}, which the map does not list before it");
        }
    }
    assert!(n_internal > 30, "{n_internal} dependencies between crates were found");
}

/// A word, a sign or a string of a source text.
#[derive(Debug, Clone, Copy)]
struct Token<'a> {
    text: &'a str,
    line: usize,
}

fn is_word_part(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Length of the string literal at the start of a text, also of a raw one; 0 if there is none.
fn string_len(text: &str) -> usize {
    let body = text.strip_prefix('b').unwrap_or(text);
    let raw = body.strip_prefix('r').map(|rest| rest.trim_start_matches('#'));
    if let Some(inside) = raw.and_then(|rest| rest.strip_prefix('"')) {
        let n_hashes = body.len() - 1 - inside.len() - 1;
        let end = format!("\"{}", "#".repeat(n_hashes));
        return text.len() - inside.len() + inside.find(&end).map_or(inside.len(), |at| at + end.len());
    }
    let Some(inside) = body.strip_prefix('"') else { return 0 };
    let mut is_escaped = false;
    let end = inside.find(|c| {
        let is_end = c == '"' && !is_escaped;
        is_escaped = c == '\\' && !is_escaped;
        is_end
    });
    text.len() - inside.len() + end.map_or(inside.len(), |at| at + 1)
}

/// Length of the character literal at the start of a text; 1, the sign alone, for a lifetime.
fn quote_len(text: &str) -> usize {
    let mut inside = text[1..].char_indices();
    match inside.next() {
        Some((_, '\\')) => text[3..].find('\'').map_or(text.len(), |at| at + 4),
        _ => match inside.next() {
            Some((at, '\'')) => at + 2,
            _ => 1,
        },
    }
}

/// Tokens of a source text without comments.
fn tokens(text: &str) -> Vec<Token<'_>> {
    let (mut found, mut at, mut line) = (Vec::new(), 0, 1);
    while let Some(next) = text[at..].chars().next() {
        let rest = &text[at..];
        let is_comment = rest.starts_with("//");
        let length = match next {
            _ if is_comment => rest.find('\n').unwrap_or(rest.len()),
            _ if string_len(rest) > 0 => string_len(rest),
            '\'' => quote_len(rest),
            ':' if rest.starts_with("::") => 2,
            _ if is_word_part(next) => rest.find(|c| !is_word_part(c)).unwrap_or(rest.len()),
            _ => next.len_utf8(),
        };
        if !is_comment && !next.is_whitespace() {
            found.push(Token { text: &rest[..length], line });
        }
        line += rest[..length].matches('\n').count();
        at += length;
    }
    found
}

/// Number of tokens in the item at the start of `tokens`: its attributes, and its code up to `;` or the end of a block.
fn item_len(tokens: &[Token]) -> usize {
    let (mut depth, mut is_attribute) = (0, false);
    for (place, token) in tokens.iter().enumerate() {
        if depth == 0 && token.text == "#" {
            is_attribute = true;
        }
        depth += i32::from(["{", "(", "["].contains(&token.text)) - i32::from(["}", ")", "]"].contains(&token.text));
        let ends = !is_attribute && ["}", ";"].contains(&token.text);
        is_attribute &= !(depth == 0 && token.text == "]");
        if depth == 0 && ends {
            return place + 1;
        }
    }
    tokens.len()
}

/// Tokens of a source text without comments and tests.
fn code_tokens(text: &str) -> Vec<Token<'_>> {
    let all = tokens(text);
    let (mut code, mut at) = (Vec::new(), 0);
    while at < all.len() {
        let is_for_tests =
            all[at..].iter().map(|token| token.text).take(7).eq(["#", "[", "cfg", "(", "test", ")", "]"]);
        if is_for_tests {
            at += item_len(&all[at..]);
        } else {
            code.push(all[at]);
            at += 1;
        }
    }
    code
}

/// Returns `true` if a file's name marks it as a test file.
fn is_test_file(path: &Path) -> bool {
    let name = path.file_stem().expect("a name").to_string_lossy();
    name == "tests" || name.ends_with("_tests") || name.starts_with("test_")
}

/// Sources of the library crates and the program without tests, as texts by module path. The program's paths begin with `program`.
fn sources() -> BTreeMap<String, String> {
    let crates = library_crates().into_iter().map(|name| (root().join("crates").join(&name).join("src"), name));
    let program = (root().join("src/bin/vitreo-uq"), "program".to_string());
    let mut sources = BTreeMap::new();
    for (place, name) in crates.chain([program]) {
        for path in files(&place).iter().filter(|path| !is_test_file(path)) {
            let inside = path.strip_prefix(&place).expect("inside its crate").with_extension("");
            let parts = inside.iter().map(|part| part.to_string_lossy());
            let modules = parts.filter(|part| !["lib", "main", "mod"].contains(&&**part));
            let module = modules.fold(name.clone(), |path, part| format!("{path}::{part}"));
            sources.insert(module, fs::read_to_string(path).expect("text"));
        }
    }
    sources
}

/// Path of an item that a source file mentions.
struct Named<'a> {
    path: Vec<&'a str>,
    /// Local name that `use` gives the item; empty in an expression.
    name: &'a str,
    /// True if the file only re-exports the path.
    is_export: bool,
}

/// Reads a tree of `use` that begins at `at`: paths and their local names. Returns the index after it.
fn read_tree<'a>(
    tokens: &[Token<'a>],
    mut at: usize,
    prefix: &[&'a str],
    found: &mut Vec<(Vec<&'a str>, &'a str)>,
) -> usize {
    let mut path = prefix.to_vec();
    while let Some(token) = tokens.get(at) {
        match token.text {
            "{" => {
                at += 1;
                while tokens[at].text != "}" {
                    at = read_tree(tokens, at, &path, found);
                    at += usize::from(tokens[at].text == ",");
                }
                return at + 1;
            }
            "as" => {
                found.push((path, tokens[at + 1].text));
                return at + 2;
            }
            "self" if !path.is_empty() => {}
            "::" => {}
            word if word.starts_with(is_word_part) || word == "*" => path.push(word),
            _ => break,
        }
        at += 1;
    }
    // Without a path it is the `use<…>` of a type.
    if let Some(&name) = path.last() {
        found.push((path, name));
    }
    at
}

/// Paths that a file names, in `use` and in expressions.
fn named_paths(text: &str) -> Vec<Named<'_>> {
    let tokens = code_tokens(text);
    let (mut named, mut at) = (Vec::new(), 0);
    while at < tokens.len() {
        let before = if at == 0 { "" } else { tokens[at - 1].text };
        if tokens[at].text == "use" {
            let visibility = tokens[..at].iter().rev().take(5).take_while(|token| ![";", "}"].contains(&token.text));
            let is_export = visibility.into_iter().any(|token| token.text == "pub");
            let mut found = Vec::new();
            at = read_tree(&tokens, at + 1, &[], &mut found);
            named.extend(found.into_iter().map(|(path, name)| Named { path, name, is_export }));
        } else if tokens[at].text.starts_with(is_word_part) && before != "::" {
            let mut path = vec![tokens[at].text];
            while let [joint, word, ..] = &tokens[at + 1..]
                && joint.text == "::"
                && word.text.starts_with(is_word_part)
            {
                path.push(word.text);
                at += 2;
            }
            at += 1;
            if path.len() > 1 {
                named.push(Named { path, name: "", is_export: false });
            }
        } else {
            at += 1;
        }
    }
    named
}

/// Resolves a path in `module` to a path that begins with its crate; `None` if it leads out of the workspace.
fn absolute(path: &[&str], module: &str, sources: &BTreeMap<String, String>) -> Option<String> {
    let name = module.split("::").next().unwrap_or(module);
    let first = path[0];
    let (base, rest) = match first {
        "crate" => (name.to_string(), &path[1..]),
        "self" => (module.to_string(), &path[1..]),
        "super" => {
            let n_up = path.iter().take_while(|part| **part == "super").count();
            let parts: Vec<&str> = module.split("::").collect();
            (parts[..parts.len().saturating_sub(n_up).max(1)].join("::"), &path[n_up..])
        }
        "vitreo_uq" => (path.get(1)?.to_string(), &path[2..]),
        _ if sources.contains_key(&format!("{module}::{first}")) => (module.to_string(), path),
        _ => (first.to_string(), &path[1..]),
    };
    let top = base.split("::").next().unwrap_or(&base);
    sources.contains_key(top).then(|| rest.iter().fold(base.clone(), |path, part| format!("{path}::{part}")))
}

/// File that defines the item of a path, resolved through `use` names.
fn definition(path: &str, known: &BTreeMap<String, String>, sources: &BTreeMap<String, String>) -> String {
    let mut path = path.to_string();
    // Names may be re-exported several times. The limit also ends a ring of names.
    for _ in 0..8 {
        let mut file = path.as_str();
        while !sources.contains_key(file) {
            file = file.rsplit_once("::").expect("its crate is a file").0;
        }
        let name_len = path[file.len()..].trim_start_matches("::").split("::").next().map_or(0, str::len);
        let name = &path[..path.len().min(file.len() + 2 + name_len)];
        match known.get(name).filter(|to| to.as_str() != name) {
            Some(to) => path = format!("{to}{}", &path[name.len()..]),
            None => return file.to_string(),
        }
    }
    path
}

/// Files that each file uses, with the paths. Re-exports and a module's own items are left out.
type Uses = BTreeMap<String, BTreeMap<String, BTreeSet<String>>>;

fn uses(sources: &BTreeMap<String, String>) -> Uses {
    let named: Vec<(&String, Vec<Named>)> = sources.iter().map(|(module, text)| (module, named_paths(text))).collect();
    let mut known = BTreeMap::new();
    for (module, paths) in &named {
        for Named { path, name, .. } in paths.iter().filter(|named| !named.name.is_empty()) {
            if let Some(to) = absolute(path, module, sources) {
                known.insert(format!("{module}::{name}"), to);
            }
        }
    }
    let mut uses: Uses = sources.keys().map(|module| (module.clone(), BTreeMap::new())).collect();
    for (module, paths) in &named {
        for Named { path, .. } in paths.iter().filter(|named| !named.is_export) {
            let Some(to) = absolute(path, module, sources) else { continue };
            let file = definition(&to, &known, sources);
            if file != **module && !file.starts_with(&format!("{module}::")) {
                uses.get_mut(*module).expect("a file").entry(file).or_default().insert(path.join("::"));
            }
        }
    }
    uses
}

/// A cycle among files, with the items used; `None` if the files can be ordered.
fn cycle(uses: &Uses) -> Option<String> {
    let mut left: BTreeSet<&String> = uses.keys().collect();
    // Files that use no remaining file are removed, one after another.
    while let Some(free) = left.iter().find(|file| !uses[**file].keys().any(|used| left.contains(used))).copied() {
        left.remove(free);
    }
    let mut walked: Vec<&String> = vec![left.first().copied()?];
    loop {
        let next = uses[walked[walked.len() - 1]].keys().find(|used| left.contains(used)).expect("it uses one");
        walked.push(next);
        if let Some(first) = walked[..walked.len() - 1].iter().position(|file| *file == next) {
            let step = |pair: &[&String]| format!("{} uses {}: {:?}", pair[0], pair[1], uses[pair[0]][pair[1]]);
            return Some(walked[first..].windows(2).map(step).collect::<Vec<_>>().join("\n"));
        }
    }
}

/// The files can be ordered so that each file uses only earlier files. A module may also use its own content.
#[test]
fn no_files_form_a_cycle() {
    let texts = |b: &str| -> BTreeMap<String, String> {
        let lib = "mod a; pub mod b; pub use b::{Thing as Other, x}; fn own() { a::f() }";
        let a = "use crate::{Other, b::{self as c}}; /// super::none\nfn f<'a>(x: &'a str) -> char { '\"' }";
        let other = "use one::b::Thing; fn g() { one::own(\"two::h\", r#\"\"two::i\"#) }";
        [("one", lib), ("one::a", a), ("one::b", b), ("two", other)].map(|(m, text)| (m.into(), text.into())).into()
    };
    let none =
        uses(&texts("pub struct Thing; // super::a\n#[cfg(test)]\n#[path = \"x\"]\nmod tests { use super::a; }"));
    assert_eq!(none["one"].len(), 0, "a module may use its own content");
    assert_eq!(none["two"].keys().collect::<Vec<_>>(), ["one", "one::b"], "exports and strings");
    assert_eq!(cycle(&none), None);
    let ring = cycle(&uses(&texts("#[cfg(test)]\nuse x::y; fn g() -> super::a::F { todo!() }"))).expect("a cycle");
    assert_eq!(ring, "one::a uses one::b: {\"crate::Other\", \"crate::b\"}\none::b uses one::a: {\"super::a::F\"}");

    let uses = uses(&sources());
    let n_uses: usize = uses.values().map(BTreeMap::len).sum();
    assert!(n_uses > 1000, "{n_uses} uses of one file by another were found");
    if let Some(cycle) = cycle(&uses) {
        panic!("files use each other:\n{cycle}");
    }
}

/// Number of lines with code, without tests.
fn n_lines(text: &str) -> usize {
    let lines = code_tokens(text).into_iter().flat_map(|token| {
        let inside = token.text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
        inside.map(move |(below, _)| token.line + below)
    });
    lines.collect::<BTreeSet<usize>>().len()
}

/// Every crate is small enough for one reader.
#[test]
fn no_crate_is_too_large() {
    assert_eq!(n_lines("fn f() {\n// no\n\n    \"a\n\nb\" }\n#[cfg(test)]\nmod tests {\n}\nfn g() {}"), 4);
    let mut sizes: BTreeMap<String, usize> = BTreeMap::new();
    for (module, text) in sources().iter().filter(|(module, _)| !module.starts_with("program")) {
        *sizes.entry(module.split("::").next().unwrap_or(module).into()).or_default() += n_lines(text);
    }
    assert!(sizes.values().sum::<usize>() > 20_000, "lines of code: {sizes:?}");
    assert!(sizes.values().all(|n| *n <= MOST_LINES), "more than {MOST_LINES} lines of code: {sizes:?}");
}

/// Library files that write commands of the program, with options.
const WRITING_COMMANDS: [&str; 2] = ["crates/figures/src/page/study.rs", "crates/jobs/src/tasks/list.rs"];

/// Numbers of the lines before a file's tests that name a command-line option.
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

/// Library errors name settings. Only the program knows its options.
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
