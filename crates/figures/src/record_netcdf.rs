//! The groups of an ArviZ file that belong to the rows of a record: `constant_data`, `observed_data`, `log_likelihood`, `posterior_predictive`, `prior`,
//! `prior_predictive`. The coordinate `row` counts the record's rows from 0 in every group, so that what has fewer rows is found in what has more.

use netcdf_writer::NcFileBuilder;

use super::netcdf_file::{NcResult, add_coordinate, add_draws, add_unit, attribute, describe};

/// One number a row.
#[derive(Debug, Clone, PartialEq)]
pub struct RowColumn<'a> {
    /// Name, such as `position_um`.
    pub name: &'a str,
    /// Unit; empty for none.
    pub unit: &'a str,
    /// One a row.
    pub values: Vec<f64>,
}

/// Draws of one number a row.
#[derive(Debug, Clone, PartialEq)]
pub struct DrawnRows<'a> {
    /// The group, such as `log_likelihood`.
    pub group: &'a str,
    /// The variable, that of the observed data.
    pub name: &'a str,
    /// Unit; empty for none.
    pub unit: &'a str,
    /// What is to be known of it.
    pub note: String,
    /// Chains.
    pub n_chains: usize,
    /// Labels of the draws of a chain: their places in `posterior`.
    pub draws: Vec<i64>,
    /// Rows of the record.
    pub rows: Vec<i64>,
    /// Shape `[chain][draw][row]`, the last index fastest.
    pub values: Vec<f64>,
}

/// Draws from the prior, one chain.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorDraws {
    /// Parameters' names.
    pub names: Vec<String>,
    /// Their units.
    pub units: Vec<String>,
    /// One list a parameter, all equally long.
    pub columns: Vec<Vec<f64>>,
    /// What is to be known of them.
    pub note: String,
}

/// What belongs to the rows of a record; empty parts are left out.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RecordGroups<'a> {
    /// What is not random, of every row.
    pub constant: Vec<RowColumn<'a>>,
    /// Rows that have a position.
    pub observed_rows: Vec<i64>,
    /// What was measured in them.
    pub observed: Vec<RowColumn<'a>>,
    /// Draws from the prior.
    pub prior: Option<PriorDraws>,
    /// Log-likelihoods and predictions.
    pub drawn: Vec<DrawnRows<'a>>,
}

impl RecordGroups<'_> {
    /// What does not fit together, in words.
    pub(super) fn check(&self) -> Result<(), String> {
        let n_rows = self.constant.first().map_or(0, |own| own.values.len());
        let uneven = |list: &[RowColumn], n: usize| list.iter().any(|own| own.values.len() != n);
        if uneven(&self.constant, n_rows) || uneven(&self.observed, self.observed_rows.len()) {
            return Err("columns of rows are not equally long".into());
        }
        if let Some(prior) = &self.prior {
            let n = prior.columns.first().map_or(0, Vec::len);
            let is_even = prior.columns.iter().all(|own| own.len() == n)
                && prior.names.len() == prior.columns.len()
                && prior.units.len() == prior.columns.len();
            if !is_even {
                return Err("columns of prior draws are not equally long".into());
            }
        }
        match self.drawn.iter().find(|own| own.values.len() != own.n_chains * own.draws.len() * own.rows.len()) {
            Some(odd) => Err(format!("`{}` has {} values", odd.group, odd.values.len())),
            None => Ok(()),
        }
    }

    pub(super) fn add_to(&self, file: &mut NcFileBuilder) -> NcResult<()> {
        let n_rows = self.constant.first().map_or(0, |own| own.values.len());
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
        self.drawn.iter().try_for_each(|own| own.add_to(file))
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
