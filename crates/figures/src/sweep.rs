//! Figure of an oscillation: storage and loss modulus against frequency over the predictive band, and the residuals below.

use super::axes::{Axes, AxisStyle, title};
use super::legend::{self, Entry, Mark};
use super::palette::{BLUE, Colour, GRID, MUTED, VERMILLION, WHITE};
use super::svg::{Fill, Rect, Stroke, Svg};
use super::ticks::AxisScale;
use base::error::InputPlace;
use base::{Error, Result};

const WIDTH_PX: f64 = 760.0;
const MAIN_PX: f64 = 330.0;
const RESIDUAL_PX: f64 = 130.0;
const LEFT_PX: f64 = 86.0;
const DOT_PX: f64 = 7.0;
const COLOURS: [Colour; 2] = [BLUE, VERMILLION];
/// Half-width of the central 95 % interval of a normal distribution, in standard deviations.
const NORMAL_95: f64 = 1.96;

/// Measured and predicted moduli to draw. Rows are in order of ascending frequency.
#[derive(Debug, Clone, Copy)]
pub struct OscillationFigure<'a> {
    /// Frequency of each row, in Hz.
    pub frequency_hz: &'a [f64],
    /// Measured storage and loss modulus of each row, in Pa.
    pub moduli_pa: &'a [[f64; 2]],
    /// True for held-out rows.
    pub is_heldout: &'a [bool],
    /// Frequencies of the predictions, in Hz; empty without a model.
    pub curve_hz: &'a [f64],
    /// 5 %, 50 % and 95 % quantiles of the predicted storage and loss modulus in Pa, at each frequency in `curve_hz`. Measurement errors are not included.
    pub bands_pa: &'a [[[f64; 3]; 2]],
    /// Residuals of both measured quantities at each row, divided by their standard deviations; empty without a model.
    pub residuals: &'a [[f64; 2]],
    /// Names of the two measured quantities in each row, for the legend.
    pub names: [&'a str; 2],
}

/// Draws the figure of an oscillation under a heading.
///
/// # Errors
/// [`Error::Input`] for an oscillation without rows, or with columns of different lengths.
pub fn oscillation(data: &OscillationFigure, heading: &str) -> Result<Svg> {
    let n = data.frequency_hz.len();
    let is_whole =
        data.moduli_pa.len() == n && data.is_heldout.len() == n && data.bands_pa.len() == data.curve_hz.len();
    if n == 0 || !is_whole || !(data.residuals.is_empty() || data.residuals.len() == n) {
        let place = InputPlace::default().at_key("sweep");
        return Err(Error::input(
            place,
            "there are no rows, or columns of different lengths",
            "give every row a value in each column",
        ));
    }
    let has_model = !data.residuals.is_empty();
    let width_px = WIDTH_PX - LEFT_PX - 20.0;
    let height_px = MAIN_PX + 150.0 + if has_model { RESIDUAL_PX + 22.0 } else { 0.0 };
    let mut svg = Svg::new(WIDTH_PX, height_px, "Storage and loss modulus against frequency");
    title(&mut svg, heading, (LEFT_PX, 24.0), width_px);
    let entries = entries(data, has_model);
    legend::row(&mut svg, &entries, (LEFT_PX, 36.0), width_px);
    let top_px = 44.0 + legend::row_height_px(&entries, width_px);
    let spread = |values: &mut dyn Iterator<Item = f64>, factor: f64| {
        let positive = values.filter(|x| *x > 0.0 && x.is_finite());
        let (low, high) = positive.fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
        AxisScale::log10(low / factor, high * factor)
    };
    let frequency = spread(&mut data.frequency_hz.iter().copied(), 1.15);
    let moduli = spread(&mut data.moduli_pa.iter().flatten().copied(), 1.4);
    let frame = |y: f64, height: f64| Rect { x: LEFT_PX, y, width: width_px, height };
    let main = Axes { frame: frame(top_px, MAIN_PX), x: frequency, y: moduli };
    main.y_axis(&mut svg, AxisStyle::new(Some("shear modulus (Pa)"), 7, 66.0).grid());
    draw_moduli(&mut svg, data, &main);
    main.outline(&mut svg);
    let frequency_label = AxisStyle::new(Some("frequency (Hz)"), 8, 38.0);
    if !has_model {
        main.x_axis(&mut svg, frequency_label);
        return Ok(svg);
    }
    let largest = data.residuals.iter().flatten().fold(3.0_f64, |largest, r| largest.max(r.abs()));
    let below = frame(top_px + MAIN_PX + 22.0, RESIDUAL_PX);
    let residual = Axes { frame: below, x: frequency, y: AxisScale::linear(-1.1 * largest, 1.1 * largest) };
    residual.y_axis(&mut svg, AxisStyle::new(Some("residual (sd)"), 5, 66.0).grid());
    residual.x_axis(&mut svg, frequency_label);
    residual.horizontal(&mut svg, 0.0, Stroke::solid(MUTED, 1.2));
    for end in [-NORMAL_95, NORMAL_95] {
        residual.horizontal(&mut svg, end, Stroke::solid(MUTED, 1.0).dashed(5.0, 4.0));
    }
    for (k, colour) in COLOURS.into_iter().enumerate() {
        let points = data.frequency_hz.iter().zip(data.residuals).map(|(f, r)| (*f, r[k]));
        dots(&mut svg, &residual, points, data.is_heldout, colour);
    }
    residual.outline(&mut svg);
    Ok(svg)
}

