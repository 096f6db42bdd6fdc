//! Reads an experiment's files into a checked [`Experiment`].

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::actuation::Actuation;
use super::apparatus::OF_STRESS_STRAIN;
use super::contact::trim_to_contact;
use super::cycles::find_cycles;
use super::force::{ForceRule, levels};
use super::frame::{Frame, Zero};
use super::inputs::{
    ExperimentFiles, Interpretation, MeasurementKind, measurement_kind, plain_path, read_table, read_toml,
};
use super::notes::Note;
use super::record::Record;
use super::table::{BlankForce, KEYS, TableDescription, decode_table, read_choice, read_described, unread_columns};
use super::trajectory::{Trajectory, read_trajectory};
use super::{Apparatus, Control, Experiment};
use base::error::{Error, InputPlace, Result};
use base::quantities::Quantities;
use base::toml_input::{TomlInput, TomlTable, text_of};

/// Smallest number of positions in a calibration cycle, twice the number of parameters of the default law and its noise.
const MIN_POSITIONS: usize = 8;
/// Constant by which a table of a compliance or a modulus is described: a stress of 1 Pa or a strain of 1.
const NORMALISED: f64 = 1.0;
/// Value of the key `force` for a force that is constant in every hold, apart from a sensor's noise.
const LEVELS: &str = "levels";
/// Allowed noise standard deviations of the position, in µm.
const NOISES_UM: [f64; 2] = [1e-9, 1e9];

impl Experiment {
    /// Reads an experiment. `path` is the directory that contains `experiment.toml`, or the path of the TOML file.
    ///
    /// # Errors
    /// [`Error::File`] if a file cannot be read, [`Error::Input`] for input that formats §1 refuses.
    pub fn read(path: &Path) -> Result<(Self, ExperimentFiles)> {
        Self::read_with(path, &Positions::Needed)
    }

    /// Reads an experiment in which no position is measured yet; `None` if one is. `path` is as in [`Self::read`].
    ///
    /// # Errors
    /// As [`Self::read`], except for missing positions.
    pub fn read_before_measurement(path: &Path) -> Result<Option<(Self, ExperimentFiles)>> {
        let (experiment, files) = Self::read_with(path, &Positions::MayBeMissing)?;
        let is_measured = experiment.record.position_m.iter().any(Option::is_some);
        Ok((!is_measured).then_some((experiment, files)))
    }

    fn read_with(path: &Path, positions: &Positions) -> Result<(Self, ExperimentFiles)> {
        let (toml_path, toml_bytes) = read_toml(path)?;
        let specification = Specification::read(&toml_path, &toml_bytes)?;
        let csv_path = toml_path.with_file_name(&specification.csv_name);
        let remedy = "put the CSV where `file` in [measurement] says, beside the TOML";
        let csv_bytes = read_table(&toml_path, &specification.csv_name, remedy)?;
        specification.complete((&toml_path, &toml_bytes), (&csv_path, &csv_bytes), positions)
    }

    /// Reads an experiment from the texts of its TOML and CSV file. The paths `toml_place` and `csv_place` only occur in errors.
    ///
    /// # Errors
    /// [`Error::File`] if a separate force log cannot be read, [`Error::Input`] for input that formats §1 refuses.
    pub fn from_texts(
        toml_place: impl Into<PathBuf>,
        toml_text: impl AsRef<[u8]>,
        csv_place: impl Into<PathBuf>,
        csv_text: impl AsRef<[u8]>,
    ) -> Result<(Self, ExperimentFiles)> {
        let (toml_place, csv_place) = (toml_place.into(), csv_place.into());
        let specification = Specification::read(&toml_place, toml_text.as_ref())?;
        let (toml, csv) = ((&*toml_place, toml_text.as_ref()), (&*csv_place, csv_text.as_ref()));
        specification.complete(toml, csv, &Positions::Needed)
    }
}

