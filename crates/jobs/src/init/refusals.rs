//! Tables that `init` refuses, each with its cause.

use std::path::Path;

use super::device::has_position;
use super::stress::{ROTATION, STRAIN, StressStrain, called};
use base::error::{Error, InputPlace, Result, Setting};
use base::units::Dimension;
use figures::number::format_significant;
use record::table::{ColumnName, InspectedTable, TableDescription, TableProposal, TableSettings};
use record::{columns_of, moduli_columns};

/// Beginnings of the names of columns that hold logarithms.
const LOGARITHMS: [&str; 3] = ["log10", "ln", "lg"];
/// Largest strain of a creep or a relaxation. A larger one is a flow.
const LARGEST_STRAIN: f64 = 100.0;

/// Refuses a record whose force is 0 in every row, or whose body does not move.
pub(super) fn refuse_without_motion(
    place: &Path,
    proposal: &TableProposal,
    stress_strain: Option<&StressStrain>,
) -> Result<()> {
    let is_published = stress_strain.is_some_and(|own| own.constant.is_some());
    if proposal.description.force.is_some() && !is_published && proposal.force_n == [0.0, 0.0] {
        let column = proposal.description.force.as_ref().map_or(String::new(), |(name, _)| name.to_string());
        return Err(Error::input(
            InputPlace::file(place).at_key(column),
            "the force is 0 in every row, so that the record shows nothing of the gel",
            format!("give another column with `{}`, or join the table with the one before it", Setting::ForceColumn),
        ));
    }
    if proposal.position_m == [0.0, 0.0] && stress_strain.is_none() {
        return Err(Error::input(
            InputPlace::file(place),
            "the position is the same in every row, so that the record shows no motion",
            format!(
                "give another column with `{}`; of a hold include the rows before its step",
                Setting::PositionColumn
            ),
        ));
    }
    Ok(())
}

/// Refuses columns of logarithms, which look like small numbers in a plain unit, unless the user names them. A logarithmic strain is a strain, and `log` alone may name the time of
/// a logger.
pub(super) fn refuse_logarithms(place: &Path, given: &TableSettings, proposal: &TableProposal) -> Result<()> {
    let TableDescription { time, force, position, .. } = &proposal.description;
    let positions = position.iter().flat_map(|(columns, _)| columns.all());
    let used = std::iter::once(&time.0).chain(force.iter().map(|(name, _)| name)).chain(positions);
    let names = used.filter_map(|column| match column {
        ColumnName::Named(name) => Some(name),
        ColumnName::Number(number) => proposal.columns.get(number - 1),
    });
    let is_named =
        |name: &str| given.columns.iter().flatten().any(|known| known == name || known.parse::<usize>().is_ok());
    let is_logarithm = |name: &&String| {
        if is_named(name) || called(name, &STRAIN, &[]) {
            return false;
        }
        let name = name.trim().to_lowercase();
        let behind = LOGARITHMS.iter().find_map(|word| name.strip_prefix(word));
        behind.is_some_and(|rest| rest.starts_with([' ', '(', '[', '_']))
    };
    match names.into_iter().find(is_logarithm) {
        None => Ok(()),
        Some(name) => Err(Error::input(
            InputPlace::file(place).at_key(name.as_str()),
            "by its name this column holds logarithms",
            "write the plain numbers into the table: a record of logarithms is not read",
        )),
    }
}

/// Refuses a relaxation of a tip, for which there is no model.
pub(super) fn refuse_relaxation_of_tip(place: &Path) -> Error {
    Error::input(
        InputPlace::file(place),
        "the position is commanded and the force measured, or seems to be, and a relaxation of a tip has no model",
        format!(
            "give the record of a hold at constant force; if this is one, say so with `{} creep`; of several parts choose the hold with `{}`",
            Setting::Kind,
            Setting::Tables
        ),
    )
}

/// Refuses the same column for two quantities.
pub(super) fn refuse_one_column_for_two(given: &TableSettings) -> Result<()> {
    let named: Vec<&String> = given.columns[..3].iter().flatten().collect();
    let twice = named.iter().enumerate().find(|(place, name)| named[..*place].contains(name));
    twice.map_or(Ok(()), |(_, name)| {
        Err(Error::input(
            InputPlace::default().at_key(name.as_str()),
            "this column is given for two quantities",
            "give time, force and position a column each",
        ))
    })
}

