//! Independence move: a walker jumps to a point that is drawn from a fixed approximation of the posterior.
//!
//! The approximation q is a mixture of multivariate t distributions with six degrees of freedom, one per mode k: q(y) = Σ w_k t₆(y; m_k, S_k). Here
//! w_k is the weight, m_k the location and S_k the scale matrix. A draw y does not depend on the present point x. It is accepted with probability
//! min(1, (π(y)/q(y))/(π(x)/q(x))), where π is the posterior density. If q is a good approximation, most draws are accepted and nearly independent,
//! within and between modes. Otherwise most draws are rejected, and only other moves are effective. Source: Tierney 1994, doi:10.1214/aos/1176325750,
//! §2.3.2.

use super::{HalfStep, Move};
use crate::ensemble::random::RandomStream;
use crate::optimum::Modes;
use crate::t_mixture::{Jumps, TMixture};
use serde::{Deserialize, Serialize};

/// Largest number of draws to which a growing mixture is fitted.
const MOST_GROWTH_DRAWS: usize = 8192;

/// Independence move that draws from a mixture of t distributions with six degrees of freedom.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Independence {
    mixture: TMixture,
}

impl Independence {
    /// Builds the move from the modes' Laplace approximations, one mixture component per mode. `None` if no mode has a usable curvature.
    pub fn from_modes(modes: &Modes, dimension: usize) -> Option<Self> {
        TMixture::from_modes(modes, dimension).map(|mixture| Self { mixture })
    }

    /// Builds the move from draws of the posterior and their log densities. Components are fitted to the draws nearest to each mode, if there are enough
    /// of them. For a single mode, further components follow where it describes the draws poorly, if more jumps are accepted with them.
    /// Each entry of `points` is one draw; `stream` selects where components start. Returns the move with its [`Self::acceptance`].
    pub fn fitted(
        modes: &Modes,
        dimension: usize,
        points: &[Vec<f64>],
        log_density: &[f64],
        stream: &mut RandomStream,
    ) -> Option<(Self, [f64; 2])> {
        let plain = Self { mixture: TMixture::fitted(modes, dimension, points)? };
        let with_acceptance = |q: Self| {
            let acceptance = q.acceptance(points, log_density);
            (q, acceptance)
        };
        let plain = with_acceptance(plain);
        // A growing mixture can lose a mode with few draws.
        if modes.len() > 1 {
            return Some(plain);
        }
        let few: Vec<Vec<f64>> =
            points.iter().step_by(points.len().div_ceil(MOST_GROWTH_DRAWS).max(1)).cloned().collect();
        let grown = with_acceptance(Self { mixture: plain.0.mixture.grown(&few, stream) });
        Some(if grown.1[0] > plain.1[0] { grown } else { plain })
    }

    /// Estimates the probability that a jump is accepted, from draws of the posterior and their log densities: the mean, and that at a point which jumps
    /// rarely leave.
    ///
    /// With r = q/π, a jump from x is accepted with probability E min(r(x), r(y)) / E r over draws y from the posterior, because draws with weight r
    /// represent q. The rarely left point is the draw with the 5 % quantile of r. The estimates are a few percent too large, because jumps into tails of q
    /// beyond all draws are rejected and not counted.
    pub fn acceptance(&self, points: &[Vec<f64>], log_density: &[f64]) -> [f64; 2] {
        let log_ratios = points.iter().zip(log_density).map(|(point, value)| self.mixture.log_density(point) - value);
        let mut ratios: Vec<f64> = log_ratios.collect();
        let top = ratios.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        ratios.iter_mut().for_each(|ratio| *ratio = (*ratio - top).exp());
        ratios.sort_by(f64::total_cmp);
        let (n, total) = (ratios.len(), ratios.iter().sum::<f64>());
        if n == 0 || total.is_nan() {
            return [0.0; 2];
        }
        // The ratio with index k in ascending order is the smaller one of 2(n − k) − 1 of the n² pairs.
        let of_pairs: f64 = ratios.iter().enumerate().map(|(k, ratio)| ratio * (2 * (n - k) - 1) as f64).sum();
        let hard = ratios.get(n / 20).copied().unwrap_or(0.0);
        [of_pairs / n as f64 / total, ratios.iter().map(|ratio| ratio.min(hard)).sum::<f64>() / total]
    }

    /// Replaces `point` by a draw from the mixture. Returns the mixture's log density at the old point minus that at the draw. `noise` is work space.
    #[inline]
    fn jump(&self, stream: &mut RandomStream, point: &mut [f64], noise: &mut [f64]) -> f64 {
        let mixture = &self.mixture;
        let before = mixture.log_density(point);
        mixture.draw(stream, point, noise);
        before - mixture.log_density(point)
    }
}

