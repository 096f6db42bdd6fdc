//! Forest plot of a hierarchical model: one panel per parameter, and in it one block per group. A block shows the group's specimens, its typical specimen and a
//! new specimen.

use super::axes::{Axes, AxisStyle, TICK_SIZE_PX, title_with_text};
use super::flags::{self, Flag};
use super::font::{shorten, text_width_px, wrapped, wrapped_to};
use super::legend::{self, Entry, Mark};
use super::number::{decimal_exponent, factored_exponent, format_decimals, power_of_ten};
use super::palette::{AXIS, Colour, GRID, INK, MUTED, WHITE};
use super::svg::{Anchor, Fill, Path, Point, Rect, Stroke, Style, Svg, TextStyle};
use super::ticks::AxisScale;
use base::error::InputPlace;
use base::{Error, Result};

const MARGIN_PX: f64 = 20.0;
const PANEL_GAP_PX: f64 = 26.0;
const FOOT_PX: f64 = 48.0;
/// Font size of a group's name, in pixels.
const NAME_SIZE_PX: f64 = 13.0;
const NAME_LINE_PX: f64 = 15.0;
const SUMMARY_PX: f64 = 38.0;
/// Distance in pixels of the summary's bar from the upper edge of the summary.
const SUMMARY_BAR_PX: f64 = 25.0;
/// Maximum number of specimens in a group with one row each. The specimens of a larger group are drawn as a cloud of marks.
const MOST_ROWS: usize = 12;
/// Maximum number of specimens in the figure whose names are written beside their rows.
const MOST_NAMES: usize = 42;
const NAMED_ROW_PX: f64 = 13.0;
const UNNAMED_ROW_PX: f64 = 7.5;
const SPECIMEN_SIZE_PX: f64 = 9.5;
const OUTLYING_LINE_PX: f64 = 12.0;
const BELOW_PX: f64 = 9.0;
const MOST_NUMBERS: usize = 5;
const TYPICAL_BAR_PX: f64 = 12.0;
const NEW_BAR_PX: f64 = 3.0;
/// Distance of a specimen's two estimates from the middle of its row, in row heights. The estimate from the specimen's own data is above, the pooled estimate
/// below.
const ROW_HALF: f64 = 0.22;
const OWN_LINE_PX: f64 = 1.1;
const OWN_OPACITY: f64 = 0.5;
const POOLED_LINE_PX: f64 = 1.8;

const REFERENCE: Stroke = Stroke { colour: AXIS, width_px: 1.0, opacity: 0.9, dash: Some((3.5, 2.5)) };

/// Content of the forest plot: title, summary, and one panel per parameter.
#[derive(Debug, Clone)]
pub struct Forest<'a> {
    /// Title of the figure.
    pub title: &'a str,
    /// Sentence that summarises the figure.
    pub sentence: &'a str,
    /// One panel per parameter, side by side. All panels have equal groups in equal order.
    pub panels: Vec<ForestPanel<'a>>,
}

/// Panel of one parameter.
#[derive(Debug, Clone)]
pub struct ForestPanel<'a> {
    /// Symbol and unit, such as `E (Pa)`.
    pub label: String,
    /// Groups, from top to bottom.
    pub rows: Vec<ForestRow<'a>>,
    /// Published values of the parameter.
    pub references: Vec<ForestReference<'a>>,
}

/// Values of a parameter in one group; all values are positive.
#[derive(Debug, Clone)]
pub struct ForestRow<'a> {
    /// Name of the group.
    pub group: &'a str,
    /// Colour of the group.
    pub colour: Colour,
    /// Number of specimens.
    pub n_specimens: usize,
    /// 5 % quantile, median and 95 % quantile for the group's typical (median) specimen.
    pub typical: [f64; 3],
    /// Central 90 % interval for a specimen that has not been measured.
    pub new_specimen: [f64; 2],
    /// Specimens of the group. Their order is equal in every panel.
    pub specimens: Vec<SpecimenMark<'a>>,
}

/// Value of a parameter in one specimen.
#[derive(Debug, Clone)]
pub struct SpecimenMark<'a> {
    /// Name of the specimen.
    pub name: &'a str,
    /// 5 % quantile, median and 95 % quantile of the posterior from the specimen's own data only.
    pub unpooled: [f64; 3],
    /// 5 % quantile, median and 95 % quantile of the posterior that is pooled with the other specimens.
    pub pooled: [f64; 3],
    /// True if the specimen lies far from its group.
    pub is_outlying: bool,
}

