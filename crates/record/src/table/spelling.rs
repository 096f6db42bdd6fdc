//! Recognition of the spellings of units and times in tables from laboratories.

use base::units::{Dimension, UNITS};

/// Cycles in a radian.
const PER_RADIAN: f64 = 0.5 * std::f64::consts::FRAC_1_PI;
/// Frequency of one cycle in a minute, in Hz.
const PER_MINUTE_HZ: f64 = 1.0 / 60.0;
/// Weight of a gram in standard gravity, in N.
const GRAM_FORCE_N: f64 = 9.806_65e-3;

/// Spellings of units that differ from the program's own names, with their dimension and their value in SI units.
const SPELLINGS: [(&str, Dimension, f64); 96] = [
    ("с", Dimension::Time, 1.0),
    ("мс", Dimension::Time, 1e-3),
    ("Н", Dimension::Force, 1.0),
    ("мН", Dimension::Force, 1e-3),
    ("мкН", Dimension::Force, 1e-6),
    ("нН", Dimension::Force, 1e-9),
    ("мм", Dimension::Length, 1e-3),
    ("мкм", Dimension::Length, 1e-6),
    ("нм", Dimension::Length, 1e-9),
    ("кПа", Dimension::Pressure, 1e3),
    ("sec", Dimension::Time, 1.0),
    ("secs", Dimension::Time, 1.0),
    ("second", Dimension::Time, 1.0),
    ("seconds", Dimension::Time, 1.0),
    ("sek", Dimension::Time, 1.0),
    ("msec", Dimension::Time, 1e-3),
    ("millisecond", Dimension::Time, 1e-3),
    ("milliseconds", Dimension::Time, 1e-3),
    ("us", Dimension::Time, 1e-6),
    ("ns", Dimension::Time, 1e-9),
    ("min", Dimension::Time, 60.0),
    ("mins", Dimension::Time, 60.0),
    ("minutes", Dimension::Time, 60.0),
    ("minute", Dimension::Time, 60.0),
    ("h", Dimension::Time, 3600.0),
    ("hr", Dimension::Time, 3600.0),
    ("hrs", Dimension::Time, 3600.0),
    ("hour", Dimension::Time, 3600.0),
    ("hours", Dimension::Time, 3600.0),
    ("newton", Dimension::Force, 1.0),
    ("newtons", Dimension::Force, 1.0),
    ("fN", Dimension::Force, 1e-15),
    ("cN", Dimension::Force, 1e-2),
    ("kN", Dimension::Force, 1e3),
    ("dyn", Dimension::Force, 1e-5),
    ("dyne", Dimension::Force, 1e-5),
    ("dynes", Dimension::Force, 1e-5),
    ("gf", Dimension::Force, GRAM_FORCE_N),
    ("mgf", Dimension::Force, 1e-3 * GRAM_FORCE_N),
    ("kgf", Dimension::Force, 1e3 * GRAM_FORCE_N),
    ("lbf", Dimension::Force, 453.592_37 * GRAM_FORCE_N),
    ("micron", Dimension::Length, 1e-6),
    ("microns", Dimension::Length, 1e-6),
    ("micrometer", Dimension::Length, 1e-6),
    ("micrometre", Dimension::Length, 1e-6),
    ("cm", Dimension::Length, 1e-2),
    ("inch", Dimension::Length, 0.0254),
    ("inches", Dimension::Length, 0.0254),
    ("in.", Dimension::Length, 0.0254),
    ("mil", Dimension::Length, 2.54e-5),
    ("mils", Dimension::Length, 2.54e-5),
    ("Å", Dimension::Length, 1e-10),
    ("pm", Dimension::Length, 1e-12),
    ("hz", Dimension::Frequency, 1.0),
    ("mHz", Dimension::Frequency, 1e-3),
    ("kHz", Dimension::Frequency, 1e3),
    ("rad/s", Dimension::Frequency, PER_RADIAN),
    ("rad/sec", Dimension::Frequency, PER_RADIAN),
    ("rad s-1", Dimension::Frequency, PER_RADIAN),
    ("rad s^-1", Dimension::Frequency, PER_RADIAN),
    ("rad s⁻¹", Dimension::Frequency, PER_RADIAN),
    ("rad.s-1", Dimension::Frequency, PER_RADIAN),
    ("rad.s^-1", Dimension::Frequency, PER_RADIAN),
    ("rad·s⁻¹", Dimension::Frequency, PER_RADIAN),
    ("1/min", Dimension::Frequency, PER_MINUTE_HZ),
    ("min-1", Dimension::Frequency, PER_MINUTE_HZ),
    ("min^-1", Dimension::Frequency, PER_MINUTE_HZ),
    ("min⁻¹", Dimension::Frequency, PER_MINUTE_HZ),
    ("rpm", Dimension::Frequency, PER_MINUTE_HZ),
    ("cpm", Dimension::Frequency, PER_MINUTE_HZ),
    ("cycles/min", Dimension::Frequency, PER_MINUTE_HZ),
    ("U/min", Dimension::Frequency, PER_MINUTE_HZ),
    ("pa", Dimension::Pressure, 1.0),
    ("PA", Dimension::Pressure, 1.0),
    ("kg/cm2", Dimension::Pressure, 98_066.5),
    ("kg/cm²", Dimension::Pressure, 98_066.5),
    ("kPa", Dimension::Pressure, 1e3),
    ("hPa", Dimension::Pressure, 1e2),
    ("bar", Dimension::Pressure, 1e5),
    ("mbar", Dimension::Pressure, 1e2),
    ("MPa", Dimension::Pressure, 1e6),
    ("GPa", Dimension::Pressure, 1e9),
    ("psi", Dimension::Pressure, 6_894.757_293_168),
    ("ksi", Dimension::Pressure, 6_894_757.293_168),
    ("atm", Dimension::Pressure, 101_325.0),
    ("mmHg", Dimension::Pressure, 133.322_387_415),
    ("Torr", Dimension::Pressure, 101_325.0 / 760.0),
    ("cmH2O", Dimension::Pressure, 98.0665),
    ("deg", Dimension::Angle, std::f64::consts::PI / 180.0),
    ("degrees", Dimension::Angle, std::f64::consts::PI / 180.0),
    ("°", Dimension::Angle, std::f64::consts::PI / 180.0),
    ("mrad", Dimension::Angle, 1e-3),
    ("%", Dimension::Ratio, 1e-2),
    ("mm/mm", Dimension::Ratio, 1.0),
    ("m/m", Dimension::Ratio, 1.0),
    ("in/in", Dimension::Ratio, 1.0),
];

