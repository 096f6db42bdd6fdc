//! User tests of `predict` and `plan`: the commands of docs/predict.md, closed forms, bad input, and effects that the record cannot distinguish.

use crate::program;

use std::path::Path;

use program::{tree, vitreo};
use serde_json::Value;

/// Scenario of docs/predict.md: the cylinder of the paper's aspect ratio, with the volume of the sphere.
const PAGE: &str = include_str!("../../docs/predict.md");
/// Displacement per force at unit creep compliance of the replica's bead in 1/m (docs/physics.md, §3).
const COMPLIANCE_PER_M: f64 = 549.178;
const SPHERE: &str = "[[scenario]]\nname = \"sphere\"\nforce = { steps_un = [[0, 2]] }\nduration_s = 3\n[[scenario.quantity]]\nkind = \"position_at\"\nat_s = 3\n";

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// The text of a block of docs/predict.md that begins with these words.
fn block(begins: &str) -> &'static str {
    let start = PAGE.find(begins).unwrap_or_else(|| panic!("docs/predict.md has no block `{begins}`"));
    PAGE[start..].split("```").next().expect("a block")
}

fn sampled(dir: &Path) {
    vitreo(dir, &["sample", "--out", "study", "--no-report"]).exits(0);
}

/// The way of the page, from the cohort to a force plan for a cylinder in a new porcine eye. The plan's probability agrees with that of `predict` under the
/// planned force.
#[test]
fn the_page_leads_to_a_plan_for_a_new_eye() {
    let dir = tempfile::tempdir().unwrap();
    let cohort = concat!(env!("CARGO_MANIFEST_DIR"), "/data/cohort");
    std::fs::write(dir.path().join("cylinder.toml"), block("[[scenario]]")).unwrap();
    let commands = block("vitreo-uq groups").lines().filter_map(|line| line.split('#').next()).map(str::trim);
    let mut plan = Value::Null;
    for line in commands.filter(|line| !line.is_empty()) {
        let mut words: Vec<&str> =
            line.split_whitespace().skip(1).map(|word| if word == "data/cohort" { cohort } else { word }).collect();
        words.extend(["--json", "last.json", "--quiet"]);
        vitreo(dir.path(), &words).exits(0);
        plan = serde_json::from_slice(&std::fs::read(dir.path().join("last.json")).unwrap()).unwrap();
    }
    assert_eq!((&plan["schema"], &plan["feasible"]), (&"vitreo-uq/plan/1".into(), &true.into()));
    let promised = number(&plan["probability_promised"]);
    assert!((0.95..0.96).contains(&promised), "{promised}");
    // 128 draws at 95 %: the binomial interval of 99.99 % begins at 0.86.
    assert!(number(&plan["probability_checked"]) > 0.86 && plan["full_runs"] == 128, "{plan}");
    let protocol = std::fs::read_to_string(dir.path().join("gels/species/plan-protocol.csv")).unwrap();
    std::fs::write(dir.path().join("protocol.csv"), &protocol).unwrap();
    let own = block("[[scenario]]").lines().filter(|line| !line.starts_with("force") && !line.starts_with("duration"));
    std::fs::write(dir.path().join("same.toml"), own.collect::<Vec<&str>>().join("\n")).unwrap();
    let again = [
        "predict",
        "gels/species",
        "--new-eye",
        "porcine",
        "--scenario",
        "same.toml",
        "--force",
        "protocol.csv",
        "--json",
        "-",
    ];
    let again = vitreo(dir.path(), &again).exits(0).json();
    let arrival = &again["scenarios"][0]["quantities"][1];
    assert_eq!(arrival["name"], "time_to_reach_um");
    assert!((number(&arrival["probability"]) - promised).abs() < 0.02, "{arrival} against {promised}");
    assert_group_share(dir.path(), &again);
}

