//! Legends of figures.

use super::axes::TICK_SIZE_PX;
use super::font::{shorten, text_width_px};
use super::palette::Colour;
use super::svg::{Anchor, Fill, Point, Rect, Stroke, Style, Svg, TextStyle};

const MARK_WIDTH_PX: f64 = 22.0;
/// Distance from the sample's left edge to the text.
pub const MARK_ADVANCE_PX: f64 = MARK_WIDTH_PX + 6.0;
const LINE_HEIGHT_PX: f64 = 1.6;

/// Sample shown beside an entry.
#[derive(Debug, Clone, Copy)]
pub enum Mark {
    /// Line.
    Line(Stroke),
    /// Filled area, with an outline if it has one.
    Area(Style),
    /// Dot with its diameter in pixels.
    Dot(Colour, f64),
    /// Line across a filled area.
    LineOnArea(Stroke, Fill),
    /// Sample that the function draws into a rectangle.
    Drawn(fn(&mut Svg, Rect)),
}

/// Entry of a legend.
#[derive(Debug, Clone)]
pub struct Entry {
    /// Sample.
    pub mark: Mark,
    /// Text beside the sample, which tells its meaning.
    pub text: String,
}

impl Entry {
    /// Creates an entry.
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

/// Draws entries below each other and returns the height used.
pub fn column(svg: &mut Svg, entries: &[Entry], at: Point, size_px: f64, width_px: f64) -> f64 {
    for (i, entry) in entries.iter().enumerate() {
        let baseline = at.1 + size_px + i as f64 * LINE_HEIGHT_PX * size_px;
        entry.draw(svg, (at.0, baseline), size_px, width_px - MARK_ADVANCE_PX + 1.0);
    }
    column_height_px(entries, size_px)
}

/// Height that [`column()`] will use.
pub fn column_height_px(entries: &[Entry], size_px: f64) -> f64 {
    entries.len() as f64 * LINE_HEIGHT_PX * size_px
}

/// Draws entries side by side, in as many lines as the width requires. Returns the height used.
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

/// Height that [`row`] will use.
pub fn row_height_px(entries: &[Entry], width_px: f64) -> f64 {
    row(&mut Svg::new(1.0, 1.0, ""), entries, (0.0, 0.0), width_px)
}
