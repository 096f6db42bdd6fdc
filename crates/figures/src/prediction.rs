//! Figure of a prediction: for every scenario the force above, and the median of the position with its 50 % and 90 % bands below.

use super::axes::{Axes, AxisStyle, LABEL_SIZE_PX, title_with_text, widest_y_number_px};
use super::legend::{self, Entry, Mark};
use super::palette::{INK, MUTED, VERMILLION, series};
use super::svg::{Anchor, Fill, Rect, Stroke, Svg, TextStyle};
use super::ticks::AxisScale;
use base::error::InputPlace;
use base::{Error, Result};
use documents::prediction::{PositionQuantiles, ScenarioPrediction};

const WIDTH_PX: f64 = 960.0;
const MARGIN_PX: f64 = 20.0;
const FORCE_HEIGHT_PX: f64 = 84.0;
const POSITION_HEIGHT_PX: f64 = 210.0;
const GAP_PX: f64 = 12.0;
const FOOT_PX: f64 = 56.0;
const NAME_PX: f64 = 24.0;
const OPACITY: [f64; 2] = [0.18, 0.36];
const TARGET: Stroke = Stroke { colour: VERMILLION, width_px: 1.8, opacity: 1.0, dash: Some((6.0, 4.0)) };

/// Draws predicted scenarios below each other. `target_um` is a distance to mark in every panel.
///
/// # Errors
/// [`Error::Input`] for no scenarios, or for a scenario with fewer than two times.
pub fn prediction(
    title: &str,
    sentence: &str,
    scenarios: &[ScenarioPrediction],
    target_um: Option<f64>,
) -> Result<Svg> {
    if scenarios.is_empty() || scenarios.iter().any(|scenario| scenario.time_s.len() < 2) {
        return Err(Error::input(
            InputPlace::default().at_key("prediction"),
            "there is no scenario with two times or more",
            "give at least one scenario",
        ));
    }
    let draw = |svg: &mut Svg| {
        let width = WIDTH_PX - 2.0 * MARGIN_PX;
        let below = MARGIN_PX + title_with_text(svg, title, sentence, (MARGIN_PX, MARGIN_PX), width) + 10.0;
        let below = below + legend::row(svg, &entries(scenarios, target_um), (MARGIN_PX, below), width) + 8.0;
        scenarios.iter().enumerate().fold(below, |top, (k, scenario)| panel(svg, scenario, k, target_um, top))
    };
    Ok(Svg::drawn(WIDTH_PX, title, 0.0, draw))
}

fn entries(scenarios: &[ScenarioPrediction], target_um: Option<f64>) -> Vec<Entry> {
    let colour = if scenarios.len() == 1 { series(0) } else { MUTED };
    let area = |opacity| Mark::Area(Fill::new(colour, opacity).into());
    let band = |name: &str, limits: fn(&PositionQuantiles) -> [&Vec<f64>; 2]| {
        let thickness = |scenario: &ScenarioPrediction| {
            let [lower, upper] = limits(&scenario.position_um);
            POSITION_HEIGHT_PX * position_scale(scenario, target_um).largest_distance(lower, upper)
        };
        legend::band_text(name, scenarios.iter().map(thickness).fold(0.0, f64::max))
    };
    let mut entries = vec![
        Entry::new(Mark::Line(Stroke::solid(colour, 2.2)), "median"),
        Entry::new(area(OPACITY[0] + OPACITY[1]), band("50 % band", |position| [&position.q25, &position.q75])),
        Entry::new(area(OPACITY[0]), band("90 % band", |position| [&position.q05, &position.q95])),
    ];
    if target_um.is_some() {
        entries.push(Entry::new(Mark::Line(TARGET), "target"));
    }
    entries
}

fn position_scale(scenario: &ScenarioPrediction, target_um: Option<f64>) -> AxisScale {
    let position_um = &scenario.position_um;
    AxisScale::over(position_um.q05.iter().chain(&position_um.q95).copied().chain(target_um).chain([0.0]), 0.06)
}