/// Under a constant force the position at 5 s is proportional to the Lethersich law's J(5 s), written out here. The share of the group is the correlation of the two specimens of
/// each draw of the population.
fn assert_group_share(dir: &Path, document: &Value) {
    let table = std::fs::read_to_string(dir.join("gels/species/new-specimens.csv")).unwrap();
    let mut lines = table.lines();
    assert_eq!(lines.next(), Some("group,draw,young_modulus_pa,viscosity_1_pa_s,viscosity_2_pa_s"));
    let compliance = |line: &str| -> f64 {
        let x: Vec<f64> = line.split(',').skip(2).map(|cell| cell.parse().unwrap()).collect();
        (1.0 - (-5.0 * x[0] / x[1]).exp()) / x[0] + 5.0 / x[2]
    };
    let values: Vec<f64> = lines.filter(|line| line.starts_with("porcine,")).map(compliance).collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let variance: f64 = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / values.len() as f64;
    let common: f64 = values.chunks_exact(2).map(|pair| (pair[0] - mean) * (pair[1] - mean)).sum();
    let expected = common / (0.5 * values.len() as f64 * variance);
    let found = &document["group_shares"][0];
    assert_eq!(found["quantity"], "position at 5 s");
    assert!((number(&found["share"]) - expected).abs() < 1e-6, "{found} for {expected}");
    assert!((0.01..0.9).contains(&expected), "{expected}");
}

/// A constant force on the record's own sphere: x(t) = F·C·J(t), with J of the Lethersich law written out here at the posterior's medians. The band is
/// narrow, so its median lies within its width of that.
#[test]
fn a_constant_force_moves_the_sphere_by_the_closed_form() {
    let dir = tempfile::tempdir().unwrap();
    sampled(dir.path());
    std::fs::write(dir.path().join("sphere.toml"), SPHERE).unwrap();
    let run = ["predict", "study", "--scenario", "sphere.toml", "--json", "-", "--no-report"];
    let document = vitreo(dir.path(), &run).exits(0).json();
    let posterior = std::fs::read(dir.path().join("study/m0/posterior.json")).unwrap();
    let posterior: Value = serde_json::from_slice(&posterior).unwrap();
    let median = |name: &str| {
        let parameters = posterior["parameters"].as_array().unwrap();
        number(&parameters.iter().find(|p| p["name"] == name).unwrap()["median"])
    };
    let [e, c1, c2] = ["young_modulus_pa", "viscosity_1_pa_s", "viscosity_2_pa_s"].map(median);
    let exact_um = |t: f64| 2.0 * COMPLIANCE_PER_M * ((1.0 - (-e * t / c1).exp()) / e + t / c2);
    let scenario = &document["scenarios"][0];
    let list =
        |key: &str| -> Vec<f64> { scenario["position_um"][key].as_array().unwrap().iter().map(number).collect() };
    let (times, q05, q95): (Vec<f64>, Vec<f64>, Vec<f64>) =
        (scenario["time_s"].as_array().unwrap().iter().map(number).collect(), list("q05"), list("q95"));
    for (row, time_s) in times.iter().enumerate().skip(1) {
        let exact = exact_um(*time_s);
        assert!(
            (q05[row]..=q95[row]).contains(&exact),
            "{time_s} s: {exact} is not within {} and {}",
            q05[row],
            q95[row]
        );
        assert!(q95[row] - q05[row] < 0.01 * exact, "the band is wide at {time_s} s");
    }
    assert!(number(&scenario["full_model_error_um"]) < 1e-6 && scenario["full_runs"] == 8, "{scenario}");
    let files = tree(&dir.path().join("study"));
    for name in ["prediction.json", "prediction.csv", "prediction.png", "prediction.pdf"] {
        assert!(files.contains_key(Path::new(name)), "{name}");
    }
    let one = vitreo(dir.path(), &[&run[..], &["--threads", "1"]].concat()).exits(0).json();
    assert_eq!(one, document, "another number of threads");
}

