//! The posterior checked by full finite elements on cycles that the fit never saw.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use statrs::distribution::{Continuous, ContinuousCDF, Normal};

use super::problem::{Problem, Reduced};
use crate::error::Result;
use crate::fe::strain::largest_principal_strain;
use crate::fe::time::{FullOrderModel, TimeScheme};
use crate::inference::likelihood::ln_likelihood;
use crate::inference::pareto::pareto_k;
use crate::model::{Forward, FullForward};

/// Posterior draws that full finite elements are run for.
pub const N_CHECK_DRAWS: usize = 128;
/// Simulated measurements that the misfit and the coverage are judged by.
const N_SIMULATIONS: usize = 8_000;
/// Fewer for long records, to so many simulated positions in all, but never fewer than resolve the 99.9 % band.
const SIMULATED_POSITIONS: usize = 40_000_000;
const FEWEST_SIMULATIONS: usize = 4_000;
/// Cyclic distances of the pairs of draws that the score's spread is averaged over.
const PAIR_DISTANCES: usize = 8;
/// Stream of the simulations, apart from the sampler's.
const SIMULATION_STREAM: u64 = u64::MAX;

/// A posterior draw in natural units: the law's parameters, then the noise in µm.
pub type NaturalDraw = Vec<f64>;

/// What full finite elements said about a posterior.
pub struct FullCheck {
    /// Full trajectory of each draw, in m; the reduced one for an instrument.
    pub trajectories_m: Vec<Vec<f64>>,
    /// Learnt noise of each draw, in m.
    pub noise_sd_m: Vec<f64>,
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

/// Runs the full model for every draw over the whole record.
pub fn check(problem: &Problem, reduced: &Reduced, draws: &[NaturalDraw]) -> Result<FullCheck> {
    let record = &problem.experiment.record;
    let reduced_forward = problem.reduced_forward(reduced);
    let n_law = problem.law.parameters().len();
    let noise_sd_m: Vec<f64> = draws.iter().map(|draw| 1e-6 * draw[n_law]).collect();
    let reduced_m: Vec<Vec<f64>> =
        draws.par_iter().map(|draw| reduced_forward.trajectory_m(&draw[..n_law])).collect::<Result<_>>()?;
    let Some(fe) = problem.finite_elements() else {
        return Ok(FullCheck {
            trajectories_m: reduced_m,
            noise_sd_m,
            surrogate_vs_full_max_m: None,
            pareto_k: None,
            weights: None,
            fe_runs: 0,
            largest_strain: None,
            discretisation_m: None,
        });
    };
    let model = FullOrderModel::new(&fe.stiffness, fe.poisson_ratio)?;
    let load = model.solve_load(&record.time_s, &record.force_n);
    let full = FullForward { model: &model, load: &load, law: problem.law, scheme: TimeScheme::Exponential };
    let full_m: Vec<Vec<f64>> =
        draws.par_iter().map(|draw| full.trajectory_m(&draw[..n_law])).collect::<Result<_>>()?;
    let distance = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).fold(0.0_f64, |d, (x, y)| d.max((x - y).abs()));
    let surrogate_vs_full_max_m = full_m.iter().zip(&reduced_m).map(distance).fold(0.0, f64::max);
    let ln_weights = ln_weights(problem, draws, &full, &reduced_forward)?;
    let mean_m = mean_trajectory(&full_m, None);
    let (extreme_row, amplitude_m) =
        mean_m.iter().enumerate().fold((0, 0.0), |(row, a), (i, x)| if x.abs() > a { (i, x.abs()) } else { (row, a) });
    let middle = problem.law.creep_compliance(&median_of(draws)[..n_law])?;
    let fields = model.fields(&load, &middle, &[extreme_row]);
    let strain = match fields.first() {
        Some(field) => {
            let nodal = fe.stiffness.assembly.unknowns.nodal_displacement(field);
            Some(largest_principal_strain(&fe.mesh, &nodal)?)
        }
        None => None,
    };
    let compliance_per_m = model.compliance_per_m();
    Ok(FullCheck {
        trajectories_m: full_m,
        noise_sd_m,
        surrogate_vs_full_max_m: Some(surrogate_vs_full_max_m),
        pareto_k: Some(pareto_k(&ln_weights)),
        weights: Some(normalised(&ln_weights)),
        fe_runs: draws.len(),
        largest_strain: strain,
        discretisation_m: fe.comparison.map(|other| amplitude_m * other.relative_error(compliance_per_m).abs()),
    })
}

