//! Estimates by simulation how many further specimens would settle a question, such as whether two groups differ.
//!
//! A true ratio of two groups is drawn from the posterior. The ratio measured with n new specimens per group varies around the true ratio, with the
//! spreads of the draw and the measurement error. Each posterior draw is then weighted by the probability with which it predicts the measured ratio. The
//! weighted draws show whether the question is settled.

use documents::groups::SampleSizePlan;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::contrast::CERTAINTY;

/// Numbers of new specimens per group for which the probability is computed.
const NUMBERS: [u32; 18] = [1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512];
/// Smallest probability of settling the question with which a number of new specimens is recommended.
const WANTED_CHANCE: f64 = 0.8;
/// Number of simulated true ratios.
const N_TRUTHS: usize = 200;
/// Number of posterior draws that are weighted for each true ratio.
const N_WEIGHTED: usize = 1_000;

/// Question whether two groups differ: posterior draws of the ratio between the groups, and of the variance of new specimens.
pub struct RatioQuestion<'a> {
    /// Logarithm of the ratio, one value per draw.
    pub log_ratio: &'a [f64],
    /// Variance of the logarithm of the ratio between one new specimen of each group, one value per draw. It includes the spreads and the measurement
    /// error.
    pub variance_of_pair: &'a [f64],
    /// Margin of practical equivalence: ratios from 1/(1 + margin) to 1 + margin count as no difference.
    pub margin: f64,
}

/// Finds the smallest number of new specimens per group that settles the question with sufficient probability.
pub fn plan(question: &RatioQuestion, seed: u64) -> SampleSizePlan {
    let mut plan = SampleSizePlan { specimens_per_group: None, chance: 0.0 };
    for n in NUMBERS {
        plan.chance = settling_probability(question, n, seed);
        if plan.chance >= WANTED_CHANCE {
            plan.specimens_per_group = Some(n);
            break;
        }
    }
    plan
}

/// Probability that `n` new specimens per group settle the question. The random numbers are the same for all n, so that results for different n are
/// comparable.
pub fn settling_probability(question: &RatioQuestion, n: u32, seed: u64) -> f64 {
    let every = |most: usize| question.log_ratio.len().div_ceil(most).max(1);
    let edge = question.margin.ln_1p();
    let pairs = || question.log_ratio.iter().zip(question.variance_of_pair).map(|(x, v)| (*x, v / f64::from(n)));
    let draws: Vec<(f64, f64)> = pairs().step_by(every(N_WEIGHTED)).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut settled, mut tried) = (0, 0);
    for (truth, variance) in pairs().step_by(every(N_TRUTHS)) {
        let noise: f64 = StandardNormal.sample(&mut rng);
        let found = truth + variance.sqrt() * noise;
        let [mut above, mut below, mut all] = [0.0; 3];
        for (log_ratio, variance) in &draws {
            let weight = (-0.5 * (found - log_ratio).powi(2) / variance).exp() / variance.sqrt();
            all += weight;
            above += if *log_ratio > edge { weight } else { 0.0 };
            below += if *log_ratio < -edge { weight } else { 0.0 };
        }
        settled += usize::from((above.max(below).max(all - above - below)) >= CERTAINTY * all);
        tried += 1;
    }
    settled as f64 / f64::from(tried.max(1))
}
