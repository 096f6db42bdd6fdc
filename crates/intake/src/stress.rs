//! `init` for stress and strain over time, and for published tables of a compliance or a modulus: stress is read as the force, and strain as the position
//! (docs/experiment.md).

use super::preamble::Preamble;
use super::request::InitRequest;
use base::error::{Error, InputPlace, Result, Setting};
use base::units::Dimension;
use record::Control;
use record::table::{InspectedTable, ParsedUnit, TableSettings, bracketed, columns_beside, factor, split_unit, unit};

/// Words by which the stress column is recognised.
const STRESS: [&str; 9] =
    ["stress", "spannung", "contrainte", "esfuerzo", "sforzo", "tensão", "напряжение", "応力", "应力"];
/// Words by which the strain column is recognised.
pub(super) const STRAIN: [&str; 9] =
    ["strain", "deform", "dehnung", "stauchung", "déform", "деформация", "ひずみ", "歪み", "应变"];
/// Words of strains, in tables without a column that is called by [`STRAIN`].
const ELONGATION: [&str; 3] = ["elongation", "élongation", "allongement"];
/// Symbols of stresses and of strains, as whole names before the unit.
const SYMBOLS: [[&str; 4]; 2] = [["τ", "σ", "tau", "sigma"], ["γ", "ε", "gamma", "epsilon"]];
/// Words and symbols by which the column of a relaxation modulus is recognised.
const MODULUS: [&str; 7] = ["modulus", "g(t)", "e(t)", "g_relax", "e_relax", "relaxationsmodul", "module"];
/// Words and symbols by which the column of a creep compliance is recognised.
pub(super) const COMPLIANCE: [&str; 5] = ["compliance", "j(t)", "d(t)", "nachgiebigkeit", "complaisance"];
/// Words by which a column of a measured quantity is recognised.
const MEASURED: [&str; 12] = [
    "stress",
    "spannung",
    "contrainte",
    "strain",
    "dehnung",
    "force",
    "kraft",
    "load",
    "position",
    "displacement",
    "weg",
    "torque",
];
/// Words of quantities that are divided by a value.
const RELATIVE: [&str; 9] =
    ["normalis", "normaliz", "normiert", "relativ", "dimensionless", "fraction of", "scaled", "归一化", "無次元"];
/// Words that exclude a column of moduli over frequency.
const OF_FREQUENCY: [&str; 5] = ["storage", "loss", "complex", "'", "tan"];
/// Words that exclude a column: a column of rates is neither stress nor strain.
const RATE: [&str; 9] =
    ["rate", "geschwindigkeit", "gradient", "vitesse", "velocidad", "velocità", "taxa", "скорость", "速"];
/// Units of a strain as a plain number.
const PLAIN: [&str; 2] = ["1", "-"];
/// Words and symbols in a strain's name that state its unit, the longer ones first.
const PARTS: [(&str, f64); 18] = [
    ("microstrain", 1e-6),
    ("ustrain", 1e-6),
    ("µstrain", 1e-6),
    ("um/mm", 1e-3),
    ("µm/mm", 1e-3),
    ("um/m", 1e-6),
    ("µm/m", 1e-6),
    ("µε", 1e-6),
    ("millistrain", 1e-3),
    ("mm/mm", 1.0),
    ("mm/m", 1e-3),
    ("‰", 1e-3),
    ("percent", 1e-2),
    ("prozent", 1e-2),
    ("pourcent", 1e-2),
    ("pct", 1e-2),
    ("%", 1e-2),
    ("frac", 1.0),
];
/// Words that name a test in tension or compression, whose strain is the stress divided by the modulus without a factor.
pub(super) const UNIAXIAL: [&str; 29] = [
    "tensil",
    "tension",
    "elongation",
    "élongation",
    "allongement",
    "compres",
    "axial",
    "young",
    "zug",
    "druck",
    "traction",
    "de tracci",
    "a tracci",
    "di trazione",
    "a trazione",
    "de tração",
    "à tração",
    "растяг",
    "растяж",
    "сжат",
    "сжим",
    "引張",
    "引っ張り",
    "圧縮",
    "拉伸",
    "压缩",
    "壓縮",
    "인장",
    "압축",
];
/// Words of stresses and strains that name such a test, unless a column is of a rotation.
const OF_LENGTH: [&str; 5] = ["engineering", "nominal", "true stress", "true strain", "stauchung"];
/// Words of a shear.
const SHEAR: [&str; 15] = [
    "shear",
    "scher",
    "schubs",
    "cisail",
    "cisalh",
    "cizall",
    "cortante",
    "di taglio",
    "сдвигов",
    "напряжение сдвига",
    "деформация сдвига",
    "せん断",
    "剪断",
    "剪切",
    "전단",
];
/// Words in the names of columns of a rotating rheometer.
pub(super) const ROTATION: [&str; 18] = joined(["torque", "rotation", "drehmoment"], SHEAR);
/// Words in the names of positions that testing machines write.
pub(super) const OF_SPECIMEN: [&str; 11] = [
    "extension",
    "elongation",
    "crosshead",
    "cross-head",
    "stroke",
    "standard travel",
    "course standard",
    "standardweg",
    "traverse",
    "verlängerung",
    "allongement",
];
/// Words in the names of the force along a rotating rheometer's axis.
const ALONG_AXIS: [&str; 3] = ["normal", "axial", "fn"];
/// Further words in the names of positions that testing machines write.
const MOTION: [&str; 5] = ["displac", "déplac", "weg", "position", "travel"];
/// Words of a stress or a strain that is relative to the deformed specimen. One relative to the first length is read before it.
const DEFORMED: [&str; 2] = ["true", "cauchy"];
/// Words that exclude such a test.
pub(super) const MULTIAXIAL: [&str; 17] = joined(["biaxial", "triaxial"], SHEAR);
/// Words in the names of stresses and strains that are not those of the test: settings, statistics, other directions, and parts of another quantity.
const BESIDE: [&str; 42] = [
    "normal",
    "residual",
    "yield",
    "wall",
    "setpoint",
    "set",
    "target",
    "soll",
    "command",
    "commanded",
    "initial",
    "max",
    "maximum",
    "min",
    "minimum",
    "sd",
    "std",
    "stdev",
    "se",
    "sem",
    "error",
    "err",
    "uncertainty",
    "recoverable",
    "recovery",
    "recovered",
    "residuals",
    "transverse",
    "lateral",
    "radial",
    "hoop",
    "elastic",
    "viscous",
    "plastic",
    "static",
    "offset",
    "raw",
    "limit",
    "amplitude",
    "normalspannung",
    "sollspannung",
    "solldehnung",
];
/// Largest strain that is taken as a plain number if no unit is stated. A larger one is more likely in percent.
const LARGEST_PLAIN: f64 = 1.0;
/// Largest difference from 1 of the first or largest value of a modulus or compliance without a unit that may be relative.
const NEAR_ONE: f64 = 0.05;
/// Names of the length of a specimen between grips.
const GAUGE: [&str; 5] = ["gauge length", "gage length", "specimen length", "grip separation", "einspannlänge"];
/// Poisson's ratio of a specimen that is nearly all water.
const OF_WATER: f64 = 0.5;

