//! Failure map of a comparison: the vertical axis is the cycle, and the horizontal axis the time since the last force step. The colour shows the mean residual
//! along the step.

use super::axes::{Axes, AxisStyle, TICK_SIZE_PX, title};
use super::font::text_width_px;
use super::legend::{FULL_COLOUR, signed_colour, signed_colour_bar};
use super::number::format_significant;
use super::palette::{INK, MUTED, WHITE};
use super::svg::{Anchor, Fill, Rect, Stroke, Style, Svg, TextStyle};
use super::ticks::AxisScale;

const WIDTH_PX: f64 = 960.0;
/// Ratio of a mean residual to its standard error above which the mean is written into the cell.
const MARKED: f64 = 3.0;

/// One row of the map: a cycle, limited to its force steps in one direction.
#[derive(Debug, Clone, PartialEq)]
pub struct FailureMapRow {
    /// Name of the row, such as "cycle 2 ↑".
    pub label: String,
    /// True if the cycle is held out.
    pub is_heldout: bool,
    /// Mean residual in each bin of time: in standard errors, and in µm. `None` for bins without measurements.
    pub cells: Vec<Option<(f64, f64)>>,
}

/// Content of the failure map: title, bins of time, and rows.
#[derive(Debug, Clone, Copy)]
pub struct FailureMapData<'a> {
    /// Title of the map.
    pub title: &'a str,
    /// End of each bin of time since the last force step, in s.
    pub lag_ends_s: &'a [f64],
    /// Start of the first bin: shortest time since a force step, in s.
    pub shortest_s: f64,
    /// Rows of the map, from top to bottom.
    pub rows: &'a [FailureMapRow],
}

/// Draws the failure map.
pub fn failure_map(data: &FailureMapData) -> Svg {
    let row_height = if data.rows.len() > 24 { 16.0 } else { 30.0 };
    let widest = data.rows.iter().map(|row| text_width_px(&label(row), TICK_SIZE_PX)).fold(40.0, f64::max);
    let left = widest + 20.0;
    let frame = Rect { x: left, y: 62.0, width: WIDTH_PX - left - 120.0, height: row_height * data.rows.len() as f64 };
    let height = frame.bottom().max(frame.y + 120.0) + 56.0;
    let mut svg = Svg::new(WIDTH_PX, height, "Failure map: cycle against time since the last force step");
    title(&mut svg, data.title, (left, 24.0), frame.width);
    let note =
        "colour: mean residual along the step, in standard errors; numbers: mean in µm, where above 3 standard errors";
    svg.text(note, (left, 46.0), TextStyle::new(TICK_SIZE_PX + 1.0, Anchor::Start).colour(MUTED));
    let last = data.lag_ends_s.last().copied().unwrap_or(1.0);
    let x = AxisScale::log10(data.shortest_s, last);
    let axes = Axes { frame, x, y: AxisScale::linear(0.0, 1.0) };
    for (place, row) in data.rows.iter().enumerate() {
        let strip = Rect { y: frame.y + row_height * place as f64, height: row_height, ..frame };
        draw_row(&mut svg, &axes, data, row, strip);
    }
    frame_heldout(&mut svg, data.rows, frame, row_height);
    axes.x_axis(&mut svg, AxisStyle::new(Some("time since the last force step (s)"), 8, 40.0).overhang_px(16.0));
    axes.outline(&mut svg);
    colour_bar(&mut svg, &frame);
    svg
}

/// Name of a row, with an asterisk if its cycle is held out.
fn label(row: &FailureMapRow) -> String {
    if row.is_heldout { format!("{} *", row.label) } else { row.label.clone() }
}

fn draw_row(svg: &mut Svg, axes: &Axes, data: &FailureMapData, row: &FailureMapRow, strip: Rect) {
    let middle = strip.y + 0.5 * strip.height + 0.36 * TICK_SIZE_PX;
    svg.text(&label(row), (strip.x - 8.0, middle), TextStyle::new(TICK_SIZE_PX, Anchor::End));
    for (k, cell) in row.cells.iter().enumerate() {
        let from = if k == 0 { data.shortest_s } else { data.lag_ends_s[k - 1].max(data.shortest_s) };
        let (x, right) = (axes.x_px(from), axes.x_px(data.lag_ends_s[k]));
        let area = Rect { x, width: right - x, ..strip };
        let Some((score, mean_um)) = cell else {
            svg.rect(area, Fill::new(MUTED, 0.12));
            continue;
        };
        let style =
            Style { fill: Some(Fill::new(signed_colour(*score), 1.0)), stroke: Some(Stroke::solid(WHITE, 0.8)) };
        svg.rect(area, style);
        let text = format_significant(*mean_um, 2);
        // If the noise is correlated, the whitened mean can have the opposite sign. A written number would then contradict its colour.
        if score.abs() > MARKED
            && score * mean_um > 0.0
            && text_width_px(&text, TICK_SIZE_PX) < area.width - 4.0
            && strip.height > 20.0
        {
            let ink = if score.abs() > 0.7 * FULL_COLOUR { WHITE } else { INK };
            let at = (x + 0.5 * area.width, middle);
            svg.text(&text, at, TextStyle::new(TICK_SIZE_PX, Anchor::Middle).colour(ink));
        }
    }
}

/// Draws a frame around each group of adjacent held-out rows.
fn frame_heldout(svg: &mut Svg, rows: &[FailureMapRow], frame: Rect, row_height: f64) {
    let mut first = 0;
    for group in rows.chunk_by(|a, b| a.is_heldout == b.is_heldout) {
        if group[0].is_heldout {
            let area =
                Rect { y: frame.y + row_height * first as f64, height: row_height * group.len() as f64, ..frame };
            svg.rect(area, Style::from(Stroke::solid(INK, 1.6).dashed(5.0, 3.0)));
        }
        first += group.len();
    }
}

fn colour_bar(svg: &mut Svg, frame: &Rect) {
    let axes = signed_colour_bar(svg, frame);
    let bar = axes.frame;
    for (y, text) in
        [(bar.y - 8.0, "bead ahead"), (bar.bottom() + 16.0, "bead lags"), (bar.bottom() + 32.0, "* held out")]
    {
        svg.text(text, (bar.x, y), TextStyle::new(TICK_SIZE_PX, Anchor::Start));
    }
    axes.outline(svg);
}
