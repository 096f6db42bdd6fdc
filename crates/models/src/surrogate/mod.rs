//! Reduction of the full-order model to a few modes, with verification (physics §3.3). The method is a proper orthogonal
//! decomposition (POD) of snapshots with Galerkin projection.
//!
//! Snapshots are full-order fields at Sobol points of a box of parameters. At one Poisson ratio, the fields of the base model
//! differ only by a factor, so that one mode is exact. Over a range of Poisson ratios three modes span the response. Both cases
//! use one implementation.

mod field_models;
pub mod hyper;
mod pod;
mod reduced;
pub mod spread;
mod three_terms;
pub mod trajectory;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use field_models::{FieldModel, FieldModels, n_pieces};
pub use pod::{EnergyProduct, Pod};
pub use reduced::ReducedOperators;

use crate::model::{Compliance, TrainedRange, convolve_m};
use base::error::{Error, Result};
use base::number::Dual;
use elements::fe::Stiffness;
use elements::fe::time::{FullOrderModel, SolvedLoad, TimeScheme};
use laws::rheology::{BaseLaw, CreepCompliance};
use record::Force;

/// Number of full-order runs that train the surrogate.
const TRAINING_RUNS: u32 = 16;
/// Number of full-order runs that verify the surrogate, at later points of the Sobol sequence.
const VERIFICATION_RUNS: u32 = 8;
/// Seed of the scrambled Sobol sequence. It is fixed, so that equal settings always give the same training points.
const DESIGN_SEED: u32 = 1;
/// Number of fields that are taken from each run, at times spread over the record.
const FIELDS_PER_RUN: usize = 6;

/// Settings for the training of a surrogate.
#[derive(Debug, Clone, PartialEq)]
pub struct Training<'a> {
    /// Constitutive law, whose creep compliance is a finite sum of exponentials.
    pub law: BaseLaw,
    /// Ranges of the law's parameters, all positive, covered on a logarithmic scale.
    pub parameters: &'a [TrainedRange],
    /// Range of the Poisson ratio; a single value if both ends agree.
    pub poisson_ratio: [f64; 2],
    /// Times of the record in s.
    pub time_s: &'a [f64],
    /// Commanded force.
    pub force: Force<'a>,
    /// Fraction of the largest singular value below which modes are dropped.
    pub tolerance: f64,
}

/// Reduced model of the base law's displacement field, with its measured errors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Surrogate {
    /// Valid ranges of the law's parameters.
    pub parameters: Vec<TrainedRange>,
    /// Valid range of the Poisson ratio.
    pub poisson_ratio: TrainedRange,
    /// Galerkin projection of the full-order model on the modes.
    pub operators: ReducedOperators,
    /// Singular values of the normalised snapshots, relative to the largest.
    pub singular_values: Vec<f64>,
    /// Fraction of the largest singular value below which modes are dropped.
    pub tolerance: f64,
    /// Number of full-order runs that trained the surrogate.
    pub snapshot_runs: usize,
    /// Number of full-order runs that verified the surrogate, at parameters outside the training set.
    pub verification_runs: usize,
    /// Largest relative distance, in the energy norm, of a verification field from the span of the modes.
    pub max_projection_error: f64,
    /// Largest difference of a reduced from a full-order trajectory, relative to the amplitude of the full-order trajectory.
    pub max_relative_error: f64,
    /// Number of unknowns of the full-order model.
    pub fe_unknowns: usize,
}

impl Training<'_> {
    fn creep_compliance(&self, law_parameters: &[f64]) -> Result<CreepCompliance> {
        self.law.creep_compliance(law_parameters).ok_or_else(|| {
            Error::numerical(
                format!("the {} law is not a finite sum of exponentials", self.law.title()),
                "train the modes with a law of springs and dashpots, as they do not depend on the law",
            )
        })
    }
}

/// Full-order run with its parameters, its trajectory and some of its fields.
struct FullRun {
    law_parameters: Vec<f64>,
    poisson_ratio: f64,
    position_m: Vec<f64>,
    fields: Vec<Vec<f64>>,
}

