//! Repair of times that do not ascend. The runs of a clock that restarts are joined, and rows that share one time of a coarse clock are spread.

use super::robust::median;
use base::error::{Error, InputPlace, Result, Setting};

/// Largest gap between two tables at which the second table begins at the last row of the first. It is a fraction of the last interval between rows.
const BEGAN_BEFORE: f64 = 0.5;
/// Fraction of an interval by which the last row of a table is moved back if the next table begins at an equal time.
const JUST_BEFORE: f64 = 1e-6;
/// Smallest fraction of rows that repeat the previous row's time for which the clock counts as coarse. The rows from the first to the last repetition count.
const COARSE: f64 = 0.2;
/// Smallest number of such rows. Fewer are repeated rows rather than a coarse clock.
const FEWEST_TIES: usize = 3;
/// Least factor by which neighbouring rows are farther apart in position than rows at neighbouring times, if rows alternate between several tracks.
const TRACKS: f64 = 3.0;

/// Least factor by which rows of equal time are farther apart than rows of a branch at successive times. Noise of a coarse clock gives a factor of about 1.
const BRANCHES: f64 = 6.0;
/// Smallest number of falls of the time, and their fraction of the rows, from which rows count as unsorted.
const FEWEST_FALLS: usize = 4;
const UNSORTED: f64 = 0.1;

/// Changes that were made to the times of a table.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct TimeChanges {
    /// Indices of the rows at which the clock restarted.
    pub restart_rows: Vec<usize>,
    /// Number of rows that repeat the previous row's time.
    pub n_ties: usize,
    /// Number of rows from the first to the last repetition. A clock may be coarse in a part of the record only, as in times of four digits after 1,000 s.
    pub n_rows_with_ties: usize,
    /// True if rows of equal time belong to several tracks.
    pub are_tracks: bool,
    /// Number of rows that repeat time, force and position of the row before, if all rows of equal times do.
    pub n_copies: usize,
}

impl TimeChanges {
    /// True if the clock is coarser than the row spacing and all rows belong to one track.
    pub fn is_coarse(&self) -> bool {
        !self.are_tracks && self.n_ties >= FEWEST_TIES && self.n_ties as f64 >= COARSE * self.n_rows_with_ties as f64
    }

    /// Counts the rows that repeat the previous row's time.
    fn with_ties_of(self, time_s: &[f64]) -> Self {
        let mut ties = (1..time_s.len()).filter(|row| time_s[*row] == time_s[row - 1]);
        let first = ties.next();
        let (n_more, last) = ties.fold((0, first), |(n, _), row| (n + 1, Some(row)));
        let n_rows_with_ties = first.zip(last).map_or(0, |(first, last)| last - first + 2);
        Self { n_ties: n_more + usize::from(first.is_some()), n_rows_with_ties, ..self }
    }
}

/// Times, forces and positions of the rows whose times [`order_times`] makes ascend.
pub(super) struct TimeRows<'a> {
    pub time_s: &'a mut [f64],
    pub force_n: &'a mut [f64],
    pub position_m: &'a [Option<f64>],
    /// True if the forces are measured at commanded positions.
    pub is_force_measured: bool,
    /// True if each force acts until its row.
    pub acts_until_row: bool,
}

/// Rules for times that do not ascend, from a table's description.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TimeRules {
    /// True if the times of a clock that restarts continue from the previous row.
    pub joins_restarts: bool,
    /// True if rows with equal times of a coarse clock are spread evenly.
    pub spreads_ties: bool,
}

