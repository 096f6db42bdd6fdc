//! Every rejection of formats §1: file, line, column or key, and a specific remedy.

use rand::{RngExt, SeedableRng};
use vitreo_uq::record::{Experiment, ExperimentFiles};
use vitreo_uq::{Error, Result};

const TOML: &str = r#"[specimen]
id = "porcine-01"
species = "porcine"
[robot]
shape = "sphere"
diameter_mm = 0.55
density_kg_m3 = 7500
[vitreous]
diameter_mm = 20.0
poisson_ratio = 0.48
density_kg_m3 = 1000
[measurement]
file = "trajectory.csv"
calibration_cycles = [1]
heldout_cycles = [2]
noise_um = 4.0
source = "synthetic"
"#;

/// Two cycles of ten rows: lines 2 to 11 and 12 to 21.
fn csv() -> String {
    let mut text = String::from("time_s,force_uN,position_um,cycle\n");
    for row in 0..20 {
        let force = if row % 10 < 5 { "4.6" } else { "-4.6" };
        text += &format!("{row}.5,{force},{}.25,{}\n", row % 10, 1 + row / 10);
    }
    text
}

fn read(toml: impl AsRef<[u8]>, csv: impl AsRef<[u8]>) -> Result<(Experiment, ExperimentFiles)> {
    Experiment::from_texts("dir/experiment.toml", toml, "dir/trajectory.csv", csv)
}

/// Name, text replaced once, its replacement, line, key (empty: none), words of the finding, words of the remedy.
type Case = (&'static str, &'static str, &'static str, usize, &'static str, &'static str, &'static str);

const SPECIMEN: &str = "[specimen]\nid = \"porcine-01\"\nspecies = \"porcine\"\n";
const ROBOT: &str = "[robot]\nshape = \"sphere\"\ndiameter_mm = 0.55\ndensity_kg_m3 = 7500\n";
const VITREOUS: &str = "[vitreous]\ndiameter_mm = 20.0\npoisson_ratio = 0.48\ndensity_kg_m3 = 1000\n";
const BOTH_BODIES: &str = "[robot]\nshape = \"sphere\"\ndiameter_mm = 0.55\ndensity_kg_m3 = 7500\n[vitreous]\ndiameter_mm = 20.0\npoisson_ratio = 0.48\ndensity_kg_m3 = 1000\n";
const MEASUREMENT: &str = "[measurement]\nfile = \"trajectory.csv\"\ncalibration_cycles = [1]\nheldout_cycles = [2]\nnoise_um = 4.0\nsource = \"synthetic\"\n";

