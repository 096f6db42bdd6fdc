//! Search for walkers that never joined the others.
//!
//! If an ensemble starts far from the mode, one or two walkers may never reach it. Their draws then dominate a standard deviation. Neither an
//! autocorrelation time nor R̂ over walkers shows this fault. This module examines a window of kept steps and looks for three signs among the walkers
//! of all ensembles:
//! - *low*: the walker's mean log density is below the median of all draws by more than five times the distance between median and 5 % quantile. For
//!   a Gaussian posterior in up to 20 dimensions, even a single draw is below this threshold only with a probability below 10⁻⁶. Heavy tails increase
//!   the distance of the threshold from the median.
//! - *stuck*: the walker did not move in the window, while others would have moved with probability 1 − 10⁻¹².
//! - *apart*: for some coordinate, the walker's mean differs from the median of all walkers' means. The difference exceeds ten robust standard deviations
//!   of these means, and it exceeds the walker's own spread.
//!
//! If more than a quarter of the walkers are stuck, or more than a quarter are apart, no walker is listed for that reason. The cause is then slow
//! mixing or a second mode with mass, which R̂ over walkers and the effective sample size show.
//!
//! The sampler does not move a walker because of these signs alone. It first climbs from the walker's position to a maximum and then decides (see
//! [`super::sample`]).

use super::draws::Draws;
use crate::diagnostics::ranks::{Sorted, median};

/// Sign by which a walker is suspected of not having joined the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SuspicionReason {
    /// The walker's mean log density is far below that of the other walkers.
    Low,
    /// The walker did not move in the window of examined steps.
    Stuck,
    /// The walker's mean position is far from that of the other walkers.
    Apart,
}

/// Walker that may have failed to join the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SuspiciousWalker {
    /// Index of the walker's ensemble.
    pub ensemble: usize,
    /// Index of the walker within the ensemble.
    pub walker: usize,
    /// Sign that the walker may not have joined the others.
    pub reason: SuspicionReason,
    /// Mean of the walker's log density over the examined steps.
    pub mean_log_density: f64,
}

const LOW_FACTOR: f64 = 5.0;
const STUCK_PROBABILITY: f64 = 1e-12;
const APART_FACTOR: f64 = 10.0;

/// Returns the walkers that may have failed to join the others, judged by the second half of the kept steps. The list is empty if fewer than 8 steps
/// are kept.
pub fn find_suspicious_walkers(draws: &Draws) -> Vec<SuspiciousWalker> {
    let first = draws.n_steps / 2;
    if draws.n_steps < 8 {
        return Vec::new();
    }
    let window = Window::new(draws, first);
    let low = window.low_limit();
    let stuck = window.stuck_after();
    let apart = window.apart();
    let mut found = Vec::new();
    for ensemble in 0..draws.n_ensembles {
        for walker in 0..draws.n_walkers {
            let idx = ensemble * draws.n_walkers + walker;
            let mean_log_density = window.mean_log_density[idx];
            let reason = if mean_log_density < low {
                SuspicionReason::Low
            } else if stuck && window.moves[idx] == 0 {
                SuspicionReason::Stuck
            } else if apart[idx] {
                SuspicionReason::Apart
            } else {
                continue;
            };
            found.push(SuspiciousWalker { ensemble, walker, reason, mean_log_density });
        }
    }
    for reason in [SuspicionReason::Stuck, SuspicionReason::Apart] {
        let n = found.iter().filter(|suspect| suspect.reason == reason).count();
        if 4 * n > draws.n_ensembles * draws.n_walkers {
            found.retain(|suspect| suspect.reason != reason);
        }
    }
    found
}

/// Statistics of all walkers over a window of kept steps. Vectors have one entry per walker, ensemble by ensemble.
struct Window<'a> {
    draws: &'a Draws,
    first: usize,
    mean_log_density: Vec<f64>,
    /// Number of kept steps at which the walker's position differs from that at the previous kept step.
    moves: Vec<usize>,
}

impl<'a> Window<'a> {
    fn new(draws: &'a Draws, first: usize) -> Self {
        let n = draws.n_ensembles * draws.n_walkers;
        let mut window = Self { draws, first, mean_log_density: Vec::new(), moves: vec![0; n] };
        window.mean_log_density = window.means(|ensemble, step| window.log_densities(ensemble, step), |_, value| value);
        for ensemble in 0..draws.n_ensembles {
            for step in first + 1..draws.n_steps {
                let before = &draws.log_density[(ensemble * draws.n_steps + step - 1) * draws.n_walkers..];
                let here = &draws.log_density[(ensemble * draws.n_steps + step) * draws.n_walkers..];
                let take = window.moves[ensemble * draws.n_walkers..].iter_mut().take(draws.n_walkers);
                take.zip(here).zip(before).for_each(|((moves, here), before)| *moves += usize::from(here != before));
            }
        }
        window
    }

    fn steps(&self) -> std::ops::Range<usize> {
        self.first..self.draws.n_steps
    }

