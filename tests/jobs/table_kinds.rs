//! Tables that a reader can misread. Each kind, in several variants written by hand, is read as the true record or refused with its cause.

use std::fmt::Write as _;

use vitreo_uq::documents::init::InitSummary;
use vitreo_uq::intake::{InitRequest, run};
use vitreo_uq::posterior::check::contradictions;
use vitreo_uq::record::table::TableSettings;
use vitreo_uq::record::{Apparatus, Control, Experiment, ExperimentFiles, OscillationRecord};

const INTERVAL_S: f64 = 0.05;
const N_ROWS: usize = 600;
const N_CYCLE: usize = 200;

/// Time (s), force (µN), position (µm): three cycles of a pull and a rest, of a Lethersich body in closed form with uniform noise of ±1 µm.
fn truth() -> Vec<[f64; 3]> {
    let creep = |t: f64| 700.0 * (1.0 - (-t / 0.4).exp()) + 50.0 * t;
    (0..N_ROWS)
        .map(|row| {
            let t = INTERVAL_S * row as f64;
            let switches = (0..6).map(|k| (5.0 * f64::from(k), if k % 2 == 0 { 1.0 } else { -1.0 }));
            let x: f64 = switches.filter(|(at, _)| t > *at).map(|(at, sign)| sign * creep(t - at)).sum();
            let force = if row / 100 % 2 == 0 { 4.6 } else { 0.0 };
            [t, force, x + noise(row)]
        })
        .collect()
}

