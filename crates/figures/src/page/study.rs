//! HTML page of a study: measurement, parameters with their uncertainty, misfits, missing effects, and the decrease of the error from revision to revision.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::{
    Figure, Tone, drop_largest_figures, figure, folded, input_hash_table, interval, page, section, table,
    table_with_text_columns,
};
use crate::labels::{effect_size, model_title_with, parameter_label};
use crate::number::{format_decimals, format_ranges, format_significant};
use documents::check::CheckSummary;
use documents::comparison::Comparison;
use documents::diagnosis::{CandidateEntry, Diagnosis, RefitParameter, VerdictKind};
use documents::extension::{EquivalentEffects, EquivalentRefit, ExtensionSummary};
use documents::ladder::LadderSummary;
use documents::learned::{FormulaParameter, Learned, LearnedPair};
use documents::posterior::{PosteriorSummary, Warning};
use documents::trust::{Trust, TrustLevel};

/// All documents of a study that its page shows.
#[derive(Debug)]
pub struct StudyPage {
    /// Description of the measurement, and contradictions between this description and the data.
    pub record: CheckSummary,
    /// Revisions of the study in order; at least one.
    pub revisions: Vec<RevisionPage>,
    /// Comparison of all revisions on equal cycles; `None` if `ladder` has not run.
    pub ladder: Option<LadderPage>,
    /// Predictions and plans for robots in this gel.
    pub predictions: Vec<PredictionPage>,
    /// Version of the program.
    pub version: String,
    /// SHA-256 hash of each input, by name.
    pub inputs_sha256: BTreeMap<String, String>,
    /// Command lines that reproduce the study.
    pub commands: Vec<String>,
}

/// Documents and figures of one revision.
#[derive(Debug)]
pub struct RevisionPage {
    /// Name of the revision: `m0`, `m1`, ….
    pub name: String,
    /// Summary of the posterior.
    pub posterior: PosteriorSummary,
    /// Misfits of the revision; `None` if `compare` has not run.
    pub comparison: Option<Comparison>,
    /// Missing effects of the revision; `None` if `diagnose` has not run.
    pub diagnosis: Option<Diagnosis>,
    /// Correction of the law that was learnt from data; `None` if `learn` has not run.
    pub learned: Option<Learned>,
    /// Differences from the revision that this one extends; `None` for the first revision.
    pub extension: Option<ExtensionSummary>,
    /// Effects that are equivalent to effects of this revision, from diagnoses.
    pub equivalents: Vec<EquivalentEffects>,
    /// Figures of the revision. The key is the file name without its extension.
    pub figures: BTreeMap<String, Figure>,
}

/// Comparison of all revisions of a study, with its figure.
#[derive(Debug)]
pub struct LadderPage {
    /// Document of the comparison.
    pub summary: LadderSummary,
    /// Figure of the comparison.
    pub figure: Figure,
}

/// Prediction or plan, with its figure.
#[derive(Debug)]
pub struct PredictionPage {
    /// Results in words.
    pub sentences: Vec<String>,
    /// Warnings about these results.
    pub warnings: Vec<Warning>,
    /// Caption of the figure.
    pub caption: &'static str,
    /// Figure of the positions.
    pub figure: Figure,
}

impl RevisionPage {
    fn warnings(&self) -> impl Iterator<Item = &Warning> {
        let of_extension = self.extension.iter().flat_map(|extension| &extension.warnings);
        self.posterior.warnings.iter().chain(of_extension.filter(|warning| !self.posterior.warnings.contains(warning)))
    }

    fn is_sound(&self) -> bool {
        self.posterior.is_sound() && self.extension.as_ref().is_none_or(ExtensionSummary::is_sound)
    }

