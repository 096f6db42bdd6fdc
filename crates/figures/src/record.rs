//! Figure of a raw record: force and position against time, starts of cycles, and the position across the line of motion.

use super::axes::{Axes, AxisStyle, title_with_text};
use super::legend::{self, Entry, Mark};
use super::palette::{BLUE, GRID, MUTED, ORANGE, VERMILLION};
use super::svg::{Rect, Stroke, Svg};
use super::ticks::AxisScale;
use base::error::InputPlace;
use base::{Error, Result};

const WIDTH_PX: f64 = 900.0;
const FORCE_PX: f64 = 150.0;
const POSITION_PX: f64 = 320.0;
const LEFT_PX: f64 = 86.0;
const DOT_PX: f64 = 3.2;
/// Margin above and below the values, as a fraction of their range.
const MARGIN: f64 = 0.05;
/// Number of micro-units in an SI unit.
const MICRO: f64 = 1e6;

/// Record to draw, in SI units. All slices have one value per row, except an empty `lateral_m`.
#[derive(Debug, Clone, Copy)]
pub struct RawRecord<'a> {
    /// Times in s.
    pub time_s: &'a [f64],
    /// Commanded force at each row, in N.
    pub force_n: &'a [f64],
    /// True if the force varies linearly between rows, false if it stays constant until the next row.
    pub is_linear: bool,
    /// Position at each row, in m; `None` if tracking was lost.
    pub position_m: &'a [Option<f64>],
    /// Position across the line of motion at each row, in m. Empty if the table has a single coordinate.
    pub lateral_m: &'a [Option<f64>],
    /// Cycle number of each row.
    pub cycle: &'a [u32],
}

/// Draws a record under a heading and a text, such as a list of subtracted offsets.
///
/// # Errors
/// [`Error::Input`] for a record without rows, or with columns of different lengths.
pub fn raw_record(record: &RawRecord, heading: &str, text: &str) -> Result<Svg> {
    check(record)?;
    let width_px = WIDTH_PX - LEFT_PX - 20.0;
    let mut svg = Svg::new(WIDTH_PX, FORCE_PX + POSITION_PX + 190.0, "Raw record");
    let below_px = title_with_text(&mut svg, heading, text, (LEFT_PX, 8.0), width_px);
    let entries = entries(record);
    let below_px = below_px + 16.0;
    legend::row(&mut svg, &entries, (LEFT_PX, below_px), width_px);
    let top_px = below_px + 6.0 + legend::row_height_px(&entries, width_px);
    let um = |values: &[Option<f64>]| values.iter().flatten().map(|x| MICRO * x).collect::<Vec<_>>();
    let (force_un, shown_um) = (forces(record), [um(record.position_m), um(record.lateral_m)].concat());
    let time = AxisScale::over(record.time_s.iter().copied(), 0.01);
    let frames = [(top_px, FORCE_PX), (top_px + FORCE_PX + 18.0, POSITION_PX)];
    let [force, position] = frames.map(|(y, height)| Rect { x: LEFT_PX, y, width: width_px, height });
    let force = Axes { frame: force, x: time, y: AxisScale::over(force_un.1.iter().copied(), MARGIN) };
    let position = Axes { frame: position, x: time, y: AxisScale::over(shown_um, MARGIN) };
    for (axes, label) in [(&force, "force (µN)"), (&position, "position (µm)")] {
        axes.y_axis(&mut svg, AxisStyle::new(Some(label), 6, 66.0).grid());
        axes.verticals(&mut svg, &starts_s(record), Stroke::solid(MUTED, 1.0).dashed(5.0, 4.0));
    }
    position.x_axis(&mut svg, AxisStyle::new(Some("time (s)"), 10, 38.0));
    force.line(&mut svg, &force_un.0, &force_un.1, Stroke::solid(VERMILLION, 1.5));
    position.horizontal(&mut svg, 0.0, Stroke::solid(GRID, 1.5));
    let dots = |values: &[Option<f64>]| -> Vec<(f64, f64)> {
        record.time_s.iter().zip(values).filter_map(|(t, x)| Some((*t, MICRO * (*x)?))).collect()
    };
    position.scatter(&mut svg, dots(record.lateral_m).into_iter(), ORANGE, DOT_PX, 0.7);
    position.scatter(&mut svg, dots(record.position_m).into_iter(), BLUE, DOT_PX, 0.8);
    force.outline(&mut svg);
    position.outline(&mut svg);
    Ok(svg)
}

