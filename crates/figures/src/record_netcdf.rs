//! Groups of an ArviZ file for the rows of a record: `constant_data`, `observed_data`, `log_likelihood`, `posterior_predictive`, `prior` and
//! `prior_predictive`. In every group the coordinate `row` counts the record's rows from 0. Groups with fewer rows can therefore be aligned.

use netcdf_writer::NcFileBuilder;

use super::netcdf_file::{NcResult, add_coordinate, add_draws, add_unit, attribute, describe};

/// A quantity with one value for each row of a record.
#[derive(Debug, Clone, PartialEq)]
pub struct RowColumn<'a> {
    /// Name of the variable, such as `position_um`.
    pub name: &'a str,
    /// Unit of the values; empty for none.
    pub unit: &'a str,
    /// Values, one per row.
    pub values: Vec<f64>,
}

/// A quantity with one value per draw and row.
#[derive(Debug, Clone, PartialEq)]
pub struct DrawsByRow<'a> {
    /// Name of the group, such as `log_likelihood`.
    pub group: &'a str,
    /// Name of the variable, equal to the name of the observed quantity.
    pub name: &'a str,
    /// Unit of the values; empty for none.
    pub unit: &'a str,
    /// Note that describes the group for readers.
    pub note: String,
    /// Number of chains.
    pub n_chains: usize,
    /// Labels of the draws of each chain: their positions along `draw` in the group `posterior`.
    pub draws: Vec<i64>,
    /// Indices of the rows in the record, from 0.
    pub rows: Vec<i64>,
    /// Values, of shape `[chain][draw][row]`, the last index fastest.
    pub values: Vec<f64>,
}

/// Draws of the parameters from the prior, in one chain.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorDraws {
    /// Name of each parameter.
    pub names: Vec<String>,
    /// Unit of each parameter.
    pub units: Vec<String>,
    /// Draws of each parameter. All lists have equal lengths.
    pub columns: Vec<Vec<f64>>,
    /// Note that describes the group for readers.
    pub note: String,
}

/// Data of a record's rows for the ArviZ file. Groups without data are omitted.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RecordGroups<'a> {
    /// Known quantities at every row of the record, such as the force.
    pub constant: Vec<RowColumn<'a>>,
    /// Indices of the rows with a measured position, from 0.
    pub observed_rows: Vec<i64>,
    /// Measurements at the rows `observed_rows`, such as the position.
    pub observed: Vec<RowColumn<'a>>,
    /// Draws of the parameters from the prior; `None` for none.
    pub prior: Option<PriorDraws>,
    /// Log likelihoods, posterior predictions and prior predictions.
    pub drawn: Vec<DrawsByRow<'a>>,
}

impl RecordGroups<'_> {
    /// Checks that all lengths agree. The error message names lengths that differ.
    pub(super) fn check(&self) -> Result<(), String> {
        let n_rows = self.constant.first().map_or(0, |row_column| row_column.values.len());
        let uneven = |list: &[RowColumn], n: usize| list.iter().any(|row_column| row_column.values.len() != n);
        if uneven(&self.constant, n_rows) || uneven(&self.observed, self.observed_rows.len()) {
            return Err("columns of rows have different lengths".into());
        }
        if let Some(prior) = &self.prior {
            let n = prior.columns.first().map_or(0, Vec::len);
            let is_even = prior.columns.iter().all(|column| column.len() == n)
                && prior.names.len() == prior.columns.len()
                && prior.units.len() == prior.columns.len();
            if !is_even {
                return Err("columns of prior draws have different lengths".into());
            }
        }
        match self.drawn.iter().find(|drawn_rows| {
            drawn_rows.values.len() != drawn_rows.n_chains * drawn_rows.draws.len() * drawn_rows.rows.len()
        }) {
            Some(odd) => Err(format!("`{}` has {} values", odd.group, odd.values.len())),
            None => Ok(()),
        }
    }

    pub(super) fn add_to(&self, file: &mut NcFileBuilder) -> NcResult<()> {
        let n_rows = self.constant.first().map_or(0, |row_column| row_column.values.len());
        let all: Vec<i64> = (0..n_rows as i64).collect();
        add_columns(file, "constant_data", &all, &self.constant)?;
        add_columns(file, "observed_data", &self.observed_rows, &self.observed)?;
        if let Some(prior) = &self.prior {
            let n = prior.columns.first().map_or(0, Vec::len);
            describe(file, "prior", &prior.note)?;
            let dimensions = add_draws(file, "prior", 1, &(0..n as i64).collect::<Vec<i64>>())?;
            for ((name, unit), values) in prior.names.iter().zip(&prior.units).zip(&prior.columns) {
                let variable = file.add_variable_path::<f64>(format!("prior/{name}"), &dimensions)?;
                add_unit(file, variable, unit)?;
                file.write_variable(variable, values)?;
            }
        }
        self.drawn.iter().try_for_each(|drawn_rows| drawn_rows.add_to(file))
    }
}

fn add_columns(file: &mut NcFileBuilder, group: &str, rows: &[i64], columns: &[RowColumn]) -> NcResult<()> {
    if columns.is_empty() {
        return Ok(());
    }
    describe(file, group, "")?;
    let row = file.add_dimension_path(format!("{group}/row"), rows.len() as u64)?;
    add_coordinate(file, group, "row", row, rows)?;
    for RowColumn { name, unit, values } in columns {
        let variable = file.add_variable_path::<f64>(format!("{group}/{name}"), &[row])?;
        add_unit(file, variable, unit)?;
        file.write_variable(variable, values)?;
    }
    Ok(())
}

impl DrawsByRow<'_> {
    fn add_to(&self, file: &mut NcFileBuilder) -> NcResult<()> {
        let Self { group, name, unit, note, n_chains, draws, rows, values } = self;
        describe(file, group, note)?;
        let [chain, draw] = add_draws(file, group, *n_chains, draws)?;
        let row = file.add_dimension_path(format!("{group}/row"), rows.len() as u64)?;
        add_coordinate(file, group, "row", row, rows)?;
        let variable = file.add_variable_path::<f64>(format!("{group}/{name}"), &[chain, draw, row])?;
        add_unit(file, variable, unit)?;
        attribute(file, variable, "long_name", note)?;
        file.write_variable(variable, values)
    }
}
