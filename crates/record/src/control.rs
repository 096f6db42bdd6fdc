//! The quantity that an experiment commands: the force, as in a creep test, or the position, as in a relaxation.

use super::noise::SD_PER_MAD;
use super::robust::median;
use super::trajectory::Trajectory;
use base::error::{Error, InputPlace, Result};
use std::path::Path;

/// Commanded quantity of a record. The other one of force and position is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Control {
    /// The force is commanded, and the position is measured.
    #[default]
    Force,
    /// The position is commanded, and the force is measured. A record has the commanded position (m) in its forces, and the measured force (N) in its positions.
    /// Creep and relaxation then have equal equations, in which the relaxation modulus takes the place of the creep compliance.
    Position,
}

/// Largest number of blocks of rows whose means are compared, and that for a range.
const MOST_BLOCKS: usize = 100;
const FEW_BLOCKS: usize = 20;
/// A quantity holds between two blocks if their means differ by less than this part of its range.
const HELD: f64 = 0.01;
/// Least part of the blocks in which a commanded quantity holds.
const MOSTLY: f64 = 0.6;
/// Least part of successive changes with equal signs that shows a trend. For noise about a constant it is 1/3.
const TREND: f64 = 0.7;

/// A quantity moves in a change of more than this part of the largest one.
const ALIKE: f64 = 0.03;

/// Least change of the force over the longest hold of the position, as a part of its range, that shows a relaxation.
const DRIFT: f64 = 0.15;

/// Largest part of the rows before a hold in which a commanded strain rises.
const RISE: f64 = 0.1;
/// Least standard deviation of a stress that may be measured, as a part of its mean.
const UNSTEADY: f64 = 0.01;
/// Largest relative standard deviation of a commanded strain beside it, as a part of that of the stress.
const STEADIER: f64 = 0.01;
/// Least difference between the first and the last values of a decay, in standard errors.
const DECAY_ERRORS: f64 = 5.0;
/// Largest distance of a measured position that holds from its typical value, as a part of that value.
const NEAR_MEAN: f64 = 0.03;
/// Least range of the force beside such a position, as a part of its mean, in standard deviations of the position, as a part of its mean.
const MORE: f64 = 5.0;

/// Least correlation of a force with the number of the row that shows a drift beneath noise.
const ORDERED: f64 = 0.7;

/// Least change of the position in one row that is a jump, as a part of its range.
const JUMP: f64 = 0.1;
/// Smallest number of equal jumps in one direction that count as a staircase.
const STAIRS: usize = 3;
/// Largest part of the rows in which a command of holds jumps.
const FEW_JUMPS: f64 = 0.1;
/// Largest sum of the squared changes of a smooth quantity from row to row, divided by the sum of its squared distances from its means. For noise it is about 2 (von Neumann's ratio).
const SMOOTH: f64 = 1.0;
/// Largest change of the force in the row of a jump, as a part of that in the next row, if the force answers there.
const LATE: f64 = 0.2;

/// Least sum of the sizes of the changes of a force in blocks of equal duration that shows a trend, as a part of its range.
const LEAST_TREND: f64 = 0.05;

/// Largest part of the blocks before the peak of a force that falls while the position stays.
const EARLY: f64 = 0.5;
/// Least fall of such a force, as a part of its peak, the largest from block to block, and the least that remains.
const LEAST_FALL: f64 = 0.1;
const LARGEST_FALL: f64 = 0.3;
const LEAST_REST: f64 = 0.1;

/// Number of blocks between the ends of a hold.
const HOLD_BLOCKS: usize = 3;

/// Largest spread of the rates of a ramp, as a part of the rate.
const STEADY: f64 = 0.1;
/// Least part of the blocks in which a ramp moves.
const RAMPING: f64 = 0.3;

impl Control {
    /// The quantity that an experiment most likely commanded, from the time (s), the force (N) and the position (m) of each row. A quantity that only jumps, while the other one changes
    /// smoothly, is commanded. Otherwise it is the position if it holds for most of the time while the force drifts, or if it changes at a much steadier rate than the force;
    /// otherwise the force.
    pub(super) fn likely(time_s: &[f64], force_n: &[f64], position_m: &[Option<f64>]) -> Self {
        let known_s = time_s.iter().zip(position_m).filter_map(|(time, position)| position.map(|_| *time));
        let time_s: Vec<f64> = known_s.collect();
        let (force_n, position_m) = known_rows(force_n, position_m);
        match [(&force_n, &position_m), (&position_m, &force_n)].map(|(command, answer)| is_command(command, answer)) {
            [true, false] => Self::Force,
            [false, true] => Self::Position,
            _ if stays_under_less_force(&force_n, &position_m) => Self::Position,
            _ if is_at_one_rate(&time_s, &position_m, &force_n) => Self::Position,
            _ if is_at_one_rate(&time_s, &force_n, &position_m) => Self::Force,
            // Rows are denser in ramps, or in the first seconds of a step: the one counts blocks of equal duration, the other blocks of equally many rows.
            _ => {
                let by_rows = Changes { force: changes(&force_n), position: changes(&position_m) };
                let of_time = |values: &[f64]| changes_of(&means_in_time(&time_s, values), values);
                let in_time = Changes { force: of_time(&force_n), position: of_time(&position_m) };
                // A record with dense first rows has few changes in time, whose signs are chance or those of a sensor that settles.
                match [by_rows.control(0, HELD), in_time.control(FEW_BLOCKS, LEAST_TREND)] {
                    [Self::Force, Self::Force] => Self::Force,
                    _ => Self::Position,
                }
            }
        }
    }
}