/// Unit that was recognised in a text.
#[derive(Debug, Clone, PartialEq)]
pub struct ParsedUnit {
    /// Dimension of the unit.
    pub dimension: Dimension,
    /// Name of the unit in `experiment.toml`, with `u` for µ.
    pub name: String,
    /// Conversion to SI units: a division by a power of ten, which is exact, or a multiplication.
    scale: UnitScale,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum UnitScale {
    Over(f64),
    Times(f64),
}

impl ParsedUnit {
    /// Unit of a plain number.
    pub fn one() -> Self {
        Self { dimension: Dimension::Ratio, name: "1".into(), scale: UnitScale::Times(1.0) }
    }

    /// Converts a value in this unit to SI units.
    pub fn to_si(&self, value: f64) -> f64 {
        match self.scale {
            UnitScale::Over(per_si_unit) => value / per_si_unit,
            UnitScale::Times(si_units) => value * si_units,
        }
    }
}

/// Parses a unit such as `µm`, `[uN]` or `(s)`; `None` for other text. A number may precede the unit: a camera's pixel may be `0.65 um` and its frame
/// `0.05 s`. The number may be a power of ten, as in `10^3 Pa` or `10⁻³ Pa`. Symbols are case-sensitive (`mN` is not `MN`), words are not.
pub fn unit(text: &str) -> Option<ParsedUnit> {
    let plain = text.trim().trim_matches(['[', ']', '(', ')', '{', '}']).trim();
    let parts = plain.split_once([' ', '·']).or_else(|| plain.split_once('*'));
    let many = parts.and_then(|(many, of)| Some((factor(many)?, one_unit(of)?)));
    match many {
        Some((many, of)) => (many > 0.0 && many.is_finite()).then(|| ParsedUnit {
            dimension: of.dimension,
            name: format!("{many} {}", of.name),
            scale: UnitScale::Times(of.to_si(many)),
        }),
        None => one_unit(text),
    }
}

/// Number before a unit: a plain number, or a power of ten such as `10^-3` or `10³`.
pub fn factor(text: &str) -> Option<f64> {
    let text = text.trim();
    let power = |text: &str| -> Option<f64> {
        let exponent = text.strip_prefix("10")?;
        let raised: String = exponent
            .chars()
            .map(|c| RAISED.iter().find(|(raised, _)| *raised == c).map_or(c, |(_, plain)| *plain))
            .collect();
        let is_raised = raised != exponent;
        let is_signed = exponent.starts_with(['-', '+', '−']);
        let marked = exponent.strip_prefix('^').or_else(|| exponent.strip_prefix("**"));
        let digits = marked.or((is_raised || is_signed).then_some(&raised))?;
        format!("1e{}", digits.trim_matches(['(', ')', '{', '}']).replace('−', "-")).parse().ok()
    };
    text.parse().ok().or_else(|| power(text))
}

/// Raised signs of an exponent, each with its plain sign.
const RAISED: [(char, char); 11] = [
    ('⁻', '-'),
    ('⁰', '0'),
    ('¹', '1'),
    ('²', '2'),
    ('³', '3'),
    ('⁴', '4'),
    ('⁵', '5'),
    ('⁶', '6'),
    ('⁷', '7'),
    ('⁸', '8'),
    ('⁹', '9'),
];

/// Prefixes of units as words, each with its letter.
const PREFIXES: [(&str, &str); 6] =
    [("micro", "u"), ("milli", "m"), ("nano", "n"), ("pico", "p"), ("femto", "f"), ("kilo", "k")];

fn one_unit(text: &str) -> Option<ParsedUnit> {
    let plain = text.trim().trim_matches(['[', ']', '(', ')', '{', '}', '<', '>', '"', '.', ' ']);
    let plain = plain.replace(['µ', 'μ'], "u");
    let lower = plain.to_lowercase();
    let prefix = PREFIXES.into_iter().find(|(prefix, _)| lower.starts_with(prefix));
    let rest = prefix.and_then(|(prefix, letter)| Some((letter, plain.get(prefix.len()..)?.trim_start_matches('-'))));
    // The text `microN` is a force, although `micron` is a length.
    let by_prefix = |(letter, rest): (&str, &str)| {
        let symbol = match rest.to_lowercase().as_str() {
            _ if ["N", "Pa", "A", "s", "m"].contains(&rest) => rest,
            "newton" | "newtons" => "N",
            "second" | "seconds" | "sec" => "s",
            "meter" | "metre" | "meters" | "metres" => "m",
            "pascal" | "pascals" => "Pa",
            "ampere" | "amperes" | "amp" => "A",
            _ => return None,
        };
        known_unit(&format!("{letter}{symbol}"))
    };
    rest.and_then(by_prefix).or_else(|| known_unit(&plain))
}

fn known_unit(plain: &str) -> Option<ParsedUnit> {
    let entry = UNITS.iter().find(|unit| unit.suffix == plain);
    if let Some(item) = entry {
        return Some(ParsedUnit {
            dimension: item.dimension,
            name: plain.into(),
            scale: UnitScale::Over(item.per_si_unit),
        });
    }
    let is_word = plain.is_ascii() && plain.len() > 2;
    // The case of a prefix tells `mPa` from `MPa`, and `mHz` from `MHz`.
    let has_other_prefix = |known: &str| {
        known.contains(char::is_uppercase) && known.starts_with(['m', 'M']) && known.get(..1) != plain.get(..1)
    };
    let is_same_word = |known: &str| is_word && known.eq_ignore_ascii_case(plain) && !has_other_prefix(known);
    let same = |known: &str| known == plain || is_same_word(known);
    match SPELLINGS.iter().find(|(known, ..)| same(known)) {
        Some((name, dimension, si_units)) => {
            Some(ParsedUnit { dimension: *dimension, name: (*name).into(), scale: UnitScale::Times(*si_units) })
        }
        None => force_per_area(plain),
    }
}

/// Unit of a stress that is written as a force over an area, such as `N/mm²` or `dyn/cm^2`.
fn force_per_area(plain: &str) -> Option<ParsedUnit> {
    let (force, area) = plain.split_once('/').map(|(force, area)| (force.trim(), area.trim()))?;
    let side = ["^2", "²", "2"].iter().find_map(|power| area.strip_suffix(power))?;
    let side = if side == "in" { "inch" } else { side };
    // Some programs write all units in capitals.
    let find = |text: &str, dimension: Dimension| {
        let found = known_unit(text).or_else(|| known_unit(&text.to_lowercase()));
        found.filter(|unit| unit.dimension == dimension)
    };
    let force = find(force, Dimension::Force)?;
    let side_m = find(side, Dimension::Length)?.to_si(1.0);
    let scale = UnitScale::Times(force.to_si(1.0) / (side_m * side_m));
    Some(ParsedUnit { dimension: Dimension::Pressure, name: plain.into(), scale })
}

/// Splits a name that ends in brackets, as in `x [µm]`, into the text before them and the text in them.
pub fn bracketed(name: &str) -> Option<(&str, &str)> {
    name.trim_end().strip_suffix([']', ')'])?.rsplit_once(['[', '('])
}

/// True if a name is that of an angular frequency.
pub fn is_angular(name: &str) -> bool {
    let name = name.to_lowercase();
    ["angular", "omega", "ω", "angulaire", "angolare", "kreis", "pulsation", "角"]
        .iter()
        .any(|word| name.contains(word))
}

/// Splits a column name such as `x [µm]`, `x (µm)`, `x/µm`, `x_um`, `x in µm` or `x en µm` into the name without the unit, and the unit, which may be missing.
pub fn split_unit(name: &str) -> (&str, Option<ParsedUnit>) {
    // The `_` in `rad_s` and the `/` in `rad/s` are part of the unit.
    let endings = [
        ("_rad_s", "rad/s"),
        ("_rad/s", "rad/s"),
        (" rad/s", "rad/s"),
        (" in 1/min", "1/min"),
        (" 1/min", "1/min"),
        (" cycles/min", "cycles/min"),
    ];
    for (ending, text) in endings {
        if let Some(stem) = name.strip_suffix(ending) {
            return (stem, unit(text));
        }
    }
    // Some programs write all names in capitals.
    if let Some(stem) = name.strip_suffix("_S").filter(|stem| stem.to_lowercase().starts_with("time")) {
        return (stem, unit("s"));
    }
    let found = match bracketed(name) {
        // Other text in brackets, such as `1/Pa`, is no unit either in part.
        // Names in capitals have their unit in capitals.
        Some((stem, "S" | "M")) if !name.contains(char::is_lowercase) => {
            name.to_lowercase().split_once(['(', '[']).and_then(|(_, text)| Some((stem, unit(text)?)))
        }
        Some((stem, "1/s" | "s^-1" | "s-1" | "s⁻¹")) if is_angular(stem) => unit("rad/s").map(|unit| (stem, unit)),
        // Elsewhere the word `in` is no unit, as in `x in µm`.
        Some((stem, "in")) => unit("inch").map(|unit| (stem, unit)),
        Some((stem, text)) => unit(text).map(|unit| (stem, unit)),
        None => ["/", " in ", " en ", "_", " "]
            .iter()
            .filter_map(|joint| Some((*joint, name.rsplit_once(joint)?)))
            .find_map(|(joint, (stem, text))| Some((joint, stem, unit(text)?)))
            // A number before the unit that is not read changes the unit, as in `G x10^3 Pa` or `J in 1/Pa`.
            .filter(|(joint, stem, unit)| {
                let is_inverse = *joint == "/" && stem.ends_with(" 1") && unit.dimension == Dimension::Pressure;
                !is_inverse && !ends_in_factor(stem)
            })
            .map(|(_, stem, unit)| (stem, unit)),
    };
    found.map_or((name, None), |(stem, unit)| (stem, Some(unit)))
}

/// True if the last word of a name is a power of ten, or a product with a number such as `x1000`. `x1` is a coordinate, and so is `x10` without a word before it.
fn ends_in_factor(stem: &str) -> bool {
    let Some(word) = stem.split([' ', '/', '_']).next_back() else { return false };
    let number = word.trim_start_matches(['x', '×', '*', '·', '(']);
    let is_product = number != word && stem != word && ["10", "1e"].iter().any(|first| number.starts_with(first));
    factor(number).is_some() && (is_product || number.parse::<f64>().is_err())
}

/// Splits the name of a column that counts pixels or frames, such as `x (px)` or `frame`, into the name without the unit, and `pixel` or `frame`.
/// `None` for other columns.
pub fn counted(name: &str) -> Option<(&str, &'static str)> {
    const COUNTS: [(&str, &str); 6] = [
        ("px", "pixel"),
        ("pixel", "pixel"),
        ("pixels", "pixel"),
        ("frame", "frame"),
        ("frames", "frame"),
        ("frm", "frame"),
    ];
    let of = |text: &str| {
        let plain = text.trim_matches(['[', ']', '(', ')', ' ']);
        COUNTS.iter().find(|(known, _)| known.eq_ignore_ascii_case(plain)).map(|(_, what)| *what)
    };
    let parts = ["[", "(", "/", "_", " "].iter().filter_map(|joint| name.rsplit_once(joint));
    parts.chain([(name, name)]).find_map(|(stem, text)| Some((stem.trim(), of(text)?)))
}

/// Splits `AM` or `PM` from a time of day, and returns the hours that this half of the day begins with.
fn half_of_day(cell: &str) -> Option<(&str, f64)> {
    let cell = cell.trim_end();
    let (time, half) = cell.split_at_checked(cell.len().checked_sub(3)?)?;
    match half.to_ascii_uppercase().as_str() {
        " AM" => Some((time, 0.0)),
        " PM" => Some((time, 12.0)),
        _ => None,
    }
}

/// Time in s of a half of the day, from the time on the dial.
fn of_dial_s(dial_s: f64, later_h: f64) -> Option<f64> {
    (3600.0..46_800.0).contains(&dial_s).then(|| dial_s.rem_euclid(43_200.0) + 3600.0 * later_h)
}

/// Returns the seconds since midnight for a time of day `hh:mm` or `hh:mm AM`; `None` for other text.
pub fn hours_minutes_s(cell: &str) -> Option<f64> {
    if let Some((dial, later_h)) = half_of_day(cell) {
        return of_dial_s(hours_minutes_s(dial)?, later_h);
    }
    let (hours, minutes) = cell.trim().split_once(':')?;
    let number = |text: &str, longest: usize| {
        let is_number = (1..=longest).contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_digit());
        is_number.then(|| text.parse::<f64>().ok())?
    };
    let minutes = number(minutes, 2).filter(|minutes| *minutes < 60.0)?;
    Some(3600.0 * number(hours, 3)? + 60.0 * minutes)
}

