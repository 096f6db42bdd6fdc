//! Drawings as PDF pages. Texts are written as outlines, so a page needs no fonts.

use std::collections::BTreeSet;
use std::io::Write as _;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use pdf_writer::types::{LineCapStyle, LineJoinStyle};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref, TextStr};
use tiny_skia::{FillRule, LineCap, Path, PathSegment};

use super::palette::Colour;

/// PDF points per SVG unit.
const POINTS_PER_PX: f32 = 0.75;

/// A shape of a drawing, in SVG units with y downwards.
pub(super) struct PdfShape<'a> {
    pub outline: &'a Path,
    pub rule: FillRule,
    /// Colour and opacity of the inside.
    pub fill: Option<(Colour, f64)>,
    pub stroke: Option<PdfStroke>,
    /// Outline to which the shape is clipped.
    pub window: Option<Path>,
}

/// The line of a shape.
pub(super) struct PdfStroke {
    pub colour: Colour,
    pub opacity: f64,
    pub width_px: f32,
    pub cap: LineCap,
    /// Lengths of dash and gap.
    pub dash: Option<[f32; 2]>,
}

/// Bytes of a PDF document with one page.
pub(super) fn pdf_page<'a>(
    [width_px, height_px]: [f32; 2],
    title: &str,
    shapes: impl Iterator<Item = PdfShape<'a>>,
) -> Vec<u8> {
    let mut content = Content::new();
    content.transform([POINTS_PER_PX, 0.0, 0.0, -POINTS_PER_PX, 0.0, POINTS_PER_PX * height_px]);
    content.set_line_join(LineJoinStyle::RoundJoin);
    let mut opacities = BTreeSet::new();
    for shape in shapes {
        content.save_state();
        if let Some(window) = &shape.window {
            trace(&mut content, window);
            content.clip_nonzero().end_path();
        }
        if let Some((colour, opacity)) = shape.fill {
            set_opacity(&mut content, opacity, &mut opacities);
            let [red, green, blue] = rgb(colour);
            content.set_fill_rgb(red, green, blue);
            trace(&mut content, shape.outline);
            match shape.rule {
                FillRule::EvenOdd => content.fill_even_odd(),
                FillRule::Winding => content.fill_nonzero(),
            };
        }
        if let Some(stroke) = &shape.stroke {
            set_opacity(&mut content, stroke.opacity, &mut opacities);
            let [red, green, blue] = rgb(stroke.colour);
            content.set_stroke_rgb(red, green, blue).set_line_width(stroke.width_px);
            content.set_line_cap(match stroke.cap {
                LineCap::Round => LineCapStyle::RoundCap,
                LineCap::Butt | LineCap::Square => LineCapStyle::ButtCap,
            });
            content.set_dash_pattern(stroke.dash.into_iter().flatten(), 0.0);
            trace(&mut content, shape.outline);
            content.stroke();
        }
        content.restore_state();
    }
    document([width_px, height_px].map(|px| POINTS_PER_PX * px), title, &compressed(&content.finish()), &opacities)
}

/// A document whose only page shows a compressed content.
fn document([width_pt, height_pt]: [f32; 2], title: &str, content: &[u8], opacities: &BTreeSet<u8>) -> Vec<u8> {
    let [catalog, pages, page, content_ref, info] = [1, 2, 3, 4, 5].map(Ref::new);
    let mut pdf = Pdf::new();
    pdf.catalog(catalog).pages(pages);
    pdf.pages(pages).kids([page]).count(1);
    let mut sheet = pdf.page(page);
    sheet.parent(pages).media_box(Rect::new(0.0, 0.0, width_pt, height_pt)).contents(content_ref);
    let mut resources = sheet.resources();
    let mut states = resources.ext_g_states();
    for percent in opacities {
        let opacity = f32::from(*percent) / 100.0;
        states
            .insert(Name(state_name(*percent).as_bytes()))
            .start::<pdf_writer::writers::ExtGraphicsState<'_>>()
            .non_stroking_alpha(opacity)
            .stroking_alpha(opacity);
    }
    states.finish();
    resources.finish();
    sheet.finish();
    pdf.stream(content_ref, content).filter(Filter::FlateDecode);
    pdf.document_info(info).title(TextStr(title));
    pdf.finish()
}

fn compressed(content: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    // Writing into memory does not fail.
    let _ = encoder.write_all(content);
    encoder.finish().unwrap_or_default()
}

/// Sets the opacity of the following shapes, in hundredths as in the SVG.
fn set_opacity(content: &mut Content, opacity: f64, opacities: &mut BTreeSet<u8>) {
    let percent = (100.0 * opacity.clamp(0.0, 1.0)).round() as u8;
    opacities.insert(percent);
    content.set_parameters(Name(state_name(percent).as_bytes()));
}

fn state_name(percent: u8) -> String {
    format!("o{percent}")
}

fn rgb(Colour(red, green, blue): Colour) -> [f32; 3] {
    [red, green, blue].map(|part| f32::from(part) / 255.0)
}

fn trace(content: &mut Content, outline: &Path) {
    let mut at = tiny_skia::Point::zero();
    for segment in outline.segments() {
        match segment {
            PathSegment::MoveTo(to) => {
                content.move_to(to.x, to.y);
                at = to;
            }
            PathSegment::LineTo(to) => {
                content.line_to(to.x, to.y);
                at = to;
            }
            PathSegment::QuadTo(middle, to) => {
                // The cubic curve with the same points.
                let near = |from: tiny_skia::Point| {
                    (from.x + 2.0 * (middle.x - from.x) / 3.0, from.y + 2.0 * (middle.y - from.y) / 3.0)
                };
                let ((x1, y1), (x2, y2)) = (near(at), near(to));
                content.cubic_to(x1, y1, x2, y2, to.x, to.y);
                at = to;
            }
            PathSegment::CubicTo(first, second, to) => {
                content.cubic_to(first.x, first.y, second.x, second.y, to.x, to.y);
                at = to;
            }
            PathSegment::Close => {
                content.close_path();
            }
        }
    }
}
