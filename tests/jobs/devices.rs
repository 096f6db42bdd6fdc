//! Device that `init` describes: a bead in a gel, a tip that is pressed into it, or a specimen between grips or plates, as options, lines above the table and names of
//! columns say.

use vitreo_uq::documents::init::InitSummary;
use vitreo_uq::intake::{InitRequest, run};
use vitreo_uq::record::table::TableSettings;
use vitreo_uq::record::{Apparatus, Experiment};

/// Applies `init` to a creep of 400 rows with a force in N and a position in mm. Returns the summary and the description.
fn described(
    above: &str,
    names: [&str; 2],
    sizes: InitRequest,
) -> Result<(InitSummary, String, Result<Experiment, String>), String> {
    let folder = tempfile::tempdir().expect("a folder");
    let (file, out) = (folder.path().join("creep.csv"), folder.path().join("creep"));
    let rows: String = (0..400)
        .map(|row| {
            let t = 0.1 * f64::from(row);
            let (force, position) = if t < 1.0 { (0.0, 0.0) } else { (6.0, 2.0 * (1.0 - (-(t - 1.0) / 9.0).exp())) };
            format!("{t:.1},{force},{position:.6}\n")
        })
        .collect();
    std::fs::write(&file, format!("{above}Time (s),{} (N),{} (mm)\n{rows}", names[0], names[1])).expect("room");
    let request = InitRequest { file, out: Some(out.clone()), ..sizes };
    let (summary, _) = run(&request, &mut |_| None).map_err(|error| error.to_string())?;
    let toml = std::fs::read_to_string(out.join("experiment.toml")).expect("a description");
    let read = Experiment::read(&out).map(|(experiment, _)| experiment).map_err(|error| error.to_string());
    Ok((summary, toml, read))
}

fn specimen(length_mm: f64, area_mm2: f64) -> InitRequest {
    InitRequest { specimen: [Some(length_mm), Some(area_mm2)], ..InitRequest::default() }
}

/// 6 N on 12 mm² is 0.5 MPa, and 2 mm of 40 mm is a strain of 5 %, whether the sizes are options or lines above the table.
#[test]
fn sizes_of_a_specimen_make_stress_and_strain() {
    let lines = "Gauge length: 40 mm\nWidth,6,mm\nThickness,2,mm\n\n";
    for (above, names, request) in [
        ("", ["Force", "Position"], specimen(40.0, 12.0)),
        ("", ["Load", "Extension"], specimen(40.0, 12.0)),
        (lines, ["Load", "Extension"], InitRequest::default()),
        ("Specimen length: 4 cm\nArea: 0.12 cm^2\n\n", ["Force", "Position"], InitRequest::default()),
    ] {
        let (summary, toml, experiment) = described(above, names, request).expect("a description");
        assert!(summary.is_complete() && toml.contains("measures = \"stress and strain\""), "{toml}");
        let reasons = summary.reasons.join("\n");
        assert!(reasons.contains("40 mm long") && reasons.contains("12 mm²"), "{reasons}");
        let experiment = experiment.expect("a record");
        assert!(matches!(experiment.apparatus, Apparatus::Instrument { is_stress_strain: true, .. }));
        let record = &experiment.record;
        // A stress of 1 Pa is kept as 1 µN, and a strain of 1 % as 1 µm.
        let (last, force) = (record.position_m[399].unwrap(), record.force_n[399]);
        let strain = 0.05 * (1.0 - (-(39.9 - 1.0) / 9.0_f64).exp());
        assert!((1e4 * last - strain).abs() < 1e-6 * strain, "{last}");
        assert!((1e6 * force - 5e5).abs() < 1e-3, "{force}");
        let columns: Vec<&str> = summary.columns.iter().map(|column| column.role.as_str()).collect();
        assert_eq!(columns, ["time", "stress", "strain"]);
    }
}