/// A plan that fails names the strain as its limit, and the largest force that keeps it. It removes the controller's file of an earlier plan.
#[test]
fn a_strain_far_too_small_is_named() {
    let dir = tempfile::tempdir().unwrap();
    sampled(dir.path());
    let plan = |more: &[&str], code: i32| {
        let target = ["plan", "study", "--reach-mm", "0.1", "--within-s", "3", "--json", "-", "--no-report"];
        vitreo(dir.path(), &[&target, more].concat()).exits(code).json()
    };
    plan(&[], 0);
    let protocol = dir.path().join("study/plan-protocol.csv");
    assert!(protocol.exists());
    let strained = plan(&["--max-strain", "0.001"], 1);
    assert_eq!((&strained["feasible"], &strained["limit"]), (&false.into(), &"strain".into()));
    assert!((1e-4..0.1).contains(&number(&strained["force"][0]["force_un"])), "{strained}");
    assert_eq!(strained["protocol_file"], "");
    assert!(!protocol.exists());
}

/// Holds longer than those of the record (5 s), and pulses and waves faster than its rows (0.05 s), are named; steps that it tests are not.
#[test]
fn times_that_the_record_does_not_test_are_named() {
    let dir = tempfile::tempdir().unwrap();
    sampled(dir.path());
    for (force, duration_s, words) in [
        ("{ steps_un = [[0, 2], [5, 0], [10, 2]] }", 15, ""),
        ("{ steps_un = [[0, 2]] }", 9, "the longest time at one force is 1.80 times"),
        ("{ steps_un = [[0, 2], [2, 0]] }", 9, "the longest time at one force is 1.40 times"),
        ("{ steps_un = [[12, 4], [15, 0]] }", 20, ""),
        ("{ sine_un = 4, frequency_hz = 3 }", 10, ""),
        ("{ sine_un = 4, frequency_hz = 10 }", 10, "asks for the motion within 0.0491 s"),
        ("{ steps_un = [[1, 2], [1.01, 0]] }", 3, "asks for the motion within 0.0100 s"),
    ] {
        let scenario = format!("[[scenario]]\nname = \"robot\"\nforce = {force}\nduration_s = {duration_s}\n");
        std::fs::write(dir.path().join("times.toml"), scenario).unwrap();
        let run = ["predict", "study", "--scenario", "times.toml", "--json", "-", "--no-report"];
        let document = vitreo(dir.path(), &run).exits(0).json();
        let warnings = document["scenarios"][0]["warnings"].to_string();
        let is_named =
            ["longest time at one force", "asks for the motion within"].iter().any(|part| warnings.contains(part));
        assert_eq!(is_named, !words.is_empty(), "{force}: {warnings}");
        assert!(warnings.contains(words), "{force}: {warnings}");
    }
}

/// Without a record the gel is that of a prior. Under a constant force a gel that only springs moves by F k/E, so quantiles of the position are those of the prior.
/// The standard error of a 5 % quantile from 10,000 draws is 0.2 % of the range of E.
#[test]
fn a_gel_of_a_prior_moves_as_its_distribution_says() {
    let dir = tempfile::tempdir().unwrap();
    let uniform = |name: &str, low: f64, high: f64, unit: &str| {
        format!(
            "[{name}]\ndistribution = \"uniform\"\nlower = {low:e}\nupper = {high:e}\nunit = \"{unit}\"\nsource = \"a test\"\n"
        )
    };
    let prior = uniform("young_modulus_pa", 2.0, 6.0, "Pa")
        + &uniform("viscosity_1_pa_s", 1e-3, 2e-3, "Pa s")
        + &uniform("viscosity_2_pa_s", 1e7, 2e7, "Pa s")
        + &uniform("noise_sd_um", 1.0, 2.0, "um");
    std::fs::write(dir.path().join("springs.toml"), prior).unwrap();
    let apparatus = "[scenario.robot]\nshape = \"sphere\"\ndiameter_mm = 0.6\n[scenario.vitreous]\ndiameter_mm = 20\npoisson_ratio = 0.48\n";
    std::fs::write(dir.path().join("sphere.toml"), SPHERE.to_string() + apparatus).unwrap();
    let run = ["predict", "--prior", "springs.toml", "--scenario", "sphere.toml", "--json", "-"];
    let document = vitreo(dir.path(), &run).exits(0).json();
    let last = |key: &str| number(document["scenarios"][0]["position_um"][key].as_array().unwrap().last().unwrap());
    let [high, median, low] = ["q95", "median", "q05"].map(last);
    for (found, expected) in [(low / median, 4.0 / 5.8), (high / median, 4.0 / 2.2)] {
        assert!((found / expected - 1.0).abs() < 0.02, "{found} against {expected}");
    }
    assert!(dir.path().join("vitreo-uq-out/prior-springs/prediction.png").is_file());
    let both = vitreo(dir.path(), &["predict", "study", "--prior", "porcine"]).exits(2);
    assert!(both.stderr.contains("--prior"), "{both}");
    vitreo(dir.path(), &["predict", "--prior", "porcine"]).refuses(&["--scenario"]);
}

