//! `init` for a rheometer's oscillation: writes a description of the table.

use std::collections::BTreeSet;
use std::f64::consts::FRAC_PI_2;
use std::path::Path;

use super::numbers::numbers_of;
use super::preamble::Preamble;
use super::source::TableSource;
use super::stress::{COMPLIANCE, MULTIAXIAL, UNIAXIAL, called};
use super::toml::add_line;
use base::error::{Error, InputPlace, Result, Setting};
use base::toml_input::quoted;
use base::units::Dimension;
use documents::init::{InitColumn, InitSummary};
use figures::number::format_significant;
use record::table::{InspectedTable, ParsedUnit, TableSettings, bracketed, is_angular, split_unit, unit};
use record::{OSCILLATION, OscillationRecord, SweepColumn};

/// Ways to write 1/s in a name. An angular frequency in it is one in rad/s.
const PER_SECOND: [&str; 4] = ["1/s", "s-1", "s^-1", "s⁻¹"];
/// Signs in a bracket for the unit of a plain number.
const PLAIN: [&str; 4] = ["", "-", "–", "1"];
/// Words in the names of moduli that are relative to a value.
const NORMALISED: [&str; 6] = ["normalis", "normaliz", "normiert", "normé", "relativ", "dimensionless"];
/// Subscripts of the modulus by which others are divided.
const OF_REFERENCE: [&str; 9] = ["e", "n", "max", "min", "_max", "_min", "ref", "_ref", "plateau"];
/// Words and symbols in the names of moduli of an oscillation.
const OF_OSCILLATION: [&str; 9] = ["modul", "storage", "loss", "g'", "g′", "g″", "g\"", "e'", "e″"];
/// Words by which a column of viscosities is recognised.
pub(super) const VISCOSITY: [&str; 5] = ["viscosity", "viskosität", "viscosité", "viscosidad", "viscosità"];

/// Columns that are called moduli of an oscillation, whether or not their names are known.
pub(super) fn called_moduli(looked: &InspectedTable) -> impl Iterator<Item = usize> {
    let names = looked.columns.iter().enumerate();
    names.filter(|(_, name)| called(name, &OF_OSCILLATION, &["tan", "factor", "faktor"])).map(|(place, _)| place)
}

/// Refuses columns of viscosities or compliances of an oscillation in place of its moduli, by their names and units.
///
/// # Errors
/// [`Error::Input`] for the first kind of which `fewest` of the columns are, with the equations of the moduli.
pub(super) fn refuse_other_than_moduli(
    place: &Path,
    looked: &InspectedTable,
    columns: &[usize],
    fewest: usize,
) -> Result<()> {
    let kinds = [
        (is_viscosity as fn(&str) -> bool, "viscosities", "G' = ω η'' and G'' = ω η', with ω in rad/s,"),
        (is_compliance, "compliances", "G' = J'/(J'² + J''²) and G'' = J''/(J'² + J''²)"),
    ];
    for (is_kind, kind, equations) in kinds {
        let names = columns.iter().map(|column| &looked.columns[*column]).filter(|name| is_kind(name));
        let names: Vec<String> = names.map(|name| format!("`{name}`")).collect();
        if names.len() >= fewest {
            return Err(Error::input(
                InputPlace::file(place),
                format!("by name or unit these columns hold {kind}, not moduli: {}", names.join(", ")),
                format!("write the moduli {equations} into columns with the names `G' [Pa]` and `G'' [Pa]`"),
            ));
        }
    }
    Ok(())
}

/// True if a column's name is that of viscosities: it says so, or has their symbol or unit.
fn is_viscosity(name: &str) -> bool {
    let is_unit = |text: &str| text.contains("Pa") && text.trim_end().ends_with('s');
    called(name, &VISCOSITY, &[])
        || ["eta", "Eta", "η"].iter().any(|symbol| has_symbol(name, symbol))
        || bracketed(name).is_some_and(|(_, text)| is_unit(text))
}

/// True if a column's name is that of compliances: it says so, or has their symbol or unit.
fn is_compliance(name: &str) -> bool {
    let is_unit = |text: &str| ["/Pa", "/kPa", "/MPa", "Pa^-1", "Pa⁻¹", "Pa-1"].iter().any(|end| text.contains(end));
    called(name, &COMPLIANCE, &[]) || has_symbol(name, "J") || bracketed(name).is_some_and(|(_, text)| is_unit(text))
}

