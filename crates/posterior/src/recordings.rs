//! Recordings: stretches of a record that were measured without interruption. The tracker's gain and offset are constant within a recording.

use record::Record;

/// Smallest ratio of a gap to the longer of its neighbouring intervals at which a new recording begins.
const GAP: f64 = 3.0;
/// Largest difference between forces that count as equal, as a fraction of the force range.
const SAME_FORCE: f64 = 1e-9;

/// Recording number of each row, from 1. A cycle begins a new recording only if the force changes at its first row or a gap in time precedes it. A cycle that begins
/// within a continuous hold continues the recording.
pub fn recordings(record: &Record) -> Vec<u32> {
    let tolerance_n = SAME_FORCE * record.force_range_n();
    let interval_s = |row: usize| row.checked_sub(1).map(|before| record.time_s[row] - record.time_s[before]);
    let is_new = |row: usize| {
        if record.cycle[row] == record.cycle[row - 1] {
            return false;
        }
        let beside_s = [interval_s(row - 1), (row + 1 < record.n_rows()).then(|| interval_s(row + 1)).flatten()];
        let longer_s = beside_s.into_iter().flatten().fold(0.0, f64::max);
        let has_gap = interval_s(row).is_some_and(|gap_s| gap_s > GAP * longer_s);
        (record.force_n[row] - record.force_n[row - 1]).abs() > tolerance_n || has_gap
    };
    let mut number = 1;
    (0..record.n_rows())
        .map(|row| {
            number += u32::from(row > 0 && is_new(row));
            number
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(time_s: &[f64], force_n: &[f64], cycle: &[u32]) -> Record {
        Record {
            time_s: time_s.to_vec(),
            force_n: force_n.to_vec(),
            position_m: vec![None; time_s.len()],
            cycle: cycle.to_vec(),
            ..Record::default()
        }
    }

    #[test]
    fn a_cycle_within_an_unbroken_hold_is_no_recording() {
        let time_s: Vec<f64> = (0..9).map(f64::from).collect();
        let cycle = [1, 1, 1, 2, 2, 2, 3, 3, 3];
        assert_eq!(recordings(&record(&time_s, &[2.0; 9], &cycle)), [1; 9]);
        let changed = [2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 1.0, 1.0, 1.0];
        assert_eq!(recordings(&record(&time_s, &changed, &cycle)), [1, 1, 1, 1, 1, 1, 2, 2, 2]);
        // A change of the force within a cycle begins no new recording.
        let within = [2.0, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
        assert_eq!(recordings(&record(&time_s, &within, &cycle)), [1; 9]);
    }

    #[test]
    fn a_gap_begins_a_recording_and_growing_intervals_do_not() {
        let cycle = [1, 1, 1, 2, 2, 2];
        for second_s in [1.0, 0.01, 3600.0] {
            let gap = [0.0, 1.0, 2.0, 6.0, 7.0, 8.0].map(|time| second_s * time);
            assert_eq!(recordings(&record(&gap, &[2.0; 6], &cycle)), [1, 1, 1, 2, 2, 2], "{second_s}");
            let logarithmic = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0].map(|time| second_s * time);
            assert_eq!(recordings(&record(&logarithmic, &[2.0; 6], &cycle)), [1; 6], "{second_s}");
        }
        assert!(recordings(&record(&[], &[], &[])).is_empty());
    }
}