/// Tolerances widen the band by their own share, and the sensitivity attributes the variance to them.
#[test]
fn tolerances_widen_the_band_and_are_its_largest_source() {
    let dir = tempfile::tempdir().unwrap();
    sampled(dir.path());
    std::fs::write(dir.path().join("s.toml"), format!("{SPHERE}[scenario.tolerance]\nforce_percent = 3\n")).unwrap();
    let document = vitreo(dir.path(), &["predict", "study", "--scenario", "s.toml", "--json", "-"]).exits(0).json();
    let position = &document["scenarios"][0]["quantities"][0];
    let half = 0.5 * (number(&position["q95"]) - number(&position["q05"])) / number(&position["median"]);
    // A uniform distribution of ± 3 % has a central 90 % interval of ± 2.7 %.
    assert!((half - 0.027).abs() < 5e-4, "{half}");
    let force = document["sensitivity"].as_array().unwrap().iter().find(|entry| entry["input"] == "force calibration");
    assert!(number(&force.unwrap()["total"]) > 0.95, "{document}");
}

/// A target beyond the limit of the force is refused with the highest probability and the limit; one within ± 5 µm of rest is held.
#[test]
fn plans_name_their_limit_and_rest_at_the_target() {
    let dir = tempfile::tempdir().unwrap();
    sampled(dir.path());
    let run = |more: &[&str]| {
        vitreo(dir.path(), &[&["plan", "study", "--within-s", "3", "--no-report", "--json", "-"], more].concat())
    };
    let far = run(&["--reach-mm", "5"]).exits(1).json();
    assert_eq!(
        (&far["feasible"], &far["limit"], &far["probability_promised"]),
        (&false.into(), &"force".into(), &0.0.into())
    );
    assert!(far["sentence"].as_str().unwrap().contains("The limit that binds is the force"), "{far}");
    run(&["--reach-mm", "30"]).refuses(&["outside the gel", "touches after 9.725 mm"]);
    let strained = run(&["--reach-mm", "0.3", "--max-strain", "0.1"]).exits(1).json();
    assert_eq!(strained["limit"], "strain");
    let rest = run(&["--reach-mm", "0.3", "--rest-within-um", "5", "--rest-s", "4", "--max-slew-un-per-s", "20"])
        .exits(0)
        .json();
    let steps: Vec<[f64; 2]> = rest["force"]
        .as_array()
        .unwrap()
        .iter()
        .map(|step| [number(&step["time_s"]), number(&step["force_un"])])
        .collect();
    let fastest =
        steps.windows(2).map(|pair| ((pair[1][1] - pair[0][1]) / (pair[1][0] - pair[0][0])).abs()).fold(0.0, f64::max);
    assert!(fastest <= 20.001, "{fastest} µN/s");
    let (times, median) =
        (rest["tube"]["time_s"].as_array().unwrap(), rest["tube"]["position_um"]["median"].as_array().unwrap());
    for (time_s, x) in times.iter().zip(median).filter(|(time_s, _)| number(time_s) >= 3.0) {
        assert!((number(x) - 300.0).abs() < 5.0, "{x} µm at {time_s} s");
    }
    // A force that rises for 3 s cannot wait for the arrival: it is shaped from the start on.
    let slow =
        ["--within-s", "5", "--reach-mm", "0.5", "--rest-within-um", "20", "--rest-s", "3", "--max-slew-un-per-s", "1"];
    let slow =
        vitreo(dir.path(), &[&["plan", "study", "--no-report", "--json", "-"], &slow[..]].concat()).exits(0).json();
    assert!(number(&slow["probability_checked"]) > 0.95, "{slow}");
    let steps: Vec<[f64; 2]> = slow["force"]
        .as_array()
        .unwrap()
        .iter()
        .map(|step| [number(&step["time_s"]), number(&step["force_un"])])
        .collect();
    assert!(
        steps.windows(2).all(|pair| (pair[1][1] - pair[0][1]).abs() <= 1.001 * (pair[1][0] - pair[0][0])),
        "{steps:?}"
    );
    // On the way there the robot does not pass the target.
    assert!(
        median.iter().all(|x| number(x) < 305.0) && !rest["sentence"].as_str().unwrap().contains("beyond"),
        "{rest}"
    );
}

