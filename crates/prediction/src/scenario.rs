//! Scenarios: a robot in a gel, the force on it, and the quantities of interest.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use base::error::{Error, InputPlace, Result};
use base::toml_input::TomlTable;
use models::effects::Library;
use posterior::problem::Problem;
use record::{Apparatus, Orientation, Robot, RobotShape, Vitreous};

use crate::force_history::ForceHistory;
use crate::quantity::{Quantity, plain};

/// Longest scenario in s: ten days.
const LONGEST_S: f64 = 864_000.0;
/// Longest name of a scenario, in characters.
const LONGEST_NAME: usize = 100;

/// Robot in a gel under a force, with quantities of interest.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    /// Name in documents and figures.
    pub name: String,
    /// Place of its table in a file; without file and line for the study's own robot.
    pub(crate) place: InputPlace,
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
    /// Half-width of the robot's place in m, along its offset; along the force for a robot in the centre.
    pub offset_m: f64,
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

    /// Error about the robot's mesh, with the scenario as its place.
    pub fn refusal_of_robot(&self, error: Error) -> Error {
        match error {
            Error::Input { found, .. } => {
                Error::input(self.place("robot"), found, "change the sizes or the offset of the scenario's robot")
            }
            other => other,
        }
    }

    /// Reads the table of one scenario. `default` is the apparatus of the study, which a scenario may leave out, as it may leave out densities.
    ///
    /// # Errors
    /// [`Error::Input`] with line and key for anything that is missing, unknown or impossible.
    pub(crate) fn from_table(table: TomlTable<'_>, folder: &Path, default: Option<(Robot, Vitreous)>) -> Result<Self> {
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
                tolerance.only(&["diameter_um", "offset_um", "force_percent"])?;
                let diameter_um = tolerance.positive("diameter_um", "diameter_um = 5")?.unwrap_or(0.0);
                let offset_um = tolerance.positive("offset_um", "offset_um = 200")?.unwrap_or(0.0);
                let percent = tolerance.positive("force_percent", "force_percent = 3")?.unwrap_or(0.0);
                tolerance.require_range("force_percent", percent, [0.0, 50.0])?;
                Tolerances { diameter_m: 1e-6 * diameter_um, offset_m: 1e-6 * offset_um, force: 0.01 * percent }
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
        let found = Self { name, place, robot, vitreous, force, duration_s, quantities, tolerances, effects };
        found.refuse_wide_tolerances()?;
        Ok(found)
    }

    /// Refuses tolerances that are not small beside the robot, or that let it leave the gel.
    pub(crate) fn refuse_wide_tolerances(&self) -> Result<()> {
        let Tolerances { diameter_m: half_width_m, offset_m, .. } = self.tolerances;
        let refuse = |key: &str, found: String| {
            Err(Error::input(self.place(&format!("tolerance.{key}")), found, "give a smaller half-width in µm"))
        };
        if half_width_m > 0.2 * diameter_m(&self.robot) {
            let found = format!("{} µm is more than a fifth of the robot's diameter", plain(1e6 * half_width_m));
            return refuse("diameter_um", found);
        }
        if offset_m > 0.0 && self.robot.farthest_point_m() + offset_m >= 0.5 * self.vitreous.diameter_m {
            return refuse("offset_um", format!("{} µm lets the robot leave the gel", plain(1e6 * offset_m)));
        }
        Ok(())
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
pub(crate) fn parameters_in<'a>(table: TomlTable<'a>, others: &[&str]) -> Result<Vec<(String, TomlTable<'a>, String)>> {
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
