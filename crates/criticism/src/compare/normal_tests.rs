//! Tests that the elimination of cycles agrees with dense algebra on the full normal equations.

use super::*;
use crate::NoiseValues;
use base::error::InputPlace;
use posterior::noise::{NoiseLikelihood, NoiseModel, ProductRequest};

/// Whitened columns of a record with short and long cycles: three columns, the residuals, and one column per cycle.
struct Dense {
    normal: Normal,
    columns: Vec<Vec<f64>>,
    residual: Vec<f64>,
    of_cycles: Vec<Vec<f64>>,
}

fn dense(noise: &NoiseValues) -> Dense {
    let n = 700;
    let time_s: Vec<f64> = (0..n).map(|row| 0.05 * row as f64 + if row > 300 { 3.0 } else { 0.0 }).collect();
    let cycle: Vec<u32> =
        (0..n).map(|row| if row < 200 { 1 + (row / 8) as u32 } else { 26 + (row / 100) as u32 }).collect();
    let position_m: Vec<f64> = time_s.iter().map(|t| 6e-4 * (0.9 * t).sin()).collect();
    let residual_m: Vec<f64> =
        (0..n).map(|row| 4e-6 * (12.9 * (row * row) as f64).sin() + 2e-6 * (0.03 * row as f64).cos()).collect();
    let observed: Vec<Option<f64>> = position_m.iter().zip(&residual_m).map(|(x, r)| Some(x + r)).collect();
    let names = ["white", "ou", "gain"].map(String::from);
    let model = NoiseModel::named(&names, &InputPlace::default()).expect("names");
    let likelihood = NoiseLikelihood::new(model, &time_s, &cycle, &observed);
    // The first column is the position, the second is nearly confined to one cycle, and the third varies slowly.
    let columns_m = [
        position_m.clone(),
        cycle.iter().map(|c| if *c == 30 { 1e-3 } else { 1e-9 * f64::from(*c) }).collect(),
        time_s.iter().map(|t| 1e-4 * (0.1 * t).cos()).collect(),
    ];
    let slices: Vec<&[f64]> = columns_m.iter().map(Vec::as_slice).chain([residual_m.as_slice()]).collect();
    let range = 4..4;
    let asked =
        ProductRequest { columns: &slices, n_common: 4, own: std::slice::from_ref(&range), with_cycles: Some(0) };
    let products = likelihood.white_products(&asked, &position_m, noise).expect("in support");
    let numbers: Vec<u32> = cycle.chunk_by(|a, b| a == b).map(|rows| rows[0]).collect();
    let has_column: Vec<bool> = (0..numbers.len()).map(|k| k != 3 && k != numbers.len() - 2).collect();
    let units: Vec<Vec<f64>> = numbers
        .iter()
        .zip(&has_column)
        .filter(|(_, has)| **has)
        .map(|(number, _)| cycle.iter().map(|c| f64::from(u8::from(c == number))).collect())
        .collect();
    let normal = Normal {
        products: products.sets[0].clone(),
        cycles: products.cycles,
        has_column,
        priors: vec![(300.0, 0.4), (0.0, 0.0), (0.0, 0.0)],
    };
    let mut white = likelihood.whiten(&columns_m, &position_m, noise);
    white.push(likelihood.whiten(&[residual_m], &position_m, noise).remove(0));
    let residual = white.remove(3);
    Dense { normal, columns: white, residual, of_cycles: likelihood.whiten(&units, &position_m, noise) }
}

#[test]
fn eliminated_cycles_have_the_amplitudes_and_errors_of_the_whole_equations() {
    for noise in [
        NoiseValues::new([4.0, 1e-3, 0.5, 1e-6, 1e-3]),
        NoiseValues::new([4.0, 3.0, 0.5, 0.01, 2.0]),
        NoiseValues::new([1.0, 20.0, 30.0, 1e-4, 0.1]),
    ] {
        let Dense { normal, columns, residual, of_cycles } = dense(&noise);
        let all: Vec<&Vec<f64>> = columns.iter().chain(&of_cycles).collect();
        let n = all.len();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut whole = DMatrix::from_fn(n, n, |i, j| dot(all[i], all[j]));
        let mut slope = DVector::from_fn(n, |i, _| dot(all[i], &residual));
        for (k, (inverse_sd, pull)) in normal.priors.iter().enumerate() {
            whole[(k, k)] += inverse_sd * inverse_sd;
            slope[k] += inverse_sd * pull;
        }
        (0..n).for_each(|k| whole[(k, k)] *= 1.0 + RIDGE);
        let inverse = whole.clone().try_inverse().expect("regular");
        let amplitudes = &inverse * &slope;
        let solved = normal.solve().expect("regular");
        let error = |k: usize| inverse[(k, k)].sqrt();
        for k in 0..3 {
            assert!((solved.amplitudes[k] - amplitudes[k]).abs() < 1e-5 * error(k), "{k}");
        }
        let with_column: Vec<usize> = (0..normal.has_column.len()).filter(|cycle| normal.has_column[*cycle]).collect();
        assert_eq!(with_column.len(), n - 3);
        let in_cycles = solved.in_cycles();
        for (k, cycle) in with_column.iter().enumerate() {
            assert!((solved.of_cycles[*cycle] - amplitudes[3 + k]).abs() < 1e-5 * error(3 + k), "cycle {cycle}");
            let weights = DVector::from_column_slice(&[0.3, -0.2, 0.1]);
            let mut all_weights = DVector::zeros(n);
            all_weights.rows_mut(0, 3).copy_from(&weights);
            all_weights[3 + k] = 1.0;
            let variance = all_weights.dot(&(&inverse * &all_weights));
            let (mean, sd) = solved.weighted_in_cycle(&weights, *cycle, &in_cycles[*cycle]);
            assert!((sd / variance.sqrt() - 1.0).abs() < 1e-5, "{sd} {}", variance.sqrt());
            assert!((mean - all_weights.dot(&amplitudes)).abs() < 1e-5 * sd);
        }
        let weights = DVector::from_column_slice(&[0.3, -0.2, 0.1]);
        let block = inverse.view((0, 0), (3, 3));
        assert!((solved.weighted(&weights).1 / weights.dot(&(block * &weights)).sqrt() - 1.0).abs() < 1e-5);
        let left: Vec<f64> = (0..residual.len())
            .map(|row| residual[row] - all.iter().zip(amplitudes.iter()).map(|(c, a)| a * c[row]).sum::<f64>())
            .collect();
        assert!((solved.left / dot(&left, &left) - 1.0).abs() < 1e-8, "{} {}", solved.left, dot(&left, &left));
    }
}