/// Draws one scenario with its upper edge at `top`, and returns the position of its lower edge.
fn panel(svg: &mut Svg, scenario: &ScenarioPrediction, index: usize, target_um: Option<f64>, top: f64) -> f64 {
    let ScenarioPrediction { time_s, force_un, position_um, .. } = scenario;
    let colour = series(index);
    let x = AxisScale::linear(time_s[0], time_s[time_s.len() - 1]);
    let force = AxisScale::over(force_un.iter().copied().chain([0.0]), 0.1);
    let position = position_scale(scenario, target_um);
    let widest = widest_y_number_px(&force, 3).max(widest_y_number_px(&position, 6));
    let left = widest + 48.0;
    let width = WIDTH_PX - left - MARGIN_PX;
    let name = format!("{}: {}", scenario.name, scenario.apparatus);
    let shown = super::font::shorten(&name, LABEL_SIZE_PX, WIDTH_PX - 2.0 * MARGIN_PX);
    svg.text(&shown, (MARGIN_PX, top + 14.0), TextStyle::new(LABEL_SIZE_PX, Anchor::Start).colour(INK));
    let upper = Rect { x: left, y: top + NAME_PX, width, height: FORCE_HEIGHT_PX };
    let lower = Rect { x: left, y: upper.bottom() + GAP_PX, width, height: POSITION_HEIGHT_PX };
    let above = Axes { frame: upper, x, y: force };
    above.y_axis(svg, AxisStyle::new(Some("force (µN)"), 3, left - 12.0).grid());
    svg.clipped(upper, |svg| {
        let (times, forces) = stairs(time_s, force_un);
        above.line(svg, &times, &forces, Stroke::solid(INK, 1.6));
    });
    above.outline(svg);
    let axes = Axes { frame: lower, x, y: position };
    axes.x_axis(svg, AxisStyle::new(Some("time (s)"), 9, 36.0).grid());
    axes.y_axis(svg, AxisStyle::new(Some("position (µm)"), 6, left - 12.0).grid());
    svg.clipped(lower, |svg| {
        axes.band(svg, time_s, &position_um.q05, &position_um.q95, Fill::new(colour, OPACITY[0]));
        axes.band(svg, time_s, &position_um.q25, &position_um.q75, Fill::new(colour, OPACITY[1]));
        axes.line(svg, time_s, &position_um.median, Stroke::solid(colour, 2.2));
        if let Some(target_um) = target_um {
            axes.horizontal(svg, target_um, TARGET);
        }
    });
    axes.outline(svg);
    lower.bottom() + FOOT_PX
}

/// Corners of a force that holds each value until the next time. A force that changes at most times is drawn with straight lines.
fn stairs(time_s: &[f64], force_un: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let n_changes = force_un.windows(2).filter(|pair| pair[0] != pair[1]).count();
    if 2 * n_changes > force_un.len() {
        return (time_s.to_vec(), force_un.to_vec());
    }
    let (mut times, mut forces) = (vec![time_s[0]], vec![force_un[0]]);
    for row in 1..time_s.len() {
        if force_un[row] != force_un[row - 1] {
            times.extend([time_s[row]; 2]);
            forces.extend([force_un[row - 1], force_un[row]]);
        }
    }
    times.push(time_s[time_s.len() - 1]);
    forces.push(force_un[force_un.len() - 1]);
    (times, forces)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scenario() -> ScenarioPrediction {
        let time_s: Vec<f64> = (0..50).map(f64::from).collect();
        let curve = |factor: f64| time_s.iter().map(|t| factor * t).collect::<Vec<f64>>();
        ScenarioPrediction {
            name: "cylinder".into(),
            apparatus: "cylinder of 2 mm × 0.2 mm".into(),
            force_un: time_s.iter().map(|t| if *t < 20.0 { 20.0 } else { 0.0 }).collect(),
            position_um: PositionQuantiles {
                q05: curve(8.0),
                q25: curve(9.0),
                median: curve(10.0),
                q75: curve(11.0),
                q95: curve(12.0),
            },
            time_s,
            quantities: Vec::new(),
            full_model_error_um: 0.0,
            full_runs: 8,
            mesh_error_um: None,
            force_error_um: 0.0,
            warnings: Vec::new(),
        }
    }

    #[test]
    fn every_scenario_has_a_panel_and_the_target_a_line() {
        let one = prediction("title", "sentence", &[scenario()], Some(300.0)).expect("a figure").document();
        let two = prediction("title", "sentence", &[scenario(), scenario()], None).expect("a figure").document();
        let count = |text: &str, words: &str| text.matches(words).count();
        assert_eq!((count(&one, "time (s)"), count(&two, "time (s)")), (1, 2));
        assert_eq!((count(&one, ">target<"), count(&two, ">target<")), (1, 0));
        assert!(prediction("title", "", &[], None).is_err());
    }

    /// Bands of a precise posterior are thinner than the line of the median. The legend says which of them cannot be seen.
    #[test]
    fn the_legend_says_which_bands_are_hidden() {
        let mut precise = scenario();
        let PositionQuantiles { q25, median, q75, .. } = &mut precise.position_um;
        for (middle, [lower, upper]) in median.iter().zip(q25.iter_mut().zip(q75).map(|(lower, upper)| [lower, upper]))
        {
            (*lower, *upper) = (0.9999 * middle, 1.0001 * middle);
        }
        let figure = |scenario| prediction("title", "", &[scenario], None).expect("a figure").document();
        let (wide, thin) = (figure(scenario()), figure(precise));
        assert!(wide.contains(">50 % band<") && wide.contains(">90 % band<"));
        assert!(thin.contains(">50 % band (thinner than the line)<") && thin.contains(">90 % band<"));
    }

    #[test]
    fn a_force_in_steps_keeps_its_corners() {
        let (times, forces) = stairs(&[0.0, 1.0, 2.0, 3.0, 4.0], &[5.0, 5.0, 0.0, 0.0, 0.0]);
        assert_eq!((times, forces), (vec![0.0, 2.0, 2.0, 4.0], vec![5.0, 5.0, 0.0, 0.0]));
    }
}
