//! Selects the rows for the plots of the page: those of a record, with a revision's predictions.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::SystemTime;

use serde::Serialize;
use vitreo_uq::base::error::Result;
use vitreo_uq::base::files::{self, FileKind};
use vitreo_uq::documents::check::CheckSummary;
use vitreo_uq::figures::predictions::{Predictions, read_predictions};
use vitreo_uq::posterior::check;
use vitreo_uq::posterior::study::PREDICTIONS_NAME;
use vitreo_uq::record::Experiment;

/// Minimum and maximum number of points of a plot.
const POINTS: [usize; 2] = [50, 28_000];
/// Maximum number of experiments, and of predictions, that are kept in memory.
const KEPT: usize = 4;

/// A record with the result of its check.
pub struct CheckedRecord {
    /// Parsed experiment.
    pub experiment: Experiment,
    /// Description of how the record was read, and contradictions between the data and their description.
    pub summary: CheckSummary,
}

/// Cache of values that are read from files. A value is valid until one of its files changes.
pub struct FileCache<T> {
    kept: Mutex<Vec<CacheEntry<T>>>,
}

/// Cached value, with its path and the times at which its files were last changed.
struct CacheEntry<T> {
    path: PathBuf,
    changed: Vec<Option<SystemTime>>,
    found: Arc<T>,
}

impl<T> Default for FileCache<T> {
    fn default() -> Self {
        Self { kept: Mutex::default() }
    }
}

impl<T> FileCache<T> {
    /// Returns the value for `path`. The function `read` is called if the value is not cached, or if one of `files` has changed.
    pub fn get(&self, path: &Path, files: &[PathBuf], read: impl FnOnce() -> Result<T>) -> Result<Arc<T>> {
        let changed = |path: &PathBuf| std::fs::metadata(path).and_then(|metadata| metadata.modified()).ok();
        let changed: Vec<_> = files.iter().map(changed).collect();
        let mut kept = self.kept.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some(cache) = kept.iter().find(|cache| cache.path == path && cache.changed == changed) {
            return Ok(Arc::clone(&cache.found));
        }
        let found = Arc::new(read()?);
        kept.retain(|cache| cache.path != path);
        kept.insert(0, CacheEntry { path: path.to_path_buf(), changed, found: Arc::clone(&found) });
        kept.truncate(KEPT);
        Ok(found)
    }
}

/// Returns the record that the description in the folder `dir` defines.
pub fn read_record(memory: &FileCache<CheckedRecord>, dir: &Path) -> Result<Arc<CheckedRecord>> {
    let entries = files::entries(dir, "").unwrap_or_default().into_iter();
    let files: Vec<PathBuf> =
        entries.filter(|(_, kind)| *kind == FileKind::File).map(|(name, _)| dir.join(name)).collect();
    memory.get(dir, &files, || {
        let (experiment, files) = Experiment::read(dir)?;
        let summary = check::summary(&experiment, &files);
        Ok(CheckedRecord { experiment, summary })
    })
}

/// Returns the predictions of the revision in `dir`. `None` if an older version of the program wrote no predictions.
pub fn read_revision(memory: &FileCache<Predictions>, dir: &Path) -> Result<Option<Arc<Predictions>>> {
    let path = dir.join(PREDICTIONS_NAME);
    files::refuse_link(&path)?;
    if !files::is_file(&path) {
        return Ok(None);
    }
    memory.get(&path, std::slice::from_ref(&path), || read_predictions(&path)).map(Some)
}

/// Time range of a plot, and its number of points.
#[derive(Debug, Clone, Copy, PartialEq, serde::Deserialize)]
pub struct Window {
    /// Start of the range in s; `None` for the start of the record.
    pub from_s: Option<f64>,
    /// End of the range in s; `None` for the end of the record.
    pub to_s: Option<f64>,
    /// Number of points of the plot, limited by `POINTS`; `None` for the largest.
    pub points: Option<usize>,
    /// True if the axis of time is logarithmic.
    #[serde(default)]
    pub is_logarithmic: bool,
}

