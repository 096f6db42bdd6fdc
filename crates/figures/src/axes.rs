//! A pair of axes that draws data inside a frame, and ticks and labels along the frame.

use super::font::{fitting_size_px, shorten, text_width_px, wrapped};
use super::palette::{AXIS, Colour, GRID, INK, MUTED};
use super::svg::{Anchor, Fill, Path, Point, Rect, Stroke, Style, Svg, TextStyle};
use super::ticks::{AxisScale, Ticks};

/// Font size of the numbers at ticks, in pixels.
pub const TICK_SIZE_PX: f64 = 11.0;
/// Font size of axis labels, in pixels.
pub const LABEL_SIZE_PX: f64 = 13.0;
/// Smallest font size to which a label shrinks. A label that is still too wide is cut.
const SMALLEST_PX: f64 = 9.0;
const TICK_LENGTH_PX: f64 = 5.0;
/// Width in pixels of the columns in which a curve's points are thinned. Half a pixel suits pictures that are enlarged to twice their size.
const COLUMN_PX: f64 = 0.5;
/// Curves with fewer points per column than this number are not thinned.
const POINTS_OF_COLUMN: f64 = 8.0;
/// Above this number of dots, a single dot represents dots that cover each other.
const MOST_DOTS: usize = 5_000;

/// A frame with a horizontal and a vertical scale, into which data are drawn.
#[derive(Debug, Clone, Copy)]
pub struct Axes {
    /// Area of the data, in pixels.
    pub frame: Rect,
    /// Horizontal scale.
    pub x: AxisScale,
    /// Vertical scale.
    pub y: AxisScale,
}

/// Style of one axis: label, numbers and grid lines.
#[derive(Debug, Clone, Copy)]
pub struct AxisStyle<'a> {
    label: Option<&'a str>,
    most_ticks: usize,
    label_distance_px: f64,
    grid: bool,
    integers: bool,
    overhang_px: f64,
}

impl<'a> AxisStyle<'a> {
    /// Creates the style of an axis. The label is a quantity with its unit, such as `time (s)`; `None` omits label and numbers. At most `most_ticks` numbers
    /// are written. The outer edge of the label is `label_distance_px` from the frame, so that the labels of stacked axes align.
    pub fn new(label: Option<&'a str>, most_ticks: usize, label_distance_px: f64) -> Self {
        let overhang_px = 0.5 * TICK_SIZE_PX;
        Self { label, most_ticks, label_distance_px, grid: false, integers: false, overhang_px }
    }
    /// Adds faint lines across the frame, one at each number.
    pub fn grid(self) -> Self {
        Self { grid: true, ..self }
    }
    /// Removes ticks between whole numbers.
    pub fn integers(self) -> Self {
        Self { integers: true, ..self }
    }
    /// Allows numbers at the ends of a horizontal axis to extend beyond it by this width.
    pub fn overhang_px(self, overhang_px: f64) -> Self {
        Self { overhang_px, ..self }
    }
    fn shows_minor(&self, value: f64) -> bool {
        !self.integers || (value - value.round()).abs() < 1e-6
    }
}

impl Axes {
    /// Horizontal position in the drawing of a value on the x scale, in pixels.
    pub fn x_px(&self, value: f64) -> f64 {
        self.frame.x + self.x.fraction(value) * self.frame.width
    }
    /// Vertical position in the drawing of a value on the y scale, in pixels.
    pub fn y_px(&self, value: f64) -> f64 {
        self.frame.bottom() - self.y.fraction(value) * self.frame.height
    }
    /// Position in the drawing of a pair of values, in pixels.
    pub fn px(&self, x: f64, y: f64) -> Point {
        (self.x_px(x), self.y_px(y))
    }

    /// Draws a line through points with finite values. A value that is not finite interrupts the line.
    pub fn line(&self, svg: &mut Svg, x: &[f64], y: &[f64], stroke: Stroke) {
        let mut path = Path::default();
        let points: Vec<Point> = x.iter().zip(y).map(|(&x, &y)| self.px(x, y)).collect();
        for run in points.split(|(x, y)| !(x.is_finite() && y.is_finite())) {
            let mut run = thin_curve(run).into_iter();
            if let Some(first) = run.next() {
                path.move_to(first);
            }
            run.for_each(|point| path.line_to(point));
        }
        svg.path(&path, stroke);
    }

