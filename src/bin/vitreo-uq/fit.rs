//! `fit`: the paper's point estimate, with standard errors.

use std::process::ExitCode;
use vitreo_uq::figures::labels::model_title;

use vitreo_uq::base::error::Result;
use vitreo_uq::base::files::write_json_atomically;
use vitreo_uq::base::parameter::NOISE_SD;
use vitreo_uq::documents::fit::{FitSummary, FittedParameter};
use vitreo_uq::figures::labels::of_parameter;
use vitreo_uq::jobs::artefacts;
use vitreo_uq::posterior::fit;
use vitreo_uq::posterior::study::{FIT_NAME, WithProvenance};

use crate::options::{self, FitArguments};
use crate::target::Target;
use crate::terminal::Terminal;
use crate::text::{column_width, significant, warning_text};
use vitreo_uq::jobs::first_revision::kept_surrogate;

pub fn run(arguments: &FitArguments) -> Result<ExitCode> {
    let common = &arguments.common;
    options::use_threads(common.threads)?;
    crate::output::check(common.json.as_deref())?;
    let terminal = Terminal::new(common.quiet);
    let target = Target::open(common, &arguments.model, &terminal)?;
    target.check(&terminal)?;
    let problem = target.problem(&arguments.model, &terminal)?;
    let kept = target.existing_study().and_then(|study| kept_surrogate(study, &terminal));
    let result = fit::run(&problem, kept, &terminal)?;
    let study = target.make_study()?;
    let provenance = artefacts::with_inputs(study.provenance("fit", 1, common.seed), &problem);
    let document = WithProvenance { provenance, body: &result.summary };
    let path = study.dir().join(FIT_NAME);
    write_json_atomically(&path, &document)?;
    terminal.finish();
    crate::output::show(common.json.as_deref(), &document, &words(&result.summary))?;
    if !common.quiet {
        crate::interrupt::say(&format!("Result: {}", path.display()));
    }
    Ok(ExitCode::from(u8::from(!result.summary.is_sound())))
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
        lines.push(format!("Held-out cycles, which no fit has seen: {} µm.", significant(rmse_um)));
    }
    lines.push(format!(
        "Starts: {} of {} lead to this minimum, no other is lower.",
        summary.starts_agreeing, summary.starts
    ));
    if let Some(distance) = summary.surrogate_vs_fe_max_um {
        lines.push(format!(
            "At the estimate the reduced model differs from {} by {} µm at most.",
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
    of_parameter(name).axis()
}

fn row(parameter: &FittedParameter, width: usize) -> String {
    let error = parameter.standard_error.map_or("–".into(), significant);
    format!("  {:<width$}{:>11}{:>18}", axis(&parameter.name), significant(parameter.value), error)
}
