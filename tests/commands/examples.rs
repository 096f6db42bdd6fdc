//! Every example runs and prints its main result.

use std::process::Command;

/// Standard output of an example.
fn output_of(example: &str, arguments: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO"));
    command.args(["run", "--quiet", "--locked", "--example", example, "--"]).args(arguments);
    let output = command.current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
    assert!(output.status.success(), "{example}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The first number after some words.
fn number(text: &str, after: &str) -> f64 {
    let rest = text.split(after).nth(1).unwrap_or_else(|| panic!("no `{after}`: {text}"));
    let word = rest.split_whitespace().next().expect("a word");
    word.trim_end_matches([',', ';']).parse().unwrap_or_else(|_| panic!("`{word}` after `{after}`: {text}"))
}

/// The compliance equals the exact one of physics §4.10, 1/1.820902396 mm, within the mesh's error.
#[test]
#[ignore = "thorough"]
fn poisson_family() {
    let dir = tempfile::tempdir().unwrap();
    let text = output_of("poisson_family", &[dir.path().to_str().unwrap()]);
    assert!(text.contains("0.48: 1 mode") && text.contains("0.499: 3 modes"), "{text}");
    assert!(text.contains("compliance at 0.48: 549.18 per m"), "{text}");
    assert!(dir.path().join("singular_values.png").is_file());
}

/// An effect from outside the crate is added: the estimate is 30 µm as in the data, and the error falls to the noise of 4 µm.
#[test]
fn custom_effect() {
    let text = output_of("custom_effect", &[]);
    assert!(text.contains("With thermal-drift the error on the last held-out cycle falls"), "{text}");
    let number = |after: &str| number(&text, after);
    assert!(number(" before, ") < 5.0 && number("held-out cycle falls: ") > 6.0, "{text}");
    // Figures show the symbols of its parameters.
    assert!(text.contains("thermal-drift A (m)"), "{text}");
    let amplitude_um = 1e6 * number("thermal-drift.amplitude_m = ");
    assert!((amplitude_um - 30.0).abs() < 10.0, "{text}");
}

/// A field effect from outside the crate: full and reduced model agree, and the effect is not zero.
#[test]
#[ignore = "thorough"]
fn custom_field_effect() {
    let text = output_of("custom_field_effect", &[]);
    for line in text.lines() {
        let (moved_um, error_um) = (number(line, "moves the robot by "), number(line, "differ by "));
        assert!(moved_um > 1.0 && error_um < 1e-3 * moved_um, "{text}");
    }
    assert_eq!(text.lines().count(), 2, "{text}");
}

/// The closed form of the standard linear solid: J(t) = 1/8 + (1 − e^{−4t/6})/4, times 500 per m and 1 µN.
#[test]
fn custom_law() {
    let text = output_of("custom_law", &[]);
    assert!(text.contains("gel_modulus_pa, mesh_modulus_pa, water_viscosity_pa_s"), "{text}");
    let creep = |t: f64| 500.0 * (1.0 / 8.0 + 0.25 * (1.0 - (-4.0 * t / 6.0_f64).exp()));
    for (t, exact_um) in [("1.0", creep(1.0)), ("5.0", creep(5.0)), ("10.0", creep(10.0) - creep(5.0))] {
        let found_um = number(&text, &format!("\n{t} s: "));
        assert!((found_um - exact_um).abs() < 1e-4, "{t} s: {found_um} {exact_um}");
    }
}

/// A custom model under the sampler: its posterior agrees with quadrature within three Monte Carlo errors or a little more (sd/√400 at the fewest draws that
/// count as converged).
#[test]
#[ignore = "thorough"]
fn custom_forward_model() {
    let text = output_of("custom_forward_model", &[]);
    assert!(text.contains("converged: true"), "{text}");
    let (mean, exact_mean) = (number(&text, "sampled: ln τ = "), number(&text, "quadrature: ln τ = "));
    let sds: Vec<f64> = text.lines().map(|line| number(line, "± ")).collect();
    assert!((mean - exact_mean).abs() < 0.2 * sds[1] && (sds[0] / sds[1] - 1.0).abs() < 0.15, "{text}");
}
