//! Draws the panels, titles and legend of a corner plot.

use super::axes::{Axes, AxisStyle, widest_y_number_px};
use super::contour::simplify;
use super::corner_content::{
    Content, CornerOptions, FEWEST_DRAWS_FOR_CONTOURS, ParameterColumn, Posterior, PriorCurve, Slot,
};
use super::density::{self, JointDensity, quantile_of_sorted};
use super::font::{shorten, text_width_px};
use super::legend::{self, Entry, Mark};
use super::number::{ValueWithErrors, format_significant};
use super::palette::{Colour, INK, MUTED};
use super::svg::{Anchor, Fill, Path, Point, Rect, Stroke, Style, Svg, TextStyle};
use super::ticks::AxisScale;

const GAP_PX: f64 = 14.0;
/// Maximum number of draws that contours are estimated from. More draws would make no visible difference.
const MOST_DRAWS: usize = 100_000;
/// Maximum number of dots outside the outermost contour. If there are more draws, only every k-th has a dot.
const MOST_DOTS: usize = 1_500;
/// Largest distance in pixels of a drawn polyline from its exact contour.
const CONTOUR_TOLERANCE_PX: f64 = 0.06;
const LEGEND_SIZE_PX: f64 = 13.0;
const NOTE_SIZE_PX: f64 = 11.5;
const SMALLEST_TITLE_PX: f64 = 8.5;

/// Positions of the panels, and font sizes.
#[derive(Debug)]
pub(super) struct CornerLayout {
    pub(super) width_px: f64,
    pub(super) height_px: f64,
    /// Upper left corner of the first panel, in pixels.
    pub origin: Point,
    panel_px: f64,
    n: usize,
    title_size_px: f64,
    y_label_distance_px: f64,
    most_ticks: usize,
}

impl CornerLayout {
    pub fn new(content: &Content) -> Self {
        let Content { slots, posteriors, options, .. } = content;
        let n = slots.len();
        let panel_px = match n {
            1 => 380.0,
            2 => 290.0,
            3 => 235.0,
            4 => 200.0,
            5 => 178.0,
            6 => 165.0,
            _ => 155.0,
        };
        let most_ticks = if panel_px > 210.0 { 6 } else { 5 };
        let numbers = slots.iter().skip(1).map(|slot| widest_y_number_px(&slot.scale, most_ticks)).fold(0.0, f64::max);
        let y_label_distance_px = if n > 1 { numbers + 30.0 } else { 24.0 };
        let title_size_px = if n <= 4 { 14.0 } else { 12.5 };
        let lines = 1.0f64.max(posteriors.len() as f64);
        let header = if options.title.is_empty() { 12.0 } else { 44.0 };
        let origin = (y_label_distance_px + 14.0, header + lines * 1.6 * title_size_px);
        let side = n as f64 * panel_px + (n as f64 - 1.0) * GAP_PX;
        // A figure with a single panel has no empty corner, so its legend is to the right of the panel.
        let right = if n == 1 { 300.0 } else { 18.0 };
        Self {
            width_px: origin.0 + side + right,
            height_px: origin.1 + side + 64.0,
            origin,
            panel_px,
            n,
            title_size_px,
            y_label_distance_px,
            most_ticks,
        }
    }

    fn frame(&self, row: usize, column: usize) -> Rect {
        let pitch = self.panel_px + GAP_PX;
        let (x, y) = (self.origin.0 + column as f64 * pitch, self.origin.1 + row as f64 * pitch);
        Rect { x, y, width: self.panel_px, height: self.panel_px }
    }
}

/// Draws the panel at a row and a column of the corner plot.
pub(super) fn panel(svg: &mut Svg, layout: &CornerLayout, content: &Content, row: usize, column: usize) {
    let (frame, slots) = (layout.frame(row, column), &content.slots);
    let axes = if row == column {
        marginal_panel(svg, layout, content, row)
    } else {
        let axes = Axes { frame, x: slots[column].scale, y: slots[row].scale };
        svg.clipped(frame, |svg| pair_panel(svg, &axes, content, &slots[row], &slots[column]));
        axes
    };
    let x_label = (row + 1 == layout.n).then_some(slots[column].label.as_str());
    axes.x_axis(svg, AxisStyle::new(x_label, layout.most_ticks, 40.0));
    if row != column {
        let y_label = (column == 0).then_some(slots[row].label.as_str());
        axes.y_axis(svg, AxisStyle::new(y_label, layout.most_ticks, layout.y_label_distance_px));
    }
    axes.outline(svg);
}