    /// Level of trust in the revision: the lower of the levels in the posterior and the extension. If the diagnosis or the comparison finds misfits, it is at
    /// most `effective`.
    fn trust(&self) -> Trust {
        let of_extension = self.extension.iter().map(|extension| &extension.trust);
        let entry = of_extension.chain([&self.posterior.trust]).max_by_key(|trust| trust.level).cloned();
        let item = entry.unwrap_or_default();
        let is_lacking = self.diagnosis.as_ref().is_some_and(|diagnosis| diagnosis.verdict.kind != VerdictKind::None);
        let fails = self.comparison.as_ref().is_some_and(|comparison| !comparison.findings.is_empty());
        if item.level == TrustLevel::Trusted && (is_lacking || fails) {
            let reason = if is_lacking {
                "the diagnosis finds that the model is incomplete"
            } else {
                "the comparison finds misfits of the model"
            };
            return Trust { level: TrustLevel::Effective, reason: reason.into() };
        }
        item
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

/// HTML page of a study. Equal documents give equal bytes.
pub fn study(mut content: StudyPage) -> String {
    let ladder = content.ladder.iter_mut().map(|ladder| &mut ladder.figure);
    let predictions = content.predictions.iter_mut().map(|prediction| &mut prediction.figure);
    let of_revisions = content.revisions.iter_mut().flat_map(|revision| revision.figures.values_mut());
    drop_largest_figures(of_revisions.chain(ladder).chain(predictions));
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

/// Name and HTML of each part of the page, for another page that arranges them. The part `suspects` is the table of candidate effects of the last revision.
pub fn study_parts(content: &StudyPage) -> Vec<(&'static str, String)> {
    let last = content.revisions.last();
    let head = last.map(|last| {
        let suspects = last.diagnosis.as_ref().map(candidate_table).unwrap_or_default();
        [("verdict", verdict(content, last)), ("parameters", parameters(last)), ("suspects", suspects)]
    });
    let sections = sections(content).into_iter().map(|(id, _, body)| (id, body));
    head.into_iter().flatten().chain(sections).map(|(id, body)| (id, body.into_string())).collect()
}

/// Sections of the page in order: name for links, heading, and content.
fn sections(content: &StudyPage) -> [(&'static str, &'static str, Markup); 10] {
    [
        ("measured", "Measurement", measured(content)),
        ("fit", "Model against measurement", against_measurement(content)),
        ("fails", "Misfits: where the model fails", failures(content)),
        ("missing", "Missing effects", missing(content)),
        ("ladder", "How the error fell", ladder_section(content)),
        ("predicted", "Predictions and plans", predictions(content)),
        ("posterior", "Posterior", posterior(content)),
        ("errors", "Sources of uncertainty", errors(content)),
        ("warned", "Warnings", warnings_section(content)),
        ("origin", "Origin of this page", origin(content)),
    ]
}

/// Box with the verdict on the last revision.
fn verdict(content: &StudyPage, last: &RevisionPage) -> Markup {
    let fatal: Vec<&Warning> = last.warnings().filter(|warning| warning.kind.is_fatal()).collect();
    let diagnosed = last.diagnosis.as_ref().map(|diagnosis| &diagnosis.verdict);
    let is_lacking = diagnosed.is_some_and(|verdict| verdict.kind != VerdictKind::None);
    let fails = last.comparison.as_ref().filter(|comparison| !comparison.findings.is_empty());
    let (heldout, trust) = (&last.posterior.heldout, last.trust());
    let (tone, heading) = if !last.is_sound() {
        (Tone::Wrong, "Not to be trusted as it stands")
    } else if is_lacking {
        (Tone::Doubtful, "The model is incomplete")
    } else if fails.is_some() {
        (Tone::Doubtful, "The model has misfits")
    } else if heldout.rmse_um.is_none() {
        (Tone::Doubtful, "No held-out cycle tests this result")
    } else if trust.level == TrustLevel::Effective {
        (Tone::Doubtful, trust.level.words())
    } else {
        (Tone::Sound, trust.level.words())
    };
    // The heading is the level of trust, unless a diagnosis or a comparison has a more serious result.
    let reason = if heading == trust.level.words() { sentence(&trust.reason) } else { trust.to_string() };
    let extended = last.extension.as_ref().map(|extension| extension.sentence.as_str());
    let misfit = heldout.rmse_um.map(|rmse| {
        let noise = heldout
            .noise_um
            .map_or("unknown".into(), |noise| format!("{} µm, {}", format_significant(noise, 3), heldout.noise_origin));
        format!(
            "The error on held-out {} {} is {} µm; the noise is {noise}.",
            if heldout.cycles.len() == 1 { "cycle" } else { "cycles" },
            format_ranges(&heldout.cycles),
            format_significant(rmse, 3)
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
                p { "To find out whether " (last.name) " lacks a physical effect, run " code { "vitreo-uq diagnose STUDY" } "." }
            }
            p.lead { "Exit code " (u8::from(!last.is_sound())) ". " (content.record.understood.positions) " positions were measured; "
                (heldout.fitted_cycles.len()) " of " (content.record.understood.cycles) " cycles were fitted." }
        }
    }
}

/// Turns a text into a sentence, with a capital letter and a full stop.
fn sentence(words: &str) -> String {
    let mut letters = words.chars();
    let first: String = letters.next().map_or(String::new(), |first| first.to_uppercase().collect());
    format!("{first}{}.", letters.as_str())
}

/// Tables of parameters: those of the law, and those of added effects.
fn parameters(last: &RevisionPage) -> Markup {
    let rows = last.posterior.parameters.iter().map(|p| {
        let label = parameter_label(&p.name);
        vec![label.symbol, format_significant(p.median, 4), interval(p.q05, p.q95), label.unit]
    });
    html! {
        (table("Parameters", &["parameter", "median", "90 % interval", "unit"], &rows.collect::<Vec<_>>()))
        @for own in last.equivalents.iter().filter(|own| !own.refits.is_empty()) { (equivalent_refits(own)) }
    }
}

/// Table of the parameters of equivalent effects, with one column for each effect's refit.
fn equivalent_refits(equivalent_effects: &EquivalentEffects) -> Markup {
    let row = |refit: &EquivalentRefit| {
        let of = |p: &RefitParameter| {
            vec![
                refit.label(p),
                format_significant(p.mean, 4),
                interval(p.q05, p.q95),
                optional(refit.rmse_heldout_um, 3),
            ]
        };
        refit.parameters.iter().map(of).collect::<Vec<_>>()
    };
    let rows: Vec<Vec<String>> = equivalent_effects.refits.iter().flat_map(row).collect();
    let diagnosed = equivalent_effects.diagnosis_of.as_deref().unwrap_or("an earlier revision");
    let caption = format!(
        "{} ({}): effects that the diagnosis of {diagnosed} cannot distinguish; each row is from a fit with one of them",
        equivalent_effects.effects.join(" + "),
        equivalent_effects.alternative().unwrap_or_default()
    );
    table(&caption, &["parameter", "mean", "90 % interval", "held-out error (µm)"], &rows)
}

fn optional(value: Option<f64>, digits: usize) -> String {
    value.map_or("–".into(), |value| format_significant(value, digits))
}

fn measured(content: &StudyPage) -> Markup {
    html! { ul { @for sentence in &content.record.understood.sentences { li { (sentence) } } } }
}

fn against_measurement(content: &StudyPage) -> Markup {
    let captions = "Measured positions over the predictive bands, with residuals and force";
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

/// Table of errors and coverage on held-out cycles.
fn heldout_table(last: &RevisionPage) -> Markup {
    let heldout = &last.posterior.heldout;
    let percent = |value: Option<f64>| value.map_or("–".into(), |value| format!("{:.0} %", 100.0 * value));
    let expected = |range: Option<[f64; 2]>| {
        range.map_or("–".into(), |[low, high]| format!("{:.0} to {:.0} %", 100.0 * low, 100.0 * high))
    };
    let row = |name: &str, value: String, right: String| vec![name.to_string(), value, right];
    let noise = optional(heldout.noise_um, 3);
    let rows = [
        row("error on the fitted cycles (µm)", format_significant(heldout.rmse_fitted_um, 3), noise.clone()),
        row("held-out error (µm)", optional(heldout.rmse_um, 3), noise),
        row("positions inside the 50 % band", percent(heldout.coverage_50), expected(heldout.coverage_50_expected)),
        row("positions inside the 90 % band", percent(heldout.coverage_90), expected(heldout.coverage_90_expected)),
        row("probability of a misfit this large", optional(heldout.joint_p, 2), "above 0.001".into()),
        row("score ln p of the held-out positions (nats)", optional(heldout.log_score_nats, 4), "–".into()),
    ];
    let by = heldout.fe_runs.map_or("the creep law".into(), |runs| last.posterior.model.full_runs(runs));
    table(&format!("Check on held-out cycles, predicted by {by}"), &["", "found", "for a right model"], &rows)
}

fn failures(content: &StudyPage) -> Markup {
    let compared: Vec<&RevisionPage> = content.revisions.iter().filter(|r| r.comparison.is_some()).collect();
    html! {
        @if compared.is_empty() { p { "Not tested: " code { "vitreo-uq compare STUDY" } " tests the residuals." } }
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
                (revision.folded("comparison", "Measurement and model, with residuals and whitened residuals"))
                (revision.folded("comparison_bias", "All tests: bias of the measurement against the model"))
            }
        }
    }
}

fn missing(content: &StudyPage) -> Markup {
    let diagnosed: Vec<&RevisionPage> = content.revisions.iter().filter(|r| r.diagnosis.is_some()).collect();
    let written = content.revisions.iter().filter_map(|revision| Some((revision, revision.learned.as_ref()?)));
    html! {
        @if diagnosed.is_empty() { p { "Not tested: " code { "vitreo-uq diagnose STUDY" } " finds missing effects." } }
        @for revision in diagnosed {
            @if let Some(diagnosis) = &revision.diagnosis {
                h3 { (revision.name) }
                p { strong { (diagnosis.verdict.sentence) } }
                (candidate_table(diagnosis))
                (revision.shown("diagnosis", "Gain of each candidate effect in the fit and on held-out cycles, and the error before and after"))
                (revision.folded("fingerprints", "Fingerprints: residuals that each leading candidate effect would explain"))
                @for entry in &diagnosis.unexplained { p { (entry.sentence) } }
                @if let Some(discrepancy) = &diagnosis.discrepancy { p { (discrepancy.sentence) } }
                (revision.shown("discrepancy", "Discrepancy that no effect of the library explains"))
                @if !diagnosis.separating_protocol.is_empty() { p { "To distinguish the equivalent effects: " (diagnosis.separating_protocol) } }
                @if !diagnosis.blind_spots.is_empty() {
                    p { "This experiment cannot detect " (diagnosis.blind_spots.join(", ")) "." }
                }
                h3 { "Noise of a single position" }
                ul { @for estimate in &diagnosis.noise { li { (estimate.text) } } }
            }
        }
        @for (revision, learned) in written {
            h3 { (revision.name) ": correction of the law learnt from data" }
            p { (learned.verdict.sentence) }
            (revision.shown("learned", "Learnt function with its 90 % band and its formula; grey: states without fitted rows"))
            (learned_tables(learned))
        }
    }
}

/// Tables of a learnt correction: the parameters of its formula, and all pairs of a quantity and a state variable that were tried.
fn learned_tables(learned: &Learned) -> Markup {
    let formula = learned.formula.as_ref().map(|formula| {
        let row = |p: &FormulaParameter| {
            vec![p.name.clone(), format_significant(p.value, 4), interval(p.q05, p.q95), p.unit.clone()]
        };
        let rows: Vec<Vec<String>> = formula.parameters.iter().map(row).collect();
        table(&formula.product(&learned.verdict.quantity), &["parameter", "value", "90 % interval", "unit"], &rows)
    });
    let row = |pair: &LearnedPair| {
        vec![
            format!("{} by {}", pair.quantity, pair.state.replace('_', " ")),
            format_decimals(pair.evidence_nats, 1),
            pair.heldout_gain_nats.map_or("–".into(), |gain| format_decimals(gain, 1)),
            optional(pair.rmse_heldout_um, 3),
        ]
    };
    let rows: Vec<Vec<String>> = learned.pairs.iter().map(row).collect();
    let heads = ["quantity and state", "evidence (nats)", "held-out gain (nats)", "error of the search (µm)"];
    html! {
        @if let Some(formula) = formula { (formula) }
        details { summary { "All pairs of quantity and state" } (table("Gains over the base model", &heads, &rows)) }
    }
}

/// Table of all candidate effects, in order of decreasing gain.
fn candidate_table(diagnosis: &Diagnosis) -> Markup {
    let smallest = |slug: &str| {
        let entry = diagnosis.smallest_detectable.iter().find(|entry| entry.effect == slug);
        entry.and_then(|entry| entry.parameter).map_or("–".into(), |size| effect_size(slug, size))
    };
    let row = |candidate: &CandidateEntry| {
        let refit = candidate.refit.as_ref();
        let chance = refit.map_or("–".into(), |_| format_decimals(candidate.p_familywise, 3));
        let refused = candidate.refused.as_ref().map(|why| format!("not applicable: {why}"));
        vec![
            candidate.effect.clone(),
            refit.map_or("–".into(), |refit| format_decimals(refit.gain_nats, 1)),
            refit.and_then(|refit| refit.heldout_gain_nats).map_or("–".into(), |gain| format_decimals(gain, 1)),
            refit.and_then(|refit| refit.rmse_heldout_um).map_or("–".into(), |um| format_significant(um, 3)),
            chance,
            smallest(&candidate.effect),
            candidate.twins.join(", "),
            refused.unwrap_or_else(|| diagnosis.status_words(candidate).into()),
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
        "smallest detectable",
        "equivalent to",
        "status",
    ];
    html! {
        (table_with_text_columns("Candidate effects: gain of a refit with each effect", &heads, &rows))
        @if let Some(sentence) = diagnosis.gains_without_error() { p { (sentence) } }
    }
}

fn ladder_section(content: &StudyPage) -> Markup {
    let Some(LadderPage { summary, figure: drawing }) = &content.ladder else {
        return html! { p { "Not computed: " code { "vitreo-uq ladder STUDY" } " compares all revisions on the same cycles." } };
    };
    let names = |last: bool| {
        let rung = if last { summary.revisions.last() } else { summary.revisions.first() };
        rung.map_or(String::new(), |rung| rung.revision.clone())
    };
    let (before, after) = (names(false), names(true));
    let shifts = summary.shifts.iter().map(|shift| {
        let shown = |p: &documents::ladder::LadderParameter| {
            format!("{} ({})", format_significant(p.median, 4), interval(p.q05, p.q95))
        };
        vec![
            parameter_label(&shift.name).axis(),
            shown(&shift.before),
            shown(&shift.after),
            format!("{} %", format_decimals(100.0 * shift.relative, 1)),
            format_decimals(shift.in_sd_before, 1),
        ]
    });
    let shifts: Vec<Vec<String>> = shifts.collect();
    html! {
        p { (summary.sentence) }
        (figure(drawing, "Error on the last held-out cycle for each revision, and the noise"))
        @if !shifts.is_empty() {
            (table(&format!("Parameters of the law before and after the missing effects were added: median and 90 % interval, both fitted to cycles {}", format_ranges(&summary.fitted_cycles)), &["parameter", &before, &after, "shift", "in sd"], &shifts))
        }
    }
}

fn predictions(content: &StudyPage) -> Markup {
    html! {
        @if content.predictions.is_empty() {
            p { "Not computed: " code { "vitreo-uq predict STUDY --scenario FILE.toml" } " predicts other robots in this gel, and " code { "vitreo-uq plan STUDY" } " finds the force for a target." }
        }
        @for prediction in &content.predictions {
            ul { @for sentence in &prediction.sentences { li { (sentence) } } }
            (figure(&prediction.figure, prediction.caption))
            @for warning in &prediction.warnings { p { "Note: " (warning.text) ". " (warning.advice) "." } }
        }
    }
}

fn posterior(content: &StudyPage) -> Markup {
    html! {
        @if let Some((last, earlier)) = content.revisions.split_last() {
            (last.shown("corner", "Posterior with priors"))
            (sampling_table(last))
            (last.folded("trace", "Traces of the draws, and their autocorrelation"))
            (last.folded("singular_values", "Singular values of the surrogate's snapshots"))
            @for revision in earlier {
                (revision.folded("corner", &format!("Posterior of {}", revision.name)))
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
            parameter_label(&p.name).axis(),
            format_significant(p.mean, 4),
            format_significant(p.sd, 2),
            format_decimals(p.ess_bulk, 0),
            format_decimals(p.ess_tail, 0),
            format_decimals(p.rhat, 3),
            optional(p.surrogate_bias_sd, 1),
            optional(p.discretisation_bias_sd, 1),
        ]
    });
    let heads = ["parameter", "mean", "sd", "ESS bulk", "ESS tail", "R̂", "surrogate (sd)", "mesh (sd)"];
    table(&caption, &heads, &rows.collect::<Vec<_>>())
}

fn errors(content: &StudyPage) -> Markup {
    let Some(last) = content.revisions.last() else { return html! {} };
    let (budget, surrogate) = (&last.posterior.error_budget_um, &last.posterior.surrogate);
    let row = |name: &str, value: String| vec![name.to_string(), value];
    let rows = [
        row("white noise, estimated", format_significant(budget.noise, 3)),
        row("mesh", optional(budget.fe_discretisation, 2)),
        row("surrogate", optional(budget.surrogate, 2)),
        row("Monte Carlo", format_significant(budget.monte_carlo, 2)),
    ];
    html! {
        (table("Contributions to the uncertainty of a predicted position, in µm", &["", "µm"], &rows))
        @if let (Some(modes), Some(unknowns), Some(runs)) = (surrogate.modes, surrogate.fe_unknowns, surrogate.snapshot_runs) {
            p { "The surrogate has " (modes) @if modes == 1 { " mode" } @else { " modes" } " from " (runs) " runs of " (unknowns) " unknowns; its error at parameters outside the training set is "
                (optional(surrogate.max_relative_error, 1)) " times the amplitude." }
        }
        @if let Some(strain) = last.posterior.largest_strain { p { "The largest strain is " (format_significant(strain, 3)) "." } }
        @if let Some(large) = &last.posterior.large_displacement {
            p { "The robot moves by " (format_significant(large.farthest_radii, 2)) " of its radii."
                @if let Some(most_um) = large.deviation_most_um {
                    " With large strains, a gel of this law would deviate by at most " (format_significant(most_um, 2)) " µm."
                } }
        }
    }
}

/// Section with the warnings of all revisions. Each warning occurs once, with the names of its revisions.
fn warnings_section(content: &StudyPage) -> Markup {
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
        @if all.is_empty() && contradictions.is_empty() && remarks.is_empty() { p { "No warnings." } }
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
        p { "Written by vitreo-uq " (content.version) ". These commands reproduce the study, byte for byte with the same inputs and version"
            @if content.revisions.iter().any(|revision| revision.diagnosis.is_some()) { " (except for " code { "--smallest" } " and " code { "--simulations" } " of a diagnosis, which are not stored)" }
            ":" }
        pre { @for command in &content.commands { (command) "\n" } }
        (input_hash_table(&content.inputs_sha256))
    }
}
