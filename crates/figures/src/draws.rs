//! Posterior draws as a table in memory and as CSV with the columns `ensemble,walker,step,<parameter>…,log_density`.

use std::collections::BTreeMap;
use std::path::Path;

use super::density::{quantile_of_sorted, sorted};
use super::labels;
use base::error::InputPlace;
use base::files::{self, Content, refuse_long_lines, stream_atomically};
use base::{Error, Result};

const INDEX_COLUMNS: [&str; 3] = ["ensemble", "walker", "step"];
/// Maximum number of values in a table of draws.
const MOST_NUMBERS: usize = 100_000_000;
const LOG_DENSITY: &str = "log_density";

/// Posterior draws from several independent ensembles of walkers.
#[derive(Debug, Clone, PartialEq)]
pub struct DrawTable {
    /// Name of each parameter, such as `young_modulus_pa`.
    pub parameter_names: Vec<String>,
    /// Unit of each parameter, such as `Pa`; `–` for none.
    pub units: Vec<String>,
    /// Number of independent ensembles.
    pub n_ensembles: usize,
    /// Number of walkers of one ensemble.
    pub n_walkers: usize,
    /// Number of stored steps of each walker.
    pub n_steps: usize,
    /// Values, of shape `[ensemble][walker][step][parameter]`, the last index fastest.
    pub values: Vec<f64>,
    /// Log densities, of shape `[ensemble][walker][step]`; empty if unknown.
    pub log_density: Vec<f64>,
}

/// Mean and central 90 % interval over the walkers of one ensemble, at every step.
#[derive(Debug, Clone, PartialEq)]
pub struct WalkerSummary {
    /// Mean over the walkers at each step.
    pub mean: Vec<f64>,
    /// 5 % quantile over the walkers at each step.
    pub lower: Vec<f64>,
    /// 95 % quantile over the walkers at each step.
    pub upper: Vec<f64>,
}

impl DrawTable {
    /// Number of draws: ensembles × walkers × steps.
    pub fn n_draws(&self) -> usize {
        self.n_ensembles * self.n_walkers * self.n_steps
    }

    /// All draws of a parameter, in the order `[ensemble][walker][step]`.
    pub fn column(&self, parameter_idx: usize) -> Vec<f64> {
        let n = self.parameter_names.len().max(1);
        self.values.iter().skip(parameter_idx).step_by(n).copied().collect()
    }

    /// Value of a parameter in one draw.
    ///
    /// # Panics
    /// If an index is outside the table.
    pub fn value(&self, ensemble: usize, walker: usize, step: usize, parameter_idx: usize) -> f64 {
        let draw = (ensemble * self.n_walkers + walker) * self.n_steps + step;
        self.values[draw * self.parameter_names.len() + parameter_idx]
    }

    /// Mean and central 90 % interval over an ensemble's walkers at every step, for trace plots.
    ///
    /// # Panics
    /// If an index is outside the table.
    pub fn walker_summary(&self, ensemble: usize, parameter_idx: usize) -> WalkerSummary {
        let mut summary = WalkerSummary { mean: Vec::new(), lower: Vec::new(), upper: Vec::new() };
        for step in 0..self.n_steps {
            let walkers: Vec<f64> =
                (0..self.n_walkers).map(|walker| self.value(ensemble, walker, step, parameter_idx)).collect();
            let ascending = sorted(&walkers);
            summary.mean.push(walkers.iter().sum::<f64>() / walkers.len() as f64);
            summary.lower.push(quantile_of_sorted(&ascending, 0.05));
            summary.upper.push(quantile_of_sorted(&ascending, 0.95));
        }
        summary
    }

    /// Checks that the sizes agree and that the names can be used as column names.
    ///
    /// # Errors
    /// [`Error::Input`] that names the wrong size or name.
    pub fn check(&self) -> Result<()> {
        let (n_parameters, n_draws) = (self.parameter_names.len(), self.n_draws());
        let sizes = [
            ("values", self.values.len(), n_draws * n_parameters),
            ("log_density", self.log_density.len(), if self.log_density.is_empty() { 0 } else { n_draws }),
            ("units", self.units.len(), n_parameters),
        ];
        if let Some((what, found, expected)) = sizes.into_iter().find(|(_, found, expected)| found != expected) {
            return Err(refuse(
                format!("{what} has {found} entries instead of {expected}"),
                "give one entry for every draw",
            ));
        }
        if n_draws == 0 || n_parameters == 0 {
            return Err(refuse(
                format!("{n_draws} draws of {n_parameters} parameters"),
                "give at least one draw of one parameter",
            ));
        }
        for (i, name) in self.parameter_names.iter().enumerate() {
            let taken = INDEX_COLUMNS.contains(&name.as_str())
                || name == LOG_DENSITY
                || self.parameter_names[..i].contains(name);
            if taken || name.is_empty() {
                return Err(refuse(
                    format!("a parameter has the name `{name}`, which is empty, repeated or reserved"),
                    "give every parameter a different name",
                ));
            }
        }
        Ok(())
    }
}