/// True if a time of two parts, such as `10:15 PM`, can only be hours and minutes.
pub fn is_hours_minutes(cell: &str) -> bool {
    half_of_day(cell).is_some() && hours_minutes_s(cell).is_some()
}

/// Returns the seconds since midnight for a time of day `hh:mm:ss.fff`, `hh:mm:ss:fff` with three digits of milliseconds, `mm:ss.fff` or `hh:mm:ss AM`; `None` for
/// other text.
pub fn clock_s(cell: &str) -> Option<f64> {
    if let Some((dial, later_h)) = half_of_day(cell) {
        return of_dial_s(clock_s(dial)?, later_h);
    }
    let parts: Vec<&str> = cell.split(':').collect();
    let are_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let (parts, milliseconds_s) = match parts.as_slice() {
        // Two digits behind the seconds may count frames.
        [time @ .., last] if time.len() == 3 && last.len() == 3 && are_digits(last) && are_digits(time[2]) => {
            (time, 1e-3 * last.parse::<f64>().ok()?)
        }
        parts => (parts, 0.0),
    };
    let (seconds, larger) = parts.split_last()?;
    if larger.is_empty() || larger.len() > 2 {
        return None;
    }
    let whole =
        |text: &&str| (!text.is_empty() && text.len() <= 4 && are_digits(text)).then(|| text.parse::<u32>().ok())?;
    let larger: Option<Vec<u32>> = larger.iter().map(whole).collect();
    let seconds: f64 = seconds.replace(',', ".").parse().ok().filter(|s: &f64| (0.0..61.0).contains(s))?;
    Some(larger?.iter().fold(0.0, |sum, part| (sum + f64::from(*part)) * 60.0) + seconds + milliseconds_s)
}

