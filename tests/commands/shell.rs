//! Completions and manual pages contain every command.

use crate::program;

use std::process::Command;

use program::{tree, vitreo};

/// Commands that `--help` lists.
fn commands(dir: &std::path::Path) -> Vec<String> {
    let help = vitreo(dir, &["--help"]).exits(0).stdout;
    let list = help.split("Commands:\n").nth(1).unwrap().split("\n\n").next().unwrap();
    let names: Vec<String> = list
        .lines()
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next().map(String::from))
        .collect();
    assert!(names.len() > 15 && names.contains(&"serve".into()), "{names:?}");
    names
}

#[test]
fn every_command_is_completed_and_bash_reads_it() {
    let place = tempfile::tempdir().unwrap();
    let names = commands(place.path());
    for (shell, mark) in [
        ("bash", "complete -F"),
        ("zsh", "#compdef vitreo-uq"),
        ("fish", "complete -c vitreo-uq"),
        ("elvish", "edit:completion"),
        ("powershell", "Register-ArgumentCompleter"),
    ] {
        let script = vitreo(place.path(), &["completions", shell]).exits(0).stdout;
        assert!(script.contains(mark), "{shell}");
        for name in &names {
            assert!(script.contains(name.as_str()), "{name} is missing for {shell}");
        }
        if shell == "bash" {
            // Every command has its own case.
            for name in &names {
                assert!(script.contains(&format!("vitreo__uq,{name})\n")), "{name}");
            }
            std::fs::write(place.path().join("completion.bash"), &script).unwrap();
            if let Ok(status) = Command::new("bash").args(["-n", "completion.bash"]).current_dir(place.path()).status()
            {
                assert!(status.success());
            }
        }
    }
    vitreo(place.path(), &["completions", "csh"]).refuses(&["csh", "bash"]);
}

#[test]
fn every_command_has_a_manual_page() {
    let place = tempfile::tempdir().unwrap();
    let names = commands(place.path());
    vitreo(place.path(), &["man", "--out", "pages/man1"]).exits(0);
    let pages = tree(&place.path().join("pages/man1"));
    let page = |name: &str| {
        let bytes = pages.get(std::path::Path::new(&format!("{name}.1"))).unwrap_or_else(|| panic!("{name}"));
        String::from_utf8(bytes.clone()).unwrap()
    };
    assert!(page("vitreo-uq").contains(".TH vitreo-uq 1"));
    for name in names.iter().filter(|name| *name != "help") {
        let text = page(&format!("vitreo-uq-{name}"));
        assert!(text.contains(".SH SYNOPSIS") && text.contains("vitreo\\-uq"), "{name}: {text}");
    }
    // Nested commands and their options.
    assert!(page("vitreo-uq-challenge-new").contains("seed"));
    assert!(page("vitreo-uq-serve").contains("port"));
    // Writing again over existing pages gives the same bytes and nothing else.
    vitreo(place.path(), &["man", "--out", "pages/man1", "--quiet"]).exits(0);
    assert_eq!(tree(&place.path().join("pages/man1")), pages);
    std::fs::write(place.path().join("file"), "x").unwrap();
    vitreo(place.path(), &["man", "--out", "file"]).refuses(&["file", "give a writable directory"]);
}