/// Whether an experiment can be read without positions.
#[derive(PartialEq, Eq)]
enum Positions {
    Needed,
    MayBeMissing,
}

/// Checked content of `experiment.toml`, before the table's rows are read.
struct Specification {
    specimen_id: String,
    species: Option<String>,
    region: Option<String>,
    apparatus: Apparatus,
    csv_name: String,
    actuation: Option<Actuation>,
    /// Description of a foreign table; `None` for a table in the program's own format.
    table: Option<TableDescription>,
    frame: Frame,
    force_rule: ForceRule,
    force_rule_given: bool,
    /// Place of the line `force = "levels"`, which removes a sensor's noise from each hold; `None` for another rule.
    levels: Option<InputPlace>,
    /// Time in s, on the table's clock, at which the first row's force began to act, after the place of its key.
    load_start: Option<(InputPlace, f64)>,
    /// True if the zero of the positions is fitted.
    fits_position_offset: bool,
    cycle_starts: Option<CycleStarts>,
    calibration: CycleList,
    heldout: CycleList,
    left_out: LeftOut,
    noise_sd_m: Option<f64>,
    source: Option<String>,
    control: Control,
    /// Value of the commanded quantity in all rows, in the unit of the table; `None` if a column has it.
    constant: Option<f64>,
}

