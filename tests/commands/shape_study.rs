//! User tests of `shapes`: the paper's claims, the second solver beside the first, sweeps and refusals.

use crate::closed_forms;
use crate::program;

use std::path::Path;

use program::{tree, vitreo};
use serde_json::Value;

fn body<'a>(document: &'a Value, shape: &str, orientation: Option<&str>, rule: &str) -> &'a Value {
    let is_wanted = |value: &&Value| {
        value["shape"] == shape && value["size_rule"] == rule && value["orientation"].as_str() == orientation
    };
    document["bodies"].as_array().unwrap().iter().find(is_wanted).unwrap()
}

fn verdict<'a>(document: &'a Value, claim: &str) -> &'a str {
    let claims = document["claims"].as_array().unwrap();
    claims.iter().find(|value| value["claim"] == claim).unwrap_or_else(|| panic!("{claim}"))["verdict"]
        .as_str()
        .unwrap()
}

/// Closed-form stiffness (m) of the ellipsoid of equal surface along the force (physics §4.3, §4.8).
fn exact_m(document: &Value, poisson_ratio: f64) -> f64 {
    let horizontal = body(document, "ellipsoid", Some("horizontal"), "equal_surface");
    let half_m = |key: &str| 0.5e-3 * horizontal[key].as_f64().unwrap();
    let (semi_major_m, semi_minor_m) = (half_m("length_mm"), half_m("diameter_mm"));
    closed_forms::Spheroid { semi_major_m, semi_minor_m, outer_radius_m: 10e-3 }.stiffness_n_per_m(poisson_ratio, true)
}

/// The paper's study: every required key, two solvers that agree, a closed form, and the verdicts. At this Poisson ratio the axial ellipsoid of equal surface
/// moves more easily than the sphere, contrary to the paper.
#[test]
#[ignore = "thorough"]
fn the_papers_claims_are_judged() {
    let dir = tempfile::tempdir().unwrap();
    let run = vitreo(dir.path(), &["shapes", "--json", "-", "--quiet", "--out", "study"]).exits(0);
    let document = run.json();
    assert_eq!((&document["schema"], &document["poisson_ratio"]), (&"vitreo-uq/shapes/1".into(), &0.48.into()));
    let bodies = document["bodies"].as_array().unwrap();
    assert_eq!(bodies.len(), 10);
    for body in bodies {
        for key in ["stiffness_m", "relative_error", "ratio_to_sphere", "surface_ratio"] {
            assert!(body[key].is_f64(), "{key} in {body}");
        }
        assert!(body["relative_error"].as_f64().unwrap() < 1e-5, "{body}");
        let bar = if body["shape"] == "cylinder" { 5e-3 } else { 5e-4 };
        assert!(body["relative_difference_3d"].as_f64().unwrap().abs() < bar, "{body}");
        let moved = &body["displacement_5s_um"];
        assert!(moved["q05"].as_f64() < moved["median"].as_f64() && moved["median"].as_f64() < moved["q95"].as_f64());
    }
    let stiffness = |value: &Value| value["stiffness_m"].as_f64().unwrap();
    let horizontal = body(&document, "ellipsoid", Some("horizontal"), "equal_surface");
    let exact = exact_m(&document, 0.48);
    assert!((stiffness(horizontal) / exact - 1.0).abs() < 3e-5, "{horizontal} {exact}");
    // Exact stiffness of physics §4.10.
    let sphere = body(&document, "sphere", None, "equal_volume");
    assert!((stiffness(sphere) / 1.820_902_396e-3 - 1.0).abs() < 1e-8);
    assert_eq!(verdict(&document, "at equal volume, the sphere moves easiest"), "holds");
    assert_eq!(verdict(&document, "at equal surface, the sphere moves easiest"), "does not hold");
    for (way, expected) in [("horizontal", "holds"), ("vertical", "does not hold")] {
        let claim = format!("at equal volume, the {way} ellipsoid moves easier than the {way} cylinder");
        assert_eq!(verdict(&document, &claim), expected);
    }
    for shape in ["ellipsoid", "cylinder"] {
        let claim = format!("at equal surface, the {shape} moves easier horizontal than vertical");
        assert_eq!(verdict(&document, &claim), "holds");
    }
    assert_eq!(
        verdict(&document, "at equal volume, resistance is proportional to the surface (within 5 %)"),
        "does not hold"
    );
    let files = tree(&dir.path().join("study/shapes"));
    let names: Vec<String> = files.keys().map(|path| path.display().to_string()).collect();
    let expected = ["cylinder_horizontal", "cylinder_vertical", "ellipsoid_horizontal", "ellipsoid_vertical"]
        .map(|body| format!("{body}.vtu"));
    assert_eq!(names[..4], expected);
    assert_eq!(names[4..], ["shapes.json", "shapes.pdf", "shapes.png", "shapes.svg", "sphere.vtu"]);
    assert_large_strains(&document);
    assert_predicted(dir.path(), &document);
}

