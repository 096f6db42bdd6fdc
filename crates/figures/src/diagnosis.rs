//! Figure of a diagnosis. It shows the gain of each candidate effect in the fit and on held-out cycles, and the errors of the base and extended model.

use super::axes::{Axes, AxisStyle, TICK_SIZE_PX, title_with_text};
use super::font::{shorten, text_width_px, wrapped};
use super::legend::{self, Entry, Mark};
use super::number::{format_decimals, format_ranges, format_significant};
use super::palette::{AXIS, BLUE, Colour, GREEN, GRID, INK, MUTED, ORANGE, PALE, PURPLE, SKY, VERMILLION, WHITE};
use super::svg::{Anchor, Fill, Rect, Stroke, Style, Svg, TextStyle};
use super::ticks::AxisScale;
use base::Result;
use documents::diagnosis::{CandidateEntry, Diagnosis, Status};

const WIDTH_PX: f64 = 980.0;
const MARGIN_PX: f64 = 20.0;
const BRACKET_PX: f64 = 24.0;
const LABEL_PX: f64 = 206.0;
/// Headings and widths (pixels) of the columns of text beside the bars.
const COLUMNS: [(&str, f64); 4] = [("status", 142.0), ("score z", 62.0), ("p", 62.0), ("visible", 62.0)];
const ROW_PX: f64 = 31.0;
const FIT_BAR_PX: f64 = 12.0;
const HELDOUT_BAR_PX: f64 = 7.0;
const SECTION_PX: f64 = 26.0;
/// Minimum held-out gain (nats) of an effect that is claimed.
const CLAIM_NATS: f64 = 2.0;
const CLAIM: Stroke = Stroke { colour: INK, width_px: 1.2, opacity: 0.7, dash: Some((5.0, 4.0)) };
const NOISE: Stroke = Stroke { colour: VERMILLION, width_px: 1.8, opacity: 1.0, dash: Some((6.0, 4.0)) };
/// Maximum number of rows for pairs of effects, and maximum number of rows for unexplained misfits.
const MOST_OTHERS: usize = 3;

/// Draws the figure of a diagnosis.
///
/// # Errors
/// None at present; future versions may refuse inconsistent documents.
pub fn diagnosis(diagnosis: &Diagnosis) -> Result<Svg> {
    let heading = format!("{}: which effect is missing?", diagnosis.experiment);
    let width = WIDTH_PX - 2.0 * MARGIN_PX;
    let bars = Bars::of(diagnosis);
    let draw = |svg: &mut Svg| {
        let text = &diagnosis.verdict.sentence;
        let below = MARGIN_PX + title_with_text(svg, &heading, text, (MARGIN_PX, MARGIN_PX), width) + 12.0;
        let below = below + legend::row(svg, &entries(diagnosis), (MARGIN_PX, below), width) + 10.0;
        let below = bars.draw(svg, below);
        errors(svg, diagnosis, below)
    };
    Ok(Svg::drawn(WIDTH_PX, &heading, MARGIN_PX, draw))
}

/// Colour and displayed name of an effect's status.
fn status_style(status: Status) -> (Colour, &'static str) {
    match status {
        Status::Claimed => (GREEN, "claimed"),
        Status::Equivalent => (SKY, "equivalent"),
        Status::Suggestive => (ORANGE, "suggestive"),
        Status::Unsupported => (MUTED, "weaker, or chance"),
        Status::Invisible => (PALE, "invisible"),
    }
}

fn entries(diagnosis: &Diagnosis) -> Vec<Entry> {
    let is_there = |status: &Status| diagnosis.candidates.iter().any(|c| c.status == *status && c.refit.is_some());
    let all = [Status::Claimed, Status::Equivalent, Status::Suggestive, Status::Unsupported, Status::Invisible];
    let of_status = |status| {
        let (colour, name) = status_style(status);
        Entry::new(Mark::Area(Fill::new(colour, 1.0).into()), name)
    };
    let mut entries: Vec<Entry> = all.into_iter().filter(is_there).map(of_status).collect();
    // These marks have a colour that no status has.
    entries.push(Entry::new(Mark::Area(Fill::new(INK, 1.0).into()), "thick: gain in fit"));
    let outlined = Style { fill: Some(Fill::new(WHITE, 1.0)), stroke: Some(Stroke::solid(INK, 1.4)) };
    entries.push(Entry::new(Mark::Area(outlined), "outlined: gain on held-out cycles"));
    entries.push(Entry::new(Mark::Line(CLAIM), format!("{CLAIM_NATS:.0} nats: minimum held-out gain of a claim")));
    entries
}

