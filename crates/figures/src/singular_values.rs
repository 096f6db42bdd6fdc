//! Figure of the singular values of snapshots: their decrease, and the modes that the surrogate keeps.

use super::axes::{Axes, AxisStyle, note, title};
use super::legend::{self, Entry, Mark};
use super::number::format_significant;
use super::palette::{MUTED, WHITE, series};
use super::svg::{Anchor, Fill, Rect, Stroke, Style, Svg};
use super::ticks::AxisScale;
use base::error::InputPlace;
use base::{Error, Result};

const WIDTH_PX: f64 = 760.0;
const HEIGHT_PX: f64 = 380.0;
/// Lower end of the vertical axis. Normalised singular values below the rounding error of the decomposition carry no information.
const FLOOR: f64 = 1e-17;
const MOST_MODES: usize = 60;

/// Singular values of one family of snapshots, which are displacement fields of full-order runs.
#[derive(Debug, Clone, Copy)]
pub struct Family<'a> {
    /// Name of the family, such as `base model` or `Poisson ratio`.
    pub label: &'a str,
    /// Singular values, largest first. They may have any unit, because the figure divides them by the first.
    pub singular_values: &'a [f64],
    /// Number of modes that the surrogate keeps.
    pub n_chosen: usize,
}

/// Draws the singular values of one or several families of snapshots, divided by the first value of each family. The dots of kept modes are filled.
///
/// # Errors
/// [`Error::Input`] for no families, a family without a positive first value, or a tolerance outside (0, 1).
pub fn singular_values(families: &[Family], tolerance: f64, heading: &str) -> Result<Svg> {
    check(families, tolerance)?;
    let shown = families.iter().map(|f| f.singular_values.len().min(MOST_MODES)).max().unwrap_or(1);
    let normalised: Vec<Vec<f64>> = families.iter().map(|family| normalised(family, shown)).collect();
    let smallest = normalised.iter().flatten().copied().fold(tolerance, f64::min);
    let entries = entries(families, tolerance);
    let left = 78.0;
    let top = if heading.is_empty() { 14.0 } else { 42.0 };
    let legend_px = legend::row_height_px(&entries, WIDTH_PX - left - 20.0);
    let frame = Rect { x: left, y: top + legend_px + 6.0, width: WIDTH_PX - left - 20.0, height: HEIGHT_PX };
    let axes = Axes { frame, x: AxisScale::linear(0.5, shown as f64 + 0.5), y: AxisScale::log10(0.3 * smallest, 3.0) };
    let mut svg = Svg::new(WIDTH_PX, frame.bottom() + 50.0, "Singular values of the snapshots");
    title(&mut svg, heading, (left, 26.0), frame.width);
    legend::row(&mut svg, &entries, (left, top), frame.width);
    axes.y_axis(&mut svg, AxisStyle::new(Some("singular value σₖ/σ₁ (–)"), 8, 66.0).grid());
    let most_ticks = shown.clamp(2, 24);
    axes.x_axis(&mut svg, AxisStyle::new(Some("mode k (–)"), most_ticks, 38.0).integers());
    axes.outline(&mut svg);
    axes.horizontal(&mut svg, tolerance, Stroke::solid(MUTED, 1.3).dashed(6.0, 4.0));
    for (i, (family, values)) in families.iter().zip(&normalised).enumerate() {
        draw_family(&mut svg, &axes, family, values, i);
    }
    let longest = families.iter().map(|f| f.singular_values.len()).max().unwrap_or(0);
    if longest > MOST_MODES {
        let text = format!("first {MOST_MODES} of {longest} modes");
        note(&mut svg, &text, (frame.right(), frame.bottom() + 38.0), Anchor::End, 200.0);
    }
    Ok(svg)
}

fn check(families: &[Family], tolerance: f64) -> Result<()> {
    let refuse =
        |found: String, remedy: &str| Err(Error::input(InputPlace::default().at_key("singular values"), found, remedy));
    if families.is_empty() {
        return refuse("no snapshots".to_owned(), "compute snapshots first");
    }
    if !(tolerance > 0.0 && tolerance < 1.0) {
        return refuse(format!("a tolerance of {tolerance}"), "give a tolerance between 0 and 1");
    }
    for family in families {
        let usable = family.singular_values.first().is_some_and(|first| *first > 0.0 && first.is_finite());
        if !usable {
            return refuse(format!("`{}` has no positive singular value", family.label), "check its snapshots");
        }
    }
    Ok(())
}

fn normalised(family: &Family, shown: usize) -> Vec<f64> {
    let first = family.singular_values[0];
    family.singular_values.iter().take(shown).map(|value| (value / first).max(FLOOR)).collect()
}

fn draw_family(svg: &mut Svg, axes: &Axes, family: &Family, values: &[f64], index: usize) {
    let colour = series(index);
    // The first point of all families coincides. Later families have smaller dots, so that each is visible.
    let radius_px = (5.4 - 1.2 * index as f64).max(2.4);
    let modes: Vec<f64> = (1..=values.len()).map(|k| k as f64).collect();
    axes.line(svg, &modes, values, Stroke::solid(colour, 1.2).opacity(0.6));
    for (k, value) in values.iter().enumerate() {
        let fill = if k < family.n_chosen { colour } else { WHITE };
        let style = Style { fill: Some(Fill::new(fill, 1.0)), stroke: Some(Stroke::solid(colour, 1.6)) };
        svg.circle(axes.px((k + 1) as f64, *value), radius_px, style);
    }
}

fn entries(families: &[Family], tolerance: f64) -> Vec<Entry> {
    let of_family = |(i, family): (usize, &Family)| {
        let (n, total) = (family.n_chosen, family.singular_values.len());
        let modes = if total == 1 { "mode" } else { "modes" };
        Entry::new(Mark::Dot(series(i), 8.0), format!("{}: {n} of {total} {modes} kept (filled)", family.label))
    };
    let mut entries: Vec<Entry> = families.iter().enumerate().map(of_family).collect();
    let line = Mark::Line(Stroke::solid(MUTED, 1.3).dashed(6.0, 4.0));
    entries.push(Entry::new(line, format!("tolerance {}", format_significant(tolerance, 1))));
    entries
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kept_modes_are_filled_and_zeros_are_drawn() {
        let values = [5.0, 1e-3, 1e-7, 1e-12, 0.0];
        let family = Family { label: "base model", singular_values: &values, n_chosen: 2 };
        let svg = singular_values(&[family], 1e-6, "POD").unwrap();
        let document = svg.document();
        let filled = format!("r=\"5.4\" fill=\"{}\"", series(0));
        assert_eq!((document.matches(&filled).count(), document.matches("r=\"5.4\" fill=\"#ffffff\"").count()), (2, 3));
        assert!(document.contains("2 of 5 modes kept") && document.contains("tolerance 1×10⁻⁶"));
        assert!(svg.png().is_ok());
    }

    #[test]
    fn empty_families_are_refused() {
        let refuses = |families: &[Family], tolerance: f64, words: &str| {
            let error = singular_values(families, tolerance, "").unwrap_err().to_string();
            assert!(error.contains(words), "`{words}` in {error}");
        };
        refuses(&[], 1e-6, "no snapshots");
        let family = |values| Family { label: "x", singular_values: values, n_chosen: 1 };
        refuses(&[family(&[])], 1e-6, "`x` has no positive singular value");
        refuses(&[family(&[0.0])], 1e-6, "`x` has no positive singular value");
        refuses(&[family(&[1.0])], 0.0, "a tolerance of 0");
    }
}
