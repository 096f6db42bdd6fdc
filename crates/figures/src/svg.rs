//! Canvas for figures, which are written as SVG, PNG and PDF.

use std::fmt::Write as _;
use std::path::{Path as FilePath, PathBuf};

use tiny_skia::{FillRule, LineCap, LineJoin, Mask, Paint, PathBuilder, Pixmap, StrokeDash, Transform};

use super::font;
use super::palette::{Colour, INK, WHITE};
use super::pdf::{PdfShape, PdfStroke, pdf_page};
use base::files::{remove_if_there, write_together, xml_text};
use base::quantities::Quantities;
use base::{Error, Result};

/// Formats of a figure, by the ends of its file names.
pub const FIGURE_FORMATS: [&str; 3] = ["svg", "png", "pdf"];
/// Number of PNG pixels per SVG unit.
const PNG_SCALE: f32 = 1.5;

/// Position in pixels: x points to the right and y downwards.
pub type Point = (f64, f64);

/// Rectangle in pixels with sides along x and y.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rect {
    /// Horizontal position of the left edge, in pixels.
    pub x: f64,
    /// Vertical position of the upper edge, in pixels.
    pub y: f64,
    /// Width in pixels.
    pub width: f64,
    /// Height in pixels.
    pub height: f64,
}

impl Rect {
    /// Position of the right edge.
    pub fn right(&self) -> f64 {
        self.x + self.width
    }
    /// Position of the lower edge.
    pub fn bottom(&self) -> f64 {
        self.y + self.height
    }
    /// Intersection of two rectangles.
    fn common(&self, other: Self) -> Self {
        let (x, y) = (self.x.max(other.x), self.y.max(other.y));
        let (right, bottom) = (self.right().min(other.right()), self.bottom().min(other.bottom()));
        Self { x, y, width: (right - x).max(0.0), height: (bottom - y).max(0.0) }
    }
}

/// Style of a line: colour, width, opacity and dashes.
#[derive(Debug, Clone, Copy)]
pub struct Stroke {
    /// Colour of the line.
    pub colour: Colour,
    /// Width in pixels.
    pub width_px: f64,
    /// Opacity of the line, from 0 (invisible) to 1.
    pub opacity: f64,
    /// Lengths of dash and gap in pixels; `None` for a solid line.
    pub dash: Option<(f64, f64)>,
}

impl Stroke {
    /// Style of a solid, opaque line.
    pub fn solid(colour: Colour, width_px: f64) -> Self {
        Self { colour, width_px, opacity: 1.0, dash: None }
    }
    /// Returns the style with dashes and gaps of these lengths.
    pub fn dashed(self, dash_px: f64, gap_px: f64) -> Self {
        Self { dash: Some((dash_px, gap_px)), ..self }
    }
    /// Returns the style with another opacity.
    pub fn opacity(self, opacity: f64) -> Self {
        Self { opacity, ..self }
    }
}

/// Style of an area: colour and opacity.
#[derive(Debug, Clone, Copy)]
pub struct Fill {
    /// Colour of the area.
    pub colour: Colour,
    /// Opacity of the area, from 0 (invisible) to 1.
    pub opacity: f64,
}

impl Fill {
    /// Fill with this colour and opacity.
    pub fn new(colour: Colour, opacity: f64) -> Self {
        Self { colour, opacity }
    }
}

/// Fill and outline of a shape.
#[derive(Debug, Clone, Copy, Default)]
pub struct Style {
    /// Fill of the shape; `None` for a shape that is not filled.
    pub fill: Option<Fill>,
    /// Outline of the shape; `None` for a shape without an outline.
    pub stroke: Option<Stroke>,
}

impl From<Stroke> for Style {
    fn from(stroke: Stroke) -> Self {
        Self { fill: None, stroke: Some(stroke) }
    }
}
impl From<Fill> for Style {
    fn from(fill: Fill) -> Self {
        Self { fill: Some(fill), stroke: None }
    }
}

/// Part of a text that is placed at the text's position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// Left end of the text.
    Start,
    /// Middle of the text.
    Middle,
    /// Right end of the text.
    End,
}

/// Style of text: size, colour, anchor and direction.
#[derive(Debug, Clone, Copy)]
pub struct TextStyle {
    /// Font size in pixels.
    pub size_px: f64,
    /// Colour of the text.
    pub colour: Colour,
    /// Part of the text that is placed at the text's position.
    pub anchor: Anchor,
    /// True for text that runs upwards, false for text that runs to the right.
    pub upwards: bool,
}

