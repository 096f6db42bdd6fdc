//! Assignment of a table's columns to the roles time, force, position and cycle.

use std::path::Path;

use super::asked::{Ask, Question, TableSettings};
use super::blocks::Header;
use super::description::TimeFormat;
use super::spelling::{ParsedUnit, bracketed, counted, split_unit, unit};
use base::error::{Error, InputPlace, Result, Setting};
use base::units::Dimension;

/// Words in the names of columns of a torque.
const TORQUE: [&str; 2] = ["torque", "drehmoment"];

/// Words of a force that no body feels at the time: a limit or a range of the drive, or a number of a whole cycle.
const NO_COURSE: [&str; 11] =
    ["max", "maximum", "maximal", "min", "minimum", "limit", "rated", "nominal", "amplitude", "fullscale", "range"];

base::named_enum! {
    /// Role of a column. The order is that of [`TableSettings::columns`].
    pub(super) enum Role {
        Time = "time",
        Force = "force",
        Position = "position",
        Cycle = "cycle",
    }
    pub fn name
}

impl Role {
    /// Setting with which the user selects the column of this role.
    fn column_setting(self) -> Setting {
        match self {
            Self::Time => Setting::TimeColumn,
            Self::Force => Setting::ForceColumn,
            Self::Position => Setting::PositionColumn,
            Self::Cycle => Setting::CycleColumn,
        }
    }

    /// Setting with which the user gives the unit of this role's column. A cycle has no unit.
    pub fn unit_setting(self) -> Setting {
        match self {
            Self::Time => Setting::TimeUnit,
            Self::Force => Setting::ForceUnit,
            Self::Position | Self::Cycle => Setting::PositionUnit,
        }
    }

    /// Returns an example of the setting that gives the unit of the column `column`, for messages.
    pub fn unit_option(self, column: &str) -> String {
        let unit = match (self, counted(column)) {
            (Self::Time, None) => "s",
            (Self::Time, Some(_)) => "\"0.05 s\"",
            (Self::Force, _) => "uN",
            (Self::Position | Self::Cycle, None) => "um",
            (Self::Position | Self::Cycle, Some(_)) => "\"0.65 um\"",
        };
        format!("{} {unit}", self.unit_setting())
    }

    /// Returns an example of the setting that gives a unit as a multiple of a known one, for messages.
    pub fn multiple_option(self) -> String {
        let unit = match self {
            Self::Time => "0.05 s",
            Self::Force => "9.81 mN",
            Self::Position | Self::Cycle => "25.4 mm",
        };
        format!("{} \"{unit}\"", self.unit_setting())
    }

    fn unit_question(self) -> Question {
        let (choices, proposal) = match self {
            Self::Time => ("s, ms, us, min, h, clock, iso", "s"),
            Self::Force => ("N, mN, uN, nN, pN", "uN"),
            Self::Position | Self::Cycle => ("m, mm, um, nm", "um"),
        };
        Question {
            text: format!("unit of the {} ({choices}, or a multiple as in `0.65 um`)", self.name()),
            choices: Vec::new(),
            also: Vec::new(),
            proposal: Some(proposal.into()),
        }
    }

    /// Asks the user for the unit of this role's column until the answer is such a unit. Returns `None` without an answer.
    pub fn ask_unit(self, ask: Ask<'_>) -> Option<String> {
        let mut question = self.unit_question();
        loop {
            let answer = ask(&question)?;
            let is_format = self == Self::Time && TimeFormat::named(&answer).is_some();
            if is_format || unit(&answer).is_some_and(|unit| Some(unit.dimension) == self.dimension()) {
                return Some(answer);
            }
            let text = format!("`{answer}` is not a unit of {}; {}", self.name(), self.unit_question().text);
            // A repeated answer comes from a program, so the questions must end.
            if text == question.text {
                return None;
            }
            question.text = text;
        }
    }

    pub fn dimension(self) -> Option<Dimension> {
        match self {
            Self::Time => Some(Dimension::Time),
            Self::Force => Some(Dimension::Force),
            Self::Position => Some(Dimension::Length),
            Self::Cycle => None,
        }
    }