/// A model with an effect that the record cannot distinguish from another: both are predicted, and the answer says whether they agree.
#[test]
#[ignore = "thorough"]
fn equivalent_effects_are_predicted_side_by_side() {
    let dir = tempfile::tempdir().unwrap();
    vitreo(dir.path(), &["challenge", "new", "--out", "eye", "--seed", "13"]).exits(0);
    vitreo(dir.path(), &["diagnose", "eye", "--out", "study", "--no-report"]).exits(0);
    vitreo(dir.path(), &["extend", "study", "--with", "instantaneous-elasticity", "--no-report"]).exits(0);
    // The two differ where the force has just changed.
    let early = "[[scenario]]\nname = \"early\"\nforce = { steps_un = [[0, 4]] }\nduration_s = 0.2\n[[scenario.quantity]]\nkind = \"position_at\"\nat_s = 0.01\n";
    std::fs::write(dir.path().join("early.toml"), early).unwrap();
    let document = vitreo(dir.path(), &["predict", "study", "--scenario", "early.toml", "--json", "-"]).exits(0).json();
    let other = &document["equivalent"][0];
    assert_eq!((&other["effect"], &other["scenario"]), (&"outer-wall-compliance".into(), &"early".into()));
    let is_named = document["warnings"].as_array().unwrap().iter().any(|warning| warning["kind"] == "model_incomplete");
    assert_eq!(other["disagrees"].as_bool().unwrap(), number(&other["disagreement"]) > 1.0);
    assert_eq!(is_named, other["disagrees"].as_bool().unwrap(), "{document}");
}

/// A power-law gel has no length of its own: a robot and a gel twice as large under four times the force have the same stresses, so that the robot moves twice as far. The stress to
/// which the viscosity refers stays that of the record.
#[test]
#[ignore = "campaigns/long-tests"]
fn a_shear_thinning_gel_scales_with_its_robot() {
    let dir = tempfile::tempdir().unwrap();
    sampled(dir.path());
    let scenario = |size: f64| {
        format!(
            "[[scenario]]\nname = \"{size}\"\nforce = {{ steps_un = [[0, {}]] }}\nduration_s = 2\n[scenario.effects]\nshear-thinning.index = 0.7\n\
             [scenario.robot]\nshape = \"sphere\"\ndiameter_mm = {}\n[scenario.vitreous]\ndiameter_mm = {}\npoisson_ratio = 0.48\n",
            2.0 * size * size,
            0.55 * size,
            20.0 * size
        )
    };
    std::fs::write(dir.path().join("s.toml"), scenario(1.0) + &scenario(2.0)).unwrap();
    let run = ["predict", "study", "--scenario", "s.toml", "--no-report", "--json", "-"];
    let document = vitreo(dir.path(), &run).exits(0).json();
    let [one, two] = [0, 1].map(|k| number(&document["scenarios"][k]["quantities"][0]["median"]));
    assert!((two / one - 2.0).abs() < 2e-3, "{two} for twice {one}");
}

