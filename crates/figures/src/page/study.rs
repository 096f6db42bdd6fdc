//! The page of a study: what was measured, what the gel is and how sure that is, where the model fails, what it lacks, and how the error fell.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::{Figure, Tone, figure, fit, folded, hashes, interval, page, section, table, table_that_ends_in_words};
use crate::labels::{model_title_with, of_parameter};
use crate::number::{listed, significant, with_decimals};
use documents::check::CheckSummary;
use documents::comparison::Comparison;
use documents::diagnosis::{CandidateEntry, Diagnosis, RefitParameter, VerdictKind};
use documents::extension::{EquivalentEffects, EquivalentRefit, ExtensionSummary};
use documents::ladder::LadderSummary;
use documents::learned::{FormulaParameter, Learned, LearnedPair};
use documents::posterior::{PosteriorSummary, Warning};
use documents::trust::{Trust, TrustLevel};

/// All that a study holds, as it stands on disk.
#[derive(Debug)]
pub struct StudyPage {
    /// What was measured, and what contradicts its description.
    pub record: CheckSummary,
    /// The revisions, in their order; at least one.
    pub revisions: Vec<RevisionPage>,
    /// All of them on the same footing, where that was asked for.
    pub ladder: Option<LadderPage>,
    /// The program's version.
    pub version: String,
    /// SHA-256 of all that went in, by name.
    pub inputs_sha256: BTreeMap<String, String>,
    /// Command lines that make it again.
    pub commands: Vec<String>,
}

/// One revision.
#[derive(Debug)]
pub struct RevisionPage {
    /// Its name, `m0`, `m1`, ….
    pub name: String,
    /// Its posterior.
    pub posterior: PosteriorSummary,
    /// Where it fails, if that was asked.
    pub comparison: Option<Comparison>,
    /// What it lacks, if that was asked.
    pub diagnosis: Option<Diagnosis>,
    /// The law that the data write by themselves, if that was asked.
    pub learned: Option<Learned>,
    /// What it changed, if it extends another.
    pub extension: Option<ExtensionSummary>,
    /// What diagnoses could not tell from its effects.
    pub equivalents: Vec<EquivalentEffects>,
    /// Its figures, by the stems of their names.
    pub figures: BTreeMap<String, Figure>,
}

/// The comparison of all revisions.
#[derive(Debug)]
pub struct LadderPage {
    /// Its document.
    pub summary: LadderSummary,
    /// Its figure.
    pub figure: Figure,
}

impl RevisionPage {
    fn warnings(&self) -> impl Iterator<Item = &Warning> {
        let of_extension = self.extension.iter().flat_map(|extension| &extension.warnings);
        self.posterior.warnings.iter().chain(of_extension.filter(|own| !self.posterior.warnings.contains(own)))
    }

    fn is_sound(&self) -> bool {
        self.posterior.is_sound() && self.extension.as_ref().is_none_or(ExtensionSummary::is_sound)
    }

    /// The lower of what the posterior and the extension say, and no more than a diagnosis or a comparison allows.
    fn trust(&self) -> Trust {
        let of_extension = self.extension.iter().map(|extension| &extension.trust);
        let own = of_extension.chain([&self.posterior.trust]).max_by_key(|trust| trust.level).cloned();
        let own = own.unwrap_or_default();
        let is_lacking = self.diagnosis.as_ref().is_some_and(|own| own.verdict.kind != VerdictKind::None);
        let fails = self.comparison.as_ref().is_some_and(|own| !own.findings.is_empty());
        if own.level == TrustLevel::Trusted && (is_lacking || fails) {
            let reason = if is_lacking {
                "the diagnosis finds that the model lacks something"
            } else {
                "the comparison finds places where the model fails"
            };
            return Trust { level: TrustLevel::Effective, reason: reason.into() };
        }
        own
    }

    fn title(&self) -> String {
        model_title_with(&self.posterior.model, &self.equivalents)
    }

    fn shown(&self, stem: &str, caption: &str) -> Markup {
        html! { @if let Some(drawing) = self.figures.get(stem) { (figure(drawing, caption)) } }
    }

    fn folded(&self, stem: &str, caption: &str) -> Markup {
        html! { @if let Some(drawing) = self.figures.get(stem) { (folded(drawing, caption)) } }
    }
}

