//! Looks at a table and says how it is written, and why it thinks so.

use std::borrow::Cow;
use std::path::Path;

use super::description::{ColumnName, TableDescription, TimeFormat, Zero};
use super::read::{read_described, rest_m, settle_zero};
use super::spelling::{Spelt, clock_s, iso_s, unit};
use super::text::{Decimal, Delimiter, cells, header_cells, is_aside};
use crate::error::{Error, Place, Result};
use crate::experiment::trajectory::{Trajectory, is_lost};
use crate::units::Dimension;

/// Lines that are looked at for the layout.
const LOOKED_AT: usize = 5_000;
/// Letters of a cell in a line of units.
const LONGEST_UNIT: usize = 8;
/// Share of the positions' range by which a record that starts at 0 may miss it.
const NEAR_ZERO: f64 = 0.02;

/// What the user says of a table; whatever is missing is found.
#[derive(Debug, Clone, Default)]
pub struct Given {
    /// Columns, by name or number.
    pub columns: [Option<String>; 4],
    /// Units of time, force and position.
    pub units: [Option<String>; 3],
}

/// A description, and what speaks for it.
#[derive(Debug, Clone)]
pub struct Proposal {
    /// The description.
    pub description: TableDescription,
    /// Names of all columns, empty where there is no header.
    pub columns: Vec<String>,
    /// In words, one sentence each.
    pub reasons: Vec<String>,
    /// Number of rows.
    pub n_rows: usize,
    /// Rows without a position.
    pub n_lost: usize,
    /// Length of the record, in s.
    pub duration_s: f64,
    /// Smallest and largest force, in N.
    pub force_n: [f64; 2],
    /// Smallest and largest position from where it is 0, in m.
    pub position_m: [f64; 2],
}

/// What a column is for; in the order of [`Given::columns`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Role {
    Time,
    Force,
    Position,
    Cycle,
}

impl Role {
    const ALL: [Self; 4] = [Self::Time, Self::Force, Self::Position, Self::Cycle];

    fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Force => "force",
            Self::Position => "position",
            Self::Cycle => "cycle",
        }
    }

    /// An example of the option that says its unit.
    fn unit_option(self) -> String {
        let unit = match self {
            Self::Time => "s",
            Self::Force => "uN",
            Self::Position | Self::Cycle => "um",
        };
        format!("--{}-unit {unit}", self.name())
    }

    fn dimension(self) -> Option<Dimension> {
        match self {
            Self::Time => Some(Dimension::Time),
            Self::Force => Some(Dimension::Force),
            Self::Position => Some(Dimension::Length),
            Self::Cycle => None,
        }
    }

    /// Names that are this and nothing else, and parts of names that suggest it.
    fn words(self) -> (&'static [&'static str], &'static [&'static str]) {
        match self {
            Self::Time => (&["t", "time", "zeit", "temps", "timestamp", "elapsed"], &["time", "zeit", "elapsed"]),
            Self::Force => (&["f", "force", "kraft", "fx", "load"], &["force", "kraft"]),
            Self::Position => {
                (&["x", "position", "pos", "displacement", "weg"], &["position", "displac", "auslenk", "posx", "xpos"])
            }
            Self::Cycle => (&["cycle", "zyklus", "cyc"], &["cycle", "zyklus"]),
        }
    }
}

/// The rows of a table, and between what its cells stand.
struct Layout {
    delimiter: Delimiter,
    decimal: Decimal,
    /// Index of the first row's line.
    first: usize,
    n_cells: usize,
}

fn is_value(cell: &str, decimal: Decimal) -> bool {
    decimal.number(cell).is_some() || clock_s(cell).is_some() || iso_s(cell).is_some()
}

/// The layout in which most cells of one block of lines are numbers or times.
fn layout(lines: &[&str]) -> Option<Layout> {
    let mut best: Option<(i64, Layout)> = None;
    for delimiter in Delimiter::ALL {
        for decimal in Decimal::ALL {
            if (delimiter, decimal) == (Delimiter::Comma, Decimal::Comma) {
                continue;
            }
            let mut run: Option<(i64, Layout)> = None;
            let mut finish = |run: &mut Option<(i64, Layout)>| {
                if let Some((score, layout)) = run.take()
                    && best.as_ref().is_none_or(|(most, _)| score > *most)
                {
                    best = Some((score, layout));
                }
            };
            for (index, line) in lines.iter().enumerate().filter(|(_, line)| !is_aside(line)) {
                let cells = cells(line, delimiter);
                let n_values = cells.iter().filter(|cell| is_value(cell, decimal)).count() as i64;
                let n_others = cells.iter().filter(|cell| !is_value(cell, decimal) && !is_lost(cell)).count() as i64;
                if n_values < 2 || n_values < n_others {
                    finish(&mut run);
                    continue;
                }
                if run.as_ref().is_some_and(|(_, layout)| layout.n_cells != cells.len()) {
                    finish(&mut run);
                }
                let fresh = Layout { delimiter, decimal, first: index, n_cells: cells.len() };
                run.get_or_insert((0, fresh)).0 += n_values - n_others;
            }
            finish(&mut run);
        }
    }
    best.map(|(_, layout)| layout)
}

