//! Tables whose first rows do not show when the load or the step began, or whose clock, samples or units can be misread. The truths are closed forms.

use std::fmt::Write as _;

use vitreo_uq::intake::{InitRequest, run};
use vitreo_uq::record::table::TableSettings;
use vitreo_uq::record::{Control, Experiment, ForceRule, OscillationRecord};

/// Applies `init` to a table, and returns the record with the words of the summary, or the refusal.
fn read(text: &str, change: impl Fn(&mut InitRequest)) -> Result<(Experiment, String), String> {
    let folder = tempfile::tempdir().expect("a folder");
    let (file, out) = (folder.path().join("a.csv"), folder.path().join("a"));
    std::fs::write(&file, text).expect("room on the disk");
    let sizes = [Some(0.55), Some(20.0), Some(0.48)];
    let mut request = InitRequest { file, out: Some(out.clone()), sizes, ..InitRequest::default() };
    change(&mut request);
    let (summary, _) = run(&request, &mut |_| None).map_err(|error| error.to_string())?;
    let (experiment, _) = Experiment::read(&out).map_err(|error| error.to_string())?;
    Ok((experiment, summary.reasons.join("\n")))
}

fn plainly(text: &str) -> Result<(Experiment, String), String> {
    read(text, |_| ())
}

/// Strain (%) of a Kelvin–Voigt body with a retardation time of 3 s, `t` s after its load.
fn crept(t: f64) -> f64 {
    1.0 - (-t / 3.0).exp()
}

/// Stress (Pa) of a standard linear solid, `t` s after a strain of 1 %.
fn relaxed(t: f64) -> f64 {
    12.0 + 18.0 * (-t / 5.0).exp()
}

/// Creep under 3 Pa, with rows every 0.5 s from `first_s` on.
fn creep_from(first_s: f64) -> String {
    let mut text = String::from("Time (s),Shear stress (Pa),Shear strain (%)\n");
    for row in 0..60 {
        let t = first_s + 0.5 * f64::from(row);
        writeln!(text, "{t},3,{:.6}", crept(t)).expect("a string");
    }
    text
}

/// Times (s) between the load and the rows with a position.
fn times_since_load(experiment: &Experiment) -> Vec<f64> {
    let record = &experiment.record;
    let first = record.force_n.iter().position(|force| *force != 0.0).expect("a load");
    let known = record.time_s.iter().zip(&record.position_m).filter(|(_, x)| x.is_some());
    known.map(|(time, _)| time - record.time_s[first]).collect()
}

fn told(text: &str, load_start: &str) -> Result<(Experiment, String), String> {
    read(text, |request| request.load_start = Some(load_start.into()))
}

fn of_second_table(text: &str) -> Result<(Experiment, String), String> {
    read(text, |request| request.known_columns.tables = Some("2".into()))
}

#[test]
fn a_creep_without_its_first_rows_asks_when_it_began() {
    let (experiment, words) = plainly(&creep_from(0.5)).expect("a creep");
    assert!((times_since_load(&experiment)[0] - 0.5).abs() < 1e-6, "{words}");
    for first_s in [1.0, 2.0, 6.0] {
        let refused = plainly(&creep_from(first_s)).expect_err("a question");
        assert!(refused.contains("load_start 0` if it began at time 0, `load_start first`"), "{refused}");
        let last = (first_s - 0.5).to_string();
        for (answer, since_s) in [("0", first_s), (last.as_str(), 0.5), ("first", 0.0)] {
            let (experiment, _) = told(&creep_from(first_s), answer).expect("a creep");
            assert!((times_since_load(&experiment)[0] - since_s).abs() < 1e-6, "{first_s} {answer}");
        }
    }
    for wrong in ["7", "nan", "soon"] {
        assert!(told(&creep_from(6.0), wrong).expect_err("no time").contains("no time up to the first row"), "{wrong}");
    }
    // A clock below 0 is shifted by the reader, and answers count on the table's clock.
    let (experiment, _) = told(&creep_from(-3.0), "-4").expect("a creep");
    assert!((times_since_load(&experiment)[0] - 1.0).abs() < 1e-6);
    // Another clock says nothing of the load.
    assert!(plainly(&creep_from(1000.0)).is_ok());
}

#[test]
fn a_bead_without_its_first_rows_asks_unless_other_switches_show_its_load() {
    let bead = |position: &dyn Fn(f64) -> f64, force: &dyn Fn(f64) -> f64| {
        let mut text = String::from("Time (s),Force (uN),Position (um)\n");
        for row in 0..240 {
            let t = 0.05 * f64::from(row);
            writeln!(text, "{:.2},{},{:.3}", t + 0.5, force(t), position(t)).expect("a string");
        }
        text
    };
    let late = bead(&|t| 515.0 + 210.0 * crept(t), &|_| 4.6);
    assert!(plainly(&late).expect_err("a question").contains("when it began"));
    let (experiment, _) = told(&late, "0").expect("a creep");
    assert!((times_since_load(&experiment)[0] - 0.5).abs() < 1e-6);
    // From rest, as after the next switches, in the coordinates of a camera.
    let switched = |t: f64| {
        (0..6)
            .filter(|k| t > 2.0 * f64::from(*k))
            .map(|k| (1.0 - 2.0 * f64::from(k % 2)) * crept(t - 2.0 * f64::from(k)))
            .sum::<f64>()
    };
    let fresh = bead(&|t| 512.0 + 210.0 * switched(t), &|t| {
        if ((t / 2.0 + 1e-9) as u32).is_multiple_of(2) { 4.6 } else { 0.0 }
    });
    let (experiment, words) = plainly(&fresh).expect("a creep");
    assert!(times_since_load(&experiment)[0].abs() < 1e-6, "{words}");
}