impl Move for Independence {
    fn name(&self) -> String {
        format!("independence(components={})", self.mixture.n_components())
    }

    fn propose(&self, step: HalfStep) {
        let HalfStep { moving, random_streams, proposals, log_factors, .. } = step;
        if let Some(component) = self.mixture.only() {
            let (exponent, points) = (self.mixture.exponent(), moving.coordinates);
            return Jumps { component, exponent, points, draws: proposals, log_factors }.draw(random_streams);
        }
        let dimension = moving.dimension;
        // The work space is on the stack for usual dimensions, so that the frequently executed loop does not allocate memory.
        let mut few = [0.0; 2 * 16];
        let mut many;
        let space = if dimension <= 16 {
            &mut few[..2 * dimension]
        } else {
            many = vec![0.0; 2 * dimension];
            &mut many[..]
        };
        let (point, noise) = space.split_at_mut(dimension);
        let n = moving.n;
        for (i, stream) in random_streams.iter_mut().enumerate() {
            point.iter_mut().enumerate().for_each(|(d, x)| *x = moving.coordinates[d * n + i]);
            log_factors[i] = self.jump(stream, point, noise);
            point.iter().enumerate().for_each(|(d, x)| proposals[d * n + i] = *x);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ensemble::moves::WalkerPoints;
    use crate::optimum::Optimum;

    /// Compares the estimated mean acceptance with jumps that are made. The standard error of 20,000 jumps is 0.0035. The estimate may be 0.06 too large.
    #[test]
    fn jumps_are_accepted_as_often_as_estimated() {
        let mut stream = RandomStream::new(12, 0);
        let normal = |x: &[f64]| -0.5 * (x[0] * x[0] + x[1] * x[1]);
        let draws: Vec<Vec<f64>> = (0..20_000).map(|_| vec![stream.normal(), stream.normal()]).collect();
        let log_density: Vec<f64> = draws.iter().map(|x| normal(x)).collect();
        let mut modes = Modes::default();
        modes.add(&Optimum {
            location: vec![1.0, 0.0],
            log_density: 0.0,
            precision: vec![0.5, 0.0, 0.0, 2.0],
            converged: true,
        });
        let q = Independence::from_modes(&modes, 2).unwrap();
        let is_accepted = |point: &Vec<f64>| {
            let mut draw = [point[0], point[1]];
            let factor = q.jump(&mut stream, &mut draw, &mut [0.0; 2]);
            stream.unit().ln() < normal(&draw) - normal(point) + factor
        };
        let made = draws.iter().map(is_accepted).filter(|is_accepted| *is_accepted).count() as f64 / 20_000.0;
        let [mean, hard] = q.acceptance(&draws, &log_density);
        assert!((made - 0.02..made + 0.06).contains(&mean), "{made} {mean}");
        assert!(0.0 < hard && hard < mean);
    }

    /// Checks that, with one component, the code for all walkers at once gives the draws and factors of the code for single walkers. The numbers of
    /// walkers are multiples of the block size and other numbers.
    #[test]
    fn the_short_way_of_one_component_is_the_long_one() {
        let mut modes = Modes::default();
        modes.add(&Optimum {
            location: vec![1.0, 2.0],
            log_density: 0.0,
            precision: vec![3.0, 1.0, 1.0, 2.0],
            converged: true,
        });
        let q = Independence::from_modes(&modes, 2).unwrap();
        for n in [1, 5, 16, 19] {
            let streams = || (0..n as u64).map(|i| RandomStream::new(3, i)).collect::<Vec<_>>();
            let coordinates: Vec<f64> = (0..2 * n).map(|i| (1.7 * i as f64).sin() * 3.0).collect();
            let (mut proposals, mut factors) = (vec![0.0; 2 * n], vec![0.0; n]);
            let moving = WalkerPoints { coordinates: &coordinates, n, dimension: 2 };
            let mut shared = RandomStream::new(3, 1000);
            let mut random_streams = streams();
            q.propose(HalfStep {
                moving,
                complement: moving,
                shared: &mut shared,
                random_streams: &mut random_streams,
                proposals: &mut proposals,
                log_factors: &mut factors,
            });
            for (i, (mut stream, used)) in streams().into_iter().zip(random_streams).enumerate() {
                let mut point = [coordinates[i], coordinates[n + i]];
                let factor = q.jump(&mut stream, &mut point, &mut [0.0; 2]);
                assert!((factor - factors[i]).abs() < 1e-12, "{factor} {}", factors[i]);
                assert!((0..2).all(|d| (point[d] - proposals[d * n + i]).abs() < 1e-12));
                assert_eq!(stream.position(), used.position());
            }
        }
    }
}
