//! Figure of a ladder, which compares the revisions of a study: fitted and held-out errors beside the noise, and the posterior of every parameter in each
//! revision.

use super::axes::{Axes, AxisStyle, TICK_SIZE_PX, title_with_text};
use super::font::{shorten, wrapped};
use super::labels::parameter_label;
use super::legend::{self, Entry, Mark};
use super::number::{format_ranges, format_significant};
use super::palette::{BLUE, Colour, GRID, INK, MUTED, SKY, VERMILLION};
use super::svg::{Anchor, Fill, Path, Rect, Stroke, Style, Svg, TextStyle};
use super::ticks::AxisScale;
use crate::labels::{effects_with, model_title};
use base::error::InputPlace;
use base::{Error, Result};
use documents::ladder::{LadderParameter, LadderRow, LadderSummary};

const WIDTH_PX: f64 = 960.0;
const MARGIN_PX: f64 = 20.0;
const LABEL_PX: f64 = 200.0;
/// Heads of the columns of numbers beside the bars.
const NUMBERS: [&str; 3] = ["held out (µm)", "fitted (µm)", "log score (nats)"];
const NUMBER_PX: f64 = 104.0;
const ROW_PX: f64 = 64.0;
const HELDOUT_BAR_PX: f64 = 20.0;
const FITTED_BAR_PX: f64 = 10.0;
/// Maximum number of parameter panels side by side.
const PANELS: usize = 3;
const PANEL_GAP_PX: f64 = 62.0;
const PANEL_ROW_PX: f64 = 24.0;
const PANEL_FOOT_PX: f64 = 58.0;

const NOISE: Stroke = Stroke { colour: VERMILLION, width_px: 1.8, opacity: 1.0, dash: Some((6.0, 4.0)) };
const FITTED: Colour = SKY;
const HELDOUT: Colour = BLUE;
/// Fill of the area that shows by how much a revision's error is smaller than the error of the revision it extends.
const REMOVED: Fill = Fill { colour: GRID, opacity: 1.0 };

/// Draws the figure of a ladder.
///
/// # Errors
/// [`Error::Input`] for a ladder without revisions.
pub fn ladder(summary: &LadderSummary) -> Result<Svg> {
    if summary.revisions.is_empty() {
        return Err(Error::input(
            InputPlace::default().at_key("revisions"),
            "the ladder has no revisions",
            "run `sample` first",
        ));
    }
    let heading = format!("{}: how the error fell", summary.experiment);
    let width = WIDTH_PX - 2.0 * MARGIN_PX;
    let draw = |svg: &mut Svg| {
        let below = MARGIN_PX + title_with_text(svg, &heading, &summary.sentence, (MARGIN_PX, MARGIN_PX), width) + 10.0;
        let below = below + legend::row(svg, &entries(summary), (MARGIN_PX, below), width) + 8.0;
        let below = waterfall(svg, summary, below);
        parameters(svg, summary, below)
    };
    Ok(Svg::drawn(WIDTH_PX, &heading, 4.0, draw))
}

fn entries(summary: &LadderSummary) -> Vec<Entry> {
    let area = |colour| Mark::Area(Fill::new(colour, 1.0).into());
    let mut entries = Vec::new();
    if !summary.heldout_cycles.is_empty() {
        entries
            .push(Entry::new(area(HELDOUT), format!("last held-out cycle {}", format_ranges(&summary.heldout_cycles))));
    }
    entries.push(Entry::new(area(FITTED), format!("fitted cycles {}", format_ranges(&summary.fitted_cycles))));
    if summary.revisions.len() > 1 && !summary.heldout_cycles.is_empty() {
        entries.push(Entry::new(Mark::Area(REMOVED.into()), "removed by the added effect"));
    }
    if let Some(noise) = summary.noise_um {
        let text = format!("noise {} µm ({})", format_significant(noise, 3), summary.noise_origin);
        entries.push(Entry::new(Mark::Line(NOISE), text));
    }
    entries
}

/// Revision that `rung` extends; `None` for the first.
fn parent<'a>(summary: &'a LadderSummary, rung: &LadderRow) -> Option<&'a LadderRow> {
    let from = rung.from.as_ref()?;
    summary.revisions.iter().find(|other| other.revision == *from)
}

