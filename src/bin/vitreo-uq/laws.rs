//! `compare --laws`: prints a comparison of base laws.

use std::process::ExitCode;

use vitreo_uq::base::error::Result;
use vitreo_uq::documents::laws::{LawComparison, LawRow, LawStatus};
use vitreo_uq::documents::oscillation::Frequencies;
use vitreo_uq::figures::labels::parameter_label;
use vitreo_uq::figures::number::format_ranges;
use vitreo_uq::jobs::laws::{self, LawsRequest};
use vitreo_uq::jobs::target::TargetKind;

use crate::options::CompareArguments;
use crate::session::Session;
use crate::text::significant;

pub fn run(arguments: &CompareArguments, names: &[String]) -> Result<ExitCode> {
    let session = Session::begin(&arguments.common)?;
    let target = session.open(&arguments.model, &[], &[TargetKind::Oscillation])?;
    let laws = names.iter().filter(|name| !name.is_empty()).cloned().collect();
    let outcome = laws::run(&target, &LawsRequest { laws, seed: arguments.common.output.seed }, &session.terminal)?;
    session.end(&outcome, &words(&outcome.document.body), "Figure", &arguments.page)
}

fn words(comparison: &LawComparison) -> String {
    let rows = match (&comparison.frequencies, comparison.heldout_cycles.as_slice()) {
        (Some(Frequencies { fitted, heldout: 0, .. }), _) => format!("{fitted} frequencies, none is held out"),
        (Some(Frequencies { fitted, heldout, .. }), _) => format!("{fitted} frequencies, scored on {heldout} others"),
        (None, []) => format!("cycles {}, no cycle is held out", format_ranges(&comparison.fitted_cycles)),
        (None, cycles) => {
            format!("cycles {}, scored on cycle {}", format_ranges(&comparison.fitted_cycles), format_ranges(cycles))
        }
    };
    let of_error = |rows: &str| format!("{rows} ({})", comparison.error_unit());
    let mut lines = vec![
        format!("{}: laws fitted to {rows}", comparison.experiment),
        comparison.sentence.clone(),
        String::new(),
        format!("  {:<26}{:>12}{:>14}{:>16}   status", "law", "nats", of_error("fitted"), of_error("held out")),
    ];
    lines.extend(comparison.laws.iter().map(row));
    for law in
        comparison.laws.iter().filter(|law| matches!(law.status, LawStatus::Likeliest | LawStatus::Indistinguishable))
    {
        lines.push(String::new());
        lines.push(format!("{} (mean and 90 % interval)", law.law));
        lines.extend(law.parameters.iter().map(|parameter| {
            let label = parameter_label(&parameter.name).axis();
            let [mean, q05, q95] = [parameter.mean, parameter.q05, parameter.q95].map(significant);
            format!("  {label:<40}{mean:>12}   {q05} to {q95}")
        }));
    }
    lines.push(String::new());
    if comparison.laws.iter().any(|law| law.evidence_difference_nats.is_some()) {
        lines.push("(nats: log evidence minus that of the likeliest law; all laws have the same wide priors and the same noise terms)".into());
    }
    if let Some(best) = comparison.laws.first().filter(|law| law.status != LawStatus::NotCompared) {
        let command = if best.status == LawStatus::Closest { "diagnose" } else { "sample" };
        lines.push(format!("Next: vitreo-uq {command} EXPERIMENT --base {} --prior generic --out STUDY", best.law));
    }
    lines.join("\n") + "\n"
}

fn row(law: &LawRow) -> String {
    let number = |value: Option<f64>| value.map_or("–".into(), significant);
    // An error below one nat decides nothing.
    let error = law
        .evidence_standard_error_nats
        .filter(|error| *error >= 1.0)
        .map_or(String::new(), |error| format!(" ± {error:.0}"));
    let difference = law.evidence_difference_nats.map_or("–".into(), |nats| format!("{:.1}{error}", nats + 0.0));
    let status = match &law.reason {
        Some(reason) => format!("{}: {reason}", law.status.text()),
        None => law.status.text().into(),
    };
    let [fitted, held_out] = law.errors().map(number);
    format!("  {:<26}{difference:>12}{fitted:>14}{held_out:>16}   {status}", law.law)
}
