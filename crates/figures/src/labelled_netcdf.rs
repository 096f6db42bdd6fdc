//! Writes posterior draws over named dimensions, such as group and parameter, as NetCDF-4 in ArviZ's layout.
//!
//! The group `posterior` contains the variables. Each has the dimensions `chain` and `draw`, followed by its own. The coordinate of a dimension contains its
//! labels as strings, so readers can select by label: `posterior["typical"].sel(group="porcine")`. The file contains no time stamps, so equal draws give equal
//! bytes.

use std::path::Path;

use super::netcdf_file::{NcResult, add_group, add_unit, into_bytes, new_file};
use base::error::InputPlace;
use base::files::write_atomically;
use base::{Error, Result};

const GROUP: &str = "posterior";
/// Names of the first two dimensions of every variable.
const RESERVED: [&str; 2] = ["chain", "draw"];

/// A dimension whose positions have names.
#[derive(Debug, Clone, PartialEq)]
pub struct Dimension<'a> {
    /// Name of the dimension, such as `group`.
    pub name: &'a str,
    /// Label of each position along the dimension; all labels are different.
    pub labels: Vec<String>,
}

/// Draws of one quantity, as a variable of the NetCDF file.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable<'a> {
    /// Name of the variable, such as `typical`.
    pub name: &'a str,
    /// Unit, such as `Pa`; empty or `–` for none.
    pub unit: &'a str,
    /// Names of the variable's dimensions after chain and draw, in order.
    pub dimensions: Vec<&'a str>,
    /// Values, of shape `[chain][draw][dimensions…]`, the last index fastest.
    pub values: Vec<f64>,
}

/// Writes draws from `n_chains` chains with `n_draws` draws each. Dimensions that no variable uses are also written.
///
/// # Errors
/// [`Error::Input`] for no draws or variables, or a wrong number of values. Values have to be finite. Names and labels have to be known, distinct and allowed
/// in NetCDF. [`Error::File`] if the file cannot be written.
pub fn write_labelled_netcdf(
    path: &Path,
    n_chains: usize,
    n_draws: usize,
    dimensions: &[Dimension],
    variables: &[Variable],
) -> Result<()> {
    if n_chains == 0 || n_draws == 0 || variables.is_empty() {
        let found = format!("{n_chains} chains of {n_draws} draws of {} variables", variables.len());
        return refuse(found, "keep at least one draw and one variable");
    }
    check_names(dimensions, variables)?;
    dimensions.iter().try_for_each(check_labels)?;
    variables.iter().try_for_each(|variable| check_values(variable, n_chains * n_draws, dimensions))?;
    let refused = |error: netcdf_writer::Error| {
        Error::input(
            InputPlace::default().at_key("NetCDF"),
            error.to_string(),
            "rename the dimension or variable, or use fewer draws",
        )
    };
    let bytes = encode(n_chains, n_draws, dimensions, variables).map_err(refused)?;
    write_atomically(path, &bytes)
}

fn refuse(found: String, remedy: &str) -> Result<()> {
    Err(Error::input(InputPlace::default().at_key("NetCDF"), found, remedy))
}

/// Checks the names. No dimension may have the name of a variable, because its labels are stored as a variable.
fn check_names(dimensions: &[Dimension], variables: &[Variable]) -> Result<()> {
    let mut names: Vec<&str> = RESERVED.to_vec();
    for name in dimensions.iter().map(|d| d.name).chain(variables.iter().map(|v| v.name)) {
        // NetCDF would read a slash in a name as the start of a group.
        if name.is_empty() || name.trim() != name || name.contains(|c: char| c == '/' || c.is_control()) {
            return refuse(
                format!("a dimension or variable has the name `{name}`, which NetCDF cannot store"),
                "give it a name of letters and digits",
            );
        }
        if names.contains(&name) {
            return refuse(format!("`{name}` is repeated, or reserved by the layout"), "give it another name");
        }
        names.push(name);
    }
    Ok(())
}

fn check_labels(dimension: &Dimension) -> Result<()> {
    let Dimension { name, labels } = dimension;
    if labels.is_empty() {
        return refuse(
            format!("dimension `{name}` has no labels"),
            "give one label per position, or remove the dimension",
        );
    }
    let mut sorted: Vec<&String> = labels.iter().collect();
    sorted.sort();
    if let Some(twice) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        return refuse(
            format!("dimension `{name}` has the label `{}` twice", twice[0]),
            "give every position a different label",
        );
    }
    if let Some(label) = labels.iter().find(|label| label.is_empty() || label.contains('\0')) {
        return refuse(
            format!(
                "dimension `{name}` has the label `{}`, which is empty or contains a null character",
                label.escape_default()
            ),
            "give a label of letters and digits",
        );
    }
    Ok(())
}

