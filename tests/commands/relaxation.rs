//! Records with a prescribed position, from the table to the verdict. The forces come from closed forms.

use crate::program::{Run, normals, vitreo};
use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;

/// Displacement per force at unit creep compliance of a bead of 0.55 mm in the middle of a ball of 20 mm with ν = 0.48, in 1/m (docs/physics.md, §3).
const COMPLIANCE_PER_M: f64 = 549.178;
/// E (Pa), c₁ and c₂ (Pa·s) of the gel.
const LAW: [f64; 3] = [3.0, 1.5, 40.0];
/// Standard deviation of the force's noise, in µN.
const NOISE_UN: f64 = 0.01;

/// Corners of the commanded position: time (s) and position (µm).
fn corners() -> Vec<[f64; 2]> {
    let cycle =
        |k: f64| [[20.0 * k + 0.5, 300.0], [20.0 * k + 10.0, 300.0], [20.0 * k + 10.5, 0.0], [20.0 * k + 20.0, 0.0]];
    std::iter::once([0.0, 0.0]).chain((0..3).flat_map(|k| cycle(f64::from(k)))).collect()
}

/// Force (µN) of the Lethersich law at a time (s). G(t) = η δ(t) + g e^{−ρt} with ρ = E/(c₁ + c₂), g = E c₂²/(c₁ + c₂)² and η = c₁c₂/(c₁ + c₂).
fn force_un(t: f64) -> f64 {
    let [e, c1, c2] = LAW;
    let (rate, modulus, viscosity) = (e / (c1 + c2), e * (c2 / (c1 + c2)).powi(2), c1 * c2 / (c1 + c2));
    let ramps = corners();
    let of_ramp = |pair: &[[f64; 2]]| {
        let ([from_s, from_um], [to_s, to_um]) = (pair[0], pair[1]);
        if t <= from_s {
            return 0.0;
        }
        let slope = (to_um - from_um) / (to_s - from_s);
        let end_s = to_s.min(t);
        let relaxed = modulus / rate * ((-rate * (t - end_s)).exp() - (-rate * (t - from_s)).exp());
        slope * (relaxed + if t <= to_s { viscosity } else { 0.0 })
    };
    ramps.windows(2).map(of_ramp).sum::<f64>() / COMPLIANCE_PER_M
}

fn write_bead(folder: &Path, drift_un_per_s: f64) {
    let (mut normal, corners) = (normals(), corners());
    let position_um = |t: f64| {
        let next = corners.partition_point(|[at, _]| *at < t).clamp(1, corners.len() - 1);
        let ([from_s, from_um], [to_s, to_um]) = (corners[next - 1], corners[next]);
        from_um + (to_um - from_um) * (t - from_s) / (to_s - from_s)
    };
    let mut table = String::from("time (s),force (µN),position (µm)\n");
    for row in 0..=1200 {
        let t = 0.05 * f64::from(row);
        let force_un = force_un(t) + drift_un_per_s * t + NOISE_UN * normal();
        let _ = writeln!(table, "{t:.2},{force_un:.5},{:.3}", position_um(t));
    }
    std::fs::write(folder.join("bead.csv"), table).unwrap();
    let sizes = ["--robot-diameter-mm", "0.55", "--vitreous-diameter-mm", "20", "--poisson-ratio", "0.48"];
    vitreo(folder, &[&["init", "bead.csv", "--out", "bead"], &sizes[..]].concat()).exits(0);
    let toml = std::fs::read_to_string(folder.join("bead/experiment.toml")).unwrap();
    assert!(toml.contains("kind = \"relaxation\""), "{toml}");
}

/// Estimates of a document of `fit`, in the order of the law's parameters.
fn estimates(document: &Value) -> Vec<f64> {
    document["parameters"].as_array().unwrap().iter().map(|own| own["value"].as_f64().unwrap()).collect()
}

