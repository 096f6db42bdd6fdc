//! `plan`: the force that brings a robot to a target with a given probability.

use std::process::ExitCode;

use clap::Args;
use vitreo_uq::base::error::{Error, InputPlace, Result};
use vitreo_uq::documents::prediction::{Plan, PlannedRobot};
use vitreo_uq::jobs::prediction::plan::{self, PlanRequest};
use vitreo_uq::prediction::plan::{Rest, Target};
use vitreo_uq::prediction::robot_size::RobotSize;

use crate::options::positive;
use crate::predict::{GelArguments, scenario_lines, warning_lines};
use crate::session::Session;
use crate::text::significant;

/// Arguments of `plan`.
#[derive(Args)]
pub struct PlanArguments {
    #[command(flatten)]
    gel: GelArguments,
    /// Distance to reach, in mm; negative against the positive force
    #[arg(long, value_name = "MILLIMETRE", allow_negative_numbers = true)]
    reach_mm: f64,
    /// Time within which it is reached
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    within_s: f64,
    /// Probability with which it is reached
    #[arg(long, value_name = "P", default_value_t = 0.95, allow_negative_numbers = true)]
    probability: f64,
    /// Largest force in µN [default: that of the study's record]
    #[arg(long, value_name = "MICRONEWTON", allow_negative_numbers = true)]
    max_force_un: Option<f64>,
    /// Largest change of the force per second, in µN/s [default: no limit]
    #[arg(long, value_name = "MICRONEWTON/S", allow_negative_numbers = true)]
    max_slew_un_per_s: Option<f64>,
    /// Largest principal strain of the gel [default: no limit]
    #[arg(long, value_name = "STRAIN", allow_negative_numbers = true)]
    max_strain: Option<f64>,
    /// Rest at the target from `--within-s` on: largest distance from it, in µm
    #[arg(long, value_name = "MICROMETRE", requires = "rest_s", allow_negative_numbers = true)]
    rest_within_um: Option<f64>,
    /// Duration of the rest at the target
    #[arg(long, value_name = "SECONDS", requires = "rest_within_um", allow_negative_numbers = true)]
    rest_s: Option<f64>,
    /// Search for the largest robot of this shape that the largest force moves to the target
    #[arg(long, conflicts_with_all = ["smallest_magnet_un_per_mm3", "rest_within_um", "max_slew_un_per_s"])]
    largest_robot: bool,
    /// Search for the longest robot of this shape and volume that the largest force moves to the target
    #[arg(long, conflicts_with_all = ["largest_robot", "smallest_magnet_un_per_mm3", "rest_within_um", "max_slew_un_per_s"])]
    longest_robot: bool,
    /// Search for the smallest robot of this shape that reaches the target if the largest force is this one per mm³ of its volume (magnetisation times field gradient)
    #[arg(long, value_name = "MICRONEWTON/MM3", conflicts_with_all = ["max_force_un", "rest_within_um", "max_slew_un_per_s"], allow_negative_numbers = true)]
    smallest_magnet_un_per_mm3: Option<f64>,
    /// Magnetic moment of the robot in A·m²: adds the field gradient to the controller's file
    #[arg(long, value_name = "A*M2", allow_negative_numbers = true)]
    moment_a_m2: Option<f64>,
}

/// Largest time of a plan, in s: ten days.
const LONGEST_S: f64 = 864_000.0;

pub fn run(arguments: &PlanArguments) -> Result<ExitCode> {
    let common = arguments.gel.common();
    let (target, size) = (target(arguments)?, size(arguments)?);
    let session = Session::begin(&common)?;
    let outcome = arguments.gel.with_place(&session, |place, sampler| {
        let scenario = arguments.gel.scenario.clone();
        plan::run(
            place,
            &PlanRequest { scenario, target, size, moment_a_m2: arguments.moment_a_m2, sampler },
            &session.terminal,
        )
    })?;
    session.end(&outcome, &words(&outcome.document.body), "Figure", &arguments.gel.page)
}

