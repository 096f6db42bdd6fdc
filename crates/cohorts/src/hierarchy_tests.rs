//! Tests of the Gibbs sampler: numerical integration, simulation-based calibration, and a comparison of draws with exact likelihoods.

use nalgebra::{DMatrix, DVector};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use statrs::function::gamma::ln_gamma;

use super::design::{Design, Labels};
use super::hierarchy::*;
use posterior::monitor::SilentMonitor;

fn normal(rng: &mut impl Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Experiment whose likelihood is normal in the logarithms of the parameters.
struct Gaussian {
    mean: Vec<f64>,
    sd: f64,
    archive: Vec<Vec<f64>>,
}

impl Gaussian {
    fn new(mean: Vec<f64>, sd: f64, rng: &mut impl Rng) -> Self {
        let archive = (0..64).map(|_| mean.iter().map(|m| m + sd * normal(rng)).collect()).collect();
        Self { mean, sd, archive }
    }

    /// Simulates `n` draws with a normal interim prior that has mean 0 and standard deviation `prior_sd`.
    fn interim(&self, prior_sd: f64, n: usize, rng: &mut impl Rng) -> InterimDraws {
        let precision = self.sd.powi(-2) + prior_sd.powi(-2);
        let mut draws = Vec::new();
        let mut log_prior = Vec::new();
        for _ in 0..n {
            let mut sum = 0.0;
            for mean in &self.mean {
                let x = mean * self.sd.powi(-2) / precision + normal(rng) / precision.sqrt();
                sum -= 0.5 * (x / prior_sd).powi(2);
                draws.push(x);
            }
            log_prior.push(sum);
        }
        InterimDraws::new(draws, log_prior)
    }
}

impl ExperimentDensity for Gaussian {
    fn ln_density(&self, point: &[f64]) -> f64 {
        point.iter().zip(&self.mean).map(|(x, m)| -0.5 * ((x - m) / self.sd).powi(2)).sum()
    }
    fn archive(&self) -> &[Vec<f64>] {
        &self.archive
    }
}

fn options(p: usize, n_sweeps: [usize; 2], seed: u64) -> HierarchyOptions {
    HierarchyOptions {
        overall_mean: vec![0.0; p],
        overall_sd: vec![1.5; p],
        level_scale: 0.8,
        scales: [0.4, 0.5, 0.3],
        student_dof: None,
        n_chains: 2,
        n_sweeps,
        max_sweeps: n_sweeps[1],
        keep_every: 1,
        seed,
    }
}

fn labels(list: &[(&str, &[&str])]) -> Vec<Labels> {
    let function = |(specimen, levels): &(&str, &[&str])| Labels {
        specimen: specimen.to_string(),
        levels: levels.iter().map(|level| level.to_string()).collect(),
    };
    list.iter().map(function).collect()
}

/// Compares the sampler with numerical integration, for two groups, one parameter and normal measurements. Given the standard deviations, the difference
/// of the groups is normal in closed form. The posterior of the three standard deviations is summed on a grid of their logarithms. The strata's scale is
/// integrated out in closed form, and the similarity κ of the strata is summed over its values. The densities do not use the sampler's code.
#[test]
fn two_groups_agree_with_quadrature() {
    let values = [[0.3, 0.9, 0.5, 0.1], [-0.2, -0.6, 0.2, -0.5]];
    let sd = 0.15;
    let mut list = Vec::new();
    let names: Vec<String> = (0..8).map(|i| format!("s{i}")).collect();
    for (i, name) in names.iter().enumerate() {
        list.push((name.as_str(), if i < 4 { &["a"][..] } else { &["b"][..] }));
    }
    let design = Design::new(&labels(&list));
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let members: Vec<Gaussian> =
        values.iter().flatten().map(|value| Gaussian::new(vec![*value], sd, &mut rng)).collect();
    let members: Vec<ExperimentMember> = members.iter().map(|member| ExperimentMember::Exact(member)).collect();
    let options = options(1, [2_000, 40_000], 7);
    let population = sample_population(&design, &members, &options, &SilentMonitor).unwrap();
    let difference: Vec<f64> = population.draws().map(|draw| draw.group_mean[0] - draw.group_mean[1]).collect();
    let mean = difference.iter().sum::<f64>() / difference.len() as f64;
    let spread = (difference.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / difference.len() as f64).sqrt();

    let [_, sigma_scale, _] = options.scales;
    let grid: Vec<f64> = (0..60).map(|i| (-5.0 + 8.0 * i as f64 / 59.0_f64).exp()).collect();
    let (mut total, mut first, mut second) = (0.0, 0.0, 0.0);
    for &tau in &grid {
        // Prior density p(τ) τ of the logarithm of the standard deviation τ between groups. The grid is evenly spaced in this logarithm.
        let of_tau = (-0.5 * (options.level_scale / tau).powi(2)).exp() / tau;
        for &one in &grid {
            for &two in &grid {
                // Joint prior density of the logarithms of both variances σ² between specimens, for each similarity κ. Each variance is inverse-gamma(κ/2,
                // κ/α). After the common scale α, which is inverse-gamma(½, 1/A²), is integrated out, the density is κ^κ Γ(κ + ½)/Γ(κ/2)² Π σ^{-κ} /
                // rate^{κ + ½}.
                let of_likeness = |kappa: &f64| {
                    let rate = kappa * (one.powi(-2) + two.powi(-2)) + sigma_scale.powi(-2);
                    let constant = kappa * kappa.ln() + ln_gamma(kappa + 0.5) - 2.0 * ln_gamma(0.5 * kappa);
                    (constant - kappa * (one * two).ln() - (kappa + 0.5) * rate.ln()).exp()
                };
                let of_sigma: f64 = SIMILARITIES.iter().map(of_likeness).sum();
                let spreads = [one, two];
                let covariance = DMatrix::from_fn(8, 8, |i, j| {
                    let same = if i == j { spreads[i / 4].powi(2) + sd * sd } else { 0.0 };
                    let group = if i / 4 == j / 4 { tau * tau } else { 0.0 };
                    same + group + options.overall_sd[0].powi(2)
                });
                let data = DVector::from_iterator(8, values.iter().flatten().copied());
                let factor = covariance.cholesky().unwrap();
                let weighted = factor.solve(&data);
                let ln_likelihood =
                    -0.5 * data.dot(&weighted) - factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
                // The covariance of the difference of the groups' means with each measurement is +τ² or −τ².
                let with_data = DVector::from_fn(8, |i, _| if i < 4 { tau * tau } else { -tau * tau });
                let mean = with_data.dot(&weighted);
                let variance = 2.0 * tau * tau - with_data.dot(&factor.solve(&with_data));
                let weight = of_tau * of_sigma * ln_likelihood.exp();
                total += weight;
                first += weight * mean;
                second += weight * (variance + mean * mean);
            }
        }
    }
    let exact_mean = first / total;
    let exact_sd = (second / total - exact_mean.powi(2)).sqrt();
    // The 80,000 draws have an autocorrelation time below 40, so the standard error of the mean is below 0.023 standard deviations.
    assert!((mean - exact_mean).abs() < 0.1 * exact_sd, "{mean} {exact_mean} ± {exact_sd}");
    assert!((spread / exact_sd - 1.0).abs() < 0.1, "{spread} {exact_sd}");
}

/// True parameter values, drawn from the prior of the hierarchy.
struct Truth {
    group_mean: Vec<Vec<f64>>,
    between: Vec<DMatrix<f64>>,
    within: DMatrix<f64>,
    values: Vec<Vec<f64>>,
}

fn inverse_gamma(shape: f64, rate: f64, rng: &mut impl Rng) -> f64 {
    1.0 / rand_distr::Gamma::new(shape, 1.0 / rate).unwrap().sample(rng)
}

/// Draws a covariance matrix of p = 2 parameters from the hierarchical inverse-Wishart distribution. The matrix is the inverse of a sum of outer products
/// of κ + p − 1 normal vectors, where κ is `likeness`.
fn covariance(scales: &[f64], likeness: f64, rng: &mut impl Rng) -> DMatrix<f64> {
    let mut precision = DMatrix::zeros(2, 2);
    for _ in 0..likeness as usize + 1 {
        let x = DVector::from_fn(2, |k, _| normal(rng) * (scales[k] / (2.0 * likeness)).sqrt());
        precision.ger(1.0, &x, &x, 1.0);
    }
    precision.try_inverse().unwrap()
}

fn truth(design: &Design, options: &HierarchyOptions, rng: &mut ChaCha8Rng) -> Truth {
    let p = 2;
    let layout = ShareLayout::new(design);
    let mut shares = vec![Vec::new(); layout.n_shares];
    for (overall_mean, overall_sd) in options.overall_mean.iter().zip(&options.overall_sd) {
        shares[0].push(overall_mean + overall_sd * normal(rng));
        for (factor, range) in layout.factors.iter().enumerate() {
            let sd = if factor < design.keys.len() {
                options.level_scale / normal(rng).abs()
            } else {
                let scale = inverse_gamma(0.5, options.scales[0].powi(-2), rng);
                inverse_gamma(1.0, 2.0 / scale, rng).sqrt()
            };
            range.clone().for_each(|share| shares[share].push(sd * normal(rng)));
        }
    }
    let mean =
        |share_places: &Vec<usize>| (0..p).map(|k| share_places.iter().map(|share| shares[*share][k]).sum()).collect();
    let group_mean: Vec<Vec<f64>> = layout.of_group.iter().map(mean).collect();
    let scales: Vec<f64> = (0..p).map(|_| inverse_gamma(0.5, options.scales[1].powi(-2), rng)).collect();
    let likeness = SIMILARITIES[rng.random_range(0..SIMILARITIES.len())];
    let between: Vec<DMatrix<f64>> = (0..design.n_strata).map(|_| covariance(&scales, likeness, rng)).collect();
    let scales: Vec<f64> = (0..p).map(|_| inverse_gamma(0.5, options.scales[2].powi(-2), rng)).collect();
    let within = covariance(&scales, 2.0, rng);
    let correlated = |matrix: &DMatrix<f64>, rng: &mut ChaCha8Rng| {
        let z = DVector::from_fn(p, |_, _| normal(rng));
        matrix.clone().cholesky().unwrap().l() * z
    };
    let mut values = vec![Vec::new(); design.n_experiments()];
    for specimen in &design.specimens {
        let weight =
            options.student_dof.map_or(1.0, |dof| rand_distr::Gamma::new(0.5 * dof, 2.0 / dof).unwrap().sample(rng));
        let deviation = correlated(&between[specimen.stratum], rng) / weight.sqrt();
        for &e in &specimen.experiments {
            let repeat = correlated(&within, rng) * f64::from(u8::from(design.has_repeats()));
            values[e] = (0..p).map(|k| group_mean[design.group_of[e]][k] + deviation[k] + repeat[k]).collect();
        }
    }
    Truth { group_mean, between, within, values }
}

/// Simulates one cohort and samples it. Returns the fraction of posterior draws below the truth, for several quantities.
fn ranks(design: &Design, options: &HierarchyOptions, sd: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let truth = truth(design, options, rng);
    let densities: Vec<Gaussian> = truth
        .values
        .iter()
        .map(|value| {
            let measured = value.iter().map(|x| x + sd * normal(rng)).collect();
            Gaussian::new(measured, sd, rng)
        })
        .collect();
    let members: Vec<ExperimentMember> = densities.iter().map(|density| ExperimentMember::Exact(density)).collect();
    let population = sample_population(design, &members, options, &SilentMonitor).unwrap();
    let share = |of_draw: &dyn Fn(&PopulationDraw) -> f64, of_truth: f64| {
        let below = population.draws().filter(|draw| of_draw(draw) < of_truth).count();
        below as f64 / population.draws().count() as f64
    };
    let correlation = |c: &[f64]| c[1] / (c[0] * c[3]).sqrt();
    let mut out = vec![
        share(&|draw| draw.group_mean[0], truth.group_mean[0][0]),
        share(&|draw| draw.group_mean[1] - draw.group_mean[3], truth.group_mean[0][1] - truth.group_mean[1][1]),
        share(&|draw| draw.between_specimens[0], truth.between[0][(0, 0)]),
        share(&|draw| correlation(&draw.between_specimens), correlation(truth.between[0].as_slice())),
    ];
    if design.has_repeats() {
        out.push(share(&|draw| draw.within_specimens[3], truth.within[(1, 1)]));
    }
    out
}

/// χ² statistic of uniformity for a histogram of the ranks with `n_bins` bins of equal width.
fn chi_square(ranks: &[f64], n_bins: usize) -> f64 {
    let mut counts = vec![0.0; n_bins];
    ranks.iter().for_each(|rank| counts[((n_bins as f64 * rank) as usize).min(n_bins - 1)] += 1.0);
    let expected = ranks.len() as f64 / n_bins as f64;
    counts.iter().map(|count: &f64| (count - expected).powi(2) / expected).sum()
}

/// Extent of a simulation-based calibration: number of simulated cohorts, number of bins, and the value that χ² exceeds with a probability of 1e-6.
struct Calibration {
    n_runs: u64,
    n_bins: usize,
    largest_chi_square: f64,
}

const SHORT: Calibration = Calibration { n_runs: 32, n_bins: 4, largest_chi_square: 30.7 };
const LONG: Calibration = Calibration { n_runs: 200, n_bins: 8, largest_chi_square: 40.5 };

fn assert_calibrated(design: &Design, student_dof: Option<f64>, calibration: &Calibration, seed: u64) {
    let base = HierarchyOptions { student_dof, ..options(2, [600, 1_200], 0) };
    let mut all: Vec<Vec<f64>> = Vec::new();
    for run in 0..calibration.n_runs {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(run);
        all.push(ranks(design, &HierarchyOptions { seed: run, ..base.clone() }, 0.2, &mut rng));
    }
    for quantity in 0..all[0].len() {
        let ranks: Vec<f64> = all.iter().map(|run| run[quantity]).collect();
        let chi_square = chi_square(&ranks, calibration.n_bins);
        assert!(chi_square < calibration.largest_chi_square, "quantity {quantity}: χ² {chi_square}");
    }
}

/// Design with one key and groups of five, three and one specimens.
fn one_key() -> Design {
    let names: Vec<String> = (0..9).map(|i| format!("s{i}")).collect();
    let level = |i: usize| match i {
        0..5 => &["a"][..],
        5..8 => &["b"][..],
        _ => &["c"][..],
    };
    let list: Vec<(&str, &[&str])> = names.iter().enumerate().map(|(i, name)| (name.as_str(), level(i))).collect();
    Design::new(&labels(&list))
}

#[test]
#[ignore = "thorough"]
fn one_key_is_calibrated() {
    assert_calibrated(&one_key(), None, &SHORT, 11);
}

#[test]
#[ignore = "campaigns/long-tests"]
fn one_key_is_calibrated_in_many_runs() {
    assert_calibrated(&one_key(), None, &LONG, 11);
}

/// Design with two keys, specimens with repeats in several regions, and one combination without specimens.
fn two_keys() -> Design {
    let mut list: Vec<(String, [&str; 2])> = Vec::new();
    for i in 0..4 {
        list.push((format!("p{i}"), ["porcine", "anterior"]));
        list.push((format!("p{i}"), ["porcine", "central"]));
    }
    for i in 0..3 {
        list.push((format!("b{i}"), ["bovine", "central"]));
        list.push((format!("b{i}"), ["bovine", "central"]));
    }
    let borrowed: Vec<(&str, &[&str])> = list.iter().map(|(name, levels)| (name.as_str(), &levels[..])).collect();
    Design::new(&labels(&borrowed))
}

#[test]
#[ignore = "thorough"]
fn two_keys_with_repeats_and_student_t_specimens_are_calibrated() {
    assert_calibrated(&two_keys(), Some(4.0), &SHORT, 12);
}

#[test]
#[ignore = "campaigns/long-tests"]
fn two_keys_with_repeats_and_student_t_specimens_are_calibrated_in_many_runs() {
    assert_calibrated(&two_keys(), Some(4.0), &LONG, 12);
}

/// The posterior from re-weighted draws agrees with the posterior from exact likelihoods.
#[test]
fn draws_agree_with_likelihoods() {
    let names: Vec<String> = (0..12).map(|i| format!("s{i}")).collect();
    let list: Vec<(&str, &[&str])> = names
        .iter()
        .enumerate()
        .map(|(i, name)| (name.as_str(), if i < 6 { &["a"][..] } else { &["b"][..] }))
        .collect();
    let design = Design::new(&labels(&list));
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let densities: Vec<Gaussian> = (0..12)
        .map(|i| {
            let centre = if i < 6 { 0.4 } else { -0.1 };
            let value = vec![centre + 0.3 * normal(&mut rng), 0.2 * normal(&mut rng)];
            Gaussian::new(value, 0.1, &mut rng)
        })
        .collect();
    let options = options(2, [1_000, 20_000], 3);
    let exact: Vec<ExperimentMember> = densities.iter().map(|density| ExperimentMember::Exact(density)).collect();
    let interim: Vec<InterimDraws> = densities.iter().map(|density| density.interim(1.2, 4_000, &mut rng)).collect();
    let drawn: Vec<ExperimentMember> = interim.iter().map(ExperimentMember::Draws).collect();
    let moments = |members: &[ExperimentMember]| {
        let population = sample_population(&design, members, &options, &SilentMonitor).unwrap();
        let values: Vec<f64> = population.draws().map(|draw| draw.group_mean[0] - draw.group_mean[2]).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt())
    };
    let ((exact_mean, exact_sd), (mean, sd)) = (moments(&exact), moments(&drawn));
    assert!((mean - exact_mean).abs() < 0.1 * exact_sd, "{mean} {exact_mean} ± {exact_sd}");
    assert!((sd / exact_sd - 1.0).abs() < 0.1, "{sd} {exact_sd}");
}
