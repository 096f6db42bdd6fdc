//! Pages of one document: species and regions compared, and the study of robot shapes.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::{Figure, Tone, figure, fit, hashes, interval, page, section, table, table_that_ends_in_words};
use crate::labels::of_parameter;
use crate::number::significant;
use documents::groups::{GroupsSummary, RatioVerdict};
use documents::posterior::Warning;
use documents::shapes::{ClaimVerdict, ShapesSummary};

/// Where a document comes from.
#[derive(Debug)]
pub struct Origin {
    /// The program's version.
    pub version: String,
    /// Seed of all random streams.
    pub seed: u64,
    /// SHA-256 of all that went in, by name.
    pub inputs_sha256: BTreeMap<String, String>,
}

/// The page of `groups`.
pub fn groups(summary: &GroupsSummary, figures: Vec<Figure>, origin: &Origin) -> String {
    let tone = if summary.is_sound() { Tone::Sound } else { Tone::Wrong };
    let heads: Vec<String> = std::iter::once("specimens".to_string())
        .chain(summary.groups.first().iter().flat_map(|group| &group.parameters).map(|p| of_parameter(&p.name).axis()))
        .collect();
    let heads: Vec<&str> = std::iter::once("group").chain(heads.iter().map(String::as_str)).collect();
    let typical = summary.groups.iter().map(|group| {
        let count = if group.specimens == 0 { "predicted".into() } else { group.specimens.to_string() };
        let of_parameters =
            group.parameters.iter().map(|p| format!("{} ({})", significant(p.median, 3), interval(p.q05, p.q95)));
        [group.name.clone(), count].into_iter().chain(of_parameters).collect()
    });
    let ratios = summary.contrasts.iter().map(|contrast| {
        let verdict = match contrast.verdict {
            RatioVerdict::Greater => "greater by more than the margin",
            RatioVerdict::Less => "smaller by more than the margin",
            RatioVerdict::Equivalent => "the same within the margin",
            RatioVerdict::Undecided => "undecided",
        };
        let more = contrast.more.map_or(String::new(), |plan| match plan.specimens_per_group {
            Some(n) => {
                format!("{n} more specimens a group would settle it with a chance of {:.0} %", 100.0 * plan.chance)
            }
            None => format!("512 more specimens a group would settle it with a chance of {:.0} %", 100.0 * plan.chance),
        });
        vec![
            format!("{}: {} over {}", of_parameter(&contrast.parameter).symbol, contrast.a, contrast.b),
            significant(contrast.ratio_median, 3),
            interval(contrast.q05, contrast.q95),
            verdict.into(),
            more,
        ]
    });
    let outlying: Vec<&str> =
        summary.specimens.iter().filter(|own| own.is_outlying).map(|own| own.name.as_str()).collect();
    let body = html! {
        div class={ "verdict " (tone.class()) } role="status" {
            h2 { span aria-hidden="true" { (tone.mark()) " " } @if summary.is_sound() { "Compared" } @else { "Not to be trusted as it stands" } }
            @for sentence in &summary.sentences { p { (sentence) } }
            @if !outlying.is_empty() { p { "Far from their groups: " (outlying.join(", ")) "." } }
            p.lead { "Exit code " (u8::from(!summary.is_sound())) ". " (summary.n_specimens) " specimens in " (summary.experiments.len()) " experiments." }
        }
        (table("The typical specimen of each group: median and 90 % interval", &heads, &typical.collect::<Vec<_>>()))
        (table_that_ends_in_words(
            &format!("Ratios of typical specimens; within {} of each other counts as the same", significant(1.0 + summary.margin, 2)),
            &["ratio", "median", "90 % interval", "", "to settle it"],
            &ratios.collect::<Vec<_>>(),
        ))
    };
    sheet("Species and regions compared", &body, figures, &summary.warnings, origin)
}

