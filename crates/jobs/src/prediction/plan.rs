//! `plan`: the force that brings a robot to a target with a given probability.

use std::path::PathBuf;

use base::error::{Error, InputPlace, Result, Setting};
use base::files::{remove_if_there, to_json, write_together};
use documents::posterior::{Warning, WarningKind};
use documents::prediction::{EquivalentPlan, ForceStep, Plan, PlannedRobot, ScenarioPrediction};
use figures::number::format_significant;
use figures::svg::{figure_files, remove_figure};
use posterior::monitor::Monitor;
use posterior::study::WithProvenance;
use prediction::ensemble::{Ensemble, Gel};
use prediction::free_path::free_path_m;
use prediction::plan::{PlannedForce, RobotComparison, Target, plan};
use prediction::quantity::{Quantity, percent, plain};
use prediction::robot_size::{self, RobotSize};
use prediction::scenario::{Scenario, aspect, diameter_m};
use record::Control;
use sampling::SamplerOptions;

use super::gel_source::{GelPlace, GelSource};
use super::predict::{digits, predicted, table};
use super::rivals::Rival;
use crate::outcome::Outcome;

/// Name of the file for the controller.
const PROTOCOL_NAME: &str = "plan-protocol.csv";

/// Relative difference of volumes or forces that counts as none.
const ROUNDING: f64 = 1e-9;
/// Name of the figure of compared robots.
const ROBOTS_NAME: &str = "plan-robots";

/// Settings of a plan.
pub struct PlanRequest {
    /// File whose scenarios name robots and gels; `None` for the study's own.
    pub scenario: Option<PathBuf>,
    /// Target and limits. A largest force of 0 stands for that of the study's record.
    pub target: Target,
    /// Size of the robot that is searched; `None` for the sizes of the scenarios.
    pub size: Option<RobotSize>,
    /// Magnetic moment of the robot in A·m²; `None` for no field gradient in the protocol.
    pub moment_a_m2: Option<f64>,
    /// Sampler settings for a first revision.
    pub sampler: SamplerOptions,
}

