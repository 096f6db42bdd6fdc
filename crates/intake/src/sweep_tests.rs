use crate::InitRequest;
use crate::run;
use documents::init::InitSummary;
use record::OscillationRecord;
use record::table::TableSettings;

/// Reads a table of an oscillation with the settings of the user. Returns the summary and the record, or the text of the refusal.
fn tried(text: &str, known_columns: TableSettings) -> Result<(InitSummary, OscillationRecord), String> {
    let folder = tempfile::tempdir().expect("a folder");
    let (file, out) = (folder.path().join("a.csv"), folder.path().join("a"));
    std::fs::write(&file, text).expect("room on the disk");
    let request = InitRequest { file, out: Some(out.clone()), known_columns, ..InitRequest::default() };
    let (summary, _) = run(&request, &mut |_| None).map_err(|error| error.to_string())?;
    let (sweep, _) = OscillationRecord::read(&out).map_err(|error| error.to_string())?;
    Ok((summary, sweep))
}

/// Text of the refusal of a table.
fn refusal(text: &str, known_columns: TableSettings) -> String {
    match tried(text, known_columns) {
        Ok((summary, _)) => panic!("{text} is read: {:?}", summary.reasons),
        Err(refused) => refused,
    }
}

/// Table of a header and of rows, each written by a function of its number from 1.
fn table(header: &str, n_rows: u32, row: impl Fn(f64) -> String) -> String {
    let rows: Vec<String> = (1..=n_rows).map(|number| row(f64::from(number))).collect();
    format!("{header}\n{}\n", rows.join("\n"))
}

/// Settings with the two columns of the moduli.
fn with_moduli(moduli: [&str; 2]) -> TableSettings {
    TableSettings { moduli: Some(moduli.map(String::from)), ..TableSettings::default() }
}

#[test]
fn a_loss_tangent_may_be_in_percent() {
    let rows = |x: f64| format!("{x},100,20");
    let plain = |header: &str| table(header, 6, rows);
    for (header, loss_pa) in [
        ("Frequency (Hz),G' (Pa),tan δ (%)", 20.0),
        ("Frequency (Hz),G' (Pa),tan δ in %", 20.0),
        ("Frequency (Hz),G' (Pa),tan δ [-]", 2000.0),
        ("Frequency (Hz),G' (Pa),Tan(delta)", 2000.0),
    ] {
        let (_, sweep) = tried(&plain(header), TableSettings::default()).expect(header);
        assert!((sweep.rows[0].pair[1] - loss_pa).abs() < 1e-9, "{header}: {:?}", sweep.rows[0]);
    }
    // A unit in a line below the names is written into the description.
    let below = plain("Frequency,G',tan δ\nHz,Pa,%");
    assert!((tried(&below, TableSettings::default()).expect("a sweep").1.rows[0].pair[1] - 20.0).abs() < 1e-9);
    for name in ["tan δ (10^-3)", "tan δ (x100)", "tan δ [arb.]"] {
        let refused = refusal(&plain(&format!("Frequency (Hz),G' (Pa),{name}")), with_moduli(["2", "3"]));
        assert!(refused.contains("the unit of this loss tangent is not known") || name.contains("x100"), "{refused}");
        assert!(refused.contains(name), "{refused}");
    }
}

/// Settings with the unit of the frequency.
fn with_frequency_in(unit: &str) -> TableSettings {
    TableSettings { sweep_units: [Some(unit.into()), None], ..TableSettings::default() }
}

#[test]
fn frequencies_may_count_cycles_per_minute() {
    let of_name = |name: &str| table(&format!("{name},G' (Pa),G'' (Pa)"), 6, |x| format!("{},100,20", 60.0 * x));
    for name in ["Frequency (1/min)", "Frequency (rpm)", "Frequency (cpm)", "Frequency 1/min"] {
        let (_, sweep) = tried(&of_name(name), TableSettings::default()).expect(name);
        assert!((sweep.rows[1].frequency_hz - 2.0).abs() < 1e-12, "{name}: {:?}", sweep.rows[1]);
    }
    let (_, sweep) = tried(&of_name("Frequency"), with_frequency_in("1/min")).expect("a unit");
    assert!((sweep.rows[1].frequency_hz - 2.0).abs() < 1e-12);
    let refused = refusal(&of_name("Frequency (1/s)"), TableSettings::default());
    assert!(refused.contains("`Frequency (1/s)` can be in Hz or in rad/s"), "{refused}");
    let (_, sweep) = tried(&of_name("Frequency (1/s)"), with_frequency_in("Hz")).expect("a unit");
    assert_eq!(sweep.rows[1].frequency_hz, 120.0);
    let refused = refusal(&of_name("Frequency (1/day)"), TableSettings::default());
    assert!(refused.contains("the unit `1/day` of the frequency"), "{refused}");
    let of_period = TableSettings { frequency: Some("1".into()), ..with_frequency_in("Hz") };
    let refused = refusal(&of_name("Period (s)"), of_period);
    assert!(refused.contains("it holds periods"), "{refused}");
}

