//! Patterns in the residuals of a fit: systematic errors that are too small to exceed the noise of a row, but not the noise of all rows together.
//!
//! Such a pattern does no harm to predictions, but the parameters have absorbed a part of it, which can be many of their standard deviations. The columns of every panel
//! ([`mod@panels`]) and the residuals are whitened by the fitted noise, and the directions of the parameters are removed from both. Without a pattern, the squared length of the
//! residuals along k columns, divided by k and by the mean square of the rest, is then F distributed, whatever the size of the fitted noise. `compare` tests the same panels
//! with the noise estimated anew and with simulated records, finds smaller patterns, and describes them.

pub mod panels;
pub mod rows;

use std::collections::BTreeSet;

use figures::number::format_significant;
use nalgebra::DVector;
use record::Record;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::misfit::project_out;
use super::noise::{NoiseLikelihood, NoiseModel};
use super::recordings::recordings;
use panels::{Panel, panels};
use rows::{ByCycle, TestRows};

/// Probability of a pattern in pure noise below which a pattern counts, for all panels together.
const FALSE_ALARM: f64 = 0.001;
/// Smallest probability that is shown: that of a larger pattern depends on tails of the noise that no record shows.
const SMALLEST_P: f64 = 1e-9;
/// Largest number of cycles of which each gets a column.
const MOST_CYCLES: usize = 32;
/// Least length of a column beside the columns before it, as a part of its own.
const LEAST_NEW: f64 = 1e-9;

/// Pattern in residuals.
#[derive(Debug, Clone, PartialEq)]
pub struct Pattern {
    /// Probability that pure noise has such a pattern in any panel, at most.
    pub p: f64,
    /// Root mean square of the pattern, divided by the standard deviation of the noise.
    pub share_of_noise: f64,
    /// Phrase for where it is largest, such as "within 0.3 s after each force step".
    pub place: String,
}

impl Pattern {
    /// The pattern in words, for a sentence.
    pub fn words(&self) -> String {
        let [share, p] = [100.0 * self.share_of_noise, self.p.max(SMALLEST_P)].map(|x| format_significant(x, 1));
        format!("a pattern of {share} % of the noise is left in the residuals, most clearly {} (p ≤ {p})", self.place)
    }
}

/// Fit whose residuals are tested.
pub struct TestedFit<'a> {
    /// Record with the times, cycles and forces.
    pub record: &'a Record,
    /// Position (m) of the fit at every row.
    pub position_m: &'a [f64],
    /// Measured positions (m) of the fitted and of the held-out cycles, one entry per row each.
    pub measured_m: [&'a [Option<f64>]; 2],
    /// Directions of the parameters: one column per direction, with one value (m) per row.
    pub columns_m: &'a [Vec<f64>],
    /// Noise that the study declares. If it is slow, only the fitted cycles are tested, because few of them do not show how slow it is in others. If it has gains, every recording
    /// has a gain and an offset of any size: one fitted recording does not show how large they are in others.
    pub declared: NoiseModel,
    /// Noise of the fit, with the values of its parameters in their units.
    pub noise: (NoiseModel, &'a [f64]),
}

impl TestedFit<'_> {
    /// The clearest pattern in the residuals; `None` if noise explains all of them.
    pub fn clearest_pattern(&self) -> Option<Pattern> {
        let Self { record, position_m, measured_m: [fitted_m, heldout_m], declared, .. } = *self;
        let [is_slow, has_gains] = ["ou", "gain"].map(|term| declared.names().contains(&term));
        let measured_m: Vec<Option<f64>> =
            fitted_m.iter().zip(heldout_m).map(|(fitted, heldout)| fitted.or(heldout.filter(|_| !is_slow))).collect();
        let residual_m = measured_m.iter().zip(position_m).map(|(y, x)| y.map_or(0.0, |y| y - x)).collect();
        let recordings = recordings(record);
        let likelihood = NoiseLikelihood::new(self.noise.0, &record.time_s, &recordings, &measured_m);
        let rows = TestRows::new(record, position_m, measured_m.iter().map(Option::is_some).collect());
        let whitening = likelihood.whitening(position_m, self.noise.1)?;
        let whiten = |columns_m: Vec<Vec<f64>>| match has_gains {
            true => {
                let of = |column_m: &Vec<f64>| without_gains(column_m, &rows, &recordings);
                whitening.whiten(&columns_m.iter().map(of).collect::<Vec<_>>())
            }
            false => whitening.whiten(&columns_m),
        };
        let recorded: BTreeSet<u32> = rows.fitted_rows().map(|row| recordings[row]).collect();
        let n_gains = if has_gains { 2 * recorded.len() } else { 0 };
        clearest(&rows, residual_m, (self.columns_m, n_gains), whiten)
    }
}