/// Plans a force, and writes the plan and the controller's file beside the source of the gel.
///
/// # Errors
/// [`Error::Input`] for a target without limits; errors of models and files.
pub fn run(place: &GelPlace<'_>, request: &PlanRequest, monitor: &dyn Monitor) -> Result<Outcome<Plan>> {
    let mut target = request.target;
    let mut scenarios = place.scenarios(request.scenario.as_deref())?;
    refuse_outside(&scenarios, &target, request.size)?;
    if target.largest_force_n == 0.0 && !matches!(request.size, Some(RobotSize::SmallestMagnet { .. })) {
        let GelPlace::Study(study) = place else { return Err(without_force()) };
        if study.experiment.control == Control::Position {
            return Err(without_force());
        }
        target.largest_force_n = study.experiment.scales().largest_force_n;
    }
    for scenario in &mut scenarios {
        scenario.quantities = match target.rest {
            None => vec![Quantity::TimeToReach { distance_m: target.reach_m, within_s: Some(target.within_s) }],
            Some(_) => [target.within_s, target.duration_s()]
                .map(|at_s| Quantity::PositionAt { at_s, at_least_m: None })
                .to_vec(),
        };
        scenario.quantities.extend(target.largest_strain.map(|_| Quantity::PeakStrain));
    }
    let source = place.open(&scenarios[0], &request.sampler, monitor)?;
    let gel = source.gel();
    let Chosen { scenario, target, robots, is_last_tried } =
        chosen_robot(&source, scenarios, &target, request.size, monitor)?;
    let planned = plan(&gel, &scenario, &target, source.kept.clone(), monitor)?;
    let tube = predicted(&gel, &planned.ensemble, &scenario, monitor)?;
    let equivalent = equivalent(&source, &scenario, &target, &planned, monitor)?;
    let mut warnings = source.warnings.clone();
    if let GelPlace::Study(study) = place
        && study.experiment.control == Control::Force
    {
        warnings.extend(against_record(&study.experiment.record.force_n, &planned.steps));
    }
    warnings.extend(equivalent.iter().filter(|other| other.probability < target.probability).map(|other| Warning {
        kind: WarningKind::ModelIncomplete,
        text: format!(
            "with {}, which the record cannot distinguish from the model's own effect, this force succeeds with {} % probability",
            other.effect,
            percent(other.probability)
        ),
        advice: "record the experiment that tells the effects apart (`vitreo-uq design`), or plan for a higher probability".into(),
    }));
    let checked = planned.checked;
    let found = Plan {
        gel: gel.draws.source.clone(),
        apparatus: scenario.apparatus(),
        reach_mm: 1e3 * target.reach_m,
        within_s: target.within_s,
        probability: target.probability,
        feasible: planned.is_feasible,
        probability_promised: planned.promised,
        probability_checked: checked,
        probability_checked_se: (checked * (1.0 - checked) / planned.full_runs.max(1) as f64).sqrt(),
        full_runs: planned.full_runs,
        limit: planned.limit.into(),
        sentence: sentence(&planned, &target, request.size, &robots)
            + if is_last_tried {
                " It is the last size that was tried: another beyond it may succeed, too."
            } else {
                ""
            }
            + &overshoot_sentence(&target, &tube),
        robots,
        force: planned.steps,
        tube,
        protocol_file: match planned.is_feasible {
            true => source.dir.join(PROTOCOL_NAME).display().to_string(),
            false => String::new(),
        },
        equivalent,
        warnings,
    };
    monitor.stage("writing results and figures");
    let figure = figures::prediction::prediction(
        "Planned force and expected position",
        &found.sentence,
        std::slice::from_ref(&found.tube),
        Some(1e6 * target.reach_m),
    )?;
    let seed = request.sampler.seed;
    let document = WithProvenance { provenance: source.provenance("plan", seed), body: found };
    let json = source.dir.join("plan.json");
    let json = (json.clone(), to_json(&json, &document)?);
    let protocol = protocol(&document.body.force, target.duration_s(), request.moment_a_m2);
    let protocol = (source.dir.join(PROTOCOL_NAME), protocol.into_bytes());
    let tube = (source.dir.join("plan-tube.csv"), table(std::slice::from_ref(&document.body.tube)));
    let [svg, png, pdf] = figure_files(&source.dir, "plan", &figure)?;
    let compared = match document.body.robots.as_slice() {
        [] | [_] => {
            remove_figure(&source.dir, ROBOTS_NAME)?;
            Vec::new()
        }
        robots => {
            let title = "Force that robots of several shapes and sizes need";
            figure_files(&source.dir, ROBOTS_NAME, &figures::robots::robots(title, &robots_sentence(&target), robots))?
                .to_vec()
        }
    };
    // A controller must not run the force of an earlier plan for this one.
    if !document.body.feasible {
        remove_if_there(&protocol.0)?;
    }
    let protocol = document.body.feasible.then_some(&protocol);
    let all = [&svg, &png, &pdf, &tube, &json].into_iter().chain(&compared).chain(protocol);
    write_together(&all.map(|(path, bytes)| (path.as_path(), bytes.as_slice())).collect::<Vec<_>>())?;
    Ok(Outcome { is_sound: document.body.is_sound(), document, written: svg.0, study: source.study.clone() })
}

/// Error for a source of the gel that commands no force.
fn without_force() -> Error {
    Error::input(
        InputPlace::setting(Setting::LargestForce),
        "only the study of a record with a commanded force has a largest force of its own",
        format!("give the actuator's largest force in µN with `{}`", Setting::LargestForce),
    )
}

/// Refuses a target at which a robot would touch the outer surface of the gel. A searched size has no robot yet: its centre must stay inside.
fn refuse_outside(scenarios: &[Scenario], target: &Target, size: Option<RobotSize>) -> Result<()> {
    let free_m = |scenario: &Scenario| match size {
        None => free_path_m(&scenario.robot, &scenario.vitreous),
        Some(_) => 0.5 * scenario.vitreous.diameter_m,
    };
    match scenarios.iter().find(|scenario| target.reach_m.abs() >= free_m(scenario)) {
        None => Ok(()),
        Some(scenario) => Err(Error::input(
            InputPlace::default().at_key("reach"),
            format!(
                "the target at {} mm lies outside the gel of {}, whose outer surface the robot touches after {} mm",
                plain(1e3 * target.reach_m),
                scenario.name,
                format_significant(1e3 * free_m(scenario), 4)
            ),
            "give a distance in mm that is far smaller than the gel",
        )),
    }
}