/// Refuses moduli that are relative to a value, by their names and units. The user may give this value as their unit, as in `250 Pa`.
///
/// # Errors
/// [`Error::Input`] for the first such column.
pub(super) fn refuse_relative_moduli(
    place: &Path,
    looked: &InspectedTable,
    given: &TableSettings,
    columns: impl IntoIterator<Item = usize>,
) -> Result<()> {
    let has_value = given.sweep_units[1].as_deref().is_some_and(|told| told.starts_with(|c: char| c.is_ascii_digit()));
    let relative =
        columns.into_iter().find(|column| is_relative(&looked.columns[*column], looked.units[*column].as_ref()));
    let Some(column) = relative.filter(|_| !has_value) else { return Ok(()) };
    Err(Error::input(
        InputPlace::file(place).at_key(looked.columns[column].as_str()),
        "by its name or unit this column is relative to a value, so that it shows no modulus",
        format!(
            "multiply it by that value, and name it as in `G' [Pa]`; or name the columns with `{} COLUMN COLUMN` and give the value as their unit, as in `{} \"250 Pa\"`",
            Setting::ModuliColumns,
            Setting::ModuliUnit
        ),
    ))
}

/// True if a modulus is relative to a value: its name says so, its unit is that of a ratio, or it is divided by another modulus, as in `G'/G0`. A reduced modulus in a unit of
/// pressure is one of a master curve.
fn is_relative(name: &str, unit: Option<&ParsedUnit>) -> bool {
    let is_of = |dimension: Dimension| unit.is_some_and(|unit| unit.dimension == dimension);
    let is_in_bracket = |text: &str| !text.is_empty() && PLAIN.contains(&text);
    let stem = bracketed(name).filter(|(_, text)| PLAIN.contains(text)).map_or(split_unit(name).0, |(stem, _)| stem);
    // Modulus behind the slash, as `G'0` or `|G*|_max`, of which the subscript remains.
    let is_modulus = |over: &str| {
        let over = over.trim().trim_start_matches(['|', '(']).to_lowercase();
        let subscript =
            over.strip_prefix(['g', 'e']).map(|rest| rest.trim_start_matches(['\'', '′', '"', '″', '*', '|']));
        subscript.is_some_and(|rest| !rest.contains(char::is_alphabetic) || OF_REFERENCE.contains(&rest))
    };
    is_of(Dimension::Ratio)
        || unit.is_none() && bracketed(name).is_some_and(|(_, text)| is_in_bracket(text.trim()))
        || called(name, &NORMALISED, &[])
        || called(name, &["reduced", "reduziert"], &[]) && !is_of(Dimension::Pressure)
        || stem.split_once('/').is_some_and(|(_, over)| is_modulus(over))
}

/// True if a bracket at the end of a loss tangent's name holds the sign of a plain number or the angle, as in `tan δ [-]` and `tan(delta)`.
fn is_plain_tangent(name: &str) -> bool {
    bracketed(name).is_none_or(|(stem, text)| {
        let is_angle = stem.trim_end().to_lowercase().ends_with("tan");
        is_angle || PLAIN.contains(&text.trim())
    })
}

/// Refuses a loss tangent in a unit other than a plain number or percent.
///
/// # Errors
/// [`Error::Input`] for such a column.
fn refuse_unit_of_tangent(place: &Path, looked: &InspectedTable, columns: &[(SweepColumn, usize)]) -> Result<()> {
    let Some((_, column)) = columns.iter().find(|(column, _)| *column == SweepColumn::LossTangent) else {
        return Ok(());
    };
    let name = &looked.columns[*column];
    let is_ratio = match &looked.units[*column] {
        Some(unit) => unit.dimension == Dimension::Ratio,
        None => is_plain_tangent(name),
    };
    if is_ratio {
        return Ok(());
    }
    Err(Error::input(
        InputPlace::file(place).at_key(name.as_str()),
        "the unit of this loss tangent is not known",
        "write plain numbers or percent into the table, and name the column `tan δ` or `tan δ (%)`",
    ))
}