/// The header's line, its names and the units beneath them.
#[derive(Default)]
struct Header {
    line: Option<usize>,
    names: Vec<String>,
    units: Vec<Option<Spelt>>,
    /// Columns whose unit is none of ours: a temperature, a voltage.
    foreign: Vec<usize>,
}

/// A line's cells as names, if it has as many as the rows have and two of them are words.
fn names_in(line: &str, layout: &Layout) -> Option<Vec<String>> {
    let found: Vec<String> = header_cells(line, layout.delimiter).into_iter().map(Cow::into_owned).collect();
    let n_words = found.iter().filter(|cell| !cell.is_empty() && !is_value(cell, layout.decimal)).count();
    (found.len() == layout.n_cells && n_words >= 2).then_some(found)
}

fn header(lines: &[&str], layout: &Layout) -> Header {
    let above: Vec<usize> = (0..layout.first).rev().filter(|index| !lines[*index].trim().is_empty()).take(2).collect();
    let names = |place: usize| above.get(place).and_then(|index| Some((*index, names_in(lines[*index], layout)?)));
    let Some((line, nearest)) = names(0) else { return Header::default() };
    let units: Vec<Option<Spelt>> = nearest.iter().map(|cell| unit(cell)).collect();
    // A line of units may have some that are none of ours, such as °C.
    if let Some((line, names)) = names(1)
        && units.iter().flatten().count() >= 2
        && nearest.iter().all(|cell| cell.chars().count() <= LONGEST_UNIT)
    {
        let is_foreign = |at: &usize| units[*at].is_none() && nearest[*at].chars().any(char::is_alphabetic);
        let foreign = (0..units.len()).filter(is_foreign).collect();
        return Header { line: Some(line), names, units, foreign };
    }
    let units = nearest.iter().map(|name| split_unit(name).1).collect();
    Header { line: Some(line), names: nearest, units, foreign: Vec::new() }
}

/// A name and the unit in it: `x [µm]`, `x (µm)`, `x/µm`, `x_um`, `x in µm`.
fn split_unit(name: &str) -> (&str, Option<Spelt>) {
    let bracketed = name.trim_end().strip_suffix([']', ')']).and_then(|open| open.rsplit_once(['[', '(']));
    let others = ["/", " in ", "_", " "].iter().filter_map(|joint| name.rsplit_once(joint));
    let found = bracketed.into_iter().chain(others).find_map(|(stem, text)| Some((stem, unit(text)?)));
    found.map_or((name, None), |(stem, unit)| (stem, Some(unit)))
}

/// How well a column fits a role; `None` where its unit speaks against it.
fn fit(role: Role, name: &str, unit: Option<&Spelt>) -> Option<u32> {
    let plain: String = split_unit(name).0.to_lowercase().chars().filter(|c| c.is_alphanumeric()).collect();
    let (exact, parts) = role.words();
    let by_name = match plain.as_str() {
        plain if exact.contains(&plain) => 4,
        plain if parts.iter().any(|part| plain.contains(part)) => 2,
        _ => 0,
    };
    let by_unit = match (role.dimension(), unit) {
        (Some(wanted), Some(unit)) if unit.dimension == wanted => 1,
        (_, Some(_)) => return None,
        _ => 0,
    };
    // A unit alone says what is measured, not what of.
    Some(by_name + by_unit)
}