/// Warning about planned forces against the direction of all forces (N) in the record: its apparatus may pull in one direction only.
fn against_record(record_n: &[f64], steps: &[ForceStep]) -> Option<Warning> {
    let has = |sign: f64| record_n.iter().any(|force_n| sign * force_n > 0.0);
    let direction = match (has(1.0), has(-1.0)) {
        (true, false) => 1.0,
        (false, true) => -1.0,
        _ => return None,
    };
    let largest_un = steps.iter().fold(0.0_f64, |most, step| most.max(step.force_un.abs()));
    let against_un = steps.iter().fold(0.0_f64, |most, step| most.max(-direction * step.force_un));
    (against_un > ROUNDING * largest_un).then(|| Warning {
        kind: WarningKind::Extrapolation,
        text: format!(
            "the plan needs forces of up to {} µN, and all forces in the record are {}: its apparatus may pull in one direction only",
            format_significant(-direction * against_un, 4),
            if direction > 0.0 { "positive" } else { "negative" }
        ),
        advice: "check that the apparatus applies forces of both directions, or plan a target that needs one direction".into(),
    })
}

/// Robot that a plan is for.
struct Chosen {
    scenario: Scenario,
    /// Target with the largest force on the robot.
    target: Target,
    /// Comparison with other robots.
    robots: Vec<PlannedRobot>,
    /// True if the robot has the last size that was tried.
    is_last_tried: bool,
}

/// Compares the robots of the scenarios, and returns the one that the plan is for, its target with the largest force on it, and the comparison. The comparison is
/// empty for one robot of a given size.
fn chosen_robot(
    source: &GelSource,
    scenarios: Vec<Scenario>,
    target: &Target,
    size: Option<RobotSize>,
    monitor: &dyn Monitor,
) -> Result<Chosen> {
    let gel = source.gel();
    let scenarios = match size {
        Some(size) => searched(scenarios, size),
        None => scenarios,
    };
    let mut comparison = RobotComparison::new(&gel, source.kept.clone());
    let mut compared = Vec::new();
    let is_only = scenarios.len() == 1 && size.is_none();
    for mut scenario in scenarios {
        if is_only {
            return Ok(Chosen { scenario, target: *target, robots: Vec::new(), is_last_tried: false });
        }
        let (mut target, mut is_last_tried) = (*target, false);
        if let Some(size) = size {
            if let Some(sized) = robot_size::sized(&gel, &scenario, &target, size, source.kept.clone(), monitor)? {
                (scenario.robot, is_last_tried) = (sized.robot, sized.is_last_tried);
            }
            target.largest_force_n = size.largest_force_n(&scenario.robot, &target);
        }
        let needed = comparison.needed_force(&scenario, &target, monitor)?;
        let robot = PlannedRobot {
            name: scenario.name.clone(),
            apparatus: scenario.apparatus(),
            length_mm: 1e3 * aspect(&scenario.robot).unwrap_or(1.0) * diameter_m(&scenario.robot),
            volume_mm3: 1e9 * scenario.robot.shape.volume_m3(),
            largest_force_un: 1e6 * target.largest_force_n,
            feasible: needed.probability >= target.probability,
            force_un: 1e6 * needed.force_n,
            probability: needed.probability,
            reach_mm: 1e3 * needed.reach_m,
            on_front: false,
            chosen: false,
        };
        compared.push(((scenario, target, is_last_tried), robot));
    }
    // Infeasible robots come last, by their probability.
    let rank = |robot: &PlannedRobot| match (robot.feasible, size) {
        (false, _) => (1, -robot.probability),
        (true, Some(RobotSize::Largest)) => (0, -robot.volume_mm3),
        (true, Some(RobotSize::Longest)) => (0, -robot.length_mm),
        (true, Some(RobotSize::SmallestMagnet { .. })) => (0, robot.volume_mm3),
        // The way to a rest takes all of the force, or a fixed part of it.
        (true, None) if target.rest.is_some() => (0, -robot.probability),
        (true, None) => (0, robot.force_un),
    };
    let order = |a: &PlannedRobot, b: &PlannedRobot| {
        let ((a_group, a_value), (b_group, b_value)) = (rank(a), rank(b));
        a_group.cmp(&b_group).then(a_value.total_cmp(&b_value))
    };
    let (mut scenarios, mut robots): (Vec<_>, Vec<PlannedRobot>) = compared.into_iter().unzip();
    let best = (0..robots.len()).min_by(|a, b| order(&robots[*a], &robots[*b])).unwrap_or(0);
    let on_front: Vec<bool> = robots.iter().map(|robot| robot.feasible && !is_dominated(robot, &robots)).collect();
    for (robot, on_front) in robots.iter_mut().zip(on_front) {
        robot.on_front = on_front;
    }
    robots[best].chosen = true;
    let (scenario, target, is_last_tried) = scenarios.swap_remove(best);
    Ok(Chosen { scenario, target, robots, is_last_tried })
}