    /// Names of columns that belong to this role alone, and parts of names that suggest the role.
    fn words(self) -> (&'static [&'static str], &'static [&'static str]) {
        match self {
            Self::Time => (
                &[
                    "t",
                    "time",
                    "zeit",
                    "temps",
                    "tiempo",
                    "tempo",
                    "tijd",
                    "время",
                    "時間",
                    "时间",
                    "timestamp",
                    "elapsed",
                    "xvalue",
                    "date",
                    "datetime",
                    "datum",
                    "clock",
                    "uhrzeit",
                ],
                &["time", "zeit", "elapsed", "frame", "temps", "tiempo", "время", "時間", "时间"],
            ),
            Self::Force => (
                &["f", "fx", "force", "kraft", "fuerza", "forza", "força", "kracht", "сила", "荷重", "力", "load"],
                &["force", "kraft", "fuerza", "forza", "força", "kracht", "сила", "荷重", "力"],
            ),
            Self::Position => (
                &["x", "position", "pos", "displacement", "disp", "weg", "travel", "standardtravel"],
                &[
                    "position",
                    "displac",
                    "déplac",
                    "deplac",
                    "auslenk",
                    "posx",
                    "xpos",
                    "xcoord",
                    "desplaz",
                    "posición",
                    "spostam",
                    "posizione",
                    "deslocam",
                    "posição",
                    "verplaats",
                    "перемещ",
                    "смещен",
                    "変位",
                    "位移",
                    "位置",
                    "indentation",
                ],
            ),
            Self::Cycle => (&["cycle", "zyklus", "cyc"], &["cycle", "zyklus"]),
        }
    }
}

/// Columns that belong to the time in column `time`. Of samples side by side, whose names repeat, they are those of one sample and those beside all samples; otherwise all.
pub fn columns_beside(names: &[String], time: usize) -> Vec<usize> {
    let all = || (0..names.len()).collect();
    let is_like = |at: &usize| names.get(time).is_some_and(|name| !name.is_empty() && names[*at] == *name);
    let times: Vec<usize> = (0..names.len()).filter(is_like).collect();
    let [first, second, ..] = times[..] else { return all() };
    let period = second - first;
    if period < 2 || times.windows(2).any(|pair| pair[1] - pair[0] != period) {
        return all();
    }
    // The time need not be the first column of its sample.
    let repeats = |start: usize| {
        // Empty columns between the samples are missing behind the last one.
        let name = |at: usize| names.get(at).map_or("", String::as_str);
        (start + period..start + times.len() * period).all(|at| name(at) == name(at - period))
    };
    let Some(start) = (0..=first).rev().take(period).find(|start| repeats(*start)) else { return all() };
    let own = start + (time - start) / period * period;
    let is_of_other =
        |at: usize| (start..start + times.len() * period).contains(&at) && !(own..own + period).contains(&at);
    (0..names.len()).filter(|at| !is_of_other(*at)).collect()
}

/// Returns the score of a column for a role, which is higher the more likely the column has the role. `None` if the column's unit contradicts the
/// role.
fn fit(role: Role, name: &str, unit: Option<&ParsedUnit>) -> Option<u32> {
    let stem = match counted(name) {
        Some((stem, _)) => stem,
        // A letter alone, as in `T (°C)`, may be another quantity.
        None => match unknown_unit(name) {
            Some((stem, _)) if stem.chars().count() > 2 => stem,
            _ => split_unit(name).0,
        },
    };
    let plain: String = stem.to_lowercase().chars().filter(|c| c.is_alphanumeric()).collect();
    let (exact, parts) = role.words();
    let by_name: u32 = match plain.as_str() {
        plain if exact.contains(&plain) => 4,
        plain if parts.iter().any(|part| plain.contains(part)) => 2,
        _ => 0,
    };
    // A rate, as in `Load at 5 mm/min`, is no minimum.
    let words =
        stem.to_lowercase().replace("full-scale", "fullscale").replace("full scale", "fullscale").replace("/min", "");
    let is_no_course =
        role == Role::Force && words.split(|c: char| !c.is_alphabetic()).any(|word| NO_COURSE.contains(&word));
    if is_no_course {
        return None;
    }
    let by_unit = match (role.dimension(), unit) {
        (Some(wanted), Some(unit)) if unit.dimension == wanted => 1,
        (_, Some(_)) => return None,
        _ => 0,
    };
    // A test has its own clock, beside which exports may show the clock of a whole sequence.
    let is_of_sequence = role == Role::Time && ["sequence", "total", "global"].iter().any(|part| plain.contains(part));
    // The clock of a cycle starts again in the next one.
    let is_of_cycle = role == Role::Time && ["cycle", "zyklus"].iter().any(|part| plain.contains(part));
    // A unit counts less than a name, because it shows the quantity but not the body that has it.
    Some((by_name + by_unit).saturating_sub(u32::from(is_of_sequence) + 2 * u32::from(is_of_cycle)))
}

