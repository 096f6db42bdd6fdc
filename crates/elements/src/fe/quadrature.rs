//! Gauss quadrature rules on the reference hexahedron and tetrahedron.

/// A quadrature point: reference coordinates and weight.
pub(super) type QuadraturePoint = ([f64; 3], f64);

/// The four-point Gauss–Legendre rule on [−1, 1]: each point with its weight.
pub(super) fn line() -> [(f64, f64); 4] {
    let (mean, root) = (3.0_f64 / 7.0, 2.0 / 7.0 * (6.0_f64 / 5.0).sqrt());
    let (inner, outer) = ((mean - root).sqrt(), (mean + root).sqrt());
    let (w_inner, w_outer) = ((18.0 + 30.0_f64.sqrt()) / 36.0, (18.0 - 30.0_f64.sqrt()) / 36.0);
    [(-outer, w_outer), (-inner, w_inner), (inner, w_inner), (outer, w_outer)]
}

/// Gauss–Legendre product rule on the cube [−1, 1]³ with four points per direction, exact to degree
/// 7 in each coordinate.
///
/// Three points per direction suffice on straight elements. The fourth preserves the convergence
/// order on curved ones.
pub(super) fn hexahedron() -> Vec<QuadraturePoint> {
    let line = line();
    let mut points = Vec::with_capacity(64);
    for (z, wz) in line {
        for (y, wy) in line {
            for (x, wx) in line {
                points.push(([x, y, z], wx * wy * wz));
            }
        }
    }
    points
}

/// Gauss–Legendre product rule collapsed onto the unit tetrahedron: 4³ points, exact to total
/// degree 5.
///
/// It uses four Gauss–Legendre points per direction. The weights contain the Jacobian of the
/// collapse, so that no table is needed. Tests check the volume and all quartic monomials.
pub(super) fn tetrahedron() -> Vec<QuadraturePoint> {
    hexahedron()
        .into_iter()
        .map(|([a, b, c], w)| {
            let [u, v, t] = [a, b, c].map(|r| 0.5 * (1.0 + r));
            // Duffy's map of the cube [0, 1]³ to the tetrahedron: x = u, y = v (1 − u), z = t
            // (1 − u)(1 − v).
            let point = [u, v * (1.0 - u), t * (1.0 - u) * (1.0 - v)];
            (point, w / 8.0 * (1.0 - u) * (1.0 - u) * (1.0 - v))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn factorial(n: i32) -> f64 {
        (1..=n).map(f64::from).product()
    }

    #[test]
    fn monomials_are_integrated_exactly() {
        for (i, j, k) in [(0, 0, 0), (1, 0, 0), (0, 2, 1), (2, 2, 0), (1, 1, 2), (4, 0, 0), (0, 0, 4)] {
            let integral = |points: Vec<QuadraturePoint>| -> f64 {
                points.iter().map(|([x, y, z], w)| w * x.powi(i) * y.powi(j) * z.powi(k)).sum()
            };
            let exact_tetrahedron = factorial(i) * factorial(j) * factorial(k) / factorial(i + j + k + 3);
            assert!((integral(tetrahedron()) - exact_tetrahedron).abs() < 1e-15);
            let line = |n: i32| if n % 2 == 0 { 2.0 / f64::from(n + 1) } else { 0.0 };
            assert!((integral(hexahedron()) - line(i) * line(j) * line(k)).abs() < 1e-14);
        }
    }
}