/// A number between −1 and 1, by the mixing function of SplitMix64.
fn noise(row: usize) -> f64 {
    let mut mixed = (row as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((mixed ^ (mixed >> 31)) >> 11) as f64 / 2.0_f64.powi(52) - 1.0
}

fn rows(line: impl Fn(usize, [f64; 3]) -> String) -> String {
    truth().into_iter().enumerate().map(|(row, values)| line(row, values) + "\n").collect()
}

fn plain() -> String {
    format!("Time (s),Force (uN),Position (um)\n{}", rows(|_, [t, f, x]| format!("{t:.3},{f},{x:.3}")))
}

type Read = (InitSummary, Experiment, ExperimentFiles);

/// Applies `init` to a table without the sizes of a bead, and reads the experiment.
fn read_without_sizes(text: &str) -> Read {
    let folder = tempfile::tempdir().expect("a folder");
    let (file, out) = (folder.path().join("a.csv"), folder.path().join("a"));
    std::fs::write(&file, text).expect("room on the disk");
    let (summary, _) =
        run(&InitRequest { file, out: Some(out.clone()), ..InitRequest::default() }, &mut |_| None).expect("a table");
    let (experiment, files) = Experiment::read(&out).expect("an experiment");
    (summary, experiment, files)
}

/// Applies `init` to a table, edits its description, and reads the experiment.
fn edited(text: &str, given: TableSettings, edit: impl Fn(&str) -> String) -> Result<Read, String> {
    let folder = tempfile::tempdir().expect("a folder");
    let (file, out) = (folder.path().join("a.csv"), folder.path().join("a"));
    std::fs::write(&file, text).expect("room on the disk");
    let sizes = [Some(0.55), Some(20.0), Some(0.48)];
    let request = InitRequest { file, out: Some(out.clone()), known_columns: given, sizes, ..InitRequest::default() };
    let (summary, _) = run(&request, &mut |_| None).map_err(|error| error.to_string())?;
    let toml = out.join("experiment.toml");
    let description = std::fs::read_to_string(&toml).expect("a description");
    std::fs::write(&toml, edit(&description)).expect("room on the disk");
    let (experiment, files) = Experiment::read(&out).map_err(|error| error.to_string())?;
    Ok((summary, experiment, files))
}

fn read(text: &str, given: TableSettings) -> Result<Read, String> {
    edited(text, given, str::to_string)
}

fn refused(text: &str, given: TableSettings) -> String {
    read(text, given).expect_err("a refusal")
}

/// Largest differences in time (s), force (µN) and position (µm) from the truth, positions up to their zero.
fn distances(experiment: &Experiment) -> [f64; 3] {
    let record = &experiment.record;
    assert_eq!(record.n_rows(), N_ROWS);
    let mut largest = [0.0_f64; 3];
    let shift = record.position_m[0].map_or(0.0, |x| 1e6 * x) - truth()[0][2];
    for (row, [t, f, x]) in truth().into_iter().enumerate() {
        let position = record.position_m[row].map_or(x, |position_m| 1e6 * position_m - shift);
        let apart = [record.time_s[row] - t, 1e6 * record.force_n[row] - f, position - x];
        (0..3).for_each(|k| largest[k] = largest[k].max(apart[k].abs()));
    }
    largest
}

#[track_caller]
fn assert_is_truth(text: &str, given: TableSettings) -> InitSummary {
    let (summary, experiment, _) = read(text, given).expect("an experiment");
    let apart = distances(&experiment);
    assert!(apart[0] < 1e-6 && apart[1] < 1e-6 && apart[2] < 2e-3, "{apart:?} {summary:?}");
    summary
}

fn kinds(experiment: &Experiment, files: &ExperimentFiles) -> Vec<String> {
    contradictions(experiment, &files.interpretation).into_iter().map(|found| found.kind).collect()
}

fn said(word: &str) -> Option<String> {
    Some(word.into())
}

#[test]
fn a_sound_record_has_no_contradiction() {
    let (_, experiment, files) = read(&plain(), TableSettings::default()).expect("an experiment");
    assert_eq!(kinds(&experiment, &files), [""; 0]);
}

#[test]
fn several_tables_of_one_recording_are_joined() {
    let header = "Time (s)\tForce (uN)\tPosition (um)";
    let table = |from: usize, to: usize, zero_s: f64| -> String {
        truth()[from..to].iter().fold(String::new(), |mut text, [t, f, x]| {
            let _ = writeln!(text, "{:.3}\t{f}\t{x:.3}", t - zero_s);
            text
        })
    };
    // One clock, a clock for each step, and titles above.
    let one_clock = format!("{header}\n{}\n{header}\n{}", table(0, 200, 0.0), table(200, 600, 0.0));
    let own_clocks = format!("{header}\n{}\n\n{header}\n{}", table(0, 200, 0.0), table(200, 600, 10.0));
    let step = |title: &str, rows: String| format!("[step]\n{title}\nTime\tForce\tPosition\ns\tuN\tum\n{rows}\n");
    let steps = step("Pull - 1", table(0, 200, 0.0))
        + &step("Pull - 2", table(200, 400, 0.0))
        + &step("Pull - 3", table(400, 600, 0.0));
    for text in [one_clock.clone(), own_clocks, steps] {
        let summary = assert_is_truth(&text, TableSettings::default());
        assert!(summary.reasons.iter().any(|reason| reason.contains("joined in time")), "{summary:?}");
    }
    // The later switches show that the load of the second table begins with its first row.
    let (summary, experiment, _) =
        read(&one_clock, TableSettings { tables: said("2"), ..TableSettings::default() }).expect("one");
    assert_eq!(experiment.record.n_rows(), 400);
    assert!(summary.reasons.iter().any(|reason| reason.contains("lines 2 to 201") && reason.ends_with("not read")));
}

#[test]
fn tables_that_are_no_one_recording_are_listed_and_chosen() {
    let fresh = |from: usize, to: usize, shift_um: f64| -> String {
        truth()[from..to]
            .iter()
            .map(|[t, f, x]| format!("{:.3},{f},{:.3}\n", t - 0.05 * from as f64, x + shift_um))
            .collect()
    };
    let header = "Time (s),Force (uN),Position (um)\n";
    let two_beads = format!("{header}{}\n{header}{}", fresh(0, 300, 0.0), fresh(0, 300, 5000.0));
    let other_columns = format!("{}\nTime (s),Force (uN),Temperature (C)\n0,1,20\n1,1,20\n2,1,21\n", plain());
    for text in [two_beads, other_columns.clone()] {
        let text = refused(&text, TableSettings::default());
        assert!(text.contains("table 1: lines 2 to") && text.contains("table 2: lines"), "{text}");
    }
    assert_is_truth(&other_columns, TableSettings { tables: said("1"), ..TableSettings::default() });
}

#[test]
fn a_motion_in_space_is_projected_and_an_unread_coordinate_is_named() {
    let along = |line: [f64; 3]| {
        rows(move |_, [t, f, x]| {
            let at = |k: usize| 100.0 * (k + 1) as f64 + x * line[k];
            format!("{t:.3},{f},{:.6},{:.6},{:.6}", at(0), at(1), at(2))
        })
    };
    let third = 3.0_f64.sqrt().recip();
    for line in [[third; 3], [2.0 / 3.0, -1.0 / 3.0, 2.0 / 3.0], [0.6, 0.8, 0.0]] {
        let text = format!("time_s,force_uN,x_um,y_um,z_um\n{}", along(line));
        let summary = assert_is_truth(&text, TableSettings::default());
        assert_eq!(summary.columns.iter().any(|column| column.role == "position_z"), line[2] != 0.0);
        let axes = [said("x_um"), said("y_um"), None];
        let (_, experiment, files) =
            read(&text, TableSettings { axes, ..TableSettings::default() }).expect("an experiment");
        let is_named = kinds(&experiment, &files).contains(&"unread_column_follows".to_string());
        assert_eq!(is_named, line[2] != 0.0, "{line:?}");
    }
}

#[test]
fn times_that_begin_again_are_joined_where_the_recording_went_on() {
    let cycles = |first_row_s: f64, with_cycle: bool| {
        let line = move |row: usize, [_, f, x]: [f64; 3]| {
            let t = INTERVAL_S * (row % N_CYCLE) as f64 + first_row_s;
            let cycle = if with_cycle { format!(",{}", row / N_CYCLE + 1) } else { String::new() };
            format!("{t:.3},{f},{x:.3}{cycle}")
        };
        let cycle = if with_cycle { ",cycle" } else { "" };
        format!("time_s,force_uN,position_um{cycle}\n{}", rows(line))
    };
    assert_is_truth(&cycles(0.0, true), TableSettings::default());
    let text = refused(&cycles(0.0, false), TableSettings::default());
    assert!(text.contains("time restarts") && text.contains("time_restarts = \"join\""), "{text}");
    assert_is_truth(&cycles(0.0, false), TableSettings { time_restarts: said("join"), ..TableSettings::default() });
    let unsorted = plain().replace("\n0.400,4.6,", "\n0.350,4.6,");
    assert!(refused(&unsorted, TableSettings::default()).contains("two rows have the time"));
}

/// A recording that begins after the load has moved the body: the force is taken to act since time 0, and `init` says so. A clock that counts from another time, with
/// positions from the first row, has no such start.
#[test]
fn a_late_first_row_states_the_start_of_the_load() {
    let late = |zero_um: f64| {
        let part = truth().into_iter().filter(|row| row[0] >= 0.3);
        let lines: String = part.map(|[t, f, x]| format!("{t:.3},{f},{:.3}\n", x - zero_um)).collect();
        read(&format!("Time (s),Force (uN),Position (um)\n{lines}"), TableSettings::default()).expect("an experiment")
    };
    let states_start = |summary: &InitSummary| summary.reasons.iter().any(|text| text.contains("load_start_s = 0"));
    let (summary, experiment, _) = late(0.0);
    assert!(states_start(&summary), "{summary:?}");
    assert_eq!((experiment.record.time_s[0], experiment.record.position_m[0]), (0.0, None));
    assert!(!states_start(&late(truth()[6][2]).0));
}

/// Positions from which the first noisy row was subtracted: the zero is fitted, and `check` names a table in which it is not.
#[test]
fn a_zero_that_carries_the_noise_of_a_row_is_fitted() {
    let first_um = truth()[0][2];
    let text = format!(
        "Time (s),Force (uN),Position (um)\n{}",
        rows(|_, [t, f, x]| format!("{t:.3},{f},{:.3}", x - first_um))
    );
    let (summary, experiment, _) = read(&text, TableSettings::default()).expect("an experiment");
    assert!(experiment.fits_position_offset, "{summary:?}");
    let as_written = |toml: &str| toml.replace("zero = \"fit\"", "");
    let (_, experiment, files) = edited(&text, TableSettings::default(), as_written).expect("an experiment");
    assert_eq!(kinds(&experiment, &files), ["zero_is_a_row"]);
    // Positions that are cut to tens of micrometres: the zero is known to such a step only.
    let coarse = rows(|_, [t, f, x]| format!("{t:.3},{f},{:.0}", 10.0 * ((x + 1.0) / 10.0).floor()));
    let (summary, experiment, _) =
        read(&format!("Time (s),Force (uN),Position (um)\n{coarse}"), TableSettings::default()).expect("an experiment");
    assert!(experiment.fits_position_offset, "{summary:?}");
}

#[test]
fn a_coarse_clock_is_spread_and_tracks_are_told_apart() {
    let clock = rows(|row, [_, f, x]| format!("10:00:{:02},{f},{x:.3}", row / 20));
    let seconds = rows(|_, [t, f, x]| format!("{:.0},{f},{x:.3}", t.floor()));
    let late = rows(|row, [_, f, x]| format!("10:00:{:02},{f},{x:.3}", (row + 10) / 20));
    for (header, text) in [("time", clock), ("time_s", seconds)] {
        let summary = assert_is_truth(&format!("{header},force_uN,position_um\n{text}"), TableSettings::default());
        assert!(summary.reasons.iter().any(|reason| reason.contains("spread evenly")), "{summary:?}");
    }
    // The first second has ten rows, so the record began within it.
    let (_, experiment, _) =
        read(&format!("time,force_uN,position_um\n{late}"), TableSettings::default()).expect("a record");
    let steps: Vec<f64> = experiment.record.time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(steps.iter().all(|step| (step - INTERVAL_S).abs() < 1e-9), "{steps:?}");

    let beads = rows(|_, [t, f, x]| format!("0,{t:.3},{f},{x:.3}\n1,{t:.3},{f},{:.3}", 900.0 - 0.01 * x));
    let named = format!("TRACK_ID,time_s,force_uN,position_um\n{beads}");
    let text = refused(&named, TableSettings::default());
    assert!(text.contains("0 (600 rows), 1 (600 rows)"), "{text}");
    assert_is_truth(&named, TableSettings { track: [None, said("0")], ..TableSettings::default() });
    let nameless = format!("id,time_s,force_uN,position_um\n{beads}");
    let text = refused(&nameless, TableSettings::default());
    assert!(text.contains("several tracks"), "{text}");
    assert_is_truth(&nameless, TableSettings { track: [said("id"), said("0")], ..TableSettings::default() });
}

#[test]
fn all_tracks_become_a_cohort() {
    let beads = rows(|_, [t, f, x]| format!("7,{t:.3},{f},{x:.3}\n9,{t:.3},{f},{:.3}", 2.0 * x));
    let folder = tempfile::tempdir().expect("a folder");
    let (file, out) = (folder.path().join("beads.csv"), folder.path().join("beads"));
    std::fs::write(&file, format!("particle,time_s,force_uN,position_um\n{beads}")).expect("room on the disk");
    let given = TableSettings { track: [None, said("all")], ..TableSettings::default() };
    let sizes = [Some(0.55), Some(20.0), Some(0.48)];
    let request = InitRequest { file, out: Some(out.clone()), known_columns: given, sizes, ..InitRequest::default() };
    let (summary, _) = run(&request, &mut |_| None).expect("two experiments");
    assert_eq!(summary.experiments, [out.join("7").display().to_string(), out.join("9").display().to_string()]);
    let travel = |track: &str| {
        let (experiment, _) = Experiment::read(&out.join(track)).expect("an experiment");
        assert_eq!(experiment.specimen_id, format!("beads-{track}"));
        experiment.record.position_m[90].expect("a position")
    };
    assert!((travel("9") / travel("7") - 2.0).abs() < 1e-3);
}

#[test]
fn header_lines_of_a_tracker_are_names_and_units() {
    let line = |row: usize, [t, f, x]: [f64; 3]| format!("ID{row},0,{:.4},299.5,0.0,{t:.3},{row},{f}", 512.0 + x);
    let above =
        "LABEL,TRACK_ID,POSITION_X,POSITION_Y,POSITION_Z,POSITION_T,FRAME,FORCE\nLabel,Track ID,X,Y,Z,T,Frame,Force\n";
    let text =
        format!("{above}Label,Track ID,X,Y,Z,T,Frame,F\n,,(micron),(micron),(micron),(sec),,(uN)\n{}", rows(line));
    let summary = assert_is_truth(&text, TableSettings::default());
    let names: Vec<&str> = summary.columns.iter().map(|column| column.name.as_str()).collect();
    assert_eq!(names, ["T", "F", "X", "Y"]);
}

#[test]
fn dates_may_begin_with_the_day_or_the_month() {
    let at = |row: usize, date: &str, between: &str| {
        let t = INTERVAL_S * row as f64;
        format!("{date} 10:02:{:02}{between}{:03}", t as usize, (1000.0 * t).round() as usize % 1000)
    };
    let german = rows(|row, [_, f, x]| {
        format!("{};{f};{x:.3}", at(row, "17.02.2020", ",")).replace('.', ",").replace("17,02,2020", "17.02.2020")
    });
    let american = rows(|row, [_, f, x]| format!("{} AM;{f};{x:.3}", at(row, "2/17/2020", ".")));
    let unclear = rows(|row, [_, f, x]| format!("{};{f};{x:.3}", at(row, "02/03/2020", ".")));
    for text in [german, american, unclear] {
        assert_is_truth(&format!("time;force [uN];position [um]\n{text}"), TableSettings::default());
    }
    let midnight = rows(|row, [_, f, x]| {
        let (date, second) =
            if row < 300 { ("02/03/2020 23:59:4", row / 60) } else { ("03/03/2020 00:00:0", (row - 300) / 60) };
        format!("{date}{second}.{:03};{f};{x:.3}", 16 * (row % 60))
    });
    let text = format!("time;force [uN];position [um]\n{midnight}");
    assert!(refused(&text, TableSettings::default()).contains("day or with the month"));
    let units = [said("day-first"), None, None];
    let (_, experiment, _) = read(&text, TableSettings { units, ..TableSettings::default() }).expect("a record");
    assert!(experiment.record.time_s[599] < 30.0);
}

#[test]
fn signs_between_thousands_are_told_from_decimal_signs() {
    let grouped = |value: f64| {
        let mut whole = value.round().abs() as u64;
        let mut text = String::new();
        while whole >= 1000 {
            text = format!(".{:03}{text}", whole % 1000);
            whole /= 1000;
        }
        format!("{}{whole}{text}", if value < -0.5 { "-" } else { "" })
    };
    let text = rows(|row, [_, f, x]| format!("{};{:.0};{}", 50 * row, 1000.0 * f, grouped(1000.0 * x)));
    let text = format!("Zeit [ms];Kraft [nN];Weg [nm]\n{text}");
    let summary = assert_is_truth(&text, TableSettings::default());
    assert!(summary.reasons.iter().any(|reason| reason.contains("thousands separator")), "{summary:?}");
    let as_decimals = refused(&text, TableSettings { thousands: said("none"), ..TableSettings::default() });
    assert!(as_decimals.contains("is not a number"), "{as_decimals}");
    // A spreadsheet quotes such numbers between commas, and writes smaller numbers without quotation marks.
    let quoted = |value: f64| match grouped(value).replace('.', ",") {
        number if number.contains(',') => format!("\"{number}\""),
        number => number,
    };
    let text =
        rows(|row, [_, f, x]| format!("{},{},{}", quoted(50.0 * row as f64), quoted(1000.0 * f), quoted(1000.0 * x)));
    assert_is_truth(&format!("Time [ms],Force [nN],Position [nm]\n{text}"), TableSettings::default());
    // A zero has no decimals where 1.500 is a number of thousands.
    let zeros = rows(|row, [_, f, x]| format!("{};{};{:.0}", 50 * row, grouped(1000.0 * f), 1e3 * (100.0 + x)));
    assert_is_truth(&format!("Zeit [ms];Kraft [nN];Weg [nm]\n{zeros}"), TableSettings::default());
    // Three decimals in every number of a column are decimals, also beside a column of whole numbers.
    let beside = rows(|row, [_, f, x]| format!("{};{:.0};{:.3}", 50 * row, 1000.0 * f, 100.0 + x));
    assert_is_truth(&format!("Zeit [ms];Kraft [nN];Weg [um]\n{beside}"), TableSettings::default());
    // Three decimals in every row are decimals, not thousands.
    let decimals = rows(|_, [t, f, x]| format!("{t:.3};{f:.3};{:.3}", 100.0 + x));
    assert_is_truth(&format!("Zeit [s];Kraft [uN];Weg [um]\n{decimals}"), TableSettings::default());
}

#[test]
fn a_blank_force_is_asked_for() {
    let on_change = rows(|row, [t, f, x]| {
        let force = if row % 100 == 0 { f.to_string() } else { String::new() };
        format!("{t:.3},{force},{x:.3}")
    });
    let text = format!("time_s,force_uN,position_um\n{on_change}");
    let refusal = refused(&text, TableSettings::default());
    assert!(refusal.contains("line 3") && refusal.contains("blank_force = \"above\""), "{refusal}");
    assert_is_truth(&text, TableSettings { blank_force: said("above"), ..TableSettings::default() });
    let at_rest = plain().replace(",0,", ",,");
    assert_is_truth(&at_rest, TableSettings { blank_force: said("zero"), ..TableSettings::default() });
}

#[test]
fn values_that_stand_for_lost_tracking_are_found() {
    for sentinel in ["-9999", "0.000", "65535"] {
        let text = rows(|row, [t, f, x]| {
            let position = if row % 23 == 7 { sentinel.to_string() } else { format!("{:.3}", 300.0 + x) };
            format!("{t:.3},{f},{position}")
        });
        let text = format!("time_s,force_uN,position_um\n{text}");
        let summary = assert_is_truth(&text, TableSettings::default());
        assert_eq!(summary.rows_without_position, N_ROWS.div_ceil(23) - usize::from(N_ROWS % 23 <= 7), "{sentinel}");
        // Without that line of the description the record reports the lost positions.
        let dropped = |toml: &str| {
            toml.lines().filter(|line| !line.starts_with("lost")).map(|line| format!("{line}\n")).collect()
        };
        let (_, experiment, files) = edited(&text, TableSettings::default(), dropped).expect("an experiment");
        assert!(kinds(&experiment, &files).contains(&"lost_positions".to_string()), "{sentinel}");
    }
}

#[test]
fn spellings_of_numbers_units_and_lines_are_known() {
    let minus = plain().replace('-', "\u{2212}");
    let trailing: String = plain()
        .lines()
        .enumerate()
        .map(|(n, line)| if n == 0 { format!("{line}\n") } else { format!("{line},\n") })
        .collect();
    for text in [
        minus,
        trailing,
        plain().replace('\n', "\r"),
        plain().replace("(uN)", "(microN)").replace("(um)", "(microns)").replace("(s)", "(sec)"),
    ] {
        assert_is_truth(&text, TableSettings::default());
    }
}

#[test]
fn a_sensors_noise_about_levels_is_taken_off() {
    for size in [0.02, 0.05] {
        let text = rows(|row, [t, f, x]| format!("{t:.3},{:.5},{x:.3}", f + size * noise(7 * row + 3)));
        let (_, experiment, files) =
            read(&format!("time_s,force_uN,position_um\n{text}"), TableSettings::default()).expect("a record");
        let apart = distances(&experiment);
        assert!(apart[1] < 0.2 * size && kinds(&experiment, &files).is_empty(), "{size} {apart:?}");
    }
    let sine = rows(|row, [t, _, x]| format!("{t:.3},{:.5},{x:.3}", 4.6 * (0.1 * t).sin() + 0.02 * noise(row)));
    let (_, experiment, _) =
        read(&format!("time_s,force_uN,position_um\n{sine}"), TableSettings::default()).expect("a record");
    assert!(experiment.record.force_n.windows(2).filter(|pair| pair[0] == pair[1]).count() < 5);
}

#[test]
fn a_gap_and_outliers_are_named_by_row() {
    let text: String = plain()
        .lines()
        .enumerate()
        .filter(|(n, _)| !(201..401).contains(n))
        .map(|(_, line)| format!("{line}\n"))
        .collect();
    let (_, experiment, files) = read(&text, TableSettings::default()).expect("a record");
    let found = contradictions(&experiment, &files.interpretation);
    let gap = found.iter().find(|found| found.kind == "gap").expect("a gap");
    assert!(gap.text.contains("from 9.950 to 20.00 s (201 sampling intervals; 0.00 µN"), "{gap:?}");

    let text =
        rows(|row, [t, f, x]| format!("{t:.3},{f},{:.3}", if [150, 340, 599].contains(&row) { x + 400.0 } else { x }));
    let (_, experiment, files) =
        read(&format!("time_s,force_uN,position_um\n{text}"), TableSettings::default()).expect("a record");
    let found = contradictions(&experiment, &files.interpretation);
    let outliers = found.iter().find(|found| found.kind == "outliers").expect("outliers");
    assert!(
        ["3 positions", "(row 151)", "(row 341)", "(row 600)"].iter().all(|part| outliers.text.contains(part)),
        "{outliers:?}"
    );
    let clean = read(&plain(), TableSettings::default()).expect("a record").1.reference_noise().expect("a noise").sd_m;
    assert!((experiment.reference_noise().expect("a noise").sd_m / clean - 1.0).abs() < 0.05);
    // Applies the remedy.
    let left_out = |toml: &str| {
        toml.replace("delimiter", "left_out_s = [[7.49, 7.51], [16.99, 17.01], [29.94, 29.96]]\ndelimiter")
    };
    let (_, experiment, files) =
        edited(&format!("time_s,force_uN,position_um\n{text}"), TableSettings::default(), left_out).expect("a record");
    assert!(kinds(&experiment, &files).is_empty() && distances(&experiment)[2] < 2e-3);
}

/// A force polled once per second: the rows show it up to a second late. The remedy is a log with the times in the message.
#[test]
fn a_force_that_is_logged_late_is_recognised() {
    for (late, sign) in [(13, 1.0), (6, 1.0), (13, -1.0)] {
        let all = truth();
        let force = |row: usize| if row < late { 0.0 } else { all[row - late][1] };
        let text = rows(|row, [t, _, x]| format!("{t:.3},{},{:.3}", force(row), sign * x));
        let text = format!("time_s,force_uN,position_um\n{text}");
        let (_, experiment, files) = read(&text, TableSettings::default()).expect("a record");
        let found = contradictions(&experiment, &files.interpretation);
        let late_found = found.iter().find(|found| found.kind == "force_logged_late").expect("found");
        assert!(
            late_found.advice.contains("5.0000") && !found.iter().any(|found| found.kind == "against_force"),
            "{found:?}"
        );
        assert_eq!(files.interpretation.settled.is_reversed, sign < 0.0);
    }
}

/// A record whose first rows, up to 3 s, are missing. Following the remedy gives the truth.
#[test]
fn a_record_that_starts_under_load_is_recognised() {
    let kept = |from: usize| -> String {
        let rows =
            truth().into_iter().skip(from).map(|[t, f, x]| format!("{:.3},{f},{x:.3}\n", t - INTERVAL_S * from as f64));
        format!("time_s,force_uN,position_um\n{}", rows.collect::<String>())
    };
    for from in [20, 60] {
        let (_, experiment, files) = read(&kept(from), TableSettings::default()).expect("a record");
        assert!(kinds(&experiment, &files).contains(&"starts_under_load".to_string()), "{from}");
        let start_s = -INTERVAL_S * from as f64;
        let told = |toml: &str| toml.replace("# load_start_s = -3.0", &format!("load_start_s = {start_s:.3}"));
        let (_, experiment, files) = edited(&kept(from), TableSettings::default(), told).expect("a record");
        assert!(kinds(&experiment, &files).is_empty(), "{:?}", kinds(&experiment, &files));
        let record = &experiment.record;
        assert_eq!((record.position_m[0], record.n_rows()), (None, N_ROWS - from + 1));
        assert!((record.time_s[1] + start_s).abs() < 1e-9 && record.time_s[0] == 0.0);
    }
}

/// Checks the layouts of programs whose headers differ from a single line of names: names in comments, units and remarks below the names, names in capitals, a
/// preamble with the quantity of the first column, and rows that are numbered in a column without a name.
#[test]
fn headers_of_many_programs_are_read() {
    let comma = |x: f64| format!("{x:.3}").replace('.', ",");
    for (program, text) in [
        (
            "JPK",
            format!(
                "# xPosition: 1.0E-5\n# segment: pause\n#\n# columns: seriesTime vDeflection height\n# fancyNames: \"Series Time\" \"Vertical deflection\" \"Height\"\n# units: s N m\n{}",
                rows(|_, [t, f, x]| format!("{t:.3} {:e} {:.9e}", 1e-6 * f, 1e-6 * x))
            ),
        ),
        (
            "Origin",
            format!(
                "Time\tForce\tPosition\ns\tuN\tum\n\tcoil\ttracked\n{}",
                rows(|_, [t, f, x]| format!("{t:.3}\t{f}\t{x:.3}"))
            ),
        ),
        (
            "R",
            format!(
                "\"time_s\" \"force_uN\" \"position_um\"\n{}",
                rows(|row, [t, f, x]| format!("\"{}\" {t:.3} {f} {x:.3}", row + 1))
            ),
        ),
        (
            "Igor",
            format!(
                "IGOR\nWAVES/D\ttime_s\tforce_uN\tposition_um\nBEGIN\n{}END\n",
                rows(|_, [t, f, x]| format!("\t{t:.3}\t{f}\t{x:.3}"))
            ),
        ),
        (
            "thermal analysis",
            format!(
                "Version\tV7.5\nNsig\t3\nSig1\tTime (min)\nSig2\tForce (N)\nSig3\tDisplacement (mm)\nStartOfData\n{}",
                rows(|_, [t, f, x]| format!("{:.9E}\t{:.6E}\t{:.9E}", t / 60.0, 1e-6 * f, 1e-3 * x))
            ),
        ),
        (
            "Fortran",
            format!(
                " TIME(S)  FORCE(N)  DISP(M)\n{}",
                rows(|_, [t, f, x]| format!(" {t:.9E}  {:.6E}  {:.9E}", 1e-6 * f, 1e-6 * x).replace('E', "D"))
            ),
        ),
        (
            "LabVIEW",
            format!(
                "LabVIEW Measurement\t\n***End_of_Header***\t\nChannels\t2\nX_Dimension\tTime\tTime\n***End_of_Header***\t\nX_Value\tForce (uN)\tPosition (um)\tComment\n{}",
                rows(|_, [t, f, x]| format!("{t:.3}\t{f}\t{x:.3}"))
            ),
        ),
        (
            "CellScale",
            format!(
                "Step,TIME_S,Size_um,Displacement_um,Force_uN\n{}",
                rows(|_, [t, f, x]| format!("hold,{t:.3},{:.3},{x:.3},{f}", 500.0 + x))
            ),
        ),
        (
            "a sequence of tests",
            format!(
                "Action,Time (action)(s),Time (sequence)(s),Force(uN),Position(um)\n{}",
                rows(|_, [t, f, x]| format!("creep,{t:.3},{:.3},{f},{x:.3}", t + 60.0))
            ),
        ),
        (
            "names of columns without cells",
            format!(
                "Time (s),Force (uN),Position (um),Note,Flag\n{}",
                rows(|_, [t, f, x]| format!("{t:.3},{f},{x:.3}"))
            ),
        ),
        (
            "a Russian program",
            format!(
                "Время (с);Сила (мкН);Перемещение (мкм);Температура\n{}",
                rows(|_, [t, f, x]| format!("{};{};{};25", comma(t), comma(f), comma(x)))
            ),
        ),
    ] {
        println!("{program}");
        assert_is_truth(&text, TableSettings::default());
    }
}

/// Checks that a tracker's file and the log of the force become the true record. TrackMate's times are frames.
#[test]
fn tracks_and_the_log_of_the_force_are_joined() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let spots: String = truth()
        .iter()
        .enumerate()
        .map(|(row, [_, _, x])| format!("<detection t=\"{row}\" x=\"{x:.4}\" y=\"{:.4}\" z=\"0\"/>", 0.5 * x))
        .collect();
    let xml = format!(
        "<?xml version=\"1.0\"?>\n<Tracks nTracks=\"1\" spaceUnits=\"micron\" frameInterval=\"{INTERVAL_S}\" timeUnits=\"sec\"><particle nSpots=\"{N_ROWS}\">{spots}</particle></Tracks>"
    );
    std::fs::write(at("tracks.xml"), xml).expect("room on the disk");
    std::fs::write(at("coil.csv"), rows(|_, [t, f, _]| format!("{t:.3};{f}")).replace('.', ",")).expect("room");
    let request = |force_file: Option<&str>| InitRequest {
        file: at("tracks.xml"),
        out: Some(at("out")),
        sizes: [Some(0.55), Some(20.0), Some(0.48)],
        force_file: force_file.map(at),
        ..InitRequest::default()
    };
    let refused = |force_file| run(&request(force_file), &mut |_| None).expect_err("a refusal").to_string();
    assert!(refused(None).contains("force_file"), "the remedy names the other file");
    assert!(refused(Some("coil.csv")).contains("no column has a unit of time"), "the log has no header");
    let named = format!("t (s);F (uN)\n{}", std::fs::read_to_string(at("coil.csv")).expect("the log"));
    std::fs::write(at("coil.csv"), named).expect("room");
    run(&request(Some("coil.csv")), &mut |_| None).expect("an experiment");
    let (experiment, _) = Experiment::read(&at("out")).expect("a description that can be read");
    let record = &experiment.record;
    for (row, [t, f, _]) in truth().into_iter().enumerate() {
        assert!((record.time_s[row] - t).abs() < 1e-6 && (1e6 * record.force_n[row] - f).abs() < 1e-6, "row {row}");
    }
    // A current needs a calibration, which only the user knows.
    std::fs::write(at("coil.csv"), format!("t [s];I [mA]\n{}", rows(|_, [t, f, _]| format!("{t:.3};{f}"))))
        .expect("room");
    let replaced = InitRequest { replace: true, ..request(Some("coil.csv")) };
    let (summary, _) = run(&replaced, &mut |_| None).expect("a description with a gap");
    assert_eq!(summary.unknown, ["actuation.calibration"]);
    assert!(Experiment::read(&at("out")).expect_err("a gap").to_string().contains("calibration"));
    let toml = std::fs::read_to_string(at("out/experiment.toml")).expect("a description");
    let known = toml.replace("calibration = \"?\"", "calibration = [0.0, 2e-6]");
    std::fs::write(at("out/experiment.toml"), known).expect("room");
    let (experiment, _) = Experiment::read(&at("out")).expect("a description that can be read");
    // 4.6 mA at 2 µN/A.
    assert!((experiment.record.force_n[1] - 9.2e-9).abs() < 1e-18, "{}", experiment.record.force_n[1]);
}