/// Changes the times (s) according to the rules so that they ascend, and returns the changes. `starts` holds the index of each table's first row. If
/// a table begins at the previous table's last row, its first force replaces the force of that row, unless the forces are measured or act until their rows anyway.
///
/// # Errors
/// [`Error::Input`] at the first time that does not ascend, with the cause that the rows suggest.
pub(super) fn order_times(
    place: &dyn Fn(usize) -> InputPlace,
    rules: TimeRules,
    starts: &[usize],
    rows: TimeRows<'_>,
) -> Result<TimeChanges> {
    let TimeRows { time_s, force_n, position_m, is_force_measured, acts_until_row } = rows;
    let measured_n = |force_n: &[f64]| is_force_measured.then(|| force_n.iter().copied().map(Some).collect::<Vec<_>>());
    let mut ordered = TimeChanges::default();
    if rules.joins_restarts {
        ordered.restart_rows = join_restarts(time_s);
    }
    for &start in starts.iter().filter(|start| **start >= 2) {
        let (gap_s, before_s) = (time_s[start] - time_s[start - 1], time_s[start - 1] - time_s[start - 2]);
        if gap_s == 0.0 {
            time_s[start - 1] -= JUST_BEFORE * before_s;
        } else if !is_force_measured && !acts_until_row && (0.0..BEGAN_BEFORE * before_s).contains(&gap_s) {
            force_n[start - 1] = force_n[start];
        }
    }
    ordered.n_copies = n_copies(time_s, force_n, position_m);
    if rules.spreads_ties {
        ordered.are_tracks = are_tracks(time_s, position_m, measured_n(force_n));
        ordered = ordered.with_ties_of(time_s);
        spread_ties(time_s);
    }
    let is_fall = |pair: &[f64]| pair[1] < pair[0];
    // Equal times that could not be spread have a fall for their cause.
    let fall = time_s.windows(2).position(is_fall).filter(|_| rules.spreads_ties);
    match fall.or_else(|| time_s.windows(2).position(|pair| pair[1] <= pair[0])) {
        None => Ok(ordered),
        Some(before) => {
            let are_tracks = are_tracks(time_s, position_m, measured_n(force_n));
            Err(refused(place(before + 1), before + 1, time_s, are_tracks))
        }
    }
}

/// Number of rows that repeat time, force and position of the row before. 0 if the rows of an equal time differ, or if values change so rarely that rows may be equal by their
/// digits.
fn n_copies(time_s: &[f64], force_n: &[f64], position_m: &[Option<f64>]) -> usize {
    let is_tie = |row: &usize| time_s[*row] == time_s[*row - 1];
    let is_equal = |row: &usize| {
        force_n[*row] == force_n[*row - 1] && position_m[*row].is_some() && position_m[*row] == position_m[*row - 1]
    };
    let (ties, others): (Vec<usize>, Vec<usize>) = (1..time_s.len()).partition(is_tie);
    let n_changed = others.iter().filter(|row| !is_equal(row)).count();
    let is_copied = ties.iter().all(is_equal) && 2 * n_changed > others.len();
    if is_copied { ties.len() } else { 0 }
}

/// Joins the runs of a clock that restarts by shifting their times (s). Returns the index of the first row of each new run.
///
/// A run that begins with time 0 starts one interval after the previous row. A run that begins later starts at the time of the previous row plus its first
/// time.
fn join_restarts(time_s: &mut [f64]) -> Vec<usize> {
    let (mut rows, mut offset_s, mut before_s) = (Vec::new(), 0.0, None);
    for row in 0..time_s.len() {
        let raw_s = time_s[row];
        if let Some(last_s) = before_s
            && is_restart(raw_s, last_s, time_s[0])
        {
            let interval_s = if row >= 2 { time_s[row - 1] - time_s[row - 2] } else { 0.0 };
            offset_s = time_s[row - 1] + if raw_s <= 0.0 { interval_s } else { 0.0 };
            rows.push(row);
        }
        time_s[row] = raw_s + offset_s;
        before_s = Some(raw_s);
    }
    rows
}

/// True if the clock restarted between `before_s` and `time_s`: the time falls back to near the record's first time.
fn is_restart(time_s: f64, before_s: f64, first_s: f64) -> bool {
    time_s < before_s && before_s > first_s && time_s - first_s <= 0.1 * (before_s - first_s)
}

/// True if times fall so often that the rows are in no order, instead of a clock that restarts.
fn are_unsorted(time_s: &[f64]) -> bool {
    let n_falls = time_s.windows(2).filter(|pair| pair[1] < pair[0]).count();
    n_falls >= FEWEST_FALLS && n_falls as f64 > UNSORTED * time_s.len() as f64
}

