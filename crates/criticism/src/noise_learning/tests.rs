//! Tests that learn known noise of every kind, and that compare the restricted likelihood with dense algebra.

use nalgebra::{DMatrix, DVector};
use std::time::Instant;

use super::super::test_subjects::{Protocol, noise_of, subject, truth_of};
use super::super::{Search, Subject};
use super::restricted::Absorbed;
use super::*;
use crate::NoiseValues;
use crate::derivatives::columns_m;

fn learnt(data: &Subject) -> NoiseEstimates {
    let fitted = data.fit(&data.base(), &[], Search::Wide).expect("fits");
    let clock = Instant::now();
    let learnt = learn(data, &data.base(), &fitted).expect("derivatives");
    println!("learnt in {:?}", clock.elapsed());
    learnt
}

fn noisy(subject: &Subject, truth_m: &[f64], noise: &NoiseValues, seed: u64) -> Subject {
    let noise_m = noise_of(subject, truth_m, noise, seed);
    subject.with_positions(&truth_m.iter().zip(noise_m).map(|(x, e)| x + e).collect::<Vec<_>>())
}

/// Root mean square of (estimate − truth)/error over repeated estimates.
fn calibration(found: &[NoiseEstimateSd], truth_um: f64) -> f64 {
    let squares = found.iter().map(|spread| ((spread.sd_m - 1e-6 * truth_um) / spread.standard_error_m).powi(2));
    (squares.sum::<f64>() / found.len() as f64).sqrt()
}

/// Every method finds the white noise of 4 µm in 24 records. The root mean square of 24 standard normal scores exceeds 1.9 once in 10⁶.
#[test]
fn white_noise_is_found_every_way() {
    let subject = subject(Protocol::Levels);
    let truth_m = truth_of(&subject, &[], &[]);
    let all: Vec<NoiseEstimates> = (0..24)
        .map(|seed| learnt(&noisy(&subject, &truth_m, &NoiseValues::new([4.0, 1e-6, 1.0, 1e-9, 1e-6]), 50 + seed)))
        .collect();
    let of = |part: fn(&NoiseEstimates) -> Option<NoiseEstimateSd>| all.iter().filter_map(part).collect::<Vec<_>>();
    let ways = [
        ("rest", of(|learnt| learnt.rest)),
        ("neighbours", of(|learnt| learnt.neighbours)),
        ("cycles", of(|learnt| learnt.cycles.map(|cycles| cycles.within))),
        ("restricted", of(|learnt| Some(learnt.restricted.row))),
    ];
    for (name, found) in ways {
        let score = calibration(&found, 4.0);
        let mean_um = 1e6 * found.iter().map(|spread| spread.sd_m).sum::<f64>() / found.len() as f64;
        println!("{name}: {mean_um:.3} µm, score {score:.2}, error {:.3} µm", 1e6 * found[0].standard_error_m);
        assert_eq!(found.len(), 24, "{name}");
        assert!(score < 1.9, "{name}: {score}");
    }
    let n_disagreeing = all.iter().filter(|learnt| !learnt.disagreements().is_empty()).count();
    all.iter().flat_map(NoiseEstimates::disagreements).for_each(|text| println!("{text}"));
    // A disagreement needs 3.5 errors, which occurs once in 2,000 records. Two of 24 occur about once in 10⁴, so the bound relies on the fixed seeds.
    assert!(n_disagreeing <= 1, "{n_disagreeing}");
    all[0].estimates().iter().for_each(|estimate| println!("{}", estimate.text));
}

/// The sentences report shifts of whole cycles by 6 µm as shifts, but not slow noise of equal size. Each record has only two differences of shifts. They are small in
/// some records and resemble a gain in others, so about six records in ten report a shift. Fewer than three of sixteen fail falsely about once in 10⁴. For slow noise,
/// with one report in 1,000 records, more than two reports have a probability below 10⁻⁶.
#[test]
fn only_shifts_of_cycles_are_called_that() {
    let subject = subject(Protocol::Paper);
    let truth_m = truth_of(&subject, &[], &[]);
    let n_said = |noise: &NoiseValues| {
        let is_said = |seed: &u64| {
            let learnt = learnt(&noisy(&subject, &truth_m, noise, 350 + seed));
            learnt.disagreements().iter().any(|text| text.contains("shifted against each other"))
        };
        (0..16).filter(is_said).count()
    };
    let (shifted, slow) = (
        n_said(&NoiseValues::new([4.0, 1e-6, 1.0, 1e-9, 6.0])),
        n_said(&NoiseValues::new([4.0, 6.0, 1.0, 1e-9, 1e-6])),
    );
    println!("said of shifts {shifted}, of slow noise {slow} of 16");
    assert!(shifted >= 3 && slow <= 2, "{shifted} {slow}");
}

