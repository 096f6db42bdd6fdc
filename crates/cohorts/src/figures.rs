//! Figures that compare groups.

use std::path::Path;

use super::hierarchy::PopulationDraw;
use super::job::Comparison;
use super::scale::SizeScale;
use base::error::{Error, Result, Setting};
use documents::groups::{CreepSummary, GroupsSummary, SpecimenSummary};
use figures::contrasts::{ContrastCell, ContrastMatrix, ContrastPanel, contrast_matrix};
use figures::corner::{CornerOptions, ParameterColumn, Posterior, corner};
use figures::creep_bands::{CreepBands, CreepGroup, creep_bands};
use figures::density::Support;
use figures::forest::{Forest, ForestPanel, ForestReference, ForestRow, SpecimenMark, forest};
use figures::labelled_netcdf::{Dimension, Variable, write_labelled_netcdf};
use figures::labels::{ParameterLabel, parameter_label};
use figures::palette::series;
use figures::svg::{Svg, write_figure};

/// Largest number of draws per group in the corner plot.
const N_CORNER_DRAWS: usize = 4_000;

/// Largest number of groups for which a figure's caption states the differences.
const MOST_GROUPS_IN_CAPTION: usize = 4;

/// Draws all figures as SVG and PNG files in `dir`.
///
/// # Errors
/// [`Error::File`] if the file system refuses, and errors of the figures.
pub fn write(dir: &Path, found: &Comparison, summary: &GroupsSummary) -> Result<()> {
    std::fs::create_dir_all(dir).map_err(|source| {
        Error::at_path("create", dir, source, format!("choose a writable place with `{}`", Setting::Out))
    })?;
    let labels: Vec<ParameterLabel> = found.parameters.iter().map(|name| parameter_label(name)).collect();
    let mut figures = vec![("groups", forest_figure(summary, &labels)?), ("corner", corner_figure(found, &labels)?)];
    if !summary.contrasts.is_empty() {
        figures.push(("contrasts", contrasts_figure(summary, &labels)?));
    }
    if let Some(creep) = &summary.creep {
        figures.push(("creep", creep_figure(summary, creep)?));
    }
    figures.iter().try_for_each(|(stem, svg): &(&str, Svg)| write_figure(dir, stem, svg))
}

/// Sentences with the conclusions of the comparison; empty if there are too many groups.
fn sentence(summary: &GroupsSummary) -> String {
    if summary.groups.len() > MOST_GROUPS_IN_CAPTION { String::new() } else { summary.sentences.join(" ") }
}

fn title(summary: &GroupsSummary, what: &str) -> String {
    format!("{what} by {}", summary.by.join(" and "))
}

fn forest_figure(summary: &GroupsSummary, labels: &[ParameterLabel]) -> Result<Svg> {
    let specimens_of = |group: &str| -> Vec<&SpecimenSummary> {
        summary.specimens.iter().filter(|specimen| specimen.group == group).collect()
    };
    let panel = |(k, label): (usize, &ParameterLabel)| {
        let mut sorted: Vec<_> = summary.groups.iter().enumerate().collect();
        sorted.sort_by_key(|(_, group)| &group.name);
        let rows = sorted.into_iter().map(|(index, group)| {
            let group_parameter = &group.parameters[k];
            let mark = |specimen: &&SpecimenSummary| {
                let of_parameter = &specimen.parameters[k];
                (specimen.name.clone(), of_parameter.alone, of_parameter.pooled, specimen.is_outlying)
            };
            let marks: Vec<_> = specimens_of(&group.name).iter().map(mark).collect();
            (index, group, group_parameter, marks)
        });
        (label.axis(), rows.collect::<Vec<_>>())
    };
    let panels: Vec<_> = labels.iter().enumerate().map(panel).collect();
    let references: Vec<Vec<(String, f64)>> = summary
        .groups
        .first()
        .map_or(&[][..], |group| &group.parameters)
        .iter()
        .map(|group_parameter| {
            let of_parameter = summary.published.iter().filter(|value| value.parameter == group_parameter.name);
            of_parameter.map(|value| (format!("{} ({})", value.source, value.species), value.value)).collect()
        })
        .collect();
    // All regions of a species have the same colour.
    let level = |name: &str| name.split(',').next().unwrap_or(name).to_string();
    let mut levels: Vec<String> = summary.groups.iter().map(|group| level(&group.name)).collect();
    levels.sort();
    levels.dedup();
    let colours: Vec<usize> =
        summary.groups.iter().map(|group| levels.binary_search(&level(&group.name)).unwrap_or(0)).collect();
    let data = Forest {
        title: &title(summary, "Specimens and their groups"),
        sentence: &sentence(summary),
        panels: panels
            .iter()
            .zip(&references)
            .map(|((label, rows), references)| ForestPanel {
                label: label.clone(),
                rows: rows
                    .iter()
                    .map(|(index, group, group_parameter, marks)| ForestRow {
                        group: &group.name,
                        colour: series(colours[*index]),
                        n_specimens: group.specimens,
                        typical: [group_parameter.q05, group_parameter.median, group_parameter.q95],
                        new_specimen: group_parameter.new_specimen_90,
                        specimens: marks
                            .iter()
                            .map(|(name, alone, pooled, is_outlying)| SpecimenMark {
                                name,
                                unpooled: *alone,
                                pooled: *pooled,
                                is_outlying: *is_outlying,
                            })
                            .collect(),
                    })
                    .collect(),
                references: references.iter().map(|(label, value)| ForestReference { label, value: *value }).collect(),
            })
            .collect(),
    };
    forest(&data)
}