/// Forces and positions of the rows that have both.
fn known_rows(force_n: &[f64], position_m: &[Option<f64>]) -> (Vec<f64>, Vec<f64>) {
    force_n.iter().zip(position_m).filter_map(|(force, position)| Some((*force, (*position)?))).unzip()
}

/// True if `values` are constant to the last digit except for a few jumps, while `answer` changes smoothly between the jumps. Measured values vary in their last digit.
fn is_command(values: &[f64], answer: &[f64]) -> bool {
    if !has_only_jumps(values) || has_only_jumps(answer) {
        return false;
    }
    let holds = values.chunk_by(|a, b| a == b).scan(0, |at, hold| {
        *at += hold.len();
        Some(&answer[*at - hold.len()..*at])
    });
    let (changes, distances) = holds.fold((0.0, 0.0), |(changes, distances), hold| {
        let mean = hold.iter().sum::<f64>() / hold.len() as f64;
        let of_changes: f64 = hold.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum();
        (changes + of_changes, distances + hold.iter().map(|x| (x - mean).powi(2)).sum::<f64>())
    });
    changes < SMOOTH * distances
}

/// True if values are constant to the last digit except for a few jumps. Many equal jumps in one direction can be the digits of a coarse sensor.
pub(super) fn has_only_jumps(values: &[f64]) -> bool {
    let [low, high] =
        values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(*x), high.max(*x)]);
    let changes: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).filter(|change| *change != 0.0).collect();
    let is_staircase = changes.len() >= STAIRS && changes.iter().all(|change| (change / changes[0] - 1.0).abs() < 1e-6);
    let sizes: Vec<f64> = changes.iter().map(|change| change.abs()).collect();
    !is_staircase
        && (sizes.len() as f64) < FEW_JUMPS * values.len() as f64
        && sizes.iter().all(|size| *size > JUMP * (high - low))
}

/// True if a strain as the table has it stays near one value without a trend, while the stress drifts by more than the strain varies: a relaxation whose measured strain counts
/// from its first row is noise only. A few rows of its rise may come first. This is no test for a bead, whose coordinate has no zero of its own.
pub(super) fn holds_as_written(force_n: &[f64], written_m: &[Option<f64>]) -> bool {
    let (force_n, known) = known_rows(force_n, written_m);
    let Some(n_rise) = rows_of_rise(&known) else { return false };
    let (known, force_n) = (&known[n_rise..], &force_n[n_rise..]);
    let is_still = !has_trend(&changes(known)) && correlation_with_row(known).abs() < 0.5 * ORDERED;
    let is_drift = drifts(&changes(force_n)) || correlation_with_row(force_n).abs() > ORDERED;
    // A stress that settles is larger at first, too. That of a relaxation falls on.
    let is_fall = if n_rise > 0 { decays(force_n) } else { is_drift || decays(force_n) };
    is_still && is_fall && relative_range(force_n) > MORE * relative_sd(known)
}

/// True if a strain stays near one value after a few rows of its rise, and the stress varies far more: so the two are measured in a relaxation, but also in the creep of an
/// elastic body under a force that is not steady.
pub(super) fn is_steadier(force_n: &[f64], written_m: &[Option<f64>]) -> bool {
    let (force_n, known) = known_rows(force_n, written_m);
    rows_of_rise(&known).is_some_and(|n_rise| {
        let [force, strain] = [&force_n[n_rise..], &known[n_rise..]].map(relative_sd);
        force > UNSTEADY && strain < STEADIER * force
    })
}

/// Number of rows before the strain is near its typical value, where it stays; `None` if they are many, or if it does not stay.
fn rows_of_rise(known: &[f64]) -> Option<usize> {
    let typical_m = median(known.to_vec())?;
    let is_near = |x: &f64| (x - typical_m).abs() < NEAR_MEAN * typical_m.abs();
    let n_rise = known.iter().position(is_near).filter(|n| *n as f64 <= RISE * known.len() as f64)?;
    known[n_rise..].iter().all(is_near).then_some(n_rise)
}

