//! Writes posterior draws as NetCDF-4 in ArviZ's layout.
//!
//! The group `posterior` has one variable per parameter, with the dimensions `chain` and `draw`. A chain is an ensemble, because ensembles are independent and
//! the walkers of one ensemble are not. The first half of a chain's draws comes from the first half of the steps. Each half contains one walker after the
//! other, with each walker's draws in the order of its steps ([`arrangement`]). ArviZ's split R̂ then equals this program's R̂, and its effective sample sizes
//! include the correlation in time. The coordinates `walker` and `step` along `draw` label the draws.
//!
//! The group `sample_stats` contains the log density as `lp`. Further groups describe the rows of a record ([`RecordGroups`]). The file contains no time
//! stamps, so equal draws give equal bytes.

use std::path::Path;

use netcdf_writer::{DimensionId, NcFileBuilder};

use super::draws::DrawTable;
use super::netcdf_file::{NcResult, add_coordinate, add_draws, add_unit, attribute, describe, into_bytes, new_file};
pub use super::record_netcdf::{DrawsByRow, PriorDraws, RecordGroups, RowColumn};
use base::error::InputPlace;
use base::files::write_atomically;
use base::{Error, Result};

const ARRANGEMENT: &str =
    "Each chain is an ensemble. Its draws are ordered by half of the steps, then by walker, then by step.";

/// Writes the draws of a table, and the groups for the rows of a record.
///
/// # Errors
/// [`Error::Input`] for an inconsistent table or names that NetCDF does not allow, [`Error::File`] if the file cannot be written.
pub fn write_draws_netcdf(path: &Path, table: &DrawTable, record: &RecordGroups) -> Result<()> {
    table.check()?;
    // NetCDF would read a slash as the start of a group. The layout uses the other names.
    let reserved = |name: &&String| name.contains('/') || ["chain", "draw", "walker", "step"].contains(&name.as_str());
    if let Some(name) = table.parameter_names.iter().find(reserved) {
        return Err(refused(format!("a parameter has the name `{name}`, which contains a slash or is reserved")));
    }
    record.check().map_err(refused)?;
    let bytes = encode(table, record).map_err(|error| refused(error.to_string()))?;
    write_atomically(path, &bytes)
}

fn refused(found: String) -> Error {
    Error::input(InputPlace::default().at_key("NetCDF"), found, "write the draws as CSV, or rename the parameter")
}

/// Walker and step of every draw of a chain, in the order in which the draws are written.
pub fn arrangement(n_walkers: usize, n_steps: usize) -> Vec<[usize; 2]> {
    let half = n_steps / 2;
    let of_steps = |steps: std::ops::Range<usize>| {
        (0..n_walkers).flat_map(move |walker| steps.clone().map(move |step| [walker, step]))
    };
    // If the number of steps is odd, the middle step belongs to neither half and is written between them.
    of_steps(0..half).chain(of_steps(half..n_steps - half)).chain(of_steps(n_steps - half..n_steps)).collect()
}

fn encode(table: &DrawTable, record: &RecordGroups) -> NcResult<Vec<u8>> {
    let mut file = new_file()?;
    let order = arrangement(table.n_walkers, table.n_steps);
    let posterior = Group::new(&mut file, "posterior", table, &order)?;
    for (i, name) in table.parameter_names.iter().enumerate() {
        posterior.add_variable(&mut file, name, &table.units[i], &table.column(i))?;
    }
    if !table.log_density.is_empty() {
        let stats = Group::new(&mut file, "sample_stats", table, &order)?;
        stats.add_variable(&mut file, "lp", "1", &table.log_density)?;
    }
    record.add_to(&mut file)?;
    into_bytes(file)
}

/// Group of a NetCDF file whose variables have one value for every draw of a table.
struct Group<'a> {
    name: &'a str,
    table: &'a DrawTable,
    order: &'a [[usize; 2]],
    dimensions: [DimensionId; 2],
}

impl<'a> Group<'a> {
    fn new(file: &mut NcFileBuilder, name: &'a str, table: &'a DrawTable, order: &'a [[usize; 2]]) -> NcResult<Self> {
        describe(file, name, ARRANGEMENT)?;
        let labels: Vec<i64> = (0..order.len() as i64).collect();
        let dimensions = add_draws(file, name, table.n_ensembles, &labels)?;
        for (place, coordinate) in ["walker", "step"].into_iter().enumerate() {
            let values: Vec<i64> = order.iter().map(|walker_and_step| walker_and_step[place] as i64).collect();
            add_coordinate(file, name, coordinate, dimensions[1], &values)?;
        }
        Ok(Self { name, table, order, dimensions })
    }

