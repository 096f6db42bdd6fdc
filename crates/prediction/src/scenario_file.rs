//! Files of scenarios, with every combination of the values in a table `[scenario.vary]`.

use std::path::Path;

use base::error::Result;
use base::files::{self, Content};
use base::toml_input::{TomlInput, TomlTable, text_of};
use documents::shapes::{BodyShape, SizeRule};
use record::{Orientation, Robot, RobotShape, Vitreous};

use crate::body::of_equal_size;
use crate::scenario::{Scenario, aspect, parameters_in, resized};

/// Largest number of scenarios of a file.
const MOST_SCENARIOS: usize = 100;
/// Keys of the table that are no parameters of effects.
const KEYS: [&str; 5] = ["shape", "orientation", "size_rule", "aspect", "size"];

/// Reads all scenarios of a file. `default` is the apparatus of the study, which a scenario may leave out, as it may leave out densities.
///
/// # Errors
/// [`base::Error::Input`] with line and key for anything that is missing, unknown or impossible.
pub fn read_scenarios(path: &Path, default: Option<(Robot, Vitreous)>) -> Result<Vec<Scenario>> {
    let bytes = files::read(path, Content::Settings, "check the path of the scenarios' file")?;
    let document = TomlInput::parse(path, text_of(path, &bytes)?)?;
    let root = document.root();
    root.only(&["scenario"])?;
    let folder = path.parent().unwrap_or(Path::new("."));
    let tables = root.tables("scenario", "[[scenario]]")?;
    if tables.is_empty() {
        return Err(root.refuse("scenario", "the list of scenarios is empty", "add a table `[[scenario]]`"));
    }
    let mut scenarios: Vec<Scenario> = Vec::new();
    for table in tables {
        let scenario = Scenario::from_table(table, folder, default)?;
        let of_table = match table.table("vary")? {
            Some(vary) => varied(&scenario, vary)?,
            None => vec![scenario],
        };
        for one in of_table {
            if scenarios.iter().any(|other| other.name == one.name) {
                let found = format!("two scenarios have the name `{}`", one.name);
                return Err(table.refuse(
                    "name",
                    found,
                    "give each scenario a different name, and each value of `vary` once",
                ));
            }
            scenarios.push(one);
        }
    }
    if scenarios.len() > MOST_SCENARIOS {
        let found = format!("there are {} scenarios", scenarios.len());
        return Err(root.refuse("scenario", found, format!("give at most {MOST_SCENARIOS} in one file")));
    }
    Ok(scenarios)
}

/// The scenario with every combination of shapes, orientations, aspect ratios, sizes, and parameters of effects. Another shape or aspect ratio keeps the robot's volume or
/// surface.
fn varied(scenario: &Scenario, vary: TomlTable<'_>) -> Result<Vec<Scenario>> {
    let rule = match vary.text("size_rule")?.as_deref() {
        None | Some("equal_volume") => SizeRule::EqualVolume,
        Some("equal_surface") => SizeRule::EqualSurface,
        Some(other) => {
            let found = format!("`{other}` is no rule for the size");
            return Err(vary.refuse("size_rule", found, "give \"equal_volume\" or \"equal_surface\""));
        }
    };
    let aspects = vary.numbers("aspect")?;
    if vary.has("size_rule") && aspects.is_none() && !vary.has("shape") {
        let found = "neither shapes nor aspect ratios vary, so that there is no size to keep";
        return Err(vary.refuse("size_rule", found, "leave it out, or add `shape` or `aspect`"));
    }
    for number in aspects.iter().flatten() {
        vary.require_range("aspect", *number, [0.01, 100.0])?;
    }
    let mut all = of_shapes(scenario, vary, aspects.as_ref().and_then(|list| list.first().copied()), rule)?;
    if let Some(numbers) = aspects {
        // A sphere among other shapes has no other aspect ratio.
        let (spheres, others): (Vec<_>, Vec<_>) = all.into_iter().partition(|one| aspect(&one.robot).is_none());
        if others.is_empty() {
            let remedy = "give an ellipsoid or a cylinder, name other shapes in `shape`, or vary `size` only";
            return Err(vary.refuse("aspect", "a sphere has no other aspect ratio", remedy));
        }
        let change = |one: &Scenario, number: f64| {
            let shape = of_equal_size(form(&one.robot.shape), number, rule, &one.robot.shape);
            let robot = Robot { shape, ..one.robot };
            Ok(Scenario { robot, ..one.clone() })
        };
        all = [spheres, combined(&others, (vary, "aspect"), &numbers, change)?].concat();
    }
    if let Some(numbers) = vary.numbers("size")? {
        let change = |one: &Scenario, number: f64| {
            vary.require_range("size", number, [0.01, 100.0])?;
            Ok(Scenario { robot: resized(&one.robot, number, number), ..one.clone() })
        };
        all = combined(&all, (vary, "size"), &numbers, change)?;
    }
    for (parameter, table, key) in parameters_in(vary, &KEYS)? {
        let numbers = table.numbers(&key)?.unwrap_or_default();
        let change = |one: &Scenario, number: f64| {
            let effects = one.effects.iter().map(|(name, value)| (name.clone(), *value));
            Ok(Scenario { effects: effects.chain([(parameter.clone(), number)]).collect(), ..one.clone() })
        };
        all = combined(&all, (table, &key), &numbers, change)?;
    }
    match all.iter().find(|one| one.robot.farthest_point_m() >= 0.5 * one.vitreous.diameter_m) {
        None => {
            all.iter().try_for_each(Scenario::refuse_wide_tolerances)?;
            Ok(all)
        }
        Some(one) => {
            let found = format!("the robot of `{}` does not fit inside the gel", one.name);
            Err(vary.refuse("size", found, "leave out this combination"))
        }
    }
}

