//! Legends of figures: samples of lines and areas, with texts.

use super::axes::{Axes, TICK_SIZE_PX};
use super::font::{shorten, text_width_px};
use super::number::format_significant;
use super::palette::{BLUE, Colour, VERMILLION};
use super::svg::{Anchor, Fill, Point, Rect, Stroke, Style, Svg, TextStyle};
use super::ticks::AxisScale;

const MARK_WIDTH_PX: f64 = 22.0;
/// Distance in pixels from the left edge of a legend's sample to its text.
pub const MARK_ADVANCE_PX: f64 = MARK_WIDTH_PX + 6.0;
const LINE_HEIGHT_PX: f64 = 1.6;
/// A band that is thinner than this is hidden by the line of its median.
const THINNEST_BAND_PX: f64 = 2.5;
/// Absolute value at which [`signed_colour`] is strongest.
pub(crate) const FULL_COLOUR: f64 = 6.0;

/// Sample of a line, area or dot in a legend.
#[derive(Debug, Clone, Copy)]
pub enum Mark {
    /// Sample of a line.
    Line(Stroke),
    /// Sample of a filled area, with an outline if the style has one.
    Area(Style),
    /// Sample of a dot, with its diameter in pixels.
    Dot(Colour, f64),
    /// Sample of a line across a filled area.
    LineOnArea(Stroke, Fill),
    /// A sample that a function draws into a rectangle.
    Drawn(fn(&mut Svg, Rect)),
}

/// Entry of a legend: a sample with a text.
#[derive(Debug, Clone)]
pub struct Entry {
    /// Sample of the line, area or dot that the entry explains.
    pub mark: Mark,
    /// Text that explains the sample.
    pub text: String,
}

impl Entry {
    /// Creates an entry from a sample and its text.
    pub fn new(mark: Mark, text: impl Into<String>) -> Self {
        Self { mark, text: text.into() }
    }

    fn draw(&self, svg: &mut Svg, at: Point, size_px: f64, text_width: f64) {
        let middle = at.1 - 0.36 * size_px;
        let swatch = Rect { x: at.0, y: middle - 0.42 * size_px, width: MARK_WIDTH_PX, height: 0.84 * size_px };
        let line = ((at.0, middle), (at.0 + MARK_WIDTH_PX, middle));
        match self.mark {
            Mark::Line(stroke) => svg.line(line.0, line.1, stroke),
            Mark::Area(style) => svg.rect(swatch, style),
            Mark::Dot(colour, diameter) => {
                svg.circle((at.0 + MARK_WIDTH_PX / 2.0, middle), diameter / 2.0, Fill::new(colour, 1.0));
            }
            Mark::LineOnArea(stroke, fill) => {
                svg.rect(swatch, fill);
                svg.line(line.0, line.1, stroke);
            }
            Mark::Drawn(draw) => draw(svg, swatch),
        }
        let text = shorten(&self.text, size_px, text_width);
        svg.text(&text, (at.0 + MARK_ADVANCE_PX, at.1), TextStyle::new(size_px, Anchor::Start));
    }
}

/// Text of the entry of a band. It says so where the line over the band hides it. `thickness_px` is the band's thickness at its thickest place.
pub fn band_text(name: &str, thickness_px: f64) -> String {
    let is_hidden = thickness_px < THINNEST_BAND_PX;
    if is_hidden { format!("{name} (thinner than the line)") } else { name.to_owned() }
}

/// Draws a legend whose entries are below each other. Returns its height in pixels.
pub fn column(svg: &mut Svg, entries: &[Entry], at: Point, size_px: f64, width_px: f64) -> f64 {
    for (i, entry) in entries.iter().enumerate() {
        let baseline = at.1 + size_px + i as f64 * LINE_HEIGHT_PX * size_px;
        entry.draw(svg, (at.0, baseline), size_px, width_px - MARK_ADVANCE_PX + 1.0);
    }
    column_height_px(entries, size_px)
}

/// Height in pixels of a legend that [`column()`] draws.
pub fn column_height_px(entries: &[Entry], size_px: f64) -> f64 {
    entries.len() as f64 * LINE_HEIGHT_PX * size_px
}

/// Draws a legend whose entries are side by side, in as many lines as the width requires. Returns its height in pixels.
pub fn row(svg: &mut Svg, entries: &[Entry], at: Point, width_px: f64) -> f64 {
    let size = TICK_SIZE_PX + 1.0;
    let (mut x, mut lines) = (0.0, 0);
    for entry in entries {
        let width = (MARK_ADVANCE_PX + text_width_px(&entry.text, size)).min(width_px);
        if x > 0.0 && x + width > width_px {
            x = 0.0;
            lines += 1;
        }
        let baseline = at.1 + size + f64::from(lines) * LINE_HEIGHT_PX * size;
        entry.draw(svg, (at.0 + x, baseline), size, width_px - MARK_ADVANCE_PX + 1.0);
        x += width + 20.0;
    }
    f64::from(lines + 1) * LINE_HEIGHT_PX * size
}

/// Height in pixels of a legend that [`row`] draws.
pub fn row_height_px(entries: &[Entry], width_px: f64) -> f64 {
    row(&mut Svg::new(1.0, 1.0, ""), entries, (0.0, 0.0), width_px)
}

/// Colour of a value: white at 0, blue for positive, vermillion for negative values.
pub(crate) fn signed_colour(value: f64) -> Colour {
    let end = if value > 0.0 { BLUE } else { VERMILLION };
    end.on_white((value.abs() / FULL_COLOUR).min(1.0))
}

/// Draws the bar of [`signed_colour`] with its numbers at the right of a frame. Returns its axes, without an outline.
pub(crate) fn signed_colour_bar(svg: &mut Svg, frame: &Rect) -> Axes {
    const N_STRIPES: usize = 48;
    let bar = Rect { x: frame.right() + 24.0, y: frame.y, width: 18.0, height: frame.height.max(120.0) };
    let axes = Axes { frame: bar, x: AxisScale::linear(0.0, 1.0), y: AxisScale::linear(-FULL_COLOUR, FULL_COLOUR) };
    for k in 0..N_STRIPES {
        let low = -FULL_COLOUR + 2.0 * FULL_COLOUR * k as f64 / N_STRIPES as f64;
        let high = low + 2.0 * FULL_COLOUR / N_STRIPES as f64;
        let stripe = Rect { y: axes.y_px(high), height: axes.y_px(low) - axes.y_px(high) + 0.5, ..bar };
        svg.rect(stripe, Fill::new(signed_colour(0.5 * (low + high)), 1.0));
    }
    for value in [-6.0, -3.0, 0.0, 3.0, 6.0] {
        let at = (bar.right() + 6.0, axes.y_px(value) + 0.36 * TICK_SIZE_PX);
        svg.text(&format_significant(value, 1), at, TextStyle::new(TICK_SIZE_PX, Anchor::Start));
    }
    axes
}
