//! Apparatus of an experiment and its tables in `experiment.toml`: a bead or robot in the vitreous, an indenter, or another instrument.

use std::f64::consts::PI;

use super::indenter::Indenter;
use base::error::{Result, Setting};
use base::toml_input::TomlTable;

/// Apparatus on which the force acts and whose position is measured.
#[derive(Debug, Clone, PartialEq)]
pub enum Apparatus {
    /// A bead or robot inside the vitreous, computed with the finite-element model.
    Robot {
        /// Bead or robot that the force moves.
        robot: Robot,
        /// Ball of gel around the robot.
        vitreous: Vitreous,
    },
    /// Another instrument that responds linearly: position = compliance × ∫J dF, with J the creep compliance and F the force.
    Instrument {
        /// Compliance of the instrument in 1/m: its position per force, divided by the creep compliance (1/Pa).
        compliance_per_m: f64,
        /// True if the record has stress and strain. A stress of 1 Pa then counts as 1 µN, and a strain of 1 % as 1 µm.
        is_stress_strain: bool,
    },
    /// Tip that is pressed into a half-space: depth^p = compliance × ∫J dF. p is the exponent of the tip's shape, J the creep compliance and F the
    /// force.
    Indenter(Indenter),
}

/// Bead or microrobot that the force moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Robot {
    /// Shape and sizes of the robot.
    pub shape: RobotShape,
    /// Density in kg/m³, used for inertia only; `None` if it is not given.
    pub density_kg_m3: Option<f64>,
    /// Offset of the robot's centre from the vitreous's centre; `None` for a robot in the middle.
    pub offset: Option<Offset>,
}

/// Offset of the robot's centre from the vitreous's centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Offset {
    /// Distance between the two centres in m, above 0.
    pub distance_m: f64,
    /// Direction of the offset relative to the force.
    pub direction: OffsetDirection,
}

base::named_enum! {
    /// Direction of a robot's offset relative to the force.
    pub enum OffsetDirection {
        /// Along the force, which is the x axis.
        Along = "along",
        /// Across the force, along the y axis, which is also the long axis of a vertical robot.
        Across = "across",
    }
    /// Name of the direction in `experiment.toml`.
    pub fn name
}

impl OffsetDirection {
    /// Index of the axis of the offset: 0 for x, 1 for y.
    pub fn axis(self) -> usize {
        match self {
            Self::Along => 0,
            Self::Across => 1,
        }
    }
}

/// Shape of the robot, with sizes in m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RobotShape {
    /// A sphere.
    Sphere {
        /// Diameter in m.
        diameter_m: f64,
    },
    /// A prolate ellipsoid of revolution.
    Ellipsoid {
        /// Long axis in m.
        length_m: f64,
        /// Short axes in m.
        diameter_m: f64,
        /// Direction of the long axis relative to the force.
        orientation: Orientation,
    },
    /// A circular cylinder.
    Cylinder {
        /// Length in m.
        length_m: f64,
        /// Diameter in m.
        diameter_m: f64,
        /// Direction of the long axis relative to the force.
        orientation: Orientation,
    },
}

/// Direction of a robot's long axis relative to the force.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Orientation {
    /// Long axis along the force.
    Horizontal,
    /// Long axis across the force.
    Vertical,
}

/// Ball of gel around the robot, with a fixed outer surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vitreous {
    /// Diameter in m.
    pub diameter_m: f64,
    /// Poisson ratio, in (−1, 0.5).
    pub poisson_ratio: f64,
    /// Density in kg/m³, used for inertia only; `None` if it is not given.
    pub density_kg_m3: Option<f64>,
}

/// Returns the line `density_kg_m3 = …` of `experiment.toml` for a density, or an empty string for `None`.
pub fn density_toml(density_kg_m3: Option<f64>) -> String {
    density_kg_m3.map_or(String::new(), |density| format!("density_kg_m3 = {density}\n"))
}

impl RobotShape {
    /// Volume of the robot, in m³.
    pub fn volume_m3(&self) -> f64 {
        match *self {
            Self::Sphere { diameter_m } => PI / 6.0 * diameter_m.powi(3),
            Self::Ellipsoid { length_m, diameter_m, .. } => PI / 6.0 * diameter_m * diameter_m * length_m,
            Self::Cylinder { length_m, diameter_m, .. } => 0.25 * PI * diameter_m * diameter_m * length_m,
        }
    }

