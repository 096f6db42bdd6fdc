//! Makes the document of a comparison of groups, `vitreo-uq/groups/1`.

use documents::groups::{
    ContrastSummary, CreepSummary, ExperimentSummary, GroupParameter, GroupSummary, GroupsSummary, IntervalSummary,
    PopulationSampler, RatioVerdict, SpecimenParameter, SpecimenSummary,
};
use rayon::prelude::*;

use super::alone::unpooled_quantiles;
use super::cohort::{Key, Measurement};
use super::contrast::Contrast;
use super::design::Specimen as SpecimenOfDesign;
use super::hierarchy::PopulationDraw;
use super::job::{Comparison, GroupsRequest, HEAVY_TAILED_DOF};
use super::plan::{RatioQuestion, plan};
use super::predict::{PredictedGroup, creep, creep_times_s};
use super::published::published_values;
use super::scale::SizeScale;
use super::{spread, wording};
use base::error::Result;
use figures::density::{quantile_of_sorted, sorted};
use laws::rheology::TimeWindow;

/// 5 %, 50 % and 95 % quantiles of the values.
fn three(values: &[f64]) -> [f64; 3] {
    let ascending = sorted(values);
    [0.05, 0.5, 0.95].map(|probability| quantile_of_sorted(&ascending, probability))
}

/// 5 %, 50 % and 95 % quantiles of the parameter values at these coordinates.
fn values(scale: SizeScale, coordinates: &[f64]) -> [f64; 3] {
    three(coordinates).map(|coordinate| scale.value(coordinate))
}

fn every(values: &[f64], p: usize, k: usize) -> Vec<f64> {
    values.iter().skip(k).step_by(p).copied().collect()
}

/// Summarises a comparison of groups in numbers and sentences.
///
/// # Errors
/// Errors of computing the law's creep.
pub fn summarise(measurements: &[Measurement], found: &Comparison, request: &GroupsRequest) -> Result<GroupsSummary> {
    let draws: Vec<&PopulationDraw> = found.population.draws().collect();
    let groups: Vec<GroupSummary> = found.groups.iter().map(|group| group_summary(found, &draws, group)).collect();
    let contrasts: Vec<ContrastSummary> =
        found.contrasts.par_iter().map(|contrast| contrast_summary(found, &draws, contrast, request)).collect();
    let experiments: Vec<ExperimentSummary> =
        (0..measurements.len()).map(|e| experiment_summary(measurements, found, e)).collect();
    let specimens = specimen_summaries(found, &draws, request.sampler.seed);
    let p = found.parameters.len();
    let within = |k: usize| {
        let sd: Vec<f64> =
            draws.iter().filter_map(|draw| draw.within_specimens.get(k * p + k).map(|v| v.sqrt())).collect();
        let [q05, median, q95] = three(&sd);
        IntervalSummary { name: found.parameters[k].into(), median, q05, q95 }
    };
    let population = &found.population;
    let sampler = PopulationSampler {
        chains: population.chains.len(),
        sweeps: population.n_sweeps,
        rhat: population.rhat,
        ess: population.ess,
    };
    let mut effects: Vec<String> =
        measurements.iter().flat_map(|measurement| measurement.specification.effects.iter().cloned()).collect();
    effects.sort();
    effects.dedup();
    let mut summary = GroupsSummary {
        by: request.keys.iter().map(|key: &Key| key.name().to_string()).collect(),
        margin: request.margin,
        law: found.law.name().into(),
        effects,
        student_dof: request.is_heavy_tailed.then_some(HEAVY_TAILED_DOF),
        sentences: Vec::new(),
        within_specimen_log_sd: found.design.has_repeats().then(|| (0..p).map(within).collect()),
        creep: creep_summary(found)?,
        published: published_values(&found.parameters),
        converged: population.has_converged,
        sampler,
        groups,
        contrasts,
        specimens,
        n_specimens: found.design.specimens.len(),
        experiments,
        warnings: Vec::new(),
    };
    summary.sentences = wording::conclusions(&summary);
    summary.warnings = wording::warnings(&summary);
    Ok(summary)
}

