use std::sync::Arc;

use super::*;
use crate::simulation_files;
use elements::fe::Stiffness;
use elements::mesh::QuarterBall;
use posterior::mechanics::Mechanics;
use posterior::monitor::SilentMonitor;
use posterior::replica::{TABLE_I, embedded};
use posterior::study::ModelSpecification;
use record::Experiment;

/// Problem of the embedded replica on a coarse mesh, for quick tests.
fn problem() -> Problem {
    let (experiment, _) = embedded().unwrap();
    let mut problem = Problem::new(experiment, ModelSpecification::default(), None, &SilentMonitor).unwrap();
    if let Some(Mechanics::FiniteElements(fe)) = Arc::get_mut(&mut problem.mechanics) {
        let ball = QuarterBall { robot_radius_m: 0.275e-3, outer_radius_m: 10e-3, n_per_edge: 1, n_layers: 4 };
        fe.mesh = ball.mesh().unwrap();
        fe.stiffness = Stiffness::new(&fe.mesh).unwrap();
    }
    problem
}

fn request(problem: &Problem, scheme: TimeScheme, time_step_s: Option<f64>) -> SimulationRequest {
    let names = problem.model.parameters().iter().map(|p| p.name.to_string());
    let set: BTreeMap<String, f64> = names.zip(TABLE_I).collect();
    let parameters = parameters(problem, &set, None).unwrap();
    SimulationRequest { parameters, scheme: Some(scheme), time_step_s, refine: None }
}

/// The exponential scheme is exact. For the midpoint rule, half the time step divides the error by 4.
#[test]
fn exponential_is_exact_and_midpoint_of_second_order() {
    let problem = problem();
    let error_um = |scheme, step| {
        let simulation = run(&problem, &request(&problem, scheme, step), false, &SilentMonitor).unwrap();
        simulation.summary.time_integration_error_um / simulation.summary.largest_displacement_um
    };
    assert!(error_um(TimeScheme::Exponential, None) < 1e-12);
    let (coarse, fine) = (error_um(TimeScheme::Midpoint, Some(0.025)), error_um(TimeScheme::Midpoint, Some(0.0125)));
    assert!(coarse < 1e-3 && (coarse / fine - 4.0).abs() < 0.05, "{coarse} {fine}");
}

#[test]
fn sub_steps_divide_the_rows_and_keep_them() {
    let record = Record {
        time_s: vec![0.0, 0.1, 0.25, 0.3],
        force_n: vec![1.0, -1.0, 2.0, 0.0],
        position_m: vec![None; 4],
        cycle: vec![1; 4],
        ..Record::default()
    };
    let grid = TimeGrid::new(&record, Some(0.05));
    assert_eq!(grid.place_of_row, [0, 2, 5, 6]);
    assert_eq!(grid.force.at_rows_n, [1.0, 1.0, -1.0, -1.0, -1.0, 2.0, 0.0]);
    for (place, time_s) in grid.place_of_row.iter().zip(&record.time_s) {
        assert_eq!(grid.time_s[*place], *time_s);
    }
    assert!(grid.time_s.windows(2).all(|pair| pair[1] - pair[0] < 0.05 + 1e-12));
    assert_eq!(n_steps(&record, Some(0.05)), 6.0);
    assert_eq!(TimeGrid::new(&record, None).time_s, record.time_s);
}

#[test]
fn fields_stand_at_the_ends_of_holds_and_are_not_too_many() {
    let (mut experiment, _) = embedded().unwrap();
    let rows = field_rows(&experiment.record);
    assert_eq!(rows, [100, 200, 300, 400, 500, 600, 700, 799]);
    experiment.record.force_n.iter_mut().enumerate().for_each(|(i, f)| *f = if i % 2 == 0 { 1.0 } else { -1.0 });
    let rows = field_rows(&experiment.record);
    assert_eq!(rows.len(), MOST_FIELDS);
    assert_eq!(rows[MOST_FIELDS - 1], 799);
}

