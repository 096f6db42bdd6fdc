//! The posterior checked by full finite elements on cycles that the fit never saw.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Gamma};

use super::joint::{Predicted, joint};
use super::mixture::Mixture;
use super::near_normal::{NearNormal, band_normals, near_normals};
use super::problem::Problem;
use super::reduced::Reduced;
use crate::error::Result;
use crate::experiment::Record;
use crate::fe::strain::largest_principal_strain;
use crate::inference::noise::NoiseModel;
use crate::inference::pareto::pareto_k;
use crate::model::{Forward, FullRun};

/// Posterior draws that full finite elements are run for.
pub const N_CHECK_DRAWS: usize = 128;
/// Draws run in full where that takes minutes each.
const N_SLOW_DRAWS: usize = 2;
/// Simulated measurements that the misfit and the coverage are judged by.
const N_SIMULATIONS: usize = 8_000;
/// Fewer for long records, to so many simulated positions in all, but never fewer than resolve the 99.9 % band. Where that is more, and errors are
/// independent and normal, closed forms take their place.
const SIMULATED_POSITIONS: usize = 40_000_000;
const FEWEST_SIMULATIONS: usize = 4_000;
/// Rows whose predictions are worked out together.
const ROWS_OF_BLOCK: usize = 1024;
/// Stream of the simulations, apart from the sampler's.
const SIMULATION_STREAM: u64 = u64::MAX;

/// Draws that may have no model on the whole record, of every hundred, before the user is told.
const LARGEST_REFUSED_PERCENT: usize = 5;
/// Normal components that stand for a Student-t.
const STUDENT_COMPONENTS: usize = 8;

/// A posterior draw in natural units: the model's parameters, then the noise's.
pub type NaturalDraw = Vec<f64>;

/// What full finite elements said about a posterior.
pub struct FullCheck {
    /// The draws that were run.
    pub draws: Vec<NaturalDraw>,
    /// Draws that have no model on the whole record, if they are too many to be left out in silence.
    pub n_refused: Option<usize>,
    /// Full trajectory of each draw, in m; the reduced one for an instrument.
    pub trajectories_m: Vec<Vec<f64>>,
    /// The noise of each draw.
    pub noise: DrawnNoise,
    /// Largest distance of the reduced from the full trajectories, in m.
    pub surrogate_vs_full_max_m: Option<f64>,
    /// Pareto k̂ of the importance weights of full over reduced likelihoods.
    pub pareto_k: Option<f64>,
    /// Normalised importance weights.
    pub weights: Option<Vec<f64>>,
    /// Full runs that were made.
    pub fe_runs: usize,
    /// Largest absolute principal strain at the largest mean displacement.
    pub largest_strain: Option<f64>,
    /// Largest difference of the mean trajectory between two meshes, in m.
    pub discretisation_m: Option<f64>,
}

/// The noise of posterior draws.
pub struct DrawnNoise {
    /// Its model.
    pub model: NoiseModel,
    /// Parameters of each draw.
    pub parameters: Vec<Vec<f64>>,
    /// Standard deviation (m) of the noise of each draw at each row.
    pub sd_m: Vec<Vec<f64>>,
    /// Standard deviations, in units of `sd_m`, of the normal components of equal weight that stand for each draw's noise: 1, or some for a
    /// Student-t.
    pub components: Vec<Vec<f64>>,
}

impl DrawnNoise {
    fn new(problem: &Problem, draws: &[NaturalDraw], trajectories_m: &[Vec<f64>]) -> Self {
        let (n_model, model, record) = (problem.model.parameters().len(), problem.noise, &problem.experiment.record);
        let parameters: Vec<Vec<f64>> = draws.iter().map(|draw| draw[n_model..].to_vec()).collect();
        let pairs = parameters.par_iter().zip(trajectories_m);
        let sd_m = pairs.map(|(own, x)| model.marginal_sd_m(&record.time_s, &record.cycle, x, own)).collect();
        let components = parameters.iter().map(|own| normal_components(model.student_dof(own))).collect();
        Self { model, parameters, sd_m, components }
    }
}

/// A t of unit variance is a normal whose precision is a gamma variable's: a few of its quantiles stand for it.
fn normal_components(student_dof: Option<f64>) -> Vec<f64> {
    let gamma = student_dof.and_then(|dof| Some((dof, Gamma::new(0.5 * dof, 0.5 * dof).ok()?)));
    let Some((dof, gamma)) = gamma else { return vec![1.0] };
    let scale = ((dof - 2.0) / dof).sqrt();
    let probability = |i: usize| (i as f64 + 0.5) / STUDENT_COMPONENTS as f64;
    (0..STUDENT_COMPONENTS).map(|i| scale / gamma.inverse_cdf(probability(i)).sqrt()).collect()
}

