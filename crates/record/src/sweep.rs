//! Oscillation measured with a rheometer: a table of moduli against frequency (formats §1.2).
//!
//! [`OscillationRecord::read`] reads and checks such a table, whose data are then complete and in SI units.

use std::path::Path;

use super::inputs::{
    ExperimentFiles, Interpretation, MeasurementKind, measurement_kind, plain_path, read_table, read_toml,
};
use super::table::{
    ColumnName, ColumnNames, InspectedTable, ParsedUnit, SWEEP_KEYS, TableLayout, TableSettings, Units, bracketed,
    cells, column, decode_table, is_blank_or_comment, listed_columns, read_choice, split_unit, told_column,
};
use base::error::{Error, InputPlace, Result, Setting};
use base::files::refuse_long_lines;
use base::toml_input::{TomlInput, TomlTable, text_of};
use base::units::Dimension;

/// Largest relative range of the frequencies of a test at one frequency.
const ONE_FREQUENCY: f64 = 1e-3;
/// Largest ratio of the moduli of repeats at one frequency.
const LIKE_REPEATS: f64 = 1.3;
/// Smallest number of frequencies with repeats from which a like difference at all of them counts, its smallest mean logarithm, and its smallest ratio to the standard deviation.
const FEWEST_DIFFERENCES: usize = 5;
const ALIKE: f64 = 0.1;
const APART: f64 = 3.0;
/// Smallest number of rows of a sweep that is compared with another one, and largest ratio of the frequencies between which its moduli are interpolated.
const FEWEST_OF_SWEEP: usize = 4;
const WIDEST_GAP: f64 = 3.0;
/// Smallest number of rows that are not held out.
const FEWEST_FITTED: usize = 4;
/// Smallest number of frequencies at which rows are held out by default.
const FEWEST_TO_HOLD_OUT: usize = 9;
/// Two frequencies count as equal if their relative difference is below this value.
const SAME_FREQUENCY: f64 = 1e-6;
/// Signs in a bracket for the unit of a plain number.
const PLAIN: [&str; 4] = ["-", "–", "1", ""];
/// Range of frequencies in Hz. Master curves of time-temperature superposition reach 10⁻¹² and 10¹² Hz; numbers beyond this range are no frequencies.
const FREQUENCIES_HZ: [f64; 2] = [1e-15, 1e15];
/// Range of frequencies in Hz that instruments reach, from days of creep to light scattering. Beyond it, a table that is no master curve has a wrong unit.
const DIRECT_HZ: [f64; 2] = [1e-6, 1e8];
/// Default Poisson ratio, that of a gel, which consists almost entirely of water and keeps its volume.
const INCOMPRESSIBLE: f64 = 0.5;

/// Pair of quantities that a rheometer measures at each frequency.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SweepForm {
    /// Storage modulus G′ and loss modulus G″, in Pa.
    StorageAndLoss,
    /// Absolute value |G*| of the complex modulus in Pa, and the phase δ in rad by which strain lags behind stress.
    ModulusAndPhase,
}

impl SweepForm {
    /// Converts storage modulus and loss modulus (Pa) to the two quantities of this form.
    pub fn of_moduli(self, storage_pa: f64, loss_pa: f64) -> [f64; 2] {
        match self {
            Self::StorageAndLoss => [storage_pa, loss_pa],
            Self::ModulusAndPhase => [storage_pa.hypot(loss_pa), loss_pa.atan2(storage_pa)],
        }
    }

    /// Converts the two quantities of this form to storage modulus and loss modulus in Pa.
    pub fn moduli(self, pair: [f64; 2]) -> [f64; 2] {
        match self {
            Self::StorageAndLoss => pair,
            Self::ModulusAndPhase => [pair[0] * pair[1].cos(), pair[0] * pair[1].sin()],
        }
    }

    /// Divides the moduli of rows and their errors.
    fn divide(self, rows: &mut [SweepRow], by: f64) {
        let n_moduli = if self == Self::StorageAndLoss { 2 } else { 1 };
        for row in rows {
            for pair in std::iter::once(&mut row.pair).chain(&mut row.sd) {
                pair[..n_moduli].iter_mut().for_each(|modulus| *modulus /= by);
            }
        }
    }

    /// Symbols of the two quantities, for tables and figures.
    pub fn names(self) -> [&'static str; 2] {
        match self {
            Self::StorageAndLoss => ["G′", "G″"],
            Self::ModulusAndPhase => ["|G*|", "δ"],
        }
    }
}

/// Measurement of a rheometer at one frequency.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SweepRow {
    /// Frequency in Hz.
    pub frequency_hz: f64,
    /// The two measured quantities, as [`OscillationRecord::form`] defines them.
    pub pair: [f64; 2],
    /// Standard deviations of the two quantities, in their units; `None` if they are unknown.
    pub sd: Option<[f64; 2]>,
    /// True if the row is held out, so that no fit uses it.
    pub is_heldout: bool,
}

