//! User tests of `design`: closed forms of the information, limits, and a protocol that separates equivalent effects.

use crate::program;

use program::{normals, vitreo};
use serde_json::Value;
use std::fmt::Write as _;

/// Displacement per force at unit creep compliance of the replica's bead in 1/m (docs/physics.md, §3).
const COMPLIANCE_PER_M: f64 = 549.178;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// Times (s) and forces (µN) of a controller's file.
fn protocol(path: &std::path::Path) -> Vec<[f64; 2]> {
    let text = std::fs::read_to_string(path).unwrap();
    let row = |line: &str| {
        let mut cells = line.split(',').map(|cell| cell.parse().unwrap());
        [cells.next().unwrap(), cells.next().unwrap()]
    };
    text.lines().skip(1).map(row).collect()
}

/// Summary of a parameter by `sample`.
fn sampled(dir: &std::path::Path, name: &str) -> Value {
    let posterior = std::fs::read_to_string(dir.join("study/m0/posterior.json")).unwrap();
    let posterior: Value = serde_json::from_str(&posterior).unwrap();
    let parameters = posterior["parameters"].as_array().unwrap();
    parameters.iter().find(|parameter| parameter["name"] == name).unwrap().clone()
}

/// One free parameter: with E and c₁ fixed, the position is C(J + ∫F dt/c₂), so dx/d ln c₂ = −C∫F dt/c₂. The information of white noise σ is the sum of its
/// squares over σ². Under |F| ≤ F_max it is largest for a constant force, and the expected standard deviation follows.
#[test]
fn one_viscosity_is_learnt_best_from_a_constant_force() {
    let dir = tempfile::tempdir().unwrap();
    let fixed = ["--set", "young_modulus_pa=3.527", "--set", "viscosity_1_pa_s=1.402"];
    vitreo(dir.path(), &[&["sample", "--out", "study", "--no-report"], &fixed[..]].concat()).exits(0);
    let run = ["design", "study", "--max-displacement-um", "1e6", "--budget-s", "20", "--json", "-"];
    let document = vitreo(dir.path(), &run).exits(0).json();
    let steps = protocol(&dir.path().join("study/design-protocol.csv"));
    assert_eq!(steps.len(), 2, "{steps:?}");
    assert!((steps[0][1].abs() - 4.6).abs() < 1e-9, "{steps:?}");
    let parameter = &document["recommended"]["parameters"][0];
    assert_eq!(parameter["name"], "viscosity_2_pa_s");
    let [c2, now, then] = ["value", "sd_now", "sd_expected"].map(|key| number(&parameter[key]));
    // 401 samples at 0.05 s, none of which moves at time 0, with the noise that `sample` learns.
    let squares: f64 = (1..=400).map(|k| (COMPLIANCE_PER_M * 4.6 * 0.05 * f64::from(k) / c2).powi(2)).sum();
    let information = squares / number(&sampled(dir.path(), "noise_sd_um")["mean"]).powi(2);
    let found = (c2 / then).powi(2) - (c2 / now).powi(2);
    assert!((found / information - 1.0).abs() < 0.1, "{found} against {information}");
    let nats = 0.5 * ((c2 / then).powi(2) / (c2 / now).powi(2)).ln();
    let [expected, error] =
        ["expected_information_nats", "standard_error"].map(|key| number(&document["recommended"][key]));
    assert!((expected - nats).abs() < 3.0 * error + 0.01, "{expected} ± {error} against {nats}");
}

