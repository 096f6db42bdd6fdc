//! User tests of `fit`, `simulate` and `corner`.

use crate::program;

use std::path::Path;

use program::{replica_with_id, tree, vitreo, vitreo_with_cache, write_instrument_experiment};
use serde_json::Value;

fn place() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

fn read_json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// Standard output and the study hold the document of formats §5. The estimate is within 5
/// standard errors of the truth (one failure in 10⁶ for another seed of the replica).
#[test]
fn fit_of_the_replica_writes_the_contracts_document() {
    let place = place();
    let run = vitreo(place.path(), &["fit", "--json", "-", "--quiet"]).exits(0);
    assert_eq!(run.stderr, "");
    let document = run.json();
    assert_eq!(document["schema"], "vitreo-uq/fit/1");
    assert!(document["version"].is_string() && document["inputs_sha256"].is_object());
    let table_i = [("young_modulus_pa", 3.527), ("viscosity_1_pa_s", 1.402), ("viscosity_2_pa_s", 47.370)];
    for (parameter, (name, truth)) in document["parameters"].as_array().unwrap().iter().zip(table_i) {
        assert_eq!(parameter["name"], name);
        let (value, error) = (parameter["value"].as_f64().unwrap(), parameter["standard_error"].as_f64().unwrap());
        assert!(error > 0.0 && (value - truth).abs() < 5.0 * error, "{parameter}");
    }
    assert!(document["objective_m2"].is_f64() && document["rmse_um"].is_f64() && document["iterations"].is_u64());
    assert_eq!(document["converged"], true);
    assert_eq!(read_json(&place.path().join("vitreo-uq-out/porcine-replica/fit.json")), document);
    let words = vitreo(place.path(), &["fit", "--threads", "1"]).exits(0);
    assert!(words.stdout.contains("converged") && words.stdout.contains("c₂ (Pa·s)"), "{words}");
    assert!(words.stderr.contains("fit.json"), "{words}");
    // Another number of threads gives the same document.
    assert_eq!(read_json(&place.path().join("vitreo-uq-out/porcine-replica/fit.json")), document);
}

#[test]
fn fit_serves_instruments_and_holds_what_is_set() {
    let place = place();
    write_instrument_experiment(&place.path().join("gel"), true, 0.0);
    let run = |more: &[&str]| vitreo(place.path(), &[&["fit", "gel", "--out", "study", "--json", "-"], more].concat());
    let document = run(&["--set", "young_modulus_pa=3.5"]).exits(0).json();
    assert_eq!(document["parameters"].as_array().unwrap().len(), 2);
    assert_eq!(document["fixed"]["young_modulus_pa"], 3.5);
    assert!(document["surrogate_vs_fe_max_um"].is_null());
    let all = ["--set", "young_modulus_pa=3.5", "--set", "viscosity_1_pa_s=1", "--set", "viscosity_2_pa_s=40"];
    run(&all).refuses(&["--set", "what to do"]);
}

/// The stiffness is fixed at ten times the truth. The misfit is far above the known noise, so the estimate is not trusted.
#[test]
fn a_fit_that_misses_the_data_ends_in_exit_code_1() {
    let place = place();
    write_instrument_experiment(&place.path().join("gel"), true, 0.0);
    let run = vitreo(place.path(), &["fit", "gel", "--out", "study", "--set", "young_modulus_pa=35"]).exits(1);
    assert!(run.stdout.contains("NOT TO BE TRUSTED") && run.stdout.contains("held fixed"), "{run}");
    assert!(place.path().join("study/fit.json").is_file());
}

/// The simulation is itself an experiment, and its fit returns the parameters that were set.
#[test]
fn a_simulation_is_an_experiment_that_fit_takes_back() {
    let place = place();
    let set = ["--set", "young_modulus_pa=2", "--set", "viscosity_1_pa_s=3", "--set", "viscosity_2_pa_s=20"];
    let run = vitreo(place.path(), &[&["simulate", "--out", "study", "--refine", "2"][..], &set].concat()).exits(0);
    assert!(run.stdout.contains("linear") && run.stdout.contains("order"), "{run}");
    let dir = place.path().join("study/simulation");
    let document = read_json(&dir.join("simulation.json"));
    assert_eq!(document["schema"], "vitreo-uq/simulation/1");
    assert_eq!(document["parameters"][2]["value"], 20.0);
    assert_eq!(document["convergence"].as_array().unwrap().len(), 2);
    assert!(document["unknowns"].as_u64().unwrap() > 1000 && document["largest_strain"].as_f64().unwrap() > 0.01);
    assert!(
        document["time_integration_error_um"].as_f64().unwrap()
            < 1e-6 * document["largest_displacement_um"].as_f64().unwrap()
    );
    let csv = std::fs::read_to_string(dir.join("trajectory.csv")).unwrap();
    assert!(csv.starts_with("time_s,force_uN,position_um,cycle\n0,4.6,0,1\n"), "{}", &csv[..80]);
    assert_eq!(csv.lines().count(), 801);
    assert!(dir.join("fields.pvd").is_file() && dir.join("fields_08.vtu").is_file());
    let fit = vitreo(place.path(), &["fit", "study/simulation", "--out", "back", "--json", "-"]).exits(0).json();
    for (parameter, truth) in fit["parameters"].as_array().unwrap().iter().zip([2.0, 3.0, 20.0]) {
        assert!((parameter["value"].as_f64().unwrap() / truth - 1.0).abs() < 1e-6, "{parameter}");
    }
}

