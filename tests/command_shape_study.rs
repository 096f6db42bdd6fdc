//! `shapes` as a user meets it: the paper's claims, the second solver beside the first, sweeps and refusals.

mod program;

use program::{tree, vitreo};
use serde_json::Value;

fn body<'a>(document: &'a Value, shape: &str, orientation: Option<&str>, rule: &str) -> &'a Value {
    let is_wanted =
        |own: &&Value| own["shape"] == shape && own["size_rule"] == rule && own["orientation"].as_str() == orientation;
    document["bodies"].as_array().unwrap().iter().find(is_wanted).unwrap()
}

fn verdict<'a>(document: &'a Value, claim: &str) -> &'a str {
    let claims = document["claims"].as_array().unwrap();
    claims.iter().find(|own| own["claim"] == claim).unwrap_or_else(|| panic!("{claim}"))["verdict"].as_str().unwrap()
}

/// Stiffness of a prolate spheroid at the centre of a ball, Poisson ratio 0.48, along its axis: physics §4.3 and §4.8, written anew.
fn spheroid_m(a: f64, b: f64, outer: f64) -> f64 {
    let (nu, pi) = (0.48, std::f64::consts::PI);
    let mu = 1.0 / (2.0 * (1.0 + nu));
    let e = (1.0 - (b / a) * (b / a)).sqrt();
    let l = ((1.0 + e) / (1.0 - e)).ln();
    let (chi, alpha) = (l / (a * e), (l - 2.0 * e) / (a * e).powi(3));
    let free = 32.0 * pi * mu * (1.0 - nu) / ((3.0 - 4.0 * nu) * chi + a * a * alpha);
    let kappa = 1.0 / (16.0 * pi * mu * (1.0 - nu));
    let b2 = kappa / (2.0 * (2.0 - 3.0 * nu) * outer.powi(3));
    let b0 = -kappa / outer * ((3.0 - 4.0 * nu) + (3.0 - 2.0 * nu) / (2.0 * (2.0 - 3.0 * nu)));
    let g = b2 * ((3.0 - 2.0 * nu) * (a * a + 2.0 * b * b) / 3.0 - 2.0 * (2.0 - 3.0 * nu) * a * a / 3.0);
    1.0 / (1.0 / free + b0 + 2.0 * g)
}

/// The paper's study: every key of the contract, two solvers that agree, a closed form, and what holds. The axial ellipsoid of equal surface
/// moves easier than the sphere at this Poisson ratio, whatever the paper says.
#[test]
fn the_papers_claims_are_judged() {
    let dir = tempfile::tempdir().unwrap();
    let run = vitreo(dir.path(), &["shapes", "--json", "-", "--quiet", "--out", "study"]).exits(0);
    let document = run.json();
    assert_eq!((&document["schema"], &document["poisson_ratio"]), (&"vitreo-uq/shapes/1".into(), &0.48.into()));
    let bodies = document["bodies"].as_array().unwrap();
    assert_eq!(bodies.len(), 10);
    for own in bodies {
        for key in ["stiffness_m", "relative_error", "ratio_to_sphere", "surface_ratio"] {
            assert!(own[key].is_f64(), "{key} in {own}");
        }
        assert!(own["relative_error"].as_f64().unwrap() < 1e-5, "{own}");
        let bar = if own["shape"] == "cylinder" { 5e-3 } else { 5e-4 };
        assert!(own["relative_difference_3d"].as_f64().unwrap().abs() < bar, "{own}");
        let moved = &own["displacement_5s_um"];
        assert!(moved["q05"].as_f64() < moved["median"].as_f64() && moved["median"].as_f64() < moved["q95"].as_f64());
    }
    let stiffness = |own: &Value| own["stiffness_m"].as_f64().unwrap();
    let horizontal = body(&document, "ellipsoid", Some("horizontal"), "equal_surface");
    let half = |key: &str| 0.5e-3 * horizontal[key].as_f64().unwrap();
    let exact = spheroid_m(half("length_mm"), half("diameter_mm"), 10e-3);
    assert!((stiffness(horizontal) / exact - 1.0).abs() < 3e-5, "{horizontal} {exact}");
    // Physics §4.10.
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
    assert_eq!(names, ["shapes.json", "shapes.png", "shapes.svg"]);
    let longest = document["longest"].as_array().unwrap();
    assert_eq!(longest.len(), 4);
    assert!(longest.iter().all(|own| own["surrogate_relative_error"].as_f64().unwrap() < 1e-3), "{longest:?}");
}

#[test]
fn what_makes_no_study_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let refuses = |arguments: &[&str], words: &[&str]| {
        let run = vitreo(dir.path(), &[&["shapes"], arguments].concat()).refuses(words);
        assert!(!dir.path().join("vitreo-uq-out").exists(), "{run}");
    };
    refuses(&["--aspect", "50"], &["--aspect", "between 1 and 20"]);
    refuses(&["--poisson", "0.5"], &["--poisson", "0.4999"]);
    refuses(&["--force", "-1"], &["--force"]);
    refuses(&["--distance", "0"], &["--distance"]);
}
