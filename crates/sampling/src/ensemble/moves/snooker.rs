//! Snooker move: a walker at x moves along the line through another walker c. The step is the projected difference of two further walkers c₁ and c₂.
//!
//! The proposal is y = x + γ ((c₁ − c₂)·e) e, where e is the unit vector along x − c. It is accepted with probability min(1, (|y − c|/|x − c|)^(d−1)
//! π(y)/π(x)); d is the dimension and π the target density. Source: ter Braak & Vrugt 2008, doi:10.1007/s11222-008-9104-9, eq. 3–4.

use super::{HalfStep, Move};

/// Snooker move: a walker moves along the line through another walker, by the projected difference of two further walkers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Snooker {
    /// Factor γ that multiplies the projected difference of two walkers.
    pub scale: f64,
}

impl Default for Snooker {
    fn default() -> Self {
        Self { scale: 1.7 }
    }
}

impl Move for Snooker {
    fn name(&self) -> String {
        format!("snooker(scale={})", self.scale)
    }

    fn propose(&self, step: HalfStep) {
        let HalfStep { moving, complement, random_streams, proposals, log_factors, .. } = step;
        let n = complement.n;
        let exponent = 0.5 * (moving.dimension as f64 - 1.0);
        for (i, stream) in random_streams.iter_mut().enumerate() {
            let (anchor, a, b) = stream.distinct_triple(n);
            let (mut distance2, mut projected) = (0.0, 0.0);
            for d in 0..moving.dimension {
                let others = &complement.coordinates[d * n..(d + 1) * n];
                let towards = moving.coordinates[d * moving.n + i] - others[anchor];
                distance2 += towards * towards;
                projected += (others[a] - others[b]) * towards;
            }
            // A walker at the position of the anchor c has no direction to move in, so it stays.
            let along = if distance2 > 0.0 { self.scale * projected / distance2 } else { 0.0 };
            for d in 0..moving.dimension {
                let x = moving.coordinates[d * moving.n + i];
                proposals[d * moving.n + i] = x + along * (x - complement.coordinates[d * n + anchor]);
            }
            // The correction factor uses y − c = (1 + along)(x − c), for the proposal y and the anchor c.
            log_factors[i] = exponent * ((1.0 + along) * (1.0 + along)).ln();
        }
    }
}
