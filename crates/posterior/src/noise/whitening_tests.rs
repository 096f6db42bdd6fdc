//! Tests of the inner products of whitened columns against products of stored whitened columns.

use super::super::dense_for_tests::{POINTS, TestRecord, gaussian_models, parameters};
use super::*;

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Compares the inner products and the log density over more rows than a block has. Products of the cycles' columns are combined from [`CycleProducts`]. The record has
/// a cycle without observations.
#[test]
fn products_are_those_of_whitened_columns() {
    let n_rows = 3 * BLOCK + 50;
    let mut record = TestRecord::irregular(n_rows);
    // Many short cycles, some of one row, precede the long cycles.
    record.cycle =
        (0..n_rows).map(|row| if row < 400 { 1 + (row / 9) as u32 } else { 50 + (row / 150) as u32 }).collect();
    (18..27).for_each(|row| record.observed_m[row] = None);
    let columns: Vec<Vec<f64>> = (0..13)
        .map(|k| record.time_s.iter().map(|t| 1e-6 * (1.0 + (f64::from(k) + 0.3) * t).sin()).collect())
        .chain([record.residual_m()])
        .collect();
    let slices: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    let visited: Vec<u32> = record.observed_rows().into_iter().map(|row| record.cycle[row]).collect();
    let numbers: Vec<u32> = visited.chunk_by(|a, b| a == b).map(|rows| rows[0]).collect();
    let units: Vec<Vec<f64>> = numbers
        .iter()
        .map(|number| record.cycle.iter().map(|cycle| f64::from(u8::from(cycle == number))).collect())
        .collect();
    for model in gaussian_models() {
        for point in POINTS {
            let parameters = parameters(model, point);
            let likelihood = NoiseLikelihood::new(model, &record.time_s, &record.cycle, &record.observed_m);
            let white = likelihood.whiten(&columns, &record.position_m, &parameters);
            let white_units = likelihood.whiten(&units, &record.position_m, &parameters);
            // Column 13 is common to both sets and comes first.
            let order: Vec<usize> = std::iter::once(13).chain(0..13).collect();
            let shuffled: Vec<&[f64]> = order.iter().map(|k| slices[*k]).collect();
            let asked = ProductRequest { columns: &shuffled, n_common: 1, own: &[1..9, 9..14], with_cycles: Some(1) };
            let products = likelihood.white_products(&asked, &record.position_m, &parameters).expect("in support");
            let members = [(0..9).collect::<Vec<usize>>(), std::iter::once(0).chain(9..14).collect()];
            for (set, members) in products.sets.iter().zip(&members) {
                for (i, a) in members.iter().enumerate() {
                    for (j, b) in members.iter().enumerate() {
                        let (a, b) = (&white[order[*a]], &white[order[*b]]);
                        let scale = (dot(a, a) * dot(b, b)).sqrt();
                        assert!((set[(i, j)] - dot(a, b)).abs() < 1e-11 * scale, "{i} {j}");
                    }
                }
            }
            let n = numbers.len();
            assert_eq!(products.cycles.len(), n);
            // In a later cycle, an earlier cycle's whitened column is proportional to the response to a unit of process. The factor is the process that enters the
            // later cycle.
            for first in 0..n {
                let cycle = &products.cycles[first];
                let length = dot(&white_units[first], &white_units[first]).sqrt();
                for (k, member) in members[1].iter().enumerate() {
                    let mut found = cycle.unit_with[k];
                    let mut process = cycle.left;
                    for later in &products.cycles[first + 1..] {
                        found += process * later.past_with[k];
                        process *= later.kept;
                    }
                    let column = &white[order[*member]];
                    let exact = dot(&white_units[first], column);
                    assert!((found - exact).abs() < 1e-10 * length * dot(column, column).sqrt(), "{found} {exact}");
                }
                for second in first..n {
                    let mut process = 1.0;
                    let mut found = 0.0;
                    if first == second {
                        found = cycle.unit;
                    } else {
                        process =
                            cycle.left * products.cycles[first + 1..second].iter().map(|c| c.kept).product::<f64>();
                        found += process * products.cycles[second].both;
                    }
                    let (mut one, mut other) = if first == second {
                        (cycle.left, cycle.left)
                    } else {
                        (process * products.cycles[second].kept, products.cycles[second].left)
                    };
                    for later in &products.cycles[second + 1..] {
                        found += one * other * later.past;
                        one *= later.kept;
                        other *= later.kept;
                    }
                    let exact = dot(&white_units[first], &white_units[second]);
                    let lengths = length * dot(&white_units[second], &white_units[second]).sqrt();
                    assert!((found - exact).abs() < 1e-10 * lengths, "{first} {second}: {found} {exact}");
                }
            }
            let residual = &white[13];
            let direct = likelihood.ln_likelihood(&record.position_m, &parameters);
            let found = products.ln_constant - 0.5 * dot(residual, residual);
            assert!((found / direct - 1.0).abs() < 1e-10, "{found} against {direct}");
            // `ln_likelihoods_of` computes this density for several residuals under eight sets of noise parameters at once. The last set differs.
            let lanes: Vec<[f64; LANES]> = parameters
                .iter()
                .map(|value| std::array::from_fn(|lane| if lane == 7 { 1.1 * value } else { *value }))
                .collect();
            let many = likelihood.ln_likelihoods_of(&[slices[13], slices[4]], &record.position_m, &lanes);
            let of_other = products.ln_constant - 0.5 * dot(&white[4], &white[4]);
            for (found, exact) in [(many[0][0], direct), (many[1][3], of_other)] {
                assert!((found / exact - 1.0).abs() < 1e-10, "{found} against {exact}");
            }
            let moved: Vec<f64> = parameters.iter().map(|value| 1.1 * value).collect();
            let moved = likelihood.ln_likelihood(&record.position_m, &moved);
            assert!((many[0][7] / moved - 1.0).abs() < 1e-10, "{} against {moved}", many[0][7]);
        }
    }
}