/// Checked oscillation in SI units, with rows in order of ascending frequency.
#[derive(Debug, Clone, PartialEq)]
pub struct OscillationRecord {
    /// Specimen identifier, `[specimen] id`.
    pub specimen_id: String,
    /// Poisson ratio ν of the specimen, which converts Young's moduli E to shear moduli E/(2 + 2ν).
    pub poisson_ratio: f64,
    /// Pair of quantities that each row contains.
    pub form: SweepForm,
    /// Measurements, one for each frequency.
    pub rows: Vec<SweepRow>,
    /// Number of table rows that were skipped because a number is missing.
    pub n_incomplete: usize,
    /// Number of table rows that were skipped because frequency and moduli are 0: nothing was measured in them.
    pub n_zero: usize,
    /// Source of the data: synthetic or measured.
    pub source: String,
}

base::named_enum! {
    /// Quantity that a column of a rheometer's table contains.
    pub enum SweepColumn {
        /// Frequency of the oscillation.
        Frequency = "frequency",
        /// Storage modulus G′.
        Storage = "storage",
        /// Loss modulus G″.
        Loss = "loss",
        /// Absolute value |G*| of the complex modulus.
        Modulus = "modulus",
        /// Phase δ by which strain lags behind stress.
        Phase = "phase",
        /// Loss tangent tan δ = G″/G′, in place of the loss modulus or the phase.
        LossTangent = "loss_tangent",
        /// Standard deviation of the storage modulus G′.
        StorageSd = "storage_sd",
        /// Standard deviation of the loss modulus G″.
        LossSd = "loss_sd",
        /// Standard deviation of the absolute value |G*| of the complex modulus.
        ModulusSd = "modulus_sd",
        /// Standard deviation of the phase δ.
        PhaseSd = "phase_sd",
    }
    /// Key of the quantity in `[measurement.columns]`, which is also the name of its column without the unit.
    pub fn key
}

impl SweepColumn {
    /// Physical dimension of the quantity's unit.
    pub fn dimension(self) -> Dimension {
        match self {
            Self::Frequency => Dimension::Frequency,
            Self::Phase | Self::PhaseSd => Dimension::Angle,
            Self::LossTangent => Dimension::Ratio,
            _ => Dimension::Pressure,
        }
    }

    /// Returns the quantity of a column from its name in the export of a rheometer's program; `None` for unknown names. Columns of standard
    /// deviations are recognised by their keys alone.
    fn from_name(name: &str, unit: Option<&ParsedUnit>) -> Option<Self> {
        let before_bracket = || {
            let (stem, text) = bracketed(name)?;
            // A letter before a bracket says too little.
            Self::from_stem(stem, false).filter(|found| match found {
                Self::Frequency => stem.trim().chars().count() > 1,
                Self::LossTangent => PLAIN.contains(&text.trim()),
                _ => false,
            })
        };
        let found = Self::from_stem(split_unit(name).0, unit.is_some()).or_else(before_bracket)?;
        unit.is_none_or(|unit| unit.dimension == found.dimension()).then_some(found)
    }

    /// Returns the quantity that a name without its unit says; `None` for unknown names.
    fn from_stem(stem: &str, has_unit: bool) -> Option<Self> {
        let stem = stem.to_lowercase();
        let plain: String = stem.chars().filter(|c| !c.is_whitespace() && !"_-|*.()".contains(*c)).collect();
        let plain =
            plain.trim_start_matches("tensile").trim_start_matches("flexural").trim_start_matches("compressive");
        // Moduli of tension are called E′ and E″.
        let plain = match plain.strip_prefix('e') {
            Some(rest) if rest.chars().all(|c| "'′″\"`´".contains(c)) => format!("g{rest}"),
            _ => plain.to_string(),
        };
        let by_words = [
            ("storagemodulus", Self::Storage),
            ("lossmodulus", Self::Loss),
            ("complexmodulus", Self::Modulus),
            ("phaseangle", Self::Phase),
            ("shearmoduluselasticcomponent", Self::Storage),
            ("shearmodulusviscouscomponent", Self::Loss),
            ("shearmoduluscomplexcomponent", Self::Modulus),
            ("moduledestockage", Self::Storage),
            ("moduledeconservation", Self::Storage),
            ("moduledeperte", Self::Loss),
            ("módulodealmacenamiento", Self::Storage),
            ("módulodepérdida", Self::Loss),
            ("módulodearmazenamento", Self::Storage),
            ("módulodeperda", Self::Loss),
            ("modulodiaccumulo", Self::Storage),
            ("modulodiconservazione", Self::Storage),
            ("modulodiperdita", Self::Loss),
            ("speichermodul", Self::Storage),
            ("verlustmodul", Self::Loss),
            ("貯蔵弾性率", Self::Storage),
            ("損失弾性率", Self::Loss),
            ("储能模量", Self::Storage),
            ("损耗模量", Self::Loss),
        ];
        // A symbol of up to three characters may follow, as in `Storage modulus E'`.
        let with_symbol = by_words.into_iter().find(|(words, _)| {
            plain
                .strip_prefix(words)
                .is_some_and(|rest| rest.is_empty() || rest.chars().count() <= 3 && rest.starts_with(['g', 'e', 'δ']))
        });
        Some(match plain.as_str() {
            _ if with_symbol.is_some() => with_symbol?.1,
            "f"
            | "freq"
            | "frequency"
            | "angularfrequency"
            | "omega"
            | "ω"
            | "frequenz"
            | "kreisfrequenz"
            | "fréquence"
            | "fréquenceangulaire"
            | "pulsation"
            | "frecuencia"
            | "frecuenciaangular"
            | "frequência"
            | "frequênciaangular"
            | "frequenza"
            | "frequenzaangolare"
            | "周波数"
            | "角周波数"
            | "频率"
            | "角频率" => Self::Frequency,
            // A letter alone says too little without its unit.
            "w" if has_unit => Self::Frequency,
            "g'" | "g′" | "g`" | "g´" | "storage" | "gstorage" | "estorage" | "gprime" => Self::Storage,
            "g''" | "g″" | "g′′" | "g\"" | "g``" | "g´´" | "loss" | "gloss" | "eloss" | "gdoubleprime" => {
                Self::Loss
            }
            "g" | "modulus" | "complexshearmodulus" => Self::Modulus,
            "phase" | "delta" | "δ" | "phasenwinkel" => Self::Phase,
            "tandelta" | "tanδ" | "tand" | "losstangent" | "lossfactor" | "verlustfaktor" => Self::LossTangent,
            "storagesd" => Self::StorageSd,
            "losssd" => Self::LossSd,
            "modulussd" => Self::ModulusSd,
            "phasesd" => Self::PhaseSd,
            _ => return None,
        })
    }
}

