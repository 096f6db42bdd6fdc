//! The embedded font, and the width of text in it.

use tiny_skia::{Path, PathBuilder, Transform};
use ttf_parser::{Face, GlyphId, OutlineBuilder};

/// DejaVu Sans, reduced to Latin and Greek letters, superscripts, subscripts, mathematical signs and arrows. The licence is beside the file.
pub(crate) static FONT: &[u8] = include_bytes!("../assets/DejaVuSans-subset.ttf");

/// Font families that the SVG names: the embedded font, then one with nearly equal widths.
pub const FAMILIES: &str = "DejaVu Sans, Verdana, sans-serif";

/// Advance width of a character that the font lacks, as a fraction of the font size.
const UNKNOWN_ADVANCE: f64 = 0.6;

/// The embedded font; `None` if its bytes are damaged.
fn font() -> Option<Face<'static>> {
    Face::parse(FONT, 0).ok()
}

/// Width in pixels of one line of text with the font size `size_px`.
pub fn text_width_px(text: &str, size_px: f64) -> f64 {
    let Some(font) = font() else {
        return UNKNOWN_ADVANCE * size_px * text.chars().count() as f64;
    };
    glyphs(&font, text).map(|(_, ems)| ems).sum::<f64>() * size_px
}

/// Glyph of each character, with its advance width as a fraction of the font size.
fn glyphs(font: &Face, text: &str) -> impl Iterator<Item = (GlyphId, f64)> {
    text.chars().map(|character| {
        let glyph = font.glyph_index(character);
        let advance = glyph.and_then(|glyph| font.glyph_hor_advance(glyph));
        let ems = advance.map_or(UNKNOWN_ADVANCE, |units| f64::from(units) / f64::from(font.units_per_em()));
        (glyph.unwrap_or_default(), ems)
    })
}

/// Outline of one line of text with the font size `size_px`; `None` if the text is blank. Coordinates are in pixels. The baseline starts at the origin and runs
/// along x; y points downwards.
pub fn text_outline(text: &str, size_px: f64) -> Option<Path> {
    let font = font()?;
    let units_per_em = f64::from(font.units_per_em());
    let mut pen = Pen { outline: PathBuilder::new(), x: 0.0 };
    for (glyph, ems) in glyphs(&font, text) {
        // A blank has no outline.
        font.outline_glyph(glyph, &mut pen);
        pen.x += (ems * units_per_em) as f32;
    }
    let scale = (size_px / units_per_em) as f32;
    pen.outline.finish()?.transform(Transform::from_scale(scale, -scale))
}

/// Collects the outlines of glyphs side by side, in units of the font.
struct Pen {
    outline: PathBuilder,
    /// Horizontal start of the current glyph.
    x: f32,
}

impl OutlineBuilder for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        self.outline.move_to(self.x + x, y);
    }
    fn line_to(&mut self, x: f32, y: f32) {
        self.outline.line_to(self.x + x, y);
    }
    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.outline.quad_to(self.x + x1, y1, self.x + x, y);
    }
    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.outline.cubic_to(self.x + x1, y1, self.x + x2, y2, self.x + x, y);
    }
    fn close(&mut self) {
        self.outline.close();
    }
}

/// Returns `text`. If it is wider than `width_px`, returns its longest beginning that fits, followed by `…`.
pub fn shorten(text: &str, size_px: f64, width_px: f64) -> String {
    if text_width_px(text, size_px) <= width_px {
        return text.to_owned();
    }
    // The width increases with every character, so bisection finds the longest beginning that fits.
    let ends: Vec<usize> = text.char_indices().map(|(end, _)| end).collect();
    let shortened = |end: usize| text[..end].trim_end().to_owned() + "…";
    let n_fitting = ends.partition_point(|end| text_width_px(&shortened(*end), size_px) <= width_px);
    n_fitting.checked_sub(1).map_or_else(String::new, |last| shortened(ends[last]))
}

/// Breaks `text` at spaces into lines of at most `width_px`. A single word that is wider is shortened.
pub fn wrapped(text: &str, size_px: f64, width_px: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        let joined = lines.last().map(|line| format!("{line} {word}"));
        match (joined.filter(|joined| text_width_px(joined, size_px) <= width_px), lines.last_mut()) {
            (Some(joined), Some(line)) => *line = joined,
            _ => lines.push(shorten(word, size_px, width_px)),
        }
    }
    lines
}

