//! Pages of single documents: the comparison of groups, the study of robot shapes, and the results of challenges.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::{
    Figure, Tone, drop_largest_figures, figure, input_hash_table, interval, page, section, table,
    table_with_text_columns,
};
use crate::labels::parameter_label;
use crate::number::format_significant;
use documents::groups::{GroupsSummary, RatioVerdict};
use documents::posterior::Warning;
use documents::shapes::{ClaimVerdict, ShapesSummary};

/// Program version, seed and inputs that a document was made with.
#[derive(Debug)]
pub struct Origin {
    /// Version of the program.
    pub version: String,
    /// Seed of all random streams.
    pub seed: u64,
    /// SHA-256 hash of each input, by name.
    pub inputs_sha256: BTreeMap<String, String>,
}

/// HTML page of the document of `groups`.
pub fn groups(summary: &GroupsSummary, figures: Vec<Figure>, origin: &Origin) -> String {
    let tone = if summary.is_sound() { Tone::Sound } else { Tone::Wrong };
    let heads: Vec<String> = std::iter::once("specimens".to_string())
        .chain(
            summary.groups.first().iter().flat_map(|group| &group.parameters).map(|p| parameter_label(&p.name).axis()),
        )
        .collect();
    let heads: Vec<&str> = std::iter::once("group").chain(heads.iter().map(String::as_str)).collect();
    let typical = summary.groups.iter().map(|group| {
        let count = if group.specimens == 0 { "predicted".into() } else { group.specimens.to_string() };
        let of_parameters = group
            .parameters
            .iter()
            .map(|p| format!("{} ({})", format_significant(p.median, 3), interval(p.q05, p.q95)));
        [group.name.clone(), count].into_iter().chain(of_parameters).collect()
    });
    let ratios = summary.contrasts.iter().map(|contrast| {
        let verdict = match contrast.verdict {
            RatioVerdict::Greater => "greater by more than the margin",
            RatioVerdict::Less => "smaller by more than the margin",
            RatioVerdict::Equivalent => "equal within the margin",
            RatioVerdict::Undecided => "undecided",
        };
        let more = contrast.more.map_or(String::new(), |plan| match plan.specimens_per_group {
            Some(n) => {
                format!(
                    "{n} more specimens per group would decide it with a probability of {:.0} %",
                    100.0 * plan.chance
                )
            }
            None => format!(
                "512 more specimens per group would decide it with a probability of {:.0} %",
                100.0 * plan.chance
            ),
        });
        vec![
            format!("{}: {} over {}", parameter_label(&contrast.parameter).symbol, contrast.a, contrast.b),
            format_significant(contrast.ratio_median, 3),
            interval(contrast.q05, contrast.q95),
            verdict.into(),
            more,
        ]
    });
    let outlying: Vec<&str> = summary
        .specimens
        .iter()
        .filter(|specimen| specimen.is_outlying)
        .map(|specimen_summary| specimen_summary.name.as_str())
        .collect();
    let body = html! {
        div class={ "verdict " (tone.class()) } role="status" {
            h2 { span aria-hidden="true" { (tone.mark()) " " } @if summary.is_sound() { "The comparison is sound" } @else { "Not to be trusted as it stands" } }
            @for sentence in &summary.sentences { p { (sentence) } }
            @if !outlying.is_empty() { p { "Far from their groups: " (outlying.join(", ")) "." } }
            p.lead { "Exit code " (u8::from(!summary.is_sound())) ". " (summary.n_specimens) " specimens in " (summary.experiments.len()) " experiments." }
        }
        (table("Typical specimen of each group: median and 90 % interval", &heads, &typical.collect::<Vec<_>>()))
        (table_with_text_columns(
            &format!("Ratios of typical specimens; specimens within a factor of {} count as equal", format_significant(1.0 + summary.margin, 2)),
            &["ratio", "median", "90 % interval", "", "to decide it"],
            &ratios.collect::<Vec<_>>(),
        ))
    };
    document_page("Comparison of species and regions", &body, figures, &summary.warnings, origin)
}