impl TextStyle {
    /// Style of horizontal text in the default colour.
    pub fn new(size_px: f64, anchor: Anchor) -> Self {
        Self { size_px, colour: INK, anchor, upwards: false }
    }
    /// Returns the style with another colour.
    pub fn colour(self, colour: Colour) -> Self {
        Self { colour, ..self }
    }
    /// Returns the style for text that runs upwards.
    pub fn upwards(self) -> Self {
        Self { upwards: true, ..self }
    }
}

/// Path of any number of open or closed lines, built step by step.
#[derive(Debug, Clone, Default)]
pub struct Path {
    text: String,
    outline: PathBuilder,
}

impl Path {
    /// Starts a new line of the path.
    pub fn move_to(&mut self, at: Point) {
        let _ = write!(self.text, "M{} {}", Px(at.0), Px(at.1));
        self.outline.move_to(Px(at.0).shown(), Px(at.1).shown());
    }
    /// Adds a straight segment from the end of the current line to `at`.
    pub fn line_to(&mut self, at: Point) {
        let _ = write!(self.text, "L{} {}", Px(at.0), Px(at.1));
        self.outline.line_to(Px(at.0).shown(), Px(at.1).shown());
    }
    /// Closes the current line by a segment to its start.
    pub fn close(&mut self) {
        self.text.push('Z');
        self.outline.close();
    }
    /// Adds a dot: a line of zero length, which round caps make visible.
    pub fn dot(&mut self, at: Point) {
        let (x, y) = (Px(at.0).drawable(), Px(at.1).drawable());
        let _ = write!(self.text, "M{x:.1} {y:.1}h0");
        self.outline.move_to(x as f32, y as f32);
        self.outline.line_to(x as f32, y as f32);
    }
    /// Adds a polyline through the points, closed if `closed` is true.
    pub fn polyline(&mut self, points: impl IntoIterator<Item = Point>, closed: bool) {
        let mut first = true;
        for point in points {
            if first {
                self.move_to(point)
            } else {
                self.line_to(point)
            }
            first = false;
        }
        if closed && !first {
            self.close();
        }
    }
    /// Returns true if the path contains nothing.
    pub fn is_empty(&self) -> bool {
        self.text.is_empty()
    }
}

/// A drawing that can be written as SVG, PNG and PDF. Equal drawings give equal text, with at most two decimals for coordinates. The text has no identifiers, so
/// several drawings fit into one HTML page.
#[derive(Debug, Clone)]
pub struct Svg {
    width_px: f64,
    height_px: f64,
    description: String,
    body: String,
    /// Shapes of `body`, which PNG and PDF are drawn from.
    shapes: Vec<SvgShape>,
    /// Texts whose outlines are among the shapes.
    texts: Vec<SvgText>,
    /// Window to which new shapes are clipped; `None` for no clipping.
    window: Option<Rect>,
}

/// Text of a drawing, with the index of its outline among the shapes.
#[derive(Debug, Clone)]
struct SvgText {
    shape: usize,
    text: String,
    at: Point,
    style: TextStyle,
}

impl SvgText {
    /// Outline of a text in place of this one; `None` if the text has no outline.
    fn outline(&self, text: &str) -> Option<tiny_skia::Path> {
        let Self { at, style, .. } = self;
        let width_px = font::text_width_px(text, style.size_px);
        let along = match style.anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => -0.5 * width_px as f32,
            Anchor::End => -width_px as f32,
        };
        let turn_deg = if style.upwards { -90.0 } else { 0.0 };
        let place = Transform::from_rotate(turn_deg);
        let place = place.post_translate(Px(at.0).shown(), Px(at.1).shown()).pre_translate(along, 0.0);
        font::text_outline(text, style.size_px).and_then(|outline| outline.transform(place))
    }
}

/// Shape of a drawing, for PNG and PDF.
#[derive(Debug, Clone)]
struct SvgShape {
    outline: tiny_skia::Path,
    style: Style,
    rule: FillRule,
    cap: LineCap,
    window: Option<Rect>,
}