#[test]
fn a_bead_under_a_prescribed_position_gives_the_law() {
    let folder = tempfile::tempdir().unwrap();
    write_bead(folder.path(), 0.0);
    let fit = vitreo(folder.path(), &["fit", "bead", "--json", "-", "--quiet"]).exits(0).json();
    for (found, expected) in estimates(&fit).into_iter().zip(LAW) {
        assert!((found / expected - 1.0).abs() < 5e-3, "{found} {expected}");
    }
    let posterior =
        vitreo(folder.path(), &["sample", "bead", "--out", "study", "--json", "-", "--quiet"]).exits(0).json();
    assert_eq!(posterior["record_kind"], "relaxation");
    assert_eq!(posterior["heldout"]["rmse_um"], Value::Null, "no position was measured");
    let rmse_un = posterior["heldout"]["rmse_un"].as_f64().unwrap();
    assert!((rmse_un / NOISE_UN - 1.0).abs() < 0.1, "{rmse_un}");
    // A force acts on the gel of a relaxation as it does on that of a creep: x(2 s) = C F J(2 s).
    std::fs::write(folder.path().join("pull.csv"), "time_s,force_un\n0,2\n2,2\n").unwrap();
    let predicted = ["predict", "study", "--force", "pull.csv", "--json", "-", "--quiet"];
    let predicted = vitreo(folder.path(), &predicted).exits(0).json();
    let [e, c1, c2] = LAW;
    let expected_um = 2.0 * COMPLIANCE_PER_M * (2.0 / c2 + (1.0 - (-2.0 * e / c1).exp()) / e);
    let found_um = predicted["scenarios"][0]["quantities"][0]["median"].as_f64().unwrap();
    assert!((found_um / expected_um - 1.0).abs() < 5e-3, "{found_um} {expected_um}");
    let plan = ["plan", "study", "--reach-mm", "0.1", "--within-s", "2", "--quiet"];
    assert!(vitreo(folder.path(), &plan).exits(2).stderr.contains("--max-force-un"));
    let report = std::fs::read_to_string(folder.path().join("study/report.html")).unwrap();
    assert!(report.contains("force (µN)") && !report.contains("position (µN)"), "labels of the measured quantity");
    let check = vitreo(folder.path(), &["check", "study"]).exits(0);
    assert!(check.stdout.contains("position 0.00 to 300 µm, which is linear"), "{}", check.stdout);
}

#[test]
fn a_drift_of_the_force_sensor_is_named_and_added() {
    let folder = tempfile::tempdir().unwrap();
    write_bead(folder.path(), 2e-3);
    vitreo(folder.path(), &["sample", "bead", "--out", "study", "--quiet"]).exits(1);
    let found = vitreo(folder.path(), &["diagnose", "study", "--json", "-", "--quiet"]).json();
    assert_eq!(found["verdict"]["effects"], serde_json::json!(["tracking-drift"]), "{}", found["verdict"]["sentence"]);
    assert!(found["verdict"]["sentence"].as_str().unwrap().contains("µN"), "{}", found["verdict"]["sentence"]);
    let extended =
        vitreo(folder.path(), &["extend", "study", "--with", "tracking-drift", "--json", "-", "--quiet"]).json();
    let after_un = extended["after"]["rmse_heldout_un"].as_f64().unwrap();
    assert!(after_un < 1.15 * NOISE_UN, "{after_un}");
}

#[test]
fn effects_of_the_field_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    write_bead(folder.path(), 0.0);
    vitreo(folder.path(), &["fit", "bead", "--with", "interface-slip"])
        .refuses(&["interface-slip", "prescribed force"]);
    vitreo(folder.path(), &["simulate", "bead", "--out", "simulated"])
        .refuses(&["the position of this record is prescribed"]);
    vitreo(folder.path(), &["fit", "bead", "--with", "inertia"]).refuses(&["inertia", "prescribed force"]);
}