/// Scenarios for which a search finds different robots. Several whose robots differ only in the searched size count as one, with the parts of the name that they share.
fn searched(scenarios: Vec<Scenario>, size: RobotSize) -> Vec<Scenario> {
    let mut kept: Vec<Scenario> = Vec::new();
    for scenario in scenarios {
        let is_same = |other: &&mut Scenario| {
            let mut with_robot = scenario.clone();
            (with_robot.name, with_robot.robot) = (other.name.clone(), other.robot);
            with_robot == **other && size.is_same_search(&other.robot, &scenario.robot)
        };
        match kept.iter_mut().find(is_same) {
            Some(other) => other.name = shared_name(&other.name, &scenario.name),
            None => kept.push(scenario),
        }
    }
    kept
}

/// Parts between commas that two names share, at the same places; the first name if there are none.
fn shared_name(one: &str, other: &str) -> String {
    let parts = one.split(", ").filter(|part| other.split(", ").any(|of_other| of_other == *part));
    let shared = parts.collect::<Vec<&str>>().join(", ");
    if shared.is_empty() { one.into() } else { shared }
}

/// True if another feasible robot is at least as large and needs at most the same force, and differs in one of both.
fn is_dominated(robot: &PlannedRobot, robots: &[PlannedRobot]) -> bool {
    // Ratios above 1 favour the other robot; equal sizes differ by rounding.
    robots.iter().filter(|other| other.feasible).any(|other| {
        let [volume, force] = [other.volume_mm3 / robot.volume_mm3, robot.force_un / other.force_un];
        volume.min(force) > 1.0 - ROUNDING && volume.max(force) > 1.0 + ROUNDING
    })
}

/// Probability of success of the planned force with each equivalent effect.
fn equivalent(
    source: &GelSource,
    scenario: &Scenario,
    target: &Target,
    planned: &PlannedForce,
    monitor: &dyn Monitor,
) -> Result<Vec<EquivalentPlan>> {
    let of_rival = |rival: &Rival| {
        let gel = Gel { problem: &rival.problem, draws: rival.draws.clone(), is_taught: true, seed: source.seed };
        let record = planned.ensemble.record().clone();
        let ensemble = Ensemble::new(&gel, scenario, record, source.kept.clone(), monitor)?;
        Ok(EquivalentPlan { effect: rival.effect.clone(), probability: target.probability_under(&ensemble)? })
    };
    source.rivals.iter().map(of_rival).collect()
}

fn sentence(planned: &PlannedForce, target: &Target, size: Option<RobotSize>, robots: &[PlannedRobot]) -> String {
    let of_force = force_sentence(planned, target);
    let Some(chosen) = robots.iter().find(|robot| robot.chosen) else { return of_force };
    let shape = chosen.apparatus.split(';').next().unwrap_or(&chosen.apparatus);
    let shape = format!("{} {shape}", if shape.starts_with('e') { "an" } else { "a" });
    let of_many = if robots.len() > 1 { format!(" of {} robots", robots.len()) } else { String::new() };
    let of_robot = match (planned.is_feasible, size) {
        (false, None) => format!("The most probable{of_many} is {}.", chosen.name),
        (false, Some(_)) => {
            format!("No size{of_many} within the limits reaches the target; the plan is for {shape}.")
        }
        (true, None) if target.rest.is_some() => format!("The most probable{of_many} is {}.", chosen.name),
        (true, None) => format!("The smallest force{of_many} is that on {}.", chosen.name),
        (true, Some(RobotSize::Largest)) => format!("The largest robot{of_many} that succeeds is {shape}."),
        (true, Some(RobotSize::Longest)) => {
            format!("The longest robot{of_many} of its volume that succeeds is {shape}.")
        }
        (true, Some(RobotSize::SmallestMagnet { .. })) => {
            format!("The smallest magnet{of_many} that succeeds is {shape}.")
        }
    };
    format!("{of_robot} {of_force}")
}