/// Finds how a table is written; `file` is only named in errors.
///
/// # Errors
/// [`Error::Input`] where no block of numbers is found, where a column or a unit cannot be told, and what reading the table so refuses; with the option that helps.
pub fn propose(file: &Path, text: &str, given: &Given) -> Result<Proposal> {
    let lines: Vec<&str> = text.lines().take(LOOKED_AT).collect();
    let layout = layout(&lines).ok_or_else(|| {
        Error::input(
            Place::file(file),
            "no two columns of numbers are found",
            "export the table as text: one sample a line, cells between commas, semicolons, tabulators or blanks",
        )
    })?;
    let header = header(&lines, &layout);
    let mut reasons = vec![said_of(&layout, &header, &lines)];
    let mut columns: [Option<usize>; 4] = [None; 4];
    for role in Role::ALL {
        columns[role as usize] = column(file, role, given, &header, &layout, &columns)?;
    }
    let first_row = cells(lines[layout.first], layout.delimiter);
    let cell = |role: Role| columns[role as usize].and_then(|at| first_row.get(at)).map_or("", |cell| cell.as_ref());
    let own_unit = |role: Role| columns[role as usize].and_then(|at| header.units.get(at).cloned().flatten());
    let told = |role: Role| given.units[role as usize].as_deref();
    let has_form = |role: Role| {
        let cell = cell(role);
        role == Role::Time && (clock_s(cell).is_some() || iso_s(cell).is_some())
    };
    let missing: Vec<Role> = [Role::Time, Role::Force, Role::Position]
        .into_iter()
        .filter(|role| told(*role).is_none() && own_unit(*role).is_none() && !has_form(*role))
        .collect();
    if let Some(first) = missing.first() {
        let names: Vec<&str> = missing.iter().map(|role| role.name()).collect();
        let options: Vec<String> = missing.iter().map(|role| role.unit_option()).collect();
        return Err(Error::input(
            Place::option(format!("--{}-unit", first.name())),
            format!("{}: the table does not say the unit of {}", file.display(), names.join(" and ")),
            format!("say it, as in `{}`", options.join(" ")),
        ));
    }
    let unit_of = |role: Role| -> Result<Spelt> {
        let found = told(role).map_or_else(|| own_unit(role), unit);
        found.filter(|unit| Some(unit.dimension) == role.dimension()).ok_or_else(|| {
            let found = format!("`{}` is no unit of a {}", told(role).unwrap_or_default(), role.name());
            let remedy = format!("say it, as in `{}`", role.unit_option());
            Error::input(Place::option(format!("--{}-unit", role.name())), found, remedy)
        })
    };
    let time_format = match given.units[0].as_deref() {
        Some("clock") => TimeFormat::Clock,
        Some("iso") => TimeFormat::Iso,
        None if iso_s(cell(Role::Time)).is_some() => TimeFormat::Iso,
        None if clock_s(cell(Role::Time)).is_some() => TimeFormat::Clock,
        _ => TimeFormat::Unit(unit_of(Role::Time)?),
    };
    let name = |role: Role| -> Option<ColumnName> {
        let at = columns[role as usize]?;
        Some(match header.names.get(at) {
            Some(name) if header.names.iter().filter(|other| *other == name).count() == 1 && !name.is_empty() => {
                ColumnName::Named(name.clone())
            }
            _ => ColumnName::Number(at + 1),
        })
    };
    let wanted = |role: Role| name(role).unwrap_or(ColumnName::Number(1));
    let mut description = TableDescription {
        delimiter: layout.delimiter,
        decimal: layout.decimal,
        header_line: header.line.map(|index| index + 1),
        first_row_line: layout.first + 1,
        time: (wanted(Role::Time), time_format),
        force: (wanted(Role::Force), unit_of(Role::Force)?),
        position: (wanted(Role::Position), unit_of(Role::Position)?),
        cycle: name(Role::Cycle),
        zero: Zero::AsWritten,
        is_reversed: false,
    };
    let mut trajectory = read_described(file, text, &description)?;
    (description.zero, description.is_reversed) = zero_and_direction(&trajectory, &mut reasons);
    settle_zero(file, &mut trajectory, &description)?;
    let ends = |values: &mut dyn Iterator<Item = f64>| {
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
    };
    Ok(Proposal {
        columns: header.names,
        reasons,
        n_rows: trajectory.time_s.len(),
        n_lost: trajectory.position_m.iter().filter(|x| x.is_none()).count(),
        duration_s: trajectory.time_s.last().zip(trajectory.time_s.first()).map_or(0.0, |(last, first)| last - first),
        force_n: ends(&mut trajectory.force_n.iter().copied()),
        position_m: ends(&mut trajectory.position_m.iter().flatten().copied()),
        description,
    })
}

fn said_of(layout: &Layout, header: &Header, lines: &[&str]) -> String {
    let between = match layout.delimiter {
        Delimiter::Comma => "commas",
        Delimiter::Semicolon => "semicolons",
        Delimiter::Tab => "tabulators",
        Delimiter::Spaces => "blanks",
    };
    let decimals = if layout.decimal == Decimal::Comma { ", decimal commas" } else { "" };
    let named = match header.line {
        Some(index) => format!("names in line {}", index + 1),
        None => "no names".into(),
    };
    let skipped = lines[..layout.first].iter().filter(|line| !line.trim().is_empty()).count();
    let above = if skipped > usize::from(header.line.is_some()) {
        format!(", {skipped} lines above the first row")
    } else {
        String::new()
    };
    format!("{} columns between {between}{decimals}, {named}{above}", layout.n_cells)
}

