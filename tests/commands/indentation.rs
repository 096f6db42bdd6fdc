//! Every command on an indentation: it works or explains why it cannot.

use crate::program;

use std::path::Path;

use program::vitreo;
use serde_json::Value;
use vitreo_uq::models::effects::EFFECTS;

/// Writes an indentation of a gel with E = 400 Pa, c₁ = 200 Pa·s and c₂ = 3,000 Pa·s by a sphere of 5 µm radius, at 25 Hz: 1 s free, 1 s with the force growing
/// to 10 nN, 3 s of hold, 0.6 s of retraction. The free tip shows a force of 11.2 nN, and a fixed recurrence generates noise of 5 nm.
fn write_indentation(dir: &Path) {
    std::fs::create_dir_all(dir).unwrap();
    let toml = "[specimen]\nid = \"gel\"\n[indenter]\nexponent = 1.5\ntip_radius_um = 500\n[measurement]\nfile = \"clamp.csv\"\ndirection = \"-\"\nnoise_um = 0.005\ncycle_starts_s = [0, 4]\nsource = \"synthetic\"\n[measurement.columns]\ntime = 1\nforce = 2\nposition = 3\n[measurement.units]\ntime = \"s\"\nforce = \"nN\"\nposition = \"um\"\n";
    std::fs::write(dir.join("experiment.toml"), toml).unwrap();
    let mut normal = program::normals();
    let (e, c1, c2, k) = (400.0, 200.0, 3000.0, 0.75 * 0.75 / f64::sqrt(5e-4));
    let (step_s, n_free, n_growing, n_pressed) = (0.04, 25, 50, 125);
    let decay = f64::exp(-step_s * e / c1);
    let mut csv = String::from("t,F,z\n");
    let (mut retarded, mut flow, mut depth_um) = (0.0, 0.0, 0.0);
    for row in 0..140 {
        let grown = (f64::from(row - n_free + 1) / f64::from(n_growing - n_free)).clamp(0.0, 1.0);
        let force_n = if row < n_pressed { 1e-8 * grown.powf(1.5) } else { 0.0 };
        depth_um = match row {
            _ if row < n_free => 0.4 * f64::from(row - n_free),
            _ if row < n_pressed => 1e6 * f64::powf(k * (retarded / e + flow / c2), 1.0 / 1.5),
            _ => depth_um - 0.4,
        };
        let noise_um = 0.005 * normal();
        let force_noise_nn = 1e-4 * normal();
        let height_um = 40.0 - depth_um + noise_um;
        csv += &format!("{:.2},{:.6},{height_um:.6}\n", step_s * f64::from(row), 11.2 + 1e9 * force_n + force_noise_nn);
        retarded = decay * retarded + (1.0 - decay) * force_n;
        flow += step_s * force_n;
    }
    std::fs::write(dir.join("clamp.csv"), csv).unwrap();
}

const PRIOR: [&str; 2] = ["--prior", "generic"];

fn names(parameters: &Value) -> Vec<&str> {
    parameters.as_array().unwrap().iter().map(|value| value["name"].as_str().unwrap()).collect()
}

const OFFSET: &str = "position-offset.offset_m";

/// The estimate is within 5 standard errors of the truth (one failure in 10⁶ for another seed), and the output describes the processing of the record.
#[test]
fn fit_says_what_is_left_of_the_record() {
    let dir = tempfile::tempdir().unwrap();
    write_indentation(&dir.path().join("gel"));
    let run = vitreo(dir.path(), &[&["fit", "gel", "--json", "-"][..], &PRIOR].concat()).exits(0);
    let document = run.json();
    let parameters = &document["parameters"];
    assert_eq!(names(parameters), ["young_modulus_pa", "viscosity_1_pa_s", "viscosity_2_pa_s", OFFSET]);
    for (parameter, truth) in parameters.as_array().unwrap().iter().zip([400.0, 200.0, 3000.0]) {
        let (value, error) = (parameter["value"].as_f64().unwrap(), parameter["standard_error"].as_f64().unwrap());
        assert!((value - truth).abs() < 5.0 * error, "{parameter} for {truth}");
    }
    for words in ["the contact grows from", "nN is subtracted", "rows before", "are left out", "position-offset"] {
        assert!(run.stderr.contains(words), "`{words}` is missing in {run}");
    }
    let toml = dir.path().join("gel/experiment.toml");
    let unknown = std::fs::read_to_string(&toml).unwrap().replace("tip_radius_um = 500\n", "");
    std::fs::write(&toml, unknown).unwrap();
    let run = vitreo(dir.path(), &[&["fit", "gel", "--out", "nominal"][..], &PRIOR].concat()).exits(0);
    assert!(run.stderr.contains("one unknown common factor"), "{run}");
}

