//! Figure of the groups' creep compliance over time, on logarithmic axes: for the typical specimen and for a new specimen.
//!
//! Up to three groups share one pair of axes. More groups have one pair of axes each, which also shows the medians of the others in grey.

use super::axes::{Axes, AxisStyle, LABEL_SIZE_PX, title_with_text, widest_y_number_px};
use super::font::{text_width_px, wrapped};
use super::legend::{self, Entry, Mark};
use super::palette::{Colour, INK, MUTED};
use super::svg::{Anchor, Fill, Path, Point, Rect, Stroke, Svg, TextStyle};
use super::ticks::AxisScale;
use base::error::InputPlace;
use base::{Error, Result};

const MARGIN_PX: f64 = 20.0;
const WIDTH_PX: f64 = 960.0;
/// Maximum number of groups that share one pair of axes.
const MOST_TOGETHER: usize = 3;
const TOGETHER_HEIGHT_PX: f64 = 430.0;
/// Maximum width of the names right of the axes, in pixels.
const MOST_NAME_PX: f64 = 170.0;
const NAME_LINE_PX: f64 = 15.0;
const NAME_LEAD_PX: f64 = 22.0;
const PANEL_HEIGHT_PX: f64 = 190.0;
const PANEL_GAP_PX: f64 = 26.0;
const FOOT_PX: f64 = 46.0;
/// Distance by which the numbers at the ends of the time axis may extend beyond it, in pixels.
const OVERHANG_PX: f64 = 16.0;
const MOST_X_NUMBERS: usize = 7;
const MOST_Y_NUMBERS: usize = 6;
const X_LABEL: &str = "time under load (s)";
const Y_LABEL: &str = "creep compliance J (1/Pa)";

const TYPICAL_OPACITY: f64 = 0.42;
const NEW_OPACITY: f64 = 0.14;
const MEDIAN_PX: f64 = 2.2;
const OTHERS: Stroke = Stroke { colour: MUTED, width_px: 1.0, opacity: 0.6, dash: None };

/// Content of the figure of creep compliance: title, summary, times and groups.
#[derive(Debug, Clone)]
pub struct CreepBands<'a> {
    /// Title of the figure.
    pub title: &'a str,
    /// Sentence that summarises the figure.
    pub sentence: &'a str,
    /// Times since the start of the load, in s; positive and increasing.
    pub time_s: &'a [f64],
    /// Groups of specimens. All lists of a group have one value per time.
    pub groups: Vec<CreepGroup<'a>>,
}

/// Creep compliance of one group, in 1/Pa.
#[derive(Debug, Clone)]
pub struct CreepGroup<'a> {
    /// Name of the group.
    pub label: &'a str,
    /// Colour of the group.
    pub colour: Colour,
    /// Median of the typical specimen's compliance at each time.
    pub median_per_pa: Vec<f64>,
    /// Lower and upper limit of the central 90 % interval of the typical specimen's compliance.
    pub typical_90_per_pa: [Vec<f64>; 2],
    /// Lower and upper limit of the central 90 % interval for a specimen that has not been measured.
    pub new_specimen_90_per_pa: [Vec<f64>; 2],
}

/// Draws the figure of the groups' creep compliance.
///
/// # Errors
/// [`Error::Input`] for no groups, fewer than two times, unequal lengths, or limits in the wrong order. Times have to be positive and increasing, values finite
/// and positive.
pub fn creep_bands(data: &CreepBands) -> Result<Svg> {
    check(data)?;
    let draw = |svg: &mut Svg| {
        let width = WIDTH_PX - 2.0 * MARGIN_PX;
        let below = MARGIN_PX + title_with_text(svg, data.title, data.sentence, (MARGIN_PX, MARGIN_PX), width) + 10.0;
        let below = below + legend::row(svg, &entries(data), (MARGIN_PX, below), width) + 10.0;
        if data.groups.len() <= MOST_TOGETHER {
            draw_shared_axes(svg, data, below)
        } else {
            draw_separate_axes(svg, data, below)
        }
    };
    Ok(Svg::drawn(WIDTH_PX, data.title, 0.0, draw))
}

