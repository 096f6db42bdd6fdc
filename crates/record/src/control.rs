//! The quantity that an experiment commands: the force, as in a creep test, or the position, as in a relaxation.

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

impl Trajectory {
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
