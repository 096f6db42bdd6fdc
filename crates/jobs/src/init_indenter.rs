//! `init` for instruments that press a tip into a gel: the tip's radius and the stiffness of its spring, as lines above the table state them.

use base::units::Dimension;
use record::table::{decode_detected, split_unit, unit};

/// Names of the radius of a spherical tip in the lines above a table, lower case.
const RADIUS: [&str; 5] = ["tip radius", "tipradius", "probe radius", "indenter radius", "bead radius"];
/// Names of the stiffness of the spring that carries the tip, lower case. The value is in N/m.
const STIFFNESS: [&str; 5] =
    ["k (n/m)", "cantilever k (n/m)", "spring constant", "springconstant", "spring constant (n/m)"];
/// Signs between a name and its value.
const BETWEEN: [char; 4] = ['\t', ':', '=', ','];

/// Value that a line above the table states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct StatedValue {
    /// The value, in SI units.
    pub value: f64,
    /// Number of the line, from 1.
    pub line: usize,
}

/// Tip of an instrument, as the lines above a table state it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct StatedTip {
    /// Radius of the sphere, in m.
    pub radius_m: StatedValue,
    /// Stiffness of the spring that carries the tip, in N/m; `None` if no line states it.
    pub stiffness_n_per_m: Option<StatedValue>,
}

impl StatedTip {
    /// Finds the tip in the lines above the row in line `first_row_line`; `None` if no line states a radius with its unit.
    pub fn of(bytes: &[u8], first_row_line: usize) -> Option<Self> {
        let text = decode_detected(bytes);
        let stated = |names: &[&str], si: fn(&str, &str) -> Option<f64>| {
            text.lines().take(first_row_line.saturating_sub(1)).enumerate().find_map(|(index, line)| {
                let line = line.trim_start_matches(['#', '%', '/', ';', ' ']);
                let (name, rest) = line.split_once(BETWEEN)?;
                let called = name.trim().to_lowercase();
                let is_called = |known: &&str| [called.as_str(), split_unit(&called).0.trim()].contains(known);
                let value = rest.trim_start_matches(|c| BETWEEN.contains(&c) || c == ' ');
                let value =
                    names.iter().any(is_called).then(|| si(name, value.split('\t').next().unwrap_or(value)))??;
                (value > 0.0 && value.is_finite()).then_some(StatedValue { value, line: index + 1 })
            })
        };
        Some(Self {
            radius_m: stated(&RADIUS, length_m)?,
            stiffness_n_per_m: stated(&STIFFNESS, |_, value| value.split_whitespace().next()?.parse().ok()),
        })
    }
}

/// Length in m from a name such as `Tip radius (um)` and its value, or from a value with its unit.
fn length_m(name: &str, value: &str) -> Option<f64> {
    let (number, behind) = value.trim().split_once(' ').unwrap_or((value.trim(), ""));
    let unit = split_unit(name).1.or_else(|| unit(behind)).filter(|unit| unit.dimension == Dimension::Length)?;
    Some(unit.to_si(number.replace(',', ".").parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tip_is_found_above_the_table_with_its_unit() {
        let stated = |text: &str| StatedTip::of(text.as_bytes(), text.lines().count());
        let tip =
            stated("Scan (#)\t1\nk (N/m)\t0.019\nTip radius (um)\t27.500\nTime (s)\tLoad (uN)\n0\t1\n").expect("a tip");
        assert!((tip.radius_m.value - 27.5e-6).abs() < 1e-18 && tip.radius_m.line == 3);
        assert_eq!(tip.stiffness_n_per_m, Some(StatedValue { value: 0.019, line: 2 }));
        let tip = stated("# tipRadius: 5 um\n# springConstant: 0.03\n# columns: t F x\n0 1 2\n").expect("a tip");
        assert!((tip.radius_m.value - 5e-6).abs() < 1e-18 && tip.stiffness_n_per_m.is_some_and(|k| k.value == 0.03));
        for text in ["tip radius: 5\nt,F\n0,1\n", "k (N/m)\t0.019\nt,F\n0,1\n", "t,F\n0,1\ntip radius (um): 5\n"] {
            assert_eq!(stated(text), None, "{text}");
        }
    }
}