/// Spreads the rows of each repeated time (s) evenly over the clock's step, which is the shorter one of the gaps before and after that time. Times that are not sorted stay
/// as they are.
fn spread_ties(time_s: &mut [f64]) {
    let mut runs: Vec<(usize, f64)> = Vec::new();
    for time in time_s.iter() {
        match runs.last_mut() {
            Some((count, value)) if value == time => *count += 1,
            _ => runs.push((1, *time)),
        }
    }
    if runs.len() == time_s.len() || runs.len() < 3 || runs.windows(2).any(|pair| pair[1].1 < pair[0].1) {
        return;
    }
    let gap_s = |place: usize| runs.get(place + 1).map_or(f64::INFINITY, |(_, next)| next - runs[place].1);
    let usual = median(runs[1..runs.len() - 1].iter().map(|(count, _)| *count as f64).collect()).unwrap_or(1.0);
    let mut row = 0;
    for (place, (count, value)) in runs.iter().enumerate() {
        // The first step of the clock may have begun before the record, and the last step may end after the record. Both therefore count as steps of
        // usual length.
        let rows_a_step = if place == 0 || place + 1 == runs.len() { usual.max(*count as f64) } else { *count as f64 };
        let step_s = gap_s(place).min(place.checked_sub(1).map_or(f64::INFINITY, gap_s));
        let left_out = if place == 0 { rows_a_step - *count as f64 } else { 0.0 };
        for k in 0..*count {
            time_s[row] = value + step_s * (left_out + k as f64) / rows_a_step;
            row += 1;
        }
    }
}

/// Returns the error for a time that is not later than the previous time. The error names the cause that the rows suggest, and the remedy.
fn refused(place: InputPlace, row: usize, time_s: &[f64], are_tracks: bool) -> Error {
    let (time, before) = (time_s[row], time_s[row - 1]);
    let is_coarse = TimeChanges::default().with_ties_of(time_s).is_coarse();
    let (found, remedy) = if time == before && is_coarse && are_tracks {
        (
            format!(
                "several rows have the time {time} s and their values alternate: the rows belong to several tracks"
            ),
            format!(
                "name the track column with `{0}` and choose one track with `{1}`; of a track that branches, keep one branch in the file",
                Setting::TrackColumn,
                Setting::Track
            ),
        )
    } else if time == before && is_coarse {
        (
            format!("several rows have the time {time} s: the clock is coarser than the rows"),
            format!(
                "use `{} spread` (in [measurement]: time_ties = \"spread\") to spread them evenly over the clock's steps",
                Setting::TimeTies
            ),
        )
    } else if time == before {
        (
            format!("time is not increasing: two rows have the time {time} s"),
            format!(
                "remove the row if it is repeated, give it its own time, or use `{} spread` if the clock is coarse",
                Setting::TimeTies
            ),
        )
    } else if is_restart(time, before, time_s[0]) && !are_unsorted(time_s) {
        (
            format!("time restarts: {time} s follows {before} s"),
            format!(
                "if the recording continued, use `{} join` (in [measurement]: time_restarts = \"join\"); otherwise put each recording in its own file",
                Setting::TimeRestarts
            ),
        )
    } else {
        (
            format!("time is not increasing: {time} s follows {before} s"),
            "sort the rows by time, unless they belong to several recordings, which need a file each".to_string(),
        )
    };
    Error::input(place, found, remedy)
}

/// True if the rows belong to several tracks: their positions tell, or the forces that are measured at commanded positions.
fn are_tracks(time_s: &[f64], position_m: &[Option<f64>], measured_n: Option<Vec<Option<f64>>>) -> bool {
    alternate(time_s, position_m) || measured_n.is_some_and(|force_n| alternate(time_s, &force_n))
}