fn refuse(found: String, remedy: &str) -> Error {
    Error::input(InputPlace::default().at_key("draws"), found, remedy)
}

/// Writes the draws as CSV, ordered by ensemble, walker and step, all counted from 0. Numbers have enough digits to
/// restore every bit.
///
/// # Errors
/// [`Error::Input`] for an inconsistent table, [`Error::File`] if the file cannot be written.
pub fn write_draws_csv(path: &Path, table: &DrawTable) -> Result<()> {
    table.check()?;
    let n_parameters = table.parameter_names.len();
    stream_atomically(path, |out| {
        let has_log_density = !table.log_density.is_empty();
        // Names come from users' model files and may contain any characters, so the CSV library quotes them.
        let names = table.parameter_names.iter().map(String::as_str);
        let header = INDEX_COLUMNS.into_iter().chain(names).chain(has_log_density.then_some(LOG_DENSITY));
        let mut writer = csv::Writer::from_writer(&mut *out);
        writer.write_record(header)?;
        writer.flush()?;
        drop(writer);
        for (draw, row) in table.values.chunks_exact(n_parameters).enumerate() {
            let (chain, step) = (draw / table.n_steps, draw % table.n_steps);
            write!(out, "{},{},{step}", chain / table.n_walkers, chain % table.n_walkers)?;
            for value in row {
                write!(out, ",{value:?}")?;
            }
            if has_log_density {
                write!(out, ",{:?}", table.log_density[draw])?;
            }
            out.write_all(b"\n")?;
        }
        Ok(())
    })
}

/// Reads draws from CSV: a file of [`write_draws_csv`], or any table with a header and one column per parameter. Without the columns `ensemble`, `walker` and
/// `step`, all rows form one chain. Units are inferred from the suffixes of the names.
///
/// # Errors
/// [`Error::File`] if the file cannot be read. [`Error::Input`] with line and column for values that are not finite numbers, for missing or repeated draws, and
/// for a file without draws.
pub fn read_draws_csv(path: &Path) -> Result<DrawTable> {
    let remedy = "give the path of a CSV file with one column per parameter";
    let bytes = files::read(path, Content::Table, remedy)?;
    refuse_long_lines(path, &bytes)?;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes.as_slice());
    let broken = |error: csv::Error| {
        let line = error.position().map_or(1, |position| position.line() as usize);
        Error::input(
            InputPlace::file(path).at_line(line),
            error.to_string(),
            "give every line as many fields as the header",
        )
    };
    let header: Vec<String> = reader.headers().map_err(broken)?.iter().map(str::to_owned).collect();
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for record in reader.records() {
        let record = record.map_err(broken)?;
        let line = record.position().map_or(0, |position| position.line() as usize);
        if rows.len() * header.len() >= MOST_NUMBERS {
            return Err(Error::input(
                InputPlace::file(path).at_line(line),
                format!("the table has more than {MOST_NUMBERS} numbers"),
                "keep every k-th draw; a few thousand are enough",
            ));
        }
        rows.push(numbers(path, line, &header, &record)?);
    }
    let table = table_from_rows(path, &header, &rows)?;
    table.check()?;
    Ok(table)
}

fn numbers(path: &Path, line: usize, header: &[String], record: &csv::StringRecord) -> Result<Vec<f64>> {
    let number = |(name, field): (&String, &str)| match field.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => {
            let place = InputPlace::file(path).at_line(line).at_key(name);
            Err(Error::input(
                place,
                format!("`{field}` is not a finite number"),
                "remove the line or correct the value",
            ))
        }
    };
    header.iter().zip(record).map(number).collect()
}

fn table_from_rows(path: &Path, header: &[String], rows: &[Vec<f64>]) -> Result<DrawTable> {
    let place = || InputPlace::file(path);
    let is_parameter = |name: &str| !INDEX_COLUMNS.contains(&name) && name != LOG_DENSITY;
    let parameters: Vec<usize> = (0..header.len()).filter(|&i| is_parameter(&header[i])).collect();
    if rows.is_empty() || parameters.is_empty() {
        let found = format!("{} draws of {} parameters", rows.len(), parameters.len());
        return Err(Error::input(place(), found, "give a header and at least one line of numbers"));
    }
    let index = INDEX_COLUMNS.map(|name| header.iter().position(|column| column == name));
    let ranks = index.map(|column| ranks(rows, column));
    let [n_ensembles, n_walkers, n_steps] = match index {
        [None, None, None] => [1, 1, rows.len()],
        _ => [&ranks[0], &ranks[1], &ranks[2]].map(|rank| rank.len().max(1)),
    };
    let n_draws = n_ensembles * n_walkers * n_steps;
    let mut order: Vec<Option<usize>> = vec![None; n_draws];
    for (i, row) in rows.iter().enumerate() {
        let rank =
            |axis: usize| index[axis].and_then(|column| ranks[axis].get(&row[column].to_bits())).copied().unwrap_or(0);
        let draw = if index == [None; 3] { i } else { (rank(0) * n_walkers + rank(1)) * n_steps + rank(2) };
        if order[draw].replace(i).is_some() {
            let found = "this combination of ensemble, walker and step is repeated";
            return Err(Error::input(
                place().at_line(i + 2),
                found,
                "keep one line per draw; the index columns are ensemble, walker and step",
            ));
        }
    }
    let Some(order) = order.into_iter().collect::<Option<Vec<usize>>>() else {
        let found = format!("{} lines for {n_ensembles} ensembles × {n_walkers} walkers × {n_steps} steps", rows.len());
        return Err(Error::input(place(), found, "give every walker the same steps, or remove the index columns"));
    };
    let log_density = header.iter().position(|name| name == LOG_DENSITY);
    Ok(DrawTable {
        parameter_names: parameters.iter().map(|&i| header[i].clone()).collect(),
        units: parameters.iter().map(|&i| labels::parameter_label(&header[i]).unit).collect(),
        n_ensembles,
        n_walkers,
        n_steps,
        values: order.iter().flat_map(|&row| parameters.iter().map(move |&i| rows[row][i])).collect(),
        log_density: log_density.map_or(Vec::new(), |i| order.iter().map(|&row| rows[row][i]).collect()),
    })
}

