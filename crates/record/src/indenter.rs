//! Indenter: a tip that is pressed into a viscoelastic half-space, and the compliance that converts its force to depth (physics §5.1).

use std::f64::consts::PI;

use base::error::Result;
use base::toml_input::TomlTable;

/// Tip that is pressed into a half-space: δ^p = k ∫J dF while the contact grows. Here δ is the depth below the contact point, p the exponent and k
/// the compliance of the tip, J the creep compliance and F the force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Indenter {
    /// Shape of the tip, which determines the exponent p.
    pub tip: Tip,
    /// Size of the tip: a sphere's radius in m, a cone's half-angle in rad or a punch's radius in m; `None` if unknown.
    pub size: Option<f64>,
    /// Poisson ratio of the half-space, in (−1, 0.5].
    pub poisson_ratio: f64,
    /// Stiffness in N/m of the spring that carries the tip. The tip's position is the recorded position minus the spring's deflection. `None` if the
    /// record gives the tip's position itself.
    pub cantilever_n_per_m: Option<f64>,
}

base::named_enum! {
    /// Shape of the tip.
    pub enum Tip {
        /// Sphere that is much larger than the depth, with the exponent 3/2.
        Sphere = "sphere",
        /// Cone, with the exponent 2.
        Cone = "cone",
        /// Flat-ended cylinder, with the exponent 1.
        Punch = "flat punch",
    }
    /// Name of the shape in messages.
    pub fn name
}

/// Radius in m that is assumed for a sphere or punch of unknown size. Moduli then contain an unknown factor.
const NOMINAL_RADIUS_M: f64 = 1e-6;
const NOMINAL_HALF_ANGLE_RAD: f64 = 0.25 * PI;
/// Allowed radii of tips in m: from a nanometre to a metre.
const RADII_M: [f64; 2] = [1e-9, 1.0];
/// Allowed half-angles of cones, in degrees. Cones outside this range are needles or plates.
const HALF_ANGLES_DEG: [f64; 2] = [1.0, 89.0];
/// Allowed stiffnesses of springs in N/m: from an optical trap to a testing machine.
const STIFFNESSES_N_PER_M: [f64; 2] = [1e-9, 1e12];
/// Default Poisson ratio, that of gels and soft tissue, which keep their volume.
const INCOMPRESSIBLE: f64 = 0.5;

const KEYS: [&str; 7] = [
    "exponent",
    "tip_radius_um",
    "tip_radius_mm",
    "half_angle_deg",
    "punch_radius_um",
    "poisson_ratio",
    "cantilever_n_per_m",
];

impl Tip {
    /// Exponent p of the tip: the depth to the power p is proportional to the force in an elastic half-space.
    pub fn exponent(self) -> f64 {
        match self {
            Self::Sphere => 1.5,
            Self::Cone => 2.0,
            Self::Punch => 1.0,
        }
    }

    /// Keys of `[indenter]` that may give the size of a tip of this shape.
    fn size_keys(self) -> &'static [&'static str] {
        match self {
            Self::Sphere => &["tip_radius_um", "tip_radius_mm"],
            Self::Cone => &["half_angle_deg"],
            Self::Punch => &["punch_radius_um"],
        }
    }

    /// Converts the value of the size key `key` to SI units: a radius in m, or a half-angle in rad.
    fn size_from(self, table: TomlTable<'_>, key: &str, value: f64) -> Result<f64> {
        match self {
            Self::Cone => Ok(table.require_range(key, value, HALF_ANGLES_DEG)?.to_radians()),
            Self::Sphere | Self::Punch => {
                let per_m = if key.ends_with("_mm") { 1e3 } else { 1e6 };
                Ok(table.require_range(key, value, RADII_M.map(|radius_m| per_m * radius_m))? / per_m)
            }
        }
    }
}

