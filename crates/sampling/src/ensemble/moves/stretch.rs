//! Stretch move: a walker at x moves along the line through another walker c.
//!
//! The proposal is y = c + z (x − c), where z has a density proportional to 1/√z on [1/a, a]. It is accepted with probability min(1, z^(d−1)
//! π(y)/π(x)); d is the dimension and π the target density. Source: Goodman & Weare 2010, doi:10.2140/camcos.2010.5.65, eq. 7–9.

use super::{HalfStep, Move};

/// Stretch move: a walker moves along the line through another walker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stretch {
    /// Largest factor a > 1 by which the distance from the other walker grows or shrinks.
    pub scale: f64,
}

impl Default for Stretch {
    fn default() -> Self {
        Self { scale: 2.0 }
    }
}

impl Move for Stretch {
    fn name(&self) -> String {
        format!("stretch(scale={})", self.scale)
    }

    fn propose(&self, step: HalfStep) {
        let HalfStep { moving, complement, random_streams, proposals, log_factors, .. } = step;
        let exponent = moving.dimension as f64 - 1.0;
        for (i, stream) in random_streams.iter_mut().enumerate() {
            let partner = stream.below(complement.n);
            // The factor z is drawn from a density ∝ 1/√z on [1/a, a] by the inverse distribution function.
            let z = ((self.scale - 1.0) * stream.unit() + 1.0).powi(2) / self.scale;
            log_factors[i] = exponent * z.ln();
            for d in 0..moving.dimension {
                let c = complement.coordinates[d * complement.n + partner];
                proposals[d * moving.n + i] = c + z * (moving.coordinates[d * moving.n + i] - c);
            }
        }
    }
}
