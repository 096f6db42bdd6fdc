//! Check of posterior draws by full finite elements, and comparison with the reduced model.

use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Gamma};

use super::prepared::PreparedModel;
use super::problem::Problem;
use crate::noise::NoiseModel;
use base::error::Result;
use elements::fe::strain::largest_principal_strain;
use models::model::{Forward, FullRun};
use sampling::pareto::pareto_k;

/// Number of posterior draws that are run in full finite elements.
pub const N_CHECK_DRAWS: usize = 128;
/// Number of posterior draws that are run in full finite elements if each run takes minutes.
const N_SLOW_DRAWS: usize = 2;
/// Largest percentage of refused draws that causes no warning. A draw is refused if the model fails for it on the whole record.
const LARGEST_REFUSED_PERCENT: usize = 5;
/// Number of normal distributions whose mixture approximates a Student-t distribution.
const STUDENT_COMPONENTS: usize = 8;

/// A posterior draw in the parameters' units: values of the model's parameters, then of the noise parameters.
pub type NaturalDraw = Vec<f64>;

/// Predictions of posterior draws by full finite elements, with measures of the reduced model's error.
pub struct FullCheck {
    /// Draws for which the model could be computed on the whole record.
    pub draws: Vec<NaturalDraw>,
    /// Number of draws for which the model failed, if there are enough of them for a warning; otherwise `None`.
    pub n_refused: Option<usize>,
    /// Predicted position (m) of each draw at every row, by the full-order model or the external program. For an instrument, and if full runs are slow, the reduced
    /// model predicts it.
    pub trajectories_m: Vec<Vec<f64>>,
    /// Noise model and noise parameters of each draw.
    pub noise: DrawnNoise,
    /// Largest distance between a reduced and a full-order trajectory, in m; `None` without a full-order model.
    pub surrogate_vs_full_max_m: Option<f64>,
    /// Pareto k̂ of the importance weights; large values mean that a few weights dominate.
    pub pareto_k: Option<f64>,
    /// Importance weight of each draw: full-order likelihood divided by reduced likelihood, normalised to the sum 1.
    pub weights: Option<Vec<f64>>,
    /// Number of full-order runs, or of predictions of an external program.
    pub fe_runs: usize,
    /// Largest absolute principal strain of the gel at the row with the largest mean displacement.
    pub largest_strain: Option<f64>,
    /// Largest displacement error of the mean trajectory due to the mesh, in m; `None` if unknown.
    pub discretisation_m: Option<f64>,
}

/// Noise of each posterior draw.
pub struct DrawnNoise {
    /// Noise model that all draws share.
    pub model: NoiseModel,
    /// Values of the noise parameters of each draw, in their units.
    pub parameters: Vec<Vec<f64>>,
    /// Standard deviation (m) of the noise of each draw at each row.
    pub sd_m: Vec<Vec<f64>>,
    /// Standard deviations of the normal components of each draw's noise, in units of `sd_m`. The components have equal weight. Normal noise has one component;
    /// Student-t noise has several.
    pub components: Vec<Vec<f64>>,
}

impl DrawnNoise {
    fn new(problem: &Problem, draws: &[NaturalDraw], trajectories_m: &[Vec<f64>]) -> Self {
        let (n_model, model, record) = (problem.model.parameters().len(), problem.noise, &problem.experiment.record);
        let parameters: Vec<Vec<f64>> = draws.iter().map(|draw| draw[n_model..].to_vec()).collect();
        let pairs = parameters.par_iter().zip(trajectories_m);
        let recordings = problem.recordings();
        let sd_m = pairs.map(|(values, x)| model.marginal_sd_m(&record.time_s, &recordings, x, values)).collect();
        let components = parameters.iter().map(|parameter| normal_components(model.student_dof(parameter))).collect();
        Self { model, parameters, sd_m, components }
    }
}

/// Standard deviations of the normal components of noise with unit variance. A Student-t distribution is a normal distribution whose precision has a gamma
/// distribution. A few quantiles of the gamma distribution approximate it.
fn normal_components(student_dof: Option<f64>) -> Vec<f64> {
    let gamma = student_dof.and_then(|dof| Some((dof, Gamma::new(0.5 * dof, 0.5 * dof).ok()?)));
    let Some((dof, gamma)) = gamma else { return vec![1.0] };
    let scale = ((dof - 2.0) / dof).sqrt();
    let probability = |i: usize| (i as f64 + 0.5) / STUDENT_COMPONENTS as f64;
    (0..STUDENT_COMPONENTS).map(|i| scale / gamma.inverse_cdf(probability(i)).sqrt()).collect()
}