/// Kinds of tests in which force and position both change, or the position falls while the force rises.
#[test]
fn the_commanded_quantity_and_its_direction_are_told() {
    // Approach of a tip: the separation (m) falls during 2 s while the force rises, then holds, with noise, for 40 s while the force decays.
    let relaxation = |sign: f64| -> String {
        let line = |row: usize| {
            let t = 0.02 * row as f64;
            let depth = 8e-6 * (t / 2.0).min(1.0);
            let force = 2e-6 * if t < 2.0 { t / 2.0 } else { 0.5 + 0.5 * (-(t - 2.0) / 6.0).exp() };
            format!("{t:.2},{:e},{:e}\n", force + 1e-8 * noise(row), 2e-5 + sign * depth + 2e-8 * noise(row + 9_999))
        };
        "Time [s],Force [N],Position [m]\n".to_string() + &(0..2_100).map(line).collect::<String>()
    };
    for (sign, direction) in [(-1.0, "direction = \"-\""), (1.0, "direction = \"+\"")] {
        let folder = tempfile::tempdir().expect("a folder");
        let (file, out) = (folder.path().join("a.csv"), folder.path().join("a"));
        std::fs::write(&file, relaxation(sign)).expect("room on the disk");
        let columns = [Some("1".into()), Some("2".into()), Some("3".into()), None];
        let known_columns = TableSettings { columns, ..TableSettings::default() };
        let request = InitRequest { file, out: Some(out.clone()), known_columns, ..InitRequest::default() };
        let (summary, _) = run(&request, &mut |_| None).expect("a relaxation");
        assert!(summary.reasons.iter().any(|reason| reason.contains("a relaxation")), "{:?}", summary.reasons);
        let toml = std::fs::read_to_string(out.join("experiment.toml")).expect("a description");
        assert!(toml.contains("kind = \"relaxation\"") && toml.contains(direction), "{toml}");
        // Of a tip there is no model of a relaxation.
        let of_tip = relaxation(sign).replacen("Force [N],Position", "vDeflection [N],separation", 1);
        std::fs::write(&request.file, of_tip).expect("room on the disk");
        let request = InitRequest { replace: true, ..request };
        let refusal = run(&request, &mut |_| None).unwrap_err().to_string();
        assert!(refusal.contains("a relaxation of a tip has no model"), "{refusal}");
    }

    // A stretch at a constant rate, forth and back, whose stress bends.
    let line = |row: usize| {
        let t = 0.5 * row as f64;
        let strain = if row < 50 { t } else { 50.0 - t };
        format!("{t},{strain:.3},{:.5}\n", 8.0 * (1.0 - (-strain / 6.0).exp()) + 0.004 * noise(row))
    };
    let text = "Time [s],Strain [%],Stress [kPa]\n".to_string() + &(0..100).map(line).collect::<String>();
    let folder = tempfile::tempdir().expect("a folder");
    let (file, out) = (folder.path().join("a.csv"), folder.path().join("a"));
    std::fs::write(&file, text).expect("room on the disk");
    let request = InitRequest { file, out: Some(out.clone()), ..InitRequest::default() };
    let (summary, _) = run(&request, &mut |_| None).expect("a stretch");
    let reasons = summary.reasons.join("\n");
    assert!(reasons.contains("the strain holds at no value for long, but is taken for the commanded"), "{reasons}");

    let twice = TableSettings { columns: [None, Some("2".into()), Some("2".into()), None], ..TableSettings::default() };
    assert!(refused(&plain(), twice).contains("given for two quantities"));
}

