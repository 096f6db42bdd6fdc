//! Figure of a calibration: a histogram of the true value's rank among posterior draws, for each quantity. A band shows the range expected for uniform ranks.

use super::axes::{Axes, AxisStyle, LABEL_SIZE_PX, note, title};
use super::font::shorten;
use super::labels::parameter_label;
use super::legend::{self, Entry, Mark};
use super::number::format_significant;
use super::palette::{BLUE, GREEN, INK, MUTED, VERMILLION};
use super::svg::{Anchor, Fill, Rect, Stroke, Style, Svg, TextStyle};
use super::ticks::AxisScale;
use documents::calibration::{CalibratedQuantity, Calibration, CalibrationKind};

const WIDTH_PX: f64 = 1080.0;
const N_COLUMNS: usize = 3;
const PANEL_HEIGHT_PX: f64 = 150.0;
const PITCH_PX: f64 = 238.0;
const TOP_PX: f64 = 86.0;
const BAND_OPACITY: f64 = 0.18;

/// Draws a histogram of the ranks for each parameter, and finally one for the log density.
pub fn rank_histograms(found: &Calibration) -> Svg {
    let n_rows = found.quantities.len().div_ceil(N_COLUMNS).max(1);
    let height = TOP_PX + PITCH_PX * n_rows as f64 + 14.0;
    let mut svg = Svg::new(WIDTH_PX, height, "Ranks of true parameters among posterior draws");
    let heading = match found.verdict.kind {
        CalibrationKind::Calibrated => "the posteriors are calibrated",
        CalibrationKind::Miscalibrated => "the posteriors are not calibrated",
        CalibrationKind::Undecided => "too few records for a verdict",
    };
    let heading = format!("{}: {heading} ({} simulated records)", found.experiment, found.ranked);
    title(&mut svg, &heading, (16.0, 26.0), WIDTH_PX - 32.0);
    let area = |colour, opacity| Mark::Area(Style { fill: Some(Fill::new(colour, opacity)), stroke: None });
    let entries = [
        Entry::new(area(BLUE, 0.8), "true values with this rank"),
        Entry::new(area(GREEN, BAND_OPACITY), "range of 99 % of bins if ranks are uniform"),
        Entry::new(Mark::Line(Stroke::solid(MUTED, 1.3).dashed(6.0, 4.0)), "expected mean"),
    ];
    legend::row(&mut svg, &entries, (16.0, 50.0), WIDTH_PX - 32.0);
    let pitch = WIDTH_PX / N_COLUMNS as f64;
    for (place, quantity) in found.quantities.iter().enumerate() {
        let (row, column) = (place / N_COLUMNS, place % N_COLUMNS);
        let frame = Rect {
            x: pitch * column as f64 + 62.0,
            y: TOP_PX + PITCH_PX * row as f64 + 26.0,
            width: pitch - 82.0,
            height: PANEL_HEIGHT_PX,
        };
        draw(&mut svg, found, quantity, frame);
    }
    svg
}