fn draw_moduli(svg: &mut Svg, data: &OscillationFigure, main: &Axes) {
    for (k, colour) in COLOURS.into_iter().enumerate() {
        let quantile = |q: usize| -> Vec<f64> { data.bands_pa.iter().map(|band| band[k][q]).collect() };
        svg.clipped(main.frame, |svg| {
            main.band(svg, data.curve_hz, &quantile(0), &quantile(2), Fill::new(colour, 0.25));
            main.line(svg, data.curve_hz, &quantile(1), Stroke::solid(colour, 1.6));
        });
        let points = data.frequency_hz.iter().zip(data.moduli_pa).map(|(f, pair)| (*f, pair[k]));
        dots(svg, main, points, data.is_heldout, colour);
    }
}

/// Draws a filled dot for each fitted row and a ring for each held-out row. Values without a logarithm are omitted.
fn dots(svg: &mut Svg, axes: &Axes, points: impl Iterator<Item = (f64, f64)>, is_heldout: &[bool], colour: Colour) {
    for ((x, y), is_heldout) in points.zip(is_heldout) {
        let at = axes.px(x, y);
        if !(at.0.is_finite() && at.1.is_finite()) || at.1 > axes.frame.bottom() || at.1 < axes.frame.y {
            continue;
        }
        svg.circle(at, 0.5 * DOT_PX, Fill::new(colour, 1.0));
        if *is_heldout {
            svg.circle(at, 0.5 * DOT_PX - 1.5, Fill::new(WHITE, 1.0));
        }
    }
}

/// Draws a ring as a sample for the legend.
fn ring(svg: &mut Svg, place: Rect) {
    let centre = (place.x + 0.5 * place.width, place.y + 0.5 * place.height);
    svg.circle(centre, 0.5 * DOT_PX, Fill::new(MUTED, 1.0));
    svg.circle(centre, 0.5 * DOT_PX - 1.5, Fill::new(WHITE, 1.0));
}

fn entries(data: &OscillationFigure, has_model: bool) -> Vec<Entry> {
    let mut entries = vec![
        Entry::new(Mark::Dot(COLOURS[0], DOT_PX), "G′, storage"),
        Entry::new(Mark::Dot(COLOURS[1], DOT_PX), "G″, loss"),
    ];
    if data.is_heldout.contains(&true) {
        entries.push(Entry::new(Mark::Drawn(ring), "held out"));
    }
    if has_model {
        entries.push(Entry::new(Mark::LineOnArea(Stroke::solid(MUTED, 1.6), Fill::new(GRID, 1.0)), "model, 5 to 95 %"));
        let [first, second] = data.names;
        let text = format!("residuals of {first} and {second}; dashed: 95 % of noise");
        entries.push(Entry::new(Mark::Line(Stroke::solid(MUTED, 1.0).dashed(5.0, 4.0)), text));
    }
    entries
}
