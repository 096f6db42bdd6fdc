//! Figures of a comparison, as SVG and PNG.

use std::collections::HashMap;
use std::path::Path;

use super::{ComparisonResult, SIGNIFICANT};
use crate::Subject;
use base::error::Result;
use documents::comparison::TestEntry;
use figures::comparison::{ComparisonData, comparison};
use figures::comparison_bars::{BarPanel, bias_sheet};
use figures::comparison_map::{FailureMapData, FailureMapRow, failure_map};
use figures::svg::{Svg, write_figure};
use posterior::sample::noise_origin_text;

/// Writes `comparison`, `comparison_map` and `comparison_bias` as SVG and PNG into a directory.
///
/// # Errors
/// Errors of [`write_figure`].
pub fn write(dir: &Path, outcome: &ComparisonResult) -> Result<()> {
    let subject = &outcome.subject;
    let name = &outcome.comparison.experiment;
    let write = |stem: &str, svg: Svg| write_figure(dir, stem, &svg.translated(subject.experiment().quantities()));
    write("comparison", comparison_figure(subject, outcome, name)?)?;
    let rows = map_rows(subject, outcome);
    let shortest_s = outcome.time_since_step_s.iter().flatten().fold(f64::INFINITY, |least, lag| least.min(*lag));
    if !rows.is_empty() {
        let heading = format!("{name}: where the model fails");
        let data = FailureMapData {
            title: &heading,
            lag_ends_s: &outcome.lag_ends_s,
            shortest_s: 0.6 * shortest_s,
            rows: &rows,
        };
        write("comparison_map", failure_map(&data))?;
    }
    let is_echo = |entry: &TestEntry| {
        outcome.comparison.findings.iter().any(|finding| finding.place == entry.place && finding.echo_of.is_some())
    };
    let panels: Vec<BarPanel> =
        outcome.comparison.panels.iter().map(|entry| bar_panel(entry, is_echo(entry))).collect();
    let heading = format!(
        "{name}: bias of the measurement against the model (bars: ± 2 standard errors; shaded: findings, faint: explained findings)"
    );
    write("comparison_bias", bias_sheet(&heading, &panels))
}

fn comparison_figure(subject: &Subject, outcome: &ComparisonResult, name: &str) -> Result<Svg> {
    let experiment = subject.experiment();
    let record = &experiment.record;
    let um = |values: &[f64]| values.iter().map(|x| 1e6 * x).collect::<Vec<f64>>();
    let (model_um, spread_um) = (um(&outcome.fitted.position_m), um(&outcome.position_sd_m));
    let sd_um: Vec<f64> = model_um
        .iter()
        .zip(&spread_um)
        .map(|(x, spread)| {
            let of_noise = subject.noise().sds_um(&outcome.fitted.noise, *x);
            of_noise.iter().fold(spread.powi(2), |sum, sd| sum + sd.powi(2)).sqrt()
        })
        .collect();
    let observed = subject.observed_m().into_iter().map(|observed_m| observed_m.map(|y| 1e6 * y));
    let position_um: Vec<Option<f64>> = observed.collect();
    let rows = &outcome.comparison.outlier_rows;
    let outliers = rows.iter().filter_map(|row| Some((record.time_s[*row], 1e6 * record.position_m[*row]?))).collect();
    let step_s: Vec<f64> = record.force_step_rows().into_iter().map(|row| record.time_s[row]).collect();
    let mut scored = (0..record.n_rows()).filter(|row| subject.scored_m[*row].is_some());
    let heldout_s =
        scored.next().map(|first| [record.time_s[first], record.time_s[scored.next_back().unwrap_or(first)]]);
    let effects = &outcome.comparison.effects;
    let with = if effects.is_empty() { "base law".into() } else { format!("with {}", effects.join(", ")) };
    comparison(&ComparisonData {
        title: &format!("{name}: measurement against model ({with})"),
        time_s: &record.time_s,
        position_um: &position_um,
        model_um: &model_um,
        sd_um: &sd_um,
        whitened: &outcome.whitened,
        outliers,
        step_s: &step_s,
        heldout_s,
        noise: experiment
            .reference_noise()
            .map(|reference_noise| (1e6 * reference_noise.sd_m, noise_origin_text(reference_noise.origin))),
    })
}

/// Number of force steps above which a row of the failure map pools the steps of neighbouring cycles that have one direction.
const MOST_MAP_ROWS: usize = 96;

/// Force steps that one row of the map shows.
struct StepGroup {
    label: String,
    is_heldout: bool,
    sign: f64,
    /// First and last row of the record in the time after each step.
    rows: Vec<[usize; 2]>,
}

