//! Figure of traces and autocorrelation. It shows the motion of the sampler's ensembles, and how many steps give one independent draw.

use super::axes::{Axes, AxisStyle, title, widest_y_number_px};
use super::legend::{self, Entry, Mark};
use super::number::format_significant;
use super::palette::{AXIS, INK, MUTED, series};
use super::svg::{Anchor, Fill, Rect, Stroke, Svg, TextStyle};
use super::ticks::AxisScale;
use base::error::InputPlace;
use base::{Error, Result};

const WIDTH_PX: f64 = 960.0;
const ROW_HEIGHT_PX: f64 = 130.0;
const ROW_GAP_PX: f64 = 16.0;
/// Fraction of the figure's width for the autocorrelation.
const AUTOCORRELATION_SHARE: f64 = 0.29;

/// Values of one parameter over the steps of one ensemble of walkers. All slices have one value per step.
#[derive(Debug, Clone)]
pub struct EnsembleTrace<'a> {
    /// Mean over the walkers at each step.
    pub mean: &'a [f64],
    /// Lower limit of the band over the walkers at each step, such as the 5 % quantile. Empty if there is no band.
    pub lower: &'a [f64],
    /// Upper limit of the band over the walkers at each step.
    pub upper: &'a [f64],
    /// Values of a few single walkers, drawn as thin lines.
    pub walkers: Vec<&'a [f64]>,
}

/// Row of the figure: the runs of one parameter and their autocorrelation.
#[derive(Debug, Clone)]
pub struct ParameterTrace<'a> {
    /// Axis label, such as `E (Pa)`.
    pub label: &'a str,
    /// Values of the parameter in each ensemble.
    pub ensembles: Vec<EnsembleTrace<'a>>,
    /// Autocorrelation of the parameter in each ensemble. The index is the lag in steps, from 0.
    pub autocorrelation: Vec<&'a [f64]>,
    /// Estimated integrated autocorrelation time, in steps; `None` if it is unknown.
    pub autocorrelation_time_steps: Option<f64>,
}

/// Draws one row per parameter. The first `n_discarded` steps are shaded as burn-in.
///
/// # Errors
/// [`Error::Input`] for no parameters or ensembles of unequal length.
pub fn trace(parameters: &[ParameterTrace], n_discarded: usize, heading: &str) -> Result<Svg> {
    let n_steps = check(parameters)?;
    let n_ensembles = parameters.iter().map(|p| p.ensembles.len()).max().unwrap_or(0);
    let entries = entries(n_ensembles, n_discarded);
    let scales: Vec<AxisScale> = parameters.iter().map(value_scale).collect();
    let left = scales.iter().map(|scale| widest_y_number_px(scale, 5)).fold(0.0, f64::max) + 50.0;
    let width = WIDTH_PX - left - 18.0;
    let legend_top = if heading.is_empty() { 8.0 } else { 36.0 };
    let top = legend_top + legend::row_height_px(&entries, width) + 10.0;
    let height = top + parameters.len() as f64 * (ROW_HEIGHT_PX + ROW_GAP_PX) + 42.0;
    let mut svg = Svg::new(WIDTH_PX, height, "Traces of the ensembles and their autocorrelation");
    title(&mut svg, heading, (left, 24.0), width);
    legend::row(&mut svg, &entries, (left, legend_top), width);
    let lags = lag_scale(parameters);
    for (row, (parameter, scale)) in parameters.iter().zip(scales).enumerate() {
        let y = top + row as f64 * (ROW_HEIGHT_PX + ROW_GAP_PX);
        let last = row + 1 == parameters.len();
        let correlation_px = AUTOCORRELATION_SHARE * width;
        let frame = Rect { x: left, y, width: width - correlation_px - 64.0, height: ROW_HEIGHT_PX };
        let axes = Axes { frame, x: AxisScale::linear(0.0, n_steps as f64), y: scale };
        trace_panel(&mut svg, &axes, parameter, n_discarded, (last, left));
        let frame = Rect { x: left + width - correlation_px, y, width: correlation_px, height: ROW_HEIGHT_PX };
        let axes = Axes { frame, x: lags, y: AxisScale::linear(-0.2, 1.05) };
        autocorrelation_panel(&mut svg, &axes, parameter, last);
    }
    Ok(svg)
}

fn check(parameters: &[ParameterTrace]) -> Result<usize> {
    let refuse = |found: String, remedy: &str| Err(Error::input(InputPlace::default().at_key("trace"), found, remedy));
    let n_steps = parameters.iter().flat_map(|p| &p.ensembles).map(|e| e.mean.len()).max().unwrap_or(0);
    if n_steps < 2 {
        return refuse(
            format!("there are {} parameters and {n_steps} steps", parameters.len()),
            "give at least two steps",
        );
    }
    for parameter in parameters {
        for ensemble in &parameter.ensembles {
            let banded = !ensemble.lower.is_empty() || !ensemble.upper.is_empty();
            let lengths = [(ensemble.lower.len(), banded), (ensemble.upper.len(), banded), (ensemble.mean.len(), true)];
            let walkers = ensemble.walkers.iter().map(|walker| (walker.len(), true));
            if lengths.into_iter().chain(walkers).any(|(length, counts)| counts && length != n_steps) {
                return refuse(
                    format!("the series for `{}` have unequal lengths", parameter.label),
                    "give one value per step",
                );
            }
        }
    }
    Ok(n_steps)
}

