//! Observed rows of a record, prepared for the Kalman filter of the noise.

/// Largest difference between time steps that count as equal, as a fraction of the record's duration. In binary, multiples of a decimal interval such as 0.05 s are not
/// exactly equidistant. Without a tolerance, every step would have its own length, and each length needs an exponential.
const EQUAL_STEP_TOLERANCE: f64 = 1e-13;

/// Row of a record with an observed position. The filter visits only these rows.
#[derive(Debug, Clone, Copy)]
pub(super) struct NoiseRow {
    /// Index of the row in the record.
    pub index: usize,
    /// Index in [`NoiseRows::step_s`] of the time step from the previously visited row.
    pub step: usize,
    /// True for the first observed row of its cycle.
    pub new_cycle: bool,
}

/// Observed rows in order of time, which the filter visits, with their distinct time steps.
#[derive(Debug, Clone)]
pub(super) struct NoiseRows {
    pub rows: Vec<NoiseRow>,
    /// Distinct step lengths in s. The first length is infinite and belongs to the step before the first row, because the process is stationary there.
    pub step_s: Vec<f64>,
}

impl NoiseRows {
    /// Prepares the rows with the indices `visited` (ascending) of a record. All rows of the record have times in s and cycle numbers.
    pub fn new(time_s: &[f64], cycle: &[u32], visited: &[usize]) -> Self {
        let length_s = |(before, after): (&usize, &usize)| time_s[*after] - time_s[*before];
        let lengths_s: Vec<f64> = visited.iter().zip(visited.iter().skip(1)).map(length_s).collect();
        let tolerance_s = EQUAL_STEP_TOLERANCE * lengths_s.iter().sum::<f64>();
        let mut order: Vec<usize> = (0..lengths_s.len()).collect();
        order.sort_by(|a, b| lengths_s[*a].total_cmp(&lengths_s[*b]));
        let mut step_s = vec![f64::INFINITY];
        let mut steps = vec![0; visited.len()];
        for position in order {
            let length_s = lengths_s[position];
            if step_s.len() == 1 || length_s - step_s[step_s.len() - 1] > tolerance_s {
                step_s.push(length_s);
            }
            steps[position + 1] = step_s.len() - 1;
        }
        let row = |position: usize| {
            let new_cycle = position == 0 || cycle[visited[position]] != cycle[visited[position - 1]];
            NoiseRow { index: visited[position], step: steps[position], new_cycle }
        };
        Self { rows: (0..visited.len()).map(row).collect(), step_s }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_lead_from_one_visited_row_to_the_next() {
        let time_s: Vec<f64> = (0..40).map(|i| 0.1 * f64::from(i)).collect();
        let cycle: Vec<u32> = (0..40).map(|i| 1 + i / 10).collect();
        let visited = [2, 3, 4, 9, 10, 21, 22, 23];
        let rows = NoiseRows::new(&time_s, &cycle, &visited);
        assert_eq!(rows.step_s.len(), 4, "0.1 s, 0.5 s and 1.1 s are the only lengths: {:?}", rows.step_s);
        for (before, after) in rows.rows.iter().zip(&rows.rows[1..]) {
            let length_s = time_s[after.index] - time_s[before.index];
            assert!((rows.step_s[after.step] - length_s).abs() < 1e-12);
        }
        let first: Vec<usize> = rows.rows.iter().filter(|row| row.new_cycle).map(|row| row.index).collect();
        assert_eq!(first, [2, 10, 21]);
        assert!(rows.rows[0].step == 0 && rows.step_s[0].is_infinite());
    }

    #[test]
    fn no_row_is_no_fault() {
        let rows = NoiseRows::new(&[0.0, 1.0], &[1, 1], &[]);
        assert!(rows.rows.is_empty());
    }
}