/// Splits a column name with a unit in brackets that is not known, such as `Force (ozf)`, into the name and that text. `None` for other names.
pub(super) fn unknown_unit(name: &str) -> Option<(&str, &str)> {
    let (stem, text) = bracketed(name)?;
    (split_unit(name).1.is_none() && counted(name).is_none()).then_some((stem.trim(), text.trim()))
}

/// Columns of a table that were found for a role.
pub(super) enum ColumnMatch {
    Missing,
    Single(usize),
    Axes(Vec<usize>),
}

/// Names and units of a table's columns, with the settings that the user gives.
pub(super) struct KnownColumns<'a> {
    pub file: &'a Path,
    pub given: &'a TableSettings,
    pub header: &'a Header,
    pub n_cells: usize,
    /// Number of columns that hold values in any row.
    pub n_filled: usize,
}

/// Answer to the question for the column of cycles that tells that there is none.
const NO_CYCLES: &str = "none";

/// Columns of a table, for messages.
pub(crate) fn listed_columns(names: &[String], n_cells: usize) -> String {
    if names.iter().all(String::is_empty) {
        return format!("columns are counted from 1 to {n_cells}");
    }
    let names: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    format!("the columns are {}", names.join(", "))
}

/// Returns the index of the column that the user gives for a setting. `told` is the column's name or its number from 1.
///
/// # Errors
/// [`Error::Input`] if there is no such column, or if several columns have the name.
pub(crate) fn told_column(names: &[String], n_cells: usize, setting: Setting, told: &str) -> Result<usize> {
    let refuse = |found: String, remedy: String| Err(Error::input(InputPlace::setting(setting), found, remedy));
    let named: Vec<usize> = (0..names.len()).filter(|at| names[*at] == told).collect();
    let number = told.parse::<usize>().ok().filter(|number| (1..=n_cells).contains(number));
    match (&named[..], number) {
        ([at], _) => Ok(*at),
        ([], Some(number)) => Ok(number - 1),
        ([], None) => refuse(
            format!("there is no column `{told}`"),
            format!("{}; give one of them or its number", listed_columns(names, n_cells)),
        ),
        (named, _) => refuse(
            format!("{} columns are called `{told}`", named.len()),
            "give the number of the right one, from 1 at the left".into(),
        ),
    }
}

