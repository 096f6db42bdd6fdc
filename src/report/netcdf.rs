//! Posterior draws as NetCDF-4 in ArviZ's layout.
//!
//! Group `posterior`: one variable a parameter over (`chain`, `draw`), chain = ensemble × walker; the coordinate
//! `ensemble` along `chain` says which chains belong together, since walkers of one ensemble are not independent.
//! Group `sample_stats`: `lp`, the log density. Group `observed_data`: the measurement, where given.
//! No time stamps: the same draws give the same bytes.

use std::path::Path;

use netcdf_writer::{DimensionId, NcAttrValue, NcFileBuilder, NcWriteFormat, NcWriteOptions, VariableId};

use super::draws::DrawTable;
use crate::error::Place;
use crate::files::write_atomically;
use crate::{Error, Result};

/// The measurement that was fitted.
#[derive(Debug, Clone, Copy)]
pub struct ObservedData<'a> {
    /// Time of each row.
    pub time_s: &'a [f64],
    /// Position of each row; `None` where tracking was lost.
    pub position_um: &'a [Option<f64>],
}

/// Writes the draws, and the measurement where given.
///
/// # Errors
/// [`Error::Input`] for an inconsistent table or names that NetCDF does not allow, [`Error::File`] where the file cannot be
/// written.
pub fn write_draws_netcdf(path: &Path, table: &DrawTable, observed: Option<ObservedData>) -> Result<()> {
    table.check()?;
    // A slash would open a group; the others are the layout's own.
    let reserved =
        |name: &&String| name.contains('/') || ["chain", "draw", "ensemble", "walker"].contains(&name.as_str());
    if let Some(name) = table.parameter_names.iter().find(reserved) {
        return Err(refused(format!("a parameter is called `{name}`")));
    }
    if let Some(observed) = observed
        && observed.time_s.len() != observed.position_um.len()
    {
        let found = format!("{} times and {} positions", observed.time_s.len(), observed.position_um.len());
        return Err(refused(found));
    }
    let bytes = encode(table, observed).map_err(|error| refused(error.to_string()))?;
    write_atomically(path, &bytes)
}

fn refused(found: String) -> Error {
    Error::input(Place::default().at_key("NetCDF"), found, "use the CSV, or rename the parameter")
}

pub(super) type NcResult<T> = std::result::Result<T, netcdf_writer::Error>;

fn encode(table: &DrawTable, observed: Option<ObservedData>) -> NcResult<Vec<u8>> {
    let mut file = new_file()?;
    let posterior = Group::new(&mut file, "posterior", table)?;
    for (i, name) in table.parameter_names.iter().enumerate() {
        posterior.add_variable(&mut file, name, &table.units[i], &table.column(i))?;
    }
    if !table.log_density.is_empty() {
        let stats = Group::new(&mut file, "sample_stats", table)?;
        stats.add_variable(&mut file, "lp", "1", &table.log_density)?;
    }
    if let Some(observed) = observed {
        add_observed(&mut file, observed)?;
    }
    into_bytes(file)
}

/// An empty file that says who made it.
pub(super) fn new_file() -> NcResult<NcFileBuilder> {
    let mut file = NcFileBuilder::new();
    creators().into_iter().try_for_each(|(name, value)| file.add_attribute(name, value))?;
    Ok(file)
}

/// The file's bytes, as NetCDF-4.
pub(super) fn into_bytes(file: NcFileBuilder) -> NcResult<Vec<u8>> {
    let (_, bytes) = file.to_vec(NcWriteOptions { format: NcWriteFormat::Nc4 })?;
    Ok(bytes)
}