/// The column of a role: the one that is given, or the one that fits best.
fn column(
    file: &Path,
    role: Role,
    given: &Given,
    header: &Header,
    layout: &Layout,
    taken: &[Option<usize>; 4],
) -> Result<Option<usize>> {
    let option = || Place::option(format!("--{}", role.name()));
    let listed = || {
        if header.names.is_empty() {
            return format!("columns are counted from 1 to {}", layout.n_cells);
        }
        let names: Vec<String> = header.names.iter().map(|name| format!("`{name}`")).collect();
        format!("the columns are {}", names.join(", "))
    };
    if let Some(told) = &given.columns[role as usize] {
        let by_name = header.names.iter().position(|name| name == told);
        let by_number = || told.parse::<usize>().ok().filter(|n| (1..=layout.n_cells).contains(n)).map(|n| n - 1);
        return by_name.or_else(by_number).map(Some).ok_or_else(|| {
            Error::input(
                option(),
                format!("there is no column `{told}`"),
                format!("{}; give a name or a number", listed()),
            )
        });
    }
    let free = (0..header.names.len()).filter(|at| !taken.contains(&Some(*at)) && !header.foreign.contains(at));
    let mut fits: Vec<(u32, usize)> =
        free.filter_map(|at| Some((fit(role, &header.names[at], header.units[at].as_ref())?, at))).collect();
    fits.retain(|(fit, _)| *fit > u32::from(role == Role::Cycle));
    fits.sort_by_key(|(fit, at)| (std::cmp::Reverse(*fit), *at));
    match fits.as_slice() {
        [] if role == Role::Cycle => Ok(None),
        [(best, at), rest @ ..] if rest.first().is_none_or(|(second, _)| second < best) => Ok(Some(*at)),
        [] => Err(Error::input(
            option(),
            format!("{}: no column is called as a {} is", file.display(), role.name()),
            format!("say which it is with `--{} NAME` or its number; {}", role.name(), listed()),
        )),
        _ => Err(Error::input(
            option(),
            format!("{}: several columns may be the {}", file.display(), role.name()),
            format!("say which it is with `--{} NAME` or its number; {}", role.name(), listed()),
        )),
    }
}

/// Where the position is 0 and which way it grows, with the reasons.
fn zero_and_direction(trajectory: &Trajectory, reasons: &mut Vec<String>) -> (Zero, bool) {
    let Trajectory { force_n, position_m, .. } = trajectory;
    let known = || position_m.iter().flatten().copied();
    let range_m = known().fold(f64::NEG_INFINITY, f64::max) - known().fold(f64::INFINITY, f64::min);
    let um = |m: f64| format!("{:.3} µm", 1e6 * m);
    let zero = match (rest_m(trajectory), position_m.first().copied().flatten()) {
        (Some(rest_m), _) if rest_m.abs() > NEAR_ZERO * range_m => {
            reasons.push(format!(
                "the position is {} before the force acts, and counts from there (zero = \"rest\")",
                um(rest_m)
            ));
            Zero::Rest
        }
        (None, Some(first_m)) if first_m.abs() > NEAR_ZERO * range_m => {
            reasons.push(format!(
                "the first position is {}, and positions count from there (zero = \"first\")",
                um(first_m)
            ));
            Zero::First
        }
        _ => Zero::AsWritten,
    };
    // Work of the force on the way to the next row: negative throughout if the position grows the other way.
    let moved = position_m.windows(2).zip(force_n).filter_map(|(pair, force)| Some((pair[1]? - pair[0]?, *force)));
    let (work, size) =
        moved.fold((0.0, 0.0), |(work, size), (way, force)| (work + way * force, size + (way * force).abs()));
    let is_reversed = work < -0.2 * size && work < 0.0;
    if is_reversed {
        reasons.push("the position grows against the force, so that its sign is turned (direction = \"-\")".into());
    }
    (zero, is_reversed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_stand_in_names_in_many_ways() {
        for name in ["x [µm]", "x (um)", "x/µm", "x_um", "x in µm", "x µm"] {
            let (stem, unit) = split_unit(name);
            assert_eq!((stem.trim(), unit.map(|unit| unit.name)), ("x", Some("um".into())), "{name}");
        }
        assert_eq!(split_unit("cycle").1, None);
        assert_eq!(split_unit("position").1, None);
    }

    #[test]
    fn what_cannot_be_told_is_asked_for() {
        let refused = |text: &str| propose(Path::new("t.csv"), text, &Given::default()).unwrap_err().to_string();
        let rows = "0,1,0\n1,1,2\n2,1,3\n";
        assert!(refused(rows).contains("--time"));
        assert!(refused(&format!("t,F,x\n{rows}")).contains("--time-unit s --force-unit uN --position-unit um"));
        assert!(refused(&format!("t [s],F [V],x [um]\n{rows}")).contains("--force"));
        let two = refused("t [s],F [uN],position a [um],position b [um]\n0,1,0,0\n1,1,2,2\n");
        assert!(two.contains("several columns may be the position"), "{two}");
        assert!(refused("nothing\nhere\n").contains("no two columns"));
    }
}