/// Rows that a plot shows.
#[derive(Debug, Serialize)]
pub struct PlotRows {
    /// Number of rows in the record, and number of rows in the time range.
    pub rows: [usize; 2],
    /// Indices of the rows that are shown, as `decimate_rows` selects them.
    #[serde(skip)]
    pub chosen: Vec<usize>,
    time_s: Vec<f64>,
    force_un: Vec<f64>,
    position_um: Vec<Option<f64>>,
    cycle: Vec<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    predicted: Option<ShownPredictions>,
    /// Predictions of the revision that is compared with the shown one.
    #[serde(skip_serializing_if = "Option::is_none")]
    compared: Option<ShownPredictions>,
}

/// Predictions of the rows that are shown.
#[derive(Debug, Serialize)]
struct ShownPredictions {
    median_um: Vec<f64>,
    q05_um: Vec<f64>,
    q95_um: Vec<f64>,
    residual_um: Vec<Option<f64>>,
}

/// Selects the rows of a record to show in a time range. It adds the predictions of the shown revision, and of one that is compared with it.
pub fn select_rows(
    experiment: &Experiment,
    predictions: Option<&Predictions>,
    compared: Option<&Predictions>,
    window: Window,
) -> PlotRows {
    let record = &experiment.record;
    let is_complete = |predictions: &&Predictions| predictions.time_s.len() == record.n_rows();
    let (predictions, compared) = (predictions.filter(is_complete), compared.filter(is_complete));
    let position_um: Vec<Option<f64>> = record.position_m.iter().map(|x| x.map(|x| 1e6 * x)).collect();
    let residual = |predictions: &Predictions, row: usize| Some(position_um[row]? - predictions.quantiles_um[2][row]);
    let residual_um = |row: usize| residual(predictions?, row);
    let force = |row: usize| Some(record.force_n[row]);
    let looks: [&dyn Fn(usize) -> Option<f64>; 3] = [&|row| position_um[row], &residual_um, &force];
    let range = rows_of(&record.time_s, window);
    let n_points = window.points.unwrap_or(POINTS[1]).clamp(POINTS[0], POINTS[1]);
    let place = place_on_axis(&record.time_s[range.clone()], window.is_logarithmic);
    let chosen = decimate_rows(range.clone(), n_points, &|row| place(record.time_s[row]), &looks);
    let of = |values: &[f64]| chosen.iter().map(|row| values[*row]).collect::<Vec<f64>>();
    let shown = |predictions: &Predictions| ShownPredictions {
        median_um: of(&predictions.quantiles_um[2]),
        q05_um: of(&predictions.quantiles_um[0]),
        q95_um: of(&predictions.quantiles_um[4]),
        residual_um: chosen.iter().map(|row| residual(predictions, *row)).collect(),
    };
    let (predicted, compared) = (predictions.map(shown), compared.map(shown));
    PlotRows {
        rows: [record.n_rows(), range.len()],
        time_s: of(&record.time_s),
        force_un: chosen.iter().map(|row| 1e6 * record.force_n[*row]).collect(),
        position_um: chosen.iter().map(|row| position_um[*row]).collect(),
        cycle: chosen.iter().map(|row| record.cycle[*row]).collect(),
        predicted,
        compared,
        chosen,
    }
}

/// Range of the rows in a time range. It includes one more row on either side.
fn rows_of(time_s: &[f64], window: Window) -> std::ops::Range<usize> {
    let from = window.from_s.map_or(0, |from_s| time_s.partition_point(|t| *t < from_s).saturating_sub(1));
    let to = window.to_s.map_or(time_s.len(), |to_s| (time_s.partition_point(|t| *t <= to_s) + 1).min(time_s.len()));
    from.min(to)..to
}

/// Function that gives the place of a time (s) on an axis through these times: 0 at the start, 1 at the end. A logarithmic axis begins at the first time after 0.
fn place_on_axis(time_s: &[f64], is_logarithmic: bool) -> impl Fn(f64) -> f64 {
    let scaled = move |time_s: f64| if is_logarithmic { time_s.max(f64::MIN_POSITIVE).ln() } else { time_s };
    let first = time_s.iter().copied().find(|time_s| !is_logarithmic || *time_s > 0.0).map_or(0.0, scaled);
    let last = time_s.last().copied().map_or(1.0, scaled);
    move |time_s| (scaled(time_s) - first) / (last - first)
}