/// Published value of a parameter.
#[derive(Debug, Clone)]
pub struct ForestReference<'a> {
    /// Source of the value, as the figure names it.
    pub label: &'a str,
    /// Value in the panel's unit.
    pub value: f64,
}

/// Draws the forest plot.
///
/// # Errors
/// [`Error::Input`] for no panels or groups, or panels whose groups differ. Values have to be finite and positive, and quantiles in order.
pub fn forest(data: &Forest) -> Result<Svg> {
    check(data)?;
    let layout = ForestLayout::new(data);
    let draw = |svg: &mut Svg| {
        let width = layout.width_px() - 2.0 * MARGIN_PX;
        let below = MARGIN_PX + title_with_text(svg, data.title, data.sentence, (MARGIN_PX, MARGIN_PX), width) + 10.0;
        let below = below + legend::row(svg, &entries(data, &layout), (MARGIN_PX, below), width) + 12.0;
        layout.draw(svg, data, below)
    };
    Ok(Svg::drawn(layout.width_px(), data.title, 0.0, draw))
}

fn check(data: &Forest) -> Result<()> {
    let refuse =
        |found: String, remedy: &str| Err(Error::input(InputPlace::default().at_key("forest plot"), found, remedy));
    let [first, others @ ..] = &data.panels[..] else {
        return refuse("no parameters".into(), "give at least one panel");
    };
    if first.rows.is_empty() {
        return refuse("no groups".into(), "give at least one group");
    }
    let names = |panel: &ForestPanel| {
        let specimens = |row: &ForestRow| row.specimens.iter().map(|s| s.name.to_owned()).collect::<Vec<_>>();
        panel.rows.iter().map(|row| (row.group.to_owned(), specimens(row))).collect::<Vec<_>>()
    };
    let expected = names(first);
    if let Some(other) = others.iter().find(|panel| names(panel) != expected) {
        let found = format!("{}: groups or specimens differ from the first panel's", other.label);
        return refuse(found, "give all panels the same groups and specimens in the same order");
    }
    let not_ascending = "not an ascending list of positive numbers";
    for panel in &data.panels {
        for row in &panel.rows {
            let place = format!("{}, {}", panel.label, row.group);
            let remedy = "give positive quantiles in ascending order";
            if !(ascending(&row.typical) && ascending(&row.new_specimen)) {
                return refuse(format!("{place}: the summary is {not_ascending}"), remedy);
            }
            if let Some(odd) = row.specimens.iter().find(|s| !(ascending(&s.unpooled) && ascending(&s.pooled))) {
                return refuse(format!("{place}, {}: the estimate is {not_ascending}", odd.name), remedy);
            }
        }
        if let Some(odd) = panel.references.iter().find(|reference| !ascending(&[reference.value])) {
            let found = format!("{}: the reference `{}` is {}", panel.label, odd.label, odd.value);
            return refuse(found, "give a positive value, or remove the reference");
        }
    }
    Ok(())
}

/// Returns whether the values are finite, positive and in ascending order.
fn ascending(values: &[f64]) -> bool {
    values.iter().all(|value| value.is_finite() && *value > 0.0) && values.is_sorted()
}

/// Form in which the specimens of a group are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Specimens {
    /// One row for each specimen, with its intervals. `named` is true if rows are high enough for names.
    Rows { named: bool },
    /// Only marks, distributed over the height of the block.
    Cloud,
}

/// Vertical space of a group. It is equal in all panels.
#[derive(Debug, Clone)]
struct ForestBlock {
    specimens: Specimens,
    /// Lines of the group's name.
    name: Vec<String>,
    /// Lines with the names of outlying specimens; empty if the rows themselves have names.
    outlying: Vec<String>,
    summary_px: f64,
    specimens_px: f64,
}

impl ForestBlock {
    fn height_px(&self) -> f64 {
        self.summary_px + self.specimens_px + BELOW_PX
    }
}

struct ForestLayout {
    label_px: f64,
    panel_px: f64,
    blocks: Vec<ForestBlock>,
    n_panels: usize,
}

/// Text of the number of specimens, such as `n = 8`.
fn size_text(row: &ForestRow) -> String {
    format!("n = {}", row.n_specimens)
}

