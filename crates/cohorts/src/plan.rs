//! Number of further specimens that would settle a question, estimated by simulation.
//!
//! A truth is drawn from the posterior. The mean of n new specimens per group scatters around it with that draw's spreads and the measurement error. All draws are then
//! weighted by their prediction of that mean, each with its own spreads. The weighted draws show whether the question is settled.

use documents::groups::SampleSizePlan;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::contrast::CERTAINTY;

/// Numbers of new specimens per group that are tried.
const NUMBERS: [u32; 18] = [1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512];
/// Smallest probability of settling the question at which a number of new specimens is recommended.
const WANTED_CHANCE: f64 = 0.8;
/// Number of truths that are tried, and of draws that are weighted for each.
const N_TRUTHS: usize = 200;
const N_WEIGHTED: usize = 1_000;

/// Posterior of a ratio and of the scatter of new specimens; one value per draw.
pub struct RatioQuestion<'a> {
    /// Logarithm of the ratio.
    pub log_ratio: &'a [f64],
    /// Variance of the difference between one new specimen of each group: spreads and measurement error.
    pub variance_of_pair: &'a [f64],
    /// Margin of practical equivalence: ratios from 1/(1 + margin) to 1 + margin count as no difference.
    pub margin: f64,
}

/// Finds the smallest number of new specimens that is likely to settle a question.
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

/// Probability that `n` new specimens per group settle the question. All n use the same random numbers.
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