impl Surrogate {
    /// Trains a surrogate on full-order runs at Sobol points, and verifies it on runs at later points of the sequence.
    pub fn train(stiffness: &Stiffness, training: &Training) -> Result<Self> {
        let runs = |indices: std::ops::Range<u32>| -> Result<Vec<FullRun>> {
            let [lower, upper] = training.poisson_ratio;
            if lower == upper {
                let model = FullOrderModel::new(stiffness, lower)?;
                let load = model.solve_load(training.time_s, training.force);
                return indices.into_par_iter().map(|i| full_run(training, i, &model, &load)).collect();
            }
            indices
                .into_par_iter()
                .map(|i| {
                    let model = FullOrderModel::new(stiffness, design_point(training, i).1)?;
                    let load = model.solve_load(training.time_s, training.force);
                    full_run(training, i, &model, &load)
                })
                .collect()
        };
        let middle = 0.5 * (training.poisson_ratio[0] + training.poisson_ratio[1]);
        let energy_matrix = stiffness.assembly.unit_stiffness(middle);
        let energy = EnergyProduct(energy_matrix.as_ref());
        let snapshots: Vec<Vec<f64>> = runs(0..TRAINING_RUNS)?.into_iter().flat_map(|run| run.fields).collect();
        let pod = Pod::new(&snapshots, energy, training.tolerance)?;
        let share = stiffness.assembly.unknowns.share();
        let operators = ReducedOperators::project(&stiffness.assembly, &pod.modes, share);
        let mut surrogate = Self {
            parameters: training.parameters.to_vec(),
            poisson_ratio: TrainedRange {
                name: "poisson_ratio".into(),
                lower: training.poisson_ratio[0],
                upper: training.poisson_ratio[1],
            },
            operators,
            singular_values: pod.singular_values.iter().map(|s| s / pod.singular_values[0]).collect(),
            tolerance: training.tolerance,
            snapshot_runs: TRAINING_RUNS as usize,
            verification_runs: VERIFICATION_RUNS as usize,
            max_projection_error: 0.0,
            max_relative_error: 0.0,
            fe_unknowns: stiffness.n_unknowns(),
        };
        for run in runs(TRAINING_RUNS..TRAINING_RUNS + VERIFICATION_RUNS)? {
            surrogate.verify(training, &run, &pod, energy)?;
        }
        Ok(surrogate)
    }

    /// Displacement of the robot per unit force at unit creep compliance, in 1/m. It returns an error for Poisson ratios outside
    /// the trained range.
    pub fn compliance_per_m(&self, poisson_ratio: f64) -> Result<f64> {
        Ok(self.dual_compliance_per_m(Dual::constant(poisson_ratio))?.value)
    }

    fn dual_compliance_per_m(&self, poisson_ratio: Dual) -> Result<Dual> {
        if !self.poisson_ratio.contains(poisson_ratio.value) {
            return Err(Error::OutsideTrainedRange {
                parameter: self.poisson_ratio.name.clone(),
                value: poisson_ratio.value,
                lower: self.poisson_ratio.lower,
                upper: self.poisson_ratio.upper,
            });
        }
        self.operators.dual_compliance_per_m(poisson_ratio)
    }

    /// Returns the compliance as a function of the Poisson ratio. `poisson_ratio` is the ratio of the experiment.
    pub fn compliance(&self, poisson_ratio: f64) -> Result<Compliance> {
        let per_m = self.compliance_per_m(poisson_ratio)?;
        let family = self.clone();
        Ok(Compliance::family(per_m, move |ratio| family.dual_compliance_per_m(ratio)))
    }

    /// Returns `true` if all data of the surrogate are consistent. Data from an edited file may be inconsistent.
    pub fn is_whole(&self) -> bool {
        let range_is_sound = |range: &TrainedRange| range.lower.is_finite() && range.lower <= range.upper;
        self.operators.is_whole()
            && !self.singular_values.is_empty()
            && self.parameters.iter().chain([&self.poisson_ratio]).all(range_is_sound)
    }