impl SvgShape {
    fn draw(&self, pixels: &mut Pixmap, mask: Option<&Mask>) {
        let scale = Transform::from_scale(PNG_SCALE, PNG_SCALE);
        let paint = |Colour(red, green, blue): Colour, opacity: f64| {
            let mut paint = Paint::default();
            paint.set_color_rgba8(red, green, blue, (255.0 * opacity.clamp(0.0, 1.0)).round() as u8);
            paint
        };
        if let Some(Fill { colour, opacity }) = self.style.fill {
            pixels.fill_path(&self.outline, &paint(colour, opacity), self.rule, scale, mask);
        }
        // A line of width 0 is invisible in SVG. The rasteriser would draw it as a thin line.
        if let Some(Stroke { colour, width_px, opacity, dash }) =
            self.style.stroke.filter(|s| Px(s.width_px).shown() > 0.0)
        {
            let stroke = tiny_skia::Stroke {
                width: Px(width_px).shown(),
                line_cap: self.cap,
                line_join: LineJoin::Round,
                dash: dash.and_then(|(dash, gap)| StrokeDash::new(vec![Px(dash).shown(), Px(gap).shown()], 0.0)),
                ..tiny_skia::Stroke::default()
            };
            pixels.stroke_path(&self.outline, &paint(colour, opacity), &stroke, scale, mask);
        }
    }
}

impl SvgShape {
    fn for_pdf(&self) -> PdfShape<'_> {
        // A line of width 0 is invisible in SVG. A PDF would show it as the thinnest line.
        let stroke = self.style.stroke.filter(|stroke| Px(stroke.width_px).shown() > 0.0);
        PdfShape {
            outline: &self.outline,
            rule: self.rule,
            fill: self.style.fill.map(|fill| (fill.colour, fill.opacity)),
            stroke: stroke.map(|Stroke { colour, width_px, opacity, dash }| PdfStroke {
                colour,
                opacity,
                width_px: Px(width_px).shown(),
                cap: self.cap,
                dash: dash.map(|(dash, gap)| [Px(dash).shown(), Px(gap).shown()]),
            }),
            window: self.window.and_then(outline_of),
        }
    }
}