/// Runs the full-order model and the reduced model for every draw over the whole record. If full runs are slow (seconds to minutes, for effects that solve for a
/// field), the reduced model predicts instead. The full-order model then runs for two draws only.
///
/// # Errors
/// [`base::Error::Numerical`] if no draw has a model on the whole record; errors of the full-order and the reduced model.
pub fn check(prepared: &PreparedModel, draws: &[NaturalDraw]) -> Result<FullCheck> {
    let problem = &prepared.problem;
    let n_rows = problem.experiment.record.n_rows();
    let (reduced_forward, full) = (prepared.local_forward(n_rows), problem.full_forward()?);
    let n_model = problem.model.parameters().len();
    let is_slow = problem.model.field().is_some();
    let outside = problem.outside_forward();
    let predicting: &dyn Forward = match (&outside, &full) {
        (Some(outside), _) => outside,
        (None, Some(full)) if !is_slow => full,
        _ => &reduced_forward,
    };
    let Runs { draws, trajectories_m, n_refused } = run_all(predicting, draws, n_model)?;
    let noise = DrawnNoise::new(problem, &draws, &trajectories_m);
    let Some(full) = full else {
        let by_surrogate = |draw: &NaturalDraw| reduced_forward.trajectory_m(&draw[..n_model]);
        let beside: Option<Result<Vec<Vec<f64>>>> = outside.map(|_| draws.par_iter().map(by_surrogate).collect());
        let beside_m = beside.transpose()?;
        let ln_weights = beside_m.as_deref().map(|beside_m| ln_weights(problem, &draws, &trajectories_m, beside_m));
        return Ok(FullCheck {
            n_refused,
            surrogate_vs_full_max_m: beside_m.as_deref().map(|beside_m| largest_distance_m(&trajectories_m, beside_m)),
            pareto_k: ln_weights.as_deref().map(pareto_k),
            weights: ln_weights.as_deref().map(normalised),
            fe_runs: beside_m.map_or(0, |beside_m| beside_m.len()),
            noise,
            draws,
            trajectories_m,
            largest_strain: problem.experiment.largest_strain,
            discretisation_m: None,
        });
    };
    let mean_m = mean_trajectory(&trajectories_m, None);
    let (extreme_row, amplitude_m) =
        mean_m.iter().enumerate().fold((0, 0.0), |(row, a), (i, x)| if x.abs() > a { (i, x.abs()) } else { (row, a) });
    let middle = median_draw(&trajectories_m, extreme_row);
    let compared: Vec<usize> = if is_slow {
        let others = (0..draws.len()).filter(|draw| *draw != middle);
        std::iter::once(middle).chain(others).take(N_SLOW_DRAWS).collect()
    } else {
        (0..draws.len()).collect()
    };
    let parameters = |draw: usize| &draws[draw][..n_model];
    let strain = |run: &FullRun| largest_strain(problem, run);
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

/// Draws for which the model could be computed, with their trajectories.
struct Runs {
    draws: Vec<NaturalDraw>,
    trajectories_m: Vec<Vec<f64>>,
    n_refused: Option<usize>,
}

/// Runs every draw over the whole record. Draws for which the model fails are left out: beyond the fitted rows the robot may move farther than the model allows.
///
/// # Errors
/// [`base::Error::Numerical`] if no draw remains.
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

fn largest_distance_m(some_m: &[Vec<f64>], others_m: &[Vec<f64>]) -> f64 {
    let pairs = some_m.iter().zip(others_m).flat_map(|(some, others)| some.iter().zip(others));
    pairs.fold(0.0, |most, (x, y)| most.max((x - y).abs()))
}

/// Index of the draw whose position at this row is the median of all draws.
fn median_draw(trajectories_m: &[Vec<f64>], row: usize) -> usize {
    let mut order: Vec<usize> = (0..trajectories_m.len()).collect();
    order.sort_by(|a, b| trajectories_m[*a][row].total_cmp(&trajectories_m[*b][row]));
    order[order.len() / 2]
}

/// Largest absolute principal strain of a full-order run, in its first displacement field. `None` without a field, or if the model itself has large strains.
pub(crate) fn largest_strain(problem: &Problem, run: &FullRun) -> Result<Option<f64>> {
    let Some(fe) = problem.finite_elements() else { return Ok(None) };
    // The displacement fields of a run belong to the model of small strains, so they do not give large strains.
    if problem.model.field().is_some_and(|(_, field)| field.is_learnt_for_record()) {
        return Ok(None);
    }
    let mesh = run.mesh.as_ref().unwrap_or(&fe.mesh);
    run.fields.first().map(|field| largest_principal_strain(mesh, field)).transpose()
}

/// Log importance weight of each draw: log likelihood of the fitted cycles by the full-order model, minus that by the reduced model.
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

/// Mean trajectory (m), weighted if weights are given.
pub fn mean_trajectory(trajectories_m: &[Vec<f64>], weights: Option<&[f64]>) -> Vec<f64> {
    let equal = 1.0 / trajectories_m.len() as f64;
    let mut mean = vec![0.0; trajectories_m.first().map_or(0, Vec::len)];
    for (k, trajectory) in trajectories_m.iter().enumerate() {
        let weight = weights.map_or(equal, |w| w[k]);
        mean.iter_mut().zip(trajectory).for_each(|(m, x)| *m += weight * x);
    }
    mean
}

/// Root mean square distance (m) between model and observed positions, over rows with an observation.
pub fn rmse_m(model_m: &[f64], observed_m: &[Option<f64>]) -> f64 {
    let squares: Vec<f64> = model_m.iter().zip(observed_m).filter_map(|(x, y)| y.map(|y| (y - x).powi(2))).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use statrs::distribution::StudentsT;

    use super::*;
    use crate::mixture::Mixture;

    /// Compares quantiles of the eight-component mixture with those of statrs' Student-t distribution, at the ends of the 50 % and the 90 % band. The quantiles agree
    /// within 4 %.
    #[test]
    fn normal_components_stand_for_a_student_t() {
        for dof in [2.5, 4.0, 30.0] {
            let sd_m: Vec<f64> = normal_components(Some(dof));
            let mixture = Mixture { mean_m: vec![0.0; sd_m.len()], sd_m };
            // This scale gives the exact distribution unit variance.
            let exact = StudentsT::new(0.0, ((dof - 2.0) / dof).sqrt(), dof).expect("a distribution");
            for probability in [0.75, 0.95] {
                let ratio = mixture.quantile(probability) / exact.inverse_cdf(probability);
                assert!((ratio - 1.0).abs() < 0.04, "{dof} {probability}: {ratio}");
            }
        }
        assert_eq!(normal_components(None), [1.0]);
    }
}
