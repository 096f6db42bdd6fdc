//! `fit`: computes the best point estimate of the parameters, as in the paper, with standard errors.

use std::process::ExitCode;

use vitreo_uq::base::error::Result;
use vitreo_uq::base::parameter::NOISE_SD;
use vitreo_uq::documents::fit::{FitSummary, FittedParameter};
use vitreo_uq::figures::labels::{model_title, parameter_label};
use vitreo_uq::jobs::fit;

use crate::options::ModelArguments;
use crate::session::Session;
use crate::text::{column_width, significant, warning_text};

pub fn run(arguments: &ModelArguments) -> Result<ExitCode> {
    let session = Session::begin(&arguments.common)?;
    let target = session.open(&arguments.model, &[], &[])?;
    let outcome = fit::run(&target, arguments.common.output.seed, &session.terminal)?;
    session.show(&outcome.document, &words(&outcome.document.body))?;
    session.say(&format!("Result: {}", outcome.written.display()));
    Ok(ExitCode::from(u8::from(!outcome.is_sound)))
}

fn words(summary: &FitSummary) -> String {
    let names = summary.parameters.iter().map(|p| p.name.as_str()).chain(summary.fixed.keys().map(String::as_str));
    let width = column_width(names);
    let verdict = if summary.converged { "converged" } else { "NOT CONVERGED" };
    let mut lines = vec![
        format!(
            "{}: {} model, nonlinear least squares on {} positions: {verdict} in {} steps",
            summary.experiment,
            model_title(&summary.model),
            summary.fitted_positions,
            summary.iterations
        ),
        summary.trust.to_string(),
        String::new(),
        format!("  {:<width$}{:>11}{:>18}", "parameter", "estimate", "standard error"),
    ];
    lines.extend(summary.parameters.iter().map(|parameter| row(parameter, width)));
    let fixed = summary.fixed.iter().filter(|(name, _)| name.as_str() != NOISE_SD.name);
    lines.extend(
        fixed.map(|(name, value)| format!("  {:<width$}{:>11}{:>18}", axis(name), significant(*value), "held fixed")),
    );
    let noise = summary.noise_um.map_or("unknown".into(), |noise| format!("{} µm", significant(noise)));
    lines.push(String::new());
    lines.push(format!("Residuals: {} µm root mean square (noise {noise}).", significant(summary.rmse_um)));
    if let Some(rmse_um) = summary.rmse_heldout_um {
        lines.push(format!("Held-out cycles: {} µm root mean square.", significant(rmse_um)));
    }
    lines.push(format!(
        "Starts: {} of {} lead to this minimum; no other minimum is lower.",
        summary.starts_agreeing, summary.starts
    ));
    if let Some(distance) = summary.surrogate_vs_fe_max_um {
        lines.push(format!(
            "At the estimate the surrogate differs from {} by at most {} µm.",
            summary.model.full_model(),
            significant(distance)
        ));
    }
    for warning in &summary.warnings {
        lines.push(String::new());
        lines.push(warning_text(warning));
    }
    lines.join("\n") + "\n"
}

fn axis(name: &str) -> String {
    parameter_label(name).axis()
}

fn row(parameter: &FittedParameter, width: usize) -> String {
    let error = parameter.standard_error.map_or("–".into(), significant);
    format!("  {:<width$}{:>11}{:>18}", axis(&parameter.name), significant(parameter.value), error)
}