fn check(data: &CreepBands) -> Result<()> {
    let refuse =
        |found: String, remedy: &str| Err(Error::input(InputPlace::default().at_key("creep bands"), found, remedy));
    let n = data.time_s.len();
    if n < 2 || data.groups.is_empty() {
        return refuse(
            format!("there are {n} times and {} groups", data.groups.len()),
            "give at least two times and one group",
        );
    }
    let usable = |value: &f64| value.is_finite() && *value > 0.0;
    if !data.time_s.iter().all(usable) || !data.time_s.is_sorted_by(|a, b| a < b) {
        return refuse(
            "the times are not positive and increasing".into(),
            "remove 0 s, and sort the times in ascending order",
        );
    }
    for group in &data.groups {
        let [lower, upper] = &group.typical_90_per_pa;
        let [new_lower, new_upper] = &group.new_specimen_90_per_pa;
        let curves = [&group.median_per_pa, lower, upper, new_lower, new_upper];
        if curves.iter().any(|curve| curve.len() != n) {
            let found = format!("{}: the curves have {:?} values for {n} times", group.label, curves.map(Vec::len));
            return refuse(found, "give one value per time");
        }
        if let Some(i) = (0..n).find(|i| curves.iter().any(|curve| !usable(&curve[*i]))) {
            let found = format!("{}: at {} s the compliance is not finite and positive", group.label, data.time_s[i]);
            return refuse(found, "remove this time or group");
        }
        let in_order = |i: &usize| {
            lower[*i] <= group.median_per_pa[*i]
                && group.median_per_pa[*i] <= upper[*i]
                && new_lower[*i] <= new_upper[*i]
        };
        if let Some(i) = (0..n).find(|i| !in_order(i)) {
            let found = format!("{}: the limits are in the wrong order at {} s", group.label, data.time_s[i]);
            return refuse(found, "give the lower limit first, and a median between the limits");
        }
    }
    Ok(())
}

/// Time scale and compliance scale for all groups. Wide predictions for new specimens lengthen the scales only up to a limit.
fn scales(data: &CreepBands) -> (AxisScale, AxisScale) {
    let typical = data.groups.iter().flat_map(|group| group.typical_90_per_pa.iter().flatten());
    let new = data.groups.iter().flat_map(|group| group.new_specimen_90_per_pa.iter().flatten());
    let y = AxisScale::log10_around(typical.copied(), new.copied(), std::iter::empty());
    (AxisScale::log10(data.time_s[0], data.time_s[data.time_s.len() - 1]), y)
}

fn draw_bands(svg: &mut Svg, axes: &Axes, data: &CreepBands, group: &CreepGroup) {
    let band = |svg: &mut Svg, [lower, upper]: &[Vec<f64>; 2], opacity| {
        axes.band(svg, data.time_s, lower, upper, Fill::new(group.colour, opacity));
    };
    band(svg, &group.new_specimen_90_per_pa, NEW_OPACITY);
    band(svg, &group.typical_90_per_pa, TYPICAL_OPACITY);
}

fn draw_median(svg: &mut Svg, axes: &Axes, data: &CreepBands, group: &CreepGroup, stroke: Stroke) {
    axes.line(svg, data.time_s, &group.median_per_pa, stroke);
}