/// True if the sizes of values fall from the first tenth to the second half, and still after the first fifth, beyond the noise of neighbouring rows.
fn decays(values: &[f64]) -> bool {
    let sizes: Vec<f64> = values.iter().map(|x| x.abs()).collect();
    let n = sizes.len();
    let steps = sizes.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let Some(step) = median(steps).filter(|_| n >= 10) else { return false };
    let sd = SD_PER_MAD / 2.0_f64.sqrt() * step;
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let last = &sizes[n / 2..];
    let falls = |part: &[f64]| {
        let error = sd * (1.0 / part.len() as f64 + 1.0 / last.len() as f64).sqrt();
        mean(part) - mean(last) > DECAY_ERRORS * error
    };
    falls(&sizes[..n / 10]) && falls(&sizes[n / 5..n / 2])
}

/// Standard deviation of values as a part of their mean.
fn relative_sd(values: &[f64]) -> f64 {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / n).sqrt() / mean.abs()
}

/// Range of the means of blocks of values as a part of the mean of all.
fn relative_range(values: &[f64]) -> f64 {
    let mean = |block: &[f64]| block.iter().sum::<f64>() / block.len() as f64;
    let blocks = values.chunks(values.len().div_ceil(FEW_BLOCKS).max(1)).map(mean);
    let [low, high] = blocks.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)]);
    (high - low) / mean(values).abs()
}

/// Correlation of values with the number of their row; 0 if they do not change.
fn correlation_with_row(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n.max(1.0);
    let rows = || values.iter().enumerate().map(|(row, x)| (row as f64 - 0.5 * (n - 1.0), x - mean));
    let sum = |of: &dyn Fn((f64, f64)) -> f64| rows().map(of).sum::<f64>();
    let size = (sum(&|(row, _)| row * row) * sum(&|(_, x)| x * x)).sqrt();
    if size > 0.0 { sum(&|(row, x)| row * x) / size } else { 0.0 }
}

/// True if changes add up to more than a small part of the range, and none of them is most of their sum: a commanded force may change at once during the hold of a body that flows only.
fn drifts(changes: &[f64]) -> bool {
    let (sum, largest) =
        changes.iter().fold((0.0, 0.0_f64), |(sum, most), change| (sum + change, most.max(change.abs())));
    sum.abs() > DRIFT && largest < 0.5 * sum.abs()
}

/// True if the force falls far after its peak, but not to 0, while the position stays: no body with elasticity does this under a commanded force.
fn stays_under_less_force(force_n: &[f64], position_m: &[f64]) -> bool {
    let [force, position] = [force_n, position_m].map(means_of_blocks);
    let sign = if force.iter().sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
    let peak = (0..force.len()).max_by(|a, b| (sign * force[*a]).total_cmp(&(sign * force[*b])));
    let Some(peak) = peak.filter(|peak| *peak as f64 <= EARLY * force.len() as f64) else { return false };
    let rest = force[force.len() - 1] / force[peak];
    let [_, after @ ..] = &position[peak..] else { return false };
    let [low, high] =
        after.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(*x), high.max(*x)]);
    let is_fall = (LEAST_REST..1.0 - LEAST_FALL).contains(&rest)
        && force[peak..].windows(2).all(|pair| (pair[1] - pair[0]).abs() < LARGEST_FALL * force[peak].abs());
    is_fall && high - low < HELD * range_with_zero(position_m)
}

/// True if values hold near one that is not 0 for a good part of the time in which they are not 0.
pub(super) fn holds(time_s: &[f64], values: &[f64]) -> bool {
    let range = range_with_zero(values);
    let holds_in = |means: Vec<f64>| {
        let apart = means.windows(HOLD_BLOCKS + 1).map(|hold| [hold[0], hold[HOLD_BLOCKS]].map(|mean| mean / range));
        let acting: Vec<[f64; 2]> = apart.filter(|ends| ends.iter().any(|end| end.abs() > JUMP)).collect();
        let is_held = |[a, b]: &&[f64; 2]| (a - b).abs() < 2.0 * HELD;
        acting.iter().filter(is_held).count() as f64 >= RAMPING * acting.len() as f64
    };
    has_only_jumps(values) || holds_in(means_of_blocks(values)) || holds_in(means_in_time(time_s, values))
}

/// Largest relative change of a force that holds, least motion under it in standard errors of its ends, and least ratio of the relative motion to the relative change.
const SAME_FORCE: f64 = 0.02;
const CREEPS: f64 = 8.0;
const RATHER: f64 = 5.0;

/// True if the body goes on moving while the force holds near its largest value. In a relaxation the force falls by more than the position changes.
pub(super) fn creeps_under_held_force(force_n: &[f64], position_m: &[Option<f64>]) -> bool {
    let (force_n, known) = known_rows(force_n, position_m);
    let largest_n = force_n.iter().fold(0.0_f64, |most, force| most.max(force.abs()));
    let held = force_n.iter().zip(&known).filter(|(force, _)| force.abs() > 0.8 * largest_n);
    let (held_n, held_m): (Vec<f64>, Vec<f64>) = held.unzip();
    let quarter = held_m.len() / 4;
    let change = |values: &[f64]| {
        let [first, last] = [&values[..quarter], &values[values.len() - quarter..]].map(|part| median(part.to_vec()));
        Some((last? - first?).abs())
    };
    let step_m = median(held_m.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect());
    let (Some(change_n), Some(change_m), Some(step_m)) = (change(&held_n), change(&held_m), step_m) else {
        return false;
    };
    let (falls, moves) = (change_n / largest_n, change_m / range_with_zero(&known));
    falls < SAME_FORCE && moves > RATHER * falls && change_m > CREEPS * step_m / (quarter as f64).sqrt()
}