/// A published relaxation modulus of a standard linear solid: 150 Pa + 400 Pa e^{−t/2 s} in shear, without a strain.
#[test]
fn a_published_modulus_gives_the_law_and_its_unit() {
    let folder = tempfile::tempdir().unwrap();
    let mut normal = normals();
    let mut table = String::from("Time (s)\tRelaxation Modulus (kPa)\n");
    for row in 0..120 {
        let t = 0.02 * 1.06_f64.powi(row);
        let modulus_pa = 150.0 + 400.0 * (-t / 2.0).exp() + 0.5 * normal();
        let _ = writeln!(table, "{t:.4}\t{:.7}", 1e-3 * modulus_pa);
    }
    std::fs::write(folder.path().join("modulus.txt"), table).unwrap();
    vitreo(folder.path(), &["init", "modulus.txt"]).exits(0);
    let arguments = ["fit", "modulus", "--base", "standard-linear-solid", "--json", "-", "--quiet"];
    let fit = vitreo(folder.path(), &arguments).exits(0).json();
    // The strain of 1 is by definition, so it says nothing of large strains.
    assert!(fit["warnings"].as_array().unwrap().iter().all(|warning| warning["kind"] != "large_strain"), "{fit}");
    // Young's moduli are three times the moduli in shear.
    for (found, expected) in estimates(&fit).into_iter().zip([450.0, 1200.0, 2400.0]) {
        assert!((found / expected - 1.0).abs() < 5e-3, "{found} {expected}");
    }
    let residual_pa = fit["rmse_pa"].as_f64().unwrap();
    assert!((residual_pa / 0.5 - 1.0).abs() < 0.2, "{residual_pa}");
    vitreo(folder.path(), &["fit", "modulus", "--base", "standard-linear-soild"]).refuses(&["standard-linear-solid"]);
}

/// A published compliance counts from the zero of its table, though its first row is after the step. `init` and `check` report the same strains.
#[test]
fn a_published_compliance_keeps_its_zero() {
    let folder = tempfile::tempdir().unwrap();
    let rows = (1..60).map(|row| 0.5 * f64::from(row));
    let table: String = rows.map(|t| format!("{t}\t{:.6}\n", 0.02 + 0.03 * (1.0 - (-t / 2.0).exp()))).collect();
    std::fs::write(folder.path().join("compliance.txt"), format!("Time (s)\tCreep Compliance\n{table}")).unwrap();
    let told = vitreo(folder.path(), &["init", "compliance.txt"]).exits(0);
    assert!(told.stdout.contains("`Creep Compliance`: 2.664 to 5.000 %"), "{told}");
    let checked = vitreo(folder.path(), &["check", "compliance"]).exits(0);
    assert!(checked.stdout.contains("strain 2.66 to 5.00 %"), "{checked}");
}

/// A rheometer's first row, at time 0, shows the strain after the step. It is the gel's instantaneous answer, and the spring of it is found: 3/(0.1/Pa) = 30 Pa. The strains of
/// the record, up to 6, limit the trust.
#[test]
fn a_strain_at_time_0_is_the_gels_answer() {
    let dir = tempfile::tempdir().unwrap();
    let mut normal = normals();
    let mut table = String::from("time [s],stress [Pa],strain [%]\n");
    for row in 0..400 {
        let t = 0.05 * f64::from(row);
        let compliance_per_pa = 0.1 + 0.2 * (1.0 - (-t / 2.0).exp()) + 0.02 * t;
        let _ = writeln!(table, "{t:.2},10,{:.3}", 1000.0 * compliance_per_pa + normal());
    }
    std::fs::write(dir.path().join("creep.csv"), table).unwrap();
    let said = vitreo(dir.path(), &["init", "creep.csv", "--out", "creep"]).exits(0).stdout;
    assert!(said.contains("instantaneous answer"), "{said}");
    let fitted = ["fit", "creep", "--base", "burgers", "--prior", "generic", "--json", "-"];
    let document = vitreo(dir.path(), &fitted).exits(0).json();
    for (found, exact) in estimates(&document).iter().zip([15.0, 30.0, 150.0, 30.0]) {
        assert!((found / exact - 1.0).abs() < 0.02, "{document}");
    }
    assert_eq!(document["trust"]["level"], "effective", "{document}");
}

