//! One record in the export layouts of laboratories, written independently of the reader. `init` needs only the sizes, or names its
//! questions; the experiment then equals the written record.

use std::path::Path;

use vitreo_uq::intake::{InitRequest, run};
use vitreo_uq::record::Experiment;
use vitreo_uq::record::table::TableSettings;

const INTERVAL_S: f64 = 0.1;
const N_ROWS: usize = 200;
/// The sizes of a robot are given, although the tests use an instrument so that nothing is meshed.
const SIZES: [Option<f64>; 3] = [Some(0.55), Some(20.0), Some(0.48)];

/// Time (s), force (µN), position (µm): two cycles of a pull in each direction, of a Lethersich body in closed form.
fn truth() -> Vec<[f64; 3]> {
    let creep = |t: f64| 155.0 * (1.0 - (-t / 0.4).exp()) + 11.6 * t;
    let steps = [(0.0, 4.6), (5.0, -9.2), (10.0, 9.2), (15.0, -9.2)];
    let row = |i: usize| {
        let t = INTERVAL_S * i as f64;
        let force = if (i / 50).is_multiple_of(2) { 4.6 } else { -4.6 };
        let past = steps.iter().filter(|(at, _)| t > *at);
        [t, force, past.map(|(at, change)| change / 4.6 * creep(t - at)).sum::<f64>()]
    };
    (0..N_ROWS).map(row).collect()
}

#[derive(Clone, Copy)]
enum Encoding {
    Utf8,
    Utf8Marked,
    Latin1,
    Utf16Little,
    Utf16Big,
}

#[derive(Clone, Copy)]
enum Times {
    Number,
    Clock,
    Iso,
}

