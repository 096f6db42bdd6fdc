//! Scenarios: a robot in a gel, the force on it, and the quantities of interest.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use base::error::{Error, InputPlace, Result};
use base::files::{self, Content};
use base::toml_input::{TomlInput, TomlTable, text_of};
use models::effects::Library;
use posterior::problem::Problem;
use record::{Apparatus, Orientation, Robot, RobotShape, Vitreous};

use crate::force_history::ForceHistory;
use crate::quantity::{Quantity, plain};

/// Longest scenario in s: ten days.
const LONGEST_S: f64 = 864_000.0;
/// Longest name of a scenario, in characters.
const LONGEST_NAME: usize = 100;
/// Largest number of scenarios of a file.
const MOST_SCENARIOS: usize = 100;

/// Robot in a gel under a force, with quantities of interest.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    /// Name in documents and figures.
    pub name: String,
    /// Place of its table in a file; without file and line for the study's own robot.
    place: InputPlace,
    /// The robot.
    pub robot: Robot,
    /// The gel around the robot.
    pub vitreous: Vitreous,
    /// Force on the robot; `None` if the file gives none, as for a plan.
    pub force: Option<ForceHistory>,
    /// Duration in s; `None` if the file gives none.
    pub duration_s: Option<f64>,
    /// Quantities of interest; empty for the position at the end.
    pub quantities: Vec<Quantity>,
    /// Tolerances of the apparatus.
    pub tolerances: Tolerances,
    /// Values of the parameters of effects that act here beside those of the gel's model, by name, in the parameters' units.
    pub effects: BTreeMap<String, f64>,
}

/// Uncertainty of the apparatus, as half-widths of uniform distributions.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Tolerances {
    /// Half-width of the robot's diameter, in m.
    pub diameter_m: f64,
    /// Half-width of the force's calibration, as a fraction of the force.
    pub force: f64,
}

impl Scenario {
    /// A robot in a gel, without a force, quantities or tolerances.
    pub fn of_robot(name: &str, robot: Robot, vitreous: Vitreous) -> Self {
        Self {
            name: name.into(),
            place: InputPlace::default(),
            robot,
            vitreous,
            force: None,
            duration_s: None,
            quantities: Vec::new(),
            tolerances: Tolerances::default(),
            effects: BTreeMap::new(),
        }
    }

    /// Place of an error about a key of the scenario.
    pub fn place(&self, key: &str) -> InputPlace {
        self.place.clone().at_key(format!("scenario {}: {key}", self.name))
    }

    /// Reads all scenarios of a file. `default` is the apparatus of the study, which a scenario may leave out, as it may leave out densities.
    ///
    /// # Errors
    /// [`Error::Input`] with line and key for anything that is missing, unknown or impossible.
    pub fn read(path: &Path, default: Option<(Robot, Vitreous)>) -> Result<Vec<Self>> {
        let bytes = files::read(path, Content::Settings, "check the path of the scenarios' file")?;
        let document = TomlInput::parse(path, text_of(path, &bytes)?)?;
        let root = document.root();
        root.only(&["scenario"])?;
        let folder = path.parent().unwrap_or(Path::new("."));
        let tables = root.tables("scenario", "[[scenario]]")?;
        if tables.is_empty() {
            return Err(root.refuse("scenario", "the list of scenarios is empty", "add a table `[[scenario]]`"));
        }
        let mut scenarios: Vec<Self> = Vec::new();
        for table in tables {
            let scenario = Self::from_table(table, folder, default)?;
            let of_table = match table.table("vary")? {
                Some(vary) => scenario.varied(vary)?,
                None => vec![scenario],
            };
            if let Some(twice) = of_table.iter().find(|one| scenarios.iter().any(|other| other.name == one.name)) {
                let found = format!("two scenarios have the name `{}`", twice.name);
                return Err(table.refuse("name", found, "give each scenario a different name"));
            }
            scenarios.extend(of_table);
        }
        if scenarios.len() > MOST_SCENARIOS {
            let found = format!("there are {} scenarios", scenarios.len());
            return Err(root.refuse("scenario", found, format!("give at most {MOST_SCENARIOS} in one file")));
        }
        Ok(scenarios)
    }