/// Row of the bar chart: one candidate effect or pair of effects.
struct CandidateRow {
    label: String,
    /// Text below the row's label, in several lines if needed.
    detail: String,
    colour: Colour,
    gain_nats: Option<f64>,
    heldout_gain_nats: Option<f64>,
    columns: [String; COLUMNS.len()],
    /// Text that replaces the bars if there is no gain to draw.
    instead: String,
    /// Text below the bars.
    note: String,
}

/// All rows of the bar chart, in sections.
struct Bars {
    /// Heading and rows of each section. The first section has no heading.
    sections: Vec<(&'static str, Vec<CandidateRow>)>,
    /// Number of rows with claimed or equivalent effects, which come first in the first section. A bracket joins them. The number is 0 if no effect is
    /// equivalent to a claimed effect.
    n_equivalent_rows: usize,
    /// Smallest and largest gain (nats) over all rows, in the fit and on held-out cycles.
    range_nats: [f64; 2],
}

impl Bars {
    fn of(diagnosis: &Diagnosis) -> Self {
        let mut candidates: Vec<&CandidateEntry> = diagnosis.candidates.iter().collect();
        let is_in_class = |c: &&CandidateEntry| matches!(c.status, Status::Claimed | Status::Equivalent);
        let gain = |c: &CandidateEntry| c.refit.as_ref().map_or(f64::NEG_INFINITY, |refit| refit.gain_nats);
        candidates.sort_by(|a, b| is_in_class(b).cmp(&is_in_class(a)).then(gain(b).total_cmp(&gain(a))));
        let has_twins = diagnosis.candidates.iter().any(|c| c.status == Status::Equivalent);
        let n_equivalent_rows = if has_twins { candidates.iter().filter(|c| is_in_class(c)).count() } else { 0 };
        let mut sections =
            vec![("", candidates.into_iter().map(|candidate| candidate_row(diagnosis, candidate)).collect())];
        sections.push(("pairs of effects", pair_rows(diagnosis)));
        sections.push(("outside the library", unexplained_rows(diagnosis)));
        sections.retain(|(_, rows)| !rows.is_empty());
        let gains = || {
            let rows = sections.iter().flat_map(|(_, rows)| rows);
            rows.flat_map(|row| [row.gain_nats, row.heldout_gain_nats]).flatten().filter(|gain| gain.is_finite())
        };
        let range_nats = [gains().fold(0.0, f64::min), gains().fold(10.0, f64::max)];
        Self { sections, n_equivalent_rows, range_nats }
    }