#[rustfmt::skip]
const TOML_CASES: &[Case] = &[
    ("syntax", "\"porcine-01\"", "porcine-01", 2, "", "not valid TOML", "double quotes"),
    ("key given twice", "species = \"porcine\"", "id = \"b\"", 3, "", "not valid TOML", "each key once"),
    ("unknown table", "[vitreous]", "[vitrous]", 8, "vitrous", "unknown key", "did you mean `vitreous`"),
    ("unknown key", "species", "spezies", 3, "specimen.spezies", "unknown key", "did you mean `species`"),
    ("unknown key far from any", "species", "colour", 3, "specimen.colour", "unknown key", "known here: id, species, region"),
    ("another unit", "diameter_mm = 0.55", "diameter_um = 550", 6, "robot.diameter_um", "unknown key", "did you mean `diameter_mm`"),
    ("missing table", SPECIMEN, "", 1, "specimen", "missing", "add `[specimen]`"),
    ("missing robot", ROBOT, "", 1, "robot", "missing", "add `[robot]`"),
    ("missing vitreous", VITREOUS, "", 1, "vitreous", "missing", "add `[vitreous]`"),
    ("missing measurement", MEASUREMENT, "", 1, "measurement", "missing", "add `[measurement]`"),
    ("missing key", "id = \"porcine-01\"\n", "", 1, "specimen.id", "missing in [specimen]", "add `id = \"porcine-01\"`"),
    ("missing shape", "shape = \"sphere\"\n", "", 4, "robot.shape", "missing", "add `shape = \"sphere\"`"),
    ("missing size", "diameter_mm = 20.0\n", "", 8, "vitreous.diameter_mm", "missing", "add `diameter_mm = 20.0`"),
    ("missing Poisson ratio", "poisson_ratio = 0.48\n", "", 8, "vitreous.poisson_ratio", "missing", "add `poisson_ratio = 0.48`"),
    ("missing file", "file = \"trajectory.csv\"\n", "", 12, "measurement.file", "missing", "add `file = \"trajectory.csv\"`"),
    ("empty id", "\"porcine-01\"", "\" \"", 2, "specimen.id", "empty", "between the quotes"),
    ("text for a number", "0.55", "\"0.55\"", 6, "robot.diameter_mm", "expected a decimal number, found string", "diameter_mm = 1.0"),
    ("number for text", "\"porcine\"", "3", 3, "specimen.species", "expected text, found integer", "species = \"…\""),
    ("key for a table", SPECIMEN, "specimen = 3\n", 1, "specimen", "expected a table", "[specimen]"),
    ("no interval", "noise_um = 4.0", "left_out_s = [1.0, 2.0]", 16, "measurement.left_out_s", "not a pair of numbers", "left_out_s = [[1.0, 2.5]"),
    ("interval backwards", "noise_um = 4.0", "left_out_s = [[2.0, 1.0]]", 16, "measurement.left_out_s", "not a pair of numbers", "[[1.0, 2.5]"),
    ("interval of nothing", "noise_um = 4.0", "left_out_s = [[100, 200]]", 16, "measurement.left_out_s", "no position between 100 and 200 s remains to be left out", "times of the record"),
    ("interval given twice", "noise_um = 4.0", "left_out_s = [[1, 2], [1, 2]]", 16, "measurement.left_out_s", "no position between 1 and 2 s remains to be left out", "times of the record"),
    ("NaN size", "0.55", "nan", 6, "robot.diameter_mm", "not a finite number", "finite decimal"),
    ("infinite size", "20.0", "inf", 9, "vitreous.diameter_mm", "not a finite number", "finite decimal"),
    ("zero size", "0.55", "0", 6, "robot.diameter_mm", "0 is not above zero", "above zero, as in `diameter_mm = 0.55`"),
    ("negative size", "20.0", "-20", 9, "vitreous.diameter_mm", "-20 is not above zero", "above zero, as in `diameter_mm = 20.0`"),
    ("negative density", "7500", "-1", 7, "robot.density_kg_m3", "not above zero", "as in `density_kg_m3 = 7500`"),
    ("zero density", "1000", "0", 11, "vitreous.density_kg_m3", "not above zero", "as in `density_kg_m3 = 1000`"),
    ("negative noise", "4.0", "-4.0", 16, "measurement.noise_um", "not above zero", "as in `noise_um = 4.0`"),
    ("negative compliance", BOTH_BODIES, "[instrument]\ncompliance_per_m = -1\n", 5, "instrument.compliance_per_m", "not above zero", "above zero"),
    ("missing compliance", BOTH_BODIES, "[instrument]\n", 4, "instrument.compliance_per_m", "missing", "add `compliance_per_m = 1.59e6`"),
    ("Poisson ratio 0.5", "0.48", "0.5", 10, "vitreous.poisson_ratio", "0.5 lies outside (−1, 0.5)", "0.499"),
    ("Poisson ratio −1", "0.48", "-1.0", 10, "vitreous.poisson_ratio", "outside (−1, 0.5)", "above −1 and below 0.5"),
    ("robot not inside", "0.55", "20.0", 9, "vitreous.diameter_mm", "does not fit inside", "lengths in millimetres"),
    ("corner not inside", "\"sphere\"\ndiameter_mm = 0.55", "\"cylinder\"\nlength_mm = 16.0\norientation = \"vertical\"\ndiameter_mm = 12.1", 11, "vitreous.diameter_mm", "does not fit inside", "sizes in [robot]"),
    ("unknown shape", "\"sphere\"", "\"cube\"", 5, "robot.shape", "unknown shape `cube`", "\"ellipsoid\""),
    ("length of a sphere", "0.55", "0.55\nlength_mm = 1", 7, "robot.length_mm", "unknown key", "known here: shape, diameter_mm"),
    ("missing length", "\"sphere\"", "\"cylinder\"\norientation = \"vertical\"", 4, "robot.length_mm", "missing", "length_mm = 1.8"),
    ("missing orientation", "\"sphere\"", "\"cylinder\"\nlength_mm = 1.8", 4, "robot.orientation", "missing", "orientation = \"horizontal\""),
    ("unknown orientation", "\"sphere\"", "\"cylinder\"\nlength_mm = 1.8\norientation = \"diagonal\"", 7, "robot.orientation", "`diagonal`", "\"vertical\""),
    ("oblate ellipsoid", "\"sphere\"", "\"ellipsoid\"\nlength_mm = 0.5\norientation = \"vertical\"", 6, "robot.length_mm", "prolate", "exchange"),
    ("robot and instrument", "[vitreous]", "[instrument]\ncompliance_per_m = 1\n[vitreous]", 4, "robot", "both [instrument] and [robot]", "only [instrument]"),
    ("neither robot nor instrument", BOTH_BODIES, "", 1, "robot", "there is no [robot], [instrument] or [indenter]", "compliance_per_m"),
    ("file outside the directory", "\"trajectory.csv\"", "\"../trajectory.csv\"", 13, "measurement.file", "not a plain path", "beside experiment.toml"),
    ("absolute file", "\"trajectory.csv\"", "\"/data/trajectory.csv\"", 13, "measurement.file", "not a plain path", "beside experiment.toml"),
    ("calibrated and held out", "[2]", "[1, 2]", 15, "measurement.heldout_cycles", "cycle 1 is both fitted and held out", "from `calibration_cycles` or"),
    ("default calibration held out", "calibration_cycles = [1]\nheldout_cycles = [2]", "heldout_cycles = [1]", 14, "measurement.heldout_cycles", "both", "the default is the first cycle"),
    ("cycle that does not exist", "[2]", "[3]", 15, "measurement.heldout_cycles", "cycle 3 does not exist; the record has 2", "from 1 to 2"),
    ("cycle listed twice", "[1]", "[1, 1]", 14, "measurement.calibration_cycles", "listed twice", "once"),
    ("cycle zero", "[1]", "[0]", 14, "measurement.calibration_cycles", "whole number from 1", "calibration_cycles = [1, 2]"),
    ("cycle without a list", "[1]", "1", 14, "measurement.calibration_cycles", "expected a list of cycle numbers", "calibration_cycles = [1, 2]"),
    ("no calibration cycle", "[1]", "[]", 14, "measurement.calibration_cycles", "no cycle is fitted", "such as [1]"),
];