fn creators() -> [(&'static str, NcAttrValue); 4] {
    let text = |text: &str| NcAttrValue::Chars(text.to_owned());
    let (name, version) = (env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"));
    [
        ("created_by", text(&format!("{name} {version}"))),
        ("creation_library", text(name)),
        ("inference_library", text(name)),
        ("inference_library_version", text(version)),
    ]
}

fn attribute(file: &mut NcFileBuilder, variable: VariableId, name: &str, text: &str) -> NcResult<()> {
    file.add_variable_attribute(variable, name, NcAttrValue::Chars(text.to_owned()))
}

/// The unit of a variable; `1` where it has none.
pub(super) fn add_unit(file: &mut NcFileBuilder, variable: VariableId, unit: &str) -> NcResult<()> {
    attribute(file, variable, "units", if unit.is_empty() || unit == "–" { "1" } else { unit })
}

/// Begins a group over `chain` and `draw`, both counted from 0; returns these two dimensions.
pub(super) fn add_group(
    file: &mut NcFileBuilder,
    name: &str,
    n_chains: usize,
    n_draws: usize,
) -> NcResult<[DimensionId; 2]> {
    creators().into_iter().try_for_each(|(attribute, value)| file.add_group_attribute(name, attribute, value))?;
    let chain = file.add_dimension_path(format!("{name}/chain"), n_chains as u64)?;
    let draw = file.add_dimension_path(format!("{name}/draw"), n_draws as u64)?;
    for (coordinate, dimension, length) in [("chain", chain, n_chains), ("draw", draw, n_draws)] {
        add_coordinate(file, name, coordinate, dimension, &(0..length as i64).collect::<Vec<i64>>())?;
    }
    Ok([chain, draw])
}

fn add_coordinate(
    file: &mut NcFileBuilder,
    group: &str,
    name: &str,
    dimension: DimensionId,
    values: &[i64],
) -> NcResult<()> {
    let variable = file.add_variable_path::<i64>(format!("{group}/{name}"), &[dimension])?;
    file.write_variable(variable, values)
}

struct Group {
    name: String,
    dimensions: [DimensionId; 2],
}

impl Group {
    /// Begins a group over a table's chains and draws, which says how the chains are made up of ensembles and walkers.
    fn new(file: &mut NcFileBuilder, name: &str, table: &DrawTable) -> NcResult<Self> {
        let (n_chains, n_walkers) = ((table.n_ensembles * table.n_walkers) as i64, table.n_walkers as i64);
        let dimensions = add_group(file, name, n_chains as usize, table.n_steps)?;
        let ensembles: Vec<i64> = (0..n_chains).map(|chain| chain / n_walkers).collect();
        let walkers: Vec<i64> = (0..n_chains).map(|chain| chain % n_walkers).collect();
        add_coordinate(file, name, "ensemble", dimensions[0], &ensembles)?;
        add_coordinate(file, name, "walker", dimensions[0], &walkers)?;
        Ok(Self { name: name.to_owned(), dimensions })
    }

    fn add_variable(&self, file: &mut NcFileBuilder, name: &str, unit: &str, values: &[f64]) -> NcResult<()> {
        let variable = file.add_variable_path::<f64>(format!("{}/{name}", self.name), &self.dimensions)?;
        add_unit(file, variable, unit)?;
        // Without it readers take `ensemble` and `walker` for data instead of labels of the chains.
        attribute(file, variable, "coordinates", "ensemble walker")?;
        file.write_variable(variable, values)
    }
}

fn add_observed(file: &mut NcFileBuilder, observed: ObservedData) -> NcResult<()> {
    let time = file.add_dimension_path("observed_data/time", observed.time_s.len() as u64)?;
    let positions: Vec<f64> = observed.position_um.iter().map(|position| position.unwrap_or(f64::NAN)).collect();
    for (name, unit, values) in [("time", "s", observed.time_s), ("position_um", "µm", &positions)] {
        let variable = file.add_variable_path::<f64>(format!("observed_data/{name}"), &[time])?;
        attribute(file, variable, "units", unit)?;
        file.write_variable(variable, values)?;
    }
    creators().into_iter().try_for_each(|(name, value)| file.add_group_attribute("observed_data", name, value))
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
    fn the_file_is_hdf5_and_the_same_each_time() {
        let dir = tempfile::tempdir().unwrap();
        let observed = ObservedData { time_s: &[0.0, 0.1], position_um: &[Some(0.0), None] };
        let write = |name: &str| {
            let path = dir.path().join(name);
            write_draws_netcdf(&path, &table("young_modulus_pa"), Some(observed)).unwrap();
            std::fs::read(path).unwrap()
        };
        let (first, second) = (write("a.nc"), write("b.nc"));
        assert_eq!(first, second);
        assert_eq!(&first[..8], b"\x89HDF\r\n\x1a\n");
        // Contiguous little-endian storage: the draws of the second parameter stand in the file as they are.
        let column: Vec<u8> = table("x").column(1).iter().flat_map(|value| value.to_le_bytes()).collect();
        assert!(first.windows(column.len()).any(|window| window == column));
    }

    #[test]
    fn impossible_names_and_shapes_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.nc");
        assert!(write_draws_netcdf(&path, &table("a/b"), None).is_err());
        assert!(write_draws_netcdf(&path, &table(""), None).is_err());
        let mut short = table("x");
        short.values.pop();
        assert!(write_draws_netcdf(&path, &short, None).is_err());
        assert!(!path.exists());
    }
}
