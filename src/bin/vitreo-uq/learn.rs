//! `learn`: the law that nobody wrote down.

use std::process::ExitCode;
use std::time::Instant;

use vitreo_uq::base::error::{Error, Place, Result};
use vitreo_uq::base::files::{remove_if_there, write_atomically, write_json_atomically};
use vitreo_uq::criticism::Subject;
use vitreo_uq::criticism::learn::{FILE_NAME, Request, learn};
use vitreo_uq::documents::learned::{Learned, LearnedErrors, LearnedKind, LearnedPair, LearnedVerdict};
use vitreo_uq::figures::learned as figure;
use vitreo_uq::figures::number::listed;
use vitreo_uq::figures::svg::{remove_figure, write_figure};
use vitreo_uq::posterior::monitor::Monitor;
use vitreo_uq::posterior::study::{LEARNED_NAME, WithProvenance};

use crate::examine::{Begun, Examined};
use crate::options::{self, LearnArguments};
use crate::terminal::Terminal;
use crate::text::significant;

/// p of at most 0.02 is asked for.
const FEWEST_SIMULATIONS: usize = 49;
/// Stem of the figure.
const FIGURE: &str = "learned";
/// Pairs that are shown.
const N_SHOWN: usize = 12;

pub fn run(arguments: &LearnArguments) -> Result<ExitCode> {
    let at = Instant::now();
    let common = &arguments.common;
    if crate::cohort::is_cohort(common.target.as_ref(), &arguments.others) {
        return crate::learn_cohort::run(arguments);
    }
    let threads = options::use_threads(common.threads)?;
    crate::output::check(common.json.as_deref())?;
    options::check_simulations(arguments.simulations, FEWEST_SIMULATIONS)?;
    let terminal = Terminal::new(common.quiet);
    let begun = Begun { at, common, page: &arguments.page, terminal: &terminal };
    let sampler = options::default_sampler(common.seed, threads);
    let examined = Examined::open(common, &arguments.model, sampler, &terminal)?;
    let request = Request { n_simulations: arguments.simulations, seed: common.seed, is_monotone: arguments.monotone };
    let subject = of_first_cycles(examined.subject_for_effects(&terminal)?, arguments.first_cycles)?;
    let outcome = learn(&subject, &request, &terminal)?;
    terminal.stage("writing results and figures");
    let learned = &outcome.learned;
    let document = WithProvenance { provenance: examined.provenance("learned", common.seed), body: learned };
    let writer = examined.study.amend_revision(&examined.revision)?;
    write_json_atomically(&writer.path().join(LEARNED_NAME), &document)?;
    let file = writer.path().join(FILE_NAME);
    match &outcome.file {
        Some(text) => write_atomically(&file, text.as_bytes())?,
        None => remove_if_there(&file)?,
    }
    let figures = writer.path().join("figures");
    match learned.function {
        Some(_) => write_figure(&figures, FIGURE, &figure::learned(learned)?)?,
        None => remove_figure(&figures, FIGURE)?,
    }
    begun.end(&examined.study, writer, &document, &words(learned, &examined.revision))?;
    Ok(ExitCode::SUCCESS)
}

/// The subject whose first cycles are fitted and whose later ones are scored, where that is asked for.
fn of_first_cycles(subject: Subject, first: Option<u32>) -> Result<Subject> {
    let Some(first) = first else { return Ok(subject) };
    let experiment = subject.experiment();
    let mut cycles = [&experiment.calibration_cycles[..], &experiment.heldout_cycles].concat();
    cycles.sort_unstable();
    let (fitted, scored): (Vec<u32>, Vec<u32>) = cycles.into_iter().partition(|cycle| *cycle <= first);
    if fitted.is_empty() || scored.is_empty() {
        let remedy = "give a number that leaves cycles on both sides";
        return Err(Error::input(
            Place::default().at_key("--first-cycles"),
            format!("{first} leaves nothing to fit or to score"),
            remedy,
        ));
    }
    subject.with_cycles(&fitted, &scored)
}