fn group_summary(found: &Comparison, draws: &[&PopulationDraw], predicted_group: &PredictedGroup) -> GroupSummary {
    let p = found.parameters.len();
    let parameter = |k: usize| {
        let scale = found.scales[k];
        let [q05, median, q95] = values(scale, &every(&predicted_group.typical, p, k));
        let [lower, _, upper] = values(scale, &every(&predicted_group.new_specimen, p, k));
        let [sd_lower, sd, sd_upper] = three(&every(&predicted_group.between_sd, p, k));
        GroupParameter {
            name: found.parameters[k].into(),
            median,
            q05,
            q95,
            scale: scale.name(),
            between_specimen_log_sd: sd,
            between_specimen_log_sd_90: [sd_lower, sd_upper],
            new_specimen_90: [lower, upper],
            pooling: predicted_group.group.and_then(|group| pooling(found, draws, group, k)),
        }
    };
    let correlation = predicted_group.group.map(|group| {
        let stratum = found.design.groups[group].stratum * p * p;
        let entry = |i: usize, j: usize| {
            let of = |draw: &PopulationDraw, i: usize, j: usize| draw.between_specimens[stratum + j * p + i];
            let values: Vec<f64> =
                draws.iter().map(|draw| of(draw, i, j) / (of(draw, i, i) * of(draw, j, j)).sqrt()).collect();
            three(&values)[1]
        };
        (0..p).map(|i| (0..p).map(|j| entry(i, j)).collect()).collect()
    });
    GroupSummary {
        name: predicted_group.name.clone(),
        specimens: predicted_group.group.map_or(0, |group| found.design.n_specimens(group)),
        experiments: predicted_group
            .group
            .map_or(0, |group| found.design.group_of.iter().filter(|g| **g == group).count()),
        parameters: (0..p).map(parameter).collect(),
        correlation,
    }
}

/// Indices of the specimens whose first experiment belongs to the group with the index `group`.
fn specimens_first_in_group(found: &Comparison, group: usize) -> Vec<usize> {
    let design = &found.design;
    let is_home =
        |specimen: &SpecimenOfDesign| specimen.experiments.first().is_some_and(|e| design.group_of[*e] == group);
    design.specimens.iter().enumerate().filter(|(_, specimen)| is_home(specimen)).map(|(index, _)| index).collect()
}

/// Pooling factor of parameter `k` in a group: 1 − V₁/V₂, computed from the specimens' deviations from the group's mean. V₁ is the variance over specimens
/// of their mean deviation. V₂ is the mean over draws of the variance over specimens. `None` for fewer than two specimens.
fn pooling(found: &Comparison, draws: &[&PopulationDraw], group: usize, k: usize) -> Option<f64> {
    let p = found.parameters.len();
    let specimens = specimens_first_in_group(found, group);
    if specimens.len() < 2 {
        return None;
    }
    let deviation = |draw: &PopulationDraw, s: usize| draw.specimen_mean[s * p + k] - draw.group_mean[group * p + k];
    let mean_of = |s: usize| draws.iter().map(|draw| deviation(draw, s)).sum::<f64>() / draws.len() as f64;
    let means: Vec<f64> = specimens.iter().map(|s| mean_of(*s)).collect();
    let variances: Vec<f64> = draws
        .iter()
        .map(|draw| spread::variance(&specimens.iter().map(|s| deviation(draw, *s)).collect::<Vec<f64>>()))
        .collect();
    let mean_variance = variances.iter().sum::<f64>() / variances.len() as f64;
    Some((1.0 - spread::variance(&means) / mean_variance).clamp(0.0, 1.0))
}

