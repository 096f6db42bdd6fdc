//! Figure of a shape study: trajectories as in the paper's Figs. 7 and 8, beside the bodies drawn to scale.

use super::bodies::StudyBody;
use super::job::{BodyStiffness, ShapesResult};
use base::error::Result;
use documents::shapes::ShapesSummary;
use documents::shapes::{BodyShape, SizeRule};
use figures::palette::{Colour, series};
use figures::shapes::{Outline, ShapeCurve, ShapesFigure, ShapesPanel, shapes};
use figures::svg::Svg;
use record::Orientation;

/// Draws the figure of a shape study.
///
/// # Errors
/// Errors of drawing the figure.
pub fn shapes_figure(found: &ShapesResult, summary: &ShapesSummary) -> Result<Svg> {
    let curve = |(index, body_stiffness): (usize, &BodyStiffness)| {
        let quantile =
            |k: usize| found.force_per_pa.iter().map(|row| 1e6 * row[k] / body_stiffness.stiffness_m).collect();
        ShapeCurve {
            label: body_stiffness.body.label(),
            colour: colour(index),
            is_dashed: body_stiffness.body.orientation == Orientation::Vertical,
            lower_um: quantile(0),
            median_um: quantile(1),
            upper_um: quantile(2),
            outline: outline(&body_stiffness.body),
        }
    };
    let panel = |rule: SizeRule| ShapesPanel {
        title: format!("{} (Fig. {})", rule.title(), if rule == SizeRule::EqualVolume { 7 } else { 8 }),
        curves: found.studied[0]
            .solved
            .iter()
            .filter(|body_stiffness| body_stiffness.body.rule == rule)
            .enumerate()
            .map(curve)
            .collect(),
    };
    shapes(&ShapesFigure {
        title: format!(
            "Robots of aspect ratio {:.2} at ±{} µN: median and 90 % band of the posterior",
            summary.aspect, summary.force_un
        ),
        time_s: &found.time_s,
        panels: SizeRule::ALL.into_iter().map(panel).collect(),
    })
}

/// Colour of a shape. Colours distinguish shapes, and dashes distinguish orientations.
fn colour(index: usize) -> Colour {
    series(index.div_ceil(2))
}

fn outline(body: &StudyBody) -> Outline {
    let [along, across] = body.sizes_m().map(|x| 1e3 * x);
    let (width_mm, height_mm) =
        if body.orientation == Orientation::Horizontal { (along, across) } else { (across, along) };
    Outline { width_mm, height_mm, is_round: body.shape != BodyShape::Cylinder }
}