/// Key of the rule for the command between rows. `command` means the commanded position of a relaxation.
fn command_key(measurement: TomlTable<'_>, control: Control, has_log: bool) -> Result<&'static str> {
    let [here, other] = if control == Control::Position { ["command", "force"] } else { ["force", "command"] };
    if measurement.has(other) {
        let found = format!("this record's rule between rows is the key `{here}`");
        return Err(measurement.refuse(other, found, format!("write `{here} = …` instead")));
    }
    if has_log && control == Control::Position {
        let remedy = "write the commanded position in a column of the measurement's own table";
        return Err(measurement.refuse("kind", "a relaxation cannot have its command in [actuation]", remedy));
    }
    Ok(here)
}

/// Key of the known noise of the position. Other measured quantities have their own endings.
const NOISE: &str = "noise_um";

/// Known noise of the measured quantity in SI units: of the position in m, or of the force in N. A stress of 1 Pa counts as 1 µN, and a strain of 1 % as 1 µm.
fn noise_sd(measurement: TomlTable<'_>, control: Control, is_stress_strain: bool) -> Result<Option<f64>> {
    let key_of = |quantities: Option<Quantities>| quantities.map_or(NOISE.into(), |quantities| quantities.key(NOISE));
    let key = &*key_of(Quantities::of(control == Control::Position, is_stress_strain));
    let keys: Vec<String> = std::iter::once(None).chain(Quantities::ALL.map(Some)).map(key_of).collect();
    if let Some(other) = keys.iter().find(|other| *other != key && measurement.has(other)) {
        let found = format!("the noise of this record is given by `{key}`");
        return Err(measurement.refuse(other, found, format!("write `{key} = …` instead")));
    }
    let noise = measurement.positive(key, &format!("{key} = 4.0"))?;
    let noise = noise.map(|noise| measurement.require_range(key, noise, NOISES_UM)).transpose()?;
    Ok(noise.map(|noise| 1e-6 * noise))
}

/// List of cycles in the TOML file, with its place for errors.
struct CycleList {
    place: InputPlace,
    cycles: Option<Vec<u32>>,
}

impl CycleList {
    fn read(measurement: TomlTable<'_>, key: &str) -> Result<Self> {
        let list = Self { place: measurement.place(key), cycles: measurement.counts(key)? };
        if let Some(cycles) = &list.cycles {
            let mut seen = BTreeSet::new();
            if let Some(cycle) = cycles.iter().find(|cycle| !seen.insert(**cycle)) {
                return Err(list.refuse(format!("cycle {cycle} is listed twice"), "list each cycle once"));
            }
        }
        Ok(list)
    }

    fn refuse(&self, found: impl Into<String>, remedy: impl Into<String>) -> Error {
        Error::input(self.place.clone(), found, remedy)
    }

    fn check_exist(&self, n_cycles: u32) -> Result<()> {
        match self.cycles.iter().flatten().find(|cycle| **cycle > n_cycles) {
            None => Ok(()),
            Some(cycle) => Err(self.refuse(
                format!("cycle {cycle} does not exist; the record has {n_cycles} cycles"),
                format!("list cycles from 1 to {n_cycles}"),
            )),
        }
    }
}

/// Time intervals in which positions are excluded, with the place of their list for errors.
struct LeftOut {
    place: InputPlace,
    /// Start and end of each interval in s; both ends are included.
    intervals_s: Vec<[f64; 2]>,
}

impl LeftOut {
    fn read(measurement: TomlTable<'_>) -> Result<Self> {
        let key = "left_out_s";
        Ok(Self { place: measurement.place(key), intervals_s: measurement.intervals(key)?.unwrap_or_default() })
    }

    /// Removes the positions in the intervals from the record, and returns the number of removed positions.
    fn leave_out(&self, record: &mut Record) -> Result<usize> {
        let mut n_left_out = 0;
        for [from_s, to_s] in &self.intervals_s {
            let rows = record.time_s.partition_point(|time_s| time_s < from_s)
                ..record.time_s.partition_point(|time_s| time_s <= to_s);
            let taken = record.position_m[rows].iter_mut().filter_map(Option::take).count();
            if taken == 0 {
                return Err(Error::input(
                    self.place.clone(),
                    format!("no position between {from_s} and {to_s} s remains to be left out"),
                    "give times of the record in seconds, as the figures show them",
                ));
            }
            n_left_out += taken;
        }
        Ok(n_left_out)
    }
}

/// Start times of cycles on the table's clock, with the place of their list for errors.
struct CycleStarts {
    place: InputPlace,
    starts_s: Vec<f64>,
}

impl CycleStarts {
    fn read(measurement: TomlTable<'_>) -> Result<Option<Self>> {
        let key = "cycle_starts_s";
        let Some(starts_s) = measurement.numbers(key)? else { return Ok(None) };
        if starts_s.is_empty() || starts_s.windows(2).any(|pair| pair[0] >= pair[1]) {
            let remedy = "give the start times of the cycles in s in ascending order, as in `cycle_starts_s = [0, 5]`";
            return Err(measurement.refuse(key, "the list is empty or its times do not ascend", remedy));
        }
        Ok(Some(Self { place: measurement.place(key), starts_s }))
    }

    /// Assigns a cycle number to each row of a table without a cycle column. Rows before the first start belong to the first cycle.
    fn number(&self, trajectory: &mut Trajectory) -> Result<()> {
        let refuse = |found: String, remedy: &str| Err(Error::input(self.place.clone(), found, remedy));
        if trajectory.cycle.is_some() {
            return refuse("the table also has a `cycle` column".into(), "remove `cycle_starts_s` or this column");
        }
        let cycle_of = |time_s: &f64| self.starts_s[1..].partition_point(|start_s| start_s <= time_s) as u32 + 1;
        let cycle: Vec<u32> = trajectory.time_s.iter().map(cycle_of).collect();
        for number in 1..=self.starts_s.len() as u32 {
            // Times ascend, so cycle numbers ascend and can be searched by bisection.
            if cycle.binary_search(&number).is_err() {
                let start_s = self.starts_s[number as usize - 1];
                return refuse(
                    format!("the cycle that starts at {start_s} s has no rows"),
                    "give start times inside the record, in seconds of its time column",
                );
            }
        }
        trajectory.cycle = Some(cycle);
        Ok(())
    }
}

impl Specification {
    fn read(file: &Path, bytes: &[u8]) -> Result<Self> {
        let document = TomlInput::parse(file, text_of(file, bytes)?)?;
        let root = document.root();
        let measurement = root.required_table("measurement")?;
        let kind = measurement_kind(root, measurement)?;
        if kind == MeasurementKind::Oscillation {
            let remedy = "give a record of force and position over time; only `check`, `sample`, `compare` with laws and `diagnose` take oscillations";
            return Err(measurement.refuse("kind", "this is an oscillation, not a record over time", remedy));
        }
        root.only(&["kind", "specimen", "robot", "vitreous", "instrument", "indenter", "measurement", "actuation"])?;
        let specimen = root.required_table("specimen")?;
        specimen.only(&["id", "species", "region"])?;
        let specimen_id = specimen.required_text("id", "id = \"porcine-01\"")?;
        let (species, region) = (specimen.text("species")?, specimen.text("region")?);
        let apparatus = Apparatus::from_document(root)?;
        measurement.only(
            &[
                &[
                    "kind",
                    "file",
                    "calibration_cycles",
                    "heldout_cycles",
                    "cycle_starts_s",
                    "left_out_s",
                    "load_start_s",
                    "noise_um",
                    "noise_un",
                    "noise_pa",
                    "noise_percent",
                    "command",
                    "constant",
                    "source",
                ],
                &["force", "zero", "direction"][..],
                &KEYS[..],
            ]
            .concat(),
        )?;
        let log = root.table("actuation")?;
        let actuation = log.map(|log| Actuation::read(log, |log| plain_path(log, "coil.csv"))).transpose()?;
        if actuation.is_some() && measurement.has("force") {
            let remedy = "move `force` to [actuation], which contains the force log";
            return Err(measurement.refuse("force", "the force comes from the log in [actuation]", remedy));
        }
        let control = if kind == MeasurementKind::Relaxation { Control::Position } else { Control::Force };
        let rule_key = command_key(measurement, control, actuation.is_some())?;
        let has_levels = measurement.text(rule_key)?.as_deref() == Some(LEVELS);
        // A position does not jump, unless the record says so.
        let default_rule = if control == Control::Position { ForceRule::Linear } else { ForceRule::default() };
        let of_rows = match has_levels {
            true => ForceRule::Hold,
            false => read_choice(measurement, rule_key, &ForceRule::ALL, ForceRule::name)?.unwrap_or(default_rule),
        };
        let (force_rule, force_rule_given) =
            actuation.as_ref().map_or((of_rows, measurement.has(rule_key)), |log| (log.rule, log.rule_given));
        if measurement.has("force_acts") && (control == Control::Position || force_rule == ForceRule::Linear) {
            let found = "the key needs a commanded force that holds between rows";
            return Err(measurement.refuse("force_acts", found, "remove it, or the rule `linear`"));
        }
        let constant = measurement.number("constant")?;
        if constant == Some(0.0) || constant.is_some() && actuation.is_some() {
            let remedy = "give the value of the commanded quantity, in N or m (for stress and strain in Pa or 1), or leave the key out";
            return Err(measurement.refuse("constant", "the commanded quantity cannot be this constant", remedy));
        }
        let mut table = TableDescription::read(measurement, actuation.is_some(), constant.map(|_| control))?;
        if let (Some(table), Control::Position) = (&mut table, control) {
            if let Some(BlankForce::Above | BlankForce::Zero) = table.blank_force {
                let found = "the force of a relaxation is measured, so a blank one is unknown";
                return Err(measurement.refuse(
                    "blank_force",
                    found,
                    "leave `blank_force` out: such rows have no force",
                ));
            }
            table.blank_force = Some(BlankForce::Lost);
        }
        if constant.is_some() && table.is_none() {
            let remedy = "describe the table in [measurement.columns], or write the commanded quantity in a column";
            return Err(measurement.refuse(
                "constant",
                "a table in the program's own format has both quantities",
                remedy,
            ));
        }
        let frame = Frame::read(measurement, table.as_ref().map_or(1, TableDescription::n_axes))?;
        let csv_name = plain_path(measurement, "trajectory.csv")?;
        let is_indenter = matches!(apparatus, Apparatus::Indenter(_));
        if is_indenter && measurement.has("zero") && frame.zero != Zero::Fit {
            return Err(measurement.refuse(
                "zero",
                "the contact point of an indenter is unknown before the fit",
                "remove `zero`, or write `zero = \"fit\"`: the height at contact is fitted",
            ));
        }
        if let Some(log) = log.filter(|_| is_indenter) {
            let remedy = "give the force in the measurement's own table";
            return Err(log.refuse("file", "an indenter's force is measured together with its height", remedy));
        }
        let fits_position_offset = is_indenter || frame.zero == Zero::Fit;
        if is_indenter && control == Control::Position {
            let remedy = "give the record of a hold at constant force, or use `[instrument]` with its compliance";
            return Err(measurement.refuse("kind", "a relaxation of an indenter has no model", remedy));
        }
        let is_stress_strain = match apparatus {
            Apparatus::Instrument { is_stress_strain, .. } => is_stress_strain || control == Control::Position,
            _ => false,
        };
        let apparatus = if is_stress_strain { apparatus.with_stress_strain() } else { apparatus };
        let noise_sd_m = noise_sd(measurement, control, is_stress_strain)?;
        Ok(Self {
            specimen_id,
            species,
            region,
            apparatus,
            csv_name,
            actuation,
            table,
            frame,
            force_rule,
            force_rule_given,
            levels: has_levels.then(|| measurement.place(rule_key)),
            load_start: measurement.number("load_start_s")?.map(|start_s| (measurement.place("load_start_s"), start_s)),
            fits_position_offset,
            cycle_starts: CycleStarts::read(measurement)?,
            calibration: CycleList::read(measurement, "calibration_cycles")?,
            heldout: CycleList::read(measurement, "heldout_cycles")?,
            left_out: LeftOut::read(measurement)?,
            noise_sd_m,
            source: measurement.text("source")?,
            control,
            constant,
        })
    }

    fn complete(
        self,
        (toml_place, toml_bytes): (&Path, &[u8]),
        (csv_place, csv_bytes): (&Path, &[u8]),
        positions: &Positions,
    ) -> Result<(Experiment, ExperimentFiles)> {
        let mut unread = Vec::new();
        let mut trajectory = match &self.table {
            None => {
                let text = text_of(csv_place, csv_bytes)?;
                read_trajectory(csv_place, text, self.actuation.is_some(), self.control == Control::Position)?
            }
            Some(table) => {
                let text = decode_table(csv_place, csv_bytes, table.layout.encoding)?;
                let trajectory = read_described(csv_place, &text, table)?;
                unread = unread_columns(csv_place, &text, table, &trajectory.lines, &trajectory.position_m);
                trajectory
            }
        };
        if let Some(constant) = self.constant {
            match self.control {
                Control::Force => trajectory.force_n = vec![constant; trajectory.time_s.len()],
                Control::Position => trajectory.position_m = vec![Some(constant); trajectory.time_s.len()],
            }
        }
        if matches!(self.apparatus, Apparatus::Instrument { is_stress_strain: true, .. }) {
            trajectory.scale(OF_STRESS_STRAIN);
        }
        // Zero and direction concern the position, also where it is commanded.
        let mut settled = None;
        if self.control == Control::Position {
            settled = Some(self.frame.apply(csv_place, &mut trajectory)?);
            trajectory.exchange(csv_place)?;
        }
        let (mut driven_place, mut force_rows, mut log_file) = (csv_place.to_path_buf(), Vec::new(), None);
        if let Some(actuation) = &self.actuation {
            driven_place = toml_place.with_file_name(&actuation.file);
            let remedy = "put the log where `file` in [actuation] says, beside the TOML";
            let bytes = read_table(toml_place, &actuation.file, remedy)?;
            (trajectory, force_rows) = actuation.merged(&driven_place, &bytes, trajectory)?;
            log_file = (actuation.file != self.csv_name).then(|| (actuation.file.clone(), bytes));
        }
        if let Some(place) = &self.levels {
            trajectory.force_n = levels(&trajectory.force_n).ok_or_else(|| {
                Error::input(
                    place.clone(),
                    "the force does not vary about fixed levels",
                    "write \"hold\" or \"linear\"",
                )
            })?;
        }
        check_driven(&driven_place, &trajectory)?;
        let mut notes = Vec::new();
        let settled = match settled {
            Some(settled) => settled,
            None => self.frame.apply(csv_place, &mut trajectory)?,
        };
        if let Some(starts) = &self.cycle_starts {
            starts.number(&mut trajectory)?;
        }
        if let Some((place, start_s)) = &self.load_start {
            trajectory.start_under_load(place, *start_s)?;
            force_rows.iter_mut().for_each(|row| *row += 1);
            force_rows.insert(0, 0);
        }
        if let Apparatus::Indenter(indenter) = &self.apparatus {
            notes.push(trim_to_contact(csv_place, &mut trajectory, indenter)?);
            notes.extend(indenter.nominal_size().map(|nominal| Note::TipUnknown { nominal }));
            check_first_cycle(csv_place, &trajectory)?;
        } else if self.fits_position_offset {
            notes.push(Note::PositionOffsetFitted);
        }
        let (lines, position_column) =
            (std::mem::take(&mut trajectory.lines), std::mem::take(&mut trajectory.position_column));
        let (mut record, lines) = record_from(trajectory, lines, force_rows, self.force_rule, &mut notes);
        let n_left_out = self.left_out.leave_out(&mut record)?;
        notes.extend((n_left_out > 0).then_some(Note::PositionsLeftOut { n_left_out, n_rows: record.n_samples() }));
        let (calibration_cycles, heldout_cycles) = self.choose_cycles(record.n_cycles())?;
        if *positions == Positions::Needed || record.position_m.iter().any(Option::is_some) {
            let place = InputPlace::file(csv_place).at_key(position_column);
            check_positions(&record, &calibration_cycles, &place, &lines)?;
        }
        let last_fitted = calibration_cycles.last().copied().unwrap_or(u32::MAX);
        let mut fitted_forces_n = record.cycle.iter().zip(&record.force_n).filter(|(cycle, _)| **cycle <= last_fitted);
        if record.n_cycles() > last_fitted && fitted_forces_n.all(|(_, force_n)| *force_n == 0.0) {
            let found = match self.control {
                Control::Force => "no force acts before the end of the fitted cycles",
                Control::Position => "the commanded position does not change before the end of the fitted cycles",
            };
            let remedy = "list a cycle in which it does, in `calibration_cycles` of the TOML";
            return Err(self.calibration.refuse(found, remedy));
        }
        note_data(&record, &heldout_cycles, self.source.is_none(), &mut notes);
        if let Some(projection) = &settled.projection {
            let range_m = range_m(&record);
            notes.push(Note::MovesAcross { line: projection.to_string(), rms_m: projection.across_rms_m, range_m });
        }
        let files = ExperimentFiles {
            toml_name: toml_place
                .file_name()
                .map_or("experiment.toml".into(), |name| name.to_string_lossy().into_owned()),
            toml_bytes: toml_bytes.to_vec(),
            csv_name: self.csv_name,
            csv_bytes: csv_bytes.to_vec(),
            log_file,
            notes,
            interpretation: Interpretation { force_rule_given: self.force_rule_given, settled, n_left_out, unread },
        };
        let has_strain = matches!(self.apparatus, Apparatus::Instrument { is_stress_strain: true, .. })
            && self.constant != Some(NORMALISED);
        let experiment = Experiment {
            largest_strain: has_strain.then(|| largest_strain(&record, self.control, self.fits_position_offset)),
            specimen_id: self.specimen_id,
            species: self.species,
            region: self.region,
            apparatus: self.apparatus,
            record,
            calibration_cycles,
            heldout_cycles,
            noise_sd_m: self.noise_sd_m,
            fits_position_offset: self.fits_position_offset,
            source: self.source.unwrap_or_else(|| "not stated".into()),
            control: self.control,
        };
        Ok((experiment, files))
    }

    /// Returns the calibration cycles and the held-out cycles. By default the first cycle calibrates, and all other cycles are held out.
    fn choose_cycles(&self, n_cycles: u32) -> Result<(Vec<u32>, Vec<u32>)> {
        self.calibration.check_exist(n_cycles)?;
        self.heldout.check_exist(n_cycles)?;
        let mut calibration = self.calibration.cycles.clone().unwrap_or_else(|| vec![1]);
        if calibration.is_empty() {
            return Err(self.calibration.refuse("no cycle is fitted", "list at least one cycle, such as [1]"));
        }
        let mut heldout = self
            .heldout
            .cycles
            .clone()
            .unwrap_or_else(|| (1..=n_cycles).filter(|cycle| !calibration.contains(cycle)).collect());
        if let Some(both) = heldout.iter().find(|cycle| calibration.contains(cycle)) {
            let remedy = if self.calibration.cycles.is_some() {
                "remove it from `calibration_cycles` or from `heldout_cycles`"
            } else {
                "remove it from `heldout_cycles`, or list other `calibration_cycles` (the default is the first cycle)"
            };
            return Err(self.heldout.refuse(format!("cycle {both} is both fitted and held out"), remedy));
        }
        calibration.sort_unstable();
        heldout.sort_unstable();
        Ok((calibration, heldout))
    }
}

/// Makes the record, with its cycles, from a trajectory. Returns the record and the line number of each row. Rows are added where a linearly varying
/// force crosses zero, because some effects act on only one sign of the force.
fn record_from(
    trajectory: Trajectory,
    lines: Vec<usize>,
    force_rows: Vec<usize>,
    force_rule: ForceRule,
    notes: &mut Vec<Note>,
) -> (Record, Vec<usize>) {
    let Trajectory { time_s, force_n, position_m, cycle, .. } = trajectory;
    let cycle_given = cycle.is_some();
    let cycle = cycle.unwrap_or_else(|| vec![1; time_s.len()]);
    let mut record = Record { time_s, force_n, position_m, cycle, force_rule, force_rows };
    if !cycle_given {
        let found = find_cycles(&record);
        notes.push(found.note());
        record.cycle = found.cycle;
    }
    record.with_force_rows(lines)
}

/// Checks that the first cycle lasts until an indenter's contact. A cycle that ends before contact would have no rows.
fn check_first_cycle(csv_place: &Path, trajectory: &Trajectory) -> Result<()> {
    match trajectory.cycle.as_ref().and_then(|cycle| cycle.first()) {
        Some(first) if *first != 1 => Err(Error::input(
            InputPlace::file(csv_place).at_line(trajectory.lines.first().copied().unwrap_or(1)),
            format!("contact begins only in cycle {first}, and rows before contact are left out"),
            "extend the first cycle into the contact, for example with `cycle_starts_s = [0, 5]` for the approach and the first part of the hold",
        )),
        _ => Ok(()),
    }
}

/// Checks that the force is not zero in all rows. Without a force no parameter can be estimated.
fn check_driven(csv_place: &Path, trajectory: &Trajectory) -> Result<()> {
    if trajectory.force_n.iter().any(|force_n| *force_n != 0.0) {
        return Ok(());
    }
    Err(Error::input(
        InputPlace::file(csv_place)
            .at_line(trajectory.lines.first().copied().unwrap_or(1))
            .at_key(trajectory.force_column.as_str()),
        "the force is zero in every row",
        "give the commanded force in this column; a record without force cannot be fitted",
    ))
}

fn check_positions(record: &Record, calibration_cycles: &[u32], place: &InputPlace, lines: &[usize]) -> Result<()> {
    let counts = record.n_positions();
    if counts.iter().all(|n_positions| *n_positions == 0) {
        return Err(Error::input(
            place.clone().at_line(lines.first().copied().unwrap_or(1)),
            "the column is empty: no position is measured yet",
            "write the measured positions into this column; a table from `design` or `plan` has only the protocol, for which `simulate` accepts zeros; `design` plans a first record without positions",
        ));
    }
    for &cycle in calibration_cycles {
        let n_positions = counts.get(cycle as usize).copied().unwrap_or(0);
        if n_positions < MIN_POSITIONS {
            let first_row = record.cycle.iter().position(|of_row| *of_row == cycle).unwrap_or(0);
            return Err(Error::input(
                place.clone().at_line(lines.get(first_row).copied().unwrap_or(1)),
                format!(
                    "calibration cycle {cycle} starts here and has {n_positions} positions; {MIN_POSITIONS} are needed"
                ),
                match counts.iter().any(|n_positions| *n_positions >= MIN_POSITIONS) {
                    true => {
                        "list a cycle with more positions in `calibration_cycles` of the TOML, or measure more positions"
                    }
                    false => {
                        "measure more positions: no cycle has enough; without the column `cycle` the force determines the cycles"
                    }
                },
            ));
        }
    }
    Ok(())
}

/// Largest strain of a record of stress and strain. Without a known zero it is the range of the strains.
fn largest_strain(record: &Record, control: Control, is_zero_unknown: bool) -> f64 {
    let strains_m: Vec<f64> = match control {
        Control::Force => record.position_m.iter().flatten().copied().collect(),
        Control::Position => record.force_n.clone(),
    };
    let start = if is_zero_unknown { [f64::INFINITY, f64::NEG_INFINITY] } else { [0.0; 2] };
    let [smallest, largest] = strains_m.iter().fold(start, |[low, high], x| [low.min(*x), high.max(*x)]);
    let strain_m = if is_zero_unknown { largest - smallest } else { largest.max(-smallest) };
    strain_m / OF_STRESS_STRAIN[1]
}

/// Largest minus smallest position of the record, in m.
fn range_m(record: &Record) -> f64 {
    let positions = || record.position_m.iter().flatten().copied();
    positions().fold(f64::NEG_INFINITY, f64::max) - positions().fold(f64::INFINITY, f64::min)
}

fn note_data(record: &Record, heldout_cycles: &[u32], source_missing: bool, notes: &mut Vec<Note>) {
    let n_missing = record.position_m.iter().filter(|position| position.is_none()).count() - record.force_rows.len();
    // Positions at the onset of contact are excluded, not missing; the note on contact mentions them.
    let touches = notes.iter().any(|note| matches!(note, Note::Contact { .. }));
    let n_touching = record.position_m.iter().take_while(|position| touches && position.is_none()).count();
    let left_out =
        notes.iter().map(|note| if let Note::PositionsLeftOut { n_left_out, .. } = note { *n_left_out } else { 0 });
    let n_missing = n_missing.saturating_sub(n_touching + left_out.sum::<usize>());
    if n_missing > 0 {
        notes.push(Note::PositionsMissing { n_missing, n_rows: record.n_samples() });
    }
    let counts = record.n_positions();
    let empty = heldout_cycles.iter().filter(|cycle| counts.get(**cycle as usize).is_none_or(|count| *count == 0));
    notes.extend(empty.map(|&cycle| Note::HeldOutCycleEmpty { cycle }));
    if let Some(Some(first)) = record.position_m.first()
        && first.abs() > 0.5 * range_m(record)
    {
        notes.push(Note::FirstPositionNotZero { position_m: *first });
    }
    if source_missing {
        notes.push(Note::SourceNotStated);
    }
}