fn contrast_summary(
    found: &Comparison,
    draws: &[&PopulationDraw],
    contrast: &Contrast,
    request: &GroupsRequest,
) -> ContrastSummary {
    let [q05, ratio_median, q95] = contrast.ratio_quantiles([0.05, 0.5, 0.95]);
    let margin = request.margin;
    let verdict = contrast.verdict(margin);
    let more = (verdict == RatioVerdict::Undecided).then(|| {
        let variance_of_pair = variance_of_pair(found, draws, contrast, request);
        let question = RatioQuestion { log_ratio: &contrast.log_ratio, variance_of_pair: &variance_of_pair, margin };
        plan(&question, request.sampler.seed)
    });
    let name = |group: usize| found.design.groups[group].name.clone();
    ContrastSummary {
        parameter: found.parameters[contrast.parameter].into(),
        a: name(contrast.groups[0]),
        b: name(contrast.groups[1]),
        ratio_median,
        q05,
        q95,
        probability_greater: contrast.probability_above(1.0),
        probability_beyond_margin: contrast.probability_above(1.0 + margin),
        probability_below_margin: 1.0 - contrast.probability_above(1.0 / (1.0 + margin)),
        is_declared: contrast.is_declared || matches!(verdict, RatioVerdict::Greater | RatioVerdict::Less),
        verdict,
        more,
    }
}

/// Variance of the log ratio between one new specimen of each of two groups, one value per draw. Spreads in log-odds are converted to spreads in
/// logarithms by the slope at the group's typical specimen. If the groups share specimens, both measurements are made on one specimen, whose deviation
/// cancels.
fn variance_of_pair(
    found: &Comparison,
    draws: &[&PopulationDraw],
    contrast: &Contrast,
    request: &GroupsRequest,
) -> Vec<f64> {
    let (p, k) = (found.parameters.len(), contrast.parameter);
    let strata = contrast.groups.map(|group| found.design.groups[group].stratum);
    let heavy = if request.is_heavy_tailed { HEAVY_TAILED_DOF / (HEAVY_TAILED_DOF - 2.0) } else { 1.0 };
    let of_measurement: f64 = contrast.groups.iter().map(|group| measurement_variance(found, *group, k)).sum();
    let variance = |draw: &&PopulationDraw| {
        let slopes = contrast.groups.map(|group| found.scales[k].relative_slope(draw.group_mean[group * p + k]));
        let between = |stratum: usize| heavy * draw.between_specimens[stratum * p * p + k * p + k];
        let within = draw.within_specimens.get(k * p + k).copied().unwrap_or(0.0);
        let is_shared = strata[0] == strata[1] && found.design.has_repeats();
        let of_specimens = if is_shared {
            (slopes[0] - slopes[1]).powi(2) * between(strata[0])
        } else {
            slopes[0].powi(2) * between(strata[0]) + slopes[1].powi(2) * between(strata[1])
        };
        of_specimens + (slopes[0].powi(2) + slopes[1].powi(2)) * within + of_measurement
    };
    draws.iter().map(variance).collect()
}

/// Variance of the logarithm of parameter `k` in a single experiment, as the median over the experiments of a group.
fn measurement_variance(found: &Comparison, group: usize, k: usize) -> f64 {
    let p = found.parameters.len();
    let of_experiment = |(e, _): (usize, &usize)| {
        let coordinates = every(&found.draws[e].coordinates, p, k).into_iter();
        spread::variance(&coordinates.map(|x| found.scales[k].ln_value(x)).collect::<Vec<f64>>())
    };
    let members = found.design.group_of.iter().enumerate().filter(|(_, group_place)| **group_place == group);
    let variances: Vec<f64> = members.map(of_experiment).collect();
    quantile_of_sorted(&sorted(&variances), 0.5)
}

fn experiment_summary(measurements: &[Measurement], found: &Comparison, e: usize) -> ExperimentSummary {
    let p = found.parameters.len();
    let (interim, entry) = (&found.interims[e], found.entries[e]);
    let specimen = found.design.specimens.iter().find(|specimen| specimen.experiments.contains(&e));
    ExperimentSummary {
        name: measurements[e].name(),
        specimen: specimen.map_or_else(String::new, |specimen| specimen.name.clone()),
        group: found.design.groups[found.design.group_of[e]].name.clone(),
        alone: (0..p).map(|k| values(found.scales[k], &every(&found.draws[e].coordinates, p, k))).collect(),
        rmse_fitted_um: interim.rmse_fitted_um,
        rmse_heldout_um: interim.rmse_heldout_um,
        predictive_sd_heldout_um: interim.predictive_sd_heldout_um,
        noise_um: interim.noise_um,
        residual_warnings: interim.residual_warnings.clone(),
        converged: interim.converged,
        effective_draws: entry.effective_draws,
        is_exact: entry.is_exact,
    }
}

