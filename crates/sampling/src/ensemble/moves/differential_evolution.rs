//! Differential evolution: a walker at x moves along the difference of two other walkers c₁ and c₂.
//!
//! The proposal is y = x + γ (c₁ − c₂) with γ = scale · u · 2.38/√(2d), for dimension d and u uniform on [1 − s, 1 + s]. A fraction of the proposals
//! use γ = 1 instead, which carries walkers between modes. The move is symmetric, so its correction factor is one. Sources: ter Braak 2006,
//! doi:10.1007/s11222-006-8769-1; Nelson, Ford & Payne 2013, doi:10.1088/0067-0049/210/1/11.

use super::{HalfStep, Move};

/// Differential-evolution move: a walker moves along the difference of two other walkers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DifferentialEvolution {
    /// Factor that multiplies the standard step 2.38/√(2d), for dimension d.
    pub scale: f64,
    /// Half-width s of the range [1 − s, 1 + s] of the random step factor, 0 ≤ s < 1.
    pub spread: f64,
    /// Fraction of proposals that add the whole difference of two walkers, which carries walkers between modes.
    pub jump_probability: f64,
}

impl Default for DifferentialEvolution {
    fn default() -> Self {
        Self { scale: 1.0, spread: 0.1, jump_probability: 0.1 }
    }
}

impl Move for DifferentialEvolution {
    fn name(&self) -> String {
        format!(
            "differential_evolution(scale={},spread={},jump_probability={})",
            self.scale, self.spread, self.jump_probability
        )
    }

    fn propose(&self, step: HalfStep) {
        let HalfStep { moving, complement, random_streams, proposals, log_factors, .. } = step;
        let gamma_0 = self.scale * 2.38 / (2.0 * moving.dimension as f64).sqrt();
        let (n, jump) = (complement.n, self.jump_probability);
        log_factors.fill(0.0);
        for (i, stream) in random_streams.iter_mut().enumerate() {
            let (a, b) = stream.distinct_pair(n);
            // One random number u makes both choices. If u is below `jump`, the walker jumps; otherwise the rescaled u is again uniform.
            let u = stream.unit();
            let factor = 1.0 + self.spread * (2.0 * (u - jump) / (1.0 - jump) - 1.0);
            let gamma = if u < jump { 1.0 } else { gamma_0 * factor };
            for d in 0..moving.dimension {
                let others = &complement.coordinates[d * n..(d + 1) * n];
                proposals[d * moving.n + i] = moving.coordinates[d * moving.n + i] + gamma * (others[a] - others[b]);
            }
        }
    }
}