#[rustfmt::skip]
const CSV_CASES: &[Case] = &[
    ("missing column", "force_uN,", "", 1, "force_uN", "column for force is missing", "`force` followed by one of _N, _mN, _uN"),
    ("unknown column", "cycle", "cyle", 1, "cyle", "unknown column", "did you mean `cycle`"),
    ("unknown column far from any", "cycle", "temperature", 1, "temperature", "unknown column", "time_s,force_uN,position_um,cycle"),
    ("misspelt quantity", "position_um", "positon_um", 1, "positon_um", "unknown column", "did you mean `position_um`"),
    ("unknown unit", "time_s", "time_min", 1, "time_min", "unknown unit `_min`", "_s, _ms"),
    ("unit of another quantity", "position_um", "position_uN", 1, "position_uN", "unknown unit `_uN`", "_m, _mm, _um, _nm"),
    ("unit in the wrong case", "force_uN", "force_UN", 1, "force_UN", "unknown unit `_UN`", "case matters"),
    ("no unit", "time_s", "time", 1, "time", "no unit", "_s, _ms"),
    ("duplicate column", "cycle", "position_um", 1, "position_um", "two columns", "keep one"),
    ("two units for one quantity", "cycle", "position_mm", 1, "position_mm", "two columns contain this quantity; the other is `position_um`", "keep one"),
    ("two cycle columns", "position_um", "cycle", 1, "cycle", "two columns", "keep one"),
    ("semicolons", "time_s,force_uN,position_um,cycle", "time_s;force_uN;position_um;cycle", 1, "time_s;force_uN;position_um;cycle", "semicolons", "by commas"),
    ("time repeats", "\n3.5,", "\n2.5,", 5, "time_s", "2.5 s follows 2.5 s", "sort the rows"),
    ("time runs back", "\n13.5,", "\n1.5,", 15, "time_s", "not increasing", "sort the rows"),
    ("time before zero", "\n0.5,", "\n-0.5,", 2, "time_s", "before t = 0", "shift the times"),
    ("time is no number", "\n3.5,", "\n3:5,", 5, "time_s", "`3:5` is not a number", "correct the time"),
    ("infinite time", "\n19.5,", "\ninf,", 21, "time_s", "not a finite", "correct the time"),
    ("NaN force", "\n3.5,4.6", "\n3.5,NaN", 5, "force_uN", "`NaN` is not a finite number", "commanded"),
    ("infinite force", "\n13.5,4.6", "\n13.5,-inf", 15, "force_uN", "`-inf` is not a finite", "commanded"),
    ("force that overflows", "\n3.5,4.6", "\n3.5,1e999", 5, "force_uN", "not a finite", "commanded"),
    ("empty force", "\n3.5,4.6", "\n3.5,", 5, "force_uN", "the cell is empty", "use `vitreo-uq init` for tables in which blank forces"),
    ("impossible force", "\n13.5,4.6", "\n13.5,1e300", 15, "force_uN", "outside the range of possible experiments", "unit at the end"),
    ("impossible position", "3.25,1", "1e200,1", 5, "position_um", "outside the range of possible experiments", "unit at the end"),
    ("infinite position", "3.25,1", "inf,1", 5, "position_um", "not a finite", "leave the cell empty"),
    ("position is no number", "3.25,1", "lost,1", 5, "position_um", "`lost` is not a number", "leave the cell empty"),
    ("ragged row, short", "3.25,1", "3.25", 5, "", "3 cells, but the header has 4", "one cell for each column"),
    ("ragged row, decimal comma", "3.25,1", "3,25,1", 5, "", "5 cells, but the header has 4", "decimal point"),
    ("cycle runs back", "5.25,2", "5.25,1", 17, "cycle", "cycle 1 follows cycle 2", "in the order of time"),
    ("cycle is skipped", "0.25,2", "0.25,3", 12, "cycle", "cycle 3 follows cycle 1", "in the order of time"),
    ("cycles from 0", "0.25,1", "0.25,0", 2, "cycle", "`0` is not a cycle number", "1, 2, 3"),
    ("first cycle is not 1", "0.25,1", "0.25,2", 2, "cycle", "the first row belongs to cycle 2", "1, 2, 3"),
    ("cycle is no number", "3.25,1", "3.25,one", 5, "cycle", "`one` is not a cycle number", "remove the `cycle` column"),
];