/// Draws the errors of all revisions as bars, with the upper edge at `top`. Returns the position of the lower edge.
fn waterfall(svg: &mut Svg, summary: &LadderSummary, top: f64) -> f64 {
    let rungs = &summary.revisions;
    let largest = rungs
        .iter()
        .flat_map(|rung| [Some(rung.rmse_fitted_um), rung.rmse_heldout_um])
        .chain([summary.noise_um])
        .flatten()
        .fold(0.0, f64::max);
    let numbers_px = NUMBER_PX * NUMBERS.len() as f64;
    let frame = Rect {
        x: MARGIN_PX + LABEL_PX,
        y: top + 20.0,
        width: WIDTH_PX - 2.0 * MARGIN_PX - LABEL_PX - numbers_px,
        height: ROW_PX * rungs.len() as f64,
    };
    let axes = Axes { frame, x: AxisScale::linear(0.0, 1.04 * largest), y: AxisScale::linear(0.0, 1.0) };
    axes.x_axis(svg, AxisStyle::new(Some("root mean square error (µm)"), 8, 36.0).grid());
    for (k, title) in NUMBERS.iter().enumerate() {
        let at = (frame.right() + NUMBER_PX * (k + 1) as f64, top + 12.0);
        svg.text(title, at, TextStyle::new(TICK_SIZE_PX, Anchor::End).colour(MUTED));
    }
    for (k, rung) in rungs.iter().enumerate() {
        let row = Rect { y: frame.y + ROW_PX * k as f64, height: ROW_PX, ..frame };
        bars(svg, &axes, summary, rung, row);
        label(svg, rung, row);
        numbers(svg, rung, row);
    }
    if let Some(noise) = summary.noise_um {
        axes.vertical(svg, noise, NOISE);
    }
    axes.outline(svg);
    frame.bottom() + 52.0
}

fn bars(svg: &mut Svg, axes: &Axes, summary: &LadderSummary, rung: &LadderRow, row: Rect) {
    let bar = |y: f64, height: f64, from: f64, to: f64| Rect {
        x: axes.x_px(from),
        y,
        width: axes.x_px(to) - axes.x_px(from),
        height,
    };
    let upper = row.y + 0.5 * (row.height - HELDOUT_BAR_PX - FITTED_BAR_PX - 3.0);
    if let Some(heldout) = rung.rmse_heldout_um {
        let before = parent(summary, rung).and_then(|parent| parent.rmse_heldout_um).filter(|before| *before > heldout);
        if let Some(before) = before {
            let removed = bar(upper, HELDOUT_BAR_PX, heldout, before);
            svg.rect(removed, REMOVED);
            // A line leads from the end of the bar above to this bar.
            let (x, end) = (removed.right(), removed.bottom());
            svg.line((x, end - ROW_PX), (x, end), Stroke::solid(MUTED, 1.0).dashed(2.0, 3.0));
            let percent = format!("−{:.0} %", 100.0 * (1.0 - heldout / before));
            let style = TextStyle::new(TICK_SIZE_PX, Anchor::Middle);
            if removed.width > 50.0 {
                svg.text(&percent, (removed.x + removed.width / 2.0, removed.y + 14.0), style);
            }
        }
        svg.rect(bar(upper, HELDOUT_BAR_PX, 0.0, heldout), Fill::new(HELDOUT, 1.0));
    }
    svg.rect(bar(upper + HELDOUT_BAR_PX + 3.0, FITTED_BAR_PX, 0.0, rung.rmse_fitted_um), Fill::new(FITTED, 1.0));
}

/// Writes the label of a revision: the model for the first revision, the added effects for the others.
fn label(svg: &mut Svg, rung: &LadderRow, row: Rect) {
    let words = match &rung.from {
        None => model_title(&rung.model),
        Some(from) => format!("{from}{}", effects_with(&rung.added, &rung.equivalents)),
    };
    let room = LABEL_PX - 50.0;
    let lines: Vec<String> = wrapped(&words, 12.0, room).into_iter().take(3).collect();
    let middle = row.y + row.height / 2.0;
    svg.text(&rung.revision, (MARGIN_PX, middle + 5.0), TextStyle::new(15.0, Anchor::Start));
    for (i, line) in lines.iter().enumerate() {
        let baseline = middle + 4.0 + 15.0 * (i as f64 - 0.5 * (lines.len() as f64 - 1.0));
        svg.text(line, (MARGIN_PX + 40.0, baseline), TextStyle::new(12.0, Anchor::Start));
    }
}

