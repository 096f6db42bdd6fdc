//! Figure of a comparison of base laws: the evidence of each law beside its error on the last cycle.

use super::axes::title_with_text;
use super::number::{format_decimals, format_significant};
use super::palette::{BLUE, GRID, INK, MUTED, SKY};
use super::svg::{Anchor, Fill, Rect, Stroke, Svg, TextStyle};
use documents::laws::{LawComparison, LawRow, LawStatus};

const WIDTH_PX: f64 = 900.0;
const MARGIN_PX: f64 = 20.0;
const LABEL_PX: f64 = 190.0;
const BAR_PX: f64 = 330.0;
const ROW_PX: f64 = 30.0;
const TEXT_PX: f64 = 13.0;
/// Difference of log evidences at the end of the bars, in nats. Laws beyond it are equally hopeless.
const LONGEST_NATS: f64 = 50.0;
/// Heads of the columns of numbers, and their right ends. Errors have a unit.
const NUMBERS: [(&str, f64); 3] = [("nats", 600.0), ("fitted", 720.0), ("held out", 860.0)];

/// Draws one row for each law. A bar shows by how much its log evidence is below that of the likeliest law.
pub fn laws(comparison: &LawComparison) -> Svg {
    let heading = format!("{}: laws compared", comparison.experiment);
    let draw = |svg: &mut Svg| {
        let width = WIDTH_PX - 2.0 * MARGIN_PX;
        let top =
            MARGIN_PX + title_with_text(svg, &heading, &comparison.sentence, (MARGIN_PX, MARGIN_PX), width) + 26.0;
        let small = |anchor| TextStyle::new(TEXT_PX, anchor).colour(MUTED);
        let has_evidence = comparison.laws.iter().any(|law| law.evidence_difference_nats.is_some());
        let of_bars =
            if has_evidence { "log evidence below the likeliest law" } else { "error relative to the largest" };
        let largest = comparison.laws.iter().filter_map(LawRow::ranking_error).fold(0.0_f64, f64::max);
        svg.text(of_bars, (MARGIN_PX + LABEL_PX, top - 8.0), small(Anchor::Start));
        for (words, right) in NUMBERS {
            let unit = if words == "nats" { String::new() } else { format!(" ({})", comparison.error_unit()) };
            svg.text(&format!("{words}{unit}"), (right, top - 8.0), small(Anchor::End));
        }
        for (place, law) in comparison.laws.iter().enumerate() {
            row(svg, law, (has_evidence, largest), top + ROW_PX * place as f64);
        }
        top + ROW_PX * comparison.laws.len() as f64 + MARGIN_PX
    };
    Svg::drawn(WIDTH_PX, &heading, 0.0, draw)
}

fn row(svg: &mut Svg, law: &LawRow, (has_evidence, largest): (bool, f64), top: f64) {
    let baseline = top + 0.65 * ROW_PX;
    let ink = if law.status == LawStatus::NotCompared { MUTED } else { INK };
    svg.text(&law.law, (MARGIN_PX, baseline), TextStyle::new(TEXT_PX, Anchor::Start).colour(ink));
    svg.line((MARGIN_PX, top + ROW_PX), (WIDTH_PX - MARGIN_PX, top + ROW_PX), Stroke::solid(GRID, 1.0));
    let left = MARGIN_PX + LABEL_PX;
    let part = match law.evidence_difference_nats {
        Some(difference) => Some((-difference / LONGEST_NATS).clamp(0.0, 1.0)),
        None => law.ranking_error().filter(|_| !has_evidence).map(|error| error / largest),
    };
    let Some(part) = part else {
        svg.text(law.status.text(), (left, baseline), TextStyle::new(TEXT_PX, Anchor::Start).colour(MUTED));
        return;
    };
    let colour = if matches!(law.status, LawStatus::LessLikely | LawStatus::FartherOff) { SKY } else { BLUE };
    // The likeliest law has a difference of 0, which still needs a mark.
    let bar = Rect { x: left, y: top + 0.25 * ROW_PX, width: (BAR_PX * part).max(3.0), height: 0.5 * ROW_PX };
    svg.rect(bar, Fill::new(colour, 1.0));
    let error = |value: Option<f64>| value.map_or("–".into(), |value| format_significant(value, 3));
    let nats = law.evidence_difference_nats.map_or("–".into(), |difference| format_decimals(difference, 1));
    let [fitted, heldout] = law.errors().map(error);
    let texts = [nats, fitted, heldout];
    for ((_, right), text) in NUMBERS.iter().zip(texts) {
        svg.text(&text, (*right, baseline), TextStyle::new(TEXT_PX, Anchor::End));
    }
}