impl ForestLayout {
    fn new(data: &Forest) -> Self {
        let rows = &data.panels[0].rows;
        let n_rows: usize = rows.iter().map(|row| row.specimens.len()).filter(|n| *n <= MOST_ROWS).sum();
        let named = n_rows <= MOST_NAMES;
        let widest_name = rows.iter().map(|row| text_width_px(row.group, NAME_SIZE_PX)).fold(0.0, f64::max);
        let label_px = (widest_name + 66.0).clamp(130.0, 220.0).ceil();
        let panel_px = [420.0, 370.0, 290.0, 265.0][(data.panels.len() - 1).min(3)];
        let blocks = (0..rows.len()).map(|i| block(data, i, named, label_px)).collect();
        Self { label_px, panel_px, blocks, n_panels: data.panels.len() }
    }

    fn width_px(&self) -> f64 {
        2.0 * MARGIN_PX + self.label_px + self.n_panels as f64 * (self.panel_px + PANEL_GAP_PX) - PANEL_GAP_PX + 4.0
    }

    /// Draws the panels with their upper edge at `top`, and returns the position of their lower edge.
    fn draw(&self, svg: &mut Svg, data: &Forest, top: f64) -> f64 {
        let height: f64 = self.blocks.iter().map(ForestBlock::height_px).sum();
        let frame_at = |k: usize, y: f64| Rect {
            x: MARGIN_PX + self.label_px + k as f64 * (self.panel_px + PANEL_GAP_PX),
            y,
            width: self.panel_px,
            height,
        };
        let axes_at = |k: usize, y: f64| Axes {
            frame: frame_at(k, y),
            x: scale(&data.panels[k]),
            y: AxisScale::linear(0.0, 1.0),
        };
        let flags_at = |axes: &Axes, panel: &ForestPanel| {
            let values: Vec<(&str, f64)> = panel.references.iter().map(|r| (r.label, r.value)).collect();
            flags::place_line_labels(axes, &values, 0.35 * PANEL_GAP_PX)
        };
        let heights =
            data.panels.iter().enumerate().map(|(k, panel)| flags::height_px(&flags_at(&axes_at(k, 0.0), panel)));
        let y = top + heights.fold(0.0, f64::max) + 4.0;
        self.names(svg, data, frame_at(0, y));
        for (k, panel) in data.panels.iter().enumerate() {
            let axes = axes_at(k, y);
            self.panel(svg, &axes, panel, &flags_at(&axes, panel));
        }
        y + height + FOOT_PX
    }

    /// Blocks with the positions of their upper edges, in a panel that starts at `top`.
    fn placed(&self, top: f64) -> impl Iterator<Item = (&ForestBlock, f64)> {
        self.blocks.iter().scan(top, |y, block| {
            let upper = *y;
            *y += block.height_px();
            Some((block, upper))
        })
    }

    /// Writes the names of groups and specimens to the left of the first panel.
    fn names(&self, svg: &mut Svg, data: &Forest, frame: Rect) {
        for (row, (block, upper)) in data.panels[0].rows.iter().zip(self.placed(frame.y)) {
            let bar = Rect { x: MARGIN_PX, y: upper + 5.0, width: 4.0, height: block.height_px() - 10.0 };
            svg.rect(bar, Fill::new(row.colour, 1.0));
            let left = MARGIN_PX + 12.0;
            for (i, line) in block.name.iter().enumerate() {
                let at = (left, upper + 21.0 + NAME_LINE_PX * i as f64);
                svg.text(line, at, TextStyle::new(NAME_SIZE_PX, Anchor::Start));
            }
            let right = frame.x - 8.0;
            let style = TextStyle::new(TICK_SIZE_PX, Anchor::End).colour(MUTED);
            svg.text(&size_text(row), (right, upper + 21.0), style);
            let below = upper + block.summary_px;
            if block.specimens == (Specimens::Rows { named: true }) {
                for (i, specimen) in row.specimens.iter().enumerate() {
                    let name = shorten(specimen.name, SPECIMEN_SIZE_PX, self.label_px - 34.0);
                    let colour = if specimen.is_outlying { INK } else { MUTED };
                    let style = TextStyle::new(SPECIMEN_SIZE_PX, Anchor::End).colour(colour);
                    let y = below + NAMED_ROW_PX * (i as f64 + 0.5);
                    if specimen.is_outlying {
                        let beside = right - text_width_px(&name, SPECIMEN_SIZE_PX) - 9.0;
                        outlying_mark(svg, (beside, y), 3.6);
                    }
                    svg.text(&name, (right, y + 3.4), style);
                }
            }
            let below_name = upper + 19.0 + NAME_LINE_PX * block.name.len() as f64;
            for (i, line) in block.outlying.iter().enumerate() {
                let at = (left, below_name + OUTLYING_LINE_PX * i as f64);
                svg.text(line, at, TextStyle::new(SPECIMEN_SIZE_PX, Anchor::Start));
            }
        }
    }