/// Without `--set` the prior's medians are used, and the output says so. The midpoint rule with sub-steps comes near the exact step.
#[test]
fn simulate_says_where_its_values_come_from_and_replaces_itself_whole() {
    let place = place();
    let run = vitreo(place.path(), &["simulate", "--out", "study"]).exits(0);
    assert!(run.stdout.contains("median of its prior"), "{run}");
    let midpoint = ["simulate", "study", "--scheme", "midpoint", "--time-step-s", "0.01", "--json", "-"];
    let document = vitreo(place.path(), &midpoint).exits(0).json();
    assert_eq!(document["scheme"], "midpoint");
    assert_eq!(document["time_steps"], 799 * 5);
    let relative =
        document["time_integration_error_um"].as_f64().unwrap() / document["largest_displacement_um"].as_f64().unwrap();
    assert!(relative > 1e-9 && relative < 1e-4, "{relative}");
    assert_eq!(read_json(&place.path().join("study/simulation/simulation.json")), document);
    let left: Vec<_> =
        tree(&place.path().join("study")).into_keys().filter(|p| p.to_string_lossy().contains(".partial")).collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn impossible_simulations_are_refused() {
    let place = place();
    write_instrument_experiment(&place.path().join("gel"), true, 0.0);
    let run = |arguments: &[&str]| vitreo(place.path(), arguments);
    run(&["simulate", "gel"]).refuses(&["no finite elements", "[robot]"]);
    run(&["simulate", "--set", "noise_sd_um=3"]).refuses(&["--set", "noise"]);
    run(&["simulate", "--time-step-s", "0.1"]).refuses(&["--time-step-s", "midpoint"]);
    run(&["simulate", "--scheme", "euler"]).refuses(&["euler", "midpoint"]);
    run(&["simulate", "--refine", "50"]).refuses(&["--refine"]);
    assert!(!place.path().join("vitreo-uq-out").exists(), "something was written");
}

#[test]
fn corner_overlays_studies_and_csv_of_any_tool() {
    let place = place();
    write_instrument_experiment(&place.path().join("gel"), true, 0.0);
    vitreo(place.path(), &["sample", "gel", "--out", "study", "--quiet"]).exits(0);
    // A file from another tool: no index columns, another order, one more parameter.
    let rows = (0..400).map(|i| f64::from(i) / 400.0).map(|u| format!("{},{},{}\n", 47.0 + u, 3.4 + 0.2 * u * u, u));
    let csv: String = std::iter::once("viscosity_2_pa_s,young_modulus_pa,gain\n".to_string()).chain(rows).collect();
    std::fs::write(place.path().join("other.csv"), csv).unwrap();
    let run = |arguments: &[&str]| vitreo(place.path(), &[&["corner"], arguments].concat());
    let shown = run(&["study", "other.csv", "--out", "figures/both", "--reference", "young_modulus_pa=3.5"]).exits(0);
    assert!(shown.stdout.contains("study m0, other") && shown.stdout.contains("both.svg"), "{shown}");
    let svg = std::fs::read_to_string(place.path().join("figures/both.svg")).unwrap();
    assert!(svg.contains("c₂") && svg.contains("gain") && svg.contains("other") && svg.contains("reference"));
    // Overlaid posteriors of possibly different data are marked in the output and in the legend.
    assert!(shown.stderr.contains("fitted to different data") && shown.stderr.contains("fitted to cycle 1"), "{shown}");
    assert!(svg.contains("(fitted to cycle 1)") && svg.contains("(unknown data)"), "{svg}");
    let png = std::fs::read(place.path().join("figures/both.png")).unwrap();
    assert_eq!(&png[1..4], b"PNG");
    // A revision and the draws in it are the same posterior.
    let quiet = run(&["study/m0", "study/m0/draws.csv", "--quiet"]).exits(0);
    assert_eq!((quiet.stdout.as_str(), quiet.stderr.as_str()), ("", ""));
    let same = run(&["study/m0", "study/m0/draws.csv"]).exits(0);
    assert!(!same.stderr.contains("different data"), "{same}");
    assert!(place.path().join("corner.png").is_file());

    run(&[]).refuses(&["porcine-replica", "vitreo-uq sample"]);
    run(&["nowhere"]).refuses(&["nowhere", "what to do"]);
    run(&["gel"]).refuses(&["gel", "no draws"]);
    run(&["study", "--reference", "young_modulus=3"]).refuses(&["--reference", "young_modulus_pa"]);
    run(&["study", "--reference", "young_modulus_pa=x"]).refuses(&["--reference", "NAME=VALUE"]);
    run(&["study", "--out", "figures"]).refuses(&["--out", "directory"]);
    std::fs::write(place.path().join("bad.csv"), "a,b\n1,2\n3,x\n").unwrap();
    run(&["bad.csv"]).refuses(&["bad.csv", "line 3"]);
}

/// The test data's mesh belongs to the paper's apparatus. An experiment with another robot gets a warning, in words and in JSON.
#[test]
fn a_mesh_that_is_not_of_the_experiment_is_used_and_doubted() {
    let place = place();
    let mesh = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/gmsh/quarter_sphere_tet10.msh");
    let replica = concat!(env!("CARGO_MANIFEST_DIR"), "/data/porcine-replica");
    let run = vitreo(place.path(), &["simulate", "--out", "fits", "--mesh", mesh, "--json", "-"]).exits(0);
    let kinds = |document: &Value| -> Vec<String> {
        document["warnings"].as_array().unwrap().iter().map(|w| w["kind"].as_str().unwrap().to_string()).collect()
    };
    assert_eq!(kinds(&run.json()), ["large_strain"]);
    let other = place.path().join("other");
    std::fs::create_dir(&other).unwrap();
    let toml = std::fs::read_to_string(format!("{replica}/experiment.toml")).unwrap();
    let changed = toml.replace("diameter_mm = 0.55", "diameter_mm = 0.6").replace("ratio = 0.48", "ratio = 0.495");
    std::fs::write(other.join("experiment.toml"), changed).unwrap();
    std::fs::copy(format!("{replica}/trajectory.csv"), other.join("trajectory.csv")).unwrap();
    let run = vitreo(place.path(), &["simulate", "other", "--out", "doubted", "--mesh", mesh, "--json", "-"]).exits(0);
    assert_eq!(kinds(&run.json()), ["large_strain", "mesh", "mesh"]);
    assert!(run.stderr.contains("0.3000 mm in [robot]") && run.stderr.contains("0.495"), "{run}");
    vitreo(place.path(), &["simulate", "--out", "fits", "--mesh", mesh, "--refine", "2"])
        .refuses(&["--refine", "--mesh"]);
}

/// A surrogate under the file name of another bead is detected, named with its path and made again. The estimate equals that of an empty cache. The test takes
/// ten seconds because it trains three surrogates.
#[test]
fn a_model_of_another_bead_is_not_taken_from_the_cache() {
    let place = place();
    replica_with_id(&place.path().join("small"), "small");
    replica_with_id(&place.path().join("large"), "large");
    let toml = place.path().join("large/experiment.toml");
    let text = std::fs::read_to_string(&toml).unwrap();
    assert!(text.contains("diameter_mm = 0.55"));
    std::fs::write(&toml, text.replace("diameter_mm = 0.55", "diameter_mm = 1.1")).unwrap();
    let fit = |name: &str, cache: &str| {
        let options = ["fit", name, "--out", &format!("{name}-{cache}"), "--json", "-"];
        vitreo_with_cache(place.path(), cache, &options)
    };
    let kept = |cache: &str| {
        let mut files: Vec<_> = tree(&place.path().join(cache)).into_keys().collect();
        assert_eq!(files.len(), 1, "{files:?}");
        place.path().join(cache).join(files.remove(0))
    };
    let expected = fit("small", "a");
    fit("large", "b");
    let file = kept("a");
    std::fs::copy(kept("b"), &file).unwrap();
    let found = fit("small", "a");
    assert_eq!(found.json()["parameters"], expected.json()["parameters"]);
    for words in [file.file_name().unwrap().to_str().unwrap(), "is not used", "radius_m", "models are kept in a,"] {
        assert!(found.stderr.contains(words), "`{words}` is missing in {found}");
    }
    assert!(!fit("small", "a").stderr.contains("is not used"));
}

/// Names of 100 kB are truncated in figures, within seconds.
#[test]
fn a_column_with_a_long_name_is_drawn() {
    let place = place();
    let (long, spaced) = ("x".repeat(100_000), "a bc ".repeat(20_000));
    let rows: String = (0..200).map(|k| format!("{},{},{}\n", k % 17, k % 13, k % 7)).collect();
    std::fs::write(place.path().join("draws.csv"), format!("{long},{spaced},c\n{rows}")).unwrap();
    let began = std::time::Instant::now();
    vitreo(place.path(), &["corner", "draws.csv", "--out", "figure", "--quiet"]).exits(0);
    assert!(began.elapsed() < std::time::Duration::from_secs(20), "{:?}", began.elapsed());
    assert!(place.path().join("figure.png").is_file());
}