/// Tells how far the robot goes beyond a target at which it rests; empty if it stays within the tolerance.
fn overshoot_sentence(target: &Target, tube: &ScenarioPrediction) -> String {
    let Some(rest) = target.rest else { return String::new() };
    let farthest = if target.reach_m > 0.0 { &tube.position_um.q95 } else { &tube.position_um.q05 };
    let beyond_um = farthest.iter().fold(0.0_f64, |most, x| most.max(x.abs())) - 1e6 * target.reach_m.abs();
    match beyond_um > 1e6 * rest.within_m * (1.0 + ROUNDING) {
        true => format!(
            " On the way it goes up to {} µm beyond the target (95 % quantile).",
            format_significant(beyond_um, 2)
        ),
        false => String::new(),
    }
}

fn robots_sentence(target: &Target) -> String {
    format!(
        "Smallest force that reaches {} mm within {} s with {} % probability. The front: no larger robot needs less force.",
        plain(1e3 * target.reach_m),
        plain(target.within_s),
        percent(target.probability)
    )
}

fn force_sentence(planned: &PlannedForce, target: &Target) -> String {
    let largest_un = planned
        .steps
        .iter()
        .map(|step| step.force_un)
        .fold(0.0_f64, |most, force| if force.abs() > most.abs() { force } else { most });
    let (reach_mm, within_s) = (plain(1e3 * target.reach_m), plain(target.within_s));
    let goal = match target.rest {
        None => format!("reaches {reach_mm} mm within {within_s} s"),
        Some(rest) => format!(
            "comes within ± {} µm of {reach_mm} mm in {within_s} s and stays there for {} s",
            plain(1e6 * rest.within_m),
            plain(rest.for_s)
        ),
    };
    let checked =
        format!("{} % of {} unused draws by full finite elements", percent(planned.checked), planned.full_runs);
    // Rounded up, because a smaller force succeeds less often than promised.
    let size_un = largest_un.abs();
    // Under a limit of the strain, a larger force may strain the gel too much.
    let digits = if target.largest_strain.is_some() { 7 } else { 4 };
    let unit_un = 10_f64.powf(size_un.log10().floor() - f64::from(digits - 1));
    let rounded_un = if size_un > 0.0 { (size_un / unit_un - 1e-9).ceil() * unit_un } else { 0.0 };
    // The most of a stepwise force is a size.
    let signed_un = if target.rest.is_some() { rounded_un } else { rounded_un.copysign(largest_un) };
    let force = format!("{} µN", format_significant(signed_un, digits as usize));
    if planned.is_feasible {
        let kind = match (target.rest, target.slew_n_per_s) {
            (Some(_), _) => "A stepwise force of at most",
            (None, Some(_)) => "A force that rises to",
            (None, None) => "A constant force of",
        };
        return format!("{kind} {force} {goal} with {} % probability ({checked}).", percent(planned.promised));
    }
    format!(
        "No force within the limits {goal} with {} % probability: the highest found is {} % at {force} ({checked}). The limit that binds is the {}.",
        percent(target.probability),
        percent(planned.promised),
        planned.limit
    )
}