/// The clearest pattern in residuals (m, one per row). `columns_m` holds the directions of the parameters, and `whiten` whitens columns and removes `n_gains` directions from
/// them.
fn clearest(
    rows: &TestRows,
    residual_m: Vec<f64>,
    (columns_m, n_gains): (&[Vec<f64>], usize),
    whiten: impl Fn(Vec<Vec<f64>>) -> Vec<Vec<f64>>,
) -> Option<Pattern> {
    let basis = orthonormal(&whiten(columns_m.to_vec()));
    let mut residual = DVector::from_vec(whiten(vec![residual_m]).pop()?);
    for direction in &basis {
        residual.axpy(-direction.dot(&residual), direction, 1.0);
    }
    let (panels, _) = panels(rows);
    let tested: Vec<&Panel> = panels.iter().filter(|panel| panel.columns.len() <= MOST_CYCLES).collect();
    let mut clearest: Option<(f64, f64, &str)> = None;
    for panel in &tested {
        let mut own: Vec<DVector<f64>> = Vec::new();
        let (mut along, mut farthest) = (0.0, (0.0, ""));
        let whitened = whiten(dense_columns(panel));
        for (column, whitened) in panel.columns.iter().zip(whitened) {
            // The phrase is that of the column that alone explains most.
            if let Some(alone) = new_direction(&whitened, &[&basis]) {
                let square = alone.dot(&residual).powi(2);
                farthest = if square > farthest.0 { (square, &*column.phrase) } else { farthest };
            }
            if let Some(direction) = new_direction(&whitened, &[&basis, &own]) {
                along += direction.dot(&residual).powi(2);
                own.push(direction);
            }
        }
        let n_left = residual.len().saturating_sub(basis.len() + own.len() + n_gains);
        let rest = (residual.norm_squared() - along).max(f64::MIN_POSITIVE) / n_left as f64;
        let ratio = along / own.len() as f64 / rest;
        let p = FisherSnedecor::new(own.len() as f64, n_left as f64).map_or(1.0, |f| f.sf(ratio));
        if clearest.is_none_or(|(least, ..)| p < least) {
            clearest = Some((p, (along / residual.len() as f64 / rest).sqrt(), farthest.1));
        }
    }
    let (p, share_of_noise, place) = clearest?;
    let p = (p * tested.len() as f64).min(1.0);
    (p < FALSE_ALARM).then(|| Pattern { p, share_of_noise, place: place.to_string() })
}

/// Columns of a panel, each with one value per row.
fn dense_columns(panel: &Panel) -> Vec<Vec<f64>> {
    match &panel.by_cycle {
        None => panel.values().dense,
        Some(ByCycle { place, has_column }) => {
            let of_cycle = |k: usize| place.iter().map(|place| f64::from(u8::from(*place == Some(k)))).collect();
            (0..has_column.len()).filter(|k| has_column[*k]).map(of_cycle).collect()
        }
    }
}

/// A column without its part along an offset and the position in each recording.
fn without_gains(column: &[f64], rows: &TestRows, recordings: &[u32]) -> Vec<f64> {
    let mut left = column.to_vec();
    let counted: Vec<usize> = rows.fitted_rows().collect();
    for own in counted.chunk_by(|a, b| recordings[*a] == recordings[*b]) {
        let mut values: Vec<f64> = own.iter().map(|row| column[*row]).collect();
        project_out(&mut values, vec![vec![1.0; own.len()], own.iter().map(|row| rows.position_m[*row]).collect()]);
        own.iter().zip(values).for_each(|(row, value)| left[*row] = value);
    }
    left
}

/// Orthonormal basis of the space that the columns span. Linearly dependent and non-finite columns are left out.
pub(super) fn orthonormal(columns: &[Vec<f64>]) -> Vec<DVector<f64>> {
    let mut basis = Vec::with_capacity(columns.len());
    for column in columns {
        basis.extend(new_direction(column, &[&basis]));
    }
    basis
}