/// `predict` varies the shape of one robot and finds the same five bodies under each rule.
fn assert_predicted(dir: &Path, document: &Value) {
    for rule in ["equal_volume", "equal_surface"] {
        let scenario = format!(
            "[[scenario]]\nname = \"robot\"\nforce = {{ steps_un = [[0, {}]] }}\n[[scenario.quantity]]\nkind = \"position_at\"\nat_s = 5\n\
             [scenario.vary]\nshape = [\"sphere\", \"ellipsoid\", \"cylinder\"]\norientation = [\"horizontal\", \"vertical\"]\n\
             aspect = [{}]\nsize_rule = \"{rule}\"\n",
            document["force_uN"], document["aspect"]
        );
        std::fs::write(dir.join("shapes.toml"), scenario).unwrap();
        let predicted = vitreo(dir, &["predict", "study", "--scenario", "shapes.toml", "--json", "-"]).exits(0).json();
        let bodies = document["bodies"].as_array().unwrap().iter().filter(|body| body["size_rule"] == rule);
        let scenarios = predicted["scenarios"].as_array().unwrap();
        assert_eq!(scenarios.len(), 5);
        for (body, scenario) in bodies.zip(scenarios) {
            for key in ["median", "q05", "q95"] {
                let [shown, found] = [&body["displacement_5s_um"][key], &scenario["quantities"][0][key]];
                let ratio = found.as_f64().unwrap() / shown.as_f64().unwrap();
                assert!((ratio - 1.0).abs() < 1e-8, "{rule} {key}: {scenario} for {body}");
            }
        }
    }
}