fn contrasts_figure(summary: &GroupsSummary, labels: &[ParameterLabel]) -> Result<Svg> {
    let names: Vec<&str> = summary
        .groups
        .iter()
        .filter(|group| group.specimens > 0)
        .map(|group_summary| group_summary.name.as_str())
        .collect();
    let parameters = summary.groups.first().map_or(&[][..], |group| &group.parameters);
    let cell = |parameter: &str, a: &str, b: &str| {
        let find = |a: &str, b: &str| {
            summary
                .contrasts
                .iter()
                .find(|contrast| contrast.parameter == parameter && contrast.a == a && contrast.b == b)
        };
        let forward = find(a, b).map(|contrast_summary| ContrastCell {
            ratio: [contrast_summary.q05, contrast_summary.ratio_median, contrast_summary.q95],
            probability_greater: contrast_summary.probability_greater,
            probability_beyond_margin: contrast_summary.probability_beyond_margin,
            is_declared: contrast_summary.is_declared,
        });
        let backward = find(b, a).map(|contrast_summary| ContrastCell {
            ratio: [1.0 / contrast_summary.q95, 1.0 / contrast_summary.ratio_median, 1.0 / contrast_summary.q05],
            probability_greater: 1.0 - contrast_summary.probability_greater,
            probability_beyond_margin: contrast_summary.probability_below_margin,
            is_declared: contrast_summary.is_declared,
        });
        forward.or(backward)
    };
    let panels = parameters.iter().zip(labels).map(|(parameter, label)| ContrastPanel {
        label: label.symbol.clone(),
        groups: names.clone(),
        cells: names.iter().map(|a| names.iter().map(|b| cell(&parameter.name, a, b)).collect()).collect(),
    });
    contrast_matrix(&ContrastMatrix {
        title: &title(summary, "Ratios of typical specimens"),
        sentence: &sentence(summary),
        margin: summary.margin,
        panels: panels.collect(),
    })
}

fn creep_figure(summary: &GroupsSummary, creep: &CreepSummary) -> Result<Svg> {
    let groups = summary.groups.iter().zip(&creep.groups).enumerate().map(|(index, (group, curves))| CreepGroup {
        label: &group.name,
        colour: series(index),
        median_per_pa: curves.median_per_pa.clone(),
        typical_90_per_pa: [curves.typical_q05_per_pa.clone(), curves.typical_q95_per_pa.clone()],
        new_specimen_90_per_pa: [curves.new_specimen_q05_per_pa.clone(), curves.new_specimen_q95_per_pa.clone()],
    });
    creep_bands(&CreepBands {
        title: &title(summary, "Creep of a typical and of a new specimen"),
        sentence: "",
        time_s: &creep.time_s,
        groups: groups.collect(),
    })
}

