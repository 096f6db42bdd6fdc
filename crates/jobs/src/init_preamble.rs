//! What the lines above a table say of the test.

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

/// Line that says that the specimen is tested in tension, compression or bending. `None` without such a line, or if another line names shear.
pub(super) fn uniaxial_line(preamble: &[String]) -> Option<&str> {
    let of_test = || {
        preamble
            .iter()
            .map(|line| (line.trim(), line.to_lowercase()))
            .filter(|(_, lower)| KEYS.iter().any(|key| lower.contains(key)))
    };
    let says = |words: &[&str], lower: &str| words.iter().any(|word| lower.contains(word));
    if of_test().any(|(_, lower)| says(&SHEAR, &lower)) {
        return None;
    }
    of_test().find(|(_, lower)| says(&UNIAXIAL, lower) && !lower.contains("surface tension")).map(|(line, _)| line)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_preamble_names_tension_unless_it_names_shear() {
        let line_of = |lines: &[&str]| {
            let lines: Vec<String> = lines.iter().map(|line| line.to_string()).collect();
            uniaxial_line(&lines).map(String::from)
        };
        for line in [
            "Clamp\tTension: Film",
            "Mode: 3-Point Bending",
            "Geometry name,DMA Single Cantilever",
            "Test type = tensile",
        ] {
            assert_eq!(line_of(&["Sample: gel", line]).as_deref(), Some(line));
            assert_eq!(line_of(&["Geometry: parallel plate", line]), None);
        }
        for line in
            ["Clamp: shear sandwich", "Surface tension of the test liquid 72 mN/m", "Sample: compression stockings", ""]
        {
            assert_eq!(line_of(&[line]), None, "{line}");
        }
    }
}
