//! The thresholds of all verdicts, in one place, with their reasons.
//!
//! [`Criteria::RECORD`] is for one creep record, [`Criteria::SWEEP`] for one oscillation, [`Criteria::COHORT`] for many records. A field names the campaign (`campaigns/`) that counts how often
//! verdicts with its value are right; no campaign varies a value alone. Two rules are shared with other commands and stand elsewhere: when a residual exceeds the noise ([`posterior::misfit`]), and
//! when an experiment separates two models ([`SEPARATED_SIGMA`]). Tolerances and budgets of computations decide nothing and stand where they are used.

use super::separation::SEPARATED_SIGMA;

/// Decision thresholds. Gains are in nats of log likelihood, noise estimated anew for every model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criteria {
    /// Largest p, over the whole search, of a claim; each further round of additions spends half of the one before. Record: 0.05, with which 10 of 2,800 records without anything hidden are claimed, since
    /// future cycles have to agree (controls). Sweep: 0.01, since held-out frequencies need not gain (sweeps). Cohort: 0.01 (cohorts).
    pub largest_p: f64,
    /// Gain in the log score of future cycles that a claim has to exceed; `None` where a claim may rest on fitted data alone. Record and cohort: 2 nats (controls, cohorts). A sweep does not ask for it:
    /// an effect need not show in the held-out frequencies (sweeps).
    pub least_future_nats: Option<f64>,
    /// What a claim may lose in the log score of the last cycle, or of held-out frequencies: an effect that does not show there gains and loses next to nothing. In six of eight records with nothing
    /// hidden and an effect claimed, the gain was on earlier cycles alone (controls).
    pub largest_loss_nats: f64,
    /// Smallest change of a predicted position, over the noise (`--smallest`): a smaller one has no use. A sweep and a cohort do not ask for it.
    pub smallest_change: f64,
    /// Most effects of a claim. Campaigns hide two at most (pairs).
    pub most_effects: usize,
    /// A larger model is tried where its rank exceeds the smaller one's by this factor and by `larger_nats` (pairs).
    pub larger_factor: f64,
    /// See `larger_factor`. Structure in place of a claim is spared so many nats for each effect of the claim beyond the first.
    pub larger_nats: f64,
    /// An effect of a larger claim whose removal costs less is left out, if the rest passes by itself (pairs).
    pub least_removal_nats: f64,

    /// Largest p of structure outside the library, by 199 simulated residuals; simulated records confirm what passes (controls, outside).
    pub largest_structure_p: f64,
    /// Least gain of structure outside the library, less what its family gains by chance (controls, outside).
    pub least_structure_nats: f64,
    /// What the best effect of the library gains by chance: structure in its place is spared as much.
    pub chance_nats: f64,
    /// Lead that structure needs to take the place of a claim whose own residual shows none (outside).
    pub structure_lead_nats: f64,
    /// Share of a claim's gain that structure in its residual has to gain to count; added to the lead as well (outside).
    pub least_structure_share: f64,
    /// Cosine above which structure and an effect of the library look alike: backlash is a delay on a square wave (outside).
    pub twin_cosine: f64,
    /// Largest p of a process beside a known structure that is reported.
    pub largest_process_p: f64,

    /// Probability, over all tests of a sweep's residual, below which it is not noise; shared with `sample` (sweeps).
    pub least_noise_p: f64,
    /// Multiple of its predictive noise above which the error of a claim on held-out cycles leaves the cause unexplained, as of a misfit in [`posterior::misfit`]; the noise of a model that lacks more holds
    /// what it lacks (pairs, cohorts).
    pub claim_factor: f64,
    /// Multiple of the known noise above which a residual is not said to look like noise, though nothing is claimed: slow noise may have made it (controls).
    pub doubtful_factor: f64,
    /// Probability of such a residual under white noise of the known size above which it is not doubtful: one in a thousand, as in [`posterior::misfit`].
    pub doubtful_p: f64,

    /// Rivals whose rank is within so many nats of the claim's are within reach of the data. Record: 6, and the experiment must not separate them (singles, fields). Sweep: 2, in fitted and in held-out
    /// frequencies, with no other test (sweeps). Cohort: any, since simulated cohorts decide (cohorts).
    pub equivalent_nats: f64,
    /// Distance in σ from which on an experiment separates a rival from the claim.
    pub separated_sigma: f64,
    /// Share of simulated cohorts, made with the rival, in which the claim leads by as much: a rival with a lower share is excluded. The truth is excluded in at most 2 of 100 (cohorts).
    pub least_rival_p: f64,
    /// Effects of a cohort whose rank is at least this share of the largest are fitted to every record before one is claimed. In one cohort with a hidden pocket
    /// (field 3 of cohorts), first-order ranks were 62 nats for the pocket and 68 for fractional damping; with full fits they were 82 and 79.
    pub near_rank: f64,
    /// Share of the claim's gain below which a cohort's rival is not tested: no twin gains so little (cohorts).
    pub least_rival_share: f64,

    /// Gains below this are not reported as suggestive, and are not worth a Bayes factor.
    pub least_gain_nats: f64,
    /// Largest p of a suggestive effect. A record asks for a gain, a cohort for p.
    pub suggestive_p: f64,
    /// Share of a signature that the base cannot absorb below which an effect is invisible.
    pub least_visible: f64,
}

impl Criteria {
    /// Of one creep record.
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
        twin_cosine: 0.95,
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

    /// Of one oscillation.
    pub const SWEEP: Self = Self {
        largest_p: 0.01,
        least_future_nats: None,
        smallest_change: 0.0,
        most_effects: 1,
        equivalent_nats: 2.0,
        ..Self::RECORD
    };

    /// Of many records together.
    pub const COHORT: Self = Self {
        largest_p: 0.01,
        smallest_change: 0.0,
        most_effects: 1,
        equivalent_nats: f64::INFINITY,
        least_gain_nats: 0.0,
        suggestive_p: 0.05,
        ..Self::RECORD
    };

    /// Largest p of a round, from 0.
    pub fn p_of_round(&self, round: usize) -> f64 {
        self.largest_p / 2.0_f64.powi(round as i32)
    }

    /// Rank that a larger model needs beside a smaller one of this rank.
    pub fn rank_of_larger(&self, rank_nats: f64) -> f64 {
        self.larger_factor * rank_nats.max(0.0) + self.larger_nats
    }
}

impl Default for Criteria {
    fn default() -> Self {
        Self::RECORD
    }
}
