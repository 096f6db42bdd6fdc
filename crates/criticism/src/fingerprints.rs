//! Fingerprint of every effect: the change of the fitted curve when the effect is added. It shows the part of the base's residual that the effect explains.

use super::search::{SearchResult, Single};
use super::subject::Subject;
use figures::fingerprints::Fingerprints;

/// Largest number of rows in a fingerprint. Longer records are thinned evenly.
const MOST_ROWS: usize = 2000;

/// Returns the fingerprints of all refitted effects, ordered by decreasing gain.
pub fn fingerprints(subject: &Subject, found: &SearchResult) -> Fingerprints {
    let experiment = subject.experiment();
    let record = &experiment.record;
    let base_m = &found.base.fitted.position_m;
    let rows: Vec<usize> = (0..record.n_rows()).step_by(record.n_rows().div_ceil(MOST_ROWS).max(1)).collect();
    let mut singles: Vec<&Single> = found.singles.iter().filter(|single| single.refitted.is_some()).collect();
    let gain = |single: &Single| single.gain.map_or(f64::NEG_INFINITY, |gain| gain.fitted);
    singles.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
    let changes = singles.into_iter().filter_map(|single| {
        let fitted = &single.refitted.as_ref()?.fitted;
        let change = rows.iter().map(|row| 1e6 * (fitted.position_m[*row] - base_m[*row])).collect();
        Some((single.slug.to_string(), change))
    });
    Fingerprints {
        time_s: rows.iter().map(|row| record.time_s[*row]).collect(),
        residual_um: rows.iter().map(|row| Some(1e6 * (record.position_m[*row]? - base_m[*row]))).collect(),
        effects: changes.collect(),
    }
}