    /// Radius in m of the sphere that has the robot's volume.
    pub fn equivalent_radius_m(&self) -> f64 {
        match *self {
            Self::Sphere { diameter_m } => 0.5 * diameter_m,
            _ => (0.75 / PI * self.volume_m3()).cbrt(),
        }
    }

    /// Diameter or length of the robot in m, whichever is smaller.
    fn smallest_size_m(&self) -> f64 {
        match *self {
            Self::Sphere { diameter_m } => diameter_m,
            Self::Ellipsoid { length_m, diameter_m, .. } | Self::Cylinder { length_m, diameter_m, .. } => {
                length_m.min(diameter_m)
            }
        }
    }

    /// Distance in m from the robot's centre to the farthest point of its surface.
    pub fn outer_radius_m(&self) -> f64 {
        match *self {
            Self::Sphere { diameter_m } => diameter_m / 2.0,
            Self::Ellipsoid { length_m, diameter_m, .. } => length_m.max(diameter_m) / 2.0,
            Self::Cylinder { length_m, diameter_m, .. } => length_m.hypot(diameter_m) / 2.0,
        }
    }
}

impl Robot {
    /// Distance in m from the vitreous's centre to the farthest point of the robot's surface.
    pub fn farthest_point_m(&self) -> f64 {
        let Some(Offset { distance_m, direction }) = self.offset else { return self.shape.outer_radius_m() };
        let is_along = |orientation| (orientation == Orientation::Horizontal) == (direction == OffsetDirection::Along);
        match self.shape {
            RobotShape::Sphere { diameter_m } => distance_m + 0.5 * diameter_m,
            RobotShape::Cylinder { length_m, diameter_m, orientation } if is_along(orientation) => {
                (distance_m + 0.5 * length_m).hypot(0.5 * diameter_m)
            }
            RobotShape::Cylinder { length_m, diameter_m, .. } => (distance_m + 0.5 * diameter_m).hypot(0.5 * length_m),
            RobotShape::Ellipsoid { length_m, orientation, .. } if is_along(orientation) => distance_m + 0.5 * length_m,
            RobotShape::Ellipsoid { length_m, diameter_m, .. } => {
                // The ellipsoid has the half-axes a and b and is offset by d across its long axis a. The squared distance of its surface point at the
                // angle t is (d + b cos t)² + (a sin t)².
                let (a, b) = (0.5 * length_m, 0.5 * diameter_m);
                let spread = a * a - b * b;
                let cos = if distance_m * b < spread { distance_m * b / spread } else { 1.0 };
                (distance_m + b * cos).hypot(a * (1.0 - cos * cos).sqrt())
            }
        }
    }
}

const MM_PER_M: f64 = 1e3;
/// Allowed sizes of bodies in mm: from a nanometre to ten metres.
const SIZES_MM: [f64; 2] = [1e-6, 1e4];
/// Allowed densities in kg/m³, from thin gases to far above any metal.
const DENSITIES_KG_M3: [f64; 2] = [1e-3, 1e6];
/// Value of the key `measures` for an instrument that records stress and strain.
pub const STRESS_STRAIN: &str = "stress and strain";
/// Newtons for a stress of 1 Pa, and metres for a strain of 1, in a record of stress and strain.
pub(super) const OF_STRESS_STRAIN: [f64; 2] = [1e-6, 1e-4];

impl Apparatus {
    /// Marks an instrument as one that records stress and strain, and scales its compliance to their units. Other apparatus stays as it is.
    pub(super) fn with_stress_strain(self) -> Self {
        match self {
            Self::Instrument { compliance_per_m, .. } => {
                let [stress, strain] = OF_STRESS_STRAIN;
                Self::Instrument { compliance_per_m: compliance_per_m * strain / stress, is_stress_strain: true }
            }
            other => other,
        }
    }
}

/// Allowed compliances of instruments, in 1/m. The inverses are lengths from a femtometre to a thousand kilometres.
const COMPLIANCES_PER_M: [f64; 2] = [1e-6, 1e15];
/// Largest ratio of the vitreous's diameter to the robot's smallest size. Larger ratios only add elements with negligible displacements.
const LARGEST_RATIO: f64 = 1e4;