    fn panel(&self, svg: &mut Svg, axes: &Axes, panel: &ForestPanel, flags: &[Flag]) {
        let frame = axes.frame;
        axes.x_axis(svg, AxisStyle::new(Some(&panel.label), MOST_NUMBERS, 36.0).grid());
        let exponent = axis_exponent(axes);
        for (row, (block, upper)) in panel.rows.iter().zip(self.placed(frame.y)) {
            // The interval of the typical specimen is also drawn behind the rows of its specimens. Blocks that are far apart can then be compared.
            let inside = Rect { y: upper + SUMMARY_BAR_PX, height: block.height_px() - SUMMARY_BAR_PX, ..frame };
            svg.clipped(frame, |svg| {
                svg.rect(between(axes, row.typical[0], row.typical[2], inside), Fill::new(row.colour, 0.14));
            });
            if upper > frame.y {
                svg.line((frame.x, upper), (frame.right(), upper), Stroke::solid(GRID, 1.0));
            }
        }
        for flag in flags {
            flag.draw_line(svg, frame, REFERENCE);
        }
        for flag in flags {
            flag.draw_name(svg, frame, TextStyle::new(TICK_SIZE_PX, Anchor::Start).colour(AXIS));
        }
        for (row, (block, upper)) in panel.rows.iter().zip(self.placed(frame.y)) {
            let below = Rect { y: upper + block.summary_px, height: block.specimens_px, ..frame };
            svg.clipped(frame, |svg| match block.specimens {
                Specimens::Rows { named } => rows(svg, axes, row, below, named),
                Specimens::Cloud => cloud(svg, axes, row, below),
            });
            summary(svg, axes, row, upper + SUMMARY_BAR_PX, exponent);
        }
        axes.outline(svg);
    }
}

fn block(data: &Forest, index: usize, named: bool, label_px: f64) -> ForestBlock {
    let row = &data.panels[0].rows[index];
    let n = row.specimens.len();
    let specimens = if n > MOST_ROWS { Specimens::Cloud } else { Specimens::Rows { named } };
    let room = label_px - 12.0 - 8.0 - text_width_px(&size_text(row), TICK_SIZE_PX) - 8.0;
    let name = wrapped_to(row.group, NAME_SIZE_PX, room, 3);
    let outlying: Vec<&str> = row.specimens.iter().filter(|s| s.is_outlying).map(|s| s.name).collect();
    let outlying = if specimens == (Specimens::Rows { named: true }) || outlying.is_empty() {
        Vec::new()
    } else {
        outlying_lines(&outlying, label_px - 20.0)
    };
    let specimens_px = match specimens {
        Specimens::Rows { named: true } => NAMED_ROW_PX * n as f64,
        Specimens::Rows { named: false } => UNNAMED_ROW_PX * n as f64,
        Specimens::Cloud => (34.0 + 0.45 * n as f64).min(120.0),
    };
    // Names of specimens begin below the group's name. Without them, the lines of the group's name may be beside the marks of the specimens.
    let text_px = 10.0 + NAME_LINE_PX * name.len() as f64 + OUTLYING_LINE_PX * outlying.len() as f64;
    let (summary_px, specimens_px) = match specimens {
        Specimens::Rows { named: true } => (SUMMARY_PX.max(text_px), specimens_px),
        _ => (SUMMARY_PX, specimens_px.max(text_px - SUMMARY_PX)),
    };
    ForestBlock { specimens, name, outlying, summary_px, specimens_px }
}

