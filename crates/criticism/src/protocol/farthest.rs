//! Distances of models under a protocol, and the protocols under which the closest models are farthest apart.

use std::sync::OnceLock;

use rayon::prelude::*;

use super::Members;
use crate::Subject;
use crate::derivatives::derivatives_m;
use crate::separation::{RivalFit, RivalPoint, RivalTruth};
use base::error::{Error, Result};

/// Number of distances that are computed at once.
const BATCH: usize = 8;

/// Places of two models: the truth, and the model that is fitted to its data.
pub(super) type Pair = [usize; 2];

/// Smallest distance (σ) between the first of several models and any other, with either of the two as the truth.
#[derive(Clone, Copy)]
pub(super) struct Separation {
    pub distance: f64,
    /// Index of the closest other model.
    pub other: usize,
}

/// Models under a protocol. Positions and derivatives are computed once, when they are needed.
pub(super) struct UnderProtocol<'a> {
    pub subject: Subject,
    pub members: &'a Members<'a>,
    positions_m: Vec<OnceLock<Option<Vec<f64>>>>,
    columns_m: Vec<OnceLock<Option<Vec<Vec<f64>>>>>,
}

impl<'a> UnderProtocol<'a> {
    pub fn new(subject: Subject, members: &'a Members<'a>) -> Self {
        let n = members.len();
        let (positions_m, columns_m) = (vec![OnceLock::new(); n], vec![OnceLock::new(); n]);
        Self { subject, members, positions_m, columns_m }
    }

    fn no_solution(&self, place: usize) -> Error {
        Error::numerical(
            format!("the model with {} has no solution under this protocol", self.members[place].0.effects.join(", ")),
            "use smaller forces",
        )
    }

    /// Position (m) of a model at its fit.
    pub fn position_m(&self, place: usize) -> Result<&[f64]> {
        let (candidate, fitted) = self.members[place];
        let found = self.positions_m[place].get_or_init(|| self.subject.trajectory_m(candidate, &fitted.theta).ok());
        found.as_deref().ok_or_else(|| self.no_solution(place))
    }

    /// Derivatives (m per unit of the coordinate) of a model's position at its fit.
    fn columns_m(&self, place: usize) -> Result<&[Vec<f64>]> {
        let (candidate, fitted) = self.members[place];
        let position_m = self.position_m(place)?;
        let derivatives = || derivatives_m(&self.subject, candidate, &fitted.theta, Some(position_m));
        self.columns_m[place].get_or_init(derivatives).as_deref().ok_or_else(|| self.no_solution(place))
    }

    pub fn truth(&self, place: usize) -> Result<RivalTruth<'_>> {
        let (candidate, fitted) = self.members[place];
        let noise = self.members[0].1.noise;
        Ok(RivalTruth { candidate, theta: &fitted.theta, noise, position_m: self.position_m(place)? })
    }

    /// Point of a model that is closest to a truth.
    pub fn closest_point(&self, [truth, model]: Pair) -> Result<RivalPoint> {
        let (candidate, fitted) = self.members[model];
        RivalFit::new(&self.subject, candidate, &self.truth(truth)?).best(Some(&fitted.theta))
    }

    /// Distance (σ) to first order around the model's own fit: its parameters absorb the difference linearly.
    pub fn first_order_distance(&self, [truth, model]: Pair) -> Result<f64> {
        let (candidate, fitted) = self.members[model];
        let (position_m, columns_m) = (self.position_m(model)?, self.columns_m(model)?);
        let truth = self.truth(truth)?;
        let found = RivalFit::new(&self.subject, candidate, &truth).first_order(&fitted.theta, position_m, columns_m);
        found.filter(|distance| distance.is_finite()).ok_or_else(|| self.no_solution(model))
    }

    /// Pairs of the first model with every other, in the order in which they are best compared: fits of models that take long come last, and the closest to first order come first.
    pub fn pairs(&self) -> Vec<Pair> {
        let key = |pair: Pair| {
            (self.members[pair[1]].0.is_slow(), self.first_order_distance(pair).unwrap_or(f64::INFINITY), pair)
        };
        let mut pairs: Vec<(bool, f64, Pair)> = all_pairs(self.members.len()).into_iter().map(key).collect();
        pairs.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        pairs.into_iter().map(|(_, _, pair)| pair).collect()
    }

    /// Smallest distance over all pairs.
    pub fn separation(self) -> Result<Separation> {
        let pairs = all_pairs(self.members.len());
        let found = farthest(vec![self], &pairs, ANY, |models, pair| Ok(models.closest_point(pair)?.distance))?;
        found.into_iter().next().map(|(separation, _)| separation).ok_or_else(|| {
            Error::numerical("the models cannot be fitted to each other's data", "check the priors of their parameters")
        })
    }
}

/// Pairs of the first of several models with every other, with either as the truth.
pub(super) fn all_pairs(n_members: usize) -> Vec<Pair> {
    (1..n_members).flat_map(|other| [[0, other], [other, 0]]).collect()
}

