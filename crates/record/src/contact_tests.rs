use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use super::*;
use crate::Tip;

const INDENTER: Indenter = Indenter { tip: Tip::Sphere, size: None, poisson_ratio: 0.5, cantilever_n_per_m: None };
const FREE_N: f64 = 11.2e-9;
const INTERVAL_S: f64 = 0.01;
/// Noise standard deviation of the force, in N.
const FORCE_SD_N: f64 = 5e-12;
const CONTACT: usize = 150;
const HOLD: usize = 300;
const RETRACT: usize = 500;

/// Returns the record of a tip that approaches at 10 µm/s and touches at row 150. The tip holds at 10 nN from row 300 to 500, and is then withdrawn.
/// During loading the force is 10 nN (depth/15 µm)^1.5.
fn indentation(drift_n_per_s: f64, seed: u64) -> Trajectory {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let noise = Normal::new(0.0, FORCE_SD_N).unwrap();
    let mut trajectory = Trajectory::empty(false, "force_nN", "depth_um");
    for row in 0..700_usize {
        let depth_m = match row {
            0..HOLD => 10e-6 * INTERVAL_S * (row as f64 - CONTACT as f64),
            HOLD..RETRACT => 15e-6 + 1e-9 * (row - HOLD) as f64,
            _ => 15.2e-6 - 10e-6 * INTERVAL_S * (row - RETRACT) as f64,
        };
        let pressing_n = match row {
            HOLD..RETRACT => 10e-9,
            _ => 10e-9 * (depth_m.max(0.0) / 15e-6).powf(1.5),
        };
        let time_s = INTERVAL_S * row as f64;
        trajectory.time_s.push(time_s);
        trajectory.force_n.push(FREE_N + drift_n_per_s * time_s.min(1.5) + pressing_n + noise.sample(&mut random));
        trajectory.position_m.push(Some(40e-6 + depth_m));
        trajectory.lines.push(row + 2);
    }
    trajectory
}

fn settle(trajectory: &mut Trajectory, indenter: &Indenter) -> Result<Note> {
    trim_to_contact(Path::new("t.csv"), trajectory, indenter)
}

/// Checks the force on the free tip, the contact and the end of the record. The force is found within 5 standard errors of a line through 120 rows
/// that is extrapolated by 30 rows; for 100 records this fails once in 10⁶. Contact is found within 10 rows, after which the mean force of five rows
/// reaches 17 noise standard deviations. No row of the retraction remains.
#[test]
fn what_is_left_is_the_growing_contact() {
    for seed in 0..50 {
        for drift_n_per_s in [0.0, 8e-12] {
            let mut trajectory = indentation(drift_n_per_s, seed);
            let Note::Contact { from_s, to_s, compared_from_s, n_before, n_after, free_n } =
                settle(&mut trajectory, &INDENTER).unwrap()
            else {
                panic!("a note of contact")
            };
            let free_n = free_n.expect("rows before contact")[0];
            let truth_n = FREE_N + 1.5 * drift_n_per_s;
            assert!((free_n - truth_n).abs() < 5.0 * 0.35 * FORCE_SD_N, "{seed}: {free_n:e} for {truth_n:e}");
            assert!((CONTACT - 25..CONTACT + 10).contains(&n_before), "{seed}: {n_before}");
            assert_eq!(n_after, 700 - RETRACT - 1, "{seed}");
            assert!((to_s - RETRACT as f64 * INTERVAL_S).abs() < 1e-9 && from_s < compared_from_s);
            // Positions are compared above 2 % of the largest force. There the depth is 0.0737 × 15 µm, 11 rows after contact.
            let first = trajectory.position_m.iter().position(Option::is_some).expect("positions");
            assert!((n_before + first).abs_diff(CONTACT + 11) <= 1, "{seed}: {first}");
            let n = trajectory.time_s.len();
            assert_eq!(n, 700 - n_before - n_after);
            assert!([trajectory.force_n.len(), trajectory.position_m.len(), trajectory.lines.len()] == [n; 3]);
            assert!((trajectory.force_n[n - 2] - 10e-9).abs() < 6.0 * FORCE_SD_N);
        }
    }
}

