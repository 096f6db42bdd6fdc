//! The thresholds of all verdicts, in one place, with their reasons.
//!
//! [`Criteria::RECORD`] is for one creep record, [`Criteria::SWEEP`] for one oscillation, [`Criteria::COHORT`] for many records. The comment on a field names the campaign in
//! `campaigns/` that counts how often verdicts with its value are right. No campaign varies a single threshold. Other commands share two further rules:
//! [`posterior::misfit`] decides when a residual exceeds the noise, and [`SEPARATED_SIGMA`] when an experiment separates two models. Tolerances and budgets of
//! computations decide no verdict. They are defined beside their use.

use super::separation::SEPARATED_SIGMA;

/// Decision thresholds. Gains are in nats of log likelihood; every model's noise is estimated anew. The rank of a model orders models: it is the gain on fitted and last cycles
/// together, less a penalty for additional parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criteria {
    /// Largest p, over the whole search, at which an effect may be claimed. Each further round of additions uses half of the previous threshold. Record: 0.05. Only 10 of 2,800
    /// records without a hidden effect then get a claim, because future cycles must agree (campaign `controls`). Sweep: 0.01, because held-out frequencies need not gain
    /// (campaign `sweeps`). Cohort: 0.01 (campaign `cohorts`).
    pub largest_p: f64,
    /// Gain (nats) in the log score of future cycles that a claim has to exceed; `None` if fitted data alone may support a claim. Record and cohort: 2 nats (campaigns `controls`,
    /// `cohorts`). Sweep: none, because an effect need not show in the held-out frequencies (campaign `sweeps`).
    pub least_future_nats: Option<f64>,
    /// Least gain (nats) of a claim on the fitted cycles. Cohort: 2 nats, as on future cycles, because p is that of both together: one disturbed cycle of one record would otherwise
    /// support a claim. Record and sweep: 0, because p is that of the fitted cycles.
    pub least_fitted_nats: f64,
    /// Largest loss (nats) of a claim in the log score of the last cycle, or of held-out frequencies. An effect that is invisible there hardly changes that score. In six of eight
    /// records with a false claim and no hidden effect, all gain was on earlier cycles (campaign `controls`).
    pub largest_loss_nats: f64,
    /// Smallest change of a predicted position that a claim must make, divided by the noise (`--smallest`). A smaller change has no practical use. Sweeps and cohorts do
    /// not use this threshold.
    pub smallest_change: f64,
    /// Largest number of effects in a claim. Simulated records hide at most two effects (campaign `pairs`).
    pub most_effects: usize,
    /// Factor in the rule that prefers a model with more effects. The larger model's rank must be at least this factor times the smaller model's rank, plus `larger_nats`
    /// (campaign `pairs`).
    pub larger_factor: f64,
    /// Addition (nats) in the rule of `larger_factor`. It also applies if residual structure outside the library competes with a claim. For each claimed effect beyond the first,
    /// the structure may gain less than the claim by this many nats and still replace it.
    pub larger_nats: f64,
    /// Cost (nats) below which an effect is removed from a claim of several effects. The remaining model must pass all criteria (campaign `pairs`).
    pub least_removal_nats: f64,

    /// Largest p of residual structure that no library effect describes, from 199 simulated residuals. Structure that passes is then confirmed with simulated records (campaigns
    /// `controls`, `outside`).
    pub largest_structure_p: f64,
    /// Least gain (nats) of residual structure that no library effect describes. The gain of its family by chance is subtracted first (campaigns `controls`, `outside`).
    pub least_structure_nats: f64,
    /// Gain (nats) of the library's best effect by chance. It is subtracted from a claim's gain before the claim is compared with residual structure outside the library.
    pub chance_nats: f64,
    /// Least excess (nats) of the gain of structure outside the library over a claim's gain, at which the structure replaces the claim. It applies if the claim's own residual
    /// shows no structure (campaign `outside`).
    pub structure_lead_nats: f64,
    /// Least gain of structure in the residual of a claimed model, as a fraction of the claim's gain, at which the structure counts. This fraction of the claim's gain is also
    /// added to `structure_lead_nats` (campaign `outside`).
    pub least_structure_share: f64,
    /// Cosine above which residual structure and an effect of the library count as alike. For example, backlash resembles a delay on a square wave (campaign `outside`).
    pub least_similar_cosine: f64,
    /// Largest p at which a Gaussian process is reported in addition to residual structure of a known shape.
    pub largest_process_p: f64,

    /// Probability of a sweep's residual under noise, over all tests, below which the residual exceeds the noise. `sample` uses the same value (campaign `sweeps`).
    pub least_noise_p: f64,
    /// Largest ratio of a claim's error on held-out cycles to its predictive noise. Above it the cause is unexplained, as with a misfit in [`posterior::misfit`]. If the
    /// model lacks further effects, its noise estimate contains them (campaigns `pairs`, `cohorts`).
    pub claim_factor: f64,
    /// Ratio of a residual to the known noise above which a record without a claim is doubtful: slow noise may have caused the residual (campaign `controls`).
    pub doubtful_factor: f64,
    /// Probability under white noise of the known size below which a residual above `doubtful_factor` is doubtful: one in a thousand, as in [`posterior::misfit`].
    pub doubtful_p: f64,

    /// Difference of ranks (nats) below which a rival is equivalent to the claim. Record: 6, and the experiment must not separate the two (campaigns `singles`, `fields`).
    /// Sweep: 2, in fitted and in held-out frequencies, with no other test (campaign `sweeps`). Cohort: infinite, because simulated cohorts decide (campaign `cohorts`).
    pub equivalent_nats: f64,
    /// Distance, in standard deviations of the noise, from which the experiment separates a rival from the claim.
    pub separated_sigma: f64,
    /// Smallest fraction of cohorts simulated from a rival in which the claim leads by at least as much as in the data. A rival with a smaller fraction is excluded. The
    /// true effect is excluded in at most 2 of 100 cohorts (campaign `cohorts`).
    pub least_rival_p: f64,
    /// Least rank of an effect that is fitted to every record before a cohort claims any effect, as a fraction of the largest rank. In one cohort with a hidden pocket (field 3 of
    /// campaign `cohorts`), first-order ranks were 62 nats for the pocket and 68 for fractional damping. With full fits they were 82 and 79.
    pub near_rank: f64,
    /// Fraction of the claim's gain below which a rival effect in a cohort is not tested: no equivalent effect gains so little (campaign `cohorts`).
    pub least_rival_share: f64,

    /// Least gain (nats) of an effect that is reported as suggestive or gets a Bayes factor.
    pub least_gain_nats: f64,
    /// Largest p of a suggestive effect. For records it is 1, so that only `least_gain_nats` decides.
    pub suggestive_p: f64,
    /// Least fraction of an effect's signature that the base cannot absorb. An effect with a smaller fraction is invisible.
    pub least_visible: f64,
}

