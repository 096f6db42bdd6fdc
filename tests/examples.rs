//! Every example runs, and says the number that it is there for.

use std::process::Command;

/// Standard output of an example.
fn output_of(example: &str, arguments: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO"));
    command.args(["run", "--quiet", "--locked", "--example", example, "--"]).args(arguments);
    let output = command.current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
    assert!(output.status.success(), "{example}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The compliance is the exact one of physics §4.10, 1/1.820902396 mm, to the mesh's error.
#[test]
fn poisson_family() {
    let dir = tempfile::tempdir().unwrap();
    let text = output_of("poisson_family", &[dir.path().to_str().unwrap()]);
    assert!(text.contains("0.48: 1 mode") && text.contains("0.499: 3 modes"), "{text}");
    assert!(text.contains("compliance at 0.48: 549.18 per m"), "{text}");
    assert!(dir.path().join("singular_values.png").is_file());
}

/// An effect from outside the crate is extended by: the 30 µm that the data were given come back, the error falls to the noise of 4 µm.
#[test]
fn custom_effect() {
    let text = output_of("custom_effect", &[]);
    assert!(text.contains("With thermal-drift the error on the held-out cycle falls"), "{text}");
    let number = |after: &str| -> f64 {
        let rest = text.split(after).nth(1).unwrap_or_else(|| panic!("no `{after}`: {text}"));
        rest.split_whitespace().next().unwrap().parse().unwrap()
    };
    assert!(number(" before, ") < 5.0 && number("held-out cycle falls: ") > 6.0, "{text}");
    let amplitude_um = 1e6 * number("thermal-drift.amplitude_m = ");
    assert!((amplitude_um - 30.0).abs() < 10.0, "{text}");
}