/// Summaries of the specimens, one for each combination of a specimen and its groups.
fn specimen_summaries(found: &Comparison, draws: &[&PopulationDraw], seed: u64) -> Vec<SpecimenSummary> {
    let (p, design) = (found.parameters.len(), &found.design);
    let mut places: Vec<(usize, usize)> = Vec::new();
    for group in 0..design.groups.len() {
        let is_there = |specimen: &SpecimenOfDesign| specimen.experiments.iter().any(|e| design.group_of[*e] == group);
        let there = design.specimens.iter().enumerate().filter(|(_, specimen)| is_there(specimen));
        places.extend(there.map(|(specimen, _)| (specimen, group)));
    }
    let within: Vec<Vec<f64>> = (0..p)
        .map(|k| draws.iter().filter_map(|draw| draw.within_specimens.get(k * p + k).copied()).collect())
        .collect();
    let alone = |(specimen, group): (usize, usize), k: usize| {
        let is_there = |e: &&usize| design.group_of[**e] == group;
        let map = design.specimens[specimen].experiments.iter().filter(is_there).map(|e| &found.draws[*e]);
        unpooled_quantiles(&map.collect::<Vec<_>>(), &within[k], k, p, seed)
    };
    let pooled = |(specimen, group): (usize, usize), k: usize| {
        let home = design.group_of[design.specimens[specimen].experiments[0]];
        let of = |draw: &&PopulationDraw| {
            draw.specimen_mean[specimen * p + k] + draw.group_mean[group * p + k] - draw.group_mean[home * p + k]
        };
        values(found.scales[k], &draws.iter().map(of).collect::<Vec<f64>>())
    };
    let coordinates: Vec<Vec<[f64; 3]>> =
        places.iter().map(|place| (0..p).map(|k| alone(*place, k)).collect()).collect();
    let medians: Vec<Vec<f64>> =
        coordinates.iter().map(|coordinate| coordinate.iter().map(|three| three[1]).collect()).collect();
    let group_of: Vec<usize> = places.iter().map(|(_, group)| *group).collect();
    let outlying = spread::outlying(&medians, &group_of);
    let summary = |index: usize| {
        let (specimen, group) = places[index];
        let parameter = |k: usize| SpecimenParameter {
            name: found.parameters[k].into(),
            alone: coordinates[index][k].map(|coordinate| found.scales[k].value(coordinate)),
            pooled: pooled((specimen, group), k),
        };
        SpecimenSummary {
            name: design.specimens[specimen].name.clone(),
            group: design.groups[group].name.clone(),
            parameters: (0..p).map(parameter).collect(),
            is_outlying: outlying[index],
        }
    };
    (0..places.len()).map(summary).collect()
}

fn creep_summary(found: &Comparison) -> Result<Option<CreepSummary>> {
    if found.parameters.len() != found.law.parameters().len() {
        return Ok(None);
    }
    let records = || found.specimens.iter().map(|specimen| &specimen.model.problem.experiment.record);
    let shortest_s = records().filter_map(|record| record.median_interval_s()).fold(f64::INFINITY, f64::min);
    let longest_s = records()
        .filter_map(|record| {
            Some((record.time_s.last()? - record.time_s.first()?) / f64::from(record.n_cycles().max(1)))
        })
        .fold(0.0, f64::max);
    if !(shortest_s > 0.0 && longest_s > shortest_s && longest_s.is_finite()) {
        return Ok(None);
    }
    let time_s = creep_times_s(TimeWindow { shortest_s, longest_s });
    let groups =
        found.groups.iter().map(|group| creep(found.law, &found.scales, group, &time_s)).collect::<Result<_>>()?;
    Ok(Some(CreepSummary { time_s, groups }))
}
