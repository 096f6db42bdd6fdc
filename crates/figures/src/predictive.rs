//! Predictive figure: the force above, then the measured positions over predictive bands, and the residuals below.

use super::axes::{Axes, AxisStyle, TICK_SIZE_PX, note, title, widest_y_number_px};
use super::density::{quantile_of_sorted, sorted};
use super::font::{shorten, text_width_px};
use super::legend::{self, Entry, Mark};
use super::number::format_significant;
use super::palette::{BLUE, Colour, INK, MUTED, ORANGE, SKY, VERMILLION};
use super::svg::{Anchor, Fill, Rect, Stroke, Svg, TextStyle};
use super::ticks::AxisScale;
use base::error::InputPlace;
use base::{Error, Result};

const WIDTH_PX: f64 = 960.0;
const MAIN_HEIGHT_PX: f64 = 330.0;
const FORCE_HEIGHT_PX: f64 = 62.0;
const RESIDUAL_HEIGHT_PX: f64 = 120.0;
const GAP_PX: f64 = 12.0;
/// Half-width of the central 90 % interval of a normal distribution, in standard deviations.
const NORMAL_90: f64 = 1.6449;
/// Lines are interrupted at gaps between rows that are longer than this number of usual intervals.
const GAP_INTERVALS: f64 = 8.0;

/// Use of a cycle by the fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CycleKind {
    /// The cycle is fitted.
    Calibration,
    /// The cycle is held out.
    HeldOut,
    /// The cycle is neither fitted nor held out.
    Unused,
}

/// Time interval and use of one cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CycleSpan {
    /// Number of the cycle in the experiment's file.
    pub cycle: i64,
    /// Time of the cycle's first row, in s.
    pub start_s: f64,
    /// End of the cycle in s: time of its last row, or of the next cycle's first row.
    pub end_s: f64,
    /// Use of the cycle: fitted, held out or unused.
    pub kind: CycleKind,
}

/// Lower and upper limits of a central predictive band. Each has one value per row, which is not finite for rows without a prediction.
#[derive(Debug, Clone, Copy)]
pub struct Band<'a> {
    /// Lower limit at each row.
    pub lower: &'a [f64],
    /// Upper limit at each row.
    pub upper: &'a [f64],
}

/// Content of the predictive figure. All slices with one value per row have equal lengths.
#[derive(Debug, Clone, Copy)]
pub struct PredictiveData<'a> {
    /// Title of the figure, such as the specimen's name.
    pub title: &'a str,
    /// Time of each row, in s.
    pub time_s: &'a [f64],
    /// Measured position of each row, in µm; `None` if tracking was lost.
    pub position_um: &'a [Option<f64>],
    /// Commanded force at each row, in µN. It stays constant until the next row.
    pub force_un: &'a [f64],
    /// Median of the predicted position at each row, in µm.
    pub median_um: &'a [f64],
    /// Central 50 % predictive band, in µm.
    pub band_50_um: Band<'a>,
    /// Central 90 % predictive band, in µm.
    pub band_90_um: Band<'a>,
    /// Cycles, in order of time.
    pub cycles: &'a [CycleSpan],
    /// Noise standard deviation (µm) that residuals are compared with, and its source, such as `known`; `None` if it is unknown.
    pub noise: Option<(f64, &'a str)>,
}

