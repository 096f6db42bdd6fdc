//! A rheometer's oscillation, from its table to a claim, and joined with a creep record of the same gel.

use crate::program;

use std::path::Path;

use program::{vitreo, write_instrument_experiment};
use serde_json::Value;

/// Writes the moduli of a gel with E = 3.5 Pa, c₁ = 1.4 Pa·s, c₂ = `c2_pa_s` and a spring of `spring_pa` in series, at 25 frequencies from 0.02 to 20 Hz. A
/// fixed recurrence adds 2 % of noise. The table has tabs, decimal commas, a line of units and an unused column.
fn write_table(file: &Path, c2_pa_s: f64, spring_pa: f64) {
    let mut normal = program::normals();
    let mut text = String::from(
        "Oscillation - frequency sweep\nAngular frequency\tStorage modulus\tLoss modulus\tTemperature\nrad/s\tPa\tPa\t°C\n",
    );
    for k in 0..25 {
        let omega = std::f64::consts::TAU * 0.02 * 1000f64.powf(f64::from(k) / 24.0);
        // Real and imaginary part of the compliance 1/(E + iωc₁) + 1/(iωc₂) + 1/E₀, with angular frequency ω and the spring's modulus E₀.
        let square = 3.5 * 3.5 + (1.4 * omega) * (1.4 * omega);
        let (re, im) = (3.5 / square + 1.0 / spring_pa, -1.4 * omega / square - 1.0 / (omega * c2_pa_s));
        let size = 1.0 / (3.0 * re.hypot(im));
        let [storage, loss] = [re, -im].map(|part| part / re.hypot(im) * size + 0.02 * size * normal());
        text += &format!("{omega:.6}\t{storage:.6}\t{loss:.6}\t37.0\n").replace('.', ",");
    }
    std::fs::write(file, text).unwrap();
}

fn median(document: &Value, name: &str) -> [f64; 3] {
    let all = document["parameters"].as_array().unwrap();
    let value = all.iter().find(|value| value["name"] == name).unwrap_or_else(|| panic!("{name} in {document}"));
    ["q05", "median", "q95"].map(|key| value[key].as_f64().unwrap())
}

/// Asserts that the 90 % interval, widened by half on both sides, contains the truth. One of three such intervals misses the truth for 1 of 100 seeds.
fn covers(document: &Value, name: &str, truth: f64) {
    let [lower, middle, upper] = median(document, name);
    assert!(
        middle - 1.5 * (middle - lower) < truth && truth < middle + 1.5 * (upper - middle),
        "{name}: {lower} to {upper} for {truth}"
    );
}

#[test]
fn a_table_of_moduli_becomes_a_posterior() {
    let place = tempfile::tempdir().unwrap();
    let dir = place.path();
    write_table(&dir.join("sweep.txt"), 47.0, 1e9);
    let said = vitreo(dir, &["init", "sweep.txt", "--id", "gel"]).exits(0);
    assert!(said.stdout.contains("an oscillation of a rheometer") && said.stdout.contains("Temperature"), "{said}");
    vitreo(dir, &["check", "sweep"]).exits(0);
    assert!(dir.join("record.png").is_file());
    let document = vitreo(dir, &["sample", "sweep", "--out", "study", "--json", "-"]).exits(0).json();
    assert_eq!(document["schema"], "vitreo-uq/oscillation/1");
    for (name, truth) in [("young_modulus_pa", 3.5), ("viscosity_1_pa_s", 1.4), ("viscosity_2_pa_s", 47.0)] {
        covers(&document, name, truth);
    }
    for file in ["posterior.json", "draws.csv", "model.toml", "figures/moduli.png", "figures/corner.svg"] {
        assert!(dir.join("study/m0").join(file).is_file(), "{file}");
    }
    let again = vitreo(dir, &["sample", "sweep", "--out", "other", "--threads", "1", "--quiet"]).exits(0);
    assert!(again.stdout.contains("converged"));
    let draws = |study: &str| std::fs::read(dir.join(study).join("m0/draws.csv")).unwrap();
    assert!(draws("study") == draws("other"), "the bytes depend on the number of threads");
    // Other commands name their requirements.
    vitreo(dir, &["fit", "sweep"]).refuses(&["this is an oscillation", "force and position over time"]);
    vitreo(dir, &["sample", "sweep", "--noise", "white,ou"]).refuses(&["--noise", "no rows over time"]);
}

/// A line above the table says tension where the columns say neither tension nor shear.
#[test]
fn a_line_above_moduli_names_tension() {
    let place = tempfile::tempdir().unwrap();
    let dir = place.path();
    write_table(&dir.join("plain.txt"), 47.0, 1e9);
    let text = std::fs::read_to_string(dir.join("plain.txt")).unwrap();
    for (name, line, is_young) in
        [("film", "Clamp: Tension, film", true), ("plate", "Geometry: parallel plate 25 mm", false)]
    {
        std::fs::write(dir.join(format!("{name}.txt")), format!("{line}\n{text}")).unwrap();
        let said = vitreo(dir, &["init", &format!("{name}.txt")]).exits(0);
        assert_eq!(said.stdout.contains(line), is_young, "{said}");
        let toml = std::fs::read_to_string(dir.join(name).join("experiment.toml")).unwrap();
        assert_eq!(toml.contains("\nmoduli = \"young\""), is_young, "{toml}");
    }
}