    /// Number of modes of the surrogate.
    pub fn n_modes(&self) -> usize {
        self.operators.n_modes
    }

    /// Compares the surrogate with a full-order run. The projection error of the modes and the error of the trajectory are stored
    /// separately.
    fn verify(&mut self, training: &Training, run: &FullRun, pod: &Pod, energy: EnergyProduct) -> Result<()> {
        for field in &run.fields {
            let norm = energy.norm(field);
            if norm == 0.0 {
                continue;
            }
            let image = energy.apply(field);
            let mut rest = field.clone();
            for mode in &pod.modes {
                let share = pod::dot(mode, &image);
                rest.iter_mut().zip(mode).for_each(|(r, m)| *r -= share * m);
            }
            self.max_projection_error = self.max_projection_error.max(energy.norm(&rest) / norm);
        }
        let law = training.creep_compliance(&run.law_parameters)?;
        let reduced = convolve_m(self.compliance_per_m(run.poisson_ratio)?, &law, training.time_s, training.force);
        let amplitude = run.position_m.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
        let distance = reduced.iter().zip(&run.position_m).fold(0.0_f64, |d, (r, x)| d.max((r - x).abs()));
        if amplitude > 0.0 {
            self.max_relative_error = self.max_relative_error.max(distance / amplitude);
        }
        Ok(())
    }
}

/// Returns the law's parameters and the Poisson ratio at one Sobol point.
fn design_point(training: &Training, index: u32) -> (Vec<f64>, f64) {
    let coordinate = |dimension: u32| f64::from(sobol_burley::sample(index, dimension, DESIGN_SEED));
    let law_parameters = training.parameters.iter().zip(0_u32..);
    let law_parameters = law_parameters
        .map(|(range, d)| (range.lower.ln() + coordinate(d) * (range.upper / range.lower).ln()).exp())
        .collect();
    let [lower, upper] = training.poisson_ratio;
    (law_parameters, lower + coordinate(training.parameters.len() as u32) * (upper - lower))
}

