//! Gibbs sampler for the distribution of parameters over specimens and groups (the population).
//!
//! An experiment e of specimen s in group g has p coordinates φ. They are logarithms of parameters, or log-odds for parameters with two bounds. The model
//! is
//!
//! ```text
//! φ_e  = μ_g + u_s + w_e        w_e ~ N(0, W)          repeats (left out if no specimen has any)
//! u_s  ~ N(0, Σ_h / λ_s)        specimens of stratum h; λ_s = 1, or Gamma(ν/2, ν/2) for Student-t specimens
//! μ_g  = m + Σ_k a_k,level(g)   a_k ~ N(0, diag τ_k²)  one term for each grouping key k, and one for the group itself
//! ```
//!
//! Here μ_g is the mean of the group, u_s the deviation of the specimen, w_e the deviation of the experiment and m the overall mean. N is a normal
//! distribution.
//!
//! Groups that have specimens in common form a stratum and have one Σ. The covariances Σ_h of several strata are partially pooled: Σ_h ~
//! inverse-Wishart(κ + p − 1, 2κ diag(1/α)). The strata share the scales α. The parameter κ measures the similarity of their covariances, from slight (2) to nearly equal
//! (32). Both α and κ are sampled.
//!
//! A single Σ has the prior of Huang & Wand (2013, Bayesian Anal. 8:439, doi:10.1214/13-BA815): half-t(κ) standard deviations, and uniform correlations
//! for κ = 2. W has this prior with κ = 2.
//!
//! The standard deviations τ between a key's levels have the prior 1/τ² ~ Gamma(½, s²/2). Then 1/τ is half-normal, and small τ are improbable. The means
//! of a few levels are therefore hardly shrunk together, and intervals of their differences keep their nominal coverage of a fixed truth. The standard
//! deviations of the groups' own terms have half-t(2) priors.
//!
//! Every update is a draw from a full conditional distribution, except the update of the experiments' parameters. The terms m and a are drawn with all
//! deviations u integrated out. The time of a sweep is proportional to the number of experiments.

mod members;
mod random;

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use statrs::function::gamma::ln_gamma;

use members::ChainState;
pub use members::{ExperimentDensity, ExperimentMember, InterimDraws};
use random::{factor, gamma, normal_of_information, normals, wishart_of_scatter};

use super::design::Design;
use base::error::{Error, Result, Setting};
use posterior::monitor::{Counter, Monitor, refuse_if_stopped};
use sampling::diagnostics::ranks::BlomScores;
use sampling::diagnostics::{DrawColumn, diagnose};

/// Largest R̂ with which draws count as converged.
pub const LARGEST_RHAT: f64 = 1.01;
/// Smallest effective number of draws, over all means and spreads, with which the draws count as converged (Vehtari et al. 2021, Bayesian Anal. 16:667).
pub const FEWEST_EFFECTIVE_DRAWS: f64 = 400.0;
/// Message on the results that are kept if the user stops a run.
pub(super) const INTERRUPTED_MESSAGE: &str = "finished experiments are kept; repeat the command to continue from them";
/// Number of sweeps between two checks of the monitor for progress and stops.
const SWEEPS_PER_CHECK: usize = 100;
/// Degrees of freedom of the half-t priors of standard deviations.
const HALF_T_DEGREES: f64 = 2.0;
/// Possible values of κ, the similarity of the strata's covariance matrices. All values are equally probable a priori.
pub const SIMILARITIES: [f64; 5] = [2.0, 4.0, 8.0, 16.0, 32.0];