/// The page; the same documents give the same bytes.
pub fn study(mut content: StudyPage) -> String {
    let ladder = content.ladder.iter_mut().map(|ladder| &mut ladder.figure);
    fit(content.revisions.iter_mut().flat_map(|revision| revision.figures.values_mut()).chain(ladder));
    let content = &content;
    let name = &content.record.experiment;
    let sections = sections(content);
    let body = html! {
        h1 { (name) }
        @if let Some(last) = content.revisions.last() {
            p.lead { (last.title()) " model, revision " (last.name) }
            (verdict(content, last))
            (parameters(last))
        }
        nav aria-label="Contents" { @for (id, heading, _) in &sections { a href={ "#" (id) } { (heading) } } }
        @for (id, heading, body) in &sections { (section(id, heading, body)) }
    };
    page(&format!("{name} – vitreo-uq"), &body)
}

/// Parts of the page with their names, each as HTML, for a page that shows other things between them; `suspects` are those of the last revision.
pub fn study_parts(content: &StudyPage) -> Vec<(&'static str, String)> {
    let last = content.revisions.last();
    let head = last.map(|last| {
        let suspects = last.diagnosis.as_ref().map(suspects).unwrap_or_default();
        [("verdict", verdict(content, last)), ("parameters", parameters(last)), ("suspects", suspects)]
    });
    let sections = sections(content).into_iter().map(|(id, _, body)| (id, body));
    head.into_iter().flatten().chain(sections).map(|(id, body)| (id, body.into_string())).collect()
}

/// Sections in their order: a name for links, a heading, and what stands there.
fn sections(content: &StudyPage) -> [(&'static str, &'static str, Markup); 9] {
    [
        ("measured", "What was measured", measured(content)),
        ("fit", "Model against measurement", against_measurement(content)),
        ("fails", "Where the model fails", failures(content)),
        ("missing", "What is missing", missing(content)),
        ("ladder", "How the error fell", ladder_section(content)),
        ("posterior", "How sure that is", posterior(content)),
        ("errors", "Where the uncertainty comes from", errors(content)),
        ("warned", "Everything that was warned of", warned(content)),
        ("origin", "Where this page comes from", origin(content)),
    ]
}

/// Whether to believe the last revision, in plain words.
fn verdict(content: &StudyPage, last: &RevisionPage) -> Markup {
    let fatal: Vec<&Warning> = last.warnings().filter(|warning| warning.kind.is_fatal()).collect();
    let diagnosed = last.diagnosis.as_ref().map(|diagnosis| &diagnosis.verdict);
    let is_lacking = diagnosed.is_some_and(|verdict| verdict.kind != VerdictKind::None);
    let fails = last.comparison.as_ref().filter(|comparison| !comparison.findings.is_empty());
    let (heldout, trust) = (&last.posterior.heldout, last.trust());
    let (tone, heading) = if !last.is_sound() {
        (Tone::Wrong, "Not to be trusted as it stands")
    } else if is_lacking {
        (Tone::Doubtful, "The model lacks something")
    } else if fails.is_some() {
        (Tone::Doubtful, "The model fails in places")
    } else if heldout.rmse_um.is_none() {
        (Tone::Doubtful, "Nothing tests this result")
    } else if trust.level == TrustLevel::Effective {
        (Tone::Doubtful, trust.level.words())
    } else {
        (Tone::Sound, trust.level.words())
    };
    // The heading is the level, or something graver that a diagnosis or a comparison has found.
    let reason = if heading == trust.level.words() { sentence(&trust.reason) } else { trust.to_string() };
    let extended = last.extension.as_ref().map(|extension| extension.sentence.as_str());
    let misfit = heldout.rmse_um.map(|rmse| {
        let noise = heldout
            .noise_um
            .map_or("unknown".into(), |noise| format!("{} µm, {}", significant(noise, 3), heldout.noise_origin));
        format!(
            "It predicts {} {}, to which it was not fitted, to {} µm; the noise is {noise}.",
            if heldout.cycles.len() == 1 { "cycle" } else { "cycles" },
            listed(&heldout.cycles),
            significant(rmse, 3)
        )
    });
    html! {
        div class={ "verdict " (tone.class()) } role="status" {
            h2 { span aria-hidden="true" { (tone.mark()) " " } (heading) }
            @if fatal.is_empty() { p { (reason) } }
            @for sentence in last.equivalents.iter().filter(|own| own.revision != last.name).filter_map(EquivalentEffects::sentence) { p { (sentence) } }
            @if let Some(sentence) = extended { p { (sentence) } }
            @if let Some(verdict) = diagnosed { p { (verdict.sentence) } }
            @else if let Some(comparison) = fails { p { (comparison.sentence) } }
            @if let Some(misfit) = misfit { p { (misfit) } }
            @if heldout.rmse_um.is_none() { p { "No cycle was held out, so no prediction was tested." } }
            @for warning in &fatal { p { span.fatal { (warning.text) "." } " What to do: " (warning.advice) "." } }
            @if diagnosed.is_none() {
                p { "Whether a physical effect is missing has not been asked of " (last.name) ": " code { "vitreo-uq diagnose STUDY" } " does." }
            }
            p.lead { "Exit code " (u8::from(!last.is_sound())) ". " (content.record.understood.positions) " positions were measured; "
                (heldout.fitted_cycles.len()) " of " (content.record.understood.cycles) " cycles were fitted." }
        }
    }
}