/// Returns the columns of a rheometer's table with their indices: frequency, then the two measured quantities. They are those that the user gives, or else those that are
/// named so. Of several frequencies, moduli that the user gives have the nearest one to their left. `None` if the table is not a rheometer's.
///
/// # Errors
/// [`Error::Input`] if a given column does not exist.
pub fn sweep_columns(looked: &InspectedTable, given: &TableSettings) -> Result<Option<Vec<(SweepColumn, usize)>>> {
    let names = &looked.columns;
    let pair = match &given.moduli {
        Some(told) => Some(told_moduli(looked, told)?),
        None => moduli_columns(looked),
    };
    let is_left = |place: &usize| pair.is_some_and(|pair| pair.iter().all(|(_, modulus)| place < modulus));
    let frequency = match &given.frequency {
        Some(told) => Some(told_column(names, names.len(), Setting::FrequencyColumn, told)?),
        None => {
            let nearest = columns_of(looked, SweepColumn::Frequency).filter(is_left).last();
            nearest.filter(|_| given.moduli.is_some()).or(columns_of(looked, SweepColumn::Frequency).next())
        }
    };
    let frequency = frequency.map(|place| (SweepColumn::Frequency, place));
    match (frequency, pair) {
        (Some(frequency), Some([first, second])) => {
            let of_errors = match [first.0, second.0] {
                [SweepColumn::Storage, SweepColumn::Loss] => [SweepColumn::StorageSd, SweepColumn::LossSd],
                _ => [SweepColumn::ModulusSd, SweepColumn::PhaseSd],
            };
            let errors: Option<Vec<_>> = of_errors.into_iter().map(|column| column_of(looked, column)).collect();
            let errors = errors.filter(|_| given.moduli.is_none() && second.0 != SweepColumn::LossTangent);
            Ok(Some([frequency, first, second].into_iter().chain(errors.into_iter().flatten()).collect()))
        }
        (frequency, _) if given.frequency.is_some() || given.moduli.is_some() => {
            let missing = if frequency.is_none() { Setting::FrequencyColumn } else { Setting::ModuliColumns };
            Err(Error::input(
                InputPlace::setting(missing),
                "no column of the table has a name of this quantity",
                format!("give it with `{missing}`, too; {}", listed_columns(names, names.len())),
            ))
        }
        _ => Ok(None),
    }
}

/// Two columns that the user gives. The second is a phase or a loss tangent if its name or its unit says so, and otherwise a loss modulus.
fn told_moduli(looked: &InspectedTable, told: &[String; 2]) -> Result<[(SweepColumn, usize); 2]> {
    let names = &looked.columns;
    let [first, second] =
        [&told[0], &told[1]].map(|told| told_column(names, names.len(), Setting::ModuliColumns, told));
    let (first, second) = (first?, second?);
    let is_of = |place: usize, column: SweepColumn| {
        SweepColumn::from_name(&looked.columns[place], looked.units[place].as_ref()) == Some(column)
    };
    let dimension = looked.units[second].as_ref().map(|unit| unit.dimension);
    let has_angle = dimension == Some(Dimension::Angle);
    let is_tangent = dimension != Some(Dimension::Pressure) && looked.columns[second].to_lowercase().contains("tan");
    let pair = match () {
        () if has_angle || is_of(second, SweepColumn::Phase) => {
            [(SweepColumn::Modulus, first), (SweepColumn::Phase, second)]
        }
        () if is_tangent => {
            let modulus = if is_of(first, SweepColumn::Modulus) { SweepColumn::Modulus } else { SweepColumn::Storage };
            [(modulus, first), (SweepColumn::LossTangent, second)]
        }
        () => [(SweepColumn::Storage, first), (SweepColumn::Loss, second)],
    };
    let named = |place: usize| SweepColumn::from_name(&looked.columns[place], looked.units[place].as_ref());
    let contradicted = pair.iter().find(|(column, place)| named(*place).is_some_and(|named| named != *column));
    match contradicted {
        Some((column, place)) => Err(Error::input(
            InputPlace::setting(Setting::ModuliColumns),
            format!(
                "`{}` stands in the place of the {}, and its name says otherwise",
                looked.columns[*place],
                column.key()
            ),
            "give storage and loss modulus, or the absolute modulus and the phase, in this order",
        )),
        None if first == second => Err(Error::input(
            InputPlace::setting(Setting::ModuliColumns),
            "the same column is given twice",
            "give two columns",
        )),
        None => Ok(pair),
    }
}

