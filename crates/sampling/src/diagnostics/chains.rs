//! Draws of one quantity from several chains.

use super::ranks::{BlomScores, Sorted};

/// Values of one quantity, from several chains of equal length.
#[derive(Debug, Clone, PartialEq)]
pub struct Chains {
    chains: Vec<Vec<f64>>,
}

impl Chains {
    /// Stores the chains. Longer chains are cut to the length of the shortest chain.
    pub fn new(mut chains: Vec<Vec<f64>>) -> Self {
        let shortest = chains.iter().map(Vec::len).min().unwrap_or(0);
        chains.iter_mut().for_each(|chain| chain.truncate(shortest));
        Self { chains }
    }

    /// Number of chains.
    pub fn n_chains(&self) -> usize {
        self.chains.len()
    }

    /// Number of draws per chain.
    pub fn n_draws(&self) -> usize {
        self.chains.first().map_or(0, Vec::len)
    }

    /// Iterates over the chains, each as a slice of its draws.
    pub fn iter(&self) -> impl Iterator<Item = &[f64]> {
        self.chains.iter().map(Vec::as_slice)
    }

    /// Splits each chain into its first and second half. With an odd number of draws, the middle draw is dropped.
    pub fn split(&self) -> Self {
        let half = self.n_draws() / 2;
        let halves = |chain: &Vec<f64>| [chain[..half].to_vec(), chain[chain.len() - half..].to_vec()];
        Self { chains: self.chains.iter().flat_map(halves).collect() }
    }

    /// Returns `true` if all values are finite and some values differ.
    pub(super) fn varies(&self) -> bool {
        let mut values = self.chains.iter().flatten();
        let Some(&first) = values.next() else { return false };
        let (mut low, mut high) = (first, first);
        for &value in values {
            if !value.is_finite() {
                return false;
            }
            (low, high) = (low.min(value), high.max(value));
        }
        first.is_finite() && high - low >= 1e-15
    }

    pub(super) fn flat(&self) -> Vec<f64> {
        self.chains.concat()
    }

    /// Returns chains of the same number and length with other values, in the order of [`Chains::flat`].
    pub(super) fn with_values(&self, values: &[f64]) -> Self {
        Self { chains: values.chunks(self.n_draws().max(1)).map(<[f64]>::to_vec).collect() }
    }

    pub(super) fn rank_normalised(&self) -> Self {
        let flat = self.flat();
        self.with_values(&Sorted::new(&flat).normal_scores(&BlomScores::new(flat.len())))
    }

    pub(super) fn map(&self, f: impl Fn(f64) -> f64 + Copy) -> Self {
        Self { chains: self.chains.iter().map(|chain| chain.iter().copied().map(f).collect()).collect() }
    }
}
