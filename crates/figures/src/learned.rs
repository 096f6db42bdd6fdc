//! Figure of a learnt function: its band over the range of states that occur in the record, and its formula.

use super::axes::{Axes, AxisStyle, title_with_text};
use super::labels::parameter_label;
use super::legend::{self, Entry, Mark};
use super::number::format_significant;
use super::palette::{BLUE, GRID, MUTED, VERMILLION};
use super::svg::{Fill, Rect, Stroke, Svg};
use super::ticks::AxisScale;
use base::error::InputPlace;
use base::{Error, Result};
use documents::learned::{Learned, LearnedFunction, LearnedPoint};

const WIDTH_PX: f64 = 760.0;
const PLOT_PX: f64 = 360.0;
const LEFT_PX: f64 = 86.0;
const MARGIN_PX: f64 = 20.0;
const AXIS_PX: f64 = 44.0;
const BAND: Fill = Fill { colour: BLUE, opacity: 0.22 };
const CURVE: Stroke = Stroke { colour: BLUE, width_px: 2.0, opacity: 1.0, dash: None };
const FORMULA: Stroke = Stroke { colour: VERMILLION, width_px: 1.8, opacity: 1.0, dash: Some((7.0, 4.0)) };
/// Fill of the range of states in which there is no fitted row.
const UNVISITED: Fill = Fill { colour: GRID, opacity: 1.0 };

/// Draws the figure of a learnt function.
///
/// # Errors
/// [`Error::Input`] if the document has no function.
pub fn learned(document: &Learned) -> Result<Svg> {
    let Some(function) = document.function.as_ref().filter(|function| function.points.len() > 1) else {
        let place = InputPlace::default().at_key("function");
        return Err(Error::input(place, "no function was learnt", "give a document with a function"));
    };
    let heading = format!("{}: correction of the law learnt from data", document.experiment);
    let width = WIDTH_PX - LEFT_PX - MARGIN_PX;
    let draw = |svg: &mut Svg| {
        let top = MARGIN_PX
            + title_with_text(
                svg,
                &heading,
                &document.verdict.sentence,
                (MARGIN_PX, MARGIN_PX),
                WIDTH_PX - 2.0 * MARGIN_PX,
            )
            + 10.0;
        let top = top + legend::row(svg, &entries(document), (LEFT_PX, top), width) + 8.0;
        plot(svg, document, function, Rect { x: LEFT_PX, y: top, width, height: PLOT_PX });
        top + PLOT_PX + AXIS_PX
    };
    Ok(Svg::drawn(WIDTH_PX, &heading, 6.0, draw))
}

fn entries(document: &Learned) -> Vec<Entry> {
    let mut entries = vec![
        Entry::new(Mark::LineOnArea(CURVE, BAND), "learnt, 90 % band"),
        Entry::new(Mark::Area(UNVISITED.into()), "no data"),
    ];
    if let Some(formula) = &document.formula {
        entries.push(Entry::new(Mark::Line(FORMULA), formula.text.clone()));
    }
    entries
}

/// Unit in which a state variable is shown, and the factor that converts to it.
fn shown(unit: &str, largest: f64) -> (&str, f64) {
    match unit {
        "m" if largest < 0.1 => ("µm", 1e6),
        "m/s" => ("µm/s", 1e6),
        "N" if largest < 1e-7 => ("pN", 1e12),
        "N" => ("µN", 1e6),
        other => (other, 1.0),
    }
}