/// Logarithms of full over reduced likelihood of the calibration cycles.
fn ln_weights(problem: &Problem, draws: &[NaturalDraw], full: &dyn Forward, reduced: &dyn Forward) -> Result<Vec<f64>> {
    let observed = problem.positions_of(&problem.experiment.calibration_cycles);
    let n_law = problem.law.parameters().len();
    let weight = |draw: &NaturalDraw| -> Result<f64> {
        let (law, noise_sd_um) = (&draw[..n_law], draw[n_law]);
        Ok(ln_likelihood(full, &observed, law, noise_sd_um)? - ln_likelihood(reduced, &observed, law, noise_sd_um)?)
    };
    draws.par_iter().map(weight).collect()
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

/// Median of every parameter.
fn median_of(draws: &[NaturalDraw]) -> NaturalDraw {
    let n = draws.first().map_or(0, Vec::len);
    let column = |d: usize| {
        let mut values: Vec<f64> = draws.iter().map(|draw| draw[d]).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    (0..n).map(column).collect()
}

/// Predictive distribution of one position: an equal mixture of Gaussians, one a draw.
struct Mixture<'a> {
    mean_m: Vec<f64>,
    sd_m: &'a [f64],
}

impl Mixture<'_> {
    fn mean(&self) -> f64 {
        self.mean_m.iter().sum::<f64>() / self.mean_m.len() as f64
    }

    fn sd(&self) -> f64 {
        let (n, mean) = (self.mean_m.len() as f64, self.mean());
        let squares = self.mean_m.iter().zip(self.sd_m).map(|(m, s)| (m - mean).powi(2) + s * s);
        (squares.sum::<f64>() / n).sqrt()
    }

    /// Distribution function and density.
    fn cdf_pdf(&self, x: f64) -> (f64, f64) {
        let standard = Normal::standard();
        let n = self.mean_m.len() as f64;
        let (mut cdf, mut pdf) = (0.0, 0.0);
        for (m, s) in self.mean_m.iter().zip(self.sd_m) {
            let t = (x - m) / s;
            cdf += standard.cdf(t);
            pdf += standard.pdf(t) / s;
        }
        (cdf / n, pdf / n)
    }

    /// Quantile by Newton's method inside a bracket that bisection keeps.
    fn quantile(&self, probability: f64) -> f64 {
        let (mean, sd) = (self.mean(), self.sd());
        let (mut lower, mut upper) = (mean - 40.0 * sd, mean + 40.0 * sd);
        let mut x = mean + sd * Normal::standard().inverse_cdf(probability);
        for _ in 0..60 {
            let (cdf, pdf) = self.cdf_pdf(x);
            if cdf < probability {
                lower = x
            } else {
                upper = x
            }
            let newton = x - (cdf - probability) / pdf;
            // Newton's next error is the square of this one.
            if (newton - x).abs() <= 1e-5 * sd {
                return newton;
            }
            let next = if newton > lower && newton < upper { newton } else { 0.5 * (lower + upper) };
            x = next;
        }
        x
    }

    /// Continuous ranked probability score of an observation (Grimit et al. 2006, doi:10.1256/qj.05.235).
    ///
    /// The mean distance between two components' draws is taken over pairs at the first few cyclic distances, which all pairs of a few components
    /// are, instead of over all n².
    fn crps(&self, observed: f64) -> f64 {
        let standard = Normal::standard();
        let spread = |mean: f64, sd: f64| {
            let t = mean / sd;
            2.0 * sd * standard.pdf(t) + mean * (2.0 * standard.cdf(t) - 1.0)
        };
        let n = self.mean_m.len();
        let components = self.mean_m.iter().zip(self.sd_m);
        let to_observed: f64 = components.clone().map(|(m, s)| spread(observed - m, *s)).sum();
        let with_itself: f64 = components.clone().map(|(_, s)| spread(0.0, s * std::f64::consts::SQRT_2)).sum();
        let n_distances = PAIR_DISTANCES.min(n - 1);
        let with_others: f64 = (1..=n_distances)
            .flat_map(|distance| (0..n).map(move |i| (i, (i + distance) % n)))
            .map(|(i, j)| spread(self.mean_m[i] - self.mean_m[j], self.sd_m[i].hypot(self.sd_m[j])))
            .sum();
        let others = if n_distances == 0 { 0.0 } else { with_others / (n * n_distances) as f64 };
        let equal = 1.0 / n as f64;
        to_observed * equal - 0.5 * (equal * equal * with_itself + (1.0 - equal) * others)
    }
}