/// A first row of zeros: the stress of the second row acted before it, because the specimen has moved.
#[test]
fn a_first_row_of_zeros_is_the_begin_of_a_creep() {
    let with = |second: f64| {
        let mut text = String::from("Time (s),Shear stress (Pa),Shear strain (%)\n0,0,0\n");
        for row in 1..60 {
            let t = 0.5 * f64::from(row);
            writeln!(text, "{t},3,{:.6}", second * crept(t)).expect("a string");
        }
        plainly(&text).expect("a creep")
    };
    let (experiment, words) = with(1.0);
    assert!((times_since_load(&experiment)[0] - 0.5).abs() < 1e-6, "{words}");
    assert!(!experiment.fits_position_offset && words.contains("are left out"), "{words}");
    let known: Vec<f64> = experiment.record.position_m.iter().copied().flatten().collect();
    assert!((known[0] / known[58] / (crept(0.5) / crept(29.5)) - 1.0).abs() < 1e-5, "{known:?}");
    // A strain that jumps with the second row is an answer at once, which that row shows.
    let jump: String = (1..60)
        .map(|row| 0.5 * f64::from(row))
        .fold(String::new(), |all, t| all + &format!("{t},3,{:.6}\n", 1.0 + crept(t)));
    let (experiment, words) =
        plainly(&format!("Time (s),Shear stress (Pa),Shear strain (%)\n0,0,0\n{jump}")).expect("a creep");
    assert!((times_since_load(&experiment)[0] - 0.5).abs() < 1e-6 && words.contains("are left out"), "{words}");
    // A bead whose force acts from the second row on has not moved there.
    let mut text = String::from("Time (s),Force (uN),Position (um)\n0,0,0.2\n");
    for row in 1..60 {
        let t = 0.5 * f64::from(row - 1);
        writeln!(text, "{},4.6,{:.3}", t + 0.5, 210.0 * crept(t) + 0.3 * f64::from(row % 3)).expect("a string");
    }
    let (experiment, words) = plainly(&text).expect("a creep");
    assert!(times_since_load(&experiment)[1].abs() < 1e-6 && !words.contains("are left out"), "{words}");
}

/// Rows before a trigger at time 0, and a step whose rows begin 0.1 s after it: the strain does not rise from the last row before.
#[test]
fn a_step_at_the_trigger_is_no_ramp() {
    let mut text = String::from("Time (s),Shear strain (%),Shear stress (Pa)\n");
    for row in 0..10 {
        writeln!(text, "{},0,0.0{row}", -20 + 2 * row).expect("a string");
    }
    for row in 0..200 {
        let t = 0.1 * 1.03_f64.powi(row);
        writeln!(text, "{t:.5},1,{:.5}", relaxed(t)).expect("a string");
    }
    let (experiment, words) = plainly(&text).expect("a relaxation");
    let record = &experiment.record;
    assert!((record.time_s[1] - 0.1).abs() < 1e-6 && record.n_rows() == 201, "{words}");
    let holds = |experiment: &Experiment| {
        let strains = &experiment.record.force_n;
        strains[0] > 0.0 && strains.iter().all(|strain| strain == &strains[0])
    };
    assert!(holds(&experiment), "{words}");
    // The row of the step has the stress before it.
    let (experiment, words) = plainly(&text.replace("0.10000,", "0,1,0\n0.10000,")).expect("a relaxation");
    assert!(experiment.record.force_n[9..12].iter().map(|strain| *strain > 0.0).eq([false, true, true]), "{words}");
    assert!(experiment.control == Control::Position && words.contains("command = \"hold\""), "{words}");
    let after = text.find("0.10000,").expect("the first row of the hold");
    let at_once = format!("Time (s),Shear strain (%),Shear stress (Pa)\n-1,0,0\n0,1,0\n{}", &text[after..]);
    let (_, words) = plainly(&at_once).expect("a relaxation");
    assert!(words.contains("the strain jumps, and the stress answers in the row after"), "{words}");
    // The same in two tables of one file.
    let lines: Vec<&str> = text.lines().collect();
    let [header, rest, hold] = [&lines[..1], &lines[1..11], &lines[11..]].map(|part| part.join("\n"));
    let (experiment, words) =
        plainly(&format!("Rest\n{header}\n{rest}\n\nHold\n{header}\n{hold}\n")).expect("a relaxation");
    assert!(experiment.record.n_rows() == 201 && holds(&experiment), "{words}");
    // The same with a bead, whose position then counts as written.
    let bead = text.replace("Shear strain (%)", "Position (um)").replace("Shear stress (Pa)", "Force (uN)");
    let (experiment, words) = plainly(&bead).expect("a relaxation");
    assert!((experiment.record.time_s[1] - 0.1).abs() < 1e-6 && holds(&experiment), "{words}");
    // A machine's noise before the step does not reverse its sign.
    let machine =
        "Gauge length: 10 mm\nArea: 100 mm²\nTime (s),Displacement (mm),Load (mN)\n-1,0,0.02\n-0.5,0,0.03\n0,0,-0.02\n";
    let rows: String = (0..150)
        .map(|row| 0.1 * 1.03_f64.powi(row))
        .fold(String::new(), |all, t| all + &format!("{t:.5},0.5,{:.5}\n", relaxed(t)));
    let (experiment, words) = plainly(&format!("{machine}{rows}")).expect("a relaxation");
    assert!(!words.contains("direction"), "{words}");
    assert!(holds(&experiment), "{words}");
}

