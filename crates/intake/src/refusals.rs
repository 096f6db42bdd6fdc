//! Tables that `init` refuses, each with its cause.

use std::path::Path;

use super::device::{Device, has_position};
use super::numbers::{has_numbers, numbers_of};
use super::stress::{
    MULTIAXIAL, ROTATION, STRAIN, StressStrain, called, is_of_relaxation, is_ratio, is_reduced_modulus, is_told,
};
use super::sweep::{VISCOSITY, called_moduli, refuse_other_than_moduli, refuse_relative_moduli};
use base::error::{Error, InputPlace, Result, Setting};
use base::units::Dimension;
use figures::number::format_significant;
use record::table::{ColumnName, InspectedTable, PositionColumns, TableDescription, TableProposal, TableSettings};
use record::{Control, SweepColumn, columns_of, moduli_columns};

/// Beginnings of the names of columns that hold logarithms.
const LOGARITHMS: [&str; 4] = ["log10", "ln", "lg", "log"];
/// Signs of a product in the name of a column of multiples; the first is also a letter.
const TIMES: [char; 4] = ['x', '×', '*', '·'];
/// Largest strain of a creep or a relaxation. A larger one is a flow.
const LARGEST_STRAIN: f64 = 100.0;
/// Largest relative difference of two columns of the same frequencies in different units.
const SAME_FREQUENCIES: f64 = 0.01;
/// Largest relative difference of an extension and of the strain beside it times the length of the specimen.
const SAME_EXTENSION: f64 = 0.05;

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
                "give another column with `{}`; of a hold include the rows before its step, or give the sizes of a specimen with `{}` and `{}`",
                Setting::PositionColumn,
                Setting::SpecimenLength,
                Setting::SpecimenArea
            ),
        ));
    }
    Ok(())
}

/// Refuses columns of logarithms and of multiples, which look like numbers in a plain unit, unless the user names them. A logger may call its time `Log time`.
pub(super) fn refuse_changed_numbers(place: &Path, given: &TableSettings, proposal: &TableProposal) -> Result<()> {
    let TableDescription { time, force, position, .. } = &proposal.description;
    let positions = position.iter().flat_map(|(columns, _)| columns.all()).map(|name| (name, Setting::PositionColumn));
    let force = force.iter().map(|(name, _)| (name, Setting::ForceColumn));
    let used = std::iter::once((&time.0, Setting::TimeColumn)).chain(force).chain(positions);
    for (column, setting) in used {
        let at = match column {
            ColumnName::Named(name) => proposal.columns.iter().position(|other| other == name),
            ColumnName::Number(number) => Some(number - 1),
        };
        let Some((at, name)) = at.and_then(|at| Some((at, proposal.columns.get(at)?))) else { continue };
        if given.columns.iter().flatten().any(|known| is_told(known, name, at)) {
            continue;
        }
        let remedy =
            format!("write the plain numbers into the table; if they are plain, name the column: `{setting} NAME`");
        refuse_changed_name(place, name, &remedy)?;
    }
    Ok(())
}

/// Refuses columns of logarithms and of multiples of a sweep. Columns that the user names are no exception: their names alone say what the numbers are.
pub(super) fn refuse_changed_columns(
    place: &Path,
    looked: &InspectedTable,
    columns: &[(SweepColumn, usize)],
) -> Result<()> {
    let remedy =
        "write the plain numbers into the table, and name the column by its quantity and unit, as in `G' [Pa]`";
    columns.iter().try_for_each(|(_, column)| refuse_changed_name(place, &looked.columns[*column], remedy))
}

/// Refuses a column whose name is one of logarithms or of multiples.
fn refuse_changed_name(place: &Path, name: &str, remedy: &str) -> Result<()> {
    let what = match () {
        () if is_logarithm(name) => "logarithms",
        () if is_multiple(name) => "multiples",
        () => return Ok(()),
    };
    Err(Error::input(InputPlace::file(place).at_key(name), format!("by its name this column holds {what}"), remedy))
}

/// True if a name begins with a logarithm. The natural logarithm of a stretch is a strain.
fn is_logarithm(name: &str) -> bool {
    let name = name.trim().to_lowercase();
    let behind = LOGARITHMS.iter().find_map(|word| name.strip_prefix(word));
    behind.is_some_and(|rest| rest.starts_with([' ', '(', '[', '_']))
        && !(name.starts_with("ln") && called(&name, &STRAIN, &[]))
}