/// A gain of 2 % shows between cycles and not between neighbours, and the sentence reports it. Changes of gain by 2.8 % are at least 12 errors. The score therefore
/// misses its threshold in fewer than one record of ten. Fewer than eight reports in sixteen have a probability below 10⁻⁵.
#[test]
fn a_gain_shows_between_cycles() {
    let subject = subject(Protocol::Levels);
    let truth_m = truth_of(&subject, &[], &[]);
    let (mut n_said, mut sum) = (0, 0.0);
    for seed in 0..16 {
        let learnt = learnt(&noisy(&subject, &truth_m, &NoiseValues::new([4.0, 1e-6, 1.0, 0.02, 1e-6]), 150 + seed));
        let cycles = learnt.cycles.expect("equal steps");
        sum += cycles.gain_sd.powi(2);
        let said = learnt.disagreements();
        n_said += usize::from(said.iter().any(|text| text.contains("change of gain")));
        if seed == 0 {
            said.iter().for_each(|text| println!("{text}"));
            learnt.estimates().iter().for_each(|estimate| println!("{}", estimate.text));
        }
    }
    // Each record has three changes of gain, and neighbouring changes share a cycle. The mean square of 16 records is within a factor of 2.5, except once in 10⁶.
    let gain_sd = (sum / 16.0_f64).sqrt();
    println!("gain {gain_sd:.4}, said {n_said} of 16");
    assert!((0.4..2.5).contains(&(gain_sd / 0.02).powi(2)), "{gain_sd}");
    assert!(n_said >= 8, "{n_said}");
}

/// The restricted likelihood shows a process of 6 µm with a correlation time of 1 s, and neighbours hardly show it. The root mean square of sixteen standard normal
/// scores is below 2.2, except once in 10⁶. The mean of sixteen estimates from neighbours has an error of 0.1 µm, a fifth of its tolerance.
#[test]
fn slow_noise_hides_from_neighbours() {
    let subject = subject(Protocol::Paper);
    let truth_m = truth_of(&subject, &[], &[]);
    let all: Vec<NoiseEstimates> = (0..16)
        .map(|seed| learnt(&noisy(&subject, &truth_m, &NoiseValues::new([4.0, 6.0, 1.0, 1e-9, 1e-6]), 250 + seed)))
        .collect();
    let rows: Vec<NoiseEstimateSd> = all.iter().map(|learnt| learnt.restricted.row).collect();
    let score = calibration(&rows, 4.0_f64.hypot(6.0));
    let mean = |part: &dyn Fn(&NoiseEstimates) -> f64| 1e6 * all.iter().map(part).sum::<f64>() / 16.0;
    let by_neighbours = mean(&|learnt| learnt.neighbours.map_or(0.0, |spread| spread.sd_m));
    let by_likelihood = mean(&|learnt| learnt.restricted.row.sd_m);
    println!("neighbours {by_neighbours:.2}, restricted {by_likelihood:.2} µm, score {score:.2}");
    all[0].disagreements().iter().for_each(|text| println!("{text}"));
    all[0].estimates().iter().for_each(|estimate| println!("{}", estimate.text));
    assert!(by_neighbours < 5.0 && score < 2.2, "{by_neighbours} {score}");
}