#[test]
fn a_clock_of_two_parts_is_what_its_name_says() {
    let table = |name: &str, cell: &dyn Fn(u32) -> String| {
        let mut text = format!("{name},Shear strain (%),Shear stress (Pa)\n");
        for row in 0..40 {
            writeln!(text, "{},1,{:.5}", cell(row), relaxed(0.2 * f64::from(row + 1))).expect("a string");
        }
        text
    };
    let interval = |text: &str| {
        let record = plainly(text).expect("a relaxation").0.record;
        record.time_s[record.n_rows() - 1] - record.time_s[record.n_rows() - 2]
    };
    let two = |row: u32| format!("00:{:02}", row + 1);
    assert_eq!(interval(&table("Time (hh:mm)", &two)), 60.0);
    for name in ["Time (mm:ss)", "Time (h:mm:ss)", "Time (min)", "Elapsed time"] {
        assert_eq!(interval(&table(name, &two)), 1.0, "{name}");
    }
    assert_eq!(interval(&table("Time (h)", &two)), 60.0);
    assert_eq!(
        interval(&table("Time of day", &|row| format!("{}:{:02}", 23 * u32::from(row < 20), (row + 40) % 60))),
        60.0
    );
    assert_eq!(interval(&table("Time", &|row| format!("2:{:02} PM", row + 6))), 60.0);
    assert_eq!(interval(&table("Time", &|row| format!("2026-11-22 10:{:02}", row + 6))), 60.0);
    let refused = plainly(&table("Time", &two)).expect_err("a question");
    assert!(refused.contains("unit_time hh:mm` or `unit_time mm:ss"), "{refused}");
    let of_unit = |unit: &str| {
        let given = TableSettings { units: [Some(unit.into()), None, None], ..TableSettings::default() };
        read(&table("Time", &two), |request| request.known_columns = given.clone()).expect("a relaxation").0.record
    };
    assert_eq!(of_unit("hh:mm").time_s[2] - of_unit("hh:mm").time_s[1], 60.0);
    assert_eq!(of_unit("mm:ss").time_s[2] - of_unit("mm:ss").time_s[1], 1.0);
    // An elapsed time keeps its zero; a time of day counts from the first row, and its step is just before that row, which is left out.
    let from_1 = |name: &str| table(name, &|row| format!("00:00:{:02}", 1 + row));
    let first_s = |text: &str| {
        let record = plainly(text).expect("a relaxation").0.record;
        let held = record.position_m.iter().position(Option::is_some).expect("a stress");
        record.time_s[held]
    };
    assert!((first_s(&from_1("Elapsed time (hh:mm:ss)")) - 1.0).abs() < 1e-6);
    assert!((first_s(&from_1("Time of day")) - 1.0).abs() < 1e-6);
    let stress =
        |name: &str| plainly(&from_1(name)).expect("a relaxation").0.record.position_m.into_iter().flatten().next();
    assert_ne!(stress("Elapsed time (hh:mm:ss)"), stress("Time of day"));
}

/// Two samples in turn, whose strains are equal: their stresses tell them apart.
#[test]
fn samples_in_turn_are_not_spread_over_the_clock() {
    let mut text = String::from("Sample,Time (s),Shear strain (%),Shear stress (Pa)\n");
    for row in 0..60 {
        let t = 0.1 * 1.07_f64.powi(row);
        writeln!(text, "ctrl,{t:.4},1,{:.5}\ntreated,{t:.4},1,{:.5}", relaxed(t), 0.8 * relaxed(t)).expect("a string");
    }
    let refused = plainly(&text).expect_err("several samples");
    assert!(refused.contains("several tracks"), "{refused}");
}