/// True if a commanded position jumps from row to row, and the force answers only in the row after each jump: the position of a row then acts from that row on.
pub(super) fn answers_after_jumps(force_n: &[f64], position_m: &[Option<f64>]) -> bool {
    let known: Vec<f64> = position_m.iter().flatten().copied().collect();
    if known.len() != force_n.len() {
        return false;
    }
    let range_m = known.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let moves = |row: usize, least: f64| (known[row] - known[row - 1]).abs() > least * range_m;
    let is_held = |row: usize| row == 0 || !moves(row, HELD);
    let is_jump = |row: &usize| moves(*row, JUMP) && is_held(row - 1) && is_held(row + 1);
    let jumps: Vec<usize> = (1..known.len().saturating_sub(1)).filter(is_jump).collect();
    let change = |row: usize| (force_n[row] - force_n[row - 1]).abs();
    let n_after = jumps.iter().filter(|row| change(**row) < LATE * change(**row + 1)).count();
    !jumps.is_empty() && n_after == jumps.len()
}

/// Correlation of the changes of force and position from block to block of rows; 0 if one of them does not change. It is positive for a passive body of which a part is elastic, and
/// noise during long holds does not hide it.
pub(super) fn correlation_of_changes(force_n: &[f64], position_m: &[Option<f64>]) -> f64 {
    let Changes { force, position } = Changes::of(force_n, position_m);
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let size = (dot(&force, &force) * dot(&position, &position)).sqrt();
    if size > 0.0 { dot(&force, &position) / size } else { 0.0 }
}

/// Changes of force and position from block to block of the rows that have both, as parts of their ranges.
struct Changes {
    force: Vec<f64>,
    position: Vec<f64>,
}

impl Changes {
    fn of(force_n: &[f64], position_m: &[Option<f64>]) -> Self {
        let (force_n, position_m) = known_rows(force_n, position_m);
        Self { force: changes(&force_n), position: changes(&position_m) }
    }

    /// Quantity that is commanded. A trend of the force counts with at least `least_pairs` changes during holds whose sizes add up to `least_trend` of the range.
    fn control(&self, least_pairs: usize, least_trend: f64) -> Control {
        let Self { force, position } = self;
        let is_held = |change: &f64| change.abs() < HELD;
        if (position.iter().filter(|change| is_held(change)).count() as f64) < MOSTLY * position.len().max(1) as f64 {
            return Control::Force;
        }
        let pairs = position.windows(2).zip(force.windows(2)).filter(|(x, _)| x.iter().all(is_held));
        let held: Vec<&[f64]> = pairs.map(|(_, force)| force).collect();
        let alike: Vec<bool> = held.iter().map(|force| force[0] * force[1] > 0.0).collect();
        let size: f64 = held.iter().map(|force| force[1].abs()).sum();
        let is_trend = are_mostly(&alike) && held.len() >= least_pairs && size >= least_trend;
        // Noise hides the trend of a slow decay from block to block, but not over a whole hold.
        let held = position.chunk_by(|a, b| is_held(a) == is_held(b)).scan(0, |at, run| {
            *at += run.len();
            Some((run, &force[*at - run.len()..*at]))
        });
        let longest = held.filter(|(run, _)| is_held(&run[0])).max_by_key(|(run, _)| run.len());
        // The force may answer a jump in the row after it.
        let drifts = longest.is_some_and(|(_, force)| drifts(&force[1..]));
        if is_trend || drifts { Control::Position } else { Control::Force }
    }
}

/// True if a quantity changes at a much steadier rate in time than the other one, which drifts to the end: a body that flows under a force goes on at one rate after the force's ramp.
fn is_at_one_rate(time_s: &[f64], values: &[f64], others: &[f64]) -> bool {
    let [own, other] = [values, others].map(|values| rates(time_s, values));
    let spread = rate_spread(&own);
    spread < STEADY && rate_spread(&other) > 3.0 * spread && (has_trend(&other) || drifts(&other[other.len() / 2..]))
}

/// Mean rates of a quantity between parts of equal duration, in ranges for each part. Rows may be denser in some of them.
fn rates(time_s: &[f64], values: &[f64]) -> Vec<f64> {
    let range = range_with_zero(values) * MOST_BLOCKS as f64;
    let parts = parts_of_time(time_s, values);
    parts.windows(2).map(|pair| (pair[1][1] - pair[0][1]) / (pair[1][0] - pair[0][0]) / range).collect()
}

