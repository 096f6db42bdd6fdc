//! Corner plot of one or several posteriors: marginal densities on the diagonal, and joint densities of pairs of parameters below it.
//!
//! A contour labelled 90 % encloses 90 % of the draws, because [`super::density::JointDensity::threshold`] uses the density at the draws. A test checks this.

use super::axes::title;
use super::corner_content::{Content, Slot};
pub use super::corner_content::{CornerOptions, FEWEST_DRAWS_FOR_CONTOURS, ParameterColumn, Posterior, PriorCurve};
use super::corner_draw::{self, CornerLayout};
use super::density::{self, Support, quantile_of_sorted};
use super::labels::axis_label;
use super::svg::Svg;
use super::ticks::AxisScale;
use base::error::InputPlace;
use base::{Error, Result};

const MOST_PARAMETERS: usize = 12;
/// Distance beyond which a draw is an outlier: a fraction of the length of the central 99.8 % interval, measured from its ends. Outliers do not lengthen the
/// axis.
const OUTLIER_DISTANCE: f64 = 0.12;
/// Maximum length of an axis that includes a reference value, divided by its length without that value. A note names a reference value that is farther away.
const REFERENCE_REACH: f64 = 2.0;

/// Draws the corner plot.
///
/// # Errors
/// [`Error::Input`] for no parameters, more than twelve, unequal numbers of draws, values that are not finite, or masses
/// outside (0, 1).
pub fn corner(posteriors: &[Posterior], options: &CornerOptions) -> Result<Svg> {
    check(posteriors, options)?;
    let ascending: Vec<Vec<Vec<f64>>> =
        posteriors.iter().map(|p| p.parameters.iter().map(|c| density::sorted(c.draws)).collect()).collect();
    let slots = slots(posteriors, &ascending);
    let n = slots.len();
    if n == 0 || n > MOST_PARAMETERS {
        let found = format!("a corner plot of {n} parameters");
        return Err(refuse(found, "choose between one and twelve parameters"));
    }
    let content = Content { slots, posteriors, ascending, options };
    let layout = CornerLayout::new(&content);
    let names: Vec<&str> = content.slots.iter().map(|slot| slot.symbol).collect();
    let mut svg = Svg::new(layout.width_px, layout.height_px, &format!("Corner plot of {}", names.join(", ")));
    title(&mut svg, options.title, (layout.origin.0, 24.0), layout.width_px - layout.origin.0 - 16.0);
    for row in 0..n {
        for column in 0..=row {
            corner_draw::panel(&mut svg, &layout, &content, row, column);
        }
    }
    corner_draw::legend(&mut svg, &layout, &content);
    Ok(svg)
}

fn refuse(found: String, remedy: &str) -> Error {
    Error::input(InputPlace::default().at_key("corner plot"), found, remedy)
}

fn check(posteriors: &[Posterior], options: &CornerOptions) -> Result<()> {
    if options.masses.iter().any(|mass| !(*mass > 0.0 && *mass < 1.0)) {
        let found = format!("contour masses {:?}", options.masses);
        return Err(refuse(found, "give probabilities between 0 and 1, such as 0.5 and 0.9"));
    }
    for posterior in posteriors {
        let n = posterior.parameters.first().map_or(0, |column| column.draws.len());
        for column in &posterior.parameters {
            let place = format!("`{}` of posterior `{}`", column.name, posterior.label);
            if column.draws.len() != n || n < 2 {
                let found = format!("{place} has {} draws, the first parameter {n}", column.draws.len());
                return Err(refuse(found, "give every parameter the same number of draws, at least two"));
            }
            if let Some(i) = column.draws.iter().position(|draw| !draw.is_finite()) {
                let found = format!("{place}: draw {} is {}", i + 1, column.draws[i]);
                return Err(refuse(found, "remove draws that are not finite"));
            }
        }
    }
    Ok(())
}

