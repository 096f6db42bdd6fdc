//! `effects`: lists the effects of the library, and how well an experiment can detect each.

use std::process::ExitCode;

use vitreo_uq::base::error::Result;
use vitreo_uq::documents::effects::{EffectEntry, EffectsSummary, ParameterEntry};
use vitreo_uq::figures::labels::model_title;
use vitreo_uq::jobs::artefacts;
use vitreo_uq::jobs::first_revision::kept_surrogate;
use vitreo_uq::jobs::visibility;
use vitreo_uq::models::effects::Library;
use vitreo_uq::posterior::study::WithProvenance;

use crate::options::ModelArguments;
use crate::session::Session;
use crate::text::significant;

pub fn run(arguments: &ModelArguments) -> Result<ExitCode> {
    let session = Session::begin(&arguments.common)?;
    let target = session.open(&arguments.model, &[], &[])?;
    let target = target.creep()?;
    let problem = target.problem(&session.terminal)?;
    let kept = target.existing_study().and_then(|study| kept_surrogate(study, &session.terminal));
    let summary = visibility::run(&problem, &Library::default(), kept, &session.terminal)?;
    let provenance = artefacts::with_inputs(target.provenance("effects", arguments.common.output.seed)?, &problem);
    session.show(&WithProvenance { provenance, body: &summary }, &words(&summary))?;
    Ok(ExitCode::SUCCESS)
}

fn words(summary: &EffectsSummary) -> String {
    let mut lines = vec![
        format!("{}: detectability of effects added to the {} model", summary.experiment, model_title(&summary.model)),
        format!(
            "(visible: share of an effect's signature that model and noise cannot absorb; standard error: for a noise of {} µm)",
            significant(summary.noise_um)
        ),
        String::new(),
    ];
    lines.push(format!("  {:<26}{:<13}{:>9}   {}", "effect", "stage", "visible", "standard error"));
    lines.extend(summary.effects.iter().map(overview));
    for effect in &summary.effects {
        lines.push(String::new());
        lines.push(format!("{}: {}", effect.slug, effect.summary));
        lines.push(format!("  {}", effect.equation));
        lines.extend(effect.parameters.iter().map(parameter));
        if !effect.twins.is_empty() {
            lines.push(format!("  nearly the same signature in this experiment: {}", effect.twins.join(", ")));
        }
        lines.extend(effect.refused.iter().map(|reason| format!("  not applicable: {reason}")));
    }
    lines.push(String::new());
    lines.push("Add one with `vitreo-uq extend --with EFFECT`.".into());
    lines.join("\n") + "\n"
}

fn overview(effect: &EffectEntry) -> String {
    let visible = match effect.visible_fraction {
        Some(fraction) if fraction >= 0.001 => format!("{:.1} %", 100.0 * fraction),
        Some(_) => "< 0.1 %".into(),
        None => "–".into(),
    };
    let error = match (effect.standard_error, effect.parameters.first()) {
        _ if effect.visible_fraction.is_some_and(|fraction| fraction < 0.001) => "not detectable".into(),
        (Some(error), Some(first)) => {
            format!("{} {} {}", first.symbol, plus_minus(error), unit(&first.unit)).trim_end().to_string()
        }
        _ => "–".into(),
    };
    format!("  {:<26}{:<13}{visible:>9}   {error}", effect.slug, effect.stage)
}

fn plus_minus(error: f64) -> String {
    format!("± {}", significant(error))
}

fn unit(unit: &str) -> &str {
    if unit == "1" { "" } else { unit }
}

fn parameter(parameter: &ParameterEntry) -> String {
    let [lower, upper] = parameter.support;
    let end = |end: Option<f64>, infinite: &str| end.map_or(infinite.to_string(), |end| end.to_string());
    let null = parameter.null.map_or("none (unidentified without the effect)".into(), |null| null.to_string());
    let unit = if parameter.unit == "1" { "no unit".into() } else { format!("in {}", parameter.unit) };
    format!(
        "  {} ({}), {unit}, between {} and {}, null {null}; prior {}",
        parameter.name,
        parameter.symbol,
        end(lower, "−∞"),
        end(upper, "∞"),
        parameter.prior
    )
}