/// Before any data the only free parameter has the prior's width, and the information is that of the closed form with the given noise. A record under this protocol, made by the closed form, then has
/// the expected standard deviation.
#[test]
fn a_first_record_is_designed_from_the_prior() {
    let dir = tempfile::tempdir().unwrap();
    let replica = concat!(env!("CARGO_MANIFEST_DIR"), "/data/porcine-replica");
    let first = dir.path().join("first");
    std::fs::create_dir(&first).unwrap();
    std::fs::copy(format!("{replica}/experiment.toml"), first.join("experiment.toml")).unwrap();
    let table = std::fs::read_to_string(format!("{replica}/trajectory.csv")).unwrap();
    let without_position = |line: &str| {
        let mut cells: Vec<&str> = line.split(',').collect();
        if cells[0] != "time_s" {
            cells[2] = "";
        }
        cells.join(",") + "\n"
    };
    std::fs::write(first.join("trajectory.csv"), table.lines().map(without_position).collect::<String>()).unwrap();
    let fixed = ["--set", "young_modulus_pa=3.527", "--set", "viscosity_1_pa_s=1.402"];
    let run = ["design", "first", "--max-displacement-um", "1e6", "--budget-s", "20", "--out", "plan", "--json", "-"];
    let document = vitreo(dir.path(), &[&run[..], &fixed[..]].concat()).exits(0).json();
    assert_eq!((&document["revision"], &document["goal"]), (&"prior".into(), &"parameters".into()));
    let parameter = &document["recommended"]["parameters"][0];
    let [c2, now, then] = ["value", "sd_now", "sd_expected"].map(|key| number(&parameter[key]));
    let squares: f64 = (1..=400).map(|k| (COMPLIANCE_PER_M * 4.6 * 0.05 * f64::from(k) / c2).powi(2)).sum();
    let (found, information) = ((c2 / then).powi(2) - (c2 / now).powi(2), squares / 16.0);
    assert!((found / information - 1.0).abs() < 0.01, "{found} against {information}");
    assert!(now / c2 > 0.1, "the prior is {c2} ± {now}");

    // A wider limit of the displacement teaches more, also where few protocols under the largest force keep it.
    let information = ["100", "300", "500", "1000"].map(|limit_um| {
        let run = [
            "design",
            "first",
            "--max-displacement-um",
            limit_um,
            "--budget-s",
            "40",
            "--out",
            limit_um,
            "--json",
            "-",
        ];
        let document = vitreo(dir.path(), &run).exits(0).json();
        // The limit holds for the middle of the prior, which is wide.
        assert!(document["warnings"].to_string().contains("gels drawn from what is known"), "{}", document["warnings"]);
        number(&document["recommended"]["expected_information_nats"])
    });
    assert!(information.windows(2).all(|pair| pair[1] > pair[0]), "{information:?}");

    // A draft of one direction stands for a magnet that only pulls.
    let one_sided = dir.path().join("one-sided");
    std::fs::create_dir(&one_sided).unwrap();
    let toml = std::fs::read_to_string(first.join("experiment.toml")).unwrap();
    let toml: String =
        toml.lines().filter(|line| !line.contains("_cycles =")).map(|line| format!("{line}\n")).collect();
    std::fs::write(one_sided.join("experiment.toml"), toml).unwrap();
    std::fs::write(one_sided.join("trajectory.csv"), "time_s,force_uN,position_um,cycle\n0,4.6,,1\n40,0,,1\n").unwrap();
    let forces_un = |more: &[&str]| {
        let run = ["design", "one-sided", "--interval-s", "0.1", "--max-displacement-um", "300", "--out", "pull"];
        let document = vitreo(dir.path(), &[&run[..], more, &["--json", "-"]].concat()).exits(0).json();
        assert!(number(&document["recommended"]["expected_information_nats"]) > 1.0, "{}", document["recommended"]);
        let steps = protocol(&dir.path().join("pull/design-protocol.csv"));
        [f64::min, f64::max].map(|end: fn(f64, f64) -> f64| steps.iter().fold(0.0, |most, step| end(most, step[1])))
    };
    let [lowest_un, highest_un] = forces_un(&[]);
    assert!(lowest_un == 0.0 && highest_un > 0.01, "{lowest_un} to {highest_un} µN");
    assert!(forces_un(&["--both-directions"])[0] < 0.0);

    let mut normal = normals();
    let next = dir.path().join("plan/next-record");
    let table = std::fs::read_to_string(next.join("trajectory.csv")).unwrap();
    // The force is the same at all times.
    let force_un = protocol(&dir.path().join("plan/design-protocol.csv"))[0][1];
    let measured = |line: &str| {
        let mut cells: Vec<String> = line.split(',').map(String::from).collect();
        if let Ok(time_s) = cells[0].parse::<f64>() {
            let creep = (1.0 - (-time_s * 3.527 / 1.402).exp()) / 3.527 + time_s / c2;
            cells[2] = format!("{:.4}", COMPLIANCE_PER_M * force_un * creep + 4.0 * normal());
        }
        cells.join(",") + "\n"
    };
    std::fs::write(next.join("trajectory.csv"), table.lines().map(measured).collect::<String>()).unwrap();
    vitreo(dir.path(), &[&["sample", "plan/next-record", "--out", "study", "--no-report"], &fixed[..]].concat())
        .exits(0);
    // The standard deviation that 401 rows with learnt noise give has an error of 5 %.
    let sd = number(&sampled(dir.path(), "viscosity_2_pa_s")["sd"]);
    assert!((sd / then - 1.0).abs() < 0.2, "{sd} sampled, {then} expected");
    // Other goals need a record, and so does an unknown noise.
    vitreo(dir.path(), &["design", "first", "--goal", "detection"]).refuses(&["detection", "no position is measured"]);
    let toml = std::fs::read_to_string(first.join("experiment.toml")).unwrap();
    let without_noise: String =
        toml.lines().filter(|line| !line.starts_with("noise_um")).map(|line| format!("{line}\n")).collect();
    std::fs::write(first.join("experiment.toml"), without_noise).unwrap();
    vitreo(dir.path(), &["design", "first"]).refuses(&["noise_um"]);
}