/// Text such as `outlying: a, b and 7 more`, in up to three lines. It has more lines if the first name needs them.
fn outlying_lines(names: &[&str], width_px: f64) -> Vec<String> {
    let lines_of = |shown: usize| {
        let hidden = names.len() - shown;
        let more = if hidden == 0 { String::new() } else { format!(" and {hidden} more") };
        wrapped(&format!("outlying: {}{more}", names[..shown].join(", ")), SPECIMEN_SIZE_PX, width_px)
    };
    let shown = (1..=names.len()).rev().find(|shown| lines_of(*shown).len() <= 3).unwrap_or(1);
    lines_of(shown)
}

fn scale(panel: &ForestPanel) -> AxisScale {
    let specimens = || panel.rows.iter().flat_map(|row| &row.specimens);
    let typical = panel.rows.iter().flat_map(|row| row.typical);
    let estimates = typical.chain(specimens().flat_map(|specimen| [specimen.unpooled[1], specimen.pooled[1]]));
    let intervals = panel
        .rows
        .iter()
        .flat_map(|row| row.new_specimen)
        .chain(specimens().flat_map(|s| [s.unpooled, s.pooled].concat()));
    AxisScale::log10_around(estimates, intervals, panel.references.iter().map(|reference| reference.value))
}

/// Part of the rectangle `inside` between two values on the x axis. It is at least two pixels wide.
fn between(axes: &Axes, lower: f64, upper: f64, inside: Rect) -> Rect {
    let (left, right) = (axes.x_px(lower), axes.x_px(upper));
    let width = (right - left).max(2.0);
    Rect { x: 0.5 * (left + right - width), width, ..inside }
}

/// Draws the summary of a group: the interval of a new specimen, over it the bar of the typical specimen, and above them its numbers.
fn summary(svg: &mut Svg, axes: &Axes, row: &ForestRow, y: f64, axis_exponent: i32) {
    let frame = axes.frame;
    let bar = |height: f64| Rect { y: y - height / 2.0, height, ..frame };
    let [q05, median, q95] = row.typical;
    svg.clipped(frame, |svg| {
        svg.rect(between(axes, row.new_specimen[0], row.new_specimen[1], bar(NEW_BAR_PX)), Fill::new(row.colour, 0.75));
        svg.rect(between(axes, q05, q95, bar(TYPICAL_BAR_PX)), Fill::new(row.colour, 1.0));
        let x = axes.x_px(median);
        svg.line((x, y - 0.5 * TYPICAL_BAR_PX - 2.0), (x, y + 0.5 * TYPICAL_BAR_PX + 2.0), Stroke::solid(INK, 2.0));
    });
    arrows(svg, axes, row.new_specimen, y, row.colour);
    let text = with_interval(row.typical, axis_exponent);
    let half = text_width_px(&text, TICK_SIZE_PX) / 2.0 + 3.0;
    let x = axes.x_px(median).clamp(frame.x + half, (frame.right() - half).max(frame.x + half));
    let behind = Rect { x: x - half, y: y - 20.5, width: 2.0 * half, height: 12.0 };
    svg.rect(behind, Fill::new(WHITE, 0.85));
    svg.text(&text, (x, y - 11.0), TextStyle::new(TICK_SIZE_PX, Anchor::Middle));
}

/// Exponent of the power of ten that multiplies the numbers on the x axis; 0 if there is none.
fn axis_exponent(axes: &Axes) -> i32 {
    let ticks = axes.x.ticks_side_by_side(MOST_NUMBERS, axes.frame.width, TICK_SIZE_PX, 0.5 * TICK_SIZE_PX);
    if ticks.factor.is_empty() { 0 } else { factored_exponent(axes.x.upper) }
}

/// Text such as `3.50 (3.12–3.94)`. The width of the interval and its lower end determine the number of decimals. The power of ten is that of the axis, or a
/// separate one if the number is very large or small.
fn with_interval([lower, median, upper]: [f64; 3], axis_exponent: i32) -> String {
    let (exponent, factor) = match (axis_exponent, factored_exponent(median)) {
        (0, exponent) if exponent != 0 => (exponent, format!("×{}", power_of_ten(exponent))),
        (axis, _) => (axis, String::new()),
    };
    let scale = 10f64.powi(exponent);
    let width = (upper - lower).max(1e-4 * median);
    let decimals = (1 - decimal_exponent(width / scale)).max(-decimal_exponent(lower / scale)).clamp(0, 4) as usize;
    let [lower, median, upper] = [lower, median, upper].map(|value| format_decimals(value / scale, decimals));
    format!("{median} ({lower}–{upper}){factor}")
}

