//! Distribution of the largest gain that a search finds in data without a missing effect. The data are simulated from a reference model and its noise. The whole search
//! is repeated on each data set, with the noise estimated anew.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::refit::Refitted;
use super::screen::Screen;
use super::{Candidate, Fitted, Search, Subject};
use posterior::monitor::{Counter, Monitor};

/// Largest gain (nats) of each simulated search, in the order of the simulations.
#[derive(Debug, Clone, PartialEq)]
pub struct Bootstrap {
    largest: Vec<f64>,
}

/// Number of simulations per batch. It is fixed, so that the total number does not depend on the number of threads.
const BATCH: usize = 10;
/// Number of simulated searches that must reach the measured gain before the simulation stops: p is then known well enough (Besag & Clifford, Biometrika 78, 301, 1991).
const ENOUGH_EXCEEDANCES: usize = 10;
/// Least number of simulated searches from which a 95 % quantile of the largest gain is reported.
const ENOUGH_FOR_QUANTILE: usize = 40;
/// Ratio of the measured gain to the largest simulated gain above which a decision needs no further simulations.
const OUT_OF_REACH: f64 = 2.0;

/// Rules for the number of searches to simulate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Simulations {
    /// Largest number of simulated searches.
    pub most: usize,
    /// Threshold of p if only a decision is needed; `None` to compute p itself. With a threshold, the simulations may stop early. Their number must then allow a p below the
    /// threshold, and the measured gain must exceed twice the largest simulated gain.
    pub only_for: Option<f64>,
}

impl Simulations {
    fn are_enough(&self, largest: &[f64], gain: f64) -> bool {
        let decides = |p: f64| 1.0 / (1.0 + largest.len() as f64) <= p;
        let is_out_of_reach = gain > OUT_OF_REACH * largest.iter().copied().fold(0.0, f64::max);
        largest.len() >= self.most
            || largest.iter().filter(|l| **l >= gain).count() >= ENOUGH_EXCEEDANCES
            || (self.only_for.is_some_and(decides) && is_out_of_reach)
    }
}

impl Bootstrap {
    /// Simulates data from the reference model. Refits the reference and every candidate that may have the largest gain. Stops after all simulations, or earlier if many of
    /// them reach the measured `gain` or if [`Simulations`] allows it.
    pub fn run(
        subject: &Subject,
        reference: &Refitted,
        candidates: &[Candidate],
        gain: f64,
        simulations: Simulations,
        seed: u64,
        monitor: &dyn Monitor,
    ) -> Self {
        let counter = Counter::new(monitor, simulations.most);
        // If first-order bounds of the gains cannot be computed, every candidate is refitted.
        let screen = Screen::new(subject, reference, candidates).ok();
        let simulate = |number: usize| {
            let gain = largest_gain(subject, reference, (candidates, screen.as_ref()), seed, number);
            counter.add_one();
            gain
        };
        Self::of(gain, simulations, simulate)
    }

    /// Collects the largest gains of simulated searches. `search` returns the largest gain (nats) of the simulation with a given number. `gain` is the largest gain of the
    /// measured data.
    pub fn of(gain: f64, simulations: Simulations, search: impl Fn(usize) -> f64 + Sync) -> Self {
        let mut largest: Vec<f64> = Vec::new();
        while !simulations.are_enough(&largest, gain) {
            let end = (largest.len() + BATCH).min(simulations.most);
            let batch: Vec<f64> = (largest.len()..end).into_par_iter().map(&search).collect();
            largest.extend(batch);
        }
        Self { largest }
    }

    /// Returns p of a gain (nats), corrected for the whole search: the probability that a search of data without an effect gains as much.
    pub fn p(&self, gain: f64) -> f64 {
        let reached = self.largest.iter().filter(|largest| **largest >= gain).count();
        (1 + reached) as f64 / (1 + self.largest.len()) as f64
    }

    /// Returns the 95 % quantile (nats) of the simulated largest gains. It is the largest gain for at most twenty simulations, and infinite for none.
    pub fn threshold(&self) -> f64 {
        let mut sorted = self.largest.clone();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() * 95 / 100).copied().unwrap_or(f64::INFINITY)
    }

    /// Sentence with the gains of the simulated searches and their number; `None` if there are none.
    pub(super) fn sentence(&self) -> Option<String> {
        let n = self.largest.len();
        let gained = self.threshold();
        let larger = self.largest.iter().filter(|largest| **largest > gained).count();
        let few = if n < ENOUGH_FOR_QUANTILE { ": enough to decide, too few for a 95 % limit" } else { "" };
        (n > 0).then(|| match larger {
            0 => format!("in {n} simulated searches without a missing effect, no refit gained more than {gained:.1} nats{few}"),
            _ => format!("in {} of {n} simulated searches without a missing effect, no refit gained more than {gained:.1} nats{few}", n - larger),
        })
    }
}

