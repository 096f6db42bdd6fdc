//! Best fit of an oscillation by any passive linear law: a spring, a dashpot and Maxwell elements of many relaxation times in parallel, all with moduli that are
//! not negative. Its residuals show the size of the measurement errors without the law in question, and rows that no law explains.

use models::non_negative;
use record::{OscillationRecord, SweepForm};

/// Number of relaxation times in a decade.
const TIMES_PER_DECADE: f64 = 12.0;
/// Largest relative difference of a Maxwell element, whose time lies between two of the grid, from the best sum of those of the grid.
pub(super) const SPECTRUM_ERROR: f64 = 0.004;
/// Relative residual at which a fit ends: exact data have no least residual.
const LEAST_RESIDUAL: f64 = 1e-6;
/// Number of decades by which the relaxation times exceed the range of the frequencies on both sides.
const DECADES_BEYOND: f64 = 1.0;
/// Largest number of rows that are tested. In longer tables, the correlation of neighbouring residuals shows a wrong law.
const MOST_ROWS: usize = 100;

/// Residuals of the fitted rows of a table, relative to the complex modulus, or to the table's errors.
pub(super) struct SpectrumFit {
    /// Sum of the squared residuals of both moduli, for each fitted row.
    pub squares: Vec<f64>,
    /// Weight of each fitted row: 1 over the absolute value of its complex modulus, or 1 over its error (1/Pa).
    pub weights: Vec<f64>,
}

/// Fits the rows that are not held out. `None` for tables that are too long.
pub(super) fn fit_spectrum(sweep: &OscillationRecord) -> Option<SpectrumFit> {
    let rows: Vec<_> = sweep.rows.iter().filter(|row| !row.is_heldout).collect();
    if rows.len() > MOST_ROWS {
        return None;
    }
    let moduli: Vec<[f64; 2]> = rows.iter().map(|row| sweep.form.moduli(row.pair)).collect();
    let weight = |k: usize| {
        let size = moduli[k][0].hypot(moduli[k][1]);
        let [first, second] = match (rows[k].sd, sweep.form) {
            (None, _) => [size; 2],
            (Some(sd), SweepForm::StorageAndLoss) => sd,
            (Some([modulus, phase]), SweepForm::ModulusAndPhase) => [modulus, size * phase],
        };
        1.0 / (0.5 * (first * first + second * second)).sqrt()
    };
    let weights: Vec<f64> = (0..rows.len()).map(weight).collect();
    let measured: Vec<f64> =
        moduli.iter().zip(&weights).flat_map(|(pair, weight)| pair.map(|modulus| modulus * weight)).collect();
    let omega_per_s: Vec<f64> = rows.iter().map(|row| std::f64::consts::TAU * row.frequency_hz).collect();
    let mut columns: Vec<f64> = Vec::new();
    for part in parts(&omega_per_s) {
        let column: Vec<f64> = omega_per_s
            .iter()
            .zip(&weights)
            .flat_map(|(omega, weight)| part.moduli(*omega).map(|x| x * weight))
            .collect();
        let norm = column.iter().map(|x| x * x).sum::<f64>().sqrt();
        columns.extend(column.iter().map(|x| x / norm));
    }
    let found = non_negative::choose(&columns, &measured, LEAST_RESIDUAL, measured.len() - 1);
    let mut rest = measured.clone();
    for (place, factor) in found.weights {
        rest.iter_mut().zip(&columns[place * measured.len()..]).for_each(|(rest, x)| *rest -= factor * x);
    }
    let squares = rest.chunks_exact(2).map(|pair| pair[0] * pair[0] + pair[1] * pair[1]).collect();
    Some(SpectrumFit { squares, weights })
}

/// An element with a modulus or viscosity of 1.
enum Part {
    Spring,
    Dashpot,
    Maxwell { time_s: f64 },
}

impl Part {
    /// Storage and loss modulus at an angular frequency.
    fn moduli(&self, omega_per_s: f64) -> [f64; 2] {
        match self {
            Self::Spring => [1.0, 0.0],
            Self::Dashpot => [0.0, omega_per_s],
            Self::Maxwell { time_s } => {
                let x = omega_per_s * time_s;
                [x * x, x].map(|y| y / (1.0 + x * x))
            }
        }
    }
}

fn parts(omega_per_s: &[f64]) -> Vec<Part> {
    let [lowest, highest] =
        [f64::min, f64::max].map(|of| omega_per_s.iter().copied().reduce(of).unwrap_or(1.0).log10());
    let (first, last) = (-highest - DECADES_BEYOND, -lowest + DECADES_BEYOND);
    let n = ((last - first) * TIMES_PER_DECADE).ceil() as usize;
    let time_s = |k: usize| 10_f64.powf(first + (last - first) * k as f64 / n as f64);
    [Part::Spring, Part::Dashpot].into_iter().chain((0..=n).map(|k| Part::Maxwell { time_s: time_s(k) })).collect()
}