/// Breaks `text` into lines like [`wrapped`], but into at most `most` lines (and at least one). If words are omitted, the last line ends in `…`.
pub fn wrapped_to(text: &str, size_px: f64, width_px: f64, most: usize) -> Vec<String> {
    let mut lines = wrapped(text, size_px, width_px);
    let most = most.max(1);
    if lines.len() > most {
        let last = lines[most - 1].trim_end_matches(|c: char| !c.is_alphanumeric()).to_owned() + "…";
        lines.truncate(most - 1);
        lines.push(last);
    }
    // With the mark `…` the last line may be too wide, so it is shortened.
    lines.iter().map(|line| shorten(line, size_px, width_px)).collect()
}

/// Largest font size from `smallest_px` to `size_px` at which `text` fits into `width_px`.
pub fn fitting_size_px(text: &str, size_px: f64, smallest_px: f64, width_px: f64) -> f64 {
    let width_at_one = text_width_px(text, 1.0);
    if width_at_one <= 0.0 { size_px } else { (width_px / width_at_one).clamp(smallest_px, size_px) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_character_the_figures_use_is_in_the_font() {
        let font = font().unwrap();
        for character in "0123456789+−×·⁰¹²³⁴⁵⁶⁷⁸⁹⁻₀₁₂₃µμΩαβγδεζηθκλνρσστφχψω≤≥≈±→←↑↓–—…√∞°·•äöüßéèçñŁő".chars()
        {
            assert!(font.glyph_index(character).is_some(), "{character} is missing");
        }
    }

    #[test]
    fn widths_agree_with_the_renderer() {
        let text = "E = 3.53 Pa·s −×10⁻³ mm";
        let svg = format!(
            "<svg xmlns='http://www.w3.org/2000/svg' width='900' height='90'><text x='10' y='50' font-family='DejaVu Sans' font-size='20'>{text}</text></svg>"
        );
        let options = resvg::usvg::Options { fontdb: crate::layout_tests::database(), ..Default::default() };
        let tree = resvg::usvg::Tree::from_str(&svg, &options).unwrap();
        let rendered = f64::from(tree.root().layer_bounding_box().width());
        let computed = text_width_px(text, 20.0);
        // The drawn glyphs are narrower than the sum of their advance widths, by the space at both ends and by kerning.
        assert!((rendered / computed - 1.0).abs() < 0.03, "{rendered} against {computed}");
    }

    #[test]
    fn shortened_text_fits() {
        let long = "a specimen whose name is far too long for any axis of any figure";
        let short = shorten(long, 12.0, 120.0);
        assert!(short.ends_with('…') && text_width_px(&short, 12.0) <= 120.0);
        assert_eq!(shorten("E (Pa)", 12.0, 120.0), "E (Pa)");
        assert_eq!(shorten("ab   cdefghijk", 12.0, text_width_px("ab …", 12.0)), "ab…");
        assert_eq!((shorten("abc", 12.0, 13.0), shorten("abc", 12.0, 1.0)), ("…".into(), String::new()));
    }

    #[test]
    fn wrapped_lines_fit_and_lose_no_word() {
        let long = "a sentence whose length is far beyond the width of any figure that could hold it";
        let lines = wrapped(long, 12.0, 120.0);
        assert!(lines.len() > 3 && lines.iter().all(|line| text_width_px(line, 12.0) <= 120.0), "{lines:?}");
        assert_eq!(lines.join(" "), long);
        assert_eq!(wrapped("", 12.0, 120.0), Vec::<String>::new());
        assert!(wrapped("incomprehensibilities", 12.0, 60.0)[0].ends_with('…'));
        let cut = wrapped_to(long, 12.0, 120.0, 2);
        assert!(cut.len() == 2 && cut[0] == lines[0] && cut[1].ends_with('…'), "{cut:?}");
        assert!(cut.iter().all(|line| text_width_px(line, 12.0) <= 120.0), "{cut:?}");
        assert_eq!(wrapped_to(long, 12.0, 120.0, 99), lines);
    }
}