impl Indenter {
    /// Reads the table `[indenter]`.
    pub(super) fn from_table(table: TomlTable<'_>) -> Result<Self> {
        table.only(&KEYS)?;
        let exponent = table.required_number("exponent", "exponent = 1.5")?;
        let Some(tip) = Tip::ALL.into_iter().find(|tip| tip.exponent() == exponent) else {
            return Err(table.refuse(
                "exponent",
                format!("exponent {exponent} belongs to no tip shape"),
                "write 1.5 for a sphere, 2 for a cone or a pyramid, 1 for a flat punch",
            ));
        };
        let sizes = KEYS.iter().copied().filter(|key| key.contains("radius") || key.contains("angle"));
        let mut size = None;
        for key in sizes {
            let Some(value) = table.positive(key, &format!("{key} = 5.0"))? else { continue };
            if !tip.size_keys().contains(&key) {
                let remedy = format!("give {}, or correct `exponent`", tip.size_keys().join(" or "));
                return Err(table.refuse(
                    key,
                    format!("exponent {exponent} belongs to a {}, which does not have this size", tip.name()),
                    remedy,
                ));
            }
            if size.replace(tip.size_from(table, key, value)?).is_some() {
                return Err(table.refuse(key, "the tip's size is given twice, by two keys", "keep only one key"));
            }
        }
        let poisson_ratio = table.number("poisson_ratio")?.unwrap_or(INCOMPRESSIBLE);
        if !(poisson_ratio > -1.0 && poisson_ratio <= INCOMPRESSIBLE) {
            return Err(table.refuse(
                "poisson_ratio",
                format!("{poisson_ratio} lies outside (−1, 0.5]"),
                "give a Poisson ratio above −1 and at most 0.5; the default is 0.5, the value of gels and soft tissue",
            ));
        }
        let stiffness = table.positive("cantilever_n_per_m", "cantilever_n_per_m = 0.06")?;
        let cantilever_n_per_m = stiffness
            .map(|stiffness| table.require_range("cantilever_n_per_m", stiffness, STIFFNESSES_N_PER_M))
            .transpose()?;
        Ok(Self { tip, size, poisson_ratio, cantilever_n_per_m })
    }

    /// Exponent p of the tip: the depth to the power p is proportional to the force in an elastic half-space.
    pub fn exponent(&self) -> f64 {
        self.tip.exponent()
    }

    /// Compliance k of the tip in m^(p−2), defined by δ^p = k ∫J dF with the depth δ, the exponent p, the creep compliance J and the force F. For the
    /// Poisson ratio ν, k is 3(1−ν²)/(4√R) for a sphere of radius R (Hertz), π(1−ν²)/(2 tan α) for a cone of half-angle α and (1−ν²)/(2a) for a punch
    /// of radius a (Sneddon 1965, doi:10.1016/0020-7225(65)90019-4). An unknown size is replaced by a radius of 1 µm or a half-angle of 45°.
    pub fn compliance(&self) -> f64 {
        let plane = 1.0 - self.poisson_ratio * self.poisson_ratio;
        let radius_m = self.size.unwrap_or(NOMINAL_RADIUS_M);
        match self.tip {
            Tip::Sphere => 0.75 * plane / radius_m.sqrt(),
            Tip::Cone => 0.5 * PI * plane / self.size.unwrap_or(NOMINAL_HALF_ANGLE_RAD).tan(),
            Tip::Punch => 0.5 * plane / radius_m,
        }
    }

    /// Text of the table `[indenter]` for `experiment.toml`.
    pub fn toml(&self) -> String {
        let mut lines = vec!["[indenter]".to_string(), format!("exponent = {}", self.exponent())];
        lines.extend(self.size.map(|size| match self.tip {
            Tip::Sphere => format!("tip_radius_um = {}", 1e6 * size),
            Tip::Cone => format!("half_angle_deg = {}", size.to_degrees()),
            Tip::Punch => format!("punch_radius_um = {}", 1e6 * size),
        }));
        lines.push(format!("poisson_ratio = {}", self.poisson_ratio));
        lines.extend(self.cantilever_n_per_m.map(|stiffness| format!("cantilever_n_per_m = {stiffness}")));
        lines.join("\n") + "\n"
    }