fn value_scale(parameter: &ParameterTrace) -> AxisScale {
    let of_ensemble = |e: &EnsembleTrace| {
        let walkers = e.walkers.iter().flat_map(|walker| walker.iter());
        e.mean.iter().chain(e.lower).chain(e.upper).chain(walkers).copied().collect::<Vec<f64>>()
    };
    AxisScale::over(parameter.ensembles.iter().flat_map(of_ensemble), 0.06)
}

/// Scale of lags in steps, up to five autocorrelation times. At longer lags, an estimated autocorrelation is only noise.
fn lag_scale(parameters: &[ParameterTrace]) -> AxisScale {
    let longest = parameters.iter().flat_map(|p| &p.autocorrelation).map(|a| a.len()).max().unwrap_or(0);
    let slowest =
        parameters.iter().filter_map(|p| p.autocorrelation_time_steps).filter(|t| t.is_finite()).fold(0.0, f64::max);
    let available = longest.saturating_sub(1).max(1) as f64;
    AxisScale::linear(
        0.0,
        if slowest > 0.0 { (5.0 * slowest).clamp(available.min(10.0), available) } else { available },
    )
}

fn trace_panel(svg: &mut Svg, axes: &Axes, parameter: &ParameterTrace, n_discarded: usize, (last, left): (bool, f64)) {
    axes.y_axis(svg, AxisStyle::new(Some(parameter.label), 5, left - 18.0).grid());
    svg.clipped(axes.frame, |svg| {
        if n_discarded > 0 {
            let end = axes.x_px(n_discarded as f64);
            svg.rect(Rect { width: end - axes.frame.x, ..axes.frame }, Fill::new(MUTED, 0.12));
        }
        for (i, ensemble) in parameter.ensembles.iter().enumerate() {
            let fill = Fill::new(series(i), 0.06);
            envelope(svg, axes, ensemble.lower, ensemble.upper, fill);
            for walker in &ensemble.walkers {
                series_line(svg, axes, walker, Stroke::solid(series(i), 0.6).opacity(0.4));
            }
        }
        for (i, ensemble) in parameter.ensembles.iter().enumerate() {
            series_line(svg, axes, ensemble.mean, Stroke::solid(series(i), 1.1).opacity(0.9));
        }
    });
    let label = last.then_some("step (–)");
    axes.x_axis(svg, AxisStyle::new(label, 8, 38.0).overhang_px(18.0));
    axes.outline(svg);
}

/// Number of successive values that share one column of 1.5 pixels, if the axes show `n` values.
fn columns(axes: &Axes, n: usize) -> usize {
    let n_columns = (axes.frame.width / 1.5) as usize;
    n.div_ceil(n_columns.max(1)).max(1)
}

/// Draws a line with one point per step. If there are more steps than pixel columns, each column shows its smallest and largest value.
fn series_line(svg: &mut Svg, axes: &Axes, values: &[f64], stroke: Stroke) {
    let every = columns(axes, values.len());
    let (mut x, mut y) = (Vec::new(), Vec::new());
    for (column, chunk) in values.chunks(every).enumerate() {
        let step = (column * every) as f64;
        if every < 3 {
            x.extend((0..chunk.len()).map(|i| step + i as f64));
            y.extend_from_slice(chunk);
            continue;
        }
        let (lower, upper) = extremes(chunk);
        let middle = step + 0.5 * chunk.len() as f64;
        // Where the values rise, a column is drawn from its smallest to its largest value, otherwise the other way round. Neighbouring columns then join
        // without a detour.
        let rising = chunk.first() <= chunk.last();
        x.extend([middle, middle]);
        y.extend(if rising { [lower, upper] } else { [upper, lower] });
    }
    axes.line(svg, &x, &y, stroke);
}

fn extremes(values: &[f64]) -> (f64, f64) {
    let finite = values.iter().copied().filter(|v| v.is_finite());
    let (lower, upper) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, u), v| (l.min(v), u.max(v)));
    if lower <= upper { (lower, upper) } else { (f64::NAN, f64::NAN) }
}

