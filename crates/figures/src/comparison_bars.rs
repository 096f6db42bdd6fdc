//! Sheet with one panel per test of a comparison. Bars show the bias (mean of measured minus predicted values) in each bin, with its
//! error. Panels of tests that found a misfit are highlighted.

use super::axes::{Axes, AxisStyle, LABEL_SIZE_PX, TICK_SIZE_PX, title};
use super::font::{shorten, text_width_px};
use super::palette::{AXIS, BLUE, INK, MUTED, VERMILLION};
use super::svg::{Anchor, Fill, Rect, Stroke, Style, Svg, TextStyle};
use super::ticks::AxisScale;

const WIDTH_PX: f64 = 1080.0;
const N_COLUMNS: usize = 3;
const PANEL_HEIGHT_PX: f64 = 150.0;
const PITCH_PX: f64 = 236.0;
/// Smallest visible width of a bar, in pixels.
const LEAST_BAR_PX: f64 = 0.7;

/// Panel of one test.
#[derive(Debug, Clone, PartialEq)]
pub struct BarPanel {
    /// Name of the test, with its p.
    pub title: String,
    /// Label of the horizontal axis: the quantity that the bins divide.
    pub x_label: String,
    /// Label of the vertical axis: quantity and unit of the bars.
    pub y_label: String,
    /// True if the test found a misfit.
    pub is_significant: bool,
    /// True if another finding explains this misfit.
    pub is_explained: bool,
    /// Label, height and standard error of each bar.
    pub bars: Vec<(String, f64, f64)>,
}

/// Draws the sheet of all panels under a heading.
pub fn bias_sheet(heading: &str, panels: &[BarPanel]) -> Svg {
    let n_rows = panels.len().div_ceil(N_COLUMNS).max(1);
    let height = 48.0 + PITCH_PX * n_rows as f64;
    let mut svg = Svg::new(WIDTH_PX, height, "Measured minus predicted values in the bins of each test");
    title(&mut svg, heading, (16.0, 26.0), WIDTH_PX - 32.0);
    let pitch = WIDTH_PX / N_COLUMNS as f64;
    for (place, panel) in panels.iter().enumerate() {
        let (row, column) = (place / N_COLUMNS, place % N_COLUMNS);
        let frame = Rect {
            x: pitch * column as f64 + 72.0,
            y: 48.0 + PITCH_PX * row as f64 + 26.0,
            width: pitch - 90.0,
            height: PANEL_HEIGHT_PX,
        };
        draw(&mut svg, panel, frame);
    }
    svg
}

fn draw(svg: &mut Svg, panel: &BarPanel, frame: Rect) {
    let ends = panel.bars.iter().flat_map(|(_, bias, sd)| [bias - 2.0 * sd, bias + 2.0 * sd]);
    let n = panel.bars.len();
    let axes = Axes { frame, x: AxisScale::linear(0.0, n.max(1) as f64), y: AxisScale::over(ends.chain([0.0]), 0.08) };
    let colour = if panel.is_significant { VERMILLION } else { BLUE };
    if panel.is_significant && !panel.is_explained {
        svg.rect(
            Rect { x: frame.x - 68.0, y: frame.y - 24.0, width: frame.width + 80.0, height: PITCH_PX - 14.0 },
            Fill::new(VERMILLION, 0.12),
        );
    }
    let ink = if panel.is_significant { VERMILLION } else { INK };
    let heading = shorten(&panel.title, LABEL_SIZE_PX, frame.width + 40.0);
    svg.text(&heading, (frame.x - 60.0, frame.y - 8.0), TextStyle::new(LABEL_SIZE_PX, Anchor::Start).colour(ink));
    axes.y_axis(svg, AxisStyle::new(Some(&panel.y_label), 5, 58.0).grid());
    let zero = axes.y_px(0.0);
    for k in shown(&panel.bars, frame.width) {
        let (_, bias, sd) = &panel.bars[k];
        let (x, right) = (axes.x_px(k as f64 + 0.15), axes.x_px(k as f64 + 0.85));
        let y = axes.y_px(*bias);
        let is_clear = bias.abs() > 2.0 * sd;
        let opacity = if is_clear && panel.is_explained {
            0.55
        } else if is_clear {
            0.9
        } else {
            0.3
        };
        let width = (right - x).max(LEAST_BAR_PX);
        svg.rect(Rect { x, y: y.min(zero), width, height: (y - zero).abs() }, Fill::new(colour, opacity));
        let middle = 0.5 * (x + right);
        let (low, high) = (axes.y_px(bias - 2.0 * sd), axes.y_px(bias + 2.0 * sd));
        svg.line((middle, low), (middle, high), Stroke::solid(INK, 1.3));
    }
    labels(svg, panel, &axes);
    axes.horizontal(svg, 0.0, Stroke::solid(AXIS, 1.0));
    svg.rect(frame, Style::from(Stroke::solid(if panel.is_significant { VERMILLION } else { MUTED }, 1.0)));
}

/// Returns the indices of the bars to draw. If bars are narrower than two pixels, one bar of each group that shares two pixels is
/// drawn: the bar with the largest ratio of height to standard error.
fn shown(bars: &[(String, f64, f64)], width_px: f64) -> Vec<usize> {
    let together = (2.0 * bars.len() as f64 / width_px).ceil().max(1.0) as usize;
    let clearness = |k: &usize| bars[*k].1.abs() / bars[*k].2.max(f64::MIN_POSITIVE);
    let indices: Vec<usize> = (0..bars.len()).collect();
    let clearest = |group: &[usize]| group.iter().copied().max_by(|a, b| clearness(a).total_cmp(&clearness(b)));
    indices.chunks(together).filter_map(clearest).collect()
}

/// Writes the names of the bars and of the axis. If the names would touch, only every second or third is written.
fn labels(svg: &mut Svg, panel: &BarPanel, axes: &Axes) {
    let frame = axes.frame;
    let n = panel.bars.len().max(1);
    let pitch = frame.width / n as f64;
    let widest = panel.bars.iter().map(|(label, ..)| text_width_px(label, TICK_SIZE_PX)).fold(1.0, f64::max);
    let every = ((widest + 5.0) / pitch).ceil().max(1.0) as usize;
    for (k, (label, ..)) in panel.bars.iter().enumerate().step_by(every) {
        let at = (frame.x + pitch * (k as f64 + 0.5), frame.bottom() + 1.4 * TICK_SIZE_PX);
        svg.text(label, at, TextStyle::new(TICK_SIZE_PX, Anchor::Middle));
    }
    let label = shorten(&panel.x_label, TICK_SIZE_PX + 1.0, frame.width + 20.0);
    let at = (frame.x + 0.5 * frame.width, frame.bottom() + 34.0);
    svg.text(&label, at, TextStyle::new(TICK_SIZE_PX + 1.0, Anchor::Middle));
}