/// Returns the two columns with the moduli of an oscillation, or with a modulus and a phase, with their indices. `None` if the table has none.
pub fn moduli_columns(looked: &InspectedTable) -> Option<[(SweepColumn, usize); 2]> {
    let pairs = [
        [SweepColumn::Storage, SweepColumn::Loss],
        [SweepColumn::Modulus, SweepColumn::Phase],
        [SweepColumn::Storage, SweepColumn::LossTangent],
        [SweepColumn::Modulus, SweepColumn::LossTangent],
    ];
    pairs.into_iter().find_map(|[a, b]| Some([column_of(looked, a)?, column_of(looked, b)?]))
}

/// First column whose name is that of a quantity of an oscillation, with its index.
fn column_of(looked: &InspectedTable, column: SweepColumn) -> Option<(SweepColumn, usize)> {
    Some((column, columns_of(looked, column).next()?))
}

/// Indices of the columns whose name is that of a quantity of an oscillation.
pub fn columns_of(looked: &InspectedTable, column: SweepColumn) -> impl Iterator<Item = usize> {
    let places = looked.columns.iter().zip(&looked.units).enumerate();
    places
        .filter(move |(_, (name, unit))| SweepColumn::from_name(name, unit.as_ref()) == Some(column))
        .map(|(place, _)| place)
}

impl OscillationRecord {
    /// True if the description of the experiment at `path` declares an oscillation. False if the description cannot be read; the reader then reports
    /// the error.
    pub fn is_described_in(path: &Path) -> bool {
        let Ok((toml_path, bytes)) = read_toml(path) else { return false };
        let found =
            text_of(&toml_path, &bytes).and_then(|text| TomlInput::parse(&toml_path, text)).and_then(|document| {
                let root = document.root();
                measurement_kind(root, root.required_table("measurement")?)
            });
        found.is_ok_and(|kind| kind == MeasurementKind::Oscillation)
    }

    /// Reads an oscillation. `path` is the directory that contains `experiment.toml`, or the path of the TOML file.
    ///
    /// # Errors
    /// [`Error::File`] if a file cannot be read, [`Error::Input`] for input that formats §1.2 refuses.
    pub fn read(path: &Path) -> Result<(Self, ExperimentFiles)> {
        let (toml_path, toml_bytes) = read_toml(path)?;
        let document = TomlInput::parse(&toml_path, text_of(&toml_path, &toml_bytes)?)?;
        let root = document.root();
        root.only(&["kind", "specimen", "rheometer", "vitreous", "robot", "instrument", "measurement"])?;
        let specimen = root.required_table("specimen")?;
        specimen.only(&["id", "species", "region"])?;
        let measurement = root.required_table("measurement")?;
        measurement.only(&[&["kind", "file", "heldout_hz", "source", "moduli", "phase_sign"], SWEEP_KEYS].concat())?;
        let csv_name = plain_path(measurement, "sweep.csv")?;
        let csv_path = toml_path.with_file_name(&csv_name);
        let remedy = "put the table where `file` in [measurement] says, beside the TOML";
        let csv_bytes = read_table(&toml_path, &csv_name, remedy)?;
        let layout = TableLayout::read(measurement)?;
        let text = decode_table(&csv_path, &csv_bytes, layout.encoding)?;
        refuse_long_lines(&csv_path, text.as_bytes())?;
        let columns = Columns::new(&csv_path, &text, measurement, &layout)?;
        let (mut rows, [n_incomplete, n_zero]) = columns.rows(&csv_path, &text, &layout)?;
        if read_choice(measurement, "phase_sign", &[false, true], |is_opposite| if is_opposite { "-" } else { "+" })?
            == Some(true)
        {
            rows.iter_mut().for_each(|row| row.pair[1] = -row.pair[1]);
        }
        refuse_other_signs(&csv_path, &columns, &rows)?;
        let as_written = rows.clone();
        sort(&mut rows);
        let poisson_ratio = poisson_ratio(root)?;
        if read_choice(measurement, "moduli", &[false, true], |is_young| if is_young { "young" } else { "shear" })?
            == Some(true)
        {
            columns.form.divide(&mut rows, 2.0 + 2.0 * poisson_ratio);
        }
        hold_out(measurement, &mut rows)?;
        refuse_several_states(&csv_path, columns.form, &rows)?;
        if let [first, .., last] = &rows[..]
            && last.frequency_hz <= (1.0 + ONE_FREQUENCY) * first.frequency_hz
        {
            let found = format!("all rows have the frequency {} Hz: this is no frequency sweep", first.frequency_hz);
            let remedy = "give a table of moduli over frequency; an amplitude sweep shows only where the gel is linear";
            return Err(Error::input(InputPlace::file(&csv_path), found, remedy));
        }
        refuse_several_sweeps(&csv_path, columns.form, &as_written)?;
        let n_fitted = rows.iter().filter(|row| !row.is_heldout).count();
        if n_fitted < FEWEST_FITTED {
            return Err(Error::input(
                InputPlace::file(&csv_path),
                format!("only {n_fitted} frequencies are fitted"),
                format!("give at least {FEWEST_FITTED}, because a law has three or more parameters"),
            ));
        }
        let sweep = Self {
            specimen_id: specimen.required_text("id", "id = \"porcine-01\"")?,
            poisson_ratio,
            form: columns.form,
            rows,
            n_incomplete,
            n_zero,
            source: measurement.text("source")?.unwrap_or_else(|| "not stated".into()),
        };
        let toml_name =
            toml_path.file_name().map_or("experiment.toml".into(), |name| name.to_string_lossy().into_owned());
        let understood = Interpretation::default();
        let files = ExperimentFiles {
            toml_name,
            toml_bytes: toml_bytes.clone(),
            csv_name,
            csv_bytes,
            log_file: None,
            notes: Vec::new(),
            interpretation: understood,
        };
        Ok((sweep, files))
    }

