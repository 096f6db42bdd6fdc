//! Tables whose first rows do not show when the load or the step began, or whose clock, samples or units can be misread. The truths are closed forms.

use std::fmt::Write as _;

use vitreo_uq::jobs::init::{InitRequest, run};
use vitreo_uq::record::table::TableSettings;
use vitreo_uq::record::{Experiment, OscillationRecord};

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

#[test]
fn a_creep_without_its_first_rows_began_at_time_0() {
    for first_s in [1.0, 2.0, 2.9] {
        let (experiment, words) = plainly(&creep_from(first_s)).expect("a creep");
        assert!((times_since_load(&experiment)[0] - first_s).abs() < 1e-6, "{words}");
        assert!(words.contains("load_start_s = 0"), "{words}");
    }
    // Where the clock does not tell, the user is asked, and both answers are read.
    let refused = plainly(&creep_from(6.0)).expect_err("a question");
    assert!(refused.contains("load_start_s 0` if it began at time 0, `load_start_s 6`"), "{refused}");
    for (began_s, since_s) in [(0.0, 6.0), (5.0, 1.0), (6.0, 0.0)] {
        let (experiment, _) = read(&creep_from(6.0), |request| request.load_start_s = Some(began_s)).expect("a creep");
        assert!((times_since_load(&experiment)[0] - since_s).abs() < 1e-6, "{began_s}");
    }
    // Another clock says nothing of the load.
    assert!(plainly(&creep_from(1000.0)).is_ok());
}

#[test]
fn a_bead_without_its_first_rows_asks_when_its_load_began() {
    let mut text = String::from("Time (s),Force (uN),Position (um)\n");
    for row in 0..140 {
        let t = 0.5 + 0.05 * f64::from(row);
        writeln!(text, "{t:.2},4.6,{:.3}", 515.0 + 210.0 * crept(t)).expect("a string");
    }
    assert!(plainly(&text).expect_err("a question").contains("when it began"));
    let (experiment, _) = read(&text, |request| request.load_start_s = Some(0.0)).expect("a creep");
    assert!((times_since_load(&experiment)[0] - 0.5).abs() < 1e-6);
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
    assert!(!experiment.fits_position_offset && words.contains("which is left out"), "{words}");
    let known: Vec<f64> = experiment.record.position_m.iter().copied().flatten().collect();
    assert!((known[0] / known[58] / (crept(0.5) / crept(29.5)) - 1.0).abs() < 1e-5, "{known:?}");
    // A bead whose force acts from the second row on has not moved there.
    let mut text = String::from("Time (s),Force (uN),Position (um)\n0,0,0.2\n");
    for row in 1..60 {
        let t = 0.5 * f64::from(row - 1);
        writeln!(text, "{},4.6,{:.3}", t + 0.5, 210.0 * crept(t) + 0.3 * f64::from(row % 3)).expect("a string");
    }
    let (experiment, words) = plainly(&text).expect("a creep");
    assert!(times_since_load(&experiment)[1].abs() < 1e-6 && !words.contains("which is left out"), "{words}");
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
    assert_eq!(interval(&table("Time (mm:ss)", &two)), 1.0);
    assert_eq!(
        interval(&table("Time of day", &|row| format!("{}:{:02}", 23 * u32::from(row < 20), (row + 40) % 60))),
        60.0
    );
    assert_eq!(interval(&table("Time", &|row| format!("2:{:02} PM", row + 6))), 60.0);
    assert_eq!(interval(&table("Time", &|row| format!("2026-11-22 10:{:02}", row + 6))), 60.0);
    let refused = plainly(&table("Time", &two)).expect_err("a question");
    assert!(refused.contains("unit_time hh:mm` or `unit_time mm:ss"), "{refused}");
    let told = |unit: &str| {
        let given = TableSettings { units: [Some(unit.into()), None, None], ..TableSettings::default() };
        read(&table("Time", &two), |request| request.known_columns = given.clone()).expect("a relaxation").0.record
    };
    assert_eq!(told("hh:mm").time_s[2] - told("hh:mm").time_s[1], 60.0);
    assert_eq!(told("mm:ss").time_s[2] - told("mm:ss").time_s[1], 1.0);
    // An elapsed time keeps its zero; a time of day counts from the first row.
    let elapsed = |first: u32| table("Elapsed time (hh:mm:ss)", &|row| format!("{:02}:00:{:02}", first, 3 + row));
    let first_s = |text: &str| {
        let record = plainly(text).expect("a relaxation").0.record;
        let held = record.position_m.iter().position(Option::is_some).expect("a stress");
        record.time_s[held]
    };
    assert!((first_s(&elapsed(0)) - 3.0).abs() < 1e-6);
    // The first row is left out there, because the step is just before it.
    assert!((first_s(&elapsed(9)) - 1.0).abs() < 1e-6);
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
fn sweeps_that_differ_in_one_sense_are_several() {
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
    assert!(sweep(0.8).expect_err("two sweeps").contains("in one sense"));
    assert!(sweep(1.15).expect_err("two sweeps").contains("in one sense"));
    assert_eq!(sweep(1.0), Ok(()));
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
    for header in ["t (s),G(t)/G0", "t [s],J(t)·1e3 [1/Pa]"] {
        assert!(table(header, &modulus).is_err(), "{header}");
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
    assert!(plainly(&text).expect_err("a question").contains("or a stretch"));
}