impl KnownColumns<'_> {
    fn listed(&self) -> String {
        listed_columns(&self.header.names, self.n_cells)
    }

    /// Returns the index of the column that the user gives for a setting. `told` is the column's name or its number from 1.
    ///
    /// # Errors
    /// [`Error::Input`] if there is no such column.
    pub fn told(&self, setting: Setting, told: &str) -> Result<usize> {
        told_column(&self.header.names, self.n_cells, setting, told)
    }

    /// Returns the indices of the columns that the user gives for x and y, with or without z; `None` if the user gives none.
    fn given_axes(&self) -> Result<Option<Vec<usize>>> {
        let [x, y, position] = [Setting::XColumn, Setting::YColumn, Setting::PositionColumn];
        let one_way = format!("give either `{x}` and `{y}`, or only `{position}`");
        match (&self.given.axes, &self.given.columns[Role::Position as usize]) {
            ([None, None, None], _) => Ok(None),
            ([Some(x), Some(y), z], None) => {
                let mut axes = vec![self.told(Setting::XColumn, x)?, self.told(Setting::YColumn, y)?];
                if let Some(z) = z {
                    axes.push(self.told(Setting::ZColumn, z)?);
                }
                Ok(Some(axes))
            }
            ([x, ..], None) => {
                let missing = if x.is_none() { Setting::XColumn } else { Setting::YColumn };
                let found = "the columns of x and y must be given together";
                Err(Error::input(InputPlace::setting(missing), found, one_way))
            }
            (_, Some(_)) => {
                let found = "the position is given in addition to x and y";
                Err(Error::input(InputPlace::setting(Setting::PositionColumn), found, one_way))
            }
        }
    }

    /// Returns the index of the y or z column that belongs to the x column `at`. It has an equal unit, and an equal name with `letter` in place of x.
    /// It is one of `beside`. `None` if there is none.
    fn partner(&self, at: usize, letter: char, taken: &[usize], beside: &[usize]) -> Option<usize> {
        let (names, units) = (&self.header.names, &self.header.units);
        let name = names.get(at)?;
        let turned = name.char_indices().filter_map(|(place, of_name)| {
            let other = match of_name {
                'x' => letter,
                'X' => letter.to_ascii_uppercase(),
                _ => return None,
            };
            Some(format!("{}{other}{}", &name[..place], &name[place + 1..]))
        });
        let free = |other: &usize| *other != at && !taken.contains(other) && !self.header.foreign.contains(other);
        turned
            .filter_map(|turned| beside.iter().copied().find(|other| names[*other] == turned))
            .find(|other| free(other) && units.get(*other) == units.get(at))
    }

    /// Error for a table with too few columns for time, force and position.
    fn refuse_too_few_columns(&self, role: Role) -> Error {
        let has_names = self.header.names.iter().any(|name| !name.is_empty());
        let found = match has_names {
            true => format!("no column is the {}; {}", role.name(), self.listed()),
            false => format!(
                "the table has {} columns without names, and a record has a time, a force and a position",
                self.n_filled
            ),
        };
        let add = match role {
            Role::Force if has_names => {
                format!("add a column of the force, or name the file that contains it with `{}`; ", Setting::ForceFile)
            }
            Role::Position if has_names => {
                "add a column of the position, with a value in every row of a hold, too; ".into()
            }
            _ => String::new(),
        };
        let remedy = format!(
            "{add}for a modulus or a compliance over time write a first line with names, as in `time [s]` and `G(t) [Pa]` or `J(t) [1/Pa]`"
        );
        Error::input(InputPlace::file(self.file), found, remedy)
    }

    /// Finds the column of a role: the column that the user gives, otherwise the column with the best score, otherwise the user's answer to a
    /// question.
    pub fn column(&self, role: Role, taken: &[usize], ask: Ask<'_>) -> Result<ColumnMatch> {
        if role == Role::Position
            && let Some(axes) = self.given_axes()?
        {
            return Ok(ColumnMatch::Axes(axes));
        }
        let setting = role.column_setting();
        let header = self.header;
        if let Some(told) = &self.given.columns[role as usize] {
            if role == Role::Cycle && told == NO_CYCLES && !header.names.contains(told) {
                return Ok(ColumnMatch::Missing);
            }
            return self.told(setting, told).map(ColumnMatch::Single);
        }
        // The time is the first role.
        let beside = match taken.first() {
            Some(time) => columns_beside(&header.names, *time),
            None => (0..header.names.len()).collect(),
        };
        let free = beside.iter().copied().filter(|at| !taken.contains(at) && !header.foreign.contains(at));
        let mut fits: Vec<(u32, usize)> =
            free.filter_map(|at| Some((fit(role, &header.names[at], header.units[at].as_ref())?, at))).collect();
        fits.retain(|(fit, _)| *fit > u32::from(role == Role::Cycle));
        fits.sort_by_key(|(fit, at)| (std::cmp::Reverse(*fit), *at));
        let best: Vec<usize> = fits.iter().filter(|(fit, _)| *fit == fits[0].0).map(|(_, at)| *at).collect();
        if role == Role::Position {
            let axes = best.iter().find_map(|at| {
                let y = self.partner(*at, 'y', taken, &beside)?;
                Some([*at, y].into_iter().chain(self.partner(*at, 'z', taken, &beside)).collect::<Vec<_>>())
            });
            if let Some(axes) = axes.filter(|axes| best.iter().all(|at| axes.contains(at))) {
                return Ok(ColumnMatch::Axes(axes));
            }
        }
        let is_component = |at: &&usize| {
            let stem = split_unit(&header.names[**at]).0.trim_end().to_lowercase();
            let has_word = stem.split(|c: char| !c.is_alphanumeric()).any(|word| word == "x");
            (has_word || stem.ends_with('x') && !stem.ends_with("max"))
                && ['y', 'z'].into_iter().any(|letter| self.partner(**at, letter, taken, &beside).is_some())
        };
        let moves_in_plane = || {
            let is_position =
                |at: &usize| fit(Role::Position, &header.names[*at], header.units[*at].as_ref()).is_some();
            beside.iter().any(|at| is_position(at) && self.partner(*at, 'y', taken, &beside).is_some())
        };
        if role == Role::Force
            && let Some(x) = best.iter().find(is_component)
            && moves_in_plane()
        {
            return Err(Error::input(
                InputPlace::setting(setting),
                format!(
                    "{}: `{}` is one component of a force, and the body moves in a plane",
                    self.file.display(),
                    header.names[*x]
                ),
                format!(
                    "add a column of the force along the motion, with its sign, and name it with `{setting}`; if only one component acts, name that one"
                ),
            ));
        }
        let found = match best.as_slice() {
            [] if role == Role::Cycle => return Ok(ColumnMatch::Missing),
            [at] => return Ok(ColumnMatch::Single(*at)),
            [] => format!("{}: no column name suggests a {}", self.file.display(), role.name()),
            _ => format!("{}: several columns may be the {}", self.file.display(), role.name()),
        };
        if best.is_empty() && (self.n_filled < 3 || taken.len() == self.n_filled) && !self.given.force_is_elsewhere {
            return Err(self.refuse_too_few_columns(role));
        }
        // The user can choose among the remaining columns, which are listed by name or, without a name, by number.
        let left = (0..self.n_cells).filter(|at| !taken.contains(at));
        // Equal names are told by number.
        let is_unique = |name: &&String| header.names.iter().filter(|other| other == name).count() == 1;
        let called = |at: usize| header.names.get(at).filter(|name| !name.is_empty()).filter(is_unique).cloned();
        let choices: Vec<String> = left.map(|at| called(at).unwrap_or_else(|| (at + 1).to_string())).collect();
        let proposal = best.first().and_then(|at| called(*at));
        let also = (1..=self.n_cells).map(|number| number.to_string()).collect();
        let question = Question { text: format!("column of the {}", role.name()), choices, also, proposal };
        match ask(&question).map(|told| self.told(setting, &told)) {
            Some(at) => at.map(ColumnMatch::Single),
            None => {
                let is_current =
                    |unit: &Option<ParsedUnit>| unit.as_ref().is_some_and(|unit| unit.dimension == Dimension::Current);
                let is_torque = |name: &String| TORQUE.iter().any(|word| name.to_lowercase().contains(word));
                let of_other = match role {
                    Role::Force if header.units.iter().any(is_current) => {
                        "; the force of a coil current is calibrated in [actuation] (docs/experiment.md)"
                    }
                    Role::Force if header.names.iter().any(is_torque) => {
                        "; a torque is no force: export stress and strain, which the instrument's program computes from torque and angle by its geometry"
                    }
                    _ => "",
                };
                let elsewhere = match role {
                    Role::Force => {
                        format!("; if another file contains the force, name it with `{}`", Setting::ForceFile)
                    }
                    Role::Time => format!(
                        "; for an oscillation name its columns with `{}` and `{}`",
                        Setting::FrequencyColumn,
                        Setting::ModuliColumns
                    ),
                    _ => String::new(),
                };
                let remedy =
                    format!("select it with `{setting} NAME` or its number; {}{of_other}{elsewhere}", self.listed());
                Err(Error::input(InputPlace::setting(setting), found, remedy))
            }
        }
    }
}