fn full_run(training: &Training, index: u32, model: &FullOrderModel, load: &SolvedLoad) -> Result<FullRun> {
    let (law_parameters, poisson_ratio) = design_point(training, index);
    let law = training.creep_compliance(&law_parameters)?;
    let n_rows = training.time_s.len();
    let rows: Vec<usize> = (1..=FIELDS_PER_RUN).map(|k| k * (n_rows - 1) / FIELDS_PER_RUN).collect();
    Ok(FullRun {
        position_m: model.trajectory(load, &law, TimeScheme::Exponential),
        fields: model.fields(load, &law, &rows),
        law_parameters,
        poisson_ratio,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use elements::mesh::QuarterBall;

    fn stiffness(n_per_edge: usize, n_layers: usize) -> Stiffness {
        let ball = QuarterBall { robot_radius_m: 0.275e-3, outer_radius_m: 10e-3, n_per_edge, n_layers };
        Stiffness::new(&ball.mesh().expect("sizes are good")).expect("the mesh is good")
    }

    fn ranges() -> Vec<TrainedRange> {
        let range = |name: &str, lower, upper| TrainedRange { name: name.into(), lower, upper };
        vec![
            range("young_modulus_pa", 0.1, 50.0),
            range("viscosity_1_pa_s", 0.05, 20.0),
            range("viscosity_2_pa_s", 2.0, 900.0),
        ]
    }

    fn train_on(n_per_edge: usize, n_layers: usize, poisson_ratio: [f64; 2], tolerance: f64) -> (Stiffness, Surrogate) {
        let time_s: Vec<f64> = (0..=200).map(|i| 0.05 * f64::from(i)).collect();
        let force_n: Vec<f64> = (0..=200).map(|i| if i < 100 { 4.6e-6 } else { -4.6e-6 }).collect();
        let stiffness = stiffness(n_per_edge, n_layers);
        let parameters = ranges();
        let training = Training {
            law: BaseLaw::Lethersich,
            parameters: &parameters,
            poisson_ratio,
            time_s: &time_s,
            force: (&force_n).into(),
            tolerance,
        };
        let surrogate = Surrogate::train(&stiffness, &training).expect("training succeeds");
        (stiffness, surrogate)
    }

    #[test]
    fn one_mode_is_exact_for_the_base_model() {
        let (_, surrogate) = train_on(1, 6, [0.48, 0.48], 1e-8);
        assert_eq!(surrogate.n_modes(), 1);
        assert!(surrogate.max_relative_error < 1e-11, "{}", surrogate.max_relative_error);
        assert!(surrogate.max_projection_error < 1e-7, "{}", surrogate.max_projection_error);
    }

    /// Checks that the fields over a range of Poisson ratios have three modes (physics §3.4). The fourth singular value is a
    /// discretisation error, which decreases as the mesh is refined.
    #[test]
    fn poisson_family_has_three_modes() {
        let (_, surrogate) = train_on(1, 6, [0.3, 0.499], 1e-4);
        assert_eq!(surrogate.n_modes(), 3, "{:?}", &surrogate.singular_values[..6]);
        let (stiffness, finer) = train_on(2, 8, [0.3, 0.499], 1e-4);
        assert!(finer.singular_values[3] < 0.4 * surrogate.singular_values[3], "{:?}", &finer.singular_values[..6]);
        assert!(finer.max_relative_error < 1e-8 && finer.max_projection_error < 1e-4);
        // No snapshot has these ratios. The compliance converges twice as fast as the field.
        for poisson_ratio in [0.31, 0.42, 0.495] {
            let full = FullOrderModel::new(&stiffness, poisson_ratio).expect("positive definite").compliance_per_m();
            let reduced = finer.compliance_per_m(poisson_ratio).expect("inside the trained range");
            assert!((reduced / full - 1.0).abs() < 1e-7, "{poisson_ratio}: {reduced} against {full}");
        }
    }

    /// Checks that both reported errors of a surrogate with too few modes are large. The error of the trajectory is the square of
    /// the error of the field.
    #[test]
    fn a_truncated_family_reports_its_errors() {
        let (_, surrogate) = train_on(1, 6, [0.3, 0.499], 0.05);
        assert_eq!(surrogate.n_modes(), 2, "{:?}", &surrogate.singular_values[..4]);
        let (field, trajectory) = (surrogate.max_projection_error, surrogate.max_relative_error);
        assert!(field > 1e-3 && field < 0.1, "{field}");
        assert!(trajectory > 0.05 * field * field && trajectory < 20.0 * field * field, "{trajectory} with {field}");
    }

    #[test]
    fn queries_outside_the_trained_range_are_refused() {
        let (_, surrogate) = train_on(1, 6, [0.48, 0.48], 1e-8);
        assert!(matches!(surrogate.compliance_per_m(0.45), Err(Error::OutsideTrainedRange { .. })));
    }

    #[test]
    fn modes_are_orthonormal_and_keep_the_snapshots_energy() {
        let stiffness = stiffness(1, 6);
        let matrix = stiffness.assembly.unit_stiffness(0.4);
        let energy = EnergyProduct(matrix.as_ref());
        let snapshots: Vec<Vec<f64>> =
            [0.1, 0.3, 0.45, 0.49].map(|nu| stiffness.factor(nu).expect("positive definite").unit_response()).to_vec();
        let pod = Pod::new(&snapshots, energy, 0.0).expect("snapshots are not zero");
        for (i, u) in pod.modes.iter().enumerate() {
            for (j, v) in pod.modes.iter().enumerate() {
                let product = pod::dot(u, &energy.apply(v));
                assert!((product - f64::from(u8::from(i == j))).abs() < 1e-9, "({i}, {j}): {product}");
            }
        }
        // The squared singular values of unit-energy snapshots add up to the number of snapshots.
        let total: f64 = pod.singular_values.iter().map(|s| s * s).sum();
        assert!((total - 4.0).abs() < 1e-12, "{total}");
    }
}
