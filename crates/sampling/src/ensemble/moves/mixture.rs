//! Mixture: every half-step uses one of several moves, drawn with fixed weights.

use super::{Move, WalkerPoints};
use crate::ensemble::random::RandomStream;

/// Moves with weights. The choice does not depend on the walkers, so that the mixture keeps every distribution invariant that
/// all its moves keep.
pub struct Mixture {
    /// Upper ends of the cells of [0, 1) that choose a move.
    moves: Vec<(f64, Box<dyn Move>)>,
    name: String,
}

impl Mixture {
    /// Builds a mixture from weights that need not add up to one. Moves without a positive, finite weight are omitted.
    pub fn new(weighted: Vec<(f64, Box<dyn Move>)>) -> Self {
        let mut moves = weighted;
        moves.retain(|(weight, _)| *weight > 0.0 && weight.is_finite());
        let total: f64 = moves.iter().map(|(weight, _)| weight).sum();
        let describe = |(weight, part): &(f64, Box<dyn Move>)| format!("{}*{}", weight / total, part.name());
        let name = format!("mixture({})", moves.iter().map(describe).collect::<Vec<_>>().join(","));
        let mut upper = 0.0;
        for (weight, _) in &mut moves {
            upper += *weight / total;
            *weight = upper;
        }
        Self { moves, name }
    }
}

impl Move for Mixture {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn propose(
        &self,
        moving: WalkerPoints,
        complement: WalkerPoints,
        shared: &mut RandomStream,
        random_streams: &mut [RandomStream],
        proposals: &mut [f64],
        log_factors: &mut [f64],
    ) {
        let u = shared.unit();
        let chosen = self.moves.iter().find(|(upper, _)| u < *upper).or(self.moves.last());
        match chosen {
            Some((_, part)) => part.propose(moving, complement, shared, random_streams, proposals, log_factors),
            // An empty mixture does not move.
            None => {
                proposals.copy_from_slice(moving.coordinates);
                log_factors.fill(0.0);
            }
        }
    }
}