/// Draws the tip of an arrow at each side of the frame where an interval continues beyond it.
fn arrows(svg: &mut Svg, axes: &Axes, ends: [f64; 2], y: f64, colour: Colour) {
    let frame = axes.frame;
    let mut path = Path::default();
    let tip =
        |path: &mut Path, x: f64, back: f64| path.polyline([(x + back, y - 3.5), (x, y), (x + back, y + 3.5)], true);
    if axes.x.fraction(ends[0]) < 0.0 {
        tip(&mut path, frame.x + 1.0, 6.0);
    }
    if axes.x.fraction(ends[1]) > 1.0 {
        tip(&mut path, frame.right() - 1.0, -6.0);
    }
    svg.path(&path, Fill::new(colour, 1.0));
}

/// Draws one row per specimen. Its own interval and estimate are above, the pooled ones below.
fn rows(svg: &mut Svg, axes: &Axes, row: &ForestRow, below: Rect, named: bool) {
    let pitch = if named { NAMED_ROW_PX } else { UNNAMED_ROW_PX };
    let size = if named { 1.0 } else { 0.8 };
    for (i, specimen) in row.specimens.iter().enumerate() {
        let middle = below.y + pitch * (i as f64 + 0.5);
        let [above, under] = [middle - ROW_HALF * pitch, middle + ROW_HALF * pitch];
        let x = |value: f64| axes.x_px(value);
        let mut interval = |[q05, _, q95]: [f64; 3], y: f64, width: f64, opacity: f64| {
            svg.line((x(q05), y), (x(q95), y), Stroke::solid(row.colour, width).opacity(opacity));
            arrows(svg, axes, [q05, q95], y, row.colour);
        };
        interval(specimen.unpooled, above, OWN_LINE_PX, OWN_OPACITY);
        interval(specimen.pooled, under, POOLED_LINE_PX * size, 1.0);
        let (unpooled, pooled) = (x(specimen.unpooled[1]), x(specimen.pooled[1]));
        if specimen.is_outlying {
            outlying_mark(svg, (unpooled, above), 6.2 * size);
        }
        svg.circle((unpooled, above), 2.4 * size, own_style(row.colour));
        svg.circle((pooled, under), 2.6 * size, Fill::new(row.colour, 1.0));
    }
}

/// Draws only the marks of the specimens, each at its own height. Multiples of the golden ratio fill the height evenly for any number of marks.
fn cloud(svg: &mut Svg, axes: &Axes, row: &ForestRow, below: Rect) {
    let y = |i: usize| below.y + 3.0 + (below.height - 6.0) * (0.5 + i as f64 * 0.618_033_988_749_895).fract();
    let (mut joins, mut path, mut pooled) = (Path::default(), Path::default(), Path::default());
    for (i, specimen) in row.specimens.iter().enumerate() {
        let (from, to) = ((axes.x_px(specimen.unpooled[1]), y(i)), (axes.x_px(specimen.pooled[1]), y(i)));
        joins.polyline([from, to], false);
        path.dot(from);
        pooled.dot(to);
    }
    svg.path(&joins, Stroke::solid(row.colour, 0.8).opacity(0.5));
    svg.dots(&path, row.colour, 4.6, 0.8);
    svg.dots(&path, WHITE, 2.8, 1.0);
    svg.dots(&pooled, row.colour, 3.6, 0.9);
    for (i, specimen) in row.specimens.iter().enumerate().filter(|(_, specimen)| specimen.is_outlying) {
        outlying_mark(svg, (axes.x_px(specimen.unpooled[1]), y(i)), 5.2);
    }
}

fn own_style(colour: Colour) -> Style {
    Style { fill: Some(Fill::new(WHITE, 1.0)), stroke: Some(Stroke::solid(colour, 1.3)) }
}

/// Draws a diamond around the own estimate of an outlying specimen.
fn outlying_mark(svg: &mut Svg, (x, y): Point, radius: f64) {
    let mut path = Path::default();
    path.polyline([(x - radius, y), (x, y - radius), (x + radius, y), (x, y + radius)], true);
    svg.path(&path, Stroke::solid(INK, 1.3));
}