    fn from_table(table: TomlTable<'_>, folder: &Path, default: Option<(Robot, Vitreous)>) -> Result<Self> {
        table.only(&[
            "name",
            "robot",
            "vitreous",
            "force",
            "duration_s",
            "quantity",
            "tolerance",
            "effects",
            "vary",
        ])?;
        let name = table.required_text("name", "name = \"cylinder\"")?;
        if name.trim().is_empty() || name.contains(char::is_control) || name.chars().count() > LONGEST_NAME {
            let remedy = format!("give a name of 1 to {LONGEST_NAME} characters without control characters");
            return Err(table.refuse("name", "this name cannot be shown", remedy));
        }
        let (mut robot, mut vitreous) = Apparatus::robot_in_gel(table, default)?;
        if let Some((own_robot, own_vitreous)) = default {
            robot.density_kg_m3 = robot.density_kg_m3.or(own_robot.density_kg_m3);
            vitreous.density_kg_m3 = vitreous.density_kg_m3.or(own_vitreous.density_kg_m3);
        }
        let force = table.table("force")?.map(|force| ForceHistory::read(force, folder)).transpose()?;
        let example = "duration_s = 10";
        let duration_s =
            table.positive("duration_s", example)?.map(|s| table.require_range("duration_s", s, [1e-6, LONGEST_S]));
        let quantities = match table.has("quantity") {
            true => table.tables("quantity", "[[scenario.quantity]]")?,
            false => Vec::new(),
        };
        let quantities: Vec<Quantity> = quantities.into_iter().map(Quantity::read).collect::<Result<_>>()?;
        let duration_s = duration_s.transpose()?;
        if let (Some(duration_s), Some(at_s)) =
            (duration_s, latest_s(&quantities).filter(|at_s| Some(*at_s) > duration_s))
        {
            let found = format!("a quantity is taken at {at_s} s, but the scenario ends at {duration_s} s");
            return Err(table.refuse("duration_s", found, "give a longer duration or an earlier time"));
        }
        let tolerances = match table.table("tolerance")? {
            None => Tolerances::default(),
            Some(tolerance) => {
                tolerance.only(&["diameter_um", "force_percent"])?;
                let diameter_um = tolerance.positive("diameter_um", "diameter_um = 5")?.unwrap_or(0.0);
                let percent = tolerance.positive("force_percent", "force_percent = 3")?.unwrap_or(0.0);
                if 1e-6 * diameter_um > 0.2 * diameter_m(&robot) {
                    let found = format!("{diameter_um} µm is more than a fifth of the robot's diameter");
                    return Err(tolerance.refuse("diameter_um", found, "give the half-width of the diameter in µm"));
                }
                tolerance.require_range("force_percent", percent, [0.0, 50.0])?;
                Tolerances { diameter_m: 1e-6 * diameter_um, force: 0.01 * percent }
            }
        };
        let mut effects = BTreeMap::new();
        if let Some(of_table) = table.table("effects")? {
            for (parameter, inner, key) in parameters_in(of_table, &[])? {
                effects.insert(
                    parameter,
                    inner.required_number(&key, "interface-slip.slip_compliance_m_per_pa_s = 1e-3")?,
                );
            }
        }
        let place = table.place("name");
        Ok(Self { name, place, robot, vitreous, force, duration_s, quantities, tolerances, effects })
    }

    /// The scenario with every combination of the values of a table `[scenario.vary]`: aspect ratios, sizes, and parameters of effects.
    fn varied(&self, vary: TomlTable<'_>) -> Result<Vec<Self>> {
        let mut all = vec![self.clone()];
        for key in ["aspect", "size"] {
            if let Some(numbers) = vary.numbers(key)? {
                let change = |one: &Self, number: f64| one.reshaped(vary, key, number);
                all = combined(&all, (vary, key), &numbers, change)?;
            }
        }
        for (parameter, table, key) in parameters_in(vary, &["aspect", "size"])? {
            let numbers = table.numbers(&key)?.unwrap_or_default();
            let change = |one: &Self, number: f64| {
                let effects = one.effects.iter().map(|(name, value)| (name.clone(), *value));
                Ok(Self { effects: effects.chain([(parameter.clone(), number)]).collect(), ..one.clone() })
            };
            all = combined(&all, (table, &key), &numbers, change)?;
        }
        match all.iter().find(|one| one.robot.farthest_point_m() >= 0.5 * one.vitreous.diameter_m) {
            None => Ok(all),
            Some(one) => {
                let found = format!("the robot of `{}` does not fit inside the gel", one.name);
                Err(vary.refuse("size", found, "leave out this combination"))
            }
        }
    }