/// Layout of one laboratory.
#[derive(Clone, Copy)]
struct Look {
    between: &'static str,
    decimal: char,
    /// Names of time, force and position; empty for no header.
    names: [&'static str; 3],
    units_row: Option<[&'static str; 3]>,
    /// Lines above the header.
    above: &'static [&'static str],
    comment_sign: &'static str,
    times: Times,
    /// Written units per second, micronewton and micrometre.
    per: [f64; 3],
    /// Order of the three columns.
    order: [usize; 3],
    /// Unused columns: name, and the value in every row.
    others: &'static [(&'static str, &'static str)],
    cycle: Option<&'static str>,
    encoding: Encoding,
    end: &'static str,
    quotes: bool,
    offset_um: f64,
    sign: f64,
    /// Angle in degrees of the bead's motion in the camera's plane, with the name of y; the position's name is that of x.
    plane: Option<(f64, &'static str)>,
    /// Units that must be given.
    said: [Option<&'static str>; 3],
}

const PLAIN: Look = Look {
    between: ",",
    decimal: '.',
    names: ["time_s", "force_uN", "position_um"],
    units_row: None,
    above: &[],
    comment_sign: "",
    times: Times::Number,
    per: [1.0; 3],
    order: [0, 1, 2],
    others: &[],
    cycle: None,
    encoding: Encoding::Utf8,
    end: "\n",
    quotes: false,
    offset_um: 0.0,
    sign: 1.0,
    plane: None,
    said: [None; 3],
};

const BRACKETS: [&str; 3] = ["Time [s]", "Force [µN]", "Position [µm]"];
const ROUND: [&str; 3] = ["t (s)", "F (µN)", "x (µm)"];
const SLASHES: [&str; 3] = ["t/s", "F/µN", "x/µm"];
const WORDS: [&str; 3] = ["Elapsed time", "Force", "Displacement"];
const GERMAN: [&str; 3] = ["Zeit [s]", "Kraft [µN]", "Weg [µm]"];
const NANO: [&str; 3] = ["time (ms)", "force (nN)", "position (nm)"];

fn looks() -> Vec<(&'static str, Look)> {
    let table = [
        ("our own", PLAIN),
        ("our own, with cycles", Look { cycle: Some("cycle"), ..PLAIN }),
        ("brackets", Look { names: BRACKETS, ..PLAIN }),
        ("round brackets", Look { names: ROUND, ..PLAIN }),
        ("slashes", Look { names: SLASHES, ..PLAIN }),
        ("micro sign", Look { names: ["time_s", "force_µN", "position_µm"], ..PLAIN }),
        ("Greek mu", Look { names: ["t [s]", "F [μN]", "x [μm]"], ..PLAIN }),
        ("words with in", Look { names: ["time in s", "force in uN", "position in um"], ..PLAIN }),
        ("German spreadsheet", Look { between: ";", decimal: ',', names: GERMAN, ..PLAIN }),
        (
            "German, Latin-1",
            Look { between: ";", decimal: ',', names: GERMAN, encoding: Encoding::Latin1, end: "\r\n", ..PLAIN },
        ),
        ("semicolons, points", Look { between: ";", names: BRACKETS, ..PLAIN }),
        ("tabs, decimal commas", Look { between: "\t", decimal: ',', names: ROUND, ..PLAIN }),
        ("blanks", Look { between: "   ", names: ["t/s", "F/uN", "x/um"], ..PLAIN }),
        ("blanks, decimal commas", Look { between: "  ", decimal: ',', names: ["t/s", "F/uN", "x/um"], ..PLAIN }),
        ("blanks after commas", Look { between: ", ", names: BRACKETS, ..PLAIN }),
        ("quotes", Look { quotes: true, names: BRACKETS, ..PLAIN }),
        ("byte-order mark", Look { encoding: Encoding::Utf8Marked, names: BRACKETS, ..PLAIN }),
        ("UTF-16", Look { encoding: Encoding::Utf16Little, between: "\t", names: BRACKETS, end: "\r\n", ..PLAIN }),
        ("UTF-16, big end first", Look { encoding: Encoding::Utf16Big, between: "\t", names: BRACKETS, ..PLAIN }),
        ("units beneath", Look { names: WORDS, units_row: Some(["s", "µN", "µm"]), ..PLAIN }),
        (
            "units beneath, in brackets",
            Look { names: ["t", "F", "x"], units_row: Some(["[s]", "[uN]", "[um]"]), between: "\t", ..PLAIN },
        ),
        (
            "units beneath, one of another kind",
            Look { names: WORDS, units_row: Some(["s", "µN", "µm"]), others: &[("T", "21.5")], ..PLAIN },
        ),
        ("header as a comment", Look { names: ROUND, comment_sign: "# ", ..PLAIN }),
        ("comments above", Look { names: BRACKETS, above: &["# tracker 3.1", "# bead 7; 20 °C"], ..PLAIN }),
        (
            "an instrument's preamble",
            Look {
                names: BRACKETS,
                between: "\t",
                above: &["Instrument: MT-2", "Operator\tAB", "Rate\t10 Hz", ""],
                ..PLAIN
            },
        ),
        ("another order", Look { order: [2, 0, 1], names: BRACKETS, ..PLAIN }),
        ("y and a temperature", Look { names: ROUND, others: &[("y (µm)", "0.2"), ("T (°C)", "21.5")], ..PLAIN }),
        ("a column of words", Look { names: ROUND, others: &[("status", "ok")], ..PLAIN }),
        (
            "a frame number first",
            Look { names: ROUND, others: &[("frame", "17")], order: [0, 1, 2], between: ";", ..PLAIN },
        ),
        ("nanonewtons, milliseconds", Look { names: NANO, per: [1e3, 1e3, 1e3], ..PLAIN }),
        ("newtons and metres", Look { names: ["t [s]", "F [N]", "x [m]"], per: [1.0, 1e-6, 1e-6], ..PLAIN }),
        ("millimetres", Look { names: ["t [s]", "F [µN]", "x [mm]"], per: [1.0, 1.0, 1e-3], ..PLAIN }),
        ("minutes", Look { names: ["t [min]", "F [µN]", "x [µm]"], per: [1.0 / 60.0, 1.0, 1.0], ..PLAIN }),
        ("a clock", Look { names: ["Time", "F [µN]", "x [µm]"], times: Times::Clock, ..PLAIN }),
        ("ISO times", Look { names: ["timestamp", "force [µN]", "position [µm]"], times: Times::Iso, ..PLAIN }),
        ("camera coordinates", Look { names: BRACKETS, offset_um: 2500.0, ..PLAIN }),
        ("turned round", Look { names: BRACKETS, sign: -1.0, ..PLAIN }),
        (
            "turned round in a camera",
            Look { names: BRACKETS, between: ";", decimal: ',', sign: -1.0, offset_um: 812.5, ..PLAIN },
        ),
        ("x and y", Look { names: ROUND, plane: Some((90.0, "y (µm)")), ..PLAIN }),
        ("x and y of a camera, slanting", {
            let names = ["t [s]", "F [µN]", "Pos X [mm]"];
            let plane = Some((-143.0, "Pos Y [mm]"));
            Look { names, per: [1.0, 1.0, 1e-3], offset_um: 2500.0, plane, between: ";", ..PLAIN }
        }),
        ("our own names, x and y", {
            let names = ["time_s", "force_uN", "position_x_um"];
            Look { names, plane: Some((17.0, "position_y_um")), between: "\t", ..PLAIN }
        }),
        ("names with blanks between blanks", Look { between: "  ", names: BRACKETS, ..PLAIN }),
        ("names with blanks and comment signs between blanks", {
            let names = ["elapsed time [s]", "Force [µN]", "Position [µm]"];
            Look { between: " ", names, comment_sign: "% ", above: &["% tracker"], ..PLAIN }
        }),
        ("no units", Look { names: ["t", "F", "x"], said: [Some("s"), Some("uN"), Some("um")], ..PLAIN }),
        ("a tracker in pixels", Look { names: ["t [s]", "F [µN]", "x"], said: [None, None, Some("um")], ..PLAIN }),
    ];
    table.to_vec()
}

fn written(look: &Look) -> Vec<u8> {
    let number = |value: f64| {
        format!("{value:.12}").trim_end_matches('0').trim_end_matches('.').replace('.', &look.decimal.to_string())
    };
    let time = |t: f64| match look.times {
        Times::Number => number(t * look.per[0]),
        // The clock passes midnight.
        Times::Clock => {
            let t = (t + 86_395.0) % 86_400.0;
            format!("{:02}:{:02}:{:06.3}", (t / 3600.0) as u32, (t / 60.0) as u32 % 60, t % 60.0)
        }
        Times::Iso => format!("2026-02-28T23:59:{:06.3}Z", t + 30.0),
    };
    let quoted = |cell: String| if look.quotes { format!("\"{cell}\"") } else { cell };
    let mut text = String::new();
    let mut line = |cells: Vec<String>| text += &(cells.join(look.between) + look.end);
    look.above.iter().for_each(|above| line(vec![(*above).to_string()]));
    let row = |names: [String; 3], y: Option<String>, others: Vec<String>, cycle: Option<String>| -> Vec<String> {
        let entry = look.order.map(|at| names[at].clone());
        let chain = entry.into_iter().chain(y);
        others.into_iter().chain(chain).chain(cycle).map(quoted).collect()
    };
    let others = |which: fn(&(&str, &str)) -> String| look.others.iter().map(which).collect::<Vec<_>>();
    let mut names = row(
        look.names.map(String::from),
        look.plane.map(|(_, y)| y.into()),
        others(|o| o.0.into()),
        look.cycle.map(String::from),
    );
    names[0] = format!("{}{}", look.comment_sign, names[0]);
    line(names);
    if let Some(units) = look.units_row {
        line(row(units.map(String::from), None, others(|_| "°C".into()), None));
    }
    for (i, [t, force, position]) in truth().into_iter().enumerate() {
        // Across the line the bead wobbles by 0.3 µm, out of step with the force.
        let (sin, cos) = look.plane.map_or((0.0, 1.0), |(degrees, _)| degrees.to_radians().sin_cos());
        let across = if look.plane.is_some() { 0.3 * (1.7 * i as f64).sin() } else { 0.0 };
        let x = look.sign * (cos * position - sin * across) + look.offset_um;
        let y = look.plane.map(|_| number((sin * position + cos * across - look.offset_um) * look.per[2]));
        let item = [time(t), number(force * look.per[1]), number(x * look.per[2])];
        line(row(item, y, others(|o| o.1.into()), look.cycle.map(|_| (1 + i / 100).to_string())));
    }
    match look.encoding {
        Encoding::Utf8 => text.into_bytes(),
        Encoding::Utf8Marked => [b"\xef\xbb\xbf", text.as_bytes()].concat(),
        Encoding::Latin1 => text.chars().map(|c| u8::try_from(u32::from(c)).expect("a letter of Latin-1")).collect(),
        Encoding::Utf16Little => text.encode_utf16().flat_map(u16::to_le_bytes).collect(),
        Encoding::Utf16Big => [0xfeff].into_iter().chain(text.encode_utf16()).flat_map(u16::to_be_bytes).collect(),
    }
}

/// Largest differences of time (s), force (µN) and position (µm) from the written values.
fn distances(experiment: &Experiment) -> [f64; 3] {
    let record = &experiment.record;
    assert_eq!(record.n_rows(), N_ROWS);
    let mut largest = [0.0_f64; 3];
    for (i, row) in truth().into_iter().enumerate() {
        let position_um = record.position_m[i].map_or(f64::NAN, |x| 1e6 * x);
        let found = [record.time_s[i], 1e6 * record.force_n[i], position_um];
        for k in 0..3 {
            largest[k] = largest[k].max(if found[k].is_nan() { f64::INFINITY } else { (found[k] - row[k]).abs() });
        }
    }
    largest
}

fn initialised(folder: &Path, number: usize, look: &Look, units: [Option<String>; 3]) -> vitreo_uq::Result<Experiment> {
    let file = folder.join(format!("table-{number}.txt"));
    std::fs::write(&file, written(look)).expect("room on the disk");
    let out = folder.join(format!("experiment-{number}"));
    let given = TableSettings { units, ..TableSettings::default() };
    let request = InitRequest {
        file,
        out: Some(out.clone()),
        known_columns: given,
        sizes: SIZES,
        replace: true,
        ..InitRequest::default()
    };
    run(&request, &mut |_| None)?;
    Experiment::read(&out).map(|(experiment, _)| experiment)
}

#[test]
fn tables_of_forty_five_looks_are_one_record() {
    let folder = tempfile::tempdir().unwrap();
    let looks = looks();
    assert_eq!(looks.len(), 45);
    let mut n_understood = 0;
    for (number, (name, look)) in looks.iter().enumerate() {
        let found = initialised(folder.path(), number, look, [None, None, None]);
        let is_asked = look.said.iter().any(Option::is_some);
        let experiment = match found {
            Ok(experiment) => {
                assert!(!is_asked, "{name}: understood, although a unit is missing");
                n_understood += 1;
                experiment
            }
            Err(error) => {
                assert!(is_asked, "{name}: {error}");
                let text = error.to_string();
                assert!(text.contains("unit_"), "{name}: {text}");
                // The remedy works.
                initialised(folder.path(), number, look, look.said.map(|unit| unit.map(String::from))).unwrap()
            }
        };
        let largest = distances(&experiment);
        // The wobble across the line tilts it by less than 0.3 / 155, and shifts the zero by at most its own size.
        let position_um = if look.plane.is_some() { 0.01 } else { 1e-6 };
        assert!(largest[0] < 1e-6 && largest[1] < 1e-9 && largest[2] < position_um, "{name}: {largest:?}");
        assert_eq!(experiment.record.n_cycles(), 2, "{name}");
    }
    assert_eq!(n_understood, 43);
}

/// Values unknown to `init` are refused by every reader, with the line. An existing experiment is not overwritten.
#[test]
fn sizes_that_are_not_known_are_marked() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bead.csv");
    std::fs::write(&file, written(&PLAIN)).unwrap();
    let out = folder.path().join("bead");
    let request = InitRequest { file, out: Some(out.clone()), ..InitRequest::default() };
    let (summary, _) = run(&request, &mut |_| None).unwrap();
    assert_eq!(summary.unknown.len(), 3);
    let refused = Experiment::read(&out).unwrap_err().to_string();
    assert!(refused.contains("robot.diameter_mm") && refused.contains("not filled in yet"), "{refused}");
    assert!(run(&request, &mut |_| None).unwrap_err().to_string().contains("there is already an experiment here"));
    let toml = std::fs::read_to_string(out.join("experiment.toml")).unwrap();
    assert!(toml.lines().filter(|line| line.contains(" = ")).all(|line| line.contains(" # ")), "{toml}");
}

/// A rheometer's creep in three layouts: a pascal counts as 1 µN, a strain of 1 % as 1 µm, and 2 + 2ν is the compliance. A remark says that the robot's sizes are ignored.
#[test]
fn a_rheometers_creep_is_a_record_in_time() {
    let folder = tempfile::tempdir().unwrap();
    let strain = |t: f64| 0.3 * (1.0 - (-t / 2.0_f64).exp()) + 0.01 * t;
    let stress = |t: f64| if t < 20.0 { 1.5 } else { 0.0 };
    let rows = |line: &dyn Fn(usize, f64) -> String| -> String { (0..400).map(|i| line(i, 0.1 * i as f64)).collect() };
    let percent = rows(&|i, t| format!("{}\t{t:.1}\t{:.4}\t{:.6}\n", i + 1, stress(t), 100.0 * strain(t)));
    let kilopascal = rows(&|_, t| format!("{t:.1};{:.6};{:.6}\n", 1e-3 * stress(t), strain(t)).replace('.', ","));
    let pascal = rows(&|_, t| format!("{:.7},{t:.1},{:.3},0.01\n", strain(t), stress(t)));
    let tables = [
        format!("Meas. Pts.\tTime\tShear Stress\tShear Strain\n\t[s]\t[Pa]\t[%]\n{percent}"),
        format!("Zeit [s];Schubspannung [kPa];Dehnung\n{kilopascal}"),
        format!("Strain (-),Time (s),Stress (Pa),Strain rate (1/s)\n{pascal}"),
    ];
    for (number, table) in tables.iter().enumerate() {
        let (file, out) = (folder.path().join("creep.txt"), folder.path().join(format!("creep-{number}")));
        std::fs::write(&file, table).unwrap();
        let request = InitRequest { file, out: Some(out.clone()), sizes: SIZES, ..InitRequest::default() };
        let (summary, _) = run(&request, &mut |_| None).unwrap();
        assert!(
            summary.is_complete() && summary.reasons.iter().any(|reason| reason.contains("ignored")),
            "{summary:?}"
        );
        let (experiment, _) = Experiment::read(&out).unwrap();
        let toml = std::fs::read_to_string(out.join("experiment.toml")).unwrap();
        assert!(toml.contains("[instrument]\ncompliance_per_m = 2.96 "), "{toml}");
        let record = &experiment.record;
        assert_eq!(record.n_rows(), 400);
        for (row, position_m) in record.position_m.iter().enumerate() {
            let t = 0.1 * row as f64;
            assert!((record.time_s[row] - t).abs() < 1e-9 && (record.force_n[row] - 1e-6 * stress(t)).abs() < 1e-15);
            assert!((position_m.unwrap() - 1e-4 * strain(t)).abs() < 1e-10, "{number} {row}");
        }
    }
}

/// A first row that lacks its last cell keeps its header, and is read.
#[test]
fn a_first_row_without_its_last_cell_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let mut table = String::from("[step]\nCreep - 1\nStep time\tForce\tPosition\tModulus\ns\tuN\tum\tPa\n0\t4.6\t0\n");
    for row in 1..40 {
        let t = 0.1 * f64::from(row);
        table += &format!("{t:.1}\t4.6\t{:.3}\t1\n", 100.0 * (1.0 - (-t).exp()));
    }
    let (file, out) = (folder.path().join("creep.txt"), folder.path().join("creep"));
    std::fs::write(&file, table).unwrap();
    let request = InitRequest { file, out: Some(out), sizes: SIZES, ..InitRequest::default() };
    let (summary, _) = run(&request, &mut |_| None).unwrap();
    assert_eq!((summary.rows, summary.columns[0].name.as_str()), (40, "Step time"), "{summary:?}");
}

/// The quantity that holds is commanded, also before the user knows the sizes.
#[test]
fn a_relaxation_is_recognised_without_sizes() {
    let folder = tempfile::tempdir().unwrap();
    let mut table = String::from("time (s),force (uN),position (um)\n");
    for row in 0..400 {
        let t = 0.1 * f64::from(row);
        let (position, force) =
            if t < 1.0 { (100.0 * t, 3.0 * t) } else { (100.0, 1.0 + 2.0 * (-(t - 1.0) / 9.0).exp()) };
        table += &format!("{t:.1},{force:.4},{position:.2}\n");
    }
    let (file, out) = (folder.path().join("relaxation.csv"), folder.path().join("relaxation"));
    std::fs::write(&file, table).unwrap();
    let request = InitRequest { file, out: Some(out.clone()), ..InitRequest::default() };
    let (summary, _) = run(&request, &mut |_| None).unwrap();
    assert!(summary.reasons.iter().any(|reason| reason.contains("a relaxation")), "{summary:?}");
    assert!(std::fs::read_to_string(out.join("experiment.toml")).unwrap().contains("kind = \"relaxation\""));
}