/// Mean place in time, from 0 to 1, and mean of the values in each part of equal duration that has rows. Times that do not ascend count as rows.
fn parts_of_time(time_s: &[f64], values: &[f64]) -> Vec<[f64; 2]> {
    let ascend = time_s.windows(2).all(|pair| pair[0] < pair[1]);
    let (Some(first_s), Some(last_s)) = (time_s.first(), time_s.last()) else { return Vec::new() };
    let place = |row: usize| match ascend {
        true => (time_s[row] - first_s) / (last_s - first_s),
        false => row as f64 / values.len() as f64,
    };
    let part = |row: usize| (MOST_BLOCKS as f64 * place(row)).min(MOST_BLOCKS as f64 - 1.0) as usize;
    let rows: Vec<usize> = (0..values.len()).collect();
    let mean =
        |rows: &[usize], of: &dyn Fn(usize) -> f64| rows.iter().map(|row| of(*row)).sum::<f64>() / rows.len() as f64;
    let parts = rows.chunk_by(|a, b| part(*a) == part(*b));
    parts.map(|rows| [mean(rows, &place), mean(rows, &|row| values[row])]).collect()
}

/// Means of the values in parts of equal duration that have rows.
fn means_in_time(time_s: &[f64], values: &[f64]) -> Vec<f64> {
    parts_of_time(time_s, values).into_iter().map(|[_, mean]| mean).collect()
}

/// Sizes of the changes in which a quantity moves. One that holds has a few large changes, and is at rest or noise between them.
fn moving(changes: &[f64]) -> Vec<f64> {
    let largest = changes.iter().fold(0.0_f64, |most, change| most.max(change.abs()));
    changes.iter().map(|change| change.abs()).filter(|size| *size > ALIKE * largest).collect()
}

/// Spread of the rates with which a quantity moves, as a part of the middle rate: small for a ramp or a triangle, with or without holds. Infinite if it hardly moves.
fn rate_spread(changes: &[f64]) -> f64 {
    let mut sizes = moving(changes);
    if sizes.is_empty() || (sizes.len() as f64) < RAMPING * changes.len() as f64 {
        return f64::INFINITY;
    }
    let middle_of = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    let middle = middle_of(&mut sizes);
    let mut apart: Vec<f64> = sizes.iter().map(|size| (size / middle - 1.0).abs()).collect();
    middle_of(&mut apart)
}

/// True if most successive changes have equal signs.
fn has_trend(changes: &[f64]) -> bool {
    are_mostly(&changes.windows(2).map(|pair| pair[0] * pair[1] > 0.0).collect::<Vec<_>>())
}

/// True if most pairs of changes have equal signs.
fn are_mostly(alike: &[bool]) -> bool {
    alike.iter().filter(|alike| **alike).count() as f64 > TREND * alike.len().max(1) as f64
}

/// Changes of a quantity from block to block of rows, as parts of its range.
fn changes(values: &[f64]) -> Vec<f64> {
    changes_of(&means_of_blocks(values), values)
}

/// Changes between means of a quantity, as parts of its range. The range includes 0, at which every record starts.
fn changes_of(means: &[f64], values: &[f64]) -> Vec<f64> {
    let range = range_with_zero(values);
    means.windows(2).map(|pair| if range > 0.0 { (pair[1] - pair[0]) / range } else { 0.0 }).collect()
}

/// Means of a quantity in blocks of equally many rows.
fn means_of_blocks(values: &[f64]) -> Vec<f64> {
    let mean = |block: &[f64]| block.iter().sum::<f64>() / block.len() as f64;
    values.chunks(values.len().div_ceil(MOST_BLOCKS).max(1)).map(mean).collect()
}

/// Range of values and 0, at which every record starts.
fn range_with_zero(values: &[f64]) -> f64 {
    values.iter().fold(0.0_f64, |most, x| most.max(*x)) - values.iter().fold(0.0_f64, |least, x| least.min(*x))
}

/// Least motion, as a part of the largest, that shows the sign of the response.
const MOVED: f64 = 0.1;
/// Smallest part of the rows with one sign, so that this is the sign of the response.
const ONE_SIGN: f64 = 0.9;

/// True if a measured force opposes the motion of a commanded position from `zero_m` in nearly all rows in which the position has moved, whatever their noise is. The inertia of a
/// tool can make the first forces much larger than all others.
pub(super) fn opposes(force_n: &[f64], position_m: &[Option<f64>], zero_m: f64) -> bool {
    let (force_n, position_m) = known_rows(force_n, position_m);
    let ways = || position_m.iter().map(|x| x - zero_m);
    let farthest_m = ways().fold(0.0_f64, |most, way| most.max(way.abs()));
    let moved = ways().zip(&force_n).filter(|(way, force)| way.abs() > MOVED * farthest_m && **force != 0.0);
    let signs: Vec<bool> = moved.map(|(way, force)| way * force < 0.0).collect();
    signs.iter().filter(|opposes| **opposes).count() as f64 > ONE_SIGN * signs.len() as f64
}