/// The page of `shapes`.
pub fn shapes(summary: &ShapesSummary, figures: Vec<Figure>, origin: &Origin) -> String {
    let claims = summary.claims.iter().map(|claim| {
        let verdict = match claim.verdict {
            ClaimVerdict::Holds => "holds",
            ClaimVerdict::DoesNotHold => "does not hold",
            ClaimVerdict::TooClose => "too close to say",
        };
        vec![claim.claim.clone(), significant(claim.probability, 3), verdict.into(), claim.numbers.clone()]
    });
    let bodies = summary.bodies.iter().map(|body| {
        let orientation = body.orientation.as_ref().map_or(String::new(), |way| format!(", {way}"));
        vec![
            format!("{}{orientation}, {}", body.shape.name(), body.size_rule.title()),
            significant(body.length_mm, 3),
            significant(body.diameter_mm, 3),
            significant(body.ratio_to_sphere, 4),
            significant(body.relative_error, 1),
            significant(body.relative_difference_3d, 1),
            significant(body.displacement_5s_um.median, 4),
            interval(body.displacement_5s_um.q05, body.displacement_5s_um.q95),
        ]
    });
    let heads = [
        "body",
        "length (mm)",
        "diameter (mm)",
        "stiffness over the sphere's",
        "its error",
        "3D against it",
        "moves (µm)",
        "90 % interval",
    ];
    let caption = format!(
        "A gel of {} mm, Poisson ratio {}, a force of {} µN held for {} s, robots {} times as long as wide",
        significant(summary.vitreous_diameter_mm, 3),
        summary.poisson_ratio,
        significant(summary.force_un, 3),
        significant(summary.hold_s, 3),
        significant(summary.aspect, 3)
    );
    let body = html! {
        (table_that_ends_in_words("What the paper claims", &["claim", "probability", "verdict", "numbers"], &claims.collect::<Vec<_>>()))
        (table(&caption, &heads, &bodies.collect::<Vec<_>>()))
    };
    sheet("Which robot moves easiest", &body, figures, &summary.warnings, origin)
}

/// What many challenges came to, as tables of words.
#[derive(Debug)]
pub struct PlaysPage {
    /// How many were played, and in how many the diagnosis failed.
    pub played: usize,
    pub failed: usize,
    /// What was hidden, how often, and what was said of it.
    pub said: Vec<Vec<String>>,
    /// Rates.
    pub rates: Vec<Vec<String>>,
    /// Heads and rows of the same by sort, protocol, noise and signal.
    pub group_heads: Vec<&'static str>,
    pub groups: Vec<Vec<String>>,
}

/// The page of `challenge run`.
pub fn plays(content: &PlaysPage, origin: &Origin) -> String {
    let body = html! {
        p.lead { (content.played) @if content.played == 1 { " record" } @else { " records" } " with something hidden, or nothing: diagnosed, and held against the truth."
            @if content.failed > 0 { " In " (content.failed) " the diagnosis failed." } }
        (table("How often it was right", &["", "share"], &content.rates))
        (table_that_ends_in_words("What was said", &["hidden", "played", "said"], &content.said))
        (table("By what was hidden, under which protocol and noise, and how strong it was (σ)", &content.group_heads, &content.groups))
    };
    sheet("Challenges played", &body, Vec::new(), &[], origin)
}

/// The page around what is particular to a document.
fn sheet(title: &str, body: &Markup, mut figures: Vec<Figure>, warnings: &[Warning], origin: &Origin) -> String {
    fit(figures.iter_mut());
    let of_warnings = html! {
        @if warnings.is_empty() { p { "Nothing." } }
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
        (hashes(&origin.inputs_sha256))
    };
    let all = html! {
        h1 { (title) }
        (body)
        @for drawing in &figures { (figure(drawing, "")) }
        (section("warned", "Everything that was warned of", &of_warnings))
        (section("origin", "Where this page comes from", &of_origin))
    };
    page(&format!("{title} – vitreo-uq"), &all)
}