/// Draws the predictive figure.
///
/// # Errors
/// [`Error::Input`] for no rows, unequal lengths, or times that are not finite or do not increase.
pub fn predictive(data: &PredictiveData) -> Result<Svg> {
    check(data)?;
    let (force_label, force) = force_in_readable_unit(data.force_un);
    let scales = PredictiveScales::new(data, &force);
    let left = scales.widest_number_px() + 42.0;
    let width = WIDTH_PX - left - 18.0;
    let names = CycleNames::fitting(data.cycles, &scales.time, width);
    let entries = entries(data, names, &scales);
    let legend_top = if data.title.is_empty() { 8.0 } else { 36.0 };
    let mut top = legend_top + legend::row_height_px(&entries, width) + 8.0;
    let mut frame = |height: f64, gap: f64| {
        let frame = Rect { x: left, y: top, width, height };
        top += height + gap;
        frame
    };
    // The strip above the force contains the names of the cycles.
    let strip = frame(18.0, 0.0);
    let time = scales.time;
    let panels = Panels {
        force: Axes { frame: frame(FORCE_HEIGHT_PX, GAP_PX), x: time, y: scales.force },
        main: Axes { frame: frame(MAIN_HEIGHT_PX, GAP_PX), x: time, y: scales.position },
        residual: Axes { frame: frame(RESIDUAL_HEIGHT_PX, 52.0), x: time, y: scales.residual },
    };
    let mut svg = Svg::new(WIDTH_PX, top, "Measured position, predictive bands, force and residuals over time");
    title(&mut svg, data.title, (left, 24.0), width);
    legend::row(&mut svg, &entries, (left, legend_top), width);
    cycle_strip(&mut svg, data.cycles, &panels.force, strip, names);
    for axes in [&panels.force, &panels.main, &panels.residual] {
        cycle_shading(&mut svg, data.cycles, axes);
    }
    panels.draw_axes(&mut svg, left, &force_label);
    let lines = Lines::new(data);
    panels.draw_force(&mut svg, data, &force);
    panels.draw_main(&mut svg, data, &lines);
    panels.draw_residuals(&mut svg, data, &lines);
    Ok(svg)
}

fn check(data: &PredictiveData) -> Result<()> {
    let refuse = |found: String, remedy: &str| {
        Err(Error::input(InputPlace::default().at_key("predictive figure"), found, remedy))
    };
    let n = data.time_s.len();
    let lengths = [
        data.position_um.len(),
        data.force_un.len(),
        data.median_um.len(),
        data.band_50_um.lower.len(),
        data.band_50_um.upper.len(),
        data.band_90_um.lower.len(),
        data.band_90_um.upper.len(),
    ];
    if n < 2 || lengths.iter().any(|length| *length != n) {
        return refuse(
            format!("there are {n} times and {lengths:?} values"),
            "give one value per row, and at least two rows",
        );
    }
    if !data.time_s.is_sorted_by(|a, b| a < b) || !data.time_s.iter().all(|t| t.is_finite()) {
        return refuse("the times do not increase".to_owned(), "sort the rows by time");
    }
    Ok(())
}

fn residuals(data: &PredictiveData) -> Vec<f64> {
    data.position_um.iter().zip(data.median_um).map(|(p, median)| p.unwrap_or(f64::NAN) - median).collect()
}

struct PredictiveScales {
    time: AxisScale,
    force: AxisScale,
    position: AxisScale,
    residual: AxisScale,
}

impl PredictiveScales {
    fn new(data: &PredictiveData, force: &[f64]) -> Self {
        let end = |scale: Option<&f64>| scale.copied().unwrap_or(0.0);
        let last_cycle_end = data.cycles.iter().map(|c| c.end_s).fold(end(data.time_s.last()), f64::max);
        let positions = data.position_um.iter().flatten();
        let bands = data.band_90_um.lower.iter().chain(data.band_90_um.upper);
        let noise = data.noise.map_or(0.0, |(sd, _)| 1.4 * NORMAL_90 * sd);
        let residuals = residuals(data);
        Self {
            time: AxisScale::linear(end(data.time_s.first()), last_cycle_end),
            force: AxisScale::over(force.iter().copied().chain([0.0]), 0.18),
            position: AxisScale::over(positions.chain(bands).copied(), 0.05),
            residual: AxisScale::over(residuals.into_iter().chain([-noise, noise]), 0.08),
        }
    }

    fn widest_number_px(&self) -> f64 {
        [(&self.force, 3), (&self.position, 8), (&self.residual, 5)]
            .map(|(scale, most)| widest_y_number_px(scale, most))
            .into_iter()
            .fold(0.0, f64::max)
    }
}

