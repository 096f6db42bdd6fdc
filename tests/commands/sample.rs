//! User tests of `sample`: exit codes, streams, files, reproducible bytes.

use crate::program;

use std::path::Path;

use program::{tree, vitreo, write_instrument_experiment};
use serde_json::Value;

/// Law and noise (µm) of [`write_instrument_experiment`].
const INSTRUMENT: [f64; 4] = [3.5, 1.4, 47.0, 0.5];

fn place() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

#[track_caller]
fn has_numbers(object: &Value, keys: &[&str]) {
    for key in keys {
        assert!(object[key].is_number(), "`{key}` in {object}");
    }
}

#[track_caller]
fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// Checks the keys of formats §5, and that the draws are nearly normal about the truth (law, noise in µm), as in the data of these tests.
fn check_contract(document: &Value, truth: [f64; 4]) {
    assert_eq!(document["schema"], "vitreo-uq/posterior/1");
    assert_eq!(document["version"], env!("CARGO_PKG_VERSION"));
    assert!(document["seed"].is_u64() && document["inputs_sha256"].is_object() && document["converged"].is_boolean());
    assert!(document["experiment"].is_string());
    assert_eq!(document["model"], serde_json::json!({"base": "lethersich", "effects": [], "noise": ["white"]}));
    let names: Vec<&str> =
        document["parameters"].as_array().unwrap().iter().map(|p| p["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["young_modulus_pa", "viscosity_1_pa_s", "viscosity_2_pa_s", "noise_sd_um"]);
    for (parameter, truth) in document["parameters"].as_array().unwrap().iter().zip(truth) {
        let of = |key: &str| number(&parameter[key]);
        // Five standard deviations: one false failure in 10⁶.
        assert!((of("mean") - truth).abs() < 5.0 * of("sd"), "{parameter} against {truth}");
        // A normal posterior has 3.29 and 0. The noise's posterior, with 100 rows or more, is skewed by less than these bounds.
        assert!(((of("q95") - of("q05")) / of("sd") - 3.29).abs() < 0.15, "{parameter}");
        assert!(((of("median") - of("mean")) / of("sd")).abs() < 0.15, "{parameter}");
        // By definition this is sd/√ESS. The ESS here is that of ranks, which is nearly equal for normal tails.
        assert!((of("mcse_mean") * of("ess_bulk").sqrt() / of("sd") - 1.0).abs() < 0.1, "{parameter}");
        assert!(of("ess_bulk") > 400.0 && of("ess_tail") > 400.0 && (0.99..1.01).contains(&of("rhat")), "{parameter}");
    }
    let sampler = [
        "walkers",
        "ensembles",
        "steps",
        "acceptance",
        "autocorrelation_time",
        "likelihood_evaluations",
        "walkers_reseeded",
    ];
    has_numbers(&document["sampler"], &sampler);
    let [walkers, ensembles, steps, acceptance, autocorrelation_steps, evaluations, n_reseeded] =
        sampler.map(|key| number(&document["sampler"][key]));
    assert!(evaluations >= walkers * ensembles * steps && n_reseeded == 0.0, "{}", document["sampler"]);
    assert!(
        (0.1..1.0).contains(&acceptance) && (1.0..steps / 10.0).contains(&autocorrelation_steps),
        "{}",
        document["sampler"]
    );
    for (object, keys) in [
        ("surrogate", &["modes", "max_relative_error", "fe_unknowns", "snapshot_runs"][..]),
        (
            "heldout",
            &[
                "cycles",
                "fe_runs",
                "rmse_um",
                "noise_um",
                "coverage_50",
                "coverage_90",
                "crps_um",
                "surrogate_vs_fe_max_um",
                "pareto_k",
            ],
        ),
        ("error_budget_um", &["noise", "fe_discretisation", "surrogate", "monte_carlo"]),
    ] {
        for key in keys {
            assert!(document[object].get(key).is_some(), "{object}.{key} is missing");
        }
    }
    assert!(document.get("largest_strain").is_some());
    for warning in document["warnings"].as_array().unwrap() {
        assert!(["kind", "text", "advice"].iter().all(|key| warning[key].is_string()), "{warning}");
    }
}

/// Checks the errors of held-out positions for a correct model with known noise.
fn check_heldout(heldout: &Value, n_rows: f64, noise_um: f64) {
    let of = |key: &str| number(&heldout[key]);
    // Five standard deviations for this number of independent normal errors: one false failure in 10⁶. The parameters are known far better than the noise.
    let is_near = |key: &str, expected: f64, sd_of_one: f64| {
        let found = of(key);
        assert!((found - expected).abs() < 5.0 * sd_of_one / n_rows.sqrt(), "{key} {found} against {expected}");
    };
    assert_eq!(of("noise_um"), noise_um);
    is_near("rmse_um", noise_um, noise_um / 2.0_f64.sqrt());
    is_near("coverage_50", 0.5, 0.5);
    is_near("coverage_90", 0.9, 0.3);
    // The expected value is σ/√π; one error has a standard deviation of 0.403 σ.
    is_near("crps_um", noise_um / std::f64::consts::PI.sqrt(), 0.403 * noise_um);
}

/// The main job without a file. Standard output holds only JSON, `--quiet` silences standard error, and every file of the revision exists. A second run with
/// other threads writes the same bytes and continues in the same study with its surrogate. Another seed gives other draws.
#[test]
fn the_replica_runs_without_any_file_and_gives_the_same_bytes_again() {
    let place = place();
    let run = |more: &[&str]| vitreo(place.path(), &[&["sample"], more].concat());
    let first = run(&["--json", "-", "--quiet", "--threads", "1"]).exits(0);
    assert_eq!(first.stderr, "");
    let document = first.json();
    // Table I and the replica's noise.
    check_contract(&document, [3.527, 1.402, 47.37, 4.0]);
    assert_eq!(document["heldout"]["cycles"], serde_json::json!([2, 3, 4]));
    check_heldout(&document["heldout"], 600.0, 4.0);
    assert!((0.0..0.7).contains(&number(&document["heldout"]["pareto_k"])), "{}", document["heldout"]);
    // The base model is one field times a function of time, so one mode represents it to rounding.
    assert_eq!(document["surrogate"]["modes"], 1);
    assert!((0.0..1e-9).contains(&number(&document["surrogate"]["max_relative_error"])), "{}", document["surrogate"]);
    assert!(
        number(&document["surrogate"]["fe_unknowns"]) > 1e4 && number(&document["surrogate"]["snapshot_runs"]) > 3.0
    );
    // Errors of the computation are below a tenth of the noise.
    let budget = &document["error_budget_um"];
    assert!((3.0..5.0).contains(&number(&budget["noise"])), "{budget}");
    for key in ["fe_discretisation", "surrogate", "monte_carlo"] {
        assert!((0.0..0.4).contains(&number(&budget[key])), "{key}: {budget}");
    }
    // Around a sphere bonded to an incompressible gel the strain is ¾ of displacement over radius. Integration points lie up to a tenth away from it.
    let farthest_radii = number(&document["large_displacement"]["farthest_radii"]);
    let strain = number(&document["largest_strain"]) / (0.75 * farthest_radii);
    assert!((0.9..1.02).contains(&strain), "{strain} of ¾ · {farthest_radii}");
    let revision = place.path().join("vitreo-uq-out/porcine-replica/m0");
    let files = tree(&revision);
    for name in ["model.toml", "posterior.json", "surrogate.json", "draws.csv", "posterior.nc", "timing.json"] {
        assert!(files.contains_key(Path::new(name)), "{name} is missing");
    }
    for stem in ["corner", "predictive", "trace", "singular_values"] {
        assert!(files.contains_key(Path::new(&format!("figures/{stem}.svg"))), "{stem} is missing");
        assert!(files.contains_key(Path::new(&format!("figures/{stem}.png"))), "{stem} is missing");
    }
    let written: Value = serde_json::from_slice(&files[Path::new("posterior.json")]).unwrap();
    assert_eq!(written, document);

    let again = run(&["--threads", "2"]).exits(0);
    assert!(again.stdout.contains("converged") && again.stderr.contains("using the kept surrogate"), "{again}");
    let other = run(&["--out", "other", "--threads", "2", "--quiet"]).exits(0);
    assert_eq!(other.stderr, "");
    for (again, dir) in [(tree(&revision), "continued"), (tree(&place.path().join("other/m0")), "new")] {
        assert_eq!(again.keys().collect::<Vec<_>>(), files.keys().collect::<Vec<_>>());
        for (name, bytes) in again.iter().filter(|(name, _)| *name != Path::new("timing.json")) {
            assert!(files[name] == *bytes, "{} differs in the {dir} study", name.display());
        }
    }
    run(&["--out", "seed", "--seed", "2", "--quiet"]).exits(0);
    let seed = tree(&place.path().join("seed/m0"));
    assert!(seed[Path::new("draws.csv")] != files[Path::new("draws.csv")]);
}

#[test]
fn an_instrument_has_null_for_finite_elements_and_does_not_fail() {
    let place = place();
    write_instrument_experiment(&place.path().join("gel"), true, 0.0);
    let run = vitreo(place.path(), &["sample", "gel", "--out", "study", "--json", "-"]).exits(0);
    let document = run.json();
    check_contract(&document, INSTRUMENT);
    check_heldout(&document["heldout"], 100.0, 0.5);
    for (object, keys) in [
        ("surrogate", &["modes", "max_relative_error", "fe_unknowns", "snapshot_runs"][..]),
        ("heldout", &["surrogate_vs_fe_max_um", "pareto_k"]),
        ("error_budget_um", &["fe_discretisation", "surrogate"]),
    ] {
        for key in keys {
            assert!(document[object][key].is_null(), "{object}.{key}: {}", document[object][key]);
        }
    }
    assert!(document["largest_strain"].is_null());
    assert_eq!(document["heldout"]["fe_runs"], Value::Null);
    let kinds: Vec<&str> =
        document["warnings"].as_array().unwrap().iter().map(|w| w["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["no_finite_elements"]);
    assert!(run.stderr.contains("Results and figures"), "{}", run.stderr);
}

#[test]
fn without_held_out_cycles_nothing_is_claimed_about_prediction() {
    let place = place();
    write_instrument_experiment(&place.path().join("gel"), false, 0.0);
    let run = vitreo(place.path(), &["sample", "gel", "--json", "result.json"]).exits(0);
    assert!(run.stdout.contains("no cycle is held out"), "{run}");
    let text = std::fs::read_to_string(place.path().join("result.json")).unwrap();
    let document: Value = serde_json::from_str(&text).unwrap();
    check_contract(&document, INSTRUMENT);
    assert_eq!(document["heldout"]["cycles"], serde_json::json!([]));
    for key in ["rmse_um", "coverage_50", "coverage_90", "crps_um"] {
        assert!(document["heldout"][key].is_null(), "{key}");
    }
}

/// The model lacks a drift of 2 µm/s in the held-out cycle: results are written and marked, and the exit code is 1.
#[test]
fn held_out_cycles_that_the_model_misses_end_in_exit_code_1() {
    let place = place();
    write_instrument_experiment(&place.path().join("gel"), true, 2.0);
    let run = vitreo(place.path(), &["sample", "gel", "--out", "study"]).exits(1);
    assert!(run.stdout.contains("NOT TO BE TRUSTED"), "{run}");
    let text = std::fs::read_to_string(place.path().join("study/m0/posterior.json")).unwrap();
    let document: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(document["converged"], true);
    let kinds: Vec<&str> =
        document["warnings"].as_array().unwrap().iter().map(|w| w["kind"].as_str().unwrap()).collect();
    assert!(kinds.contains(&"heldout_outside_band") && kinds.contains(&"misfit_above_noise"), "{kinds:?}");
}

/// Too few steps: results are written and marked, and the exit code is 1.
#[test]
fn draws_that_have_not_converged_end_in_exit_code_1() {
    let place = place();
    write_instrument_experiment(&place.path().join("gel"), true, 0.0);
    let run = vitreo(place.path(), &["sample", "gel", "--steps", "60", "--out", "study"]).exits(1);
    assert!(run.stdout.contains("NOT CONVERGED") && run.stdout.contains("--steps"), "{run}");
    assert!(place.path().join("study/m0/posterior.json").is_file());
}

#[test]
fn bad_input_ends_in_exit_code_2_with_a_remedy_and_nothing_is_written() {
    let place = place();
    let run = |arguments: &[&str]| vitreo(place.path(), arguments);
    run(&["sample", "--no-such-option"]).refuses(&["--no-such-option"]);
    run(&["sampel"]).refuses(&["sample"]);
    run(&[]).refuses(&["Usage"]);
    run(&["sample", "nowhere"]).refuses(&["nowhere", "what to do"]);
    run(&["sample", "--prior", "porcin"]).refuses(&["porcin", "what to do"]);
    run(&["sample", "--set", "young_modulus=3"]).refuses(&["--set", "young_modulus_pa"]);
    run(&["sample", "--set", "young_modulus_pa=-3"]).refuses(&["--set", "what to do"]);
    run(&["sample", "--base", "zener"]).refuses(&["--base", "lethersich"]);
    run(&["sample", "--with", "inertiaa"]).refuses(&["--with", "what to do"]);
    run(&["sample", "--chains", "2"]).refuses(&["what to do"]);
    run(&["sample", "--mesh", "nowhere.msh"]).refuses(&["nowhere.msh", "what to do"]);
    run(&["sample", "--steps", "0"]).refuses(&["--steps", "what to do"]);
    run(&["sample", "--seed", "-1"]).refuses(&["--seed", "-1"]);
    let all_fixed: Vec<String> = ["young_modulus_pa", "viscosity_1_pa_s", "viscosity_2_pa_s", "noise_sd_um"]
        .iter()
        .flat_map(|name| ["--set".to_string(), format!("{name}=3.0")])
        .collect();
    run(&[&["sample"], all_fixed.iter().map(String::as_str).collect::<Vec<_>>().as_slice()].concat())
        .refuses(&["--set", "nothing to infer"]);
    run(&["sample", "--from", "m0"]).refuses(&["--from", "what to do"]);
    run(&["sample", "--json", "nowhere/result.json"]).refuses(&["--json", "nowhere"]);
    let left: Vec<_> = tree(place.path()).into_keys().collect();
    assert!(left.is_empty() && std::fs::read_dir(place.path()).unwrap().next().is_none(), "{left:?}");
}

#[test]
fn the_same_model_is_continued_another_refused_and_replaced_by_force() {
    let place = place();
    write_instrument_experiment(&place.path().join("gel"), true, 0.0);
    write_instrument_experiment(&place.path().join("other"), true, 0.5);
    let run = |arguments: &[&str]| vitreo(place.path(), arguments);
    run(&["sample", "gel", "--out", "study"]).exits(0);
    run(&["sample", "study"]).exits(0);
    let before = tree(&place.path().join("study"));
    run(&["sample", "study", "--set", "viscosity_1_pa_s=1.4"]).refuses(&["another", "--force"]);
    run(&["sample", "other", "--out", "study"]).refuses(&["--out", "--force"]);
    run(&["sample", "study", "--out", "elsewhere"]).refuses(&["--out"]);
    run(&["sample", "study", "--from", "m7"]).refuses(&["m7", "m0"]);
    let after: Vec<_> =
        tree(&place.path().join("study")).into_iter().filter(|(path, _)| !path.ends_with(".lock")).collect();
    assert!(after == before.into_iter().filter(|(path, _)| !path.ends_with(".lock")).collect::<Vec<_>>());
    run(&["sample", "study", "--set", "viscosity_1_pa_s=1.4", "--force"]).exits(0);
    let model = std::fs::read_to_string(place.path().join("study/m0/model.toml")).unwrap();
    assert!(model.contains("viscosity_1_pa_s = 1.4"), "{model}");
    // The existing model is used without being named again.
    let document = run(&["sample", "study", "--json", "-"]).exits(0).json();
    assert_eq!(document["parameters"].as_array().unwrap().len(), 3);
}

/// A prior file is part of a revision. The revision keeps a copy and is not replaced silently when the file changes.
#[test]
#[ignore = "thorough"]
fn a_prior_file_is_kept_and_compared_by_content() {
    let place = place();
    let porcine = include_str!("../../priors/porcine.toml");
    let prior = place.path().join("mine.toml");
    std::fs::write(&prior, porcine).unwrap();
    let sample = |extra: &[&str]| vitreo(place.path(), &[&["sample", "--out", "study", "--quiet"], extra].concat());
    sample(&["--prior", "mine.toml"]).exits(0);
    assert_eq!(std::fs::read_to_string(place.path().join("study/m0/prior.toml")).unwrap(), porcine);
    std::fs::write(&prior, porcine.replace("median = 1.8\nlog_sd = 1.25", "median = 100.0\nlog_sd = 0.1")).unwrap();
    sample(&["--prior", "mine.toml"]).refuses(&["another model", "--force"]);
    let run = sample(&["--prior", "mine.toml", "--force"]).exits(1);
    assert!(run.stdout.contains("NOT TO BE TRUSTED"), "{run}");
    // The study works without the file, from its own copy.
    std::fs::remove_file(&prior).unwrap();
    vitreo(place.path(), &["fit", "study", "--quiet"]).exits(1);
    vitreo(place.path(), &["fit", "study/m0"]).refuses(&["study/m0", "--from"]);
}

#[cfg(unix)]
#[test]
fn json_goes_through_links_and_into_pipes_without_replacing_them() {
    let place = place();
    write_instrument_experiment(&place.path().join("gel"), true, 0.0);
    let (target, link) = (place.path().join("real.json"), place.path().join("link.json"));
    std::fs::write(&target, "old").unwrap();
    std::os::unix::fs::symlink(&target, &link).unwrap();
    vitreo(place.path(), &["fit", "gel", "--json", "link.json", "--quiet"]).exits(0);
    assert!(link.is_symlink() && std::fs::read_to_string(&target).unwrap().contains("vitreo-uq/fit/1"));
    vitreo(place.path(), &["fit", "gel", "--json", "/dev/null", "--quiet"]).exits(0);
    assert!(!Path::new("/dev/null").metadata().unwrap().is_file());
}

/// The coarse imported mesh is wrong by a few per cent, and the fit's moduli absorb this. Exact theory reveals it, and the exit code is 1. A mesh is an
/// input: another one does not replace the result silently.
#[test]
#[ignore = "thorough"]
fn an_imported_mesh_is_judged_and_is_an_input() {
    let place = place();
    let mesh = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/gmsh/quarter_sphere_tet10.msh");
    let sample = |extra: &[&str]| vitreo(place.path(), &[&["sample", "--out", "study", "--quiet"], extra].concat());
    let document = sample(&["--mesh", mesh, "--json", "-"]).exits(1).json();
    let kinds: Vec<&str> =
        document["warnings"].as_array().unwrap().iter().map(|w| w["kind"].as_str().unwrap()).collect();
    assert!(kinds.contains(&"mesh_inaccurate"), "{kinds:?}");
    assert!(document["inputs_sha256"]["mesh"].is_string());
    // −3.7 % in the moduli is −84 standard deviations. The summary gives the bias with its sign.
    let bias = document["parameters"][0]["discretisation_bias_sd"].as_f64().unwrap();
    assert!((-120.0..-50.0).contains(&bias), "{bias}");
    sample(&[]).refuses(&["another mesh", "--force"]);
    sample(&["--force"]).exits(0);
}
