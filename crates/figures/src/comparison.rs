//! Figure of a model's comparison with the measurement: positions over predictive bands, then residuals in µm, then whitened residuals.

use super::axes::{Axes, AxisStyle, title, widest_y_number_px};
use super::legend::{self, Entry, Mark};
use super::number::format_significant;
use super::palette::{BLUE, INK, MUTED, SKY, VERMILLION};
use super::svg::{Fill, Rect, Stroke, Svg};
use super::ticks::AxisScale;
use base::error::InputPlace;
use base::{Error, Result};

const WIDTH_PX: f64 = 960.0;
const MAIN_HEIGHT_PX: f64 = 300.0;
const RESIDUAL_HEIGHT_PX: f64 = 165.0;
/// Half-width of the central 90 % interval of a normal distribution, in standard deviations.
const NORMAL_90: f64 = 1.6449;
const KNOWN: Stroke = Stroke { colour: VERMILLION, width_px: 1.2, opacity: 1.0, dash: Some((6.0, 4.0)) };

/// Content of the figure. All slices with one value per row have equal lengths.
#[derive(Debug, Clone)]
pub struct ComparisonData<'a> {
    /// Title of the figure.
    pub title: &'a str,
    /// Time of each row, in s.
    pub time_s: &'a [f64],
    /// Measured position of each row, in µm; `None` for rows without a position.
    pub position_um: &'a [Option<f64>],
    /// Predicted position of each row, in µm.
    pub model_um: &'a [f64],
    /// Standard deviation of each prediction, including noise, in µm.
    pub sd_um: &'a [f64],
    /// Residual of each row without the noise's correlation, in standard deviations; `None` for rows that are not compared.
    pub whitened: &'a [Option<f64>],
    /// Time (s) and position (µm) of each outlier.
    pub outliers: Vec<(f64, f64)>,
    /// Times of force steps, in s.
    pub step_s: &'a [f64],
    /// Start and end of the held-out cycle, in s; `None` without one.
    pub heldout_s: Option<[f64; 2]>,
    /// Noise standard deviation (µm) and its source; `None` if it is unknown.
    pub noise: Option<(f64, &'a str)>,
}

/// Draws the figure of a comparison.
///
/// # Errors
/// [`Error::Input`] for unequal lengths or fewer than two rows.
pub fn comparison(data: &ComparisonData) -> Result<Svg> {
    let n = data.time_s.len();
    let lengths = [data.position_um.len(), data.model_um.len(), data.sd_um.len(), data.whitened.len()];
    if n < 2 || lengths.iter().any(|length| *length != n) {
        return Err(Error::input(
            InputPlace::default().at_key("comparison figure"),
            format!("there are {n} times and {lengths:?} values"),
            "give one value per row, and at least two rows",
        ));
    }
    let bands = data.model_um.iter().zip(data.sd_um).flat_map(|(x, sd)| [x - NORMAL_90 * sd, x + NORMAL_90 * sd]);
    let time = AxisScale::linear(data.time_s[0], data.time_s[n - 1]);
    let left_out = data.outliers.iter().map(|(_, y)| *y);
    let position = AxisScale::over(data.position_um.iter().flatten().copied().chain(bands).chain(left_out), 0.05);
    let white = AxisScale::over(data.whitened.iter().flatten().copied().chain([-3.5, 3.5]), 0.06);
    let residuals = data.time_s.iter().zip(data.position_um).zip(data.model_um);
    let left_um: Vec<(f64, f64)> = residuals.filter_map(|((t, y), x)| y.map(|y| (*t, y - x))).collect();
    let limits_um: Vec<f64> = data.noise.iter().flat_map(|(um, _)| [-NORMAL_90 * um, NORMAL_90 * um]).collect();
    let room_um = limits_um.iter().map(|limit_um| 2.0 * limit_um);
    let left_scale = AxisScale::over(left_um.iter().map(|(_, left)| *left).chain(room_um), 0.06);
    let left = [(&position, 8), (&left_scale, 6), (&white, 6)]
        .map(|(scale, most)| widest_y_number_px(scale, most))
        .into_iter()
        .fold(0.0, f64::max)
        + 42.0;
    let width = WIDTH_PX - left - 18.0;
    let entries = entries(data, &position, &left_scale);
    let top = 36.0 + legend::row_height_px(&entries, width) + 8.0;
    let main = Axes { frame: Rect { x: left, y: top, width, height: MAIN_HEIGHT_PX }, x: time, y: position };
    let below = |above: &Axes, y: AxisScale| {
        let frame = Rect { y: above.frame.bottom() + 14.0, height: RESIDUAL_HEIGHT_PX, ..above.frame };
        Axes { frame, x: time, y }
    };
    let difference = below(&main, left_scale);
    let residual = below(&difference, white);
    let height = residual.frame.bottom() + 52.0;
    let mut svg = Svg::new(WIDTH_PX, height, "Measured position over predictive bands, and residuals");
    title(&mut svg, data.title, (left, 24.0), width);
    legend::row(&mut svg, &entries, (left, 36.0), width);
    for axes in [&main, &difference, &residual] {
        shade(&mut svg, axes, data);
    }
    main.y_axis(&mut svg, AxisStyle::new(Some("position (µm)"), 8, left - 8.0).grid());
    difference.y_axis(&mut svg, AxisStyle::new(Some("residual (µm)"), 6, left - 8.0).grid());
    residual.y_axis(&mut svg, AxisStyle::new(Some("whitened residual (σ)"), 6, left - 8.0).grid());
    draw_main(&mut svg, &main, data);
    svg.clipped(difference.frame, |svg| {
        let [lower, upper] = residual_band_um(data);
        difference.band(svg, data.time_s, &lower, &upper, Fill::new(BLUE, 0.25));
        difference.horizontal(svg, 0.0, Stroke::solid(BLUE, 1.3));
        for limit in limits_um {
            difference.horizontal(svg, limit, KNOWN);
        }
        difference.scatter(svg, left_um.iter().copied(), INK, 2.6, 0.75);
    });
    draw_residuals(&mut svg, &residual, data);
    difference.x_axis(&mut svg, AxisStyle::new(None, 10, 38.0));
    difference.outline(&mut svg);
    main.x_axis(&mut svg, AxisStyle::new(None, 10, 38.0));
    residual.x_axis(&mut svg, AxisStyle::new(Some("time (s); grey lines: force steps"), 10, 38.0).overhang_px(16.0));
    main.outline(&mut svg);
    residual.outline(&mut svg);
    Ok(svg)
}

