//! Search for values that a tracker writes for lost positions, such as −9999 or 0. Such a value repeats, far from the positions in the rows around
//! it.

use std::collections::HashMap;

use super::robust::median;

/// Thresholds for a value to count as a lost position. At least `FEWEST` of its rows, and at least the fraction `MOSTLY`, must be far from the
/// neighbouring rows.
const FEWEST: usize = 3;
const MOSTLY: f64 = 0.5;
/// Factors for the smallest distance of a lost position from its neighbouring rows. It is the largest of four distances: `STEPS` median steps
/// between rows, `DIGITS` steps of the last written digit, `FLOWS` times the distance between the neighbouring rows, and the part `OF_RANGE` of the range of most positions.
const STEPS: f64 = 20.0;
const DIGITS: f64 = 20.0;
const FLOWS: f64 = 5.0;
const OF_RANGE: f64 = 0.01;
/// Part of the positions at either end that the range leaves out.
const BESIDE: f64 = 0.05;
/// Largest number of consecutive rows in which a lost position may repeat. In longer runs the body is at rest, unless the value lies outside all
/// other values by more than their range.
const LONGEST: usize = 10;

/// Returns the values that repeat and are mostly far from the rows before and after, in ascending order and in the unit of the positions. The search is repeated without the
/// values that it has found: one mark of a lost position hides another.
pub fn repeated_outliers(positions: &[Option<f64>]) -> Vec<f64> {
    let mut known: Vec<f64> = positions.iter().flatten().copied().collect();
    let mut found = Vec::new();
    loop {
        let more = outliers_of(&known);
        if more.is_empty() {
            break;
        }
        known.retain(|x| !more.contains(x));
        found.extend(more);
    }
    found.sort_unstable_by(f64::total_cmp);
    found
}