/// Every refusal names the place and the remedy.
#[test]
fn wrong_scenarios_and_targets_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    sampled(dir.path());
    let refuses = |text: &str, words: &[&str]| {
        std::fs::write(dir.path().join("s.toml"), text).unwrap();
        vitreo(dir.path(), &["predict", "study", "--scenario", "s.toml"]).exits(2).refuses(words);
    };
    refuses("[[scenario]]\nname = \"a\"\n", &["force", "steps_un"]);
    refuses("[[scenario]]\nname = \"a\"\nforce = { ramp_un_per_s = 1 }\n", &["duration_s = 10"]);
    refuses(&SPHERE.replace("position_at", "return").replace("at_s = 3\n", ""), &["not zero over some time"]);
    let thin =
        "[scenario.robot]\nshape = \"cylinder\"\nlength_mm = 30\ndiameter_mm = 0.2\norientation = \"horizontal\"\n";
    refuses(
        &SPHERE.replace("[[scenario.quantity]]", &format!("{thin}[[scenario.quantity]]")),
        &["does not fit inside"],
    );
    // Without a record there is no largest force to which an effect could refer.
    let of_prior = |robot: &str, effects: &str| {
        let gel = "[scenario.vitreous]\ndiameter_mm = 20\npoisson_ratio = 0.48\n";
        let text = format!("{robot}{gel}{effects}[[scenario.quantity]]");
        std::fs::write(dir.path().join("s.toml"), SPHERE.replace("[[scenario.quantity]]", &text)).unwrap();
        vitreo(dir.path(), &["predict", "--prior", "porcine", "--scenario", "s.toml"]).exits(2)
    };
    let bead = "[scenario.robot]\nshape = \"sphere\"\ndiameter_mm = 0.55\n";
    of_prior(bead, "[scenario.effects]\nforce-bias.fraction = 0.5\n").refuses(&["s.toml", "largest force of a record"]);
    let needle =
        "[scenario.robot]\nshape = \"ellipsoid\"\nlength_mm = 9\ndiameter_mm = 0.09\norientation = \"horizontal\"\n";
    of_prior(needle, "").refuses(&["s.toml", "scenario sphere: robot", "change the sizes"]);
    let none = vitreo(dir.path(), &["predict", "study", "--new-eye", "porcine"]).exits(2);
    none.refuses(&["vitreo-uq groups"]);
    vitreo(dir.path(), &["plan", "study", "--reach-mm", "0", "--within-s", "3"]).exits(2).refuses(&["--reach-mm"]);
    for probability in ["0", "1", "1.5"] {
        let unsure = ["plan", "study", "--reach-mm", "0.1", "--within-s", "3", "--probability", probability];
        vitreo(dir.path(), &unsure).exits(2).refuses(&["--probability", "from 0.5 to 0.999", "more often than it"]);
    }
}