fn plot(svg: &mut Svg, document: &Learned, function: &LearnedFunction, frame: Rect) {
    let points = &function.points;
    let column = |of: fn(&LearnedPoint) -> f64| -> Vec<f64> { points.iter().map(of).collect() };
    let states = column(|point| point.state);
    let largest = states.iter().fold(0.0_f64, |largest, state| largest.max(state.abs()));
    let (unit, factor) = shown(&function.state_unit, largest);
    let states: Vec<f64> = states.iter().map(|state| factor * state).collect();
    let visited = function.visited.map(|end| factor * end);
    // Where there are no data the band can be arbitrarily wide. Only states with fitted rows therefore determine the scale.
    let is_visited = |state: f64| (visited[0]..=visited[1]).contains(&state);
    let seen = states.iter().zip(points).filter(|(state, _)| is_visited(**state));
    let formula = document.formula.as_ref().map(|formula| formula.factors.clone()).unwrap_or_default();
    let values = seen.flat_map(|(_, point)| [point.q05, point.q95]).chain([1.0]);
    let axes = Axes { frame, x: AxisScale::over(states.iter().copied(), 0.0), y: AxisScale::over(values, 0.06) };
    for [from, to] in [[states[0], visited[0]], [visited[1], states[states.len() - 1]]] {
        if to > from {
            let [left, right] = [from, to].map(|end| axes.x_px(end));
            svg.rect(Rect { x: left, y: frame.y, width: right - left, height: frame.height }, UNVISITED);
        }
    }
    let quantity = format!(
        "{}, relative to its value at {} {unit}",
        parameter_label(&document.verdict.quantity).symbol,
        format_significant(factor * function.reference_state, 3)
    );
    axes.y_axis(svg, AxisStyle::new(Some(&quantity), 7, 66.0).grid());
    axes.x_axis(svg, AxisStyle::new(Some(&format!("{} ({unit})", document.verdict.state.replace('_', " "))), 8, 38.0));
    svg.clipped(frame, |svg| {
        axes.horizontal(svg, 1.0, Stroke::solid(MUTED, 1.0).dashed(3.0, 3.0));
        axes.band(svg, &states, &column(|point| point.q05), &column(|point| point.q95), BAND);
        axes.line(svg, &states, &column(|point| point.factor), CURVE);
        if formula.len() == states.len() {
            axes.line(svg, &states, &formula, FORMULA);
        }
    });
    axes.outline(svg);
}

#[cfg(test)]
mod tests {
    use super::*;
    use documents::errors::ModelErrors;
    use documents::learned::{LearnedFormula, LearnedKind, LearnedVerdict};

    fn document() -> Learned {
        let points = (0..21).map(|k| {
            let state = 1e-4 * f64::from(k);
            LearnedPoint { state, factor: 1.0 + 500.0 * state, q05: 1.0 + 450.0 * state, q95: 1.0 + 550.0 * state }
        });
        let points: Vec<LearnedPoint> = points.collect();
        let factors = points.iter().map(|point| point.factor).collect();
        let errors = ModelErrors { rmse_fitted_um: 4.0, rmse_heldout_um: Some(4.1) };
        Learned {
            experiment: "a gel".into(),
            verdict: LearnedVerdict {
                kind: LearnedKind::Learned,
                quantity: "young_modulus_pa".into(),
                state: "path".into(),
                equivalent: vec![],
                library: vec![],
                sentence: "young_modulus_pa depends on the path.".into(),
            },
            fitted_cycles: vec![1, 2],
            heldout_cycles: vec![3],
            monotone: false,
            function: Some(LearnedFunction {
                state_unit: "m".into(),
                visited: [0.0, 1.5e-3],
                reference_state: 0.0,
                at_reference: None,
                points,
            }),
            formula: Some(LearnedFormula {
                text: "1 + rate*path".into(),
                parameters: vec![],
                file: "f.toml".into(),
                factors,
            }),
            memory: vec![],
            base: errors,
            learned: Some(errors),
            with_formula: Some(errors),
            noise_um: Some(4.0),
            p_familywise: 0.01,
            explained_fraction: Some(0.9),
            pairs: vec![],
        }
    }

    /// Lengths are shown in micrometres, and states without fitted rows are shaded. A document without a function gives no figure.
    #[test]
    fn the_figure_says_what_was_visited() {
        let text = learned(&document()).unwrap().document();
        assert!(text.contains("path (µm)") && text.contains("no data") && text.contains("1 + rate*path"));
        let nothing = Learned { function: None, ..document() };
        assert!(learned(&nothing).is_err_and(|error| error.to_string().contains("no function was learnt")));
    }
}