/// True if a name holds a product with a number, as in `Stress x10 (Pa)`, `10 x Stress`, `10^-3 Stress` or `Strain*1000`. `x1` and `x 2` are coordinates.
fn is_multiple(name: &str) -> bool {
    let name = name.to_lowercase();
    if name
        .trim_start()
        .strip_prefix("10")
        .is_some_and(|power| power.starts_with(['^', '⁻', '⁺', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹']))
    {
        return true;
    }
    let number_before = |text: &str| text.trim().parse::<f64>().is_ok_and(|number| number != 1.0);
    let number_behind = |text: &str, is_letter: bool| {
        let digits: String =
            text.trim_start().chars().take_while(|c| c.is_ascii_digit() || ".^-e".contains(*c)).collect();
        let rest = text.trim_start()[digits.len()..].trim_start();
        let is_number = digits.starts_with(|c: char| c.is_ascii_digit()) && digits != "1" && !rest.starts_with('x');
        is_number && (!is_letter || ["10", "0.", "1e"].iter().any(|first| digits.starts_with(first)))
    };
    name.char_indices().filter(|(_, sign)| TIMES.contains(sign)).any(|(at, sign)| {
        let (before, behind) = (&name[..at], &name[at + sign.len_utf8()..]);
        let is_apart = sign != 'x' || before.ends_with([' ', ')', ']']);
        let has_name = behind.trim_start().starts_with(char::is_alphabetic);
        is_apart
            && !before.trim().is_empty()
            && (number_behind(behind, sign == 'x') || has_name && number_before(before))
    })
}

/// Refuses amplitudes of an oscillation over time, which look like a hold: a phase or a complex viscosity stands beside the stress or force.
pub(super) fn refuse_amplitudes(
    place: &Path,
    bytes: &[u8],
    given: &TableSettings,
    looked: &InspectedTable,
) -> Result<()> {
    let is_given = given.columns[1..3].iter().chain(&given.axes).any(Option::is_some);
    let of_oscillation = [SweepColumn::Phase, SweepColumn::LossTangent].into_iter();
    // `Phase` alone may be a part of the test, and `delta` a distance.
    let is_sure = |place: &usize| {
        looked.units[*place].is_some()
            || called(&looked.columns[*place], &["angle", "tan", "winkel", "faktor", "factor"], &[])
    };
    // A bead's record may have a phase of its camera. That of an oscillation has its frequency.
    let is_of = |dimension: Dimension| looked.units.iter().flatten().any(|unit| unit.dimension == dimension);
    let has_frequency = columns_of(looked, SweepColumn::Frequency).next().is_some();
    let is_bead = is_of(Dimension::Force) && is_of(Dimension::Length) && !has_frequency;
    let named = of_oscillation.flat_map(|column| columns_of(looked, column)).filter(is_sure);
    let is_viscosity =
        |place: &usize| called(&looked.columns[*place], &["complex viscosity", "komplexe viskosität"], &[]);
    let viscosities = (0..looked.columns.len()).filter(is_viscosity);
    // Exports hold the columns of all kinds of tests, those of the others without numbers.
    let found = named.chain(viscosities).find(|place| has_numbers(bytes, looked, *place));
    match found.map(|place| &looked.columns[place]).filter(|_| !is_given && !is_bead) {
        None => Ok(()),
        Some(name) => Err(Error::input(
            InputPlace::file(place),
            format!("`{name}` is a column of an oscillation, and no pair of its moduli is in the table"),
            format!(
                "add the ratio of the amplitudes of stress and strain as `complex modulus [Pa]` beside frequency and phase; for a record over time name the columns with `{}` and `{}`",
                Setting::ForceColumn,
                Setting::PositionColumn
            ),
        )),
    }
}

/// Refuses a frequency that another one in another unit contradicts, so that one of the units is wrong. Sweeps side by side have a frequency each: of several sweeps
/// only frequencies next to each other are compared.
pub(super) fn refuse_contradictory_frequencies(
    place: &Path,
    bytes: &[u8],
    looked: &InspectedTable,
    columns: &[(SweepColumn, usize)],
) -> Result<()> {
    let [(_, chosen), moduli @ ..] = columns else { return Ok(()) };
    let has_one_sweep = moduli.iter().all(|(column, _)| columns_of(looked, *column).count() < 2);
    let frequencies: Vec<usize> = columns_of(looked, SweepColumn::Frequency).collect();
    let is_beside = |other: &usize| {
        has_one_sweep || (*chosen.min(other)..*chosen.max(other)).all(|between| frequencies.contains(&between))
    };
    for other in frequencies.iter().filter(|other| is_beside(other)) {
        let units = [*chosen, *other].map(|column| looked.units[column].as_ref());
        let [Some(unit), Some(other_unit)] = units else { continue };
        if unit.to_si(1.0) == other_unit.to_si(1.0) {
            continue;
        }
        let rows = numbers_of(bytes, looked, [*chosen, *other]);
        let in_hz = |[first, second]: [f64; 2]| [unit.to_si(first), other_unit.to_si(second)].map(f64::abs);
        let difference = |[first, second]: [f64; 2]| (first - second).abs();
        let largest = |[first, second]: [f64; 2]| first.max(second);
        // Rounding to few decimals changes small frequencies most, which add little to the sums.
        let sum = |of: &dyn Fn([f64; 2]) -> f64| rows.iter().map(|(_, pair)| of(in_hz(*pair))).sum::<f64>();
        if sum(&difference) <= SAME_FREQUENCIES * sum(&largest) {
            continue;
        }
        let apart = |pair: [f64; 2]| difference(pair) > SAME_FREQUENCIES * largest(pair);
        let Some((line, [first, second])) = rows.iter().find(|(_, pair)| apart(in_hz(*pair))) else { continue };
        let [name, other_name] = [*chosen, *other].map(|column| &looked.columns[column]);
        return Err(Error::input(
            InputPlace::file(place).at_line(*line),
            format!(
                "`{name}` and `{other_name}` are different frequencies: {first} {} and {second} {}",
                unit.name, other_unit.name
            ),
            format!(
                "one of the two units is wrong, because 1 Hz is 2π rad/s; choose the right column with `{} COLUMN`",
                Setting::FrequencyColumn
            ),
        ));
    }
    Ok(())
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

/// Refuses force and displacement of a specimen in shear.
///
/// # Errors
/// [`Error::Input`] for a specimen with such a column.
pub(super) fn refuse_sheared_specimen(place: &Path, device: &Device, proposal: &TableProposal) -> Result<()> {
    let TableDescription { force, position, .. } = &proposal.description;
    let position = match position {
        Some((PositionColumns::Along(name), _)) => Some(name),
        _ => None,
    };
    let names = [force.as_ref().map(|(name, _)| name), position].into_iter().flatten().map(ColumnName::to_string);
    let is_specimen =
        matches!(device, Device::Specimen) || device.stress_strain().is_some_and(|own| own.is_of_specimen);
    match names.filter(|_| is_specimen).find(|name| called(name, &MULTIAXIAL, &[])) {
        None => Ok(()),
        Some(name) => Err(Error::input(
            InputPlace::file(place).at_key(name),
            "a specimen in shear is strained by its displacement divided by its gap, and the sizes of a specimen are read for tension and compression only",
            "write the shear stress and the shear strain into columns such as `Shear stress [Pa]` and `Shear strain [1]`",
        )),
    }
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
    let viscosity = named(&VISCOSITY);
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
        format!(
            "name it with `{}`, and give its unit in its name, as in `frequency [rad/s]`; moduli over time, strain or temperature are not read",
            Setting::FrequencyColumn
        ),
    ))
}

/// Refuses a modulus over time that may be no relaxation modulus, unless the user says that it is one: `is_told` is true then.
pub(super) fn refuse_other_modulus(
    place: &Path,
    creep: &StressStrain,
    looked: &InspectedTable,
    is_told: bool,
) -> Result<()> {
    let at = creep.given.columns[1].as_ref().and_then(|number| number.parse::<usize>().ok());
    let Some(name) = at.and_then(|number| looked.columns.get(number - 1)) else { return Ok(()) };
    if creep.constant != Some(Control::Position) {
        return Ok(());
    }
    if is_reduced_modulus(name) {
        return Err(Error::input(
            InputPlace::file(place).at_key(name.as_str()),
            "by its name this is the modulus of an indentation, E/(1 − ν²)",
            "multiply it by 1 − ν² with Poisson's ratio ν of the gel, and name it `E(t) [Pa]`",
        ));
    }
    if is_told || is_of_relaxation(looked) {
        return Ok(());
    }
    Err(Error::input(
        InputPlace::file(place).at_key(name.as_str()),
        "a modulus over time can be that of a relaxation after a step of strain, or the stiffness of a gel that sets, ages or dissolves",
        format!("if it is a relaxation, give `{} relaxation`; the program has no model of the other", Setting::Kind),
    ))
}

/// Refuses an extension that is not the strain beside it times the length of the specimen, as that of a crosshead beside an extensometer.
pub(super) fn refuse_other_extension(place: &Path, extension: &TableProposal, strain: &TableProposal) -> Result<()> {
    let [of_extension, of_strain] =
        [extension, strain].map(|proposal| 1e3 * (proposal.position_m[1] - proposal.position_m[0]));
    let range = of_extension.max(of_strain);
    if (of_extension - of_strain).abs() <= SAME_EXTENSION * range {
        return Ok(());
    }
    let name = |proposal: &TableProposal| {
        let column = proposal.description.position.iter().flat_map(|(columns, _)| columns.all()).next().cloned();
        match column {
            Some(ColumnName::Named(name)) => name,
            Some(ColumnName::Number(number)) => {
                proposal.columns.get(number - 1).cloned().unwrap_or_else(|| number.to_string())
            }
            None => String::new(),
        }
    };
    let [first, second] = [extension, strain].map(name);
    Err(Error::input(
        InputPlace::file(place).at_key(first.as_str()),
        format!(
            "`{first}` changes by {} mm, but `{second}` times the length of the specimen by {} mm: the machine and the grips may give way, or the length is another one",
            format_significant(of_extension, 3),
            format_significant(of_strain, 3)
        ),
        format!(
            "choose the one that is measured on the specimen: `{0} \"{second}\"` or `{0} \"{first}\"`",
            Setting::PositionColumn
        ),
    ))
}

/// Refuses a modulus or a compliance that is relative to its first value, unless the user names the columns.
pub(super) fn refuse_ratio(place: &Path, given: &TableSettings, looked: &InspectedTable) -> Result<()> {
    let words = ["modul", "compliance", "nachgiebigkeit", "g(t)", "e(t)", "j(t)", "d(t)"];
    let found = looked.columns.iter().find(|name| is_ratio(name) && called(name, &words, &[]));
    let is_given = given.columns[1..3].iter().any(Option::is_some);
    let Some(name) = found.filter(|_| !is_given) else { return Ok(()) };
    Err(Error::input(
        InputPlace::file(place).at_key(name.as_str()),
        "by its name this column is relative to a value, so that it shows no modulus",
        "multiply it by that value, and name it with its unit, as in `G(t) [Pa]` or `J(t) [1/Pa]`",
    ))
}

/// Refuses a table over a frequency without a pair of moduli, and without columns of a record over time.
pub(super) fn refuse_without_moduli(place: &Path, given: &TableSettings, looked: &InspectedTable) -> Result<()> {
    let is_time = |name: &String| {
        let name = name.trim().to_lowercase();
        ["time", "zeit", "temps", "tiempo", "tempo"].iter().any(|word| name.starts_with(word)) || name == "t"
    };
    let is_record = given.columns.iter().chain(&given.axes).chain(&given.units).any(Option::is_some)
        || looked
            .columns
            .iter()
            .any(|name| is_time(name) || called(name, &["force", "position", "displacement", "current"], &[]))
        || looked.units.iter().flatten().any(|unit| matches!(unit.dimension, Dimension::Time | Dimension::Length));
    // A letter alone may be the force.
    let is_sure = |place: &usize| looked.units[*place].is_some() || looked.columns[*place].chars().count() > 1;
    let frequency = columns_of(looked, SweepColumn::Frequency).find(is_sure);
    let Some(frequency) = frequency.filter(|_| !is_record) else { return Ok(()) };
    refuse_other_than_moduli(place, looked, &(0..looked.columns.len()).collect::<Vec<_>>(), 2)?;
    refuse_relative_moduli(place, looked, given, called_moduli(looked))?;
    Err(Error::input(
        InputPlace::file(place),
        format!(
            "`{}` is a frequency, and no two columns are named as the moduli of an oscillation",
            looked.columns[frequency]
        ),
        format!(
            "name storage and loss modulus, or a modulus and the phase, with `{} COLUMN COLUMN`",
            Setting::ModuliColumns
        ),
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
                format!("choose two columns of one sweep with `{} COLUMN COLUMN`", Setting::ModuliColumns),
            ));
        }
    }
    Ok(())
}
