//! Figure of a shape study: trajectories of robots of several shapes, with one panel per size rule. The bodies are drawn to scale beside them.

use std::f64::consts::PI;

use super::axes::{Axes, AxisStyle, TICK_SIZE_PX, title};
use super::palette::{AXIS, Colour, INK, MUTED};
use super::svg::{Anchor, Fill, Path, Rect, Stroke, Style, Svg, TextStyle};
use super::ticks::AxisScale;
use base::error::InputPlace;
use base::{Error, Result};

const MARGIN_PX: f64 = 20.0;
const HEADING_PX: f64 = 34.0;
const PANEL_TITLE_PX: f64 = 24.0;
const CURVES_WIDTH_PX: f64 = 520.0;
const CURVES_HEIGHT_PX: f64 = 340.0;
const AXIS_LEFT_PX: f64 = 62.0;
const AXIS_FOOT_PX: f64 = 46.0;
const BODIES_WIDTH_PX: f64 = 380.0;
const GAP_PX: f64 = 26.0;
const LABEL_PX: f64 = 150.0;
const BODY_GAP_PX: f64 = 12.0;
const LONGEST_BAR_PX: f64 = 60.0;
const BAND_OPACITY: f64 = 0.16;

/// Outline of a body in the plane that contains its axis and the force. The force points to the right.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outline {
    /// Extent along the force, in mm.
    pub width_mm: f64,
    /// Extent across the force, in mm.
    pub height_mm: f64,
    /// True for an ellipse, false for a rectangle.
    pub is_round: bool,
}

/// Trajectory of a body, with its uncertainty.
#[derive(Debug, Clone, PartialEq)]
pub struct ShapeCurve {
    /// Name of the body.
    pub label: String,
    /// Colour of the body and its trajectory.
    pub colour: Colour,
    /// True if the trajectory is a dashed line.
    pub is_dashed: bool,
    /// 5 % quantile of the position at every time, in µm.
    pub lower_um: Vec<f64>,
    /// Median of the position at every time, in µm.
    pub median_um: Vec<f64>,
    /// 95 % quantile of the position at every time, in µm.
    pub upper_um: Vec<f64>,
    /// Outline of the body.
    pub outline: Outline,
}

/// Panel with the bodies of one size rule, such as equal volume.
#[derive(Debug, Clone, PartialEq)]
pub struct ShapesPanel {
    /// Name of the size rule, such as equal volume.
    pub title: String,
    /// Trajectories of the bodies.
    pub curves: Vec<ShapeCurve>,
}

/// Content of the figure of a shape study: title, times, and one panel per size rule.
#[derive(Debug, Clone, PartialEq)]
pub struct ShapesFigure<'a> {
    /// Title of the figure.
    pub title: String,
    /// Times of all trajectories, in s.
    pub time_s: &'a [f64],
    /// Panels, from top to bottom.
    pub panels: Vec<ShapesPanel>,
}

/// Draws the figure of a shape study.
///
/// # Errors
/// [`Error::Input`] for no bodies, or curves that are not finite or not as long as the times.
pub fn shapes(data: &ShapesFigure) -> Result<Svg> {
    check(data)?;
    let width = MARGIN_PX + AXIS_LEFT_PX + CURVES_WIDTH_PX + GAP_PX + BODIES_WIDTH_PX + MARGIN_PX;
    let panel_height = PANEL_TITLE_PX + CURVES_HEIGHT_PX + AXIS_FOOT_PX;
    let height = MARGIN_PX + HEADING_PX + data.panels.len() as f64 * (panel_height + GAP_PX);
    let mut svg = Svg::new(width, height, &data.title);
    title(&mut svg, &data.title, (MARGIN_PX, MARGIN_PX + 14.0), width - 2.0 * MARGIN_PX);
    let all = || data.panels.iter().flat_map(|panel| &panel.curves);
    let y = AxisScale::over(
        all().flat_map(|shape_curve| shape_curve.lower_um.iter().chain(&shape_curve.upper_um)).copied(),
        0.05,
    );
    let x = AxisScale::over(data.time_s.iter().copied(), 0.0);
    let px_per_mm = data.panels.iter().map(px_per_mm).fold(f64::INFINITY, f64::min);
    for (index, panel) in data.panels.iter().enumerate() {
        let top = MARGIN_PX + HEADING_PX + index as f64 * (panel_height + GAP_PX);
        svg.text(&panel.title, (MARGIN_PX, top + 12.0), TextStyle::new(14.0, Anchor::Start).colour(INK));
        let frame = Rect {
            x: MARGIN_PX + AXIS_LEFT_PX,
            y: top + PANEL_TITLE_PX,
            width: CURVES_WIDTH_PX,
            height: CURVES_HEIGHT_PX,
        };
        curves(&mut svg, &Axes { frame, x, y }, data.time_s, panel);
        let left = frame.right() + GAP_PX;
        bodies(&mut svg, Rect { x: left, width: BODIES_WIDTH_PX, ..frame }, px_per_mm, panel);
    }
    Ok(svg)
}

