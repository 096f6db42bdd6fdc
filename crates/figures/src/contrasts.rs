//! Figure of pairwise contrasts between groups: one matrix per parameter. Each cell shows the ratio of the row's group to the column's group.

use super::axes::{TICK_SIZE_PX, title_with_text};
use super::font::{fitting_size_px, shorten, text_width_px, wrapped, wrapped_to};
use super::number::{format_decimals, format_significant};
use super::palette::{BLUE, Colour, GRID, INK, MUTED, VERMILLION, WHITE};
use super::svg::{Anchor, Fill, Point, Rect, Stroke, Style, Svg, TextStyle};
use base::error::InputPlace;
use base::{Error, Result};

const MARGIN_PX: f64 = 20.0;
/// Maximum width of the figure if panels are side by side, in pixels.
const MOST_WIDTH_PX: f64 = 1300.0;
const LEAST_WIDTH_PX: f64 = 900.0;
const PANEL_GAP_PX: f64 = 34.0;
const NAME_SIZE_PX: f64 = 11.5;
const NAME_LINE_PX: f64 = 13.5;
/// Maximum width of a group's name beside a row, and maximum height of a name that is written upwards above a column; in pixels.
const MOST_NAME_PX: f64 = 118.0;
/// Opacity of a cell's strongest colour. It is low enough for legible text in the cell.
const STRONGEST: f64 = 0.72;
const DECLARED: Stroke = Stroke { colour: INK, width_px: 3.0, opacity: 1.0, dash: None };
/// Possible ends of the colour scale, as ratios of two groups.
const ENDS: [f64; 7] = [1.25, 1.5, 2.0, 3.0, 5.0, 10.0, 100.0];

/// Content of the figure of contrasts: title, summary, and one matrix per parameter.
#[derive(Debug, Clone)]
pub struct ContrastMatrix<'a> {
    /// Title of the figure.
    pub title: &'a str,
    /// Sentence that summarises the figure.
    pub sentence: &'a str,
    /// Smallest relative difference that matters in practice: 0.1 for 10 %.
    pub margin: f64,
    /// One matrix per parameter.
    pub panels: Vec<ContrastPanel<'a>>,
}

/// Matrix of contrasts between groups in one parameter.
#[derive(Debug, Clone)]
pub struct ContrastPanel<'a> {
    /// Symbol and unit, such as `E (Pa)`.
    pub label: String,
    /// Names of the groups, at least two.
    pub groups: Vec<&'a str>,
    /// Ratio of the row's group to the column's group, at `[row][column]`; `None` on the diagonal and for unknown ratios.
    pub cells: Vec<Vec<Option<ContrastCell>>>,
}

/// Contrast of two groups: ratio of their parameter values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContrastCell {
    /// 5 % quantile, median and 95 % quantile of the ratio.
    pub ratio: [f64; 3],
    /// Probability that the ratio is above 1.
    pub probability_greater: f64,
    /// Probability that the ratio is above 1 + `margin`.
    pub probability_beyond_margin: f64,
    /// True if the direction of the difference is certain enough to be declared.
    pub is_declared: bool,
}

/// Draws the matrices of contrasts.
///
/// # Errors
/// [`Error::Input`] for no panels, panels of fewer than two groups, cells that do not form a square, or a margin that is negative or not finite. Ratios have to
/// be finite, positive and in order, and probabilities have to lie between 0 and 1.
pub fn contrast_matrix(data: &ContrastMatrix) -> Result<Svg> {
    check(data)?;
    let layout = ContrastLayout::new(data);
    let draw = |svg: &mut Svg| {
        let width = layout.width_px - 2.0 * MARGIN_PX;
        let below = MARGIN_PX + title_with_text(svg, data.title, data.sentence, (MARGIN_PX, MARGIN_PX), width) + 12.0;
        let below = below + legend(svg, data, &layout, (MARGIN_PX, below)) + 22.0;
        layout.draw(svg, data, below)
    };
    Ok(Svg::drawn(layout.width_px, data.title, 0.0, draw))
}