/// Bodies along the force with large strains. For the sphere an independent program found 27 µm at the end of the first pull, with laws 1 % away from this
/// posterior's. Blunt bodies deviate most. Meshes that fail before the end are marked.
fn assert_large_strains(document: &Value) {
    let large = &document["large_strains"];
    let all = large["bodies"].as_array().unwrap();
    let number = |value: &Value, key: &str| value[key].as_f64().unwrap_or_else(|| panic!("{key} in {value}"));
    let find = |shape: &str, rule: &str, aspect: f64| {
        let is_wanted = |value: &&Value| {
            value["shape"] == shape && value["size_rule"] == rule && (number(value, "aspect") - aspect).abs() < 1e-9
        };
        all.iter().find(is_wanted).unwrap_or_else(|| panic!("{shape} {aspect}"))
    };
    let sphere = find("sphere", "equal_volume", 1.0);
    assert!((number(sphere, "deviation_um") - 27.0).abs() < 1.0, "{sphere}");
    assert!(number(sphere, "lengths_moved") > 1.5 && number(sphere, "error_um") < 0.3, "{sphere}");
    assert!((number(sphere, "deviation_with_mobility_um") - 82.0).abs() < 4.0, "{sphere}");
    let blunt = find("ellipsoid", "equal_volume", 2.0);
    let small = |value: &Value| number(value, "small_strains_um");
    let large_um = |value: &Value| small(value) + number(value, "deviation_um");
    assert!((small(blunt) / small(sphere) - 1.044).abs() < 1e-3, "{blunt}");
    assert!((large_um(blunt) / large_um(sphere) - 1.019).abs() < 1e-3, "{blunt}");
    let median_um = &body(document, "sphere", None, "equal_volume")["displacement_5s_um"]["median"];
    assert!((number(sphere, "small_strains_um") / median_um.as_f64().unwrap() - 1.0).abs() < 1e-12);
    for rule in ["equal_volume", "equal_surface"] {
        let deviations = [sphere, find("ellipsoid", rule, 1.5), find("ellipsoid", rule, 2.0)];
        assert!(
            deviations.iter().all(|deviation| deviation["is_whole"] == true && deviation["followed_s"] == 5.0),
            "{deviations:?}"
        );
        let um = deviations.map(|value| number(value, "deviation_um"));
        assert!(um[0] > um[1] && um[1] > um[2] && um[2] > 0.0, "{um:?}");
        let slender = [find("ellipsoid", rule, 68.0 / 7.0), find("cylinder", rule, 68.0 / 7.0)];
        for value in slender {
            assert!(value["is_whole"] == false && value["deviation_with_mobility_um"].is_null(), "{value}");
            assert!(number(value, "followed_s") < 1.0 && number(value, "radii_moved") > 1.0, "{value}");
            assert!(number(value, "deviation_um").abs() < 0.01 * number(value, "small_strains_um"), "{value}");
        }
        let claim = |part: &str| {
            let claims = large["claims"].as_array().unwrap();
            let title = format!("at {}, the {part}", rule.replace('_', " "));
            claims.iter().find(|value| value["claim"].as_str().unwrap().starts_with(&title)).unwrap()["verdict"].clone()
        };
        assert_eq!(claim("sphere moves easiest of the ellipsoids"), "does not hold");
        assert_eq!(claim("horizontal ellipsoid moves easier"), "holds");
    }
}

/// Sweeps over Poisson ratios: the error bounds at each, and the axial ellipsoid of equal surface against the closed form at every one. Its order relative to the
/// sphere depends on the Poisson ratio, and the output says so.
#[test]
#[ignore = "thorough"]
fn sweeps_keep_to_the_bars_and_say_which_claims_they_change() {
    assert_swept("0.48,0.3", 4);
}

#[test]
#[ignore = "campaigns/long-tests"]
fn sweeps_up_to_nearly_incompressible_gels_keep_to_the_bars() {
    assert_swept("0.48,0.3,0.499", 6);
}