/// Runs the full model for every draw over the whole record, and the reduced one beside it. Where a full run takes seconds to minutes, as with effects whose
/// field is solved for, the reduced model predicts, and the full one is run beside it for the first few draws.
///
/// # Errors
/// [`crate::Error::Numerical`] when no draw has a model on the whole record; whatever its parts refuse.
pub fn check(problem: &Problem, reduced: &Reduced, draws: &[NaturalDraw]) -> Result<FullCheck> {
    let (reduced_forward, full) = (problem.reduced_forward(reduced), problem.full_forward()?);
    let n_model = problem.model.parameters().len();
    let is_slow = problem.model.effects().iter().any(|effect| effect.field_model().is_some());
    let predicting: &dyn Forward = match &full {
        Some(full) if !is_slow => full,
        _ => &reduced_forward,
    };
    let Runs { draws, trajectories_m, n_refused } = run_all(predicting, draws, n_model)?;
    let noise = DrawnNoise::new(problem, &draws, &trajectories_m);
    let Some(full) = full else {
        return Ok(FullCheck {
            n_refused,
            noise,
            draws,
            trajectories_m,
            surrogate_vs_full_max_m: None,
            pareto_k: None,
            weights: None,
            fe_runs: 0,
            largest_strain: None,
            discretisation_m: None,
        });
    };
    let mean_m = mean_trajectory(&trajectories_m, None);
    let (extreme_row, amplitude_m) =
        mean_m.iter().enumerate().fold((0, 0.0), |(row, a), (i, x)| if x.abs() > a { (i, x.abs()) } else { (row, a) });
    let middle = middle_draw(&trajectories_m, extreme_row);
    let compared: Vec<usize> = if is_slow {
        let others = (0..draws.len()).filter(|draw| *draw != middle);
        std::iter::once(middle).chain(others).take(N_SLOW_DRAWS).collect()
    } else {
        (0..draws.len()).collect()
    };
    let parameters = |draw: usize| &draws[draw][..n_model];
    let strain = |run: &FullRun| strain_of(problem, run);
    let (beside_m, largest_strain): (Vec<Vec<f64>>, Option<f64>) = if is_slow {
        let rows = [extreme_row];
        let run = |draw: &usize| full.run(parameters(*draw), if *draw == middle { &rows } else { &[] });
        let runs: Vec<FullRun> = compared.par_iter().map(run).collect::<Result<_>>()?;
        let largest = runs.first().map(strain).transpose()?.flatten();
        (runs.into_iter().map(|run| run.position_m).collect(), largest)
    } else {
        let reduced = compared.par_iter().map(|draw| reduced_forward.trajectory_m(parameters(*draw)));
        (reduced.collect::<Result<_>>()?, strain(&full.run(parameters(middle), &[extreme_row])?)?)
    };
    let distance = |(draw, b): (&usize, &Vec<f64>)| {
        trajectories_m[*draw].iter().zip(b).fold(0.0_f64, |d, (x, y)| d.max((x - y).abs()))
    };
    let surrogate_vs_full_max_m = compared.iter().zip(&beside_m).map(distance).fold(0.0, f64::max);
    let ln_weights = (!is_slow).then(|| ln_weights(problem, &draws, &trajectories_m, &beside_m));
    let comparison = problem.finite_elements().and_then(|fe| fe.comparison);
    let relative_error = comparison.map(|other| other.relative_error(full.compliance_per_m()).abs());
    Ok(FullCheck {
        noise,
        fe_runs: compared.len(),
        draws,
        n_refused,
        trajectories_m,
        surrogate_vs_full_max_m: Some(surrogate_vs_full_max_m),
        pareto_k: ln_weights.as_deref().map(pareto_k),
        weights: ln_weights.as_deref().map(normalised),
        largest_strain,
        discretisation_m: relative_error.map(|error| amplitude_m * error),
    })
}

/// Draws with their trajectories.
struct Runs {
    draws: Vec<NaturalDraw>,
    trajectories_m: Vec<Vec<f64>>,
    n_refused: Option<usize>,
}