fn check(data: &ContrastMatrix) -> Result<()> {
    let refuse =
        |found: String, remedy: &str| Err(Error::input(InputPlace::default().at_key("contrast matrix"), found, remedy));
    if data.panels.is_empty() {
        return refuse("no parameters".into(), "give at least one panel");
    }
    if !(data.margin.is_finite() && data.margin >= 0.0) {
        return refuse(format!("a margin of {}", data.margin), "give 0.1 for 10 %");
    }
    for panel in &data.panels {
        let (label, n) = (&panel.label, panel.groups.len());
        if n < 2 {
            return refuse(format!("{label}: {n} groups"), "compare at least two groups");
        }
        if panel.cells.len() != n || panel.cells.iter().any(|row| row.len() != n) {
            return refuse(
                format!("{label}: the cells do not form a square of {n} rows"),
                "give each group a row and a column",
            );
        }
        for (row, cells) in panel.cells.iter().enumerate() {
            for (column, cell) in cells.iter().enumerate() {
                let Some(cell) = cell else { continue };
                let place = format!("{label}, {} over {}", panel.groups[row], panel.groups[column]);
                let positive = cell.ratio.iter().all(|ratio| ratio.is_finite() && *ratio > 0.0);
                if !positive || !cell.ratio.is_sorted() {
                    let found = format!("{place}: the quantiles are {:?}", cell.ratio);
                    return refuse(found, "give positive quantiles in ascending order");
                }
                let probabilities = [cell.probability_greater, cell.probability_beyond_margin];
                if !probabilities.iter().all(|p| (0.0..=1.0).contains(p)) {
                    let found = format!("{place}: the probabilities are {probabilities:?}");
                    return refuse(found, "give probabilities from 0 to 1");
                }
            }
        }
    }
    Ok(())
}

struct ContrastLayout {
    width_px: f64,
    n_columns: usize,
    cell: (f64, f64),
    sizes: ContrastSizes,
    /// Width left of the cells for the names of the rows, in pixels.
    name_px: f64,
    /// Height above the cells for the names of the columns, in pixels.
    head_px: f64,
    upwards: bool,
    scale: ColourScale,
}

/// Font sizes in a cell: of the ratio, and of its interval and probabilities.
#[derive(Debug, Clone, Copy)]
struct ContrastSizes {
    ratio_px: f64,
    small_px: f64,
}

impl ContrastLayout {
    fn new(data: &ContrastMatrix) -> Self {
        let n_groups = data.panels.iter().map(|panel| panel.groups.len()).max().unwrap_or(2);
        let (cell, sizes) = match n_groups {
            ..=4 => ((98.0, 66.0), ContrastSizes { ratio_px: 16.0, small_px: 11.0 }),
            5..=6 => ((90.0, 60.0), ContrastSizes { ratio_px: 14.0, small_px: 10.5 }),
            _ => ((84.0, 54.0), ContrastSizes { ratio_px: 13.0, small_px: 10.0 }),
        };
        // Names above columns are horizontal if every word fits.
        let fits = |name: &str| {
            let lines = wrapped(name, NAME_SIZE_PX, cell.0 - 8.0);
            lines.len() <= 4 && lines.iter().all(|line| !line.ends_with('…'))
        };
        let groups = || data.panels.iter().flat_map(|panel| &panel.groups);
        let upwards = !groups().all(|name| fits(name));
        let widest = groups().map(|name| text_width_px(name, NAME_SIZE_PX)).fold(0.0, f64::max);
        let name_px = (widest + 11.0).min(MOST_NAME_PX).ceil();
        let head_px = if upwards {
            name_px
        } else {
            let most = groups().map(|name| wrapped(name, NAME_SIZE_PX, cell.0 - 8.0).len()).max().unwrap_or(1);
            NAME_LINE_PX * most as f64 + 4.0
        };
        let panel_px = name_px + cell.0 * n_groups as f64;
        let fitting = (MOST_WIDTH_PX - 2.0 * MARGIN_PX + PANEL_GAP_PX) / (panel_px + PANEL_GAP_PX);
        let n_columns = (fitting as usize).clamp(1, data.panels.len());
        let width = 2.0 * MARGIN_PX + n_columns as f64 * (panel_px + PANEL_GAP_PX) - PANEL_GAP_PX;
        let scale = ColourScale::over(data);
        Self { width_px: width.max(LEAST_WIDTH_PX), n_columns, cell, sizes, name_px, head_px, upwards, scale }
    }