impl Apparatus {
    /// Reads the apparatus from `[robot]` and `[vitreous]`, from `[instrument]` or from `[indenter]`.
    pub(super) fn from_document(root: TomlTable<'_>) -> Result<Self> {
        if let Some(indenter) = root.table("indenter")? {
            if let Some(other) = ["robot", "vitreous", "instrument"].into_iter().find(|other| root.has(other)) {
                return Err(root.refuse(
                    other,
                    format!("both [indenter] and [{other}] are given"),
                    "keep only [indenter] for a tip that is pressed into a gel, or remove [indenter]",
                ));
            }
            return Ok(Self::Indenter(Indenter::from_table(indenter)?));
        }
        if let Some(instrument) = root.table("instrument")? {
            for other in ["robot", "vitreous"] {
                if root.has(other) {
                    return Err(root.refuse(
                        other,
                        format!("both [instrument] and [{other}] are given"),
                        "keep [robot] and [vitreous] for a body in the eye, or only [instrument] for another device",
                    ));
                }
            }
            instrument.only(&["compliance_per_m", "measures"])?;
            if instrument.is_unknown("compliance_per_m") {
                let remedy = format!(
                    "for a specimen between grips or plates run `init` again with `{}` and `{}`; for another device write its displacement (m) at a force of 1 N in a gel of E = 1 Pa",
                    Setting::SpecimenLength,
                    Setting::SpecimenArea
                );
                return Err(instrument.refuse("compliance_per_m", "this is not filled in yet", remedy));
            }
            let compliance_per_m =
                instrument.required_within("compliance_per_m", "compliance_per_m = 1.59e6", COMPLIANCES_PER_M)?;
            let is_stress_strain = match instrument.text("measures")?.as_deref() {
                None => false,
                Some(STRESS_STRAIN) => true,
                Some(other) => {
                    let remedy = format!("write \"{STRESS_STRAIN}\", or leave the key out for a force and a position");
                    return Err(instrument.refuse("measures", format!("unknown quantities `{other}`"), remedy));
                }
            };
            return Ok(Self::Instrument { compliance_per_m, is_stress_strain });
        }
        if !root.has("robot") && !root.has("vitreous") {
            return Err(root.refuse(
                "robot",
                "the apparatus is missing: there is no [robot], [instrument] or [indenter]",
                "add `[robot]` and `[vitreous]`, or `[indenter]` with `exponent = …` for a tip, or `[instrument]` with `compliance_per_m = …` for another device",
            ));
        }
        let (robot, vitreous) = Self::robot_in_gel(root, None)?;
        Ok(Self::Robot { robot, vitreous })
    }

    /// Reads `[robot]` and `[vitreous]`. `default` replaces a table that is absent.
    ///
    /// # Errors
    /// [`base::Error::Input`] if a table is missing or wrong, or if the robot does not fit into the gel.
    pub fn robot_in_gel(root: TomlTable<'_>, default: Option<(Robot, Vitreous)>) -> Result<(Robot, Vitreous)> {
        let table = |key: &str| if default.is_some() { root.table(key) } else { root.required_table(key).map(Some) };
        let (robot_table, vitreous_table) = (table("robot")?, table("vitreous")?);
        let robot = robot_table.map(robot_from).transpose()?.or(default.map(|(robot, _)| robot));
        let vitreous = vitreous_table.map(vitreous_from).transpose()?.or(default.map(|(_, vitreous)| vitreous));
        let (Some(robot), Some(vitreous)) = (robot, vitreous) else { return Err(root.missing("robot", "[robot]")) };
        let (robot_table, vitreous_table) = (robot_table.unwrap_or(root), vitreous_table.unwrap_or(root));
        let reach_m = robot.shape.outer_radius_m();
        let farthest_m = robot.farthest_point_m();
        if let Some(offset) =
            robot.offset.filter(|_| reach_m < vitreous.diameter_m / 2.0 && farthest_m >= vitreous.diameter_m / 2.0)
        {
            let to_mm = |metres: f64| metres * MM_PER_M;
            return Err(robot_table.refuse(
                "offset_mm",
                format!(
                    "the robot's centre is {:.4} mm from the vitreous's centre; the robot's surface reaches {:.4} mm from the vitreous's centre, but the vitreous's radius is {:.4} mm; the gap is {:.4} mm",
                    to_mm(offset.distance_m),
                    to_mm(farthest_m),
                    to_mm(vitreous.diameter_m / 2.0),
                    to_mm(vitreous.diameter_m / 2.0 - farthest_m)
                ),
                "reduce `offset_mm`, the distance of the two centres, until a gap remains between robot and outer surface",
            ));
        }
        if reach_m >= vitreous.diameter_m / 2.0 {
            return Err(vitreous_table.refuse(
                "diameter_mm",
                format!(
                    "the robot reaches {:.4} mm from its centre but the vitreous's radius is {:.4} mm: the robot does not fit inside",
                    reach_m * MM_PER_M,
                    vitreous.diameter_m / 2.0 * MM_PER_M
                ),
                "check `diameter_mm` in [vitreous] and the sizes in [robot]; all are full diameters or lengths in millimetres",
            ));
        }
        if vitreous.diameter_m > LARGEST_RATIO * robot.shape.smallest_size_m() {
            return Err(vitreous_table.refuse(
                "diameter_mm",
                format!("the vitreous is more than {LARGEST_RATIO} times as large as the robot's smallest size"),
                "check `diameter_mm` in [vitreous] and the sizes in [robot]; a gel a thousand times larger than the robot already acts like an infinite one",
            ));
        }
        Ok((robot, vitreous))
    }
}