/// The sheets of a workbook are tables of their own, also if their header has too few names.
#[test]
fn sheets_are_tables_of_their_own() {
    let rows: String = truth().iter().map(|[t, f, x]| format!("{t:.3}\t{f}\t{x:.3}\n")).collect();
    let text = format!("sheet one\nTime (s)\tForce (uN)\tPosition (um)\n{rows}\nsheet two\nSpecimen\tB\n{rows}");
    let refusal = refused(&text, TableSettings::default());
    assert!(refusal.contains("2 tables") && refusal.contains("starts anew"), "{refusal}");
    let some = |texts: [&str; 3]| texts.map(|text| Some(text.to_string()));
    let [time, force, position] = some(["1", "2", "3"]);
    let columns = [time, force, position, None];
    let second =
        TableSettings { tables: Some("2".into()), columns, units: some(["s", "uN", "um"]), ..TableSettings::default() };
    let (_, experiment, _) = read(&text, second).expect("the second sheet");
    assert!(distances(&experiment)[2] < 0.01);
}

/// A relaxation whose first row, at time 0, already has the strain of the hold: the step is taken to begin just before it, and the stress of this row is not compared.
#[test]
fn a_relaxation_that_begins_with_its_hold_is_read() {
    let rows: String = (0..200)
        .map(|row| {
            let t = 0.2 * f64::from(row);
            format!("{t:.1},1.0,{:.4}\n", 5.0 + 15.0 * (-t / 8.0).exp())
        })
        .collect();
    let (summary, experiment, files) =
        read(&format!("Time [s],Strain [%],Stress [Pa]\n{rows}"), TableSettings::default()).expect("a relaxation");
    assert!(summary.reasons.iter().any(|reason| reason.contains("left_out_s")), "{:?}", summary.reasons);
    let record = &experiment.record;
    assert_eq!((record.position_m[0], record.position_m[1]), (None, None));
    assert!(record.force_n[1..].iter().all(|strain| (strain - 1e-6).abs() < 1e-18), "{:?}", &record.force_n[..4]);
    assert!((record.position_m[2].unwrap() - 1e-6 * (5.0 + 15.0 * (-0.2_f64 / 8.0).exp())).abs() < 1e-10);
    assert!(kinds(&experiment, &files).is_empty(), "{:?}", kinds(&experiment, &files));
}

/// Decimal commas in quotes, between commas.
#[test]
fn quoted_decimal_commas_between_commas_are_read() {
    let comma = |x: f64| format!("\"{}\"", format!("{x:.3}").replace('.', ","));
    let text = format!(
        "Time (s),Force (uN),Position (um)\n{}",
        rows(|_, [t, f, x]| format!("{},{},{}", comma(t), comma(f), comma(x)))
    );
    assert_is_truth(&text, TableSettings::default());
}

/// Exports with a line of empty cells, or of a remark, between the names and the units.
#[test]
fn lines_between_names_and_units_are_passed() {
    for between in [",,,", ",Constant component,,", ",,Waveform,Waveform"] {
        let text = format!(
            "Test:,creep,,\n{between}\nInterval data:,Time,Force,Position\n{between}\n,[s],[uN],[um]\n{}",
            rows(|_, [t, f, x]| format!(",{t:.3},{f},{x:.3}"))
        );
        assert_is_truth(&text, TableSettings::default());
    }
}

/// Headers with more cells than the rows: an empty first cell, a title, or a column of notes. Another line of words may stand above the names.
#[test]
fn names_and_units_stand_above_their_columns() {
    let body = rows(|row, [t, f, x]| format!("{},{t:.3},{f},{x:.3}", row + 1));
    for header in [
        ",No.,Time [s],Force [uN],Position [um]",
        ",No.,Time,Force,Position\n,,[s],[uN],[um]",
        "No.,Time,Force,Position\n,,[s],[uN],[um]",
        "Interval data:,No.,Time,Force,Position\n,[s],[uN],[um]",
        "Sample,Gel A,Operator,JD\n,Time,Force,Position\n,s,uN,um",
        "No.:,Time [s],Force [uN],Position [um],Comment",
        "gel 1,gel 1,gel 1,gel 1\n,Time,Force,Position\n[1],[s],[uN],[um]",
    ] {
        assert_is_truth(&format!("{header}\n{body}"), TableSettings::default());
    }
}

/// Rows with their number in a column before the others.
fn numbered(rows: &str) -> String {
    rows.lines().enumerate().map(|(row, line)| format!("{},{line}\n", row + 1)).collect()
}

/// Tables that show no creep, no relaxation and no oscillation are refused with what they show.
#[test]
fn flows_and_auxiliary_columns_are_refused() {
    let rows =
        |line: &dyn Fn(f64) -> String| -> String { (0..200).map(|row| line(0.1 * f64::from(row)) + "\n").collect() };
    let relaxing = |t: f64| 3.0 + 2.0 * (-t / 4.0).exp();
    for (text, cause) in [
        (
            format!(
                "Torque (N.m),Displacement (rad),Step time (s),Axial force (N),Gap (mm)\n{}",
                rows(&|t| format!("{:.5},0.01,{t:.1},{:.4},1.0", 1e-5 * relaxing(t), 0.1 + 0.001 * t))
            ),
            "rotating rheometer",
        ),
        (
            format!(
                "Time [s],Shear Rate [1/s],Shear Stress [Pa],Shear Strain [%]\n{}",
                rows(&|t| format!("{t:.1},1000,{:.4},{:.1}", relaxing(t), 1e5 * (t + 0.1)))
            ),
            "the specimen flows",
        ),
        (
            format!(
                "Shear Rate [1/s],Shear Stress [Pa],Viscosity [Pa.s]\n{}",
                rows(&|t| format!("{:.1},{:.4},{:.4}", t + 0.1, relaxing(t), relaxing(t) / (t + 0.1)))
            ),
            "a flow curve",
        ),
        (
            format!(
                "Time (s),Force (uN),Position (um)\n{}",
                rows(&|t| format!("{t:.1},{},10.0", if t < 10.0 { 0.0 } else { 5.0 }))
            ),
            "the position is the same in every row",
        ),
    ] {
        let refusal = refused(&text, TableSettings::default());
        assert!(refusal.contains(cause), "{refusal}");
    }
}

