//! What the lines above a table say of the test: how the specimen is held, and sizes.

use base::units::Dimension;
use record::table::{bracketed, split_unit, unit};

/// Words of lines that name how a specimen is held and loaded.
const KEYS: [&str; 11] =
    ["geometry", "clamp", "mode", "fixture", "grip", "deformation", "test", "loading", "method", "instrument", "probe"];
/// Words for tension, compression and bending.
const UNIAXIAL: [&str; 10] = [
    "tension",
    "tensile",
    "uniaxial",
    "compression",
    "cantilever",
    "bending",
    "flexur",
    "three-point",
    "three point",
    "3-point",
];
/// Words for shear, and for the geometries of rotational rheometers, which also compress their specimens.
const SHEAR: [&str; 8] = ["shear", "torsion", "rotation", "cone", "couette", "cylinder", "vane", "plate"];
/// Words of a title that names a test in tension or compression: one of the first together with one of the second, which keep away settings, materials and remarks.
const TITLES: [&str; 5] = ["tension", "tensile", "uniaxial", "compression", "compressive"];
const OF_TESTS: [&str; 12] = [
    "unconfined",
    "confined",
    "uniaxial",
    "test",
    "tests",
    "relaxation",
    "creep",
    "dynamic",
    "dma",
    "electroforce",
    "instron",
    "zwick",
];
/// Number of lines above the rows among which the name of the table's step stands, with names, units and a remark.
const HEADER_LINES: usize = 4;
/// Signs between a name and its value.
const BETWEEN: [char; 5] = ['\t', ':', '=', ',', ';'];

/// Ends of names that say by which device a size is measured.
const QUALIFIERS: [&str; 2] = [", standard travel", ", crosshead"];

/// Lines above a table, each with its number from 1.
#[derive(Debug, Clone, Copy)]
pub(super) struct Preamble<'a>(pub &'a [(usize, String)]);

/// Value that a line above the table states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct StatedValue {
    /// The value, in SI units.
    pub value: f64,
    /// Number of the line, from 1.
    pub line: usize,
}

impl<'a> Preamble<'a> {
    /// Line that says that the specimen is tested in tension, compression or bending. `None` without such a line, or if another line names shear. The name of the table's step, such
    /// as `Axial - 1`, says more than the geometry, whose plates may be those of a rheometer.
    pub fn uniaxial_line(self) -> Option<&'a str> {
        let is_axial = |line: &str| {
            let lower = line.to_lowercase();
            lower.split(|c: char| !c.is_alphabetic()).filter(|word| !word.is_empty()).eq(["axial"])
        };
        let last = self.0.last().map_or(0, |(number, _)| *number);
        let is_of_table = |number: usize| number + HEADER_LINES > last;
        if let Some((_, line)) = self.0.iter().find(|(number, line)| is_of_table(*number) && is_axial(line)) {
            return Some(line.trim());
        }
        let of_test = || {
            let lines = self.0.iter().map(|(_, line)| (line.trim(), line.to_lowercase()));
            lines.filter(|(_, lower)| KEYS.iter().any(|key| lower.contains(key)))
        };
        let says = |words: &[&str], lower: &str| words.iter().any(|word| lower.contains(word));
        // Plates of a rheometer shear, and plates of compression do not.
        let says_shear = |lower: &str| says(&SHEAR, &lower.replace("compression plate", ""));
        if of_test().any(|(_, lower)| says_shear(&lower)) {
            return None;
        }
        let is_of_key = |lower: &str| {
            (says(&UNIAXIAL, lower) || words(lower).any(|word| word == "dma")) && !is_of_other_things(lower)
        };
        let of_key = of_test().find(|(_, lower)| is_of_key(lower));
        let lines = || self.0.iter().map(|(_, line)| (line.trim(), line.to_lowercase()));
        let is_sheared = lines().any(|(_, lower)| says_shear(&lower));
        of_key.or_else(|| lines().find(|(_, lower)| !is_sheared && is_title(lower))).map(|(line, _)| line)
    }

    /// Length in m that a line states with its unit under one of the names, which are in lower case.
    pub fn length_m(self, names: &[&str]) -> Option<StatedValue> {
        self.stated(names, |name, value| {
            let (number, behind) = number_and_unit(value)?;
            let unit = split_unit(name).1.or_else(|| unit(behind))?;
            (unit.dimension == Dimension::Length).then(|| unit.to_si(number))
        })
    }

    /// Area in m² that a line states with its unit under one of the names, which are in lower case.
    pub fn area_m2(self, names: &[&str]) -> Option<StatedValue> {
        self.stated(names, |name, value| {
            let (number, behind) = number_and_unit(value)?;
            let square = bracketed(name).map_or(behind, |(_, text)| text).trim();
            let side = ["^2", "²", "2"].iter().find_map(|power| square.strip_suffix(power))?;
            let side_m = unit(side).filter(|unit| unit.dimension == Dimension::Length)?.to_si(1.0);
            Some(number * side_m * side_m)
        })
    }

    /// Number that a line states under one of the names, which are in lower case.
    pub fn number(self, names: &[&str]) -> Option<StatedValue> {
        self.stated(names, |_, value| number_and_unit(value).map(|(number, _)| number))
    }

    /// Value above zero that a line states under one of the names. The line nearest to the table decides: lines of other tables may stand farther above.
    fn stated(self, names: &[&str], si: fn(&str, &str) -> Option<f64>) -> Option<StatedValue> {
        self.0.iter().rev().find_map(|(number, line)| {
            let line = line.trim_start_matches(['#', '%', '/', ';', ' ']);
            // A name in quotation marks may contain a comma, unless the quotation marks enclose the value, too.
            let is_name =
                |(name, rest): &(&str, &str)| !name.contains([':', '=', ';', '\t']) && !rest.trim().is_empty();
            let quoted = line.strip_prefix('"').and_then(|text| text.split_once('"')).filter(is_name);
            let (name, rest) = quoted.or_else(|| line.trim_start_matches('"').split_once(BETWEEN))?;
            let name = name.trim_end_matches('"');
            let called = name.trim().to_lowercase();
            let called = QUALIFIERS.iter().find_map(|end| called.strip_suffix(end)).unwrap_or(&called).to_string();
            let before_bracket = called.split(['(', '[']).next().unwrap_or_default().trim();
            if !names
                .iter()
                .any(|known| [called.as_str(), split_unit(&called).0.trim(), before_bracket].contains(known))
            {
                return None;
            }
            let value = rest.trim_start_matches(|c| BETWEEN.contains(&c) || c == ' ' || c == '"');
            let value = si(name, value)?;
            (value > 0.0 && value.is_finite()).then_some(StatedValue { value, line: *number })
        })
    }
}