/// Probabilities of the quantiles that bands are made of.
pub const BAND_PROBABILITIES: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];

/// Predictive quantiles (m) of every row, in the order of [`BAND_PROBABILITIES`].
pub fn bands_m(check: &FullCheck) -> Vec<[f64; 5]> {
    let n_rows = check.trajectories_m.first().map_or(0, Vec::len);
    (0..n_rows)
        .into_par_iter()
        .map(|row| mixture(check, row))
        .map(|m| BAND_PROBABILITIES.map(|p| m.quantile(p)))
        .collect()
}

fn mixture<'a>(check: &'a FullCheck, row: usize) -> Mixture<'a> {
    Mixture { mean_m: check.trajectories_m.iter().map(|t| t[row]).collect(), sd_m: &check.noise_sd_m }
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
pub fn score(check: &FullCheck, bands_m: &[[f64; 5]], observed_m: &[Option<f64>], seed: u64) -> Option<Score> {
    let rows: Vec<(usize, f64)> = observed_m.iter().enumerate().filter_map(|(i, y)| y.map(|y| (i, y))).collect();
    if rows.is_empty() {
        return None;
    }
    let n = rows.len() as f64;
    let n_simulations = (SIMULATED_POSITIONS / rows.len()).clamp(FEWEST_SIMULATIONS, N_SIMULATIONS);
    let mixtures: Vec<Mixture> = rows.iter().map(|(row, _)| mixture(check, *row)).collect();
    let centre: Vec<(f64, f64)> = mixtures.iter().map(|m| (m.mean(), m.sd())).collect();
    let squares: f64 = rows.iter().zip(&centre).map(|((_, y), (mean, _))| (y - mean).powi(2)).sum();
    let crps: f64 = mixtures.par_iter().zip(&rows).map(|(m, (_, y))| m.crps(*y)).collect::<Vec<f64>>().iter().sum();
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
    let simulated: Vec<[f64; 4]> = (0..n_simulations)
        .into_par_iter()
        .map(|simulation| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(SIMULATION_STREAM - simulation as u64);
            let draw = rng.random_range(0..check.trajectories_m.len());
            let noise: Vec<f64> = rows.iter().map(|_| StandardNormal.sample(&mut rng)).collect();
            statistics(&|k| check.trajectories_m[draw][rows[k].0] + check.noise_sd_m[draw] * noise[k])
        })
        .collect();
    let at_least = |s: usize| simulated.iter().filter(|v| v[s] >= found[s]).count();
    let p = |s: usize| (1 + at_least(s)) as f64 / (1 + n_simulations) as f64;
    let range = |s: usize| {
        let mut values: Vec<f64> = simulated.iter().map(|v| v[s]).collect();
        values.sort_by(f64::total_cmp);
        [values[n_simulations / 200], values[n_simulations - 1 - n_simulations / 200]]
    };
    Some(Score {
        rmse_m: (squares / n).sqrt(),
        coverage: [found[2], found[3]],
        coverage_expected: [range(2), range(3)],
        joint_p: (2.0 * p(0).min(p(1))).min(1.0),
        crps_m: crps / n,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gaussian_check(n_rows: usize, noise_sd_m: f64) -> FullCheck {
        FullCheck {
            trajectories_m: vec![(0..n_rows).map(|i| 1e-4 * (i as f64 * 0.1).sin()).collect(); 4],
            noise_sd_m: vec![noise_sd_m; 4],
            surrogate_vs_full_max_m: None,
            pareto_k: None,
            weights: None,
            fe_runs: 0,
            largest_strain: None,
            discretisation_m: None,
        }
    }

    /// A mixture of one component is a Gaussian, whose quantiles and score are known: CRPS(N(0,1), y) = y(2Φ(y)−1) + 2φ(y) − 1/√π.
    #[test]
    fn one_component_has_the_gaussian_closed_forms() {
        let mixture = Mixture { mean_m: vec![2.0], sd_m: &[3.0] };
        for (p, z) in [(0.05, -1.644_853_626_951_472_2), (0.25, -0.674_489_750_196_081_7), (0.5, 0.0)] {
            assert!((mixture.quantile(p) - (2.0 + 3.0 * z)).abs() < 1e-7);
        }
        let y = 0.7_f64;
        let standard = Normal::standard();
        let exact = y * (2.0 * standard.cdf(y) - 1.0) + 2.0 * standard.pdf(y) - 1.0 / std::f64::consts::PI.sqrt();
        assert!((mixture.crps(2.0 + 3.0 * y) / 3.0 - exact).abs() < 1e-12);
    }

    /// CRPS of a two-component mixture against ∫ (F(x) − 1{x ≥ y})² dx.
    #[test]
    fn mixture_score_equals_its_integral() {
        let mixture = Mixture { mean_m: vec![-1.0, 2.0], sd_m: &[0.5, 1.5] };
        let (y, h) = (0.4, 1e-3);
        let integral: f64 = (-20_000..20_000)
            .map(|i| (f64::from(i) + 0.5) * h)
            .map(|x| (mixture.cdf_pdf(x).0 - f64::from(u8::from(x >= y))).powi(2) * h)
            .sum();
        assert!((mixture.crps(y) - integral).abs() < 1e-4, "{} {integral}", mixture.crps(y));
        assert!((mixture.cdf_pdf(mixture.quantile(0.3)).0 - 0.3).abs() < 1e-9);
    }

    /// Data from the predictive distribution itself pass; a shift of half a standard deviation over 400 rows, or a single outlier of 7, does
    /// not. 400 positions: the coverages lie in their 99 % ranges for this fixed seed.
    #[test]
    fn joint_check_accepts_its_own_and_rejects_shift_and_outlier() {
        let n_rows = 400;
        let check = gaussian_check(n_rows, 4e-6);
        let bands = bands_m(&check);
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let draw = |rng: &mut ChaCha8Rng| -> f64 { StandardNormal.sample(rng) };
        let own: Vec<f64> = (0..n_rows).map(|i| check.trajectories_m[0][i] + 4e-6 * draw(&mut rng)).collect();
        let scored = |values: &dyn Fn(usize) -> f64| {
            let observed: Vec<Option<f64>> = (0..n_rows).map(|i| Some(values(i))).collect();
            score(&check, &bands, &observed, 3).expect("there are positions")
        };
        let good = scored(&|i| own[i]);
        assert!(good.joint_p > 0.01, "{good:?}");
        for (coverage, [lower, upper]) in good.coverage.iter().zip(good.coverage_expected) {
            assert!(*coverage >= lower && *coverage <= upper, "{good:?}");
        }
        assert!(scored(&|i| own[i] + if i % 2 == 0 { 4e-6 } else { -4e-6 }).joint_p < 1e-3);
        assert!(scored(&|i| own[i] + if i == 77 { 28e-6 } else { 0.0 }).joint_p < 1e-3);
        assert!(score(&check, &bands, &vec![None; n_rows], 3).is_none());
    }
}
