//! Several modes of a posterior. A median and an interval over all of them describe none.

use super::prior::{Prior, PriorSet};
use documents::posterior::{Warning, WarningKind};
use figures::number::format_significant;
use sampling::diagnostics::DrawColumn;
use sampling::evidence::{WeightedDraws, find_density_valley};

/// Largest number of draws in which modes are sought.
const MOST_DRAWS: usize = 2_000;
/// Golden ratio minus 1: its multiples, without their integer parts, are spread evenly.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Indices of the draws in which modes are sought, spread evenly over all. A constant stride would favour some walkers.
pub fn draws_for_modes(n_draws: usize) -> impl Iterator<Item = usize> {
    (0..n_draws.min(MOST_DRAWS)).map(move |k| ((k as f64 * GOLDEN).fract() * n_draws as f64) as usize)
}

/// Warning that the density of a parameter has a valley, which separates two modes; `None` if there is no valley. `columns` holds the draws of each sampled parameter, in its
/// unit. Only the parameters that `is_wanted` accepts by name count.
pub fn several_modes(priors: &PriorSet, columns: &[DrawColumn], is_wanted: impl Fn(&str) -> bool) -> Option<Warning> {
    let n_draws = columns.first().map_or(0, |column| column.values.len());
    let priors = priors.priors();
    let point = |draw: usize| -> Vec<f64> {
        let pairs = priors.iter().zip(columns);
        pairs.map(|(prior, column)| prior.distribution.to_unconstrained(column.values[draw])).collect()
    };
    let points: Vec<Vec<f64>> = draws_for_modes(n_draws).map(point).collect();
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

#[cfg(test)]
mod tests {
    use super::*;
    use sampling::ensemble::RandomStream;

    /// Draws of one parameter by four ensembles of 32 walkers over 250 steps. A walker stays in its mode: the first `n_lower` of 32 are about 1, the others about 10.
    fn warning(n_lower: usize) -> Option<Warning> {
        let all = PriorSet::named("porcine").expect("a prior");
        let others: Vec<&str> = all.names().filter(|name| *name != "young_modulus_pa").collect();
        let mut stream = RandomStream::new(3, 0);
        let values = (0..4 * 250 * 32).map(|draw| {
            let middle = if draw % 32 < n_lower { 1.0 } else { 10.0 };
            middle * (0.9 + 0.2 * stream.unit())
        });
        let column = DrawColumn { n_ensembles: 4, n_steps: 250, n_walkers: 32, values: values.collect() };
        several_modes(&all.without(&others), &[column], |_| true)
    }

    /// The share of a mode among 2,000 draws that are spread evenly is that of its walkers, within 0.02.
    #[test]
    fn modes_are_found_with_their_shares_whichever_walkers_hold_them() {
        for (n_lower, shares) in [(8, ["0.25", "0.75"]), (24, ["0.75", "0.25"])] {
            let text = warning(n_lower).expect("two modes").text;
            let share = |k: usize| -> f64 {
                let part = text.split("probability ").nth(k + 1).expect("a probability");
                part[..4].parse().expect("a number")
            };
            for (k, expected) in shares.iter().enumerate() {
                assert!((share(k) - expected.parse::<f64>().expect("a number")).abs() < 0.02, "{text}");
            }
            assert!(text.contains("young_modulus_pa = 1.0") || text.contains("young_modulus_pa = 0.99"), "{text}");
        }
        assert!(warning(0).is_none() && warning(32).is_none());
    }
}