/// Stress and strain stand among columns of other stresses and strains. The columns of the test are found by their words, or asked for.
#[test]
fn the_stress_and_the_strain_of_the_test_are_found() {
    let creep = |line: &dyn Fn(f64, f64) -> String| -> String {
        let strain = |t: f64| 2.0 * (1.0 - (-t / 3.0).exp()) + 0.05 * t;
        (0..200).map(|row| 0.1 * f64::from(row)).map(|t| line(t, strain(t)) + "\n").collect()
    };
    let column = |summary: &InitSummary, role: &str| {
        summary.columns.iter().find(|column| column.role == role).map(|column| column.name.clone())
    };
    let four = |header: &str| {
        let before = header.starts_with("Time (s),Strain");
        let line = |t: f64, strain: f64| match before {
            true => format!("{t:.1},{strain:.4},3.0,10.0"),
            false => format!("{t:.1},1.0,{strain:.4},10.0"),
        };
        format!("{header}\n{}", creep(&line))
    };
    for (header, stress, strain) in [
        ("Time (s),Strain (%),Normal stress (Pa),Shear stress (Pa)", "Shear stress (Pa)", "Strain (%)"),
        ("Time (s),Strain (%),Yield stress (Pa),Stress (Pa)", "Stress (Pa)", "Strain (%)"),
        ("Time (s),Strain setpoint (%),Strain (%),Stress (Pa)", "Stress (Pa)", "Strain (%)"),
        ("Time (s),Recoverable strain (%),Strain (%),Stress (Pa)", "Stress (Pa)", "Strain (%)"),
        ("Time (s),Strain constant,Strain (%),Stress (Pa)", "Stress (Pa)", "Strain (%)"),
        ("Time (s),SD strain (%),Mean strain (%),Stress (Pa)", "Stress (Pa)", "Mean strain (%)"),
        ("Time (s),Grip strain (%),Extensometer strain (%),Stress (Pa)", "Stress (Pa)", "?"),
        ("Time (s),Strain (%),Stress sample 1 (Pa),Stress sample 2 (Pa)", "?", "Strain (%)"),
    ] {
        let tried = read(&four(header), TableSettings::default());
        if [stress, strain].contains(&"?") {
            let refusal = tried.err().unwrap_or_else(|| panic!("{header}"));
            assert!(refusal.contains("several columns can be meant"), "{refusal}");
            continue;
        }
        let (summary, ..) = tried.unwrap_or_else(|error| panic!("{header}: {error}"));
        let number = |name: &str| header.split(',').position(|known| known == name).unwrap() + 1;
        let is = |role: &str, name: &str| {
            let found = column(&summary, role).unwrap();
            assert!(found == name || found.contains(&number(name).to_string()), "{header}: {role} {found}");
        };
        is("stress", stress);
        is("strain", strain);
    }
    // A column that the user names, and a time that he names, keep tension.
    let text = four("Time (s),Tensile strain (%),Grip strain (%),Tensile stress (Pa)");
    let columns = [Some("1".into()), None, Some("3".into()), None];
    let (summary, ..) = read(&text, TableSettings { columns, ..TableSettings::default() }).expect("a creep");
    let is_tension = summary.reasons.iter().any(|reason| reason.contains("with compliance_per_m = 1,"));
    assert!(is_tension, "{:?}", summary.reasons);
}

/// A relaxation whose strain is measured beneath noise, from its first row on.
#[test]
fn a_measured_strain_that_holds_is_commanded() {
    // A decay to a third, and one of three hundredths.
    for (plateau, part) in [(10.0, 20.0), (20.0, 0.6)] {
        let line = |row: usize| {
            let t = 0.01 * 1.06_f64.powi(row as i32);
            format!(
                "{t:.5},{:.4},{:.4}\n",
                1.0 + 0.004 * noise(row),
                plateau + part * (-t / 3.0).exp() + 0.02 * noise(row + 500)
            )
        };
        let text =
            "Time (s),Shear strain (%),Shear stress (Pa)\n".to_string() + &(0..150).map(line).collect::<String>();
        let (summary, experiment, _) = read(&text, TableSettings::default()).expect("a relaxation");
        assert_eq!(experiment.control, Control::Position, "{:?}", summary.reasons);
    }
}

/// Columns of logarithms look like small numbers in a plain unit. A logger's time is read if the user names it.
#[test]
fn logarithms_are_refused() {
    let of_logger = plain().replacen("Time (s)", "Log Time (s)", 1);
    let named = TableSettings { columns: [Some("Log Time (s)".into()), None, None, None], ..TableSettings::default() };
    let (_, experiment, _) = read(&of_logger, named).expect("a logger's time");
    assert_eq!(experiment.record.n_rows(), N_ROWS);
    assert!(refused(&of_logger, TableSettings::default()).contains("name the column: `time NAME`"));
    for header in
        ["log10 time (s),log10 G(t) (Pa)", "ln(t) (s),J (1/Pa)", "log t (s),G(t) (Pa)", "time (s),log G(t) (Pa)"]
    {
        let rows: String = (0..60)
            .map(|row| format!("{:.3},{:.4}\n", -1.0 + 0.05 * f64::from(row), 3.5 - 0.01 * f64::from(row)))
            .collect();
        let refusal = refused(&format!("{header}\n{rows}"), TableSettings::default());
        assert!(refusal.contains("holds logarithms"), "{header}: {refusal}");
    }
}

/// A factor in a column's name is not a unit. Coordinates and sizes of lenses are no factors.
#[test]
fn multiples_are_refused() {
    let rows: String = (0..60).map(|row| format!("{row},{:.4},2\n", f64::from(row).sqrt())).collect();
    for header in [
        "Time (s),Strain (%),Stress x10 (Pa)",
        "Time (s),Strain (%),10 x Stress (Pa)",
        "Time (s),Strain*1000 (%),Stress (Pa)",
        "Time (s),Strain (%) x 10,Stress (Pa)",
        "Time x 0.5 s,Strain (%),Stress (Pa)",
    ] {
        let refusal = refused(&format!("{header}\n{rows}"), TableSettings::default());
        assert!(refusal.contains("holds multiples"), "{header}: {refusal}");
    }
    let by_number = TableSettings { columns: [Some("1".into()), None, None, None], ..TableSettings::default() };
    assert!(refused(&format!("Time (s),Strain (%),Stress x10 (Pa)\n{rows}"), by_number).contains("holds multiples"));
    for header in [
        "Time (s),2 x (um),Force (uN)",
        "Time (s),x 2 (um),Force (uN)",
        "Time (s),x1 (um),Force x (uN)",
        "Time (s),Strain (%),Stress (Pa)",
    ] {
        assert!(read(&format!("{header}\n{rows}"), TableSettings::default()).is_ok(), "{header}");
    }
}

/// The amplitudes of an oscillation at one strain look like a relaxation.
#[test]
fn amplitudes_of_an_oscillation_are_refused() {
    let rows: String = (0..40)
        .map(|row| {
            format!("{},{:.4},{:.3},1,{:.2}\n", 10 * row, 10.0 / f64::from(row + 1), 12.0 - 0.1 * f64::from(row), 16.0)
        })
        .collect();
    for header in [
        "Time (s),Frequency (Hz),Oscillation stress (Pa),Oscillation strain (%),Phase angle (deg)",
        "Time (s),Temperature (°C),Stress (Pa),Strain (%),tan delta",
        "Time (s),Complex viscosity (Pa.s),Stress (Pa),Strain (%),n",
    ] {
        let refusal = refused(&format!("{header}\n{rows}"), TableSettings::default());
        assert!(refusal.contains("is a column of an oscillation"), "{header}: {refusal}");
    }
    // An export with the columns of other tests.
    let empty = rows.replace(",16.00\n", ",16.00,,0\n");
    let header = "Time (s),n,Stress (Pa),n2,Strain (%),Tan delta,Phase angle (deg)";
    assert!(read(&format!("{header}\n{empty}"), TableSettings::default()).is_ok());
    // A part of the test, and an indentation.
    for header in ["Time (s),Phase,Stress (Pa),n,Strain (%)", "Time (s),delta,Stress (Pa),n,Strain (%)"] {
        assert!(read(&format!("{header}\n{rows}"), TableSettings::default()).is_ok(), "{header}");
    }
}

/// Two samples beside each other have equal names. A chosen time reads the columns beside it.
#[test]
fn a_chosen_time_reads_the_columns_beside_it() {
    let row = |k: i32| {
        let creep = |scale: f64| scale * (1.0 + f64::from(k)).ln();
        format!("{},10,{:.4},{},20,{:.4}\n", f64::from(k) * 0.5, creep(1.0), 3 * k, creep(4.0))
    };
    // The first sample has ten rows more.
    let more = |k: i32| format!("{},10,{:.4},,,\n", f64::from(k) * 0.5, (1.0 + f64::from(k)).ln());
    let text = "Time (s),Stress (Pa),Strain (%),Time (s),Stress (Pa),Strain (%)\n".to_string()
        + &(0..60).map(row).chain((60..70).map(more)).collect::<String>();
    let with =
        |time: &str| TableSettings { columns: [Some(time.into()), None, None, None], ..TableSettings::default() };
    for (time, stress_n, n_rows, duration_s) in [("1", 10.0, 70, 34.5), ("4", 20.0, 60, 177.0)] {
        let (_, experiment, _) = read(&text, with(time)).expect("one sample");
        let record = &experiment.record;
        // A stress of 1 Pa is read as 1 µN.
        assert!((1e6 * record.force_n[5] - stress_n).abs() < 1e-9, "{time}: {}", record.force_n[5]);
        assert_eq!(record.n_rows(), n_rows, "{time}");
        assert!((record.time_s[n_rows - 1] - record.time_s[0] - duration_s).abs() < 1e-9, "{time}");
    }
    let refusal = refused(&text, with("Time (s)"));
    assert!(refusal.contains("2 columns are called `Time (s)`"), "{refusal}");
    // The time need not be the first column of a sample, and a column may serve both.
    let row = |k: i32| format!("5,{k},{},50,{},{}\n", f64::from(k).sqrt(), 2 * k, f64::from(k));
    let rows = (0..60).map(row).collect::<String>();
    for (header, time, force_un, last_um) in [
        ("Force (uN),Time (s),Position (um),Force (uN),Time (s),Position (um)", "2", 5.0, 59_f64.sqrt()),
        ("Force (uN),Time (s),Position (um),Force (uN),Time (s),Position (um)", "5", 50.0, 59.0),
        ("Force (uN),Time (s),Position (um),n,Time (s),n2", "2", 5.0, 59_f64.sqrt()),
    ] {
        let (_, experiment, _) = read(&format!("{header}\n{rows}"), with(time)).expect(header);
        let record = &experiment.record;
        assert!((1e6 * record.force_n[5] - force_un).abs() < 1e-9, "{header} {time}: {}", record.force_n[5]);
        let range_um = 1e6 * (record.position_m[59].unwrap_or(0.0) - record.position_m[0].unwrap_or(0.0));
        assert!((range_um.abs() - last_um).abs() < 1e-6, "{header} {time}: {range_um}");
    }
}

/// A line above the table that only names the test decides between shear and tension, unless it is a setting.
#[test]
fn a_title_names_compression() {
    let table = "Time (s),Strain (%),Stress (Pa)\n".to_string()
        + &(0..60).map(|row| format!("{row},{:.4},2\n", f64::from(row + 1).ln())).collect::<String>();
    for (title, is_uniaxial) in [
        ("Unconfined compression of hydrogel", true),
        ("# Uniaxial tension, stress relaxation", true),
        ("Geometry: Compression plates", true),
        ("Bose ElectroForce 3200 tension", true),
        ("Instrument: DMA 850", true),
        ("Test: PDMAEMA hydrogel", false),
        ("Compression moulded PVA hydrogel", false),
        ("Shear creep of compression-molded disks", false),
        ("No tension applied before the test", false),
        ("Trimmed after compression", false),
        ("Compression set 0.2", false),
        ("Sample 3; surface tension 72 mN/m", false),
        ("Compression: 10 %", false),
        ("Geometry: parallel plate 25 mm", false),
        ("Lossless data compression", false),
        ("Preload: 0.1 N compression, then shear", false),
    ] {
        let (summary, ..) = read(&format!("{title}\n\n{table}"), TableSettings::default()).expect(title);
        let is_read_so = summary.reasons.iter().any(|reason| reason.contains("compliance_per_m = 1,"));
        assert_eq!(is_read_so, is_uniaxial, "{title}: {:?}", summary.reasons);
    }
}