/// Priors of the hierarchy, and settings of its sampler.
#[derive(Debug, Clone, PartialEq)]
pub struct HierarchyOptions {
    /// Prior mean of the overall mean of all groups, one coordinate per parameter.
    pub overall_mean: Vec<f64>,
    /// Prior standard deviation of the overall mean of all groups, one coordinate per parameter.
    pub overall_sd: Vec<f64>,
    /// Scale of the prior for the standard deviation between the levels of a key, such as species. It refers to the coordinate (logarithm or log-odds).
    pub level_scale: f64,
    /// Scales of three half-t priors for standard deviations of the coordinates: between groups in addition to the keys, between specimens, and between
    /// repeats.
    pub scales: [f64; 3],
    /// Degrees of freedom of the Student-t distribution of specimens; `None` for a normal distribution.
    pub student_dof: Option<f64>,
    /// Number of independent chains.
    pub n_chains: usize,
    /// Two numbers of sweeps per chain: first sweeps, which are dropped, and further sweeps until convergence is first tested.
    pub n_sweeps: [usize; 2],
    /// Largest number of sweeps per chain after the dropped sweeps. The number of sweeps doubles until the draws have converged.
    pub max_sweeps: usize,
    /// Initial interval between kept sweeps. The interval doubles each time that the number of sweeps doubles.
    pub keep_every: usize,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// One posterior draw of the population: distribution of p parameters over specimens and groups.
#[derive(Debug, Clone, PartialEq)]
pub struct PopulationDraw {
    /// Mean coordinates of each group, p values per group.
    pub group_mean: Vec<f64>,
    /// Covariance matrix between specimens of each stratum (groups with specimens in common), p² values per stratum.
    pub between_specimens: Vec<f64>,
    /// Covariance matrix between repeats, p² values; empty if no specimen has repeats.
    pub within_specimens: Vec<f64>,
    /// Standard deviations between the levels of each key, p values per key. If there are several keys, p standard deviations between groups in addition
    /// to the keys follow.
    pub between_groups_sd: Vec<f64>,
    /// Mean coordinates of each specimen, p values per specimen. If a specimen has several groups, the values are for the group of its first experiment.
    pub specimen_mean: Vec<f64>,
    /// Weight λ of each specimen. A Student-t specimen far from its group has a small weight.
    pub specimen_weight: Vec<f64>,
    /// Overall mean, and the terms of the keys' levels and groups that add up to the groups' means. Each term has p values; [`ShareLayout`] defines their
    /// order.
    pub shares: Vec<f64>,
}

/// Order of the terms (shares) that add up to the groups' means.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ShareLayout {
    /// Number of terms (shares) that add up to the groups' means, including the overall mean.
    pub n_shares: usize,
    /// Range of the indices of each factor's terms. The factors are the keys and, if there are several keys, the groups in addition to the keys.
    pub factors: Vec<Range<usize>>,
    /// Indices of the terms that add up to each group's mean. The overall mean comes first.
    pub of_group: Vec<Vec<usize>>,
}

impl ShareLayout {
    /// Determines the order of the terms for a design.
    pub fn new(design: &Design) -> Self {
        let mut factors = Vec::new();
        let mut next = 1;
        let mut of_group = vec![vec![0]; design.groups.len()];
        for (key, levels) in design.keys.iter().enumerate() {
            factors.push(next..next + levels.len());
            for (shares, group) in of_group.iter_mut().zip(&design.groups) {
                shares.push(next + group.levels[key]);
            }
            next += levels.len();
        }
        if design.keys.len() > 1 {
            factors.push(next..next + design.groups.len());
            of_group.iter_mut().enumerate().for_each(|(group, shares)| shares.push(next + group));
            next += design.groups.len();
        }
        Self { n_shares: next, factors, of_group }
    }
}

/// Posterior draws of the population from all chains, with their convergence diagnostics.
pub struct Population {
    /// Kept draws of each chain.
    pub chains: Vec<Vec<PopulationDraw>>,
    /// Number of sweeps per chain from which draws were kept.
    pub n_sweeps: usize,
    /// Largest rank-normalised split R̂ of all groups' means and spreads.
    pub rhat: f64,
    /// Smallest effective number of draws of all groups' means and spreads, for the bulk or the tails.
    pub ess: f64,
    /// `true` if R̂ and the effective number of draws meet their thresholds.
    pub has_converged: bool,
}

impl Population {
    /// All kept draws of the population, one chain after the other.
    pub fn draws(&self) -> impl Iterator<Item = &PopulationDraw> {
        self.chains.iter().flatten()
    }
}