    /// Fills the area between the curves `lower` and `upper` over the same `x`. A value that is not finite interrupts it.
    pub fn band(&self, svg: &mut Svg, x: &[f64], lower: &[f64], upper: &[f64], fill: Fill) {
        let mut path = Path::default();
        let n = x.len().min(lower.len()).min(upper.len());
        let finite = |i: &usize| x[*i].is_finite() && lower[*i].is_finite() && upper[*i].is_finite();
        let mut start = 0;
        while start < n {
            let run: Vec<usize> = (start..n).take_while(finite).collect();
            let edge = |y: &[f64]| thin_curve(&run.iter().map(|&i| self.px(x[i], y[i])).collect::<Vec<Point>>());
            if run.len() > 1 {
                path.polyline(edge(upper).into_iter().chain(edge(lower).into_iter().rev()), true);
            }
            start += run.len() + 1;
        }
        svg.path(&path, fill);
    }

    /// Draws a dot at each finite point inside the frame. Of many dots that cover each other by more than half, only one is drawn.
    pub fn scatter(
        &self,
        svg: &mut Svg,
        points: impl Iterator<Item = (f64, f64)>,
        colour: Colour,
        diameter_px: f64,
        opacity: f64,
    ) {
        let inside = |scale: &AxisScale, value| (0.0..=1.0).contains(&scale.fraction(value));
        let is_drawn =
            |(x, y): &(f64, f64)| x.is_finite() && y.is_finite() && inside(&self.x, *x) && inside(&self.y, *y);
        let mut drawn: Vec<Point> = points.filter(is_drawn).map(|(x, y)| self.px(x, y)).collect();
        if drawn.len() > MOST_DOTS {
            // Dots in one cell cover each other by more than half, so only one of them is drawn.
            let cell = 0.5 * diameter_px;
            let mut taken = std::collections::HashSet::new();
            drawn.retain(|(x, y)| taken.insert(((x / cell) as i64, (y / cell) as i64)));
        }
        let mut dots = Path::default();
        drawn.into_iter().for_each(|point| dots.dot(point));
        svg.dots(&dots, colour, diameter_px, opacity);
    }

    /// Draws a vertical line at the value `x` across the frame, if the value lies on the axis.
    pub fn vertical(&self, svg: &mut Svg, x: f64, stroke: Stroke) {
        if (0.0..=1.0).contains(&self.x.fraction(x)) {
            let x = self.x_px(x);
            svg.line((x, self.frame.y), (x, self.frame.bottom()), stroke);
        }
    }

    /// Draws vertical lines at the values `x` across the frame, at most one per pixel.
    pub fn verticals(&self, svg: &mut Svg, x: &[f64], stroke: Stroke) {
        let mut last_px = f64::NEG_INFINITY;
        for x in x {
            let at_px = self.x_px(*x);
            if (at_px - last_px).abs() >= 1.0 {
                self.vertical(svg, *x, stroke);
                last_px = at_px;
            }
        }
    }

    /// Draws a horizontal line at the value `y` across the frame, if the value lies on the axis.
    pub fn horizontal(&self, svg: &mut Svg, y: f64, stroke: Stroke) {
        if (0.0..=1.0).contains(&self.y.fraction(y)) {
            let y = self.y_px(y);
            svg.line((self.frame.x, y), (self.frame.right(), y), stroke);
        }
    }

    /// Draws the frame's outline.
    pub fn outline(&self, svg: &mut Svg) {
        svg.rect(self.frame, Style::from(Stroke::solid(AXIS, 1.0)));
    }

    /// Draws ticks on the lower edge of the frame, with numbers and label if the style has a label.
    pub fn x_axis(&self, svg: &mut Svg, style: AxisStyle) {
        let ticks = self.x.ticks_side_by_side(style.most_ticks, self.frame.width, TICK_SIZE_PX, style.overhang_px);
        let bottom = self.frame.bottom();
        for &value in ticks.minor.iter().filter(|value| style.shows_minor(**value)) {
            let x = self.x_px(value);
            svg.line((x, bottom), (x, bottom - 0.5 * TICK_LENGTH_PX), Stroke::solid(AXIS, 0.7));
        }
        for (value, label) in &ticks.major {
            let x = self.x_px(*value);
            if style.grid {
                svg.line((x, self.frame.y), (x, bottom), Stroke::solid(GRID, 0.8));
            }
            svg.line((x, bottom), (x, bottom - TICK_LENGTH_PX), Stroke::solid(AXIS, 1.0));
            if style.label.is_some() {
                svg.text(label, (x, bottom + 1.4 * TICK_SIZE_PX), TextStyle::new(TICK_SIZE_PX, Anchor::Middle));
            }
        }
        if let Some(label) = style.label {
            self.x_label(svg, &with_factor(label, &ticks), bottom + style.label_distance_px);
        }
    }