/// Returns the posteriors that contain the parameter of `slot`, each with its index and the parameter's draws.
fn posteriors_with_parameter<'a, 'b>(
    posteriors: &'a [Posterior<'b>],
    slot: &'a Slot,
) -> impl Iterator<Item = (usize, &'a Posterior<'b>, &'a ParameterColumn<'b>)> {
    let columns = slot.columns.iter();
    posteriors.iter().zip(columns).enumerate().filter_map(|(i, (p, column))| column.map(|c| (i, p, &p.parameters[c])))
}

fn reference_stroke() -> Stroke {
    Stroke::solid(INK, 1.1).dashed(1.5, 2.5)
}

fn prior_stroke() -> Stroke {
    Stroke::solid(MUTED, 1.4).dashed(6.0, 4.0)
}

fn marginal_panel(svg: &mut Svg, layout: &CornerLayout, content: &Content, row: usize) -> Axes {
    let (slot, frame, posteriors) = (&content.slots[row], layout.frame(row, row), content.posteriors);
    let curves: Vec<_> = posteriors_with_parameter(posteriors, slot)
        .map(|(i, posterior, column)| {
            let sorted = slot.columns[i].map_or(&[][..], |c| &content.ascending[i][c]);
            (posterior, column, sorted, density::marginal(sorted, column.support))
        })
        .collect();
    let peak = curves
        .iter()
        .filter_map(|(.., curve)| curve.as_ref())
        .flat_map(|m| m.density.iter().copied())
        .fold(0.0, f64::max);
    let top = if peak > 0.0 { 1.08 * peak } else { 1.0 };
    let axes = Axes { frame, x: slot.scale, y: AxisScale::linear(0.0, top) };
    svg.clipped(frame, |svg| {
        for (posterior, column, sorted, curve) in &curves {
            match curve {
                Some(curve) => marginal_curve(svg, &axes, curve, sorted, posterior.colour, posteriors.len() == 1),
                None => axes.vertical(svg, column.draws[0], Stroke::solid(posterior.colour, 2.0)),
            }
        }
        let priors =
            curves.iter().filter_map(|(posterior, column, ..)| column.prior.map(|prior| (prior, posterior.colour)));
        prior_curves(svg, &axes, &priors.collect::<Vec<_>>());
        reference_mark(svg, &axes, slot);
    });
    let lines: Vec<(Colour, ValueWithErrors)> =
        curves.iter().map(|(posterior, _, sorted, _)| (posterior.colour, quantile_title(sorted))).collect();
    titles(svg, layout, frame, slot, &lines, posteriors.len() > 1);
    axes
}

/// Draws priors as dashed lines. Posteriors with equal priors share one line; different priors have their posteriors' colours.
fn prior_curves(svg: &mut Svg, axes: &Axes, priors: &[(PriorCurve, Colour)]) {
    let mut distinct: Vec<(PriorCurve, Colour)> = Vec::new();
    for (prior, colour) in priors {
        if !distinct.iter().any(|(other, _)| other == prior) {
            distinct.push((*prior, *colour));
        }
    }
    for (prior, colour) in &distinct {
        let colour = if distinct.len() == 1 { MUTED } else { *colour };
        let inside = |x: &f64| (-0.02..=1.02).contains(&axes.x.fraction(*x));
        let x: Vec<f64> = prior.x.iter().map(|x| if inside(x) { *x } else { f64::NAN }).collect();
        axes.line(svg, &x, prior.density, Stroke { colour, ..prior_stroke() });
    }
}

fn quantile_title(sorted: &[f64]) -> ValueWithErrors {
    let quantile = |p| quantile_of_sorted(sorted, p);
    ValueWithErrors::from_quantiles(quantile(0.16), quantile(0.5), quantile(0.84))
}

