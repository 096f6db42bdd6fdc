//! The quantity that an experiment commands: the force, as in a creep test, or the position, as in a relaxation.

use super::record::Record;
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

/// A quantity holds if it changes by less than this part of its range over a tenth of the rows, in most places.
const HELD: f64 = 0.01;
/// Factor by which the held quantity changes less than the other one.
const CLEARLY_LESS: f64 = 0.3;

impl Record {
    /// The quantity that an experiment most likely commanded: the position if it holds while the force changes, otherwise the force.
    pub fn likely_control(&self) -> Control {
        let rows: Vec<usize> = (0..self.n_rows()).filter(|row| self.position_m[*row].is_some()).collect();
        let [force, position] = [
            change(rows.iter().map(|row| self.force_n[*row]).collect()),
            change(rows.iter().filter_map(|row| self.position_m[*row]).collect()),
        ];
        if position < HELD && position < CLEARLY_LESS * force { Control::Position } else { Control::Force }
    }
}

/// Median change of a quantity over a tenth of the rows, as a part of its range. The range includes 0, at which every record starts.
fn change(values: Vec<f64>) -> f64 {
    let apart = values.len().div_ceil(10).max(1);
    let range = values.iter().fold(0.0_f64, |most, x| most.max(*x)) - values.iter().fold(0.0_f64, |least, x| least.min(*x));
    let changes = values.windows(apart + 1).map(|window| (window[apart] - window[0]).abs()).collect();
    median(changes).map_or(0.0, |change| if range > 0.0 { change / range } else { 0.0 })
}

impl Trajectory {
    /// Multiplies the forces and the positions by a factor each.
    pub(super) fn scale(&mut self, [of_force, of_position]: [f64; 2]) {
        self.force_n.iter_mut().for_each(|force| *force *= of_force);
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
        self.position_m = force_n.into_iter().map(Some).collect();
        std::mem::swap(&mut self.force_column, &mut self.position_column);
        Ok(())
    }
}