/// Samples the distribution of the parameters over specimens and groups (the population). `members` has one entry for each experiment of the design.
///
/// # Errors
/// [`base::Error::Numerical`] if an experiment has no draws or a covariance cannot be factored, [`base::Error::Interrupted`] if stopped.
pub fn sample_population(
    design: &Design,
    members: &[ExperimentMember],
    options: &HierarchyOptions,
    monitor: &dyn Monitor,
) -> Result<Population> {
    if members.iter().any(ExperimentMember::is_empty) {
        return Err(Error::numerical("an experiment has no draws", format!("sample longer ({})", Setting::Steps)));
    }
    let start = |number: usize| {
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
        rng.set_stream(number as u64);
        let chain = Chain::new(design, members, options, &mut rng);
        HierarchyRun { chain, rng, kept: Vec::new() }
    };
    let mut runs: Vec<HierarchyRun> = (0..options.n_chains).map(start).collect();
    let [n_dropped, n_first] = options.n_sweeps;
    run_sweeps(&mut runs, n_dropped, usize::MAX, monitor)?;
    runs.iter_mut().flat_map(|run| &mut run.chain.places).for_each(ChainState::freeze);
    let (mut n_sweeps, mut n_next, mut keep_every) = (0, n_first, options.keep_every);
    loop {
        run_sweeps(&mut runs, n_next, keep_every, monitor)?;
        n_sweeps += n_next;
        let (rhat, ess) = diagnostics(design, &runs, options.overall_mean.len());
        let has_converged = rhat <= LARGEST_RHAT && ess >= FEWEST_EFFECTIVE_DRAWS;
        if has_converged || 2 * n_sweeps > options.max_sweeps {
            let chains = runs.into_iter().map(|run| run.kept).collect();
            return Ok(Population { chains, n_sweeps, rhat, ess, has_converged });
        }
        (n_next, keep_every) = (n_sweeps, 2 * keep_every);
        for run in &mut runs {
            let mut index = 0;
            run.kept.retain(|_| {
                index += 1;
                index % 2 == 0
            });
        }
    }
}

/// A chain with its random numbers and the draws that it has kept.
struct HierarchyRun<'a, 'm> {
    chain: Chain<'a, 'm>,
    rng: ChaCha8Rng,
    kept: Vec<PopulationDraw>,
}

/// Makes `n_sweeps` sweeps of each chain, and keeps the state after every `keep_every`-th sweep.
fn run_sweeps(runs: &mut [HierarchyRun], n_sweeps: usize, keep_every: usize, monitor: &dyn Monitor) -> Result<()> {
    let counter = Counter::new(monitor, runs.len() * n_sweeps / SWEEPS_PER_CHECK);
    let one = |run: &mut HierarchyRun| {
        for sweep in 1..=n_sweeps {
            run.chain.sweep(&mut run.rng)?;
            if sweep % keep_every == 0 {
                run.kept.push(run.chain.draw());
            }
            if sweep.is_multiple_of(SWEEPS_PER_CHECK) {
                counter.add_one();
                refuse_if_stopped(monitor, INTERRUPTED_MESSAGE)?;
            }
        }
        Ok(())
    };
    runs.par_iter_mut().map(one).collect()
}