/// With E and c₁ fixed, the position at time t under a constant force F is C·F·(J + t/c₂). So its standard deviation is C·F·t/c₂ times the relative one of c₂, now and
/// after the designed record. The files for the new record are a description that `check` reads, with the positions missing.
#[test]
fn a_decision_is_designed_for_by_its_own_derivative() {
    let dir = tempfile::tempdir().unwrap();
    let fixed = ["--set", "young_modulus_pa=3.527", "--set", "viscosity_1_pa_s=1.402"];
    vitreo(dir.path(), &[&["sample", "--out", "study", "--no-report"], &fixed[..]].concat()).exits(0);
    let scenario = "[[scenario]]\nname = \"push\"\nforce = { steps_un = [[0, 3]] }\n[[scenario.quantity]]\nkind = \"position_at\"\nat_s = 10\n";
    std::fs::write(dir.path().join("push.toml"), scenario).unwrap();
    let run = ["design", "study", "--scenario", "push.toml", "--no-report", "--json", "-"];
    let document = vitreo(dir.path(), &run).exits(0).json();
    let (parameter, quantity) = (&document["recommended"]["parameters"][0], &document["quantity"]);
    let c2 = number(&parameter["value"]);
    let slope_um = COMPLIANCE_PER_M * 3.0 * 10.0 / c2;
    for key in ["sd_now", "sd_expected"] {
        let expected = slope_um * number(&parameter[key]) / c2;
        assert!(
            (number(&quantity[key]) / expected - 1.0).abs() < 1e-3,
            "{key}: {quantity}, {expected} by the closed form"
        );
    }
    assert!(number(&quantity["sd_expected"]) < number(&quantity["sd_now"]), "{quantity}");
    assert_eq!((&document["goal"], &quantity["quantity"]), (&"decision".into(), &"position at 10 s".into()));
    let refusal = vitreo(dir.path(), &["check", "study/next-record"]).exits(2);
    assert!(refusal.stderr.contains("the column is empty"), "{refusal}");
    let refusal = vitreo(dir.path(), &["design", "study", "--goal", "decision"]).exits(2);
    assert!(refusal.stderr.contains("--scenario"), "{refusal}");
}