fn words(learned: &Learned, revision: &str) -> String {
    let scored = match learned.heldout_cycles[..] {
        [] => "none held out".to_string(),
        _ => format!("scored on {}", listed(&learned.heldout_cycles)),
    };
    let mut lines = vec![
        format!("{} ({revision}): {}", learned.experiment, learned.verdict.sentence),
        format!(
            "(every model fitted to cycles {}, {scored}; p {:.3} for the whole search)",
            listed(&learned.fitted_cycles),
            learned.p_familywise
        ),
        String::new(),
        format!(
            "  {:<28}{:<20}{:>11}{:>11}{:>11}{:>16}",
            "quantity", "state", "evidence", "held-out", "last", "held-out error"
        ),
    ];
    lines.extend(learned.pairs.iter().take(N_SHOWN).map(row));
    lines.push("  (gains in nats over the model without; error in µm on the held-out cycle)".into());
    if learned.pairs.len() > N_SHOWN {
        lines.push(format!("  and {} more, which gain less", learned.pairs.len() - N_SHOWN));
    }
    lines.push(String::new());
    lines.push(format!("  {:<24}{:>18}{:>20}", "error (µm)", "fitted cycles", "held-out cycle"));
    lines.push(errors("without", &learned.base));
    lines.extend(learned.learned.as_ref().map(|own| errors("as learnt", own)));
    lines.extend(learned.with_formula.as_ref().map(|own| errors("by the formula", own)));
    lines.push(format!("  {:<24}{:>18}", "noise", significant(learned.noise_um)));
    lines.extend(at_reference(learned));
    if let Some(formula) = &learned.formula {
        lines.push(String::new());
        lines.push(format!("Formula: {}", formula.product(&learned.verdict.quantity)));
        lines.extend(formula.parameters.iter().map(|own| {
            let [value, q05, q95] = [own.value, own.q05, own.q95].map(significant);
            format!("  {:<12} {value} ({q05} to {q95}) {}", own.name, own.unit)
        }));
    }
    lines.extend(learned.memory.iter().filter(|own| own.share > 1e-3).map(|own| {
        format!("  retardation of {} s: {} of the law's compliance", significant(own.time_s), significant(own.share))
    }));
    lines.push(String::new());
    lines.extend(advice(learned, revision));
    lines.join("\n") + "\n"
}

/// The quantity at the reference state, where it is a parameter of the law.
fn at_reference(learned: &Learned) -> Vec<String> {
    let Some((function, own)) = learned.function.as_ref().and_then(|own| Some((own, own.at_reference?))) else {
        return Vec::new();
    };
    let [value, q05, q95] = [own.value, own.q05, own.q95].map(significant);
    let LearnedVerdict { quantity, state, .. } = &learned.verdict;
    vec![
        String::new(),
        format!(
            "`{quantity}` is {value} ({q05} to {q95}) at a {} of {} {}; the function is given over its value there",
            state.replace('_', " "),
            significant(function.reference_state),
            function.state_unit
        ),
    ]
}

/// What to do next.
fn advice(learned: &Learned, revision: &str) -> Option<String> {
    if learned.verdict.kind == LearnedKind::Nothing {
        return None;
    }
    if let [slug, ..] = &learned.verdict.library[..] {
        return Some(format!("Add the library's effect with `vitreo-uq extend STUDY --with {slug}`."));
    }
    let formula = learned.formula.as_ref()?;
    Some(format!(
        "Add it with `vitreo-uq extend STUDY --with STUDY/{revision}/{}`; another specimen's study takes the same file.",
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

fn errors(label: &str, own: &LearnedErrors) -> String {
    let heldout = own.rmse_heldout_um.map_or("–".into(), significant);
    format!("  {label:<24}{:>18}{heldout:>20}", significant(own.rmse_fitted_um))
}