/// A hold that is recorded from one interval after its step on began at time 0. The first force of a machine is then not its zero.
#[test]
fn a_hold_that_begins_one_interval_late_began_at_zero() {
    let stress = |t: f64| 1200.0 + 1800.0 * (-t / 5.0).exp();
    let of = |header: &str, strain: &str, factor: f64| {
        let rows: String = (1..=60)
            .map(|k| (k, f64::from(k) * 0.5))
            .map(|(_, t)| format!("{t},{strain},{:.5}\n", factor * stress(t)))
            .collect();
        read_without_sizes(&format!("{header}\n{rows}")).1
    };
    let rheometer = of("Time (s),Strain (%),Stress (Pa)", "5", 0.05);
    let machine = of("Gauge length: 20 mm\nArea: 10 mm2\nTime (s),Displacement (mm),Force (N)", "1", 0.05 * 1e-5);
    for experiment in [rheometer, machine] {
        assert_eq!(experiment.control, Control::Position);
        let record = &experiment.record;
        // The hold acts from time 0 on, half a second before the first measured row.
        let first = record.position_m.iter().position(Option::is_some).expect("a row");
        assert!((record.time_s[first] - 0.5).abs() < 1e-9 && record.force_n[0] != 0.0, "{}", record.time_s[first]);
    }
}

/// Stress and strain of a compression may have opposite signs. The moduli stay positive.
#[test]
fn opposite_signs_of_stress_and_strain_are_turned() {
    for (of_strain, of_stress) in [(1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0)] {
        let row = |k: i32| {
            let t = 0.05 * f64::from(k);
            let strain = 0.1 * t.min(0.5);
            format!("{t:.2},{},{}\n", of_strain * 100.0 * strain, of_stress * 1500.0 * strain * (-t / 20.0).exp())
        };
        let text = "Time (s),Strain (%),Stress (Pa)\n".to_string() + &(0..400).map(row).collect::<String>();
        let experiment = read(&text, TableSettings::default()).expect("a relaxation").1;
        assert_eq!(experiment.control, Control::Position);
        let record = &experiment.record;
        let product: f64 = record.force_n.iter().zip(&record.position_m).map(|(a, b)| a * b.unwrap_or(0.0)).sum();
        assert!(product > 0.0, "{of_strain} {of_stress}: {product}");
    }
}

/// A stress as a force over an area.
#[test]
fn a_force_over_an_area_is_a_stress() {
    let rows: String =
        (0..100).map(|row| format!("{:.1},{:.4},2\n", 0.1 * f64::from(row), f64::from(row).sqrt())).collect();
    let largest_n = |unit: &str| {
        let (_, experiment, _) =
            read(&format!("Time (s),Strain (%),Stress ({unit})\n{rows}"), TableSettings::default()).expect("a creep");
        experiment.record.force_n.iter().fold(0.0_f64, |most, x| most.max(*x))
    };
    let of_pa = largest_n("Pa");
    for (unit, pa) in [
        ("N/mm²", 1e6),
        ("N / mm2", 1e6),
        ("kN/m^2", 1e3),
        ("gf/cm2", 98.0665),
        ("DYN/CM2", 0.1),
        ("lbf/in²", 6_894.757_293),
    ] {
        assert!((largest_n(unit) / (pa * of_pa) - 1.0).abs() < 1e-9, "{unit}");
    }
}

/// Rows without a measured force are left out and counted, also if they are all rows of a table.
#[test]
fn rows_without_a_force_are_left_out() {
    let blanked =
        rows(|row, [t, f, x]| if row % 50 == 7 { format!("{t:.3},,{x:.3}") } else { format!("{t:.3},{f},{x:.3}") });
    let given = TableSettings { blank_force: Some("left-out".into()), ..TableSettings::default() };
    let (summary, experiment, _) =
        read(&format!("Time (s),Force (uN),Position (um)\n{blanked}"), given.clone()).expect("a record");
    assert!(
        summary.reasons.iter().any(|reason| reason.contains("12 rows have no measured force")),
        "{:?}",
        summary.reasons
    );
    assert_eq!(experiment.record.n_rows(), N_ROWS - 12);
    let empty: String = (0..60).map(|row| format!("{:.3},,1.0\n", 40.0 + 0.05 * f64::from(row))).collect();
    let header = "Time (s),Force (uN),Position (um)";
    let text = format!("{header}\n{}\n{header}\n{empty}", rows(|_, [t, f, x]| format!("{t:.3},{f},{x:.3}")));
    let given = TableSettings { tables: Some("all".into()), ..given };
    let (_, experiment, _) = read(&text, given).expect("the first table");
    assert_eq!(experiment.record.n_rows(), N_ROWS);
}

/// A bead at a place far from 0, whose motion is small and soon over while the force sinks a little, is no relaxation; nor is a creep whose strain does not vary more than its stress.
#[test]
fn a_hold_far_from_zero_is_no_relaxation() {
    let bead: String = (0..600)
        .map(|row| {
            let t = 0.1 * row as f64;
            let x = 512.0 + 10.0 * (1.0 - (-t).exp()) + 0.05 * noise(row);
            format!("{t:.1},{:.4},{x:.3}\n", 10.0 * (1.0 - 0.004 * t / 60.0) + 0.002 * noise(row + 700))
        })
        .collect();
    let (_, experiment, _) =
        read(&format!("Time (s),Force (uN),Position (um)\n{bead}"), TableSettings::default()).expect("a creep");
    assert_eq!(experiment.control, Control::Force);
    let gel: String = (0..200)
        .map(|row| {
            format!("{},{:.3},{:.4}\n", row + 1, 99.9 + 0.0005 * f64::from(row), 5.0 + 0.03 * noise(row as usize))
        })
        .collect();
    let (summary, experiment, _) =
        read(&format!("Time (s),Stress (Pa),Strain (%)\n{gel}"), TableSettings::default()).expect("a creep");
    assert_eq!(experiment.control, Control::Force, "{:?}", summary.reasons);
}

/// Lines above a table in quotation marks, with their values inside or behind.
#[test]
fn quoted_lines_state_sizes() {
    let body = rows(|_, [t, f, x]| format!("{t:.3},{:.6},{f}", 1e-3 * x));
    for (lines, length_mm) in [
        ("\"Gage length: 25 mm\"\n", "25"),
        ("\"Gage length:\",25,mm\n", "25"),
        ("\"Gage length, 25 mm\"\n", "25"),
        ("\"Gage length, standard travel\",25,\"mm\"\n\"Gage length, tolerance\",1,\"mm\"\n", "25"),
    ] {
        let text = format!("{lines}\"Cross-section\",12,\"mm²\"\n\nTime,Extension,Load\ns,mm,mN\n{body}");
        let (summary, ..) = read_without_sizes(&text);
        let is_said =
            summary.reasons.iter().any(|reason| reason.contains(&format!("{length_mm} mm long (from line 1")));
        assert!(is_said, "{lines} {:?}", summary.reasons);
    }
}

/// A sheet of testXpert: names in quotation marks with a comma, and a travel of the machine.
#[test]
fn sizes_of_a_testing_machine_are_read() {
    let text = format!(
        "\"Cross-section\",12,\"mm²\"\n\"Gage length, standard travel\",25,\"mm\"\n\n\"Time\",\"Standard travel\",\"Standard force\"\n\"s\",\"mm\",\"mN\"\n{}",
        rows(|_, [t, f, x]| format!("{t:.3},{:.6},{f}", 1e-3 * x))
    );
    let (summary, experiment, _) = read_without_sizes(&text);
    assert!(
        matches!(experiment.apparatus, Apparatus::Instrument { is_stress_strain: true, .. }),
        "{:?}",
        summary.reasons
    );
    assert!(summary.reasons.iter().any(|reason| reason.contains("25 mm long (from line 2")), "{:?}", summary.reasons);
}

/// A bead that is held from time 0 on and then brought back counts its positions from the zero of the table. A zero of its first row would lose the first step.
#[test]
fn a_hold_from_the_start_counts_from_zero() {
    let text: String = (0..400)
        .map(|row| {
            let t = 0.05 * f64::from(row);
            let (position, since) = if t < 10.0 { (1.0, t) } else { (0.0, t - 10.0) };
            let sign = if t < 10.0 { 1.0 } else { -0.6 };
            // The force of a row is that just before its position acts.
            let before = if row == 200 { 0.002 + 0.007 * (-10.0_f64 / 3.0).exp() } else { -2e-5 };
            let force = if row % 200 == 0 { before } else { sign * (0.002 + 0.007 * (-since / 3.0).exp()) };
            format!("{t:.2},{force:.6},{position}\n")
        })
        .collect();
    let (summary, experiment, _) =
        read(&format!("time (s),force (uN),position (um)\n{text}"), TableSettings::default()).expect("a relaxation");
    assert!(summary.reasons.iter().any(|reason| reason.contains("already that of the hold")), "{:?}", summary.reasons);
    assert_eq!(experiment.record.force_rule.name(), "hold");
    let record = &experiment.record;
    let ends = |of: &dyn Fn(f64, f64) -> f64, from: f64| record.force_n.iter().fold(from, |most, x| of(most, *x));
    assert!(
        (ends(&f64::max, 0.0) - 1e-6).abs() < 1e-15 && ends(&f64::min, 0.0).abs() < 1e-15,
        "{:?}",
        &record.force_n[..3]
    );
    assert_eq!(record.position_m[0], None, "the force of the first row depends on how the position rises");
}

/// A table of a sweep at several temperatures is refused, and leaves no folder; so is one with two columns of a modulus, or without a frequency.
#[test]
fn several_sweeps_in_one_table_are_refused() {
    let sweep = |factor: f64| -> String {
        (1..=20)
            .map(|row| {
                let f = 0.1 * f64::from(row);
                format!("{f:.1},{:.3},{:.3}\n", factor * (100.0 + f), factor * 10.0 * f)
            })
            .collect()
    };
    let folder = tempfile::tempdir().expect("a folder");
    let tried = |text: &str| {
        let (file, out) = (folder.path().join("a.csv"), folder.path().join("a"));
        std::fs::write(&file, text).expect("room on the disk");
        let request = InitRequest { file, out: Some(out.clone()), replace: true, ..InitRequest::default() };
        let tried = run(&request, &mut |_| None).map(|(summary, _)| summary.rows).map_err(|error| error.to_string());
        assert_eq!(out.exists(), tried.is_ok());
        let _ = std::fs::remove_dir_all(out);
        tried
    };
    let header = "Frequency [Hz],G' [Pa],G'' [Pa]\n";
    assert_eq!(tried(&format!("{header}{}", sweep(1.0))), Ok(20));
    // Repeats of one sweep differ by their scatter.
    assert_eq!(tried(&format!("{header}{}{}", sweep(1.0), sweep(1.05))), Ok(40));
    let refused = tried(&format!("{header}{}{}", sweep(1.0), sweep(4.0))).unwrap_err();
    assert!(refused.contains("these are several sweeps"), "{refused}");
    let twice = sweep(1.0).replace('\n', ",1,2\n");
    let refused = tried(&format!("Frequency [Hz],G' [Pa],G'' [Pa],G' [Pa],G'' [Pa]\n{twice}")).unwrap_err();
    assert!(refused.contains("2 columns are named as the storage"), "{refused}");
    let refused = tried(&format!("x,G' [Pa],G'' [Pa]\n{}", sweep(1.0))).unwrap_err();
    assert!(refused.contains("no column is named as a frequency"), "{refused}");
    // Names of other programs and languages.
    for header in [
        "Frequency(Hz),Shear modulus (elastic component)(Pa),Shear modulus (viscous component)(Pa)",
        "f en Hz,G' en Pa,G'' en Pa",
        "Fréquence [Hz],Module de Stockage [Pa],Module de Perte [Pa]",
        "Angular frequency [1/s],G' [Pa],G'' [Pa]",
    ] {
        assert_eq!(tried(&format!("{header}\n{}", sweep(1.0))), Ok(20), "{header}");
    }
    // A title before the names of the columns, which the rows have no cell for.
    let titled = format!("Interval data:,Frequency,Storage Modulus,Loss Modulus\n,[Hz],[Pa],[Pa]\n{}", sweep(1.0));
    assert_eq!(tried(&titled), Ok(20));
    // A column without cells at the end, with a name and a unit, does not shift the units.
    let with_status =
        format!("No.,Frequency,Storage Modulus,Loss Modulus,Status\n,[Hz],[kPa],[kPa],[1]\n{}", numbered(&sweep(1.0)));
    assert_eq!(tried(&with_status.replace(',', "\t")), Ok(20));
    let refused = tried(&format!("omega,G',G''\n{}", sweep(1.0))).unwrap_err();
    assert!(refused.contains("`unit_frequency rad/s`; `unit_moduli Pa`"), "{refused}");
}