    /// Adds a variable. The values are given in the order of the table and written in the order of the group.
    fn add_variable(&self, file: &mut NcFileBuilder, name: &str, unit: &str, values: &[f64]) -> NcResult<()> {
        let variable = file.add_variable_path::<f64>(format!("{}/{name}", self.name), &self.dimensions)?;
        add_unit(file, variable, unit)?;
        // Without this attribute, readers take `walker` and `step` for data instead of labels of the draws.
        attribute(file, variable, "coordinates", "walker step")?;
        let (n_walkers, n_steps) = (self.table.n_walkers, self.table.n_steps);
        let of_ensemble = |ensemble: usize| {
            self.order.iter().map(move |[walker, step]| values[(ensemble * n_walkers + walker) * n_steps + step])
        };
        file.write_variable(variable, &(0..self.table.n_ensembles).flat_map(of_ensemble).collect::<Vec<f64>>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(name: &str) -> DrawTable {
        DrawTable {
            parameter_names: vec![name.to_owned(), "gain_sd".to_owned()],
            units: vec!["Pa".to_owned(), "–".to_owned()],
            n_ensembles: 2,
            n_walkers: 3,
            n_steps: 5,
            values: (0..60).map(|i| 1.0 / (1.0 + f64::from(i))).collect(),
            log_density: (0..30).map(f64::from).collect(),
        }
    }

    #[test]
    fn halves_of_a_chain_are_halves_of_the_steps() {
        let order = arrangement(3, 5);
        assert_eq!(order.len(), 15);
        assert!(order[..6].iter().all(|[_, step]| *step < 2) && order[9..].iter().all(|[_, step]| *step > 2));
        assert_eq!(order[..3], [[0, 0], [0, 1], [1, 0]]);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        sorted.dedup();
        assert_eq!(sorted.len(), 15);
        assert_eq!(arrangement(2, 1), [[0, 0], [1, 0]]);
    }

    #[test]
    fn the_file_is_hdf5_and_the_same_each_time() {
        let dir = tempfile::tempdir().unwrap();
        let record = RecordGroups {
            constant: vec![RowColumn { name: "force", unit: "µN", values: vec![1.0, 2.0] }],
            observed_rows: vec![0],
            observed: vec![RowColumn { name: "position_um", unit: "µm", values: vec![0.5] }],
            ..RecordGroups::default()
        };
        let write = |name: &str| {
            let path = dir.path().join(name);
            write_draws_netcdf(&path, &table("young_modulus_pa"), &record).unwrap();
            std::fs::read(path).unwrap()
        };
        let (first, second) = (write("a.nc"), write("b.nc"));
        assert_eq!(first, second);
        assert_eq!(&first[..8], b"\x89HDF\r\n\x1a\n");
        // Storage is contiguous and little-endian, so the first draws of the first walker occur in the file as they are in memory.
        let column: Vec<u8> = table("x").column(1)[..2].iter().flat_map(|value| value.to_le_bytes()).collect();
        assert!(first.windows(column.len()).any(|window| window == column));
    }

    #[test]
    fn impossible_names_and_shapes_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.nc");
        let none = RecordGroups::default();
        let refuses = |table: &DrawTable, record: &RecordGroups, words: &str| {
            let error = write_draws_netcdf(&path, table, record).unwrap_err().to_string();
            assert!(error.contains(words), "`{words}` in {error}");
        };
        refuses(&table("a/b"), &none, "a parameter has the name `a/b`");
        refuses(&table(""), &none, "a parameter has the name ``");
        let mut short = table("x");
        short.values.pop();
        refuses(&short, &none, "values has 59 entries instead of 60");
        let uneven = RecordGroups { observed_rows: vec![3], ..RecordGroups::default() };
        let column = RowColumn { name: "position_um", unit: "µm", values: vec![0.5, 0.6] };
        let uneven = RecordGroups { observed: vec![column], ..uneven };
        refuses(&table("x"), &uneven, "columns of rows have different lengths");
        assert!(!path.exists());
    }
}