    /// Draws all panels, with the upper edge at `top`. Returns the position of the lower edge.
    fn draw(&self, svg: &mut Svg, data: &ContrastMatrix, top: f64) -> f64 {
        let mut y = top;
        for panels in data.panels.chunks(self.n_columns) {
            let most = panels.iter().map(|panel| panel.groups.len()).max().unwrap_or(0);
            let mut x = MARGIN_PX;
            for panel in panels {
                self.panel(svg, panel, (x, y));
                x += self.name_px + self.cell.0 * panel.groups.len() as f64 + PANEL_GAP_PX;
            }
            y += 24.0 + self.head_px + self.cell.1 * most as f64 + 28.0;
        }
        y - 28.0 + MARGIN_PX
    }

    fn panel(&self, svg: &mut Svg, panel: &ContrastPanel, (x, y): Point) {
        let (width, height) = self.cell;
        let n = panel.groups.len();
        let frame = Rect {
            x: x + self.name_px,
            y: y + 24.0 + self.head_px,
            width: width * n as f64,
            height: height * n as f64,
        };
        let heading = shorten(&panel.label, 15.0, self.name_px + frame.width);
        svg.text(&heading, (x, y + 14.0), TextStyle::new(15.0, Anchor::Start));
        for (i, name) in panel.groups.iter().enumerate() {
            self.row_name(svg, name, (frame.x - 8.0, frame.y + height * (i as f64 + 0.5)));
            self.column_name(svg, name, (frame.x + width * (i as f64 + 0.5), frame.y - 6.0));
        }
        let at = |row: usize, column: usize| Rect {
            x: frame.x + width * column as f64,
            y: frame.y + height * row as f64,
            width,
            height,
        };
        for (row, cells) in panel.cells.iter().enumerate() {
            for (column, cell) in cells.iter().enumerate() {
                match cell {
                    Some(cell) => {
                        let colour = self.scale.colour(cell.ratio[1], sign_certainty(cell.probability_greater));
                        svg.rect(at(row, column), Fill::new(colour, 1.0));
                        numbers(svg, cell, panel.cells[column][row].as_ref(), at(row, column), self.sizes);
                    }
                    None => svg.rect(at(row, column), Fill::new(GRID, 0.7)),
                }
            }
        }
        for i in 0..=n {
            let (x, y) = (frame.x + width * i as f64, frame.y + height * i as f64);
            svg.line((x, frame.y), (x, frame.bottom()), Stroke::solid(WHITE, 2.0));
            svg.line((frame.x, y), (frame.right(), y), Stroke::solid(WHITE, 2.0));
        }
        for (row, cells) in panel.cells.iter().enumerate() {
            for (column, _) in cells.iter().enumerate().filter(|(_, cell)| cell.is_some_and(|cell| cell.is_declared)) {
                draw_difference_frame(svg, at(row, column));
            }
        }
    }

    fn row_name(&self, svg: &mut Svg, name: &str, (right, middle): Point) {
        let lines = wrapped_to(name, NAME_SIZE_PX, self.name_px - 10.0, (self.cell.1 / NAME_LINE_PX) as usize);
        for (i, line) in lines.iter().enumerate() {
            let y = middle + 4.0 + NAME_LINE_PX * (i as f64 - 0.5 * (lines.len() as f64 - 1.0));
            svg.text(line, (right, y), TextStyle::new(NAME_SIZE_PX, Anchor::End));
        }
    }

    fn column_name(&self, svg: &mut Svg, name: &str, (middle, bottom): Point) {
        if !self.upwards {
            let lines = wrapped(name, NAME_SIZE_PX, self.cell.0 - 8.0);
            for (i, line) in lines.iter().rev().enumerate() {
                let at = (middle, bottom - NAME_LINE_PX * i as f64);
                svg.text(line, at, TextStyle::new(NAME_SIZE_PX, Anchor::Middle));
            }
            return;
        }
        let lines = wrapped_to(name, NAME_SIZE_PX, self.name_px - 8.0, (self.cell.0 / NAME_LINE_PX) as usize);
        for (i, line) in lines.iter().enumerate() {
            let x = middle + 4.0 + NAME_LINE_PX * (i as f64 - 0.5 * (lines.len() as f64 - 1.0));
            svg.text(line, (x, bottom), TextStyle::new(NAME_SIZE_PX, Anchor::Start).upwards());
        }
    }
}