impl Svg {
    /// Creates an empty white drawing. Screen readers read the description.
    pub fn new(width_px: f64, height_px: f64, description: &str) -> Self {
        let (description, body) = (description.to_owned(), String::new());
        Self { width_px, height_px, description, body, shapes: Vec::new(), texts: Vec::new(), window: None }
    }
    /// Creates a drawing of the height that `draw` returns, plus a margin. It is drawn once to determine its height, and then again.
    pub fn drawn(width_px: f64, description: &str, margin_px: f64, draw: impl Fn(&mut Self) -> f64) -> Self {
        let height_px = draw(&mut Self::new(width_px, 1.0, "")) + margin_px;
        let mut svg = Self::new(width_px, height_px, description);
        draw(&mut svg);
        svg
    }
    /// Width of the drawing in SVG units.
    pub fn width_px(&self) -> f64 {
        self.width_px
    }
    /// Height of the drawing in SVG units.
    pub fn height_px(&self) -> f64 {
        self.height_px
    }
    /// Draws a straight line.
    pub fn line(&mut self, from: Point, to: Point, stroke: Stroke) {
        let mut path = Path::default();
        path.polyline([from, to], false);
        self.path(&path, stroke);
    }
    /// Draws a path. Areas are filled by the even-odd rule, so a loop inside a loop is a hole.
    pub fn path(&mut self, path: &Path, style: impl Into<Style>) {
        if !path.is_empty() {
            let style = style.into();
            let rule = if style.fill.is_some() { " fill-rule=\"evenodd\"" } else { "" };
            let _ = writeln!(self.body, "<path d=\"{}\"{rule}{}/>", path.text, Attributes(style));
            self.push(path.outline.clone().finish(), style, FillRule::EvenOdd, LineCap::Butt);
        }
    }
    /// Draws dots of equal size as one SVG element. The path consists of [`Path::dot`]s.
    pub fn dots(&mut self, dots: &Path, colour: Colour, diameter_px: f64, opacity: f64) {
        if !dots.is_empty() {
            let stroke = Stroke::solid(colour, diameter_px).opacity(opacity);
            let attributes = Attributes(stroke.into());
            let _ = writeln!(self.body, "<path d=\"{}\" stroke-linecap=\"round\"{attributes}/>", dots.text);
            self.push(dots.outline.clone().finish(), stroke.into(), FillRule::Winding, LineCap::Round);
        }
    }
    /// Draws a rectangle.
    pub fn rect(&mut self, rect: Rect, style: impl Into<Style>) {
        let Rect { x, y, width, height } = rect;
        let (x, y, width, height) = (Px(x), Px(y), Px(width.max(0.0)), Px(height.max(0.0)));
        let style = style.into();
        self.push(outline_of(rect), style, FillRule::Winding, LineCap::Butt);
        let attributes = Attributes(style);
        let _ = writeln!(self.body, "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"{attributes}/>");
    }
    /// Draws a circle.
    pub fn circle(&mut self, centre: Point, radius_px: f64, style: impl Into<Style>) {
        let style = style.into();
        let (x, y, radius, attributes) = (Px(centre.0), Px(centre.1), Px(radius_px), Attributes(style));
        let outline = PathBuilder::from_circle(x.shown(), y.shown(), radius.shown());
        self.push(outline, style, FillRule::Winding, LineCap::Butt);
        let _ = writeln!(self.body, "<circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\"{attributes}/>");
    }
    /// Draws one line of text. Its baseline passes through `at`.
    pub fn text(&mut self, text: &str, at: Point, style: TextStyle) {
        if text.is_empty() {
            return;
        }
        let (x, y, size, colour) = (Px(at.0), Px(at.1), Px(style.size_px), style.colour);
        let anchor = match style.anchor {
            Anchor::Start => "",
            Anchor::Middle => " text-anchor=\"middle\"",
            Anchor::End => " text-anchor=\"end\"",
        };
        let turn = if style.upwards { format!(" transform=\"rotate(-90 {x} {y})\"") } else { String::new() };
        let written = SvgText { shape: self.shapes.len(), text: text.to_string(), at, style };
        let outline = written.outline(text);
        if outline.is_some() {
            self.texts.push(written);
        }
        self.push(outline, Fill::new(colour, 1.0).into(), FillRule::Winding, LineCap::Butt);
        let text = xml_text(text);
        let _ = writeln!(
            self.body,
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\" fill=\"{colour}\"{anchor}{turn}>{text}</text>"
        );
    }
    /// Calls `draw` and clips its shapes to `window`. In the SVG a nested viewport clips them, because a clip path would need an identifier.
    pub fn clipped(&mut self, window: Rect, draw: impl FnOnce(&mut Self)) {
        let (x, y, width, height) = (Px(window.x), Px(window.y), Px(window.width), Px(window.height));
        if window.width <= 0.0 || window.height <= 0.0 {
            return;
        }
        let _ = writeln!(
            self.body,
            "<svg x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" viewBox=\"{x} {y} {width} {height}\" preserveAspectRatio=\"none\" overflow=\"hidden\">"
        );
        let outer = self.window;
        self.window = Some(outer.map_or(window, |outer| outer.common(window)));
        draw(self);
        self.window = outer;
        self.body.push_str("</svg>\n");
    }
    fn push(&mut self, outline: Option<tiny_skia::Path>, style: Style, rule: FillRule, cap: LineCap) {
        self.shapes.extend(outline.map(|outline| SvgShape { outline, style, rule, cap, window: self.window }));
    }
    /// Text of the complete SVG document.
    pub fn document(&self) -> String {
        let (width, height, families) = (Px(self.width_px), Px(self.height_px), font::FAMILIES);
        let (title, background) = (xml_text(&self.description), WHITE);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" role=\"img\" font-family=\"{families}\">\n<title>{title}</title>\n<rect width=\"{width}\" height=\"{height}\" fill=\"{background}\"/>\n{}</svg>\n",
            self.body
        )
    }
    /// Exchanges the words and units of the drawing's texts, for a record with other quantities.
    #[must_use]
    pub fn translated(mut self, quantities: Option<Quantities>) -> Self {
        if let Some(quantities) = quantities {
            self.description = quantities.translate(&self.description).into_owned();
            self.body = quantities.translate_drawing(&self.body);
            for own in &self.texts {
                let text = quantities.translate(&own.text);
                if let (true, Some(outline)) = (text != own.text, own.outline(&text)) {
                    self.shapes[own.shape].outline = outline;
                }
            }
        }
        self
    }