/// Sweeps of a Maxwell body at two temperatures, whose moduli differ by a factor; repeats within 3 % are one sweep.
#[test]
fn sweeps_that_differ_alike_are_several() {
    let sweep = |factor: f64| {
        let mut text = String::from("Frequency [Hz],Temperature [°C],G' [Pa],G'' [Pa]\n");
        for row in 0..12_i32 {
            let x = 0.1 * 1.6_f64.powi(row);
            for (place, scale) in [1.0, factor].into_iter().enumerate() {
                let scale = scale * (1.0 + 0.01 * f64::from((row * 7 + place as i32 * 3) % 5 - 2));
                writeln!(
                    text,
                    "{x:.5},{},{:.3},{:.3}",
                    25 + 10 * place,
                    scale * 1200.0 * x * x / (1.0 + x * x),
                    scale * 1200.0 * x / (1.0 + x * x)
                )
                .expect("a string");
            }
        }
        let folder = tempfile::tempdir().expect("a folder");
        let (file, out) = (folder.path().join("a.csv"), folder.path().join("a"));
        std::fs::write(&file, text).expect("room on the disk");
        let request = InitRequest { file, out: Some(out.clone()), ..InitRequest::default() };
        run(&request, &mut |_| None).map_err(|error| error.to_string())?;
        OscillationRecord::read(&out).map(|_| ()).map_err(|error| error.to_string())
    };
    assert!(sweep(0.8).expect_err("two sweeps").contains("at each of them"));
    assert!(sweep(1.15).expect_err("two sweeps").contains("at each of them"));
    assert_eq!((sweep(1.0), sweep(1.05)), (Ok(()), Ok(())));
}

#[test]
fn names_of_young_s_quantities_and_of_changed_numbers_are_read() {
    let table = |header: &str, value: &dyn Fn(f64) -> f64| {
        let mut text = format!("{header}\n");
        for row in 1..60 {
            let t = 0.2 * f64::from(row);
            writeln!(text, "{t:.2},{:.6}", value(t)).expect("a string");
        }
        plainly(&text)
    };
    let modulus = |t: f64| 100.0 * relaxed(t);
    let (_, words) = table("Time (s),Relaxation modulus E(t) [Pa]", &modulus).expect("a relaxation");
    assert!(words.contains("compliance_per_m = 1,"), "{words}");
    let (_, words) = table("Time (s),Creep compliance D(t) (1/Pa)", &crept).expect("a creep");
    assert!(words.contains("compliance_per_m = 1,"), "{words}");
    let (_, words) = table("Time (s),Relaxation modulus G(t) [Pa]", &modulus).expect("a relaxation");
    assert!(words.contains("compliance_per_m = 2.96"), "{words}");
    for header in [
        "Time (s),Relaxation modulus gel E (Pa)",
        "Time (s),Relaxation modulus G(t) group E (Pa)",
        "Time (s),Normal relaxation modulus (Pa)",
    ] {
        let (_, words) = table(header, &modulus).expect("a relaxation");
        assert!(words.contains("compliance_per_m = 2.96"), "{words}");
    }
    assert!(table("t (s),G(t)/G0", &modulus).expect_err("a ratio").contains("relative to a value"));
    assert!(table("t [s],J(t)·1e3 [1/Pa]", &modulus).expect_err("multiples").contains("multiples"));
    for unit in ["% of L0", "in %", "%, engineering"] {
        assert!(
            plainly(&creep_from(0.0).replace("Shear strain (%)", &format!("\"Shear strain ({unit})\""))).is_ok(),
            "{unit}"
        );
    }
    for unit in ["%/100", "m%"] {
        let text = creep_from(0.0).replace("Shear strain (%)", &format!("Shear strain ({unit})"));
        assert!(plainly(&text).expect_err("a question").contains("is not known"), "{unit}");
    }
    // A relaxation at a stretch of 1.05 is none at a strain of 105 %.
    let mut text = String::from("Time (s),Strain,Stress (Pa)\n0,1,0\n");
    (1..60)
        .map(|row| 0.1 * f64::from(row))
        .for_each(|t| writeln!(text, "{t:.2},1.05,{:.5}", relaxed(t)).expect("a string"));
    assert!(plainly(&text).expect_err("a question").contains("a stretch that begins at 1"));
    let given = TableSettings { units: [None, None, Some("1".into())], ..TableSettings::default() };
    let (_, words) = read(&text, |request| request.known_columns = given.clone()).expect("a relaxation");
    assert!(words.contains("read as a stretch") && words.contains("compliance_per_m = 1,"), "{words}");
}