fn assert_swept(poisson_ratios: &str, n_settings: usize) {
    let dir = tempfile::tempdir().unwrap();
    // A law with a springpot has no form for large strains, whose computation would take most of the time. It does not describe this record, and exit code 1 says so.
    let arguments = [
        "shapes",
        "--poisson",
        poisson_ratios,
        "--force-un",
        "4.6,9.2",
        "--base",
        "spring-springpot",
        "--quiet",
        "--out",
        "study",
    ];
    let run = vitreo(dir.path(), &arguments).exits(1);
    for words in [
        "0.48",
        "for other values, at equal surface, the sphere moves easiest: holds at aspect 9.714 and Poisson ratio 0.3",
        "force ±4.600 µN",
        "Note: the largest force is 2.00 times that of the record that taught the law.",
        "NOT TO BE TRUSTED: in the record that taught the law, ",
    ] {
        assert!(run.stdout.contains(words), "{words}\n{run}");
    }
    let text = std::fs::read_to_string(dir.path().join("study/shapes/shapes.json")).unwrap();
    let document: Value = serde_json::from_str(&text).unwrap();
    let sweep = document["sweep"].as_array().unwrap();
    assert_eq!(sweep.len(), n_settings);
    let number = |value: &Value| value.as_f64().unwrap_or_else(|| panic!("{value}"));
    for setting in sweep {
        let nu = number(&setting["poisson_ratio"]);
        for value in setting["bodies"].as_array().unwrap() {
            let bar = if value["shape"] == "cylinder" { 5e-3 } else { 5e-4 };
            assert!(
                number(&value["relative_difference_3d"]).abs() < bar && number(&value["relative_error"]) < 1e-8,
                "{value}"
            );
            assert!(value["mesh_3d"]["unknowns"].as_u64().unwrap() <= 60_000, "{value}");
        }
        let horizontal = body(setting, "ellipsoid", Some("horizontal"), "equal_surface");
        let exact = exact_m(setting, nu);
        assert!((number(&horizontal["stiffness_m"]) / exact - 1.0).abs() < 3e-5, "{horizontal} {exact}");
        let expected = if nu == 0.3 { "holds" } else { "does not hold" };
        assert_eq!(verdict(setting, "at equal surface, the sphere moves easiest"), expected);
    }
    // Twice the force gives twice the displacement.
    let moved = |k: usize| number(&sweep[k]["bodies"][0]["displacement_5s_um"]["median"]);
    assert!((moved(1) / moved(0) - 2.0).abs() < 1e-12);
}

/// The user's own mesh beside the five bodies. It is a mesh of the experiment's sphere, so all its results are known.
#[test]
#[ignore = "thorough"]
fn the_users_mesh_is_set_beside_the_bodies() {
    let dir = tempfile::tempdir().unwrap();
    let mesh = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/gmsh/quarter_sphere_tet10.msh");
    let arguments = [
        "shapes",
        "--mesh",
        mesh,
        "--poisson",
        "0.3",
        "--base",
        "spring-springpot",
        "--json",
        "-",
        "--quiet",
        "--out",
        "study",
    ];
    let document = vitreo(dir.path(), &arguments).exits(1).json();
    let value = &document["own_body"];
    let number = |key: &str| value[key].as_f64().unwrap_or_else(|| panic!("{key} in {value}"));
    println!("{value}");
    let pi = std::f64::consts::PI;
    assert!((number("surface_area_mm2") / (pi * 0.55 * 0.55) - 1.0).abs() < 2e-3);
    assert!((number("volume_mm3") / (pi / 6.0 * 0.55_f64.powi(3)) - 1.0).abs() < 2e-3);
    for key in ["ratio_to_sphere_of_equal_volume", "ratio_to_sphere_of_equal_surface"] {
        let excess = number(key) - 1.0;
        assert!(excess > 0.0 && excess < 0.05, "{key}: tetrahedra are a little too stiff, {excess}");
    }
    let refused = vitreo(dir.path(), &["shapes", "--mesh", "nowhere.msh", "--quiet", "--out", "other"]);
    refused.refuses(&["nowhere.msh"]);
}

#[test]
fn what_makes_no_study_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let refuses = |arguments: &[&str], words: &[&str]| {
        let run = vitreo(dir.path(), &[&["shapes"], arguments].concat()).refuses(words);
        assert!(!dir.path().join("vitreo-uq-out").exists(), "{run}");
    };
    refuses(&["--aspect", "50"], &["--aspect", "between 1 and 20"]);
    refuses(&["--aspect", "3,0.5"], &["--aspect", "0.5"]);
    refuses(&["--poisson", "0.48,0.5"], &["--poisson", "0.4999"]);
    refuses(&["--force-un", "-1"], &["--force-un"]);
    // `--force` means replacing; a force value after it gets a hint to `--force-un`.
    refuses(&["--force", "4.6,9.2"], &["--force", "--force-un 4.6,9.2"]);
    refuses(&["somewhere", "--force", "4.6"], &["--force-un 4.6"]);
    refuses(&["--force", "-1"], &["--force-un -1"]);
}