/// Order of day, month and year in a date, named by the first of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DateOrder {
    /// Year first (ISO 8601): `2026-11-22`.
    Year,
    /// Day first: `22.11.2026`, `22/11/2026`.
    Day,
    /// Month first: `11/22/2026`.
    Month,
}

impl DateOrder {
    /// All orders of dates.
    pub const ALL: [Self; 3] = [Self::Year, Self::Day, Self::Month];
}

/// Returns the seconds since 1970 for a date with a time, in the given order of day, month and year. Examples are ISO 8601's
/// `2026-11-22T10:00:00.25Z`, `22.11.2026 10:00:00,25` and `11/22/2026 10:00 AM`. `None` for other text.
pub fn date_time_s(cell: &str, order: DateOrder) -> Option<f64> {
    let (date, time) = cell.split_once(['T', ' '])?;
    let date = date.trim_end_matches(',');
    let signs: &[char] = if order == DateOrder::Year { &['-', '/'] } else { &['.', '/', '-'] };
    let sign = date.chars().find(|c| signs.contains(c))?;
    let numbers: Vec<i64> = date.split(sign).map(|part| part.parse().ok()).collect::<Option<_>>()?;
    let [first, second, third] = *numbers.as_slice() else { return None };
    let (year, month, day) = match order {
        DateOrder::Year => (first, second, third),
        // Dates with points begin with the day.
        DateOrder::Month if sign == '.' => return None,
        DateOrder::Day => (third, second, first),
        DateOrder::Month => (third, first, second),
    };
    let year = if order != DateOrder::Year && (0..=99).contains(&year) { 2000 + year } else { year };
    if !((1..=12).contains(&month) && (1..=31).contains(&day) && (1900..=2999).contains(&year)) {
        return None;
    }
    let time = time.trim();
    let at = time.find(['Z', 'z', '+', '-']).unwrap_or(time.len());
    let (time, zone) = time.split_at(at);
    let offset_s = match zone {
        "" | "Z" | "z" => 0.0,
        _ => {
            let (sign, rest) = zone.split_at(1);
            let (hours, minutes) = rest.split_once(':').unwrap_or((rest, "0"));
            let seconds = 3600.0 * hours.parse::<f64>().ok()? + 60.0 * minutes.parse::<f64>().ok()?;
            if sign == "+" { seconds } else { -seconds }
        }
    };
    // Days since 1970 in the Gregorian calendar, with years that begin in March (H. Hinnant, "chrono-compatible low-level date algorithms").
    let year = if month <= 2 { year - 1 } else { year };
    let (era, of_era) = (year.div_euclid(400), year.rem_euclid(400));
    let of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    let days = era * 146_097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719_468;
    // Beside a date, a time of two parts has no seconds.
    Some(86_400.0 * days as f64 + hours_minutes_s(time).or_else(|| clock_s(time))? - offset_s)
}