/// A creep after rows at rest, whose clock counts from the step and whose rows grow sparser: the load began at 0, not with its first row. Evenly spaced rows after several at rest do not show it.
#[test]
fn a_load_at_the_trigger_began_at_zero() {
    let with = |before: &[f64], after: &dyn Fn(i32) -> f64| {
        let mut text = String::from("Time (s),Shear stress (Pa),Shear strain (%)\n");
        for t in before {
            writeln!(text, "{t},0,0").expect("a string");
        }
        for row in 0..120 {
            let t = after(row);
            writeln!(text, "{t:.5},5,{:.6}", 0.5 + crept(t)).expect("a string");
        }
        plainly(&text).expect("a creep")
    };
    let grows = |row: i32| 0.1 * 1.06_f64.powi(row);
    for before in [&[0.0][..], &[-4.0, -3.0, -2.0, -1.0, 0.0], &[-4.0, -3.0, -2.0, -1.0]] {
        let (experiment, words) = with(before, &grows);
        assert!((times_since_load(&experiment)[0] - 0.1).abs() < 1e-6, "{before:?} {words}");
        assert!(!experiment.fits_position_offset, "{before:?} {words}");
    }
    let (experiment, words) = with(&[0.0], &|row| 0.1 * f64::from(row + 1));
    assert!((times_since_load(&experiment)[0] - 0.1).abs() < 1e-6, "{words}");
    let (experiment, words) = with(&[-0.2, -0.1, 0.0], &|row| 0.1 * f64::from(row + 1));
    assert!(times_since_load(&experiment)[3].abs() < 1e-6, "{words}");
}

/// The first strain of a rheometer's creep is the gel's answer at once, and no zero to be fitted: the law that made the record is found.
#[test]
fn the_first_strain_of_a_rheometer_is_no_zero() {
    let mut text = String::from("Time\tStrain\tStress\ns\t%\tPa\n");
    for row in 0..120 {
        let t = 0.1 * 1.0655_f64.powi(row);
        // 5 Pa on springs of 1000 Pa and 500 Pa in shear, the second with a dashpot beside it.
        let strain = 0.5 + 1.0 - (-t / 5.0).exp();
        writeln!(text, "{t:.4}\t{strain:.5}\t5").expect("a string");
    }
    let (experiment, words) = plainly(&text).expect("a creep");
    assert!(!experiment.fits_position_offset && words.contains("the gel's instantaneous answer"), "{words}");
    let first = *experiment.record.position_m.iter().flatten().next().expect("a strain");
    // A strain of 1 % is kept as 1 µm.
    assert!((1e6 * first - (1.5 - (-0.02_f64).exp())).abs() < 1e-4, "{first} {words}");
    // Strains against the stress keep their zero, too.
    let against = text.replace("\t5\n", "\t-5\n");
    let (experiment, words) = plainly(&against).expect("a creep");
    let first = *experiment.record.position_m.iter().flatten().next().expect("a strain");
    assert!(!experiment.fits_position_offset && (first * experiment.record.force_n[119]) > 0.0, "{first} {words}");
}

/// Rest, creep and recovery of a rheometer, whose clock counts from the begin of each step, in one table beside another clock or in three: stresses begin where steps do.
#[test]
fn a_stress_begins_with_its_step() {
    let begins_s = [0.0, 10.0, 70.0];
    let strain = |t: f64| [10.0, 70.0].map(|begin: f64| crept((t - begin).max(0.0)));
    let rows = |step: usize| -> Vec<[f64; 4]> {
        let (n_rows, interval_s) = if step == 0 { (10, 1.0) } else { (120, 0.5) };
        (1..=n_rows)
            .map(|row| {
                let since_s = interval_s * f64::from(row);
                let [up, down] = strain(begins_s[step] + since_s);
                [begins_s[step] + since_s, since_s, if step == 1 { 3.0 } else { 0.0 }, up - down]
            })
            .collect()
    };
    let line = |[t, since_s, stress, strain]: [f64; 4]| format!("{t:.2},{since_s:.2},{stress},{strain:.6}\n");
    let one: String = (0..3).flat_map(|step| rows(step).into_iter().map(line)).collect();
    let table = |step: usize| {
        let rows: String = rows(step).into_iter().map(line).collect();
        format!("Interval {}\nTime [s],Interval Time [s],Shear Stress [Pa],Shear Strain [%]\n{rows}\n", step + 1)
    };
    let several = (0..3).map(table).collect::<String>();
    for text in [format!("t in s,t_seg in s,Stress in Pa,Strain in %\n{one}"), several] {
        let (experiment, words) = plainly(&text).expect("a creep");
        let record = &experiment.record;
        let switches: Vec<f64> = record.force_step_rows().into_iter().map(|row| record.time_s[row]).collect();
        assert!(words.contains("force_acts = \"until-row\""), "{words}");
        assert_eq!(record.n_samples(), 250, "{words}");
        assert!(
            switches.len() == 2 && (switches[0] - 10.0).abs() < 1e-9 && (switches[1] - 70.0).abs() < 1e-9,
            "{switches:?}"
        );
    }
    // A single step has no other clock, and its load began at the 0 of its own.
    let single: String = rows(1).into_iter().map(line).collect();
    let (experiment, words) =
        plainly(&format!("t in s,t_seg in s,Stress in Pa,Strain in %\n{single}")).expect("a creep");
    assert!((times_since_load(&experiment)[0] - 0.5).abs() < 1e-6 && !words.contains("force_acts"), "{words}");
}