/// Runs every draw over the whole record. Those that the model refuses there, since they go farther than on the fitted rows, are left out.
///
/// # Errors
/// [`crate::Error::Numerical`] when none is left.
fn run_all(forward: &dyn Forward, draws: &[NaturalDraw], n_model: usize) -> Result<Runs> {
    let runs: Vec<Result<Vec<f64>>> = draws.par_iter().map(|draw| forward.trajectory_m(&draw[..n_model])).collect();
    let n_refused = runs.iter().filter(|run| run.is_err()).count();
    let is_few = 100 * n_refused <= LARGEST_REFUSED_PERCENT * draws.len();
    let n_refused_told = (!is_few).then_some(n_refused);
    let mut kept = Runs { draws: Vec::new(), trajectories_m: Vec::new(), n_refused: n_refused_told };
    for (draw, run) in draws.iter().zip(runs) {
        match run {
            Ok(trajectory_m) => {
                kept.draws.push(draw.clone());
                kept.trajectories_m.push(trajectory_m);
            }
            Err(error) if n_refused == draws.len() => return Err(error),
            Err(_) => {}
        }
    }
    Ok(kept)
}

/// The draw whose position at a row is the median.
fn middle_draw(trajectories_m: &[Vec<f64>], row: usize) -> usize {
    let mut order: Vec<usize> = (0..trajectories_m.len()).collect();
    order.sort_by(|a, b| trajectories_m[*a][row].total_cmp(&trajectories_m[*b][row]));
    order[order.len() / 2]
}

fn strain_of(problem: &Problem, run: &FullRun) -> Result<Option<f64>> {
    let Some(fe) = problem.finite_elements() else { return Ok(None) };
    let mesh = run.mesh.as_ref().unwrap_or(&fe.mesh);
    run.fields.first().map(|field| largest_principal_strain(mesh, field)).transpose()
}

/// Logarithms of full over reduced likelihood of the calibration cycles.
fn ln_weights(problem: &Problem, draws: &[NaturalDraw], full_m: &[Vec<f64>], reduced_m: &[Vec<f64>]) -> Vec<f64> {
    let likelihood = problem.noise_likelihood(&problem.experiment.calibration_cycles);
    let n_model = problem.model.parameters().len();
    let runs = draws.par_iter().zip(full_m.par_iter().zip(reduced_m));
    runs.map(|(draw, (full, reduced))| {
        let noise = &draw[n_model..];
        likelihood.ln_likelihood(full, noise) - likelihood.ln_likelihood(reduced, noise)
    })
    .collect()
}

fn normalised(ln_weights: &[f64]) -> Vec<f64> {
    let top = ln_weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = ln_weights.iter().map(|w| (w - top).exp()).collect();
    let total: f64 = weights.iter().sum();
    weights.iter().map(|w| w / total).collect()
}

/// Mean over trajectories, weighted if weights are given.
pub fn mean_trajectory(trajectories_m: &[Vec<f64>], weights: Option<&[f64]>) -> Vec<f64> {
    let equal = 1.0 / trajectories_m.len() as f64;
    let mut mean = vec![0.0; trajectories_m.first().map_or(0, Vec::len)];
    for (k, trajectory) in trajectories_m.iter().enumerate() {
        let weight = weights.map_or(equal, |w| w[k]);
        mean.iter_mut().zip(trajectory).for_each(|(m, x)| *m += weight * x);
    }
    mean
}

/// Probabilities of the quantiles that bands are made of.
pub const BAND_PROBABILITIES: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];

/// Predictive quantiles (m) of every row, in the order of [`BAND_PROBABILITIES`].
pub fn bands_m(check: &FullCheck) -> Vec<[f64; 5]> {
    let normals = band_normals();
    let near = |near: &NearNormal| normals.map(|z| near.quantile_m(z));
    let far = |mixture: Mixture| BAND_PROBABILITIES.map(|p| mixture.quantile(p));
    by_blocks(check, &|_, prediction| match prediction {
        Prediction::Near(normal) => near(&normal),
        Prediction::Far(mixture) => far(mixture),
    })
}

/// The predictive distribution of one position.
enum Prediction {
    Near(NearNormal),
    Far(Mixture),
}

/// What follows from every row's prediction, in the order of the rows.
fn by_blocks<T: Send>(check: &FullCheck, of: &(dyn Fn(usize, Prediction) -> T + Sync)) -> Vec<T> {
    let n_rows = check.trajectories_m.first().map_or(0, Vec::len);
    let block = |index: usize| {
        let rows = index * ROWS_OF_BLOCK..n_rows.min((index + 1) * ROWS_OF_BLOCK);
        let found = near_normals(check, rows.clone());
        let prediction = |row: usize, near: Option<NearNormal>| {
            near.map_or_else(|| Prediction::Far(mixture(check, row)), Prediction::Near)
        };
        rows.zip(found).map(|(row, near)| of(row, prediction(row, near))).collect::<Vec<T>>()
    };
    let blocks: Vec<Vec<T>> = (0..n_rows.div_ceil(ROWS_OF_BLOCK)).into_par_iter().map(block).collect();
    blocks.into_iter().flatten().collect()
}

