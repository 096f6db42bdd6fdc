//! Log densities that wrap another log density: one distributes evaluations over threads, one counts them.

use crate::LogDensity;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// Log density that splits each batch of points into smaller batches and evaluates them on the current thread pool. By the rules of [`LogDensity`], a
/// point's value does not depend on its batch. The results therefore equal those of the unsplit batch to the last bit.
pub(super) struct SplitDensity<'a> {
    pub inner: &'a dyn LogDensity,
    /// Number of points in each smaller batch.
    pub piece: usize,
}

impl LogDensity for SplitDensity<'_> {
    fn dimension(&self) -> usize {
        self.inner.dimension()
    }

    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        self.split(points, log_density, |_, entry, values| self.inner.log_density(entry, values));
    }

    fn log_density_above(&self, points: &[f64], floors: &[f64], log_density: &mut [f64]) {
        self.split(points, log_density, |first, entry, values| {
            self.inner.log_density_above(entry, &floors[first..first + values.len()], values);
        });
    }
}

impl SplitDensity<'_> {
    /// Evaluates each smaller batch by a function of the number of its first point, its points and its values.
    fn split(&self, points: &[f64], log_density: &mut [f64], evaluate: impl Fn(usize, &[f64], &mut [f64]) + Sync) {
        let (n, dimension) = (log_density.len(), self.dimension());
        log_density.par_chunks_mut(self.piece.max(1)).enumerate().for_each(|(k, values)| {
            let first = k * self.piece.max(1);
            let entry: Vec<f64> =
                (0..dimension).flat_map(|d| &points[d * n + first..d * n + first + values.len()]).copied().collect();
            evaluate(first, &entry, values);
        });
    }
}

/// Log density that counts its evaluations. It is used for the search for modes and the recovery of walkers; evaluations of regular steps follow from
/// the number of steps.
pub(super) struct CountingDensity<'a> {
    inner: &'a dyn LogDensity,
    count: AtomicU64,
}

impl<'a> CountingDensity<'a> {
    pub fn new(inner: &'a dyn LogDensity) -> Self {
        Self { inner, count: AtomicU64::new(0) }
    }

    pub fn count(&self) -> u64 {
        self.count.load(Ordering::Relaxed)
    }
}

impl LogDensity for CountingDensity<'_> {
    fn dimension(&self) -> usize {
        self.inner.dimension()
    }

    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        self.count.fetch_add(log_density.len() as u64, Ordering::Relaxed);
        self.inner.log_density(points, log_density);
    }

    fn log_density_above(&self, points: &[f64], floors: &[f64], log_density: &mut [f64]) {
        self.count.fetch_add(log_density.len() as u64, Ordering::Relaxed);
        self.inner.log_density_above(points, floors, log_density);
    }
}