/// A commanded strain that is not 0 at time 0 answers to nothing, and a stretch counts from its first row: neither begins before it.
#[test]
fn commanded_strains_and_stretches_begin_in_their_first_row() {
    let dir = tempfile::tempdir().unwrap();
    let begins_before =
        |name: &str, header: &str, strain: &dyn Fn(f64) -> f64, stress: &dyn Fn(f64) -> f64, more: &[&str]| {
            let times = (0..200).map(|row| 0.1 * f64::from(row));
            let rows: String = times.map(|t| format!("{t:.1},{:.5},{:.5}\n", stress(t), strain(t))).collect();
            std::fs::write(dir.path().join(format!("{name}.csv")), format!("{header}\n{rows}")).unwrap();
            let file = format!("{name}.csv");
            vitreo(dir.path(), &[&["init", &file, "--out", name], more].concat()).exits(0);
            let toml = std::fs::read_to_string(dir.path().join(name).join("experiment.toml")).unwrap();
            toml.lines().any(|line| line.starts_with("load_start_s"))
        };
    let ramp = |t: f64| if t < 2.0 { 3.0 + 3.5 * t } else { 10.0 };
    let relaxing = |t: f64| 5.0 + 2.0 * (-t / 3.0).exp();
    let kind = ["--kind", "relaxation"];
    assert!(!begins_before("held", "time [s],stress [Pa],strain [%]", &ramp, &relaxing, &kind));
    let units = ["--force", "F", "--position", "L", "--unit-time", "s", "--unit-force", "Pa", "--unit-position", "1"];
    let stretch = |t: f64| 1.0 + 2.0 * (1.0 - (-t / 3.0).exp());
    assert!(!begins_before("stretch", "time,F,L", &stretch, &|_| 10.0, &units));
}