/// Draws all groups in one pair of axes, with their names at the ends of the curves. Returns the position of the lower edge.
fn draw_shared_axes(svg: &mut Svg, data: &CreepBands, top: f64) -> f64 {
    let (x, y) = scales(data);
    let names: Vec<Vec<String>> =
        data.groups.iter().map(|group| wrapped(group.label, LABEL_SIZE_PX, MOST_NAME_PX)).collect();
    let widest = names.iter().flatten().map(|line| text_width_px(line, LABEL_SIZE_PX)).fold(0.0, f64::max);
    let left = widest_y_number_px(&y, MOST_Y_NUMBERS) + 48.0;
    let width = WIDTH_PX - left - NAME_LEAD_PX - widest - MARGIN_PX;
    let axes = Axes { frame: Rect { x: left, y: top, width, height: TOGETHER_HEIGHT_PX }, x, y };
    let frame = axes.frame;
    axes.x_axis(svg, AxisStyle::new(Some(X_LABEL), MOST_X_NUMBERS, 36.0).grid().overhang_px(OVERHANG_PX));
    axes.y_axis(svg, AxisStyle::new(Some(Y_LABEL), MOST_Y_NUMBERS, left - 12.0).grid());
    svg.clipped(frame, |svg| {
        data.groups.iter().for_each(|group| draw_bands(svg, &axes, data, group));
        for group in &data.groups {
            draw_median(svg, &axes, data, group, Stroke::solid(group.colour, MEDIAN_PX));
        }
    });
    axes.outline(svg);
    let end = |group: &CreepGroup| axes.y_px(group.median_per_pa[data.time_s.len() - 1]).clamp(frame.y, frame.bottom());
    let wanted: Vec<f64> = data.groups.iter().map(end).collect();
    let heights: Vec<f64> = names.iter().map(|lines| NAME_LINE_PX * lines.len() as f64 + 4.0).collect();
    for (i, middle) in separate_blocks(&wanted, &heights, (frame.y, frame.bottom())).into_iter().enumerate() {
        let mut lead = Path::default();
        let right = frame.right();
        lead.polyline(
            [(right, wanted[i]), (right + 5.0, wanted[i]), (right + 13.0, middle), (right + 18.0, middle)],
            false,
        );
        svg.path(&lead, Stroke::solid(data.groups[i].colour, MEDIAN_PX));
        name(svg, &names[i], (right + NAME_LEAD_PX, middle));
    }
    frame.bottom() + FOOT_PX
}

/// Writes a name in one or several lines, centred at the height `middle`.
fn name(svg: &mut Svg, lines: &[String], (left, middle): Point) {
    for (i, line) in lines.iter().enumerate() {
        let baseline = middle + 0.36 * LABEL_SIZE_PX + NAME_LINE_PX * (i as f64 - 0.5 * (lines.len() as f64 - 1.0));
        svg.text(line, (left, baseline), TextStyle::new(LABEL_SIZE_PX, Anchor::Start).colour(INK));
    }
}

/// Returns the centres of blocks that must not overlap, close to the wanted centres and in their order. The blocks lie within the two limits if there is enough
/// room.
fn separate_blocks(wanted: &[f64], heights: &[f64], (upper, lower): (f64, f64)) -> Vec<f64> {
    let mut order: Vec<usize> = (0..wanted.len()).collect();
    order.sort_by(|a, b| wanted[*a].total_cmp(&wanted[*b]));
    let mut middles = wanted.to_vec();
    let mut free = upper;
    for &i in &order {
        middles[i] = wanted[i].max(free + heights[i] / 2.0);
        free = middles[i] + heights[i] / 2.0;
    }
    let mut free = lower.max(upper + heights.iter().sum::<f64>());
    for &i in order.iter().rev() {
        middles[i] = middles[i].min(free - heights[i] / 2.0);
        free = middles[i] - heights[i] / 2.0;
    }
    middles
}