/// Columns that are 0 except in some rows are whitened from their first row until they no longer influence the filter. The result is compared with the whitening of the
/// columns with all rows. Some columns contain gaps of the record or end beyond it.
#[test]
fn columns_of_some_rows_are_whitened_as_whole_ones() {
    let record = TestRecord::irregular(900);
    for model in gaussian_models() {
        for point in POINTS {
            let parameters = parameters(model, point);
            let likelihood = NoiseLikelihood::new(model, &record.time_s, &record.cycle, &record.observed_m);
            let whitening = likelihood.whitening(&record.position_m, &parameters).expect("in support");
            for (first, end) in [(0, 7), (3, 90), (440, 441), (700, 900), (899, 900)] {
                let parts: Vec<Vec<f64>> = (0..11)
                    .map(|k| (first..end).map(|row| 1e-6 * (1.0 + 0.1 * (k * row) as f64).sin()).collect())
                    .collect();
                let whole = |part: &Vec<f64>| [vec![0.0; first], part.clone(), vec![0.0; 900 - end]].concat();
                let wholes: Vec<Vec<f64>> = parts.iter().map(whole).collect();
                let exact = likelihood.whiten(&wholes, &record.position_m, &parameters);
                let (from, found) = whitening.whiten_from(&parts, first);
                for (found, exact) in found.iter().zip(&exact) {
                    let largest = exact.iter().fold(0.0, |a: f64, x| a.max(x.abs()));
                    let at = |row: usize| row.checked_sub(from).and_then(|row| found.get(row)).copied().unwrap_or(0.0);
                    let error = (0..exact.len()).map(|row| (at(row) - exact[row]).abs()).fold(0.0, f64::max);
                    assert!(error <= 1e-12 * largest, "{first} {end} {error} {largest}");
                }
            }
        }
    }
}
