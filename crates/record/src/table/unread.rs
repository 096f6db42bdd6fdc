//! Search for columns that the description does not use but that are correlated with the position, such as a forgotten coordinate.

use super::description::TableDescription;
use super::read::ColumnNames;
use super::spelling::split_unit;
use super::text::cells;
use base::units::Dimension;

/// Column that is not read although its values are correlated with the position.
#[derive(Debug, Clone, PartialEq)]
pub struct UnreadColumn {
    /// Name of the column.
    pub name: String,
    /// Pearson's correlation of the column's values with the position.
    pub correlation: f64,
}

/// Largest number of rows from which correlations are computed.
const MOST_ROWS: usize = 20_000;
/// Smallest fraction of the rows in which a column must contain a number to be considered.
const MOSTLY: f64 = 0.9;
/// Smallest absolute correlation with the position at which a column is reported.
const FOLLOWS: f64 = 0.7;

/// Returns the columns that are not read although they are correlated with the position. Only columns with a unit of length or a coordinate's name
/// count. `lines` holds the line number of each row, from 1, and `position_m` the position.
pub(crate) fn unread_columns(
    file: &std::path::Path,
    text: &str,
    description: &TableDescription,
    lines: &[usize],
    position_m: &[Option<f64>],
) -> Vec<UnreadColumn> {
    let layout = &description.layout;
    let names = ColumnNames::new(file, text, layout);
    let TableDescription { time, force, position, cycle, track, .. } = description;
    let positions = position.iter().flat_map(|(columns, _)| columns.all());
    let others = force.iter().map(|(name, _)| name).chain(cycle).chain(track.iter().map(|(name, _)| name));
    let read: Vec<usize> = std::iter::once(&time.0)
        .chain(positions)
        .chain(others)
        .filter_map(|name| names.place(name).ok().map(|(at, _)| at))
        .collect();
    // A column without a unit in its name may follow the motion for other reasons, such as a compliance or a torque.
    let is_coordinate = |name: &str| match split_unit(name) {
        (_, Some(unit)) => unit.dimension == Dimension::Length,
        (stem, None) => {
            // A unit that is unknown, as in `Z (slice)`, does not count.
            let plain = stem.split(['(', '[']).next().unwrap_or(stem).trim().to_lowercase();
            ["x", "y", "z"].contains(&plain.as_str())
                || ["pos", "displac", "coord"].iter().any(|part| plain.contains(part))
        }
    };
    let all = names.all();
    let candidates: Vec<usize> = (0..all.len()).filter(|at| !read.contains(at) && is_coordinate(&all[*at])).collect();
    if candidates.is_empty() {
        return Vec::new();
    }
    let step = lines.len().div_ceil(MOST_ROWS).max(1);
    let mut wanted = lines.iter().zip(position_m).step_by(step).peekable();
    let mut values: Vec<Vec<(f64, f64)>> = vec![Vec::new(); candidates.len()];
    let (mut n_rows, mut n_numbers) = (0_usize, vec![0_usize; candidates.len()]);
    for (index, line) in text.lines().enumerate() {
        let Some((_, position)) = wanted.next_if(|(number, _)| **number == index + 1) else { continue };
        let Some(position) = position else { continue };
        let cells = cells(line, layout.delimiter);
        n_rows += 1;
        for (place, at) in candidates.iter().enumerate() {
            if let Some(value) = cells.get(*at).and_then(|cell| layout.number(cell)) {
                n_numbers[place] += 1;
                values[place].push((value, *position));
            }
        }
    }
    let follows = |place: usize| {
        let pairs = &values[place];
        // Columns that only increase or only decrease are counters and clocks, not coordinates.
        let is_monotone =
            pairs.windows(2).all(|two| two[0].0 <= two[1].0) || pairs.windows(2).all(|two| two[0].0 >= two[1].0);
        if is_monotone || (n_numbers[place] as f64) < MOSTLY * n_rows as f64 {
            return None;
        }
        let correlation = correlation(pairs)?;
        (correlation.abs() >= FOLLOWS).then(|| UnreadColumn { name: all[candidates[place]].to_string(), correlation })
    };
    (0..candidates.len()).filter_map(follows).collect()
}

/// Pearson's correlation of pairs of values; `None` if one of the two values is constant.
fn correlation(pairs: &[(f64, f64)]) -> Option<f64> {
    let n = pairs.len() as f64;
    let mean = pairs.iter().fold((0.0, 0.0), |sum, pair| (sum.0 + pair.0 / n, sum.1 + pair.1 / n));
    let sums = pairs.iter().fold([0.0; 3], |[aa, ab, bb], pair| {
        let (a, b) = (pair.0 - mean.0, pair.1 - mean.1);
        [aa + a * a, ab + a * b, bb + b * b]
    });
    let size = (sums[0] * sums[2]).sqrt();
    (size > 0.0).then(|| sums[1] / size)
}