    /// Draws all sections, with the upper edge at `top`. Returns the position of the lower edge.
    fn draw(&self, svg: &mut Svg, top: f64) -> f64 {
        let n_headings = self.sections.iter().filter(|(heading, _)| !heading.is_empty()).count();
        let columns_px: f64 = COLUMNS.iter().map(|column| column.1).sum();
        let left = MARGIN_PX + BRACKET_PX + LABEL_PX;
        let width = WIDTH_PX - MARGIN_PX - left - columns_px;
        let heights: f64 = self.sections.iter().flat_map(|(_, rows)| rows).map(|row| row.height_px(width)).sum();
        let frame = Rect { x: left, y: top + 20.0, width, height: heights + SECTION_PX * n_headings as f64 };
        let [least, largest] = self.range_nats.map(compress_gain);
        let pad = 0.03 * (largest - least);
        let lower = if least < 0.0 { least - pad } else { 0.0 };
        let axes = Axes { frame, x: AxisScale::linear(lower, largest + pad), y: AxisScale::linear(0.0, 1.0) };
        gain_axis(svg, &axes, self.range_nats);
        let mut x = frame.right();
        for (title, width) in COLUMNS {
            x += width;
            svg.text(title, (x, top + 12.0), TextStyle::new(TICK_SIZE_PX, Anchor::End).colour(MUTED));
        }
        let mut y = frame.y;
        for (heading, rows) in &self.sections {
            if !heading.is_empty() {
                svg.line((MARGIN_PX, y), (WIDTH_PX - MARGIN_PX, y), Stroke::solid(GRID, 1.0));
                let style = TextStyle::new(TICK_SIZE_PX, Anchor::Start).colour(MUTED);
                svg.text(heading, (MARGIN_PX + BRACKET_PX, y + 17.0), style);
                y += SECTION_PX;
            }
            for row in rows {
                let height = row.height_px(width);
                row.draw(svg, &axes, Rect { y, height, ..frame });
                y += height;
            }
        }
        axes.vertical(svg, 0.0, Stroke::solid(AXIS, 1.0));
        axes.vertical(svg, compress_gain(CLAIM_NATS), CLAIM);
        let mut y = frame.y;
        for (heading, rows) in &self.sections {
            y += if heading.is_empty() { 0.0 } else { SECTION_PX };
            for row in rows {
                let height = row.height_px(width);
                row.draw_notes(svg, Rect { y, height, ..frame });
                y += height;
            }
        }
        axes.outline(svg);
        if self.n_equivalent_rows > 1 {
            let class = self.sections.iter().flat_map(|(_, rows)| rows).take(self.n_equivalent_rows);
            bracket(svg, frame.y + 5.0, frame.y + class.map(|row| row.height_px(width)).sum::<f64>() - 5.0);
        }
        frame.bottom() + 56.0
    }
}

/// Draws a bracket beside the rows of equivalent effects.
fn bracket(svg: &mut Svg, top: f64, bottom: f64) {
    let (x, stroke) = (MARGIN_PX + BRACKET_PX - 6.0, Stroke::solid(INK, 1.4));
    svg.line((x, top), (x, bottom), stroke);
    for y in [top, bottom] {
        svg.line((x, y), (x + 5.0, y), stroke);
    }
    let room = bottom - top;
    let words = ["equivalent effects", "equivalent", "equiv."];
    let words = words.into_iter().find(|words| text_width_px(words, TICK_SIZE_PX) <= room).unwrap_or("");
    let style = TextStyle::new(TICK_SIZE_PX, Anchor::Middle).upwards();
    svg.text(words, (x - 5.0, 0.5 * (top + bottom)), style);
}

/// Compresses a gain g to sign(g) log₁₀(1 + |g|). One axis can then show losses, and gains from tenths to thousands of nats.
fn compress_gain(gain_nats: f64) -> f64 {
    gain_nats.signum() * gain_nats.abs().ln_1p() / std::f64::consts::LN_10
}

fn gain_axis(svg: &mut Svg, axes: &Axes, [least, largest]: [f64; 2]) {
    let powers = (0..9).map(|n| 10f64.powi(n)).filter(|power| *power <= 1.05 * largest.max(-least));
    let marks = powers.flat_map(|power| [power, -power]).chain([0.0]);
    let bottom = axes.frame.bottom();
    let mut previous_end = f64::NEG_INFINITY;
    let mut marks: Vec<f64> =
        marks.filter(|mark| (0.0..=1.0).contains(&axes.x.fraction(compress_gain(*mark)))).collect();
    marks.sort_by(f64::total_cmp);
    for mark in marks {
        let x = axes.x_px(compress_gain(mark));
        svg.line((x, axes.frame.y), (x, bottom), Stroke::solid(GRID, 0.8));
        svg.line((x, bottom), (x, bottom - 5.0), Stroke::solid(AXIS, 1.0));
        let label = format_decimals(mark, 0);
        let half = 0.5 * text_width_px(&label, TICK_SIZE_PX);
        if x - half > previous_end + 6.0 {
            svg.text(&label, (x, bottom + 15.0), TextStyle::new(TICK_SIZE_PX, Anchor::Middle));
            previous_end = x + half;
        }
    }
    let at = (axes.frame.x + 0.5 * axes.frame.width, bottom + 35.0);
    let label = "gain over the base model (nats, logarithmic beyond ±1)";
    svg.text(label, at, TextStyle::new(13.0, Anchor::Middle));
}

/// Font size of the texts below a label and below a bar, in pixels.
const SMALL_PX: f64 = 10.0;
const SMALL_PITCH_PX: f64 = 12.5;

impl CandidateRow {
    fn details(&self) -> Vec<String> {
        wrapped(&self.detail, SMALL_PX, LABEL_PX - 10.0)
    }