fn entries(data: &ComparisonData, position: &AxisScale, residual: &AxisScale) -> Vec<Entry> {
    let [lower, upper] = residual_band_um(data);
    let thickness_px = (MAIN_HEIGHT_PX * position.largest_distance(&lower, &upper))
        .max(RESIDUAL_HEIGHT_PX * residual.largest_distance(&lower, &upper));
    let band = legend::band_text("90 % predictive band, with the fitted noise", thickness_px);
    let mut entries = vec![
        Entry::new(Mark::Dot(INK, 3.6), "measured"),
        Entry::new(Mark::Line(Stroke::solid(BLUE, 1.8)), "model"),
        Entry::new(Mark::Area(Fill::new(BLUE, 0.3).into()), band),
        Entry::new(Mark::Dot(VERMILLION, 4.5), "whitened residual beyond 3 σ"),
    ];
    if let Some((um, origin)) = data.noise {
        let text = format!("90 % of the noise of {} µm ({origin})", format_significant(um, 2));
        entries.insert(3, Entry::new(Mark::Line(KNOWN), text));
    }
    if !data.outliers.is_empty() {
        entries.push(Entry::new(Mark::Dot(MUTED, 5.0), "outlier, not used"));
    }
    if data.heldout_s.is_some() {
        entries.push(Entry::new(Mark::Area(Fill::new(SKY, 0.3).into()), "held out"));
    }
    entries
}

/// Limits of the 90 % predictive band about the model at each row, in µm.
fn residual_band_um(data: &ComparisonData) -> [Vec<f64>; 2] {
    [-NORMAL_90, NORMAL_90].map(|factor| data.sd_um.iter().map(|sd| factor * sd).collect())
}

fn shade(svg: &mut Svg, axes: &Axes, data: &ComparisonData) {
    if let Some([from, to]) = data.heldout_s {
        let (left, right) = (axes.x_px(from), axes.x_px(to));
        svg.rect(Rect { x: left, width: right - left, ..axes.frame }, Fill::new(SKY, 0.14));
    }
    axes.verticals(svg, data.step_s, Stroke::solid(MUTED, 0.8).opacity(0.45));
}

fn draw_main(svg: &mut Svg, axes: &Axes, data: &ComparisonData) {
    let edge =
        |factor: f64| -> Vec<f64> { data.model_um.iter().zip(data.sd_um).map(|(x, sd)| x + factor * sd).collect() };
    svg.clipped(axes.frame, |svg| {
        axes.band(svg, data.time_s, &edge(-NORMAL_90), &edge(NORMAL_90), Fill::new(BLUE, 0.25));
        axes.line(svg, data.time_s, data.model_um, Stroke::solid(BLUE, 1.3));
        let points = data.time_s.iter().zip(data.position_um).filter_map(|(t, y)| y.map(|y| (*t, y)));
        axes.scatter(svg, points, INK, 2.2, 0.75);
        axes.scatter(svg, data.outliers.iter().copied(), MUTED, 5.0, 1.0);
    });
}

fn draw_residuals(svg: &mut Svg, axes: &Axes, data: &ComparisonData) {
    svg.clipped(axes.frame, |svg| {
        axes.horizontal(svg, 0.0, Stroke::solid(BLUE, 1.3));
        for limit in [-NORMAL_90, NORMAL_90] {
            axes.horizontal(svg, limit, Stroke::solid(BLUE, 1.0).dashed(6.0, 4.0));
        }
        let points = || data.time_s.iter().zip(data.whitened).filter_map(|(t, r)| r.map(|r| (*t, r)));
        axes.scatter(svg, points().filter(|(_, r)| r.abs() <= 3.0), INK, 2.6, 0.75);
        axes.scatter(svg, points().filter(|(_, r)| r.abs() > 3.0), VERMILLION, 4.5, 1.0);
    });
}