fn check_values(variable: &Variable, n_draws: usize, dimensions: &[Dimension]) -> Result<()> {
    let name = variable.name;
    let mut expected = n_draws;
    for (i, dimension) in variable.dimensions.iter().enumerate() {
        let Some(known) = dimensions.iter().find(|known| known.name == *dimension) else {
            let remedy = "use one of the given dimensions; chain and draw are added automatically";
            return refuse(format!("`{name}` has the unknown dimension `{dimension}`"), remedy);
        };
        if variable.dimensions[..i].contains(dimension) {
            let remedy = "give the second dimension another name, even with equal labels";
            return refuse(format!("`{name}` has the dimension `{dimension}` twice"), remedy);
        }
        expected *= known.labels.len();
    }
    if variable.values.len() != expected {
        let found = format!("`{name}` has {} values instead of {expected}", variable.values.len());
        return refuse(found, "give one value per chain, draw and position of its dimensions");
    }
    if let Some(at) = variable.values.iter().position(|value| !value.is_finite()) {
        let draw = at / (expected / n_draws);
        let found = format!("`{name}` is {} in draw {draw}, counted over all chains from 0", variable.values[at]);
        return refuse(found, "give finite values; the sampler has failed in this draw");
    }
    Ok(())
}

fn encode(n_chains: usize, n_draws: usize, dimensions: &[Dimension], variables: &[Variable]) -> NcResult<Vec<u8>> {
    let mut file = new_file()?;
    let draws = add_group(&mut file, GROUP, n_chains, n_draws)?;
    let mut ids = Vec::new();
    for Dimension { name, labels } in dimensions {
        let id = file.add_dimension_path(format!("{GROUP}/{name}"), labels.len() as u64)?;
        let coordinate = file.add_string_variable_path(format!("{GROUP}/{name}"), &[id])?;
        file.write_string_variable(coordinate, labels)?;
        ids.push(id);
    }
    for Variable { name, unit, dimensions: names, values } in variables {
        let place = |name: &&str| dimensions.iter().position(|dimension| dimension.name == *name);
        let shape: Vec<_> = draws.into_iter().chain(names.iter().filter_map(place).map(|place| ids[place])).collect();
        let variable = file.add_variable_path::<f64>(format!("{GROUP}/{name}"), &shape)?;
        add_unit(&mut file, variable, unit)?;
        file.write_variable(variable, values)?;
    }
    into_bytes(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    const N_CHAINS: usize = 2;
    const N_DRAWS: usize = 3;

    fn dimensions() -> Vec<Dimension<'static>> {
        let labelled = |name, labels: &[&str]| Dimension { name, labels: labels.iter().map(|l| (*l).into()).collect() };
        vec![labelled("group", &["porcine", "µ-gel, 4 °C"]), labelled("parameter", &["E", "c₁", "c₂"])]
    }

    fn variables() -> Vec<Variable<'static>> {
        let values = |n: usize| (0..n).map(|i| 1.0 / (1.0 + i as f64)).collect();
        vec![
            Variable { name: "typical", unit: "Pa", dimensions: vec!["group", "parameter"], values: values(36) },
            Variable { name: "lp", unit: "–", dimensions: vec![], values: values(6) },
        ]
    }

    #[test]
    fn the_file_is_hdf5_and_the_same_each_time() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str| {
            let path = dir.path().join(name);
            write_labelled_netcdf(&path, N_CHAINS, N_DRAWS, &dimensions(), &variables()).unwrap();
            std::fs::read(path).unwrap()
        };
        let (first, second) = (write("a.nc"), write("b.nc"));
        assert_eq!(first, second);
        assert_eq!(&first[..8], b"\x89HDF\r\n\x1a\n");
        let holds = |bytes: &[u8]| first.windows(bytes.len()).any(|window| window == bytes);
        let values: Vec<u8> = variables()[0].values.iter().flat_map(|value| value.to_le_bytes()).collect();
        assert!(holds(&values) && holds("µ-gel, 4 °C".as_bytes()));
    }

    #[test]
    fn impossible_names_and_shapes_are_refused() {
        type Change = fn(&mut Vec<Dimension>, &mut Vec<Variable>);
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.nc");
        let refused: [(Change, &str); 14] = [
            (|_, v| v.clear(), "2 chains of 3 draws of 0 variables"),
            (|d, _| d[0].name = "chain", "`chain` is repeated, or reserved by the layout"),
            (|d, _| d[1].name = "group", "`group` is repeated"),
            (|_, v| v[1].name = "typical", "`typical` is repeated"),
            (|_, v| v[1].name = "parameter", "`parameter` is repeated"),
            (|_, v| v[1].name = "a/b", "has the name `a/b`"),
            (|d, _| d[0].name = "", "has the name ``"),
            (|d, _| d[0].labels.clear(), "dimension `group` has no labels"),
            (|d, _| d[1].labels[2] = "E".into(), "the label `E` twice"),
            (|d, _| d[1].labels[2] = "a\0b".into(), "the label `a\\u{0}b`"),
            (|_, v| v[0].dimensions[1] = "region", "the unknown dimension `region`"),
            (|_, v| v[0].dimensions[1] = "group", "the dimension `group` twice"),
            (|_, v| v[0].values.truncate(35), "`typical` has 35 values instead of 36"),
            (|_, v| v[0].values[13] = f64::NAN, "`typical` is NaN in draw 2"),
        ];
        for (change, words) in refused {
            let (mut dimensions, mut variables) = (dimensions(), variables());
            change(&mut dimensions, &mut variables);
            let result = write_labelled_netcdf(&path, N_CHAINS, N_DRAWS, &dimensions, &variables);
            let message = result.unwrap_err().to_string();
            assert!(message.contains(words), "`{words}` in {message}");
        }
        let empty = write_labelled_netcdf(&path, 0, N_DRAWS, &dimensions(), &variables());
        assert!(empty.is_err_and(|error| error.to_string().contains("keep at least one draw")));
        assert!(!path.exists());
    }
}
