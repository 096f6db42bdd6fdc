//! Hash of Rust sources for build scripts. It covers only code: comments, white space and tests do not change it.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;

/// Hashes files and the files below directories, and makes Cargo watch each of them. Test files are left out.
///
/// Directories are not watched, because Cargo would then run the build script after every edit of a test. A new source file is
/// noticed through the `mod` line that declares it.
///
/// # Errors
/// Errors of reading a file or directory, with its path.
pub fn of<'a>(places: impl IntoIterator<Item = &'a Path>) -> std::io::Result<u64> {
    let mut hash = DefaultHasher::new();
    places.into_iter().try_for_each(|place| add(place, &mut hash))?;
    Ok(hash.finish())
}

fn add(path: &Path, hash: &mut DefaultHasher) -> std::io::Result<()> {
    let at_path = |error: std::io::Error| std::io::Error::new(error.kind(), format!("{}: {error}", path.display()));
    if path.is_dir() {
        let entries = std::fs::read_dir(path).map_err(at_path)?;
        let mut paths = entries.map(|entry| entry.map(|e| e.path())).collect::<Result<Vec<_>, _>>()?;
        paths.sort();
        return paths.iter().try_for_each(|path| add(path, hash));
    }
    if is_test(path) {
        return Ok(());
    }
    println!("cargo:rerun-if-changed={}", path.display());
    let bytes = std::fs::read(path).map_err(at_path)?;
    match (path.extension(), std::str::from_utf8(&bytes)) {
        (Some(ending), Ok(text)) if ending == "rs" => code(text).hash(hash),
        _ => bytes.hash(hash),
    }
    Ok(())
}

/// Returns `true` if the file's name marks it as a test file in this project.
fn is_test(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name == "tests.rs" || name.ends_with("_tests.rs") || name.starts_with("test_")
}

/// Code of a source file, without comments, white space outside literals, and the tests at its end.
pub fn code(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or(text);
    let mut kept = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let length = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if let Some(length) = literal(rest).filter(|_| !ends_in_word(&kept)) {
            kept.push_str(&rest[..length]);
            length
        } else {
            if !first.is_whitespace() {
                kept.push(first);
            }
            first.len_utf8()
        };
        rest = &rest[length..];
    }
    kept
}

/// Returns `true` if the kept code ends inside a name. An `r` that follows then belongs to the name and does not begin a raw string.
fn ends_in_word(kept: &str) -> bool {
    kept.chars().next_back().is_some_and(|last| last.is_alphanumeric() || last == '_')
}

/// Length in bytes of the string or character literal at the start of a text.
fn literal(text: &str) -> Option<usize> {
    let unprefixed = text.strip_prefix(['b', 'c']).unwrap_or(text);
    let prefix = text.len() - unprefixed.len();
    if let Some(raw) = unprefixed.strip_prefix('r') {
        let n_hashes = raw.len() - raw.trim_start_matches('#').len();
        let end = format!("\"{}", "#".repeat(n_hashes));
        let inside = raw[n_hashes..].strip_prefix('"')?;
        return inside.find(&end).map(|at| text.len() - inside.len() + at + end.len());
    }
    let quote = unprefixed.chars().next().filter(|first| ['"', '\''].contains(first))?;
    let mut characters = unprefixed.char_indices().skip(1);
    let mut n_inside = 0;
    while let Some((at, character)) = characters.next() {
        match character {
            '\\' => drop(characters.next()),
            end if end == quote => return Some(prefix + at + 1),
            _ => {}
        }
        n_inside += 1;
        // A lifetime is not a literal: 'a has no second quote after one character or one escape.
        if quote == '\'' && n_inside > 1 && !unprefixed.starts_with("'\\") {
            return None;
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::code;

    #[test]
    fn comments_white_space_and_tests_change_nothing() {
        let plain = "fn f<'a>(x: &'a str) -> char { let s = \"a // b\"; '\"' }";
        let other = "/// Says what.\nfn f<'a>( x: &'a str ) -> char {\n    // why\n    let s = \"a // b\"; '\"'\n}\n#[cfg(test)]\nmod tests {\n}";
        assert_eq!(code(plain), code(other));
        assert!(code(plain).contains("\"a // b\"") && code(plain).ends_with("'\"'}"), "{}", code(plain));
    }

    #[test]
    fn code_and_literals_count() {
        assert_ne!(code("let x = 1;"), code("let x = 2;"));
        assert_ne!(code("let x = \"a b\";"), code("let x = \"ab\";"));
        assert_ne!(code("let x = r#\"// \"a\"#;"), code("let x = r#\"// \"b\"#;"));
        assert_ne!(code("'\\u{1F600}' // x"), code("'\\u{1F601}' // x"));
    }
}