impl Trajectory {
    /// Multiplies the forces and the positions by a factor each.
    pub(super) fn scale(&mut self, [of_force, of_position]: [f64; 2]) {
        self.force_n.iter_mut().chain(&mut self.force_before_n).for_each(|force| *force *= of_force);
        self.position_m.iter_mut().flatten().for_each(|position| *position *= of_position);
        self.position_unit_m *= of_position;
    }

    /// Exchanges force and position, for a record with a prescribed position. Errors name `file`.
    ///
    /// # Errors
    /// [`Error::Input`] if a row has no position, or if the table has several coordinates.
    pub(super) fn exchange(&mut self, file: &Path) -> Result<()> {
        let refuse = |line: usize, found: &str, remedy: &str| {
            let place = InputPlace::file(file).at_line(line).at_key(self.position_column.as_str());
            Err(Error::input(place, found, remedy))
        };
        if !self.others_m.is_empty() {
            let remedy = "give the column of the commanded position, or leave out `kind = \"relaxation\"`";
            return refuse(self.lines.first().copied().unwrap_or(1), "a commanded position has one coordinate", remedy);
        }
        if let Some(row) = self.position_m.iter().position(Option::is_none) {
            let remedy = "write the commanded position in every row";
            return refuse(self.lines.get(row).copied().unwrap_or(1), "the commanded position is missing", remedy);
        }
        let force_n = std::mem::take(&mut self.force_n);
        self.force_n = std::mem::take(&mut self.position_m).into_iter().flatten().collect();
        self.position_m = force_n.into_iter().map(|force_n| (!force_n.is_nan()).then_some(force_n)).collect();
        std::mem::swap(&mut self.force_column, &mut self.position_column);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn control(force: impl Fn(f64) -> f64, position: impl Fn(f64) -> f64) -> Control {
        let rows = (0..1200).map(|row| 0.05 * f64::from(row)).map(|t| (force(t), Some(position(t))));
        let (force_n, position_m): (Vec<f64>, Vec<Option<f64>>) = rows.unzip();
        let time_s: Vec<f64> = (0..1200).map(f64::from).collect();
        Control::likely(&time_s, &force_n, &position_m)
    }

    /// A ramp, then a hold whose force decays beneath noise that exceeds its change from row to row.
    #[test]
    fn a_noisy_decay_during_a_hold_is_a_relaxation() {
        let noise = |t: f64| 0.06 * (((1.0 + t) * 12.9898).sin() * 43_758.545_3).fract();
        let ramp = |t: f64| (t / 5.0).min(1.0);
        let force = |t: f64| if t < 5.0 { t / 5.0 } else { 0.6 + 0.4 * (-(t - 5.0) / 15.0).exp() };
        assert_eq!(control(|t| force(t) + noise(t), ramp), Control::Position);
        // The force holds beneath the same noise, and the position reaches its plateau.
        assert_eq!(control(|t| 1.0 + noise(t), |t| 1.0 - (-t / 2.0).exp()), Control::Force);
    }

    /// A stretch at a constant rate, forth and back, whose force bends.
    #[test]
    fn a_position_at_a_constant_rate_is_commanded() {
        let triangle = |t: f64| if t < 30.0 { t } else { 60.0 - t };
        let force = |t: f64| 5.0 * (1.0 - (-triangle(t) / 8.0).exp());
        assert_eq!(control(force, triangle), Control::Position);
        assert_eq!(control(triangle, force), Control::Force);
        // A ramp with jitter, then a hold.
        let jittered = |t: f64| (1.0 + 0.002 * (9.0 * t).sin()) * t.min(36.0);
        let answer = |t: f64| if t < 36.0 { 8.0 * t - 0.1 * t * t } else { 158.4 * (0.8 + 0.2 * (36.0 - t).exp()) };
        assert_eq!(control(answer, jittered), Control::Position);
        // A fluid under a constant force moves at one rate.
        assert_eq!(control(|_| 1.0, |t| t), Control::Force);
        let rows = |of: &dyn Fn(f64) -> f64| (0..1200).map(|row| of(0.05 * f64::from(row))).collect::<Vec<f64>>();
        let some = |values: Vec<f64>| values.into_iter().map(Some).collect::<Vec<_>>();
        assert!(correlation_of_changes(&rows(&force), &some(rows(&|t: f64| -triangle(t)))) < -0.5);
    }

    /// Rows are dense in ramps, and sparse in the hold between them, so that most rows are of ramps.
    #[test]
    fn a_hold_counts_by_its_duration() {
        let of_ramp = |first: f64| (0..300).map(move |row| first + 0.005 * f64::from(row));
        let time_s: Vec<f64> =
            of_ramp(0.0).chain((0..290).map(|row| 1.5 + 0.2 * f64::from(row))).chain(of_ramp(59.5)).collect();
        let strain = |t: f64| (t / 1.5).min(1.0).min((61.0 - t) / 1.5);
        let stress = |t: f64| strain(t) * (0.8 + 0.2 * (-(t - 1.5).max(0.0) / 20.0).exp());
        let likely = |force: &dyn Fn(f64) -> f64, position: &dyn Fn(f64) -> f64| {
            let positions: Vec<Option<f64>> = time_s.iter().map(|t| Some(position(*t))).collect();
            Control::likely(&time_s, &time_s.iter().map(|t| force(*t)).collect::<Vec<_>>(), &positions)
        };
        assert_eq!(likely(&stress, &strain), Control::Position);
        let creep = |t: f64| strain(t) * (1.0 - 0.2 * (-(t - 1.5).max(0.0) / 20.0).exp());
        assert_eq!(likely(&strain, &creep), Control::Force);
    }

    /// Rows are dense at first, the strain saturates, and the sensor of the stress settles by 0.2 %.
    #[test]
    fn a_creep_with_dense_first_rows_is_no_relaxation() {
        for per_decade in [5, 10, 30] {
            let time_s: Vec<f64> =
                (0..=4 * per_decade).map(|row| 0.1 * 10.0_f64.powf(f64::from(row) / f64::from(per_decade))).collect();
            let stress: Vec<f64> = time_s.iter().map(|t| 100.0 * (1.0 - 0.002 * (1.0 - (-t / 300.0).exp()))).collect();
            let strain: Vec<Option<f64>> = time_s.iter().map(|t| Some(0.1 * (1.0 - 0.7 * (-t / 3.0).exp()))).collect();
            assert_eq!(Control::likely(&time_s, &stress, &strain), Control::Force, "{per_decade}");
        }
    }

    /// The stress falls at once after the ramp of a measured strain, then it holds: a decay that is no trend.
    #[test]
    fn a_stress_that_falls_while_the_strain_stays_is_measured() {
        let noise = |t: f64| 0.002 * (((1.0 + t) * 12.9898).sin() * 43_758.545_3).fract();
        let ramp = |t: f64| (t / 5.0).min(1.0);
        let stress = |t: f64| ramp(t) * (0.7 + 0.3 * (-(t - 5.0).max(0.0) / 1.5).exp()) + 4e-4 * (t - 20.0).max(0.0);
        assert_eq!(control(|t| stress(t) + noise(t), |t| ramp(t) + noise(9.0 * t)), Control::Position);
        // A load that exceeds its hold at first draws back an elastic body, and leaves a fluid in motion.
        assert_eq!(control(|t| stress(t) + noise(t), |t| stress(t) + noise(9.0 * t)), Control::Force);
        assert_eq!(control(|t| stress(t) + noise(t), |t| t), Control::Force);
    }

    #[test]
    fn values_hold_for_a_part_of_their_time() {
        let time_s: Vec<f64> = (0..1200).map(|row| 0.05 * f64::from(row)).collect();
        let does = |of: &dyn Fn(f64) -> f64| holds(&time_s, &time_s.iter().map(|t| of(*t)).collect::<Vec<_>>());
        let triangle = |t: f64| if t < 30.0 { t } else { 60.0 - t };
        assert!(!does(&triangle) && !does(&|t| t) && !does(&|t| t.sin()));
        // Contacts of a plate, with nothing between them.
        assert!(!does(&|t| (triangle(t) - 20.0).max(0.0)));
        assert!(does(&|t| triangle(t).min(20.0)) && does(&|t| f64::from(u8::from(t % 2.0 < 0.3))));
    }

    /// A body that flows at one rate after the ramp of its force, and one whose force has noise.
    #[test]
    fn a_flow_after_a_ramp_is_no_command() {
        let noise = |t: f64| 0.02 * (((1.0 + t) * 12.9898).sin() * 43_758.545_3).fract();
        for ramp_s in [2.0, 3.0, 6.0] {
            let flow = |t: f64| if t < ramp_s { 0.5 * t * t / ramp_s } else { t - 0.5 * ramp_s };
            for size in [0.0, 1.0] {
                assert_eq!(
                    control(|t| (t / ramp_s).min(1.0) + size * noise(t), flow),
                    Control::Force,
                    "{ramp_s} {size}"
                );
            }
        }
        // A noisy stress that grows with the ramp of a strain.
        assert_eq!(control(|t| 0.2 + t / 60.0 + (t / 60.0).powi(3) + 5.0 * noise(t), |t| t), Control::Position);
    }

    /// The rows of a ramp are dense at its start.
    #[test]
    fn a_rate_is_one_in_time() {
        let time_s: Vec<f64> = (0..300).map(|row| 1e-3 * 1.04_f64.powi(row)).collect();
        let of = |value: &dyn Fn(f64) -> f64| time_s.iter().map(|t| value(*t)).collect::<Vec<f64>>();
        let ramp = |t: f64| 0.002 * t;
        let bends = |t: f64| 1.0 + (t / 60.0).powi(2);
        let some = |values: Vec<f64>| values.into_iter().map(Some).collect::<Vec<_>>();
        assert_eq!(Control::likely(&time_s, &of(&bends), &some(of(&ramp))), Control::Position);
        assert_eq!(Control::likely(&time_s, &of(&ramp), &some(of(&bends))), Control::Force);
    }

    #[test]
    fn a_force_against_the_motion_is_one_in_nearly_all_rows() {
        let noise = |row: usize| 0.3 * (((1.0 + row as f64) * 12.9898).sin() * 43_758.545_3).fract();
        let held: Vec<Option<f64>> = (0..200).map(|row| Some(64.0 - 3.0 + noise(row))).collect();
        let decay: Vec<f64> = (0..200).map(|row| if row < 3 { -500.0 } else { 1000.0 - 2.0 * row as f64 }).collect();
        let other: Vec<f64> = decay.iter().map(|force| -force).collect();
        assert!(opposes(&decay, &held, 64.0) && !opposes(&other, &held, 64.0));
        assert!(!opposes(&[1.0, -1.0, 1.0, -1.0], &[Some(1.0); 4], 0.0) && !opposes(&[], &[], 0.0));
    }

    /// A position that is 1 and 0 for 40 rows in turn, after changes of `n_ramp` rows, and a force that answers `delay` rows later.
    #[test]
    fn an_answer_after_a_jump_shows_when_the_position_acts() {
        let answers = |delay: usize, n_ramp: usize| {
            let part = |row: usize| (row % 40 + 1).min(n_ramp) as f64 / n_ramp as f64;
            let position = |row: usize| if row % 80 < 40 { part(row) } else { 1.0 - part(row) };
            let force = |row: usize| {
                let since = (row + 40 - delay) % 40;
                let sign = if (row + 80 - delay) % 80 < 40 { 1.0 } else { -1.0 };
                sign * part(since) * (0.2 + (-(since as f64) / 9.0).exp())
            };
            let positions: Vec<Option<f64>> = (0..200).map(|row| Some(position(row))).collect();
            answers_after_jumps(&(0..200).map(force).collect::<Vec<_>>(), &positions)
        };
        assert!(answers(1, 1));
        assert!(!answers(0, 1) && !answers(2, 1) && !answers(0, 3) && !answers(1, 3));
    }

    /// A step whose answer reaches its plateau in the first rows, so that neither quantity changes for most of the time.
    #[test]
    fn a_quantity_that_is_constant_to_the_last_digit_is_commanded() {
        let noise = |t: f64| (((1.0 + t) * 12.9898).sin() * 43_758.545_3).fract();
        let decay = |t: f64| 49.0 + 151.0 * (-t / 0.2).exp() + noise(t);
        let growth = |t: f64| 5.0 - 4.0 * (-t / 0.2).exp() + 0.02 * noise(t);
        for jump in [0.0, 2.0] {
            let command = |t: f64| if t < 30.0 { 5.0 } else { 5.0 + jump };
            assert_eq!(control(decay, command), Control::Position);
            assert_eq!(control(command, growth), Control::Force);
            // A command that is measured is not constant: noise decides nothing, and the creep remains the default.
            let measured = |t: f64| command(t) + 0.5 * noise(7.0 * t);
            assert_eq!(control(measured, growth), Control::Force);
            assert_eq!(control(decay, measured), Control::Force);
            assert_eq!(control(|t| 49.0 + noise(t), command), Control::Force);
        }
        // Both are written with few digits, and both are constant in most rows.
        assert_eq!(control(|_| 1.0, |t| f64::from(u8::from(t > 1.0))), Control::Force);
        // A body that comes to rest moves by less than a jump before.
        let rest: Vec<f64> = (0..1200).map(|row| (100.0 * growth((0.05 * f64::from(row)).min(3.0))).round()).collect();
        assert!(!has_only_jumps(&rest) && has_only_jumps(&[&[0.0; 9][..], &[1.0; 9], &[3.0; 9]].concat()));
    }

    #[test]
    fn the_quantity_that_holds_is_commanded() {
        let noise = |t: f64| 0.02 * (((1.0 + t) * 12.9898).sin() * 43_758.545_3).fract();
        let square = |t: f64| f64::from(u8::from(t % 20.0 < 10.0));
        let decay = |t: f64| (square(t) - 0.5) * (-(t % 10.0) / 8.0).exp();
        let creep = |t: f64| square(t) - decay(t);
        assert_eq!(control(|t| decay(t) + noise(t), square), Control::Position);
        assert_eq!(control(square, |t| creep(t) + noise(t)), Control::Force);
        // The force answers the jump in the row after it.
        let late = |t: f64| if t < 4.99 { 0.0 } else { 0.5 + 0.5 * ((5.0 - t) / 20.0).exp() };
        assert_eq!(control(|t| late(t - 0.05) + noise(t), |t| f64::from(u8::from(t > 4.99))), Control::Position);
        // A noisy force whose body has come to rest is no relaxation.
        assert_eq!(control(|t| 1.0 + noise(t), |t| 1.0 - (-t).exp()), Control::Force);
        assert_eq!(control(|t| t.sin(), |t| (t - 0.3).sin()), Control::Force);
    }
}