pub(super) fn mixture(check: &FullCheck, row: usize) -> Mixture {
    let mut mixture = Mixture { mean_m: Vec::new(), sd_m: Vec::new() };
    for (k, trajectory) in check.trajectories_m.iter().enumerate() {
        for component in &check.noise.components[k] {
            mixture.mean_m.push(trajectory[row]);
            mixture.sd_m.push(component * check.noise.sd_m[k][row]);
        }
    }
    mixture
}

/// How well predictions and positions of some rows agree.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    /// Root mean square distance of the posterior mean from the positions, in m.
    pub rmse_m: f64,
    /// Fractions of positions inside the central 50 % and 90 % bands.
    pub coverage: [f64; 2],
    /// Range in which 99 % of simulated measurements have their coverage.
    pub coverage_expected: [[f64; 2]; 2],
    /// Probability of a misfit at least as large, by joint simulation: the smaller of that of the largest standardised deviation and of their mean
    /// square, doubled.
    pub joint_p: f64,
    /// Mean continuous ranked probability score, in m.
    pub crps_m: f64,
}

/// Scores the held-out rows; `None` if there are none with a position.
///
/// `record` gives times and cycles; `observed_m` the positions to score.
pub fn score(
    check: &FullCheck,
    bands_m: &[[f64; 5]],
    record: &Record,
    observed_m: &[Option<f64>],
    seed: u64,
) -> Option<Score> {
    let rows: Vec<(usize, f64)> = observed_m.iter().enumerate().filter_map(|(i, y)| y.map(|y| (i, y))).collect();
    if rows.is_empty() {
        return None;
    }
    let n = rows.len() as f64;
    let n_simulations = (SIMULATED_POSITIONS / rows.len()).clamp(FEWEST_SIMULATIONS, N_SIMULATIONS);
    let of_row = |row: usize, prediction: Prediction| {
        let y = observed_m[row]?;
        Some(match prediction {
            Prediction::Near(normal) => ((normal.mean_m, normal.sd_m), normal.crps_m(y)),
            Prediction::Far(mixture) => ((mixture.mean(), mixture.sd()), mixture.crps(y)),
        })
    };
    let (centre, scores): (Vec<(f64, f64)>, Vec<f64>) = by_blocks(check, &of_row).into_iter().flatten().unzip();
    let squares: f64 = rows.iter().zip(&centre).map(|((_, y), (mean, _))| (y - mean).powi(2)).sum();
    let crps: f64 = scores.iter().sum();
    let statistics = |position: &dyn Fn(usize) -> f64| {
        let (mut largest, mut square, mut inside) = (0.0_f64, 0.0, [0.0; 2]);
        for (k, (row, _)) in rows.iter().enumerate() {
            let y = position(k);
            let z = (y - centre[k].0) / centre[k].1;
            largest = largest.max(z.abs());
            square += z * z;
            let [lower_90, lower_50, _, upper_50, upper_90] = bands_m[*row];
            inside[0] += f64::from(u8::from(y >= lower_50 && y <= upper_50));
            inside[1] += f64::from(u8::from(y >= lower_90 && y <= upper_90));
        }
        [largest, square / n, inside[0] / n, inside[1] / n]
    };
    let found = statistics(&|k| rows[k].1);
    let scored = |coverage_expected: [[f64; 2]; 2], p_largest: f64, p_square: f64| Score {
        rmse_m: (squares / n).sqrt(),
        coverage: [found[2], found[3]],
        coverage_expected,
        joint_p: (2.0 * p_largest.min(p_square)).min(1.0),
        crps_m: crps / n,
    };
    if n_simulations * rows.len() > SIMULATED_POSITIONS && check.noise.model == NoiseModel::default() {
        let places: Vec<usize> = rows.iter().map(|(row, _)| *row).collect();
        let joint = joint(&Predicted { check, rows: &places, centre: &centre, bands_m }, found[0], found[1]);
        return Some(scored(joint.coverage, joint.p_largest, joint.p_square));
    }
    let time_s: Vec<f64> = rows.iter().map(|(row, _)| record.time_s[*row]).collect();
    let cycle: Vec<u32> = rows.iter().map(|(row, _)| record.cycle[*row]).collect();
    let simulated: Vec<[f64; 4]> = (0..n_simulations)
        .into_par_iter()
        .map(|simulation| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(SIMULATION_STREAM - simulation as u64);
            let draw = rng.random_range(0..check.trajectories_m.len());
            let position_m: Vec<f64> = rows.iter().map(|(row, _)| check.trajectories_m[draw][*row]).collect();
            let parameters = &check.noise.parameters[draw];
            let noise_m = check.noise.model.simulate_m(&time_s, &cycle, &position_m, parameters, &mut rng);
            statistics(&|k| position_m[k] + noise_m[k])
        })
        .collect();
    let at_least = |s: usize| simulated.iter().filter(|v| v[s] >= found[s]).count();
    let p = |s: usize| (1 + at_least(s)) as f64 / (1 + n_simulations) as f64;
    let range = |s: usize| {
        let mut values: Vec<f64> = simulated.iter().map(|v| v[s]).collect();
        values.sort_by(f64::total_cmp);
        [values[n_simulations / 200], values[n_simulations - 1 - n_simulations / 200]]
    };
    Some(scored([range(2), range(3)], p(0), p(1)))
}