fn robot_from(table: TomlTable<'_>) -> Result<Robot> {
    let shape_name = table.required_text("shape", "shape = \"sphere\"")?;
    let shape = match shape_name.as_str() {
        "sphere" => {
            table.only(&["shape", "diameter_mm", "density_kg_m3", "offset_mm", "offset_direction"])?;
            RobotShape::Sphere { diameter_m: size_m(table, "diameter_mm", "diameter_mm = 0.55")? }
        }
        "ellipsoid" | "cylinder" => {
            let sizes = ["shape", "length_mm", "diameter_mm", "orientation", "density_kg_m3"];
            table.only(&[&sizes[..], &["offset_mm", "offset_direction"]].concat())?;
            let length_m = size_m(table, "length_mm", "length_mm = 1.8")?;
            let diameter_m = size_m(table, "diameter_mm", "diameter_mm = 0.28")?;
            let orientation = orientation_from(table)?;
            if shape_name == "cylinder" {
                RobotShape::Cylinder { length_m, diameter_m, orientation }
            } else if length_m >= diameter_m {
                RobotShape::Ellipsoid { length_m, diameter_m, orientation }
            } else {
                return Err(table.refuse(
                    "length_mm",
                    "the ellipsoid's length is less than its diameter; it must be prolate",
                    "exchange `length_mm` (the long axis) and `diameter_mm` (the two short axes)",
                ));
            }
        }
        other => {
            return Err(table.refuse(
                "shape",
                format!("unknown shape `{other}`"),
                "use \"sphere\", \"ellipsoid\" or \"cylinder\"",
            ));
        }
    };
    let density_kg_m3 = density(table, "density_kg_m3 = 7500")?;
    let offset = offset_from(table)?;
    Ok(Robot { shape, density_kg_m3, offset })
}

/// Reads the robot's offset from the vitreous's centre; `None` if the offset is missing or 0.
fn offset_from(table: TomlTable<'_>) -> Result<Option<Offset>> {
    let distance_mm = table.number("offset_mm")?.unwrap_or(0.0);
    if !(distance_mm >= 0.0 && distance_mm.is_finite()) {
        return Err(table.refuse(
            "offset_mm",
            format!("{distance_mm} is not a distance"),
            "give the distance between the centres of robot and vitreous in millimetres, 0 or more; the side does not matter",
        ));
    }
    let direction = match table.text("offset_direction")?.as_deref() {
        None if distance_mm == 0.0 => return Ok(None),
        None => return Err(table.missing("offset_direction", "offset_direction = \"along\"")),
        Some("along") => OffsetDirection::Along,
        Some("across") => OffsetDirection::Across,
        Some(other) => {
            return Err(table.refuse(
                "offset_direction",
                format!("unknown direction `{other}`"),
                "use \"along\" (along the force) or \"across\" (across it)",
            ));
        }
    };
    Ok((distance_mm > 0.0).then_some(Offset { distance_m: distance_mm / MM_PER_M, direction }))
}