/// Words of the summary of a table that is read.
fn words(text: &str) -> String {
    tried(text, TableSettings::default()).expect("a sweep").0.reasons.join("\n")
}

#[test]
fn frequencies_beyond_instruments_are_named() {
    let up_to = |factor: f64| table("Frequency (Hz),G' (Pa),G'' (Pa)", 6, |x| format!("{},100,20", factor * x));
    assert!(words(&up_to(1e11)).contains("of a direct measurement check their unit"));
    assert!(!words(&up_to(1.0)).contains("check their unit"));
}

/// A program may write zeros for the tests that it did not make.
#[test]
fn zeros_are_no_oscillation() {
    let header = "Time (s),Frequency (Hz),G' (Pa),G'' (Pa),Stress (Pa),Strain (%)";
    let row = |x: f64, frequency_hz: f64| {
        let modulus = if frequency_hz > 0.0 { 100.0 } else { 0.0 };
        format!("{x},{frequency_hz},{modulus},{modulus},10,{:.3}", 5.0 + x / (x + 3.0))
    };
    let sweep = table(header, 12, |x| row(x, (x - 3.0).max(0.0)));
    assert!(words(&sweep).contains("3 rows are left out, because frequency and moduli are 0"), "{}", words(&sweep));
    let folder = tempfile::tempdir().expect("a folder");
    let (file, out) = (folder.path().join("creep.csv"), folder.path().join("creep"));
    std::fs::write(&file, table(header, 30, |x| row(x, 0.0))).expect("room on the disk");
    let request = InitRequest { file, out: Some(out), ..InitRequest::default() };
    let (summary, _) = run(&request, &mut |_| None).expect("a creep");
    assert!(summary.reasons.join("\n").contains("a creep test"), "{:?}", summary.reasons);
    let refused = refusal(&table("Frequency (Hz),G' (Pa),G'' (Pa)", 9, |_| "0,0,0".into()), TableSettings::default());
    assert!(refused.contains("the frequency is 0 in every row: this is no oscillation"), "{refused}");
}

#[test]
fn a_phase_of_the_other_sign_is_read_and_named() {
    let modulus_and_phase = |phase: fn(f64) -> f64| {
        table("Frequency (Hz),|G*| (Pa),Phase angle (°)", 6, |x| format!("{x},100,{}", phase(x)))
    };
    let (summary, sweep) = tried(&modulus_and_phase(|x| -5.0 * x), TableSettings::default()).expect("a sweep");
    assert!((sweep.rows[1].pair[1] - 10.0_f64.to_radians()).abs() < 1e-12, "{:?}", sweep.rows[1]);
    assert!(summary.reasons.join("\n").contains("is read with the other sign"), "{:?}", summary.reasons);
    let loss = table("Frequency (Hz),G' (Pa),G'' (Pa)", 6, |x| format!("{x},100,{}", -x));
    assert_eq!(tried(&loss, TableSettings::default()).expect("a sweep").1.rows[1].pair, [100.0, 2.0]);
    // A few negative phases are noise, and larger ones are no convention.
    let mixed = modulus_and_phase(|x| if x > 4.0 { -1.0 } else { x });
    let (summary, sweep) = tried(&mixed, TableSettings::default()).expect("a sweep");
    assert!(sweep.rows[5].pair[1] < 0.0 && !summary.reasons.join("\n").contains("other sign"));
    let refused = refusal(&modulus_and_phase(|_| -170.0), TableSettings::default());
    assert!(refused.contains("the storage modulus is negative in every row"), "{refused}");
}

#[test]
fn relative_moduli_are_refused_by_name() {
    let of_names = |names: &str| table(&format!("Frequency (Hz),{names}"), 6, |x| format!("{x},1,0.2"));
    for names in [
        "G'/G0 (-),G''/G0 (-)",
        "G' (normalised),G'' (normalised)",
        "Reduced storage modulus,Reduced loss modulus",
        "Normalized G' (Pa),Normalized G'' (Pa)",
        "G'/G'_max,G''/G'_max",
        "G' (%),G'' (%)",
    ] {
        for given in [TableSettings::default(), with_moduli(["2", "3"])] {
            let refused = refusal(&of_names(names), given);
            assert!(refused.contains("is relative to a value"), "{names}: {refused}");
        }
        // The advice of the refusal.
        let told = TableSettings { sweep_units: [None, Some("250 Pa".into())], ..with_moduli(["2", "3"]) };
        assert_eq!(tried(&of_names(names), told).expect(names).1.rows[0].pair, [250.0, 50.0], "{names}");
    }
    for names in ["G' (Pa),G'' (Pa)", "G'/Pa,G''/Pa", "Reduced storage modulus (Pa),Reduced loss modulus (Pa)"] {
        let sweep = tried(&of_names(names), with_moduli(["2", "3"])).expect(names).1;
        assert_eq!(sweep.rows[0].pair, [1.0, 0.2], "{names}");
    }
}
