//! Mittag-Leffler function E_α(−x) of order α for x ≥ 0, which describes the creep of a spring and a springpot in parallel.

use std::f64::consts::PI;

use nalgebra::Complex;
use statrs::function::gamma::gamma;

/// Smallest x^{1/α} for which E_α(−x) is computed by its asymptotic series. The smallest term of the series is about
/// e^{−x^{1/α}}.
const ASYMPTOTIC_FROM: f64 = 40.0;
/// Number of nodes on the upper half of the contour of the inverse Laplace transform. The error of about 2.85^{−36} is below
/// rounding.
const N_NODES: usize = 18;

/// Returns E_α(−x) = Σₖ (−x)ᵏ/Γ(αk + 1) for an order α in (0, 1] and x ≥ 0; NaN for other arguments.
///
/// The absolute error is below 1e-12. Up to x^{1/α} = 40 the inverse Laplace transform of s^{α−1}/(s^α + x) at time 1 is summed
/// on a parabola around the negative axis (Weideman and Trefethen 2007, doi:10.1090/S0025-5718-07-01945-X). The transform has no
/// other singularities for these orders. For larger x the asymptotic series Σₖ (−1)^{k−1} x^{−k}/Γ(1 − αk) is accurate to
/// rounding, also relative to the value.
pub fn mittag_leffler(order: f64, x: f64) -> f64 {
    if !(order > 0.0 && order <= 1.0 && x >= 0.0) {
        return f64::NAN;
    }
    if order == 1.0 {
        return (-x).exp();
    }
    if x == f64::INFINITY {
        return 0.0;
    }
    if x.powf(order.recip()) < ASYMPTOTIC_FROM { on_parabola(order, x) } else { asymptotic(order, x) }
}

/// Returns E_α(−x) as the contour integral (1/2πi) ∫ eˢ s^{α−1}/(s^α + x) ds along the parabola s = μ(1 + iu)². The integral is
/// computed by the midpoint rule in u. The lower half of the contour contributes the conjugate of the upper half.
fn on_parabola(order: f64, x: f64) -> f64 {
    let n = N_NODES as f64;
    let (step, scale) = (3.0 / n, PI * n / 12.0);
    let mut sum = 0.0;
    for node in 0..N_NODES {
        let direction = Complex::new(1.0, step * (node as f64 + 0.5));
        let s = direction * direction * scale;
        let power = s.powf(order);
        // ds = 2iμ(1 + iu) du, and s = μ(1 + iu)², so that ds/s = 2i du/(1 + iu).
        let integrand = s.exp() * power / (power + x) * Complex::new(0.0, 2.0) / direction;
        sum += integrand.im;
    }
    sum * step / PI
}