    fn x_label(&self, svg: &mut Svg, label: &str, baseline: f64) {
        let (lines, size) = label_lines(label, self.frame.width);
        for (i, line) in lines.iter().enumerate() {
            let at = (self.frame.x + self.frame.width / 2.0, baseline + 1.15 * size * i as f64);
            svg.text(line, at, TextStyle::new(size, Anchor::Middle));
        }
    }

    /// Draws ticks on the left edge of the frame, with numbers and label if the style has a label.
    pub fn y_axis(&self, svg: &mut Svg, style: AxisStyle) {
        let ticks = self.y.ticks(style.most_ticks);
        let left = self.frame.x;
        for &value in ticks.minor.iter().filter(|value| style.shows_minor(**value)) {
            let y = self.y_px(value);
            svg.line((left, y), (left + 0.5 * TICK_LENGTH_PX, y), Stroke::solid(AXIS, 0.7));
        }
        for (value, label) in &ticks.major {
            let y = self.y_px(*value);
            if style.grid {
                svg.line((left, y), (self.frame.right(), y), Stroke::solid(GRID, 0.8));
            }
            svg.line((left, y), (left + TICK_LENGTH_PX, y), Stroke::solid(AXIS, 1.0));
            if style.label.is_some() {
                let at = (left - 6.0, y + 0.36 * TICK_SIZE_PX);
                svg.text(label, at, TextStyle::new(TICK_SIZE_PX, Anchor::End));
            }
        }
        if let Some(label) = style.label {
            let label = with_factor(label, &ticks);
            let (lines, size) = label_lines(&label, self.frame.height);
            for (i, line) in lines.iter().rev().enumerate() {
                let x = left - style.label_distance_px + size - 1.15 * size * i as f64;
                let at = (x, self.frame.y + self.frame.height / 2.0);
                svg.text(line, at, TextStyle::new(size, Anchor::Middle).upwards());
            }
        }
    }
}

/// Removes points of a curve that are too close together to be visible. The curve must run from left to right. In each column of pixels the function keeps the
/// first, lowest, highest and last points, so the curve's envelope is exact.
fn thin_curve(run: &[Point]) -> Vec<Point> {
    let width_px = run.first().zip(run.last()).map_or(0.0, |(first, last)| last.0 - first.0);
    let is_sparse = (run.len() as f64) < POINTS_OF_COLUMN * (1.0 + width_px / COLUMN_PX);
    if is_sparse || !run.is_sorted_by(|a, b| a.0 <= b.0) {
        return run.to_vec();
    }
    let column = |point: &Point| (point.0 / COLUMN_PX).floor();
    let mut kept = Vec::new();
    for points in run.chunk_by(|a, b| column(a) == column(b)) {
        let last = points.len() - 1;
        let extreme = |largest: bool| {
            let sign = if largest { 1.0 } else { -1.0 };
            (0..points.len()).max_by(|a, b| (sign * points[*a].1).total_cmp(&(sign * points[*b].1))).unwrap_or(0)
        };
        let mut chosen = [0, extreme(false), extreme(true), last];
        chosen.sort_unstable();
        let distinct = chosen.iter().enumerate().filter(|(i, k)| *i == 0 || chosen[i - 1] != **k);
        kept.extend(distinct.map(|(_, k)| points[*k]));
    }
    kept
}

/// Returns the lines of an axis label and their font size. If a single line would be too small, the quantity and the unit have a line each.
fn label_lines(label: &str, room_px: f64) -> (Vec<String>, f64) {
    let whole = fitting_size_px(label, LABEL_SIZE_PX, SMALLEST_PX, room_px);
    if text_width_px(label, whole) <= room_px {
        return (vec![label.to_owned()], whole);
    }
    let parts: Vec<&str> = label.rfind(" (").map_or(vec![label], |at| vec![&label[..at], &label[at + 1..]]);
    let size = |part: &&str| fitting_size_px(part, LABEL_SIZE_PX, SMALLEST_PX, room_px);
    let size = parts.iter().map(size).fold(LABEL_SIZE_PX, f64::min);
    (parts.into_iter().map(|part| shorten(part, size, room_px)).collect(), size)
}