/// Two sweeps beside each other have equal names. Chosen moduli have the frequency beside them, which the summary names by its number.
#[test]
fn chosen_moduli_read_the_frequency_beside_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("a.csv");
    let sweep = "omega [rad/s],G' [Pa],G'' [Pa]";
    let rows: String = (1..=12).map(|row| format!("{row},100,{row},{0},200,{0}\n", 10 * row)).collect();
    std::fs::write(&file, format!("{sweep},{sweep}\n{rows}")).expect("room on the disk");
    let out = folder.path().join("a");
    let moduli = Some(["5".to_string(), "6".to_string()]);
    let known_columns = TableSettings { moduli, ..TableSettings::default() };
    let request = InitRequest { file, out: Some(out.clone()), known_columns, ..InitRequest::default() };
    let (summary, _) = run(&request, &mut |_| None).expect("a sweep");
    assert_eq!(summary.columns[0].name, "column 4: omega [rad/s]");
    assert_eq!(summary.others[0], "column 1: omega [rad/s]");
    let (sweep, _) = OscillationRecord::read(&out).expect("a sweep");
    assert!((sweep.rows[0].frequency_hz - 10.0 / std::f64::consts::TAU).abs() < 1e-9);
}

/// Signals that are numbered above a table without a header, in their units; logarithms and multiples are no plain numbers, also if the user names them.
#[test]
fn names_of_moduli_say_what_their_numbers_are() {
    let folder = tempfile::tempdir().expect("a folder");
    let rows: String = (1..=20).map(|row| format!("{row}\t{row}\t0.1\t0.0{row:02}\n")).collect();
    let tried = |above: &str, moduli: Option<[&str; 2]>, frequency: Option<&str>| {
        let (file, out) = (folder.path().join("a.txt"), folder.path().join("a"));
        std::fs::write(&file, format!("{above}{rows}")).expect("room on the disk");
        let known_columns = TableSettings {
            moduli: moduli.map(|names| names.map(String::from)),
            frequency: frequency.map(String::from),
            ..TableSettings::default()
        };
        let request =
            InitRequest { file, out: Some(out.clone()), replace: true, known_columns, ..InitRequest::default() };
        run(&request, &mut |_| None).map_err(|error| error.to_string())?;
        Ok::<f64, String>(OscillationRecord::read(&out).expect("a sweep").0.rows[0].frequency_hz)
    };
    let signals = "Instrument\tDMA Q800\nNsig\t4\nSig1\tTime (min)\nSig2\tFrequency (Hz)\nSig3\tStorage Modulus (MPa)\nSig4\tLoss Modulus (MPa)\nStartOfData\n";
    assert_eq!(tried(signals, None, None), Ok(1.0));
    for (header, moduli, frequency, what) in [
        ("t\tFrequency (Hz)\tlog G' (Pa)\tlog G'' (Pa)\n", Some(["3", "4"]), None, "logarithms"),
        ("t\tFrequency (Hz)\tG' x10^3 (Pa)\tG'' x10^3 (Pa)\n", Some(["3", "4"]), None, "multiples"),
        ("t\tlog10 frequency (Hz)\tG' (Pa)\tG'' (Pa)\n", None, Some("2"), "logarithms"),
    ] {
        let refused = tried(header, moduli, frequency).unwrap_err();
        assert!(refused.contains(&format!("holds {what}")), "{refused}");
    }
}

/// Frequencies in Hz and in rad/s differ by 2π, but for their rounding. Otherwise the user chooses one of them.
#[test]
fn frequencies_that_contradict_each_other_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let tried = |factor: f64, frequency: Option<&str>| {
        let (file, out) = (folder.path().join("a.csv"), folder.path().join("a"));
        let row = |row: i32| format!("{:.2},{row},100,{row}\n", f64::from(row) / factor);
        let rows: String = (1..=20).map(row).collect();
        std::fs::write(&file, format!("Frequency (Hz),omega (rad/s),G' (Pa),G'' (Pa)\n{rows}")).expect("room");
        let known_columns = TableSettings { frequency: frequency.map(String::from), ..TableSettings::default() };
        let request = InitRequest { file, out: Some(out), replace: true, known_columns, ..InitRequest::default() };
        run(&request, &mut |_| None)
            .map(|(summary, _)| summary.columns[0].unit.clone())
            .map_err(|error| error.to_string())
    };
    assert_eq!(tried(std::f64::consts::TAU, None), Ok("Hz".into()));
    let refused = tried(1.0, None).unwrap_err();
    assert!(refused.contains("line 2") && refused.contains("different frequencies: 1 Hz and 1 rad/s"), "{refused}");
    assert!(refused.contains("frequency COLUMN`"), "{refused}");
    assert_eq!(tried(1.0, Some("omega (rad/s)")), Ok("rad/s".into()));
}

/// Viscosities and compliances of an oscillation are refused with the equations of the moduli, whether or not the user names them as moduli.
#[test]
fn viscosities_and_compliances_are_no_moduli() {
    let folder = tempfile::tempdir().expect("a folder");
    let rows: String = (1..=12).map(|row| format!("{row},100,{row}\n")).collect();
    for (names, found) in [
        ("eta' (Pa.s),eta'' (Pa.s)", "G' = ω η'' and G'' = ω η'"),
        ("η' [Pa],η'' [Pa]", "G' = ω η'' and G'' = ω η'"),
        ("J' (1/Pa),J'' (1/Pa)", "G' = J'/(J'² + J''²)"),
        ("storage compliance,loss compliance", "G' = J'/(J'² + J''²)"),
    ] {
        for moduli in [None, Some(["2".to_string(), "3".to_string()])] {
            let (file, out) = (folder.path().join("a.csv"), Some(folder.path().join("a")));
            std::fs::write(&file, format!("omega [rad/s],{names}\n{rows}")).expect("room on the disk");
            let known_columns = TableSettings { moduli, ..TableSettings::default() };
            let request = InitRequest { file, out, known_columns, ..InitRequest::default() };
            let refused = run(&request, &mut |_| None).unwrap_err().to_string();
            assert!(refused.contains(found), "{names}: {refused}");
        }
    }
}

/// Two of three tables of stress and strain are joined by their numbers.
#[test]
fn chosen_tables_of_stress_and_strain_are_joined() {
    let table = |from: f64, stress: f64| -> String {
        let rows: String = (1..=30)
            .map(|row| format!("{:.1}\t{stress}\t{:.4}\n", from + 0.5 * f64::from(row), 0.01 * f64::from(row)))
            .collect();
        format!("Interval\nTime\tShear Stress\tShear Strain\n[s]\t[Pa]\t[%]\n{rows}\n")
    };
    let text = [table(0.0, 2.0), table(15.0, 1.0), table(0.0, 5.0)].concat();
    let given = |tables: &str| TableSettings { tables: Some(tables.into()), ..TableSettings::default() };
    let (_, experiment, _) = read(&text, given("1,2")).expect("a creep");
    assert_eq!(experiment.record.position_m.iter().flatten().count(), 60);
    assert_eq!(read(&text, given("3")).expect("a creep").1.record.position_m.iter().flatten().count(), 30);
}

/// A table of a relaxation of time (s) and two quantities, written by `line` from time, strain and stress (Pa).
fn relaxed(header: &str, line: impl Fn(f64, f64, f64) -> String) -> String {
    let row = |row: usize| {
        let t = 0.5 * row as f64;
        line(t, 0.02 * (t / 2.0).min(1.0), 6.0 * (t / 2.0).min(1.0) * (0.6 + 0.4 * (-(t - 2.0).max(0.0) / 9.0).exp()))
            + "\n"
    };
    header.to_string() + "\n" + &(0..120).map(row).collect::<String>()
}

/// Runs `init` on a table, and returns the summary with the text of `experiment.toml`, or the refusal.
fn written(text: &str, request: InitRequest) -> Result<(InitSummary, String), String> {
    let folder = tempfile::tempdir().expect("a folder");
    let (file, out) = (folder.path().join("a.csv"), folder.path().join("a"));
    std::fs::write(&file, text).expect("room on the disk");
    let request = InitRequest { file, out: Some(out.clone()), ..request };
    let (summary, _) = run(&request, &mut |_| None).map_err(|error| error.to_string())?;
    Ok((summary, std::fs::read_to_string(out.join("experiment.toml")).expect("a description")))
}

/// Smallest and largest value of the column with a role, in s, µN or µm.
fn range_of(summary: &InitSummary, role: &str) -> [f64; 2] {
    let column = summary.columns.iter().find(|column| column.role == role);
    column.and_then(|column| column.range).unwrap_or_else(|| panic!("no {role}: {:?}", summary.columns))
}

#[test]
fn a_modulus_over_time_is_one_of_a_relaxation_only_if_something_says_so() {
    let table =
        |name: &str| relaxed(&format!("Time (s),{name}"), |t, _, stress| format!("{t},{}", 50.0 * stress + 1.0));
    let kind = |name: &str| written(&table(name), InitRequest::default());
    for name in ["Relaxation modulus (Pa)", "G(t) (Pa)", "E(t) [kPa]"] {
        assert!(kind(name).expect(name).1.contains("kind = \"relaxation\""), "{name}");
    }
    for name in ["Elastic modulus (Pa)", "Compressive modulus (kPa)"] {
        assert!(kind(name).expect_err(name).contains("sets, ages or dissolves"), "{name}");
        let told = InitRequest { control: Some(Control::Position), ..InitRequest::default() };
        assert!(written(&table(name), told).expect(name).1.contains("kind = \"relaxation\""), "{name}");
    }
    let swept = format!("Time sweep at 1 Hz and 1 % of strain\n{}", table("G(t) (Pa)"));
    assert!(written(&swept, InitRequest::default()).expect_err("a sweep").contains("sets, ages or dissolves"));
    for name in ["Indentation relaxation modulus (Pa)", "Relaxation modulus E* (Pa)"] {
        assert!(kind(name).expect_err(name).contains("E/(1 − ν²)"), "{name}");
    }
    let ratios = ["Relative relaxation modulus", "Reduced relaxation modulus", "G(t)/max", "Scaled relaxation modulus"];
    for name in ratios.into_iter().chain(["G(t)/G0", "Dimensionless relaxation modulus"]) {
        assert!(kind(name).expect_err(name).contains("relative to a value"), "{name}");
    }
    assert!(kind("10^-2 G(t) (Pa)").expect_err("a multiple").contains("holds multiples"));
    // The slash of a unit divides by no modulus.
    let compliance = relaxed("Time (s),Creep compliance [1/GPa]", |t, _, stress| format!("{t},{}", 9.0 - stress));
    written(&compliance, InitRequest::default()).expect("a compliance in 1/GPa");
}

