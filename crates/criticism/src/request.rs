//! Settings of a diagnosis.

use super::criteria::Criteria;
use documents::errors::ModelErrors;

/// Settings of a diagnosis.
#[derive(Debug, Clone, PartialEq)]
pub struct DiagnosisRequest {
    /// Thresholds of the verdict.
    pub criteria: Criteria,
    /// Most simulated searches a round.
    pub n_simulations: usize,
    /// Seed of all random numbers.
    pub seed: u64,
    /// True to compute every p and the results that only the text needs: evidence of all candidates, protocols, smallest sizes. `challenge run` leaves them out.
    pub in_full: bool,
    /// Errors of the base model's posterior on the same cycles, if it was sampled; else the document shows those of its best fit.
    pub base_errors: Option<ModelErrors>,
}

impl Default for DiagnosisRequest {
    fn default() -> Self {
        Self { criteria: Criteria::RECORD, n_simulations: 99, seed: 1, in_full: true, base_errors: None }
    }
}