/// All words of two lists.
const fn joined<const A: usize, const B: usize, const ALL: usize>(
    first: [&'static str; A],
    second: [&'static str; B],
) -> [&'static str; ALL] {
    assert!(ALL == A + B);
    let mut all = [""; ALL];
    let mut place = 0;
    while place < ALL {
        all[place] = if place < A { first[place] } else { second[place - A] };
        place += 1;
    }
    all
}

/// Size of the unit that a strain's name states, and whether the name can be read: a bracket may hold another unit.
fn stated_part(name: &str) -> (Option<f64>, bool) {
    let name = name.to_lowercase().replace('μ', "µ");
    if has_changed_percent(&name) {
        return (None, false);
    }
    if let Some((_, part)) = PARTS.iter().find(|(text, _)| name.contains(text)) {
        return (Some(*part), true);
    }
    if name.split_once(" in ").is_some_and(|(_, unit)| PLAIN.contains(&unit.trim())) {
        return (Some(1.0), true);
    }
    match bracketed(&name).map(|(_, text)| text.trim()) {
        None => (None, true),
        Some(text) => {
            let is_plain = text.is_empty() || PLAIN.contains(&text);
            (is_plain.then_some(1.0), is_plain)
        }
    }
}

/// True if a bracket at the end of a name changes a percent sign, as in `(%/100)` or `(m%)`.
fn has_changed_percent(name: &str) -> bool {
    bracketed(name).and_then(|(_, text)| text.split_once('%')).is_some_and(|(before, behind)| {
        before.ends_with(char::is_alphanumeric) || behind.trim_start().starts_with(['/', '×', '*', '·'])
    })
}

/// True if the user's text for a column is the column's name, or its number from 1.
pub(super) fn is_told(told: &str, name: &str, place: usize) -> bool {
    told == name || told == (place + 1).to_string()
}

/// Whether a column's name contains one of the words and none of the others.
pub(super) fn called(name: &str, words: &[&str], others: &[&str]) -> bool {
    let name = name.to_lowercase();
    let contains = |word: &&str| name.contains(word);
    words.iter().any(contains) && !others.iter().any(contains)
}

/// Reason that a line above the table, or other columns, give for tension, compression or bending.
fn said_beside(looked: &InspectedTable) -> Option<String> {
    let preamble = Preamble(&looked.preamble);
    let said = preamble.uniaxial_line().map(|line| format!("a line above the table is `{line}`"));
    let gauge = || Some(format!("line {} states the gauge length of a specimen", preamble.length_m(&GAUGE)?.line));
    said.or_else(gauge).or_else(|| measured_beside(looked))
}

/// True for a table of a rotation or a shear, by the names or symbols of its columns.
fn rotates(looked: &InspectedTable) -> bool {
    let is_of_shear = |name: &String| ["τ", "tau", "γ", "gamma"].contains(&symbol(name).as_str());
    looked.columns.iter().any(|name| called(name, &ROTATION, &[]) || is_of_shear(name))
}

/// Reason that a force and a displacement beside stress and strain give for tension or compression: a testing machine measures both, and a rheometer neither. `None` in a
/// table of a rotation.
fn measured_beside(looked: &InspectedTable) -> Option<String> {
    let column = |dimension: Dimension, is_named: fn(&str) -> bool| {
        let mut columns = looked.columns.iter().zip(&looked.units);
        let is_one = |unit: &Option<ParsedUnit>| unit.as_ref().is_some_and(|unit| unit.dimension == dimension);
        columns.find(|(name, unit)| is_one(unit) && is_named(name)).map(|(name, _)| name)
    };
    let force = column(Dimension::Force, |name| !called(name, &ALONG_AXIS, &[]))?;
    let length = column(Dimension::Length, |name| called(name, &OF_SPECIMEN, &[]) || called(name, &MOTION, &[]))?;
    (!rotates(looked)).then(|| format!("`{force}` and `{length}` are columns of a testing machine"))
}

/// True if a column or a line above the table names a relaxation.
pub(super) fn says_relaxation(looked: &InspectedTable) -> bool {
    let above = looked.preamble.iter().map(|(_, line)| line);
    looked.columns.iter().chain(above).any(|text| called(text, &["relax", "step strain"], &[]))
}

/// The column of a quantity among those that are called so: the only one that is measured along the test and relative to the undeformed specimen, or the only one without
/// another word in its name. Names that differ only in their units are the same quantity.
///
/// # Errors
/// [`Error::Input`] if several remain.
fn only_one<T: Copy>(looked: &InspectedTable, found: &[(usize, T)], setting: Setting) -> Result<(usize, T)> {
    let name = |place: usize| looked.columns[place].as_str();
    let words = |place: usize| {
        let text = name(place).to_lowercase();
        text.split(|c: char| !c.is_alphabetic()).map(String::from).collect::<Vec<String>>()
    };
    let is_beside = |place: usize| words(place).iter().any(|word| BESIDE.contains(&word.as_str()));
    let without = |list: Vec<(usize, T)>, is_left_out: &dyn Fn(usize) -> bool| {
        let kept: Vec<(usize, T)> = list.iter().copied().filter(|(place, _)| !is_left_out(*place)).collect();
        if kept.is_empty() { list } else { kept }
    };
    let measured = without(found.to_vec(), &is_beside);
    let relative = without(measured, &|place| called(name(place), &DEFORMED, &[]));
    let left = without(relative, &|place| {
        let quantity = quantity(name(place));
        !STRESS.iter().chain(&STRAIN).any(|word| quantity == *word)
    });
    let units = &looked.units;
    let is_twice =
        left[1..].iter().any(|(place, _)| name(*place) == name(left[0].0) && units[*place] == units[left[0].0]);
    if !is_twice && left.iter().all(|(place, _)| quantity(name(*place)) == quantity(name(left[0].0))) {
        return Ok(left[0]);
    }
    if is_twice {
        let numbers: Vec<String> = left.iter().map(|(place, _)| (place + 1).to_string()).collect();
        return Err(Error::input(
            InputPlace::setting(setting),
            format!(
                "{} columns are called `{}`: those with the numbers {}",
                left.len(),
                name(left[0].0),
                numbers.join(", ")
            ),
            format!("give the number of the right one: `{setting} {}`", numbers[0]),
        ));
    }
    let names: Vec<String> = left.iter().map(|(place, _)| format!("`{}`", name(*place))).collect();
    Err(Error::input(
        InputPlace::setting(setting),
        format!("several columns can be meant: {}", names.join(", ")),
        format!("name the right one: `{setting} NAME`"),
    ))
}

/// Lower-case name of a column without its unit.
fn quantity(name: &str) -> String {
    let (stem, unit) = split_unit(name);
    let stem = match bracketed(name) {
        Some((stem, _)) if unit.is_none() && stated_part(name).0.is_some() => stem,
        _ => stem,
    };
    stem.trim().trim_end_matches('%').trim_start_matches('%').trim().to_lowercase()
}

/// Lower-case text of a column's name before its unit.
fn symbol(name: &str) -> String {
    let name = name.to_lowercase().replace("(t)", "").replace(" in ", "/");
    name.split(['(', '[', '/']).next().unwrap_or_default().trim().to_string()
}

/// True if a name is that of a modulus or compliance of tension by its symbol, as in `Relaxation modulus E(t)`.
fn is_of_young(name: &str) -> bool {
    let is_symbol = |word: &str| ["e(t)", "d(t)"].contains(&word.trim_matches([',', ';', ':']));
    ["e", "d", "e_relax"].contains(&symbol(name).as_str())
        || name.to_lowercase().split_whitespace().any(is_symbol) && !called(name, &MULTIAXIAL, &[])
}

/// True if a name is that of a quantity divided by its first value, as in `G(t)/G0`.
pub(super) fn is_ratio(name: &str) -> bool {
    let stem = quantity(name);
    let over = stem.split_once('/').map(|(_, over)| over.trim());
    RELATIVE.iter().any(|word| stem.contains(word))
        || stem.contains("reduced") && stated_pressure(name).is_none()
        || over.is_some_and(|over| {
            !over.starts_with("gpa")
                && (over.starts_with(['g', 'e', 'j', 'd']) || over.starts_with("max") || over.starts_with("init"))
        })
}

/// Unit of a stress or a modulus that a name states.
fn stated_pressure(name: &str) -> Option<ParsedUnit> {
    split_unit(name).1.filter(|unit| unit.dimension == Dimension::Pressure)
}

/// True if a name is that of the modulus of an indentation, which contains Poisson's ratio of the gel.
pub(super) fn is_reduced_modulus(name: &str) -> bool {
    let is_symbol =
        name.split(|c: char| c.is_whitespace() || "([,;".contains(c)).any(|word| ["E*", "Er", "E_r"].contains(&word));
    called(name, &["modul"], &["complex"])
        && (called(name, &["plane strain", "indentation"], &[]) || called(name, &["reduced"], &["relax"]) || is_symbol)
}

/// True if a table of a modulus over time says that it is one of a relaxation, by a word or by a symbol such as `G(t)`. Stiffness over the time of a gelation, of ageing or of a
/// sweep looks alike.
pub(super) fn is_of_relaxation(looked: &InspectedTable) -> bool {
    // A rate of sampling is no frequency of a test.
    let has = |words: &[&str]| looked.preamble.iter().any(|(_, line)| called(line, words, &["sampl", "rate", "acqui"]));
    let is_symbol = |name: &String| {
        let symbol = symbol(name);
        ["g", "e", "g_relax", "e_relax"].contains(&symbol.as_str()) || called(name, &["g(t)", "e(t)"], &[])
    };
    says_relaxation(looked) || looked.columns.iter().any(is_symbol) && !has(&["time sweep", "oscillat", " hz"])
}

/// True if a name does not end in a bracket that holds a unit.
fn has_no_unit(name: &str) -> bool {
    let name = name.trim_end();
    name.ends_with("(t)") || !name.ends_with([')', ']'])
}

/// Unit that the name of a compliance states, in brackets or behind its words; `None` without one.
fn unit_of_compliance(name: &str) -> Option<String> {
    let behind = || {
        let (stem, text) = [" in ", "/"].iter().find_map(|joint| name.split_once(joint))?;
        let is_unit = ["Pa", "psi", "bar", "/N"].iter().any(|unit| text.contains(unit));
        is_unit.then(|| if stem.ends_with(" 1") { format!("1/{text}") } else { text.to_string() })
    };
    bracketed(name).filter(|_| !has_no_unit(name)).map(|(_, text)| text.to_string()).or_else(behind)
}

/// Size of the unit of a compliance in 1/Pa. A name without a unit is in 1/Pa, unless it is only a letter. `None` for another unit.
fn per_pa(name: &str, symbol: &str) -> Option<f64> {
    let Some(text) = unit_of_compliance(name) else {
        return (symbol.len() > 1 || name.ends_with("(t)")).then_some(1.0);
    };
    let text = text.replace(" / ", "/");
    let text = text.trim();
    let (many, of) = match text.split_once([' ', '·', '*']) {
        Some((many, of)) => (factor(many)?, of.trim()),
        None => (1.0, text),
    };
    let inverse = of.strip_prefix("1/").or_else(|| ["^-1", "⁻¹", "-1"].iter().find_map(|end| of.strip_suffix(end)));
    // An area over a force is the inverse of a stress.
    let turned = || of.split_once('/').map(|(area, force)| format!("{}/{}", force.trim(), area.trim()));
    let pressure = inverse.map(|text| text.trim().to_string()).or_else(turned).and_then(|text| unit(&text));
    pressure.filter(|unit| unit.dimension == Dimension::Pressure).map(|unit| many / unit.to_si(1.0))
}

/// Refuses a modulus or a compliance over time whose unit is not known.
///
/// # Errors
/// [`Error::Input`] for such a column in a table without the quantities of a record.
fn refuse_unknown_unit(looked: &InspectedTable, given: &TableSettings) -> Result<()> {
    let is_given = given.columns[1..3].iter().chain(&given.axes).any(Option::is_some);
    let is_measured = |name: &String| called(name, &MEASURED, &MODULUS);
    let has_dimension = |dimension| looked.units.iter().flatten().any(|unit| unit.dimension == dimension);
    if is_given
        || looked.columns.iter().any(is_measured)
        || [Dimension::Force, Dimension::Length, Dimension::Frequency].into_iter().any(has_dimension)
    {
        return Ok(());
    }
    let is_of = |name: &str, words: &[&str], symbols: [&str; 2]| {
        let words: Vec<&str> = words.iter().copied().filter(|word| !word.contains('(')).collect();
        called(name, &words, &OF_FREQUENCY) || symbols.iter().any(|symbol| name.trim_start().starts_with(symbol))
    };
    let kinds = [
        (&MODULUS[..], ["G(t)", "E(t)"], "Pa", "G(t) [Pa]"),
        (&COMPLIANCE[..], ["J(t)", "D(t)"], "1/Pa", "J(t) [1/Pa]"),
    ];
    let unknown = looked.columns.iter().zip(&looked.units).find_map(|(name, unit)| {
        let kind = kinds.iter().find(|(words, symbols, ..)| is_of(name, words, *symbols))?;
        (unit.is_none() && bracketed(name).is_some() && !has_no_unit(name)).then_some((name, kind))
    });
    let Some((name, (_, _, plain, example))) = unknown else { return Ok(()) };
    Err(Error::input(
        InputPlace::default().at_key(name.as_str()),
        "the unit of this column is not known",
        format!("write its values in {plain} into the table, and name it as in `{example}`"),
    ))
}

/// Refuses a compliance beside a stress: the strain from which it was computed is not in the table.
///
/// # Errors
/// [`Error::Input`] for such a column, if no other column is a strain.
fn refuse_compliance_beside_stress(
    looked: &InspectedTable,
    stresses: &[(usize, f64)],
    strains: &[(usize, Option<f64>)],
) -> Result<()> {
    let name = |place: usize| looked.columns[place].as_str();
    let is_compliance = |place: usize| called(name(place), &COMPLIANCE, &OF_FREQUENCY);
    let found = (0..looked.columns.len()).find(|place| is_compliance(*place));
    let (Some(compliance), [(stress, _), ..]) = (found, stresses) else { return Ok(()) };
    // A machine and an instrument with a tip also have compliances, beside a force or a position.
    let is_of_machine =
        looked.units.iter().flatten().any(|unit| matches!(unit.dimension, Dimension::Force | Dimension::Length));
    let has_other_unit = per_pa(name(compliance), &symbol(name(compliance))).is_none();
    if strains.iter().any(|(place, _)| !is_compliance(*place)) || is_of_machine || has_other_unit {
        return Ok(());
    }
    Err(Error::input(
        InputPlace::default().at_key(name(compliance)),
        format!("a compliance beside `{}` is no strain, and the table has none", name(*stress)),
        "multiply the compliance by the stress into a column such as `Strain [1]`; or delete the column of the stress if the stress never changes: the compliance is then read alone",
    ))
}

/// Settings for a machine's stress beside an extension, for a specimen of known cross-section: the stress is read as a force. `None` if the table has no such column, or several,
/// or a force.
pub(super) fn stress_of_specimen(
    request: &InitRequest,
    looked: &InspectedTable,
    area_m2: f64,
) -> Option<TableSettings> {
    let given = &request.known_columns;
    let has_dimension = |dimension| looked.units.iter().flatten().any(|unit| unit.dimension == dimension);
    let named = given.columns[1].as_ref();
    if named.is_none() && has_dimension(Dimension::Force) || !has_dimension(Dimension::Length) {
        return None;
    }
    let told = given.units[1].as_deref().map(unit);
    let columns = looked.columns.iter().zip(&looked.units).enumerate();
    let stresses = columns.filter_map(|(place, (name, unit))| {
        let size = told.clone().unwrap_or_else(|| unit.clone()).filter(|unit| unit.dimension == Dimension::Pressure)?;
        let is_stress =
            called(name, &STRESS, &RATE) && !called(name, &MULTIAXIAL, &[]) && !called(name, &DEFORMED, &[]);
        named.map_or(is_stress, |named| is_told(named, name, place)).then(|| (place, size.to_si(1.0)))
    });
    let found: Vec<(usize, f64)> = stresses.collect();
    let [(place, pa)] = found[..] else { return None };
    let mut settings = given.clone();
    settings.columns[1] = Some((place + 1).to_string());
    settings.units[1] = Some(format!("{:e} N", pa * area_m2));
    Some(settings)
}

/// Settings for a strain beside a machine's force, for a specimen of known length: the strain is read as a position. `None` if the table has no such column, or several.
pub(super) fn strain_of_specimen(
    request: &InitRequest,
    looked: &InspectedTable,
    length_mm: f64,
) -> Option<TableSettings> {
    let given = &request.known_columns;
    let named = given.columns[2].as_ref();
    let columns = || looked.columns.iter().zip(&looked.units).enumerate();
    let strains = columns().filter_map(|(place, (name, unit))| {
        let part = match (given.units[2].as_deref().map(str::trim), unit) {
            (Some("%"), _) => 1e-2,
            (Some("1" | "-"), _) => 1.0,
            (Some(_), _) => return None,
            (None, Some(unit)) if unit.dimension == Dimension::Ratio => unit.to_si(1.0),
            (None, Some(_)) => return None,
            (None, None) => stated_part(name).0?,
        };
        let is_named = named.is_some_and(|named| is_told(named, name, place));
        (is_named
            || named.is_none()
                && called(name, &STRAIN, &RATE)
                && !called(name, &MULTIAXIAL, &[])
                && !called(name, &DEFORMED, &[]))
        .then_some((place, part))
    });
    let found: Vec<(usize, f64)> = strains.collect();
    let [(place, part)] = found[..] else { return None };
    let mut settings = given.clone();
    settings.columns[2] = Some((place + 1).to_string());
    settings.units[2] = Some(format!("{} mm", part * length_mm));
    Some(settings)
}

/// Stress and strain over time, of which one is commanded.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct StressStrain {
    /// Columns to read, with units. A stress of 1 Pa is read as a force of 1 N, and a strain of 1 as a position of 1 m.
    pub given: TableSettings,
    /// Strain divided by stress for a creep compliance of 1, which is 2 + 2ν for Poisson's ratio ν.
    pub compliance: f64,
    /// Quantity that is commanded with the constant value 1, in a table of a compliance or a modulus; `None` if the table has both stress and strain.
    pub constant: Option<Control>,
    /// True if the user says that the columns are stress and strain, whatever their names, or that the strain is a plain number.
    pub is_told: bool,
    /// True if the sizes of a specimen have turned a machine's force and position into them.
    pub is_of_specimen: bool,
    /// Reason for which the test is one of tension, compression or bending, if no column says so.
    uniaxial_because: Option<String>,
    /// True if the strain is taken as a plain number because nothing states its unit.
    is_assumed_plain: bool,
}

/// A unit of `many` times another.
fn so_many(many: f64, of: &str) -> Option<String> {
    Some(if many == 1.0 { of.to_string() } else { format!("{many} {of}") })
}

impl StressStrain {
    /// Finds the columns of stress and strain, of a modulus, or of a compliance; `None` if the table has none of them.
    ///
    /// # Errors
    /// [`Error::Input`] for a strain in a unit that is not known.
    pub fn of(looked: &InspectedTable, given: &TableSettings, poisson_ratio: Option<f64>) -> Result<Option<Self>> {
        let told = |place: usize, dimension: Dimension| {
            let parsed = given.units[place].as_deref().and_then(unit);
            parsed.filter(|unit| unit.dimension == dimension).map(|unit| unit.to_si(1.0))
        };
        let is_plain = given.units[2].as_deref().is_some_and(|text| PLAIN.contains(&text.trim()));
        let strain = if is_plain { Some(1.0) } else { told(2, Dimension::Ratio) };
        let told_stress = told(1, Dimension::Pressure);
        let is_of_other = |place: usize, dimension: Dimension| {
            given.units[place].as_deref().and_then(unit).is_some_and(|unit| unit.dimension == dimension)
        };
        let has_force_or_length = is_of_other(1, Dimension::Force) || is_of_other(2, Dimension::Length);
        if has_force_or_length || given.axes.iter().any(Option::is_some) {
            return Ok(None);
        }
        if let Some((stress, strain)) = told_stress.zip(strain) {
            return Self::told(looked, given, [stress, strain], poisson_ratio);
        }
        let told_strain = strain;
        let told_compliance = given.units[2].as_deref().and_then(|text| per_pa(&format!("J ({text})"), "J"));
        // Column that the user names for a role, by its name or its number.
        let named = |role: usize| {
            let name = given.columns[role].as_ref()?;
            let number = name.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
            looked.columns.iter().position(|other| other == name).or(number)
        };
        let beside = &match named(0) {
            Some(time) => columns_beside(&looked.columns, time),
            None => (0..looked.columns.len()).collect(),
        };
        let columns = |role: usize| {
            let columns = looked.columns.iter().zip(&looked.units).enumerate();
            columns.filter(move |(place, _)| match given.columns[role] {
                Some(_) => named(role) == Some(*place),
                None => beside.contains(place),
            })
        };
        let has_unit = |dimension| looked.units.iter().flatten().any(|unit| unit.dimension == dimension);
        let is_of_bead = has_unit(Dimension::Force) && has_unit(Dimension::Length);
        let has_word = |words: &[&str]| looked.columns.iter().any(|name| called(name, words, &RATE));
        let has_words = [has_word(&STRESS), has_word(&STRAIN)];
        // Symbols and words of other quantities say what a column is only where no column says it in words.
        let is_meant = |role: usize, name: &str| {
            !is_of_bead
                && !has_words[role - 1]
                && (SYMBOLS[role - 1].contains(&symbol(name).as_str()) || role == 2 && called(name, &ELONGATION, &RATE))
        };
        let is_called = |role: usize, name: &str, words: &[&str]| {
            named(role).is_some() || called(name, words, &RATE) || is_meant(role, name)
        };
        let stresses: Vec<(usize, f64)> = columns(1)
            .filter_map(|(place, (name, unit))| {
                let stated = unit.as_ref().filter(|unit| unit.dimension == Dimension::Pressure);
                let size = told_stress.or_else(|| stated.map(|unit| unit.to_si(1.0)))?;
                is_called(1, name, &STRESS).then_some((place, size))
            })
            .collect();
        let strains: Vec<(usize, Option<f64>)> = columns(2)
            .filter_map(|(place, (name, unit))| {
                let part = match unit {
                    None if is_called(2, name, &STRAIN) => {
                        let (stated, is_read) = stated_part(name);
                        told_strain.or(stated).or(is_read.then_some(1.0))
                    }
                    Some(unit) if unit.dimension == Dimension::Ratio => Some(told_strain.unwrap_or(unit.to_si(1.0))),
                    _ => return None,
                };
                is_called(2, name, &STRAIN).then_some((place, part))
            })
            .collect();
        refuse_compliance_beside_stress(looked, &stresses, &strains)?;
        let (stress, strain) = match (&stresses[..], &strains[..]) {
            ([], _) | (_, []) => (None, None),
            _ => (
                Some(only_one(looked, &stresses, Setting::ForceColumn)?),
                Some(only_one(looked, &strains, Setting::PositionColumn)?),
            ),
        };
        let name = |place: usize| looked.columns[place].as_str();
        let (stress, strain, constant) = match (stress, strain) {
            (Some(_), Some((place, None))) => {
                return Err(Error::input(
                    InputPlace::setting(Setting::PositionUnit),
                    format!("the unit of the strain `{}` is not known", name(place)),
                    format!(
                        "give it: `{0} %` for percent, `{0} 1` for a plain number, `{0} \"0.1 %\"` for thousandths",
                        Setting::PositionUnit
                    ),
                ));
            }
            (Some(stress), Some((place, Some(part)))) => (stress, (place, part), None),
            // The only column of values serves as both quantities until the table is described.
            _ => match Self::published(looked, [named(1), named(2)], [told_stress, told_compliance]) {
                Some((column, control)) => (column, column, Some(control)),
                None => return refuse_unknown_unit(looked, given).map(|()| None),
            },
        };
        let rotates = rotates(looked);
        let is_uniaxial = [stress.0, strain.0].into_iter().any(|place| {
            called(name(place), &UNIAXIAL, &MULTIAXIAL)
                || !rotates && called(name(place), &OF_LENGTH, &MULTIAXIAL)
                || !rotates && ["ε", "epsilon"].contains(&symbol(name(place)).as_str())
                || constant.is_some() && is_of_young(name(place))
        });
        let names = || [stress.0, strain.0].into_iter().map(name);
        // G and J are a shear modulus and the compliance in shear.
        let is_shear = |name: &str| {
            called(name, &MULTIAXIAL, &[]) || constant.is_some() && ["g", "j"].contains(&symbol(name).as_str())
        };
        let is_open = !is_uniaxial && !names().any(is_shear);
        let uniaxial_because = if is_open { said_beside(looked) } else { None };
        let is_uniaxial = is_uniaxial || uniaxial_because.is_some();
        let has_stated = match constant {
            None => looked.units[strain.0].is_some() || told_strain.is_some(),
            Some(Control::Position) => looked.units[strain.0].is_some() || told_stress.is_some(),
            Some(Control::Force) => told_compliance.is_some() || unit_of_compliance(name(strain.0)).is_some(),
        };
        let number = |(place, _): (usize, f64)| Some((place + 1).to_string());
        Ok(Some(Self {
            given: TableSettings {
                columns: [given.columns[0].clone(), number(stress), number(strain), given.columns[3].clone()],
                units: [given.units[0].clone(), so_many(stress.1, "N"), so_many(strain.1, "m")],
                ..given.clone()
            },
            compliance: if is_uniaxial { 1.0 } else { 2.0 + 2.0 * poisson_ratio.unwrap_or(OF_WATER) },
            constant,
            is_told: is_plain || named(2).is_some() && !called(name(strain.0), &STRAIN, &RATE),
            is_of_specimen: false,
            uniaxial_because,
            is_assumed_plain: !has_stated && stated_part(name(strain.0)).0.is_none(),
        }))
    }

    /// Stress and strain of a specimen in tension or compression, whose `sizes` have turned its forces and positions into them.
    pub fn of_specimen(sizes: String) -> Self {
        Self {
            given: TableSettings::default(),
            compliance: 1.0,
            constant: None,
            is_told: false,
            is_of_specimen: true,
            uniaxial_because: Some(sizes),
            is_assumed_plain: false,
        }
    }

    /// Takes the test for one of tension or compression, unless a column says otherwise.
    pub fn take_for_tension(&mut self, looked: &InspectedTable, because: &str) {
        if self.compliance != 1.0 && !rotates(looked) {
            self.compliance = 1.0;
            self.uniaxial_because = Some(because.into());
        }
    }

    /// Remark that a strain is taken for a plain number; `None` if its unit is stated.
    pub fn plain_remark(&self) -> Option<String> {
        (self.is_assumed_plain && self.constant.is_none()).then(|| {
            format!(
                "no unit of the strain is stated: it is taken for a plain number, of which 1 is 100 %; for percent give `{} %`",
                Setting::PositionUnit
            )
        })
    }

    /// Refuses values without a stated unit: strains that are too large for a plain number, and a modulus or a compliance whose first or largest value is about 1, as if it
    /// were divided by that value. `largest` is the largest absolute value.
    ///
    /// # Errors
    /// [`Error::Input`] for such values.
    pub fn refuse_unlikely_plain(&self, first: Option<f64>, largest: f64) -> Result<()> {
        if !self.is_assumed_plain {
            return Ok(());
        }
        if let Some(constant) = self.constant {
            let is_near_one = |value: f64| (value.abs() - 1.0).abs() < NEAR_ONE;
            if ![first, Some(largest)].into_iter().flatten().any(is_near_one) {
                return Ok(());
            }
            let (setting, name, unit) = match constant {
                Control::Position => (Setting::ForceUnit, "modulus", "Pa"),
                Control::Force => (Setting::PositionUnit, "compliance", "1/Pa"),
            };
            return Err(Error::input(
                InputPlace::setting(setting),
                format!(
                    "no unit of the {name} is stated, and its first or largest value is about 1, as if it were divided by that value"
                ),
                format!(
                    "give the unit, as in `{setting} {unit}`; multiply a relative {name} by the value that it was divided by"
                ),
            ));
        }
        if largest <= LARGEST_PLAIN {
            return Ok(());
        }
        Err(Error::input(
            InputPlace::setting(Setting::PositionUnit),
            format!(
                "no unit of the strain is stated, and it reaches {}",
                figures::number::format_significant(largest, 3)
            ),
            format!(
                "give the unit: `{0} %` for percent, `{0} 1` for a plain number, or for a stretch that begins at 1",
                Setting::PositionUnit
            ),
        ))
    }

    /// Stress and strain by the units that the user gives, in the given columns or in those that are called so.
    fn told(
        looked: &InspectedTable,
        given: &TableSettings,
        [stress, strain]: [f64; 2],
        poisson_ratio: Option<f64>,
    ) -> Result<Option<Self>> {
        let column = |role: usize, words: &[&str], setting: Setting| {
            if let Some(name) = &given.columns[role] {
                return Ok(Some(name.clone()));
            }
            let named = looked.columns.iter().enumerate().filter(|(_, name)| called(name, words, &RATE));
            let found: Vec<(usize, ())> = named.map(|(place, _)| (place, ())).collect();
            let only = if found.is_empty() { None } else { Some(only_one(looked, &found, setting)?) };
            Ok::<_, Error>(only.map(|(place, ())| (place + 1).to_string()))
        };
        let is_shear = looked.columns.iter().any(|name| called(name, &MULTIAXIAL, &[]));
        let uniaxial_because = if is_shear { None } else { said_beside(looked) };
        let columns = [column(1, &STRESS, Setting::ForceColumn)?, column(2, &STRAIN, Setting::PositionColumn)?];
        let [Some(of_stress), Some(of_strain)] = columns else { return Ok(None) };
        Ok(Some(Self {
            given: TableSettings {
                columns: [given.columns[0].clone(), Some(of_stress), Some(of_strain), given.columns[3].clone()],
                units: [given.units[0].clone(), so_many(stress, "N"), so_many(strain, "m")],
                ..given.clone()
            },
            compliance: if uniaxial_because.is_some() { 1.0 } else { 2.0 + 2.0 * poisson_ratio.unwrap_or(OF_WATER) },
            constant: None,
            is_told: true,
            is_of_specimen: false,
            uniaxial_because,
            is_assumed_plain: false,
        }))
    }

    /// Column of a modulus or a compliance over time, as its index and the size of its unit in SI units, with the quantity that is commanded. `None` unless the table has
    /// one such column, or the user names it as force or position, and none of the quantities that it was computed from.
    fn published(
        looked: &InspectedTable,
        named: [Option<usize>; 2],
        [told_modulus, told_compliance]: [Option<f64>; 2],
    ) -> Option<((usize, f64), Control)> {
        let columns = || looked.columns.iter().zip(&looked.units).enumerate();
        // A modulus or a compliance beside the quantities from which it was computed is not read. A compliance beside the strain alone is: the stress is not in the table.
        let measures = |words: &[&str]| {
            columns().any(|(_, (name, unit))| {
                let dimension = unit.as_ref().map(|unit| unit.dimension);
                called(name, words, &MODULUS) || matches!(dimension, Some(Dimension::Force | Dimension::Length))
            })
        };
        let others: Vec<&str> = MEASURED.into_iter().filter(|word| !STRAIN.contains(word)).collect();
        let found: Vec<((usize, f64), Control)> = columns()
            .filter_map(|(place, (name, unit))| {
                let symbol = symbol(name);
                let is_modulus = called(name, &MODULUS, &OF_FREQUENCY);
                let is_compliance = called(name, &COMPLIANCE, &OF_FREQUENCY) || ["j", "d"].contains(&symbol.as_str());
                if is_ratio(name) || named.iter().flatten().any(|wanted| *wanted != place) {
                    return None;
                }
                match unit.as_ref() {
                    Some(unit)
                        if unit.dimension == Dimension::Pressure
                            && (is_modulus || ["g", "e"].contains(&symbol.as_str())) =>
                    {
                        Some(((place, told_modulus.unwrap_or(unit.to_si(1.0))), Control::Position))
                    }
                    None if is_modulus && (has_no_unit(name) || told_modulus.is_some()) => {
                        Some(((place, told_modulus.unwrap_or(1.0)), Control::Position))
                    }
                    None if is_compliance => {
                        Some(((place, told_compliance.or_else(|| per_pa(name, &symbol))?), Control::Force))
                    }
                    _ => None,
                }
            })
            .collect();
        match found[..] {
            [found] if !measures(&MEASURED) || found.1 == Control::Force && !measures(&others) => Some(found),
            _ => None,
        }
    }

    /// Explains how the table is read, for the quantity that is commanded. `is_unheld` is true if this quantity holds at no value for long.
    pub fn reason(&self, control: Control, is_unheld: bool) -> String {
        let what = match (self.constant, control) {
            (None, Control::Force) if is_unheld => {
                "stress and strain over time; the stress holds at no value for long, but is taken for the commanded quantity (if the strain is commanded, use kind = \"relaxation\")"
            }
            (None, Control::Position) if is_unheld => {
                "stress and strain over time; the strain holds at no value for long, but is taken for the commanded quantity (if the stress is commanded, use kind = \"creep\")"
            }
            (None, Control::Force) => "stress and strain over time, and the stress holds: a creep test",
            (None, Control::Position) => {
                "stress and strain over time, and the strain holds or changes at a constant rate: a relaxation"
            }
            (Some(_), Control::Force) => {
                "a creep compliance over time: the strain at a stress of 1 Pa from time 0 (a table without a unit is in 1/Pa)"
            }
            (Some(_), Control::Position) => {
                "a relaxation modulus over time: the stress at a strain of 1 from time 0 (a table without a unit is in Pa)"
            }
        };
        let factor = match self.compliance {
            1.0 if let Some(because) = &self.uniaxial_because => {
                format!("compliance_per_m = 1, because {because}; write 2 + 2ν for shear")
            }
            1.0 => "compliance_per_m = 1, because a column is of tension or compression; write 2 + 2ν for shear".into(),
            shear => format!("compliance_per_m = {shear} = 2 + 2ν for shear; write 1 for tension"),
        };
        format!("{what}. 1 Pa is entered as 1 N and a strain of 1 as 1 m, with {factor}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use record::table::inspect_table;

    fn creep(header: &str, poisson_ratio: Option<f64>) -> Option<StressStrain> {
        let rest = ",1".repeat(header.split(',').count().saturating_sub(2));
        let text = format!("{header}\n0,0{rest}\n1,5{rest}\n2,6{rest}\n");
        let looked = inspect_table("creep.csv".as_ref(), text.as_bytes()).expect("a table");
        StressStrain::of(&looked, &TableSettings::default(), poisson_ratio).expect("a known unit")
    }

    #[test]
    fn strains_have_the_unit_that_their_name_states() {
        for (name, unit) in [
            ("Strain", "m"),
            ("Strain [-]", "m"),
            ("Strain (mm/mm)", "m"),
            ("Strain (fraction)", "m"),
            ("strain_percent", "0.01 m"),
            ("Strain Pct", "0.01 m"),
            ("% strain", "0.01 m"),
            ("Dehnung (Prozent)", "0.01 m"),
            ("Strain (‰)", "0.001 m"),
            ("Strain (mm/m)", "0.001 m"),
            ("Strain (microstrain)", "0.000001 m"),
            ("Strain (um/m)", "0.000001 m"),
        ] {
            let found = creep(&format!("Time [s],{name},Stress [Pa]"), None).unwrap_or_else(|| panic!("{name}"));
            assert_eq!(found.given.units[2].as_deref(), Some(unit), "{name}");
            assert_eq!(found.refuse_unlikely_plain(None, 16.0).is_err(), name == "Strain", "{name}");
            assert!(found.refuse_unlikely_plain(None, 0.9).is_ok(), "{name}");
        }
        let looked =
            inspect_table("s.csv".as_ref(), b"Time [s],Strain [mod],Stress [Pa]\n0,0,1\n1,5,1\n2,6,1\n").unwrap();
        let refused = StressStrain::of(&looked, &TableSettings::default(), None).unwrap_err().to_string();
        assert!(refused.contains("`Strain [mod]` is not known"), "{refused}");
        let told = TableSettings { units: [None, None, Some("%".into())], ..TableSettings::default() };
        let found = StressStrain::of(&looked, &told, None).unwrap().expect("a creep");
        assert_eq!(found.given.units[2].as_deref(), Some("0.01 m"));
    }

    #[test]
    fn tension_has_no_factor() {
        for (header, factor) in [
            ("Time (s),Tensile stress (Pa),Tensile strain (%)", 1.0),
            ("Time (s),Compressive stress (Pa),Strain (%)", 1.0),
            ("t (s),E(t) (kPa),n", 1.0),
            ("t (s),D(t),n", 1.0),
            ("t (s),G(t) (kPa),n", 3.0),
            ("Time (s),Extension stress (Pa),Strain (%)", 1.0),
            ("Time (s),Shear stress (Pa),Strain (%)", 3.0),
            ("Time (s),Biaxial stress (Pa),Strain (%)", 3.0),
            ("Zeit in s,Spannung in Pa,Stauchung in %", 1.0),
            ("Zeit in s,Schubspannung in Pa,Dehnung in %", 3.0),
            ("t [s],τ [Pa],ε [%]", 3.0),
            ("t [s],Shear stress [Pa],epsilon [%]", 3.0),
            ("Temps (s),Contrainte (Pa),Allongement (%)", 1.0),
            ("t [s],τ [Pa],γ [-]", 3.0),
            ("t in s,tau in Pa,gamma in -", 3.0),
            ("t [s],σ [kPa],ε [%]", 1.0),
            ("Time (s),Displacement (mm),Force (N),Strain (%),Stress (MPa)", 1.0),
            ("Time (s),Gap (mm),Normal force (N),Strain (%),Stress (Pa)", 3.0),
            ("Temps (s),Contrainte (Pa),Déformation (%),Force axiale (N),Entrefer (mm)", 3.0),
            ("t in s,Stress in Pa,Strain in %,Fn in N,h in mm", 3.0),
            ("Time (s),Displacement (mm),Force (N),Torque (N m),Strain (%),Stress (Pa)", 3.0),
            ("Time (s),Displacement (mm),Force (N),Shear strain (%),Stress (Pa)", 3.0),
        ] {
            let found = creep(header, None).unwrap_or_else(|| panic!("{header}"));
            assert_eq!(found.compliance, factor, "{header}");
        }
    }

    /// A line above the table decides only where no column does.
    #[test]
    fn a_line_above_the_table_names_tension() {
        for (line, header, factor) in [
            ("Clamp: Tension film", "Time [s],Strain [%],Stress [Pa]", 1.0),
            ("Clamp: Tension film", "Time [s],Shear strain [%],Shear stress [Pa]", 3.0),
            ("Geometry: cone plate", "Time [s],Strain [%],Stress [Pa]", 3.0),
        ] {
            let text = format!("Sample: gel\n{line}\n\n{header}\n0,0,1\n1,5,1\n2,6,1\n");
            let looked = inspect_table("creep.csv".as_ref(), text.as_bytes()).expect("a table");
            let found = StressStrain::of(&looked, &TableSettings::default(), None).unwrap().expect("a creep");
            assert_eq!(found.compliance, factor, "{line} {header}");
            assert_eq!(found.reason(Control::Force, false).contains(line), factor == 1.0, "{line} {header}");
        }
    }

    #[test]
    fn stress_and_strain_are_a_creep_in_their_units() {
        let found = creep("Time [s],Shear strain [%],Shear stress [kPa]", Some(0.48)).expect("a creep");
        assert_eq!(found.given.columns, [None, Some("3".into()), Some("2".into()), None]);
        assert_eq!(found.given.units, [None, Some("1000 N".into()), Some("0.01 m".into())]);
        assert!((found.compliance - 2.96).abs() < 1e-12);
        let plain = creep("Zeit in s,Dehnung,Spannung in Pa", None).expect("a creep");
        assert_eq!(plain.given.units, [None, Some("N".into()), Some("m".into())]);
        assert_eq!(plain.compliance, 3.0);
    }

    /// Units on the command line say what the columns are. Without names of stress and strain, the columns are given, too.
    #[test]
    fn units_that_are_told_make_a_creep_of_any_columns() {
        let looked = inspect_table("m.csv".as_ref(), b"Time,L,F\n0,0,1\n1,5,1\n2,6,1\n").expect("a table");
        let units = [Some("s".into()), Some("kPa".into()), Some("%".into())];
        let columns = [None, Some("F".into()), Some("L".into()), None];
        let given = TableSettings { units: units.clone(), columns, ..TableSettings::default() };
        let found = StressStrain::of(&looked, &given, None).unwrap().expect("a creep");
        assert_eq!(found.given.columns, [None, Some("F".into()), Some("L".into()), None]);
        assert_eq!(found.given.units, [Some("s".into()), Some("1000 N".into()), Some("0.01 m".into())]);
        let plain = TableSettings { units: [None, Some("Pa".into()), Some("1".into())], ..given };
        let found = StressStrain::of(&looked, &plain, None).unwrap().expect("a creep");
        assert_eq!(found.given.units, [None, Some("N".into()), Some("m".into())]);
        let unnamed = TableSettings { units, ..TableSettings::default() };
        assert_eq!(StressStrain::of(&looked, &unnamed, None).unwrap(), None);
    }

    #[test]
    fn other_tables_are_none() {
        for header in [
            "Time [s],Position [um],Force [uN]",
            "Time [s],Strain rate [%],Stress [Pa]",
            "t_s,strain_um,stress_Pa",
            "t_s,F_uN,x_um,sigma (Pa),epsilon",
        ] {
            assert_eq!(creep(header, None), None, "{header}");
        }
    }

    #[test]
    fn unknown_units_of_published_tables_are_named() {
        for header in ["t,Modulus [GPU],n", "t,G(t) (x10^3 Pa),n", "t,Compliance (%/Pa),n"] {
            let looked =
                inspect_table("p.csv".as_ref(), format!("{header}\n0,0,1\n1,5,1\n2,6,1\n").as_bytes()).unwrap();
            let refused = StressStrain::of(&looked, &TableSettings::default(), None).unwrap_err().to_string();
            assert!(refused.contains("the unit of this column is not known"), "{header}: {refused}");
        }
    }

    #[test]
    fn units_of_published_tables_can_be_given_and_values_near_one_need_one() {
        let read = |header: &str, units: [Option<&str>; 3]| {
            let looked = inspect_table("p.csv".as_ref(), format!("{header}\n0,1\n1,0.5\n2,0.4\n").as_bytes()).unwrap();
            let given = TableSettings { units: units.map(|unit| unit.map(String::from)), ..TableSettings::default() };
            StressStrain::of(&looked, &given, None).expect("a known unit").expect("a published table")
        };
        for (header, units, size) in [
            ("t (s),G(t)", [None, Some("kPa"), None], "1000 N"),
            ("t (s),G(t) [Pa]", [None, Some("kPa"), None], "1000 N"),
            ("t (s),J(t)", [None, None, Some("1/kPa")], "0.001 m"),
        ] {
            let found = read(header, units);
            let role = if header.contains('G') { 1 } else { 2 };
            assert_eq!(found.given.units[role].as_deref(), Some(size), "{header}");
            assert!(found.refuse_unlikely_plain(Some(1.0), 1.0).is_ok(), "{header}");
        }
        for header in ["t (s),G(t)", "t (s),J(t)", "t (s),Relaxation modulus"] {
            let found = read(header, [None; 3]);
            assert!(found.refuse_unlikely_plain(Some(30.0), 30.0).is_ok(), "{header}");
            let refused = found.refuse_unlikely_plain(Some(0.99), 4.0).unwrap_err().to_string();
            assert!(refused.contains("is about 1"), "{header}: {refused}");
        }
        for header in ["t (s),G(t) [Pa]", "t (s),J(t) [1/Pa]", "t (s),J(t) in 1/kPa"] {
            assert!(read(header, [None; 3]).refuse_unlikely_plain(Some(1.0), 1.0).is_ok(), "{header}");
        }
    }

    #[test]
    fn published_tables_have_one_commanded_value() {
        let modulus = creep("Time [s],Relaxation Modulus [kPa],n", None).expect("a modulus");
        assert_eq!((modulus.constant, modulus.given.units[1].as_deref()), (Some(Control::Position), Some("1000 N")));
        let compliance = creep("t (s),J(t),n", None).expect("a compliance");
        assert_eq!((compliance.constant, compliance.given.columns[2].as_deref()), (Some(Control::Force), Some("2")));
        for (header, unit) in [
            ("t,J (1/Pa),n", "m"),
            ("t,J(t) [kPa^-1],n", "0.001 m"),
            ("t,Compliance [1/MPa],n", "0.000001 m"),
            ("t,Creep compliance,n", "m"),
            ("t,Compliance [mm²/N],n", "0.000001 m"),
            ("t,J (10^-3 1/Pa),n", "0.001 m"),
            ("t,Creep compliance/10^-3 Pa^-1,n", "0.001 m"),
            ("t,Creep compliance/kPa^-1,n", "0.001 m"),
            ("t,J(t) in 1/kPa,n", "0.001 m"),
            ("t,Creep compliance 1/kPa,n", "0.001 m"),
            ("t,J(t) [1 / kPa],n", "0.001 m"),
            ("t,Creep compliance in shear,n", "m"),
            ("t,Creep compliance of gel/agar,n", "m"),
        ] {
            let found = creep(header, None).unwrap_or_else(|| panic!("{header}"));
            assert_eq!(
                (found.constant, found.given.units[2].as_deref()),
                (Some(Control::Force), Some(unit)),
                "{header}"
            );
        }
        let beside_strain = creep("Time [h],Creep Strain [-],Creep Compliance [MPa^-1]", None).expect("a compliance");
        assert_eq!(beside_strain.given.columns[2].as_deref(), Some("3"));
        assert_eq!(creep("t,G [kPa],n", None).unwrap().given.units[1].as_deref(), Some("1000 N"));
        for header in [
            "t,J,n",
            "t,J [%/Pa],n",
            "Time [s],Storage modulus [Pa],Loss modulus [Pa]",
            "t (s),Force (uN),Position (um),Modulus (Pa)",
        ] {
            assert_eq!(creep(header, None), None, "{header}");
        }
    }
}
