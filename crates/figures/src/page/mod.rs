//! Makes HTML pages that show documents and figures, and compute nothing. Each page is a single file without scripts. It loads nothing else, and prints on A4.

mod sheets;
mod study;

use std::collections::BTreeMap;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::number::format_significant;

pub use sheets::{ChallengeResultsPage, Origin, groups, plays, shapes};
pub use study::{LadderPage, PredictionPage, RevisionPage, StudyPage, study, study_parts};

/// Maximum size of a page in bytes, so that it can be sent by mail.
const MOST_BYTES: usize = 3_000_000;
/// Number of a page's bytes that are reserved for text and tables.
const TEXT_BYTES: usize = 400_000;

/// Style sheet of all pages and of parts of pages.
pub const STYLE: &str = include_str!("style.css");

/// Figure on a page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Figure {
    /// Path of the figure's file in the study.
    pub file: String,
    /// Drawing as SVG; `None` if it was omitted to limit the size of the page.
    pub svg: Option<String>,
}

/// Tone of a verdict. A mark, a word and a colour show it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Tone {
    Sound,
    Doubtful,
    Wrong,
}

impl Tone {
    fn class(self) -> &'static str {
        match self {
            Self::Sound => "sound",
            Self::Doubtful => "doubtful",
            Self::Wrong => "wrong",
        }
    }

    fn mark(self) -> &'static str {
        match self {
            Self::Sound => "✓",
            Self::Doubtful => "?",
            Self::Wrong => "✗",
        }
    }
}

/// Omits the largest figures until the remaining figures fit into a page.
fn drop_largest_figures<'a>(figures: impl Iterator<Item = &'a mut Figure>) {
    let mut figures: Vec<&mut Figure> = figures.collect();
    let size = |figure: &Figure| figure.svg.as_ref().map_or(0, String::len);
    let mut total: usize = figures.iter().map(|figure| size(figure)).sum();
    figures.sort_by_key(|figure| std::cmp::Reverse(size(figure)));
    for figure in figures {
        if total <= MOST_BYTES - TEXT_BYTES {
            break;
        }
        total -= size(figure);
        figure.svg = None;
    }
}

/// HTML of a complete page with this title and body.
fn page(title: &str, body: &Markup) -> String {
    let shell = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body { main { (body) } }
        }
    };
    shell.into_string()
}

/// Section with a heading. The table of contents links to its `id`.
fn section(id: &str, heading: &str, body: &Markup) -> Markup {
    html! { section id=(id) { h2 { (heading) } (body) } }
}

/// Drawing with a caption. The program itself makes the drawing, so its SVG is inserted without escaping.
fn figure(figure: &Figure, caption: &str) -> Markup {
    html! {
        figure {
            @match &figure.svg {
                Some(svg) => (PreEscaped(svg)),
                None => p.left-out { "This figure is omitted to keep the page below 3 MB." },
            }
            figcaption { (caption) @if !caption.is_empty() { " " } "(" code { (figure.file) } ")" }
        }
    }
}

/// Drawing with a caption that is hidden until a reader opens it.
fn folded(drawing: &Figure, caption: &str) -> Markup {
    html! { details { summary { (caption) } (figure(drawing, caption)) } }
}

/// Table of numbers. The first cell of each row is the row's heading.
fn table(caption: &str, heads: &[&str], rows: &[Vec<String>]) -> Markup {
    table_of("", caption, heads, rows)
}

/// Table of numbers whose last two columns are text.
fn table_with_text_columns(caption: &str, heads: &[&str], rows: &[Vec<String>]) -> Markup {
    table_of("ends-in-words", caption, heads, rows)
}

fn table_of(class: &str, caption: &str, heads: &[&str], rows: &[Vec<String>]) -> Markup {
    html! {
        div.scroll {
            table class=[(!class.is_empty()).then_some(class)] {
                caption { (caption) }
                thead { tr { @for head in heads { th scope="col" { (head) } } } }
                tbody {
                    @for row in rows {
                        tr {
                            @for (index, cell) in row.iter().enumerate() {
                                @if index == 0 { th scope="row" { (cell) } } @else { td { (cell) } }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Text of an interval from `low` to `high`.
fn interval(low: f64, high: f64) -> String {
    format!("{} to {}", format_significant(low, 4), format_significant(high, 4))
}

/// Table of the inputs' SHA-256 hashes.
fn input_hash_table(inputs_sha256: &BTreeMap<String, String>) -> Markup {
    let rows: Vec<Vec<String>> = inputs_sha256.iter().map(|(name, hash)| vec![name.clone(), hash.clone()]).collect();
    table("SHA-256 of the inputs", &["input", "SHA-256"], &rows)
}