/// Draws the band between two series, averaged over each pixel column.
fn envelope(svg: &mut Svg, axes: &Axes, lower: &[f64], upper: &[f64], fill: Fill) {
    // Columns are wider than for lines, because an average needs less detail than extremes.
    let every = 2 * columns(axes, lower.len());
    let mean = |chunk: &[f64]| chunk.iter().sum::<f64>() / chunk.len() as f64;
    let averaged = |values: &[f64]| values.chunks(every).map(mean).collect::<Vec<f64>>();
    let x: Vec<f64> = (0..lower.len().div_ceil(every)).map(|column| (column as f64 + 0.5) * every as f64).collect();
    axes.band(svg, &x, &averaged(lower), &averaged(upper), fill);
}

fn autocorrelation_panel(svg: &mut Svg, axes: &Axes, parameter: &ParameterTrace, last: bool) {
    axes.y_axis(svg, AxisStyle::new(Some("autocorrelation (–)"), 4, 46.0).grid());
    axes.horizontal(svg, 0.0, Stroke::solid(AXIS, 0.8));
    svg.clipped(axes.frame, |svg| {
        for (i, autocorrelation) in parameter.autocorrelation.iter().enumerate() {
            let shown = autocorrelation.len().min(axes.x.upper.ceil() as usize + 2);
            let lags: Vec<f64> = (0..shown).map(|lag| lag as f64).collect();
            axes.line(svg, &lags, &autocorrelation[..shown], Stroke::solid(series(i), 1.3));
        }
        if let Some(steps) = parameter.autocorrelation_time_steps {
            axes.vertical(svg, steps, Stroke::solid(INK, 1.2).dashed(5.0, 3.0));
        }
    });
    if let Some(steps) = parameter.autocorrelation_time_steps {
        let at = (axes.frame.right() - 8.0, axes.frame.y + 18.0);
        svg.text(&format!("τ = {} steps", format_significant(steps, 3)), at, TextStyle::new(12.0, Anchor::End));
    }
    let label = last.then_some("lag (steps)");
    axes.x_axis(svg, AxisStyle::new(label, 5, 38.0).overhang_px(14.0));
    axes.outline(svg);
}

fn entries(n_ensembles: usize, n_discarded: usize) -> Vec<Entry> {
    let mark = |i| Mark::LineOnArea(Stroke::solid(series(i), 1.8), Fill::new(series(i), 0.15));
    let mut entries: Vec<Entry> =
        (0..n_ensembles).map(|i| Entry::new(mark(i), format!("ensemble {}", i + 1))).collect();
    if n_discarded > 0 {
        entries.push(Entry::new(Mark::Area(Fill::new(MUTED, 0.2).into()), "discarded"));
    }
    entries.push(Entry::new(Mark::Line(Stroke::solid(INK, 1.2).dashed(5.0, 3.0)), "autocorrelation time τ"));
    entries
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameter<'a>(mean: &'a [f64], autocorrelation: &'a [f64]) -> ParameterTrace<'a> {
        let ensemble = EnsembleTrace { mean, lower: mean, upper: mean, walkers: vec![mean] };
        ParameterTrace {
            label: "E (Pa)",
            ensembles: vec![ensemble],
            autocorrelation: vec![autocorrelation],
            autocorrelation_time_steps: Some(4.0),
        }
    }

    #[test]
    fn long_runs_stay_small_and_keep_their_extremes() {
        let mut mean: Vec<f64> = (0..100_000).map(|i| (i as f64 * 0.37).sin()).collect();
        mean[54_321] = 9.0;
        let autocorrelation: Vec<f64> = (0..200).map(|lag| (-f64::from(lag) / 4.0).exp()).collect();
        let svg = trace(&[parameter(&mean, &autocorrelation)], 0, "").unwrap();
        assert!(svg.document().len() < 100_000, "{}", svg.document().len());
        assert_eq!(svg.document(), trace(&[parameter(&mean, &autocorrelation)], 0, "").unwrap().document());
        // A single extreme step determines the scale. It is drawn at 6 % of the range below the upper edge.
        let frame_top = 8.0 + 1.6 * 12.0 + 10.0;
        let range = 1.12 * 10.0;
        let y = frame_top + ROW_HEIGHT_PX * (0.06 * 10.0 / range);
        assert!(svg.document().contains(&format!(" {y:.2}")), "{y}");
        assert!(svg.document().contains("τ = 4.00 steps"));
    }

    #[test]
    fn unequal_series_are_refused() {
        let (long, short) = (vec![0.0; 10], vec![0.0; 9]);
        let mut bad = parameter(&long, &long);
        bad.ensembles[0].upper = &short;
        let label = bad.label.to_string();
        let refused = |parameters: &[ParameterTrace]| trace(parameters, 0, "").unwrap_err().to_string();
        assert!(refused(&[bad]).contains(&format!("the series for `{label}` have unequal lengths")));
        assert!(refused(&[]).contains("there are 0 parameters and 0 steps"));
        let mut without_band = parameter(&long, &long);
        without_band.ensembles[0].lower = &[];
        without_band.ensembles[0].upper = &[];
        assert!(trace(&[without_band], 3, "").unwrap().png().is_ok());
    }
}
