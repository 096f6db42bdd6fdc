use super::*;

/// Reads an oscillation from the text of its table and the text of `[measurement]`.
fn read(table: &str, measurement: &str) -> Result<OscillationRecord> {
    let dir = tempfile::tempdir().unwrap();
    let toml = format!(
        "[specimen]\nid = \"gel\"\n\n[measurement]\nkind = \"oscillation\"\nfile = \"sweep.csv\"\n{measurement}"
    );
    std::fs::write(dir.path().join("experiment.toml"), toml).unwrap();
    std::fs::write(dir.path().join("sweep.csv"), table).unwrap();
    assert!(OscillationRecord::is_described_in(dir.path()));
    OscillationRecord::read(dir.path()).map(|(sweep, _)| sweep)
}

const TABLE: &str = "frequency_hz,storage_pa,loss_pa\n10,4,5\n0.1,1,2\n1,2,3\n100,6,7\n";

#[test]
fn rows_ascend_whatever_the_table_does() {
    let sweep = read(TABLE, "").unwrap();
    let frequencies: Vec<f64> = sweep.rows.iter().map(|row| row.frequency_hz).collect();
    assert_eq!(frequencies, [0.1, 1.0, 10.0, 100.0]);
    assert_eq!(sweep.rows[0].pair, [1.0, 2.0]);
    assert_eq!((sweep.poisson_ratio, sweep.form, sweep.has_errors()), (0.5, SweepForm::StorageAndLoss, false));
    assert!(sweep.rows.iter().all(|row| !row.is_heldout));
}

#[test]
fn angles_kilopascals_and_decimal_commas_are_the_same_sweep() {
    let described = "delimiter = \";\"\ndecimal = \",\"\n[measurement.columns]\nfrequency = \"ω [rad/s]\"\nmodulus = \"|G*| [kPa]\"\nphase = 3\nmodulus_sd = 4\nphase_sd = 5\n\
        [measurement.units]\nphase = \"deg\"\nmodulus_sd = \"Pa\"\nphase_sd = \"deg\"\n";
    let mut table = String::from("ω [rad/s];|G*| [kPa];delta;s;d\n");
    for k in 0..5 {
        table += &format!("{};0,005;{};0,1;1\n", f64::from(k + 1) * 2.0, 30).replace('.', ",");
    }
    let sweep = read(&table, described).unwrap();
    let row = sweep.rows[0];
    assert!((row.frequency_hz - 2.0 / std::f64::consts::TAU).abs() < 1e-12);
    let [storage, loss] = sweep.form.moduli(row.pair);
    assert!((storage - 5.0 * 30f64.to_radians().cos()).abs() < 1e-12 && (loss - 2.5).abs() < 1e-12);
    let sd = row.sd.unwrap();
    assert!((sd[0] - 0.1).abs() < 1e-12 && (sd[1] - 1f64.to_radians()).abs() < 1e-12);
}

#[test]
fn every_third_frequency_is_held_out_or_those_that_are_named() {
    let rows: String = (1..=9).map(|k| format!("{k},1,1\n")).collect();
    let table = format!("frequency_hz,storage_pa,loss_pa\n{rows}");
    let heldout = |measurement: &str| -> Vec<f64> {
        let sweep = read(&table, measurement).unwrap();
        sweep.rows.iter().filter(|row| row.is_heldout).map(|row| row.frequency_hz).collect()
    };
    assert_eq!(heldout(""), [2.0, 5.0, 8.0]);
    assert_eq!(heldout("heldout_hz = [9, 3]\n"), [3.0, 9.0]);
    assert_eq!(heldout("heldout_hz = []\n"), [0.0; 0]);
}

/// Two sweeps in one table, with frequencies as an instrument measures them: repeats are held out together, and stay in the order of the table.
#[test]
fn repeats_of_a_frequency_are_held_out_together() {
    let sweep = |storage: u32, jitter: f64| -> String {
        (1..=9).map(|k| format!("{},{storage},1\n", f64::from(k) + if k % 2 == 0 { jitter } else { -jitter })).collect()
    };
    let table = format!("frequency_hz,storage_pa,loss_pa\n{}{}", sweep(100, 2e-4), sweep(103, -2e-4));
    let heldout = |measurement: &str| -> Vec<i64> {
        let sweep = read(&table, measurement).unwrap();
        let order: Vec<f64> = sweep.rows.iter().map(|row| row.pair[0]).collect();
        assert!(order.chunks(2).all(|pair| pair == [100.0, 103.0]), "{order:?}");
        sweep.rows.iter().filter(|row| row.is_heldout).map(|row| row.frequency_hz.round() as i64).collect()
    };
    assert_eq!(heldout(""), [2, 2, 5, 5, 8, 8]);
    assert_eq!(heldout("heldout_hz = [3.0002]\n"), [3, 3]);
}