/// Table for the controller: each force holds until the next row; the last row ends the protocol.
fn protocol(steps: &[ForceStep], end_s: f64, moment_a_m2: Option<f64>) -> String {
    let last = steps.last().map(|step| ForceStep { time_s: end_s, force_un: step.force_un });
    let column = if moment_a_m2.is_some() { ",gradient_t_per_m" } else { "" };
    let mut text = format!("time_s,force_un{column}\n");
    for ForceStep { time_s, force_un } in steps.iter().copied().chain(last) {
        let gradient = moment_a_m2.map_or(String::new(), |moment| format!(",{}", digits(1e-6 * force_un / moment)));
        text += &format!("{},{}{gradient}\n", digits(time_s), digits(force_un));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use record::{Robot, RobotShape, Vitreous};

    fn target(reach_m: f64) -> Target {
        Target {
            reach_m,
            within_s: 3.0,
            probability: 0.95,
            largest_force_n: 1e-3,
            slew_n_per_s: None,
            largest_strain: None,
            rest: None,
        }
    }

    /// Cylinders of one volume have one longest robot, and three largest ones.
    #[test]
    fn a_search_has_one_row_for_each_robot_that_it_can_find() {
        let dir = tempfile::tempdir().expect("a directory");
        let path = dir.path().join("robots.toml");
        let text = "[[scenario]]\nname = \"cylinder\"\n[scenario.robot]\nshape = \"cylinder\"\nlength_mm = 1.97\ndiameter_mm = 0.203\norientation = \"horizontal\"\n[scenario.vitreous]\ndiameter_mm = 20\npoisson_ratio = 0.48\n[scenario.vary]\naspect = [4, 10, 20]\n";
        let names = |text: &str, size: RobotSize| -> Vec<String> {
            std::fs::write(&path, text).expect("a file");
            let all = prediction::scenario_file::read_scenarios(&path, None).expect("scenarios");
            searched(all, size).into_iter().map(|scenario| scenario.name).collect()
        };
        assert_eq!(names(text, RobotSize::Longest), ["cylinder"]);
        assert_eq!(names(text, RobotSize::Largest).len(), 3);
        let with_sizes = format!("{text}size = [1, 2]\n");
        assert_eq!(names(&with_sizes, RobotSize::Longest), ["cylinder, size 1", "cylinder, size 2"]);
        assert_eq!(names(&with_sizes, RobotSize::Largest)[0], "cylinder, aspect 4");
    }

    /// Forces against a record of one direction are named; rounding is no force.
    #[test]
    fn forces_against_the_direction_of_the_record_are_named() {
        let steps = |forces_un: &[f64]| -> Vec<ForceStep> {
            forces_un.iter().map(|force_un| ForceStep { time_s: 0.0, force_un: *force_un }).collect()
        };
        let found = against_record(&[0.0, 4.6e-6], &steps(&[-1.577, 0.0])).expect("a warning");
        assert!(found.text.contains("up to −1.577 µN, and all forces in the record are positive"), "{}", found.text);
        let found = against_record(&[0.0, -4.6e-6], &steps(&[-3.0, 1.0])).expect("a warning");
        assert!(found.text.contains("up to 1.000 µN, and all forces in the record are negative"), "{}", found.text);
        assert_eq!(against_record(&[4.6e-6, -4.6e-6], &steps(&[-1.577])), None);
        assert_eq!(against_record(&[4.6e-6], &steps(&[1.577, -1e-12])), None);
        assert!(!WarningKind::Extrapolation.is_fatal());
    }

    /// A bead of 0.55 mm in a gel of 20 mm touches the outer surface after 9.725 mm in both directions.
    #[test]
    fn a_target_inside_the_outer_surface_is_refused() {
        let shape = RobotShape::Sphere { diameter_m: 0.55e-3 };
        let vitreous = Vitreous { diameter_m: 0.02, poisson_ratio: 0.48, density_kg_m3: None };
        let bead = Scenario::of_robot("own robot", Robot { shape, density_kg_m3: None, offset: None }, vitreous);
        let refused = |reach_m: f64, size| refuse_outside(std::slice::from_ref(&bead), &target(reach_m), size);
        assert!([9.72e-3, -9.72e-3].into_iter().all(|reach_m| refused(reach_m, None).is_ok()));
        for reach_m in [9.73e-3, -9.73e-3] {
            let found = refused(reach_m, None).expect_err("a refusal").to_string();
            assert!(found.contains("the robot touches after 9.725 mm"), "{found}");
        }
        // A smaller robot may reach the target.
        assert!(refused(9.73e-3, Some(RobotSize::Largest)).is_ok());
        assert!(refused(10.0e-3, Some(RobotSize::Largest)).is_err());
    }
}
