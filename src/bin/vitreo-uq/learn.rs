//! `learn`: learns a correction of the constitutive law from data.

use std::path::Path;
use std::process::ExitCode;

use vitreo_uq::base::error::Result;
use vitreo_uq::documents::errors::ModelErrors;
use vitreo_uq::documents::learned::{Learned, LearnedKind, LearnedPair, LearnedVerdict};
use vitreo_uq::documents::learned_cohort::{CohortPair, ConfirmedOn, LearnedCohort, LearnedCohortKind};
use vitreo_uq::figures::number::format_ranges;
use vitreo_uq::jobs::learn::{self, LearnDocument, LearnRequest};
use vitreo_uq::jobs::target::TargetKind;

use crate::options::{self, LearnArguments};
use crate::session::{RESULTS, Session};
use crate::text::significant;

/// Smallest number of simulated records. With fewer, the required p of 0.02 cannot be resolved.
const FEWEST_SIMULATIONS: usize = 49;
/// Number of pairs (corrected quantity and state variable) in the table.
const N_SHOWN: usize = 12;
/// Number of pairs (corrected quantity and state variable) in the table of a cohort.
const N_SHOWN_OF_COHORT: usize = 6;

pub fn run(arguments: &LearnArguments) -> Result<ExitCode> {
    let session = Session::begin(&arguments.common)?;
    let taken = [TargetKind::Cohort];
    if session.kind(&arguments.others, &taken) == TargetKind::Creep {
        options::check_simulations(arguments.simulations, FEWEST_SIMULATIONS)?;
    }
    let target = session.open(&arguments.model, &arguments.others, &taken)?;
    let request = LearnRequest {
        simulations: arguments.simulations,
        first_cycles: arguments.first_cycles,
        is_monotone: arguments.monotone,
        sampler: session.default_sampler(),
    };
    let outcome = learn::run(&target, &request, &session.terminal)?;
    let words = match &outcome.document.body {
        LearnDocument::Creep(learned) => words(learned, &outcome.name()),
        LearnDocument::Cohort(learned) => cohort_words(learned, &outcome.written),
    };
    session.end(&outcome, &words, RESULTS, &arguments.page)
}

fn words(learned: &Learned, revision: &str) -> String {
    let scored = match learned.heldout_cycles[..] {
        [] => "none held out".to_string(),
        _ => format!("scored on {}", format_ranges(&learned.heldout_cycles)),
    };
    let mut lines = vec![
        format!("{} ({revision}): {}", learned.experiment, learned.verdict.sentence),
        format!(
            "(every model fitted to cycles {}, {scored}; p {:.3} of the whole search)",
            format_ranges(&learned.fitted_cycles),
            learned.p_familywise
        ),
        String::new(),
        format!(
            "  {:<28}{:<20}{:>11}{:>11}{:>11}{:>16}",
            "quantity", "state", "evidence", "held-out", "last", "error of search"
        ),
    ];
    lines.extend(learned.pairs.iter().take(N_SHOWN).map(row));
    lines.push("  (gains in nats over the base model; error of search: in µm on the last held-out cycle, with every kind of noise)".into());
    if learned.pairs.len() > N_SHOWN {
        lines.push(format!("  and {} more with smaller gains", learned.pairs.len() - N_SHOWN));
    }
    lines.push(String::new());
    lines.push(format!("  {:<24}{:>18}{:>20}", "error (µm)", "fitted cycles", "last held-out cycle"));
    lines.push(errors("before", &learned.base));
    lines.extend(learned.learned.as_ref().map(|model_errors| errors("learnt function", model_errors)));
    lines.extend(learned.with_formula.as_ref().map(|model_errors| errors("formula", model_errors)));
    lines.extend(learned.noise_um.map(|noise_um| format!("  {:<24}{:>18}", "noise", significant(noise_um))));
    lines.extend(at_reference(learned));
    if let Some(formula) = &learned.formula {
        lines.push(String::new());
        lines.push(format!("Formula: {}", formula.product(&learned.verdict.quantity)));
        lines.extend(formula.parameters.iter().map(|parameter| {
            let [value, q05, q95] = [parameter.value, parameter.q05, parameter.q95].map(significant);
            format!("  {:<12} {value} ({q05} to {q95}) {}", parameter.name, parameter.unit)
        }));
    }
    lines.extend(learned.memory.iter().filter(|retardation| retardation.share > 1e-3).map(|entry| {
        format!(
            "  retardation time {} s: share {} of the law's compliance",
            significant(entry.time_s),
            significant(entry.share)
        )
    }));
    lines.push(String::new());
    lines.extend(advice(learned, revision));
    lines.join("\n") + "\n"
}