/// With a capital and a full stop.
fn sentence(words: &str) -> String {
    let mut letters = words.chars();
    let first: String = letters.next().map_or(String::new(), |first| first.to_uppercase().collect());
    format!("{first}{}.", letters.as_str())
}

/// The law and what was added to it.
fn parameters(last: &RevisionPage) -> Markup {
    let rows = last.posterior.parameters.iter().map(|p| {
        let label = of_parameter(&p.name);
        vec![label.symbol, significant(p.median, 4), interval(p.q05, p.q95), label.unit]
    });
    html! {
        (table("What the gel is", &["parameter", "median", "90 % interval", "unit"], &rows.collect::<Vec<_>>()))
        @for own in last.equivalents.iter().filter(|own| !own.refits.is_empty()) { (equivalent_refits(own)) }
    }
}

/// Parameters of effects that the diagnosis could not tell from each other, side by side.
fn equivalent_refits(own: &EquivalentEffects) -> Markup {
    let row = |refit: &EquivalentRefit| {
        let of = |p: &RefitParameter| {
            vec![p.name.clone(), significant(p.mean, 4), interval(p.q05, p.q95), optional(refit.rmse_heldout_um, 3)]
        };
        refit.parameters.iter().map(of).collect::<Vec<_>>()
    };
    let rows: Vec<Vec<String>> = own.refits.iter().flat_map(row).collect();
    let diagnosed = own.diagnosis_of.as_deref().unwrap_or("an earlier revision");
    let caption = format!(
        "{} ({}): not told apart by the diagnosis of {diagnosed}, which refitted each by itself",
        own.effects.join(" + "),
        own.alternative().unwrap_or_default()
    );
    table(&caption, &["parameter", "mean", "90 % interval", "held-out error (µm)"], &rows)
}

fn optional(value: Option<f64>, digits: usize) -> String {
    value.map_or("–".into(), |value| significant(value, digits))
}

fn measured(content: &StudyPage) -> Markup {
    html! { ul { @for sentence in &content.record.understood.sentences { li { (sentence) } } } }
}

fn against_measurement(content: &StudyPage) -> Markup {
    let captions = "Measured positions over the bands of the prediction, residuals and force below";
    html! {
        @if let Some((last, earlier)) = content.revisions.split_last() {
            h3 { (last.name) ": " (last.title()) }
            (last.shown("predictive", captions))
            (heldout_table(last))
            @for revision in earlier {
                (revision.folded("predictive", &format!("{}: {}", revision.name, revision.title())))
            }
        }
    }
}

/// How the posterior predicts what it has not seen.
fn heldout_table(last: &RevisionPage) -> Markup {
    let heldout = &last.posterior.heldout;
    let percent = |value: Option<f64>| value.map_or("–".into(), |value| format!("{:.0} %", 100.0 * value));
    let expected = |range: Option<[f64; 2]>| {
        range.map_or("–".into(), |[low, high]| format!("{:.0} to {:.0} %", 100.0 * low, 100.0 * high))
    };
    let row = |name: &str, value: String, right: String| vec![name.to_string(), value, right];
    let noise = optional(heldout.noise_um, 3);
    let rows = [
        row("error of the fitted cycles (µm)", significant(heldout.rmse_fitted_um, 3), noise.clone()),
        row("held-out error (µm)", optional(heldout.rmse_um, 3), noise),
        row("positions inside the 50 % band", percent(heldout.coverage_50), expected(heldout.coverage_50_expected)),
        row("positions inside the 90 % band", percent(heldout.coverage_90), expected(heldout.coverage_90_expected)),
        row("probability of a misfit this large", optional(heldout.joint_p, 2), "above 0.001".into()),
        row("score ln p of the held-out positions (nats)", optional(heldout.log_score_nats, 4), "–".into()),
    ];
    let by = heldout.fe_runs.map_or("the creep law".into(), |runs| last.posterior.model.full_runs(runs));
    table(&format!("The held-out check, by {by}"), &["", "found", "a right model"], &rows)
}