/// Unit vector along a column's part beside orthonormal vectors; `None` if there is no such part.
fn new_direction(column: &[f64], beside: &[&Vec<DVector<f64>>]) -> Option<DVector<f64>> {
    let mut left = DVector::from_column_slice(column);
    let whole = left.norm();
    // Two passes make the columns orthogonal up to rounding errors.
    for _ in 0..2 {
        for direction in beside.iter().copied().flatten() {
            let along = direction.dot(&left);
            left.axpy(-along, direction, 1.0);
        }
    }
    let norm = left.norm();
    (norm > LEAST_NEW * whole && norm.is_finite()).then(|| left / norm)
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::error::InputPlace;
    use sampling::ensemble::RandomStream;

    /// Clearest pattern in the residuals of four cycles with noise of 1 µm, whose position is a square wave with a lag. Offset, scale and lag are fitted. `missed` (µm) is added in
    /// each row, by its cycle from 0, the sign of its force and the time since the step in s.
    fn pattern(number: u64, rows_each: usize, missed: impl Fn(usize, f64, f64) -> f64) -> Option<Pattern> {
        pattern_beside(NoiseModel::default(), number, rows_each, missed)
    }

    fn pattern_beside(
        declared: NoiseModel,
        number: u64,
        rows_each: usize,
        missed: impl Fn(usize, f64, f64) -> f64,
    ) -> Option<Pattern> {
        let (n, half) = (4 * rows_each, rows_each / 2);
        let step_s = 10.0 / rows_each as f64;
        let sign = |row: usize| if (row / half).is_multiple_of(2) { 1.0 } else { -1.0 };
        let since = |row: usize| step_s * (row % half) as f64;
        let lagged = |time_s: f64| {
            move |row: usize| sign(row) * (1.0 - 2.0 * (-since(row) / time_s).exp() * f64::from(u8::from(row >= half)))
        };
        let column = |of: &dyn Fn(usize) -> f64| -> Vec<f64> { (0..n).map(|row| 1e-6 * of(row)).collect() };
        let absorbed = [column(&|_| 1.0), column(&lagged(2.0)), column(&|row| lagged(2.2)(row) - lagged(2.0)(row))];
        let mut stream = RandomStream::new(17, number);
        let errors_m: Vec<f64> =
            (0..n).map(|row| 1e-6 * (stream.normal() + missed(row / rows_each, sign(row), since(row)))).collect();
        let position_m = column(&|row| 100.0 * lagged(2.0)(row));
        let record = Record {
            time_s: (0..n).map(|row| step_s * row as f64).collect(),
            force_n: (0..n).map(|row| 4.6e-6 * sign(row)).collect(),
            position_m: position_m.iter().copied().map(Some).collect(),
            cycle: (0..n).map(|row| 1 + (row / rows_each) as u32).collect(),
            ..Record::default()
        };
        let measured_m: Vec<Option<f64>> = position_m.iter().zip(&errors_m).map(|(x, error)| Some(x + error)).collect();
        let fit = TestedFit {
            record: &record,
            position_m: &position_m,
            measured_m: [&measured_m, &vec![None; n]],
            columns_m: &absorbed,
            declared,
            noise: (NoiseModel::default(), &[1.0]),
        };
        fit.clearest_pattern()
    }

    /// More than three alarms in 400 records of noise occur with a probability below 10⁻³, also in short records.
    #[test]
    fn noise_has_no_pattern() {
        for rows_each in [12, 200] {
            let found: Vec<Pattern> = (0..400).filter_map(|number| pattern(number, rows_each, |_, _, _| 0.0)).collect();
            assert!(found.len() <= 3, "{rows_each}: {found:?}");
        }
    }

    /// More than twelve alarms in 4,000 records of six rows a cycle, of whose 24 rows gains and offsets take eight, occur with a probability below 10⁻³: at most four are expected.
    #[test]
    fn gains_and_offsets_are_counted() {
        let names = ["white", "gain"].map(String::from);
        let declared = NoiseModel::named(&names, &InputPlace::default()).expect("a noise model");
        let alarm = |number: &u64| pattern_beside(declared, *number, 6, |_, _, _| 0.0).is_some();
        let n_alarms = (0..4_000).filter(alarm).count();
        assert!(n_alarms <= 12, "{n_alarms}");
    }

    /// A missed response of twice the noise just after each step adds up to about 9 standard deviations of the noise, with a root mean square of a third of the noise.
    #[test]
    fn a_missed_response_is_found_where_it_is() {
        let found = pattern(1, 200, |_, sign, since_s| 2.0 * sign * (-since_s / 0.2).exp()).expect("a pattern");
        assert!(found.p < 1e-6 && (0.2..0.45).contains(&found.share_of_noise), "{found:?}");
        assert!(found.place.contains("after each force step"), "{found:?}");
    }

    /// Offsets of the cycles of 0.4 times the noise are 5.7 standard errors each.
    #[test]
    fn offsets_of_cycles_are_found() {
        let offset = |cycle: usize| [0.4, -0.4, -0.4, 0.4][cycle];
        let found = pattern(2, 200, |cycle, _, _| offset(cycle)).expect("a pattern");
        assert!(found.p < 1e-6 && found.place.contains("cycle"), "{found:?}");
    }
}