    /// True if every row has standard deviations.
    pub fn has_errors(&self) -> bool {
        self.rows.iter().all(|row| row.sd.is_some())
    }

    /// True if some frequencies are beyond the reach of instruments, so that the rows are a master curve or have a wrong unit.
    pub fn is_beyond_instruments(&self) -> bool {
        let [lowest_hz, highest_hz] = self.range_hz();
        lowest_hz < DIRECT_HZ[0] || highest_hz > DIRECT_HZ[1]
    }

    /// Lowest and highest frequency of the rows, in Hz.
    pub fn range_hz(&self) -> [f64; 2] {
        let ends = [self.rows.first(), self.rows.last()];
        ends.map(|row| row.map_or(1.0, |row| row.frequency_hz))
    }
}

/// Refuses moduli of which one is negative in every row: the table counts the phase, or the stress or strain, with the other sign.
fn refuse_other_signs(file: &Path, columns: &Columns, rows: &[SweepRow]) -> Result<()> {
    let are_negative = |of: &dyn Fn(&SweepRow) -> f64| !rows.is_empty() && rows.iter().all(|row| of(row) < 0.0);
    let refuse = |found: &str, remedy: &str| {
        let names = columns.pair.each_ref().map(|(_, name, _)| name.as_str());
        Err(Error::input(InputPlace::file(file).at_key(names.join("` and `")), found, remedy))
    };
    if are_negative(&|row| columns.form.moduli(row.pair)[0]) {
        let found = "the storage modulus is negative in every row, and a gel at rest has a positive one";
        return refuse(found, "correct the sign of stress or strain, which shifts the phase by 180°");
    }
    if are_negative(&|row| row.pair[1]) {
        let found = "the phase or the loss modulus is negative in every row, and no passive gel has such a one";
        let remedy = "write `phase_sign = \"-\"` in [measurement] if the table counts the phase with the other sign; remove the key if it is there";
        return refuse(found, remedy);
    }
    Ok(())
}

/// True if a row has the frequency of the one before it.
fn is_repeat(row: &SweepRow, next: &SweepRow) -> bool {
    next.frequency_hz <= (1.0 + ONE_FREQUENCY) * row.frequency_hz
}

/// Rows of each frequency, in the order of the table. Rows ascend by frequency.
pub fn rows_by_frequency(rows: &[SweepRow]) -> impl Iterator<Item = &[SweepRow]> {
    rows.chunk_by(is_repeat)
}

/// Sorts rows by frequency. Repeats of a frequency keep the order of the table, even if an instrument writes slightly different frequencies.
fn sort(rows: &mut Vec<SweepRow>) {
    let mut numbered: Vec<(usize, SweepRow)> = std::mem::take(rows).into_iter().enumerate().collect();
    numbered.sort_by(|a, b| a.1.frequency_hz.total_cmp(&b.1.frequency_hz));
    numbered.chunk_by_mut(|a, b| is_repeat(&a.1, &b.1)).for_each(|repeats| repeats.sort_by_key(|(place, _)| *place));
    rows.extend(numbered.into_iter().map(|(_, row)| row));
}

