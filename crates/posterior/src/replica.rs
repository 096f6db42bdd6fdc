//! Built-in experiment: a synthetic replica of the paper's measurement, labelled as synthetic. The raw data of the paper are not public.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use crate::mechanics::robot_mesh;
use base::error::{Error, Result};
use elements::fe::Stiffness;
use elements::fe::time::{FullOrderModel, TimeScheme};
use laws::rheology::CreepCompliance;
use record::{Apparatus, Experiment, ExperimentFiles};

const TOML: &str = include_str!("../../../data/porcine-replica/experiment.toml");
const CSV: &str = include_str!("../../../data/porcine-replica/trajectory.csv");

/// Parameters in Table I of the paper: Young's modulus (Pa), retardation viscosity and flow viscosity (Pa·s).
pub const TABLE_I: [f64; 3] = [3.527, 1.402, 47.370];

/// Refinement level of the mesh that generates the data, one above the level of the fitted model.
const MESH_LEVEL: usize = 4;
const N_CYCLES: usize = 4;
const HOLD_S: f64 = 5.0;
const FORCE_N: f64 = 4.6e-6;
const INTERVAL_S: f64 = 0.05;
/// Number of implicit-midpoint time steps per sample. The fitted model uses one exact step per sample.
const STEPS_PER_SAMPLE: usize = 20;
const NOISE_SD_M: f64 = 4e-6;
const SEED: u64 = 20130703;

/// Returns the embedded replica with its files. Commands use this experiment if the user gives none.
pub fn embedded() -> Result<(Experiment, ExperimentFiles)> {
    Experiment::from_texts(
        "the embedded porcine replica: experiment.toml",
        TOML,
        "the embedded porcine replica: trajectory.csv",
        CSV,
    )
}

/// Generates the replica's `trajectory.csv` by full finite elements with the parameters of Table I, and adds white noise. Mesh and time step are finer than in the
/// fitted model, and the integrator differs.
pub fn trajectory_csv() -> Result<String> {
    let Apparatus::Robot { robot, vitreous } =
        Experiment::from_texts("experiment.toml", TOML, "trajectory.csv", CSV)?.0.apparatus
    else {
        return Err(Error::numerical(
            "the embedded replica's description has no [robot] and [vitreous]",
            "restore data/porcine-replica/experiment.toml",
        ));
    };
    let stiffness = Stiffness::new(&robot_mesh(&robot, &vitreous, MESH_LEVEL)?)?;
    let model = FullOrderModel::new(&stiffness, vitreous.poisson_ratio)?;
    let n_rows = (N_CYCLES as f64 * 2.0 * HOLD_S / INTERVAL_S).round() as usize;
    let hold_rows = (HOLD_S / INTERVAL_S).round() as usize;
    let n_steps = n_rows * STEPS_PER_SAMPLE;
    let time_s: Vec<f64> = (0..n_steps).map(|i| INTERVAL_S * i as f64 / STEPS_PER_SAMPLE as f64).collect();
    let force_n: Vec<f64> = (0..n_steps)
        .map(|i| if (i / STEPS_PER_SAMPLE / hold_rows).is_multiple_of(2) { FORCE_N } else { -FORCE_N })
        .collect();
    let load = model.solve_load(&time_s, &force_n);
    let position_m = model.trajectory(&load, &CreepCompliance::lethersich(&TABLE_I), TimeScheme::Midpoint);
    let noise = Normal::new(0.0, NOISE_SD_M).map_err(|e| Error::numerical(e.to_string(), "give a positive noise"))?;
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut csv = String::from("time_s,force_uN,position_um,cycle\n");
    for row in 0..n_rows {
        let i = row * STEPS_PER_SAMPLE;
        let position_um = 1e6 * (position_m[i] + noise.sample(&mut rng));
        let cycle = 1 + row / (2 * hold_rows);
        csv += &format!("{:.2},{:.1},{position_um:.3},{cycle}\n", time_s[i], 1e6 * force_n[i]);
    }
    Ok(csv)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The committed file equals the generated one, except for one unit of the last printed digit, which rounding may change.
    #[test]
    #[ignore = "thorough"]
    fn committed_data_are_what_the_command_makes() {
        let made = trajectory_csv().expect("the model runs");
        assert_eq!(made.lines().count(), CSV.lines().count());
        for (made, committed) in made.lines().zip(CSV.lines()).skip(1) {
            let field =
                |line: &str, i: usize| line.split(',').nth(i).and_then(|f| f.parse::<f64>().ok()).unwrap_or(f64::NAN);
            for i in 0..4 {
                let distance = (field(made, i) - field(committed, i)).abs();
                assert!(distance < 1.5e-3, "{made} against {committed}");
            }
        }
    }
}