    /// Log densities of an ensemble at a step, one entry per walker.
    fn log_densities(&self, ensemble: usize, step: usize) -> &'a [f64] {
        let Draws { n_steps, n_walkers, log_density, .. } = self.draws;
        &log_density[(ensemble * n_steps + step) * n_walkers..][..*n_walkers]
    }

    /// Values of coordinate d of an ensemble at a step, one entry per walker.
    fn coordinates(&self, ensemble: usize, step: usize, d: usize) -> &'a [f64] {
        let Draws { n_steps, n_walkers, dimension, positions, .. } = self.draws;
        &positions[((ensemble * n_steps + step) * dimension + d) * n_walkers..][..*n_walkers]
    }

    /// Mean of `of(walker, value)` over the steps of the window, one entry per walker. `row(ensemble, step)` returns the values, one per walker.
    fn means(&self, row: impl Fn(usize, usize) -> &'a [f64], of: impl Fn(usize, f64) -> f64) -> Vec<f64> {
        let n_walkers = self.draws.n_walkers;
        let mut sums = vec![0.0; self.draws.n_ensembles * n_walkers];
        for ensemble in 0..self.draws.n_ensembles {
            for step in self.steps() {
                let skip = sums.iter_mut().enumerate().skip(ensemble * n_walkers);
                skip.zip(row(ensemble, step)).for_each(|((walker, sum), value)| *sum += of(walker, *value));
            }
        }
        let n = self.steps().len() as f64;
        sums.iter_mut().for_each(|sum| *sum /= n);
        sums
    }

    /// Threshold for a walker's mean log density. A walker below the threshold is *low*.
    fn low_limit(&self) -> f64 {
        let row = self.draws.n_walkers;
        let pooled: Vec<f64> = (0..self.draws.n_ensembles)
            .flat_map(|e| {
                &self.draws.log_density[(e * self.draws.n_steps + self.first) * row..(e + 1) * self.draws.n_steps * row]
            })
            .copied()
            .collect();
        let sorted = Sorted::new(&pooled);
        let middle = sorted.quantile(0.5);
        middle - LOW_FACTOR * (middle - sorted.quantile(0.05))
    }

    /// Returns `true` if the window is so long that a walker without any move in it counts as *stuck*.
    fn stuck_after(&self) -> bool {
        let rates: Vec<f64> = self.moves.iter().map(|n| *n as f64 / (self.steps().len() - 1) as f64).collect();
        (1.0 - median(&rates)).powi(self.steps().len() as i32 - 1) < STUCK_PROBABILITY
    }

    /// Returns one flag per walker: `true` if the mean of some coordinate is far *apart* from the means of the other walkers.
    fn apart(&self) -> Vec<bool> {
        let mut apart = vec![false; self.draws.n_ensembles * self.draws.n_walkers];
        for d in 0..self.draws.dimension {
            let row = |ensemble: usize, step: usize| self.coordinates(ensemble, step, d);
            let means = self.means(row, |_, x| x);
            let variances = self.means(row, |walker, x| (x - means[walker]) * (x - means[walker]));
            let centre = median(&means);
            let deviations: Vec<f64> = means.iter().map(|mean| (mean - centre).abs()).collect();
            // For a Gaussian, 1.4826 times the median absolute deviation is the standard deviation.
            let robust_sd = 1.4826 * median(&deviations);
            for (k, variance) in variances.iter().enumerate() {
                apart[k] |= deviations[k] > APART_FACTOR * robust_sd && deviations[k] > variance.sqrt();
            }
        }
        apart
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ensemble::random::RandomStream;

    /// Draws with two independent standard normal coordinates.
    fn draws(n_steps: usize) -> Draws {
        let (n_ensembles, n_walkers, dimension) = (4, 16, 2);
        let mut stream = RandomStream::new(3, 0);
        let positions: Vec<f64> = (0..n_ensembles * n_steps * dimension * n_walkers).map(|_| stream.normal()).collect();
        let mut draws = Draws {
            n_ensembles,
            n_steps,
            n_walkers,
            dimension,
            store_every: 1,
            positions,
            log_density: vec![0.0; n_ensembles * n_steps * n_walkers],
        };
        refresh(&mut draws);
        draws
    }

    fn refresh(draws: &mut Draws) {
        for e in 0..draws.n_ensembles {
            for s in 0..draws.n_steps {
                for w in 0..draws.n_walkers {
                    let r2 = draws.value(e, s, w, 0).powi(2) + draws.value(e, s, w, 1).powi(2);
                    draws.log_density[(e * draws.n_steps + s) * draws.n_walkers + w] = -0.5 * r2;
                }
            }
        }
    }

    fn set(draws: &mut Draws, walker: usize, f: impl Fn(usize, f64) -> f64) {
        for s in 0..draws.n_steps {
            let idx = (draws.n_steps + s) * draws.dimension * draws.n_walkers + walker;
            draws.positions[idx] = f(s, draws.positions[idx]);
        }
        refresh(draws);
    }

    #[test]
    fn a_healthy_bulk_has_no_suspects() {
        assert_eq!(find_suspicious_walkers(&draws(200)), []);
    }

    #[test]
    fn each_fault_is_found_and_only_in_its_walker() {
        let mut low = draws(200);
        set(&mut low, 3, |_, x| x + 9.0);
        let found = find_suspicious_walkers(&low);
        assert_eq!(found.len(), 1);
        assert_eq!((found[0].ensemble, found[0].walker, found[0].reason), (1, 3, SuspicionReason::Low));

        let mut stuck = draws(200);
        for s in 0..200 {
            for d in 0..2 {
                stuck.positions[((200 + s) * 2 + d) * 16 + 5] = 0.3;
            }
        }
        refresh(&mut stuck);
        assert_eq!(
            find_suspicious_walkers(&stuck).iter().map(|s| (s.walker, s.reason)).collect::<Vec<_>>(),
            [(5, SuspicionReason::Stuck)]
        );

        let mut apart = draws(200);
        set(&mut apart, 7, |_, x| 0.1 * x + 2.0);
        assert_eq!(
            find_suspicious_walkers(&apart).iter().map(|s| (s.walker, s.reason)).collect::<Vec<_>>(),
            [(7, SuspicionReason::Apart)]
        );
    }
}
