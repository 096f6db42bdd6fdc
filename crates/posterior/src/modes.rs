//! Several modes of a posterior. A median and an interval over all of them describe none.

use super::prior::{Prior, PriorSet};
use documents::posterior::{Warning, WarningKind};
use figures::number::format_significant;
use sampling::diagnostics::DrawColumn;
use sampling::evidence::{WeightedDraws, find_density_valley};

/// Number of draws in which modes are sought. Draws of a chain are not independent, and so many of all are nearly.
const MOST_DRAWS: usize = 1000;
/// Golden ratio minus 1: its multiples, without their integer parts, are spread evenly.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Warning that the density of a parameter has a valley, which separates two modes; `None` if there is no valley. `columns` holds the draws of each sampled parameter, in its
/// unit. Only the parameters that `is_wanted` accepts by name count.
pub fn several_modes(priors: &PriorSet, columns: &[DrawColumn], is_wanted: impl Fn(&str) -> bool) -> Option<Warning> {
    let n_draws = columns.first().map_or(0, |column| column.values.len());
    // A constant stride would favour some walkers.
    let place = |k: usize| ((k as f64 * GOLDEN).fract() * n_draws as f64) as usize;
    let chosen: Vec<usize> = (0..n_draws.min(MOST_DRAWS)).map(place).collect();
    let priors = priors.priors();
    let point = |draw: &usize| -> Vec<f64> {
        priors
            .iter()
            .zip(columns)
            .map(|(prior, column)| prior.distribution.to_unconstrained(column.values[*draw]))
            .collect()
    };
    let points: Vec<Vec<f64>> = chosen.iter().map(point).collect();
    let equal = vec![0.0; points.len()];
    let draws = WeightedDraws::new(points, &equal);
    let separates = |d: &usize| Some((*d, find_density_valley(&draws, |point| point[*d])?));
    let (split, bottom) = (0..priors.len()).filter(|d| is_wanted(&priors[*d].name)).find_map(|d| separates(&d))?;
    let sides =
        [draws.restricted_to(|point| point[split] < bottom), draws.restricted_to(|point| point[split] >= bottom)];
    let lower = draws.mean(|point| f64::from(u8::from(point[split] < bottom)));
    let listed = |side: &WeightedDraws, share: f64| {
        let of_parameter = |(d, prior): (usize, &Prior)| {
            let median = prior.distribution.from_unconstrained(side.quantiles(|point| point[d], &[0.5])[0]);
            format!("{} = {}", prior.name, format_significant(median, 3))
        };
        let medians: Vec<String> =
            priors.iter().enumerate().filter(|(_, prior)| is_wanted(&prior.name)).map(of_parameter).collect();
        format!("{} (probability {share:.2})", medians.join(", "))
    };
    Some(Warning {
        kind: WarningKind::Undetermined,
        text: format!("the posterior has two modes: {}, or {}", listed(&sides[0], lower), listed(&sides[1], 1.0 - lower)),
        advice: "fix a parameter that you know (--set), or narrow its prior; `vitreo-uq design` proposes a record that tells them apart".into(),
    })
}