    /// The scenario with another aspect ratio at the same volume, or another size at the same aspect ratio.
    fn reshaped(&self, vary: TomlTable<'_>, key: &str, number: f64) -> Result<Self> {
        vary.require_range(key, number, [0.01, 100.0])?;
        let robot = match (key, aspect(&self.robot)) {
            ("aspect", None) => {
                let remedy = "give an ellipsoid or a cylinder, or vary `size` only";
                return Err(vary.refuse("aspect", "a sphere has no other aspect ratio", remedy));
            }
            ("aspect", Some(own)) => slenderer(&self.robot, number / own),
            _ => resized(&self.robot, number, number),
        };
        Ok(Self { robot, ..self.clone() })
    }

    /// Problem of the gel with the effects of this scenario, whose parameters have fixed values; `None` without such effects.
    ///
    /// # Errors
    /// [`Error::Input`] for an effect that the gel's model has already, that lacks a parameter, or that does not suit the gel's record.
    pub fn with_effects(&self, problem: &Problem) -> Result<Option<Problem>> {
        if self.effects.is_empty() {
            return Ok(None);
        }
        let refuse = |found: String, remedy: &str| Error::input(self.place("effects"), found, remedy);
        let slug_of = |name: &String| name.split('.').next().unwrap_or_default().to_string();
        let slugs: BTreeSet<String> = self.effects.keys().map(slug_of).collect();
        if let Some(own) = slugs.iter().find(|slug| problem.specification.effects.contains(slug)) {
            let found = format!("the gel's model has {own}, with its own parameters");
            return Err(refuse(found, "leave it out here, or predict from a revision without it"));
        }
        let slugs: Vec<String> = slugs.into_iter().collect();
        let values: Vec<String> = self.effects.iter().map(|(name, value)| format!("{name}={value}")).collect();
        let here = |error: Error| match error {
            Error::Input { found, remedy, .. } => refuse(found, &remedy),
            other => other,
        };
        let specification =
            problem.specification.clone().with_options(None, &slugs, &[], None, &values).map_err(here)?;
        let found = problem.with_model(specification, &Library::default()).map_err(here)?;
        let free = found.parameters().into_iter().find(|spec| {
            let is_of_scenario = slugs
                .iter()
                .any(|slug| spec.name.strip_prefix(slug.as_str()).is_some_and(|rest| rest.starts_with('.')));
            is_of_scenario && !found.specification.fixed.contains_key(spec.name)
        });
        match free {
            None => Ok(Some(found)),
            Some(spec) => Err(refuse(
                format!("`{}` has no value", spec.name),
                "give all parameters of the effect (`vitreo-uq effects`)",
            )),
        }
    }

    /// Force and duration (s) of a prediction. The default duration is the later one of the last change of the force and the last quantity.
    ///
    /// # Errors
    /// [`Error::Input`] if the scenario has no force, or if nothing determines its duration.
    pub fn force_and_duration(&self) -> Result<(&ForceHistory, f64)> {
        let refuse = |key: &str, found: &str, remedy: &str| Err(Error::input(self.place(key), found, remedy));
        let Some(force) = &self.force else {
            let remedy =
                "add a force, as in `force = { steps_un = [[0, 20], [5, 0]] }`, or give a table with `--force`";
            return refuse("force", "the scenario has no force", remedy);
        };
        if force.last_change_s() > LONGEST_S {
            return refuse("force", "the force changes after more than ten days", "give times in seconds");
        }
        let latest = latest_s(&self.quantities).unwrap_or(0.0).max(force.last_change_s());
        match self.duration_s {
            Some(duration_s) => Ok((force, duration_s)),
            None if latest > 0.0 => Ok((force, latest)),
            None => refuse("duration_s", "nothing gives the scenario's duration", "add `duration_s = 10`"),
        }
    }

    /// Robot and gel in words, with their sizes.
    pub fn apparatus(&self) -> String {
        let mm = |metres: f64| plain(1e3 * metres);
        let turned = |orientation| match orientation {
            Orientation::Horizontal => "along the force",
            Orientation::Vertical => "across the force",
        };
        let robot = match self.robot.shape {
            RobotShape::Sphere { diameter_m } => format!("sphere of {} mm", mm(diameter_m)),
            RobotShape::Ellipsoid { length_m, diameter_m, orientation } => {
                format!("ellipsoid of {} mm × {} mm, {}", mm(length_m), mm(diameter_m), turned(orientation))
            }
            RobotShape::Cylinder { length_m, diameter_m, orientation } => {
                format!("cylinder of {} mm × {} mm, {}", mm(length_m), mm(diameter_m), turned(orientation))
            }
        };
        let place = self.robot.offset.map_or(String::new(), |offset| {
            format!(", {} mm off the centre {} the force", mm(offset.distance_m), offset.direction.name())
        });
        let Vitreous { diameter_m, poisson_ratio, .. } = self.vitreous;
        let effects: String = self.effects.iter().map(|(name, value)| format!("; {name} = {value}")).collect();
        format!("{robot}{place}; gel of {} mm, Poisson ratio {poisson_ratio}{effects}", mm(diameter_m))
    }
}