/// Returns E_α(−x) as the sum of its asymptotic series. The sum uses the identities 1/Γ(1 − αk) = Γ(αk) sin(αkπ)/π and sin(αkπ) =
/// (−1)^{k−1} sin(k(1 − α)π). The second identity avoids cancellation near α = 1.
fn asymptotic(order: f64, x: f64) -> f64 {
    let mut sum = 0.0;
    let mut power = 1.0;
    for k in 1..2000_u32 {
        let k = f64::from(k);
        power /= x;
        let size = power * gamma(order * k);
        sum += size * (k * (1.0 - order) * PI).sin() / PI;
        // Terms decrease until αk reaches x^{1/α} ≥ 40. They are below rounding long before that.
        if size < 1e-17 * sum.abs() || order * k > ASYMPTOTIC_FROM {
            break;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Dimensionless times z of the values in [`COMPUTED`].
    const TIMES: [f64; 9] = [1e-6, 1e-3, 0.1, 1.0, 10.0, 38.0, 45.0, 1e3, 1e6];
    /// Orders α, each with the values E_α(−zᵅ) at the times z of [`TIMES`], computed with mpmath 1.4.1 at 50 digits. Up to z =
    /// 300 the values are sums of the defining series, with the additional digits that cancellation requires. For larger z they
    /// are sums of the asymptotic series.
    const COMPUTED: [(f64, [f64; 9]); 6] = [
        (
            0.1,
            [
                0.7906097703920939,
                0.6537859211520186,
                0.5432523566546027,
                0.4855644643110821,
                0.4282562822896716,
                0.3957953247791241,
                0.3917428674737609,
                0.3205335945928398,
                0.1908671558502618,
            ],
        ),
        (
            0.3,
            [
                0.9826174875599313,
                0.875594681943097,
                0.6320805779499665,
                0.4565944083296907,
                0.2907394319085957,
                0.2130705051520282,
                0.2044201574078135,
                0.0900850991795513,
                0.01209693774299433,
            ],
        ),
        (
            0.5,
            [
                0.9988726200811514,
                0.9652942200040563,
                0.7235784384776155,
                0.427583576155807,
                0.1705777183259727,
                0.09036404494212345,
                0.08319946569357137,
                0.01783233388854205,
                0.0005641893014533876,
            ],
        ),
        (
            0.7,
            [
                0.999930563357974,
                0.9913086088004852,
                0.8091590410230899,
                0.3996119781155994,
                0.07736295200035549,
                0.02788110144545577,
                0.02460049548407939,
                0.002672220801867773,
                2.10922541786283e-05,
            ],
        ),
        (
            0.9,
            [
                0.9999958606736886,
                0.9979277905012597,
                0.8780961230255849,
                0.3760660214246419,
                0.01725937951363121,
                0.004253767021202445,
                0.003617309039977477,
                0.0002104263244703049,
                4.184679412257419e-07,
            ],
        ),
        (
            0.99,
            [
                0.9999988470198187,
                0.9989245601714793,
                0.9023925487647493,
                0.3685483180603396,
                0.001399871698424114,
                0.0002905575448804197,
                0.0002435144763838032,
                1.079916930701048e-05,
                1.154708205802149e-08,
            ],
        ),
    ];

    #[test]
    fn equals_values_computed_at_fifty_digits() {
        for (order, row) in COMPUTED {
            for (z, expected) in TIMES.into_iter().zip(row) {
                let found = mittag_leffler(order, z.powf(order));
                assert!((found - expected).abs() < 1e-12, "{order} {z}: {found:e} {expected:e}");
                assert!((found / expected - 1.0).abs() < 1e-8, "{order} {z}: {found:e} {expected:e}");
            }
        }
    }

    /// Checks E_{½}(−x) = e^{x²} erfc(x) against ten decimals of Abramowitz and Stegun (1964), Table 7.1: erf(½) = 0.5204998778,
    /// erf(1) = 0.8427007929, erf(2) = 0.9953222650.
    #[test]
    fn equals_published_values_of_the_error_function() {
        for (x, erf) in [(0.5_f64, 0.5204998778), (1.0, 0.8427007929), (2.0, 0.9953222650)] {
            let growth = (x * x).exp();
            assert!((mittag_leffler(0.5, x) - growth * (1.0 - erf)).abs() < 0.6e-10 * growth, "{x}");
        }
    }

    #[test]
    fn is_an_exponential_at_order_one_and_continuous_there() {
        for x in [0.0, 1e-6, 0.4, 3.0, 39.0] {
            assert_eq!(mittag_leffler(1.0, x), (-x).exp());
            assert!((mittag_leffler(1.0 - 1e-13, x) - (-x).exp()).abs() < 1e-12, "{x}");
        }
        assert_eq!(mittag_leffler(0.7, f64::INFINITY), 0.0);
        assert!((mittag_leffler(0.7, 0.0) - 1.0).abs() < 1e-12);
        assert!(
            mittag_leffler(1.2, 1.0).is_nan()
                && mittag_leffler(0.0, 1.0).is_nan()
                && mittag_leffler(0.5, -1.0).is_nan()
        );
    }

    /// Returns ∫ f over [a, b] by Simpson's rule. The interval is halved until the result changes by less than `tolerance`.
    fn adaptive_simpson(f: &dyn Fn(f64) -> f64, a: f64, b: f64, tolerance: f64) -> f64 {
        let middle = 0.5 * (a + b);
        let rule = |a: f64, b: f64| (b - a) / 6.0 * (f(a) + 4.0 * f(0.5 * (a + b)) + f(b));
        let (whole, halves) = (rule(a, b), rule(a, middle) + rule(middle, b));
        if (whole - halves).abs() < 15.0 * tolerance || b - a < 1e-7 {
            return halves + (halves - whole) / 15.0;
        }
        adaptive_simpson(f, a, middle, 0.5 * tolerance) + adaptive_simpson(f, middle, b, 0.5 * tolerance)
    }

    /// Compares the function with an adaptive quadrature of E_α(−z^α) = ∫ (sin απ/π) e^{−zeᵘ}/(e^{αu} + 2 cos απ + e^{−αu}) du.
    /// The quadrature uses neither the contour nor the series of the function.
    #[test]
    fn equals_an_independent_quadrature_from_1e_minus_6_to_1e6() {
        for order in [0.31_f64, 0.47, 0.62, 0.78, 0.89, 0.97, 0.999] {
            for power in -6..=6 {
                let z = 10_f64.powi(power) * 1.7;
                let density = |u: f64| {
                    let poles = (0.5 * order * u).sinh().powi(2) + (0.5 * PI * (1.0 - order)).sin().powi(2);
                    (PI * (1.0 - order)).sin() / (4.0 * PI * poles) * (-z * u.exp()).exp()
                };
                // Below the lower end the density is (sin απ/π) e^{αu}. Above the upper end e^{−zeᵘ} is negligible.
                let cells = (-90..90).map(|cell| (f64::from(cell), f64::from(cell + 1)));
                let inside: f64 = cells.map(|(a, b)| adaptive_simpson(&density, a, b, 1e-13)).sum();
                let expected = inside + (PI * order).sin() / (PI * order) * (-order * 90.0).exp();
                let found = mittag_leffler(order, z.powf(order));
                assert!((found - expected).abs() < 1e-9, "{order} {z}: {found:e} {expected:e}");
            }
        }
    }
}
