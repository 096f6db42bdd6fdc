//! The thresholds of all verdicts, in one place, with their reasons.
//!
//! [`Criteria::RECORD`] is for one creep record, [`Criteria::SWEEP`] for one oscillation, [`Criteria::COHORT`] for many records. A field names the campaign (`campaigns/`) that counts how often
//! verdicts with its value are right; no campaign varies a value alone. Other commands share two further rules: [`posterior::misfit`] decides when a residual exceeds the noise, and
//! [`SEPARATED_SIGMA`] when an experiment separates two models. Tolerances and budgets of computations decide no verdict and are defined beside their use.

use super::separation::SEPARATED_SIGMA;

/// Decision thresholds. Gains are in nats of log likelihood; every model's noise is estimated anew.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criteria {
    /// Largest p of a claim, over the whole search; each further round of additions uses half of the previous p. Record: 0.05. It claims an effect in 10 of 2,800 records without a hidden effect,
    /// since future cycles must agree (controls). Sweep: 0.01, since held-out frequencies need not gain (sweeps). Cohort: 0.01 (cohorts).
    pub largest_p: f64,
    /// Gain in the log score of future cycles that a claim has to exceed; `None` where a claim may rest on fitted data alone. Record and cohort: 2 nats (controls, cohorts).
    /// Sweep: none, since an effect need not show in the held-out frequencies (sweeps).
    pub least_future_nats: Option<f64>,
    /// Largest loss of a claim in the log score of the last cycle, or of held-out frequencies. An effect that does not show there changes that score very little. In six of eight records
    /// with a false claim and no hidden effect, the gain was on earlier cycles alone (controls).
    pub largest_loss_nats: f64,
    /// Smallest change of a predicted position, over the noise (`--smallest`); a smaller change has no use. Sweeps and cohorts do not use this threshold.
    pub smallest_change: f64,
    /// Most effects of a claim. Campaigns hide two at most (pairs).
    pub most_effects: usize,
    /// A larger model is tried where its rank exceeds the smaller one's by this factor and by `larger_nats` (pairs).
    pub larger_factor: f64,
    /// See `larger_factor`. Structure that would replace a claim gets so many nats of allowance for each effect of the claim beyond the first.
    pub larger_nats: f64,
    /// An effect of a larger claim is left out if its removal costs less and the rest passes alone (pairs).
    pub least_removal_nats: f64,

    /// Largest p of structure outside the library, by 199 simulated residuals; simulated records confirm structure that passes (controls, outside).
    pub largest_structure_p: f64,
    /// Least gain of structure outside the library, less its family's gain by chance (controls, outside).
    pub least_structure_nats: f64,
    /// Gain of the library's best effect by chance: structure in its place gets the same allowance.
    pub chance_nats: f64,
    /// Lead that structure needs to replace a claim whose own residual shows no structure (outside).
    pub structure_lead_nats: f64,
    /// Share of a claim's gain that structure in its residual must gain to count. This share is also added to the lead (outside).
    pub least_structure_share: f64,
    /// Cosine above which structure and an effect of the library are treated as alike: backlash is a delay on a square wave (outside).
    pub least_similar_cosine: f64,
    /// Largest p at which a process beside a known structure is reported.
    pub largest_process_p: f64,

    /// Smallest probability of a sweep's residual, over all tests, that counts as noise; shared with `sample` (sweeps).
    pub least_noise_p: f64,
    /// Multiple of its predictive noise above which a claim's error on held-out cycles leaves the cause unexplained, like a misfit in [`posterior::misfit`]. The noise estimate of a model that lacks
    /// further effects contains those effects (pairs, cohorts).
    pub claim_factor: f64,
    /// Multiple of the known noise above which a residual without a claim is not reported as noise: slow noise may have caused it (controls).
    pub doubtful_factor: f64,
    /// Probability of such a residual under white noise of the known size. Above this value, one in a thousand as in [`posterior::misfit`], the residual is not doubtful.
    pub doubtful_p: f64,

    /// The data cannot rule out a rival whose rank is within so many nats of the claim's. Record: 6, and the experiment must not separate them (singles, fields). Sweep: 2, in fitted and in held-out
    /// frequencies, with no other test (sweeps). Cohort: any, since simulated cohorts decide (cohorts).
    pub equivalent_nats: f64,
    /// Distance in σ from which the experiment separates a rival from the claim.
    pub separated_sigma: f64,
    /// Smallest share of simulated cohorts, made with the rival, in which the claim leads by as much; a rival with a lower share is excluded. The truth is excluded in at most 2 of 100 (cohorts).
    pub least_rival_p: f64,
    /// Before a cohort claims an effect, effects whose rank is at least this share of the largest are fitted to every record. In one cohort with a hidden pocket
    /// (field 3 of cohorts), first-order ranks were 62 nats for the pocket and 68 for fractional damping; with full fits they were 82 and 79.
    pub near_rank: f64,
    /// Share of the claim's gain below which a cohort's rival is not tested: no equivalent effect gains so little (cohorts).
    pub least_rival_share: f64,

    /// Least gain of an effect that is reported as suggestive or gets a Bayes factor.
    pub least_gain_nats: f64,
    /// Largest p of a suggestive effect. Records use a threshold of gain, cohorts of p.
    pub suggestive_p: f64,
    /// Least share of a signature that the base cannot absorb; an effect with less is invisible.
    pub least_visible: f64,
}

impl Criteria {
    /// Thresholds for one creep record.
    pub const RECORD: Self = Self {
        largest_p: 0.05,
        least_future_nats: Some(2.0),
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
        smallest_change: 0.0,
        most_effects: 1,
        equivalent_nats: f64::INFINITY,
        least_gain_nats: 0.0,
        suggestive_p: 0.05,
        ..Self::RECORD
    };

    /// Largest p of a round; rounds count from 0.
    pub fn p_of_round(&self, round: usize) -> f64 {
        self.largest_p / 2.0_f64.powi(round as i32)
    }

    /// Least rank of a larger model that is preferred to a smaller one of this rank, in nats.
    pub fn rank_of_larger(&self, rank_nats: f64) -> f64 {
        self.larger_factor * rank_nats.max(0.0) + self.larger_nats
    }
}

impl Default for Criteria {
    fn default() -> Self {
        Self::RECORD
    }
}