/// Converts the force to µN, nN or pN, whichever gives numbers near one. Returns the axis label and the converted values.
fn force_in_readable_unit(force_un: &[f64]) -> (String, Vec<f64>) {
    let largest = force_un.iter().map(|f| f.abs()).filter(|f| f.is_finite()).fold(0.0, f64::max);
    let (unit, factor) = match largest {
        l if l == 0.0 || l >= 0.1 => ("µN", 1.0),
        l if l >= 1e-4 => ("nN", 1e3),
        _ => ("pN", 1e6),
    };
    (format!("force ({unit})"), force_un.iter().map(|f| f * factor).collect())
}

fn kind_colour(kind: CycleKind) -> Option<Colour> {
    match kind {
        CycleKind::Calibration => Some(ORANGE),
        CycleKind::HeldOut => Some(SKY),
        CycleKind::Unused => None,
    }
}

fn cycle_shading(svg: &mut Svg, cycles: &[CycleSpan], axes: &Axes) {
    for cycle in cycles {
        let (left, right) = (axes.x_px(cycle.start_s), axes.x_px(cycle.end_s));
        let area = Rect { x: left, width: right - left, ..axes.frame };
        if let Some(colour) = kind_colour(cycle.kind) {
            svg.rect(area, Fill::new(colour, if cycle.kind == CycleKind::Calibration { 0.10 } else { 0.06 }));
        }
        if cycle.start_s > axes.x.lower {
            svg.line((left, axes.frame.y), (left, axes.frame.bottom()), Stroke::solid(MUTED, 0.7).opacity(0.5));
        }
    }
}

/// Forms of the cycles' names in the strip above the force, from the longest to the shortest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum CycleNames {
    NumberAndKind,
    Word,
    Number,
    Nothing,
}

impl CycleNames {
    /// Longest form of names that fits into the narrowest cycle.
    fn fitting(cycles: &[CycleSpan], time: &AxisScale, width_px: f64) -> Self {
        let span_px = |c: &CycleSpan| (time.fraction(c.end_s) - time.fraction(c.start_s)) * width_px;
        let narrowest = cycles.iter().map(span_px).fold(f64::INFINITY, f64::min);
        let fits = |form: &Self| cycles.iter().all(|c| text_width_px(&form.text(c), TICK_SIZE_PX) + 8.0 <= narrowest);
        [Self::NumberAndKind, Self::Word, Self::Number].into_iter().find(fits).unwrap_or(Self::Nothing)
    }

    fn text(self, cycle: &CycleSpan) -> String {
        let kind = match cycle.kind {
            CycleKind::Calibration => "fitted",
            CycleKind::HeldOut => "held out",
            CycleKind::Unused => "not used",
        };
        match self {
            Self::NumberAndKind => format!("cycle {}: {kind}", cycle.cycle),
            Self::Word => format!("cycle {}", cycle.cycle),
            Self::Number => cycle.cycle.to_string(),
            Self::Nothing => String::new(),
        }
    }
}

/// Draws the strip above the force, with the names of the cycles.
fn cycle_strip(svg: &mut Svg, cycles: &[CycleSpan], axes: &Axes, strip: Rect, names: CycleNames) {
    for cycle in cycles {
        let (left, right) = (axes.x_px(cycle.start_s), axes.x_px(cycle.end_s));
        let area = Rect { x: left, width: right - left, height: strip.height - 3.0, ..strip };
        if let Some(colour) = kind_colour(cycle.kind) {
            svg.rect(area, Fill::new(colour, 0.35));
        }
        let at = (area.x + area.width / 2.0, area.y + 11.5);
        svg.text(&names.text(cycle), at, TextStyle::new(TICK_SIZE_PX, Anchor::Middle));
    }
}

/// Points of curves over time: row numbers with their times. NaN and `None` interrupt the curves at every gap between rows.
struct Lines {
    time_s: Vec<f64>,
    rows: Vec<Option<usize>>,
}