/// Units of the columns, as the table states them. If it does not state all of them, the error asks the user to write them into the columns' names.
fn units_of(place: &Path, looked: &InspectedTable, columns: &[(SweepColumn, usize)]) -> Result<Vec<ParsedUnit>> {
    let found = |(column, place): &(SweepColumn, usize)| match &looked.units[*place] {
        None if *column == SweepColumn::LossTangent => Some(ParsedUnit::one()),
        stated => stated.clone(),
    };
    let missing: BTreeSet<String> = columns
        .iter()
        .filter(|column| found(column).is_none())
        .map(|(column, place)| {
            let name = &looked.columns[*place];
            match column.dimension() {
                Dimension::Frequency if is_angular(name) => format!("`{} rad/s`", Setting::FrequencyUnit),
                Dimension::Frequency => format!("`{0} Hz` or `{0} rad/s`", Setting::FrequencyUnit),
                // A bracket holds another unit, in place of which the right one is written.
                Dimension::Angle => {
                    let stem = bracketed(name).map_or(name.as_str(), |(stem, _)| stem.trim_end());
                    format!("the name `{stem} [deg]` or `{stem} [rad]`")
                }
                _ => format!("`{0} Pa` or `{0} kPa`", Setting::ModuliUnit),
            }
        })
        .collect();
    // Text in the bracket of a frequency that is no unit, or one of several.
    let unclear = columns.iter().find_map(|(column, place)| {
        let name = &looked.columns[*place];
        let text = bracketed(name).filter(|_| looked.units[*place].is_none())?.1.trim();
        (*column == SweepColumn::Frequency && !text.is_empty()).then(|| match PER_SECOND.contains(&text) {
            true => format!("`{name}` can be in Hz or in rad/s"),
            false => format!("the unit `{text}` of the frequency `{name}` is not known"),
        })
    });
    let cause = unclear
        .unwrap_or_else(|| "the table does not state all units of the oscillation, or states unknown ones".into());
    columns.iter().map(found).collect::<Option<_>>().ok_or_else(|| {
        Error::input(
            InputPlace::file(place),
            cause,
            format!("give them: {}", missing.into_iter().collect::<Vec<_>>().join("; ")),
        )
    })
}

/// The table with the units that the user gives, and with rad/s for an angular frequency in 1/s.
///
/// # Errors
/// [`Error::Input`] for a text that is no unit of the quantity.
pub(super) fn with_told_units(
    looked: &InspectedTable,
    given: &TableSettings,
    columns: &[(SweepColumn, usize)],
) -> Result<InspectedTable> {
    let mut looked = looked.clone();
    for (column, place) in columns {
        let (told, setting) = match column.dimension() {
            Dimension::Frequency => (&given.sweep_units[0], Setting::FrequencyUnit),
            Dimension::Pressure => (&given.sweep_units[1], Setting::ModuliUnit),
            _ => continue,
        };
        let Some(told) = told else {
            let name = &looked.columns[*place];
            if looked.units[*place].is_none() && is_angular(name) && PER_SECOND.iter().any(|text| name.contains(text)) {
                looked.units[*place] = unit("rad/s");
            }
            continue;
        };
        let stated = looked.units[*place].as_ref().filter(|unit| unit.dimension == Dimension::Time);
        if let Some(stated) = stated.filter(|_| *column == SweepColumn::Frequency) {
            return Err(Error::input(
                InputPlace::setting(setting),
                format!("`{}` is in {}: it holds periods, not frequencies", looked.columns[*place], stated.name),
                "write the frequencies 1/T of the periods T into the table",
            ));
        }
        looked.units[*place] =
            Some(unit(told).filter(|unit| unit.dimension == column.dimension()).ok_or_else(|| {
                let remedy = match column.dimension() {
                    Dimension::Frequency => "give `Hz`, `kHz`, `mHz`, `rad/s` or `1/min`",
                    _ => "give `Pa`, `kPa`, `MPa` or another unit of pressure",
                };
                Error::input(InputPlace::setting(setting), format!("`{told}` is no unit of this quantity"), remedy)
            })?);
    }
    Ok(looked)
}

/// True if a word of a column's name is a symbol with or without a sign, such as E or E′.
fn has_symbol(name: &str, symbol: &str) -> bool {
    let is_symbol = |word: &str| {
        let rest = word.trim_start_matches('|').strip_prefix(symbol);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['\'', '′', '″', '"', '`', '´', '*', '_']))
    };
    name.split([' ', '(', '[']).any(is_symbol)
}