/// On the first hold, the restricted log likelihood equals an expression in dense matrices, up to a constant. The expression is −½(ln det Σ + ln det(AᵀΣ⁻¹A + prior) +
/// the squared residual after the best step), with the covariance Σ and the derivatives A.
#[test]
fn the_restricted_likelihood_equals_dense_algebra() {
    let subject = subject(Protocol::Paper);
    let subject = subject.without_rows(&(60..800).collect::<Vec<_>>());
    let truth_m = truth_of(&subject, &[], &[]);
    let data = noisy(&subject, &truth_m, &NoiseValues::new([4.0, 3.0, 0.5, 0.01, 2.0]), 3);
    let base = data.base();
    let fitted = data.fit(&base, &[], Search::Wide).expect("fits");
    let absorbed = Absorbed::new(&data, &base, &fitted).expect("derivatives");
    let columns = columns_m(&data, &base, &fitted.theta).expect("derivatives");
    let rows: Vec<usize> = (0..800).filter(|row| data.fitted_m[*row].is_some()).collect();
    let time_s = &data.experiment().record.time_s;
    let dense = |noise: &NoiseValues| {
        let covariance = DMatrix::from_fn(rows.len(), rows.len(), |a, b| {
            let (i, j) = (rows[a], rows[b]);
            let white = if i == j { noise[0] * noise[0] } else { 0.0 };
            let process = noise[1] * noise[1] * (-(time_s[i] - time_s[j]).abs() / noise[2]).exp();
            let gain = noise[3] * noise[3] * 1e12 * fitted.position_m[i] * fitted.position_m[j];
            1e-12 * (white + process + gain + noise[4] * noise[4])
        });
        let a = DMatrix::from_fn(rows.len(), columns.len(), |i, k| columns[k][rows[i]]);
        let residual = DVector::from_iterator(
            rows.len(),
            rows.iter().map(|row| data.fitted_m[*row].expect("observed") - fitted.position_m[*row]),
        );
        let factor = covariance.cholesky().expect("positive definite");
        let mut precision = a.transpose() * factor.solve(&a);
        let mut pull = a.transpose() * factor.solve(&residual);
        for (k, free) in base.free.iter().enumerate() {
            let (mean, sd) = free.prior.expect("the law's");
            precision[(k, k)] += 1.0 / (sd * sd);
            pull[k] += (mean - fitted.theta[k]) / (sd * sd);
        }
        let step = precision.clone().lu().solve(&pull).expect("regular");
        0.5 * pull.dot(&step) - 0.5 * precision.determinant().ln()
    };
    for noise in [
        NoiseValues::new([4.0, 3.0, 0.5, 0.01, 2.0]),
        NoiseValues::new([2.0, 8.0, 2.0, 0.05, 1.0]),
        NoiseValues::new([6.0, 0.1, 0.2, 1e-4, 0.1]),
    ] {
        let (ours, dense) = (absorbed.correction(&noise), dense(&noise));
        assert!((ours - dense).abs() < 1e-6 * (1.0 + dense.abs()), "{ours} against {dense}");
    }
}

/// The law's three parameters use many of the degrees of freedom of twenty rows of white noise. Maximum likelihood understates σ, restricted maximum likelihood does not.
/// The prior of the process adds a little white noise, so the test of the ratio of the two estimates is one-sided. Both use the same records, so the ratio hardly
/// scatters. The mean of the sixty variances by maximum likelihood has an error of 4 %. The asserted loss is about four of those errors; chance removes it with a
/// probability of 3 × 10⁻⁵.
#[test]
fn restricted_estimates_make_good_what_the_mean_absorbs() {
    let subject = subject(Protocol::Paper);
    let subject = subject.without_rows(&(0..800).filter(|row| row % 10 != 0 || *row >= 200).collect::<Vec<_>>());
    let truth_m = truth_of(&subject, &[], &[]);
    let (mut by_maximum, mut by_restricted) = (0.0, 0.0);
    for seed in 0..60 {
        let data = noisy(&subject, &truth_m, &NoiseValues::new([4.0, 1e-6, 1.0, 1e-9, 1e-6]), 700 + seed);
        let fitted = data.fit(&data.base(), &[], Search::Wide).expect("fits");
        let restricted = learn(&data, &data.base(), &fitted).expect("derivatives").restricted;
        by_maximum += (fitted.noise[0].powi(2) + fitted.noise[1].powi(2)) / 60.0;
        by_restricted += restricted.row.sd_m.powi(2) * 1e12 / 60.0;
    }
    println!("variance over truth: maximum {:.3}, restricted {:.3}", by_maximum / 16.0, by_restricted / 16.0);
    assert!(by_restricted > 1.05 * by_maximum && by_maximum < 16.0, "{by_maximum} {by_restricted}");
}