/// The parameters of effects in a table, each with the table and the key of its value. Names have the slug of the effect before a point, which also separates nested tables.
fn parameters_in<'a>(table: TomlTable<'a>, others: &[&str]) -> Result<Vec<(String, TomlTable<'a>, String)>> {
    let mut found = Vec::new();
    for key in table.keys_in_order() {
        if others.contains(&key) {
            continue;
        }
        if key.contains('.') {
            found.push((key.to_string(), table, key.to_string()));
            continue;
        }
        if table.is_number(key) || table.numbers(key).is_ok_and(|numbers| numbers.is_some()) {
            let others = others.iter().map(|other| format!("`{other}`, ")).collect::<String>();
            let remedy =
                format!("give {others}a parameter of an effect, such as `interface-slip.slip_compliance_m_per_pa_s`");
            return Err(table.refuse(key, format!("unknown key `{key}`"), remedy));
        }
        let inner = table.required_table(key)?;
        found.extend(inner.keys_in_order().into_iter().map(|name| (format!("{key}.{name}"), inner, name.to_string())));
    }
    Ok(found)
}

/// Every scenario with every value of one quantity. `at` is the table and the key of the values.
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

/// Diameter of a robot, in m.
pub fn diameter_m(robot: &Robot) -> f64 {
    match robot.shape {
        RobotShape::Sphere { diameter_m }
        | RobotShape::Ellipsoid { diameter_m, .. }
        | RobotShape::Cylinder { diameter_m, .. } => diameter_m,
    }
}

/// Length over diameter of a robot; `None` for a sphere.
pub fn aspect(robot: &Robot) -> Option<f64> {
    match robot.shape {
        RobotShape::Sphere { .. } => None,
        RobotShape::Ellipsoid { length_m, diameter_m, .. } | RobotShape::Cylinder { length_m, diameter_m, .. } => {
            Some(length_m / diameter_m)
        }
    }
}

/// The robot with its ratio of length to diameter multiplied by a factor, at the same volume.
pub fn slenderer(robot: &Robot, factor: f64) -> Robot {
    resized(robot, factor.powf(2.0 / 3.0), factor.powf(-1.0 / 3.0))
}

/// The same robot with its length and its diameter multiplied by factors. A sphere takes the factor of the diameter.
pub fn resized(robot: &Robot, length_factor: f64, diameter_factor: f64) -> Robot {
    let shape = match robot.shape {
        RobotShape::Sphere { diameter_m } => RobotShape::Sphere { diameter_m: diameter_factor * diameter_m },
        RobotShape::Ellipsoid { length_m, diameter_m, orientation } => RobotShape::Ellipsoid {
            length_m: length_factor * length_m,
            diameter_m: diameter_factor * diameter_m,
            orientation,
        },
        RobotShape::Cylinder { length_m, diameter_m, orientation } => RobotShape::Cylinder {
            length_m: length_factor * length_m,
            diameter_m: diameter_factor * diameter_m,
            orientation,
        },
    };
    Robot { shape, ..*robot }
}

/// Latest time (s) at which a quantity is taken; `None` if no quantity has a time.
fn latest_s(quantities: &[Quantity]) -> Option<f64> {
    quantities.iter().flat_map(Quantity::times_s).reduce(f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<Scenario>> {
        let dir = tempfile::tempdir().expect("a directory");
        let path = dir.path().join("scenarios.toml");
        std::fs::write(&path, text).expect("a file");
        let vitreous = Vitreous { diameter_m: 0.02, poisson_ratio: 0.48, density_kg_m3: None };
        let shape = RobotShape::Sphere { diameter_m: 0.55e-3 };
        Scenario::read(&path, Some((Robot { shape, density_kg_m3: Some(7500.0), offset: None }, vitreous)))
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
}
