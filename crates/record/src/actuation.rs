//! Separate log of the force (formats §1). Its times differ from the camera's, and it may contain a coil current instead of a force.

use std::path::Path;

use super::force::{Force, ForceRule};
use super::table::{KEYS, TableDescription, decode_table, read_choice, read_described};
use super::trajectory::Trajectory;
use base::error::{Error, InputPlace, Result};
use base::toml_input::TomlTable;
use base::units::Dimension;

/// Checked content of the table `[actuation]` in `experiment.toml`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Actuation {
    /// Path of the log file, relative to the TOML file's directory.
    pub file: String,
    description: TableDescription,
    /// Coefficients aᵢ that convert a current I (A) to a force F (N): F = Σ aᵢ Iⁱ. Empty if the log contains the force itself.
    calibration: Vec<f64>,
    /// Rule for the force between the log's rows.
    pub rule: ForceRule,
    pub rule_given: bool,
}

/// Largest difference of two times that count as equal, as a fraction of the record's duration.
const SAME_TIME: f64 = 1e-12;

impl Actuation {
    /// Reads the table `[actuation]`. The function `file` checks and returns the path of the log.
    pub fn read(actuation: TomlTable<'_>, file: impl Fn(TomlTable<'_>) -> Result<String>) -> Result<Self> {
        actuation.only(&[&["file", "force", "calibration"], &KEYS[..]].concat())?;
        let description = TableDescription::read_log(actuation)?;
        let calibration = actuation.numbers("calibration")?.unwrap_or_default();
        let rule = read_choice(actuation, "force", &ForceRule::ALL, ForceRule::name)?.unwrap_or_default();
        if description.acts_until_row && rule == ForceRule::Linear {
            let found = "the key needs a force that holds between rows";
            return Err(actuation.refuse("force_acts", found, "remove it, or write `force = \"hold\"`"));
        }
        let is_current = description.force.as_ref().is_some_and(|(_, unit)| unit.dimension == Dimension::Current);
        if is_current && calibration.is_empty() {
            return Err(actuation.missing("calibration", "calibration = [0.0, 2.3e-6]"));
        }
        if !is_current && !calibration.is_empty() {
            let remedy = "name the column `current` in [actuation.columns], or remove the calibration";
            return Err(actuation.refuse(
                "calibration",
                "the log contains a force, but the calibration converts a current",
                remedy,
            ));
        }
        Ok(Self { file: file(actuation)?, description, calibration, rule, rule_given: actuation.has("force") })
    }

    /// Returns the camera's trajectory with the force of the log, and the indices of added rows. A row is added wherever the force changes between
    /// two camera rows. Time 0 is the camera's first time or the first change of the force, whichever is earlier.
    pub(super) fn merged(&self, file: &Path, bytes: &[u8], trajectory: Trajectory) -> Result<(Trajectory, Vec<usize>)> {
        let log = self.log(file, bytes, &trajectory)?;
        let force = Force { at_rows_n: &log.force_n, rule: self.rule };
        let changes = |row: usize| {
            let before = if row == 0 { 0.0 } else { log.force_n[row - 1] };
            let bends = self.rule == ForceRule::Linear
                && force.slope_n_per_s(&log.time_s, row)
                    != row.checked_sub(1).map_or(0.0, |k| force.slope_n_per_s(&log.time_s, k));
            log.force_n[row] != before || bends
        };
        let length_s = trajectory.time_s.last().zip(log.time_s.last()).map_or(0.0, |(a, b)| a.max(*b));
        let same_s = SAME_TIME * length_s;
        let last_s = trajectory.time_s.last().copied().unwrap_or(0.0);
        let begin_s = trajectory.time_s.first().copied().unwrap_or(0.0);
        let first_push_s = (0..log.time_s.len()).find(|&row| changes(row)).map_or(begin_s, |row| log.time_s[row]);
        let shift_s = (-first_push_s).max(0.0);
        let (mut made, mut force_rows) = (trajectory.without_rows(), Vec::new());
        let mut coming = (0..log.time_s.len())
            .filter(|&row| changes(row) && log.time_s[row] < last_s - same_s)
            .map(|row| log.time_s[row])
            .peekable();
        for row in 0..trajectory.time_s.len() {
            let time_s = trajectory.time_s[row];
            while let Some(change_s) = coming.next_if(|change_s| *change_s < time_s - same_s) {
                force_rows.push(made.time_s.len());
                made.push_from(&trajectory, row, change_s + shift_s, force.at_n(&log.time_s, change_s), false);
            }
            // If a camera row coincides with a change of the force, within rounding, no row is added for the change.
            let at_s = coming.next_if(|change_s| *change_s < time_s + same_s).unwrap_or(time_s);
            made.push_from(&trajectory, row, time_s + shift_s, force.at_n(&log.time_s, at_s), true);
        }
        Ok((made, force_rows))
    }

    /// Reads the log as a trajectory: times in s on the camera's clock, forces in N.
    fn log(&self, file: &Path, bytes: &[u8], trajectory: &Trajectory) -> Result<Trajectory> {
        let text = decode_table(file, bytes, self.description.layout.encoding)?;
        let mut log = read_described(file, &text, &self.description)?;
        let later_s = log.clock_zero_s - trajectory.clock_zero_s;
        log.time_s.iter_mut().for_each(|time_s| *time_s += later_s);
        // If forces act until their rows, that of the first row has acted since the camera's first row, and none acts after the last.
        let started_s = trajectory.time_s.first().copied().unwrap_or(0.0);
        if let Some(before_n) =
            log.force_before_n.filter(|_| log.time_s.first().is_some_and(|first_s| *first_s > started_s))
        {
            log.time_s.insert(0, started_s);
            log.force_n.insert(0, before_n);
            log.lines.insert(0, log.lines[0]);
        }
        if let (Some(_), Some(last_n)) = (log.force_before_n, log.force_n.last_mut()) {
            *last_n = 0.0;
        }
        for (force, line) in log.force_n.iter_mut().zip(&log.lines) {
            if !self.calibration.is_empty() {
                *force = self.calibration.iter().rev().fold(0.0, |sum, a| sum * *force + a);
            }
            if !force.is_finite() {
                let remedy = "correct the current, or the calibration in [actuation]";
                return Err(Error::input(
                    InputPlace::file(file).at_line(*line),
                    format!("the force is {force} N, not a finite number"),
                    remedy,
                ));
            }
        }
        let overlaps = log.time_s.first().zip(trajectory.time_s.last()).is_some_and(|(a, b)| a < b)
            && log.time_s.last().zip(trajectory.time_s.first()).is_some_and(|(a, b)| a > b);
        if !overlaps {
            return Err(Error::input(
                InputPlace::file(file).at_line(log.lines.first().copied().unwrap_or(1)),
                format!(
                    "the log covers {:?} to {:?} s, but the positions cover {:?} to {:?} s",
                    log.time_s.first().copied().unwrap_or(0.0),
                    log.time_s.last().copied().unwrap_or(0.0),
                    trajectory.time_s.first().copied().unwrap_or(0.0),
                    trajectory.time_s.last().copied().unwrap_or(0.0)
                ),
                "use the times of one clock in both tables; check their units in [measurement.units] and [actuation.units]",
            ));
        }
        Ok(log)
    }
}
