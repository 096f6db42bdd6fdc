//! Formats results as text and tables.

use vitreo_uq::documents::check::CheckSummary;
use vitreo_uq::documents::posterior::{ParameterSummary, PosteriorSummary, Warning};
use vitreo_uq::figures::labels::model_title;
use vitreo_uq::figures::labels::parameter_label;
use vitreo_uq::figures::number::format_ranges;

/// Text that `sample` prints: a summary of the posterior.
pub fn posterior(summary: &PosteriorSummary) -> String {
    let mut text = String::new();
    let mut line = |words: String| {
        text += &words;
        text.push('\n');
    };
    let sampler = &summary.sampler;
    let verdict = if summary.converged { "converged" } else { "NOT CONVERGED" };
    line(format!(
        "{}: {} model, {} ensembles of {} walkers, {} steps: {verdict}",
        summary.experiment,
        model_title(&summary.model),
        sampler.ensembles,
        sampler.walkers,
        sampler.steps
    ));
    line(summary.trust.to_string());
    line(String::new());
    parameter_table(&summary.parameters).lines().for_each(|row| line(row.into()));
    line(String::new());
    surrogate_lines(summary, &mut line);
    heldout_lines(summary, &mut line);
    budget_lines(summary, &mut line);
    for warning in &summary.warnings {
        line(String::new());
        line(warning_text(warning));
    }
    text
}

/// Width in characters of a table column that fits these names of parameters.
pub fn column_width<'a>(names: impl Iterator<Item = &'a str>) -> usize {
    names.map(|name| parameter_label(name).axis().chars().count() + 2).max().unwrap_or(0).max(12)
}

/// Table of parameters and their posteriors, one line per parameter.
pub fn parameter_table(parameters: &[ParameterSummary]) -> String {
    let names: Vec<String> = parameters.iter().map(|p| parameter_label(&p.name).axis()).collect();
    let width = column_width(parameters.iter().map(|p| p.name.as_str()));
    let mut rows =
        vec![format!("  {:<width$}{:>11}{:>11}{:>11}{:>9}{:>8}", "parameter", "median", "5 %", "95 %", "ESS", "R̂")];
    rows.extend(parameters.iter().zip(names).map(|(p, name)| {
        let [median, q05, q95] = [p.median, p.q05, p.q95].map(significant);
        let ess = p.ess_bulk.min(p.ess_tail);
        format!("  {name:<width$}{median:>11}{q05:>11}{q95:>11}{ess:>9.0}{:>7.3}", p.rhat)
    }));
    rows.join("\n")
}

fn surrogate_lines(summary: &PosteriorSummary, line: &mut impl FnMut(String)) {
    let surrogate = &summary.surrogate;
    if let (Some(modes), Some(error), Some(unknowns), Some(runs)) =
        (surrogate.modes, surrogate.max_relative_error, surrogate.fe_unknowns, surrogate.snapshot_runs)
    {
        let why = if modes == 1 { " (exact for this model: space and time separate)" } else { "" };
        let plural = if modes == 1 { "mode" } else { "modes" };
        let rest = surrogate
            .singular_values
            .as_ref()
            .and_then(|values| values.get(modes))
            .map_or(String::new(), |s| format!(", next singular value {s:.0e} times the first"));
        line(format!("Surrogate: {modes} {plural}{why} from {runs} runs of {unknowns} unknowns{rest};"));
        line(format!("  error {error:.0e} times the amplitude, at parameters outside the training set."));
    }
}

fn heldout_lines(summary: &PosteriorSummary, line: &mut impl FnMut(String)) {
    let heldout = &summary.heldout;
    let noise =
        heldout.noise_um.map_or("unknown".into(), |n| format!("{} µm, {}", significant(n), heldout.noise_origin));
    line(format!("Fitted cycles: error {} µm (noise {noise}).", significant(heldout.rmse_fitted_um)));
    if let (Some(rmse), Some(coverage_50), Some(coverage_90), Some(p)) =
        (heldout.rmse_um, heldout.coverage_50, heldout.coverage_90, heldout.joint_p)
    {
        let by = if let Some(runs) = heldout.fe_runs {
            summary.model.full_runs(runs)
        } else {
            "the creep law (this instrument needs no finite elements)".into()
        };
        line(format!(
            "Held-out cycles {}, predicted by {by}: held-out error {} µm.",
            format_ranges(&heldout.cycles),
            significant(rmse)
        ));
        let expected = |range: Option<[f64; 2]>| {
            range.map_or(String::new(), |[a, b]| format!(" (for a right model: {:.0}–{:.0} %)", 100.0 * a, 100.0 * b))
        };
        line(format!(
            "  In the 50 % band: {:.0} %{}; in the 90 % band: {:.0} %{}; probability of a misfit this large by chance: {}.",
            100.0 * coverage_50,
            expected(heldout.coverage_50_expected),
            100.0 * coverage_90,
            expected(heldout.coverage_90_expected),
            if p < 0.001 { "< 0.001".into() } else { format!("at most {p:.2}") }
        ));
    }
}

fn budget_lines(summary: &PosteriorSummary, line: &mut impl FnMut(String)) {
    let budget = &summary.error_budget_um;
    let part = |name: &str, value: Option<f64>| value.map(|v| format!("{name} {}", significant(v)));
    let parts = [
        part("learnt noise", Some(budget.noise)),
        part("mesh", budget.fe_discretisation),
        part("surrogate", budget.surrogate),
        part("Monte Carlo", Some(budget.monte_carlo)),
    ];
    line(format!("Error budget (µm): {}.", parts.into_iter().flatten().collect::<Vec<_>>().join(", ")));
}

pub fn warning_text(warning: &Warning) -> String {
    let mark = if warning.kind.is_fatal() { "NOT TO BE TRUSTED" } else { "Note" };
    format!("{mark}: {}.\n  What to do: {}.", warning.text, warning.advice)
}

/// Formats a value with four significant digits. A very small or large value has three digits and an exponent.
pub fn significant(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let magnitude = value.abs().log10().floor() as i32;
    match magnitude {
        -3..=5 => format!("{value:.*}", (3 - magnitude).max(0) as usize),
        _ => format!("{value:.2e}"),
    }
}

/// Sentence on the number `n` of positions that were excluded as outliers; `None` if `n` is 0.
pub fn outliers_left_out(n: usize) -> Option<String> {
    match n {
        0 => None,
        1 => Some("One position was left out as an outlier.".into()),
        n => Some(format!("{n} positions were left out as outliers.")),
    }
}

/// How a record was read, and its contradictions.
pub fn check_text(summary: &CheckSummary) -> String {
    let mut lines = summary.understood.sentences.clone();
    lines.push(String::new());
    if summary.contradictions.is_empty() {
        lines.push("The record agrees with its description.".into());
    }
    for contradiction in &summary.contradictions {
        let sure = if contradiction.certain { "WRONG" } else { "may be wrong" };
        lines.push(format!("{sure}: {}", contradiction.text));
        lines.push(format!("  what to do: {}", contradiction.advice));
    }
    lines.join("\n") + "\n"
}