fn corner_figure(found: &Comparison, labels: &[ParameterLabel]) -> Result<Svg> {
    let p = labels.len();
    let measured = || found.groups.iter().filter(|group| group.group.is_some());
    let values: Vec<Vec<Vec<f64>>> = measured()
        .map(|group| {
            let step = (group.typical.len() / p).div_ceil(N_CORNER_DRAWS).max(1);
            let column = |k: usize| {
                let coordinates = group.typical.iter().skip(k).step_by(p * step);
                coordinates.map(|x| found.scales[k].value(*x)).collect()
            };
            (0..p).map(column).collect()
        })
        .collect();
    let posteriors: Vec<Posterior> = measured()
        .zip(&values)
        .enumerate()
        .map(|(index, (group, columns))| Posterior {
            label: &group.name,
            colour: series(index),
            parameters: found
                .parameters
                .iter()
                .zip(&found.scales)
                .zip(labels.iter().zip(columns))
                .map(|((name, scale), (label, draws))| ParameterColumn {
                    name,
                    symbol: &label.symbol,
                    unit: &label.unit,
                    draws,
                    support: support(*scale),
                    prior: None,
                    reference: None,
                })
                .collect(),
        })
        .collect();
    corner(&posteriors, &CornerOptions { title: "Typical specimens of every group", ..CornerOptions::default() })
}

/// Interval of the parameter values for which a scale (logarithm or log-odds) is defined.
fn support(scale: SizeScale) -> Support {
    match scale {
        SizeScale::Logarithm => Support { lower: 0.0, upper: f64::INFINITY },
        SizeScale::LogOdds { lower, upper } => Support { lower, upper },
    }
}

/// Writes the draws of the population as a NetCDF file in ArviZ's layout, with named dimensions. The variables `typical` and `specimen_value` are
/// parameter values in SI units. Other variables refer to the logarithms of these values, or to log-odds for parameters with two bounds.
///
/// # Errors
/// [`Error::File`] if the file system refuses.
pub fn write_netcdf(path: &Path, found: &Comparison) -> Result<()> {
    let design = &found.design;
    let chains = &found.population.chains;
    let n_draws = chains.first().map_or(0, Vec::len);
    let names = |list: &mut dyn Iterator<Item = &str>| list.map(String::from).collect::<Vec<String>>();
    let parameters = || names(&mut found.parameters.iter().copied());
    let strata = (0..design.n_strata).map(|stratum| {
        let members = design.groups.iter().filter(|group| group.stratum == stratum);
        members.map(|group| group.name.as_str()).collect::<Vec<&str>>().join(" + ")
    });
    let dimensions = [
        Dimension { name: "group", labels: names(&mut design.groups.iter().map(|group| group.name.as_str())) },
        Dimension {
            name: "specimen",
            labels: names(&mut design.specimens.iter().map(|specimen| specimen.name.as_str())),
        },
        Dimension { name: "stratum", labels: strata.collect() },
        Dimension { name: "parameter", labels: parameters() },
        Dimension { name: "other_parameter", labels: parameters() },
    ];
    let all = |of: &dyn Fn(&PopulationDraw) -> &[f64]| -> Vec<f64> {
        found.population.draws().flat_map(|draw| of(draw).iter().copied()).collect()
    };
    let variable = |name, dimensions: &[&'static str], values| Variable {
        name,
        unit: "1",
        dimensions: dimensions.to_vec(),
        values,
    };
    let values = |of: &dyn Fn(&PopulationDraw) -> &[f64]| -> Vec<f64> {
        all(of).iter().zip(found.scales.iter().cycle()).map(|(x, scale)| scale.value(*x)).collect()
    };
    let mut variables = vec![
        variable("typical", &["group", "parameter"], values(&|draw| &draw.group_mean)),
        variable("specimen_value", &["specimen", "parameter"], values(&|draw| &draw.specimen_mean)),
        variable("log_typical", &["group", "parameter"], all(&|draw| &draw.group_mean)),
        variable("log_specimen", &["specimen", "parameter"], all(&|draw| &draw.specimen_mean)),
        variable(
            "covariance_between_specimens",
            &["stratum", "parameter", "other_parameter"],
            all(&|draw| &draw.between_specimens),
        ),
        variable("specimen_weight", &["specimen"], all(&|draw| &draw.specimen_weight)),
    ];
    if design.has_repeats() {
        variables.push(variable(
            "covariance_within_specimens",
            &["parameter", "other_parameter"],
            all(&|draw| &draw.within_specimens),
        ));
    }
    write_labelled_netcdf(path, chains.len(), n_draws, &dimensions, &variables)
}
