//! Tests against closed forms and independent quadrature, both near the mean and so far in the tail that only the logarithm can represent the probability.

use super::*;

fn equal(n: usize, correlation: f64) -> DMatrix<f64> {
    DMatrix::from_fn(n, n, |i, j| if i == j { 1.0 } else { correlation })
}

/// ln ∫ exp(f) by the trapezoidal rule with n intervals. The interval [from, to] contains the whole integrand, or the integrand is smooth at its ends.
fn ln_integral(f: impl Fn(f64) -> f64, [from, to]: [f64; 2], n: usize) -> f64 {
    let width = (to - from) / n as f64;
    let values: Vec<f64> = (0..=n).map(|i| f(from + width * i as f64)).collect();
    let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let ends = 0.5 * ((values[0] - largest).exp() + (values[n] - largest).exp());
    let inner: f64 = values[1..n].iter().map(|value| (value - largest).exp()).sum();
    largest + (width * (ends + inner)).ln()
}

/// ln Q(x) to full accuracy: by erfc for small x, else by the continued fraction.
fn ln_upper(x: f64) -> f64 {
    if x < 20.0 {
        return (0.5 * erfc(x * FRAC_1_SQRT_2)).ln();
    }
    let fraction = (1..200).rev().fold(x, |below, k| x + f64::from(k) / below);
    -0.5 * (x * x + TAU.ln()) - fraction.ln()
}

#[test]
fn an_interval_is_right_wherever_it_lies() {
    for x in [-3.0, 0.0, 0.5, 4.0, 15.0, 24.9, 25.1, 40.0, 300.0, 1e4] {
        let (found, expected) = (ln_within(x, f64::INFINITY), ln_upper(x));
        assert!((found - expected).abs() < 1e-10 * expected.abs().max(1.0), "{x}: {found} {expected}");
        assert_eq!(ln_within(f64::NEG_INFINITY, -x), found);
    }
    // Φ(−15) to fifteen digits, computed with forty; the underlying error function is accurate to ten.
    assert!((ln_within(f64::NEG_INFINITY, -15.0) - 3.670_966_199_312_75e-51_f64.ln()).abs() < 1e-10);
    for (lower, upper) in [(-1.0, 2.0), (0.3, 0.300_01), (10.0, 10.5), (-31.0, -30.0), (200.0, 200.000_01)] {
        let expected = ln_integral(|t| -0.5 * (t * t + TAU.ln()), [lower, upper], 400_000);
        let found = ln_within(lower, upper);
        assert!((found - expected).abs() < 1e-8, "{lower} {upper}: {found} {expected}");
    }
    assert_eq!(ln_within(f64::NEG_INFINITY, f64::INFINITY), 0.0);
}

#[test]
fn a_quantile_is_where_the_share_lies_below() {
    for (lower, upper) in [(-1.0, 2.0), (-9.0, 3.0), (0.5, f64::INFINITY), (4.0, 6.0), (12.0, 13.0), (-500.0, -400.0)] {
        for share in [1e-4, 0.02, 0.5, 0.9, 0.999_9] {
            let x = quantile_within(lower, upper, share);
            let found = (ln_within(lower, x) - ln_within(lower, upper)).exp();
            assert!((found / share - 1.0).abs() < 1e-5, "{lower} {upper} {share}: {found}");
        }
    }
}

/// The probability that all of n coordinates are positive has closed forms. It is ¼ + asin ρ/2π for two and ⅛ + Σ asin ρ/4π for three. It is 1/(n + 1) if all
/// correlations are ½.
#[test]
fn orthants_have_their_closed_forms() {
    let orthant = |covariance: &DMatrix<f64>| {
        let n = covariance.nrows();
        ln_box_probability(covariance, &vec![0.0; n], &vec![f64::INFINITY; n]).exp()
    };
    for rho in [-0.999, -0.7, 0.0, 0.4, 0.95, 0.9999] {
        let expected = 0.25 + f64::asin(rho) / TAU;
        let found = orthant(&equal(2, rho));
        assert!((found / expected - 1.0).abs() < 2e-4, "{rho}: {found} {expected}");
    }
    let three = DMatrix::from_row_slice(3, 3, &[1.0, -0.6, 0.2, -0.6, 1.0, 0.5, 0.2, 0.5, 1.0]);
    let expected = 0.125 + [-0.6_f64, 0.2, 0.5].iter().map(|rho| rho.asin()).sum::<f64>() / (2.0 * TAU);
    assert!((orthant(&three) / expected - 1.0).abs() < 1e-4, "{} {expected}", orthant(&three));
    // The result does not depend on the coordinates' scales.
    let scale = [1e-6, 3.0, 1e5];
    let scaled = DMatrix::from_fn(3, 3, |i, j| three[(i, j)] * scale[i] * scale[j]);
    assert!((orthant(&scaled) / orthant(&three) - 1.0).abs() < 1e-9);
    for n in 2..=6 {
        let found = orthant(&equal(n, 0.5));
        let expected = 1.0 / (n + 1) as f64;
        assert!((found / expected - 1.0).abs() < 2e-3, "{n}: {found} {expected}");
    }
}

