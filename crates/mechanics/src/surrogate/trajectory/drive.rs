//! The force that acts behind a load, written out at times: what a program is told that knows nothing of loads.

use crate::experiment::{Force, ForceRule, KeptForce};
use crate::stages::Load;

/// Steps in which a force that lags follows a change of the command, all of them of the same share of the change.
const LAG_STEPS: usize = 24;
/// Times nearer to a row than this share of the record are the row's.
const SNAP: f64 = 1e-9;

/// A force at the rows of a record and between them.
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    /// Times in s: the rows', and those at which a force changes that is not the commanded one.
    pub time_s: Vec<f64>,
    /// Force at these times.
    pub force: KeptForce,
    /// Where the record's rows stand among the times.
    pub rows: Vec<usize>,
}

impl Drive {
    /// The force as it is commanded.
    pub fn commanded(time_s: &[f64], force: Force<'_>) -> Self {
        Self { time_s: time_s.to_vec(), force: force.into(), rows: (0..time_s.len()).collect() }
    }

    /// The force behind delay, factors, offset and lag (by value, in this order); a gradient is not followed.
    ///
    /// A force that lags is written out in steps of its mean between their ends. Where the command goes in lines through zero, the factor is that of the row's own sign.
    pub fn behind(load: &Load, time_s: &[f64], force: Force<'_>) -> Self {
        let (Some(&first_s), Some(&last_s)) = (time_s.first(), time_s.last()) else {
            return Self::commanded(time_s, force);
        };
        let (delay_s, lag_s) = (load.delay_s.value, load.lag_time_s.value);
        let near = |at_s: f64| {
            let place = time_s.partition_point(|row_s| *row_s < at_s);
            let around = [place.checked_sub(1), Some(place)].into_iter().flatten().filter_map(|k| time_s.get(k));
            let snapped = around.copied().find(|row_s| (row_s - at_s).abs() <= SNAP * (last_s - first_s));
            snapped.unwrap_or(at_s)
        };
        let scaled = |force_n: &f64| {
            force_n * if *force_n > 0.0 { load.positive_factor.value } else { load.negative_factor.value }
        };
        let at_rows_n: Vec<f64> = force.at_rows_n.iter().map(scaled).collect();
        let shifted_s: Vec<f64> =
            if delay_s == 0.0 { time_s.to_vec() } else { time_s.iter().map(|row_s| near(row_s + delay_s)).collect() };
        let before = |row: usize| row.checked_sub(1).map_or(0.0, |before| at_rows_n[before]);
        let is_change = |row: &usize| match force.rule {
            ForceRule::Hold => *row == 0 || at_rows_n[*row] != before(*row),
            ForceRule::Linear => {
                *row == 0
                    || at_rows_n
                        .get(row + 1)
                        .is_none_or(|next| next - at_rows_n[*row] != at_rows_n[*row] - before(*row))
            }
        };
        let changes_s: Vec<f64> = (0..at_rows_n.len()).filter(is_change).map(|row| shifted_s[row]).collect();
        let mut all_s: Vec<f64> = time_s.iter().chain(&changes_s).copied().filter(|at_s| *at_s <= last_s).collect();
        if lag_s > 0.0 {
            for (k, change_s) in changes_s.iter().chain(std::iter::once(&first_s)).enumerate() {
                let until_s = changes_s.get(k + 1).copied().unwrap_or(last_s);
                let steps = (1..LAG_STEPS).map(|step| change_s - lag_s * (1.0 - step as f64 / LAG_STEPS as f64).ln());
                all_s.extend(steps.map(near).filter(|at_s| *at_s < until_s.min(last_s)));
            }
        }
        all_s.sort_by(f64::total_cmp);
        all_s.dedup();
        let shifted = Force { at_rows_n: &at_rows_n, rule: force.rule };
        let command_n = |at_s: f64| shifted.at_n(&shifted_s, at_s) + load.offset_n.value;
        let mut force_n: Vec<f64> = all_s.iter().map(|at_s| command_n(*at_s)).collect();
        if lag_s > 0.0 {
            force_n = lagging(&all_s, &force_n, force.rule, lag_s);
        }
        let rows = time_s.iter().map(|row_s| all_s.partition_point(|at_s| at_s < row_s)).collect();
        Self { time_s: all_s, force: KeptForce { at_rows_n: force_n, rule: force.rule }, rows }
    }
}

/// τ Ḟ = F_in − F from 0, exactly: its values at the times where it goes in lines, else its means up to the next.
fn lagging(time_s: &[f64], command_n: &[f64], rule: ForceRule, lag_s: f64) -> Vec<f64> {
    let mut now_n = 0.0;
    let mut lagging = Vec::with_capacity(time_s.len());
    for (k, &from_n) in command_n.iter().enumerate() {
        let step_s = time_s.get(k + 1).map_or(0.0, |next_s| next_s - time_s[k]);
        let (kept, share) = ((-step_s / lag_s).exp(), step_s / lag_s);
        match rule {
            ForceRule::Hold => {
                let mean_share = if share > 0.0 { -(-share).exp_m1() / share } else { 1.0 };
                lagging.push(from_n + (now_n - from_n) * mean_share);
                now_n = from_n + (now_n - from_n) * kept;
            }
            ForceRule::Linear => {
                lagging.push(now_n);
                let slope =
                    if step_s > 0.0 { (command_n.get(k + 1).unwrap_or(&from_n) - from_n) / step_s } else { 0.0 };
                now_n = from_n + slope * (step_s - lag_s) + (now_n - from_n + slope * lag_s) * kept;
            }
        }
    }
    lagging
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::Stages;

    fn load(change: impl FnOnce(&mut Load)) -> Load {
        let mut load = Stages::of_law(Vec::new()).load;
        change(&mut load);
        load
    }

    /// Impulses of a dashpot's force, against closed forms: a delayed, biased and lagging square wave.
    #[test]
    fn the_force_behind_a_load_has_its_impulse() {
        let time_s: Vec<f64> = (0..=40).map(|row| 0.25 * f64::from(row)).collect();
        let force_n: Vec<f64> = (0..=40).map(|row| if row < 20 { 4.0 } else { -4.0 }).collect();
        let force = Force::from(&force_n);
        let impulse = |load: &Load| {
            let drive = Drive::behind(load, &time_s, force);
            assert!(drive.rows.iter().zip(&time_s).all(|(row, at_s)| drive.time_s[*row] == *at_s));
            let steps = drive.time_s.windows(2).zip(&drive.force.at_rows_n);
            steps.map(|(ends, force_n)| force_n * (ends[1] - ends[0])).sum::<f64>()
        };
        let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        near(impulse(&load(|_| ())), 0.0);
        assert_eq!(Drive::behind(&load(|_| ()), &time_s, force), Drive::commanded(&time_s, force));
        // 5 s forward, and 4.9 s backward.
        near(impulse(&load(|own| own.delay_s = 0.1.into())), 0.4);
        near(impulse(&load(|own| own.offset_n = 0.5.into())), 5.0);
        near(impulse(&load(|own| own.negative_factor = 0.5.into())), 10.0);
        // ∫F = ∫F_in − τ F(end): F_in's own is 0, and F ends at −4 up to e^(−5/0.2).
        near(impulse(&load(|own| own.lag_time_s = 0.2.into())), 0.8 - 0.2 * 8.0 * (-5.0_f64 / 0.2).exp());
    }
}
