//! Places names of vertical lines above a frame, so that names and lines do not overlap.

use super::axes::Axes;
use super::font::{shorten, text_width_px};
use super::palette::WHITE;
use super::svg::{Anchor, Fill, Rect, Stroke, Svg, TextStyle};

/// Font size of the names, in pixels.
const SIZE_PX: f64 = 10.0;
/// Height of a row of names, in pixels.
pub const ROW_PX: f64 = 13.0;
/// Distance between a name and its line, in pixels.
const GAP_PX: f64 = 3.0;
const BETWEEN_PX: f64 = 8.0;

/// Name of a vertical line, with its place above the frame.
#[derive(Debug, Clone)]
pub struct Flag {
    text: String,
    /// Horizontal position of the line in pixels; `None` if the value lies beyond the axis.
    line_px: Option<f64>,
    /// Left edge and width of the name, in pixels.
    left_px: f64,
    width_px: f64,
    /// Row of the name, counted upwards from the frame, from 0.
    row: usize,
}

/// Places names above `axes`, at the positions of their values. Names may extend beyond the axes by `overhang_px` on both sides. If a value lies beyond an end
/// of the axis, its name is at that end, with an arrow.
pub fn place_line_labels(axes: &Axes, values: &[(&str, f64)], overhang_px: f64) -> Vec<Flag> {
    let frame = axes.frame;
    let (left, right) = (frame.x - overhang_px, frame.right() + overhang_px);
    let mut ascending: Vec<(&str, f64)> = values.to_vec();
    ascending.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut placed: Vec<Flag> = Vec::new();
    // Names are usually to the right of their lines, so they are placed from right to left. Each line then passes beside the names that are already placed.
    for (name, value) in ascending.into_iter().rev() {
        let fraction = axes.x.fraction(value);
        let line_px = (0.0..=1.0).contains(&fraction).then(|| axes.x_px(value));
        let text = match line_px {
            Some(_) => name.to_owned(),
            None if fraction < 0.0 => format!("← {name}"),
            None => format!("{name} →"),
        };
        let text = shorten(&text, SIZE_PX, right - left);
        let width_px = text_width_px(&text, SIZE_PX);
        // A name is beside its line if there is room, otherwise at the upper end of the line.
        let rows = 0..=placed.len();
        let beside = |x: f64| [x + GAP_PX, x - GAP_PX - width_px];
        let last_resort = match line_px {
            Some(x) => (x - width_px / 2.0).clamp(left, (right - width_px).max(left)),
            None if fraction < 0.0 => frame.x.min(right - width_px),
            None => (frame.right() - width_px).max(left),
        };
        let places =
            rows.clone().flat_map(|row| line_px.into_iter().flat_map(beside).map(move |left_px| (row, left_px)));
        let places = places.chain(rows.clone().map(|row| (row, last_resort)));
        let inside = |left_px: f64| left_px >= left - 0.01 && left_px + width_px <= right + 0.01;
        let flags: Vec<Flag> = places
            .filter(|(_, left_px)| inside(*left_px))
            .map(|(row, left_px)| Flag { text: text.clone(), line_px, left_px, width_px, row })
            .collect();
        let free = |strictly: bool| flags.iter().find(|flag| placed.iter().all(|other| !flag.meets(other, strictly)));
        // If there is no other place, the line passes behind a name and is interrupted there.
        placed.extend(free(true).or_else(|| free(false)).cloned());
    }
    placed
}

impl Flag {
    fn meets(&self, other: &Self, strictly: bool) -> bool {
        let names_meet = self.row == other.row
            && self.left_px < other.left_px + other.width_px + BETWEEN_PX
            && other.left_px < self.left_px + self.width_px + BETWEEN_PX;
        let crosses = |line: &Self, name: &Self| {
            let through = |x: f64| x > name.left_px - GAP_PX + 0.5 && x < name.left_px + name.width_px + GAP_PX - 0.5;
            line.row >= name.row && line.line_px.is_some_and(through)
        };
        names_meet || strictly && (crosses(self, other) || crosses(other, self))
    }

    /// Draws the line through the frame and up to its name. [`Flag::draw_name`] writes the name.
    pub fn draw_line(&self, svg: &mut Svg, frame: Rect, stroke: Stroke) {
        if let Some(x) = self.line_px {
            let beside = x < self.left_px || x > self.left_px + self.width_px;
            let top = frame.y - ROW_PX * (self.row as f64 + if beside { 0.8 } else { 0.0 });
            svg.line((x, top), (x, frame.bottom()), stroke);
        }
    }

    /// Writes the name of the line.
    pub fn draw_name(&self, svg: &mut Svg, frame: Rect, style: TextStyle) {
        let baseline = frame.y - ROW_PX * self.row as f64 - 3.5;
        let behind = Rect { x: self.left_px, y: baseline - 9.0, width: self.width_px, height: 11.0 };
        svg.rect(behind, Fill::new(WHITE, 1.0));
        let style = TextStyle { size_px: SIZE_PX, anchor: Anchor::Start, ..style };
        svg.text(&self.text, (self.left_px, baseline), style);
    }
}

/// Height in pixels of all names above the frame.
pub fn height_px(flags: &[Flag]) -> f64 {
    flags.iter().map(|flag| ROW_PX * (flag.row + 1) as f64).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ticks::AxisScale;

    fn axes() -> Axes {
        let frame = Rect { x: 100.0, y: 100.0, width: 300.0, height: 50.0 };
        Axes { frame, x: AxisScale::log10(1.0, 100.0), y: AxisScale::linear(0.0, 1.0) }
    }

    #[test]
    fn names_of_close_values_do_not_meet() {
        let values: Vec<(&str, f64)> = (0..7).map(|k| ("Sharif-Kashani 2011", 1.0 + 0.5 * f64::from(k))).collect();
        let values: Vec<(&str, f64)> = values.into_iter().chain([("a far one", 99.0)]).collect();
        let flags = place_line_labels(&axes(), &values, 10.0);
        assert_eq!(flags.len(), 8);
        for (i, flag) in flags.iter().enumerate() {
            assert!(flag.left_px >= 90.0 && flag.left_px + flag.width_px <= 410.0, "{flag:?}");
            assert!(flags[..i].iter().all(|other| !flag.meets(other, true)), "{flags:?}");
        }
        assert!(
            flags[0].left_px + flags[0].width_px < axes().x_px(99.0),
            "the last stands left of its line: {flags:?}"
        );
    }

    #[test]
    fn values_beyond_the_axis_are_named_at_its_end() {
        let flags = place_line_labels(&axes(), &[("small", 1e-3), ("large", 1e9)], 0.0);
        assert!(flags.iter().all(|flag| flag.line_px.is_none() && flag.row == 0));
        assert_eq!((flags[0].text.as_str(), flags[1].text.as_str()), ("large →", "← small"));
        assert_eq!(height_px(&flags), ROW_PX);
    }

    #[test]
    fn a_name_as_wide_as_the_frame_is_placed_all_the_same() {
        let long = "published by several groups over many years in journals of ophthalmology and of rheology alike";
        let flags = place_line_labels(&axes(), &[(long, 3.0), (long, 30.0), (long, 31.0)], 0.0);
        assert_eq!(flags.len(), 3);
        assert!(flags[0].row != flags[1].row && flags[1].row != flags[2].row && flags[0].row != flags[2].row);
    }
}