/// Draws one pair of axes per group, each with the medians of the other groups. Returns the position of the lower edge.
fn draw_separate_axes(svg: &mut Svg, data: &CreepBands, top: f64) -> f64 {
    let (x, y) = scales(data);
    let n = data.groups.len();
    let n_columns = if n == 4 { 2 } else { 3 };
    let left = widest_y_number_px(&y, MOST_Y_NUMBERS) + 48.0;
    let pitch = (WIDTH_PX - left - MARGIN_PX + PANEL_GAP_PX) / n_columns as f64;
    let names: Vec<Vec<String>> =
        data.groups.iter().map(|group| wrapped(group.label, LABEL_SIZE_PX, pitch - PANEL_GAP_PX - 16.0)).collect();
    let mut bottom = top;
    for (row, groups) in data.groups.chunks(n_columns).enumerate() {
        let names = &names[row * n_columns..];
        let most = names.iter().take(groups.len()).map(Vec::len).max().unwrap_or(1).max(1);
        let above = bottom;
        let y_px = above + NAME_LINE_PX * most as f64 + 8.0;
        for (column, group) in groups.iter().enumerate() {
            let index = row * n_columns + column;
            let frame =
                Rect { x: left + pitch * column as f64, y: y_px, width: pitch - PANEL_GAP_PX, height: PANEL_HEIGHT_PX };
            let axes = Axes { frame, x, y };
            // Only the lowest panel of each column has numbers on its time axis.
            let x_label = (index + n_columns >= n).then_some(X_LABEL);
            axes.x_axis(svg, AxisStyle::new(x_label, 5, 36.0).grid().overhang_px(0.5 * PANEL_GAP_PX));
            let y_label = (column == 0).then_some(Y_LABEL);
            axes.y_axis(svg, AxisStyle::new(y_label, MOST_Y_NUMBERS, left - 12.0).grid());
            svg.clipped(frame, |svg| {
                for (_, other) in data.groups.iter().enumerate().filter(|(k, _)| *k != index) {
                    draw_median(svg, &axes, data, other, OTHERS);
                }
                draw_bands(svg, &axes, data, group);
                draw_median(svg, &axes, data, group, Stroke::solid(group.colour, MEDIAN_PX));
            });
            axes.outline(svg);
            let height = NAME_LINE_PX * names[column].len() as f64;
            let bar = Rect { x: frame.x, y: y_px - 5.0 - height, width: 4.0, height };
            svg.rect(bar, Fill::new(group.colour, 1.0));
            name(svg, &names[column], (frame.x + 11.0, bar.y + height / 2.0));
        }
        bottom = y_px + PANEL_HEIGHT_PX + 14.0;
        // In a shorter column, the axis label of the lowest panel is above the names of the next row.
        if (row + 2) * n_columns > n && (row + 1) * n_columns < n {
            bottom += FOOT_PX - 8.0;
        }
    }
    bottom - 14.0 + FOOT_PX
}

fn entries(data: &CreepBands) -> Vec<Entry> {
    let colour = if let [only] = &data.groups[..] { only.colour } else { MUTED };
    // The dark band is drawn over the light band, so the sample combines both opacities.
    let typical = 1.0 - (1.0 - TYPICAL_OPACITY) * (1.0 - NEW_OPACITY);
    let mark = Mark::LineOnArea(Stroke::solid(colour, MEDIAN_PX), Fill::new(colour, typical));
    let mut entries = vec![
        Entry::new(mark, "typical specimen: median and 90 % interval"),
        Entry::new(Mark::Area(Fill::new(colour, NEW_OPACITY).into()), "90 % interval of a new specimen"),
    ];
    if data.groups.len() > MOST_TOGETHER {
        entries.push(Entry::new(Mark::Line(OTHERS), "medians of the other groups"));
    }
    entries
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_keep_their_order_and_apart() {
        let middles = separate_blocks(&[50.0, 10.0, 52.0, 98.0], &[20.0; 4], (0.0, 100.0));
        assert_eq!(middles, [50.0, 10.0, 70.0, 90.0]);
        let crowded = separate_blocks(&[99.0, 98.0, 97.0], &[30.0; 3], (0.0, 100.0));
        assert_eq!(crowded, [85.0, 55.0, 25.0]);
    }
}