/// HTML page of the document of `shapes`.
pub fn shapes(summary: &ShapesSummary, figures: Vec<Figure>, origin: &Origin) -> String {
    let claims = summary.claims.iter().map(|claim| {
        let verdict = match claim.verdict {
            ClaimVerdict::Holds => "holds",
            ClaimVerdict::DoesNotHold => "does not hold",
            ClaimVerdict::TooClose => "too close to decide",
        };
        vec![claim.claim.clone(), format_significant(claim.probability, 3), verdict.into(), claim.numbers.clone()]
    });
    let bodies = summary.bodies.iter().map(|body| {
        let orientation = body.orientation.as_ref().map_or(String::new(), |way| format!(", {way}"));
        vec![
            format!("{}{orientation}, {}", body.shape.name(), body.size_rule.title()),
            format_significant(body.length_mm, 3),
            format_significant(body.diameter_mm, 3),
            format_significant(body.ratio_to_sphere, 4),
            format_significant(body.relative_error, 1),
            format_significant(body.relative_difference_3d, 1),
            format_significant(body.displacement_5s_um.median, 4),
            interval(body.displacement_5s_um.q05, body.displacement_5s_um.q95),
        ]
    });
    let heads = [
        "body",
        "length (mm)",
        "diameter (mm)",
        "stiffness / sphere",
        "error",
        "3D − 2D",
        "displacement (µm)",
        "90 % interval",
    ];
    let caption = format!(
        "Gel of {} mm, Poisson ratio {}, force of {} µN held for {} s, robots {} times as long as wide",
        format_significant(summary.vitreous_diameter_mm, 3),
        summary.poisson_ratio,
        format_significant(summary.force_un, 3),
        format_significant(summary.hold_s, 3),
        format_significant(summary.aspect, 3)
    );
    let body = html! {
        (table_with_text_columns("Claims of the paper", &["claim", "probability", "verdict", "numbers"], &claims.collect::<Vec<_>>()))
        (table(&caption, &heads, &bodies.collect::<Vec<_>>()))
    };
    document_page("Comparison of robot shapes", &body, figures, &summary.warnings, origin)
}

/// Results of a run of challenges, as tables of text.
#[derive(Debug)]
pub struct ChallengeResultsPage {
    /// Number of challenges that were played.
    pub played: usize,
    /// Number of challenges whose diagnosis failed.
    pub failed: usize,
    /// Table with a row for each hidden truth: its name, the number of records with it, and the verdicts on it.
    pub verdicts: Vec<Vec<String>>,
    /// Table of rates: name and value.
    pub rates: Vec<Vec<String>>,
    /// Heads of the columns of `groups`.
    pub group_heads: Vec<&'static str>,
    /// Table of results, with a row for each combination of hidden kind (such as a single effect), protocol, noise and signal.
    pub groups: Vec<Vec<String>>,
}

/// HTML page of the results of `challenge run`.
pub fn plays(content: &ChallengeResultsPage, origin: &Origin) -> String {
    let body = html! {
        p.lead { (content.played) @if content.played == 1 { " record" } @else { " records" } " with hidden effects or none, diagnosed and compared with the truth."
            @if content.failed > 0 { " In " (content.failed) " of them the diagnosis failed." } }
        (table("Rates", &["", "share"], &content.rates))
        (table_with_text_columns("Verdicts", &["hidden", "played", "verdicts"], &content.verdicts))
        (table("Results by sort, protocol, noise and signal (σ)", &content.group_heads, &content.groups))
    };
    document_page("Results of challenges", &body, Vec::new(), &[], origin)
}

/// HTML page with the elements that all documents have: title, contents and origin.
fn document_page(
    title: &str,
    body: &Markup,
    mut figures: Vec<Figure>,
    warnings: &[Warning],
    origin: &Origin,
) -> String {
    drop_largest_figures(figures.iter_mut());
    let of_warnings = html! {
        @if warnings.is_empty() { p { "No warnings." } }
        ul {
            @for warning in warnings {
                li {
                    @if warning.kind.is_fatal() { span.fatal { "Not to be trusted as it stands. " } }
                    (warning.text) ". What to do: " (warning.advice) "."
                }
            }
        }
    };
    let of_origin = html! {
        p { "Written by vitreo-uq " (origin.version) " with seed " (origin.seed) "." }
        (input_hash_table(&origin.inputs_sha256))
    };
    let all = html! {
        h1 { (title) }
        (body)
        @for drawing in &figures { (figure(drawing, "")) }
        (section("warned", "Warnings", &of_warnings))
        (section("origin", "Origin of this page", &of_origin))
    };
    page(&format!("{title} – vitreo-uq"), &all)
}