/// Returns the experiment with positions simulated from a model and its noise. `number` selects a random stream of `seed`.
pub fn simulated(subject: &Subject, reference: &Refitted, seed: u64, number: usize) -> Subject {
    subject.with_positions(&simulated_m(subject, reference, seed, number))
}

/// Simulates positions (m), one per row of the record, from a model and its noise. `number` selects a random stream of `seed`.
pub fn simulated_m(subject: &Subject, reference: &Refitted, seed: u64, number: usize) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(number as u64);
    let record = &subject.experiment().record;
    let Fitted { position_m, noise, .. } = &reference.fitted;
    let noise_m =
        subject.noise().simulate_m(&record.time_s, &subject.problem().recordings(), position_m, noise, &mut rng);
    position_m.iter().zip(&noise_m).map(|(x, e)| x + e).collect()
}

fn largest_gain(
    subject: &Subject,
    reference: &Refitted,
    (candidates, screen): (&[Candidate], Option<&Screen>),
    seed: u64,
    number: usize,
) -> f64 {
    let data = simulated(subject, reference, seed, number).with_trajectory_memory();
    let start = (reference.fitted.theta.clone(), reference.fitted.noise);
    let Ok(base) = data.fit(&reference.candidate, &[start], Search::Local) else { return f64::INFINITY };
    let gain = |candidate: &Candidate| {
        let start = (candidate.embed(&reference.candidate, &base.theta), base.noise);
        data.fit(candidate, &[start], Search::Local).map_or(0.0, |fitted| fitted.objective - base.objective)
    };
    let bounds = screen.map_or(vec![f64::INFINITY; candidates.len()], |screen| screen.bounds_nats(&data));
    let mut order: Vec<usize> = (0..candidates.len()).collect();
    order.sort_by(|a, b| bounds[*b].total_cmp(&bounds[*a]));
    // Candidates with the largest bounds come first. A candidate is not refitted if its bound is below the largest gain so far.
    order
        .into_iter()
        .fold(0.0, |best, place| if bounds[place] < best { best } else { gain(&candidates[place]).max(best) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NoiseValues;
    use crate::refit::refit_all;
    use crate::test_replica::{WHITE, base_fit, replica, simulated};
    use posterior::monitor::SilentMonitor;
    use sampling::ensemble::RandomStream;

    fn candidates() -> Vec<Candidate> {
        ["tracking-drift", "force-bias"].iter().map(|slug| replica().extended(&[slug]).expect("addable")).collect()
    }

    /// The mean p of 24 correct models is 0.5 ± 0.059. The test allows four standard deviations (false failures below 1e-4).
    #[test]
    #[ignore = "thorough"]
    fn p_of_correct_models_is_about_a_half() {
        let p = p_of_correct_models(24, 40);
        let mean = p.iter().sum::<f64>() / 24.0;
        assert!((mean - 0.51).abs() < 4.0 * 0.059, "{mean}");
    }

    /// p of the largest gain on 60 correct models is uniform. Its mean is 0.5 ± 0.037; the test allows five standard deviations (false failures below 1e-6). The lowest
    /// and the highest quarter of the range are each empty with a probability of 3e-8.
    #[test]
    #[ignore = "campaigns/long-tests"]
    fn p_of_correct_models_is_uniform() {
        let p = p_of_correct_models(60, 60);
        let mean = p.iter().sum::<f64>() / 60.0;
        // Besag and Clifford's rule stops early at large p and then overstates it by a few per cent.
        assert!((mean - 0.51).abs() < 5.0 * 0.037, "{mean}");
        assert!(p.iter().any(|p| *p < 0.25) && p.iter().any(|p| *p > 0.75), "{p:?}");
    }

    /// Returns p of the largest gain for each of `n_models` correct models, from at most `most` simulations each.
    fn p_of_correct_models(n_models: u64, most: usize) -> Vec<f64> {
        let (base, fitted) = base_fit();
        let candidates = candidates();
        let noise = NoiseValues::new([4.0, 3.0, 1.0, 0.01, 1.0]);
        let p_of = |seed: u64| {
            let data = simulated(&base, &fitted.theta, &noise, 1000 + seed);
            let reference = Refitted::new(&data, base.clone(), &[], Search::Wide).expect("fits");
            let larger = refit_all(&data, &candidates, &[&reference], Search::Wide, &SilentMonitor);
            let gains = larger.iter().flatten().map(|model| model.gain_over(&reference, &data).fitted);
            let largest = gains.fold(0.0, f64::max);
            let simulations = Simulations { most, only_for: None };
            Bootstrap::run(&data, &reference, &candidates, largest, simulations, seed, &SilentMonitor).p(largest)
        };
        (0..n_models).into_par_iter().map(p_of).collect()
    }

    /// If the gain and the simulated gains have one distribution, p ≤ 1/20 occurs once in twenty trials, also if simulations stop early. Over 20,000 trials, the standard error
    /// of the fraction is 0.0015 for p ≤ 1/20 and 0.0035 for p ≤ 1/2. The test allows five standard errors, which are exceeded once in 10⁶. Early stopping misses some
    /// exceedances, which adds 10⁻⁴. Stopping at common gains overstates p and never understates it.
    #[test]
    fn p_is_uniform_under_exchange_and_conservative_where_it_stops_early() {
        const N: u64 = 20_000;
        let shares = |only_for: Option<f64>| {
            let p = |trial: u64| {
                let exponential = |number: u64| -RandomStream::new(17, 1_000 * trial + number).unit().ln();
                let gain = exponential(999);
                let bootstrap =
                    Bootstrap::of(gain, Simulations { most: 99, only_for }, |number| exponential(number as u64));
                (bootstrap.p(gain), bootstrap.largest.len())
            };
            let found: Vec<(f64, usize)> = (0..N).into_par_iter().map(p).collect();
            let share = |bar: f64| found.iter().filter(|(p, _)| *p <= bar).count() as f64 / N as f64;
            (share(0.05), share(0.5), found.iter().map(|(_, n)| n).sum::<usize>() as f64 / N as f64)
        };
        let (rare, common, mean) = shares(None);
        assert!((rare - 0.05).abs() < 5.0 * 0.0015, "{rare}");
        assert!(common < 0.5 + 5.0 * 0.0035 && common > 0.4, "{common}");
        let (rare, common, mean_to_decide) = shares(Some(0.05));
        assert!((rare - 0.05).abs() < 5.0 * 0.0015 + 1e-4, "{rare}");
        assert!(common < 0.5 + 5.0 * 0.0035 && common > 0.4, "{common}");
        assert!(mean < 50.0 && mean_to_decide < mean, "{mean} {mean_to_decide}");
    }

    /// Simulated positions scatter about the model by its noise, independently in each simulation. 800 white errors have a mean square of 16 ± 0.8 µm². Their correlation
    /// with those of another simulation is 0 ± 0.035. The test allows five standard deviations (false failures below 1e-6 each).
    #[test]
    fn simulations_have_the_noise_and_each_its_own() {
        let (candidate, fitted) = base_fit();
        let reference = Refitted { candidate, fitted: Fitted { noise: WHITE, ..fitted }, future: None };
        let errors_um = |number: usize| -> Vec<f64> {
            let data = super::simulated(replica(), &reference, 3, number);
            let both = data.fitted_m.iter().zip(&data.scored_m).map(|(a, b)| a.or(*b).expect("every row has one"));
            both.zip(&reference.fitted.position_m).map(|(y, x)| 1e6 * (y - x)).collect()
        };
        let mean = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>() / a.len() as f64;
        let each: Vec<Vec<f64>> = (0..3).map(errors_um).collect();
        assert_eq!(each[0].len(), 800);
        for (k, errors) in each.iter().enumerate() {
            assert!((mean(errors, errors) - 16.0).abs() < 5.0 * 0.8);
            let other = &each[(k + 1) % 3];
            assert!(mean(errors, other).abs() / 16.0 < 5.0 * 0.036);
        }
    }

    /// The largest gain of a simulated search equals that of wide fits to the simulated data. The noise is estimated anew for every model. Fits of a single candidate, or with
    /// a fixed noise, give other values.
    #[test]
    #[ignore = "thorough"]
    fn a_simulated_search_fits_mean_and_noise_of_every_model() {
        let (candidate, fitted) = base_fit();
        let noise = NoiseValues::new([4.0, 3.0, 1.0, 0.01, 1.0]);
        let reference = Refitted { candidate, fitted: Fitted { noise, ..fitted }, future: None };
        let candidates = candidates();
        let mut n_of_second = 0;
        for number in 0..8 {
            let data = super::simulated(replica(), &reference, 21, number);
            let base = Refitted::new(&data, reference.candidate.clone(), &[], Search::Wide).expect("fits");
            let larger = refit_all(&data, &candidates, &[&base], Search::Wide, &SilentMonitor);
            let gains: Vec<f64> =
                larger.iter().flatten().map(|model| model.fitted.objective - base.fitted.objective).collect();
            n_of_second += usize::from(gains[1] > gains[0] + 0.2);
            let largest = gains.iter().copied().fold(0.0, f64::max);
            let found = largest_gain(replica(), &reference, (&candidates, None), 21, number);
            assert!((found - largest).abs() < 0.1, "{number}: {found} {largest}");
        }
        assert!(n_of_second > 0);
    }

    /// Skipping candidates that cannot have the largest gain does not change the largest gain. The test makes 24 simulated searches over every effect that needs no
    /// finite elements, under white and slow noise. It skips most refits.
    #[test]
    fn what_is_not_refitted_would_not_have_gained_most() {
        let subject = crate::test_subjects::subject(crate::test_subjects::Protocol::Levels);
        let position_m = crate::test_subjects::truth_of(&subject, &[], &[]);
        let mut n_left_out = 0;
        for (seed, noise) in [(5, WHITE), (6, NoiseValues::new([4.0, 4.0, 1.0, 0.01, 1.0]))] {
            let noise_m = crate::test_subjects::noise_of(&subject, &position_m, &noise, seed);
            let measured: Vec<f64> = position_m.iter().zip(noise_m).map(|(x, noise)| x + noise).collect();
            let data = subject.with_positions(&measured);
            let reference = Refitted::new(&data, data.base(), &[], Search::Wide).expect("fits");
            let slugs = data.library().effects().iter().map(|effect| effect.slug());
            let candidates: Vec<Candidate> = slugs.filter_map(|slug| data.extended(&[slug]).ok()).collect();
            assert!(candidates.len() > 8, "{}", candidates.len());
            let screen = Screen::new(&data, &reference, &candidates).expect("derivatives");
            for number in 0..12 {
                let all = largest_gain(&data, &reference, (&candidates, None), 31, number);
                let screened = largest_gain(&data, &reference, (&candidates, Some(&screen)), 31, number);
                assert_eq!(screened, all, "{number}");
                let bounds = screen.bounds_nats(&super::simulated(&data, &reference, 31, number));
                n_left_out += bounds.iter().filter(|bound| **bound < all).count();
            }
        }
        assert!(n_left_out > 24 * 4, "{n_left_out}");
    }

    #[test]
    fn a_count_gives_a_p() {
        let bootstrap = Bootstrap { largest: vec![0.5, 1.0, 2.0, 4.0] };
        assert_eq!(bootstrap.p(3.0), 2.0 / 5.0);
        assert_eq!(bootstrap.p(5.0), 1.0 / 5.0);
        assert_eq!(bootstrap.threshold(), 4.0);
        // The 95th of 99 sorted gains: four exceed it.
        assert_eq!(Bootstrap { largest: (1..=99).rev().map(f64::from).collect() }.threshold(), 95.0);
        // Ten searches are too few for a 95 % limit.
        let words = |n: i32| Bootstrap { largest: (1..=n).map(f64::from).collect() }.sentence().expect("searches");
        assert!(
            words(10).starts_with("in 10 simulated searches without a missing effect, no refit gained more than 10.0")
        );
        assert!(words(10).contains("too few") && !words(99).contains("too few"));
        assert!(words(99).starts_with("in 95 of 99 simulated searches") && words(99).contains("more than 95.0 nats"));
        assert_eq!(Bootstrap { largest: Vec::new() }.sentence(), None);
        let decision = Simulations { most: 99, only_for: Some(0.05) };
        assert!(decision.are_enough(&[1.0; 20], 2.1) && !decision.are_enough(&[1.0; 20], 1.9));
        assert!(!decision.are_enough(&[1.0; 10], 9.0) && decision.are_enough(&[1.0; 10], 0.5));
        let whole = Simulations { only_for: None, ..decision };
        assert!(!whole.are_enough(&[1.0; 98], 9.0) && whole.are_enough(&[1.0; 99], 9.0));
    }
}