/// Nearly the same record once more has the same information, so that the standard deviation of the only parameter falls by √2. A filled-in record is never overwritten, and a record of
/// another robot is refused.
#[test]
fn a_later_record_adds_its_information() {
    let dir = tempfile::tempdir().unwrap();
    let fixed = ["--set", "young_modulus_pa=3.527", "--set", "viscosity_1_pa_s=1.402"];
    vitreo(dir.path(), &[&["sample", "--out", "study", "--no-report"], &fixed[..]].concat()).exits(0);
    let replica = concat!(env!("CARGO_MANIFEST_DIR"), "/data/porcine-replica");
    let design = |after: &[&str]| {
        vitreo(dir.path(), &[&["design", "study", "--no-report", "--json", "-"], after].concat()).exits(0).json()
    };
    // A record with the same rows would count twice. In this one the last position differs, by less than the noise.
    let again = dir.path().join("again");
    std::fs::create_dir(&again).unwrap();
    std::fs::copy(format!("{replica}/experiment.toml"), again.join("experiment.toml")).unwrap();
    let table = std::fs::read_to_string(format!("{replica}/trajectory.csv")).unwrap();
    let (rows, last) = table.trim_end().rsplit_once('\n').unwrap();
    let mut cells: Vec<String> = last.split(',').map(String::from).collect();
    cells[2] = format!("{:.3}", cells[2].parse::<f64>().unwrap() + 0.5);
    std::fs::write(again.join("trajectory.csv"), format!("{rows}\n{}\n", cells.join(","))).unwrap();
    let (alone, after) = (design(&[]), design(&["--after", "again"]));
    vitreo(dir.path(), &["design", "study", "--after", replica]).refuses(&["the same rows"]);
    vitreo(dir.path(), &["design", "study", "--after", "again", "--after", "again"]).refuses(&["the same rows"]);
    let sd = |document: &Value| number(&document["recommended"]["parameters"][0]["sd_now"]);
    let sampled = number(&sampled(dir.path(), "viscosity_2_pa_s")["sd"]);
    assert!((sd(&alone) / sampled - 1.0).abs() < 0.1, "{} against {sampled} by `sample`", sd(&alone));
    let ratio = sd(&alone) / sd(&after);
    assert!((ratio / 2.0_f64.sqrt() - 1.0).abs() < 0.01, "{ratio}");
    let record = &after["after"][0];
    assert!((number(&record["rmse_um"]) / number(&record["noise_um"]) - 1.0).abs() < 0.1, "{record}");
    assert_eq!(alone.get("after"), None);

    let table = dir.path().join("study/next-record/trajectory.csv");
    let filled = std::fs::read_to_string(&table).unwrap().replacen(",,", ",1.5,", 1);
    std::fs::write(&table, &filled).unwrap();
    let next = design(&[]);
    assert!(next["recommended"]["record_dir"].as_str().unwrap().ends_with("next-record-2"), "{next}");
    assert_eq!(std::fs::read_to_string(&table).unwrap(), filled);

    let other = dir.path().join("other");
    std::fs::create_dir(&other).unwrap();
    let toml = std::fs::read_to_string(format!("{replica}/experiment.toml")).unwrap();
    let diameter = toml.lines().find(|line| line.starts_with("diameter_mm")).unwrap();
    std::fs::write(other.join("experiment.toml"), toml.replacen(diameter, "diameter_mm = 0.6", 1)).unwrap();
    std::fs::copy(format!("{replica}/trajectory.csv"), other.join("trajectory.csv")).unwrap();
    vitreo(dir.path(), &["design", "study", "--after", "other"]).refuses(&["another apparatus"]);
    let detection = ["design", "study", "--after", "again", "--goal", "detection"];
    vitreo(dir.path(), &detection).refuses(&["--after", "one record"]);
}

/// The designed record shows at least as many effects as the present one, and a smaller bias of the force.
#[test]
#[ignore = "thorough"]
fn a_record_is_designed_for_the_effects_that_it_shows() {
    let dir = tempfile::tempdir().unwrap();
    vitreo(dir.path(), &["sample", "--out", "study", "--no-report"]).exits(0);
    let document = vitreo(dir.path(), &["design", "study", "--goal", "detection", "--json", "-"]).exits(0).json();
    let all = document["detectable"].as_array().unwrap();
    let seen = |key: &str| all.iter().filter(|found| !found[key].is_null()).count();
    assert!(all.len() > 15 && seen("smallest_expected") >= seen("smallest_now"), "{document}");
    let finer = |found: &&Value| {
        let [now, then] = ["smallest_now", "smallest_expected"].map(|key| found[key].as_f64().map(f64::abs));
        found["effect"] == "force-bias" && now.zip(then).is_some_and(|(now, then)| then < now)
    };
    assert!(all.iter().any(|found| finer(&found)), "{document}");
}