/// A gel that slips without friction: an incompressible medium resists a sphere with 4πGa·u in place of 6πGa·u, so that the sphere moves 1.5 times as far
/// (Basset 1888; physics §4.7). The container, 36 times as wide, and the Poisson ratio of 0.48 change this by a few percent.
#[test]
fn effects_of_a_scenario_act_on_the_gel_of_a_study() {
    let dir = tempfile::tempdir().unwrap();
    sampled(dir.path());
    let run = |effects: &str| {
        let text = SPHERE.replace("[[scenario.quantity]]", &format!("{effects}\n[[scenario.quantity]]"));
        std::fs::write(dir.path().join("slip.toml"), text).unwrap();
        vitreo(dir.path(), &["predict", "study", "--scenario", "slip.toml", "--no-report", "--json", "-"])
    };
    let median = |document: &Value| number(&document["scenarios"][0]["quantities"][0]["median"]);
    let slip = "interface-slip.slip_compliance_m_per_pa_s";
    let sticking = median(&run("").exits(0).json());
    let [little, free] =
        ["1e-12", "1e6"].map(|size| run(&format!("[scenario.effects]\n{slip} = {size}")).exits(0).json());
    assert!((median(&little) / sticking - 1.0).abs() < 1e-3, "{} {sticking}", median(&little));
    assert!((median(&free) / sticking / 1.5 - 1.0).abs() < 0.05, "{} {sticking}", median(&free));
    assert!(free["scenarios"][0]["apparatus"].as_str().unwrap().contains(&format!("{slip} = 1000000")), "{free}");
    let strained = run(&format!("[scenario.effects]\n{slip} = 1e6\n[[scenario.quantity]]\nkind = \"peak_strain\""))
        .exits(0)
        .json();
    let warnings = strained["scenarios"][0]["warnings"].to_string();
    assert!(warnings.contains("peak strain is that of the displacement field without interface-slip"), "{warnings}");
    let varied = run(&format!("[scenario.vary]\n\"{slip}\" = [1e-12, 1e6]")).exits(0).json();
    let both: Vec<f64> = (0..2).map(|k| number(&varied["scenarios"][k]["quantities"][0]["median"])).collect();
    assert_eq!(both, [median(&little), median(&free)]);
    run("[scenario.effects]\nslip = 1").exits(2).refuses(&["unknown key `slip`"]);
    run("[scenario.effects]\ninterface-slip.slip = 1").exits(2).refuses(&["unknown parameter", "slip_compliance"]);
    run("[scenario.effects]\nactuator-lags.lag_time_s = 1").exits(2).refuses(&["did you mean `actuator-lag`"]);
}

/// A linear gel: the force that a robot needs is inversely proportional to its compliance. At ν = 0.48 the resistance of the cylinder along the force is 1.2934
/// times that of the sphere of its volume, and of the ellipsoid 1.25 times (docs/shapes.md). Another robot then needs a force of that ratio, and a force of that ratio
/// leads back to the robot.
#[test]
fn robots_are_compared_by_the_force_that_they_need() {
    let dir = tempfile::tempdir().unwrap();
    sampled(dir.path());
    // Volume of a sphere of 0.55 mm: bodies of length to diameter 68/7.
    let robots = "[[scenario]]\nname = \"sphere\"\n[scenario.vary]\nsize = [1, 2]\n\
        [[scenario]]\nname = \"ellipsoid\"\n[scenario.robot]\nshape = \"ellipsoid\"\nlength_mm = 0.55\ndiameter_mm = 0.55\norientation = \"horizontal\"\n[scenario.vary]\naspect = [9.714285714]\n\
        [[scenario]]\nname = \"cylinder\"\n[scenario.robot]\nshape = \"cylinder\"\nlength_mm = 0.48046\ndiameter_mm = 0.48046\norientation = \"horizontal\"\n[scenario.vary]\naspect = [9.714285714]\n";
    std::fs::write(dir.path().join("robots.toml"), robots).unwrap();
    let run = [
        "plan",
        "study",
        "--scenario",
        "robots.toml",
        "--reach-mm",
        "0.3",
        "--within-s",
        "3",
        "--no-report",
        "--json",
        "-",
    ];
    let plan = vitreo(dir.path(), &run).exits(0).json();
    let all = plan["robots"].as_array().unwrap();
    let force = |name: &str| number(&all.iter().find(|robot| robot["name"] == name).unwrap()["force_un"]);
    let sphere = force("sphere, size 1");
    for (name, resistance, accuracy) in [
        ("ellipsoid, aspect 9.714285714", 1.25, 2e-4),
        ("cylinder, aspect 9.714285714", 1.2934, 2e-4),
        ("sphere, size 2", 2.0, 0.1),
    ] {
        assert!((force(name) / sphere / resistance - 1.0).abs() < accuracy, "{name}: {}", force(name) / sphere);
    }
    let front: Vec<&Value> = all.iter().filter(|robot| robot["on_front"] == true).map(|robot| &robot["name"]).collect();
    assert_eq!(front, ["sphere, size 1", "sphere, size 2"]);
    assert!(
        plan["sentence"].as_str().unwrap().starts_with("The smallest force of 4 robots is that on sphere, size 1."),
        "{plan}"
    );
    assert!(dir.path().join("study/plan-robots.svg").is_file());
    // Under 1.25 times the sphere's force, the ellipsoid of the aspect ratio that this belongs to is the longest one.
    let ellipsoid = robots[robots.find("[[scenario]]\nname = \"ellipsoid").unwrap()..].split("[scenario.vary]").next();
    std::fs::write(dir.path().join("ellipsoid.toml"), ellipsoid.unwrap()).unwrap();
    let force = (1.25 * sphere).to_string();
    let longest = |target: &str, more: &[&str]| {
        let words = ["plan", "study", "--scenario", target, "--reach-mm", "0.3", "--within-s", "3", "--longest-robot"];
        vitreo(dir.path(), &[&words[..], &["--max-force-un", &force, "--no-report", "--json", "-"], more].concat())
    };
    let plan = longest("ellipsoid.toml", &[]).exits(0).json();
    let length_mm = 0.55 * (68.0_f64 / 7.0).powf(2.0 / 3.0);
    let robot = &plan["robots"][0];
    assert!((number(&robot["length_mm"]) / length_mm - 1.0).abs() < 2e-3, "{robot}");
    assert!((6.0 / std::f64::consts::PI * number(&robot["volume_mm3"]) / 0.55_f64.powi(3) - 1.0).abs() < 1e-6);
    assert!(
        plan["sentence"].as_str().unwrap().starts_with("The longest robot of its volume that succeeds is"),
        "{plan}"
    );
    std::fs::write(dir.path().join("sphere.toml"), "[[scenario]]\nname = \"sphere\"\n").unwrap();
    longest("sphere.toml", &[]).exits(2).refuses(&["no other aspect ratio"]);
    longest("ellipsoid.toml", &["--max-strain", "0.1"]).exits(2).refuses(&["limit of the strain"]);
}