/// True if the name of a column of moduli is of tension, compression or bending: it says so, or its symbol is E.
fn is_of_tension(name: &str) -> bool {
    called(name, &[&UNIAXIAL[..], &["flexur", "bending"]].concat(), &MULTIAXIAL) || has_symbol(name, "E")
}

/// True if the name of a column of moduli is of shear: it says so, or its symbol is G.
fn is_of_shear(name: &str) -> bool {
    called(name, &MULTIAXIAL, &[]) || has_symbol(name, "G")
}

/// Reason to read the phase with the other sign: it is negative in every row, and at most 90°, or the loss modulus or the loss tangent is. `None` if the signs are those of a passive
/// gel, or mixed.
fn opposite_phase(source: &TableSource, looked: &InspectedTable, columns: &[(SweepColumn, usize)]) -> Option<String> {
    let (kind, place) = *columns.get(2)?;
    let unit = looked.units[place].clone().unwrap_or_else(ParsedUnit::one);
    let values = numbers_of(&source.bytes, looked, [place]);
    let is_negative = |value: f64| value < 0.0 && (kind != SweepColumn::Phase || value >= -FRAC_PI_2);
    let is_opposite = !values.is_empty() && values.iter().all(|(_, [value])| is_negative(unit.to_si(*value)));
    is_opposite.then(|| {
        format!(
            "`{}` is negative in every row, and no passive gel has such a phase: the phase is read with the other sign, as −δ (phase_sign = \"-\")",
            looked.columns[place]
        )
    })
}

/// Remarks on the rows of an oscillation.
pub(super) fn remarks(sweep: &OscillationRecord) -> Vec<String> {
    let [lowest_hz, highest_hz] = sweep.range_hz().map(|hz| format_significant(hz, 2));
    let beyond = sweep.is_beyond_instruments().then(|| {
        format!(
            "the frequencies reach from {lowest_hz} to {highest_hz} Hz, as those of a master curve; of a direct measurement check their unit"
        )
    });
    let left_out = if sweep.n_zero == 1 { "1 row is".into() } else { format!("{} rows are", sweep.n_zero) };
    let zeros = (sweep.n_zero > 0)
        .then(|| format!("{left_out} left out, because frequency and moduli are 0: nothing was measured there"));
    beyond.into_iter().chain(zeros).collect()
}

