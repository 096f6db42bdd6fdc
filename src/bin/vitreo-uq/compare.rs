//! `compare`: tests the residuals of a model for misfits.

use std::process::ExitCode;

use vitreo_uq::base::error::Result;
use vitreo_uq::criticism::compare::SIGNIFICANT;
use vitreo_uq::documents::comparison::{Comparison, Finding, TestEntry};
use vitreo_uq::jobs::compare::{self, CompareRequest};

use crate::options::{self, CompareArguments};
use crate::session::{RESULTS, Session};
use crate::text::{outliers_left_out, significant};

/// Smallest number of simulated records. With fewer, a probability of 5 % over all tests cannot be resolved.
const FEWEST_SIMULATIONS: usize = 39;

pub fn run(arguments: &CompareArguments) -> Result<ExitCode> {
    if let Some(names) = &arguments.laws {
        return crate::laws::run(arguments, names);
    }
    let session = Session::begin(&arguments.common)?;
    if let Some(simulations) = arguments.simulations {
        options::check_simulations(simulations, FEWEST_SIMULATIONS)?;
    }
    let target = session.open(&arguments.model, &[], &[])?;
    let request = CompareRequest { simulations: arguments.simulations, sampler: session.default_sampler() };
    let outcome = compare::run(&target, &request, &session.terminal)?;
    session.end(&outcome, &words(&outcome.document.body, &outcome.name()), RESULTS, &arguments.page)
}

/// Maximum number of findings that are printed in full. The JSON document contains all of them.
const MAX_PRINTED_FINDINGS: usize = 5;

fn words(comparison: &Comparison, revision: &str) -> String {
    let effects = if comparison.effects.is_empty() {
        "base law".into()
    } else {
        format!("with {}", comparison.effects.join(", "))
    };
    let mut lines = vec![format!("{}: {revision} ({effects})", comparison.experiment), comparison.sentence.clone()];
    if !comparison.findings.is_empty() {
        lines.push(String::new());
    }
    let (sources, echoes): (Vec<&Finding>, Vec<&Finding>) =
        comparison.findings.iter().partition(|finding| finding.echo_of.is_none());
    for finding in sources.iter().take(MAX_PRINTED_FINDINGS) {
        lines.push(format!("* {}: {}", finding.place.replace('_', " "), finding.sentence));
    }
    lines.extend(also("Also found", sources.iter().skip(MAX_PRINTED_FINDINGS)));
    lines.extend(also("Explained by these findings", echoes.iter()));
    lines.extend(outliers_left_out(comparison.outlier_rows.len()));
    lines.push(String::new());
    lines.push(format!("  {:<20}{:>14}{:>12}{:>16}", "test", "gain (nats)", "p", "p of all tests"));
    lines.extend(comparison.panels.iter().map(row));
    for left in &comparison.left_out {
        lines.push(format!("  {:<20}not tested: {}", left.place.replace('_', " "), left.reason));
    }
    if comparison.heldout_cycles.is_empty() {
        lines.push(String::new());
        lines.push("No cycle is held out, so findings are only suggestive.".into());
    }
    lines.push(String::new());
    lines.push(if comparison.findings.is_empty() {
        "See figures/comparison.png, comparison_map.png and comparison_bias.png.".into()
    } else {
        "See figures/comparison_map.png for the place of the misfit; `vitreo-uq diagnose` names the missing effect."
            .to_string()
    });
    lines.join("\n") + "\n"
}

/// Line with the names of findings that are not printed in full; `None` if there are none. `words` is the beginning of the line.
fn also<'a>(words: &str, findings: impl Iterator<Item = &'a &'a Finding>) -> Option<String> {
    let names: Vec<String> = findings.map(|finding| finding.place.replace('_', " ")).collect();
    (!names.is_empty()).then(|| format!("  {words}: {}.", names.join(", ")))
}

fn row(entry: &TestEntry) -> String {
    let mark = if entry.p_familywise < SIGNIFICANT { " *" } else { "" };
    let p = if entry.p < 1e-4 { "< 0.0001".into() } else { format!("{:.4}", entry.p) };
    let name = entry.place.replace('_', " ");
    format!("  {name:<20}{:>14}{p:>12}{:>16.3}{mark}", significant(entry.gain_nats), entry.p_familywise)
}