/// Draws a marginal density as a curve over a light area. For a single posterior the central 68 % are darker.
fn marginal_curve(svg: &mut Svg, axes: &Axes, curve: &density::Marginal, sorted: &[f64], colour: Colour, alone: bool) {
    let shown: Vec<usize> =
        (0..curve.x.len()).filter(|&i| (-0.02..=1.02).contains(&axes.x.fraction(curve.x[i]))).collect();
    let pick = |values: &[f64]| shown.iter().map(|&i| values[i]).collect::<Vec<f64>>();
    let (x, y) = (pick(&curve.x), pick(&curve.density));
    axes.band(svg, &x, &vec![0.0; x.len()], &y, Fill::new(colour, if alone { 0.16 } else { 0.12 }));
    if alone {
        let (lower, upper) = (quantile_of_sorted(sorted, 0.16), quantile_of_sorted(sorted, 0.84));
        let central: Vec<f64> =
            x.iter().zip(&y).map(|(x, y)| if (lower..=upper).contains(x) { *y } else { f64::NAN }).collect();
        axes.band(svg, &x, &vec![0.0; x.len()], &central, Fill::new(colour, 0.26));
    }
    let mut path = Path::default();
    let points: Vec<Point> = x.iter().zip(&y).map(|(x, y)| axes.px(*x, *y)).collect();
    path.polyline(simplify(&points, CONTOUR_TOLERANCE_PX), false);
    svg.path(&path, Stroke::solid(colour, 1.8));
}

/// Marks the reference value by a line. If it lies beyond the axis, a note names it.
fn reference_mark(svg: &mut Svg, axes: &Axes, slot: &Slot) {
    let Some(value) = slot.reference else { return };
    let fraction = axes.x.fraction(value);
    if (0.0..=1.0).contains(&fraction) {
        axes.vertical(svg, value, reference_stroke());
        return;
    }
    let text = format_significant(value, 3);
    let y = axes.frame.y + 16.0;
    if fraction > 1.0 {
        svg.text(&format!("{text} →"), (axes.frame.right() - 7.0, y), TextStyle::new(11.0, Anchor::End));
    } else {
        svg.text(&format!("← {text}"), (axes.frame.x + 7.0, y), TextStyle::new(11.0, Anchor::Start));
    }
}

fn pair_panel(svg: &mut Svg, axes: &Axes, content: &Content, row: &Slot, column: &Slot) {
    let Content { posteriors, options, .. } = content;
    let outermost = options.masses.iter().copied().fold(0.0, f64::max);
    for (i, posterior, x) in posteriors_with_parameter(posteriors, column) {
        let Some(y) = row.columns[i].map(|c| &posterior.parameters[c]) else { continue };
        let (xs, ys) = (thinned(x.draws), thinned(y.draws));
        let points = || xs.iter().copied().zip(ys.iter().copied());
        let enough = xs.len() >= FEWEST_DRAWS_FOR_CONTOURS;
        let joint = if enough { JointDensity::new(&xs, &ys, x.support, y.support) } else { None };
        let Some(joint) = joint else {
            axes.scatter(svg, points().step_by(xs.len().div_ceil(MOST_DOTS)), posterior.colour, 2.4, 0.6);
            continue;
        };
        if posteriors.len() == 1 {
            let threshold = joint.threshold(outermost);
            let outside: Vec<Point> = points().filter(|(x, y)| joint.is_outside(*x, *y, threshold)).collect();
            let every = outside.len().div_ceil(MOST_DOTS).max(1);
            axes.scatter(svg, outside.into_iter().step_by(every), posterior.colour, 1.7, 0.45);
        }
        contours(svg, axes, &joint, (x, y), posterior.colour, options.masses, posteriors.len());
    }
    if let Some(value) = column.reference {
        axes.vertical(svg, value, reference_stroke());
    }
    if let Some(value) = row.reference {
        axes.horizontal(svg, value, reference_stroke());
    }
}

/// Returns at most [`MOST_DRAWS`] evenly spaced draws. The spacing has no small prime factor. Otherwise it would always select the same few walkers from a
/// table that is ordered by step.
fn thinned(draws: &[f64]) -> Vec<f64> {
    let mut every = draws.len().div_ceil(MOST_DRAWS).max(1);
    while every > 1 && [2_usize, 3, 5, 7].iter().any(|prime| every.is_multiple_of(*prime)) {
        every += 1;
    }
    draws.iter().step_by(every).copied().collect()
}

/// Fractions of the draws in the order in which their regions are drawn: the largest first, because it is at the back.
fn draw_order(masses: &[f64]) -> Vec<f64> {
    let mut masses = masses.to_vec();
    masses.sort_by(|a, b| b.total_cmp(a));
    masses
}

fn region_fill(colour: Colour, n_posteriors: usize) -> Fill {
    Fill::new(colour, if n_posteriors == 1 { 0.26 } else { 0.14 })
}

fn region_stroke(colour: Colour) -> Stroke {
    Stroke::solid(colour, 1.5)
}