impl Lines {
    fn new(data: &PredictiveData) -> Self {
        let intervals: Vec<f64> = data.time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let longest = GAP_INTERVALS * quantile_of_sorted(&sorted(&intervals), 0.5);
        let (mut time_s, mut rows) = (Vec::new(), Vec::new());
        for (i, &time) in data.time_s.iter().enumerate() {
            if i > 0 && time - data.time_s[i - 1] > longest {
                time_s.push(f64::NAN);
                rows.push(None);
            }
            time_s.push(time);
            rows.push(Some(i));
        }
        Self { time_s, rows }
    }

    fn of(&self, values: &[f64]) -> Vec<f64> {
        self.rows.iter().map(|row| row.map_or(f64::NAN, |i| values[i])).collect()
    }
}

struct Panels {
    force: Axes,
    main: Axes,
    residual: Axes,
}

impl Panels {
    fn draw_axes(&self, svg: &mut Svg, left: f64, force_label: &str) {
        let y = |label, most_ticks| AxisStyle::new(Some(label), most_ticks, left - 8.0).grid();
        self.force.y_axis(svg, y(force_label, 3));
        self.main.y_axis(svg, y("position (µm)", 8));
        self.residual.y_axis(svg, y("residual (µm)", 5));
        for (axes, label) in [(&self.force, None), (&self.main, None), (&self.residual, Some("time (s)"))] {
            axes.x_axis(svg, AxisStyle::new(label, 10, 38.0).overhang_px(16.0));
            axes.outline(svg);
        }
    }

    /// Draws the force as a staircase, because it stays constant from row to row.
    fn draw_force(&self, svg: &mut Svg, data: &PredictiveData, force: &[f64]) {
        let (mut time, mut steps): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        for (i, &value) in force.iter().enumerate() {
            // Between rows of equal force the staircase has no corner.
            if i > 0 && i + 1 < force.len() && value == force[i - 1] {
                continue;
            }
            if let Some(&before) = steps.last() {
                time.push(data.time_s[i]);
                steps.push(before);
            }
            time.push(data.time_s[i]);
            steps.push(value);
        }
        if let Some(&last) = steps.last() {
            time.push(self.force.x.upper);
            steps.push(last);
        }
        svg.clipped(self.force.frame, |svg| self.force.line(svg, &time, &steps, Stroke::solid(INK, 1.4)));
    }

    fn draw_main(&self, svg: &mut Svg, data: &PredictiveData, lines: &Lines) {
        svg.clipped(self.main.frame, |svg| {
            draw_bands(svg, &self.main, data, lines, &vec![0.0; data.time_s.len()]);
            let points = data.time_s.iter().zip(data.position_um).map(|(t, p)| (*t, p.unwrap_or(f64::NAN)));
            self.main.scatter(svg, points, INK, dot_diameter_px(data), 0.75);
            // The median is drawn above the dots. Otherwise dense dots would hide it.
            self.main.line(svg, &lines.time_s, &lines.of(data.median_um), Stroke::solid(BLUE, 1.3));
        });
    }

    /// Draws dots and bands relative to the predictive median. Bands are then visible even if they are thin compared with the motion.
    fn draw_residuals(&self, svg: &mut Svg, data: &PredictiveData, lines: &Lines) {
        let residuals = residuals(data);
        svg.clipped(self.residual.frame, |svg| {
            draw_bands(svg, &self.residual, data, lines, data.median_um);
            self.residual.horizontal(svg, 0.0, Stroke::solid(BLUE, 1.3));
            let points = data.time_s.iter().copied().zip(residuals.iter().copied());
            self.residual.scatter(svg, points, INK, dot_diameter_px(data), 0.75);
            if let Some((sd, _)) = data.noise {
                for limit in [-NORMAL_90 * sd, NORMAL_90 * sd] {
                    self.residual.horizontal(svg, limit, noise_stroke());
                }
            }
        });
        let scored = |kind| {
            score(data, &residuals, kind).map(|(rmse, name)| format!("{name} RMSE {} µm", format_significant(rmse, 2)))
        };
        let text: Vec<String> = [CycleKind::Calibration, CycleKind::HeldOut].into_iter().filter_map(scored).collect();
        let at = (self.residual.frame.right(), self.residual.frame.bottom() + 38.0);
        note(svg, &text.join(", "), at, Anchor::End, 0.42 * self.residual.frame.width);
    }
}

