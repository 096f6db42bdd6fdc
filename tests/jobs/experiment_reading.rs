//! Defaults in reading an experiment: cycles, held-out cycles, noise, and a force that begins before the camera.

use std::path::Path;

use vitreo_uq::record::{Experiment, NoiseOrigin};

/// Reads an instrument's experiment with these rows (a header and lines) and additional lines of TOML.
fn read(csv: &str, more: &[(&str, &str)], toml: &str) -> Experiment {
    let folder = tempfile::tempdir().expect("a folder");
    let text = format!(
        "[specimen]\nid = \"gel\"\n[instrument]\ncompliance_per_m = 549.0\n[measurement]\nfile = \"trajectory.csv\"\nsource = \"synthetic\"\n{toml}"
    );
    for (name, text) in [("experiment.toml", text.as_str()), ("trajectory.csv", csv)].iter().chain(more) {
        std::fs::write(folder.path().join(name), text).expect("a file");
    }
    Experiment::read(Path::new(folder.path())).expect("a sound experiment").0
}

/// A stage that is 1.5 % fast in one half of a record and slow in the other. Cycles begin at upward force steps, although none lies a whole number of periods from the first.
#[test]
fn cycles_without_a_column_follow_a_period_that_drifts() {
    let mut starts_s = vec![0.0];
    for k in 0..24 {
        starts_s.push(starts_s[k] + if k < 12 { 0.98 } else { 1.02 });
    }
    let mut csv = String::from("time_s,force_uN,position_um\n");
    let mut expected = Vec::new();
    for k in 0..24 {
        for row in 0..50 {
            let t = starts_s[k] + (starts_s[k + 1] - starts_s[k]) * f64::from(row) / 50.0;
            let force_un = if row < 25 { 4.6 } else { -4.6 };
            csv += &format!("{t:.5},{force_un},{:.3}\n", 0.3 * f64::from((7 * row + 3 * k as i32) % 11));
            expected.push(k as u32 + 1);
        }
    }
    assert_eq!(read(&csv, &[], "").record.cycle, expected);
}

/// By default the first cycle is fitted and all others are held out, including the last.
#[test]
fn all_cycles_but_the_first_are_held_out() {
    let row = |row: u32| {
        let force_un = if row % 20 < 10 { 1.0 } else { -1.0 };
        format!("{:.2},{force_un},{},{}\n", 0.1 * f64::from(row), row % 7, 1 + row / 20)
    };
    let csv = String::from("time_s,force_uN,position_um,cycle\n") + &(0..60).map(row).collect::<String>();
    let experiment = read(&csv, &[], "");
    assert_eq!((experiment.calibration_cycles, experiment.heldout_cycles), (vec![1], vec![2, 3]));
}

/// Three rests of eight positions ±1 µm about a line: 24 squares, minus a slope and a level each, leave √(24/18) µm. The pattern + − − + + − − + has neither.
#[test]
fn a_line_through_each_rest_is_taken_from_its_noise() {
    let pattern = [1.0, -1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0];
    let mut csv = String::from("time_s,force_uN,position_um,cycle\n");
    let mut row = 0;
    for cycle in 1..=3 {
        for place in 0..40 {
            // Eight rows of force, then a rest whose last quarter counts.
            let (force_un, position_um) = match place {
                0..8 => (1.0, 40.0 * f64::from(place)),
                8..32 => (0.0, 300.0 - 9.0 * f64::from(place)),
                _ => (0.0, 5.0 + pattern[place as usize - 32]),
            };
            csv += &format!("{:.1},{force_un},{position_um},{cycle}\n", 0.1 * f64::from(row));
            row += 1;
        }
    }
    let found = read(&csv, &[], "").reference_noise().expect("rests");
    let NoiseOrigin::Rest { n_positions, n_windows, .. } = found.origin else { panic!("{found:?}") };
    assert_eq!((n_positions, n_windows), (24, 3));
    assert!((1e6 * found.sd_m - (24.0_f64 / 18.0).sqrt()).abs() < 1e-6, "{found:?}");
}

/// Rows alternately 20 and 40 ms apart, with white noise of 4 µm on a straight motion. A position deviates from the line through its neighbours by √(1 + w² + (1 − w)²) times the noise, w = ⅓ or ⅔. The median of 3,000 such
/// correlated differences has a standard error of 2 %; four of them are allowed.
#[test]
fn short_lags_are_right_on_uneven_rows() {
    let mut state = 1_u64;
    let mut unit = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    };
    let mut csv = String::from("time_s,force_uN,position_um,cycle\n");
    let mut t = 0.0;
    for row in 0..6_200 {
        let normal = (-2.0 * unit().ln()).sqrt() * (std::f64::consts::TAU * unit()).cos();
        let force_un = if row < 3_100 { 1.0 } else { -1.0 };
        csv += &format!("{t:.3},{force_un},{:.5},{}\n", 3.0 * t + 4.0 * normal, 1 + row / 3_100);
        t += if row % 2 == 0 { 0.02 } else { 0.04 };
    }
    let found = read(&csv, &[], "").reference_noise().expect("differences");
    assert!(matches!(found.origin, NoiseOrigin::ShortLag { n_differences } if n_differences > 2_900), "{found:?}");
    assert!((found.sd_m / 4e-6 - 1.0).abs() < 0.08, "{found:?}");
}

/// A coil is switched on 0.7 s before the camera. Times count from then, so the position is 0 at the start of the force.
#[test]
fn a_force_before_the_camera_moves_the_clock() {
    let camera: String = (0..40).map(|row| format!("{:.2},{},{}\n", 0.1 * f64::from(row), row, 1 + row / 20)).collect();
    let log = "t_s,F_uN\n-0.7,4.6\n1.25,-4.6\n";
    let toml = "calibration_cycles = [1, 2]\n[actuation]\nfile = \"coil.csv\"\n[actuation.columns]\ntime = \"t_s\"\nforce = \"F_uN\"\n";
    let record = read(&format!("time_s,position_um,cycle\n{camera}"), &[("coil.csv", log)], toml).record;
    let forces: Vec<(f64, f64)> =
        record.force_rows.iter().map(|&row| (record.time_s[row], record.force_n[row])).collect();
    assert_eq!(forces.iter().map(|force| force.1).collect::<Vec<_>>(), [4.6e-6, -4.6e-6]);
    for (found, expected) in forces
        .iter()
        .map(|pair| pair.0)
        .chain([record.time_s[1], *record.time_s.last().expect("rows")])
        .zip([0.0, 1.95, 0.7, 4.6])
    {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
}

/// Positions of an interval, ends included, are lost. Times, forces and cycles stay unchanged.
#[test]
fn positions_that_are_left_out_are_lost() {
    let rows: String = (0..40)
        .map(|row| format!("{},{},{row},{}\n", row, if row % 10 < 5 { 4.6 } else { -4.6 }, 1 + row / 10))
        .collect();
    let csv = format!("time_s,force_uN,position_um,cycle\n{rows}");
    let (whole, left) = (read(&csv, &[], ""), read(&csv, &[], "left_out_s = [[11, 13.5], [25.0, 25.0]]\n"));
    let lost: Vec<usize> = (0..40).filter(|row| left.record.position_m[*row].is_none()).collect();
    assert_eq!(lost, [11, 12, 13, 25]);
    assert_eq!((&left.record.time_s, &left.record.force_n), (&whole.record.time_s, &whole.record.force_n));
    assert_eq!(left.record.cycle, whole.record.cycle);
    assert!(
        (0..40)
            .filter(|row| !lost.contains(row))
            .all(|row| left.record.position_m[row] == whole.record.position_m[row])
    );
}