/// Ten seconds between rows follow a rest with one: the clock of the steps does not fall. Of several tables, the last one alone can be read.
#[test]
fn a_clock_of_steps_may_not_fall() {
    let mut text = String::from("Time [s],Interval Time [s],Shear Stress [Pa],Shear Strain [%]\n");
    for row in 1..6 {
        writeln!(text, "{row},{row},0,0").expect("a string");
    }
    for row in 1..60 {
        let since_s = 10.0 * f64::from(row);
        writeln!(text, "{},{since_s},3,{:.6}", 5.0 + since_s, crept(since_s)).expect("a string");
    }
    let (experiment, words) = plainly(&text).expect("a creep");
    let switches = experiment.record.force_step_rows();
    assert!(switches.len() == 1 && (experiment.record.time_s[switches[0]] - 5.0).abs() < 1e-9, "{switches:?} {words}");
    let last = format!("Interval 2\n{}", text.replace(",3,", ",4,"));
    let both = format!("Interval 1\n{text}\n{last}");
    let (experiment, words) = of_second_table(&both).expect("a creep");
    assert_eq!(experiment.record.n_samples(), 64, "{words}");
}

/// Creep and recovery with rows at the ends of their intervals: the stress before the first row is that of the hold. A bead that is loaded all the time begins so, too.
#[test]
fn a_stress_acts_until_the_end_of_its_interval() {
    let mut text = String::from("Time (s),Step time (s),Stress (Pa),Strain (%)\n");
    for row in 1..=240 {
        let (t, since_s) = (0.5 * f64::from(row), 0.5 * f64::from((row - 1) % 120 + 1));
        let strain = if row <= 120 { crept(t) } else { crept(t) - crept(t - 60.0) };
        writeln!(text, "{t},{since_s},{},{strain:.6}", if row <= 120 { 0.05 } else { 0.0 }).expect("a string");
    }
    let (experiment, words) = plainly(&text).expect("a creep");
    let record = &experiment.record;
    let switches: Vec<f64> = record.force_step_rows().into_iter().map(|row| record.time_s[row]).collect();
    assert_eq!(switches, [0.0, 60.0], "{words}");
    assert!(
        record.force_n[0] > 0.0 && record.force_n[..120].iter().all(|force| *force == record.force_n[0]),
        "{words}"
    );
    let mut text = String::from("Time (s),Force (uN),Position (um)\n");
    for row in 1..400 {
        let t = 0.1 * f64::from(row);
        writeln!(text, "{t:.1},4.6,{:.3}", 210.0 * crept(t) + 0.3 * f64::from(row % 3)).expect("a string");
    }
    let (experiment, words) = plainly(&text).expect("a creep");
    assert!((times_since_load(&experiment)[0] - 0.1).abs() < 1e-6, "{words}");
}

/// A stress that rises for 10 s is a ramp between its rows, and one that rises in steps is not.
#[test]
fn a_sampled_ramp_is_linear() {
    let with = |stress: &dyn Fn(i32) -> f64| {
        let mut text = String::from("Time (s),Shear stress (Pa),Shear strain (%)\n");
        for row in 0..200 {
            let t = 0.25 * f64::from(row);
            writeln!(text, "{t},{},{:.6}", stress(row), stress(row) * crept(t)).expect("a string");
        }
        plainly(&text).expect("a creep")
    };
    let (experiment, words) = with(&|row| 0.125 * f64::from(row.min(40)));
    assert_eq!(experiment.record.force_rule, ForceRule::Linear, "{words}");
    assert!(words.contains("from line 2 to line 42") && !words.contains("also jumps"), "{words}");
    let (experiment, words) = with(&|row| if row < 150 { 0.125 * f64::from(row.min(40)) } else { 0.0 });
    assert_eq!(experiment.record.force_rule, ForceRule::Linear);
    assert!(words.contains("also jumps, first in line 152 (1 in all)"), "{words}");
    let (experiment, words) = with(&|row| f64::from(row.min(40) / 10));
    assert_eq!(experiment.record.force_rule, ForceRule::Hold, "{words}");
}

#[test]
fn times_of_day_do_not_show_when_a_load_began() {
    let mut text = String::from("Time,Shear stress (Pa),Shear strain (%)\n");
    for row in 0..60 {
        writeln!(text, "2024-03-09T13:58:{row:02},3,{:.6}", crept(0.5 + f64::from(row))).expect("a string");
    }
    let refused = plainly(&text).expect_err("a question");
    assert!(refused.contains("times of day do not show") && refused.contains("load_start -0.5`"), "{refused}");
    let (experiment, _) = told(&text, "-0.5").expect("a creep");
    assert!((times_since_load(&experiment)[0] - 0.5).abs() < 1e-6);
    // A clock that begins at midnight counts from the load.
    let (_, words) = plainly(&text.replace("2024-03-09T13:58", "00:00")).expect("a creep");
    assert!(words.contains("the step is assumed to have begun just before it"), "{words}");
    // A relaxation at its hold begins just before the first row, unless the user says when.
    let mut text = String::from("Time of day,Shear strain (%),Shear stress (Pa)\n");
    for row in 0..60 {
        writeln!(text, "13:58:{row:02},1,{:.5}", relaxed(0.5 + f64::from(row))).expect("a string");
    }
    let (experiment, _) = plainly(&text).expect("a relaxation");
    assert_eq!(experiment.control, Control::Position);
    let (experiment, _) = told(&text, "-0.5").expect("a relaxation");
    assert!((times_since_load(&experiment)[0] - 0.5).abs() < 1e-6);
}