/// Returns the largest R̂ and the smallest effective number of draws, over the groups' means and the logarithms of the spreads.
fn diagnostics(design: &Design, runs: &[HierarchyRun], p: usize) -> (f64, f64) {
    let n_kept = runs.first().map_or(0, |run| run.kept.len());
    let blom = BlomScores::new(runs.len() * n_kept);
    let of = |value: &(dyn Fn(&PopulationDraw) -> f64 + Sync)| {
        let values = runs.iter().flat_map(|run| run.kept.iter().map(value)).collect();
        diagnose(&DrawColumn { n_ensembles: runs.len(), n_steps: n_kept, n_walkers: 1, values }, &blom)
    };
    let means = (0..design.groups.len() * p).into_par_iter().map(|i| of(&|draw| draw.group_mean[i]));
    let diagonal = |i: usize| i / p * p * p + i % p * (p + 1);
    let between =
        (0..design.n_strata * p).into_par_iter().map(|i| of(&|draw| draw.between_specimens[diagonal(i)].ln()));
    let n_within = if design.has_repeats() { p } else { 0 };
    let within = (0..n_within).into_par_iter().map(|i| of(&|draw| draw.within_specimens[diagonal(i)].ln()));
    let all: Vec<_> = means.chain(between).chain(within).collect();
    let rhat = all.iter().map(|parameter_diagnostics| parameter_diagnostics.rhat).fold(0.0, f64::max);
    let ess = all
        .iter()
        .map(|parameter_diagnostics| parameter_diagnostics.ess_bulk.min(parameter_diagnostics.ess_tail))
        .fold(f64::INFINITY, f64::min);
    (rhat, ess)
}

/// Scatter matrix Σ λ x xᵀ of deviations x that have a common covariance and the weights λ, with the number of deviations.
struct Scatter {
    sum: DMatrix<f64>,
    count: usize,
}

impl Scatter {
    fn new(p: usize) -> Self {
        Self { sum: DMatrix::zeros(p, p), count: 0 }
    }

    fn add(&mut self, weight: f64, deviation: &DVector<f64>) {
        self.sum.ger(weight, deviation, deviation, 1.0);
        self.count += 1;
    }
}

/// Draws inverse covariance matrices, given the scatter matrices of the deviations. Then draws the scales that the covariances share (Huang & Wand, with
/// common scales for several covariances).
fn draw_covariances(
    scatters: Vec<Scatter>,
    scales: &mut [f64],
    scale_of_prior: f64,
    nu: f64,
    rng: &mut ChaCha8Rng,
) -> Result<Vec<DMatrix<f64>>> {
    let p = scales.len();
    let draw = |Scatter { mut sum, count }: Scatter| {
        (0..p).for_each(|k| sum[(k, k)] += 2.0 * nu / scales[k]);
        wishart_of_scatter(nu + (p - 1 + count) as f64, sum, rng)
    };
    let precisions: Vec<DMatrix<f64>> = scatters.into_iter().map(draw).collect::<Result<_>>()?;
    let shape = 0.5 * (precisions.len() as f64 * (nu + (p - 1) as f64) + 1.0);
    for (k, scale) in scales.iter_mut().enumerate() {
        let diagonal: f64 = precisions.iter().map(|precision| precision[(k, k)]).sum();
        *scale = 1.0 / gamma(shape, nu * diagonal + scale_of_prior.powi(-2), rng);
    }
    Ok(precisions)
}

/// Draws κ, the similarity of the strata's covariances, given the inverse covariances and their scales.
fn draw_likeness(precisions: &[DMatrix<f64>], scales: &[f64], rng: &mut ChaCha8Rng) -> f64 {
    let p = scales.len();
    let ln_densities = SIMILARITIES.map(|likeness| {
        let degrees = likeness + (p - 1) as f64;
        let ln_scale: f64 = scales.iter().map(|scale| (2.0 * likeness / scale).ln()).sum();
        // Logarithm of the multivariate gamma function, up to a constant.
        let ln_gamma: f64 = (0..p).map(|j| ln_gamma(0.5 * (degrees - j as f64))).sum();
        let constant = 0.5 * degrees * (ln_scale - p as f64 * std::f64::consts::LN_2) - ln_gamma;
        let of_precision = |precision: &DMatrix<f64>| {
            let trace: f64 = (0..p).map(|k| 2.0 * likeness / scales[k] * precision[(k, k)]).sum();
            0.5 * degrees * precision.determinant().ln() - 0.5 * trace
        };
        precisions.iter().map(|precision| constant + of_precision(precision)).sum::<f64>()
    });
    let largest = ln_densities.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let weights = ln_densities.map(|ln_density| (ln_density - largest).exp());
    let mut level = rng.random::<f64>() * weights.iter().sum::<f64>();
    for (likeness, weight) in SIMILARITIES.iter().zip(weights) {
        level -= weight;
        if level <= 0.0 {
            return *likeness;
        }
    }
    SIMILARITIES[SIMILARITIES.len() - 1]
}