/// Refuses a table of a viscosity over the shear rate.
pub(super) fn refuse_flow_curve(place: &Path, given: &TableSettings, looked: &InspectedTable) -> Result<()> {
    let named = |words: &[&str]| looked.columns.iter().find(|name| called(name, words, &[]));
    let rate = named(&["shear rate", "shearrate", "shear_rate", "scherrate", "de cisaillement"]);
    let viscosity = named(&["viscosity", "viskosität", "viscosité", "viscosidad", "viscosità"]);
    let is_given = given.columns.iter().chain(&given.axes).any(Option::is_some);
    let Some((rate, viscosity)) = rate.zip(viscosity).filter(|_| !is_given) else { return Ok(()) };
    Err(Error::input(
        InputPlace::file(place),
        format!("`{rate}` and `{viscosity}` are columns of a flow curve, which shows the viscosity of a steady flow"),
        "give a creep, a relaxation or an oscillation, whose tables have the strain or the moduli",
    ))
}

/// Refuses the axial force and the gap of a rotating rheometer, whose test is one of torque and angle, unless the user names the columns.
pub(super) fn refuse_gap_of_rheometer(place: &Path, given: &TableSettings, proposal: &TableProposal) -> Result<()> {
    let is_word =
        |name: &str, word: &str| name.split(|c: char| !c.is_alphabetic()).any(|part| part.eq_ignore_ascii_case(word));
    let has_gap = has_position(proposal, &["gap", "spalt", "entrefer"]);
    let rotation = proposal.columns.iter().find(|name| called(name, &ROTATION, &[]) || is_word(name, "couple"));
    let is_given = given.columns[1..3].iter().any(Option::is_some);
    let Some(rotation) = rotation.filter(|_| has_gap && !is_given) else { return Ok(()) };
    Err(Error::input(
        InputPlace::file(place),
        format!("`{rotation}` is a column of a rotating rheometer, whose axial force and gap do not describe its test"),
        format!(
            "export the stress and the strain of the test; for a squeezing test name the columns with `{}` and `{}`",
            Setting::ForceColumn,
            Setting::PositionColumn
        ),
    ))
}

/// Refuses a flow, whose strain exceeds by far what a law of small strains describes.
pub(super) fn refuse_flow(place: &Path, proposal: &TableProposal) -> Result<()> {
    let strain = proposal.position_m.iter().fold(0.0, |most: f64, strain| most.max(strain.abs()));
    if strain <= LARGEST_STRAIN {
        return Ok(());
    }
    Err(Error::input(
        InputPlace::file(place),
        format!("the strain reaches {} %: the specimen flows", format_significant(100.0 * strain, 2)),
        "give a creep, a relaxation or an oscillation at small strain; check the unit of the strain if it was one",
    ))
}

/// Refuses a table with the moduli of an oscillation, but without a column that is named as a frequency, a force or a position.
pub(super) fn refuse_without_frequency(place: &Path, given: &TableSettings, looked: &InspectedTable) -> Result<()> {
    let is_record = given.columns.iter().chain(&given.axes).any(Option::is_some)
        || looked.units.iter().flatten().any(|unit| matches!(unit.dimension, Dimension::Force | Dimension::Length));
    let Some([(_, first), (_, second)]) = moduli_columns(looked).filter(|_| !is_record) else { return Ok(()) };
    let name = |column: usize| &looked.columns[column];
    Err(Error::input(
        InputPlace::file(place),
        format!(
            "`{}` and `{}` are moduli of an oscillation, and no column is named as a frequency",
            name(first),
            name(second)
        ),
        "name the column of the frequency with its unit, as in `frequency [rad/s]`; moduli over time, strain or temperature are not read",
    ))
}

/// Refuses a table with several columns of one modulus, such as of several specimens.
pub(super) fn refuse_several_columns(place: &Path, looked: &InspectedTable) -> Result<()> {
    for (column, _) in moduli_columns(looked).into_iter().flatten() {
        let names: Vec<String> =
            columns_of(looked, column).map(|place| format!("`{}`", looked.columns[place])).collect();
        if names.len() > 1 {
            let shown = names.iter().take(4).cloned().collect::<Vec<_>>().join(", ");
            return Err(Error::input(
                InputPlace::file(place),
                format!("{} columns are named as the {}: {shown}", names.len(), column.key()),
                "keep the columns of one sweep in the table",
            ));
        }
    }
    Ok(())
}