/// Refuses rows of one frequency whose moduli differ more than repeats do, or that differ alike at all frequencies: the table then holds sweeps at several
/// temperatures or strains, or of several specimens.
fn refuse_several_states(file: &Path, form: SweepForm, rows: &[SweepRow]) -> Result<()> {
    let modulus_pa = |row: &SweepRow| form.moduli(row.pair).into_iter().fold(0.0, f64::hypot);
    for repeats in rows_by_frequency(rows) {
        let moduli = || repeats.iter().map(modulus_pa);
        let (least, most) = (moduli().fold(f64::INFINITY, f64::min), moduli().fold(0.0, f64::max));
        if most > LIKE_REPEATS * least {
            return Err(Error::input(
                InputPlace::file(file),
                format!(
                    "{} rows have the frequency {:.4} Hz, and their moduli lie between {least:.3e} and {most:.3e} Pa: these are several sweeps, such as of several temperatures or strains",
                    repeats.len(),
                    repeats[0].frequency_hz
                ),
                "give a table with the rows of one sweep",
            ));
        }
    }
    // Noise scatters the differences of repeats about 0.
    let difference = |group: &[SweepRow]| {
        let logs = || group.iter().map(|row| modulus_pa(row).ln());
        logs().fold(f64::NEG_INFINITY, f64::max) - logs().fold(f64::INFINITY, f64::min)
    };
    let differences: Vec<f64> = rows_by_frequency(rows)
        .filter(|group| group.len() > 1)
        .map(difference)
        .filter(|difference| difference.is_finite())
        .collect();
    let n = differences.len() as f64;
    let mean = differences.iter().sum::<f64>() / n;
    let sd = (differences.iter().map(|difference| (difference - mean).powi(2)).sum::<f64>() / n).sqrt();
    if differences.len() >= FEWEST_DIFFERENCES && mean > ALIKE.max(APART * sd) {
        return Err(Error::input(
            InputPlace::file(file),
            format!(
                "{} frequencies have several rows, whose moduli differ by {:.0} % at each of them: these are several sweeps, such as of several temperatures or specimens",
                differences.len(),
                100.0 * mean.exp_m1()
            ),
            "give a table with the rows of one sweep",
        ));
    }
    Ok(())
}

/// Sweeps of rows in the order of the table: rows whose frequencies ascend or descend all along.
fn sweeps(rows: &[SweepRow]) -> Vec<&[SweepRow]> {
    let (mut parts, mut first, mut direction) = (Vec::new(), 0, 0.0);
    for (place, pair) in (1..).zip(rows.windows(2)) {
        let step = (pair[1].frequency_hz / pair[0].frequency_hz).ln();
        if step.abs() <= ONE_FREQUENCY {
            continue;
        }
        if step * direction < 0.0 {
            parts.push(&rows[first..place]);
            (first, direction) = (place, 0.0);
        } else {
            direction = step.signum();
        }
    }
    parts.push(&rows[first..]);
    parts.retain(|part| part.len() >= FEWEST_OF_SWEEP);
    parts
}

/// Differences of the logarithms of |G*| between the rows of a sweep and another sweep, which is interpolated between neighbouring frequencies.
fn differences_between(form: SweepForm, sweep: &[SweepRow], other: &[SweepRow]) -> Vec<f64> {
    let log_point = |row: &SweepRow| {
        let modulus_pa = form.moduli(row.pair).into_iter().fold(0.0, f64::hypot);
        [row.frequency_hz.ln(), modulus_pa.ln()]
    };
    let mut points: Vec<[f64; 2]> = other.iter().map(log_point).collect();
    points.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let difference = |row: &SweepRow| {
        let [x, y] = log_point(row);
        let above = points.partition_point(|[at, _]| *at < x);
        let (lower, upper) = (points.get(above.checked_sub(1)?)?, points.get(above)?);
        let gap = upper[0] - lower[0];
        let part = if gap > 0.0 { (x - lower[0]) / gap } else { 0.0 };
        (gap <= WIDEST_GAP.ln()).then(|| y - lower[1] - part * (upper[1] - lower[1]))
    };
    sweep.iter().filter_map(difference).filter(|difference| difference.is_finite()).collect()
}

