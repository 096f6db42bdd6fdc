//! Mixture of moves: each half-step uses one of several moves, chosen at random with fixed weights.

use super::{HalfStep, Move};

/// Several moves with weights, one of which is chosen at random for each half-step. The choice does not depend on the walkers. A distribution that
/// every move leaves invariant is therefore invariant under the mixture.
pub struct Mixture {
    /// Each move after its cumulative weight in [0, 1]. A uniform random number selects the first move whose cumulative weight exceeds it.
    moves: Vec<(f64, Box<dyn Move>)>,
    name: String,
}

impl Mixture {
    /// Builds a mixture of moves with weights, which need not add up to one. Moves whose weight is not positive and finite are omitted.
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

    fn propose(&self, step: HalfStep) {
        let u = step.shared.unit();
        let chosen = self.moves.iter().find(|(upper, _)| u < *upper).or(self.moves.last());
        match chosen {
            Some((_, part)) => part.propose(step),
            // An empty mixture leaves every walker in place.
            None => {
                step.proposals.copy_from_slice(step.moving.coordinates);
                step.log_factors.fill(0.0);
            }
        }
    }
}
