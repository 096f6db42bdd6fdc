//! Polynomials on [−1, 1]: Gauss rules, Lagrange polynomials at the Gauss–Lobatto nodes, and
//! Legendre polynomials.

/// Value and derivative at x of the Legendre polynomial of this degree.
pub(in crate::fe) fn legendre(degree: usize, x: f64) -> (f64, f64) {
    let (mut before, mut now, mut slope_before, mut slope) = (0.0, 1.0, 0.0, 0.0);
    for k in 0..degree {
        let k = k as f64;
        let next = ((2.0 * k + 1.0) * x * now - k * before) / (k + 1.0);
        // The recurrence P′ₖ₊₁ = P′ₖ₋₁ + (2k + 1) Pₖ also holds at x = ±1.
        let next_slope = slope_before + (2.0 * k + 1.0) * now;
        (before, now, slope_before, slope) = (now, next, slope, next_slope);
    }
    (now, slope)
}

/// Finds a root by Newton's method from a good first guess `x`. `step` returns the Newton
/// correction.
fn root(mut x: f64, step: impl Fn(f64) -> f64) -> f64 {
    for _ in 0..50 {
        let dx = step(x);
        x -= dx;
        if dx.abs() < 1e-16 {
            break;
        }
    }
    x
}

/// Points and weights of the Gauss–Legendre rule with n points, exact to degree 2n − 1.
pub(in crate::fe) fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    let point = |i: usize| {
        let guess = -(std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
        let x = root(guess, |x| {
            let (p, dp) = legendre(n, x);
            p / dp
        });
        let (_, dp) = legendre(n, x);
        (x, 2.0 / ((1.0 - x * x) * dp * dp))
    };
    (0..n).map(point).collect()
}

/// Gauss–Lobatto nodes, `order` + 1 in number: ±1 and the extrema of the Legendre polynomial of
/// degree `order`.
pub(in crate::fe) fn gauss_lobatto(order: usize) -> Vec<f64> {
    let n = order as f64;
    let node = |i: usize| match i {
        0 => -1.0,
        i if i == order => 1.0,
        i => root(-(std::f64::consts::PI * i as f64 / n).cos(), |x| {
            let (p, dp) = legendre(order, x);
            // The second derivative follows from Legendre's equation: (1 − x²) P″ = 2x
            // P′ − n(n + 1) P.
            dp * (1.0 - x * x) / (2.0 * x * dp - n * (n + 1.0) * p)
        }),
    };
    (0..=order).map(node).collect()
}

/// Value and derivative at x of each node's Lagrange polynomial. They are computed as products
/// instead of quotients, because x may be a node.
pub(in crate::fe) fn lagrange(nodes: &[f64], x: f64) -> Vec<(f64, f64)> {
    let others =
        |skip: &[usize]| -> f64 { (0..nodes.len()).filter(|m| !skip.contains(m)).map(|m| x - nodes[m]).product() };
    (0..nodes.len())
        .map(|j| {
            let scale: f64 = (0..nodes.len()).filter(|&m| m != j).map(|m| nodes[j] - nodes[m]).product();
            let slope: f64 = (0..nodes.len()).filter(|&k| k != j).map(|k| others(&[j, k])).sum();
            (others(&[j]) / scale, slope / scale)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_integrate_and_bases_differentiate_polynomials_exactly() {
        for order in 2..=14 {
            let (nodes, degree) = (gauss_lobatto(order), order as i32);
            for (x, _) in gauss_legendre(order + 3) {
                let functions = lagrange(&nodes, x);
                let interpolated = functions.iter().zip(&nodes).map(|((l, _), node)| l * node.powi(degree));
                assert!((interpolated.sum::<f64>() - x.powi(degree)).abs() < 1e-13, "order {order}");
                let slope = functions.iter().zip(&nodes).map(|((_, dl), node)| dl * node.powi(degree));
                let exact = f64::from(degree) * x.powi(degree - 1);
                assert!((slope.sum::<f64>() - exact).abs() < 1e-11, "order {order}");
            }
            let integral: f64 = gauss_legendre(order).iter().map(|(x, w)| w * x.powi(2 * degree - 2)).sum();
            assert!((integral - 2.0 / f64::from(2 * degree - 1)).abs() < 1e-14, "order {order}");
        }
    }
}