/// Checks that every faulty input is refused with a message that contains the listed words.
#[test]
fn what_is_no_sweep_is_refused_with_its_place() {
    for (table, measurement, found) in [
        ("frequency_hz,storage_pa\n1,2\n", "", "line 1: there is no column for the moduli"),
        ("frequency_hz,storage_pa,loss_pa\n1,x,3\n", "", "line 2, `storage_pa`: `x` is not a number"),
        (
            "frequency_hz,storage_pa,loss_pa\n-1,2,3\n",
            "",
            "line 2, `frequency_hz`: -1 Hz is outside the range from 1e-15 to 1e15 Hz",
        ),
        (
            "frequency_hz,storage_pa,loss_pa,storage_sd_pa,loss_sd_pa\n1,2,3,0,1\n",
            "",
            "`storage_sd_pa`: the standard deviation is 0",
        ),
        ("frequency_hz,storage_pa,loss_pa\n1,2,3\n2,,3\n", "", "1 frequencies are fitted"),
        (TABLE, "heldout_hz = [3]\n", "the table has no row at 3 Hz"),
        (TABLE, "force = \"hold\"\n", "force"),
    ] {
        let error = read(table, measurement).unwrap_err().to_string();
        assert!(error.contains(found), "{error}");
    }
}

#[test]
fn a_rheometers_own_names_are_known() {
    let table = "Angular frequency\tStorage modulus\tLoss modulus\tTan(delta)\nrad/s\tPa\tPa\t\n1,0\t2,0\t3,0\t1,5\n2,0\t3,0\t4,0\t1,3\n";
    let looked = super::super::table::inspect_table("a.txt".as_ref(), table.as_bytes()).unwrap();
    let named = TableSettings::default();
    let columns = sweep_columns(&looked, &named).unwrap().unwrap();
    assert_eq!(columns, [(SweepColumn::Frequency, 0), (SweepColumn::Storage, 1), (SweepColumn::Loss, 2)]);
    let creep =
        super::super::table::inspect_table("b.csv".as_ref(), b"time_s,force_uN,position_um\n0,1,2\n1,1,3\n").unwrap();
    assert_eq!(sweep_columns(&creep, &named).unwrap(), None);
}

/// Two sweeps beside each other have equal names. Chosen moduli have the frequency beside them.
#[test]
fn chosen_moduli_have_the_nearest_frequency_to_their_left() {
    let sweep = "omega [rad/s],G' [Pa],G'' [Pa]";
    let table = format!("{sweep},{sweep}\n1,2,3,4,5,6\n2,3,4,5,6,7\n3,4,5,6,7,8\n");
    let looked = super::super::table::inspect_table("a.csv".as_ref(), table.as_bytes()).unwrap();
    let places = |moduli: [&str; 2], frequency: Option<&str>| {
        let given = TableSettings {
            moduli: Some(moduli.map(String::from)),
            frequency: frequency.map(String::from),
            ..TableSettings::default()
        };
        let columns = sweep_columns(&looked, &given).unwrap().unwrap();
        columns.into_iter().map(|(_, place)| place).collect::<Vec<_>>()
    };
    assert_eq!(places(["5", "6"], None), [3, 4, 5]);
    assert_eq!(places(["2", "3"], None), [0, 1, 2]);
    assert_eq!(places(["5", "6"], Some("1")), [0, 4, 5]);
}