/// Lines with the value of the corrected quantity at the reference state; empty if the quantity is not a parameter of the law.
fn at_reference(learned: &Learned) -> Vec<String> {
    let Some((function, quantity_at_reference)) =
        learned.function.as_ref().and_then(|learned_function| Some((learned_function, learned_function.at_reference?)))
    else {
        return Vec::new();
    };
    let [value, q05, q95] =
        [quantity_at_reference.value, quantity_at_reference.q05, quantity_at_reference.q95].map(significant);
    let LearnedVerdict { quantity, state, .. } = &learned.verdict;
    vec![
        String::new(),
        format!(
            "`{quantity}` is {value} ({q05} to {q95}) at a {} of {} {}; the function is relative to this value",
            state.replace('_', " "),
            significant(function.reference_state),
            function.state_unit
        ),
    ]
}

/// Line with the next command; `None` if there is none to recommend.
fn advice(learned: &Learned, revision: &str) -> Option<String> {
    if learned.verdict.kind == LearnedKind::Nothing {
        return None;
    }
    if let [slug, ..] = &learned.verdict.library[..] {
        return Some(format!("Add the library's effect with `vitreo-uq extend STUDY --with {slug}`."));
    }
    let formula = learned.formula.as_ref()?;
    Some(format!(
        "Add it with `vitreo-uq extend STUDY --with STUDY/{revision}/{}`; the same file works in studies of other specimens.",
        formula.file
    ))
}

fn row(pair: &LearnedPair) -> String {
    let number = |value: Option<f64>| value.map_or("–".into(), |value| format!("{value:.1}"));
    format!(
        "  {:<28}{:<20}{:>11.1}{:>11}{:>11}{:>16}",
        pair.quantity,
        pair.state.replace('_', " "),
        pair.evidence_nats,
        number(pair.heldout_gain_nats),
        number(pair.last_cycle_gain_nats),
        pair.rmse_heldout_um.map_or("–".into(), significant),
    )
}

fn errors(label: &str, model_errors: &ModelErrors) -> String {
    let heldout = model_errors.rmse_heldout_um.map_or("–".into(), significant);
    format!("  {label:<24}{:>18}{heldout:>20}", significant(model_errors.rmse_fitted_um))
}

fn cohort_words(learned: &LearnedCohort, written: &Path) -> String {
    let mut lines = vec![
        learned.verdict.sentence.clone(),
        String::new(),
        format!("  {:<28}{:<20}{:>11}{:>11}", "quantity", "state", "evidence", "held-out"),
    ];
    lines.extend(learned.pairs.iter().take(N_SHOWN_OF_COHORT).map(cohort_row));
    lines.push("  (gains in nats over all records used for learning)".into());
    if let Some(formula) = &learned.formula {
        lines.push(String::new());
        let units = formula.parameters.iter().zip(&formula.units);
        let names: Vec<String> = units.map(|(name, unit)| format!("{name} ({unit})")).collect();
        lines.push(format!(
            "  {:<28}{:>11}{:>13}{:>11}   {}",
            "confirmed on",
            "gain",
            "error before",
            "after",
            names.join(", ")
        ));
        lines.extend(learned.confirmed_on.iter().map(confirmed_row));
        lines.push("  (gains in nats and errors in µm on the last held-out cycle)".into());
    }
    if learned.verdict.kind == LearnedCohortKind::Confirmed
        && let Some(formula) = &learned.formula
    {
        lines.push(String::new());
        let file = written.join(&formula.file);
        lines.push(format!("Add it to every record with `vitreo-uq extend DIR… --with {}`.", file.display()));
    }
    lines.join("\n") + "\n"
}

fn cohort_row(cohort_pair: &CohortPair) -> String {
    let state = cohort_pair.state.replace('_', " ");
    format!(
        "  {:<28}{state:<20}{:>11.1}{:>11.1}",
        cohort_pair.quantity, cohort_pair.evidence_nats, cohort_pair.heldout_gain_nats
    )
}

fn confirmed_row(confirmed_on: &ConfirmedOn) -> String {
    let values: Vec<String> = confirmed_on.values.iter().map(|value| significant(*value)).collect();
    format!(
        "  {:<28}{:>11.1}{:>13}{:>11}   {}",
        confirmed_on.experiment,
        confirmed_on.last_cycle_gain_nats,
        significant(confirmed_on.rmse_before_um),
        significant(confirmed_on.rmse_after_um),
        values.join(", ")
    )
}