struct Chain<'a, 'm> {
    design: &'a Design,
    members: &'a [ExperimentMember<'m>],
    options: &'a HierarchyOptions,
    layout: ShareLayout,
    p: usize,
    has_repeats: bool,
    /// Index of each experiment's specimen.
    specimen_of: Vec<usize>,
    places: Vec<ChainState>,
    shares: DVector<f64>,
    group_mean: Vec<DVector<f64>>,
    /// Deviation of each specimen from the mean of its group. Without repeats, it is the deviation of the specimen's single experiment.
    deviation: Vec<DVector<f64>>,
    weight: Vec<f64>,
    /// Precision matrix between specimens of each stratum. The next field holds the prior scales that the strata share.
    precision: Vec<DMatrix<f64>>,
    scale: Vec<f64>,
    likeness: f64,
    /// Precision matrix between repeats of a specimen. The next field holds its prior scales.
    repeat_precision: DMatrix<f64>,
    repeat_scale: Vec<f64>,
    /// Variance between the terms of each factor (key, or groups in addition to the keys), one value per parameter. The next field holds the scales of the
    /// priors.
    factor_variance: Vec<Vec<f64>>,
    factor_scale: Vec<Vec<f64>>,
}

impl<'a, 'm> Chain<'a, 'm> {
    fn new(
        design: &'a Design,
        members: &'a [ExperimentMember<'m>],
        options: &'a HierarchyOptions,
        rng: &mut ChaCha8Rng,
    ) -> Self {
        let p = options.overall_mean.len();
        let layout = ShareLayout::new(design);
        let places: Vec<ChainState> = members.iter().map(|member| member.start(p, rng)).collect();
        let mut specimen_of = vec![0; design.n_experiments()];
        for (index, specimen) in design.specimens.iter().enumerate() {
            specimen.experiments.iter().for_each(|e| specimen_of[*e] = index);
        }
        let of_sd = |sd: f64| DMatrix::from_diagonal_element(p, p, 1.0 / (sd * sd));
        let n_factors = layout.factors.len();
        // Start values of the spreads vary between chains, typically by a factor of 2.7 in either direction.
        let mut spread = |scale: f64| scale * (normals(1, rng)[0]).exp();
        Self {
            precision: (0..design.n_strata).map(|_| of_sd(spread(0.5 * options.scales[1]))).collect(),
            scale: vec![1.0; p],
            likeness: SIMILARITIES[1],
            repeat_precision: of_sd(spread(0.5 * options.scales[2])),
            repeat_scale: vec![1.0; p],
            factor_variance: vec![vec![spread(options.scales[0]).powi(2); p]; n_factors],
            factor_scale: vec![vec![1.0; p]; n_factors],
            shares: DVector::zeros(p * layout.n_shares),
            group_mean: vec![DVector::zeros(p); design.groups.len()],
            deviation: vec![DVector::zeros(p); design.specimens.len()],
            weight: vec![1.0; design.specimens.len()],
            has_repeats: design.has_repeats(),
            layout,
            design,
            members,
            options,
            p,
            specimen_of,
            places,
        }
    }

    fn sweep(&mut self, rng: &mut ChaCha8Rng) -> Result<()> {
        self.draw_shares(rng)?;
        self.draw_deviations(rng)?;
        self.draw_members(rng);
        self.draw_factor_variances(rng);
        if self.has_repeats {
            self.draw_repeat_precision(rng)?;
        }
        if let Some(dof) = self.options.student_dof {
            self.draw_weights(dof, rng);
        }
        self.draw_precisions(rng)
    }

    fn residual(&self, experiment: usize) -> DVector<f64> {
        let mean = &self.group_mean[self.design.group_of[experiment]];
        DVector::from_fn(self.p, |k, _| self.places[experiment].coordinates[k] - mean[k])
    }

    /// Draws the overall mean and the terms of the keys' levels, given the experiments' parameters. The specimens' deviations are integrated out.
    fn draw_shares(&mut self, rng: &mut ChaCha8Rng) -> Result<()> {
        let (p, design) = (self.p, self.design);
        let n = p * self.layout.n_shares;
        let mut precision = DMatrix::zeros(n, n);
        let mut information = DVector::zeros(n);
        for k in 0..p {
            let of_overall = 1.0 / self.options.overall_sd[k].powi(2);
            precision[(k, k)] = of_overall;
            information[k] = of_overall * self.options.overall_mean[k];
            for (factor, range) in self.layout.factors.iter().enumerate() {
                for share in range.clone() {
                    precision[(p * share + k, p * share + k)] = 1.0 / self.factor_variance[factor][k];
                }
            }
        }
        let layout = &self.layout;
        let mut add = |groups: [usize; 2], block: &DMatrix<f64>| {
            for row in &layout.of_group[groups[0]] {
                for column in &layout.of_group[groups[1]] {
                    let mut view = precision.view_mut((p * row, p * column), (p, p));
                    view += block;
                }
            }
        };
        for (index, specimen) in design.specimens.iter().enumerate() {
            let matrix = &self.precision[specimen.stratum] * self.weight[index];
            let value = |e: usize| DVector::from_column_slice(&self.places[e].coordinates);
            if !self.has_repeats {
                let e = specimen.experiments[0];
                let group = design.group_of[e];
                add([group, group], &matrix);
                let product = &matrix * value(e);
                for share in &layout.of_group[group] {
                    let mut view = information.rows_mut(p * share, p);
                    view += &product;
                }
                continue;
            }
            let repeat = &self.repeat_precision;
            let count = specimen.experiments.len() as f64;
            let covariance = factor(matrix + repeat * count)?.inverse();
            let shared = repeat * covariance * repeat;
            let sum = specimen.experiments.iter().fold(DVector::zeros(p), |sum, e| sum + value(*e));
            for &e in &specimen.experiments {
                let group = design.group_of[e];
                add([group, group], repeat);
                for &other in &specimen.experiments {
                    add([group, design.group_of[other]], &-&shared);
                }
                let product = repeat * value(e) - &shared * &sum;
                for share in &layout.of_group[group] {
                    let mut view = information.rows_mut(p * share, p);
                    view += &product;
                }
            }
        }
        self.shares = normal_of_information(precision, information, rng)?;
        for (mean, shares) in self.group_mean.iter_mut().zip(&self.layout.of_group) {
            mean.fill(0.0);
            for share in shares {
                *mean += self.shares.rows(p * share, p);
            }
        }
        Ok(())
    }

    fn draw_deviations(&mut self, rng: &mut ChaCha8Rng) -> Result<()> {
        for (index, specimen) in self.design.specimens.iter().enumerate() {
            let sum = specimen.experiments.iter().fold(DVector::zeros(self.p), |sum, e| sum + self.residual(*e));
            self.deviation[index] = if self.has_repeats {
                let count = specimen.experiments.len() as f64;
                let precision = &self.precision[specimen.stratum] * self.weight[index] + &self.repeat_precision * count;
                normal_of_information(precision, &self.repeat_precision * sum, rng)?
            } else {
                sum
            };
        }
        Ok(())
    }

    fn draw_members(&mut self, rng: &mut ChaCha8Rng) {
        for e in 0..self.design.n_experiments() {
            let specimen = self.specimen_of[e];
            let stratum = self.design.specimens[specimen].stratum;
            let group_mean = &self.group_mean[self.design.group_of[e]];
            let (mean, precision) = if self.has_repeats {
                (group_mean + &self.deviation[specimen], self.repeat_precision.clone())
            } else {
                (group_mean.clone(), &self.precision[stratum] * self.weight[specimen])
            };
            self.members[e].step(&mut self.places[e], mean.as_slice(), &precision, rng);
            if !self.has_repeats {
                self.deviation[specimen] = self.residual(e);
            }
        }
    }

    fn draw_factor_variances(&mut self, rng: &mut ChaCha8Rng) {
        let nu = HALF_T_DEGREES;
        let n_keys = self.design.keys.len();
        for (factor, range) in self.layout.factors.iter().enumerate() {
            for k in 0..self.p {
                let squares: f64 = range.clone().map(|share| self.shares[self.p * share + k].powi(2)).sum();
                let count = range.len() as f64;
                if factor < n_keys {
                    let rate = 0.5 * (self.options.level_scale.powi(2) + squares);
                    self.factor_variance[factor][k] = 1.0 / gamma(0.5 * (1.0 + count), rate, rng);
                    continue;
                }
                let scale = self.factor_scale[factor][k];
                let variance = 1.0 / gamma(0.5 * (nu + count), nu / scale + 0.5 * squares, rng);
                self.factor_variance[factor][k] = variance;
                let rate = nu / variance + self.options.scales[0].powi(-2);
                self.factor_scale[factor][k] = 1.0 / gamma(0.5 * (nu + 1.0), rate, rng);
            }
        }
    }

    /// Draws the precision matrix between repeats and its prior scales, given all repeats.
    fn draw_repeat_precision(&mut self, rng: &mut ChaCha8Rng) -> Result<()> {
        let mut scatter = Scatter::new(self.p);
        for e in 0..self.design.n_experiments() {
            scatter.add(1.0, &(self.residual(e) - &self.deviation[self.specimen_of[e]]));
        }
        let scale = self.options.scales[2];
        self.repeat_precision =
            draw_covariances(vec![scatter], &mut self.repeat_scale, scale, HALF_T_DEGREES, rng)?.remove(0);
        Ok(())
    }

    fn draw_weights(&mut self, dof: f64, rng: &mut ChaCha8Rng) {
        for (index, specimen) in self.design.specimens.iter().enumerate() {
            let deviation = &self.deviation[index];
            let distance = (deviation.transpose() * &self.precision[specimen.stratum] * deviation)[0];
            self.weight[index] = gamma(0.5 * (dof + self.p as f64), 0.5 * (dof + distance), rng);
        }
    }

    /// Draws the precision matrix between specimens of each stratum, given the stratum's specimens. Then draws the prior scales and the similarity κ that
    /// the strata share.
    fn draw_precisions(&mut self, rng: &mut ChaCha8Rng) -> Result<()> {
        let mut scatters: Vec<Scatter> = (0..self.design.n_strata).map(|_| Scatter::new(self.p)).collect();
        for (index, specimen) in self.design.specimens.iter().enumerate() {
            scatters[specimen.stratum].add(self.weight[index], &self.deviation[index]);
        }
        let scale = self.options.scales[1];
        self.precision = draw_covariances(scatters, &mut self.scale, scale, self.likeness, rng)?;
        self.likeness = draw_likeness(&self.precision, &self.scale, rng);
        Ok(())
    }

    fn draw(&self) -> PopulationDraw {
        let inverse = |matrix: &DMatrix<f64>| -> Vec<f64> {
            matrix
                .clone()
                .try_inverse()
                .map_or_else(|| vec![f64::NAN; self.p * self.p], |entry| entry.as_slice().to_vec())
        };
        let specimens = self.design.specimens.iter().zip(&self.deviation);
        PopulationDraw {
            group_mean: self.group_mean.iter().flat_map(|mean| mean.iter().copied()).collect(),
            between_specimens: self.precision.iter().flat_map(inverse).collect(),
            within_specimens: if self.has_repeats { inverse(&self.repeat_precision) } else { Vec::new() },
            between_groups_sd: self.factor_variance.iter().flatten().map(|variance| variance.sqrt()).collect(),
            specimen_mean: specimens
                .flat_map(|(specimen, deviation)| {
                    let mean = &self.group_mean[self.design.group_of[specimen.experiments[0]]] + deviation;
                    mean.iter().copied().collect::<Vec<f64>>()
                })
                .collect(),
            specimen_weight: self.weight.clone(),
            shares: self.shares.as_slice().to_vec(),
        }
    }
}
