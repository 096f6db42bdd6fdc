//! Formats the diagnosis of a cohort as text: the effects that all its specimens lack.

use vitreo_uq::documents::cohort::{CohortDiagnosis, CohortEffect, NullSide, SizeDistribution};
use vitreo_uq::documents::diagnosis::{Status, VerdictKind};
use vitreo_uq::figures::labels::parameter_label;

use crate::text::significant;

/// Smallest gain (nats) of an effect that gets its own row.
const LEAST_LISTED_NATS: f64 = 0.05;

/// Text of a cohort's diagnosis.
pub fn words(diagnosis: &CohortDiagnosis) -> String {
    let mut lines = vec![
        format!("{} records: {}", diagnosis.specimens.len(), diagnosis.verdict.sentence),
        String::new(),
        format!(
            "  {:<26}{:>9}{:>10}{:>9}{:>8}   {:<34}{}",
            "effect", "gain", "held-out", "p", "share", "size", "status"
        ),
    ];
    let mut effects: Vec<&CohortEffect> = diagnosis.effects.iter().collect();
    effects.sort_by(|a, b| b.gain_nats.total_cmp(&a.gain_nats));
    let (listed, rest): (Vec<&CohortEffect>, Vec<&CohortEffect>) = effects
        .into_iter()
        .partition(|effect| effect.gain_nats > LEAST_LISTED_NATS || effect.status == Status::Claimed);
    lines.extend(listed.into_iter().map(row));
    let nothing: Vec<&str> = rest
        .iter()
        .filter(|cohort_effect| cohort_effect.refused.is_none())
        .map(|cohort_effect| cohort_effect.effect.as_str())
        .collect();
    if !nothing.is_empty() {
        lines.push(format!("  no gain from any common distribution of sizes: {}", nothing.join(", ")));
    }
    lines.push("  (gain: nats over all records, by the best common distribution of sizes; p: of the search)".into());
    lines.extend(groups(diagnosis));
    if let Some(extended) = diagnosis.extended
        && let (Some(before), Some(after)) = (diagnosis.base.rmse_heldout_um, extended.rmse_heldout_um)
    {
        lines.push(format!(
            "Error on the last held-out cycles of all records: {} µm; with the effect that the cohort predicts: {} µm.",
            significant(before),
            significant(after)
        ));
    }
    lines.extend(diagnosis.remarks.iter().map(|remark| format!("Note: {remark}.")));
    if diagnosis.verdict.kind == VerdictKind::Missing {
        let effects = diagnosis.verdict.effects.join(",");
        lines.push(String::new());
        lines.push(format!("Add it to every record with `vitreo-uq extend DIR… --with {effects}`."));
    }
    lines.join("\n") + "\n"
}

fn row(effect: &CohortEffect) -> String {
    let heldout = effect.heldout_gain_nats.map_or("–".into(), |gain| format!("{gain:.1}"));
    let share = effect.law.as_ref().map_or("–".into(), |law| format!("{:.0} %", 100.0 * law.share));
    let size = match (&effect.law, &effect.parameter) {
        (Some(law), Some(parameter)) => size(law, parameter),
        _ => "–".into(),
    };
    let standing = match (effect.status, &effect.refused) {
        (_, Some(reason)) => format!("not applicable: {reason}"),
        (Status::Claimed, _) => "CLAIMED".into(),
        (Status::Equivalent, _) => "equivalent".into(),
        (Status::Suggestive, _) => "suggestive".into(),
        _ => String::new(),
    };
    format!(
        "  {:<26}{:>9.1}{heldout:>10}{:>9.4}{share:>8}   {size:<34}{standing}",
        effect.effect, effect.gain_nats, effect.p_familywise
    )
    .trim_end()
    .to_string()
}

fn size(law: &SizeDistribution, parameter: &str) -> String {
    let label = parameter_label(parameter);
    let symbol = label.symbol.rsplit(' ').next().unwrap_or_default().to_string();
    let sign = match law.sides {
        NullSide::Above => "",
        NullSide::Below => "−",
        NullSide::Either => "±",
    };
    let unit = if label.unit == "–" { String::new() } else { format!(" {}", label.unit) };
    format!("{symbol} {sign}{}{unit} ×/÷ {:.1}", significant(law.median), law.between_specimen_log_sd.exp())
}

/// Lines of text: sizes of an effect in each group, contrasts between groups, and the law's parameters without and with the effect.
fn groups(diagnosis: &CohortDiagnosis) -> Vec<String> {
    let mut lines = Vec::new();
    if diagnosis.groups.is_empty() {
        return lines;
    }
    lines.push(String::new());
    for group in &diagnosis.groups {
        let [median, q05, q95] = [group.median, group.q05, group.q95].map(significant);
        let percent = |share: f64| format!("{:.0}", 100.0 * share);
        lines.push(format!(
            "  {} ({} records): {} {median} ({q05} to {q95}), in {} % ({} to {}) of the records",
            group.name,
            group.records,
            parameter_label(&group.parameter).axis(),
            percent(group.share),
            percent(group.share_q05),
            percent(group.share_q95)
        ));
    }
    lines.extend(diagnosis.contrasts.iter().map(|contrast| {
        let mark = if contrast.is_declared { "*" } else { " " };
        format!("{mark} {}.", contrast.sentence)
    }));
    for law in &diagnosis.law {
        lines.push(format!(
            "  {}: {} {} without the effect, {} with it",
            law.group,
            parameter_label(&law.parameter).axis(),
            significant(law.before),
            significant(law.after)
        ));
    }
    lines
}