/// Returns one group per force step. If the steps are too many, each group has the steps of successive cycles in one direction.
fn step_groups(subject: &Subject) -> Vec<StepGroup> {
    let record = &subject.experiment().record;
    let steps = record.force_step_rows();
    let n_together = (2 * record.n_cycles() as usize).div_ceil(MOST_MAP_ROWS).max(1) as u32;
    let is_pooled = steps.len() > MOST_MAP_ROWS;
    let mut groups: Vec<StepGroup> = Vec::new();
    let mut known: HashMap<(u32, bool, bool), usize> = HashMap::new();
    for (place, &at) in steps.iter().enumerate() {
        let before = if at == 0 { 0.0 } else { record.force_n[at - 1] };
        let sign = (record.force_n[at] - before).signum();
        let end = steps.get(place + 1).map_or(record.n_rows() - 1, |next| *next);
        let cycle = record.cycle[at];
        let is_heldout = subject.experiment().heldout_cycles.contains(&cycle);
        let direction = if sign > 0.0 { "+" } else { "−" };
        let bin = cycle.saturating_sub(1) / n_together;
        let key = (bin, is_heldout, sign > 0.0);
        if let Some(group) = known.get(&key).filter(|_| is_pooled).and_then(|group| groups.get_mut(*group)) {
            group.rows.push([at + 1, end]);
            continue;
        }
        // Time rounded to 0.1 ms and written without trailing zeros.
        let at_s = (1e4 * record.time_s[at]).round() / 1e4;
        let label = match (is_pooled, n_together) {
            (false, _) => format!("cycle {cycle}: {direction} step at {at_s} s"),
            (true, 1) => format!("cycle {cycle}: {direction} steps"),
            (true, _) => format!("cycles {} to {}: {direction} steps", bin * n_together + 1, (bin + 1) * n_together),
        };
        known.insert(key, groups.len());
        groups.push(StepGroup { label, is_heldout, sign, rows: vec![[at + 1, end]] });
    }
    groups
}

/// Rows of the failure map: whitened residuals times the sign of the force step, averaged by step and by time since the step. Each cell also has the residual in µm.
fn map_rows(subject: &Subject, outcome: &ComparisonResult) -> Vec<FailureMapRow> {
    let mut rows: Vec<FailureMapRow> = Vec::new();
    for group in step_groups(subject) {
        let mut cells = vec![(0.0, 0.0, 0_usize); outcome.lag_ends_s.len()];
        for row in group.rows.iter().flat_map(|[first, last]| *first..=*last) {
            let (Some(white), Some(lag_s)) = (outcome.whitened[row], outcome.time_since_step_s[row]) else { continue };
            let Some(y) = subject.fitted_m[row].or(subject.scored_m[row]) else { continue };
            let bin = outcome.lag_ends_s.partition_point(|end| *end < lag_s);
            if let Some(cell) = cells.get_mut(bin) {
                let residual_um = 1e6 * (y - outcome.fitted.position_m[row]);
                *cell = (cell.0 + group.sign * white, cell.1 + group.sign * residual_um, cell.2 + 1);
            }
        }
        if cells.iter().all(|cell| cell.2 == 0) {
            continue;
        }
        let of_cell = |(white, residual_um, n): &(f64, f64, usize)| {
            let count = *n as f64;
            (*n > 0).then(|| (white / count.sqrt(), residual_um / count))
        };
        let cells = cells.iter().map(of_cell).collect();
        rows.push(FailureMapRow { label: group.label, is_heldout: group.is_heldout, cells });
    }
    rows
}

fn bar_panel(entry: &TestEntry, is_echo: bool) -> BarPanel {
    let p = if entry.p_familywise < 0.01 {
        format!("{:.3}", entry.p_familywise)
    } else {
        format!("{:.2}", entry.p_familywise)
    };
    let y_label = match entry.place.as_str() {
        "runs" => "score",
        "autocorrelation" => "correlation",
        _ if entry.is_along_force => "bias along it (µm)",
        _ => "bias (µm)",
    };
    BarPanel {
        title: match is_echo {
            true => format!("{}: p = {p} (explained)", entry.place.replace('_', " ")),
            false => format!("{}: p = {p}", entry.place.replace('_', " ")),
        },
        is_explained: is_echo,
        x_label: entry.title.clone(),
        y_label: y_label.into(),
        is_significant: entry.p_familywise < SIGNIFICANT,
        bars: entry.bars.iter().map(|bar| (bar.label.clone(), bar.bias_um, bar.sd_um)).collect(),
    }
}