/// A frequency is known by its unit, and a negative modulus is told.
#[test]
fn a_sweep_with_inertia_is_told() {
    let place = tempfile::tempdir().unwrap();
    let row = |k: i32| format!("{},{},{}\n", 0.1 * 1.5f64.powi(k), 100.0 - 0.1 * f64::from(k * k * k), 10.0);
    let text = "w (rad/s),G'(Pa),G''(Pa)\n".to_string() + &(0..14).map(row).collect::<String>();
    std::fs::write(place.path().join("sweep.csv"), text).unwrap();
    vitreo(place.path(), &["init", "sweep.csv"]).exits(0);
    let said = vitreo(place.path(), &["check", "sweep"]).exits(0);
    assert!(said.stdout.contains("a modulus is negative at 3 of 14 frequencies"), "{said}");
}

/// Moduli of two samples beside each other have names that say too little. The user names a pair, with a modulus and a loss modulus, a phase or a loss tangent.
#[test]
fn columns_of_moduli_are_named_by_the_user() {
    let place = tempfile::tempdir().unwrap();
    let dir = place.path();
    let row = |k: i32| {
        let f = 0.1 * 1.5_f64.powi(k);
        format!("{f},100,10,{},{},0.1,5.7\n", 200.0 + f, 20.0 + f)
    };
    let header = "f (Hz),A storage (Pa),A loss (Pa),B storage (Pa),B loss (Pa),B tan,B angle (deg)\n";
    std::fs::write(dir.join("two.csv"), header.to_string() + &(0..14).map(row).collect::<String>()).unwrap();
    let refused = ["`f (Hz)` is a frequency", "`--moduli COLUMN COLUMN`"];
    vitreo(dir, &["init", "two.csv"]).refuses(&refused);
    for (pair, keys) in [
        (["B storage (Pa)", "B loss (Pa)"], ["storage = \"B storage (Pa)\"", "loss = \"B loss (Pa)\""]),
        (["4", "6"], ["storage = \"B storage (Pa)\"", "loss_tangent = \"B tan\""]),
        (["B storage (Pa)", "B angle (deg)"], ["modulus = \"B storage (Pa)\"", "phase = \"B angle (deg)\""]),
    ] {
        vitreo(dir, &["init", "two.csv", "--replace", "--moduli", pair[0], pair[1]]).exits(0);
        let toml = std::fs::read_to_string(dir.join("two/experiment.toml")).unwrap();
        assert!(keys.iter().all(|key| toml.contains(key)), "{toml}");
        vitreo(dir, &["check", "two"]).exits(0);
    }
    let twice = ["init", "two.csv", "--replace", "--moduli", "4", "4"];
    vitreo(dir, &twice).refuses(&["--moduli", "the same column is given twice"]);
    let text = std::fs::read_to_string(dir.join("two.csv")).unwrap();
    std::fs::write(dir.join("one.csv"), text.replace("B storage", "Storage modulus").replace("B loss", "Loss modulus"))
        .unwrap();
    vitreo(dir, &["init", "one.csv", "--moduli", "5", "4"])
        .refuses(&["`Loss modulus (Pa)` stands in the place of the storage"]);
    let unknown = ["init", "two.csv", "--replace", "--moduli", "C storage", "B loss (Pa)"];
    vitreo(dir, &unknown).refuses(&["--moduli", "there is no column `C storage`"]);
}

/// A Lethersich law with a spring in series is two Maxwell bodies in parallel, of which the moduli add up to that of the spring. Laws of two elements do not explain it.
#[test]
fn laws_of_a_table_of_moduli_are_ranked() {
    let place = tempfile::tempdir().unwrap();
    let dir = place.path();
    write_table(&dir.join("sweep.txt"), 47.0, 30.0);
    vitreo(dir, &["init", "sweep.txt"]).exits(0);
    let compared = |laws: &str, exit_code: i32| {
        let run = vitreo(dir, &["compare", "sweep", "--laws", laws, "--out", "study"]).exits(exit_code);
        assert!(dir.join("study/laws.png").is_file());
        let text = std::fs::read_to_string(dir.join("study/laws.json")).unwrap();
        (serde_json::from_str::<Value>(&text).unwrap(), run.stdout)
    };
    let (found, said) = compared("maxwell,lethersich,two-mode-maxwell", 0);
    let best = &found["laws"][0];
    assert_eq!((&best["law"], &best["status"]), (&"two-mode-maxwell".into(), &"likeliest".into()), "{said}");
    // The table's noise is 2 % of |G*| for each modulus.
    let error = best["misfit"]["relative_fitted"].as_f64().unwrap();
    assert!((0.014..0.026).contains(&error), "{error}");
    let moduli = best["parameters"].as_array().unwrap().iter();
    let moduli = moduli.filter(|parameter| parameter["name"].as_str().unwrap().ends_with("_modulus_pa"));
    let sum: f64 = moduli.map(|parameter| parameter["mean"].as_f64().unwrap()).sum();
    assert!((sum - 30.0).abs() < 3.0, "{sum}");
    assert!(said.contains("its residuals are noise") && said.contains("fitted (%)"), "{said}");
    let fixed =
        ["compare", "sweep", "--laws", "two-mode-maxwell", "--set", "second_flow_viscosity_pa_s=47", "--out", "other"];
    vitreo(dir, &fixed).exits(0);
    let (found, said) = compared("maxwell,kelvin-voigt", 1);
    assert_eq!(found["is_explained"], false, "{said}");
    assert!(said.contains("No law explains the record"), "{said}");
}

