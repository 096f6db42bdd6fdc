//! Predictions from the population: a new specimen of a group, its creep, and groups without measurements.

use documents::groups::CreepPrediction;
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{ChiSquared, Distribution, StandardNormal};

use super::design::Design;
use super::hierarchy::{PopulationDraw, ShareLayout};
use super::scale::SizeScale;
use base::error::{Result, Setting};
use base::number::Dual;
use figures::density::{quantile_of_sorted, sorted};
use laws::rheology::{BaseLaw, RetardationSpectrum, TimeWindow};

/// Largest number of draws for which creep is computed.
const N_CURVES: usize = 1_000;
/// Number of times at which creep is computed.
const N_TIMES: usize = 41;
/// Number of the random stream for the first group's predictions. Each further group has the next stream.
const STREAM: u64 = 1 << 32;

/// Prediction of a group by the population. Each vector holds one draw after another, with one value per parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct PredictedGroup {
    /// Name of the group.
    pub name: String,
    /// Coordinates (logarithms or log-odds) of the parameters of the group's typical specimen.
    pub typical: Vec<f64>,
    /// Coordinates (logarithms or log-odds) of the parameters of a new specimen, as the mean over its repeats.
    pub new_specimen: Vec<f64>,
    /// Coordinates of the parameters of another new specimen, from the same draws of the population.
    pub other_specimen: Vec<f64>,
    /// Standard deviations between specimens, in the coordinates.
    pub between_sd: Vec<f64>,
    /// Index of the group in the design; `None` for a group without measurements.
    pub group: Option<usize>,
}

/// Predicts all groups of the design. If the design has two keys, combinations of levels without measurements follow.
///
/// For a combination without measurements, the group's own term is drawn from its distribution. Its specimens have the spread of the measured group with
/// the most levels in common.
pub fn predicted_groups(
    design: &Design,
    draws: &[&PopulationDraw],
    p: usize,
    student_dof: Option<f64>,
    seed: u64,
) -> Vec<PredictedGroup> {
    let mut rng_of = {
        let mut next = STREAM;
        move || {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(next);
            next += 1;
            rng
        }
    };
    let mut all = Vec::new();
    for (index, group) in design.groups.iter().enumerate() {
        let typical = draws.iter().flat_map(|draw| draw.group_mean[index * p..(index + 1) * p].to_vec()).collect();
        all.push(with_specimens(&group.name, typical, group.stratum, Some(index), draws, student_dof, &mut rng_of()));
    }
    for levels in missing(design) {
        let mut rng = rng_of();
        let layout = ShareLayout::new(design);
        let shares: Vec<usize> = std::iter::once(0)
            .chain(levels.iter().zip(&layout.factors).map(|(level, range)| range.start + level))
            .collect();
        let own_sd = design.keys.len() * p;
        let mut typical = Vec::with_capacity(draws.len() * p);
        for draw in draws {
            for k in 0..p {
                let noise: f64 = StandardNormal.sample(&mut rng);
                let sum: f64 = shares.iter().map(|share| draw.shares[share * p + k]).sum();
                typical.push(sum + draw.between_groups_sd[own_sd + k] * noise);
            }
        }
        // Keys are ordered by importance, so agreement in an earlier key counts more.
        let likeness = |specimen_levels: &Vec<usize>| {
            specimen_levels.iter().zip(&levels).map(|(a, b)| a == b).collect::<Vec<bool>>()
        };
        let nearest = (0..design.groups.len()).rev().max_by_key(|g| likeness(&design.groups[*g].levels)).unwrap_or(0);
        let names: Vec<&str> = levels.iter().zip(&design.keys).map(|(level, key)| key[*level].as_str()).collect();
        let stratum = design.groups[nearest].stratum;
        all.push(with_specimens(&names.join(","), typical, stratum, None, draws, student_dof, &mut rng));
    }
    all
}

/// Combinations of the two keys' levels for which there is no experiment; empty unless the design has two keys.
fn missing(design: &Design) -> Vec<Vec<usize>> {
    let [first, second] = &design.keys[..] else { return Vec::new() };
    let all = (0..first.len()).flat_map(|a| (0..second.len()).map(move |b| vec![a, b]));
    all.filter(|levels| design.groups.iter().all(|group| group.levels != *levels)).collect()
}