fn check(data: &ShapesFigure) -> Result<()> {
    let refuse = |found: &str| {
        let place = InputPlace::default().at_key("shapes");
        Err(Error::input(place, found, "give every body a finite value at every time"))
    };
    if data.time_s.len() < 2 || data.panels.iter().all(|panel| panel.curves.is_empty()) {
        return refuse("the figure needs a body and two times");
    }
    for shape_curve in data.panels.iter().flat_map(|panel| &panel.curves) {
        for values in [&shape_curve.lower_um, &shape_curve.median_um, &shape_curve.upper_um] {
            if values.len() != data.time_s.len() || values.iter().any(|x| !x.is_finite()) {
                return refuse(&format!("{}: a value is not finite, or a time has no value", shape_curve.label));
            }
        }
    }
    Ok(())
}

fn stroke(shape_curve: &ShapeCurve) -> Stroke {
    let solid = Stroke::solid(shape_curve.colour, 1.8);
    if shape_curve.is_dashed { solid.dashed(6.0, 4.0) } else { solid }
}

fn curves(svg: &mut Svg, axes: &Axes, time_s: &[f64], panel: &ShapesPanel) {
    axes.x_axis(svg, AxisStyle::new(Some("time (s)"), 6, 38.0).grid());
    axes.y_axis(svg, AxisStyle::new(Some("position (µm)"), 7, 54.0).grid());
    svg.clipped(axes.frame, |svg| {
        for shape_curve in &panel.curves {
            axes.band(
                svg,
                time_s,
                &shape_curve.lower_um,
                &shape_curve.upper_um,
                Fill::new(shape_curve.colour, BAND_OPACITY),
            );
        }
        for shape_curve in &panel.curves {
            axes.line(svg, time_s, &shape_curve.median_um, stroke(shape_curve));
        }
    });
    axes.outline(svg);
}

/// Minimum height in pixels of the row in which a body is drawn.
const LEAST_ROW_PX: f64 = TICK_SIZE_PX + 6.0;

/// Largest scale (pixels per mm) at which the bodies of a panel fit beside its curves.
fn px_per_mm(panel: &ShapesPanel) -> f64 {
    let n = panel.curves.len() as f64;
    let widest_mm = panel.curves.iter().map(|curve| curve.outline.width_mm).fold(f64::MIN_POSITIVE, f64::max);
    let total_mm: f64 = panel.curves.iter().map(|curve| curve.outline.height_mm).sum();
    let free_px = CURVES_HEIGHT_PX - BODY_GAP_PX * (n + 1.0) - LEAST_ROW_PX * n;
    ((BODIES_WIDTH_PX - LABEL_PX - 20.0) / widest_mm).min(free_px / total_mm.max(f64::MIN_POSITIVE))
}

/// Largest number of the form 1, 2 or 5 times a power of ten that does not exceed `most_mm`.
fn round_length_mm(most_mm: f64) -> f64 {
    let power = 10_f64.powf(most_mm.log10().floor());
    [5.0, 2.0].map(|digit| digit * power).into_iter().find(|length| *length <= most_mm).unwrap_or(power)
}