/// Coordinates with equal positive correlations are the sum of one shared variable t and independent variables. The probability is therefore a single integral: ∫φ(t)
/// P(…| t)ⁿ dt.
#[test]
fn boxes_far_away_have_the_probability_of_a_single_integral() {
    for n in [1, 3, 5] {
        for rho in [0.1, 0.98] {
            for (lower, upper) in
                [(-1.0, 0.5), (5.0, f64::INFINITY), (15.0, 15.5), (15.0, f64::INFINITY), (-300.0, -200.0)]
            {
                let given = |t: f64| {
                    let function = |end: f64| (end - f64::sqrt(rho) * t) / f64::sqrt(1.0 - rho);
                    -0.5 * (t * t + TAU.ln()) + n as f64 * ln_within(function(lower), function(upper))
                };
                let expected = ln_integral(given, [-320.0, 320.0], 640_000);
                let found = ln_box_probability(&equal(n, rho), &vec![lower; n], &vec![upper; n]);
                let tolerance = if n <= 3 { 5e-4 } else { 5e-3 };
                assert!((found - expected).abs() < tolerance, "{n} {rho} {lower} {upper}: {found} {expected}");
            }
        }
    }
}

/// Two coordinates with any correlation and box agree with a sum over one of them.
#[test]
fn two_coordinates_agree_with_a_sum_over_one() {
    for rho in [-0.999, -0.8, 0.3, 0.99] {
        for (lower, upper) in [
            ([-1.0, -2.0], [3.0, 0.1]),
            ([0.0, 0.0], [9.0, 9.0]),
            ([8.0, -1.0], [9.0, 1.0]),
            ([12.0, 9.0], [12.5, 40.0]),
        ] {
            let given = |x: f64| {
                let function = |end: f64| (end - rho * x) / f64::sqrt(1.0 - rho * rho);
                -0.5 * (x * x + TAU.ln()) + ln_within(function(lower[1]), function(upper[1]))
            };
            let expected = ln_integral(given, [lower[0], upper[0]], 400_000);
            let found = ln_box_probability(&equal(2, rho), &lower, &upper);
            assert!((found - expected).abs() < 1e-3, "{rho} {lower:?} {upper:?}: {found} {expected}");
        }
    }
}

/// Distant ends have no influence unless other coordinates push towards them; an independent coordinate contributes a factor.
#[test]
fn ends_count_where_they_are_reached() {
    let covariance = DMatrix::from_row_slice(3, 3, &[1.0, 0.95, 0.0, 0.95, 1.0, 0.0, 0.0, 0.0, 4.0]);
    let alone = ln_within(10.0, 90.0);
    let free = ln_box_probability(&covariance, &[10.0, -90.0, -90.0], &[90.0, 90.0, 90.0]);
    assert!((free - alone).abs() < 1e-9, "{free} {alone}");
    // An end nine standard deviations away is far, until the first coordinate shifts the second to 9.5.
    let held = ln_box_probability(&covariance, &[10.0, -90.0, -90.0], &[90.0, 9.0, 90.0]);
    assert!(held < alone - 1.0, "{held} {alone}");
    let value = ln_box_probability(&covariance, &[10.0, -90.0, 0.0], &[90.0, 90.0, f64::INFINITY]);
    assert!((value - alone + std::f64::consts::LN_2).abs() < 1e-9, "{value}");
    assert_eq!(ln_box_probability(&DMatrix::zeros(0, 0), &[], &[]), 0.0);
}
