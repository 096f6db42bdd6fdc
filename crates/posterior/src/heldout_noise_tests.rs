//! Tests of bands and joint simulation under noise that is correlated in time and has a gain and an offset for each cycle.

use rand_distr::StandardNormal;

use super::*;
use crate::full_check::{NaturalDraw, check};
use crate::monitor::SilentMonitor;
use crate::prepared::PreparedModel;
use crate::problem::Problem;
use crate::replica::{TABLE_I, embedded};
use crate::study::ModelSpecification;
use laws::rheology::CreepCompliance;
use models::model::convolve_m;
use record::Apparatus;

const COMPLIANCE_PER_M: f64 = 549.0;
/// Noise parameters: white noise (µm), slow noise (µm) and its correlation time (s), gain and offset (µm) per cycle; all but the time are standard deviations.
const NOISE: [f64; 5] = [4.0, 3.0, 0.7, 0.03, 5.0];

/// Problem with the replica's protocol, an instrument in place of the bead, and all Gaussian noise terms.
fn problem() -> Problem {
    let (mut experiment, _) = embedded().unwrap();
    experiment.apparatus = Apparatus::Instrument { compliance_per_m: COMPLIANCE_PER_M, is_stress_strain: false };
    let noise = ["white", "ou", "gain"].map(String::from);
    let specification = ModelSpecification::default().with_options(None, &[], &noise, None, &[]).unwrap();
    Problem::new(experiment, specification, None, &SilentMonitor).unwrap()
}

/// Positions (m) of the Lethersich law in closed form, at every row.
fn exact_m(problem: &Problem) -> Vec<f64> {
    let record = &problem.experiment.record;
    convolve_m(COMPLIANCE_PER_M, &CreepCompliance::lethersich(&TABLE_I), &record.time_s, &record.force_n)
}

/// Full check of four equal draws.
fn check_of(problem: &Problem) -> FullCheck {
    let prepared = PreparedModel::new(problem, None, &SilentMonitor).unwrap();
    let draw: NaturalDraw = TABLE_I.into_iter().chain(NOISE).collect();
    check(&prepared, &vec![draw; 4]).unwrap()
}

#[test]
fn bands_are_as_wide_as_all_noise_terms_together() {
    let problem = problem();
    let bands_m = bands_m(&check_of(&problem));
    let [white, ou, _, gain, offset] = NOISE;
    // These are the standard normal quantiles of the probabilities 95 % and 75 %.
    let (outer, inner) = (1.644_853_626_951_472_2, 0.674_489_750_196_081_7);
    for (x_m, band) in exact_m(&problem).into_iter().zip(bands_m) {
        let sd_m = (1e-12 * (white * white + ou * ou + offset * offset) + (gain * x_m).powi(2)).sqrt();
        let expected = [-outer, -inner, 0.0, inner, outer].map(|z| x_m + z * sd_m);
        for (found, expected) in band.into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-6 * sd_m, "{band:?} about {x_m} with {sd_m}");
        }
    }
}

/// Draws the noise (m) at every row once, from the definition of each term.
fn noise_m(record: &Record, position_m: &[f64], rng: &mut ChaCha8Rng) -> Vec<f64> {
    let [white, ou, ou_time_s, gain, offset] = NOISE;
    let mut standard = || -> f64 { rng.sample(StandardNormal) };
    let (mut process, mut of_cycle) = (1e-6 * ou * standard(), [0.0; 2]);
    (0..record.n_rows())
        .map(|i| {
            if i > 0 {
                let decay = (-(record.time_s[i] - record.time_s[i - 1]) / ou_time_s).exp();
                process = decay * process + 1e-6 * ou * (1.0 - decay * decay).sqrt() * standard();
            }
            if i == 0 || record.cycle[i] != record.cycle[i - 1] {
                of_cycle = [gain * standard(), 1e-6 * offset * standard()];
            }
            position_m[i] * of_cycle[0] + of_cycle[1] + process + 1e-6 * white * standard()
        })
        .collect()
}

/// Scores 40 measurements that are simulated term by term. Each coverage lies outside its 99 % range with a probability of 1 %. For each band, more than 7 of 40
/// coverages thus lie outside with a probability of 10⁻⁷. If the ranges were computed for independent errors, they would be so narrow that many more coverages lie
/// outside.
///
/// The joint probability of a misfit is twice the smaller of two probabilities, at most 1. The joint probability is 1 if both exceed one half. This happens in at least
/// a quarter of the measurements. The probability that it happens in none of 40 measurements is 10⁻⁵.
#[test]
fn the_coverage_s_range_is_that_of_gains_and_offsets_shared_by_a_cycle() {
    let problem = problem();
    let check = check_of(&problem);
    let (bands_m, exact_m, record) = (bands_m(&check), exact_m(&problem), &problem.experiment.record);
    let mut rng = ChaCha8Rng::seed_from_u64(31);
    let (mut outside, mut outside_independent, mut n_certain) = ([0; 2], [0; 2], 0);
    for _ in 0..40 {
        let noise_m = noise_m(record, &exact_m, &mut rng);
        // Every tenth row of the held-out cycles is scored.
        let is_scored = |i: usize| record.cycle[i] > 1 && i.is_multiple_of(10);
        let observed_m: Vec<Option<f64>> =
            (0..record.n_rows()).map(|i| is_scored(i).then(|| exact_m[i] + noise_m[i])).collect();
        let score = score(&check, &bands_m, record, &observed_m, 5).unwrap();
        n_certain += usize::from(score.joint_p == 1.0);
        let n = observed_m.iter().flatten().count() as f64;
        for (band, probability) in [0.5_f64, 0.9].into_iter().enumerate() {
            let coverage = score.coverage[band];
            let [lower, upper] = score.coverage_expected[band];
            outside[band] += usize::from(coverage < lower || coverage > upper);
            let half_range = 2.576 * (probability * (1.0 - probability) / n).sqrt();
            outside_independent[band] += usize::from((coverage - probability).abs() > half_range);
        }
    }
    assert!(n_certain > 0);
    assert!(outside.iter().all(|count| *count <= 7), "{outside:?}");
    assert!(outside_independent.iter().all(|count| *count > 7), "{outside_independent:?}");
}