/// Selects about `n_points` of the given rows. The axis, on which `place` gives the place of a row, is divided into columns of equal width. From each column it
/// takes the first row, and those with the smallest and largest value of each function in `looks`.
fn decimate_rows(
    rows: std::ops::Range<usize>,
    n_points: usize,
    place: &dyn Fn(usize) -> f64,
    looks: &[&dyn Fn(usize) -> Option<f64>],
) -> Vec<usize> {
    if rows.len() <= n_points {
        return rows.collect();
    }
    let n_columns = n_points / (1 + 2 * looks.len()) + 1;
    let all: Vec<usize> = rows.clone().collect();
    let column_of = |row: &usize| (place(*row).clamp(0.0, 1.0) * n_columns as f64) as usize;
    let mut chosen = Vec::with_capacity(n_points);
    for range in all.chunk_by(|a, b| column_of(a) == column_of(b)) {
        let mut of_column = vec![range[0]];
        for look in looks {
            let valued = || range.iter().filter_map(|row| Some((*row, look(*row)?)));
            of_column.extend(valued().min_by(|a, b| a.1.total_cmp(&b.1)).map(|(row, _)| row));
            of_column.extend(valued().max_by(|a, b| a.1.total_cmp(&b.1)).map(|(row, _)| row));
        }
        of_column.sort_unstable();
        of_column.dedup();
        chosen.extend(of_column);
    }
    chosen.extend(rows.last().filter(|last| chosen.last() != Some(last)));
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An isolated extreme row is always selected, and rows stay in order. The number of selected rows is at most a few above the requested number.
    #[test]
    fn what_stands_out_is_shown() {
        let value = |row: usize| Some(if row == 54_321 { 9.0 } else { (row as f64 * 0.01).sin() });
        let other = |row: usize| (row != 7).then_some(-(row as f64));
        let time_s: Vec<f64> = (0..100_000).map(f64::from).collect();
        let linear = place_on_axis(&time_s, false);
        let chosen = decimate_rows(0..100_000, 1000, &|row| linear(time_s[row]), &[&value, &other]);
        assert!(chosen.contains(&54_321) && chosen.contains(&99_999) && chosen.contains(&0));
        assert!(chosen.windows(2).all(|pair| pair[0] < pair[1]));
        assert!((500..=1010).contains(&chosen.len()), "{}", chosen.len());
        assert_eq!(decimate_rows(3..10, 50, &|row| row as f64, &[&value]), (3..10).collect::<Vec<_>>());
        // On a logarithmic axis each decade has as many columns as any other.
        let logarithmic = place_on_axis(&time_s, true);
        let chosen = decimate_rows(0..100_000, 1000, &|row| logarithmic(time_s[row]), &[&value, &other]);
        let in_decade = |low: usize| chosen.iter().filter(|row| (low..10 * low).contains(*row)).count();
        assert_eq!(in_decade(1), 9, "the first decade has fewer rows than columns");
        assert!(
            (1..5).all(|decade| in_decade(10_usize.pow(decade)) >= 1000 / 5 / 5),
            "each decade has a fifth of the columns"
        );
    }

    #[test]
    fn a_window_reaches_one_row_beyond_its_ends() {
        let time_s: Vec<f64> = (0..100).map(f64::from).collect();
        let window = |from_s, to_s| Window { from_s, to_s, points: None, is_logarithmic: false };
        assert_eq!(rows_of(&time_s, window(Some(10.0), Some(20.0))), 9..22);
        assert_eq!(rows_of(&time_s, window(None, None)), 0..100);
        assert_eq!(rows_of(&time_s, window(Some(500.0), Some(600.0))), 99..100);
        assert_eq!(rows_of(&time_s, window(Some(20.0), Some(-5.0))), 1..1);
        assert_eq!(rows_of(&time_s, window(Some(f64::NAN), Some(f64::NAN))).len(), 1);
    }
}
