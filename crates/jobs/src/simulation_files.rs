//! Files of a simulation: trajectory, TOML description and fields. Together they form an experiment.

use std::path::Path;

use super::simulate::Simulation;
use base::error::{Error, Result};
use base::toml_input::quoted;
use documents::simulation::SimulationSummary;
use elements::mesh::vtu::{PointData, TimeStep, write_pvd, write_vtu};
use posterior::problem::Problem;
use record::{Apparatus, Experiment, Offset, Orientation, Record, RobotShape, STRESS_STRAIN, density_toml};

/// Writes the trajectory, the description and the fields into `dir`. The directory can then be read as an experiment.
///
/// # Errors
/// [`Error::File`] if the operating system refuses.
pub fn write(dir: &Path, problem: &Problem, simulation: &Simulation) -> Result<()> {
    let refused = |path: &Path, source| Error::at_path("write", path, source, "check that the disk has room");
    let texts = [
        ("trajectory.csv", trajectory_csv(&problem.experiment.record, &simulation.position_m)),
        ("experiment.toml", experiment_toml(problem, &simulation.summary)),
    ];
    for (name, text) in texts {
        let path = dir.join(name);
        std::fs::write(&path, text).map_err(|source| refused(&path, source))?;
    }
    let mut files = Vec::new();
    for (number, (row, field)) in simulation.fields.iter().enumerate() {
        let displacement_m = PointData { name: "displacement_m", components: 3, values: field.as_flattened() };
        let name = format!("fields_{:02}.vtu", number + 1);
        write_vtu(dir.join(&name), &simulation.mesh, &[displacement_m])?;
        files.push((problem.experiment.record.time_s[*row], name));
    }
    let steps: Vec<TimeStep> = files.iter().map(|(time_s, file)| TimeStep { time_s: *time_s, file }).collect();
    write_pvd(dir.join("fields.pvd"), &steps)
}

/// Removes the rounding error in a number's last decimal digit: 4.6000000000000005 becomes 4.6.
fn decimal(value: f64) -> f64 {
    format!("{value:.14e}").parse().unwrap_or(value)
}

fn trajectory_csv(record: &Record, position_m: &[f64]) -> String {
    let mut csv = String::from("time_s,force_uN,position_um,cycle\n");
    for (row, position_m) in position_m.iter().enumerate() {
        let (force_un, position_um) = (decimal(1e6 * record.force_n[row]), decimal(1e6 * position_m));
        csv += &format!("{},{force_un},{position_um},{}\n", record.time_s[row], record.cycle[row]);
    }
    csv
}

fn experiment_toml(problem: &Problem, summary: &SimulationSummary) -> String {
    let experiment = &problem.experiment;
    let values: Vec<String> = summary.parameters.iter().map(|p| format!("{} = {}", p.name, p.value)).collect();
    let source =
        format!("synthetic: full finite elements with {} unknowns, no noise; {}", summary.unknowns, values.join(", "));
    let measurement = [
        format!("calibration_cycles = {:?}", experiment.calibration_cycles),
        format!("heldout_cycles = {:?}", experiment.heldout_cycles),
        format!("force = \"{}\"", experiment.record.force_rule.name()),
        format!("source = {}", quoted(&source)),
    ];
    let head = "# SYNTHETIC. Made by `vitreo-uq simulate`: full finite elements, no noise.";
    description_toml(head, &format!("{}-simulated", experiment.specimen_id), experiment, &measurement)
}

/// Description of a record with the apparatus of an experiment, in the table `trajectory.csv`. `measurement` has the further lines of its section.
pub fn description_toml(head: &str, id: &str, experiment: &Experiment, measurement: &[String]) -> String {
    let mut lines = vec![head.to_string(), "[specimen]".into(), format!("id = {}", quoted(id))];
    lines.extend(experiment.species.iter().map(|species| format!("species = {}", quoted(species))));
    lines.extend(experiment.region.iter().map(|region| format!("region = {}", quoted(region))));
    lines.push(apparatus_toml(&experiment.apparatus));
    lines.extend(["[measurement]".to_string(), "file = \"trajectory.csv\"".into()]);
    lines.extend_from_slice(measurement);
    lines.join("\n") + "\n"
}

/// Tables that describe an apparatus.
pub fn apparatus_toml(apparatus: &Apparatus) -> String {
    let mm = |metres: f64| decimal(1e3 * metres);
    match apparatus {
        Apparatus::Instrument { compliance_per_m, is_stress_strain: false } => {
            format!("[instrument]\ncompliance_per_m = {compliance_per_m}")
        }
        // Inside, 1 Pa counts as 1 µN and 1 % as 1 µm.
        Apparatus::Instrument { compliance_per_m, is_stress_strain: true } => {
            let of_strain = decimal(1e-2 * compliance_per_m);
            format!("[instrument]\ncompliance_per_m = {of_strain}\nmeasures = {}", quoted(STRESS_STRAIN))
        }
        Apparatus::Indenter(indenter) => indenter.toml(),
        Apparatus::Robot { robot, vitreous } => {
            let shape = match robot.shape {
                RobotShape::Sphere { diameter_m } => format!("shape = \"sphere\"\ndiameter_mm = {}", mm(diameter_m)),
                RobotShape::Ellipsoid { length_m, diameter_m, orientation } => {
                    elongated_toml("ellipsoid", mm(length_m), mm(diameter_m), orientation)
                }
                RobotShape::Cylinder { length_m, diameter_m, orientation } => {
                    elongated_toml("cylinder", mm(length_m), mm(diameter_m), orientation)
                }
            };
            format!(
                "[robot]\n{shape}\n{}{}[vitreous]\ndiameter_mm = {}\npoisson_ratio = {}\n{}",
                density_toml(robot.density_kg_m3),
                offset_toml(robot.offset),
                mm(vitreous.diameter_m),
                vitreous.poisson_ratio,
                density_toml(vitreous.density_kg_m3)
            )
        }
    }
}

/// TOML lines that describe the robot's offset from the centre; empty if it is in the centre.
fn offset_toml(offset: Option<Offset>) -> String {
    offset.map_or_else(String::new, |offset| {
        let (distance_mm, direction) = (decimal(1e3 * offset.distance_m), offset.direction.name());
        format!("offset_mm = {distance_mm}\noffset_direction = \"{direction}\"\n")
    })
}

fn elongated_toml(shape: &str, length_mm: f64, diameter_mm: f64, orientation: Orientation) -> String {
    let orientation = match orientation {
        Orientation::Horizontal => "horizontal",
        Orientation::Vertical => "vertical",
    };
    format!(
        "shape = \"{shape}\"\nlength_mm = {length_mm}\ndiameter_mm = {diameter_mm}\norientation = \"{orientation}\""
    )
}