/// Writes ratio, interval and probabilities into a cell. `inverse` is the cell of the inverse ratio.
fn numbers(svg: &mut Svg, cell: &ContrastCell, inverse: Option<&ContrastCell>, rect: Rect, sizes: ContrastSizes) {
    let ContrastSizes { ratio_px, small_px } = sizes;
    let (x, room) = (rect.x + rect.width / 2.0, rect.width - 15.0);
    let [q05, median, q95] = cell.ratio;
    let lines = [
        (ratio_text(median), ratio_px),
        (format!("{}–{}", ratio_text(q05), ratio_text(q95)), small_px),
        (probabilities_text(cell, inverse), small_px),
    ];
    let total = 1.12 * ratio_px + 2.0 * 1.28 * small_px;
    let mut y = rect.y + 0.5 * (rect.height - total);
    for (text, size_px) in lines {
        y += if size_px == ratio_px { 1.0 } else { 1.28 } * size_px;
        let size_px = fitting_size_px(&text, size_px, 7.0, room);
        svg.text(&shorten(&text, size_px, room + 1.0), (x, y), TextStyle::new(size_px, Anchor::Middle));
    }
}

/// Formats a ratio: with two decimals near one, otherwise with two significant digits.
fn ratio_text(ratio: f64) -> String {
    if (0.0995..9.995).contains(&ratio) { format_decimals(ratio, 2) } else { format_significant(ratio, 2) }
}

/// Text of two probabilities: that the ratio lies on the median's side of 1, and that it does so by more than the margin.
fn probabilities_text(cell: &ContrastCell, inverse: Option<&ContrastCell>) -> String {
    let (direction, beyond) = if cell.ratio[1] >= 1.0 {
        (cell.probability_greater, Some(cell.probability_beyond_margin))
    } else {
        (1.0 - cell.probability_greater, inverse.map(|inverse| inverse.probability_beyond_margin))
    };
    let beyond = beyond.map_or(String::new(), |beyond| format!(" · {}", probability_text(beyond)));
    format!("{}{beyond}", probability_text(direction))
}

/// Formats a probability with two decimals, or with three near 0 and 1. The text is never 0 or 1, because a finite number of draws cannot be that certain.
fn probability_text(probability: f64) -> String {
    match probability {
        ..0.0005 => "<0.001".into(),
        ..0.00995 | 0.99..0.9995 => format_decimals(probability, 3),
        0.9995.. => ">0.999".into(),
        _ => format_decimals(probability, 2),
    }
}

fn draw_difference_frame(svg: &mut Svg, rect: Rect) {
    let Rect { x, y, width, height } = rect;
    let inside = Rect { x: x + 2.5, y: y + 2.5, width: width - 5.0, height: height - 5.0 };
    svg.rect(inside, Style::from(DECLARED));
}

/// Certainty of a difference's sign: 0 if both signs are equally probable, 1 if one sign is certain.
fn sign_certainty(probability_greater: f64) -> f64 {
    (2.0 * probability_greater - 1.0).abs()
}

/// Colour scale of ratios: blue (row smaller) over white to vermillion (row greater). Colours are paler if the sign is uncertain.
#[derive(Debug, Clone, Copy)]
struct ColourScale {
    /// Ratio at which the colour is strongest.
    end: f64,
}

impl ColourScale {
    fn over(data: &ContrastMatrix) -> Self {
        let cells = data.panels.iter().flat_map(|panel| &panel.cells).flatten().flatten();
        let largest = cells.map(|cell| cell.ratio[1].ln().abs()).fold(0.0, f64::max).exp();
        Self { end: ENDS.into_iter().find(|end| *end >= largest).unwrap_or(ENDS[ENDS.len() - 1]) }
    }

    fn colour(&self, ratio: f64, sureness: f64) -> Colour {
        let strength = (ratio.ln().abs() / self.end.ln()).min(1.0);
        // The power 0.6 makes small differences visible. The power 1.5 makes cells pale if their sign is nearly random.
        let share = STRONGEST * strength.powf(0.6) * sureness.powf(1.5);
        let towards = if ratio < 1.0 { BLUE } else { VERMILLION };
        towards.on_white(share)
    }
}

