//! Settings of a diagnosis.

use super::criteria::Criteria;
use documents::errors::ModelErrors;

/// Settings of a diagnosis.
#[derive(Debug, Clone, PartialEq)]
pub struct DiagnosisRequest {
    /// Thresholds of the verdict.
    pub criteria: Criteria,
    /// Largest number of simulated searches per round.
    pub n_simulations: usize,
    /// Seed of all random numbers.
    pub seed: u64,
    /// True to compute every p, and the results that only the document's text needs: evidence of all candidates, protocols and smallest sizes. `challenge run` leaves them out.
    pub in_full: bool,
    /// Errors of the base model's posterior on these cycles, if it was sampled; else the document shows the errors of its best fit.
    pub base_errors: Option<ModelErrors>,
}

impl Default for DiagnosisRequest {
    fn default() -> Self {
        Self { criteria: Criteria::RECORD, n_simulations: 99, seed: 1, in_full: true, base_errors: None }
    }
}