/// Checks one sweep in four spellings: G′ and G″, G′ and tan δ, |G*| and tan δ, and Young's moduli, which are 2 + 2ν times as large.
#[test]
fn tangents_and_youngs_moduli_are_the_same_sweep() {
    let columns = |first: &str, second: &str| {
        format!(
            "[measurement.columns]\nfrequency = \"frequency_hz\"\n{first} = 2\n{second} = 3\n[measurement.units]\n{first} = \"kPa\"\n"
        )
    };
    let moduli = |row: f64| [row + 1.0, 0.5 * row];
    let table = |values: &dyn Fn([f64; 2]) -> [f64; 2]| {
        let row = |k: i32| {
            let [a, b] = values(moduli(f64::from(k)));
            format!("{k},{a:?},{b:?}\n")
        };
        format!("frequency_hz,a,b\n{}", (1..=5).map(row).collect::<String>())
    };
    let young = format!("moduli = \"young\"\n{}loss = \"kPa\"\n", columns("storage", "loss"));
    for (values, measurement) in [
        (&(|[g, h]: [f64; 2]| [g, h / g]) as &dyn Fn([f64; 2]) -> [f64; 2], columns("storage", "loss_tangent")),
        (&|[g, h]| [g.hypot(h), h / g], columns("modulus", "loss_tangent")),
        (&|moduli| moduli.map(|modulus| 3.0 * modulus), young),
    ] {
        let sweep = read(&table(values), &measurement).unwrap();
        for row in &sweep.rows {
            let expected = moduli(row.frequency_hz).map(|kpa| 1e3 * kpa);
            let found = sweep.form.moduli(row.pair);
            assert!(found.iter().zip(expected).all(|(x, y)| (x / y - 1.0).abs() < 1e-12), "{measurement}: {row:?}");
        }
    }
    let with_errors = columns("storage", "loss_tangent")
        .replace("[measurement.units]", "storage_sd = 3\n[measurement.units]\nstorage_sd = \"Pa\"");
    assert!(read(&table(&|moduli| moduli), &with_errors).unwrap_err().to_string().contains("not of a loss tangent"));
}

#[test]
fn names_of_tension_and_of_tangents_are_known() {
    for (header, expected) in [
        ("Frequency (mHz),E' (MPa),E'' (MPa),tan(delta)", [SweepColumn::Storage, SweepColumn::Loss]),
        ("Frequency (Hz),Storage modulus E' (MPa),Loss modulus E'' (MPa)", [SweepColumn::Storage, SweepColumn::Loss]),
        ("Frequency (Hz),Tensile Storage Modulus (kPa),Tan(delta)", [SweepColumn::Storage, SweepColumn::LossTangent]),
        ("omega (rad/s),|G*| (Pa),tan δ", [SweepColumn::Modulus, SweepColumn::LossTangent]),
        ("omega (rad·s⁻¹),|G*| (Pa),tan δ", [SweepColumn::Modulus, SweepColumn::LossTangent]),
    ] {
        let text = format!("{header}\n{0}\n{0}\n{0}\n", vec!["1"; header.split(',').count()].join(","));
        let looked = super::super::table::inspect_table("a.csv".as_ref(), text.as_bytes()).unwrap();
        let columns = sweep_columns(&looked, &TableSettings::default()).unwrap().unwrap();
        let found: Vec<SweepColumn> = columns.into_iter().map(|(column, _)| column).collect();
        assert_eq!(found[1..], expected, "{header}");
    }
}

/// Columns of errors have the names of their keys. One alone is not read.
#[test]
fn errors_are_known_by_the_names_of_their_keys() {
    for (header, n_columns) in [
        ("frequency_hz,storage_pa,loss_pa,storage_sd_pa,loss_sd_pa", 5),
        ("frequency_hz,modulus_pa,phase_deg,modulus_sd_pa,phase_sd_deg", 5),
        ("frequency_hz,storage_pa,loss_pa,storage_sd_pa,n", 3),
    ] {
        let text = format!("{header}\n{0}\n{0}\n{0}\n", "1,1,1,1,1");
        let looked = super::super::table::inspect_table("a.csv".as_ref(), text.as_bytes()).unwrap();
        let columns = sweep_columns(&looked, &TableSettings::default()).unwrap().unwrap();
        assert_eq!(columns.len(), n_columns, "{header}");
    }
}

/// Shifted frequencies of a master curve are read. Numbers that no shift reaches are refused.
#[test]
fn master_curves_reach_beyond_instruments() {
    let table = |frequencies_hz: [f64; 5]| {
        let rows: String = frequencies_hz.iter().map(|f| format!("{f:e},100,20\n")).collect();
        read(&format!("frequency_hz,storage_pa,loss_pa\n{rows}"), "")
    };
    let master = table([1e-12, 1e-6, 1.0, 1e6, 1e12]).unwrap();
    assert_eq!((master.range_hz(), master.is_beyond_instruments()), ([1e-12, 1e12], true));
    assert!(!table([1e-3, 1e-2, 1.0, 1e2, 1e3]).unwrap().is_beyond_instruments());
    for outside_hz in [-1.0, 1e-16, 1e16] {
        let error = table([outside_hz, 1e-2, 1.0, 1e2, 1e3]).unwrap_err().to_string();
        assert!(error.contains("is outside the range"), "{error}");
    }
}

