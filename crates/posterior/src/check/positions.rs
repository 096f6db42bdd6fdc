//! Checks for doubtful positions. They are clipped at the end of the tracker's range, repeated, outlying, lost, or in a column that is not read.

use std::collections::HashMap;

use super::{CheckContext, found, um};
use documents::check::Contradiction;
use figures::number::format_significant;
use record::noise::Outlier;
use record::repeated_outliers;

/// Smallest number of equal positions at one end of the range that counts as clipping.
const CLIPPED: usize = 5;
/// Smallest fraction of all positions that must be equal at one end of the range to count as clipped.
const CLIPPED_SHARE: f64 = 0.01;
/// Smallest number of successive equal positions at one end of the range that counts as clipping.
const CLIPPED_RUN: usize = 3;
/// Smallest fraction of positions that equal the position before them and are reported as repeated.
const REPEATED: f64 = 0.25;
/// Coarsest resolution, as a fraction of the noise, at which equal positions are suspicious.
const COARSE: f64 = 0.5;

/// Resolution of the written positions in m: the smallest difference between two unequal positions.
fn resolution_m(positions: &[f64]) -> f64 {
    let mut sorted = positions.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > 0.0).fold(f64::INFINITY, f64::min)
}

/// Returns true if the positions have a finer resolution than their noise, so that equal positions are unlikely to be chance.
fn is_fine(looked: &CheckContext<'_>, positions: &[f64]) -> bool {
    let noise_m = looked.fit.as_ref().map_or(looked.noise_m, |fit| looked.noise_m.min(fit.left_sd_m));
    noise_m > 0.0 && resolution_m(positions) < COARSE * noise_m
}

/// Finds many positions that are equal to the largest or the smallest position.
pub(super) fn clipped(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let positions: Vec<f64> = looked.record.position_m.iter().flatten().copied().collect();
    if !is_fine(looked, &positions) {
        return None;
    }
    let ends = [f64::max as fn(f64, f64) -> f64, f64::min].map(|end| positions.iter().copied().reduce(end));
    let (end, n) = ends
        .into_iter()
        .flatten()
        .filter_map(|end| {
            let is_there: Vec<bool> = positions.iter().map(|x| *x == end).collect();
            let longest = is_there.split(|there| !there).map(<[bool]>::len).max().unwrap_or(0);
            let n = is_there.iter().filter(|there| **there).count();
            (n >= CLIPPED && n as f64 >= CLIPPED_SHARE * positions.len() as f64 && longest >= CLIPPED_RUN)
                .then_some((end, n))
        })
        .max_by_key(|(_, n)| *n)?;
    let text = format!("{n} positions are exactly {} µm, where the tracker's range seems to end", um(end));
    Some(found("clipped_positions", false, text, "leave the position empty in these rows: a limit is no measurement"))
}

/// Finds positions equal to the previous position, although the noise should make them differ.
pub(super) fn repeated(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let positions: Vec<f64> = looked.record.position_m.iter().flatten().copied().collect();
    if !is_fine(looked, &positions) {
        return None;
    }
    let mut counts: HashMap<u64, usize> = HashMap::new();
    positions.iter().for_each(|x| *counts.entry(x.to_bits()).or_default() += 1);
    // Equal positions at one end of the range belong to the check for clipped positions.
    let most = counts.values().copied().max().unwrap_or(0);
    let n = positions.windows(2).filter(|pair| pair[0] == pair[1]).count();
    if n < CLIPPED || (n as f64) < REPEATED * positions.len() as f64 || 2 * most > n {
        return None;
    }
    let text = format!("{n} of {} positions are exactly equal to the position in the row before", positions.len());
    let advice = "leave the position empty if the tracker gave no new one: the log seems to be faster than the camera";
    Some(found("repeated_positions", false, text, advice))
}

/// Largest number of outliers that a message lists.
const LISTED: usize = 5;

/// Finds single positions that are far from the positions before and after them.
pub(super) fn outliers(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let record = looked.record;
    let outliers = record::noise::outliers(record);
    let at = |outlier: &Outlier| {
        let time_s = record.time_s[outlier.row];
        format!("{} s (row {}) by {} µm", format_significant(time_s, 6), outlier.row + 1, um(outlier.distance_m))
    };
    let said: Vec<String> = outliers.iter().take(LISTED).map(at).collect();
    let more = outliers.len().saturating_sub(LISTED);
    let more = if more > 0 { format!(", and {more} more") } else { String::new() };
    let first = outliers.first()?;
    let half_s = 0.25 * record.median_interval_s()?;
    let time_s = record.time_s[first.row];
    let text = format!(
        "{} {} far from the rows around: at {}{more}",
        outliers.len(),
        if outliers.len() == 1 { "position lies" } else { "positions lie" },
        said.join(", ")
    );
    let advice = format!(
        "leave them out with `left_out_s = [[{}, {}]]` in [measurement], one pair for each; or use noise with heavy tails (`student`)",
        format_significant(time_s - half_s, 6),
        format_significant(time_s + half_s, 6)
    );
    Some(found("outliers", false, text, advice))
}

/// Finds a position value, such as 0, that marks lost tracking instead of a measurement.
pub(super) fn lost(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let positions = &looked.record.position_m;
    let values = repeated_outliers(positions);
    let value = *values.first()?;
    let n = positions.iter().filter(|x| x.is_some_and(|x| values.contains(&x))).count();
    let text = format!(
        "{n} positions are exactly {} µm while the rows around them are elsewhere: this value seems to mark lost tracking",
        um(value)
    );
    let advice =
        "leave the position empty in these rows, or describe the table with `vitreo-uq init`, which finds such values";
    Some(found("lost_positions", true, text, advice))
}

/// Finds a column of the table that is not read, although its values are correlated with the position.
pub(super) fn unread(looked: &CheckContext<'_>) -> Option<Contradiction> {
    let columns: Vec<String> = looked
        .understood
        .unread
        .iter()
        .map(|column| format!("`{}` (correlation {:.2})", column.name, column.correlation))
        .collect();
    let text = format!(
        "the table has columns that are not read, although they are correlated with the motion: {}",
        columns.join(", ")
    );
    let advice = "if it is a coordinate, name position_x, position_y and position_z in [measurement.columns]; all have one unit, so convert a column in another one first";
    (!columns.is_empty()).then(|| found("unread_column_follows", false, text, advice))
}