/// A longer record never teaches less, and the default protocol stays within the displacement of the present record.
#[test]
fn longer_records_teach_more_within_the_limits() {
    let dir = tempfile::tempdir().unwrap();
    vitreo(dir.path(), &["sample", "--out", "study", "--no-report"]).exits(0);
    let document = vitreo(dir.path(), &["design", "study", "--json", "-"]).exits(0).json();
    let front = document["front"].as_array().unwrap();
    assert!(front.len() >= 3, "{document}");
    for pair in front.windows(2) {
        let nats = |entry: &Value| number(&entry["expected_information_nats"]);
        assert!(nats(&pair[1]) >= nats(&pair[0]) - 1e-9, "{pair:?}");
    }
    for parameter in document["recommended"]["parameters"].as_array().unwrap() {
        assert!(number(&parameter["sd_expected"]) < number(&parameter["sd_now"]), "{parameter}");
    }
    std::fs::copy(dir.path().join("study/design-protocol.csv"), dir.path().join("protocol.csv")).unwrap();
    let moved = vitreo(dir.path(), &["predict", "study", "--force", "protocol.csv", "--json", "-"]).exits(0).json();
    let median = moved["scenarios"][0]["position_um"]["median"].as_array().unwrap();
    let farthest = median.iter().map(|x| number(x).abs()).fold(0.0, f64::max);
    assert!(farthest <= 1.01 * number(&document["largest_displacement_um"]), "{farthest} µm");
    let again = vitreo(dir.path(), &["design", "study", "--json", "-", "--threads", "1"]).exits(0).json();
    assert_eq!(again, document, "another number of threads");
}

/// The commands of docs/design.md: the diagnosis names two effects that the paper's protocol hardly tells apart, and the designed record decides between them.
#[test]
#[ignore = "thorough"]
fn a_designed_record_tells_equivalent_effects_apart() {
    let dir = tempfile::tempdir().unwrap();
    vitreo(dir.path(), &["challenge", "new", "--out", "eye", "--seed", "13"]).exits(0);
    let said = vitreo(dir.path(), &["diagnose", "eye", "--out", "study", "--no-report"]).exits(0);
    assert!(said.stdout.contains("vitreo-uq design study"), "{said}");
    let design = vitreo(dir.path(), &["design", "study", "--json", "-"]).exits(0).json();
    assert_eq!(
        (&design["goal"], &design["effects"]),
        (&"effects".into(), &serde_json::json!(["instantaneous-elasticity", "outer-wall-compliance"]))
    );
    let [now, then] = [number(&design["separation_now_sigma"]), number(&design["recommended"]["separation_sigma"])];
    assert!(then > 1.5 * now && then > 8.0, "{then} σ against {now} σ");
    assert!(number(&design["recommended"]["verdict_right_probability"]) >= 0.8, "{design}");
    // The true model moves by the designed protocol; a diagnosis of that record names one effect only.
    let steps = protocol(&dir.path().join("study/design-protocol.csv"));
    let (end_s, mut table) = (steps[steps.len() - 1][0], String::from("time_s,force_uN,position_um,cycle\n"));
    for k in 0..=(end_s / 0.05).round() as usize {
        let t = 0.05 * k as f64;
        let force = steps.iter().rev().find(|step| step[0] <= t + 1e-9).unwrap()[1];
        // Two thirds are fitted and the last third is scored.
        let cycle = if t < 0.67 * end_s { 1 } else { 2 };
        writeln!(table, "{t:.2},{force},0,{cycle}").unwrap();
    }
    let next = dir.path().join("next");
    std::fs::create_dir(&next).unwrap();
    let toml = std::fs::read_to_string(dir.path().join("eye/experiment.toml")).unwrap();
    let toml: Vec<&str> = toml
        .lines()
        .filter(|line| !line.starts_with("calibration_cycles") && !line.starts_with("heldout_cycles"))
        .collect();
    let toml =
        toml.join("\n").replace("[measurement]", "[measurement]\ncalibration_cycles = [1]\nheldout_cycles = [2]");
    std::fs::write(next.join("experiment.toml"), toml).unwrap();
    std::fs::write(next.join("trajectory.csv"), &table).unwrap();
    let extended = ["extend", "study", "--with", "instantaneous-elasticity", "--no-report", "--json", "-"];
    let extended = vitreo(dir.path(), &extended).exits(0).json();
    let values: Vec<String> = extended["parameters"]
        .as_array()
        .unwrap_or(&Vec::new())
        .iter()
        .map(|p| format!("{}={}", p["name"].as_str().unwrap(), number(&p["median"])))
        .collect();
    assert!(!values.is_empty(), "{extended}");
    let mut simulate = vec!["simulate", "next", "--out", "simulated", "--with", "instantaneous-elasticity"];
    values.iter().filter(|value| !value.starts_with("noise")).for_each(|value| simulate.extend(["--set", value]));
    vitreo(dir.path(), &simulate).exits(0);
    let clean = std::fs::read_to_string(dir.path().join("simulated/simulation/trajectory.csv")).unwrap();
    let mut noise = normals();
    let mut lines = clean.lines();
    let mut noisy = format!("{}\n", lines.next().unwrap());
    for line in lines {
        let mut cells: Vec<String> = line.split(',').map(String::from).collect();
        cells[2] = format!("{:.4}", cells[2].parse::<f64>().unwrap() + 4.0 * noise());
        noisy += &format!("{}\n", cells.join(","));
    }
    std::fs::write(next.join("trajectory.csv"), noisy).unwrap();
    let verdict =
        vitreo(dir.path(), &["diagnose", "next", "--out", "decided", "--no-report", "--json", "-"]).exits(0).json();
    assert_eq!(
        (&verdict["verdict"]["effects"], &verdict["verdict"]["equivalent"]),
        (&serde_json::json!(["instantaneous-elasticity"]), &serde_json::json!([]))
    );
    // Both records together reject the other effect, and the design ends.
    let after = ["design", "study", "--after", "next", "--no-report", "--json", "-"];
    let after = vitreo(dir.path(), &after).exits(0).json();
    assert!(
        after["stop"].as_str().unwrap().contains("instantaneous-elasticity leads outer-wall-compliance"),
        "{after}"
    );
    assert_eq!((&after["goal"], &after["effects"]), (&"parameters".into(), &serde_json::json!([])));
    let likeliest = &after["models"][0];
    assert_eq!(likeliest["effects"], "instantaneous-elasticity");
    assert!(number(&likeliest["probability"]) > 0.98, "{after}");
    let record = &after["after"][0];
    assert!((number(&record["rmse_um"]) / 4.0 - 1.0).abs() < 0.1, "{record}");
}