fn check(record: &RawRecord) -> Result<()> {
    let n = record.time_s.len();
    let is_whole = [record.force_n.len(), record.position_m.len(), record.cycle.len()].iter().all(|len| *len == n);
    if n > 0 && is_whole && (record.lateral_m.is_empty() || record.lateral_m.len() == n) {
        return Ok(());
    }
    let place = InputPlace::default().at_key("record");
    Err(Error::input(
        place,
        "there are no rows, or columns of different lengths",
        "give every row a value in each column",
    ))
}

/// Times (s) and forces (µN) at the corners of the line that shows the force.
fn forces(record: &RawRecord) -> (Vec<f64>, Vec<f64>) {
    let (mut time_s, mut force_un) = (Vec::new(), Vec::new());
    for (row, (t, force_n)) in record.time_s.iter().zip(record.force_n).enumerate() {
        if !record.is_linear && row > 0 && record.force_n[row - 1] != *force_n {
            time_s.push(*t);
            force_un.push(MICRO * record.force_n[row - 1]);
        }
        time_s.push(*t);
        force_un.push(MICRO * force_n);
    }
    (time_s, force_un)
}

/// Start times (s) of all cycles except the first.
fn starts_s(record: &RawRecord) -> Vec<f64> {
    let rows = 1..record.cycle.len();
    rows.filter(|row| record.cycle[*row] != record.cycle[row - 1]).map(|row| record.time_s[row]).collect()
}

fn entries(record: &RawRecord) -> Vec<Entry> {
    let rule = if record.is_linear { "linear between rows" } else { "constant between rows" };
    let mut entries = vec![
        Entry::new(Mark::Line(Stroke::solid(VERMILLION, 1.5)), format!("force, {rule}")),
        Entry::new(Mark::Dot(BLUE, 6.0), "position"),
    ];
    if !record.lateral_m.is_empty() {
        entries.push(Entry::new(Mark::Dot(ORANGE, 6.0), "across the line of motion"));
    }
    if !starts_s(record).is_empty() {
        entries.push(Entry::new(Mark::Line(Stroke::solid(MUTED, 1.0).dashed(5.0, 4.0)), "start of a cycle"));
    }
    entries
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_held_force_has_corners_and_cycles_are_marked() {
        let (time_s, force_n) = ([0.0, 1.0, 2.0, 3.0], [1e-6, 1e-6, -1e-6, -1e-6]);
        let position_m = [Some(0.0), None, Some(2e-6), Some(1e-6)];
        let record = RawRecord {
            time_s: &time_s,
            force_n: &force_n,
            is_linear: false,
            position_m: &position_m,
            lateral_m: &[],
            cycle: &[1, 1, 2, 2],
        };
        assert_eq!(forces(&record), (vec![0.0, 1.0, 2.0, 2.0, 3.0], vec![1.0, 1.0, 1.0, -1.0, -1.0]));
        assert_eq!(starts_s(&record), [2.0]);
        let linear = RawRecord { is_linear: true, lateral_m: &position_m, ..record };
        assert_eq!(forces(&linear).0.len(), 4);
        let document = raw_record(&linear, "bead", "").unwrap().document();
        assert!(document.contains("across the line of motion") && document.contains("start of a cycle"));
        let uneven = raw_record(&RawRecord { cycle: &[1], ..record }, "bead", "");
        assert!(uneven.is_err_and(|error| error.to_string().contains("columns of different lengths")));
    }
}
