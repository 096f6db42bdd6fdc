//! Functions that write the elements common to all NetCDF files of the program.

use netcdf_writer::{DimensionId, NcAttrValue, NcFileBuilder, NcWriteFormat, NcWriteOptions, VariableId};

pub(super) type NcResult<T> = std::result::Result<T, netcdf_writer::Error>;

/// Creates a file without groups that contains the name of the program as its creator.
pub(super) fn new_file() -> NcResult<NcFileBuilder> {
    let mut file = NcFileBuilder::new();
    creators().into_iter().try_for_each(|(name, value)| file.add_attribute(name, value))?;
    Ok(file)
}

/// Converts the file to bytes in the format NetCDF-4.
pub(super) fn into_bytes(file: NcFileBuilder) -> NcResult<Vec<u8>> {
    let (_, bytes) = file.to_vec(NcWriteOptions { format: NcWriteFormat::Nc4 })?;
    Ok(bytes)
}

fn text(text: &str) -> NcAttrValue {
    NcAttrValue::Chars(text.to_owned())
}

fn creators() -> [(&'static str, NcAttrValue); 4] {
    // The creator is the program, not this crate.
    let (name, version) = ("vitreo-uq", env!("CARGO_PKG_VERSION"));
    [
        ("created_by", text(&format!("{name} {version}"))),
        ("creation_library", text(name)),
        ("inference_library", text(name)),
        ("inference_library_version", text(version)),
    ]
}

/// Writes the creator into a group, and a note that describes the group.
pub(super) fn describe(file: &mut NcFileBuilder, group: &str, note: &str) -> NcResult<()> {
    creators().into_iter().try_for_each(|(name, value)| file.add_group_attribute(group, name, value))?;
    if note.is_empty() { Ok(()) } else { file.add_group_attribute(group, "note", text(note)) }
}

pub(super) fn attribute(file: &mut NcFileBuilder, variable: VariableId, name: &str, value: &str) -> NcResult<()> {
    file.add_variable_attribute(variable, name, text(value))
}

/// Writes the unit of a variable; `1` if it has none.
pub(super) fn add_unit(file: &mut NcFileBuilder, variable: VariableId, unit: &str) -> NcResult<()> {
    attribute(file, variable, "units", if unit.is_empty() || unit == "–" { "1" } else { unit })
}

/// Adds a group with the dimensions `chain` and `draw`, both counted from 0. Returns these two dimensions.
pub(super) fn add_group(
    file: &mut NcFileBuilder,
    name: &str,
    n_chains: usize,
    n_draws: usize,
) -> NcResult<[DimensionId; 2]> {
    describe(file, name, "")?;
    add_draws(file, name, n_chains, &(0..n_draws as i64).collect::<Vec<i64>>())
}

/// Adds the dimensions `chain` and `draw` to a group. Chains are counted from 0; draws have the given labels.
pub(super) fn add_draws(
    file: &mut NcFileBuilder,
    group: &str,
    n_chains: usize,
    draws: &[i64],
) -> NcResult<[DimensionId; 2]> {
    let chain = file.add_dimension_path(format!("{group}/chain"), n_chains as u64)?;
    let draw = file.add_dimension_path(format!("{group}/draw"), draws.len() as u64)?;
    add_coordinate(file, group, "chain", chain, &(0..n_chains as i64).collect::<Vec<i64>>())?;
    add_coordinate(file, group, "draw", draw, draws)?;
    Ok([chain, draw])
}

pub(super) fn add_coordinate(
    file: &mut NcFileBuilder,
    group: &str,
    name: &str,
    dimension: DimensionId,
    values: &[i64],
) -> NcResult<()> {
    let variable = file.add_variable_path::<i64>(format!("{group}/{name}"), &[dimension])?;
    file.write_variable(variable, values)
}
