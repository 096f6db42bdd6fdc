//! Figure of a model's discrepancy, which is the part of the residuals that no effect explains. There is one panel with a 90 % band for each term of the
//! discrepancy, such as a function of time.

use super::axes::{Axes, AxisStyle, title_with_text, widest_y_number_px};
use super::legend::{self, Entry, Mark};
use super::palette::{AXIS, MUTED, VERMILLION};
use super::svg::{Fill, Rect, Stroke, Svg};
use super::ticks::AxisScale;
use base::error::InputPlace;
use base::{Error, Result};

const WIDTH_PX: f64 = 820.0;
const MARGIN_PX: f64 = 20.0;
const HEIGHT_PX: f64 = 300.0;
const FOOT_PX: f64 = 60.0;
/// Maximum number of points of a curve. If there are more rows, they are averaged in bins.
const MOST_POINTS: usize = 160;
/// Half-width of a central 90 % band of a normal distribution, in standard deviations.
const BAND_SDS: f64 = 1.645;

/// One term of the discrepancy, with one value per row. Rows may be in any order, and all lists have equal lengths.
#[derive(Debug, Clone)]
pub struct DiscrepancyPanel {
    /// Text for the curve in the legend.
    pub legend_text: String,
    /// Quantity and unit of the horizontal axis, such as `time since the force step (s)`.
    pub axis_label: String,
    /// True if the axis is logarithmic. Rows whose coordinate is not positive are then omitted.
    pub is_logarithmic: bool,
    /// Coordinate of each row along the axis.
    pub coordinate: Vec<f64>,
    /// Estimated discrepancy of each row, in µm.
    pub mean_um: Vec<f64>,
    /// Standard deviation of the estimate, in µm. If it is 0 in all rows, no band is drawn.
    pub sd_um: Vec<f64>,
    /// Residual of each row, in µm; not finite for rows without a measurement.
    pub residual_um: Vec<f64>,
}

/// Point of the curve: an average over the rows in one bin of the coordinate.
struct BandPoint {
    coordinate: f64,
    mean_um: f64,
    sd_um: f64,
    residual_um: f64,
}

/// Draws the panels below each other, under a heading and a text. Each shows the curve, its 90 % band and averaged residuals.
///
/// # Errors
/// [`Error::Input`] for series of unequal length or fewer than two different values along an axis.
pub fn discrepancy(panels: &[DiscrepancyPanel], heading: &str, text: &str) -> Result<Svg> {
    let drawn: Vec<(Vec<BandPoint>, &DiscrepancyPanel)> =
        panels.iter().map(|panel| Ok((points(panel)?, panel))).collect::<Result<_>>()?;
    let width = WIDTH_PX - 2.0 * MARGIN_PX;
    let draw = |svg: &mut Svg| {
        let below = MARGIN_PX + title_with_text(svg, heading, text, (MARGIN_PX, MARGIN_PX), width) + 8.0;
        drawn.iter().fold(below, |below, (points, panel)| draw_panel(svg, points, panel, below))
    };
    Ok(Svg::drawn(WIDTH_PX, "Discrepancy of the model, with its band", 0.0, draw))
}

/// Draws a panel with the upper edge at `top`, and returns the position of its lower edge.
fn draw_panel(svg: &mut Svg, points: &[BandPoint], panel: &DiscrepancyPanel, top: f64) -> f64 {
    let x: Vec<f64> = points.iter().map(|point| point.coordinate).collect();
    let of = |value: &dyn Fn(&BandPoint) -> f64| points.iter().map(value).collect::<Vec<f64>>();
    let mean = of(&|point| point.mean_um);
    let lower = of(&|point| point.mean_um - BAND_SDS * point.sd_um);
    let upper = of(&|point| point.mean_um + BAND_SDS * point.sd_um);
    let residual = of(&|point| point.residual_um);
    let shown = lower.iter().chain(&upper).chain(&residual).copied().chain([0.0]).filter(|value| value.is_finite());
    let y_scale = AxisScale::over(shown, 0.06);
    let (first, last) = (x[0], x[x.len() - 1]);
    let x_scale = if panel.is_logarithmic { AxisScale::log10(first, last) } else { AxisScale::linear(first, last) };
    let left = widest_y_number_px(&y_scale, 7) + 52.0;
    let width = WIDTH_PX - left - 22.0;
    let has_band = points.iter().any(|point| point.sd_um > 0.0);
    let top = top + legend::row(svg, &entries(&panel.legend_text, has_band), (left, top), width) + 8.0;
    let frame = Rect { x: left, y: top, width, height: HEIGHT_PX };
    let axes = Axes { frame, x: x_scale, y: y_scale };
    axes.y_axis(svg, AxisStyle::new(Some("residual (µm)"), 7, left - 18.0).grid());
    axes.x_axis(svg, AxisStyle::new(Some(&panel.axis_label), 10, 38.0));
    svg.clipped(frame, |svg| {
        if has_band {
            axes.band(svg, &x, &lower, &upper, Fill::new(VERMILLION, 0.22));
        }
        axes.horizontal(svg, 0.0, Stroke::solid(AXIS, 1.0));
        axes.scatter(svg, x.iter().copied().zip(residual.iter().copied()), MUTED, 4.0, 0.8);
        axes.line(svg, &x, &mean, Stroke::solid(VERMILLION, 2.2));
    });
    axes.outline(svg);
    frame.bottom() + FOOT_PX
}