/// The library omits effects that need finite elements or a linear position; `simulate` and `shapes` name their requirements.
#[test]
fn what_makes_no_sense_is_left_out_with_the_reason() {
    let dir = tempfile::tempdir().unwrap();
    write_indentation(&dir.path().join("gel"));
    let document = vitreo(dir.path(), &[&["effects", "gel", "--json", "-"][..], &PRIOR].concat()).exits(0).json();
    for entry in document["effects"].as_array().unwrap() {
        let effect = EFFECTS.iter().find(|effect| entry["slug"] == effect.slug()).expect("of the library");
        let is_refused = effect.needs_finite_elements() || effect.depends_on_position();
        assert_eq!(
            (entry["visible_fraction"].is_null(), entry["refused"].is_string()),
            (is_refused, is_refused),
            "{entry}"
        );
    }
    vitreo(dir.path(), &["simulate", "gel"]).refuses(&["no finite elements", "[robot]"]);
    vitreo(dir.path(), &["shapes", "gel"]).refuses(&["[robot] and [vitreous]"]);
    vitreo(dir.path(), &["fit", "gel", "--with", "force-gradient"]).refuses(&["force-gradient", "indenter"]);
    vitreo(dir.path(), &["fit", "gel", "--with", "inertia"]).refuses(&["inertia", "finite elements"]);
    vitreo(dir.path(), &["fit", "gel", "--with", "position-offset"]).refuses(&["position-offset"]);
}

/// Sample, compare, diagnose, extend and ladder each write their document, with the contact point. A correct model lacks nothing.
#[test]
#[ignore = "thorough"]
fn the_loop_goes_round() {
    let dir = tempfile::tempdir().unwrap();
    write_indentation(&dir.path().join("gel"));
    let sample =
        vitreo(dir.path(), &[&["sample", "gel", "--out", "a", "--json", "-", "--quiet"][..], &PRIOR].concat()).exits(0);
    let document = sample.json();
    assert!(names(&document["parameters"]).contains(&OFFSET), "{document}");
    assert_eq!(document["heldout"]["cycles"], serde_json::json!([2]));
    // 25 predicted positions with noise of 5 nm: the error is below twice the noise and above half of it, except once in 10⁵.
    let rmse_um = document["heldout"]["rmse_um"].as_f64().unwrap();
    assert!((0.0025..0.01).contains(&rmse_um), "{rmse_um}");
    let compared = vitreo(dir.path(), &["compare", "a", "--json", "-", "--quiet"]).exits(0).json();
    assert!(compared["rmse_heldout_um"].as_f64().unwrap() < 0.01, "{compared}");
    let diagnosis = vitreo(dir.path(), &["diagnose", "a", "--json", "-", "--quiet"]).exits(0).json();
    assert_ne!(diagnosis["verdict"]["kind"], "missing", "{diagnosis}");
    assert_eq!(diagnosis["separating_protocol"], "", "{diagnosis}");
    let extended = vitreo(dir.path(), &["extend", "a", "--with", "tracking-drift", "--json", "-", "--quiet"]);
    assert!([0, 1].contains(&extended.code), "{extended}");
    assert!(names(&extended.json()["parameters"]).contains(&OFFSET), "{extended}");
    let ladder = vitreo(dir.path(), &["ladder", "a", "--json", "-", "--quiet"]);
    assert!([0, 1].contains(&ladder.code), "{ladder}");
    assert_eq!(ladder.json()["revisions"].as_array().unwrap().len(), 2, "{ladder}");
}
