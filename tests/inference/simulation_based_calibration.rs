//! Simulation-based calibration (Talts et al. 2018, arXiv:1804.06788) of the whole inference. Parameters are drawn from the prior,
//! data simulated from them, and the posterior sampled. The truth's rank among independent posterior draws must be uniform.

use crate::creep_posterior;

use creep_posterior::over_cores;
use std::collections::BTreeMap;
use std::sync::OnceLock;

use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};
use vitreo_uq::laws::rheology::CreepCompliance;
use vitreo_uq::models::model::{Compliance, Model, TrainedRange, convolve_m};
use vitreo_uq::posterior::likelihood::{FittedRecord, PosteriorParts, ReducedPosterior};
use vitreo_uq::posterior::noise::NoiseModel;
use vitreo_uq::posterior::prior::PriorSet;
use vitreo_uq::sampling::calibration::{Ranks, chi_square, independent_draw_indices, rank};
use vitreo_uq::sampling::ensemble::{RandomStream, RunControl};
use vitreo_uq::sampling::{LogDensity, SamplerOptions, sample};

const N_REPLICATES: u64 = 192;
const N_LONG_REPLICATES: u64 = 512;
/// Enough replicates to detect a noise underestimated by a factor of 1.3.
const N_REPLICATES_WRONG: u64 = 32;
/// Number of posterior draws for the rank: one less than a multiple of the number of bins.
const N_DRAWS: usize = 127;
/// Limit of steps. With such a wide prior the data of about one draw in twelve give a thin, curved ridge, on which walkers need tens of thousands of
/// steps. Such runs report that they have not converged; they are ranked like all others.
const MAX_STEPS: u64 = 4_000;
/// Fraction of such data. The test fails if so many more runs are unconverged that the probability is 1e-5 (binomial).
const RIDGE_SHARE: f64 = 1.0 / 12.0;
const N_BINS: usize = 16;
const FALSE_FAILURE_RATE: f64 = 1e-6;

/// A problem whose parameters can be drawn and whose data can be simulated.
struct Problem<Draw, Build> {
    /// Draws parameters (unconstrained) from the prior.
    draw_prior: Draw,
    /// Simulates data and builds the log density of their posterior.
    build: Build,
}

struct Replicates {
    /// Ranks of each coordinate, and of the log density at the end, for every replicate.
    ranks: Vec<Vec<usize>>,
    n_unconverged: usize,
}

/// Ranks of all replicates.
fn calibrate<D, Draw, Build>(problem: &Problem<Draw, Build>, n_replicates: u64) -> Replicates
where
    D: LogDensity,
    Draw: Fn(&mut RandomStream) -> Vec<f64> + Sync,
    Build: Fn(&[f64], &mut RandomStream) -> D + Sync,
{
    let replicate = |seed: u64| {
        let mut stream = RandomStream::new(seed, 1 << 61);
        let truth = (problem.draw_prior)(&mut stream);
        let density = (problem.build)(&truth, &mut stream);
        let starts: Vec<Vec<f64>> = (0..16).map(|_| (problem.draw_prior)(&mut stream)).collect();
        let options = SamplerOptions { seed, threads: 1, max_steps: MAX_STEPS, ..SamplerOptions::default() };
        let outcome = sample(&density, &starts, &options, &RunControl::default()).unwrap();
        let mut at_truth = [0.0];
        density.log_density(&truth, &mut at_truth);
        let draws = &outcome.draws;
        let places = independent_draw_indices(draws, N_DRAWS);
        let of = |value: &dyn Fn(usize, usize, usize) -> f64| {
            places.iter().map(|&[e, step, w]| value(e, step, w)).collect::<Vec<f64>>()
        };
        let log_density =
            |e: usize, step: usize, w: usize| draws.log_density[(e * draws.n_steps + step) * draws.n_walkers + w];
        let mut ranks: Vec<usize> =
            truth.iter().enumerate().map(|(d, &x)| rank(x, of(&|e, step, w| draws.value(e, step, w, d)))).collect();
        ranks.push(rank(at_truth[0], of(&log_density)));
        (ranks, outcome.converged)
    };
    let results = over_cores(n_replicates, replicate);
    let n_unconverged = results.iter().filter(|(_, converged)| !converged).count();
    Replicates { ranks: results.into_iter().map(|(ranks, _)| ranks).collect(), n_unconverged }
}

impl Replicates {
    /// Ranks of each quantity.
    fn quantities(&self) -> Vec<Ranks> {
        let of = |q: usize| Ranks { ranks: self.ranks.iter().map(|row| row[q]).collect(), n_draws: N_DRAWS };
        (0..self.ranks[0].len()).map(of).collect()
    }
}

/// χ² of the rank histogram of each quantity: N_BINS − 1 degrees of freedom if ranks are uniform.
fn chi_squares(replicates: &Replicates) -> Vec<f64> {
    let of_quantity = |ranks: &Ranks| {
        let counts = ranks.counts(N_BINS);
        println!("{counts:?}");
        chi_square(&counts)
    };
    replicates.quantities().iter().map(of_quantity).collect()
}

/// Location and spread of each quantity's ranks, standard normal if ranks are uniform.
///
/// For a Gaussian posterior whose sd is wrong by a factor f, u = Φ(z/f). With the long test's 512 replicates the expected spread reaches the limit at
/// f = 0.83 or 1.22, so half of such mistakes are caught; the χ² of 16 bins needs 0.80 or 1.31. With 192 replicates the spread reaches it at 0.72 or 1.4.
fn scores(replicates: &Replicates) -> Vec<[f64; 2]> {
    replicates.quantities().iter().map(|ranks| [ranks.location_score(), ranks.dispersion_score()]).collect()
}