fn failures(content: &StudyPage) -> Markup {
    let compared: Vec<&RevisionPage> = content.revisions.iter().filter(|r| r.comparison.is_some()).collect();
    html! {
        @if compared.is_empty() { p { "Not asked: " code { "vitreo-uq compare STUDY" } " looks where the model fails." } }
        @for revision in compared {
            @if let Some(comparison) = &revision.comparison {
                h3 { (revision.name) }
                p { (comparison.sentence) }
                ul {
                    @for finding in comparison.findings.iter().filter(|finding| finding.echo_of.is_none()) {
                        li { strong { (finding.place.replace('_', " ")) } ": " (finding.sentence) }
                    }
                }
                (revision.shown("comparison_map", "Failure map: cycle against time since the last force step"))
                (revision.folded("comparison", "Measurement against model, what is left, and the same whitened"))
                (revision.folded("comparison_bias", "Every look: bias of the measurement against the model"))
            }
        }
    }
}

fn missing(content: &StudyPage) -> Markup {
    let diagnosed: Vec<&RevisionPage> = content.revisions.iter().filter(|r| r.diagnosis.is_some()).collect();
    let written = content.revisions.iter().filter_map(|revision| Some((revision, revision.learned.as_ref()?)));
    html! {
        @if diagnosed.is_empty() { p { "Not asked: " code { "vitreo-uq diagnose STUDY" } " names the effect that is missing." } }
        @for revision in diagnosed {
            @if let Some(diagnosis) = &revision.diagnosis {
                h3 { (revision.name) }
                p { strong { (diagnosis.verdict.sentence) } }
                (suspects(diagnosis))
                (revision.shown("diagnosis", "Every effect refitted: what it gains in the fit and on held-out cycles, and the error before and after"))
                (revision.folded("fingerprints", "Fingerprints: what a refit with each of the leading suspects would explain of what the model leaves"))
                @for entry in &diagnosis.unexplained { p { (entry.sentence) } }
                @if let Some(discrepancy) = &diagnosis.discrepancy { p { (discrepancy.sentence) } }
                (revision.shown("discrepancy", "What no effect of the library explains"))
                @if !diagnosis.separating_protocol.is_empty() { p { "To tell them apart: " (diagnosis.separating_protocol) } }
                @if !diagnosis.blind_spots.is_empty() {
                    p { "This experiment cannot show " (diagnosis.blind_spots.join(", ")) "." }
                }
                h3 { "Noise of one position" }
                ul { @for estimate in &diagnosis.noise { li { (estimate.text) } } }
            }
        }
        @for (revision, learned) in written {
            h3 { (revision.name) ": what the data write by themselves" }
            p { (learned.verdict.sentence) }
            (revision.shown("learned", "The learned function with its 90 % band and its formula; grey where no fitted row was"))
            (learnt(learned))
        }
    }
}

/// The formula's parameters, and all pairs that were looked at.
fn learnt(learned: &Learned) -> Markup {
    let formula = learned.formula.as_ref().map(|formula| {
        let row = |p: &FormulaParameter| {
            vec![p.name.clone(), significant(p.value, 4), interval(p.q05, p.q95), p.unit.clone()]
        };
        let rows: Vec<Vec<String>> = formula.parameters.iter().map(row).collect();
        table(&formula.product(&learned.verdict.quantity), &["parameter", "value", "90 % interval", "unit"], &rows)
    });
    let row = |pair: &LearnedPair| {
        vec![
            format!("{} by {}", pair.quantity, pair.state.replace('_', " ")),
            with_decimals(pair.evidence_nats, 1),
            pair.heldout_gain_nats.map_or("–".into(), |gain| with_decimals(gain, 1)),
            optional(pair.rmse_heldout_um, 3),
        ]
    };
    let rows: Vec<Vec<String>> = learned.pairs.iter().map(row).collect();
    let heads = ["quantity and state", "evidence (nats)", "held-out gain (nats)", "error of the search (µm)"];
    html! {
        @if let Some(formula) = formula { (formula) }
        details { summary { "Every pair that was looked at" } (table("Gains over the model without", &heads, &rows)) }
    }
}