fn draw(svg: &mut Svg, found: &Calibration, calibrated_quantity: &CalibratedQuantity, frame: Rect) {
    let [lower, upper] = found.bin_interval_99.map(|count| count as f64);
    let n_bins = calibrated_quantity.counts.len().max(1);
    let mean = found.ranked as f64 / n_bins as f64;
    let most = calibrated_quantity.counts.iter().map(|count| *count as f64).fold(upper, f64::max).max(1.0);
    let last = found.draws as f64 + 1.0;
    let axes = Axes { frame, x: AxisScale::linear(0.0, last), y: AxisScale::linear(0.0, 1.12 * most) };
    axes.y_axis(svg, AxisStyle::new(Some("true values (–)"), 5, 48.0).grid().integers());
    axes.band(svg, &[0.0, last], &[lower, lower], &[upper, upper], Fill::new(GREEN, BAND_OPACITY));
    for (bin, count) in calibrated_quantity.counts.iter().enumerate() {
        let edge = |bin: usize| axes.x_px(last * bin as f64 / n_bins as f64);
        let (x, y) = (edge(bin) + 0.6, axes.y_px(*count as f64));
        let is_outside = !(lower..=upper).contains(&(*count as f64));
        let colour = if is_outside { VERMILLION } else { BLUE };
        let bar = Rect { x, y, width: edge(bin + 1) - 0.6 - x, height: frame.bottom() - y };
        svg.rect(bar, Fill::new(colour, 0.8));
    }
    axes.horizontal(svg, mean, Stroke::solid(MUTED, 1.3).dashed(6.0, 4.0));
    axes.x_axis(svg, AxisStyle::new(Some("rank of the true value (–)"), 6, 34.0));
    axes.outline(svg);
    let symbol = parameter_label(&calibrated_quantity.name).symbol;
    let p = calibrated_quantity.p_holm.map_or(String::new(), |p| format!(", corrected p {}", format_significant(p, 2)));
    let heading = shorten(&format!("{symbol}{p}"), LABEL_SIZE_PX, frame.width + 40.0);
    svg.text(&heading, (frame.x, frame.y - 9.0), TextStyle::new(LABEL_SIZE_PX, Anchor::Start).colour(INK));
    let share = |share: Option<f64>| share.map_or("–".into(), |share| format!("{:.0} %", 100.0 * share));
    let covered = format!(
        "50 % intervals contain {}, 90 % {}",
        share(calibrated_quantity.coverage_50.share),
        share(calibrated_quantity.coverage_90.share)
    );
    note(svg, &covered, (frame.right(), frame.bottom() + 52.0), Anchor::End, frame.width);
}

#[cfg(test)]
mod tests {
    use super::*;
    use documents::calibration::{CalibrationVerdict, Coverage, Simulator};
    use documents::posterior::ModelSummary;

    fn found() -> Calibration {
        let quantity = |name: &str, counts: Vec<usize>| CalibratedQuantity {
            name: name.into(),
            counts,
            chi_square: Some(9.0),
            place: Some(0.1),
            spread: Some(0.2),
            p_chi_square: Some(0.4),
            p_holm: Some(1.0),
            z_mean: Some(0.0),
            z_sd: Some(1.0),
            coverage_50: Coverage { share: Some(0.52), interval_95: [0.4, 0.6] },
            coverage_90: Coverage { share: None, interval_95: [0.0, 1.0] },
        };
        Calibration {
            experiment: "eye <1>".into(),
            model: ModelSummary { base: "lethersich".into(), effects: Vec::new(), noise: vec!["white".into()] },
            simulated_by: Simulator::FullFiniteElements,
            replicates: 60,
            ranked: 50,
            not_converged: 10,
            failed: 0,
            redrawn: 0,
            draws: 99,
            bin_interval_99: [4, 17],
            quantities: vec![
                quantity("young_modulus_pa", vec![10, 10, 18, 3, 9]),
                quantity("log_density", vec![10; 5]),
            ],
            verdict: CalibrationVerdict { kind: CalibrationKind::Calibrated, sentence: String::new() },
        }
    }

    /// Every bin has a bar. Bars outside the expected band have another colour.
    #[test]
    fn bars_beyond_the_band_stand_out() {
        let svg = rank_histograms(&found());
        let document = svg.document();
        let bars = |colour: super::super::palette::Colour| document.matches(&format!("fill=\"{colour}\"")).count();
        assert_eq!((bars(BLUE), bars(VERMILLION)), (8 + 1, 2), "and one in the legend");
        assert!(document.contains("eye &lt;1&gt;: the posteriors are calibrated (50 simulated records)"));
        assert!(document.contains("50 % intervals contain 52 %, 90 % –"));
        assert!(svg.png().is_ok());
    }

    #[test]
    fn nothing_ranked_is_drawn_too() {
        let nothing = Calibration { ranked: 0, bin_interval_99: [0, 0], quantities: Vec::new(), ..found() };
        assert!(rank_histograms(&nothing).png().is_ok());
    }
}