/// Number of statistics asserted for a correct program: χ², location and spread of five quantities.
const N_ASSERTIONS: f64 = 15.0;

/// Limit that all χ² and scores of a correct program exceed once in 10⁶ calibrations, together with [`score_limit`].
fn chi_square_limit() -> f64 {
    ChiSquared::new(N_BINS as f64 - 1.0).unwrap().inverse_cdf(1.0 - FALSE_FAILURE_RATE / N_ASSERTIONS)
}

/// Limit of a score's magnitude (two-sided).
fn score_limit() -> f64 {
    Normal::standard().inverse_cdf(1.0 - 0.5 * FALSE_FAILURE_RATE / N_ASSERTIONS)
}

/// Compliance of the porcine apparatus (physics §4.10), in 1/m.
const COMPLIANCE_PER_M: f64 = 549.178;

fn priors() -> &'static PriorSet {
    static PRIORS: OnceLock<PriorSet> = OnceLock::new();
    PRIORS.get_or_init(|| PriorSet::named("porcine").unwrap())
}

/// Training range of the surrogate in `sample`: the prior's box.
fn trained() -> &'static [TrainedRange] {
    static TRAINED: OnceLock<Vec<TrainedRange>> = OnceLock::new();
    TRAINED.get_or_init(|| {
        let boxes = priors().box_quantiles(1e-9);
        let ranges = priors().names().zip(boxes).take(3);
        ranges.map(|(name, (lower, upper))| TrainedRange { name: name.into(), lower, upper }).collect()
    })
}

/// Posterior of `sample`: porcine prior, reduced model, vectorised likelihood, one cycle at 20 Hz.
/// `noise_factor` multiplies σ in the data: 1, or a deliberate mistake.
fn reduced_posterior(truth: &[f64], stream: &mut RandomStream, noise_factor: f64) -> ReducedPosterior<'static> {
    let natural = priors().from_unconstrained(truth);
    let time_s: Vec<f64> = (0..200).map(|i| 0.05 * f64::from(i)).collect();
    let force_n: Vec<f64> = (0..200).map(|i| if i < 100 { 4.6e-6 } else { -4.6e-6 }).collect();
    let law = CreepCompliance::lethersich(&natural[..3]);
    let position_m = convolve_m(COMPLIANCE_PER_M, &law, &time_s, &force_n);
    let noise_sd_m = noise_factor * 1e-6 * natural[3];
    let observed: Vec<Option<f64>> = position_m.iter().map(|x| Some(x + noise_sd_m * stream.normal())).collect();
    static MODEL: OnceLock<Model> = OnceLock::new();
    static FIXED: BTreeMap<String, f64> = BTreeMap::new();
    let parts = PosteriorParts {
        model: MODEL.get_or_init(Model::lethersich),
        noise: NoiseModel::default(),
        compliance: Compliance::fixed(COMPLIANCE_PER_M),
        trained: trained(),
        priors: priors(),
        fixed: &FIXED,
    };
    let record =
        FittedRecord { time_s: &time_s, force: (&force_n).into(), recording: &[1; 200], observed_m: &observed };
    ReducedPosterior::new(parts, record)
}

/// Ranks of `n_replicates` truths from the porcine prior.
fn reduced_ranks(n_replicates: u64, noise_factor: f64) -> Replicates {
    let draw_prior = |stream: &mut RandomStream| {
        let draw = priors().priors().iter().map(|prior| prior.distribution.quantile(stream.unit()));
        priors().to_unconstrained(&draw.collect::<Vec<f64>>())
    };
    let build = |truth: &[f64], stream: &mut RandomStream| reduced_posterior(truth, stream, noise_factor);
    calibrate(&Problem { draw_prior, build }, n_replicates)
}

#[test]
#[ignore = "thorough"]
fn ranks_on_the_surrogate_are_uniform() {
    assert_uniform(N_REPLICATES);
}

#[test]
#[ignore = "campaigns/long-tests"]
fn many_ranks_on_the_surrogate_are_uniform() {
    assert_uniform(N_LONG_REPLICATES);
}

fn assert_uniform(n_replicates: u64) {
    let ranks = reduced_ranks(n_replicates, 1.0);
    let (chi2, scores) = (chi_squares(&ranks), scores(&ranks));
    println!("χ² {chi2:?}, limit {:.1}, unconverged {}", chi_square_limit(), ranks.n_unconverged);
    println!("{scores:?}, limit {:.2}", score_limit());
    assert!(chi2.iter().all(|&value| value < chi_square_limit()), "{chi2:?}");
    assert!(scores.as_flattened().iter().all(|score| score.abs() < score_limit()), "{scores:?}");
    let n = n_replicates as f64;
    let most = n * RIDGE_SHARE + 4.9 * (n * RIDGE_SHARE * (1.0 - RIDGE_SHARE)).sqrt();
    assert!((ranks.n_unconverged as f64) < most, "{} unconverged, at most {most:.0}", ranks.n_unconverged);
}

/// The harness can fail: data with 1.3 times the noise of the truth give too large a σ, and the location of σ's rank reveals this.
#[test]
fn a_wrong_likelihood_is_caught() {
    let scores = scores(&reduced_ranks(N_REPLICATES_WRONG, 1.3));
    println!("{scores:?}, limit {:.2}", score_limit());
    assert!(scores[3][0].abs() > score_limit(), "{scores:?}");
}