/// Every effect of the library, what gains most first.
fn suspects(diagnosis: &Diagnosis) -> Markup {
    let smallest = |slug: &str| {
        let entry = diagnosis.smallest_detectable.iter().find(|entry| entry.effect == slug);
        optional(entry.and_then(|entry| entry.parameter), 2)
    };
    let row = |candidate: &CandidateEntry| {
        let refit = candidate.refit.as_ref();
        let chance = refit.map_or("–".into(), |_| with_decimals(candidate.p_familywise, 3));
        let refused = candidate.refused.as_ref().map(|why| format!("not here: {why}"));
        vec![
            candidate.effect.clone(),
            refit.map_or("–".into(), |refit| with_decimals(refit.gain_nats, 1)),
            refit.and_then(|refit| refit.heldout_gain_nats).map_or("–".into(), |gain| with_decimals(gain, 1)),
            refit.and_then(|refit| refit.rmse_heldout_um).map_or("–".into(), |um| significant(um, 3)),
            chance,
            smallest(&candidate.effect),
            candidate.twins.join(", "),
            refused.unwrap_or_else(|| diagnosis.standing(candidate).into()),
        ]
    };
    let gain =
        |candidate: &&CandidateEntry| candidate.refit.as_ref().map_or(f64::NEG_INFINITY, |refit| refit.gain_nats);
    let mut candidates: Vec<&CandidateEntry> = diagnosis.candidates.iter().collect();
    candidates.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
    let rows: Vec<Vec<String>> = candidates.into_iter().map(row).collect();
    let heads = [
        "effect",
        "gain (nats)",
        "held-out gain (nats)",
        "expected error (µm)",
        "p of the search",
        "smallest seen",
        "looks like",
        "standing",
    ];
    html! {
        (table_that_ends_in_words("Suspects: what a refit with each effect gains", &heads, &rows))
        @if let Some(sentence) = diagnosis.gains_without_error() { p { (sentence) } }
    }
}

fn ladder_section(content: &StudyPage) -> Markup {
    let Some(LadderPage { summary, figure: drawing }) = &content.ladder else {
        return html! { p { "Not asked: " code { "vitreo-uq ladder STUDY" } " sets all revisions on the same footing." } };
    };
    let names = |last: bool| {
        let rung = if last { summary.revisions.last() } else { summary.revisions.first() };
        rung.map_or(String::new(), |rung| rung.revision.clone())
    };
    let (before, after) = (names(false), names(true));
    let shifts = summary.shifts.iter().map(|shift| {
        let shown =
            |p: &documents::ladder::RungParameter| format!("{} ({})", significant(p.median, 4), interval(p.q05, p.q95));
        vec![
            of_parameter(&shift.name).axis(),
            shown(&shift.before),
            shown(&shift.after),
            format!("{} %", with_decimals(100.0 * shift.relative, 1)),
            with_decimals(shift.in_sd_before, 1),
        ]
    });
    let shifts: Vec<Vec<String>> = shifts.collect();
    html! {
        p { (summary.sentence) }
        (figure(drawing, "The error on the cycle that no fit has seen, revision by revision, down to the noise"))
        @if !shifts.is_empty() {
            (table(&format!("What was missing had bent the law: median and 90 % interval, both fitted to cycles {}", listed(&summary.fitted_cycles)), &["parameter", &before, &after, "shift", "in sd"], &shifts))
        }
    }
}

fn posterior(content: &StudyPage) -> Markup {
    html! {
        @if let Some((last, earlier)) = content.revisions.split_last() {
            (last.shown("corner", "The posterior, with the priors"))
            (sampling_table(last))
            (last.folded("trace", "How the draws went, and how long they remember"))
            (last.folded("singular_values", "Singular values of the snapshots that the reduced model is made of"))
            @for revision in earlier {
                (revision.folded("corner", &format!("The posterior of {}", revision.name)))
            }
        }
    }
}