fn contours(
    svg: &mut Svg,
    axes: &Axes,
    joint: &JointDensity,
    (x, y): (&ParameterColumn, &ParameterColumn),
    colour: Colour,
    masses: &[f64],
    n_posteriors: usize,
) {
    let window = supported_window(axes, x, y);
    svg.clipped(window, |svg| {
        for mass in draw_order(masses) {
            let mut path = Path::default();
            for points in joint.contour(mass) {
                let mut pixels: Vec<Point> = points.into_iter().map(|(x, y)| axes.px(x, y)).collect();
                if let Some(first) = pixels.first().copied() {
                    pixels.push(first);
                }
                path.polyline(simplify(&pixels, CONTOUR_TOLERANCE_PX), true);
            }
            svg.path(
                &path,
                Style { fill: Some(region_fill(colour, n_posteriors)), stroke: Some(region_stroke(colour)) },
            );
        }
    });
}

/// Part of the frame in which both parameters are within their hard limits.
fn supported_window(axes: &Axes, x: &ParameterColumn, y: &ParameterColumn) -> Rect {
    let frame = axes.frame;
    let left = if x.support.lower.is_finite() { axes.x_px(x.support.lower).max(frame.x) } else { frame.x };
    let right = if x.support.upper.is_finite() { axes.x_px(x.support.upper).min(frame.right()) } else { frame.right() };
    let top = if y.support.upper.is_finite() { axes.y_px(y.support.upper).max(frame.y) } else { frame.y };
    let bottom =
        if y.support.lower.is_finite() { axes.y_px(y.support.lower).min(frame.bottom()) } else { frame.bottom() };
    Rect { x: left, y: top, width: right - left, height: bottom - top }
}

/// Writes one line per posterior above the panel: `E = 3.53 +0.12 −0.11 Pa`, with the errors raised and lowered. If the panel is too narrow, the symbol is
/// omitted. If it is still too narrow, the font size shrinks.
fn titles(
    svg: &mut Svg,
    layout: &CornerLayout,
    frame: Rect,
    slot: &Slot,
    lines: &[(Colour, ValueWithErrors)],
    coloured: bool,
) {
    let size = layout.title_size_px;
    let room = frame.width + GAP_PX - 4.0;
    let unit = if slot.unit.is_empty() || slot.unit == "–" { String::new() } else { format!(" {}", slot.unit) };
    let head = format!("{} = ", slot.symbol);
    let width =
        |value: &ValueWithErrors, head: &str, size: f64| text_width_px(head, size) + value_width_px(value, &unit, size);
    let widest = |head: &str| lines.iter().map(|(_, value)| width(value, head, size)).fold(0.0, f64::max);
    // If the symbol would make the numbers too small, it is omitted. The axis label shows it.
    let head = if widest(&head) * SMALLEST_TITLE_PX > room * size { String::new() } else { head };
    let size = size * (room / widest(&head).max(1.0)).clamp(SMALLEST_TITLE_PX / size, 1.0);
    for (i, (colour, value)) in lines.iter().enumerate() {
        let baseline = frame.y - 0.62 * size - (lines.len() - 1 - i) as f64 * 1.6 * size;
        let start = frame.x + (frame.width - width(value, &head, size)) / 2.0;
        value_with_errors(svg, (start, baseline), &head, value, &unit, size, if coloured { *colour } else { INK });
    }
}

const ERROR_SIZE: f64 = 0.72;

fn value_width_px(value: &ValueWithErrors, unit: &str, size: f64) -> f64 {
    let errors = text_width_px(&value.plus, ERROR_SIZE * size).max(text_width_px(&value.minus, ERROR_SIZE * size));
    text_width_px(&value.centre, size) + 0.1 * size + errors + text_width_px(&tail(value, unit), size)
}

fn tail(value: &ValueWithErrors, unit: &str) -> String {
    if value.factor.is_empty() { unit.to_owned() } else { format!(" {}{unit}", value.factor) }
}