/// `sample` and `diagnose` agree on a law that lacks a spring. With the spring nothing is missing.
#[test]
#[ignore = "thorough"]
fn a_missing_spring_is_found_and_added() {
    let place = tempfile::tempdir().unwrap();
    let dir = place.path();
    write_table(&dir.join("sweep.txt"), 47.0, 30.0);
    vitreo(dir, &["init", "sweep.txt"]).exits(0);
    vitreo(dir, &["sample", "sweep", "--out", "study"]).exits(1);
    let found = vitreo(dir, &["diagnose", "study", "--json", "-"]).exits(0).json();
    assert_eq!(
        (&found["verdict"]["kind"], &found["verdict"]["effects"][0]),
        (&"missing".into(), &"instantaneous-elasticity".into())
    );
    let with = ["sample", "study", "--with", "instantaneous-elasticity", "--quiet"];
    vitreo(dir, &with).refuses(&["m0 has another model", "--force"]);
    vitreo(dir, &[&with[..], &["--force"]].concat()).exits(0);
    // The diagnosis uses the study's own model.
    let found = vitreo(dir, &["diagnose", "study", "--json", "-"]).exits(0).json();
    assert_eq!(found["verdict"]["kind"], "none", "{found}");
}

/// Creep and oscillation of one gel share a law. Those of two gels do not, and the output says so.
#[test]
fn records_of_one_gel_share_its_law() {
    let place = tempfile::tempdir().unwrap();
    let dir = place.path();
    write_instrument_experiment(&dir.join("creep"), true, 0.0);
    for (name, c2_pa_s) in [("same", 47.0), ("another", 80.0)] {
        write_table(&dir.join(format!("{name}.txt")), c2_pa_s, 1e9);
        vitreo(dir, &["init", &format!("{name}.txt"), "--id", "gel"]).exits(0);
    }
    let joint = vitreo(dir, &["sample", "creep", "same", "--out", "joint", "--json", "-"]).exits(0).json();
    assert_eq!(joint["schema"], "vitreo-uq/joint/1");
    assert!(joint["agreement"]["p"].as_f64().unwrap() > 0.01, "{}", joint["agreement"]);
    let alone = vitreo(dir, &["sample", "same", "--out", "alone", "--json", "-"]).exits(0).json();
    for (name, truth) in [("young_modulus_pa", 3.5), ("viscosity_1_pa_s", 1.4), ("viscosity_2_pa_s", 47.0)] {
        covers(&joint, name, truth);
        let width = |document: &Value| median(document, name)[2] - median(document, name)[0];
        assert!(width(&joint) < width(&alone), "{name} is known no better by two records");
    }
    assert!(dir.join("joint/joint.png").is_file());
    let apart = vitreo(dir, &["sample", "creep", "another", "--out", "apart", "--json", "-"]).exits(1).json();
    assert!(apart["agreement"]["p"].as_f64().unwrap() < 1e-3, "{}", apart["agreement"]);
    // A drift of the held-out cycle, which the agreement does not test, is told as for the record alone.
    write_instrument_experiment(&dir.join("drifting"), true, 5.0);
    let drifting = vitreo(dir, &["sample", "drifting", "same", "--out", "both", "--json", "-"]).exits(1).json();
    let warnings = drifting["warnings"].as_array().unwrap();
    let of_record = |own: &&Value| own["text"].as_str().unwrap().starts_with("record 1 alone: ");
    assert!(warnings.iter().any(|own| of_record(&own) && own["kind"] == "misfit_above_noise"), "{warnings:?}");
    // A law without flow misses both records alike. Its learnt noise says so.
    let solid = ["sample", "creep", "same", "--base", "kelvin-voigt", "--out", "solid", "--json", "-"];
    let solid = vitreo(dir, &solid).exits(1).json();
    assert!(solid["warnings"].to_string().contains("the common law misses this record"), "{}", solid["warnings"]);
    vitreo(dir, &["sample", "creep", "same", "--with", "tracking-drift"]).refuses(&["--with", "share only the law"]);
}