/// Noise of the depth is no decrease: a hold of constant depth keeps its rows, and a retraction is cut off. The mean of nine rows falls by its error of one standard deviation
/// within three rows of the retraction, which falls by 0.1 µm a row.
#[test]
fn noise_of_the_depth_is_no_retraction() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    for sd_m in [10e-9, 50e-9, 150e-9] {
        let noise = Normal::new(0.0, sd_m).unwrap();
        let mut trajectory = indentation(0.0, 1);
        for (row, x) in trajectory.position_m.iter_mut().enumerate() {
            let creep_m = 1e-9 * (row.clamp(HOLD, RETRACT) - HOLD) as f64;
            *x = x.map(|x| x - creep_m + noise.sample(&mut random));
        }
        let mut held = Trajectory {
            time_s: trajectory.time_s.clone(),
            force_n: trajectory.force_n.clone(),
            position_m: trajectory.position_m.clone(),
            lines: trajectory.lines.clone(),
            ..Trajectory::empty(false, "force_nN", "depth_um")
        };
        keep(&mut held, 0..RETRACT);
        let Note::Contact { n_after, .. } = settle(&mut held, &INDENTER).unwrap() else { panic!("a note of contact") };
        assert_eq!(n_after, 0, "{sd_m:e}");
        let Note::Contact { n_after, .. } = settle(&mut trajectory, &INDENTER).unwrap() else { panic!("a note") };
        assert!(n_after.abs_diff(700 - RETRACT) <= 20, "{sd_m:e}: {n_after}");
    }
}

/// Checks that the deflection of the spring that carries the tip is subtracted from the position. A force of 10 nN at a stiffness of 0.05 N/m gives a
/// deflection of 0.2 µm.
#[test]
fn the_deflection_of_the_spring_is_taken_off() {
    let (mut stiff, mut soft) = (indentation(0.0, 1), indentation(0.0, 1));
    settle(&mut stiff, &INDENTER).unwrap();
    settle(&mut soft, &Indenter { cantilever_n_per_m: Some(0.05), ..INDENTER }).unwrap();
    let at = |trajectory: &Trajectory| trajectory.position_m[200].expect("in the hold");
    assert!(((at(&stiff) - at(&soft)) / 0.2e-6 - 1.0).abs() < 0.01, "{} {}", at(&stiff), at(&soft));
}

/// A spring that is stated too soft would be deflected by 20 µm, but the recorded position moves by 15 µm.
#[test]
fn a_spring_that_is_too_soft_is_named() {
    let mut trajectory = indentation(0.0, 1);
    let refused = settle(&mut trajectory, &Indenter { cantilever_n_per_m: Some(5e-4), ..INDENTER });
    let refused = refused.expect_err("a refusal").to_string();
    assert!(refused.contains("correct `cantilever_n_per_m`"), "{refused}");
}

#[test]
fn a_record_that_begins_in_contact_keeps_its_forces() {
    let mut trajectory = indentation(0.0, 2);
    keep(&mut trajectory, CONTACT..RETRACT);
    let force_n = trajectory.force_n.clone();
    let Note::Contact { n_before, n_after, free_n, .. } = settle(&mut trajectory, &INDENTER).unwrap() else {
        panic!("a note of contact")
    };
    assert_eq!((n_before, n_after, free_n), (0, 0, None));
    assert_eq!(trajectory.force_n, force_n);
    // A force that grows evenly from the first row on has no rows with a free tip, even if it stays small for many rows.
    let mut ramp = indentation(0.0, 2);
    keep(&mut ramp, CONTACT..RETRACT);
    ramp.force_n.iter_mut().enumerate().for_each(|(row, force)| *force = 1e-12 * row as f64);
    let note = settle(&mut ramp, &INDENTER).unwrap();
    assert!(matches!(note, Note::Contact { n_before: 0, free_n: None, .. }), "{note}");
}

#[test]
fn what_is_no_indentation_is_refused_with_a_remedy() {
    let refused = |change: &dyn Fn(&mut Trajectory), words: &[&str]| {
        let mut trajectory = indentation(0.0, 3);
        change(&mut trajectory);
        let message = settle(&mut trajectory, &INDENTER).unwrap_err().to_string();
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
    };
    let heights = |t: &mut Trajectory| t.position_m.iter_mut().flatten().for_each(|x| *x = -*x);
    refused(&heights, &["depth_um", "falls by", "direction = \"-\""]);
    refused(&|t| t.force_n.iter_mut().for_each(|f| *f = -*f), &["force_nN", "no force presses", "sign"]);
    refused(&|t| t.position_m.iter_mut().for_each(|x| *x = None), &["no position remains"]);
    refused(
        &|t| keep(t, 0..CONTACT + 20),
        &["positions lie between the start of the contact and its largest depth", "approach and the hold"],
    );
}
