//! Makes safe names of files and directories from text by people or other programs.

/// Largest length of a name in bytes. File systems limit names by bytes, and temporary names add a prefix and a suffix.
const LONGEST_BYTES: usize = 80;
/// Device names on Windows, which are reserved with and without an extension.
const DEVICES: [&str; 4] = ["con", "prn", "aux", "nul"];
/// Prefixes of numbered device names on Windows, such as `com1`. A name is reserved if exactly one digit follows the prefix.
const PORTS: [&str; 2] = ["com", "lpt"];

/// Converts text to a name that every file system accepts. No program takes it for an option, a hidden file or another directory. Letters, digits, `-`,
/// `_` and `.` stay; all other characters become `-`. The name has at most 80 bytes, does not start with `.` or `-`, does not end with `.`, and is not a
/// device name. An empty result becomes `specimen`.
pub fn safe_name(text: &str) -> String {
    let keep = |c: char| if c.is_alphanumeric() || matches!(c, '-' | '_' | '.') { c } else { '-' };
    let mut safe = String::new();
    for c in text.trim().chars().map(keep).skip_while(|c| matches!(c, '-' | '.')) {
        if safe.len() + c.len_utf8() > LONGEST_BYTES {
            break;
        }
        safe.push(c);
    }
    safe.truncate(safe.trim_end_matches('.').len());
    let stem = safe.split('.').next().unwrap_or_default();
    if is_device(stem) {
        safe.insert(stem.len(), '_');
    }
    if safe.is_empty() { "specimen".to_string() } else { safe }
}

fn is_device(stem: &str) -> bool {
    let stem = stem.to_lowercase();
    let is_port = |port: &str| {
        let mut rest = stem.strip_prefix(port).unwrap_or_default().chars();
        rest.next().is_some_and(char::is_numeric) && rest.next().is_none()
    };
    DEVICES.contains(&stem.as_str()) || PORTS.into_iter().any(is_port)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_safe_and_readable() {
        for (text, name) in [
            ("porcine-01", "porcine-01"),
            ("left eye", "left-eye"),
            ("眼睛 1", "眼睛-1"),
            ("--force", "force"),
            ("-", "specimen"),
            (".-.hidden", "hidden"),
            ("../../etc/passwd", "etc-passwd"),
            ("a\u{202e}fdp", "a-fdp"),
            ("a\n\"$(b)\"\\c%2e", "a----b---c-2e"),
            ("name...", "name"),
            ("NUL", "NUL_"),
            ("com1.csv", "com1_.csv"),
            ("com10", "com10"),
            ("console", "console"),
            ("", "specimen"),
        ] {
            assert_eq!(safe_name(text), name, "{text:?}");
        }
        let long = safe_name(&"ä".repeat(500));
        assert_eq!((long.len(), long.chars().count()), (80, 40));
    }
}