#[track_caller]
fn assert_refused(
    name: &str,
    result: Result<(Experiment, ExperimentFiles)>,
    file: &str,
    line: usize,
    key: &str,
    words: (&str, &str),
) {
    let error = result.expect_err(name);
    assert_eq!(error.exit_code(), 2, "{name}");
    let text = error.to_string();
    let Error::Input { place, found, remedy } = error else { panic!("{name}: {text}") };
    assert_eq!(place.file.as_deref().and_then(|path| path.to_str()), Some(file), "{name}: {text}");
    assert_eq!(place.line, Some(line), "{name}: {text}");
    assert_eq!(place.key.as_deref().unwrap_or(""), key, "{name}: {text}");
    assert!(found.contains(words.0), "{name}: {text}");
    assert!(remedy.contains(words.1), "{name}: {text}");
    assert!(
        text.contains(file) && text.contains(&format!("line {line}")) && text.contains("what to do"),
        "{name}: {text}"
    );
}

#[test]
fn the_files_that_are_broken_below_are_accepted_whole() {
    let (experiment, files) = read(TOML, csv()).unwrap();
    assert_eq!((experiment.calibration_cycles, experiment.heldout_cycles), (vec![1], vec![2]));
    assert_eq!(experiment.noise_sd_m, Some(4e-6));
    assert_eq!(experiment.record.force_n[7], -4.6e-6);
    assert_eq!((files.toml_name.as_str(), files.csv_name.as_str()), ("experiment.toml", "trajectory.csv"));
    assert_eq!((files.toml_bytes, files.csv_bytes, files.notes), (TOML.into(), csv().into_bytes(), vec![]));
}