fn value_with_errors(
    svg: &mut Svg,
    at: Point,
    head: &str,
    value: &ValueWithErrors,
    unit: &str,
    size: f64,
    colour: Colour,
) {
    let style = TextStyle::new(size, Anchor::Start).colour(colour);
    let small = TextStyle::new(ERROR_SIZE * size, Anchor::Start).colour(colour);
    let front = format!("{head}{}", value.centre);
    svg.text(&front, at, style);
    let errors = at.0 + text_width_px(&front, size) + 0.1 * size;
    svg.text(&value.plus, (errors, at.1 - 0.42 * size), small);
    svg.text(&value.minus, (errors, at.1 + 0.26 * size), small);
    let after = errors + text_width_px(&value.plus, small.size_px).max(text_width_px(&value.minus, small.size_px));
    let tail = tail(value, unit);
    // Some renderers ignore a space at the beginning of a text, so the space is added to the position.
    let space = if tail.starts_with(' ') { text_width_px(" ", size) } else { 0.0 };
    svg.text(tail.trim_start(), (after + space, at.1), style);
}

/// Draws the legend of colours, lines and contours into the empty upper right corner.
pub(super) fn legend(svg: &mut Svg, layout: &CornerLayout, content: &Content) {
    let Content { posteriors, slots, options, .. } = content;
    let entries = entries(posteriors, slots, options);
    let shade = if posteriors.len() == 1 { "Darker area on the diagonal: 68 %" } else { "" };
    let notes = ["Titles: median and 68 % interval", shade];
    let last = layout.frame(0, layout.n - 1);
    let needed = legend::column_height_px(&entries, LEGEND_SIZE_PX) + 18.0 + notes.len() as f64 * 15.0;
    let titles = 1.6 * layout.title_size_px * posteriors.len() as f64 + 8.0;
    // The first k rows are empty to the right of their panels, down to the titles of column k. The empty area is wide for few rows and high for many.
    let high_enough = |k: &usize| *k as f64 * (layout.panel_px + GAP_PX) - titles >= needed;
    let most_rows = layout.n.saturating_sub(1).max(1);
    let rows = (1..most_rows).find(high_enough).unwrap_or(most_rows);
    let beside = layout.frame(0, rows - 1).right() + 26.0;
    // A figure with a single panel has its legend beside the panel.
    let room = if layout.n == 1 { 270.0 } else { last.right() - beside };
    let texts = entries.iter().map(|entry| (entry.text.as_str(), LEGEND_SIZE_PX, legend::MARK_ADVANCE_PX));
    let widths = texts
        .chain(notes.map(|text| (text, NOTE_SIZE_PX, 0.0)))
        .map(|(text, size, mark)| text_width_px(text, size) + mark);
    let width = widths.fold(0.0, f64::max).min(room);
    let left = if layout.n == 1 { beside } else { last.right() - width };
    let height = legend::column(svg, &entries, (left, layout.origin.1), LEGEND_SIZE_PX, width);
    for (i, text) in notes.iter().enumerate() {
        let baseline = layout.origin.1 + height + 18.0 + i as f64 * 15.0;
        svg.text(
            &shorten(text, NOTE_SIZE_PX, width + 1.0),
            (left, baseline),
            TextStyle::new(NOTE_SIZE_PX, Anchor::Start).colour(MUTED),
        );
    }
}

fn entries(posteriors: &[Posterior], slots: &[Slot], options: &CornerOptions) -> Vec<Entry> {
    let mut entries = Vec::new();
    for posterior in posteriors.iter().filter(|p| !p.label.is_empty()) {
        entries.push(Entry::new(Mark::Line(Stroke::solid(posterior.colour, 2.5)), posterior.label));
    }
    let colour = if let [only] = posteriors { only.colour } else { MUTED };
    for (depth, mass) in draw_order(options.masses).into_iter().enumerate() {
        // Regions overlap in the panels, so the legend's sample combines their opacities.
        let opacity = 1.0 - (1.0 - region_fill(colour, posteriors.len()).opacity).powi(depth as i32 + 1);
        let area = Style { fill: Some(Fill::new(colour, opacity)), stroke: Some(region_stroke(colour)) };
        let percent = format_significant(100.0 * mass, 3);
        let percent =
            if percent.contains('.') { percent.trim_end_matches('0').trim_end_matches('.') } else { percent.as_str() };
        entries.push(Entry::new(Mark::Area(area), format!("encloses {percent} % of the draws")));
    }
    let any_prior = posteriors.iter().flat_map(|p| &p.parameters).any(|c| c.prior.is_some());
    if any_prior {
        entries.push(Entry::new(Mark::Line(prior_stroke()), "prior"));
    }
    if slots.iter().any(|slot| slot.reference.is_some()) {
        entries.push(Entry::new(Mark::Line(reference_stroke()), options.reference_label));
    }
    entries
}