impl Criteria {
    /// Thresholds for one creep record.
    pub const RECORD: Self = Self {
        largest_p: 0.05,
        least_future_nats: Some(2.0),
        least_fitted_nats: 0.0,
        largest_loss_nats: 0.1,
        smallest_change: 0.25,
        most_effects: 3,
        larger_factor: 1.03,
        larger_nats: 8.0,
        least_removal_nats: 4.0,
        largest_structure_p: 0.02,
        least_structure_nats: 5.5,
        chance_nats: 1.5,
        structure_lead_nats: 4.0,
        least_structure_share: 0.1,
        least_similar_cosine: 0.95,
        largest_process_p: 0.05,
        least_noise_p: 0.01,
        claim_factor: posterior::misfit::NOISE_FACTOR,
        doubtful_factor: 1.3,
        doubtful_p: posterior::misfit::FALSE_ALARM,
        equivalent_nats: 6.0,
        separated_sigma: SEPARATED_SIGMA,
        least_rival_p: 0.02,
        near_rank: 0.8,
        least_rival_share: 0.2,
        least_gain_nats: 2.0,
        suggestive_p: 1.0,
        least_visible: 1e-3,
    };

    /// Thresholds for one oscillation.
    pub const SWEEP: Self = Self {
        largest_p: 0.01,
        least_future_nats: None,
        smallest_change: 0.0,
        most_effects: 1,
        equivalent_nats: 2.0,
        ..Self::RECORD
    };

    /// Thresholds for many records together.
    pub const COHORT: Self = Self {
        largest_p: 0.01,
        least_fitted_nats: 2.0,
        smallest_change: 0.0,
        most_effects: 1,
        equivalent_nats: f64::INFINITY,
        least_gain_nats: 0.0,
        suggestive_p: 0.05,
        ..Self::RECORD
    };

    /// Returns the largest p at which a round may claim an effect. Rounds count from 0.
    pub fn p_of_round(&self, round: usize) -> f64 {
        self.largest_p / 2.0_f64.powi(round as i32)
    }

    /// Returns the least rank (nats) at which a model with more effects is preferred to one with fewer effects and the rank `rank_nats`. A rank is a gain in log likelihood, less
    /// a penalty for additional parameters.
    pub fn rank_of_larger(&self, rank_nats: f64) -> f64 {
        self.larger_factor * rank_nats.max(0.0) + self.larger_nats
    }
}

impl Default for Criteria {
    fn default() -> Self {
        Self::RECORD
    }
}