    /// Renders the drawing as PNG with the embedded font, with 1.5 pixels per SVG unit.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the drawing is too large for the memory.
    pub fn png(&self) -> Result<Vec<u8>> {
        let failed =
            |what: String| Error::numerical(format!("the figure could not be rendered: {what}"), "use the SVG");
        let [width, height] = [self.width_px, self.height_px].map(|size| (Px(size).shown() * PNG_SCALE).ceil() as u32);
        let too_large = || failed(format!("{width} × {height} pixels are too many"));
        let mut pixels = Pixmap::new(width, height).ok_or_else(too_large)?;
        pixels.fill(tiny_skia::Color::WHITE);
        let mut mask: Option<(Rect, Mask)> = None;
        for shape in &self.shapes {
            if let Some(window) = shape.window
                && mask.as_ref().is_none_or(|(drawn, _)| *drawn != window)
            {
                let mut inside = Mask::new(width, height).ok_or_else(too_large)?;
                if let Some(outline) = outline_of(window) {
                    let scale = Transform::from_scale(PNG_SCALE, PNG_SCALE);
                    inside.fill_path(&outline, FillRule::Winding, true, scale);
                }
                mask = Some((window, inside));
            }
            shape.draw(&mut pixels, mask.as_ref().filter(|_| shape.window.is_some()).map(|(_, inside)| inside));
        }
        pixels.encode_png().map_err(|error| failed(error.to_string()))
    }

    /// Returns the drawing as a PDF document of one page, with texts as outlines.
    pub fn pdf(&self) -> Vec<u8> {
        let size_px = [self.width_px, self.height_px].map(|size| Px(size).shown());
        pdf_page(size_px, &self.description, self.shapes.iter().map(SvgShape::for_pdf))
    }
}

/// Writes `<stem>.svg`, `<stem>.png` and `<stem>.pdf` into `dir`. Each file is written completely or not at all.
///
/// # Errors
/// [`Error::File`] if the directory cannot be written, [`Error::Numerical`] if the PNG cannot be rendered. In the latter case nothing is written.
pub fn write_figure(dir: &FilePath, stem: &str, svg: &Svg) -> Result<()> {
    let files = figure_files(dir, stem, svg)?;
    write_together(&files.each_ref().map(|(path, bytes)| (path.as_path(), bytes.as_slice())))
}

/// Returns path and content of `<stem>.svg`, `<stem>.png` and `<stem>.pdf`, for callers that write them together with other files.
///
/// # Errors
/// [`Error::Numerical`] if the PNG cannot be rendered.
pub fn figure_files(dir: &FilePath, stem: &str, svg: &Svg) -> Result<[(PathBuf, Vec<u8>); 3]> {
    let png = svg.png()?;
    let path = |format: &str| dir.join(format!("{stem}.{format}"));
    let [of_svg, of_png, of_pdf] = FIGURE_FORMATS.map(path);
    Ok([(of_svg, svg.document().into_bytes()), (of_png, png), (of_pdf, svg.pdf())])
}

/// Removes the files that an earlier [`write_figure`] has written, if they exist.
///
/// # Errors
/// [`Error::File`] if the directory cannot be written.
pub fn remove_figure(dir: &FilePath, stem: &str) -> Result<()> {
    FIGURE_FORMATS.iter().try_for_each(|format| remove_if_there(&dir.join(format!("{stem}.{format}"))))
}

/// Rectangle as a path for the rasteriser; `None` if it has no area.
fn outline_of(rect: Rect) -> Option<tiny_skia::Path> {
    let [x, y, width, height] = [rect.x, rect.y, rect.width, rect.height].map(|at| Px(at).shown());
    let rect = tiny_skia::Rect::from_xywh(x, y, width, height)?;
    (width > 0.0 && height > 0.0).then(|| PathBuilder::from_rect(rect))
}

/// Coordinate in pixels that is printed with at most two decimals.
#[derive(Clone, Copy)]
struct Px(f64);

/// Largest absolute coordinate that is drawn. It is far outside every figure, and still within the range of rasterisers.
const FARTHEST_PX: f64 = 20_000.0;

impl Px {
    /// Coordinate that can be drawn: limited to ±`FARTHEST_PX`, and 0 for NaN.
    fn drawable(self) -> f64 {
        if self.0.is_nan() { 0.0 } else { self.0.clamp(-FARTHEST_PX, FARTHEST_PX) }
    }
    /// Coordinate for the rasteriser, rounded to the two decimals that the SVG prints.
    fn shown(self) -> f32 {
        ((self.drawable() * 100.0).round() / 100.0) as f32
    }
}

impl std::fmt::Display for Px {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let hundredths = (Self(self.0).drawable() * 100.0).round();
        // A negative zero would be printed with a sign.
        let text = format!("{:.2}", if hundredths == 0.0 { 0.0 } else { hundredths / 100.0 });
        f.write_str(text.trim_end_matches('0').trim_end_matches('.'))
    }
}