fn outliers_of(known: &[f64]) -> Vec<f64> {
    let mut rows: HashMap<u64, Vec<usize>> = HashMap::new();
    for (row, x) in known.iter().enumerate() {
        rows.entry(x.to_bits()).or_default().push(row);
    }
    let mut sorted = known.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let digit = sorted.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > 0.0).fold(f64::INFINITY, f64::min);
    // Few glitches do not count.
    let quantile = |part: f64| sorted.get((part * (sorted.len().max(1) - 1) as f64) as usize).copied().unwrap_or(0.0);
    let range = quantile(1.0 - BESIDE) - quantile(BESIDE);
    let step = median(known.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect()).unwrap_or(0.0);
    let is_beyond = |x: f64| {
        let (below, above) = (sorted.partition_point(|other| *other < x), sorted.partition_point(|other| *other <= x));
        let (lower, higher) = (&sorted[..below], &sorted[above..]);
        let is_apart = |others: &[f64]| match others {
            [first, .., last] => (x - first).abs().min((x - last).abs()) > last - first,
            _ => false,
        };
        lower.is_empty() && is_apart(higher) || higher.is_empty() && is_apart(lower)
    };
    let is_far = |row: usize| {
        let x = known[row];
        let before = known[..row].iter().rposition(|other| *other != x);
        let after = known[row + 1..].iter().position(|other| *other != x).map(|place| row + 1 + place);
        let Some((before, after)) = before.zip(after) else { return false };
        let is_rest = after - before > LONGEST + 1 && !is_beyond(x);
        let (before, after) = (known[before], known[after]);
        let distance = (x - before).abs().min((x - after).abs());
        // A value between the two neighbours is part of the motion.
        let is_between = (before - x) * (after - x) < 0.0;
        let least = (STEPS * step).max(DIGITS * digit).max(FLOWS * (after - before).abs()).max(OF_RANGE * range);
        !is_between && !is_rest && distance > least
    };
    rows.iter()
        .filter(|(_, rows)| rows.len() >= FEWEST)
        .filter(|(_, rows)| {
            let n_far = rows.iter().filter(|row| is_far(**row)).count();
            n_far >= FEWEST && n_far as f64 >= MOSTLY * rows.len() as f64
        })
        .map(|(bits, _)| f64::from_bits(*bits))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(row: usize) -> f64 {
        let t = (row % 200) as f64;
        if row % 400 < 200 { 700.0 * (1.0 - (-t / 20.0).exp()) } else { 700.0 * (-t / 20.0).exp() }
    }

    /// Returns deterministic noise between −1 and 1: multiples of an irrational number, modulo 1, are uniformly distributed.
    fn noise(row: usize) -> f64 {
        2.0 * (row as f64 * 0.754_877_666).fract() - 1.0
    }

    #[test]
    fn a_repeated_value_far_from_its_neighbours_is_lost_tracking() {
        for sentinel in [-9999.0, 0.0, 65535.0] {
            let positions: Vec<Option<f64>> =
                (0..1200).map(|row| Some(if row % 17 == 5 { sentinel } else { motion(row) + noise(row) })).collect();
            assert_eq!(repeated_outliers(&positions), [sentinel]);
        }
    }

    /// Checks that one mark does not hide another, and that a single glitch hides none.
    #[test]
    fn several_marks_are_found() {
        let marked = |marks: [f64; 2], row: usize| match row % 17 {
            5 => marks[0],
            11 => marks[1],
            _ => motion(row) / 20.0 + 0.05 * noise(row),
        };
        for marks in [[0.0, 65535.0], [-1.0, 65535.0], [-99999.0, -50.0]] {
            let positions: Vec<Option<f64>> = (0..1200).map(|row| Some(marked(marks, row))).collect();
            assert_eq!(repeated_outliers(&positions), marks);
        }
        let glitch = |row: usize| if row == 700 { 1e6 } else { marked([-50.0, -50.0], row) };
        assert_eq!(repeated_outliers(&(0..1200).map(|row| Some(glitch(row))).collect::<Vec<_>>()), [-50.0]);
    }

    /// Checks that a value far outside all others counts as a lost position in runs of any length, here 30 rows.
    #[test]
    fn long_bursts_of_a_value_beyond_all_others_are_found() {
        let positions: Vec<Option<f64>> =
            (0..1200).map(|row| Some(if row % 300 > 269 { -9999.0 } else { motion(row) + noise(row) })).collect();
        assert_eq!(repeated_outliers(&positions), [-9999.0]);
    }

    /// Checks that 0 counts as a position if a body rests at exactly 0 in half of the rows, and tracking is lost in a few other rows.
    #[test]
    fn a_value_that_is_mostly_a_position_is_kept() {
        let phase = |row: usize| (row % 100) as f64 / 100.0;
        let rises = |row: usize| 300.0 + 400.0 * (1.0 - (-5.0 * phase(row)).exp());
        // The motion ends at its first position, so a rest resembles a run of lost rows.
        let returns = |row: usize| 300.0 + 400.0 * (std::f64::consts::PI * phase(row)).sin();
        for pulled in [&rises as &dyn Fn(usize) -> f64, &returns] {
            let at = |row: usize| if row % 200 < 100 { 0.0 } else { pulled(row) + noise(row) };
            let positions: Vec<Option<f64>> =
                (0..1200).map(|row| Some(if row % 200 == 150 { 0.0 } else { at(row) })).collect();
            assert!(repeated_outliers(&positions).is_empty());
        }
    }

    /// Checks that a machine's position counts as a position if it moves a little and back during a hold.
    #[test]
    fn a_small_excursion_during_a_hold_is_kept() {
        let held = |row: usize| if row / 9 % 40 == 30 { 0.311_65 } else { 0.311_45 };
        let machine = |row: usize| if row < 200 { 0.001_557_25 * row as f64 } else { held(row) };
        let positions: Vec<Option<f64>> = (0..1200).map(|row| Some(machine(row))).collect();
        assert!(repeated_outliers(&positions).is_empty());
    }

    #[test]
    fn rounded_clipped_and_resting_positions_are_none() {
        let rounded = |digit: f64| (0..1200).map(move |row| Some(digit * ((motion(row) + noise(row)) / digit).round()));
        assert!(repeated_outliers(&rounded(13.0).collect::<Vec<_>>()).is_empty());
        assert!(repeated_outliers(&rounded(0.1).collect::<Vec<_>>()).is_empty());
        let clipped: Vec<Option<f64>> = rounded(0.1).map(|x| x.map(|x: f64| x.min(600.0))).collect();
        assert!(repeated_outliers(&clipped).is_empty());
        let steps: Vec<Option<f64>> = (0..400).map(|row| Some(if row % 100 < 50 { 0.0 } else { 500.0 })).collect();
        assert!(repeated_outliers(&steps).is_empty());
    }
}