/// Adds the common factor of an axis's numbers to the unit in its label: `E (Pa)` becomes `E (10⁻³ Pa)`.
fn with_factor(label: &str, ticks: &Ticks) -> String {
    let power = ticks.factor.trim_start_matches('×');
    match (power.is_empty(), label.rfind(" (")) {
        (true, _) => label.to_owned(),
        (false, Some(at)) if label.ends_with("(–)") => format!("{} ({power})", &label[..at]),
        (false, Some(at)) => format!("{} ({power} {}", &label[..at], &label[at + 2..]),
        (false, None) => format!("{label} ({power})"),
    }
}

/// Width in pixels of the widest number on a vertical axis with at most `most_ticks` numbers.
pub fn widest_y_number_px(scale: &AxisScale, most_ticks: usize) -> f64 {
    let ticks = scale.ticks(most_ticks);
    ticks.major.iter().map(|(_, label)| text_width_px(label, TICK_SIZE_PX)).fold(0.0, f64::max)
}

/// Writes a note in the colour of secondary text, cut to `width_px`.
pub fn note(svg: &mut Svg, text: &str, at: Point, anchor: Anchor, width_px: f64) {
    svg.text(&shorten(text, TICK_SIZE_PX, width_px), at, TextStyle::new(TICK_SIZE_PX, anchor).colour(MUTED));
}

/// Writes a figure's title in one line, cut to `width_px`.
pub fn title(svg: &mut Svg, text: &str, at: Point, width_px: f64) {
    let size = fitting_size_px(text, 16.0, 12.0, width_px);
    svg.text(&shorten(text, size, width_px), at, TextStyle::new(size, Anchor::Start).colour(INK));
}

/// Writes a figure's title, and a text below it in as many lines as the width requires. Returns their height in pixels.
pub fn title_with_text(svg: &mut Svg, heading: &str, text: &str, at: Point, width_px: f64) -> f64 {
    title(svg, heading, (at.0, at.1 + 16.0), width_px);
    let lines = wrapped(text, LABEL_SIZE_PX, width_px);
    for (i, line) in lines.iter().enumerate() {
        let baseline = at.1 + 38.0 + 1.35 * LABEL_SIZE_PX * i as f64;
        svg.text(line, (at.0, baseline), TextStyle::new(LABEL_SIZE_PX, Anchor::Start));
    }
    24.0 + 1.35 * LABEL_SIZE_PX * lines.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes() -> Axes {
        let frame = Rect { x: 10.0, y: 20.0, width: 100.0, height: 50.0 };
        Axes { frame, x: AxisScale::linear(0.0, 10.0), y: AxisScale::linear(0.0, 1.0) }
    }

    #[test]
    fn gaps_break_lines_and_bands() {
        let x = [0.0, 1.0, 2.0, 3.0, 4.0];
        let y = [0.1, 0.2, f64::NAN, 0.3, 0.4];
        let mut svg = Svg::new(120.0, 80.0, "");
        axes().line(&mut svg, &x, &y, Stroke::solid(INK, 1.0));
        assert!(svg.document().contains("M10 65L20 60M40 55L50 50"), "{}", svg.document());
        let mut svg = Svg::new(120.0, 80.0, "");
        axes().band(&mut svg, &x, &[0.0; 5], &y, Fill::new(INK, 0.5));
        assert_eq!(svg.document().matches('Z').count(), 2);
    }

    /// A curve of 50,000 points with one spike is thinned to at most four points per column. The spike and both ends remain.
    #[test]
    fn curves_keep_their_envelope_when_thinned() {
        let value = |i: usize| if i == 31_007 { 0.99 } else { 0.3 + 0.1 * (0.37 * i as f64).sin() };
        let run: Vec<Point> = (0..50_000).map(|i| axes().px(10.0 * i as f64 / 49_999.0, value(i))).collect();
        let kept = thin_curve(&run);
        assert!(kept.len() <= 4 * 201, "{}", kept.len());
        assert_eq!((kept.first(), kept.last()), (run.first(), run.last()));
        let highest = |points: &[Point]| points.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
        assert_eq!(highest(&kept), highest(&run));
        let sparse: Vec<Point> = run.into_iter().step_by(100).collect();
        assert_eq!(thin_curve(&sparse), sparse);
    }

    #[test]
    fn factors_go_into_the_unit() {
        let ticks = Ticks { factor: "×10⁻³".into(), ..Ticks::default() };
        assert_eq!(with_factor("E (Pa)", &ticks), "E (10⁻³ Pa)");
        assert_eq!(with_factor("α (–)", &ticks), "α (10⁻³)");
        assert_eq!(with_factor("E (Pa)", &Ticks::default()), "E (Pa)");
    }
}