fn sampling_table(last: &RevisionPage) -> Markup {
    let posterior = &last.posterior;
    let sampler = &posterior.sampler;
    let caption = format!(
        "{} ensembles of {} walkers, {} steps: {}",
        sampler.ensembles,
        sampler.walkers,
        sampler.steps,
        if posterior.converged { "converged" } else { "NOT CONVERGED" }
    );
    let rows = posterior.parameters.iter().map(|p| {
        vec![
            of_parameter(&p.name).axis(),
            significant(p.mean, 4),
            significant(p.sd, 2),
            with_decimals(p.ess_bulk, 0),
            with_decimals(p.ess_tail, 0),
            with_decimals(p.rhat, 3),
            optional(p.surrogate_bias_sd, 1),
            optional(p.discretisation_bias_sd, 1),
        ]
    });
    let heads = ["parameter", "mean", "sd", "ESS bulk", "ESS tail", "R̂", "reduced model (sd)", "mesh (sd)"];
    table(&caption, &heads, &rows.collect::<Vec<_>>())
}

fn errors(content: &StudyPage) -> Markup {
    let Some(last) = content.revisions.last() else { return html! {} };
    let (budget, surrogate) = (&last.posterior.error_budget_um, &last.posterior.surrogate);
    let row = |name: &str, value: String| vec![name.to_string(), value];
    let rows = [
        row("noise from row to row, learnt", significant(budget.noise, 3)),
        row("mesh", optional(budget.fe_discretisation, 2)),
        row("reduced model", optional(budget.surrogate, 2)),
        row("Monte Carlo", significant(budget.monte_carlo, 2)),
    ];
    html! {
        (table("Parts of the uncertainty of a predicted position, in µm", &["", "µm"], &rows))
        @if let (Some(modes), Some(unknowns), Some(runs)) = (surrogate.modes, surrogate.fe_unknowns, surrogate.snapshot_runs) {
            p { "The reduced model has " (modes) @if modes == 1 { " mode" } @else { " modes" } " from " (runs) " runs of " (unknowns) " unknowns; on parameters that trained nothing it errs by "
                (optional(surrogate.max_relative_error, 1)) " of the amplitude." }
        }
        @if let Some(strain) = last.posterior.largest_strain { p { "The largest strain is " (significant(strain, 3)) "." } }
        @if let Some(large) = &last.posterior.large_displacement {
            p { "The robot moves by " (significant(large.farthest_radii, 2)) " of its radii."
                @if let Some(most_um) = large.deviation_most_um {
                    " A gel of this law whose strains may be large would deviate by " (significant(most_um, 2)) " µm at most."
                } }
        }
    }
}

/// Warnings of all revisions, each once, with the revisions that have it.
fn warned(content: &StudyPage) -> Markup {
    let mut all: Vec<(&Warning, Vec<&str>)> = Vec::new();
    for revision in &content.revisions {
        for warning in revision.warnings() {
            match all.iter_mut().find(|(known, _)| *known == warning) {
                Some((_, names)) => names.push(&revision.name),
                None => all.push((warning, vec![&revision.name])),
            }
        }
    }
    let remarks: Vec<(&str, &String)> = content
        .revisions
        .iter()
        .flat_map(|revision| revision.diagnosis.iter().map(|diagnosis| (revision.name.as_str(), diagnosis)))
        .flat_map(|(name, diagnosis)| diagnosis.remarks.iter().map(move |remark| (name, remark)))
        .collect();
    let contradictions = &content.record.contradictions;
    html! {
        @if all.is_empty() && contradictions.is_empty() && remarks.is_empty() { p { "Nothing." } }
        ul {
            @for contradiction in contradictions { li { "The record: " (contradiction.text) ". What to do: " (contradiction.advice) "." } }
            @for (warning, names) in &all {
                li {
                    @if warning.kind.is_fatal() { span.fatal { "Not to be trusted as it stands. " } }
                    (names.join(", ")) ": " (warning.text) ". What to do: " (warning.advice) "."
                }
            }
            @for (name, remark) in &remarks { li { (name) ", diagnosis: " (remark) "." } }
        }
    }
}

fn origin(content: &StudyPage) -> Markup {
    html! {
        p { "Written by vitreo-uq " (content.version) ". These commands make the study again, to the last byte with the same inputs and the same version"
            @if content.revisions.iter().any(|revision| revision.diagnosis.is_some()) { " (but for " code { "--smallest" } " and " code { "--simulations" } " of a diagnosis, which it does not keep)" }
            ":" }
        pre { @for command in &content.commands { (command) "\n" } }
        (hashes(&content.inputs_sha256))
    }
}