/// True if the rows belong to several tracks, because the positions of neighbouring rows differ much more than those of rows at neighbouring times, throughout or where times
/// are equal.
fn alternate(time_s: &[f64], position_m: &[Option<f64>]) -> bool {
    let together = time_s.iter().take_while(|time| **time == time_s[0]).count();
    let apart = |step: usize| {
        let pairs = position_m.iter().zip(position_m.iter().skip(step));
        median(pairs.filter_map(|(a, b)| Some(((*b)? - (*a)?).abs())).collect())
    };
    together >= 2 && apart(1).zip(apart(together)).is_some_and(|(next, same)| next > TRACKS * same)
        || branches(time_s, position_m)
}

/// True if a track has branches: rows of equal time are much farther apart than the rows of a branch at successive times. Branches have one order at all times.
fn branches(time_s: &[f64], position_m: &[Option<f64>]) -> bool {
    let rows: Vec<(f64, f64)> = time_s.iter().zip(position_m).filter_map(|(time, x)| Some((*time, (*x)?))).collect();
    let groups: Vec<&[(f64, f64)]> = rows.chunk_by(|a, b| a.0 == b.0).collect();
    let tied = groups.iter().flat_map(|group| group.windows(2).map(|pair| (pair[1].1 - pair[0].1).abs())).collect();
    let alike = groups.windows(2).filter(|pair| pair[0].len() > 1 && pair[0].len() == pair[1].len());
    let steps = alike.flat_map(|pair| pair[0].iter().zip(pair[1]).map(|(a, b)| (b.1 - a.1).abs())).collect();
    median(tied).zip(median(steps)).is_some_and(|(tied, step)| step > 0.0 && tied > BRANCHES * step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_begins_again_goes_on() {
        // In the first case the rows of a run are at the start of each interval, in the second case at the end.
        for (first_s, expected) in [(0.0, [0.0, 0.5, 1.0, 1.5]), (0.5, [0.5, 1.0, 1.5, 2.0])] {
            let mut time_s = [first_s, first_s + 0.5, first_s, first_s + 0.5];
            assert_eq!(join_restarts(&mut time_s), [2]);
            assert_eq!(time_s, expected);
        }
        let mut unsorted = [0.0, 1.0, 2.0, 1.5];
        assert!(join_restarts(&mut unsorted).is_empty());
    }

    /// Checks a second table that starts 0.01 s after the last row of the first table, as rheometers log it: its force then acts from that last row on. If
    /// the second table starts a full interval later, no force changes. If it starts at an equal time, the last row of the first table is moved slightly
    /// back.
    #[test]
    fn a_table_that_begins_with_the_last_row_of_another_switches_there() {
        let place = |row: usize| InputPlace::file("t.csv").at_line(row + 2);
        let position_m = [Some(0.0); 5];
        for (third_s, expected_n, is_nudged) in [
            (60.01, [1.0, 1.0, 2.0, 2.0, 2.0], false),
            (90.0, [1.0, 1.0, 1.0, 2.0, 2.0], false),
            (60.0, [1.0, 1.0, 1.0, 2.0, 2.0], true),
        ] {
            let (mut time_s, mut force_n) = ([0.01, 30.0, 60.0, third_s, 100.0], [1.0, 1.0, 1.0, 2.0, 2.0]);
            let rows = TimeRows {
                time_s: &mut time_s,
                force_n: &mut force_n,
                position_m: &position_m,
                is_force_measured: false,
                acts_until_row: false,
            };
            order_times(&place, TimeRules::default(), &[0, 3], rows).expect("times that ascend");
            assert_eq!(force_n, expected_n, "{third_s}");
            assert_eq!(time_s[2] < 60.0, is_nudged, "{third_s}");
            assert!((time_s[2] - 60.0).abs() < 1e-3, "{third_s}");
        }
    }

    /// Checks rows at 4 Hz with a clock that shows only whole seconds. The first second has two rows, and the last second has one.
    #[test]
    fn rows_of_a_coarse_clock_are_spread() {
        let truth: Vec<f64> = (2..13).map(|row| 0.25 * f64::from(row)).collect();
        let mut time_s: Vec<f64> = truth.iter().map(|time| time.floor()).collect();
        assert_eq!(
            TimeChanges::default().with_ties_of(&time_s),
            TimeChanges { n_ties: 7, n_rows_with_ties: 10, ..TimeChanges::default() }
        );
        spread_ties(&mut time_s);
        assert_eq!(time_s, truth);
    }

    #[test]
    fn copies_of_rows_are_no_coarse_clock() {
        let time_s: Vec<f64> = (0..40_usize).map(|row| (row / 2) as f64).collect();
        let copied: Vec<Option<f64>> = (0..40_usize).map(|row| Some((row / 2) as f64)).collect();
        assert_eq!(n_copies(&time_s, &[1.0; 40], &copied), 20);
        // A body that rests most of the time has equal rows by its digits, and lost positions are no copies.
        let resting: Vec<Option<f64>> = (0..40_usize).map(|row| Some((row / 10) as f64)).collect();
        assert_eq!(n_copies(&time_s, &[1.0; 40], &resting), 0);
        for other in [None, Some(3.1)] {
            let mut moving = copied.clone();
            (moving[6], moving[7]) = (other, None);
            assert_eq!(n_copies(&time_s, &[1.0; 40], &moving), 0);
        }
    }

    /// Times of four digits are coarse only after 1,000 s: rows every 0.6 s then have a step of 1 s. A repeated row is no coarse clock.
    #[test]
    fn a_clock_may_be_coarse_in_a_part_of_the_record() {
        let truth: Vec<f64> = (0..400).map(|row| 800.0 + 0.6 * f64::from(row)).collect();
        let mut time_s: Vec<f64> =
            truth.iter().map(|time| if *time < 1e3 { (10.0 * time).round() / 10.0 } else { time.floor() }).collect();
        let changes = TimeChanges::default().with_ties_of(&time_s);
        assert!(changes.is_coarse() && (changes.n_ties as f64) < COARSE * 400.0, "{changes:?}");
        spread_ties(&mut time_s);
        let largest_s = truth.iter().zip(&time_s).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(largest_s < 1.0 && time_s.windows(2).all(|pair| pair[0] < pair[1]), "{largest_s}");
        let repeated = [0.0, 1.0, 1.0, 2.0, 3.0];
        assert!(!TimeChanges::default().with_ties_of(&repeated).is_coarse());
    }

    /// A track of 40 times that has a second branch, twenty steps away, in the second half. A coarse clock has none, whatever its noise and digits are.
    #[test]
    fn a_track_that_branches_is_several_tracks() {
        let noise = |row: usize| 2.0 * ((row as f64 + 1.0) * 12.9898).sin().mul_add(43_758.545_3, 0.0).fract();
        let (mut time_s, mut position_m) = (Vec::new(), Vec::new());
        for row in 0..40_usize {
            let x = row as f64 + 0.2 * noise(row);
            for branch in 0..if row < 20 { 1 } else { 2 } {
                time_s.push(row as f64);
                position_m.push(Some(x + 20.0 * branch as f64));
            }
        }
        assert!(alternate(&time_s, &position_m));
        for rows_a_step in [2, 4, 10, 30] {
            let coarse_s: Vec<f64> = (0..300_usize).map(|row| (row / rows_a_step) as f64).collect();
            let positions = |size: f64, digits: f64| -> Vec<Option<f64>> {
                let noisy = (0..300).map(|row| 0.1 * row as f64 + size * noise(row));
                noisy.map(|x| Some((x * digits).round() / digits)).collect()
            };
            for (size, digits) in [(1.0, 1e6), (1.0, 1.0), (0.0, 1e6), (0.0, 2.0)] {
                assert!(!alternate(&coarse_s, &positions(size, digits)), "{rows_a_step} rows, {size}, {digits}");
            }
        }
    }

    #[test]
    fn rows_of_several_tracks_alternate() {
        let time_s: Vec<f64> = (0..20).map(|row| f64::from(row / 2)).collect();
        let tracks: Vec<Option<f64>> = (0..20).map(|row| Some(f64::from(100 * (row % 2) + row))).collect();
        let one: Vec<Option<f64>> = (0..20).map(|row| Some(f64::from(row))).collect();
        assert!(alternate(&time_s, &tracks) && !alternate(&time_s, &one));
    }
}