/// True if a line in lower case names a test of tension or compression, and is not a value with its name.
fn is_title(lower: &str) -> bool {
    let has = |list: &[&str]| words(lower).any(|word| list.contains(&word));
    !lower.contains([':', '=', ';', '\t']) && has(&TITLES) && has(&OF_TESTS) && !is_of_other_things(lower)
}

/// True if a line in lower case denies a load, or names the tension of a surface.
fn is_of_other_things(lower: &str) -> bool {
    words(lower).any(|word| ["no", "not", "without", "surface", "interfacial"].contains(&word))
}

fn words(lower: &str) -> impl Iterator<Item = &str> {
    lower.split(|c: char| !c.is_alphanumeric())
}

/// Number at the start of a text, with a point or a comma, and the unit behind it, also in the next cell.
fn number_and_unit(value: &str) -> Option<(f64, &str)> {
    let value = value.trim();
    let end = value.find(|c: char| !(c.is_ascii_digit() || ['.', ',', '+', '-', 'e', 'E'].contains(&c)));
    let (number, behind) = value.split_at(end.unwrap_or(value.len()));
    let number = number.trim_end_matches(',').replace(',', ".").parse().ok()?;
    Some((number, behind.trim_matches(|c| BETWEEN.contains(&c) || c == ' ' || c == '"')))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(text: &str) -> Vec<(usize, String)> {
        text.lines().enumerate().map(|(place, line)| (place + 1, line.to_string())).collect()
    }

    #[test]
    fn a_preamble_names_tension_unless_it_names_shear() {
        let line_of = |text: &str| Preamble(&lines(text)).uniaxial_line().map(String::from);
        for line in [
            "Clamp\tTension: Film",
            "Mode: 3-Point Bending",
            "Geometry name,DMA Single Cantilever",
            "Test type = tensile",
        ] {
            assert_eq!(line_of(&format!("Sample: gel\n{line}")).as_deref(), Some(line));
            assert_eq!(line_of(&format!("Geometry: parallel plate\n{line}")), None);
        }
        assert_eq!(
            line_of("Geometry: parallel plate\n- Axial Compliance [m/N]: 1E-6\nAxial - 1\t\t").as_deref(),
            Some("Axial - 1")
        );
        for line in
            ["Clamp: shear sandwich", "Surface tension of the test liquid 72 mN/m", "Sample: compression stockings", ""]
        {
            assert_eq!(line_of(line), None, "{line}");
        }
    }

    #[test]
    fn sizes_are_read_with_their_unit_and_line() {
        for (text, length_mm) in [
            ("Gauge length: 10 mm", Some(10.0)),
            ("sample gel\n\"Gauge length\",\"12,5\",\"mm\"", Some(12.5)),
            ("# gauge length (um) = 800", Some(0.8)),
            ("Gauge length;25.0;mm", Some(25.0)),
            ("Gauge length: 10", None),
            ("Gauge length: -3 mm", None),
            ("Gauge: 10 mm", None),
        ] {
            let found = Preamble(&lines(text)).length_m(&["gauge length"]);
            assert_eq!(found.map(|found| (1e9 * found.value).round() / 1e6), length_mm, "{text}");
        }
        for (text, area_mm2) in [
            ("Area: 12 mm^2", Some(12.0)),
            ("Area (mm²): 12", Some(12.0)),
            ("Area\t0.2\tcm2", Some(20.0)),
            ("Area: 12 mm", None),
        ] {
            let found = Preamble(&lines(text)).area_m2(&["area"]);
            assert_eq!(found.map(|found| (1e9 * found.value).round() / 1e3), area_mm2, "{text}");
        }
    }
}