/// A file with two relaxations and a frequency sweep of one gel becomes one posterior by two commands.
#[test]
fn several_tests_in_one_file_are_joined() {
    let folder = tempfile::tempdir().unwrap();
    let mut normal = normals();
    let mut file = String::from("Filename\tgel.tri\nInstrument name\trheometer\n");
    for (number, strain_percent) in [(1, 1.0), (2, 5.0)] {
        let _ = write!(file, "\n[step]\nStress relaxation - {number}\nStep time\tStrain\tStress\ns\t%\tPa\n");
        for row in 0..100 {
            let t = 0.02 * 1.07_f64.powi(row);
            let stress_pa = 0.01 * strain_percent * (150.0 + 400.0 * (-t / 2.0).exp() + 0.5 * normal());
            let _ = writeln!(file, "{t:.4}\t{strain_percent}\t{stress_pa:.6}");
        }
    }
    file += "\n[step]\nFrequency sweep - 3\nAngular frequency\tStorage modulus\tLoss modulus\nrad/s\tPa\tPa\n";
    for row in 0..25 {
        let x = 2.0 * 0.05 * 1.4_f64.powi(row);
        let (storage, loss) = (150.0 + 400.0 * x * x / (1.0 + x * x), 400.0 * x / (1.0 + x * x));
        let [storage, loss] = [storage, loss].map(|modulus| modulus * (1.0 + 0.01 * normal()));
        let _ = writeln!(file, "{:.5}\t{storage:.4}\t{loss:.4}", 0.5 * x);
    }
    std::fs::write(folder.path().join("gel.txt"), file).unwrap();
    vitreo(folder.path(), &["init", "gel.txt"]).refuses(&["3 tables", "Stress relaxation - 1", "--table"]);
    vitreo(folder.path(), &["init", "gel.txt", "--table", "each", "--out", "gel"]).exits(0);
    let joint = ["sample", "gel/1", "gel/2", "gel/3", "--base", "standard-linear-solid", "--json", "-", "--quiet"];
    let joint = vitreo(folder.path(), &joint).exits(0).json();
    let kinds: Vec<&str> =
        joint["records"].as_array().unwrap().iter().map(|own| own["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["relaxation", "relaxation", "oscillation"]);
    for (own, expected) in joint["parameters"].as_array().unwrap().iter().zip([450.0, 1200.0, 2400.0]) {
        let median = own["median"].as_f64().unwrap();
        assert!((median / expected - 1.0).abs() < 0.01, "{own} {expected}");
    }
    assert!(joint["parameters"].to_string().contains("noise_sd_pa"), "{}", joint["parameters"]);
    for twice in [["sample", "gel/1", "gel/1"], ["sample", "gel/3", "gel/3"]] {
        vitreo(folder.path(), &twice).refuses(&["the same rows", "give every record once"]);
    }
}

/// Samples a record as a standard linear solid.
fn sample_as_solid(folder: &Path, name: &str) -> Run {
    let law = ["--base", "standard-linear-solid", "--prior", "generic", "--json", "-", "--no-report"];
    vitreo(folder, &[&["sample", name], &law[..]].concat())
}

/// Checks the first two parameters (Pa) of a posterior.
fn finds_moduli(posterior: &Value, expected_pa: [f64; 2]) {
    for (own, expected) in posterior["parameters"].as_array().unwrap().iter().zip(expected_pa) {
        let [low, high] = ["q05", "q95"].map(|key| own[key].as_f64().unwrap());
        // Four times the interval's half width is 6.6 standard deviations.
        assert!((0.5 * (low + high) - expected).abs() < 2.0 * (high - low), "{own} {expected}");
    }
}

/// A strain that steps between two rows, while the stress relaxes as fast, is read as a ramp: `check` says so, and no result is trusted. Rows just before and after the step tell its
/// time, although no stress was measured in them.
#[test]
fn a_step_between_rows_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let step_s = 2.1;
    let stress = |t: f64| if t < step_s { 0.0 } else { 0.02 * (100.0 + 200.0 * (-(t - step_s) / 0.8_f64).exp()) };
    let mut normal = normals();
    let mut write = |name: &str, more: &[f64]| {
        let mut times: Vec<f64> = (0..80).map(|row| 0.5 * f64::from(row)).chain(more.iter().copied()).collect();
        times.sort_by(f64::total_cmp);
        let mut table = String::from("Time [s];Shear strain [%];Shear stress [Pa]\n");
        for t in times {
            let strain = if t < step_s { 0.0 } else { 2.0 };
            let measured = format!("{:.6}", stress(t) + 0.01 * normal());
            let measured = if more.contains(&t) { "" } else { &measured };
            table += &format!("{t:.4};{strain:.4};{measured}\n");
        }
        std::fs::write(folder.path().join(format!("{name}.csv")), table).unwrap();
        let blank = ["--blank-force", "left-out"];
        vitreo(folder.path(), &[&["init", &format!("{name}.csv"), "--quiet"], &blank[..]].concat()).exits(0);
        vitreo(folder.path(), &["check", name]).exits(0).stdout.contains("strain jumps between the rows at 2")
    };
    assert!(write("coarse", &[]), "the step lies between rows at 2 and 2.5 s");
    assert!(!write("told", &[2.0999, 2.1001]), "the step has rows at its time");
    let sampled = sample_as_solid(folder.path(), "coarse");
    assert!(sampled.exits(1).stderr.contains("strain jumps between the rows"));
    finds_moduli(&sample_as_solid(folder.path(), "told").exits(0).json(), [300.0, 600.0]);
}

/// A row of no strain at time 0, and evenly spaced rows after a gap: the strain may have grown in the gap or jumped, so `check` says so and no result is trusted. Rows that are evenly
/// spaced in the logarithm of time have no gap: the strain jumped at 0, and the moduli are those of the gel.
#[test]
fn a_gap_after_a_row_of_no_strain_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut normal = normals();
    let mut write = |name: &str, times: &[f64]| {
        let mut table = String::from("Time [s];Shear strain [%];Shear stress [Pa]\n0;0;0.001\n");
        for t in times {
            let stress = 0.02 * (100.0 + 200.0 * (-t / 0.8_f64).exp());
            table += &format!("{t:.5};2.0;{:.6}\n", stress + 0.01 * normal());
        }
        std::fs::write(folder.path().join(format!("{name}.csv")), table).unwrap();
        vitreo(folder.path(), &["init", &format!("{name}.csv"), "--quiet"]).exits(0);
        vitreo(folder.path(), &["check", name])
            .exits(0)
            .stdout
            .contains("strain jumps between the rows at 0.0000 and 0.5")
    };
    let even: Vec<f64> = (0..200).map(|row| 0.5 + 0.1 * f64::from(row)).collect();
    let logarithmic: Vec<f64> = (0..81).map(|row| 0.01 * 10f64.powf(f64::from(row) / 25.0)).collect();
    assert!(write("even", &even));
    assert!(!write("logarithmic", &logarithmic));
    let sampled = sample_as_solid(folder.path(), "even");
    assert!(sampled.exits(1).stderr.contains("strain jumps between the rows"));
    finds_moduli(&sample_as_solid(folder.path(), "logarithmic").exits(0).json(), [300.0, 600.0]);
}
