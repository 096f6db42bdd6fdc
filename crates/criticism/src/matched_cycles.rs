//! Rows of different cycles that match: they are at the same time in their cycles and follow the same force step.

use record::Record;

/// Largest difference of two rows' times within their cycles at which the rows count as simultaneous, as a fraction of the sample interval.
const SAME_TIME_INTERVALS: f64 = 0.1;
/// Largest difference of two force steps that count as equal, as a fraction of the force's range.
const EQUAL_STEP_FRACTION: f64 = 0.05;
/// Smallest number of matching rows at which cycles are compared.
pub(super) const FEWEST_MATCHED_ROWS: usize = 20;

/// Tolerances within which times and forces count as equal.
pub(super) struct MatchTolerance {
    time_s: f64,
    force_n: f64,
}

impl MatchTolerance {
    /// Tolerances for a record; `None` if it has fewer than two rows.
    pub(super) fn of(record: &Record) -> Option<Self> {
        let time_s = SAME_TIME_INTERVALS * record.median_interval_s()?;
        Some(Self { time_s, force_n: EQUAL_STEP_FRACTION * record.force_range_n() })
    }

    /// Finds the row of `cycle` that matches a row of another cycle.
    pub(super) fn find<'a>(&self, cycle: &'a [Phase], row: &Phase) -> Option<&'a Phase> {
        let at = cycle.partition_point(|other| other.after_s < row.after_s - self.time_s);
        cycle.get(at).filter(|other| {
            other.after_s <= row.after_s + self.time_s
                && (row.from_n - other.from_n).abs() <= self.force_n
                && (row.to_n - other.to_n).abs() <= self.force_n
        })
    }
}

/// A row of a cycle, with its time in the cycle and the forces before and after the last force step.
pub(super) struct Phase {
    pub(super) row: usize,
    after_s: f64,
    from_n: f64,
    to_n: f64,
}

/// Phases of the rows of every cycle.
pub(super) fn phases_of_cycles(record: &Record) -> Vec<Vec<Phase>> {
    let steps = record.force_step_rows();
    (1..=record.n_cycles()).map(|cycle| phases(record, &steps, cycle)).collect()
}

/// Phases of the rows of a cycle; `steps` are the rows of all force steps.
fn phases(record: &Record, steps: &[usize], cycle: u32) -> Vec<Phase> {
    let first = record.cycle.partition_point(|other| *other < cycle);
    let end = record.cycle.partition_point(|other| *other <= cycle);
    let phase = |row: usize| {
        // A position is the limit from the left: at the step's own row it still belongs to the previous hold.
        let step = steps.partition_point(|step| *step < row).checked_sub(1).map(|place| steps[place]);
        let before = |step: usize| step.checked_sub(1).map_or(0.0, |before| record.force_n[before]);
        let (from_n, to_n) = step.map_or((0.0, 0.0), |step| (before(step), record.force_n[step]));
        Phase { row, after_s: record.time_s[row] - record.time_s[first], from_n, to_n }
    };
    (first..end).map(phase).collect()
}

/// Slope of the least-squares line of y over x, the sum of squares of x about its mean, and the residuals of the line.
pub(super) fn about_line(x: &[f64], y: &[f64]) -> ((f64, f64), Vec<f64>) {
    let n = x.len() as f64;
    let (mean_x, mean_y) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let weight = x.iter().map(|x| (x - mean_x).powi(2)).sum::<f64>().max(f64::MIN_POSITIVE);
    let slope = x.iter().zip(y).map(|(x, y)| (x - mean_x) * (y - mean_y)).sum::<f64>() / weight;
    ((slope, weight), x.iter().zip(y).map(|(x, y)| y - mean_y - slope * (x - mean_x)).collect())
}
