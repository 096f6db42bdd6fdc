//! Groups of an ArviZ file for the rows of a record: `constant_data`, `observed_data`, `log_likelihood`, `posterior_predictive`, `prior`,
//! `prior_predictive`. The coordinate `row` counts the record's rows from 0 in every group, so that groups with fewer rows can be aligned.

use netcdf_writer::NcFileBuilder;

use super::netcdf_file::{NcResult, add_coordinate, add_draws, add_unit, attribute, describe};

/// Column with one number per row.
#[derive(Debug, Clone, PartialEq)]
pub struct RowColumn<'a> {
    /// Name, such as `position_um`.
    pub name: &'a str,
    /// Unit; empty for none.
    pub unit: &'a str,
    /// Values, one per row.
    pub values: Vec<f64>,
}

/// Draws of one number per row.
#[derive(Debug, Clone, PartialEq)]
pub struct DrawnRows<'a> {
    /// Group, such as `log_likelihood`.
    pub group: &'a str,
    /// Variable, equal to that of the observed data.
    pub name: &'a str,
    /// Unit; empty for none.
    pub unit: &'a str,
    /// Note for readers.
    pub note: String,
    /// Number of chains.
    pub n_chains: usize,
    /// Labels of the draws of a chain: their positions in `posterior`.
    pub draws: Vec<i64>,
    /// Rows of the record.
    pub rows: Vec<i64>,
    /// Shape `[chain][draw][row]`, the last index fastest.
    pub values: Vec<f64>,
}

/// Draws from the prior, in one chain.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorDraws {
    /// Names of the parameters.
    pub names: Vec<String>,
    /// Units of the parameters.
    pub units: Vec<String>,
    /// Draws, one list per parameter, all of equal length.
    pub columns: Vec<Vec<f64>>,
    /// Note for readers.
    pub note: String,
}

/// Data for the rows of a record; empty parts are omitted.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RecordGroups<'a> {
    /// Known quantities of every row.
    pub constant: Vec<RowColumn<'a>>,
    /// Rows with a position.
    pub observed_rows: Vec<i64>,
    /// Measurements in these rows.
    pub observed: Vec<RowColumn<'a>>,
    /// Draws from the prior.
    pub prior: Option<PriorDraws>,
    /// Log-likelihoods and predictions.
    pub drawn: Vec<DrawnRows<'a>>,
}

impl RecordGroups<'_> {
    /// Checks the sizes. The error says which lengths do not match.
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

impl DrawnRows<'_> {
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
