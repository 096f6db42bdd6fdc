//! The Bayes factor of two nested models from the larger one's posterior: B = p(null) / p(null | data), the prior over the posterior density of
//! the parameter at its null (Dickey 1971, doi:10.1214/aoms/1177693507).
//!
//! It is valid if the other parameters' priors do not depend on that parameter. Local likelihood gives the posterior density from draws (Loader 1996,
//! doi:10.1214/aos/1032298287). Near the null its logarithm is a parabola on the support, so a null at an end of the support is
//! estimated as well as one inside.

use nalgebra::{Matrix3, Vector3};
use vitreo_uq::base::distribution::Distribution;
use vitreo_uq::sampling::evidence::WeightedDraws;

/// Bayes factor by the density ratio, or the reason for its absence.
#[derive(Debug, Clone, PartialEq)]
pub enum SavageDickey {
    /// Density ratio.
    Ratio {
        /// ln of the Bayes factor, the larger model over the smaller one.
        ln_bayes_factor: f64,
        /// Standard error of the logarithm.
        standard_error: f64,
    },
    /// No ratio, for this reason.
    NotApplicable(String),
}

/// Half width of the window around the null, in posterior standard deviations.
const WINDOW_SDS: f64 = 2.0;
/// Number of effective draws that the window needs.
const FEWEST_DRAWS: f64 = 100.0;
/// Number of parts of the draws. Each is left out in turn for the error (jackknife), because a single part may be too small for a fit.
const N_BATCHES: usize = 10;
/// Number of panels of Simpson's rule over the window.
const N_PANELS: usize = 200;

/// Density ratio of one parameter, a function of the draws, with its null and prior. Draws must be independent or in random order.
pub fn savage_dickey(
    draws: &WeightedDraws,
    of: impl Fn(&[f64]) -> f64,
    null: f64,
    prior: &Distribution,
) -> SavageDickey {
    let ln_prior = prior.ln_pdf(null);
    if !ln_prior.is_finite() {
        return SavageDickey::NotApplicable(format!("the prior's density at the null {null} is nothing or has no end"));
    }
    let values: Vec<(f64, f64)> =
        draws.points.iter().map(|point| of(point)).zip(draws.weights.iter().copied()).collect();
    let mean: f64 = values.iter().map(|(x, w)| w * x).sum();
    let sd = values.iter().map(|(x, w)| w * (x - mean).powi(2)).sum::<f64>().sqrt();
    let half_width = WINDOW_SDS * sd;
    let inside = || values.iter().filter(|(x, _)| (x - null).abs() < half_width).map(|(_, w)| *w);
    let n_inside = inside().sum::<f64>().powi(2) / inside().map(|w| w * w).sum::<f64>();
    if n_inside.is_nan() || n_inside < FEWEST_DRAWS {
        return SavageDickey::NotApplicable(format!(
            "the posterior, {mean:.3e} ± {sd:.1e}, has too few draws near the null {null:.3e}: the effect is too plain for a density ratio"
        ));
    }
    let (lower, upper) = prior.support();
    let ends = [((lower - null) / half_width).max(-1.0), ((upper - null) / half_width).min(1.0)];
    let density = |values: &mut dyn Iterator<Item = &(f64, f64)>| {
        let scaled = values.map(|(x, w)| ((x - null) / half_width, *w));
        ln_density_at_zero(scaled, ends).map(|ln_density| ln_density - half_width.ln())
    };
    let whole = density(&mut values.iter());
    let of_batches: Option<Vec<f64>> =
        (0..N_BATCHES).map(|left_out| density(&mut without_part(&values, left_out))).collect();
    let (Some(whole), Some(of_batches)) = (whole, of_batches) else {
        return SavageDickey::NotApplicable("the posterior density at the null cannot be fitted to the draws".into());
    };
    let n = N_BATCHES as f64;
    let middle = of_batches.iter().sum::<f64>() / n;
    let variance = of_batches.iter().map(|x| (x - middle).powi(2)).sum::<f64>() * (n - 1.0) / n;
    SavageDickey::Ratio { ln_bayes_factor: ln_prior - whole, standard_error: variance.sqrt() }
}

/// All values except one in ten, starting at `left_out`.
fn without_part(values: &[(f64, f64)], left_out: usize) -> impl Iterator<Item = &(f64, f64)> {
    values.iter().enumerate().filter(move |(place, _)| place % N_BATCHES != left_out).map(|(_, value)| value)
}

/// Kernel (1 − t²)².
fn kernel(t: f64) -> f64 {
    (1.0 - t * t).max(0.0).powi(2)
}

/// ln density at t = 0 of weighted values t in the window between the ends. It is the a of a + bt + ct² that maximises
/// Σ w K(t)(a + bt + ct²) − Σw ∫ K(t) exp(a + bt + ct²) dt, whose gradient equates moments.
fn ln_density_at_zero(values: impl Iterator<Item = (f64, f64)>, ends: [f64; 2]) -> Option<f64> {
    let (mut moments, mut total) = (Vector3::zeros(), 0.0);
    for (t, weight) in values {
        total += weight;
        moments += Vector3::new(1.0, t, t * t) * (weight * kernel(t));
    }
    moments /= total;
    let step = (ends[1] - ends[0]) / N_PANELS as f64;
    let nodes: Vec<(f64, f64)> = (0..=N_PANELS)
        .map(|k| {
            let t = ends[0] + step * k as f64;
            let simpson = if k == 0 || k == N_PANELS { 1.0 } else { 2.0 + 2.0 * (k % 2) as f64 };
            (t, kernel(t) * simpson * step / 3.0)
        })
        .collect();
    let area: f64 = nodes.iter().map(|(_, weight)| weight).sum();
    let mut shape = Vector3::new((moments[0] / area).ln(), 0.0, 0.0);
    let objective = |shape: &Vector3<f64>| {
        let integral: f64 = nodes.iter().map(|(t, w)| w * (shape[0] + t * (shape[1] + t * shape[2])).exp()).sum();
        shape.dot(&moments) - integral
    };
    for _ in 0..100 {
        let (mut expected, mut curvature) = (Vector3::zeros(), Matrix3::zeros());
        for (t, weight) in &nodes {
            let powers = Vector3::new(1.0, *t, t * t);
            let share = weight * shape.dot(&powers).exp();
            expected += powers * share;
            curvature += powers * powers.transpose() * share;
        }
        let change = curvature.cholesky()?.solve(&(moments - expected));
        // Newton's method on a concave function. The step is halved until the objective increases.
        let mut length = 1.0;
        while objective(&(shape + change * length)) < objective(&shape) && length > 1e-6 {
            length *= 0.5;
        }
        shape += change * length;
        if change.amax() < 1e-9 {
            return Some(shape[0]).filter(|a| a.is_finite());
        }
    }
    None
}