fn noise_stroke() -> Stroke {
    Stroke::solid(VERMILLION, 1.5).dashed(6.0, 4.0)
}

/// Draws both bands relative to a curve, which has one value per row.
fn draw_bands(svg: &mut Svg, axes: &Axes, data: &PredictiveData, lines: &Lines, relative_to: &[f64]) {
    let relative = |values: &[f64]| values.iter().zip(relative_to).map(|(v, base)| v - base).collect::<Vec<f64>>();
    for (band, opacity) in [(data.band_90_um, 0.22), (data.band_50_um, 0.36)] {
        let (lower, upper) = (lines.of(&relative(band.lower)), lines.of(&relative(band.upper)));
        axes.band(svg, &lines.time_s, &lower, &upper, Fill::new(BLUE, opacity));
    }
}

/// Root mean square residual (µm) about the predictive median over the cycles of one kind, with the kind's name; `None` without such cycles.
fn score(data: &PredictiveData, residuals: &[f64], kind: CycleKind) -> Option<(f64, &'static str)> {
    let name = if kind == CycleKind::Calibration { "fitted" } else { "held-out" };
    // A row at the boundary of two cycles belongs to the later cycle.
    let cycle_at = |time: f64| {
        let begun = data.cycles.partition_point(|c| c.start_s <= time);
        data.cycles[..begun].last().filter(|c| time <= c.end_s)
    };
    let inside = |time: f64| cycle_at(time).is_some_and(|cycle| cycle.kind == kind);
    let squares: Vec<f64> =
        data.time_s.iter().zip(residuals).filter(|(t, r)| inside(**t) && r.is_finite()).map(|(_, r)| r * r).collect();
    (!squares.is_empty()).then(|| ((squares.iter().sum::<f64>() / squares.len() as f64).sqrt(), name))
}

/// Diameter of the dots in pixels. It is smaller if there are many.
fn dot_diameter_px(data: &PredictiveData) -> f64 {
    let spacing = WIDTH_PX / data.time_s.len() as f64;
    (2.2 * spacing).clamp(1.5, 3.6)
}

/// Entries of the legend. They explain the colours of cycles if the strip above the force has no room for names.
fn entries(data: &PredictiveData, names: CycleNames, scales: &PredictiveScales) -> Vec<Entry> {
    let band = |name: &str, band: Band| {
        let in_panel = |scale: &AxisScale, height_px: f64| height_px * scale.largest_distance(band.lower, band.upper);
        let (main, residual) =
            (in_panel(&scales.position, MAIN_HEIGHT_PX), in_panel(&scales.residual, RESIDUAL_HEIGHT_PX));
        legend::band_text(name, main.max(residual))
    };
    let mut entries = vec![
        Entry::new(Mark::Dot(INK, 3.6), "measured"),
        Entry::new(Mark::Line(Stroke::solid(BLUE, 1.8)), "predictive median"),
        Entry::new(Mark::Area(Fill::new(BLUE, 0.5).into()), band("50 % band", data.band_50_um)),
        Entry::new(Mark::Area(Fill::new(BLUE, 0.22).into()), band("90 % band", data.band_90_um)),
    ];
    if let Some((sd, name)) = data.noise {
        let text =
            format!("90 % of the noise ({}, σ = {} µm)", shorten(name, TICK_SIZE_PX, 200.0), format_significant(sd, 2));
        entries.push(Entry::new(Mark::Line(noise_stroke()), text));
    }
    let has = |kind| names != CycleNames::NumberAndKind && data.cycles.iter().any(|cycle| cycle.kind == kind);
    for (kind, name) in [(CycleKind::Calibration, "fitted cycles"), (CycleKind::HeldOut, "held-out cycles")] {
        if let (true, Some(colour)) = (has(kind), kind_colour(kind)) {
            entries.push(Entry::new(Mark::Area(Fill::new(colour, 0.35).into()), name));
        }
    }
    entries
}

#[cfg(test)]
#[path = "predictive_tests.rs"]
mod tests;