/// Bad limits and records without a goal are refused with the remedy.
#[test]
fn impossible_designs_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    vitreo(dir.path(), &["sample", "--out", "study", "--no-report"]).exits(0);
    vitreo(dir.path(), &["design", "study", "--goal", "effects"]).refuses(&["vitreo-uq diagnose"]);
    vitreo(dir.path(), &["design", "study", "--budget-s", "0.1"]).refuses(&["20 samples"]);
    vitreo(dir.path(), &["design", "study", "--budget-s", "1e5", "--interval-s", "0.05"]).refuses(&["longer interval"]);
    vitreo(dir.path(), &["design", "study", "--max-force-un", "-3"]).refuses(&["--max-force-un"]);
    // A small limit of the displacement reduces the force of every protocol, also of those that continue a shorter one.
    let limits = ["design", "study", "--max-displacement-um", "20", "--json", "-", "--no-report"];
    let small = vitreo(dir.path(), &limits).json();
    let table = std::fs::read_to_string(dir.path().join("study/design-protocol.csv")).unwrap();
    let forces = table.lines().skip(1).map(|line| line.split(',').nth(1).unwrap().parse::<f64>().unwrap().abs());
    let largest_un = forces.fold(0.0, f64::max);
    assert!(largest_un > 0.02 && largest_un < 2.0, "{largest_un} µN");
    let information = |protocol: &Value| protocol["expected_information_nats"].as_f64().unwrap();
    let longer = small["front"].as_array().unwrap().windows(2);
    longer.for_each(|pair| assert!(information(&pair[1]) > 1.2 * information(&pair[0]), "{}", small["front"]));
}