#[test]
fn every_unacceptable_toml_is_refused_at_its_line_and_key() {
    for &(name, from, to, line, key, found, remedy) in TOML_CASES {
        let broken = TOML.replacen(from, to, 1);
        assert_ne!(broken, TOML, "{name}");
        assert_refused(name, read(&broken, csv()), "dir/experiment.toml", line, key, (found, remedy));
        // Windows line ends and a byte-order mark do not change line numbers.
        let windows = format!("\u{feff}{}", broken.replace('\n', "\r\n"));
        assert_refused(name, read(windows, csv()), "dir/experiment.toml", line, key, (found, remedy));
    }
}

#[test]
fn every_unacceptable_csv_is_refused_at_its_line_and_column() {
    for &(name, from, to, line, key, found, remedy) in CSV_CASES {
        let broken = csv().replacen(from, to, 1);
        assert_ne!(broken, csv(), "{name}");
        assert_refused(name, read(TOML, &broken), "dir/trajectory.csv", line, key, (found, remedy));
        let windows = format!("\u{feff}{}", broken.replace('\n', "\r\n"));
        assert_refused(name, read(TOML, windows), "dir/trajectory.csv", line, key, (found, remedy));
    }
}

#[test]
fn what_concerns_whole_files_is_refused() {
    let toml = "dir/experiment.toml";
    let trajectory = "dir/trajectory.csv";
    assert_refused("empty TOML", read("", csv()), toml, 1, "", ("empty", "example"));
    assert_refused("blank CSV", read(TOML, "\n \n"), trajectory, 1, "", ("empty", "example"));
    assert_refused("binary TOML", read(b"[specimen]\nid = \"\xff\"", csv()), toml, 2, "", ("not UTF-8", "UTF-8"));
    assert_refused("binary CSV", read(TOML, b"PK\x03\x04\n\xfe\xff"), trajectory, 2, "", ("not UTF-8", "spreadsheet"));
    let header = "time_s,force_uN,position_um\n";
    assert_refused("no rows", read(TOML, header), trajectory, 1, "", ("0 rows", "at least two"));
    assert_refused("one row", read(TOML, format!("{header}0,1,0\n")), trajectory, 2, "", ("1 rows", "at least two"));
    let still = csv().replace("-4.6", "0").replace("4.6", "0.0");
    assert_refused(
        "no force",
        read(TOML, still),
        trajectory,
        2,
        "force_uN",
        ("zero in every row", "commanded force in this column"),
    );
}