/// One protocol, whatever its distance.
pub(super) const ANY: (usize, f64) = (1, f64::NEG_INFINITY);

/// A protocol whose pairs are compared one after another.
struct Tried<T> {
    /// Smallest distance so far: no smaller than that of all pairs.
    least: Separation,
    n_compared: usize,
    protocol: T,
}

/// Of several protocols, the `keep` whose closest models are farthest apart, the best first. Pairs of a protocol are compared in the given order, as long as the protocol can be among the best.
/// Protocols under which a model has no solution, or whose distance is not above the `floor`, are left out.
///
/// # Errors
/// Errors of `distance` other than [`Error::Numerical`].
pub(super) fn farthest<T: Sync + Send>(
    protocols: Vec<T>,
    pairs: &[Pair],
    (keep, floor): (usize, f64),
    distance: impl Fn(&T, Pair) -> Result<f64> + Sync,
) -> Result<Vec<(Separation, T)>> {
    let start = |protocol| Tried { least: Separation { distance: f64::INFINITY, other: 1 }, n_compared: 0, protocol };
    let mut list: Vec<Tried<T>> = protocols.into_iter().map(start).collect();
    loop {
        list.sort_by(|a, b| b.least.distance.total_cmp(&a.least.distance));
        let mut n_finished = 0;
        let mut open: Vec<&mut Tried<T>> = Vec::new();
        for tried in &mut list {
            if n_finished == keep {
                break;
            }
            if tried.n_compared < pairs.len() { open.push(tried) } else { n_finished += 1 }
        }
        if open.is_empty() {
            list.truncate(keep);
            return Ok(list.into_iter().map(|tried| (tried.least, tried.protocol)).collect());
        }
        // Protocols without any distance are equal, and all of them are begun.
        if open[0].n_compared > 0 {
            open.truncate(BATCH);
        }
        let pairs_each = BATCH.div_ceil(open.len());
        let advance = |tried: &mut Tried<T>| {
            let next = &pairs[tried.n_compared..pairs.len().min(tried.n_compared + pairs_each)];
            let found: Vec<Result<f64>> = next.par_iter().map(|pair| distance(&tried.protocol, *pair)).collect();
            for ([truth, model], found) in next.iter().zip(found) {
                let found = found?;
                if found < tried.least.distance {
                    tried.least = Separation { distance: found, other: *truth.max(model) };
                }
            }
            tried.n_compared += next.len();
            Ok(())
        };
        let advanced: Vec<Result<()>> = open
            .into_par_iter()
            .map(|tried| {
                let found = advance(tried);
                if found.is_err() {
                    tried.n_compared = usize::MAX;
                }
                found
            })
            .collect();
        if let Some(failed) =
            advanced.into_iter().filter_map(Result::err).find(|error| !matches!(error, Error::Numerical { .. }))
        {
            return Err(failed);
        }
        list.retain(|tried| tried.n_compared != usize::MAX && tried.least.distance > floor);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    /// Distances that follow no order, one of fifty without a solution. The best three are those that all pairs of all protocols give, and most pairs need not be compared.
    #[test]
    fn the_best_are_those_of_all_pairs() {
        let pairs = all_pairs(6);
        let distance = |protocol: usize, [truth, model]: Pair| {
            let number = (7919 * (protocol + 1) + 104_729 * truth + 1_299_709 * model) % 10_007;
            if number.is_multiple_of(50) {
                return Err(Error::numerical("no solution", "none"));
            }
            Ok(1.0 + number as f64 + 50.0 * protocol as f64)
        };
        let n_compared = AtomicUsize::new(0);
        let counted = |protocol: &usize, pair: Pair| {
            n_compared.fetch_add(1, Ordering::Relaxed);
            distance(*protocol, pair)
        };
        let mut all: Vec<(f64, usize)> = Vec::new();
        for protocol in 0..200 {
            let of_pairs: Result<Vec<f64>> = pairs.iter().map(|pair| distance(protocol, *pair)).collect();
            if let Ok(of_pairs) = of_pairs {
                all.push((of_pairs.into_iter().fold(f64::INFINITY, f64::min), protocol));
            }
        }
        all.sort_by(|a, b| b.0.total_cmp(&a.0));
        let found = |keep, floor| {
            let best = farthest((0..200).collect(), &pairs, (keep, floor), counted).expect("no other error");
            best.into_iter().map(|(least, protocol)| (least.distance, protocol)).collect::<Vec<_>>()
        };
        assert_eq!(found(3, f64::NEG_INFINITY), all[..3]);
        assert!(n_compared.load(Ordering::Relaxed) < 200 * pairs.len() / 2, "{n_compared:?} pairs were compared");
        assert_eq!(found(3, all[1].0), all[..1]);
        let stopped = farthest(vec![0], &pairs, ANY, |_: &usize, _| Err(Error::Interrupted { kept: String::new() }));
        assert!(matches!(stopped, Err(Error::Interrupted { .. })));
    }
}
