//! What a caller of `diagnose` decides.

use super::search::Bars;

/// What a caller decides.
#[derive(Debug, Clone, PartialEq)]
pub struct DiagnosisRequest {
    /// What a claim has to pass.
    pub bars: Bars,
    /// Most simulated searches a round.
    pub n_simulations: usize,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Whether to look for what only words need: evidence of all candidates, protocols, smallest sizes. `challenge run` leaves them out.
    pub in_full: bool,
}

impl Default for DiagnosisRequest {
    fn default() -> Self {
        let bars = Bars { largest_p: 0.05, least_future_nats: 2.0, smallest_change: 0.25 };
        Self { bars, n_simulations: 99, seed: 1, in_full: true }
    }
}