/// Refuses sweeps one after the other whose moduli differ between equal frequencies: they are of several temperatures, strains or specimens.
fn refuse_several_sweeps(file: &Path, form: SweepForm, rows: &[SweepRow]) -> Result<()> {
    let parts = sweeps(rows);
    let pairs = (0..parts.len()).flat_map(|place| (0..place).map(move |other| [place, other]));
    for [place, other] in pairs {
        let differences = differences_between(form, parts[place], parts[other]);
        if differences.len() < FEWEST_DIFFERENCES {
            continue;
        }
        let n = differences.len() as f64;
        let mean = differences.iter().sum::<f64>() / n;
        let sd = (differences.iter().map(|difference| (difference - mean).powi(2)).sum::<f64>() / n).sqrt();
        let mut sizes: Vec<f64> = differences.iter().map(|difference| difference.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let typical = sizes[sizes.len() / 2];
        if mean.abs() > ALIKE.max(APART * sd) || typical > LIKE_REPEATS.ln() {
            return Err(Error::input(
                InputPlace::file(file),
                format!(
                    "the frequencies run through one range {} times, and the moduli of two runs differ by {:.0} %: these are several sweeps, such as of several temperatures or specimens",
                    parts.len(),
                    100.0 * typical.exp_m1()
                ),
                "give a table with the rows of one sweep",
            ));
        }
    }
    Ok(())
}

/// Reads the Poisson ratio from `[rheometer]`, otherwise from `[vitreous]`. The default is 0.5.
fn poisson_ratio(root: TomlTable<'_>) -> Result<f64> {
    for name in ["rheometer", "vitreous"] {
        let Some(table) = root.table(name)? else { continue };
        if name == "rheometer" {
            table.only(&["poisson_ratio"])?;
        }
        if let Some(ratio) = table.number("poisson_ratio")? {
            if ratio > -1.0 && ratio <= INCOMPRESSIBLE {
                return Ok(ratio);
            }
            return Err(table.refuse(
                "poisson_ratio",
                format!("{ratio} is not a possible Poisson ratio"),
                "give a value above −1 and at most 0.5",
            ));
        }
    }
    Ok(INCOMPRESSIBLE)
}

/// Column index, name and unit of each measured quantity.
struct Columns {
    form: SweepForm,
    /// True if the second quantity is written as the loss tangent.
    has_tangent: bool,
    frequency: (usize, String, ParsedUnit),
    pair: [(usize, String, ParsedUnit); 2],
    sd: Option<[(usize, String, ParsedUnit); 2]>,
}

impl Columns {
    fn new(file: &Path, text: &str, measurement: TomlTable<'_>, layout: &TableLayout) -> Result<Self> {
        let names = ColumnNames::new(file, text, layout);
        let described = measurement.table("columns")?;
        let keys = SweepColumn::ALL.map(SweepColumn::key);
        described.map_or(Ok(()), |table| table.only(&keys))?;
        let units = Units::read(measurement, &keys)?;
        let find = |wanted: SweepColumn| -> Result<Option<(usize, String, ParsedUnit)>> {
            let name = match described {
                Some(table) if table.has(wanted.key()) => column(table, wanted.key())?,
                Some(_) => return Ok(None),
                None => {
                    let is_it = |name: &&std::borrow::Cow<'_, str>| split_unit(name).0 == wanted.key();
                    match names.all().iter().find(is_it) {
                        Some(name) => ColumnName::Named(name.to_string()),
                        None => return Ok(None),
                    }
                }
            };
            let unit = match wanted {
                SweepColumn::LossTangent => units.of_ratio(wanted.key(), &name)?,
                _ => units.of(wanted.key(), wanted.dimension(), &name)?,
            };
            let (place, shown) = names.place(&name)?;
            Ok(Some((place, shown, unit)))
        };
        let missing = |what: &str, example: &str| {
            let found = names.all().join("`, `");
            Error::input(
                InputPlace::file(file).at_line(layout.header_line.unwrap_or(layout.first_row_line)),
                format!("there is no column for the {what}; the header has `{found}`"),
                format!("name the column {example}, or assign it in [measurement.columns]"),
            )
        };
        let frequency = find(SweepColumn::Frequency)?.ok_or_else(|| missing("frequency", "`frequency_hz`"))?;
        let pair = |a, b| Ok::<_, Error>(find(a)?.zip(find(b)?).map(|(a, b)| [a, b]));
        let polar = (SweepForm::ModulusAndPhase, [SweepColumn::Modulus, SweepColumn::Phase]);
        let moduli = (SweepForm::StorageAndLoss, [SweepColumn::Storage, SweepColumn::Loss]);
        for (form, [first, second]) in [moduli, polar] {
            if let Some(columns) = pair(first, second)? {
                let sd = match form {
                    SweepForm::StorageAndLoss => pair(SweepColumn::StorageSd, SweepColumn::LossSd)?,
                    SweepForm::ModulusAndPhase => pair(SweepColumn::ModulusSd, SweepColumn::PhaseSd)?,
                };
                return Ok(Self { form, has_tangent: false, frequency, pair: columns, sd });
            }
        }
        for (form, [first, _]) in [moduli, polar] {
            if let Some(columns) = pair(first, SweepColumn::LossTangent)? {
                for sd in [SweepColumn::StorageSd, SweepColumn::LossSd, SweepColumn::ModulusSd, SweepColumn::PhaseSd] {
                    if let Some((_, name, _)) = find(sd)? {
                        return Err(Error::input(
                            InputPlace::file(file).at_key(name),
                            "errors are read of a loss modulus or a phase, not of a loss tangent",
                            "write the loss modulus or the phase with its error, or remove the columns of errors",
                        ));
                    }
                }
                return Ok(Self { form, has_tangent: true, frequency, pair: columns, sd: None });
            }
        }
        Err(missing("moduli", "`storage_pa` and `loss_pa`, or `modulus_pa` and `phase_deg`"))
    }

    /// Reads the table's rows. Returns the measured rows, the number of rows that lack a number, and the number of rows of zeros, which programs write for the rows of other
    /// tests.
    fn rows(&self, file: &Path, text: &str, layout: &TableLayout) -> Result<(Vec<SweepRow>, [usize; 2])> {
        let (mut rows, mut n_incomplete, mut n_zero, mut first_zero) = (Vec::new(), 0, 0, None);
        let lines = text.lines().enumerate().skip(layout.first_row_line - 1);
        let is_row = |(index, line): &(usize, &str)| {
            layout.table_of(index + 1).is_some() && !is_blank_or_comment(line, layout.comment.as_deref())
        };
        for (index, line) in lines.filter(is_row) {
            let cells = cells(line, layout.delimiter);
            let number = |(place, name, unit): &(usize, String, ParsedUnit)| -> Result<Option<f64>> {
                let cell = cells.get(*place).map_or("", |cell| cell.as_ref());
                if cell.is_empty() {
                    return Ok(None);
                }
                let found = layout.number(cell).ok_or_else(|| {
                    let decimal = layout.decimal.name();
                    let found = format!("`{cell}` is not a number with the decimal sign `{decimal}`");
                    let remedy = "correct it, or leave the cell empty if nothing was measured";
                    Error::input(InputPlace::file(file).at_line(index + 1).at_key(name.as_str()), found, remedy)
                })?;
                Ok(Some(unit.to_si(found)))
            };
            let refuse = |(_, name, _): &(usize, String, ParsedUnit), found: String, remedy: &str| {
                Error::input(InputPlace::file(file).at_line(index + 1).at_key(name.as_str()), found, remedy)
            };
            let both = |columns: &[(usize, String, ParsedUnit); 2]| {
                Ok::<_, Error>(number(&columns[0])?.zip(number(&columns[1])?))
            };
            let (frequency_hz, pair) = (number(&self.frequency)?, both(&self.pair)?);
            let sd = self.sd.as_ref().map(both).transpose()?;
            let (Some(frequency_hz), Some(pair), None | Some(Some(_))) = (frequency_hz, pair, sd) else {
                n_incomplete += 1;
                continue;
            };
            if frequency_hz == 0.0 {
                match pair {
                    (0.0, 0.0) => n_zero += 1,
                    _ => first_zero = first_zero.or(Some(index + 1)),
                }
                continue;
            }
            if !(FREQUENCIES_HZ[0]..=FREQUENCIES_HZ[1]).contains(&frequency_hz) {
                let [lowest, highest] = FREQUENCIES_HZ;
                let found = format!("{frequency_hz} Hz is outside the range from {lowest:e} to {highest:e} Hz");
                return Err(refuse(&self.frequency, found, "correct it, or the column's unit"));
            }
            let sd = sd.flatten().map(<[f64; 2]>::from);
            if let Some((column, sd)) = self.sd.iter().flatten().zip(sd.iter().flatten()).find(|(_, sd)| **sd <= 0.0) {
                let remedy = "give a standard deviation above 0, or remove the error columns";
                return Err(refuse(column, format!("the standard deviation is {sd}"), remedy));
            }
            let pair = match (self.has_tangent, self.form) {
                (false, _) => pair.into(),
                (true, SweepForm::StorageAndLoss) => [pair.0, pair.0 * pair.1],
                (true, SweepForm::ModulusAndPhase) => [pair.0, pair.1.atan()],
            };
            rows.push(SweepRow { frequency_hz, pair, sd, is_heldout: false });
        }
        let place = || InputPlace::file(file).at_key(self.frequency.1.as_str());
        match first_zero {
            _ if rows.is_empty() && (n_zero > 0 || first_zero.is_some()) => Err(Error::input(
                place(),
                "the frequency is 0 in every row: this is no oscillation",
                "give the table of a frequency sweep; of a creep or a relaxation name the columns of time, force and position",
            )),
            Some(line) => Err(Error::input(
                place().at_line(line),
                "the frequency is 0, and the moduli are not",
                "correct it, or delete the row if nothing was measured",
            )),
            None => Ok((rows, [n_incomplete, n_zero])),
        }
    }
}

/// Marks rows as held out: the rows with the frequencies in `heldout_hz`, or by default those of every third frequency starting with the second. Repeats of a fitted
/// frequency would not test the law.
fn hold_out(measurement: TomlTable<'_>, rows: &mut [SweepRow]) -> Result<()> {
    let Some(wanted_hz) = measurement.numbers("heldout_hz")? else {
        if rows_by_frequency(rows).count() >= FEWEST_TO_HOLD_OUT {
            rows.chunk_by_mut(is_repeat).skip(1).step_by(3).flatten().for_each(|row| row.is_heldout = true);
        }
        return Ok(());
    };
    for wanted_hz in wanted_hz {
        let is_it = |row: &SweepRow| (row.frequency_hz / wanted_hz - 1.0).abs() < SAME_FREQUENCY;
        let mut n_found = 0;
        for row in rows.chunk_by_mut(is_repeat).filter(|repeats| repeats.iter().any(is_it)).flatten() {
            row.is_heldout = true;
            n_found += 1;
        }
        if n_found == 0 {
            let found = format!("the table has no row at {wanted_hz} Hz");
            return Err(measurement.refuse("heldout_hz", found, "list frequencies of the table, in Hz"));
        }
    }
    Ok(())
}

#[cfg(test)]
#[path = "sweep_tests.rs"]
mod tests;