/// The largest sphere under a force, and the smallest under a force that grows with its volume. A sphere of radius a in an infinite gel moves by F·J/(6π a ·
/// const), so that twice the force moves a sphere of twice the size as far, up to the effect of the container; the plan for the robot that is found must need
/// the whole force.
#[test]
fn sizes_are_found_at_their_limit() {
    let dir = tempfile::tempdir().unwrap();
    sampled(dir.path());
    let run = |more: &[&str]| {
        let words = ["plan", "study", "--reach-mm", "0.1", "--within-s", "3", "--no-report", "--json", "-"];
        vitreo(dir.path(), &[&words[..], more].concat()).exits(0).json()
    };
    let diameter_mm = |plan: &Value| (6.0 / std::f64::consts::PI * number(&plan["robots"][0]["volume_mm3"])).cbrt();
    let [once, twice] = ["1", "2"].map(|force| run(&["--largest-robot", "--max-force-un", force]));
    let ratio = diameter_mm(&twice) / diameter_mm(&once);
    assert!((ratio - 2.0).abs() < 0.3, "{ratio}");
    for (plan, largest_un) in [(&once, 1.0), (&twice, 2.0)] {
        let robot = &plan["robots"][0];
        assert!((number(&robot["force_un"]) / largest_un - 1.0).abs() < 1e-3, "{robot}");
        assert!(
            plan["sentence"].as_str().unwrap().starts_with("The largest robot that succeeds is a sphere of"),
            "{plan}"
        );
    }
    // The same sphere as a magnet: its force per volume leads back to it.
    let density = 1.0 / number(&once["robots"][0]["volume_mm3"]);
    let magnet = run(&["--smallest-magnet-un-per-mm3", &density.to_string()]);
    assert!((diameter_mm(&magnet) / diameter_mm(&once) - 1.0).abs() < 1e-3, "{magnet}");
    // A strain limit needs a larger body than the force does: the strain of a displacement falls with the size.
    let strained = ["0.2", "0.15"].map(|limit| run(&["--smallest-magnet-un-per-mm3", "100", "--max-strain", limit]));
    let ratio = diameter_mm(&strained[1]) / diameter_mm(&strained[0]);
    assert!((ratio / (0.2 / 0.15) - 1.0).abs() < 0.05, "{ratio}");
}