struct Attributes(Style);

impl std::fmt::Display for Attributes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0.fill {
            Some(Fill { colour, opacity }) => {
                write!(f, " fill=\"{colour}\"")?;
                if opacity < 1.0 {
                    write!(f, " fill-opacity=\"{}\"", Px(opacity))?;
                }
            }
            None => f.write_str(" fill=\"none\"")?,
        }
        if let Some(Stroke { colour, width_px, opacity, dash }) = self.0.stroke {
            write!(f, " stroke=\"{colour}\" stroke-width=\"{}\" stroke-linejoin=\"round\"", Px(width_px))?;
            if opacity < 1.0 {
                write!(f, " stroke-opacity=\"{}\"", Px(opacity))?;
            }
            if let Some((dash, gap)) = dash {
                write!(f, " stroke-dasharray=\"{} {}\"", Px(dash), Px(gap))?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::palette::BLUE;

    fn drawing() -> Svg {
        let mut svg = Svg::new(100.0, 50.0, "test <&> \u{1}");
        svg.text("a < b & \"c\" \u{0} µ", (5.0, 20.0), TextStyle::new(12.0, Anchor::Start));
        svg.clipped(Rect { x: 10.0, y: 10.0, width: 20.0, height: 20.0 }, |svg| {
            svg.rect(Rect { x: -50.0, y: 15.0, width: 500.0, height: 10.0 }, Fill::new(BLUE, 1.0));
        });
        svg
    }

    #[test]
    fn a_viewport_clips_in_the_png() {
        let png = drawing().png().unwrap();
        let pixels = tiny_skia::Pixmap::decode_png(&png).unwrap();
        assert_eq!((pixels.width(), pixels.height()), (150, 75));
        let at = |x, y| pixels.pixel(x, y).map(|p| (p.red(), p.green(), p.blue())).unwrap();
        assert_eq!(at(30, 30), (0x00, 0x72, 0xb2));
        assert_eq!(at(60, 30), (0xff, 0xff, 0xff));
    }

    #[test]
    fn a_figure_is_three_files_with_the_same_bytes_each_time() {
        let (first, second) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        for dir in [&first, &second] {
            write_figure(dir.path(), "figure", &drawing()).unwrap();
        }
        for name in ["figure.svg", "figure.png", "figure.pdf"] {
            assert_eq!(
                std::fs::read(first.path().join(name)).unwrap(),
                std::fs::read(second.path().join(name)).unwrap()
            );
        }
        assert_eq!(std::fs::read_dir(first.path()).unwrap().count(), 3);
        remove_figure(first.path(), "figure").unwrap();
        assert_eq!(std::fs::read_dir(first.path()).unwrap().count(), 0);
    }

    #[test]
    fn coordinates_of_any_size_can_be_drawn() {
        let mut svg = Svg::new(100.0, 50.0, "far away");
        let far = [1e19, -1e308, f64::INFINITY, f64::NAN, f64::MIN_POSITIVE];
        for (x, y) in far.iter().flat_map(|x| far.map(|y| (*x, y))) {
            let mut path = Path::default();
            path.polyline([(10.0, 10.0), (x, y), (20.0, 30.0)], true);
            path.dot((x, y));
            svg.path(&path, Stroke::solid(BLUE, 1.0).dashed(6.0, 4.0));
            svg.circle((x, y), 3.0, Fill::new(BLUE, 0.5));
            svg.clipped(Rect { x, y, width: x, height: y }, |svg| {
                svg.line((0.0, 0.0), (x, y), Stroke::solid(BLUE, 1.0))
            });
        }
        assert!(svg.png().is_ok());
    }

    /// A translated drawing equals the drawing of the translated text, also as a bitmap.
    #[test]
    fn translated_texts_are_drawn_anew() {
        let drawn = |text: &str| {
            let mut svg = Svg::new(200.0, 40.0, text);
            svg.text(text, (100.0, 20.0), TextStyle::new(12.0, Anchor::Middle));
            svg
        };
        let translated = drawn("position (µm)").translated(Some(Quantities::Relaxation));
        let expected = drawn("force (µN)");
        assert_eq!(translated.document(), expected.document());
        assert_eq!(translated.png().unwrap(), expected.png().unwrap());
    }

    #[test]
    fn coordinates_are_short() {
        assert_eq!(format!("{} {} {} {}", Px(1.0), Px(-0.001), Px(2.505), Px(1234.5)), "1 0 2.51 1234.5");
    }
}