/// Checks that the offset of a sensor is fitted, and that `check` finds it where it is not.
#[test]
fn the_offset_of_a_sensor_before_a_relaxation_is_fitted() {
    let table = |offset: f64, direction: f64| {
        let line = |row: usize| {
            let t = 0.1 * row as f64;
            let [strain, stress] = if t < 10.0 { [0.0, 0.0] } else { [5.0, 20.0 + 30.0 * (-(t - 10.0) / 4.0).exp()] };
            format!("{t:.1},{},{}\n", direction * strain, stress + offset + 0.05 * noise(row))
        };
        format!("Time (s),Strain (%),Stress (Pa)\n{}", (0..600).map(line).collect::<String>())
    };
    for (offset, direction) in [(7.0, 1.0), (-7.0, 1.0), (7.0, -1.0)] {
        let text = table(offset, direction);
        let (summary, experiment, files) =
            edited(&text, TableSettings::default(), str::to_string).expect("a relaxation");
        assert_eq!(experiment.control, Control::Position, "{offset}");
        assert!(
            experiment.fits_position_offset
                && summary.reasons.iter().any(|reason| reason.contains("its zero is fitted"))
        );
        let commanded = experiment.record.force_n.iter().fold(0.0_f64, |most, x| most.max(*x));
        assert!((commanded / experiment.record.force_n[300] - 1.0).abs() < 1e-9, "{offset}, {direction}");
        assert!(!kinds(&experiment, &files).contains(&"zero_off".to_string()), "{offset}");
        let unfitted = |toml: &str| toml.replace("zero = \"fit\"", "zero = \"first\"");
        let (_, experiment, files) = edited(&text, TableSettings::default(), unfitted).expect("a relaxation");
        assert!(kinds(&experiment, &files).contains(&"zero_off".to_string()), "{offset}");
    }
    let (_, experiment, files) =
        edited(&table(0.0, 1.0), TableSettings::default(), str::to_string).expect("a relaxation");
    assert!(!experiment.fits_position_offset && !kinds(&experiment, &files).contains(&"zero_off".to_string()));
}

#[test]
fn the_offset_of_a_force_at_rest_is_found() {
    let found = |offset_un: f64| {
        let rest =
            (0..50).map(|row| format!("{:.3},{offset_un},{:.3}\n", 0.05 * f64::from(row), noise(row as usize + 700)));
        let pulled = rows(|_, [t, f, x]| format!("{:.3},{},{x:.3}", t + 2.5, f + offset_un));
        let text = format!("Time (s),Force (uN),Position (um)\n{}{pulled}", rest.collect::<String>());
        let (_, experiment, files) = read(&text, TableSettings::default()).expect("a record");
        kinds(&experiment, &files).contains(&"force_off".to_string())
    };
    assert!(found(0.8) && found(-0.5) && !found(0.0));
    // A small force that has moved a body to its place is followed by a large one for a short time.
    let tail = |row: u32| {
        let (t, force) = (0.1 * f64::from(row), if row < 580 { 0.3 } else { 1.0 });
        let pulled = |since: f64| 20.0 * (1.0 - (-since.max(0.0) / 0.3).exp());
        format!("{t:.1},{force},{:.3}\n", 0.3 * pulled(t) + 0.7 * pulled(t - 58.0) + 0.02 * noise(row as usize))
    };
    let text = format!("Time (s),Force (uN),Position (um)\n{}", (0..600).map(tail).collect::<String>());
    let (_, experiment, files) = read(&text, TableSettings::default()).expect("a record");
    assert!(!kinds(&experiment, &files).contains(&"force_off".to_string()));
}

#[test]
fn shears_compliances_and_stresses_of_specimens_are_told_apart() {
    let specimen = [Some(25.0), Some(12.0)];
    let of = |text: &str, specimen| written(text, InitRequest { specimen, ..InitRequest::default() });
    // A stress beside an extension gives the same description of stress and strain as a force beside it.
    let by_stress = relaxed("Time (s),Tensile stress (MPa),Extension (mm)", |t, strain, stress| {
        format!("{t},{},{}", 1e-3 * stress, 25.0 * strain)
    });
    let by_force = relaxed("Time (s),Load (N),Extension (mm)", |t, strain, stress| {
        format!("{t},{},{}", 12e-3 * stress, 25.0 * strain)
    });
    let ranges = [&by_stress, &by_force].map(|text| {
        let (summary, toml) = of(text, specimen).expect("a relaxation");
        assert!(toml.contains("compliance_per_m = 1.0"), "{toml}");
        range_of(&summary, "stress")
    });
    assert!((ranges[0][1] / ranges[1][1] - 1.0).abs() < 1e-9, "{ranges:?}");
    let sheared = by_force.replace("Load (N),Extension", "Shear force (N),Shear displacement");
    assert!(of(&sheared, specimen).expect_err("a shear").contains("divided by its gap"));
    // A compliance is no strain.
    let compliance = relaxed("Time (s),Shear stress (Pa),Compliance (1/Pa)", |t, strain, _| format!("{t},10,{strain}"));
    assert!(of(&compliance, [None; 2]).expect_err("a compliance").contains("is no strain"));
    let machine = by_force.replace("Extension (mm)", "Extension (mm),Stress (kPa),Machine compliance (mm/N)");
    of(&machine.replace('\n', ",1,0.001\n").replacen(",1,0.001\n", "\n", 1), specimen).expect("a machine's compliance");
    let material = relaxed("t (s),Sforzo concentrazione 2% (Pa),Deformazione [1]", |t, strain, stress| {
        format!("{t},{stress},{strain}")
    });
    assert!(of(&material, [None; 2]).expect("a shear").1.contains("compliance_per_m = 3.0"));
    let alone = relaxed("Time (s),Compliance (1/Pa)", |t, strain, _| format!("{t},{strain}"));
    of(&alone, [None; 2]).expect("the remedy");
    for name in [
        "引張応力 (Pa)",
        "压缩应力 (Pa)",
        "Sforzo di trazione (Pa)",
        "Esfuerzo de tracción (Pa)",
        "Сжимающее напряжение (Pa)",
    ] {
        let text = relaxed(&format!("t (s),{name},Strain [1]"), |t, strain, stress| format!("{t},{stress},{strain}"));
        assert!(of(&text, [None; 2]).expect(name).1.contains("compliance_per_m = 1.0"), "{name}");
    }
    let parts =
        relaxed("Time (s),Stress (Pa),Strain (µm/mm)", |t, strain, stress| format!("{t},{stress},{}", 1e3 * strain));
    assert!(of(&parts, [None; 2]).expect("a strain").1.contains("position = \"0.001 m\""));
}

#[test]
fn samples_beside_an_empty_column_belong_to_their_time() {
    let text = relaxed("Time [s],Stress [Pa],Strain [%],,Time [s],Stress [Pa],Strain [%]", |t, strain, stress| {
        format!("{t},{stress},{},,{t},{},{}", 100.0 * strain, 3.0 * stress, 200.0 * strain)
    });
    let told = |time: &str| TableSettings { columns: [said(time), None, None, None], ..TableSettings::default() };
    let stress = |time: &str| {
        let request = InitRequest { known_columns: told(time), ..InitRequest::default() };
        range_of(&written(&text, request).expect(time).0, "stress")[1]
    };
    assert!((stress("5") / stress("1") - 3.0).abs() < 1e-9);
}

#[test]
fn forces_that_mean_a_missing_value_are_refused() {
    let table = |mark: &str| {
        let force = |row: usize, force: f64| if [50, 51, 320].contains(&row) { mark.into() } else { force.to_string() };
        format!(
            "Time (s),Force (uN),Position (um)\n{}",
            rows(|row, [t, f, x]| format!("{t:.3},{},{x:.3}", force(row, f)))
        )
    };
    for mark in ["-9999", "99999", "-999.0"] {
        let refused = refused(&table(mark), TableSettings::default());
        assert!(refused.contains("line 52, `Force (uN)`") && refused.contains("means a missing value"), "{refused}");
    }
    let told = TableSettings { blank_force: Some("above".into()), ..TableSettings::default() };
    assert_is_truth(&table(""), told);
    let pulse =
        |row: usize, x: f64| format!("{:.2},{},{x:.3}\n", 0.05 * row as f64, if row % 100 < 15 { 999 } else { 0 });
    let pulses: String = truth().iter().enumerate().map(|(row, [_, _, x])| pulse(row, *x)).collect();
    read(&format!("Time (s),Force (nN),Position (um)\n{pulses}"), TableSettings::default()).expect("pulses of 999 nN");
}

#[test]
fn columns_of_one_name_are_chosen_by_their_number() {
    let text = relaxed("Time (s),Shear stress (Pa),Shear strain (%),Shear strain (%)", |t, strain, stress| {
        format!("{t},{stress},{},{}", 130.0 * strain, 100.0 * strain)
    });
    let refusal = written(&text, InitRequest::default()).expect_err("two strains");
    assert!(refusal.contains("2 columns are called `Shear strain (%)`: those with the numbers 3, 4"), "{refusal}");
    let known_columns = TableSettings { columns: [None, None, said("4"), None], ..TableSettings::default() };
    let (summary, _) = written(&text, InitRequest { known_columns, ..InitRequest::default() }).expect("the second");
    let [_, largest] = range_of(&summary, "strain");
    assert!((largest / 2e4 - 1.0).abs() < 1e-9, "{:?}", summary.columns);
}

#[test]
fn an_extension_that_is_not_the_strain_is_chosen() {
    let table = |compliant: f64| {
        let header = "Gauge length: 50 mm\nCross-section: 20 mm^2\nTime (s),Load (N),Extension (mm),Strain 1 (%)";
        relaxed(header, |t, strain, stress| format!("{t},{stress},{},{}", 50.0 * compliant * strain, 100.0 * strain))
    };
    written(&table(1.0), InitRequest::default()).expect("both are equal");
    let refusal = written(&table(1.25), InitRequest::default()).expect_err("another extension");
    assert!(refusal.contains("changes by 1.25 mm") && refusal.contains("by 1.00 mm"), "{refusal}");
    let largest = |name: &str| {
        let known_columns = TableSettings { columns: [None, None, said(name), None], ..TableSettings::default() };
        let request = InitRequest { known_columns, ..InitRequest::default() };
        range_of(&written(&table(1.25), request).expect(name).0, "strain")[1]
    };
    let ratio = largest("Extension (mm)") / largest("Strain 1 (%)");
    assert!((ratio - 1.25).abs() < 1e-9, "{ratio}");
    // A strain that is measured across the axis, or that is no small one, shows nothing of the extension.
    let beside = table(1.25).replace("Strain 1 (%)", "Shear strain (%)");
    written(&beside, InitRequest::default()).expect("another strain");
}

/// A commanded force of a tip jumps, and a limit of a drive is no force.
#[test]
fn a_commanded_force_of_a_tip_holds() {
    let creep = |t: f64| 900.0 * (1.0 - 0.5 * (-t / 3.0).exp());
    let tip = |ramp: [f64; 2]| {
        let line = |row: usize| {
            let t = 0.1 * row as f64;
            let load = ramp.get(row).copied().unwrap_or(0.02);
            let depth = if row == 0 { 0.0 } else { creep(t) };
            format!("{t:.1},{load},{depth:.1}\n")
        };
        "Tip radius: 50 um\nTime (s),Load (uN),Indentation (nm)\n".to_string() + &(0..200).map(line).collect::<String>()
    };
    let is_linear =
        |text: &str| written(text, InitRequest::default()).expect("a tip").1.contains("\nforce = \"linear\"");
    assert!(!is_linear(&tip([0.0, 0.02])));
    assert!(is_linear(&tip([0.0, 0.0191])), "the end of a ramp");
    let drive =
        rows(|row, [t, f, x]| format!("{t:.2},9.2,{},{x:.1}", if f > 0.0 { 50 } else { 0 } + usize::from(row > 900)));
    let refusal = written(&format!("time (s),Max force (uN),Output (%),x (um)\n{drive}"), InitRequest::default());
    assert!(refusal.expect_err("no force").contains("no column name suggests a force"));
}
