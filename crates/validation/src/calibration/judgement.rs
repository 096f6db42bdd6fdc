//! Computes the verdict of a calibration from the ranks of all replicates.

use super::sentence::sentence;
use super::{CalibrationSubject, FEWEST, LEVEL, LOG_DENSITY, N_DRAWS, Ranked, Replicate};
use documents::calibration::{CalibratedQuantity, Calibration, CalibrationKind, CalibrationVerdict, Coverage};
use sampling::calibration::{
    Ranks, chi_square, count_interval, holm, p_of_chi_square, p_of_score, probability_interval,
};

/// Allowed numbers of histogram bins for the ranks. The first that leaves at least [`FEWEST_IN_BIN`] ranks per bin on average is used.
const BINS: [usize; 4] = [20, 10, 5, 4];
/// Smallest mean number of ranks in a bin for which χ² can be trusted.
const FEWEST_IN_BIN: usize = 5;

/// Returns the document of a calibration. The replicates may be in any order.
pub fn judge(subject: &CalibrationSubject, replicates: &[Replicate]) -> Calibration {
    let mut sorted: Vec<&Replicate> = replicates.iter().collect();
    sorted.sort_by_key(|replicate| replicate.number);
    let sampled: Vec<&Ranked> = sorted.iter().filter_map(|replicate| replicate.ranked.as_ref()).collect();
    // Whether a run converges depends on the truth only through the record. Excluding runs that did not converge therefore keeps the other ranks uniform.
    let ranked: Vec<&Ranked> = sampled.iter().copied().filter(|ranked| ranked.converged).collect();
    let n_bins = BINS.into_iter().find(|bins| bins * FEWEST_IN_BIN <= ranked.len()).unwrap_or(BINS[BINS.len() - 1]);
    let names = subject.parameters.iter().map(String::as_str).chain([LOG_DENSITY]);
    let mut quantities: Vec<CalibratedQuantity> =
        names.enumerate().map(|(index, name)| quantity(name, index, &ranked, n_bins)).collect();
    correct(&mut quantities);
    let kind = match quantities.iter().filter_map(|quantity| quantity.p_holm).min_by(f64::total_cmp) {
        None => CalibrationKind::Undecided,
        Some(p) if p < LEVEL => CalibrationKind::Miscalibrated,
        Some(_) => CalibrationKind::Calibrated,
    };
    let mut found = Calibration {
        experiment: subject.experiment.clone(),
        model: subject.model.clone(),
        simulated_by: subject.simulated_by,
        replicates: sorted.len(),
        ranked: ranked.len(),
        not_converged: sampled.len() - ranked.len(),
        failed: sorted.len() - sampled.len(),
        redrawn: sorted.iter().map(|replicate| replicate.redrawn).sum(),
        draws: N_DRAWS,
        bin_interval_99: count_interval(ranked.len(), 1.0 / n_bins as f64, 0.99),
        quantities,
        verdict: CalibrationVerdict { kind, sentence: String::new() },
    };
    found.verdict.sentence = sentence(&found);
    found
}

fn quantity(name: &str, index: usize, ranked: &[&Ranked], n_bins: usize) -> CalibratedQuantity {
    let ranks = Ranks { ranks: ranked.iter().map(|ranked| ranked.ranks[index]).collect(), n_draws: N_DRAWS };
    let counts = ranks.counts(n_bins);
    let is_judged = ranked.len() >= FEWEST;
    let chi_square = is_judged.then(|| chi_square(&counts));
    let z: Vec<f64> = ranked.iter().filter_map(|ranked| ranked.z.get(index).copied()).collect();
    let n = z.len() as f64;
    let z_mean = (!z.is_empty()).then(|| z.iter().sum::<f64>() / n);
    let z_sd = z_mean
        .filter(|_| z.len() > 1)
        .map(|mean| (z.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt());
    let coverage = |share: f64| {
        let (n, inside) = (ranked.len(), ranks.n_inside(share));
        Coverage {
            share: (n > 0).then(|| inside as f64 / n as f64),
            interval_95: probability_interval(inside, n, 0.95),
        }
    };
    CalibratedQuantity {
        name: name.into(),
        chi_square,
        place: is_judged.then(|| ranks.location_score()),
        spread: is_judged.then(|| ranks.dispersion_score()),
        p_chi_square: chi_square.map(|value| p_of_chi_square(value, n_bins)),
        p_holm: None,
        z_mean,
        z_sd,
        coverage_50: coverage(0.5),
        coverage_90: coverage(0.9),
        counts,
    }
}

/// Corrects each p for the number of tests, over all quantities. Each quantity has three tests. The χ² test detects any deviation from uniform ranks. The tests
/// of place and spread need fewer replicates to detect the two usual faults: a shifted posterior, and a posterior of wrong width.
fn correct(quantities: &mut [CalibratedQuantity]) {
    let of = |calibrated_quantity: &CalibratedQuantity| {
        Some([
            calibrated_quantity.p_chi_square?,
            p_of_score(calibrated_quantity.place?),
            p_of_score(calibrated_quantity.spread?),
        ])
    };
    let Some(p) = quantities.iter().map(of).collect::<Option<Vec<_>>>() else { return };
    let corrected = holm(p.as_flattened());
    for (quantity, three) in quantities.iter_mut().zip(corrected.chunks(3)) {
        quantity.p_holm = three.iter().copied().min_by(f64::total_cmp);
    }
}

#[cfg(test)]
#[path = "judgement_tests.rs"]
mod tests;