fn orientation_from(table: TomlTable<'_>) -> Result<Orientation> {
    match table.required_text("orientation", "orientation = \"horizontal\"")?.as_str() {
        "horizontal" => Ok(Orientation::Horizontal),
        "vertical" => Ok(Orientation::Vertical),
        other => Err(table.refuse(
            "orientation",
            format!("unknown orientation `{other}`"),
            "use \"horizontal\" (long axis along the force) or \"vertical\" (across it)",
        )),
    }
}

fn density(table: TomlTable<'_>, example: &str) -> Result<Option<f64>> {
    let key = "density_kg_m3";
    table.positive(key, example)?.map(|density| table.require_range(key, density, DENSITIES_KG_M3)).transpose()
}

fn vitreous_from(table: TomlTable<'_>) -> Result<Vitreous> {
    table.only(&["diameter_mm", "poisson_ratio", "density_kg_m3"])?;
    let diameter_m = size_m(table, "diameter_mm", "diameter_mm = 20.0")?;
    let poisson_ratio = table.required_number("poisson_ratio", "poisson_ratio = 0.48")?;
    if !(poisson_ratio > -1.0 && poisson_ratio < 0.5) {
        return Err(table.refuse(
            "poisson_ratio",
            format!("{poisson_ratio} lies outside (−1, 0.5)"),
            "give a Poisson ratio above −1 and below 0.5; 0.48 for vitreous, 0.499 for nearly incompressible",
        ));
    }
    let density_kg_m3 = density(table, "density_kg_m3 = 1000")?;
    Ok(Vitreous { diameter_m, poisson_ratio, density_kg_m3 })
}