/// Collects the parameters of all posteriors in the order of their first appearance. Each parameter has one scale for all posteriors.
fn slots<'a>(posteriors: &'a [Posterior<'a>], ascending: &[Vec<Vec<f64>>]) -> Vec<Slot<'a>> {
    let mut names: Vec<&str> = Vec::new();
    let mut slots = Vec::new();
    for first in posteriors.iter().flat_map(|posterior| &posterior.parameters) {
        if names.contains(&first.name) {
            continue;
        }
        names.push(first.name);
        let columns: Vec<Option<usize>> =
            posteriors.iter().map(|p| p.parameters.iter().position(|c| c.name == first.name)).collect();
        let of_slot: Vec<(&ParameterColumn, &[f64])> = (0..posteriors.len())
            .filter_map(|i| columns[i].map(|c| (&posteriors[i].parameters[c], ascending[i][c].as_slice())))
            .collect();
        let reference = of_slot.iter().find_map(|(column, _)| column.reference).filter(|value| value.is_finite());
        let label = axis_label(first.symbol, first.unit);
        let scale = common_scale(&of_slot, reference);
        slots.push(Slot { label, symbol: first.symbol, unit: first.unit, scale, reference, columns });
    }
    slots
}

/// Scale that includes all draws except outliers, with a margin. It includes the reference value, unless the draws would then be too close together.
fn common_scale(columns: &[(&ParameterColumn, &[f64])], reference: Option<f64>) -> AxisScale {
    let (mut lower, mut upper) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut limits = Support { lower: f64::INFINITY, upper: f64::NEG_INFINITY };
    for (column, ascending) in columns {
        let quantile = |p| quantile_of_sorted(ascending, p);
        let slack = OUTLIER_DISTANCE * (quantile(0.999) - quantile(0.001));
        lower = lower.min(quantile(0.0).max(quantile(0.001) - slack));
        upper = upper.max(quantile(1.0).min(quantile(0.999) + slack));
        limits.lower = limits.lower.min(column.support.lower);
        limits.upper = limits.upper.max(column.support.upper);
    }
    let margin = 0.04 * (upper - lower);
    // A large margin beyond a hard limit would show impossible values. A narrow margin keeps a line at the limit visible.
    let beyond = 0.01 * (upper - lower);
    let (mut start, mut end) = (
        (lower - margin).max(limits.lower.min(lower) - beyond),
        (upper + margin).min(limits.upper.max(upper) + beyond),
    );
    if let Some(value) = reference {
        let reach = REFERENCE_REACH * (end - start);
        if value < start && value > end - reach {
            start = value - margin;
        } else if value > end && value < start + reach {
            end = value + margin;
        }
    }
    AxisScale::linear(start, end)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::palette::series;

    fn column<'a>(name: &'a str, draws: &'a [f64]) -> ParameterColumn<'a> {
        ParameterColumn {
            name,
            symbol: name,
            unit: "Pa",
            draws,
            support: Support::default(),
            prior: None,
            reference: None,
        }
    }

    fn wave(n: usize, frequency: f64) -> Vec<f64> {
        (0..n).map(|i| (i as f64 * frequency).sin() + 1e-3 * i as f64 / n as f64).collect()
    }

    #[test]
    fn posteriors_are_matched_by_name() {
        let (a, b, c) = (wave(300, 0.7), wave(300, 1.3), wave(300, 2.1));
        let first = Posterior { label: "m0", colour: series(0), parameters: vec![column("E", &a), column("c₁", &b)] };
        let second =
            Posterior { label: "m1", colour: series(1), parameters: vec![column("c₁", &a), column("x", &c)] };
        let posteriors = [first, second];
        let slots = slots(&posteriors, &[vec![a.clone(), b.clone()], vec![a.clone(), c.clone()]]);
        let matched: Vec<_> = slots.iter().map(|slot| (slot.symbol, slot.columns.clone())).collect();
        assert_eq!(matched, [("E", vec![Some(0), None]), ("c₁", vec![Some(1), Some(0)]), ("x", vec![None, Some(1)])]);
        let svg = corner(&posteriors, &CornerOptions::default()).unwrap();
        assert!(svg.document().contains(">m1<"));
    }

    #[test]
    fn bad_input_is_refused_with_a_remedy() {
        let (good, short, bad) = (wave(100, 0.7), wave(99, 0.7), vec![f64::NAN; 100]);
        for (columns, word) in [
            (vec![column("a", &good), column("b", &short)], "same number"),
            (vec![column("a", &good), column("b", &bad)], "draw 1 is NaN"),
            (vec![], "between one and twelve"),
        ] {
            let posterior = Posterior { label: "p", colour: series(0), parameters: columns };
            let message = corner(&[posterior], &CornerOptions::default()).unwrap_err().to_string();
            assert!(message.contains(word), "{message}");
        }
        let posterior = Posterior { label: "p", colour: series(0), parameters: vec![column("a", &good)] };
        let options = CornerOptions { masses: &[90.0], ..CornerOptions::default() };
        let message = corner(&[posterior], &options).unwrap_err().to_string();
        assert!(message.contains("90") && message.contains("probabilities between 0 and 1"), "{message}");
    }

    #[test]
    fn few_or_constant_draws_and_far_references_do_not_fail() {
        let (few, constant) = (wave(5, 0.7), vec![2.0; 5]);
        let mut far = column("a", &few);
        far.reference = Some(1e9);
        let posterior = Posterior { label: "p", colour: series(0), parameters: vec![far, column("b", &constant)] };
        let svg = corner(&[posterior], &CornerOptions::default()).unwrap();
        assert!(svg.document().contains('→'), "a reference beyond the axis is named");
        assert!(svg.png().is_ok());
    }

    #[test]
    fn the_same_draws_give_the_same_bytes() {
        let (a, b) = (wave(4_000, 0.7), wave(4_000, 1.3));
        let make = || {
            let parameters = vec![column("a", &a), column("b", &b)];
            corner(&[Posterior { label: "p", colour: series(0), parameters }], &CornerOptions::default())
                .unwrap()
                .document()
        };
        assert_eq!(make(), make());
    }
}