/// A machine's force beside the specimen's strain, by its name or by the unit that the user gives.
#[test]
fn a_strain_beside_the_force_of_a_specimen_is_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let percent = TableSettings { units: [None, None, Some("%".into())], ..TableSettings::default() };
    let named = TableSettings { columns: [None, None, Some("3".into()), None], ..percent.clone() };
    for (number, (names, known_columns, of_one)) in [
        ("Compressive load (N),Compressive strain (%)", TableSettings::default(), 100.0),
        ("Standardkraft (N),Stauchung [%]", TableSettings::default(), 100.0),
        ("Load (N),Strain (mm/mm)", TableSettings::default(), 1.0),
        ("Load (N),Strain", percent, 100.0),
        ("Load (N),e", named, 100.0),
    ]
    .into_iter()
    .enumerate()
    {
        let rows: String = (0..400)
            .map(|row| {
                let t = 0.1 * f64::from(row);
                let strain = if t < 1.0 { 0.0 } else { of_one * 0.05 * (1.0 - (-(t - 1.0) / 9.0).exp()) };
                format!("{t:.1},{},{strain:.7}\n", if t < 1.0 { 0.0 } else { 6.0 })
            })
            .collect();
        let (file, out) = (folder.path().join("s.csv"), folder.path().join(number.to_string()));
        std::fs::write(&file, format!("Time (s),{names}\n{rows}")).expect("room");
        let request = InitRequest { file, out: Some(out.clone()), known_columns, ..specimen(40.0, 12.0) };
        run(&request, &mut |_| None).unwrap_or_else(|error| panic!("{names}: {error}"));
        let (experiment, _) = Experiment::read(&out).expect("a record");
        let (last, force) = (experiment.record.position_m[399].unwrap(), experiment.record.force_n[399]);
        let strain = 0.05 * (1.0 - (-(39.9 - 1.0) / 9.0_f64).exp());
        assert!((1e4 * last - strain).abs() < 1e-5 * strain, "{names}: {last}");
        assert!((1e6 * force - 5e5).abs() < 1e-3, "{names}: {force}");
    }
}

/// A machine's position begins at any value: 2 % of 20 mm, from 20 mm, from −35 mm, and after a rest.
#[test]
fn an_absolute_position_of_a_machine_counts_from_its_start() {
    let folder = tempfile::tempdir().expect("a folder");
    for (number, (start_mm, rest_s)) in [(20.0, 0.0), (-35.0, 0.0), (20.0, 2.0)].into_iter().enumerate() {
        let rows: String = (0..400)
            .map(|row| {
                let t = 0.05 * f64::from(row);
                let part = (t - rest_s).clamp(0.0, 1.0);
                let force = 0.2 * part * (0.5 + 0.5 * (-(t - rest_s - 1.0).max(0.0) / 5.0).exp());
                format!("{t:.2},{force:.5},{:.4}\n", start_mm + 0.4 * part)
            })
            .collect();
        let (file, out) = (folder.path().join("pull.csv"), folder.path().join(number.to_string()));
        std::fs::write(&file, format!("Time (s),Force (N),Displacement (mm)\n{rows}")).expect("room");
        let request = InitRequest { file, out: Some(out.clone()), ..specimen(20.0, 100.0) };
        let (summary, _) = run(&request, &mut |_| None).expect("a description");
        let (experiment, _) = Experiment::read(&out).expect("a record");
        let strain = &experiment.record.force_n;
        let largest = strain.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        assert!(strain[0].abs() < 1e-12 && (largest - 2e-6).abs() < 1e-11, "{largest} {:?}", summary.reasons);
        assert!(!experiment.fits_position_offset, "a commanded position has no noise");
    }
}

/// The position of a tip is its depth already; that of the head that carries its spring is not, and needs the spring's stiffness.
#[test]
fn a_spring_is_subtracted_from_the_position_of_its_head_only() {
    let tip = || InitRequest { tip: [Some(5.0), None], ..InitRequest::default() };
    let spring = "# springConstant: 0.0122\n";
    for (above, name, line, unknown) in [
        (spring, "verticalTipPosition", Some("# cantilever_n_per_m = 0.0122"), 0),
        (spring, "Tip-Sample Separation", Some("# cantilever_n_per_m = 0.0122"), 0),
        (spring, "height", Some("cantilever_n_per_m = 0.0122"), 0),
        ("", "height", Some("cantilever_n_per_m = \"?\""), 1),
        ("", "Indentation", None, 0),
    ] {
        let mut request = tip();
        request.known_columns =
            TableSettings { columns: [None, None, Some(format!("{name} (mm)")), None], ..TableSettings::default() };
        let (summary, toml, _) = described(above, ["Force", name], request).expect("a description");
        let found = toml.lines().find(|line| line.contains("cantilever_n_per_m"));
        assert_eq!(found.is_some(), line.is_some(), "{toml}");
        assert!(found.zip(line).is_none_or(|(found, line)| found.starts_with(line)), "{toml}");
        assert_eq!(summary.unknown.len(), unknown, "{:?}", summary.unknown);
    }
}

/// A machine that presses counts its position down while the force grows.
#[test]
fn a_compression_keeps_its_sign() {
    let folder = tempfile::tempdir().expect("a folder");
    let rows: String = (0..400)
        .map(|row| {
            let t = 0.1 * f64::from(row);
            let position = -(0.05 * t).min(0.5);
            let force = if t < 10.0 { 0.9 * t - 0.02 * t * t } else { 4.0 + 3.0 * ((10.0 - t) / 6.0).exp() };
            format!("{t:.1},{force:.4},{position:.4}\n")
        })
        .collect();
    let (file, out) = (folder.path().join("press.csv"), folder.path().join("press"));
    std::fs::write(&file, format!("Time (s),Load (N),Extension (mm)\n{rows}")).expect("room");
    let request = InitRequest { file, out: Some(out.clone()), ..specimen(10.0, 50.0) };
    run(&request, &mut |_| None).expect("a description");
    let (experiment, _) = Experiment::read(&out).expect("a record");
    let record = &experiment.record;
    assert!(record.force_n[200] > 0.0 && record.position_m[200].unwrap() > 0.0);
    // A strain of 5 % is kept as 5 µm.
    assert!((1e6 * record.force_n[200] - 5.0).abs() < 1e-3, "{}", record.force_n[200]);
}

