//! Unit suffixes of columns and keys. Input is converted to SI units once, when it is read. All internal values are in SI units.
//!
//! A column name such as `force_uN` consists of a quantity and a unit, separated by the last underscore (`docs/formats.md` §1).

/// Physical dimension of a quantity in a column or key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dimension {
    /// Time, SI unit s.
    Time,
    /// Force, SI unit N.
    Force,
    /// Length, SI unit m.
    Length,
    /// Electric current, SI unit A.
    Current,
    /// Frequency in cycles per second, unit Hz.
    Frequency,
    /// Stress or modulus, SI unit Pa.
    Pressure,
    /// Angle, SI unit rad.
    Angle,
    /// Ratio, such as a strain; unit 1.
    Ratio,
}

/// Unit that input may use.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// Suffix without its underscore, such as `uN`; case matters.
    pub suffix: &'static str,
    /// Physical dimension of the unit.
    pub dimension: Dimension,
    /// Number of these units in one SI unit: 10⁶ for `um`. It is a power of ten and hence exact in `f64`.
    pub per_si_unit: f64,
}

/// All units that input may use (`docs/formats.md` §1). Listing, parsing and error messages read this slice.
pub const UNITS: &[Unit] = &[
    Unit { suffix: "s", dimension: Dimension::Time, per_si_unit: 1.0 },
    Unit { suffix: "ms", dimension: Dimension::Time, per_si_unit: 1e3 },
    Unit { suffix: "N", dimension: Dimension::Force, per_si_unit: 1.0 },
    Unit { suffix: "mN", dimension: Dimension::Force, per_si_unit: 1e3 },
    Unit { suffix: "uN", dimension: Dimension::Force, per_si_unit: 1e6 },
    Unit { suffix: "nN", dimension: Dimension::Force, per_si_unit: 1e9 },
    Unit { suffix: "pN", dimension: Dimension::Force, per_si_unit: 1e12 },
    Unit { suffix: "m", dimension: Dimension::Length, per_si_unit: 1.0 },
    Unit { suffix: "mm", dimension: Dimension::Length, per_si_unit: 1e3 },
    Unit { suffix: "um", dimension: Dimension::Length, per_si_unit: 1e6 },
    Unit { suffix: "nm", dimension: Dimension::Length, per_si_unit: 1e9 },
    Unit { suffix: "A", dimension: Dimension::Current, per_si_unit: 1.0 },
    Unit { suffix: "mA", dimension: Dimension::Current, per_si_unit: 1e3 },
    Unit { suffix: "uA", dimension: Dimension::Current, per_si_unit: 1e6 },
    Unit { suffix: "Hz", dimension: Dimension::Frequency, per_si_unit: 1.0 },
    Unit { suffix: "Pa", dimension: Dimension::Pressure, per_si_unit: 1.0 },
    Unit { suffix: "mPa", dimension: Dimension::Pressure, per_si_unit: 1e3 },
    Unit { suffix: "rad", dimension: Dimension::Angle, per_si_unit: 1.0 },
];

impl Unit {
    /// Finds the unit with this dimension and suffix; `None` if it is not accepted.
    pub fn find(dimension: Dimension, suffix: &str) -> Option<Unit> {
        UNITS.iter().find(|unit| unit.dimension == dimension && unit.suffix == suffix).copied()
    }

    /// Converts a value in this unit to SI.
    ///
    /// The function divides by an exact power of ten, which is more accurate than multiplying by an inexact one. For example, 4.6 µN becomes the double
    /// nearest to 4.6·10⁻⁶ N in almost every case.
    pub fn to_si(self, value: f64) -> f64 {
        value / self.per_si_unit
    }
}

impl Dimension {
    /// Lists this dimension's accepted suffixes with their underscores for messages, such as "_s, _ms".
    pub fn accepted_suffixes(self) -> String {
        let suffixes: Vec<String> =
            UNITS.iter().filter(|unit| unit.dimension == self).map(|unit| format!("_{}", unit.suffix)).collect();
        suffixes.join(", ")
    }
}

/// Returns the candidate most similar to a misspelt name; `None` if none is similar enough.
///
/// Similarity is measured by the case-insensitive Levenshtein distance. The distance may be at most a third of the longer name's length, or
/// 2 if this is larger. It must also be less than the candidate's length.
pub fn nearest_name<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    candidates
        .into_iter()
        .map(|candidate| (strsim::levenshtein(&name.to_lowercase(), &candidate.to_lowercase()), candidate))
        .filter(|(distance, candidate)| {
            *distance
                <= (name.chars().count().max(candidate.chars().count()) / 3)
                    .max(2)
                    .min(candidate.len().saturating_sub(1))
        })
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unit_converts_one_million_to_its_si_value() {
        let expected = [
            ("s", 1e6),
            ("ms", 1e3),
            ("N", 1e6),
            ("mN", 1e3),
            ("uN", 1.0),
            ("nN", 1e-3),
            ("pN", 1e-6),
            ("m", 1e6),
            ("mm", 1e3),
            ("um", 1.0),
            ("nm", 1e-3),
            ("A", 1e6),
            ("mA", 1e3),
            ("uA", 1.0),
            ("Hz", 1e6),
            ("Pa", 1e6),
            ("mPa", 1e3),
            ("rad", 1e6),
        ];
        assert_eq!(UNITS.len(), expected.len());
        for (unit, (suffix, si)) in UNITS.iter().zip(expected) {
            assert_eq!(unit.suffix, suffix);
            assert_eq!(unit.to_si(1e6), si);
        }
    }

    #[test]
    fn a_suffix_counts_only_in_its_dimension_and_case() {
        assert!(Unit::find(Dimension::Length, "mm").is_some());
        assert!(Unit::find(Dimension::Force, "mm").is_none());
        assert!(Unit::find(Dimension::Force, "un").is_none());
        assert!(Unit::find(Dimension::Time, "").is_none());
    }

    #[test]
    fn misspelt_names_find_their_neighbour_and_strangers_do_not() {
        let names = ["diameter_mm", "length_mm", "density_kg_m3"];
        assert_eq!(nearest_name("diametre_mm", names), Some("diameter_mm"));
        assert_eq!(nearest_name("Density_kg_m3", names), Some("density_kg_m3"));
        assert_eq!(nearest_name("colour", names), None);
        assert_eq!(nearest_name("", ["id"]), None);
    }
}