fn numbers(svg: &mut Svg, rung: &LadderRow, row: Rect) {
    let value = |value: Option<f64>| value.map_or("–".into(), |value| format_significant(value, 3));
    let score = rung.heldout_log_score_nats.map_or("–".into(), |score| super::number::format_decimals(score, 1));
    let middle = row.y + row.height / 2.0;
    for (k, text) in [value(rung.rmse_heldout_um), value(Some(rung.rmse_fitted_um)), score].iter().enumerate() {
        let at = (row.right() + NUMBER_PX * (k + 1) as f64, middle + 4.0);
        svg.text(text, at, TextStyle::new(12.0, Anchor::End));
    }
    if !rung.converged {
        let at = (row.right() + NUMBER_PX * NUMBERS.len() as f64, middle + 20.0);
        svg.text("not converged", at, TextStyle::new(TICK_SIZE_PX, Anchor::End).colour(VERMILLION));
    }
}

/// Draws one panel per parameter, with its posterior median and 90 % interval in each revision. Returns the position of the lower edge.
fn parameters(svg: &mut Svg, summary: &LadderSummary, top: f64) -> f64 {
    let mut names: Vec<&str> = Vec::new();
    for parameter in summary.revisions.iter().flat_map(|rung| &rung.parameters) {
        if !names.contains(&parameter.name.as_str()) {
            names.push(&parameter.name);
        }
    }
    let text = "Posteriors: median and 90 % interval in each revision";
    svg.text(text, (MARGIN_PX, top + 14.0), TextStyle::new(13.0, Anchor::Start));
    let top = top + 28.0;
    let n_columns = names.len().clamp(1, PANELS);
    let width = (WIDTH_PX - 2.0 * MARGIN_PX) / n_columns as f64 - PANEL_GAP_PX;
    let height = PANEL_ROW_PX * summary.revisions.len() as f64;
    for (k, name) in names.iter().enumerate() {
        let frame = Rect {
            x: MARGIN_PX + 40.0 + (k % n_columns) as f64 * (width + PANEL_GAP_PX),
            y: top + (k / n_columns) as f64 * (height + PANEL_FOOT_PX),
            width,
            height,
        };
        panel(svg, summary, name, frame);
    }
    top + names.len().div_ceil(n_columns) as f64 * (height + PANEL_FOOT_PX)
}

fn panel(svg: &mut Svg, summary: &LadderSummary, name: &str, frame: Rect) {
    let find = |rung: &'_ LadderRow| rung.parameters.iter().find(|p| p.name == name).cloned();
    let found: Vec<Option<LadderParameter>> = summary.revisions.iter().map(find).collect();
    let ends = found.iter().flatten().flat_map(|p| [p.q05, p.q95]);
    let axes = Axes { frame, x: AxisScale::over(ends, 0.08), y: AxisScale::linear(0.0, 1.0) };
    let label = parameter_label(name).axis();
    axes.x_axis(svg, AxisStyle::new(Some(&label), 5, 36.0).grid());
    let last = found.len() - 1;
    for (k, (rung, parameter)) in summary.revisions.iter().zip(&found).enumerate() {
        let y = frame.y + PANEL_ROW_PX * (k as f64 + 0.5);
        let text = shorten(&rung.revision, TICK_SIZE_PX, 34.0);
        let colour = if parameter.is_some() { INK } else { MUTED };
        svg.text(&text, (frame.x - 6.0, y + 4.0), TextStyle::new(TICK_SIZE_PX, Anchor::End).colour(colour));
        let Some(p) = parameter else { continue };
        let colour = if k == last { HELDOUT } else { MUTED };
        svg.line((axes.x_px(p.q05), y), (axes.x_px(p.q95), y), Stroke::solid(colour, 2.2));
        let mut ends = Path::default();
        for end in [p.q05, p.q95] {
            ends.move_to((axes.x_px(end), y - 4.0));
            ends.line_to((axes.x_px(end), y + 4.0));
        }
        svg.path(&ends, Stroke::solid(colour, 1.6));
        let style =
            Style { fill: Some(Fill::new(colour, 1.0)), stroke: Some(Stroke::solid(super::palette::WHITE, 1.0)) };
        svg.circle((axes.x_px(p.median), y), 4.6, style);
    }
    axes.outline(svg);
}
