//! Counter-based random streams, one per walker. Results therefore do not depend on threads or the order of walkers.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// Stream of random 32-bit words from the generator ChaCha8, identified by a seed and a stream number. Words are read in sequence, so a checkpoint
/// stores only the position.
#[derive(Debug, Clone)]
pub struct RandomStream {
    generator: ChaCha8Rng,
}

impl RandomStream {
    /// Makes the stream with the number `stream` for a seed.
    pub fn new(seed: u64, stream: u64) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(stream);
        Self { generator }
    }

    /// Number of random words read from the stream so far.
    pub fn position(&self) -> u64 {
        // Nobody reads 2⁶⁴ words of one walker, so the conversion loses nothing.
        self.generator.get_word_pos() as u64
    }

    /// Moves the stream to a position from [`RandomStream::position`].
    pub fn seek(&mut self, position: u64) {
        self.generator.set_word_pos(u128::from(position));
    }

    /// Returns 32 random bits. Reads one word.
    #[inline]
    pub fn word(&mut self) -> u32 {
        self.generator.next_u32()
    }

    /// Returns a uniform number in (0, 1): the midpoint of one of 2³² equal cells. Reads one word. The smallest value is 1.2·10⁻¹⁰, so acceptance
    /// probabilities below it are not resolved.
    #[inline]
    pub fn unit(&mut self) -> f64 {
        (f64::from(self.word()) + 0.5) * (1.0 / 4_294_967_296.0)
    }

    /// Returns a uniform integer from 0 to n − 1; 0 for n = 0. Reads one word. The probability of each integer has a relative error of at most n/2³².
    #[inline]
    pub fn below(&mut self, n: usize) -> usize {
        ((u64::from(self.word()) * n as u64) >> 32) as usize
    }

    /// Returns two distinct indices from 0 to n − 1; n ≥ 2. Reads two words.
    #[inline]
    pub fn distinct_pair(&mut self, n: usize) -> (usize, usize) {
        let first = self.below(n);
        let second = self.below(n - 1);
        (first, second + usize::from(second >= first))
    }

    /// Returns three distinct indices from 0 to n − 1; n ≥ 3. Reads three words.
    #[inline]
    pub fn distinct_triple(&mut self, n: usize) -> (usize, usize, usize) {
        let (first, second) = self.distinct_pair(n);
        let mut third = self.below(n - 2);
        third += usize::from(third >= first.min(second));
        third += usize::from(third >= first.max(second));
        (first, second, third)
    }

    /// Returns a standard normal number by the ziggurat method. Reads two words, rarely more.
    #[inline]
    pub fn normal(&mut self) -> f64 {
        self.generator.sample(StandardNormal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeking_continues_the_sequence() {
        for consumed in [0, 1, 63, 64, 65, 1000] {
            let mut straight = RandomStream::new(5, 9);
            (0..consumed).for_each(|_| {
                straight.word();
            });
            let mut resumed = RandomStream::new(5, 9);
            resumed.seek(straight.position());
            let next = |stream: &mut RandomStream| (0..200).map(|_| stream.word()).collect::<Vec<_>>();
            assert_eq!(next(&mut straight), next(&mut resumed), "after {consumed} words");
        }
    }

    /// Checks that each ordered triple of distinct indices below 5 has probability 1/60. χ² with 59 degrees of freedom exceeds 150 with a probability
    /// of 10⁻⁹.
    #[test]
    fn triples_are_distinct_and_uniform() {
        let mut stream = RandomStream::new(1, 0);
        let n_draws = 60_000;
        let mut counts = [0_u32; 125];
        for _ in 0..n_draws {
            let (a, b, c) = stream.distinct_triple(5);
            assert!(a != b && b != c && a != c && a.max(b).max(c) < 5);
            counts[25 * a + 5 * b + c] += 1;
        }
        let expected = f64::from(n_draws) / 60.0;
        let chi2: f64 = counts.iter().filter(|&&n| n > 0).map(|&n| (f64::from(n) - expected).powi(2) / expected).sum();
        assert_eq!(counts.iter().filter(|&&n| n > 0).count(), 60);
        assert!(chi2 < 150.0, "{chi2}");
    }

    /// Checks mean and variance of normal numbers z. The mean of z² has a standard error of √(2/n) = 0.0045 for n numbers. The tolerance is six
    /// standard errors.
    #[test]
    fn normal_has_unit_variance() {
        let mut stream = RandomStream::new(2, 0);
        let mean_square = (0..100_000).map(|_| stream.normal().powi(2)).sum::<f64>() / 1e5;
        assert!((mean_square - 1.0).abs() < 0.027, "{mean_square}");
    }
}