fn size_m(table: TomlTable<'_>, key: &str, example: &str) -> Result<f64> {
    Ok(table.required_within(key, example, SIZES_MM)? / MM_PER_M)
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::toml_input::TomlInput;

    fn read(text: &str) -> Apparatus {
        let document = TomlInput::parse(std::path::Path::new("e.toml"), text).unwrap();
        Apparatus::from_document(document.root()).unwrap()
    }

    #[test]
    fn every_shape_is_read_in_si() {
        let vitreous = "[vitreous]\ndiameter_mm = 20\npoisson_ratio = 0.48\ndensity_kg_m3 = 1000\n";
        let robot = |lines: &str| match read(&format!("[robot]\ndensity_kg_m3 = 7500\n{lines}\n{vitreous}")) {
            Apparatus::Robot { robot, vitreous } => {
                assert_eq!(vitreous, Vitreous { diameter_m: 0.02, poisson_ratio: 0.48, density_kg_m3: Some(1000.0) });
                assert_eq!(robot.density_kg_m3, Some(7500.0));
                robot.shape
            }
            other => panic!("{other:?}"),
        };
        assert_eq!(robot("shape = \"sphere\"\ndiameter_mm = 0.55"), RobotShape::Sphere { diameter_m: 0.55e-3 });
        let sizes = "length_mm = 2\ndiameter_mm = 0.5\norientation = ";
        assert_eq!(
            robot(&format!("shape = \"ellipsoid\"\n{sizes}\"vertical\"")),
            RobotShape::Ellipsoid { length_m: 2e-3, diameter_m: 0.5e-3, orientation: Orientation::Vertical }
        );
        assert_eq!(
            robot(&format!("shape = \"cylinder\"\n{sizes}\"horizontal\"")),
            RobotShape::Cylinder { length_m: 2e-3, diameter_m: 0.5e-3, orientation: Orientation::Horizontal }
        );
    }

    const SPHERE: &str = "[robot]\nshape = \"sphere\"\ndiameter_mm = 0.5\ndensity_kg_m3 = 7500\n";
    const VITREOUS: &str = "[vitreous]\ndiameter_mm = 20\npoisson_ratio = 0.48\ndensity_kg_m3 = 1000\n";

    #[test]
    fn offsets_are_read_and_nothing_is_in_the_middle() {
        let offset = |lines: &str| match read(&format!("{SPHERE}{lines}\n{VITREOUS}")) {
            Apparatus::Robot { robot, .. } => robot.offset,
            other => panic!("{other:?}"),
        };
        for nothing in ["", "offset_mm = 0", "offset_mm = 0.0\noffset_direction = \"across\""] {
            assert_eq!(offset(nothing), None, "{nothing}");
        }
        for direction in [OffsetDirection::Along, OffsetDirection::Across] {
            let lines = format!("offset_mm = 2.5\noffset_direction = \"{}\"", direction.name());
            assert_eq!(offset(&lines), Some(Offset { distance_m: 2.5e-3, direction }));
        }
    }

    #[test]
    fn offsets_that_leave_no_room_or_direction_are_refused() {
        let refused = |robot: &str, words: &[&str]| {
            let text = format!("{robot}\n{VITREOUS}");
            let document = TomlInput::parse(std::path::Path::new("e.toml"), &text).unwrap();
            let message = Apparatus::from_document(document.root()).unwrap_err().to_string();
            assert!(words.iter().all(|word| message.contains(word)), "{message}");
        };
        let sphere = |lines: &str| format!("{SPHERE}{lines}");
        refused(&sphere("offset_mm = 2"), &["offset_direction"]);
        refused(&sphere("offset_mm = -2\noffset_direction = \"along\""), &["line 5", "-2", "0 or more"]);
        refused(&sphere("offset_mm = 2\noffset_direction = \"up\""), &["`up`", "along", "across"]);
        refused(
            &sphere("offset_mm = 9.8\noffset_direction = \"across\""),
            &["line 5", "9.8000 mm from", "reaches 10.0500 mm", "gap is -0.0500 mm"],
        );
    }

    /// Compares the farthest point of each robot with the largest distance of many points on its surface.
    #[test]
    fn the_farthest_point_is_the_farthest() {
        let (length_m, diameter_m) = (3.0_f64, 1.0_f64);
        for orientation in [Orientation::Horizontal, Orientation::Vertical] {
            let long = if orientation == Orientation::Horizontal { 0 } else { 1 };
            for direction in [OffsetDirection::Along, OffsetDirection::Across] {
                for distance_m in [0.1, 1.0, 4.0] {
                    let found = |shape| {
                        let offset = Some(Offset { distance_m, direction });
                        Robot { shape, density_kg_m3: None, offset }.farthest_point_m()
                    };
                    let (mut ellipsoid, mut cylinder) = (0.0_f64, 0.0_f64);
                    for (i, j) in (0..=400).flat_map(|i| (0..400).map(move |j| (i, j))) {
                        let (height, turn) = ((f64::from(i) * PI / 400.0).cos(), f64::from(j) * PI / 200.0);
                        let reach = |radius: f64, farthest: &mut f64| {
                            let mut place = [0.0; 3];
                            place[long] = 0.5 * length_m * height;
                            place[(long + 1) % 3] = 0.5 * diameter_m * radius * turn.cos();
                            place[(long + 2) % 3] = 0.5 * diameter_m * radius * turn.sin();
                            place[direction.axis()] += distance_m;
                            *farthest = farthest.max(place.iter().map(|x| x * x).sum::<f64>().sqrt());
                        };
                        reach((1.0 - height * height).sqrt(), &mut ellipsoid);
                        reach(1.0, &mut cylinder);
                    }
                    let exact = found(RobotShape::Ellipsoid { length_m, diameter_m, orientation });
                    assert!((exact / ellipsoid - 1.0).abs() < 1e-4, "{exact} {ellipsoid}");
                    let exact = found(RobotShape::Cylinder { length_m, diameter_m, orientation });
                    assert!((exact / cylinder - 1.0).abs() < 1e-4, "{exact} {cylinder}");
                }
            }
        }
    }

    #[test]
    fn another_instrument_needs_its_compliance_only() {
        assert_eq!(
            read("[instrument]\ncompliance_per_m = 1.59e6\n"),
            Apparatus::Instrument { compliance_per_m: 1.59e6, is_stress_strain: false }
        );
    }

    #[test]
    fn the_farthest_point_of_a_cylinder_is_its_corner() {
        let shape = RobotShape::Cylinder { length_m: 4.0, diameter_m: 3.0, orientation: Orientation::Vertical };
        assert_eq!(shape.outer_radius_m(), 2.5);
    }
}