fn entries(data: &Forest, layout: &ForestLayout) -> Vec<Entry> {
    let rows = || data.panels.iter().flat_map(|panel| &panel.rows);
    let mut entries = vec![
        Entry::new(
            Mark::Drawn(|svg, r| {
                let bar = Rect { y: r.y + r.height / 2.0 - 5.0, height: 10.0, ..r };
                svg.rect(bar, Fill::new(MUTED, 1.0));
                let x = r.x + r.width / 2.0;
                svg.line((x, bar.y - 1.5), (x, bar.bottom() + 1.5), Stroke::solid(INK, 2.0));
            }),
            "typical specimen: median and 90 % interval",
        ),
        Entry::new(Mark::Line(Stroke::solid(MUTED, NEW_BAR_PX)), "90 % interval of a new specimen"),
    ];
    if rows().any(|row| !row.specimens.is_empty()) {
        let has_rows = layout.blocks.iter().any(|block| block.specimens != Specimens::Cloud);
        let has_clouds = layout.blocks.iter().any(|block| block.specimens == Specimens::Cloud);
        let shown = match (has_rows, has_clouds) {
            (true, false) => "median and 90 %",
            (true, true) => "median and 90 % (large groups: median only)",
            (false, _) => "median",
        };
        let [item, pooled] =
            if has_rows { [own_with_interval, pooled_with_interval] } else { [own_alone, pooled_alone] };
        entries.push(Entry::new(Mark::Drawn(item), format!("specimen, from its own data: {shown}")));
        entries.push(Entry::new(Mark::Drawn(pooled), format!("specimen, pooled with the others: {shown}")));
        if has_clouds {
            let mark = |svg: &mut Svg, r: Rect| {
                let y = r.y + r.height / 2.0;
                svg.line((r.x, y), (r.x + r.width, y), Stroke::solid(MUTED, 0.8).opacity(0.6));
            };
            entries.push(Entry::new(Mark::Drawn(mark), "change by pooling"));
        }
    }
    if rows().any(|row| row.specimens.iter().any(|specimen| specimen.is_outlying)) {
        let mark = |svg: &mut Svg, r: Rect| outlying_mark(svg, (r.x + r.width / 2.0, r.y + r.height / 2.0), 6.0);
        entries.push(Entry::new(Mark::Drawn(mark), "outlying specimen"));
    }
    if data.panels.iter().any(|panel| !panel.references.is_empty()) {
        entries.push(Entry::new(Mark::Line(REFERENCE), "published"));
    }
    entries
}

fn own_with_interval(svg: &mut Svg, r: Rect) {
    let y = r.y + r.height / 2.0;
    svg.line((r.x, y), (r.x + r.width, y), Stroke::solid(MUTED, OWN_LINE_PX).opacity(OWN_OPACITY));
    own_alone(svg, r);
}

fn pooled_with_interval(svg: &mut Svg, r: Rect) {
    let y = r.y + r.height / 2.0;
    svg.line((r.x, y), (r.x + r.width, y), Stroke::solid(MUTED, POOLED_LINE_PX));
    pooled_alone(svg, r);
}

fn pooled_alone(svg: &mut Svg, r: Rect) {
    svg.circle((r.x + r.width / 2.0, r.y + r.height / 2.0), 2.8, Fill::new(MUTED, 1.0));
}

fn own_alone(svg: &mut Svg, r: Rect) {
    svg.circle((r.x + r.width / 2.0, r.y + r.height / 2.0), 3.0, own_style(MUTED));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_that_their_interval_supports() {
        assert_eq!(with_interval([3.123, 3.5, 3.944], 0), "3.50 (3.12–3.94)");
        assert_eq!(with_interval([42.2, 47.4, 53.1], 0), "47 (42–53)");
        assert_eq!(with_interval([0.04, 0.31, 2.2], 0), "0.31 (0.04–2.20)");
        assert_eq!(with_interval([1.9e-7, 2.2e-7, 2.5e-7], 0), "2.20 (1.90–2.50)×10⁻⁷");
        assert_eq!(with_interval([1.9e-7, 2.2e-7, 2.5e-7], -6), "0.220 (0.190–0.250)");
        assert_eq!(with_interval([2.0, 2.0, 2.0], 0), "2.0000 (2.0000–2.0000)");
    }
}