/// Draws each body with its name and a sample of its line. All bodies have one scale.
fn bodies(svg: &mut Svg, room: Rect, scale: f64, panel: &ShapesPanel) {
    let centre = room.x + LABEL_PX + 0.5 * (room.width - LABEL_PX);
    let mut top = room.y + BODY_GAP_PX;
    for shape_curve in &panel.curves {
        let height = (scale * shape_curve.outline.height_mm).max(LEAST_ROW_PX);
        let middle = top + 0.5 * height;
        svg.line((room.x, middle), (room.x + 22.0, middle), stroke(shape_curve));
        svg.text(
            &shape_curve.label,
            (room.x + 28.0, middle + 0.35 * TICK_SIZE_PX),
            TextStyle::new(TICK_SIZE_PX, Anchor::Start).colour(INK),
        );
        let (half_width, half_height) =
            (0.5 * scale * shape_curve.outline.width_mm, 0.5 * scale * shape_curve.outline.height_mm);
        let mut path = Path::default();
        if shape_curve.outline.is_round {
            let point = |i: usize| {
                let angle = 2.0 * PI * i as f64 / 72.0;
                (centre + half_width * angle.cos(), middle + half_height * angle.sin())
            };
            path.polyline((0..72).map(point), true);
        } else {
            let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
            path.polyline(corners.map(|(u, v)| (centre + u * half_width, middle + v * half_height)), true);
        }
        svg.path(&path, Style::from(Fill::new(shape_curve.colour, 0.55)));
        svg.path(&path, Stroke::solid(AXIS, 0.8));
        top += height + BODY_GAP_PX;
    }
    let bar_mm = round_length_mm(LONGEST_BAR_PX / scale);
    let (left, below) = (room.x + LABEL_PX, room.bottom() - 4.0);
    svg.line((left, below), (left + scale * bar_mm, below), Stroke::solid(INK, 1.5));
    let style = TextStyle::new(TICK_SIZE_PX, Anchor::Start).colour(MUTED);
    svg.text(&format!("{bar_mm} mm; force to the right and left"), (left + scale * bar_mm + 8.0, below + 4.0), style);
}

#[cfg(test)]
mod tests {
    use super::super::layout_tests::{LONG, assert_legible};
    use super::super::palette::series;
    use super::*;

    fn figure<'a>(time_s: &'a [f64], label: &str, outline: Outline) -> ShapesFigure<'a> {
        let values = |scale: f64| time_s.iter().map(|t| scale * t * (11.0 - t)).collect::<Vec<f64>>();
        let curve = |k: usize| ShapeCurve {
            label: format!("{label} {k}"),
            colour: series(k),
            is_dashed: k % 2 == 1,
            lower_um: values(9.0 + k as f64),
            median_um: values(10.0 + k as f64),
            upper_um: values(11.0 + k as f64),
            outline,
        };
        let panel = |title: &str| ShapesPanel { title: title.into(), curves: (0..5).map(curve).collect() };
        let panels = vec![panel("equal volume (Fig. 7)"), panel("equal surface (Fig. 8)")];
        ShapesFigure { title: LONG.into(), time_s, panels }
    }

    /// Figures of round bodies, and of slender bodies along and across the force, are legible. In each case another size determines the scale.
    #[test]
    fn bodies_of_any_proportion_are_legible() {
        let time_s: Vec<f64> = (0..=20).map(|i| 0.5 * f64::from(i)).collect();
        for (width_mm, height_mm) in [(0.5, 0.5), (9.0, 0.4), (0.4, 9.0), (1e-3, 1e-3)] {
            let outline = Outline { width_mm, height_mm, is_round: width_mm > 1.0 };
            let svg = shapes(&figure(&time_s, "ellipsoid, horizontal", outline)).unwrap();
            assert_legible(&format!("{width_mm} × {height_mm}"), &svg);
        }
    }

    #[test]
    fn what_cannot_be_drawn_is_refused() {
        let time_s: Vec<f64> = (0..=20).map(|i| 0.5 * f64::from(i)).collect();
        let outline = Outline { width_mm: 1.0, height_mm: 1.0, is_round: true };
        let mut figure = figure(&time_s, "sphere", outline);
        figure.panels[1].curves[2].upper_um[3] = f64::NAN;
        let error = shapes(&figure).unwrap_err().to_string();
        assert!(error.contains("sphere 2"), "{error}");
        figure.panels.clear();
        assert!(
            shapes(&figure).is_err_and(|error| error.to_string().contains("the figure needs a body and two times"))
        );
    }
}