    fn notes(&self, width_px: f64) -> Vec<String> {
        wrapped(&self.note, SMALL_PX, width_px - 16.0)
    }

    /// Height of the row in pixels, if its frame has the width `width_px`.
    fn height_px(&self, width_px: f64) -> f64 {
        let (details, notes) = (self.details().len(), self.notes(width_px).len());
        let below = |lines: usize, first: f64| if lines == 0 { 0.0 } else { first + SMALL_PITCH_PX * lines as f64 };
        ROW_PX.max(below(details, 18.0)).max(below(notes, FIT_BAR_PX + 10.0))
    }

    /// Height in pixels below the thick bar: that of the note, or of the thin held-out bar if there is no note.
    fn room_below_px(&self, width_px: f64) -> f64 {
        match self.notes(width_px).len() {
            0 => HELDOUT_BAR_PX + 2.0,
            n => 4.0 + SMALL_PITCH_PX * n as f64,
        }
    }

    /// Writes the note below the bar, on a white ground that covers the lines behind it.
    fn draw_notes(&self, svg: &mut Svg, row: Rect) {
        let top = row.y + 0.5 * (row.height - FIT_BAR_PX - self.room_below_px(row.width)) + FIT_BAR_PX;
        for (k, line) in (1..).zip(&self.notes(row.width)) {
            let (x, baseline) = (row.x + 8.0, top + SMALL_PITCH_PX * f64::from(k));
            let behind = Rect {
                x: x - 2.0,
                y: baseline - SMALL_PX,
                width: text_width_px(line, SMALL_PX) + 4.0,
                height: SMALL_PITCH_PX,
            };
            svg.rect(behind, Fill::new(WHITE, 1.0));
            svg.text(line, (x, baseline), TextStyle::new(SMALL_PX, Anchor::Start).colour(MUTED));
        }
    }