/// True if a cell is a date with a time, in any order.
pub fn is_date_time(cell: &str) -> bool {
    DateOrder::ALL.into_iter().any(|order| date_time_s(cell, order).is_some())
}

/// Word in `experiment.toml` for the times of a clock, by one of its cells: `iso` for a date that begins with the year, `clock` for a time of day. `None` for numbers, and for dates that
/// may begin with the day or with the month, and times of two parts.
pub fn clock_word(cell: &str) -> Option<&'static str> {
    let n_digits = cell.bytes().take_while(u8::is_ascii_digit).count();
    match is_date_time(cell) {
        true => (n_digits == 4).then_some("iso"),
        false => clock_s(cell).filter(|_| hours_minutes_s(cell).is_none()).map(|_| "clock"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_recognised_in_any_dress() {
        for (text, name, value) in [
            ("[µm]", "um", 1e-6),
            ("(μN)", "uN", 1e-6),
            ("uN", "uN", 1e-6),
            ("Seconds", "seconds", 1.0),
            ("min", "min", 60.0),
            ("MSEC", "msec", 1e-3),
            ("nN", "nN", 1e-9),
            ("cm", "cm", 1e-2),
            ("microN", "uN", 1e-6),
            ("[micro-Newton]", "uN", 1e-6),
            ("micron", "micron", 1e-6),
            ("nanometers", "nm", 1e-9),
            ("{millisec}", "ms", 1e-3),
            ("dyn", "dyn", 1e-5),
            ("[kN]", "kN", 1e3),
            ("Inches", "inches", 0.0254),
            ("mHz", "mHz", 1e-3),
            ("MPA", "MPa", 1e6),
            ("[1/min]", "1/min", 1.0 / 60.0),
            ("RPM", "rpm", 1.0 / 60.0),
            ("(cpm)", "cpm", 1.0 / 60.0),
            ("[mmHg]", "mmHg", 133.322_387_415),
            ("(cmH2O)", "cmH2O", 98.0665),
            ("ksi", "ksi", 6_894_757.293_168),
        ] {
            let found = unit(text).unwrap_or_else(|| panic!("{text}"));
            assert_eq!((found.name.as_str(), found.to_si(1.0)), (name, value), "{text}");
        }
        let pixel = unit("0.65 µm").expect("so many of a unit");
        assert_eq!((pixel.name.as_str(), pixel.dimension), ("0.65 um", Dimension::Length));
        assert!((pixel.to_si(2.0) - 1.3e-6).abs() < 1e-20);
        for text in
            ["", "MN", "Um", "MHz", "mpa", "MM", "a.u.", "V", "px", "-1 um", "0 um", "inf um", "0.65 px", "um 2"]
        {
            assert_eq!(unit(text), None, "{text}");
        }
    }

    #[test]
    fn powers_of_ten_belong_to_the_unit() {
        for (name, stem, si) in [
            ("G(t)/10^3 Pa", "G(t)", 1e3),
            ("E(t)/10^6 Pa", "E(t)", 1e6),
            ("F / 10^-3 N", "F ", 1e-3),
            ("Stress [10³ Pa]", "Stress ", 1e3),
            ("t/10⁻³ s", "t", 1e-3),
            ("Force (1e-6 N)", "Force ", 1e-6),
            ("Force (10^3·Pa)", "Force ", 1e3),
            ("Force/10-3 N", "Force", 1e-3),
            ("G/10**3 Pa", "G", 1e3),
            ("x10_um", "x10", 1e-6),
            ("Weg 1/um", "Weg 1", 1e-6),
            ("x2_um", "x2", 1e-6),
            ("Sensor 100 N", "Sensor 100", 1.0),
        ] {
            let (found, unit) = split_unit(name);
            let unit = unit.unwrap_or_else(|| panic!("{name}"));
            assert_eq!(found, stem, "{name}");
            assert!((unit.to_si(1.0) / si - 1.0).abs() < 1e-12, "{name}: {unit:?}");
        }
        for name in ["G x10^3 Pa", "Stress 10^3 Pa", "J(t) in 1/kPa", "Force (x10^3 N)", "G ×1000 Pa"] {
            assert_eq!(split_unit(name), (name, None), "{name}");
        }
    }

    #[test]
    fn units_stand_in_names_in_many_ways() {
        for name in ["x [µm]", "x (um)", "x/µm", "x_um", "x in µm", "x µm"] {
            let (stem, unit) = split_unit(name);
            assert_eq!((stem.trim(), unit.map(|unit| unit.name)), ("x", Some("um".into())), "{name}");
        }
        for name in ["f (1/min)", "f 1/min", "f in 1/min", "f_rpm", "f [min⁻¹]"] {
            let (stem, unit) = split_unit(name);
            assert_eq!((stem.trim(), unit.map(|unit| unit.to_si(60.0))), ("f", Some(1.0)), "{name}");
        }
        assert_eq!(split_unit("J (1/Pa)").1, None);
        assert_eq!(split_unit("DISP(M)").1.map(|unit| unit.name), Some("m".into()));
        assert_eq!(split_unit("Conductance (S)").1, None);
        assert_eq!(split_unit("Displacement (in)").1.map(|unit| unit.name), Some("inch".into()));
        assert_eq!(split_unit("x_in").1, None);
        assert_eq!(split_unit("TIME_S").1.map(|unit| unit.name), Some("s".into()));
        assert_eq!(split_unit("Сила (мкН)").1.map(|unit| unit.to_si(1.0)), Some(1e-6));
        assert_eq!(split_unit("cycle").1, None);
        assert_eq!(split_unit("position").1, None);
    }

    #[test]
    fn pixels_and_frames_are_counts() {
        for (name, found) in [
            ("x (px)", Some(("x", "pixel"))),
            ("X_pixels", Some(("X", "pixel"))),
            ("frame", Some(("frame", "frame"))),
            ("t [frames]", Some(("t", "frame"))),
            ("x (um)", None),
            ("framework", None),
        ] {
            assert_eq!(counted(name), found, "{name}");
        }
    }

    #[test]
    fn times_of_day_and_dates_are_seconds() {
        assert_eq!(clock_s("01:02:03.5"), Some(3723.5));
        assert_eq!(clock_s("02:03,5"), Some(123.5));
        assert_eq!(clock_s("01:02:03:250"), Some(3723.25));
        assert_eq!(clock_s("12:00:01.5 AM"), Some(1.5));
        assert_eq!(clock_s("12:00:01 pm"), Some(43_201.0));
        assert_eq!(clock_s("1:00:00 PM"), Some(46_800.0));
        let iso_s = |text| date_time_s(text, DateOrder::Year);
        assert_eq!(iso_s("1970-01-02T00:00:01Z"), Some(86_401.0));
        assert_eq!(iso_s("2000-03-01 12:00:00"), Some(951_912_000.0));
        assert_eq!(iso_s("2024-02-29T01:00:00.25+01:00"), Some(1_709_164_800.25));
        for text in ["12", "1:2:3:4", "1:2:3:+25", "1:2:3:4:250", "a:b", "12:99", "13:00:00 PM", "0:10:00 AM", " AM"] {
            assert_eq!(clock_s(text), None, "{text}");
        }
        for text in ["2024-13-01T00:00:00", "2024-02-29", "yesterday 10:00"] {
            assert_eq!(iso_s(text), None, "{text}");
        }
    }

    #[test]
    fn dates_may_begin_with_the_day_or_the_month() {
        let iso = date_time_s("2020-02-17 10:02:00.05", DateOrder::Year);
        for (text, order) in [
            ("17.02.2020 10:02:00,050", DateOrder::Day),
            ("17/02/2020 10:02:00.05", DateOrder::Day),
            ("2/17/2020 10:02:00.05 AM", DateOrder::Month),
            ("2/17/20, 10:02:00.05", DateOrder::Month),
        ] {
            assert_eq!(date_time_s(text, order), iso, "{text}");
            let others = DateOrder::ALL.into_iter().filter(|other| *other != order);
            assert!(others.into_iter().all(|other| date_time_s(text, other).is_none()), "{text}");
        }
        assert!(is_date_time("1/2/2020 3:04:05") && !is_date_time("10:02:00") && !is_date_time("1.2 3.4"));
    }
}