/// Makes the text of `experiment.toml` for an oscillation, and the interpretation of the table.
pub(super) fn describe_sweep(
    source: &TableSource,
    id: Option<&str>,
    poisson_ratio: Option<f64>,
    looked: &InspectedTable,
    columns: &[(SweepColumn, usize)],
) -> Result<(String, InitSummary)> {
    let stem = source.stem();
    let moduli: Vec<usize> = columns
        .iter()
        .filter(|(column, _)| column.dimension() == Dimension::Pressure)
        .map(|(_, place)| *place)
        .collect();
    refuse_other_than_moduli(&source.place, looked, &moduli, 1)?;
    refuse_unit_of_tangent(&source.place, looked, columns)?;
    let units = units_of(&source.place, looked, columns)?;
    let mut lines = String::from("# Description of the experiment: an oscillation of a rheometer.\n");
    let mut line = |key: &str, value, comment: &str| add_line(&mut lines, key, value, comment);
    line("\n[specimen]\nid", quoted(id.unwrap_or(&stem)), "name of the specimen");
    let poisson = poisson_ratio.unwrap_or(0.5);
    line("\n[rheometer]\npoisson_ratio", format!("{poisson:?}"), "of the specimen; 0.5 if it is nearly all water");
    line("\n[measurement]\nkind", quoted(OSCILLATION), "moduli over frequency");
    line("file", quoted(&source.name), "copy of the table, as text");
    line("source", quoted(&source.origin), "origin of the table; synthetic or measured");
    let names = || columns.iter().map(|(_, place)| looked.columns[*place].as_str());
    let is_named_young = names().any(is_of_tension);
    let uniaxial = Preamble(&looked.preamble).uniaxial_line().filter(|_| !names().any(is_of_shear));
    let is_young = is_named_young || uniaxial.is_some();
    let key = if is_young { "moduli" } else { "# moduli" };
    line(key, quoted("young"), "for moduli of tension, compression or bending");
    line("# heldout_hz", "[1.0]".into(), "frequencies that are not fitted; default: every third");
    let opposite = opposite_phase(source, looked, columns);
    if opposite.is_some() {
        line("phase_sign", quoted("-"), "the table counts the phase with the other sign");
    }
    let layout = &looked.layout;
    if !layout.row_lines.is_empty() {
        line("row_lines", format!("{:?}", layout.row_lines), "first and last line of the table");
    }
    line("delimiter", quoted(layout.delimiter.name()), "between cells");
    line("decimal", quoted(layout.decimal.name()), "before decimals");
    if let Some(encoding) = layout.encoding {
        line("encoding", quoted(encoding.name()), "of the text: utf-8, utf-16-le, utf-16-be or latin-1");
    }
    if let Some(header) = layout.header_line {
        line("header_line", header.to_string(), "line of the columns' names");
    }
    if layout.row_lines.is_empty() {
        line("first_row_line", layout.first_row_line.to_string(), "line of the first row");
    }
    let is_unique = |name: &String| looked.columns.iter().filter(|other| *other == name).count() == 1;
    for (index, (column, place)) in columns.iter().enumerate() {
        let key = format!("{}{}", if index == 0 { "\n[measurement.columns]\n" } else { "" }, column.key());
        let name = &looked.columns[*place];
        let value =
            if is_unique(name) && layout.header_line.is_some() { quoted(name) } else { (place + 1).to_string() };
        line(&key, value, "name in the header, or number from 1");
    }
    line(
        "# storage_sd",
        quoted("…"),
        "columns of errors, if the table has them: storage_sd and loss_sd, or modulus_sd and phase_sd",
    );
    // A plain number needs no unit.
    let with_units = columns.iter().zip(&units).filter(|(_, unit)| **unit != ParsedUnit::one());
    for (index, ((column, _), unit)) in with_units.enumerate() {
        let key = format!("{}{}", if index == 0 { "\n[measurement.units]\n" } else { "" }, column.key());
        let known = match column.dimension() {
            Dimension::Frequency => "Hz or rad/s",
            Dimension::Angle => "deg or rad",
            Dimension::Ratio => "1 or %",
            _ => "Pa, kPa, MPa or mPa",
        };
        line(&key, quoted(&unit.name), known);
    }
    let because =
        uniaxial.filter(|_| !is_named_young).map(|line| format!(", because a line above the table is `{line}`"));
    let reason = match is_young {
        true => format!(
            "frequencies and moduli of tension: an oscillation; moduli are divided by 2 + 2ν (`moduli = \"young\"`){}",
            because.unwrap_or_default()
        ),
        false => "frequencies and shear moduli: an oscillation of a rheometer (write `moduli = \"young\"` for tension)"
            .into(),
    };
    // Equal names are told apart by number.
    let named = |place: usize| {
        let name = &looked.columns[place];
        match name.as_str() {
            "" => format!("column {}", place + 1),
            _ if is_unique(name) => name.clone(),
            _ => format!("column {}: {name}", place + 1),
        }
    };
    let shown = |((column, place), unit): (&(SweepColumn, usize), &ParsedUnit)| InitColumn {
        role: column.key().into(),
        name: named(*place),
        unit: unit.name.clone(),
        range: None,
    };
    let is_used = |place: usize| columns.iter().any(|(_, used)| *used == place);
    // Under a header, a column without a name holds nothing.
    let is_shown = |place: usize| layout.header_line.is_none() || !looked.columns[place].is_empty();
    let others = (0..looked.columns.len()).filter(|place| !is_used(*place) && is_shown(*place));
    let summary = InitSummary {
        experiments: Vec::new(),
        directory: String::new(),
        file: source.name.clone(),
        reasons: [looked.said.clone(), reason].into_iter().chain(opposite).collect(),
        columns: columns.iter().zip(&units).map(shown).collect(),
        others: others.map(named).collect(),
        rows: 0,
        rows_without_position: 0,
        unknown: Vec::new(),
    };
    Ok((lines, summary))
}

#[cfg(test)]
#[path = "sweep_tests.rs"]
mod tests;