/// A table of relaxations may have columns of an oscillation that hold nothing, and the stress of a few rows may have another sign by the inertia of the tool.
#[test]
fn columns_without_values_describe_nothing() {
    let mut text = String::from(
        "Angular Frequency,Storage Modulus,Loss Modulus,Time,Shear Stress,Strain\n[rad/s],[Pa],[Pa],[s],[Pa],[%]\n",
    );
    for row in 0..100 {
        let t = 0.01 * 1.12_f64.powi(row);
        let stress = if row < 3 { -15_000.0 } else { relaxed(t) };
        writeln!(text, "******,******,******,{t:.5},{stress:.4},1").expect("a string");
    }
    let (experiment, words) = plainly(&text).expect("a relaxation");
    assert_eq!(experiment.control, Control::Position, "{words}");
    assert!(!words.contains("opposite signs") && experiment.record.force_n[50] > 0.0, "{words}");
}

/// Points that an instrument calls invalid stand in place of the first rows, between the header and the rows.
#[test]
fn invalid_points_are_no_rows() {
    let mut text = String::from("Interval\t1\n");
    for interval in 0..2 {
        writeln!(text, "Data\tPoint\tTime\tStress\tStrain\n\t\t[s]\t[Pa]\t[%]").expect("a string");
        for row in 1..40 {
            match (interval, row) {
                (1, ..8) => writeln!(text, "\t{row}  (invalide)\t\t\t"),
                _ => writeln!(text, "\t{row}\t{}\t3\t{:.6}", 0.5 * f64::from(row), crept(0.5 * f64::from(row))),
            }
            .expect("a string");
        }
        writeln!(text, "\nInterval\t2").expect("a string");
    }
    let last = |request: &mut InitRequest| {
        request.known_columns.tables = Some("2".into());
        request.load_start = Some("0".into());
    };
    let (experiment, words) = read(&text, last).expect("a creep");
    assert_eq!(experiment.record.n_samples(), 32, "{words}");
    assert!((times_since_load(&experiment)[0] - 4.0).abs() < 1e-6, "{words}");
}

/// A sheet of a workbook with fewer columns than the sheet before it, and a word in each row, has tables of its own.
#[test]
fn a_narrow_sheet_after_a_wide_one_is_read() {
    let wide: String = (0..5).map(|row| format!("{row}\t1\t2\t3\t4\t5\t6\n")).collect();
    let narrow: String = (0..40).map(|row| format!("{row}\t3\t{:.6}\tvalid\n", crept(f64::from(row)))).collect();
    let text = format!(
        "sheet one\na\tb\tc\td\te\tf\tg\n{wide}\nsheet two\nTime [s]\tShear stress [Pa]\tShear strain [%]\tState\n{narrow}"
    );
    let (experiment, words) = of_second_table(&text).expect("a creep");
    assert_eq!(experiment.record.n_samples(), 40, "{words}");
}

/// Several specimens in one table are asked for by the column that names them. The size of a specimen that is compressed changes against the force.
#[test]
fn specimens_of_one_table_are_told_apart() {
    let mut text = String::from("Specimen Name,Time (s),Force (uN),Current Size (um)\n");
    for set in ["A", "B"] {
        for row in 0..200 {
            let noise = 0.4 * ((1.0 + f64::from(row)) * 12.9898).sin();
            let (force, size) =
                if row == 0 { (0.0, 64.0) } else { (30.0 * relaxed(0.2 * f64::from(row)), 61.0 + noise) };
            writeln!(text, "{set},{},{force:.3},{size:.3}", 0.2 * f64::from(row)).expect("a string");
        }
    }
    let columns = |track: Option<&str>| {
        let track = track.map(String::from);
        move |request: &mut InitRequest| {
            request.known_columns.columns[2] = Some("Current Size (um)".into());
            request.known_columns.track[1].clone_from(&track);
            request.specimen = [Some(0.064), Some(0.003)];
            request.control = Some(Control::Position);
        }
    };
    let refused = read(&text, columns(None)).expect_err("a question");
    assert!(refused.contains("A (200 rows), B (200 rows)"), "{refused}");
    let (experiment, words) = read(&text, columns(Some("B"))).expect("a relaxation");
    let record = &experiment.record;
    let row = (record.n_samples(), record.force_n[100], record.position_m[100]);
    assert!(row.0 == 200 && row.1 > 0.0 && row.2 > Some(0.0), "{row:?} {words}");
}