fn entries(what: &str, has_band: bool) -> Vec<Entry> {
    let line = Stroke::solid(VERMILLION, 2.2);
    let mark = if has_band { Mark::LineOnArea(line, Fill::new(VERMILLION, 0.22)) } else { Mark::Line(line) };
    vec![Entry::new(Mark::Dot(MUTED, 5.0), "residuals, averaged"), Entry::new(mark, what)]
}

/// Averages the rows in bins of equal width along the axis. Bins without rows are omitted.
fn points(rows: &DiscrepancyPanel) -> Result<Vec<BandPoint>> {
    let refuse =
        |found: String, remedy: &str| Err(Error::input(InputPlace::default().at_key("discrepancy"), found, remedy));
    let n = rows.coordinate.len();
    if [rows.mean_um.len(), rows.sd_um.len(), rows.residual_um.len()] != [n; 3] {
        return refuse("the series have unequal lengths".into(), "give one value per row");
    }
    let along = |row: usize| if rows.is_logarithmic { rows.coordinate[row].ln() } else { rows.coordinate[row] };
    let is_shown = |row: &usize| along(*row).is_finite() && rows.mean_um[*row].is_finite();
    let shown: Vec<usize> = (0..n).filter(is_shown).collect();
    let lowest = shown.iter().map(|row| along(*row)).fold(f64::INFINITY, f64::min);
    let highest = shown.iter().map(|row| along(*row)).fold(f64::NEG_INFINITY, f64::max);
    if shown.is_empty() || highest <= lowest {
        return refuse(
            format!("the {} rows do not have two different values of the axis", shown.len()),
            "give rows with at least two different values",
        );
    }
    let bin = |row: usize| (((along(row) - lowest) / (highest - lowest)) * (MOST_POINTS - 1) as f64).round() as usize;
    let mut bins: Vec<Vec<usize>> = vec![Vec::new(); MOST_POINTS];
    shown.iter().for_each(|row| bins[bin(*row)].push(*row));
    let average = |values: &[f64], of: &[usize]| of.iter().map(|row| values[*row]).sum::<f64>() / of.len() as f64;
    let point = |of: &Vec<usize>| {
        let measured: Vec<usize> = of.iter().copied().filter(|row| rows.residual_um[*row].is_finite()).collect();
        BandPoint {
            coordinate: average(&rows.coordinate, of),
            mean_um: average(&rows.mean_um, of),
            sd_um: average(&rows.sd_um, of),
            residual_um: average(&rows.residual_um, &measured),
        }
    };
    Ok(bins.iter().filter(|of| !of.is_empty()).map(point).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panel(coordinate: &[f64], values: &[f64]) -> DiscrepancyPanel {
        DiscrepancyPanel {
            legend_text: "unexplained, 90 % band".into(),
            axis_label: "time since the force step (s)".into(),
            is_logarithmic: true,
            coordinate: coordinate.to_vec(),
            mean_um: values.to_vec(),
            sd_um: values.to_vec(),
            residual_um: values.to_vec(),
        }
    }

    #[test]
    fn rows_at_one_place_are_averaged_and_those_off_a_logarithmic_axis_left_out() {
        let found = points(&panel(&[1.0, 1.0, 10.0, 0.0], &[2.0, 4.0, 5.0, 100.0])).unwrap();
        let of: Vec<(f64, f64)> = found.iter().map(|point| (point.coordinate, point.mean_um)).collect();
        assert_eq!(of, [(1.0, 3.0), (10.0, 5.0)]);
    }

    #[test]
    fn rows_that_were_not_measured_have_a_curve_and_no_dot() {
        let unmeasured =
            DiscrepancyPanel { residual_um: vec![1.0, f64::NAN, 3.0], ..panel(&[1.0, 2.0, 4.0], &[1.0, 2.0, 3.0]) };
        let svg = discrepancy(&[unmeasured], "heading", "text").unwrap();
        assert!(svg.document().contains("90 % band") && !svg.document().contains("NaN"));
        assert!(svg.png().is_ok());
    }

    #[test]
    fn parts_stand_one_below_the_other_and_what_is_known_has_no_band() {
        let known =
            DiscrepancyPanel { legend_text: "slip".into(), sd_um: vec![0.0; 2], ..panel(&[1.0, 2.0], &[1.0, 2.0]) };
        let parts = |panels: &[DiscrepancyPanel]| discrepancy(panels, "heading", "text").unwrap().document();
        let (one, both) = (parts(std::slice::from_ref(&known)), parts(&[known, panel(&[1.0, 2.0], &[1.0, 2.0])]));
        assert!(one.contains(">slip<") && !one.contains("fill-opacity=\"0.22\""), "{one}");
        assert!(
            both.contains(">slip<") && both.contains("90 % band") && both.contains("fill-opacity=\"0.22\""),
            "{both}"
        );
    }

    #[test]
    fn what_cannot_be_drawn_is_refused() {
        let refused = |panel: DiscrepancyPanel| discrepancy(&[panel], "", "").unwrap_err().to_string();
        assert!(refused(panel(&[], &[])).contains("the 0 rows do not have two different values of the axis"));
        assert!(
            refused(panel(&[2.0, 2.0], &[1.0, 1.0]))
                .contains("the 2 rows do not have two different values of the axis")
        );
        assert!(refused(panel(&[1.0, 2.0], &[1.0])).contains("the series have unequal lengths"));
    }
}
