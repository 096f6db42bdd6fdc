//! Figure and table of the effects' fingerprints: the change of the fitted curve by each effect, together with the residuals.

use std::path::Path;

use super::axes::{Axes, AxisStyle, title_with_text};
use super::legend::{self, Entry, Mark};
use super::palette::{MUTED, VERMILLION};
use super::svg::{Rect, Stroke, Svg};
use super::ticks::AxisScale;
use base::error::{Error, InputPlace, Result};
use base::files::stream_atomically;

const WIDTH_PX: f64 = 960.0;
const MARGIN_PX: f64 = 20.0;
const PANEL_PX: f64 = 120.0;
const GAP_PX: f64 = 44.0;
const LEFT_PX: f64 = 64.0;
/// Number of panels side by side.
const COLUMNS: usize = 2;
const MOST_PANELS: usize = 6;
const LINE: Stroke = Stroke { colour: VERMILLION, width_px: 1.8, opacity: 1.0, dash: None };
const DOT_PX: f64 = 2.2;

/// Residuals of a record, and the change of the fitted curve by each effect. All lists have one value per row.
#[derive(Debug, Clone, PartialEq)]
pub struct Fingerprints {
    /// Time of each row, in s.
    pub time_s: Vec<f64>,
    /// Residual, in µm; `None` for rows without a measurement.
    pub residual_um: Vec<Option<f64>>,
    /// Name of each effect, and the change of the fitted curve (µm) by a refit with this effect; largest gain first.
    pub effects: Vec<(String, Vec<f64>)>,
}

/// Writes the fingerprints as a table with one column per effect.
///
/// # Errors
/// [`Error::File`] if the file cannot be written.
pub fn write_fingerprints(path: &Path, fingerprints: &Fingerprints) -> Result<()> {
    stream_atomically(path, |out| {
        // Names of effects contain only letters and hyphens, so they need no quotation marks.
        let names: String = fingerprints.effects.iter().map(|(slug, _)| format!(",{slug}")).collect();
        writeln!(out, "time_s,left_um{names}")?;
        for (row, time_s) in fingerprints.time_s.iter().enumerate() {
            let left = fingerprints.residual_um[row].map_or(String::new(), |left| format!("{left:.4}"));
            let changes: String =
                fingerprints.effects.iter().map(|(_, change)| format!(",{:.4}", change[row])).collect();
            writeln!(out, "{time_s:?},{left}{changes}")?;
        }
        Ok(())
    })
}

/// Draws the fingerprints of the effects with the largest gains. `experiment` is named in the title.
///
/// # Errors
/// [`Error::Input`] if there is no effect, or fewer than two rows.
pub fn fingerprints(fingerprints: &Fingerprints, experiment: &str) -> Result<Svg> {
    let (time_s, shown) = (&fingerprints.time_s, fingerprints.effects.iter().take(MOST_PANELS));
    let (Some(first), Some(last), true) =
        (time_s.first(), time_s.last(), !fingerprints.effects.is_empty() && time_s.len() > 1)
    else {
        return Err(Error::input(
            InputPlace::default(),
            "there is nothing to draw",
            "give at least two rows and one effect",
        ));
    };
    let heading = format!("{experiment}: residuals that each effect would explain");
    let text = "Points: residuals. Line: change of the fitted curve when the model is refitted with the effect.";
    let left = fingerprints.residual_um.iter().flatten().copied();
    let changes = shown.clone().flat_map(|(_, change)| change.iter().copied());
    let (x, y) = (AxisScale::linear(*first, *last), AxisScale::over(left.chain(changes), 0.06));
    let measured: Vec<(f64, f64)> =
        time_s.iter().zip(&fingerprints.residual_um).filter_map(|(t, left)| Some((*t, (*left)?))).collect();
    let width = (WIDTH_PX - 2.0 * MARGIN_PX - COLUMNS as f64 * LEFT_PX) / COLUMNS as f64;
    let draw = |svg: &mut Svg| {
        let at = (MARGIN_PX, MARGIN_PX);
        let top = MARGIN_PX + title_with_text(svg, &heading, text, at, WIDTH_PX - 2.0 * MARGIN_PX) + 8.0;
        let mut bottom = top;
        for (place, (slug, change)) in shown.clone().enumerate() {
            let (row, column) = (place / COLUMNS, place % COLUMNS);
            let x_px = MARGIN_PX + LEFT_PX + column as f64 * (width + LEFT_PX);
            let y_px = top + 22.0 + row as f64 * (PANEL_PX + GAP_PX + 22.0);
            let frame = Rect { x: x_px, y: y_px, width, height: PANEL_PX };
            legend::row(svg, &[Entry::new(Mark::Line(LINE), slug.clone())], (x_px, y_px - 20.0), width);
            let axes = Axes { frame, x, y };
            axes.y_axis(svg, AxisStyle::new((column == 0).then_some("µm"), 5, 44.0).grid());
            axes.x_axis(svg, AxisStyle::new(Some("time (s)"), 6, 34.0));
            svg.clipped(frame, |svg| {
                axes.scatter(svg, measured.iter().copied(), MUTED, DOT_PX, 0.6);
                axes.line(svg, time_s, change, LINE);
            });
            axes.outline(svg);
            bottom = frame.bottom() + GAP_PX;
        }
        bottom
    };
    Ok(Svg::drawn(WIDTH_PX, &heading, 0.0, draw))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Fingerprints {
        let time_s: Vec<f64> = (0..50).map(|k| 0.1 * f64::from(k)).collect();
        let left_um = time_s.iter().map(|t| (*t != 1.0).then(|| t.sin())).collect();
        let change = |scale: f64| time_s.iter().map(|t| scale * t.sin()).collect::<Vec<f64>>();
        let effects = [("softening", 0.9), ("inertia", 0.1)].map(|(slug, scale)| (slug.to_string(), change(scale)));
        Fingerprints { residual_um: left_um, effects: effects.to_vec(), time_s }
    }

    /// Every effect has a column in the table and a panel in the figure. Rows without a position have an empty residual cell.
    #[test]
    fn every_effect_is_written_and_drawn() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("fingerprints.csv");
        write_fingerprints(&path, &example()).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!((lines.len(), lines[0]), (51, "time_s,left_um,softening,inertia"));
        assert!(lines[11].starts_with("1.0,,"), "{}", lines[11]);
        let svg = fingerprints(&example(), "eye").unwrap().document();
        assert!(svg.contains("softening") && svg.contains("inertia"));
        let nothing = Fingerprints { effects: Vec::new(), ..example() };
        assert!(
            fingerprints(&nothing, "eye").is_err_and(|error| error.to_string().contains("there is nothing to draw"))
        );
    }
}