/// Maps each distinct value of an index column to its position in ascending order. Values need not be successive, because thinned steps may be numbered 0, 10,
/// 20, ….
fn ranks(rows: &[Vec<f64>], column: Option<usize>) -> BTreeMap<u64, usize> {
    let values = column.map_or(Vec::new(), |column| sorted(&rows.iter().map(|row| row[column]).collect::<Vec<_>>()));
    let mut ranks = BTreeMap::new();
    for value in values {
        let next = ranks.len();
        ranks.entry(value.to_bits()).or_insert(next);
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(crate) fn table() -> DrawTable {
        let (n_ensembles, n_walkers, n_steps) = (2, 3, 4);
        let n = n_ensembles * n_walkers * n_steps;
        DrawTable {
            parameter_names: vec!["young_modulus_pa".into(), "slip, \"odd\"".into()],
            units: vec!["Pa".into(), "–".into()],
            n_ensembles,
            n_walkers,
            n_steps,
            values: (0..2 * n).map(|i| (i as f64 + 0.1).exp2() / 3.0 * if i % 5 == 0 { -1e-30 } else { 1.0 }).collect(),
            log_density: (0..n).map(|i| -(i as f64).sqrt()).collect(),
        }
    }

    #[test]
    fn csv_keeps_every_bit() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("draws.csv");
        write_draws_csv(&path, &table()).unwrap();
        assert_eq!(read_draws_csv(&path).unwrap(), table());
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.starts_with("ensemble,walker,step,young_modulus_pa,\"slip, \"\"odd\"\"\",log_density\n0,0,0,"));
    }

    #[test]
    fn rows_may_come_in_any_order_and_steps_may_be_thinned() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("draws.csv");
        std::fs::write(&path, "step,walker,ensemble,x_pa\n10,0,0,2\n0,1,0,3\n0,0,0,1\n10,1,0,4\n").unwrap();
        let table = read_draws_csv(&path).unwrap();
        assert_eq!((table.n_ensembles, table.n_walkers, table.n_steps), (1, 2, 2));
        assert_eq!(table.values, [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(table.units, ["Pa"]);
        std::fs::write(&path, "x,y\n1,2\n3,4\n5,6\n").unwrap();
        assert_eq!(read_draws_csv(&path).unwrap().column(1), [2.0, 4.0, 6.0]);
    }

    #[test]
    fn bad_files_are_refused_with_line_and_column() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("draws.csv");
        for (text, word) in [
            ("a,b\n1,2\n3,x\n", "line 3, `b`: `x`"),
            ("a,b\n1,2\n3\n", "line 3"),
            ("a,b\n", "0 draws of 2"),
            ("ensemble,walker,step,a\n0,0,0,1\n0,0,0,2\n", "line 3: this combination"),
            ("ensemble,walker,step,a\n0,0,0,1\n0,1,1,2\n", "2 lines for 1 ensembles × 2 walkers × 2 steps"),
            ("a,a\n1,2\n", "a parameter has the name `a`"),
            ("a\nNaN\n", "line 2, `a`"),
        ] {
            std::fs::write(&path, text).unwrap();
            let message = read_draws_csv(&path).unwrap_err().to_string();
            assert!(message.contains(word), "{text:?}: {message}");
        }
        assert!(matches!(read_draws_csv(&dir.path().join("none.csv")), Err(Error::File { .. })));
    }

    #[test]
    fn walkers_are_summarised_at_every_step() {
        let summary = table().walker_summary(1, 0);
        let walkers = [table().value(1, 0, 2, 0), table().value(1, 1, 2, 0), table().value(1, 2, 2, 0)];
        assert!((summary.mean[2] - walkers.iter().sum::<f64>() / 3.0).abs() <= 1e-12 * summary.mean[2].abs());
        assert_eq!(summary.upper.len(), 4);
        assert!(summary.lower[2] >= walkers.iter().copied().fold(f64::INFINITY, f64::min));
    }
}