/// The scenario with every named shape in every named orientation; a sphere has no orientation. `first_aspect` is the aspect ratio of a robot that has none.
fn of_shapes(
    scenario: &Scenario,
    vary: TomlTable<'_>,
    first_aspect: Option<f64>,
    rule: SizeRule,
) -> Result<Vec<Scenario>> {
    let (own_shape, own_orientation) = form(&scenario.robot.shape);
    let shape_of = |text: &String| match text.as_str() {
        "sphere" => Ok(BodyShape::Sphere),
        "ellipsoid" => Ok(BodyShape::Ellipsoid),
        "cylinder" => Ok(BodyShape::Cylinder),
        other => Err(vary.refuse(
            "shape",
            format!("unknown shape `{other}`"),
            "give \"sphere\", \"ellipsoid\" or \"cylinder\"",
        )),
    };
    let orientation_of = |text: &String| match text.as_str() {
        "horizontal" => Ok(Orientation::Horizontal),
        "vertical" => Ok(Orientation::Vertical),
        other => Err(vary.refuse(
            "orientation",
            format!("unknown orientation `{other}`"),
            "give \"horizontal\" (along the force) or \"vertical\"",
        )),
    };
    let [shapes, orientations] = ["shape", "orientation"].map(|key| vary.texts(key));
    let (shapes, orientations) = (shapes?, orientations?);
    if shapes.is_none() && orientations.is_none() {
        return Ok(vec![scenario.clone()]);
    }
    for (key, list) in [("shape", &shapes), ("orientation", &orientations)] {
        if list.as_ref().is_some_and(Vec::is_empty) {
            return Err(vary.refuse(key, "the list is empty", "give at least one value, or leave the key out"));
        }
    }
    let shapes: Vec<BodyShape> =
        shapes.map_or(Ok(vec![own_shape]), |texts| texts.iter().map(shape_of).collect::<Result<_>>())?;
    let orientations: Vec<Orientation> = orientations
        .map_or(Ok(vec![own_orientation]), |texts| texts.iter().map(orientation_of).collect::<Result<_>>())?;
    if vary.has("orientation") && shapes.iter().all(|shape| *shape == BodyShape::Sphere) {
        let remedy = "leave it out, or name other shapes in `shape`";
        return Err(vary.refuse("orientation", "a sphere has no orientation", remedy));
    }
    let mut all = Vec::new();
    for shape in shapes {
        if shape == BodyShape::Sphere {
            let sphere = of_equal_size((shape, Orientation::Horizontal), 1.0, rule, &scenario.robot.shape);
            all.push(named(scenario, shape.name(), sphere));
            continue;
        }
        let Some(aspect) = aspect(&scenario.robot).or(first_aspect) else {
            let found = format!("a sphere gives no ratio of length to diameter for the shape `{}`", shape.name());
            return Err(vary.refuse("shape", found, "add `aspect = [9.714]`"));
        };
        for orientation in &orientations {
            let way = if *orientation == Orientation::Horizontal { "horizontal" } else { "vertical" };
            let of_shape = of_equal_size((shape, *orientation), aspect, rule, &scenario.robot.shape);
            all.push(named(scenario, &format!("{} {way}", shape.name()), of_shape));
        }
    }
    Ok(all)
}