#[test]
fn fewer_than_eight_positions_in_a_calibration_cycle_are_refused() {
    let without = |rows: std::ops::Range<usize>| -> String {
        let empty = |(line, text): (usize, &str)| {
            let cells: Vec<&str> = text.split(',').collect();
            let lost = line >= 1 && rows.contains(&(line - 1));
            format!("{},{},{},{}\n", cells[0], cells[1], if lost { "" } else { cells[2] }, cells[3])
        };
        csv().lines().enumerate().map(empty).collect()
    };
    read(TOML, without(3..5)).unwrap();
    let words = ("calibration cycle 1 starts here and has 7 positions; 8 are needed", "`calibration_cycles`");
    assert_refused("cycle 1", read(TOML, without(3..6)), "dir/trajectory.csv", 2, "position_um", words);
    let second = TOML.replace("[2]", "[]").replace("[1]", "[1, 2]");
    let words = ("calibration cycle 2 starts here and has 1 positions", "measure more");
    assert_refused("cycle 2", read(second, without(10..19)), "dir/trajectory.csv", 12, "position_um", words);
    let words = ("the column is empty", "write the measured positions");
    assert_refused("a protocol", read(TOML, without(0..1000)), "dir/trajectory.csv", 2, "position_um", words);
    // A held-out cycle may be short.
    read(TOML, without(10..19)).unwrap();
}

#[test]
fn missing_files_are_named_with_a_remedy() {
    let place = tempfile::tempdir().unwrap();
    let toml_path = place.path().join("experiment.toml");
    for (content, missing) in [(None, "experiment.toml"), (Some(TOML), "trajectory.csv")] {
        if let Some(content) = content {
            std::fs::write(&toml_path, content).unwrap();
        }
        let error = Experiment::read(place.path()).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        let Error::File { action, path, remedy, .. } = error else { panic!("{error}") };
        assert_eq!((action, path), ("read", place.path().join(missing)));
        assert!(!remedy.is_empty());
    }
    std::fs::write(place.path().join("trajectory.csv"), csv()).unwrap();
    let from_directory = Experiment::read(place.path()).unwrap();
    assert_eq!(from_directory, Experiment::read(&toml_path).unwrap());
    assert_eq!(from_directory.1.csv_bytes, csv().into_bytes());
}

/// 20,000 files with up to six random bytes changed, removed, doubled or cut off: accepted or refused, never a panic.
#[test]
fn damaged_files_never_panic() {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(2);
    let without_cycles: String =
        csv().lines().map(|line| format!("{}\n", line.rsplit_once(',').map_or(line, |(left, _)| left))).collect();
    let pieces: [&[u8]; 8] = [b",", b"\n", b"\"", b"-", b"1e308", b"nan", b"\xff", b"="];
    let mut n_accepted = 0;
    for round in 0..20_000 {
        let mut files =
            [TOML.as_bytes().to_vec(), if round % 4 == 1 { without_cycles.clone() } else { csv() }.into_bytes()];
        let damaged = &mut files[round % 2];
        for _ in 0..rng.random_range(1..=6) {
            let at = rng.random_range(0..damaged.len().max(1)).min(damaged.len().saturating_sub(1));
            match rng.random_range(0..12) {
                _ if damaged.is_empty() => {}
                0 => damaged.truncate(at),
                1..=3 => drop(damaged.remove(at)),
                4..=6 => damaged.insert(at, damaged[at]),
                7..=8 => damaged[at] = rng.random(),
                _ => drop(damaged.splice(at..at, pieces[rng.random_range(0..pieces.len())].iter().copied())),
            }
        }
        match read(&files[0], &files[1]) {
            Ok((experiment, _)) => {
                n_accepted += 1;
                assert!(experiment.record.time_s.windows(2).all(|pair| pair[0] < pair[1]));
                assert!(experiment.record.force_n.iter().all(|force_n| force_n.is_finite()));
                assert_eq!(experiment.record.cycle.len(), experiment.record.n_rows());
                experiment.reference_noise();
                experiment.record.force_step_rows();
            }
            Err(error) => assert!(error.to_string().contains("what to do")),
        }
    }
    assert!((100..19_000).contains(&n_accepted), "the damage is neither harmless nor always fatal: {n_accepted}");
}