fn size(arguments: &PlanArguments) -> Result<Option<RobotSize>> {
    let un_per_mm3 = positive("--smallest-magnet-un-per-mm3", arguments.smallest_magnet_un_per_mm3, 1e9)?;
    // 1 µN/mm³ is 1000 N/m³.
    let magnet = un_per_mm3.map(|density| RobotSize::SmallestMagnet { force_per_volume_n_m3: 1e3 * density });
    let longest = arguments.longest_robot.then_some(RobotSize::Longest);
    Ok(magnet.or(longest).or(arguments.largest_robot.then_some(RobotSize::Largest)))
}

fn target(arguments: &PlanArguments) -> Result<Target> {
    let reach_mm = arguments.reach_mm;
    if !(reach_mm != 0.0 && reach_mm.abs() <= 1e4) {
        let (found, remedy) = (format!("{reach_mm} mm"), "give a distance other than 0, of at most 10000 mm");
        return Err(Error::input(InputPlace::default().at_key("--reach-mm"), found, remedy));
    }
    positive("--within-s", Some(arguments.within_s), LONGEST_S)?;
    let largest_un = positive("--max-force-un", arguments.max_force_un, 1e9)?;
    let slew_un = positive("--max-slew-un-per-s", arguments.max_slew_un_per_s, 1e12)?;
    let largest_strain = positive("--max-strain", arguments.max_strain, 100.0)?;
    let within_um = positive("--rest-within-um", arguments.rest_within_um, 1e7)?;
    let rest_s = positive("--rest-s", arguments.rest_s, LONGEST_S)?;
    positive("--moment-a-m2", arguments.moment_a_m2, 1e3)?;
    let probability = arguments.probability;
    if !(0.5..=0.999).contains(&probability) {
        let found = format!("a probability of {probability}");
        let remedy = "give a probability from 0.5 to 0.999: a force that fails more often than it succeeds is no plan, and the draws resolve no larger one";
        return Err(Error::input(InputPlace::default().at_key("--probability"), found, remedy));
    }
    Ok(Target {
        reach_m: 1e-3 * reach_mm,
        within_s: arguments.within_s,
        probability,
        largest_force_n: largest_un.map_or(0.0, |un| 1e-6 * un),
        slew_n_per_s: slew_un.map(|un| 1e-6 * un),
        largest_strain,
        rest: within_um.zip(rest_s).map(|(um, for_s)| Rest { within_m: 1e-6 * um, for_s }),
    })
}

fn words(found: &Plan) -> String {
    let mut lines = vec![format!("Plan for {}", found.gel), found.sentence.clone(), String::new()];
    if found.robots.len() > 1 {
        let width = found.robots.iter().map(|robot| robot.name.chars().count()).fold(NARROWEST, usize::max);
        lines.push(format!(
            "  {:<width$}{:>12}{:>12}{:>14}{:>14}   front",
            "robot", "mm³", "force (µN)", "probability", "reach (mm)"
        ));
        lines.extend(found.robots.iter().map(|robot| robot_line(robot, width)));
        lines.push("  (reach: distance that the largest force reaches in time with the requested probability; front: no larger robot needs less force)".into());
        lines.push(String::new());
    }
    lines.extend(scenario_lines(&found.tube));
    lines.extend(found.equivalent.iter().map(|other| format!("  {}", other.sentence())));
    lines.push(match found.feasible {
        true => format!("  Controller's file: {}", found.protocol_file),
        false => "  No controller's file is written, because the plan does not reach the target.".into(),
    });
    lines.extend(warning_lines(&found.tube.warnings));
    lines.extend(warning_lines(&found.warnings));
    lines.join("\n") + "\n"
}

/// Smallest width of the column of names, in characters.
const NARROWEST: usize = 34;

fn robot_line(robot: &PlannedRobot, width: usize) -> String {
    let [volume, force, reach] = [robot.volume_mm3, robot.force_un, robot.reach_mm].map(significant);
    let force = if robot.feasible { force } else { "too weak".into() };
    let front = if robot.on_front { "yes" } else { "" };
    format!("  {:<width$}{volume:>12}{force:>12}{:>14.3}{reach:>14}   {front}", robot.name, robot.probability)
}