/// The directory that a simulation writes can be read as an experiment. This experiment has the simulated positions and an equal apparatus.
#[test]
fn the_directory_is_itself_an_experiment() {
    let problem = problem();
    let simulation = run(&problem, &request(&problem, TimeScheme::Exponential, None), false, &SilentMonitor).unwrap();
    let dir = tempfile::tempdir().unwrap();
    simulation_files::write(dir.path(), &problem, &simulation).unwrap();
    let (experiment, files) = Experiment::read(dir.path()).unwrap();
    assert!(files.notes.is_empty(), "{:?}", files.notes);
    assert_eq!(experiment.apparatus, problem.experiment.apparatus);
    assert_eq!(experiment.calibration_cycles, problem.experiment.calibration_cycles);
    assert_eq!(experiment.heldout_cycles, problem.experiment.heldout_cycles);
    assert!(experiment.source.starts_with("synthetic"));
    let original = &problem.experiment.record;
    assert_eq!(experiment.record.time_s, original.time_s);
    assert_eq!(experiment.record.cycle, original.cycle);
    for (row, position) in experiment.record.position_m.iter().enumerate() {
        assert!((position.unwrap() - simulation.position_m[row]).abs() < 1e-17);
        assert!((experiment.record.force_n[row] / original.force_n[row] - 1.0).abs() < 1e-14);
    }
    let pvd = std::fs::read_to_string(dir.path().join("fields.pvd")).unwrap();
    let written = (1..=8).all(|i| {
        let name = format!("fields_{i:02}.vtu");
        pvd.contains(&name) && dir.path().join(&name).is_file()
    });
    assert!(written && !dir.path().join("fields_09.vtu").exists());
}

/// Compares the stiffness of each mesh level with the exact value (physics §4.2). The errors decrease, the differences agree with the table's column of
/// differences, and the order of convergence is above 3.
#[test]
fn convergence_table_converges_to_the_exact_value() {
    let problem = problem();
    let request = SimulationRequest { refine: Some(3), ..request(&problem, TimeScheme::Exponential, None) };
    let table = run(&problem, &request, false, &SilentMonitor).unwrap().summary.convergence;
    assert_eq!(table.len(), 3);
    let exact_m = 1.820902396e-3;
    for level in &table {
        assert!((level.stiffness_m / exact_m - 1.0 - level.relative_error.unwrap()).abs() < 1e-8);
    }
    for pair in table.windows(2) {
        assert!(pair[1].relative_error.unwrap().abs() < 0.5 * pair[0].relative_error.unwrap().abs(), "{table:?}");
        let difference = pair[1].relative_difference.unwrap();
        assert!((pair[1].stiffness_m / pair[0].stiffness_m - 1.0 - difference).abs() < 1e-15);
    }
    assert!(table[2].relative_error.unwrap().abs() < 2e-4 && table[2].order.unwrap() > 3.0, "{table:?}");
}

#[test]
fn values_come_from_the_option_then_the_model_then_the_prior() {
    let mut problem = problem();
    problem.specification.fixed.insert("viscosity_1_pa_s".into(), 7.0);
    let set = BTreeMap::from([("young_modulus_pa".to_string(), 2.0)]);
    let found = parameters(&problem, &set, None).unwrap();
    assert_eq!(found.iter().map(|p| p.value).collect::<Vec<_>>()[..2], [2.0, 7.0]);
    // The prior for porcine gels is log-normal with a median of 30.
    assert!((found[2].value - 30.0).abs() < 1e-9 && found[2].origin.contains("prior"), "{found:?}");
    let noise = BTreeMap::from([("noise_sd_um".to_string(), 2.0)]);
    let refused = parameters(&problem, &noise, None).unwrap_err().to_string();
    assert!(refused.contains("noise_sd_um is given, but a simulation has no noise"), "{refused}");
}

#[test]
fn impossible_requests_are_refused_with_their_option() {
    let problem = problem();
    let base = request(&problem, TimeScheme::Midpoint, None);
    let refused = |request: SimulationRequest, has_mesh_file: bool, option: &str| {
        let error = check_request(&problem, &request, has_mesh_file).unwrap_err();
        assert!(error.exit_code() == 2 && error.to_string().contains(option), "{error}");
    };
    for step in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-12] {
        refused(SimulationRequest { time_step_s: Some(step), ..base.clone() }, false, "`time_step_s`");
    }
    let exact = SimulationRequest { scheme: Some(TimeScheme::Exponential), time_step_s: Some(0.1), ..base.clone() };
    refused(exact, false, "scheme midpoint");
    refused(SimulationRequest { refine: Some(0), ..base.clone() }, false, "`refine`");
    refused(SimulationRequest { refine: Some(99), ..base.clone() }, false, "`refine`");
    refused(SimulationRequest { refine: Some(2), ..base.clone() }, true, "leave out mesh");
    assert!(check_request(&problem, &base, true).is_ok());
}
