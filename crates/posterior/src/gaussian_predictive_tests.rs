//! Tests of nearly normal predictions against mixtures, and of joint probabilities in closed form against simulations.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::full_check::{DrawnNoise, FullCheck};
use super::super::heldout::{bands_m, mixture, score};
use super::super::joint::{Predicted, joint};
use super::{BAND_PROBABILITIES, band_normals, near_normals};
use crate::noise::NoiseModel;
use record::Record;

/// Returns 24 draws with a noise of about 4 µm. Their positions deviate by up to 2 × `reach` times the noise. Their noise deviates by up to half of `reach`, relative
/// to 4 µm.
fn varied_check(n_rows: usize, reach: f64) -> FullCheck {
    let draws = 24;
    let part = |k: usize, seed: f64| reach * (seed * k as f64).sin();
    let x = |k: usize, i: usize| 1e-4 * (i as f64 * 0.1).sin() + 4e-6 * part(k, 1.3) * (1.0 + (0.01 * i as f64).cos());
    let sd_m = |k: usize| 4e-6 * (1.0 + 0.5 * part(k, 2.9));
    let noise = DrawnNoise {
        model: NoiseModel::default(),
        parameters: (0..draws).map(|k| vec![1e6 * sd_m(k)]).collect(),
        sd_m: (0..draws).map(|k| vec![sd_m(k); n_rows]).collect(),
        components: vec![vec![1.0]; draws],
    };
    FullCheck {
        draws: Vec::new(),
        n_refused: None,
        trajectories_m: (0..draws).map(|k| (0..n_rows).map(|i| x(k, i)).collect()).collect(),
        noise,
        surrogate_vs_full_max_m: None,
        pareto_k: None,
        weights: None,
        fe_runs: 0,
        largest_strain: None,
        discretisation_m: None,
    }
}

/// The series for nearly normal predictions gives the centres, bands and mean scores of the mixtures. Draws that differ too much have no series.
#[test]
fn nearly_normal_predictions_are_the_mixtures() {
    let check = varied_check(300, 0.05);
    let normals = band_normals();
    for (row, near) in near_normals(&check, 0..300).into_iter().enumerate().step_by(7) {
        let (near, exact) = (near.expect("near"), mixture(&check, row));
        assert!(
            ((near.mean_m - exact.mean()) / exact.sd()).abs() < 1e-9 && (near.sd_m / exact.sd() - 1.0).abs() < 1e-9
        );
        for (z, probability) in normals.into_iter().zip(BAND_PROBABILITIES) {
            let error = (near.quantile_m(z) - exact.quantile(probability)) / exact.sd();
            assert!(error.abs() < 2e-5, "{row} {probability}: {error}");
        }
        // The mixture's score uses only some pairs of draws. The score of the series uses all pairs.
        for y in [-2.5, -0.3, 0.0, 1.2, 4.0] {
            let y = exact.mean() + y * exact.sd();
            assert!((near.crps_m(y) - exact.crps(y)).abs() < 2e-3 * exact.sd(), "{row}");
        }
    }
    assert!(near_normals(&varied_check(3, 0.5), 0..3).iter().all(Option::is_none));
}

/// Compares the closed forms with the simulation on 3000 rows, for a good and a bad measurement. Probabilities agree within 0.03 and ranges within 0.004. The standard
/// errors of 4000 simulations are 0.008 for probabilities and 0.001 for ranges. The coverage of 3000 rows has steps of 0.0003.
#[test]
fn closed_forms_are_what_simulations_find() {
    let n_rows = 3000;
    let check = varied_check(n_rows, 0.05);
    let bands = bands_m(&check);
    let record = Record {
        time_s: (0..n_rows).map(|i| i as f64).collect(),
        force_n: vec![0.0; n_rows],
        position_m: vec![None; n_rows],
        cycle: vec![1; n_rows],
        ..Record::default()
    };
    let centre: Vec<(f64, f64)> = (0..n_rows).map(|row| mixture(&check, row)).map(|m| (m.mean(), m.sd())).collect();
    let places: Vec<usize> = (0..n_rows).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    for stretch in [1.0, 1.03] {
        let draw = |rng: &mut ChaCha8Rng| -> f64 { rng.sample(rand_distr::StandardNormal) };
        let observed: Vec<Option<f64>> =
            centre.iter().map(|(mean, sd)| Some(mean + stretch * sd * draw(&mut rng))).collect();
        let simulated = score(&check, &bands, &record, &observed, 5).expect("there are positions");
        let z = |(y, (mean, sd)): (&Option<f64>, &(f64, f64))| (y.unwrap_or(0.0) - mean) / sd;
        let z: Vec<f64> = observed.iter().zip(&centre).map(z).collect();
        let largest = z.iter().fold(0.0_f64, |a, z| a.max(z.abs()));
        let square = z.iter().map(|z| z * z).sum::<f64>() / n_rows as f64;
        let predicted = Predicted { check: &check, rows: &places, centre: &centre, bands_m: &bands };
        let joint = joint(&predicted, largest, square);
        let joint_p = (2.0 * joint.p_largest.min(joint.p_square)).min(1.0);
        assert!((joint_p - simulated.joint_p).abs() < 0.06, "{joint:?} {simulated:?}");
        for (ours, theirs) in joint.coverage.iter().zip(simulated.coverage_expected) {
            assert!(
                (ours[0] - theirs[0]).abs() < 0.004 && (ours[1] - theirs[1]).abs() < 0.004,
                "{joint:?} {simulated:?}"
            );
        }
    }
}