fn with_specimens(
    name: &str,
    typical: Vec<f64>,
    stratum: usize,
    group: Option<usize>,
    draws: &[&PopulationDraw],
    student_dof: Option<f64>,
    rng: &mut ChaCha8Rng,
) -> PredictedGroup {
    let p = typical.len() / draws.len().max(1);
    let covariance = |draw: &PopulationDraw| {
        DMatrix::from_column_slice(p, p, &draw.between_specimens[stratum * p * p..(stratum + 1) * p * p])
    };
    let chi_squared = student_dof.and_then(|dof| ChiSquared::new(dof).ok().map(|chi_squared| (dof, chi_squared)));
    let mut specimens = || -> Vec<f64> {
        let mut all = Vec::with_capacity(typical.len());
        for (draw, mean) in draws.iter().zip(typical.chunks_exact(p.max(1))) {
            let noise = DVector::from_fn(p, |_, _| StandardNormal.sample(rng));
            let weight = chi_squared.map_or(1.0, |(dof, chi_squared)| chi_squared.sample(rng) / dof);
            let factor = covariance(draw).cholesky();
            let deviation = factor.map_or_else(|| DVector::zeros(p), |factor| factor.l() * noise / weight.sqrt());
            all.extend(mean.iter().zip(deviation.iter()).map(|(mean, deviation)| mean + deviation));
        }
        all
    };
    let (new_specimen, other_specimen) = (specimens(), specimens());
    let sd_of = |draw: &&PopulationDraw| (0..p).map(|k| covariance(draw)[(k, k)].sqrt()).collect::<Vec<f64>>();
    let between_sd = draws.iter().flat_map(sd_of).collect();
    PredictedGroup { name: name.to_string(), typical, new_specimen, other_specimen, between_sd, group }
}

/// Times (s) at which creep is predicted, evenly spaced in the logarithm.
pub fn creep_times_s(window: TimeWindow) -> Vec<f64> {
    let (first, last) = (window.shortest_s.ln(), window.longest_s.ln());
    (0..N_TIMES).map(|i| (first + (last - first) * i as f64 / (N_TIMES - 1) as f64).exp()).collect()
}

/// Predicts the creep compliance of a group's typical specimen and of a new specimen. All parameters of the law must be compared between groups.
///
/// # Errors
/// [`base::Error::Numerical`] if creep cannot be computed for any draw.
pub fn creep(law: BaseLaw, scales: &[SizeScale], group: &PredictedGroup, time_s: &[f64]) -> Result<CreepPrediction> {
    let (Some(first), Some(last)) = (time_s.first(), time_s.last()) else {
        return Err(base::Error::numerical("the list of times for the creep is empty", "give at least one time"));
    };
    let window = TimeWindow { shortest_s: *first, longest_s: *last };
    let p = law.parameters().len();
    let (mut n_all, mut n_left_out) = (0, 0);
    let mut curves = |coordinates: &[f64]| -> Result<Vec<Vec<f64>>> {
        let step = (coordinates.len() / p).div_ceil(N_CURVES).max(1);
        let mut at_time: Vec<Vec<f64>> = vec![Vec::new(); time_s.len()];
        for draw in coordinates.chunks_exact(p).step_by(step) {
            let parameters: Vec<Dual> = draw.iter().zip(scales).map(|(x, scale)| scale.value(*x).into()).collect();
            n_all += 1;
            match curve(law, &parameters, window, time_s) {
                Some(curve) => at_time.iter_mut().zip(curve).for_each(|(values, value)| values.push(value)),
                None => n_left_out += 1,
            }
        }
        if at_time.iter().any(Vec::is_empty) {
            return Err(base::Error::numerical(
                format!("the law has no finite creep in any draw of {}", group.name),
                format!("give narrower priors ({}), or fix a parameter ({})", Setting::Prior, Setting::Fixed),
            ));
        }
        Ok(at_time.iter().map(|values| sorted(values)).collect())
    };
    let (typical, new_specimen) = (curves(&group.typical)?, curves(&group.new_specimen)?);
    let quantile = |at_time: &[Vec<f64>], probability: f64| {
        at_time.iter().map(|ascending| quantile_of_sorted(ascending, probability)).collect::<Vec<f64>>()
    };
    Ok(CreepPrediction {
        median_per_pa: quantile(&typical, 0.5),
        typical_q05_per_pa: quantile(&typical, 0.05),
        typical_q95_per_pa: quantile(&typical, 0.95),
        new_specimen_q05_per_pa: quantile(&new_specimen, 0.05),
        new_specimen_q95_per_pa: quantile(&new_specimen, 0.95),
        share_left_out: f64::from(n_left_out) / f64::from(n_all.max(1)),
    })
}

/// Creep compliance J(t) at each time. `None` if the law has no spectrum in the time window, or if values exceed the range of floating-point numbers.
fn curve(law: BaseLaw, parameters: &[Dual], window: TimeWindow, time_s: &[f64]) -> Option<Vec<f64>> {
    let spectrum: RetardationSpectrum = RetardationSpectrum::of_law(&law.elements(parameters), window).ok()?;
    let curve: Vec<f64> = time_s.iter().map(|time| spectrum.creep_compliance_per_pa(*time)).collect();
    curve.iter().all(|value| value.is_finite() && *value > 0.0).then_some(curve)
}