    fn draw(&self, svg: &mut Svg, axes: &Axes, row: Rect) {
        let (middle, right) = (row.y + 0.5 * row.height, axes.frame.x - 8.0);
        let details = self.details();
        let baseline = middle + 4.0 - 0.5 * SMALL_PITCH_PX * details.len() as f64;
        svg.text(&shorten(&self.label, 12.0, LABEL_PX - 10.0), (right, baseline), TextStyle::new(12.0, Anchor::End));
        for (k, line) in (1..).zip(&details) {
            let at = (right, baseline + SMALL_PITCH_PX * f64::from(k));
            svg.text(line, at, TextStyle::new(SMALL_PX, Anchor::End).colour(MUTED));
        }
        let bar = |y: f64, height: f64, gain_nats: f64| {
            let (from, to) = (axes.x_px(0.0), axes.x_px(compress_gain(gain_nats)));
            Rect { x: from.min(to), y, width: (to - from).abs().max(1.0), height }
        };
        let upper = middle - 0.5 * (FIT_BAR_PX + self.room_below_px(axes.frame.width));
        if let Some(gain) = self.gain_nats.filter(|gain| gain.is_finite()) {
            svg.rect(bar(upper, FIT_BAR_PX, gain), Fill::new(self.colour, 1.0));
        }
        if let Some(gain) = self.heldout_gain_nats.filter(|gain| gain.is_finite()) {
            let style = Style { fill: Some(Fill::new(WHITE, 1.0)), stroke: Some(Stroke::solid(self.colour, 1.4)) };
            svg.rect(bar(upper + FIT_BAR_PX + 2.0, HELDOUT_BAR_PX, gain), style);
        }
        let start = axes.x_px(compress_gain(CLAIM_NATS)) + 8.0;
        let lines = wrapped(&self.instead, SMALL_PX, axes.frame.right() - start - 6.0);
        for (i, line) in lines.iter().take(2).enumerate() {
            let baseline = middle + 4.0 + 12.0 * (i as f64 - 0.5 * (lines.len().min(2) as f64 - 1.0));
            svg.text(line, (start, baseline), TextStyle::new(SMALL_PX, Anchor::Start).colour(MUTED));
        }
        let mut x = axes.frame.right();
        for (text, (_, width)) in self.columns.iter().zip(COLUMNS) {
            x += width;
            let text = shorten(text, TICK_SIZE_PX, width - 4.0);
            svg.text(&text, (x, middle + 4.0), TextStyle::new(TICK_SIZE_PX, Anchor::End));
        }
    }
}

fn candidate_row(diagnosis: &Diagnosis, candidate: &CandidateEntry) -> CandidateRow {
    let (colour, _) = status_style(candidate.status);
    let refit = candidate.refit.as_ref();
    let detail =
        if candidate.twins.is_empty() { String::new() } else { format!("like {}", candidate.twins.join(", ")) };
    let number = |shown: bool, text: String| if shown { text } else { "–".into() };
    let is_refused = candidate.refused.is_some();
    CandidateRow {
        label: candidate.effect.clone(),
        detail,
        colour,
        gain_nats: refit.map(|refit| refit.gain_nats),
        heldout_gain_nats: refit.and_then(|refit| refit.heldout_gain_nats),
        columns: [
            diagnosis.status_words(candidate).into(),
            number(candidate.z.is_finite() && !is_refused, format_decimals(candidate.z, 1)),
            number(refit.is_some() && candidate.p_familywise.is_finite(), probability(candidate.p_familywise)),
            number(candidate.visible_fraction.is_finite() && !is_refused, percent(candidate.visible_fraction)),
        ],
        instead: candidate.refused.clone().unwrap_or_default(),
        note: String::new(),
    }
}

fn pair_rows(diagnosis: &Diagnosis) -> Vec<CandidateRow> {
    let row = |pair: &documents::diagnosis::PairEntry| {
        let is_claimed =
            pair.effects.len() > 1 && pair.effects.iter().all(|slug| diagnosis.verdict.effects.contains(slug));
        let (colour, name) = if is_claimed { status_style(Status::Claimed) } else { (MUTED, "") };
        CandidateRow {
            label: pair.effects.first().cloned().unwrap_or_default(),
            detail: pair.effects.get(1).map_or(String::new(), |slug| format!("+ {slug}")),
            colour,
            gain_nats: Some(pair.gain_nats),
            heldout_gain_nats: pair.heldout_gain_nats,
            columns: [name.into(), String::new(), String::new(), String::new()],
            instead: String::new(),
            note: String::new(),
        }
    };
    diagnosis.pairs.iter().take(MOST_OTHERS).map(row).collect()
}

fn unexplained_rows(diagnosis: &Diagnosis) -> Vec<CandidateRow> {
    let row = |entry: &documents::diagnosis::UnexplainedMisfit| CandidateRow {
        label: entry.kind.clone(),
        detail: String::new(),
        colour: PURPLE,
        gain_nats: Some(entry.gain_nats),
        heldout_gain_nats: None,
        columns: ["unexplained".into(), String::new(), probability(entry.p_familywise), String::new()],
        instead: String::new(),
        note: entry.sentence.clone(),
    };
    diagnosis.unexplained.iter().take(MOST_OTHERS).map(row).collect()
}

fn probability(p: f64) -> String {
    if p < 0.001 { "< 0.001".into() } else { format_decimals(p, if p < 0.1 { 3 } else { 2 }) }
}

fn percent(fraction: f64) -> String {
    if fraction > 0.0 && fraction < 0.001 {
        "< 0.1 %".into()
    } else {
        format!("{} %", format_significant(100.0 * fraction, 2))
    }
}

/// Draws the errors of the base model and the extended model with the noise, with the upper edge at `top`. Returns the position of the lower edge.
fn errors(svg: &mut Svg, diagnosis: &Diagnosis, top: f64) -> f64 {
    let base = &diagnosis.base;
    let mut rows = vec![("base model".to_string(), base.rmse_fitted_um, base.rmse_heldout_um)];
    if let Some(extended) = &diagnosis.extended {
        let with = format!("+ {}", diagnosis.verdict.effects.join(" + "));
        rows.push((with, extended.rmse_fitted_um, extended.rmse_heldout_um));
    }
    let noise_um = base.noise_um;
    let area = |colour| Mark::Area(Fill::new(colour, 1.0).into());
    let mut entries = vec![Entry::new(area(SKY), format!("fitted cycles {}", format_ranges(&diagnosis.fitted_cycles)))];
    if !diagnosis.heldout_cycles.is_empty() {
        entries.insert(
            0,
            Entry::new(area(BLUE), format!("last held-out cycle {}", format_ranges(&diagnosis.heldout_cycles))),
        );
    }
    entries.extend(noise_um.map(|um| Entry::new(Mark::Line(NOISE), format!("noise {} µm", format_significant(um, 3)))));
    let left = MARGIN_PX + BRACKET_PX + LABEL_PX;
    let width = WIDTH_PX - MARGIN_PX - left - 62.0;
    let top = top + legend::row(svg, &entries, (left, top), width) + 4.0;
    let frame = Rect { x: left, y: top, width, height: (ROW_PX + 6.0) * rows.len() as f64 };
    let largest = rows.iter().flat_map(|row| [Some(row.1), row.2]).chain([noise_um]).flatten().fold(0.0, f64::max);
    let axes = Axes { frame, x: AxisScale::linear(0.0, 1.04 * largest), y: AxisScale::linear(0.0, 1.0) };
    axes.x_axis(svg, AxisStyle::new(Some("root mean square error (µm)"), 10, 36.0).grid());
    for (k, (label, fitted, heldout)) in rows.iter().enumerate() {
        let middle = frame.y + (ROW_PX + 6.0) * (k as f64 + 0.5);
        let bar = |y: f64, height: f64, to: f64| Rect { x: frame.x, y, width: axes.x_px(to) - frame.x, height };
        if let Some(heldout) = heldout {
            svg.rect(bar(middle - 12.0, 13.0, *heldout), Fill::new(BLUE, 1.0));
        }
        svg.rect(bar(middle + 3.0, 8.0, *fitted), Fill::new(SKY, 1.0));
        let label = shorten(label, 12.0, LABEL_PX + BRACKET_PX - 10.0);
        svg.text(&label, (frame.x - 8.0, middle + 4.0), TextStyle::new(12.0, Anchor::End));
        let text = format!("{} µm", format_significant(heldout.unwrap_or(*fitted), 3));
        svg.text(&text, (frame.right() + 62.0, middle), TextStyle::new(12.0, Anchor::End));
    }
    if let Some(noise_um) = noise_um {
        axes.vertical(svg, noise_um, NOISE);
    }
    axes.outline(svg);
    frame.bottom() + 44.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Colours of statuses, and of the marks that explain the bars, differ by at least 60 of 255 in one channel.
    #[test]
    fn the_colours_of_the_legend_differ() {
        let statuses =
            [Status::Claimed, Status::Equivalent, Status::Suggestive, Status::Unsupported, Status::Invisible];
        let mut colours: Vec<Colour> = statuses.map(|status| status_style(status).0).to_vec();
        colours.push(INK);
        for (place, one) in colours.iter().enumerate() {
            for other in &colours[..place] {
                let channels = [(one.0, other.0), (one.1, other.1), (one.2, other.2)];
                assert!(channels.iter().any(|(a, b)| a.abs_diff(*b) >= 60), "{one:?} {other:?}");
            }
        }
    }

    #[test]
    fn the_words_of_every_status_fit_into_their_column() {
        // These are the longest texts that `Diagnosis::status_words` returns.
        for words in ["weaker than the claim", "no more than chance", "helps, not enough"] {
            assert_eq!(shorten(words, TICK_SIZE_PX, COLUMNS[0].1 - 4.0), words);
        }
    }
}