/// Draws the legend, which explains numbers, colours and frames. Returns its height in pixels.
fn legend(svg: &mut Svg, data: &ContrastMatrix, layout: &ContrastLayout, (x, y): Point) -> f64 {
    let percent = format_significant(100.0 * data.margin, 2);
    let percent = percent.strip_suffix(".0").unwrap_or(&percent);
    let height = layout.cell.1.max(60.0);
    let sample = Rect { x, y, width: layout.cell.0, height };
    let cell = ContrastCell {
        ratio: [1.21, 1.48, 1.83],
        probability_greater: 0.998,
        probability_beyond_margin: 0.97,
        is_declared: true,
    };
    svg.rect(sample, Fill::new(layout.scale.colour(cell.ratio[1], sign_certainty(cell.probability_greater)), 1.0));
    numbers(svg, &cell, None, sample, layout.sizes);
    draw_difference_frame(svg, sample);
    let notes = [
        "median of row's group ÷ column's group".to_owned(),
        "90 % interval".to_owned(),
        format!("probability of this direction · of more than {percent} %"),
        "framed: the program states a difference".to_owned(),
    ];
    let left = sample.right() + 12.0;
    for (i, note) in notes.iter().enumerate() {
        let at = (left, y + 11.0 + 15.5 * i as f64);
        svg.text(note, at, TextStyle::new(TICK_SIZE_PX + 0.5, Anchor::Start));
    }
    let widest = notes.iter().map(|note| text_width_px(note, TICK_SIZE_PX + 0.5)).fold(0.0, f64::max);
    colour_key(svg, layout.scale, (left + widest + 46.0, y));
    height
}

/// Draws the colour scale. The ratio increases to the right, and the certainty of its sign downwards.
fn colour_key(svg: &mut Svg, scale: ColourScale, (x, y): Point) {
    const STEPS: usize = 21;
    const SURE: [(f64, &str); 3] = [(0.999, "> 0.99"), (0.9, "0.9"), (0.6, "0.6")];
    let (width, row, top) = (230.0, 13.0, y + 17.0);
    let step = width / STEPS as f64;
    svg.text("row smaller", (x, y + 11.0), TextStyle::new(TICK_SIZE_PX, Anchor::Start).colour(MUTED));
    svg.text("row greater", (x + width, y + 11.0), TextStyle::new(TICK_SIZE_PX, Anchor::End).colour(MUTED));
    for (i, (probability, label)) in SURE.into_iter().enumerate() {
        let y = top + row * i as f64;
        for k in 0..STEPS {
            let exponent = 2.0 * (k as f64 + 0.5) / STEPS as f64 - 1.0;
            let colour = scale.colour((exponent * scale.end.ln()).exp(), sign_certainty(probability));
            // Each step is slightly wider than its distance to the next, so that no gap is visible.
            let rect = Rect { x: x + step * k as f64, y, width: step + 0.3, height: row };
            svg.rect(rect, Fill::new(colour, 1.0));
        }
        let style = TextStyle::new(TICK_SIZE_PX - 0.5, Anchor::Start).colour(MUTED);
        svg.text(label, (x + width + 8.0, y + 10.5), style);
    }
    let frame = Rect { x, y: top, width, height: row * SURE.len() as f64 };
    svg.rect(frame, Style::from(Stroke::solid(MUTED, 0.8)));
    let end = |ratio: f64| format_significant(ratio, 2);
    let plain = |text: String| text.strip_suffix(".0").map(str::to_owned).unwrap_or(text);
    let labels = [
        (x, format!("÷ {}", plain(end(scale.end))), Anchor::Start),
        (x + width / 2.0, "1".into(), Anchor::Middle),
        (x + width, format!("× {}", plain(end(scale.end))), Anchor::End),
    ];
    for (at, text, anchor) in labels {
        svg.text(&text, (at, frame.bottom() + 13.0), TextStyle::new(TICK_SIZE_PX, anchor));
    }
    svg.text("probability", (x + width + 8.0, y + 11.0), TextStyle::new(TICK_SIZE_PX, Anchor::Start).colour(MUTED));
}
