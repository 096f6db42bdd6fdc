//! Draws that a sampling run keeps.

use super::walkers::Ensemble;
use crate::diagnostics::DrawColumn;

/// Draws of all ensembles since the end of the burn-in.
#[derive(Debug, Clone, PartialEq)]
pub struct Draws {
    /// Number of independent ensembles.
    pub n_ensembles: usize,
    /// Number of kept steps per ensemble.
    pub n_steps: usize,
    /// Number of walkers per ensemble.
    pub n_walkers: usize,
    /// Number of unconstrained coordinates of a point.
    pub dimension: usize,
    /// Interval between kept steps, in steps.
    pub store_every: u64,
    /// Positions of the walkers. Coordinate d of walker w at kept step s of ensemble e is at `positions[((e·n_steps + s)·dimension + d)·n_walkers +
    /// w]`.
    pub positions: Vec<f64>,
    /// Log densities at the walkers' positions. The value of walker w at kept step s of ensemble e is at `log_density[(e·n_steps + s)·n_walkers +
    /// w]`.
    pub log_density: Vec<f64>,
}

impl Draws {
    /// Value of coordinate d of one draw.
    pub fn value(&self, ensemble: usize, step: usize, walker: usize, d: usize) -> f64 {
        self.positions[((ensemble * self.n_steps + step) * self.dimension + d) * self.n_walkers + walker]
    }

    /// Coordinates of one draw.
    pub fn point(&self, ensemble: usize, step: usize, walker: usize) -> Vec<f64> {
        (0..self.dimension).map(|d| self.value(ensemble, step, walker, d)).collect()
    }

    /// Returns the coordinates of `n` draws, evenly distributed over ensembles, steps and walkers. The indices advance by the golden ratio, so that
    /// no walkers are preferred.
    pub fn subsample(&self, n: usize) -> Vec<Vec<f64>> {
        let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
        let pick = |k: usize| {
            let index = (((k as f64 + 0.5) * golden).fract() * self.len() as f64) as usize;
            let (step, walker) = (index / self.n_walkers, index % self.n_walkers);
            self.point(step / self.n_steps, step % self.n_steps, walker)
        };
        (0..n).map(pick).collect()
    }

    /// Number of draws.
    pub fn len(&self) -> usize {
        self.log_density.len()
    }

    /// Returns `true` if there are no draws.
    pub fn is_empty(&self) -> bool {
        self.log_density.is_empty()
    }

    /// Values of coordinate d of all draws. The walker changes fastest, then the step, then the ensemble.
    pub fn column(&self, d: usize) -> DrawColumn {
        let stride = self.dimension * self.n_walkers;
        let mut values = Vec::with_capacity(self.len());
        for step in self.positions.chunks_exact(stride.max(1)) {
            values.extend_from_slice(&step[d * self.n_walkers..(d + 1) * self.n_walkers]);
        }
        self.with_values(values)
    }

    /// Returns the draws of all ensembles from kept step `first` on, one vector of coordinates per draw, and their log densities.
    pub fn since(&self, first: usize) -> (Vec<Vec<f64>>, Vec<f64>) {
        let (mut points, mut log_density) = (Vec::new(), Vec::new());
        for ensemble in 0..self.n_ensembles {
            for step in first..self.n_steps {
                points.extend((0..self.n_walkers).map(|walker| self.point(ensemble, step, walker)));
            }
            let row = |step: usize| (ensemble * self.n_steps + step) * self.n_walkers;
            log_density.extend_from_slice(&self.log_density[row(first)..row(self.n_steps)]);
        }
        (points, log_density)
    }

    fn with_values(&self, values: Vec<f64>) -> DrawColumn {
        DrawColumn { n_ensembles: self.n_ensembles, n_steps: self.n_steps, n_walkers: self.n_walkers, values }
    }
}

/// Draws that one ensemble has kept so far.
#[derive(Debug, Clone, Default)]
pub(super) struct DrawRecord {
    pub positions: Vec<f64>,
    pub log_density: Vec<f64>,
    pub n_stored: usize,
    /// Step of the ensemble after which draws are recorded.
    pub base_step: u64,
    pub store_every: u64,
}

impl DrawRecord {
    /// Makes an empty record with memory for `capacity` steps.
    pub fn new(base_step: u64, store_every: u64, capacity: usize, dimension: usize, n_walkers: usize) -> Self {
        Self {
            positions: Vec::with_capacity(capacity * dimension * n_walkers),
            log_density: Vec::with_capacity(capacity * n_walkers),
            n_stored: 0,
            base_step,
            store_every,
        }
    }

    /// Deletes all draws. Recording begins again after step `base_step`.
    pub fn restart(&mut self, base_step: u64, store_every: u64) {
        self.positions.clear();
        self.log_density.clear();
        (self.n_stored, self.base_step, self.store_every) = (0, base_step, store_every);
    }

    /// Stores the positions of the ensemble's walkers if the present step is due for storage. A record that reaches `limit` steps is then reduced to
    /// every second step.
    pub fn keep(&mut self, ensemble: &Ensemble, limit: Option<usize>) {
        if !(ensemble.n_steps() - self.base_step).is_multiple_of(self.store_every) {
            return;
        }
        ensemble.record(&mut self.positions, &mut self.log_density);
        self.n_stored += 1;
        if limit == Some(self.n_stored) {
            self.thin();
        }
    }

    /// Deletes the 1st, 3rd, 5th, … kept step and doubles the interval between kept steps.
    fn thin(&mut self) {
        let kept = self.n_stored / 2;
        for values in [&mut self.positions, &mut self.log_density] {
            let stride = values.len() / self.n_stored;
            for k in 0..kept {
                values.copy_within((2 * k + 1) * stride..(2 * k + 2) * stride, k * stride);
            }
            values.truncate(kept * stride);
        }
        self.n_stored = kept;
        self.store_every *= 2;
    }
}

/// Joins the records of all ensembles into one set of draws. The ensembles must have made equally many steps.
pub(super) fn join(records: &[&DrawRecord], dimension: usize, n_walkers: usize) -> Draws {
    let first = records.first();
    Draws {
        n_ensembles: records.len(),
        n_steps: first.map_or(0, |record| record.n_stored),
        n_walkers,
        dimension,
        store_every: first.map_or(1, |record| record.store_every),
        positions: records.iter().map(|record| &record.positions[..]).collect::<Vec<_>>().concat(),
        log_density: records.iter().map(|record| &record.log_density[..]).collect::<Vec<_>>().concat(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_the_multiples_of_the_new_interval() {
        let mut record = DrawRecord::new(10, 1, 8, 1, 2);
        for step in 1..=8 {
            record.positions.extend([f64::from(step), -f64::from(step)]);
            record.log_density.extend([0.5 * f64::from(step); 2]);
            record.n_stored += 1;
        }
        record.thin();
        assert_eq!(record.positions, [2.0, -2.0, 4.0, -4.0, 6.0, -6.0, 8.0, -8.0]);
        assert_eq!(record.log_density, [1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0, 4.0]);
        assert_eq!((record.n_stored, record.store_every), (4, 2));
    }
}