/// Without a header, the user names the columns of an oscillation by numbers and gives the units.
#[test]
fn an_oscillation_may_have_no_header() {
    let rows: String = (0..20).map(|row| 10_f64.powf(0.1 * f64::from(row) - 1.0)).fold(String::new(), |all, omega| {
        let whole = 1.0 + omega * omega;
        all + &format!("{omega:.6} {:.6} {:.6}\n", 300.0 * omega * omega / whole, 300.0 * omega / whole)
    });
    let told = |units: [Option<&str>; 2]| {
        let folder = tempfile::tempdir().expect("a folder");
        let (file, out) = (folder.path().join("a.txt"), folder.path().join("a"));
        std::fs::write(&file, &rows).expect("room on the disk");
        let known_columns = TableSettings {
            frequency: Some("1".into()),
            moduli: Some(["2".into(), "3".into()]),
            sweep_units: units.map(|unit| unit.map(String::from)),
            ..TableSettings::default()
        };
        let request = InitRequest { file, out: Some(out.clone()), known_columns, ..InitRequest::default() };
        run(&request, &mut |_| None).map_err(|error| error.to_string())?;
        OscillationRecord::read(&out).map(|(sweep, _)| sweep).map_err(|error| error.to_string())
    };
    let refused = told([None, None]).expect_err("units are missing");
    assert!(refused.contains("`unit_frequency Hz` or `unit_frequency rad/s`; `unit_moduli Pa`"), "{refused}");
    assert!(told([Some("s"), Some("Pa")]).expect_err("no unit").contains("no unit of this quantity"));
    let sweep = told([Some("rad/s"), Some("kPa")]).expect("a sweep");
    assert!((sweep.rows[0].frequency_hz - 0.1 / std::f64::consts::TAU).abs() < 1e-6);
    assert!((sweep.rows[10].pair[0] - 150_000.0).abs() < 1.0, "{:?}", sweep.rows[10]);
}

/// A log of the force has the times at which forces begin or end, times of a clock, or ramps.
#[test]
fn a_log_says_when_its_forces_act() {
    let clock = |t: f64| format!("10:00:{t:06.3}");
    let track = |time: &dyn Fn(f64) -> String, name: &str| -> String {
        (0..320)
            .map(|row| 0.1 * f64::from(row))
            .fold(format!("{name},Position (um)\n"), |all, t| all + &format!("{},{:.3}\n", time(t), crept(t)))
    };
    let plain = |t: f64| format!("{t:.1}");
    let with = |track: &str, log: &str| {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("track.csv"), track).expect("room on the disk");
        std::fs::write(at("log.csv"), log).expect("room on the disk");
        let request = InitRequest {
            file: at("track.csv"),
            out: Some(at("out")),
            sizes: [Some(0.55), Some(20.0), Some(0.48)],
            force_file: Some(at("log.csv")),
            ..InitRequest::default()
        };
        run(&request, &mut |_| None).map_err(|error| error.to_string())?;
        Experiment::read(&at("out")).map(|(experiment, _)| experiment.record).map_err(|error| error.to_string())
    };
    let seconds = track(&plain, "Time (s)");
    for (track, log) in [
        (&seconds, "time (s),force (uN)\n0,0\n2,4.6\n12,0\n22,4.6\n"),
        (&seconds, "t_end (s),force (uN)\n2,0\n12,4.6\n22,0\n33,4.6\n"),
        (&track(&clock, "Time of day"), "Time,force (uN)\n10:00:00,0\n10:00:02,4.6\n10:00:12,0\n10:00:22,4.6\n"),
    ] {
        let record = with(track, log).expect("a record");
        for (time_s, force_n) in record.time_s.iter().zip(&record.force_n) {
            let acts = (2.0..12.0).contains(&(time_s + 1e-9)) || time_s + 1e-9 > 22.0;
            assert!((1e6 * force_n - if acts { 4.6 } else { 0.0 }).abs() < 1e-6, "{log} {time_s} {force_n}");
        }
    }
    let ramp: String = (0..320)
        .map(|row| (0.1 * f64::from(row), 0.1 * f64::from((row - 20).clamp(0, 46))))
        .fold(String::from("time (s),force (uN)\n"), |all, (t, force)| all + &format!("{t:.1},{force:.1}\n"));
    assert_eq!(with(&seconds, &ramp).expect("a record").force_rule, ForceRule::Linear);
    let stairs = with(&seconds, "time (s),force (uN)\n0,0\n5,1\n10,2\n15,3\n20,4\n25,0\n").expect("a record");
    assert_eq!(stairs.force_rule, ForceRule::Hold);
    let refused = with(&seconds, "duration (s),force (uN)\n2,0\n10,4.6\n").expect_err("no times");
    assert!(refused.contains("holds durations"), "{refused}");
    let refused = with(&seconds, "Time,force (uN)\n0:00,0\n0:10,4.6\n0:20,0\n").expect_err("two parts");
    assert!(refused.contains("no column has a unit of time"), "{refused}");
}