#[cfg(test)]
#[path = "heldout_noise_tests.rs"]
mod noise_tests;
#[cfg(test)]
mod tests {
    use statrs::distribution::StudentsT;

    use super::*;

    fn gaussian_check(n_rows: usize, noise_sd_m: f64) -> FullCheck {
        let noise = DrawnNoise {
            model: NoiseModel::default(),
            parameters: vec![vec![1e6 * noise_sd_m]; 4],
            sd_m: vec![vec![noise_sd_m; n_rows]; 4],
            components: vec![vec![1.0]; 4],
        };
        FullCheck {
            draws: Vec::new(),
            n_refused: None,
            trajectories_m: vec![(0..n_rows).map(|i| 1e-4 * (i as f64 * 0.1).sin()).collect(); 4],
            noise,
            surrogate_vs_full_max_m: None,
            pareto_k: None,
            weights: None,
            fe_runs: 0,
            largest_strain: None,
            discretisation_m: None,
        }
    }

    /// Bands of a heavy-tailed noise: its 50 % and 90 % quantiles against statrs' Student-t. Eight components leave a few per cent.
    #[test]
    fn normal_components_stand_for_a_student_t() {
        for dof in [2.5, 4.0, 30.0] {
            let sd_m: Vec<f64> = normal_components(Some(dof));
            let mixture = Mixture { mean_m: vec![0.0; sd_m.len()], sd_m };
            // Of unit variance.
            let exact = StudentsT::new(0.0, ((dof - 2.0) / dof).sqrt(), dof).expect("a distribution");
            for probability in [0.75, 0.95] {
                let ratio = mixture.quantile(probability) / exact.inverse_cdf(probability);
                assert!((ratio - 1.0).abs() < 0.04, "{dof} {probability}: {ratio}");
            }
        }
        assert_eq!(normal_components(None), [1.0]);
    }

    /// Data from the predictive distribution itself pass; a shift of half a standard deviation over 400 rows, or a single outlier of 7, does
    /// not. 400 positions: the coverages lie in their 99 % ranges for this fixed seed.
    #[test]
    fn joint_check_accepts_its_own_and_rejects_shift_and_outlier() {
        let n_rows = 400;
        let check = gaussian_check(n_rows, 4e-6);
        let bands = bands_m(&check);
        let record = Record {
            time_s: (0..n_rows).map(|i| i as f64).collect(),
            force_n: vec![0.0; n_rows],
            position_m: vec![None; n_rows],
            cycle: vec![1; n_rows],
        };
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let draw = |rng: &mut ChaCha8Rng| -> f64 { rng.sample(rand_distr::StandardNormal) };
        let own: Vec<f64> = (0..n_rows).map(|i| check.trajectories_m[0][i] + 4e-6 * draw(&mut rng)).collect();
        let scored = |values: &dyn Fn(usize) -> f64| {
            let observed: Vec<Option<f64>> = (0..n_rows).map(|i| Some(values(i))).collect();
            score(&check, &bands, &record, &observed, 3).expect("there are positions")
        };
        let good = scored(&|i| own[i]);
        assert!(good.joint_p > 0.01, "{good:?}");
        for (coverage, [lower, upper]) in good.coverage.iter().zip(good.coverage_expected) {
            assert!(*coverage >= lower && *coverage <= upper, "{good:?}");
        }
        assert!(scored(&|i| own[i] + if i % 2 == 0 { 4e-6 } else { -4e-6 }).joint_p < 1e-3);
        assert!(scored(&|i| own[i] + if i == 77 { 28e-6 } else { 0.0 }).joint_p < 1e-3);
        assert!(score(&check, &bands, &record, &vec![None; n_rows], 3).is_none());
    }
}