    /// Text that names the assumed size of a tip of unknown size, for messages; `None` if the size is known.
    pub(super) fn nominal_size(&self) -> Option<&'static str> {
        match (self.size, self.tip) {
            (Some(_), _) => None,
            (None, Tip::Cone) => Some("a half-angle of 45°"),
            (None, Tip::Sphere | Tip::Punch) => Some("a radius of 1 µm"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::toml_input::TomlInput;

    fn read(lines: &str) -> Result<Indenter> {
        let text = format!("[indenter]\n{lines}\n");
        let document = TomlInput::parse(std::path::Path::new("e.toml"), &text).unwrap();
        Indenter::from_table(document.root().required_table("indenter").unwrap())
    }

    /// Compares depths with the formulas of Hertz (sphere) and Sneddon (cone and punch), written by hand as force over depth. For an elastic
    /// half-space, the indenter must return the depth from which each force was computed.
    #[test]
    fn closed_forms_give_the_depth() {
        let depth_m = |lines: &str, young_pa: f64, force_n: f64| {
            let indenter = read(lines).unwrap();
            (indenter.compliance() * force_n / young_pa).powf(1.0 / indenter.exponent())
        };
        // Sphere: F = (4/3) E/(1−ν²) √R δ^{3/2}. E = 1 kPa, ν = 0.5, R = 4 µm and δ = 1 µm give 3.5556e-9 N.
        let hertz = depth_m("exponent = 1.5\ntip_radius_um = 4", 1e3, 4.0 / 3.0 * 1e3 / 0.75 * 2e-3 * 1e-9);
        assert!((hertz / 1e-6 - 1.0).abs() < 1e-12, "{hertz}");
        assert_eq!(
            read("exponent = 1.5\ntip_radius_mm = 0.004").unwrap(),
            read("exponent = 1.5\ntip_radius_um = 4").unwrap()
        );
        // Cone: F = (2/π) E/(1−ν²) tan α δ² with α = 30°, ν = 0.4, δ = 2 µm.
        let force_n = 2.0 / PI * 5e2 / 0.84 * (1.0 / 3.0_f64.sqrt()) * 4e-12;
        let cone = depth_m("exponent = 2\nhalf_angle_deg = 30\npoisson_ratio = 0.4", 5e2, force_n);
        assert!((cone / 2e-6 - 1.0).abs() < 1e-12, "{cone}");
        // Punch: F = 2 a E/(1−ν²) δ with the radius a.
        let punch = depth_m("exponent = 1\npunch_radius_um = 10", 2e3, 2.0 * 1e-5 * 2e3 / 0.75 * 3e-7);
        assert!((punch / 3e-7 - 1.0).abs() < 1e-12, "{punch}");
    }

    #[test]
    fn what_is_written_is_read_back() {
        for lines in [
            "exponent = 1.5",
            "exponent = 1.5\ntip_radius_um = 2.5\ncantilever_n_per_m = 0.061",
            "exponent = 2.0\nhalf_angle_deg = 35\npoisson_ratio = 0.45",
            "exponent = 1\npunch_radius_um = 7",
        ] {
            let indenter = read(lines).unwrap();
            let again = read(indenter.toml().trim_start_matches("[indenter]\n")).unwrap();
            assert!((again.compliance() / indenter.compliance() - 1.0).abs() < 1e-14, "{lines}");
            assert_eq!((again.tip, again.cantilever_n_per_m), (indenter.tip, indenter.cantilever_n_per_m));
        }
    }

    #[test]
    fn what_cannot_be_is_refused_with_a_remedy() {
        let refused = |lines: &str, words: &[&str]| {
            let message = read(lines).unwrap_err().to_string();
            assert!(words.iter().all(|word| message.contains(word)), "{message}");
        };
        refused("tip_radius_um = 3", &["exponent", "exponent = 1.5"]);
        refused("exponent = 1.7", &["line 2", "1.7", "1.5 for a sphere"]);
        refused("exponent = 2\ntip_radius_um = 3", &["line 3", "cone", "half_angle_deg"]);
        refused("exponent = 1.5\ntip_radius_um = 3\ntip_radius_mm = 0.003", &["line 4", "twice"]);
        refused("exponent = 2\nhalf_angle_deg = 90", &["line 3", "half_angle_deg"]);
        refused("exponent = 1.5\npoisson_ratio = 0.51", &["0.51", "at most 0.5"]);
        refused("exponent = 1.5\ntip_radius_um = 0", &["above zero"]);
    }
}