#[test]
fn a_tip_is_taken_from_options_lines_and_names() {
    let given = || InitRequest { tip: [Some(27.5), Some(1.9e9)], ..InitRequest::default() };
    let lines = "k (N/m)\t1.9e9\nTip radius (um)\t27.500\n";
    for (above, names, request) in [
        ("", ["Force", "Position"], given()),
        (lines, ["Load", "Z"], InitRequest::default()),
        ("# tipRadius: 27.5 um\n# springConstant: 1.9e9\n", ["Force", "Position"], InitRequest::default()),
    ] {
        let (summary, toml, experiment) = described(above, names, request).expect("a description");
        assert!(summary.is_complete(), "{summary:?}");
        assert!(
            toml.contains("tip_radius_um = 27.5 ") && toml.contains("\ncantilever_n_per_m = 1900000000.0 "),
            "{toml}"
        );
        let experiment = experiment.expect("a record");
        let Apparatus::Indenter(indenter) = experiment.apparatus else { panic!("{toml}") };
        assert!((indenter.size.unwrap() - 27.5e-6).abs() < 1e-15 && indenter.cantilever_n_per_m == Some(1.9e9));
    }
    // Without its unit, a radius is not read; a size of a bead says that no tip was pressed into the gel.
    let (summary, ..) = described("tip radius: 5\n", ["Force", "Position"], InitRequest::default()).unwrap();
    assert_eq!(summary.unknown.len(), 3);
    let bead = InitRequest { sizes: [Some(0.5), Some(20.0), Some(0.48)], ..InitRequest::default() };
    let (_, toml, _) = described(lines, ["Force", "Indentation"], bead).unwrap();
    assert!(toml.contains("[robot]"), "{toml}");
}

/// Names of columns decide the device, but its sizes stay open.
#[test]
fn names_of_columns_tell_the_device() {
    for (names, section, open, option) in [
        (["Load", "Indentation"], "[indenter]", "indenter.tip_radius_um", "robot_diameter_mm"),
        (["Load", "Crosshead"], "[instrument]", "instrument.compliance_per_m", "specimen_length_mm"),
        (["Force", "Position"], "[robot]", "robot.diameter_mm", "tip_radius_um"),
    ] {
        let (summary, toml, read) = described("", names, InitRequest::default()).expect("a description");
        assert!(toml.contains(section) && summary.unknown[0] == open, "{toml} {:?}", summary.unknown);
        let reasons = summary.reasons.join("\n");
        assert!(reasons.contains(option), "{reasons}");
        assert!(read.unwrap_err().contains("not filled in yet"));
    }
}

/// Each table of a file has the sizes that stand above it.
#[test]
fn every_table_has_its_own_sizes() {
    let table = |length_mm: f64| -> String {
        let rows: String = (0..60).map(|row| format!("{row},6,{:.4}\n", 0.1 + 0.01 * f64::from(row))).collect();
        format!("Gauge length: {length_mm} mm\nArea: 12 mm^2\nTime (s),Load (N),Extension (mm)\n{rows}\n")
    };
    let folder = tempfile::tempdir().expect("a folder");
    let (file, out) = (folder.path().join("both.csv"), folder.path().join("both"));
    std::fs::write(&file, table(20.0) + &table(40.0)).expect("room");
    let known_columns = TableSettings { tables: Some("each".into()), ..TableSettings::default() };
    run(&InitRequest { file, out: Some(out.clone()), known_columns, ..InitRequest::default() }, &mut |_| None)
        .expect("two descriptions");
    let unit_of = |number: &str| {
        let toml = std::fs::read_to_string(out.join(number).join("experiment.toml")).expect("a description");
        toml.lines().rev().find(|line| line.starts_with("position")).expect("a unit").to_string()
    };
    assert!(unit_of("1").contains("0.05 m") && unit_of("2").contains("0.025 m"), "{} {}", unit_of("1"), unit_of("2"));
}

#[test]
fn impossible_sizes_are_refused() {
    for request in [specimen(0.0, 12.0), specimen(40.0, -1.0), specimen(f64::INFINITY, 1.0)] {
        let refused = described("", ["Force", "Position"], request).map(|(summary, ..)| summary).unwrap_err();
        assert!(refused.contains("is not above 0"), "{refused}");
    }
}