/// Programs write zeros into the rows of other tests. They are no measurements, unless only the frequency is 0.
#[test]
fn rows_of_zeros_are_left_out() {
    let header = "frequency_hz,storage_pa,loss_pa\n";
    let sweep = read(&format!("{header}0,0,0\n0,0,0\n{}", &TABLE[header.len()..]), "").unwrap();
    assert_eq!((sweep.rows.len(), sweep.n_zero, sweep.n_incomplete), (4, 2, 0));
    for (rows, found) in [
        ("0,0,0\n0,0,0\n0,0,0\n", "`frequency_hz`: the frequency is 0 in every row: this is no oscillation"),
        ("0,1,2\n0,1,2\n0,0,0\n", "`frequency_hz`: the frequency is 0 in every row: this is no oscillation"),
        ("1,1,2\n0,1,2\n2,1,2\n", "line 3, `frequency_hz`: the frequency is 0, and the moduli are not"),
    ] {
        let error = read(&format!("{header}{rows}"), "").unwrap_err().to_string();
        assert!(error.contains(found), "{error}");
    }
}

/// A table may count the phase from the strain to the stress. Its description says so; a few negative rows are noise or inertia.
#[test]
fn a_phase_may_have_the_other_sign() {
    let rows = |signs: [f64; 2]| -> String {
        (1..=5).map(|k| format!("{k},{},{}\n", signs[0] * 100.0, signs[1] * f64::from(k))).collect()
    };
    let moduli = |signs: [f64; 2]| format!("frequency_hz,storage_pa,loss_pa\n{}", rows(signs));
    let polar = format!("frequency_hz,modulus_pa,phase_deg\n{}", rows([1.0, -10.0]));
    let opposite = "phase_sign = \"-\"\n";
    for table in [moduli([1.0, -1.0]), polar] {
        let sweep = read(&table, opposite).unwrap();
        assert!(sweep.rows.iter().all(|row| row.pair[1] > 0.0), "{:?}", sweep.rows);
        let error = read(&table, "").unwrap_err().to_string();
        assert!(error.contains("is negative in every row") && error.contains("phase_sign"), "{error}");
    }
    assert_eq!(read(&moduli([1.0, 1.0]), "phase_sign = \"+\"\n").unwrap().rows[1].pair, [100.0, 2.0]);
    let error = read(&moduli([1.0, 1.0]), opposite).unwrap_err().to_string();
    assert!(error.contains("remove the key"), "{error}");
    let error = read(&moduli([-1.0, 1.0]), "").unwrap_err().to_string();
    assert!(error.contains("the storage modulus is negative in every row"), "{error}");
    let some = moduli([1.0, 1.0]).replace("3,100,3", "3,100,-3");
    assert_eq!(read(&some, "").unwrap().rows[2].pair, [100.0, -3.0]);
}

/// Sweeps of a Maxwell body one after the other, on different frequencies. Those of one state are one record; those of two states are not.
#[test]
fn sweeps_on_different_frequencies_are_compared() {
    let sweep = |factor: f64, first_hz: f64, is_descending: bool| -> String {
        let row = |k: i32| {
            let x = first_hz * 1.5_f64.powi(if is_descending { 14 - k } else { k });
            // Noise of 2 %.
            let scale = factor * (1.0 + 0.01 * f64::from((k * 7) % 5 - 2));
            format!("{x},{},{}\n", scale * 100.0 * x * x / (1.0 + x * x), scale * 100.0 * x / (1.0 + x * x))
        };
        (0..15).map(row).collect()
    };
    let tried =
        |second: String| read(&format!("frequency_hz,storage_pa,loss_pa\n{}{second}", sweep(1.0, 0.1, false)), "");
    for (factor, is_descending) in [(1.4, false), (0.8, true), (0.1, false)] {
        let error = tried(sweep(factor, 0.117, is_descending)).unwrap_err().to_string();
        assert!(error.contains("these are several sweeps"), "{factor}: {error}");
    }
    // Rows of one frequency that drifts are no runs through a range.
    let drift = |first_hz: f64, storage: u32| -> String {
        (0..10).map(|k| format!("{},{storage},1\n", first_hz + 1.2e-3 * f64::from(k))).collect()
    };
    let drifts = format!("frequency_hz,storage_pa,loss_pa\n{}{}", drift(1.0, 100), drift(1.0006, 200));
    let error = read(&drifts, "").unwrap_err().to_string();
    assert!(error.contains("rows have the frequency"), "{error}");
    for (second, n_rows) in [
        (sweep(1.0, 0.117, false), 30),
        (sweep(1.03, 0.117, true), 30),
        // A second sweep of other frequencies has nothing in common with the first.
        (sweep(1.4, 100.0, false), 30),
        (String::new(), 15),
    ] {
        assert_eq!(tried(second).unwrap().rows.len(), n_rows);
    }
}