fn named(scenario: &Scenario, what: &str, shape: RobotShape) -> Scenario {
    let robot = Robot { shape, ..scenario.robot };
    Scenario { name: format!("{}, {what}", scenario.name), robot, ..scenario.clone() }
}

/// Shape and orientation without the sizes; a sphere counts as horizontal.
pub(crate) fn form(shape: &RobotShape) -> (BodyShape, Orientation) {
    match *shape {
        RobotShape::Sphere { .. } => (BodyShape::Sphere, Orientation::Horizontal),
        RobotShape::Ellipsoid { orientation, .. } => (BodyShape::Ellipsoid, orientation),
        RobotShape::Cylinder { orientation, .. } => (BodyShape::Cylinder, orientation),
    }
}

/// Every scenario with every value of one quantity, at a key of a table.
fn combined(
    all: &[Scenario],
    (table, key): (TomlTable<'_>, &str),
    numbers: &[f64],
    change: impl Fn(&Scenario, f64) -> Result<Scenario>,
) -> Result<Vec<Scenario>> {
    if numbers.is_empty() {
        return Err(table.refuse(key, "the list is empty", format!("give numbers, as in `{key} = [0.5, 1, 2]`")));
    }
    if all.len() * numbers.len() > MOST_SCENARIOS {
        let found = format!("there are {} combinations", all.len() * numbers.len());
        return Err(table.refuse(key, found, format!("give at most {MOST_SCENARIOS} in one file")));
    }
    let changed = |(one, number): (&Scenario, &f64)| {
        let new = change(one, *number)?;
        Ok(Scenario { name: format!("{}, {key} {number}", new.name), ..new })
    };
    all.iter().flat_map(|one| numbers.iter().map(move |number| (one, number))).map(changed).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::body_and_direction;

    fn read(text: &str) -> Result<Vec<Scenario>> {
        let dir = tempfile::tempdir().expect("a directory");
        let path = dir.path().join("scenarios.toml");
        std::fs::write(&path, text).expect("a file");
        let vitreous = Vitreous { diameter_m: 0.02, poisson_ratio: 0.48, density_kg_m3: None };
        let shape = RobotShape::Sphere { diameter_m: 0.55e-3 };
        read_scenarios(&path, Some((Robot { shape, density_kg_m3: Some(7500.0), offset: None }, vitreous)))
    }

    const CYLINDER: &str = "[[scenario]]\nname = \"cylinder\"\nforce = { steps_un = [[0, 20], [5, 0]] }\n[scenario.robot]\nshape = \"cylinder\"\nlength_mm = 2.04\ndiameter_mm = 0.21\norientation = \"horizontal\"\n[[scenario.quantity]]\nkind = \"position_at\"\nat_s = 7\n";

    #[test]
    fn what_a_scenario_leaves_out_is_the_study_s() {
        let found = &read(CYLINDER).expect("scenarios")[0];
        assert_eq!(found.vitreous.diameter_m, 0.02);
        assert_eq!(found.robot.density_kg_m3, Some(7500.0));
        assert_eq!(found.force_and_duration().expect("a force").1, 7.0);
        assert!(
            found.apparatus().starts_with("cylinder of 2.04 mm × 0.21 mm, along the force"),
            "{}",
            found.apparatus()
        );
    }

    #[test]
    fn impossible_scenarios_are_refused_with_line_and_key() {
        let refusal = |text: &str| read(text).expect_err("a refusal").to_string();
        let too_large = CYLINDER.replace("length_mm = 2.04", "length_mm = 30");
        assert!(refusal(&too_large).contains("does not fit inside"));
        let twice = format!("{CYLINDER}{CYLINDER}");
        assert!(refusal(&twice).contains("two scenarios"));
        let early = CYLINDER.replace("name =", "duration_s = 6\nname =");
        assert!(refusal(&early).contains("ends at 6 s"));
        let vary = |line: &str| format!("{CYLINDER}[scenario.vary]\n{line}\n");
        assert!(refusal(&vary("size = [1, 20]")).contains("`cylinder, size 20` does not fit"));
        assert!(refusal(&vary("aspect = []")).contains("empty"));
        let force = "force = { steps_un = [[0, 20], [5, 0]] }\n";
        let forceless = read(&CYLINDER.replace(force, "")).expect("a scenario")[0].force_and_duration().unwrap_err();
        assert!(forceless.to_string().contains("scenarios.toml, line 2, `scenario cylinder: force`"), "{forceless}");
        assert!(refusal(&CYLINDER.replace("\"cylinder\"\nforce", "\"\\u001b[2J\"\nforce")).contains("cannot be shown"));
        assert!(refusal("[[scenarios]]\n").contains("`scenario`"));
        assert!(refusal("scenario = []\n").contains("empty"));
        assert!(refusal(&CYLINDER.replace("position_at", "speeed")).contains("line 10"));
    }

    /// Aspect ratios keep the volume, and sizes the aspect ratio.
    #[test]
    fn robots_are_varied_in_aspect_ratio_and_size() {
        let found = read(&format!("{CYLINDER}[scenario.vary]\naspect = [2, 5]\nsize = [1, 3]\n")).expect("scenarios");
        let names: Vec<&str> = found.iter().map(|scenario| scenario.name.as_str()).collect();
        assert_eq!(
            names,
            [
                "cylinder, aspect 2, size 1",
                "cylinder, aspect 2, size 3",
                "cylinder, aspect 5, size 1",
                "cylinder, aspect 5, size 3"
            ]
        );
        let volume_m3 = 0.25 * std::f64::consts::PI * 0.21e-3_f64.powi(2) * 2.04e-3;
        for (scenario, [aspect, size]) in found.iter().zip([[2.0, 1.0], [2.0, 3.0], [5.0, 1.0], [5.0, 3.0_f64]]) {
            let RobotShape::Cylinder { length_m, diameter_m, .. } = scenario.robot.shape else { panic!("no cylinder") };
            assert!((length_m / diameter_m / aspect - 1.0).abs() < 1e-12, "{}", scenario.name);
            let expected_m3 = volume_m3 * size.powi(3);
            assert!((scenario.robot.shape.volume_m3() / expected_m3 - 1.0).abs() < 1e-12, "{}", scenario.name);
        }
    }

    /// The shapes of the paper's Figs. 7 and 8: surfaces of 1 : 1.684 : 1.712 at equal volume (physics §4.4), and equal surfaces.
    #[test]
    fn shapes_keep_the_volume_or_the_surface() {
        let sphere = "[[scenario]]\nname = \"bead\"\n[scenario.vary]\n";
        let shapes = "shape = [\"sphere\", \"ellipsoid\", \"cylinder\"]\n";
        let rest = "orientation = [\"horizontal\", \"vertical\"]\naspect = [9.714285714285714]\n";
        let found = |rule: &str| read(&format!("{sphere}{shapes}{rest}{rule}")).expect("scenarios");
        let area_m2 = |one: &Scenario| body_and_direction(&one.robot.shape).0.surface_area_m2();
        let by_volume = found("");
        let names: Vec<&str> = by_volume.iter().map(|one| one.name.as_str()).collect();
        assert_eq!(names[0], "bead, sphere");
        assert_eq!(names[2], "bead, ellipsoid vertical, aspect 9.714285714285714");
        let ratio = |one: &Scenario| area_m2(one) / area_m2(&by_volume[0]);
        let expected = [1.0, 1.684, 1.684, 1.712, 1.712];
        assert_eq!(by_volume.len(), expected.len());
        assert!(by_volume.iter().zip(expected).all(|(one, area)| (ratio(one) - area).abs() < 1e-3), "{by_volume:?}");
        let by_surface = found("size_rule = \"equal_surface\"\n");
        assert!(by_surface.iter().all(|one| (ratio(one) - 1.0).abs() < 1e-12), "{by_surface:?}");
        let refusal = |text: &str| read(&format!("{sphere}{text}")).expect_err("a refusal").to_string();
        assert!(refusal(shapes).contains("for the shape `ellipsoid`"));
        assert!(refusal("shape = [\"sphere\", \"sphere\"]\n").contains("two scenarios"));
        assert!(refusal("shape = [\"sphere\"]\norientation = []\n").contains("the list is empty"));
        assert!(refusal("orientation = [\"vertical\"]\n").contains("a sphere has no orientation"));
        assert!(refusal("size = [1]\nsize_rule = \"equal_surface\"\n").contains("neither shapes nor aspect"));
        assert!(refusal("shape = [\"cube\"]\n").contains("unknown shape `cube`"));
        assert!(refusal("orientation = [\"up\"]\n").contains("unknown orientation `up`"));
        assert!(refusal("size_rule = \"equal\"\n").contains("`equal` is no rule"));
        assert!(refusal("shape = []\n").contains("the list is empty"));
        assert!(refusal("aspect = [2]\n").contains("a sphere has no other aspect ratio"));
    }
}
